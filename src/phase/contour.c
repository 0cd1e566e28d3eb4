/* PhaseContour: see phase/contour.h. Marching squares on a lattice; places on its lines, and the middles of edges, by
   bisection. */
#include "compat.h"
#include "phase/contour.h"
#include "base/array.h"

#define FINE       4       /* lattice lines in a length */
#define MAX_POINTS 1000000 /* points of the lattice */
#define HALVINGS   52
#define TIP        1e-9 /* of a lattice line: so far is a place from its ends */

typedef struct {
  PhaseField field;
  void      *ctx;
  PetscInt   m[2];
  PetscReal  lower[2], step[2];
  PetscReal *v; /* [m[1] + 1][m[0] + 1] */
  /* lines along x, then those along y: where the function is zero on them */
  PetscInt    nline;
  PetscReal  *x; /* [nline][2] */
  PetscInt    drop, *n, *capacity;
  PhaseEdge **edge;
} Contour;

static PetscInt place_of(const Contour *c, PetscInt i, PetscInt j)
{
  return j * (c->m[0] + 1) + i;
}

static void position(const Contour *c, PetscInt place, PetscReal x[2])
{
  x[0] = c->lower[0] + c->step[0] * (PetscReal)(place % (c->m[0] + 1));
  x[1] = c->lower[1] + c->step[1] * (PetscReal)(place / (c->m[0] + 1));
}

static PetscBool is_inside(const Contour *c, PetscInt place)
{
  return (PetscBool)(c->v[place] < 0);
}

/* Line of the lattice from a place along an axis */
static PetscInt line_of(PetscInt place, PetscInt axis)
{
  return 2 * place + axis;
}

