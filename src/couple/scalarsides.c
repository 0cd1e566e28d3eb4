/* ScalarSides: see scalarsides.h. */
#include "compat.h"
#include "impl.h"
#include "scalarsides.h"
#include "fem/side.h"

/* The node in the middle of a side */
static PetscInt find_middle(const MeshLocal *l, PetscInt cell, PetscInt side)
{
  PetscInt slot[SIDE_MAX];

  SideList(l->dim, side, slot);
  return l->cell_node[cell * l->nb + slot[l->dim == 2 ? 1 : 4]];
}

/* Middles of sides belong to two cells: inside [nnode_all] <- 1 where one of them lies inside a body */
static PetscErrorCode mark_middles(Couple c, const PetscInt inactive[], PetscInt inside[])
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < l->ncell_all; e++) {
    if (inactive[e] < 0 || !CoupleIsInactiveInside(c, inactive[e])) continue;
    for (PetscInt side = 0; side < 2 * l->dim; side++) inside[find_middle(l, e, side)] = 1;
  }
  PetscCall(MeshSyncNodesInt(c->mesh, inside)); /* owners see both cells */
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarSidesFind(Couple c, PetscInt *n, ScalarSide *list[])
{
  const MeshLocal *l        = c->loc;
  const PetscInt  *inactive = MeshUpdateGetInactive(c->mesh_update), *of_node;
  PetscInt        *inside;

  PetscFunctionBeginUser;
  *n    = 0;
  *list = NULL;
  if (!inactive) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoupleGetNodeBody(c, &of_node));
  PetscCall(PetscCalloc1(l->nnode_all, &inside));
  PetscCall(mark_middles(c, inactive, inside));
  for (PetscInt pass = 0; pass < 2; pass++) {
    *n = 0;
    for (PetscInt e = 0; e < l->ncell_all; e++)
      for (PetscInt side = 0; side < 2 * l->dim && inactive[e] < 0; side++) {
        const PetscInt middle = find_middle(l, e, side);

        if (!inside[middle] || of_node[middle] < 0) continue;
        if (pass == 1) (*list)[*n] = (ScalarSide){.cell = e, .side = side, .body = of_node[middle]};
        ++*n;
      }
    if (pass == 0) PetscCall(PetscMalloc1(*n, list));
  }
  PetscCall(PetscFree(inside));
  PetscFunctionReturn(PETSC_SUCCESS);
}
