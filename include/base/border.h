/* Border: the boundary of a domain by its geometry, in pieces: circles, cylinders and spheres in closed form, and the
   curved faces of a mesh (second order), found by a search grid. Sides of a box are no pieces: who knows the box
   knows them. Knows neither mesh nor bodies. Lengths in the unit of the scene; vectors have 3 components, 2D ones a
   zero.

   A piece is smooth: faces join where their normals differ by less than 35 degrees, as long as the normal stays
   within 40 degrees of that of the piece's first face. So two positions of a piece where something touches it press in
   about the same direction, and what touches a corner, or both sides of a bend, touches two pieces. Pieces and faces
   have the same numbers on any number of ranks.

   A touch of something round is a position that is nearer to its centre than all positions of the boundary around it:
   one along a smooth wall, two in a corner, one at an edge. */
#pragma once
#include <petscsys.h>

#define BORDER_NODES   9  /* of a face in space; 3 in the plane */
#define BORDER_TOUCHES 16 /* of a piece, at most */

typedef struct _p_Border *Border;

/* A face of second order, its positions by lattice position (i, i + 3 j); nodes have the numbers of the mesh, by which
   faces know their neighbours */
typedef struct {
  PetscInt  boundary;
  PetscInt  node[BORDER_NODES];
  PetscReal x[BORDER_NODES][3];
  PetscReal inside[3]; /* some position in the domain near it, to tell its sides */
} BorderFace;

/* A circle, a sphere (axis -1), or a cylinder along an axis; inside: the domain is */
typedef struct {
  PetscReal centre[3], radius;
  PetscInt  axis;
  PetscBool inside;
} BorderRound;

/* Where the boundary is near a point. gap: distance, negative if the point is outside of the domain; normal: into the
   domain, at edges from the position to the point; K: its gradient [3][3] along the boundary, the curvatures (of a
   ball of radius R in the domain 1/R, of a container -1/R, 0 where it is flat or an edge) */
typedef struct {
  PetscReal gap, x[3], normal[3], K[9];
} BorderPoint;

PetscErrorCode BorderCreate(PetscInt dim, Border *);
PetscErrorCode BorderDestroy(Border *);
/* The next boundary, numbered from 0. solid: something may touch it. */
PetscErrorCode BorderAdd(Border, const char name[], PetscBool solid);
PetscErrorCode BorderAddRound(Border, PetscInt boundary, const BorderRound *);
/* All faces of all boundaries that have any, the same on all ranks; then no more. Not collective. */
PetscErrorCode BorderSetFaces(Border, PetscInt n, const BorderFace[]);

PetscErrorCode BorderGetBoundaries(Border, PetscInt *n);
PetscErrorCode BorderGetName(Border, PetscInt boundary, const char **name);
PetscErrorCode BorderIsSolid(Border, PetscInt boundary, PetscBool *);
PetscErrorCode BorderFind(Border, const char name[], PetscInt *boundary); /* -1: none */
/* Is it made of the faces of a mesh, all around? */
PetscErrorCode BorderHasFaces(Border, PetscBool *);
/* Pieces of solid boundaries, numbered from 0, and the boundary of one */
PetscErrorCode BorderGetPieces(Border, PetscInt *n);
PetscErrorCode BorderGetBoundary(Border, PetscInt piece, PetscInt *boundary);

/* Pieces nearer to x than reach, ascending: list [*n], borrowed until the next call */
PetscErrorCode BorderFindNear(Border, const PetscReal x[3], PetscReal reach, PetscInt *n, const PetscInt *list[]);
/* Where a ball about x touches a piece, nearer than reach: place [BORDER_TOUCHES], in the order of the faces */
PetscErrorCode BorderTouch(Border, PetscInt piece, const PetscReal x[3], PetscReal reach, PetscInt *n,
                           BorderPoint point[]);
/* Of n points x [n][3] within `radius` of c, those which the piece is nearest to of all pieces that meet there,
   nearer than reach: place [n], with gap PETSC_MAX_REAL for all others */
PetscErrorCode BorderTouchPoints(Border, PetscInt piece, const PetscReal c[3], PetscReal radius, PetscReal reach,
                                 PetscInt n, const PetscReal x[][3], BorderPoint point[]);
/* The position of a piece that is nearest to x, if it is nearer than reach (else gap PETSC_MAX_REAL) */
PetscErrorCode BorderNearest(Border, PetscInt piece, const PetscReal x[3], PetscReal reach, BorderPoint *);
/* Of all boundaries, solid or not, the nearest one within reach of x (PETSC_MAX_REAL: anywhere), -1: none, and the gap
   there: negative outside of the domain */
PetscErrorCode BorderLocate(Border, const PetscReal x[3], PetscReal reach, PetscInt *boundary, PetscReal *gap);
