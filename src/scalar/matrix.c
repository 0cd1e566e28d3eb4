/* Scalars, the matrix of a step. Rows of own nodes are filled from own and ghost cells, so that nothing is sent: where
   an entry of a cell stands in its row is kept, in two bytes, from 0 on among own columns, from HALF on among those of
   other ranks. */
#include "compat.h"
#include "impl.h"
#include "base/array.h"
#include "mesh/pattern.h"

#define HALF  0x8000
#define OTHER 0xffff /* the row is another rank's */

/* Position of a global column among the own or the other ones of a sorted row */
static unsigned short find_position(const MeshLocal *l, PetscInt n, const PetscInt column[], PetscInt wanted)
{
  const PetscInt  first = l->node_start, last = l->node_start + l->nnode;
  const PetscBool own = (PetscBool)(wanted >= first && wanted < last);
  PetscInt        at  = 0;

  for (PetscInt k = 0; k < n && column[k] != wanted; k++) at += (column[k] >= first && column[k] < last) == own;
  return (unsigned short)(own ? at : HALF + at);
}

PetscErrorCode ScalarsFindPattern(Scalars all)
{
  const MeshLocal *l  = all->loc;
  const PetscInt   nb = l->nb;

  PetscFunctionBeginUser;
  PetscCall(MeshFindPattern(all->mesh, &all->row_start, &all->column));
  for (PetscInt i = 0; i < l->nnode; i++)
    PetscCheck(all->row_start[i + 1] - all->row_start[i] < HALF, PETSC_COMM_SELF, PETSC_ERR_SUP,
               "A node has %" PetscInt_FMT " neighbours, at most %d are possible",
               all->row_start[i + 1] - all->row_start[i], HALF - 1);
  PetscCall(ArrayCheckSize(all->comm, "the matrix of a scalar", (PetscReal)l->ncell_all * nb * nb));
  PetscCall(PetscMalloc1(l->ncell_all * nb * nb, &all->entry));
  for (PetscInt c = 0; c < l->ncell_all; c++)
    for (PetscInt i = 0; i < nb; i++) {
      const PetscInt row = l->cell_node[c * nb + i];

      for (PetscInt j = 0; j < nb; j++)
        all->entry[(c * nb + i) * nb + j] = row >= l->nnode
                                            ? OTHER
                                            : find_position(l, all->row_start[row + 1] - all->row_start[row],
                                                            all->column + all->row_start[row],
                                                            l->node_global[l->cell_node[c * nb + j]]);
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCreateMatrix(Scalars all, Scalar *s)
{
  const PetscInt n = all->loc->nnode;

  PetscFunctionBeginUser;
  PetscCall(MatCreate(all->comm, &s->A));
  PetscCall(MatSetSizes(s->A, n, n, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetType(s->A, MATAIJ));
  PetscCall(MatSeqAIJSetPreallocationCSR(s->A, all->row_start, all->column, NULL));
  PetscCall(MatMPIAIJSetPreallocationCSR(s->A, all->row_start, all->column, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

typedef struct {
  const PetscInt *start[2];
  PetscReal      *value[2];
} Values;

/* Of own cell c, for measure.c: with test functions that add up to 1 diffusion is none */
static void note_sums(Scalars all, Scalar *s, PetscInt c, const ScalarCell *cell)
{
  const PetscInt nb = all->loc->nb, nbp = all->element.nbp, nq = all->loc->dim == 2 ? 3 : 9;
  PetscReal      M[MESH_MAX_NB] = {0}, L[MESH_MAX_NB] = {0}, *sums = s->sums + 2 * c * nb;

  s->has_sums[c] = (PetscBool)(s->decay == 0 && !s->cells.decay && !s->input.slope && !s->cell_side &&
                               (!s->cells.sample || s->cells.sample[c] < 0));
  for (PetscInt i = all->cell_face[c]; i >= 0; i = all->next_face[i])
    for (PetscInt q = 0; q < nq && s->input.face; q++)
      if (s->input.face[(i * nq + q) * 2 + 1] != 0) s->has_sums[c] = PETSC_FALSE;
  if (!s->has_sums[c]) return;
  for (PetscInt i = 0; i < nb; i++)
    for (PetscInt j = 0; j < nb; j++) {
      M[j] += cell->M[i * nbp + j];
      L[j] += cell->A[i * nbp + j];
    }
  for (PetscInt j = 0; j < nb; j++) {
    sums[j]      = M[j];
    sums[nb + j] = s->w ? (L[j] - all->step.ct * M[j]) / all->step.theta : 0;
  }
}

static void add_cell(Scalars all, Scalar *s, PetscInt c, const PetscReal A[], const PetscReal f[], const Values *v)
{
  const MeshLocal *l  = all->loc;
  const PetscInt   nb = l->nb, nbp = all->element.nbp, *node = l->cell_node + c * nb;

  for (PetscInt i = 0; i < nb; i++) {
    const unsigned short *entry = all->entry + (c * nb + i) * nb;
    PetscReal            *own, *other;

    if (node[i] >= l->nnode || s->owner[node[i]] >= 0) continue;
    own   = v->value[0] + v->start[0][node[i]];
    other = v->value[1] ? v->value[1] + v->start[1][node[i]] : NULL;
    s->rhs[node[i]] += f[i];
    for (PetscInt j = 0; j < nb; j++) {
      if (entry[j] < HALF) own[entry[j]] += A[i * nbp + j];
      else other[entry[j] - HALF] += A[i * nbp + j];
    }
  }
}

/* Rows of fixed nodes, and of those in no cell of the problem: x = what it is */
static void set_fixed(Scalars all, const Scalar *s, const Values *v)
{
  const MeshLocal *l = all->loc;

  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscInt c = l->node_cell[l->node_cell_ptr[i]];
    PetscInt       j = 0;

    if (ScalarIsFree(s, i)) continue;
    while (l->cell_node[c * l->nb + j] != i) j++;
    v->value[0][v->start[0][i] + all->entry[(c * l->nb + j) * l->nb + j]] = 1;
    s->rhs[i]                                                             = s->x[i];
  }
}

PetscErrorCode ScalarAssemble(Scalars all, Scalar *s)
{
  const MeshLocal *l        = all->loc;
  Mat              block[2] = {s->A, NULL};
  Values           v        = {{NULL, NULL}, {NULL, NULL}};
  PetscInt         n;
  PetscBool        seq, done;

  PetscFunctionBeginUser;
  PetscCall(PetscObjectTypeCompare((PetscObject)s->A, MATSEQAIJ, &seq));
  if (!seq) PetscCall(MatMPIAIJGetSeqAIJ(s->A, &block[0], &block[1], NULL));
  PetscCall(MatZeroEntries(s->A));
  PetscCall(PetscArrayzero(s->rhs, l->nnode_all));
  PetscCall(PetscArrayzero(s->seen, l->nnode_all));
  for (PetscInt k = 0; k < 2 && block[k]; k++) {
    PetscCall(MatGetRowIJ(block[k], 0, PETSC_FALSE, PETSC_FALSE, &n, &v.start[k], NULL, &done));
    PetscCall(MatSeqAIJGetArray(block[k], &v.value[k]));
  }
  if (!s->sums) PetscCall(PetscMalloc2(2 * l->ncell * l->nb, &s->sums, l->ncell, &s->has_sums));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    ScalarCell cell;

    if (!ScalarCellIsActive(s, c)) continue;
    PetscCall(ScalarCellSet(all, s, c, &cell));
    if (c < l->ncell) note_sums(all, s, c, &cell);
    MeshCellMatrix(l, c, 1, all->element.nbp, cell.A);
    MeshCellScatter(l, c, 1, cell.f);
    add_cell(all, s, c, cell.A, cell.f, &v);
    for (PetscInt j = 0; j < l->nb; j++) s->seen[l->cell_node[c * l->nb + j]] = PETSC_TRUE;
  }
  set_fixed(all, s, &v);
  for (PetscInt k = 0; k < 2 && block[k]; k++) {
    PetscCall(MatSeqAIJRestoreArray(block[k], &v.value[k]));
    PetscCall(MatRestoreRowIJ(block[k], 0, PETSC_FALSE, PETSC_FALSE, &n, &v.start[k], NULL, &done));
  }
  PetscCall(MatAssemblyBegin(s->A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(s->A, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}
