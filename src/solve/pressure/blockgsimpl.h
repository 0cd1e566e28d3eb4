/* Inside of BlockGS; for its files only. blockgs.c: rows, sweeps, products. blockgsdevice.c: where vectors lie in the
   memory of a device. */
#pragma once
#include "blockgs.h"
#include "rowpool.h"

typedef struct {
  MPI_Comm         comm;
  PetscInt         nk, n, nghost; /* block size, own block rows, columns of other ranks */
  const PetscInt  *start, *column;
  PetscInt        *own, *before;     /* [n] own columns of a row, which come first; those before the diagonal */
  RowPool          pool;             /* blocks [nk][nk] column by column */
  float           *inverse;          /* [n][nk][nk], likewise */
  PetscInt         nborder, *border; /* rows with columns of other ranks */
  PetscReal       *ghost, *residual; /* [nghost][nk]; [n][nk] right-hand side less what other ranks' unknowns do */
  unsigned char   *fine;             /* [n] which rows products take exactly, or NULL: all, if exact */
  PetscSF          sf;               /* NULL on one rank */
  MPI_Datatype     unit;             /* nk reals */
  const PetscReal *extra;            /* [n][nk][nk] or NULL, see BlockGSSetExtra */
  /* W, see BlockGSSetLowRank */
  PetscInt         nt, nw, *w_row, *w_column;
  SharedReduction  shared_reduction; /* of the block columns, borrowed */
  PetscBool        any;              /* a part of low rank has been set */
  const PetscReal *w;                /* [nw][nk][nr], borrowed */
  PetscReal       *t;                /* [nt] W^T x, nr numbers for every block column */
  /* [ncolumn] what a sweep multiplies the column's part by: ranks that sweep it at the same time */
  PetscReal *factor;
  /* of BlockGSSetDevice, or NULL */
  const DeviceQueue *queue;
  const DeviceRows  *rows;
  PetscReal         *all;
} BlockGS;

/* BlockGSMultiplySparse there. Collective. */
PetscErrorCode BlockGSMultiplyOnDevice(const BlockGS *, Vec x, Vec y);
