/* Material: what the stress of a fluid is where it is not mu grad u with one number mu. A Newtonian fluid has none
   (NULL), and a loop pays one test of that pointer.

   The assembly, the residuals and the steps of a flow know a material by this table alone: facts, what happens once in
   a step, and what a cell adds to the forms. Its own data hang at Flow.material_data; its file is the only one that
   looks into them. -flow_rheology chooses among generalised.c, viscoelastic.c and eddy.c (choose.c), of which one law
   excludes the others; FlowSetProperties with viscosities by cell chooses percell.c for a fluid that has none of these.

   Per-cell functions work at the lattice points of a cell (mesh/hang.h), with its metric; they are local. Entries that
   may be NULL say so. */
#pragma once
#include "flow/flow.h"
#include "fem/element.h"

/* Gradients of the basis at a quadrature point, [axis][j] */
typedef PetscReal FlowGradients[3][ELEMENT_MAX_NBP];

/* Viscosity at quadrature points, of the materials that have one, else all NULL */
typedef struct {
  PetscReal *velocity;    /* [nnode_all][dim] whose gradient sets it */
  PetscReal *mu;          /* [ncell_all][nq] */
  PetscReal *cell, *node; /* [ncell_all], [nnode_all] means */
  PetscBool  current;     /* these belong to the velocity */
} Viscosity;

typedef struct {
  const char *name;
  /* facts */
  PetscBool symmetric; /* the viscous stress is mu (grad u + grad u^T) with the mu of Viscosity; no number mu is in the
                            operator, which is a matrix of all components */
  PetscBool matrix_free; /* products may do without a matrix */
  PetscBool varies;      /* the matrix is another one in every step */
  PetscBool linear;      /* the convecting velocity must not become a parabola on its own account (auto) */
  PetscReal factor;      /* of Viscosity.mu in the scalar operator; 0: not in it */
  /* life: fields for the mesh as it is; on a new mesh, with what is kept of `old`, whose arrays are freed */
  PetscErrorCode (*create)(Flow);
  PetscErrorCode (*remesh)(Flow, Mesh old);
  PetscErrorCode (*destroy)(Flow);
  /* errors: options of the flow, or a steady problem, that it cannot have; NULL: none */
  PetscErrorCode (*check)(Flow, const char scheme[], PetscBool end_of_step);
  PetscErrorCode (*refuse_steady)(Flow);
  /* in a step: one of length dt begins (NULL: nothing to do); its velocities, cells or frame have changed; these cells
     have another shape (NULL); coefficients for it, unless they are current (collective); its solution is u (NULL) */
  PetscErrorCode (*begin)(Flow, PetscReal dt);
  void (*outdate)(Flow);
  PetscErrorCode (*move)(Flow, PetscInt n, const PetscInt cells[]);
  PetscErrorCode (*update)(Flow);
  PetscErrorCode (*accept)(Flow, const PetscReal u[]);
  /* of a cell: r [nb][dim] += stress tested, of nodal velocities ul [nb][dim] (NULL: zero); ce [nb][nbp] += what the
     scalar operator has of it; n [nb*dim][nb*dim] += what couples components, with the derivative at u
     (NULL: without; NULL: nothing does). stress: the viscosity mu of mu (grad + grad^T) at quadrature point q, where
     the velocity gradient is grad; extra [3][3] += what is not of this form. */
  void (*residual)(Flow, PetscInt c, const ElementMetric *, const PetscReal ul[], PetscReal r[]);
  void (*scalar)(Flow, PetscInt c, const ElementMetric *, PetscReal ce[]);
  void (*tangent)(Flow, PetscInt c, const ElementMetric *, const PetscReal ul[], PetscReal n[]);
  PetscReal (*stress)(const struct _p_Flow *, PetscInt c, const ElementMetric *, PetscInt q, PetscReal grad[3][3],
                      PetscReal extra[3][3]);
  /* of the step's solution, own cells: force [dim] += what leaves through openings; collective; NULL: nothing */
  PetscErrorCode (*diagnose)(Flow, PetscReal force[]);
  PetscErrorCode (*visit)(Flow, State); /* NULL: nothing to keep */
  PetscErrorCode (*view)(Flow, PetscViewer);
} FlowMaterial;

extern const FlowMaterial FLOW_GENERALISED, FLOW_VISCOELASTIC, FLOW_EDDIES, FLOW_PER_CELL;

/* Read -flow_rheology, and the options of the law. Collective. */
PetscErrorCode FlowChooseMaterial(Flow);

/* Arrays of f->viscosity, with zeros (viscosity.c). */
PetscErrorCode ViscosityCreate(Flow);
PetscErrorCode ViscosityDestroy(Flow);
PetscErrorCode ViscosityRemesh(Flow, Mesh old);
/* The velocity becomes that at the point theta of the step. Local. */
void ViscosityOutdate(Flow);
/* Means over cells and nodes. Collective. */
PetscErrorCode ViscosityAverage(Flow);
/* Parts of the stress mu (grad u + grad u^T), as the table has them; grad u^T alone couples components. */
void ViscosityResidual(Flow, PetscInt c, const ElementMetric *, const PetscReal ul[], PetscReal r[]);
void ViscosityScalar(Flow, PetscInt c, const ElementMetric *, PetscReal ce[]);
void ViscosityTangentAt(const struct _p_Flow *, PetscInt c, PetscInt q, PetscReal weight, FlowGradients, PetscReal n[]);
void ViscosityTangent(Flow, PetscInt c, const ElementMetric *, const PetscReal ul[], PetscReal n[]);
PetscReal ViscosityStress(const struct _p_Flow *, PetscInt c, const ElementMetric *, PetscInt q, PetscReal grad[3][3],
                          PetscReal extra[3][3]);
/* D = (grad + grad^T)/2; returns sqrt(2 D:D) */
PetscReal ViscosityStrain(PetscInt dim, PetscReal grad[3][3], PetscReal D[3][3]);
