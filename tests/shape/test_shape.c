/* Unit tests of the shape module: loading and its errors, defaults against closed forms, projection, options.
   Collective: run on 1, 2, 3 ranks. Plugins that are wrong on purpose are expected in the folder badshapes beside this
   program, the real ones in ../../shapes (make tests). */
/* ranks: 1 2 3 */
#include "compat.h"
#include "shape/host.h"
#include "base/opt.h"
#include "base/runcomm.h"
#include "impl.h"
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static char folder[PETSC_MAX_PATH_LEN]; /* of this program */

/* ---- helpers ---- */

static PetscErrorCode KeepMessage(MPI_Comm comm, int line, const char *func, const char *file, PetscErrorCode code,
                                  PetscErrorType type, const char *message, void *ctx)
{
  (void)comm;
  (void)line;
  (void)func;
  (void)file;
  if (type == PETSC_ERROR_INITIAL && message) (void)PetscStrncpy((char *)ctx, message, 4096);
  return code;
}

static void MustWork(PetscErrorCode ierr)
{
  assert_int_equal(ierr, 0);
}

static void MustHold(const char message[], const char part[])
{
  if (!strstr(message, part)) fail_msg("the message lacks '%s': %s", part, message);
}

/* ShapeCreate must fail; message [4096] gets the text. */
static void MustFail(const char type[], PetscInt dim, char message[])
{
  PetscErrorCode ierr;
  Shape          s = NULL;

  message[0] = 0;
  MustWork(PetscPushErrorHandler(KeepMessage, message));
  ierr = ShapeCreate(type, "t_", dim, &s);
  MustWork(PetscPopErrorHandler());
  assert_int_not_equal(ierr, 0);
  assert_null(s);
}

static void MustBeNear(PetscReal value, PetscReal expected, PetscReal tolerance, const char what[])
{
  if (!(PetscAbsReal(value - expected) <= tolerance))
    fail_msg("%s is %.12g, expected %.12g within %g", what, (double)value, (double)expected, (double)tolerance);
}

static void SetOption(const char name[], const char value[])
{
  if (value) MustWork(PetscOptionsSetValue(NULL, name, value));
  else MustWork(PetscOptionsClearValue(NULL, name));
}

static Shape Make(const char type[], PetscInt dim)
{
  Shape s;

  MustWork(ShapeCreate(type, "t_", dim, &s));
  return s;
}

/* Which folders to search: badshapes and the real ones. */
static int SetPath(void **state)
{
  char path[2 * PETSC_MAX_PATH_LEN];

  (void)state;
  MustWork(PetscSNPrintf(path, sizeof(path), "%s/badshapes:%s/../../shapes", folder, folder));
  SetOption("-shape_path", path);
  return 0;
}

/* ---- loading ---- */

static void test_unknown_type_lists_known(void **state)
{
  char message[4096];

  (void)state;
  MustFail("cube", 2, message);
  MustHold(message, "Shape 'cube' is not known (known: ");
  MustHold(message, "circle");
  assert_null(strstr(message, "template")); /* for writers of plugins; it can be loaded */
  MustHold(message, "put cube.so into a folder of -shape_path");
}

static void test_type_is_not_a_path(void **state)
{
  char message[4096];

  (void)state;
  MustFail("build/shapes/circle.so", 2, message);
  MustHold(message, "-shape_path");
}

static void test_broken_plugins_say_what_to_do(void **state)
{
  const char *expected[][3] = {{"nosymbol", "does not register a shape", "TUMBLE_SHAPE_REGISTER"},
                               {"badinterface", "was built for shape interface 1003", "rebuild"},
                               {"nodistance", "lacks the required operation 'distance'", ".ops.distance"},
                               {"othername", "registers the type 'cube'", "rename the file"},
                               {"undefined", "cannot be loaded", "compile it again"}};
  char        message[4096];

  (void)state;
  for (size_t i = 0; i < sizeof(expected) / sizeof(expected[0]); i++) {
    MustFail(expected[i][0], 2, message);
    MustHold(message, expected[i][0]);
    MustHold(message, expected[i][1]);
    MustHold(message, expected[i][2]);
  }
}

/* A file that only one rank sees as broken: all ranks must fail alike (here rank 0 alone has a text file in its
   path). */
