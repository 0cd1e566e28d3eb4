/* Bodies, the state: what everybody asks of it, and how it is written. Below all other files of the room. */
#include "compat.h"
#include "impl.h"
#include "subdomains.h"
#include "base/algebra.h"
#include "bodies/local.h"

PetscErrorCode BodiesGetState(Bodies b, BodyState **state)
{
  PetscFunctionBeginUser;
  *state = &b->view;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetArrays(Bodies b, BodyArrays **arrays)
{
  PetscFunctionBeginUser;
  *arrays = &b->state;
  PetscFunctionReturn(PETSC_SUCCESS);
}

MPI_Comm BodiesComm(Bodies b)
{
  return b->subdomains ? b->subdomains->comm : PETSC_COMM_SELF;
}

PetscErrorCode BodiesSetTime(Bodies b, PetscReal time)
{
  PetscFunctionBeginUser;
  b->state.time = time;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesWriteForces(Bodies b, PetscReal (**force)[3], PetscReal (**torque)[3])
{
  PetscFunctionBeginUser;
  *force  = b->state.force;
  *torque = b->state.torque;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesSetVelocity(Bodies b, PetscInt k, const PetscReal u[3], const PetscReal w[3])
{
  PetscFunctionBeginUser;
  if (u) PetscCall(PetscArraycpy(b->state.u[k], u, 3));
  if (w) PetscCall(PetscArraycpy(b->state.w[k], w, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- degrees of freedom ---- */

PetscBool BodiesIsFree(Bodies b, PetscInt k, PetscInt d)
{
  const PetscInt bit = d < 3 ? BODY_FREE_X << d : BODY_FREE_ROTATION;

  return (PetscBool)((BodiesGetGroup(&b->view, k)->free & bit) && !(d == 3 && b->state.stopped[k]) &&
                     !b->state.removed[k] && !b->fixed);
}

PetscErrorCode BodiesSetFixed(Bodies b, PetscBool fixed)
{
  PetscFunctionBeginUser;
  b->fixed = fixed;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesRemove(Bodies b, PetscInt k)
{
  BodyArrays *s = &b->state;

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  s->removed[k] = PETSC_TRUE;
  s->gap[k]     = PETSC_MAX_REAL;
  for (PetscInt a = 0; a < 3; a++) {
    s->u[k][a] = s->w[k][a] = s->u_old[k][a] = s->w_old[k][a] = 0;
    s->contact_force[k][a] = s->contact_torque[k][a] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void keep_along(const PetscReal e[3], PetscReal v[3])
{
  const PetscReal along = dot3(e, v);

  for (PetscInt a = 0; a < 3; a++) v[a] = along * e[a];
}

void BodiesKeepAxes(BodyState *s, PetscInt k, PetscReal u[3], PetscReal w[3])
{
  const Motion *m = &BodiesGetGroup(s, k)->motion;

  if (u && m->has_slide) keep_along(m->slide, u);
  if (w && m->has_hinge) keep_along(m->hinge, w);
}

PetscErrorCode BodiesStepVelocity(Bodies b, PetscInt k, const PetscReal u[3], const PetscReal w[3])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(b->state.u_old[k], b->state.u[k], 3));
  PetscCall(PetscArraycpy(b->state.w_old[k], b->state.w[k], 3));
  PetscCall(BodiesSetVelocity(b, k, u, w));
  BodiesKeepAxes(&b->view, k, b->state.u[k], b->state.w[k]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- mass ---- */

PetscErrorCode BodiesGetVolume(Bodies b, PetscInt k, PetscReal *volume)
{
  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  *volume = BodiesVolume(&b->view, k);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* R t R^T */
static void rotate_tensor(const PetscReal q[4], const PetscReal t[6], PetscReal out[6])
{
  const PetscInt row[6] = {0, 1, 2, 0, 0, 1}, col[6] = {0, 1, 2, 1, 2, 2};
  PetscReal      R[9];

  RotationMatrix(q, R);
  for (PetscInt k = 0; k < 6; k++) {
    PetscReal tr[3];

    apply_tensor(t, R + 3 * col[k], tr); /* t times column col of R^T */
    out[k] = R[3 * row[k]] * tr[0] + R[3 * row[k] + 1] * tr[1] + R[3 * row[k] + 2] * tr[2];
  }
}

PetscErrorCode BodiesGetInertia(Bodies b, PetscInt k, const PetscReal q[], PetscBool per_density, PetscReal inertia[6])
{
  const BodyGroup *g;
  PetscReal        scale;

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  g     = BodiesGetGroup(&b->view, k);
  scale = (per_density ? 1 : b->state.density[k]) * PetscPowRealInt(b->state.scale[k], b->state.dim + 2);
  PetscCall(PetscArrayzero(inertia, 6));
  if (b->state.dim == 2) inertia[2] = g->mass.inertia[2];
  else rotate_tensor(q ? q : b->state.q[k], g->mass.inertia, inertia);
  for (PetscInt i = 0; i < 6; i++) inertia[i] *= scale;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetArm(Bodies b, PetscInt k, const PetscReal q[], PetscReal arm[3])
{
  const BodyGroup *g = BodiesGetGroup(&b->view, k);

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(arm, 3));
  if (g->motion.has_pivot) {
    PetscReal R[9];

    RotationMatrix(q ? q : b->state.q[k], R);
    for (PetscInt a = 0; a < 3; a++)
      arm[a] = b->state.scale[k] * (R[3 * a] * g->arm[0] + R[3 * a + 1] * g->arm[1] + R[3 * a + 2] * g->arm[2]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the frame ---- */

PetscErrorCode BodiesStartFrame(Bodies b, const PetscReal period[3])
{
  PetscFunctionBeginUser;
  b->state.travels = PETSC_TRUE;
  for (PetscInt a = 0; a < b->state.dim; a++) b->period[a] = period[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesSetFrame(Bodies b, const PetscReal next[3], const PetscReal velocity[3])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(b->state.frame_next, next, 3));
  PetscCall(PetscArraycpy(b->state.frame_u, velocity, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesAcceptFrame(Bodies b)
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(b->state.frame, b->state.frame_next, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- speed ---- */

PetscReal BodiesPointSpeed(BodyState *s, PetscInt k, const PetscReal u[3], const PetscReal w[3])
{
  PetscReal speed = 0;

  for (PetscInt d = 0; d < 3; d++) speed += PetscSqr(u[d] - s->frame_u[d]);
  return PetscSqrtReal(speed) + (BodiesGetDisc(s, k) > 0 ? 0 : BodiesGetRadius(s, k) * PetscSqrtReal(dot3(w, w)));
}

PetscReal BodiesFastestPoint(BodyState *s, PetscInt k, PetscReal r)
{
  PetscReal u[3], w[3];

  for (PetscInt d = 0; d < 3; d++) {
    u[d] = s->u[k][d] + r * (s->u[k][d] - s->u_old[k][d]);
    w[d] = s->w[k][d] + r * (s->w[k][d] - s->w_old[k][d]);
  }
  return BodiesPointSpeed(s, k, u, w);
}
