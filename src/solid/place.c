/* Solids: where the solids of a group start. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/opt.h"

PetscErrorCode SolidGroupReadPlacements(SolidGroup *g, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                                        ParticlesPlaced *placed, Placement **place)
{
  PetscFunctionBeginUser;
  PetscCall(
    ParticleReadPlacements(g->name, "elastic particles", dim, g->mesh.radius, lower, upper, placed, &g->count, place));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* In space: -particle_<group>_quaternion, then turned by the angle about -particle_<group>_axis, as rigid bodies; a
   table may give each its own */
static PetscErrorCode read_turn(const char group[], const Placement *p, PetscReal R[9])
{
  char      name[OPT_NAME];
  PetscReal axis[3] = {0, 0, 1}, q[4] = {1, 0, 0, 0}, length;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_quaternion", name), 4, q, NULL));
  PetscCheck(q[0] != 0 || q[1] != 0 || q[2] != 0 || q[3] != 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s is zero: give w,x,y,z with w = cos(a/2) and x,y,z = sin(a/2) times the axis", name);
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_axis", name), 3, axis, NULL));
  if (p->has_quaternion) PetscCall(PetscArraycpy(q, p->q, 4));
  if (p->has_axis) PetscCall(PetscArraycpy(axis, p->axis, 3));
  length = PetscSqrtReal(dot3(axis, axis));
  PetscCheck(length > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "%s has no length: give an axis that is not zero",
             name);
  for (PetscInt a = 0; a < 3; a++) axis[a] /= length;
  RotationAdvance(p->angle, axis, q);
  RotationMatrix(q, R);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From the position that the scene gives to the centroid: with a pivot that is another point of the shape */
static PetscErrorCode read_arm(const SolidGroup *g, PetscInt dim, PetscReal arm[3])
{
  char      name[OPT_NAME];
  PetscReal pivot[3] = {0};
  PetscBool has_pivot;
  ShapeMass mass;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray(OptJoin("-particle_", g->name, "_pivot", name), dim, pivot, &has_pivot));
  PetscCall(ShapeGetMass(g->shape, &mass));
  for (PetscInt a = 0; a < 3; a++) arm[a] = has_pivot && a < dim ? mass.centroid[a] - pivot[a] : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidGroupPlace(const SolidGroup *g, PetscInt dim, const Placement place[], PetscReal X[])
{
  PetscReal arm[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(read_arm(g, dim, arm));
  for (PetscInt i = 0; i < g->count; i++) {
    const PetscReal c = PetscCosReal(place[i].angle), sn = PetscSinReal(place[i].angle);
    PetscReal       R[9] = {c, -sn, 0, sn, c, 0, 0, 0, 1};

    if (dim == 3) PetscCall(read_turn(g->name, &place[i], R));
    for (PetscInt j = 0; j < g->mesh.nnode * dim; j++) {
      PetscReal *x = X + i * g->mesh.nnode * dim + j;

      *x = place[i].x[j % dim];
      for (PetscInt e = 0; e < dim; e++) *x += R[3 * (j % dim) + e] * (arm[e] + g->mesh.X[j / dim * dim + e]);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
