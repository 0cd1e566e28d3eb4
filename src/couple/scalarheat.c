/* ScalarHeat: see scalarheat.h. */
#include "compat.h"
#include "impl.h"
#include "scalarheat.h"

#define NUMBERS 6 /* of BodyHeat */
#define SUMS    4 /* capacity, content, history, convected */

_Static_assert(sizeof(BodyHeat) == NUMBERS * sizeof(PetscReal), "numbers of a body");

PetscErrorCode ScalarHeatCreate(Couple c, PetscInt n, ScalarHeat *h)
{
  const size_t each = (size_t)n * sizeof(PetscReal);

  PetscFunctionBeginUser;
  *h = (ScalarHeat){.n = n};
  PetscCall(PetscCalloc2(c->s->ngroups * n, &h->keeps, c->s->ngroups * n, &h->pays));
  PetscCall(PetscCalloc2(n, &h->covered, n, &h->appears));
  PetscCall(BodiesAttach(c->bodies, NUMBERS * each, (void **)&h->last));
  PetscCall(BodiesAttachWork(c->bodies, NUMBERS * each, (void **)&h->next));
  PetscCall(BodiesAttachWork(c->bodies, SUMS * each, (void **)&h->sum));
  PetscCall(BodiesAttachWork(c->bodies, each, (void **)&h->given));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarHeatDestroy(Couple c, ScalarHeat *h)
{
  PetscFunctionBeginUser;
  PetscCall(BodiesDetach(c->bodies, (void **)&h->last));
  PetscCall(BodiesDetach(c->bodies, (void **)&h->next));
  PetscCall(BodiesDetach(c->bodies, (void **)&h->sum));
  PetscCall(BodiesDetach(c->bodies, (void **)&h->given));
  PetscCall(PetscFree2(h->keeps, h->pays));
  PetscCall(PetscFree2(h->covered, h->appears));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ScalarHeatKeeps(const ScalarHeat *h, Couple c, PetscInt i)
{
  for (PetscInt g = 0; g < c->s->ngroups; g++)
    if (h->keeps[g * h->n + i]) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* Of scalars first to last - 1: sums over the cells that bodies cover, of all ranks */
static PetscErrorCode sum_cells(ScalarHeat *h, Couple c, Scalars scalars, PetscInt first, PetscInt last,
                                const ScalarCover *cover)
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(h->sum, c->s->n * h->n * SUMS));
  for (PetscInt i = first; i < last; i++)
    for (PetscInt e = 0; e < cover->n; e++) {
      const CoveredCell *at  = cover->covered + e;
      PetscReal         *sum = h->sum + (at->body * h->n + i) * SUMS;
      ScalarExcess       x;

      if (at->cell >= c->loc->ncell || !at->first || !h->keeps[c->s->body_group[at->body] * h->n + i]) continue;
      PetscCall(ScalarsMeasureExcess(scalars, i, at->cell, &x));
      sum[0] += x.capacity;
      sum[1] += x.content;
      sum[2] += x.history;
      sum[3] += x.convected;
    }
  PetscCall(BodiesSumLocal(c->bodies, h->n * SUMS, h->sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of body k: *appears, the heat a time that appears; in next->owed what of it is to be given back */
static void close_books(ScalarHeat *h, Couple c, PetscInt k, PetscInt i, PetscReal *appears)
{
  const FlowStep  *f    = c->step;
  const PetscReal *sum  = h->sum + (k * h->n + i) * SUMS;
  const BodyHeat  *last = h->last + k * h->n + i;
  BodyHeat        *next = h->next + k * h->n + i;
  const PetscReal  d0 = f->d0, d1 = f->d1;

  *next = (BodyHeat){PetscMin(2, last->have + 1), sum[1], last->content, sum[0], last->capacity, 0};
  if (last->have == 0) { /* what it began with, taken where it is now */
    next->content_old  = d0 + d1 != 0 ? sum[2] / (d0 + d1) : sum[1];
    next->capacity_old = sum[0];
    next->have         = 2;
    *appears           = 0;
    return;
  }
  *appears   = sum[2] - d0 * last->content - d1 * last->content_old - sum[3];
  next->owed = *appears;
  if (last->capacity != 0)
    next->owed -= last->content / last->capacity * ((d0 + d1) * sum[0] - d0 * last->capacity - d1 * last->capacity_old);
  next->owed *= h->pays[c->s->body_group[k] * h->n + i] ? f->dt : 0;
}

PetscErrorCode ScalarHeatBegin(ScalarHeat *h, Couple c, Scalars scalars, const ScalarCover *cover)
{
  PetscFunctionBeginUser;
  PetscCall(sum_cells(h, c, scalars, 0, h->n, cover));
  for (PetscInt e = 0; e < c->s->n * h->n; e++) {
    const PetscReal capacity = h->sum[e * SUMS], content = h->sum[e * SUMS + 1];

    h->last[e] = (BodyHeat){2, content, content, capacity, capacity, 0};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarHeatPredict(ScalarHeat *h, Couple c, Scalars scalars, PetscInt i, const ScalarCover *cover)
{
  PetscFunctionBeginUser;
  PetscCall(sum_cells(h, c, scalars, i, i + 1, cover));
  h->appears[i] = 0;
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscInt at = k * h->n + i;
    PetscReal      appears;

    h->given[at] = 0;
    if (c->s->removed[k] || !h->keeps[c->s->body_group[k] * h->n + i]) continue;
    close_books(h, c, k, i, &appears);
    h->appears[i] += c->s->own[k] ? appears : 0;
    if (h->pays[c->s->body_group[k] * h->n + i]) h->given[at] = -(h->last[at].owed + h->next[at].owed) / c->step->dt;
  }
  PetscCall(BodiesSum(c->bodies, 1, h->appears + i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarHeatMeasure(ScalarHeat *h, Couple c, Scalars scalars, const ScalarCover *cover)
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(h->covered, h->n));
  PetscCall(PetscArrayzero(h->appears, h->n));
  PetscCall(sum_cells(h, c, scalars, 0, h->n, cover));
  for (PetscInt k = 0; k < c->s->n; k++)
    for (PetscInt i = 0; i < h->n; i++) {
      PetscReal appears;

      if (c->s->removed[k] || !h->keeps[c->s->body_group[k] * h->n + i]) continue;
      close_books(h, c, k, i, &appears);
      h->next[k * h->n + i].owed += h->last[k * h->n + i].owed + h->given[k * h->n + i] * c->step->dt;
      if (c->s->own[k]) h->appears[i] += appears;
      if (c->s->own[k]) h->covered[i] += appears + h->given[k * h->n + i];
    }
  PetscCall(BodiesSum(c->bodies, h->n, h->covered));
  PetscCall(BodiesSum(c->bodies, h->n, h->appears));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ScalarHeatAccept(ScalarHeat *h, Couple c)
{
  for (PetscInt k = 0; k < c->s->n; k++)
    for (PetscInt i = 0; i < h->n; i++)
      if (h->keeps[c->s->body_group[k] * h->n + i]) h->last[k * h->n + i] = h->next[k * h->n + i];
}

PetscErrorCode ScalarHeatVisit(ScalarHeat *h, Couple c, State state)
{
  PetscFunctionBeginUser;
  /* after a run without the books begin anew */
  PetscCall(BodiesVisitOptional(c->bodies, state, "body_heat", NUMBERS * h->n, (PetscReal *)h->last));
  PetscFunctionReturn(PETSC_SUCCESS);
}
