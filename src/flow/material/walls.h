/* Walls: how far the quadrature points of the cells are from the walls of the mesh, and how the nearest point of a wall
   moves.

   Walls are the boundary faces with a condition of type no_slip, moving_wall or rotating_wall, each with the second-
   order geometry of its cell: the nearest point is found on the curved face, by descent along its two coordinates.
   Every rank knows all of these faces, so that values do not depend on the ranks; the cost is 250 bytes a face.
   Periodic images count. Computed once, and anew for cells that change their shape. */
#pragma once
#include <petscsys.h>

typedef struct _p_Walls *Walls;
struct _p_Flow;

/* Collective. The flow is borrowed. */
PetscErrorCode WallsCreate(struct _p_Flow *, Walls *);
PetscErrorCode WallsDestroy(Walls *);
/* These n local cells have another shape. Local. */
PetscErrorCode WallsForget(Walls, PetscInt n, const PetscInt cells[]);
/* Distances of cells whose shape is new, velocities of the step. Collective. */
PetscErrorCode WallsUpdate(Walls);
/* Distance from quadrature point q of local cell c, PETSC_MAX_REAL without walls, and velocity v [dim] there. Local. */
PetscReal WallsDistance(Walls, PetscInt c, PetscInt q, PetscReal v[3]);
