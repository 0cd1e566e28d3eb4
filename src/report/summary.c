/* Summary: the page at the end of a run, and what it shares with summary.json (summaryjson.c). It measures nothing
   itself but memory and the wall clock of the whole run: times of phases and numbers of a step come from the caller. */
#include "compat.h"
#include "impl.h"
#include "files.h"
#include "summary.h"
#include "base/log.h"
#include <petsctime.h>
#include <sys/resource.h>

static PetscErrorCode get_memory(Monitor m, PetscReal *mb)
{
  struct rusage usage;
  PetscReal     mine = 0;

  PetscFunctionBeginUser;
#if defined(__APPLE__)
  const PetscReal unit = 1048576; /* bytes there, kB elsewhere */
#else
  const PetscReal unit = 1024;
#endif
  if (!getrusage(RUSAGE_SELF, &usage)) mine = (PetscReal)usage.ru_maxrss / unit;
  PetscCallMPI(MPI_Allreduce(&mine, mb, 1, MPIU_REAL, MPIU_SUM, m->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode collect_summary(Monitor m, Summary *s)
{
  PetscLogDouble now;
  PetscReal      mine[MONITOR_NPHASES + 1], all[MONITOR_NPHASES + 1];

  PetscFunctionBeginUser;
  if (m->measured) now = m->wall_end;
  else PetscCall(PetscTime(&now));
  PetscCall(PetscArraycpy(mine, m->seconds, MONITOR_NPHASES));
  mine[MONITOR_NPHASES] = m->seconds[MONITOR_SETUP] + (m->started ? (PetscReal)(now - m->wall_start) : 0);
  PetscCallMPI(MPI_Allreduce(mine, all, MONITOR_NPHASES + 1, MPIU_REAL, MPIU_MAX, m->comm));
  PetscCall(PetscArraycpy(s->seconds, all, MONITOR_NPHASES));
  s->total           = all[MONITOR_NPHASES];
  s->iterations_mean = m->solves.n ? m->solves.sum / m->solves.n : 0;
  if (m->measured) s->memory_mb = m->memory_mb;
  else PetscCall(get_memory(m, &s->memory_mb));
  PetscCall(VersionsGet(&s->versions));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode print_phase(Monitor m, const char name[], PetscReal seconds, const Summary *s, PetscBool per_step)
{
  char step[32] = "";

  PetscFunctionBeginUser;
  if (per_step && s->steps > 0) PetscCall(PetscSNPrintf(step, sizeof(step), " %14.4g", (double)(seconds / s->steps)));
  PetscCall(PetscPrintf(m->comm, "  %-16s %12.4g %8.1f%s\n", name, (double)seconds,
                        s->total > 0 ? (double)(100 * seconds / s->total) : 0., step));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const Balance *find_balance(Monitor m, const char name[])
{
  for (PetscInt i = 0; i < m->balances.n; i++)
    if (!strcmp(m->balances.row[i].name, name)) return m->balances.row + i;
  return NULL;
}

/* Where ranks got too little of their cores, for long enough to tell */
static PetscErrorCode print_cores(Monitor m, const Summary *s)
{
  const Balance *core = find_balance(m, "core_share"), *wait = find_balance(m, "core_wait");

  PetscFunctionBeginUser;
  if (!core || !wait || core->min > CORE_FRACTION || wait->max < CORE_WAIT || s->total < CORE_WALL)
    PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscPrintf(m->comm, "  a core's time that ranks got: %.2f to %.2f%s\n", (double)core->min,
                        (double)core->max,
                        m->size > 1 ? "; with fewer ranks, or on free cores, the run is faster"
                                    : "; on a free core the run is faster"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* " cm/s" of a speed whose scene names its units, " diameters" of an overlap, "" where it is not known */
static PetscErrorCode format_unit(Monitor m, const char name[], char text[], size_t len)
{
  const char *length = m->unit[UNIT_LENGTH], *time = m->unit[UNIT_TIME];

  PetscFunctionBeginUser;
  text[0] = 0;
  if (!strcmp(name, "overlap_max")) PetscCall(PetscStrncpy(text, " diameters", len));
  if (length[0] && time[0] && (!strcmp(name, "fall_speed_max") || !strcmp(name, "speed_max")))
    PetscCall(PetscSNPrintf(text, len, " %s/%s", length, time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorAddLimit(Monitor m, const MonitorLimit *limit)
{
  PetscFunctionBeginUser;
  PetscCheck(m->limits.n < MONITOR_LIMITS, PETSC_COMM_SELF, PETSC_ERR_PLIB,
             "Limit '%s' of a step: the summary has room for %d", limit->name, MONITOR_LIMITS);
  m->limits.row[m->limits.n++] = *limit;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Which limit held how many steps, where the run chose them or refused one */
static PetscErrorCode print_limits(Monitor m)
{
  PetscBool any = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m->limits.n; i++)
    any = (PetscBool)(any || m->limits.row[i].refused || (m->limits.row[i].chosen && m->limits.row[i].steps));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscPrintf(m->comm, "\n  %-44s %8s %8s %14s\n", "length of steps by", "steps", "refused", "shortest"));
  for (PetscInt i = 0; i < m->limits.n; i++) {
    const MonitorLimit *l        = &m->limits.row[i];
    char                text[96] = "", shortest[32] = "-";

    if (!l->steps && !l->refused) continue;
    if (l->option) PetscCall(PetscSNPrintf(text, sizeof(text), "  (%s)", l->option));
    if (l->steps) PetscCall(PetscSNPrintf(shortest, sizeof(shortest), "%.4g", (double)l->dt_min));
    PetscCall(PetscPrintf(m->comm, "  %-44s %8" PetscInt_FMT " %8" PetscInt_FMT " %14s%s\n", l->what, l->steps,
                          l->refused, shortest, text));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode print_summary(Monitor m, const Summary *s)
{
  char unit[32];

  PetscFunctionBeginUser;
  PetscCall(PetscPrintf(m->comm, "\nSummary of %s: %" PetscInt_FMT " steps to t = %.6g%s%s\n", s->scene, s->steps,
                        (double)s->time_end, m->unit[UNIT_TIME][0] ? " " : "", m->unit[UNIT_TIME]));
  PetscCall(PetscPrintf(m->comm,
                        "  %" PetscInt_FMT " cells, %" PetscInt_FMT " unknowns, %" PetscInt_FMT
                        " bod%s, %d rank%s, %.0f MB\n",
                        s->cells, s->unknowns, m->bodies->nall, m->bodies->nall == 1 ? "y" : "ies", (int)m->size,
                        m->size > 1 ? "s" : "", (double)s->memory_mb));
  PetscCall(PetscPrintf(m->comm, "  outer iterations a step: mean %.3g, largest %" PetscInt_FMT "\n",
                        (double)s->iterations_mean, m->solves.max));
  PetscCall(print_cores(m, s));
  PetscCall(PetscPrintf(m->comm, "\n  %-16s %12s %8s %14s\n", "phase", "wall [s]", "[%]", "a step [s]"));
  for (PetscInt i = 0; i < MONITOR_NPHASES; i++)
    if (SummaryShowsPhase(s, i))
      PetscCall(print_phase(m, SUMMARY_PHASE[i], s->seconds[i], s, i == MONITOR_SETUP ? PETSC_FALSE : PETSC_TRUE));
  PetscCall(print_phase(m, "total", s->total, s, PETSC_FALSE));
  PetscCall(print_limits(m));
  if (m->nquantity) PetscCall(PetscPrintf(m->comm, "\n  %-24s %14s\n", "quantity", "value"));
  for (PetscInt i = 0; i < m->nquantity; i++) {
    PetscCall(format_unit(m, m->quantity[i].name, unit, sizeof(unit)));
    PetscCall(PetscPrintf(m->comm, "  %-24s %14.7g%s\n", m->quantity[i].name, (double)m->quantity[i].value, unit));
  }
  PetscCall(PetscPrintf(m->comm, "\n  results in %s: series.csv, bodies.csv, ", m->dir));
  for (PetscInt i = 0; i < MAX_FILES && m->further[i]; i++) PetscCall(PetscPrintf(m->comm, "%s, ", m->further[i]));
  PetscCall(PetscPrintf(m->comm, "summary.json, options.txt\n"));
  if (m->rank == 0) fflush(PETSC_STDOUT);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_tracked(Monitor m)
{
  PetscFunctionBeginUser;
  if (m->max.fall_speed > PETSC_MIN_REAL) PetscCall(MonitorQuantity(m, "fall_speed_max", m->max.fall_speed));
  if (m->max.speed > PETSC_MIN_REAL) PetscCall(MonitorQuantity(m, "speed_max", m->max.speed));
  if (m->bodies->nall) PetscCall(MonitorQuantity(m, "overlap_max", PetscMax(0, m->max.overlap)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorEnd(Monitor m, PetscBool *wanted)
{
  PetscFunctionBeginUser;
  *wanted = m->measure;
  if (!m->measure) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(get_memory(m, &m->memory_mb));
  PetscCall(PetscTime(&m->wall_end));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorBandwidth(Monitor m, Mat S)
{
  PetscFunctionBeginUser;
  PetscCall(BandwidthMeasure(S, &m->bandwidth));
  m->measured = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorFinish(Monitor m, const char scene[], PetscInt cells, PetscInt unknowns, PetscInt steps,
                             PetscReal time_end)
{
  Summary s = {.scene = scene, .cells = cells, .unknowns = unknowns, .steps = steps, .time_end = time_end};
  char    path[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  ProgressClear(m);
  PetscCall(set_tracked(m));
  PetscCall(collect_summary(m, &s));
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/summary.json", m->dir));
  PetscCall(FileCheck(m->comm, m->rank ? 0 : SummaryWrite(m, &s, path), path));
  PetscCall(print_summary(m, &s));
  PetscFunctionReturn(PETSC_SUCCESS);
}
