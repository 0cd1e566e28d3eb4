/* Combination: a sum of a few vectors, and a constant by component, as kernels take it. */
#pragma once
#include "kernel.h"

#define MAX_VECTORS 4

typedef struct {
  int           n;
  const double *v[MAX_VECTORS];
  double        factor[MAX_VECTORS], constant[3];
} Combination;

/* v, factor [n <= MAX_VECTORS] and constant (NULL: 0) on the host; v: arrays of the device */
HOST Combination CombinationOf(int n, const double *const v[], const double factor[], const double constant[3])
{
  Combination c;

  c.n = n;
  for (int m = 0; m < MAX_VECTORS; m++) {
    c.v[m]      = m < n ? v[m] : NULL;
    c.factor[m] = m < n ? factor[m] : 0;
  }
  for (int a = 0; a < 3; a++) c.constant[a] = constant ? constant[a] : 0;
  return c;
}
