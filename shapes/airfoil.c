/* NACA four-digit airfoil with closed trailing edge, nose towards -x, chord along x.

   Outline (Jacobs, Ward & Pinkerton, NACA report 460) with the last thickness coefficient -0.1036, which closes the
   trailing edge. With z from 1 (trailing edge) over 0 (nose) to -1 (trailing edge) and x/c = z^2, thickness is smooth
   through the nose: sqrt(x/c) = |z|. z = cos(phi). Distance: the chords of 256 arcs, each with the largest deviation
   (sag) of its arc, bound the answer; circles around groups of arcs rule out most of them, and the arcs that can hold
   the closest point are searched by Newton with bisection. The sign is the side of the outline at the closest point;
   points closest to the corner at the trailing edge are outside. The body origin is at `origin` of the chord (0.25: the
   quarter-chord point). 2D only. Digits mpTT: camber m/100, camber_position p/10, thickness TT/100. */
#include "shape.h"

#define NARC   256 /* arcs, each with its chord */
#define NGROUP 16
#define PER    (NARC / NGROUP) /* arcs in a group */

typedef struct {
  PetscReal c[2], t[2], k[2]; /* point, first and second derivative by phi */
} Point;

typedef struct {
  PetscReal chord, thickness, camber, position, origin;
  Point     end[NARC + 1]; /* ends of the arcs, m, counter-clockwise from the trailing edge */
  PetscReal ex[NARC], ey[NARC], inv2[NARC], sag[NARC];
  PetscReal gx[NGROUP], gy[NGROUP], gr[NGROUP]; /* a circle around each group of arcs */
  PetscReal radius;
} Airfoil;

/* ---- the curve ---- */

/* Half thickness, signed like z, and its first two derivatives by z. */
static void Thickness(const Airfoil *f, PetscReal z, PetscReal *h, PetscReal *h1, PetscReal *h2)
{
  const PetscReal a = PetscAbsReal(z), sign = z < 0 ? -1.0 : 1.0, s = 5.0 * f->thickness, z2 = z * z;

  *h  = s * (0.2969 * z - sign * z2 * (0.1260 + z2 * (0.3516 - z2 * (0.2843 - z2 * 0.1036))));
  *h1 = s * (0.2969 - a * (0.2520 + z2 * (1.4064 - z2 * (1.7058 - z2 * 0.8288))));
  *h2 = -s * sign * (0.2520 + z2 * (4.2192 - z2 * (8.5290 - z2 * 5.8016)));
}

/* Camber line y(x) and its first three derivatives (x in chords). */
static void Camber(const Airfoil *f, PetscReal x, PetscReal y[4])
{
  const PetscReal p = f->position, q = x < p ? f->camber / (p * p) : f->camber / ((1.0 - p) * (1.0 - p));

  y[0] = x < p ? q * x * (2.0 * p - x) : q * (1.0 - 2.0 * p + x * (2.0 * p - x));
  y[1] = 2.0 * q * (p - x);
  y[2] = -2.0 * q;
  y[3] = 0.0;
}

/* The outline at phi: camber line plus thickness along its normal (-sin theta, cos theta). Derivatives by the chain
   rule, first in z. */
static void EvaluateCurve(const Airfoil *f, PetscReal phi, Point *p)
{
  const PetscReal z = PetscCosReal(phi), z1 = -PetscSinReal(phi), z2 = -z;
  PetscReal       y[4], h, h1, h2, c, s, thx, thxx, th1, th2, cz[2], tz[2], kz[2];

  Camber(f, z * z, y);
  Thickness(f, z, &h, &h1, &h2);
  c     = 1.0 / PetscSqrtReal(1.0 + y[1] * y[1]); /* cos and sin of the slope angle theta = atan y' */
  s     = y[1] * c;
  thx   = y[2] * c * c; /* theta by x */
  thxx  = (y[3] - 2.0 * y[1] * thx * y[2]) * c * c;
  th1   = thx * 2.0 * z; /* theta by z, with x = z^2 */
  th2   = thxx * 4.0 * z * z + thx * 2.0;
  cz[0] = z * z - h * s;
  cz[1] = y[0] + h * c;
  tz[0] = 2.0 * z - h1 * s - h * c * th1;
  tz[1] = 2.0 * z * y[1] + h1 * c - h * s * th1;
  kz[0] = 2.0 - h2 * s - 2.0 * h1 * c * th1 - h * (c * th2 - s * th1 * th1);
  kz[1] = 2.0 * y[1] + 4.0 * z * z * y[2] + h2 * c - 2.0 * h1 * s * th1 - h * (s * th2 + c * th1 * th1);
  for (int a = 0; a < 2; a++) {
    p->c[a] = cz[a];
    p->t[a] = tz[a] * z1;
    p->k[a] = kz[a] * z1 * z1 + tz[a] * z2;
  }
}

