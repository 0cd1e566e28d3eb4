/* Inside of Scalars; for its files only. scalar.c: life cycle, fields, state. read.c: options. condition.c: boundaries
   and their faces. source.c: sources and fluxes. cells.c: matrices of a cell. matrix.c: the matrix of a step. solve.c:
   right-hand side and solver.
   extend.c: values where nothing is solved for. points.c: points of a cell, at which measure.c (balance and fluxes) and
   excess.c (what bodies bring into it) sum. */
#pragma once
#include "fem/element.h"
#include "scalar/scalar.h"
#include "base/expr.h"

typedef enum {
  SCALAR_SOLVER_SWEEPS,
  SCALAR_SOLVER_ILU,
  SCALAR_SOLVER_MULTIGRID,
  SCALAR_SOLVER_DIRECT
} ScalarSolverKind;

/* How the steps of a scalar are solved for (solve.c) */
typedef struct {
  KSP              ksp;
  ScalarSolverKind kind, working; /* of ksp; that took over where the chosen one failed */
  PetscBool        has_failed;
  PetscInt         first, spent; /* iterations of the solve that the preconditioner was made for, -1: it is to be
                                     made; those beyond them since */
  PetscInt         served;       /* steps that it has served since */
  PetscInt         wait, pause;  /* steps before one is kept again; so many the last time */
} ScalarSolver;

typedef enum {
  SCALAR_NONE,
  SCALAR_VALUE,
  SCALAR_FLUX, /* with or without transfer */
} ScalarConditionKind;

/* A number, or an expression */
typedef struct {
  PetscReal value;
  Expr      formula;
  PetscBool given;
} ScalarNumber;

typedef struct {
  ScalarConditionKind kind;
  ScalarNumber        value, flux, ambient;
  PetscReal           transfer;
} ScalarCondition;

/* Faces of local cells on boundaries; side 2 axis + 1: upper end */
typedef struct {
  PetscInt cell, side, boundary;
} ScalarFace;

/* A cut cell of a body with one value: what it exchanges with it, a unit of the difference */
typedef struct {
  PetscInt  cell, lump;
  PetscReal each[MESH_MAX_NB], whole;
} ScalarLumpCell;

/* Stabilisation (limit.c) of the last solve: parts of cells that are of low order [ncell_all], NULL: none is; of fluxes
   that raise and lower a node the part that is left [nnode_all][2]; values that these go by [nnode_all]. Of the step:
   by how much cells are beyond the bound, 0 to 1 [ncell_all], NULL: not known; whether one is, on any rank; cells that
   share a node with one [nnear]; lowest and highest value of nodes there [nnode_all] */
typedef struct {
  PetscBool  wanted, any;
  PetscReal *part, *node, *x, *peclet, (*bound)[2];
  PetscInt   nnear, *near;
} ScalarLimits;

/* What goes into a scalar in a step (source.c), linear in its value T: source q - slope T at the nodes [nnode_all],
   flux q - h T through faces on boundaries [nface][nq][2], other sides [nside][nq][2] and, by volume, surfaces in
   samples [nsample][count][2]: q, h. NULL: there is none. */
typedef struct {
  PetscReal *q, *slope, *face, *side, *sample;
  PetscInt   count;  /* of the samples of a cell */
  PetscBool  reacts; /* does it go by scalars? */
} ScalarInput;

