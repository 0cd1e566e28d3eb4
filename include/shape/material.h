/* What the particles of a group are made of: a particle is a shape with a material. Called by the rooms that own
   particles (bodies, solid, phase), each of which takes the groups that are its own. */
#pragma once
#include <petscsys.h>

typedef enum {
  MATERIAL_RIGID,
  MATERIAL_NEO_HOOKEAN,
  MATERIAL_ST_VENANT_KIRCHHOFF,
  MATERIAL_FLUID
} Material;

/* Read -particle_<group>_material; rigid where it is not given. Errors: not a known word. Not collective. */
PetscErrorCode MaterialRead(const char group[], Material *material);
