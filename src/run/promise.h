/* Promise: how close the presets come to the converged value, and on which meshes they do.

   Known are how many cells a body is thick about its centre, and in the plane how many the boundary layer of a falling
   one (runs/validate/presets.md, runs/studies/tradeoff). */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"

extern const char *const PROMISE_PRESETS[]; /* "fast", "balanced", "accurate", NULL */

PetscReal PromisePercent(PetscInt preset);
/* A preset that was asked for: refusal [len] says why it is known not to keep its promise here, and what is offered in
   its place keeps its own; "" if nothing is known. Collective. */
PetscErrorCode PromiseRefuse(const MeshLocal *, Bodies, PetscInt preset, char refusal[], size_t len);
/* None was asked for: a remark where the default one, balanced, is known not to keep its promise, with
   -couple_boundary as it is. Collective. */
PetscErrorCode PromiseRemark(const MeshLocal *, Bodies);
