/* Couple, joints: loads on a body that change with its motion (bodies/joint.h: springs, dampers, moorings,
   expressions), in the rows of the system. Linear about the state before the step: at the time at which the rows hold,
   theta of the step later, the load is
     F0 - K dt (a U + b U_old) - C c (U - U_old),   a = theta s, b = theta (1 - s), c = theta,
   F0 that of the old place and velocity, so that K and C act as rows of the body do and no step is too long. The way of
   the body is that of BodiesAdvancePosition, s = 1/2 in steps of second order. A spring whose period the step does not
   see would ring with the step, undamped, and so would a damper under cn: as the frequency (the rate) times the step
   goes from STIFF_RESOLVED to STIFF_UNSEEN (base/stiff.h), a and c go to 1 and b to 1 - s: displacement and speed are
   gone after two steps (b = 0 would ring where the way is that of the mean speed, and lose a fifth a step), as those of
   bonds (contact/bondforce.c). */
#include "compat.h"
#include "impl.h"
#include "base/stiff.h"
#include "bodies/local.h"
#include "bodies/mass.h"

/* 0 .. 1: how little a step sees of the fastest change, from the largest K/M or C/M along a slot */
static PetscReal stiffness(Couple c, PetscInt k, const PetscReal M[], const PetscReal K[], PetscReal power)
{
  const PetscReal density = c->s->density[k] + c->par->density;
  PetscReal       max     = 0;

  for (PetscInt i = 0; i < c->nr * c->nr; i += c->nr + 1)
    if (M[i] > 0) max = PetscMax(max, K[i] / (density * M[i]));
  return StiffFraction(c->step->dt * PetscPowReal(max, power));
}

static PetscErrorCode add_loads(Couple c, PetscInt k)
{
  const PetscInt  nr    = c->nr;
  const PetscReal theta = c->step->theta, dt = c->step->dt;
  const PetscReal middle = c->step->order == 2 ? 0.5 : 1;
  PetscReal       M[36], K[36], C[36], *A, *b, stiff, next, before, damped;
  PetscBool       any;

  PetscFunctionBeginUser;
  A = c->rigid.joint + k * nr * (nr + 1);
  b = A + nr * nr;
  PetscCall(PetscArrayzero(A, nr * (nr + 1)));
  PetscCall(BodiesGetResistance(c->bodies, k, CoupleLoadTime(c), dt, K, C, &any));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(RigidGetMass(c->bodies, k, c->rigid.q[k], M));
  stiff  = stiffness(c, k, M, K, 0.5);
  next   = dt * ((1 - stiff) * theta * middle + stiff);
  before = dt * ((1 - stiff) * theta + stiff) * (1 - middle);
  stiff  = stiffness(c, k, M, C, 1);
  damped = (1 - stiff) * theta + stiff;
  for (PetscInt i = 0; i < nr; i++)
    for (PetscInt j = 0; j < nr; j++) {
      const PetscInt e = i * nr + j;
      PetscReal      old, older;

      CoupleGetHistory(c, k, j, &old, &older);
      A[e] = next * K[e] + damped * C[e];
      b[i] += (damped * C[e] - before * K[e]) * old;
      if (!((c->rigid.unknown[k] >> j) & 1)) c->rigid.g[k * nr + i] -= A[e] * c->rigid.U[k * nr + j];
      c->rigid.D[k * nr * nr + e] += A[e];
    }
  for (PetscInt i = 0; i < nr; i++) c->rigid.g[k * nr + i] += b[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_joints(Couple c, void *data)
{
  PetscFunctionBeginUser;
  (void)data;
  for (PetscInt k = 0; k < c->s->n; k++) PetscCall(add_loads(c, k));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetJointForce(Couple c, PetscInt k, PetscReal out[])
{
  const PetscInt nr = c->nr;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(out, nr));
  if (!c->rigid.joint) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < nr; i++) {
    const PetscReal *A = c->rigid.joint + k * nr * (nr + 1);

    out[i] = A[nr * nr + i];
    for (PetscInt j = 0; j < nr; j++) out[i] -= A[i * nr + j] * c->rigid.U[k * nr + j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Couple c, void *data)
{
  PetscFunctionBeginUser;
  (void)data;
  PetscCall(BodiesDetach(c->bodies, (void **)&c->rigid.joint));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant JOINTS = {.name = "joints", .rows = add_joints, .destroy = destroy};

PetscErrorCode CoupleAddJoints(Couple c)
{
  PetscBool any = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < c->s->ngroups; g++)
    any = (PetscBool)(any || (c->s->group[g].free && BodiesGroupResists(&c->s->group[g])));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesAttachWork(c->bodies, (size_t)((c->nr + 1) * c->nr) * sizeof(PetscReal), (void **)&c->rigid.joint));
  PetscCall(CoupleAddParticipant(c, &JOINTS, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}
