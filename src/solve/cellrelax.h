/* CellRelax: one additive relaxation of the saddle point system on the cells that a body cuts, for preconditioners.

   In these cells the pressure operator with lumped masses is far off, and what remains is local. With the scalar block
   A_c of the velocity matrix over the free nodes of a cell, L = A_c^{-1} the same for all components, b_a the cell's
   divergence and e the residual,

     v_a = L e_a,   p_c = T^{-1} (e_p - sum_a b_a v_a),   v_a += L b_a^T p_c,   T = sum_a b_a L b_a^T + C + small I

   solves the cell's own system (Vanka 1986, additive). p_c is added to the pressure, v_a to the velocities,
   divided by the number of relaxed cells that share the node. Rigid velocities stay. A component that a wall prescribes
   has no part in e, b and v, but stays in A_c if another one of the node is free.

   Which cells: those with a part, but not the whole, in a body under a penalty; without a penalty those with nodes
   inside and outside of a body that the mesh does not line up with. */
#pragma once
#include "flow/flow.h"
#include "pressure/pressure.h"
#include "solve/constraint.h"
#include "solve/penaltyterm.h"

typedef struct _p_CellRelax *CellRelax;

/* Collective. */
PetscErrorCode CellRelaxCreate(Flow, Constraint, CellRelax *);
PetscErrorCode CellRelaxDestroy(CellRelax *);

/* Mark, in marked [nnode_all], the nodes whose rows of the matrix CellRelaxUpdate will want. Local. */
PetscErrorCode CellRelaxMarkNodes(const MeshLocal *, Constraint, Pressure, const PenaltyTerm *penalty,
                                  PetscBool marked[]);
/* New cells, matrix or penalty (NULL: none). rows: of FlowGatherRows with those nodes marked, or NULL: the matrix
   of FlowGetMatrix. scale: the continuity rows are multiplied by it. After PressureUpdate. Collective. */
PetscErrorCode CellRelaxUpdate(CellRelax, const Rows *rows, Pressure, const PenaltyTerm *penalty, PetscReal scale);
/* Number of relaxed cells on all ranks. Not collective. */
PetscErrorCode CellRelaxGetCount(CellRelax, PetscInt *n);

/* u += v, p += p_c for the residual e of the momentum rows [own nodes][dim], zero at inert slots, and r of the
   continuity rows [own cells][dim + 1]. Collective. */
PetscErrorCode CellRelaxApply(CellRelax, const PetscReal e[], const PetscReal r[], PetscReal u[], PetscReal p[]);
/* The same for arrays in the memory of a device: what belongs to relaxed cells comes to the host. Collective. */
PetscErrorCode CellRelaxApplyOnDevice(CellRelax, const PetscReal e[], const PetscReal r[], PetscReal u[],
                                      PetscReal p[]);
