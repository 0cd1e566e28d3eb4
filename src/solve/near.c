/* FlowSolver: rows of the velocity matrix around bodies, for what couples them to the fluid around them in
   preconditioners (bodycoupling.h, cellrelax.h). With a product without a matrix these rows are all that a step needs
   of it. */
#include "compat.h"
#include "cellrelax.h"
#include "impl.h"
#include "flow/device.h"

/* Are cut cells relaxed, whose blocks are made of rows? */
static PetscBool relaxes_cells(FlowSolver fs)
{
  return (PetscBool)(FlowSolverTwoStages(fs) && fs->choice.relax_cells);
}

PetscBool FlowSolverCouplesOnDevice(FlowSolver fs)
{
  return (PetscBool)(FlowStaysOnDevice(fs->flow) && !relaxes_cells(fs));
}

PetscErrorCode FlowSolverGatherRows(FlowSolver fs)
{
  PetscBool *marked;

  PetscFunctionBeginUser;
  fs->body.near = NULL;
  if (!FlowIsMatrixFree(fs->flow) || fs->choice.smoother != RELAX_JACOBI || fs->set.need_Ar || fs->set.need_whole)
    PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(fs->loc->nnode_all, &marked));
  PetscCall(BodyCouplingMarkNodes(fs->constraint, marked));
  if (relaxes_cells(fs))
    PetscCall(CellRelaxMarkNodes(fs->loc, fs->constraint, fs->pressure,
                                 FlowSolverHasPenalty(fs) ? fs->body.penalty : NULL, marked));
  PetscCall(FlowGatherRows(fs->flow, marked, &fs->body.near_rows));
  fs->body.near = &fs->body.near_rows;
  PetscCall(PetscFree(marked));
  PetscFunctionReturn(PETSC_SUCCESS);
}
