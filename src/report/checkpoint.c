/* Checkpoint: see checkpoint.h. The order of files is that of their time of change: a run restarted from an old
   checkpoint leaves newer steps of the abandoned branch behind, which are not its past. Rank 0 looks at the
   directory, all ranks learn the result. */
#include "compat.h"
#include "base/runcomm.h"
#include "report/checkpoint.h"
#include "base/hdf5.h"
#include "base/log.h"
#include "base/opt.h"
#include "mesh/state.h"
#include <dirent.h>
#include <errno.h>
#include <petsctime.h>
#include "base/interrupt.h"
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define MAX_MODULES 32
#define KEEP        2

typedef struct {
  char       name[64];
  void      *module;
  StateVisit visit;
} Module;

struct _p_Checkpoint {
  MPI_Comm         comm;
  Mesh             mesh;
  const MeshLocal *loc;
  PetscInt         meshes; /* of the mesh, when its state was created */
  Fields           fields;
  State            state;
  PetscMPIInt      rank;
  PetscInt         every, nmodule, last_step; /* last_step: in the newest file, -1 if there is none */
  PetscReal        minutes;
  PetscLogDouble   written; /* wall clock of the last checkpoint */
  char             from[PETSC_MAX_PATH_LEN];
  PetscBool        restarted, stopped, polled; /* polled: a step was taken */
  PetscBool        deforms;                    /* the mesh follows bodies */
  Module           module[MAX_MODULES], restore;
  struct sigaction usual[3];
  int              signal; /* that stopped the run */
  PetscLogDouble   last_poll;
};

#define LARGE_MESH 50000 /* nodes, from which on the solves of the first step ask for signals */
#define LONG_STEP  1     /* s, from which on the solves of the next step ask for signals */

static volatile sig_atomic_t wants_write, wants_stop;
static char                  last_path[PETSC_MAX_PATH_LEN]; /* for CheckpointGetLast */

static const int SIGNALS[] = {SIGUSR1, SIGTERM, SIGINT};
#define NSIGNALS ((int)(sizeof(SIGNALS) / sizeof(SIGNALS[0])))

/* Options that have no bearing on the state: by beginning, by end */
static const char *const FREE_BEGIN[] = {"-output_",     "-checkpoint_",   "-sim_time",   "-sim_steps",
                                         "-sim_restart", "-scene_dry_run", "-log_",       "-options_",
                                         "-malloc",      "-info",          "-shape_path", NULL};
static const char *const FREE_END[]   = {"_monitor", "_view", "_converged_reason", NULL};

/* ---- signals ---- */

static void note_signal(int number)
{
  if (number == SIGUSR1) wants_write = 1;
  else if (number == SIGINT && wants_stop) { /* impatient: at once */ (void)signal(SIGINT, SIG_DFL);
    (void)raise(SIGINT);
  } else InterruptRaise(wants_stop = number);
}

static void take_signals(Checkpoint c)
{
  struct sigaction action;

  memset(&action, 0, sizeof(action));
  action.sa_handler = note_signal;
  action.sa_flags   = SA_RESTART;
  sigemptyset(&action.sa_mask);
  wants_write = wants_stop = 0;
  InterruptRaise(0);
  InterruptArm((PetscBool)(c->loc->nnode_global > LARGE_MESH)); /* how long a step takes is not known yet */
  for (int i = 0; i < NSIGNALS; i++) (void)sigaction(SIGNALS[i], &action, &c->usual[i]);
}

/* ---- files in the directory (rank 0) ---- */

typedef struct {
  char            name[64];
  PetscInt        step;
  struct timespec changed;
} File;

static int newest_first(const void *a, const void *b)
{
  const File *x = a, *y = b;

  if (x->changed.tv_sec != y->changed.tv_sec) return x->changed.tv_sec > y->changed.tv_sec ? -1 : 1;
  if (x->changed.tv_nsec != y->changed.tv_nsec) return x->changed.tv_nsec > y->changed.tv_nsec ? -1 : 1;
  return x->step > y->step ? -1 : x->step < y->step;
}

