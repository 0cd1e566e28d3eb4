/* Contact, bonds: which pairs are bonded, at the start and later, and which bonds break (see contact/bonds.h). */
#include "compat.h"
#include "bond.h"
#include "base/array.h"
#include "base/exact.h"
#include "base/opt.h"
#include "base/sparse.h"
#include "bodies/local.h"

#define GAP        0.01 /* in the smaller radius, up to which bodies touch */
#define MAX_GROUPS 256

PetscBool ContactHasBonds(Contact c)
{
  return (PetscBool)(c->bonds != NULL);
}

/* ---- options ---- */

static PetscErrorCode read_groups(Contact c, Bonds b)
{
  PetscInt n = MAX_GROUPS;
  char    *name[MAX_GROUPS];

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(c->s->ngroups + 1, &b->select.group));
  PetscCall(OptStringArray("-contact_bond_groups", &n, name));
  for (PetscInt g = 0; g < c->s->ngroups; g++) b->select.group[g] = (PetscBool)(n == 0);
  for (PetscInt i = 0; i < n; i++) {
    PetscBool same = PETSC_FALSE;

    for (PetscInt g = 0; g < c->s->ngroups && !same; g++) {
      PetscCall(PetscStrcmp(name[i], c->s->group[g].name, &same));
      if (same) b->select.group[g] = PETSC_TRUE;
    }
    PetscCheck(same, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "-contact_bond_groups names '%s', which is none of -particle_groups: correct it", name[i]);
    PetscCall(PetscFree(name[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int compare_pairs(const void *a, const void *b)
{
  const PetscInt *p = (const PetscInt *)a, *q = (const PetscInt *)b;

  if (p[0] != q[0]) return p[0] < q[0] ? -1 : 1;
  return p[1] < q[1] ? -1 : p[1] > q[1];
}

/* Lines of two numbers of bodies; # begins a comment */
static PetscErrorCode read_pairs(Contact c, const char name[], BondSelection *s)
{
  PetscInt capacity = 0, number = 0;
  char     line[256];
  FILE    *file = fopen(name, "r");

  PetscFunctionBeginUser;
  PetscCheck(file, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "Cannot read -contact_bond_file %s: correct the path", name);
  while (fgets(line, sizeof(line), file)) {
    long long i, j;

    number++;
    if (line[strspn(line, " \t\r\n")] == 0 || line[strspn(line, " \t")] == '#') continue;
    PetscCheck(sscanf(line, "%lld%*[ ,;\t]%lld", &i, &j) == 2 && i != j && PetscMin(i, j) >= 0 &&
                 PetscMax(i, j) < c->s->nall,
               PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s:%" PetscInt_FMT
               ": a line of -contact_bond_file has the numbers of two bodies, from 0 to %" PetscInt_FMT ": correct it",
               name, number, c->s->nall - 1);
    PetscCall(ArrayReserve(s->npairs + 1, &capacity, &s->pair, sizeof(*s->pair), NULL));
    s->pair[s->npairs][0]   = (PetscInt)PetscMin(i, j);
    s->pair[s->npairs++][1] = (PetscInt)PetscMax(i, j);
  }
  (void)fclose(file);
  PetscCheck(s->npairs > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_bond_file %s has no pairs: give a line for each, the numbers of both bodies, or remove the option",
             name);
  qsort(s->pair, (size_t)s->npairs, sizeof(*s->pair), compare_pairs);
  for (PetscInt p = 1; p < s->npairs; p++)
    PetscCheck(compare_pairs(s->pair[p - 1], s->pair[p]), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "-contact_bond_file %s has the pair %" PetscInt_FMT " %" PetscInt_FMT " twice: remove a line", name,
               s->pair[p][0], s->pair[p][1]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_selection(Contact c, Bonds b)
{
  static const char *const FORMS[]                  = {"start", "contact", "slow", NULL};
  PetscInt                 forms                    = 0;
  char                     file[PETSC_MAX_PATH_LEN] = "";

  PetscFunctionBeginUser;
  b->select.gap   = -1;
  b->select.speed = PETSC_MAX_REAL;
  PetscCall(OptString("-contact_bond_file", file, sizeof(file)));
  b->select.touching = (PetscBool)!file[0];
  PetscCall(OptBool("-contact_bond_touching", &b->select.touching));
  PetscCall(OptBool("-contact_bond_walls", &b->select.walls));
  PetscCall(OptReal("-contact_bond_gap", &b->select.gap));
  PetscCall(OptChoice("-contact_bond_forms", FORMS, &forms));
  b->select.later = (PetscBool)(forms > 0);
  if (forms == 2) PetscCall(OptReal("-contact_bond_speed", &b->select.speed));
  PetscCheck(forms < 2 || b->select.speed < PETSC_MAX_REAL, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_bond_forms slow needs -contact_bond_speed: the speed below which bodies that touch are bonded");
  PetscCheck(!b->select.later || c->law->lookahead, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_bond_forms %s needs the search of contact: give another -contact_law than none", FORMS[forms]);
  PetscCall(read_groups(c, b));
  if (file[0]) PetscCall(read_pairs(c, file, &b->select));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCreateBonds(Contact c)
{
  PetscBool wanted = PETSC_FALSE;
  PetscReal max    = 0;
  Bonds     b;

  PetscFunctionBeginUser;
  if (!c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&b));
  PetscCall(BondReadLaw(b, &wanted));
  if (!wanted) PetscCall(PetscFree(b));
  if (!wanted) PetscFunctionReturn(PETSC_SUCCESS);
  c->bonds = b;
  PetscCall(read_selection(c, b));
  PetscCall(BodiesAttach(c->bodies, sizeof(*b->force), (void **)&b->force));
  for (PetscInt i = 0; i < c->kinds.n; i++) max = PetscMax(max, c->kinds.kind[i].radius);
  PetscCall(BodiesMax(c->bodies, 1, &max));
  c->horizon = PetscMax(c->horizon, b->select.gap < 0 ? GAP * max : b->select.gap);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactDestroyBonds(Contact c)
{
  Bonds b = c->bonds;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesDetach(c->bodies, (void **)&b->slot));
  PetscCall(BodiesDetach(c->bodies, (void **)&b->force));
  PetscCall(PetscFree(b->select.group));
  PetscCall(PetscFree(b->select.pair));
  PetscCall(PetscFree(b->bond));
  PetscCall(PetscFree(b->event));
  PetscCall(PetscFree(c->list.bonded));
  PetscCall(PetscFree(c->bonds));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- bonds that form ---- */

/* In the run bodies touch where they feel the law of contact, which may let them come no nearer */
static PetscReal touching_gap(Contact c, const Pair *p, PetscBool start)
{
  const PetscReal gap = GAP * ContactSmallerRadius(c, p);

  if (c->bonds->select.gap >= 0) return c->bonds->select.gap;
  return start ? gap : PetscMax(gap, c->range);
}

/* May the pair be bonded, wherever it is? */
static PetscBool is_selected(Contact c, const Pair *p, PetscBool start)
{
  const BondSelection *s  = &c->bonds->select;
  const PetscInt       ni = c->s->number[p->i], nj = p->j >= 0 ? c->s->number[p->j] : -1;
  const PetscInt       key[] = {PetscMin(ni, nj), PetscMax(ni, nj)};

  if (start && p->j >= 0 && s->pair && bsearch(key, s->pair, (size_t)s->npairs, sizeof(*s->pair), compare_pairs))
    return PETSC_TRUE;
  if (!s->group[c->s->body_group[p->i]]) return PETSC_FALSE;
  if (p->j < 0) return (PetscBool)(s->walls && (start || s->later));
  if (start ? !s->touching : !s->later) return PETSC_FALSE;
  return s->group[c->s->body_group[p->j]];
}

/* Where the pair is nearest: from the centre of i to the middle of the gap, direction towards i. *touches: near enough?
   */
static PetscErrorCode find_nearest_points(Contact c, const Pair *p, PetscBool start, PetscReal r[3],
                                          PetscReal normal[3], PetscBool *touches)
{
  PetscInt     n;
  PetscReal    gap, near_by = touching_gap(c, p, start);
  const Touch *best = NULL;

  PetscFunctionBeginUser;
  *touches = PETSC_FALSE;
  PetscCall(ContactFindTouch(c, p->i, p->j, &n, &gap));
  if (gap > near_by) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < n; k++)
    if (!best || c->touch[k].gap < best->gap) best = &c->touch[k];
  if (!best) PetscFunctionReturn(PETSC_SUCCESS);
  *touches = PETSC_TRUE;
  for (PetscInt a = 0; a < 3; a++) {
    normal[a] = best->normal[a];
    r[a]      = ContactKind(c, p->i)->disc > 0 ? -(ContactKind(c, p->i)->disc + 0.5 * gap) * normal[a] : best->ri[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Out of space into the axes of a body */
static void turn_back(const PetscReal q[4], const PetscReal x[3], PetscReal y[3])
{
  PetscReal R[9];

  RotationMatrix(q, R);
  for (PetscInt a = 0; a < 3; a++) y[a] = R[a] * x[0] + R[3 + a] * x[1] + R[6 + a] * x[2];
}

static void fill_record(Contact c, const Pair *p, const PetscReal r[3], const PetscReal normal[3], PetscReal time,
                        BondRecord *record)
{
  PetscReal       partner, d[3], arm[2][3], none[4] = {1, 0, 0, 0}, back[4], axis[3];
  const PetscInt  k = ContactGetCarrier(c, p, &partner), j = k == p->i ? p->j : p->i;
  const PetscReal side = k == p->i ? 1 : -1, *qk = c->s->q[k], *qj = j >= 0 ? c->s->q[j] : none;

  for (PetscInt a = 0; a < 3; a++) d[a] = p->j >= 0 ? c->s->x[p->i][a] - c->s->x[p->j][a] : 0; /* j to i */
  if (p->j >= 0) ContactWrap(c, d);
  for (PetscInt a = 0; a < 3; a++) {
    const PetscReal of_j = p->j >= 0 ? r[a] + d[a] : c->s->x[p->i][a] + r[a];

    arm[0][a] = k == p->i ? r[a] : of_j;
    arm[1][a] = k == p->i ? of_j : r[a];
    axis[a]   = -side * normal[a];
  }
  *record = (BondRecord){.partner = partner, .formed = time};
  turn_back(qk, arm[0], record->end[0]);
  turn_back(qj, arm[1], record->end[1]);
  turn_back(qk, axis, record->axis);
  RotationInvert(qk, back);
  RotationMultiply(back, qj, record->turn);
  record->radius = c->bonds->par.radius * ContactSmallerRadius(c, p);
  record->length = p->j >= 0 ? PetscSqrtReal(dot3(d, d)) : PetscSqrtReal(dot3(r, r));
}

/* Speed at which the pair moves where it touches is below the bound? */
static PetscErrorCode is_slow(Contact c, const Pair *p, const PetscReal r[3], const PetscReal normal[3],
                              PetscBool *slow)
{
  PetscReal v[3], rj[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3 && p->j >= 0; a++) rj[a] = c->x[p->i][a] - c->x[p->j][a];
  ContactWrap(c, rj);
  for (PetscInt a = 0; a < 3; a++) rj[a] += r[a];
  PetscCall(ContactRelativeVelocity(c, p, r, rj, normal, v));
  *slow = (PetscBool)(dot3(v, v) <= PetscSqr(PetscMin(c->bonds->select.speed, 1e100)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* New records [n], at most one a pair of the list, and their carriers */
typedef struct {
  PetscInt    n, capacity, *carrier;
  BondRecord *record;
} NewBonds;

static PetscErrorCode find_new(Contact c, PetscReal time, PetscBool start, NewBonds *new)
{
  PetscFunctionBeginUser;
  for (PetscInt p = 0; p < c->list.n; p++) {
    const Pair *pair = &c->list.pair[p];
    PetscReal   r[3], normal[3], partner;
    PetscBool   touches;

    if (c->s->removed[pair->i] || !is_selected(c, pair, start) || BondFind(c, pair)) continue;
    PetscCall(find_nearest_points(c, pair, start, r, normal, &touches));
    if (touches && !start) PetscCall(is_slow(c, pair, r, normal, &touches));
    if (!touches) continue;
    PetscCall(ArrayReserve(new->n + 1, &new->capacity, &new->carrier, sizeof(*new->carrier), &new->record,
                           sizeof(*new->record), NULL));
    new->carrier[new->n] = ContactGetCarrier(c, pair, &partner);
    fill_record(c, pair, r, normal, time, &new->record[new->n++]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode form_bonds(Contact c, PetscReal time, PetscBool start, PetscBool *any)
{
  Bonds b       = c->bonds;
  NewBonds new  = {0};
  PetscReal max = 0;
  PetscInt *count;

  PetscFunctionBeginUser;
  PetscCall(find_new(c, time, start, &new));
  *any = (PetscBool)(new.n > 0);
  PetscCall(BodiesAny(c->bodies, any));
  if (!*any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(c->s->n, &count));
  for (PetscInt e = 0; e < c->s->n * b->max_bonds; e++) count[e / b->max_bonds] += b->slot[e].partner != 0;
  for (PetscInt e = 0; e < new.n; e++) max = PetscMax(max, ++count[new.carrier[e]]);
  PetscCall(PetscFree(count));
  PetscCall(BodiesMax(c->bodies, 1, &max));
  PetscCall(BondReserve(c, (PetscInt)max));
  for (PetscInt e = 0; e < new.n; e++) {
    const PetscInt k = new.carrier[e];
    PetscInt       m = k * b->max_bonds;

    while (b->slot[m].partner != 0) m++;
    b->slot[m] = new.record[e];
    PetscCall(BondNote(c, &b->slot[m], k, time, start ? BOND_START : BOND_CONTACT));
  }
  PetscCall(BodiesUpdateGhosts(c->bodies, BOND_REALS * b->max_bonds, b->slot));
  b->listed = PETSC_FALSE;
  PetscCall(PetscFree(new.carrier));
  PetscCall(PetscFree(new.record));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bonds of all ranks between bodies */
static PetscErrorCode count_pairs(Contact c, PetscInt *n)
{
  PetscReal sum = 0;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < c->s->n * c->bonds->max_bonds; e++)
    if (c->s->own[e / c->bonds->max_bonds] && c->bonds->slot[e].partner > 0) sum++;
  PetscCall(BodiesSum(c->bodies, 1, &sum));
  *n = (PetscInt)sum;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactStartBonds(Contact c)
{
  Bonds      b      = c->bonds;
  PetscInt   npairs = 0;
  PetscBool  any;
  BondTotals totals;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  b->searching = PETSC_TRUE;
  PetscCall(ContactFindPairs(c));
  PetscCall(form_bonds(c, c->s->time, PETSC_TRUE, &any));
  b->searching = PETSC_FALSE;
  if (c->law->lookahead) PetscCall(BondMarkPairs(c));
  else c->list.valid = PETSC_FALSE;
  if (!c->law->lookahead) c->list.n = 0;
  PetscCall(ContactGetBondTotals(c, &totals));
  PetscCall(count_pairs(c, &npairs));
  PetscCheck(totals.n > 0 || b->select.later, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_bond_law bonds nothing: no two bodies touch within -contact_bond_gap at the start. Raise it, move them, or give -contact_bond_forms contact");
  PetscCheck(!b->select.pair || b->select.touching || npairs >= b->select.npairs, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_bond_file has %" PetscInt_FMT " pairs, of which %" PetscInt_FMT
             " touch within -contact_bond_gap: raise that, or correct the file",
             b->select.npairs, npairs);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the end of a step ---- */

static PetscErrorCode break_bonds(Contact c, PetscReal time, PetscBool *any)
{
  Bonds b = c->bonds;

  PetscFunctionBeginUser;
  *any = PETSC_FALSE;
  for (PetscInt e = 0; e < b->n; e++) {
    Bond     *bond = &b->bond[e];
    BondCause cause;

    PetscCall(BondStore(c, bond));
    if (c->s->removed[bond->i] || (bond->j >= 0 && c->s->removed[bond->j])) cause = BOND_LEFT;
    else if (!BondBreaks(b, c->dim, bond->record, time, &cause)) continue;
    PetscCall(BondNote(c, bond->record, bond->i, time, cause));
    bond->record->partner = 0;
    *any                  = PETSC_TRUE;
  }
  PetscCall(BodiesAny(c->bodies, any));
  if (*any) b->listed = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Ends on walls go with them */
static PetscErrorCode move_ends(Contact c, PetscReal dt)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < c->bonds->n && c->domain.wall.velocity; e++) {
    Bond     *b = &c->bonds->bond[e];
    PetscReal v[3];

    if (b->j >= 0) continue;
    PetscCall(ContactGetWallVelocity(c, b->j, b->record->end[1], b->frame.axis[0], v));
    for (PetscInt a = 0; a < 3; a++) b->record->end[1][a] += dt * v[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondFinishStep(Contact c, PetscReal time, PetscReal dt)
{
  PetscBool broke, formed = PETSC_FALSE;

  PetscFunctionBeginUser;
  c->x = c->s->x;
  c->q = c->s->q;
  c->u = c->s->u;
  c->w = c->s->w;
  PetscCall(move_ends(c, dt));
  PetscCall(break_bonds(c, time, &broke));
  if (c->bonds->select.later && c->list.valid) PetscCall(form_bonds(c, time, PETSC_FALSE, &formed));
  if ((broke || formed) && c->list.valid) PetscCall(BondMarkPairs(c));
  PetscCall(BondList(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- questions ---- */

PetscErrorCode BondGetEnergy(Contact c, PetscReal *stored)
{
  Bonds b   = c->bonds;
  Exact sum = {{0}, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < c->s->n * b->max_bonds; e++)
    if (c->s->own[e / b->max_bonds] && b->slot[e].partner != 0) ExactAdd(&sum, b->slot[e].stored);
  PetscCall(ExactGetSum(BodiesComm(c->bodies), &sum, stored));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetBondTotals(Contact c, BondTotals *t)
{
  Bonds     b        = c->bonds;
  PetscReal sum[3]   = {0, 0, 0};
  Exact     released = {{0}, 0, 0};

  PetscFunctionBeginUser;
  *t = (BondTotals){0};
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < c->s->n * b->max_bonds; e++)
    sum[0] += c->s->own[e / b->max_bonds] && b->slot[e].partner != 0;
  sum[1] = b->formed;
  sum[2] = b->broken;
  ExactAdd(&released, b->released);
  PetscCall(BodiesSum(c->bodies, 3, sum));
  PetscCall(ExactGetSum(BodiesComm(c->bodies), &released, &t->released));
  PetscCall(BondGetEnergy(c, &t->stored));
  t->n      = (PetscInt)sum[0];
  t->formed = (PetscInt)sum[1];
  t->broken = (PetscInt)sum[2];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int compare_events(const void *a, const void *b)
{
  const BondEvent *p = (const BondEvent *)a, *q = (const BondEvent *)b;

  if (p->time != q->time) return p->time < q->time ? -1 : 1;
  if (p->i != q->i) return p->i < q->i ? -1 : 1;
  return p->j < q->j ? -1 : p->j > q->j;
}

PetscErrorCode ContactTakeBondEvents(Contact c, PetscInt *n, BondEvent *event[])
{
  Bonds b = c->bonds;

  PetscFunctionBeginUser;
  PetscCall(SparseGather(BodiesComm(c->bodies), b->nevents, sizeof(BondEvent), b->event, n, event, NULL));
  qsort(*event, (size_t)*n, sizeof(BondEvent), compare_events);
  PetscCall(PetscFree(b->event)); /* those of the start are many */
  b->nevents = b->event_capacity = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetBonds(Contact c, PetscInt *n, BondView *bond[])
{
  Bonds b = c->bonds;

  PetscFunctionBeginUser;
  *n = 0;
  PetscCall(BondList(c));
  PetscCall(PetscMalloc1(b->n + 1, bond));
  for (PetscInt e = 0; e < b->n; e++) {
    const PetscInt    i = b->bond[e].i, j = b->bond[e].j;
    const BondRecord *r  = b->bond[e].record;
    BondView         *to = &(*bond)[*n];

    if (!c->s->own[i]) continue;
    *to = (BondView){.i = c->s->number[i], .j = j >= 0 ? c->s->number[j] : j, .stored = r->stored, .formed = r->formed};
    for (PetscInt a = 0; a < 4; a++) to->load[a] = r->load[a];
    for (PetscInt a = 0; a < 3; a++) to->x[a] = c->s->x[i][a];
    for (PetscInt a = 0; a < 3; a++) to->offset[a] = (j >= 0 ? c->s->x[j][a] : r->end[1][a]) - to->x[a];
    ContactWrap(c, to->offset);
    (*n)++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
