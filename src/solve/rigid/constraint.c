/* Constraint: the rows of the projection P (see constraint.h, projection.h). */
#include "compat.h"
#include "projection.h"
#include "base/log.h"
#include "base/room.h"
#include "base/rowtype.h"

/* Bodies that a rank has slots for, by those of an even share: its own share by number, and as many more by place */
#define SLOTS 2

PetscInt ConstraintSlots(PetscInt nbodies)
{
  PetscMPIInt size;

  (void)MPI_Comm_size(PETSC_COMM_WORLD, &size);
  return PetscMin(nbodies, SLOTS * ((nbodies + size - 1) / size));
}

static PetscInt bit_count(PetscInt bits)
{
  PetscInt n = 0;

  for (; bits; bits &= bits - 1) n++;
  return n;
}

/* Row a of the rigid map at node i about centre X: velocity component a for unit rigid velocities, without regard to
   what is unknown */
static void rigid_row(const MeshLocal *l, PetscInt i, PetscInt a, const PetscReal X[3], PetscReal row[])
{
  PetscReal r[3] = {0, 0, 0};

  for (PetscInt d = 0; d < l->dim; d++) { r[d] = MeshNearest(l, d, l->x[i * l->dim + d] - X[d]); }
  for (PetscInt d = 0; d < l->dim; d++) row[d] = d == a;
  if (l->dim == 2) row[2] = a == 0 ? -r[1] : r[0];
  else {
    /* (w x r)_a = sum_b spin[a][b] w_b */
    const PetscReal spin[3][3] = {{0, r[2], -r[1]}, {-r[2], 0, r[0]}, {r[1], -r[0], 0}};

    for (PetscInt b = 0; b < 3; b++) row[3 + b] = spin[a][b];
  }
}

