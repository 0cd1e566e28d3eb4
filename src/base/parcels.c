/* Parcels: see parcels.h. */
#include "compat.h"
#include "base/parcels.h"

PetscErrorCode ParcelsExchange(MPI_Comm comm, PetscMPIInt tag, PetscInt n, const PetscMPIInt to[], size_t bytes, const void *out, PetscInt *comes,
                               void *in, PetscMPIInt **from)
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
    PetscCallMPI(MPI_Irecv(into + (size_t)at * bytes, (PetscMPIInt)arrives[i], type, source[i], tag, comm, request + i));
    for (PetscInt j = 0; j < arrives[i]; j++) (*from)[at + j] = source[i];
  }
  for (PetscInt i = 0, at = 0; i < nto; at += count[i++])
    PetscCallMPI(MPI_Isend((const char *)out + (size_t)at * bytes, (PetscMPIInt)count[i], type, rank[i], tag, comm, request + nfrom + i));
  PetscCallMPI(MPI_Waitall(nto + nfrom, request, MPI_STATUSES_IGNORE));
  PetscCallMPI(MPI_Type_free(&type));
  PetscCall(PetscFree(request));
  PetscCall(PetscFree(source));
  PetscCall(PetscFree(arrives));
  PetscCall(PetscFree2(rank, count));
  *(char **)in = into;
  PetscFunctionReturn(PETSC_SUCCESS);
}
