/* Border: nearest places of curved faces, touches along walls, in corners, at edges and free ends, inside and
   outside. */
/* ranks: 1 */
#include "compat.h"
#include "base/border.h"
#include "base/face.h"
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

#define OK(call) assert_int_equal(call, 0)

static void near(PetscReal got, PetscReal want, PetscReal tolerance)
{
  if (!(PetscAbsReal(got - want) <= tolerance))
    fail_msg("%.17g differs from %.17g by more than %g", (double)got, (double)want, (double)tolerance);
}

/* ---- borders in the plane: polygons, the domain to the left of their sides ---- */

typedef struct {
  PetscInt   n, last;
  BorderFace face[256];
} Outline;

/* A straight side in `parts` faces, from a to b; nodes that are given have these numbers */
static void add_side(Outline *o, PetscInt boundary, PetscInt parts, const PetscReal a[2], PetscInt first,
                     const PetscReal b[2], PetscInt end)
{
  for (PetscInt p = 0; p < parts; p++) {
    BorderFace *f = &o->face[o->n++];

    *f      = (BorderFace){.boundary = boundary,
                           .node     = {p ? o->last : first, 1000 + 2 * o->n, p == parts - 1 ? end : 1001 + 2 * o->n}};
    o->last = f->node[2];
    for (PetscInt i = 0; i < 3; i++)
      for (PetscInt d = 0; d < 2; d++) f->x[i][d] = a[d] + (p + 0.5 * i) / parts * (b[d] - a[d]);
    f->inside[0] = f->x[1][0] - 0.1 * (b[1] - a[1]) / parts;
    f->inside[1] = f->x[1][1] + 0.1 * (b[0] - a[0]) / parts;
  }
}

/* The polygon of corners x [n], boundary of each side, -1: none */
static void add_polygon(Outline *o, PetscInt n, const PetscReal x[][2], const PetscInt boundary[], PetscInt parts)
{
  for (PetscInt i = 0; i < n; i++)
    if (boundary[i] >= 0) add_side(o, boundary[i], parts, x[i], i, x[(i + 1) % n], (i + 1) % n);
}

static Border create_border(const Outline *o)
{
  Border b;

  OK(BorderCreate(2, &b));
  OK(BorderAdd(b, "wall", PETSC_TRUE));
  OK(BorderAdd(b, "hole", PETSC_FALSE));
  OK(BorderSetFaces(b, o->n, o->face));
  return b;
}

/* All touches of a ball about x; the places of the last piece that is touched */
static PetscInt count_touches(Border b, PetscReal x, PetscReal y, PetscReal z, PetscReal reach, BorderPoint place[])
{
  const PetscReal at[3] = {x, y, z};
  const PetscInt *piece;
  PetscInt        n, m, all = 0, list[64];
  BorderPoint     now[BORDER_TOUCHES];

  OK(BorderFindNear(b, at, reach, &n, &piece));
  for (PetscInt i = 0; i < n; i++) list[i] = piece[i];
  for (PetscInt i = 0; i < n; i++) {
    OK(BorderTouch(b, list[i], at, reach, &m, now));
    for (PetscInt k = 0; k < m; k++) place[all++] = now[k];
  }
  return all;
}

static const PetscReal SQUARE[4][2] = {{0, 0}, {2, 0}, {2, 1}, {0, 1}};

static void test_square(void **state)
{
  const PetscInt sides[4] = {0, 0, 0, 0};
  Outline        o        = {0};
  BorderPoint    p[64];
  PetscInt       n, boundary;
  PetscReal      gap;
  Border         b;

  (void)state;
  add_polygon(&o, 4, SQUARE, sides, 8);
  b = create_border(&o);
  OK(BorderGetPieces(b, &n));
  assert_int_equal(n, 4);
  for (PetscInt i = 0; i <= 200; i++) { /* over faces and where they join: one touch along a wall */
    assert_int_equal(count_touches(b, 0.5 + i / 200., 0.3, 0, 0.4, p), 1);
    near(p[0].gap, 0.3, 1e-14);
    near(p[0].normal[1], 1, 1e-14);
    near(p[0].normal[0], 0, 1e-14);
  }
  assert_int_equal(count_touches(b, 0.2, 0.3, 0, 0.4, p), 2); /* a corner */
  near(p[0].gap + p[1].gap, 0.5, 1e-14);
  assert_int_equal(count_touches(b, 1, 0.5, 0, 0.4, p), 0);
  assert_int_equal(count_touches(b, 1, -0.1, 0, 0.4, p), 1); /* in the wall */
  near(p[0].gap, -0.1, 1e-14);
  near(p[0].normal[1], 1, 1e-14);
  OK(BorderLocate(b, (const PetscReal[]){1.9, -0.3, 0}, PETSC_MAX_REAL, &boundary, &gap));
  near(gap, -0.3, 1e-14);
  OK(BorderLocate(b, (const PetscReal[]){1.9, 0.3, 0}, PETSC_MAX_REAL, &boundary, &gap));
  near(gap, 0.1, 1e-14);
  OK(BorderLocate(b, (const PetscReal[]){-0.3, -0.4, 0}, PETSC_MAX_REAL, &boundary, &gap));
  near(gap, -0.5, 1e-14);
  OK(BorderDestroy(&b));
}

