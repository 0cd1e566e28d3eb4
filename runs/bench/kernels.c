/* Kernels: each kernel of device/device.h on a box of n^3 cells: nanoseconds a cell and GB/s of the bytes that it must
   move, and its result beside that of the same kernel on the processor. Without PETSc. runs/bench/kernels.sh compiles
   and runs it.

     kernels cuda|cpu n [repeats]     n a multiple of 4; below 17 results are compared */
#include "device/device.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define OK(call) \
  do { \
    const int e_ = (call); \
    if (e_) { \
      fprintf(stderr, "%s: %s\n", #call, (*queue.run->explain)(e_)); \
      exit(1); \
    } \
  } while (0)

static DeviceQueue queue, cpu;
static int         n, nc, nn, nv, repeats, compare;
static double      worst;

/* The mesh: cells in bricks of 4 x 4 x 2, nodes as cells meet them */
static int *place, *cell_at, *node, *lattice_node;

static void *need(size_t bytes)
{
  void *p = calloc(bytes + 1, 1);

  if (!p) exit(1);
  return p;
}

static double noise(size_t i)
{
  unsigned long long z = (i + 1) * 0x9e3779b97f4a7c15ull;

  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return (double)((z ^ (z >> 31)) >> 11) / 4503599627370496.0 - 1;
}

static double *random_numbers(size_t m, size_t seed)
{
  double *v = need(m * sizeof(double));

  for (size_t i = 0; i < m; i++) v[i] = noise(seed * 1000003 + i);
  return v;
}

static void build_mesh(void)
{
  const int n1 = 2 * n + 1;
  int       at = 0;

  nc           = n * n * n;
  nv           = (n + 1) * (n + 1) * (n + 1);
  place        = need(sizeof(int) * (size_t)nc);
  cell_at      = need(sizeof(int) * (size_t)nc);
  node         = need(sizeof(int) * (size_t)nc * 27);
  lattice_node = need(sizeof(int) * (size_t)n1 * (size_t)n1 * (size_t)n1);
  for (int k = 0; k < n; k += 2)
    for (int j = 0; j < n; j += 4)
      for (int i = 0; i < n; i += 4)
        for (int e = 0; e < 32; e++) {
          place[at]          = i + e % 4 + n * (j + e / 4 % 4 + n * (k + e / 16));
          cell_at[place[at]] = at;
          at++;
        }
  nn = 0;
  for (int c = 0; c < nc; c++)
    for (int l = 0; l < 27; l++) {
      const int x = place[c] % n * 2 + l % 3, y = place[c] / n % n * 2 + l / 3 % 3, z = place[c] / n / n * 2 + l / 9;
      int      *p = lattice_node + x + (size_t)n1 * ((size_t)y + (size_t)n1 * (size_t)z);

      if (!*p) *p = ++nn;
      node[(size_t)c * 27 + (size_t)l] = *p - 1;
    }
}

/* others: as cells that are no boxes, slightly bent */
static void make_cells(const DeviceQueue *q, int others, DeviceCells *cells)
{
  unsigned char *kind = need((size_t)nc);
  double *box = need(sizeof(double) * 4 * (size_t)nc), *position = need(others ? sizeof(double) * 81 * (size_t)nc : 8);
  DeviceMesh   m = {.nnode = nn, .ncell = nc, .node = node, .kind = kind, .box = box, .position = position};
  const double h = 1.0 / n;

  memset(kind, others ? DEVICE_OTHER : DEVICE_BOX, (size_t)nc);
  for (int c = 0; c < nc; c++) {
    box[4 * c] = h * h * h / 8;
    for (int a = 0; a < 3; a++) box[4 * c + 1 + a] = 2 / h;
    for (int l = 0; l < 27 && others; l++) {
      const double x[3] = {(place[c] % n + 0.5 * (l % 3)) * h, (place[c] / n % n + 0.5 * (l / 3 % 3)) * h,
                           (place[c] / n / n + 0.5 * (l / 9)) * h};

      for (int a = 0; a < 3; a++)
        position[(size_t)c * 81 + (size_t)(3 * l + a)] = x[a] + 0.03 * sin(3.1 * x[0]) * sin(3.1 * x[1] * (1 + a)) *
                                                                  sin(3.1 * x[2]);
    }
  }
  if (DeviceCellsCreate(q, &m, cells)) exit(1);
  free(kind);
  free(box);
  free(position);
}

static void *bring(size_t bytes, const void *host)
{
  void *p;

  OK((*queue.run->allocate)(&queue, bytes, &p));
  if (host) OK((*queue.run->upload)(&queue, bytes, host, p));
  else OK((*queue.run->zero)(&queue, bytes, p));
  return p;
}

static double now(void)
{
  struct timespec t;

  OK((*queue.run->wait)(&queue));
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void print_row(const char what[], double seconds, double bytes)
{
  printf("%-44s %8.3f %8.0f\n", what, 1e9 * seconds / nc, 1e-9 * bytes * nc / seconds);
  fflush(stdout);
}

/* `call` once for the comparison, with `out` zero before, then `repeats` times */
#define RUN(what, bytes, call) \
  do { \
    double start_; \
\
    OK(call); \
    start_ = now(); \
    for (int r_ = 0; r_ < repeats; r_++) OK(call); \
    print_row(what, (now() - start_) / repeats, bytes); \
  } while (0)

/* out [m] on the device beside want on the processor */
static void check(const char what[], size_t m, const double *out, const double *want)
{
  double *got = need(m * sizeof(double)), most = 0, size = 0;

  OK((*queue.run->download)(&queue, m * sizeof(double), out, got));
  for (size_t i = 0; i < m; i++) {
    const double d = fabs(got[i] - want[i]);

    if (!(d <= most)) most = d;
    if (fabs(want[i]) > size) size = fabs(want[i]);
  }
  printf("  %-42s differs by %.1e\n", what, most / size);
  if (!(most / size <= worst)) worst = most / size;
  free(got);
}

/* One kernel: compared (n small) or timed. host, there: the call with arrays of the processor and of the device */
#define TRY(what, bytes, m, out_host, out_there, host, there) \
  do { \
    if (compare) { \
      memset(out_host, 0, (m) * sizeof(double)); \
      OK((*queue.run->zero)(&queue, (m) * sizeof(double), out_there)); \
      if (host) exit(1); \
      OK(there); \
      check(what, m, out_there, out_host); \
    } else RUN(what, bytes, there); \
  } while (0)

static void try_velocity(int others)
{
  const size_t nu = 3 * (size_t)nn, np = 4 * (size_t)nc;
  const double nodes = 24 * 8, form_bytes = others ? 27 * 10 * 8 : 85 * 8, list = 108, constant[3] = {0.1, 0.2, 0.3},
               factor[] = {0.3, -0.7};
  DeviceForm  form      = {.convection = 1, .a = 3, .b = 0.1, .scale = 1.5};
  DeviceCells hc, c;
  size_t      nk;
  double     *w = random_numbers(nu, 1), *x = random_numbers(nu, 2), *y = need(nu * 8), *p = random_numbers(np, 3),
         *out = need(np * 8), *k, *dw, *dx, *dy, *dp, *dout, *dk, *b = random_numbers(324, 4);
  int             *zero = need((size_t)nc * sizeof(int));
  DeviceDivergence hd = {.kind = zero, .shared = b, .shared_mass = b}, dd = {0};

  make_cells(&cpu, others, &hc);
  make_cells(&queue, others, &c);
  nk = DeviceCoefficients(&c, &form);
  k  = need(compare ? nk * 8 : 8);
  dw = bring(nu * 8, w), dx = bring(nu * 8, x), dy = bring(nu * 8, NULL), dp = bring(np * 8, p),
  dout = bring(np * 8, NULL);
  dk   = bring(nk * 8, NULL);
  TRY(others ? "convection at points, curved" : "convection at points", list + nodes + form_bytes, nk, k, dk,
      (*cpu.run->set_coefficients)(&cpu, &hc, &form, w, NULL, k),
      (*queue.run->set_coefficients)(&queue, &c, &form, dw, NULL, dk));
  TRY(others ? "S x, curved" : "S x", list + 2 * nodes + form_bytes, nu, y, dy,
      (*cpu.run->multiply)(&cpu, &hc, &form, k, 0, x, y), (*queue.run->multiply)(&queue, &c, &form, dk, 0, dx, dy));
  TRY(others ? "diagonal, curved" : "diagonal", list + form_bytes + 64, (size_t)nn, y, dy,
      (*cpu.run->add_diagonal)(&cpu, &hc, &form, k, y), (*queue.run->add_diagonal)(&queue, &c, &form, dk, dy));
  {
    const double *const hv[] = {x, w}, *const dv[] = {dx, dw};

    TRY(others ? "mass of two vectors, curved" : "mass of two vectors", list + 3 * nodes, nu, y, dy,
        (*cpu.run->add_mass)(&cpu, &hc, &form, k, 2, 2, hv, factor, constant, y),
        (*queue.run->add_mass)(&queue, &c, &form, dk, 2, 2, dv, factor, constant, dy));
  }
  if (!others) {
    dd             = (DeviceDivergence){.kind = bring((size_t)nc * sizeof(int), zero), .shared = bring(324 * 8, b)};
    dd.shared_mass = dd.shared;
    TRY("B u", list + nodes + 64, np, out, dout, (*cpu.run->divergence)(&cpu, &hc, &hd, 2, x, 0.5, p, out),
        (*queue.run->divergence)(&queue, &c, &dd, 2, dx, 0.5, dp, dout));
    TRY("M^-1 B^T p", list + 2 * nodes + 32, nu, y, dy, (*cpu.run->add_gradient)(&cpu, &hc, &hd, 0, 2, w, p, y),
        (*queue.run->add_gradient)(&queue, &c, &dd, 0, 2, dw, dp, dy));
    TRY("mass of the pressure", 4 + 96, np, out, dout, (*cpu.run->add_pressure_mass)(&cpu, &hc, &hd, 2, p, out),
        (*queue.run->add_pressure_mass)(&queue, &c, &dd, 2, dp, dout));
    TRY("mean gradients", list + nodes + 8, np, out, dout, (*cpu.run->gradients)(&cpu, &hc, &hd, x, out),
        (*queue.run->gradients)(&queue, &c, &dd, dx, dout));
    TRY("largest speeds of cells", list + nodes + 16, 2 * (size_t)nc, out, dout,
        (*cpu.run->speeds)(&cpu, &hc, constant, x, out), (*queue.run->speeds)(&queue, &c, constant, dx, dout));
  }
  DeviceCellsDestroy(&cpu, &hc);
  DeviceCellsDestroy(&queue, &c);
  {
    void *host[]  = {w, x, y, p, out, k, b, zero},
         *there[] = {dw, dx, dy, dp, dout, dk, (void *)dd.kind, (void *)dd.shared};

    for (int i = 0; i < 8; i++) {
      free(host[i]);
      OK((*queue.run->release)(&queue, there[i]));
    }
  }
}

/* Rows of cells that lie alike, 27 kinds */
static void make_rows(DeviceRows *h)
{
  int *start = need(((size_t)nc + 1) * sizeof(int)), *column = need((size_t)nc * 27 * sizeof(int)),
      *at = need((size_t)nc * sizeof(int)), *kind = need((size_t)nc * sizeof(int));
  double *value  = random_numbers(27 * 27 * 16, 5);
  float  *single = need(27 * 27 * 16 * sizeof(float)), *inverse = need(27 * 16 * sizeof(float));

  for (int i = 0; i < 27 * 27 * 16; i++) single[i] = (float)value[i];
  for (int i = 0; i < 27 * 16; i++) inverse[i] = (float)noise(77 + (size_t)i);
  for (int c = 0; c < nc; c++) {
    const int p[3] = {place[c] % n, place[c] / n % n, place[c] / n / n};
    int       m    = start[c];

    for (int a = 2; a >= 0; a--) kind[c] = 3 * kind[c] + (p[a] == 0 ? 0 : p[a] == n - 1 ? 2 : 1);
    at[c] = 27 * kind[c];
    for (int q = 0; q < 27; q++) {
      const int x = p[0] + q % 3 - 1, y = p[1] + q / 3 % 3 - 1, z = p[2] + q / 9 - 1;

      if (x >= 0 && y >= 0 && z >= 0 && x < n && y < n && z < n) column[m++] = cell_at[x + n * (y + n * z)];
    }
    start[c + 1] = m;
  }
  *h = (DeviceRows){nc, start[nc], 27 * 27, start, column, at, kind, value, single, inverse};
}

static void try_rows(void)
{
  const size_t np = 4 * (size_t)nc;
  DeviceRows   h, r;
  double      *x = random_numbers(np, 6), *b = random_numbers(np, 7), *d = random_numbers(np, 8), *y = need(np * 8);

  make_rows(&h);
  r = (DeviceRows){nc,
                   h.start[nc],
                   27 * 27,
                   bring(((size_t)nc + 1) * 4, h.start),
                   bring((size_t)h.start[nc] * 4, h.column),
                   bring((size_t)nc * 4, h.at),
                   bring((size_t)nc * 4, h.kind),
                   bring(27 * 27 * 128, h.value),
                   bring(27 * 27 * 64, h.single),
                   bring(27 * 64, h.inverse)};
  {
    double *dx = bring(np * 8, x), *db = bring(np * 8, b), *dd = bring(np * 8, d), *dy = bring(np * 8, NULL);
    const DeviceChebyshev hs = {0.3, 0.6, b, x, d, y}, ds = {0.3, 0.6, db, dx, dd, dy}, h0 = {0, 0.6, b, NULL, d, y},
                          d0 = {0, 0.6, db, NULL, dd, dy};

    TRY("S_p p", 27 * 4 + 80, np, y, dy, (*cpu.run->multiply_rows)(&cpu, &h, x, y),
        (*queue.run->multiply_rows)(&queue, &r, dx, dy));
    TRY("S_p p, single precision, residual", 27 * 4 + 112, np, y, dy, (*cpu.run->residual_rows)(&cpu, &h, b, x, y),
        (*queue.run->residual_rows)(&queue, &r, db, dx, dy));
    TRY("Chebyshev on P1disc", 27 * 4 + 180, np, y, dy, (*cpu.run->smooth_rows)(&cpu, &h, &hs),
        (*queue.run->smooth_rows)(&queue, &r, &ds));
    TRY("Chebyshev on P1disc, the first", 108, np, y, dy, (*cpu.run->smooth_rows)(&cpu, &h, &h0),
        (*queue.run->smooth_rows)(&queue, &r, &d0));
  }
}

static void try_vertices(void)
{
  const size_t np     = 4 * (size_t)nc;
  int         *vertex = need((size_t)nc * 32), *form = need((size_t)nc * 4), *column = need((size_t)nv * 27 * 4);
  double      *value = random_numbers((size_t)nv * 27, 9), *fit = random_numbers(32, 10), *p = random_numbers(np, 11),
         *v = random_numbers((size_t)nv, 12), *b = random_numbers((size_t)nv, 13), *y = need(np * 8), *d = need(np * 8);
  DeviceTransfer ht = {nc, nv, vertex, form, fit}, t;
  DeviceSparse   ha = {nv, 27, column, value}, a;

  for (int c = 0; c < nc; c++)
    for (int s = 0; s < 8; s++)
      vertex[(size_t)s * (size_t)nc + (size_t)c] = place[c] % n + (s & 1) +
                                                   (n + 1) * (place[c] / n % n + (s >> 1 & 1) +
                                                              (n + 1) * (place[c] / n / n + (s >> 2)));
  for (int i = 0; i < nv; i++)
    for (int q = 0; q < 27; q++) {
      const int m = n + 1, x = i % m + q % 3 - 1, z = i / m / m + q / 9 - 1, yy = i / m % m + q / 3 % 3 - 1;
      const int in = x >= 0 && yy >= 0 && z >= 0 && x < m && yy < m && z < m;

      column[(size_t)q * (size_t)nv + (size_t)i] = in ? x + m * (yy + m * z) : 0;
      if (!in) value[(size_t)q * (size_t)nv + (size_t)i] = 0;
    }
  t = (DeviceTransfer){nc, nv, bring((size_t)nc * 32, vertex), bring((size_t)nc * 4, form), bring(32 * 8, fit)};
  a = (DeviceSparse){nv, 27, bring((size_t)nv * 27 * 4, column), bring((size_t)nv * 27 * 8, value)};
  {
    double *dp = bring(np * 8, p), *dv = bring((size_t)nv * 8, v), *db = bring((size_t)nv * 8, b),
           *dy = bring(np * 8, NULL), *dd = bring(np * 8, NULL);
    const DeviceChebyshev hs = {0.3, 0.6, b, v, d, y}, ds = {0.3, 0.6, db, dv, dd, dy};

    TRY("restriction to vertices", 76, (size_t)nv, y, dy, (*cpu.run->vertices.add_restricted)(&cpu, &ht, p, y),
        (*queue.run->vertices.add_restricted)(&queue, &t, dp, dy));
    TRY("interpolation from vertices", 108, np, y, dy, (*cpu.run->vertices.add_interpolated)(&cpu, &ht, v, y),
        (*queue.run->vertices.add_interpolated)(&queue, &t, dv, dy));
    TRY("Q1 product", 27 * 12 + 16, (size_t)nv, y, dy, (*cpu.run->multiply_sparse)(&cpu, &ha, 0, v, y),
        (*queue.run->multiply_sparse)(&queue, &a, 0, dv, dy));
    TRY("Q1 transposed product", 27 * 12 + 16, (size_t)nv, y, dy, (*cpu.run->add_transposed)(&cpu, &ha, v, y),
        (*queue.run->add_transposed)(&queue, &a, dv, dy));
    TRY("Q1 Chebyshev", 27 * 12 + 48, (size_t)nv, y, dy, (*cpu.run->smooth_sparse)(&cpu, &ha, v, &hs),
        (*queue.run->smooth_sparse)(&queue, &a, dv, &ds));
  }
}

static void try_sums(void)
{
  const size_t m = 3 * (size_t)nn;
  double      *a = random_numbers(m, 14), *b = random_numbers(m, 15), *y = need(m * 8), partial[DEVICE_PARTIAL], out[3];
  double      *da = bring(m * 8, a), *db = bring(m * 8, b), *dy = bring(m * 8, NULL),
         *dpartial = bring(sizeof(partial), NULL), *dout = bring(24, NULL);
  const double *const hv[] = {a, b}, *const dv[] = {da, db}, factor[] = {0.3, -0.7}, shift[] = {0.1, 0.2, -0.3};
  int *slot = need(m * 4), *dslot;

  for (size_t i = 0; i < m; i++) slot[i] = (int)(m - 1 - i);
  dslot = bring(m * 4, slot);

  TRY("two dots", 24 * 8 * 2, 2, out, dout, (*cpu.run->dot)(&cpu, m, a, b, b, b, partial, out),
      (*queue.run->dot)(&queue, m, da, db, db, db, dpartial, dout));
  TRY("sums of components", 24 * 8 * 2, 3, out, dout,
      (*cpu.run->balance.sum_components)(&cpu, nn, NULL, 2, hv, factor, partial, out),
      (*queue.run->balance.sum_components)(&queue, nn, NULL, 2, dv, factor, dpartial, dout));
  TRY("largest entry", 24 * 8 * 2, 1, out, dout, (*cpu.run->largest)(&cpu, m, a, NULL, shift, partial, out),
      (*queue.run->largest)(&queue, m, da, NULL, shift, dpartial, dout));
  TRY("combination of two vectors", 24 * 8 * 3, m, y, dy, (*cpu.run->combine)(&cpu, m, 2, hv, factor, shift, y),
      (*queue.run->combine)(&queue, m, 2, dv, factor, shift, dy));
  TRY("product by entries", 24 * 8 * 3, m, y, dy, (*cpu.run->scale)(&cpu, m, a, b, y),
      (*queue.run->scale)(&queue, m, da, db, dy));
  TRY("inverse diagonal", 24 * 8 + 16 * 8, m, y, dy, (*cpu.run->invert_diagonal)(&cpu, nn, 0.1, a, b, y),
      (*queue.run->invert_diagonal)(&queue, nn, 0.1, da, db, dy));
  TRY("rows of a list", 24 * 8 * 2 + 96, m, y, dy, (*cpu.run->pick)(&cpu, (int)m, 1, slot, a, y),
      (*queue.run->pick)(&queue, (int)m, 1, dslot, da, dy));
  TRY("entries of a list", 24 * 8 * 2 + 96, m, y, dy, (*cpu.run->set_slots)(&cpu, (int)m, slot, a, y),
      (*queue.run->set_slots)(&queue, (int)m, dslot, da, dy));
}

int main(int argc, char **argv)
{
  cpu.run   = DeviceGetKernels("cpu");
  queue.run = DeviceGetKernels(argc > 1 ? argv[1] : "cuda");
  n         = argc > 2 ? atoi(argv[2]) : 8;
  repeats   = argc > 3 ? atoi(argv[3]) : 20;
  compare   = n < 17;
  if (!queue.run || n < 4 || n % 4) {
    fprintf(stderr, "usage: kernels cuda|cpu n [repeats], n a multiple of 4; cuda where it was compiled for it\n");
    return 1;
  }
  build_mesh();
  if (!compare) printf("%s, %d^3 cells%*s  ns/cell     GB/s\n", queue.run->name, n, 28, "");
  else printf("%s beside the processor, %d^3 cells\n", queue.run->name, n);
  try_velocity(0);
  if (n <= 64) try_velocity(1);
  try_rows();
  try_vertices();
  try_sums();
  if (compare) printf("%s: largest difference %.1e\n", worst <= 1e-6 ? "the same" : "NOT THE SAME", worst);
  return compare && !(worst <= 1e-6);
}
