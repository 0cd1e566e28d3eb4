/* Curves of quadratic edges: area, length, centre and moments of an ellipse; closest points with their sign; holes and
   loops that overlap; a shift along the normals; who descends from whom; contact
   angles on what is solid. */
/* ranks: 1 2 */
#include "core.h"
#include "fem/edge.h"
#include "phase/drops.h"

#define EDGES 200

/* m ellipses [5]: centre, half axes, +1 or -1 for a hole */
static PhaseCurve ellipses(PetscInt m, const PetscReal of[][5], const PetscInt drop[])
{
  PhaseCurve c;

  (void)PhaseCurveCreate(m * EDGES, &c);
  for (PetscInt e = 0; e < c.n; e++) {
    const PetscInt k = e / EDGES, i = e % EDGES;

    for (PetscInt j = 0; j < 3; j++) {
      const PetscReal t = of[k][4] * PETSC_PI * (PetscReal)((2 * i + j) % (2 * EDGES)) / EDGES;

      c.x[e][j][0] = of[k][0] + of[k][2] * PetscCosReal(t);
      c.x[e][j][1] = of[k][1] + of[k][3] * PetscSinReal(t);
    }
    c.drop[e]   = drop[k];
    c.next[e]   = k * EDGES + (i + 1) % EDGES;
    c.before[e] = k * EDGES + (i + EDGES - 1) % EDGES;
  }
  PhaseCurveLink(&c);
  return c;
}

static void test_sums(void **state)
{
  const PetscReal of[1][5] = {{0.3, -0.2, 0.5, 0.25, 1}};
  const PetscInt  drop[1]  = {7};
  PhaseCurve      c        = ellipses(1, of, drop);
  PhaseSums       s;

  (void)state;
  PhaseCurveMeasure(&c, 7, &s);
  NEAR(s.area, PETSC_PI * 0.125, 1e-8);
  NEAR(s.length, 2.4221120551, 1e-7); /* 4 a E(3/4) */
  NEAR(s.centre[0], 0.3, 1e-10);
  NEAR(s.centre[1], -0.2, 1e-10);
  NEAR(s.second[0], 0.25 * 0.25, 1e-8);
  NEAR(s.second[1], 0.25 * 0.0625, 1e-8);
  BELOW(PetscAbsReal(s.second[2]), 1e-10);
  PhaseCurveMeasure(&c, 3, &s);
  assert_true(s.area == 0);
  (void)PhaseCurveDestroy(&c);
}

static void test_closest(void **state)
{
  const PetscReal of[3][5] = {{0, 0, 1, 1, 1}, {0, 0, 0.5, 0.5, -1}, {1.5, 0, 0.75, 0.75, 1}};
  const PetscInt  drop[3]  = {0, 0, 1};
  PhaseCurve      c        = ellipses(3, of, drop);
  PhasePoint      p;
  /* outside; in the drop; in its hole; where two overlap */
  const PetscReal x[4][2] = {{0, 3}, {0, 0.7}, {0.1, 0}, {0.9, 0}};
  const PetscReal d[4]    = {2, -0.2, 0.4, -0.15};

  (void)state;
  for (PetscInt i = 0; i < 4; i++) {
    PhaseCurveClosest(&c, x[i], 10, &p);
    NEAR(p.d, d[i], 1e-7);
  }
  PhaseCurveClosest(&c, x[0], 1, &p);
  assert_true(p.edge == -1 && p.d == 1);
  (void)PhaseCurveDestroy(&c);
}

/* A loop with a lobe that is the wrong way round, as a figure of eight: beyond the lobe is not inside, in it neither */
static void test_folded(void **state)
{
  PhaseCurve c;
  PhasePoint p;

  (void)state;
  (void)PhaseCurveCreate(EDGES, &c);
  for (PetscInt e = 0; e < EDGES; e++) {
    for (PetscInt j = 0; j < 3; j++) {
      const PetscReal t = PETSC_PI * (PetscReal)((2 * e + j) % (2 * EDGES)) / EDGES, x = PetscCosReal(t);

      c.x[e][j][0] = x > 0 ? 2 * x : x;
      c.x[e][j][1] = PetscSinReal(2 * t);
    }
    c.drop[e]   = 0;
    c.next[e]   = (e + 1) % EDGES;
    c.before[e] = (e + EDGES - 1) % EDGES;
  }
  PhaseCurveLink(&c);
  assert_true(c.nloop == 1 && c.area[0] > 0);
  for (PetscInt i = 0; i < 4; i++) {
    const PetscReal x[4][2] = {{1.4, 0}, {-0.7, 0}, {-3, 0.1}, {3, 0.1}};

    PhaseCurveClosest(&c, x[i], 10, &p);
    assert_true(i == 0 ? p.d < 0 : p.d > 0);
  }
  (void)PhaseCurveDestroy(&c);
}

