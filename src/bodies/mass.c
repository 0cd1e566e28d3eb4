/* Rigid: see mass.h. */
#include "compat.h"
#include "impl.h"
#include "base/rigid.h"
#include "bodies/mass.h"

/* Space inertia of body k as a full 3 x 3 matrix per unit density */
static PetscErrorCode get_inertia(Bodies bodies, PetscInt k, const PetscReal q[], PetscInt dim, PetscReal J[3][3])
{
  PetscReal t[6];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetInertia(bodies, k, q, PETSC_TRUE, t));
  if (dim == 2) {
    PetscCall(PetscMemzero(J, 9 * sizeof(PetscReal)));
    J[2][2] = t[2];
  } else {
    J[0][0] = t[0];
    J[1][1] = t[1];
    J[2][2] = t[2];
    J[0][1] = J[1][0] = t[3];
    J[0][2] = J[2][0] = t[4];
    J[1][2] = J[2][1] = t[5];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* S [dim][nr - dim]: w x arm = S w; the velocity of the centre is that of the reference point plus S w */
static void get_spin(PetscInt dim, const PetscReal arm[3], PetscReal S[3][3])
{
  for (PetscInt a = 0; a < dim; a++) RigidSpinRow(dim, a, arm, S[a]);
}

PetscErrorCode RigidGetMass(Bodies bodies, PetscInt k, const PetscReal q[4], PetscReal M[])
{
  const PetscInt dim = bodies->view.dim, nr = RigidSize(dim);
  PetscReal      volume, J[3][3], arm[3], S[3][3];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetVolume(bodies, k, &volume));
  PetscCall(get_inertia(bodies, k, q, dim, J));
  for (PetscInt i = 0; i < nr * nr; i++) M[i] = 0;
  for (PetscInt a = 0; a < dim; a++) M[a * (nr + 1)] = volume;
  if (dim == 2) M[8] = J[2][2];
  else
    for (PetscInt a = 0; a < 9; a++) M[(3 + a / 3) * nr + 3 + a % 3] = J[a / 3][a % 3];
  if (!BodiesGetGroup(&bodies->view, k)->motion.has_pivot) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesGetArm(bodies, k, q, arm));
  get_spin(dim, arm, S);
  for (PetscInt b = 0; b < nr - dim; b++) {
    for (PetscInt a = 0; a < dim; a++) M[a * nr + dim + b] = M[(dim + b) * nr + a] = volume * S[a][b];
    for (PetscInt e = 0; e < nr - dim; e++)
      for (PetscInt a = 0; a < dim; a++) M[(dim + b) * nr + dim + e] += volume * S[a][b] * S[a][e];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RigidReduceForce(Bodies bodies, PetscInt k, const PetscReal q[4], const PetscReal force[3],
                                const PetscReal torque[3], PetscReal out[])
{
  const PetscInt dim = bodies->view.dim, nr = RigidSize(dim);
  PetscReal      arm[3], S[3][3];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetArm(bodies, k, q, arm));
  get_spin(dim, arm, S);
  for (PetscInt a = 0; a < dim; a++) out[a] = force[a];
  for (PetscInt b = 0; b < nr - dim; b++) {
    out[dim + b] = dim == 2 ? torque[2] : torque[b];
    for (PetscInt a = 0; a < dim; a++) out[dim + b] += S[a][b] * force[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RigidCentripetal(Bodies bodies, PetscInt k, const PetscReal q[4], const PetscReal rotation[],
                                PetscReal out[3])
{
  PetscReal w[3], arm[3], along, square;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) w[a] = bodies->view.dim == 3 ? rotation[a] : a == 2 ? rotation[0] : 0;
  PetscCall(BodiesGetArm(bodies, k, q, arm));
  along  = w[0] * arm[0] + w[1] * arm[1] + w[2] * arm[2];
  square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
  for (PetscInt a = 0; a < 3; a++) out[a] = along * w[a] - square * arm[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}
