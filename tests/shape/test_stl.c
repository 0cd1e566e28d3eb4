/* Surfaces of triangles: a sphere against its closed forms, files of all formats, what is refused; surfaces that are
   taken as they are: holes, crossings, turned, doubled and inner triangles, with the volume that they should have. */
/* ranks: 1 2 */
#include "core.h"
#include "raised.h"
#include "base/log.h"
#include "shape/host.h"
#include "triangles/read.h"
#include <string.h>

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
    for (int i = 0; i < 3; i++)
      fprintf(f, "   vertex %.9g %.9g %.9g\n", (double)soup.x[t][i][0], (double)soup.x[t][i][1],
              (double)soup.x[t][i][2]);
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

/* A cube of side 2 with its corners numbered as by bits, in a format, the same for all */
static const int quad[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};

static void write_upper(FILE *f)
{
  fprintf(f, "  SOLID vertex part\r\n");
  for (PetscInt t = 0; t < soup.n; t++) {
    fprintf(f, " FACET NORMAL 0 0 0\r\n\r\n  OUTER LOOP\r\n");
    for (int i = 0; i < 3; i++)
      fprintf(f, "   VERTEX %.9gD0\t%.9ge+00 %.9g\r\n", (double)soup.x[t][i][0], (double)soup.x[t][i][1],
              (double)soup.x[t][i][2]);
    fprintf(f, t % 2 ? "  END LOOP\r\n END FACET\r\n" : "  ENDLOOP\r\n ENDFACET\r\n");
    if (t == soup.n / 2) fprintf(f, "END SOLID\r\nSolid facet two\r\n");
  }
  fprintf(f, "ENDSOLID\r\n");
}

static void write_extra(FILE *f)
{
  write_binary(f);
  fprintf(f, "colours");
}

static void write_obj(FILE *f)
{
  fprintf(f, "\xef\xbb\xbf# cube\nmtllib x\no cube\n");
  for (int c = 0; c < 8; c++)
    fprintf(f, "v %d %d %d 1 0.5 0.5\nvn 0 0 1\nvt 0 0\n", c & 1 ? 1 : -1, c & 2 ? 1 : -1, c & 4 ? 1 : -1);
  fprintf(f, "g sides\nusemtl y\n");
  for (int q = 0; q < 6; q++)
    fprintf(f,
            q < 2   ? "f %d/1/1 %d/1/1 %d/1/1 %d/1/1\n"
            : q < 4 ? "f %d//1 %d//1 \\\n %d//1 %d//1\n"
                    : "f %d %d %d %d # side\n",
            quad[q][0] - 8 * (q == 5) + (q < 5), quad[q][1] - 8 * (q == 5) + (q < 5),
            quad[q][2] - 8 * (q == 5) + (q < 5), quad[q][3] - 8 * (q == 5) + (q < 5));
}

static void write_off(FILE *f)
{
  fprintf(f, "# cube\nCOFF\n\n8 6 0 # sizes\n");
  for (int c = 0; c < 8; c++) fprintf(f, "%d %d %d 255 0 0 255\n", c & 1 ? 1 : -1, c & 2 ? 1 : -1, c & 4 ? 1 : -1);
  for (int q = 0; q < 6; q++) fprintf(f, "4 %d %d %d %d 0.1 0.2 0.3\n", quad[q][0], quad[q][1], quad[q][2], quad[q][3]);
}

static void write_ply_heading(FILE *f, const char format[])
{
  fprintf(f,
          "ply\nformat %s 1.0\ncomment cube\nelement vertex 8\nproperty float x\nproperty double y\nproperty uchar red\nproperty short z\n",
          format);
  fprintf(f,
          "element edge 1\nproperty int a\nelement face 6\nproperty uchar flag\nproperty list uchar int vertex_indices\nend_header\n");
}

