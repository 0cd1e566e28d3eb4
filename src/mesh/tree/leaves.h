/* Leaves: which cells a refined box has (-mesh_levels), without a list of them on any rank.

   Every base cell of the box (or graded channel) is the root of a quadtree or octree. A cell of level l with longest
   side h_l is refined if the distance of its centre to the surfaces is below `band` h_l, or as the boxes of
   -mesh_refine want it. Distances change by at most the way, so that from band 2.2 (plane) and 2.6 (space) on no two
   cells that touch, corners included, differ by more than one level; for narrower bands a cell is also refined if one
   of its children's neighbours would otherwise be two levels finer than a cell beside it (Sundar, Sampath & Biros,
   SIAM J. Sci. Comput. 30, 2008, balance such trees from a list; here it is part of the formula). Whether a cell
   exists can thus be told without communication, by every rank near its own cells: there it knows where bodies are
   (MeshSurface.look) and which cells are marked. What -mesh_distance gives counts as the distance to one more surface,
   filled where it is negative.

   Cells are ordered along the Z curve (Morton 1966) of the lattice of finest cells; a rank has a contiguous range,
   found from the counts of base cells, the only thing all ranks know of. Places on the lattice: [0, n 2^levels) an
   axis, at most 2^20. */
#pragma once
#include "boxes.h"
#include "keys.h"
#include "../kinds/kind.h"
#include "base/curve.h"
#include "base/expr.h"
#include "mesh/mesh.h"

typedef struct {
  uint64_t key; /* along the curve */
  PetscInt x[3], level;
} Leaf;

#define LEAVES_MAX_NEIGHBOURS 64
#define LEAVES_MAX_LEVELS     12
#define LEAVES_AROUND         4 /* layers of cells around the own ones: three (refined.c) and what lies beside */

typedef struct _n_Leaves {
  MPI_Comm           comm;
  MeshKind           kind;                        /* borrowed */
  PetscInt           dim, levels, n[3], cells[3]; /* base cells, finest cells an axis */
  PetscBool          periodic[3], around, given;  /* refine around the surfaces? where -mesh_distance is small? */
  Expr               distance;                    /* of that; NULL: the number `constant` */
  PetscReal          constant;
  PetscReal          band;
  const MeshSurface *surface; /* borrowed during construction */
  PetscBool          listed;  /* leaves are given, in place of the formula, */
  PetscInt           nlist;
  Leaf              *list; /* [nlist] and these are those of other ranks around the own ones */
  Boxes              boxes;
  Keys               memo[LEAVES_MAX_LEVELS + 1]; /* is a cell refined? */
  PetscInt           nleaf, start;
  PetscInt64         total;
  Leaf              *leaf;  /* [nleaf] of this rank */
  uint64_t          *first; /* [size] key of every rank's first leaf */
} Leaves;

/* Read -mesh_refine, -mesh_refine_distance and boxes and find the leaves of this rank. Collective. Errors: nothing to
   refine around, a band too narrow, fewer cells than ranks, too many cells for the lattice; those of BoxesRead. */
PetscErrorCode LeavesCreate(MPI_Comm, MeshKind, PetscInt levels, const MeshSurface *, Leaves *);
/* The base cells themselves, unrefined; no rank lists more than its own. On one rank row by row, where only
   LeavesPosition may be asked. Collective. Error: fewer cells than ranks. */
PetscErrorCode LeavesCreateEqual(MPI_Comm, MeshKind, Leaves *);
/* The same with leaves that are given: this rank's share [LeavesRange] of the `total` along the curve, without their
   keys. Collective. Error: fewer cells than ranks. */
