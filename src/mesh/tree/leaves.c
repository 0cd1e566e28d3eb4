/* Leaves: see leaves.h. */
#include "compat.h"
#include "leaves.h"
#include "../kinds/kindimpl.h"
#include "marks.h"

#define BAND_PLANE 2.2 /* from here on levels are balanced by themselves */
#define BAND_SPACE 2.6

PetscErrorCode LeavesPosition(const Leaves *t, const PetscInt half[], PetscReal x[])
{
  const MeshKind k = t->kind;
  PetscReal      q[3];

  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < t->dim; d++)
    q[d] = half[d] == 2 * t->cells[d]
           ? k->upper[d]
           : k->lower[d] + (k->upper[d] - k->lower[d]) * (PetscReal)half[d] / (PetscReal)(2 * t->cells[d]);
  PetscCall(MeshKindEvaluate(k, q, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the formula ---- */

PetscErrorCode LeavesMeasure(const Leaves *t, PetscInt level, const PetscInt x[], PetscReal centre[3], PetscReal *h)
{
  PetscInt  half[2][3];
  PetscReal end[2][3];

  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < t->dim; d++) {
    half[0][d] = 2 * x[d];
    half[1][d] = 2 * (x[d] + LeavesWidth(t, level));
  }
  for (PetscInt i = 0; i < 2; i++) PetscCall(LeavesPosition(t, half[i], end[i]));
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
  if (t->distance) PetscCall(ExprEvaluateAlone(t->distance, 0, x, &more));
  *d = PetscMin(*d, PetscMax(more, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* With a narrow band, how far from a surface a cell of size h may be refined because of finer ones beside it */
static PetscReal narrow_reach(const Leaves *t, PetscReal h)
{
  return t->band < (t->dim == 2 ? BAND_PLANE : BAND_SPACE)
         ? (1.5 * PetscSqrtReal((PetscReal)t->dim) + 0.5 * t->band) * h
         : 0;
}

PetscReal LeavesReach(const Leaves *t, PetscReal h)
{
  return PetscMax(narrow_reach(t, h), t->band * h);
}

/* Around surfaces, remembered: a narrow band asks again and again */
static PetscErrorCode surface_refines(Leaves *t, PetscInt level, const PetscInt x[], PetscBool *refine)
{
  const uint64_t key = CurveKey(t->dim, x);
  PetscReal      centre[3], h, d = PETSC_MAX_REAL, far;
  PetscInt       memo;

  PetscFunctionBeginUser;
  *refine = PETSC_FALSE;
  if (!(t->around || t->given) || level >= t->levels) PetscFunctionReturn(PETSC_SUCCESS);
  memo = KeysFind(&t->memo[level], key);
  if (memo >= 0) {
    *refine = (PetscBool)memo;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(LeavesMeasure(t, level, x, centre, &h));
  far = narrow_reach(t, h);
  PetscCall(find_distance(t, level, centre, PetscMax(far, t->band * h), &d));
  *refine = (PetscBool)(d < t->band * h);
  if (!*refine && d < far && level + 1 < t->levels) PetscCall(neighbours_refine(t, level, x, refine));
  PetscCall(KeysAdd(&t->memo[level], key, *refine, &memo));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeavesRefine(Leaves *t, PetscInt level, const PetscInt x[], PetscBool *refine)
{
  PetscReal centre[3], h;

  PetscFunctionBeginUser;
  *refine = PETSC_FALSE;
  if (level >= t->levels) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(surface_refines(t, level, x, refine));
  if (!*refine && t->surface && t->surface->marks) *refine = MarksHave(t->surface->marks, level, CurveKey(t->dim, x));
  if (*refine || !t->boxes.n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(LeavesMeasure(t, level, x, centre, &h));
  *refine = BoxesRefine(&t->boxes, t->dim, level, centre, h);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- leaves ---- */

PetscMPIInt LeavesOwner(const Leaves *t, uint64_t key)
{
  PetscMPIInt size;

  (void)MPI_Comm_size(t->comm, &size);
  return CurveRank(size, t->first, key);
}

uint64_t LeavesKey(const Leaves *t, const PetscInt x[])
{
  return CurveKey(t->dim, x);
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

PetscErrorCode LeavesCreateCurve(const Leaves *t, Curve *curve)
{
  PetscReal  *line[3] = {NULL, NULL, NULL};
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(t->comm, &size));
  for (PetscInt d = 0; d < t->dim; d++) {
    PetscCall(PetscMalloc1(t->cells[d] + 1, &line[d]));
    for (PetscInt i = 0; i <= t->cells[d]; i++) {
      PetscInt  half[3] = {0, 0, 0};
      PetscReal x[3];

      half[d] = 2 * i;
      PetscCall(LeavesPosition(t, half, x));
      line[d][i] = x[d];
    }
  }
  PetscCall(CurveCreate(t->dim, t->cells, (const PetscReal *const *)line, size, t->first, curve));
  for (PetscInt d = 0; d < t->dim; d++) PetscCall(PetscFree(line[d]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool LeavesContain(const Leaves *t, const Leaf *leaf, const PetscInt x[])
{
  const PetscInt w = LeavesWidth(t, leaf->level);

  for (PetscInt d = 0; d < t->dim; d++)
    if (x[d] < leaf->x[d] || x[d] >= leaf->x[d] + w) return PETSC_FALSE;
  return PETSC_TRUE;
}

PetscErrorCode LeavesFind(Leaves *t, const PetscInt x[], Leaf *out)
{
  const uint64_t key = CurveKey(t->dim, x);
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

    PetscCheck(i >= 0 && LeavesContain(t, t->list + i, x), PETSC_COMM_SELF, PETSC_ERR_PLIB,
               "A cell of another rank is asked for that this one does not know");
    *out = t->list[i];
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (out->level = 0;; out->level++) {
    const PetscInt w = LeavesWidth(t, out->level);

    for (PetscInt d = 0; d < 3; d++) out->x[d] = d < t->dim ? x[d] & ~(w - 1) : 0;
    PetscCall(LeavesRefine(t, out->level, out->x, &refine));
    if (!refine) break;
  }
  out->key = CurveKey(t->dim, out->x);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeavesLevelBeside(Leaves *t, const Leaf *leaf, const PetscInt step[], PetscInt *level)
{
  const PetscInt w    = LeavesWidth(t, leaf->level);
  PetscInt       x[3] = {0, 0, 0};
  Leaf           other;

  PetscFunctionBeginUser;
  *level = -1;
  /* the finest cell that touches: farther down another leaf may lie between, which is more than ranks know */
  for (PetscInt d = 0; d < t->dim; d++) x[d] = leaf->x[d] + (step[d] > 0 ? w : step[d]);
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
  PetscCall(LeavesMeasure(t, a->level, a->x, x, &h));
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
          "Cells of levels %" PetscInt_FMT " and %" PetscInt_FMT
          " meet near (%g, %g): sizes of the base cells change too quickly, or distances to a body are no distances. Raise -mesh_refine_distance (%g)",
          a->level, b->level, (double)x[0], (double)x[1], (double)t->band);
}

PetscBool LeavesIsInner(const Leaves *t, PetscMPIInt rank, const Leaf *leaf)
{
  const PetscInt w      = LeavesWidth(t, leaf->level);
  PetscInt       low[3] = {0, 0, 0}, high[3] = {0, 0, 0};

  for (PetscInt d = 0; d < t->dim; d++) {
    low[d]  = leaf->x[d] - 1;
    high[d] = leaf->x[d] + w;
    if (!t->periodic[d]) {
      low[d]  = PetscMax(low[d], 0);
      high[d] = PetscMin(high[d], t->cells[d] - 1);
    }
    if (low[d] < 0 || high[d] >= t->cells[d]) return PETSC_FALSE;
  }
  return (PetscBool)(LeavesOwner(t, CurveKey(t->dim, low)) == rank && LeavesOwner(t, CurveKey(t->dim, high)) == rank);
}

PetscErrorCode LeavesCheckBalance(Leaves *t, const Leaf *leaf)
{
  const PetscInt w = LeavesWidth(t, leaf->level);

  PetscFunctionBeginUser;
  if (leaf->level < 2) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 1; i < 1 << t->dim; i++) { /* away from the other cells of its parent */
    PetscInt x[3] = {0, 0, 0};
    Leaf     other;

    for (PetscInt d = 0; d < t->dim; d++) x[d] = leaf->x[d] + ((i >> d) & 1 ? (leaf->x[d] & w ? w : -1) : 0);
    if (!LeavesWrap(t, x)) continue;
    PetscCall(LeavesFind(t, x, &other));
    PetscCall(check_balance(t, leaf, &other));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
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

/* ---- all of them ---- */

int LeavesCompare(const void *a, const void *b)
{
  const uint64_t x = ((const Leaf *)a)->key, y = ((const Leaf *)b)->key;

  return x < y ? -1 : x > y;
}

PetscErrorCode LeavesAreSame(const Leaves *a, const Leaves *b, PetscBool *same)
{
  PetscFunctionBeginUser;
  *same = (PetscBool)(a->levels == b->levels && a->total == b->total && a->start == b->start && a->nleaf == b->nleaf);
  for (PetscInt d = 0; d < a->dim; d++) *same = (PetscBool)(*same && a->n[d] == b->n[d]);
  for (PetscInt i = 0; i < a->nleaf && *same; i++)
    *same = (PetscBool)(a->leaf[i].key == b->leaf[i].key && a->leaf[i].level == b->leaf[i].level);
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
