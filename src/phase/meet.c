/* PhaseCurve, solids: how a curve meets the surface of something solid (phase/curve.h). From a length before the
   surface on it is drawn: an arc that goes on smoothly and meets the surface at the contact angle, and inside a curve
   from there to where it comes out. An arc with tangents t, s at its ends has its chord along t + s, by which its end
   is found. */
#include "compat.h"
#include "impl.h"
#include "base/array.h"
#include "fem/edge.h"

#define FINE   4    /* edges of what is drawn in a length */
#define DIFFER 1e-5 /* of a length: for normals of the surface */
#define ROUNDS 40
#define INWARD 0.2 /* cosine: so much towards the surface an arc goes at nearest */
#define CLOSE  1e-12
#define BACK   0.75 /* of a length: so far before its end the curve's tangent is measured */

typedef struct {
  PetscReal x[2], t[2]; /* place, and tangent along the curve, of length 1 */
} End;

static PetscErrorCode distance_at(const PhaseSolid *s, const PetscReal x[2], PetscReal *d)
{
  PetscFunctionBeginUser;
  PetscCall((*s->distance)(s->ctx, 1, x, d, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode normal_at(const PhaseSolid *s, const PetscReal x[2], PetscReal n[2])
{
  const PetscReal e    = DIFFER * s->h;
  const PetscReal y[8] = {x[0] + e, x[1], x[0] - e, x[1], x[0], x[1] + e, x[0], x[1] - e};
  PetscReal       d[4], size;

  PetscFunctionBeginUser;
  PetscCall((*s->distance)(s->ctx, 4, y, d, NULL));
  n[0] = d[0] - d[1];
  n[1] = d[2] - d[3];
  size = PetscHypotReal(n[0], n[1]);
  if (size > 0) n[0] /= size;
  if (size > 0) n[1] /= size;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Tangent at a surface with normal n of a curve that goes into it with its drop on the left (side 1) or right (-1) */
static void contact_tangent(PetscReal angle, PetscReal side, const PetscReal n[2], PetscReal t[2])
{
  const PetscReal c = PetscCosReal(angle), s = PetscSinReal(angle);

  t[0] = -c * side * n[1] - s * n[0];
  t[1] = c * side * n[0] - s * n[1];
}

/* From `from`, outside, along its tangent and that at the surface, to the surface: *to */
static PetscErrorCode find_contact(const PhaseSolid *s, const End *from, PetscReal side, End *to)
{
  PetscReal n[2], angle, d;

  PetscFunctionBeginUser;
  *to = *from;
  PetscCall((*s->distance)(s->ctx, 1, from->x, &d, &angle));
  PetscCall(normal_at(s, from->x, n));
  for (PetscInt round = 0; round < ROUNDS; round++) {
    PetscReal e[2], y[2] = {from->x[0], from->x[1]}, size, in;

    contact_tangent(angle, side, n, to->t);
    for (PetscInt a = 0; a < 2; a++) e[a] = from->t[a] + to->t[a];
    size = PetscMax(PETSC_SMALL, PetscHypotReal(e[0], e[1]));
    in   = (e[0] * n[0] + e[1] * n[1]) / size;
    for (PetscInt a = 0; a < 2; a++) e[a] = e[a] / size - PetscMax(0, in + INWARD) * n[a];
    for (PetscInt i = 0; i < ROUNDS; i++) {
      PetscCall(distance_at(s, y, &d));
      PetscCall(normal_at(s, y, n));
      if (PetscAbsReal(d) < CLOSE * s->h) break;
      in = PetscMax(INWARD, -(e[0] * n[0] + e[1] * n[1]));
      for (PetscInt a = 0; a < 2; a++) y[a] += d / in * e[a];
    }
    size = PetscHypotReal(y[0] - to->x[0], y[1] - to->x[1]);
    for (PetscInt a = 0; a < 2; a++) to->x[a] = y[a];
    if (size < CLOSE * s->h) break;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what is kept ---- */

/* An end of the curve at node 2 (way 1) or node 0 (way -1) of edge e, where it goes on to what is solid: tangent that
   way, by a parabola through nodes before it */
static void measure_end(const PhaseCurve *c, PetscReal h, PetscInt e, PetscInt way, End *to)
{
  const PetscInt last = way > 0 ? 2 : 0;
  PetscReal      p[3][2], at[3] = {0}, y[2], length = 0, size;
  PetscInt       n = 1;

  for (PetscInt a = 0; a < 2; a++) to->x[a] = p[0][a] = c->x[e][last][a];
  for (PetscInt i = e; n < 3 && !c->wall[i];) {
    for (PetscInt j = 1; j < 3 && n < 3; j++) {
      length += PetscSqrtReal(EdgeDistance2(c->x[i][last - way * j], c->x[i][last - way * (j - 1)]));
      if (length < n * BACK * h) continue;
      at[n] = length;
      for (PetscInt a = 0; a < 2; a++) p[n][a] = c->x[i][last - way * j][a];
      n++;
    }
    i = way > 0 ? c->before[i] : c->next[i];
    if (i == e) break;
  }
  EdgeEvaluate(c->x[e], (PetscReal)way, y, to->t);
  for (PetscInt a = 0; a < 2; a++) {
    if (n == 3)
      to->t[a] = p[0][a] * (1 / at[1] + 1 / at[2]) - p[1][a] * at[2] / (at[1] * (at[2] - at[1])) +
                 p[2][a] * at[1] / (at[2] * (at[2] - at[1]));
    else to->t[a] *= way;
  }
  size = PetscHypotReal(to->t[0], to->t[1]);
  for (PetscInt a = 0; a < 2 && size > 0; a++) to->t[a] /= size;
}

static PetscErrorCode keep_edge(const PhaseCurve *c, PetscInt e, Edges *to)
{
  PhaseEdge *edge;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(to->n + 1, &to->capacity, &to->edge, sizeof(*to->edge), NULL));
  edge       = to->edge + to->n++;
  edge->drop = (PetscReal)c->drop[e];
  edge->wall = c->wall[e] ? 1 : 0;
  PetscCall(PetscArraycpy((PetscReal *)edge->x, (const PetscReal *)c->x[e], 6));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what is drawn ---- */

/* Hermite's cubic from one end to another, both tangents along the curve; of arcs nearly one */
static PetscErrorCode add_cubic(const End *from, const End *to, PetscReal h, PetscInt drop, Edges *all)
{
  const PetscReal chord = PetscSqrtReal(EdgeDistance2(from->x, to->x)),
                  half  = 0.5 * PetscAcosReal(PetscMax(-1, PetscMin(1, from->t[0] * to->t[0] + from->t[1] * to->t[1]))),
                  m     = chord / PetscSqr(PetscCosReal(0.5 * half));
  const PetscInt n      = PetscMax(1, (PetscInt)PetscCeilReal(FINE * chord / h));

  PetscFunctionBeginUser;
  if (chord < CLOSE * h) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ArrayReserve(all->n + n, &all->capacity, &all->edge, sizeof(*all->edge), NULL));
  for (PetscInt i = 0; i < n; i++) {
    PhaseEdge *edge = all->edge + all->n++;

    edge->drop = (PetscReal)drop;
    edge->wall = 0;
    for (PetscInt j = 0; j < 3; j++) {
      const PetscReal r = (PetscReal)(2 * i + j) / (PetscReal)(2 * n), q = 1 - r;

      for (PetscInt a = 0; a < 2; a++)
        edge->x[j][a] = q * q * (1 + 2 * r) * from->x[a] + r * r * (3 - 2 * r) * to->x[a] +
                        r * q * m * (q * from->t[a] - r * to->t[a]);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Between edges that are kept: from the end of the first to the begin of the last */
static PetscErrorCode draw_between(const PhaseCurve *c, const PhaseSolid *s, PetscInt first, PetscInt last, Edges *all)
{
  End from, to, in, out;

  PetscFunctionBeginUser;
  measure_end(c, s->h, first, 1, &from);
  measure_end(c, s->h, last, -1, &to);
  PetscCall(find_contact(s, &from, 1, &in));
  PetscCall(find_contact(s, &to, -1, &out));
  for (PetscInt a = 0; a < 2; a++) {
    to.t[a]  = -to.t[a];
    out.t[a] = -out.t[a];
  }
  if ((out.x[0] - in.x[0]) * (to.x[0] - from.x[0]) + (out.x[1] - in.x[1]) * (to.x[1] - from.x[1]) <= 0) {
    PetscCall(add_cubic(&from, &to, s->h, c->drop[first], all)); /* contact lines that meet let go of the surface */
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(add_cubic(&from, &in, s->h, c->drop[first], all));
  PetscCall(add_cubic(&in, &out, s->h, c->drop[first], all));
  PetscCall(add_cubic(&out, &to, s->h, c->drop[first], all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the whole ---- */

/* near [n] edges within a length of what is solid, deep [n] those that are in it */
static PetscErrorCode find_near(const PhaseCurve *c, const PhaseSolid *s, PetscBool near[], PetscBool deep[])
{
  PetscReal *d;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(3 * c->n, &d));
  PetscCall((*s->distance)(s->ctx, 3 * c->n, (const PetscReal *)c->x, d, NULL));
  for (PetscInt e = 0; e < c->n; e++) {
    const PetscReal nearest = PetscMin(d[3 * e], PetscMin(d[3 * e + 1], d[3 * e + 2]));

    near[e] = (PetscBool)(nearest < s->h);
    deep[e] = (PetscBool)(nearest < 0);
  }
  PetscCall(PetscFree(d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A loop of n edges at these places, the first of them not near; *drawn: something was */
static PetscErrorCode copy_loop(const PhaseCurve *c, const PhaseSolid *s, PetscInt n, const PetscInt place[],
                                const PetscBool near[], const PetscBool deep[], Edges *all)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n;) {
    PetscInt  to      = i;
    PetscBool crosses = PETSC_FALSE, wall = PETSC_FALSE;

    for (; to < n && near[place[to]]; to++) {
      crosses = (PetscBool)(crosses || deep[place[to]]);
      wall    = (PetscBool)(wall || c->wall[place[to]]);
    }
    if (crosses && !wall) PetscCall(draw_between(c, s, place[i - 1], place[to % n], all));
    else
      for (to = PetscMax(i + 1, to); i < to; i++) PetscCall(keep_edge(c, place[i], all));
    i = to;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode replace(PhaseCurve *c, PetscInt nloop, const PetscInt first[], const Edges *all)
{
  PetscFunctionBeginUser;
  PetscCall(PhaseCurveDestroy(c));
  PetscCall(PhaseCurveCreate(all->n, c));
  for (PetscInt l = 0; l < nloop; l++)
    for (PetscInt e = first[l]; e < first[l + 1]; e++) {
      PetscCall(PetscArraycpy((PetscReal *)c->x[e], (const PetscReal *)all->edge[e].x, 6));
      c->drop[e]   = (PetscInt)all->edge[e].drop;
      c->wall[e]   = (PetscBool)(all->edge[e].wall != 0);
      c->next[e]   = e + 1 < first[l + 1] ? e + 1 : first[l];
      c->before[e] = e > first[l] ? e - 1 : first[l + 1] - 1;
    }
  PhaseCurveLink(c);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseCurveMeet(PhaseCurve *c, const PhaseSolid *s)
{
  const PetscInt nloop = c->nloop;
  PetscInt      *first, *place;
  PetscBool     *near, *deep;
  Edges          all = {0};

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc4(nloop + 1, &first, c->n, &place, c->n, &near, c->n, &deep));
  PetscCall(find_near(c, s, near, deep));
  for (PetscInt l = 0; l < nloop; l++) {
    const PetscInt n = c->first[l + 1] - c->first[l], *edge = c->edge + c->first[l];
    PetscInt       begin = 0;

    first[l] = all.n;
    while (begin < n && near[edge[begin]]) begin++;
    for (PetscInt i = 0; i < n; i++) place[i] = edge[(begin + i) % n];
    if (begin < n) PetscCall(copy_loop(c, s, n, place, near, deep, &all));
    for (PetscInt i = 0; i < n && begin == n; i++) PetscCall(keep_edge(c, place[i], &all)); /* all of it is near */
  }
  first[nloop] = all.n;
  PetscCall(replace(c, nloop, first, &all));
  PetscCall(PetscFree(all.edge));
  PetscCall(PetscFree4(first, place, near, deep));
  PetscFunctionReturn(PETSC_SUCCESS);
}
