/* What is asked of an interface, in the plane (curve.h) and in space (sheet.h). */
#pragma once
#include <petscsys.h>

/* Sums over what a drop holds. In space volumes are in `area` and areas in `length`. */
typedef struct {
  PetscReal area, length, centre[3]; /* length: of all curves, without */
  PetscReal wet;                     /* that along walls, likewise */
  PetscReal second[6];               /* about the centre, over the area: xx, yy, xy; in space xx yy zz xy xz yz */
} PhaseSums;

/* A closest point: distance, negative inside, the place, its edge or face (-1: none) */
typedef struct {
  PetscReal d, y[3];
  PetscInt  edge;
} PhasePoint;

/* Something solid, on which interfaces end: signed distances d [n] of x [n][dim], negative inside, and the contact
   angles inside drops of what is nearest (NULL: not wanted). level, asked in space: gradient of the sum of both
   curvatures of a drop's interface where the fluids are at rest, positive where it bends outwards (NULL: none). */
typedef struct {
  void     *ctx;
  PetscReal h;       /* a length, about a cell */
  PetscBool mirrors; /* walls are, that interfaces end on (in space) */
  PetscErrorCode (*distance)(void *ctx, PetscInt n, const PetscReal x[], PetscReal d[], PetscReal angle[]);
  void (*level)(void *ctx, PetscInt drop, PetscReal gradient[3]);
} PhaseSolid;
