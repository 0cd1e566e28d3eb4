/* The inside of a MeshKind, for kind.c (options, boxes) and gmsh.c (what mesh files need). */
#pragma once
#include "kind.h"
#include "map.h"

#define MAX_BOUNDARIES 32

enum {
  KIND_BOX,
  KIND_CHANNEL,
  KIND_FITTED,
  KIND_DISC,
  KIND_ANNULUS,
  KIND_FILE
};

struct _p_MeshKind {
  MPI_Comm  comm;
  PetscInt  kind, dim;
  PetscInt  cells[3];
  PetscReal lower[3], upper[3], period[3];
  PetscInt  block[3]; /* fitted: first line of the O-grid block along x, y; O-grids: cells along a side */
  PetscInt  nring;
  char      file[PETSC_MAX_PATH_LEN];
  MeshMap   map;
  PetscInt  nboundary;
  char      boundary[MAX_BOUNDARIES][64];
};

/* The physical names of a Gmsh file that hold faces become the boundaries; the mesh is on rank 0. Collective.
   Errors: no name, too many, two names for a face. */
PetscErrorCode MeshKindFindFileBoundaries(MeshKind, DM);
/* This boundary of a 2D file is the circle {x, y, radius}: its vertices move there, its cells are bent. Collective.
   Error: a vertex that is not near the circle. */
PetscErrorCode MeshKindMakeRound(MeshKind, DM, const char boundary[], const PetscReal circle[3]);
