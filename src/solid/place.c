/* Solids: where the solids of a group start. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"
#include "shape/material.h"

PetscErrorCode SolidGroupPlace(const SolidGroup *g, PetscInt dim, PetscReal x[], PetscReal *angle)
{
  char      name[OPT_NAME];
  PetscReal pivot[3] = {0}, arm[2], c, sn;
  PetscBool has_pivot;
  ShapeMass mass;

  PetscFunctionBeginUser;
  PetscCall(ParticleReadPosition(g->name, "elastic particles", dim, x, angle));
  PetscCall(OptRealArray(OptJoin("-particle_", g->name, "_pivot", name), dim, pivot, &has_pivot));
  PetscCall(ShapeGetMass(g->shape, &mass));
  for (PetscInt a = 0; a < 2; a++) arm[a] = has_pivot ? mass.centroid[a] - pivot[a] : 0;
  c  = PetscCosReal(*angle);
  sn = PetscSinReal(*angle);
  x[0] += c * arm[0] - sn * arm[1];
  x[1] += sn * arm[0] + c * arm[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}
