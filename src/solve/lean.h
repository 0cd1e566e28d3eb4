/* Lean Krylov methods: as PETSc's, with fewer vectors and fewer points at which ranks wait for each other.

   lean_fgmres, lean_gmres: GMRES with the preconditioner on the right (flexible: Saad 1993), vectors taken one by one
   as iterations need them; PETSc's take ten and ten. lean_fgmres holds two an iteration, and the preconditioner may
   vary; lean_gmres holds one, and applies it once more at the end. Options: -ksp_gmres_restart (60); KSPGMRESSetRestart
   works. Where they start anew the convergence test is not asked twice.

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

/* During or after a solve of the two GMRES: the iterate is base + sum_j now[j] z[j], the one before base + sum_j
   before[j] z[j], j < n; both arrays [n]. lean: false, and nothing else set, where the solver is not lean_fgmres.
   Arrays and vectors are borrowed until the next iteration. Not collective. */
PetscErrorCode LeanGetIterates(KSP, PetscBool *lean, Vec *base, PetscInt *n, const Vec *z[], const PetscReal *now[], const PetscReal *before[]);
/* Vectors of lean_gmres to work with between solves, laid out as its right-hand side; what KSPBuildResidual needs is in
   them until then. lean: false, and nothing else set, where the solver is another. Borrowed until the next solve.
   Collective. */
PetscErrorCode LeanBorrow(KSP, PetscInt n, PetscBool *lean, Vec v[]);
/* A vector that lean_gmres may use while it solves, in place of one of its own; the operator and the preconditioner
   must not use it. Not collective. */
PetscErrorCode LeanSetWork(KSP, Vec);
