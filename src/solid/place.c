/* Solids: where the solids of a group start. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"

/* One a group */
static PetscErrorCode refuse_places(const char group[])
{
  static const char *const PLACES[] = {"single", "lattice", "random", "table", "pack", NULL};
  char                     name[OPT_NAME];
  PetscInt                 place = 0;

  PetscFunctionBeginUser;
  PetscCall(OptChoice(OptJoin("-particle_", group, "_place", name), PLACES, &place));
  PetscCheck(place == 0, PETSC_COMM_SELF, PETSC_ERR_SUP,
             "%s %s: elastic particles are placed one a group, at -particle_%s_position: remove it, or give each its own group",
             name, PLACES[place], group);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidGroupPlace(const SolidGroup *g, PetscInt dim, PetscReal x[], PetscReal *angle)
{
  char      name[OPT_NAME];
  PetscReal pivot[3] = {0}, arm[2], c, sn;
  PetscBool found, has_pivot;
  ShapeMass mass;

  PetscFunctionBeginUser;
  PetscCall(refuse_places(g->name));
  *angle = 0;
  PetscCall(OptRealArray(OptJoin("-particle_", g->name, "_position", name), dim, x, &found));
  PetscCheck(found, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "Group '%s' has no position: give %s", g->name, name);
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_angle", name), angle));
  PetscCall(OptRealArray(OptJoin("-particle_", g->name, "_pivot", name), dim, pivot, &has_pivot));
  PetscCall(ShapeGetMass(g->shape, &mass));
  for (PetscInt a = 0; a < 2; a++) arm[a] = has_pivot ? mass.centroid[a] - pivot[a] : 0;
  c  = PetscCosReal(*angle);
  sn = PetscSinReal(*angle);
  x[0] += c * arm[0] - sn * arm[1];
  x[1] += sn * arm[0] + c * arm[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}
