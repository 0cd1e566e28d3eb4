/* Aggregates: see aggregates.h. */
#include "compat.h"
#include "aggregates.h"
#include "base/algebra.h"

/* The root of body k, and in d its place relative to that of the root: parent and offset [n][3] */
static PetscInt find_root(PetscInt parent[], PetscReal (*offset)[3], PetscInt k, PetscReal d[3])
{
  d[0] = d[1] = d[2] = 0;
  while (parent[k] != k) {
    for (PetscInt a = 0; a < 3; a++) d[a] += offset[k][a];
    k = parent[k];
  }
  return k;
}

static void unite(PetscInt parent[], PetscInt size[], PetscReal (*offset)[3], const BondView *b)
{
  PetscReal      di[3], dj[3];
  const PetscInt i = find_root(parent, offset, b->i, di), j = find_root(parent, offset, b->j, dj);
  const PetscInt up = size[i] >= size[j] ? i : j, down = up == i ? j : i;

  if (i == j) return;
  for (PetscInt a = 0; a < 3; a++) { /* place of root j in that of root i */
    const PetscReal d = di[a] + b->offset[a] - dj[a];

    offset[down][a] = down == j ? d : -d;
  }
  parent[down] = up;
  size[up] += size[down];
}

/* Sums of all aggregates: squares of distances, and the line through log N over log R */
static void measure(PetscInt n, PetscInt parent[], const PetscInt size[], PetscReal (*offset)[3], PetscReal (*sum)[4],
                    Aggregates *out)
{
  PetscReal x = 0, y = 0, xx = 0, xy = 0, d[3];
  PetscInt  m = 0;

  for (PetscInt k = 0; k < n; k++) {
    const PetscInt root = find_root(parent, offset, k, d);

    for (PetscInt a = 0; a < 3; a++) sum[root][a] += d[a];
    sum[root][3] += dot3(d, d);
  }
  for (PetscInt k = 0; k < n; k++) {
    const PetscReal N = (PetscReal)size[k];
    PetscReal       R;

    if (parent[k] != k || size[k] < 2) continue;
    R = PetscSqrtReal(PetscMax(0, sum[k][3] / N - dot3(sum[k], sum[k]) / (N * N)));
    out->aggregates++;
    out->bonded += size[k];
    out->largest = PetscMax(out->largest, size[k]);
    out->rg += R * N;
    if (R <= 0) continue;
    m++;
    x += PetscLogReal(R);
    y += PetscLogReal(N);
    xx += PetscSqr(PetscLogReal(R));
    xy += PetscLogReal(R) * PetscLogReal(N);
  }
  if (out->bonded) out->rg /= (PetscReal)out->bonded;
  if (m > 1 && m * xx - x * x > PETSC_SQRT_MACHINE_EPSILON * m * xx)
    out->dimension = (m * xy - x * y) / (m * xx - x * x);
}

/* Of every body the lowest number of its aggregate, found at the root first; -1: alone */
static void number_aggregates(PetscInt n, PetscInt parent[], const PetscInt size[], PetscReal (*offset)[3],
                              PetscInt number[])
{
  PetscReal d[3];

  for (PetscInt k = n - 1; k >= 0; k--) number[find_root(parent, offset, k, d)] = k;
  for (PetscInt k = 0; k < n; k++) {
    const PetscInt root = find_root(parent, offset, k, d);

    number[k] = size[root] > 1 ? number[root] : -1;
  }
}

PetscErrorCode AggregatesFind(PetscInt n, PetscInt nbonds, const BondView bond[], Aggregates *out, PetscInt number[])
{
  PetscInt *parent, *size;
  PetscReal(*offset)[3], (*sum)[4];

  PetscFunctionBeginUser;
  *out = (Aggregates){0};
  PetscCall(PetscMalloc2(n, &parent, n, &size));
  PetscCall(PetscCalloc2(n, &offset, n, &sum));
  for (PetscInt k = 0; k < n; k++) parent[k] = k;
  for (PetscInt k = 0; k < n; k++) size[k] = 1;
  for (PetscInt e = 0; e < nbonds; e++)
    if (bond[e].j >= 0) unite(parent, size, offset, &bond[e]);
  measure(n, parent, size, offset, sum, out);
  if (number) number_aggregates(n, parent, size, offset, number);
  PetscCall(PetscFree2(parent, size));
  PetscCall(PetscFree2(offset, sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}
