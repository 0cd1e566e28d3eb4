/* Cell: what a thread does for one component of one cell. A block has 32 cells and 96 threads, thread 32 a + lane has
   component a of cell lane. Nodal values come and go through shared memory, s [81][PAD], row 3 j + a for component a of
   node j, where neighbouring threads have the components of the nodes of one cell. */
#pragma once
#include "kernel.h"

#define G       DEVICE_GROUP
#define PAD     (G + 1)
#define THREADS 96
#define AT      0.77459666924148337704 /* the outer points on a line, sqrt(3/5) */
#define NODE(e) ((e) & (DEVICE_MAX_NODES - 1))

/* ---- lines of three ---- */

DEV void to_points(double *a, double *b, double *c)
{
  const double even = 0.3 * (*a + *c) + 0.4 * *b, odd = 0.5 * AT * (*c - *a);

  *a = even - odd;
  *c = even + odd;
}

DEV void to_nodes(double *a, double *b, double *c)
{
  const double even = 0.3 * (*a + *c), odd = 0.5 * AT * (*c - *a);

  *b += 0.4 * (*a + *c);
  *a = even - odd;
  *c = even + odd;
}

DEV void turn_line(const int back, double *a, double *b, double *c)
{
  if (back) to_nodes(a, b, c);
  else to_points(a, b, c);
}

/* v [27], nodes <-> points, along the three axes */
DEV void turn_lines(const int back, double *v)
{
  UNROLL
  for (int k = 0; k < 9; k++) turn_line(back, &v[k], &v[k + 9], &v[k + 18]);
  UNROLL
  for (int k = 0; k < 9; k++)
    turn_line(back, &v[k / 3 * 9 + k % 3], &v[k / 3 * 9 + k % 3 + 3], &v[k / 3 * 9 + k % 3 + 6]);
  UNROLL
  for (int k = 0; k < 9; k++) turn_line(back, &v[3 * k], &v[3 * k + 1], &v[3 * k + 2]);
}

/* Derivative at point i of a line of values at points, and what it gives back to them */
DEV double slope(const int i, double a, double b, double c)
{
  if (i == 0) return -1.5 / AT * a + 2 / AT * b - 0.5 / AT * c;
  if (i == 1) return 0.5 / AT * (c - a);
  return 0.5 / AT * a - 2 / AT * b + 1.5 / AT * c;
}

DEV void slope_back(const int i, double f, double *a, double *b, double *c)
{
  if (i == 0) {
    *a -= 1.5 / AT * f;
    *b += 2 / AT * f;
    *c -= 0.5 / AT * f;
  } else if (i == 1) {
    *a -= 0.5 / AT * f;
    *c += 0.5 / AT * f;
  } else {
    *a += 0.5 / AT * f;
    *b -= 2 / AT * f;
    *c += 1.5 / AT * f;
  }
}

/* Derivatives along the three axes at point q of values v [27] at points, `stride` apart */
DEV void slopes(const int q, const int stride, const double *v, double g[3])
{
  const int x = q / 3 * 3, y = q / 9 * 9 + q % 3, z = q % 9;

  g[0] = slope(q % 3, v[x * stride], v[(x + 1) * stride], v[(x + 2) * stride]);
  g[1] = slope(q / 3 % 3, v[y * stride], v[(y + 3) * stride], v[(y + 6) * stride]);
  g[2] = slope(q / 9, v[z * stride], v[(z + 9) * stride], v[(z + 18) * stride]);
}

DEV void slopes_back(const int q, const double f[3], double *o)
{
  const int x = q / 3 * 3, y = q / 9 * 9 + q % 3, z = q % 9;

  slope_back(q % 3, f[0], &o[x], &o[x + 1], &o[x + 2]);
  slope_back(q / 3 % 3, f[1], &o[y], &o[y + 3], &o[y + 6]);
  slope_back(q / 9, f[2], &o[z], &o[z + 9], &o[z + 18]);
}

/* Quadrature weight of point q */
DEV double point_weight(const int q)
{
  return (q % 3 == 1 ? 8. / 9 : 5. / 9) * (q / 3 % 3 == 1 ? 8. / 9 : 5. / 9) * (q / 9 == 1 ? 8. / 9 : 5. / 9);
}

