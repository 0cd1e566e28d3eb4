/* ScalarGrowth: see scalargrowth.h. */
#include "compat.h"
#include "impl.h"
#include "scalargrowth.h"
#include "base/log.h"
#include "bodies/local.h"

#define NUMBERS 7   /* of BodyGrowth */
#define FAR     0.5 /* cells that a surface may go in a step */

_Static_assert(sizeof(BodyGrowth) == NUMBERS * sizeof(PetscReal), "numbers of a body");

PetscErrorCode ScalarGrowthCreate(Couple c, PetscInt n, const ScalarMaterial *material, ScalarGrowth *g)
{
  PetscBool any = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->s->ngroups; i++) any = (PetscBool)(any || c->s->group[i].grows);
  *g = (ScalarGrowth){.n = any ? n : 0, .material = material};
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesAttach(c->bodies, sizeof(*g->last), (void **)&g->last));
  PetscCall(BodiesAttachWork(c->bodies, sizeof(*g->rate), (void **)&g->rate));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarGrowthDestroy(Couple c, ScalarGrowth *g)
{
  PetscFunctionBeginUser;
  if (!g->n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesDetach(c->bodies, (void **)&g->last));
  PetscCall(BodiesDetach(c->bodies, (void **)&g->rate));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool grows(Couple c, PetscInt k)
{
  return (PetscBool)(BodiesGetGroup(c->s, k)->grows && !c->s->removed[k]);
}

/* Volume of a body that is too small for the mesh */
static PetscReal smallest(Couple c)
{
  return PetscPowRealInt(c->loc->h, (int)c->loc->dim);
}

static void start(ScalarGrowth *g, Couple c, PetscInt k)
{
  const PetscReal volume = BodiesVolume(c->s, k), size = c->s->scale[k];

  if (g->last[k].volume == 0) g->last[k] = (BodyGrowth){0, volume, volume, 0, 0, size, size};
}

PetscErrorCode ScalarGrowthBegin(ScalarGrowth *g, Couple c)
{
  const FlowStep *f = c->step;
  const PetscReal r = f->dt_old > 0 ? ((1 - f->theta) * f->dt_old + f->theta * f->dt) / f->dt_old : 0;
  PetscReal      *scale;

  PetscFunctionBeginUser;
  if (!g->n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(c->s->n, &scale));
  for (PetscInt k = 0; k < c->s->n; k++) {
    const BodyGrowth *b = g->last + k;
    PetscReal         rate, volume;

    if (!grows(c, k)) continue;
    start(g, c, k);
    rate     = b->rate + (b->have > 1 ? r * (b->rate - b->rate_old) : 0);
    volume   = (f->d0 * b->volume + f->d1 * b->volume_old + rate) / f->ct;
    volume   = PetscMax(volume, 0.5 * smallest(c)) / BodiesGetGroup(c->s, k)->mass.volume;
    scale[k] = PetscPowReal(volume, 1 / (PetscReal)c->loc->dim);
  }
  PetscCall(BodiesResize(c->bodies, scale));
  PetscCall(PetscFree(scale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarGrowthLimit(const ScalarGrowth *g, Couple c, PetscReal *dt)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n && g->n; k++) {
    const PetscReal rate = PetscAbsReal(g->last[k].rate);

    if (!grows(c, k) || rate == 0) continue;
    *dt = PetscMin(*dt,
                   FAR * c->loc->h * (PetscReal)c->loc->dim * g->last[k].volume / (rate * BodiesGetRadius(c->s, k)));
  }
  if (g->n) PetscCall(BodiesMin(c->bodies, 1, dt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal ScalarGrowthGetRate(const ScalarGrowth *g, Couple c, PetscInt k)
{
  const FlowStep *f = c->step;

  if (!g->n || !grows(c, k)) return 0;
  return f->ct - (f->d0 * g->last[k].size + f->d1 * g->last[k].size_old) / c->s->scale[k];
}

PetscErrorCode ScalarGrowthFreed(const ScalarGrowth *g, Couple c, Scalars scalars, PetscInt i, PetscReal *freed)
{
  const FlowStep         *f   = c->step;
  const PetscInt          dim = c->loc->dim;
  const ScalarParameters *par;

  PetscFunctionBeginUser;
  *freed = 0;
  if (!g->n) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < c->s->n; k++) {
    const ScalarMaterial *m = g->material + c->s->body_group[k] * g->n + i;
    const BodyGrowth     *b = g->last + k;

    if (!grows(c, k) || !c->s->own[k] || m->condition != SCALAR_BODY_VALUE) continue;
    *freed -= m->value * BodiesGetGroup(c->s, k)->mass.volume *
              (f->ct * PetscPowRealInt(c->s->scale[k], (int)dim) - f->d0 * PetscPowRealInt(b->size, (int)dim) -
               f->d1 * PetscPowRealInt(b->size_old, (int)dim));
  }
  PetscCall(BodiesSum(c->bodies, 1, freed));
  PetscCall(ScalarsGetParameters(scalars, i, &par));
  *freed *= par->capacity;
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ScalarGrowthMeasure(ScalarGrowth *g, Couple c, PetscInt i, const PetscReal flux[])
{
  for (PetscInt k = 0; k < c->s->n && g->n; k++) {
    if (i == 0) g->rate[k] = 0;
    if (grows(c, k)) g->rate[k] -= g->material[c->s->body_group[k] * g->n + i].dissolves * flux[k];
  }
}

/* Removes bodies that are about to be smaller than a cell; says so of the first */
static PetscErrorCode remove_small(ScalarGrowth *g, Couple c)
{
  PetscReal first = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    if (!grows(c, k) || g->last[k].volume + c->step->dt * PetscMin(0, g->last[k].rate) > smallest(c)) continue;
    first = PetscMin(first, (PetscReal)c->s->number[k]);
    PetscCall(BodiesRemove(c->bodies, k));
  }
  if (g->told) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesMin(c->bodies, 1, &first));
  if (first == PETSC_MAX_REAL) PetscFunctionReturn(PETSC_SUCCESS);
  g->told = PETSC_TRUE;
  PetscCall(
    LogRemark("body %" PetscInt_FMT
              " has dissolved at t = %g: it is smaller than a cell (%g) and is removed, with what it is still made of. "
              "Others go without a message (bodies_removed in summary.json)",
              (PetscInt)first, (double)c->step->time, (double)c->loc->h));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarGrowthAccept(ScalarGrowth *g, Couple c)
{
  const FlowStep *f = c->step;

  PetscFunctionBeginUser;
  if (!g->n || f->dt == 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < c->s->n; k++) {
    BodyGrowth *b = g->last + k;

    if (!grows(c, k)) continue;
    *b = (BodyGrowth){.have       = PetscMin(2, b->have + 1),
                      .volume     = (f->d0 * b->volume + f->d1 * b->volume_old + g->rate[k]) / f->ct,
                      .volume_old = b->volume,
                      .rate       = g->rate[k],
                      .rate_old   = b->rate,
                      .size       = c->s->scale[k],
                      .size_old   = b->size};
  }
  PetscCall(remove_small(g, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarGrowthVisit(ScalarGrowth *g, Couple c, State state)
{
  PetscFunctionBeginUser;
  if (!g->n) PetscFunctionReturn(PETSC_SUCCESS);
  /* after a run without they begin anew */
  PetscCall(BodiesVisitOptional(c->bodies, state, "body_growth", NUMBERS, (PetscReal *)g->last));
  PetscFunctionReturn(PETSC_SUCCESS);
}