static void write_ply(FILE *f)
{
  write_ply_heading(f, "ascii");
  for (int c = 0; c < 8; c++) fprintf(f, "%d %d 7 %d\n", c & 1 ? 1 : -1, c & 2 ? 1 : -1, c & 4 ? 1 : -1);
  fprintf(f, "3\n");
  for (int q = 0; q < 6; q++) fprintf(f, "1 4 %d %d %d %d\n", quad[q][0], quad[q][1], quad[q][2], quad[q][3]);
}

/* Bytes of a value of this machine, in the order asked for */
static void put_value(FILE *f, const void *value, int bytes, PetscBool big)
{
  const unsigned  one         = 1;
  const PetscBool little_here = (PetscBool)(*(const char *)&one == 1);

  for (int i = 0; i < bytes; i++) fputc(((const unsigned char *)value)[big == little_here ? bytes - 1 - i : i], f);
}

static void write_ply_binary(FILE *f, PetscBool big)
{
  const int edge = 3;

  write_ply_heading(f, big ? "binary_big_endian" : "binary_little_endian");
  for (int c = 0; c < 8; c++) {
    const float  x = c & 1 ? 1 : -1;
    const double y = c & 2 ? 1 : -1;
    const short  z = c & 4 ? 1 : -1;

    put_value(f, &x, 4, big);
    put_value(f, &y, 8, big);
    fputc(7, f);
    put_value(f, &z, 2, big);
  }
  put_value(f, &edge, 4, big);
  for (int q = 0; q < 6; q++) {
    fputc(1, f);
    fputc(4, f);
    for (int i = 0; i < 4; i++) put_value(f, &quad[q][i], 4, big);
  }
}

static void write_ply_little(FILE *f)
{
  write_ply_binary(f, PETSC_FALSE);
}

