/* Monitor: series.csv, bodies.csv, progress lines, options.txt and summary.json (see monitor.h).

   Rank 0 writes; the state of the bodies is the same on all ranks, so nothing is gathered. What can go wrong on rank 0 alone (files) is told to
   all ranks, which leave with one error. The estimate of the time left takes wall clock a simulated second as constant.
   It measures nothing itself but memory and the wall clock of the whole run: times of phases and numbers of a step come from the caller. */
#include "compat.h"
#include "report/monitor.h"
#include "base/opt.h"
#include "bandwidth.h"
#include <errno.h>
#include <petsctime.h>
#include <petscpkg_version.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>
#if defined(__has_include)
  #if __has_include("version.h")
    #include "version.h"
  #endif
#endif
#if !defined(TUMBLE_COMMIT)
  #define TUMBLE_COMMIT "unknown"
#endif
#if !defined(TUMBLE_VERSION)
  #define TUMBLE_VERSION "unknown"
#endif

#if defined(PETSC_USE_DEBUG) || !defined(__OPTIMIZE__) || defined(__SANITIZE_ADDRESS__)
  #define OPTIMISED 0 /* times of such a build mean nothing */
#else
  #define OPTIMISED 1
#endif

#define MAX_BODIES     64 /* with more, bodies.csv holds only those that are asked for */
#define MAX_LINES      50 /* of progress, roughly */
#define MAX_QUANTITIES 64
#define MAX_COLUMNS    64
#define MAX_BALANCES   8
#define VERSION_LEN    128

typedef struct {
  char      name[64];
  PetscReal value;
} Quantity;

typedef struct {
  char      name[32];
  PetscReal min, mean, max; /* over the ranks */
} Balance;

struct _p_Monitor {
  BodyState     *bodies;
  PetscMPIInt    rank, size;
  char           dir[PETSC_MAX_PATH_LEN];
  FILE          *series, *body_file; /* rank 0 */
  PetscBool      restarted;          /* a state has been loaded; then the next two count */
  PetscReal      length[2];          /* of series.csv and bodies.csv then, bytes */
  PetscReal      wall_before;
  PetscInt       series_every, progress_every, first_body, last_body;
  PetscBool      started; /* MonitorWrite has been called; then the next two are set */
  PetscReal      time_start;
  PetscLogDouble wall_start;
  PetscReal      seconds[MONITOR_NPHASES], seconds_before[MONITOR_NPHASES]; /* until now; until the last call of MonitorWrite */
  PetscReal      fall_speed_max, speed_max, overlap_max;                    /* PETSC_MIN_REAL: no such body */
  PetscInt       nsolve, iterations_max;
  PetscReal      iterations_sum;
  PetscInt       nquantity, ncolumn;
  Quantity       column[MAX_COLUMNS]; /* further ones of series.csv */
  Quantity       quantity[MAX_QUANTITIES];
  PetscInt       nbalance;
  Balance        balance[MAX_BALANCES];
  PetscBool      measure, measured; /* -output_yardstick; the rest is set then */
  Bandwidth      yardstick;
  PetscReal      memory_mb;
  PetscLogDouble wall_end;
};

#define SERIES_HEADING \
  "step,time_s,dt_s,cfl,outer_iterations,divergence,kinetic_energy,momentum_error,seconds,seconds_nse,seconds_force,seconds_particle,bodies_energy,contact_energy,contact_work" /* and the added columns */
#define BODIES_HEADING \
  "step,time_s,body,group,x,y,z,angle_rad,u,v,w,omega_x,omega_y,omega_z,force_x,force_y,force_z,torque_x,torque_y,torque_z,gap,radius\n"

static const char *const PHASE[MONITOR_NPHASES] = {"setup", "nse", "force", "particle", "output"};

/* ---- files ---- */

/* Rank 0 knows; all ranks raise the same error */
static PetscErrorCode check_file(Monitor m, int err, const char name[])
{
  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Bcast(&err, 1, MPI_INT, 0, PETSC_COMM_WORLD));
  PetscCheck(!err, PETSC_COMM_WORLD, PETSC_ERR_FILE_WRITE, "Cannot write '%s/%s': %s. Check the disk or choose another -output_dir", m->dir, name,
             strerror(err));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* On rank 0 *file is open afterwards, on the others NULL */
