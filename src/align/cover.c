/* Align, cover: which cells belong to surfaces, and what their nodes are. */
#include "compat.h"
#include "impl.h"

#define TIE 1e-9 /* of a cell: centres on a surface are all outside, whatever round-off says */

/* Own cells with their centre in surface k drawn at X (this periodic image); where surfaces overlap, the deeper one
   wins */
static PetscErrorCode cover_image(Align s, PetscInt k, PetscInt image, const PetscReal X[3], PetscReal radius)
{
  const MeshLocal *l = s->loc;
  const PetscInt  *list;
  PetscInt         n, m = 0, node[CHUNK];
  PetscReal        x[3 * CHUNK], dist[CHUNK];

  PetscFunctionBeginUser;
  PetscCall(MeshNodesInBox(s->mesh, X, radius, &n, &list));
  for (PetscInt e = 0; e <= n; e++) {
    if (e < n && s->grid.kind[list[e]] == NODE_CENTRE && list[e] < l->nnode && !s->grid.held[list[e]]) {
      for (PetscInt a = 0; a < l->dim; a++) x[l->dim * m + a] = l->x_start[l->dim * list[e] + a];
      node[m++] = list[e];
    }
    if (m < CHUNK && e < n) continue;
    PetscCall(AlignDistance(s, k, X, m, x, dist));
    for (PetscInt i = 0; i < m; i++) {
      const PetscInt c = l->centre_cell[node[i]];

      if (AlignIsClosed(s, c)) continue;
      if (dist[i] >= -TIE * s->grid.size[node[i]] || (s->cover[c] && dist[i] >= s->depth[node[i]])) continue;
      if (!s->cover[c]) PetscCall(AlignListAdd(&s->covered, c));
      s->cover[c]       = k + 1;
      s->image[c]       = image;
      s->depth[node[i]] = dist[i];
    }
    m = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The code of the centre nodes carries the message: surface and image */
PetscErrorCode AlignShareCover(Align s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->covered.n; e++)
    s->code[AlignCentre(s, s->covered.i[e])] = 1 + 27 * (s->cover[s->covered.i[e]] - 1) + s->image[s->covered.i[e]];
  PetscCall(AlignSyncSurfaces(s, 27, s->code));
  PetscCall(MeshSyncNodes(s->mesh, 1, s->depth));
  for (PetscInt e = 0; e < s->covered.n; e++) s->code[AlignCentre(s, s->covered.i[e])] = 0;
  for (PetscInt i = l->nnode; i < l->nnode_all; i++) {
    if (s->code[i]) {
      if (!s->cover[l->centre_cell[i]]) PetscCall(AlignListAdd(&s->covered, l->centre_cell[i]));
      s->cover[l->centre_cell[i]] = (s->code[i] - 1) / 27 + 1;
      s->image[l->centre_cell[i]] = (s->code[i] - 1) % 27;
    }
    s->code[i] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignCoverCells(Align s, const PetscBool aligned[])
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal radius = s->surfaces->radius[k] * (1 + 1e-12);

    if (!aligned[k] || s->paths.is[k]) continue;
    for (DomainImages i = {0}; MeshNextImage(s->loc, AlignCentreOf(s, k), radius, &i);)
      PetscCall(cover_image(s, k, i.next - 1, i.at, radius));
  }
  PetscCall(AlignShareCover(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mark in work[] (at centre nodes) the cells that own vertex i must give back: those of surfaces that do not pass
   through the side it is on, the least covered one when two surfaces, or two images of one, meet there */
static void choose_open(Align s, PetscInt i)
{
  const MeshLocal *l     = s->loc;
  PetscInt         first = 0, last = -1;
  PetscBool        two = PETSC_FALSE;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
    const PetscInt c = l->node_cell[e], centre = AlignCentre(s, c);

    if (!s->cover[c]) continue;
    if (AlignIsBarred(s, i, s->cover[c] - 1)) s->work[centre] = 1;
    if (first && AlignCopyOf(s, i, c) != first) two = PETSC_TRUE;
    first = AlignCopyOf(s, i, c);
    if (last >= 0) {
      const PetscReal gain = s->depth[centre] - s->depth[AlignCentre(s, last)];

      if (gain < 0 || (gain == 0 && l->cell_global[c] < l->cell_global[last])) continue;
    }
    last = c;
  }
  if (two) s->work[AlignCentre(s, last)] = 1;
}

PetscErrorCode AlignOpenMarkedCells(Align s, PetscBool *any)
{
  PetscInt left = 0;

  PetscFunctionBeginUser;
  *any = PETSC_FALSE;
  PetscCall(MeshSumNodes(s->mesh, 1, s->work));
  PetscCall(MeshSyncNodes(s->mesh, 1, s->work));
  for (PetscInt e = 0; e < s->covered.n; e++) {
    const PetscInt c = s->covered.i[e], centre = AlignCentre(s, c);

    if (s->work[centre] > 0) {
      s->cover[c] = 0;
      *any        = PETSC_TRUE;
    } else s->covered.i[left++] = c;
    s->work[centre] = 0;
  }
  s->covered.n = left;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, any, 1, COMPAT_MPI_BOOL, MPI_LOR, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignOpenGaps(Align s)
{
  const MeshLocal *l = s->loc;
  PetscBool        any;

  PetscFunctionBeginUser;
  do {
    for (PetscInt e = 0; e < s->covered.n; e++)
      for (PetscInt v = 0; v < s->grid.cell.ncorner; v++) {
        const PetscInt i = AlignCellNodes(s, s->covered.i[e])[CORNER[v]];

        if (i < l->nnode) choose_open(s, i);
      }
    PetscCall(AlignOpenMarkedCells(s, &any));
  } while (any);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignClassifyNodes(Align s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->covered.n; e++) {
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt i    = AlignCellNodes(s, s->covered.i[e])[j];
      PetscBool      wall = PETSC_FALSE;

      if (i >= l->nnode || s->code[i]) continue;
      for (PetscInt n = l->node_cell_ptr[i]; n < l->node_cell_ptr[i + 1]; n++)
        wall = (PetscBool)(wall || !s->cover[l->node_cell[n]]);
      s->code[i] = 2 * s->cover[s->covered.i[e]] - (wall ? 1 : 0);
      PetscCall(AlignListAdd(&s->marked, i));
    }
  }
  PetscCall(AlignSyncSurfaces(s, 2, s->code));
  PetscCall(AlignShareCopies(s));
  for (PetscInt i = l->nnode; i < l->nnode_all; i++)
    if (s->code[i]) PetscCall(AlignListAdd(&s->marked, i));
  PetscFunctionReturn(PETSC_SUCCESS);
}
