/* Track: see track.h. */
#include "compat.h"
#include "track.h"
#include "base/csv.h"
#include "base/opt.h"

#define REPEAT_LINES 4 /* a periodic spline needs three intervals */

/* A column as a spline: values y and second derivatives m at the lines; integral of y up to each line */
typedef struct {
  PetscBool  has, rate; /* rate: a velocity */
  PetscReal *y, *m, *integral;
} Curve;

struct _p_Track {
  PetscInt   n;
  PetscReal *t;
  PetscBool  repeat;
  Curve      curve[4]; /* three axes, turn */
};

/* ---- splines ---- */

/* Solve the tridiagonal system lower, diagonal, upper in place of the right-hand side x; diagonal is overwritten */
static void solve_tridiagonal(PetscInt n, const PetscReal lower[], PetscReal diagonal[], const PetscReal upper[],
                              PetscReal x[])
{
  for (PetscInt i = 1; i < n; i++) {
    const PetscReal f = lower[i] / diagonal[i - 1];

    diagonal[i] -= f * upper[i - 1];
    x[i] -= f * x[i - 1];
  }
  for (PetscInt i = n - 1; i >= 0; i--) x[i] = (x[i] - (i + 1 < n ? upper[i] * x[i + 1] : 0)) / diagonal[i];
}

/* Second derivatives of the spline through y; at an end natural (0) or with slope zero (flat) */
static PetscErrorCode fit_held(PetscInt n, const PetscReal t[], const PetscReal y[], PetscBool flat_start,
                               PetscBool flat_end, PetscReal m[])
{
  PetscReal *lower, *diagonal, *upper;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc3(n, &lower, n, &diagonal, n, &upper));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal before = i > 0 ? t[i] - t[i - 1] : 0, after = i + 1 < n ? t[i + 1] - t[i] : 0;
    const PetscReal left = i > 0 ? (y[i] - y[i - 1]) / before : 0, right = i + 1 < n ? (y[i + 1] - y[i]) / after : 0;
    const PetscBool natural = (PetscBool)((i == 0 && !flat_start) || (i == n - 1 && !flat_end));

    lower[i]    = natural ? 0 : before;
    upper[i]    = natural ? 0 : after;
    diagonal[i] = natural ? 1 : 2 * (before + after);
    m[i]        = natural ? 0 : 6 * (right - left);
  }
  solve_tridiagonal(n, lower, diagonal, upper, m);
  PetscCall(PetscFree3(lower, diagonal, upper));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same with equal slopes and second derivatives at both ends, what y gains in between apart: a cyclic system, by
   the formula of Sherman and Morrison */
static PetscErrorCode fit_repeated(PetscInt n, const PetscReal t[], const PetscReal y[], PetscReal m[])
{
  const PetscInt k = n - 1; /* unknowns; the last line is the first one */
  PetscReal     *lower, *diagonal, *again, *upper, *z, first, corner, f;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc5(k, &lower, k, &diagonal, k, &again, k, &upper, k, &z));
  for (PetscInt i = 0; i < k; i++) {
    const PetscInt  p      = i > 0 ? i - 1 : k - 1;
    const PetscReal before = t[p + 1] - t[p], after = t[i + 1] - t[i];

    lower[i]    = before;
    upper[i]    = after;
    diagonal[i] = 2 * (before + after);
    m[i]        = 6 * ((y[i + 1] - y[i]) / after - (y[p + 1] - y[p]) / before);
  }
  corner = lower[0]; /* couples the first and the last unknown, both ways */
  first  = -diagonal[0];
  diagonal[0] -= first;
  diagonal[k - 1] -= corner * corner / first;
  z[0]     = first;
  z[k - 1] = corner;
  PetscCall(PetscArraycpy(again, diagonal, k));
  solve_tridiagonal(k, lower, diagonal, upper, m);
  solve_tridiagonal(k, lower, again, upper, z);
  f = (m[0] + corner / first * m[k - 1]) / (1 + z[0] + corner / first * z[k - 1]);
  for (PetscInt i = 0; i < k; i++) m[i] -= f * z[i];
  m[k] = m[0];
  PetscCall(PetscFree5(lower, diagonal, again, upper, z));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Value, slope and integral from line i of the spline at t, in the interval after line i */
