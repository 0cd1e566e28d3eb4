/* Outlines: all bodies as HDF5 + XDMF, at the same steps as the fields.

   bodies_<step>.h5: time [1]; per body position, velocity, angular_velocity, force (of the fluid), contact_force
   [n][3], angle, radius (of the bounding circle) [n], group [n];
   in 2D also outline [n][points][3] (counter-clockwise; a disc starts in its own direction, so that its turning can
   be seen) and line [n][points + 1].
   bodies.xmf: in ParaView two blocks, `centres` (points for glyphs) and, in 2D, `outlines`, with velocity, angular
   velocity and radius. Bodies that have left are marked by radius 0. */
#pragma once
#include "bodies/bodies.h"

typedef struct _p_Outlines *Outlines;

/* The bodies are borrowed. Collective on PETSC_COMM_WORLD, like all others. */
PetscErrorCode OutlinesCreate(Bodies, Outlines *);
PetscErrorCode OutlinesDestroy(Outlines *);
/* Write one snapshot into dir, an existing directory; does nothing without bodies. A step written twice takes the
   place of its first version. Error: the disk. */
PetscErrorCode OutlinesWrite(Outlines, const char dir[], PetscInt step, PetscReal time);
/* StateVisit of an Outlines: the snapshots so far. */
PetscErrorCode OutlinesVisitState(void *outlines, State);
