/* Place: where the particles of a group start: in rows, at random, or from a table. For the rooms that own them. */
#pragma once
#include <petscsys.h>

/* First state of one body. 2D: third components zero. */
typedef struct {
  PetscReal x[3], u[3]; /* centre of mass, its velocity */
  PetscReal angle;      /* rad, about z, the axis of the group, or its own */
  PetscReal axis[3];    /* its own, of any length, if has_axis */
  PetscReal omega[3];   /* angular velocity, rad/s */
  PetscReal q[4];       /* orientation in 3D, if `turned`, the angle included */
  PetscReal scale;      /* size in that of the shape */
  PetscReal radius;     /* bounding radius, which gives the size; 0: the size is given */
  PetscReal density;
  PetscBool has_axis, has_quaternion; /* q holds what the angle turns, of any length */
  PetscBool turned;
} Placement;

/* -particle_<group>_place */
enum {
  PLACE_SINGLE,
  PLACE_LATTICE,
  PLACE_RANDOM,
  PLACE_TABLE,
  PLACE_PACK
};
static const char *const PLACE_NAMES[] = {"single", "lattice", "random", "table", "pack", NULL};

/* q of a body in space: its own or this one, turned by its angle about its own axis or this one, of length 1.
   Afterwards it is `turned`. */
void PlaceTurn(const PetscReal axis[3], const PetscReal q[4], Placement *);

/* Uniform in [0, 1): the next number of a sequence, the same on every machine; the start of a sequence of its own for
   each `stream` of a seed. */
PetscReal  PlaceUniform(PetscInt64 *state);
PetscInt64 PlaceStream(PetscInt seed, PetscInt stream);

/* Particles placed so far, [n], for groups that are to keep clear of them */
typedef struct {
  PetscInt n, capacity;
  PetscReal (*x)[3], *radius;
} ParticlesPlaced;

/* count more, of this bounding radius times p[i].scale. Not collective. */
PetscErrorCode ParticlesPlacedAdd(ParticlesPlaced *, PetscReal radius, PetscInt count, const Placement p[]);
PetscErrorCode ParticlesPlacedDestroy(ParticlesPlaced *);

/* Where bodies of a group go: inside lower .. upper, of bounding radius `radius` (random: times p[i].scale), `margin`
   apart from each other */
typedef struct {
  const char      *name; /* of the group, for messages */
  PetscInt         dim;
  const PetscReal *lower, *upper; /* [3] */
  PetscReal        radius, margin;
} PlaceBox;

/* Both place `count` bodies. Not collective, same result on every rank. Error: they do not fit. Lattice: rows along x,
   one cell of the box for each body, as even as possible in all directions, n [3] of them; a last row that is not full
   is spread over the width. OnLattice: x of body i. Random: dart throwing that also keeps clear of those placed before;
   the sequence depends on seed alone, not on the machine. The error names the share of the box that was filled; dart
   throwing cannot go beyond 0.54 (2D), 0.38 (3D). */
PetscErrorCode PlaceLattice(const PlaceBox *, PetscInt count, PetscInt n[3]);
void           PlaceOnLattice(const PlaceBox *, const PetscInt n[3], PetscInt count, PetscInt i, PetscReal x[3]);
PetscErrorCode PlaceRandom(const PlaceBox *, PetscInt seed, const ParticlesPlaced *, PetscInt count, Placement p[]);

/* Read a CSV table: a header line that names the columns x, y (and z in 3D), and if wanted angle [rad], u, v (w in
   3D), omega [rad/s, about z], size or radius, density, and in 3D axis_x .. axis_z (that of the angle) and q_w .. q_z
   (orientation before the angle turns it), in any order; then one line a body. Empty lines and lines that start with #
   are skipped. `base` holds what missing columns get; *sizes, *densities, *angles (any of the orientation): the table
   has such columns. Collective on the run (rank 0 reads the file). *p is allocated, free with PetscFree.
   Errors: as file:line. */
PetscErrorCode PlaceTable(const char file[], PetscInt dim, const Placement *base, PetscInt *n, Placement **p,
                          PetscBool *sizes, PetscBool *densities, PetscBool *angles);
