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

/* x [27] = coefficient of term t at the points: 0 mass with divergence, 1 to 3 convection, 4 to 9 diffusion xx xy xz yy
   yz zz, times the weights of the points where those are not in the coefficients */
DEV void read_term(const int box, const DeviceForm f, const double *RESTRICT k, const int t, const int e, const int h,
                   double *x)
{
  const int     skew = f.skew != 0, flow = NFLOW(f.convection, skew), n = box ? flow + f.vary : 7 + flow;
  const int     first = box ? 0 : 7, more = t == 0 ? f.convection && skew : box && t >= 4 && f.vary;
  const double *at = k + (t == 0 ? 0 : box ? 1 + e : t - 3) * G, *vary = k + (first + (t == 0 ? 3 : flow)) * G;
  double        one = 0, factor = 1;

  if (box) k += 4 * G, vary += 4 * G;
  if (t > 0 && t < 4) at = k + (first + e) * G;
  else if (box) one = at[0];
  else factor = t > 0 && e != h ? 2 : 1;
  UNROLL
  for (int q = 0; q < 27; q++) {
    const double own = box && (t == 0 || t >= 4) ? point_weight(q) * one : factor * at[q * n * G];

    x[q] = !more ? own : t == 0 ? own + vary[q * n * G] : own * vary[q * n * G];
  }
}

/* Thread t: what its terms add to d [27], which stands `stride` apart in shared memory */
DEV void add_terms(const int box, const int thread, const DeviceForm f, const double *RESTRICT k, const int stride,
                   double *d)
{
  for (int t = thread / G; t < 10; t += 3) {
    const int e = t < 4 ? t - 1 : t < 7 ? 0 : t < 9 ? 1 : 2, h = t < 7 ? t - 4 : t < 9 ? t - 6 : 2;
    double    x[27];

    if ((box && t >= 4 && e != h) || (!f.convection && t > 0 && t < 4)) continue;
    read_term(box, f, k, t, e, h, x);
    UNROLL
    for (int axis = 0; axis < 3; axis++)
      contract_pair(axis, t == 0 ? 0 : t < 4 ? axis == e : (axis == e) + (axis == h), x);
    UNROLL
    for (int j = 0; j < 27; j++) d[j * stride] += x[j];
  }
}

/* Where something hangs: thread t has every third slot */
DEV void hanging_group(const int box, const int convection, const int skew, const int vary, const DeviceCells c,
                       const int first, const double *RESTRICT coefficient, double *diagonal)
{
  SHARED double s[81 * PAD];
  const int     flow = NFLOW(convection, skew), g = first + BLOCK;
  const double *k = coefficient + BLOCK * (box ? box_size(flow, vary) : other_size(flow));

  EACH_THREAD(t, THREADS)
  for (int slot = t / G; slot < 27; slot += 3) {
    const DeviceHang *h = find_hang(t, c, g);
    const int         e = c.node[((Big)g * G + t % G) * 27 + slot];
    double            v[27], sum = 0, *mine = component(t, s);

    if (!h || e < 0) continue;
    for (int j = 0; j < 27; j++) mine[3 * j * PAD] = j == slot;
    hang_gather(h, 3 * PAD, mine);
    UNROLL
    for (int j = 0; j < 27; j++) v[j] = mine[3 * j * PAD];
    multiply_cell(box, convection, skew, vary, k + t % G, v);
    UNROLL
    for (int j = 0; j < 27; j++) sum += v[j] * mine[3 * j * PAD];
    ADD(diagonal[NODE(e)], sum);
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

    for (int j = 0; j < 27; j++) mine[3 * j * PAD] = 0;
    add_terms(box, t, f, k + t % G, 3 * PAD, mine);
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

/* With the form as constants, as products have it: with numbers that are read they spill registers */
#define HANGING(name, box, convection, skew, vary) \
  KERNEL(THREADS, 2) name(const DeviceCells c, const int first, const double *RESTRICT k, double *d) \
  { \
    hanging_group(box, convection, skew, vary, c, first, k, d); \
  }
EACH_FORM(HANGING)

typedef void (*Hanging)(const DeviceCells, const int, const double *, double *);

int NAME(add_diagonal)(const DeviceQueue *queue, const DeviceCells *cells, const DeviceForm *form,
                       const double coefficient[], double d[])
{
  static const Hanging box[] = FORMS_OF_BOXES, other[] = FORMS_OF_OTHERS;
  const int            nother = cells->ngroup - cells->nbox, flow = NFLOW(form->convection, form->skew != 0);
  const double        *of_other    = coefficient + cells->nbox * box_size(flow, form->vary);
  const Hanging        hanging_box = box[find_form(form, form->vary)], hanging_other = other[find_form(form, 0)];

  LAUNCH(queue, of_boxes, cells->nbox, THREADS, *cells, *form, coefficient, d);
  LAUNCH(queue, of_others, nother, THREADS, *cells, *form, of_other, d);
  if (cells->hang) {
    LAUNCH(queue, hanging_box, cells->nbox, THREADS, *cells, 0, coefficient, d);
    LAUNCH(queue, hanging_other, nother, THREADS, *cells, cells->nbox, of_other, d);
  }
  return EndKernel(queue, __func__, NodeBytes(cells->ngroup) + CoefficientBytes(cells, form) + 16. * cells->nnode);
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
  return EndKernel(queue, __func__, 40. * nnode);
}
