/* Inside of VCycle; for its files only. vcycle.c: life cycle and application. vcyclerows.c: rows of the levels. */
#pragma once
#include "vcycle.h"

/* Rows of this rank, columns numbered here: [0, own) its own, those of other ranks behind them */
typedef struct {
  PetscInt  n, own, nghost; /* rows; columns */
  PetscInt *start;          /* [n + 1], of a square matrix [3 n + 1]: entries before, behind the diagonal, of ghosts */
  PetscInt  capacity, *col;
  float    *value;
  PetscSF   ghosts; /* to the columns behind the own ones; NULL: on no rank there are any */
} VRows;

typedef struct {
  PetscBool  replicated; /* on all ranks, which have all rows of it */
  VRows      A;          /* without its diagonal */
  PetscReal *inverse;    /* [n] of the diagonal, made larger where the sweeps of ranks would not converge */
  float     *more;       /* [n] by so much */
  VRows      P;          /* to the next level from this one; none on the lowest */
  VRows      ghost;      /* rows of P of the ghosts, where the next level is replicated: not fetched on the way up */
  PetscReal *x, *b;      /* [n + ghosts], [n + ghosts of P of the level above] */
} VLevel;

struct _p_VCycle {
  MPI_Comm   comm;
  PetscBool  alone; /* there is one rank */
  PetscInt   n;
  VLevel    *level; /* finest first */
  PetscReal  unit;  /* entries are in it, a power of two */
  PetscReal *d;     /* [n + ghosts] D, or NULL */
  PetscInt  *ghost; /* global numbers of the finest level's ghosts */
};

/* Finest level: A in the cycle's unit. Ghosts that stay the same are not arranged again. Collective. */
PetscErrorCode VLevelTakeFinest(VCycle, Mat A);
/* A level of the ranks' own rows. Collective. */
PetscErrorCode VLevelTake(VCycle, Mat A, VLevel *);
/* Rows of P: columns are ghosts and own ones, or (replicated) numbers of all. Collective. */
PetscErrorCode VRowsTake(Mat P, PetscBool replicated, VRows *);
/* Levels that all hold: n matrices A[k], the last the finest, and P[k] from A[k + 1] to A[k]. Collective. */
PetscErrorCode VLevelsGather(VCycle, PetscInt n, Mat A[], Mat P[], VLevel level[]);
/* l->ghost: rows of l->P of the ghosts of l->A. Collective. */
PetscErrorCode VLevelFetchGhosts(VCycle, VLevel *l);
PetscErrorCode VRowsDestroy(VRows *);
