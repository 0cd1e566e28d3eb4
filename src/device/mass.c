/* Device: products with the mass, whose coefficients are the first of the velocity operator's (cell.h): right-hand
   sides and energies. */
#include "cell.h"
#include "combination.h"
#include "functions.h"

/* scale times the mass of x; coefficients of a group, `size` numbers, of which those of the mass stand `stride` apart
   from point to point */
DEV void mass_group(const int box, const DeviceCells c, const int first, const Combination x, const double scale,
                    const Big size, const int stride, const double *RESTRICT coefficient, double *y)
{
  SHARED double s[81 * PAD];
  const int     g = first + BLOCK;

  UNROLL
  for (int m = 0; m < MAX_VECTORS; m++)
    if (m < x.n) EACH_THREAD(t, THREADS) gather(t, c, g, 0, m > 0, x.factor[m], x.v[m], s);
  BARRIER;
  EACH_THREAD(t, THREADS)
  {
    const double *k        = coefficient + BLOCK * size + t % G;
    double       *mine     = component(t, s), v[27];
    const double  constant = t < G ? x.constant[0] : t < 2 * G ? x.constant[1] : x.constant[2];

    if (x.n) to_positions(t, c, g, s);
    UNROLL
    for (int j = 0; j < 27; j++) v[j] = constant + (x.n ? mine[3 * j * PAD] : 0);
    turn_lines(0, v);
    UNROLL
    for (int q = 0; q < 27; q++) v[q] *= scale * (box ? point_weight(q) * k[0] : k[q * stride]);
    turn_lines(1, v);
    UNROLL
    for (int j = 0; j < 27; j++) mine[3 * j * PAD] = v[j];
    to_slots(t, c, g, s);
  }
  BARRIER;
  EACH_THREAD(t, THREADS)
  scatter(t, c, g, 0, s, y);
}

KERNEL(THREADS, 6)
of_boxes(const DeviceCells c, const Combination x, const double scale, const Big size, const int stride,
         const double *RESTRICT k, double *y)
{
  mass_group(1, c, 0, x, scale, size, stride, k, y);
}

KERNEL(THREADS, 5)
of_others(const DeviceCells c, const Combination x, const double scale, const Big size, const int stride,
          const double *RESTRICT k, double *y)
{
  mass_group(0, c, c.nbox, x, scale, size, stride, k, y);
}

int NAME(add_mass)(const DeviceQueue *queue, const DeviceCells *cells, const DeviceForm *form,
                   const double coefficient[], double scale, int n, const double *const v[], const double factor[],
                   const double constant[3], double y[])
{
  const int         flow = NFLOW(form->convection, form->skew != 0);
  const Big         box = box_size(flow, form->vary), other = other_size(flow);
  const Combination x = CombinationOf(n, v, factor, constant);

  LAUNCH(queue, of_boxes, cells->nbox, THREADS, *cells, x, scale, box, 0, coefficient, y);
  coefficient += cells->nbox * box;
  LAUNCH(queue, of_others, cells->ngroup - cells->nbox, THREADS, *cells, x, scale, other, (7 + flow) * G, coefficient,
         y);
  return EndKernel(queue, __func__,
                   NodeBytes(cells->ngroup) + G * 8. * (cells->nbox + 27. * (cells->ngroup - cells->nbox)) +
                     24. * (n + 2.) * cells->nnode);
}
