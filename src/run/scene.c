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
#include "scalarlayers.h"
#include "couple/scalars.h"
#include "defaults.h"
#include "estimate.h"
#include "contactphase.h"
#include "meshadapt.h"
#include "refine.h"
#include "sim.h"
#include "start.h"
#include "walls.h"

#define STEADY_RTOL "1e-10"

/* Without a flow nothing holds the volume of an incompressible solid */
static PetscErrorCode check_solids_alone(const SimComponents *sim)
{
  SolidsState *s;

  PetscFunctionBeginUser;
  if (!sim->solids) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SolidsGetState(sim->solids, &s));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCheck(!s->group[g].membrane, sim->comm, PETSC_ERR_SUP,
               "-flow_active false: what the membrane of group '%s' encloses is a fluid: leave the flow on",
               s->group[g].name);
    PetscCheck(s->group[g].compressible, sim->comm, PETSC_ERR_SUP,
               "-flow_active false: the volume of the incompressible solid of group '%s' is held by the pressure of a flow: give -particle_%s_poisson "
               "below 0.5, such as 0.49",
               s->group[g].name, s->group[g].name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What contact needs to know of a scene without a flow: all boundaries are walls, and the range goes by the size of the
   bodies. */
static PetscErrorCode create_contact_alone(SimComponents *sim, const MeshLocal *l, ContactWalls *walls)
{
  PetscReal  density = 0, h = PETSC_MAX_REAL;
  PetscInt   sides;
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCall(FlowReadFluid(l->dim, &density, sim->gravity_start, &sim->gravity));
  PetscCall(BodiesGetState(sim->bodies, &s));
  PetscCall(check_solids_alone(sim));
  if (sim->solids && !s->nall) h = l->h;
  PetscCheck(s->nall || sim->solids, sim->comm, PETSC_ERR_USER_INPUT,
             "A scene without flow and without bodies has nothing to do: give -particle_groups, or remove -flow_active");
  for (PetscInt k = 0; k < s->n; k++) h = PetscMin(h, 0.2 * BodiesGetRadius(s, k));
  PetscCall(BodiesMin(sim->bodies, 1, &h));
  for (PetscInt g = 0; g < s->ngroups; g++)
    PetscCheck(!s->group[g].with_fluid, sim->comm, PETSC_ERR_USER_INPUT,
               "-particle_%s_initial_velocity fluid needs a flow: remove it, or -flow_active false", s->group[g].name);
  for (PetscInt g = 0; g < s->ngroups; g++)
    PetscCheck(!s->group[g].slip, sim->comm, PETSC_ERR_USER_INPUT,
               "-particle_%s_slip_* needs a flow: remove it, or -flow_active false", s->group[g].name);
  PetscCall(WallsFind(sim->mesh, NULL, sim->bodies, &sim->border, &sides, walls));
  PetscCall(ContactCreate(sim->bodies, h, density, sim->gravity_start, l->lower, l->upper, sides, &sim->contact));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the mesh needs no longer, because bodies stand still */
static PetscErrorCode destroy_unused_deform(SimComponents *sim, PetscBool steady)
{
  PetscBool still;

  PetscFunctionBeginUser;
  PetscCall(BodiesAreStill(sim->bodies, &still));
  if (still || steady) PetscCall(DeformDestroy(&sim->deform));
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
  const FlowRateResult *flow_rate;
  BodyState            *s;
  PetscInt              heavy = 0, open = 0;
  PetscReal             falls[3] = {0, 0, 0}; /* does a body, along this axis? */

  PetscFunctionBeginUser;
  PetscCall(CoupleGetFlowRate(couple, &flow_rate));
  PetscCall(BodiesGetState(bodies, &s));
  for (PetscInt d = 0; d < l->dim; d++) {
    open |= (l->period[d] > 0) << d;
    for (PetscInt k = 0; k < s->n && l->period[d] > 0 && par->gravity[d] != 0; k++)
      if (s->density[k] != par->density && BodiesIsFree(bodies, k, d)) falls[d] = 1;
  }
  PetscCall(BodiesMax(bodies, 3, falls));
  for (PetscInt d = 0; d < l->dim; d++) heavy |= (falls[d] > 0) << d;
  if (flow_rate && flow_rate->backflow)
    PetscCall(
      LogRemark("back-flow: zero %s along gravity in the periodic box (-couple_backflow), checked every step (column backflow_error)",
                flow_rate->controlled & flow_rate->backflow ? "net flux of fluid and bodies"
                                                            : "mean force on fluid and bodies"));
  else if (heavy & ~(flow_rate ? flow_rate->controlled : 0) && open == (1 << l->dim) - 1)
    PetscCall(LogRemark(
      "the box is periodic along every axis, and nothing in it holds the weight of the bodies less their buoyancy: bodies and fluid are "
      "accelerated without end. Choose a back-flow by -couple_backflow flux or force, give it a wall, or balance the weight by -flow_force"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Parts of bodies that are spread over the ranks are, in a flow, those of the mesh and some cells beyond. */
static PetscErrorCode set_up_contact(SimComponents *sim, PetscBool active)
{
  PetscInt   reach[2] = {0, 0};
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(sim->bodies, &s));
  if (active && BodiesComm(sim->bodies) != PETSC_COMM_SELF) {
    PetscCall(FlowFindReach(&reach[0]));
    if (s->nall) PetscCall(CoupleFindReach(sim->mesh, sim->bodies, &reach[1]));
    reach[0] = PetscMax(reach[0], reach[1]);
    PetscCall(CoupleSetSubdomains(sim->mesh, sim->bodies, reach[0]));
  }
  PetscCall(RefineSetBodies(sim->refine, sim->bodies, reach[0]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* h: of the flow's smallest cells */
static PetscErrorCode create_solids(SimComponents *sim, PetscBool active, PetscInt dim, PetscReal h,
                                    const PetscReal lower[3], const PetscReal upper[3])
{
  PetscFunctionBeginUser;
  PetscCall(SolidsCreate(sim->comm, dim, active ? SOLID_FINER * h : h, lower, upper, &sim->solids));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A refined mesh is made around bodies and solids, others before them */
static PetscErrorCode create_mesh_and_bodies(SimComponents *sim, PetscBool active, PetscBool steady,
                                             const MeshLocal **mesh)
{
  const MeshLocal *l;
  PetscInt         levels, dim;
  PetscReal        h, lower[3], upper[3], period[3];
  PetscBool        with_bodies;

  PetscFunctionBeginUser;
  PetscCall(MeshReadLevels(&levels, &with_bodies));
  if (levels) {
    PetscCall(MeshReadBox(sim->comm, &dim, lower, upper, period));
    PetscCall(MeshReadFinest(sim->comm, &h));
    PetscCall(create_solids(sim, active, dim, h, lower, upper));
    PetscCall(DropsCreate(sim->comm, dim, &sim->drops));
    PetscCall(RefineCreateMesh(sim->comm, with_bodies, steady, sim->solids, sim->drops, &sim->bodies, &sim->mesh,
                               &sim->refine));
  } else PetscCall(MeshCreate(sim->comm, &sim->mesh));
  PetscCall(MeshGetLocal(sim->mesh, mesh));
  if (levels) PetscFunctionReturn(PETSC_SUCCESS);
  l = *mesh;
  PetscCall(BodiesCreateLocal(sim->comm, l->dim, l->lower, l->upper, l->period, &sim->bodies));
  PetscCall(create_solids(sim, active, l->dim, l->h, l->lower, l->upper));
  PetscCall(DropsCreate(sim->comm, l->dim, &sim->drops));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What solves for a steady flow, on the bodies that are known now */
static PetscErrorCode create_steady(SimComponents *sim, PetscBool steady)
{
  FlowInitial initial;

  PetscFunctionBeginUser;
  PetscCall(FlowGetInitial(sim->flow, &initial, NULL));
  if (!steady && initial != FLOW_START_STEADY) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoupleUpdateLocalBodies(sim->couple));
  if (steady) PetscCall(SteadyCreate(sim->flow, sim->couple, STEADY_RTOL, &sim->steady));
  if (initial == FLOW_START_STEADY) PetscCall(SteadyCreate(sim->flow, sim->couple, "1e-5", &sim->steady_start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_scalar_fields(SimComponents *sim)
{
  PetscInt            n;
  const CoupleScalar *scalar;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetScalars(sim->couple, &n, &scalar));
  for (PetscInt i = 0; i < n; i++)
    PetscCall(FieldsAddScalar(sim->fields, scalar[i].par->name, scalar[i].par->gradient));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What leaves the domain, is written and is reported */
static PetscErrorCode create_reports(SimComponents *sim, const MeshLocal *l, PetscBool steady,
                                     const DeformResult *deformation, const ContactPacking *packing)
{
  PetscFunctionBeginUser;
  PetscCall(BodiesOutflowCreate(sim->bodies, l->lower, l->upper, l->period, sim->border, &sim->outflow));
  PetscCall(FieldsCreate(sim->mesh, sim->scene, &sim->fields));
  if (sim->couple) PetscCall(add_scalar_fields(sim));
  PetscCall(OutlinesCreate(sim->comm, sim->bodies, l->lower, l->upper, l->period, &sim->outlines));
  PetscCall(MonitorCreate(sim->comm, sim->bodies, &sim->monitor));
  if (deformation) PetscCall(report_deformation(sim->monitor, deformation));
  if (packing->bodies) PetscCall(report_packing(sim->monitor, packing));
  PetscCall(CheckpointCreate(sim->mesh, (PetscBool)(sim->deform || sim->solids), sim->fields, &sim->checkpoint));
  if (sim->flow) PetscCall(DiagnosticsCreate(sim->flow, sim->bodies, sim->couple, sim->monitor, &sim->diagnostics));
  if (sim->flow)
    PetscCall(MeshAdaptCreate(sim->refine, steady, sim->flow, sim->couple, sim->bodies, sim->contact, sim->monitor,
                              &sim->meshadapt));
  if (sim->flow) PetscCall(ScalarLayersCreate(sim, &sim->scalar_layers));
  if (sim->flow && !steady) PetscCall(StatisticsCreate(sim->flow, sim->monitor, &sim->statistics));
  PetscCall(SuspensionCreate(sim->bodies, sim->contact, sim->monitor, l->lower, l->upper, l->period, &sim->suspension));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The least of that, for a run that writes nothing */
static PetscErrorCode create_trial(SimComponents *sim, const MeshLocal *l)
{
  PetscFunctionBeginUser;
  PetscCall(BodiesOutflowCreate(sim->bodies, l->lower, l->upper, l->period, sim->border, &sim->outflow));
  PetscCall(FieldsCreate(sim->mesh, sim->scene, &sim->fields));
  PetscCall(MonitorCreate(sim->comm, sim->bodies, &sim->monitor));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* refusal [len]: as DefaultsApply has it; NULL: for a trial, of options that have their defaults already */
static PetscErrorCode build(SimComponents *sim, char refusal[], size_t len)
{
  const MeshLocal      *l;
  const FlowParameters *par;
  PetscInt              sides;
  PetscReal             film_gap_offset;
  ContactWalls          walls;
  PetscBool             active = PETSC_TRUE, steady = PETSC_FALSE, deformed = PETSC_FALSE, restarted, estimated;
  FlowInitial           initial;
  DeformResult          deformation;
  ContactPacking        packing;

  PetscFunctionBeginUser;
  PetscCall(OptBool("-flow_active", &active));
  if (active) PetscCall(OptBool("-sim_steady", &steady));
  PetscCall(create_mesh_and_bodies(sim, active, steady, &l));
  if (active && refusal)
    PetscCall(DefaultsApply(sim->mesh, sim->bodies, sim->solids, sim->drops, steady, refusal, len));
  PetscCall(set_up_contact(sim, active));
  PetscCall(ContactPack(sim->bodies, l->lower, l->upper, l->period, &packing));
  if (active) {
    PetscCall(BodySurfacesCreateDeform(sim->mesh, sim->bodies, &sim->deform));
    deformed = (PetscBool)(sim->deform != NULL);
    if (deformed) PetscCall(DeformMesh(sim->deform, &deformation));
    PetscCall(FlowCreate(sim->mesh, &sim->flow));
    PetscCall(FlowGetParameters(sim->flow, &par));
    if (!steady) PetscCall(FrameCreate(sim->flow, sim->bodies, l, &sim->frame));
    PetscCall(OptHas("-sim_restart", &restarted));
    PetscCall(FlowGetInitial(sim->flow, &initial, NULL));
    PetscCheck(!steady || initial != FLOW_START_STEADY, sim->comm, PETSC_ERR_USER_INPUT,
               "-flow_initial steady starts time steps, and -sim_steady takes none: remove one of them");
    if (!restarted) PetscCall(StartRead(sim->mesh, sim->flow, sim->bodies));
  }
  if (active) {
    if (deformed) PetscCall(destroy_unused_deform(sim, steady));
    PetscCall(CoupleCreate(sim->flow, sim->bodies, &sim->couple));
    if (!restarted) PetscCall(StartScalars(sim->couple));
    PetscCall(remark_backflow(l, par, sim->bodies, sim->couple));
    if (sim->deform) PetscCall(CoupleSetDeform(sim->couple, sim->deform));
    if (sim->solids) PetscCall(CoupleSetSolids(sim->couple, sim->solids));
    if (sim->drops) PetscCall(CoupleSetDrops(sim->couple, sim->drops));
    PetscCall(WallsFind(sim->mesh, sim->flow, sim->bodies, &sim->border, &sides, &walls));
    PetscCall(ContactCreate(sim->bodies, l->h, par->density, par->gravity, l->lower, l->upper, sides, &sim->contact));
    PetscCall(ContactSetViscosity(sim->contact, par->viscosity));
    PetscCall(CoupleGetFilmGapOffset(sim->couple, &film_gap_offset));
    PetscCall(ContactSetFilmGapOffset(sim->contact, film_gap_offset));
    PetscCall(ContactPhaseCheckOptions(sim));
  } else PetscCall(create_contact_alone(sim, l, &walls));
  PetscCall(ContactSetWalls(sim->contact, &walls));
  PetscCall(ContactSetPeriod(sim->contact, l->period));
  PetscCall(ContactCheckStart(sim->contact));
  if (active) PetscCall(create_steady(sim, steady));
  PetscCall(AccuracyIsWanted(steady, &estimated)); /* at the end */
  if (!refusal) PetscCall(create_trial(sim, l));
  else PetscCall(create_reports(sim, l, steady, deformed ? &deformation : NULL, &packing));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(SimComponents *sim)
{
  PetscFunctionBeginUser;
  PetscCall(SuspensionDestroy(&sim->suspension));
  PetscCall(StatisticsDestroy(&sim->statistics));
  PetscCall(ScalarLayersDestroy(&sim->scalar_layers));
  PetscCall(DiagnosticsDestroy(&sim->diagnostics));
  PetscCall(CheckpointDestroy(&sim->checkpoint));
  PetscCall(MonitorDestroy(&sim->monitor));
  PetscCall(OutlinesDestroy(&sim->outlines));
  PetscCall(FieldsDestroy(&sim->fields));
  PetscCall(SteadyDestroy(&sim->steady));
  PetscCall(SteadyDestroy(&sim->steady_start));
  PetscCall(BodiesOutflowDestroy(&sim->outflow));
  PetscCall(ContactDestroy(&sim->contact));
  PetscCall(BorderDestroy(&sim->border));
  PetscCall(CoupleDestroy(&sim->couple));
  PetscCall(FrameDestroy(&sim->frame));
  PetscCall(FlowDestroy(&sim->flow));
  PetscCall(DeformDestroy(&sim->deform));
  PetscCall(ExprDestroy(&sim->gravity));
  PetscCall(MeshAdaptDestroy(&sim->meshadapt));
  PetscCall(RefineDestroy(&sim->refine));
  PetscCall(SolidsDestroy(&sim->solids));
  PetscCall(DropsDestroy(&sim->drops));
  PetscCall(BodiesDestroy(&sim->bodies));
  PetscCall(MeshDestroy(&sim->mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* See SimComponents.make */
static PetscErrorCode make_other(SimComponents *sim)
{
  const MeshLocal *l;
  ContactPacking   packing;

  PetscFunctionBeginUser;
  if (sim->timed) {
    PetscCall(build(sim, NULL, 0));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(create_mesh_and_bodies(sim, PETSC_TRUE, PETSC_TRUE, &l));
  PetscCall(set_up_contact(sim, PETSC_TRUE));
  PetscCall(ContactPack(sim->bodies, l->lower, l->upper, l->period, &packing));
  if (BodiesComm(sim->bodies) != PETSC_COMM_SELF) PetscCall(BodiesMigrate(sim->bodies, l->h, 1));
  PetscCall(FlowCreate(sim->mesh, &sim->flow));
  PetscCall(CoupleCreate(sim->flow, sim->bodies, &sim->couple));
  PetscCall(CoupleUpdateLocalBodies(sim->couple));
  PetscCall(SteadyCreate(sim->flow, sim->couple, STEADY_RTOL, &sim->steady));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view_output(const SimComponents *sim, PetscViewer out)
{
  const char *dir;
  PetscInt    every;
  PetscReal   interval;

  PetscFunctionBeginUser;
  PetscCall(FieldsGetDirectory(sim->fields, &dir));
  PetscCall(FieldsGetEvery(sim->fields, &every));
  PetscCall(FieldsGetInterval(sim->fields, &interval));
  PetscCall(PetscViewerASCIIPrintf(out, "output: into %s, ", dir));
  if (every) PetscCall(PetscViewerASCIIPrintf(out, "snapshots every %" PetscInt_FMT " steps", every));
  if (interval > 0)
    PetscCall(PetscViewerASCIIPrintf(out, "%ssnapshots every %g of time", every ? ", " : "", (double)interval));
  PetscCall(PetscViewerASCIIPrintf(out, "%s\n", every || interval > 0 ? "" : "no snapshots (-output_every)"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the scene activates and what it leaves out */
static PetscErrorCode describe(const SimComponents *sim, Sim loop)
{
  PetscViewer           out = PETSC_VIEWER_STDOUT_(sim->comm);
  const FlowParameters *par;
  FlowSolver            solver;
  BodyState            *s;
  PetscLogDouble        memory;
  PetscInt              i = 0;
  PetscBool             still;
  const char           *absent[8];

  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(out, "scene: %s\n", sim->scene));
  PetscCall(MeshView(sim->mesh, out));
  if (sim->flow) {
    PetscCall(FlowView(sim->flow, out));
    PetscCall(CoupleGetSolver(sim->couple, &solver));
    PetscCall(FlowSolverView(solver, out));
  }
  PetscCall(BodiesView(sim->bodies, out));
  if (sim->flow) PetscCall(CoupleView(sim->couple, out));
  PetscCall(ContactView(sim->contact, out));
  PetscCall(FrameView(sim->frame, out));
  PetscCall(SimView(loop, out));
  PetscCall(EstimateView(sim, loop, out));
  PetscCall(view_output(sim, out));
  PetscCall(CheckpointView(sim->checkpoint, out));
  if (sim->flow) {
    PetscCall(FlowGetParameters(sim->flow, &par));
    if (!par->convection) absent[i++] = "convection";
  } else absent[i++] = "flow";
  PetscCall(BodiesGetState(sim->bodies, &s));
  PetscCall(BodiesAreStill(sim->bodies, &still));
  if (!s->nall) absent[i++] = "bodies, projection, contact, force integrals";
  else if (still) absent[i++] = "motion of bodies (marked once, not integrated), rigid unknowns, pair search";
  if (s->nall == 1) absent[i++] = "contact between bodies";
  if (s->nall == 1 && !still) absent[i++] = "pair search";
  PetscCall(PetscViewerASCIIPrintf(out, "not active:"));
  for (PetscInt k = 0; k < i; k++) PetscCall(PetscViewerASCIIPrintf(out, "%s %s", k ? "," : "", absent[k]));
  PetscCall(PetscMemoryGetCurrentUsage(&memory));
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &memory, 1, MPI_DOUBLE, MPI_SUM, sim->comm));
  PetscCall(PetscViewerASCIIPrintf(out, "%s\nmemory after set-up: %.0f MB on all ranks\n", i ? "" : " nothing",
                                   memory / 1048576));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of a mesh that has been made anew, for a steady solver; steps begin by it */
static PetscErrorCode update_local_bodies(const SimComponents *sim)
{
  PetscFunctionBeginUser;
  PetscCall(ContactMigrate(sim->contact, 0, NULL));
  PetscCall(CoupleUpdateLocalBodies(sim->couple));
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
  RunCommSet(MPI_COMM_NULL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SceneRun(MPI_Comm comm, const char name[])
{
  SimComponents  sim = {0};
  Sim            loop;
  PetscBool      dry = PETSC_FALSE, restarted;
  PetscLogDouble begin, now;
  const char    *dir;
  char           refusal[640] = "";

  PetscFunctionBeginUser;
  RunCommSet(comm);
  PetscCall(PetscTime(&begin));
  PetscCall(PetscLogStagePush(TB_STAGE_SETUP));
  sim.scene = name;
  sim.comm  = comm;
  PetscCall(OptCheckRenamed());
  PetscCall(OptBool("-scene_dry_run", &dry));
  PetscCall(build(&sim, refusal, sizeof(refusal)));
  sim.make    = make_other;
  sim.destroy = destroy;
  PetscCall(SimCreate(&sim, &loop));
  PetscCall(CheckpointLoad(sim.checkpoint, &restarted));
  if (restarted) PetscCall(BodiesResume(sim.bodies));
  if (restarted) PetscCall(RefineMatch(sim.refine));
  if (restarted && sim.refine && sim.steady) PetscCall(update_local_bodies(&sim));
  if (sim.flow && !sim.steady && !restarted && !dry && !refusal[0]) PetscCall(StartSolve(&sim));
  PetscCall(SimSetUp(loop));
  PetscCall(OptCheckUnused()); /* every module has read its options, and nothing is written yet */
  PetscCheck(!refusal[0], comm, PETSC_ERR_USER_INPUT, "%s", refusal);
  if (!restarted) PetscCall(EstimateRemark(&sim, loop));
  if (dry) {
    PetscCall(describe(&sim, loop));
  } else {
    PetscCall(FieldsOpen(sim.fields));
    PetscCall(CheckpointOpen(sim.checkpoint));
    PetscCall(FieldsGetDirectory(sim.fields, &dir));
    PetscCall(MonitorOpen(sim.monitor, dir));
    if (restarted) PetscCall(SimRewind(loop));
    PetscCall(PetscTime(&now));
    PetscCall(MonitorPhaseSeconds(sim.monitor, MONITOR_SETUP, now - begin));
  }
  PetscCall(PetscLogStagePop());
  if (!dry) PetscCall(SimRun(loop));
  if (!dry) PetscCall(SimFinish(loop));
  PetscCall(SimDestroy(&loop));
  PetscCall(destroy(&sim));
  PetscCall(forget_run());
  PetscFunctionReturn(PETSC_SUCCESS);
}
