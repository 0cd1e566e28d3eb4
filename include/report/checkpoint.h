/* Checkpoint: when the state of a run is written to disk, and how a run goes on from there.

   Files checkpoint_<step>.h5 in the output directory (format: state.h), each complete or not there at all; the last
   two are kept. A signal to any rank asks for one too: SIGUSR1 writes and goes on, SIGTERM writes and ends the run in
   order, as does SIGINT (Ctrl-C where there is no mpiexec; a second one ends it at once). (Open MPI's mpiexec passes
   SIGUSR1 on; a SIGTERM to mpiexec itself leaves its ranks one second only, unless
   OMPI_MCA_odls_base_sigkill_timeout says more: send it to a rank, or let the batch system send it early.)

   On the same number of ranks a restarted run repeats bit for bit what the run that wrote the checkpoint did after
   it, on another number to the tolerance of the solvers.
   For this the run that goes on starts its solvers afresh after every checkpoint, as the restarted one must: their
   set-up is the price of a checkpoint, and runs with different -checkpoint_every differ by round-off.

   Options: -checkpoint_every steps (0: none), -checkpoint_minutes wall clock (0: none), -sim_restart FILE or latest
   (the newest whole checkpoint in -output_dir). With either of the first two the last state of the run is written as
   well, so that it can be prolonged. What may change at a restart: everything but the mesh, the number of bodies and
   their shapes. Bodies stay where they are (BodiesResume); a changed option of flow, bodies, mesh or contact is a
   remark with its old and new value, others are listed. From an earlier checkpoint in the same directory: tables,
   lists and snapshots of later steps go (FieldsRewind), checkpoints stay until newer ones displace them.
   A refined mesh (-mesh_levels) has its tree in the file and may change within its box: base cells, levels, what it is
   refined around. */
#pragma once
#include "report/fields.h"

typedef struct _p_Checkpoint *Checkpoint;

/* Reads the options and takes over SIGTERM, SIGINT and SIGUSR1 until it is destroyed; touches no file. deforms: the
   mesh will follow bodies, and nodes are told by their positions now, before it does. Collective. */
PetscErrorCode CheckpointCreate(Mesh, PetscBool deforms, Fields, Checkpoint *);
PetscErrorCode CheckpointDestroy(Checkpoint *);
PetscErrorCode CheckpointView(Checkpoint, PetscViewer);
/* A module with state, visited by `visit` under its name; loading follows the order of these calls. `module` is
   borrowed. Not collective. */
PetscErrorCode CheckpointAdd(Checkpoint, const char name[], void *module, StateVisit visit);

/* Before any of them is loaded, `restore` sees the module of this name in a file that may have another mesh
   (StateBeginLook) and can give the mesh the cells of the file. Not collective. */
PetscErrorCode CheckpointSetRestore(Checkpoint, const char name[], void *module, StateVisit restore);

/* Load the state of all modules if -sim_restart is given. Call when all modules are built and added, before the first
   step. Collective.
   Errors: those of StateBeginLoad; no checkpoint found. */
PetscErrorCode CheckpointLoad(Checkpoint, PetscBool *restarted);
/* The output directory exists now: print what the run goes on from, remove leftovers. Collective. Error: the
   directory holds checkpoints of another run and neither -sim_restart nor -output_overwrite is given. */
PetscErrorCode CheckpointOpen(Checkpoint);

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
