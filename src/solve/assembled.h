/* Assembled: assembled forms of the projected operators, for preconditioners that need a matrix (direct solvers, hypre,
   GAMG, ILU). */
#pragma once
#include "pressure/pressure.h"
#include "rigid/rigid.h"

/* S for every component as one matrix, of own nodes that are wanted [own nodes]; of the others there is a 0 on the
   diagonal. Collective; caller destroys. */
PetscErrorCode AssembledCreateNodes(Flow, const PetscBool wanted[], Mat *A);
/* out = P^T A P + D with the identity on inert slots, and the part of a penalty (may be NULL); A: velocity matrix
   of all components, P of ConstraintCreateMat, D [nbodies][nr][nr]; with the ties, and what
   others have added to the flow (FlowAddOperator). Collective; caller destroys. */
PetscErrorCode AssembledCreateVelocity(Flow, Constraint, Mat A, Mat P, const PetscReal D[], const PenaltyTerm *,
                                       ContactCoupling, Mat *out);
/* B P, own pressures x u_r. Collective; caller destroys. */
PetscErrorCode AssembledCreateDivergence(Flow, Mat P, Mat *BP);
/* out = [Ar, -P^T B^T; balance scale B P, balance C'], with C' = gap_fraction times C of shared cells plus a tiny
   multiple of the Schur complement's size, which gives undetermined pressures a value. The outer iteration removes
   its effect. Collective; caller destroys. */
PetscErrorCode AssembledCreateWhole(Flow, Pressure, PetscReal scale, PetscReal balance, PetscReal gap_fraction, Mat P,
                                    Mat Ar, Mat *out);