static void test_shift(void **state)
{
  const PetscReal of[2][5] = {{0, 0, 1, 1, 1}, {5, 0, 1, 1, 1}};
  const PetscInt  drop[2]  = {0, 1};
  PhaseCurve      c        = ellipses(2, of, drop);
  PhaseSums       s;

  (void)state;
  (void)PhaseCurveShift(&c, 1, 0.1);
  PhaseCurveUpdate(&c);
  PhaseCurveMeasure(&c, 1, &s);
  NEAR(s.area, PETSC_PI * 1.21, 1e-6);
  PhaseCurveMeasure(&c, 0, &s);
  NEAR(s.area, PETSC_PI, 1e-6);
  (void)PhaseCurveDestroy(&c);
}

/* Edges that the ranks hand in by turns, a square across a period: four edges, put together */
static void test_gather(void **state)
{
  static const PetscReal P[8][2]   = {{0.9, 0.2}, {1, 0.2}, {0.1, 0.2}, {0.1, 0.3},
                                      {0.1, 0.4}, {0, 0.4}, {0.9, 0.4}, {0.9, 0.3}};
  const PetscReal        period[2] = {1, 0};
  PhaseEdge              edge[4];
  PhaseCurve             c;
  PhaseSums              s;
  PetscMPIInt            rank, size;
  PetscInt               n = 0;

  (void)state;
  (void)MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  (void)MPI_Comm_size(PETSC_COMM_WORLD, &size);
  for (PetscInt e = 3; e >= 0; e--) {
    if (e % size != rank) continue;
    for (PetscInt j = 0; j < 3; j++)
      for (PetscInt a = 0; a < 2; a++) {
        edge[n].key[j][a] = P[(2 * e + j) % 8][a] >= 1 ? 0 : P[(2 * e + j) % 8][a];
        edge[n].x[j][a]   = P[(2 * e + j) % 8][a];
      }
    if (e == 0) edge[n].x[2][0] += 1; /* this one ends beyond the period */
    if (e == 2) edge[n].x[2][0] -= 1;
    edge[n++].drop = 3;
  }
  (void)PhaseCurveGather(PETSC_COMM_WORLD, n, edge, period, &c);
  assert_true(c.n == 4 && c.nloop == 1);
  PhaseCurveMeasure(&c, 3, &s);
  NEAR(s.area, 0.04, 1e-12);
  (void)PhaseCurveDestroy(&c);
}

