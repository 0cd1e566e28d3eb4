/* Sparse exchange: see sparse.h. */
#include "compat.h"
#include "base/sparse.h"

PetscErrorCode SparseExchange(MPI_Comm comm, PetscMPIInt tag, PetscInt n, const PetscMPIInt to[], size_t bytes,
                              const void *out, PetscInt *comes, void *in, PetscMPIInt **from)
{
  PetscMPIInt *rank, *source, nto = 0, nfrom;
  PetscInt    *count, *arrives;
  char        *into;
  MPI_Datatype type;
  MPI_Request *request;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(n, &rank, n, &count));
  for (PetscInt i = 0; i < n; i++) {
    if (!i || to[i] != to[i - 1]) {
      rank[nto]    = to[i];
      count[nto++] = 0;
    }
    count[nto - 1]++;
  }
  PetscCall(PetscCommBuildTwoSided(comm, 1, MPIU_INT, nto, rank, count, &nfrom, &source, &arrives));
  *comes = 0;
  for (PetscMPIInt i = 0; i < nfrom; i++) *comes += arrives[i];
  PetscCall(PetscMalloc1((size_t)*comes * bytes, &into));
  PetscCall(PetscMalloc1(*comes, from));
  PetscCall(PetscMalloc1(nto + nfrom, &request));
  PetscCallMPI(MPI_Type_contiguous((int)bytes, MPI_BYTE, &type));
  PetscCallMPI(MPI_Type_commit(&type));
  for (PetscInt i = 0, at = 0; i < nfrom; at += arrives[i++]) {
    PetscMPIInt m;

    PetscCall(PetscMPIIntCast(arrives[i], &m));
    PetscCallMPI(MPI_Irecv(into + (size_t)at * bytes, m, type, source[i], tag, comm, request + i));
    for (PetscInt j = 0; j < arrives[i]; j++) (*from)[at + j] = source[i];
  }
  for (PetscInt i = 0, at = 0; i < nto; at += count[i++]) {
    PetscMPIInt m;

    PetscCall(PetscMPIIntCast(count[i], &m));
    PetscCallMPI(MPI_Isend((const char *)out + (size_t)at * bytes, m, type, rank[i], tag, comm, request + nfrom + i));
  }
  PetscCallMPI(MPI_Waitall(nto + nfrom, request, MPI_STATUSES_IGNORE));
  PetscCallMPI(MPI_Type_free(&type));
  PetscCall(PetscFree(request));
  PetscCall(PetscFree(source));
  PetscCall(PetscFree(arrives));
  PetscCall(PetscFree2(rank, count));
  *(char **)in = into;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SparseGather(MPI_Comm comm, PetscInt n, size_t bytes, const void *own, PetscInt *total, void *all,
                            PetscMPIInt **rank)
{
  PetscMPIInt  size, mine, *count, *start;
  MPI_Datatype type;
  char        *in;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscMPIIntCast(n, &mine));
  PetscCall(PetscMalloc2(size, &count, size + 1, &start));
  PetscCallMPI(MPI_Allgather(&mine, 1, MPI_INT, count, 1, MPI_INT, comm));
  start[0] = 0;
  for (PetscMPIInt r = 0; r < size; r++) start[r + 1] = start[r] + count[r];
  *total = start[size];
  PetscCall(PetscMalloc1((size_t)*total * bytes, &in));
  PetscCallMPI(MPI_Type_contiguous((int)bytes, MPI_BYTE, &type));
  PetscCallMPI(MPI_Type_commit(&type));
  PetscCallMPI(MPI_Allgatherv(own, mine, type, in, count, start, type, comm));
  PetscCallMPI(MPI_Type_free(&type));
  if (rank) PetscCall(PetscMalloc1(*total, rank));
  for (PetscMPIInt r = 0; r < size && rank; r++)
    for (PetscMPIInt i = start[r]; i < start[r + 1]; i++) (*rank)[i] = r;
  PetscCall(PetscFree2(count, start));
  *(char **)all = in;
  PetscFunctionReturn(PETSC_SUCCESS);
}
