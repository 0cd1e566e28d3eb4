/* Inside of Flow; for its files only. flow.c: parameters, fields, life cycle. cells.c: what depends on the shape of
   cells. owners.c: what participants add. properties.c: several fluids. assemble.c: matrix, right-hand side, products
   with B. product.c with lanes.c: products without a matrix. rows.c: rows of S near marked nodes. components.c: matrix
   of all components. material/: stresses that are not Newtonian. time.c: schemes. evaluate.c: what a solution amounts
   to, cell by cell; it changes nothing. remesh.c: what goes by the mesh. */
#pragma once
#include "fem/element.h"
#include "flow/flow.h"
#include "fem/batch.h"
#include "material/eddy.h"
#include "material/material.h"
#include "material/walls.h"
#include "ondevice.h"
#include "owners.h"
#include "traction.h"

/* In the order of the values of -flow_time */
enum {
  SCHEME_BE,
  SCHEME_CN,
  SCHEME_BDF2,
  SCHEME_FSTHETA
};

/* What cells of one form share: matrix of B, size; of boxes also the edges (else 0), what hangs in them (MeshHang's
   code, -1: nothing), det J and the inverse pressure mass */
typedef struct {
  PetscReal *b, size, edge[3], det; /* behind b the inverse mass of the pressure, of boxes of refined meshes the lumped
                                       masses [nb] */
  PetscInt   hang_code;
} CellKind;

/* Of FlowSetProperties, NULL: the number of the parameters */
typedef struct {
  const PetscReal *density, *viscosity; /* [ncell_all] */
  /* [nnode_all] of M weighted with density over that of the parameters: row sums; what FlowGetInertialMass gives. NULL:
     never needed */
  PetscReal *inertia, *mass;
  PetscBool  lost; /* there were some on the mesh before, and nobody has set them since */
} Properties;

/* Scheme and history in time */
typedef struct {
  PetscInt  scheme, nsteps, substep; /* steps taken; substep that comes next */
  PetscReal dt_old, dt_older;        /* last steps (0: none) */
  PetscReal extrapolation;           /* of w, in units of the old step */
  PetscReal curvature;               /* factor of its parabola */
  PetscReal cfl;                     /* of the last step, 0: none */
  PetscBool parabola;                /* may w be one, in large steps? */
} FlowTime;

/* Geometry of the cells */
typedef struct {
  PetscBool  *affine;
  PetscReal  *inverse, *det;       /* [ncell_all][dim*dim], [ncell_all] */
  PetscReal  *centre, *size;       /* [ncell_all][dim] where its pressures are centred; [ncell_all] */
  PetscReal **b, **b_own;          /* [ncell_all] cell matrices of B: own ones (or NULL), or of a kind */
  CellKind   *kind;                /* forms common to several cells, the first with zeros */
  PetscInt    nkind, ncell;        /* ncell: local cells */
  PetscReal  *lumped;              /* [nnode_all] */
  PetscInt   *open, *visited, now; /* stamps: [nnode_all] mass is being computed, [ncell_all] done */
  PetscInt   *neighbour;           /* [ncell_all] scratch */
} FlowCells;

/* Velocity matrix of the step. Matrix-free, S is made when FlowGetMatrix wants it, and belongs to the step if it is
   current */
typedef struct {
  Mat                 S, A;      /* of a component; of all, or NULL */
  PetscReal           ct, theta; /* of the assembled one; 0: none yet */
  void               *entry;     /* [ncell_all][nb][nb] position of an entry of a cell in its row, see FlowEntry */
  PetscBool           wide;      /* positions have two bytes, since a row is long; else one */
  PetscBool           free, current;
  struct _p_Product  *product;   /* or NULL: S is assembled in every step */
  struct _p_NearRows *near_rows; /* of FlowGatherRows, NULL: never called */
} FlowMatrix;

/* -flow_convection_form conservative */
typedef struct {
  PetscBool wanted;
  PetscInt  axes;       /* bit mask of periodic ones, 0: not wanted */
  PetscReal impulse[3]; /* over volume, that convection took in the last step */
} FlowKept;

