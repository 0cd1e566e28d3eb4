/* Refine: see refine.h. */
#include "compat.h"
#include "refine.h"
#include "base/log.h"
#include "base/opt.h"
#include "mesh/carry.h"

#define AHEAD 10 /* steps that a new mesh looks ahead */

typedef struct {
  Bodies     bodies;
  BodyState *s;
  PetscInt   dim;
  PetscReal  period[3];
  PetscBool  inside; /* insides count as surface */
  PetscReal  margin; /* bands are wider by this */
  /* where the bodies are */
  const PetscReal (*X)[3], (*q)[4];
} Surface;

struct _p_Refine {
  MPI_Comm comm;
  Mesh     mesh;
  Surface  surface;
  PetscReal (*X)[3], (*q)[4], way, seconds; /* way: -mesh_follow_way */
  PetscInt changes;
};

/* Smallest distance of x to any body, looked at closely for those within reach only */
static PetscErrorCode measure_distance(void *context, const PetscReal x[3], PetscReal reach, PetscReal *d)
{
  const Surface *s = context;

  PetscFunctionBeginUser;
  *d = PETSC_MAX_REAL;
  for (PetscInt k = 0; k < s->s->n; k++) {
    PetscReal y[3] = {0, 0, 0}, r = 0, at;

    for (PetscInt a = 0; a < s->dim; a++) {
      y[a] = DomainNearest(s->period[a], x[a], s->X[k][a]);
      r += PetscSqr(y[a] - s->X[k][a]);
    }
    r = PetscSqrtReal(r) - BodiesGetRadius(s->s, k);
    r -= s->margin;
    if (s->s->gone[k] || r > reach || r > *d) continue;
    PetscCall(BodiesDistance(s->bodies, k, s->X[k], s->q[k], 1, y, &at));
    *d = PetscMin(*d, s->inside ? PetscMax(at - s->margin, 0) : PetscAbsReal(at));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells that a surface cuts and that have nodes of a larger cell cost iterations: 11 become 19, 30 become 45 */
static PetscErrorCode remark_cut_jumps(Surface *s, Mesh mesh)
{
  const MeshLocal *l;
  PetscInt         cut   = 0;
  Surface          plain = *s;

  PetscFunctionBeginUser;
  plain.inside = PETSC_FALSE;
  plain.margin = 0;
  PetscCall(MeshGetLocal(mesh, &l));
  for (PetscInt c = 0; c < l->ncell && s->s->n; c++) {
    PetscReal xc[MESH_MAX_NB * 3], centre[3] = {0, 0, 0}, r = 0, d;

    if (!MeshCellHang(l, c)) continue;
    PetscCall(MeshCellCoordinates(mesh, c, xc));
    for (PetscInt a = 0; a < l->dim; a++) {
      centre[a] = xc[(l->nb / 2) * l->dim + a];
      r += PetscSqr(centre[a] - xc[a]);
    }
    r = PetscSqrtReal(r);
    PetscCall(measure_distance(&plain, centre, r, &d));
    cut += d < r;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &cut, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD));
  if (cut)
    PetscCall(LogRemark("levels of the mesh jump at %" PetscInt_FMT
                        " cells that a body's surface is in: up to three times the iterations. Raise -mesh_band, or move or enlarge the boxes of "
                        "-mesh_refine",
                        cut));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where bodies are, and as far ahead as half of the way allows; dt 0: at the start, where they are */
static PetscErrorCode place_bodies(Refine r, PetscReal dt)
{
  BodyState *s = r->surface.s;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal speed = 0, ahead = AHEAD * dt;

    for (PetscInt a = 0; a < s->dim; a++) speed += PetscSqr(s->u[k][a]);
    speed = PetscSqrtReal(speed);
    if (speed * ahead > r->surface.margin) ahead = r->surface.margin / speed;
    for (PetscInt a = 0; a < 3; a++) r->X[k][a] = s->x[k][a] + ahead * s->u[k][a];
    PetscCall(PetscArraycpy(r->q[k], s->q[k], 4));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* How far a point of body k can be at the end of the step from where the mesh has it */
static PetscErrorCode find_way(Refine r, PetscInt k, PetscReal dt, PetscReal *way)
{
  BodyState *s = r->surface.s;
  PetscReal  X[3], q[4], angle, dot = 0;

  PetscFunctionBeginUser;
  PetscCall(BodiesPredict(r->surface.bodies, k, dt, 1, X, q, &angle));
  *way = 0;
  for (PetscInt a = 0; a < s->dim; a++) *way += PetscSqr(DomainNearest(r->surface.period[a], X[a] - r->X[k][a], 0));
  for (PetscInt a = 0; a < 4; a++) dot += q[a] * r->q[k][a];
  *way = PetscSqrtReal(*way);
  if (BodiesGetDisc(s, k) == 0) *way += 2 * BodiesGetRadius(s, k) * PetscSqrtReal(PetscMax(0, 1 - PetscSqr(PetscMin(1, PetscAbsReal(dot)))));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_follower(MPI_Comm comm, const Surface *surface, Refine *refine)
{
  Refine    r;
  PetscReal way    = 2;
  PetscBool follow = PETSC_FALSE;

  PetscFunctionBeginUser;
  *refine = NULL;
  PetscCall(OptBool("-mesh_follow", &follow));
  if (!follow) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptReal("-mesh_follow_way", &way));
  PetscCall(PetscNew(&r));
  r->comm    = comm;
  r->surface = *surface;
  r->way     = way;
  PetscCall(PetscCalloc2(surface->s->n, &r->X, surface->s->n, &r->q));
  PetscCall(place_bodies(r, 0));
  r->surface.X = r->X;
  r->surface.q = r->q;
  *refine      = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineCreateMesh(MPI_Comm comm, PetscBool around, Bodies *bodies, Mesh *mesh, Refine *refine)
{
  Surface   surface = {0}, *s = &surface;
  PetscReal lower[3], upper[3];
  PetscBool still;

  PetscFunctionBeginUser;
  PetscCall(MeshReadBox(comm, &s->dim, lower, upper, s->period));
  PetscCall(BodiesCreate(s->dim, lower, upper, bodies));
  s->bodies = *bodies;
  PetscCall(BodiesGetState(*bodies, &s->s));
  PetscCall(BodiesAreStill(*bodies, &still));
  s->inside = (PetscBool)!still;
  s->X      = s->s->x;
  s->q      = s->s->q;
  *refine   = NULL;
  if (!still && around) PetscCall(create_follower(comm, s, refine));
  PetscCheck(still || !around || *refine, comm, PETSC_ERR_USER_INPUT,
             "-mesh_refine bodies refines where bodies are at the start, and these move: give -mesh_follow, or name a box around their way "
             "(-mesh_refine <box>, -mesh_box_<box>_corners)");
  if (*refine) s = &(*refine)->surface;
  /* the size of the finest cells is known when there are some */
  if (*refine) PetscCall(MeshReadFinest(comm, &s->margin));
  if (*refine) s->margin *= 0.5 * (*refine)->way;
  PetscCall(MeshCreateAround(comm, s->s->n ? &(MeshSurface){measure_distance, s} : NULL, mesh));
  PetscCall(remark_cut_jumps(s, *mesh));
  if (*refine) (*refine)->mesh = *mesh;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineDestroy(Refine *refine)
{
  PetscFunctionBeginUser;
  if (!*refine) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree2((*refine)->X, (*refine)->q));
  PetscCall(PetscFree(*refine));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineCheck(Refine r)
{
  static const char *const OTHERS[] = {"-sim_adapt", "-sim_steady", "-sim_frame"};
  char                     from[8]  = "";

  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < 3; i++) {
    char      text[8];
    PetscBool given, off, none;

    PetscCall(OptHas(OTHERS[i], &given));
    PetscCall(OptPeek(OTHERS[i], text, sizeof(text)));
    PetscCall(PetscStrcasecmp(text, "false", &off));
    PetscCall(PetscStrcasecmp(text, "none", &none));
    PetscCheck(!given || off || none || text[0] == '0', r->comm, PETSC_ERR_SUP,
               "-mesh_follow does not work with %s: switch that off (a preset may have chosen it), or remove -mesh_follow", OTHERS[i]);
  }
  PetscCall(OptPeek("-sim_restart", from, sizeof(from)));
  PetscCheck(!from[0], r->comm, PETSC_ERR_SUP,
             "-sim_restart does not know where a mesh that follows bodies was: run from the start, or without -mesh_follow");
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineFollow(Refine r, Flow flow, Couple couple, PetscReal dt)
{
  Mesh           old;
  PetscLogDouble begin, end;
  PetscBool      due = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < r->surface.s->n && !due; k++) {
    PetscReal way = 0;

    if (r->surface.s->gone[k]) continue;
    PetscCall(find_way(r, k, dt, &way));
    due = (PetscBool)(way > r->surface.margin);
  }
  if (!due) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscTime(&begin));
  PetscCall(place_bodies(r, dt));
  PetscCall(CoupleLeave(couple));
  PetscCall(MeshRemesh(r->mesh, &(MeshSurface){measure_distance, &r->surface}, &old));
  PetscCall(FlowRemesh(flow, old));
  PetscCall(CoupleRemesh(couple, &old));
  PetscCall(MeshDestroy(&old));
  PetscCall(PetscTime(&end));
  r->seconds += end - begin;
  r->changes++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineReport(Refine r, Monitor monitor)
{
  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MonitorQuantity(monitor, "mesh_changes", (PetscReal)r->changes));
  PetscCall(MonitorQuantity(monitor, "mesh_seconds", r->seconds));
  PetscFunctionReturn(PETSC_SUCCESS);
}
