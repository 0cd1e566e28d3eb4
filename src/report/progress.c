/* Progress: lines on standard output while the run goes on. The estimate of the time left takes wall clock a
   simulated second as constant. */
#include "compat.h"
#include "impl.h"
#include <petsctime.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MAX_LINES 50  /* of progress, roughly */
#define BAR       40  /* characters */
#define BAR_EVERY 0.1 /* s */

/* 1, 2, 5, 10, ... steps, so that a run to time_end prints at most about MAX_LINES lines */
PetscInt ProgressChoose(const MonitorStep *s, PetscReal time_end)
{
  const PetscReal steps = s->dt > 0 ? (time_end - s->time) / s->dt : 0;
  PetscInt        every = 1;

  for (PetscInt i = 0; every < steps / MAX_LINES && every < 1000000000; i++)
    every = i % 3 == 1 ? every / 2 * 5 : 2 * every;
  return every;
}

/* The part that is done, of the time to time_end, or 0 */
static PetscReal find_fraction(Monitor m, const MonitorStep *s, PetscReal time_end)
{
  if (!(time_end > m->time_start)) return 0;
  return PetscMax(0, PetscMin(1, (s->time - m->time_start) / (time_end - m->time_start)));
}

PetscErrorCode ProgressFormat(PetscReal seconds, char text[], size_t len)
{
  const PetscInt64 n = (PetscInt64)(seconds + 0.5);

  PetscFunctionBeginUser;
  if (n < 100) PetscCall(PetscSNPrintf(text, len, "%d s", (int)n));
  else PetscCall(PetscSNPrintf(text, len, "%d:%02d:%02d", (int)(n / 3600), (int)(n / 60 % 60), (int)(n % 60)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* "-" while nothing is known */
static PetscErrorCode format_left(Monitor m, const MonitorStep *s, PetscReal time_end, char text[], size_t len)
{
  PetscLogDouble now;
  PetscReal      left = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscTime(&now));
  if (s->time > m->time_start)
    left = (PetscReal)(now - m->wall_start) * (time_end - s->time) / (s->time - m->time_start);
  if (left >= 0 && left < 1e8 && s->time > m->time_start) PetscCall(ProgressFormat(left, text, len));
  else PetscCall(PetscStrncpy(text, "-", len));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A number, or "-" where the run has no fluid */
static PetscErrorCode print_flow(Monitor m, const MonitorStep *s, const char format[], int width, PetscReal value)
{
  char text[32] = "-";

  PetscFunctionBeginUser;
  if (s->gradient > 0 || s->speed > 0) PetscCall(PetscSNPrintf(text, sizeof(text), format, (double)value));
  PetscCall(PetscPrintf(m->comm, " %*s", width, text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ProgressHeading(Monitor m)
{
  const char *const *unit = m->unit;
  char               time[16], dt[16], speed[24];

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(time, sizeof(time), unit[UNIT_TIME][0] ? "time [%s]" : "time", unit[UNIT_TIME]));
  PetscCall(PetscSNPrintf(dt, sizeof(dt), unit[UNIT_TIME][0] ? "dt [%s]" : "dt", unit[UNIT_TIME]));
  PetscCall(PetscSNPrintf(speed, sizeof(speed), unit[UNIT_TIME][0] && unit[UNIT_LENGTH][0] ? "speed [%s/%s]" : "speed",
                          unit[UNIT_LENGTH], unit[UNIT_TIME]));
  PetscCall(PetscPrintf(m->comm, "%9s %12s %11s %8s %14s %12s", "step", time, dt, "CFL", speed, "div/gradient"));
  if (m->solver) PetscCall(PetscPrintf(m->comm, " %10s %14s %14s", "iterations", "kinetic energy", "momentum error"));
  PetscCall(PetscPrintf(m->comm, " %9s %6s %9s\n", "wall [s]", "done", "left"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ProgressPrint(Monitor m, const MonitorStep *s, PetscReal time_end)
{
  char left[32];

  PetscFunctionBeginUser;
  ProgressClear(m);
  PetscCall(format_left(m, s, time_end, left, sizeof(left)));
  PetscCall(PetscPrintf(m->comm, "%9" PetscInt_FMT " %12.6g %11.4g", s->step, (double)s->time, (double)s->dt));
  PetscCall(print_flow(m, s, "%.3g", 8, s->cfl));
  PetscCall(print_flow(m, s, "%.4g", 14, s->speed));
  PetscCall(print_flow(m, s, "%.1e", 12, s->gradient > 0 ? s->divergence / s->gradient : 0));
  if (m->solver)
    PetscCall(PetscPrintf(m->comm, " %10" PetscInt_FMT " %14.7g %14.3e", s->outer_iterations, (double)s->kinetic_energy,
                          (double)s->momentum_error));
  PetscCall(PetscPrintf(m->comm, " %9.3g %4.0f %% %9s\n", (double)s->seconds,
                        (double)(100 * find_fraction(m, s, time_end)), left));
  if (m->rank == 0) fflush(PETSC_STDOUT); /* piped output should not lag behind by a block */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the bar ---- */

/* Where somebody looks at this very terminal: a launcher may show a terminal of its own for standard output, whose text
   goes to a file, but never for standard error as well */
static PetscBool is_watched(Monitor m)
{
  const char *terminal = getenv("TERM");

  return (PetscBool)(m->rank == 0 && PETSC_STDOUT == stdout && isatty(STDOUT_FILENO) && isatty(STDERR_FILENO) &&
                     terminal && strcmp(terminal, "dumb"));
}

PetscErrorCode ProgressBar(Monitor m, const MonitorStep *s, PetscReal time_end)
{
  const PetscReal fraction      = find_fraction(m, s, time_end);
  const char      full[BAR + 1] = "########################################";
  char            left[32];
  PetscLogDouble  now;

  PetscFunctionBeginUser;
  if (!is_watched(m)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscTime(&now));
  if (m->bar && now - m->bar_at < BAR_EVERY) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(format_left(m, s, time_end, left, sizeof(left)));
  fprintf(stdout, "\r\033[K[%-*.*s] %.0f %%, step %" PetscInt_FMT ", %s left\r", BAR, (int)(BAR * fraction), full,
          (double)(100 * fraction), s->step, left);
  fflush(stdout);
  m->bar    = PETSC_TRUE;
  m->bar_at = now;
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ProgressClear(Monitor m)
{
  if (!m->bar) return;
  fputs("\r\033[K", stdout);
  fflush(stdout);
  m->bar = PETSC_FALSE;
}
