/* RankBoxes: see rankboxes.h. */
#include "compat.h"
#include "base/domain.h"
#include "base/neargrid.h"
#include "base/sparse.h"
#include "base/rankboxes.h"
#include "base/array.h"

struct _p_RankBoxes {
  PetscInt  dim, n; /* boxes of all ranks, in the order of these */
  PetscReal lower[3], period[3];
  PetscReal (*box)[2][3];
  PetscMPIInt    *rank; /* [n] */
  NearGrid        near;
  Grid            inside; /* of the boxes themselves */
  const PetscInt *inside_box;
  PetscInt        question, *last, capacity; /* last [ranks]: question that a rank was the answer of last */
  PetscMPIInt    *answer;
};

static PetscErrorCode create_grid(RankBoxes r, const PetscReal upper[3])
{
  PetscReal(*x)[3], *half;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(r->n, &x, r->n, &half));
  for (PetscInt i = 0; i < r->n; i++) {
    half[i] = 0;
    for (PetscInt a = 0; a < 3; a++) {
      x[i][a] = 0.5 * (r->box[i][0][a] + r->box[i][1][a]);
      if (a < r->dim) half[i] = PetscMax(half[i], 0.5 * (r->box[i][1][a] - r->box[i][0][a]));
    }
  }
  PetscCall(NearGridCreate(r->dim, r->lower, upper, r->period, r->n, (const PetscReal(*)[3])x, half, &r->near));
  PetscCall(NearGridGet(r->near, 0, &r->inside, &r->inside_box));
  PetscCall(PetscFree2(x, half));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RankBoxesCreate(MPI_Comm comm, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                               const PetscReal period[3], PetscInt n, PetscReal (*box)[2][3], RankBoxes *regions)
{
  RankBoxes   r;
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&r));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  r->dim = dim;
  for (PetscInt a = 0; a < dim; a++) {
    r->lower[a]  = lower[a];
    r->period[a] = period[a];
  }
  PetscCall(SparseGather(comm, n, sizeof(*box), box, &r->n, &r->box, &r->rank));
  PetscCall(PetscCalloc1(size, &r->last));
  PetscCall(create_grid(r, upper));
  *regions = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RankBoxesDestroy(RankBoxes *regions)
{
  RankBoxes r = *regions;

  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(NearGridDestroy(&r->near));
  PetscCall(PetscFree(r->box));
  PetscCall(PetscFree(r->rank));
  PetscCall(PetscFree(r->last));
  PetscCall(PetscFree(r->answer));
  PetscCall(PetscFree(*regions));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Square of the distance of x to box i or its nearest image */
static PetscReal distance_to_box(const struct _p_RankBoxes *r, PetscInt i, const PetscReal x[3])
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

static void wrap(const struct _p_RankBoxes *r, const PetscReal x[3], PetscReal y[3])
{
  for (PetscInt a = 0; a < 3; a++) y[a] = a < r->dim ? DomainWrap(r->period[a], x[a], r->lower[a]) : 0;
}

PetscErrorCode RankBoxesNear(RankBoxes r, const PetscReal x[3], PetscReal reach, PetscInt *n, const PetscMPIInt *rank[])
{
  PetscInt        count = 0;
  const PetscInt *box;
  PetscReal       y[3];
  Grid            grid;

  PetscFunctionBeginUser;
  PetscCall(NearGridGet(r->near, reach, &grid, &box));
  wrap(r, x, y);
  r->question++;
  for (PetscInt e = GridFirst(grid, y); e >= 0; e = GridNext(grid, e)) {
    const PetscInt i = box[GridItem(grid, e)];

    if (r->last[r->rank[i]] == r->question || distance_to_box(r, i, y) >= reach * reach) continue;
    r->last[r->rank[i]] = r->question;
    PetscCall(ArrayReserve(count + 1, &r->capacity, &r->answer, sizeof(*r->answer), NULL));
    r->answer[count++] = r->rank[i];
  }
  PetscCall(PetscSortMPIInt(count, r->answer));
  *n    = count;
  *rank = r->answer;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RankBoxesSend(RankBoxes r, PetscInt n, const PetscReal (*x)[3], const PetscReal reach[], PetscInt *m,
                             PetscMPIInt **to, PetscInt **which)
{
  PetscInt capacity = 0;

  PetscFunctionBeginUser;
  *m     = 0;
  *to    = NULL;
  *which = NULL;
  for (PetscInt i = 0; i < n; i++) {
    const PetscMPIInt *rank;
    PetscInt           count;

    PetscCall(RankBoxesNear(r, x[i], reach[i], &count, &rank));
    PetscCall(ArrayReserve(*m + count, &capacity, to, sizeof(**to), which, sizeof(**which), NULL));
    for (PetscInt k = 0; k < count; k++) {
      (*to)[*m]        = rank[k];
      (*which)[(*m)++] = i;
    }
  }
  PetscCall(PetscSortMPIIntWithIntArray((PetscMPIInt)*m, *to, *which));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscMPIInt RankBoxesOwner(RankBoxes r, const PetscReal x[3])
{
  PetscInt  best    = r->n;
  PetscReal nearest = PETSC_MAX_REAL, y[3];

  wrap(r, x, y);
  for (PetscInt e = GridFirst(r->inside, y); e >= 0; e = GridNext(r->inside, e)) {
    const PetscInt i = r->inside_box[GridItem(r->inside, e)];

    if (i < best && distance_to_box(r, i, y) <= 0) best = i;
  }
  for (PetscInt i = 0, found = best; i < r->n && found == r->n; i++) {
    const PetscReal d = distance_to_box(r, i, y);

    if (d < nearest) best = i;
    nearest = PetscMin(nearest, d);
  }
  return r->rank[best];
}
