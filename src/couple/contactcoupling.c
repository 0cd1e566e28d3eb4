/* Couple: forces of contact that are solved with the flow (contact/contact.h: ContactSpring). A spring that parts with
   the speed v = sum over its two bodies of row . U, row its unit force on the rigid slots of a body, is its value on
   the right of these rows and a tie of its rate in the matrix. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/array.h"
#include "bodies/local.h"
#include "bodies/mass.h"

struct _p_CoupleContact {
  PetscInt       n, capacity;
  ContactSpring *spring;      /* of CoupleSetContact */
  BodySpring    *body_spring; /* [n] */
  PetscReal     *force;       /* [n] on the right of the rigid rows: by prescribed velocities, then all */
};

PetscErrorCode CoupleSetContact(Couple c, PetscInt n, const ContactSpring spring[])
{
  CoupleContact t = c->contact_coupling;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(n, &t->capacity, &t->spring, sizeof(*t->spring), &t->body_spring, sizeof(*t->body_spring),
                         &t->force, sizeof(*t->force), NULL));
  if (n) PetscCall(PetscArraycpy(t->spring, spring, n));
  t->n = n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_pairs(Couple c, void *data)
{
  const struct _p_CoupleContact *t = (const struct _p_CoupleContact *)data;
  PetscInt                       n = 0, (*pair)[2];

  PetscFunctionBeginUser;
  if (!c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(t->n, &pair));
  for (PetscInt i = 0; i < t->n; i++) {
    if (t->spring[i].again) continue;
    pair[n][0]   = t->spring[i].i;
    pair[n++][1] = PetscMax(-1, t->spring[i].j);
  }
  PetscCall(ConstraintSetPairs(c->constraint, n, (const PetscInt(*)[2])pair));
  PetscCall(PetscFree(pair));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A spring with all of its rows */
static PetscErrorCode make_body_spring(Couple c, const ContactSpring *s, BodySpring *body_spring)
{
  PetscFunctionBeginUser;
  *body_spring = (BodySpring){.body = {s->i, PetscMax(-1, s->j)}, .stiffness = s->rate};
  for (PetscInt side = 0; side < 2; side++) {
    const PetscInt  k = body_spring->body[side];
    PetscReal       force[3], torque[3];
    const PetscReal none[3] = {0, 0, 0};

    if (k < 0) continue;
    for (PetscInt a = 0; a < 3; a++) force[a] = side ? -s->normal[a] : s->normal[a];
    cross(side ? s->rj : s->ri, force, torque);
    PetscCall(RigidReduceForce(c->bodies, k, c->rigid.q[k], s->turns ? none : force, s->turns ? force : torque,
                               body_spring->row[side]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Speed at which the bodies of a spring separate by their prescribed velocities, and by those that are solved for */
static PetscReal separation_speed(Couple c, const BodySpring *body_spring, PetscBool of_unknown)
{
  PetscReal speed = 0;

  for (PetscInt side = 0; side < 2; side++) {
    const PetscInt k = body_spring->body[side];

    for (PetscInt i = 0; i < c->nr && k >= 0; i++)
      if (of_unknown || !((c->rigid.unknown[k] >> i) & 1))
        speed += body_spring->row[side][i] * c->rigid.U[k * c->nr + i];
  }
  return speed;
}

/* To the right-hand side of the rigid rows */
static void add_force(Couple c, const BodySpring *body_spring, PetscReal force)
{
  for (PetscInt e = 0; e < 2 * c->nr; e++)
    if (body_spring->body[e / c->nr] >= 0)
      c->rigid.g[body_spring->body[e / c->nr] * c->nr + e % c->nr] += force * body_spring->row[e / c->nr][e % c->nr];
}

static PetscErrorCode add_body_springs(Couple c, void *data)
{
  CoupleContact t = (CoupleContact)data;

  PetscFunctionBeginUser;
  if (!c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < t->n; i++) {
    PetscCall(make_body_spring(c, &t->spring[i], &t->body_spring[i]));
    t->force[i] = t->spring[i].value - t->spring[i].rate * separation_speed(c, &t->body_spring[i], PETSC_FALSE);
    add_force(c, &t->body_spring[i], t->force[i]);
  }
  PetscCall(FlowSolverSetContactCoupling(c->solver, t->n, t->body_spring));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the forces came to, on the right of the rigid rows too */
static PetscErrorCode take_body_springs(Couple c, void *data)
{
  CoupleContact t = (CoupleContact)data;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < t->n; i++) {
    const PetscReal force = t->spring[i].value -
                            t->spring[i].rate * separation_speed(c, &t->body_spring[i], PETSC_TRUE);

    add_force(c, &t->body_spring[i], force - t->force[i]);
    t->force[i] = force;
  }
  PetscCall(BodiesUpdateGhosts(c->bodies, c->nr, c->rigid.g));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetContact(Couple c, const PetscReal *force[])
{
  PetscFunctionBeginUser;
  *force = c->contact_coupling->force;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Couple c, void *data)
{
  CoupleContact t = (CoupleContact)data;

  PetscFunctionBeginUser;
  PetscCall(PetscFree(t->spring));
  PetscCall(PetscFree(t->body_spring));
  PetscCall(PetscFree(t->force));
  PetscCall(PetscFree(c->contact_coupling));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant CONTACT_COUPLING = {.name    = "contact",
                                                   .prepare = set_pairs,
                                                   .rows    = add_body_springs,
                                                   .solved  = take_body_springs,
                                                   .destroy = destroy};

PetscErrorCode CoupleAddContact(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c->contact_coupling));
  PetscCall(CoupleAddParticipant(c, &CONTACT_COUPLING, c->contact_coupling));
  PetscFunctionReturn(PETSC_SUCCESS);
}
