/* Boxes: where -mesh_refine asks for fine cells besides those at surfaces: in boxes of the domain, and in boxes that go
   with bodies, such as their wakes (-mesh_box_<box>_group).

   Cells that overlap a box by half get its levels; outside, levels fall off with a slope that keeps the balance. A box
   that goes with a body stands as the body does when the mesh is made: its corners are measured from the body's centre,
   along the axes of the domain or, with the first one, against the velocity of the body. What reaches over a periodic
   border goes on behind it. */
#pragma once
#include "../kinds/kind.h"
#include "mesh/mesh.h"

#define BOXES_NAME 32
#define BOXES_MAX  16 /* names in -mesh_refine */

typedef struct {
  PetscReal origin[3], axis[3][3]; /* what places are measured from, and along */
  PetscReal lower[3], upper[3];
  PetscInt  levels;
} MeshBox;

/* What -mesh_refine names */
typedef struct {
  PetscBool bodies, expression, carried; /* around bodies; by -mesh_distance; does a box go with bodies? */
  PetscInt  nbox;
  char      box[BOXES_MAX][BOXES_NAME], group[BOXES_MAX][BOXES_NAME]; /* group: of the bodies a box goes with, or "" */
} BoxesNames;

typedef struct {
  BoxesNames names;
  MeshBox    given[BOXES_MAX];     /* [names.nbox]; those of a group are measured from its bodies */
  PetscBool  motion[BOXES_MAX];    /* and stand against their motion? */
  PetscInt   n, capacity, carried; /* carried: those that go with bodies that this rank owns */
  MeshBox   *box;                  /* [n] with periodic images */
} Boxes;

/* Collective. Error: too many. */
PetscErrorCode BoxesReadNames(BoxesNames *);
/* Read the boxes that -mesh_refine names. Collective. Errors: a box that is empty, that nobody gave or that is finer
   than -mesh_levels. */
PetscErrorCode BoxesRead(MPI_Comm, PetscInt dim, PetscInt levels, Boxes *);
/* How far from a body a box that goes with it refines cells of sides h; 0: none does. */
PetscReal BoxesReach(const Boxes *, PetscReal h);
/* Put them where the surface (may be NULL) has their bodies now. Error: a group that the scene does not have. */
PetscErrorCode BoxesPlace(Boxes *, MeshKind, const MeshSurface *);
PetscErrorCode BoxesDestroy(Boxes *);
/* Does a box ask for a cell of this level, centre x [dim] and longest side h to be halved? Not collective. */
PetscBool BoxesRefine(const Boxes *, PetscInt dim, PetscInt level, const PetscReal x[], PetscReal h);
