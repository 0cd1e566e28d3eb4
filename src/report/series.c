/* Series: the tables series.csv and bodies.csv, a line a step, flushed, so that a running or killed job can be read.
   Columns stand in tables below, which are also the documentation of the files. The state of the bodies is the same
   on all ranks: rank 0 writes, and nothing is gathered. */
#include "compat.h"
#include "impl.h"
#include "files.h"
#include <errno.h>
#include <math.h>
#include <string.h>
#include <unistd.h>

const MonitorColumn MONITOR_SERIES[] = {
  {"step", "", 12, "number of the step, 0 is the state before the first"},
  {"time_s", "time", 12, "at the end of the step"},
  {"dt_s", "time", 12, "length of the step, 0 in steady scenes"},
  {"cfl", "", 6, "largest CFL number of a cell"},
  {"outer_iterations", "", 12, "of the linear solves of the step"},
  {"divergence", "1/time", 6, "root mean square over the domain"},
  {"kinetic_energy", "energy", 12, "of the fluid"},
  {"momentum_error", "", 6, "what the balance of momentum lacks, relative to the sizes of its forces"},
  {"seconds", "s", 6, "wall clock of the step"},
  {"seconds_nse", "s", 6, "of it, on rank 0, the flow equations"},
  {"seconds_force", "s", 6, "forces on bodies"},
  {"seconds_particle", "s", 6, "marking of nodes, motion and contact of bodies"},
  {"bodies_energy", "energy", 9, "kinetic energy of the bodies"},
  {"contact_energy", "energy", 9, "stored in contacts"},
  {"contact_work", "energy", 9, "of contact on the bodies since the beginning"},
  {NULL, NULL, 0, NULL},
};

#define GROUP 3 /* the one column of text */
const MonitorColumn MONITOR_BODIES[] = {
  {"step", "", 12, "number of the step"},
  {"time_s", "time", 12, "at the end of the step"},
  {"body", "", 12, "number of the body, from 0"},
  {"group", "", 0, "name of its group"},
  {"x", "length", 12, "centre of mass"},
  {"y", "length", 12, ""},
  {"z", "length", 12, "0 in 2D"},
  {"angle_rad", "rad", 12, "not wrapped in 2D; in 3D of the rotation out of the initial position"},
  {"u", "length/time", 12, "velocity of the centre"},
  {"v", "length/time", 12, ""},
  {"w", "length/time", 12, ""},
  {"omega_x", "1/time", 12, "angular velocity"},
  {"omega_y", "1/time", 12, ""},
  {"omega_z", "1/time", 12, ""},
  {"force_x", "force", 12, "of the fluid"},
  {"force_y", "force", 12, ""},
  {"force_z", "force", 12, ""},
  {"torque_x", "force length", 12, "of the fluid, about the centre"},
  {"torque_y", "force length", 12, ""},
  {"torque_z", "force length", 12, ""},
  {"gap", "length", 12, "to the next body or wall, inf if nothing is near"},
  {"radius", "length", 12, "of a disc or sphere, else 0"},
  {NULL, NULL, 0, NULL},
};

#define NSERIES (PETSC_STATIC_ARRAY_LENGTH(MONITOR_SERIES) - 1)
#define NBODIES (PETSC_STATIC_ARRAY_LENGTH(MONITOR_BODIES) - 1)

/* ---- files ---- */