static PetscErrorCode two_circles(void *ctx, PetscInt n, const PetscReal x[], PetscReal value[])
{
  PetscFunctionBeginUser;
  (void)ctx;
  for (PetscInt i = 0; i < n; i++)
    value[i] = PetscMin(PetscHypotReal(x[2 * i] - 1, x[2 * i + 1]) - 0.4,
                        PetscHypotReal(x[2 * i] - 2, x[2 * i + 1] - 0.5) - 0.2);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Half a circle on the lower side of a box, and a circle: areas, lengths, the side, closest points; a
   shift at the wall */
static void test_contour(void **state)
{
  const PhaseBox  box     = {.h = 0.05, .lower = {0, 0}, .upper = {3, 1}};
  const PetscReal x[3][2] = {{1, 0}, {1.5, 0.01}, {2, 0.5}}, d[3] = {-0.4, 0.1, -0.2};
  PhaseEdge      *edge = NULL;
  PetscInt        n = 0, capacity = 0;
  PhaseCurve      c;
  PhaseSums       s;
  PhasePoint      p;

  (void)state;
  assert_true(!PhaseContourTrace(&box, two_circles, NULL, 0, &n, &capacity, &edge));
  assert_true(!PhaseCurveGather(PETSC_COMM_SELF, n, edge, NULL, &c));
  (void)PetscFree(edge);
  assert_true(c.nloop == 2);
  PhaseCurveMeasure(&c, 0, &s);
  NEAR(s.area, PETSC_PI * (0.08 + 0.04), 1e-7);
  NEAR(s.length, PETSC_PI * 0.8, 1e-7);
  NEAR(s.wet, 0.8, 1e-10);
  for (PetscInt i = 0; i < 3; i++) {
    PhaseCurveClosest(&c, x[i], 10, &p);
    NEAR(p.d, i == 1 ? PetscHypotReal(0.5, 0.01) - 0.4 : d[i], 1e-6);
  }
  assert_true(!PhaseCurveShift(&c, 0, 0.001));
  PhaseCurveUpdate(&c);
  PhaseCurveMeasure(&c, 0, &s);
  NEAR(s.area, PETSC_PI * (0.5 * 0.401 * 0.401 + 0.201 * 0.201), 1e-6);
  NEAR(s.wet, 0.802, 1e-6);
  (void)PhaseCurveDestroy(&c);
}

static const char OPTIONS[] =
  "-particle_groups a,b -particle_a_shape circle -particle_b_shape circle -particle_a_radius 1 -particle_b_radius 1 "
  "-particle_a_position 0,0 -particle_b_position 3,0 -particle_a_material fluid -particle_b_material fluid "
  "-particle_a_surface_tension 1 -particle_b_surface_tension 1";

/* These two drops, and the interface that they start with */
static DropsState *start(Drops *drops, PhaseInterface *from)
{
  const PhaseBox box = {.h = 0.1, .lower = {-9, -9}, .upper = {9, 9}};
  DropsState    *s;

  *from = (PhaseInterface){.sheet = {0}};
  (void)PetscOptionsInsertString(NULL, OPTIONS);
  assert_true(!DropsCreate(PETSC_COMM_WORLD, 2, drops));
  assert_true(!DropsGetState(*drops, &s));
  assert_true(!DropsStart(*drops, &box, &from->curve));
  return s;
}

/* A drop breaks into two, the larger keeps the number; what is left of nothing is lost */
static void test_descent(void **state)
{
  const PetscReal of[2][5]  = {{-0.4, 0, 0.3, 0.3, 1}, {0.5, 0, 0.5, 0.5, 1}};
  const PetscInt  part[2]   = {0, 1};
  const PetscReal volume[2] = {PETSC_PI * 0.09, PETSC_PI * 0.25};
  PetscInt        number[2];
  PetscBool       changed;
  PhaseInterface  from, now = {.curve = ellipses(2, of, part)};
  Drops           drops;
  DropsState     *s = start(&drops, &from);

  (void)state;
  NEAR(from.curve.area[0], PETSC_PI, 1e-8);
  assert_true(!DropsInherit(drops, &from, &now, 2, volume, number, &changed));
  assert_true(changed && s->n == 2 && s->broken == 1 && s->merged == 0 && number[1] == 0 && number[0] == 2);
  NEAR(s->lost, PETSC_PI, 1e-6);
  NEAR(s->drop[0].target + s->drop[1].target, PETSC_PI, 1e-6);
  NEAR(s->drop[0].target / s->drop[1].target, 0.25 / 0.09, 1e-12);
  (void)PhaseInterfaceDestroy(&from);
  (void)PhaseInterfaceDestroy(&now);
  (void)DropsDestroy(&drops);
}

/* Two drops of which in one step one breaks, and a piece of it merges with the other: an event of both kinds, whose
   volume is kept and of which the surface is told */
static void test_exchange(void **state)
{
  const PetscReal of[2][5]  = {{-0.5, 0, 0.4, 0.4, 1}, {2.1, 0, 1.9, 0.9, 1}};
  const PetscInt  part[2]   = {0, 1};
  const PetscReal volume[2] = {PETSC_PI * 0.16, PETSC_PI * 1.71};
  PetscInt        number[2];
  PetscBool       changed;
  PhaseInterface  from, now = {.curve = ellipses(2, of, part)};
  PhaseSums       sums[2];
  Drops           drops;
  DropsState     *s = start(&drops, &from);

  (void)state;
  assert_true(!DropsInherit(drops, &from, &now, 2, volume, number, &changed));
  assert_true(changed && s->n == 2 && s->broken == 1 && s->merged == 1 && s->lost == 0);
  NEAR(s->drop[0].target + s->drop[1].target, 2 * PETSC_PI, 1e-6);
  for (PetscInt i = 0; i < 2; i++) PhaseInterfaceMeasure(&now, i, &sums[i]);
  NEAR(s->taken, 4 * PETSC_PI - sums[0].length - sums[1].length, 1e-6);
  (void)PhaseInterfaceDestroy(&from);
  (void)PhaseInterfaceDestroy(&now);
  (void)DropsDestroy(&drops);
}

/* A disc of radius .4 at (1, .1) with the contact angle *ctx */
static PetscErrorCode disc(void *ctx, PetscInt n, const PetscReal x[], PetscReal d[], PetscReal angle[])
{
  for (PetscInt i = 0; i < n; i++) {
    d[i] = PetscHypotReal(x[2 * i] - 1, x[2 * i + 1] - 0.1) - 0.4;
    if (angle) angle[i] = *(const PetscReal *)ctx;
  }
  return PETSC_SUCCESS;
}

/* Angle inside the drop at which an edge, one end of which is in the disc, meets its surface */
static PetscReal angle_of(PetscReal (*const p)[2], PetscReal first)
{
  const PetscReal in  = first < 0 ? 1 : -1; /* -1: into the disc */
  PetscReal       low = -1, high = 1, y[2], t[2], d, n[2];

  for (PetscInt i = 0; i < 60; i++) {
    EdgeEvaluate(p, 0.5 * (low + high), y, t);
    (void)disc(NULL, 1, y, &d, NULL);
    *((d < 0) == (first < 0) ? &low : &high) = 0.5 * (low + high);
  }
  n[0] = (y[0] - 1) / 0.4;
  n[1] = (y[1] - 0.1) / 0.4;
  return PetscAcosReal(in * (t[0] * -in * n[1] + t[1] * in * n[0]) / PetscHypotReal(t[0], t[1]));
}

/* A drop into which a disc has come ends on it at the contact angle; elsewhere it is as before. */
static void test_meet(void **state)
{
  const PetscReal of[1][5] = {{0, 0, 1, 1, 1}};
  const PetscInt  drop[1]  = {4};

  (void)state;
  for (PetscReal angle = 0.8; angle < 2.5; angle += 0.4) {
    PhaseCurve c     = ellipses(1, of, drop);
    PetscInt   found = 0;
    PhasePoint p;

    assert_int_equal(PhaseCurveMeet(&c, &(PhaseSolid){.ctx = &angle, .h = 0.15, .distance = disc}), 0);
    assert_int_equal(c.nloop, 1);
    for (PetscInt e = 0; e < c.n; e++) {
      PetscReal d[3];

      assert_int_equal(c.drop[e], 4);
      BELOW(EdgeDistance2(c.x[e][2], c.x[c.next[e]][0]), 1e-28);
      (void)disc(NULL, 3, c.x[e][0], d, NULL);
      if ((d[0] < -1e-9 && d[2] > -1e-9) || (d[0] > 1e-9 && d[2] < 1e-9)) {
        NEAR(angle_of(c.x[e], d[0]), angle, 0.02);
        found++;
      }
    }
    assert_int_equal(found, 2);
    PhaseCurveClosest(&c, (const PetscReal[2]){-0.9, 0}, 1, &p);
    NEAR(p.d, -0.1, 1e-8);
    (void)PhaseCurveDestroy(&c);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_sums),    cmocka_unit_test(test_closest),
                                     cmocka_unit_test(test_folded),  cmocka_unit_test(test_shift),
                                     cmocka_unit_test(test_gather),  cmocka_unit_test(test_contour),
                                     cmocka_unit_test(test_descent), cmocka_unit_test(test_exchange),
                                     cmocka_unit_test(test_meet)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (ShapeFinalize() || OptFinalize() || PetscFinalize()) return 1;
  return failed;
}
