/* Ranges: which leaves a rank has (the constructors of leaves.h). Every rank counts those of its share of the base
   cells; from the counts all know where along the curve the ranges end, and each lists its own. */
#include "compat.h"
#include "leaves.h"
#include "../kinds/kindimpl.h"
#include "marks.h"
#include "../numbers.h"
#include "base/opt.h"

#define MAX_LATTICE (1 << 20)
#define BOXES       8 /* around the base cells of a rank */
/* base cells from the own ones within which the formula is asked: LEAVES_AROUND, half of the one that holds the place,
   one more for a narrow band */
#define FAR     (LEAVES_AROUND + 2)
#define CLOSURE 3 /* and within which a marked cell may have others refined */

/* All leaves below a cell along the curve: counted, and those with numbers in [from, to) listed */
static PetscErrorCode walk(Leaves *t, PetscInt level, const PetscInt x[], PetscInt64 from, PetscInt64 to,
                           PetscInt64 *count)
{
  PetscBool refine;

  PetscFunctionBeginUser;
  PetscCall(LeavesRefine(t, level, x, &refine));
  if (!refine) {
    if (*count >= from && *count < to) {
      Leaf *leaf = t->leaf + (*count - from);

      *leaf = (Leaf){.key = LeavesKey(t, x), .level = level};
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

/* Base cells along the curve */
static PetscErrorCode list_roots(const Leaves *t, PetscInt nroot, Leaf root[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < nroot; i++) {
    const PetscInt at[3] = {i % t->n[0], i / t->n[0] % t->n[1], t->dim == 3 ? i / t->n[0] / t->n[1] : 0};

    root[i] = (Leaf){.level = 0};
    for (PetscInt d = 0; d < t->dim; d++) root[i].x[d] = at[d] << t->levels;
    root[i].key = LeavesKey(t, root[i].x);
  }
  qsort(root, (size_t)nroot, sizeof(*root), LeavesCompare);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Boxes around base cells [n] along the curve: box [*nbox] */
static PetscErrorCode bound_roots(const Leaves *t, PetscInt n, const Leaf root[], PetscInt *nbox,
                                  PetscReal box[BOXES][2][3])
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
        PetscCall(LeavesPosition(t, half, x));
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
static PetscErrorCode list_around(Leaves *t, PetscInt n, const Leaf root[])
{
  const MeshKind k      = t->kind;
  PetscReal      widest = 0, box[BOXES][2][3], reach;
  PetscInt       nbox;
  RankBoxes      regions;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < n; c++) {
    PetscReal centre[3], h;

    PetscCall(LeavesMeasure(t, 0, root[c].x, centre, &h));
    widest = PetscMax(widest, h);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &widest, 1, MPIU_REAL, MPIU_MAX, t->comm));
  reach = PetscSqrtReal((PetscReal)t->dim) * FAR * widest;
  PetscCall(bound_roots(t, n, root, &nbox, box));
  PetscCall(RankBoxesCreate(t->comm, t->dim, k->lower, k->upper, k->period, nbox, box, &regions));
  if (t->surface && t->surface->marks)
    PetscCall(MarksLook(t->surface->marks, t, regions, reach + PetscSqrtReal((PetscReal)t->dim) * CLOSURE * widest));
  reach += LeavesReach(t, widest) + BoxesReach(&t->boxes, widest);
  if (t->surface && t->surface->look) PetscCall((*t->surface->look)(t->surface->context, regions, reach));
  PetscCall(BoxesPlace(&t->boxes, k, t->surface));
  PetscCall(RankBoxesDestroy(&regions));
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
    PetscInt own, first;

    LeavesRange(nroot, size, r, &own, &first);
    PetscCall(PetscMPIIntCast(own, &n[r]));
    PetscCall(PetscMPIIntCast(first, &begin[r]));
  }
  PetscCall(list_around(t, n[rank], root + begin[rank]));
  for (PetscInt i = begin[rank]; i < begin[rank] + n[rank]; i++) {
    PetscInt64 m = 0;

    PetscCall(walk(t, 0, root[i].x, 0, 0, &m));
    count[i] = (PetscInt)m;
  }
  PetscCallMPI(MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, count, n, begin, MPIU_INT, t->comm));
  PetscCall(PetscFree2(n, begin));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void LeavesRange(PetscInt64 total, PetscMPIInt size, PetscMPIInt rank, PetscInt *n, PetscInt *start)
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
  PetscCheck(t->total >= size, t->comm, PETSC_ERR_USER_INPUT,
             "%d cells are too few for %d ranks: raise -mesh_cells or use fewer ranks", (int)t->total, size);
  PetscCall(NumbersCheck(t->comm, t->dim, (PetscReal)t->total));
  LeavesRange(t->total, size, rank, &t->nleaf, &t->start);
  PetscCall(PetscMalloc1(t->nleaf, &t->leaf));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode gather_first_keys(Leaves *t)
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
  PetscCall(list_around(t, last - first, root + first));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &t->boxes.carried, 1, MPIU_INT, MPI_SUM, t->comm));
  for (PetscInt i = first; i < last; i++) PetscCall(walk(t, 0, root[i].x, t->start, to, &from));
  PetscCall(gather_first_keys(t));
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

    *leaf = (Leaf){.key = LeavesKey(t, x)};
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
    leaf->key = LeavesKey(t, leaf->x);
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
             "-mesh_levels %" PetscInt_FMT
             " refines around bodies, and the scene has none: name a box by -mesh_refine, or remove -mesh_levels",
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
               "%" PetscInt_FMT " cells along axis %c with %" PetscInt_FMT
               " levels are more than %d finest cells: lower -mesh_levels or -mesh_cells",
               t->n[d], (char)('x' + d), t->levels, MAX_LATTICE);
    t->cells[d] = t->n[d] << t->levels;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeavesCreate(MPI_Comm comm, MeshKind kind, PetscInt levels, const MeshSurface *surface, Leaves *t)
{
  PetscFunctionBeginUser;
  *t = (Leaves){.comm = comm, .kind = kind, .dim = kind->dim, .levels = levels, .surface = surface, .band = 3};
  PetscCall(OptReal("-mesh_refine_distance", &t->band));
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
  PetscCall(gather_first_keys(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeavesCreateFromList(MPI_Comm comm, MeshKind kind, PetscInt levels, PetscInt64 total, const Leaf list[],
                                    Leaves *t)
{
  PetscFunctionBeginUser;
  *t = (Leaves){.comm = comm, .kind = kind, .dim = kind->dim, .levels = levels, .total = total, .listed = PETSC_TRUE};
  PetscCall(set_lattice(t));
  PetscCall(take_range(t));
  PetscCall(PetscArraycpy(t->leaf, list, t->nleaf));
  for (PetscInt i = 0; i < t->nleaf; i++) t->leaf[i].key = LeavesKey(t, t->leaf[i].x);
  PetscCall(gather_first_keys(t));
  PetscCall(LeavesLearn(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}
