/* Contact, geometry: where two bodies, or a body and a wall, touch.

   Disc-disc and disc-wall in closed form. Any other pair: surface points of each body against the signed distance of
   the other, both ways; wall: surface points against the plane. The force acts through all points within reach, with
   weights that fall off as exp(-(gap - smallest gap)/(r/4)) and add up to one. The single deepest point would jump
   along a flat side and chatter in torque; a plain sum over points would make the force depend on how many there are.
   This way the force is that of two discs, wherever it acts. Distances across a periodic face count as those to the
   nearest image. */
#include "compat.h"
#include "impl.h"

#define POINT_DECAY 0.25 /* in r */

void ContactDiscGap(Contact c, PetscInt i, PetscReal radius_i, PetscInt j, PetscReal radius_j, PetscReal normal[3], PetscReal *gap)
{
  if (j < 0) {
    const PetscInt  face = -1 - j, a = face / 2;
    const PetscReal sign = face % 2 ? -1 : 1, wall = face % 2 ? c->upper[a] : c->lower[a];

    for (PetscInt b = 0; b < 3; b++) normal[b] = b == a ? sign : 0;
    *gap = sign * (c->x[i][a] - wall) - radius_i;
  } else {
    PetscReal d[3] = {c->x[i][0] - c->x[j][0], c->x[i][1] - c->x[j][1], c->x[i][2] - c->x[j][2]}, length, scale;

    ContactWrap(c, d);
    length = PetscSqrtReal(dot3(d, d));
    scale  = length > 0 ? 1 / length : 0;
    for (PetscInt b = 0; b < 3; b++) normal[b] = scale * d[b];
    if (length <= 0) normal[0] = 1; /* same centre: any direction */
    *gap = length - radius_i - radius_j;
  }
}

static void touch_discs(Contact c, PetscInt i, PetscReal radius_i, PetscInt j, PetscReal radius_j, Touch *t)
{
  PetscReal half;

  ContactDiscGap(c, i, radius_i, j, radius_j, t->normal, &t->gap);
  half = j < 0 ? 0 : 0.5 * t->gap;
  for (PetscInt a = 0; a < 3; a++) {
    t->ri[a] = -(radius_i + half) * t->normal[a];
    t->rj[a] = j < 0 ? 0 : (radius_j + half) * t->normal[a];
  }
}

/* Surface point p of a body, from its centre, space axes. */
static void turn_point(PetscInt dim, const PetscReal R[9], PetscReal scale, const PetscReal p[], PetscReal r[3])
{
  for (PetscInt a = 0; a < 3; a++) r[a] = scale * (R[3 * a] * p[0] + R[3 * a + 1] * p[1] + (dim == 3 ? R[3 * a + 2] * p[2] : 0));
}

static PetscInt touch_wall(Contact c, PetscInt i, PetscInt face, Touch t[])
{
  const Kind     *kind = ContactKind(c, i);
  const PetscInt  a    = face / 2;
  const PetscReal sign = face % 2 ? -1 : 1, wall = face % 2 ? c->upper[a] : c->lower[a];
  PetscReal       R[9];

  RotationMatrix(c->q[i], R);
  for (PetscInt p = 0; p < kind->npoints; p++) {
    turn_point(c->dim, R, kind->scale, kind->point + p * c->dim, t[p].ri);
    t[p].gap = sign * (c->x[i][a] + t[p].ri[a] - wall);
    for (PetscInt b = 0; b < 3; b++) {
      t[p].normal[b] = b == a ? sign : 0;
      t[p].rj[b]     = 0;
    }
  }
  return kind->npoints;
}

/* y [dim] in the frame of the shape of a group, for r from the centre of a body of size `scale` in space axes */
static void to_body_frame(PetscInt dim, const PetscReal R[9], const BodyGroup *g, PetscReal scale, const PetscReal r[3], PetscReal y[])
{
  for (PetscInt a = 0; a < dim; a++) y[a] = (R[a] * r[0] + R[3 + a] * r[1] + R[6 + a] * r[2]) / scale + g->mass.centroid[a];
}

/* Points of body `from` that are near body `to`, with gap and outward normal of `to`. The body that the normal points
   at, i of the pair, is `from`; turned round if not. */
