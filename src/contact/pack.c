/* Contact, packing: places for the bodies of groups with -particle_<g>_place pack.

   Bodies start anywhere in their box, so small that they fill a quarter of it, and grow to their size in stages, as
   in Lubachevsky & Stillinger (1990, J. Stat. Phys. 60, 561). Between two stages overlaps are relaxed: pair after
   pair is moved apart along its normal by what its gap lacks (Gauss-Seidel on the places, as in separate.c), and
   turned about the point of contact where orientations are random; large bodies give way less than small ones. A
   little more room is made than is asked for (slack), so that a pair that has been moved apart stays so while its
   neighbours are. Pairs and gaps are those of the contact: search.c, touch.c. A gap of bodies that are no discs is
   first that of surface points; at the end it is sought on the surface between the points, so that no overlap is
   left that the points do not see.

   The order of the pairs is that of blocks of 2^dim cells, which a pair lies in: first those whose lowest cell is even
   along all axes, then those where it is odd along x, and so on. Blocks of one such colour have no body in common. So
   the cells alone decide what comes of a sweep, whichever rank does it: a rank does the blocks in which it has bodies,
   for which it knows all bodies of the cells around its own, and ghosts hear of their owners after each colour.

   Works for convex shapes; others may hook into each other and still come apart. */
#include "compat.h"
#include "pack.h"
#include "base/log.h"
#include "base/array.h"
#include <petsctime.h>

#define START        0.25 /* fraction of the box that bounding circles fill at first; a third of it in 3D */
#define GROWTH       1.04 /* of the size in a stage */
#define SHRINK       1.02 /* where they do not fit */
#define STAGE_SWEEPS 15
#define MAX_SWEEPS   4000
#define PATIENCE     400  /* sweeps without a tenth less overlap, after which it is given up */
#define SLACK        0.02 /* in mean radii */
#define SLACK_SWEEPS 100  /* after which the slack is halved */
#define LOOK         0.15 /* gaps that are computed, in mean radii */
#define POINTS(dim)  ((dim) == 2 ? 64 : 200)
#define MAX_CELLS(n) (4. * (n) + 64)
#define NOWHERE      -1 /* cell of a body that does not move */

static PetscReal box_of(const BodyGroup *g, PetscInt dim)
{
  PetscReal volume = 1;

  for (PetscInt a = 0; a < dim; a++) volume *= g->pack.upper[a] - g->pack.lower[a];
  return volume;
}

