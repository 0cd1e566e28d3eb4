/* Device: which components of nodes are fixed, and what stands there. */
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
  return LAST_ERROR();
}

KERNEL(256, 1) copy(const int n, const int *RESTRICT slot, const double *from, double *to)
{
  EACH(i, n) to[slot[i]] = from[slot[i]];
}

int NAME(copy_slots)(const DeviceQueue *queue, int n, const int slot[], const double from[], double to[])
{
  LAUNCH(queue, copy, BlocksFor(n), 256, n, slot, from, to);
  return LAST_ERROR();
}
