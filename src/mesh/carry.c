/* Carry: see mesh/carry.h. Places are in quarters of finest cells. Who has the old cell at a place is told by the
   ranks' first keys, without looking for the cell. */
#include "compat.h"
#include "mesh/carry.h"
#include "impl.h"
#include "leaves.h"
#include "mesh/element.h"

/* n places, wanted by this rank, on their way to the owners of the old cells there */
typedef struct {
  const Leaves *leaves;
  PetscMPIInt   size, *ask, *asked, *ask_at, *asked_at;
  PetscInt      n, nasked, *slot; /* slot [n]: where place i stands among those sent */
  PetscInt     *place;            /* [nasked][3] what others want */
} Travel;

/* Owner of the old finest cell at a place; the upper end of the box belongs to the last one */
static PetscMPIInt owner_of(const Leaves *t, const PetscInt quarter[3], uint64_t *key)
{
  PetscInt x[3] = {0, 0, 0};

  for (PetscInt d = 0; d < t->dim; d++) x[d] = PetscMin(quarter[d] / 4, t->cells[d] - 1);
  *key = LeavesKey(t, x);
  return LeavesOwner(t, *key);
}

static PetscErrorCode begin_travel(const Leaves *t, PetscInt n, const PetscInt quarter[], Travel *w)
{
  PetscInt    *send;
  PetscMPIInt *next, *owner;
  uint64_t     key;

  PetscFunctionBeginUser;
  *w = (Travel){.leaves = t, .n = n};
  PetscCallMPI(MPI_Comm_size(t->comm, &w->size));
  PetscCall(PetscCalloc4(w->size, &w->ask, w->size, &w->asked, w->size + 1, &w->ask_at, w->size + 1, &w->asked_at));
  PetscCall(PetscMalloc1(n, &w->slot));
  PetscCall(PetscMalloc3(3 * n, &send, w->size, &next, n, &owner));
  for (PetscInt i = 0; i < n; i++) {
    owner[i] = owner_of(t, quarter + 3 * i, &key);
    w->ask[owner[i]] += 3;
  }
  PetscCallMPI(MPI_Alltoall(w->ask, 1, MPI_INT, w->asked, 1, MPI_INT, t->comm));
  for (PetscMPIInt r = 0; r < w->size; r++) {
    w->ask_at[r + 1]   = w->ask_at[r] + w->ask[r];
    w->asked_at[r + 1] = w->asked_at[r] + w->asked[r];
    next[r]            = w->ask_at[r] / 3;
  }
  for (PetscInt i = 0; i < n; i++) {
    w->slot[i] = next[owner[i]]++;
    PetscCall(PetscArraycpy(send + 3 * w->slot[i], quarter + 3 * i, 3));
  }
  w->nasked = w->asked_at[w->size] / 3;
  PetscCall(PetscMalloc1(3 * w->nasked, &w->place));
  PetscCallMPI(MPI_Alltoallv(send, w->ask, w->ask_at, MPIU_INT, w->place, w->asked, w->asked_at, MPIU_INT, t->comm));
  PetscCall(PetscFree3(send, next, owner));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* answer [nasked][bs] back to those who asked: out [n][bs] in their order */
static PetscErrorCode end_travel(Travel *w, PetscInt bs, const PetscReal answer[], PetscReal out[])
{
  PetscReal *got;

  PetscFunctionBeginUser;
  for (PetscMPIInt r = 0; r <= w->size; r++) {
    if (r < w->size) w->ask[r] = w->ask[r] / 3 * (PetscMPIInt)bs;
    if (r < w->size) w->asked[r] = w->asked[r] / 3 * (PetscMPIInt)bs;
    w->ask_at[r]   = w->ask_at[r] / 3 * (PetscMPIInt)bs;
    w->asked_at[r] = w->asked_at[r] / 3 * (PetscMPIInt)bs;
  }
  PetscCall(PetscMalloc1(w->n * bs, &got));
  PetscCallMPI(MPI_Alltoallv(answer, w->asked, w->asked_at, MPIU_REAL, got, w->ask, w->ask_at, MPIU_REAL, w->leaves->comm));
  for (PetscInt i = 0; i < w->n; i++) PetscCall(PetscArraycpy(out + i * bs, got + w->slot[i] * bs, bs));
  PetscCall(PetscFree(got));
  PetscCall(PetscFree(w->place));
  PetscCall(PetscFree(w->slot));
  PetscCall(PetscFree4(w->ask, w->asked, w->ask_at, w->asked_at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own cell at a place that this rank is asked about, and the place in it, -1 to 1 */
static PetscErrorCode find_place(const Leaves *t, const PetscInt quarter[3], PetscInt *cell, PetscReal xi[3])
{
  uint64_t    key;
  const Leaf *leaf;

  PetscFunctionBeginUser;
  (void)owner_of(t, quarter, &key);
  *cell = LeavesOwnBefore(t, key);
  leaf  = t->leaf + *cell;
  for (PetscInt d = 0; d < t->dim; d++) xi[d] = (PetscReal)(quarter[d] - 4 * leaf->x[d]) / (PetscReal)(2 * LeavesWidth(t, leaf->level)) - 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCarryNodes(Mesh old, Mesh now, PetscInt bs, const PetscReal v[], PetscReal w[])
{
  const MeshLocal *l = &old->loc, *m = &now->loc;
  PetscInt        *quarter;
  PetscReal       *answer;
  Travel           t;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(3 * m->nnode, &quarter));
  for (PetscInt i = 0; i < 3 * m->nnode; i++) quarter[i] = 2 * now->half[i];
  PetscCall(begin_travel(old->leaves, m->nnode, quarter, &t));
  PetscCall(PetscMalloc1(t.nasked * bs, &answer));
  for (PetscInt i = 0; i < t.nasked; i++) {
    PetscReal xi[3] = {0, 0, 0}, phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB], value[MESH_MAX_NB];
    PetscInt  c;

    PetscCall(find_place(old->leaves, t.place + 3 * i, &c, xi));
    ElementBasis(l->dim, xi, phi, dphi);
    for (PetscInt b = 0; b < bs; b++) {
      for (PetscInt j = 0; j < l->nb; j++) value[j] = v[l->cell_node[c * l->nb + j] * bs + b];
      MeshCellGather(l, c, 1, value);
      answer[i * bs + b] = 0;
      for (PetscInt j = 0; j < l->nb; j++) answer[i * bs + b] += phi[j] * value[j];
    }
  }
  PetscCall(end_travel(&t, bs, answer, w));
  PetscCall(MeshSyncNodes(now, bs, w));
  PetscCall(PetscFree(answer));
  PetscCall(PetscFree(quarter));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Samples of a cell are at xi = +-1/2 */
PetscErrorCode MeshCarryCells(Mesh old, Mesh now, const PetscReal p[], PetscReal q[])
{
  const MeshLocal *m   = &now->loc;
  const PetscInt   dim = m->dim, nk = dim + 1, ns = 1 << dim;
  PetscInt        *quarter;
  PetscReal       *answer, *sample;
  Travel           t;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(3 * ns * m->ncell, &quarter));
  PetscCall(PetscMalloc1(ns * m->ncell, &sample));
  for (PetscInt c = 0; c < m->ncell; c++) {
    const Leaf *leaf = now->leaves->leaf + c;

    for (PetscInt s = 0; s < ns; s++)
      for (PetscInt d = 0; d < dim; d++)
        quarter[3 * (c * ns + s) + d] = 4 * leaf->x[d] + ((s >> d) & 1 ? 3 : 1) * LeavesWidth(now->leaves, leaf->level);
  }
  PetscCall(begin_travel(old->leaves, ns * m->ncell, quarter, &t));
  PetscCall(PetscMalloc1(t.nasked, &answer));
  for (PetscInt i = 0; i < t.nasked; i++) {
    PetscReal xi[3];
    PetscInt  c;

    PetscCall(find_place(old->leaves, t.place + 3 * i, &c, xi));
    answer[i] = p[c * nk];
    for (PetscInt d = 0; d < dim; d++) answer[i] += p[c * nk + 1 + d] * xi[d];
  }
  PetscCall(end_travel(&t, 1, answer, sample));
  for (PetscInt c = 0; c < m->ncell; c++) {
    for (PetscInt k = 0; k < nk; k++) q[c * nk + k] = 0;
    for (PetscInt s = 0; s < ns; s++) {
      q[c * nk] += sample[c * ns + s] / ns;
      for (PetscInt d = 0; d < dim; d++) q[c * nk + 1 + d] += ((s >> d) & 1 ? 2 : -2) * sample[c * ns + s] / ns;
    }
  }
  PetscCall(PetscFree(answer));
  PetscCall(PetscFree(sample));
  PetscCall(PetscFree(quarter));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshRemesh(Mesh m, const MeshSurface *surface, Mesh *old)
{
  Mesh           now;
  struct _p_Mesh was = *m;

  PetscFunctionBeginUser;
  PetscCall(MeshCreateAround(m->comm, surface, &now));
  *m            = *now;
  *now          = was;
  m->loc.moves  = was.loc.moves + 1;
  m->loc.meshes = was.loc.meshes + 1;
  *old          = now;
  PetscFunctionReturn(PETSC_SUCCESS);
}
