/* Finer: what elements of the next order, Q3 with P2, would find beside a steady solution of a flow: src/flow/finer.c.
   Called by run. Shapes, units and ownership: flow.h. */
#pragma once
#include "flow/flow.h"

typedef struct _p_FlowFiner *FlowFiner;
typedef struct {
  const PetscReal *load;        /* [nnode_all][dim], complete on own nodes: what is to be added to FlowRhs for it, where
                                   the system is linear about the solution (Newton's) */
  FlowVolume       volume;      /* and to continuity */
  PetscReal        velocity[3]; /* what it adds to int u */
  PetscReal        energy;      /* and to the kinetic energy */
  PetscReal        fraction;    /* int |grad|^2 of it over that of the flow */
} FlowFinerResult;
/* Has the flow one density and one viscosity, and nothing that participants add? Local. */
PetscBool FlowCanBeFiner(Flow);
/* given [nnode_all]: bits of components that are given at a node; u [nnode_all][dim]: the solution (synced). Copied.
   Collective. */
PetscErrorCode FlowFinerCreate(Flow, const unsigned char given[], const PetscReal u[], FlowFiner *);
PetscErrorCode FlowFinerDestroy(FlowFiner *);
/* Beside u (synced), p and what was found before; the result is that of all so far. Borrowed until the next call.
   Collective. */
PetscErrorCode FlowFinerFind(FlowFiner, const PetscReal u[], const PetscReal p[], const FlowFinerResult **);
/* Do residuals of cells, and so forces, count what was found? Local. */
PetscErrorCode FlowFinerCount(FlowFiner, PetscBool count);
