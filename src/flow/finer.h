/* Finer: one cell of FlowFiner (finer.c), its functions of the next order and its own problem (finercell.c).

   Functions of one component: products along the axes of the three of Q2 and of s (s^2 - 1), with that one at least
   once, and Q2's own in the middle; those of the pressure: 1, y, y y^T of y = (x - centre)/h. */
#pragma once
#include "flow/finer.h"
#include "impl.h"

#define FINER_LINE 4  /* functions along an axis, and points of quadrature */
#define FINER_W    38 /* functions of one component: 8 in the plane */
#define FINER_Q    64 /* points of quadrature, 4 an axis */
#define FINER_L    9  /* functions of the pressure, without the constant */

typedef struct {
  PetscInt  dim, nb, nw, nq, nl;
  PetscInt  digit[FINER_W][3];                 /* along an axis: 0, 1, 2 of Q2, FINER_ODD */
  PetscInt  place[FINER_W], node[MESH_MAX_NB]; /* of functions found and of Q2's among all products, x fastest */
  PetscReal line[2][FINER_LINE][FINER_LINE];   /* value, slope along an axis: function, point */
  PetscReal back[2][FINER_LINE][FINER_LINE];   /* the same, point, function */
  PetscReal psi[FINER_Q][FINER_W], dpsi[FINER_Q][3][FINER_W], weight[FINER_Q];
} FinerTables;

enum {
  FINER_ODD = 3
};

/* What is found in a cell */
typedef struct {
  PetscReal *v, *p; /* [nw][dim], [nl] */
} FinerFound;

typedef struct {
  Flow               f;
  const FinerTables *t;
  PetscReal          x[MESH_MAX_NB * 3], u[MESH_MAX_NB * 3], source[MESH_MAX_NB * 3], p[4], h;
  unsigned char      given[FINER_W]; /* bits: components of functions that are none */
} FinerCell;

/* Integrals over a cell, or over many */
typedef struct {
  PetscReal velocity[3], energy;     /* what is found adds to int u and to the kinetic energy */
  PetscReal correction, dissipation; /* mu int |grad|^2 of what is found, and of the flow without it */
} FinerSums;

void FinerFillTables(PetscInt dim, FinerTables *);
/* r [nw][dim]: forces on a cell less what flow and what was found before answer with. Local. */
void FinerResidual(const FinerCell *, const FinerFound *before, PetscReal r[]);
/* The cell's own Oseen problem with forces r, so that also with what was found before it is free of divergence but for
   its mean: added to `found`, velocity of which goes into v [nw][dim]. Local. */
PetscErrorCode FinerSolve(const FinerCell *, const PetscReal r[], const FinerFound *found, PetscReal v[]);
/* What `found` adds to the momentum residual r [nb][dim] of a cell and takes from its continuity, source [dim + 1]; its
   integrals are added. Local. */
void FinerAnswer(const FinerCell *, const FinerFound *found, PetscReal r[], PetscReal source[], FinerSums *);
/* r [nb][dim]: convection of a velocity u [nb][dim] by itself. Local. */
void FinerConvect(const FinerCell *, const PetscReal u[], PetscReal r[]);
