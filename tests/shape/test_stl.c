/* Surfaces of triangles: a sphere against its closed forms, text and binary files, what is refused; composites. */
/* ranks: 1 2 */
#include "core.h"
#include "raised.h"
#include "shape/host.h"

#define DEEPEST 5
#define MOST    (20 << 2 * DEEPEST)

typedef struct {
  PetscInt  n;
  PetscReal x[MOST][3][3];
} Soup;

static Soup soup;
static char file[64];

/* ---- triangles ---- */

static void unit(PetscReal v[3])
{
  const PetscReal r = PetscSqrtReal(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);

  for (int a = 0; a < 3; a++) v[a] /= r;
}

static void split(const PetscReal t[3][3], PetscInt level)
{
  PetscReal middle[3][3];

  if (!level) {
    OK(PetscMemcpy(soup.x[soup.n++], t, 9 * sizeof(PetscReal)));
    return;
  }
  for (int i = 0; i < 3; i++) {
    for (int a = 0; a < 3; a++) middle[i][a] = t[i][a] + t[(i + 1) % 3][a];
    unit(middle[i]);
  }
  for (int i = 0; i < 3; i++) {
    PetscReal corner[3][3];

    for (int a = 0; a < 3; a++) {
      corner[0][a] = t[i][a];
      corner[1][a] = middle[i][a];
      corner[2][a] = middle[(i + 2) % 3][a];
    }
    split(corner, level - 1);
  }
  split(middle, level - 1);
}

/* The faces of an octahedron, refined: 8 4^level triangles on the unit sphere */
static void make_sphere(PetscInt level)
{
  soup.n = 0;
  for (int o = 0; o < 8; o++) {
    const PetscReal s[3]    = {o & 1 ? -1 : 1, o & 2 ? -1 : 1, o & 4 ? -1 : 1};
    const int       turn    = s[0] * s[1] * s[2] > 0 ? 1 : 2;
    PetscReal       t[3][3] = {{0}};

    for (int i = 0; i < 3; i++) t[i][i * turn % 3] = s[i * turn % 3];
    split(t, level);
  }
}

static void add_box(const PetscReal lower[3], const PetscReal upper[3])
{
  const int face[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};

  for (int k = 0; k < 12; k++)
    for (int i = 0; i < 3; i++) {
      const int c = face[k / 2][i ? i + k % 2 : 0];

      for (int a = 0; a < 3; a++) soup.x[soup.n][i][a] = c >> a & 1 ? upper[a] : lower[a];
      soup.n += i == 2;
    }
}

static void turn_over(PetscInt first, PetscInt end)
{
  for (PetscInt t = first; t < end; t++)
    for (int a = 0; a < 3; a++) {
      const PetscReal x = soup.x[t][1][a];

      soup.x[t][1][a] = soup.x[t][2][a];
      soup.x[t][2][a] = x;
    }
}

/* ---- files ---- */

static void write_text(FILE *f)
{
  fprintf(f, "solid test\n");
  for (PetscInt t = 0; t < soup.n; t++) {
    fprintf(f, " facet normal 0 0 0\n  outer loop\n");
    for (int i = 0; i < 3; i++) fprintf(f, "   vertex %.9g %.9g %.9g\n", (double)soup.x[t][i][0], (double)soup.x[t][i][1], (double)soup.x[t][i][2]);
    fprintf(f, "  endloop\n endfacet\n");
  }
  fprintf(f, "endsolid test\n");
}

static void write_binary(FILE *f)
{
  const char     heading[80] = "solid, says the heading of this binary file";
  const unsigned n           = (unsigned)soup.n;
  const short    none        = 0;

  fwrite(heading, 1, sizeof(heading), f);
  fwrite(&n, 4, 1, f);
  for (PetscInt t = 0; t < soup.n; t++) {
    float v[12] = {0};

    for (int i = 0; i < 9; i++) v[3 + i] = (float)soup.x[t][i / 3][i % 3];
    fwrite(v, sizeof(v), 1, f);
    fwrite(&none, 2, 1, f);
  }
}

static void write_file(void (*write)(FILE *))
{
  PetscMPIInt rank;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  if (!rank) {
    FILE *f = fopen(file, "wb");

    assert_non_null(f);
    if (write) write(f);
    fclose(f);
  }
  OK(MPI_Barrier(PETSC_COMM_WORLD));
}

static Shape load(void (*write)(FILE *))
{
  Shape s;

  write_file(write);
  OK(ShapeCreate("stl", "t_", 3, &s));
  return s;
}

static void refuse(void (*write)(FILE *), const char text[], const char more[])
{
  Shape s;

  write_file(write);
  begin_error();
  expect_error(ShapeCreate("stl", "t_", 3, &s), PETSC_ERR_USER_INPUT, text, more, NULL);
}

/* ---- sphere ---- */

/* Volume, moment of inertia and the largest error of the distance, all against the unit sphere */
static void measure_sphere(PetscInt level, PetscReal error[3])
{
  enum {
    N = 200
  };
  PetscReal x[N * 3], d[N];
  ShapeMass m;
  Shape     s;

  make_sphere(level);
  s = load(write_binary);
  OK(ShapeGetMass(s, &m));
  error[0] = PetscAbsReal(m.volume / (4 * PETSC_PI / 3) - 1);
  error[1] = PetscAbsReal(m.inertia[1] / (8 * PETSC_PI / 15) - 1);
  error[2] = 0;
  BELOW(m.centroid[0], 1e-7);
  BELOW(m.inertia[3], 1e-7);
  for (PetscInt i = 0; i < 3 * N; i++) x[i] = 1.5 * noise(i);
  OK(ShapeDistance(s, N, x, d));
  for (PetscInt i = 0; i < N; i++)
    error[2] = PetscMax(error[2], PetscAbsReal(d[i] + 1 - PetscSqrtReal(PetscSqr(x[3 * i]) + PetscSqr(x[3 * i + 1]) + PetscSqr(x[3 * i + 2]))));
  OK(ShapeDestroy(&s));
}

