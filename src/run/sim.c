/* Sim: see sim.h. One pass of the loop is the method: contact forces, bodies drawn, flow solved, forces
   read, bodies moved, reports (src/README.md follows a step). Seconds count by phase, as in the method's cost table. */
#include "compat.h"
#include "flow/device.h"
#include "simimpl.h"
#include "accuracy.h"
#include "gauge.h"
#include "contactphase.h"
#include "base/interrupt.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "scalarlayers.h"
#include "couple/scalars.h"
#include "report/dropfields.h"
#include "report/solidfields.h"

static PetscErrorCode visit_state(void *sim, State state)
{
  Sim      s   = sim;
  PetscInt has = s->has_acceleration;

  PetscFunctionBeginUser;
  PetscCall(StateInts(state, "step", 1, &s->step));
  PetscCall(StateInts(state, "substeps", 1, &s->substeps));
  PetscCall(StateReals(state, "time", 1, &s->time));
  PetscCall(StateReals(state, "dt_old", 1, &s->dt_old));
  PetscCall(StateInts(state, "has_acceleration", 1, &has));
  s->has_acceleration = (PetscBool)has;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The order is that of loading: what others depend on comes first */
static PetscErrorCode add_states(Sim s)
{
  const SimComponents *p = &s->components;

  PetscFunctionBeginUser;
  if (s->trial) {
    PetscCall(RefineConnect(p->refine, p->flow, p->couple, s->adapt, s->limits, NULL, p->monitor));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(CheckpointAdd(p->checkpoint, "sim", s, visit_state));
  PetscCall(CheckpointAdd(p->checkpoint, "bodies", p->bodies, BodiesVisitState));
  PetscCall(RefineConnect(p->refine, p->flow, p->couple, s->adapt, s->limits, p->checkpoint, p->monitor));
  if (p->flow) PetscCall(CheckpointAdd(p->checkpoint, "flow", p->flow, FlowVisitState));
  if (p->frame) PetscCall(CheckpointAdd(p->checkpoint, "frame", p->frame, FrameVisitState));
  if (p->flow) PetscCall(CheckpointAdd(p->checkpoint, "couple", p->couple, CoupleVisitState));
  if (p->solids) PetscCall(CheckpointAdd(p->checkpoint, "solids", p->solids, SolidsVisitState));
  PetscCall(CheckpointAdd(p->checkpoint, "contact", p->contact, ContactVisitState));
  PetscCall(CheckpointAdd(p->checkpoint, "output", p->fields, FieldsVisitState));
  if (s->books) PetscCall(CheckpointAdd(p->checkpoint, "energy", s->books, BooksVisitState));
  if (s->adapt) PetscCall(CheckpointAdd(p->checkpoint, "adapt", s->adapt, AdaptVisitState));
  if (p->time_error) PetscCall(CheckpointAdd(p->checkpoint, "timeerror", p->time_error, TimeErrorVisitState));
  PetscCall(CheckpointAdd(p->checkpoint, "limits", s->limits, LimitsVisitState));
  if (p->gauge) PetscCall(CheckpointAdd(p->checkpoint, "gauge", p->gauge, GaugeVisitState));
  if (p->statistics) PetscCall(CheckpointAdd(p->checkpoint, "statistics", p->statistics, StatisticsVisitState));
  PetscCall(CheckpointAdd(p->checkpoint, "bodyfile", p->outlines, OutlinesVisitState));
  if (s->bond_report) PetscCall(CheckpointAdd(p->checkpoint, "bonds", s->bond_report, BondReportVisitState));
  PetscCall(CheckpointAdd(p->checkpoint, "monitor", p->monitor, MonitorVisitState));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimCreate(const SimComponents *components, Sim *sim)
{
  Sim       s;
  PetscReal energy;
  PetscBool springs, gauged = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->components = *components;
  s->trial      = (PetscBool)(components->checkpoint == NULL);
  s->dt         = 0.01;
  s->time_end   = PETSC_MAX_REAL;
  s->steps_max  = PETSC_MAX_INT;
  if (components->steady) PetscCall(SteadyRefuseTime());
  PetscCall(OptReal("-sim_dt", &s->dt));
  PetscCall(OptReal("-sim_time", &s->time_end));
  PetscCall(OptInt("-sim_steps", &s->steps_max));
  if (components->steady) s->dt = s->time_end = 0;
  PetscCheck(s->time_end < PETSC_MAX_REAL || s->steps_max < PETSC_MAX_INT, components->comm, PETSC_ERR_USER_INPUT,
             "The run has no end: give -sim_time or -sim_steps");
  PetscCall(BodiesGetState(components->bodies, &s->s));
  s->dt_old = s->dt;
  *sim      = s;
  PetscCall(FieldsGetInterval(components->fields, &s->interval));
  PetscCall(SimCreateLimits(s));
  s->fields_good = -1;
  PetscCall(BodiesGetSpringEnergy(components->bodies, &energy, &springs));
  s->spring_column = -1;
  if (springs) PetscCall(MonitorAddColumn(components->monitor, "spring_energy", &s->spring_column));
  if (!s->trial) PetscCall(BondReportCreate(components, &s->bond_report));
  if (!s->trial) PetscCall(BooksCreate(components, &s->books));
  if (!s->trial) PetscCall(SolidReportCreate(components, &s->solid_report));
  if (!s->trial) PetscCall(DropReportCreate(components, &s->drop_report));
  PetscCall(AccuracyIsGauged(components, s->trial, &gauged));
  if (gauged)
    PetscCall(
      GaugeCreate(components, s->time_end < PETSC_MAX_REAL ? s->time_end : s->steps_max * s->dt, &s->components.gauge));
  PetscCall(add_states(s));
  if (components->flow) PetscCall(BodiesAttach(components->bodies, sizeof(*s->a), (void **)&s->a));
  if (components->flow) PetscCall(BodiesAttach(components->bodies, sizeof(*s->alpha), (void **)&s->alpha));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimDestroy(Sim *sim)
{
  PetscFunctionBeginUser;
  if (!*sim) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(AdaptDestroy(&(*sim)->adapt));
  PetscCall(TimeErrorDestroy(&(*sim)->components.time_error));
  PetscCall(LimitsDestroy(&(*sim)->limits));
  PetscCall(StepCheckDestroy(&(*sim)->check));
  PetscCall(BondReportDestroy(&(*sim)->bond_report));
  PetscCall(BooksDestroy(&(*sim)->books));
  PetscCall(SolidReportDestroy(&(*sim)->solid_report));
  PetscCall(DropReportDestroy(&(*sim)->drop_report));
  PetscCall(GaugeDestroy(&(*sim)->components.gauge));
  PetscCall(BodiesDetach((*sim)->components.bodies, (void **)&(*sim)->a));
  PetscCall(BodiesDetach((*sim)->components.bodies, (void **)&(*sim)->alpha));
  PetscCall(PetscFree(*sim));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimGetStep(Sim s, PetscReal *dt, PetscReal *end, PetscBool *adapted)
{
  PetscFunctionBeginUser;
  *dt      = s->dt;
  *end     = s->time_end < PETSC_MAX_REAL ? s->time_end : s->steps_max * s->dt;
  *adapted = (PetscBool)(s->adapt != NULL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimView(Sim s, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  if (s->components.steady) {
    PetscCall(SteadyView(s->components.steady, viewer));
    PetscCall(MeshAdaptView(s->components.meshadapt, viewer));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscViewerASCIIPrintf(viewer, "time: step %g", (double)s->dt));
  if (s->time_end < PETSC_MAX_REAL) PetscCall(PetscViewerASCIIPrintf(viewer, ", to %g", (double)s->time_end));
  if (s->steps_max < PETSC_MAX_INT)
    PetscCall(PetscViewerASCIIPrintf(viewer, ", at most %" PetscInt_FMT " steps", s->steps_max));
  if (s->time_end < PETSC_MAX_REAL && s->dt > 0 && !s->adapt)
    PetscCall(
      PetscViewerASCIIPrintf(viewer, ", %.0f steps", PetscCeilReal((s->time_end - s->time) / s->dt * (1 - 1e-9))));
  PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  PetscCall(AdaptView(s->adapt, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies that are spread go to the ranks that need them in the step dt to come; a: its acceleration without contact,
   NULL: none. Those that stand still, once. */
static PetscErrorCode know_bodies(Sim s, PetscReal (*a)[3], PetscReal dt)
{
  PetscBool still;

  PetscFunctionBeginUser;
  PetscCall(BodiesAreStill(s->components.bodies, &still));
  if (still && s->local_bodies_updated) PetscFunctionReturn(PETSC_SUCCESS);
  s->local_bodies_updated = PETSC_TRUE;
  PetscCall(ContactMigrate(s->components.contact, dt, a));
  PetscCall(CoupleUpdateLocalBodies(s->components.couple));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_fields(Sim s)
{
  const MeshLocal    *l;
  PetscInt           *body;
  PetscReal          *u, *p, *gradient, *psi, *conformation = NULL, *T;
  PetscInt            nscalar;
  const CoupleScalar *scalar;

  PetscFunctionBeginUser;
  if (!s->components.flow) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MeshGetLocal(s->components.mesh, &l));
  PetscCall(FlowGetFields(s->components.flow, &u, NULL, &p));
  PetscCall(PetscMalloc2(l->ncell * (l->dim + 1), &gradient, l->nnode_all, &body));
  PetscCall(FlowGetPressureGradient(s->components.flow, p, gradient));
  PetscCall(CoupleMarkInside(s->components.couple, body));
  PetscCall(FieldsMove(s->components.fields, s->s->frame));
  PetscCall(FlowGetLogConformation(s->components.flow, &psi, NULL));
  if (psi) PetscCall(PetscMalloc1(6 * l->nnode_all, &conformation));
  if (psi) PetscCall(FlowGetConformation(s->components.flow, conformation));
  PetscCall(CoupleGetScalars(s->components.couple, &nscalar, &scalar));
  PetscCall(PetscMalloc1(nscalar * l->nnode_all, &T));
  for (PetscInt i = 0; i < nscalar; i++) PetscCall(CoupleGetScalarField(s->components.couple, i, T + i * l->nnode_all));
  PetscCall(FieldsSetScalars(s->components.fields, T));
  PetscCall(DropReportMarkCells(s->drop_report));
  PetscCall(FieldsWrite(s->components.fields, s->step, s->time, u, gradient, body, s->eta, conformation));
  PetscCall(PetscFree(T));
  PetscCall(PetscFree(conformation));
  PetscCall(PetscFree2(gradient, body));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What follows counts as this phase, in the times of the monitor and in PETSc's log */
static PetscErrorCode begin_phase(Sim s, MonitorPhase phase)
{
  PetscFunctionBeginUser;
  s->phase = phase;
  PetscCall(PetscTime(&s->since));
  if (s->trial) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogStagePush(phase == MONITOR_NSE      ? TB_STAGE_FLOW
                              : phase == MONITOR_OUTPUT ? TB_STAGE_OUTPUT
                                                        : TB_STAGE_BODIES));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode end_phase(Sim s)
{
  PetscLogDouble now;

  PetscFunctionBeginUser;
  if (s->trial) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogStagePop());
  PetscCall(PetscTime(&now));
  PetscCall(MonitorPhaseSeconds(s->components.monitor, s->phase, now - s->since));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode stop_unsolved(Sim s, KSPConvergedReason reason, PetscInt its, PetscReal dt)
{
  PetscFunctionBeginUser;
  if (!s->trial) PetscCall(write_fields(s));
  PetscCall(SimStopUnsolved(s, reason, its, dt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_snapshot(Sim s)
{
  const char *dir;

  PetscFunctionBeginUser;
  PetscCall(write_fields(s));
  if (s->check && !StepCheckDoubts(s->check)) s->fields_good = s->step;
  PetscCall(FieldsGetDirectory(s->components.fields, &dir));
  if (s->bond_report) PetscCall(BondReportSnapshot(s->bond_report, dir, s->step, s->time));
  else PetscCall(OutlinesWrite(s->components.outlines, dir, s->step, s->time, NULL));
  PetscCall(DropFieldsWrite(s->components.comm, s->components.drops, dir, s->step, s->time));
  PetscCall(SolidFieldsWrite(s->components.comm, s->components.solids, dir, s->step, s->time));
  PetscCall(SuspensionWrite(s->components.suspension, dir, s->step));
  PetscCall(StatisticsWrite(s->components.statistics, dir));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* seconds: wall clock of the step */
static PetscErrorCode report(Sim s, PetscReal dt, PetscReal seconds)
{
  const PetscReal time_end = s->time_end < PETSC_MAX_REAL ? s->time_end : s->steps_max * s->dt;
  PetscInt        every;
  PetscReal       stored, *u = NULL;
  MonitorStep     m = {.step             = s->step,
                       .time             = s->time,
                       .dt               = dt,
                       .cfl              = s->diag.cfl,
                       .outer_iterations = s->its,
                       .divergence       = s->diag.divergence,
                       .kinetic_energy   = s->diag.kinetic_energy,
                       .momentum_error   = s->balance.error,
                       .speed            = s->diag.speed_max,
                       .seconds          = seconds};

  PetscFunctionBeginUser;
  PetscCall(BodiesGetEnergy(s->components.bodies, &m.bodies_energy));
  PetscCall(ContactGetEnergy(s->components.contact, &m.contact_energy, &m.contact_work));
  if (s->spring_column >= 0) {
    PetscCall(BodiesGetSpringEnergy(s->components.bodies, &stored, NULL));
    PetscCall(MonitorSetColumn(s->components.monitor, s->spring_column, stored));
  }
  PetscCall(BondReportStep(s->bond_report, s->time));
  PetscCall(BooksReport(s->books));
  PetscCall(SolidReportStep(s->solid_report));
  PetscCall(DropReportStep(s->drop_report, s->step, s->time));
  PetscCall(SuspensionStep(s->components.suspension));
  PetscCall(ScalarLayersStep(s->components.scalar_layers, s->step, s->time));
  PetscCall(StatisticsStep(s->components.statistics, s->time, dt));
  if (s->components.flow && MonitorPrints(s->components.monitor, &m, time_end)) {
    if (!FlowStaysOnDevice(s->components.flow)) PetscCall(FlowGetFields(s->components.flow, &u, NULL, NULL));
    PetscCall(FlowGetGradientNorm(s->components.flow, u, &m.gradient));
  }
  PetscCall(MonitorWrite(s->components.monitor, &m, time_end));
  PetscCall(FieldsGetEvery(s->components.fields, &every));
  if ((every > 0 && (s->components.steady || s->step % every == 0)) || (s->hits && s->snapshot))
    PetscCall(write_snapshot(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What follows a solve of `its` iterations over dt, a time step or a part of one: forces, diagnostics, bodies moved */
static PetscErrorCode finish_substep(Sim s, PetscReal dt, PetscInt its)
{
  CouplePower power;

  PetscFunctionBeginUser;
  PetscCall(begin_phase(s, MONITOR_FORCE));
  PetscCall(CoupleForce(s->components.couple));
  PetscCall(end_phase(s));
  PetscCall(begin_phase(s, MONITOR_OUTPUT));
  PetscCall(CoupleDiagnose(s->components.couple, &s->diag));
  PetscCall(CoupleMomentum(s->components.couple, &s->diag, &s->balance));
  if (!s->trial) PetscCall(DiagnosticsStep(s->components.diagnostics, &s->balance));
  if (PetscIsInfOrNanReal(s->diag.kinetic_energy)) PetscCall(stop_unsolved(s, KSP_DIVERGED_NANORINF, its, dt));
  if (s->books || s->check) PetscCall(CoupleGetPower(s->components.couple, &power));
  PetscCall(BooksStep(s->books, &s->diag, &power, dt));
  if (s->check) PetscCall(StepCheckMeasure(s->check, &s->diag, &s->balance, &power, s->time + dt, dt));
  PetscCall(end_phase(s));
  PetscCall(begin_phase(s, MONITOR_PARTICLE));
  if (s->adapt) PetscCall(AdaptAccept(s->adapt, s->diag.cfl));
  PetscCall(TimeErrorStep(s->components.time_error));
  PetscCall(CoupleAdvance(s->components.couple));
  if (s->components.frame) PetscCall(FrameAccept(s->components.frame));
  if (s->check) PetscCall(StepCheckDisplacement(s->check, s->time + dt, dt, (PetscBool)(s->adapt != NULL)));
  PetscCall(ContactFinishStep(s->components.contact));
  PetscCall(ContactCountWork(s->components.contact, dt));
  PetscCall(BooksClose(s->books));
  PetscCall(BodiesOutflowApply(s->components.outflow));
  PetscCall(end_phase(s));
  s->time   = s->hits ? s->until : s->time + dt;
  s->dt_old = dt;
  s->its += its;
  s->has_acceleration = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Count and report the time step dt that began at the clock `start` */
static PetscErrorCode finish_step(Sim s, PetscReal dt, PetscLogDouble start)
{
  PetscFunctionBeginUser;
  s->step++;
  PetscCall(SimCountLimits(s, dt));
  PetscCall(begin_phase(s, MONITOR_OUTPUT));
  PetscCall(GaugeStep(s->components.gauge, &s->diag, s->time, dt));
  if (!s->trial) PetscCall(report(s, dt, s->since - start));
  PetscCall(end_phase(s));
  s->its = 0;
  if (s->check) PetscCall(SimStopDoubted(s, dt, SimIsAtEnd(s)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Solve for the step dt or a part of one; what is known of the time before it stays */
static PetscErrorCode solve_substep(Sim s, PetscReal dt, PetscInt *its, KSPConvergedReason *reason)
{
  const FlowParameters *par;
  PetscBool             solved;

  PetscFunctionBeginUser;
  PetscCall(RefineTrack(s->components.refine, dt));
  PetscCall(begin_phase(s, MONITOR_PARTICLE));
  PetscCall(FlowBeginStep(s->components.flow, s->time + dt, dt));
  if (s->components.frame) PetscCall(FrameBegin(s->components.frame));
  if (s->s->nall) {
    PetscCall(FlowGetParameters(s->components.flow, &par));
    PetscCall(ContactSetGravity(s->components.contact, par->gravity));
    PetscCall(ContactPhaseEstimate(&s->components, dt, s->has_acceleration ? s->dt_old : 0, s->a, s->alpha));
    PetscCall(ContactPhaseIsSolved(&s->components, &solved));
    if (!solved || !s->has_acceleration)
      PetscCall(StepCheckPredicted(s->check, s->a, (PetscBool)!s->has_acceleration, s->time + dt, dt,
                                   (PetscBool)(s->adapt != NULL)));
    PetscCall(know_bodies(s, s->a, dt));
    PetscCall(ContactPhaseFind(&s->components, dt, !s->has_acceleration, s->a, s->alpha));
  }
  PetscCall(CoupleUpdateGeometry(s->components.couple));
  PetscCall(end_phase(s));
  PetscCall(begin_phase(s, MONITOR_NSE));
  PetscCall(CoupleSolve(s->components.couple, its, reason));
  PetscCall(ContactPhaseTake(&s->components));
  PetscCall(end_phase(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Has a signal ended the solve? Then the state is that before the step. */
static PetscErrorCode take_back(Sim s, KSPConvergedReason reason)
{
  PetscFunctionBeginUser;
  s->ended = (PetscBool)(reason < 0 && InterruptHeard());
  if (s->ended) PetscCall(ContactRevert(s->components.contact));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One time step in the parts that the scheme wants */
static PetscErrorCode take_substeps(Sim s, PetscReal dt)
{
  PetscInt           n, its;
  const PetscReal   *fraction;
  const PetscBool    hits = s->hits;
  KSPConvergedReason reason;

  PetscFunctionBeginUser;
  PetscCall(FlowGetSubsteps(s->components.flow, &n, &fraction));
  if (InterruptIsArmed()) PetscCall(ContactKeep(s->components.contact));
  for (PetscInt i = 0; i < n; i++) {
    if (i) InterruptArm(PETSC_FALSE); /* the first part cannot be taken back any more */
    s->hits = (PetscBool)(hits && i == n - 1);
    PetscCall(solve_substep(s, fraction[i] * dt, &its, &reason));
    PetscCall(take_back(s, reason));
    if (s->ended) PetscFunctionReturn(PETSC_SUCCESS);
    if (reason < 0) PetscCall(stop_unsolved(s, reason, its, dt));
    PetscCall(finish_substep(s, fraction[i] * dt, its));
  }
  s->diag.cfl /= fraction[n - 1]; /* that of the whole step */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Solve, and solve again with a shorter step, until the error is small enough */
static PetscErrorCode take_adapted(Sim s, PetscReal *dt)
{
  PetscInt           its;
  PetscBool          accept;
  KSPConvergedReason reason;

  PetscFunctionBeginUser;
  PetscCall(ContactKeep(s->components.contact));
  while (PETSC_TRUE) {
    PetscCall(SimChooseStep(s, dt));
    PetscCall(solve_substep(s, *dt, &its, &reason));
    PetscCall(take_back(s, reason));
    if (s->ended) PetscFunctionReturn(PETSC_SUCCESS);
    PetscCall(AdaptCheck(s->adapt, reason, &accept));
    if (accept) break;
    s->its += its;
    PetscCall(ContactRevert(s->components.contact));
  }
  if (reason < 0) PetscCall(stop_unsolved(s, reason, its, *dt));
  PetscCall(finish_substep(s, *dt, its));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_step(Sim s)
{
  PetscLogDouble start;
  PetscReal      dt;

  PetscFunctionBeginUser;
  PetscCall(PetscTime(&start));
  if (s->adapt) PetscCall(take_adapted(s, &dt));
  else {
    PetscCall(SimChooseStep(s, &dt));
    PetscCall(take_substeps(s, dt));
  }
  if (!s->ended) PetscCall(finish_step(s, dt, start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* On one mesh; *more: there is another one to solve on */
static PetscErrorCode solve_steady(Sim s, PetscBool *more)
{
  PetscLogDouble start;
  PetscInt       its, linear, unknowns;
  FlowSolver     solver;

  PetscFunctionBeginUser;
  PetscCall(begin_phase(s, MONITOR_NSE));
  start = s->since;
  PetscCall(SteadySolve(s->components.steady, &its, &linear));
  PetscCall(end_phase(s));
  PetscCall(MonitorQuantity(s->components.monitor, "nonlinear_iterations", its));
  PetscCall(finish_substep(s, 0, linear));
  *more = PETSC_FALSE;
  if (InterruptHeard()) PetscFunctionReturn(PETSC_SUCCESS); /* what it is worth, a restart goes on from */
  PetscCall(CoupleGetSolver(s->components.couple, &solver));
  PetscCall(FlowSolverGetUnknowns(solver, &unknowns));
  PetscCall(MeshAdaptEstimate(s->components.meshadapt, unknowns, &s->eta));
  PetscCall(finish_step(s, 0, start));
  PetscCall(begin_phase(s, MONITOR_PARTICLE));
  PetscCall(MeshAdaptRefine(s->components.meshadapt, s->components.steady, more));
  PetscCall(end_phase(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A step of the bodies without a flow */
static PetscErrorCode take_step_alone(Sim s)
{
  PetscLogDouble start;
  PetscInt       substeps;
  PetscReal      dt, gravity[3];

  PetscFunctionBeginUser;
  PetscCall(begin_phase(s, MONITOR_PARTICLE));
  start = s->since;
  PetscCall(SimChooseStep(s, &dt));
  if (s->components.gravity) PetscCall(ExprEvaluate(s->components.gravity, s->time + 0.5 * dt, 1, NULL, gravity));
  if (s->components.gravity) PetscCall(ContactSetGravity(s->components.contact, gravity));
  PetscCall(ContactAdvanceAlone(s->components.contact, dt));
  if (s->components.solids) PetscCall(SolidAdvanceAlone(&s->components, s->time, dt));
  PetscCall(BodiesOutflowApply(s->components.outflow));
  PetscCall(end_phase(s));
  PetscCall(ContactGetWork(s->components.contact, NULL, NULL, &substeps));
  s->time = s->hits ? s->until : s->time + dt;
  PetscCall(BodiesSetTime(s->components.bodies, s->time));
  s->substeps += substeps;
  PetscCall(finish_step(s, dt, start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimRewind(Sim s)
{
  const char *dir;

  PetscFunctionBeginUser;
  PetscCall(FieldsGetDirectory(s->components.fields, &dir));
  PetscCall(FieldsRewind(s->components.fields, s->step));
  PetscCall(OutlinesRewind(s->components.outlines, dir));
  PetscCall(BondReportRewind(s->bond_report, dir));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimSetUp(Sim s)
{
  FlowSolver       solver;
  PetscInt         n;
  const PetscReal *fraction;

  PetscFunctionBeginUser;
  if (!s->components.flow) PetscFunctionReturn(PETSC_SUCCESS);
  if (s->components.steady) {
    PetscCall(SteadySetUp(s->components.steady));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(FlowGetSubsteps(s->components.flow, &n, &fraction));
  PetscCall(FlowBeginStep(s->components.flow, s->time + fraction[0] * s->dt, fraction[0] * s->dt));
  if (s->components.frame) PetscCall(FrameBegin(s->components.frame));
  PetscCall(know_bodies(s, NULL, fraction[0] * s->dt));
  PetscCall(CoupleSetUpGeometry(s->components.couple));
  PetscCall(FlowAssemble(s->components.flow));
  PetscCall(CoupleGetSolver(s->components.couple, &solver));
  PetscCall(FlowSolverSetUp(solver));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Write the state if it is time */
static PetscErrorCode save_state(Sim s, PetscBool *stop)
{
  PetscBool due;

  PetscFunctionBeginUser;
  PetscCall(CheckpointPoll(s->components.checkpoint, s->step, &due, stop));
  if (!due || (s->check && StepCheckDoubts(s->check) && !*stop)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(begin_phase(s, MONITOR_OUTPUT));
  PetscCall(CheckpointWrite(s->components.checkpoint, s->step, s->time));
  PetscCall(end_phase(s));
  s->renew = (PetscBool)(s->components.flow != NULL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* After a checkpoint: go on as a restarted run would, see checkpoint.h */
static PetscErrorCode renew_solvers(Sim s)
{
  PetscFunctionBeginUser;
  s->renew = PETSC_FALSE;
  PetscCall(begin_phase(s, MONITOR_OUTPUT));
  PetscCall(CoupleRenewSolver(s->components.couple));
  PetscCall(SimSetUp(s));
  PetscCall(end_phase(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimRun(Sim s)
{
  PetscBool stop = PETSC_FALSE, due, more = (PetscBool)(s->components.steady != NULL);

  PetscFunctionBeginUser;
  while (more) PetscCall(solve_steady(s, &more));
  if (s->components.steady)
    PetscCall(CheckpointPoll(s->components.checkpoint, s->step, &due, &stop)); /* it counts as a step */
  if (stop) PetscCall(CheckpointWrite(s->components.checkpoint, s->step, s->time));
  if (!s->components.steady && s->step > 0 && SimIsAtEnd(s))
    PetscCall(LogRemark("nothing is left to do: the checkpoint is at step %" PetscInt_FMT
                        ", t = %g, the end of the run. Raise -sim_time or -sim_steps",
                        s->step, (double)s->time));
  PetscCall(CoresBegin(&s->cores));
  while (!stop && !SimIsAtEnd(s)) {
    if (s->renew) PetscCall(renew_solvers(s));
    if (s->components.flow) PetscCall(take_step(s));
    else PetscCall(take_step_alone(s));
    PetscCall(save_state(s, &stop));
    PetscCall(CoresStep(&s->cores, s->components.comm));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimRunTrial(Sim s, Gauge *gauge)
{
  PetscBool end = PETSC_FALSE;

  PetscFunctionBeginUser;
  *gauge = s->components.gauge;
  while (!end && !SimIsAtEnd(s)) {
    InterruptArm(PETSC_TRUE);
    PetscCall(take_step(s));
    PetscCall(InterruptAsk(&end));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
