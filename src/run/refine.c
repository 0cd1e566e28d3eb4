/* Refine: see refine.h. */
#include "compat.h"
#include "refine.h"
#include "bodydistance.h"
#include "defaults.h"
#include "base/algebra.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "couple/elasticsurfaces.h"
#include "mesh/carry.h"

#define LEAD_STEPS   10   /* steps that a new mesh looks ahead */
#define CREEPS       1e-3 /* a body that goes less of its margin in these steps has no wake */
#define DROPS_MARGIN 0.7  /* of the margin: drops are of changing form */
#define START        8    /* cells along the smallest body on the first mesh that is refined by the flow */

struct _p_Refine {
  MPI_Comm     comm;
  Mesh         mesh;
  BodyDistance surface;
  /* elastic solids, NULL: none; their surfaces and nodes [nnode][dim] where the mesh has them */
  const SolidsState *solids;
  ElasticSurfaces    outlines;
  PetscReal         *x;
  PetscBool          tracks;
  PetscInt           coarser;        /* levels less than -mesh_levels around bodies on the first mesh */
  PetscInt           reach;          /* cells beyond its own within which a rank is to know bodies */
  PetscReal          track_distance; /* -mesh_track_distance */
  PetscInt           changes;
  /* what stands on the mesh */
  Flow   flow;
  Couple couple;
  Adapt  adapt;
  void  *client; /* NULL: no other */
  PetscErrorCode (*renew)(void *client, Mesh old);
  Limits   limits;
  PetscInt row; /* of these, where the mesh follows */
  Monitor  monitor;
};

/* Cells that a surface cuts and that have nodes of a larger cell cost iterations: 11 become 19, 30 become 45 */
static PetscErrorCode remark_cut_jumps(BodyDistance *s, Mesh mesh)
{
  const PetscBool  inside = s->inside;
  const PetscReal  margin = s->margin;
  const MeshLocal *l;
  PetscInt         cut = 0;
  MPI_Comm         comm;

  PetscFunctionBeginUser;
  s->inside = PETSC_FALSE;
  s->margin = 0;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshGetComm(mesh, &comm));
  for (PetscInt c = 0; c < l->ncell && BodyDistanceCount(s); c++) {
    PetscReal xc[MESH_MAX_NB * 3], centre[3] = {0, 0, 0}, r = 0, d;

    if (!MeshCellHang(l, c)) continue;
    PetscCall(MeshCellCoordinates(mesh, c, xc));
    for (PetscInt a = 0; a < l->dim; a++) {
      centre[a] = xc[(l->nb / 2) * l->dim + a];
      r += PetscSqr(centre[a] - xc[a]);
    }
    r = PetscSqrtReal(r);
    PetscCall(BodyDistanceAt(s, centre, r, &d));
    cut += d < r;
  }
  s->inside = inside;
  s->margin = margin;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &cut, 1, MPIU_INT, MPI_SUM, comm));
  if (cut)
    PetscCall(
      LogRemark("levels of the mesh jump at %" PetscInt_FMT
                " cells that a body's surface is in: up to three times the iterations. Raise -mesh_refine_distance, or move or enlarge the boxes of "
                "-mesh_refine",
                cut));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where bodies are in a box that may travel, and as far ahead as half of the way allows; dt 0: at the start, where they
   are. Their velocity, for wakes: 0 of those that creep. */
