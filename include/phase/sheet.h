/* PhaseSheet: closed surfaces of biquadratic faces in space, the interface between two fluids: what a PhaseCurve
   (curve.h) is in the plane. The nodes of a face are those of a side of a hexahedron of a mesh that is lined up with
   the interface. A surface that encloses a negative volume is a hole. Where an interface ends at plane walls across an
   axis, faces along these close the surface: they bound the volume and are no interface.

   All ranks know all faces, in an order that does not depend on the partition, and do the same with them. Nothing is
   collective but what says so. */
#pragma once
#include "phase/point.h"

/* As a rank hands it in. Nodes are a lattice of 3 x 3, the first direction fastest; first times second direction points
   out of the drop. */
typedef struct {
  PetscReal key[9][3]; /* tells nodes apart, the same on all ranks */
  PetscReal x[9][3];
  PetscReal drop; /* number of what it bounds */
  PetscReal wall; /* 1: along a wall, 0: of the interface */
} PhaseFace;

typedef struct {
  PetscInt n, nnode, npart;
  PetscReal (*x)[9][3]; /* [n] */
  PetscReal (
    *ball)[5];         /* [n] a ball that holds the face; behind it, how far from the next of its nodes it is at most */
  PetscReal whole[4];  /* one that holds all */
  PetscInt (*node)[9]; /* [n] of nnode, those of neighbours are the same */
  PetscInt  *drop;     /* [n] */
  PetscInt  *part;     /* [n] closed surface that it is of */
  PetscReal *volume;   /* [npart] negative: a hole */
  PetscBool *closes;   /* [npart] not over a period */
  PetscBool *wall;     /* [n] along a wall */
} PhaseSheet;

/* The surfaces of all faces that the ranks hand in. period [3]: 0 where there is none; faces of a surface are put next
   to each other. Collective. Error: a surface is not closed. */
PetscErrorCode PhaseSheetGather(MPI_Comm, PetscInt n, const PhaseFace face[], const PetscReal period[], PhaseSheet *);
/* n faces, for the caller to fill x, node, drop, part and wall; then PhaseSheetUpdate. */
PetscErrorCode PhaseSheetCreate(PetscInt n, PetscInt nnode, PetscInt npart, PhaseSheet *);
PetscErrorCode PhaseSheetDestroy(PhaseSheet *);
/* After the nodes have moved: balls, volumes. */
void PhaseSheetUpdate(PhaseSheet *);

/* As PhaseCurveClosest, PhaseCurveApproach, PhaseCurveMeasure and PhaseCurveShift (curve.h). Near: distance of the
   nearest node, or reach if that is less. */
void           PhaseSheetClosest(const PhaseSheet *, const PetscReal x[3], PetscReal reach, PhasePoint *);
void           PhaseSheetApproach(const PhaseSheet *, const PetscReal x[3], const PetscReal out[3], PhasePoint *);
void           PhaseSheetMeasure(const PhaseSheet *, PetscInt drop, PhaseSums *);
PetscReal      PhaseSheetNear(const PhaseSheet *, const PetscReal x[3], PetscReal reach);
PetscErrorCode PhaseSheetShift(PhaseSheet *, PetscInt drop, PetscReal way);
/* fixed [nnode]: along which axes (bits) walls fix a node, those that the faces along them close the surface at. Slide:
   a unit normal n becomes the way along such walls that goes as far along it. */
void PhaseSheetGetFixed(const PhaseSheet *, PetscInt fixed[]);
void PhaseSheetSlide(PetscInt fixed, PetscReal n[3]);
/* sheetmeet.c. As PhaseCurveMeet. */
PetscErrorCode PhaseSheetMeet(PhaseSheet *, const PhaseSolid *);
