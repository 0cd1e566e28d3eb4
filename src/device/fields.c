/* Device: nodal fields as a whole: combinations, sums over nodes, largest entries. Reductions in two passes and always
   in the same order. */
#include "combination.h"
#include "functions.h"

#define THREADS 256
#define BLOCKS  (DEVICE_PARTIAL / 4)

DEV double combined(const Combination c, const Big i)
{
  double sum = 0;

  UNROLL
  for (int m = 0; m < MAX_VECTORS; m++)
    if (m < c.n) sum += c.factor[m] * c.v[m][i];
  return sum;
}

KERNEL(256, 1) combine_entries(const Big n, const Combination c, double *out)
{
  EACH(i, n) out[i] = combined(c, i) + c.constant[i % 3];
}

int NAME(combine)(const DeviceQueue *queue, size_t n, int nv, const double *const v[], const double factor[],
                  const double constant[3], double out[])
{
  LAUNCH(queue, combine_entries, BlocksFor((Big)n), 256, (Big)n, CombinationOf(nv, v, factor, constant), out);
  return EndKernel(queue, __func__, 8. * (double)n * (nv + 1));
}

KERNEL(256, 1) scale_entries(const Big n, const double *RESTRICT weight, const double *RESTRICT x, double *y)
{
  EACH(i, n) y[i] = weight[i] * x[i];
}

int NAME(scale)(const DeviceQueue *queue, size_t n, const double weight[], const double x[], double y[])
{
  LAUNCH(queue, scale_entries, BlocksFor((Big)n), 256, (Big)n, weight, x, y);
  return EndKernel(queue, __func__, 24. * (double)n);
}

KERNEL(256, 1) scale_rows(const Big n, const double *RESTRICT weight, const double *RESTRICT x, double *y)
{
  EACH(i, n) y[i] = weight[i / 3] * x[i];
}

int NAME(scale_nodes)(const DeviceQueue *queue, int nnode, const double weight[], const double x[], double y[])
{
  LAUNCH(queue, scale_rows, BlocksFor((Big)nnode * 3), 256, (Big)nnode * 3, weight, x, y);
  return EndKernel(queue, __func__, 56. * nnode);
}

DEV double magnitude(const double x)
{
  return x < 0 ? -x : x;
}

KERNEL(256, 1) write_sizes(const Big n, const double *RESTRICT x, double *y)
{
  EACH(i, n) y[i] = magnitude(x[i]);
}

int NAME(take_sizes)(const DeviceQueue *queue, size_t n, const double x[], double y[])
{
  LAUNCH(queue, write_sizes, BlocksFor((Big)n), 256, (Big)n, x, y);
  return EndKernel(queue, __func__, 16. * (double)n);
}

KERNEL(256, 1)
add_slopes(const Big n, const double *RESTRICT place, const double f0, const double f1, const double f2, double *y)
{
  EACH(i, n)
  {
    const double *x = place + 4 * i;

    y[4 * i] += f0 * x[0] + f1 * x[1] + f2 * x[2];
    y[4 * i + 1] += f0 * x[3];
    y[4 * i + 2] += f1 * x[3];
    y[4 * i + 3] += f2 * x[3];
  }
}

int NAME(add_linear)(const DeviceQueue *queue, int ncell, const double place[], const double factor[3], double y[])
{
  LAUNCH(queue, add_slopes, BlocksFor(ncell), 256, (Big)ncell, place, factor[0], factor[1], factor[2], y);
  return EndKernel(queue, __func__, 96. * ncell);
}

/* ---- sums ---- */

/* s [3][THREADS]: sums into the first */
#define ADD_UP(s) \
  for (int half = THREADS / 2; half > 0; half /= 2) { \
    BARRIER; \
    EACH_THREAD(t, THREADS) \
    if (t < half) \
      for (int a = 0; a < 3; a++) (s)[a * THREADS + t] += (s)[a * THREADS + t + half]; \
  }

