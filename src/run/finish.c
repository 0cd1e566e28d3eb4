/* Sim: the end of a run, what it tells once it is over. */
#include "compat.h"
#include "accuracy.h"
#include "simimpl.h"

static PetscErrorCode finish_flow(const SimComponents *part, PetscInt *cells, PetscInt *unknowns)
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

PetscErrorCode SimFinish(Sim s)
{
  PetscInt    cells = 0, unknowns = 0, removed;
  const char *dir;

  PetscFunctionBeginUser;
  PetscCall(BodiesOutflowGetRemoved(s->part.outflow, &removed));
  if (removed) PetscCall(MonitorQuantity(s->part.monitor, "bodies_removed", removed));
  PetscCall(FieldsGetDirectory(s->part.fields, &dir));
  PetscCall(SuspensionWrite(s->part.suspension, dir, s->step));
  PetscCall(StatisticsWrite(s->part.statistics, dir));
  if (s->adapt) PetscCall(AdaptFinish(s->adapt));
  PetscCall(LimitsFinish(s->limits, s->part.monitor));
  PetscCall(BooksFinish(s->books));
  if (s->part.flow) PetscCall(finish_flow(&s->part, &cells, &unknowns));
  else PetscCall(MonitorQuantity(s->part.monitor, "contact_substeps", s->substeps));
  PetscCall(CoresFinish(&s->cores, s->part.monitor));
  PetscCall(MonitorFinish(s->part.monitor, s->part.scene, cells, unknowns, s->step, s->time));
  PetscCall(CheckpointFinish(s->part.checkpoint, s->step, s->time));
  PetscFunctionReturn(PETSC_SUCCESS);
}
