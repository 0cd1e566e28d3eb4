/* Scalars: what a flow carries, heat or concentrations, on the mesh of the flow. Knows neither a flow nor bodies: it is
   given velocities, and what cells are made of.

   Q2 elements, 3-point Gauss quadrature an axis. One step n -> n+1 of a scalar T with heat capacity c and conductivity
   k by volume (a concentration: c = 1, k the diffusivity) is linear:

     c (c_t T - d(T), v) + c (w.grad T_theta, v) + (k grad T_theta, grad v) + (r T_theta, v) = (f, v) + <q, v>,
     d(T) = d0 T^n + d1 T^{n-1},   T_theta = theta T + (1 - theta) T^n

   in the scheme of the flow, w its velocity at the point theta of the step. At boundaries T has a value, or
   k dT/dn is a flux q into the domain, or transfer h (T_ambient - T), or nothing (0). On periodic meshes
   T = G.x + T' with a mean gradient G and a periodic T', the unknown.

   What cells are made of can differ by cell (ScalarCells) and within cells that surfaces cut (ScalarSamples: sums over
   n x n (x n) sub-cells in place of the quadrature).

   Reactions: of first order, c dT/dt gains c sum_k r_k T_k, the own rate below zero part of r above; of any kind, a
   source f by scalars; on surfaces, a flux q by scalars. They act at the point theta: f and q linear in the scalar's
   own value where that uses it up (implicit, source.c), of scalars earlier in the list as solved for (A -> B in this
   order: what A loses B gains, to round-off for c = 1), of later ones extrapolated (second order with bdf2 and
   Crank-Nicolson); solved again where that is not what the values found make of them (ScalarsSettle).

   Nodal arrays are [nnode_all], synced. Options: -scalars names them, then -scalar_<scalar>_... */
#pragma once
#include "mesh/mesh.h"
#include "base/expr.h"
#include "base/state.h"

typedef struct _p_Scalars *Scalars;

typedef struct {
  PetscReal time, dt, ct, d0, d1, theta; /* as of FlowStep; dt 0: steady, c_t = 0 */
  PetscReal extrapolation;               /* T_theta is about T^n + extrapolation (T^n - T^{n-1}) */
} ScalarStep;

typedef struct {
  const char *name;
  PetscReal   capacity, conductivity; /* of the fluid */
  PetscReal   expansion, reference;   /* the fluid's density is rho (1 - expansion (T - reference)) */
  PetscReal   length, difference;     /* that its Nusselt number goes by; difference 0: none asked for */
  PetscBool   periodic_gradient;
  PetscReal   gradient[3];
} ScalarParameters;

/* A surface with a flux by place, time and scalars: place in the frame of a body at X that is turned by the matrix R
   (rows), X there is `origin` */
typedef struct {
  Expr      flux;
  PetscReal X[3], R[9], origin[3];
} ScalarSurface;

/* What samples of a cell are made of: midpoints of n^dim sub-cells in reference coordinates, first axis fastest.
   reaction r, source f: r T - f on the left side. */
typedef struct {
  PetscInt         n, cell;
  const PetscReal *capacity, *conductivity, *reaction, *source; /* [n^dim] */
  PetscInt         lump; /* of ScalarLumps: the reaction is towards its value, r (T - value); -1: towards 0 */
  PetscInt         body; /* whose surface cuts the cell */
  /* with a flux by an expression: the surface, area by volume of each sample [n^dim]; NULL: there is none */
  const ScalarSurface *surface;
  const PetscReal     *layer;
} ScalarSamples;

/* What cells are made of, borrowed until the next call; NULL arrays: the fluid alone */
typedef struct {
  const PetscReal     *capacity, *conductivity; /* [ncell_all]; conductivity < 0: no part of the problem */
  const PetscReal     *source;                  /* [ncell_all] in addition to the option's */
  const PetscReal     *decay; /* [ncell_all] likewise, rates of a first-order reaction; NULL: there is none */
  PetscInt             nsample;
  const PetscInt      *sample; /* [ncell_all] which of the nsample samples is it, -1: none */
  const ScalarSamples *samples;
  /* What counts in content and mean: [ncell_all] SCALAR_COUNTS_ALL of a cell, _NOTHING, or where in `outside` the parts
     of its noutside^dim sub-cells begin (in the order of ScalarSamples), of the fluid's capacity. NULL: all of all. */
  const PetscInt  *counts;
  const PetscReal *outside;
  PetscInt         noutside;
  /* Where sources and reactions of the options act, in the way of `counts`: parts of samples, which all have then.
     NULL: in all cells but those of samples. */
  const PetscInt *fluid;
} ScalarCells;
enum {
  SCALAR_COUNTS_ALL     = -1,
  SCALAR_COUNTS_NOTHING = -2
};

/* Nodes with a value that is no boundary condition [nnode_all] */
typedef struct {
  const PetscBool *fixed;
  const PetscReal *value;
  const PetscInt  *body; /* whose they are, where they are fixed */
} ScalarNodes;

