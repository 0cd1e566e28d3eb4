/* Swing: bodies that are led to and fro, whose force is mostly that of the fluid which they push along. */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"

typedef struct {
  PetscInt  group; /* of the bodies that swing, the thinnest; -1: none */
  PetscReal cells; /* they are thick, PETSC_MAX_REAL: none */
  PetscInt  layer_group;
  PetscReal layer; /* cells in the layer sqrt(2 nu U/A) that swings with these (Stokes 1851), the thinnest */
} Swing;

#define SWING_NONE ((Swing){-1, PETSC_MAX_REAL, -1, PETSC_MAX_REAL})

/* Bodies whose translation is prescribed and swings: sqrt(8) pi U^2/(A D) below 10, with U and A the root mean squares
   of speed and acceleration over the run and D the diameter (of an oscillation the number of Keulegan and Carpenter
   1958). By options that stay unread. Collective. */
PetscErrorCode SwingFind(const MeshLocal *, Bodies, Swing *);
