/* Meshkind: serial meshes built from options (see kind.h): the table of kinds, their boundaries, what a mesh asks of
   them. Boxes come from PETSc, graded ones from graded.c, what is round from round.c, the boundaries of mesh files from
   gmsh.c. Does not refine or distribute. */
#include "compat.h"
#include "kindimpl.h"
#include "base/domain.h"
#include "base/opt.h"
#include "mesh/mesh.h"

static const char *const kind_names[] = {"box",  "channel", "fitted", "disc", "annulus",
                                         "tube", "ball",    "shell",  "file", NULL};

/* ---- options ---- */

static PetscErrorCode read_file(MeshKind k)
{
  PetscBool given;

  PetscFunctionBeginUser;
  PetscCall(OptString("-mesh_file", k->file, sizeof(k->file)));
  PetscCheck(k->file[0], k->comm, PETSC_ERR_USER_INPUT, "-mesh_kind file needs -mesh_file <name.msh>");
  PetscCall(PetscTestFile(k->file, 'r', &given));
  PetscCheck(given, k->comm, PETSC_ERR_FILE_OPEN, "Mesh file '%s' cannot be read: check -mesh_file", k->file);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_options(MeshKind k)
{
  PetscErrorCode (*const read[])(MeshKind) = {MeshKindReadCells, MeshKindReadChannel, MeshKindReadFitted,
                                              MeshKindReadDisc,  MeshKindReadAnnulus, MeshKindReadTube,
                                              MeshKindReadBall,  MeshKindReadShell,   read_file};

  PetscFunctionBeginUser;
  k->dim = 2;
  PetscCall(OptChoice("-mesh_kind", kind_names, &k->kind));
  k->name = kind_names[k->kind];
  PetscCall(read[k->kind](k));
  k->map.dim = k->dim;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- boundaries ---- */

static PetscErrorCode add_boundary(MeshKind k, const char name[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscStrncpy(k->boundary[k->nboundary++], name, sizeof(k->boundary[0])));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool is_box(MeshKind k)
{
  return (PetscBool)(k->kind == KIND_BOX || k->kind == KIND_CHANNEL);
}

/* Side of a box that holds the outer face at q, of the axes from the first one on; O-grids in index coordinates */
static const char *side_of_face(MeshKind k, PetscInt first, const PetscReal q[])
{
  const PetscBool box = is_box(k);

  for (PetscInt d = first; d < k->dim; d++) {
    const PetscReal lower = box ? k->lower[d] : 0, upper = box ? k->upper[d] : k->cells[d],
                    tol = 1e-6 * (upper - lower) / k->cells[d];

    if (k->period[d] > 0) continue;
    if (PetscAbsReal(q[d] - lower) < tol) return DOMAIN_SIDE[2 * d];
    if (PetscAbsReal(q[d] - upper) < tol) return DOMAIN_SIDE[2 * d + 1];
  }
  return NULL;
}

/* Boundary of a mesh we made that holds the outer face at q; NULL: the face is inside a periodic axis */
static const char *boundary_of_face(MeshKind k, const PetscReal q[])
{
  const PetscBool cubes = (PetscBool)(k->kind == KIND_BALL || k->kind == KIND_SHELL);
  const PetscReal s     = PetscMax(PetscMax(PetscAbsReal(q[0]), PetscAbsReal(q[1])), cubes ? PetscAbsReal(q[2]) : 0);
  const char     *side;

  if (k->kind == KIND_DISC || k->kind == KIND_BALL) return "outer";
  if (k->kind == KIND_ANNULUS || k->kind == KIND_SHELL)
    return s > 0.5 * (k->map.inner + k->map.outer) ? "outer" : "inner";
  side = side_of_face(k, k->kind == KIND_TUBE ? 2 : 0, q);
  if (side) return side;
  return k->kind == KIND_FITTED ? "cylinder" : k->kind == KIND_TUBE ? "outer" : NULL;
}

static PetscErrorCode label_faces(MeshKind k, DM dm)
{
  PetscInt fStart, fEnd;

  PetscFunctionBeginUser;
  for (PetscInt b = 0; b < k->nboundary; b++) PetscCall(DMCreateLabel(dm, k->boundary[b]));
  PetscCall(DMPlexGetHeightStratum(dm, 1, &fStart, &fEnd));
  for (PetscInt f = fStart; f < fEnd; f++) {
    PetscInt    support;
    PetscReal   q[3];
    const char *name;

    PetscCall(DMPlexGetSupportSize(dm, f, &support));
    if (support != 1) continue;
    PetscCall(DMPlexComputeCellGeometryFVM(dm, f, NULL, q, NULL));
    name = boundary_of_face(k, q);
    if (name) PetscCall(DMSetLabelValue(dm, name, f, 1));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode name_boundaries(MeshKind k)
{
  const PetscBool rings = (PetscBool)(k->kind == KIND_ANNULUS || k->kind == KIND_SHELL);
  const PetscBool round = (PetscBool)(rings || k->kind == KIND_DISC || k->kind == KIND_BALL);

  PetscFunctionBeginUser;
  if (rings) PetscCall(add_boundary(k, "inner"));
  if (round || k->kind == KIND_TUBE) PetscCall(add_boundary(k, "outer"));
  for (PetscInt i = k->kind == KIND_TUBE ? 4 : 0; i < 2 * k->dim && !round; i++)
    if (k->period[i / 2] == 0) PetscCall(add_boundary(k, DOMAIN_SIDE[i]));
  if (k->kind == KIND_FITTED) PetscCall(add_boundary(k, "cylinder"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_round(MeshKind k, DM dm)
{
  PetscFunctionBeginUser;
  for (PetscInt b = 0; b < k->nboundary; b++) {
    char      name[OPT_NAME];
    PetscBool given;
    PetscReal circle[3];

    PetscCall(OptRealArray(OptJoin("-mesh_round_", k->boundary[b], "", name), 3, circle, &given));
    if (!given) continue;
    PetscCheck(circle[2] > 0, k->comm, PETSC_ERR_USER_INPUT, "%s: radius %g must be positive", name, (double)circle[2]);
    PetscCheck(k->dim == 2, k->comm, PETSC_ERR_SUP,
               "%s: round boundaries are for 2D meshes; '%s' is 3D: remove the option", name, k->file);
    PetscCheck(!k->curved, k->comm, PETSC_ERR_USER_INPUT,
               "%s: the cells of '%s' are bent already, of second order: remove the option", name, k->file);
    PetscCall(MeshKindMakeRound(k, dm, k->boundary[b], circle));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- creation ---- */

static PetscErrorCode create_box(MeshKind k, DM *dm)
{
  DMBoundaryType boundary[3];

  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < 3; d++) boundary[d] = k->period[d] > 0 ? DM_BOUNDARY_PERIODIC : DM_BOUNDARY_NONE;
  PetscCall(CompatCreateBoxMesh(k->comm, k->dim, k->cells, k->lower, k->upper, boundary, dm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindRead(MPI_Comm comm, MeshKind *kind)
{
  PetscFunctionBeginUser;
  PetscCall(PetscNew(kind));
  (*kind)->comm = comm;
  PetscCall(read_options(*kind));
  if ((*kind)->kind != KIND_FILE) PetscCall(name_boundaries(*kind));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindCreateBox(MPI_Comm comm, PetscInt dim, const PetscInt cells[], const PetscReal lower[],
                                 const PetscReal upper[], MeshKind *kind)
{
  MeshKind k;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&k));
  k->comm    = comm;
  k->kind    = KIND_BOX;
  k->name    = kind_names[KIND_BOX];
  k->dim     = dim;
  k->map.dim = dim;
  for (PetscInt d = 0; d < 3; d++) {
    k->cells[d] = d < dim ? cells[d] : 1;
    k->lower[d] = d < dim ? lower[d] : 0;
    k->upper[d] = d < dim ? upper[d] : 0;
  }
  PetscCall(name_boundaries(k));
  *kind = k;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindGetBoxCells(MeshKind k, PetscReal *n)
{
  PetscFunctionBeginUser;
  *n = is_box(k);
  for (PetscInt d = 0; d < k->dim; d++) *n *= k->cells[d];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindBuild(MeshKind k, DM *dm)
{
  PetscFunctionBeginUser;
  if (k->kind == KIND_FILE) {
    PetscCall(MeshKindCreateFromFile(k, dm));
    PetscCall(read_round(k, *dm));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (is_box(k)) PetscCall(create_box(k, dm));
  else PetscCall(MeshKindCreateRound(k, dm));
  PetscCall(label_faces(k, *dm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindReadBox(MPI_Comm comm, MeshKind *kind)
{
  PetscFunctionBeginUser;
  PetscCall(MeshKindRead(comm, kind));
  PetscCheck(is_box(*kind), comm, PETSC_ERR_SUP,
             "-mesh_levels refines boxes: it does not work with -mesh_kind %s, use box or channel, or remove -mesh_levels",
             kind_names[(*kind)->kind]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindSetCells(MeshKind k, const PetscInt cells[3])
{
  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < k->dim; d++) {
    PetscCheck(k->cells[d] == cells[d] || k->map.type == MESHMAP_IDENTITY, k->comm, PETSC_ERR_USER_INPUT,
               "The checkpoint has %" PetscInt_FMT " base cells along axis %c, this scene %" PetscInt_FMT
               ", and cells that grow cannot be told from these numbers: restart with the -mesh_ options of the run that wrote it",
               cells[d], (char)('x' + d), k->cells[d]);
    k->cells[d] = cells[d];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindDestroy(MeshKind *kind)
{
  PetscFunctionBeginUser;
  if (!*kind) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MeshMapClear(&(*kind)->map));
  PetscCall(CurvedDestroy(&(*kind)->curved));
  PetscCall(PetscFree(*kind));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindGetBoundaries(MeshKind k, PetscInt *n, const char (**names)[64])
{
  PetscFunctionBeginUser;
  *n     = k->nboundary;
  *names = (const char(*)[64])k->boundary;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindHasSides(MeshKind k, PetscBool *has)
{
  PetscFunctionBeginUser;
  *has = (PetscBool)(k->kind != KIND_FILE);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindGetSmallest(MeshKind k, PetscReal *h)
{
  PetscFunctionBeginUser;
  *h = 0;
  for (PetscInt d = 0; d < k->dim; d++) {
    PetscReal min = (k->upper[d] - k->lower[d]) / (PetscReal)k->cells[d];

    for (PetscInt i = 0; i < k->cells[d] && k->map.line[d]; i++)
      min = PetscMin(min, k->map.line[d][i + 1] - k->map.line[d][i]);
    *h = PetscMax(*h, min);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindGetBox(MeshKind k, PetscInt *dim, PetscReal lower[3], PetscReal upper[3], PetscReal period[3])
{
  PetscFunctionBeginUser;
  *dim = k->dim;
  for (PetscInt d = 0; d < 3; d++) {
    lower[d]  = k->lower[d];
    upper[d]  = k->upper[d];
    period[d] = k->period[d];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindGetPeriod(MeshKind k, const PetscReal *period[], const PetscReal *upper[])
{
  PetscFunctionBeginUser;
  *period = k->period;
  *upper  = k->upper;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindGetCurved(MeshKind k, Curved *curved)
{
  PetscFunctionBeginUser;
  *curved = k->curved;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindEvaluate(MeshKind k, const PetscReal q[], PetscReal x[])
{
  PetscFunctionBeginUser;
  MeshMapEvaluate(&k->map, q, x);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode map_points(const MeshMap *map, Vec points)
{
  PetscInt     n;
  PetscScalar *x;

  PetscFunctionBeginUser;
  PetscCall(VecGetLocalSize(points, &n));
  PetscCall(VecGetArray(points, &x));
  for (PetscInt i = 0; i < n; i += map->dim) MeshMapEvaluate(map, x + i, x + i);
  PetscCall(VecRestoreArray(points, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindPlaceVertices(MeshKind k, DM dm)
{
  Vec       x;
  PetscBool localized;

  PetscFunctionBeginUser;
  if (k->map.type == MESHMAP_IDENTITY) PetscFunctionReturn(PETSC_SUCCESS); /* bent cells of a file too */
  PetscCall(DMGetCoordinatesLocal(dm, &x));
  PetscCall(map_points(&k->map, x));
  PetscCall(DMSetCoordinatesLocal(dm, x)); /* drops the global vector */
  PetscCall(DMGetCoordinatesLocalized(dm, &localized));
  if (localized) { /* a periodic box: cells at the seam have coordinates of their own */
    PetscCall(DMGetCellCoordinatesLocal(dm, &x));
    PetscCall(map_points(&k->map, x));
    PetscCall(DMSetCellCoordinatesLocal(dm, x));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
