/* RowPool: see rowpool.h. */
#include "compat.h"
#include "rowpool.h"
#include "base/array.h"

#define SLACK 4
#define LANES 8

/* Of the bits that are kept (Fowler, Noll, Vo, by words instead of bytes), in lanes that do not wait for each other */
static PetscInt64 compute_key(const RowPool *p, PetscInt n, const PetscReal value[])
{
  const uint64_t prime = 1099511628211u;
  uint64_t       lane[LANES], key = 14695981039346656037u;

  for (int k = 0; k < LANES; k++) lane[k] = key + (uint64_t)k;
  for (PetscInt e = 0; e < n; e += LANES)
    for (int k = 0; k < LANES && e + k < n; k++) {
      const PetscReal v = p->keep ? value[e + k] : (PetscReal)(float)value[e + k];
      uint64_t        bits;

      memcpy(&bits, &v, sizeof(bits));
      lane[k] = (lane[k] ^ bits ^ bits >> 29) * prime;
    }
  for (int k = 0; k < LANES; k++) key = (key ^ lane[k] ^ lane[k] >> 29) * prime;
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

    if (!kind || (kind->key == key && kind->length == length && is_equal(p, length * p->unit, value, kind->at)))
      return s;
  }
}

/* A new place for length blocks. Room doubles until a good part of the rows has been set, and is made for all then. */
static PetscErrorCode take_place(RowPool *p, PetscInt length, PetscInt *at)
{
  PetscFunctionBeginUser;
  if (p->used + length > p->capacity) {
    const PetscBool early = (PetscBool)(4 * p->nset <= p->n);
    const PetscReal all   = early ? 0 : 1.02 * (PetscReal)p->used / (PetscReal)p->nset * (PetscReal)p->n;

    p->capacity = PetscMax(p->used + length,
                           PetscMax(p->capacity + (early ? p->capacity : p->capacity / 4), (PetscInt)all));
    PetscCall(PetscRealloc((size_t)(p->capacity * p->unit + SLACK) * sizeof(float), &p->value));
    if (p->keep) PetscCall(PetscRealloc((size_t)(p->capacity * p->unit + SLACK) * sizeof(PetscReal), &p->exact));
  }
  *at = p->used;
  p->used += length;
  for (PetscInt e = p->used * p->unit; e < p->used * p->unit + SLACK; e++) { /* which a vector may read */
    p->value[e] = 0;
    if (p->keep) p->exact[e] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Row i is of another kind from now on, or of none (-1) */
static void change_kind(RowPool *p, PetscInt i, PetscInt kind)
{
  if (p->kind_of[i] >= 0) p->kind[p->kind_of[i]].users--;
  p->kind_of[i] = kind;
  if (kind >= 0) p->kind[kind].users++;
}

/* A place of its own for row i: that of its kind if no other row is of it */
static PetscErrorCode take_own(RowPool *p, PetscInt i, PetscInt length)
{
  RowKind *kind = p->kind_of[i] >= 0 ? p->kind + p->kind_of[i] : NULL;

  PetscFunctionBeginUser;
  if (p->own[i] >= 0) PetscFunctionReturn(PETSC_SUCCESS);
  if (kind && kind->users == 1) {
    p->own[i]    = kind->at;
    kind->length = -1;
  } else PetscCall(take_place(p, length, &p->own[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RowPoolSet(RowPool *p, PetscInt i, PetscInt length, const PetscReal value[], PetscBool many)
{
  const PetscInt   n    = length * p->unit;
  const PetscInt64 key  = compute_key(p, n, value);
  const PetscInt   slot = find_slot(p, key, length, value);

  PetscFunctionBeginUser;
  p->nset = PetscMin(p->nset + 1, p->n);
  if (p->slot[slot] >= 0) {
    change_kind(p, i, p->slot[slot]);
    p->at[i] = p->kind[p->slot[slot]].at;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (many && p->nkind < p->n) {
    PetscCall(ArrayReserve(p->nkind + 1, &p->kind_capacity, &p->kind, sizeof(*p->kind), NULL));
    PetscCall(take_place(p, length, &p->at[i]));
    p->kind[p->nkind] = (RowKind){key, p->at[i], length, 0};
    p->slot[slot]     = p->nkind++;
    change_kind(p, i, p->slot[slot]);
  } else {
    PetscCall(take_own(p, i, length));
    change_kind(p, i, -1);
    p->at[i] = p->own[i];
  }
  for (PetscInt e = 0; e < n; e++) p->value[p->at[i] * p->unit + e] = (float)value[e];
  if (p->keep) PetscCall(PetscArraycpy(p->exact + p->at[i] * p->unit, value, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void RowPoolClear(RowPool *p)
{
  p->used = p->nkind = p->nset = 0;
  for (PetscInt i = 0; i < p->n; i++) p->at[i] = 0, p->own[i] = p->kind_of[i] = -1;
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
  PetscCall(PetscMalloc4(n, &p->at, n, &p->own, n, &p->kind_of, slots, &p->slot));
  RowPoolClear(p);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RowPoolDestroy(RowPool *p)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree4(p->at, p->own, p->kind_of, p->slot));
  PetscCall(PetscFree(p->kind));
  PetscCall(PetscFree(p->value));
  PetscCall(PetscFree(p->exact));
  PetscFunctionReturn(PETSC_SUCCESS);
}
