/* Meshmap: where the points of a mesh lie.

   A mesh is refined in reference coordinates q, in which all its edges are straight; the map x(q) then puts every
   vertex and every Q2 node in its place. The map is smooth inside each block of the mesh and known in closed form, so
   points on a circle lie on it to round-off on every level of refinement and on every rank, and no cell degenerates.
   Lengths in the unit of the scene. Maps own their arrays; nothing here is collective. */
#pragma once
#include <petscsys.h>

/* Fitted, disc and annulus in space: the same in every plane, the lines of axis z by their index. */
typedef enum {
  MESHMAP_IDENTITY,
  MESHMAP_LINES,   /* box; its mesh lines moved along each axis */
  MESHMAP_FITTED,  /* mesh lines in index space, with a square block of O-grid around a circle */
  MESHMAP_DISC,    /* square of half-width inner in the middle, rings around it up to half-width outer */
  MESHMAP_ANNULUS, /* square rings of half-width inner to outer become circles */
  MESHMAP_BALL,    /* cube of half-width inner in the middle, cubes around it up to half-width outer */
  MESHMAP_SHELL,   /* cubes of half-width inner to outer become spheres */
  MESHMAP_ROUND    /* mesh of a file: cells with an edge on a circle are bent, the rest stays */
} MeshMapType;

/* A quadrilateral of straight edges whose first edge becomes an arc */
typedef struct {
  PetscReal corner[4][2];                /* counter-clockwise; the first two on the circle */
  PetscReal centre[2], radius, angle[2]; /* angles of the first two corners, less than a turn apart */
  PetscReal lower[2], upper[2];          /* bounding box of the corners */
} MeshMapBent;

typedef struct {
  MeshMapType  type;
  PetscInt     dim;
  PetscReal    lower[3], upper[3]; /* range of q and x for MESHMAP_LINES */
  PetscInt     ncell[3];           /* cells between the lines of an axis */
  PetscReal   *line[3];            /* [ncell + 1] position of the mesh lines, increasing */
  PetscReal    middle[2];          /* q of the centre of the rings */
  PetscReal    inner, outer;       /* half-widths of the innermost and outermost square of the rings, in q */
  PetscReal    centre[3];          /* of the circle or circles, the sphere or spheres */
  PetscReal    radius[2];          /* fitted, disc, ball: radius[0]; annulus, shell: inner, outer */
  PetscReal    ring_ratio;         /* thickness of the outermost layer over that of the innermost; 0: the same */
  PetscInt     nbent;
  MeshMapBent *bent;
} MeshMap;

/* x [dim] of the point with reference coordinates q [dim]; x and q may be the same array. */
void MeshMapEvaluate(const MeshMap *, const PetscReal q[], PetscReal x[]);

/* Sizes along an axis at distance d from the uniform part: h (1 + growth d/h) up to h coarsest.
   Count: number of such cells in the distance d, as a real number. Distance: its inverse. growth >= 0, coarsest >=
   1. */
PetscReal MeshMapCountCells(PetscReal d, PetscReal h, PetscReal growth, PetscReal coarsest);
PetscReal MeshMapDistance(PetscReal count, PetscReal h, PetscReal growth, PetscReal coarsest);

/* Lines of an axis: n[0] cells from end[0] to end[1], n[1] equal cells of about size h up to end[2], n[2] cells up to
   end[3]; the outer ones grow away from the equal ones. A part of length zero has no cells. */
PetscErrorCode MeshMapSetLines(MeshMap *, PetscInt axis, const PetscReal end[4], const PetscInt n[3], PetscReal h,
                               PetscReal growth, PetscReal coarsest);

/* Lines of an axis: n layers, thinner towards both ends, by a factor each; the one in the middle is `ratio` times as
   thick as those at the ends. n >= 1, ratio > 0. */
PetscErrorCode MeshMapSetLayers(MeshMap *, PetscInt axis, PetscReal lower, PetscReal upper, PetscInt n,
                                PetscReal ratio);
/* Lines of an axis: n cells between lower and upper, finest at both ends: the line i lies at the share
   tanh(s eta)/tanh(s) of the half width, eta = 2 i/n - 1 (Vinokur, J. Comput. Phys. 50, 1983); s = 0: equal cells. */
PetscErrorCode MeshMapSetStretched(MeshMap *, PetscInt axis, PetscReal lower, PetscReal upper, PetscInt n, PetscReal s);

/* Bend the first edge of the cell with these corners to the circle through its ends; sets all but the corners. */
void MeshMapBend(MeshMapBent *, const PetscReal centre[2], PetscReal radius);

/* Free the arrays. */
PetscErrorCode MeshMapClear(MeshMap *);
