/* Contact, search: which bodies can touch before the list of pairs is made again.

   A body is entered in a grid of cells (grid.h) with half-width radius + half the horizon + its reach; pairs that share
   a cell are compared by their bounding circles. The reach holds the way of the coming step and a skin of a tenth of
   the radius, so that a list lasts until some body has used its share up; then all is made anew. Periodic directions:
   bodies near a face enter again as images beyond the other one. The list is sorted, so that the age of the list does
   not change the order in which forces add up. */
#include "compat.h"
#include "base/grid.h"
#include "base/array.h"
#include "bond.h"
#include "impl.h"
#include "base/log.h"

typedef struct {
  Contact   c;
  PetscInt  n, nimages, capacity; /* items: n bodies, then images */
  PetscInt *body;                 /* [nimages] of image n + m */
  PetscReal widest;               /* half-width: how far boxes stick out of the domain, to meet images there */
  PetscReal (*shift)[3];          /* [nimages] */
} Items;

/* Centre of body k, moved into the domain where that is periodic */
static void place_body(Contact c, PetscInt k, PetscReal x[3])
{
  for (PetscInt a = 0; a < 3; a++) x[a] = DomainWrap(c->domain.period[a], c->x[k][a], c->domain.lower[a]);
}

static PetscReal reach_of(Contact c, PetscInt k)
{
  return c->list.reach ? c->list.reach[k] : 0;
}

static PetscReal half_width(Contact c, PetscInt k)
{
  return ContactKind(c, k)->radius + 0.5 * c->horizon + c->list.listed[k].reach;
}

