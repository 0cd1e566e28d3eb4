/* SolidElement: forces and matrices of a solid's cells, at given positions of its nodes.

   All arrays of unknowns are [nnode][dim] of the mesh, matrices of cells [nb * dim][nb * dim], component fastest.
   Nothing is collective. */
#pragma once
#include "solid/law.h"
#include "solid/reference.h"

#define SOLID_MAX_N      81 /* unknowns of a cell */
#define SOLID_MAX_AROUND 64 /* nodes of the cells around one of a membrane */

/* What a cell is at its positions x [nb][dim]: f [nb][dim] = int P : grad phi, K its derivative (NULL: not wanted).
   Returns the smallest J of its quadrature points. */
PetscReal SolidCellForce(const SolidMesh *, const SolidMaterial *, PetscInt c, const PetscReal x[], PetscReal f[],
                         PetscReal K[]);
/* Bending of a membrane: the energy, B/2 times the integral of the square of its curvature (the sum of both principal
   ones), at x [nnode][dim]; f [nnode][dim] += its derivative (NULL: not wanted). A matrix that is near its second
   derivative and nowhere negative is for each component sum_i v_i v_i^T over the nodes i, v_i at their neighbours in
   laplace of the mesh from then on. */
PetscReal SolidBend(const SolidMesh *, PetscReal bending, const PetscReal x[], PetscReal f[]);
/* The area (in the plane length) A of a membrane at x [nnode][dim]; l [nnode][dim] its derivative. With a modulus k of
   the area as a whole the energy is k/2 (A - A_0)^2/A_0, and its force the tension k (A/A_0 - 1) times l. */
PetscReal SolidFindArea(const SolidMesh *, const PetscReal x[], PetscReal l[]);
/* m [nb][nb] = int phi_i phi_j over the reference cell */
void SolidCellMass(const SolidMesh *, PetscInt c, PetscReal m[]);
/* V [nb * dim][nb * dim] = 2 eta int D(phi_i) : D(phi_j) over the cell as it is at x, with eta = 1 */
void SolidCellViscosity(const SolidMesh *, PetscInt c, const PetscReal x[], PetscReal V[]);
/* F [dim][nd] at quadrature point q of cell c for positions x [nb][dim] of its nodes; returns J, of membranes that of
   the area */
PetscReal SolidGradient(const SolidMesh *, PetscInt c, PetscInt q, const PetscReal x[], PetscReal F[]);
/* Positions x [nnode][dim] of the whole solid: those of cell c into xc [nb][dim] */
static inline void SolidGather(const SolidMesh *m, PetscInt c, const PetscReal x[], PetscReal xc[])
{
  for (PetscInt j = 0; j < m->nb; j++)
    for (PetscInt a = 0; a < m->dim; a++) xc[m->dim * j + a] = x[m->dim * m->cell_node[c * m->nb + j] + a];
}
/* Position x [3] of quadrature point q of a cell with nodes xc [nb][dim], or what else is given there */
static inline void SolidLocate(const SolidMesh *m, PetscInt q, const PetscReal xc[], PetscReal x[3])
{
  for (PetscInt a = 0; a < 3; a++) x[a] = 0;
  for (PetscInt j = 0; j < m->nb; j++)
    for (PetscInt a = 0; a < m->dim; a++) x[a] += m->phi[q * m->nb + j] * xc[m->dim * j + a];
}

/* Sums over a solid at x [nnode][dim], over what a membrane encloses */
typedef struct {
  PetscReal volume, centroid[3];
  PetscReal area;          /* of a membrane */
  PetscReal strain_energy; /* of the whole law, bending and the area as a whole */
  PetscReal stretch_max;
  PetscReal rotation;  /* in the plane: angle of the polar decomposition of the mean F */
  PetscReal second[6]; /* second moments about the centroid, xx yy zz xy xz yz */
} SolidSums;
void SolidMeasure(const SolidMesh *, const SolidMaterial *, const PetscReal x[], SolidSums *);
/* Volume and centroid alone */
PetscReal SolidFindVolume(const SolidMesh *, const PetscReal x[], PetscReal centroid[3]);
/* Mean of velocities u [nnode][dim] over a solid, by the weights of its reference mesh; over what a membrane at x
   encloses, of a flow that is free of divergence */
void SolidMeanVelocity(const SolidMesh *, const PetscReal x[], const PetscReal u[], PetscReal mean[3]);
/* Nodes x [nnode][dim] of a membrane are moved along its normal, all but those that are held as far, until it encloses
   its reference volume; those of a solid, none of which is held, away from its centroid, until it has that. *error:
   what was put right, over that volume. area, of a membrane: it is also stretched along its axes until it has that
   (0: it is not; nor where it is nearly round, and no other shape of its volume has less). */
PetscErrorCode SolidKeepVolume(const SolidMesh *, const PetscBool held[], PetscReal area, PetscReal x[],
                               PetscReal *error);
