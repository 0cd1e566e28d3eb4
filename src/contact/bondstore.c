/* Contact, where bonds are kept: in slots of their carriers, attached to the bodies, so that they go from rank to rank
   and into files with them. The owner of the carrier knows the partner, because bonded bodies touch; all ranks that
   list a bond change it alike, and copies of carriers get what their owners have when bodies migrate. */
#include "compat.h"
#include "bond.h"
#include "base/array.h"

BondRecord *BondFind(Contact c, const Pair *p)
{
  const struct _p_Bonds *b = c->bonds;
  PetscReal              partner;
  const PetscInt         k = ContactGetCarrier(c, p, &partner);

  for (PetscInt m = 0; m < b->max_bonds; m++)
    if (b->slot[k * b->max_bonds + m].partner == partner) return &b->slot[k * b->max_bonds + m];
  return NULL;
}

/* Slots for `max` bonds a body, with what is in the old ones as far as there is room */
static PetscErrorCode set_max_bonds(Contact c, PetscInt max)
{
  Bonds          b = c->bonds;
  const PetscInt n = c->s->n, kept = PetscMin(max, b->max_bonds);
  BondRecord    *old;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n * kept, &old));
  for (PetscInt k = 0; k < n; k++)
    for (PetscInt m = 0; m < kept; m++) old[k * kept + m] = b->slot[k * b->max_bonds + m];
  PetscCall(BodiesDetach(c->bodies, (void **)&b->slot));
  if (max) PetscCall(BodiesAttach(c->bodies, max * sizeof(BondRecord), (void **)&b->slot));
  for (PetscInt k = 0; k < n; k++)
    for (PetscInt m = 0; m < kept; m++) b->slot[k * max + m] = old[k * kept + m];
  PetscCall(PetscFree(old));
  b->max_bonds = max;
  b->listed    = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondReserve(Contact c, PetscInt max)
{
  PetscFunctionBeginUser;
  if (max > c->bonds->max_bonds) PetscCall(set_max_bonds(c, max));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Local number of a body, -1: not known here */
static PetscInt find_local(Contact c, PetscInt number)
{
  PetscInt k;

  if (c->s->n == c->s->nall) return number;
  if (PetscFindInt(number, c->s->n, c->s->number, &k)) return -1;
  return k < 0 ? -1 : k;
}

static PetscErrorCode add_to_list(Contact c, PetscInt k, BondRecord *r)
{
  Bonds          b = c->bonds;
  const PetscInt j = r->partner > 0 ? find_local(c, (PetscInt)r->partner - 1) : (PetscInt)r->partner;

  PetscFunctionBeginUser;
  if (r->partner > 0 && (j < 0 || (!c->s->own[k] && !c->s->own[j]))) PetscFunctionReturn(PETSC_SUCCESS);
  if (r->partner < 0 && !c->s->own[k]) PetscFunctionReturn(PETSC_SUCCESS);
  b->bond[b->n++] = (Bond){.i = k, .j = j, .n = c->dim == 2 ? 3 : BOND_MODES, .record = r};
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* By carrier, then partner: the order in which their rows are summed up is that of no rank */
static int compare_bonds(const void *a, const void *b)
{
  const Bond     *p = (const Bond *)a, *q = (const Bond *)b;
  const PetscReal x = p->record->partner, y = q->record->partner;

  if (p->i != q->i) return p->i < q->i ? -1 : 1;
  return x < y ? -1 : x > y;
}

PetscErrorCode BondList(Contact c)
{
  Bonds    b = c->bonds;
  PetscInt n = 0;

  PetscFunctionBeginUser;
  if (b->listed) PetscFunctionReturn(PETSC_SUCCESS);
  b->listed = PETSC_TRUE;
  b->n      = 0;
  for (PetscInt e = 0; e < c->s->n * b->max_bonds; e++) n += b->slot[e].partner != 0;
  if (n > b->capacity) { /* as many as there are: in a list that grows by doubling half is room */
    PetscCall(PetscFree(b->bond));
    PetscCall(PetscMalloc1(n, &b->bond));
    b->capacity = n;
  }
  for (PetscInt k = 0; k < c->s->n; k++)
    for (PetscInt m = 0; m < b->max_bonds; m++)
      if (b->slot[k * b->max_bonds + m].partner != 0) PetscCall(add_to_list(c, k, &b->slot[k * b->max_bonds + m]));
  if (b->n > 1) qsort(b->bond, (size_t)b->n, sizeof(*b->bond), compare_bonds);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondMarkPairs(Contact c)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(c->list.bonded));
  PetscCall(PetscMalloc1(c->list.n + 1, &c->list.bonded));
  for (PetscInt p = 0; p < c->list.n; p++) c->list.bonded[p] = (PetscBool)(BondFind(c, &c->list.pair[p]) != NULL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what has happened ---- */

PetscErrorCode BondNote(Contact c, const BondRecord *r, PetscInt carrier, PetscReal time, BondCause cause)
{
  Bonds     b = c->bonds;
  PetscReal end[3], R[9];

  PetscFunctionBeginUser;
  if (!c->s->own[carrier]) PetscFunctionReturn(PETSC_SUCCESS);
  RotationMatrix(c->s->q[carrier], R);
  for (PetscInt a = 0; a < 3; a++) end[a] = c->s->x[carrier][a] + dot3(R + 3 * a, r->end[0]);
  PetscCall(ArrayReserve(b->nevents + 1, &b->event_capacity, &b->event, sizeof(*b->event), NULL));
  b->event[b->nevents] = (BondEvent){.time  = time,
                                     .i     = c->s->number[carrier],
                                     .j     = (PetscInt)r->partner,
                                     .cause = cause};
  if (r->partner > 0) b->event[b->nevents].j -= 1;
  for (PetscInt a = 0; a < 3; a++) b->event[b->nevents].x[a] = end[a];
  for (PetscInt a = 0; a < 4; a++) b->event[b->nevents].load[a] = cause <= BOND_CONTACT ? r->load[a] : r->mean[a];
  b->nevents++;
  if (cause <= BOND_CONTACT) b->formed++;
  else {
    b->broken++;
    b->released += r->stored;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- files ---- */

/* Sums of all ranks, which the first one goes on from */
static PetscErrorCode visit_counts(Contact c, State state)
{
  Bonds       b     = c->bonds;
  PetscReal   sum[] = {(PetscReal)b->formed, (PetscReal)b->broken, b->released};
  PetscMPIInt rank;

  PetscFunctionBeginUser;
  PetscCall(BodiesSum(c->bodies, 3, sum));
  PetscCall(StateReals(state, "bond_counts", 3, sum));
  PetscCallMPI(MPI_Comm_rank(BodiesComm(c->bodies), &rank));
  b->formed   = rank ? 0 : (PetscInt)sum[0];
  b->broken   = rank ? 0 : (PetscInt)sum[1];
  b->released = rank ? 0 : sum[2];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondRefuseLoss(Contact c, State state)
{
  PetscReal sum[3] = {0, 0, 0};
  PetscBool has;

  PetscFunctionBeginUser;
  PetscCall(StateHas(state, "bond_counts", &has));
  if (has) PetscCall(StateReals(state, "bond_counts", 3, sum));
  PetscCheck(sum[0] <= sum[1], BodiesComm(c->bodies), PETSC_ERR_USER_INPUT,
             "The checkpoint of -sim_restart has %" PetscInt_FMT
             " bonds, which hold bodies together: give -contact_bond_law, or start without -sim_restart",
             (PetscInt)(sum[0] - sum[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondVisit(Contact c, State state)
{
  Bonds     b   = c->bonds;
  PetscInt  max = b->max_bonds;
  PetscBool has = PETSC_TRUE;
  BodyRows  rows;

  PetscFunctionBeginUser;
  if (StateIsLoading(state)) PetscCall(StateHas(state, "bond_slots", &has));
  PetscCheck(has, BodiesComm(c->bodies), PETSC_ERR_USER_INPUT,
             "The checkpoint has no bonds: remove -contact_bond_law, or start without -sim_restart");
  PetscCall(StateInts(state, "bond_slots", 1, &max));
  if (StateIsLoading(state)) PetscCall(set_max_bonds(c, max));
  PetscCall(BodiesBeginRows(c->bodies, &rows));
  if (max) PetscCall(BodiesVisitReals(c->bodies, &rows, state, "bonds", BOND_REALS * max, (PetscReal *)b->slot));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "bond_force", 6, (PetscReal *)b->force));
  PetscCall(BodiesEndRows(&rows));
  PetscCall(visit_counts(c, state));
  if (!StateIsLoading(state)) PetscFunctionReturn(PETSC_SUCCESS);
  if (max) PetscCall(BodiesUpdateGhosts(c->bodies, BOND_REALS * max, b->slot));
  PetscCall(BodiesUpdateGhosts(c->bodies, 6, b->force));
  PetscCall(BodiesSync(c->bodies, PETSC_TRUE)); /* strains are found before the first step has done so */
  b->nevents = 0;
  b->listed  = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}
