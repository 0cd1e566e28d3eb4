/* Elastic: elastic solids in the flow, as a participant of the step (participant.h).

   One velocity field for fluid and solids: the nodes of a solid move with the flow, u_s = P u, P the flow's basis at
   their predicted positions x* (Boffi & Gastaldi 2003; Zhao, Freund & Moser 2008). With x^{n+1} = a + b dt u_s, as the
   scheme differentiates, the step stays one linear system: next to S every component has
     E = P^T (c_t m M_s + b dt K(x*) + V) P,   force P^T (m M_s d(u_s) + (rho_s - rho_f) M_s g - f(x*) - K (a - x*)),
   f the force of the law, K its tangent, M_s the mass of the reference mesh, V what a solid is more viscous. The fluid
   inside keeps its inertia: m = rho_s - rho_f. The isotropic part of a compressible solid is the pressure's,
   p = -kappa (J - 1): continuity of the cells inside reads B u + C p = g (FlowAddVolume), and an incompressible one has
   there the return of its volume, g alone; what the flow's pressures do not see of it is its law's (SOLID_BULK).

   A membrane is the same with the nodes of a surface, in whose E and force there is only K and f; inside is the fluid,
   and its volume is kept by a step of its nodes along the normal (SolidKeepVolume), which the flow does not see.

   With -couple_method aligned the flow's mesh is lined up with the solids at x* (elasticalign.h): the pressure may then
   jump at their surface. P is the basis in cells of the solid alone; inertia and weight are taken over these cells
   (elasticinertia.h), not over the solid's mesh: m = 0. */
#pragma once
#include "elasticale.h"
#include "elasticalign.h"
#include "elasticinertia.h"
#include "elastictension.h"
#include "couple/elasticsurfaces.h"
#include "pointcells.h"
#include "solid/solid.h"
#include "couple/couple.h"

/* Where points lie on this rank: cell -1 where another rank (or none) answers */
typedef struct {
  PetscInt   n, capacity;
  PetscInt  *cell;    /* [n] */
  PetscReal *xi;      /* [n][dim] */
  PetscBool *reached; /* [solids] may own cells hold points of it? Of nodes alone */
} ElasticPoints;

/* A node of an outline (in space: of a surface) that is pushed by what is near */
typedef struct {
  PetscInt  node, other[ELASTIC_SIDE]; /* the nodes of the side of a solid that it comes close to, with */
  PetscReal weight[ELASTIC_SIDE];      /* their part in the closest point; 0: it is none */
  PetscInt  body;                      /* rigid body, -1: none */
  PetscReal n[3], y[3];                /* away from it; the closest point */
  PetscReal force, rate;               /* at the predicted positions; what it loses for the way */
} ElasticContact;

/* Those of this step, found by this rank */
typedef struct {
  PetscInt        n, capacity;
  ElasticContact *list;
  PetscInt        nnear, near_capacity, *near; /* solids near the one that is looked at, */
  PetscReal (*image)[3];                       /* and where an image of them has its centre */
  PetscBool touched, joined;                   /* there were some; the matrix has entries of two solids */
} ElasticContacts;

/* Terms of continuity of own cells: C [][dim + 1][dim + 1], g [][dim + 1] */
typedef struct {
  PetscInt   n, capacity, *cell;
  PetscReal *C, *g;
} ElasticVolumes;

/* What happens once in a run */
typedef struct {
  PetscBool compared; /* sizes of cells, solids' and flow's */
  PetscBool told;     /* that a step was too long */
  PetscBool started;  /* velocities of the first step are those of the flow */
  PetscBool inside;   /* the fluid inside has taken the velocities of solids */
} ElasticOnce;

/* Part of the momentum that lining up changed in this step, and the largest of the run */
typedef struct {
  PetscReal change, largest;
  PetscInt  immersed;   /* steps of the run in which some solid was */
  PetscBool done, told; /* on this mesh: has it been lined up? */
} ElasticLineUps;

/* Where the mesh is lined up with solids in every step, how nodes move for scalars (feet.h), [nnode_all][dim] each;
   NULL: there are none */
typedef struct {
  Couple     c;
  PetscReal *way, *shift, *velocity;
} ElasticCarried;