static PetscErrorCode collect_rows(Constraint c)
{
  const MeshLocal *l = c->loc;
  PetscInt         n = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode; i++) n += c->node_body[i] >= 0 ? l->dim : bit_count(c->fixed[i]);
  if (n > c->ninert || !c->slot) {
    PetscCall(PetscFree4(c->slot, c->body, c->local_body, c->coef));
    PetscCall(PetscMalloc4(n, &c->slot, n, &c->body, n, &c->local_body, n * c->nr, &c->coef));
  }
  c->ninert = 0;
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscInt k = c->node_body[i];

    if (k < 0 && !c->fixed[i]) continue;
    for (PetscInt a = 0; a < l->dim; a++) {
      PetscReal *row = c->coef + c->ninert * c->nr;

      if (k < 0 && !((c->fixed[i] >> a) & 1)) continue;
      for (PetscInt s = 0; s < c->nr; s++) row[s] = 0;
      if (k >= 0) {
        rigid_row(l, i, a, c->X[k], row);
        for (PetscInt s = 0; s < c->nr; s++)
          if (!((c->unknown[k] >> s) & 1)) row[s] = 0;
      }
      c->slot[c->ninert]         = i * l->dim + a;
      c->body[c->ninert]         = k >= 0 && c->unknown[k] ? k : -1;
      c->local_body[c->ninert++] = -1;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode list_body_nodes(Constraint c)
{
  PetscInt n = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->loc->nnode_all; i++) n += c->node_body[i] >= 0 || c->follow[i] >= 0;
  PetscCall(RoomFor(n, &c->body_node_room, &c->body_node, sizeof(*c->body_node), NULL));
  c->nbody_nodes = 0;
  for (PetscInt i = 0; i < c->loc->nnode_all; i++)
    if (c->node_body[i] >= 0 || c->follow[i] >= 0) c->body_node[c->nbody_nodes++] = i;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode collect_followers(Constraint c)
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  c->nfollow = 0;
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscInt k = c->follow[i];

    if (k < 0 || c->node_body[i] >= 0 || !c->unknown[k]) continue;
    PetscCall(RoomFor(c->nfollow + l->dim, &c->follow_room, &c->follow_slot, sizeof(*c->follow_slot), &c->follow_body, sizeof(*c->follow_body),
                      &c->follow_coef, c->nr * sizeof(*c->follow_coef), NULL));
    for (PetscInt a = 0; a < l->dim; a++) {
      PetscReal *row = c->follow_coef + c->nfollow * c->nr;

      if ((c->fixed[i] >> a) & 1) continue;
      rigid_row(l, i, a, c->X[k], row);
      for (PetscInt s = 0; s < c->nr; s++)
        if (!((c->unknown[k] >> s) & 1)) row[s] = 0;
      c->follow_slot[c->nfollow]   = i * l->dim + a;
      c->follow_body[c->nfollow++] = k;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- slots of rigid velocities ---- */

static void know_body(Constraint c, PetscInt k)
{
  if (c->local_index[k] >= 0) return;
  c->local_index[k]          = c->nlocal;
  c->local_list[c->nlocal++] = k;
}

/* May the slots of body k, which is known by its nodes or not, be here? */
static PetscBool may_hold(Constraint c, PetscMPIInt rank, PetscInt k)
{
  if (c->slot_of) return (PetscBool)(c->slot_of[k] / c->count == rank);
  return (PetscBool)(c->local_index[k] >= 0 || (k >= c->numbers->rstart && k < c->numbers->rend));
}

/* Both bodies of a pair where the slots of one may be */
static PetscErrorCode know_partners(Constraint c)
{
  PetscMPIInt rank;
  PetscBool  *here;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCall(PetscMalloc1(c->npartners, &here));
  for (PetscInt j = 0; j < c->npartners; j++) {
    here[j] = may_hold(c, rank, c->partner[j][0]);
    if (c->partner[j][1] >= 0) here[j] = (PetscBool)(here[j] || may_hold(c, rank, c->partner[j][1]));
  }
  for (PetscInt j = 0; j < 2 * c->npartners; j++) {
    const PetscInt k = c->partner[j / 2][j % 2];

    if (here[j / 2] && k >= 0 && c->unknown[k]) know_body(c, k);
  }
  PetscCall(PetscFree(here));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies that local nodes, ghosts too, lie in or follow, and more: ascending */
static PetscErrorCode know_bodies(Constraint c)
{
  PetscFunctionBeginUser;
  for (PetscInt l = 0; l < c->nlocal; l++) c->local_index[c->local_list[l]] = -1;
  c->nlocal = 0;
  for (PetscInt i = 0; i < c->loc->nnode_all; i++) {
    const PetscInt k = ConstraintGetMover(c, i);

    if (k >= 0 && c->unknown[k]) know_body(c, k);
  }
  for (PetscInt j = 0; j < c->nmore; j++) know_body(c, c->more[j]);
  PetscCall(know_partners(c));
  PetscCall(PetscSortInt(c->nlocal, c->local_list));
  for (PetscInt l = 0; l < c->nlocal; l++) c->local_index[c->local_list[l]] = l;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* bid [nlocal]: own nodes of each known body, and this rank */
static PetscErrorCode count_nodes(Constraint c, PetscMPIInt rank, PetscInt (*bid)[2])
{
  PetscFunctionBeginUser;
  for (PetscInt l = 0; l < c->nlocal; l++) {
    bid[l][0] = 0;
    bid[l][1] = rank;
  }
  for (PetscInt i = 0; i < c->loc->nnode; i++) {
    const PetscInt k = ConstraintGetMover(c, i);

    if (k >= 0 && c->local_index[k] >= 0) bid[c->local_index[k]][0]++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The slots of a body are on the rank that holds most of its nodes, so that they move with it; where that rank has no
   room, or no rank a node, on the rank that its number belongs to, which always has. It is there, too, that the ranks
   that know a body learn where its slots are. */
static PetscErrorCode place_slots(Constraint c)
{
  const PetscInt share = c->numbers->n, first = c->numbers->rstart;
  PetscInt       room = c->count - share, (*best)[2], (*bid)[2], *slot;
  PetscMPIInt    rank;
  PetscSF        sf;

  PetscFunctionBeginUser;
  if (c->slot_of) {
    for (PetscInt l = 0; l < c->nlocal; l++) c->local_slot[l] = c->slot_of[c->local_list[l]];
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (c->numbers->size == 1) {
    for (c->nown = 0; c->nown < share; c->nown++) c->own[c->nown] = c->nown;
    PetscCall(PetscArraycpy(c->local_slot, c->local_list, c->nlocal));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCall(PetscSFCreate(PETSC_COMM_WORLD, &sf));
  PetscCall(PetscSFSetGraphLayout(sf, c->numbers, c->nlocal, NULL, PETSC_OWN_POINTER, c->local_list));
  PetscCall(PetscMalloc3(share, &best, c->nlocal, &bid, share, &slot));
  PetscCall(count_nodes(c, rank, bid));
  for (PetscInt k = 0; k < share; k++) {
    best[k][0] = best[k][1] = -1;
    slot[k]                 = -1;
  }
  PetscCall(PetscSFReduceBegin(sf, MPIU_2INT, bid, best, MPI_MAXLOC));
  PetscCall(PetscSFReduceEnd(sf, MPIU_2INT, bid, best, MPI_MAXLOC));
  PetscCall(PetscSFBcastBegin(sf, MPIU_2INT, best, bid, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(sf, MPIU_2INT, best, bid, MPI_REPLACE));
  c->nown = 0;
  for (PetscInt l = 0; l < c->nlocal; l++) {
    const PetscInt  k     = c->local_list[l];
    const PetscBool guest = (PetscBool)(k < first || k >= first + share);

    c->local_slot[l] = -1;
    if (bid[l][1] != rank || (guest && !room)) continue;
    room -= guest;
    c->local_slot[l]  = rank * c->count + c->nown;
    c->own[c->nown++] = k;
  }
  PetscCall(PetscSFReduceBegin(sf, MPIU_INT, c->local_slot, slot, MPI_MAX));
  PetscCall(PetscSFReduceEnd(sf, MPIU_INT, c->local_slot, slot, MPI_MAX));
  for (PetscInt k = 0; k < share; k++) {
    if (slot[k] >= 0) continue;
    slot[k]           = rank * c->count + c->nown;
    c->own[c->nown++] = first + k;
  }
  PetscCall(PetscSFBcastBegin(sf, MPIU_INT, slot, c->local_slot, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(sf, MPIU_INT, slot, c->local_slot, MPI_REPLACE));
  PetscCall(PetscFree3(best, bid, slot));
  PetscCall(PetscSFDestroy(&sf));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* List the bodies known here and connect them to their slots and to the other ranks that know them. */
static PetscErrorCode connect_rigid_slots(Constraint c)
{
  PetscSFNode *root;

  PetscFunctionBeginUser;
  PetscCall(know_bodies(c));
  for (PetscInt j = 0; j < c->ninert; j++) c->local_body[j] = c->body[j] < 0 ? -1 : c->local_index[c->body[j]];
  PetscCall(place_slots(c));
  PetscCall(PetscSFDestroy(&c->rigid_sf));
  PetscCall(PetscSFCreate(PETSC_COMM_WORLD, &c->rigid_sf));
  PetscCall(PetscMalloc1(c->nlocal, &root));
  for (PetscInt l = 0; l < c->nlocal; l++) root[l] = (PetscSFNode){c->local_slot[l] / c->count, c->local_slot[l] % c->count};
  PetscCall(PetscSFSetGraph(c->rigid_sf, c->count, c->nlocal, NULL, PETSC_OWN_POINTER, root, PETSC_OWN_POINTER));
  PetscCall(SharingDestroy(&c->sharing));
  PetscCall(SharingCreate(c->rigid_sf, c->nlocal, c->nr, &c->sharing));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal ConstraintKnown(Constraint c, PetscInt i, PetscInt a)
{
  const PetscBool fixed = (PetscBool)((c->fixed[i] >> a) & 1);
  const PetscInt  k     = c->node_body[i] >= 0 ? c->node_body[i] : fixed || c->follow[i] < 0 || !c->unknown[c->follow[i]] ? -1 : c->follow[i];
  PetscReal       row[6], v = 0;

  if (k < 0) return fixed ? c->value[i * c->loc->dim + a] : 0;
  rigid_row(c->loc, i, a, c->X[k], row);
  for (PetscInt s = 0; s < c->nr; s++)
    if (!((c->unknown[k] >> s) & 1)) v += row[s] * c->U[k * c->nr + s];
  return v;
}

/* nbodies: of all ranks, of which arrays have room for so many; all of them are known now, or none; count: as in
   ConstraintCreateKnown */
static PetscErrorCode create(Mesh mesh, PetscInt nbodies, PetscInt room, PetscInt count, PetscBool all, Constraint *constraint)
{
  Constraint c;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  c->mesh    = mesh;
  c->nall    = nbodies;
  c->nbodies = all ? nbodies : 0;
  c->room    = room;
  c->count   = count;
  PetscCall(MeshGetLocal(mesh, &c->loc));
  c->nr = c->loc->dim == 2 ? 3 : 6;
  if (!all) PetscCall(PetscMalloc1(room, &c->slot_of));
  PetscCall(PetscLayoutCreateFromSizes(PETSC_COMM_WORLD, PETSC_DECIDE, nbodies, 1, &c->numbers));
  PetscCall(PetscCalloc3(c->loc->nnode_all, &c->fixed, c->loc->nnode_all, &c->node_body, c->loc->nnode_all, &c->follow));
  PetscCall(
    PetscCalloc6(room, &c->unknown, room, &c->X, room * c->nr, &c->U, room, &c->local_index, room, &c->local_list, room * c->nr, &c->local_rigid));
  PetscCall(PetscMalloc4(room, &c->length, room * c->nr, &c->packed, c->count, &c->own, room, &c->local_slot));
  for (PetscInt k = 0; k < room; k++) {
    c->length[k]      = 1;
    c->local_index[k] = -1;
  }
  PetscCall(PetscCalloc1(room, &c->united));
  for (PetscInt i = 0; i < c->loc->nnode_all; i++) c->node_body[i] = c->follow[i] = -1;
  PetscCall(RowTypeCreate(c->nr, &c->rigid_type));
  PetscCall(collect_rows(c));
  PetscCall(connect_rigid_slots(c));
  *constraint = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintCreate(Mesh mesh, PetscInt nbodies, Constraint *constraint)
{
  PetscFunctionBeginUser;
  PetscCall(create(mesh, nbodies, nbodies, ConstraintSlots(nbodies), PETSC_TRUE, constraint));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintCreateKnown(Mesh mesh, PetscInt nbodies, PetscInt room, PetscInt count, Constraint *constraint)
{
  PetscFunctionBeginUser;
  PetscCall(create(mesh, nbodies, room, count, PETSC_FALSE, constraint));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintGetRoom(Constraint c, PetscInt *room, PetscInt *count)
{
  PetscFunctionBeginUser;
  *room  = c->room;
  *count = c->count;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetKnown(Constraint c, PetscInt n, const PetscMPIInt rank[], const PetscInt which[])
{
  PetscMPIInt  self;
  PetscSFNode *root;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &self));
  for (PetscInt l = 0; l < c->nlocal; l++) c->local_index[c->local_list[l]] = -1;
  c->nlocal = c->nown = 0;
  c->nbodies          = n;
  c->have_bodies      = PETSC_FALSE;
  PetscCall(PetscMalloc1(n, &root));
  for (PetscInt k = 0; k < n; k++) {
    c->slot_of[k] = rank[k] * c->count + which[k];
    root[k]       = (PetscSFNode){rank[k], which[k]};
    if (rank[k] == self) c->own[c->nown++] = k;
  }
  PetscCall(PetscSFDestroy(&c->known_sf));
  PetscCall(PetscSFCreate(PETSC_COMM_WORLD, &c->known_sf));
  PetscCall(PetscSFSetGraph(c->known_sf, c->count, n, NULL, PETSC_OWN_POINTER, root, PETSC_OWN_POINTER));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintDestroy(Constraint *constraint)
{
  Constraint c = *constraint;

  PetscFunctionBeginUser;
  if (!c) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree4(c->slot, c->body, c->local_body, c->coef));
  PetscCall(PetscFree3(c->fixed, c->node_body, c->follow));
  PetscCall(PetscFree(c->follow_slot));
  PetscCall(PetscFree(c->follow_body));
  PetscCall(PetscFree(c->follow_coef));
  PetscCall(PetscFree(c->more));
  PetscCall(PetscFree(c->partner));
  PetscCall(PetscFree6(c->unknown, c->X, c->U, c->local_index, c->local_list, c->local_rigid));
  PetscCall(PetscFree4(c->length, c->packed, c->own, c->local_slot));
  PetscCall(PetscFree(c->united));
  PetscCall(PetscFree(c->body_node));
  PetscCall(PetscSFDestroy(&c->rigid_sf));
  PetscCall(PetscSFDestroy(&c->known_sf));
  PetscCall(PetscFree(c->slot_of));
  PetscCall(PetscLayoutDestroy(&c->numbers));
  PetscCall(SharingDestroy(&c->sharing));
  PetscCall(RowTypeDestroy(&c->rigid_type));
  PetscCall(PetscFree(*constraint));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetLengths(Constraint c, const PetscReal length[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(c->length, length, c->nbodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetBoundary(Constraint c, const unsigned char fixed[], const PetscReal value[])
{
  const MeshLocal *l = c->loc;
  PetscBool        same;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycmp(c->fixed, fixed, l->nnode_all, &same));
  PetscCall(PetscArraycpy(c->fixed, fixed, l->nnode_all));
  c->value = value;
  if (!same) {
    PetscCall(collect_rows(c));
    c->followers_changed = PETSC_TRUE;
    for (PetscInt j = 0; j < c->ninert; j++)
      if (c->body[j] >= 0) c->local_body[j] = c->local_index[c->body[j]];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetFollowers(Constraint c, const PetscInt follow[], PetscInt nmore, const PetscInt more[])
{
  PetscBool same = (PetscBool)(nmore == c->nmore);

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->loc->nnode_all; i++) {
    const PetscInt k = follow ? follow[i] : -1;

    if (k != c->follow[i]) same = PETSC_FALSE;
    c->follow[i] = k;
  }
  for (PetscInt j = 0; j < nmore && same; j++) same = (PetscBool)(more[j] == c->more[j]);
  if (!same) c->followers_changed = PETSC_TRUE;
  PetscCall(RoomFor(nmore, &c->more_room, &c->more, sizeof(*c->more), NULL));
  PetscCall(PetscArraycpy(c->more, more, nmore));
  c->nmore = nmore;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetPartners(Constraint c, PetscInt n, const PetscInt pair[][2])
{
  PetscBool same = (PetscBool)(n == c->npartners);

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < n && same; j++) same = (PetscBool)(pair[j][0] == c->partner[j][0] && pair[j][1] == c->partner[j][1]);
  if (same) PetscFunctionReturn(PETSC_SUCCESS);
  c->followers_changed = PETSC_TRUE;
  PetscCall(RoomFor(n, &c->partner_room, &c->partner, sizeof(*c->partner), NULL));
  if (n) PetscCall(PetscMemcpy(c->partner, pair, (size_t)n * sizeof(*c->partner)));
  c->npartners = n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetBodies(Constraint c, const PetscInt node_body[], PetscReal (*X)[3], const PetscInt unknown[], const PetscReal U[],
                                   PetscBool *changed)
{
  const MeshLocal *l       = c->loc;
  PetscBool        same[3] = {PETSC_TRUE, PETSC_TRUE, PETSC_TRUE}, moved;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    const PetscInt k = c->fixed[i] ? -1 : node_body[i]; /* walls win */

    if (k != c->node_body[i]) same[0] = PETSC_FALSE;
    c->node_body[i] = k;
  }
  PetscCall(PetscArraycmp((PetscReal *)c->X, (PetscReal *)X, 3 * c->nbodies, &same[1]));
  PetscCall(PetscArraycmp(c->unknown, unknown, c->nbodies, &same[2]));
  moved = (PetscBool)(!c->have_bodies || c->followers_changed || !same[0] || !same[1] || !same[2]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &moved, 1, COMPAT_MPI_BOOL, MPI_LOR, PETSC_COMM_WORLD));
  c->have_bodies = PETSC_TRUE;
  PetscCall(PetscArraycpy((PetscReal *)c->X, (PetscReal *)X, 3 * c->nbodies));
  PetscCall(PetscArraycpy(c->unknown, unknown, c->nbodies));
  PetscCall(PetscArraycpy(c->U, U, c->nbodies * c->nr));
  c->followers_changed = PETSC_FALSE;
  if (moved) {
    PetscCall(PetscLogEventBegin(TB_PROJECT, 0, 0, 0, 0));
    PetscCall(collect_rows(c));
    PetscCall(collect_followers(c));
    PetscCall(connect_rigid_slots(c));
    PetscCall(list_body_nodes(c));
    PetscCall(PetscLogEventEnd(TB_PROJECT, 0, 0, 0, 0));
  }
  if (changed) *changed = moved;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintSetUnited(Constraint c, const PetscBool united[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(c->united, united, c->nbodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintGetRigidSize(Constraint c, PetscInt *nr)
{
  PetscFunctionBeginUser;
  *nr = c->nr;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintGetSizes(Constraint c, PetscInt *nodal, PetscInt *total)
{
  PetscFunctionBeginUser;
  if (nodal) *nodal = c->loc->nnode * c->loc->dim;
  if (total) *total = c->loc->nnode * c->loc->dim + c->count * c->nr;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintCreateVec(Constraint c, Vec *ur)
{
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetSizes(c, NULL, &n));
  PetscCall(VecCreateMPI(PETSC_COMM_WORLD, n, PETSC_DETERMINE, ur));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintGetNodeBody(Constraint c, const PetscInt *node_body[])
{
  PetscFunctionBeginUser;
  *node_body = c->node_body;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintRigidMap(Constraint c, PetscInt i, PetscInt k, PetscReal R[])
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < c->loc->dim; a++) rigid_row(c->loc, i, a, c->X[k], R + a * c->nr);
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ConstraintRigidAt(const MeshLocal *l, PetscInt i, const PetscReal X[3], PetscReal R[])
{
  for (PetscInt a = 0; a < l->dim; a++) rigid_row(l, i, a, X, R + a * (l->dim == 2 ? 3 : 6));
}