static void test_sphere_converges(void **state)
{
  PetscReal coarse[3], middle[3], fine[3];

  (void)state;
  measure_sphere(3, coarse); /* 512 triangles */
  measure_sphere(4, middle);
  measure_sphere(5, fine); /* 8192 */
  for (int k = 0; k < 3; k++) {
    expect_rate("volume, inertia, distance", coarse[k], middle[k], 2);
    expect_rate("volume, inertia, distance", middle[k], fine[k], 2);
  }
  BELOW(fine[0], 2e-3);
  BELOW(fine[1], 3e-3);
  BELOW(fine[2], 1e-3);
}

/* A hollow box with a second one beside it: exact; the same from text, scaled */
static void test_boxes(void **state)
{
  const PetscReal corner[3][2][3] = {{{0, 0, 0}, {4, 2, 2}}, {{1, .5, .5}, {2, 1.5, 1.5}}, {{5, 0, 0}, {6, 2, 2}}};
  const PetscReal x[5][3]         = {{.25, 1, 1}, {1.5, 1, 1}, {4.75, 1, 1}, {5.25, 1, 1}, {-3, -4, 1}};
  const PetscReal expected[5]     = {-.25, .5, .25, -.25, 5};
  PetscReal       d[5];
  ShapeMass       m;
  Shape           s;

  (void)state;
  soup.n = 0;
  for (int b = 0; b < 3; b++) add_box(corner[b][0], corner[b][1]);
  turn_over(12, 24);
  OK(PetscOptionsSetValue(NULL, "-t_origin", "0,0,0"));
  for (int text = 0; text < 2; text++) {
    const PetscReal scale = text ? 1e-3 : 1;
    PetscReal       y[15];

    OK(PetscOptionsSetValue(NULL, "-t_scale", text ? "1e-3" : "1"));
    s = load(text ? write_text : write_binary);
    for (int i = 0; i < 15; i++) y[i] = scale * x[i / 3][i % 3];
    OK(ShapeDistance(s, 5, y, d));
    for (int i = 0; i < 5; i++) NEAR(d[i], scale * expected[i], 1e-14 * scale);
    OK(ShapeGetMass(s, &m));
    NEAR(m.volume, 19 * PetscPowReal(scale, 3), 1e-13 * PetscPowReal(scale, 3));
    NEAR(m.centroid[0], scale * (16 * 2 - 1.5 + 4 * 5.5) / 19, 1e-13 * scale);
    OK(ShapeDestroy(&s));
  }
  OK(PetscOptionsClearValue(NULL, "-t_origin"));
  OK(PetscOptionsClearValue(NULL, "-t_scale"));
}

/* ---- what is refused ---- */

static void write_words(FILE *f)
{
  fprintf(f, "solid x\nvertex 0 0 0\nvertex 1 zero 0\n");
}

static void write_nonsense(FILE *f)
{
  fprintf(f, "ply\nformat ascii 1.0\n");
}

static void write_cut_off(FILE *f)
{
  fprintf(f, "solid x\nvertex 0 0 0\nvertex 1 0 0\n");
}

static void test_refused(void **state)
{
  const PetscReal box[3][2][3] = {{{0, 0, 0}, {1, 1, 1}}, {{.5, .25, .25}, {1.5, .75, .75}}, {{.25, .25, .25}, {.75, .75, .75}}};

  (void)state;
  make_sphere(2);
  soup.n--;
  refuse(write_text, "3 have a triangle on one side only (holes), 0 have more than two, at 0", "the first at (");
  make_sphere(2);
  turn_over(7, 8);
  refuse(write_binary, "at 3 the triangles face to opposite sides (turned normals)", "Repair it with a mesh program");
  make_sphere(2);
  turn_over(0, soup.n);
  refuse(write_binary, "faces inwards (its volume is -", "turn all normals");
  soup.n = 0;
  add_box(box[0][0], box[0][1]);
  add_box(box[1][0], box[1][1]);
  refuse(write_binary, "crosses itself", "join its parts");
  soup.n = 0;
  add_box(box[0][0], box[0][1]);
  add_box(box[2][0], box[2][1]);
  refuse(write_binary, "where its closest triangle says", "lies inside of another");
  refuse(write_words, ":3: expected three finite numbers after 'vertex'", file);
  refuse(write_nonsense, "is no STL file", "begins with 'solid'");
  refuse(write_cut_off, "2 corners, which is no multiple of three", "cut off");
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_sphere_converges),
    cmocka_unit_test(test_boxes),
    cmocka_unit_test(test_refused),
  };
  PetscMPIInt size, rank;
  int         failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  snprintf(file, sizeof(file), "test_stl_%d.stl", size);
  PetscCall(PetscOptionsSetValue(NULL, "-t_file", file));
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (!rank) (void)remove(file);
  if (!failed) PetscCall(ShapeFinalize());
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
