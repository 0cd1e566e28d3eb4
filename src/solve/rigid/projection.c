/* Constraint: applications of P and its transpose (see projection.h). Rigid velocities travel between the rank that
   holds their slots and the ranks whose nodes follow them through a PetscSF. */
#include "compat.h"
#include "projection.h"
#include "base/inline.h"
#include "base/rowtype.h"

PetscErrorCode ConstraintFetchRigid(Constraint c, const PetscReal rigid[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscSFBcastBegin(c->rigid_sf, c->rigid_type, rigid, c->local_rigid, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(c->rigid_sf, c->rigid_type, rigid, c->local_rigid, MPI_REPLACE));
  for (PetscInt e = 0; e < c->nlocal * c->nr; e++) c->local_rigid[e] *= ConstraintSlotUnit(c, c->local_list[e / c->nr], e % c->nr);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintDeliverRigid(Constraint c, const PetscReal local[], PetscReal rigid[])
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < c->nlocal * c->nr; e++) c->packed[e] = ConstraintSlotUnit(c, c->local_list[e / c->nr], e % c->nr) * local[e];
  PetscCall(PetscSFReduceBegin(c->rigid_sf, c->rigid_type, c->packed, rigid, MPIU_SUM));
  PetscCall(PetscSFReduceEnd(c->rigid_sf, c->rigid_type, c->packed, rigid, MPIU_SUM));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSumRows(Constraint c, PetscInt n, const PetscReal value[], PetscReal own[])
{
  PetscReal   *row;
  MPI_Datatype type;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->nlocal * n, &row));
  for (PetscInt e = 0; e < c->nlocal * n; e++) row[e] = value[c->local_list[e / n] * n + e % n];
  PetscCall(PetscArrayzero(own, c->nown * n));
  PetscCall(RowTypeCreate(n, &type));
  PetscCall(PetscSFReduceBegin(c->rigid_sf, type, row, own, MPIU_SUM));
  PetscCall(PetscSFReduceEnd(c->rigid_sf, type, row, own, MPIU_SUM));
  PetscCall(RowTypeDestroy(&type));
  PetscCall(PetscFree(row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintCopyRows(Constraint c, PetscInt n, const PetscReal own[], PetscReal value[])
{
  PetscReal   *row;
  MPI_Datatype type;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->nlocal * n, &row));
  PetscCall(RowTypeCreate(n, &type));
  PetscCall(PetscSFBcastBegin(c->rigid_sf, type, own, row, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(c->rigid_sf, type, own, row, MPI_REPLACE));
  for (PetscInt e = 0; e < c->nown * n; e++) value[c->own[e / n] * n + e % n] = own[e];
  for (PetscInt e = 0; e < c->nlocal * n; e++) value[c->local_list[e / n] * n + e % n] = row[e];
  PetscCall(RowTypeDestroy(&type));
  PetscCall(PetscFree(row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* nr as a constant */
INLINE void expand(const PetscInt nr, Constraint c, const PetscReal *restrict rigid, PetscReal *restrict v, PetscReal *restrict saved)
{
  for (PetscInt j = 0; j < c->ninert; j++) {
    PetscReal value = 0;

    if (c->body[j] >= 0)
      for (PetscInt s = 0; s < nr; s++) value += c->coef[j * nr + s] * rigid[c->local_body[j] * nr + s];
    if (saved) saved[j] = v[c->slot[j]];
    v[c->slot[j]] = value;
  }
  for (PetscInt j = 0; j < c->nfollow; j++) {
    const PetscReal *U    = rigid + c->local_index[c->follow_body[j]] * nr;
    const PetscInt   slot = c->follow_slot[j];
    PetscReal        sum  = v[slot];

    if (saved) saved[c->ninert + j] = sum;
    for (PetscInt s = 0; s < nr; s++) sum += c->follow_coef[j * nr + s] * U[s];
    v[slot] = sum;
  }
}

PetscErrorCode ConstraintExpandInPlace(Constraint c, const PetscReal rigid[], PetscReal v[], PetscReal saved[])
{
  PetscFunctionBeginUser;
  PetscCall(ConstraintFetchRigid(c, rigid));
  if (c->nr == 3) expand(3, c, c->local_rigid, v, saved);
  else expand(6, c, c->local_rigid, v, saved);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintPutBack(Constraint c, const PetscReal saved[], PetscReal v[])
{
  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < c->ninert; j++) v[c->slot[j]] = saved[j];
  for (PetscInt j = 0; j < c->nfollow; j++) v[c->follow_slot[j]] = saved[c->ninert + j];
  PetscFunctionReturn(PETSC_SUCCESS);
}

INLINE void reduce(const PetscInt nr, Constraint c, PetscReal *restrict r, PetscReal *restrict rigid)
{
  for (PetscInt j = 0; j < c->ninert; j++) {
    const PetscReal value = r[c->slot[j]];

    r[c->slot[j]] = 0;
    if (c->body[j] < 0) continue;
    for (PetscInt s = 0; s < nr; s++) rigid[c->local_body[j] * nr + s] += c->coef[j * nr + s] * value;
  }
  for (PetscInt j = 0; j < c->nfollow; j++) {
    const PetscReal value = r[c->follow_slot[j]];
    PetscReal      *sum   = rigid + c->local_index[c->follow_body[j]] * nr;

    for (PetscInt s = 0; s < nr; s++) sum[s] += c->follow_coef[j * nr + s] * value;
  }
}

PetscErrorCode ConstraintReduceInPlace(Constraint c, PetscReal r[], PetscReal rigid[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(c->local_rigid, c->nlocal * c->nr));
  if (c->nr == 3) reduce(3, c, r, c->local_rigid);
  else reduce(6, c, r, c->local_rigid);
  PetscCall(ConstraintDeliverRigid(c, c->local_rigid, rigid));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal known_of(Constraint c, PetscInt slot)
{
  return ConstraintKnown(c, slot / c->loc->dim, slot % c->loc->dim);
}

PetscErrorCode ConstraintExpand(Constraint c, Vec ur, PetscReal u[])
{
  const MeshLocal *l = c->loc;
  const PetscInt   n = l->nnode * l->dim;
  const PetscReal *x;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(ur, &x));
  PetscCall(PetscArraycpy(u, x, n));
  PetscCall(ConstraintExpandInPlace(c, x + n, u, NULL));
  PetscCall(VecRestoreArrayRead(ur, &x));
  for (PetscInt j = 0; j < c->ninert; j++) u[c->slot[j]] += known_of(c, c->slot[j]);
  for (PetscInt j = 0; j < c->nfollow; j++) u[c->follow_slot[j]] += known_of(c, c->follow_slot[j]);
  PetscCall(MeshSyncNodes(c->mesh, l->dim, u));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintRestrict(Constraint c, const PetscReal u[], const PetscReal U[], Vec ur)
{
  const PetscInt n = c->loc->nnode * c->loc->dim;
  PetscReal     *x;

  PetscFunctionBeginUser;
  PetscCall(VecGetArray(ur, &x));
  PetscCall(PetscArraycpy(x, u, n));
  for (PetscInt j = 0; j < c->ninert; j++) x[c->slot[j]] = 0;
  for (PetscInt j = 0; j < c->nfollow; j++) {
    x[c->follow_slot[j]] -= known_of(c, c->follow_slot[j]);
    for (PetscInt s = 0; s < c->nr; s++) x[c->follow_slot[j]] -= c->follow_coef[j * c->nr + s] * U[c->follow_body[j] * c->nr + s];
  }
  PetscCall(PetscArrayzero(x + n, c->count * c->nr));
  for (PetscInt i = 0; i < c->nown * c->nr; i++) {
    const PetscInt k = c->own[i / c->nr], s = i % c->nr;

    x[n + i] = (c->unknown[k] >> s) & 1 ? U[k * c->nr + s] / ConstraintSlotUnit(c, k, s) : 0;
  }
  PetscCall(VecRestoreArray(ur, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void take_unknown(Constraint c, const PetscReal from[], PetscReal U[])
{
  for (PetscInt i = 0; i < c->nbodies * c->nr; i++)
    if ((c->unknown[i / c->nr] >> (i % c->nr)) & 1) U[i] = from[i] * ConstraintSlotUnit(c, i / c->nr, i % c->nr);
}

/* From the slots to the ranks that know their bodies */
static PetscErrorCode gather_known(Constraint c, Vec ur, PetscReal U[])
{
  const PetscReal *x;
  PetscReal       *known;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->nbodies * c->nr, &known));
  PetscCall(VecGetArrayRead(ur, &x));
  PetscCall(PetscSFBcastBegin(c->known_sf, c->rigid_type, x + c->loc->nnode * c->loc->dim, known, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(c->known_sf, c->rigid_type, x + c->loc->nnode * c->loc->dim, known, MPI_REPLACE));
  PetscCall(VecRestoreArrayRead(ur, &x));
  take_unknown(c, known, U);
  PetscCall(PetscFree(known));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From the slots to the shares by number, which are in the order of all */
PetscErrorCode ConstraintGatherRigid(Constraint c, Vec ur, PetscReal U[])
{
  const PetscInt   n = c->loc->nnode * c->loc->dim, own = c->numbers->n * c->nr;
  const PetscReal *x;
  PetscReal       *all, *mine;
  PetscMPIInt      size, rank, *counts, *starts;
  PetscSF          sf;

  PetscFunctionBeginUser;
  if (c->slot_of) {
    PetscCall(gather_known(c, ur, U));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCall(PetscMalloc4(c->nbodies * c->nr, &all, own, &mine, size, &counts, size, &starts));
  for (PetscMPIInt r = 0; r < size; r++) {
    PetscCall(PetscMPIIntCast(c->numbers->range[r] * c->nr, &starts[r]));
    PetscCall(PetscMPIIntCast((c->numbers->range[r + 1] - c->numbers->range[r]) * c->nr, &counts[r]));
  }
  PetscCall(PetscSFCreate(PETSC_COMM_WORLD, &sf));
  PetscCall(PetscSFSetGraphLayout(sf, c->numbers, c->nown, NULL, PETSC_OWN_POINTER, c->own));
  PetscCall(VecGetArrayRead(ur, &x));
  PetscCall(PetscSFReduceBegin(sf, c->rigid_type, x + n, mine, MPI_REPLACE));
  PetscCall(PetscSFReduceEnd(sf, c->rigid_type, x + n, mine, MPI_REPLACE));
  PetscCall(VecRestoreArrayRead(ur, &x));
  PetscCall(PetscSFDestroy(&sf));
  PetscCallMPI(MPI_Allgatherv(mine, counts[rank], MPIU_REAL, all, counts, starts, MPIU_REAL, PETSC_COMM_WORLD));
  take_unknown(c, all, U);
  PetscCall(PetscFree4(all, mine, counts, starts));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Every rank stores its slots behind its nodal ones. */
PetscErrorCode ConstraintGetRigidColumns(Constraint c, PetscInt column[])
{
  PetscInt    total;
  PetscLayout layout;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetSizes(c, NULL, &total));
  PetscCall(PetscLayoutCreateFromSizes(PETSC_COMM_WORLD, total, PETSC_DETERMINE, 1, &layout));
  for (PetscInt l = 0; l < c->nlocal; l++) {
    const PetscInt rank = c->local_slot[l] / c->count;

    column[c->local_list[l]] = layout->range[rank + 1] - ((rank + 1) * c->count - c->local_slot[l]) * c->nr;
  }
  PetscCall(PetscLayoutDestroy(&layout));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintCreateMat(Constraint c, Mat *P)
{
  PetscInt nodal, total, row0, col0, *column, j = 0, f = 0;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetSizes(c, &nodal, &total));
  PetscCall(PetscMalloc1(c->nbodies, &column));
  PetscCall(ConstraintGetRigidColumns(c, column));
  PetscCall(MatCreateAIJ(PETSC_COMM_WORLD, nodal, total, PETSC_DETERMINE, PETSC_DETERMINE, c->nr + 1, NULL, c->nr, NULL, P));
  PetscCall(MatGetOwnershipRange(*P, &row0, NULL));
  PetscCall(MatGetOwnershipRangeColumn(*P, &col0, NULL));
  for (PetscInt i = 0; i < nodal; i++) {
    if (j < c->ninert && c->slot[j] == i) {
      if (c->body[j] >= 0)
        for (PetscInt s = 0; s < c->nr; s++)
          if (c->coef[j * c->nr + s] != 0)
            PetscCall(
              MatSetValue(*P, row0 + i, column[c->body[j]] + s, ConstraintSlotUnit(c, c->body[j], s) * c->coef[j * c->nr + s], INSERT_VALUES));
      j++;
    } else PetscCall(MatSetValue(*P, row0 + i, col0 + i, 1, INSERT_VALUES));
    if (f < c->nfollow && c->follow_slot[f] == i) {
      for (PetscInt s = 0; s < c->nr; s++)
        if (c->follow_coef[f * c->nr + s] != 0)
          PetscCall(MatSetValue(*P, row0 + i, column[c->follow_body[f]] + s,
                                ConstraintSlotUnit(c, c->follow_body[f], s) * c->follow_coef[f * c->nr + s], INSERT_VALUES));
      f++;
    }
  }
  PetscCall(MatAssemblyBegin(*P, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*P, MAT_FINAL_ASSEMBLY));
  PetscCall(PetscFree(column));
  PetscFunctionReturn(PETSC_SUCCESS);
}
