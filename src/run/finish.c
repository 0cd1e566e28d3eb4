/* Sim: the end of a run, what it tells once it is over. */
#include "compat.h"
#include "accuracy.h"
#include "scalarlayers.h"
#include "simimpl.h"

static PetscErrorCode finish_flow(const SimComponents *sim, PetscInt *cells, PetscInt *unknowns)
{
  const MeshLocal *l;
  FlowSolver       solver;
  PetscInt         ncut, nbodies;
  PetscReal        separation, meshes, residuals;
  PetscBool        measure;
  Mat              S;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(sim->mesh, &l));
  PetscCall(CoupleGetSolver(sim->couple, &solver));
  PetscCall(FlowSolverGetUnknowns(solver, unknowns));
  PetscCall(CoupleGetLoad(sim->couple, &ncut, &nbodies));
  PetscCall(MonitorBalance(sim->monitor, "cells", l->ncell));
  PetscCall(MonitorBalance(sim->monitor, "nodes", l->nnode));
  PetscCall(MonitorBalance(sim->monitor, "ghost_nodes", l->nnode_all - l->nnode));
  PetscCall(MonitorBalance(sim->monitor, "body_cells", ncut));
  PetscCall(MonitorBalance(sim->monitor, "bodies", nbodies));
  PetscCall(DiagnosticsFinish(sim->diagnostics));
  PetscCall(ScalarLayersFinish(sim->scalar_layers));
  PetscCall(AccuracyEstimate(sim));
  PetscCall(AccuracyEstimateInTime(sim));
  PetscCall(ContactGetSeparation(sim->contact, &separation));
  if (separation > 0) PetscCall(MonitorQuantity(sim->monitor, "separation_max", separation));
  PetscCall(RefineReport(sim->refine));
  PetscCall(CoupleGetDropped(sim->couple, &meshes, &residuals));
  if (meshes > 0) PetscCall(MonitorQuantity(sim->monitor, "residual_dropped_new_mesh", meshes));
  if (residuals > 0) PetscCall(MonitorQuantity(sim->monitor, "residual_dropped_large", residuals));
  PetscCall(MonitorEnd(sim->monitor, &measure));
  if (measure) {
    PetscCall(FlowGetMatrix(sim->flow, &S));
    PetscCall(MonitorBandwidth(sim->monitor, S));
  }
  *cells = l->ncell_global;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimFinish(Sim s)
{
  PetscInt    cells = 0, unknowns = 0, removed;
  const char *dir;

  PetscFunctionBeginUser;
  PetscCall(BodiesOutflowGetRemoved(s->components.outflow, &removed));
  if (removed) PetscCall(MonitorQuantity(s->components.monitor, "bodies_removed", removed));
  PetscCall(FieldsGetDirectory(s->components.fields, &dir));
  PetscCall(SuspensionWrite(s->components.suspension, dir, s->step));
  PetscCall(StatisticsWrite(s->components.statistics, dir));
  if (s->adapt) PetscCall(AdaptFinish(s->adapt));
  PetscCall(TimeErrorFinish(s->components.time_error));
  PetscCall(LimitsFinish(s->limits, s->components.monitor));
  PetscCall(BooksFinish(s->books));
  if (s->components.flow) PetscCall(finish_flow(&s->components, &cells, &unknowns));
  else PetscCall(MonitorQuantity(s->components.monitor, "contact_substeps", s->substeps));
  PetscCall(CoresFinish(&s->cores, s->components.monitor));
  PetscCall(MonitorFinish(s->components.monitor, s->components.scene, cells, unknowns, s->step, s->time));
  PetscCall(CheckpointFinish(s->components.checkpoint, s->step, s->time));
  PetscFunctionReturn(PETSC_SUCCESS);
}