typedef struct Elastic {
  Solids          solids;
  SolidsState    *s;
  ElasticSurfaces surfaces; /* outlines, for align, for ale at the start, to see what is close */
  PetscReal      *corner;   /* [][dim] theirs at the start, lent to the boundary method */
  PetscInt        nodes[2]; /* first node of all solids whose row this rank has, and the one after the last */
  /* of a step, [nnode][dim]: predicted positions x*, and what positions are without the velocity (a) */
  PetscReal        *x, *a, *u, *end; /* u: velocities as solved, end: positions at its end with them */
  ElasticPoints     node, point;     /* nodes of the solids; their quadrature points */
  Mat               P, K;            /* map, of each component the same; matrix of the solids, its upper half */
  Vec               us, fs, all;     /* velocities, forces: rows as K; all: the same on every rank */
  VecScatter        gather;
  PetscReal        *force;          /* [own nodes][dim] on the flow */
  PetscReal        *viscosity;      /* [ncell_all] of the flow, NULL: that of the parameters; see elasticinside.h */
  PetscReal        *lumped;         /* [nnode_all] inertia of solids that the mesh follows, NULL: immersed */
  PetscBool         aligned;        /* -couple_method aligned: alone, or */
  PetscBool         rebase, beside; /* after rigid bodies that stand still, at first; together with such as move */
  ElasticAlign      align;          /* NULL: immersed, or not yet */
  ElasticAlignKept *left;           /* while the cells of the mesh are made anew: of those before */
  ElasticInertia    inertia;        /* of solids that the mesh follows */
  ElasticAle        ale;            /* solids that are held: the mesh goes along; NULL: not so, or not yet */
  PetscBool         anchored;
  ElasticCarried    carried;
  ElasticLabels     labels; /* of this step, if there is one */
  ElasticLineUps    lineup;
  ElasticOnce       once;
  ElasticContacts   contacts;
  PetscBool        *within; /* [solids][solids] does the first start in the second, a membrane? NULL: there is none */
  ElasticVolumes    volumes;
  ElasticTensions   tensions;
  PetscReal         supplied; /* power of what prescribes velocities against the force of solids there, all ranks */
  PetscReal        *load;     /* [solids][dim] force on the flow in the step solved, all ranks */
  PetscReal        *kept;     /* [solids] error of the volume that was put right at the end of the step */
  PetscReal        *change;   /* [solids][dim] int c_t u_s - d(u_s) */
} Elastic;

/* Is solid k one that the mesh follows in this step? */
static inline PetscBool ElasticIsLined(const Elastic *e, PetscInt k)
{
  return (PetscBool)(e->align && e->labels.lined[k]);
}
/* What solid k is denser than the fluid, of which a membrane holds as much as it displaces */
PetscReal ElasticExcess(const Elastic *, Couple, PetscInt k);
/* The present step of the flow: positions that it predicts. */
PetscErrorCode ElasticPredict(Elastic *, Couple);
/* e->end, positions with the velocities of the step solved and the volumes that are to be kept; e->kept. Collective. */
PetscErrorCode ElasticFindEnd(Elastic *, Couple);
/* Where the points are, and with them P. Collective. Error: a node outside of the domain. */
PetscErrorCode ElasticMap(Elastic *, Couple);
/* The matrix of the solids, of the nodes of their cells and of what touches in a step. Collective. */
PetscErrorCode ElasticCreateMatrix(Elastic *, MPI_Comm);
/* K, force and the terms of continuity, given to the flow. Collective. */
PetscErrorCode ElasticAssemble(Elastic *, Couple);
/* Velocities of the nodes in the solution u [nnode_all][dim], into e->u on every rank. Collective. */
PetscErrorCode ElasticTakeVelocity(Elastic *, Couple, const PetscReal u[]);
/* elasticlineup.c: the mesh follows the solids at their predicted positions, e->labels; where it does no more, the old
   velocities of the flow are those of the material. Collective. */
PetscErrorCode ElasticLineUp(Elastic *, Couple);
/* Of a step that is accepted: what that changed of the momentum, a remark if it is large. Collective. */
PetscErrorCode ElasticRemarkLineUp(Elastic *, Couple);
/* elasticstart.c: once, before the first step, with the mesh lined up: the velocity of the flow changes by what
   velocities that solids start with make of the fluid inside. Collective. */
PetscErrorCode ElasticStartInside(Elastic *, Couple);
/* A membrane has no mass and pushes nothing as a whole: *size, of forces, += the pull across a cut through the middle
   of each, about. Collective. */
PetscErrorCode ElasticAddPull(const Elastic *, PetscReal *size);
/* Of the step solved: kinetic energy of what the flow does not count, strain energy, the power of the weight in excess
   of the fluid's and of what holds nodes of the flow. Collective, all ranks the same. */
PetscErrorCode ElasticAddEnergy(const Elastic *, Couple, CouplePower *);
/* 1/2 int |u|^2 of velocities u [nnode][dim] over the reference mesh of a solid, and int u; nothing of a membrane */
PetscReal ElasticMotion(const SolidMesh *, const PetscReal u[], PetscReal sum[3]);
/* Where the energy goes: their equations tested with the velocity of the end. Contact counts with the boundary method:
   it gives back what it took as bodies part. Collective. */
PetscErrorCode ElasticAddLosses(const Elastic *, Couple, CoupleLosses *);
/* CoupleLimitStep, CoupleOverstep (elasticlimit.c). Collective, all ranks the same. Errors: a step that is too short to
   go on with; with ElasticCheckStep, of the step solved: a cell that turns inside out, a volume that is lost. */
PetscErrorCode ElasticLimitStep(const Elastic *, Couple, PetscReal *dt);
PetscErrorCode ElasticCheckStep(const Elastic *, Couple);
PetscErrorCode ElasticOverstep(const Elastic *, Couple, PetscReal *ratio);
/* elasticscalars.c. Scalars know solids as materials; without scalars nothing happens. All collective. Errors: of
   CoupleAddPhases. Once: */
PetscErrorCode ElasticAddPhases(Elastic *, Couple);
/* On every mesh: scalars go along with its nodes */
PetscErrorCode ElasticCarryScalars(Elastic *, Couple);
/* They begin, if they have not, with solids where they start */
PetscErrorCode ElasticStartPhases(Elastic *, Couple);
/* Which cells, and parts of cells, are solids with their nodes at x */
PetscErrorCode ElasticSetPhases(Elastic *, Couple, const PetscReal x[]);
