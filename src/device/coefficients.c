/* Device: coefficients of the velocity operator at the points of cells (cell.h says in which order), once a step. */
#include "cell.h"
#include "functions.h"

/* Point q of nu [27], whose first axis is the slowest */
DEV double read_nu(const double *RESTRICT nu, const DeviceCells c, const int g, const int lane, const int q)
{
  const int cell = c.cell[g * G + lane];

  return cell < 0 ? 0 : nu[(Big)cell * 27 + q % 3 * 9 + q / 3 % 3 * 3 + q / 9];
}

/* s [27] of the thread's component at positions -> at points */
DEV void evaluate(const int t, double *s)
{
  double  v[27];
  double *mine = component(t, s);

  UNROLL
  for (int j = 0; j < 27; j++) v[j] = mine[3 * j * PAD];
  turn_lines(0, v);
  UNROLL
  for (int j = 0; j < 27; j++) mine[3 * j * PAD] = v[j];
}

/* Boxes: thread (a, lane) has the convection along axis a, and everything else of the points with q % 3 == a */
DEV void set_box(const int t, const DeviceCells c, const DeviceForm f, const int g, const double *RESTRICT nu,
                 const double *s, double *RESTRICT k)
{
  const int     a = t / G, lane = t % G, skew = f.skew != 0, flow = NFLOW(f.convection, skew), n = flow + f.vary;
  const double *box = c.box + (Big)g * 4 * G + lane, det = box[0], *w = s + lane;

  k += lane;
  if (a == 0) k[0] = f.a * det;
  k[(1 + a) * G] = (f.vary ? 1 : f.b) * det * box[(1 + a) * G] * box[(1 + a) * G];
  k += 4 * G;
  UNROLL
  for (int q = 0; q < 27; q++) {
    const double scale = point_weight(q) * det;

    if (f.convection) k[(q * n + a) * G] = scale * box[(1 + a) * G] * w[(3 * q + a) * PAD];
    if (q % 3 != a) continue;
    if (f.convection && skew) {
      double div = 0;

      for (int e = 0; e < 3; e++) {
        double d[3];

        slopes(q, 3 * PAD, w + e * PAD, d);
        div += box[(1 + e) * G] * d[e];
      }
      k[(q * n + 3) * G] = f.skew * scale * div;
    }
    if (f.vary) k[(q * n + flow) * G] = f.b + f.nu_factor * read_nu(nu, c, g, lane, q);
  }
}

/* inverse [e][a] = dxi_e/dx_a and det of J [a][e] */
DEV double invert(double J[3][3], double inverse[3][3])
{
  double det = 0;

  UNROLL
  for (int e = 0; e < 3; e++) {
    const int f = (e + 1) % 3, g = (e + 2) % 3;

    UNROLL
    for (int a = 0; a < 3; a++) {
      const int b = (a + 1) % 3, d = (a + 2) % 3;

      inverse[e][a] = J[b][f] * J[d][g] - J[b][g] * J[d][f];
    }
  }
  for (int a = 0; a < 3; a++) det += inverse[0][a] * J[a][0];
  for (int e = 0; e < 3; e++)
    for (int a = 0; a < 3; a++) inverse[e][a] /= det;
  return det;
}

/* Convection and divergence at point q; scale: weight and det */
DEV void set_flow(const DeviceForm f, const int q, const double scale, double inverse[3][3], const double *w, double *k)
{
  double div = 0;

  for (int e = 0; e < 3; e++)
    k[e * G] = scale * (inverse[e][0] * w[3 * q * PAD] + inverse[e][1] * w[(3 * q + 1) * PAD] +
                        inverse[e][2] * w[(3 * q + 2) * PAD]);
  if (f.skew == 0) return;
  for (int a = 0; a < 3; a++) {
    double d[3];

    slopes(q, 3 * PAD, w + a * PAD, d);
    for (int e = 0; e < 3; e++) div += inverse[e][a] * d[e];
  }
  k[3 * G] = f.skew * scale * div;
}

