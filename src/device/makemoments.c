/* Device: moments of the parts of cells in balls, from samples whose shares fall linearly over a width about the
   surface (couple/cutcells.h has the same on the host, for all shapes). A block has one part; sums go along one axis
   after the other. */
#include "functions.h"
#include <math.h>

#define G       DEVICE_GROUP
#define N       DEVICE_MAX_SAMPLES
#define PAIRS   6
#define THREADS 64

/* Products of two of the three functions of an axis at sample s of n */
DEV void set_pairs(const int s, const int n, double *pair)
{
  const double x    = (2 * s + 1.) / n - 1;
  const double f[3] = {x * (x - 1) / 2, 1 - x * x, x * (x + 1) / 2};

  pair[0] = f[0] * f[0];
  pair[1] = f[0] * f[1];
  pair[2] = f[0] * f[2];
  pair[3] = f[1] * f[1];
  pair[4] = f[1] * f[2];
  pair[5] = f[2] * f[2];
}

/* sum [6] over the samples along the first axis, at y and z from the centre */
DEV void sum_line(const DeviceBall b, const int n, const double *pair, const double y, const double z, double *sum)
{
  const double size = b.edge[0] * b.edge[1] * b.edge[2] / ((double)n * n * n);

  for (int i = 0; i < PAIRS; i++) sum[i] = 0;
  for (int s = 0; s < n; s++) {
    const double x    = b.lower[0] + b.edge[0] * (s + 0.5) / n;
    const double part = 0.5 - (sqrt(x * x + y * y + z * z) - b.radius) / b.width, some = part > 0 ? part : 0,
                 w = size * (some < 1 ? some : 1);

    for (int i = 0; i < PAIRS; i++) sum[i] += w * pair[s * PAIRS + i];
  }
}

KERNEL(THREADS, 8)
make(const int n, const int *RESTRICT place, const DeviceBall *RESTRICT ball, double *moment)
{
  SHARED double    pair[N * PAIRS], line[N * N * PAIRS], plane[N * PAIRS * PAIRS];
  const DeviceBall b = ball[BLOCK];

  EACH_THREAD(t, THREADS)
  for (int s = t; s < n; s += THREADS) set_pairs(s, n, pair + s * PAIRS);
  BARRIER;
  EACH_THREAD(t, THREADS)
  for (int row = t; row < n * n; row += THREADS)
    sum_line(b, n, pair, b.lower[1] + b.edge[1] * (row % n + 0.5) / n, b.lower[2] + b.edge[2] * (row / n + 0.5) / n,
             line + row * PAIRS);
  BARRIER;
  EACH_THREAD(t, THREADS)
  for (int e = t; e < n * PAIRS * PAIRS; e += THREADS) {
    const int z = e / (PAIRS * PAIRS), j = e / PAIRS % PAIRS, i = e % PAIRS;
    double    sum = 0;

    for (int y = 0; y < n; y++) sum += pair[y * PAIRS + j] * line[(z * n + y) * PAIRS + i];
    plane[e] = sum;
  }
  BARRIER;
  EACH_THREAD(t, THREADS)
  for (int m = t; m < PAIRS * PAIRS * PAIRS; m += THREADS) {
    const int to = place[BLOCK], j = m % (PAIRS * PAIRS);
    double    sum = 0;

    for (int z = 0; z < n; z++) sum += pair[z * PAIRS + m / (PAIRS * PAIRS)] * plane[z * PAIRS * PAIRS + j];
    moment[((Big)(to / G) * PAIRS * PAIRS * PAIRS + m) * G + to % G] = b.factor * sum;
  }
}

int NAME(make_moments)(const DeviceQueue *queue, int n, int nsample, const int place[], const DeviceBall ball[],
                       double moment[])
{
  LAUNCH(queue, make, n, THREADS, nsample, place, ball, moment);
  return EndKernel(queue, __func__, n * (sizeof(DeviceBall) + 4. + 216 * 8));
}
