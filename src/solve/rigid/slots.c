/* Constraint: on which ranks the rigid slots of bodies are, and the ways to them (see constraintimpl.h). */
#include "compat.h"
#include "constraintimpl.h"

static void know_body(Constraint c, PetscInt k)
{
  if (c->slots.local_index[k] >= 0) return;
  c->slots.local_index[k]               = c->view.nlocal;
  c->slots.local_list[c->view.nlocal++] = k;
}

/* May the slots of body k, which is known by its nodes or not, be here? */
static PetscBool may_have_slots(Constraint c, PetscMPIInt rank, PetscInt k)
{
  if (c->slots.owner_slot) return (PetscBool)(c->slots.owner_slot[k] / c->view.count == rank);
  return (PetscBool)(c->slots.local_index[k] >= 0 || (k >= c->slots.numbers->rstart && k < c->slots.numbers->rend));
}

/* Both bodies of a pair where the slots of one may be */
static PetscErrorCode find_partners(Constraint c)
{
  PetscMPIInt rank;
  PetscBool  *here;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(c->view.comm, &rank));
  PetscCall(PetscMalloc1(c->wanted.npair, &here));
  for (PetscInt j = 0; j < c->wanted.npair; j++) {
    here[j] = may_have_slots(c, rank, c->wanted.pair[j][0]);
    if (c->wanted.pair[j][1] >= 0) here[j] = (PetscBool)(here[j] || may_have_slots(c, rank, c->wanted.pair[j][1]));
  }
  for (PetscInt j = 0; j < 2 * c->wanted.npair; j++) {
    const PetscInt k = c->wanted.pair[j / 2][j % 2];

    if (here[j / 2] && k >= 0 && c->unknown[k]) know_body(c, k);
  }
  PetscCall(PetscFree(here));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies that local nodes, ghosts too, lie in or follow, and more: ascending */
