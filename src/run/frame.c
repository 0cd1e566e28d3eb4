/* Frame: see frame.h. */
#include "compat.h"
#include "base/runcomm.h"
#include "frame.h"
#include "base/domain.h"
#include "base/opt.h"
#include "bodies/local.h"

enum {
  NONE,
  BODY,
  VELOCITY
};
static const char *const KINDS[] = {"none", "body", "velocity", NULL};

struct _p_Frame {
  Flow             flow;
  Bodies           bodies;
  const MeshLocal *loc;
  PetscInt         kind, body, axes;
  PetscReal        velocity[3];
  PetscReal        start[3]; /* where in the box the body stays */
  PetscReal        now[3], old[3], next[3];
};

static PetscErrorCode read_body(Frame f, PetscInt open)
{
  BodyState *s;
  PetscBool  given = PETSC_FALSE;
  PetscInt   k;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(f->bodies, &s));
  PetscCall(OptInt("-sim_frame_body", &f->body));
  PetscCheck(f->body < s->nall, RunComm(), PETSC_ERR_USER_INPUT,
             "Option -sim_frame_body %" PetscInt_FMT ": this scene has %" PetscInt_FMT
             " bodies, numbered from 0 as in bodies.csv",
             f->body, s->nall);
  PetscCall(OptAxes("-sim_frame_axes", f->loc->dim, &f->axes, &given));
  if (!given) f->axes = open;
  PetscCheck(given || open, RunComm(), PETSC_ERR_USER_INPUT,
             "Option -sim_frame body: walls stand across every axis and would travel with the box: make the ends of the way inflow (of the fluid ahead, as seen "
             "from the laboratory), outflow or periodic");
  k = BodiesFindOwn(s, f->body);
  if (k >= 0) PetscCall(PetscArraycpy(f->start, s->x[k], 3));
  PetscCall(BodiesSum(f->bodies, 3, f->start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_velocity(Frame f)
{
  PetscBool given;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray("-sim_frame_velocity", f->loc->dim, f->velocity, &given));
  PetscCheck(given, RunComm(), PETSC_ERR_USER_INPUT,
             "Option -sim_frame velocity: give the velocity of the box with -sim_frame_velocity");
  for (PetscInt a = 0; a < f->loc->dim; a++)
    if (f->velocity[a] != 0) f->axes |= 1 << a;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_axes(Frame f, PetscInt open)
{
  const FlowParameters *par;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < f->loc->dim; a++)
    PetscCheck(!((f->axes & ~open) >> a & 1), RunComm(), PETSC_ERR_USER_INPUT,
               "Option -sim_frame %s: a wall (or a boundary that is no plane along an axis) stands across %c and would travel with the box: make both ends inflow (of "
               "the fluid ahead, as seen from the laboratory), outflow or periodic, or let the box not move along %c (-sim_frame_%s)",
               KINDS[f->kind], (char)('x' + a), (char)('x' + a), f->kind == BODY ? "axes" : "velocity");
  PetscCall(FlowGetParameters(f->flow, &par));
  PetscCheck(par->convection, RunComm(), PETSC_ERR_USER_INPUT,
             "Option -sim_frame %s: the velocity of the box is part of the convection: set -flow_convection true, or leave out -sim_frame",
             KINDS[f->kind]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FrameCreate(Flow flow, Bodies bodies, const MeshLocal *l, Frame *frame)
{
  Frame    f;
  PetscInt open, kind = NONE;

  PetscFunctionBeginUser;
  *frame = NULL;
  PetscCall(OptChoice("-sim_frame", KINDS, &kind));
  if (kind == NONE) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&f));
  f->flow   = flow;
  f->bodies = bodies;
  f->loc    = l;
  f->kind   = kind;
  PetscCall(ConditionsGetSlidingAxes(FlowConditions(flow), &open));
  if (kind == BODY) PetscCall(read_body(f, open));
  else PetscCall(read_velocity(f));
  PetscCall(check_axes(f, open));
  PetscCall(BodiesStartFrame(bodies, l->period));
  *frame = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FrameDestroy(Frame *frame)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(*frame));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FrameView(Frame f, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  if (!f) PetscFunctionReturn(PETSC_SUCCESS);
  if (f->kind == BODY)
    PetscCall(PetscViewerASCIIPrintf(viewer, "frame: the box follows body %" PetscInt_FMT " along%s%s%s\n", f->body,
                                     f->axes & 1 ? " x" : "", f->axes & 2 ? " y" : "", f->axes & 4 ? " z" : ""));
  else
    PetscCall(PetscViewerASCIIPrintf(viewer, "frame: the box moves with velocity (%g, %g, %g)\n",
                                     (double)f->velocity[0], (double)f->velocity[1], (double)f->velocity[2]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where the box must be at the end of the step for the body, as the step predicts it, to be drawn where it was at first
   */
static PetscErrorCode track_body(Frame f)
{
  const FlowStep *step;
  BodyState      *s;
  PetscReal       X[3], q[4], angle, displacement[3] = {0, 0, 0};
  PetscInt        k;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(f->flow, &step));
  PetscCall(BodiesGetState(f->bodies, &s));
  k = BodiesFindOwn(s, f->body);
  PetscCheck(k < 0 || !s->removed[k], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Body %" PetscInt_FMT
             " has left the domain, and -sim_frame body cannot follow it any more: widen the domain, or end the run before t = %g",
             f->body, (double)s->time);
  PetscCall(BodiesSetFrame(f->bodies, f->now, step->frame));
  PetscCall(BodiesSetTime(f->bodies, step->time - step->dt));
  if (k >= 0) PetscCall(BodiesPredict(f->bodies, k, step->dt, step->order, X, q, &angle));
  for (PetscInt a = 0; a < f->loc->dim && k >= 0; a++)
    if ((f->axes >> a) & 1) displacement[a] = DomainNearest(f->loc->period[a], X[a] - f->start[a], 0);
  PetscCall(BodiesSum(f->bodies, 3, displacement));
  for (PetscInt a = 0; a < 3; a++) f->next[a] = f->now[a] + displacement[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FrameBegin(Frame f)
{
  const FlowStep *step;
  PetscReal       v[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(f->flow, &step));
  if (f->kind == BODY) PetscCall(track_body(f));
  else
    for (PetscInt a = 0; a < 3; a++) f->next[a] = f->now[a] + step->dt * f->velocity[a];
  for (PetscInt a = 0; a < f->loc->dim; a++) {
    /* c_t X - d(X) by differences, for the box may be far from where it began */
    const PetscReal displacement = f->next[a] - f->now[a], before = f->now[a] - f->old[a];

    v[a] = f->kind == VELOCITY ? f->velocity[a] : step->ct * displacement + step->d1 * before;
  }
  PetscCall(FlowSetFrame(f->flow, v));
  PetscCall(BodiesSetFrame(f->bodies, f->next, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FrameAccept(Frame f)
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(f->old, f->now, 3));
  PetscCall(PetscArraycpy(f->now, f->next, 3));
  PetscCall(BodiesAcceptFrame(f->bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FrameVisitState(void *frame, State state)
{
  Frame           f = (Frame)frame;
  const FlowStep *step;
  PetscReal       v[3];

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(f->flow, &step));
  PetscCall(PetscArraycpy(v, step->frame, 3));
  PetscCall(StateReals(state, "place", 3, f->now));
  PetscCall(StateReals(state, "place_old", 3, f->old));
  PetscCall(StateReals(state, "start", 3, f->start));
  PetscCall(StateReals(state, "velocity", 3, v));
  if (!StateIsLoading(state)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArraycpy(f->next, f->now, 3));
  PetscCall(FlowSetFrame(f->flow, v));
  PetscCall(BodiesSetFrame(f->bodies, f->now, v));
  PetscCall(BodiesAcceptFrame(f->bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}
