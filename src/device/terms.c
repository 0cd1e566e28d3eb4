/* Device: further terms of cells, from the moments of products of basis functions. */
#include "cell.h"
#include "functions.h"

#define MOMENTS 216

/* Of functions i and j on a line */
DEV int product_of(const int i, const int j)
{
  return i < j ? (i == 0 ? j : i == 1 ? 4 : 5) : i == j ? (i == 0 ? 0 : i == 1 ? 3 : 5) : (j == 0 ? i : 4);
}

/* Of nodes i and j of a cell */
DEV int moment_of(const int i, const int j)
{
  return (product_of(i / 9, j / 9) * 6 + product_of(i / 3 % 3, j / 3 % 3)) * 6 + product_of(i % 3, j % 3);
}

KERNEL(256, 1) arrange(const DeviceCells c, const double *RESTRICT from, double *to)
{
  EACH(i, (Big)c.ngroup * MOMENTS * G)
  {
    const int cell = c.cell[i / (MOMENTS * G) * G + i % G];

    to[i] = cell < 0 ? 0 : from[(Big)cell * MOMENTS + i / G % MOMENTS];
  }
}

int NAME(arrange_moments)(const DeviceQueue *queue, const DeviceCells *terms, const double from[], double moments[])
{
  LAUNCH(queue, arrange, BlocksFor((Big)terms->ngroup * MOMENTS * G), 256, *terms, from, moments);
  return LAST_ERROR();
}

/* o [27] = the term times v [27] at positions; m: moments of the lane */
DEV void multiply_term(const double *RESTRICT m, const double *v, double *o)
{
  UNROLL
  for (int i = 0; i < 27; i++) o[i] = 0;
  UNROLL
  for (int i = 0; i < 27; i++) {
    UNROLL
    for (int j = i; j < 27; j++) {
      const double e = m[moment_of(i, j) * G];

      o[i] += e * v[j];
      if (j > i) o[j] += e * v[i];
    }
  }
}

KERNEL(THREADS, 3)
add(const DeviceCells c, const double *RESTRICT moments, const int masked, const double *RESTRICT x, double *y)
{
  SHARED double s[81 * PAD];
  const int     g = BLOCK;

  EACH_THREAD(t, THREADS)
  gather(t, c, g, masked, 0, 1, x, s);
  BARRIER;
  EACH_THREAD(t, THREADS)
  {
    double *mine = component(t, s), v[27], o[27];

    to_positions(t, c, g, s);
    UNROLL
    for (int j = 0; j < 27; j++) v[j] = mine[3 * j * PAD];
    multiply_term(moments + (Big)g * MOMENTS * G + t % G, v, o);
    UNROLL
    for (int j = 0; j < 27; j++) mine[3 * j * PAD] = o[j];
    to_slots(t, c, g, s);
  }
  BARRIER;
  EACH_THREAD(t, THREADS)
  scatter(t, c, g, masked, s, y);
}

int NAME(add_terms)(const DeviceQueue *queue, const DeviceCells *terms, const double moments[], int masked,
                    const double x[], double y[])
{
  LAUNCH(queue, add, terms->ngroup, THREADS, *terms, moments, masked, x, y);
  return LAST_ERROR();
}

/* Entry (slot, slot): of x^T M x with x what the unit vector of the slot is at the positions */
DEV double diagonal_entry(const DeviceHang *h, const double *RESTRICT m, const int slot, double *x)
{
  double sum = 0;

  if (!h) return m[moment_of(slot, slot) * G];
  for (int j = 0; j < 27; j++) x[j] = j == slot;
  hang_gather(h, 1, x);
  for (int i = 0; i < 27; i++)
    for (int j = 0; j < 27 && x[i] != 0; j++) sum += x[i] * x[j] * m[moment_of(i, j) * G];
  return sum;
}

KERNEL(THREADS, 4) add_diagonal(const DeviceCells c, const double *RESTRICT moments, double *d)
{
  const int g = BLOCK;

  EACH_THREAD(t, THREADS)
  for (int slot = t / G; slot < 27; slot += 3) {
    const int e = c.node[((Big)g * G + t % G) * 27 + slot];
    double    x[27];

    if (e >= 0) ADD(d[NODE(e)], diagonal_entry(find_hang(t, c, g), moments + (Big)g * MOMENTS * G + t % G, slot, x));
  }
}

int NAME(add_terms_diagonal)(const DeviceQueue *queue, const DeviceCells *terms, const double moments[], double d[])
{
  LAUNCH(queue, add_diagonal, terms->ngroup, THREADS, *terms, moments, d);
  return LAST_ERROR();
}
