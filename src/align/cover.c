/* Snap, cover: which cells belong to bodies, and what their nodes are. */
#include "compat.h"
#include "impl.h"

#define TIE 1e-9 /* of a cell: centres on the surface of a body are all outside, whatever round-off says */

/* Own cells with their centre in body k drawn at X (this periodic image); where bodies overlap, the deeper one wins */
static PetscErrorCode cover_image(Snap s, PetscInt k, PetscInt image, const PetscReal X[3], PetscReal radius)
{
  const MeshLocal *l = s->loc;
  const PetscInt  *list;
  PetscInt         n, m = 0, node[CHUNK];
  PetscReal        x[3 * CHUNK], dist[CHUNK];

  PetscFunctionBeginUser;
  PetscCall(MeshNodesInBox(s->mesh, X, radius, &n, &list));
  for (PetscInt e = 0; e <= n; e++) {
    if (e < n && s->kind[list[e]] == NODE_CENTRE && list[e] < l->nnode) {
      for (PetscInt a = 0; a < l->dim; a++) x[l->dim * m + a] = l->x_start[l->dim * list[e] + a];
      node[m++] = list[e];
    }
    if (m < CHUNK && e < n) continue;
    PetscCall(SnapDistance(s, k, X, m, x, dist));
    for (PetscInt i = 0; i < m; i++) {
      const PetscInt c = l->centre_cell[node[i]];

      if (dist[i] >= -TIE * s->size[node[i]] || (s->cover[c] && dist[i] >= s->depth[node[i]])) continue;
      if (!s->cover[c]) PetscCall(SnapListAdd(&s->dead, c));
      s->cover[c]       = k + 1;
      s->image[c]       = image;
      s->depth[node[i]] = dist[i];
    }
    m = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The code of the centre nodes carries the message: body and image */
PetscErrorCode SnapShareCover(Snap s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->dead.n; e++) s->code[SnapCentre(s, s->dead.i[e])] = 1 + 27 * (s->cover[s->dead.i[e]] - 1) + s->image[s->dead.i[e]];
  PetscCall(SnapSyncBodies(s, 27, s->code));
  PetscCall(MeshSyncNodes(s->mesh, 1, s->depth));
  for (PetscInt e = 0; e < s->dead.n; e++) s->code[SnapCentre(s, s->dead.i[e])] = 0;
  for (PetscInt i = l->nnode; i < l->nnode_all; i++) {
    if (s->code[i]) {
      if (!s->cover[l->centre_cell[i]]) PetscCall(SnapListAdd(&s->dead, l->centre_cell[i]));
      s->cover[l->centre_cell[i]] = (s->code[i] - 1) / 27 + 1;
      s->image[l->centre_cell[i]] = (s->code[i] - 1) % 27;
    }
    s->code[i] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapCoverCells(Snap s, const PetscBool fitted[])
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->nbodies; k++) {
    const PetscReal radius = s->surfaces->radius[k] * (1 + 1e-12);

    if (!fitted[k] || s->is_path[k]) continue;
    for (DomainImages i = {0}; MeshNextImage(s->loc, SnapCentreOf(s, k), radius, &i);) PetscCall(cover_image(s, k, i.next - 1, i.at, radius));
  }
  PetscCall(SnapShareCover(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mark in work[] (at centre nodes) the cells that own vertex i must give back: those of bodies that do not pass
   through the side it is on, the least covered one when two bodies, or two images of one, meet there */
static void choose_open(Snap s, PetscInt i)
{
  const MeshLocal *l     = s->loc;
  PetscInt         first = 0, last = -1;
  PetscBool        two = PETSC_FALSE;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
    const PetscInt c = l->node_cell[e], centre = SnapCentre(s, c);

    if (!s->cover[c]) continue;
    if (SnapIsBarred(s, i, s->cover[c] - 1)) s->work[centre] = 1;
    if (first && SnapSolid(s, i, c) != first) two = PETSC_TRUE;
    first = SnapSolid(s, i, c);
    if (last >= 0) {
      const PetscReal gain = s->depth[centre] - s->depth[SnapCentre(s, last)];

      if (gain < 0 || (gain == 0 && l->cell_global[c] < l->cell_global[last])) continue;
    }
    last = c;
  }
  if (two) s->work[SnapCentre(s, last)] = 1;
}

PetscErrorCode SnapOpenMarkedCells(Snap s, PetscBool *any)
{
  PetscInt left = 0;

  PetscFunctionBeginUser;
  *any = PETSC_FALSE;
  PetscCall(MeshSumNodes(s->mesh, 1, s->work));
  PetscCall(MeshSyncNodes(s->mesh, 1, s->work));
  for (PetscInt e = 0; e < s->dead.n; e++) {
    const PetscInt c = s->dead.i[e], centre = SnapCentre(s, c);

    if (s->work[centre] > 0) {
      s->cover[c] = 0;
      *any        = PETSC_TRUE;
    } else s->dead.i[left++] = c;
    s->work[centre] = 0;
  }
  s->dead.n = left;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, any, 1, COMPAT_MPI_BOOL, MPI_LOR, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapOpenGaps(Snap s)
{
  const MeshLocal *l = s->loc;
  PetscBool        any;

  PetscFunctionBeginUser;
  do {
    for (PetscInt e = 0; e < s->dead.n; e++)
      for (PetscInt v = 0; v < s->cell_kind.ncorner; v++) {
        const PetscInt i = SnapCellNodes(s, s->dead.i[e])[CORNER[v]];

        if (i < l->nnode) choose_open(s, i);
      }
    PetscCall(SnapOpenMarkedCells(s, &any));
  } while (any);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapClassifyNodes(Snap s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->dead.n; e++) {
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt i    = SnapCellNodes(s, s->dead.i[e])[j];
      PetscBool      wall = PETSC_FALSE;

      if (i >= l->nnode || s->code[i]) continue;
      for (PetscInt n = l->node_cell_ptr[i]; n < l->node_cell_ptr[i + 1]; n++) wall = (PetscBool)(wall || !s->cover[l->node_cell[n]]);
      s->code[i] = 2 * s->cover[s->dead.i[e]] - (wall ? 1 : 0);
      PetscCall(SnapListAdd(&s->marked, i));
    }
  }
  PetscCall(SnapSyncBodies(s, 2, s->code));
  PetscCall(SnapShareSolids(s));
  for (PetscInt i = l->nnode; i < l->nnode_all; i++)
    if (s->code[i]) PetscCall(SnapListAdd(&s->marked, i));
  PetscFunctionReturn(PETSC_SUCCESS);
}
