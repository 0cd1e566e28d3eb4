/* Promise: how close the presets come to the converged value, and on which meshes they do.

   Known are how many cells a body is thick about its centre, and in the plane how many the boundary layer of a falling
   one (runs/validate/presets.md, runs/studies/tradeoff). */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"

extern const char *const PROMISE_PRESETS[]; /* "fast", "balanced", "accurate", NULL */

/* A preset that was asked for. Error: known not to keep its promise here; what is offered in its place keeps its own.
   Collective. */
PetscErrorCode PromiseRefuse(const MeshLocal *, Bodies, PetscInt preset);
/* None was asked for: a remark where the default one, balanced, is known not to keep its promise, with
   -couple_boundary as it is. Collective. */
PetscErrorCode PromiseRemark(const MeshLocal *, Bodies);
