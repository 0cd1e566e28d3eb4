/* SharedReduction: see sharedreduction.h. */
#include "compat.h"
#include "sharedreduction.h"

#define RECORD (REDUCTION_MANY + 1) /* number of sharers, or -1 - index among the wide ones; the sharers, ascending */

struct _p_SharedReduction {
  MPI_Comm     comm;
  PetscMPIInt  tag, rank, nnear, nbefore, *near; /* neighbours, ascending; those of lower rank */
  PetscInt    *start, *entry;                    /* entries [start[nnear]] to exchange, by neighbour, ascending */
  PetscInt     nshared, *shared, max_unit;       /* entries on a few ranks */
  PetscInt     nwide, nmine, *wide, *mine;       /* on any rank, here; index among the wide ones, entry [nmine] */
  PetscReal   *in, *out, *own, *sum;
  MPI_Request *request;
};

/* What each root tells its leaves, [roots][RECORD]; nwide: roots of many leaves, on all ranks */
static PetscErrorCode write_records(PetscSF sf, MPI_Comm comm, PetscInt nroot, PetscMPIInt rank, PetscInt nleaf,
                                    PetscInt record[], PetscInt *nwide)
{
  const PetscInt *degree;
  PetscInt       *mine, *sharer, total = 0, wide = 0, before = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscSFComputeDegreeBegin(sf, &degree));
  PetscCall(PetscSFComputeDegreeEnd(sf, &degree));
  for (PetscInt i = 0; i < nroot; i++) {
    total += degree[i];
    wide += degree[i] > REDUCTION_MANY;
  }
  PetscCallMPI(MPI_Exscan(&wide, &before, 1, MPIU_INT, MPI_SUM, comm));
  PetscCall(MPIU_Allreduce(&wide, nwide, 1, MPIU_INT, MPI_SUM, comm));
  PetscCall(PetscMalloc2(nleaf, &mine, total, &sharer));
  for (PetscInt i = 0; i < nleaf; i++) mine[i] = rank;
  PetscCall(PetscSFGatherBegin(sf, MPIU_INT, mine, sharer));
  PetscCall(PetscSFGatherEnd(sf, MPIU_INT, mine, sharer));
  for (PetscInt i = 0, at = 0; i < nroot; at += degree[i++]) {
    PetscInt *r = record + i * RECORD;

    r[0] = degree[i] > REDUCTION_MANY ? -1 - before++ : degree[i];
    PetscCall(PetscSortInt(degree[i], sharer + at));
    for (PetscInt j = 0; j < r[0]; j++) r[1 + j] = sharer[at + j];
  }
  PetscCall(PetscFree2(mine, sharer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The neighbours and what to exchange with them, from pairs (rank, entry) in the order of entries */
static PetscErrorCode list_neighbours(SharedReduction s, PetscInt npair, PetscInt to[], PetscInt entry[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscSortIntWithArray(npair, to, entry));
  for (PetscInt i = 0; i < npair; i++) s->nnear += !i || to[i] != to[i - 1];
  PetscCall(PetscMalloc3(s->nnear, &s->near, s->nnear + 1, &s->start, npair, &s->entry));
  PetscCall(PetscMalloc3(npair * s->max_unit, &s->in, npair * s->max_unit, &s->out, 2 * s->nnear, &s->request));
  s->nnear = 0;
  for (PetscInt i = 0; i < npair; i++) {
    if (!i || to[i] != to[i - 1]) {
      s->near[s->nnear]    = (PetscMPIInt)to[i];
      s->start[s->nnear++] = i;
      s->nbefore += to[i] < s->rank;
    }
    s->entry[i] = entry[i];
  }
  s->start[s->nnear] = npair;
  for (PetscInt r = 0; r < s->nnear; r++)
    PetscCall(PetscSortInt(s->start[r + 1] - s->start[r], s->entry + s->start[r]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_records(SharedReduction s, PetscInt n, const PetscInt record[])
{
  PetscInt npair = 0, *to, *entry;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) {
    s->nmine += record[i * RECORD] < 0;
    s->nshared += record[i * RECORD] > 1;
    npair += PetscMax(0, record[i * RECORD] - 1);
  }
  PetscCall(PetscMalloc3(s->nshared, &s->shared, s->nmine, &s->wide, s->nmine, &s->mine));
  PetscCall(PetscMalloc2(s->nshared * s->max_unit, &s->own, s->nwide * s->max_unit, &s->sum));
  PetscCall(PetscMalloc2(npair, &to, npair, &entry));
  s->nshared = s->nmine = npair = 0;
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt *r = record + i * RECORD;

    if (r[0] < 0) {
      s->wide[s->nmine]   = -1 - r[0];
      s->mine[s->nmine++] = i;
    } else if (r[0] > 1) s->shared[s->nshared++] = i;
    for (PetscInt j = 1; j <= r[0]; j++) {
      if (r[j] == s->rank) continue;
      to[npair]      = r[j];
      entry[npair++] = i;
    }
  }
  PetscCall(list_neighbours(s, npair, to, entry));
  PetscCall(PetscFree2(to, entry));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SharedReductionCreate(PetscSF sf, PetscInt n, PetscInt max_unit, SharedReduction *shared_reduction)
{
  SharedReduction s;
  PetscMPIInt     size;
  PetscInt        nroot, *root, *leaf;
  MPI_Datatype    type;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->max_unit = max_unit;
  PetscCall(PetscCommDuplicate(PetscObjectComm((PetscObject)sf), &s->comm, &s->tag));
  PetscCallMPI(MPI_Comm_rank(s->comm, &s->rank));
  PetscCallMPI(MPI_Comm_size(s->comm, &size));
  *shared_reduction = s;
  if (size == 1) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscSFGetGraph(sf, &nroot, NULL, NULL, NULL));
  PetscCall(PetscMalloc2(nroot * RECORD, &root, n * RECORD, &leaf));
  PetscCall(write_records(sf, s->comm, nroot, s->rank, n, root, &s->nwide));
  PetscCallMPI(MPI_Type_contiguous(RECORD, MPIU_INT, &type));
  PetscCallMPI(MPI_Type_commit(&type));
  PetscCall(PetscSFBcastBegin(sf, type, root, leaf, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(sf, type, root, leaf, MPI_REPLACE));
  PetscCallMPI(MPI_Type_free(&type));
  PetscCall(read_records(s, n, leaf));
  PetscCall(PetscFree2(root, leaf));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SharedReductionDestroy(SharedReduction *shared_reduction)
{
  SharedReduction s = *shared_reduction;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree3(s->near, s->start, s->entry));
  PetscCall(PetscFree3(s->in, s->out, s->request));
  PetscCall(PetscFree3(s->shared, s->wide, s->mine));
  PetscCall(PetscFree2(s->own, s->sum));
  PetscCall(PetscCommDestroy(&s->comm));
  PetscCall(PetscFree(*shared_reduction));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode start_exchange(SharedReduction s, PetscInt unit, const PetscReal value[])
{
  PetscFunctionBeginUser;
  for (PetscMPIInt r = 0; r < s->nnear; r++) {
    const PetscInt begin = s->start[r];
    PetscMPIInt    n;

    PetscCall(PetscMPIIntCast((s->start[r + 1] - begin) * unit, &n));
    PetscCallMPI(MPI_Irecv(s->in + begin * unit, n, MPIU_REAL, s->near[r], s->tag, s->comm, s->request + r));
  }
  for (PetscMPIInt r = 0; r < s->nnear; r++) {
    const PetscInt begin = s->start[r];
    PetscMPIInt    n;

    PetscCall(PetscMPIIntCast((s->start[r + 1] - begin) * unit, &n));
    for (PetscInt e = begin * unit; e < begin * unit + n; e++) s->out[e] = value[s->entry[e / unit] * unit + e % unit];
    PetscCallMPI(
      MPI_Isend(s->out + begin * unit, n, MPIU_REAL, s->near[r], s->tag, s->comm, s->request + s->nnear + r));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Parts of the neighbours [from, to) */
static void add_contributions(SharedReduction s, PetscInt unit, PetscMPIInt from, PetscMPIInt to, PetscReal value[])
{
  for (PetscInt e = s->start[from] * unit; e < s->start[to] * unit; e++)
    value[s->entry[e / unit] * unit + e % unit] += s->in[e];
}

static PetscErrorCode sum_wide(SharedReduction s, PetscInt unit, PetscReal value[])
{
  PetscMPIInt count;

  PetscFunctionBeginUser;
  if (!s->nwide) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMPIIntCast(s->nwide * unit, &count));
  PetscCall(PetscArrayzero(s->sum, s->nwide * unit));
  for (PetscInt e = 0; e < s->nmine * unit; e++)
    s->sum[s->wide[e / unit] * unit + e % unit] = value[s->mine[e / unit] * unit + e % unit];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, s->sum, count, MPIU_REAL, MPIU_SUM, s->comm));
  for (PetscInt e = 0; e < s->nmine * unit; e++)
    value[s->mine[e / unit] * unit + e % unit] = s->sum[s->wide[e / unit] * unit + e % unit];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SharedReductionSum(SharedReduction s, PetscInt unit, PetscReal value[])
{
  PetscFunctionBeginUser;
  PetscCall(SharedReductionSumBegin(s, unit, value));
  PetscCall(SharedReductionSumEnd(s, unit, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SharedReductionSumBegin(SharedReduction s, PetscInt unit, const PetscReal value[])
{
  PetscFunctionBeginUser;
  if (s && s->nnear) PetscCall(start_exchange(s, unit, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SharedReductionSumEnd(SharedReduction s, PetscInt unit, PetscReal value[])
{
  PetscFunctionBeginUser;
  if (!s || (!s->nnear && !s->nwide)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(sum_wide(s, unit, value));
  for (PetscInt e = 0; e < s->nshared * unit; e++) {
    PetscReal *v = value + s->shared[e / unit] * unit + e % unit;

    s->own[e] = *v;
    *v        = 0;
  }
  PetscCallMPI(MPI_Waitall(2 * s->nnear, s->request, MPI_STATUSES_IGNORE));
  add_contributions(s, unit, 0, s->nbefore, value);
  for (PetscInt e = 0; e < s->nshared * unit; e++) value[s->shared[e / unit] * unit + e % unit] += s->own[e];
  add_contributions(s, unit, s->nbefore, s->nnear, value);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SharedReductionGetSizes(SharedReduction s, PetscInt *shared, PetscInt *sent)
{
  PetscFunctionBeginUser;
  if (shared) *shared = s->nshared + s->nmine;
  if (sent) *sent = s->nnear ? s->start[s->nnear] : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}
