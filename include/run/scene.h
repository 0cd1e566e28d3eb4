/* Scene: reads the options of a scene and builds everything it asks for.
   Options: -preset fast|balanced|accurate (defaults for solver, boundary method and time scheme together),
   -scene_dry_run (build everything, say what is active and what is not, stop before the first step). */
#pragma once
#include <petscsys.h>

/* Run the scene whose options are in the database; name is used for the output directory and in reports. Collective on
   the communicator.

   A process may run several scenes one after another, and processes of communicators without a common rank run theirs
   side by side. Afterwards nothing of a run is left in the process: its remarks, the defaults that it put into the
   database, which options it has read, a signal that it heard; on the disk each has its -output_dir. What is the
   process's and not the run's: PETSc's database, which the caller clears between scenes of different options
   (PetscOptionsClear), events and stages of the log (they sum up), and a signal, which ends the run that is on. */
PetscErrorCode SceneRun(MPI_Comm, const char name[]);