KERNEL(THREADS, 4)
sum_nodes(const Big n, const double *RESTRICT weight, const Combination c, double *partial)
{
  SHARED double s[3 * THREADS];

  EACH_THREAD(t, THREADS)
  {
    double v[3] = {0, 0, 0};

    for (Big i = (Big)BLOCK * THREADS + t; i < n; i += (Big)BLOCKS * THREADS)
      for (int a = 0; a < 3; a++) v[a] += (weight ? weight[i] : 1) * combined(c, 3 * i + a);
    for (int a = 0; a < 3; a++) s[a * THREADS + t] = v[a];
  }
  ADD_UP(s)
  EACH_THREAD(t, THREADS)
  if (t < 3) partial[t * BLOCKS + BLOCK] = s[t * THREADS];
}

KERNEL(THREADS, 1) sum_blocks(const int blocks, const double *partial, double *out)
{
  SHARED double s[3 * THREADS];

  EACH_THREAD(t, THREADS)
  for (int a = 0; a < 3; a++) {
    double v = 0;

    for (int i = t; i < blocks; i += THREADS) v += partial[a * BLOCKS + i];
    s[a * THREADS + t] = v;
  }
  ADD_UP(s)
  EACH_THREAD(t, THREADS)
  if (t < 3) out[t] = s[t * THREADS];
}

int NAME(sum_components)(const DeviceQueue *queue, int nnode, const double weight[], int nv, const double *const v[],
                         const double factor[], double partial[], double out[])
{
  const int blocks = BlocksOfSum(nnode, THREADS, BLOCKS);

  LAUNCH(queue, sum_nodes, blocks, THREADS, (Big)nnode, weight, CombinationOf(nv, v, factor, NULL), partial);
  LAUNCH(queue, sum_blocks, 1, THREADS, blocks, partial, out);
  return EndKernel(queue, __func__, (24. * nv + (weight ? 8 : 0)) * nnode);
}

/* ---- largest ---- */

#define FIND_LARGEST(s) \
  for (int half = THREADS / 2; half > 0; half /= 2) { \
    BARRIER; \
    EACH_THREAD(t, THREADS) \
    if (t < half && (s)[t + half] > (s)[t]) (s)[t] = (s)[t + half]; \
  }

KERNEL(THREADS, 4)
largest_entries(const Big n, const double *RESTRICT v, const double *RESTRICT weight, const double shift0,
                const double shift1, const double shift2, double *partial)
{
  SHARED double s[THREADS];

  EACH_THREAD(t, THREADS)
  {
    double most = 0;

    for (Big i = (Big)BLOCK * THREADS + t; i < n; i += (Big)BLOCKS * THREADS) {
      const int    a = (int)(i % 3);
      const double x = magnitude(v[i] - (a == 0 ? shift0 : a == 1 ? shift1 : shift2)) * (weight ? weight[i] : 1);

      if (x > most) most = x;
    }
    s[t] = most;
  }
  FIND_LARGEST(s)
  EACH_THREAD(t, THREADS)
  if (t == 0) partial[BLOCK] = s[0];
}

KERNEL(THREADS, 1) largest_block(const int blocks, const double *partial, double *out)
{
  SHARED double s[THREADS];

  EACH_THREAD(t, THREADS)
  {
    double most = 0;

    for (int i = t; i < blocks; i += THREADS)
      if (partial[i] > most) most = partial[i];
    s[t] = most;
  }
  FIND_LARGEST(s)
  EACH_THREAD(t, THREADS)
  if (t == 0) out[0] = s[0];
}

int NAME(largest)(const DeviceQueue *queue, size_t n, const double v[], const double weight[], const double shift[3],
                  double partial[], double out[])
{
  const int blocks = BlocksOfSum((Big)n, THREADS, BLOCKS);

  LAUNCH(queue, largest_entries, blocks, THREADS, (Big)n, v, weight, shift ? shift[0] : 0, shift ? shift[1] : 0,
         shift ? shift[2] : 0, partial);
  LAUNCH(queue, largest_block, 1, THREADS, blocks, partial, out);
  return EndKernel(queue, __func__, (weight ? 16. : 8.) * (double)n);
}