static void test_error_of_one_rank_is_raised_on_all(void **state)
{
  char        dir[] = "/tmp/tumble_shape_XXXXXX", file[PETSC_MAX_PATH_LEN], path[3 * PETSC_MAX_PATH_LEN], message[4096];
  PetscMPIInt rank;
  FILE       *f;

  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  if (rank == 0) {
    assert_non_null(mkdtemp(dir));
    snprintf(file, sizeof(file), "%s/ellipse.so", dir);
    f = fopen(file, "w");
    assert_non_null(f);
    fputs("not a shared object\n", f);
    fclose(f);
    snprintf(path, sizeof(path), "%s:%s/../../shapes", dir, folder);
    SetOption("-shape_path", path);
  }
  MustFail("ellipse", 2, message);
  if (rank == 0) {
    unlink(file);
    rmdir(dir);
  }
  MustHold(message, "cannot be loaded");
  SetPath(state);
  {
    Shape s = Make("ellipse", 2); /* and the failure leaves nothing behind */

    MustWork(ShapeDestroy(&s));
  }
}

/* Where ranks create shapes by themselves, the last one makes one and meets an error that no other rank hears of */
static void test_rank_of_its_own(void **state)
{
  char        message[4096];
  PetscMPIInt rank, size;

  (void)state;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  MPI_Comm_size(PETSC_COMM_WORLD, &size);
  RunCommSet(PETSC_COMM_SELF);
  if (rank == size - 1) {
    Shape s = Make("ellipse", 2);

    MustWork(ShapeDestroy(&s));
    MustFail("elipse", 2, message);
    MustHold(message, "ellipse");
  }
  RunCommSet(MPI_COMM_NULL);
  assert_true(ShapeComm() == PETSC_COMM_WORLD);
}

static void test_wrong_dimension(void **state)
{
  char message[4096];

  (void)state;
  MustFail("airfoil", 3, message);
  MustHold(message, "works in 2D only");
}

static void test_distance_not_finite(void **state)
{
  char message[4096];

  (void)state;
  SetOption("-t_fault", "1");
  MustFail("faulty", 2, message);
  SetOption("-t_fault", NULL);
  MustHold(message, "not finite");
  MustHold(message, "faulty");
}

static void test_option_out_of_range(void **state)
{
  char message[4096];

  (void)state;
  SetOption("-t_radius", "-0.1");
  MustFail("circle", 2, message);
  SetOption("-t_radius", NULL);
  MustHold(message, "-t_radius");
  MustHold(message, "-0.1");
}

static void test_options_do_not_fit(void **state)
{
  char message[4096];

  (void)state;
  SetOption("-t_corner", "0.6");
  MustFail("template", 2, message);
  SetOption("-t_corner", NULL);
  MustHold(message, "Corner radius 0.6");
}

/* The folder beside the library makes plugins findable from any working directory, without -shape_path. */
static void test_found_from_any_directory(void **state)
{
  char        cwd[PETSC_MAX_PATH_LEN];
  Shape       s;
  const char *type;

  SetOption("-shape_path", NULL);
  assert_non_null(getcwd(cwd, sizeof(cwd)));
  assert_int_equal(chdir("/"), 0);
  s = Make("leaflet", 2);
  assert_int_equal(chdir(cwd), 0);
  MustWork(ShapeGetType(s, &type));
  assert_string_equal(type, "leaflet");
  MustWork(ShapeDestroy(&s));
  SetPath(state);
}

static void test_finalize_refuses_live_shapes(void **state)
{
  char           message[4096] = "";
  Shape          s             = Make("circle", 2);
  PetscErrorCode ierr;

  (void)state;
  MustWork(PetscPushErrorHandler(KeepMessage, message));
  ierr = ShapeFinalize();
  MustWork(PetscPopErrorHandler());
  assert_int_not_equal(ierr, 0);
  MustHold(message, "1 shapes are still in use");
  MustWork(ShapeDestroy(&s));
  MustWork(ShapeFinalize()); /* and can be loaded again after it */
  s = Make("circle", 2);
  MustWork(ShapeDestroy(&s));
}

/* ---- defaults against closed forms ---- */

static void test_default_mass_disc(void **state)
{
  const PetscReal r = 0.3, v = PETSC_PI * r * r;
  Shape           s;
  ShapeMass       m;

  (void)state;
  SetOption("-t_radius", "0.3");
  s = Make("circle", 2);
  MustWork(ShapeDefaultMass(s, r, 2, &m));
  MustBeNear(m.volume, v, 1e-6 * v, "area of a disc by quadrature");
  MustBeNear(m.inertia[2], 0.5 * v * r * r, 1e-6 * 0.5 * v * r * r, "polar moment of a disc by quadrature");
  MustBeNear(m.centroid[0], 0, 1e-9, "centroid of a disc");
  MustWork(ShapeDestroy(&s));
  SetOption("-t_radius", NULL);
}