typedef struct {
  VectorField field; /* of FlowSetSource */
  void       *ctx;
  PetscReal
    *source; /* its weighted mean over the step, with -flow_force if it depends on x [nnode_all][dim]; NULL: none */
  PetscReal given[3],
    pressure_gradient[3]; /* uniform part of -flow_force, and of FlowSetMeanPressureGradient: their sum is in par */
  Expr gravity,
    expr; /* NULL: numbers, in par; those that do not depend on the position are put into par in every step */
  Traction traction; /* of openings of type pressure, NULL: there are none */
  FlowKept kept;
} FlowForces;

/* How the flow starts */
typedef struct {
  FlowInitial kind;
  Expr        formula; /* velocity; NULL: numbers */
  PetscBool   mean;    /* velocity of the parameters is that of -flow_rate */
  char        run[PETSC_MAX_PATH_LEN];
} FlowStart;

struct _p_Flow {
  MPI_Comm         comm; /* the mesh's */
  Mesh             mesh;
  const MeshLocal *loc;
  FlowParameters   par;
  FlowStep         step;
  Conditions       boundary;
  ElementTables    element;
  BatchTables     *tables; /* the same for cells side by side */
  FlowTime         time;
  FlowCells        cells;
  FlowMatrix       matrix;
  FlowForces       force;
  FlowStart        start;
  Owners           owners; /* further terms, operators and forces */
  Properties       properties;
  /* what its stress is (material.h), NULL: Newtonian; its own data; viscosity at points where it has one */
  const FlowMaterial *material;
  void               *material_data;
  Viscosity           viscosity;
  /* fields; u_older: NULL but for quadratic extrapolation */
  PetscReal       *u, *u_old, *u_older, *w, *p, *p_old;
  OnDevice         device;        /* NULL: everything lies in the memory of the processor */
  const PetscReal *finer;         /* [ncell][nb][dim] what residuals of cells count beside u and p, or NULL (finer.c) */
  const PetscReal *mesh_velocity; /* [nnode_all][dim] of the nodes, NULL: they stand still */
};

/* Read density, gravity and body force. Collective. */
PetscErrorCode FlowReadForces(Flow);
/* -flow_convection_form conservative: along which axes. Error: the domain has openings. Collective. */
PetscErrorCode FlowCheckKept(Flow);
/* That what convection took of the momentum in this step, flux [3] times its length, comes back in the next. Local. */
void FlowKeepMomentum(Flow, const PetscReal flux[3], PetscReal volume);
/* Read how the flow starts, and set u and u_old if it is a closed form. Collective. */
PetscErrorCode FlowSetInitial(Flow);
/* Velocity of side `side` of the box (DOMAIN_SIDE) as a wall, v [3], once its ramp has ended; *wall: is it one of type
   no_slip or moving_wall? Error: a wall whose velocity is an expression. */
PetscErrorCode ConditionsGetSide(Conditions, PetscInt side, PetscReal v[3], PetscBool *wall);
/* Gravity, body force and source of the step. Local. */
PetscErrorCode FlowEvaluateForces(Flow);
/* Error: a force changes in time, and a steady state is wanted. */
PetscErrorCode FlowRefuseTime(Flow);

/* Arrays by cells and nodes, conditions, matrix; fields are zero. Collective. */
PetscErrorCode FlowCreateComponents(Flow);
PetscErrorCode FlowDestroyComponents(Flow);
/* What is kept of the cells (cells.c), and, anew after all have changed, everything that depends on their shape.
   Collective. */
