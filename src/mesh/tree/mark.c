/* Mark: see mesh/mark.h. */
#include "compat.h"
#include "marks.h"
#include "../impl.h"
#include "base/sparse.h"
#include "base/array.h"

static PetscErrorCode forget_cells(MeshMarks m)
{
  PetscFunctionBeginUser;
  for (PetscInt l = 0; l <= LEAVES_MAX_LEVELS; l++) {
    PetscCall(KeysDestroy(&m->refined[l]));
    PetscCall(PetscFree(m->cell[l].x));
    m->cell[l] = (MarkedCells){0};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshMarksDestroy(MeshMarks *marks)
{
  PetscFunctionBeginUser;
  if (!*marks) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(forget_cells(*marks));
  PetscCall(PetscFree((*marks)->own));
  PetscCall(PetscFree(*marks));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The cell of a level that holds the finest cell x */
static PetscErrorCode add_cell(MeshMarks m, const Leaves *t, PetscInt level, const PetscInt x[3])
{
  const PetscInt w    = LeavesWidth(t, level);
  MarkedCells   *list = &m->cell[level];
  PetscInt       y[3] = {0, 0, 0}, at;

  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < t->dim; d++) y[d] = x[d] & ~(w - 1);
  PetscCall(KeysAdd(&m->refined[level], LeavesKey(t, y), list->n, &at));
  if (at < list->n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ArrayReserve(list->n + 1, &list->capacity, &list->x, sizeof(*list->x), NULL));
  PetscCall(PetscArraycpy(list->x[list->n++], y, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* MarkedCells around one of a level exist if their parents are refined */
static PetscErrorCode add_parents_around(MeshMarks m, const Leaves *t, PetscInt level, const PetscInt x[3])
{
  const PetscInt w = LeavesWidth(t, level);

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < (t->dim == 2 ? 9 : 27); i++) {
    const PetscInt step[3] = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
    PetscInt       y[3]    = {0, 0, 0};

    for (PetscInt d = 0; d < t->dim; d++) y[d] = x[d] + w * step[d];
    if (LeavesWrap(t, y)) PetscCall(add_cell(m, t, level - 1, y));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshMarksGrow(Mesh mesh, const PetscBool mark[], MeshMarks *marks)
{
  const Leaves *t        = mesh->leaves;
  PetscInt      capacity = 0;
  MeshMarks     m;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&m));
  for (PetscInt c = 0; c < t->nleaf; c++) {
    const Leaf    *leaf  = t->leaf + c;
    const PetscInt level = mark[c] && leaf->level < t->levels ? leaf->level : leaf->level - 1;

    if (level < 0) continue; /* parents of parents follow from the closure */
    PetscCall(ArrayReserve(m->n + 1, &capacity, &m->own, sizeof(*m->own), NULL));
    PetscCall(PetscArraycpy(m->own[m->n], leaf->x, 3));
    m->own[m->n++][3] = level;
  }
  *marks = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Refined cells of other ranks and of this one that are near to its regions: cell [*n] */
static PetscErrorCode exchange_cells(MeshMarks m, const Leaves *t, RankBoxes regions, PetscReal reach, PetscInt *n,
                                     PetscInt (**cell)[MARKS_WIDTH])
{
  PetscMPIInt *to, *from, tag;
  PetscInt     nout, *which, (*out)[MARKS_WIDTH];
  PetscReal(*x)[3], *far;
  MPI_Comm comm;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(m->n, &x, m->n, &far));
  for (PetscInt i = 0; i < m->n; i++) {
    PetscInt half[3];

    for (PetscInt d = 0; d < 3; d++) half[d] = 2 * m->own[i][d] + 1;
    PetscCall(LeavesPosition(t, half, x[i]));
    far[i] = reach;
  }
  PetscCall(RankBoxesSend(regions, m->n, (const PetscReal(*)[3])x, far, &nout, &to, &which));
  PetscCall(PetscFree2(x, far));
  PetscCall(PetscMalloc1(nout, &out));
  for (PetscInt i = 0; i < nout; i++) PetscCall(PetscArraycpy(out[i], m->own[which[i]], MARKS_WIDTH));
  PetscCall(PetscCommDuplicate(t->comm, &comm, &tag));
  PetscCall(SparseExchange(comm, tag, nout, to, sizeof(*out), out, n, cell, &from));
  PetscCall(PetscCommDestroy(&comm));
  PetscCall(PetscFree(to));
  PetscCall(PetscFree(from));
  PetscCall(PetscFree(which));
  PetscCall(PetscFree(out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MarksLook(MeshMarks m, const Leaves *t, RankBoxes regions, PetscReal reach)
{
  PetscInt n, (*cell)[MARKS_WIDTH];

  PetscFunctionBeginUser;
  PetscCall(forget_cells(m));
  PetscCall(exchange_cells(m, t, regions, reach, &n, &cell));
  for (PetscInt i = 0; i < n; i++) PetscCall(add_cell(m, t, cell[i][3], cell[i]));
  for (PetscInt level = t->levels; level > 0; level--)
    for (PetscInt i = 0; i < m->cell[level].n; i++) {
      const PetscInt x[3] = {m->cell[level].x[i][0], m->cell[level].x[i][1], m->cell[level].x[i][2]};

      PetscCall(add_parents_around(m, t, level, x));
    }
  PetscCall(PetscFree(cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshGetLevel(Mesh mesh, PetscInt c, PetscInt *level)
{
  PetscFunctionBeginUser;
  *level = mesh->leaves ? mesh->leaves->leaf[c].level : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}
