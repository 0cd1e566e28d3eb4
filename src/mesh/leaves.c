/* Leaves: see leaves.h. */
#include "compat.h"
#include "leaves.h"
#include "numbers.h"
#include "kindimpl.h"
#include "marks.h"
#include "base/opt.h"

#define MAX_LATTICE (1 << 20)
#define BAND_PLANE  2.2 /* from here on levels are balanced by themselves */
#define BAND_SPACE  2.6
#define BOXES       8 /* around the base cells of a rank */
/* base cells from the own ones within which the formula is asked: LEAVES_AROUND, half of the one that holds the place,
   one more for a narrow band */
#define FAR     (LEAVES_AROUND + 2)
#define CLOSURE 3 /* and within which a marked cell may have others refined */

/* ---- the curve ---- */

/* Bits of x spread to every second (third) place */
static uint64_t spread(PetscInt dim, uint64_t x)
{
  if (dim == 2) {
    x = (x | x << 16) & 0x0000FFFF0000FFFFu;
    x = (x | x << 8) & 0x00FF00FF00FF00FFu;
    x = (x | x << 4) & 0x0F0F0F0F0F0F0F0Fu;
    x = (x | x << 2) & 0x3333333333333333u;
    return (x | x << 1) & 0x5555555555555555u;
  }
  x = (x | x << 32) & 0x001F00000000FFFFu;
  x = (x | x << 16) & 0x001F0000FF0000FFu;
  x = (x | x << 8) & 0x100F00F00F00F00Fu;
  x = (x | x << 4) & 0x10C30C30C30C30C3u;
  return (x | x << 2) & 0x1249249249249249u;
}

static uint64_t curve_key(PetscInt dim, const PetscInt x[])
{
  uint64_t key = 0;

  for (PetscInt d = 0; d < dim; d++) key |= spread(dim, (uint64_t)x[d]) << d;
  return key;
}

