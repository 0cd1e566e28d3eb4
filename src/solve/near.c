/* FlowSolver: rows of the velocity matrix around bodies, for what couples them to the fluid around them in
   preconditioners (bodycoupling.h, cellrelax.h). With a product without a matrix these rows are all that a step needs
   of it. */
#include "compat.h"
#include "cellrelax.h"
#include "impl.h"

PetscErrorCode FlowSolverGatherRows(FlowSolver fs)
{
  PetscBool *marked;

  PetscFunctionBeginUser;
  fs->near = NULL;
  if (!FlowIsMatrixFree(fs->flow) || fs->relax != RELAX_JACOBI || fs->need_Ar || fs->need_whole) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(fs->loc->nnode_all, &marked));
  PetscCall(BodyCouplingMarkNodes(fs->constraint, marked));
  if (fs->two_stage && fs->relax_cells)
    PetscCall(CellRelaxMarkNodes(fs->loc, fs->constraint, fs->pressure, FlowSolverIsSoft(fs) ? fs->soft : NULL, marked));
  PetscCall(FlowGatherRows(fs->flow, marked, &fs->near_rows));
  fs->near = &fs->near_rows;
  PetscCall(PetscFree(marked));
  PetscFunctionReturn(PETSC_SUCCESS);
}
