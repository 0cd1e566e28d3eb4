/* Edge: quadratic edges in the plane, on which interfaces and outlines of solids lie. An edge has the nodes p [3][2],
   first, middle and last, at the parameters t = -1, 0, 1; what it bounds is on its left. Nothing is collective. */
#pragma once
#include <petscsys.h>

/* 5-point Gauss quadrature over t: exact for area and moments of what edges bound */
#define EDGE_NGAUSS 5
static const PetscReal EDGE_GAUSS[EDGE_NGAUSS]  = {-0.9061798459386640, -0.5384693101056831, 0, 0.5384693101056831,
                                                   0.9061798459386640};
static const PetscReal EDGE_WEIGHT[EDGE_NGAUSS] = {0.2369268850561891, 0.4786286704993665, 0.5688888888888889,
                                                   0.4786286704993665, 0.2369268850561891};

/* Position, and its derivative by t */
static inline void EdgeEvaluate(PetscReal (*const p)[2], PetscReal t, PetscReal at[2], PetscReal d[2])
{
  for (PetscInt a = 0; a < 2; a++) {
    const PetscReal slope = 0.5 * (p[2][a] - p[0][a]), curvature = p[0][a] - 2 * p[1][a] + p[2][a];

    at[a] = p[1][a] + t * (slope + 0.5 * t * curvature);
    d[a]  = slope + t * curvature;
  }
}

/* Square of the distance of two points */
static inline PetscReal EdgeDistance2(const PetscReal x[2], const PetscReal y[2])
{
  return PetscSqr(x[0] - y[0]) + PetscSqr(x[1] - y[1]);
}

/* Radius of a circle about the middle node that the edge lies in */
static inline PetscReal EdgeRadius(PetscReal (*const p)[2])
{
  return 1.1 * PetscSqrtReal(PetscMax(EdgeDistance2(p[0], p[1]), EdgeDistance2(p[1], p[2])));
}

/* Parameter in [-1, 1] of the point of the edge closest to x: the best of nine starts, by Newton's method */
static inline PetscReal EdgeClosest(PetscReal (*const p)[2], const PetscReal x[2])
{
  PetscReal t = 0, best = PETSC_MAX_REAL, y[2], d[2];

  for (PetscInt i = 0; i <= 8; i++) {
    const PetscReal s = -1 + 0.25 * (PetscReal)i;

    EdgeEvaluate(p, s, y, d);
    if (EdgeDistance2(x, y) >= best) continue;
    best = EdgeDistance2(x, y);
    t    = s;
  }
  for (PetscInt i = 0; i < 12; i++) {
    PetscReal f, slope, norm, to;

    EdgeEvaluate(p, t, y, d);
    norm  = d[0] * d[0] + d[1] * d[1];
    f     = (y[0] - x[0]) * d[0] + (y[1] - x[1]) * d[1];
    slope = norm;
    for (PetscInt a = 0; a < 2; a++) slope += (y[a] - x[a]) * (p[0][a] - 2 * p[1][a] + p[2][a]);
    if (slope < 0.1 * norm) slope = norm;
    to = PetscMax(-1, PetscMin(1, t - f / slope));
    if (PetscAbsReal(to - t) < 1e-14) return to;
    t = to;
  }
  return t;
}

/* Unit normal, outwards; zero where all nodes are one */
static inline void EdgeNormal(PetscReal (*const p)[2], PetscReal t, PetscReal n[2])
{
  PetscReal y[2], d[2], norm;

  EdgeEvaluate(p, t, y, d);
  norm = PetscMax(PetscHypotReal(d[0], d[1]), PETSC_MACHINE_EPSILON * (PetscAbsReal(p[2][0]) + PetscAbsReal(p[2][1])));
  n[0] = norm > 0 ? d[1] / norm : 0;
  n[1] = norm > 0 ? -d[0] / norm : 0;
}
