/* Keys: see keys.h. */
#include "compat.h"
#include "keys.h"
#include "base/mix.h"

/* Where a key is or belongs */
static PetscInt find_slot(const Keys *t, uint64_t key)
{
  PetscInt i = (PetscInt)(Mix64(key) & (uint64_t)(t->capacity - 1));

  while (t->value[i] >= 0 && t->key[i] != key) i = (i + 1) & (t->capacity - 1);
  return i;
}

static PetscErrorCode grow(Keys *t)
{
  Keys more = {.capacity = t->capacity ? 2 * t->capacity : 1024};

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(more.capacity, &more.key, more.capacity, &more.value));
  for (PetscInt i = 0; i < more.capacity; i++) more.value[i] = -1;
  for (PetscInt i = 0; i < t->capacity; i++) {
    if (t->value[i] < 0) continue;
    const PetscInt at = find_slot(&more, t->key[i]);

    more.key[at]   = t->key[i];
    more.value[at] = t->value[i];
  }
  more.n = t->n;
  PetscCall(PetscFree2(t->key, t->value));
  *t = more;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode KeysDestroy(Keys *t)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree2(t->key, t->value));
  *t = (Keys){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscInt KeysFind(const Keys *t, uint64_t key)
{
  return t->capacity ? t->value[find_slot(t, key)] : -1;
}

PetscErrorCode KeysAdd(Keys *t, uint64_t key, PetscInt value, PetscInt *found)
{
  PetscInt at;

  PetscFunctionBeginUser;
  if (2 * t->n >= t->capacity) PetscCall(grow(t));
  at = find_slot(t, key);
  if (t->value[at] < 0) {
    t->key[at]   = key;
    t->value[at] = value;
    t->n++;
  }
  *found = t->value[at];
  PetscFunctionReturn(PETSC_SUCCESS);
}
