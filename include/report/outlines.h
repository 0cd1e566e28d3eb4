/* Outlines: all bodies as HDF5 + XDMF, at the same steps as the fields. Called by run.

   bodies_<step>.h5: time [1]; per body position, velocity, angular_velocity, force (of the fluid), contact_force
   [n][3], orientation [n][4] (unit quaternion, scalar first: from the body's axes to those of space), angle, radius
   (of the bounding circle; 0: has left) [n], group, body [n]. What is drawn are the n bodies and then their images
   across the period that reach into the domain:
     2D: outline [lines][points][3], counter-clockwise, corners exact, first point straight ahead along the body's first
         axis (so that its turning can be seen); line [lines][points + 1];
     3D: surface [points][3], triangle [triangles][3], normals outward;
     of each line or triangle: cell_body, cell_group, cell_velocity, cell_angular_velocity.
   With bonds also aggregate [n] and cell_aggregate.
   bodies.xmf shows what is drawn, centres.xmf the centres with all that is known of the bodies. */
#pragma once
#include "bodies/bodies.h"

typedef struct _p_Outlines *Outlines;

/* ---- set-up of a scene ---- */

/* The bodies are borrowed. Box of the domain, and its period (0: none), [3]. Collective on the communicator of the
   run, like all others. */
PetscErrorCode OutlinesCreate(MPI_Comm, Bodies, const PetscReal lower[], const PetscReal upper[],
                              const PetscReal period[], Outlines *);
/* Frees it and sets it to NULL. Collective. */
PetscErrorCode OutlinesDestroy(Outlines *);
/* All snapshots of the run will have aggregates (contact/bonds.h), those of before a restart too. Local. */
void OutlinesAddAggregates(Outlines);
/* ---- a snapshot, restart ---- */

/* Write one snapshot into dir, an existing directory; does nothing without bodies. aggregate [n] of the bodies this
   rank knows: number of the lowest body of its aggregate, -1: alone; NULL without OutlinesAddAggregates. A step written
   twice takes the position of its first version. Error: the disk. */
PetscErrorCode OutlinesWrite(Outlines, const char dir[], PetscInt step, PetscReal time, const PetscReal aggregate[]);
/* After a restart, in the directory where the run goes on: bodies.xmf and centres.xmf are written again, with the
   snapshots of the checkpoint alone; none if the directory has no such list. Error: the disk. */
PetscErrorCode OutlinesRewind(Outlines, const char dir[]);
/* StateVisit of an Outlines: the snapshots so far. */
PetscErrorCode OutlinesVisitState(void *outlines, State);
