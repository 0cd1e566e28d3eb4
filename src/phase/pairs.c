/* Drops, pairs: which of them are not to merge (phase/drops.h). Two that are nearer than a cell are neighbours, since a
   time that is remembered. */
#include "compat.h"
#include "impl.h"
#include "base/array.h"
#include "base/domain.h"
#include "fem/edge.h"

PetscBool DropsMayStayApart(const DropsState *s)
{
  for (PetscInt g = 0; g < s->ngroups; g++)
    if (s->group[g].never || s->group[g].film > 0 || s->group[g].drainage > 0) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* Least distance of the middles of the pieces of a drop to the interface of another, by all images; `reach`: or more */
static PetscReal find_gap(const PhaseCurve *c, PetscInt a, PetscInt b, PetscReal reach, const PetscReal period[])
{
  PetscReal gap = reach;

  for (PetscInt e = 0; e < c->n; e++) {
    if (c->drop[e] != a || c->wall[e]) continue;
    for (PetscInt o = 0; o < c->n; o++) {
      if (c->drop[o] != b || c->wall[o]) continue;
      for (PetscInt j = 1; j < 3; j++) {
        PetscReal x[2], y[2], d[2];

        for (PetscInt i = 0; i < 2; i++) x[i] = DomainNearest(period[i], c->x[e][j][i], c->ball[o][i]);
        if (EdgeDistance2(x, c->ball[o]) > PetscSqr(gap + c->ball[o][2])) continue;
        EdgeEvaluate(c->x[o], EdgeClosest(c->x[o], x), y, d);
        gap = PetscMin(gap, PetscSqrtReal(EdgeDistance2(x, y)));
      }
    }
  }
  return gap;
}

static DropPair *find_pair(const DropsState *s, PetscInt a, PetscInt b)
{
  for (PetscInt i = 0; i < s->npair; i++)
    if (s->pair[i].drop[0] == PetscMin(a, b) && s->pair[i].drop[1] == PetscMax(a, b)) return s->pair + i;
  return NULL;
}

PetscErrorCode DropsFindPairs(Drops d, const PhaseInterface *f, PetscReal h, PetscReal time, const PetscReal period[])
{
  DropsState *s        = &d->s;
  DropPair   *pair     = NULL;
  PetscInt    capacity = 0, n = 0;
  PetscReal   reach = h;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->ngroups; g++) reach = PetscMax(reach, s->group[g].film);
  for (PetscInt i = 0; i < s->n && f->curve.n; i++)
    for (PetscInt j = i + 1; j < s->n; j++) {
      const PetscInt  a = s->drop[i].number, b = s->drop[j].number;
      const PetscReal gap = find_gap(&f->curve, a, b, reach, period);
      const DropPair *old = find_pair(s, a, b);

      if (gap >= reach) continue;
      PetscCall(ArrayReserve(n + 1, &capacity, &pair, sizeof(*pair), NULL));
      pair[n++] = (DropPair){.drop = {a, b}, .since = old ? old->since : time, .gap = gap};
    }
  PetscCall(PetscFree(s->pair));
  s->pair  = pair;
  s->npair = n;
  s->time  = time;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool DropsAreApart(const DropsState *s, PetscInt a, PetscInt b)
{
  const PetscInt   i = DropsFind(s, a), j = DropsFind(s, b);
  const DropPair  *p = find_pair(s, a, b);
  const DropGroup *g, *o;
  PetscReal        film, drainage;

  if (i < 0 || j < 0 || i == j) return PETSC_FALSE;
  g = s->group + s->drop[i].group;
  o = s->group + s->drop[j].group;
  if (g->never || o->never) return PETSC_TRUE;
  film     = PetscMax(g->film, o->film);
  drainage = PetscMax(g->drainage, o->drainage);
  if (film > 0 && (!p || p->gap >= film)) return PETSC_TRUE;
  return (PetscBool)(drainage > 0 && (!p || s->time - p->since < drainage));
}

PetscErrorCode DropsVisitPairs(DropsState *s, State state)
{
  PetscReal *v;

  PetscFunctionBeginUser;
  PetscCall(StateInts(state, "pairs", 1, &s->npair));
  if (StateIsLoading(state)) {
    PetscCall(PetscFree(s->pair));
    PetscCall(PetscCalloc1(s->npair, &s->pair));
  }
  PetscCall(PetscMalloc1(4 * s->npair, &v));
  for (PetscInt i = 0; i < 4 * s->npair; i++) {
    const DropPair *p = s->pair + i / 4;

    v[i] = i % 4 < 2 ? (PetscReal)p->drop[i % 4] : i % 4 == 2 ? p->since : p->gap;
  }
  PetscCall(StateReals(state, "neighbours", 4 * s->npair, v));
  for (PetscInt i = 0; i < s->npair && StateIsLoading(state); i++)
    s->pair[i] = (DropPair){.drop  = {(PetscInt)v[4 * i], (PetscInt)v[4 * i + 1]},
                            .since = v[4 * i + 2],
                            .gap   = v[4 * i + 3]};
  PetscCall(PetscFree(v));
  PetscFunctionReturn(PETSC_SUCCESS);
}
