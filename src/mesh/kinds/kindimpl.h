/* The inside of a MeshKind, for the files of this folder. */
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
  KIND_TUBE,
  KIND_BALL,
  KIND_SHELL,
  KIND_FILE
};

struct _p_MeshKind {
  MPI_Comm    comm;
  PetscInt    kind, dim;
  const char *name; /* of the kind */
  PetscInt    cells[3];
  PetscReal   lower[3], upper[3], period[3];
  PetscInt    block[3]; /* fitted: first line of the O-grid block along x, y; what is round: cells along a side */
  PetscInt    nring;
  char        file[PETSC_MAX_PATH_LEN];
  MeshMap     map;
  Curved      curved; /* cells of a file that bend, NULL: there are none */
  PetscInt    nboundary;
  char        boundary[MAX_BOUNDARIES][64];
};

/* The mesh of a Gmsh file on rank 0. Boundaries are the physical groups of its outer edges or faces: by name (what is
   no letter, digit or dash becomes '_'), or by number; without any there is one, `boundary`. Cells that go round the
   wrong way are turned, with a remark. Collective; the caller destroys dm. Errors: an unreadable file, cells that are
   no quadrilaterals or hexahedra of order 1 or 2, or are inverted, or not joined; a plane that is not x, y; outer edges
   or faces without a name beside others with one; too many names, two for a face. */
PetscErrorCode MeshKindCreateFromFile(MeshKind, DM *dm);
/* This boundary of a 2D file is the circle {x, y, radius}: its vertices move there, its cells are bent. Collective.
   Error: a vertex that is not near the circle. */
PetscErrorCode MeshKindMakeRound(MeshKind, DM, const char boundary[], const PetscReal circle[3]);

/* Readers of options, collective: -mesh_periodic for the box from lower to upper; centre and radius of a circle;
   -mesh_ring_ratio;
   -mesh_resolution (error: below `min`); layers of an O-grid along z (n: as many unless told otherwise) and their
   periodicity. */
PetscErrorCode MeshKindReadPeriodic(MeshKind);
PetscErrorCode MeshKindReadCentre(MeshKind, PetscInt axes);
PetscErrorCode MeshKindReadRadius(MeshKind);
PetscErrorCode MeshKindReadCircle(MeshKind);
PetscErrorCode MeshKindReadRatio(MeshKind);
PetscErrorCode MeshKindReadResolution(MeshKind, PetscInt min, PetscInt *resolution);
PetscErrorCode MeshKindReadLayers(MeshKind, PetscInt n);
/* The whole number nearest to n, at least 1 */
static inline PetscInt MeshKindCount(PetscReal n)
{
  return PetscMax(1, (PetscInt)PetscFloorReal(n + 0.5));
}

/* Options of boxes and graded channels */
PetscErrorCode MeshKindReadCells(MeshKind);
PetscErrorCode MeshKindReadChannel(MeshKind);
PetscErrorCode MeshKindReadFitted(MeshKind);
/* Options of these kinds, and the mesh of them and of the fitted channel on rank 0. Collective. */
PetscErrorCode MeshKindReadDisc(MeshKind);
PetscErrorCode MeshKindReadAnnulus(MeshKind);
PetscErrorCode MeshKindReadTube(MeshKind);
PetscErrorCode MeshKindReadBall(MeshKind);
PetscErrorCode MeshKindReadShell(MeshKind);
PetscErrorCode MeshKindCreateRound(MeshKind, DM *dm);
