/* Solids: elastic particles, groups of -particle_groups with a -particle_<group>_material other than rigid: elastic
   solids, and membranes, without mass, around a fluid of the flow's own density.

   A group has one reference mesh (reference.h) of its shape, its law and density; a solid is a copy of that mesh with
   positions and velocities of its nodes at the last two times: these are all its state. All ranks know all solids;
   what is worked out of one alone is worked out by one rank, which gives it to the others (SolidsExchange). The room
   knows no flow; couple/elastic.c ties solids to one, and without a flow SolidsAdvance moves them by themselves, all on
   every rank. Lengths, masses and times in the units of the scene. */
#pragma once
#include "base/expr.h"
#include "base/state.h"
#include "solid/element.h"

/* Cells of solids in a flow, cells of the flow: smaller ones, so that a solid feels all that the flow's nodes in it can
   do. Where its nodes are fewer some of that has no stiffness, and the solid is too soft, by an amount that is that of
   the mesh (runs/studies/elastic). */
#define SOLID_FINER 0.6667
/* SolidMaterial.bulk of incompressible solids over their shear modulus. The pressure of the flow holds their volume in
   its own cells, with one polynomial each; nothing else holds it at points, whose errors grew to that of the volume
   itself where a solid was squeezed, until it crumpled (runs/studies/elastic). */
#define SOLID_BULK 10

typedef struct {
  char          name[64];
  Shape         shape;
  SolidMesh     mesh;
  SolidMaterial material;  /* kappa 0; lambda 0 where it is incompressible */
  PetscReal     stiffness; /* as a pressure: the shear modulus, of a membrane over its radius */
  PetscBool     compressible, membrane;
  PetscReal     density, viscosity;
  PetscReal     inner_viscosity; /* of what a membrane encloses, 0: as around it */
  PetscInt      first, count;    /* of the solids; those of several are neither held nor watched */
  PetscReal    *start;           /* [count][RigidSize] velocities at the start; NULL: those of the flow */
  PetscBool    *clamped;         /* [mesh.nnode] */
  PetscInt      nclamped;
  PetscInt      nwatch, *watch; /* nodes of the reference mesh that are watched */
  PetscReal    *watched;        /* [nwatch][dim] where they are in space at the start */
} SolidGroup;

/* Read-only but for the arrays of nodes */
typedef struct {
  MPI_Comm          comm;
  PetscInt          dim, ngroups, n; /* n: solids */
  PetscInt          own[2];          /* those from own[0] to before own[1] are this rank's to work out */
  const PetscInt   *start;           /* [ranks + 1] own[0] of all */
  const SolidGroup *group;
  const PetscInt   *group_of;              /* [n] */
  const PetscInt   *first;                 /* [n + 1] first node of a solid */
  PetscInt          nnode;                 /* of all solids */
  PetscReal        *X;                     /* [nnode][dim] in space at the start, */
  PetscReal        *x, *x_old, *u, *u_old; /* positions and velocities now and a step before */
  PetscReal        *tension;               /* [n] of membranes whose area is held as a whole, else 0 */
  PetscReal         time_dt;               /* length of the last step, 0: none so far */
} SolidsState;

/* Is some of them a membrane, or (false) something else? */
static inline PetscBool SolidsHave(const SolidsState *s, PetscBool membrane)
{
  for (PetscInt g = 0; g < s->ngroups; g++)
    if (s->group[g].membrane == membrane) return PETSC_TRUE;
  return PETSC_FALSE;
}

typedef struct _p_Solids *Solids;

/* Read the options of all elastic groups, make their meshes (cells of `size` unless they say otherwise) and place
   their solids; *solids is NULL if there are none. lower, upper [3]: of the domain. Collective. Errors: a shape that
   cannot be followed, options that contradict each other. */
PetscErrorCode SolidsCreate(MPI_Comm, PetscInt dim, PetscReal size, const PetscReal lower[3], const PetscReal upper[3],
                            Solids *);
PetscErrorCode SolidsDestroy(Solids *);
PetscErrorCode SolidsGetState(Solids, SolidsState **);
/* v [n][width], or [nnode][width] by nodes: each rank has those of its own solids, afterwards those of all. Collective.
 */
PetscErrorCode SolidsExchange(const SolidsState *, PetscInt width, PetscReal v[]);
PetscErrorCode SolidsExchangeNodes(const SolidsState *, PetscInt width, PetscReal v[]);
/* Does some membrane enclose a fluid of another viscosity than that around it? */
PetscBool SolidsHaveInnerFluid(Solids);
/* How many membranes have a modulus of the area as a whole */
PetscInt       SolidsCountGlobalAreas(Solids);
PetscErrorCode SolidsView(Solids, PetscViewer);

/* Sums of solid k as it is now. */
void SolidsMeasure(Solids, PetscInt k, SolidSums *);
/* The step is taken: x, u [nnode][dim] and the tensions [n] are those of its end (NULL: there are none). */
PetscErrorCode SolidsAccept(Solids, PetscReal dt, const PetscReal x[], const PetscReal u[], const PetscReal tension[]);
/* A step without flow under this gravity [dim]: Newton's method, bdf2 (the first step implicit Euler). Collective.
   Error: Newton's method fails. */
PetscErrorCode SolidsAdvance(Solids, PetscReal dt, const PetscReal gravity[]);
/* Positions x [nnode][dim] of the nodes of solid k, predicted for the end of a step dt, become those that it would take
   by itself from there: density M (x' - x)/dt^2 + f(x') = 0, nearly (three steps of Newton's method); where that fails
   they stay. What turns as a rigid body is predicted with a strain that is not there; linearised about that a stiff
   solid is unstable. Not for membranes. Not collective. */
PetscErrorCode SolidsRelax(Solids, PetscInt k, PetscReal dt, PetscReal x[]);
/* StateVisit of Solids. */
PetscErrorCode SolidsVisitState(void *solids, State);
