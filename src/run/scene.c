/* Scene: see scene.h. */
#include "compat.h"
#include "shape/host.h"
#include "base/runcomm.h"
#include "base/interrupt.h"
#include "run/scene.h"
#include "accuracy.h"
#include "couple/bodysurfaces.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "defaults.h"
#include "estimate.h"
#include "contactphase.h"
#include "meshadapt.h"
#include "refine.h"
#include "sim.h"
#include "start.h"
#include "walls.h"

#define TRIAL_TOLERANCE "1e-7" /* of a steady solution that an error is estimated by */

/* What contact needs to know of a scene without a flow: all boundaries are walls, and the range goes by the size of the
   bodies. */
static PetscErrorCode create_contact_alone(SimComponents *part, const MeshLocal *l, ContactWalls *walls)
{
  PetscReal  density = 0, gravity[3] = {0, 0, 0}, h = PETSC_MAX_REAL;
  PetscInt   sides;
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCall(FlowReadFluid(l->dim, &density, gravity, &part->gravity));
  PetscCall(BodiesGetState(part->bodies, &s));
  PetscCheck(s->nall, part->comm, PETSC_ERR_USER_INPUT,
             "A scene without flow and without bodies has nothing to do: give -particle_groups, or remove -flow_active");
  for (PetscInt k = 0; k < s->n; k++) h = PetscMin(h, 0.2 * BodiesGetRadius(s, k));
  PetscCall(BodiesMin(part->bodies, 1, &h));
  for (PetscInt g = 0; g < s->ngroups; g++)
    PetscCheck(!s->group[g].with_fluid, part->comm, PETSC_ERR_USER_INPUT,
               "-particle_%s_initial_velocity fluid needs a flow: remove it, or -flow_active false", s->group[g].name);
  PetscCall(WallsFind(part->mesh, NULL, part->bodies, &part->border, &sides, walls));
  PetscCall(ContactCreate(part->bodies, h, density, gravity, l->lower, l->upper, sides, &part->contact));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the mesh needs no longer, because bodies stand still */
static PetscErrorCode drop_deform(SimComponents *part, PetscBool steady)
{
  PetscBool still;

  PetscFunctionBeginUser;
  PetscCall(BodiesAreStill(part->bodies, &still));
  if (still || steady) PetscCall(DeformDestroy(&part->deform));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode report_deformation(Monitor monitor, const DeformResult *r)
{
  PetscFunctionBeginUser;
  PetscCall(
    PetscPrintf(MonitorComm(monitor),
                "mesh deformed in %" PetscInt_FMT
                " steps: sizes of cells %.3f to %.3f of the wanted ones, smallest Jacobian %.3f of its cell's mean\n",
                r->steps, (double)r->area[0], (double)r->area[1], (double)r->jacobian));
  PetscCall(MonitorQuantity(monitor, "deform_area_min", r->area[0]));
  PetscCall(MonitorQuantity(monitor, "deform_area_max", r->area[1]));
  PetscCall(MonitorQuantity(monitor, "deform_jacobian", r->jacobian));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode report_packing(Monitor monitor, const ContactPacking *p)
{
  PetscFunctionBeginUser;
  PetscCall(PetscPrintf(MonitorComm(monitor),
                        "%" PetscInt_FMT " bodies packed to a fraction of %.4f in %" PetscInt_FMT " sweeps, %.1f s\n",
                        p->bodies, (double)p->fraction, p->sweeps, (double)p->seconds));
  PetscCall(MonitorQuantity(monitor, "pack_fraction", p->fraction));
  PetscCall(MonitorQuantity(monitor, "pack_sweeps", p->sweeps));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where bodies fall along a periodic axis: what holds their weight less their buoyancy */
static PetscErrorCode remark_backflow(const MeshLocal *l, const FlowParameters *par, Bodies bodies, Couple couple)
{
  const FlowRateResult *drive;
  BodyState            *s;
  PetscInt              heavy = 0, open = 0;
  PetscReal             falls[3] = {0, 0, 0}; /* does a body, along this axis? */

  PetscFunctionBeginUser;
  PetscCall(CoupleGetFlowRate(couple, &drive));
  PetscCall(BodiesGetState(bodies, &s));
  for (PetscInt d = 0; d < l->dim; d++) {
    open |= (l->period[d] > 0) << d;
    for (PetscInt k = 0; k < s->n && l->period[d] > 0 && par->gravity[d] != 0; k++)
      if (s->density[k] != par->density && BodiesIsFree(bodies, k, d)) falls[d] = 1;
  }
  PetscCall(BodiesMax(bodies, 3, falls));
  for (PetscInt d = 0; d < l->dim; d++) heavy |= (falls[d] > 0) << d;
  if (drive && drive->backflow)
    PetscCall(
      LogRemark("back-flow: zero %s along gravity in the periodic box (-couple_backflow), checked every step (column backflow_error)",
                drive->held & drive->backflow ? "net flux of fluid and bodies" : "mean force on fluid and bodies"));
  else if (heavy & ~(drive ? drive->held : 0) && open == (1 << l->dim) - 1)
    PetscCall(LogRemark(
      "the box is periodic along every axis, and nothing in it holds the weight of the bodies less their buoyancy: bodies and fluid are "
      "accelerated without end. Choose a back-flow by -couple_backflow flux or force, give it a wall, or balance the weight by -flow_force"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Parts of bodies that are spread over the ranks are, in a flow, those of the mesh and some cells beyond. */
static PetscErrorCode settle_bodies(SimComponents *part, PetscBool active)
{
  PetscInt   reach[2] = {0, 0};
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(part->bodies, &s));
  if (active && BodiesComm(part->bodies) != PETSC_COMM_SELF) {
    PetscCall(FlowFindReach(&reach[0]));
    if (s->nall) PetscCall(CoupleFindReach(part->mesh, part->bodies, &reach[1]));
    reach[0] = PetscMax(reach[0], reach[1]);
    PetscCall(CoupleSetComponents(part->mesh, part->bodies, reach[0]));
  }
  PetscCall(RefineSetBodies(part->refine, part->bodies, reach[0]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A refined mesh is made around the bodies, others before them */
static PetscErrorCode create_mesh_and_bodies(SimComponents *part, PetscBool steady, const MeshLocal **l)
{
  PetscInt  levels;
  PetscBool around;

  PetscFunctionBeginUser;
  PetscCall(MeshReadLevels(&levels, &around));
  if (levels) PetscCall(RefineCreateMesh(part->comm, around, steady, &part->bodies, &part->mesh, &part->refine));
  else PetscCall(MeshCreate(part->comm, &part->mesh));
  PetscCall(MeshGetLocal(part->mesh, l));
  if (!levels)
    PetscCall(BodiesCreateLocal(part->comm, (*l)->dim, (*l)->lower, (*l)->upper, (*l)->period, &part->bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What solves for a steady flow, on the bodies that are known now */
static PetscErrorCode create_steady(SimComponents *part, PetscBool steady)
{
  FlowInitial initial;

  PetscFunctionBeginUser;
  PetscCall(FlowGetInitial(part->flow, &initial, NULL));
  if (!steady && initial != FLOW_START_STEADY) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoupleUpdateLocalBodies(part->couple));
  if (steady) PetscCall(SteadyCreate(part->flow, part->couple, "1e-10", &part->steady));
  if (initial == FLOW_START_STEADY) PetscCall(SteadyCreate(part->flow, part->couple, "1e-5", &part->steady_start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What leaves the domain, is written and is reported */
static PetscErrorCode create_reports(SimComponents *part, const MeshLocal *l, PetscBool steady,
                                     const DeformResult *deformation, const ContactPacking *packing)
{
  PetscFunctionBeginUser;
  PetscCall(BodiesOutflowCreate(part->bodies, l->lower, l->upper, l->period, part->border, &part->outflow));
  PetscCall(FieldsCreate(part->mesh, part->scene, &part->fields));
  PetscCall(OutlinesCreate(part->comm, part->bodies, l->lower, l->upper, l->period, &part->outlines));
  PetscCall(MonitorCreate(part->comm, part->bodies, &part->monitor));
  if (deformation) PetscCall(report_deformation(part->monitor, deformation));
  if (packing->bodies) PetscCall(report_packing(part->monitor, packing));
  PetscCall(CheckpointCreate(part->mesh, (PetscBool)(part->deform != NULL), part->fields, &part->checkpoint));
  if (part->flow)
    PetscCall(DiagnosticsCreate(part->flow, part->bodies, part->couple, part->monitor, &part->diagnostics));
  if (part->flow)
    PetscCall(MeshAdaptCreate(part->refine, steady, part->flow, part->couple, part->bodies, part->contact,
                              part->monitor, &part->meshadapt));
  if (part->flow && !steady) PetscCall(StatisticsCreate(part->flow, part->monitor, &part->statistics));
  PetscCall(
    SuspensionCreate(part->bodies, part->contact, part->monitor, l->lower, l->upper, l->period, &part->suspension));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The least of that, for a run that writes nothing */
static PetscErrorCode create_trial(SimComponents *part, const MeshLocal *l)
{
  PetscFunctionBeginUser;
  PetscCall(BodiesOutflowCreate(part->bodies, l->lower, l->upper, l->period, part->border, &part->outflow));
  PetscCall(FieldsCreate(part->mesh, part->scene, &part->fields));
  PetscCall(MonitorCreate(part->comm, part->bodies, &part->monitor));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* refusal [len]: as DefaultsApply has it; NULL: for a trial, of options that have their defaults already */
static PetscErrorCode build(SimComponents *part, char refusal[], size_t len)
{
  const MeshLocal      *l;
  const FlowParameters *par;
  PetscInt              sides;
  PetscReal             recess;
  ContactWalls          walls;
  PetscBool             active = PETSC_TRUE, steady = PETSC_FALSE, deformed = PETSC_FALSE, restarted, estimated;
  FlowInitial           initial;
  DeformResult          deformation;
  ContactPacking        packing;

  PetscFunctionBeginUser;
  PetscCall(OptBool("-flow_active", &active));
  if (active) PetscCall(OptBool("-sim_steady", &steady));
  PetscCall(create_mesh_and_bodies(part, steady, &l));
  if (active && refusal) PetscCall(DefaultsApply(part->mesh, part->bodies, steady, refusal, len));
  PetscCall(settle_bodies(part, active));
  PetscCall(ContactPack(part->bodies, l->lower, l->upper, l->period, &packing));
  if (active) {
    PetscCall(BodySurfacesCreateDeform(part->mesh, part->bodies, &part->deform));
    deformed = (PetscBool)(part->deform != NULL);
    if (deformed) PetscCall(DeformMesh(part->deform, &deformation));
    PetscCall(FlowCreate(part->mesh, &part->flow));
    PetscCall(FlowGetParameters(part->flow, &par));
    if (!steady) PetscCall(FrameCreate(part->flow, part->bodies, l, &part->frame));
    PetscCall(OptHas("-sim_restart", &restarted));
    PetscCall(FlowGetInitial(part->flow, &initial, NULL));
    PetscCheck(!steady || initial != FLOW_START_STEADY, part->comm, PETSC_ERR_USER_INPUT,
               "-flow_initial steady starts time steps, and -sim_steady takes none: remove one of them");
    if (!restarted) PetscCall(StartRead(part->mesh, part->flow, part->bodies));
  }
  if (active) {
    if (deformed) PetscCall(drop_deform(part, steady));
    PetscCall(CoupleCreate(part->flow, part->bodies, &part->couple));
    PetscCall(remark_backflow(l, par, part->bodies, part->couple));
    if (part->deform) PetscCall(CoupleSetDeform(part->couple, part->deform));
    PetscCall(WallsFind(part->mesh, part->flow, part->bodies, &part->border, &sides, &walls));
    PetscCall(ContactCreate(part->bodies, l->h, par->density, par->gravity, l->lower, l->upper, sides, &part->contact));
    PetscCall(ContactSetViscosity(part->contact, par->viscosity));
    PetscCall(CoupleGetFilmGapOffset(part->couple, &recess));
    PetscCall(ContactSetFilmGapOffset(part->contact, recess));
    PetscCall(ContactPhaseCheckOptions(part));
  } else PetscCall(create_contact_alone(part, l, &walls));
  PetscCall(ContactSetWalls(part->contact, &walls));
  PetscCall(ContactSetPeriod(part->contact, l->period));
  PetscCall(ContactCheckStart(part->contact));
  if (active) PetscCall(create_steady(part, steady));
  PetscCall(AccuracyIsWanted(steady, &estimated)); /* at the end */
  if (!refusal) PetscCall(create_trial(part, l));
  else PetscCall(create_reports(part, l, steady, deformed ? &deformation : NULL, &packing));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(SimComponents *part)
{
  PetscFunctionBeginUser;
  PetscCall(SuspensionDestroy(&part->suspension));
  PetscCall(StatisticsDestroy(&part->statistics));
  PetscCall(DiagnosticsDestroy(&part->diagnostics));
  PetscCall(CheckpointDestroy(&part->checkpoint));
  PetscCall(MonitorDestroy(&part->monitor));
  PetscCall(OutlinesDestroy(&part->outlines));
  PetscCall(FieldsDestroy(&part->fields));
  PetscCall(SteadyDestroy(&part->steady));
  PetscCall(SteadyDestroy(&part->steady_start));
  PetscCall(BodiesOutflowDestroy(&part->outflow));
  PetscCall(ContactDestroy(&part->contact));
  PetscCall(BorderDestroy(&part->border));
  PetscCall(CoupleDestroy(&part->couple));
  PetscCall(FrameDestroy(&part->frame));
  PetscCall(FlowDestroy(&part->flow));
  PetscCall(DeformDestroy(&part->deform));
  PetscCall(ExprDestroy(&part->gravity));
  PetscCall(MeshAdaptDestroy(&part->meshadapt));
  PetscCall(RefineDestroy(&part->refine));
  PetscCall(BodiesDestroy(&part->bodies));
  PetscCall(MeshDestroy(&part->mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* See SimComponents.make */
static PetscErrorCode make_other(SimComponents *part)
{
  const MeshLocal *l;
  ContactPacking   packing;

  PetscFunctionBeginUser;
  if (part->timed) {
    PetscCall(build(part, NULL, 0));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(create_mesh_and_bodies(part, PETSC_TRUE, &l));
  PetscCall(settle_bodies(part, PETSC_TRUE));
  PetscCall(ContactPack(part->bodies, l->lower, l->upper, l->period, &packing));
  if (BodiesComm(part->bodies) != PETSC_COMM_SELF) PetscCall(BodiesMigrate(part->bodies, l->h, 1));
  PetscCall(FlowCreate(part->mesh, &part->flow));
  PetscCall(CoupleCreate(part->flow, part->bodies, &part->couple));
  PetscCall(CoupleUpdateLocalBodies(part->couple));
  PetscCall(SteadyCreate(part->flow, part->couple, TRIAL_TOLERANCE, &part->steady));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view_output(const SimComponents *part, PetscViewer out)
{
  const char *dir;
  PetscInt    every;
  PetscReal   interval;

  PetscFunctionBeginUser;
  PetscCall(FieldsGetDirectory(part->fields, &dir));
  PetscCall(FieldsGetEvery(part->fields, &every));
  PetscCall(FieldsGetInterval(part->fields, &interval));
  PetscCall(PetscViewerASCIIPrintf(out, "output: into %s, ", dir));
  if (every) PetscCall(PetscViewerASCIIPrintf(out, "snapshots every %" PetscInt_FMT " steps", every));
  if (interval > 0)
    PetscCall(PetscViewerASCIIPrintf(out, "%ssnapshots every %g of time", every ? ", " : "", (double)interval));
  PetscCall(PetscViewerASCIIPrintf(out, "%s\n", every || interval > 0 ? "" : "no snapshots (-output_every)"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the scene activates and what it leaves out */
static PetscErrorCode describe(const SimComponents *part, Sim sim)
{
  PetscViewer           out = PETSC_VIEWER_STDOUT_(part->comm);
  const FlowParameters *par;
  FlowSolver            solver;
  BodyState            *s;
  PetscLogDouble        memory;
  PetscInt              i = 0;
  PetscBool             still;
  const char           *absent[8];

  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(out, "scene: %s\n", part->scene));
  PetscCall(MeshView(part->mesh, out));
  if (part->flow) {
    PetscCall(FlowView(part->flow, out));
    PetscCall(CoupleGetSolver(part->couple, &solver));
    PetscCall(FlowSolverView(solver, out));
  }
  PetscCall(BodiesView(part->bodies, out));
  if (part->flow) PetscCall(CoupleView(part->couple, out));
  PetscCall(ContactView(part->contact, out));
  PetscCall(FrameView(part->frame, out));
  PetscCall(SimView(sim, out));
  PetscCall(EstimateView(part, sim, out));
  PetscCall(view_output(part, out));
  PetscCall(CheckpointView(part->checkpoint, out));
  if (part->flow) {
    PetscCall(FlowGetParameters(part->flow, &par));
    if (!par->convection) absent[i++] = "convection";
  } else absent[i++] = "flow";
  PetscCall(BodiesGetState(part->bodies, &s));
  PetscCall(BodiesAreStill(part->bodies, &still));
  if (!s->nall) absent[i++] = "bodies, projection, contact, force integrals";
  else if (still) absent[i++] = "motion of bodies (marked once, not integrated), rigid unknowns, pair search";
  if (s->nall == 1) absent[i++] = "contact between bodies";
  if (s->nall == 1 && !still) absent[i++] = "pair search";
  PetscCall(PetscViewerASCIIPrintf(out, "not active:"));
  for (PetscInt k = 0; k < i; k++) PetscCall(PetscViewerASCIIPrintf(out, "%s %s", k ? "," : "", absent[k]));
  PetscCall(PetscMemoryGetCurrentUsage(&memory));
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &memory, 1, MPI_DOUBLE, MPI_SUM, part->comm));
  PetscCall(PetscViewerASCIIPrintf(out, "%s\nmemory after set-up: %.0f MB on all ranks\n", i ? "" : " nothing",
                                   memory / 1048576));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of a mesh that has been made anew, for a steady solver; steps begin by it */
static PetscErrorCode meet_bodies(const SimComponents *part)
{
  PetscFunctionBeginUser;
  PetscCall(ContactMigrate(part->contact, 0, NULL));
  PetscCall(CoupleUpdateLocalBodies(part->couple));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What a run leaves in the process goes */
static PetscErrorCode forget_run(void)
{
  PetscFunctionBeginUser;
  InterruptArm(PETSC_FALSE);
  InterruptRaise(0);
  PetscCall(LogFinalize());
  PetscCall(ShapeFinalize()); /* a plugin declares its options where it is loaded */
  PetscCall(OptFinalize());
  PetscCall(ShapeSetComm(MPI_COMM_NULL));
  RunCommSet(MPI_COMM_NULL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SceneRun(MPI_Comm comm, const char name[])
{
  SimComponents  part = {0};
  Sim            sim;
  PetscBool      dry = PETSC_FALSE, restarted;
  PetscLogDouble begin, now;
  const char    *dir;
  char           refusal[640] = "";

  PetscFunctionBeginUser;
  RunCommSet(comm);
  PetscCall(ShapeSetComm(comm));
  PetscCall(PetscTime(&begin));
  PetscCall(PetscLogStagePush(TB_STAGE_SETUP));
  part.scene = name;
  part.comm  = comm;
  PetscCall(OptCheckRenamed());
  PetscCall(OptBool("-scene_dry_run", &dry));
  PetscCall(build(&part, refusal, sizeof(refusal)));
  part.make    = make_other;
  part.destroy = destroy;
  PetscCall(SimCreate(&part, &sim));
  PetscCall(CheckpointLoad(part.checkpoint, &restarted));
  if (restarted) PetscCall(BodiesResume(part.bodies));
  if (restarted) PetscCall(RefineMatch(part.refine));
  if (restarted && part.refine && part.steady) PetscCall(meet_bodies(&part));
  if (part.flow && !part.steady && !restarted && !dry && !refusal[0]) PetscCall(StartSolve(&part));
  PetscCall(SimSetUp(sim));
  PetscCall(OptCheckUnused()); /* every module has read its options, and nothing is written yet */
  PetscCheck(!refusal[0], comm, PETSC_ERR_USER_INPUT, "%s", refusal);
  if (!restarted) PetscCall(EstimateRemark(&part, sim));
  if (dry) {
    PetscCall(describe(&part, sim));
  } else {
    PetscCall(FieldsOpen(part.fields));
    PetscCall(CheckpointOpen(part.checkpoint));
    PetscCall(FieldsGetDirectory(part.fields, &dir));
    PetscCall(MonitorOpen(part.monitor, dir));
    if (restarted) PetscCall(SimRewind(sim));
    PetscCall(PetscTime(&now));
    PetscCall(MonitorPhaseSeconds(part.monitor, MONITOR_SETUP, now - begin));
  }
  PetscCall(PetscLogStagePop());
  if (!dry) PetscCall(SimRun(sim));
  if (!dry) PetscCall(SimFinish(sim));
  PetscCall(SimDestroy(&sim));
  PetscCall(destroy(&part));
  PetscCall(forget_run());
  PetscFunctionReturn(PETSC_SUCCESS);
}