/* ---- nodal values ---- */

/* Thread t: s = (add: +=) factor times x [nnode][3] in the slots of the cells of group g; masked: fixed components
   count as zero */
DEV void gather(const int t, const DeviceCells c, const int g, const int masked, const int add, const double factor,
                const double *RESTRICT x, double *s)
{
  const int  j = t / 3, a = t % 3;
  const int *node = c.node + (Big)g * G * 27 + j;

  if (t >= 81) return;
  UNROLL_BY(16)
  for (int k = 0; k < G; k++) {
    const int e = node[k * 27];
    double    v = 0;

    if (e >= 0 && !(masked && (e >> (DEVICE_NODE_BITS + a) & 1))) v = factor * x[(Big)NODE(e) * 3 + a];
    s[t * PAD + k] = add ? s[t * PAD + k] + v : v;
  }
}

/* y [nnode][3] += what s has in the slots */
DEV void scatter(const int t, const DeviceCells c, const int g, const int masked, const double *s, double *y)
{
  const int  j = t / 3, a = t % 3;
  const int *node = c.node + (Big)g * G * 27 + j;

  if (t >= 81) return;
  UNROLL_BY(8)
  for (int k = 0; k < G; k++) {
    const int e = node[k * 27];

    if (e >= 0 && !(masked && (e >> (DEVICE_NODE_BITS + a) & 1))) ADD(y[(Big)NODE(e) * 3 + a], s[t * PAD + k]);
  }
}

/* Does something hang in the cell of thread t? */
DEV const DeviceHang *find_hang(const int t, const DeviceCells c, const int g)
{
  const int h = c.hang ? c.hang[g * G + t % G] : -1;

  return h < 0 ? NULL : c.hangs + h;
}

/* v [27], `stride` apart: values in slots -> values at positions */
DEV void hang_gather(const DeviceHang *h, const int stride, double *v)
{
  double out[DEVICE_HANG_SLOTS];

  for (int r = 0; r < h->n; r++) {
    double sum = 0;

    for (int e = h->start[r]; e < h->start[r + 1]; e++) sum += h->weight[e] * v[h->from[e] * stride];
    out[r] = sum;
  }
  for (int r = 0; r < h->n; r++) v[h->slot[r] * stride] = out[r];
}

/* What belongs to positions -> what belongs to slots */
DEV void hang_scatter(const DeviceHang *h, const int stride, double *v)
{
  double in[DEVICE_HANG_SLOTS];

  for (int r = 0; r < h->n; r++) {
    in[r]                  = v[h->slot[r] * stride];
    v[h->slot[r] * stride] = 0;
  }
  for (int r = 0; r < h->n; r++)
    for (int e = h->start[r]; e < h->start[r + 1]; e++) v[h->from[e] * stride] += h->weight[e] * in[r];
}

/* The cell's component of thread t in s */
DEV double *component(const int t, double *s)
{
  return s + t / G * PAD + t % G;
}

DEV void to_positions(const int t, const DeviceCells c, const int g, double *s)
{
  const DeviceHang *h = find_hang(t, c, g);

  if (h) hang_gather(h, 3 * PAD, component(t, s));
}

DEV void to_slots(const int t, const DeviceCells c, const int g, double *s)
{
  const DeviceHang *h = find_hang(t, c, g);

  if (h) hang_scatter(h, 3 * PAD, component(t, s));
}

/* ---- bytes ---- */

/* Nodes of cells, of which n of 32 places */
HOST double NodeBytes(const int n)
{
  return (double)n * G * (27 + 1) * sizeof(int);
}

/* Matrices of cells in groups, which boxes share */
HOST double MatrixBytes(const DeviceCells *c)
{
  return (double)G * (c->nbox * sizeof(int) + (double)(c->ngroup - c->nbox) * 324 * sizeof(double));
}

/* Coefficients that a product reads */
HOST double CoefficientBytes(const DeviceCells *c, const DeviceForm *f)
{
  return (double)DeviceCoefficients(c, f) * sizeof(double);
}

/* ---- matrices of B ---- */