static PetscErrorCode open_file(Monitor m, const char name[], const char heading[], FILE **file)
{
  const PetscBool append = (PetscBool)(m->restarted && !strcmp(name, "options.txt"));
  char            path[PETSC_MAX_PATH_LEN];
  int             err = 0;

  PetscFunctionBeginUser;
  *file = NULL;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", m->dir, name));
  if (m->rank == 0) {
    *file = fopen(path, append ? "a" : "w");
    if (!*file || fputs(heading, *file) < 0 || fflush(*file)) err = errno ? errno : EIO;
  }
  PetscCall(check_file(m, err, name));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rank 0: open a file of the run, cut it at `length` bytes and go on there. 0, errno (ENOENT: no such file), or -1 with the reason why it is not a file of this run. */
static int cut_file(const char path[], const char heading[], PetscReal length, FILE **file, const char **reason)
{
  char first[1024] = "";

  *file = fopen(path, "r+");
  if (!*file) return errno;
  if (!fgets(first, sizeof(first), *file) || strcmp(first, heading)) *reason = "its columns are others";
  else if (fseek(*file, 0, SEEK_END) || (PetscReal)ftell(*file) < length) *reason = "it is shorter than when the checkpoint was written";
  else if (ftruncate(fileno(*file), (off_t)length) || fseek(*file, 0, SEEK_END)) return errno;
  return *reason ? -1 : 0;
}

/* After a restart: continue the file; a directory without it gets a new one */
static PetscErrorCode continue_file(Monitor m, const char name[], const char heading[], PetscReal length, FILE **file)
{
  char        path[PETSC_MAX_PATH_LEN], why[128] = "";
  const char *reason = NULL;
  int         err    = 0;

  PetscFunctionBeginUser;
  *file = NULL;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", m->dir, name));
  if (m->rank == 0) err = cut_file(path, heading, length, file, &reason);
  if (reason) PetscCall(PetscStrncpy(why, reason, sizeof(why)));
  PetscCallMPI(MPI_Bcast(&err, 1, MPI_INT, 0, PETSC_COMM_WORLD));
  PetscCallMPI(MPI_Bcast(why, sizeof(why), MPI_CHAR, 0, PETSC_COMM_WORLD));
  PetscCheck(err >= 0, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "'%s' does not belong to the run that is restarted: %s. Choose another -output_dir; it begins with the first step after the checkpoint",
             path, why);
  if (err == ENOENT) PetscCall(open_file(m, name, heading, file));
  else PetscCall(check_file(m, err, name));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* 0 or errno */
static int close_file(FILE **file)
{
  FILE     *f   = *file;
  const int bad = f ? ferror(f) : 0;

  *file = NULL;
  if (f && (fclose(f) || bad)) return errno ? errno : EIO;
  return 0;
}

/* ---- versions ---- */

typedef struct {
  char petsc[VERSION_LEN], mpi[VERSION_LEN], hypre[VERSION_LEN], hdf5[VERSION_LEN];
} Versions;

/* First line of the library's self-description, up to the first comma ("Open MPI v4.1.4") */
static PetscErrorCode get_mpi_version(char version[], size_t len)
{
  char text[MPI_MAX_LIBRARY_VERSION_STRING];
  int  n;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Get_library_version(text, &n));
  text[strcspn(text, ",\n\r")] = 0;
  PetscCall(PetscStrncpy(version, text, len));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode get_versions(Versions *v)
{
  PetscInt major, minor, subminor;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(v, sizeof(*v)));
  PetscCall(PetscGetVersionNumber(&major, &minor, &subminor, NULL));
  PetscCall(PetscSNPrintf(v->petsc, VERSION_LEN, "%" PetscInt_FMT ".%" PetscInt_FMT ".%" PetscInt_FMT, major, minor, subminor));
  PetscCall(get_mpi_version(v->mpi, VERSION_LEN));
#if defined(PETSC_PKG_HYPRE_VERSION_MAJOR)
  PetscCall(
    PetscSNPrintf(v->hypre, VERSION_LEN, "%d.%d.%d", PETSC_PKG_HYPRE_VERSION_MAJOR, PETSC_PKG_HYPRE_VERSION_MINOR, PETSC_PKG_HYPRE_VERSION_SUBMINOR));
#endif
#if defined(PETSC_PKG_HDF5_VERSION_MAJOR)
  PetscCall(
    PetscSNPrintf(v->hdf5, VERSION_LEN, "%d.%d.%d", PETSC_PKG_HDF5_VERSION_MAJOR, PETSC_PKG_HDF5_VERSION_MINOR, PETSC_PKG_HDF5_VERSION_SUBMINOR));
#endif
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_options(Monitor m)
{
  FILE    *f;
  Versions v;
  char     heading[1024];

  PetscFunctionBeginUser;
  PetscCall(get_versions(&v));
  PetscCall(PetscSNPrintf(heading, sizeof(heading), "# tumble %s (commit %s), PETSc %s, %s, hypre %s, HDF5 %s, ranks %d\n", TUMBLE_VERSION,
                          TUMBLE_COMMIT, v.petsc, v.mpi, v.hypre[0] ? v.hypre : "none", v.hdf5[0] ? v.hdf5 : "none", (int)m->size));
  PetscCall(open_file(m, "options.txt", heading, &f));
  PetscCall(OptWrite(f));
  PetscCall(check_file(m, close_file(&f), "options.txt"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- tracked quantities ---- */

static void track_bodies(Monitor m)
{
  const BodyState *b = m->bodies;

  for (PetscInt k = 0; k < b->n; k++) {
    const BodyGroup *g = &b->group[b->body_group[k]];
    const PetscReal *u = b->u[k];

    m->overlap_max = PetscMax(m->overlap_max, -b->gap[k] / (2 * g->radius));
    if (!(g->free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z))) continue;
    m->fall_speed_max = PetscMax(m->fall_speed_max, -u[b->dim - 1]);
    m->speed_max      = PetscMax(m->speed_max, PetscSqrtReal(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]));
  }
}

static void track_iterations(Monitor m, const MonitorStep *s)
{
  if (s->step == 0) return; /* the state before the first step: nothing was solved */
  m->nsolve++;
  m->iterations_sum += s->outer_iterations;
  m->iterations_max = PetscMax(m->iterations_max, s->outer_iterations);
}

static PetscErrorCode set_tracked(Monitor m)
{
  PetscFunctionBeginUser;
  if (m->fall_speed_max > PETSC_MIN_REAL) PetscCall(MonitorQuantity(m, "fall_speed_max", m->fall_speed_max));
  if (m->speed_max > PETSC_MIN_REAL) PetscCall(MonitorQuantity(m, "speed_max", m->speed_max));
  if (m->bodies->n) PetscCall(MonitorQuantity(m, "overlap_max", PetscMax(0, m->overlap_max)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- lines ---- */

static void print_vector(FILE *f, const PetscReal v[3])
{
  for (PetscInt d = 0; d < 3; d++) fprintf(f, ",%.12g", (double)v[d]);
}

static PetscReal body_angle(const BodyState *b, PetscInt k)
{
  const PetscReal *q = b->q[k];

  return b->dim == 2 ? b->angle[k] : 2 * PetscAtan2Real(PetscSqrtReal(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), q[0]);
}

static void print_body(FILE *f, const MonitorStep *s, const BodyState *b, PetscInt k)
{
  const BodyGroup *g = &b->group[b->body_group[k]];

  fprintf(f, "%" PetscInt_FMT ",%.12g,%" PetscInt_FMT ",%s", s->step, (double)s->time, k, g->name);
  print_vector(f, b->x[k]);
  fprintf(f, ",%.12g", (double)body_angle(b, k));
  print_vector(f, b->u[k]);
  print_vector(f, b->w[k]);
  print_vector(f, b->force[k]);
  print_vector(f, b->torque[k]);
  fprintf(f, b->gap[k] < PETSC_MAX_REAL ? ",%.12g" : ",inf", (double)b->gap[k]);
  fprintf(f, ",%.12g\n", (double)g->disc);
}

/* seconds: of the phases in this step */
static void print_series(Monitor m, const MonitorStep *s, const PetscReal seconds[])
{
  FILE *f = m->series;

  fprintf(f, "%" PetscInt_FMT ",%.12g,%.12g,%.6g,%" PetscInt_FMT, s->step, (double)s->time, (double)s->dt, (double)s->cfl, s->outer_iterations);
  fprintf(f, ",%.6g,%.12g,%.6g,%.6g", (double)s->divergence, (double)s->kinetic_energy, (double)s->momentum_error, (double)s->seconds);
  fprintf(f, ",%.6g,%.6g,%.6g", (double)seconds[MONITOR_NSE], (double)seconds[MONITOR_FORCE], (double)seconds[MONITOR_PARTICLE]);
  fprintf(f, ",%.9g,%.9g,%.9g", (double)s->bodies_energy, (double)s->contact_energy, (double)s->contact_work);
  for (PetscInt i = 0; i < m->ncolumn; i++) fprintf(f, ",%.12g", (double)m->column[i].value);
  fprintf(f, "\n");
}

static PetscErrorCode append_lines(Monitor m, const MonitorStep *s, const PetscReal seconds[])
{
  int err[2] = {0, 0};

  PetscFunctionBeginUser;
  if (m->rank == 0) {
    print_series(m, s, seconds);
    for (PetscInt k = m->first_body; k <= m->last_body; k++) print_body(m->body_file, s, m->bodies, k);
    if (fflush(m->series) || ferror(m->series)) err[0] = errno ? errno : EIO;
    if (fflush(m->body_file) || ferror(m->body_file)) err[1] = errno ? errno : EIO;
  }
  PetscCall(check_file(m, err[0] ? err[0] : err[1], err[0] ? "series.csv" : "bodies.csv"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* 1, 2, 5, 10, ... steps, so that a run to time_end prints at most about MAX_LINES lines */
static PetscInt choose_progress(const MonitorStep *s, PetscReal time_end)
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

static PetscErrorCode print_heading(void)
{
  PetscFunctionBeginUser;
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "%9s %12s %11s %8s %6s %11s %14s %14s %9s %10s\n", "step", "time [s]", "dt [s]", "CFL", "outer",
                        "divergence", "kinetic energy", "momentum error", "wall [s]", "left h:m:s"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode print_progress(Monitor m, const MonitorStep *s, PetscReal time_end)
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

static PetscErrorCode start_run(Monitor m, const MonitorStep *s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscTime(&m->wall_start));
  m->wall_start -= s->seconds + m->wall_before;
  if (!m->restarted) m->time_start = s->time - s->dt;
  m->started = PETSC_TRUE;
  PetscCall(print_heading());
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- summary ---- */

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
  PetscCall(get_versions(&s->versions));
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

static void print_json_versions(FILE *f, const Versions *v)
{
  const char *const name[] = {"petsc", "mpi", "hypre", "hdf5"}, *const text[] = {v->petsc, v->mpi, v->hypre, v->hdf5};

  fprintf(f, "  \"commit\": \"%s\",\n  \"versions\": {\"tumble\": \"%s\"", TUMBLE_COMMIT, TUMBLE_VERSION);
  for (int i = 0; i < 4; i++) {
    if (!text[i][0]) continue;
    fprintf(f, ", \"%s\": ", name[i]);
    print_json_string(f, text[i]);
  }
  fprintf(f, "},\n");
}

static void print_json_seconds(FILE *f, const Summary *s)
{
  fprintf(f, "  \"seconds\": {");
  for (PetscInt i = 0; i < MONITOR_NPHASES; i++) fprintf(f, "\"%s\": %.6g, ", PHASE[i], (double)s->seconds[i]);
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

static void print_json_yardstick(FILE *f, Monitor m)
{
  const Bandwidth *y = &m->yardstick;

  if (!m->measured) return;
  fprintf(f, "  \"yardstick\": {\"triad_one\": %.6g, \"triad_all\": %.6g, \"sweep\": %.6g, \"sweep_bytes\": %.12g},\n", (double)y->triad_one,
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

/* Written beside and renamed: a reader never meets half a file */
static int write_json(Monitor m, const Summary *s, const char path[], const char scratch[])
{
  FILE *f = fopen(scratch, "w");
  int   err;

  if (!f) return errno;
  fprintf(f, "{\n  \"scene\": ");
  print_json_string(f, s->scene);
  fprintf(f,
          ",\n  \"ranks\": %d,\n  \"cells\": %" PetscInt_FMT ",\n  \"unknowns\": %" PetscInt_FMT ",\n  \"bodies\": %" PetscInt_FMT
          ",\n  \"steps\": %" PetscInt_FMT,
          (int)m->size, s->cells, s->unknowns, m->bodies->n, s->steps);
  fprintf(f, ",\n  \"time_end\": ");
  print_json_real(f, s->time_end);
  fprintf(f, ",\n");
  print_json_versions(f, &s->versions);
  fprintf(f, "  \"optimised\": %s,\n", OPTIMISED ? "true" : "false");
  print_json_seconds(f, s);
  fprintf(f, "  \"outer_iterations\": {\"mean\": %.6g, \"max\": %" PetscInt_FMT "},\n", (double)s->iterations_mean, m->iterations_max);
  fprintf(f, "  \"memory_mb\": %.6g,\n", (double)s->memory_mb);
  print_json_balance(f, m);
  print_json_yardstick(f, m);
  print_json_quantities(f, m);
  fprintf(f, "}\n");
  err = close_file(&f);
  if (err) return err;
  return rename(scratch, path) ? errno : 0;
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

static PetscErrorCode print_summary(Monitor m, const Summary *s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "\nSummary of %s: %" PetscInt_FMT " steps to t = %.6g s\n", s->scene, s->steps, (double)s->time_end));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "  %" PetscInt_FMT " cells, %" PetscInt_FMT " unknowns, %" PetscInt_FMT " bod%s, %d rank%s, %.0f MB\n",
                        s->cells, s->unknowns, m->bodies->n, m->bodies->n == 1 ? "y" : "ies", (int)m->size, m->size > 1 ? "s" : "",
                        (double)s->memory_mb));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "  outer iterations a step: mean %.3g, largest %" PetscInt_FMT "\n", (double)s->iterations_mean,
                        m->iterations_max));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "\n  %-16s %12s %8s %14s\n", "phase", "wall [s]", "[%]", "a step [s]"));
  for (PetscInt i = 0; i < MONITOR_NPHASES; i++) PetscCall(print_phase(PHASE[i], s->seconds[i], s, i == MONITOR_SETUP ? PETSC_FALSE : PETSC_TRUE));
  PetscCall(print_phase("total", s->total, s, PETSC_FALSE));
  if (m->nquantity) PetscCall(PetscPrintf(PETSC_COMM_WORLD, "\n  %-24s %14s\n", "quantity", "value"));
  for (PetscInt i = 0; i < m->nquantity; i++)
    PetscCall(PetscPrintf(PETSC_COMM_WORLD, "  %-24s %14.7g\n", m->quantity[i].name, (double)m->quantity[i].value));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "\n  results in %s: series.csv, bodies.csv, summary.json, options.txt\n", m->dir));
  if (m->rank == 0) fflush(PETSC_STDOUT);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

static PetscErrorCode read_options(Monitor m)
{
  PetscInt  range[2] = {0, m->bodies->n - 1};
  PetscBool found;

  PetscFunctionBeginUser;
  m->series_every = 1;
  PetscCall(OptInt("-output_series", &m->series_every));
  PetscCall(OptBool("-output_yardstick", &m->measure));
  PetscCall(OptInt("-output_progress", &m->progress_every));
  PetscCall(OptIntArray("-output_bodies", 2, range, &found));
  PetscCheck(!found || (range[0] <= range[1] && range[1] < m->bodies->n), PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "Option -output_bodies %" PetscInt_FMT ",%" PetscInt_FMT " does not name bodies of this scene, which has %" PetscInt_FMT
             ": give first,last with 0 <= first <= last < %" PetscInt_FMT,
             range[0], range[1], m->bodies->n, m->bodies->n);
  if (!found && m->bodies->n > MAX_BODIES) range[1] = -1;
  m->first_body = range[0];
  m->last_body  = range[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorCreate(Bodies bodies, Monitor *monitor)
{
  Monitor m;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&m));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &m->rank));
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &m->size));
  PetscCall(BodiesGetState(bodies, &m->bodies));
  m->fall_speed_max = m->speed_max = m->overlap_max = PETSC_MIN_REAL;
  PetscCall(read_options(m));
  *monitor = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorAddColumn(Monitor m, const char name[], PetscInt *column)
{
  PetscFunctionBeginUser;
  PetscCheck(m->ncolumn < MAX_COLUMNS, PETSC_COMM_SELF, PETSC_ERR_SUP, "Column '%s': series.csv has room for %d further columns", name, MAX_COLUMNS);
  PetscCall(PetscStrncpy(m->column[m->ncolumn].name, name, sizeof(m->column->name)));
  *column = m->ncolumn++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorSetColumn(Monitor m, PetscInt column, PetscReal value)
{
  PetscFunctionBeginUser;
  PetscCheck(column >= 0 && column < m->ncolumn, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Column %" PetscInt_FMT " of %" PetscInt_FMT, column,
             m->ncolumn);
  m->column[column].value = value;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode open_series(Monitor m)
{
  char heading[256 + MAX_COLUMNS * sizeof(m->column->name)] = SERIES_HEADING;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m->ncolumn; i++) {
    PetscCall(PetscStrlcat(heading, ",", sizeof(heading)));
    PetscCall(PetscStrlcat(heading, m->column[i].name, sizeof(heading)));
  }
  PetscCall(PetscStrlcat(heading, "\n", sizeof(heading)));
  if (m->restarted) PetscCall(continue_file(m, "series.csv", heading, m->length[0], &m->series));
  else PetscCall(open_file(m, "series.csv", heading, &m->series));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorOpen(Monitor m, const char dir[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscStrncpy(m->dir, dir, sizeof(m->dir)));
  PetscCall(write_options(m));
  PetscCall(open_series(m));
  if (m->restarted) PetscCall(continue_file(m, "bodies.csv", BODIES_HEADING, m->length[1], &m->body_file));
  else PetscCall(open_file(m, "bodies.csv", BODIES_HEADING, &m->body_file));
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
  PetscCheck(m->nquantity >= 0 && m->nquantity <= MAX_QUANTITIES, PETSC_COMM_WORLD, PETSC_ERR_FILE_UNEXPECTED,
             "The checkpoint has %" PetscInt_FMT " quantities, this program at most %d: restart with the version that wrote it", m->nquantity,
             MAX_QUANTITIES);
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
  PetscReal      max[3] = {m->fall_speed_max, m->speed_max, m->overlap_max};
  PetscLogDouble now;

  PetscFunctionBeginUser;
  PetscCall(PetscTime(&now));
  if (!StateIsLoading(state)) {
    m->length[0] = m->series ? (PetscReal)ftell(m->series) : 0;
    m->length[1] = m->body_file ? (PetscReal)ftell(m->body_file) : 0;
    if (m->started) m->wall_before = (PetscReal)(now - m->wall_start);
  }
  PetscCall(StateReals(state, "file_length", 2, m->length));
  PetscCall(StateReals(state, "time_start", 1, &m->time_start));
  PetscCall(StateReals(state, "wall", 1, &m->wall_before));
  PetscCall(StateReals(state, "seconds", MONITOR_NPHASES, m->seconds));
  PetscCall(StateReals(state, "max", 3, max));
  PetscCall(StateInts(state, "solves", 1, &m->nsolve));
  PetscCall(StateReals(state, "iterations_sum", 1, &m->iterations_sum));
  PetscCall(StateInts(state, "iterations_max", 1, &m->iterations_max));
  PetscCall(visit_quantities(m, state));
  if (StateIsLoading(state)) {
    m->fall_speed_max = max[0];
    m->speed_max      = max[1];
    m->overlap_max    = max[2];
    m->restarted      = PETSC_TRUE;
    PetscCall(PetscArraycpy(m->seconds_before, m->seconds, MONITOR_NPHASES));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorWrite(Monitor m, const MonitorStep *s, PetscReal time_end)
{
  const PetscBool first = (PetscBool)!m->started, last = (PetscBool)(s->time >= time_end - 0.5 * s->dt);
  PetscReal       seconds[MONITOR_NPHASES];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < MONITOR_NPHASES; i++) {
    seconds[i]           = m->seconds[i] - m->seconds_before[i];
    m->seconds_before[i] = m->seconds[i];
  }
  if (first) PetscCall(start_run(m, s));
  if (!m->progress_every) m->progress_every = s->dt > 0 ? choose_progress(s, time_end) : 0;
  track_bodies(m);
  track_iterations(m, s);
  if (last || s->step % m->series_every == 0) PetscCall(append_lines(m, s, seconds));
  if (first || last || (m->progress_every && s->step % m->progress_every == 0)) PetscCall(print_progress(m, s, time_end));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorPhaseSeconds(Monitor m, MonitorPhase phase, PetscReal seconds)
{
  PetscFunctionBeginUser;
  PetscCheck(phase >= 0 && phase < MONITOR_NPHASES, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Phase %d is not one of 0 to %d", (int)phase,
             MONITOR_NPHASES - 1);
  m->seconds[phase] += seconds;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorQuantity(Monitor m, const char name[], PetscReal value)
{
  PetscInt i = 0;

  PetscFunctionBeginUser;
  while (i < m->nquantity && strcmp(m->quantity[i].name, name)) i++;
  PetscCheck(i < MAX_QUANTITIES, PETSC_COMM_WORLD, PETSC_ERR_ARG_OUTOFRANGE, "Quantity '%s' is one too many: a run holds at most %d", name,
             MAX_QUANTITIES);
  PetscCheck(strlen(name) < sizeof(m->quantity[i].name), PETSC_COMM_WORLD, PETSC_ERR_ARG_OUTOFRANGE,
             "Name of quantity '%s' is longer than %d characters", name, (int)sizeof(m->quantity[i].name) - 1);
  PetscCall(PetscStrncpy(m->quantity[i].name, name, sizeof(m->quantity[i].name)));
  m->quantity[i].value = value;
  if (i == m->nquantity) m->nquantity++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorGetQuantity(Monitor m, const char name[], PetscReal *value, PetscBool *found)
{
  PetscInt i = 0;

  PetscFunctionBeginUser;
  while (i < m->nquantity && strcmp(m->quantity[i].name, name)) i++;
  if (found) *found = (PetscBool)(i < m->nquantity);
  if (i < m->nquantity) *value = m->quantity[i].value;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorBalance(Monitor m, const char name[], PetscReal mine)
{
  PetscReal extreme[2] = {mine, -mine}, sum = mine;
  PetscInt  i = 0;
  Balance  *b;

  PetscFunctionBeginUser;
  while (i < m->nbalance && strcmp(m->balance[i].name, name)) i++;
  PetscCheck(i < MAX_BALANCES && strlen(name) < sizeof(b->name), PETSC_COMM_WORLD, PETSC_ERR_ARG_OUTOFRANGE,
             "Balance '%s' is one too many or its name too long: a run holds at most %d", name, MAX_BALANCES);
  b = m->balance + i;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, extreme, 2, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &sum, 1, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscCall(PetscStrncpy(b->name, name, sizeof(b->name)));
  b->min  = -extreme[1];
  b->mean = sum / m->size;
  b->max  = extreme[0];
  if (i == m->nbalance) m->nbalance++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorYardstick(Monitor m, Mat S)
{
  PetscFunctionBeginUser;
  if (!m->measure) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(get_memory(&m->memory_mb));
  PetscCall(PetscTime(&m->wall_end));
  PetscCall(BandwidthMeasure(S, &m->yardstick));
  m->measured = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorFinish(Monitor m, const char scene[], PetscInt cells, PetscInt unknowns, PetscInt steps, PetscReal time_end)
{
  Summary s = {.scene = scene, .cells = cells, .unknowns = unknowns, .steps = steps, .time_end = time_end};
  char    path[PETSC_MAX_PATH_LEN], scratch[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  PetscCall(set_tracked(m));
  PetscCall(collect_summary(m, &s));
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/summary.json", m->dir));
  PetscCall(PetscSNPrintf(scratch, sizeof(scratch), "%s/summary.json.part", m->dir));
  PetscCall(check_file(m, m->rank ? 0 : write_json(m, &s, path, scratch), "summary.json"));
  PetscCall(print_summary(m, &s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MonitorDestroy(Monitor *monitor)
{
  Monitor m = *monitor;
  int     series, bodies;

  PetscFunctionBeginUser;
  if (!m) PetscFunctionReturn(PETSC_SUCCESS);
  series = close_file(&m->series);
  bodies = close_file(&m->body_file);
  PetscCall(check_file(m, series ? series : bodies, series ? "series.csv" : "bodies.csv"));
  PetscCall(PetscFree(*monitor));
  PetscFunctionReturn(PETSC_SUCCESS);
}
