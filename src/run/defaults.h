/* Defaults: the one place where options get values that depend on the scene or on other options. */
#pragma once
#include "mesh/mesh.h"

/* Apply the table of defaults.c, for a scene with a flow, when its mesh is known and before anything else is created.
   What scene or command line give wins. Reads -preset. Collective. Error: recipe fast, one projection sweep of a time
   step, in a steady scene. */
PetscErrorCode DefaultsApply(const MeshLocal *, PetscBool steady);
