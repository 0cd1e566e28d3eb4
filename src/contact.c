/* Contact: repulsion between bodies and from the walls of the domain box, see contact.h for the law.

   Geometry. Disc-disc and disc-wall in closed form. Any other pair: surface points of each body against the signed distance of the other,
   both ways; wall: surface points against the plane. The force acts through all points within reach, with weights that fall off as
   exp(-(gap - smallest gap)/(r/4)) and add up to one. The single deepest point would jump along a flat side and chatter in torque; a plain sum
   over points would make the force depend on how many there are. This way the force is that of two discs, wherever it acts.

   Stiffness. A body of effective mass m = (rho_s + C rho_f) Vol (C = 1 in 2D, 1/2 in 3D: added mass of a disc, a sphere) that arrives with speed u_ref is
   to stop without overlap: K = 1.5 m u_ref^2/r, because the work of the law over its range is K r/3. u_ref is the terminal speed
   sqrt(2 Vol/A |rho_s/rho_f - 1| |g|) (drag coefficient 1; disc: Vol/A = pi d/4, sphere 2 d/3, with d twice the bounding radius), or the fastest
   present body if that is faster. Without gravity or difference of density nothing but the motion gives a scale: then also
   sqrt(8 r a/3) with a the largest frozen acceleration (so that K >= 4 m a) and 0.01 r/dt. No history enters: a restart gives the same forces.
   A pair takes the larger K; bodies that cannot move do not count. s = 1/2 makes the slope of the law continuous at gap 0.

   Time. ContactStep integrates the bodies that can come within range by symplectic Euler. Three additions make a body come to rest although
   the flow answers only once a step (measured with bodies under linear drag in the unit test; values are not critical):
   - damping (Hunt & Crossley 1975): force times (1 + v/(0.1 u_ref)), v the speed of approach, never attractive. It takes the energy out
     and vanishes with the speed, so that the resting gap is that of the law;
   - drag: the frozen acceleration belongs to the old velocity. While contact changes the velocity by du, the acceleration changes by -lambda du
     with lambda from (buoyant acceleration - a) = lambda u, where that is a resistance. Without it bodies slower than u_ref/5 overlap
     when the step exceeds their relaxation time;
   - look-ahead: two steps are integrated, and each pair takes the larger of the means over one and over two steps (divided by 1 and 2 steps).
     A second-order scheme (bdf2) gives only 2/3 of a sudden impulse in its first step; without look-ahead bodies overlap at u dt > r.
   Measured for one disc, densities 0.001 to 10, be and bdf2, true added mass 1 to 1.5: smallest gap 0.37 r up to u dt = 2 r (that is h, CFL number 1). At rest
   the position is steady to round-off in most cases; where drag rules (step beyond the relaxation time) it may wander in a bounded cycle of up to
   0.2 r at u dt = r, 1.5 r at 2 r. Stable while the true effective mass is above 3/4 of ours. Limit: bodies without buoyancy that a very viscous flow
   presses together (step 10 relaxation times) overlap by some r before the force has grown. Knows no friction, no sub-grid lubrication. Work: cell list, then pairs. Replicated on all ranks, not parallel yet. */
#include "compat.h"
#include "cells.h"
#include "contact.h"
#include "opt.h"
#include "rotation.h"

#define OVERLAP_SCALE 0.5  /* s of the law */
#define DAMPING_SPEED 0.1  /* in u_ref */
#define POINT_DECAY   0.25 /* in r */
#define STEP_FACTOR   0.1  /* sub-step in sqrt(m r/(2 K)) */
#define LIMIT_FACTOR  0.4  /* longest sub-step that -contact_substeps may ask for */
#define SPEED_FLOOR   0.01 /* in r/dt */
#define REST_SPEED    0.01 /* in r/dt: slower bodies feel no drag */
#define LOOKAHEAD     2    /* steps */
#define MAX_POINTS    1024 /* surface points of a shape */

enum {
  LAW_REPULSIVE,
  LAW_NONE
};
static const char *const law_names[] = {"repulsive", "none", NULL};

/* A point where two bodies (or a body and a wall) meet. */
typedef struct {
  PetscReal gap, weight;
  PetscReal x[3];      /* where the force acts */
  PetscReal normal[3]; /* from the partner towards body i */
} Touch;

/* Force on body i over some time, its torque on i, and the torque on j; the force on j is the opposite. */
typedef struct {
  PetscReal f[3], ti[3], tj[3];
} Impulse;

typedef struct {
  PetscInt i, j;   /* j = -1 - face for a wall */
  Impulse  sum[2]; /* over one step, over LOOKAHEAD steps */
} Pair;

/* A body during the sub-steps. */
typedef struct {
  PetscReal x[3], q[4], u[3], w[3];
  PetscReal u0[3], w0[3];
  PetscReal inverse_mass[3], inverse_inertia[6]; /* zero where not free; space axes */
  PetscReal a[3], alpha[3], drag;
  PetscReal stiffness, speed; /* K and u_ref */
  PetscReal reach;
  PetscInt  active;
} Mover;

