/* Contact, slip: what pairs remember, tangential springs and where they began, while the list of pairs is made anew,
   on other ranks perhaps, and in files. That of a pair goes with its carrier, by the partner's permanent number. All
   ranks that know a pair compute the same spring, and the owner of the carrier knows the pair. */
#include "compat.h"
#include "cohesion.h"

PetscInt ContactGetCarrier(Contact c, const Pair *p, PetscReal *other)
{
  const PetscBool j = (PetscBool)(p->j >= 0 && ContactKind(c, p->j)->radius < ContactKind(c, p->i)->radius);

  *other = p->j < 0 ? p->j : 1 + c->s->number[j ? p->i : p->j];
  return j ? p->j : p->i;
}

static PetscBool remembers(const PetscReal slip[])
{
  return (PetscBool)(dot3(slip, slip) > 0 || slip[3] != 0);
}

/* In the slots of body k, of that partner (0: the first that is free); NULL: none */
static PetscReal *find_slot(const Slips *s, PetscInt k, PetscReal partner)
{
  for (PetscInt m = 0; m < s->max_partners; m++)
    if (s->slot[(k * s->max_partners + m) * SLIP] == partner) return s->slot + (k * s->max_partners + m) * SLIP;
  return NULL;
}

PetscErrorCode ContactForgetSlips(Contact c, Slips *s)
{
  PetscFunctionBeginUser;
  PetscCall(BodiesDetach(c->bodies, (void **)&s->slot));
  s->max_partners = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_slots(Contact c, PetscInt max, Slips *s)
{
  PetscFunctionBeginUser;
  PetscCall(ContactForgetSlips(c, s));
  s->max_partners = max;
  if (max) PetscCall(BodiesAttach(c->bodies, max * SLIP * sizeof(PetscReal), (void **)&s->slot));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactStoreSlips(Contact c, Slips *s)
{
  PetscInt *count;
  PetscReal max = 0, other;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(c->s->n, &count));
  for (PetscInt p = 0; p < c->list.n; p++) {
    const PetscInt k = ContactGetCarrier(c, &c->list.pair[p], &other);

    if (remembers(c->list.slip[p])) max = PetscMax(max, ++count[k]);
  }
  PetscCall(PetscFree(count));
  PetscCall(BodiesMax(c->bodies, 1, &max));
  PetscCall(make_slots(c, (PetscInt)max, s));
  for (PetscInt p = 0; p < c->list.n; p++) {
    const PetscInt k = ContactGetCarrier(c, &c->list.pair[p], &other);

    if (remembers(c->list.slip[p])) {
      PetscReal *slot = find_slot(s, k, 0);

      slot[0] = other;
      for (PetscInt a = 0; a < SLIP - 1; a++) slot[1 + a] = c->list.slip[p][a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactLoadSlips(Contact c, const Slips *s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(c->list.slip));
  PetscCall(PetscCalloc1(c->list.n + 1, &c->list.slip));
  for (PetscInt p = 0; p < c->list.n && s->max_partners; p++) {
    PetscReal        other;
    const PetscInt   k    = ContactGetCarrier(c, &c->list.pair[p], &other);
    const PetscReal *slot = find_slot(s, k, other);

    for (PetscInt a = 0; a < SLIP - 1 && slot; a++) c->list.slip[p][a] = slot[1 + a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactVisitSlips(Contact c, State state, Slips *s)
{
  const PetscBool latches = (PetscBool)(c->cohesion && c->cohesion->law->latches);
  PetscInt        size    = 0;
  BodyRows        rows;

  PetscFunctionBeginUser;
  if (StateIsLoading(state)) {
    PetscCall(StateGetSize(state, "slips", &size));
    c->list.remembers = (PetscBool)(c->spring.friction > 0 || latches || (c->law->impulses && size > 0));
    if (!c->list.remembers) PetscCall(PetscFree(c->list.slip)); /* of the start */
    PetscCall(make_slots(c, (c->law->impulses || latches) && size > 0 ? size / (SLIP * c->s->nall) : 0, s));
  }
  if (!s->max_partners) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesBeginRows(c->bodies, &rows));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "slips", SLIP * s->max_partners, s->slot));
  PetscCall(BodiesEndRows(&rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}
