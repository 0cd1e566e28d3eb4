/* Regions: see regions.h. */
#include "compat.h"
#include "base/domain.h"
#include "base/grid.h"
#include "base/parcels.h"
#include "base/regions.h"
#include "base/room.h"
#include <math.h>

#define LEAST 1e-6  /* width of a cell of a grid by that of the domain */
#define GRIDS 64    /* at most, one a power of two of the reach */
#define ZERO  -1100 /* 2^ZERO is 0 */

struct _p_Regions {
  PetscInt  dim, n; /* boxes of all ranks, in the order of these */
  PetscReal lower[3], upper[3], period[3];
  PetscReal (*box)[2][3], mean; /* mean of their half-widths */
  PetscMPIInt *rank;
  PetscInt     ngrid, power[GRIDS];
  Grid         grid[GRIDS];
  PetscInt    *item[GRIDS];           /* box of an item, which is one or an image of one */
  PetscInt     question, *last, room; /* last [ranks]: question that a rank was the answer of last */
  PetscMPIInt *answer;
};

static PetscReal half_width(const struct _p_Regions *r, PetscInt i)
{
  PetscReal half = 0;

  for (PetscInt a = 0; a < r->dim; a++) half = PetscMax(half, 0.5 * (r->box[i][1][a] - r->box[i][0][a]));
  return half;
}

static PetscErrorCode fill_grid(Regions r, PetscReal reach, Grid *grid, PetscInt **item)
{
  PetscInt n = 0, room = 0;

  PetscFunctionBeginUser;
  *item = NULL;
  PetscCall(GridCreate(r->dim, r->lower, r->upper, 2 * (r->mean + reach), 8 * r->n, grid));
  for (PetscInt i = 0; i < r->n; i++) {
    const PetscReal half = half_width(r, i) + reach;
    PetscReal       x[3];

    for (PetscInt a = 0; a < 3; a++) x[a] = 0.5 * (r->box[i][0][a] + r->box[i][1][a]);
    for (DomainImages k = {0}; DomainNextImage(r->period, r->lower, r->upper, x, half, &k);) {
      PetscCall(RoomFor(n + 1, &room, item, sizeof(**item), NULL));
      (*item)[n] = i;
      PetscCall(GridInsert(*grid, n++, k.at, half));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The number of the grid for a reach */
static PetscErrorCode find_grid(Regions r, PetscReal reach, PetscInt *number)
{
  int power = ZERO;

  PetscFunctionBeginUser;
  if (reach > 0) (void)frexp(reach, &power); /* reach <= 2^power */
  for (*number = 0; *number < r->ngrid && r->power[*number] != power; (*number)++) {}
  if (*number < r->ngrid) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(r->ngrid < GRIDS, PETSC_COMM_SELF, PETSC_ERR_PLIB, "Ranks are asked for with too many reaches");
  PetscCall(fill_grid(r, ldexp(1, power), &r->grid[r->ngrid], &r->item[r->ngrid]));
  r->power[r->ngrid++] = power;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RegionsCreate(MPI_Comm comm, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3], const PetscReal period[3], PetscInt n,
                             PetscReal (*box)[2][3], Regions *regions)
{
  Regions     r;
  PetscMPIInt size;
  PetscInt    zero;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&r));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  r->dim = dim;
  for (PetscInt a = 0; a < dim; a++) {
    r->lower[a]  = lower[a];
    r->upper[a]  = upper[a];
    r->period[a] = period[a];
  }
  PetscCall(ParcelsGather(comm, n, sizeof(*box), box, &r->n, &r->box, &r->rank));
  for (PetscInt a = 0; a < dim; a++) r->mean = PetscMax(r->mean, LEAST * (upper[a] - lower[a]));
  for (PetscInt i = 0; i < r->n; i++) r->mean += half_width(r, i) / (PetscReal)r->n;
  PetscCall(PetscCalloc1(size, &r->last));
  PetscCall(find_grid(r, 0, &zero));
  *regions = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RegionsDestroy(Regions *regions)
{
  Regions r = *regions;

  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < r->ngrid; i++) {
    PetscCall(GridDestroy(&r->grid[i]));
    PetscCall(PetscFree(r->item[i]));
  }
  PetscCall(PetscFree(r->box));
  PetscCall(PetscFree(r->rank));
  PetscCall(PetscFree(r->last));
  PetscCall(PetscFree(r->answer));
  PetscCall(PetscFree(*regions));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Square of the distance of x to box i or its nearest image */
static PetscReal distance_to_box(const struct _p_Regions *r, PetscInt i, const PetscReal x[3])
{
  PetscReal sum = 0;

  for (PetscInt a = 0; a < r->dim; a++) {
    PetscReal d = PETSC_MAX_REAL;

    for (PetscInt image = r->period[a] > 0 ? -1 : 0; image <= (r->period[a] > 0 ? 1 : 0); image++) {
      const PetscReal y = x[a] + image * r->period[a];

      d = PetscMin(d, PetscMax(0, PetscMax(r->box[i][0][a] - y, y - r->box[i][1][a])));
    }
    sum += d * d;
  }
  return sum;
}

static void wrap(const struct _p_Regions *r, const PetscReal x[3], PetscReal y[3])
{
  for (PetscInt a = 0; a < 3; a++) y[a] = a < r->dim ? DomainWrap(r->period[a], x[a], r->lower[a]) : 0;
}

PetscErrorCode RegionsNear(Regions r, const PetscReal x[3], PetscReal reach, PetscInt *n, const PetscMPIInt *rank[])
{
  PetscInt  g, count = 0;
  PetscReal y[3];

  PetscFunctionBeginUser;
  PetscCall(find_grid(r, reach, &g));
  wrap(r, x, y);
  r->question++;
  for (PetscInt e = GridFirst(r->grid[g], y); e >= 0; e = GridNext(r->grid[g], e)) {
    const PetscInt i = r->item[g][GridItem(r->grid[g], e)];

    if (r->last[r->rank[i]] == r->question || distance_to_box(r, i, y) >= reach * reach) continue;
    r->last[r->rank[i]] = r->question;
    PetscCall(RoomFor(count + 1, &r->room, &r->answer, sizeof(*r->answer), NULL));
    r->answer[count++] = r->rank[i];
  }
  PetscCall(PetscSortMPIInt(count, r->answer));
  *n    = count;
  *rank = r->answer;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscMPIInt RegionsOwner(Regions r, const PetscReal x[3])
{
  PetscInt  best  = r->n;
  PetscReal least = PETSC_MAX_REAL, y[3];

  wrap(r, x, y);
  for (PetscInt e = GridFirst(r->grid[0], y); e >= 0; e = GridNext(r->grid[0], e)) {
    const PetscInt i = r->item[0][GridItem(r->grid[0], e)];

    if (i < best && distance_to_box(r, i, y) <= 0) best = i;
  }
  for (PetscInt i = 0, found = best; i < r->n && found == r->n; i++) {
    const PetscReal d = distance_to_box(r, i, y);

    if (d < least) best = i;
    least = PetscMin(least, d);
  }
  return r->rank[best];
}
