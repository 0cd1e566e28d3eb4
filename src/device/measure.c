/* Device: what single cells have of a velocity: its largest values, the squares of its mean gradients. */
#include "cell.h"
#include "functions.h"

/* Squares of the largest speeds at the nodes of a cell, at rest and as one sees it that moves with the frame */
DEV void speeds_group(const DeviceCells c, const double f0, const double f1, const double f2, const double *RESTRICT u,
                      double *out)
{
  SHARED double s[81 * PAD];
  const int     g = BLOCK;

  EACH_THREAD(t, THREADS)
  gather(t, c, g, 0, 0, 1, u, s);
  BARRIER;
  EACH_THREAD(t, THREADS)
  to_positions(t, c, g, s);
  BARRIER;
  EACH_THREAD(t, THREADS)
  {
    const int cell    = t < G ? c.cell[g * G + t] : -1;
    double    most[2] = {0, 0};

    if (cell >= 0) {
      for (int j = 0; j < 27; j++) {
        const double *v = s + 3 * j * PAD + t, x = v[0], y = v[PAD], z = v[2 * PAD], at_rest = x * x + y * y + z * z,
                     seen = (x - f0) * (x - f0) + (y - f1) * (y - f1) + (z - f2) * (z - f2);

        if (at_rest > most[0]) most[0] = at_rest;
        if (seen > most[1]) most[1] = seen;
      }
      out[cell]                = most[0];
      out[(Big)c.ncell + cell] = most[1];
    }
  }
}

KERNEL(THREADS, 4)
speeds_cells(const DeviceCells c, const double f0, const double f1, const double f2, const double *RESTRICT u,
             double *out)
{
  speeds_group(c, f0, f1, f2, u, out);
}

int NAME(speeds)(const DeviceQueue *queue, const DeviceCells *cells, const double frame[3], const double u[],
                 double out[])
{
  LAUNCH(queue, speeds_cells, cells->ngroup, THREADS, *cells, frame[0], frame[1], frame[2], u, out);
  return EndKernel(queue, __func__, NodeBytes(cells->ngroup) + 24. * cells->nnode + 16. * cells->ncell);
}

/* Thread (i, lane): component i, whose derivatives are the rows of B of the constant pressure */
DEV void gradients_group(const int box, const DeviceCells c, const int first, const DeviceDivergence d,
                         const double *RESTRICT u, double *out)
{
  SHARED double s[81 * PAD], square[THREADS];
  const int     g = first + BLOCK, stride = box ? 1 : G;

  EACH_THREAD(t, THREADS)
  gather(t, c, g, 0, 0, 1, u, s);
  BARRIER;
  EACH_THREAD(t, THREADS)
  {
    const double *b = box ? d.shared + (Big)d.kind[g * G + t % G] * 324 : d.own + (Big)(g - c.nbox) * 324 * G + t % G;
    const double *mine   = component(t, s);
    double        sum[3] = {0, 0, 0};

    for (int j = 0; j < 27; j++)
      for (int a = 0; a < 3; a++) sum[a] += b[(3 * j + a) * 4 * stride] * mine[3 * j * PAD];
    square[t] = sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2];
  }
  BARRIER;
  EACH_THREAD(t, THREADS)
  {
    const int cell = t < G ? c.cell[g * G + t] : -1;

    if (cell >= 0) out[4 * (Big)cell] = square[t] + square[t + G] + square[t + 2 * G];
  }
}

KERNEL(THREADS, 4)
gradients_boxes(const DeviceCells c, const DeviceDivergence d, const double *RESTRICT u, double *out)
{
  gradients_group(1, c, 0, d, u, out);
}

KERNEL(THREADS, 4)
gradients_others(const DeviceCells c, const DeviceDivergence d, const double *RESTRICT u, double *out)
{
  gradients_group(0, c, c.nbox, d, u, out);
}

int NAME(gradients)(const DeviceQueue *queue, const DeviceCells *cells, const DeviceDivergence *d, const double u[],
                    double out[])
{
  LAUNCH(queue, gradients_boxes, cells->nbox, THREADS, *cells, *d, u, out);
  LAUNCH(queue, gradients_others, cells->ngroup - cells->nbox, THREADS, *cells, *d, u, out);
  return EndKernel(queue, __func__,
                   NodeBytes(cells->ngroup) + MatrixBytes(cells) + 24. * cells->nnode + 32. * cells->ncell);
}

/* ---- the mass of the pressure ---- */

/* One thread a place */
KERNEL(256, 1)
solve_masses(const DeviceCells c, const DeviceDivergence d, const double factor, const double *RESTRICT r, double *y)
{
  EACH(place, (Big)c.ngroup * G)
  {
    const int     cell = c.cell[place], box = place < (Big)c.nbox * G;
    const double *m = box ? d.shared_mass + (Big)d.kind[place] * 16 : d.own_mass + (place - (Big)c.nbox * G) * 16;

    if (cell >= 0)
      for (int k = 0; k < 4; k++) {
        const double *of = r + (Big)cell * 4;

        y[(Big)cell * 4 + k] += factor *
                                (m[4 * k] * of[0] + m[4 * k + 1] * of[1] + m[4 * k + 2] * of[2] + m[4 * k + 3] * of[3]);
      }
  }
}

int NAME(add_pressure_mass)(const DeviceQueue *queue, const DeviceCells *cells, const DeviceDivergence *d,
                            double factor, const double r[], double y[])
{
  const Big n = (Big)cells->ngroup * G;

  LAUNCH(queue, solve_masses, BlocksFor(n), 256, *cells, *d, factor, r, y);
  return EndKernel(queue, __func__, 96. * cells->ncell);
}
