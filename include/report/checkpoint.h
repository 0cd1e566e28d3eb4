/* Checkpoint: when the state of a run is written to disk, and how a run goes on from there. Called by run.

   Options, signals, what may change at a restart: runs/guide/parallel.md, "Checkpoints and restarts". Content of the
   files: base/state.h, where each module visits its own state.

   Files checkpoint_<step>.h5 in the output directory are complete or do not exist; the last two are kept. On the
   same number of ranks a restarted run repeats bit for bit what the run that wrote the checkpoint did after it, on
   another number to the tolerance of the solvers. Therefore a run renews its solvers after every checkpoint, as the
   restarted one must: runs with different -checkpoint_every differ by round-off. A refined mesh (-mesh_levels) has
   its tree in the file and may change within its box: base cells, levels, what it is refined around. Open MPI's
   mpiexec passes SIGUSR1 on; after a SIGTERM to mpiexec its ranks have one second, unless
   OMPI_MCA_odls_base_sigkill_timeout says more.

   Collective: on the communicator of the mesh. */
#pragma once
#include "report/fields.h"

typedef struct _p_Checkpoint *Checkpoint;

/* ---- set-up of a scene ---- */

/* Reads the options and takes over SIGTERM, SIGINT and SIGUSR1 until it is destroyed; touches no file. deforms: the
   mesh will follow bodies, and nodes are told by their positions now, before it does. Collective. */
PetscErrorCode CheckpointCreate(Mesh, PetscBool deforms, Fields, Checkpoint *);
/* Frees it and restores the signals; sets it to NULL. Local. */
PetscErrorCode CheckpointDestroy(Checkpoint *);
/* Prints when checkpoints are written. Collective. */
PetscErrorCode CheckpointView(Checkpoint, PetscViewer);
/* A module with state, visited by `visit` under its name; loading follows the order of these calls. `module` is
   borrowed. Not collective. */
PetscErrorCode CheckpointAdd(Checkpoint, const char name[], void *module, StateVisit visit);

/* Before any of them is loaded, `restore` sees the module of this name in a file that may have another mesh
   (StateBeginLook) and can give the mesh the cells of the file. Not collective. */
PetscErrorCode CheckpointSetRestore(Checkpoint, const char name[], void *module, StateVisit restore);

/* ---- start and restart ---- */

/* Load the state of all modules if -sim_restart is given. Call when all modules are built and added, before the first
   step. Collective.
   Errors: those of StateBeginLoad; no checkpoint found. */
PetscErrorCode CheckpointLoad(Checkpoint, PetscBool *restarted);
/* The output directory exists now: print what the run goes on from, remove leftovers. Collective. Error: the
   directory holds checkpoints of another run and neither -sim_restart nor -output_overwrite is given. */
PetscErrorCode CheckpointOpen(Checkpoint);

/* ---- after every step, and at the end ---- */

/* After step `step`: is a checkpoint due, is the run to stop? After one that took long the solves of the next one hear
   signals, too (base/interrupt.h). Collective, one reduction. */
PetscErrorCode CheckpointPoll(Checkpoint, PetscInt step, PetscBool *due, PetscBool *stop);
/* Write the state now, remove all but the last two files. Does nothing if that of this step is written. Collective.
   Errors: disk full. */
PetscErrorCode CheckpointWrite(Checkpoint, PetscInt step, PetscReal time);
/* At the end of the run: writes if checkpoints are wanted at all; tells where the state is after SIGTERM.
   Collective. */
PetscErrorCode CheckpointFinish(Checkpoint, PetscInt step, PetscReal time);

/* The last checkpoint of this process's run, or "" (for the message after an error). Not collective. */
const char *CheckpointGetLast(void);