static PetscErrorCode touch_points(Contact c, PetscInt from, PetscInt to, PetscBool turned, Touch t[], PetscInt *nt)
{
  const Kind      *kind = ContactKind(c, from), *far = ContactKind(c, to);
  const BodyGroup *g = BodiesGetGroup(c->state, to);
  PetscReal        Rf[9], Rt[9], y[CONTACT_MAX_POINTS * 3], d[CONTACT_MAX_POINTS], nrm[CONTACT_MAX_POINTS * 3], apart[3] = {0, 0, 0};
  PetscInt         n = 0, kept = 0;

  PetscFunctionBeginUser;
  RotationMatrix(c->q[from], Rf);
  RotationMatrix(c->q[to], Rt);
  for (PetscInt a = 0; a < c->dim; a++) apart[a] = c->x[from][a] - c->x[to][a];
  ContactWrap(c, apart);
  for (PetscInt p = 0; p < kind->npoints; p++) {
    PetscReal *mine = turned ? t[n].rj : t[n].ri, *other = turned ? t[n].ri : t[n].rj;

    turn_point(c->dim, Rf, kind->scale, kind->point + p * c->dim, mine);
    for (PetscInt a = 0; a < 3; a++) other[a] = apart[a] + mine[a];
    if (dot3(other, other) > PetscSqr(far->radius + c->horizon)) continue;
    to_body_frame(c->dim, Rt, g, far->scale, other, y + n * c->dim);
    n++;
  }
  *nt = 0;
  if (!n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ShapeDistance(g->shape, n, y, d));
  for (PetscInt p = 0; p < n; p++) {
    const PetscReal apart_by = far->scale * d[p];

    if (apart_by >= c->horizon) continue;
    t[kept]     = t[p];
    t[kept].gap = apart_by;
    for (PetscInt a = 0; a < c->dim; a++) y[kept * c->dim + a] = y[p * c->dim + a];
    kept++;
  }
  PetscCall(ShapeNormal(g->shape, kept, y, nrm));
  for (PetscInt p = 0; p < kept; p++)
    for (PetscInt a = 0; a < 3; a++) {
      t[p].normal[a] = 0;
      for (PetscInt b = 0; b < c->dim; b++) t[p].normal[a] += (turned ? -1 : 1) * Rt[3 * a + b] * nrm[p * c->dim + b];
    }
  *nt = kept;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Weights fall off from the deepest point and vanish at the horizon, so that a point comes into play without a jump. */
static void weigh(Contact c, PetscInt n, Touch t[], PetscReal *smallest)
{
  PetscReal sum = 0;

  *smallest = PETSC_MAX_REAL;
  for (PetscInt p = 0; p < n; p++) *smallest = PetscMin(*smallest, t[p].gap);
  if (*smallest >= c->horizon) return;
  for (PetscInt p = 0; p < n; p++) {
    t[p].weight = PetscMax(0, 1 - t[p].gap / c->horizon) * PetscExpReal(-(t[p].gap - *smallest) / (POINT_DECAY * c->range));
    sum += t[p].weight;
  }
  for (PetscInt p = 0; p < n; p++) t[p].weight /= sum;
}

PetscErrorCode ContactFindTouch(Contact c, PetscInt i, PetscInt j, PetscInt *n, PetscReal *gap)
{
  const Kind *ki = ContactKind(c, i), *kj = j >= 0 ? ContactKind(c, j) : NULL;
  PetscInt    m = 0;

  PetscFunctionBeginUser;
  *n = 0;
  if (ki->disc > 0 && (!kj || kj->disc > 0)) {
    touch_discs(c, i, ki->disc, j, kj ? kj->disc : 0, c->touch);
    *n                 = 1;
    *gap               = c->touch[0].gap;
    c->touch[0].weight = 1;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (!kj) *n = touch_wall(c, i, -1 - j, c->touch);
  else if (ContactWithin(c, i, j, ki->radius + kj->radius + c->horizon)) {
    PetscCall(touch_points(c, i, j, PETSC_FALSE, c->touch, n));
    PetscCall(touch_points(c, j, i, PETSC_TRUE, c->touch + *n, &m));
    *n += m;
  }
  weigh(c, *n, c->touch, gap);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- curvature ---- */

/* Mean curvature of the surface of body k where r (from its centre) is nearest: divergence of the normal, by
   differences along the tangents. */
static PetscErrorCode surface_curvature(Contact c, PetscInt k, const PetscReal r[3], PetscReal *curvature)
{
  const BodyGroup *g    = BodiesGetGroup(c->state, k);
  const Kind      *kind = ContactKind(c, k);
  const PetscReal  step = 0.02 * g->radius;
  PetscReal        R[9], y[3], s[3], nrm[3], p[6], m[6], sum = 0;

  PetscFunctionBeginUser;
  if (g->disc > 0) {
    *curvature = 1 / kind->disc;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  RotationMatrix(c->q[k], R);
  to_body_frame(c->dim, R, g, kind->scale, r, y);
  PetscCall(ShapeProject(g->shape, 1, y, s));
  PetscCall(ShapeNormal(g->shape, 1, s, nrm));
  for (PetscInt b = 0; b < c->dim; b++) { /* div n = sum_b d n_b/d x_b; along the normal it does not change */
    for (PetscInt side = 0; side < 2; side++) {
      for (PetscInt a = 0; a < c->dim; a++) p[side * c->dim + a] = s[a] + (a == b ? (side ? 1 : -1) * step : 0);
    }
    PetscCall(ShapeNormal(g->shape, 2, p, m));
    sum += (m[c->dim + b] - m[b]) / (2 * step);
  }
  *curvature = sum / (c->dim - 1) / kind->scale;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCurvature(Contact c, PetscInt i, PetscInt j, const Touch *t, PetscReal *curvature)
{
  PetscReal ci, cj = 0, least = 1 / ContactKind(c, i)->radius;

  PetscFunctionBeginUser;
  PetscCall(surface_curvature(c, i, t->ri, &ci));
  if (j >= 0) {
    PetscCall(surface_curvature(c, j, t->rj, &cj));
    least = PetscMin(least, 1 / ContactKind(c, j)->radius);
  }
  *curvature = PetscMax(ci + cj, least);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- surface points ---- */

/* Points about one range apart on the largest body, at least 32, at most `most`. A disc needs them only against bodies
   that are no discs. */
static PetscErrorCode create_points(Contact c, const BodyGroup *g, PetscInt most, PetscInt *n, PetscReal **point)
{
  PetscReal *x, *w, area = 0;

  PetscFunctionBeginUser;
  if (g->disc > 0) area = c->dim == 2 ? 2 * PETSC_PI * g->disc : 4 * PETSC_PI * PetscSqr(g->disc);
  else {
    PetscCall(PetscMalloc2(64 * c->dim, &x, 64, &w));
    PetscCall(ShapeSurface(g->shape, 64, x, w));
    for (PetscInt p = 0; p < 64; p++) area += w[p];
    PetscCall(PetscFree2(x, w));
  }
  *n = (PetscInt)PetscMin(most, PetscMax(32, PetscCeilReal(area / PetscPowRealInt(c->range / g->largest, c->dim - 1))));
  PetscCall(PetscMalloc1(*n * c->dim, point));
  PetscCall(PetscMalloc1(*n, &w));
  PetscCall(ShapeSurface(g->shape, *n, *point, w));
  for (PetscInt p = 0; p < *n; p++)
    for (PetscInt a = 0; a < c->dim; a++) (*point)[p * c->dim + a] -= g->mass.centroid[a];
  PetscCall(PetscFree(w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCreatePoints(Contact c, PetscInt most)
{
  PetscInt *n;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(c->s->ngroups, &n));
  for (PetscInt g = 0; g < c->s->ngroups; g++) {
    PetscCall(PetscFree(c->point[g]));
    PetscCall(create_points(c, &c->s->group[g], most, &n[g], &c->point[g]));
  }
  for (PetscInt i = 0; i < c->nkinds; i++) {
    c->kind[i].npoints = n[c->kind[i].group];
    c->kind[i].point   = c->point[c->kind[i].group];
  }
  PetscCall(PetscFree(n));
  PetscFunctionReturn(PETSC_SUCCESS);
}