/* An edge that points into the domain is one touch, whatever pieces meet there, and the same in any order of faces */
static void test_nose(void **state)
{
  const PetscReal x[6][2]  = {{0, 0}, {1, 0}, {1, 1}, {2, 1}, {2, 3}, {0, 3}};
  const PetscInt  sides[6] = {0, 0, 0, 0, 0, 0};
  Outline         o        = {0};
  BorderPoint     p[64], q[64];
  Border          b, turned;

  (void)state;
  add_polygon(&o, 6, x, sides, 3);
  b = create_border(&o);
  for (PetscInt i = 0; i < o.n / 2; i++) {
    const BorderFace f = o.face[i];

    o.face[i]           = o.face[o.n - 1 - i];
    o.face[o.n - 1 - i] = f;
  }
  turned = create_border(&o);
  assert_int_equal(count_touches(b, 0.7, 1.4, 0, 0.55, p), 1);
  near(p[0].gap, 0.5, 1e-14);
  near(p[0].normal[0], -0.6, 1e-14);
  near(p[0].normal[1], 0.8, 1e-14);
  assert_int_equal(count_touches(turned, 0.7, 1.4, 0, 0.55, q), 1);
  near(q[0].gap, p[0].gap, 0);
  assert_int_equal(count_touches(b, 1 - 1e-12, 1.4, 0, 0.5, p), 1);
  assert_int_equal(count_touches(b, 1.2, 1.4, 0, 0.5, p), 1);
  assert_int_equal(count_touches(b, 0.6, 0.3, 0, 0.45, p), 2); /* floor and riser */
  OK(BorderDestroy(&b));
  OK(BorderDestroy(&turned));
}

/* A floor with a hole: its edge keeps bodies off on all sides, what is below the hole has left by it */
static void test_free_end(void **state)
{
  const PetscReal x[6][2]     = {{0, 0}, {0.5, 0}, {1.5, 0}, {2, 0}, {2, 1}, {0, 1}};
  const PetscInt  sides[6]    = {0, 1, 0, 0, 0, 0};
  const PetscReal point[2][3] = {{0.6, -0.1, 0}, {0.4, -0.1, 0}}, centre[3] = {0.5, 0.2, 0};
  Outline         o = {0};
  BorderPoint     p[64];
  const PetscInt *piece;
  PetscInt        n, boundary, floor = 0;
  PetscReal       gap;
  Border          b;

  (void)state;
  add_polygon(&o, 6, x, sides, 2);
  b = create_border(&o);
  assert_int_equal(count_touches(b, 0.6, 0.1, 0, 0.2, p), 1);
  near(p[0].gap, 0.1 * PetscSqrtReal(2), 1e-14);
  near(p[0].normal[0], PetscSqrtReal(0.5), 1e-14);
  assert_int_equal(count_touches(b, 1, 0.1, 0, 0.2, p), 0);
  OK(BorderFindNear(b, centre, 0.5, &n, &piece));
  for (PetscInt i = 0, found = 0; i < n && !found; i++) { /* the part left of the hole */
    OK(BorderNearest(b, floor = piece[i], (const PetscReal[]){0.4, 0.1, 0}, 1, p));
    found = PetscAbsReal(p->gap - 0.1) < 1e-14;
  }
  OK(BorderTouchPoints(b, floor, centre, 0.4, 0.2, 2, point, p));
  near(p[0].gap, 0.1 * PetscSqrtReal(2), 1e-14);
  near(p[1].gap, -0.1, 1e-14);
  OK(BorderLocate(b, point[0], 0.5, &boundary, &gap));
  assert_int_equal(boundary, 1);
  near(gap, -0.1, 1e-14);
  OK(BorderDestroy(&b));
}

