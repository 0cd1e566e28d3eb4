/* TimeError: see timeerror.h. */
#include "compat.h"
#include "timeerror.h"
#include "calm.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "flow/device.h"
#include "promise.h"

/* steps after which a run is judged for the first time, by the latter half of them: a sudden start leaves about
   1/(3 n^2) at step n, .1 and .03 % */
#define FIRST          32
#define FIRST_ACCURATE 64
#define EVERY          8   /* steps between two looks at the rate of friction */
#define FADE           0.9 /* what older looks count */
#define SAFETY         0.8 /* of the step that would do: an error that is .8 of the promise by the square of it */
#define YOUNG          128 /* steps, of a run that may stop */
#define LEFT           0.5 /* of the promise: what longer steps may leave in the latter half of the run */
#define GROWTH         2   /* of a step that did more than that, at most */

/* Error of the mean velocity of a flow that swings, over the square of the part of it that is curved within cells:
   channels with .1 to .7 cells in the layer at walls .13 to .15 (runs/studies/steps) */
#define CURVED 0.15

/* Over a stretch of steps */
typedef struct {
  PetscReal error, past, speed, change, time; /* integrals over time; past: of what longer steps made; change: of the
                                                 derivative; its length */
  PetscInt  n;
} Share;

struct _p_TimeError {
  const SimComponents *p;
  const MeshLocal     *l;
  PetscReal           *slow, *age;      /* [nnode_all][dim] mean of the derivative; [nnode_all] (calm.h) */
  PetscReal            friction[2];     /* viscosity |grad|^2, | |^2 of the derivative, sums over looks */
  PetscReal            past, last;      /* error that longer steps made, as those of `now`; share in the last stretch */
  PetscReal            end;             /* of the run */
  PetscReal            promised, bound; /* share; longest step that keeps it */
  PetscInt             preset, row, n, first; /* n: steps seen; when they are judged for the first time */
  Share                before, now;           /* up to the last power of two, since then */
  PetscInt             order;
  PetscBool            asked, told, mesh_told;
};

