/* Bandwidth: see bandwidth.h.

   Each figure is the best of several repetitions: what the machine can do, not what it does beside other work. Times
   are wall clock between barriers. */
#include "compat.h"
#include "bandwidth.h"
#include <petsctime.h>

#define TRIAD_LENGTH     8000000 /* doubles an array: 64 MB, beyond the share of a last-level cache that a core has */
#define TRIAD_REPEATS    8
#define SMOOTHER_REPEATS 50
#define SMOOTHER_SECONDS 1. /* no further repetition after this time */

/* Best time of some triads on this rank; ranks that take no part only keep step */
static PetscErrorCode time_triad(MPI_Comm comm, PetscBool is_active, PetscReal *restrict a, const PetscReal *restrict b,
                                 const PetscReal *restrict c, PetscReal *best)
{
  PetscFunctionBeginUser;
  *best = PETSC_MAX_REAL;
  for (PetscInt k = 0; k < TRIAD_REPEATS; k++) {
    const PetscReal s = 1 + k;
    PetscLogDouble  begin, end;

    PetscCallMPI(MPI_Barrier(comm));
    if (!is_active) continue;
    PetscCall(PetscTime(&begin));
    for (PetscInt i = 0; i < TRIAD_LENGTH; i++) a[i] = b[i] + s * c[i];
    PetscCall(PetscTime(&end));
    *best = PetscMin(*best, end - begin);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure_triad(MPI_Comm comm, Bandwidth *y)
{
  const PetscReal bytes = 3. * sizeof(PetscReal) * TRIAD_LENGTH;
  PetscReal      *a, *b, *c, best, sum, speed[2];
  PetscMPIInt     rank;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCall(PetscMalloc3(TRIAD_LENGTH, &a, TRIAD_LENGTH, &b, TRIAD_LENGTH, &c));
  for (PetscInt i = 0; i < TRIAD_LENGTH; i++) {
    a[i] = 0;
    b[i] = i % 7;
    c[i] = i % 5;
  }
  PetscCall(time_triad(comm, (PetscBool)(rank == 0), a, b, c, &best));
  speed[0] = rank ? 0 : bytes / best;
  PetscCall(time_triad(comm, PETSC_TRUE, a, b, c, &best));
  speed[1] = bytes / best;
  sum      = a[TRIAD_LENGTH / 2]; /* the compiler must not find that nobody reads a */
  PetscCheck(sum == b[TRIAD_LENGTH / 2] + TRIAD_REPEATS * c[TRIAD_LENGTH / 2], PETSC_COMM_SELF, PETSC_ERR_PLIB,
             "The triad gives %g", (double)sum);
  PetscCall(PetscFree3(a, b, c));
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, speed, 2, MPIU_REAL, MPIU_SUM, comm));
  y->triad_one = speed[0];
  y->triad_all = speed[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure_smoother(MPI_Comm comm, Mat S, Bandwidth *y)
{
  Vec            x, r;
  MatInfo        info;
  PetscLogDouble spent = 0;

  PetscFunctionBeginUser;
  PetscCall(MatCreateVecs(S, &x, &r));
  PetscCall(VecSet(x, 1));
  y->smoother = PETSC_MAX_REAL;
  for (PetscInt k = 0; k < SMOOTHER_REPEATS && spent < SMOOTHER_SECONDS; k++) {
    PetscLogDouble begin, end;

    PetscCallMPI(MPI_Barrier(comm));
    PetscCall(PetscTime(&begin));
    PetscCall(MatMult(S, x, r));
    PetscCall(PetscTime(&end));
    end -= begin;
    PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &end, 1, MPI_DOUBLE, MPI_MAX, comm));
    y->smoother = PetscMin(y->smoother, end);
    spent += end;
  }
  PetscCall(VecDestroy(&x));
  PetscCall(VecDestroy(&r));
  PetscCall(MatGetInfo(S, MAT_GLOBAL_SUM, &info));
  y->smoother_bytes = info.nz_used * (sizeof(PetscScalar) + sizeof(PetscInt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BandwidthMeasure(Mat S, Bandwidth *y)
{
  MPI_Comm comm;

  PetscFunctionBeginUser;
  PetscCall(PetscObjectGetComm((PetscObject)S, &comm));
  PetscCall(measure_triad(comm, y));
  PetscCall(measure_smoother(comm, S, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}
