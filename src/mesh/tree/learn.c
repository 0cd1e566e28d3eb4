/* Learn: of leaves that are given, those around the own ones (LeavesLearn of leaves.h). Layer by layer: positions that
   touch the last layer and are other ranks' go to these, which answer with the cells that hold them. */
#include "compat.h"
#include "leaves.h"
#include "base/sparse.h"
#include "base/array.h"

typedef struct {
  Leaves     *t;
  PetscMPIInt rank, tag;
  MPI_Comm    comm;
  Keys        asked, foreign; /* positions; leaves of other ranks */
  PetscInt    n, capacity;
  uint64_t   *key; /* [n] to ask for now */
  PetscInt    list_capacity;
} Learn;

static int compare_keys(const void *a, const void *b)
{
  const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;

  return x < y ? -1 : x > y;
}

/* Places beside leaves [n] that other ranks own and were not asked for, along the curve, and so by their ranks */
static PetscErrorCode list_positions(Learn *l, PetscInt n, const Leaf leaf[])
{
  PetscFunctionBeginUser;
  l->n = 0;
  for (PetscInt i = 0; i < n; i++) {
    PetscInt count, x[LEAVES_MAX_NEIGHBOURS][3];

    LeavesTouching(l->t, leaf + i, &count, x);
    for (PetscInt k = 0; k < count; k++) {
      const uint64_t key    = LeavesKey(l->t, x[k]);
      const PetscInt before = l->asked.n;
      PetscInt       found;

      if (LeavesOwner(l->t, key) == l->rank) continue;
      PetscCall(KeysAdd(&l->asked, key, 0, &found));
      if (l->asked.n == before) continue;
      PetscCall(ArrayReserve(l->n + 1, &l->capacity, &l->key, sizeof(*l->key), NULL));
      l->key[l->n++] = key;
    }
  }
  qsort(l->key, (size_t)l->n, sizeof(*l->key), compare_keys);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The leaves that hold the positions, at the end of the list if they are not in it yet */
static PetscErrorCode ask(Learn *l)
{
  Leaves      *t = l->t;
  PetscMPIInt *to, *from, *who;
  PetscInt     nasked, nreply;
  uint64_t    *asked;
  Leaf        *answer, *reply;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->n, &to));
  for (PetscInt i = 0; i < l->n; i++) to[i] = LeavesOwner(t, l->key[i]);
  PetscCall(SparseExchange(l->comm, l->tag, l->n, to, sizeof(*asked), l->key, &nasked, &asked, &from));
  PetscCall(PetscMalloc1(nasked, &answer));
  for (PetscInt i = 0; i < nasked; i++) answer[i] = t->leaf[LeavesOwnBefore(t, asked[i])];
  PetscCall(SparseExchange(l->comm, l->tag, nasked, from, sizeof(*answer), answer, &nreply, &reply, &who));
  for (PetscInt i = 0; i < nreply; i++) {
    const PetscInt before = l->foreign.n;
    PetscInt       found;

    PetscCall(KeysAdd(&l->foreign, reply[i].key, 0, &found));
    if (l->foreign.n == before) continue;
    PetscCall(ArrayReserve(t->nlist + 1, &l->list_capacity, &t->list, sizeof(*t->list), NULL));
    t->list[t->nlist++] = reply[i];
  }
  PetscCall(PetscFree(to));
  PetscCall(PetscFree(from));
  PetscCall(PetscFree(who));
  PetscCall(PetscFree(asked));
  PetscCall(PetscFree(answer));
  PetscCall(PetscFree(reply));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeavesLearn(Leaves *t)
{
  Learn    l     = {.t = t};
  PetscInt first = 0;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(t->comm, &l.rank));
  PetscCall(PetscCommDuplicate(t->comm, &l.comm, &l.tag));
  for (PetscInt layer = 0; layer < LEAVES_AROUND; layer++) {
    const PetscInt from = first;

    first = t->nlist;
    PetscCall(list_positions(&l, layer ? t->nlist - from : t->nleaf, layer ? t->list + from : t->leaf));
    PetscCall(ask(&l));
  }
  qsort(t->list, (size_t)t->nlist, sizeof(*t->list), LeavesCompare);
  PetscCall(PetscCommDestroy(&l.comm));
  PetscCall(KeysDestroy(&l.asked));
  PetscCall(KeysDestroy(&l.foreign));
  PetscCall(PetscFree(l.key));
  PetscFunctionReturn(PETSC_SUCCESS);
}
