/* SolidBlock: the rigid bodies that share cells with solids. Their velocities belong to the block: a node that is tied
   to a body moves with it, and what is stiff there is stiff for the body.

   M_r^{-1} = diag(weight) + [-F R; 1] M^{-1} [-F R; 1]^T of system.h stays as it is at the nodes outside of the block;
   inside, with the bodies' rows, A stands for it, less what the nodes outside put there, (F R)^T weight^{-1} F R. */
#include "compat.h"
#include "solidblockimpl.h"
#include "base/project.h"

static PetscReal free_fraction(FlowSolver fs, PetscInt slot)
{
  return 1 - fs->body.fraction[slot / fs->loc->dim];
}

PetscErrorCode SolidBlockFindBodies(FlowSolver fs, const PetscReal at[])
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  const ConstraintRows *r = &c->relative_rows;
  SolidBlock            b = fs->solid;
  PetscInt             *local, *own;
  PetscReal            *row, any = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(fs->loc->nnode, &b->inside, c->nbodies, &b->with));
  for (PetscInt i = 0; i < fs->loc->nnode; i++) b->inside[i] = (PetscBool)(at[i] != 0);
  if (!c->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc3(c->nlocal, &local, c->count, &own, c->count, &row));
  for (PetscInt j = 0; j < r->n; j++)
    if (r->body[j] >= 0 && b->inside[r->slot[j] / fs->loc->dim]) local[c->local_index[r->body[j]]] = 1;
  PetscCall(ConstraintSumCounts(fs->constraint, local, own));
  for (PetscInt k = 0; k < c->nown; k++) row[k] = own[k] > 0;
  for (PetscInt k = 0; k < c->nown; k++) any = PetscMax(any, row[k]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &any, 1, MPIU_REAL, MPIU_MAX, fs->comm));
  if (any > 0) PetscCall(VecDuplicate(fs->vec.t_u, &b->t));
  PetscCall(ConstraintCopyRows(fs->constraint, 1, row, b->with));
  PetscCall(PetscFree3(local, own, row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscInt SolidBlockListBodies(FlowSolver fs, PetscInt start, PetscInt slot[])
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  PetscInt              n = 0;

  for (PetscInt k = 0; k < c->nown; k++)
    for (PetscInt s = 0; s < fs->nr && fs->solid->with[c->own[k]] > 0; s++)
      slot[n++] = start + fs->nodal + k * fs->nr + s;
  return n;
}

void SolidBlockMarkMoved(FlowSolver fs, PetscBool wanted[])
{
  const ConstraintView *c       = ConstraintGetView(fs->constraint);
  const ConstraintRows *rows[2] = {&c->inert, &c->relative_rows};

  for (PetscInt i = 0; i < 2; i++)
    for (PetscInt j = 0; j < rows[i]->n; j++)
      if (rows[i]->body[j] >= 0 && fs->solid->with[rows[i]->body[j]] > 0)
        wanted[rows[i]->slot[j] / fs->loc->dim] = PETSC_TRUE;
}

/* Is row j one of the nodes outside, of a body in the block? */
static PetscBool is_outside(FlowSolver fs, const ConstraintRows *r, PetscInt j)
{
  return (PetscBool)(r->body[j] >= 0 && fs->solid->with[r->body[j]] > 0 &&
                     !fs->solid->inside[r->slot[j] / fs->loc->dim]);
}

PetscErrorCode SolidBlockReduceBodies(FlowSolver fs, Mat A)
{
  const ConstraintView *c  = ConstraintGetView(fs->constraint);
  const ConstraintRows *r  = &c->relative_rows;
  const PetscInt        nr = fs->nr, nn = nr * nr;
  PetscReal            *sum, *own;
  PetscInt              start;

  PetscFunctionBeginUser;
  if (!c->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatGetOwnershipRange(A, &start, NULL));
  PetscCall(PetscCalloc2(c->nbodies * nn, &sum, c->count * nn, &own));
  for (PetscInt j = 0; j < r->n; j++) {
    const PetscReal w = fs->weight[r->slot[j]];

    if (!is_outside(fs, r, j) || w <= 0) continue;
    for (PetscInt e = 0; e < nn; e++)
      sum[r->body[j] * nn + e] += PetscSqr(free_fraction(fs, r->slot[j])) * fs->step.scale / w *
                                  r->coef[j * nr + e / nr] * r->coef[j * nr + e % nr];
  }
  PetscCall(ConstraintSumRows(fs->constraint, nn, sum, own));
  for (PetscInt k = 0; k < c->nown; k++)
    for (PetscInt e = 0; e < nn && fs->solid->with[c->own[k]] > 0; e++) {
      const PetscInt row = start + fs->nodal + k * nr;

      if (own[k * nn + e] == 0) continue;
      PetscCall(MatSetValue(A, row + e / nr, row + e % nr,
                            -own[k * nn + e] * ConstraintSlotUnit(c, c->own[k], e / nr) *
                              ConstraintSlotUnit(c, c->own[k], e % nr),
                            ADD_VALUES));
    }
  PetscCall(PetscFree2(sum, own));
  PetscCall(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidBlockCoupleBodies(FlowSolver fs, IS slots, Mat *X)
{
  const ConstraintView *c  = ConstraintGetView(fs->constraint);
  const ConstraintRows *r  = &c->relative_rows;
  const PetscInt        nr = fs->nr;
  PetscInt              start, *column;
  Mat                   T, Ts, out;

  PetscFunctionBeginUser;
  if (!c->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(c->nbodies, &column));
  PetscCall(ConstraintGetRigidColumns(fs->constraint, column));
  PetscCall(MatCreateAIJ(fs->comm, fs->nur, fs->nur, PETSC_DETERMINE, PETSC_DETERMINE, nr + 1, NULL, nr, NULL, &T));
  PetscCall(MatGetOwnershipRange(T, &start, NULL));
  for (PetscInt i = start; i < start + fs->nur; i++) PetscCall(MatSetValue(T, i, i, 1, INSERT_VALUES));
  for (PetscInt j = 0; j < r->n; j++)
    for (PetscInt s = 0; s < nr && is_outside(fs, r, j); s++)
      PetscCall(MatSetValue(T, start + r->slot[j], column[r->body[j]] + s,
                            free_fraction(fs, r->slot[j]) * r->coef[j * nr + s] * ConstraintSlotUnit(c, r->body[j], s),
                            INSERT_VALUES));
  PetscCall(MatAssemblyBegin(T, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(T, MAT_FINAL_ASSEMBLY));
  PetscCall(MatCreateSubMatrix(T, slots, slots, MAT_INITIAL_MATRIX, &Ts));
  PetscCall(MatrixProject(*X, Ts, &out));
  PetscCall(MatDestroy(&Ts));
  PetscCall(MatDestroy(&T));
  PetscCall(MatDestroy(X));
  *X = out;
  PetscCall(PetscFree(column));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidBlockTakeBodies(FlowSolver fs, Vec x, PetscReal rigid[], Vec *from)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  SolidBlock            b = fs->solid;
  PetscReal            *t;

  PetscFunctionBeginUser;
  *from = x;
  if (!b->t) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecCopy(x, b->t));
  PetscCall(VecGetArray(b->t, &t));
  for (PetscInt i = 0; i < c->nown * fs->nr; i++) {
    if (b->with[c->own[i / fs->nr]] == 0) continue;
    t[fs->nodal + i] = rigid[i];
    rigid[i]         = 0;
  }
  PetscCall(VecRestoreArray(b->t, &t));
  *from = b->t;
  PetscFunctionReturn(PETSC_SUCCESS);
}
