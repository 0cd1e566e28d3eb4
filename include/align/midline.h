/* Midline: the line halfway between the two sides of a slender plane shape, from tip to tip.

   Found from the signed distance alone, so that every figure has one: from a point near the centroid a march goes
   both ways along the surface; in each step the two sides are looked for across the direction of march, and the point
   halfway between them is the next one. It ends where the direction of march leaves the surface: that point is the tip.
   A figure has a mid-line if it is at least three times as long as thick and if the widths along the line add up to
   its area within 5 %, which figures with branches or holes do not fulfil. Lengths in the unit of the scene, points
   in the frame of the figure. Nothing here is collective. */
#pragma once
#include <petscsys.h>

typedef struct _p_Midline *Midline;

/* A figure of the plane as the search sees it: signed distance; bounding radius about the centre; area; a point of the
   surface near the centre and the outward normal there, across from which the line is begun */
typedef struct {
  void *ctx;
  PetscErrorCode (*distance)(void *ctx, const PetscReal x[2], PetscReal *d);
  PetscReal radius, area, wall[2], normal[2];
} MidlineFigure;

/* *line is NULL for a figure that has none. */
PetscErrorCode MidlineCreate(const MidlineFigure *, Midline *line);
/* A copy, `scale` times as large. */
PetscErrorCode MidlineScale(Midline, PetscReal scale, Midline *line);
PetscErrorCode MidlineDestroy(Midline *);
/* Length from tip to tip and largest thickness. */
PetscErrorCode MidlineGetSize(Midline, PetscReal *length, PetscReal *thickness);
/* Points y [n][2] at the lengths s [n] from the first tip, 0 <= s <= length: cubic interpolation of points a
   hundredth of the shape apart. The tips are met exactly. */
PetscErrorCode MidlinePoint(Midline, PetscInt n, const PetscReal s[], PetscReal y[]);
/* Closest point of the line to each x [n][2]: its s [n] and the distance d [n], positive to the left of the line
   (seen along it), negative to the right. Beyond a tip s is 0 or length. */
PetscErrorCode MidlineProject(Midline, PetscInt n, const PetscReal x[], PetscReal s[], PetscReal d[]);