/* Of some rank? */
static PetscErrorCode list_is_old(Contact c, PetscBool *old)
{
  PetscFunctionBeginUser;
  *old = (PetscBool)!c->list.valid;
  for (PetscInt k = 0; k < c->s->n && !*old; k++) {
    const PetscReal d[3] = {c->x[k][0] - c->list.listed[k].x[0], c->x[k][1] - c->list.listed[k].x[1],
                            c->x[k][2] - c->list.listed[k].x[2]};
    const PetscReal left = c->list.listed[k].reach - reach_of(c, k);

    *old = (PetscBool)(left < 0 || dot3(d, d) > left * left);
  }
  PetscCall(BodiesAny(c->bodies, old));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* shift: where the image of j that is meant lies. In a small periodic box the same two bodies may meet several times:
   only the nearest image counts. */
static PetscErrorCode test_pair(Contact c, PetscInt i, PetscInt j, const PetscReal shift[3])
{
  const Kind     *ki = ContactKind(c, i), *kj = ContactKind(c, j);
  const PetscReal reach = ki->radius + kj->radius + c->horizon + c->list.listed[i].reach + c->list.listed[j].reach;
  PetscReal       d2    = 0, xi[3], xj[3];

  PetscFunctionBeginUser;
  c->count.tests++;
  if ((!c->s->own[i] && !c->s->own[j] && c->list.halo == 0) || (!ki->moves && !kj->moves) || c->s->removed[i] ||
      c->s->removed[j])
    PetscFunctionReturn(PETSC_SUCCESS);
  place_body(c, i, xi);
  place_body(c, j, xj);
  for (PetscInt a = 0; a < c->dim; a++) {
    const PetscReal d = xi[a] - xj[a] - shift[a];

    if (c->domain.period[a] > 0 && (d >= 0.5 * c->domain.period[a] || d < -0.5 * c->domain.period[a]))
      PetscFunctionReturn(PETSC_SUCCESS);
    d2 += d * d;
  }
  if (d2 < reach * reach) PetscCall(ContactAddPair(c, i, j));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* An image meets only bodies, and of the two ways in which a pair can meet across a face only the one that shifts the
   larger number counts. */
static PetscErrorCode visit_items(void *ctx, PetscInt a, PetscInt b)
{
  Items          *it      = (Items *)ctx;
  const PetscReal zero[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  if (b < it->n) PetscCall(test_pair(it->c, a, b, zero));
  else if (a < it->n && a < it->body[b - it->n])
    PetscCall(test_pair(it->c, a, it->body[b - it->n], it->shift[b - it->n]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_walls(Contact c, PetscInt k)
{
  const Kind *kind = ContactKind(c, k);

  PetscFunctionBeginUser;
  if (!kind->moves || c->s->removed[k] || !c->s->own[k]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactFindWalls(c, k, kind->radius + c->horizon + c->list.listed[k].reach));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- cells ---- */

static PetscReal count_entries(Contact c, PetscReal size)
{
  PetscReal sum = 0;

  for (PetscInt k = 0; k < c->s->n; k++) sum += PetscPowRealInt(1 + 2 * half_width(c, k) / size, c->dim);
  return sum;
}

/* Cells twice as wide as the smallest box, unless large bodies would then fill too many of them. */
static PetscReal choose_cell_size(Contact c)
{
  const PetscReal max  = (c->dim == 2 ? 8. : 20.) * c->s->n;
  PetscReal       size = PETSC_MAX_REAL;

  for (PetscInt k = 0; k < c->s->n; k++) size = PetscMin(size, 4 * half_width(c, k));
  while (count_entries(c, size) > max) size *= 2;
  return size;
}

static PetscErrorCode add_images(Items *it, Grid cells, PetscInt k)
{
  Contact         c    = it->c;
  const PetscReal half = half_width(c, k);
  PetscReal       x[3];

  PetscFunctionBeginUser;
  place_body(c, k, x);
  for (DomainImages i = {0};
       DomainNextImage(c->domain.period, c->domain.lower, c->domain.upper, x, half + it->widest, &i);) {
    if (i.shift[0] == 0 && i.shift[1] == 0 && i.shift[2] == 0) continue;
    PetscCall(
      ArrayReserve(it->nimages + 1, &it->capacity, &it->body, sizeof(*it->body), &it->shift, sizeof(*it->shift), NULL));
    it->body[it->nimages] = k;
    PetscCall(PetscArraycpy(it->shift[it->nimages], i.shift, 3));
    PetscCall(GridInsert(cells, it->n + it->nimages++, i.at, half));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The box of the bodies that this rank knows: images beyond it fall into its outermost cells */
static void bound_bodies(Contact c, PetscReal lower[3], PetscReal upper[3])
{
  PetscReal x[3];

  for (PetscInt a = 0; a < 3; a++) {
    lower[a] = c->domain.upper[a];
    upper[a] = c->domain.lower[a];
  }
  for (PetscInt k = 0; k < c->s->n; k++) {
    place_body(c, k, x);
    for (PetscInt a = 0; a < c->dim && !c->s->removed[k]; a++) {
      lower[a] = PetscMax(c->domain.lower[a], PetscMin(lower[a], x[a]));
      upper[a] = PetscMin(c->domain.upper[a], PetscMax(upper[a], x[a]));
    }
  }
}

static PetscErrorCode search_cells(Contact c)
{
  const PetscInt  n        = c->s->n;
  const PetscBool periodic = (PetscBool)(c->domain.period[0] > 0 || c->domain.period[1] > 0 || c->domain.period[2] > 0);
  Items           it       = {.c = c, .n = n};
  PetscReal       x[3], lower[3], upper[3];
  Grid            cells;

  PetscFunctionBeginUser;
  bound_bodies(c, lower, upper);
  PetscCall(GridCreate(c->dim, lower, upper, choose_cell_size(c), 4 * n + 64, &cells));
  for (PetscInt k = 0; k < n; k++) {
    place_body(c, k, x);
    it.widest = PetscMax(it.widest, half_width(c, k));
    if (!c->s->removed[k]) PetscCall(GridInsert(cells, k, x, half_width(c, k)));
  }
  for (PetscInt k = 0; k < n && periodic; k++)
    if (!c->s->removed[k]) PetscCall(add_images(&it, cells, k));
  PetscCall(GridForPairs(cells, visit_items, &it));
  PetscCall(GridDestroy(&cells));
  PetscCall(PetscFree(it.body));
  PetscCall(PetscFree(it.shift));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- all pairs ---- */

/* Pairs of bodies: two bodies at least, and one that moves */
static PetscErrorCode search_bodies(Contact c)
{
  PetscBool moves = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->kinds.n; i++) moves = (PetscBool)(moves || c->kinds.kind[i].moves);
  if (c->s->n < 2 || !moves) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_SEARCH, 0, 0, 0, 0));
  PetscCall(search_cells(c));
  PetscCall(PetscLogEventEnd(TB_SEARCH, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies go to their owners, and meet others there */
static PetscErrorCode migrate_bodies(Contact c, PetscReal range)
{
  PetscFunctionBeginUser;
  PetscCall(BodiesMigrate(c->bodies, range, 1 + CONTACT_SKIN));
  PetscCall(ContactUpdateLocalBodies(c));
  PetscCall(PetscFree(c->list.listed));
  PetscCall(PetscFree(c->list.reach));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where all ranks know all: bodies that grow are other ones, and the list of pairs goes by their sizes */
static PetscErrorCode update_sizes(Contact c)
{
  PetscBool grow = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < c->s->ngroups; g++) grow = (PetscBool)(grow || c->s->group[g].grows);
  if (!grow) PetscFunctionReturn(PETSC_SUCCESS);
  if (c->list.remembers && c->list.valid) PetscCall(ContactStoreSlips(c, &c->list.carried));
  PetscCall(ContactUpdateLocalBodies(c));
  c->list.valid = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactMigrate(Contact c, PetscReal dt, PetscReal (*a)[3])
{
  const BodyArrays *s            = c->s;
  const PetscReal   time         = 2 * dt; /* of the look-ahead; bodies are drawn nearer than twice their way */
  PetscReal         displacement = 0;

  PetscFunctionBeginUser;
  if (BodiesComm(c->bodies) == PETSC_COMM_SELF) {
    PetscCall(update_sizes(c));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal speed = PetscSqrtReal(PetscMax(dot3(s->u[k], s->u[k]), dot3(s->u_old[k], s->u_old[k])));

    displacement = PetscMax(displacement, time * (speed + (a ? 0.5 * time * PetscSqrtReal(dot3(a[k], a[k])) : 0)));
  }
  PetscCall(BodiesMax(c->bodies, 1, &displacement));
  if (c->list.remembers && c->list.valid) PetscCall(ContactStoreSlips(c, &c->list.carried));
  PetscCall(migrate_bodies(c, c->horizon + c->range + 2 * displacement));
  c->list.valid = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactFindPairs(Contact c)
{
  PetscBool anew;

  PetscFunctionBeginUser;
  if (!c->s->nall || (!c->law->lookahead && !(c->bonds && c->bonds->searching))) PetscFunctionReturn(PETSC_SUCCESS);
  c->count.tests = 0;
  PetscCall(list_is_old(c, &anew));
  if (!anew) PetscFunctionReturn(PETSC_SUCCESS);
  if (c->list.remembers && c->list.valid) PetscCall(ContactStoreSlips(c, &c->list.carried));
  if (BodiesComm(c->bodies) != PETSC_COMM_SELF && c->alone) PetscCall(migrate_bodies(c, c->horizon + c->list.halo));
  if (!c->list.listed) PetscCall(PetscMalloc1(PetscMax(1, c->s->n), &c->list.listed));
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscCall(PetscArraycpy(c->list.listed[k].x, c->x[k], 3));
    c->list.listed[k].reach = reach_of(c, k) + CONTACT_SKIN * ContactKind(c, k)->radius;
  }
  c->list.n = 0;
  PetscCall(search_bodies(c));
  for (PetscInt k = 0; k < c->s->n; k++) PetscCall(find_walls(c, k));
  PetscCall(ContactSortPairs(c));
  if (c->list.remembers) PetscCall(ContactLoadSlips(c, &c->list.carried));
  PetscCall(ContactForgetSlips(c, &c->list.carried));
  c->list.valid = PETSC_TRUE;
  c->count.lists++;
  if (c->bonds) PetscCall(BondMarkPairs(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- taking steps back ---- */

PetscErrorCode ContactKeep(Contact c)
{
  const BodyArrays *s = c->s;

  PetscFunctionBeginUser;
  if (!c->kept.force) PetscCall(BodiesAttach(c->bodies, sizeof(*c->kept.force), (void **)&c->kept.force));
  for (PetscInt k = 0; k < s->n; k++) {
    PetscCall(PetscArraycpy(c->kept.force[k], s->contact_force[k], 3));
    PetscCall(PetscArraycpy(c->kept.force[k] + 3, s->contact_torque[k], 3));
    c->kept.force[k][6] = s->gap[k];
  }
  if (c->list.slip) PetscCall(ContactStoreSlips(c, &c->kept.slips));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactRevert(Contact c)
{
  BodyArrays *s = c->s;

  PetscFunctionBeginUser;
  PetscCheck(c->kept.force || !s->n, PETSC_COMM_SELF, PETSC_ERR_ORDER,
             "Nothing has been kept: call ContactKeep before the step");
  for (PetscInt k = 0; k < s->n; k++) {
    PetscCall(PetscArraycpy(s->contact_force[k], c->kept.force[k], 3));
    PetscCall(PetscArraycpy(s->contact_torque[k], c->kept.force[k] + 3, 3));
    s->gap[k] = c->kept.force[k][6];
  }
  if (c->list.slip) PetscCall(ContactLoadSlips(c, &c->kept.slips)); /* the list of pairs may be another one now */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- state ---- */

PetscErrorCode ContactVisitState(void *contact, State state)
{
  Contact         c     = contact;
  const PetscBool keeps = (PetscBool)(!c->alone && BodiesComm(c->bodies) == PETSC_COMM_SELF);
  PetscInt        have  = c->list.valid && keeps;

  PetscFunctionBeginUser;
  PetscCall(StateReals(state, "work", 1, &c->work));
  PetscCall(StateReals(state, "separation", 1, &c->separation.largest));
  PetscCall(ContactVisitMeans(c, state));
  if (c->list.slip && !StateIsLoading(state) && c->list.valid) PetscCall(ContactStoreSlips(c, &c->list.carried));
  PetscCall(ContactVisitSlips(c, state, &c->list.carried));
  if (c->bonds) PetscCall(BondVisit(c, state));
  else if (StateIsLoading(state)) PetscCall(BondRefuseLoss(c, state));
  PetscCall(StateInts(state, "have_list", 1, &have));
  c->list.valid = (PetscBool)(have && keeps); /* else made anew, also where the file is of one rank, which knew all */
  if (!c->list.valid) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactVisitPairs(c, state));
  if (c->bonds && StateIsLoading(state)) PetscCall(BondMarkPairs(c));
  if (c->list.remembers && StateIsLoading(state)) PetscCall(ContactLoadSlips(c, &c->list.carried));
  PetscCall(ContactForgetSlips(c, &c->list.carried));
  PetscFunctionReturn(PETSC_SUCCESS);
}
