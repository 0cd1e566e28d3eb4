/* Midline: see midline.h. */
#include "compat.h"
#include "align/midline.h"
#include "base/array.h"

#define STEPS     100  /* in a bounding radius */
#define MAX_STEPS 1000 /* to a tip */
#define SLENDER   3    /* smallest length over thickness */
#define MISSING   0.05 /* largest difference between the area along the line and that of the figure, as its share */

struct _p_Midline {
  PetscInt n, capacity;
  PetscReal (*x)[2]; /* [n] from tip to tip */
  PetscReal *s;      /* [n] length along the line */
  PetscReal  thickness, area;
};

/* ---- the march ---- */

typedef struct {
  PetscReal x[2], t[2]; /* place and direction */
  PetscReal width;
} Front;

/* Distance u > 0 from the inner point x along the unit vector e to the surface: steps of the distance never pass it,
   and the last bit is found by bisection */
static PetscErrorCode find_side(const MidlineFigure *figure, const PetscReal x[2], const PetscReal e[2], PetscReal *u)
{
  const PetscReal r   = figure->radius;
  PetscReal       low = 0, high = 0, d;

  PetscFunctionBeginUser;
  while (high < 3 * r) {
    const PetscReal y[2] = {x[0] + high * e[0], x[1] + high * e[1]};

    PetscCall(figure->distance(figure->ctx, y, &d));
    if (d >= 0) break;
    low = high;
    high += PetscMax(-d, 1e-5 * r);
  }
  while (high - low > 1e-15 * r) {
    const PetscReal mid = 0.5 * (low + high), y[2] = {x[0] + mid * e[0], x[1] + mid * e[1]};

    if (mid <= low || mid >= high) break;
    PetscCall(figure->distance(figure->ctx, y, &d));
    if (d >= 0) high = mid;
    else low = mid;
  }
  *u = 0.5 * (low + high);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* To the middle between the two sides; x is inside */
static PetscErrorCode centre_front(const MidlineFigure *figure, Front *f)
{
  const PetscReal left[2] = {-f->t[1], f->t[0]}, right[2] = {f->t[1], -f->t[0]};
  PetscReal       u, v;

  PetscFunctionBeginUser;
  PetscCall(find_side(figure, f->x, left, &u));
  PetscCall(find_side(figure, f->x, right, &v));
  for (PetscInt a = 0; a < 2; a++) f->x[a] += 0.5 * (u - v) * left[a];
  f->width = u + v;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void turn_front(Front *f, const PetscReal from[2])
{
  const PetscReal r[2] = {f->x[0] - from[0], f->x[1] - from[1]}, size = PetscSqrtReal(r[0] * r[0] + r[1] * r[1]);

  for (PetscInt a = 0; a < 2 && size > 0; a++) f->t[a] = r[a] / size;
}

/* In the middle of the figure, as far as it has one: across from the point of the surface */
static PetscErrorCode find_start(const MidlineFigure *figure, Front *f)
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 2; a++) f->x[a] = figure->wall[a] - 1e-7 * figure->radius * figure->normal[a];
  f->t[0] = -figure->normal[1];
  f->t[1] = figure->normal[0];
  PetscCall(centre_front(figure, f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_point(Midline m, const PetscReal x[2])
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(m->n + 1, &m->capacity, &m->x, sizeof(*m->x), NULL));
  m->x[m->n][0]   = x[0];
  m->x[m->n++][1] = x[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Points from front f (left out) to the tip ahead; *whole: is there a tip? */
static PetscErrorCode step_to_tip(Midline m, const MidlineFigure *figure, Front f, PetscBool *whole)
{
  const PetscReal step         = figure->radius / STEPS;
  PetscReal       curvature[2] = {0, 0};

  PetscFunctionBeginUser;
  *whole = PETSC_FALSE;
  for (PetscInt i = 0; i < MAX_STEPS; i++) {
    const Front old  = f;
    PetscReal   t[2] = {f.t[0] + curvature[0], f.t[1] + curvature[1]}, size = PetscSqrtReal(t[0] * t[0] + t[1] * t[1]),
              step_length;

    for (PetscInt a = 0; a < 2; a++) f.t[a] = t[a] / size;
    PetscCall(find_side(figure, f.x, f.t, &step_length));
    if (step_length <= 1.3 * step) {
      for (PetscInt a = 0; a < 2; a++) f.x[a] += step_length * f.t[a];
      PetscCall(add_point(m, f.x));
      m->area += 0.5 * step_length * old.width;
      *whole = PETSC_TRUE;
      break;
    }
    for (PetscInt a = 0; a < 2; a++) f.x[a] += step * f.t[a];
    PetscCall(centre_front(figure, &f));
    turn_front(&f, old.x);
    for (PetscInt a = 0; a < 2; a++) curvature[a] = i ? f.t[a] - old.t[a] : 0; /* the first direction is a guess */
    PetscCall(add_point(m, f.x));
    m->thickness = PetscMax(m->thickness, f.width);
    m->area += 0.5 * (f.width + old.width) * PetscSqrtReal(PetscSqr(f.x[0] - old.x[0]) + PetscSqr(f.x[1] - old.x[1]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode reverse_points(Midline m)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m->n / 2; i++) {
    for (PetscInt a = 0; a < 2; a++) {
      const PetscReal t = m->x[i][a];

      m->x[i][a]            = m->x[m->n - 1 - i][a];
      m->x[m->n - 1 - i][a] = t;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Lengths of the chords between the points, added up */
static PetscErrorCode measure_line(Midline m)
{
  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(m->n, &m->s));
  m->s[0] = 0;
  for (PetscInt i = 1; i < m->n; i++)
    m->s[i] = m->s[i - 1] +
              PetscSqrtReal(PetscSqr(m->x[i][0] - m->x[i - 1][0]) + PetscSqr(m->x[i][1] - m->x[i - 1][1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode MidlineCreate(const MidlineFigure *figure, Midline *line)
{
  Midline   m;
  Front     f;
  PetscBool whole[2] = {PETSC_FALSE, PETSC_FALSE};

  PetscFunctionBeginUser;
  *line = NULL;
  PetscCall(PetscNew(&m));
  PetscCall(find_start(figure, &f));
  m->thickness = f.width;
  PetscCall(step_to_tip(m, figure, f, &whole[0]));
  PetscCall(reverse_points(m));
  PetscCall(add_point(m, f.x));
  for (PetscInt a = 0; a < 2; a++) f.t[a] = -f.t[a];
  PetscCall(step_to_tip(m, figure, f, &whole[1]));
  PetscCall(measure_line(m));
  if (whole[0] && whole[1] && m->n >= 4 && m->s[m->n - 1] >= SLENDER * m->thickness) {
    if (PetscAbsReal(m->area - figure->area) <= MISSING * figure->area) *line = m;
  }
  if (!*line) PetscCall(MidlineDestroy(&m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MidlineScale(Midline from, PetscReal scale, Midline *line)
{
  Midline m;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&m));
  *m           = *from;
  m->capacity  = m->n;
  m->thickness = scale * from->thickness;
  m->area      = scale * scale * from->area;
  m->x         = NULL;
  PetscCall(PetscMalloc1(m->n, &m->x));
  PetscCall(PetscMalloc1(m->n, &m->s));
  for (PetscInt i = 0; i < m->n; i++) {
    for (PetscInt a = 0; a < 2; a++) m->x[i][a] = scale * from->x[i][a];
    m->s[i] = scale * from->s[i];
  }
  *line = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MidlineDestroy(Midline *line)
{
  PetscFunctionBeginUser;
  if (!*line) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree((*line)->x));
  PetscCall(PetscFree((*line)->s));
  PetscCall(PetscFree(*line));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MidlineGetSize(Midline m, PetscReal *length, PetscReal *thickness)
{
  PetscFunctionBeginUser;
  if (length) *length = m->s[m->n - 1];
  if (thickness) *thickness = m->thickness;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MidlinePoint(Midline m, PetscInt n, const PetscReal s[], PetscReal y[])
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n; e++) {
    PetscInt low = 0, high = m->n - 1, first;

    while (high - low > 1) {
      const PetscInt mid = (low + high) / 2;

      if (m->s[mid] <= s[e]) low = mid;
      else high = mid;
    }
    first    = PetscMax(0, PetscMin(low - 1, m->n - 4)); /* Lagrange's polynomial of four points */
    y[2 * e] = y[2 * e + 1] = 0;
    for (PetscInt i = first; i < first + 4; i++) {
      PetscReal weight = 1;

      for (PetscInt j = first; j < first + 4; j++)
        if (j != i) weight *= (s[e] - m->s[j]) / (m->s[i] - m->s[j]);
      for (PetscInt a = 0; a < 2; a++) y[2 * e + a] += weight * m->x[i][a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MidlineProject(Midline m, PetscInt n, const PetscReal x[], PetscReal s[], PetscReal d[])
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n; e++) {
    PetscReal best = PETSC_MAX_REAL, side = 1;

    for (PetscInt i = 0; i + 1 < m->n; i++) {
      const PetscReal t[2]   = {m->x[i + 1][0] - m->x[i][0], m->x[i + 1][1] - m->x[i][1]},
                      r[2]   = {x[2 * e] - m->x[i][0], x[2 * e + 1] - m->x[i][1]};
      const PetscReal length = m->s[i + 1] - m->s[i],
                      along  = PetscMin(1, PetscMax(0, (t[0] * r[0] + t[1] * r[1]) / PetscSqr(length)));
      const PetscReal d2     = PetscSqr(r[0] - along * t[0]) + PetscSqr(r[1] - along * t[1]);

      if (d2 >= best) continue;
      best = d2;
      side = t[0] * r[1] - t[1] * r[0] >= 0 ? 1 : -1;
      s[e] = m->s[i] + along * length;
    }
    d[e] = side * PetscSqrtReal(best);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