/* The same in metres in the body frame. */
static void EvaluateOutline(const Airfoil *f, PetscReal phi, Point *p)
{
  EvaluateCurve(f, phi, p);
  p->c[0] -= f->origin;
  for (int a = 0; a < 2; a++) {
    p->c[a] *= f->chord;
    p->t[a] *= f->chord;
    p->k[a] *= f->chord;
  }
}

/* phi stays 1e-12 away from the corner (1e-24 chords), where the tangent would vanish and with it its direction. */
static PetscReal ArcStart(PetscInt i)
{
  return 1e-12 + (PETSC_PI - 2e-12) * (PetscReal)i / (PetscReal)NARC;
}

/* ---- closest point ---- */

/* Distance from px, py to chord i; *t is where on it, from 0 to 1. */
static inline PetscReal ChordDistance(const Airfoil *f, PetscInt i, PetscReal px, PetscReal py, PetscReal *t)
{
  const PetscReal rx = px - f->end[i].c[0], ry = py - f->end[i].c[1];
  PetscReal       dx, dy;

  *t = PetscMin(PetscMax((rx * f->ex[i] + ry * f->ey[i]) * f->inv2[i], 0.0), 1.0);
  dx = rx - *t * f->ex[i];
  dy = ry - *t * f->ey[i];
  return PetscSqrtReal(dx * dx + dy * dy);
}

/* Half the derivative of the squared distance from x to the outline by phi. */
static PetscReal Slope(const Point *p, const PetscReal x[])
{
  return (p->c[0] - x[0]) * p->t[0] + (p->c[1] - x[1]) * p->t[1];
}

/* Closest point of arc i: root of the slope, started at `at` of the arc, falling back to bisection whenever Newton
   leaves the bracket. */
static PetscReal SearchArc(const Airfoil *f, PetscInt i, const PetscReal x[], PetscReal at, Point *p)
{
  PetscReal lo = ArcStart(i), hi = ArcStart(i + 1), phi = lo + at * (hi - lo);

  *p = f->end[i];
  if (Slope(p, x) > 0) return lo;
  *p = f->end[i + 1];
  if (Slope(p, x) < 0) return hi;
  for (int it = 0; it < 60; it++) {
    PetscReal g, dg, next;

    EvaluateOutline(f, phi, p);
    g  = Slope(p, x);
    dg = p->t[0] * p->t[0] + p->t[1] * p->t[1] + (p->c[0] - x[0]) * p->k[0] + (p->c[1] - x[1]) * p->k[1];
    if (g > 0) hi = phi;
    else lo = phi;
    next = dg > 0 ? phi - g / dg : lo;
    if (PetscAbsReal(next - phi) < 1e-13) break; /* moves the point by 1e-13 chords at most */
    if (!(next > lo && next < hi)) next = 0.5 * (lo + hi);
    if (hi - lo < 1e-15) break;
    phi = next;
  }
  return phi;
}

/* Outward unit normal of the outline at p. */
static void OutlineNormal(const Point *p, PetscReal n[])
{
  const PetscReal len = PetscSqrtReal(p->t[0] * p->t[0] + p->t[1] * p->t[1]);

  n[0] = p->t[1] / len;
  n[1] = -p->t[0] / len;
}

