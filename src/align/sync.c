/* Align, sync: what ranks tell each other about surfaces. */
#include "compat.h"
#include "impl.h"

PetscInt AlignFind(Align s, PetscInt number)
{
  const PetscInt *list = s->surfaces->number;
  PetscInt        from = 0, to = s->surfaces->n;

  while (to - from > 1) {
    const PetscInt middle = (from + to) / 2;

    if (list[middle] <= number) from = middle;
    else to = middle;
  }
  return to > from && list[from] == number ? from : -1;
}

PetscErrorCode AlignSyncSurfaces(Align s, PetscInt per, PetscInt v[])
{
  const MeshLocal *l      = s->loc;
  const PetscInt  *number = s->surfaces->number;

  PetscFunctionBeginUser;
  if (!AlignIsSpread(s)) {
    PetscCall(MeshSyncNodesInt(s->mesh, v));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt i = 0; i < l->nnode; i++)
    if (v[i]) v[i] = 1 + per * number[(v[i] - 1) / per] + (v[i] - 1) % per;
  PetscCall(MeshSyncNodesInt(s->mesh, v));
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    PetscInt k;

    if (!v[i]) continue;
    k = AlignFind(s, (v[i] - 1) / per);
    PetscCheck(k >= 0, PETSC_COMM_SELF, PETSC_ERR_PLIB,
               "Cells around surface %" PetscInt_FMT " are on a rank that does not know it", (v[i] - 1) / per);
    v[i] = 1 + per * k + (v[i] - 1) % per;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of a few numbers of every rank, where surfaces are spread: otherwise all have the same */
static PetscErrorCode reduce(Align s, MPI_Op op, PetscInt n, PetscReal v[])
{
  PetscFunctionBeginUser;
  if (AlignIsSpread(s)) PetscCall(MPIU_Allreduce(MPI_IN_PLACE, v, (PetscMPIInt)n, MPIU_REAL, op, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignSum(Align s, PetscInt n, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(reduce(s, MPIU_SUM, n, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignMax(Align s, PetscReal *v)
{
  PetscFunctionBeginUser;
  PetscCall(reduce(s, MPIU_MAX, 1, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignAny(Align s, PetscBool *any)
{
  PetscFunctionBeginUser;
  if (AlignIsSpread(s) && s->surfaces->nall)
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, any, 1, COMPAT_MPI_BOOL, MPI_LOR, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode reduce_local(Align s, MPI_Op op, PetscInt width, PetscReal v[])
{
  PetscMPIInt n;

  PetscFunctionBeginUser;
  PetscCall(PetscMPIIntCast(width * s->surfaces->n, &n));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, v, n, MPIU_REAL, op, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignSumLocal(Align s, PetscInt width, PetscReal v[])
{
  PetscFunctionBeginUser;
  if (AlignIsSpread(s)) PetscCall(s->surfaces->sum(s->surfaces->ctx, width, v));
  else PetscCall(reduce_local(s, MPIU_SUM, width, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignMaxLocal(Align s, PetscInt width, PetscReal v[])
{
  PetscFunctionBeginUser;
  if (AlignIsSpread(s)) PetscCall(s->surfaces->max(s->surfaces->ctx, width, v));
  else PetscCall(reduce_local(s, MPIU_MAX, width, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}