PetscErrorCode FlowCreateCells(Flow);
PetscErrorCode FlowDestroyCells(Flow);
PetscErrorCode FlowComputeCells(Flow);
/* Inertial mass of the densities as they are. Collective. */
PetscErrorCode FlowUpdateInertia(Flow);
/* S without values. Collective. */
PetscErrorCode FlowCreateMatrix(Flow);
/* The velocity operator without a matrix (product.c); update: to the step's coefficients. Collective. */
PetscErrorCode FlowCreateProduct(Flow);
PetscErrorCode FlowDestroyProduct(Flow);
PetscErrorCode FlowUpdateProduct(Flow);
/* What FlowGatherRows keeps (rows.c). Local. */
PetscErrorCode FlowDestroyRows(Flow);
/* Matrix of local cell c in S, ce [nb][nbp], between its nodes, or where it hangs between its lattice points (hang.h);
   without the terms of owners. Local. */
PetscErrorCode FlowCellMatrix(Flow, PetscInt c, PetscReal ce[]);
PetscErrorCode FlowCellLatticeMatrix(Flow, PetscInt c, PetscReal ce[]);
/* w of the step, and the velocity that sets the viscosity, from the fields in use. Local. */
PetscErrorCode FlowExtrapolateConvection(Flow);

/* Read the conditions. Collective. Errors: inflow or moving wall without velocity, slip on a boundary that is no plane
   along an axis. */
PetscErrorCode ConditionsCreate(Mesh, Conditions *);
PetscErrorCode ConditionsDestroy(Conditions *);
PetscErrorCode ConditionsView(Conditions, PetscViewer);
/* The pressure outside boundary b, of type pressure, over a step of length dt that ends at the time of the last
   ConditionsSetTime, theta at its end + (1 - theta) at its beginning, with factor and ramp: value [m] at points x
   [m][dim]. Collective. */
PetscErrorCode ConditionsGetPressure(Conditions, PetscInt b, PetscReal theta, PetscReal dt, PetscInt m,
                                     const PetscReal x[], PetscReal value[]);
/* Evaluate the prescribed values at a time; PETSC_MAX_REAL: those of the steady state, after all ramps. Local.
   Error: a steady state is wanted and a boundary never stops changing (_factor). */
PetscErrorCode ConditionsSetTime(Conditions, PetscReal time);

