/* Grid: search grid with linked lists, see grid.h.

   Method: every box is registered in all cells it touches (entries form one linked list a cell). A pair that shares
   several cells is reported in one of them only, the cell at the lower corner of the overlap of their cell ranges, so
   no list of seen pairs is needed. Cost is proportional to the number of entries plus the pairs that share a cell. Does
   not handle periodic directions. */
#include "compat.h"
#include "base/grid.h"
#include "base/array.h"

struct _p_Grid {
  PetscInt  dim, n[3], nentries, entry_capacity, item_capacity;
  PetscReal lower[3], inverse[3]; /* inverse: cells per unit length */
  PetscInt *head;                 /* [cells] first entry, -1 = none */
  PetscInt *next, *item;          /* [nentries] */
  PetscInt (*corner)[3];          /* [items] lowest cell of each item */
};

static PetscInt locate_axis(Grid c, PetscInt a, PetscReal x)
{
  const PetscReal s = PetscFloorReal((x - c->lower[a]) * c->inverse[a]);

  return s > 0 ? (s < c->n[a] - 1 ? (PetscInt)s : c->n[a] - 1) : 0;
}

static PetscInt flat_index(Grid c, const PetscInt i[3])
{
  return (i[2] * c->n[1] + i[1]) * c->n[0] + i[0];
}

static PetscErrorCode add_entry(Grid c, PetscInt cell, PetscInt item)
{
  PetscFunctionBeginUser;
  PetscCall(
    ArrayReserve(c->nentries + 1, &c->entry_capacity, &c->next, sizeof(*c->next), &c->item, sizeof(*c->item), NULL));
  c->item[c->nentries] = item;
  c->next[c->nentries] = c->head[cell];
  c->head[cell]        = c->nentries++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode GridCreate(PetscInt dim, const PetscReal lower[3], const PetscReal upper[3], PetscReal size,
                          PetscInt max_cells, Grid *cells)
{
  Grid      c;
  PetscReal total = 1, n[3] = {1, 1, 1};

  PetscFunctionBeginUser;
  PetscCheck(dim == 2 || dim == 3, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "Search grid of dimension %" PetscInt_FMT ": use 2 or 3", dim);
  PetscCheck(size > 0, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "Search grid with cells of width %g: use a positive width", (double)size);
  PetscCall(PetscNew(&c));
  c->dim = dim;
  for (PetscInt a = 0; a < dim; a++) {
    n[a] = PetscMax(1, PetscFloorReal((upper[a] - lower[a]) / size));
    total *= n[a];
  }
  for (; total > PetscMax(1, max_cells);) {
    total = 1;
    for (PetscInt a = 0; a < dim; a++) {
      n[a] = PetscMax(1, PetscFloorReal(n[a] / 2));
      total *= n[a];
    }
  }
  for (PetscInt a = 0; a < 3; a++) {
    c->n[a]       = (PetscInt)n[a];
    c->lower[a]   = a < dim ? lower[a] : 0;
    c->inverse[a] = a < dim && upper[a] > lower[a] ? n[a] / (upper[a] - lower[a]) : 0;
  }
  PetscCall(PetscMalloc1((PetscInt)total, &c->head));
  for (PetscInt i = 0; i < (PetscInt)total; i++) c->head[i] = -1;
  *cells = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode GridDestroy(Grid *cells)
{
  Grid c = *cells;

  PetscFunctionBeginUser;
  if (!c) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree(c->head));
  PetscCall(PetscFree(c->next));
  PetscCall(PetscFree(c->item));
  PetscCall(PetscFree(c->corner));
  PetscCall(PetscFree(*cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode GridInsert(Grid c, PetscInt item, const PetscReal x[3], PetscReal half)
{
  PetscInt lo[3] = {0, 0, 0}, hi[3] = {0, 0, 0}, i[3];

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(item + 1, &c->item_capacity, &c->corner, sizeof(*c->corner), NULL));
  for (PetscInt a = 0; a < c->dim; a++) {
    lo[a] = locate_axis(c, a, x[a] - half);
    hi[a] = locate_axis(c, a, x[a] + half);
  }
  PetscCall(PetscArraycpy(c->corner[item], lo, 3));
  for (i[2] = lo[2]; i[2] <= hi[2]; i[2]++)
    for (i[1] = lo[1]; i[1] <= hi[1]; i[1]++)
      for (i[0] = lo[0]; i[0] <= hi[0]; i[0]++) PetscCall(add_entry(c, flat_index(c, i), item));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscInt GridFirst(Grid c, const PetscReal x[3])
{
  PetscInt i[3] = {0, 0, 0};

  for (PetscInt a = 0; a < c->dim; a++) i[a] = locate_axis(c, a, x[a]);
  return c->head[flat_index(c, i)];
}

PetscInt GridNext(Grid c, PetscInt entry)
{
  return c->next[entry];
}

PetscInt GridItem(Grid c, PetscInt entry)
{
  return c->item[entry];
}

PetscErrorCode GridForPairs(Grid c, GridVisit visit, void *ctx)
{
  const PetscInt ncells = c->n[0] * c->n[1] * c->n[2];
  PetscInt       overlap[3];

  PetscFunctionBeginUser;
  for (PetscInt cell = 0; cell < ncells; cell++)
    for (PetscInt e = c->head[cell]; e >= 0; e = c->next[e])
      for (PetscInt f = c->next[e]; f >= 0; f = c->next[f]) {
        const PetscInt i = PetscMin(c->item[e], c->item[f]), j = PetscMax(c->item[e], c->item[f]);

        for (PetscInt a = 0; a < 3; a++) overlap[a] = PetscMax(c->corner[i][a], c->corner[j][a]);
        if (flat_index(c, overlap) == cell) PetscCall(visit(ctx, i, j));
      }
  PetscFunctionReturn(PETSC_SUCCESS);
}
