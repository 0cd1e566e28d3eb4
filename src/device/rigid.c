/* Device: rigid velocities of bodies at nodes and in cells, and back: a block of threads sums what a body has. */
#include "functions.h"

#define THREADS   128
#define NODE(e)   ((e) & (DEVICE_MAX_NODES - 1))
#define HAS(e, a) (!((e) >> (DEVICE_NODE_BITS + (a)) & 1))

/* s [6][THREADS]: sums into the first */
#define ADD_UP(s) \
  for (int half = THREADS / 2; half > 0; half /= 2) { \
    BARRIER; \
    EACH_THREAD(t, THREADS) \
    for (int m = 0; m < 6 && t < half; m++) (s)[m * THREADS + t] += (s)[m * THREADS + t + half]; \
  }

/* ---- at nodes ---- */

KERNEL(256, 1) spread_rigid(const DevicePairs r, const double factor, const double *RESTRICT U, double *y)
{
  EACH(i, r.n)
  {
    const int     e = r.at[i];
    const double *V = U + r.body[i] * 6, *W = V + 3,
                 arm[3] = {r.value[r.n + i], r.value[2 * r.n + i], r.value[3 * r.n + i]};

    for (int a = 0; a < 3; a++) {
      const int    b = (a + 1) % 3, c = (a + 2) % 3;
      const double v = r.value[i] * V[a] + W[b] * arm[c] - W[c] * arm[b];

      if (HAS(e, a)) ADD(y[(Big)NODE(e) * 3 + a], factor * v);
    }
  }
}

int NAME(add_rigid)(const DeviceQueue *queue, const DevicePairs *r, double factor, const double U[], double y[])
{
  LAUNCH(queue, spread_rigid, BlocksFor(r->n), 256, *r, factor, U, y);
  return EndKernel(queue, __func__, 88. * r->n);
}

/* s [6], THREADS apart += force and torque of entry i */
DEV void add_force(const DevicePairs r, const int i, const double *RESTRICT x, double *s)
{
  const int    e      = r.at[i];
  const double arm[3] = {r.value[r.n + i], r.value[2 * r.n + i], r.value[3 * r.n + i]};
  double       f[3];

  for (int a = 0; a < 3; a++) f[a] = HAS(e, a) ? x[(Big)NODE(e) * 3 + a] : 0;
  for (int a = 0; a < 3; a++) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;

    s[a * THREADS] += r.value[i] * f[a];
    s[(3 + a) * THREADS] += arm[b] * f[c] - arm[c] * f[b];
  }
}

KERNEL(THREADS, 4) gather_rigid(const DevicePairs r, const double factor, const double *RESTRICT x, double *out)
{
  SHARED double s[6 * THREADS];

  EACH_THREAD(t, THREADS)
  {
    for (int m = 0; m < 6; m++) s[m * THREADS + t] = 0;
    for (int i = r.start[BLOCK] + t; i < r.start[BLOCK + 1]; i += THREADS) add_force(r, i, x, s + t);
  }
  ADD_UP(s)
  EACH_THREAD(t, THREADS)
  if (t < 6) out[BLOCK * 6 + t] = factor * s[t * THREADS];
}

int NAME(sum_rigid)(const DeviceQueue *queue, const DevicePairs *r, double factor, const double x[], double out[])
{
  LAUNCH(queue, gather_rigid, r->nbody, THREADS, *r, factor, x, out);
  return EndKernel(queue, __func__, 64. * r->n);
}

/* ---- in cells ---- */

KERNEL(256, 1) spread_blocks(const DevicePairs b, const double factor, const double *RESTRICT U, double *y)
{
  EACH(i, (Big)b.n * 4)
  {
    const Big     k = i % 4, e = i / 4;
    const double *V   = U + b.body[e] * 6;
    double        sum = 0;

    for (int m = 0; m < 6; m++) sum += b.value[(k * 6 + m) * b.n + e] * V[m];
    ADD(y[(Big)b.at[e] * 4 + k], factor * sum);
  }
}

int NAME(add_blocks)(const DeviceQueue *queue, const DevicePairs *b, double factor, const double U[], double y[])
{
  LAUNCH(queue, spread_blocks, BlocksFor((Big)b->n * 4), 256, *b, factor, U, y);
  return EndKernel(queue, __func__, 264. * b->n);
}

KERNEL(THREADS, 4) gather_blocks(const DevicePairs b, const double *RESTRICT x, double *out)
{
  SHARED double s[6 * THREADS];

  EACH_THREAD(t, THREADS)
  {
    for (int m = 0; m < 6; m++) s[m * THREADS + t] = 0;
    for (int e = b.start[BLOCK] + t; e < b.start[BLOCK + 1]; e += THREADS)
      for (int k = 0; k < 4; k++) {
        const double v = x[(Big)b.at[e] * 4 + k];

        for (int m = 0; m < 6; m++) s[m * THREADS + t] += b.value[(Big)(k * 6 + m) * b.n + e] * v;
      }
  }
  ADD_UP(s)
  EACH_THREAD(t, THREADS)
  if (t < 6) out[BLOCK * 6 + t] = s[t * THREADS];
}

int NAME(sum_blocks)(const DeviceQueue *queue, const DevicePairs *b, const double x[], double out[])
{
  LAUNCH(queue, gather_blocks, b->nbody, THREADS, *b, x, out);
  return EndKernel(queue, __func__, 232. * b->n);
}
