/* Sim: see sim.h. One pass of the loop is the algorithm of the method: contact forces, bodies drawn, flow solved,
   forces read, bodies moved, reports (src/README.md follows a step through all rooms). Seconds are counted by phase
   (NSE, Force, Particle, Output) as in the method's own cost table. */
#include "compat.h"
#include "simimpl.h"
#include "accuracy.h"
#include "gauge.h"
#include "contactphase.h"
#include "base/interrupt.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"

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
  const SimComponents *p = &s->part;

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
  PetscCall(CheckpointAdd(p->checkpoint, "contact", p->contact, ContactVisitState));
  PetscCall(CheckpointAdd(p->checkpoint, "output", p->fields, FieldsVisitState));
  if (s->books) PetscCall(CheckpointAdd(p->checkpoint, "energy", s->books, BooksVisitState));
  if (s->adapt) PetscCall(CheckpointAdd(p->checkpoint, "adapt", s->adapt, AdaptVisitState));
  PetscCall(CheckpointAdd(p->checkpoint, "limits", s->limits, LimitsVisitState));
  if (p->gauge) PetscCall(CheckpointAdd(p->checkpoint, "gauge", p->gauge, GaugeVisitState));
  if (p->statistics) PetscCall(CheckpointAdd(p->checkpoint, "statistics", p->statistics, StatisticsVisitState));
  PetscCall(CheckpointAdd(p->checkpoint, "bodyfile", p->outlines, OutlinesVisitState));
  PetscCall(CheckpointAdd(p->checkpoint, "monitor", p->monitor, MonitorVisitState));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimCreate(const SimComponents *part, Sim *sim)
{
  Sim       s;
  PetscReal energy;
  PetscBool springs, gauged = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->part      = *part;
  s->trial     = (PetscBool)(part->checkpoint == NULL);
  s->dt        = 0.01;
  s->time_end  = PETSC_MAX_REAL;
  s->steps_max = PETSC_MAX_INT;
  if (part->steady) PetscCall(SteadyRefuseTime());
  PetscCall(OptReal("-sim_dt", &s->dt));
  PetscCall(OptReal("-sim_time", &s->time_end));
  PetscCall(OptInt("-sim_steps", &s->steps_max));
  if (part->steady) s->dt = s->time_end = 0;
  PetscCheck(s->time_end < PETSC_MAX_REAL || s->steps_max < PETSC_MAX_INT, part->comm, PETSC_ERR_USER_INPUT,
             "The run has no end: give -sim_time or -sim_steps");
  PetscCall(BodiesGetState(part->bodies, &s->s));
  s->dt_old = s->dt;
  *sim      = s;
  PetscCall(FieldsGetInterval(part->fields, &s->interval));
  PetscCall(SimCreateLimits(s));
  s->fields_good = -1;
  PetscCall(BodiesGetSpringEnergy(part->bodies, &energy, &springs));
  s->spring_column = -1;
  if (springs) PetscCall(MonitorAddColumn(part->monitor, "spring_energy", &s->spring_column));
  if (!s->trial) PetscCall(BooksCreate(part, &s->books));
  PetscCall(AccuracyIsGauged(part, s->trial, &gauged));
  if (gauged)
    PetscCall(GaugeCreate(part, s->time_end < PETSC_MAX_REAL ? s->time_end : s->steps_max * s->dt, &s->part.gauge));
  PetscCall(add_states(s));
  if (part->flow) PetscCall(BodiesAttach(part->bodies, sizeof(*s->a), (void **)&s->a));
  if (part->flow) PetscCall(BodiesAttach(part->bodies, sizeof(*s->alpha), (void **)&s->alpha));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimDestroy(Sim *sim)
{
  PetscFunctionBeginUser;
  if (!*sim) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(AdaptDestroy(&(*sim)->adapt));
  PetscCall(LimitsDestroy(&(*sim)->limits));
  PetscCall(StepCheckDestroy(&(*sim)->check));
  PetscCall(BooksDestroy(&(*sim)->books));
  PetscCall(GaugeDestroy(&(*sim)->part.gauge));
  PetscCall(BodiesDetach((*sim)->part.bodies, (void **)&(*sim)->a));
  PetscCall(BodiesDetach((*sim)->part.bodies, (void **)&(*sim)->alpha));
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
  if (s->part.steady) {
    PetscCall(SteadyView(s->part.steady, viewer));
    PetscCall(MeshAdaptView(s->part.meshadapt, viewer));
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
  PetscCall(BodiesAreStill(s->part.bodies, &still));
  if (still && s->known) PetscFunctionReturn(PETSC_SUCCESS);
  s->known = PETSC_TRUE;
  PetscCall(ContactMigrate(s->part.contact, dt, a));
  PetscCall(CoupleUpdateLocalBodies(s->part.couple));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_fields(Sim s)
{
  const MeshLocal *l;
  PetscInt        *body;
  PetscReal       *u, *p, *gradient, *psi, *conformation = NULL;

  PetscFunctionBeginUser;
  if (!s->part.flow) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MeshGetLocal(s->part.mesh, &l));
  PetscCall(FlowGetFields(s->part.flow, &u, NULL, &p));
  PetscCall(PetscMalloc2(l->ncell * (l->dim + 1), &gradient, l->nnode_all, &body));
  PetscCall(FlowGetPressureGradient(s->part.flow, p, gradient));
  PetscCall(CoupleMarkInside(s->part.couple, body));
  PetscCall(FieldsMove(s->part.fields, s->s->frame));
  PetscCall(FlowGetLogConformation(s->part.flow, &psi, NULL));
  if (psi) PetscCall(PetscMalloc1(6 * l->nnode_all, &conformation));
  if (psi) PetscCall(FlowGetConformation(s->part.flow, conformation));
  PetscCall(FieldsWrite(s->part.fields, s->step, s->time, u, gradient, body, s->eta, conformation));
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
  PetscCall(MonitorPhaseSeconds(s->part.monitor, s->phase, now - s->since));
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
  PetscCall(FieldsGetDirectory(s->part.fields, &dir));
  PetscCall(OutlinesWrite(s->part.outlines, dir, s->step, s->time));
  PetscCall(SuspensionWrite(s->part.suspension, dir, s->step));
  PetscCall(StatisticsWrite(s->part.statistics, dir));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* seconds: wall clock of the step */
static PetscErrorCode report(Sim s, PetscReal dt, PetscReal seconds)
{
  const PetscReal time_end = s->time_end < PETSC_MAX_REAL ? s->time_end : s->steps_max * s->dt;
  PetscInt        every;
  PetscReal       stored, *u;
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
  PetscCall(BodiesGetEnergy(s->part.bodies, &m.bodies_energy));
  PetscCall(ContactGetEnergy(s->part.contact, &m.contact_energy, &m.contact_work));
  if (s->spring_column >= 0) {
    PetscCall(BodiesGetSpringEnergy(s->part.bodies, &stored, NULL));
    PetscCall(MonitorSetColumn(s->part.monitor, s->spring_column, stored));
  }
  PetscCall(BooksReport(s->books));
  PetscCall(SuspensionStep(s->part.suspension));
  PetscCall(StatisticsStep(s->part.statistics, s->time, dt));
  if (s->part.flow && MonitorPrints(s->part.monitor, &m, time_end)) {
    PetscCall(FlowGetFields(s->part.flow, &u, NULL, NULL));
    PetscCall(FlowGetGradientNorm(s->part.flow, u, &m.gradient));
  }
  PetscCall(MonitorWrite(s->part.monitor, &m, time_end));
  PetscCall(FieldsGetEvery(s->part.fields, &every));
  if ((every > 0 && (s->part.steady || s->step % every == 0)) || (s->hits && s->snapshot)) PetscCall(write_snapshot(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What follows a solve of `its` iterations over dt, a time step or a part of one: forces, diagnostics, bodies moved */
static PetscErrorCode finish_part(Sim s, PetscReal dt, PetscInt its)
{
  const PetscReal *u, *p;

  PetscFunctionBeginUser;
  PetscCall(begin_phase(s, MONITOR_FORCE));
  PetscCall(CoupleForce(s->part.couple));
  PetscCall(end_phase(s));
  PetscCall(begin_phase(s, MONITOR_OUTPUT));
  PetscCall(CoupleGetSolution(s->part.couple, &u, &p));
  PetscCall(FlowDiagnose(s->part.flow, u, &s->diag));
  PetscCall(CoupleMomentum(s->part.couple, &s->diag, &s->balance));
  if (!s->trial) PetscCall(DiagnosticsStep(s->part.diagnostics, &s->balance));
  PetscCall(BooksStep(s->books, &s->diag, dt));
  if (PetscIsInfOrNanReal(s->diag.kinetic_energy)) PetscCall(stop_unsolved(s, KSP_DIVERGED_NANORINF, its, dt));
  if (s->check) PetscCall(StepCheckMeasure(s->check, &s->diag, &s->balance, s->time + dt, dt));
  PetscCall(end_phase(s));
  PetscCall(begin_phase(s, MONITOR_PARTICLE));
  if (s->adapt) PetscCall(AdaptAccept(s->adapt, s->diag.cfl));
  PetscCall(CoupleAdvance(s->part.couple));
  if (s->part.frame) PetscCall(FrameAccept(s->part.frame));
  if (s->check) PetscCall(StepCheckDisplacement(s->check, s->time + dt, dt, (PetscBool)(s->adapt != NULL)));
  PetscCall(ContactFinishStep(s->part.contact));
  PetscCall(ContactCountWork(s->part.contact, dt));
  PetscCall(BooksClose(s->books));
  PetscCall(BodiesOutflowApply(s->part.outflow));
  PetscCall(end_phase(s));
  s->time   = s->hits ? s->until : s->time + dt;
  s->dt_old = dt;
  s->its += its;
  s->has_acceleration = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool is_at_end(Sim s)
{
  return (PetscBool)(s->step >= s->steps_max || s->time >= s->time_end * (1 - 1e-12) - 1e-9 * s->dt);
}

/* Count and report the time step dt that began at the clock `start` */
static PetscErrorCode finish_step(Sim s, PetscReal dt, PetscLogDouble start)
{
  PetscFunctionBeginUser;
  s->step++;
  PetscCall(SimCountLimits(s, dt));
  PetscCall(begin_phase(s, MONITOR_OUTPUT));
  PetscCall(GaugeStep(s->part.gauge, &s->diag, s->time, dt));
  if (!s->trial) PetscCall(report(s, dt, s->since - start));
  PetscCall(end_phase(s));
  s->its = 0;
  if (s->check) PetscCall(SimStopDoubted(s, dt, is_at_end(s)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Solve for the step dt or a part of one; what is known of the time before it stays */
static PetscErrorCode solve_part(Sim s, PetscReal dt, PetscInt *its, KSPConvergedReason *reason)
{
  const FlowParameters *par;
  PetscBool             solved;

  PetscFunctionBeginUser;
  PetscCall(RefineFollow(s->part.refine, dt));
  PetscCall(begin_phase(s, MONITOR_PARTICLE));
  PetscCall(FlowBeginStep(s->part.flow, s->time + dt, dt));
  if (s->part.frame) PetscCall(FrameBegin(s->part.frame));
  if (s->s->nall) {
    PetscCall(FlowGetParameters(s->part.flow, &par));
    PetscCall(ContactSetGravity(s->part.contact, par->gravity));
    PetscCall(ContactPhaseEstimate(&s->part, dt, s->has_acceleration ? s->dt_old : 0, s->a, s->alpha));
    PetscCall(ContactPhaseIsSolved(&s->part, &solved));
    if (!solved || !s->has_acceleration)
      PetscCall(StepCheckPredicted(s->check, s->a, (PetscBool)!s->has_acceleration, s->time + dt, dt,
                                   (PetscBool)(s->adapt != NULL)));
    PetscCall(know_bodies(s, s->a, dt));
    PetscCall(ContactPhaseFind(&s->part, dt, !s->has_acceleration, s->a, s->alpha));
  }
  PetscCall(CoupleUpdateGeometry(s->part.couple));
  PetscCall(end_phase(s));
  PetscCall(begin_phase(s, MONITOR_NSE));
  PetscCall(CoupleSolve(s->part.couple, its, reason));
  PetscCall(ContactPhaseTake(&s->part));
  PetscCall(end_phase(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Has a signal ended the solve? Then the state is that before the step. */
static PetscErrorCode take_back(Sim s, KSPConvergedReason reason)
{
  PetscFunctionBeginUser;
  s->ended = (PetscBool)(reason < 0 && InterruptHeard());
  if (s->ended) PetscCall(ContactRevert(s->part.contact));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One time step in the parts that the scheme wants */
static PetscErrorCode take_parts(Sim s, PetscReal dt)
{
  PetscInt           n, its;
  const PetscReal   *fraction;
  const PetscBool    hits = s->hits;
  KSPConvergedReason reason;

  PetscFunctionBeginUser;
  PetscCall(FlowGetSubsteps(s->part.flow, &n, &fraction));
  if (InterruptIsArmed()) PetscCall(ContactKeep(s->part.contact));
  for (PetscInt i = 0; i < n; i++) {
    if (i) InterruptArm(PETSC_FALSE); /* the first part cannot be taken back any more */
    s->hits = (PetscBool)(hits && i == n - 1);
    PetscCall(solve_part(s, fraction[i] * dt, &its, &reason));
    PetscCall(take_back(s, reason));
    if (s->ended) PetscFunctionReturn(PETSC_SUCCESS);
    if (reason < 0) PetscCall(stop_unsolved(s, reason, its, dt));
    PetscCall(finish_part(s, fraction[i] * dt, its));
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
  PetscCall(ContactKeep(s->part.contact));
  while (PETSC_TRUE) {
    PetscCall(SimChooseStep(s, dt));
    PetscCall(solve_part(s, *dt, &its, &reason));
    PetscCall(take_back(s, reason));
    if (s->ended) PetscFunctionReturn(PETSC_SUCCESS);
    PetscCall(AdaptCheck(s->adapt, reason, &accept));
    if (accept) break;
    s->its += its;
    PetscCall(ContactRevert(s->part.contact));
  }
  if (reason < 0) PetscCall(stop_unsolved(s, reason, its, *dt));
  PetscCall(finish_part(s, *dt, its));
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
    PetscCall(take_parts(s, dt));
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
  PetscCall(SteadySolve(s->part.steady, &its, &linear));
  PetscCall(end_phase(s));
  PetscCall(MonitorQuantity(s->part.monitor, "nonlinear_iterations", its));
  PetscCall(finish_part(s, 0, linear));
  *more = PETSC_FALSE;
  if (InterruptHeard()) PetscFunctionReturn(PETSC_SUCCESS); /* what it is worth, a restart goes on from */
  PetscCall(CoupleGetSolver(s->part.couple, &solver));
  PetscCall(FlowSolverGetUnknowns(solver, &unknowns));
  PetscCall(MeshAdaptEstimate(s->part.meshadapt, unknowns, &s->eta));
  PetscCall(finish_step(s, 0, start));
  PetscCall(begin_phase(s, MONITOR_PARTICLE));
  PetscCall(MeshAdaptRefine(s->part.meshadapt, s->part.steady, more));
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
  if (s->part.gravity) PetscCall(ExprEvaluate(s->part.gravity, s->time + 0.5 * dt, 1, NULL, gravity));
  if (s->part.gravity) PetscCall(ContactSetGravity(s->part.contact, gravity));
  PetscCall(ContactAdvanceAlone(s->part.contact, dt));
  PetscCall(BodiesOutflowApply(s->part.outflow));
  PetscCall(end_phase(s));
  PetscCall(ContactGetWork(s->part.contact, NULL, NULL, &substeps));
  s->time = s->hits ? s->until : s->time + dt;
  PetscCall(BodiesSetTime(s->part.bodies, s->time));
  s->substeps += substeps;
  PetscCall(finish_step(s, dt, start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimRewind(Sim s)
{
  const char *dir;

  PetscFunctionBeginUser;
  PetscCall(FieldsGetDirectory(s->part.fields, &dir));
  PetscCall(FieldsRewind(s->part.fields, s->step));
  PetscCall(OutlinesRewind(s->part.outlines, dir));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimSetUp(Sim s)
{
  FlowSolver       solver;
  PetscInt         n;
  const PetscReal *fraction;

  PetscFunctionBeginUser;
  if (!s->part.flow) PetscFunctionReturn(PETSC_SUCCESS);
  if (s->part.steady) {
    PetscCall(SteadySetUp(s->part.steady));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(FlowGetSubsteps(s->part.flow, &n, &fraction));
  PetscCall(FlowBeginStep(s->part.flow, s->time + fraction[0] * s->dt, fraction[0] * s->dt));
  if (s->part.frame) PetscCall(FrameBegin(s->part.frame));
  PetscCall(know_bodies(s, NULL, fraction[0] * s->dt));
  PetscCall(CoupleUpdateGeometry(s->part.couple));
  PetscCall(FlowAssemble(s->part.flow));
  PetscCall(CoupleGetSolver(s->part.couple, &solver));
  PetscCall(FlowSolverSetUp(solver));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Write the state if it is time */
static PetscErrorCode save_state(Sim s, PetscBool *stop)
{
  PetscBool due;

  PetscFunctionBeginUser;
  PetscCall(CheckpointPoll(s->part.checkpoint, s->step, &due, stop));
  if (!due || (s->check && StepCheckDoubts(s->check) && !*stop)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(begin_phase(s, MONITOR_OUTPUT));
  PetscCall(CheckpointWrite(s->part.checkpoint, s->step, s->time));
  PetscCall(end_phase(s));
  s->renew = (PetscBool)(s->part.flow != NULL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* After a checkpoint: go on as a restarted run would, see checkpoint.h */
static PetscErrorCode renew_solvers(Sim s)
{
  PetscFunctionBeginUser;
  s->renew = PETSC_FALSE;
  PetscCall(begin_phase(s, MONITOR_OUTPUT));
  PetscCall(CoupleRenewSolver(s->part.couple));
  PetscCall(SimSetUp(s));
  PetscCall(end_phase(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimRun(Sim s)
{
  PetscBool stop = PETSC_FALSE, due, more = (PetscBool)(s->part.steady != NULL);

  PetscFunctionBeginUser;
  while (more) PetscCall(solve_steady(s, &more));
  if (s->part.steady) PetscCall(CheckpointPoll(s->part.checkpoint, s->step, &due, &stop)); /* it counts as a step */
  if (stop) PetscCall(CheckpointWrite(s->part.checkpoint, s->step, s->time));
  if (!s->part.steady && s->step > 0 && is_at_end(s))
    PetscCall(LogRemark("nothing is left to do: the checkpoint is at step %" PetscInt_FMT
                        ", t = %g, the end of the run. Raise -sim_time or -sim_steps",
                        s->step, (double)s->time));
  PetscCall(CoresBegin(&s->cores));
  while (!stop && !is_at_end(s)) {
    if (s->renew) PetscCall(renew_solvers(s));
    if (s->part.flow) PetscCall(take_step(s));
    else PetscCall(take_step_alone(s));
    PetscCall(save_state(s, &stop));
    PetscCall(CoresStep(&s->cores, s->part.comm));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimRunTrial(Sim s, Gauge *gauge)
{
  PetscBool end = PETSC_FALSE;

  PetscFunctionBeginUser;
  *gauge = s->part.gauge;
  while (!end && !is_at_end(s)) {
    InterruptArm(PETSC_TRUE);
    PetscCall(take_step(s));
    PetscCall(InterruptAsk(&end));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