static void test_default_mass_ball(void **state)
{
  const PetscReal r = 0.5, v = 4.0 / 3.0 * PETSC_PI * r * r * r;
  Shape           s = Make("circle", 3);
  ShapeMass       m;

  (void)state;
  MustWork(ShapeDefaultMass(s, r, 3, &m));
  MustBeNear(m.volume, v, 1e-6 * v, "volume of a ball by quadrature");
  for (PetscInt a = 0; a < 3; a++)
    MustBeNear(m.inertia[a], 0.4 * v * r * r, 1e-6 * 0.4 * v * r * r, "moment of a ball by quadrature");
  for (PetscInt a = 3; a < 6; a++) MustBeNear(m.inertia[a], 0, 1e-6 * v, "product of inertia of a ball");
  MustWork(ShapeDestroy(&s));
}

#define THIN 0.02

/* The segment of half length 1 - THIN along an oblique axis, THIN thick */
static PetscErrorCode capsule_distance(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  const PetscReal e[3] = {0.36, 0.48, 0.8};

  PetscFunctionBeginUser;
  (void)s;
  for (PetscInt i = 0; i < n; i++) {
    PetscReal along = 0, square = 0;

    for (PetscInt a = 0; a < 3; a++) along += e[a] * x[3 * i + a];
    along = PetscMax(THIN - 1, PetscMin(1 - THIN, along));
    for (PetscInt a = 0; a < 3; a++) square += PetscSqr(x[3 * i + a] - along * e[a]);
    d[i] = PetscSqrtReal(square) - THIN;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Fifty times as long as thick: one per cent off without deeper cells where the body is thin */
static void test_default_mass_capsule(void **state)
{
  const PetscReal v      = PETSC_PI * THIN * THIN * (2 * (1 - THIN) + 4. / 3. * THIN);
  const Loaded    loaded = {.type = "capsule", .file = "capsule.so"};
  struct _p_Shape s      = {.loaded = &loaded, .ops = {.distance = capsule_distance}, .dim = 3, .radius = 1};
  ShapeMass       m;

  (void)state;
  MustWork(ShapeDefaultMass(&s, 1, 3, &m));
  MustBeNear(m.volume, v, 1e-6 * v, "volume of a slender capsule by quadrature");
}

/* Sharp edges, where the cut converges as the square of the cells only */
static void test_default_mass_cylinder(void **state)
{
  Shape     s = Make("cylinder", 3);
  ShapeMass m, exact;

  (void)state;
  MustWork(ShapeGetMass(s, &exact));
  MustWork(ShapeDefaultMass(s, 0.8, 3, &m));
  MustBeNear(m.volume, exact.volume, 1e-6 * exact.volume, "volume of a cylinder by quadrature");
  for (PetscInt a = 0; a < 3; a++)
    MustBeNear(m.inertia[a], exact.inertia[a], 2e-6 * exact.inertia[a], "moment of a cylinder by quadrature");
  MustWork(ShapeDestroy(&s));
}

/* Off-centre, with round ends: centroid and parallel axes. */
static void test_default_mass_leaflet(void **state)
{
  for (PetscInt dim = 2; dim <= 3; dim++) {
    const PetscReal tolerance = 1e-6;
    Shape           s;
    ShapeMass       m, exact;

    (void)state;
    SetOption("-t_thickness", "0.4");
    s = Make("leaflet", dim);
    MustWork(ShapeGetMass(s, &exact));
    MustWork(ShapeDefaultMass(s, 0.8, dim, &m));
    MustBeNear(m.volume, exact.volume, tolerance * exact.volume, "volume of a leaflet by quadrature");
    MustBeNear(m.centroid[0], 0.3, tolerance, "centroid of a leaflet");
    for (PetscInt a = dim == 2 ? 2 : 0; a < 3; a++)
      MustBeNear(m.inertia[a], exact.inertia[a], 2.0 * tolerance * exact.inertia[a],
                 "moment of a leaflet by quadrature");
    MustWork(ShapeDestroy(&s));
    SetOption("-t_thickness", NULL);
  }
}

/* A square with rounded corners uses the default for everything. */
static void test_default_mass_rounded_square(void **state)
{
  const PetscReal area = 1.0 - (4.0 - PETSC_PI) * 0.01;
  Shape           s    = Make("template", 2);
  ShapeMass       m;
  PetscReal       r;

  (void)state;
  MustWork(ShapeGetMass(s, &m));
  MustBeNear(m.volume, area, 1e-6 * area, "area of the rounded square");
  MustWork(ShapeGetRadius(s, &r));
  MustBeNear(r, PetscSqrtReal(2.0) * 0.4 + 0.1, 1e-4, "radius of the rounded square");
  assert_true(r >= PetscSqrtReal(2.0) * 0.4 + 0.1 - 1e-6);
  MustWork(ShapeDestroy(&s));
}

static void test_default_normal(void **state)
{
  const PetscReal x[6] = {0.3, 0.4, -0.7, 0.1, 0.0, 0.0};
  PetscReal       n[6];
  Shape           s = Make("circle", 2);

  (void)state;
  MustWork(ShapeDefaultNormal(s, 0.5, 2, 3, x, n));
  for (PetscInt i = 0; i < 2; i++)
    for (PetscInt a = 0; a < 2; a++)
      MustBeNear(n[2 * i + a], x[2 * i + a] / PetscSqrtReal(PetscSqr(x[2 * i]) + PetscSqr(x[2 * i + 1])), 1e-9,
                 "component of the normal");
  MustBeNear(PetscSqrtReal(n[4] * n[4] + n[5] * n[5]), 1.0, 1e-12, "length of the normal at the centre");
  MustWork(ShapeDestroy(&s));
}

/* Perimeter 2a(...) of an ellipse 1 x 0.5: 4 E(3/4) = 4.844224110273838; points even in arc length, on the curve,
   counter-clockwise. */
static void test_default_surface_ellipse(void **state)
{
  enum {
    N = 200
  };
  Shape     s = Make("ellipse", 2);
  PetscReal x[2 * N], w[N], d[N], sum = 0, shortest = 10, longest = 0, area2 = 0;

  (void)state;
  MustWork(ShapeSurface(s, N, x, w));
  MustWork(ShapeDistance(s, N, x, d));
  for (PetscInt i = 0; i < N; i++) {
    const PetscReal *p = x + 2 * i, *q = x + 2 * ((i + 1) % N),
                    len = PetscSqrtReal(PetscSqr(q[0] - p[0]) + PetscSqr(q[1] - p[1]));

    MustBeNear(d[i], 0, 1e-11, "distance of a surface point");
    sum += w[i];
    shortest = PetscMin(shortest, len);
    longest  = PetscMax(longest, len);
    area2 += p[0] * q[1] - p[1] * q[0];
  }
  MustBeNear(sum, 4.844224110273838, 5e-6, "perimeter of an ellipse");
  MustBeNear(shortest / longest, 1.0, 2e-3, "evenness of the surface points");
  MustBeNear(0.5 * area2, 0.5 * PETSC_PI, 1e-3, "signed area of the surface points");
  MustWork(ShapeDestroy(&s));
}

static void test_default_surface_ball(void **state)
{
  enum {
    N = 300
  };
  Shape     s = Make("circle", 3);
  PetscReal x[3 * N], w[N], d[N], sum = 0, centre[3] = {0, 0, 0};

  (void)state;
  MustWork(ShapeDefaultSurface(s, 0.5, 3, N, x, w));
  MustWork(ShapeDistance(s, N, x, d));
  for (PetscInt i = 0; i < N; i++) {
    MustBeNear(d[i], 0, 1e-11, "distance of a surface point");
    assert_true(w[i] > 0);
    sum += w[i];
    for (PetscInt a = 0; a < 3; a++) centre[a] += w[i] * x[3 * i + a];
  }
  MustBeNear(sum, PETSC_PI, 5e-3 * PETSC_PI, "area of a ball");
  for (PetscInt a = 0; a < 3; a++) MustBeNear(centre[a] / sum, 0, 1e-2, "centre of the surface points");
  MustWork(ShapeDestroy(&s));
}

/* ---- projection, disc, closest points ---- */

static void test_project(void **state)
{
  const PetscReal x[8] = {2.0, 0.0, 0.1, 0.0, 0.0, 0.0, -3.0, 4.0};
  PetscReal       y[8], d[4];
  Shape           s = Make("circle", 2);

  (void)state;
  MustWork(ShapeProject(s, 4, x, y));
  MustBeNear(y[0], 0.5, 1e-12, "projection in x");
  MustBeNear(y[2], 0.5, 1e-12, "projection from inside");
  MustBeNear(y[6], -0.3, 1e-12, "oblique projection");
  MustWork(ShapeDistance(s, 4, y, d));
  for (PetscInt i = 0; i < 4; i++) MustBeNear(d[i], 0, 1e-12, "distance after projection");
  MustWork(ShapeDestroy(&s));
}

/* Points on the medial axis, where the gradient of the distance vanishes or jumps. */
static void test_project_from_kinks(void **state)
{
  const char *type[3] = {"leaflet", "template", "ellipse"};

  (void)state;
  for (int k = 0; k < 3; k++) {
    const PetscReal x[8] = {0.0, 0.0, 0.2, 0.0, 0.25, 0.25, 0.7, 0.0};
    PetscReal       y[8], d[4], d0[4];
    Shape           s = Make(type[k], 2);

    MustWork(ShapeProject(s, 4, x, y));
    MustWork(ShapeDistance(s, 4, x, d0));
    MustWork(ShapeDistance(s, 4, y, d));
    for (PetscInt i = 0; i < 4; i++) {
      MustBeNear(d[i], 0, 1e-12, "distance after projection");
      MustBeNear(PetscSqrtReal(PetscSqr(y[2 * i] - x[2 * i]) + PetscSqr(y[2 * i + 1] - x[2 * i + 1])),
                 PetscAbsReal(d0[i]), 1e-6, "way of the projection");
    }
    MustWork(ShapeDestroy(&s));
  }
}

static void test_disc(void **state)
{
  PetscReal r;
  Shape     s = Make("circle", 2);

  (void)state;
  MustWork(ShapeGetDisc(s, &r));
  MustBeNear(r, 0.5, 1e-12, "radius of a disc");
  MustWork(ShapeGetRadius(s, &r));
  MustBeNear(r, 0.5, 0, "bounding radius of a disc");
  MustWork(ShapeDestroy(&s));
  s = Make("ellipse", 2);
  MustWork(ShapeGetDisc(s, &r));
  assert_true(r == 0.0);
  MustWork(ShapeDestroy(&s));
  SetOption("-t_a", "0.5"); /* an ellipse with equal axes is a disc */
  s = Make("ellipse", 2);
  SetOption("-t_a", NULL);
  MustWork(ShapeGetDisc(s, &r));
  MustBeNear(r, 0.5, 1e-9, "radius of a round ellipse");
  MustWork(ShapeDestroy(&s));
}

/* Closest points by dense sampling of the outline. */
/* Volumes and moments of superellipsoids: an ellipsoid for the exponent 2; else against the default quadrature, in 2D
   also against the area 4 a b Gamma(1 + 1/n)^2/Gamma(1 + 2/n); and distances against points of the surface */
static void test_superellipsoid(void **state)
{
  const PetscReal g = 0.906402477055477, g2 = 0.886226925452758; /* Gamma(5/4), Gamma(3/2) */
  PetscReal       r, nearest                = 0;
  ShapeMass       m;
  Shape           s;

  (void)state;
  SetOption("-t_a", "0.5");
  SetOption("-t_b", "0.3");
  SetOption("-t_exponent", "4");
  s = Make("superellipsoid", 2);
  MustWork(ShapeGetMass(s, &m));
  MustBeNear(m.volume, 4 * 0.5 * 0.3 * g * g / g2, 1e-14, "area of a superellipse");
  MustWork(ShapeGetReach(s, &r));
  MustBeNear(r, PetscPowReal(PetscPowReal(0.5, 4) + PetscPowReal(0.3, 4), 0.25), 1e-14, "reach of a superellipse");
  for (PetscInt i = 0; i < 40; i++) {
    const PetscReal x[2] = {0.7 * PetscCosReal(1.7 * i), 0.02 * i * PetscSinReal(1.7 * i)};
    PetscReal       d, best = PETSC_MAX_REAL;

    for (PetscInt k = 0; k < 20000; k++) { /* even angles in the plane of squares */
      const PetscReal t = 2 * PETSC_PI * k / 20000, c = PetscCosReal(t), q = PetscSinReal(t),
                      n = PetscPowReal(c * c * c * c + q * q * q * q, 0.25);

      best = PetscMin(best, PetscSqr(x[0] - 0.5 * c / n) + PetscSqr(x[1] - 0.3 * q / n));
    }
    MustWork(ShapeDistance(s, 1, x, &d));
    nearest = PetscMax(nearest, PetscAbsReal(PetscAbsReal(d) - PetscSqrtReal(best)));
  }
  MustBeNear(nearest, 0, 1e-4, "distance to a superellipse");
  MustWork(ShapeDestroy(&s));
  SetOption("-t_exponent", "2");
  SetOption("-t_c", "0.2");
  s = Make("superellipsoid", 3);
  MustWork(ShapeGetMass(s, &m));
  MustBeNear(m.volume, 4 * PETSC_PI / 3 * 0.5 * 0.3 * 0.2, 1e-14, "volume of an ellipsoid");
  MustBeNear(m.inertia[0], 0.2 * m.volume * (0.09 + 0.04), 1e-14, "inertia of an ellipsoid");
  MustBeNear(m.inertia[2], 0.2 * m.volume * (0.25 + 0.09), 1e-14, "inertia of an ellipsoid");
  MustWork(ShapeDestroy(&s));
  for (size_t i = 0; i < 4; i++) SetOption((const char *const[]){"-t_a", "-t_b", "-t_c", "-t_exponent"}[i], NULL);
}

static void test_ellipse_distance_by_sampling(void **state)
{
  Shape s = Make("ellipse", 2);

  (void)state;
  for (PetscInt i = 0; i < 40; i++) {
    const PetscReal x[2] = {1.6 * PetscSinReal(1.0 + 3.1 * (PetscReal)i), 1.1 * PetscCosReal(2.0 * (PetscReal)i)};
    PetscReal       d, best = 100;

    for (PetscInt k = 0; k < 20000; k++) {
      const PetscReal phi = 2.0 * PETSC_PI * (PetscReal)k / 20000.0;

      best = PetscMin(best, PetscSqr(x[0] - PetscCosReal(phi)) + PetscSqr(x[1] - 0.5 * PetscSinReal(phi)));
    }
    MustWork(ShapeDistance(s, 1, x, &d));
    MustBeNear(PetscAbsReal(d), PetscSqrtReal(best), 2e-4, "distance to an ellipse");
    assert_true((d < 0) == (x[0] * x[0] + 4.0 * x[1] * x[1] < 1.0));
  }
  MustWork(ShapeDestroy(&s));
}

/* NACA 0012: thickness 0.12 near 30 % chord, nose and closed trailing edge on the outline. */
static void test_airfoil_landmarks(void **state)
{
  const PetscReal x[8] = {-0.25, 0.0, 0.75, 0.0, 0.05, 0.0600156, 0.85, 0.0};
  PetscReal       d[4];
  Shape           s = Make("airfoil", 2);

  (void)state;
  MustWork(ShapeDistance(s, 4, x, d));
  MustBeNear(d[0], 0, 1e-12, "distance at the nose");
  MustBeNear(d[1], 0, 1e-12, "distance at the trailing edge");
  MustBeNear(d[2], 0, 5e-5, "distance at the thickest point");
  MustBeNear(d[3], 0.1, 1e-12, "distance behind the trailing edge");
  MustWork(ShapeDestroy(&s));
}

/* ---- polygon ---- */

static void WritePolygon(char file[], const char text[])
{
  PetscMPIInt rank;

  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  MustWork(PetscSNPrintf(file, PETSC_MAX_PATH_LEN, "%s/test_shape_outline.txt", folder));
  if (rank == 0) {
    FILE *f = fopen(file, "w");

    assert_non_null(f);
    fputs(text, f);
    fclose(f);
  }
  MPI_Barrier(PETSC_COMM_WORLD);
  SetOption("-t_file", file);
}

static void RemovePolygon(const char file[])
{
  PetscMPIInt rank;

  MPI_Barrier(PETSC_COMM_WORLD);
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  if (rank == 0) unlink(file);
  SetOption("-t_file", NULL);
}

/* An L, clockwise in the file, with comments and the first corner repeated. */
static void test_polygon_properties(void **state)
{
  char            file[PETSC_MAX_PATH_LEN];
  const PetscReal x[6] = {0.5, 0.5, 1.5, 1.5, 1.5, 0.75};
  PetscReal       d[3];
  ShapeMass       m;
  Shape           s;

  (void)state;
  WritePolygon(file, "# an L\n0 0\n0 2\n1, 2 # comma and comment\n1 1\n\n2 1\n2 0\n0 0\n");
  s = Make("polygon", 2);
  MustWork(ShapeDistance(s, 3, x, d));
  MustBeNear(d[0], -0.5, 1e-14, "distance inside an L");
  MustBeNear(d[1], 0.5, 1e-14, "distance in the notch of an L");
  MustBeNear(d[2], -0.25, 1e-14, "distance in the arm of an L");
  MustWork(ShapeGetMass(s, &m));
  MustBeNear(m.volume, 3.0, 1e-13, "area of an L");
  MustBeNear(m.centroid[0], 2.5 / 3.0, 1e-13, "centroid of an L");
  MustBeNear(m.inertia[2], 3.0 / 6.0 + 4.0 / 3.0, 1e-12, "polar moment of an L");
  MustWork(ShapeDestroy(&s));
  RemovePolygon(file);
}

static void test_polygon_errors(void **state)
{
  const char *expected[][3] = {{"0 0\n2 2\n2 0\n0 2\n", "from line 1 to line 2 meets the edge from line 3 to line 4",
                                "must not cross"},
                               {"0 0\n1 0\n1 1\n0.5 0\n0 1\n",
                                "the edge from line 1 to line 2 meets the edge from line", "must not cross"},
                               {"0 0\n2 0\n1 0\n0 1\n", "meets the edge", "from line 3"},
                               {"0 0\n1 zero\n1 1\n", ":2: expected two finite numbers", "1 zero"},
                               {"0 0\n1 0\n", "at least 3 different corners, found 2", "outline"}};
  char        file[PETSC_MAX_PATH_LEN], message[4096];

  (void)state;
  for (size_t i = 0; i < sizeof(expected) / sizeof(expected[0]); i++) {
    WritePolygon(file, expected[i][0]);
    MustFail("polygon", 2, message);
    RemovePolygon(file);
    MustHold(message, expected[i][1]);
    MustHold(message, expected[i][2]);
  }
  MustFail("polygon", 2, message);
  MustHold(message, "cannot be read");
}

/* The folder of this program, whatever the working directory. */
static void FindFolder(void)
{
  char    self[PETSC_MAX_PATH_LEN];
  ssize_t n = readlink("/proc/self/exe", self, sizeof(self) - 1);

  if (n < 0) n = 0;
  self[n] = 0;
  snprintf(folder, sizeof(folder), "%s", dirname(self));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_unknown_type_lists_known),
    cmocka_unit_test(test_type_is_not_a_path),
    cmocka_unit_test(test_broken_plugins_say_what_to_do),
    cmocka_unit_test(test_error_of_one_rank_is_raised_on_all),
    cmocka_unit_test(test_rank_of_its_own),
    cmocka_unit_test(test_wrong_dimension),
    cmocka_unit_test(test_distance_not_finite),
    cmocka_unit_test(test_option_out_of_range),
    cmocka_unit_test(test_options_do_not_fit),
    cmocka_unit_test(test_found_from_any_directory),
    cmocka_unit_test(test_finalize_refuses_live_shapes),
    cmocka_unit_test(test_default_mass_disc),
    cmocka_unit_test(test_default_mass_ball),
    cmocka_unit_test(test_default_mass_capsule),
    cmocka_unit_test(test_default_mass_cylinder),
    cmocka_unit_test(test_default_mass_leaflet),
    cmocka_unit_test(test_default_mass_rounded_square),
    cmocka_unit_test(test_default_normal),
    cmocka_unit_test(test_default_surface_ellipse),
    cmocka_unit_test(test_default_surface_ball),
    cmocka_unit_test(test_project),
    cmocka_unit_test(test_project_from_kinks),
    cmocka_unit_test(test_disc),
    cmocka_unit_test(test_ellipse_distance_by_sampling),
    cmocka_unit_test(test_superellipsoid),
    cmocka_unit_test(test_airfoil_landmarks),
    cmocka_unit_test(test_polygon_properties),
    cmocka_unit_test(test_polygon_errors),
  };
  int failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  FindFolder();
  failed = cmocka_run_group_tests(tests, SetPath, NULL);
  if (!failed) PetscCall(ShapeFinalize()); /* a failed test may have left a shape behind */
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
