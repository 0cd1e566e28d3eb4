/* Summary: summary.json and the page at the end of a run. It measures nothing itself but memory and the wall clock of
   the whole run: times of phases and numbers of a step come from the caller. */
#include "compat.h"
#include "impl.h"
#include "files.h"
#include "versions.h"
#include "base/log.h"
#include <petsctime.h>
#include <sys/resource.h>

static const char *const PHASE[MONITOR_NPHASES] = {"setup", "nse", "force", "particle", "output", "mesh"};

typedef struct {
  const char *scene;
  PetscInt    cells, unknowns, steps;
  PetscReal   time_end, seconds[MONITOR_NPHASES], total, memory_mb, iterations_mean;
  Versions    versions;
} Summary;

static PetscErrorCode get_memory(PetscReal *mb)
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
  PetscCallMPI(MPI_Allreduce(&mine, mb, 1, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
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
  PetscCallMPI(MPI_Allreduce(mine, all, MONITOR_NPHASES + 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  PetscCall(PetscArraycpy(s->seconds, all, MONITOR_NPHASES));
  s->total           = all[MONITOR_NPHASES];
  s->iterations_mean = m->nsolve ? m->iterations_sum / m->nsolve : 0;
  if (m->measured) s->memory_mb = m->memory_mb;
  else PetscCall(get_memory(&s->memory_mb));
  PetscCall(VersionsGet(&s->versions));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void print_json_string(FILE *f, const char text[])
{
  fputc('"', f);
  for (const char *c = text; *c; c++) {
    if (*c == '"' || *c == '\\') fputc('\\', f);
    if ((unsigned char)*c < 0x20) fprintf(f, "\\u%04x", (unsigned)*c);
    else fputc(*c, f);
  }
  fputc('"', f);
}

static void print_json_real(FILE *f, PetscReal value)
{
  if (PetscIsInfOrNanReal(value)) fprintf(f, "null");
  else fprintf(f, "%.12g", (double)value);
}

static void print_json_remarks(FILE *f)
{
  const char *const *text;
  PetscInt           n;

  (void)LogGetRemarks(&n, &text);
  fprintf(f, "  \"remarks\": [");
  for (PetscInt i = 0; i < n; i++) {
    fprintf(f, "%s\n    ", i ? "," : "");
    print_json_string(f, text[i]);
  }
  fprintf(f, "%s],\n", n ? "\n  " : "");
}

static void print_json_versions(FILE *f, const Versions *v)
{
  const char *const name[] = {"petsc", "mpi", "hypre", "hdf5"}, *const text[] = {v->petsc, v->mpi, v->hypre, v->hdf5};

  fprintf(f, "  \"commit\": \"%s\",\n  \"versions\": {\"tumble\": \"%s\"", v->commit, v->tumble);
  for (int i = 0; i < 4; i++) {
    if (!text[i][0]) continue;
    fprintf(f, ", \"%s\": ", name[i]);
    print_json_string(f, text[i]);
  }
  fprintf(f, "},\n");
}

/* Those the scene names */
static void print_json_units(FILE *f, Monitor m)
{
  static const char *const NAME[NUNITS] = {[UNIT_LENGTH] = "length", [UNIT_TIME] = "time", [UNIT_MASS] = "mass"};
  const char              *comma        = "";

  fprintf(f, "  \"units\": {");
  for (int i = 0; i < NUNITS; i++) {
    if (!m->unit[i][0]) continue;
    fprintf(f, "%s\"%s\": \"%s\"", comma, NAME[i], m->unit[i]);
    comma = ", ";
  }
  fprintf(f, "},\n");
}

static PetscBool is_shown(const Summary *s, PetscInt phase)
{
  return (PetscBool)(phase != MONITOR_MESH || s->seconds[phase] > 0);
}

static void print_json_seconds(FILE *f, const Summary *s)
{
  fprintf(f, "  \"seconds\": {");
  for (PetscInt i = 0; i < MONITOR_NPHASES; i++)
    if (is_shown(s, i)) fprintf(f, "\"%s\": %.6g, ", PHASE[i], (double)s->seconds[i]);
  fprintf(f, "\"total\": %.6g},\n", (double)s->total);
}

static void print_json_balance(FILE *f, Monitor m)
{
  fprintf(f, "  \"balance\": {");
  for (PetscInt i = 0; i < m->nbalance; i++) {
    const Balance *b = m->balance + i;

    fprintf(f, "%s\n    \"%s\": {\"min\": %.12g, \"mean\": %.12g, \"max\": %.12g}", i ? "," : "", b->name, (double)b->min, (double)b->mean,
            (double)b->max);
  }
  fprintf(f, "%s},\n", m->nbalance ? "\n  " : "");
}

static void print_json_bandwidth(FILE *f, Monitor m)
{
  const Bandwidth *y = &m->bandwidth;

  if (!m->measured) return;
  fprintf(f, "  \"bandwidth\": {\"triad_one\": %.6g, \"triad_all\": %.6g, \"sweep\": %.6g, \"sweep_bytes\": %.12g},\n", (double)y->triad_one,
          (double)y->triad_all, (double)y->sweep, (double)y->sweep_bytes);
}

static void print_json_quantities(FILE *f, Monitor m)
{
  fprintf(f, "  \"quantities\": {");
  for (PetscInt i = 0; i < m->nquantity; i++) {
    fprintf(f, "%s\n    ", i ? "," : "");
    print_json_string(f, m->quantity[i].name);
    fprintf(f, ": ");
    print_json_real(f, m->quantity[i].value);
  }
  fprintf(f, "%s}\n", m->nquantity ? "\n  " : "");
}

/* Rank 0: 0 or errno */
static int write_json(Monitor m, const Summary *s, const char path[])
{
  FILE *f;
  int   err = FileBegin(path, &f);

  if (err) return err;
  fprintf(f, "{\n  \"scene\": ");
  print_json_string(f, s->scene);
  fprintf(f,
          ",\n  \"ranks\": %d,\n  \"cells\": %" PetscInt_FMT ",\n  \"unknowns\": %" PetscInt_FMT ",\n  \"bodies\": %" PetscInt_FMT
          ",\n  \"steps\": %" PetscInt_FMT,
          (int)m->size, s->cells, s->unknowns, m->bodies->nall, s->steps);
  fprintf(f, ",\n  \"time_end\": ");
  print_json_real(f, s->time_end);
  fprintf(f, ",\n");
  print_json_units(f, m);
  print_json_versions(f, &s->versions);
  fprintf(f, "  \"optimised\": %s,\n", s->versions.optimised ? "true" : "false");
  print_json_seconds(f, s);
  fprintf(f, "  \"outer_iterations\": {\"mean\": %.6g, \"max\": %" PetscInt_FMT "},\n", (double)s->iterations_mean, m->iterations_max);
  fprintf(f, "  \"memory_mb\": %.6g,\n", (double)s->memory_mb);
  print_json_balance(f, m);
  print_json_bandwidth(f, m);
  print_json_remarks(f);
  print_json_quantities(f, m);
  fprintf(f, "}\n");
  return FileEnd(path, &f);
}

static PetscErrorCode print_phase(const char name[], PetscReal seconds, const Summary *s, PetscBool per_step)
{
  char step[32] = "";

  PetscFunctionBeginUser;
  if (per_step && s->steps > 0) PetscCall(PetscSNPrintf(step, sizeof(step), " %14.4g", (double)(seconds / s->steps)));
  PetscCall(
    PetscPrintf(PETSC_COMM_WORLD, "  %-16s %12.4g %8.1f%s\n", name, (double)seconds, s->total > 0 ? (double)(100 * seconds / s->total) : 0., step));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const Balance *find_balance(Monitor m, const char name[])
{
  for (PetscInt i = 0; i < m->nbalance; i++)
    if (!strcmp(m->balance[i].name, name)) return m->balance + i;
  return NULL;
}

/* Where ranks got too little of their cores, for long enough to tell */
static PetscErrorCode print_cores(Monitor m, const Summary *s)
{
  const Balance *share = find_balance(m, "core_share"), *wait = find_balance(m, "core_wait");

  PetscFunctionBeginUser;
  if (!share || !wait || share->min > CORE_SHARE || wait->max < CORE_WAIT || s->total < CORE_WALL) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "  a core's time that ranks got: %.2f to %.2f%s\n", (double)share->min, (double)share->max,
                        m->size > 1 ? "; with fewer ranks, or on free cores, the run is faster" : "; on a free core the run is faster"));
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

static PetscErrorCode print_summary(Monitor m, const Summary *s)
{
  char unit[32];

  PetscFunctionBeginUser;
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "\nSummary of %s: %" PetscInt_FMT " steps to t = %.6g%s%s\n", s->scene, s->steps, (double)s->time_end,
                        m->unit[UNIT_TIME][0] ? " " : "", m->unit[UNIT_TIME]));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "  %" PetscInt_FMT " cells, %" PetscInt_FMT " unknowns, %" PetscInt_FMT " bod%s, %d rank%s, %.0f MB\n",
                        s->cells, s->unknowns, m->bodies->nall, m->bodies->nall == 1 ? "y" : "ies", (int)m->size, m->size > 1 ? "s" : "",
                        (double)s->memory_mb));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "  outer iterations a step: mean %.3g, largest %" PetscInt_FMT "\n", (double)s->iterations_mean,
                        m->iterations_max));
  PetscCall(print_cores(m, s));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "\n  %-16s %12s %8s %14s\n", "phase", "wall [s]", "[%]", "a step [s]"));
  for (PetscInt i = 0; i < MONITOR_NPHASES; i++)
    if (is_shown(s, i)) PetscCall(print_phase(PHASE[i], s->seconds[i], s, i == MONITOR_SETUP ? PETSC_FALSE : PETSC_TRUE));
  PetscCall(print_phase("total", s->total, s, PETSC_FALSE));
  if (m->nquantity) PetscCall(PetscPrintf(PETSC_COMM_WORLD, "\n  %-24s %14s\n", "quantity", "value"));
  for (PetscInt i = 0; i < m->nquantity; i++) {
    PetscCall(format_unit(m, m->quantity[i].name, unit, sizeof(unit)));
    PetscCall(PetscPrintf(PETSC_COMM_WORLD, "  %-24s %14.7g%s\n", m->quantity[i].name, (double)m->quantity[i].value, unit));
  }
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "\n  results in %s: series.csv, bodies.csv, summary.json, options.txt\n", m->dir));
  if (m->rank == 0) fflush(PETSC_STDOUT);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_tracked(Monitor m)
{
  PetscFunctionBeginUser;
  if (m->fall_speed_max > PETSC_MIN_REAL) PetscCall(MonitorQuantity(m, "fall_speed_max", m->fall_speed_max));
  if (m->speed_max > PETSC_MIN_REAL) PetscCall(MonitorQuantity(m, "speed_max", m->speed_max));
  if (m->bodies->nall) PetscCall(MonitorQuantity(m, "overlap_max", PetscMax(0, m->overlap_max)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorEnd(Monitor m, PetscBool *wanted)
{
  PetscFunctionBeginUser;
  *wanted = m->measure;
  if (!m->measure) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(get_memory(&m->memory_mb));
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

PetscErrorCode MonitorFinish(Monitor m, const char scene[], PetscInt cells, PetscInt unknowns, PetscInt steps, PetscReal time_end)
{
  Summary s = {.scene = scene, .cells = cells, .unknowns = unknowns, .steps = steps, .time_end = time_end};
  char    path[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  ProgressClear(m);
  PetscCall(set_tracked(m));
  PetscCall(collect_summary(m, &s));
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/summary.json", m->dir));
  PetscCall(FileCheck(m->rank ? 0 : write_json(m, &s, path), path));
  PetscCall(print_summary(m, &s));
  PetscFunctionReturn(PETSC_SUCCESS);
}
