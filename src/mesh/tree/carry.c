/* Carry: see mesh/carry.h. Places are in finest cells of the old mesh: exact, as they are quarters of it, where both
   meshes have the same lattice. Who has the old cell at a position is told by the ranks' first keys, without looking
   for the cell. */
#include "compat.h"
#include "mesh/carry.h"
#include "../impl.h"
#include "leaves.h"
#include "refined.h"
#include "base/sparse.h"
#include "fem/element.h"

#define CARRY_MAX 6 /* numbers a node, a symmetric tensor; fields at once */

/* n positions, wanted by this rank: those in its own old cells, and those that go to the owners of the old cells */
typedef struct {
  const Leaves *leaves;
  MPI_Comm      comm;
  PetscMPIInt   tag, *to, *from; /* [nfar] ascending, [nasked - nown] */
  PetscInt      nown, nfar, *own, *far;
  PetscInt      nasked;
  PetscReal (*position)[3]; /* [nasked] first the own ones, then what others want */
} Travel;

/* Owner of the old finest cell at a position; the upper end of the box belongs to the last one */
static PetscMPIInt owner_of(const Leaves *t, const PetscReal position[3], uint64_t *key)
{
  PetscInt x[3] = {0, 0, 0};

  for (PetscInt d = 0; d < t->dim; d++) x[d] = PetscMin((PetscInt)position[d], t->cells[d] - 1);
  *key = LeavesKey(t, x);
  return LeavesOwner(t, *key);
}

