/* Fields: snapshots of velocity and pressure as HDF5 + XDMF, and the output directory. Called by run.

   Velocity has all its Q2 nodes (XDMF Quadrilateral_9 / Hexahedron_27). The discontinuous pressure is written as cell
   mean and cell gradient (exact) and, for pictures, as nodal average. What is in the files: runs/reference/OUTPUT.md.

   Collective: on the communicator of the mesh, which is borrowed. */
#pragma once
#include "mesh/mesh.h"
#include "base/state.h"

typedef struct _p_Fields *Fields;

/* ---- set-up of a scene ---- */

/* Reads -output_dir (default out/<scene>), -output_every (0 = none), -output_interval (0 = none) and
   -output_overwrite; touches no file. Collective. */
PetscErrorCode FieldsCreate(Mesh, const char scene[], Fields *);
/* Create the directory, once every option is known to be right. One that already holds a series.csv is refused with a
   message naming -output_overwrite unless that is given or the run is a restart. mesh.h5 is written with the first
   snapshot; mesh_<step>.h5 with the first after a restart on another distribution of the mesh, where nodes have other
   numbers. Collective. */
PetscErrorCode FieldsOpen(Fields);
/* Frees it and sets it to NULL. Collective. */
PetscErrorCode FieldsDestroy(Fields *);
/* -output_dir, with its default. Borrowed. Local. */
PetscErrorCode FieldsGetDirectory(Fields, const char **dir);
/* -output_every, steps; 0: none. Local. */
PetscErrorCode FieldsGetEvery(Fields, PetscInt *every);
/* -output_interval, time; 0: none. Local. */
PetscErrorCode FieldsGetInterval(Fields, PetscReal *interval);
/* -output_overwrite. Local. */
PetscErrorCode FieldsGetOverwrite(Fields, PetscBool *overwrite);

/* ---- restart ---- */

/* The run goes on after this step, perhaps from an earlier one than the directory has: fields.xmf is written again
   without what came later, and files of later steps, of whatever kind but checkpoints, are removed. After FieldsOpen.
   Collective. Error: the disk. */
PetscErrorCode FieldsRewind(Fields, PetscInt step);
/* StateVisit of Fields: the snapshots so far. Once loaded, FieldsOpen goes on with the results in the directory. */
PetscErrorCode FieldsVisitState(void *fields, State);

/* ---- a snapshot ---- */

/* The mesh of the next snapshots is displaced by offset [3] as a whole (moving frame): coordinates in the files are
   those of the laboratory. Local. */
PetscErrorCode FieldsMove(Fields, const PetscReal offset[3]);

/* Snapshots hold a further nodal field of this name, with a mean gradient [dim] (both borrowed). Before the first
   snapshot. Local. */
PetscErrorCode FieldsAddScalar(Fields, const char name[], const PetscReal gradient[]);
/* Their values in the next snapshot, without the mean gradient, [number of them][nnode_all]. Borrowed until
   FieldsWrite. Local. */
PetscErrorCode FieldsSetScalars(Fields, const PetscReal value[]);
/* The next snapshots have phases, [own cells]: 0 the fluid around, 1 and up the groups of drops. Borrowed until
   FieldsWrite. Local. */
PetscErrorCode FieldsSetPhase(Fields, const PetscInt phase[]);

/* Write one snapshot: u [nnode_all][dim] (ghosts are not read), p [own cells][dim + 1] (value at the cell centre,
   then gradient: p(x) = p0 + g.(x - xc)), body [nnode_all] index of the body that a node lies in or -1 (may be NULL),
   error [own cells] error_indicator of -mesh_adapt (may be NULL), conformation [nnode_all][6] of a viscoelastic fluid,
   xx xy xz yy yz zz (may be NULL). Files fields_<step>.h5 and a temporal collection fields.xmf, rewritten after every
   snapshot so that a running or killed job can be opened. Collective. */
PetscErrorCode FieldsWrite(Fields, PetscInt step, PetscReal time, const PetscReal u[], const PetscReal p[],
                           const PetscInt body[], const PetscReal error[], const PetscReal conformation[]);
