/* Boundaries: what walls feel and what flows through openings, of every named boundary.

   The force of a wall is the momentum residual summed over its nodes, as in the balance of momentum. Where
   boundaries meet, a node counts for the one whose velocity holds there, but for the pressure, which each gets for
   its own share of the surface (that of an inflow would be seen in the friction of the wall beside it). What penalty
   bodies that reach a wall exert on it is not in it.
   The flow through an opening is int u.n = sum of u over its nodes with the weights int phi n, the column sums of the
   divergence, so that the flows through all openings add up to the integral of div u. */
#pragma once
#include "couple/couple.h"
#include "fitted.h"

typedef struct _p_Boundaries *Boundaries;

/* A node with prescribed components, as one cell has it */
typedef struct {
  PetscInt  cell, slot, node; /* place in the list of cells, slot in it */
  PetscInt  owner[3];         /* boundary that prescribes a component, -1: none */
  PetscInt  wall;             /* components of walls, not of an inflow: bit mask */
  PetscBool fitted, shared;   /* on a body that is a hole; on several boundaries */
} BoundaryPoint;

PetscErrorCode BoundariesCreate(Flow, Fitted, Boundaries *);
PetscErrorCode BoundariesDestroy(Boundaries *);
/* Weights anew, for a mesh that has moved. Collective. */
PetscErrorCode BoundariesUpdate(Boundaries);
/* Own cells with prescribed nodes, and the places of these in them, cell after cell. Borrowed, local. */
PetscErrorCode BoundariesGetPoints(Boundaries, PetscInt *ncell, const PetscInt *cell[], PetscInt *n,
                                   const BoundaryPoint *point[]);
/* Begin a sum; what a place supplies: its momentum residual [dim], and the pressure, which is divided among the
   boundaries that meet there; the flow of u [nnode_all][dim], and the sum over ranks. Only Finish is collective. */
PetscErrorCode BoundariesBegin(Boundaries);
PetscErrorCode BoundariesAdd(Boundaries, const BoundaryPoint *, const PetscReal residual[], const PetscReal p[]);
PetscErrorCode BoundariesFinish(Boundaries, const PetscReal u[]);
/* What else wall b of the mesh feels, after Finish: force [3] of all ranks. Not collective. */
PetscErrorCode BoundariesAddForce(Boundaries, PetscInt b, const PetscReal force[3]);
PetscErrorCode BoundariesGet(Boundaries, PetscInt *n, const CoupleBoundary *boundary[]);
