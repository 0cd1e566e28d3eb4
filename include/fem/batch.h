/* Batch: the velocity operator on LANES cells at once, without a matrix. Sum factorisation over the axes of the cell
   (Orszag 1980) with derivatives taken among the quadrature points (collocation; Kronbichler & Kormann 2012), cells in
   the lanes of vectors: 12 small products an axis and component, and no entry is loaded that is not used at once.

   Arrays are [..][LANES]: the same number of several cells side by side. Node j and quadrature point q of a cell are at
   lattice position (j % 3, (j/3) % 3, j/9), as in fem/element.h, whose 3-point Gauss rule and matrices these are up to
   round-off. Nothing here is collective, and nothing calls PETSc. */
#pragma once
#include "fem/element.h"

#define BATCH_LANES 8
typedef PetscReal Lanes __attribute__((vector_size(BATCH_LANES * sizeof(PetscReal))));

typedef struct {
  PetscInt  dim, n;                 /* nodes of a cell, quadrature points */
  PetscReal weight[ELEMENT_MAX_NB]; /* of the points */
  PetscReal norm[ELEMENT_MAX_NB];   /* of products of Legendre polynomials, as integrals over boxes have them */
  PetscReal pair[3][3][3];          /* on a line value^2, value times derivative, derivative^2: [which][node][point] */
} BatchTables;

/* The operator a (u, v) + ((b + nu) grad u, grad v) + (w . grad u + skew div w u, v) */
typedef struct {
  PetscBool box, convection; /* edges along the axes; w is there */
  PetscBool vary;            /* nu is there, a number for every point */
  PetscReal a, b, skew;
} BatchForm;

/* Of boxes det J and the diagonal `inverse` of J^{-1}, of others the node coordinates xc [n][dim] */
typedef struct {
  Lanes det, inverse[3], xc[ELEMENT_MAX_NB * 3];
} BatchGeometry;

/* Over a cell: int u.u, int div u, int (w . grad v + skew div w v) */
typedef struct {
  Lanes square, divergence, flux[3];
} BatchIntegrals;

void BatchSetTables(PetscInt dim, BatchTables *);
/* Lanes that the coefficients of a form take */
PetscInt BatchCoefficients(const BatchTables *, const BatchForm *);
/* Coefficients of the form; w [n][dim] or NULL, nu [n] or NULL. Cells with det 0 give zero. */
void BatchSet(const BatchTables *, const BatchForm *, const BatchGeometry *, const Lanes w[], const Lanes nu[],
              Lanes coefficient[]);
/* Its mass, after BatchSet, times a factor of each cell */
void BatchScaleMass(const BatchTables *, const BatchForm *, const Lanes *factor, Lanes coefficient[]);
/* x [n][dim] <- the operator times x */
void BatchMultiply(const BatchTables *, const BatchForm *, const Lanes coefficient[], Lanes x[]);
/* Its diagonal d [n], the same for all components */
void BatchDiagonal(const BatchTables *, const BatchForm *, const Lanes coefficient[], Lanes d[]);
/* Integrals of nodal fields u, v (NULL: u) and w (NULL: none), all [n][dim] */
void BatchIntegrate(const BatchTables *, PetscBool box, const BatchGeometry *, PetscReal skew, const Lanes u[],
                    const Lanes v[], const Lanes w[], BatchIntegrals *);
