/* Solids: where the solids of a group start. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/opt.h"
#include "shape/material.h"

/* In space: -particle_<group>_quaternion, then turned by the angle about -particle_<group>_axis, as rigid bodies */
static PetscErrorCode read_turn(const char group[], PetscReal angle, PetscReal R[9])
{
  char      name[OPT_NAME];
  PetscReal axis[3] = {0, 0, 1}, q[4] = {1, 0, 0, 0}, length;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_quaternion", name), 4, q, NULL));
  PetscCheck(q[0] != 0 || q[1] != 0 || q[2] != 0 || q[3] != 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s is zero: give w,x,y,z with w = cos(a/2) and x,y,z = sin(a/2) times the axis", name);
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_axis", name), 3, axis, NULL));
  length = PetscSqrtReal(dot3(axis, axis));
  PetscCheck(length > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "%s has no length: give an axis that is not zero",
             name);
  for (PetscInt a = 0; a < 3; a++) axis[a] /= length;
  RotationAdvance(angle, axis, q);
  RotationMatrix(q, R);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidGroupPlace(const SolidGroup *g, PetscInt dim, PetscReal x[], PetscReal R[9])
{
  char      name[OPT_NAME];
  PetscReal pivot[3] = {0}, arm[3], angle, c, sn;
  PetscBool has_pivot;
  ShapeMass mass;

  PetscFunctionBeginUser;
  PetscCall(ParticleReadPosition(g->name, "elastic particles", dim, x, &angle));
  PetscCall(OptRealArray(OptJoin("-particle_", g->name, "_pivot", name), dim, pivot, &has_pivot));
  PetscCall(ShapeGetMass(g->shape, &mass));
  for (PetscInt a = 0; a < 3; a++) arm[a] = has_pivot && a < dim ? mass.centroid[a] - pivot[a] : 0;
  c  = PetscCosReal(angle);
  sn = PetscSinReal(angle);
  PetscCall(PetscArraycpy(R, ((const PetscReal[9]){c, -sn, 0, sn, c, 0, 0, 0, 1}), 9));
  if (dim == 3) PetscCall(read_turn(g->name, angle, R));
  for (PetscInt a = 0; a < dim; a++) {
    PetscReal way = 0;

    for (PetscInt e = 0; e < dim; e++) way += R[3 * a + e] * arm[e];
    x[a] += way;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
