/* Device: multigrid cycles over the kernels, whose order is the host's. Compiled once, by the C compiler. Smoothers are
   Chebyshev polynomials, which are symmetric (Adams, Brezina, Hu & Tuminaro 2003). */
#ifndef __CUDACC__
  #include "kernel.h"

/* Coefficients of step k of a Chebyshev iteration for [low, high]; rho: of the step before, and of this one */
static void set_step(int k, double low, double high, double *rho, DeviceChebyshev *c)
{
  const double theta = (high + low) / 2, delta = (high - low) / 2, sigma = theta / delta,
               now = k == 0 ? 1 / sigma : 1 / (2 * sigma - *rho);

  c->c1 = k == 0 ? 0 : now * *rho;
  c->c2 = k == 0 ? 1 / theta : 2 * now / delta;
  *rho  = now;
}

/* x from zero (start) or as it is; x and y change places */
static int smooth_level(const DeviceQueue *q, int degree, int start, DeviceLevel *l)
{
  double rho = 0;
  int    e   = 0;

  for (int k = 0; k < degree && !e; k++) {
    DeviceChebyshev c = {.b = l->b, .x = start && k == 0 ? NULL : l->x, .d = l->d, .x_new = l->y};

    set_step(k, 0.3 * l->largest, l->largest, &rho, &c);
    e    = (*q->run->smooth_sparse)(q, &l->A, l->inverse, &c);
    l->y = l->x;
    l->x = c.x_new;
  }
  return e;
}

int DeviceCycle(const DeviceQueue *q, int n, int degree, DeviceLevel *l)
{
  DeviceLevel *next = l + 1;
  int          e;

  if (n == 1) return (*q->run->multiply_sparse)(q, &l->A, 0, l->b, l->x);
  e = smooth_level(q, degree, 1, l);
  if (!e) e = (*q->run->residual_sparse)(q, &l->A, l->b, l->x, l->y);
  if (!e) e = (*q->run->zero)(q, (size_t)next->A.n * sizeof(double), next->b);
  if (!e) e = (*q->run->add_transposed)(q, &l->P, l->y, next->b);
  if (!e) e = DeviceCycle(q, n - 1, degree, next);
  if (!e) e = (*q->run->multiply_sparse)(q, &l->P, 1, next->x, l->x);
  return e ? e : smooth_level(q, degree, 0, l);
}

int DevicePressureShift(const DeviceQueue *q, const DevicePressure *p, const double b[], const double x[],
                        const double **out)
{
  const double one = 1;
  int          e;

  *out = b;
  if (!x || (!p->body.n && !(p->ranks.ctx && p->shifted))) return 0; /* ranks sum together */
  *out = p->shifted;
  e    = (*q->run->body.sum_blocks)(q, &p->body, x, p->U);
  if (!e && p->ranks.ctx) e = (*p->ranks.sum)(p->ranks.ctx, p->U);
  if (!e) e = (*q->run->combine)(q, (size_t)p->rows.n * 4, 1, &b, &one, NULL, p->shifted);
  return e ? e : (*q->run->body.add_blocks)(q, &p->body, -1, p->U, p->shifted);
}

static int fetch(const DevicePressure *p, double *x)
{
  return p->ranks.ctx && x ? (*p->ranks.fetch)(p->ranks.ctx, x) : 0;
}

/* The same over cells; *x and *y change places */
static int smooth_cells(const DeviceQueue *q, const DevicePressure *p, int start, const double b[], double **x,
                        double **y)
{
  double rho = 0;
  int    e   = 0;

  for (int k = 0; k < p->degree && !e; k++) {
    DeviceChebyshev c = {.x = start && k == 0 ? NULL : *x, .d = p->d, .x_new = *y};

    set_step(k, p->largest / 8, p->largest, &rho, &c);
    e = DevicePressureShift(q, p, b, c.x, &c.b);
    if (!e) e = fetch(p, (double *)c.x);
    if (!e) e = (*q->run->smooth_rows)(q, &p->rows, &c);
    *y = *x;
    *x = c.x_new;
  }
  return e;
}

/* x += what the vertices make of p->r */
static int correct_cells(const DeviceQueue *q, const DevicePressure *p, double *x)
{
  int e;

  if (p->ranks.ctx) return (*p->ranks.correct)(p->ranks.ctx, p->r, x);
  e = (*q->run->zero)(q, (size_t)p->transfer.nvertex * sizeof(double), p->level[0].b);
  if (!e) e = (*q->run->vertices.add_restricted)(q, &p->transfer, p->r, p->level[0].b);
  if (!e) e = DeviceCycle(q, p->nlevel, 2, p->level);
  return e ? e : (*q->run->vertices.add_interpolated)(q, &p->transfer, p->level[0].x, x);
}

int DevicePressureApply(const DeviceQueue *q, const DevicePressure *p, const double b[], double z[])
{
  double       *x = p->ranks.ctx ? p->y : z, *y = p->x; /* after twice the degree what was x is x again */
  const double *shifted = b, one = 1;
  int           e = smooth_cells(q, p, 1, b, &x, &y);

  if (!e) e = DevicePressureShift(q, p, b, x, &shifted);
  if (!e) e = fetch(p, x);
  if (!e) e = (*q->run->residual_rows)(q, &p->rows, shifted, x, p->r);
  if (!e) e = correct_cells(q, p, x);
  if (!e) e = smooth_cells(q, p, 0, b, &x, &y);
  if (e || !p->ranks.ctx) return e;
  return (*q->run->combine)(q, (size_t)p->rows.n * 4, 1, (const double *const *)&x, &one, NULL, z);
}
#endif