/* Bodies with one value each, unknowns of the system: capacity (c_t T - d(T)) = source + what its nodes and samples
   take in. Borrowed for the step. */
typedef struct {
  PetscInt         n;                 /* that this rank knows */
  const PetscBool *is, *own;          /* [n] is it one? does this rank count it? */
  const PetscInt  *of_node;           /* [nnode_all] whose node is it, -1: nobody's */
  const PetscReal *capacity, *source; /* [n] of the equation */
  const PetscReal *content;           /* [n] capacity that its heat goes by */
  PetscReal       *value;             /* [n][stride] value at T^n, T^{n-1}, and as solved for */
  PetscInt         stride;
  PetscErrorCode (*sum)(void *, PetscReal v[]); /* v [n]: sums over all ranks. Collective. */
  void *ctx;
} ScalarLumps;

/* A side of a cell, beside those at boundaries, through which q - h T goes into it (sides as of fem/side.h) */
typedef struct {
  PetscInt             cell, side;
  PetscReal            q, h;
  const ScalarSurface *surface; /* says q; NULL: the number */
  PetscInt             body;    /* whose surface it is */
} ScalarSide;

/* Of a step; heat a time, positive into the domain; sums of all ranks */
typedef struct {
  PetscReal mean, min, max; /* at the end of the step, over the capacity that counts (ScalarCells); over nodes */
  PetscReal content;        /* int c T of what counts */
  PetscReal change;         /* int c (c_t T - d) */
  PetscReal convected;      /* int c w.grad T_theta, what leaves by convection */
  PetscReal source;         /* of sources, less reactions, and through ScalarSides */
  PetscReal boundary;       /* sum over boundaries */
  PetscReal nodes;          /* through nodes of ScalarNodes */
  PetscReal residual,
    size;              /* change + convected - source - boundary - nodes; sum of their sizes, of the change by place */
  PetscReal effective; /* with a mean gradient G: int k |grad T|^2 over |G|^2 and the box: effective conductivity, in a
                          flow with what it disperses along G; 0 without */
} ScalarBalance;

/* Read the options of all that -scalars names; NULL: none. Collective. Errors: unknown boundaries, conditions that
   exclude each other, a mean gradient on a mesh that is not periodic along it. */
PetscErrorCode ScalarsCreate(Mesh, Scalars *);
PetscErrorCode ScalarsDestroy(Scalars *);
PetscErrorCode ScalarsView(Scalars, PetscViewer);
PetscInt       ScalarsCount(Scalars);
PetscErrorCode ScalarsGetParameters(Scalars, PetscInt s, const ScalarParameters **);
/* Conductivity over capacity of the scalar of that name, by options that stay unread. Local. */
PetscErrorCode ScalarsPeekDiffusivity(const char scalar[], PetscReal *diffusivity);
/* T^n and T^{n-1} (may be NULL), writable; T' where there is a mean gradient. Borrowed until the next ScalarsAccept. */
PetscErrorCode ScalarsGetFields(Scalars, PetscInt s, PetscReal *T[], PetscReal *T_old[]);
/* The solution of the step before ScalarsAccept, T' where there is a mean gradient. Borrowed. */
PetscErrorCode ScalarsGetSolution(Scalars, PetscInt s, PetscReal *T[]);
/* Reads the scalar of that name in the output of a run, the value of an option, at x [nnode_all][dim] of nodes: T,
   synced. Collective. */
typedef PetscErrorCode (*ScalarsReader)(Mesh, const char option[], const char run[], const char scalar[],
                                        const PetscReal x[], PetscReal T[]);
/* Scalars with -scalar_<scalar>_initial_run begin with what it reads. Collective. */
PetscErrorCode ScalarsSetReader(Scalars, ScalarsReader);
/* The fields begin with the option's value, or what is read, at x [nnode_all][dim] in place of the nodes.
   Collective. */
PetscErrorCode ScalarsStartAt(Scalars, PetscInt s, const PetscReal x[]);
/* A step begins; cells and nodes as last told. Collective. */
PetscErrorCode ScalarsBeginStep(Scalars, const ScalarStep *);
PetscErrorCode ScalarsSetCells(Scalars, PetscInt s, const ScalarCells *);
/* Nodes count as shifted by so much, shift [nnode_all][dim], borrowed; NULL: they are where the mesh has them. */
PetscErrorCode ScalarsSetShift(Scalars, const PetscReal shift[]);
PetscErrorCode ScalarsSetNodes(Scalars, PetscInt s, const ScalarNodes *);
/* Of local cells, those of one cell in a row; borrowed until the next call. Not collective. */
PetscErrorCode ScalarsSetSides(Scalars, PetscInt s, PetscInt n, const ScalarSide side[]);
/* NULL: there are none. Not collective. */
PetscErrorCode ScalarsSetLumps(Scalars, PetscInt s, const ScalarLumps *);
/* From now on nodes in no cell of the problem get values after each solve, means of those around: bodies that move will
   free them. Not collective. */
