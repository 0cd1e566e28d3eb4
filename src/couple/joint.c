/* Couple, joints: loads on a body that change with its motion (bodies/joint.h: springs, dampers, moorings, expressions),
   in the rows of the system. Linear about the state before the step: at the time at which the rows hold, theta of the
   step later, the load is
     F0 - K theta dt (s U + (1 - s) U_old) - theta C (U - U_old),
   F0 that of the old place and velocity, so that K and C act as rows of the body do and no step is too long. The way of
   the body is that of BodiesAdvancePosition, s = 1/2 in steps of second order. A spring whose period the step does not
   see would ring with the step, undamped: as its frequency times the step goes from RESOLVED to STIFF, s goes to 1. */
#include "compat.h"
#include "impl.h"
#include "bodies/mass.h"

#define RESOLVED 0.5
#define STIFF    2.

/* Share of the new velocity in the way, from the largest frequency along a slot */
static PetscReal implicitness(Couple c, PetscInt k, const PetscReal M[], const PetscReal K[])
{
  const PetscReal middle = c->step->order == 2 ? 0.5 : 1, density = c->s->density[k] + c->par->density;
  PetscReal       most = 0;

  for (PetscInt i = 0; i < c->nr * c->nr; i += c->nr + 1)
    if (M[i] > 0) most = PetscMax(most, K[i] / (density * M[i]));
  return middle + (1 - middle) * PetscClipInterval((c->step->dt * PetscSqrtReal(most) - RESOLVED) / (STIFF - RESOLVED), 0, 1);
}

PetscErrorCode CoupleAddJoint(Couple c, PetscInt k, const PetscReal M[])
{
  const PetscInt  nr    = c->nr;
  const PetscReal theta = c->step->theta, dt = c->step->dt;
  PetscReal       K[36], C[36], *A, *b, s;
  PetscBool       any;

  PetscFunctionBeginUser;
  if (!c->joint) PetscFunctionReturn(PETSC_SUCCESS);
  A = c->joint + k * nr * (nr + 1);
  b = A + nr * nr;
  PetscCall(PetscArrayzero(A, nr * (nr + 1)));
  PetscCall(BodiesGetResistance(c->bodies, k, CoupleLoadTime(c), dt, K, C, &any));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  s = implicitness(c, k, M, K);
  for (PetscInt i = 0; i < nr; i++)
    for (PetscInt j = 0; j < nr; j++) {
      const PetscInt  e   = i * nr + j;
      const PetscReal old = CoupleSlotBefore(c, k, j);

      A[e] = theta * (dt * s * K[e] + C[e]);
      b[i] += theta * (C[e] - dt * (1 - s) * K[e]) * old;
      if (!((c->unknown[k] >> j) & 1)) c->g[k * nr + i] -= A[e] * c->U[k * nr + j];
      c->D[k * nr * nr + e] += A[e];
    }
  for (PetscInt i = 0; i < nr; i++) c->g[k * nr + i] += b[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetJointForce(Couple c, PetscInt k, PetscReal out[])
{
  const PetscInt nr = c->nr;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(out, nr));
  if (!c->joint) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < nr; i++) {
    const PetscReal *A = c->joint + k * nr * (nr + 1);

    out[i] = A[nr * nr + i];
    for (PetscInt j = 0; j < nr; j++) out[i] -= A[i * nr + j] * c->U[k * nr + j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
