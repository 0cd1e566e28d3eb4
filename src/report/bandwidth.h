/* Bandwidth: how fast the machine is, measured in the process that has just computed, so that a time per step means
   something on another machine.

   Triad: a[i] = b[i] + s c[i] over arrays beyond the caches, 24 bytes an entry (McCalpin's STREAM; write-allocate
   traffic is not counted). Sweep: one product of a matrix with one vector, best of some; the unit in which a step is
   expressed. */
#pragma once
#include <petscmat.h>

typedef struct {
  PetscReal triad_one, triad_all; /* bandwidth of rank 0 while the others wait; sum over all ranks at the same time
                                     [bytes/s] */
  PetscReal smoother;             /* one product S x [s], slowest rank */
  PetscReal smoother_bytes;       /* what it reads at least: values and column indices of S, all ranks */
} Bandwidth;

/* Takes about a second and 192 MB a rank, which are freed again. Collective on the communicator of S. */
PetscErrorCode BandwidthMeasure(Mat S, Bandwidth *);
