/* Meshkind: boxes, the channel and the channel around a cylinder (see kind.h). Sizes of the graded channel meshes are
   fixed by a basic resolution and its cell counts, and other resolutions multiply the counts, so that meshes of twice
   the resolution contain the lines of the coarser ones. Lengths in the unit of the scene. */
#include "compat.h"
#include "../memory.h"
#include "kindimpl.h"
#include "base/mix.h"
#include "base/opt.h"
#include "mesh/mesh.h"

/* Channel of Schaefer & Turek, and the sizes on which its meshes are based */
static const PetscReal channel_upper[2] = {2.2, 0.41}, cylinder_centre[2] = {0.2, 0.2}, cylinder_radius = 0.05;

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
    PetscReal end[4] = {k->lower[d], g->lower[d], g->upper[d], k->upper[d]}, shift = 0, narrowest = PETSC_MAX_REAL;
    PetscInt  count[3] = {0, 0, 0};

    for (PetscInt section = 0; section < 3; section += 2) {
      const PetscReal length = end[section + 1] - end[section];

      if (length <= 0) continue;
      count[section] = MeshKindCount(scale *
                                     MeshKindCount(MeshMapCountCells(length, g->h, g->growth[d], g->coarsest[d])));
      narrowest      = PetscMin(narrowest, length);
    }
    count[1] = MeshKindCount(scale * MeshKindCount((end[2] - end[1]) / g->h));
    if (g->seed && count[0] && count[2])
      shift = random_fraction(g->seed, d) * PetscMin((end[2] - end[1]) / count[1], narrowest);
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
  PetscCheck(!cells, k->comm, PETSC_ERR_USER_INPUT,
             "-mesh_focus sets the cells from -mesh_focus_h: remove -mesh_cells");
  PetscCall(OptHas("-mesh_focus_h", &size));
  PetscCheck(size, k->comm, PETSC_ERR_USER_INPUT, "-mesh_focus needs the size of its cells: give -mesh_focus_h");
  PetscCall(OptReal("-mesh_focus_h", &g.h));
  for (PetscInt d = 0; d < k->dim; d++) {
    g.lower[d] = PetscMax(box[d], k->lower[d]);
    g.upper[d] = PetscMin(box[k->dim + d], k->upper[d]);
    PetscCheck(g.upper[d] > g.lower[d], k->comm, PETSC_ERR_USER_INPUT,
               "-mesh_focus [%g, %g] along axis %c is empty or outside the box [%g, %g] of -mesh_lower and -mesh_upper",
               (double)box[d], (double)box[k->dim + d], (char)('x' + d), (double)k->lower[d], (double)k->upper[d]);
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
               "-mesh_stretch gives %g along %c, which is periodic and has no ends for cells to gather at: give 0 there",
               (double)s[d], (char)('x' + d));
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
    PetscCheck(k->upper[d] > k->lower[d], k->comm, PETSC_ERR_USER_INPUT,
               "The box is empty along axis %c: -mesh_upper %g is not above -mesh_lower %g", (char)('x' + d),
               (double)k->upper[d], (double)k->lower[d]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindReadCells(MeshKind k)
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
               "Axis %c is periodic with %" PetscInt_FMT " cells: -mesh_cells needs at least 3 there", (char)('x' + d),
               k->cells[d]);
  }
  PetscCall(
    MeshCheckMemory(k->comm, k->dim,
                    (PetscReal)k->cells[0] * (PetscReal)k->cells[1] * (k->dim == 3 ? (PetscReal)k->cells[2] : 1)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* 2,211 cells at 10 cells a diameter, 8,844 at 20: the mesh on which the boundary treatments were compared */
PetscErrorCode MeshKindReadChannel(MeshKind k)
{
  Grading  g = {.h = 0.01, .growth = {0.08, 0.12}, .coarsest = {8, 2}, .lower = {0.11, 0.11}, .upper = {0.31, 0.29}};
  PetscInt resolution = MeshDefaultResolution(k->name);

  PetscFunctionBeginUser;
  PetscCall(MeshKindReadResolution(k, 2, &resolution));
  PetscCall(read_growth(2, &g));
  PetscCall(read_seed(&g));
  for (PetscInt d = 0; d < 2; d++) k->upper[d] = channel_upper[d];
  PetscCall(set_lines(k, 2, &g, resolution / 10.0, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* An O-grid between the cylinder and a square of twice its diameter */
PetscErrorCode MeshKindReadFitted(MeshKind k)
{
  Grading   g          = {.growth = {0.3, 0.3}, .coarsest = {8, 8}};
  PetscInt  resolution = MeshDefaultResolution(k->name), n[2][3];
  PetscReal radius, plane;

  PetscFunctionBeginUser;
  k->map.ring_ratio = 3;
  PetscCall(read_dimension(k));
  PetscCall(MeshKindReadResolution(k, 2, &resolution));
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
               (double)g.lower[d], (double)g.upper[d], (char)('x' + d), (double)k->lower[d], (double)k->upper[d],
               (double)radius);
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
  plane = (PetscReal)k->cells[0] * (PetscReal)k->cells[1] +
          (PetscReal)resolution * (PetscReal)(4 * k->nring - resolution);
  PetscCall(MeshCheckMemory(k->comm, 3, plane * (PetscReal)k->cells[2]));
  PetscFunctionReturn(PETSC_SUCCESS);
}
