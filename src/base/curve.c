/* Curve: see base/curve.h. */
#include "compat.h"
#include "base/curve.h"

struct _p_Curve {
  PetscInt    dim, cells[3];
  PetscReal  *line[3];
  PetscMPIInt size;
  uint64_t   *first;
};

/* Bits of x spread to every second (third) place */
static uint64_t spread(PetscInt dim, uint64_t x)
{
  if (dim == 2) {
    x = (x | x << 16) & 0x0000FFFF0000FFFFu;
    x = (x | x << 8) & 0x00FF00FF00FF00FFu;
    x = (x | x << 4) & 0x0F0F0F0F0F0F0F0Fu;
    x = (x | x << 2) & 0x3333333333333333u;
    return (x | x << 1) & 0x5555555555555555u;
  }
  x = (x | x << 32) & 0x001F00000000FFFFu;
  x = (x | x << 16) & 0x001F0000FF0000FFu;
  x = (x | x << 8) & 0x100F00F00F00F00Fu;
  x = (x | x << 4) & 0x10C30C30C30C30C3u;
  return (x | x << 2) & 0x1249249249249249u;
}

uint64_t CurveKey(PetscInt dim, const PetscInt x[])
{
  uint64_t key = 0;

  for (PetscInt d = 0; d < dim; d++) key |= spread(dim, (uint64_t)x[d]) << d;
  return key;
}

PetscMPIInt CurveRank(PetscMPIInt size, const uint64_t first[], uint64_t key)
{
  PetscMPIInt low = 0, high = size;

  while (high - low > 1) {
    const PetscMPIInt middle = (low + high) / 2;

    if (first[middle] <= key) low = middle;
    else high = middle;
  }
  return low;
}

PetscErrorCode CurveCreate(PetscInt dim, const PetscInt cells[], const PetscReal *const line[], PetscMPIInt size,
                           const uint64_t first[], Curve *curve)
{
  Curve c;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  c->dim  = dim;
  c->size = size;
  PetscCall(PetscMalloc1(size, &c->first));
  PetscCall(PetscArraycpy(c->first, first, size));
  for (PetscInt d = 0; d < dim; d++) {
    c->cells[d] = cells[d];
    PetscCall(PetscMalloc1(cells[d] + 1, &c->line[d]));
    PetscCall(PetscArraycpy(c->line[d], line[d], cells[d] + 1));
  }
  *curve = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CurveDestroy(Curve *curve)
{
  PetscFunctionBeginUser;
  if (!*curve) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt d = 0; d < 3; d++) PetscCall(PetscFree((*curve)->line[d]));
  PetscCall(PetscFree((*curve)->first));
  PetscCall(PetscFree(*curve));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscMPIInt CurveOwner(Curve c, const PetscReal x[])
{
  PetscInt cell[3] = {0, 0, 0};

  for (PetscInt d = 0; d < c->dim; d++)
    for (PetscInt high = c->cells[d]; high - cell[d] > 1;) {
      const PetscInt middle = (cell[d] + high) / 2;

      if (x[d] < c->line[d][middle]) high = middle;
      else cell[d] = middle;
    }
  return CurveRank(c->size, c->first, CurveKey(c->dim, cell));
}
