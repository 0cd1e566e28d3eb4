/* Constraint: applications of P and its transpose (see projection.h). Rigid velocities travel between the rank that
   holds their slots and the ranks whose nodes follow them through a PetscSF. */
#include "compat.h"
#include "constraintimpl.h"
#include "base/inline.h"
#include "base/rowtype.h"

PetscErrorCode ConstraintFetchRigid(Constraint c, const PetscReal rigid[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscSFBcastBegin(c->slots.sf, c->slots.type, rigid, c->slots.local_rigid, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(c->slots.sf, c->slots.type, rigid, c->slots.local_rigid, MPI_REPLACE));
  for (PetscInt e = 0; e < c->view.nlocal * c->view.nr; e++)
    c->slots.local_rigid[e] *= ConstraintSlotUnit(&c->view, c->slots.local_list[e / c->view.nr], e % c->view.nr);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintFetchSlots(Constraint c, const PetscReal rigid[], const PetscReal *local[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscSFBcastBegin(c->slots.sf, c->slots.type, rigid, c->slots.packed, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(c->slots.sf, c->slots.type, rigid, c->slots.packed, MPI_REPLACE));
  *local = c->slots.packed;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintDeliverRigid(Constraint c, const PetscReal local[], PetscReal rigid[])
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < c->view.nlocal * c->view.nr; e++)
    c->slots.packed[e] = ConstraintSlotUnit(&c->view, c->slots.local_list[e / c->view.nr], e % c->view.nr) * local[e];
  PetscCall(PetscSFReduceBegin(c->slots.sf, c->slots.type, c->slots.packed, rigid, MPIU_SUM));
  PetscCall(PetscSFReduceEnd(c->slots.sf, c->slots.type, c->slots.packed, rigid, MPIU_SUM));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSumRows(Constraint c, PetscInt n, const PetscReal value[], PetscReal own[])
{
  PetscReal   *row;
  MPI_Datatype type;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->view.nlocal * n, &row));
  for (PetscInt e = 0; e < c->view.nlocal * n; e++) row[e] = value[c->slots.local_list[e / n] * n + e % n];
  PetscCall(PetscArrayzero(own, c->view.nown * n));
  PetscCall(RowTypeCreate(n, &type));
  PetscCall(PetscSFReduceBegin(c->slots.sf, type, row, own, MPIU_SUM));
  PetscCall(PetscSFReduceEnd(c->slots.sf, type, row, own, MPIU_SUM));
  PetscCall(RowTypeDestroy(&type));
  PetscCall(PetscFree(row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintCopyRows(Constraint c, PetscInt n, const PetscReal own[], PetscReal value[])
{
  PetscReal   *row;
  MPI_Datatype type;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->view.nlocal * n, &row));
  PetscCall(RowTypeCreate(n, &type));
  PetscCall(PetscSFBcastBegin(c->slots.sf, type, own, row, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(c->slots.sf, type, own, row, MPI_REPLACE));
  for (PetscInt e = 0; e < c->view.nown * n; e++) value[c->own[e / n] * n + e % n] = own[e];
  for (PetscInt e = 0; e < c->view.nlocal * n; e++) value[c->slots.local_list[e / n] * n + e % n] = row[e];
  PetscCall(RowTypeDestroy(&type));
  PetscCall(PetscFree(row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSumCounts(Constraint c, const PetscInt local[], PetscInt own[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(own, c->view.count));
  PetscCall(PetscSFReduceBegin(c->slots.sf, MPIU_INT, local, own, MPI_SUM));
  PetscCall(PetscSFReduceEnd(c->slots.sf, MPIU_INT, local, own, MPI_SUM));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* nr as a constant */
INLINE void expand(const PetscInt nr, Constraint c, const PetscReal *restrict rigid, PetscReal *restrict v)
{
  for (PetscInt j = 0; j < c->view.inert.n; j++) {
    PetscReal value = 0;

    if (c->inert.body[j] >= 0)
      for (PetscInt s = 0; s < nr; s++) value += c->inert.coef[j * nr + s] * rigid[c->inert.local_body[j] * nr + s];
    v[c->inert.slot[j]] = value;
  }
  for (PetscInt j = 0; j < c->view.relative_rows.n; j++) {
    const PetscReal *U    = rigid + c->slots.local_index[c->relative_rows.body[j]] * nr;
    const PetscInt   slot = c->relative_rows.slot[j];
    PetscReal        sum  = v[slot];

    for (PetscInt s = 0; s < nr; s++) sum += c->relative_rows.coef[j * nr + s] * U[s];
    v[slot] = sum;
  }
}

PetscErrorCode ConstraintExpandInPlace(Constraint c, const PetscReal rigid[], PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(ConstraintFetchRigid(c, rigid));
  if (c->view.nr == 3) expand(3, c, c->slots.local_rigid, v);
  else expand(6, c, c->slots.local_rigid, v);
  PetscFunctionReturn(PETSC_SUCCESS);
}

INLINE void reduce(const PetscInt nr, Constraint c, PetscReal *restrict r, PetscReal *restrict rigid)
{
  for (PetscInt j = 0; j < c->view.inert.n; j++) {
    const PetscReal value = r[c->inert.slot[j]];

    r[c->inert.slot[j]] = 0;
    if (c->inert.body[j] < 0) continue;
    for (PetscInt s = 0; s < nr; s++) rigid[c->inert.local_body[j] * nr + s] += c->inert.coef[j * nr + s] * value;
  }
  for (PetscInt j = 0; j < c->view.relative_rows.n; j++) {
    const PetscReal value = r[c->relative_rows.slot[j]];
    PetscReal      *sum   = rigid + c->slots.local_index[c->relative_rows.body[j]] * nr;

    for (PetscInt s = 0; s < nr; s++) sum[s] += c->relative_rows.coef[j * nr + s] * value;
  }
}

PetscErrorCode ConstraintReduceInPlace(Constraint c, PetscReal r[], PetscReal rigid[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(c->slots.local_rigid, c->view.nlocal * c->view.nr));
  if (c->view.nr == 3) reduce(3, c, r, c->slots.local_rigid);
  else reduce(6, c, r, c->slots.local_rigid);
  PetscCall(ConstraintDeliverRigid(c, c->slots.local_rigid, rigid));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal prescribed_at(Constraint c, PetscInt slot)
{
  return ConstraintGetPrescribed(c, slot / c->view.loc->dim, slot % c->view.loc->dim);
}

PetscErrorCode ConstraintExpand(Constraint c, Vec ur, PetscReal u[])
{
  const MeshLocal *l = c->view.loc;
  const PetscInt   n = l->nnode * l->dim;
  const PetscReal *x;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(ur, &x));
  PetscCall(PetscArraycpy(u, x, n));
  PetscCall(ConstraintExpandInPlace(c, x + n, u));
  PetscCall(VecRestoreArrayRead(ur, &x));
  for (PetscInt j = 0; j < c->view.inert.n; j++) u[c->inert.slot[j]] += prescribed_at(c, c->inert.slot[j]);
  for (PetscInt j = 0; j < c->view.relative_rows.n; j++)
    u[c->relative_rows.slot[j]] += prescribed_at(c, c->relative_rows.slot[j]);
  PetscCall(MeshSyncNodes(c->mesh, l->dim, u));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ConstraintRestrictRigid(Constraint c, const PetscReal U[], PetscReal rigid[])
{
  for (PetscInt i = 0; i < c->view.count * c->view.nr; i++) rigid[i] = 0;
  for (PetscInt i = 0; i < c->view.nown * c->view.nr; i++) {
    const PetscInt k = c->own[i / c->view.nr], s = i % c->view.nr;

    if (ConstraintIsUnknown(&c->view, k, s)) rigid[i] = U[k * c->view.nr + s] / ConstraintSlotUnit(&c->view, k, s);
  }
}

PetscErrorCode ConstraintRestrict(Constraint c, const PetscReal u[], const PetscReal U[], Vec ur)
{
  const PetscInt n = c->view.loc->nnode * c->view.loc->dim;
  PetscReal     *x;

  PetscFunctionBeginUser;
  PetscCall(VecGetArray(ur, &x));
  PetscCall(PetscArraycpy(x, u, n));
  for (PetscInt j = 0; j < c->view.inert.n; j++) x[c->inert.slot[j]] = 0;
  for (PetscInt j = 0; j < c->view.relative_rows.n; j++) {
    x[c->relative_rows.slot[j]] -= prescribed_at(c, c->relative_rows.slot[j]);
    for (PetscInt s = 0; s < c->view.nr; s++)
      x[c->relative_rows.slot[j]] -= c->relative_rows.coef[j * c->view.nr + s] *
                                     U[c->relative_rows.body[j] * c->view.nr + s];
  }
  ConstraintRestrictRigid(c, U, x + n);
  PetscCall(VecRestoreArray(ur, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void take_unknown(Constraint c, const PetscReal from[], PetscReal U[])
{
  for (PetscInt i = 0; i < c->view.nbodies * c->view.nr; i++)
    if (ConstraintIsUnknown(&c->view, i / c->view.nr, i % c->view.nr))
      U[i] = from[i] * ConstraintSlotUnit(&c->view, i / c->view.nr, i % c->view.nr);
}

/* From the slots to the ranks that know their bodies */
static PetscErrorCode gather_local(Constraint c, const PetscReal rigid[], PetscReal U[])
{
  PetscReal *owner_slot;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->view.nbodies * c->view.nr, &owner_slot));
  PetscCall(PetscSFBcastBegin(c->slots.owner_sf, c->slots.type, rigid, owner_slot, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(c->slots.owner_sf, c->slots.type, rigid, owner_slot, MPI_REPLACE));
  take_unknown(c, owner_slot, U);
  PetscCall(PetscFree(owner_slot));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From the slots to the shares by number, which are in the order of all */
PetscErrorCode ConstraintGatherRigid(Constraint c, const PetscReal rigid[], PetscReal U[])
{
  const PetscInt own = c->slots.numbers->n * c->view.nr;
  PetscReal     *all, *mine;
  PetscMPIInt    size, rank, *counts, *starts;
  PetscSF        sf;

  PetscFunctionBeginUser;
  if (c->slots.owner_slot) {
    PetscCall(gather_local(c, rigid, U));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCallMPI(MPI_Comm_size(c->view.comm, &size));
  PetscCallMPI(MPI_Comm_rank(c->view.comm, &rank));
  PetscCall(PetscMalloc4(c->view.nbodies * c->view.nr, &all, own, &mine, size, &counts, size, &starts));
  for (PetscMPIInt r = 0; r < size; r++) {
    PetscCall(PetscMPIIntCast(c->slots.numbers->range[r] * c->view.nr, &starts[r]));
    PetscCall(PetscMPIIntCast((c->slots.numbers->range[r + 1] - c->slots.numbers->range[r]) * c->view.nr, &counts[r]));
  }
  PetscCall(PetscSFCreate(c->view.comm, &sf));
  PetscCall(PetscSFSetGraphLayout(sf, c->slots.numbers, c->view.nown, NULL, PETSC_OWN_POINTER, c->own));
  PetscCall(PetscSFReduceBegin(sf, c->slots.type, rigid, mine, MPI_REPLACE));
  PetscCall(PetscSFReduceEnd(sf, c->slots.type, rigid, mine, MPI_REPLACE));
  PetscCall(PetscSFDestroy(&sf));
  PetscCallMPI(MPI_Allgatherv(mine, counts[rank], MPIU_REAL, all, counts, starts, MPIU_REAL, c->view.comm));
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
  PetscCall(PetscLayoutCreateFromSizes(c->view.comm, total, PETSC_DETERMINE, 1, &layout));
  for (PetscInt l = 0; l < c->view.nlocal; l++) {
    const PetscInt rank = c->slots.local_slot[l] / c->view.count;

    column[c->slots.local_list[l]] = layout->range[rank + 1] -
                                     ((rank + 1) * c->view.count - c->slots.local_slot[l]) * c->view.nr;
  }
  PetscCall(PetscLayoutDestroy(&layout));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Row j of r into row i of P; column as ConstraintGetRigidColumns says */
static PetscErrorCode set_row(const ConstraintView *c, const ConstraintRows *r, PetscInt j, const PetscInt column[],
                              PetscInt i, Mat P)
{
  const PetscInt   k    = r->body[j];
  const PetscReal *coef = r->coef + j * c->nr;

  PetscFunctionBeginUser;
  for (PetscInt s = 0; s < c->nr && k >= 0; s++)
    if (coef[s] != 0) PetscCall(MatSetValue(P, i, column[k] + s, ConstraintSlotUnit(c, k, s) * coef[s], INSERT_VALUES));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintCreateMat(Constraint c, Mat *P)
{
  PetscInt nodal, total, row0, col0, *column, j = 0, f = 0;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetSizes(c, &nodal, &total));
  PetscCall(PetscMalloc1(c->view.nbodies, &column));
  PetscCall(ConstraintGetRigidColumns(c, column));
  PetscCall(MatCreateAIJ(c->view.comm, nodal, total, PETSC_DETERMINE, PETSC_DETERMINE, c->view.nr + 1, NULL, c->view.nr,
                         NULL, P));
  PetscCall(MatGetOwnershipRange(*P, &row0, NULL));
  PetscCall(MatGetOwnershipRangeColumn(*P, &col0, NULL));
  for (PetscInt i = 0; i < nodal; i++) {
    if (j < c->view.inert.n && c->inert.slot[j] == i) {
      PetscCall(set_row(&c->view, &c->view.inert, j, column, row0 + i, *P));
      j++;
    } else PetscCall(MatSetValue(*P, row0 + i, col0 + i, 1, INSERT_VALUES));
    if (f < c->view.relative_rows.n && c->relative_rows.slot[f] == i) {
      PetscCall(set_row(&c->view, &c->view.relative_rows, f, column, row0 + i, *P));
      f++;
    }
  }
  PetscCall(MatAssemblyBegin(*P, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*P, MAT_FINAL_ASSEMBLY));
  PetscCall(PetscFree(column));
  PetscFunctionReturn(PETSC_SUCCESS);
}
