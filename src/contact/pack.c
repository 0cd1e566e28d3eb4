/* Contact, packing: places for the bodies of groups with -particle_<g>_place pack.

   Bodies start anywhere in their box, so small that they fill a quarter of it, and grow to their size in stages, as
   in Lubachevsky & Stillinger (1990, J. Stat. Phys. 60, 561). Between two stages overlaps are relaxed: pair after
   pair is moved apart along its normal by what its gap lacks (Gauss-Seidel on the places, as in separate.c), and
   turned about the point of contact where orientations are random; large bodies give way less than small ones. A
   little more room is made than is asked for (slack), so that a pair that has been moved apart stays so while its
   neighbours are. Pairs and gaps are those of the contact: search.c, touch.c. A gap of bodies that are no discs is
   first that of surface points; at the end it is sought on the surface between the points, so that no overlap is
   left that the points do not see.

   Works for convex shapes; others may hook into each other and still come apart. Replicated: every rank computes
   the same places, from the seeds of the groups. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "base/room.h"
#include <petsctime.h>

#define START            0.25 /* share of the box that bounding circles fill at first; a third of it in 3D */
#define GROWTH           1.04 /* of the size in a stage */
#define SHRINK           1.02 /* where they do not fit */
#define STAGE_SWEEPS     15
#define MOST_SWEEPS      4000
#define PATIENCE         400  /* sweeps without a tenth less overlap, after which it is given up */
#define SLACK            0.02 /* in mean radii */
#define SLACK_SWEEPS     100  /* after which the slack is halved */
#define LOOK             0.15 /* gaps that are computed, in mean radii */
#define DOUBT            0.04 /* gaps that surface points may miss, in radii */
#define POINTS(dim)      ((dim) == 2 ? 64 : 200)
#define SEARCH_STEP(dim) ((dim) == 2 ? 0.06 : 0.15) /* first step of a search on a surface, in radii */
#define SEARCH_HALVINGS  14

typedef struct {
  Contact    c;
  PetscReal  size, slack, mean;                 /* of all packed bodies; mean radius */
  PetscBool  round;                             /* bodies count as their bounding circles */
  PetscBool  fine;                              /* gaps are sought between the surface points */
  PetscReal *inverse_mass, *inverse_spin, *way; /* [n] way: that a body has gone */
  PetscReal *bound, *mark;                      /* [room] of pairs: a gap it had, ways of the two bodies then */
  PetscInt   room, sweeps;
  PetscReal  worst;                   /* that gaps lacked in the last sweep */
  PetscReal (*lower)[3], (*upper)[3]; /* [ngroups] where a body must stay; infinite along periodic axes */
} Pack;

static const Packing *packing(const Pack *p, PetscInt k)
{
  return &BodiesGetGroup(p->c->state, k)->pack;
}

/* Gap that a pair, or body i and a face of its box, must have */
static PetscReal margin_of(const Pack *p, PetscInt i, PetscInt j)
{
  const Packing *a = packing(p, i), *b = j >= 0 ? packing(p, j) : a;

  return PetscMax(a->wanted ? a->margin : 0, b->wanted ? b->margin : 0);
}

/* ---- moving ---- */

/* Move a body by a push along n at r from its centre */
static void shift_body(Pack *p, PetscInt k, PetscReal push, const PetscReal n[3], const PetscReal r[3])
{
  Contact   c = p->c;
  PetscReal turn[3], length = PetscAbsReal(push) * p->inverse_mass[k];

  for (PetscInt a = 0; a < c->dim; a++) c->x[k][a] += push * p->inverse_mass[k] * n[a];
  if (p->inverse_spin[k] > 0) {
    cross(r, n, turn);
    for (PetscInt a = 0; a < 3; a++) turn[a] *= push * p->inverse_spin[k];
    length += ContactKind(c, k)->radius * PetscSqrtReal(dot3(turn, turn));
    c->s->angle[k] += turn[2];
    if (c->dim == 2) RotationFromAngle(c->s->angle[k], c->q[k]);
    else RotationAdvance(1, turn, c->q[k]);
  }
  p->way[k] += length;
}

