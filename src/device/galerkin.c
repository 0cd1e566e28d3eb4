/* Device: matrices between vertices, where they are kept: that of the pressure's Laplacian (solve/pressure/laplacian.h)
   changes in cells that are boxes, those of wider lattices are P^T A P. */
#include "cell.h"
#include "functions.h"

/* Where entry (i, j) stands, which is there. Entries stand in the order of columns; what fills a row comes last. */
DEV Big find_entry(const DeviceSparse a, const int i, const int j)
{
  Big at = i;

  while (a.column[at] != j) at += a.n;
  return at;
}

/* Integral of sum over axes of k d phi_u d phi_v, from f: k times the box's measure over that of a unit one */
DEV double box_entry(const double f[3], const int u, const int v)
{
  const int    apart = u ^ v; /* bits: axes along which the vertices differ */
  const double x = apart & 1 ? 1 : 2, y = apart & 2 ? 1 : 2, z = apart & 4 ? 1 : 2;

  return f[0] * (apart & 1 ? -1 : 1) * y * z + f[1] * x * (apart & 2 ? -1 : 1) * z +
         f[2] * x * y * (apart & 4 ? -1 : 1);
}

/* row [8] of vertex s: of the corners, or where these hang of T^T K T, T [corner][vertex] */
DEV void box_row(const double f[3], const DeviceHang *h, const int s, double *row)
{
  double sum[8];

  for (int t = 0; t < 8; t++) row[t] = h ? 0 : box_entry(f, s, t);
  if (!h) return;
  for (int w = 0; w < 8; w++) {
    sum[w] = 0;
    for (int v = 0; v < 8; v++) sum[w] += h->corner[v * 8 + s] * box_entry(f, v, w);
  }
  for (int w = 0; w < 8; w++)
    for (int t = 0; t < 8; t++) row[t] += sum[w] * h->corner[w * 8 + t];
}

KERNEL(256, 1)
add_cells(const DeviceCells c, const int *RESTRICT place, const DeviceTransfer t, const int n, const int *RESTRICT cell,
          const double *RESTRICT k, const DeviceSparse a, double *value)
{
  EACH(i, (Big)n * 8)
  {
    const int         at = cell[i / 8], s = (int)(i % 8), lane = place[at] % G;
    const double     *box = c.box + (Big)(place[at] / G) * 4 * G + lane;
    const DeviceHang *h   = c.hang && c.hang[place[at]] >= 0 ? c.hangs + c.hang[place[at]] : NULL;
    double            f[3], row[8];

    for (int d = 0; d < 3; d++) f[d] = k[i / 8 * 3 + d] * box[0] * box[(1 + d) * G] * box[(1 + d) * G] / 18;
    box_row(f, h, s, row);
    for (int v = 0; v < 8; v++) {
      const int from = t.vertex[(Big)s * t.ncell + at], to = t.vertex[(Big)v * t.ncell + at];

      if (row[v] != 0) ADD(value[find_entry(a, from, to)], row[v]);
    }
  }
}

int NAME(add_boxes)(const DeviceQueue *queue, const DeviceCells *cells, const int place[], const DeviceTransfer *t,
                    int n, const int cell[], const double k[], const DeviceSparse *a)
{
  LAUNCH(queue, add_cells, BlocksFor((Big)n * 8), 256, *cells, place, *t, n, cell, k, *a, (double *)a->value);
  return EndKernel(queue, __func__, n * (100. + 64 * 16));
}

KERNEL(256, 1)
add_each(const int n, const int *RESTRICT row, const int *RESTRICT column, const double *RESTRICT from,
         const DeviceSparse a, double *value)
{
  EACH(i, n) ADD(value[find_entry(a, row[i], column[i])], from[i]);
}

int NAME(add_entries)(const DeviceQueue *queue, int n, const int row[], const int column[], const double value[],
                      const DeviceSparse *a)
{
  LAUNCH(queue, add_each, BlocksFor(n), 256, n, row, column, value, *a, (double *)a->value);
  return EndKernel(queue, __func__, 36. * n);
}

KERNEL(256, 1) multiply_twice(const DeviceSparse a, const DeviceSparse p, const DeviceSparse c, double *value)
{
  EACH(e, (Big)a.n * a.width)
  {
    const Big i = e % a.n, j = a.column[e];

    for (int u = 0; u < p.width && a.value[e] != 0; u++) {
      const double left = a.value[e] * p.value[(Big)u * p.n + i];

      for (int v = 0; v < p.width && left != 0; v++) {
        const double right = p.value[(Big)v * p.n + j];

        if (right != 0) ADD(value[find_entry(c, p.column[(Big)u * p.n + i], p.column[(Big)v * p.n + j])], left * right);
      }
    }
  }
}

int NAME(coarsen)(const DeviceQueue *queue, const DeviceSparse *a, const DeviceSparse *p, const DeviceSparse *c)
{
  const int e = NAME(zero)(queue, (size_t)c->n * c->width * sizeof(double), (double *)c->value);

  if (e) return e;
  LAUNCH(queue, multiply_twice, BlocksFor((Big)a->n * a->width), 256, *a, *p, *c, (double *)c->value);
  return EndKernel(queue, __func__, 12. * ((double)a->n * a->width + (double)p->n * p->width + 2. * c->n * c->width));
}

KERNEL(256, 1) invert(const DeviceSparse a, double *inverse)
{
  EACH(i, a.n) inverse[i] = 1 / a.value[find_entry(a, (int)i, (int)i)];
}

int NAME(invert_sparse)(const DeviceQueue *queue, const DeviceSparse *a, double inverse[])
{
  LAUNCH(queue, invert, BlocksFor(a->n), 256, *a, inverse);
  return EndKernel(queue, __func__, 24. * a->n);
}
