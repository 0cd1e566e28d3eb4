/* Lean Krylov methods: as PETSc's, with fewer vectors and fewer points at which ranks wait for each other.

   lean_fgmres, lean_gmres: GMRES with the preconditioner on the right (flexible: Saad 1993), vectors taken one by one
   as iterations need them; PETSc's take ten and ten. lean_fgmres holds two an iteration, and the preconditioner may
   vary; lean_gmres holds one, and applies it once more at the end of all but short solves. The preconditioned vectors
   are held in single precision: rounding is part of the preconditioner, since the operator is applied to what is held.
   So are the Krylov vectors where the tolerance is 1e-5 or looser. Options: -ksp_gmres_restart (60);
   KSPGMRESSetRestart works. Where they start anew the convergence test is not asked twice.

   lean_cg: conjugate gradients with one reduction an iteration (Chronopoulos & Gear 1989), which knows the norm of the
   next residual as well; a null space of one vector is taken from the correction alone, once. Three vectors for
   residual, preconditioned residual and direction, two for their products.

   All: norm types unpreconditioned (lean_cg: preconditioned and natural, too), preconditioner on their side only. */
#pragma once
#include <petscksp.h>

#define LEAN_FGMRES "lean_fgmres"
#define LEAN_GMRES  "lean_gmres"
#define LEAN_CG     "lean_cg"

/* Make the three types known to PETSc; again does nothing. Not collective. */
PetscErrorCode LeanRegister(void);

/* During a solve of lean_fgmres, asked by its convergence test: entries [begin, end) of this rank's part of the
   iterate and of the one before; both [end - begin]. Not collective. */
PetscErrorCode LeanGetIterates(KSP, PetscInt begin, PetscInt end, PetscReal now[], PetscReal before[]);
/* single: vectors may be kept in single precision, as they are before this. The last `tail` own entries of the unknowns
   are in another unit than those before (0): what is rounded is so in units of the largest of its kind. Nothing happens
   where the solver is not a lean GMRES. Not collective. */
PetscErrorCode LeanSetPrecision(KSP, PetscBool single, PetscInt tail);
/* Two vectors that the GMRES may use while they solve, in place of their own; the operator and the preconditioner must
   not use them. KSPBuildResidual works until w is written. w may be a right-hand side, which is then spent; t may be
   NULL. Nothing happens where the solver is another. Not collective. */
PetscErrorCode LeanSetWork(KSP, Vec w, Vec t);
