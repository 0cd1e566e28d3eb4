/* Finish: see finish.h. */
#include "compat.h"
#include "finish.h"
#include "accuracy.h"

PetscErrorCode FinishFlow(const SimParts *part, PetscInt *cells, PetscInt *unknowns)
{
  const MeshLocal *l;
  FlowSolver       solver;
  PetscInt         ncut, nbodies;
  PetscReal        separation, meshes, residuals;
  PetscBool        measure;
  Mat              S;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(part->mesh, &l));
  PetscCall(CoupleGetSolver(part->couple, &solver));
  PetscCall(FlowSolverGetUnknowns(solver, unknowns));
  PetscCall(CoupleGetLoad(part->couple, &ncut, &nbodies));
  PetscCall(MonitorBalance(part->monitor, "cells", l->ncell));
  PetscCall(MonitorBalance(part->monitor, "nodes", l->nnode));
  PetscCall(MonitorBalance(part->monitor, "ghost_nodes", l->nnode_all - l->nnode));
  PetscCall(MonitorBalance(part->monitor, "body_cells", ncut));
  PetscCall(MonitorBalance(part->monitor, "bodies", nbodies));
  PetscCall(DiagnosticsFinish(part->diagnostics));
  PetscCall(AccuracyEstimate(part));
  PetscCall(AccuracyEstimateInTime(part));
  PetscCall(ContactGetSeparation(part->contact, &separation));
  if (separation > 0) PetscCall(MonitorQuantity(part->monitor, "separation_max", separation));
  PetscCall(RefineReport(part->refine));
  PetscCall(CoupleGetDropped(part->couple, &meshes, &residuals));
  if (meshes > 0) PetscCall(MonitorQuantity(part->monitor, "residual_dropped_new_mesh", meshes));
  if (residuals > 0) PetscCall(MonitorQuantity(part->monitor, "residual_dropped_large", residuals));
  PetscCall(MonitorEnd(part->monitor, &measure));
  if (measure) {
    PetscCall(FlowGetMatrix(part->flow, &S));
    PetscCall(MonitorBandwidth(part->monitor, S));
  }
  *cells = l->ncell_global;
  PetscFunctionReturn(PETSC_SUCCESS);
}
