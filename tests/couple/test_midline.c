/* Midline: exact for straight bodies wherever their origin is, on the arc for a curved plate, none for bodies that are
   thick, branched or have a hole. */
#include "core.h"
#include "couple/bodysurfaces.h"

static Midline line_of(const char type[], const char options[], Shape *shape)
{
  Midline line;

  give(options);
  OK(ShapeCreate(type, "t_", 2, shape));
  OK(BodyMidlineCreate(*shape, &line));
  return line;
}

/* A straight line from (x0, 0) to (x1, 0), in either sense, of a body of the given thickness */
static void expect_straight(const char type[], const char options[], PetscReal x0, PetscReal x1, PetscReal thickness)
{
  Shape     shape;
  Midline   line = line_of(type, options, &shape);
  PetscReal length, width, end[4], s[3], d[3], sense;

  assert_non_null(line);
  OK(MidlineGetSize(line, &length, &width));
  NEAR(length, x1 - x0, 1e-13);
  NEAR(width, thickness, 1e-3 * thickness);
  s[0] = 0;
  s[1] = length;
  OK(MidlinePoint(line, 2, s, end));
  sense = end[0] < end[2] ? 1 : -1;
  NEAR(PetscMin(end[0], end[2]), x0, 1e-13);
  NEAR(PetscMax(end[0], end[2]), x1, 1e-13);
  for (PetscInt i = 0; i <= 50; i++) {
    const PetscReal t = length * i / 50.0;
    PetscReal       y[2];

    OK(MidlinePoint(line, 1, &t, y));
    NEAR(y[0], end[0] + sense * t, 1e-12);
    NEAR(y[1], 0, 1e-11); /* the distance of an ellipse is exact to 1e-12 */
  }
  {
    const PetscReal x[6] = {0.5 * (x0 + x1), 0.1, 0.5 * (x0 + x1), -0.2, x1 + 0.3, 0.4};

    OK(MidlineProject(line, 3, x, s, d));
    NEAR(s[0], 0.5 * length, 1e-8);
    NEAR(d[0], 0.1 * sense, 1e-10);
    NEAR(d[1], -0.2 * sense, 1e-10);
    NEAR(s[2], sense > 0 ? length : 0, 0);
    NEAR(PetscAbsReal(d[2]), 0.5, 1e-10);
  }
  OK(MidlineDestroy(&line));
  OK(ShapeDestroy(&shape));
}

static void test_straight(void **state)
{
  (void)state;
  expect_straight("leaflet", "-t_length 0.8 -t_thickness 0.05", -0.025, 0.775, 0.05);
  expect_straight("leaflet", "-t_length 2 -t_thickness 1e-4 -t_origin 0.5", -1, 1, 1e-4);
  expect_straight("ellipse", "-t_a 0.5 -t_b 0.02", -0.5, 0.5, 0.04);
}

/* Outline of a plate along an arc of radius 1 and angle 1.2, thickness 0.04; of a cross */
static void write_outlines(const char arc[], const char cross[])
{
  const PetscReal plus[24] = {1,  0.1,  0.1,  0.1,  0.1,  1,  -0.1, 1,  -0.1, 0.1,  -1, 0.1,
                              -1, -0.1, -0.1, -0.1, -0.1, -1, 0.1,  -1, 0.1,  -0.1, 1,  -0.1};
  FILE           *file     = fopen(arc, "w");

  assert_non_null(file);
  for (int i = 0; i < 400; i++) {
    const PetscReal r = i < 200 ? 1.02 : 0.98, t = 1.2 * (i < 200 ? i : 399 - i) / 199.0;

    fprintf(file, "%.17g %.17g\n", (double)(r * PetscCosReal(t)), (double)(r * PetscSinReal(t)));
  }
  fclose(file);
  file = fopen(cross, "w");
  assert_non_null(file);
  for (int i = 0; i < 12; i++) fprintf(file, "%g %g\n", (double)plus[2 * i], (double)plus[2 * i + 1]);
  fclose(file);
}

static void test_curved_and_none(void **state)
{
  Shape     shape;
  Midline   line;
  PetscReal length;
  char      arc[64], cross[64], options[128];

  (void)state;
  snprintf(arc, sizeof(arc), "/tmp/tumble-arc-%d", (int)getpid());
  snprintf(cross, sizeof(cross), "/tmp/tumble-cross-%d", (int)getpid());
  write_outlines(arc, cross);
  snprintf(options, sizeof(options), "-t_file %s", arc);
  line = line_of("polygon", options, &shape);
  assert_non_null(line);
  OK(MidlineGetSize(line, &length, NULL));
  NEAR(length, 1.2, 1e-4);
  for (PetscInt i = 0; i <= 50; i++) {
    const PetscReal t = length * i / 50.0;
    PetscReal       y[2];

    OK(MidlinePoint(line, 1, &t, y));
    NEAR(PetscSqrtReal(y[0] * y[0] + y[1] * y[1]), 1, 1e-4);
  }
  OK(MidlineDestroy(&line));
  OK(ShapeDestroy(&shape));
  snprintf(options, sizeof(options), "-t_file %s", cross);
  assert_null(line_of("polygon", options, &shape));
  OK(ShapeDestroy(&shape));
  assert_null(line_of("circle", "-t_radius 0.1", &shape));
  OK(ShapeDestroy(&shape));
  assert_null(line_of("ellipse", "-t_a 0.5 -t_b 0.2", &shape));
  OK(ShapeDestroy(&shape));
  assert_null(line_of("ring", "", &shape));
  OK(ShapeDestroy(&shape));
  remove(arc);
  remove(cross);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_straight), cmocka_unit_test(test_curved_and_none)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (OptFinalize() || ShapeFinalize() || PetscFinalize()) return 1;
  return failed;
}
