/* Sample: a field of a snapshot of another run (report/fields.h) at the nodes of this mesh. Called by run
   (-flow_initial run, -scalar_<scalar>_initial_run).

   Exact where the point lies in a cell of that run: its Q2 polynomial. The two meshes need have nothing in common but
   the dimension. Every rank reads the whole snapshot, and looks for its own nodes. */
#pragma once
#include "mesh/mesh.h"

typedef struct {
  PetscInt inside, outside, nowhere; /* own nodes, of all ranks: found; outside, the nearest position of that run's box
                                        answers; in no cell even so (a hole of that mesh): left as they are */
} SampleCount;

/* option: whose value the path is, for messages. path: an output folder, of which the last snapshot is taken, or a file
   fields_<step>.h5. The first `width` numbers of the field go to v [nnode_all][width], synced, of nodes that lie at
   x [nnode_all][dim]. box: lower and upper corner of that run's mesh. A position outside of it is first shifted by the
   periods of this mesh. Collective. Errors: no such file or field, other dimension. */
PetscErrorCode SampleField(const char option[], const char path[], const char field[], PetscInt width, Mesh,
                           const PetscReal x[], PetscReal v[], PetscReal box[2][3], SampleCount *);