/* How easily body k gives way along n at r */
static PetscReal ease(const Pack *p, PetscInt k, const PetscReal n[3], const PetscReal r[3])
{
  PetscReal rn[3];

  cross(r, n, rn);
  return p->inverse_mass[k] + p->inverse_spin[k] * dot3(rn, rn);
}

/* Move bodies apart by what is missing of their gap; j < 0: a face of the box */
static void part(Pack *p, PetscInt i, PetscInt j, const Touch *t, PetscReal missing)
{
  const PetscReal inverse = ease(p, i, t->normal, t->ri) + (j >= 0 ? ease(p, j, t->normal, t->rj) : 0);
  /* bodies that turn see their gap change in another way than linearly: no more than a part of their size at once */
  const PetscReal most = 0.5 * ContactKind(p->c, i)->radius;

  if (inverse <= 0) return;
  shift_body(p, i, PetscMin(missing, most) / inverse, t->normal, t->ri);
  if (j >= 0) shift_body(p, j, -PetscMin(missing, most) / inverse, t->normal, t->rj);
}

/* ---- gaps ---- */

/* Distance of the point at r from the centre of body i to body j (apart: centre of i from that of j), or its place
   along the inner normal of a face of the box, from the centre */
static PetscErrorCode measure(Pack *p, PetscInt j, const PetscReal apart[3], const PetscReal r[3], PetscReal *d)
{
  const PetscReal zero[3] = {0, 0, 0}, x[3] = {apart[0] + r[0], apart[1] + r[1], apart[2] + r[2]};

  PetscFunctionBeginUser;
  if (j >= 0) PetscCall(BodiesDistance(p->c->bodies, j, zero, p->c->q[j], 1, x, d));
  else *d = ((-1 - j) % 2 ? -1 : 1) * r[(-1 - j) / 2];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From a point near the surface of body i at r to the surface point nearby that is nearest to j: steps along two
   tangents, halved where none of them gains */
static PetscErrorCode search_surface(Pack *p, PetscInt i, PetscInt j, const PetscReal apart[3], const PetscReal normal[3], PetscReal r[3],
                                     PetscReal *gap)
{
  const PetscInt  dim     = p->c->dim;
  const PetscReal zero[3] = {0, 0, 0}, axis[3] = {dim == 3 && PetscAbsReal(normal[2]) > 0.7, 0, dim == 2 || PetscAbsReal(normal[2]) <= 0.7};
  PetscReal       t[2][3], step                = SEARCH_STEP(dim) * ContactKind(p->c, i)->radius;

  PetscFunctionBeginUser;
  cross(axis, normal, t[0]);
  cross(normal, t[0], t[1]);
  PetscCall(BodiesProject(p->c->bodies, i, zero, p->c->q[i], 1, r, r));
  PetscCall(measure(p, j, apart, r, gap));
  for (PetscInt halving = 0; halving < SEARCH_HALVINGS; halving++) {
    PetscReal best[3], least = *gap;

    for (PetscInt e = 0; e < 2 * (dim - 1); e++) {
      PetscReal y[3] = {0, 0, 0}, d;

      for (PetscInt a = 0; a < dim; a++) y[a] = r[a] + (e % 2 ? -step : step) * t[e / 2][a];
      PetscCall(BodiesProject(p->c->bodies, i, zero, p->c->q[i], 1, y, y));
      PetscCall(measure(p, j, apart, y, &d));
      if (d >= least) continue;
      least = d;
      PetscCall(PetscArraycpy(best, y, 3));
    }
    if (least < *gap) {
      PetscCall(PetscArraycpy(r, best, 3));
      *gap = least;
    } else step *= 0.5;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bounding circles, where body j stays as it is only that of i. At first, because bodies that lie on each other have
   surface points that seem not to overlap. */
static PetscErrorCode look_at_circles(Pack *p, PetscInt i, PetscInt j, Touch *t)
{
  Contact         c  = p->c;
  const PetscReal ri = ContactKind(c, i)->radius, rj = ContactKind(c, j)->radius, zero[3] = {0, 0, 0};
  PetscReal       apart[3], y[3] = {0, 0, 0}, d;

  PetscFunctionBeginUser;
  ContactDiscGap(c, i, ri, j, rj, t->normal, &t->gap);
  for (PetscInt a = 0; a < 3; a++) apart[a] = (t->gap + ri + rj) * t->normal[a];
  if (p->inverse_mass[j] == 0) {
    PetscCall(BodiesDistance(c->bodies, j, zero, c->q[j], 1, apart, &d));
    PetscCall(BodiesProject(c->bodies, j, zero, c->q[j], 1, apart, y));
    t->gap = d - ri;
    if (d != 0)
      for (PetscInt a = 0; a < c->dim; a++) t->normal[a] = (apart[a] - y[a]) / d;
  }
  for (PetscInt a = 0; a < 3; a++) {
    t->ri[a] = -ri * t->normal[a];
    t->rj[a] = apart[a] + t->ri[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Centres in each other: only bodies that lie on each other */
static PetscErrorCode lie_on_each_other(Pack *p, PetscInt i, PetscInt j, const PetscReal apart[3], PetscBool *yes)
{
  const PetscReal zero[3] = {0, 0, 0}, back[3] = {-apart[0], -apart[1], -apart[2]};
  PetscReal       di, dj;

  PetscFunctionBeginUser;
  PetscCall(BodiesDistance(p->c->bodies, j, zero, p->c->q[j], 1, apart, &dj));
  PetscCall(BodiesDistance(p->c->bodies, i, zero, p->c->q[i], 1, back, &di));
  *yes = (PetscBool)(di < 0 || dj < 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The deepest point of a pair; gap PETSC_MAX_REAL: not near */
static PetscErrorCode look_at_pair(Pack *p, PetscInt i, PetscInt j, Touch *t)
{
  Contact     c  = p->c;
  const Kind *ki = ContactKind(c, i), *kj = ContactKind(c, j);
  PetscReal   gap, apart[3];
  PetscInt    n;
  PetscBool   inside = PETSC_FALSE;

  PetscFunctionBeginUser;
  t->gap = PETSC_MAX_REAL;
  if (p->round && p->inverse_mass[i] > 0) {
    PetscCall(look_at_circles(p, i, j, t));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(ContactFindTouch(c, i, j, &n, &gap));
  for (PetscInt k = 0; k < n; k++)
    if (c->touch[k].gap < t->gap) *t = c->touch[k];
  if (!p->fine || (ki->disc > 0 && kj->disc > 0)) PetscFunctionReturn(PETSC_SUCCESS);
  if (t->gap > margin_of(p, i, j) + p->slack + DOUBT * PetscMin(ki->radius, kj->radius)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < 3; a++) apart[a] = t->rj[a] - t->ri[a];
  PetscCall(lie_on_each_other(p, i, j, apart, &inside));
  if (inside) PetscCall(look_at_circles(p, i, j, t));
  else PetscCall(search_surface(p, i, j, apart, t->normal, t->ri, &t->gap));
  for (PetscInt a = 0; a < 3; a++) t->rj[a] = t->ri[a] + apart[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Body k and a face of its box; gap PETSC_MAX_REAL: not near */
static PetscErrorCode look_at_face(Pack *p, PetscInt k, PetscInt face, Touch *t)
{
  Contact         c    = p->c;
  const Kind     *kind = ContactKind(c, k);
  const PetscInt  a = face / 2, g = c->s->body_group[k];
  const PetscReal sign = face % 2 ? -1 : 1, from = sign * (c->x[k][a] - (face % 2 ? p->upper[g][a] : p->lower[g][a]));
  PetscReal       R[9], lowest = PETSC_MAX_REAL, zero[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  t->gap = PETSC_MAX_REAL;
  for (PetscInt b = 0; b < 3; b++) t->normal[b] = b == a ? sign : 0;
  if (from > kind->radius + margin_of(p, k, -1) + p->slack) PetscFunctionReturn(PETSC_SUCCESS);
  if (kind->disc > 0) {
    for (PetscInt b = 0; b < 3; b++) t->ri[b] = -kind->disc * t->normal[b];
    t->gap = from - kind->disc;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  RotationMatrix(c->q[k], R);
  for (PetscInt i = 0; i < kind->npoints; i++) {
    const PetscReal *y = kind->point + i * c->dim;
    PetscReal        r[3];

    for (PetscInt b = 0; b < 3; b++) r[b] = kind->scale * (R[3 * b] * y[0] + R[3 * b + 1] * y[1] + (c->dim == 3 ? R[3 * b + 2] * y[2] : 0));
    if (sign * r[a] >= lowest) continue;
    lowest = sign * r[a];
    PetscCall(PetscArraycpy(t->ri, r, 3));
  }
  if (p->fine) PetscCall(search_surface(p, k, -1 - face, zero, t->normal, t->ri, &lowest));
  t->gap = from + lowest;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- sweeps ---- */

static void note_gap(Pack *p, PetscReal gap, PetscReal margin)
{
  p->worst = PetscMax(p->worst, margin - gap);
}

static PetscErrorCode sweep_pairs(Pack *p, PetscBool moving)
{
  Contact c = p->c;
  Touch   t;

  PetscFunctionBeginUser;
  for (PetscInt n = 0; n < c->npairs; n++) {
    const PetscInt  i = c->pair[n].i, j = c->pair[n].j;
    const PetscReal margin = margin_of(p, i, j), way = p->way[i] + p->way[j];

    if (p->bound[n] - (way - p->mark[n]) >= margin + p->slack) continue; /* not nearer since */
    PetscCall(look_at_pair(p, i, j, &t));
    p->bound[n] = PetscMin(t.gap, c->horizon);
    p->mark[n]  = way;
    note_gap(p, t.gap, margin);
    if (moving && t.gap < margin + p->slack) part(p, i, j, &t, margin + p->slack - t.gap);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode sweep_faces(Pack *p, PetscBool moving)
{
  Contact c = p->c;
  Touch   t;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal margin = margin_of(p, k, -1);

    for (PetscInt face = 0; face < 2 * c->dim && packing(p, k)->wanted; face++) {
      PetscCall(look_at_face(p, k, face, &t));
      if (t.gap >= PETSC_MAX_REAL) continue;
      note_gap(p, t.gap, margin);
      if (moving && t.gap < margin + p->slack) part(p, k, -1, &t, margin + p->slack - t.gap);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The list of pairs for where the bodies are now; what was known of the gaps is forgotten with the old one */
static PetscErrorCode renew_list(Pack *p)
{
  Contact c = p->c;

  PetscFunctionBeginUser;
  PetscCall(ContactFindPairs(c));
  if (c->tests == 0) PetscFunctionReturn(PETSC_SUCCESS); /* it was still good */
  PetscCall(RoomFor(c->npairs, &p->room, &p->bound, sizeof(*p->bound), &p->mark, sizeof(*p->mark), NULL));
  for (PetscInt n = 0; n < c->npairs; n++) p->bound[n] = -PETSC_MAX_REAL;
  for (PetscInt n = 0; n < c->npairs; n++) p->mark[n] = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What gaps lack, after or without moving bodies apart */
static PetscErrorCode sweep(Pack *p, PetscBool moving)
{
  PetscFunctionBeginUser;
  p->worst = -PETSC_MAX_REAL;
  PetscCall(renew_list(p));
  PetscCall(sweep_pairs(p, moving));
  PetscCall(sweep_faces(p, moving));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sweeps until every gap is at least its margin, at most so many; *done tells whether it came to that, which only a
   sweep that moves nothing can. The slack is halved from time to time: near the densest packing there is no room
   for it. */
static PetscErrorCode relax(Pack *p, PetscInt most, PetscBool *done)
{
  PetscReal best  = PETSC_MAX_REAL;
  PetscInt  since = 0;

  PetscFunctionBeginUser;
  *done = PETSC_FALSE;
  for (PetscInt i = 1; i <= most && since < PATIENCE && !*done; i++, since++) {
    PetscCall(sweep(p, PETSC_TRUE));
    if (p->worst < 0.9 * best) {
      best  = p->worst;
      since = 0;
    }
    if (p->worst <= 0) PetscCall(sweep(p, PETSC_FALSE));
    *done = (PetscBool)(p->worst <= 0);
    p->sweeps++;
    if (i % SLACK_SWEEPS == 0) p->slack *= 0.5;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- growth ---- */

/* All packed bodies at `size` times their own */
static void set_size(Pack *p, PetscReal size)
{
  Contact c = p->c;

  for (PetscInt i = 0; i < c->nkinds; i++) {
    Kind           *k = &c->kind[i];
    const PetscReal s = size / p->size;

    if (!k->moves) continue;
    k->scale *= s;
    k->radius *= s;
    k->disc *= s;
  }
  c->have_list = PETSC_FALSE;
  p->size      = size;
  p->slack     = SLACK * p->mean * size;
}

/* Bodies at their true size, free of the round-off of the growth */
static void set_true_size(Pack *p)
{
  Contact c = p->c;

  set_size(p, 1);
  for (PetscInt k = 0; k < c->s->n; k++) {
    ContactKind(c, k)->scale  = c->s->scale[k];
    ContactKind(c, k)->radius = BodiesGetRadius(c->state, k);
    ContactKind(c, k)->disc   = BodiesGetDisc(c->state, k);
  }
}

/* The size at which bounding circles fill a small share of the smallest box */
static PetscReal first_size(const Pack *p)
{
  const BodyArrays *s   = p->c->s;
  PetscReal         sum = 0, box = PETSC_MAX_REAL;

  for (PetscInt k = 0; k < s->n; k++)
    if (packing(p, k)->wanted) sum += (s->dim == 2 ? PETSC_PI : 4 * PETSC_PI / 3) * PetscPowRealInt(BodiesGetRadius(p->c->state, k), s->dim);
  for (PetscInt g = 0; g < s->ngroups; g++) {
    const Packing *b      = &s->group[g].pack;
    PetscReal      volume = 1;

    for (PetscInt a = 0; a < s->dim; a++) volume *= b->upper[a] - b->lower[a];
    if (b->wanted) box = PetscMin(box, volume);
  }
  return PetscMin(1, PetscPowReal((s->dim == 2 ? START : START / 3) * box / sum, 1. / s->dim));
}

/* They do not fit: say what they would fill, shrunk until they do */
static PetscErrorCode refuse(Pack *p)
{
  const BodyArrays *s      = p->c->s;
  const PetscReal   worst  = p->worst;
  PetscReal         volume = 0, box = 1;
  PetscInt          g    = 0;
  PetscBool         done = PETSC_FALSE;

  PetscFunctionBeginUser;
  while (!s->group[g].pack.wanted) g++;
  for (PetscInt a = 0; a < s->dim; a++) box *= s->group[g].pack.upper[a] - s->group[g].pack.lower[a];
  for (PetscInt k = s->group[g].first; k < s->group[g].first + s->group[g].count; k++) volume += BodiesVolume(p->c->state, k);
  p->fine = PETSC_FALSE;
  for (PetscReal size = 1 / SHRINK; size > 0.2 && !done; size /= SHRINK) {
    set_size(p, size);
    PetscCall(relax(p, SLACK_SWEEPS, &done));
  }
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
          "Bodies cannot be packed: group '%s' is to fill %.3g of its box, about %.2g is within reach (overlaps of %.2g were left at full size). Lower "
          "-particle_%s_fraction, _count or _margin, or widen -particle_%s_lower .. _upper",
          s->group[g].name, (double)(volume / box), (double)(volume / box * PetscPowRealInt(p->size, s->dim)), (double)worst, s->group[g].name,
          s->group[g].name);
}

static PetscErrorCode grow(Pack *p)
{
  PetscBool done;

  PetscFunctionBeginUser;
  p->round = PETSC_TRUE;
  for (PetscReal size = first_size(p); size < 1; size *= GROWTH) {
    set_size(p, size);
    PetscCall(relax(p, p->round ? MOST_SWEEPS : STAGE_SWEEPS, &done));
    p->round = PETSC_FALSE;
  }
  set_true_size(p);
  PetscCall(relax(p, MOST_SWEEPS, &done));
  if (!done) PetscCall(refuse(p));
  p->fine         = PETSC_TRUE;
  p->c->have_list = PETSC_FALSE;
  PetscCall(relax(p, MOST_SWEEPS, &done));
  if (!done) PetscCall(refuse(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- from and to the scene ---- */

static PetscErrorCode set_weights(Pack *p)
{
  Contact   c = p->c;
  PetscReal inertia[6];
  PetscInt  n = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->nkinds; i++) c->kind[i].moves = c->s->group[c->kind[i].group].pack.wanted;
  for (PetscInt k = 0; k < c->s->n; k++) {
    if (!packing(p, k)->wanted) continue;
    p->mean += BodiesGetRadius(c->state, k);
    n++;
    p->inverse_mass[k] = 1 / BodiesVolume(c->state, k);
    if (!packing(p, k)->turns || ContactKind(c, k)->disc > 0) continue;
    PetscCall(BodiesGetInertia(c->bodies, k, NULL, PETSC_TRUE, inertia));
    p->inverse_spin[k] = c->dim == 2 ? 1 / inertia[2] : 3 / (inertia[0] + inertia[1] + inertia[2]);
  }
  p->mean /= n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Faces that hold the bodies of a group: not those of a box that is as long as the period */
static void set_faces(Pack *p)
{
  const Contact c = p->c;

  for (PetscInt g = 0; g < c->s->ngroups; g++)
    for (PetscInt a = 0; a < c->dim; a++) {
      const Packing  *b    = &c->s->group[g].pack;
      const PetscBool open = (PetscBool)(c->period[a] > 0 && b->upper[a] - b->lower[a] > c->period[a] * (1 - 1e-9));

      p->lower[g][a] = open ? PETSC_MIN_REAL : b->lower[a];
      p->upper[g][a] = open ? PETSC_MAX_REAL : b->upper[a];
    }
}

static PetscErrorCode store_places(Pack *p)
{
  Contact c = p->c;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal x[3];

    if (!packing(p, k)->wanted) continue;
    for (PetscInt a = 0; a < 3; a++) x[a] = DomainWrap(c->period[a], c->x[k][a], c->lower[a]);
    PetscCall(BodiesPlace(c->bodies, k, x, c->q[k], c->s->angle[k]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode pack_bodies(Pack *p)
{
  const PetscInt n = p->c->s->n, m = p->c->s->ngroups;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc3(n, &p->inverse_mass, n, &p->inverse_spin, n, &p->way));
  PetscCall(PetscCalloc2(m, &p->lower, m, &p->upper));
  PetscCall(set_weights(p));
  set_faces(p);
  p->c->range = p->c->horizon = LOOK * p->mean;
  for (PetscInt g = 0; g < m; g++) p->c->horizon = PetscMax(p->c->horizon, p->c->s->group[g].pack.margin + LOOK * p->mean);
  PetscCall(ContactCreatePoints(p->c, POINTS(p->c->dim)));
  p->size = 1;
  PetscCall(grow(p));
  PetscCall(store_places(p));
  PetscCall(PetscFree2(p->lower, p->upper));
  PetscCall(PetscFree3(p->inverse_mass, p->inverse_spin, p->way));
  PetscCall(PetscFree(p->bound));
  PetscCall(PetscFree(p->mark));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void find_fraction(const BodyState *s, ContactPacking *result)
{
  for (PetscInt g = 0; g < s->ngroups; g++) {
    const BodyGroup *group = &s->group[g];
    PetscReal        box = 1, sum = 0;

    if (!group->pack.wanted) continue;
    for (PetscInt a = 0; a < s->dim; a++) box *= group->pack.upper[a] - group->pack.lower[a];
    for (PetscInt k = group->first; k < group->first + group->count; k++) sum += BodiesVolume(s, k);
    result->bodies += group->count;
    result->fraction += sum / box;
  }
}

PetscErrorCode ContactPack(Bodies bodies, const PetscReal lower[3], const PetscReal upper[3], const PetscReal period[3], ContactPacking *result)
{
  Pack           p = {0};
  PetscLogDouble begin, end;
  BodyState     *s;

  PetscFunctionBeginUser;
  *result = (ContactPacking){0};
  PetscCall(BodiesGetState(bodies, &s));
  find_fraction(s, result);
  if (!result->bodies) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscTime(&begin));
  PetscCall(PetscLogEventBegin(TB_CONTACT, 0, 0, 0, 0));
  PetscCall(ContactCreateBare(bodies, lower, upper, &p.c));
  PetscCall(ContactSetPeriod(p.c, period));
  PetscCall(pack_bodies(&p));
  PetscCall(ContactDestroy(&p.c));
  PetscCall(PetscLogEventEnd(TB_CONTACT, 0, 0, 0, 0));
  PetscCall(PetscTime(&end));
  result->sweeps  = p.sweeps;
  result->seconds = end - begin;
  PetscFunctionReturn(PETSC_SUCCESS);
}
