/* Gauge: see gauge.h. */
#include "compat.h"
#include "gauge.h"
#include "base/opt.h"
#include "bodies/local.h"

#define PER_BODY 12   /* subjects */
#define NOISE    1e-3 /* forces, in those of viscosity and inertia at the largest speed, that are errors alone */
#define START    0.5  /* share of the run that is not gauged */
#define MOVED    0.5  /* of the fluid's largest speed, to which velocities of bodies are compared at least */

/* Values stand body by body, subject by subject, those of the fluid after them */
struct _p_Gauge {
  Flow       flow;
  Bodies     bodies;
  BodyState *s;
  PetscInt   n, steps, order;
  PetscReal  from, time, weight;                      /* weight: time that was gauged */
  PetscReal  speed;                                   /* largest so far */
  PetscReal *now, *before, *sum, *max, *min, *radius; /* before: one step earlier */
  PetscBool *has, looked;                             /* looked: before is known */
};

/* ---- who has what ---- */

/* A body is gauged by its force where it is not free, else by its velocity */
static void mark_body(Gauge g, const BodyGroup *group, PetscInt number, PetscBool driven)
{
  const PetscInt  bit[3] = {BODY_FREE_X, BODY_FREE_Y, BODY_FREE_Z};
  const PetscBool turns  = (PetscBool)((group->free & BODY_FREE_ROTATION) != 0);
  PetscBool      *has    = g->has + number * PER_BODY;

  for (PetscInt a = 0; a < 3; a++) {
    const PetscBool goes  = (PetscBool)((group->free & bit[a]) != 0 && !group->motion.has_pivot),
                    plane = (PetscBool)(g->s->dim == 3 || a == 2);

    if (a < g->s->dim) has[goes ? 6 + a : a] = (PetscBool)(goes || !driven);
    if (plane) has[turns ? 9 + a : 3 + a] = (PetscBool)(turns || !driven);
  }
}

static PetscErrorCode choose_values(Gauge g)
{
  const FlowParameters *par;
  PetscBool             driven = PETSC_FALSE, all_prescribed = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(g->flow, &par));
  for (PetscInt i = 0; i < g->s->ngroups; i++) all_prescribed = (PetscBool)(all_prescribed && !g->s->group[i].free);
  for (PetscInt a = 0; a < g->s->dim; a++) driven = (PetscBool)(driven || (par->force[a] != 0 && all_prescribed));
  for (PetscInt i = 0; i < g->s->ngroups; i++)
    for (PetscInt k = 0; k < g->s->group[i].count; k++) mark_body(g, &g->s->group[i], g->s->group[i].first + k, driven);
  for (PetscInt a = 0; a < g->s->dim && driven; a++) g->has[g->s->nall * PER_BODY + a] = PETSC_TRUE;
  g->has[g->s->nall * PER_BODY + 3] = (PetscBool)(g->s->nall == 0 && !driven);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode GaugeCreate(const SimComponents *p, PetscReal end, Gauge *gauge)
{
  BodyState *s;
  Gauge      g;
  PetscBool  given;

  PetscFunctionBeginUser;
  *gauge = NULL;
  PetscCall(BodiesGetState(p->bodies, &s));
  if (s->nall > GAUGE_BODIES) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&g));
  g->flow   = p->flow;
  g->bodies = p->bodies;
  g->s      = s;
  g->n      = PER_BODY * s->nall + 4;
  PetscCall(OptPeekReal("-monitor_from", &g->from, &given));
  if (!given) g->from = START * end;
  PetscCall(PetscCalloc7(g->n, &g->now, g->n, &g->before, g->n, &g->sum, g->n, &g->max, g->n, &g->min, s->nall,
                         &g->radius, g->n, &g->has));
  for (PetscInt i = 0; i < g->n; i++) g->max[i] = PETSC_MIN_REAL;
  for (PetscInt i = 0; i < g->n; i++) g->min[i] = PETSC_MAX_REAL;
  for (PetscInt k = 0; k < s->n; k++)
    if (s->own[k]) g->radius[s->number[k]] = BodiesGetRadius(s, k);
  PetscCall(BodiesSum(p->bodies, s->nall, g->radius));
  PetscCall(choose_values(g));
  *gauge = g;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode GaugeDestroy(Gauge *gauge)
{
  PetscFunctionBeginUser;
  if (!*gauge) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree7((*gauge)->now, (*gauge)->before, (*gauge)->sum, (*gauge)->max, (*gauge)->min, (*gauge)->radius,
                       (*gauge)->has));
  PetscCall(PetscFree(*gauge));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- values ---- */

static PetscErrorCode look(Gauge g, const FlowDiagnostics *d)
{
  const BodyState *s = g->s;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(g->now, g->n));
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal *v = g->now + PER_BODY * s->number[k];

    for (PetscInt a = 0; a < 3 && s->own[k] && !s->removed[k]; a++) {
      v[a]     = s->force[k][a];
      v[3 + a] = s->torque[k][a];
      v[6 + a] = s->u[k][a];
      v[9 + a] = s->w[k][a];
    }
  }
  if (s->nall) PetscCall(BodiesSum(g->bodies, PER_BODY * s->nall, g->now));
  for (PetscInt a = 0; a < 3 && d->volume > 0; a++) g->now[PER_BODY * s->nall + a] = d->velocity[a] / d->volume;
  g->now[PER_BODY * s->nall + 3] = d->kinetic_energy;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void add(Gauge g, PetscReal dt)
{
  for (PetscInt i = 0; i < g->n; i++) {
    g->sum[i] += 0.5 * dt * (g->before[i] + g->now[i]);
    g->max[i] = PetscMax(g->max[i], PetscMax(g->before[i], g->now[i]));
    g->min[i] = PetscMin(g->min[i], PetscMin(g->before[i], g->now[i]));
  }
  g->weight += dt;
  g->steps++;
}

