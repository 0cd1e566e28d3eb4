/* PointCells: see pointcells.h. */
#include "compat.h"
#include "pointcells.h"
#include "base/domain.h"
#include "fem/element.h"

#define INSIDE 1e-12 /* beyond its faces a point still counts as in a cell: no other is looked at */

struct _p_PointCells {
  Mesh             mesh; /* NULL: cells by themselves, */
  const PetscInt  *node; /* their nodes */
  const PetscReal *x;    /* and these nodes' positions */
  PetscInt         dim, nb, ncell;
  PetscReal        period[3], origin[3];
  PetscReal        beyond;
  PetscReal       *box;               /* [ncell][2][3] what a cell answers for lies in: its middle, half its widths */
  PetscInt         n[3], *ptr, *cell; /* bins along each axis, cells of bin b: ptr[b] to ptr[b + 1] */
  PetscReal        lower[3], size[3];
  PetscReal        middle[3], half[3]; /* box that holds those of all cells, or an image of each; half < 0: no cell */
};

static PetscErrorCode get_coordinates(PointCells p, PetscInt c, PetscReal xc[])
{
  PetscFunctionBeginUser;
  if (p->mesh) PetscCall(MeshCellCoordinates(p->mesh, c, xc));
  for (PetscInt i = 0; i < p->nb * p->dim && !p->mesh; i++)
    xc[i] = p->x[p->dim * p->node[c * p->nb + i / p->dim] + i % p->dim];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The box of cell c, larger by what it answers for */
static PetscErrorCode find_box(PointCells p, PetscInt c)
{
  PetscReal x[MESH_MAX_NB * 3], low[3], high[3];

  PetscFunctionBeginUser;
  PetscCall(get_coordinates(p, c, x));
  for (PetscInt a = 0; a < p->dim; a++) {
    low[a] = high[a] = x[a];
    for (PetscInt j = 1; j < p->nb; j++) {
      low[a]  = PetscMin(low[a], x[p->dim * j + a]);
      high[a] = PetscMax(high[a], x[p->dim * j + a]);
    }
    p->box[6 * c + a]     = 0.5 * (low[a] + high[a]);
    p->box[6 * c + 3 + a] = (0.5 * p->beyond + 0.55) * (high[a] - low[a]); /* bent edges bulge between nodes */
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bin of a coordinate along axis a, of periodic axes within the period */
static PetscInt bin_of(const struct _p_PointCells *p, PetscInt a, PetscReal x)
{
  PetscInt i = (PetscInt)PetscFloorReal((x - p->lower[a]) / p->size[a]);

  if (p->period[a] > 0) return ((i % p->n[a]) + p->n[a]) % p->n[a];
  return PetscMax(0, PetscMin(p->n[a] - 1, i));
}

/* Counts (fill false) or enters cell c in the bins of its box */
static void enter(PointCells p, PetscInt c, PetscBool fill, PetscInt count[])
{
  const PetscReal *mid = p->box + 6 * c, *half = mid + 3;
  PetscInt         first[3] = {0}, last[3] = {0};

  for (PetscInt a = 0; a < p->dim; a++) {
    first[a] = (PetscInt)PetscFloorReal((mid[a] - half[a] - p->lower[a]) / p->size[a]);
    last[a] = PetscMin(first[a] + p->n[a] - 1, (PetscInt)PetscFloorReal((mid[a] + half[a] - p->lower[a]) / p->size[a]));
  }
  for (PetscInt k = first[2]; k <= last[2]; k++)
    for (PetscInt j = first[1]; j <= last[1]; j++)
      for (PetscInt i = first[0]; i <= last[0]; i++) {
        const PetscInt at[3] = {i, j, k};
        PetscInt       bin   = 0;
        PetscBool      out   = PETSC_FALSE;

        for (PetscInt a = p->dim - 1; a >= 0; a--) {
          if (p->period[a] <= 0 && (at[a] < 0 || at[a] >= p->n[a])) out = PETSC_TRUE;
          bin = bin * p->n[a] + ((at[a] % p->n[a]) + p->n[a]) % p->n[a];
        }
        if (out) continue;
        if (fill) p->cell[p->ptr[bin] + count[bin]] = c;
        count[bin]++;
      }
}

static PetscErrorCode fill_bins(PointCells p, PetscInt nbins, const PetscBool wanted[])
{
  PetscInt *count;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(nbins, &count));
  PetscCall(PetscMalloc1(nbins + 1, &p->ptr));
  for (PetscInt c = 0; c < p->ncell; c++)
    if (!wanted || wanted[c]) enter(p, c, PETSC_FALSE, count);
  p->ptr[0] = 0;
  for (PetscInt b = 0; b < nbins; b++) p->ptr[b + 1] = p->ptr[b] + count[b];
  PetscCall(PetscMalloc1(p->ptr[nbins], &p->cell));
  PetscCall(PetscArrayzero(count, nbins));
  for (PetscInt c = 0; c < p->ncell; c++)
    if (!wanted || wanted[c]) enter(p, c, PETSC_TRUE, count);
  PetscCall(PetscFree(count));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The box of all wanted cells (NULL: all), images as near as they come to the first of them */
static void find_whole(PointCells p, const PetscBool wanted[])
{
  PetscReal low[3], high[3];
  PetscInt  first = -1;

  for (PetscInt a = 0; a < 3; a++) p->half[a] = -1;
  for (PetscInt c = 0; c < p->ncell; c++) {
    if (wanted && !wanted[c]) continue;
    first = first < 0 ? c : first;
    for (PetscInt a = 0; a < p->dim; a++) {
      const PetscReal mid  = DomainNearest(p->period[a], p->box[6 * c + a], p->box[6 * first + a]),
                      half = p->box[6 * c + 3 + a];

      low[a]       = c == first ? mid - half : PetscMin(low[a], mid - half);
      high[a]      = c == first ? mid + half : PetscMax(high[a], mid + half);
      p->middle[a] = 0.5 * (low[a] + high[a]);
      p->half[a]   = 0.5 * (high[a] - low[a]);
    }
  }
}

/* Bins over the boxes of the wanted cells (NULL: all) */
static PetscErrorCode make_bins(PointCells p, const PetscBool wanted[])
{
  PetscReal low[3]  = {PETSC_MAX_REAL, PETSC_MAX_REAL, PETSC_MAX_REAL},
            high[3] = {-PETSC_MAX_REAL, -PETSC_MAX_REAL, -PETSC_MAX_REAL}, volume = 1, side;
  PetscInt n = 0, nbins = 1;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(6 * p->ncell, &p->box));
  for (PetscInt c = 0; c < p->ncell; c++) {
    const PetscReal *mid = p->box + 6 * c, *half = mid + 3;

    if (wanted && !wanted[c]) continue;
    PetscCall(find_box(p, c));
    n++;
    for (PetscInt d = 0; d < p->dim; d++) {
      low[d]  = PetscMin(low[d], mid[d] - half[d]);
      high[d] = PetscMax(high[d], mid[d] + half[d]);
    }
  }
  for (PetscInt d = 0; d < p->dim; d++) {
    if (p->period[d] > 0) low[d] = p->origin[d];
    if (p->period[d] > 0) high[d] = p->origin[d] + p->period[d];
    volume *= n ? high[d] - low[d] : 1;
  }
  side = PetscPowReal(volume / PetscMax(1, n), 1 / (PetscReal)p->dim);
  for (PetscInt d = 0; d < 3; d++) {
    p->n[d]     = d < p->dim && n ? PetscMax(1, PetscMin(4000, (PetscInt)((high[d] - low[d]) / side))) : 1;
    p->lower[d] = low[d];
    p->size[d]  = d < p->dim && n ? (high[d] - low[d]) / (PetscReal)p->n[d] : 1;
    nbins *= p->n[d];
  }
  find_whole(p, wanted);
  PetscCall(fill_bins(p, nbins, wanted));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PointCellsCreate(Mesh mesh, const PetscBool wanted[], PetscReal beyond, PointCells *cells)
{
  const MeshLocal *l;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(PetscNew(cells));
  (*cells)->mesh   = mesh;
  (*cells)->beyond = beyond;
  (*cells)->dim    = l->dim;
  (*cells)->nb     = l->nb;
  (*cells)->ncell  = l->ncell;
  for (PetscInt d = 0; d < l->dim; d++) {
    (*cells)->period[d] = l->period[d];
    (*cells)->origin[d] = l->lower[d];
  }
  PetscCall(make_bins(*cells, wanted));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PointCellsCreateOf(PetscInt dim, PetscInt ncell, const PetscInt node[], const PetscReal x[],
                                  PetscReal beyond, PointCells *cells)
{
  PetscFunctionBeginUser;
  PetscCall(PetscNew(cells));
  (*cells)->node   = node;
  (*cells)->x      = x;
  (*cells)->beyond = beyond;
  (*cells)->dim    = dim;
  (*cells)->nb     = dim == 2 ? 9 : 27;
  (*cells)->ncell  = ncell;
  PetscCall(make_bins(*cells, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PointCellsDestroy(PointCells *cells)
{
  PetscFunctionBeginUser;
  if (!*cells) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree((*cells)->box));
  PetscCall(PetscFree((*cells)->ptr));
  PetscCall(PetscFree((*cells)->cell));
  PetscCall(PetscFree(*cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool PointCellsReach(PointCells p, const PetscReal centre[], PetscReal radius)
{
  for (PetscInt a = 0; a < p->dim; a++)
    if (PetscAbsReal(DomainNearest(p->period[a], centre[a], p->middle[a]) - p->middle[a]) > p->half[a] + radius ||
        p->half[a] < 0)
      return PETSC_FALSE;
  return PETSC_TRUE;
}

/* How far x is from the middle of cell c's box, where it ends at 1 */
static PetscReal distance(const struct _p_PointCells *p, PetscInt c, const PetscReal x[])
{
  const PetscReal *mid = p->box + 6 * c, *half = mid + 3;
  PetscReal        far = 0;

  for (PetscInt a = 0; a < p->dim; a++)
    far = PetscMax(far, PetscAbsReal(DomainNearest(p->period[a], x[a], mid[a]) - mid[a]) / half[a]);
  return far;
}

/* Is x deeper in cell c than *far? */
static PetscErrorCode try_cell(PointCells p, PetscInt c, const PetscReal x[], PetscInt *cell, PetscReal xi[],
                               PetscReal *far)
{
  PetscReal xc[MESH_MAX_NB * 3], at[3], y[3], size = 0;

  PetscFunctionBeginUser;
  PetscCall(get_coordinates(p, c, xc));
  for (PetscInt a = 0; a < p->dim; a++) at[a] = DomainNearest(p->period[a], x[a], xc[p->nb / 2 * p->dim + a]);
  if (!ElementLocate(p->dim, xc, at, y)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < p->dim; a++) size = PetscMax(size, PetscAbsReal(y[a]));
  if (size >= *far || size > 1 + INSIDE + p->beyond) PetscFunctionReturn(PETSC_SUCCESS);
  *far  = size;
  *cell = c;
  for (PetscInt a = 0; a < p->dim; a++) xi[a] = y[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PointCellsFind(PointCells p, const PetscReal x[], PetscInt *cell, PetscReal xi[], PetscReal *far)
{
  PetscReal smallest = 1;
  PetscInt  bin = 0, nearest = -1;

  PetscFunctionBeginUser;
  *cell = -1;
  *far  = PETSC_MAX_REAL;
  for (PetscInt a = p->dim - 1; a >= 0; a--) bin = bin * p->n[a] + bin_of(p, a, x[a]);
  for (PetscInt e = p->ptr[bin]; e < p->ptr[bin + 1]; e++) {
    const PetscReal d = distance(p, p->cell[e], x);

    if (d <= smallest) nearest = p->cell[e];
    smallest = PetscMin(smallest, d);
  }
  if (nearest >= 0) PetscCall(try_cell(p, nearest, x, cell, xi, far));
  for (PetscInt e = p->ptr[bin]; e < p->ptr[bin + 1] && *far > 1 + INSIDE; e++)
    if (p->cell[e] != nearest && distance(p, p->cell[e], x) <= 1) PetscCall(try_cell(p, p->cell[e], x, cell, xi, far));
  PetscFunctionReturn(PETSC_SUCCESS);
}
