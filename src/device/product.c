/* Device: products with the velocity operator, y += S x. A block takes 32 cells of one kind; kernels are compiled for
   each kind and form (fem/batch.h has the method and the same for the processor). */
#include "cell.h"
#include "functions.h"

/* Coefficients of a lane, in groups of so many numbers, of which the kind's own come first */
DEV const double *find_coefficients(const int box, const DeviceCells c, const int g, const int lane, const Big size,
                                    const double *RESTRICT coefficient)
{
  const int first = box ? 0 : c.from ? c.of_boxes : c.nbox, place = c.from ? c.from[g * G + lane] : g * G + lane;

  return coefficient + (place / G - first) * size + place % G;
}

DEV void multiply_group(const int box, const int convection, const int skew, const int vary, const DeviceCells c,
                        const int first, const double *RESTRICT coefficient, const int masked, const double *RESTRICT x,
                        double *y)
{
  SHARED double s[81 * PAD];
  const int     flow = NFLOW(convection, skew), g = first + BLOCK;
  const Big     size = box ? box_size(flow, vary) : other_size(flow);

  EACH_THREAD(t, THREADS)
  gather(t, c, g, masked, 0, 1, x, s);
  BARRIER;
  EACH_THREAD(t, THREADS)
  {
    double  v[27];
    double *mine = component(t, s);

    to_positions(t, c, g, s);
    UNROLL
    for (int j = 0; j < 27; j++) v[j] = mine[3 * j * PAD];
    multiply_cell(box, convection, skew, vary, find_coefficients(box, c, g, t % G, size, coefficient), v);
    UNROLL
    for (int j = 0; j < 27; j++) mine[3 * j * PAD] = v[j];
    to_slots(t, c, g, s);
  }
  BARRIER;
  EACH_THREAD(t, THREADS)
  scatter(t, c, g, masked, s, y);
}

#define MULTIPLY(name, box, convection, skew, vary) \
  KERNEL(THREADS, 4) \
  name(const DeviceCells c, const int first, const double *RESTRICT k, const int masked, const double *RESTRICT x, \
       double *y) \
  { \
    multiply_group(box, convection, skew, vary, c, first, k, masked, x, y); \
  }
EACH_FORM(MULTIPLY)

typedef void (*Multiply)(const DeviceCells, const int, const double *, const int, const double *, double *);

int NAME(multiply)(const DeviceQueue *queue, const DeviceCells *cells, const DeviceForm *form,
                   const double coefficient[], int masked, const double x[], double y[])
{
  static const Multiply box[] = FORMS_OF_BOXES, other[] = FORMS_OF_OTHERS;
  const int             skew = form->convection && form->skew != 0, flow = NFLOW(form->convection, skew);
  const Multiply        of_boxes = box[find_form(form, form->vary)], of_others = other[find_form(form, 0)];

  LAUNCH(queue, of_boxes, cells->nbox, THREADS, *cells, 0, coefficient, masked, x, y);
  coefficient += (cells->from ? cells->of_boxes : cells->nbox) * box_size(flow, form->vary != 0);
  LAUNCH(queue, of_others, cells->ngroup - cells->nbox, THREADS, *cells, cells->nbox, coefficient, masked, x, y);
  return EndKernel(queue, __func__, NodeBytes(cells->ngroup) + CoefficientBytes(cells, form) + 72. * cells->nnode);
}