/* Where entry (row, k) of a lane's matrix stands: b + (row * 4 + k) * stride */
DEV const double *find_matrix(const int box, const DeviceCells c, const DeviceDivergence d, const int g, const int lane)
{
  return box ? d.shared + (Big)d.kind[g * G + lane] * 324 : d.own + (Big)(g - c.nbox) * 324 * G + lane;
}

/* ---- coefficients ---- */

/* Coefficients of boxes [group][4 + 27 n][32]: mass, diffusion along each axis; for every point convection along each
   reference axis, with skew that of the divergence, with `vary` the factor of the diffusion, which stands for b + nu.
   Of others [group][27][7 + flow][32]: mass, diffusion (upper triangle by rows), convection, divergence. Quadrature
   weights are in all but the first four of boxes. */
#define NFLOW(convection, skew) ((convection) ? 3 + (skew) : 0)

BOTH Big box_size(const int flow, const int vary)
{
  return (Big)(4 + 27 * (flow + vary)) * G;
}

BOTH Big other_size(const int flow)
{
  return (Big)27 * (7 + flow) * G;
}

/* ---- kernels of constant forms ---- */

/* M(name, box, convection, skew, vary) for each form */
#define EACH_FORM(M) \
  M(box_plain, 1, 0, 0, 0) \
  M(box_convection, 1, 1, 0, 0) \
  M(box_skew, 1, 1, 1, 0) \
  M(box_vary, 1, 0, 0, 1) \
  M(box_vary_convection, 1, 1, 0, 1) \
  M(box_vary_skew, 1, 1, 1, 1) \
  M(other_plain, 0, 0, 0, 0) \
  M(other_convection, 0, 1, 0, 0) \
  M(other_skew, 0, 1, 1, 0)
/* Kernels of EACH_FORM in the order of find_form; other cells have `vary` in their coefficients */
#define FORMS_OF_BOXES \
  { \
    box_plain, box_convection, box_skew, box_vary, box_vary_convection, box_vary_skew \
  }
#define FORMS_OF_OTHERS \
  { \
    other_plain, other_convection, other_skew \
  }

HOST int find_form(const DeviceForm *f, const int vary)
{
  return (f->convection != 0) * (1 + (f->skew != 0)) + 3 * (vary != 0);
}

/* v [27] at positions <- the operator times v for one component; c: coefficients of the lane, G apart */
DEV void multiply_cell(const int box, const int convection, const int skew, const int vary, const double *RESTRICT c,
                       double *v)
{
  const int flow = NFLOW(convection, skew), n = box ? flow + vary : 7 + flow;
  double    o[27], mass = 0, k[3] = {0, 0, 0};

  if (box) {
    mass = c[0];
    for (int e = 0; e < 3; e++) k[e] = c[(1 + e) * G];
    c += 4 * G;
  }
  turn_lines(0, v);
  UNROLL
  for (int q = 0; q < 27; q++) o[q] = 0;
  UNROLL
  for (int q = 0; q < 27; q++) {
    const double *at = c + q * n * G, *u = box ? at : at + 7 * G;
    double        g[3], f[3], r;

    slopes(q, 1, v, g);
    if (box) {
      const double w = vary ? point_weight(q) * at[flow * G] : point_weight(q);

      r    = point_weight(q) * (mass * v[q]);
      f[0] = w * (k[0] * g[0]);
      f[1] = w * (k[1] * g[1]);
      f[2] = w * (k[2] * g[2]);
    } else {
      const double kxy = at[2 * G], kxz = at[3 * G], kyz = at[5 * G];

      r    = at[0] * v[q];
      f[0] = at[G] * g[0] + kxy * g[1] + kxz * g[2];
      f[1] = kxy * g[0] + at[4 * G] * g[1] + kyz * g[2];
      f[2] = kxz * g[0] + kyz * g[1] + at[6 * G] * g[2];
    }
    if (convection) r += u[0] * g[0] + u[G] * g[1] + u[2 * G] * g[2];
    if (convection && skew) r += u[3 * G] * v[q];
    o[q] += r;
    slopes_back(q, f, o);
  }
  turn_lines(1, o);
  UNROLL
  for (int q = 0; q < 27; q++) v[q] = o[q];
}
