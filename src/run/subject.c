/* Subject: see subject.h. */
#include "compat.h"
#include "subject.h"
#include "bodies/local.h"

#define SMALL 0.02 /* of viscosity and inertia at the largest speed: forces and torques that are nearly nothing */

PetscErrorCode SubjectMeasure(const SimComponents *p, Measured *m)
{
  BodyState       *s;
  FlowDiagnostics  d;
  const PetscReal *u, *q;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(m, sizeof(*m)));
  PetscCall(BodiesGetState(p->bodies, &s));
  for (PetscInt k = 0; k < s->n; k++)
    for (PetscInt a = 0; a < 3 && s->own[k]; a++) {
      m->force[3 * s->number[k] + a]  = s->force[k][a];
      m->torque[3 * s->number[k] + a] = s->torque[k][a];
    }
  PetscCall(BodiesSum(p->bodies, 3 * s->nall, m->force));
  PetscCall(BodiesSum(p->bodies, 3 * s->nall, m->torque));
  PetscCall(CoupleGetSolution(p->couple, &u, &q));
  PetscCall(FlowDiagnose(p->flow, u, q, &d));
  m->energy = d.kinetic_energy;
  m->speed  = d.speed_max;
  for (PetscInt a = 0; a < 3; a++) m->velocity[a] = d.velocity[a]; /* whatever part of the bodies counts as fluid */
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal get_force(const Measured *m, PetscInt i)
{
  return m->force[i];
}

static PetscReal get_torque(const Measured *m, PetscInt i)
{
  return m->torque[i];
}

static PetscReal get_velocity(const Measured *m, PetscInt i)
{
  return m->velocity[i];
}

static PetscReal get_energy(const Measured *m, PetscInt i)
{
  (void)i;
  return m->energy;
}

/* The axis along which any of n/3 has its largest value */
static void find_largest(const Measured *m, PetscInt n, Subject *s)
{
  for (PetscInt i = 0; i < n; i++) {
    if (PetscAbsReal((*s->of)(m, i)) <= s->size) continue;
    s->size = PetscAbsReal((*s->of)(m, i));
    s->axis = i % 3;
  }
}

/* A force that viscosity and inertia make at the largest speed of the fluid, and the radius of the largest body */
static PetscErrorCode find_scale(const SimComponents *p, const Measured *m, PetscReal *force, PetscReal *radius)
{
  const FlowParameters *par;
  BodyState            *s;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(p->bodies, &s));
  PetscCall(FlowGetParameters(p->flow, &par));
  *radius = 0;
  for (PetscInt k = 0; k < s->n; k++) *radius = PetscMax(*radius, BodiesGetRadius(s, k));
  PetscCall(BodiesMax(p->bodies, 1, radius));
  *force = par->viscosity * m->speed * PetscPowRealInt(*radius, s->dim - 2);
  if (par->convection) *force += par->density * PetscSqr(m->speed) * PetscPowRealInt(*radius, s->dim - 1);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SubjectChoose(const SimComponents *p, const Measured *m, Subject *s)
{
  const FlowParameters *par;
  BodyState            *b;
  PetscReal             force = 0, radius = 0;
  PetscBool             driven = PETSC_FALSE;
  const char           *name   = "force";

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(p->bodies, &b));
  PetscCall(FlowGetParameters(p->flow, &par));
  PetscCall(find_scale(p, m, &force, &radius));
  for (PetscInt a = 0; a < 3; a++) driven = (PetscBool)(driven || par->force[a] != 0);
  if (driven) {
    name = "mean_velocity";
    *s   = (Subject){.of = get_velocity, .n = 1};
    find_largest(m, 3, s);
  } else {
    *s = (Subject){.of = get_force, .n = b->nall};
    find_largest(m, 3 * b->nall, s);
    if (s->size <= SMALL * force) {
      name = "torque";
      *s   = (Subject){.of = get_torque, .n = b->nall};
      find_largest(m, 3 * b->nall, s);
      if (s->size <= SMALL * force * radius) s->size = 0;
    }
  }
  (void)snprintf(s->name, sizeof(s->name), "%s_%c", name, (char)('x' + s->axis));
  if (s->size == 0) *s = (Subject){.of = get_energy, .n = 1, .size = m->energy, .name = "kinetic_energy"};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal SubjectValue(const Subject *s, const Measured *m, PetscInt i)
{
  return s->size > 0 ? (*s->of)(m, s->axis + 3 * i) / s->size : 0;
}
