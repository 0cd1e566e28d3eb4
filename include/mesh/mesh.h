/* Mesh: a fixed, distributed DMPlex mesh of quadrilaterals or hexahedra with its Q2 nodes.

   The mesh knows nothing of bodies or equations. Every vertex, edge, face and cell of the DMPlex carries exactly one Q2
   node, so a cell has nb = 3^dim nodes; node j of a cell sits at lattice position (j % 3, (j/3) % 3, j/9) of the
   reference cell [-1,1]^dim. Each rank holds its own cells first, then one layer of ghost cells (all cells that share a
   node with an own cell); own nodes first, then ghost nodes. Local indices everywhere; global = node_start + local for
   own nodes.

   PETSc's -dm_refine and -petscpartitioner_type act on it; without them boxes of 200,000 cells or more are made
   distributed on many ranks, without a DMPlex. With -mesh_levels cells are refined where it is wanted: a
   cell beside a larger one then has nodes of the larger one in its slots, and values at its lattice positions come from
   them by an interpolation of the element (mesh/hang.h). */
#pragma once
#include "base/border.h"
#include "base/curve.h"
#include "base/domain.h"
#include "base/rankboxes.h"
#include "mesh/hang.h"
#include <petscdmplex.h>
#include <petscsf.h>

#define MESH_MAX_NB 27 /* ELEMENT_MAX_NB of fem */

/* Read-only view of the local mesh. */
typedef struct {
  PetscInt               dim, nb;                /* nb = 3^dim nodes a cell */
  PetscInt               ncell, ncell_all;       /* own cells; with ghosts */
  PetscInt               nnode, nnode_all;       /* own Q2 nodes; with ghosts */
  PetscInt               cell_start, node_start; /* global index of the first own cell, node */
  PetscInt               ncell_global, nnode_global;
  const PetscInt        *cell_node;     /* [ncell_all][nb] local node */
  const PetscInt        *cell_global;   /* [ncell_all] global cell index */
  const PetscInt        *node_global;   /* [nnode_all] global node index */
  const PetscInt        *node_cell_ptr; /* [nnode_all + 1] into node_cell: the cells around a node */
  const PetscInt        *node_cell;
  const MeshHang *const *hang;        /* [ncell_all] where slots of a cell hang, NULL entry: none; NULL: nowhere */
  const PetscInt        *centre_cell; /* [nnode_all] cell whose centre node it is, or -1 */
  const PetscReal       *x;           /* [nnode_all][dim] node coordinates, second-order geometry */
  const PetscReal       *x_start;     /* [nnode_all][dim] the same before any MeshMoveNodes */
  PetscInt               moves;       /* calls of MeshMoveNodes so far */
  PetscInt               meshes;      /* how often its cells have been rebuilt (mesh/carry.h) */
  PetscReal              period[3];   /* length of the period along an axis, 0 = not periodic */
  PetscReal              lower[3], upper[3]; /* bounding box of the whole mesh */
  PetscReal              h;                  /* smallest cell size of the whole mesh (volume^(1/dim)) */
} MeshLocal;

typedef struct _p_Mesh *Mesh;

/* ---- before a mesh is made: run ---- */

/* Its levels of refinement (0: none), around bodies and in boxes that go with them or elsewhere alone. Collective. */
PetscErrorCode MeshReadLevels(PetscInt *levels, PetscBool *around);
/* What -mesh_resolution is by default on a mesh of that kind (-mesh_kind). Not collective. */
PetscInt MeshDefaultResolution(const char kind[]);
/* Longest side of the smallest cells that -mesh_levels can make. Collective. */
PetscErrorCode MeshReadFinest(MPI_Comm, PetscReal *h);
/* The box of a mesh of kind box or channel, and its periods. Collective. */
PetscErrorCode MeshReadBox(MPI_Comm, PetscInt *dim, PetscReal lower[3], PetscReal upper[3], PetscReal period[3]);

/* ---- made, looked at: run ---- */

/* Build from options, distribute, number. Collective. Errors: unreadable file, cells that are not
   quadrilaterals/hexahedra, inverted cells (named by their centre), fewer than 3 cells along a periodic axis. */
PetscErrorCode MeshCreate(MPI_Comm, Mesh *);

/* Bodies that boxes of -mesh_refine go with: position, velocity (0: at rest), has it left? is it this rank's? [n] each,
   borrowed */
typedef struct {
  PetscInt n;
  const PetscReal (*x)[3], (*u)[3];
  const PetscBool *removed, *own;
} MeshCarriers;

/* What -mesh_levels refines around: d [1] the distance of x to it (0 where all is to be fine), which changes by at
   most the way; beyond `reach` any larger number does. The same on every rank that is asked; not collective. With marks
   (mesh/mark.h) cells are also refined one by one, and the surface may be left out (NULL). */
