/* Carry: see mesh/carry.h. Places are in finest cells of the old mesh: exact, as they are quarters of it, where both
   meshes have the same lattice. Who has the old cell at a place is told by the ranks' first keys, without looking for
   the cell. */
#include "compat.h"
#include "mesh/carry.h"
#include "impl.h"
#include "leaves.h"
#include "refined.h"
#include "mesh/element.h"

/* n places, wanted by this rank, on their way to the owners of the old cells there */
typedef struct {
  const Leaves *leaves;
  PetscMPIInt   size, *ask, *asked, *ask_at, *asked_at;
  PetscInt      n, nasked, *slot; /* slot [n]: where place i stands among those sent */
  PetscReal    *place;            /* [nasked][3] what others want */
} Travel;

/* Owner of the old finest cell at a place; the upper end of the box belongs to the last one */
static PetscMPIInt owner_of(const Leaves *t, const PetscReal place[3], uint64_t *key)
{
  PetscInt x[3] = {0, 0, 0};

  for (PetscInt d = 0; d < t->dim; d++) x[d] = PetscMin((PetscInt)place[d], t->cells[d] - 1);
  *key = LeavesKey(t, x);
  return LeavesOwner(t, *key);
}

static PetscErrorCode begin_travel(const Leaves *t, PetscInt n, const PetscReal place[], Travel *w)
{
  PetscReal   *send;
  PetscMPIInt *next, *owner;
  uint64_t     key;

  PetscFunctionBeginUser;
  *w = (Travel){.leaves = t, .n = n};
  PetscCallMPI(MPI_Comm_size(t->comm, &w->size));
  PetscCall(PetscCalloc4(w->size, &w->ask, w->size, &w->asked, w->size + 1, &w->ask_at, w->size + 1, &w->asked_at));
  PetscCall(PetscMalloc1(n, &w->slot));
  PetscCall(PetscMalloc3(3 * n, &send, w->size, &next, n, &owner));
  for (PetscInt i = 0; i < n; i++) {
    owner[i] = owner_of(t, place + 3 * i, &key);
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
    PetscCall(PetscArraycpy(send + 3 * w->slot[i], place + 3 * i, 3));
  }
  w->nasked = w->asked_at[w->size] / 3;
  PetscCall(PetscMalloc1(3 * w->nasked, &w->place));
  PetscCallMPI(MPI_Alltoallv(send, w->ask, w->ask_at, MPIU_REAL, w->place, w->asked, w->asked_at, MPIU_REAL, t->comm));
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
static void find_place(const Leaves *t, const PetscReal place[3], PetscInt *cell, PetscReal xi[3])
{
  uint64_t    key;
  const Leaf *leaf;

  (void)owner_of(t, place, &key);
  *cell = LeavesOwnBefore(t, key);
  leaf  = t->leaf + *cell;
  for (PetscInt d = 0; d < t->dim; d++) xi[d] = 2 * (place[d] - (PetscReal)leaf->x[d]) / (PetscReal)LeavesWidth(t, leaf->level) - 1;
}

/* Places of the new lattice, n counts of 1/parts of its finest cells, in those of the old one */
static void convert_places(const Leaves *now, const Leaves *old, PetscInt parts, PetscInt n, const PetscInt count[], PetscReal place[])
{
  for (PetscInt i = 0; i < n; i++) {
    for (PetscInt d = 0; d < 3; d++)
      place[3 * i + d] = d < now->dim ? (PetscReal)count[3 * i + d] * (PetscReal)old->cells[d] / (PetscReal)(parts * now->cells[d]) : 0;
  }
}

/* Where the old field is asked for on behalf of each new node, in quarters of finest cells of the new lattice */
typedef struct {
  PetscInt   n, *start, *count; /* start [nnode + 1], count [n][3] */
  PetscReal *weight;            /* [n] */
} Samples;

/* Side, in finest cells, of the largest cell around a node: twice its middle is an odd multiple of it */
static PetscInt largest_width(const MeshLocal *l, const PetscInt half[], PetscInt node)
{
  PetscInt width = 1;

  for (PetscInt e = l->node_cell_ptr[node]; e < l->node_cell_ptr[node + 1]; e++) {
    const PetscInt middle = half[3 * l->cell_node[l->node_cell[e] * l->nb + l->nb / 2]];

    width = PetscMax(width, middle & -middle);
  }
  return width;
}

/* Axes along which a node is the middle of its largest cells, if those may have been smaller ones before: bits */
static PetscInt middle_axes(Mesh old, Mesh now, PetscInt node, PetscInt *width)
{
  const MeshLocal *l    = &now->loc;
  PetscInt         axes = 0;

  *width = largest_width(l, now->half, node);
  if (*width * old->leaves->cells[0] <= now->leaves->cells[0]) return 0;
  for (PetscInt d = 0; d < l->dim; d++) axes |= (now->half[3 * node + d] & *width ? 1 : 0) << d;
  return axes;
}

/* The value at a middle that keeps the integral along an edge, by Simpson's rule on its two halves before: the weights
   of five places; along every axis of a face or a cell of which the node is the middle */
static void add_samples(PetscInt dim, PetscInt axes, PetscInt width, const PetscInt half[3], PetscInt *n, Samples *s)
{
  static const PetscReal weight[5] = {-0.125, 0.5, 0.25, 0.5, -0.125};

  for (PetscInt i = 0; i < (dim == 2 ? 25 : 125); i++) {
    const PetscInt at[3] = {i % 5, i / 5 % 5, i / 25};
    PetscBool      apart = PETSC_FALSE;

    for (PetscInt d = 0; d < dim; d++) apart = (PetscBool)(apart || (!((axes >> d) & 1) && at[d] != 2));
    if (apart) continue;
    if (s->count) {
      s->weight[*n] = 1;
      for (PetscInt d = 0; d < 3; d++) {
        s->count[3 * *n + d] = 2 * half[d];
        if (d >= dim || !((axes >> d) & 1)) continue;
        s->count[3 * *n + d] += (at[d] - 2) * width;
        s->weight[*n] *= weight[at[d]];
      }
    }
    (*n)++;
  }
}

static PetscErrorCode list_samples(Mesh old, Mesh now, PetscBool conserve, Samples *s)
{
  const MeshLocal *l = &now->loc;

  PetscFunctionBeginUser;
  *s = (Samples){0};
  PetscCall(PetscMalloc1(l->nnode + 1, &s->start));
  for (PetscInt pass = 0; pass < 2; pass++) {
    PetscInt n = 0;

    for (PetscInt i = 0; i < l->nnode; i++) {
      PetscInt       width = 0;
      const PetscInt axes  = conserve ? middle_axes(old, now, i, &width) : 0;

      s->start[i] = n;
      add_samples(l->dim, axes, width, now->half + 3 * i, &n, s);
    }
    s->start[l->nnode] = s->n = n;
    if (!pass) PetscCall(PetscMalloc2(3 * n, &s->count, n, &s->weight));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_samples(Samples *s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(s->start));
  PetscCall(PetscFree2(s->count, s->weight));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Old values [nasked][bs] at the places that this rank is asked about */
static void evaluate_places(Mesh old, const Travel *t, PetscInt bs, const PetscReal v[], PetscReal answer[])
{
  const MeshLocal *l = &old->loc;

  for (PetscInt i = 0; i < t->nasked; i++) {
    PetscReal xi[3] = {0, 0, 0}, phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB], value[MESH_MAX_NB];
    PetscInt  c;

    find_place(old->leaves, t->place + 3 * i, &c, xi);
    ElementBasis(l->dim, xi, phi, dphi);
    for (PetscInt b = 0; b < bs; b++) {
      for (PetscInt j = 0; j < l->nb; j++) value[j] = v[l->cell_node[c * l->nb + j] * bs + b];
      MeshCellGather(l, c, 1, value);
      answer[i * bs + b] = 0;
      for (PetscInt j = 0; j < l->nb; j++) answer[i * bs + b] += phi[j] * value[j];
    }
  }
}

static PetscErrorCode carry(Mesh old, Mesh now, PetscBool conserve, PetscInt bs, const PetscReal v[], PetscReal w[])
{
  const MeshLocal *m = &now->loc;
  PetscReal       *answer, *place, *sample;
  Samples          s;
  Travel           t;

  PetscFunctionBeginUser;
  PetscCall(list_samples(old, now, conserve, &s));
  PetscCall(PetscMalloc2(3 * s.n, &place, bs * s.n, &sample));
  convert_places(now->leaves, old->leaves, 4, s.n, s.count, place);
  PetscCall(begin_travel(old->leaves, s.n, place, &t));
  PetscCall(PetscMalloc1(t.nasked * bs, &answer));
  evaluate_places(old, &t, bs, v, answer);
  PetscCall(end_travel(&t, bs, answer, sample));
  for (PetscInt i = 0; i < m->nnode; i++) {
    for (PetscInt b = 0; b < bs; b++) {
      w[i * bs + b] = 0;
      for (PetscInt e = s.start[i]; e < s.start[i + 1]; e++) w[i * bs + b] += s.weight[e] * sample[e * bs + b];
    }
  }
  PetscCall(MeshSyncNodes(now, bs, w));
  PetscCall(PetscFree(answer));
  PetscCall(PetscFree2(place, sample));
  PetscCall(destroy_samples(&s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCarryNodes(Mesh old, Mesh now, PetscInt bs, const PetscReal v[], PetscReal w[])
{
  PetscFunctionBeginUser;
  PetscCall(carry(old, now, PETSC_FALSE, bs, v, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCarryVelocity(Mesh old, Mesh now, const PetscReal v[], PetscReal w[])
{
  PetscFunctionBeginUser;
  PetscCall(carry(old, now, PETSC_TRUE, now->loc.dim, v, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Samples of a cell are at xi = +-1/2 */
PetscErrorCode MeshCarryCells(Mesh old, Mesh now, const PetscReal p[], PetscReal q[])
{
  const MeshLocal *m   = &now->loc;
  const PetscInt   dim = m->dim, nk = dim + 1, ns = 1 << dim;
  PetscInt        *quarter;
  PetscReal       *answer, *sample, *place;
  Travel           t;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(3 * ns * m->ncell, &quarter));
  PetscCall(PetscMalloc2(ns * m->ncell, &sample, 3 * ns * m->ncell, &place));
  for (PetscInt c = 0; c < m->ncell; c++) {
    const Leaf *leaf = now->leaves->leaf + c;

    for (PetscInt s = 0; s < ns; s++)
      for (PetscInt d = 0; d < dim; d++)
        quarter[3 * (c * ns + s) + d] = 4 * leaf->x[d] + ((s >> d) & 1 ? 3 : 1) * LeavesWidth(now->leaves, leaf->level);
  }
  convert_places(now->leaves, old->leaves, 4, ns * m->ncell, quarter, place);
  PetscCall(begin_travel(old->leaves, ns * m->ncell, place, &t));
  PetscCall(PetscMalloc1(t.nasked, &answer));
  for (PetscInt i = 0; i < t.nasked; i++) {
    PetscReal xi[3];
    PetscInt  c;

    find_place(old->leaves, t.place + 3 * i, &c, xi);
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
  PetscCall(PetscFree2(sample, place));
  PetscCall(PetscFree(quarter));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshReplace(Mesh m, Mesh now)
{
  const struct _p_Mesh was = *m;

  PetscFunctionBeginUser;
  *m            = *now;
  *now          = was;
  m->loc.moves  = was.loc.moves + 1;
  m->loc.meshes = was.loc.meshes + 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshRemesh(Mesh m, const MeshSurface *surface, Mesh *old)
{
  PetscFunctionBeginUser;
  PetscCall(MeshCreateAround(m->comm, surface, old));
  PetscCall(MeshReplace(m, *old));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshIsAround(Mesh m, const MeshSurface *surface, PetscBool *same)
{
  PetscInt  levels;
  PetscBool around;
  MeshKind  kind;
  Leaves    leaves;

  PetscFunctionBeginUser;
  *same = PETSC_FALSE;
  PetscCall(MeshReadLevels(&levels, &around));
  if (!levels || !m->leaves) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MeshKindReadBox(m->comm, &kind));
  PetscCall(LeavesCreate(m->comm, kind, levels, surface, &leaves));
  PetscCall(LeavesAreSame(m->leaves, &leaves, same));
  PetscCall(LeavesDestroy(&leaves));
  PetscCall(MeshKindDestroy(&kind));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- trees in checkpoints ---- */

static const char *const PLACE[] = {"x", "y", "z"};

PetscErrorCode MeshVisitTree(void *mesh, State s)
{
  const Mesh    m = (Mesh)mesh;
  const Leaves *t = m->leaves;
  PetscReal    *v;
  PetscInt      cells[3] = {1, 1, 1}, levels;

  PetscFunctionBeginUser;
  if (!t || StateIsLoading(s)) PetscFunctionReturn(PETSC_SUCCESS);
  levels = t->levels;
  PetscCall(PetscArraycpy(cells, t->n, t->dim));
  PetscCall(StateInts(s, "levels", 1, &levels));
  PetscCall(StateInts(s, "cells", 3, cells));
  PetscCall(PetscMalloc1(t->nleaf, &v));
  for (PetscInt d = 0; d <= t->dim; d++) {
    for (PetscInt i = 0; i < t->nleaf; i++) v[i] = (PetscReal)(d < t->dim ? t->leaf[i].x[d] : t->leaf[i].level);
    PetscCall(StateCells(s, d < t->dim ? PLACE[d] : "level", 1, v));
  }
  PetscCall(PetscFree(v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* This rank's share of the leaves of the file: leaf, to be freed */
static PetscErrorCode load_leaves(const Leaves *t, State look, PetscInt total, Leaf **leaf)
{
  PetscMPIInt size, rank;
  PetscInt    n, start;
  PetscReal  *v;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(t->comm, &size));
  PetscCallMPI(MPI_Comm_rank(t->comm, &rank));
  LeavesShare(total, size, rank, &n, &start);
  PetscCall(PetscMalloc1(n, &v));
  PetscCall(PetscCalloc1(n, leaf));
  for (PetscInt d = 0; d <= t->dim; d++) {
    PetscCall(StateRows(look, d < t->dim ? PLACE[d] : "level", PETSC_FALSE, n, v));
    for (PetscInt i = 0; i < n; i++) *(d < t->dim ? &(*leaf)[i].x[d] : &(*leaf)[i].level) = (PetscInt)v[i];
  }
  PetscCall(PetscFree(v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshRestore(Mesh m, State look, Mesh *old)
{
  PetscInt  n, cells[3], levels, space;
  PetscBool same;
  Leaf     *leaf;
  Mesh      now;

  PetscFunctionBeginUser;
  *old = NULL;
  PetscCall(StateGetSize(look, "level", &n));
  PetscCall(StateGetSize(look, "z", &space));
  if (n < 0 || !m->leaves || (space >= 0) != (m->loc.dim == 3)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(StateInts(look, "levels", 1, &levels));
  PetscCall(StateInts(look, "cells", 3, cells));
  PetscCall(load_leaves(m->leaves, look, n, &leaf));
  PetscCall(MeshCreateOf(m->comm, cells, levels, n, leaf, &now));
  PetscCall(PetscFree(leaf));
  PetscCall(LeavesAreSame(m->leaves, now->leaves, &same));
  if (same) {
    PetscCall(MeshDestroy(&now));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(MeshReplace(m, now));
  *old = now;
  PetscFunctionReturn(PETSC_SUCCESS);
}
