/* Constraint: life cycle, and what it is told in a step (see constraint.h). */
#include "compat.h"
#include "constraintimpl.h"
#include "base/log.h"
#include "base/array.h"
#include "base/rigid.h"
#include "base/rowtype.h"

/* Bodies that a rank has slots for, by those of an even share: its own share by number, and as many more by place */
#define SLOTS 2

PetscInt ConstraintSlots(MPI_Comm comm, PetscInt nbodies)
{
  PetscMPIInt size;

  (void)MPI_Comm_size(comm, &size);
  return PetscMin(nbodies, SLOTS * ((nbodies + size - 1) / size));
}

/* The view's arrays that stay where they are */
static void set_view(Constraint c)
{
  ConstraintView *v = &c->view;

  v->own         = c->own;
  v->unknown     = c->unknown;
  v->united      = c->united;
  v->X           = (const PetscReal(*)[3])c->X;
  v->length      = c->length;
  v->U           = c->U;
  v->fixed       = c->fixed;
  v->node_body   = c->node_body;
  v->relative    = c->relative;
  v->local_index = c->slots.local_index;
  v->local_list  = c->slots.local_list;
  v->local_slot  = c->slots.local_slot;
  v->local_rigid = c->slots.local_rigid;
}

/* nbodies: of all ranks, of which arrays hold up to `capacity`; all of them are known now, or none; count: as in
   ConstraintCreateLocal */
