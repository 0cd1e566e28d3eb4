/* AlignSurfaces: the closed surfaces that a mesh is lined up with, as their owner shows them. Rigid surfaces are one
   owner (couple/bodysurfaces.c); anything with a signed distance can be another: an elastic outline, a drop.

   Surfaces have permanent numbers. A rank knows n of them, in ascending order of the numbers, and calls them k = 0 ..
   n - 1; it must know all whose inside or whose neighbourhood (ALIGN_RINGS + 2 cells) its cells reach. Where each rank
   knows all (sum NULL), number[k] = k. The owner keeps the table true: between two fits it may change n, the arrays and
   what the functions answer; within a fit nothing changes, and all ranks that know a surface answer alike, to the last
   bit. Vectors have 3 components in arrays and dim in lists of points; in the plane the third is 0. Functions are not
   collective unless they say so. */
#pragma once
#include "align/midline.h"

typedef struct {
  void     *ctx;
  PetscInt  n, nall; /* known to this rank; all of them, gone ones too */
  PetscReal largest; /* bounding radius of the largest that there will ever be, on any rank */
  /* of each of the n, borrowed */
  const PetscInt  *number;
  const PetscBool *own;             /* does this rank count it? One rank does (where all know all: every rank) */
  const PetscBool *inactive_inside; /* NULL: all. The cells inside leave the fluid, and their nodes need no position;
                                       else they are cells of the mesh as those outside, as in a drop or a copy */
  const PetscReal (*centre)[3], *radius; /* ball that holds it; images are told by their centre */
  const PetscReal *round;                /* radius of a circle or a sphere, 0: it is none */
  const PetscReal *volume;               /* in the plane: area */
  /* Signed distances d [m] of points x [m][dim], negative inside, of the surface as it is with its centre at `at`: at
     centre[k] or at an image. Changes by no more than the way; exact near the surface. */
  PetscErrorCode (*distance)(void *ctx, PetscInt k, const PetscReal at[3], PetscInt m, const PetscReal x[],
                             PetscReal d[]);
  /* Closest points y [m][dim] of the surface as it is at centre[k], to round-off on it */
  PetscErrorCode (*project)(void *ctx, PetscInt k, PetscInt m, const PetscReal x[], PetscReal y[]);
  /* Of fluid surfaces, whose inside is active and which have no edges: as project, of the points whose outward normal
     has no part against out [m][dim], from the inside to the outside of the mesh there, so that the two sides of a film
     or a neck do not take each other's; where a cell could not be used, vertices then stay off the surface
     (AlignResult.rest), and cells keep their side. NULL: project serves, and such cells are given back or the surface
     is left alone. */
  PetscErrorCode (*approach)(void *ctx, PetscInt k, PetscInt m, const PetscReal x[], const PetscReal out[],
                             PetscReal y[]);
  /* Of those, bits 2 axis + (upper one) of the plane sides of the domain that each may end on, in place of a measure of
     how deep it is behind them; volume[k] is then that within the domain. NULL: none of any */
  const PetscInt *ends_on;
  /* [ncell] own cells that none of the surfaces may cover; NULL: none */
  const PetscBool *closed;
  /* In the plane: the number of corners, and the first `max` of them x [max][2]; NULL: all are smooth. In space edges
     are found from the distance, of all that are not round. */
  PetscErrorCode (*corners)(void *ctx, PetscInt k, PetscInt max, PetscInt *m, PetscReal x[]);
  /* About `max` points x [*m][dim] spread over the surface, the caller's to free, for surfaces as wide as a period
     that may meet their own images; NULL: none does */
  PetscErrorCode (*points)(void *ctx, PetscInt k, PetscInt max, PetscInt *m, PetscReal **x);
  /* In the plane, of one that is nowhere as thick as `limit`: its mid-line, the caller's to destroy, *line NULL: it is
     thicker, or has none. All ranks must know it. The frame of the line: R turns it into space, centre [2] is
     the surface's centre there. NULL: none is that thin */
  PetscErrorCode (*midline)(void *ctx, PetscInt k, PetscReal limit, Midline *line);
  PetscErrorCode (*frame)(void *ctx, PetscInt k, PetscReal R[9], PetscReal centre[2]);
  /* v [n][width] becomes the sum (the largest) over the ranks that know a surface, on all of these. Collective. NULL
     both: all ranks know all */
  PetscErrorCode (*sum)(void *ctx, PetscInt width, PetscReal v[]);
  PetscErrorCode (*max)(void *ctx, PetscInt width, PetscReal v[]);
} AlignSurfaces;

/* Do the cells inside surface k leave the fluid? */
static inline PetscBool AlignLeavesFluid(const AlignSurfaces *s, PetscInt k)
{
  return (PetscBool)(!s->inactive_inside || s->inactive_inside[k]);
}
