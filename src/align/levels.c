/* Align, levels: on a mesh with cells of several sizes, is there room to line it up? As the fit would go: cells with
   their centre in a surface, the vertices around them and the rings that follow, but for repairs. */
#include "compat.h"
#include "impl.h"

static const PetscInt MOVED_RINGS = ALIGN_RINGS - 1; /* the outermost ring stays where cells of another size are */

/* Centre nodes of own cells with their centre in surface k get 1 */
static PetscErrorCode mark_inside(Mesh mesh, const AlignSurfaces *f, PetscInt k, PetscReal mark[])
{
  const MeshLocal *l;
  PetscReal        radius;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  radius = f->radius[k];
  for (DomainImages image = {0}; MeshNextImage(l, f->centre[k], radius, &image);) {
    const PetscInt *list;
    PetscInt        n;

    PetscCall(MeshNodesInBox(mesh, image.at, radius, &n, &list));
    for (PetscInt e = 0; e < n; e++) {
      PetscReal d;

      if (l->centre_cell[list[e]] < 0 || list[e] >= l->nnode) continue;
      PetscCall(f->distance(f->ctx, k, image.at, 1, l->x + l->dim * list[e], &d));
      if (d < 0) mark[list[e]] = 1;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Vertices of covered cells, next to live ones, get 1, those of cells around them 2 and so on */
static PetscErrorCode mark_rings(Mesh mesh, PetscReal mark[])
{
  const MeshLocal *l;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  for (PetscInt ring = 0; ring <= MOVED_RINGS; ring++) {
    for (PetscInt c = 0; c < l->ncell_all; c++) {
      const PetscInt *node = l->cell_node + c * l->nb;
      PetscBool       next = (PetscBool)(ring == 0 && mark[node[l->nb / 2]] > 0);

      for (PetscInt v = 0; v < 1 << l->dim; v++)
        next = (PetscBool)(next || (ring > 0 && mark[node[CORNER[v]]] == ring));
      for (PetscInt v = 0; v < 1 << l->dim && next; v++)
        if (mark[node[CORNER[v]]] == 0) mark[node[CORNER[v]]] = ring + 1;
    }
    PetscCall(MeshSyncNodes(mesh, 1, mark));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignHasEvenCells(Mesh mesh, const AlignSurfaces *f, PetscBool *even)
{
  const MeshLocal *l;
  PetscReal       *mark;
  MPI_Comm         comm;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshGetComm(mesh, &comm));
  *even = PETSC_TRUE;
  if (!l->hang) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(l->nnode_all, &mark));
  for (PetscInt k = 0; k < f->n; k++) PetscCall(mark_inside(mesh, f, k, mark));
  PetscCall(MeshSyncNodes(mesh, 1, mark));
  PetscCall(mark_rings(mesh, mark));
  for (PetscInt c = 0; c < l->ncell; c++)
    for (PetscInt v = 0; v < 1 << l->dim && MeshCellHang(l, c); v++)
      if (mark[l->cell_node[c * l->nb + CORNER[v]]] > 0) *even = PETSC_FALSE;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, even, 1, COMPAT_MPI_BOOL, MPI_LAND, comm));
  PetscCall(PetscFree(mark));
  PetscFunctionReturn(PETSC_SUCCESS);
}