/* Coefficients of the material for the step, unless they are current. Collective. */
static inline PetscErrorCode FlowUpdateMaterial(Flow f)
{
  PetscFunctionBeginUser;
  if (f->material) PetscCall((*f->material->update)(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The functions below are called once a cell and are therefore inlined. */

/* Metric of local cell c at its quadrature points: of an affine cell as stored, else from the coordinates. A cell that
   is no part of the fluid has zero weights. */
static inline PetscErrorCode FlowCellMetric(Flow f, PetscInt c, ElementMetric *m)
{
  const PetscInt dim = f->loc->dim;

  PetscFunctionBeginUser;
  if (f->cells.affine[c]) {
    ElementSetAffine(&f->element, f->cells.inverse + c * dim * dim, f->cells.det[c], m);
  } else {
    PetscReal xc[MESH_MAX_NB * 3];

    PetscCall(MeshCellCoordinates(f->mesh, c, xc));
    ElementSetMetric(&f->element, xc, m);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is the viscous stress mu (grad u + grad u^T), with a viscosity that varies? */
static inline PetscBool FlowVaries(const struct _p_Flow *f)
{
  return (PetscBool)(f->material && f->material->symmetric);
}

/* The number mu of the gradient form mu grad u in residuals and in the matrix */
static inline PetscReal FlowNumber(const struct _p_Flow *f)
{
  return FlowVaries(f) ? 0 : f->par.matrix;
}

static inline PetscReal FlowDensity(const struct _p_Flow *f, PetscInt c)
{
  return f->properties.density ? f->properties.density[c] : f->par.density;
}

/* Over that of the parameters */
static inline PetscReal FlowDensityRatio(const struct _p_Flow *f, PetscInt c)
{
  return f->properties.density ? f->properties.density[c] / f->par.density : 1;
}

/* Row sums of the mass that inertia has */
static inline const PetscReal *FlowInertia(const struct _p_Flow *f)
{
  return f->properties.density ? f->properties.inertia : f->cells.lumped;
}

/* Body force in cell c: that of the parameters, and the weight that is not in the pressure */
static inline const PetscReal *FlowForceIn(const struct _p_Flow *f, PetscInt c, PetscReal force[3])
{
  for (PetscInt a = 0; a < 3; a++)
    force[a] = f->par.force[a] + (FlowDensity(f, c) - f->par.density) * f->par.gravity[a];
  return force;
}

/* r [nb][dim] = momentum residual of cell c without pressure: nodal acceleration al, velocity vl (NULL: zero),
   convecting velocity wl, all [nb][dim] */
static inline void FlowCellMomentum(Flow f, PetscInt c, const ElementMetric *m, const PetscReal al[],
                                    const PetscReal vl[], const PetscReal wl[], PetscReal r[])
{
  PetscReal own[3];

  ElementResidual(&f->element, m, FlowDensity(f, c), FlowNumber(f),
                  f->properties.density ? FlowForceIn(f, c, own) : f->par.force, al, vl, f->par.convection ? wl : NULL,
                  f->par.skew, r);
  if (f->material) (*f->material->residual)(f, c, m, vl, r);
}

/* A cell that is no part of the fluid */
static inline PetscBool FlowIsInactive(const struct _p_Flow *f, PetscInt c)
{
  return (PetscBool)(f->cells.affine[c] && f->cells.det[c] == 0);
}

/* Is the fluid one with one density, and its stress mu grad u with one number mu? */
static inline PetscBool FlowIsPlain(const struct _p_Flow *f)
{
  return (PetscBool)(!f->material && !f->properties.density);
}

/* grad [a][b] = du_a/dx_b of nodal values ul [nb][dim] */
static inline void FlowVelocityGradient(const struct _p_Flow *f, FlowGradients g, const PetscReal ul[],
                                        PetscReal grad[3][3])
{
  const PetscInt dim = f->loc->dim;

  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt b = 0; b < dim; b++) grad[a][b] = 0;
  for (PetscInt j = 0; j < f->loc->nb; j++)
    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt b = 0; b < dim; b++) grad[a][b] += g[b][j] * ul[j * dim + a];
}

/* Node at lattice position j of local cell c, -1 where none is. */
static inline PetscInt FlowCellNode(const MeshLocal *l, PetscInt c, PetscInt j)
{
  const MeshHang *h = MeshCellHang(l, c);

  for (PetscInt i = 0; h && i < h->n; i++) {
    if (h->slot[i] != j) continue;
    return h->start[i + 1] - h->start[i] == 1 ? l->cell_node[c * l->nb + h->from[h->start[i]]] : -1;
  }
  return l->cell_node[c * l->nb + j];
}

/* Where entry (i, j) of cell c stands in its row: from 0 on among own columns, or (*other) among those of other
   ranks; -1: the row is another rank's */
static inline PetscInt FlowEntry(const struct _p_Flow *f, PetscBool wide, PetscInt c, PetscInt i, PetscInt j,
                                 PetscBool *other)
{
  const size_t   k    = ((size_t)c * (size_t)f->loc->nb + (size_t)i) * (size_t)f->loc->nb + (size_t)j;
  const PetscInt half = wide ? 0x8000 : 0x80,
                 e = wide ? ((const unsigned short *)f->matrix.entry)[k] : ((const unsigned char *)f->matrix.entry)[k];

  *other = (PetscBool)(e >= half);
  return e < half ? e : e == 2 * half - 1 ? -1 : e - half;
}

/* Numbers in the matrix b of a cell, behind which its inverse mass of the pressure [dim+1][dim+1] stands */
static inline PetscInt FlowDivergenceSize(const struct _p_Flow *f)
{
  return (f->loc->dim + 1) * f->loc->nb * f->loc->dim;
}

static inline const PetscReal *FlowPressureMass(const struct _p_Flow *f, PetscInt c)
{
  return f->cells.b[c] + FlowDivergenceSize(f);
}
