/* History: see history.h. */
#include "compat.h"
#include "history.h"

struct _p_History {
  PetscInt   ncolumns, n, capacity;
  PetscReal *time;  /* [n] increasing */
  PetscReal *value; /* [n][ncolumns] */
};

static PetscReal sample(History h, PetscInt i, PetscInt column)
{
  return h->value[i * h->ncolumns + column];
}

/* First sample not before a time */
static PetscInt find_sample(History h, PetscReal time)
{
  PetscInt low = 0, high = h->n;

  while (low < high) {
    const PetscInt middle = (low + high) / 2;

    if (h->time[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low;
}

PetscErrorCode HistoryCreate(PetscInt ncolumns, History *history)
{
  PetscFunctionBeginUser;
  PetscCall(PetscNew(history));
  (*history)->ncolumns = ncolumns;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode HistoryDestroy(History *history)
{
  PetscFunctionBeginUser;
  if (!*history) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree((*history)->time));
  PetscCall(PetscFree((*history)->value));
  PetscCall(PetscFree(*history));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode HistoryAdd(History h, PetscReal time, const PetscReal value[])
{
  PetscFunctionBeginUser;
  if (h->n && time == h->time[h->n - 1]) h->n--;
  PetscCheck(!h->n || time > h->time[h->n - 1], PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "Sample at time %g after one at %g: times must increase", (double)time, (double)h->time[h->n - 1]);
  if (h->n == h->capacity) {
    h->capacity = 2 * h->capacity + 64;
    PetscCall(PetscRealloc(h->capacity * sizeof(PetscReal), &h->time));
    PetscCall(PetscRealloc(PetscMax(1, h->capacity * h->ncolumns) * sizeof(PetscReal), &h->value));
  }
  h->time[h->n] = time;
  PetscCall(PetscArraycpy(h->value + h->n * h->ncolumns, value, h->ncolumns));
  h->n++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode HistoryGetEnd(History h, PetscReal *time)
{
  PetscFunctionBeginUser;
  *time = h->n ? h->time[h->n - 1] : -PETSC_MAX_REAL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Vertex of the parabola through the samples i - 1, i, i + 1 (Newton's form); the sample i where it is no extremum
   among them */
static void find_vertex(History h, PetscInt i, PetscInt column, PetscReal *time, PetscReal *value)
{
  const PetscReal t0 = h->time[i - 1], t1 = h->time[i], t2 = h->time[i + 1], y0 = sample(h, i - 1, column),
                  y1 = sample(h, i, column), y2 = sample(h, i + 1, column);
  const PetscReal a = (y1 - y0) / (t1 - t0), b = ((y2 - y1) / (t2 - t1) - a) / (t2 - t0);

  *time  = t1;
  *value = y1;
  /* on a flank at the end of the range */
  if (PetscIsInfOrNanReal(a) || PetscIsInfOrNanReal(b) || b == 0 || (y1 - y0) * (y1 - y2) < 0) return;
  *time  = 0.5 * (t0 + t1) - 0.5 * a / b;
  *value = y0 + a * (*time - t0) + b * (*time - t0) * (*time - t1);
}

PetscErrorCode HistoryGetExtremum(History h, PetscInt column, PetscInt sign, PetscReal from, PetscReal until,
                                  PetscReal *time, PetscReal *value, PetscBool *found)
{
  PetscInt best = -1;

  PetscFunctionBeginUser;
  for (PetscInt i = find_sample(h, from); i < h->n && h->time[i] <= until; i++) {
    const PetscReal y = sample(h, i, column);

    if (!PetscIsInfOrNanReal(y) && (best < 0 || sign * y > sign * sample(h, best, column))) best = i;
  }
  *found = (PetscBool)(best >= 0);
  if (best > 0 && best < h->n - 1) find_vertex(h, best, column, time, value);
  else if (best >= 0) {
    *time  = h->time[best];
    *value = sample(h, best, column);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode HistoryGetPeriod(History h, PetscInt column, PetscReal from, PetscReal *period, PetscInt *n)
{
  PetscReal time, low = 0, high = 0, first = 0, last = 0;
  PetscInt  crossings = 0;
  PetscBool found;

  PetscFunctionBeginUser;
  PetscCall(HistoryGetExtremum(h, column, 1, from, PETSC_MAX_REAL, &time, &high, &found));
  PetscCall(HistoryGetExtremum(h, column, -1, from, PETSC_MAX_REAL, &time, &low, &found));
  for (PetscInt i = find_sample(h, from) + 1; i < h->n; i++) {
    const PetscReal a = sample(h, i - 1, column) - 0.5 * (low + high), b = sample(h, i, column) - 0.5 * (low + high);

    if (!(a < 0 && b >= 0)) continue;
    last = h->time[i - 1] + (h->time[i] - h->time[i - 1]) * a / (a - b);
    if (!crossings++) first = last;
  }
  *n      = PetscMax(0, crossings - 1);
  *period = *n ? (last - first) / *n : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode HistoryGetValue(History h, PetscInt column, PetscReal time, PetscReal *value, PetscBool *found)
{
  PetscInt first, last;

  PetscFunctionBeginUser;
  *found = (PetscBool)(h->n && time >= h->time[0] && time <= h->time[h->n - 1]);
  if (!*found) PetscFunctionReturn(PETSC_SUCCESS);
  first  = PetscMax(0, PetscMin(find_sample(h, time) - 2, h->n - 4));
  last   = PetscMin(h->n, first + 4);
  *value = 0;
  for (PetscInt i = first; i < last; i++) { /* Lagrange's form */
    PetscReal weight = 1;

    for (PetscInt j = first; j < last; j++)
      if (j != i) weight *= (time - h->time[j]) / (h->time[i] - h->time[j]);
    *value += weight * sample(h, i, column);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
