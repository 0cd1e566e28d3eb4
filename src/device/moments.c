/* Device: parts of cells with a mass of their own, from their moments: a block has 32 parts, a thread one component of
   one part (cell.h). Entry i j of a matrix is the moment of the pairs of functions along the axes. */
#include "cell.h"
#include "functions.h"

/* Which of 6 pairs functions i and j of a line are */
BOTH int pair_of(const int i, const int j)
{
  const int low = i < j ? i : j, high = i < j ? j : i;

  return low == 0 ? high : low == 1 ? 2 + high : 5;
}

/* Entry of the matrix of a lane */
DEV double entry(const double *RESTRICT m, const int i, const int j)
{
  return m[((pair_of(i / 9, j / 9) * 6 + pair_of(i / 3 % 3, j / 3 % 3)) * 6 + pair_of(i % 3, j % 3)) * G];
}

/* v [27], `stride` apart <- the matrix times v */
DEV void multiply_matrix(const double *RESTRICT m, const int stride, double *v)
{
  double x[27], y[27];

  for (int j = 0; j < 27; j++) x[j] = v[j * stride];
  for (int i = 0; i < 27; i++) {
    double sum = 0;

    for (int j = 0; j < 27; j++) sum += entry(m, i, j) * x[j];
    y[i] = sum;
  }
  for (int i = 0; i < 27; i++) v[i * stride] = y[i];
}

DEV void leave_out(const int without, const int stride, double *v)
{
  for (int j = 0; j < 27; j++)
    if (without >> j & 1) v[j * stride] = 0;
}

/* Moments of place e */
DEV const double *moments_of(const DeviceMoments p, const int e)
{
  const int from = p.from ? p.from[e] : e;

  return p.moment + (Big)(from / G) * 216 * G + from % G;
}

/* As the kernels of cells want them */
DEV DeviceCells cells_of(const DeviceMoments p)
{
  DeviceCells c = {0};

  c.node  = p.node;
  c.hang  = p.hang;
  c.hangs = p.hangs;
  return c;
}

KERNEL(THREADS, 4) multiply_all(const DeviceMoments p, const double *RESTRICT x, double *y)
{
  SHARED double     s[81 * PAD];
  const DeviceCells c = cells_of(p);

  EACH_THREAD(t, THREADS)
  gather(t, c, BLOCK, 0, 0, 1, x, s);
  BARRIER;
  EACH_THREAD(t, THREADS)
  {
    double   *mine    = component(t, s);
    const int without = p.without[BLOCK * G + t % G];

    leave_out(without, 3 * PAD, mine);
    to_positions(t, c, BLOCK, s);
    multiply_matrix(moments_of(p, BLOCK * G + t % G), 3 * PAD, mine);
    to_slots(t, c, BLOCK, s);
    leave_out(without, 3 * PAD, mine);
  }
  BARRIER;
  EACH_THREAD(t, THREADS)
  scatter(t, c, BLOCK, 0, s, y);
}

int NAME(multiply_moments)(const DeviceQueue *queue, const DeviceMoments *p, const double x[], double y[])
{
  LAUNCH(queue, multiply_all, p->ngroup, THREADS, *p, x, y);
  return EndKernel(queue, __func__, NodeBytes(p->ngroup) + (double)p->ngroup * G * (216 * 8. + 27 * 72.));
}

/* What unit vectors of slots are at the positions, where something hangs: thread t has every third slot */
DEV void add_hanging(const int t, const DeviceMoments p, const DeviceHang *h, const int g, double *mine,
                     double *diagonal)
{
  const double *m = moments_of(p, g * G + t % G);

  for (int slot = t / G; slot < 27; slot += 3) {
    const int e   = p.node[((Big)g * G + t % G) * 27 + slot];
    double    sum = 0;

    if (e < 0 || p.without[g * G + t % G] >> slot & 1) continue;
    for (int j = 0; j < 27; j++) mine[3 * j * PAD] = j == slot;
    hang_gather(h, 3 * PAD, mine);
    for (int i = 0; i < 27; i++)
      for (int j = 0; j < 27; j++) sum += mine[3 * i * PAD] * entry(m, i, j) * mine[3 * j * PAD];
    ADD(diagonal[NODE(e)], sum);
  }
}

KERNEL(THREADS, 2) diagonal_all(const DeviceMoments p, double *diagonal)
{
  SHARED double     s[81 * PAD];
  const DeviceCells c = cells_of(p);

  EACH_THREAD(t, THREADS)
  {
    const DeviceHang *h = find_hang(t, c, BLOCK);
    const double     *m = moments_of(p, BLOCK * G + t % G);

    if (h) add_hanging(t, p, h, BLOCK, component(t, s), diagonal);
    for (int slot = t / G; slot < 27 && !h; slot += 3) {
      const int e = p.node[((Big)BLOCK * G + t % G) * 27 + slot];

      if (e >= 0 && !(p.without[BLOCK * G + t % G] >> slot & 1)) ADD(diagonal[NODE(e)], entry(m, slot, slot));
    }
  }
}

int NAME(add_moments_diagonal)(const DeviceQueue *queue, const DeviceMoments *p, double d[])
{
  LAUNCH(queue, diagonal_all, p->ngroup, THREADS, *p, d);
  return EndKernel(queue, __func__, NodeBytes(p->ngroup) + (double)p->ngroup * G * (27 * 8. + 27 * 16.));
}