typedef struct {
  PetscInt   n;
  PetscReal *x; /* [n][dim] surface points about the centroid, body frame */
} Points;

struct _p_Contact {
  Bodies     bodies;
  BodyState *s;
  PetscInt   law, substeps, walls, dim;
  PetscReal  h, range, multiple, rho_f, g[3], lower[3], upper[3];
  Points    *points;       /* [ngroups] */
  PetscReal *terminal;     /* [ngroups] u_ref from gravity */
  PetscReal  extra, floor; /* u_ref from the present motion: for all bodies, for bodies without buoyancy */
  Mover     *mover;        /* [n] */
  Pair      *pair;
  PetscInt   npairs, pair_room, tests, steps_done;
  Touch      touch[2 * MAX_POINTS];
};

/* ---- small tools ---- */

static PetscReal dot(const PetscReal a[3], const PetscReal b[3])
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const PetscReal a[3], const PetscReal b[3], PetscReal c[3])
{
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

static void apply_tensor(const PetscReal t[6], const PetscReal v[3], PetscReal tv[3])
{
  tv[0] = t[0] * v[0] + t[3] * v[1] + t[4] * v[2];
  tv[1] = t[3] * v[0] + t[1] * v[1] + t[5] * v[2];
  tv[2] = t[4] * v[0] + t[5] * v[1] + t[2] * v[2];
}

static void invert_tensor(const PetscReal t[6], PetscReal inv[6])
{
  const PetscReal xx = t[1] * t[2] - t[5] * t[5], xy = t[4] * t[5] - t[3] * t[2], xz = t[3] * t[5] - t[1] * t[4];
  const PetscReal det = t[0] * xx + t[3] * xy + t[4] * xz;

  inv[0] = xx / det;
  inv[1] = (t[0] * t[2] - t[4] * t[4]) / det;
  inv[2] = (t[0] * t[1] - t[3] * t[3]) / det;
  inv[3] = xy / det;
  inv[4] = xz / det;
  inv[5] = (t[3] * t[4] - t[0] * t[5]) / det;
}

/* The law without K: 0 beyond the range, 1 at gap 0. */
static PetscReal law_value(Contact c, PetscReal gap)
{
  if (gap >= c->range) return 0;
  return gap >= 0 ? PetscSqr(1 - gap / c->range) : 1 - gap / (OVERLAP_SCALE * c->range);
}

static const BodyGroup *group_of(Contact c, PetscInt k)
{
  return &c->s->group[c->s->body_group[k]];
}

static PetscBool can_move(const BodyGroup *g)
{
  return g->free ? PETSC_TRUE : PETSC_FALSE;
}

static PetscReal effective_mass(Contact c, const BodyGroup *g)
{
  return (g->density + (c->dim == 2 ? 1 : 0.5) * c->rho_f) * g->mass.volume;
}

/* ---- scales ---- */

static void set_stiffness(Contact c, PetscInt k, PetscReal *K, PetscReal *speed)
{
  const BodyGroup *g   = group_of(c, k);
  const PetscReal  own = c->terminal[c->s->body_group[k]];

  *speed = PetscMax(own, c->extra);
  if (own <= 0) *speed = PetscMax(*speed, c->floor);
  *K = can_move(g) ? c->multiple * 1.5 * effective_mass(c, g) * PetscSqr(*speed) / c->range : 0;
}

/* The fastest point of any body, now. */
static PetscReal fastest(Contact c)
{
  const BodyState *s   = c->s;
  PetscReal        top = 0;

  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g    = group_of(c, k);
    const PetscReal  spin = g->disc > 0 ? 0 : g->radius * PetscSqrtReal(dot(s->w[k], s->w[k]));

    top = PetscMax(top, PetscSqrtReal(dot(s->u[k], s->u[k])) + spin);
  }
  return top;
}

static void set_scales(Contact c, PetscReal dt, PetscReal (*a)[3])
{
  PetscReal push = 0;

  c->extra = fastest(c);
  for (PetscInt k = 0; a && k < c->s->n; k++)
    if (can_move(group_of(c, k))) push = PetscMax(push, dot(a[k], a[k]));
  if (dt > 0) c->floor = PetscMax(SPEED_FLOOR * c->range / dt, PetscSqrtReal(8. / 3. * c->range * PetscSqrtReal(push)));
}

/* ---- pairs ---- */