typedef struct {
  char             name[64];
  ScalarParameters par;
  ScalarNumber     source, initial;
  char             run[PETSC_MAX_PATH_LEN]; /* it begins with the fields of, "": none */
  PetscBool        solved;                  /* is x the solution of the step? */
  PetscReal        decay;                   /* rate of a first-order reaction */
  PetscReal       *gain;          /* [n] rates by which scalars make this one, in its source; NULL: none does */
  ScalarCondition *condition;     /* [nboundary] */
  PetscReal       *T, *T_old, *x; /* [nnode_all] */
  PetscReal *excess; /* [nnode_all] by how much T is above its bounds, or below them (negative); NULL: it is not */
  /* of the step: */
  PetscInt         *owner; /* [nnode_all] boundary that prescribes a node's value, nboundary: ScalarNodes does; -1 */
  PetscReal        *fixed; /* [nnode_all] that value */
  ScalarInput       input;
  PetscReal        *rhs;  /* [nnode_all] */
  PetscBool        *seen; /* [nnode_all] is it in a cell of the problem? */
  ScalarCells       cells;
  ScalarNodes       nodes;
  PetscInt          nside, *cell_side; /* [ncell_all] first side of a cell, -1; NULL: there are none */
  const ScalarSide *side;              /* [nside] */
  /* bodies with one value each (lumps.c), NULL: none; nodes of each, work [2][nnode_all], cut cells; the
     product with the matrix, and what the preconditioner is made of */
  const ScalarLumps *lumps;
  PetscReal         *lump_count, *lump_nodal;
  PetscInt           nlump_cell;
  ScalarLumpCell    *lump_cell;
  Mat                lump_product, lump_rows;
  /* [own cells][2][nb] of the last ScalarAssemble, sums over the columns of M and of what convects, where these are all
     that a cell has; NULL: not known. has_sums [own cells] */
  PetscReal *sums;
  PetscBool *has_sums;
  /* of ScalarsMeasureGrowth: weights of nodes in cells that stand still, int c; the others [ngrowth_cell] */
  PetscReal       *growth_weight; /* [nnode_all] */
  PetscInt        *growth_cell, ngrowth_cell;
  Mat              A;
  ScalarSolver     solver;
  PetscBool        extended; /* ScalarsExtend */
  const PetscReal *w;        /* of the last solve */
  ScalarLimits     limit;
} Scalar;

struct _p_Scalars {
  MPI_Comm         comm;
  Mesh             mesh;
  const MeshLocal *loc;
  ElementTables    element;
  PetscReal        integral[MESH_MAX_NB]; /* of the basis over the reference cell */
  PetscInt         n, nboundary;
  PetscReal        rtol; /* -scalars_rtol */
  Scalar          *scalar;
  ScalarsReader    read; /* NULL: none */
  ScalarStep       step;
  const PetscReal *shift; /* of nodes, or NULL */
  PetscReal       *edge;  /* [ncell_all][3] of cells that are boxes, else 0; found when the mesh had moved .. */
  PetscInt         moves; /* .. so often, -1: not yet */
  /* of the mesh, made when first wanted: */
  PetscBool       ready;
  PetscInt        nface;
  ScalarFace     *face;
  PetscInt       *cell_face, *next_face; /* [ncell_all] first face of a cell, -1; [nface] the next of its cell */
  PetscInt       *row_start, *column;    /* pattern of own rows, columns global */
  unsigned short *entry;                 /* [ncell_all][nb][nb] see matrix.c */
};

/* read.c */
PetscErrorCode ScalarsRead(Scalars);
PetscErrorCode ScalarForgetOptions(Scalars, Scalar *);
PetscErrorCode ScalarEvaluateNumber(const ScalarNumber *, PetscReal time, PetscInt n, const PetscReal x[],
                                    PetscReal value[]);

/* source.c: what goes into a scalar by the values of all as they are. Collective. */
PetscErrorCode ScalarSetInput(Scalars, Scalar *);
/* The same where that changes it by more than scalars are solved for; else it stays. Collective. */
PetscErrorCode ScalarRenewInput(Scalars, Scalar *, PetscBool *changed);
PetscErrorCode ScalarForgetInput(ScalarInput *);
/* Does some of it on this rank grow less where the value is larger? */
PetscBool ScalarHasSink(Scalars, const Scalar *);

/* condition.c */
PetscErrorCode ScalarsFindFaces(Scalars);
PetscErrorCode ScalarsSetValues(Scalars, Scalar *); /* prescribed ones */
/* Quadrature of a side of a cell: positions x [nq][dim], weight with area [nq], basis phi [nq][MESH_MAX_NB]; nq <= 9;
   normal [nq][dim] (NULL: not wanted), out of the cell */
PetscErrorCode ScalarSidePoints(Scalars, PetscInt c, PetscInt side, PetscReal x[], PetscReal weight[], PetscReal phi[],
                                PetscReal normal[]);
/* The same of face i */
PetscErrorCode ScalarFacePoints(Scalars, PetscInt i, PetscReal x[], PetscReal weight[], PetscReal phi[]);

