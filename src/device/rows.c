/* Device: rows of the pressure operator in blocks of 4 x 4, and its smoother. Four threads a row: thread m has column m
   of every block, whose four numbers stand side by side; what the four have of a number is added up through shared
   memory. */
#include "functions.h"

#define ROWS    64 /* a block of threads */
#define THREADS (4 * ROWS)

enum {
  MULTIPLY,
  RESIDUAL,
  SMOOTH,
  FIRST
};

typedef struct {
  double        c1, c2;
  const double *b, *x;
  double       *d, *y;
} Vectors;

/* sum [4] += column m of the blocks of row i times x */
#define ADD_ROW(T, value) \
  do { \
    const T *v      = (value) + (Big)r.at[i] * 16 + m * 4; \
    T        own[4] = {0, 0, 0, 0}; \
\
    UNROLL_BY(9) \
    for (int e = r.start[i]; e < r.start[i + 1]; e++, v += 16) { \
      const T xm = (T)x[(Big)r.column[e] * 4 + m]; \
\
      for (int k = 0; k < 4; k++) own[k] += v[k] * xm; \
    } \
    for (int k = 0; k < 4; k++) sum[k * THREADS] = (double)own[k]; \
  } while (0)

/* What the four threads of a row have of number m */
DEV double add_up(const double *sum, const int t)
{
  const double *s = sum + t % 4 * THREADS + t / 4 * 4;

  return (s[0] + s[1]) + (s[2] + s[3]);
}

DEV void rows_block(const int mode, const DeviceRows r, const Vectors v)
{
  SHARED double          sum[4 * THREADS], defect[THREADS];
  const double *RESTRICT x     = v.x;
  const Big              first = (Big)BLOCK * ROWS;

  EACH_THREAD(t, THREADS)
  {
    const Big i    = first + t / 4;
    const int m    = t % 4;
    double   *mine = sum + t;

    if (i < r.n && mode != FIRST) {
      double *sum = mine;

      if (mode == MULTIPLY) ADD_ROW(double, r.value);
      else ADD_ROW(float, r.single);
    }
  }
  BARRIER;
  EACH_THREAD(t, THREADS)
  {
    const Big at = first * 4 + t;

    if (first + t / 4 < r.n) {
      const double s = mode == FIRST ? 0 : add_up(sum, t);

      if (mode == MULTIPLY) v.y[at] = s;
      else if (mode == RESIDUAL) v.y[at] = v.b[at] - s;
      else defect[t] = v.b[at] - s;
    }
  }
  if (mode == MULTIPLY || mode == RESIDUAL) return;
  BARRIER;
  EACH_THREAD(t, THREADS)
  {
    const Big i = first + t / 4, at = first * 4 + t;

    if (i < r.n) {
      const float  *inverse = r.inverse + (Big)r.kind[i] * 16 + t % 4;
      const double *of      = defect + t / 4 * 4;
      double        d       = 0;

      for (int m = 0; m < 4; m++) d += (double)inverse[4 * m] * of[m];
      d       = v.c2 * d + (mode == FIRST || v.c1 == 0 ? 0 : v.c1 * v.d[at]);
      v.d[at] = d;
      v.y[at] = (mode == FIRST ? 0 : x[at]) + d;
    }
  }
}

KERNEL(THREADS, 4) multiply(const DeviceRows r, const Vectors v)
{
  rows_block(MULTIPLY, r, v);
}

KERNEL(THREADS, 4) residual(const DeviceRows r, const Vectors v)
{
  rows_block(RESIDUAL, r, v);
}

KERNEL(THREADS, 4) smooth(const DeviceRows r, const Vectors v)
{
  rows_block(SMOOTH, r, v);
}

KERNEL(THREADS, 4) smooth_first(const DeviceRows r, const Vectors v)
{
  rows_block(FIRST, r, v);
}

/* Columns and entries of all rows, those that are equal once; bytes of an entry */
HOST double row_bytes(const DeviceRows *r, double size)
{
  return 12. * r->n + 4. * r->nentry + 16. * size * r->nblock;
}

HOST int blocks_of(const DeviceRows *r)
{
  return (r->n + ROWS - 1) / ROWS;
}

int NAME(multiply_rows)(const DeviceQueue *queue, const DeviceRows *r, const double x[], double y[])
{
  const Vectors v = {0, 0, NULL, x, NULL, y};

  LAUNCH(queue, multiply, blocks_of(r), THREADS, *r, v);
  return EndKernel(queue, __func__, row_bytes(r, 8) + 64. * r->n);
}

int NAME(residual_rows)(const DeviceQueue *queue, const DeviceRows *r, const double b[], const double x[], double y[])
{
  const Vectors v = {0, 0, b, x, NULL, y};

  LAUNCH(queue, residual, blocks_of(r), THREADS, *r, v);
  return EndKernel(queue, __func__, row_bytes(r, 4) + 96. * r->n);
}

int NAME(smooth_rows)(const DeviceQueue *queue, const DeviceRows *r, const DeviceChebyshev *c)
{
  const Vectors v = {c->c1, c->c2, c->b, c->x, c->d, c->x_new};

  if (c->x) LAUNCH(queue, smooth, blocks_of(r), THREADS, *r, v);
  else LAUNCH(queue, smooth_first, blocks_of(r), THREADS, *r, v);
  return EndKernel(queue, __func__, (c->x ? row_bytes(r, 4) + 32. * r->n : 0) + (64 + 128.) * r->n);
}
