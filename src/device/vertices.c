/* Device: pressures at vertices: transfer from and to those of cells, sparse matrices between vertices. */
#include "functions.h"

KERNEL(256, 1) restrict_cells(const DeviceTransfer f, const double *RESTRICT r, double *v)
{
  EACH(i, (Big)f.ncell * 8)
  {
    const Big     c   = i % f.ncell;
    const int     s   = (int)(i / f.ncell);
    const double *fit = f.fit + (Big)f.form[c] * 32 + s, *of = r + c * 4;

    ADD(v[f.vertex[i]], fit[0] * of[0] + fit[8] * of[1] + fit[16] * of[2] + fit[24] * of[3]);
  }
}

KERNEL(256, 1) interpolate_cells(const DeviceTransfer f, const double *RESTRICT v, double *x)
{
  EACH(c, f.ncell)
  {
    const double *fit    = f.fit + (Big)f.form[c] * 32;
    double        sum[4] = {0, 0, 0, 0};

    UNROLL
    for (int s = 0; s < 8; s++) {
      const double u = v[f.vertex[s * (Big)f.ncell + c]];

      for (int k = 0; k < 4; k++) sum[k] += fit[k * 8 + s] * u;
    }
    for (int k = 0; k < 4; k++) x[c * 4 + k] += sum[k];
  }
}

int NAME(add_restricted)(const DeviceQueue *queue, const DeviceTransfer *f, const double r[], double v[])
{
  LAUNCH(queue, restrict_cells, BlocksFor((Big)f->ncell * 8), 256, *f, r, v);
  return EndKernel(queue, __func__, 68. * f->ncell + 16. * f->nvertex);
}

int NAME(add_interpolated)(const DeviceQueue *queue, const DeviceTransfer *f, const double v[], double x[])
{
  LAUNCH(queue, interpolate_cells, BlocksFor(f->ncell), 256, *f, v, x);
  return EndKernel(queue, __func__, 100. * f->ncell + 8. * f->nvertex);
}

DEV double multiply_row(const DeviceSparse a, const Big i, const double *RESTRICT x)
{
  double sum = 0;

  UNROLL_BY(9)
  for (int e = 0; e < a.width; e++) sum += a.value[(Big)e * a.n + i] * x[a.column[(Big)e * a.n + i]];
  return sum;
}

KERNEL(256, 1) multiply(const DeviceSparse a, const int add, const double *RESTRICT x, double *y)
{
  EACH(i, a.n) y[i] = multiply_row(a, i, x) + (add ? y[i] : 0);
}

KERNEL(256, 1) transposed(const DeviceSparse a, const double *RESTRICT x, double *y)
{
  EACH(i, (Big)a.n * a.width)
  {
    if (a.value[i] != 0) ADD(y[a.column[i]], a.value[i] * x[i % a.n]);
  }
}

KERNEL(256, 1) residual(const DeviceSparse a, const double *RESTRICT b, const double *RESTRICT x, double *r)
{
  EACH(i, a.n) r[i] = b[i] - multiply_row(a, i, x);
}

KERNEL(256, 1) smooth(const DeviceSparse a, const double *RESTRICT inverse, const DeviceChebyshev c)
{
  EACH(i, a.n)
  {
    const double r = c.b[i] - (c.x ? multiply_row(a, i, c.x) : 0),
                 d = c.c2 * inverse[i] * r + (c.x && c.c1 != 0 ? c.c1 * c.d[i] : 0);

    c.d[i]     = d;
    c.x_new[i] = (c.x ? c.x[i] : 0) + d;
  }
}

int NAME(multiply_sparse)(const DeviceQueue *queue, const DeviceSparse *a, int add, const double x[], double y[])
{
  LAUNCH(queue, multiply, BlocksFor(a->n), 256, *a, add, x, y);
  return EndKernel(queue, __func__, a->n * (12. * a->width + 24));
}

int NAME(add_transposed)(const DeviceQueue *queue, const DeviceSparse *a, const double x[], double y[])
{
  LAUNCH(queue, transposed, BlocksFor((Big)a->n * a->width), 256, *a, x, y);
  return EndKernel(queue, __func__, a->n * (12. * a->width + 24));
}

int NAME(residual_sparse)(const DeviceQueue *queue, const DeviceSparse *a, const double b[], const double x[],
                          double r[])
{
  LAUNCH(queue, residual, BlocksFor(a->n), 256, *a, b, x, r);
  return EndKernel(queue, __func__, a->n * (12. * a->width + 24));
}

int NAME(smooth_sparse)(const DeviceQueue *queue, const DeviceSparse *a, const double inverse[],
                        const DeviceChebyshev *c)
{
  LAUNCH(queue, smooth, BlocksFor(a->n), 256, *a, inverse, *c);
  return EndKernel(queue, __func__, a->n * ((c->x ? 12. * a->width : 0) + 48));
}
