/* Drawn surfaces: closed, outwards, on the surface, and of the volume of the shape, edges and thin parts among them. */
/* ranks: 1 */
#include "core.h"
#include "raised.h"
#include "shape/host.h"
#include <stdlib.h>

#define MOST_DRAWN 4000

static int compare_halves(const void *a, const void *b)
{
  const PetscInt *p = a, *q = b;

  return p[0] != q[0] ? (p[0] < q[0] ? -1 : 1) : p[1] < q[1] ? -1 : p[1] > q[1];
}

/* Every edge is run along as often one way as the other. */
static void expect_closed(PetscInt n, const PetscInt triangle[])
{
  PetscInt *half;

  OK(PetscMalloc1(6 * n, &half));
  for (PetscInt i = 0; i < 3 * n; i++) {
    const PetscInt a = triangle[i], b = triangle[i / 3 * 3 + (i + 1) % 3];

    half[2 * i]     = PetscMin(a, b);
    half[2 * i + 1] = 2 * PetscMax(a, b) + (a < b);
  }
  qsort(half, (size_t)(3 * n), 2 * sizeof(PetscInt), compare_halves);
  for (PetscInt i = 0, j; i < 3 * n; i = j) {
    PetscInt sum = 0;

    for (j = i; j < 3 * n && half[2 * j] == half[2 * i] && half[2 * j + 1] / 2 == half[2 * i + 1] / 2; j++)
      sum += half[2 * j + 1] % 2 ? 1 : -1;
    assert_int_equal(sum, 0);
  }
  OK(PetscFree(half));
}

/* options: name, value, name, value, ..., NULL. error: of the volume, relative */
static void expect_drawn(const char type[], const char *const options[], PetscReal volume, PetscReal error)
{
  Shape      s;
  PetscInt   np, nt, *t;
  PetscReal *x, sum = 0;

  for (int i = 0; options[i]; i += 2) OK(PetscOptionsSetValue(NULL, options[i], options[i + 1]));
  OK(ShapeCreate(type, "t_", 3, &s));
  OK(ShapeTriangulate(s, MOST_DRAWN, &np, &x, &nt, &t));
  for (PetscInt i = 0; i < nt; i++) {
    const PetscReal *a = x + 3 * t[3 * i], *b = x + 3 * t[3 * i + 1], *c = x + 3 * t[3 * i + 2];

    sum += (a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
            a[2] * (b[0] * c[1] - b[1] * c[0])) /
           6;
    for (int k = 0; k < 3; k++) {
      PetscReal d;

      OK(ShapeDistance(s, 1, x + 3 * t[3 * i + k], &d));
      BELOW(d, 1e-8);
    }
  }
  expect_closed(nt, t);
  NEAR(sum, volume, error * volume);
  print_message("%s: volume %.6g drawn as %.6g by %d triangles\n", type, (double)volume, (double)sum, (int)nt);
  OK(PetscFree(x));
  OK(PetscFree(t));
  OK(ShapeDestroy(&s));
  for (int i = 0; options[i]; i += 2) OK(PetscOptionsClearValue(NULL, options[i]));
}

static void test_edges(void **state)
{
  const char *const plate[] = {"-t_size", "4,2,0.04", NULL}, *const coin[] = {"-t_radius", "1", "-t_length", "0.02",
                                                                              NULL};
  const char *const wedge[] = {"-t_parts",   "a,b",   "-t_a_shape",  "box",     "-t_a_size",      "2,2,2",
                               "-t_b_shape", "box",   "-t_b_size",   "2,3,6",   "-t_b_angle",     "0.5",
                               "-t_b_axis",  "0,1,0", "-t_b_offset", "1.2,0,0", "-t_b_operation", "difference",
                               NULL};
  const char *const bore[]  = {"-t_parts",    "a,b",        "-t_a_shape",     "box",         "-t_a_size",
                               "2,2,2",       "-t_b_shape", "cylinder",       "-t_b_radius", "0.5",
                               "-t_b_length", "3",          "-t_b_operation", "difference",  NULL};

  (void)state;
  expect_drawn("box", plate, .32, 1e-12);
  expect_drawn("cylinder", coin, .02 * PETSC_PI, 1e-3);
  /* what the plane x = 1.2 - 1 / cos .5 + z tan .5 leaves of the cube */
  expect_drawn("composite", wedge, 4 * (2.2 - 1 / PetscCosReal(.5)), 1e-3);
  expect_drawn("composite", bore, 8 - PETSC_PI / 2, 2e-2);
}

/* What has no edges is drawn as before. */
static void test_round(void **state)
{
  const char *const ball[] = {"-t_radius", "1", NULL}, *const pill[] = {"-t_size", "2,1,1", "-t_rounding", "0.3", NULL};
  const PetscReal r = .3, inner[3] = {1.4, .4, .4};

  (void)state;
  expect_drawn("circle", ball, 4 * PETSC_PI / 3, 2e-2);
  expect_drawn("box", pill,
               inner[0] * inner[1] * inner[2] + 2 * r * (2 * inner[0] * inner[1] + inner[1] * inner[2]) +
                 PETSC_PI * r * r * (inner[0] + .8) + 4 * PETSC_PI / 3 * r * r * r,
               1e-2);
}

/* A union with a fin that no grid sees: both surfaces, without what lies inside; the sum of their areas */
static void test_thin_part(void **state)
{
  const char *const options[] = {"-t_parts",    "a,b",          "-t_a_shape", "circle",    "-t_a_radius",
                                 "0.2",         "-t_b_shape",   "box",        "-t_b_size", "0.001,1,0.8",
                                 "-t_b_offset", "0.0137,0.6,0", "-t_b_angle", "0.1",       NULL};
  Shape             s;
  PetscInt          np, nt, *t;
  PetscReal        *x, area = 0, reach = 0;

  (void)state;
  for (int i = 0; options[i]; i += 2) OK(PetscOptionsSetValue(NULL, options[i], options[i + 1]));
  OK(ShapeCreate("composite", "t_", 3, &s));
  OK(ShapeTriangulate(s, MOST_DRAWN, &np, &x, &nt, &t));
  for (PetscInt i = 0; i < nt; i++) {
    const PetscReal *a = x + 3 * t[3 * i], *b = x + 3 * t[3 * i + 1], *c = x + 3 * t[3 * i + 2];
    PetscReal        n[3], d;

    for (int k = 0; k < 3; k++)
      n[k] = (b[(k + 1) % 3] - a[(k + 1) % 3]) * (c[(k + 2) % 3] - a[(k + 2) % 3]) -
             (b[(k + 2) % 3] - a[(k + 2) % 3]) * (c[(k + 1) % 3] - a[(k + 1) % 3]);
    area += 0.5 * PetscSqrtReal(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3; k++) {
      OK(ShapeDistance(s, 1, x + 3 * t[3 * i + k], &d));
      BELOW(d, 1e-8);
      reach = PetscMax(reach, x[3 * t[3 * i + k] + 1]);
    }
  }
  NEAR(reach, 0.6 + 0.5 * PetscCosReal(0.1), 1e-3);
  NEAR(area, 4 * PETSC_PI * 0.04 + 2 * (0.8 + 0.001 * 1.8), 0.02);
  OK(PetscFree(x));
  OK(PetscFree(t));
  OK(ShapeDestroy(&s));
  for (int i = 0; options[i]; i += 2) OK(PetscOptionsClearValue(NULL, options[i]));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_edges),
    cmocka_unit_test(test_round),
    cmocka_unit_test(test_thin_part),
  };
  int failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (!failed) PetscCall(ShapeFinalize());
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
