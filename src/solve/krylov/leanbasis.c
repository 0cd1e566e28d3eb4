/* Vectors of a Krylov method: see leanbasis.h. */
#include "compat.h"
#include "leanbasis.h"
#include "base/array.h"

#define BLOCK     1024  /* entries that stay in the first cache while all vectors pass over them */
#define LANES     8     /* sums side by side */
#define SMALLEST  1e-30 /* of the largest entry: less is zero, so that no float is subnormal */
#define MIN_SCALE 1e-300

PetscErrorCode LeanBasisKeep(LeanBasis *b, PetscInt n)
{
  PetscFunctionBeginUser;
  for (; b->n > n; b->n--) PetscCall(PetscFree(b->vector[b->n - 1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeanBasisDestroy(LeanBasis *b)
{
  PetscFunctionBeginUser;
  PetscCall(LeanBasisKeep(b, 0));
  PetscCall(PetscFree(b->vector));
  PetscCall(PetscFree(b->scale));
  b->capacity = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeanBasisUse(LeanBasis *b, PetscBool single, PetscInt length, PetscInt split)
{
  PetscFunctionBeginUser;
  if (b->single != single || b->length != length || b->split != split) PetscCall(LeanBasisKeep(b, 0));
  b->single = single;
  b->length = length;
  b->split  = split;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode reserve(LeanBasis *b, PetscInt n)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(n, &b->capacity, &b->vector, sizeof(void *), &b->scale, sizeof(*b->scale), NULL));
  for (; b->n < n; b->n++)
    PetscCall(PetscMalloc((size_t)b->length * (b->single ? sizeof(float) : sizeof(PetscReal)), &b->vector[b->n]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void round_to(PetscInt n, PetscReal scale, PetscReal x[], float v[])
{
  const PetscReal inverse = 1 / scale;

  for (PetscInt i = 0; i < n; i++) {
    const PetscReal y = x[i] * inverse;

    v[i] = (float)(PetscAbsReal(y) < SMALLEST ? 0 : y);
    x[i] = scale * (PetscReal)v[i];
  }
}

/* Entries of one unit: [begin, end) of a vector */
static void get_half(const LeanBasis *b, PetscInt half, PetscInt *begin, PetscInt *end)
{
  *begin = half ? b->split : 0;
  *end   = half ? b->length : b->split;
}

PetscErrorCode LeanBasisPut(LeanBasis *b, PetscInt i, PetscReal x[])
{
  PetscFunctionBeginUser;
  PetscCall(reserve(b, i + 1));
  b->scale[i][0] = b->scale[i][1] = 1;
  if (!b->single) {
    PetscCall(PetscArraycpy((PetscReal *)b->vector[i], x, b->length));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt half = 0; half < 2; half++) {
    PetscReal max = 0;
    PetscInt  begin, end;

    get_half(b, half, &begin, &end);
    for (PetscInt k = begin; k < end; k++) max = PetscMax(max, PetscAbsReal(x[k]));
    if (max > MIN_SCALE && max < 1 / MIN_SCALE) b->scale[i][half] = max;
    round_to(end - begin, b->scale[i][half], x + begin, (float *)b->vector[i] + begin);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sums in lanes, which the compiler may keep in one register */
#define DOT(type) \
  static PetscReal dot_##type(PetscInt n, const type v[], const PetscReal x[]) \
  { \
    PetscReal lane[LANES] = {0}, sum = 0; \
    PetscInt  i = 0; \
\
    for (; i + LANES <= n; i += LANES) \
      for (PetscInt l = 0; l < LANES; l++) lane[l] += (PetscReal)v[i + l] * x[i + l]; \
    for (; i < n; i++) sum += (PetscReal)v[i] * x[i]; \
    for (PetscInt l = 0; l < LANES; l++) sum += lane[l]; \
    return sum; \
  }
DOT(float)
DOT(double)

void LeanBasisDot(const LeanBasis *b, PetscInt n, const PetscReal x[], PetscReal dot[])
{
  for (PetscInt j = 0; j <= n; j++) dot[j] = 0;
  for (PetscInt half = 0; half < 2; half++) {
    PetscInt begin, end;

    get_half(b, half, &begin, &end);
    for (PetscInt from = begin; from < end; from += BLOCK) {
      const PetscInt m = PetscMin(BLOCK, end - from);

      for (PetscInt j = 0; j < n; j++)
        dot[j] += b->scale[j][half] * (b->single ? dot_float(m, (const float *)b->vector[j] + from, x + from)
                                                 : dot_double(m, (const double *)b->vector[j] + from, x + from));
      dot[n] += dot_double(m, x + from, x + from);
    }
  }
}

void LeanBasisAdd(const LeanBasis *b, PetscInt n, const PetscReal c[], PetscInt begin, PetscInt end, PetscReal y[])
{
  for (PetscInt from = begin, m; from < end; from += m) {
    const PetscInt half = from >= b->split;
    PetscReal     *to   = y + from - begin;

    m = PetscMin(BLOCK, (half ? end : PetscMin(end, b->split)) - from);
    for (PetscInt j = 0; j < n; j++) {
      const PetscReal a = c[j] * b->scale[j][half];

      if (b->single)
        for (PetscInt i = 0; i < m; i++) to[i] += a * (PetscReal)((const float *)b->vector[j])[from + i];
      else
        for (PetscInt i = 0; i < m; i++) to[i] += a * ((const PetscReal *)b->vector[j])[from + i];
    }
  }
}
