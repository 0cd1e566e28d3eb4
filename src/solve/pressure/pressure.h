/* Pressure: the projected pressure operator S_p = B_r M_r^{-1} B_r^T + eps B_c M_c^{-1} B_c^T and its two-level
   preconditioner.

   The part of the nodes has a fixed pattern (cells that share a node) and is a matrix; rows of cells away from any
   change of the constraint are kept. The part of bodies with unknown rigid velocities, W W^T = sum of B R_k M_k^{-1} (B
   R_k)^T, is of rank 3 (6 in 3D) a body and is applied, not stored; preconditioners other than the default see the
   matrix alone. Default preconditioner (options under -flow_fieldsplit_pressure_): PCMG with two levels, discontinuous
   P1 -> continuous Q1 on the vertices (coarse.h), block Gauss-Seidel on the fine level, BoomerAMG (GAMG where hypre is
   missing) on the coarse one. Where options say no more of it than that, both are done by cycles of our own, which are
   the same but for round-off (pressurecycle.c, vcycle.h). */
#pragma once
#include "../rigid/rigid.h"
#include "flow/flow.h"

typedef struct _p_Pressure *Pressure;

/* Options for the default preconditioner; the command line wins. */
PetscErrorCode PressureSetDefaults(void);
PetscErrorCode PressureCreate(Flow, Constraint, Pressure *);
PetscErrorCode PressureDestroy(Pressure *);
/* Ties between bodies whose part in M_r belongs to the operator, not to its preconditioner. Borrowed. */
PetscErrorCode PressureSetContactCoupling(Pressure, ContactCoupling);

/* eps of the design's section 4: share of their inverse mass that the nodes of body k keep. None at resolved walls: no
   cell is cut there, and fluid on one side only would make a wall that yields take constant pressures out of the null
   space. */
PetscReal PressureGetRegularisation(Pressure, PetscInt k);

/* All masses here are divided by rho c_t: S_p belongs to continuity rows multiplied by rho c_t, and does not depend on
   the time step. weight [nnode_all][dim]: inverse mass of every nodal slot (zero at walls), with the penalty where
   a body holds the node softly; fraction [nnode_all]: what part of the motion of its body such a node takes up at
   once (1: lies in the body, 0: free), NULL if only nodes inside matter; mass_inverse [nbodies][nr][nr]: inverse of
   the bodies' blocks of M_r, zero for known degrees of freedom. Collective. */
PetscErrorCode PressureUpdate(Pressure, const PetscReal weight[], const PetscReal fraction[],
                              const PetscReal mass_inverse[]);
/* The weights of the last update, where they stay. Borrowed. Not collective. */
PetscErrorCode PressureGetWeight(Pressure, const PetscReal *weight[]);

/* Cells of the flow that are about to change (FlowUpdateCells): the parts of all operators that depend on the n listed
   local cells are taken out, with the shapes they still have. Collective. */
PetscErrorCode PressureForgetCells(Pressure, PetscInt n, const PetscInt cells[]);
/* After the change: cell_material [ncell_all] < 0 for cells that are no part of the fluid (kept as a pointer), resolved
   [nbodies]: the mesh lines up with this body. Their pressures get the identity as block. Collective. */
PetscErrorCode PressureSetInactive(Pressure, const PetscInt cell_material[], const PetscBool resolved[]);

/* Compressibility C of cells between two constrained surfaces, the first ncompressible, and the identity in inactive
   cells: cells [n] and blocks [n][nk][nk]. Part of the system's operator (B u + C p = 0) and of S_p. After
   PressureUpdate. */
PetscErrorCode PressureHasShared(Pressure, PetscBool *any); /* such a cell on any rank; not collective */
PetscErrorCode PressureGetShared(Pressure, PetscInt *n, PetscInt *ncompressible, const PetscInt *cell[],
                                 const PetscReal *block[]);

/* Take from pressure [own cells][dim + 1] its mean over the fluid, the null space of closed domains. Collective. */
PetscErrorCode PressureRemoveConstant(Pressure, PetscReal pressure[]);
/* Is the constant pressure in the null space (closed domain, no shared cells)? After PressureUpdate. */
PetscErrorCode PressureIsSingular(Pressure, PetscBool *singular);

/* Take from r [own cells][dim + 1], a residual of continuity, what no velocity can cause: in closed domains its sum,
   from the cells with flow, and all of it in cells inside of bodies. It is round-off, but spread over all cells it
   would be divided by the softness of the latter, a million times larger than the pressures that matter. After
   PressureUpdate, on a device (r in its memory) after the solver's set-up. Collective. */
PetscErrorCode PressureMakeConsistent(Pressure, PetscReal r[]);

/* On a device (flow/device.h): y [own cells][dim + 1] += C x there, of which fraction of compressible cells. After the
   solver's set-up. Local. */
PetscErrorCode PressureSharedOnDevice(Pressure, PetscReal fraction, const PetscReal x[], PetscReal y[]);

/* The operator and the matrix for preconditioners (the same object when no body is unknown). Borrowed. */
PetscErrorCode PressureGetMats(Pressure, Mat *operator, Mat * matrix);
/* Its diagonal. */
PetscErrorCode PressureGetDiagonal(Pressure, Vec);
/* Give the two-level interpolation to the solver's preconditioner if that is PCMG with two levels. */
PetscErrorCode PressureSetUpPC(Pressure, KSP);
