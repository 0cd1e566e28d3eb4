/* Device: products with B and its transpose, by the matrices of cells. Of boxes those of a kind, which all lanes load
   at once; of others their own, side by side. */
#include "cell.h"
#include "functions.h"

/* Thread (k, lane) has pressure k of a cell */
DEV void divergence_group(const int box, const DeviceCells c, const int first, const DeviceDivergence d,
                          const double alpha, const double *RESTRICT u, const double beta, const double *in,
                          double *out)
{
  SHARED double s[81 * PAD], result[4 * G];
  const int     g = first + BLOCK, stride = box ? 1 : G;

  EACH_THREAD(t, 4 * G)
  gather(t, c, g, 0, 0, 1, u, s);
  BARRIER;
  EACH_THREAD(t, 4 * G)
  {
    const int     lane   = t % G;
    const double *b      = find_matrix(box, c, d, g, lane) + t / G * stride;
    double        sum[3] = {0, 0, 0};

    UNROLL_BY(9)
    for (int j = 0; j < 27; j++) {
      UNROLL
      for (int a = 0; a < 3; a++) sum[a] += b[(3 * j + a) * 4 * stride] * s[(3 * j + a) * PAD + lane];
    }
    result[lane * 4 + t / G] = alpha * (sum[0] + sum[1] + sum[2]);
  }
  BARRIER;
  EACH_THREAD(t, 4 * G)
  {
    const int cell = c.cell[g * G + t / 4];
    const Big to   = (Big)cell * 4 + t % 4;

    if (cell >= 0) out[to] = result[t] + (in ? beta * in[to] : 0);
  }
}

KERNEL(4 * G, 4)
divergence_boxes(const DeviceCells c, const DeviceDivergence d, const double alpha, const double *RESTRICT u,
                 const double beta, const double *in, double *out)
{
  divergence_group(1, c, 0, d, alpha, u, beta, in, out);
}

KERNEL(4 * G, 4)
divergence_others(const DeviceCells c, const DeviceDivergence d, const double alpha, const double *RESTRICT u,
                  const double beta, const double *in, double *out)
{
  divergence_group(0, c, c.nbox, d, alpha, u, beta, in, out);
}

int NAME(divergence)(const DeviceQueue *queue, const DeviceCells *cells, const DeviceDivergence *d, double alpha,
                     const double u[], double beta, const double in[], double out[])
{
  LAUNCH(queue, divergence_boxes, cells->nbox, 4 * G, *cells, *d, alpha, u, beta, in, out);
  LAUNCH(queue, divergence_others, cells->ngroup - cells->nbox, 4 * G, *cells, *d, alpha, u, beta, in, out);
  return EndKernel(queue, __func__,
                   NodeBytes(cells->ngroup) + MatrixBytes(cells) + 24. * cells->nnode +
                     (in ? 64. : 32.) * cells->ncell);
}

/* y += weight times what s has in the slots */
DEV void scatter_weighted(const int t, const DeviceCells c, const int g, const int masked,
                          const double *RESTRICT weight, const double *s, double *y)
{
  const int  j = t / 3, a = t % 3;
  const int *node = c.node + (Big)g * G * 27 + j;

  if (t >= 81) return;
  UNROLL_BY(8)
  for (int k = 0; k < G; k++) {
    const int e    = node[k * 27];
    const Big slot = (Big)NODE(e) * 3 + a;

    if (e >= 0 && !(masked && (e >> (DEVICE_NODE_BITS + a) & 1))) ADD(y[slot], weight[slot] * s[t * PAD + k]);
  }
}

/* Thread (a, lane) has component a of a cell's nodes */
DEV void gradient_group(const int box, const DeviceCells c, const int first, const DeviceDivergence d, const int masked,
                        const double alpha, const double *RESTRICT weight, const double *RESTRICT p, double *y)
{
  SHARED double s[81 * PAD];
  const int     g = first + BLOCK, stride = box ? 1 : G;

  EACH_THREAD(t, THREADS)
  {
    const int     cell = c.cell[g * G + t % G];
    const double *b    = find_matrix(box, c, d, g, t % G) + t / G * 4 * stride;
    double        pk[4], *mine = component(t, s);

    UNROLL
    for (int k = 0; k < 4; k++) pk[k] = cell < 0 ? 0 : alpha * p[(Big)cell * 4 + k];
    UNROLL_BY(9)
    for (int j = 0; j < 27; j++) {
      const double *at = b + 12 * j * stride;

      mine[3 * j * PAD] = at[0] * pk[0] + at[stride] * pk[1] + at[2 * stride] * pk[2] + at[3 * stride] * pk[3];
    }
  }
  BARRIER;
  EACH_THREAD(t, THREADS)
  {
    if (weight) scatter_weighted(t, c, g, masked, weight, s, y);
    else scatter(t, c, g, masked, s, y);
  }
}

KERNEL(THREADS, 6)
gradient_boxes(const DeviceCells c, const DeviceDivergence d, const int masked, const double alpha,
               const double *RESTRICT weight, const double *RESTRICT p, double *y)
{
  gradient_group(1, c, 0, d, masked, alpha, weight, p, y);
}

KERNEL(THREADS, 6)
gradient_others(const DeviceCells c, const DeviceDivergence d, const int masked, const double alpha,
                const double *RESTRICT weight, const double *RESTRICT p, double *y)
{
  gradient_group(0, c, c.nbox, d, masked, alpha, weight, p, y);
}

int NAME(add_gradient)(const DeviceQueue *queue, const DeviceCells *cells, const DeviceDivergence *d, int masked,
                       double alpha, const double weight[], const double p[], double y[])
{
  LAUNCH(queue, gradient_boxes, cells->nbox, THREADS, *cells, *d, masked, alpha, weight, p, y);
  LAUNCH(queue, gradient_others, cells->ngroup - cells->nbox, THREADS, *cells, *d, masked, alpha, weight, p, y);
  return EndKernel(queue, __func__,
                   NodeBytes(cells->ngroup) + MatrixBytes(cells) + (weight ? 72. : 48.) * cells->nnode +
                     32. * cells->ncell);
}
