/* Align, mend: hexahedra that are nearly flat, at tips and edges whose radius is a few cells
   (runs/studies/aligned-space).

   In every round the vertices of cells with a ratio of Jacobians below AIM try steps of one length: eight in the
   tangent plane of the surface, from where wall vertices go back to the closest point, and for other vertices two
   along the normal. A vertex keeps the step after which the cells around it lack least of AIM, summed. Vertices without
   a common cell move together, those with the larger random number of their place first: the result does not depend on
   the ranks. Cells that stay flat are for the check to judge. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/mix.h"

#define AIM    0.005
#define NROUND 30
#define MARGIN 1e-6 /* share by which a step must be better, lest round-off decides */

static const PetscReal STEP[3] = {0.12, 0.05, 0.02}; /* of the rounds in turn, cell sizes */

/* What a vertex is in a round; s->work */
enum {
  IDLE,
  WAITS,
  MOVES
};

/* What the fluid cells around vertex i lack */
static PetscReal shortfall(Align s, PetscInt i)
{
  const MeshLocal *l   = s->loc;
  PetscReal        sum = 0;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++)
    if (AlignIsCellActive(s, l->node_cell[e])) sum += PetscMax(0, AIM - AlignCellQuality(s, l->node_cell[e], NULL));
  return sum;
}

