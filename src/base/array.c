/* Array: see array.h. */
#include "compat.h"
#include "base/array.h"
#include <stdarg.h>

#define WIDTH (int)(8 * sizeof(PetscInt))
#define TOO_MANY \
  "A rank has %s of %.4g entries, more than this PETSc with %d-bit numbers counts (%.4g): use more ranks, fewer cells (-mesh_cells, -mesh_levels), or " \
  "build with a PETSc of 64-bit numbers (make check-64 shows how)"

PetscErrorCode ArrayCheckSize(MPI_Comm comm, const char what[], PetscReal n)
{
  PetscFunctionBeginUser;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &n, 1, MPIU_REAL, MPIU_MAX, comm));
  PetscCheck(n <= (PetscReal)PETSC_MAX_INT, comm, PETSC_ERR_USER_INPUT, TOO_MANY, what, (double)n, WIDTH,
             (double)PETSC_MAX_INT);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ArrayReserve(PetscInt n, PetscInt *capacity, ...)
{
  va_list arrays;

  PetscFunctionBeginUser;
  if (n >= 0 && n <= *capacity) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(n >= 0 && n < PETSC_MAX_INT, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, TOO_MANY, "a list",
             1 + (double)PETSC_MAX_INT, WIDTH, (double)PETSC_MAX_INT);
  *capacity = n < PETSC_MAX_INT / 2 - 32 ? 2 * n + 64 : PETSC_MAX_INT;
  va_start(arrays, capacity);
  for (void *array; (array = va_arg(arrays, void *));) {
    const size_t size = va_arg(arrays, size_t);

    PetscCall(PetscRealloc((size_t)*capacity * size, array));
  }
  va_end(arrays);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ArrayTrim(PetscInt n, PetscInt *capacity, ...)
{
  va_list arrays;

  PetscFunctionBeginUser;
  if (n < 64 || *capacity - n < *capacity / 4) PetscFunctionReturn(PETSC_SUCCESS);
  *capacity = n;
  va_start(arrays, capacity);
  for (void *array; (array = va_arg(arrays, void *));) {
    const size_t size = va_arg(arrays, size_t);

    PetscCall(PetscRealloc((size_t)n * size, array));
  }
  va_end(arrays);
  PetscFunctionReturn(PETSC_SUCCESS);
}
