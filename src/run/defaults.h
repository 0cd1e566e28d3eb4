/* Defaults: the one place where options get values that depend on the scene or on other options. */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"
#include "phase/drops.h"
#include "solid/solid.h"

/* Apply the table of defaults.c, for a scene with a flow, when its mesh, its bodies, elastic particles and drops (NULL:
   none) are known and before anything else is created. Reads -preset, balanced unless given. What scene or command line
   give wins, but a preset of the command line replaces what the scene gives for its options, and lists it in one line.
   refusal [len]: why a preset that is asked for is known not to keep its promise in this scene, else ""; an error once
   no option is left that nobody reads, since a misspelt one may be the reason. Collective. Errors: recipe fast, a sweep
   or two of a time step, in a steady scene. */
PetscErrorCode DefaultsApply(Mesh, Bodies, Solids, Drops, PetscBool steady, char refusal[], size_t len);
/* Before a mesh is made whose cells follow bodies that move: -mesh_refine_distance, in space under a penalty as narrow
   as these need it, but for drops (runs/studies/refinement, "How wide a band"); elsewhere, where less was measured or
   far fields of the plane ask for more, the mesh's own. Collective. */
PetscErrorCode DefaultsSetBand(PetscInt dim, PetscBool drops);
