/* Inside of Mesh, for the files of this room: README.md says which does what. */
#pragma once
#include "mesh/mesh.h"
#include "kinds/kind.h"

#define MESH_MAX_BLOCK 16

struct _p_Mesh {
  MPI_Comm     comm;
  DM           dm; /* while the mesh is built of one, else NULL */
  MeshKind     kind;
  MeshLocal    loc;
  PetscInt    *cell_node, *cell_global, *node_global, *node_cell_ptr, *node_cell, *centre_cell;
  PetscReal   *x, *x_start; /* x_start is an array of its own once nodes have moved */
  PetscSF      node_sf;     /* ghost nodes -> owners, in local node numbers */
  MPI_Datatype block[MESH_MAX_BLOCK];
  PetscInt     nboundary, **boundary_node, *boundary_count; /* [nboundary], names belong to kind */
  const char (*boundary_name)[64];
  /* background grid for MeshNodesInBox: nodes of bin b are bin_node[bin_ptr[b] .. bin_ptr[b + 1]) */
  PetscInt  nbin[3], *bin_ptr, *bin_node, *found;
  PetscReal bin_lower[3], bin_size[3];
  /* of a refined mesh; NULL, 0 otherwise. hang_table by HANG_CODE of hangimpl.h */
  struct _n_Leaves *leaves; /* own ones, in the order of the own cells */
  PetscInt         *half;   /* [nnode_all][3] places of the nodes in halves of finest cells */
  MeshHang        **hang, **hang_table;
  PetscInt          levels, *level_count, hanging; /* [levels + 1] cells of all ranks; hanging places */
};

/* Lattice corner (0 or 2 along each axis) of vertex v in the closure of a PETSc quadrilateral or hexahedron */
static inline void MeshCornerPosition(PetscInt dim, PetscInt v, PetscInt pos[3])
{
  static const PetscInt quad[4][3] = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
  static const PetscInt hex[8][3]  = {{0, 0, 0}, {0, 2, 0}, {2, 2, 0}, {2, 0, 0},
                                      {0, 0, 2}, {2, 0, 2}, {2, 2, 2}, {0, 2, 2}};

  for (PetscInt d = 0; d < 3; d++) pos[d] = dim == 2 ? quad[v][d] : hex[v][d];
}

/* Points of the closure of cell c of dm by lattice position, the mean of that of their vertices: point [nb]; vertex
   [2^dim] in the order of the closure. Error: no quadrilateral or hexahedron. (lattice.c) */
PetscErrorCode MeshCellLattice(DM dm, PetscInt dim, PetscInt c, PetscInt point[], PetscInt vertex[]);
/* Smallest Jacobian over the corners of a cell with nodes xc [nb][dim], and a size: their mean (the volume where the
   edges are straight in 2D or the cell a parallelepiped). Local. */
void MeshMeasureCell(PetscInt dim, const PetscReal xc[], PetscReal *smallest, PetscReal *volume);
/* Coordinates of the nodes, box and cell size; order [ncell_all] cells of the DM, vertex [ncell_all][2^dim] as above.
   Collective. Errors: an inverted cell, curved cells. */
PetscErrorCode MeshSetCoordinates(Mesh, const PetscInt order[], const PetscInt vertex[]);
/* Number the nodes in the order in which the cells touch them, own ones first; cell_node holds mesh points on entry,
   nodes on exit. ghost [pEnd]: whether another rank owns a point; number [pEnd] returns the node of a point, or -1. Not
   collective. */
PetscErrorCode MeshNumberNodes(Mesh, const PetscBool ghost[], PetscInt pEnd, PetscInt number[]);
/* Global numbers, way from ghosts to owners, cells of nodes. order [ncell_all]: mesh points of cells. Collective. */
PetscErrorCode MeshNumberGlobally(Mesh, PetscInt pEnd, const PetscInt order[], const PetscInt number[]);
/* The parts of that which need cell_node and node_global alone. Collective. */
PetscErrorCode MeshConnectNodes(Mesh);
/* The background grid of MeshNodesInBox, of the nodes where they are. Not collective. */
PetscErrorCode MeshCreateBins(Mesh);
PetscErrorCode MeshDestroyBins(Mesh);