static PetscErrorCode evaluate_lattice(Contour *c)
{
  const PetscInt n = (c->m[0] + 1) * (c->m[1] + 1);
  PetscReal     *x;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(2 * n, &x));
  for (PetscInt p = 0; p < n; p++) position(c, p, x + 2 * p);
  PetscCall((*c->field)(c->ctx, n, x, c->v));
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Between a [n][2], inside, and b, outside: x becomes the zero */
static PetscErrorCode bisect(const Contour *c, PetscInt n, PetscReal a[], PetscReal b[], PetscReal x[])
{
  PetscReal *v;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &v));
  for (PetscInt k = 0; k < HALVINGS; k++) {
    for (PetscInt i = 0; i < 2 * n; i++) x[i] = 0.5 * (a[i] + b[i]);
    PetscCall((*c->field)(c->ctx, n, x, v));
    for (PetscInt i = 0; i < 2 * n; i++) (v[i / 2] < 0 ? a : b)[i] = x[i];
  }
  PetscCall(PetscFree(v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode cross_lines(Contour *c)
{
  PetscInt  *which, n = 0;
  PetscReal *a, *b, *x;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc4(c->nline, &which, 2 * c->nline, &a, 2 * c->nline, &b, 2 * c->nline, &x));
  for (PetscInt j = 0; j <= c->m[1]; j++)
    for (PetscInt i = 0; i <= c->m[0]; i++)
      for (PetscInt axis = 0; axis < 2; axis++) {
        const PetscInt p = place_of(c, i, j), q = place_of(c, i + (axis == 0), j + (axis == 1));
        PetscReal      y[2][2];

        if ((axis ? j : i) == c->m[axis] || is_inside(c, p) == is_inside(c, q)) continue;
        position(c, is_inside(c, p) ? p : q, y[0]);
        position(c, is_inside(c, p) ? q : p, y[1]);
        for (PetscInt k = 0; k < 2; k++) {
          a[2 * n + k] = y[0][k] + TIP * (y[1][k] - y[0][k]);
          b[2 * n + k] = y[1][k] + TIP * (y[0][k] - y[1][k]);
        }
        which[n++] = line_of(p, axis);
      }
  PetscCall(bisect(c, n, a, b, x));
  for (PetscInt i = 0; i < n; i++) PetscCall(PetscArraycpy(c->x + 2 * which[i], x + 2 * i, 2));
  PetscCall(PetscFree4(which, a, b, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- edges ---- */

/* From one end to the other: a line's number, or -1 less a place of the lattice */
static PetscErrorCode add_edge(Contour *c, PetscInt from, PetscInt to, PetscBool wall)
{
  const PetscInt end[2] = {from, to};
  PhaseEdge     *e;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(*c->n + 1, c->capacity, c->edge, sizeof(**c->edge), NULL));
  e       = *c->edge + *c->n;
  e->drop = (PetscReal)c->drop;
  e->wall = wall ? 1 : 0;
  for (PetscInt k = 0; k < 2; k++) {
    e->key[2 * k][0] = (PetscReal)end[k];
    e->key[2 * k][1] = (PetscReal)c->drop;
    if (end[k] >= 0) PetscCall(PetscArraycpy(e->x[2 * k], c->x + 2 * end[k], 2));
    else position(c, -1 - end[k], e->x[2 * k]);
  }
  e->key[1][0] = (PetscReal)c->drop;
  e->key[1][1] = (PetscReal)*c->n;
  for (PetscInt a = 0; a < 2; a++) e->x[1][a] = 0.5 * (e->x[0][a] + e->x[2][a]);
  *c->n += 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The inside of a cell goes round it; where it leaves a side for the outside an edge begins, to where it comes back */
static PetscErrorCode add_cell(Contour *c, PetscInt i, PetscInt j)
{
  const PetscInt corner[4] = {place_of(c, i, j), place_of(c, i + 1, j), place_of(c, i + 1, j + 1),
                              place_of(c, i, j + 1)};
  const PetscInt line[4] = {line_of(corner[0], 0), line_of(corner[1], 1), line_of(corner[3], 0), line_of(corner[0], 1)};
  PetscInt       crossed = 0;
  PetscReal      x[2][2], middle[2], v = 0;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < 4; k++) crossed += is_inside(c, corner[k]) != is_inside(c, corner[(k + 1) % 4]);
  if (!crossed) PetscFunctionReturn(PETSC_SUCCESS);
  if (crossed == 4) {
    position(c, corner[0], x[0]);
    position(c, corner[2], x[1]);
    for (PetscInt a = 0; a < 2; a++) middle[a] = 0.5 * (x[0][a] + x[1][a]);
    PetscCall((*c->field)(c->ctx, 1, middle, &v));
  }
  for (PetscInt k = 0; k < 4; k++) {
    const PetscInt turn = crossed == 4 && v >= 0 ? 3 : 1;
    PetscInt       to   = (k + turn) % 4;

    if (!is_inside(c, corner[k]) || is_inside(c, corner[(k + 1) % 4])) continue;
    while (is_inside(c, corner[to]) || !is_inside(c, corner[(to + 1) % 4])) to = (to + turn) % 4;
    PetscCall(add_edge(c, line[k], line[to], PETSC_FALSE));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Along a side of the box, from a place to the next one, by a line between them */
static PetscErrorCode add_side(Contour *c, PetscInt p, PetscInt q, PetscInt line)
{
  PetscFunctionBeginUser;
  if (!is_inside(c, p) && !is_inside(c, q)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(add_edge(c, is_inside(c, p) ? -1 - p : line, is_inside(c, q) ? -1 - q : line, PETSC_TRUE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_sides(Contour *c)
{
  PetscFunctionBeginUser;
  for (PetscInt axis = 0; axis < 2; axis++)
    for (PetscInt upper = 0; upper < 2; upper++)
      for (PetscInt k = 0; k < c->m[axis]; k++) {
        const PetscInt across   = upper ? c->m[1 - axis] : 0;
        const PetscInt p        = axis ? place_of(c, across, k) : place_of(c, k, across),
                       q        = axis ? place_of(c, across, k + 1) : place_of(c, k + 1, across);
        const PetscBool counter = (PetscBool)((axis == 0) == (upper == 0)); /* the box on the left */

        PetscCall(add_side(c, counter ? p : q, counter ? q : p, line_of(p, axis)));
      }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Middles of the edges from `begin` on, across their chord */
static PetscErrorCode place_middles(Contour *c, PetscInt begin)
{
  PetscInt   m = 0, *which;
  PetscReal *a, *b, *x, *v;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc5(*c->n, &which, 2 * *c->n, &a, 2 * *c->n, &b, 2 * *c->n, &x, 2 * *c->n, &v));
  for (PetscInt e = begin; e < *c->n; e++) {
    const PhaseEdge *edge = *c->edge + e;
    const PetscReal  t[2] = {edge->x[2][0] - edge->x[0][0], edge->x[2][1] - edge->x[0][1]};

    if (edge->wall != 0) continue;
    a[2 * m]     = edge->x[1][0] - 0.4 * t[1]; /* the inside is on the left */
    a[2 * m + 1] = edge->x[1][1] + 0.4 * t[0];
    b[2 * m]     = edge->x[1][0] + 0.4 * t[1];
    b[2 * m + 1] = edge->x[1][1] - 0.4 * t[0];
    which[m++]   = e;
  }
  PetscCall((*c->field)(c->ctx, m, a, v));
  PetscCall((*c->field)(c->ctx, m, b, v + m));
  for (PetscInt i = 0; i < m; i++)
    if (!(v[i] < 0 && v[m + i] >= 0)) which[i] = -1; /* the chord serves */
  PetscCall(bisect(c, m, a, b, x));
  for (PetscInt i = 0; i < m; i++)
    if (which[i] >= 0) PetscCall(PetscArraycpy((*c->edge)[which[i]].x[1], x + 2 * i, 2));
  PetscCall(PetscFree5(which, a, b, x, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseContourTrace(const PhaseBox *box, PhaseField field, void *ctx, PetscInt drop, PetscInt *n,
                                 PetscInt *capacity, PhaseEdge **edge)
{
  Contour        c     = {.field = field, .ctx = ctx, .drop = drop, .n = n, .capacity = capacity, .edge = edge};
  const PetscInt begin = *n;
  PetscReal      area  = 1, step;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 2; a++) area *= box->upper[a] - box->lower[a];
  step = PetscMax(box->h / FINE, PetscSqrtReal(area / MAX_POINTS));
  for (PetscInt a = 0; a < 2; a++) {
    c.m[a]     = (PetscInt)PetscMax(2, PetscCeilReal((box->upper[a] - box->lower[a]) / step - 1e-6));
    c.lower[a] = box->lower[a];
    c.step[a]  = (box->upper[a] - box->lower[a]) / (PetscReal)c.m[a];
  }
  c.nline = 2 * (c.m[0] + 1) * (c.m[1] + 1);
  PetscCall(PetscMalloc2(c.nline / 2, &c.v, 2 * c.nline, &c.x));
  PetscCall(evaluate_lattice(&c));
  PetscCall(cross_lines(&c));
  for (PetscInt j = 0; j < c.m[1]; j++)
    for (PetscInt i = 0; i < c.m[0]; i++) PetscCall(add_cell(&c, i, j));
  PetscCall(add_sides(&c));
  PetscCall(place_middles(&c, begin));
  PetscCall(PetscFree2(c.v, c.x));
  PetscFunctionReturn(PETSC_SUCCESS);
}
