/* VCycle: rows of the levels, from PETSc's matrices and from all ranks, see vcycleimpl.h. */
#include "compat.h"
#include "vcycleimpl.h"
#include "base/array.h"
#include "base/rowtype.h"

/* Rows to be read: up to two parts side by side, the second with columns of other ranks. A row in any order. */
typedef struct {
  PetscInt           n, own, nghost, first; /* rows; columns of the first part, of the second; the first one's number */
  const PetscInt    *ghost;                 /* [nghost] numbers of the second part's */
  const PetscInt    *start[2], *col[2];     /* [1] NULL: there is no second part */
  const PetscScalar *value[2];
  Mat                block[2];
} Source;

static PetscErrorCode open_source(Mat A, Source *f)
{
  PetscBool seq, done;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(f, 1));
  PetscCall(MatGetLocalSize(A, &f->n, &f->own));
  PetscCall(MatGetOwnershipRangeColumn(A, &f->first, NULL));
  PetscCall(PetscObjectBaseTypeCompare((PetscObject)A, MATSEQAIJ, &seq));
  if (seq) f->block[0] = A;
  else PetscCall(MatMPIAIJGetSeqAIJ(A, &f->block[0], &f->block[1], &f->ghost));
  if (f->block[1]) PetscCall(MatGetSize(f->block[1], NULL, &f->nghost));
  for (int k = 0; k < 2 && f->block[k]; k++) {
    PetscInt n;

    PetscCall(MatGetRowIJ(f->block[k], 0, PETSC_FALSE, PETSC_FALSE, &n, &f->start[k], &f->col[k], &done));
    PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_SUP, "Rows of the coarse matrix are not stored one after the other");
    PetscCall(MatSeqAIJGetArrayRead(f->block[k], &f->value[k]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode close_source(Source *f)
{
  PetscFunctionBeginUser;
  for (int k = 0; k < 2 && f->block[k]; k++) {
    PetscInt  n;
    PetscBool done;

    PetscCall(MatSeqAIJRestoreArrayRead(f->block[k], &f->value[k]));
    PetscCall(MatRestoreRowIJ(f->block[k], 0, PETSC_FALSE, PETSC_FALSE, &n, &f->start[k], &f->col[k], &done));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscInt count_entries(const Source *f)
{
  return f->start[0][f->n] + (f->start[1] ? f->start[1][f->n] : 0);
}

static PetscErrorCode reserve(VRows *to, PetscInt n, PetscInt nstart, PetscInt nentry)
{
  PetscFunctionBeginUser;
  if (!to->start) PetscCall(PetscMalloc1(nstart, &to->start));
  to->n = n;
  if (nentry <= to->capacity && nentry >= to->capacity / 4 * 3) PetscFunctionReturn(PETSC_SUCCESS);
  to->capacity = nentry +
                 (to->capacity ? nentry / 16 : 0); /* those of bodies that move come again, a few more or less */
  PetscCall(PetscRealloc(to->capacity * sizeof(*to->col), &to->col));
  PetscCall(PetscRealloc(to->capacity * sizeof(*to->value), &to->value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void put(VRows *to, PetscInt e, PetscInt col, PetscReal value)
{
  to->col[e]   = col;
  to->value[e] = (float)value;
}

/* Row i of a square matrix from entry e on: before the diagonal, behind it, ghosts. The diagonal, and the sum of the
   ghosts' sizes. */
static void put_row(const Source *f, PetscInt i, PetscReal factor, VRows *to, PetscReal *diagonal, PetscReal *others)
{
  const PetscInt *s = f->start[0];
  PetscInt        e = to->start[3 * i];

  *diagonal = *others = 0;
  for (int behind = 0; behind < 2; behind++) {
    for (PetscInt k = s[i]; k < s[i + 1]; k++) {
      if (f->col[0][k] == i) *diagonal = factor * f->value[0][k];
      else if ((f->col[0][k] > i) == behind) put(to, e++, f->col[0][k], factor * f->value[0][k]);
    }
    to->start[3 * i + 1 + behind] = e;
  }
  for (PetscInt k = f->start[1] ? f->start[1][i] : 0; f->start[1] && k < f->start[1][i + 1]; k++) {
    *others += PetscAbsReal(factor * f->value[1][k]);
    put(to, e++, f->own + f->col[1][k], factor * f->value[1][k]);
  }
  to->start[3 * i + 3] = e;
}

/* Diagonals with half of what other ranks have in the row, unless that is below a third: as hypre's l1 smoothers */
static PetscErrorCode take_square(const Source *f, PetscReal factor, VLevel *l)
{
  PetscFunctionBeginUser;
  PetscCall(reserve(&l->A, f->n, 3 * f->n + 1, count_entries(f)));
  l->A.own    = f->own;
  l->A.nghost = f->nghost;
  if (!l->inverse) PetscCall(PetscMalloc2(f->n, &l->inverse, f->n, &l->more));
  l->A.start[0] = 0;
  for (PetscInt i = 0; i < f->n; i++) {
    PetscReal diagonal, others, more;

    put_row(f, i, factor, &l->A, &diagonal, &others);
    more = 0.5 * others > PetscAbsReal(diagonal) / 3 ? 0.5 * others : 0;
    if (diagonal < 0) more = -more;
    l->more[i]    = (float)more;
    diagonal      = (PetscReal)(float)diagonal + (PetscReal)l->more[i];
    l->inverse[i] = diagonal != 0 ? 1 / diagonal : 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode arrange_ghosts(PetscLayout layout, PetscInt n, const PetscInt ghost[], PetscSF *sf)
{
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(layout->comm, &size));
  if (size == 1) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscSFDestroy(sf));
  PetscCall(PetscSFCreate(layout->comm, sf));
  PetscCall(PetscSFSetGraphLayout(*sf, layout, n, NULL, PETSC_COPY_VALUES, ghost));
  PetscCall(PetscSFSetUp(*sf));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode VLevelTake(VCycle s, Mat A, VLevel *l)
{
  Source      f;
  PetscLayout layout;

  PetscFunctionBeginUser;
  PetscCall(open_source(A, &f));
  PetscCall(take_square(&f, 1 / s->unit, l));
  PetscCall(MatGetLayouts(A, NULL, &layout));
  PetscCall(arrange_ghosts(layout, f.nghost, f.ghost, &l->A.ghosts));
  PetscCall(close_source(&f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode VLevelTakeFinest(VCycle s, Mat A)
{
  VLevel     *l = s->level;
  Source      f;
  PetscLayout layout;
  PetscInt    nold = l->A.nghost;
  PetscBool   same;

  PetscFunctionBeginUser;
  PetscCall(open_source(A, &f));
  PetscCall(take_square(&f, 1 / s->unit, l));
  same = (PetscBool)(l->x && f.nghost == nold);
  if (same) PetscCall(PetscArraycmp(s->ghost, f.ghost, f.nghost, &same));
  if (!s->alone) PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &same, 1, COMPAT_MPI_BOOL, MPI_LAND, s->comm));
  if (!same) {
    PetscCall(MatGetLayouts(A, NULL, &layout));
    PetscCall(arrange_ghosts(layout, f.nghost, f.ghost, &l->A.ghosts));
    PetscCall(PetscFree(l->x));
    PetscCall(PetscCalloc1(f.n + f.nghost, &l->x));
    PetscCall(PetscFree(s->ghost));
    PetscCall(PetscMalloc1(f.nghost, &s->ghost));
    PetscCall(PetscArraycpy(s->ghost, f.ghost, f.nghost));
    PetscCall(PetscFree(s->d));
    if (l->ghost.start) PetscCall(VLevelFetchGhosts(s, l));
  }
  PetscCall(close_source(&f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode VRowsTake(Mat P, PetscBool replicated, VRows *to)
{
  Source      f;
  PetscLayout layout;
  PetscInt    e = 0, ncol;

  PetscFunctionBeginUser;
  PetscCall(open_source(P, &f));
  PetscCall(MatGetSize(P, NULL, &ncol));
  PetscCall(reserve(to, f.n, f.n + 1, count_entries(&f)));
  to->own      = replicated ? ncol : f.own;
  to->nghost   = replicated ? 0 : f.nghost;
  to->start[0] = 0;
  for (PetscInt i = 0; i < f.n; i++) {
    for (int block = 0; block < 2 && f.start[block]; block++)
      for (PetscInt k = f.start[block][i]; k < f.start[block][i + 1]; k++) {
        const PetscInt c = f.col[block][k];

        if (replicated) put(to, e++, block ? f.ghost[c] : f.first + c, f.value[block][k]);
        else put(to, e++, block ? f.own + c : c, f.value[block][k]);
      }
    to->start[i + 1] = e;
  }
  if (!replicated) {
    PetscCall(MatGetLayouts(P, NULL, &layout));
    PetscCall(arrange_ghosts(layout, f.nghost, f.ghost, &to->ghosts));
  }
  PetscCall(close_source(&f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode VLevelFetchGhosts(VCycle s, VLevel *l)
{
  const VRows *P   = &l->P;
  PetscInt     max = 0, e = 0, width;
  PetscReal   *own, *ghost;
  MPI_Datatype type;

  PetscFunctionBeginUser;
  if (s->alone) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < P->n; i++) max = PetscMax(max, P->start[i + 1] - P->start[i]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &max, 1, MPIU_INT, MPI_MAX, s->comm));
  width = 1 + 2 * max; /* number of entries, columns and values */
  PetscCall(PetscCalloc2(P->n * width, &own, l->A.nghost * width, &ghost));
  for (PetscInt i = 0; i < P->n; i++) {
    PetscReal *row = own + i * width;

    row[0] = (PetscReal)(P->start[i + 1] - P->start[i]);
    for (PetscInt k = P->start[i]; k < P->start[i + 1]; k++) {
      *++row = (PetscReal)P->col[k];
      *++row = (PetscReal)P->value[k];
    }
  }
  PetscCall(RowTypeCreate(width, &type));
  PetscCall(PetscSFBcastBegin(l->A.ghosts, type, own, ghost, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(l->A.ghosts, type, own, ghost, MPI_REPLACE));
  PetscCall(RowTypeDestroy(&type));
  PetscCall(VRowsDestroy(&l->ghost));
  PetscCall(reserve(&l->ghost, l->A.nghost, l->A.nghost + 1, l->A.nghost * max));
  l->ghost.start[0] = 0;
  for (PetscInt i = 0; i < l->A.nghost; i++) {
    const PetscReal *row = ghost + i * width;

    for (PetscInt k = 0; k < (PetscInt)row[0]; k++) put(&l->ghost, e++, (PetscInt)row[1 + 2 * k], row[2 + 2 * k]);
    l->ghost.start[i + 1] = e;
  }
  PetscCall(PetscFree2(own, ghost));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode VRowsDestroy(VRows *r)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(r->start));
  PetscCall(PetscFree(r->col));
  PetscCall(PetscFree(r->value));
  PetscCall(PetscSFDestroy(&r->ghosts));
  r->capacity = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- levels that all ranks hold ---- */

/* Rows of several matrices one after the other: of each their number, lengths and columns; values */
typedef struct {
  PetscInt     nindex, nvalue, index_capacity, value_capacity, *index;
  PetscScalar *value;
} Packed;

static PetscErrorCode pack(Mat A, Packed *p)
{
  Source   f;
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(open_source(A, &f));
  n = count_entries(&f);
  PetscCall(ArrayReserve(p->nindex + 1 + f.n + n, &p->index_capacity, &p->index, sizeof(*p->index), NULL));
  PetscCall(ArrayReserve(p->nvalue + n, &p->value_capacity, &p->value, sizeof(*p->value), NULL));
  p->index[p->nindex++] = f.n;
  for (PetscInt i = 0; i < f.n; i++)
    p->index[p->nindex++] = f.start[0][i + 1] - f.start[0][i] + (f.start[1] ? f.start[1][i + 1] - f.start[1][i] : 0);
  for (PetscInt i = 0; i < f.n; i++)
    for (int block = 0; block < 2 && f.start[block]; block++)
      for (PetscInt k = f.start[block][i]; k < f.start[block][i + 1]; k++) {
        p->index[p->nindex++] = block ? f.ghost[f.col[block][k]] : f.first + f.col[block][k];
        p->value[p->nvalue++] = f.value[block][k];
      }
  PetscCall(close_source(&f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What all ranks have packed, rank after rank; at [2][ranks]: where each one's indices and values begin */
static PetscErrorCode gather(MPI_Comm comm, Packed *p, PetscInt **at)
{
  PetscMPIInt size, mine[2], *count, *n, *start;
  Packed      all = {0};

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscMPIIntCast(p->nindex, &mine[0]));
  PetscCall(PetscMPIIntCast(p->nvalue, &mine[1]));
  PetscCall(PetscMalloc1(2 * size, at));
  PetscCall(PetscMalloc3(2 * size, &count, size, &n, size, &start));
  PetscCallMPI(MPI_Allgather(mine, 2, MPI_INT, count, 2, MPI_INT, comm));
  for (PetscMPIInt r = 0; r < size; r++) {
    (*at)[r]        = all.nindex;
    (*at)[size + r] = all.nvalue;
    all.nindex += count[2 * r];
    all.nvalue += count[2 * r + 1];
  }
  PetscCall(PetscMalloc1(all.nindex, &all.index));
  PetscCall(PetscMalloc1(all.nvalue, &all.value));
  for (int k = 0; k < 2; k++) {
    for (PetscMPIInt r = 0; r < size; r++) {
      n[r] = count[2 * r + k];
      PetscCall(PetscMPIIntCast((*at)[k * size + r], &start[r]));
    }
    if (k) PetscCallMPI(MPI_Allgatherv(p->value, mine[1], MPIU_SCALAR, all.value, n, start, MPIU_SCALAR, comm));
    else PetscCallMPI(MPI_Allgatherv(p->index, mine[0], MPIU_INT, all.index, n, start, MPIU_INT, comm));
  }
  PetscCall(PetscFree3(count, n, start));
  PetscCall(PetscFree(p->index));
  PetscCall(PetscFree(p->value));
  *p = all;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The next matrix of all ranks as one; the caller frees its three arrays */
static PetscErrorCode unpack(MPI_Comm comm, const Packed *p, PetscInt at[], Source *f)
{
  PetscMPIInt  size;
  PetscInt     n = 0, e = 0, *start, *col;
  PetscScalar *value;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(f, 1));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  for (PetscMPIInt r = 0; r < size; r++) {
    const PetscInt *index = p->index + at[r];

    f->n += index[0];
    for (PetscInt i = 0; i < index[0]; i++) e += index[1 + i];
  }
  PetscCall(PetscMalloc1(f->n + 1, &start));
  PetscCall(PetscMalloc1(e, &col));
  PetscCall(PetscMalloc1(e, &value));
  start[0] = e = 0;
  for (PetscMPIInt r = 0; r < size; r++) {
    const PetscInt *index = p->index + at[r], m = index[0];
    PetscInt        k = 0;

    for (PetscInt i = 0; i < m; i++, n++) start[n + 1] = start[n] + index[1 + i];
    for (; e < start[n]; e++, k++) {
      col[e]   = index[1 + m + k];
      value[e] = p->value[at[size + r] + k];
    }
    at[r] += 1 + m + k;
    at[size + r] += k;
  }
  f->own      = f->n;
  f->start[0] = start;
  f->col[0]   = col;
  f->value[0] = value;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode free_source(Source *f)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(f->start[0]));
  PetscCall(PetscFree(f->col[0]));
  PetscCall(PetscFree(f->value[0]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode VLevelsGather(VCycle s, PetscInt n, Mat A[], Mat P[], VLevel level[])
{
  Packed    all = {0};
  PetscInt *at;

  PetscFunctionBeginUser;
  for (PetscInt k = n - 1; k >= 0; k--) {
    PetscCall(pack(A[k], &all));
    if (k) PetscCall(pack(P[k - 1], &all));
  }
  PetscCall(gather(s->comm, &all, &at));
  for (PetscInt k = 0; k < n; k++) {
    VRows *to = &level[k].P;
    Source f;

    level[k].replicated = PETSC_TRUE;
    PetscCall(unpack(s->comm, &all, at, &f));
    PetscCall(take_square(&f, 1 / s->unit, &level[k]));
    PetscCall(free_source(&f));
    if (k == n - 1) break;
    PetscCall(unpack(s->comm, &all, at, &f));
    PetscCall(reserve(to, f.n, f.n + 1, count_entries(&f)));
    PetscCall(MatGetSize(A[n - 2 - k], &to->own, NULL));
    PetscCall(PetscArraycpy(to->start, f.start[0], f.n + 1));
    for (PetscInt e = 0; e < f.start[0][f.n]; e++) put(to, e, f.col[0][e], f.value[0][e]);
    PetscCall(free_source(&f));
  }
  PetscCall(PetscFree(at));
  PetscCall(PetscFree(all.index));
  PetscCall(PetscFree(all.value));
  PetscFunctionReturn(PETSC_SUCCESS);
}