/* Others: thread (a, lane) has the points with q % 3 == a; x, w: positions and velocity at the points */
DEV void set_other(const int t, const DeviceCells c, const DeviceForm f, const int g, const double *RESTRICT nu,
                   const double *x, const double *w, double *RESTRICT k)
{
  const int a = t / G, lane = t % G, flow = NFLOW(f.convection, f.skew != 0);

  x += lane;
  w += lane;
  k += lane;
  UNROLL
  for (int q = 0; q < 27; q++) {
    double  J[3][3], inverse[3][3], scale, b;
    double *at = k + q * (7 + flow) * G;

    if (q % 3 != a) continue;
    for (int d = 0; d < 3; d++) slopes(q, 3 * PAD, x + d * PAD, J[d]);
    scale = point_weight(q) * invert(J, inverse);
    b     = scale * (f.b + (f.vary ? f.nu_factor * read_nu(nu, c, g, lane, q) : 0));
    at[0] = f.a * scale;
    for (int e = 0, to = 1; e < 3; e++)
      for (int h = e; h < 3; h++, to++)
        at[to * G] = b *
                     (inverse[e][0] * inverse[h][0] + inverse[e][1] * inverse[h][1] + inverse[e][2] * inverse[h][2]);
    if (f.convection) set_flow(f, q, scale, inverse, w, at + 7 * G);
  }
}

KERNEL(THREADS, 4)
of_boxes(const DeviceCells c, const DeviceForm f, const double *RESTRICT w, const double *RESTRICT nu, double *k)
{
  SHARED double s[81 * PAD];
  const int     g = BLOCK;

  if (f.convection) {
    EACH_THREAD(t, THREADS) gather(t, c, g, 0, 0, f.scale, w, s);
    BARRIER;
    EACH_THREAD(t, THREADS)
    {
      to_positions(t, c, g, s);
      evaluate(t, s);
    }
    BARRIER;
  }
  EACH_THREAD(t, THREADS)
  set_box(t, c, f, g, nu, s, k + g * box_size(NFLOW(f.convection, f.skew != 0), f.vary));
}

/* Positions of group g of those that are no boxes, as gather would have them */
DEV void take_positions(const int t, const DeviceCells c, const int g, double *s)
{
  const double *x    = c.position + (Big)(g - c.nbox) * 81 * G + t;
  double       *mine = component(t, s);

  UNROLL
  for (int j = 0; j < 27; j++) mine[3 * j * PAD] = x[3 * j * G];
}

KERNEL(THREADS, 4)
of_others(const DeviceCells c, const DeviceForm f, const double *RESTRICT w, const double *RESTRICT nu, double *k)
{
  SHARED double s[81 * PAD], x[81 * PAD];
  const int     g = c.nbox + BLOCK;

  if (f.convection) EACH_THREAD(t, THREADS) gather(t, c, g, 0, 0, f.scale, w, s);
  BARRIER;
  EACH_THREAD(t, THREADS)
  {
    take_positions(t, c, g, x);
    evaluate(t, x);
    if (f.convection) {
      to_positions(t, c, g, s);
      evaluate(t, s);
    }
  }
  BARRIER;
  EACH_THREAD(t, THREADS)
  set_other(t, c, f, g, nu, x, s, k + BLOCK * other_size(NFLOW(f.convection, f.skew != 0)));
}

int NAME(set_coefficients)(const DeviceQueue *queue, const DeviceCells *cells, const DeviceForm *form, const double w[],
                           const double nu[], double coefficient[])
{
  const int flow = NFLOW(form->convection, form->skew != 0);

  LAUNCH(queue, of_boxes, cells->nbox, THREADS, *cells, *form, w, nu, coefficient);
  coefficient += cells->nbox * box_size(flow, form->vary);
  LAUNCH(queue, of_others, cells->ngroup - cells->nbox, THREADS, *cells, *form, w, nu, coefficient);
  return EndKernel(queue, __func__, NodeBytes(cells->ngroup) + CoefficientBytes(cells, form) + 24. * cells->nnode);
}

#ifndef __CUDACC__
size_t DeviceCoefficients(const DeviceCells *cells, const DeviceForm *form)
{
  const int flow = NFLOW(form->convection, form->skew != 0);

  return (size_t)(cells->nbox * box_size(flow, form->vary) + (cells->ngroup - cells->nbox) * other_size(flow));
}
#endif