static PetscErrorCode set_body_positions(Refine r, PetscReal dt)
{
  BodyState *s = r->surface.s;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal speed = 0, lead_time = LEAD_STEPS * dt;

    for (PetscInt a = 0; a < s->dim; a++) speed += PetscSqr(s->u[k][a] - s->frame_u[a]);
    speed = PetscSqrtReal(speed);
    if (speed * lead_time > r->surface.margin) lead_time = r->surface.margin / speed;
    for (PetscInt a = 0; a < 3; a++) r->surface.X[k][a] = s->x[k][a] + lead_time * (s->u[k][a] - s->frame_u[a]);
    PetscCall(PetscArraycpy(r->surface.q[k], s->q[k], 4));
    speed = PetscSqrtReal(dot3(s->u[k], s->u[k]));
    for (PetscInt a = 0; a < 3; a++)
      r->surface.u[k][a] = dt == 0 || speed * LEAD_STEPS * dt > CREEPS * r->surface.margin ? s->u[k][a] : 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same of elastic solids */
static PetscErrorCode set_solid_positions(Refine r, PetscReal dt)
{
  const SolidsState *s = r->solids;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscInt first = s->dim * s->first[k], last = s->dim * s->first[k + 1];
    PetscReal      speed = 0, lead_time = LEAD_STEPS * dt;

    for (PetscInt i = first; i < last; i++) speed = PetscMax(speed, PetscAbsReal(s->u[i]));
    speed *= PetscSqrtReal(s->dim);
    if (speed * lead_time > r->surface.margin) lead_time = r->surface.margin / speed;
    for (PetscInt i = first; i < last; i++) r->x[i] = s->x[i] + lead_time * s->u[i];
  }
  PetscCall(ElasticSurfacesSet(r->outlines, r->x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* How far a node of a solid can be at the end of the step from where the mesh has it */
static PetscReal solid_displacement(Refine r, PetscReal dt)
{
  const SolidsState *s   = r->solids;
  PetscReal          far = 0;

  for (PetscInt i = 0; s && i < s->nnode; i++) {
    PetscReal way = 0;

    for (PetscInt j = s->dim * i; j < s->dim * (i + 1); j++) way += PetscSqr(s->x[j] + dt * s->u[j] - r->x[j]);
    far = PetscMax(far, way);
  }
  return PetscSqrtReal(far);
}

/* How far a point of body k can be at the end of the step from where the mesh has it */
static PetscErrorCode find_displacement(Refine r, PetscInt k, PetscReal dt, PetscReal *track_distance)
{
  BodyState *s = r->surface.s;
  PetscReal  X[3], q[4], angle, dot = 0;

  PetscFunctionBeginUser;
  PetscCall(BodiesPredict(r->surface.bodies, k, dt, 1, X, q, &angle));
  /* the step of the box is not known yet: as fast as in the last one */
  for (PetscInt a = 0; a < s->dim; a++) X[a] += s->frame_next[a] - s->frame[a] - dt * s->frame_u[a];
  *track_distance = 0;
  for (PetscInt a = 0; a < s->dim; a++)
    *track_distance += PetscSqr(DomainNearest(r->surface.period[a], X[a] - r->surface.X[k][a], 0));
  for (PetscInt a = 0; a < 4; a++) dot += q[a] * r->surface.q[k][a];
  *track_distance = PetscSqrtReal(*track_distance);
  if (BodiesGetDisc(s, k) == 0)
    *track_distance += 2 * BodiesGetRadius(s, k) *
                       PetscSqrtReal(PetscMax(0, 1 - PetscSqr(PetscMin(1, PetscAbsReal(dot)))));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same of drops, which know where they are going after the first step */
static PetscErrorCode set_drop_positions(Refine r, PetscReal dt)
{
  PetscFunctionBeginUser;
  if (r->surface.drops) PetscCall(DropDistanceSet(r->surface.drops, LEAD_STEPS * dt, DROPS_MARGIN * r->surface.margin));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode drop_displacement(Refine r, PetscReal dt, PetscReal *way)
{
  PetscFunctionBeginUser;
  *way = 0;
  if (r->surface.drops) PetscCall(DropDistanceMoved(r->surface.drops, dt, way));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What a mesh is made around */
static MeshSurface mesh_surface(Refine r)
{
  return (MeshSurface){.distance = BodyDistanceHasAny(&r->surface) ? BodyDistanceAt : NULL,
                       .carriers = BodyDistanceWakeBoxes,
                       .look     = BodyDistanceGather,
                       .context  = &r->surface,
                       .coarser  = r->coarser};
}

static PetscErrorCode start_tracking(Refine r)
{
  BodyDistance *s = &r->surface;

  PetscFunctionBeginUser;
  PetscCall(DefaultsSetBand(s->dim, (PetscBool)(s->drops != NULL)));
  r->track_distance = 2;
  PetscCall(OptReal("-mesh_track_distance", &r->track_distance));
  /* the size of the finest cells is known when there are some */
  PetscCall(MeshReadFinest(r->comm, &s->margin));
  s->margin *= 0.5 * r->track_distance;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Refined by the flow: with the first levels that lead to eight cells along the smallest body */
static PetscErrorCode start_coarse(Refine r)
{
  PetscReal smallest = PETSC_MAX_REAL, h;
  PetscInt  levels;
  PetscBool with_bodies;

  PetscFunctionBeginUser;
  PetscCall(MeshReadLevels(&levels, &with_bodies));
  PetscCall(MeshReadFinest(r->comm, &h));
  for (PetscInt k = 0; k < r->surface.s->n; k++) smallest = PetscMin(smallest, 2 * BodiesGetRadius(r->surface.s, k));
  PetscCall(BodiesMin(r->surface.bodies, 1, &smallest));
  for (; r->coarser < levels && 2 * h * START <= smallest; r->coarser++) h *= 2;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineIsByFlow(PetscBool *wanted)
{
  PetscFunctionBeginUser;
  *wanted = PETSC_FALSE;
  PetscCall(OptBool("-mesh_adapt", wanted));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineGetSurface(Refine r, MeshSurface *surface)
{
  PetscFunctionBeginUser;
  *surface = mesh_surface(r);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The solids where they start; *still: do they stay near there? Held ones do. */
static PetscErrorCode start_solids(Refine r, Solids solids, PetscBool *still)
{
  SolidsState *s;

  PetscFunctionBeginUser;
  if (!solids) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SolidsGetState(solids, &s));
  r->solids = s;
  for (PetscInt g = 0; g < s->ngroups; g++) *still = (PetscBool)(*still && s->group[g].nclamped > 0);
  PetscCall(PetscMalloc1(s->dim * s->nnode, &r->x));
  PetscCall(ElasticSurfacesCreate(s, &r->outlines));
  r->surface.solids = ElasticSurfacesGet(r->outlines);
  PetscCall(set_solid_positions(r, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The drops where they start; *still: there are none */
static PetscErrorCode start_drops(Refine r, Drops drops, PetscBool *still)
{
  BodyDistance *s = &r->surface;
  PetscReal     h;

  PetscFunctionBeginUser;
  if (!drops) PetscFunctionReturn(PETSC_SUCCESS);
  *still = PETSC_FALSE;
  PetscCall(MeshReadFinest(r->comm, &h));
  PetscCall(DropDistanceCreate(drops, s->dim, s->lower, s->upper, s->period, h, &s->drops));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineCreateMesh(MPI_Comm comm, PetscBool with_bodies, PetscBool steady, Solids solids, Drops drops,
                                Bodies *bodies, Mesh *mesh, Refine *refine)
{
  Refine        r;
  BodyDistance *s;
  MeshSurface   surface;
  PetscBool     still, adapt = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&r));
  r->comm = comm;
  s       = &r->surface;
  s->comm = comm;
  PetscCall(MeshReadBox(comm, &s->dim, s->lower, s->upper, s->period));
  PetscCall(BodiesCreateLocal(comm, s->dim, s->lower, s->upper, s->period, bodies));
  s->bodies = *bodies;
  PetscCall(BodiesGetState(*bodies, &s->s));
  PetscCall(BodiesAreStill(*bodies, &still));
  PetscCall(start_solids(r, solids, &still));
  PetscCall(start_drops(r, drops, &still));
  still     = (PetscBool)(still || steady); /* no time in which to go */
  s->inside = (PetscBool)!still;
  if (steady || (!still && with_bodies)) PetscCall(OptBool("-mesh_track", &r->tracks));
  PetscCheck(!steady || !r->tracks, comm, PETSC_ERR_USER_INPUT,
             "-mesh_track does not work with -sim_steady, where no body moves: remove -mesh_track");
  PetscCheck(still || !with_bodies || r->tracks, comm, PETSC_ERR_USER_INPUT,
             "-mesh_refine bodies, or a box with a group, refines where bodies are at the start, and these move: give -mesh_track, or name a box around their way "
             "(-mesh_refine <box>, -mesh_box_<box>_corners)");
  if (r->tracks) PetscCall(start_tracking(r));
  if (still) PetscCall(RefineIsByFlow(&adapt));
  if (adapt) PetscCall(start_coarse(r));
  surface = mesh_surface(r);
  PetscCall(MeshCreateAround(comm, BodyDistanceHasAny(s) || adapt ? &surface : NULL, mesh));
  PetscCall(remark_cut_jumps(s, *mesh));
  PetscCall(BodyDistanceFree(s));
  r->mesh = *mesh;
  *refine = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineDestroy(Refine *refine)
{
  PetscFunctionBeginUser;
  if (!*refine) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodyDistanceFree(&(*refine)->surface));
  PetscCall(DropDistanceDestroy(&(*refine)->surface.drops));
  PetscCall(ElasticSurfacesDestroy(&(*refine)->outlines));
  PetscCall(PetscFree((*refine)->x));
  if ((*refine)->surface.X) {
    PetscCall(BodiesDetach((*refine)->surface.bodies, (void **)&(*refine)->surface.X));
    PetscCall(BodiesDetach((*refine)->surface.bodies, (void **)&(*refine)->surface.q));
    PetscCall(BodiesDetach((*refine)->surface.bodies, (void **)&(*refine)->surface.u));
  }
  PetscCall(PetscFree(*refine));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineSetBodies(Refine r, Bodies bodies, PetscInt reach)
{
  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  r->surface.bodies = bodies;
  r->reach          = reach;
  PetscCall(BodiesGetState(bodies, &r->surface.s));
  if (!r->tracks) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesAttach(bodies, sizeof(*r->surface.X), (void **)&r->surface.X));
  PetscCall(BodiesAttach(bodies, sizeof(*r->surface.q), (void **)&r->surface.q));
  PetscCall(BodiesAttach(bodies, sizeof(*r->surface.u), (void **)&r->surface.u));
  PetscCall(set_body_positions(r, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The one door for a changed mesh: what stands on it is made anew, its fields come from the old one, which goes. Before
   the change CoupleBeforeRemesh, but where fields will be loaded. */
static PetscErrorCode renew_above(Refine r, Mesh old)
{
  PetscFunctionBeginUser;
  if (r->flow) PetscCall(CoupleSetSubdomains(r->mesh, r->surface.bodies, r->reach));
  if (r->flow) PetscCall(FlowRemesh(r->flow, old));
  if (r->adapt) PetscCall(AdaptRemesh(r->adapt, old));
  if (r->client) PetscCall((*r->renew)(r->client, old));
  if (r->couple) PetscCall(CoupleAfterRemesh(r->couple, &old));
  PetscCall(MeshDestroy(&old));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode remesh(Refine r)
{
  MeshSurface surface = mesh_surface(r);
  Mesh        old;

  PetscFunctionBeginUser;
  if (r->couple) PetscCall(CoupleBeforeRemesh(r->couple));
  PetscCall(MeshRemesh(r->mesh, BodyDistanceHasAny(&r->surface) ? &surface : NULL, &old));
  PetscCall(BodyDistanceFree(&r->surface));
  PetscCall(renew_above(r, old));
  /* rigid ones, where there are any, become known as the step predicts them */
  if (r->couple && !r->surface.s->nall) PetscCall(CoupleUpdateLocalBodies(r->couple));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineReplace(Refine r, Mesh now)
{
  PetscFunctionBeginUser;
  if (r->couple) PetscCall(CoupleBeforeRemesh(r->couple));
  PetscCall(MeshReplace(r->mesh, now));
  PetscCall(renew_above(r, now));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineTrack(Refine r, PetscReal dt)
{
  PetscLogDouble begin, end;
  PetscReal      way;
  PetscBool      due = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (!r || !r->tracks) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < r->surface.s->n && !due; k++) {
    PetscReal track_distance = 0;

    if (r->surface.s->removed[k]) continue;
    PetscCall(find_displacement(r, k, dt, &track_distance));
    due = (PetscBool)(track_distance > r->surface.margin);
  }
  PetscCall(drop_displacement(r, dt, &way));
  due = (PetscBool)(due || PetscMax(way, solid_displacement(r, dt)) > r->surface.margin);
  PetscCall(BodiesAny(r->surface.bodies, &due));
  if (!due) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(LimitsExceed(r->limits, r->row));
  PetscCall(PetscTime(&begin));
  PetscCall(set_body_positions(r, dt));
  PetscCall(set_solid_positions(r, dt));
  PetscCall(set_drop_positions(r, dt));
  PetscCall(remesh(r));
  PetscCall(PetscTime(&end));
  PetscCall(MonitorPhaseSeconds(r->monitor, MONITOR_MESH, end - begin));
  r->changes++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineReport(Refine r)
{
  PetscFunctionBeginUser;
  if (!r || !r->tracks) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MonitorQuantity(r->monitor, "mesh_changes", (PetscReal)r->changes));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- checkpoints ---- */

static PetscErrorCode restore(void *refine, State look)
{
  Refine r = refine;
  Mesh   old;

  PetscFunctionBeginUser;
  PetscCall(MeshRestore(r->mesh, look, &old));
  if (old) PetscCall(renew_above(r, old));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit_solids(Refine r, State state)
{
  PetscBool has;

  PetscFunctionBeginUser;
  if (!r->solids) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(StateHas(state, "solids", &has));
  if (!has) PetscFunctionReturn(PETSC_SUCCESS); /* where they started: the mesh follows in the next step */
  PetscCall(StateReals(state, "solids", r->solids->dim * r->solids->nnode, r->x));
  PetscCall(ElasticSurfacesSet(r->outlines, r->x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit_drops(Refine r, State state)
{
  PetscBool has = PETSC_TRUE;

  PetscFunctionBeginUser;
  if (!r->surface.drops) PetscFunctionReturn(PETSC_SUCCESS);
  if (StateIsLoading(state)) PetscCall(StateHas(state, "drops_started", &has)); /* as of solids */
  if (has) PetscCall(DropDistanceVisit(r->surface.drops, state));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The run before may have followed no body: then the present one begins with where they are */
static PetscErrorCode visit_state(void *refine, State state)
{
  Refine         r    = refine;
  const Bodies   b    = r->surface.bodies;
  const PetscInt n    = r->surface.s->nall;
  PetscInt       size = 3 * n;
  BodyRows       rows;

  PetscFunctionBeginUser;
  if (!r->tracks) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(visit_solids(r, state));
  PetscCall(visit_drops(r, state));
  if (StateIsLoading(state)) PetscCall(StateGetSize(state, "place", &size));
  if (size == 3 * n) {
    PetscCall(BodiesBeginRows(b, &rows));
    PetscCall(BodiesVisitReals(b, &rows, state, "place", 3, (PetscReal *)r->surface.X));
    PetscCall(BodiesVisitReals(b, &rows, state, "orientation", 4, (PetscReal *)r->surface.q));
    PetscCall(StateInts(state, "changes", 1, &r->changes));
    if (StateIsLoading(state)) PetscCall(StateGetSize(state, "velocity", &size));
    if (size == 3 * n) PetscCall(BodiesVisitReals(b, &rows, state, "velocity", 3, (PetscReal *)r->surface.u));
    PetscCall(BodiesEndRows(&rows));
  } else PetscCall(set_body_positions(r, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineConnect(Refine r, Flow flow, Couple couple, Adapt adapt, Limits limits, Checkpoint checkpoint,
                             Monitor monitor)
{
  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  r->flow    = flow;
  r->couple  = couple;
  r->adapt   = adapt;
  r->limits  = limits;
  r->monitor = monitor;
  if (r->tracks)
    PetscCall(LimitsAdd(limits,
                        &(Limit){LIMIT_CHECK, "mesh", "the displacement of bodies on one mesh", "-mesh_track_distance",
                                 "finest cells", "cells are rebuilt", r->track_distance, NULL, NULL},
                        &r->row));
  if (!checkpoint) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CheckpointSetRestore(checkpoint, "tree", r, restore));
  PetscCall(CheckpointAdd(checkpoint, "tree", r->mesh, MeshVisitTree));
  PetscCall(CheckpointAdd(checkpoint, "refine", r, visit_state));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineSetClient(Refine r, PetscErrorCode (*renew)(void *client, Mesh old), void *client)
{
  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  r->client = client;
  r->renew  = renew;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineMatch(Refine r)
{
  MeshSurface surface;
  PetscBool   same;

  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  surface = mesh_surface(r);
  PetscCall(MeshIsAround(r->mesh, BodyDistanceHasAny(&r->surface) ? &surface : NULL, &same));
  PetscCall(BodyDistanceFree(&r->surface));
  if (!same) PetscCall(remesh(r));
  PetscFunctionReturn(PETSC_SUCCESS);
}
