/* Device: what the operator has between nodes and bodies. Entries are pairs of a node and a body with four numbers
   each, of which products take three at a time. */
#include "functions.h"

/* Number m of entry e among n, of arrays [2][n][3] */
DEV Big number_of(const int n, const int e, const int m)
{
  return m < 3 ? (Big)e * 3 + m : ((Big)n + e) * 3;
}

KERNEL(256, 1) clear(const Big n, double *x, double *y)
{
  EACH(i, n) x[i] = y[i] = 0;
}

KERNEL(256, 1) place(const DeviceEntries s)
{
  EACH(i, (Big)s.narm * 4) s.x[number_of(s.n, s.entry[i / 4], (int)(i % 4))] = s.arm[i];
}

int NAME(place_arms)(const DeviceQueue *queue, const DeviceEntries *s)
{
  const Big n = 6 * (Big)s->n;

  LAUNCH(queue, clear, BlocksFor(n), 256, n, s->x, s->y);
  LAUNCH(queue, place, BlocksFor((Big)s->narm * 4), 256, *s);
  return EndKernel(queue, __func__, 96. * s->n + 68. * s->narm);
}

KERNEL(256, 1) subtract(const DevicePairs p, const int *RESTRICT entry, const DeviceEntries s)
{
  EACH(i, p.n)
  {
    if (entry[i] < 0) continue;
    for (int m = 0; m < 4; m++) s.y[number_of(s.n, entry[i], m)] -= p.value[(Big)m * p.n + i];
  }
}

int NAME(subtract_pairs)(const DeviceQueue *queue, const DevicePairs *p, const int entry[], const DeviceEntries *s)
{
  LAUNCH(queue, subtract, BlocksFor(p->n), 256, *p, entry, *s);
  return EndKernel(queue, __func__, 100. * p->n);
}

KERNEL(256, 1) take_numbers(const DeviceEntries s, const int n, const int *RESTRICT entry, double *value)
{
  EACH(i, n)
  for (int m = 0; m < 4; m++) value[(Big)m * n + i] = s.y[number_of(s.n, entry[i], m)];
}

int NAME(take_pairs)(const DeviceQueue *queue, const DeviceEntries *s, int n, const int entry[], double value[])
{
  LAUNCH(queue, take_numbers, BlocksFor(n), 256, *s, n, entry, value);
  return EndKernel(queue, __func__, 68. * n);
}

/* ---- between bodies ---- */

#define THREADS 128

/* s [16], THREADS apart += the products of the numbers of arm i and of its entry */
DEV void add_products(const DeviceEntries e, const int arm, const int entry, double *s)
{
  double y[4];

  for (int m = 0; m < 4; m++) y[m] = e.y[number_of(e.n, entry, m)];
  for (int k = 0; k < 4; k++)
    for (int m = 0; m < 4; m++) s[(4 * k + m) * THREADS] += e.arm[(Big)arm * 4 + k] * y[m];
}

KERNEL(THREADS, 4)
sum(const DeviceEntries e, const int *RESTRICT start, const int *RESTRICT arm, const int *RESTRICT entry, double *out)
{
  SHARED double s[16 * THREADS];

  EACH_THREAD(t, THREADS)
  {
    for (int m = 0; m < 16; m++) s[m * THREADS + t] = 0;
    for (int i = start[BLOCK] + t; i < start[BLOCK + 1]; i += THREADS) add_products(e, arm[i], entry[i], s + t);
  }
  for (int half = THREADS / 2; half > 0; half /= 2) {
    BARRIER;
    EACH_THREAD(t, THREADS)
    for (int m = 0; m < 16 && t < half; m++) s[m * THREADS + t] += s[m * THREADS + t + half];
  }
  BARRIER;
  EACH_THREAD(t, THREADS)
  if (t < 16) out[(Big)BLOCK * 16 + t] = s[t * THREADS];
}

int NAME(sum_entries)(const DeviceQueue *queue, const DeviceEntries *s, int n, int nterm, const int start[],
                      const int arm[], const int entry[], double out[])
{
  LAUNCH(queue, sum, n, THREADS, *s, start, arm, entry, out);
  return EndKernel(queue, __func__, 72. * nterm + 132. * n);
}
