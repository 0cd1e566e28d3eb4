/* Device: sums of products, in two passes and always in the same order. */
#include "functions.h"

#define THREADS 256
#define BLOCKS  (DEVICE_PARTIAL / 2)

/* s [2][THREADS]: sums of both into the first */
#define ADD_UP(s) \
  for (int half = THREADS / 2; half > 0; half /= 2) { \
    BARRIER; \
    EACH_THREAD(t, THREADS) \
    if (t < half) { \
      (s)[t] += (s)[t + half]; \
      (s)[THREADS + t] += (s)[THREADS + t + half]; \
    } \
  }

KERNEL(THREADS, 4)
sum_products(const Big n, const double *RESTRICT a, const double *RESTRICT b, const double *RESTRICT c,
             const double *RESTRICT d, double *partial)
{
  SHARED double s[2 * THREADS];

  EACH_THREAD(t, THREADS)
  {
    double v0 = 0, v1 = 0;

    for (Big i = (Big)BLOCK * THREADS + t; i < n; i += (Big)BLOCKS * THREADS) {
      v0 += a[i] * b[i];
      if (c) v1 += c[i] * d[i];
    }
    s[t]           = v0;
    s[THREADS + t] = v1;
  }
  ADD_UP(s)
  EACH_THREAD(t, THREADS)
  if (t < 2) partial[t * BLOCKS + BLOCK] = s[t * THREADS];
}

KERNEL(THREADS, 1) sum_partial(const int two, const int blocks, const double *partial, double *out)
{
  SHARED double s[2 * THREADS];

  EACH_THREAD(t, THREADS)
  {
    double v0 = 0, v1 = 0;

    for (int i = t; i < blocks; i += THREADS) {
      v0 += partial[i];
      v1 += partial[BLOCKS + i];
    }
    s[t]           = v0;
    s[THREADS + t] = v1;
  }
  ADD_UP(s)
  EACH_THREAD(t, THREADS)
  if (t < 1 + two) out[t] = s[t * THREADS];
}

int NAME(dot)(const DeviceQueue *queue, size_t n, const double a[], const double b[], const double c[],
              const double d[], double partial[], double out[])
{
  const int blocks = BlocksOfSum((Big)n, THREADS, BLOCKS);

  LAUNCH(queue, sum_products, blocks, THREADS, (Big)n, a, b, c, d, partial);
  LAUNCH(queue, sum_partial, 1, THREADS, c != NULL, blocks, partial, out);
  return EndKernel(queue, __func__, (c ? 32. : 16.) * (double)n);
}