PetscErrorCode LeavesPlace(const Leaves *t, const PetscInt half[], PetscReal x[])
{
  const MeshKind k = t->kind;
  PetscReal      q[3];

  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < t->dim; d++)
    q[d] = half[d] == 2 * t->cells[d] ? k->upper[d] : k->lower[d] + (k->upper[d] - k->lower[d]) * (PetscReal)half[d] / (PetscReal)(2 * t->cells[d]);
  PetscCall(MeshKindEvaluate(k, q, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the formula ---- */

/* Centre and longest side of a cell */
static PetscErrorCode measure(const Leaves *t, PetscInt level, const PetscInt x[], PetscReal centre[3], PetscReal *h)
{
  PetscInt  half[2][3];
  PetscReal end[2][3];

  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < t->dim; d++) {
    half[0][d] = 2 * x[d];
    half[1][d] = 2 * (x[d] + LeavesWidth(t, level));
  }
  for (PetscInt i = 0; i < 2; i++) PetscCall(LeavesPlace(t, half[i], end[i]));
  *h        = 0;
  centre[2] = 0;
  for (PetscInt d = 0; d < t->dim; d++) {
    centre[d] = 0.5 * (end[0][d] + end[1][d]);
    *h        = PetscMax(*h, end[1][d] - end[0][d]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool LeavesWrap(const Leaves *t, PetscInt x[])
{
  for (PetscInt d = 0; d < t->dim; d++) {
    if (t->periodic[d]) x[d] = (x[d] + t->cells[d]) % t->cells[d];
    else if (x[d] < 0 || x[d] >= t->cells[d]) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

static PetscErrorCode surface_refines(Leaves *t, PetscInt level, const PetscInt x[], PetscBool *refine);

/* Would a cell of the next level that touches a child of this one be refined? */
static PetscErrorCode neighbours_refine(Leaves *t, PetscInt level, const PetscInt x[], PetscBool *refine)
{
  const PetscInt w = LeavesWidth(t, level + 1), n = t->dim == 2 ? 16 : 64;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n && !*refine; i++) {
    PetscInt y[3] = {0, 0, 0};

    for (PetscInt d = 0; d < t->dim; d++) y[d] = x[d] + w * (((i >> (2 * d)) & 3) - 1);
    if (LeavesWrap(t, y)) PetscCall(surface_refines(t, level + 1, y, refine));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of x to what is to be finer than a level, but for boxes; beyond reach any larger number */
static PetscErrorCode find_distance(Leaves *t, PetscInt level, const PetscReal x[3], PetscReal reach, PetscReal *d)
{
  PetscReal more = t->constant;

  PetscFunctionBeginUser;
  *d = PETSC_MAX_REAL;
  if (t->around && t->surface->distance && level < t->levels - t->surface->coarser)
    PetscCall((*t->surface->distance)(t->surface->context, x, reach, d));
  if (!t->given) PetscFunctionReturn(PETSC_SUCCESS);
  if (t->distance) PetscCall(ExprEvaluateAlone(t->distance, x, &more));
  *d = PetscMin(*d, PetscMax(more, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* With a narrow band, how far from a surface a cell of size h may be refined because of finer ones beside it */
static PetscReal narrow_reach(const Leaves *t, PetscReal h)
{
  return t->band < (t->dim == 2 ? BAND_PLANE : BAND_SPACE) ? (1.5 * PetscSqrtReal((PetscReal)t->dim) + 0.5 * t->band) * h : 0;
}

/* Around surfaces, remembered: a narrow band asks again and again */
static PetscErrorCode surface_refines(Leaves *t, PetscInt level, const PetscInt x[], PetscBool *refine)
{
  const uint64_t key = curve_key(t->dim, x);
  PetscReal      centre[3], h, d = PETSC_MAX_REAL, far;
  PetscInt       known;

  PetscFunctionBeginUser;
  *refine = PETSC_FALSE;
  if (!(t->around || t->given) || level >= t->levels) PetscFunctionReturn(PETSC_SUCCESS);
  known = KeysFind(&t->memo[level], key);
  if (known >= 0) {
    *refine = (PetscBool)known;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(measure(t, level, x, centre, &h));
  far = narrow_reach(t, h);
  PetscCall(find_distance(t, level, centre, PetscMax(far, t->band * h), &d));
  *refine = (PetscBool)(d < t->band * h);
  if (!*refine && d < far && level + 1 < t->levels) PetscCall(neighbours_refine(t, level, x, refine));
  PetscCall(KeysAdd(&t->memo[level], key, *refine, &known));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode refines(Leaves *t, PetscInt level, const PetscInt x[], PetscBool *refine)
{
  PetscReal centre[3], h;

  PetscFunctionBeginUser;
  *refine = PETSC_FALSE;
  if (level >= t->levels) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(surface_refines(t, level, x, refine));
  if (!*refine && t->surface && t->surface->marks) *refine = MarksHave(t->surface->marks, level, curve_key(t->dim, x));
  if (*refine || !t->boxes.n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(measure(t, level, x, centre, &h));
  *refine = BoxesRefine(&t->boxes, t->dim, level, centre, h);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- leaves ---- */

PetscMPIInt LeavesOwner(const Leaves *t, uint64_t key)
{
  PetscMPIInt size, lo = 0, hi;

  (void)MPI_Comm_size(t->comm, &size);
  hi = size;
  while (hi - lo > 1) {
    const PetscMPIInt mid = (lo + hi) / 2;

    if (t->first[mid] <= key) lo = mid;
    else hi = mid;
  }
  return lo;
}

uint64_t LeavesKey(const Leaves *t, const PetscInt x[])
{
  return curve_key(t->dim, x);
}

static PetscInt find_before(PetscInt n, const Leaf leaf[], uint64_t key)
{
  PetscInt lo = -1, hi = n;

  while (hi - lo > 1) {
    const PetscInt mid = (lo + hi) / 2;

    if (leaf[mid].key <= key) lo = mid;
    else hi = mid;
  }
  return lo;
}

PetscInt LeavesOwnBefore(const Leaves *t, uint64_t key)
{
  return find_before(t->nleaf, t->leaf, key);
}

PetscInt LeavesOwnIndex(const Leaves *t, uint64_t key)
{
  const PetscInt i = LeavesOwnBefore(t, key);

  return i >= 0 && t->leaf[i].key == key ? i : -1;
}

static PetscBool is_inside(const Leaves *t, const Leaf *leaf, const PetscInt x[])
{
  const PetscInt w = LeavesWidth(t, leaf->level);

  for (PetscInt d = 0; d < t->dim; d++)
    if (x[d] < leaf->x[d] || x[d] >= leaf->x[d] + w) return PETSC_FALSE;
  return PETSC_TRUE;
}

PetscErrorCode LeavesFind(Leaves *t, const PetscInt x[], Leaf *out)
{
  const uint64_t key = curve_key(t->dim, x);
  PetscMPIInt    rank;
  PetscBool      refine = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(t->comm, &rank));
  if (t->first && LeavesOwner(t, key) == rank) {
    *out = t->leaf[LeavesOwnBefore(t, key)];
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (t->listed) {
    const PetscInt i = find_before(t->nlist, t->list, key);

    PetscCheck(i >= 0 && is_inside(t, t->list + i, x), PETSC_COMM_SELF, PETSC_ERR_PLIB,
               "A cell of another rank is asked for that this one does not know");
    *out = t->list[i];
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (out->level = 0;; out->level++) {
    const PetscInt w = LeavesWidth(t, out->level);

    for (PetscInt d = 0; d < 3; d++) out->x[d] = d < t->dim ? x[d] & ~(w - 1) : 0;
    PetscCall(refines(t, out->level, out->x, &refine));
    if (!refine) break;
  }
  out->key = curve_key(t->dim, out->x);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeavesLevelBeside(Leaves *t, const Leaf *leaf, const PetscInt step[], PetscInt *level)
{
  const PetscInt w    = LeavesWidth(t, leaf->level);
  PetscInt       x[3] = {0, 0, 0};
  Leaf           other;

  PetscFunctionBeginUser;
  *level = -1;
  for (PetscInt d = 0; d < t->dim; d++) x[d] = leaf->x[d] + step[d] * w;
  if (!LeavesWrap(t, x)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(LeavesFind(t, x, &other));
  *level = PetscMin(other.level, leaf->level);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_balance(const Leaves *t, const Leaf *a, const Leaf *b)
{
  PetscReal x[3], h;

  PetscFunctionBeginUser;
  if (PetscAbsInt(a->level - b->level) <= 1) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(measure(t, a->level, a->x, x, &h));
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
          "Cells of levels %" PetscInt_FMT " and %" PetscInt_FMT
          " meet near (%g, %g): sizes of the base cells change too quickly, or distances to a body are no distances. Raise -mesh_band (%g)",
          a->level, b->level, (double)x[0], (double)x[1], (double)t->band);
}

/* Just outside, and in both halves along a side */
void LeavesTouching(const Leaves *t, const Leaf *leaf, PetscInt *n, PetscInt out[LEAVES_MAX_NEIGHBOURS][3])
{
  const PetscInt w = LeavesWidth(t, leaf->level), half = w / 2, count = t->dim == 2 ? 16 : 64;

  *n = 0;
  for (PetscInt i = 0; i < count; i++) {
    PetscInt  x[3] = {0, 0, 0}, inner = 0;
    PetscBool twice = PETSC_FALSE;

    for (PetscInt d = 0; d < t->dim; d++) {
      const PetscInt where = (i >> (2 * d)) & 3;

      x[d] = leaf->x[d] + (where == 0 ? -1 : where == 1 ? 0 : where == 2 ? half : w);
      inner += where == 1 || where == 2;
      twice = (PetscBool)(twice || (where == 2 && !half));
    }
    if (twice || inner == t->dim || !LeavesWrap(t, x)) continue;
    (void)PetscArraycpy(out[(*n)++], x, 3);
  }
}

PetscErrorCode LeavesNeighbours(Leaves *t, const Leaf *leaf, PetscInt *n, Leaf out[LEAVES_MAX_NEIGHBOURS])
{
  PetscInt count, x[LEAVES_MAX_NEIGHBOURS][3];

  PetscFunctionBeginUser;
  *n = 0;
  LeavesTouching(t, leaf, &count, x);
  for (PetscInt i = 0; i < count; i++) {
    PetscInt k = 0;
    Leaf     other;

    PetscCall(LeavesFind(t, x[i], &other));
    while (k < *n && out[k].key != other.key) k++;
    if (k < *n) continue;
    PetscCall(check_balance(t, leaf, &other));
    out[(*n)++] = other;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- ranges ---- */

/* All leaves below a cell along the curve: counted, and those with numbers in [from, to) listed */
static PetscErrorCode walk(Leaves *t, PetscInt level, const PetscInt x[], PetscInt64 from, PetscInt64 to, PetscInt64 *count)
{
  PetscBool refine;

  PetscFunctionBeginUser;
  PetscCall(refines(t, level, x, &refine));
  if (!refine) {
    if (*count >= from && *count < to) {
      Leaf *leaf = t->leaf + (*count - from);

      *leaf = (Leaf){.key = curve_key(t->dim, x), .level = level};
      for (PetscInt d = 0; d < t->dim; d++) leaf->x[d] = x[d];
    }
    (*count)++;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt i = 0; i < 1 << t->dim; i++) {
    PetscInt y[3] = {0, 0, 0};

    for (PetscInt d = 0; d < t->dim; d++) y[d] = x[d] + ((i >> d) & 1) * LeavesWidth(t, level + 1);
    PetscCall(walk(t, level + 1, y, from, to, count));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

int LeavesCompare(const void *a, const void *b)
{
  const uint64_t x = ((const Leaf *)a)->key, y = ((const Leaf *)b)->key;

  return x < y ? -1 : x > y;
}

/* Base cells along the curve */
static PetscErrorCode list_roots(const Leaves *t, PetscInt nroot, Leaf root[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < nroot; i++) {
    const PetscInt at[3] = {i % t->n[0], i / t->n[0] % t->n[1], t->dim == 3 ? i / t->n[0] / t->n[1] : 0};

    root[i] = (Leaf){.level = 0};
    for (PetscInt d = 0; d < t->dim; d++) root[i].x[d] = at[d] << t->levels;
    root[i].key = curve_key(t->dim, root[i].x);
  }
  qsort(root, (size_t)nroot, sizeof(*root), LeavesCompare);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Boxes around base cells [n] along the curve: box [*nbox] */
static PetscErrorCode bound_roots(const Leaves *t, PetscInt n, const Leaf root[], PetscInt *nbox, PetscReal box[BOXES][2][3])
{
  PetscFunctionBeginUser;
  *nbox = 0;
  for (PetscInt i = 0; i < BOXES; i++) {
    const PetscInt from = n * i / BOXES, to = n * (i + 1) / BOXES;

    if (from == to) continue;
    for (PetscInt d = 0; d < 3; d++) {
      box[*nbox][0][d] = d < t->dim ? PETSC_MAX_REAL : 0;
      box[*nbox][1][d] = d < t->dim ? -PETSC_MAX_REAL : 0;
    }
    for (PetscInt c = from; c < to; c++)
      for (PetscInt end = 0; end < 2; end++) {
        PetscInt  half[3] = {0, 0, 0};
        PetscReal x[3];

        for (PetscInt d = 0; d < t->dim; d++) half[d] = 2 * (root[c].x[d] + end * LeavesWidth(t, 0));
        PetscCall(LeavesPlace(t, half, x));
        for (PetscInt d = 0; d < t->dim; d++) {
          box[*nbox][0][d] = PetscMin(box[*nbox][0][d], x[d]);
          box[*nbox][1][d] = PetscMax(box[*nbox][1][d], x[d]);
        }
      }
    (*nbox)++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Before the formula is asked about cells within FAR base cells of the given ones [n] */
static PetscErrorCode look(Leaves *t, PetscInt n, const Leaf root[])
{
  const MeshKind k      = t->kind;
  PetscReal      widest = 0, box[BOXES][2][3], reach;
  PetscInt       nbox;
  Regions        regions;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < n; c++) {
    PetscReal centre[3], h;

    PetscCall(measure(t, 0, root[c].x, centre, &h));
    widest = PetscMax(widest, h);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &widest, 1, MPIU_REAL, MPIU_MAX, t->comm));
  reach = PetscSqrtReal((PetscReal)t->dim) * FAR * widest;
  PetscCall(bound_roots(t, n, root, &nbox, box));
  PetscCall(RegionsCreate(t->comm, t->dim, k->lower, k->upper, k->period, nbox, box, &regions));
  if (t->surface && t->surface->marks)
    PetscCall(MarksLook(t->surface->marks, t, regions, reach + PetscSqrtReal((PetscReal)t->dim) * CLOSURE * widest));
  reach += PetscMax(narrow_reach(t, widest), t->band * widest) + BoxesReach(&t->boxes, widest);
  if (t->surface && t->surface->look) PetscCall((*t->surface->look)(t->surface->context, regions, reach));
  PetscCall(BoxesPlace(&t->boxes, k, t->surface));
  PetscCall(RegionsDestroy(&regions));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Leaves of every base cell, on all ranks; each counts its share: count [nroot] */
static PetscErrorCode count_leaves(Leaves *t, PetscInt nroot, const Leaf root[], PetscInt count[])
{
  PetscMPIInt size, rank, *n, *begin;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(t->comm, &size));
  PetscCallMPI(MPI_Comm_rank(t->comm, &rank));
  PetscCall(PetscMalloc2(size, &n, size, &begin));
  for (PetscMPIInt r = 0; r < size; r++) {
    begin[r] = (PetscMPIInt)((PetscInt64)nroot * r / size);
    n[r]     = (PetscMPIInt)((PetscInt64)nroot * (r + 1) / size) - begin[r];
  }
  PetscCall(look(t, n[rank], root + begin[rank]));
  for (PetscInt i = begin[rank]; i < begin[rank] + n[rank]; i++) {
    PetscInt64 m = 0;

    PetscCall(walk(t, 0, root[i].x, 0, 0, &m));
    count[i] = (PetscInt)m;
  }
  PetscCallMPI(MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, count, n, begin, MPIU_INT, t->comm));
  PetscCall(PetscFree2(n, begin));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void LeavesShare(PetscInt64 total, PetscMPIInt size, PetscMPIInt rank, PetscInt *n, PetscInt *start)
{
  *start = (PetscInt)(total * rank / size);
  *n     = (PetscInt)(total * (rank + 1) / size) - *start;
}

/* The range of this rank out of t->total leaves */
static PetscErrorCode take_range(Leaves *t)
{
  PetscMPIInt size, rank;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(t->comm, &size));
  PetscCallMPI(MPI_Comm_rank(t->comm, &rank));
  PetscCheck(t->total >= size, t->comm, PETSC_ERR_USER_INPUT, "%d cells are too few for %d ranks: raise -mesh_cells or use fewer ranks",
             (int)t->total, size);
  PetscCall(NumbersCheck(t->comm, t->dim, (PetscReal)t->total));
  LeavesShare(t->total, size, rank, &t->nleaf, &t->start);
  PetscCall(PetscMalloc1(t->nleaf, &t->leaf));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode share_first_keys(Leaves *t)
{
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(t->comm, &size));
  PetscCall(PetscMalloc1(size, &t->first));
  PetscCallMPI(MPI_Allgather(&t->leaf[0].key, 1, MPI_UINT64_T, t->first, 1, MPI_UINT64_T, t->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_own_leaves(Leaves *t)
{
  PetscInt   nroot = t->n[0] * t->n[1] * (t->dim == 3 ? t->n[2] : 1), *count, first = 0, last = 0;
  PetscInt64 to, at = 0, from = 0;
  Leaf      *root;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(nroot, &root, nroot, &count));
  PetscCall(list_roots(t, nroot, root));
  PetscCall(count_leaves(t, nroot, root, count));
  for (PetscInt i = 0; i < nroot; i++) t->total += count[i];
  PetscCall(take_range(t));
  to = t->start + t->nleaf;
  for (; last < nroot && at < to; at += count[last++]) /* base cells with own leaves: [first, last) */
    if (at + count[last] <= t->start) {
      first = last + 1;
      from  = at + count[last];
    }
  PetscCall(look(t, last - first, root + first));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &t->boxes.carried, 1, MPIU_INT, MPI_SUM, t->comm));
  for (PetscInt i = first; i < last; i++) PetscCall(walk(t, 0, root[i].x, t->start, to, &from));
  PetscCall(share_first_keys(t));
  PetscCall(PetscFree2(root, count));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells of a box that is not refined, below one of the lattice with sides `w`, along the curve: those with numbers of
   the own range are listed, *at counts all. Cells of the lattice outside of the box are none. */
static void list_equal(Leaves *t, const PetscInt x[], PetscInt w, PetscInt64 *at)
{
  PetscInt64 count = 1;

  for (PetscInt d = 0; d < t->dim; d++) count *= PetscMax(0, PetscMin(t->cells[d], x[d] + w) - x[d]);
  if (!count || *at + count <= t->start || *at >= t->start + t->nleaf) {
    *at += count;
    return;
  }
  if (w == 1) {
    Leaf *leaf = t->leaf + ((*at)++ - t->start);

    *leaf = (Leaf){.key = curve_key(t->dim, x)};
    for (PetscInt d = 0; d < t->dim; d++) leaf->x[d] = x[d];
    return;
  }
  for (PetscInt i = 0; i < 1 << t->dim; i++) {
    PetscInt y[3] = {0, 0, 0};

    for (PetscInt d = 0; d < t->dim; d++) y[d] = x[d] + ((i >> d) & 1) * (w / 2);
    list_equal(t, y, w / 2, at);
  }
}

/* All of them, row by row: what one rank's sweeps like better than the curve (runs/bench) */
static void list_rows(Leaves *t)
{
  for (PetscInt i = 0; i < t->nleaf; i++) {
    Leaf *leaf = t->leaf + i;

    *leaf = (Leaf){.x = {i % t->cells[0], i / t->cells[0]}};
    if (t->dim == 3) {
      leaf->x[2] = leaf->x[1] / t->cells[1];
      leaf->x[1] %= t->cells[1];
    }
    leaf->key = curve_key(t->dim, leaf->x);
  }
}

/* ---- options ---- */

static PetscErrorCode read_regions(Leaves *t)
{
  PetscBool given = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCall(BoxesRead(t->comm, t->dim, t->levels, &t->boxes));
  t->around = t->boxes.names.bodies;
  t->given  = t->boxes.names.expression;
  if (t->given) PetscCall(ExprRead("-mesh_distance", t->dim, 1, &t->constant, &t->distance, &given));
  PetscCheck(given, t->comm, PETSC_ERR_USER_INPUT,
             "-mesh_refine expression needs the distance to what is to be fine: give it by -mesh_distance, such as \"sqrt(x^2 + y^2) - 0.5\"");
  PetscCheck(!t->around || t->surface, t->comm, PETSC_ERR_USER_INPUT,
             "-mesh_levels %" PetscInt_FMT " refines around bodies, and the scene has none: name a box by -mesh_refine, or remove -mesh_levels",
             t->levels);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_lattice(Leaves *t)
{
  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < t->dim; d++) {
    t->n[d]        = t->kind->cells[d];
    t->periodic[d] = (PetscBool)(t->kind->period[d] > 0);
    PetscCheck(t->n[d] < MAX_LATTICE >> t->levels, t->comm, PETSC_ERR_USER_INPUT,
               "%" PetscInt_FMT " cells along axis %c with %" PetscInt_FMT " levels are more than %d finest cells: lower -mesh_levels or -mesh_cells",
               t->n[d], (char)('x' + d), t->levels, MAX_LATTICE);
    t->cells[d] = t->n[d] << t->levels;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeavesCreate(MPI_Comm comm, MeshKind kind, PetscInt levels, const MeshSurface *surface, Leaves *t)
{
  PetscFunctionBeginUser;
  *t = (Leaves){.comm = comm, .kind = kind, .dim = kind->dim, .levels = levels, .surface = surface, .band = 3};
  PetscCall(OptReal("-mesh_band", &t->band));
  PetscCall(read_regions(t));
  PetscCall(set_lattice(t));
  PetscCall(find_own_leaves(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeavesCreateEqual(MPI_Comm comm, MeshKind kind, Leaves *t)
{
  PetscInt64 at = 0;
  PetscInt   w  = 1;

  PetscFunctionBeginUser;
  *t = (Leaves){.comm = comm, .kind = kind, .dim = kind->dim, .total = 1};
  PetscCall(set_lattice(t));
  for (PetscInt d = 0; d < t->dim; d++) {
    t->total *= t->cells[d];
    while (w < t->cells[d]) w *= 2;
  }
  PetscCall(take_range(t));
  if (t->nleaf == t->total) list_rows(t);
  else list_equal(t, (const PetscInt[3]){0, 0, 0}, w, &at);
  PetscCall(share_first_keys(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeavesCreateFromList(MPI_Comm comm, MeshKind kind, PetscInt levels, PetscInt64 total, const Leaf list[], Leaves *t)
{
  PetscFunctionBeginUser;
  *t = (Leaves){.comm = comm, .kind = kind, .dim = kind->dim, .levels = levels, .total = total, .listed = PETSC_TRUE};
  PetscCall(set_lattice(t));
  PetscCall(take_range(t));
  PetscCall(PetscArraycpy(t->leaf, list, t->nleaf));
  for (PetscInt i = 0; i < t->nleaf; i++) t->leaf[i].key = curve_key(t->dim, t->leaf[i].x);
  PetscCall(share_first_keys(t));
  PetscCall(LeavesLearn(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeavesAreSame(const Leaves *a, const Leaves *b, PetscBool *same)
{
  PetscFunctionBeginUser;
  *same = (PetscBool)(a->levels == b->levels && a->total == b->total && a->start == b->start && a->nleaf == b->nleaf);
  for (PetscInt d = 0; d < a->dim; d++) *same = (PetscBool)(*same && a->n[d] == b->n[d]);
  for (PetscInt i = 0; i < a->nleaf && *same; i++) *same = (PetscBool)(a->leaf[i].key == b->leaf[i].key && a->leaf[i].level == b->leaf[i].level);
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, same, 1, COMPAT_MPI_BOOL, MPI_LAND, a->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeavesClose(Leaves *t)
{
  PetscFunctionBeginUser;
  for (PetscInt l = 0; l <= LEAVES_MAX_LEVELS; l++) PetscCall(KeysDestroy(&t->memo[l]));
  PetscCall(ExprDestroy(&t->distance));
  PetscCall(BoxesDestroy(&t->boxes));
  PetscCall(PetscFree(t->list));
  t->surface = NULL;
  t->nlist   = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeavesDestroy(Leaves *t)
{
  PetscFunctionBeginUser;
  PetscCall(LeavesClose(t));
  PetscCall(PetscFree(t->leaf));
  PetscCall(PetscFree(t->first));
  PetscFunctionReturn(PETSC_SUCCESS);
}
