/* Progress: lines on standard output while the run goes on. The estimate of the time left takes wall clock a
   simulated second as constant. */
#include "compat.h"
#include "impl.h"
#include <petsctime.h>

#define MAX_LINES 50 /* of progress, roughly */

/* 1, 2, 5, 10, ... steps, so that a run to time_end prints at most about MAX_LINES lines */
PetscInt ProgressChoose(const MonitorStep *s, PetscReal time_end)
{
  const PetscReal steps = s->dt > 0 ? (time_end - s->time) / s->dt : 0;
  PetscInt        every = 1;

  for (PetscInt i = 0; every < steps / MAX_LINES && every < 1000000000; i++) every = i % 3 == 1 ? every / 2 * 5 : 2 * every;
  return every;
}

/* "1:02:03"; "-" while nothing is known */
static PetscErrorCode format_left(Monitor m, const MonitorStep *s, PetscReal time_end, char text[], size_t len)
{
  PetscLogDouble now;
  PetscReal      left = 0;
  PetscInt       seconds;

  PetscFunctionBeginUser;
  PetscCall(PetscTime(&now));
  if (s->time > m->time_start) left = (PetscReal)(now - m->wall_start) * (time_end - s->time) / (s->time - m->time_start);
  if (!(left >= 0 && left < 1e8) || s->time <= m->time_start) {
    PetscCall(PetscStrncpy(text, "-", len));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  seconds = (PetscInt)(left + 0.5);
  PetscCall(PetscSNPrintf(text, len, "%" PetscInt_FMT ":%02" PetscInt_FMT ":%02" PetscInt_FMT, seconds / 3600, seconds / 60 % 60, seconds % 60));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ProgressHeading(Monitor m)
{
  const char *unit = m->unit[UNIT_TIME];
  char        time[16], dt[16];

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(time, sizeof(time), unit[0] ? "time [%s]" : "time", unit));
  PetscCall(PetscSNPrintf(dt, sizeof(dt), unit[0] ? "dt [%s]" : "dt", unit));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "%9s %12s %11s %8s %6s %11s %14s %14s %9s %10s\n", "step", time, dt, "CFL", "outer", "divergence",
                        "kinetic energy", "momentum error", "wall [s]", "left h:m:s"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ProgressPrint(Monitor m, const MonitorStep *s, PetscReal time_end)
{
  char left[32];

  PetscFunctionBeginUser;
  PetscCall(format_left(m, s, time_end, left, sizeof(left)));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "%9" PetscInt_FMT " %12.6g %11.4g %8.3g %6" PetscInt_FMT " %11.3e %14.7g %14.3e %9.3g %10s\n", s->step,
                        (double)s->time, (double)s->dt, (double)s->cfl, s->outer_iterations, (double)s->divergence, (double)s->kinetic_energy,
                        (double)s->momentum_error, (double)s->seconds, left));
  if (m->rank == 0) fflush(PETSC_STDOUT); /* piped output should not lag behind by a block */
  PetscFunctionReturn(PETSC_SUCCESS);
}