static void write_ply_big(FILE *f)
{
  write_ply_binary(f, PETSC_TRUE);
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
    error[2] = PetscMax(error[2], PetscAbsReal(d[i] + 1 -
                                               PetscSqrtReal(PetscSqr(x[3 * i]) + PetscSqr(x[3 * i + 1]) +
                                                             PetscSqr(x[3 * i + 2]))));
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

/* ---- formats ---- */

static void test_formats(void **state)
{
  void (*const write[])(FILE *) = {write_text, write_binary, write_upper,      write_extra,  write_obj,
                                   write_off,  write_ply,    write_ply_little, write_ply_big};
  const PetscReal lower[3] = {-1, -1, -1}, upper[3] = {1, 1, 1}, x[6] = {2, 0, 0, .5, .25, 0};
  PetscReal       d[2];
  ShapeMass       m;

  (void)state;
  for (size_t i = 0; i < sizeof(write) / sizeof(write[0]); i++) {
    Shape s;

    soup.n = 0;
    add_box(lower, upper);
    s = load(write[i]);
    OK(ShapeGetMass(s, &m));
    NEAR(m.volume, 8, 1e-13);
    NEAR(m.inertia[0], 16. / 3, 1e-13);
    OK(ShapeDistance(s, 2, x, d));
    NEAR(d[0], 1, 1e-14);
    NEAR(d[1], -.5, 1e-14);
    OK(ShapeDestroy(&s));
  }
}

/* ---- surfaces that are taken as they are ---- */

/* What a binary file says does not hang on the order of bytes of the machine */
static void test_bytes(void **state)
{
  const char number[4] = {0x78, 0x56, 0x34, 0x12}, top[4] = {0, 0, 0, (char)0x80};
  const char three_halves[4] = {0, 0, (char)0xc0, 0x3f},
             minus_tenth[4]  = {(char)0xcd, (char)0xcc, (char)0xcc, (char)0xbd};

  (void)state;
  assert_int_equal(read_little32(number), 0x12345678);
  assert_true(read_little32(top) == 2147483648u);
  assert_true(read_little_float(three_halves) == 1.5f);
  assert_true(read_little_float(minus_tenth) == -0.1f);
}

static void take_away(PetscInt t)
{
  soup.n--;
  OK(PetscMemmove(soup.x[t], soup.x[t + 1], (size_t)(soup.n - t) * sizeof(soup.x[0])));
}

static void begin_robust(void)
{
  OK(PetscOptionsSetValue(NULL, "-t_surface", "robust"));
  OK(PetscOptionsSetValue(NULL, "-t_origin", "0,0,0"));
}

static void end_robust(void)
{
  OK(PetscOptionsClearValue(NULL, "-t_surface"));
  OK(PetscOptionsClearValue(NULL, "-t_origin"));
}

/* Winding number of the triangles of the soup around x, of the file and as they are there */
static PetscReal wind(const PetscReal x[3])
{
  PetscReal sum = 0;

  for (PetscInt t = 0; t < soup.n; t++) {
    PetscReal r[3][3], l[3], dot[3], det;

    for (int i = 0; i < 3; i++) {
      for (int a = 0; a < 3; a++) r[i][a] = soup.x[t][i][a] - x[a];
      l[i] = PetscSqrtReal(r[i][0] * r[i][0] + r[i][1] * r[i][1] + r[i][2] * r[i][2]);
    }
    for (int i = 0; i < 3; i++)
      dot[i] = r[i][0] * r[(i + 1) % 3][0] + r[i][1] * r[(i + 1) % 3][1] + r[i][2] * r[(i + 1) % 3][2];
    det = r[0][0] * (r[1][1] * r[2][2] - r[1][2] * r[2][1]) + r[0][1] * (r[1][2] * r[2][0] - r[1][0] * r[2][2]) +
          r[0][2] * (r[1][0] * r[2][1] - r[1][1] * r[2][0]);
    sum += PetscAtan2Real(det, l[0] * l[1] * l[2] + dot[0] * l[2] + dot[1] * l[0] + dot[2] * l[1]) / (2 * PETSC_PI);
  }
  return sum;
}

/* The soup, robust: its volume; where compare is set the sign is that of its winding number; 1-Lipschitz */
static void expect_robust(PetscReal volume, PetscReal error, PetscBool compare, const char remark[])
{
  enum {
    N = 400
  };
  PetscReal          x[N * 3], d[N];
  ShapeMass          m;
  Shape              s;
  PetscInt           n;
  const char *const *text;

  OK(LogFinalize());
  s = load(write_text);
  OK(LogGetRemarks(&n, &text));
  if (remark) {
    assert_int_equal(n, 1);
    if (!strstr(text[0], remark)) fail_msg("'%s' is not in '%s'", remark, text[0]);
  } else assert_int_equal(n, 0);
  OK(ShapeGetMass(s, &m));
  NEAR(m.volume, volume, error * volume);
  for (PetscInt i = 0; i < 3 * N; i++)
    x[i] = (i < 3 * N / 2 ? 1.6 : 1e-3) * noise(i) + (i < 3 * N / 2 ? 0 : x[i - 3 * N / 2]);
  OK(ShapeDistance(s, N, x, d));
  for (PetscInt i = 0; i < N; i++) {
    const PetscInt  j = i < N / 2 ? (i + 1) % (N / 2) : i - N / 2;
    const PetscReal w = wind(x + 3 * i);

    if (compare && PetscAbsReal(w - .5) > 1e-3) assert_int_equal(w > .5, d[i] < 0);
    assert_true(PetscAbsReal(d[i] - d[j]) <=
                1e-12 + PetscSqrtReal(PetscSqr(x[3 * i] - x[3 * j]) + PetscSqr(x[3 * i + 1] - x[3 * j + 1]) +
                                      PetscSqr(x[3 * i + 2] - x[3 * j + 2])));
  }
  OK(ShapeDestroy(&s));
}

/* Volume of the sphere of 512 triangles as a closed surface */
static PetscReal measure_closed(void)
{
  ShapeMass m;
  Shape     s;

  make_sphere(3);
  s = load(write_text);
  OK(ShapeGetMass(s, &m));
  OK(ShapeDestroy(&s));
  return m.volume;
}

static void test_holes(void **state)
{
  const PetscReal lower[3] = {-1, -1, -1}, upper[3] = {1, 1, 1};
  PetscReal       volume;

  (void)state;
  volume = measure_closed();
  begin_robust();
  expect_robust(volume, 1e-12, PETSC_TRUE, NULL); /* closed: nothing to say, the same body */
  for (PetscInt t = soup.n - 1; t >= 0; t -= 37) take_away(t);
  expect_robust(volume, 1e-12, PETSC_TRUE, "42 open edges, 14 holes, closed");
  make_sphere(3);
  for (PetscInt t = soup.n - 1; t >= 0; t--) /* a cap of height .11 is removed: pi h^2 (1 - h / 3) of it */
    if (PetscMin(soup.x[t][0][2], PetscMin(soup.x[t][1][2], soup.x[t][2][2])) < -.9) take_away(t);
  expect_robust(volume, 1e-2, PETSC_FALSE, "1 holes, closed");
  soup.n = 0;
  add_box(lower, upper);
  soup.n -= 2; /* a whole side */
  expect_robust(8, 1e-12, PETSC_TRUE, "4 open edges, 1 holes, closed");
  end_robust();
}

static void test_turned(void **state)
{
  const PetscReal volume       = measure_closed(),
                  box[2][2][3] = {{{-1, -1, -1}, {1, 1, 1}}, {{-.5, -.5, -.5}, {.5, .5, .5}}};

  (void)state;
  begin_robust();
  make_sphere(3);
  for (PetscInt t = 0; t < soup.n; t += 5) turn_over(t, t + 1);
  expect_robust(volume, 1e-12, PETSC_FALSE, "103 turned triangles");
  make_sphere(3);
  turn_over(0, soup.n);
  expect_robust(volume, 1e-12, PETSC_FALSE, "512 turned triangles");
  make_sphere(3);
  for (PetscInt t = 0; t < 50; t++) OK(PetscMemcpy(soup.x[soup.n++], soup.x[t], sizeof(soup.x[0])));
  turn_over(512, 530);
  expect_robust(volume, 1e-12, PETSC_FALSE, "50 doubled triangles, dropped");
  soup.n = 0; /* a hollow stays one, also of a box turned inside out */
  for (int b = 0; b < 2; b++) add_box(box[b][0], box[b][1]);
  turn_over(12, 24);
  expect_robust(7, 1e-12, PETSC_TRUE, NULL);
  turn_over(0, 24);
  expect_robust(7, 1e-12, PETSC_FALSE, "24 turned triangles");
  end_robust();
}

/* Boxes that cross, lie in each other, share a side or its plane, one with a wall inside */
static void test_crossing(void **state)
{
  const PetscReal a[2][3] = {{-1, -1, -1}, {1, 1, 1}};
  const struct {
    PetscReal   lower[3], upper[3], volume;
    const char *remark;
  } other[] = {
    {{-.5, -.25, -.25}, {1.4, .25, .25}, 8.1, "10 triangles that others go through, cut"},
    {{.5, .5, .5}, {1.5, 1.5, 1.5}, 9 - .125, "triangles that others go through, cut"},
    {{-.5, -.5, -.5}, {.5, .5, .5}, 8, NULL},
    {{0, -1, -1}, {1.5, 1, 1}, 10, "triangles that others go through, cut"},
    {{1, -1, -1}, {1.5, 1, 1}, 10, "2 doubled triangles, dropped, 1 inner sheets, dropped"},
  };

  (void)state;
  begin_robust();
  for (size_t i = 0; i < sizeof(other) / sizeof(other[0]); i++) {
    soup.n = 0;
    add_box(a[0], a[1]);
    add_box(other[i].lower, other[i].upper);
    expect_robust(other[i].volume, 1e-12, (PetscBool)(i < 4), other[i].remark);
  }
  soup.n = 0; /* six sides that do not quite meet */
  add_box(a[0], a[1]);
  for (PetscInt k = 0; k < 12 * 9; k++) {
    const PetscInt t = k / 9, c = k % 3, normal[6] = {2, 2, 1, 1, 0, 0};

    if (normal[t / 2] != c) soup.x[t][k / 3 % 3][c] *= .9995;
  }
  expect_robust(8, 2e-3, PETSC_FALSE, "24 open edges, 16 corners welded");
  end_robust();
}

/* Far nodes by their expansions against all triangles, on a surface with holes that no symmetry helps */
static void test_winding(void **state)
{
  Surface   f = {.n = 0};
  Moment   *m;
  PetscReal worst = 0, *xyz;

  (void)state;
  make_sphere(3);
  for (PetscInt t = soup.n - 1; t >= 0; t -= 7) take_away(t);
  OK(PetscMalloc1(9 * soup.n, &xyz));
  for (PetscInt i = 0; i < 9 * soup.n; i++) xyz[i] = soup.x[i / 9][i / 3 % 3][i % 3] * (i % 3 + 1);
  OK(SurfaceJoinCorners(&f, soup.n, xyz, 1));
  OK(SurfaceBuildTree(&f));
  OK(SurfaceMakeNormals(&f, PETSC_FALSE));
  OK(SurfaceMakeMoments(&f, &m));
  for (PetscInt i = 0; i < 500; i++) {
    PetscReal x[3];

    for (int a = 0; a < 3; a++) x[a] = 2 * noise(3 * i + a) * (a + 1);
    worst = PetscMax(worst, PetscAbsReal(SurfaceWindingFast(&f, m, x) - SurfaceWinding(&f, x)));
  }
  print_message("winding number of expansions: within %.2g\n", (double)worst);
  BELOW(worst, 5e-3);
  assert_true(worst > 1e-9); /* some nodes were far */
  OK(PetscFree(m));
  OK(PetscFree(xyz));
  OK(SurfaceDestroy(&f));
}

/* ---- what is refused ---- */

static void write_words(FILE *f)
{
  fprintf(f, "solid x\nvertex 0 0 0\nvertex 1 zero 0\n");
}

static void write_nonsense(FILE *f)
{
  fprintf(f, "PK nothing like it\n");
}

static void write_cut_off(FILE *f)
{
  fprintf(f, "solid x\nvertex 0 0 0\nvertex 1 0 0\n");
}

static void test_refused(void **state)
{
  const PetscReal box[3][2][3] = {{{0, 0, 0}, {1, 1, 1}},
                                  {{.5, .25, .25}, {1.5, .75, .75}},
                                  {{.25, .25, .25}, {.75, .75, .75}}};

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
  refuse(write_words, ":3: expected a finite number, found 'zero'", file);
  refuse(write_nonsense, "is no STL file", "begins with 'solid'");
  soup.n = 0;
  for (int k = 0; k < 2; k++) add_box(box[0][0], box[0][1]);
  soup.n = 2;
  refuse(write_text, "has 2 triangles: a body needs 4", file);
  refuse(write_cut_off, "a face of 2 corners", "cut off");
}

static void test_nothing(void **state)
{
  (void)state;
  make_sphere(2); /* four triangles apart from each other, closed by themselves */
  for (int k = 1; k < 4; k++) OK(PetscMemcpy(soup.x[k], soup.x[17 * k], sizeof(soup.x[0])));
  soup.n = 4;
  OK(PetscOptionsSetValue(NULL, "-t_surface", "robust"));
  refuse(write_text, "encloses nothing", "a body needs an inside");
  OK(PetscOptionsSetValue(NULL, "-t_surface", "open"));
  refuse(write_text, "-t_surface 'open' is none of closed, robust", "closed");
  end_robust();
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_sphere_converges), cmocka_unit_test(test_boxes),
    cmocka_unit_test(test_formats),          cmocka_unit_test(test_holes),
    cmocka_unit_test(test_winding),          cmocka_unit_test(test_turned),
    cmocka_unit_test(test_crossing),         cmocka_unit_test(test_refused),
    cmocka_unit_test(test_nothing),          cmocka_unit_test(test_bytes),
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
  PetscCall(LogFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
