/* Sample: the velocity of a snapshot of another run (report/fields.h) at the nodes of this mesh. Called by run
   (-flow_initial run).

   Exact where the point lies in a cell of that run: its Q2 polynomial. The two meshes need have nothing in common but
   the dimension. Every rank reads the whole snapshot, and looks for its own nodes. */
#pragma once
#include "mesh/mesh.h"

typedef struct {
  PetscInt inside, outside, nowhere; /* own nodes, of all ranks: found; outside, the nearest position of that run's box
                                        answers; in no cell even so (a hole of that mesh): left as they are */
} SampleCount;

/* path: an output folder, of which the last snapshot is taken, or a file fields_<step>.h5. u [nnode_all][dim], synced.
   lower, upper [3]: box of that run's mesh. A position outside of it is first shifted by the periods of this mesh.
   Collective. Errors: no such file, other dimension. */
PetscErrorCode SampleVelocity(const char path[], Mesh, PetscReal u[], PetscReal lower[3], PetscReal upper[3],
                              SampleCount *);
