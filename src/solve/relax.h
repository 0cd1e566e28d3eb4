/* Relax: approximate inverses of the velocity matrix, one scalar matrix for all components, in one pass over its
   entries for all of them.

   Jacobi: the diagonal alone, which is all that a velocity operator without a matrix gives. On the rank's own part of
   the matrix: SOR sweeps (omega 1), or an incomplete factorisation without fill-in (ILU(0):
   Meijerink & van der Vorst 1977; Saad 2003, ch. 10), whose factors are stored in single precision. Where convection
   outweighs inertia and viscosity within a cell, sweeps against the flow amplify what they should damp, and the
   factorisation does not care. It costs as much as some ten sweeps (runs/studies/flow-solver).
   Factors that amplify are not used: SOR is, until the next update.

   Arrays are [own nodes][dim]. Inert slots (walls, nodes of bodies) have diagonal_inverse 0 and keep zero corrections.
   Nothing here is collective. */
#pragma once
#include <petscmat.h>

typedef struct _p_Relax *Relax;

typedef enum {
  RELAX_JACOBI,
  RELAX_SOR,
  RELAX_ILU
} RelaxKind;

/* n own nodes. */
PetscErrorCode RelaxCreate(PetscInt n, PetscInt dim, Relax *);
PetscErrorCode RelaxDestroy(Relax *);

/* New values in the scalar matrix S (rows: own nodes; Jacobi: NULL), borrowed: diagonal_inverse [n][dim] of it, zero at
   inert slots, borrowed. S must keep its pattern. */
PetscErrorCode RelaxUpdate(Relax, RelaxKind, Mat S, const PetscReal diagonal_inverse[]);

/* its sweeps in the directions of the flag from x, or from zero as the flag says; with a factorisation x = (LU)^{-1} b,
   with Jacobi D^{-1} b. Error: more than one of these two, or a start value. */
PetscErrorCode RelaxApply(Relax, MatSORType flag, PetscInt its, const PetscReal b[], PetscReal x[]);
