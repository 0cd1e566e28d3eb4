/* Contact, the list of pairs: it grows, is brought into order, saved and loaded. What is in it says search.c. */
#include "compat.h"
#include "impl.h"
#include "base/array.h"

PetscErrorCode ContactAddPair(Contact c, PetscInt i, PetscInt j)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(c->list.n + 1, &c->list.capacity, &c->list.pair, sizeof(*c->list.pair), NULL));
  c->list.pair[c->list.n++] = (Pair){i, j};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactSortPairs(Contact c)
{
  Pair     *old = c->list.pair, *sorted;
  PetscInt *start;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(c->s->n + 1, &start));
  PetscCall(PetscMalloc1(c->list.n, &sorted));
  for (PetscInt p = 0; p < c->list.n; p++) start[old[p].i + 1]++;
  for (PetscInt k = 0; k < c->s->n; k++) start[k + 1] += start[k];
  for (PetscInt p = 0; p < c->list.n; p++) sorted[start[old[p].i]++] = old[p];
  PetscCall(PetscFree(start));
  for (PetscInt p = 1; p < c->list.n; p++) {
    const Pair now = sorted[p];
    PetscInt   at  = p;

    for (; at > 0 && sorted[at - 1].i == now.i && sorted[at - 1].j > now.j; at--) sorted[at] = sorted[at - 1];
    sorted[at] = now;
  }
  PetscCall(PetscFree(c->list.pair));
  c->list.pair     = sorted;
  c->list.capacity = c->list.n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactVisitPairs(Contact c, State state)
{
  PetscInt n = c->s->n;

  PetscFunctionBeginUser;
  PetscCall(StateInts(state, "pairs", 1, &c->list.n));
  if (StateIsLoading(state)) {
    c->list.capacity = c->list.n;
    PetscCall(PetscRealloc(c->list.n * sizeof(Pair), &c->list.pair));
    if (!c->list.listed) PetscCall(PetscMalloc1(n, &c->list.listed));
  }
  PetscCall(StateInts(state, "pair", 2 * c->list.n, (PetscInt *)c->list.pair));
  PetscCall(StateReals(state, "listed", 4 * n, (PetscReal *)c->list.listed));
  PetscFunctionReturn(PETSC_SUCCESS);
}