static PetscErrorCode place_around(Align s, PetscInt i)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  PetscCall(AlignPlaceAgain(s, l->node_cell_ptr[i + 1] - l->node_cell_ptr[i], l->node_cell + l->node_cell_ptr[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Normal of the wall that vertex i belongs to, and two tangents */
static PetscErrorCode find_axes(Align s, PetscInt i, PetscReal n[3], PetscReal t[2][3])
{
  const PetscInt k = s->level[i] / 8;
  PetscReal      x[3], size;

  PetscFunctionBeginUser;
  AlignOffset(s, k, AlignCentreOf(s, k), i, PETSC_FALSE, x);
  for (PetscInt a = 0; a < 3; a++) x[a] = AlignCentreOf(s, k)[a] + x[a] + s->d[3 * i + a];
  PetscCall(AlignWallNormal(s, k, x, 1e-3 * s->grid.size[i], n));
  for (PetscInt a = 0; a < 3; a++) t[1][a] = (a == 0) == (PetscAbsReal(n[0]) < 0.6) && a < 2; /* an axis far from n */
  cross(n, t[1], t[0]);
  size = PetscMax(PetscSqrtReal(dot3(t[0], t[0])), PETSC_SMALL);
  for (PetscInt a = 0; a < 3; a++) t[0][a] /= size;
  cross(n, t[0], t[1]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own vertex i: the best of its steps */
static PetscErrorCode move_vertex(Align s, PetscInt i, PetscReal step)
{
  const PetscBool wall = (PetscBool)(s->level[i] % 8 == 1);
  PetscReal       low = shortfall(s, i), n[3] = {0}, t[2][3] = {{0}}, *d = s->d + 3 * i, from[3], best[3];

  PetscFunctionBeginUser;
  if (low == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_axes(s, i, n, t));
  for (PetscInt a = 0; a < 3; a++) from[a] = best[a] = d[a];
  for (PetscInt e = 0; e < (wall ? 8 : 10); e++) {
    const PetscReal c[3] = {e < 8 ? PetscCosReal(e * PETSC_PI / 4) : 0, e < 8 ? PetscSinReal(e * PETSC_PI / 4) : 0,
                            e < 8 ? 0 : 17 - 2 * e};
    PetscReal lack;

    for (PetscInt a = 0; a < 3; a++) d[a] = from[a] + step * (c[0] * t[0][a] + c[1] * t[1][a] + c[2] * n[a]);
    if (s->grid.side[i]) AlignKeepOnSides(s, i);
    if (wall) PetscCall(AlignProjectNodes(s, 1, &i, PETSC_FALSE));
    PetscCall(place_around(s, i));
    lack = shortfall(s, i);
    if (lack >= (1 - MARGIN) * low) continue;
    low = lack;
    for (PetscInt a = 0; a < 3; a++) best[a] = d[a];
  }
  for (PetscInt a = 0; a < 3; a++) d[a] = best[a];
  PetscCall(place_around(s, i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- whose turn it is ---- */

/* A random number that belongs to the place of node i */
static uint64_t tie_number(Align s, PetscInt i)
{
  uint64_t z = 0;

  for (PetscInt a = 0; a < 3; a++) {
    double   x = (double)s->loc->x_start[3 * i + a] + 0.0;
    uint64_t bits;

    (void)memcpy(&bits, &x, sizeof(bits));
    z = Mix64(z + MIX_STEP + bits);
  }
  return z;
}

/* Is own vertex i first among those that wait in the cells around it? */
static PetscBool is_first(Align s, PetscInt i)
{
  const MeshLocal *l    = s->loc;
  const uint64_t   mine = tie_number(s, i);

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++)
    for (PetscInt v = 0; v < 8; v++) {
      const PetscInt j = AlignCellNodes(s, l->node_cell[e])[CORNER[v]];

      if (j != i && s->work[j] == WAITS && tie_number(s, j) > mine) return PETSC_FALSE;
    }
  return PETSC_TRUE;
}

/* Vertices of flat cells that may move wait: list of own and ghost ones; *any: on some rank? */
static PetscErrorCode find_waiting(Align s, List *list, PetscBool *any)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  list->n = 0;
  for (PetscInt e = 0; e < s->touched.n; e++) {
    const PetscInt c = s->touched.i[e];

    if (c >= l->ncell || !AlignIsCellActive(s, c) || AlignCellQuality(s, c, NULL) >= AIM) continue;
    for (PetscInt v = 0; v < 8; v++)
      if (s->level[AlignCellNodes(s, c)[CORNER[v]]] && s->corners.at[AlignCellNodes(s, c)[CORNER[v]]] == 0)
        s->work[AlignCellNodes(s, c)[CORNER[v]]] = 1;
  }
  PetscCall(MeshSumNodes(s->mesh, 1, s->work));
  PetscCall(MeshSyncNodes(s->mesh, 1, s->work));
  for (PetscInt e = 0; e < s->ring.n; e++) {
    const PetscInt i = s->ring.i[e];

    if (s->work[i] <= 0) continue;
    if (s->pull && s->pull[i] > 0) { /* it has left the surface, and has its place */
      s->work[i] = IDLE;
      continue;
    }
    s->work[i] = WAITS;
    PetscCall(AlignListAdd(list, i));
  }
  *any = (PetscBool)(list->n > 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, any, 1, COMPAT_MPI_BOOL, MPI_LOR, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Those whose turn it is move, on all ranks; *left: does anyone still wait? */
static PetscErrorCode move_first(Align s, const List *list, PetscReal step, PetscBool *left)
{
  List first = {0, 0, NULL};

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < list->n; e++)
    if (list->i[e] < s->loc->nnode && s->work[list->i[e]] == WAITS && is_first(s, list->i[e]))
      PetscCall(AlignListAdd(&first, list->i[e]));
  for (PetscInt e = 0; e < first.n; e++) {
    s->work[first.i[e]] = MOVES;
    PetscCall(move_vertex(s, first.i[e], step * s->grid.size[first.i[e]]));
  }
  PetscCall(PetscFree(first.i));
  PetscCall(MeshSyncNodes(s->mesh, 3, s->d));
  PetscCall(MeshSyncNodes(s->mesh, 1, s->work));
  *left = PETSC_FALSE;
  for (PetscInt e = 0; e < list->n; e++) {
    const PetscInt i = list->i[e];

    if (s->work[i] == MOVES) {
      PetscCall(place_around(s, i));
      s->work[i] = IDLE;
    }
    *left = (PetscBool)(*left || s->work[i] == WAITS);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, left, 1, COMPAT_MPI_BOOL, MPI_LOR, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignMend(Align s)
{
  List      list = {0, 0, NULL};
  PetscBool any  = PETSC_TRUE, left;

  PetscFunctionBeginUser;
  for (PetscInt round = 0; round < NROUND && any; round++) {
    PetscCall(find_waiting(s, &list, &any));
    for (left = any; left;) PetscCall(move_first(s, &list, STEP[round % 3], &left));
  }
  PetscCall(PetscFree(list.i));
  PetscFunctionReturn(PETSC_SUCCESS);
}
