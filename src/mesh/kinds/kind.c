/* Meshkind: serial meshes built from options (see kind.h).

   Boxes come from PETSc, what is round from round.c, the boundaries of mesh files from gmsh.c. Sizes of the graded
   channel meshes are fixed by a basic resolution and its cell counts, and other resolutions multiply the counts, so
   that meshes of twice the resolution contain the lines of the coarser ones. Lengths in the unit of the
   scene. Does not refine or distribute. */
#include "compat.h"
#include "../memory.h"
#include "kindimpl.h"
#include "base/domain.h"
#include "base/mix.h"
#include "base/opt.h"
#include "mesh/mesh.h"
#include <strings.h>

static const char *const kind_names[] = {"box", "channel", "fitted", "disc", "annulus", "tube", "ball", "shell", "file", NULL};

/* Channel of Schaefer & Turek, and the sizes on which its meshes are based */
static const PetscReal channel_upper[2] = {2.2, 0.41}, cylinder_centre[2] = {0.2, 0.2}, cylinder_radius = 0.05;

/* ---- options ---- */

PetscErrorCode MeshKindReadPeriodic(MeshKind k)
{
  PetscInt n = 3;
  char    *names[3];

  PetscFunctionBeginUser;
  PetscCall(OptStringArray("-mesh_periodic", &n, names));
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt axis = names[i][0] - 'x';

    PetscCheck(axis >= 0 && axis < k->dim && !names[i][1], k->comm, PETSC_ERR_USER_INPUT,
               "Option -mesh_periodic: '%s' is not an axis of a %" PetscInt_FMT "D mesh: use x, y or z", names[i], k->dim);
    k->period[axis] = k->upper[axis] - k->lower[axis];
    PetscCall(PetscFree(names[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A fraction from -1/2 to 1/2 that depends on seed and axis, the same on every machine */
static PetscReal random_fraction(PetscInt seed, PetscInt axis)
{
  return (PetscReal)(Mix64(MIX_STEP * (uint64_t)(3 * seed + axis + 1)) >> 11) / 9007199254740992.0 - 0.5;
}

typedef struct {
  PetscReal h, growth[3], coarsest[3]; /* size in the fine part; how it grows outside, an axis each */
  PetscReal lower[3], upper[3];        /* the fine part */
  PetscInt  seed;
} Grading;

static PetscErrorCode read_growth(PetscInt dim, Grading *g)
{
  PetscFunctionBeginUser;
  PetscCall(OptRealArray("-mesh_growth", dim, g->growth, NULL));
  PetscCall(OptRealArray("-mesh_coarsest", dim, g->coarsest, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mesh lines of the first dim axes; cell counts are those of the grading times scale. n, if not NULL, returns the
   counts before, in and behind the fine part of each axis */
static PetscErrorCode set_lines(MeshKind k, PetscInt dim, const Grading *g, PetscReal scale, PetscInt (*n)[3])
{
  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < dim; d++) {
    PetscReal end[4] = {k->lower[d], g->lower[d], g->upper[d], k->upper[d]}, shift = 0, room = PETSC_MAX_REAL;
    PetscInt  count[3] = {0, 0, 0};

    for (PetscInt part = 0; part < 3; part += 2) {
      const PetscReal length = end[part + 1] - end[part];

      if (length <= 0) continue;
      count[part] = MeshKindCount(scale * MeshKindCount(MeshMapCountCells(length, g->h, g->growth[d], g->coarsest[d])));
      room        = PetscMin(room, length);
    }
    count[1] = MeshKindCount(scale * MeshKindCount((end[2] - end[1]) / g->h));
    if (g->seed && count[0] && count[2]) shift = random_fraction(g->seed, d) * PetscMin((end[2] - end[1]) / count[1], room);
    end[1] += shift;
    end[2] += shift;
    PetscCall(MeshMapSetLines(&k->map, d, end, count, g->h, g->growth[d], g->coarsest[d]));
    for (PetscInt i = 0; i < 3 && n; i++) n[d][i] = count[i];
    k->cells[d] = k->map.ncell[d];
  }
  k->map.type = MESHMAP_LINES;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_seed(Grading *g)
{
  PetscFunctionBeginUser;
  PetscCall(OptInt("-mesh_shift_seed", &g->seed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_focus(MeshKind k)
{
  Grading   g      = {.growth = {0.1, 0.1, 0.1}, .coarsest = {8, 8, 8}};
  PetscReal box[6] = {0};
  PetscBool given, cells, size;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray("-mesh_focus", 2 * k->dim, box, &given));
  if (!given) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptHas("-mesh_cells", &cells));
  PetscCheck(!cells, k->comm, PETSC_ERR_USER_INPUT, "-mesh_focus sets the cells from -mesh_focus_h: remove -mesh_cells");
  PetscCall(OptHas("-mesh_focus_h", &size));
  PetscCheck(size, k->comm, PETSC_ERR_USER_INPUT, "-mesh_focus needs the size of its cells: give -mesh_focus_h");
  PetscCall(OptReal("-mesh_focus_h", &g.h));
  for (PetscInt d = 0; d < k->dim; d++) {
    g.lower[d] = PetscMax(box[d], k->lower[d]);
    g.upper[d] = PetscMin(box[k->dim + d], k->upper[d]);
    PetscCheck(g.upper[d] > g.lower[d], k->comm, PETSC_ERR_USER_INPUT,
               "-mesh_focus [%g, %g] along axis %c is empty or outside the box [%g, %g] of -mesh_lower and -mesh_upper", (double)box[d],
               (double)box[k->dim + d], (char)('x' + d), (double)k->lower[d], (double)k->upper[d]);
  }
  PetscCall(read_growth(k->dim, &g));
  PetscCall(read_seed(&g));
  PetscCall(set_lines(k, k->dim, &g, 1, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* -mesh_stretch: cells that gather at both ends of an axis */
static PetscErrorCode read_stretch(MeshKind k)
{
  PetscReal s[3] = {0, 0, 0};
  PetscBool given;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray("-mesh_stretch", k->dim, s, &given));
  if (!given) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(k->map.type == MESHMAP_IDENTITY, k->comm, PETSC_ERR_USER_INPUT,
             "-mesh_stretch and -mesh_focus both say where cells are fine: remove one of them");
  for (PetscInt d = 0; d < k->dim; d++) {
    PetscCheck(k->period[d] == 0 || s[d] == 0, k->comm, PETSC_ERR_USER_INPUT,
               "-mesh_stretch gives %g along %c, which is periodic and has no ends for cells to gather at: give 0 there", (double)s[d],
               (char)('x' + d));
    PetscCall(MeshMapSetStretched(&k->map, d, k->lower[d], k->upper[d], k->cells[d], s[d]));
  }
  k->map.type = MESHMAP_LINES;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Three numbers in an option that has one for each axis mean three dimensions */
static PetscErrorCode read_dimension(MeshKind k)
{
  const char *const given[] = {"-mesh_cells", "-mesh_lower", "-mesh_upper"};

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 3; i++) {
    PetscInt n;

    PetscCall(OptCountItems(given[i], &n));
    if (n == 3) k->dim = 3;
  }
  PetscCall(OptInt("-mesh_dimension", &k->dim));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_corners(MeshKind k)
{
  PetscFunctionBeginUser;
  PetscCall(OptRealArray("-mesh_lower", k->dim, k->lower, NULL));
  PetscCall(OptRealArray("-mesh_upper", k->dim, k->upper, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_corners(MeshKind k)
{
  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < k->dim; d++) {
    PetscCheck(k->upper[d] > k->lower[d], k->comm, PETSC_ERR_USER_INPUT, "The box is empty along axis %c: -mesh_upper %g is not above -mesh_lower %g",
               (char)('x' + d), (double)k->upper[d], (double)k->lower[d]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_box(MeshKind k)
{
  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < 3; d++) {
    k->cells[d] = 16;
    k->upper[d] = 1;
  }
  PetscCall(read_dimension(k));
  PetscCall(read_corners(k));
  PetscCall(check_corners(k));
  PetscCall(MeshKindReadPeriodic(k));
  PetscCall(read_focus(k));
  if (k->map.type == MESHMAP_IDENTITY) PetscCall(OptIntArray("-mesh_cells", k->dim, k->cells, NULL));
  PetscCall(read_stretch(k));
  for (PetscInt d = 0; d < k->dim; d++) {
    PetscCheck(k->period[d] == 0 || k->cells[d] >= 3, k->comm, PETSC_ERR_USER_INPUT,
               "Axis %c is periodic with %" PetscInt_FMT " cells: -mesh_cells needs at least 3 there", (char)('x' + d), k->cells[d]);
  }
  PetscCall(MeshCheckMemory(k->comm, k->dim, (PetscReal)k->cells[0] * (PetscReal)k->cells[1] * (k->dim == 3 ? (PetscReal)k->cells[2] : 1)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscInt MeshDefaultResolution(const char kind[])
{
  return !strcasecmp(kind, "channel") ? 10 : !strcasecmp(kind, "fitted") ? 16 : 4;
}

/* 2,211 cells at 10 cells a diameter, 8,844 at 20: the mesh on which the boundary treatments were compared */
static PetscErrorCode read_channel(MeshKind k)
{
  Grading  g          = {.h = 0.01, .growth = {0.08, 0.12}, .coarsest = {8, 2}, .lower = {0.11, 0.11}, .upper = {0.31, 0.29}};
  PetscInt resolution = MeshDefaultResolution(k->name);

  PetscFunctionBeginUser;
  PetscCall(MeshKindReadResolution(2, &resolution));
  PetscCall(read_growth(2, &g));
  PetscCall(read_seed(&g));
  for (PetscInt d = 0; d < 2; d++) k->upper[d] = channel_upper[d];
  PetscCall(set_lines(k, 2, &g, resolution / 10.0, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* An O-grid between the cylinder and a square of twice its diameter */
static PetscErrorCode read_fitted(MeshKind k)
{
  Grading   g          = {.growth = {0.3, 0.3}, .coarsest = {8, 8}};
  PetscInt  resolution = MeshDefaultResolution(k->name), n[2][3];
  PetscReal radius, plane;

  PetscFunctionBeginUser;
  k->map.ring_ratio = 3;
  PetscCall(read_dimension(k));
  PetscCall(MeshKindReadResolution(2, &resolution));
  PetscCall(MeshKindReadRatio(k));
  PetscCall(read_growth(2, &g));
  for (PetscInt d = 0; d < 2; d++) {
    k->upper[d]      = channel_upper[d];
    k->map.centre[d] = cylinder_centre[d];
  }
  k->upper[2]      = channel_upper[1];
  k->map.radius[0] = cylinder_radius;
  PetscCall(read_corners(k));
  PetscCall(check_corners(k));
  PetscCall(MeshKindReadCircle(k));
  radius = g.h = k->map.radius[0];
  for (PetscInt d = 0; d < 2; d++) {
    g.lower[d] = k->map.centre[d] - 2 * radius;
    g.upper[d] = k->map.centre[d] + 2 * radius;
    PetscCheck(g.lower[d] >= k->lower[d] && g.upper[d] <= k->upper[d], k->comm, PETSC_ERR_USER_INPUT,
               "-mesh_kind fitted puts the cylinder into a square of twice its diameter, [%g, %g] along %c, which must lie within [%g, %g]: change -mesh_centre, "
               "-mesh_radius %g, -mesh_lower or -mesh_upper",
               (double)g.lower[d], (double)g.upper[d], (char)('x' + d), (double)k->lower[d], (double)k->upper[d], (double)radius);
  }
  PetscCall(set_lines(k, 2, &g, resolution / 4.0, n));
  for (PetscInt d = 0; d < 2; d++) {
    k->block[d]      = n[d][0];
    k->map.middle[d] = n[d][0] + 0.5 * resolution;
  }
  k->block[2]  = resolution;
  k->nring     = MeshKindCount(0.5 * resolution);
  k->map.type  = MESHMAP_FITTED;
  k->map.outer = 0.5 * resolution;
  k->map.inner = 0.5 * k->map.outer;
  if (k->dim == 2) PetscFunctionReturn(PETSC_SUCCESS);
  /* layers twice as thick as cells beside the block */
  PetscCall(MeshKindReadLayers(k, MeshKindCount((k->upper[2] - k->lower[2]) / (8 * radius) * resolution)));
  plane = (PetscReal)k->cells[0] * (PetscReal)k->cells[1] + (PetscReal)resolution * (PetscReal)(4 * k->nring - resolution);
  PetscCall(MeshCheckMemory(k->comm, 3, plane * (PetscReal)k->cells[2]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

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
  PetscErrorCode (*const read[])(MeshKind) = {read_box,         read_channel,     read_fitted,       MeshKindReadDisc, MeshKindReadAnnulus,
                                              MeshKindReadTube, MeshKindReadBall, MeshKindReadShell, read_file};

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
    const PetscReal lower = box ? k->lower[d] : 0, upper = box ? k->upper[d] : k->cells[d], tol = 1e-6 * (upper - lower) / k->cells[d];

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
  if (k->kind == KIND_ANNULUS || k->kind == KIND_SHELL) return s > 0.5 * (k->map.inner + k->map.outer) ? "outer" : "inner";
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
    PetscCheck(k->dim == 2, k->comm, PETSC_ERR_SUP, "%s: round boundaries are for 2D meshes; '%s' is 3D: remove the option", name, k->file);
    PetscCheck(!k->curved, k->comm, PETSC_ERR_USER_INPUT, "%s: the cells of '%s' are bent already, of second order: remove the option", name,
               k->file);
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
    PetscReal least = (k->upper[d] - k->lower[d]) / (PetscReal)k->cells[d];

    for (PetscInt i = 0; i < k->cells[d] && k->map.line[d]; i++) least = PetscMin(least, k->map.line[d][i + 1] - k->map.line[d][i]);
    *h = PetscMax(*h, least);
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