static PetscErrorCode know_bodies(Constraint c)
{
  PetscFunctionBeginUser;
  for (PetscInt l = 0; l < c->view.nlocal; l++) c->slots.local_index[c->slots.local_list[l]] = -1;
  c->view.nlocal = 0;
  for (PetscInt i = 0; i < c->view.loc->nnode_all; i++) {
    const PetscInt k = ConstraintGetMover(&c->view, i);

    if (k >= 0 && c->unknown[k]) know_body(c, k);
  }
  for (PetscInt j = 0; j < c->wanted.nmore; j++) know_body(c, c->wanted.more[j]);
  PetscCall(find_partners(c));
  PetscCall(PetscSortInt(c->view.nlocal, c->slots.local_list));
  for (PetscInt l = 0; l < c->view.nlocal; l++) c->slots.local_index[c->slots.local_list[l]] = l;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* bid [nlocal]: own nodes of each known body, and this rank */
static PetscErrorCode count_nodes(Constraint c, PetscMPIInt rank, PetscInt (*bid)[2])
{
  PetscFunctionBeginUser;
  for (PetscInt l = 0; l < c->view.nlocal; l++) {
    bid[l][0] = 0;
    bid[l][1] = rank;
  }
  for (PetscInt i = 0; i < c->view.loc->nnode; i++) {
    const PetscInt k = ConstraintGetMover(&c->view, i);

    if (k >= 0 && c->slots.local_index[k] >= 0) bid[c->slots.local_index[k]][0]++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The slots of a body are on the rank that holds most of its nodes, so that they move with it; where that rank has no
   room, or no rank a node, on the rank that its number belongs to, which always has. It is there, too, that the ranks
   that know a body learn where its slots are. */
static PetscErrorCode place_slots(Constraint c)
{
  const PetscInt nshare = c->slots.numbers->n, first = c->slots.numbers->rstart;
  PetscInt       free_slots = c->view.count - nshare, (*best)[2], (*bid)[2], *slot;
  PetscMPIInt    rank;
  PetscSF        sf;

  PetscFunctionBeginUser;
  if (c->slots.owner_slot) {
    for (PetscInt l = 0; l < c->view.nlocal; l++) c->slots.local_slot[l] = c->slots.owner_slot[c->slots.local_list[l]];
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (c->slots.numbers->size == 1) {
    for (c->view.nown = 0; c->view.nown < nshare; c->view.nown++) c->own[c->view.nown] = c->view.nown;
    PetscCall(PetscArraycpy(c->slots.local_slot, c->slots.local_list, c->view.nlocal));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCallMPI(MPI_Comm_rank(c->view.comm, &rank));
  PetscCall(PetscSFCreate(c->view.comm, &sf));
  PetscCall(PetscSFSetGraphLayout(sf, c->slots.numbers, c->view.nlocal, NULL, PETSC_OWN_POINTER, c->slots.local_list));
  PetscCall(PetscMalloc3(nshare, &best, c->view.nlocal, &bid, nshare, &slot));
  PetscCall(count_nodes(c, rank, bid));
  for (PetscInt k = 0; k < nshare; k++) {
    best[k][0] = best[k][1] = -1;
    slot[k]                 = -1;
  }
  PetscCall(PetscSFReduceBegin(sf, MPIU_2INT, bid, best, MPI_MAXLOC));
  PetscCall(PetscSFReduceEnd(sf, MPIU_2INT, bid, best, MPI_MAXLOC));
  PetscCall(PetscSFBcastBegin(sf, MPIU_2INT, best, bid, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(sf, MPIU_2INT, best, bid, MPI_REPLACE));
  c->view.nown = 0;
  for (PetscInt l = 0; l < c->view.nlocal; l++) {
    const PetscInt  k     = c->slots.local_list[l];
    const PetscBool guest = (PetscBool)(k < first || k >= first + nshare);

    c->slots.local_slot[l] = -1;
    if (bid[l][1] != rank || (guest && !free_slots)) continue;
    free_slots -= guest;
    c->slots.local_slot[l] = rank * c->view.count + c->view.nown;
    c->own[c->view.nown++] = k;
  }
  PetscCall(PetscSFReduceBegin(sf, MPIU_INT, c->slots.local_slot, slot, MPI_MAX));
  PetscCall(PetscSFReduceEnd(sf, MPIU_INT, c->slots.local_slot, slot, MPI_MAX));
  for (PetscInt k = 0; k < nshare; k++) {
    if (slot[k] >= 0) continue;
    slot[k]                = rank * c->view.count + c->view.nown;
    c->own[c->view.nown++] = first + k;
  }
  PetscCall(PetscSFBcastBegin(sf, MPIU_INT, slot, c->slots.local_slot, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(sf, MPIU_INT, slot, c->slots.local_slot, MPI_REPLACE));
  PetscCall(PetscFree3(best, bid, slot));
  PetscCall(PetscSFDestroy(&sf));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* List the bodies known here and connect them to their slots and to the other ranks that know them. */
PetscErrorCode ConstraintConnectSlots(Constraint c)
{
  PetscSFNode *root;

  PetscFunctionBeginUser;
  PetscCall(know_bodies(c));
  for (PetscInt j = 0; j < c->view.inert.n; j++)
    c->inert.local_body[j] = c->inert.body[j] < 0 ? -1 : c->slots.local_index[c->inert.body[j]];
  PetscCall(place_slots(c));
  PetscCall(PetscSFDestroy(&c->slots.sf));
  PetscCall(PetscSFCreate(c->view.comm, &c->slots.sf));
  PetscCall(PetscMalloc1(c->view.nlocal, &root));
  for (PetscInt l = 0; l < c->view.nlocal; l++)
    root[l] = (PetscSFNode){c->slots.local_slot[l] / c->view.count, c->slots.local_slot[l] % c->view.count};
  PetscCall(
    PetscSFSetGraph(c->slots.sf, c->view.count, c->view.nlocal, NULL, PETSC_OWN_POINTER, root, PETSC_OWN_POINTER));
  PetscCall(SharedReductionDestroy(&c->view.shared_reduction));
  PetscCall(SharedReductionCreate(c->slots.sf, c->view.nlocal, c->view.nr, &c->view.shared_reduction));
  PetscFunctionReturn(PETSC_SUCCESS);
}