/* A wall between two rooms, thinner than a ball: the far side of it is no touch */
static void test_thin_wall(void **state)
{
  const PetscReal x[8][2]  = {{0, 0}, {2, 0}, {2, 1}, {1.02, 1}, {1.02, 0.2}, {1, 0.2}, {1, 1}, {0, 1}};
  const PetscInt  sides[8] = {0, 0, 0, 0, 0, 0, 0, 0};
  Outline         o        = {0};
  BorderPoint     p[64];
  Border          b;

  (void)state;
  add_polygon(&o, 8, x, sides, 4);
  b = create_border(&o);
  assert_int_equal(count_touches(b, 0.9, 0.6, 0, 0.2, p), 1);
  near(p[0].gap, 0.1, 1e-14);
  near(p[0].normal[0], -1, 1e-14);
  OK(BorderDestroy(&b));
}

/* A polygon of many sides is smooth: pieces share it, and where they meet nothing is counted twice */
static void test_round_polygon(void **state)
{
  Outline     o = {0};
  PetscReal   x[48][2];
  PetscInt    sides[48] = {0}, n;
  BorderPoint p[64];
  Border      b;

  (void)state;
  for (PetscInt i = 0; i < 48; i++) {
    x[i][0] = -PetscCosReal(2 * PETSC_PI * i / 48);
    x[i][1] = -PetscSinReal(2 * PETSC_PI * i / 48);
  }
  add_polygon(&o, 48, x, sides, 1);
  b = create_border(&o);
  OK(BorderGetPieces(b, &n));
  assert_in_range(n, 4, 12);
  for (PetscInt i = 0; i < 48; i++) { /* the middle of every side */
    const PetscReal a = 2 * PETSC_PI * (i + 0.5) / 48, s = PetscCosReal(PETSC_PI / 48) - 0.3;

    assert_int_equal(count_touches(b, s * PetscCosReal(a), s * PetscSinReal(a), 0, 0.3 + 1e-9, p), 1);
    near(p[0].gap, 0.3, 1e-12);
    near(p[0].normal[0], -PetscCosReal(a), 1e-9);
  }
  OK(BorderDestroy(&b));
}

/* ---- curved faces ---- */

/* A parabola y = x^2/2, from -1 to 1: nearest places by brute force, curvature 1 at its lowest point, seen from above
   -1 */
static void test_parabola(void **state)
{
  const PetscReal x[3][3] = {{-1, 0.5, 0}, {0, 0, 0}, {1, 0.5, 0}};
  PetscReal       n[3], K[9];
  FacePoint       f, g;

  (void)state;
  for (PetscInt i = 0; i < 60; i++) {
    const PetscReal p[3] = {-1.5 + 3 * i / 59., 0.8 * PetscSinReal(3 * i), 0};
    PetscReal       best = PETSC_MAX_REAL;

    FaceNearest(2, x, p, &f);
    for (PetscInt k = 0; k <= 20000; k++) {
      const PetscReal s = -1 + k / 10000.;

      best = PetscMin(best, PetscSqrtReal(PetscSqr(s - p[0]) + PetscSqr(0.5 * s * s - p[1])));
    }
    near(f.distance, best, 1e-5);
    assert_true(f.distance <= best + 1e-14);
  }
  FaceEvaluate(2, x, (const PetscReal[]){0, 0}, &g);
  FaceNormal(2, &g, n);
  FaceCurvature(2, &g, n, K);
  near(n[1], 1, 1e-15);
  near(K[0], -1, 1e-14);
  near(K[4], 0, 1e-14);
}

/* In space: z = (x^2 + 2 y^2)/4 on a skewed patch has curvatures 1/2 and 1 at its lowest point; nearest by brute
   force */
static void test_patch(void **state)
{
  PetscReal x[9][3], n[3], K[9];
  FacePoint f;

  (void)state;
  for (PetscInt i = 0; i < 9; i++) {
    x[i][0] = i % 3 - 1 + 0.3 * (i / 3 - 1);
    x[i][1] = i / 3 - 1;
    x[i][2] = 0.25 * (PetscSqr(x[i][0]) + 2 * PetscSqr(x[i][1]));
  }
  FaceEvaluate(3, (const PetscReal(*)[3])x, (const PetscReal[]){0, 0}, &f);
  FaceNormal(3, &f, n);
  FaceCurvature(3, &f, n, K);
  near(n[2], 1, 1e-15);
  near(K[0], -0.5, 1e-14);
  near(K[4], -1, 1e-14);
  near(K[1], 0, 1e-14);
  for (PetscInt i = 0; i < 30; i++) {
    const PetscReal p[3] = {1.4 * PetscSinReal(2 * i), 1.3 * PetscCosReal(5 * i), 0.7 * PetscSinReal(7 * i)};
    PetscReal       best = PETSC_MAX_REAL;

    FaceNearest(3, (const PetscReal(*)[3])x, p, &f);
    for (PetscInt k = 0; k < 401 * 401; k++) {
      const PetscReal v = -1 + k / 401 / 200., u = -1 + k % 401 / 200. + 0.3 * v;

      best = PetscMin(best, PetscSqrtReal(PetscSqr(u - p[0]) + PetscSqr(v - p[1]) +
                                          PetscSqr(0.25 * (u * u + 2 * v * v) - p[2])));
    }
    near(f.distance, best, 1e-4);
    assert_true(f.distance <= best + 1e-12);
  }
}

