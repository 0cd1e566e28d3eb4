/* Resume: a run goes on from a checkpoint with options that are not those of the run that wrote it. What is prescribed
   is a function of time and start (motion.h), so that another motion, or one that was free before, would put bodies
   elsewhere at once. Where that is so, for an axis or the turn of a group, the motion begins anew: its start is where
   the bodies are, its time 0 is now. Starts and clocks that are not those of the options go into the checkpoints that
   follow. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/log.h"
#include "base/sparse.h"

#define SMALL 1e-9 /* of a radius, rad: what is no jump */

/* Where a body of a group starts that is not all free */
typedef struct {
  PetscInt  group, index; /* number within it */
  PetscReal x[3], q[4], angle;
} Start;

static void start_orientation(const Placement *p, PetscReal q[4])
{
  if (p->turned) (void)PetscArraycpy(q, p->q, 4);
  else RotationFromAngle(p->angle, q);
}

PetscErrorCode BodyGatherStarts(Bodies b)
{
  const BodyArrays *s = &b->state;
  Start            *own, *all;
  PetscInt          n = 0, total;

  PetscFunctionBeginUser;
  if (!b->subdomains) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(s->n, &own));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscInt g = s->body_group[k];

    if (!s->own[k] || !b->start[g]) continue;
    own[n] = (Start){.group = g, .index = s->number[k] - s->group[g].first, .angle = BodyStart(b, k)->angle};
    PetscCall(PetscArraycpy(own[n].x, BodyStart(b, k)->x, 3));
    start_orientation(BodyStart(b, k), own[n++].q);
  }
  PetscCall(SparseGather(BodiesComm(b), n, sizeof(*own), own, &total, &all, NULL));
  for (PetscInt i = 0; i < total; i++) BodySetStart(b, all[i].group, all[i].index, all[i].x, all[i].q, all[i].angle);
  PetscCall(PetscFree(own));
  PetscCall(PetscFree(all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- state ---- */

static PetscBool has_clocks(Bodies b)
{
  for (PetscInt g = 0; g < b->state.ngroups; g++)
    for (PetscInt a = 0; a < 4; a++)
      if (b->clock[g][a] != 0) return PETSC_TRUE;
  return PETSC_FALSE;
}

PetscErrorCode BodyVisitStarts(Bodies b, const BodyRows *rows, State state)
{
  const BodyArrays *s = &b->state;
  PetscInt          n = has_clocks(b) ? 4 * s->ngroups : -1;
  PetscReal(*x)[3], (*q)[4], *angle;

  PetscFunctionBeginUser;
  if (StateIsLoading(state)) PetscCall(StateGetSize(state, "motion_clock", &n));
  if (n != 4 * s->ngroups) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(StateReals(state, "motion_clock", n, (PetscReal *)b->clock));
  PetscCall(PetscCalloc3(s->n, &x, s->n, &q, s->n, &angle));
  for (PetscInt k = 0; k < s->n; k++) {
    if (!b->start[s->body_group[k]]) continue;
    PetscCall(PetscArraycpy(x[k], BodyStart(b, k)->x, 3));
    start_orientation(BodyStart(b, k), q[k]);
    angle[k] = BodyStart(b, k)->angle;
  }
  PetscCall(BodiesVisitReals(b, rows, state, "motion_x", 3, (PetscReal *)x));
  PetscCall(BodiesVisitReals(b, rows, state, "motion_q", 4, (PetscReal *)q));
  PetscCall(BodiesVisitReals(b, rows, state, "motion_angle", 1, angle));
  for (PetscInt k = 0; k < s->n && StateIsLoading(state); k++) {
    const PetscInt g = s->body_group[k];

    if (b->start[g]) BodySetStart(b, g, s->number[k] - s->group[g].first, x[k], q[k], angle[k]);
  }
  if (StateIsLoading(state)) PetscCall(BodyGatherStarts(b));
  PetscCall(PetscFree3(x, q, angle));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- going on ---- */

/* Does body k move by the options of its group at all, in a way that has a start? */
static PetscBool has_start(Bodies b, PetscInt k)
{
  const PetscInt g = b->state.body_group[k];

  return (PetscBool)(b->start[g] && !b->state.group[g].body_fitted && !b->state.removed[k]);
}

/* The point of body k that `position` places, in the laboratory */
static PetscErrorCode reference_point(Bodies b, PetscInt k, PetscReal x[3])
{
  PetscReal arm[3];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetArm(b, k, NULL, arm));
  for (PetscInt a = 0; a < 3; a++) x[a] = b->state.x[k][a] - arm[a] + b->state.frame[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Without whole lengths of the domain, by which bodies may have been put back in a periodic one */
static PetscReal nearest(Bodies b, PetscInt a, PetscReal d)
{
  const PetscReal length = b->upper[a] - b->lower[a];

  return d - length * PetscFloorReal(d / length + 0.5);
}

/* Which of x, y, z, turn of body k the options would change at once */
static PetscErrorCode find_jumps(Bodies b, PetscInt k, PetscReal jumps[4])
{
  const BodyArrays *s = &b->state;
  const BodyGroup  *g = BodiesGetGroup(&b->view, k);
  PetscReal         x[3], u[3], turn[3], w[3], at[3], X[3], q[4], angle, same = 0, opposite = 0;

  PetscFunctionBeginUser;
  PetscCall(BodyEvaluateMotion(b, k, s->time, x, u, turn, w));
  PetscCall(reference_point(b, k, at));
  for (PetscInt a = 0; a < s->dim; a++)
    if (!(g->free & (BODY_FREE_X << a)) &&
        PetscAbsReal(nearest(b, a, x[a] - at[a])) > SMALL * BodiesGetRadius(&b->view, k))
      jumps[a] = 1;
  PetscCall(BodiesPredict(b, k, 0, 0, X, q, &angle));
  for (PetscInt a = 0; a < 4; a++) {
    same += PetscSqr(q[a] - s->q[k][a]);
    opposite += PetscSqr(q[a] + s->q[k][a]);
  }
  if (PetscMin(same, opposite) > PetscSqr(SMALL) || PetscAbsReal(angle - s->angle[k]) > SMALL) jumps[3] = 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The motion of body k begins here and now */
static PetscErrorCode begin_anew(Bodies b, PetscInt k, const PetscReal jumps[4])
{
  const BodyArrays *s = &b->state;
  const BodyGroup  *g = BodiesGetGroup(&b->view, k);
  Placement        *p = BodyStart(b, k);
  PetscReal         x[3], u[3], turn[3], w[3], at[3];

  PetscFunctionBeginUser;
  PetscCall(MotionEvaluate(&g->motion, p, 0, x, u, turn, w));
  PetscCall(reference_point(b, k, at));
  for (PetscInt a = 0; a < s->dim; a++)
    if (jumps[a] > 0) p->x[a] += at[a] - x[a];
  if (jumps[3] == 0) PetscFunctionReturn(PETSC_SUCCESS);
  if (g->free & BODY_FREE_ROTATION) PetscCall(PetscArrayzero(turn, 3));
  p->angle  = s->angle[k] - dot3(turn, g->motion.axis);
  p->turned = (PetscBool)(s->dim == 3);
  PetscCall(PetscArraycpy(p->q, s->q[k], 4));
  if (s->dim == 3) RotationAdvance(-1, turn, p->q);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Stops may be others than before */
static PetscErrorCode check_stops(Bodies b, PetscInt k)
{
  BodyArrays     *s     = &b->state;
  const Motion   *m     = &BodiesGetGroup(&b->view, k)->motion;
  const char     *name  = BodiesGetGroup(&b->view, k)->name;
  const PetscReal angle = s->angle[k];

  PetscFunctionBeginUser;
  if (s->stopped[k] && (!m->has_stops || PetscAbsReal(angle - m->stops[s->stopped[k] > 0]) > SMALL)) s->stopped[k] = 0;
  PetscCheck(!m->has_stops || (angle >= m->stops[0] - SMALL && angle <= m->stops[1] + SMALL), PETSC_COMM_SELF,
             PETSC_ERR_USER_INPUT,
             "Body %" PetscInt_FMT
             " of group '%s' is at the angle %g in the checkpoint, beyond -particle_%s_stops %g,%g: give stops around it, or none",
             BodiesIndexInGroup(&b->view, k), name, (double)angle, name, (double)m->stops[0], (double)m->stops[1]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode report_jumps(Bodies b, PetscInt g, const PetscReal jumps[4])
{
  static const char *const WORD[]   = {"x", "y", "z", "rotation"};
  char                     list[64] = "";

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 4; a++) {
    if (jumps[a] == 0) continue;
    PetscCall(PetscStrlcat(list, list[0] ? ", " : "", sizeof(list)));
    PetscCall(PetscStrlcat(list, WORD[a], sizeof(list)));
  }
  PetscCall(
    LogRemark("what is prescribed of the bodies of group '%s' (%s) is not what it was when the checkpoint was written: it begins now, at t = %g, where "
              "they are, and the time of its formulas, ramp and files counts from now",
              b->state.group[g].name, list, (double)b->state.time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesResume(Bodies b)
{
  const BodyArrays *s      = &b->state;
  PetscInt          jumped = 0;
  PetscReal(*jumps)[4];

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(s->ngroups, &jumps));
  for (PetscInt k = 0; k < s->n; k++) {
    if (!has_start(b, k) || !s->own[k]) continue;
    PetscCall(check_stops(b, k));
    PetscCall(find_jumps(b, k, jumps[s->body_group[k]]));
  }
  PetscCall(BodiesMax(b, 4 * s->ngroups, (PetscReal *)jumps));
  for (PetscInt i = 0; i < 4 * s->ngroups; i++) jumped += jumps[i / 4][i % 4] > 0;
  for (PetscInt k = 0; k < s->n && jumped; k++)
    if (has_start(b, k)) PetscCall(begin_anew(b, k, jumps[s->body_group[k]]));
  if (jumped) PetscCall(BodyGatherStarts(b));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscBool any = PETSC_FALSE;

    for (PetscInt a = 0; a < 4; a++) {
      if (jumps[g][a] == 0) continue;
      any            = PETSC_TRUE;
      b->clock[g][a] = s->time;
    }
    if (any) PetscCall(report_jumps(b, g, jumps[g]));
    for (PetscInt k = 0; k < s->n && any; k++)
      if (s->body_group[k] == g && has_start(b, k)) PetscCall(BodiesApplyPrescribed(b, k, s->time));
  }
  PetscCall(PetscFree(jumps));
  PetscFunctionReturn(PETSC_SUCCESS);
}
