/* RowPool: see rowpool.h. */
#include "compat.h"
#include "rowpool.h"
#include "base/room.h"

#define SLACK 4

/* Of the bits that are kept (Fowler, Noll, Vo, by words instead of bytes) */
static PetscInt64 compute_key(const RowPool *p, PetscInt n, const PetscReal value[])
{
  uint64_t key = 14695981039346656037u;

  for (PetscInt e = 0; e < n; e++) {
    const PetscReal v = p->keep ? value[e] : (PetscReal)(float)value[e];
    uint64_t        bits;

    memcpy(&bits, &v, sizeof(bits));
    key = (key ^ bits ^ bits >> 29) * 1099511628211u;
  }
  return (PetscInt64)(key ^ key >> 32);
}

static PetscBool is_equal(const RowPool *p, PetscInt n, const PetscReal value[], PetscInt at)
{
  const float *row = p->value + at * p->unit;

  if (p->keep) return (PetscBool)!memcmp(value, p->exact + at * p->unit, (size_t)n * sizeof(*value));
  for (PetscInt e = 0; e < n; e++)
    if ((float)value[e] != row[e]) return PETSC_FALSE;
  return PETSC_TRUE;
}

/* The slot of a row: with the kind that it is of, or empty. There are more slots than kinds. */
static PetscInt find_slot(const RowPool *p, PetscInt64 key, PetscInt length, const PetscReal value[])
{
  for (PetscInt s = (PetscInt)(key & p->mask);; s = (s + 1) & p->mask) {
    const RowKind *kind = p->slot[s] < 0 ? NULL : p->kind + p->slot[s];

    if (!kind || (kind->key == key && kind->length == length && is_equal(p, length * p->unit, value, kind->at))) return s;
  }
}

/* A new place for length blocks */
static PetscErrorCode take_place(RowPool *p, PetscInt length, PetscInt *at)
{
  PetscFunctionBeginUser;
  if (p->used + length > p->room) {
    const PetscInt room  = PetscMax(p->used + length, p->room + p->room / 4);
    const size_t   begin = (size_t)(p->used * p->unit), end = (size_t)(room * p->unit + SLACK);

    p->room = room;
    PetscCall(PetscRealloc(end * sizeof(float), &p->value));
    PetscCall(PetscArrayzero(p->value + begin, end - begin));
    if (p->keep) PetscCall(PetscRealloc(end * sizeof(PetscReal), &p->exact));
    if (p->keep) PetscCall(PetscArrayzero(p->exact + begin, end - begin));
  }
  *at = p->used;
  p->used += length;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RowPoolSet(RowPool *p, PetscInt i, PetscInt length, const PetscReal value[], PetscBool many)
{
  const PetscInt   n    = length * p->unit;
  const PetscInt64 key  = compute_key(p, n, value);
  const PetscInt   slot = find_slot(p, key, length, value);

  PetscFunctionBeginUser;
  if (p->slot[slot] >= 0) {
    p->at[i] = p->kind[p->slot[slot]].at;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (many && p->nkind < p->n) {
    PetscCall(RoomFor(p->nkind + 1, &p->kind_room, &p->kind, sizeof(*p->kind), NULL));
    PetscCall(take_place(p, length, &p->at[i]));
    p->kind[p->nkind] = (RowKind){key, p->at[i], length};
    p->slot[slot]     = p->nkind++;
  } else {
    if (p->own[i] < 0) PetscCall(take_place(p, length, &p->own[i]));
    p->at[i] = p->own[i];
  }
  for (PetscInt e = 0; e < n; e++) p->value[p->at[i] * p->unit + e] = (float)value[e];
  if (p->keep) PetscCall(PetscArraycpy(p->exact + p->at[i] * p->unit, value, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void RowPoolClear(RowPool *p)
{
  p->used = p->nkind = 0;
  for (PetscInt i = 0; i < p->n; i++) p->at[i] = 0, p->own[i] = -1;
  for (PetscInt s = 0; s <= p->mask; s++) p->slot[s] = -1;
}

PetscErrorCode RowPoolCreate(PetscInt n, PetscInt unit, PetscBool exact, RowPool *p)
{
  PetscInt slots = 2;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(p, sizeof(*p)));
  while (slots < 2 * n) slots *= 2;
  p->n    = n;
  p->unit = unit;
  p->keep = exact;
  p->mask = slots - 1;
  PetscCall(PetscMalloc3(n, &p->at, n, &p->own, slots, &p->slot));
  RowPoolClear(p);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RowPoolDestroy(RowPool *p)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree3(p->at, p->own, p->slot));
  PetscCall(PetscFree(p->kind));
  PetscCall(PetscFree(p->value));
  PetscCall(PetscFree(p->exact));
  PetscFunctionReturn(PETSC_SUCCESS);
}
