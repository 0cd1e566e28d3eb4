/* Lagged: a preconditioner of a matrix that changes in a few rows at a time, without its set-up every time.

   A multigrid hierarchy M of the matrix A_0 costs several times what one application does. When bodies move, rows near
   their surfaces alone change, by orders of magnitude where a node goes from fluid to body. M is kept, and the
   two-level cycle

     forward Gauss-Seidel sweep with A,   x += D M^{-1} D (b - A x),   backward sweep,   D_i = min(1, sqrt(A_0ii/A_ii))

   corrects it: D takes back where A has grown, so that the old hierarchy does not overshoot there (which sweeps cannot
   make good), the sweeps supply what is missing where A has shrunk (runs/studies/flow-solver, "Many bodies"). They go
   over the rows that have changed, so that the correction costs next to nothing. M is built anew when more than a share
   of the diagonal has changed by a tenth. While nothing has changed, the application is that of M alone. Symmetric and
   positive definite if A and M are, however far apart these are. The sweeps are those of the rank's own rows.

   hypre's BoomerAMG with the smoothers of this program gives its levels to a VCycle (vcycle.h), whose finest matrix is
   always A: its sweeps take the place of these, and the levels below see A as D A D. */
#pragma once
#include <petscksp.h>

/* Turn pc, of whatever type, into a lagged one, whose M has the options of pc (prefix; no type there: PETSc's default).
   keep: fraction of the rows that may change before M is built anew, 0: at every change. Collective; errors: of the
   options. */
PetscErrorCode LaggedCreate(PC pc, PetscReal keep);

/* The matrix is A now, another one or the one of before with new values (no call where there are none). Not needed
   afterwards. Collective. */
PetscErrorCode LaggedUpdate(PC pc, Mat A);