static void evaluate(Track s, const Curve *c, PetscInt i, PetscReal t, PetscReal *value, PetscReal *slope,
                     PetscReal *integral)
{
  const PetscReal h = s->t[i + 1] - s->t[i], a = t - s->t[i], b = s->t[i + 1] - t;
  const PetscReal left = c->y[i] / h - c->m[i] * h / 6, right = c->y[i + 1] / h - c->m[i + 1] * h / 6;

  *value    = (c->m[i] * b * b * b + c->m[i + 1] * a * a * a) / (6 * h) + left * b + right * a;
  *slope    = (c->m[i + 1] * a * a - c->m[i] * b * b) / (2 * h) + right - left;
  *integral = (c->m[i] * (h * h * h * h - b * b * b * b) + c->m[i + 1] * a * a * a * a) / (24 * h) +
              0.5 * left * (h * h - b * b) + 0.5 * right * a * a;
}

static PetscErrorCode fit(Track s, Curve *c)
{
  PetscFunctionBeginUser;
  if (s->repeat) PetscCall(fit_repeated(s->n, s->t, c->y, c->m));
  else PetscCall(fit_held(s->n, s->t, c->y, (PetscBool)(!c->rate && s->t[0] > 0), (PetscBool)!c->rate, c->m));
  c->integral[0] = 0;
  for (PetscInt i = 0; i + 1 < s->n; i++) {
    PetscReal value, slope, gain;

    evaluate(s, c, i, s->t[i + 1], &value, &slope, &gain);
    c->integral[i + 1] = c->integral[i] + gain;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- reading ---- */

static PetscErrorCode check_table(const Csv *t, PetscInt dim, PetscBool repeat)
{
  const PetscInt min = repeat ? REPEAT_LINES : 2;

  PetscFunctionBeginUser;
  PetscCheck(CsvColumn(t, "t") >= 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s:%" PetscInt_FMT ": the header line has no column 't': add it", t->file, t->header);
  for (PetscInt i = 0; i < t->ncolumn; i++) {
    const char *const known[] = {"t", "x", "y", "u", "v", "angle", "omega", "z", "w"};
    PetscBool         found   = PETSC_FALSE;

    for (PetscInt k = 0; k < (dim == 3 ? 9 : 7); k++) found = (PetscBool)(found || !strcmp(t->name[i], known[k]));
    PetscCheck(found, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s:%" PetscInt_FMT ": column '%s' is not known (known in %" PetscInt_FMT
               "D: t, x, y, u, v, angle, omega%s)",
               t->file, t->header, t->name[i], dim, dim == 3 ? ", z, w" : "");
  }
  PetscCheck(t->ncolumn > 1, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s:%" PetscInt_FMT ": nothing moves: add a column such as x, u, angle or omega", t->file, t->header);
  PetscCheck(t->nrow >= min, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s: %" PetscInt_FMT " line%s of numbers, a motion needs at least %" PetscInt_FMT "%s", t->file, t->nrow,
             t->nrow == 1 ? "" : "s", min, repeat ? " to be repeated" : "");
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Column of a place or angle, or of its velocity, as curve a */
static PetscErrorCode take_column(Track s, const Csv *t, PetscInt a, const char position[], const char rate[])
{
  const PetscInt at[2] = {CsvColumn(t, position), CsvColumn(t, rate)}, column = PetscMax(at[0], at[1]);
  Curve         *c = &s->curve[a];

  PetscFunctionBeginUser;
  PetscCheck(at[0] < 0 || at[1] < 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s:%" PetscInt_FMT ": columns '%s' and '%s' say the same: remove one", t->file, t->header, position,
             rate);
  if (column < 0) PetscFunctionReturn(PETSC_SUCCESS);
  c->has  = PETSC_TRUE;
  c->rate = (PetscBool)(at[1] >= 0);
  PetscCall(PetscMalloc3(s->n, &c->y, s->n, &c->m, s->n, &c->integral));
  for (PetscInt i = 0; i < s->n; i++) c->y[i] = t->value[i * t->ncolumn + column];
  PetscCheck(!c->rate || !s->repeat || c->y[0] == c->y[s->n - 1], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s:%" PetscInt_FMT ": %s ends at %g and begins at %g: a velocity that is repeated has to end as it began",
             t->file, t->line[s->n - 1], rate, (double)c->y[s->n - 1], (double)c->y[0]);
  PetscCall(fit(s, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrackRead(const char group[], PetscInt dim, Track *track)
{
  const char *const position[] = {"x", "y", "z", "angle"}, *const rate[] = {"u", "v", "w", "omega"};
  char     name[OPT_NAME], file[PETSC_MAX_PATH_LEN]                      = "";
  PetscInt column;
  Track    s;
  Csv      t;

  PetscFunctionBeginUser;
  *track = NULL;
  PetscCall(OptString(OptJoin("-particle_", group, "_motion_file", name), file, sizeof(file)));
  if (!file[0]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&s));
  PetscCall(OptBool(OptJoin("-particle_", group, "_motion_repeat", name), &s->repeat));
  PetscCall(CsvRead(file, "t and, say, x,y,angle", &t));
  PetscCall(check_table(&t, dim, s->repeat));
  s->n   = t.nrow;
  column = CsvColumn(&t, "t");
  PetscCall(PetscMalloc1(s->n, &s->t));
  for (PetscInt i = 0; i < s->n; i++) {
    s->t[i] = t.value[i * t.ncolumn + column];
    PetscCheck(i == 0 || s->t[i] > s->t[i - 1], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s:%" PetscInt_FMT ": t = %g does not come after %g: sort the lines by time, each time once", file,
               t.line[i], (double)s->t[i], (double)s->t[i - 1]);
  }
  for (PetscInt a = 0; a < 4; a++) PetscCall(take_column(s, &t, a, position[a], rate[a]));
  PetscCall(CsvDestroy(&t));
  *track = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrackDestroy(Track *track)
{
  Track s = *track;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < 4; a++) PetscCall(PetscFree3(s->curve[a].y, s->curve[a].m, s->curve[a].integral));
  PetscCall(PetscFree(s->t));
  PetscCall(PetscFree(*track));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool TrackHas(Track s, PetscInt a)
{
  return (PetscBool)(s && s->curve[a].has);
}

void TrackEvaluate(Track s, PetscInt a, PetscReal time, PetscReal *displacement, PetscReal *velocity)
{
  const Curve    *c    = &s->curve[a];
  const PetscInt  last = s->n - 1;
  const PetscReal span = s->t[last] - s->t[0];
  PetscReal       t = time, gained = 0, value, slope, integral;
  PetscInt        i = 0, end = last;

  if (s->repeat) {
    const PetscReal turns = PetscFloorReal((time - s->t[0]) / span);

    t      = PetscMin(PetscMax(time - turns * span, s->t[0]), s->t[last]);
    gained = turns * (c->rate ? c->integral[last] : c->y[last] - c->y[0]);
  } else if (time < s->t[0] || time > s->t[last]) {
    i             = time < s->t[0] ? 0 : last;
    *velocity     = c->rate ? c->y[i] : 0;
    *displacement = c->rate ? c->integral[i] + c->y[i] * (time - s->t[i]) : c->y[i] - c->y[0];
    return;
  }
  while (end - i > 1) {
    const PetscInt middle = (i + end) / 2;

    if (s->t[middle] <= t) i = middle;
    else end = middle;
  }
  evaluate(s, c, i, t, &value, &slope, &integral);
  *velocity     = c->rate ? value : slope;
  *displacement = gained + (c->rate ? c->integral[i] + integral : value - c->y[0]);
}