/* Signed distance and its gradient at one point. */
static PetscReal MeasurePoint(const Airfoil *f, const PetscReal x[], PetscReal normal[])
{
  PetscReal lower[NGROUP], dist[NARC], at[NARC], upper = PETSC_MAX_REAL, best2 = PETSC_MAX_REAL, best_phi = 0, best,
                                                 side, n[2] = {1, 0};
  Point p, q                                                = {{0, 0}, {0, 0}, {0, 0}};

  for (PetscInt g = 0; g < NGROUP; g++) {
    const PetscReal r = PetscSqrtReal(PetscSqr(x[0] - f->gx[g]) + PetscSqr(x[1] - f->gy[g]));

    lower[g] = r - f->gr[g];
    upper    = PetscMin(upper, r + f->gr[g]);
  }
  for (PetscInt g = 0; g < NGROUP; g++) {
    if (lower[g] > upper) continue;
    for (PetscInt i = g * PER; i < (g + 1) * PER; i++) {
      dist[i] = ChordDistance(f, i, x[0], x[1], &at[i]);
      upper   = PetscMin(upper, dist[i] + f->sag[i]);
    }
  }
  for (PetscInt g = 0; g < NGROUP; g++) {
    if (lower[g] > upper) continue; /* upper never rises: what is kept here was measured above */
    for (PetscInt i = g * PER; i < (g + 1) * PER; i++) {
      PetscReal phi, d2;

      if (dist[i] - f->sag[i] > upper) continue;
      phi = SearchArc(f, i, x, at[i], &p);
      d2  = PetscSqr(p.c[0] - x[0]) + PetscSqr(p.c[1] - x[1]);
      if (d2 < best2) {
        best2    = d2;
        best_phi = phi;
        q        = p;
      }
    }
  }
  best = PetscSqrtReal(best2);
  side = best;
  /* otherwise the corner: every point it is closest to is outside */
  if (best_phi > ArcStart(0) && best_phi < ArcStart(NARC)) {
    OutlineNormal(&q, n);
    side = (x[0] - q.c[0]) * n[0] + (x[1] - q.c[1]) * n[1];
  }
  for (int a = 0; a < 2; a++)
    normal[a] = best > 1e-7 * f->chord ? (side < 0 ? q.c[a] - x[a] : x[a] - q.c[a]) / best : n[a];
  return side < 0 ? -best : best;
}

/* ---- operations ---- */

