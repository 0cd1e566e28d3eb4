/* Scene: reads the options of a scene and builds everything it asks for.
   Options: -preset fast|balanced|accurate (defaults for solver, boundary rung and time scheme together),
   -scene_dry_run (build everything, say what is active and what is not, stop before the first step). */
#pragma once
#include <petscsys.h>

/* Run the scene whose options are in the database; name is used for the output directory and in reports. Collective. */
PetscErrorCode SceneRun(const char name[]);