static PetscErrorCode create_constraint(Mesh mesh, PetscInt nbodies, PetscInt capacity, PetscInt count, PetscBool all,
                                        Constraint *constraint)
{
  Constraint       c;
  const MeshLocal *l;
  PetscInt         nr;
  MPI_Comm         comm;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  PetscCall(MeshGetComm(mesh, &comm));
  PetscCall(MeshGetLocal(mesh, &l));
  nr      = RigidSize(l->dim);
  c->mesh = mesh;
  c->view = (ConstraintView){.comm     = comm,
                             .loc      = l,
                             .nall     = nbodies,
                             .nbodies  = all ? nbodies : 0,
                             .capacity = capacity,
                             .nr       = nr,
                             .count    = count};
  if (!all) PetscCall(PetscMalloc1(capacity, &c->slots.owner_slot));
  PetscCall(PetscLayoutCreateFromSizes(c->view.comm, PETSC_DECIDE, nbodies, 1, &c->slots.numbers));
  PetscCall(PetscCalloc3(l->nnode_all, &c->fixed, l->nnode_all, &c->node_body, l->nnode_all, &c->relative));
  PetscCall(PetscCalloc6(capacity, &c->unknown, capacity, &c->X, capacity * nr, &c->U, capacity, &c->slots.local_index,
                         capacity, &c->slots.local_list, capacity * nr, &c->slots.local_rigid));
  PetscCall(PetscMalloc4(capacity, &c->length, capacity * nr, &c->slots.packed, count, &c->own, capacity,
                         &c->slots.local_slot));
  for (PetscInt k = 0; k < capacity; k++) {
    c->length[k]            = 1;
    c->slots.local_index[k] = -1;
  }
  PetscCall(PetscCalloc1(capacity, &c->united));
  for (PetscInt i = 0; i < l->nnode_all; i++) c->node_body[i] = c->relative[i] = -1;
  set_view(c);
  PetscCall(RowTypeCreate(nr, &c->slots.type));
  PetscCall(ConstraintCollectInert(c));
  PetscCall(ConstraintConnectSlots(c));
  *constraint = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintCreate(Mesh mesh, PetscInt nbodies, Constraint *constraint)
{
  MPI_Comm comm;

  PetscFunctionBeginUser;
  PetscCall(MeshGetComm(mesh, &comm));
  PetscCall(create_constraint(mesh, nbodies, nbodies, ConstraintSlots(comm, nbodies), PETSC_TRUE, constraint));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintCreateLocal(Mesh mesh, PetscInt nbodies, PetscInt capacity, PetscInt count,
                                     Constraint *constraint)
{
  PetscFunctionBeginUser;
  PetscCall(create_constraint(mesh, nbodies, capacity, count, PETSC_FALSE, constraint));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintGetCapacity(Constraint c, PetscInt *capacity, PetscInt *count)
{
  PetscFunctionBeginUser;
  *capacity = c->view.capacity;
  *count    = c->view.count;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetLocal(Constraint c, PetscInt n, const PetscMPIInt rank[], const PetscInt which[])
{
  PetscMPIInt  self;
  PetscSFNode *root;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(c->view.comm, &self));
  for (PetscInt l = 0; l < c->view.nlocal; l++) c->slots.local_index[c->slots.local_list[l]] = -1;
  c->view.nlocal = c->view.nown = 0;
  c->view.nbodies               = n;
  c->have_bodies                = PETSC_FALSE;
  PetscCall(PetscMalloc1(n, &root));
  for (PetscInt k = 0; k < n; k++) {
    c->slots.owner_slot[k] = rank[k] * c->view.count + which[k];
    root[k]                = (PetscSFNode){rank[k], which[k]};
    if (rank[k] == self) c->own[c->view.nown++] = k;
  }
  PetscCall(PetscSFDestroy(&c->slots.owner_sf));
  PetscCall(PetscSFCreate(c->view.comm, &c->slots.owner_sf));
  PetscCall(PetscSFSetGraph(c->slots.owner_sf, c->view.count, n, NULL, PETSC_OWN_POINTER, root, PETSC_OWN_POINTER));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintDestroy(Constraint *constraint)
{
  Constraint c = *constraint;

  PetscFunctionBeginUser;
  if (!c) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree4(c->inert.slot, c->inert.body, c->inert.local_body, c->inert.coef));
  PetscCall(PetscFree3(c->fixed, c->node_body, c->relative));
  PetscCall(PetscFree(c->relative_rows.slot));
  PetscCall(PetscFree(c->relative_rows.body));
  PetscCall(PetscFree(c->relative_rows.coef));
  PetscCall(PetscFree(c->wanted.more));
  PetscCall(PetscFree(c->wanted.pair));
  PetscCall(PetscFree6(c->unknown, c->X, c->U, c->slots.local_index, c->slots.local_list, c->slots.local_rigid));
  PetscCall(PetscFree4(c->length, c->slots.packed, c->own, c->slots.local_slot));
  PetscCall(PetscFree(c->united));
  PetscCall(PetscFree(c->body_node));
  PetscCall(PetscSFDestroy(&c->slots.sf));
  PetscCall(PetscSFDestroy(&c->slots.owner_sf));
  PetscCall(PetscFree(c->slots.owner_slot));
  PetscCall(PetscLayoutDestroy(&c->slots.numbers));
  PetscCall(SharedReductionDestroy(&c->view.shared_reduction));
  PetscCall(RowTypeDestroy(&c->slots.type));
  PetscCall(PetscFree(*constraint));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetLengths(Constraint c, const PetscReal length[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(c->length, length, c->view.nbodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetBoundary(Constraint c, const unsigned char fixed[], const PetscReal value[])
{
  const MeshLocal *l = c->view.loc;
  PetscBool        same;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycmp(c->fixed, fixed, l->nnode_all, &same));
  PetscCall(PetscArraycpy(c->fixed, fixed, l->nnode_all));
  c->value = value;
  if (!same) {
    PetscCall(ConstraintCollectInert(c));
    c->wanted.changed = PETSC_TRUE;
    for (PetscInt j = 0; j < c->view.inert.n; j++)
      if (c->inert.body[j] >= 0) c->inert.local_body[j] = c->slots.local_index[c->inert.body[j]];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetRelative(Constraint c, const PetscInt relative[], PetscInt nmore, const PetscInt more[])
{
  PetscBool same = (PetscBool)(nmore == c->wanted.nmore);

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->view.loc->nnode_all; i++) {
    const PetscInt k = relative ? relative[i] : -1;

    if (k != c->relative[i]) same = PETSC_FALSE;
    c->relative[i] = k;
  }
  for (PetscInt j = 0; j < nmore && same; j++) same = (PetscBool)(more[j] == c->wanted.more[j]);
  if (!same) c->wanted.changed = PETSC_TRUE;
  PetscCall(ArrayReserve(nmore, &c->wanted.more_capacity, &c->wanted.more, sizeof(*c->wanted.more), NULL));
  PetscCall(PetscArraycpy(c->wanted.more, more, nmore));
  c->wanted.nmore = nmore;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetPairs(Constraint c, PetscInt n, const PetscInt pair[][2])
{
  PetscBool same = (PetscBool)(n == c->wanted.npair);

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < n && same; j++)
    same = (PetscBool)(pair[j][0] == c->wanted.pair[j][0] && pair[j][1] == c->wanted.pair[j][1]);
  if (same) PetscFunctionReturn(PETSC_SUCCESS);
  c->wanted.changed = PETSC_TRUE;
  PetscCall(ArrayReserve(n, &c->wanted.pair_capacity, &c->wanted.pair, sizeof(*c->wanted.pair), NULL));
  if (n) PetscCall(PetscMemcpy(c->wanted.pair, pair, (size_t)n * sizeof(*c->wanted.pair)));
  c->wanted.npair = n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetBodies(Constraint c, const PetscInt node_body[], PetscReal (*X)[3],
                                   const PetscInt unknown[], const PetscReal U[], PetscBool *changed)
{
  const MeshLocal *l       = c->view.loc;
  PetscBool        same[3] = {PETSC_TRUE, PETSC_TRUE, PETSC_TRUE}, renew;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    const PetscInt k = c->fixed[i] ? -1 : node_body[i]; /* walls win */

    if (k != c->node_body[i]) same[0] = PETSC_FALSE;
    c->node_body[i] = k;
  }
  PetscCall(PetscArraycmp((PetscReal *)c->X, (PetscReal *)X, 3 * c->view.nbodies, &same[1]));
  PetscCall(PetscArraycmp(c->unknown, unknown, c->view.nbodies, &same[2]));
  renew = (PetscBool)(!c->have_bodies || c->wanted.changed || !same[0] || !same[1] || !same[2]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &renew, 1, COMPAT_MPI_BOOL, MPI_LOR, c->view.comm));
  c->have_bodies = PETSC_TRUE;
  PetscCall(PetscArraycpy((PetscReal *)c->X, (PetscReal *)X, 3 * c->view.nbodies));
  PetscCall(PetscArraycpy(c->unknown, unknown, c->view.nbodies));
  PetscCall(PetscArraycpy(c->U, U, c->view.nbodies * c->view.nr));
  c->wanted.changed = PETSC_FALSE;
  if (renew) {
    PetscCall(PetscLogEventBegin(TB_PROJECT, 0, 0, 0, 0));
    PetscCall(ConstraintCollectInert(c));
    PetscCall(ConstraintCollectRelative(c));
    PetscCall(ConstraintConnectSlots(c));
    PetscCall(ConstraintListBodyNodes(c));
    PetscCall(PetscLogEventEnd(TB_PROJECT, 0, 0, 0, 0));
  }
  if (changed) *changed = renew;
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ConstraintMoveNodes(Constraint c)
{
  c->wanted.changed = PETSC_TRUE;
}

PetscErrorCode ConstraintSetSlip(Constraint c, const PetscReal slip[])
{
  PetscFunctionBeginUser;
  c->slip = slip;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetUnited(Constraint c, const PetscBool united[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(c->united, united, c->view.nbodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintGetRigidSize(Constraint c, PetscInt *nr)
{
  PetscFunctionBeginUser;
  *nr = c->view.nr;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintGetSizes(Constraint c, PetscInt *nodal, PetscInt *total)
{
  PetscFunctionBeginUser;
  if (nodal) *nodal = c->view.loc->nnode * c->view.loc->dim;
  if (total) *total = c->view.loc->nnode * c->view.loc->dim + c->view.count * c->view.nr;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintCreateVec(Constraint c, Vec *ur)
{
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetSizes(c, NULL, &n));
  PetscCall(VecCreateMPI(c->view.comm, n, PETSC_DETERMINE, ur));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintGetNodeBody(Constraint c, const PetscInt *node_body[])
{
  PetscFunctionBeginUser;
  *node_body = c->node_body;
  PetscFunctionReturn(PETSC_SUCCESS);
}
