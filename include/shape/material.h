/* What the particles of a group are made of: a particle is a shape with a material. Called by the rooms that own
   particles (bodies, solid, phase), each of which takes the groups that are its own; options that they read alike. */
#pragma once
#include "shape.h"
#include "shape/place.h"

typedef enum {
  MATERIAL_RIGID,
  MATERIAL_NEO_HOOKEAN,
  MATERIAL_ST_VENANT_KIRCHHOFF,
  MATERIAL_MEMBRANE,
  MATERIAL_FLUID
} Material;

/* Read -particle_<group>_material; rigid where it is not given. Errors: not a known word. Not collective. */
PetscErrorCode MaterialRead(const char group[], Material *material);

typedef struct {
  char     name[64];
  Material material;
} ParticleGroup;

/* Those of -particle_groups whose material is one from first to last: group [*n], the caller's to free. Not
   collective. */
PetscErrorCode ParticleListGroups(Material first, Material last, PetscInt *n, ParticleGroup *group[]);
/* Shape of the particles of a group, -particle_<group>_shape. Collective as ShapeCreate. Error: it has none. */
PetscErrorCode ParticleCreateShape(const char group[], PetscInt dim, Shape *shape);
/* Position x [dim] of the one particle of a group, and its angle (0 where it is not given); what: "drops", for the
   message where -particle_<group>_place asks for more. Errors: that, no position. Not collective. */
PetscErrorCode ParticleReadPosition(const char group[], const char what[], PetscInt dim, PetscReal x[],
                                    PetscReal *angle);

/* How the particles of a group are turned in space: -particle_<group>_quaternion q, then by their angle about
   -particle_<group>_axis, which is made one of length 1. Both hold what counts without the options. has_axis, has_q may
   be NULL. Errors: zeros. */
PetscErrorCode ParticleReadTurn(const char group[], PetscReal axis[3], PetscBool *has_axis, PetscReal q[4],
                                PetscBool *has_q);

/* Where all particles of a group start, whose shape has this bounding radius, as -particle_<group>_place says: single,
   lattice, random or table; lower, upper [3] of the domain. They are added to `placed`. *p [*n] is the caller's to
   free; *moves: its velocities are given, by -particle_<group>_velocity, _angular_velocity, _initial_velocity given or
   the table. Collective. Errors: they do not fit, place pack, a table with sizes or densities, velocities that are
   expressions. */
PetscErrorCode ParticleReadPlacements(const char group[], const char what[], PetscInt dim, PetscReal radius,
                                      const PetscReal lower[3], const PetscReal upper[3], ParticlesPlaced *placed,
                                      PetscInt *n, Placement **p, PetscBool *moves);
