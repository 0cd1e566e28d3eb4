/* Hang: element interpolation at jumps between levels of refinement.

   A cell beside a cell of twice its size has nodes that are none of its own: on the shared face (in space also edge)
   its slots of MeshLocal.cell_node hold the nodes of the large face, and values at its lattice positions are H_e times
   the values in its slots: (3/8, 3/4, -1/8) at the quarter points of a large edge, the node itself at its ends and
   middle, tensor products on faces. Hanging positions are therefore in no array, matrix or exchange. What is computed
   with a cell, at its positions, returns to its slots with the transpose.

     gather         v <- H_e v         MeshHangGather
     scatter        r <- H_e^T r       MeshHangScatter
     cell matrices  K <- H_e^T K H_e   MeshHangMatrix;   b <- b H_e for rows of functionals: MeshHangScatter

   Nothing here is collective. */
#pragma once
#include <petscsys.h>

#define MESH_HANG_SLOTS 27
#define MESH_HANG_CODES 512 /* ways in which something hangs */

typedef struct _n_MeshHang {
  PetscInt  code;                       /* of the way, below MESH_HANG_CODES */
  PetscInt  nb, n;                      /* slots; rows of H_e that are not those of the identity */
  PetscInt  slot[MESH_HANG_SLOTS];      /* the index of such a row */
  PetscInt  start[MESH_HANG_SLOTS + 1]; /* its entries */
  PetscInt  from[MESH_HANG_SLOTS * 9];
  PetscReal weight[MESH_HANG_SLOTS * 9];
  PetscReal corner[8][8]; /* the same for multilinear functions of the vertices: at corner, of corner slot */
} MeshHang;

/* v [nb][bs]: values in slots -> values at positions */
void MeshHangGather(const MeshHang *, PetscInt bs, PetscReal v[]);
/* r [nb][bs]: what belongs to positions -> what belongs to slots */
void MeshHangScatter(const MeshHang *, PetscInt bs, PetscReal r[]);
/* K [nb * bs][stride], the same unknowns in rows and columns */
void MeshHangMatrix(const MeshHang *, PetscInt bs, PetscInt stride, PetscReal K[]);
/* Of K [nb][stride], one unknown a node: d [nb] = diagonal of H_e^T K H_e */
void MeshHangDiagonal(const MeshHang *, PetscInt stride, const PetscReal K[], PetscReal d[]);