/* cells.c: a cell in the step, at its lattice points: matrix A = c_t M + theta L (convection, diffusion, reaction,
   transfer at boundaries), mass M with the capacity, both [nb][nbp]; right-hand side f [nb] of history, sources and
   fluxes; lift: G.x at the lattice points where there is a mean gradient */
typedef struct {
  PetscReal A[ELEMENT_MAX_NB * ELEMENT_MAX_NBP], M[ELEMENT_MAX_NB * ELEMENT_MAX_NBP], f[ELEMENT_MAX_NB],
    linear[ELEMENT_MAX_NB];
} ScalarCell;
PetscErrorCode ScalarCellSet(Scalars, const Scalar *, PetscInt c, ScalarCell *);
/* Before it is stabilised, without its faces and history: A, M, and f of sources */
PetscErrorCode ScalarCellMatrices(Scalars, const Scalar *, PetscInt c, ScalarCell *);
/* Basis phi [nb], its gradients in space g and the weight of sample q of n^dim in a cell with node coordinates xc */
PetscReal ScalarSampleBasis(Scalars, PetscInt n, PetscInt q, const PetscReal xc[], PetscReal phi[],
                            PetscReal g[3][MESH_MAX_NB]);
/* What sources and reactions of the options do in it, source - slope T at its lattice points; acts: do they? Else
   neither is set. decay: rate of a first-order reaction, that of its material with it */
typedef struct {
  PetscBool acts;
  PetscReal decay, q[MESH_MAX_NB], slope[MESH_MAX_NB];
} ScalarCellInput;
void ScalarCellGetInput(Scalars, const Scalar *, PetscInt c, ScalarCellInput *);
/* Its sample k has the source f - r T */
static inline void ScalarSampleTerms(const Scalar *s, PetscInt c, PetscInt k, PetscReal *r, PetscReal *f)
{
  const PetscInt       at  = s->cells.sample[c];
  const ScalarSamples *p   = s->cells.samples + at;
  const PetscReal     *has = p->surface ? s->input.sample + (at * s->input.count + k) * 2 : NULL;

  *r = p->reaction[k] + (has ? has[1] : 0);
  *f = p->source[k] + (has ? has[0] : 0);
}
/* Part of its sample k in which they do */
PetscReal ScalarSamplePart(const Scalar *, PetscInt c, PetscInt k);
/* Is it part of the problem? */
PetscBool ScalarCellIsActive(const Scalar *, PetscInt c);
/* Node coordinates xc [nb][dim], with the shift */
PetscErrorCode ScalarCellCoordinates(Scalars, PetscInt c, PetscReal xc[]);
/* Edges [dim] of a box; NULL: it is none. Found once where nodes are. */
PetscErrorCode ScalarCellBox(Scalars, PetscInt c, const PetscReal *edge[]);
PetscErrorCode ScalarCellMetric(Scalars, PetscInt c, ElementMetric *);
/* G.x at its lattice points, 0 without a mean gradient */
PetscErrorCode ScalarCellLinear(Scalars, const Scalar *, PetscInt c, PetscReal linear[]);
/* r [nb] = scale int phi_i v over a cell, v [nb] at its lattice points */
PetscErrorCode ScalarCellIntegrate(Scalars, PetscInt c, PetscReal scale, const PetscReal v[], PetscReal r[]);
/* points.c: points of a cell at which terms are summed: its samples, or those of the element */
typedef struct {
  const ScalarSamples *sample;              /* NULL: it has none, */
  PetscReal            xc[MESH_MAX_NB * 3]; /* its coordinates where it has, */
  ElementMetric        m;                   /* its metric where not, */
  PetscReal            capacity;            /* and its capacity; 0: it is no part of the problem */
  PetscInt             n;
} ScalarPoints;
typedef struct {
  PetscReal weight, capacity, phi[MESH_MAX_NB], g[3][MESH_MAX_NB];
} ScalarPoint;
PetscErrorCode ScalarCellPoints(Scalars, const Scalar *, PetscInt c, ScalarPoints *);
PetscErrorCode ScalarCellPoint(Scalars, const ScalarPoints *, PetscInt q, ScalarPoint *);
/* Its nodal values: at the end of the step and at the two before, G.x, at the point theta of the step (with G.x);
   convection */