typedef struct {
  PetscErrorCode (*distance)(void *context, const PetscReal x[3], PetscReal reach, PetscReal *d);
  void *context;
  /* Bodies of a group, for boxes against their motion or along the axes, n < 0: there is no such group. The function
     NULL: there are none at all. */
  PetscErrorCode (*carriers)(void *context, const char group[], PetscBool motion, MeshCarriers *);
  /* From now on a rank asks about nothing that is farther than reach from its regions. Collective. NULL: it may ask
     about everything. */
  PetscErrorCode (*look)(void *context, RankBoxes, PetscReal reach);
  PetscInt             coarser; /* so many levels less than -mesh_levels around it */
  struct _p_MeshMarks *marks;   /* borrowed during construction; NULL: none */
} MeshSurface;

/* MeshCreate with -mesh_levels around `surface` (NULL: there is none). Collective. More errors: what -mesh_levels does
   not work with. */
PetscErrorCode MeshCreateAround(MPI_Comm, const MeshSurface *, Mesh *);
/* A box of equal cells, cells, lower, upper [dim], whatever the options say: for small meshes of somebody's own, such
   as on PETSC_COMM_SELF. Collective. */
PetscErrorCode MeshCreateBox(MPI_Comm, PetscInt dim, const PetscInt cells[], const PetscReal lower[],
                             const PetscReal upper[], Mesh *);
PetscErrorCode MeshDestroy(Mesh *);
PetscErrorCode MeshView(Mesh, PetscViewer);
PetscErrorCode MeshGetLocal(Mesh, const MeshLocal **);
PetscErrorCode MeshGetComm(Mesh, MPI_Comm *);

/* ---- boundaries: flow (conditions), run (walls) ---- */

/* Names such as left right bottom top back front (box) or the physical names of a Gmsh file. */
PetscErrorCode MeshGetBoundaryCount(Mesh, PetscInt *n);
PetscErrorCode MeshGetBoundaryName(Mesh, PetscInt b, const char **name);
/* That of a name, -1: none */
PetscErrorCode MeshFindBoundary(Mesh, const char name[], PetscInt *b);
/* Local nodes (own and ghost) on boundary b. */
PetscErrorCode MeshGetBoundaryNodes(Mesh, PetscInt b, PetscInt *n, const PetscInt *nodes[]);
/* Plane sides of the mesh's box that all nodes of boundary b lay on before nodes moved: bits 2 axis + (upper one), 0:
   none. Collective. */
PetscErrorCode MeshGetBoundarySides(Mesh, PetscInt b, PetscInt *sides);
/* Boundary b of a round kind (disc, annulus, tube, ball, shell, the cylinder of fitted): circle, cylinder or sphere,
   *round: is it one? Not collective. */
PetscErrorCode MeshGetBoundaryRound(Mesh, PetscInt b, PetscBool *round, BorderRound *);
/* Are boundaries called left, right, ... the whole sides of the mesh's box? Not so in a file. Not collective. */
PetscErrorCode MeshHasSides(Mesh, PetscBool *);
/* Faces of own cells on boundaries, face [*n] (base/border.h), the caller's to free. Not collective. */
PetscErrorCode MeshGetBoundaryFaces(Mesh, PetscInt *n, BorderFace *face[]);
/* Where boundary b lies, in words: "y = 0", "circle of radius 1 about 0,0", or its box. Collective. */
PetscErrorCode MeshDescribeBoundary(Mesh, PetscInt b, char text[], size_t size);

/* ---- cells and points: flow, solve, align, couple ---- */

/* A difference of coordinates along axis a, to the nearest image where that axis is periodic */
static inline PetscReal MeshNearest(const MeshLocal *l, PetscInt a, PetscReal r)
{
  return DomainNearest(l->period[a], r, 0);
}

/* Periodic images of x from which something of this half-width reaches the domain: DomainNextImage */
static inline PetscBool MeshNextImage(const MeshLocal *l, const PetscReal x[3], PetscReal half, DomainImages *i)
{
  return DomainNextImage(l->period, l->lower, l->upper, x, half, i);
}

/* Coordinates of the lattice positions of local cell c, xc [nb][dim], unwrapped across periodic boundaries; those of
   the nodes in its slots, which differ where something hangs. Not collective. */
PetscErrorCode MeshCellCoordinates(Mesh, PetscInt c, PetscReal xc[]);
PetscErrorCode MeshSlotCoordinates(Mesh, PetscInt c, PetscReal xs[]);

/* Element interpolation of local cell c, NULL where nothing hangs; values v [nb][bs] in slots to positions, r [nb][bs]
   from positions to slots, matrices K [nb * bs][stride] of the same unknowns (mesh/hang.h) */