/* ---- closed forms ---- */

static void test_rounds(void **state)
{
  const BorderRound shape[3] = {{{1, 2, 0}, 0.5, -1, PETSC_FALSE},
                                {{1, 2, 0}, 2, 2, PETSC_TRUE},
                                {{1, 2, 3}, 2, -1, PETSC_TRUE}};
  const PetscReal   x[3]     = {1.6, 2.8, 3}; /* 1 from the centre */
  const PetscReal   gap[3] = {0.5, 1, 1}, side[3] = {1, -1, -1};

  (void)state;
  for (PetscInt i = 0; i < 3; i++) {
    BorderPoint p;
    PetscInt    boundary, n;
    PetscReal   d;
    Border      b;

    OK(BorderCreate(i ? 3 : 2, &b));
    OK(BorderAdd(b, "outer", PETSC_TRUE));
    OK(BorderAddRound(b, 0, &shape[i]));
    OK(BorderTouch(b, 0, (const PetscReal[]){x[0], x[1], i ? 3 : 0}, 2, &n, &p));
    assert_int_equal(n, 1);
    near(p.gap, gap[i], 1e-14);
    near(p.normal[0], side[i] * 0.6, 1e-14);
    near(p.normal[1], side[i] * 0.8, 1e-14);
    near(p.K[0] + p.K[4] + p.K[8], side[i] * (i == 2 ? 2 : 1) / shape[i].radius, 1e-14);
    near(p.K[0] * p.normal[0] + p.K[1] * p.normal[1], 0, 1e-14);
    OK(BorderLocate(b, (const PetscReal[]){3.4, 5.2, i ? 3 : 0}, 1, &boundary, &d));
    if (i) near(d, -2, 1e-14);
    else assert_int_equal(boundary, -1);
    OK(BorderDestroy(&b));
  }
}

/* A cube of 3 x 3 faces a side: one touch at a side, two along an edge, three in a corner */
static void test_cube(void **state)
{
  static BorderFace face[54];
  PetscInt          n = 0, pieces;
  BorderPoint       p[64];
  Border            b;

  (void)state;
  for (PetscInt side = 0; side < 6; side++)
    for (PetscInt e = 0; e < 9; e++, n++) {
      face[n] = (BorderFace){.inside = {0.5, 0.5, 0.5}};
      for (PetscInt i = 0; i < 9; i++) {
        PetscInt at[3];

        at[side / 2]           = side % 2 ? 6 : 0;
        at[(side / 2 + 1) % 3] = 2 * (e % 3) + i % 3;
        at[(side / 2 + 2) % 3] = 2 * (e / 3) + i / 3;
        face[n].node[i]        = at[0] + 7 * (at[1] + 7 * at[2]);
        for (PetscInt d = 0; d < 3; d++) face[n].x[i][d] = at[d] / 6.;
      }
    }
  OK(BorderCreate(3, &b));
  OK(BorderAdd(b, "cube", PETSC_TRUE));
  OK(BorderSetFaces(b, n, face));
  OK(BorderGetPieces(b, &pieces));
  assert_int_equal(pieces, 6);
  for (PetscInt i = 0; i < 7; i++) assert_int_equal(count_touches(b, 0.3 + i / 15., 1. / 3, 0.1, 0.2, p), 1);
  assert_int_equal(count_touches(b, 0.4, 0.15, 0.1, 0.2, p), 2);
  assert_int_equal(count_touches(b, 0.12, 0.15, 0.9, 0.2, p), 3);
  OK(BorderDestroy(&b));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_square),    cmocka_unit_test(test_nose),          cmocka_unit_test(test_free_end),
    cmocka_unit_test(test_thin_wall), cmocka_unit_test(test_round_polygon), cmocka_unit_test(test_parabola),
    cmocka_unit_test(test_patch),     cmocka_unit_test(test_rounds),        cmocka_unit_test(test_cube),
  };
  int failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  return PetscFinalize() || failed;
}