/* The step that `from` lies in counts from there on: otherwise what changes steadily would differ between runs by what
   it does in a step */
PetscErrorCode GaugeStep(Gauge g, const FlowDiagnostics *d, PetscReal time, PetscReal dt)
{
  const FlowStep *step;

  PetscFunctionBeginUser;
  if (!g) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetStep(g->flow, &step));
  g->time  = time;
  g->order = step->order;
  g->speed = PetscMax(g->speed, d->speed_max);
  if (time + dt < g->from) PetscFunctionReturn(PETSC_SUCCESS); /* nor does the next one see it */
  PetscCall(look(g, d));
  if (time > g->from + 1e-9 * dt && g->steps == 0) {
    const PetscReal fraction = PetscMax(0, PetscMin(1, (g->from - time + dt) / dt));

    for (PetscInt i = 0; i < g->n && g->looked; i++) g->before[i] += fraction * (g->now[i] - g->before[i]);
    if (!g->looked) PetscCall(PetscArraycpy(g->before, g->now, g->n));
    add(g, time - PetscMax(g->from, time - dt));
  } else if (time > g->from + 1e-9 * dt) add(g, dt);
  g->looked = PETSC_TRUE;
  PetscCall(PetscArraycpy(g->before, g->now, g->n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void GaugeGetEnd(Gauge g, PetscReal *from, PetscReal *time, PetscInt *order, PetscInt *steps)
{
  *from  = g->from;
  *time  = g->time;
  *order = g->order;
  *steps = g->steps;
}

PetscErrorCode GaugeVisitState(void *gauge, State state)
{
  Gauge     g       = gauge;
  PetscInt  looked  = g->looked;
  PetscReal when[2] = {g->from, g->time};
  PetscBool has;

  PetscFunctionBeginUser;
  PetscCall(StateHas(state, "weight", &has));
  if (!has) PetscFunctionReturn(PETSC_SUCCESS); /* of a run that was not gauged: what follows is */
  PetscCall(StateReals(state, "when", 2, when));
  if (PetscAbsReal(when[0] - g->from) > 1e-9 * g->from) { /* the run ends at another time now */
    g->from = PetscMax(g->from, when[1]);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(StateReals(state, "weight", 1, &g->weight));
  PetscCall(StateReals(state, "speed", 1, &g->speed));
  PetscCall(StateInts(state, "looked", 1, &looked));
  g->looked = (PetscBool)looked;
  PetscCall(StateInts(state, "steps", 1, &g->steps));
  PetscCall(StateReals(state, "before", g->n, g->before));
  PetscCall(StateReals(state, "sum", g->n, g->sum));
  PetscCall(StateReals(state, "most", g->n, g->max));
  PetscCall(StateReals(state, "least", g->n, g->min));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- subjects ---- */

/* Place of the value of a subject */
static PetscInt get_index(Gauge g, PetscInt subject, PetscInt body)
{
  return subject < PER_BODY ? PER_BODY * body + subject : PER_BODY * g->s->nall + subject - PER_BODY;
}

PetscInt GaugeCount(Gauge g, PetscInt subject)
{
  return subject < PER_BODY ? g->s->nall : 1;
}

static PetscReal value(Gauge g, PetscInt i, PetscInt kind)
{
  if (g->steps == 0) return 0;
  return kind == 0 ? g->sum[i] / g->weight : kind == 1 ? g->max[i] : g->min[i];
}

PetscReal GaugeValue(Gauge g, PetscInt subject, PetscInt body, PetscInt kind)
{
  const PetscInt i = get_index(g, subject, body);

  return g->has[i] ? value(g, i, kind) : 0;
}

/* Forces that are errors alone, as across a flow that is symmetric, are none */
static PetscErrorCode find_noise(Gauge g, PetscReal r, PetscReal *noise)
{
  const FlowParameters *par;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(g->flow, &par));
  *noise = NOISE * (par->viscosity * g->speed * PetscPowRealInt(r, g->s->dim - 2) +
                    par->density * PetscSqr(g->speed) * PetscPowRealInt(r, g->s->dim - 1));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode GaugeGetSize(Gauge g, PetscInt subject, PetscReal *size, PetscReal *scale)
{
  PetscFunctionBeginUser;
  *size = *scale = 0;
  for (PetscInt k = 0; k < GaugeCount(g, subject); k++) {
    PetscReal mine = 0, r = 1, noise = 0;

    for (PetscInt i = 1; i < GAUGE_KINDS; i++)
      mine = PetscMax(mine, PetscAbsReal(value(g, get_index(g, subject, k), i)));
    if (subject / 3 == 1) r = 1 / g->radius[k];
    if (subject / 3 == 3) r = g->radius[k];
    if (subject < 6) PetscCall(find_noise(g, g->radius[k], &noise));
    if (r * mine <= noise) continue;
    *scale = PetscMax(*scale, r * mine);
    /* in a frame that moves with a body it goes nowhere */
    if (subject / 3 == 2) mine = PetscMax(mine, MOVED * g->speed);
    if (g->has[get_index(g, subject, k)]) *size = PetscMax(*size, mine);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

void GaugeGetName(PetscInt subject, char name[32])
{
  static const char *const KIND[] = {"force", "torque", "velocity", "omega", "mean_velocity"};

  if (subject == GAUGE_SUBJECTS - 1) (void)snprintf(name, 32, "kinetic_energy");
  else (void)snprintf(name, 32, "%s_%c", KIND[subject / 3], (char)('x' + subject % 3));
}
