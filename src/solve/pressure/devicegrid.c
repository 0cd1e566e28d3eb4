/* Devicegrid: see devicegrid.h */
#include "compat.h"
#include "devicegrid.h"
#include <stdlib.h>

#define OFF     1e-6 /* of an interval: how far points of a lattice may be off */
#define SHORT   1.5  /* times the shortest interval: axes that take part */
#define TERMS   64   /* vertices that one has its value from, at most */
#define NOT_ONE -1

/* Vertices by the numbers of their lattice points, ascending */
typedef struct {
  PetscInt64 key;
  PetscInt   i;
} Place;

typedef struct {
  const DeviceGrid *g;
  Place            *place; /* [g->n] */
} Index;

/* A vertex as a sum of others */
typedef struct {
  PetscInt  n, from[TERMS];
  PetscReal weight[TERMS];
  PetscBool fails;
} Sum;

static PetscInt64 key_of(const DeviceGrid *g, const PetscInt at[3])
{
  return ((PetscInt64)at[2] * (g->size[1] + 1) + at[1]) * (g->size[0] + 1) + at[0];
}

static int compare(const void *a, const void *b)
{
  const PetscInt64 x = ((const Place *)a)->key, y = ((const Place *)b)->key;

  return (x > y) - (x < y);
}

static PetscErrorCode index_points(const DeviceGrid *g, Index *index)
{
  PetscFunctionBeginUser;
  index->g = g;
  PetscCall(PetscMalloc1(g->n, &index->place));
  for (PetscInt i = 0; i < g->n; i++) index->place[i] = (Place){key_of(g, g->at[i]), i};
  qsort(index->place, (size_t)g->n, sizeof(Place), compare);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Vertex at a lattice point, or NOT_ONE */
static PetscInt find_point(const Index *index, const PetscInt at[3])
{
  const Place  key   = {key_of(index->g, at), 0};
  const Place *found = (const Place *)bsearch(&key, index->place, (size_t)index->g->n, sizeof(Place), compare);

  return found ? found->i : NOT_ONE;
}

/* ---- the finest lattice ---- */

/* Shortest sides of cells along the axes */
static PetscErrorCode find_intervals(Mesh mesh, const MeshLocal *l, PetscReal h[3])
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) h[a] = PETSC_MAX_REAL;
  for (PetscInt c = 0; c < l->ncell; c++) {
    static const PetscInt END[3] = {2, 6, 18}; /* corners beside the first, by lattice position */
    PetscReal             x[81];

    PetscCall(MeshCellCoordinates(mesh, c, x));
    for (PetscInt a = 0; a < 3; a++) h[a] = PetscMin(h[a], PetscAbsReal(x[END[a] * 3 + a] - x[a]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* x in intervals from the lower end; is it at one? */
static PetscBool round_point(PetscReal x, PetscReal h, PetscInt *at)
{
  const PetscReal n = PetscFloorReal(x / h + 0.5);

  *at = (PetscInt)n;
  return (PetscBool)(PetscAbsReal(x / h - n) <= OFF);
}

PetscErrorCode DeviceGridCreate(Mesh mesh, Transfer transfer, DeviceGrid *g)
{
  const MeshLocal *l;
  const PetscInt  *global, *node;
  PetscInt         own;
  PetscBool        fits = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  *g = (DeviceGrid){.tree = (PetscBool)(l->hang != NULL)};
  PetscCall(TransferGetVertices(transfer, &own, &g->n, &global, &node));
  if (l->dim != 3 || own != g->n || g->n == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_intervals(mesh, l, g->h));
  for (PetscInt a = 0; a < 3; a++) {
    g->period[a] = (PetscBool)(l->period[a] > 0);
    fits         = (PetscBool)(fits && g->h[a] > 0 && round_point(l->upper[a] - l->lower[a], g->h[a], &g->size[a]));
  }
  if (!fits) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(g->n, &g->at));
  for (PetscInt i = 0; i < l->nnode_all && fits; i++)
    for (PetscInt a = 0; a < 3 && node[i] >= 0; a++) {
      fits = (PetscBool)(fits && round_point(l->x[i * 3 + a] - l->lower[a], g->h[a], &g->at[node[i]][a]));
      if (g->period[a]) g->at[node[i]][a] %= g->size[a];
    }
  if (!fits) PetscCall(PetscFree(g->at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceGridDestroy(DeviceGrid *g)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(g->at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- to one of twice the width ---- */

/* Which axes take part; is there one? */
static PetscBool choose_axes(const DeviceGrid *g, PetscBool halve[3])
{
  PetscReal smallest = PETSC_MAX_REAL;
  PetscBool can[3];

  for (PetscInt a = 0; a < 3; a++) {
    can[a] = (PetscBool)(g->size[a] > (g->period[a] ? 2 : 1));
    if (can[a]) smallest = PetscMin(smallest, g->h[a]);
  }
  for (PetscInt a = 0; a < 3; a++) halve[a] = (PetscBool)(can[a] && (g->tree || g->h[a] <= SHORT * smallest));
  return (PetscBool)(halve[0] || halve[1] || halve[2]);
}

/* Does axis a of the wider lattice have this point? The ends of an axis it has. */
static PetscBool has_point(const DeviceGrid *g, const PetscBool halve[3], const PetscInt at[3], PetscInt a)
{
  return (PetscBool)(!halve[a] || at[a] % 2 == 0 || (!g->period[a] && at[a] == g->size[a]));
}

/* sum += weight times the value at a point of the lattice of `index`: of its vertex there, else of its neighbours
   `step` away along the axes where it lies between points twice as far apart */
static void add_point(const Index *index, const PetscInt at[3], PetscInt step, PetscReal weight, Sum *sum)
{
  const DeviceGrid *g    = index->g;
  const PetscInt    i    = find_point(index, at);
  PetscInt          axes = 0, axis[3];

  if (i != NOT_ONE) {
    PetscInt k = 0;

    while (k < sum->n && sum->from[k] != i) k++;
    if (k == TERMS) sum->fails = PETSC_TRUE;
    if (sum->fails) return;
    if (k == sum->n) sum->weight[sum->n] = 0, sum->from[sum->n++] = i;
    sum->weight[k] += weight;
    return;
  }
  for (PetscInt a = 0; a < 3; a++)
    if (at[a] / step % 2) axis[axes++] = a;
  if (step > g->size[0] && step > g->size[1] && step > g->size[2]) sum->fails = PETSC_TRUE;
  if (sum->fails) return;
  if (!axes) add_point(index, at, 2 * step, weight, sum);
  for (PetscInt k = 0; axes && k < 1 << axes; k++) {
    PetscInt to[3] = {at[0], at[1], at[2]};

    for (PetscInt e = 0; e < axes; e++) {
      const PetscInt a = axis[e];

      to[a] += (k >> e & 1) ? step : -step;
      if (g->period[a]) to[a] = (to[a] + g->size[a]) % g->size[a];
      if (to[a] > g->size[a]) sum->fails = PETSC_TRUE;
    }
    add_point(index, to, step, weight / (1 << axes), sum);
  }
}

/* The row of vertex i: between which points of the wider lattice it lies */
static void find_row(const DeviceGrid *g, const PetscBool halve[3], const Index *coarse, PetscInt i, Sum *sum)
{
  const PetscInt *at   = g->at[i];
  PetscInt        axes = 0, axis[3];

  sum->n     = 0;
  sum->fails = PETSC_FALSE;
  for (PetscInt a = 0; a < 3; a++)
    if (!has_point(g, halve, at, a)) axis[axes++] = a;
  for (PetscInt k = 0; k < 1 << axes; k++) {
    PetscInt to[3];

    for (PetscInt a = 0; a < 3; a++) to[a] = halve[a] ? (at[a] + 1) / 2 : at[a];
    for (PetscInt e = 0; e < axes; e++) {
      const PetscInt a = axis[e];

      to[a] = at[a] / 2 + (k >> e & 1);
      if (g->period[a]) to[a] %= coarse->g->size[a];
    }
    add_point(coarse, to, 1, 1. / (1 << axes), sum);
  }
}

static PetscErrorCode fill(const DeviceGrid *g, const PetscBool halve[3], const Index *coarse, Mat P, PetscBool *fails)
{
  PetscFunctionBeginUser;
  *fails = PETSC_FALSE;
  for (PetscInt i = 0; i < g->n && !*fails; i++) {
    Sum sum;

    find_row(g, halve, coarse, i, &sum);
    *fails = sum.fails;
    PetscCall(MatSetValues(P, 1, &i, sum.n, sum.from, sum.weight, INSERT_VALUES));
  }
  PetscCall(MatAssemblyBegin(P, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(P, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceGridCoarsen(const DeviceGrid *g, DeviceGrid *coarse, Mat *P)
{
  PetscBool halve[3], fails;
  Index     index;

  PetscFunctionBeginUser;
  *P         = NULL;
  *coarse    = *g;
  coarse->at = NULL;
  coarse->n  = 0;
  if (!choose_axes(g, halve)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < 3; a++)
    if (halve[a]) {
      coarse->size[a] = (g->size[a] + 1) / 2;
      coarse->h[a]    = 2 * g->h[a];
    }
  PetscCall(PetscMalloc1(g->n, &coarse->at));
  for (PetscInt i = 0; i < g->n; i++) {
    if (!has_point(g, halve, g->at[i], 0) || !has_point(g, halve, g->at[i], 1) || !has_point(g, halve, g->at[i], 2))
      continue;
    for (PetscInt a = 0; a < 3; a++) coarse->at[coarse->n][a] = halve[a] ? (g->at[i][a] + 1) / 2 : g->at[i][a];
    coarse->n++;
  }
  PetscCall(index_points(coarse, &index));
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, g->n, coarse->n, g->tree ? TERMS : 8, NULL, P));
  PetscCall(MatSetOption(*P, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE)); /* around holes there are more */
  PetscCall(fill(g, halve, &index, *P, &fails));
  PetscCall(PetscFree(index.place));
  if (fails) PetscCall(MatDestroy(P));
  if (fails) PetscCall(DeviceGridDestroy(coarse));
  PetscFunctionReturn(PETSC_SUCCESS);
}