static PetscErrorCode keep_promise(void *timeerror, PetscReal *dt)
{
  PetscFunctionBeginUser;
  *dt = PetscMin(*dt, ((TimeError)timeerror)->bound);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The mesh has been made anew */
static PetscErrorCode carry_over(void *timeerror, Mesh old)
{
  TimeError t = timeerror;

  PetscFunctionBeginUser;
  PetscCall(MeshSyncNodes(old, t->l->dim, t->slow));
  PetscCall(MeshGetLocal(t->p->mesh, &t->l));
  PetscCall(CalmCarry(old, t->p->mesh, &t->slow, &t->age));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TimeErrorCreate(const SimComponents *p, Limits limits, PetscReal end, TimeError *timeerror)
{
  TimeError t;
  char      preset[64];

  PetscFunctionBeginUser;
  *timeerror = NULL;
  if (!p->flow || p->steady || p->drops || p->solids || FlowGetQueue(p->flow)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&t));
  t->p = p;
  PetscCall(MeshGetLocal(p->mesh, &t->l));
  PetscCall(OptPeek("-preset", preset, sizeof(preset)));
  t->asked    = (PetscBool)(preset[0] != 0);
  t->preset   = PromiseFind(preset);
  t->promised = 0.01 * PromisePercent(t->preset);
  t->bound    = PETSC_MAX_REAL;
  t->end      = end;
  t->first    = t->promised < 0.005 ? FIRST_ACCURATE : FIRST;
  t->last     = -1;
  PetscCall(PetscCalloc2(t->l->nnode_all * t->l->dim, &t->slow, t->l->nnode_all, &t->age));
  CalmBegin(t->l, t->age);
  PetscCall(LimitsAdd(limits,
                      &(Limit){LIMIT_BOUND, "promise", "what the preset promises", "-sim_dt", "",
                               "shorter from then on", t->promised, keep_promise, t},
                      &t->row));
  PetscCall(RefineSetClient(p->refine, carry_over, t));
  *timeerror = t;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TimeErrorDestroy(TimeError *t)
{
  PetscFunctionBeginUser;
  if (!*t) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree2((*t)->slow, (*t)->age));
  PetscCall(PetscFree(*t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- a step ---- */

/* The derivative of order p is weight[0] u^{n+1} + weight[1] u^n + weight[2] u^{n-1} */
static void get_weights(const FlowStep *step, PetscReal weight[3])
{
  const PetscReal h = step->dt, k = step->dt_old;

  if (step->order == 1) {
    weight[0] = 1 / h;
    weight[1] = -1 / h;
    weight[2] = 0;
  } else {
    weight[0] = 2 / (h * (h + k));
    weight[1] = -2 / (h * k);
    weight[2] = 2 / (k * (h + k));
  }
}

/* Rate of friction, viscosity |grad a|^2/|a|^2 of the derivative a */
static PetscErrorCode look_at_rate(TimeError t, const PetscReal u[], const PetscReal now[], const PetscReal old[],
                                   const PetscReal weight[3])
{
  const PetscInt        n = t->l->nnode_all * t->l->dim, dim = t->l->dim;
  const FlowParameters *par;
  const PetscReal      *m;
  PetscReal            *a, norm, square = 0;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(t->p->flow, &par));
  PetscCall(FlowGetLumpedMass(t->p->flow, &m));
  PetscCall(PetscMalloc1(n, &a));
  for (PetscInt j = 0; j < n; j++) a[j] = weight[0] * u[j] + weight[1] * now[j] + weight[2] * old[j];
  PetscCall(FlowGetGradientNorm(t->p->flow, a, &norm));
  for (PetscInt j = 0; j < t->l->nnode * dim; j++) square += m[j / dim] * PetscSqr(a[j]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &square, 1, MPIU_REAL, MPIU_SUM, t->p->comm));
  t->friction[0] = FADE * t->friction[0] + par->viscosity / par->density * PetscSqr(norm);
  t->friction[1] = FADE * t->friction[1] + square;
  PetscCall(PetscFree(a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal get_rate(TimeError t)
{
  return t->friction[1] > 0 ? t->friction[0] / t->friction[1] : 0;
}

/* A preset that was asked for cannot keep its promise: the run stops */
static PetscErrorCode refuse(TimeError t, const char why[])
{
  char refusal[400] = "";

  PetscFunctionBeginUser;
  PetscCall(PromiseSay(t->preset, PETSC_TRUE, why, refusal, sizeof(refusal)));
  SETERRQ(t->p->comm, PETSC_ERR_USER_INPUT, "%s", refusal);
}

/* Does friction take of this error, from now until the latter half of the run, what the promise has no room for? */
static PetscBool is_forgotten(TimeError t, PetscReal error, PetscReal now)
{
  error *= PetscExpReal(-get_rate(t) * PetscMax(0, 0.5 * t->end - now));
  return (PetscBool)(error <= LEFT * t->promised);
}

/* Shorter steps from here on */
static PetscErrorCode shorten(TimeError t, PetscReal enough, const char why[])
{
  PetscFunctionBeginUser;
  if (!t->told)
    PetscCall(LogRemark("-preset %s promises %s %%, and %s: they are at most %.3g long from here, step %" PetscInt_FMT
                        ", on. Start with that (-sim_dt)",
                        PROMISE_PRESETS[t->preset], PromiseText(t->preset), why, (double)enough, t->n + 2));
  t->bound = enough;
  t->past  = PetscMax(t->past, t->now.error / t->now.time);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is the error of these steps, of length dt, beyond the promise? Then what to do about it. */
static PetscErrorCode compare_with_promise(TimeError t, PetscReal error, PetscReal dt)
{
  char            why[160], text[320];
  const FlowStep *step;
  const PetscReal enough = SAFETY * dt * PetscPowReal(t->promised / PetscMax(error, 1e-12), 1. / (PetscReal)t->order);

  PetscFunctionBeginUser;
  if (error <= t->promised) {
    if (t->bound < PETSC_MAX_REAL) t->bound = PetscMin(enough, GROWTH * t->bound);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscSNPrintf(why, sizeof(why), "the estimated error of steps of %.3g is %.2g %%", (double)dt,
                          (double)(100 * error)));
  PetscCall(PetscSNPrintf(text, sizeof(text), "%s. Lower -sim_dt to %.2g", why, (double)enough));
  if (t->asked && enough < t->bound) {
    PetscCall(FlowGetStep(t->p->flow, &step));
    if (t->n <= YOUNG && !is_forgotten(t, error, step->time)) PetscCall(refuse(t, text));
    PetscCall(shorten(t, enough, why));
  } else if (!t->asked && !t->told) PetscCall(PromiseSay(t->preset, PETSC_FALSE, text, NULL, 0));
  t->told = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What component a of v would be at node j of cell c, were it linear between the vertices of the cell */
static PetscReal between_vertices(const MeshLocal *l, PetscInt c, PetscInt j, const PetscReal v[], PetscInt a)
{
  const PetscInt at[3] = {j % 3, j / 3 % 3, j / 9}, step[3] = {1, 3, 9};
  PetscReal      sum = 0;

  for (PetscInt k = 0; k < 1 << l->dim; k++) {
    PetscReal weight = 1;
    PetscInt  vertex = 0;

    for (PetscInt d = 0; d < l->dim; d++) {
      const PetscInt side = 2 * ((k >> d) & 1);

      weight *= 1 - 0.5 * PetscAbsInt(at[d] - side);
      vertex += side * step[d];
    }
    sum += weight * v[l->cell_node[c * l->nb + vertex] * l->dim + a];
  }
  return sum;
}

/* sum [2] += integral of |v - what is linear between vertices|^2, |v|^2: at a node the former is one number, whichever
   cell is asked, but for cells with smaller neighbours, which are left out. Collective. */
static PetscErrorCode add_curved(TimeError t, const PetscReal v[], PetscReal sum[2])
{
  const MeshLocal *l   = t->l;
  const PetscInt   dim = l->dim, nb = l->nb;
  const PetscReal *m;
  PetscReal       *curved, part[2] = {0, 0};

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(t->p->flow, &m));
  PetscCall(PetscCalloc1(l->nnode_all * dim, &curved));
  for (PetscInt c = 0; c < l->ncell_all; c++)
    for (PetscInt j = 0; j < nb && !MeshCellHang(l, c); j++)
      for (PetscInt a = 0; a < dim; a++) {
        const PetscInt i = l->cell_node[c * nb + j] * dim + a;

        curved[i] = v[i] - between_vertices(l, c, j, v, a);
      }
  for (PetscInt i = 0; i < l->nnode * dim; i++) {
    part[0] += m[i / dim] * PetscSqr(curved[i]);
    part[1] += m[i / dim] * PetscSqr(v[i]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, part, 2, MPIU_REAL, MPIU_SUM, t->p->comm));
  for (PetscInt k = 0; k < 2; k++) sum[k] += part[k];
  PetscCall(PetscFree(curved));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of a flow without bodies that swings: what is curved within cells of velocity and acceleration, the latter over the
   rate omega, so that it does not matter when in a period that is asked */
static PetscErrorCode measure_curved(TimeError t, PetscReal omega, PetscReal *part)
{
  const PetscInt   n = t->l->nnode_all * t->l->dim;
  const FlowStep  *step;
  const PetscReal *u, *pressure;
  PetscReal       *now, *change, sum[2] = {0, 0};

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(t->p->flow, &step));
  PetscCall(CoupleGetSolution(t->p->couple, &u, &pressure));
  PetscCall(FlowGetFields(t->p->flow, &now, NULL, NULL));
  PetscCall(PetscMalloc1(n, &change));
  for (PetscInt j = 0; j < n; j++) change[j] = (u[j] - now[j]) / (step->dt * omega);
  PetscCall(add_curved(t, u, sum));
  PetscCall(add_curved(t, change, sum));
  PetscCall(PetscFree(change));
  *part = sum[1] > 0 ? PetscSqrtReal(sum[0] / sum[1]) : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does the mesh carry a flow without bodies that swings, with its layers at walls? Those with bodies: promise.c. */
static PetscErrorCode check_layer(TimeError t)
{
  BodyState *s;
  char       law[64], why[320];
  PetscReal  omega, part = 0, error;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(t->p->bodies, &s));
  PetscCall(OptPeek("-flow_rheology", law, sizeof(law)));
  if (!t->asked || t->mesh_told || t->order < 2 || s->nall || law[0] || t->now.change <= 0)
    PetscFunctionReturn(PETSC_SUCCESS);
  omega = PetscSqrtReal(t->now.change / t->now.speed);
  if (get_rate(t) > omega) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(measure_curved(t, omega, &part));
  error = CURVED * part * part;
  if (error <= t->promised) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(
    PetscSNPrintf(why, sizeof(why),
                  "the mesh leaves an estimated error of %.2g %% in a flow that swings: its layers at walls are "
                  "thin. Refine the mesh there (-mesh_cells, -mesh_resolution, -mesh_stretch)",
                  (double)(100 * error)));
  if (t->n <= YOUNG) PetscCall(refuse(t, why));
  PetscCall(LogRemark("-preset %s promises %s %%, and %s", PROMISE_PRESETS[t->preset], PromiseText(t->preset), why));
  t->mesh_told = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* At the end of a stretch of steps */
static PetscErrorCode end_stretch(TimeError t)
{
  const PetscReal bound = t->bound;

  PetscFunctionBeginUser;
  t->last = t->now.speed > 0 ? t->now.error / t->now.speed : -1;
  if (t->n >= t->first && t->last >= 0) PetscCall(compare_with_promise(t, t->last, t->now.time / (PetscReal)t->now.n));
  if (t->n >= t->first && t->last >= 0) PetscCall(check_layer(t));
  t->before = t->bound < bound ? (Share){0} : t->now;
  t->now    = (Share){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TimeErrorStep(TimeError t)
{
  const FlowStep  *step;
  const PetscReal *u, *pressure, *m;
  const PetscInt  *body;
  PetscReal       *now, *old, weight[3], c, q, rate, sum[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  if (!t) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetStep(t->p->flow, &step));
  if (step->dt_old <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoupleGetSolution(t->p->couple, &u, &pressure));
  PetscCall(CoupleGetNodeBody(t->p->couple, &body));
  PetscCall(FlowGetFields(t->p->flow, &now, &old, NULL));
  PetscCall(FlowGetLumpedMass(t->p->flow, &m));
  get_weights(step, weight);
  CalmStep(t->l, body, t->age);
  if (t->n % EVERY == 0) PetscCall(look_at_rate(t, u, now, old, weight));
  c    = step->error * step->ct * step->dt * PetscPowRealInt(step->dt, (int)step->order);
  rate = get_rate(t);
  q    = rate * step->dt / (1 + rate * step->dt);
  for (PetscInt i = 0; i < t->l->nnode; i++) {
    const PetscInt dim = t->l->dim;
    PetscReal      e = 0, size = 0, change = 0;

    for (PetscInt j = i * dim; j < (i + 1) * dim; j++) {
      const PetscReal a = weight[0] * u[j] + weight[1] * now[j] + weight[2] * old[j];

      t->slow[j] += q * (a - t->slow[j]);
      e += PetscSqr(c * (a - t->slow[j]));
      size += PetscSqr(u[j]);
      change += PetscSqr(a);
    }
    if (t->age[i] < CALM_STEPS) continue;
    sum[0] += m[i] * e;
    sum[1] += m[i] * size;
    sum[2] += m[i] * change;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, t->p->comm));
  t->past *= PetscExpReal(-rate * step->dt);
  t->now.error += step->dt * PetscSqrtReal(sum[0]);
  t->now.past += step->dt * t->past;
  t->now.speed += step->dt * PetscSqrtReal(sum[1]);
  t->now.change += step->dt * PetscSqrtReal(sum[2]);
  t->now.time += step->dt;
  t->now.n++;
  t->order = step->order;
  t->n++;
  if (2 * t->n >= t->first && (t->n & (t->n - 1)) == 0) PetscCall(end_stretch(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what comes of it ---- */

/* As a share; -1: not known */
static PetscReal get_estimate(TimeError t)
{
  const PetscReal speed = t->before.speed + t->now.speed;

  if (!(speed > 0) || 2 * t->n <= t->first) return t->last;
  return (t->before.error + t->now.error + t->before.past + t->now.past) / speed;
}

void TimeErrorGet(TimeError t, PetscReal *error)
{
  *error = t ? get_estimate(t) : -1;
}

PetscErrorCode TimeErrorFinish(TimeError t)
{
  PetscReal error;

  PetscFunctionBeginUser;
  TimeErrorGet(t, &error);
  if (error < 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MonitorQuantity(t->p->monitor, "estimated_error_time", error));
  if (t->asked && error > t->promised && t->n >= t->first)
    PetscCall(
      LogRemark("-preset %s promises %s %%, and the steps of this run leave an estimated error of %.2g %%: lower -sim_dt",
                PROMISE_PRESETS[t->preset], PromiseText(t->preset), (double)(100 * error)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TimeErrorVisitState(void *timeerror, State state)
{
  TimeError t          = timeerror;
  PetscReal number[15] = {t->before.error, t->before.past, t->before.speed, t->before.change, t->before.time,
                          t->now.error,    t->now.past,    t->now.speed,    t->now.change,    t->now.time,
                          t->friction[0],  t->friction[1], t->bound,        t->past,          t->last};
  PetscInt  count[5]   = {t->before.n, t->now.n, t->n, t->order, t->told};
  PetscBool has;

  PetscFunctionBeginUser;
  PetscCall(StateHas(state, "numbers", &has));
  if (!has) PetscFunctionReturn(PETSC_SUCCESS); /* of an older run: begins here */
  PetscCall(StateReals(state, "numbers", 15, number));
  PetscCall(StateInts(state, "counts", 5, count));
  t->before = (Share){number[0], number[1], number[2], number[3], number[4], count[0]};
  t->now    = (Share){number[5], number[6], number[7], number[8], number[9], count[1]};
  t->bound  = number[12];
  t->past   = number[13];
  t->last   = number[14];
  t->n      = count[2];
  t->order  = count[3];
  PetscCall(PetscArraycpy(t->friction, number + 10, 2));
  t->told = (PetscBool)count[4];
  PetscCall(StateNodes(state, "slow", t->l->dim, t->slow));
  PetscCall(StateNodes(state, "age", 1, t->age));
  PetscFunctionReturn(PETSC_SUCCESS);
}