/* Of the box of a group that its bodies fill. Collective. */
static PetscErrorCode find_fill(Bodies bodies, PetscInt group, PetscReal *fill)
{
  Exact      sum = {{0}, 0, 0};
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  for (PetscInt k = 0; k < s->n; k++)
    if (s->own[k] && s->body_group[k] == group) ExactAdd(&sum, BodiesVolume(s, k));
  PetscCall(ExactGetSum(BodiesComm(bodies), &sum, fill));
  *fill /= box_of(&s->group[group], s->dim);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- moving ---- */

/* Move a body by a push along n at r from its centre */
static void shift_body(Pack *p, PetscInt k, PetscReal shift, const PetscReal n[3], const PetscReal r[3])
{
  Contact   c = p->c;
  PetscReal turn[3], length = PetscAbsReal(shift) * p->inverse_mass[k];

  for (PetscInt a = 0; a < c->dim; a++) c->x[k][a] += shift * p->inverse_mass[k] * n[a];
  if (p->inverse_moment[k] > 0) {
    cross(r, n, turn);
    for (PetscInt a = 0; a < 3; a++) turn[a] *= shift * p->inverse_moment[k];
    length += ContactKind(c, k)->radius * PetscSqrtReal(dot3(turn, turn));
    c->s->angle[k] += turn[2];
    if (c->dim == 2) RotationFromAngle(c->s->angle[k], c->q[k]);
    else RotationAdvance(1, turn, c->q[k]);
  }
  p->travelled[k] += length;
}

/* How easily body k gives way along n at r */
static PetscReal mobility(const Pack *p, PetscInt k, const PetscReal n[3], const PetscReal r[3])
{
  PetscReal rn[3];

  cross(r, n, rn);
  return p->inverse_mass[k] + p->inverse_moment[k] * dot3(rn, rn);
}

/* Move bodies apart by what is missing of their gap; j < 0: a face of the box */
static void separate_pair(Pack *p, PetscInt i, PetscInt j, const Touch *t, PetscReal missing)
{
  const PetscReal inverse = mobility(p, i, t->normal, t->ri) + (j >= 0 ? mobility(p, j, t->normal, t->rj) : 0);
  /* bodies that turn see their gap change in another way than linearly: no more than a part of their size at once */
  const PetscReal max = 0.5 * ContactKind(p->c, i)->radius;

  if (inverse <= 0) return;
  shift_body(p, i, PetscMin(missing, max) / inverse, t->normal, t->ri);
  if (j >= 0) shift_body(p, j, -PetscMin(missing, max) / inverse, t->normal, t->rj);
}

/* ---- blocks ---- */

/* Of a block along one axis, from cells of the bodies of a pair, which are the same or neighbours */
static PetscInt lowest_cell(PetscInt n, PetscInt i, PetscInt j)
{
  if (i == NOWHERE || j == NOWHERE) return PetscMax(i, j);
  if (i == j) return i;
  return PetscAbsInt(i - j) == 1 ? PetscMin(i, j) : n - 1; /* across the period */
}

/* Cells as wide as bodies that move may be apart in a list of pairs, or wider where there would be many more of them
   than bodies; an even number along a period: blocks of one colour must not meet across it. The contact shall know
   ghosts as far as blocks of own bodies reach. Collective. */
static PetscErrorCode choose_cells(Pack *p)
{
  Contact   c    = p->c;
  PetscReal wide = 0, total = PETSC_MAX_REAL, sum = 0, length[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->kinds.n; i++)
    if (c->kinds.kind[i].moves) wide = PetscMax(wide, c->kinds.kind[i].radius);
  PetscCall(BodiesMax(c->bodies, 1, &wide));
  for (PetscInt a = 0; a < c->dim; a++) length[a] = c->domain.upper[a] - c->domain.lower[a];
  for (wide = c->horizon + 2 * (1 + CONTACT_SKIN) * wide; total > MAX_CELLS(c->s->nall); wide *= 2) {
    total = 1;
    for (PetscInt a = 0; a < 3; a++) total *= PetscMax(1, PetscFloorReal(length[a] / wide));
    for (PetscInt a = 0; a < 3 && total <= MAX_CELLS(c->s->nall); a++)
      p->ncells[a] = (PetscInt)PetscMax(1, PetscFloorReal(length[a] / wide));
  }
  for (PetscInt a = 0; a < 3; a++) {
    if (c->domain.period[a] > 0 && p->ncells[a] > 1) p->ncells[a] -= p->ncells[a] % 2;
    sum += PetscSqr(2 * length[a] / p->ncells[a]);
  }
  c->list.halo = PetscSqrtReal(sum);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The cells of all bodies that move, [n][3]; low: at most the lowest along the axes, even; count: how many of each
   parity */
static void find_cells(const Pack *p, PetscInt (*cell)[3], PetscInt low[3], PetscInt bins[3])
{
  const Contact c       = p->c;
  PetscInt      high[3] = {0, 0, 0};

  for (PetscInt a = 0; a < 3; a++) {
    const PetscReal inverse = a < c->dim ? p->ncells[a] / (c->domain.upper[a] - c->domain.lower[a]) : 0;

    low[a] = p->ncells[a] - 1;
    for (PetscInt k = 0; k < c->s->n; k++) {
      const PetscReal at = inverse *
                           (DomainWrap(c->domain.period[a], c->x[k][a], c->domain.lower[a]) - c->domain.lower[a]);

      cell[k][a] = p->inverse_mass[k] > 0 ? (PetscInt)PetscMax(0, PetscMin(p->ncells[a] - 1, at)) : NOWHERE;
      if (cell[k][a] == NOWHERE) continue;
      low[a]  = PetscMin(low[a], cell[k][a]);
      high[a] = PetscMax(high[a], cell[k][a]);
    }
    low[a] -= low[a] % 2;
    bins[a] = PetscMax(0, high[a] - low[a]) / 2 + 1;
  }
}

/* Pairs by the colours of their blocks, then by blocks, then as they were; without those of blocks that have no own
   bodies */
static PetscErrorCode order_pairs(Pack *p)
{
  Contact    c = p->c;
  Pair      *pair;
  PetscInt   low[3], bins[3], ncolours = 1 << c->dim, size, n = 0, (*cell)[3], *start, *at;
  PetscBool *mine;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(c->s->n, &cell, c->list.n, &at, c->list.n, &pair));
  find_cells(p, cell, low, bins);
  size = bins[0] * bins[1] * bins[2];
  PetscCall(PetscCalloc2(ncolours * size + 1, &start, ncolours * size, &mine));
  for (PetscInt k = 0; k < c->list.n; k++) {
    const Pair *now    = &c->list.pair[k];
    PetscInt    colour = 0, bin = 0;

    for (PetscInt a = 2; a >= 0; a--) {
      const PetscInt low_cell = lowest_cell(p->ncells[a], cell[now->i][a], cell[now->j][a]);

      colour += low_cell % 2 << a;
      bin = bin * bins[a] + (low_cell - low[a]) / 2;
    }
    at[k]       = colour * size + bin;
    mine[at[k]] = (PetscBool)(mine[at[k]] || c->s->own[now->i] || c->s->own[now->j]);
    start[at[k] + 1]++;
  }
  for (PetscInt i = 0; i < ncolours * size; i++) { /* counts become first places */
    if (i % size == 0) p->colour[i / size] = n;
    n += mine[i] ? start[i + 1] : 0;
    start[i + 1] = n;
  }
  p->colour[ncolours] = n;
  for (PetscInt k = 0; k < c->list.n; k++)
    if (mine[at[k]]) pair[start[at[k]]++] = c->list.pair[k];
  c->list.n = n;
  PetscCall(PetscArraycpy(c->list.pair, pair, n));
  PetscCall(PetscFree3(cell, at, pair));
  PetscCall(PetscFree2(start, mine));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The list of pairs for where the bodies are now; what was known of the gaps is forgotten with the old one.
   Collective. */
static PetscErrorCode renew_list(Pack *p)
{
  Contact c = p->c;

  PetscFunctionBeginUser;
  PetscCall(ContactFindPairs(c));
  if (c->count.lists == p->lists) PetscFunctionReturn(PETSC_SUCCESS); /* it was still good */
  p->lists = c->count.lists;
  PetscCall(order_pairs(p));
  PetscCall(ArrayReserve(c->list.n, &p->capacity, &p->bound, sizeof(*p->bound), &p->mark, sizeof(*p->mark), NULL));
  for (PetscInt n = 0; n < c->list.n; n++) p->bound[n] = -PETSC_MAX_REAL;
  for (PetscInt n = 0; n < c->list.n; n++) p->mark[n] = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- sweeps ---- */

static void note_gap(Pack *p, PetscReal gap, PetscReal margin)
{
  p->worst = PetscMax(p->worst, margin - gap);
}

static PetscErrorCode sweep_pairs(Pack *p, PetscInt first, PetscInt end, PetscBool moving)
{
  Contact c = p->c;
  Touch   t;

  PetscFunctionBeginUser;
  for (PetscInt n = first; n < end; n++) {
    const PetscInt  i = c->list.pair[n].i, j = c->list.pair[n].j;
    const PetscReal margin = PackMargin(p, i, j), travel = p->travelled[i] + p->travelled[j];

    if (p->bound[n] - (travel - p->mark[n]) >= margin + p->slack) continue; /* not nearer since */
    PetscCall(PackLookAtPair(p, i, j, &t));
    p->bound[n] = PetscMin(t.gap, c->horizon);
    p->mark[n]  = travel;
    note_gap(p, t.gap, margin);
    if (moving && t.gap < margin + p->slack) separate_pair(p, i, j, &t, margin + p->slack - t.gap);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode sweep_faces(Pack *p, PetscBool moving)
{
  Contact c = p->c;
  Touch   t;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal margin = PackMargin(p, k, -1);

    for (PetscInt face = 0; face < 2 * c->dim && PackingOf(p, k)->wanted; face++) {
      PetscCall(PackLookAtFace(p, k, face, &t));
      if (t.gap >= PETSC_MAX_REAL) continue;
      note_gap(p, t.gap, margin);
      if (moving && t.gap < margin + p->slack) separate_pair(p, k, -1, &t, margin + p->slack - t.gap);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Ghosts are where their owners are. Collective. */
static PetscErrorCode update_ghosts(Pack *p)
{
  Contact         c    = p->c;
  const PetscBool flat = (PetscBool)(c->dim == 2);

  PetscFunctionBeginUser;
  if (BodiesComm(c->bodies) == PETSC_COMM_SELF) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < c->s->n; k++) {
    for (PetscInt a = 0; a < 3; a++) p->of_owner[k][a] = a == 2 && flat ? c->s->angle[k] : c->x[k][a];
    p->of_owner[k][3] = p->travelled[k];
  }
  PetscCall(BodiesUpdateGhosts(c->bodies, 4, p->of_owner));
  if (!flat) PetscCall(BodiesUpdateGhosts(c->bodies, 4, c->q));
  for (PetscInt k = 0; k < c->s->n; k++) {
    if (c->s->own[k]) continue;
    for (PetscInt a = 0; a < c->dim; a++) c->x[k][a] = p->of_owner[k][a];
    p->travelled[k] = p->of_owner[k][3];
    if (!flat) continue;
    c->s->angle[k] = p->of_owner[k][2];
    RotationFromAngle(c->s->angle[k], c->q[k]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What gaps lack, after or without moving bodies apart. Collective. */
static PetscErrorCode sweep(Pack *p, PetscBool moving)
{
  PetscFunctionBeginUser;
  p->worst = -PETSC_MAX_REAL;
  PetscCall(renew_list(p));
  for (PetscInt i = 0; i < 1 << p->c->dim; i++) {
    PetscCall(sweep_pairs(p, p->colour[i], p->colour[i + 1], moving));
    if (moving) PetscCall(update_ghosts(p));
  }
  PetscCall(sweep_faces(p, moving));
  PetscCall(BodiesMax(p->c->bodies, 1, &p->worst));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sweeps until every gap is at least its margin, at most so many; *done tells whether it came to that, which only a
   sweep that moves nothing can. The slack is halved from time to time: near the densest packing there is no room
   for it. */
static PetscErrorCode relax(Pack *p, PetscInt max, PetscBool *done)
{
  PetscReal best  = PETSC_MAX_REAL;
  PetscInt  since = 0;

  PetscFunctionBeginUser;
  *done = PETSC_FALSE;
  for (PetscInt i = 1; i <= max && since < PATIENCE && !*done; i++, since++) {
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

/* All packed bodies at `size` times their own. Collective. */
static PetscErrorCode set_size(Pack *p, PetscReal size)
{
  PetscFunctionBeginUser;
  p->c->packed_size = size;
  p->c->list.valid  = PETSC_FALSE;
  PetscCall(ContactUpdateLocalBodies(p->c));
  PetscCall(choose_cells(p));
  p->size  = size;
  p->slack = SLACK * p->mean * size;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The size at which bounding circles fill a small fraction of the smallest box. Collective. */
static PetscErrorCode first_size(const Pack *p, PetscReal *size)
{
  const BodyArrays *s   = p->c->s;
  PetscReal         box = PETSC_MAX_REAL, filled;
  Exact             sum = {{0}, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++)
    if (PackingOf(p, k)->wanted && s->own[k])
      ExactAdd(&sum,
               (s->dim == 2 ? PETSC_PI : 4 * PETSC_PI / 3) * PetscPowRealInt(BodiesGetRadius(p->c->state, k), s->dim));
  PetscCall(ExactGetSum(BodiesComm(p->c->bodies), &sum, &filled));
  for (PetscInt g = 0; g < s->ngroups; g++)
    if (s->group[g].pack.wanted) box = PetscMin(box, box_of(&s->group[g], s->dim));
  *size = PetscMin(1, PetscPowReal((s->dim == 2 ? START : START / 3) * box / filled, 1. / s->dim));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* They do not fit: say what they would fill, shrunk until they do. Collective. */
static PetscErrorCode refuse_packing(Pack *p)
{
  const BodyArrays *s     = p->c->s;
  const PetscReal   worst = p->worst;
  PetscReal         fill;
  PetscInt          g    = 0;
  PetscBool         done = PETSC_FALSE;

  PetscFunctionBeginUser;
  while (!s->group[g].pack.wanted) g++;
  PetscCall(find_fill(p->c->bodies, g, &fill));
  p->fine = PETSC_FALSE;
  for (PetscReal size = 1 / SHRINK; size > 0.2 && !done; size /= SHRINK) {
    PetscCall(set_size(p, size));
    PetscCall(relax(p, SLACK_SWEEPS, &done));
  }
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
          "Bodies cannot be packed: group '%s' is to fill %.3g of its box, about %.2g is within reach (overlaps of %.2g were left at full size). Lower "
          "-particle_%s_fraction, _count or _margin, or widen -particle_%s_lower .. _upper",
          s->group[g].name, (double)fill, (double)(fill * PetscPowRealInt(p->size, s->dim)), (double)worst,
          s->group[g].name, s->group[g].name);
}

static PetscErrorCode grow(Pack *p)
{
  PetscReal first = 1;
  PetscBool done;

  PetscFunctionBeginUser;
  p->round = PETSC_TRUE;
  PetscCall(first_size(p, &first));
  for (PetscReal size = first; size < 1; size *= GROWTH) {
    PetscCall(set_size(p, size));
    PetscCall(relax(p, p->round ? MAX_SWEEPS : STAGE_SWEEPS, &done));
    p->round = PETSC_FALSE;
  }
  PetscCall(set_size(p, 1));
  PetscCall(relax(p, MAX_SWEEPS, &done));
  if (!done) PetscCall(refuse_packing(p));
  p->fine          = PETSC_TRUE;
  p->c->list.valid = PETSC_FALSE;
  PetscCall(relax(p, MAX_SWEEPS, &done));
  if (!done) PetscCall(refuse_packing(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- from and to the scene ---- */

static PetscErrorCode set_weights(Pack *p)
{
  Contact   c = p->c;
  PetscReal inertia[6];
  PetscInt  n   = 0;
  Exact     sum = {{0}, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    if (!PackingOf(p, k)->wanted) continue;
    if (c->s->own[k]) ExactAdd(&sum, BodiesGetRadius(c->state, k));
    p->inverse_mass[k] = 1 / BodiesVolume(c->state, k);
    if (!PackingOf(p, k)->turns || ContactKind(c, k)->disc > 0) continue;
    PetscCall(BodiesGetInertia(c->bodies, k, NULL, PETSC_TRUE, inertia));
    p->inverse_moment[k] = c->dim == 2 ? 1 / inertia[2] : 3 / (inertia[0] + inertia[1] + inertia[2]);
  }
  for (PetscInt g = 0; g < c->s->ngroups; g++) n += c->s->group[g].pack.wanted ? c->s->group[g].count : 0;
  PetscCall(ExactGetSum(BodiesComm(c->bodies), &sum, &p->mean));
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
      const PetscBool open = (PetscBool)(c->domain.period[a] > 0 &&
                                         b->upper[a] - b->lower[a] > c->domain.period[a] * (1 - 1e-9));

      p->lower[g][a] = open ? PETSC_MIN_REAL : b->lower[a];
      p->upper[g][a] = open ? PETSC_MAX_REAL : b->upper[a];
    }
}

static PetscErrorCode store_positions(Pack *p)
{
  Contact c = p->c;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal x[3];

    if (!PackingOf(p, k)->wanted) continue;
    for (PetscInt a = 0; a < 3; a++) x[a] = DomainWrap(c->domain.period[a], c->x[k][a], c->domain.lower[a]);
    PetscCall(BodiesSetInitialPositions(c->bodies, k, x, c->q[k], c->s->angle[k]));
  }
  PetscCall(BodiesGatherStarts(c->bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode pack_bodies(Pack *p)
{
  Contact        c = p->c;
  const PetscInt m = c->s->ngroups;

  PetscFunctionBeginUser;
  PetscCall(BodiesAttach(c->bodies, sizeof(PetscReal), (void **)&p->inverse_mass));
  PetscCall(BodiesAttach(c->bodies, sizeof(PetscReal), (void **)&p->inverse_moment));
  PetscCall(BodiesAttach(c->bodies, sizeof(PetscReal), (void **)&p->travelled));
  PetscCall(BodiesAttachWork(c->bodies, sizeof(*p->of_owner), (void **)&p->of_owner));
  PetscCall(PetscCalloc2(m, &p->lower, m, &p->upper));
  PetscCall(set_weights(p));
  set_faces(p);
  c->range = c->horizon = LOOK * p->mean;
  for (PetscInt g = 0; g < m; g++) c->horizon = PetscMax(c->horizon, c->s->group[g].pack.margin + LOOK * p->mean);
  PetscCall(ContactCreatePoints(c, POINTS(c->dim)));
  c->alone = PETSC_TRUE; /* bodies go to their owners when a list is made */
  PetscCall(grow(p));
  PetscCall(store_positions(p));
  PetscCall(PetscFree2(p->lower, p->upper));
  PetscCall(BodiesDetach(c->bodies, (void **)&p->inverse_mass));
  PetscCall(BodiesDetach(c->bodies, (void **)&p->inverse_moment));
  PetscCall(BodiesDetach(c->bodies, (void **)&p->travelled));
  PetscCall(BodiesDetach(c->bodies, (void **)&p->of_owner));
  PetscCall(PetscFree(p->bound));
  PetscCall(PetscFree(p->mark));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactPack(Bodies bodies, const PetscReal lower[3], const PetscReal upper[3], const PetscReal period[3],
                           ContactPacking *result)
{
  Pack           p = {0};
  PetscLogDouble begin, end;
  BodyState     *s;

  PetscFunctionBeginUser;
  *result = (ContactPacking){0};
  PetscCall(BodiesGetState(bodies, &s));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscReal fill;

    if (!s->group[g].pack.wanted) continue;
    PetscCall(find_fill(bodies, g, &fill));
    result->fraction += fill;
    result->bodies += s->group[g].count;
  }
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
