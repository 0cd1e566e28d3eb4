/* Element: tables and kernels of the Q2 element on quadrilaterals and hexahedra, one cell at a time.

   Node j of a cell sits at lattice position (j % 3, (j/3) % 3, j/9) of [-1,1]^dim; quadrature is 3-point Gauss an axis
   (mesh.h, flow.h). The kernels are written for a general dimension and inlined with constants, so that the compiler
   vectorises them over nodes or over quadrature points (rows padded to a multiple of four). Cells that are
   parallelograms keep one Jacobian, and take mass and stiffness from reference matrices; the others are integrated.
   Nothing here is collective. */
#pragma once
#include <petscsys.h>

#define ELEMENT_MAX_NB  27 /* nodes */
#define ELEMENT_MAX_NBP 28 /* nodes padded to a multiple of 4 */
#define ELEMENT_MAX_NQ  28 /* quadrature points, padded alike */

/* Edges of a cell in the plane: vertex, middle, vertex */
static const PetscInt ELEMENT_EDGE[4][3] = {{0, 1, 2}, {0, 3, 6}, {2, 5, 8}, {6, 7, 8}};

/* Tables; the second form of a table is for vectors over quadrature points */
typedef struct {
  PetscInt   dim, nb, nbp, nq, nqp; /* nodes, quadrature points, both also padded (padding holds zeros) */
  PetscReal *phi, *dphi;            /* [nq][nbp], [nq][dim][nbp] */
  PetscReal *phi_t, *dphi_t;        /* [nb][nqp], [nb][dim][nqp] */
  PetscReal *weight;                /* [nqp] of the quadrature */
  PetscReal *mass, *stiffness; /* reference matrices [nb][nbp], [dim][dim][nb][nbp]: int phi_i phi_j, int d_e phi_i d_f
                                  phi_j (e and f symmetrised) */
} ElementTables;

/* Geometry of a cell at its quadrature points: inverse Jacobian [e][a] = dxi_e/dx_a and weight x det J. A parallelogram
   has inverse[0] only. */
typedef struct {
  PetscBool affine;
  PetscReal det; /* of a parallelogram */
  PetscReal inverse[ELEMENT_MAX_NQ][9], weight[ELEMENT_MAX_NQ];
} ElementMetric;

PetscErrorCode ElementCreate(PetscInt dim, ElementTables *);
PetscErrorCode ElementDestroy(ElementTables *);

/* Metric from the node coordinates xc [nb][dim] (affine = false), or from the stored Jacobian of a parallelogram:
   inverse [dim][dim], det. */
void ElementSetMetric(const ElementTables *, const PetscReal xc[], ElementMetric *);
void ElementSetAffine(const ElementTables *, const PetscReal inverse[], PetscReal det, ElementMetric *);
static inline const PetscReal *ElementInverse(const ElementMetric *m, PetscInt q)
{
  return m->inverse[m->affine ? 0 : q];
}

/* Quadratic basis of the nodes -1, 0, 1 on [-1, 1] and its derivative at s: a factor of the basis of a cell. */
static inline void ElementLine(PetscReal s, PetscReal v[3], PetscReal dv[3])
{
  v[0]  = 0.5 * s * (s - 1);
  v[1]  = 1 - s * s;
  v[2]  = 0.5 * s * (s + 1);
  dv[0] = s - 0.5;
  dv[1] = -2 * s;
  dv[2] = s + 0.5;
}

/* Basis phi [nb] and its derivatives dphi [dim][nb] at xi [dim]. */
void ElementBasis(PetscInt dim, const PetscReal xi[], PetscReal phi[], PetscReal dphi[]);
/* Position x [dim] of xi [dim] in the cell with nodes xc [nb][dim], and the Jacobian J [a][e] = dx_a/dxi_e
   [dim][dim]. */
void ElementMap(PetscInt dim, const PetscReal xc[], const PetscReal xi[], PetscReal x[], PetscReal J[]);

/* Basis phi [nb] at quadrature point q of the cell with nodes xc [nb][dim]; returns the point's weight with the volume,
   of a cell by itself (of many: ElementSetMetric). */
PetscReal ElementGaussPoint(PetscInt dim, const PetscReal xc[], PetscInt q, PetscReal phi[]);

/* Reference coordinates xi [dim] of the point x [dim] in the cell with nodes xc [nb][dim] by Newton's method; false if
   it does not converge (the map need not have an inverse far outside of the cell). The point may
   lie outside: |xi| > 1. */
PetscBool ElementLocate(PetscInt dim, const PetscReal xc[], const PetscReal x[], PetscReal xi[]);

/* Gradients of the basis at quadrature point q in space: g [dim][ELEMENT_MAX_NBP] */
void ElementGradients(const ElementTables *, const ElementMetric *, PetscInt q, PetscReal g[3][ELEMENT_MAX_NBP]);

/* ce [nb][nbp] = a int phi_i phi_j + b int grad phi_i . grad phi_j + int phi_i (w . grad phi_j + skew div w phi_j) with
   nodal w [nb][dim], or NULL */
void ElementOperator(const ElementTables *, const ElementMetric *, PetscReal a, PetscReal b, const PetscReal w[],
                     PetscReal skew, PetscReal ce[]);

/* r [nb][dim] = rho (s, v) + rho (w . grad u + skew div w u, v) + mu (grad u, grad v) - (force, v) with nodal
   acceleration s, velocity u (NULL: zero), convection w (NULL: none), all [nb][dim]; force [dim]. */
void ElementResidual(const ElementTables *, const ElementMetric *, PetscReal rho, PetscReal mu, const PetscReal force[],
                     const PetscReal s[], const PetscReal u[], const PetscReal w[], PetscReal skew, PetscReal r[]);
/* y = B u and r += scale B^T p with the cells' matrices b [ncell][dim + 1][nb * dim] and nodes [ncell][nb]; u, r
   [nodes][dim], y, p [ncell][dim + 1]. Local. */
void ElementDivergence(PetscInt dim, PetscInt ncell, const PetscInt cell_node[], const PetscReal *const b[],
                       const PetscReal u[], PetscReal y[]);
void ElementGradient(PetscInt dim, PetscInt ncell, const PetscInt cell_node[], const PetscReal *const b[],
                     PetscReal scale, const PetscReal p[], PetscReal r[]);
