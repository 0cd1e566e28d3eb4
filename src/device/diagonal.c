/* Device: the diagonal of the velocity operator. Terms of the form are dealt out to the three threads of a cell, each
   of which takes its own along the axes by products of basis functions with themselves (fem/batch.c). Where something
   hangs, x^T K x of what the unit vector of a slot is at the positions. */
#include "cell.h"
#include "functions.h"

/* value^2, value times derivative, derivative^2 of basis function j at point q of a line */
DEV double pair(const int order, const int j, const int q)
{
  const double x = AT * (q - 1),
               v = j == 0 ? 0.5 * x * (x - 1)
                 : j == 1 ? 1 - x * x
                          : 0.5 * x * (x + 1),
               d = j == 0 ? x - 0.5
                 : j == 1 ? -2 * x
                          : x + 0.5;

  return order == 0 ? v * v : order == 1 ? v * d : d * d;
}

/* x [27] at points -> at nodes, along axis `axis` */
DEV void contract_pair(const int axis, const int order, double *x)
{
  const int s = axis == 0 ? 1 : axis == 1 ? 3 : 9;
  double    p[9];

  UNROLL
  for (int i = 0; i < 9; i++) p[i] = pair(order, i / 3, i % 3);
  UNROLL
  for (int line = 0; line < 9; line++) {
    const int    at = line / s * 3 * s + line % s;
    const double a = x[at], b = x[at + s], c = x[at + 2 * s];

    x[at]         = p[0] * a + p[1] * b + p[2] * c;
    x[at + s]     = p[3] * a + p[4] * b + p[5] * c;
    x[at + 2 * s] = p[6] * a + p[7] * b + p[8] * c;
  }
}

/* What coefficient k has of term t at point q: 0 mass with divergence, 1 to 3 convection, 4 to 9 diffusion xx xy xz yy
   yz zz */
DEV double read_term(const int box, const DeviceForm f, const double *RESTRICT k, const int t, const int e, const int h,
                     const int q)
{
  const int     skew = f.skew != 0, flow = NFLOW(f.convection, skew);
  const double *at = box ? k + (4 + q * (flow + f.vary)) * G : k + q * (7 + flow) * G, *u = box ? at : at + 7 * G;

  if (t == 0) return (box ? point_weight(q) * k[0] : at[0]) + (f.convection && skew ? u[3 * G] : 0);
  if (t < 4) return u[e * G];
  if (box) return point_weight(q) * k[(1 + e) * G] * (f.vary ? at[flow * G] : 1);
  return at[(t - 3) * G] * (e == h ? 1 : 2);
}

/* Thread t: what its terms add to d [27] */
DEV void add_terms(const int box, const int thread, const DeviceForm f, const double *RESTRICT k, double *d)
{
  for (int t = thread / G; t < 10; t += 3) {
    const int e = t < 4 ? t - 1 : t < 7 ? 0 : t < 9 ? 1 : 2, h = t < 7 ? t - 4 : t < 9 ? t - 6 : 2;
    double    x[27];

    if ((box && t >= 4 && e != h) || (!f.convection && t > 0 && t < 4)) continue;
    UNROLL
    for (int q = 0; q < 27; q++) x[q] = read_term(box, f, k, t, e, h, q);
    UNROLL
    for (int axis = 0; axis < 3; axis++)
      contract_pair(axis, t == 0 ? 0 : t < 4 ? axis == e : (axis == e) + (axis == h), x);
    UNROLL
    for (int j = 0; j < 27; j++) d[j] += x[j];
  }
}

/* Where something hangs: thread t has every third slot */
DEV void add_hanging(const int box, const int t, const DeviceCells c, const int g, const DeviceForm f,
                     const double *RESTRICT k, double *mine, double *diagonal)
{
  const DeviceHang *h = find_hang(t, c, g);

  for (int slot = t / G; slot < 27; slot += 3) {
    const int e = c.node[((Big)g * G + t % G) * 27 + slot];
    double    v[27], sum = 0;

    for (int j = 0; j < 27; j++) mine[3 * j * PAD] = j == slot;
    hang_gather(h, 3 * PAD, mine);
    UNROLL
    for (int j = 0; j < 27; j++) v[j] = mine[3 * j * PAD];
    multiply_cell(box, f.convection, f.skew != 0, f.vary, k, v);
    UNROLL
    for (int j = 0; j < 27; j++) sum += v[j] * mine[3 * j * PAD];
    if (e >= 0) ADD(diagonal[NODE(e)], sum);
  }
}

DEV void diagonal_group(const int box, const DeviceCells c, const int first, const DeviceForm f,
                        const double *RESTRICT coefficient, double *diagonal)
{
  SHARED double s[81 * PAD];
  const int     flow = NFLOW(f.convection, f.skew != 0), g = first + BLOCK;
  const double *k = coefficient + BLOCK * (box ? box_size(flow, f.vary) : other_size(flow));

  EACH_THREAD(t, THREADS)
  {
    double *mine = component(t, s);

    if (find_hang(t, c, g)) add_hanging(box, t, c, g, f, k + t % G, mine, diagonal);
    else {
      double d[27];

      UNROLL
      for (int j = 0; j < 27; j++) d[j] = 0;
      add_terms(box, t, f, k + t % G, d);
      UNROLL
      for (int j = 0; j < 27; j++) mine[3 * j * PAD] = d[j];
    }
  }
  BARRIER;
  EACH_THREAD(t, THREADS)
  for (int i = t; i < 27 * G; i += THREADS) {
    const int     cell_slot = i / 27, j = i % 27, e = c.node[((Big)g * G + cell_slot) * 27 + j];
    const double *d = s + 3 * j * PAD + cell_slot;

    if (e >= 0 && !find_hang(cell_slot, c, g)) ADD(diagonal[NODE(e)], d[0] + d[PAD] + d[2 * PAD]);
  }
}

KERNEL(THREADS, 2) of_boxes(const DeviceCells c, const DeviceForm f, const double *RESTRICT k, double *d)
{
  diagonal_group(1, c, 0, f, k, d);
}

KERNEL(THREADS, 2) of_others(const DeviceCells c, const DeviceForm f, const double *RESTRICT k, double *d)
{
  diagonal_group(0, c, c.nbox, f, k, d);
}

int NAME(add_diagonal)(const DeviceQueue *queue, const DeviceCells *cells, const DeviceForm *form,
                       const double coefficient[], double d[])
{
  LAUNCH(queue, of_boxes, cells->nbox, THREADS, *cells, *form, coefficient, d);
  coefficient += cells->nbox * box_size(NFLOW(form->convection, form->skew != 0), form->vary);
  LAUNCH(queue, of_others, cells->ngroup - cells->nbox, THREADS, *cells, *form, coefficient, d);
  return LAST_ERROR();
}

KERNEL(256, 1)
invert_entries(const Big n, const double min, const double *RESTRICT mass, const double *RESTRICT d, double *out)
{
  EACH(i, 3 * n)
  {
    const double value = d[i / 3], bound = min * mass[i / 3];

    out[i] = value == 0 ? 0 : 1 / (value > bound ? value : bound);
  }
}

int NAME(invert_diagonal)(const DeviceQueue *queue, int nnode, double min, const double mass[], const double d[],
                          double out[])
{
  LAUNCH(queue, invert_entries, BlocksFor(3 * (Big)nnode), 256, (Big)nnode, min, mass, d, out);
  return LAST_ERROR();
}
