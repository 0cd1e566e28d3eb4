/* Remap: nodal fields of a mesh that is about to move, evaluated where its nodes will be.

   The value at a new position is, in this order:
     (a) that of the old fluid cell that contains it;
     (b) outside all old fluid cells (a body has uncovered it): that of the Q2 polynomial of the nearest one in
         reference coordinates, as far as |xi| <= 1.8;
     (c) where no map can be inverted (flat corner cells of a staircase): first-order Taylor from the nearest of the
         points (0, +-0.77)^dim of old fluid cells, up to 1.5 cells away;
     (d) the value the node has now; counted.
   Cells that must not answer for a position are told by their sides. A position that is not in a cell of this rank is
   offered to the ranks near by, and the best answer is taken, so that the result does not depend on the partition. */
#pragma once
#include "mesh/mesh.h"

typedef struct _p_Remap *Remap;

typedef struct {
  PetscInt inside, extended, taylor, kept; /* nodes by (a) .. (d), all ranks */
} RemapCount;

PetscErrorCode RemapCreate(Mesh, Remap *);
PetscErrorCode RemapDestroy(Remap *);

/* What each cell is now, [ncell_all] */
typedef struct {
  const PetscInt *inactive; /* >= 0: no part of the fluid; NULL: all are */
  const PetscInt *side;     /* a cell of side s is not asked for positions of side -s; 0: for all */
} RemapCells;

/* nodes [n]: own nodes, x [n][dim] their new positions and side [n] of these (RemapCells). field [nfield]: arrays
   [nnode_all][dim], synced. out [n][nfield][dim]. Collective. */
PetscErrorCode RemapEvaluate(Remap, PetscInt n, const PetscInt nodes[], const PetscReal x[], const PetscInt side[],
                             RemapCells, PetscInt nfield, const PetscReal *const field[], PetscReal out[],
                             RemapCount *);
/* The same at the feet of trajectories: fields at y of each node, y + part way(y) = x, way [nnode_all][dim] a
   displacement of all nodes, synced, and part [n]; all cells answer. This is where x is in the mesh moved by part way;
   beside it y is the nearest place of the nearest cell. out [n][1 + nfield][dim]: x - y, then the fields.
   Collective. */
PetscErrorCode RemapEvaluateFeet(Remap, PetscInt n, const PetscInt nodes[], const PetscReal x[], const PetscReal way[],
                                 const PetscReal part[], PetscInt nfield, const PetscReal *const field[],
                                 PetscReal out[]);
/* The same for positions of another mesh, in cells of these sizes [n] (RemapCellSize of theirs); out has on entry what
   (d) leaves. Collective. */
PetscErrorCode RemapEvaluateAt(Remap, PetscInt n, const PetscReal x[], const PetscReal size[], const PetscInt side[],
                               RemapCells, PetscInt nfield, const PetscReal *const field[], PetscReal out[],
                               RemapCount *);
/* Size of the cells around local node i before they moved: the largest extent along an axis. Not collective. */
PetscReal RemapCellSize(Remap, PetscInt i);
