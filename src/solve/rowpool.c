/* RowPool: see rowpool.h. */
#include "compat.h"
#include "rowpool.h"

#define MOST_KINDS 256    /* a box in space has some 30 */
#define ALIKE      2.4e-7 /* of the entry: twice the unit round-off of floats */
#define NOTHING    1e-13  /* of the largest entry: what should be zero */
#define SLACK      4

/* A sum that tells most rows apart; its terms are of the size of the entries */
static PetscReal add_up(PetscInt n, const PetscReal value[], PetscReal *size)
{
  PetscReal sum = 0;

  *size = 0;
  for (PetscInt e = 0; e < n; e++) {
    sum += value[e] * (1 + (PetscReal)(e * 7 % 11) / 16);
    *size = PetscMax(*size, PetscAbsReal(value[e]));
  }
  return sum;
}

static PetscBool is_alike(PetscInt n, const PetscReal value[], const float row[], PetscReal size)
{
  for (PetscInt e = 0; e < n; e++)
    if (PetscAbsReal(value[e] - row[e]) > ALIKE * PetscAbsReal(value[e]) + NOTHING * size) return PETSC_FALSE;
  return PETSC_TRUE;
}

/* A new place for length blocks */
static PetscErrorCode take_place(RowPool *p, PetscInt length, PetscInt *at)
{
  PetscFunctionBeginUser;
  if (p->used + length > p->room) {
    p->room = PetscMax(p->used + length, p->room + p->room / 4);
    PetscCall(PetscRealloc((size_t)(p->room * p->unit + SLACK) * sizeof(float), &p->value));
    PetscCall(PetscArrayzero(p->value + p->used * p->unit, (p->room - p->used) * p->unit + SLACK));
  }
  *at = p->used;
  p->used += length;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RowPoolSet(RowPool *p, PetscInt i, PetscInt length, const PetscReal value[], PetscBool many)
{
  const PetscInt  n = length * p->unit;
  PetscReal       size;
  const PetscReal sum = add_up(n, value, &size);
  PetscInt       *at;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < p->nkind; k++) {
    if (p->kind_length[k] != length || PetscAbsReal(p->kind_sum[k] - sum) > 2 * (PetscReal)n * ALIKE * size) continue;
    if (!is_alike(n, value, p->value + p->kind_at[k] * p->unit, size)) continue;
    p->at[i] = p->kind_at[k];
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (many && p->nkind < MOST_KINDS) {
    p->kind_length[p->nkind] = length;
    p->kind_sum[p->nkind]    = sum;
    at                       = &p->kind_at[p->nkind++];
    *at                      = -1;
  } else at = &p->own[i];
  if (*at < 0) PetscCall(take_place(p, length, at));
  p->at[i] = *at;
  for (PetscInt e = 0; e < n; e++) p->value[*at * p->unit + e] = (float)value[e];
  PetscFunctionReturn(PETSC_SUCCESS);
}

void RowPoolClear(RowPool *p)
{
  p->used = p->nkind = 0;
  for (PetscInt i = 0; i < p->n; i++) p->at[i] = 0, p->own[i] = -1;
}

PetscErrorCode RowPoolCreate(PetscInt n, PetscInt unit, RowPool *p)
{
  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(p, sizeof(*p)));
  p->n    = n;
  p->unit = unit;
  PetscCall(PetscMalloc5(n, &p->at, n, &p->own, MOST_KINDS, &p->kind_at, MOST_KINDS, &p->kind_length, MOST_KINDS, &p->kind_sum));
  RowPoolClear(p);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RowPoolDestroy(RowPool *p)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree5(p->at, p->own, p->kind_at, p->kind_length, p->kind_sum));
  PetscCall(PetscFree(p->value));
  PetscFunctionReturn(PETSC_SUCCESS);
}