static PetscErrorCode add_pair(Contact c, PetscInt i, PetscInt j)
{
  PetscFunctionBeginUser;
  if (c->npairs == c->pair_room) {
    c->pair_room = 2 * c->pair_room + 64;
    PetscCall(PetscRealloc(c->pair_room * sizeof(Pair), &c->pair));
  }
  PetscCall(PetscMemzero(&c->pair[c->npairs], sizeof(Pair)));
  c->pair[c->npairs].i   = i;
  c->pair[c->npairs++].j = j;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode test_pair(void *ctx, PetscInt i, PetscInt j)
{
  Contact         c  = (Contact)ctx;
  const Mover    *mi = &c->mover[i], *mj = &c->mover[j];
  const PetscReal reach = group_of(c, i)->radius + group_of(c, j)->radius + c->range + mi->reach + mj->reach;
  PetscReal       d2    = 0;

  PetscFunctionBeginUser;
  c->tests++;
  if (!can_move(group_of(c, i)) && !can_move(group_of(c, j))) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < c->dim; a++) d2 += PetscSqr(mi->x[a] - mj->x[a]);
  if (d2 < reach * reach) PetscCall(add_pair(c, i, j));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_walls(Contact c, PetscInt k)
{
  const Mover    *m     = &c->mover[k];
  const PetscReal reach = group_of(c, k)->radius + c->range + m->reach;

  PetscFunctionBeginUser;
  if (!can_move(group_of(c, k))) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt face = 0; face < 2 * c->dim; face++) {
    const PetscInt  a = face / 2;
    const PetscReal d = face % 2 ? c->upper[a] - m->x[a] : m->x[a] - c->lower[a];

    if ((c->walls >> face & 1) && d < reach) PetscCall(add_pair(c, k, -1 - face));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal half_width(Contact c, PetscInt k)
{
  return group_of(c, k)->radius + 0.5 * c->range + c->mover[k].reach;
}

static PetscReal count_entries(Contact c, PetscReal size)
{
  PetscReal sum = 0;

  for (PetscInt k = 0; k < c->s->n; k++) sum += PetscPowRealInt(1 + 2 * half_width(c, k) / size, c->dim);
  return sum;
}

/* Cells as wide as the smallest box, unless large bodies would then fill too many of them. */
static PetscReal choose_cell_size(Contact c)
{
  const PetscReal room = (c->dim == 2 ? 8. : 20.) * c->s->n;
  PetscReal       size = PETSC_MAX_REAL;

  for (PetscInt k = 0; k < c->s->n; k++) size = PetscMin(size, 2 * half_width(c, k));
  while (count_entries(c, size) > room) size *= 2;
  return size;
}

/* All pairs that can come within range, from x and reach of the movers. */
static PetscErrorCode find_pairs(Contact c)
{
  const PetscInt n = c->s->n;
  Cells          cells;

  PetscFunctionBeginUser;
  c->npairs = c->tests = 0;
  if (!n || c->law == LAW_NONE) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CellsCreate(c->dim, c->lower, c->upper, choose_cell_size(c), 4 * n + 64, &cells));
  for (PetscInt k = 0; k < n; k++) {
    PetscCall(CellsInsert(cells, k, c->mover[k].x, half_width(c, k)));
    PetscCall(find_walls(c, k));
  }
  PetscCall(CellsForPairs(cells, test_pair, c));
  PetscCall(CellsDestroy(&cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- geometry ---- */

static PetscInt touch_discs(Contact c, const Mover *mi, PetscReal ri, const Mover *mj, PetscReal rj, Touch *t)
{
  PetscReal d[3] = {0, 0, 0}, length;

  for (PetscInt a = 0; a < c->dim; a++) d[a] = mi->x[a] - mj->x[a];
  length = PetscSqrtReal(dot(d, d));
  t->gap = length - ri - rj;
  for (PetscInt a = 0; a < 3; a++) {
    t->normal[a] = length > 0 ? d[a] / length : (a == 0); /* same centre: any direction */
    t->x[a]      = mj->x[a] + (rj + 0.5 * t->gap) * t->normal[a];
  }
  return 1;
}

static PetscInt touch_disc_wall(Contact c, const Mover *m, PetscReal r, PetscInt face, Touch *t)
{
  const PetscInt  a    = face / 2;
  const PetscReal sign = face % 2 ? -1 : 1, wall = face % 2 ? c->upper[a] : c->lower[a];

  t->gap = sign * (m->x[a] - wall) - r;
  for (PetscInt b = 0; b < 3; b++) {
    t->normal[b] = b == a ? sign : 0;
    t->x[b]      = m->x[b] - r * t->normal[b];
  }
  return 1;
}

static void place_point(const Mover *m, const PetscReal R[9], PetscInt dim, const PetscReal p[], PetscReal x[3])
{
  for (PetscInt a = 0; a < 3; a++) x[a] = m->x[a] + R[3 * a] * p[0] + R[3 * a + 1] * p[1] + (dim == 3 ? R[3 * a + 2] * p[2] : 0);
}

static PetscInt touch_wall(Contact c, PetscInt i, PetscInt face, Touch t[])
{
  const Points   *pts  = &c->points[c->s->body_group[i]];
  const Mover    *m    = &c->mover[i];
  const PetscInt  a    = face / 2;
  const PetscReal sign = face % 2 ? -1 : 1, wall = face % 2 ? c->upper[a] : c->lower[a];
  PetscReal       R[9];

  RotationMatrix(m->q, R);
  for (PetscInt p = 0; p < pts->n; p++) {
    place_point(m, R, c->dim, pts->x + p * c->dim, t[p].x);
    t[p].gap = sign * (t[p].x[a] - wall);
    for (PetscInt b = 0; b < 3; b++) t[p].normal[b] = b == a ? sign : 0;
  }
  return pts->n;
}

/* Points of body `from` that are near body `to`, with gap and outward normal of `to`; sign -1 turns the normal round. */
static PetscErrorCode touch_points(Contact c, PetscInt from, PetscInt to, PetscReal sign, Touch t[], PetscInt *nt)
{
  const Points    *pts = &c->points[c->s->body_group[from]];
  const BodyGroup *g   = group_of(c, to);
  const Mover     *mf = &c->mover[from], *mt = &c->mover[to];
  PetscReal        Rf[9], Rt[9], y[MAX_POINTS * 3], d[MAX_POINTS], nrm[MAX_POINTS * 3];
  PetscInt         n = 0, kept = 0;

  PetscFunctionBeginUser;
  RotationMatrix(mf->q, Rf);
  RotationMatrix(mt->q, Rt);
  for (PetscInt p = 0; p < pts->n; p++) {
    PetscReal r[3];

    place_point(mf, Rf, c->dim, pts->x + p * c->dim, t[n].x);
    for (PetscInt a = 0; a < 3; a++) r[a] = a < c->dim ? t[n].x[a] - mt->x[a] : 0;
    if (dot(r, r) > PetscSqr(g->radius + c->range)) continue;
    for (PetscInt a = 0; a < c->dim; a++) y[n * c->dim + a] = Rt[a] * r[0] + Rt[3 + a] * r[1] + Rt[6 + a] * r[2] + g->mass.centroid[a];
    n++;
  }
  *nt = 0;
  if (!n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ShapeDistance(g->shape, n, y, d));
  for (PetscInt p = 0; p < n; p++) {
    if (d[p] >= c->range) continue;
    t[kept]     = t[p];
    t[kept].gap = d[p];
    for (PetscInt a = 0; a < c->dim; a++) y[kept * c->dim + a] = y[p * c->dim + a];
    kept++;
  }
  PetscCall(ShapeNormal(g->shape, kept, y, nrm));
  for (PetscInt p = 0; p < kept; p++)
    for (PetscInt a = 0; a < 3; a++) {
      t[p].normal[a] = 0;
      for (PetscInt b = 0; b < c->dim; b++) t[p].normal[a] += sign * Rt[3 * a + b] * nrm[p * c->dim + b];
    }
  *nt = kept;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Weights fall off from the deepest point and vanish at the range, so that a point comes into play without a jump. */
static void weigh(Contact c, PetscInt n, Touch t[], PetscReal *smallest)
{
  PetscReal sum = 0;

  *smallest = PETSC_MAX_REAL;
  for (PetscInt p = 0; p < n; p++) *smallest = PetscMin(*smallest, t[p].gap);
  if (*smallest >= c->range) return;
  for (PetscInt p = 0; p < n; p++) {
    t[p].weight = PetscMax(0, 1 - t[p].gap / c->range) * PetscExpReal(-(t[p].gap - *smallest) / (POINT_DECAY * c->range));
    sum += t[p].weight;
  }
  for (PetscInt p = 0; p < n; p++) t[p].weight /= sum;
}

/* All touching points of a pair, weights adding up to one, and its smallest gap (PETSC_MAX_REAL: none found). */
static PetscErrorCode find_touch(Contact c, PetscInt i, PetscInt j, PetscInt *n, PetscReal *gap)
{
  const BodyGroup *gi = group_of(c, i), *gj = j >= 0 ? group_of(c, j) : NULL;
  PetscInt         m = 0;

  PetscFunctionBeginUser;
  *n = 0;
  if (gj && gi->disc > 0 && gj->disc > 0) *n = touch_discs(c, &c->mover[i], gi->disc, &c->mover[j], gj->disc, c->touch);
  else if (!gj && gi->disc > 0) *n = touch_disc_wall(c, &c->mover[i], gi->disc, -1 - j, c->touch);
  else if (!gj) *n = touch_wall(c, i, -1 - j, c->touch);
  else {
    PetscReal d2 = 0;

    for (PetscInt a = 0; a < c->dim; a++) d2 += PetscSqr(c->mover[i].x[a] - c->mover[j].x[a]);
    if (d2 < PetscSqr(gi->radius + gj->radius + c->range)) {
      PetscCall(touch_points(c, i, j, 1, c->touch, n));
      PetscCall(touch_points(c, j, i, -1, c->touch + *n, &m));
      *n += m;
    }
  }
  weigh(c, *n, c->touch, gap);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- forces ---- */

static void add_force(Impulse *s, PetscReal scale, const PetscReal f[3], const PetscReal ri[3], const PetscReal rj[3])
{
  PetscReal ti[3], tj[3];

  cross(ri, f, ti);
  cross(f, rj, tj); /* the force on j is -f */
  for (PetscInt a = 0; a < 3; a++) {
    s->f[a] += scale * f[a];
    s->ti[a] += scale * ti[a];
    s->tj[a] += scale * tj[a];
  }
}

/* Inverse of the mass that body m opposes to a force along n at lever r. */
static PetscReal inverse_mass_along(const Mover *m, const PetscReal r[3], const PetscReal n[3])
{
  PetscReal rn[3], irn[3], sum = 0;

  cross(r, n, rn);
  apply_tensor(m->inverse_inertia, rn, irn);
  for (PetscInt a = 0; a < 3; a++) sum += m->inverse_mass[a] * n[a] * n[a];
  return sum + dot(rn, irn);
}

static PetscReal speed_along(const Mover *m, const PetscReal r[3], const PetscReal n[3])
{
  PetscReal wr[3];

  cross(m->w, r, wr);
  return dot(m->u, n) + dot(wr, n);
}

/* Force of the law times (1 + approach speed/damping speed), with the speed after the sub-step h (implicit, so that damping is stable). h = 0: the law alone. */
static PetscReal damp_force(PetscReal f, PetscReal damping, PetscReal h, PetscReal approach, PetscReal inverse_mass)
{
  const PetscReal rate = damping > 0 ? f / damping : 0;

  if (h <= 0) return f;
  return PetscMax(0, (f + rate * approach) / (1 + h * rate * inverse_mass));
}

/* Force and torques of pair p at the present place of its bodies. */
static PetscErrorCode evaluate_pair(Contact c, const Pair *p, PetscReal h, Impulse *sum, PetscReal *gap)
{
  const Mover *mi = &c->mover[p->i], *mj = p->j >= 0 ? &c->mover[p->j] : NULL;
  const Mover *hard = mj && mj->stiffness > mi->stiffness ? mj : mi;
  PetscInt     n;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(sum, sizeof(*sum)));
  PetscCall(find_touch(c, p->i, p->j, &n, gap));
  if (*gap >= c->range) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < n; k++) {
    const Touch *t = &c->touch[k];
    PetscReal    ri[3], rj[3] = {0, 0, 0}, f[3], approach, inverse;
    PetscReal    value = hard->stiffness * t->weight * law_value(c, t->gap);

    if (value <= 0) continue;
    for (PetscInt a = 0; a < 3; a++) {
      ri[a] = a < c->dim ? t->x[a] - mi->x[a] : 0;
      if (mj) rj[a] = a < c->dim ? t->x[a] - mj->x[a] : 0;
    }
    approach = (mj ? speed_along(mj, rj, t->normal) : 0) - speed_along(mi, ri, t->normal);
    inverse  = inverse_mass_along(mi, ri, t->normal) + (mj ? inverse_mass_along(mj, rj, t->normal) : 0);
    value    = damp_force(value, DAMPING_SPEED * hard->speed, h, approach, inverse);
    for (PetscInt a = 0; a < 3; a++) f[a] = value * t->normal[a];
    add_force(sum, 1, f, ri, rj);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void scatter_impulse(const Pair *p, const Impulse *s, PetscReal scale, PetscReal (*force)[3], PetscReal (*torque)[3])
{
  for (PetscInt a = 0; a < 3; a++) {
    force[p->i][a] += scale * s->f[a];
    torque[p->i][a] += scale * s->ti[a];
    if (p->j < 0) continue;
    force[p->j][a] -= scale * s->f[a];
    torque[p->j][a] += scale * s->tj[a];
  }
}

static void note_gap(const Pair *p, PetscReal gap, PetscReal *all)
{
  all[p->i] = PetscMin(all[p->i], gap);
  if (p->j >= 0) all[p->j] = PetscMin(all[p->j], gap);
}

/* ---- sub-steps ---- */

/* A tenth of the fluid's inertia turns with the body: keeps very light bodies from spinning up within a sub-step. */
static PetscErrorCode effective_inertia(Contact c, PetscInt k, PetscReal inertia[6])
{
  PetscFunctionBeginUser;
  PetscCall(BodiesGetInertia(c->bodies, k, PETSC_TRUE, inertia));
  for (PetscInt i = 0; i < 6; i++) inertia[i] *= group_of(c, k)->density + 0.1 * c->rho_f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_inverses(Contact c, PetscInt k)
{
  const BodyGroup *g = group_of(c, k);
  Mover           *m = &c->mover[k];
  PetscReal        inertia[6];

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(m->inverse_mass, 3));
  PetscCall(PetscArrayzero(m->inverse_inertia, 6));
  for (PetscInt a = 0; a < c->dim; a++)
    if (g->free & (BODY_FREE_X << a)) m->inverse_mass[a] = 1 / effective_mass(c, g);
  if (!(g->free & BODY_FREE_ROTATION)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(effective_inertia(c, k, inertia));
  if (c->dim == 2) m->inverse_inertia[2] = 1 / inertia[2];
  else invert_tensor(inertia, m->inverse_inertia);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* lambda with (buoyant acceleration - a) = lambda u, 0 where a is no resistance; bodies all but at rest have none */
static PetscReal estimate_drag(Contact c, PetscInt k, PetscReal dt, const PetscReal a[3])
{
  const BodyGroup *g    = group_of(c, k);
  const PetscReal *u    = c->s->u[k];
  const PetscReal  rest = REST_SPEED * c->range / dt;
  PetscReal        sum  = 0;

  for (PetscInt b = 0; b < c->dim; b++)
    if (g->free & (BODY_FREE_X << b)) sum += ((g->density - c->rho_f) * g->mass.volume * c->g[b] / effective_mass(c, g) - a[b]) * u[b];
  return PetscMax(0, sum) / (dot(u, u) + rest * rest);
}

static PetscErrorCode start_movers(Contact c, PetscReal dt, PetscReal (*a)[3], PetscReal (*alpha)[3])
{
  const BodyState *s    = c->s;
  const PetscReal  time = LOOKAHEAD * dt;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g = group_of(c, k);
    Mover           *m = &c->mover[k];

    PetscCall(PetscArraycpy(m->x, s->x[k], 3));
    PetscCall(PetscArraycpy(m->q, s->q[k], 4));
    for (PetscInt b = 0; b < 3; b++) {
      const PetscBool moves = g->free & (BODY_FREE_X << b) ? PETSC_TRUE : PETSC_FALSE,
                      turns = (g->free & BODY_FREE_ROTATION) && (c->dim == 3 || b == 2) ? PETSC_TRUE : PETSC_FALSE;

      m->u[b] = m->u0[b] = s->u[k][b];
      m->w[b] = m->w0[b] = s->w[k][b];
      m->a[b]            = moves ? a[k][b] : 0;
      m->alpha[b]        = turns ? alpha[k][b] : 0;
    }
    m->drag   = estimate_drag(c, k, dt, m->a);
    m->active = 0;
    m->reach  = (PetscSqrtReal(dot(m->u, m->u)) + 0.5 * PetscSqrtReal(dot(m->a, m->a)) * time) * time + 0.5 * c->range;
    set_stiffness(c, k, &m->stiffness, &m->speed);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Only bodies of some pair take part in the sub-steps: list them. */
static PetscErrorCode list_active(Contact c, PetscInt *n, PetscInt active[])
{
  PetscFunctionBeginUser;
  *n = 0;
  for (PetscInt p = 0; p < c->npairs; p++)
    for (PetscInt side = 0; side < 2; side++) {
      const PetscInt k = side ? c->pair[p].j : c->pair[p].i;

      if (k < 0 || c->mover[k].active) continue;
      c->mover[k].active = 1;
      active[(*n)++]     = k;
      PetscCall(set_inverses(c, k));
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* min sqrt(m r/(2 K)) over the pairs, m the smaller mass */
static PetscReal contact_time(Contact c)
{
  PetscReal least = PETSC_MAX_REAL;

  for (PetscInt p = 0; p < c->npairs; p++) {
    const PetscInt i = c->pair[p].i, j = c->pair[p].j;
    PetscReal      K = c->mover[i].stiffness, m = can_move(group_of(c, i)) ? effective_mass(c, group_of(c, i)) : PETSC_MAX_REAL;

    if (j >= 0) {
      K = PetscMax(K, c->mover[j].stiffness);
      if (can_move(group_of(c, j))) m = PetscMin(m, effective_mass(c, group_of(c, j)));
    }
    if (K > 0) least = PetscMin(least, PetscSqrtReal(m * c->range / (2 * K)));
  }
  return least;
}

static PetscErrorCode choose_substeps(Contact c, PetscReal dt, PetscInt *n)
{
  const PetscReal time = contact_time(c), wanted = PetscCeilReal(dt / (STEP_FACTOR * time)), needed = PetscCeilReal(dt / (LIMIT_FACTOR * time));

  PetscFunctionBeginUser;
  PetscCheck(c->substeps == 0 || c->substeps >= needed, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_substeps %" PetscInt_FMT
             " is too small: the contact force changes within %g s, a step of %g s needs at least %g (%g for accuracy). Raise or remove -contact_substeps, or lower -sim_dt or -contact_stiffness",
             c->substeps, (double)time, (double)dt, (double)needed, (double)wanted);
  PetscCheck(c->substeps || wanted < 1e7, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "The contact force would need %g sub-steps (a step is %g s, the force changes within %g s): lower -sim_dt or -contact_stiffness",
             (double)wanted, (double)dt, (double)time);
  *n = c->substeps ? c->substeps : PetscMax(1, (PetscInt)wanted);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocity after the motion without contact. */
static void drift_velocity(Mover *m, PetscReal h)
{
  for (PetscInt a = 0; a < 3; a++) {
    /* implicit in the drag: du/dt = a - lambda (u - u0) */
    if (m->inverse_mass[a] > 0) m->u[a] = (m->u[a] + h * (m->a[a] + m->drag * m->u0[a])) / (1 + h * m->drag);
    m->w[a] += h * m->alpha[a];
  }
}

static void kick(Mover *m, PetscReal h, PetscReal sign, const PetscReal f[3], const PetscReal torque[3])
{
  PetscReal dw[3];

  apply_tensor(m->inverse_inertia, torque, dw);
  for (PetscInt a = 0; a < 3; a++) {
    m->u[a] += h * sign * f[a] * m->inverse_mass[a];
    m->w[a] += h * dw[a];
  }
}

static PetscErrorCode advance_substep(Contact c, PetscReal h, PetscInt nactive, const PetscInt active[], PetscBool in_step, PetscReal *gap_all)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < nactive; k++) drift_velocity(&c->mover[active[k]], h);
  for (PetscInt k = 0; k < c->npairs; k++) {
    Pair     *p = &c->pair[k];
    Impulse   now;
    PetscReal gap;

    PetscCall(evaluate_pair(c, p, h, &now, &gap));
    if (in_step) note_gap(p, gap, gap_all);
    if (gap >= c->range) continue;
    for (PetscInt a = 0; a < 3; a++)
      for (PetscInt w = in_step ? 0 : 1; w < 2; w++) {
        p->sum[w].f[a] += h * now.f[a];
        p->sum[w].ti[a] += h * now.ti[a];
        p->sum[w].tj[a] += h * now.tj[a];
      }
    kick(&c->mover[p->i], h, 1, now.f, now.ti);
    if (p->j >= 0) kick(&c->mover[p->j], h, -1, now.f, now.tj);
  }
  for (PetscInt k = 0; k < nactive; k++) {
    Mover *m = &c->mover[active[k]];

    for (PetscInt a = 0; a < c->dim; a++) m->x[a] += h * m->u[a];
    RotationAdvance(h, m->w, m->q);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The larger of the means over one step and over the look-ahead, pair by pair: as a whole, so that momentum stays conserved. */
static void store_means(Contact c, PetscReal dt)
{
  for (PetscInt k = 0; k < c->npairs; k++) {
    const Pair     *p  = &c->pair[k];
    const PetscReal f1 = dot(p->sum[0].f, p->sum[0].f), f2 = dot(p->sum[1].f, p->sum[1].f) / PetscSqr(LOOKAHEAD);
    const PetscInt  w = f2 > f1;

    scatter_impulse(p, &p->sum[w], 1 / (w ? LOOKAHEAD * dt : dt), c->s->contact_force, c->s->contact_torque);
  }
}

PetscErrorCode ContactStep(Contact c, PetscReal dt, PetscReal (*a)[3], PetscReal (*alpha)[3])
{
  BodyState *s = c->s;
  PetscInt  *active, nactive, n;

  PetscFunctionBeginUser;
  PetscCheck(dt > 0, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Time step %g of the contact must be positive", (double)dt);
  for (PetscInt k = 0; k < s->n; k++) {
    s->gap[k] = PETSC_MAX_REAL;
    for (PetscInt b = 0; b < 3; b++) s->contact_force[k][b] = s->contact_torque[k][b] = 0;
  }
  c->steps_done = 0;
  set_scales(c, dt, a);
  PetscCall(start_movers(c, dt, a, alpha));
  PetscCall(find_pairs(c));
  if (!c->npairs) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(s->n, &active));
  PetscCall(list_active(c, &nactive, active));
  PetscCall(choose_substeps(c, dt, &n));
  for (PetscInt i = 0; i < LOOKAHEAD * n; i++) PetscCall(advance_substep(c, dt / n, nactive, active, i < n ? PETSC_TRUE : PETSC_FALSE, s->gap));
  c->steps_done = n;
  store_means(c, dt);
  PetscCall(PetscFree(active));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactEvaluate(Contact c, PetscReal (*x)[3], PetscReal (*q)[4], PetscReal (*force)[3], PetscReal (*torque)[3], PetscReal *gap)
{
  PetscFunctionBeginUser;
  set_scales(c, 0, NULL);
  for (PetscInt k = 0; k < c->s->n; k++) {
    Mover *m = &c->mover[k];

    PetscCall(PetscMemzero(m, sizeof(*m)));
    PetscCall(PetscArraycpy(m->x, x[k], 3));
    PetscCall(PetscArraycpy(m->q, q[k], 4));
    set_stiffness(c, k, &m->stiffness, &m->speed);
    gap[k] = PETSC_MAX_REAL;
    for (PetscInt a = 0; a < 3; a++) force[k][a] = torque[k][a] = 0;
  }
  PetscCall(find_pairs(c));
  for (PetscInt p = 0; p < c->npairs; p++) {
    Impulse   now;
    PetscReal g;

    PetscCall(evaluate_pair(c, &c->pair[p], 0, &now, &g));
    note_gap(&c->pair[p], g, gap);
    scatter_impulse(&c->pair[p], &now, 1, force, torque);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- questions ---- */

PetscErrorCode ContactGetMass(Contact c, PetscInt k, PetscReal *mass, PetscReal inertia[6])
{
  PetscFunctionBeginUser;
  PetscCheck(k >= 0 && k < c->s->n, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Body %" PetscInt_FMT " does not exist: there are %" PetscInt_FMT, k,
             c->s->n);
  *mass = effective_mass(c, group_of(c, k));
  if (inertia) PetscCall(effective_inertia(c, k, inertia));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetWork(Contact c, PetscInt *tests, PetscInt *pairs, PetscInt *substeps)
{
  PetscFunctionBeginUser;
  if (tests) *tests = c->tests;
  if (pairs) *pairs = c->npairs;
  if (substeps) *substeps = c->steps_done;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactView(Contact c, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer, "contact: law %s, range %g, stiffness x %g, walls%s%s%s%s%s%s%s\n", law_names[c->law], (double)c->range,
                                   (double)c->multiple, c->walls & 1 ? " x-" : "", c->walls & 2 ? " x+" : "", c->walls & 4 ? " y-" : "",
                                   c->walls & 8 ? " y+" : "", c->walls & 16 ? " z-" : "", c->walls & 32 ? " z+" : "", c->walls ? "" : " none"));
  for (PetscInt g = 0; g < c->s->ngroups; g++)
    PetscCall(PetscViewerASCIIPrintf(viewer, "  group %s: terminal speed scale %g, %" PetscInt_FMT " surface points\n", c->s->group[g].name,
                                     (double)c->terminal[g], c->points[g].n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- creation ---- */

/* Points about one range apart, at least 32. */
static PetscErrorCode create_points(Contact c, const BodyGroup *g, Points *pts)
{
  PetscReal *x, *w, area = 0, wanted;

  PetscFunctionBeginUser;
  if (g->disc > 0) {
    /* needed only against bodies that are no discs */
    area = c->dim == 2 ? 2 * PETSC_PI * g->disc : 4 * PETSC_PI * PetscSqr(g->disc);
  } else {
    PetscCall(PetscMalloc2(64 * c->dim, &x, 64, &w));
    PetscCall(ShapeSurface(g->shape, 64, x, w));
    for (PetscInt p = 0; p < 64; p++) area += w[p];
    PetscCall(PetscFree2(x, w));
  }
  wanted = area / PetscPowRealInt(c->range, c->dim - 1);
  pts->n = (PetscInt)PetscMin(MAX_POINTS, PetscMax(32, PetscCeilReal(wanted)));
  PetscCall(PetscMalloc1(pts->n * c->dim, &pts->x));
  PetscCall(PetscMalloc1(pts->n, &w));
  PetscCall(ShapeSurface(g->shape, pts->n, pts->x, w));
  for (PetscInt p = 0; p < pts->n; p++)
    for (PetscInt a = 0; a < c->dim; a++) pts->x[p * c->dim + a] -= g->mass.centroid[a];
  PetscCall(PetscFree(w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal terminal_speed(Contact c, const BodyGroup *g)
{
  const PetscReal d = 2 * g->radius, height = c->dim == 2 ? PETSC_PI / 2 * d : 4. / 3. * d; /* 2 Vol/A of a disc, a sphere */
  const PetscReal excess = PetscAbsReal(g->density / c->rho_f - 1);

  if (excess < 1e-6) return 0; /* meant to be neutrally buoyant */
  return PetscSqrtReal(height * excess * PetscSqrtReal(dot(c->g, c->g)));
}

static PetscErrorCode read_options(Contact c)
{
  PetscFunctionBeginUser;
  c->range    = 0.5 * c->h;
  c->multiple = 1;
  PetscCall(OptChoice("-contact_law", "Law of the contact force", law_names, &c->law));
  PetscCall(
    OptReal("-contact_range", "Gap below which bodies repel each other (default: half a cell)", "m", OPT_POSITIVE, PETSC_MAX_REAL, &c->range));
  PetscCall(OptReal("-contact_stiffness", "Multiple of the default stiffness", "", OPT_POSITIVE, PETSC_MAX_REAL, &c->multiple));
  PetscCall(
    OptInt("-contact_substeps", "Sub-steps of the contact in a time step, 0: from the stiffness", "", 0, PETSC_MAX_INT / LOOKAHEAD, &c->substeps));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCreate(Bodies bodies, PetscReal h, PetscReal rho_f, const PetscReal gravity[3], const PetscReal lower[3],
                             const PetscReal upper[3], PetscInt walls, Contact *contact)
{
  Contact c;

  PetscFunctionBeginUser;
  PetscCheck(h > 0 && rho_f > 0, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Contact needs a positive cell size and fluid density, not %g and %g",
             (double)h, (double)rho_f);
  PetscCall(PetscNew(&c));
  c->bodies = bodies;
  PetscCall(BodiesGetState(bodies, &c->s));
  c->dim   = c->s->dim;
  c->h     = h;
  c->rho_f = rho_f;
  c->walls = walls;
  for (PetscInt a = 0; a < c->dim; a++) {
    c->g[a]     = gravity[a];
    c->lower[a] = lower[a];
    c->upper[a] = upper[a];
  }
  PetscCall(read_options(c));
  PetscCall(PetscCalloc2(c->s->ngroups, &c->points, c->s->ngroups, &c->terminal));
  PetscCall(PetscCalloc1(c->s->n, &c->mover));
  for (PetscInt g = 0; g < c->s->ngroups; g++) {
    PetscCall(create_points(c, &c->s->group[g], &c->points[g]));
    c->terminal[g] = terminal_speed(c, &c->s->group[g]);
  }
  *contact = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactDestroy(Contact *contact)
{
  Contact c = *contact;

  PetscFunctionBeginUser;
  if (!c) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt g = 0; g < c->s->ngroups; g++) PetscCall(PetscFree(c->points[g].x));
  PetscCall(PetscFree2(c->points, c->terminal));
  PetscCall(PetscFree(c->mover));
  PetscCall(PetscFree(c->pair));
  PetscCall(PetscFree(*contact));
  PetscFunctionReturn(PETSC_SUCCESS);
}