PetscErrorCode LeavesCreateFromList(MPI_Comm, MeshKind, PetscInt levels, PetscInt64 total, const Leaf[], Leaves *);
/* Of leaves that are given: those around the own ones, by asking their owners. Collective. */
PetscErrorCode LeavesLearn(Leaves *);
/* Of so many leaves, or base cells: how many a rank has, and which is its first. Not collective. */
void           LeavesRange(PetscInt64 total, PetscMPIInt size, PetscMPIInt rank, PetscInt *n, PetscInt *start);
PetscErrorCode LeavesDestroy(Leaves *);
/* Have both the same base cells, levels, and leaves of this rank? Collective, the same on all ranks. */
PetscErrorCode LeavesAreSame(const Leaves *, const Leaves *, PetscBool *same);
/* Forget the surface, and with it the leaves of other ranks. */
PetscErrorCode LeavesClose(Leaves *);

/* The formula: is a cell refined, as far as LEAVES_AROUND lets it be asked? Not collective. */
PetscErrorCode LeavesRefine(Leaves *, PetscInt level, const PetscInt x[], PetscBool *refine);
/* How far from a surface it refines cells of size h */
PetscReal LeavesReach(const Leaves *, PetscReal h);
/* Centre and longest side of a cell. Not collective. */
PetscErrorCode LeavesMeasure(const Leaves *, PetscInt level, const PetscInt x[], PetscReal centre[3], PetscReal *h);
/* The cell that holds the finest cell x [dim] inside the lattice, no farther than LEAVES_AROUND cells from an own one;
   not collective. */
PetscErrorCode LeavesFind(Leaves *, const PetscInt x[], Leaf *);
/* Is the finest cell x inside of a leaf? */
PetscBool LeavesContain(const Leaves *, const Leaf *, const PetscInt x[]);
/* Finest cells just outside of a cell that lie in all cells that touch it: x [*n][3] */
void LeavesTouching(const Leaves *, const Leaf *, PetscInt *n, PetscInt x[LEAVES_MAX_NEIGHBOURS][3]);
/* Cells that touch a cell, each once. Error: levels jump by more than one (a distance that is none). */
PetscErrorCode LeavesNeighbours(Leaves *, const Leaf *, PetscInt *n, Leaf out[LEAVES_MAX_NEIGHBOURS]);
/* Are all cells that touch a cell surely of this rank? Keys ascend with every axis, so those of a block lie between
   those of its ends. */
PetscBool LeavesIsInner(const Leaves *, PetscMPIInt rank, const Leaf *);
/* Is no cell that touches this one two levels larger? Such a one holds a block beside the parent. Error: it does. */
PetscErrorCode LeavesCheckBalance(Leaves *, const Leaf *);
/* Level of the cell that lies beside the cell in direction step [dim] of -1, 0, 1: its own if it is as large or in
   smaller pieces, -1 outside of the domain. */
PetscErrorCode LeavesLevelBeside(Leaves *, const Leaf *, const PetscInt step[], PetscInt *level);
/* Rank of a leaf, and its place in the list of this rank if it is an own one, else -1. */
PetscMPIInt LeavesOwner(const Leaves *, uint64_t key);
PetscInt    LeavesOwnIndex(const Leaves *, uint64_t key);
/* Whose a place in the box is, after the leaves have gone. Error: none. Not collective. */
PetscErrorCode LeavesCreateCurve(const Leaves *, Curve *);
/* Order of leaves along the curve, for qsort */
int LeavesCompare(const void *, const void *);
/* The last own leaf that starts at a key or before; key of a finest cell. What remains after LeavesClose. */
PetscInt LeavesOwnBefore(const Leaves *, uint64_t key);
uint64_t LeavesKey(const Leaves *, const PetscInt x[]);
/* Finest cell x beside one of the domain, wrapped along periodic axes; false if it lies outside */
PetscBool LeavesWrap(const Leaves *, PetscInt x[]);
/* Space coordinates of lattice position x in halves of finest cells. */
PetscErrorCode LeavesPosition(const Leaves *, const PetscInt half[], PetscReal x[]);
/* Sides of a cell in finest cells */
static inline PetscInt LeavesWidth(const Leaves *t, PetscInt level)
{
  return (PetscInt)1 << (t->levels - level);
}
