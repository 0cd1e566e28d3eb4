/* Nodes of a mesh: numbers, and exchange of values between ranks (see impl.h, mesh.h). */
#include "compat.h"
#include "impl.h"
#include "numbers.h"
#include "base/rowtype.h"

PetscErrorCode MeshNumberNodes(Mesh m, const PetscBool ghost[], PetscInt pEnd, PetscInt number[])
{
  MeshLocal *l = &m->loc;

  PetscFunctionBeginUser;
  for (PetscInt p = 0; p < pEnd; p++) number[p] = -1;
  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt i = 0; i < l->ncell_all * l->nb; i++) {
      const PetscInt p = m->cell_node[i];

      if (number[p] < 0 && (PetscInt)ghost[p] == pass) number[p] = l->nnode_all++;
    }
    if (pass == 0) l->nnode = l->nnode_all;
  }
  for (PetscInt i = 0; i < l->ncell_all * l->nb; i++) m->cell_node[i] = number[m->cell_node[i]];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Global numbers of cells and nodes: own ones count up from the rank's start, ghosts learn theirs from the owner. */
static PetscErrorCode number_globally(Mesh m, PetscInt pEnd, const PetscInt order[], const PetscInt number[])
{
  MeshLocal *l = &m->loc;
  PetscInt  *root, *leaf, nroot;
  PetscSF    sf;

  PetscFunctionBeginUser;
  PetscCall(NumbersSpread(m->comm, "cells", l->ncell, l->dim + 1, &l->cell_start, &l->ncell_global));
  PetscCall(NumbersSpread(m->comm, "nodes", l->nnode, l->dim, &l->node_start, &l->nnode_global));
  PetscCall(NumbersCheck(m->comm, l->dim, (PetscReal)l->ncell_global));
  PetscCall(PetscMalloc2(pEnd, &root, pEnd, &leaf));
  PetscCall(DMGetPointSF(m->dm, &sf));
  PetscCall(PetscSFGetGraph(sf, &nroot, NULL, NULL, NULL));
  for (PetscInt kind = 0; kind < 2; kind++) { /* a cell point is both a cell and a node: two broadcasts */
    for (PetscInt p = 0; p < pEnd; p++) root[p] = -1;
    if (kind == 0) {
      for (PetscInt c = 0; c < l->ncell; c++) root[order[c]] = l->cell_start + c;
    } else {
      for (PetscInt p = 0; p < pEnd; p++)
        if (number[p] >= 0 && number[p] < l->nnode) root[p] = l->node_start + number[p];
    }
    PetscCall(PetscArraycpy(leaf, root, pEnd));
    if (nroot >= 0) { /* the mesh is distributed */
      PetscCall(PetscSFBcastBegin(sf, MPIU_INT, root, leaf, MPI_REPLACE));
      PetscCall(PetscSFBcastEnd(sf, MPIU_INT, root, leaf, MPI_REPLACE));
    }
    if (kind == 0) {
      for (PetscInt c = 0; c < l->ncell_all; c++) m->cell_global[c] = leaf[order[c]];
    } else {
      for (PetscInt p = 0; p < pEnd; p++)
        if (number[p] >= 0) m->node_global[number[p]] = leaf[p];
    }
  }
  PetscCall(PetscFree2(root, leaf));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_node_sf(Mesh m)
{
  const MeshLocal *l      = &m->loc;
  const PetscInt   nghost = l->nnode_all - l->nnode;
  PetscLayout      layout;
  PetscInt        *ilocal;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(nghost, &ilocal));
  for (PetscInt i = 0; i < nghost; i++) ilocal[i] = l->nnode + i;
  PetscCall(PetscLayoutCreateFromSizes(m->comm, l->nnode, PETSC_DETERMINE, 1, &layout));
  PetscCall(PetscSFCreate(m->comm, &m->node_sf));
  PetscCall(PetscSFSetGraphLayout(m->node_sf, layout, nghost, ilocal, PETSC_OWN_POINTER, m->node_global + l->nnode));
  PetscCall(PetscSFSetUp(m->node_sf));
  PetscCall(PetscLayoutDestroy(&layout));
  for (int bs = 0; bs < MESH_MAX_BLOCK; bs++) PetscCall(RowTypeCreate(bs + 1, &m->block[bs]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode connect_nodes_to_cells(Mesh m)
{
  MeshLocal *l = &m->loc;
  PetscInt  *fill;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(l->nnode_all + 1, &m->node_cell_ptr));
  PetscCall(PetscMalloc1(l->ncell_all * l->nb, &m->node_cell));
  for (PetscInt i = 0; i < l->ncell_all * l->nb; i++) m->node_cell_ptr[m->cell_node[i] + 1]++;
  for (PetscInt i = 0; i < l->nnode_all; i++) m->node_cell_ptr[i + 1] += m->node_cell_ptr[i];
  PetscCall(PetscMalloc1(l->nnode_all, &fill));
  PetscCall(PetscArraycpy(fill, m->node_cell_ptr, l->nnode_all));
  for (PetscInt i = 0; i < l->ncell_all * l->nb; i++) m->node_cell[fill[m->cell_node[i]]++] = i / l->nb;
  PetscCall(PetscFree(fill));
  PetscCall(PetscMalloc1(l->nnode_all, &m->centre_cell));
  for (PetscInt i = 0; i < l->nnode_all; i++) m->centre_cell[i] = -1;
  for (PetscInt c = 0; c < l->ncell_all; c++) m->centre_cell[m->cell_node[c * l->nb + l->nb / 2]] = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshConnectNodes(Mesh m)
{
  PetscFunctionBeginUser;
  PetscCall(create_node_sf(m));
  PetscCall(connect_nodes_to_cells(m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshNumberGlobally(Mesh m, PetscInt pEnd, const PetscInt order[], const PetscInt number[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(m->loc.nnode_all, &m->node_global));
  PetscCall(number_globally(m, pEnd, order, number));
  PetscCall(MeshConnectNodes(m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshFetchNodes(Mesh m, PetscInt bs, const PetscReal own[], PetscReal ghost[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscSFBcastBegin(m->node_sf, m->block[bs - 1], own, ghost, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(m->node_sf, m->block[bs - 1], own, ghost, MPI_REPLACE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshSyncNodes(Mesh m, PetscInt bs, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(MeshFetchNodes(m, bs, v, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshSumNodes(Mesh m, PetscInt bs, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscSFReduceBegin(m->node_sf, m->block[bs - 1], v, v, MPIU_SUM));
  PetscCall(PetscSFReduceEnd(m->node_sf, m->block[bs - 1], v, v, MPIU_SUM));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshSyncNodesInt(Mesh m, PetscInt v[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscSFBcastBegin(m->node_sf, MPIU_INT, v, v, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(m->node_sf, MPIU_INT, v, v, MPI_REPLACE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshNumberVertices(Mesh m, PetscInt vertex[], PetscInt *nown)
{
  const MeshLocal *l = &m->loc;
  PetscInt         start;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode_all; i++) vertex[i] = -1;
  for (PetscInt i = 0; i < l->ncell_all * l->nb; i++) {
    const PetscInt j = i % l->nb;

    if (j % 3 != 1 && (j / 3) % 3 != 1 && (l->dim == 2 || j / 9 != 1)) vertex[l->cell_node[i]] = 0;
  }
  *nown = 0;
  for (PetscInt i = 0; i < l->nnode; i++)
    if (vertex[i] == 0) vertex[i] = (*nown)++;
  PetscCall(NumbersSpread(m->comm, "vertices", *nown, 1, &start, NULL));
  for (PetscInt i = 0; i < l->nnode; i++)
    if (vertex[i] >= 0) vertex[i] += start;
  PetscCall(MeshSyncNodesInt(m, vertex));
  PetscFunctionReturn(PETSC_SUCCESS);
}
