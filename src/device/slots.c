/* Device: which components of nodes are fixed, what stands there, and entries of lists. */
#include "cell.h"
#include "functions.h"

KERNEL(256, 1) write_fixed(const Big n, const unsigned char *RESTRICT fixed, int *node)
{
  EACH(i, n)
  {
    const int e = node[i];

    if (e >= 0) node[i] = NODE(e) | (fixed ? (fixed[NODE(e)] & 7) << DEVICE_NODE_BITS : 0);
  }
}

int NAME(set_fixed)(const DeviceQueue *queue, const DeviceCells *cells, const unsigned char fixed[], int node[])
{
  const Big n = (Big)cells->ngroup * G * 27;

  LAUNCH(queue, write_fixed, BlocksFor(n), 256, n, fixed, node);
  return EndKernel(queue, __func__, 2 * NodeBytes(cells->ngroup) + cells->nnode);
}

KERNEL(256, 1) copy(const int n, const int *RESTRICT slot, const double *from, double *to)
{
  EACH(i, n) to[slot[i]] = from[slot[i]];
}

int NAME(copy_slots)(const DeviceQueue *queue, int n, const int slot[], const double from[], double to[])
{
  LAUNCH(queue, copy, BlocksFor(n), 256, n, slot, from, to);
  return EndKernel(queue, __func__, 20. * n);
}

KERNEL(256, 1) set(const int n, const int *RESTRICT slot, const double *RESTRICT value, double *to)
{
  EACH(i, n) to[slot[i]] = value[i];
}

int NAME(set_slots)(const DeviceQueue *queue, int n, const int slot[], const double value[], double to[])
{
  LAUNCH(queue, set, BlocksFor(n), 256, n, slot, value, to);
  return EndKernel(queue, __func__, 20. * n);
}

KERNEL(256, 1) fill(const int n, const int *RESTRICT slot, const double value, double *to)
{
  EACH(i, n) to[slot[i]] = value;
}

int NAME(fill_slots)(const DeviceQueue *queue, int n, const int slot[], double value, double to[])
{
  LAUNCH(queue, fill, BlocksFor(n), 256, n, slot, value, to);
  return EndKernel(queue, __func__, 12. * n);
}

KERNEL(256, 1) pick_rows(const int n, const int size, const int *RESTRICT row, const double *RESTRICT from, double *out)
{
  EACH(i, (Big)n * size) out[i] = from[(Big)row[i / size] * size + i % size];
}

int NAME(pick)(const DeviceQueue *queue, int n, int size, const int row[], const double from[], double out[])
{
  LAUNCH(queue, pick_rows, BlocksFor((Big)n * size), 256, n, size, row, from, out);
  return EndKernel(queue, __func__, n * (4. + 16. * size));
}

KERNEL(256, 1) put_rows(const int n, const int size, const int *RESTRICT row, const double *RESTRICT value, double *to)
{
  EACH(i, (Big)n * size) to[(Big)row[i / size] * size + i % size] = value[i];
}

int NAME(put)(const DeviceQueue *queue, int n, int size, const int row[], const double value[], double to[])
{
  LAUNCH(queue, put_rows, BlocksFor((Big)n * size), 256, n, size, row, value, to);
  return EndKernel(queue, __func__, n * (4. + 16. * size));
}

KERNEL(256, 1) add_rows(const int n, const int size, const int *RESTRICT row, const double *RESTRICT value, double *to)
{
  EACH(i, (Big)n * size) to[(Big)row[i / size] * size + i % size] += value[i];
}

int NAME(add)(const DeviceQueue *queue, int n, int size, const int row[], const double value[], double to[])
{
  LAUNCH(queue, add_rows, BlocksFor((Big)n * size), 256, n, size, row, value, to);
  return EndKernel(queue, __func__, n * (4. + 24. * size));
}
