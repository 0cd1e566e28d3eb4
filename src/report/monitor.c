/* Monitor: see monitor.h. What a step and a run have to tell is kept here; series.c, progress.c and summary.c write
   it. */
#include "compat.h"
#include "base/log.h"
#include "base/opt.h"
#include "files.h"
#include "impl.h"
#include "bodies/local.h"
#include "versions.h"
#include <petsctime.h>
#include <string.h>

#define MAX_BODIES 64    /* with more, bodies.csv holds only those that are asked for */
#define MAX_CSV    10000 /* and with more of these they are written in parallel */

static PetscErrorCode write_options(Monitor m)
{
  FILE    *f;
  Versions v;
  char     heading[1024], path[PETSC_MAX_PATH_LEN], *options;

  PetscFunctionBeginUser;
  PetscCall(VersionsGet(&v));
  PetscCall(PetscSNPrintf(heading, sizeof(heading),
                          "# tumble %s (commit %s), PETSc %s, %s, hypre %s, HDF5 %s, ranks %d\n", v.tumble, v.commit,
                          v.petsc, v.mpi, v.hypre[0] ? v.hypre : "none", v.hdf5[0] ? v.hdf5 : "none", (int)m->size));
  PetscCall(SeriesOpenFile(m, "options.txt", heading, m->before.restarted, &f));
  PetscCall(OptGetRead(&options));
  if (f) fputs(options, f);
  PetscCall(PetscFree(options));
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/options.txt", m->dir));
  PetscCall(FileCheck(m->comm, FileClose(&f), path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- tracked quantities ---- */

static PetscErrorCode track_bodies(Monitor m)
{
  const BodyState *b    = m->bodies;
  PetscReal        v[3] = {m->max.overlap, m->max.fall_speed, m->max.speed};

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < b->n; k++) {
    const BodyGroup *g = BodiesGetGroup(b, k);
    const PetscReal *u = b->u[k];

    v[0] = PetscMax(v[0], -b->gap[k] / (2 * BodiesGetRadius(b, k)));
    if (!(g->free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z))) continue;
    v[1] = PetscMax(v[1], -u[b->dim - 1]);
    v[2] = PetscMax(v[2], PetscSqrtReal(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]));
  }
  PetscCall(BodiesMax(m->all, 3, v));
  m->max.overlap    = v[0];
  m->max.fall_speed = v[1];
  m->max.speed      = v[2];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void track_iterations(Monitor m, const MonitorStep *s)
{
  if (s->step == 0) return; /* the state before the first step: nothing was solved */
  m->solves.n++;
  m->solves.sum += s->outer_iterations;
  m->solves.max = PetscMax(m->solves.max, s->outer_iterations);
}

static PetscErrorCode start_run(Monitor m, const MonitorStep *s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscTime(&m->wall_start));
  m->wall_start -= s->seconds + m->before.wall;
  if (!m->before.restarted) m->time_start = s->time - s->dt;
  m->started = PETSC_TRUE;
  PetscCall(ProgressHeading(m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

static PetscErrorCode read_options(Monitor m)
{
  static const char *const FORMATS[] = {"auto", "csv", "hdf5", NULL};
  PetscInt                 range[2] = {0, m->bodies->nall - 1}, format = 0;
  PetscBool                found;

  PetscFunctionBeginUser;
  m->series_every = 1;
  PetscCall(OptInt("-output_series", &m->series_every));
  PetscCall(OptBool("-output_bandwidth", &m->measure));
  PetscCall(OptInt("-output_progress", &m->progress_every));
  PetscCall(OptBool("-output_progress_solver", &m->solver));
  PetscCall(OptIntArray("-output_bodies", 2, range, &found));
  PetscCheck(!found || (range[0] <= range[1] && range[1] < m->bodies->nall), m->comm, PETSC_ERR_USER_INPUT,
             "Option -output_bodies %" PetscInt_FMT ",%" PetscInt_FMT
             " does not name bodies of this scene, which has %" PetscInt_FMT
             ": give first,last with 0 <= first <= last < %" PetscInt_FMT,
             range[0], range[1], m->bodies->nall, m->bodies->nall);
  if (!found && m->bodies->nall > MAX_BODIES) {
    range[1] = -1;
    PetscCall(LogRemark("bodies.csv stays without lines: more than %d bodies (%" PetscInt_FMT
                        ") are written only where -output_bodies first,last asks for them, such as 0,%" PetscInt_FMT
                        " for all",
                        MAX_BODIES, m->bodies->nall, m->bodies->nall - 1));
  }
  PetscCall(OptChoice("-output_bodies_format", FORMATS, &format));
  m->tables     = (PetscBool)(format == 2 || (format == 0 && range[1] - range[0] >= MAX_CSV));
  m->first_body = range[0];
  m->last_body  = range[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_units(Monitor m)
{
  static const char *const LENGTH[]     = {"km", "m", "cm", "mm", "um", "nm", NULL};
  static const char *const TIME[]       = {"h", "min", "s", "ms", "us", "ns", NULL};
  static const char *const MASS[]       = {"t", "kg", "g", "mg", "ug", "ng", "pg", NULL};
  static const PetscReal   METRES[]     = {1e3, 1, 1e-2, 1e-3, 1e-6, 1e-9};
  static const PetscReal   SECONDS[]    = {3600, 60, 1, 1e-3, 1e-6, 1e-9};
  static const PetscReal   KILOGRAMS[]  = {1e3, 1, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15};
  PetscInt                 word[NUNITS] = {-1, -1, -1}; /* not said */

  PetscFunctionBeginUser;
  PetscCall(OptChoice("-units_length", LENGTH, &word[UNIT_LENGTH]));
  PetscCall(OptChoice("-units_time", TIME, &word[UNIT_TIME]));
  PetscCall(OptChoice("-units_mass", MASS, &word[UNIT_MASS]));
  m->unit[UNIT_LENGTH] = word[UNIT_LENGTH] < 0 ? "" : LENGTH[word[UNIT_LENGTH]];
  m->unit[UNIT_TIME]   = word[UNIT_TIME] < 0 ? "" : TIME[word[UNIT_TIME]];
  m->unit[UNIT_MASS]   = word[UNIT_MASS] < 0 ? "" : MASS[word[UNIT_MASS]];
  m->si[UNIT_LENGTH]   = word[UNIT_LENGTH] < 0 ? 0 : METRES[word[UNIT_LENGTH]];
  m->si[UNIT_TIME]     = word[UNIT_TIME] < 0 ? 0 : SECONDS[word[UNIT_TIME]];
  m->si[UNIT_MASS]     = word[UNIT_MASS] < 0 ? 0 : KILOGRAMS[word[UNIT_MASS]];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorGetUnits(Monitor m, const char *unit[3], PetscReal si[3])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < NUNITS; i++) {
    unit[i] = m->unit[i];
    si[i]   = m->si[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorAddFile(Monitor m, const char name[])
{
  PetscInt n = 0;

  PetscFunctionBeginUser;
  while (n < MAX_FILES && m->further[n]) n++;
  PetscCheck(n < MAX_FILES, m->comm, PETSC_ERR_ARG_OUTOFRANGE, "More than %d tables", MAX_FILES);
  m->further[n] = name;
  PetscFunctionReturn(PETSC_SUCCESS);
}

MPI_Comm MonitorComm(Monitor m)
{
  return m->comm;
}

PetscErrorCode MonitorCreate(MPI_Comm comm, Bodies bodies, Monitor *monitor)
{
  Monitor m;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&m));
  m->comm = comm;
  PetscCallMPI(MPI_Comm_rank(m->comm, &m->rank));
  PetscCallMPI(MPI_Comm_size(m->comm, &m->size));
  m->all = bodies;
  PetscCall(BodiesGetState(bodies, &m->bodies));
  m->max.fall_speed = m->max.speed = m->max.overlap = PETSC_MIN_REAL;
  PetscCall(read_options(m));
  PetscCall(read_units(m));
  *monitor = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorAddColumn(Monitor m, const char name[], PetscInt *column)
{
  PetscFunctionBeginUser;
  PetscCheck(m->ncolumn < MAX_COLUMNS, PETSC_COMM_SELF, PETSC_ERR_SUP,
             "Column '%s': series.csv has room for %d further columns", name, MAX_COLUMNS);
  PetscCheck(MonitorExplains(name), PETSC_COMM_SELF, PETSC_ERR_SUP,
             "Column '%s' of series.csv has no row in MONITOR_FURTHER (src/report/series.c)", name);
  PetscCall(PetscStrncpy(m->column[m->ncolumn].name, name, sizeof(m->column->name)));
  *column = m->ncolumn++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorSetColumn(Monitor m, PetscInt column, PetscReal value)
{
  PetscFunctionBeginUser;
  PetscCheck(column >= 0 && column < m->ncolumn, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "Column %" PetscInt_FMT " of %" PetscInt_FMT, column, m->ncolumn);
  m->column[column].value = value;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorOpen(Monitor m, const char dir[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscStrncpy(m->dir, dir, sizeof(m->dir)));
  PetscCall(write_options(m));
  PetscCall(SeriesOpen(m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Names and values of the quantities set so far */
static PetscErrorCode visit_quantities(Monitor m, State state)
{
  char       names[MAX_QUANTITIES * (sizeof(m->quantity->name) + 1)] = "", *text = names, *next;
  PetscReal *value;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m->nquantity; i++) {
    PetscCall(PetscStrlcat(names, m->quantity[i].name, sizeof(names)));
    PetscCall(PetscStrlcat(names, "\n", sizeof(names)));
  }
  PetscCall(StateInts(state, "quantities", 1, &m->nquantity));
  PetscCall(StateText(state, "quantity_names", &text));
  PetscCheck(m->nquantity >= 0 && m->nquantity <= MAX_QUANTITIES, m->comm, PETSC_ERR_FILE_UNEXPECTED,
             "The checkpoint has %" PetscInt_FMT
             " quantities, this program at most %d: restart with the version that wrote it",
             m->nquantity, MAX_QUANTITIES);
  PetscCall(PetscMalloc1(m->nquantity, &value));
  for (PetscInt i = 0; i < m->nquantity; i++) value[i] = m->quantity[i].value;
  PetscCall(StateReals(state, "quantity", m->nquantity, value));
  next = text;
  for (PetscInt i = 0; i < m->nquantity && StateIsLoading(state); i++) {
    const size_t n = strcspn(next, "\n");

    PetscCall(PetscStrncpy(m->quantity[i].name, next, PetscMin(n + 1, sizeof(m->quantity[i].name))));
    m->quantity[i].value = value[i];
    next += n + (next[n] != 0);
  }
  if (StateIsLoading(state)) PetscCall(PetscFree(text));
  PetscCall(PetscFree(value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorVisitState(void *monitor, State state)
{
  Monitor        m      = monitor;
  PetscReal      max[3] = {m->max.fall_speed, m->max.speed, m->max.overlap};
  PetscInt       nphase = MONITOR_NPHASES; /* as loaded: fewer in older files */
  PetscLogDouble now;

  PetscFunctionBeginUser;
  PetscCall(PetscTime(&now));
  if (!StateIsLoading(state)) {
    m->before.length[0] = m->series ? (PetscReal)ftell(m->series) : 0;
    m->before.length[1] = m->body_file ? (PetscReal)ftell(m->body_file) : 0;
    if (m->started) m->before.wall = (PetscReal)(now - m->wall_start);
  }
  PetscCall(StateReals(state, "file_length", 2, m->before.length));
  PetscCall(StateReals(state, "time_start", 1, &m->time_start));
  PetscCall(StateReals(state, "wall", 1, &m->before.wall));
  if (StateIsLoading(state)) PetscCall(StateGetSize(state, "seconds", &nphase));
  PetscCall(StateReals(state, "seconds", PetscMin(nphase, MONITOR_NPHASES), m->seconds));
  PetscCall(StateReals(state, "max", 3, max));
  PetscCall(StateInts(state, "solves", 1, &m->solves.n));
  PetscCall(StateReals(state, "iterations_sum", 1, &m->solves.sum));
  PetscCall(StateInts(state, "iterations_max", 1, &m->solves.max));
  PetscCall(visit_quantities(m, state));
  if (StateIsLoading(state)) {
    m->max.fall_speed   = max[0];
    m->max.speed        = max[1];
    m->max.overlap      = max[2];
    m->before.restarted = PETSC_TRUE;
    PetscCall(PetscArraycpy(m->seconds_before, m->seconds, MONITOR_NPHASES));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool is_last(const MonitorStep *s, PetscReal time_end)
{
  return (PetscBool)(s->time >= time_end - 0.5 * s->dt);
}

PetscBool MonitorPrints(Monitor m, const MonitorStep *s, PetscReal time_end)
{
  if (!m->progress_every) m->progress_every = s->dt > 0 ? ProgressChoose(s, time_end) : 0;
  return (PetscBool)(!m->started || is_last(s, time_end) || (m->progress_every && s->step % m->progress_every == 0));
}

PetscErrorCode MonitorWrite(Monitor m, const MonitorStep *s, PetscReal time_end)
{
  const PetscBool prints = MonitorPrints(m, s, time_end);
  PetscReal       seconds[MONITOR_NPHASES];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < MONITOR_NPHASES; i++) {
    seconds[i]           = m->seconds[i] - m->seconds_before[i];
    m->seconds_before[i] = m->seconds[i];
  }
  if (!m->started) PetscCall(start_run(m, s));
  PetscCall(track_bodies(m));
  track_iterations(m, s);
  if (is_last(s, time_end) || s->step % m->series_every == 0) PetscCall(SeriesAppend(m, s, seconds));
  if (prints) PetscCall(ProgressPrint(m, s, time_end));
  else PetscCall(ProgressBar(m, s, time_end));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorPhaseSeconds(Monitor m, MonitorPhase phase, PetscReal seconds)
{
  PetscFunctionBeginUser;
  PetscCheck(phase >= 0 && phase < MONITOR_NPHASES, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "Phase %d is not one of 0 to %d", (int)phase, MONITOR_NPHASES - 1);
  m->seconds[phase] += seconds;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorQuantity(Monitor m, const char name[], PetscReal value)
{
  PetscInt i = 0;

  PetscFunctionBeginUser;
  while (i < m->nquantity && strcmp(m->quantity[i].name, name)) i++;
  PetscCheck(i < MAX_QUANTITIES, m->comm, PETSC_ERR_ARG_OUTOFRANGE,
             "Quantity '%s' is one too many: a run holds at most %d", name, MAX_QUANTITIES);
  PetscCheck(strlen(name) < sizeof(m->quantity[i].name), m->comm, PETSC_ERR_ARG_OUTOFRANGE,
             "Name of quantity '%s' is longer than %d characters", name, (int)sizeof(m->quantity[i].name) - 1);
  PetscCall(PetscStrncpy(m->quantity[i].name, name, sizeof(m->quantity[i].name)));
  m->quantity[i].value = value;
  if (i == m->nquantity) m->nquantity++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorBalance(Monitor m, const char name[], PetscReal mine)
{
  PetscReal extreme[2] = {mine, -mine}, sum = mine;
  PetscInt  i = 0;
  Balance  *b;

  PetscFunctionBeginUser;
  while (i < m->balances.n && strcmp(m->balances.row[i].name, name)) i++;
  PetscCheck(i < MAX_BALANCES && strlen(name) < sizeof(b->name), m->comm, PETSC_ERR_ARG_OUTOFRANGE,
             "Balance '%s' is one too many or its name too long: a run holds at most %d", name, MAX_BALANCES);
  b = m->balances.row + i;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, extreme, 2, MPIU_REAL, MPIU_MAX, m->comm));
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &sum, 1, MPIU_REAL, MPIU_SUM, m->comm));
  PetscCall(PetscStrncpy(b->name, name, sizeof(b->name)));
  b->min  = -extreme[1];
  b->mean = sum / m->size;
  b->max  = extreme[0];
  if (i == m->balances.n) m->balances.n++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorDestroy(Monitor *monitor)
{
  PetscFunctionBeginUser;
  if (!*monitor) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SeriesClose(*monitor));
  PetscCall(PetscFree(*monitor));
  PetscFunctionReturn(PETSC_SUCCESS);
}
