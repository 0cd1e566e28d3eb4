/* PhaseContour: the curve on which a function of the place is zero, within a box of the plane. Quadratic edges, about
   four to a length, their nodes on the curve to round-off; where the inside reaches a side of the box, edges along it
   close the curve. */
#pragma once
#include "phase/curve.h"

typedef struct {
  PetscReal h, lower[2], upper[2];
  PetscReal period[2]; /* 0: none */
  PetscInt  wets;      /* sides that drops may wet: bits 2 axis + (upper one) */
} PhaseBox;

/* value [n] at x [n][2], negative inside; called alike on all ranks */
typedef PetscErrorCode (*PhaseField)(void *ctx, PetscInt n, const PetscReal x[], PetscReal value[]);

/* Appends the edges of the zero line, on all ranks alike, to *edge [*n], the caller's to free, whose room is *capacity;
   they bound `drop`. Their keys are those of no other drop's edges. */
PetscErrorCode PhaseContourTrace(const PhaseBox *, PhaseField, void *ctx, PetscInt drop, PetscInt *n,
                                 PetscInt *capacity, PhaseEdge **edge);