typedef struct {
  PetscReal x[MESH_MAX_NB], now[MESH_MAX_NB], old[MESH_MAX_NB], linear[MESH_MAX_NB], theta[MESH_MAX_NB],
    w[MESH_MAX_NB * 3];
  PetscBool convects;
} ScalarValues;
PetscErrorCode ScalarCellValues(Scalars, const Scalar *, PetscInt c, ScalarValues *);
/* w.grad T_theta there */
PetscReal ScalarConvected(PetscInt dim, PetscInt nb, const ScalarPoint *, const ScalarValues *);

/* limit.c: how cells are stabilised, by the solution; again: at least as they are already. *more: the solution is out
   of its bounds, solve again. Collective. */
PetscErrorCode ScalarLimit(Scalars, Scalar *, PetscBool again, PetscBool *more);
PetscErrorCode ScalarLimitForget(Scalar *);
/* The step is taken: how far its values are out of their bounds. Collective. */
PetscErrorCode ScalarLimitAccept(Scalars, Scalar *);

/* limitcell.c: node at lattice point j of cell c, -1: none is */
PetscInt ScalarLimitNode(const MeshLocal *, PetscInt c, PetscInt j);
/* Of cell c, at its lattice points: nodes, values of a nodal field and their rates of change */
void ScalarLimitValues(Scalars, const Scalar *, PetscInt c, const PetscReal nodal[], PetscInt node[], PetscReal x[],
                       PetscReal r[]);
/* Nodes i, j of a cell with matrices L and M, values x and rates of change r at its lattice points: diffusion d that
   makes L of low order, and the flux into i that this takes away */
PetscReal ScalarLimitFlux(Scalars, PetscInt i, PetscInt j, const PetscReal L[], const PetscReal M[],
                          const PetscReal x[], const PetscReal r[], PetscReal *d);
/* A += scale c_t M */
void ScalarLimitAddMass(Scalars, PetscReal scale, PetscReal A[], const PetscReal M[]);
/* Matrices A, M [nb][nbp] of a cell with a part of low order: that much of it */
void ScalarLimitCell(Scalars, const Scalar *, PetscInt c, PetscReal A[], PetscReal M[]);

/* matrix.c */
PetscErrorCode ScalarsFindPattern(Scalars);
PetscErrorCode ScalarCreateMatrix(Scalars, Scalar *);
/* The matrix of the step; fixed rows are those of the identity. rhs [nnode_all]: right-hand side, own nodes. */
PetscErrorCode ScalarAssemble(Scalars, Scalar *);

/* lumps.c */
typedef struct {
  Scalars all;
  Scalar *scalar;
  Vec     in;
} ScalarLumpProduct;
/* Is a node one of a body with one value? */
PetscBool ScalarIsLumped(const Scalar *, PetscInt i);
/* Is an own node, of the matrix there is, solved for: neither fixed nor in no cell of the problem? */
PetscBool ScalarIsFree(const Scalar *, PetscInt i);
/* After ScalarsPredict: nodes get the values of their bodies. Collective. */
PetscErrorCode ScalarLumpsBegin(Scalars, Scalar *);
/* After ScalarAssemble: right-hand side, product and rows of the preconditioner. Collective. */
PetscErrorCode ScalarLumpsAssemble(Scalars, Scalar *);
/* What the solver solves with */
Mat ScalarGetProduct(const Scalar *);
/* The solution is found. Collective. */
PetscErrorCode ScalarLumpsTake(Scalars, Scalar *);
/* Adds those that this rank counts, and to flux [bodies] what they let into the fluid (NULL: not wanted). Local. */
void           ScalarLumpsMeasure(Scalars, const Scalar *, ScalarBalance *, PetscReal flux[]);
PetscErrorCode ScalarLumpsForget(Scalar *);

/* extend.c: the solution at nodes in no cell of the problem. Collective. */
PetscErrorCode ScalarExtendSolution(Scalars, Scalar *);

/* solve.c: matrix and solver, unless they are there */
PetscErrorCode ScalarCreateSolver(Scalars, Scalar *);
PetscErrorCode ScalarForgetSolver(Scalar *);

/* made when first wanted */
PetscErrorCode ScalarsSetUp(Scalars);
