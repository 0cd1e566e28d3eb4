/* Contact, geometry: where two bodies, or a body and a wall, touch.

   Disc-disc and disc-side of a box in closed form. Any other pair: surface points of each body against the signed
   distance of the other, both ways; wall: see wall.c. The force acts through all points within reach, with weights
   that fall off as exp(-(gap - smallest gap)/(r/4)) and add up to one. The single deepest point would jump along a
   flat side and chatter in torque; a plain sum over points would make the force depend on how many there are. This
   way the force is that of two discs, wherever it acts. Distances across a periodic face count as those to the
   nearest image. */
#include "compat.h"
#include "impl.h"

#define POINT_DECAY    0.25 /* in r */
#define MIN_IN_CONCAVE 0.01 /* of a film in a round wall that is hardly wider than the body, in that of others */
#define MIN_CURVATURE  0.1  /* of a film in space, in that of the bounding ball: spheroids of 10 to 1 have it */

void ContactDiscGap(Contact c, PetscInt i, PetscReal radius_i, PetscInt j, PetscReal radius_j, PetscReal normal[3],
                    PetscReal *gap)
{
  if (j < 0) {
    const PetscInt  face = -1 - j, a = face / 2;
    const PetscReal sign = face % 2 ? -1 : 1, wall = face % 2 ? c->domain.upper[a] : c->domain.lower[a];

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

/* y [dim] in the frame of the shape of a group, for r from the centre of a body of size `scale` in space axes */
static void to_body_frame(PetscInt dim, const PetscReal R[9], const BodyGroup *g, PetscReal scale, const PetscReal r[3],
                          PetscReal y[])
{
  for (PetscInt a = 0; a < dim; a++)
    y[a] = (R[a] * r[0] + R[3 + a] * r[1] + R[6 + a] * r[2]) / scale + g->mass.centroid[a];
}

/* Points of body `from` that are near body `to`, with gap and outward normal of `to`. The body that the normal points
   at, i of the pair, is `from`; turned round if not. */
static PetscErrorCode touch_points(Contact c, PetscInt from, PetscInt to, PetscBool turned, Touch t[], PetscInt *nt)
{
  const Kind      *kind = ContactKind(c, from), *far = ContactKind(c, to);
  const BodyGroup *g = BodiesGetGroup(c->state, to);
  PetscReal        Rf[9], Rt[9], y[CONTACT_MAX_POINTS * 3], d[CONTACT_MAX_POINTS], nrm[CONTACT_MAX_POINTS * 3],
    apart[3] = {0, 0, 0};
  PetscInt n = 0, kept = 0;

  PetscFunctionBeginUser;
  RotationMatrix(c->q[from], Rf);
  RotationMatrix(c->q[to], Rt);
  for (PetscInt a = 0; a < c->dim; a++) apart[a] = c->x[from][a] - c->x[to][a];
  ContactWrap(c, apart);
  for (PetscInt p = 0; p < kind->npoints; p++) {
    PetscReal *mine = turned ? t[n].rj : t[n].ri, *other = turned ? t[n].ri : t[n].rj;

    ContactTurnPoint(c->dim, Rf, kind->scale, kind->point + p * c->dim, mine);
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
static void set_weights(Contact c, PetscInt n, Touch t[], PetscReal *smallest)
{
  PetscReal sum = 0;

  *smallest = PETSC_MAX_REAL;
  for (PetscInt p = 0; p < n; p++) *smallest = PetscMin(*smallest, t[p].gap);
  if (*smallest >= c->horizon) return;
  for (PetscInt p = 0; p < n; p++) {
    t[p].weight = PetscMax(0, 1 - t[p].gap / c->horizon) *
                  PetscExpReal(-(t[p].gap - *smallest) / (POINT_DECAY * c->range));
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
  if (ki->disc > 0 && (kj ? kj->disc > 0 : !ContactIsPiece(j))) {
    touch_discs(c, i, ki->disc, j, kj ? kj->disc : 0, c->touch);
    *n                 = 1;
    *gap               = c->touch[0].gap;
    c->touch[0].weight = 1;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (!kj) PetscCall(ContactTouchWall(c, i, j, n, c->touch));
  else if (ContactWithin(c, i, j, ki->radius + kj->radius + c->horizon)) {
    PetscCall(touch_points(c, i, j, PETSC_FALSE, c->touch, n));
    PetscCall(touch_points(c, j, i, PETSC_TRUE, c->touch + *n, &m));
    *n += m;
  }
  set_weights(c, *n, c->touch, gap);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- where the gap is narrowest ---- */

/* A point on a surface, all in space axes */
typedef struct {
  PetscReal r[3];      /* from the body's centre */
  PetscReal normal[3]; /* outward */
  PetscReal K[9];      /* gradient of the normal: the curvatures, and none along the normal */
} SurfacePoint;

static void point_on_disc(PetscInt dim, PetscReal radius, const PetscReal r[3], SurfacePoint *p)
{
  const PetscReal length = PetscSqrtReal(dot3(r, r));

  for (PetscInt a = 0; a < 3; a++) {
    p->normal[a] = r[a] / length;
    p->r[a]      = radius * p->normal[a];
  }
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt b = 0; b < dim; b++) p->K[3 * a + b] = ((a == b) - p->normal[a] * p->normal[b]) / radius;
}

/* Where r (from its centre) is nearest to the surface of body k; the curvature by differences */
static PetscErrorCode find_surface_point(Contact c, PetscInt k, const PetscReal r[3], SurfacePoint *p)
{
  const BodyGroup *g    = BodiesGetGroup(c->state, k);
  const Kind      *kind = ContactKind(c, k);
  const PetscReal  step = 0.02 * g->radius;
  const PetscInt   dim  = c->dim;
  PetscReal        R[9], y[3] = {0}, s[3] = {0}, x[7 * 3], n[7 * 3], body[9] = {0};

  PetscFunctionBeginUser;
  *p = (SurfacePoint){{0}, {0}, {0}};
  if (kind->disc > 0) {
    point_on_disc(dim, kind->disc, r, p);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  RotationMatrix(c->q[k], R);
  to_body_frame(dim, R, g, kind->scale, r, y);
  PetscCall(ShapeProject(g->shape, 1, y, s));
  for (PetscInt e = 0; e <= 2 * dim; e++) /* the place itself, then steps to either side along each axis */
    for (PetscInt a = 0; a < dim; a++)
      x[e * dim + a] = s[a] + (e > 0 && a == (e - 1) / 2 ? (e % 2 ? -1 : 1) * step : 0);
  PetscCall(ShapeNormal(g->shape, 2 * dim + 1, x, n));
  for (PetscInt a = 0; a < dim; a++) s[a] -= g->mass.centroid[a];
  ContactTurnPoint(dim, R, kind->scale, s, p->r);
  ContactTurnPoint(dim, R, 1, n, p->normal);
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt b = 0; b < dim; b++)
      body[3 * a + b] = (n[(2 * b + 2) * dim + a] - n[(2 * b + 1) * dim + a]) / (2 * step * kind->scale);
  for (PetscInt e = 0; e < 9; e++)
    for (PetscInt f = 0; f < 9; f++) p->K[e] += R[3 * (e / 3) + f / 3] * body[f] * R[3 * (e % 3) + f % 3];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The point on the partner of i that is nearest to the point pi; its r is from the partner's centre (0: a wall) */
static PetscErrorCode find_partner(Contact c, PetscInt i, PetscInt j, const SurfacePoint *pi, Touch *t,
                                   SurfacePoint *pj)
{
  PetscReal apart[3];

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) t->ri[a] = pi->r[a];
  if (j < 0) {
    *pj = (SurfacePoint){{0}, {0}, {0}};
    PetscCall(ContactPlaceOnWall(c, i, j, pi->r, &t->gap, pj->normal, pj->K));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt a = 0; a < 3; a++) apart[a] = c->x[i][a] - c->x[j][a];
  ContactWrap(c, apart);
  for (PetscInt a = 0; a < 3; a++) t->rj[a] = apart[a] + pi->r[a];
  PetscCall(find_surface_point(c, j, t->rj, pj));
  t->gap = 0;
  for (PetscInt a = 0; a < 3; a++) t->gap += (t->rj[a] - pj->r[a]) * pj->normal[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Trace, and sum of the principal minors: with the normal as null direction sum and product of principal curvatures */
static void invariants(const PetscReal K[9], PetscReal *sum, PetscReal *product)
{
  *sum     = K[0] + K[4] + K[8];
  *product = K[0] * K[4] + K[4] * K[8] + K[8] * K[0] -
             0.25 * (PetscSqr(K[1] + K[3]) + PetscSqr(K[2] + K[6]) + PetscSqr(K[5] + K[7]));
}

/* The quadratic gap of curvatures K and the slope that both normals tell, to its minimum; none far away (flat sides) */
static void move_to_minimum(PetscInt dim, const PetscReal K[9], const PetscReal ni[3], const PetscReal n[3],
                            PetscReal far, Touch *t)
{
  const PetscReal down = -dot3(ni, n), scale = K[0] + K[4] + K[8];
  PetscReal       M[9], slope[3], step[3], descent;

  if (down < 0.5 || scale <= 0) return;
  for (PetscInt a = 0; a < 3; a++) slope[a] = (ni[a] + down * n[a]) / down;
  for (PetscInt e = 0; e < 9; e++) M[e] = K[e] + scale * n[e / 3] * n[e % 3] + (dim == 2 && e == 8 ? scale : 0);
  solve3(M, slope, step);
  descent = 0.5 * dot3(slope, step);
  if (dot3(step, step) > far * far || descent < 0) return;
  t->gap -= descent;
  for (PetscInt a = 0; a < 3; a++) {
    t->ri[a] -= step[a];
    t->rj[a] -= step[a];
  }
}

PetscErrorCode ContactFindNarrowest(Contact c, PetscInt i, PetscInt j, Touch *t, Curvature *curvature)
{
  PetscReal    min     = 1 / ContactKind(c, i)->radius, K[9], sum, product, root;
  PetscReal    concave = 0; /* curvature of a wall around the body */
  SurfacePoint pi, pj;

  PetscFunctionBeginUser;
  PetscCall(find_surface_point(c, i, t->ri, &pi));
  PetscCall(find_partner(c, i, j, &pi, t, &pj));
  if (j >= 0) min = PetscMin(min, 1 / ContactKind(c, j)->radius);
  invariants(pi.K, &sum, &product);
  curvature->of[0] = sum / (c->dim - 1);
  invariants(pj.K, &sum, &product);
  curvature->of[1] = sum / (c->dim - 1);
  if (j < 0)
    concave = PetscMax(0, c->dim == 2 ? -sum : PetscSqrtReal(PetscMax(0, 0.25 * sum * sum - product)) - 0.5 * sum);
  for (PetscInt e = 0; e < 9; e++) K[e] = pi.K[e] + pj.K[e];
  move_to_minimum(c->dim, K, pi.normal, pj.normal, 0.25 / min, t);
  if (j < 0) t->rj[0] = t->rj[1] = t->rj[2] = 0;
  invariants(K, &sum, &product);
  root = c->dim == 2 ? 0 : PetscSqrtReal(PetscMax(0, 0.25 * sum * sum - product));
  sum  = c->dim == 2 ? 2 * sum : sum;
  if (c->dim == 3) min *= MIN_CURVATURE;
  min                     = PetscMax(min - concave, MIN_IN_CONCAVE * min);
  curvature->principal[0] = PetscMax(0.5 * sum - root, min);
  curvature->principal[1] = PetscMax(0.5 * sum + root, min);
  PetscFunctionReturn(PETSC_SUCCESS);
}