static inline const MeshHang *MeshCellHang(const MeshLocal *l, PetscInt c)
{
  return l->hang ? l->hang[c] : NULL;
}
static inline void MeshCellGather(const MeshLocal *l, PetscInt c, PetscInt bs, PetscReal v[])
{
  if (l->hang && l->hang[c]) MeshHangGather(l->hang[c], bs, v);
}
/* Values v [nb][bs] of a nodal array [nnode_all][bs] at the positions of cell c */
static inline void MeshCellValues(const MeshLocal *l, PetscInt c, PetscInt bs, const PetscReal nodal[], PetscReal v[])
{
  const PetscInt *node = l->cell_node + c * l->nb;

  for (PetscInt j = 0; j < l->nb; j++)
    for (PetscInt a = 0; a < bs; a++) v[j * bs + a] = nodal[node[j] * bs + a];
  MeshCellGather(l, c, bs, v);
}
static inline void MeshCellScatter(const MeshLocal *l, PetscInt c, PetscInt bs, PetscReal r[])
{
  if (l->hang && l->hang[c]) MeshHangScatter(l->hang[c], bs, r);
}
static inline void MeshCellMatrix(const MeshLocal *l, PetscInt c, PetscInt bs, PetscInt stride, PetscReal K[])
{
  if (l->hang && l->hang[c]) MeshHangMatrix(l->hang[c], bs, stride, K);
}

/* Is a cell with nodes xc [nb][dim], 9 or 27, a box along the axes with its other nodes in the middle, each to
   `round_off` of its edges [dim], which are given back? */
static inline PetscBool MeshIsBox(PetscInt dim, PetscInt nb, const PetscReal xc[], PetscReal round_off,
                                  PetscReal edge[])
{
  for (PetscInt d = 0; d < dim; d++) edge[d] = xc[(nb - 1) * dim + d] - xc[d];
  for (PetscInt j = 0; j < nb; j++) {
    const PetscInt at[3] = {j % 3, j / 3 % 3, j / 9};

    for (PetscInt d = 0; d < dim; d++)
      if (!(PetscAbsReal(xc[d] + 0.5 * at[d] * edge[d] - xc[j * dim + d]) <= round_off * edge[d])) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

/* Nodes (own and ghost) whose coordinates, as they were before any MeshMoveNodes, lie in the cube of half-width `half`
   about x [dim]; cost is proportional to the answer, by a background grid. The list is valid until the next call.
   Periodic images are the caller's business (MeshNextImage). Not collective. */
PetscErrorCode MeshNodesInBox(Mesh, const PetscReal x[], PetscReal half, PetscInt *n, const PetscInt *list[]);

/* ---- which rank has what: bodies that are spread ---- */

/* Boxes, lowest and highest corner, that cover this rank's own cells, at most 8, to be freed by the caller; all its
   ghost cells, or their images, lie no farther than *beyond from one, which is larger by `reach` diagonals of this
   rank's largest cell. Not collective (the mesh as it is). */
PetscErrorCode MeshCover(Mesh, PetscInt reach, PetscInt *n, PetscReal (**box)[2][3], PetscReal *beyond);
/* Whose a position in the domain is, by the cell there, for meshes that are dealt along a curve; NULL for others. The
   caller's, also after the mesh is gone. Not collective. */
PetscErrorCode MeshCreateCurve(Mesh, Curve *);
/* The same of all ranks; *beyond: the largest of them. Collective. */
PetscErrorCode MeshCreateRankBoxes(Mesh, PetscInt reach, RankBoxes *, PetscReal *beyond);

/* ---- nodes that move: align, deform, couple ---- */

/* Give the n local nodes (own and ghost) new positions x [n][dim]; topology, numbering and MeshNodesInBox stay as they
   are. Every rank must give a node it shares the same position; the caller answers for valid cells. Collective in the
   sense that all ranks must call it, possibly with n = 0. */
PetscErrorCode MeshMoveNodes(Mesh, PetscInt n, const PetscInt nodes[], const PetscReal x[]);
/* What positions of nodes are now counts as those before any MeshMoveNodes: for meshes that are given another form as
   a whole. h is measured again. Collective. */
PetscErrorCode MeshRebase(Mesh);

/* ---- exchange ---- */

/* Nodal fields with bs values a node, [nnode_all][bs]: copy own values to ghosts; add ghost contributions to the owner
   (ghosts unchanged). Fetch: the first from one array into the ghosts of another, of which own values are not touched;
   NULL on a rank without ghosts. Collective. */
PetscErrorCode MeshSyncNodes(Mesh, PetscInt bs, PetscReal v[]);
PetscErrorCode MeshFetchNodes(Mesh, PetscInt bs, const PetscReal own[], PetscReal ghost[]);
PetscErrorCode MeshSumNodes(Mesh, PetscInt bs, PetscReal v[]);
PetscErrorCode MeshSyncNodesInt(Mesh, PetscInt v[]);
/* Global numbers of the vertices (corners of cells) among themselves: own ones count up; vertex [nnode_all] number or
   -1, nown how many are own. Collective. */
PetscErrorCode MeshNumberVertices(Mesh, PetscInt vertex[], PetscInt *nown);
