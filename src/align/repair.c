/* Align, repair: the covered cells of surfaces in space, made such that their staircase is a surface: it can then be
   laid onto the wall without folds. Around a ball that always holds (sums of squared distances over both diagonals of a
   square are equal); other surfaces need a cell now and then.

   Cells are added to a surface, never taken away, so that it ends: a live cell between two opposite faces of the
   surface, and where the covered or the live cells around an edge or a vertex do not hang together through faces, the
   one of the live cells that is least outside. Decisions are made by the owner of the cell, edge or vertex on what was
   there before the sweep, so that the result does not depend on the ranks. A cell whose filling would make the surface
   touch another one or a side that it does not pass through stays live; whether the mesh can do with that is for the
   check to say. */
#include "compat.h"
#include "impl.h"

#define AROUND 64 /* cells around a vertex, at most */

/* Solid, seen from cell c, of the covered cell on the other side of its face with middle node i; 0: none */
static PetscInt beyond_face(Align s, PetscInt c, PetscInt i)
{
  const MeshLocal *l = s->loc;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++)
    if (l->node_cell[e] != c) return AlignCopyOf(s, AlignCentre(s, c), l->node_cell[e]);
  return 0;
}

/* Has live cell c covered cells of the same surface, and image, beyond two opposite faces? */
static PetscBool is_between(Align s, PetscInt c)
{
  const PetscInt *node = AlignCellNodes(s, c), mid = s->grid.cell.centre;

  for (PetscInt step = 1; step <= 9; step *= 3) {
    const PetscInt k = beyond_face(s, c, node[mid - step]);

    if (k && k == beyond_face(s, c, node[mid + step])) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

static PetscBool share_face(Align s, PetscInt c, PetscInt e)
{
  const PetscInt *a = AlignCellNodes(s, c), *b = AlignCellNodes(s, e);

  for (PetscInt f = 0; f < 36; f++)
    if (a[s->grid.cell.face[f / 6][4]] == b[s->grid.cell.face[f % 6][4]]) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* Do the n cells hang together through faces? */
static PetscBool hang_together(Align s, PetscInt n, const PetscInt cell[])
{
  PetscInt queue[AROUND], reached = 1, seen[AROUND] = {1};

  queue[0] = 0;
  for (PetscInt at = 0; at < reached; at++)
    for (PetscInt e = 1; e < n; e++) {
      if (seen[e] || !share_face(s, cell[queue[at]], cell[e])) continue;
      seen[e]          = 1;
      queue[reached++] = e;
    }
  return (PetscBool)(n == 0 || reached == n);
}

/* Distance of the middle of cell c from a copy as seen from node i */
static PetscErrorCode cell_distance(Align s, PetscInt i, PetscInt copy, PetscInt c, PetscReal *d)
{
  const PetscInt k = AlignCopySurface(copy);
  PetscReal      x[3];

  PetscFunctionBeginUser;
  AlignPositionInCopy(s, i, copy, AlignCentre(s, c), AlignCentreOf(s, k), x);
  PetscCall(AlignDistance(s, k, AlignCentreOf(s, k), 1, x, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of live cells, the one least outside of a copy as seen from node at, ties by place */
static PetscErrorCode mark_min_outside(Align s, PetscInt at, PetscInt copy, PetscInt n, const PetscInt cell[])
{
  const PetscReal tie  = 1e-9;
  PetscReal       low  = PETSC_MAX_REAL;
  PetscInt        best = -1;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt   i = AlignCentre(s, cell[e]);
    const PetscReal *x = s->loc->x_start + 3 * i, margin = tie * s->grid.size[i];
    PetscReal        d;
    PetscBool        first = PETSC_TRUE;

    PetscCall(cell_distance(s, at, copy, cell[e], &d));
    if (best >= 0 && PetscAbsReal(d - low) <= margin) {
      const PetscReal *y = s->loc->x_start + 3 * best;

      first = (PetscBool)(x[2] != y[2] ? x[2] < y[2] : x[1] != y[1] ? x[1] < y[1] : x[0] < y[0]);
    } else if (best >= 0 && d > low) first = PETSC_FALSE;
    if (!first) continue;
    low  = d;
    best = i;
  }
  if (best >= 0) s->work[best] = 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells around own edge or vertex i */
static PetscErrorCode repair_around(Align s, PetscInt i)
{
  const MeshLocal *l = s->loc;
  PetscInt         covered[AROUND], live[AROUND], ncovered = 0, nlive = 0;

  PetscFunctionBeginUser;
  if (l->node_cell_ptr[i + 1] - l->node_cell_ptr[i] > AROUND) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
    if (s->cover[l->node_cell[e]]) covered[ncovered++] = l->node_cell[e];
    else live[nlive++] = l->node_cell[e];
  }
  if (!ncovered || !nlive || AlignIsBarred(s, i, s->cover[covered[0]] - 1) ||
      (hang_together(s, ncovered, covered) && hang_together(s, nlive, live)))
    PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(mark_min_outside(s, i, AlignCopyOf(s, i, covered[0]), nlive, live));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own cells, edges and vertices of the covered cells */
static PetscErrorCode find_defects(Align s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  s->now++;
  for (PetscInt e = 0; e < s->covered.n * l->nb; e++) {
    const PetscInt i = AlignCellNodes(s, s->covered.i[e / l->nb])[e % l->nb];

    if (s->stamp[0][i] == s->now) continue;
    s->stamp[0][i] = s->now;
    if (s->grid.kind[i] == NODE_FACE) {
      for (PetscInt m = l->node_cell_ptr[i]; m < l->node_cell_ptr[i + 1]; m++)
        if (l->node_cell[m] < l->ncell && !s->cover[l->node_cell[m]] && is_between(s, l->node_cell[m]))
          s->work[AlignCentre(s, l->node_cell[m])] = 1;
    } else if (s->grid.kind[i] != NODE_CENTRE && i < l->nnode) PetscCall(repair_around(s, i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The one copy, seen from there, whose covered cells own live cell c touches; 0: none, several, or also a side that its
   surface does not pass through */
static PetscInt only_solid(Align s, PetscInt c)
{
  const MeshLocal *l = s->loc;
  PetscInt         k = 0, side = 0;

  for (PetscInt v = 0; v < s->grid.cell.ncorner; v++) {
    const PetscInt i = AlignCellNodes(s, c)[CORNER[v]];

    side |= s->grid.side[i];
    for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
      const PetscInt j = AlignCopyOf(s, AlignCentre(s, c), l->node_cell[e]);

      if (j && k && j != k) return 0;
      if (j) k = j;
    }
  }
  return k && (side & ~s->tally.passes[AlignCopySurface(k)]) ? 0 : k;
}

/* Own live cells that were marked on some rank become covered, all at once; *any: was there one? */
static PetscErrorCode fill_marked(Align s, PetscBool *any)
{
  const MeshLocal *l    = s->loc;
  List             fill = {0, 0, NULL}, copy = {0, 0, NULL};

  PetscFunctionBeginUser;
  PetscCall(MeshSumNodes(s->mesh, 1, s->work));
  for (PetscInt e = 0; e < s->covered.n; e++) /* marked cells touch covered ones */
    for (PetscInt v = 0; v < s->grid.cell.ncorner; v++) {
      const PetscInt i = AlignCellNodes(s, s->covered.i[e])[CORNER[v]];

      for (PetscInt m = l->node_cell_ptr[i]; m < l->node_cell_ptr[i + 1]; m++) {
        const PetscInt c = l->node_cell[m], centre = AlignCentre(s, c);

        if (c < l->ncell && s->work[centre] > 0 && !s->cover[c] && !AlignIsClosed(s, c) && only_solid(s, c)) {
          PetscCall(AlignListAdd(&fill, c));
          PetscCall(AlignListAdd(&copy, only_solid(s, c)));
        }
        s->work[centre] = 0;
      }
    }
  for (PetscInt e = 0; e < fill.n; e++) {
    const PetscInt c = fill.i[e], k = AlignCopySurface(copy.i[e]);

    s->cover[c] = k + 1;
    s->image[c] = 0;
    for (PetscInt a = 2; a >= 0; a--)
      s->image[c] = 3 * s->image[c] + PetscMax(-1, PetscMin(1, AlignCopyStep(copy.i[e], a))) + 1;
    PetscCall(cell_distance(s, AlignCentre(s, c), copy.i[e], c, &s->depth[AlignCentre(s, c)]));
    PetscCall(AlignListAdd(&s->covered, c));
  }
  *any = (PetscBool)(fill.n > 0);
  PetscCall(PetscFree(fill.i));
  PetscCall(PetscFree(copy.i));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, any, 1, COMPAT_MPI_BOOL, MPI_LOR, s->comm));
  if (*any) PetscCall(AlignShareCover(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignRepair(Align s)
{
  PetscBool any;

  PetscFunctionBeginUser;
  do {
    PetscCall(find_defects(s));
    PetscCall(fill_marked(s, &any));
  } while (any);
  PetscCall(AlignOpenGaps(s)); /* two surfaces that were filled towards each other at once */
  PetscFunctionReturn(PETSC_SUCCESS);
}
