/* Walls: see walls.h. Kinds that we make ourselves are sides of boxes, circles, cylinders and spheres; of a mesh file
   all ranks hear all faces, some kilobyte each. */
#include "compat.h"
#include "walls.h"
#include "base/sparse.h"

#define WHOLE 1e-6 /* of the size of the box: faces are in a side of it, and all of it */

static PetscErrorCode find_velocity(void *context, PetscInt boundary, const PetscReal x[3], PetscReal v[3])
{
  PetscFunctionBeginUser;
  PetscCall(ConditionsGetVelocity((Conditions)context, boundary, x, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does a wall stand at boundary b? */
static PetscErrorCode is_solid(Mesh mesh, Flow flow, Bodies bodies, PetscInt b, PetscBool *solid, PetscBool *moves)
{
  BodyState  *s;
  const char *name;

  PetscFunctionBeginUser;
  *solid = PETSC_TRUE;
  *moves = PETSC_FALSE;
  if (flow) PetscCall(ConditionsSticks(FlowConditions(flow), b, solid, moves));
  PetscCall(BodiesGetState(bodies, &s));
  PetscCall(MeshGetBoundaryName(mesh, b, &name));
  for (PetscInt g = 0; g < s->ngroups && *solid; g++) {
    PetscBool same;

    PetscCall(PetscStrcmp(name, s->group[g].body_fitted ? s->group[g].surface : s->group[g].name, &same));
    *solid = (PetscBool)!same;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Area of a face if it lies in side `side` of the box, else 0 */
static PetscReal area_in_side(const MeshLocal *l, const BorderFace *f, PetscInt side)
{
  const PetscInt a = side / 2, p = (a + 1) % l->dim, q = (a + 2) % 3,
                 *corner = l->dim == 2 ? (const PetscInt[]){0, 2, 2, 0} : (const PetscInt[]){0, 2, 8, 6};
  const PetscReal at     = side % 2 ? l->upper[a] : l->lower[a];
  PetscReal       area   = 0;

  for (PetscInt i = 0; i < (l->dim == 2 ? 3 : 9); i++)
    if (PetscAbsReal(f->x[i][a] - at) > WHOLE * (l->upper[a] - l->lower[a])) return 0;
  if (l->dim == 2) return PetscAbsReal(f->x[2][p] - f->x[0][p]);
  for (PetscInt i = 0; i < 4; i++) {
    const PetscReal *x = f->x[corner[i]], *y = f->x[corner[(i + 1) % 4]];

    area += 0.5 * (x[p] * y[q] - x[q] * y[p]);
  }
  return PetscAbsReal(area);
}

/* Boundaries of a file that are whole sides of its box and have their names are closed forms, as those of a box */
static PetscErrorCode find_sides(Mesh mesh, PetscInt n, const BorderFace face[], PetscInt side[CONTACT_SIDES])
{
  const MeshLocal *l;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  for (PetscInt i = 0; i < 2 * l->dim; i++) {
    PetscReal whole = 1, area = 0;

    PetscCall(MeshFindBoundary(mesh, DOMAIN_SIDE[i], &side[i]));
    for (PetscInt a = 0; a < l->dim; a++) whole *= a == i / 2 ? 1 : l->upper[a] - l->lower[a];
    for (PetscInt f = 0; f < n && side[i] >= 0; f++) {
      const PetscReal covered = face[f].boundary == side[i] ? area_in_side(l, &face[f], i) : 0;

      if (face[f].boundary == side[i] && covered <= 0) area = -PETSC_MAX_REAL;
      area += covered;
    }
    if (PetscAbsReal(area - whole) > WHOLE * whole) side[i] = -1;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode WallsFind(Mesh mesh, Flow flow, Bodies bodies, Border *border, PetscInt *sides, ContactWalls *walls)
{
  const MeshLocal *l;
  PetscInt         nown, nface = 0, nboundary;
  BorderFace      *own, *face  = NULL;
  PetscBool        box;
  MPI_Comm         comm;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshHasSides(mesh, &box));
  PetscCall(MeshGetComm(mesh, &comm));
  if (!box) {
    PetscCall(MeshGetBoundaryFaces(mesh, &nown, &own));
    PetscCall(SparseGather(comm, nown, sizeof(*own), own, &nface, &face, NULL));
    PetscCall(PetscFree(own));
  }
  *walls = (ContactWalls){.side = {-1, -1, -1, -1, -1, -1}};
  for (PetscInt i = 0; i < CONTACT_SIDES && box; i++)
    PetscCall(MeshFindBoundary(mesh, DOMAIN_SIDE[i], &walls->side[i]));
  if (!box) PetscCall(find_sides(mesh, nface, face, walls->side));
  PetscCall(BorderCreate(l->dim, border));
  PetscCall(MeshGetBoundaryCount(mesh, &nboundary));
  *sides = 0;
  for (PetscInt b = 0; b < nboundary; b++) {
    BorderRound r;
    PetscBool   solid, moves, round;
    PetscInt    i = 0;
    const char *name;

    PetscCall(is_solid(mesh, flow, bodies, b, &solid, &moves));
    while (i < CONTACT_SIDES && walls->side[i] != b) i++;
    if (i < CONTACT_SIDES && solid) *sides |= 1 << i;
    if (solid && moves) {
      walls->velocity = find_velocity;
      walls->context  = FlowConditions(flow);
    }
    PetscCall(MeshGetBoundaryName(mesh, b, &name));
    PetscCall(BorderAdd(*border, name, (PetscBool)(solid && i == CONTACT_SIDES)));
    PetscCall(MeshGetBoundaryRound(mesh, b, &round, &r));
    if (round) PetscCall(BorderAddRound(*border, b, &r));
  }
  PetscCall(BorderSetFaces(*border, nface, face));
  PetscCall(PetscFree(face));
  walls->border = *border;
  PetscFunctionReturn(PETSC_SUCCESS);
}
