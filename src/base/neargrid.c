/* NearGrid: see neargrid.h. */
#include "compat.h"
#include "base/domain.h"
#include "base/neargrid.h"
#include "base/array.h"
#include <math.h>

#define GRIDS       64    /* at most */
#define ZERO        -1100 /* 2^ZERO is 0 */
#define SPACING_MIN 1e-6  /* width of a cell by that of the domain */

struct _p_NearGrid {
  PetscInt  dim, n;
  PetscReal lower[3], upper[3], period[3], mean; /* mean half-width */
  PetscReal (*x)[3], *half;
  PetscInt  ngrid, power[GRIDS]; /* of two, of the reach */
  Grid      grid[GRIDS];
  PetscInt *box[GRIDS]; /* of an item */
};

PetscErrorCode NearGridCreate(PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                              const PetscReal period[3], PetscInt n, const PetscReal (*x)[3], const PetscReal half[],
                              NearGrid *grid)
{
  NearGrid g;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&g));
  g->dim = dim;
  g->n   = n;
  for (PetscInt a = 0; a < dim; a++) {
    g->lower[a]  = lower[a];
    g->upper[a]  = upper[a];
    g->period[a] = period[a];
    g->mean      = PetscMax(g->mean, SPACING_MIN * (upper[a] - lower[a]));
  }
  PetscCall(PetscMalloc2(n, &g->x, n, &g->half));
  PetscCall(PetscArraycpy(g->x, x, n));
  PetscCall(PetscArraycpy(g->half, half, n));
  for (PetscInt i = 0; i < n; i++) g->mean += PetscMax(0, half[i]) / (PetscReal)n;
  *grid = g;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode NearGridDestroy(NearGrid *grid)
{
  NearGrid g = *grid;

  PetscFunctionBeginUser;
  if (!g) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < g->ngrid; i++) {
    PetscCall(GridDestroy(&g->grid[i]));
    PetscCall(PetscFree(g->box[i]));
  }
  PetscCall(PetscFree2(g->x, g->half));
  PetscCall(PetscFree(*grid));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode fill(const struct _p_NearGrid *g, PetscReal reach, Grid *grid, PetscInt **box)
{
  PetscInt n = 0, capacity = 0;

  PetscFunctionBeginUser;
  *box = NULL;
  PetscCall(GridCreate(g->dim, g->lower, g->upper, 2 * (g->mean + reach), 8 * g->n, grid));
  for (PetscInt i = 0; i < g->n; i++) {
    if (g->half[i] < 0) continue;
    for (DomainImages k = {0}; DomainNextImage(g->period, g->lower, g->upper, g->x[i], g->half[i] + reach, &k);) {
      PetscCall(ArrayReserve(n + 1, &capacity, box, sizeof(**box), NULL));
      (*box)[n] = i;
      PetscCall(GridInsert(*grid, n++, k.at, g->half[i] + reach));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode NearGridGet(NearGrid g, PetscReal reach, Grid *grid, const PetscInt *box[])
{
  int      power = ZERO;
  PetscInt i     = 0;

  PetscFunctionBeginUser;
  if (reach > 0) (void)frexp(reach, &power); /* reach < 2^power */
  while (i < g->ngrid && g->power[i] != power) i++;
  if (i == g->ngrid) {
    PetscCheck(i < GRIDS, PETSC_COMM_SELF, PETSC_ERR_PLIB, "Boxes are looked for with too many reaches");
    PetscCall(fill(g, ldexp(1, power), &g->grid[i], &g->box[i]));
    g->power[g->ngrid++] = power;
  }
  *grid = g->grid[i];
  *box  = g->box[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}
