/* PhaseCurve: closed curves of quadratic edges in the plane, the interface between two fluids. The inside is on their
   left. The nodes of an edge are those of a mesh that is lined up with the interface, so that the curve is sampled anew
   on every mesh and never operated on: what is connected is decided by the cells. A loop that runs clockwise is a hole.
   Where an interface ends at a wall, edges along the wall close the curve: they bound the area and are no interface.

   All ranks know all edges, in an order that does not depend on the partition, and do the same with them. Nothing is
   collective but what says so. */
#pragma once
#include "phase/point.h"

/* As a rank hands it in */
typedef struct {
  PetscReal key[3][2]; /* tells the first, the middle and the last node apart, the same on all ranks */
  PetscReal x[3][2];
  PetscReal drop; /* number of what it bounds */
  PetscReal wall; /* 1: along a wall, 0: of the interface */
} PhaseEdge;

typedef struct {
  PetscInt n, nloop;
  PetscReal (*x)[3][2];     /* [n] first, middle, last node */
  PetscReal (*ball)[3];     /* [n] a circle that holds the edge */
  PetscReal  whole[3];      /* one that holds all */
  PetscInt  *drop;          /* [n] */
  PetscInt  *next, *before; /* [n] */
  PetscInt  *loop;          /* [n] */
  PetscInt  *first, *edge;  /* [nloop + 1], [n] edges of a loop */
  PetscReal *area;          /* [nloop] negative: a hole */
  PetscBool *wall;          /* [n] along a wall */
} PhaseCurve;

/* The curve of all edges that the ranks hand in. period [2]: 0 where there is none; edges of a loop are put next to
   each other. Collective. Error: an edge has none that goes on where it ends. */
PetscErrorCode PhaseCurveGather(MPI_Comm, PetscInt n, const PhaseEdge edge[], const PetscReal period[], PhaseCurve *);
/* n edges, for the caller to fill x, drop, wall, next and before; then PhaseCurveLink finds the loops. */
PetscErrorCode PhaseCurveCreate(PetscInt n, PhaseCurve *);
void           PhaseCurveLink(PhaseCurve *);
PetscErrorCode PhaseCurveDestroy(PhaseCurve *);
/* After the nodes have moved: circles, areas. */
void PhaseCurveUpdate(PhaseCurve *);

/* Closest point to x, of all loops. Where loops overlap they are one (the least distance of those that are no holes),
   so that a curve that has run into another is one with it. Farther than `reach` (edge -1): d is reach, no place. */
void PhaseCurveClosest(const PhaseCurve *, const PetscReal x[2], PetscReal reach, PhasePoint *);
/* The nearest point of those where the outward normal of the edge has no part against out [2] (NULL: of all), whatever
   the loops are to each other; of all if there is none. d: its distance, without a sign. */
void PhaseCurveApproach(const PhaseCurve *, const PetscReal x[2], const PetscReal out[2], PhasePoint *);
/* Sums over the loops of a drop. Green's theorem, exact for quadratic edges but for the length. */
void PhaseCurveMeasure(const PhaseCurve *, PetscInt drop, PhaseSums *);
/* A new curve *to of the edges that stay [n] (NULL: all), each followed by the next of its loop that does. */
PetscErrorCode PhaseCurveKeep(const PhaseCurve *, const PetscBool stays[], PhaseCurve *to);
/* The loops of a drop go. */
PetscErrorCode PhaseCurveRemove(PhaseCurve *, PetscInt drop);
/* Moves the nodes of a drop by `way` along their normals, outwards; ends at a wall along it, to where a parallel curve
   has them. PhaseCurveUpdate follows. */
PetscErrorCode PhaseCurveShift(PhaseCurve *, PetscInt drop, PetscReal way);

/* meet.c. Where the curve is inside what is solid, and so far before it, it is drawn anew, such that it meets the
   surface at the contact angle. */
PetscErrorCode PhaseCurveMeet(PhaseCurve *, const PhaseSolid *);

/* retrace.c. *now: the curve drawn anew, by itself, where a lattice of lines `step` apart, one of them through origin,
   cuts it: edges of about that length, their nodes on it. In place of drops its edges have the numbers of connected
   components, from 0. Of a curve without walls. */
PetscErrorCode PhaseCurveRetrace(const PhaseCurve *, const PetscReal origin[2], PetscReal step, PhaseCurve *now,
                                 PetscInt *ncomponent);
