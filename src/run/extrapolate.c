/* Extrapolate: see extrapolate.h. */
#include "compat.h"
#include "extrapolate.h"

/* Error of the judged mesh is this part of the difference to one of `ratio` times its cells */
static PetscReal take_part(PetscReal difference, PetscReal ratio, PetscReal order)
{
  return difference / (PetscPowReal(ratio, order) - 1);
}

/* Difference of the coarser of two meshes beside that of the other, of an error of that order */
static PetscReal get_growth(const PetscReal ratio[2], PetscReal order)
{
  return (PetscPowReal(ratio[1], order) - 1) / (PetscPowReal(ratio[0], order) - 1);
}

PetscReal ExtrapolateError(PetscInt n, const PetscReal difference[], const PetscReal ratio[], const ErrorOrder *order,
                           ErrorTrend *trend)
{
  const PetscReal first = PetscAbsReal(difference[0]);
  PetscReal       second, low = order->low, high = order->high;

  *trend = TREND_STALLS;
  if (n == 1) return take_part(first, ratio[0], order->low);
  second = PetscAbsReal(difference[1]);
  if (difference[0] * difference[1] < 0) { /* the finest may lie anywhere in what they span */
    *trend = TREND_TURNS;
    return take_part(first + second, ratio[1], order->low);
  }
  if (second > PetscLogReal(ratio[1]) / PetscLogReal(ratio[0]) * first)
    *trend = TREND_CONVERGES; /* by an order above 0 */
  if (second <= get_growth(ratio, order->low) * first) return take_part(first, ratio[0], order->low);
  if (second >= get_growth(ratio, order->high) * first) return take_part(second, ratio[1], order->vanished);
  for (PetscInt i = 0; i < 30; i++) {
    const PetscReal middle = 0.5 * (low + high);

    if (get_growth(ratio, middle) * first < second) low = middle;
    else high = middle;
  }
  return take_part(first, ratio[0], low);
}
