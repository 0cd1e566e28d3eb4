/* Couple: energy of rigid bodies and the power of what acts on them from outside (CoupleGetPower). Costs one pass over
   the bodies: what prescribed nodes supply is known from the balance of momentum. And where the energy goes within
   (CoupleGetLosses): the equations of the step tested with the velocities in the middle of it. */
#include "compat.h"
#include "impl.h"
#include "flow/device.h"
#include "bodies/local.h"
#include "bodies/mass.h"

/* Is every degree of freedom of body k free or at rest? Others are moved by somebody outside. */
static PetscBool is_inside(Couple c, PetscInt k)
{
  for (PetscInt i = 0; i < c->nr; i++)
    if (!BodiesIsFree(c->bodies, k, i < c->loc->dim ? i : 3) && c->rigid.U[k * c->nr + i] != 0) return PETSC_FALSE;
  return PETSC_TRUE;
}

static PetscErrorCode add_body(Couple c, PetscInt k, CouplePower *w)
{
  const PetscInt   nr = c->nr;
  const PetscReal *U = c->rigid.U + k * nr, density = c->s->density[k], inside = CoupleInnerDensity(c, k);
  const PetscBool  free = is_inside(c, k);
  PetscReal        M[36], force[3], torque[3], g[6], joint[6], square = 0;

  PetscFunctionBeginUser;
  PetscCall(RigidGetMass(c->bodies, k, c->rigid.q[k], M));
  for (PetscInt i = 0; i < nr; i++)
    for (PetscInt j = 0; j < nr; j++) square += 0.5 * U[i] * M[i * nr + j] * U[j];
  w->size += density * square;
  w->energy += ((free ? density : 0) - inside) * square;
  PetscCall(BodiesGetLoad(c->bodies, k, c->par->density, c->par->gravity, force, torque));
  for (PetscInt a = 0; a < 3; a++) {
    force[a]  = free ? force[a] + c->s->contact_force[k][a] : -c->s->force[k][a];
    torque[a] = free ? torque[a] + c->s->contact_torque[k][a] : -c->s->torque[k][a];
  }
  PetscCall(RigidReduceForce(c->bodies, k, c->rigid.q[k], force, torque, g));
  PetscCall(CoupleGetJointForce(c, k, joint));
  for (PetscInt i = 0; i < nr; i++) w->power += (free ? g[i] + joint[i] : g[i]) * U[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CouplePowerOfBodies(Couple c, CouplePower *w)
{
  const PetscBool first = CoupleCountsFirst(c);
  CouplePower     own   = {.energy = first ? w->energy : 0, .power = first ? w->power : 0, .size = first ? w->size : 0};
  PetscReal       sum[3];

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++)
    if (c->s->own[k] && !c->s->removed[k] && !BodiesGetGroup(c->s, k)->body_fitted) PetscCall(add_body(c, k, &own));
  sum[0] = own.energy;
  sum[1] = own.power;
  sum[2] = own.size;
  PetscCall(BodiesSum(c->bodies, 3, sum));
  w->energy = sum[0];
  w->power  = sum[1];
  w->size   = sum[2];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- where it goes ---- */

/* v = theta u + (1 - theta) u^n, V likewise of the bodies */
static PetscErrorCode find_middle(Couple c, PetscReal v[], PetscReal V[])
{
  const PetscReal theta = c->step->theta;
  PetscReal      *u;

  PetscFunctionBeginUser;
  PetscCall(FlowTakeSolution(c->flow, c->field.u, c->field.p));
  PetscCall(FlowGetFields(c->flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < c->loc->nnode_all * c->loc->dim; i++) v[i] = theta * c->field.u[i] + (1 - theta) * u[i];
  for (PetscInt k = 0; k < c->s->n; k++)
    for (PetscInt i = 0; i < c->nr; i++) {
      PetscReal now, old;

      CoupleGetHistory(c, k, i, &now, &old);
      V[k * c->nr + i] = theta * c->rigid.U[k * c->nr + i] + (1 - theta) * now;
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* -v . G U - V . (G^T u - H U) of the penalty, to which the flow's terms are the rest (solve/penaltyterm.h) */
static PetscErrorCode power_of_springs(Couple c, const PetscReal v[], const PetscReal V[], PetscReal *power)
{
  const PetscInt n = c->s->n * c->nr;
  PetscReal     *penalty_force, *rigid_force, *still;

  PetscFunctionBeginUser;
  if (!c->method.terms) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc3(n, &penalty_force, n, &rigid_force, n, &still));
  PetscCall(PenaltyTermAddForce(c->method.terms, c->constraint, c->field.u, c->rigid.U, penalty_force));
  PetscCall(PenaltyTermAddForce(c->method.terms, c->constraint, v, still, rigid_force));
  for (PetscInt i = 0; i < n; i++) *power -= V[i] * penalty_force[i] + c->rigid.U[i] * rigid_force[i];
  PetscCall(PetscFree3(penalty_force, rigid_force, still));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* -p . B u: nothing but in cells between two surfaces, which give way (-flow_pressure_gap_compressibility) */
static PetscErrorCode power_of_gaps(Couple c, PetscReal *power)
{
  const PetscInt n = c->loc->ncell * (c->loc->dim + 1);
  PetscReal     *divergence;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &divergence));
  PetscCall(FlowDivergence(c->flow, c->field.u, divergence));
  for (PetscInt i = 0; i < n; i++) *power -= c->field.p[i] * divergence[i];
  PetscCall(PetscFree(divergence));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_losses_of_body(Couple c, PetscInt k, const PetscReal V[], CoupleLosses *w)
{
  const PetscInt  nr  = c->nr;
  const PetscReal own = is_inside(c, k) ? c->s->density[k] : 0, excess = own - CoupleInnerDensity(c, k);
  PetscReal       M[36], now[6], old[6], momentum[6], g[6];

  PetscFunctionBeginUser;
  PetscCall(RigidGetMass(c->bodies, k, c->rigid.q[k], M));
  for (PetscInt i = 0; i < nr; i++) CoupleGetHistory(c, k, i, &now[i], &old[i]);
  PetscCall(CoupleHistory(c, k, M, now, old, momentum));
  PetscCall(RigidReduceForce(c->bodies, k, c->rigid.q[k], c->s->contact_force[k], c->s->contact_torque[k], g));
  for (PetscInt i = 0; i < nr; i++) {
    for (PetscInt j = 0; j < nr; j++)
      w->inertia += excess * V[i] * c->step->ct * M[i * nr + j] * c->rigid.U[k * nr + j];
    w->inertia -= excess * V[i] * momentum[i];
    if (own <= 0) continue;
    w->contact += V[i] * g[i];
    w->counted += c->rigid.U[k * nr + i] * g[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetLosses(Couple c, CoupleLosses *w)
{
  FlowPower p;
  PetscReal boundary = 0, sum[3], *v, *V; /* sum: over bodies */

  PetscFunctionBeginUser;
  *w = (CoupleLosses){0};
  PetscCall(PetscMalloc2(c->loc->nnode_all * c->loc->dim, &v, c->s->n * c->nr, &V));
  PetscCall(find_middle(c, v, V));
  PetscCall(FlowGetPower(c->flow, c->field.u, v, &p));
  PetscCall(power_of_springs(c, v, V, &boundary));
  if (c->slip) PetscCall(CoupleAddSlipLoss(c, v, V, &boundary));
  PetscCall(power_of_gaps(c, &boundary));
  for (PetscInt k = 0; k < c->s->n; k++)
    if (c->s->own[k] && !c->s->removed[k] && !BodiesGetGroup(c->s, k)->body_fitted)
      PetscCall(add_losses_of_body(c, k, V + k * c->nr, w));
  PetscCall(PetscFree2(v, V));
  sum[0] = w->inertia;
  sum[1] = w->contact;
  sum[2] = w->counted;
  PetscCall(BodiesSum(c->bodies, 3, sum));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &boundary, 1, MPIU_REAL, MPIU_SUM, c->comm));
  *w = (CoupleLosses){.inertia  = p.inertia + sum[0],
                      .viscous  = p.viscous,
                      .boundary = p.terms + boundary,
                      .contact  = sum[1],
                      .counted  = sum[2]};
  CoupleEach(c, losses, w);
  PetscFunctionReturn(PETSC_SUCCESS);
}
