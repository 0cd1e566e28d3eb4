/* Couple, rigid: the rigid bodies as a participant of the step. Where they are predicted to be, which of their
   velocities are unknown, their rows of the system, and where they go. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "bodies/local.h"
#include "bodies/mass.h"

static PetscBool is_free(Couple c, PetscInt k, PetscInt s)
{
  return BodiesIsFree(c->bodies, k, s < c->loc->dim ? s : 3);
}

/* ---- geometry ---- */

PetscErrorCode CoupleSetReferencePoint(Couple c, PetscInt k)
{
  PetscReal arm[3];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetArm(c->bodies, k, c->rigid.q[k], arm));
  for (PetscInt a = 0; a < 3; a++) c->rigid.P[k][a] = c->rigid.X[k][a] - arm[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* With explicit coupling, what is free is drawn where it is, and the prescribed part where it will be: prescribed
   bodies are the same under both couplings. */
static PetscErrorCode predict_bodies(Couple c, void *data)
{
  PetscReal angle;

  PetscFunctionBeginUser;
  (void)data;
  PetscCall(BodiesSetTime(c->bodies, c->step->time - c->step->dt));
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscCall(
      BodiesPredict(c->bodies, k, c->step->dt, c->implicit ? c->step->order : 0, c->rigid.X[k], c->rigid.q[k], &angle));
    PetscCall(CoupleSetReferencePoint(c, k));
  }
  PetscCall(IndicatorIsCurrent(c->indicator, c->rigid.X, c->rigid.q, c->step->ct,
                               &c->method.current)); /* the strength of a penalty goes by c_t */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Which rigid velocities are unknown; values of the others, and first guesses */
static PetscErrorCode set_rigid_velocities(Couple c)
{
  PetscReal ratio;

  PetscFunctionBeginUser;
  ratio = c->step->dt_old > 0 ? c->step->dt / c->step->dt_old : 0;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal u[3], w[3];

    PetscCall(BodiesGetPrescribedVelocity(c->bodies, k, c->step->time, u, w));
    c->rigid.unknown[k] = 0;
    for (PetscInt i = 0; i < c->nr; i++) {
      PetscReal now, old;

      CoupleGetHistory(c, k, i, &now, &old);
      if (c->implicit && is_free(c, k, i)) c->rigid.unknown[k] |= 1 << i;
      c->rigid.U[k * c->nr + i] = (c->rigid.unknown[k] >> i) & 1
                                  ? (c->step->order == 2 ? now + ratio * (now - old) : now)
                                  : RigidValue(c->loc->dim, u, w, i);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocities that the conditions prescribe, but for nodes on the surface of or inside a body that passes through a
   side of the domain: these belong to the body. Elsewhere walls win over bodies. */
static PetscErrorCode set_boundary(Couple c, const PetscInt node_body[], const unsigned char fixed[],
                                   const PetscReal value[])
{
  unsigned char *free_fixed;

  PetscFunctionBeginUser;
  if (!c->method.sides_move) {
    PetscCall(ConstraintSetBoundary(c->constraint, fixed, value));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscMalloc1(c->loc->nnode_all, &free_fixed));
  for (PetscInt i = 0; i < c->loc->nnode_all; i++)
    free_fixed[i] = node_body[i] >= 0 && CoupleIsInactiveInside(c, node_body[i]) ? 0 : fixed[i];
  PetscCall(ConstraintSetBoundary(c->constraint, free_fixed, value));
  PetscCall(PetscFree(free_fixed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inertia D = c_t (rho_s - rho_i) (Vol; I) and right-hand side (rho_s - rho_i) (Vol; I) d(U) + (rho_s - rho_f) Vol g
   + contact + load of the rigid rows, rho_i: density of the fluid inside. Known velocities that share an inertia
   with unknown ones (a pivot that moves) count on the right. */
static PetscErrorCode fill_rigid_rows(Couple c)
{
  const PetscInt nr = c->nr;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal excess = c->s->density[k] - CoupleInnerDensity(c, k);
    PetscReal       M[36], K[36], *g = c->rigid.g + k * nr, force[3], torque[3], inside[6], now[6], old[6], momentum[6];

    PetscCall(RigidGetMass(c->bodies, k, c->rigid.q[k], M));
    PetscCall(BodiesGetLoadAt(c->bodies, k, CoupleLoadTime(c), c->par->density, c->par->gravity, force, torque));
    for (PetscInt a = 0; a < 3; a++) {
      force[a] += c->s->contact_force[k][a];
      torque[a] += c->s->contact_torque[k][a];
    }
    PetscCall(RigidReduceForce(c->bodies, k, c->rigid.q[k], force, torque, g));
    PetscCall(RigidInteriorForce(c, k, inside));
    for (PetscInt i = 0; i < nr; i++) CoupleGetHistory(c, k, i, &now[i], &old[i]);
    PetscCall(CoupleHistory(c, k, M, now, old, momentum));
    for (PetscInt i = 0; i < nr; i++) {
      g[i] += inside[i] + excess * momentum[i];
      for (PetscInt j = 0; j < nr; j++) {
        c->rigid.D[(k * nr + i) * nr + j] = c->step->ct * excess * M[i * nr + j];
        if (!((c->rigid.unknown[k] >> j) & 1)) g[i] -= c->rigid.D[(k * nr + i) * nr + j] * c->rigid.U[k * nr + j];
      }
    }
    if (CoupleConstrainAxes(c, k, M, K))
      for (PetscInt i = 0; i < nr * nr; i++) c->rigid.D[k * nr * nr + i] += K[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_rows(Couple c, void *data)
{
  const unsigned char *fixed;
  const PetscInt      *node_body;
  const PetscReal     *value;

  PetscFunctionBeginUser;
  (void)data;
  PetscCall(ConditionsGetValues(FlowConditions(c->flow), &fixed, &value));
  PetscCall(IndicatorGetNodes(c->indicator, &node_body, NULL, NULL));
  PetscCall(set_rigid_velocities(c));
  PetscCall(set_boundary(c, node_body, fixed, value));
  if (!c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(
    ConstraintSetBodies(c->constraint, node_body, c->rigid.P, c->rigid.unknown, c->rigid.U, &c->method.rows_changed));
  PetscCall(fill_rigid_rows(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_forces(Couple c, void *data)
{
  PetscFunctionBeginUser;
  (void)data;
  if (c->s->nall) PetscCall(CoupleForceOnBodies(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode balance_bodies(Couple c, void *data, const FlowDiagnostics *d, CoupleBalance *b)
{
  PetscFunctionBeginUser;
  (void)data;
  PetscCall(CoupleBalanceBodies(c, d, b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode power_of_bodies(Couple c, void *data, CouplePower *w)
{
  PetscFunctionBeginUser;
  (void)data;
  PetscCall(CouplePowerOfBodies(c, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- advancing ---- */

/* Velocities and positions of the bodies at the end of the step; bodies that stand still are left alone */
static PetscErrorCode advance_bodies(Couple c)
{
  BodyState *s = c->s;
  PetscBool  still;

  PetscFunctionBeginUser;
  PetscCall(BodiesAreStill(c->bodies, &still));
  if (still) {
    PetscCall(BodiesSetTime(c->bodies, c->step->time));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscLogEventBegin(TB_ADVANCE, 0, 0, 0, 0));
  if (c->implicit) {
    for (PetscInt k = 0; k < s->n; k++) {
      PetscReal u[3] = {0}, w[3] = {0};

      for (PetscInt i = 0; i < c->nr; i++) *RigidComponent(c->loc->dim, u, w, i) = c->rigid.U[k * c->nr + i];
      PetscCall(BodiesStepVelocity(c->bodies, k, u, w));
    }
    PetscCall(BodiesAdvancePosition(c->bodies, c->step->dt, c->step->order == 2 ? 0.5 : 1));
    for (PetscInt k = 0; k < s->n; k++) PetscCall(BodiesRelease(c->bodies, k, c->par->density, c->par->gravity));
  } else PetscCall(CoupleAdvanceExplicitly(c));
  PetscCall(PetscLogEventEnd(TB_ADVANCE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode advance_rigid(Couple c, void *data)
{
  PetscFunctionBeginUser;
  (void)data;
  PetscCall(advance_bodies(c));
  PetscCall(PetscArraycpy(c->rigid.U_older, c->rigid.U_old, c->s->n * c->nr));
  PetscCall(PetscArraycpy(c->rigid.U_old, c->rigid.U, c->s->n * c->nr));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode visit_rigid(Couple c, void *data, State state)
{
  BodyRows rows;

  PetscFunctionBeginUser;
  (void)data;
  PetscCall(BodiesBeginRows(c->bodies, &rows));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "U_old", c->nr, c->rigid.U_old));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "U_older", c->nr, c->rigid.U_older));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "du_old", 3, c->rigid.du_old));
  PetscCall(BodiesVisitIntegers(c->bodies, &rows, state, "growth", c->rigid.growth));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "force_old", 6, c->rigid.force_old));
  PetscCall(BodiesEndRows(&rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_rigid(Couple c, void *data)
{
  CoupleRigid *r       = &c->rigid;
  void **const array[] = {(void **)&r->U_old,     (void **)&r->U_older, (void **)&r->du_old, (void **)&r->growth,
                          (void **)&r->force_old, (void **)&r->X,       (void **)&r->q,      (void **)&r->P,
                          (void **)&r->unknown,   (void **)&r->U,       (void **)&r->D,      (void **)&r->g,
                          (void **)&r->residual};

  PetscFunctionBeginUser;
  (void)data;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(array); i++) PetscCall(BodiesDetach(c->bodies, array[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant RIGID = {.name    = "rigid",
                                        .prepare = predict_bodies,
                                        .rows    = set_rows,
                                        .force   = find_forces,
                                        .balance = balance_bodies,
                                        .energy  = power_of_bodies,
                                        .advance = advance_rigid,
                                        .visit   = visit_rigid,
                                        .destroy = destroy_rigid};

/* Arrays per local body, zeros */
static PetscErrorCode attach_arrays(Couple c)
{
  const size_t real = sizeof(PetscReal), slots = (size_t)c->nr * sizeof(PetscReal);
  CoupleRigid *r = &c->rigid;

  PetscFunctionBeginUser;
  PetscCall(BodiesAttach(c->bodies, slots, (void **)&r->U_old));
  PetscCall(BodiesAttach(c->bodies, slots, (void **)&r->U_older));
  PetscCall(BodiesAttach(c->bodies, 3 * real, (void **)&r->du_old));
  PetscCall(BodiesAttach(c->bodies, sizeof(PetscInt), (void **)&r->growth));
  PetscCall(BodiesAttach(c->bodies, 6 * real, (void **)&r->force_old));
  PetscCall(BodiesAttachWork(c->bodies, 3 * real, (void **)&r->X));
  PetscCall(BodiesAttachWork(c->bodies, 4 * real, (void **)&r->q));
  PetscCall(BodiesAttachWork(c->bodies, 3 * real, (void **)&r->P));
  PetscCall(BodiesAttachWork(c->bodies, sizeof(PetscInt), (void **)&r->unknown));
  PetscCall(BodiesAttachWork(c->bodies, slots, (void **)&r->U));
  PetscCall(BodiesAttachWork(c->bodies, (size_t)c->nr * slots, (void **)&r->D));
  PetscCall(BodiesAttachWork(c->bodies, slots, (void **)&r->g));
  PetscCall(BodiesAttachWork(c->bodies, slots, (void **)&r->residual));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Before the first step bodies have always moved as they do at its beginning */
static PetscErrorCode set_history(Couple c)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal u[3], w[3];

    PetscCall(BodiesGetPrescribedVelocity(c->bodies, k, 0, u, w));
    for (PetscInt i = 0; i < c->nr; i++)
      c->rigid.U_old[k * c->nr + i] = c->rigid.U_older[k * c->nr + i] = RigidValue(c->loc->dim, u, w, i);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAddRigid(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(attach_arrays(c));
  PetscCall(set_history(c));
  PetscCall(CoupleAddParticipant(c, &RIGID, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}
