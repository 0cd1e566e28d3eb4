/* DropCells: have drops in the plane the cells that a preset's promise needs?

   Promised are their shapes, speeds and places, and the frequency and decay of oscillations and waves, but not when
   drops merge or break up, which the mesh decides. Steps are limited by -couple_drops_steps, which presets set. */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"
#include "phase/drops.h"

/* Is anything promised of drops here? In the plane, on a mesh that is lined up with them. By options that stay unread.
   Local. */
PetscErrorCode DropCellsArePromised(const MeshLocal *, PetscBool *promised);
/* A preset that was asked for: refusal [len], unless that says something. Collective. */
PetscErrorCode DropCellsCheck(const MeshLocal *, Drops, Bodies, PetscInt preset, char refusal[], size_t len);