static PetscErrorCode ShapeCreate_Airfoil(Shape s)
{
  Airfoil *f;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  PetscCall(ShapeSetData(s, f));
  f->chord     = 1.0;
  f->thickness = 0.12;
  f->camber    = 0.0;
  f->position  = 0.4;
  f->origin    = 0.25;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Airfoil(Shape s)
{
  Airfoil *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(ShapeOptionReal(s, "chord", "Chord", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &f->chord));
  PetscCall(
    ShapeOptionReal(s, "thickness", "Largest thickness (last two digits / 100)", "chord", 0.01, 0.4, &f->thickness));
  PetscCall(ShapeOptionReal(s, "camber", "Largest camber (first digit / 100)", "chord", 0.0, 0.095, &f->camber));
  PetscCall(ShapeOptionReal(s, "camber_position", "Position of the largest camber (second digit / 10)", "chord", 0.1,
                            0.9, &f->position));
  PetscCall(ShapeOptionReal(s, "origin", "Body origin along the chord: 0 nose, 1 trailing edge", "chord", 0.0, 1.0,
                            &f->origin));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Chord and sag of arc i; the sag is sampled, so with a margin of a quarter. */
static void MeasureArc(Airfoil *f, PetscInt i)
{
  PetscReal t;
  Point     p;

  f->ex[i]   = f->end[i + 1].c[0] - f->end[i].c[0];
  f->ey[i]   = f->end[i + 1].c[1] - f->end[i].c[1];
  f->inv2[i] = 1.0 / (PetscSqr(f->ex[i]) + PetscSqr(f->ey[i]));
  f->sag[i]  = 1e-12 * f->chord;
  for (PetscInt k = 1; k < 16; k++) {
    EvaluateOutline(f, ArcStart(i) + (PetscReal)k / 16.0 * (ArcStart(i + 1) - ArcStart(i)), &p);
    f->sag[i] = PetscMax(f->sag[i], 1.25 * ChordDistance(f, i, p.c[0], p.c[1], &t));
  }
}

/* Circle around the arcs of group g, about the middle of its ends. */
static void MeasureGroup(Airfoil *f, PetscInt g)
{
  const Point *a = &f->end[g * PER], *b = &f->end[(g + 1) * PER];

  f->gx[g] = 0.5 * (a->c[0] + b->c[0]);
  f->gy[g] = 0.5 * (a->c[1] + b->c[1]);
  f->gr[g] = 0;
  for (PetscInt i = g * PER; i < (g + 1) * PER; i++)
    for (PetscInt e = i; e <= i + 1; e++)
      f->gr[g] = PetscMax(f->gr[g], f->sag[i] + PetscSqrtReal(PetscSqr(f->end[e].c[0] - f->gx[g]) +
                                                              PetscSqr(f->end[e].c[1] - f->gy[g])));
}

static PetscErrorCode ShapeSetUp_Airfoil(Shape s)
{
  Airfoil *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  for (PetscInt i = 0; i <= NARC; i++) EvaluateOutline(f, ArcStart(i), &f->end[i]);
  for (PetscInt i = 0; i < NARC; i++) MeasureArc(f, i);
  for (PetscInt g = 0; g < NGROUP; g++) MeasureGroup(f, g);
  f->radius = 0;
  for (PetscInt i = 0; i < NARC; i++)
    for (PetscInt e = i; e <= i + 1; e++)
      f->radius = PetscMax(f->radius, f->sag[i] + PetscSqrtReal(PetscSqr(f->end[e].c[0]) + PetscSqr(f->end[e].c[1])));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDistance_Airfoil(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Airfoil  *f;
  PetscReal normal[2];

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  for (PetscInt i = 0; i < n; i++) d[i] = MeasurePoint(f, x + 2 * i, normal);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeNormal_Airfoil(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Airfoil *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  for (PetscInt i = 0; i < n; i++) MeasurePoint(f, x + 2 * i, normal + 2 * i);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Airfoil(Shape s, PetscReal *r)
{
  Airfoil *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  *r = f->radius;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Length of the arc from lo to hi: five-point Gauss rule, exact to round-off on a 256th of the outline. */
static PetscReal ArcLength(const Airfoil *f, PetscReal lo, PetscReal hi)
{
  const PetscReal at[5]     = {-0.906179845938664, -0.538469310105683, 0.0, 0.538469310105683, 0.906179845938664};
  const PetscReal weight[5] = {0.236926885056189, 0.478628670499366, 0.568888888888889, 0.478628670499366,
                               0.236926885056189};
  PetscReal       sum       = 0;
  Point           p;

  for (int q = 0; q < 5; q++) {
    EvaluateOutline(f, 0.5 * (lo + hi) + 0.5 * (hi - lo) * at[q], &p);
    sum += 0.5 * (hi - lo) * weight[q] * PetscSqrtReal(p.t[0] * p.t[0] + p.t[1] * p.t[1]);
  }
  return sum;
}

/* Evenly spaced in arc length, half a spacing away from the trailing edge. */
static PetscErrorCode ShapeSurface_Airfoil(Shape s, PetscInt n, PetscReal x[], PetscReal w[])
{
  Airfoil  *f;
  PetscReal len[NARC], total = 0, start = 0;
  PetscInt  arc = 0;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  for (PetscInt i = 0; i < NARC; i++) total += len[i] = ArcLength(f, ArcStart(i), ArcStart(i + 1));
  for (PetscInt k = 0; k < n; k++) {
    const PetscReal at = ((PetscReal)k + 0.5) * total / (PetscReal)n;
    PetscReal       lo, hi, base;
    Point           p;

    while (arc < NARC - 1 && start + len[arc] < at) start += len[arc++];
    base = lo = ArcStart(arc);
    hi        = ArcStart(arc + 1);
    for (int it = 0; it < 45; it++) { /* bisection: n is small and this is done once */
      const PetscReal mid = 0.5 * (lo + hi);

      if (ArcLength(f, base, mid) < at - start) lo = mid;
      else hi = mid;
    }
    EvaluateOutline(f, 0.5 * (lo + hi), &p);
    x[2 * k]     = p.c[0];
    x[2 * k + 1] = p.c[1];
    w[k]         = total / (PetscReal)n;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The trailing edge */
static PetscErrorCode ShapeCorners_Airfoil(Shape s, PetscInt max, PetscInt *n, PetscReal x[])
{
  Airfoil *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  *n = 1;
  for (PetscInt a = 0; a < 2 && max > 0; a++) x[a] = f->end[0].c[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Airfoil(Shape s, PetscViewer viewer)
{
  Airfoil *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(PetscViewerASCIIPrintf(viewer, "chord %g m, thickness %g, camber %g at %g of the chord, origin at %g\n",
                                   (double)f->chord, (double)f->thickness, (double)f->camber, (double)f->position,
                                   (double)f->origin));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Airfoil(Shape s)
{
  Airfoil *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(PetscFree(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "airfoil",
  .description = "NACA four-digit airfoil, closed trailing edge",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 1,
  .ops         = {.create   = ShapeCreate_Airfoil,
                  .options  = ShapeOptions_Airfoil,
                  .setup    = ShapeSetUp_Airfoil,
                  .distance = ShapeDistance_Airfoil,
                  .radius   = ShapeRadius_Airfoil,
                  .normal   = ShapeNormal_Airfoil,
                  .surface  = ShapeSurface_Airfoil,
                  .view     = ShapeView_Airfoil,
                  .destroy  = ShapeDestroy_Airfoil,
                  .corners  = ShapeCorners_Airfoil},
};