static PetscErrorCode begin_travel(const Leaves *t, PetscInt n, PetscReal (*position)[3], Travel *w)
{
  PetscReal(*send)[3], (*came)[3];
  PetscMPIInt rank, nfar;
  PetscInt    ncame;
  uint64_t    key;

  PetscFunctionBeginUser;
  *w = (Travel){.leaves = t};
  PetscCallMPI(MPI_Comm_rank(t->comm, &rank));
  PetscCall(PetscCommDuplicate(t->comm, &w->comm, &w->tag));
  PetscCall(PetscMalloc3(n, &w->own, n, &w->far, n, &w->to));
  for (PetscInt i = 0; i < n; i++) {
    const PetscMPIInt owner = owner_of(t, position[i], &key);

    if (owner == rank) w->own[w->nown++] = i;
    else {
      w->far[w->nfar]  = i;
      w->to[w->nfar++] = owner;
    }
  }
  PetscCall(PetscMPIIntCast(w->nfar, &nfar));
  PetscCall(PetscSortMPIIntWithIntArray(nfar, w->to, w->far));
  PetscCall(PetscMalloc1(w->nfar, &send));
  for (PetscInt i = 0; i < w->nfar; i++) PetscCall(PetscArraycpy(send[i], position[w->far[i]], 3));
  PetscCall(SparseExchange(w->comm, w->tag, w->nfar, w->to, sizeof(*send), send, &ncame, &came, &w->from));
  w->nasked = w->nown + ncame;
  PetscCall(PetscMalloc1(w->nasked, &w->position));
  for (PetscInt i = 0; i < w->nown; i++) PetscCall(PetscArraycpy(w->position[i], position[w->own[i]], 3));
  PetscCall(PetscArraycpy(w->position + w->nown, came, ncame));
  PetscCall(PetscFree(send));
  PetscCall(PetscFree(came));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The first of the far positions that go to a rank */
static PetscInt first_of(const Travel *w, PetscMPIInt rank)
{
  PetscInt low = 0, high = w->nfar;

  while (low < high) {
    const PetscInt middle = (low + high) / 2;

    if (w->to[middle] < rank) low = middle + 1;
    else high = middle;
  }
  return low;
}

/* answer [nasked][bs] back to those who asked: out [n][bs] in their order */
static PetscErrorCode end_travel(Travel *w, PetscInt bs, const PetscReal answer[], PetscReal out[])
{
  PetscMPIInt *who;
  PetscReal   *got;
  PetscInt     n, at = 0;

  PetscFunctionBeginUser;
  PetscCall(SparseExchange(w->comm, w->tag, w->nasked - w->nown, w->from, bs * sizeof(*out), answer + bs * w->nown, &n,
                           &got, &who));
  for (PetscInt i = 0; i < w->nown; i++) PetscCall(PetscArraycpy(out + bs * w->own[i], answer + bs * i, bs));
  for (PetscInt i = 0; i < n; i++) { /* of a rank in the order in which it was asked */
    at = !i || who[i] != who[i - 1] ? first_of(w, who[i]) : at + 1;
    PetscCall(PetscArraycpy(out + bs * w->far[at], got + bs * i, bs));
  }
  PetscCall(PetscFree(got));
  PetscCall(PetscFree(who));
  PetscCall(PetscFree(w->from));
  PetscCall(PetscFree(w->position));
  PetscCall(PetscFree3(w->own, w->far, w->to));
  PetscCall(PetscCommDestroy(&w->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own cell at a position that this rank is asked about, looked for from the last one on, and the position in it, -1 to
   1 */
static void find_cell_at(const Leaves *t, const PetscReal position[3], PetscInt *cell, PetscReal xi[3])
{
  PetscInt    x[3] = {0, 0, 0};
  const Leaf *leaf;

  for (PetscInt d = 0; d < t->dim; d++) x[d] = PetscMin((PetscInt)position[d], t->cells[d] - 1);
  if (*cell < 0 || !LeavesContain(t, t->leaf + *cell, x)) *cell = LeavesOwnBefore(t, LeavesKey(t, x));
  leaf = t->leaf + *cell;
  for (PetscInt d = 0; d < t->dim; d++)
    xi[d] = 2 * (position[d] - (PetscReal)leaf->x[d]) / (PetscReal)LeavesWidth(t, leaf->level) - 1;
}

/* Places of the new lattice, n counts of 1/parts of its finest cells, in those of the old one */
static void convert_positions(const Leaves *now, const Leaves *old, PetscInt divisions, PetscInt n,
                              const PetscInt count[], PetscReal (*position)[3])
{
  for (PetscInt i = 0; i < n; i++) {
    for (PetscInt d = 0; d < 3; d++)
      position[i][d] = d < now->dim
                       ? (PetscReal)count[3 * i + d] * (PetscReal)old->cells[d] / (PetscReal)(divisions * now->cells[d])
                       : 0;
  }
}

/* Where the old field is asked for on behalf of each new node, in quarters of finest cells of the new lattice */
typedef struct {
  PetscInt   n, *start, *count; /* start [nnode + 1], count [n][3] */
  PetscReal *weight;            /* [n] */
} Samples;

/* What new nodes and cells keep of an old mesh with the same lattice. A node keeps its value where one of the largest
   cells around it was there before with the same positions that hang: along its edges and faces the old field is the
   quadratic of that cell, which interpolation and Simpson's rule on its halves both give back. One sample is enough
   where one of the largest cells lay in an old cell. */
typedef struct {
  PetscInt  *cell;    /* [ncell] old own cell that holds this one, or -1: there is none on this rank, or smaller ones */
  PetscInt  *node;    /* [nnode] old node whose value this one keeps, or -1 */
  PetscInt  *largest; /* [nnode_all] side of the largest cell around a node, in finest cells */
  PetscBool *inside;  /* [nnode] one of the largest cells lay in an old one */
} Kept;

/* Sides of cells from twice their middle, an odd multiple of it */
static void measure_around(Mesh now, PetscInt largest[])
{
  const MeshLocal *l = &now->loc;

  for (PetscInt c = 0; c < l->ncell_all; c++) {
    const PetscInt *node = l->cell_node + c * l->nb, middle = now->half[3 * node[l->nb / 2]];

    for (PetscInt j = 0; j < l->nb; j++) largest[node[j]] = PetscMax(largest[node[j]], middle & -middle);
  }
}

/* Own cells of both meshes ascend along the curve: one merge, no search */
static void match_cells(const Leaves *now, const Leaves *old, PetscInt cell[])
{
  PetscBool same = PETSC_TRUE;
  PetscInt  k    = 0;

  for (PetscInt d = 0; d < now->dim; d++) same = (PetscBool)(same && now->cells[d] == old->cells[d]);
  for (PetscInt c = 0; c < now->nleaf; c++) {
    const Leaf *leaf = now->leaf + c;

    cell[c] = -1;
    if (!same) continue;
    while (k + 1 < old->nleaf && old->leaf[k + 1].key <= leaf->key) k++;
    if (old->leaf[k].level <= leaf->level && LeavesContain(old, old->leaf + k, leaf->x)) cell[c] = k;
  }
}

static PetscErrorCode find_kept(Mesh old, Mesh now, Kept *kept)
{
  const MeshLocal *l = &now->loc, *m = &old->loc;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(l->ncell, &kept->cell, l->nnode, &kept->node, l->nnode, &kept->inside));
  PetscCall(PetscCalloc1(l->nnode_all, &kept->largest));
  measure_around(now, kept->largest);
  match_cells(now->leaves, old->leaves, kept->cell);
  for (PetscInt i = 0; i < l->nnode; i++) {
    kept->node[i]   = -1;
    kept->inside[i] = PETSC_FALSE;
  }
  for (PetscInt c = 0; c < l->ncell; c++) {
    const PetscInt k = kept->cell[c], *node = l->cell_node + c * l->nb,
                   width = LeavesWidth(now->leaves, now->leaves->leaf[c].level);
    const MeshHang *h = MeshCellHang(l, c), *g = k >= 0 ? MeshCellHang(m, k) : NULL;
    const PetscBool alike = (PetscBool)(k >= 0 && old->leaves->leaf[k].level == now->leaves->leaf[c].level &&
                                        !h == !g && (!h || h->code == g->code));

    for (PetscInt j = 0; j < l->nb && k >= 0; j++) {
      if (node[j] >= l->nnode || kept->largest[node[j]] != width) continue;
      kept->inside[node[j]] = PETSC_TRUE;
      if (alike) kept->node[node[j]] = m->cell_node[k * l->nb + j];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_kept(Kept *kept)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree3(kept->cell, kept->node, kept->inside));
  PetscCall(PetscFree(kept->largest));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Axes along which a node is the middle of its largest cells, if those may have been smaller ones before: bits */
static PetscInt middle_axes(Mesh old, Mesh now, PetscInt node, PetscInt width)
{
  const MeshLocal *l    = &now->loc;
  PetscInt         axes = 0;

  if (width * old->leaves->cells[0] <= now->leaves->cells[0]) return 0;
  for (PetscInt d = 0; d < l->dim; d++) axes |= (now->half[3 * node + d] & width ? 1 : 0) << d;
  return axes;
}

/* The value at a middle that keeps the integral along an edge, by Simpson's rule on its two halves before: the weights
   of five positions; along every axis of a face or a cell of which the node is the middle */
static void add_samples(PetscInt axes, PetscInt width, const PetscInt half[3], PetscInt *n, Samples *s)
{
  static const PetscReal weight[5] = {-0.125, 0.5, 0.25, 0.5, -0.125};
  PetscInt               from[3], to[3];

  for (PetscInt d = 0; d < 3; d++) {
    from[d] = (axes >> d) & 1 ? 0 : 2;
    to[d]   = (axes >> d) & 1 ? 5 : 3;
  }
  if (!s->count) {
    *n += (to[0] - from[0]) * (to[1] - from[1]) * (to[2] - from[2]);
    return;
  }
  for (PetscInt k = from[2]; k < to[2]; k++)
    for (PetscInt j = from[1]; j < to[1]; j++)
      for (PetscInt i = from[0]; i < to[0]; i++, (*n)++) {
        const PetscInt at[3] = {i, j, k};

        s->weight[*n] = 1;
        for (PetscInt d = 0; d < 3; d++) {
          s->count[3 * *n + d] = 2 * half[d] + (at[d] - 2) * width;
          if ((axes >> d) & 1) s->weight[*n] *= weight[at[d]];
        }
      }
}

static PetscErrorCode list_samples(Mesh old, Mesh now, PetscBool conserve, const Kept *kept, Samples *s)
{
  const MeshLocal *l = &now->loc;

  PetscFunctionBeginUser;
  *s = (Samples){0};
  PetscCall(PetscMalloc1(l->nnode + 1, &s->start));
  for (PetscInt pass = 0; pass < 2; pass++) {
    PetscInt n = 0;

    for (PetscInt i = 0; i < l->nnode; i++) {
      const PetscInt width = kept->largest[i],
                     axes  = conserve && !kept->inside[i] ? middle_axes(old, now, i, width) : 0;

      s->start[i] = n;
      if (kept->node[i] < 0) add_samples(axes, width, now->half + 3 * i, &n, s);
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

/* The functions of a cell that are not zero at xi, which is mostly a node or a quarter point: slots, values */
static PetscInt list_functions(PetscInt dim, const PetscReal xi[], PetscInt slot[], PetscReal phi[])
{
  PetscReal v[3][3] = {{0}, {0}, {1}}, dv[3];
  PetscInt  n       = 0;

  for (PetscInt d = 0; d < dim; d++) ElementLine(xi[d], v[d], dv);
  for (PetscInt j = 0; j < (dim == 2 ? 9 : 27); j++) {
    phi[n] = v[0][j % 3] * v[1][j / 3 % 3] * v[2][j / 9];
    if (phi[n] == 0) continue;
    slot[n++] = j;
  }
  return n;
}

/* Of `count` old fields v [nnode_all][bs]: values [nasked][count][bs] at the positions that this rank is
   asked about */
static void evaluate_positions(Mesh old, const Travel *t, PetscInt count, PetscInt bs, const PetscReal *const v[],
                               PetscReal answer[])
{
  const MeshLocal *l = &old->loc;
  PetscReal        value[CARRY_MAX][MESH_MAX_NB * CARRY_MAX];
  PetscInt         c = -1;

  for (PetscInt i = 0; i < t->nasked; i++) {
    const PetscInt last = c, *node;
    PetscReal      xi[3], phi[MESH_MAX_NB];
    PetscInt       slot[MESH_MAX_NB], n;
    PetscBool      hangs;

    find_cell_at(old->leaves, t->position[i], &c, xi);
    n     = list_functions(l->dim, xi, slot, phi);
    node  = l->cell_node + c * l->nb;
    hangs = (PetscBool)(MeshCellHang(l, c) != NULL);
    for (PetscInt f = 0; f < count; f++) {
      PetscReal *out = answer + (i * count + f) * bs;

      for (PetscInt e = 0; e < l->nb * bs && hangs && c != last; e++) value[f][e] = v[f][node[e / bs] * bs + e % bs];
      if (hangs && c != last) MeshCellGather(l, c, bs, value[f]);
      for (PetscInt b = 0; b < bs; b++) out[b] = 0;
      for (PetscInt j = 0; j < n; j++) {
        const PetscReal *from = hangs ? value[f] + slot[j] * bs : v[f] + node[slot[j]] * bs;

        for (PetscInt b = 0; b < bs; b++) out[b] += phi[j] * from[b];
      }
    }
  }
}

static PetscErrorCode carry(Mesh old, Mesh now, PetscBool conserve, PetscInt count, PetscInt bs,
                            const PetscReal *const v[], PetscReal *const w[])
{
  const MeshLocal *m = &now->loc;
  PetscReal       *answer, *sample, (*position)[3];
  const PetscInt   width = count * bs;
  Samples          s;
  Travel           t;
  Kept             kept;

  PetscFunctionBeginUser;
  PetscCheck(bs <= CARRY_MAX, PETSC_COMM_SELF, PETSC_ERR_PLIB,
             "%" PetscInt_FMT " numbers a node are carried, at most %d are", bs, CARRY_MAX);
  PetscCall(find_kept(old, now, &kept));
  PetscCall(list_samples(old, now, conserve, &kept, &s));
  PetscCall(PetscMalloc2(s.n, &position, width * s.n, &sample));
  convert_positions(now->leaves, old->leaves, 4, s.n, s.count, position);
  PetscCall(begin_travel(old->leaves, s.n, position, &t));
  PetscCall(PetscMalloc1(t.nasked * width, &answer));
  evaluate_positions(old, &t, count, bs, v, answer);
  PetscCall(end_travel(&t, width, answer, sample));
  for (PetscInt f = 0; f < count; f++) {
    for (PetscInt i = 0; i < m->nnode; i++)
      for (PetscInt b = 0; b < bs; b++) {
        w[f][i * bs + b] = kept.node[i] >= 0 ? v[f][kept.node[i] * bs + b] : 0;
        for (PetscInt e = s.start[i]; e < s.start[i + 1]; e++)
          w[f][i * bs + b] += s.weight[e] * sample[e * width + f * bs + b];
      }
    PetscCall(MeshSyncNodes(now, bs, w[f]));
  }
  PetscCall(PetscFree(answer));
  PetscCall(PetscFree2(position, sample));
  PetscCall(destroy_samples(&s));
  PetscCall(destroy_kept(&kept));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCarryNodes(Mesh old, Mesh now, PetscInt bs, const PetscReal v[], PetscReal w[])
{
  PetscFunctionBeginUser;
  PetscCall(carry(old, now, PETSC_FALSE, 1, bs, &v, &w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCarryVelocities(Mesh old, Mesh now, PetscInt count, const PetscReal *const v[], PetscReal *const w[])
{
  const PetscReal *from[CARRY_MAX];
  PetscReal       *to[CARRY_MAX];
  PetscInt         n = 0;

  PetscFunctionBeginUser;
  for (PetscInt f = 0; f < count; f++) {
    if (!v[f]) continue;
    from[n] = v[f];
    to[n++] = w[f];
  }
  PetscCall(carry(old, now, PETSC_TRUE, n, now->loc.dim, from, to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Samples, at xi = +-1/2 of a cell, are asked for where it was not there before */
PetscErrorCode MeshCarryCells(Mesh old, Mesh now, const PetscReal p[], PetscReal q[])
{
  const MeshLocal *m   = &now->loc;
  const PetscInt   dim = m->dim, nk = dim + 1, ns = 1 << dim;
  PetscInt        *quarter, *cell, n = 0, last = -1;
  PetscReal       *answer, *sample, (*position)[3];
  Travel           t;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(m->ncell, &cell));
  match_cells(now->leaves, old->leaves, cell);
  for (PetscInt c = 0; c < m->ncell; c++) {
    if (cell[c] >= 0 && old->leaves->leaf[cell[c]].level != now->leaves->leaf[c].level) cell[c] = -1;
    n += cell[c] < 0;
  }
  PetscCall(PetscCalloc1(3 * ns * n, &quarter));
  PetscCall(PetscMalloc2(ns * n, &sample, ns * n, &position));
  for (PetscInt c = 0, at = 0; c < m->ncell; c++) {
    const Leaf *leaf = now->leaves->leaf + c;

    for (PetscInt s = 0; s < ns && cell[c] < 0; s++, at++)
      for (PetscInt d = 0; d < dim; d++)
        quarter[3 * at + d] = 4 * leaf->x[d] + ((s >> d) & 1 ? 3 : 1) * LeavesWidth(now->leaves, leaf->level);
  }
  convert_positions(now->leaves, old->leaves, 4, ns * n, quarter, position);
  PetscCall(begin_travel(old->leaves, ns * n, position, &t));
  PetscCall(PetscMalloc1(t.nasked, &answer));
  for (PetscInt i = 0; i < t.nasked; i++) {
    PetscReal xi[3];

    find_cell_at(old->leaves, t.position[i], &last, xi);
    answer[i] = p[last * nk];
    for (PetscInt d = 0; d < dim; d++) answer[i] += p[last * nk + 1 + d] * xi[d];
  }
  PetscCall(end_travel(&t, 1, answer, sample));
  for (PetscInt c = 0, at = 0; c < m->ncell; c++) {
    for (PetscInt k = 0; k < nk; k++) q[c * nk + k] = cell[c] >= 0 ? p[cell[c] * nk + k] : 0;
    for (PetscInt s = 0; s < ns && cell[c] < 0; s++, at++) {
      q[c * nk] += sample[at] / ns;
      for (PetscInt d = 0; d < dim; d++) q[c * nk + 1 + d] += ((s >> d) & 1 ? 2 : -2) * sample[at] / ns;
    }
  }
  PetscCall(PetscFree(answer));
  PetscCall(PetscFree2(sample, position));
  PetscCall(PetscFree(quarter));
  PetscCall(PetscFree(cell));
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

static const char *const AXIS[] = {"x", "y", "z"};

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
    PetscCall(StateCells(s, d < t->dim ? AXIS[d] : "level", 1, v));
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
  LeavesRange(total, size, rank, &n, &start);
  PetscCall(PetscMalloc1(n, &v));
  PetscCall(PetscCalloc1(n, leaf));
  for (PetscInt d = 0; d <= t->dim; d++) {
    PetscCall(StateRows(look, d < t->dim ? AXIS[d] : "level", PETSC_FALSE, n, v));
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