PetscErrorCode ScalarsExtend(Scalars, PetscInt s);
/* Fluxes of sides of this scalar go by scalars. Not collective. */
PetscErrorCode ScalarsReact(Scalars, PetscInt s);
/* The convecting velocity of the ScalarsSolve that follows, and as a solution what is extrapolated to the step.
   Local. */
PetscErrorCode ScalarsPredict(Scalars, PetscInt s, const PetscReal w[]);
/* Solves for scalar s with the convecting velocity w [nnode_all][dim] (NULL: none). *reason < 0: failed. Collective. */
PetscErrorCode ScalarsSolve(Scalars, PetscInt s, const PetscReal w[], KSPConvergedReason *reason);
/* After all are solved for: solves again for those whose sources or fluxes go by scalars until these are what the
   values make of them, to -scalars_rtol, of steady ones to 1e-8. *failed: the scalar whose solver failed, with the
   reason, -1: none. Collective. Error: no steady state is found. */
PetscErrorCode ScalarsSettle(Scalars, PetscInt *failed, KSPConvergedReason *reason);
/* force [nnode_all][dim] += -density expansion (T_theta - reference) gravity, integrated over the part `fluid`
   [ncell_all] of own cells (NULL: 1; cells with samples: their weights by weight [cell's samples]), T extrapolated to
   the point theta of the step. Local. */
PetscErrorCode ScalarsAddBuoyancy(Scalars, PetscInt s, PetscReal density, const PetscReal gravity[3],
                                  const PetscReal fluid[], PetscReal force[]);
/* Balance of the step solved, and the heat a time that each boundary [nboundary] lets in. flux [bodies] += what bodies
   let into the fluid: through their fixed nodes, by sources and reactions of samples, through ScalarSides, of
   ScalarLumps; of this rank's cells; NULL: not wanted. Collective. */
PetscErrorCode ScalarsMeasure(Scalars, PetscInt s, ScalarBalance *, PetscReal boundary[], PetscReal flux[]);
/* Over local cell c in the step solved, with capacities in excess of the fluid's, c' (of a cell that is no part of the
   problem: minus the fluid's): what bodies bring into the balance. */
typedef struct {
  PetscReal capacity;  /* int c' */
  PetscReal content;   /* int c' T */
  PetscReal history;   /* int c' (d0 T^n + d1 T^{n-1}), with the values that the step began with */
  PetscReal convected; /* int c' w.grad T_theta */
} ScalarExcess;
/* Local, after ScalarsSolve or ScalarsPredict. */
PetscErrorCode ScalarsMeasureExcess(Scalars, PetscInt s, PetscInt c, ScalarExcess *);
/* Over the own cells of the problem, of this rank: int c T, int c d(T) and int c T_theta div V less what of it goes
   through boundaries, V [nnode_all][dim] the velocity of nodes (skip [ncell_all]: cells >= 0 move as a whole, NULL:
   none). After ScalarsSolve or ScalarsPredict, and ScalarsFindGrowing of the step. Local. */
PetscErrorCode ScalarsFindGrowing(Scalars, PetscInt s, const PetscReal V[], const PetscInt skip[]);
PetscErrorCode ScalarsMeasureGrowth(Scalars, PetscInt s, const PetscReal V[], const PetscInt skip[], PetscReal sum[3]);
/* int over local cell c of v [n^dim], by sub-cells as of ScalarSamples; n 0: of the number *v. Local. */
PetscErrorCode ScalarsIntegrate(Scalars, PetscInt c, PetscInt n, const PetscReal v[], PetscReal *sum);
/* int over local cell c of each of its functions: sum [nb of the mesh], none below zero. Local. */
PetscErrorCode ScalarsIntegrateBasis(Scalars, PetscInt c, PetscReal sum[]);
/* Area of every boundary [nboundary]. Collective. */
PetscErrorCode ScalarsGetAreas(Scalars, PetscReal area[]);
/* Has boundary b a value, a flux or a transfer coefficient? */
PetscBool ScalarsIsOpen(Scalars, PetscInt s, PetscInt b);
/* The step is taken. Collective. */
PetscErrorCode ScalarsAccept(Scalars);

/* Preconditioners that were kept, and which solvers have failed, are forgotten: what follows depends on the fields
   alone. Not collective. */
PetscErrorCode ScalarsRenewSolvers(Scalars);

/* Cells are rebuilt: matrices and conditions of the old mesh go; then the fields are carried to the new one. */
PetscErrorCode ScalarsDiscard(Scalars);
PetscErrorCode ScalarsRemesh(Scalars, Mesh old);
/* StateVisit of Scalars */
PetscErrorCode ScalarsVisitState(void *scalars, State);