PetscErrorCode SeriesOpenFile(Monitor m, const char name[], const char heading[], PetscBool append, FILE **file)
{
  char path[PETSC_MAX_PATH_LEN];
  int  err = 0;

  PetscFunctionBeginUser;
  *file = NULL;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", m->dir, name));
  if (m->rank == 0) {
    *file = fopen(path, append ? "a" : "w");
    if (!*file || fputs(heading, *file) < 0 || fflush(*file)) err = errno ? errno : EIO;
  }
  PetscCall(FileCheck(err, path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rank 0: open a file of the run, cut it at `length` bytes and go on there. 0, errno (ENOENT: no such file), or -1
   with the reason why it is not a file of this run. */
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

/* A new table, or after a restart the one that is there */
static PetscErrorCode open_table(Monitor m, const char name[], const char heading[], PetscReal length, FILE **file)
{
  char        path[PETSC_MAX_PATH_LEN], why[128] = "";
  const char *reason = NULL;
  int         err    = 0;

  PetscFunctionBeginUser;
  *file = NULL;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", m->dir, name));
  if (!m->restarted) err = ENOENT;
  else if (m->rank == 0) err = cut_file(path, heading, length, file, &reason);
  if (reason) PetscCall(PetscStrncpy(why, reason, sizeof(why)));
  PetscCallMPI(MPI_Bcast(&err, 1, MPI_INT, 0, PETSC_COMM_WORLD));
  PetscCallMPI(MPI_Bcast(why, sizeof(why), MPI_CHAR, 0, PETSC_COMM_WORLD));
  PetscCheck(err >= 0, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "'%s' does not belong to the run that is restarted: %s. Choose another -output_dir; it begins with the first step after the checkpoint",
             path, why);
  if (err == ENOENT) PetscCall(SeriesOpenFile(m, name, heading, PETSC_FALSE, file));
  else PetscCall(FileCheck(err, path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_heading(const MonitorColumn column[], char heading[], size_t len)
{
  PetscFunctionBeginUser;
  heading[0] = 0;
  for (PetscInt i = 0; column[i].name; i++) {
    if (i) PetscCall(PetscStrlcat(heading, ",", len));
    PetscCall(PetscStrlcat(heading, column[i].name, len));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SeriesOpen(Monitor m)
{
  char heading[512 + MAX_COLUMNS * (sizeof(m->column->name) + 1)];

  PetscFunctionBeginUser;
  PetscCall(write_heading(MONITOR_SERIES, heading, sizeof(heading)));
  for (PetscInt i = 0; i < m->ncolumn; i++) {
    PetscCall(PetscStrlcat(heading, ",", sizeof(heading)));
    PetscCall(PetscStrlcat(heading, m->column[i].name, sizeof(heading)));
  }
  PetscCall(PetscStrlcat(heading, "\n", sizeof(heading)));
  PetscCall(open_table(m, "series.csv", heading, m->length[0], &m->series));
  PetscCall(write_heading(MONITOR_BODIES, heading, sizeof(heading)));
  PetscCall(PetscStrlcat(heading, "\n", sizeof(heading)));
  PetscCall(open_table(m, "bodies.csv", heading, m->length[1], &m->body_file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_tables(Monitor m, int series, int bodies)
{
  char path[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", m->dir, series ? "series.csv" : "bodies.csv"));
  PetscCall(FileCheck(series ? series : bodies, path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SeriesClose(Monitor m)
{
  const int series = FileClose(&m->series), bodies = FileClose(&m->body_file);

  PetscFunctionBeginUser;
  PetscCall(check_tables(m, series, bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- lines ---- */

static PetscReal body_angle(const BodyState *b, PetscInt k)
{
  const PetscReal *q = b->q[k];

  return b->dim == 2 ? b->angle[k] : 2 * PetscAtan2Real(PetscSqrtReal(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), q[0]);
}

static void print_body(FILE *f, const MonitorStep *s, const BodyState *b, PetscInt k)
{
  const BodyGroup *g = BodiesGetGroup(b, k);
  const PetscReal *x = b->x[k], *u = b->u[k], *w = b->w[k], *F = b->force[k], *T = b->torque[k];
  const PetscReal  gap            = b->gap[k] < PETSC_MAX_REAL ? b->gap[k] : (PetscReal)INFINITY;
  const PetscReal  value[NBODIES] = {s->step, s->time, k,    0,    x[0], x[1], x[2], body_angle(b, k), u[0], u[1], u[2], w[0], w[1], w[2],
                                     F[0],    F[1],    F[2], T[0], T[1], T[2], gap,  g->disc};

  for (size_t i = 0; i < NBODIES; i++) {
    if (i == GROUP) fprintf(f, ",%s", g->name);
    else fprintf(f, "%s%.*g", i ? "," : "", (int)MONITOR_BODIES[i].digits, (double)value[i]);
  }
  fprintf(f, "\n");
}

/* seconds: of the phases in this step */
static void print_series(Monitor m, const MonitorStep *s, const PetscReal seconds[])
{
  const PetscReal value[NSERIES] = {s->step,
                                    s->time,
                                    s->dt,
                                    s->cfl,
                                    s->outer_iterations,
                                    s->divergence,
                                    s->kinetic_energy,
                                    s->momentum_error,
                                    s->seconds,
                                    seconds[MONITOR_NSE],
                                    seconds[MONITOR_FORCE],
                                    seconds[MONITOR_PARTICLE],
                                    s->bodies_energy,
                                    s->contact_energy,
                                    s->contact_work};

  for (size_t i = 0; i < NSERIES; i++) fprintf(m->series, "%s%.*g", i ? "," : "", (int)MONITOR_SERIES[i].digits, (double)value[i]);
  for (PetscInt i = 0; i < m->ncolumn; i++) fprintf(m->series, ",%.12g", (double)m->column[i].value);
  fprintf(m->series, "\n");
}

PetscErrorCode SeriesAppend(Monitor m, const MonitorStep *s, const PetscReal seconds[])
{
  int err[2] = {0, 0};

  PetscFunctionBeginUser;
  if (m->rank == 0) {
    print_series(m, s, seconds);
    for (PetscInt k = m->first_body; k <= m->last_body; k++) print_body(m->body_file, s, m->bodies, k);
    if (fflush(m->series) || ferror(m->series)) err[0] = errno ? errno : EIO;
    if (fflush(m->body_file) || ferror(m->body_file)) err[1] = errno ? errno : EIO;
  }
  PetscCall(check_tables(m, err[0], err[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}
