/* Solids: where the solids of a group start. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/opt.h"

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
  PetscReal arm[3], axis[3] = {0, 0, 1}, q[4] = {1, 0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(read_arm(g, dim, arm));
  if (dim == 3) PetscCall(ParticleReadTurn(g->name, axis, NULL, q, NULL));
  for (PetscInt i = 0; i < g->count; i++) {
    const PetscReal c = PetscCosReal(place[i].angle), sn = PetscSinReal(place[i].angle);
    PetscReal       R[9] = {c, -sn, 0, sn, c, 0, 0, 0, 1};
    Placement       p    = place[i];

    if (dim == 3) {
      PlaceTurn(axis, q, &p);
      RotationMatrix(p.q, R);
    }
    for (PetscInt j = 0; j < g->mesh.nnode * dim; j++) {
      PetscReal *x = X + i * g->mesh.nnode * dim + j;

      *x = p.x[j % dim];
      for (PetscInt e = 0; e < dim; e++) *x += R[3 * (j % dim) + e] * (arm[e] + g->mesh.X[j / dim * dim + e]);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
