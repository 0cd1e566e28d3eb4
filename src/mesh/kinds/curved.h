/* Curved: cells of second order of a mesh file, whose edges and faces bend.

   The DMPlex has the corners alone, and its cells are halved with straight edges (-dm_refine). Which cell of the file a
   cell came from stays with it in labels, and where its nodes lie in that cell tells where they lie on the bent one:
   refined meshes keep the geometry of the file. */
#pragma once
#include <petscdmplex.h>

typedef struct _p_Curved *Curved;

/* ncell cells with the positions x [ncell][nb][dim] of their nodes by lattice position (mesh.h) on rank 0, taken over;
   both ignored elsewhere. Collective. */
PetscErrorCode CurvedCreate(MPI_Comm, PetscInt dim, PetscInt ncell, PetscReal *x, Curved *);
PetscErrorCode CurvedDestroy(Curved *);
/* Number the cells of a mesh whose cells are those, on rank 0. Collective. */
PetscErrorCode CurvedMark(Curved, DM);
/* Fetch the cells that this rank's came from, once the mesh is refined and distributed. Collective. */
PetscErrorCode CurvedFetch(Curved, DM);
/* After that: reference coordinates xi [dim] in [-1, 1] of a point q [dim] of the straight cell that cell `point` of
   the DM came from, and the place x [dim] on the bent one. Not collective. Error: the straight cell is inverted. */
PetscErrorCode CurvedFind(Curved, PetscInt point, const PetscReal q[], PetscReal xi[]);
void           CurvedEvaluate(Curved, PetscInt point, const PetscReal xi[], PetscReal x[]);