/* Checkpoints in dir, newest first; *file is allocated. suffix ".h5", or ".h5.part" for what a killed run left. */
static PetscErrorCode list_files(const char dir[], const char suffix[], PetscInt *n, File **file)
{
  DIR           *d        = opendir(dir);
  PetscInt       capacity = 0;
  struct dirent *entry;

  PetscFunctionBeginUser;
  *n    = 0;
  *file = NULL;
  while (d && (entry = readdir(d))) {
    char        path[PETSC_MAX_PATH_LEN];
    long        step;
    int         end = 0;
    struct stat st;

    if (sscanf(entry->d_name, "checkpoint_%ld%n", &step, &end) != 1 || strcmp(entry->d_name + end, suffix) ||
        strlen(entry->d_name) >= sizeof((*file)->name))
      continue;
    PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", dir, entry->d_name));
    if (stat(path, &st)) continue;
    if (*n == capacity) {
      capacity = 2 * capacity + 16;
      PetscCall(PetscRealloc((size_t)capacity * sizeof(**file), file));
    }
    (*file)[*n].step    = (PetscInt)step;
    (*file)[*n].changed = st.st_mtim;
    PetscCall(PetscStrncpy((*file)[*n].name, entry->d_name, sizeof((*file)->name)));
    (*n)++;
  }
  if (d) (void)closedir(d);
  if (*n) qsort(*file, (size_t)*n, sizeof(**file), newest_first);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Remove all but the first `keep` files of the list */
static PetscErrorCode remove_files(const char dir[], const char suffix[], PetscInt keep)
{
  File    *file;
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(list_files(dir, suffix, &n, &file));
  for (PetscInt i = keep; i < n; i++) {
    char path[PETSC_MAX_PATH_LEN];

    PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", dir, file[i].name));
    (void)remove(path);
  }
  PetscCall(PetscFree(file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The newest whole checkpoint in dir: path, "" if there is none; says which newer ones it passes over */
static PetscErrorCode find_latest(const char dir[], char path[], size_t len)
{
  File    *file;
  PetscInt n;

  PetscFunctionBeginUser;
  path[0] = 0;
  PetscCall(list_files(dir, ".h5", &n, &file));
  for (PetscInt i = 0; i < n; i++) {
    char        reason[256];
    const char *bad;

    PetscCall(PetscSNPrintf(path, len, "%s/%s", dir, file[i].name));
    bad = Hdf5CheckFile(path, reason, sizeof(reason));
    if (!bad) break;
    PetscCall(PetscPrintf(PETSC_COMM_SELF, "Checkpoint %s is passed over: %s\n", path, bad));
    path[0] = 0;
  }
  PetscCall(PetscFree(file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- options ---- */

static PetscBool is_free(const char line[])
{
  const size_t n = strcspn(line, " \n");

  for (int i = 0; FREE_BEGIN[i]; i++)
    if (!strncmp(line, FREE_BEGIN[i], strlen(FREE_BEGIN[i]))) return PETSC_TRUE;
  for (int i = 0; FREE_END[i]; i++)
    if (n >= strlen(FREE_END[i]) && !strncmp(line + n - strlen(FREE_END[i]), FREE_END[i], strlen(FREE_END[i])))
      return PETSC_TRUE;
  return PETSC_FALSE;
}

/* The line of text that gives the option that `line` gives, or NULL */
static const char *find_line(const char text[], const char line[])
{
  const size_t n = strcspn(line, " \n");

  for (const char *at = text; *at; at += strcspn(at, "\n"), at += *at == '\n')
    if (strcspn(at, " \n") == n && !strncmp(at, line, n)) return at;
  return NULL;
}

static int same_line(const char a[], const char b[])
{
  const size_t n = strcspn(a, "\n");

  return n == strcspn(b, "\n") && !strncmp(a, b, n);
}

/* Does an option bear on bodies, flow or mesh, rather than on how equations are solved? */
static PetscBool is_physics(const char name[])
{
  static const char *const BEGIN[]  = {"-flow_",     "-particle_", "-mesh_",     "-couple_", "-contact_",
                                       "-sim_frame", "-sim_dt",    "-sim_adapt", "-preset",  NULL};
  static const char *const WITHIN[] = {"_ksp_",   "_pc_",  "_fieldsplit_",  "_mg_",    "_mat_",
                                       "_solver", "_rtol", "_velocity_tol", "_min_it", NULL};

  for (int i = 0; WITHIN[i]; i++)
    if (strstr(name, WITHIN[i])) return PETSC_FALSE;
  for (int i = 0; BEGIN[i]; i++)
    if (!strncmp(name, BEGIN[i], strlen(BEGIN[i]))) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* The value in a line `-name value`, without its end; `none` where there is no line */
static void copy_value(const char line[], const char none[], char value[], size_t len)
{
  const size_t n = line ? strcspn(line, " \n") : 0;

  if (!line) (void)snprintf(value, len, "%s", none);
  else (void)snprintf(value, len, "%.*s", (int)strcspn(line + n + (line[n] == ' '), "\n"), line + n + (line[n] == ' '));
  if (!value[0]) (void)snprintf(value, len, "true"); /* a switch */
}

/* One line about an option that differs: name, value now, value then */
static PetscErrorCode print_change(MPI_Comm comm, const char was[], const char is[], PetscInt *n)
{
  const char *line = is ? is : was;
  char        name[OPT_NAME], none[128], then[512], now[512];
  const char *usual;

  PetscFunctionBeginUser;
  (void)snprintf(name, sizeof(name), "%.*s", (int)strcspn(line, " \n"), line);
  usual = OptGetDefault(name);
  if (strchr(usual, ' ')) usual = ""; /* one in words */
  (void)snprintf(none, sizeof(none), "not given%s%s", usual[0] ? ": " : "", usual);
  copy_value(was, none, then, sizeof(then));
  copy_value(is, none, now, sizeof(now));
  if (is_physics(name)) {
    PetscCall(LogRemark("the run goes on with other physics than its checkpoint: %s %s (was %s)", name, now, then));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (!(*n)++) PetscCall(PetscPrintf(comm, "Other options that differ from those of the checkpoint:\n"));
  PetscCall(PetscPrintf(comm, "  %s %s (was %s)\n", name, now, then));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Say which options differ between then and now, one `-name value` a line: those of the physics first */
static PetscErrorCode print_changes(const char then[], const char now[])
{
  PetscInt n = 0;

  PetscFunctionBeginUser;
  for (int pass = 0; pass < 4; pass++) { /* what is new or other, then what is gone */
    const PetscBool missing = (PetscBool)(pass % 2), physics = (PetscBool)(pass < 2);
    const char     *text = missing ? then : now, *other = missing ? now : then;

    for (const char *at = text; *at; at += strcspn(at, "\n"), at += *at == '\n') {
      const char *match = find_line(other, at);
      char        name[OPT_NAME];

      if (is_free(at) || (match && (missing || same_line(at, match)))) continue;
      (void)snprintf(name, sizeof(name), "%.*s", (int)strcspn(at, " \n"), at);
      if (is_physics(name) == physics)
        PetscCall(print_change(RunComm(), missing ? at : match, missing ? NULL : at, &n));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit_options(Checkpoint c)
{
  char *now, *then, *renamed;

  PetscFunctionBeginUser;
  PetscCall(OptGetAll(&now));
  then = now;
  PetscCall(StateModule(c->state, NULL));
  PetscCall(StateText(c->state, "options", &then));
  if (StateIsLoading(c->state)) {
    PetscCall(OptRenameLines(then, &renamed)); /* a checkpoint may be older than a name */
    PetscCall(print_changes(renamed, now));
    PetscCall(PetscFree(renamed));
    PetscCall(PetscFree(then));
  }
  PetscCall(PetscFree(now));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit_modules(Checkpoint c)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->nmodule; i++) {
    PetscCall(StateModule(c->state, c->module[i].name));
    PetscCall(c->module[i].visit(c->module[i].module, c->state));
  }
  PetscCall(visit_options(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Its keys, places of all cells and nodes, need not be there between checkpoints, unless the mesh deforms: those are
   the places of the beginning */
static PetscErrorCode remove_state(Checkpoint c)
{
  PetscFunctionBeginUser;
  if (!c->deforms) PetscCall(StateDestroy(&c->state));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A state of the cells and nodes that there are now */
static PetscErrorCode renew_state(Checkpoint c)
{
  PetscFunctionBeginUser;
  if (c->state && c->loc->meshes == c->meshes) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(StateDestroy(&c->state));
  PetscCall(MeshCreateState(c->mesh, &c->state));
  c->meshes = c->loc->meshes;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode CheckpointCreate(Mesh mesh, PetscBool deforms, Fields fields, Checkpoint *checkpoint)
{
  Checkpoint c;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  PetscCall(MeshGetComm(mesh, &c->comm));
  c->fields    = fields;
  c->last_step = -1;
  c->deforms   = deforms;
  PetscCallMPI(MPI_Comm_rank(c->comm, &c->rank));
  PetscCall(OptInt("-checkpoint_every", &c->every));
  PetscCall(OptReal("-checkpoint_minutes", &c->minutes));
  PetscCall(OptString("-sim_restart", c->from, sizeof(c->from)));
  c->mesh = mesh;
  PetscCall(MeshGetLocal(mesh, &c->loc));
  if (deforms) PetscCall(renew_state(c));
  PetscCall(PetscTime(&c->written));
  last_path[0] = 0;
  take_signals(c);
  *checkpoint = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CheckpointDestroy(Checkpoint *checkpoint)
{
  Checkpoint c = *checkpoint;

  PetscFunctionBeginUser;
  if (!c) PetscFunctionReturn(PETSC_SUCCESS);
  for (int i = 0; i < NSIGNALS; i++) (void)sigaction(SIGNALS[i], &c->usual[i], NULL);
  PetscCall(StateDestroy(&c->state));
  PetscCall(PetscFree(*checkpoint));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CheckpointView(Checkpoint c, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  if (c->every || c->minutes > 0) {
    PetscCall(PetscViewerASCIIPrintf(viewer, "checkpoints:"));
    if (c->every) PetscCall(PetscViewerASCIIPrintf(viewer, " every %" PetscInt_FMT " steps", c->every));
    if (c->minutes > 0) PetscCall(PetscViewerASCIIPrintf(viewer, " every %g minutes", (double)c->minutes));
    PetscCall(PetscViewerASCIIPrintf(viewer, ", the last %d kept\n", KEEP));
  } else PetscCall(PetscViewerASCIIPrintf(viewer, "checkpoints: on SIGUSR1, SIGTERM and SIGINT only\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CheckpointAdd(Checkpoint c, const char name[], void *module, StateVisit visit)
{
  PetscFunctionBeginUser;
  PetscCheck(c->nmodule < MAX_MODULES, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "Module '%s' is one too many: a checkpoint has room for %d", name, MAX_MODULES);
  PetscCall(PetscStrncpy(c->module[c->nmodule].name, name, sizeof(c->module[0].name)));
  c->module[c->nmodule].module  = module;
  c->module[c->nmodule++].visit = visit;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CheckpointSetRestore(Checkpoint c, const char name[], void *module, StateVisit restore)
{
  PetscFunctionBeginUser;
  PetscCall(PetscStrncpy(c->restore.name, name, sizeof(c->restore.name)));
  c->restore.module = module;
  c->restore.visit  = restore;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode restore_mesh(Checkpoint c)
{
  PetscFunctionBeginUser;
  PetscCall(renew_state(c));
  if (!c->restore.visit) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(StateBeginLook(c->state, c->from));
  PetscCall(StateModule(c->state, c->restore.name));
  PetscCall((*c->restore.visit)(c->restore.module, c->state));
  PetscCall(StateEnd(c->state));
  PetscCall(renew_state(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CheckpointLoad(Checkpoint c, PetscBool *restarted)
{
  const char *dir;

  PetscFunctionBeginUser;
  *restarted = PETSC_FALSE;
  if (!c->from[0]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_CHECKPOINT, 0, 0, 0, 0));
  if (!strcmp(c->from, "latest")) {
    PetscCall(FieldsGetDirectory(c->fields, &dir));
    if (c->rank == 0) PetscCall(find_latest(dir, c->from, sizeof(c->from)));
    PetscCallMPI(MPI_Bcast(c->from, sizeof(c->from), MPI_CHAR, 0, c->comm));
    PetscCheck(c->from[0], c->comm, PETSC_ERR_USER_INPUT,
               "-sim_restart latest: '%s' holds no whole checkpoint. Give a file, another -output_dir, or start without -sim_restart",
               dir);
  }
  PetscCall(restore_mesh(c));
  PetscCall(StateBeginLoad(c->state, c->from));
  PetscCall(visit_modules(c));
  PetscCall(StateEnd(c->state));
  PetscCall(remove_state(c));
  PetscCall(PetscStrncpy(last_path, c->from, sizeof(last_path)));
  *restarted = c->restarted = PETSC_TRUE;
  PetscCall(PetscLogEventEnd(TB_CHECKPOINT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CheckpointOpen(Checkpoint c)
{
  const char *dir;
  PetscBool   overwrite;
  PetscInt    n = 0;
  File       *file;

  PetscFunctionBeginUser;
  PetscCall(FieldsGetDirectory(c->fields, &dir));
  PetscCall(FieldsGetOverwrite(c->fields, &overwrite));
  if (c->rank == 0) {
    PetscCall(remove_files(dir, ".h5.part", 0));
    if (!c->restarted && overwrite) PetscCall(remove_files(dir, ".h5", 0));
    PetscCall(list_files(dir, ".h5", &n, &file));
    PetscCall(PetscFree(file));
  }
  PetscCallMPI(MPI_Bcast(&n, 1, MPIU_INT, 0, c->comm));
  PetscCheck(!n || c->restarted, c->comm, PETSC_ERR_USER_INPUT,
             "Directory '%s' already holds checkpoints of a run: continue it with -sim_restart latest, choose another -output_dir, or allow to remove them with "
             "-output_overwrite",
             dir);
  if (c->restarted) PetscCall(PetscPrintf(c->comm, "Restarted from %s\n", c->from));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CheckpointPoll(Checkpoint c, PetscInt step, PetscBool *due, PetscBool *stop)
{
  int            wants[3] = {wants_write, wants_stop, 0};
  PetscLogDouble now;

  PetscFunctionBeginUser;
  c->polled = PETSC_TRUE;
  PetscCall(remove_state(c));
  PetscCall(PetscTime(&now));
  if (c->minutes > 0 && now - c->written > 60 * c->minutes) wants[0] = 1;
  wants[2]     = now - c->last_poll > LONG_STEP;
  c->last_poll = now;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, wants, 3, MPI_INT, MPI_MAX, c->comm));
  wants_write = 0;
  InterruptArm((PetscBool)(wants[2] != 0));
  *stop = c->stopped = (PetscBool)(wants[1] != 0);
  c->signal          = wants[1];
  *due               = (PetscBool)(wants[0] || wants[1] || (c->every && step % c->every == 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CheckpointWrite(Checkpoint c, PetscInt step, PetscReal time)
{
  char        path[PETSC_MAX_PATH_LEN];
  const char *dir;

  PetscFunctionBeginUser;
  if (c->last_step == step) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_CHECKPOINT, 0, 0, 0, 0));
  PetscCall(FieldsGetDirectory(c->fields, &dir));
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/checkpoint_%" PetscInt_FMT ".h5", dir, step));
  PetscCall(renew_state(c));
  PetscCall(StateBeginSave(c->state, path));
  PetscCall(visit_modules(c));
  PetscCall(StateEnd(c->state));
  PetscCall(remove_state(c));
  if (c->rank == 0) PetscCall(remove_files(dir, ".h5", KEEP));
  PetscCall(PetscStrncpy(last_path, path, sizeof(last_path)));
  PetscCall(PetscTime(&c->written));
  c->last_step = step;
  PetscCall(PetscInfo(NULL, "Checkpoint %s at time %g\n", path, (double)time));
  PetscCall(PetscLogEventEnd(TB_CHECKPOINT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CheckpointFinish(Checkpoint c, PetscInt step, PetscReal time)
{
  PetscFunctionBeginUser;
  if ((c->every || c->minutes > 0) && (c->polled || !c->restarted)) PetscCall(CheckpointWrite(c, step, time));
  if (c->stopped)
    PetscCall(PetscPrintf(c->comm,
                          "Stopped by %s after step %" PetscInt_FMT
                          ", t = %g. The state is in %s: continue with -sim_restart latest\n",
                          c->signal == SIGINT ? "SIGINT" : "SIGTERM", step, (double)time, last_path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const char *CheckpointGetLast(void)
{
  return last_path;
}
