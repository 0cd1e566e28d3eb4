/* Cores: see cores.h. */
#define _GNU_SOURCE
#include "compat.h"
#include "cores.h"
#include <dlfcn.h>
#include <limits.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define YIELD      "OMPI_MCA_mpi_yield_when_idle"
#define MAX_CPUS   4096
#define WORD       ((int)(CHAR_BIT * sizeof(unsigned long)))
#define WORDS      (MAX_CPUS / WORD)
#define FIRST_STEP 10

/* ---- what there is ---- */

/* Quota over period, 0: none. One file "200000 100000" or "max 100000", or two files. */
static double read_limit(const char folder[])
{
  char  path[1200];
  FILE *f;
  long  quota = -1, period = 0;

  (void)snprintf(path, sizeof(path), "%s/cpu.max", folder);
  if ((f = fopen(path, "r"))) {
    if (fscanf(f, "%ld %ld", &quota, &period) != 2) quota = -1;
    (void)fclose(f);
    return quota > 0 && period > 0 ? (double)quota / (double)period : 0;
  }
  (void)snprintf(path, sizeof(path), "%s/cpu.cfs_quota_us", folder);
  if ((f = fopen(path, "r"))) {
    if (fscanf(f, "%ld", &quota) != 1) quota = -1;
    (void)fclose(f);
  }
  (void)snprintf(path, sizeof(path), "%s/cpu.cfs_period_us", folder);
  if (quota > 0 && (f = fopen(path, "r"))) {
    if (fscanf(f, "%ld", &period) != 1) period = 0;
    (void)fclose(f);
  }
  return quota > 0 && period > 0 ? (double)quota / (double)period : 0;
}

/* The least limit of the group and those above it; a container often sees its own group as the root */
static double read_group(const char root[], const char group[])
{
  char   folder[1100];
  double smallest = 0;
  size_t top      = strlen(root);

  (void)snprintf(folder, sizeof(folder), "%s%s", root, group);
  for (;;) {
    const double limit = read_limit(folder);
    char        *slash = strrchr(folder, '/');

    if (limit > 0 && (smallest == 0 || limit < smallest)) smallest = limit;
    if (!slash || (size_t)(slash - folder) < top) return smallest;
    *slash = 0;
  }
}

double CoresReadQuota(const char file[], const char root[])
{
  char   line[1024];
  double smallest = 0;
  FILE  *f        = fopen(file, "r");

  while (f && fgets(line, sizeof(line), f)) { /* "0::/group", or "4:cpu,cpuacct:/group" */
    char  *names = strchr(line, ':'), *group = names ? strchr(names + 1, ':') : NULL, top[1040];
    double limit;

    line[strcspn(line, "\n")] = 0;
    if (!group) continue;
    *group++ = 0;
    names++;
    if (names[0] && strcmp(names, "cpu") && strncmp(names, "cpu,", 4) && !strstr(names, ",cpu,") &&
        (strlen(names) < 4 || strcmp(names + strlen(names) - 4, ",cpu")))
      continue;
    (void)snprintf(top, sizeof(top), "%s%s", root, names[0] ? "/cpu" : "");
    limit = read_group(top, group);
    if (limit > 0 && (smallest == 0 || limit < smallest)) smallest = limit;
  }
  if (f) (void)fclose(f);
  return smallest;
}

int CoresReadLocalSize(void)
{
  static const char *const NAME[] = {"OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "PMI_LOCAL_SIZE",
                                     "SLURM_STEP_TASKS_PER_NODE", "SLURM_TASKS_PER_NODE"};

  for (int i = 0; i < (int)PETSC_STATIC_ARRAY_LENGTH(NAME); i++) {
    const char *text = getenv(NAME[i]);

    if (i >= 3 && !getenv("SLURM_PROCID")) continue; /* of the job, which another launcher divides as it likes */
    if (text && atoi(text) > 0) return atoi(text);
  }
  return 0;
}

/* Cores of a process (0: this one); their number, 0: not known */
static int read_mask(pid_t process, unsigned long mask[WORDS])
{
  int n = 0;

  memset(mask, 0, WORDS * sizeof(*mask));
  if (sched_getaffinity(process, WORDS * sizeof(*mask), (cpu_set_t *)mask)) return 0;
  for (int w = 0; w < WORDS; w++) n += __builtin_popcountl(mask[w]);
  return n;
}

/* ---- who gives way ---- */

static int    given;             /* the user has said who gives way */
static double quota;             /* of the container, cores; 0: none, and no affinity shows it */
static int    on_node, on_cores; /* ranks on this node, cores that they may use */

void CoresPrepare(void)
{
  unsigned long mask[WORDS], launcher[WORDS];
  const int     size = CoresReadLocalSize(), mine = read_mask(0, mask);

  given = getenv(YIELD) != NULL;
  quota = CoresReadQuota("/proc/self/cgroup", "/sys/fs/cgroup");
  if (size <= 1 || given) return;
  (void)read_mask(getppid(), launcher);
  if ((quota > 0 && quota < size) || (mine > 0 && mine < size && !memcmp(mask, launcher, sizeof(mask))))
    (void)setenv(YIELD, "1", 1);
}

int CoresAreShared(int n, int words, const unsigned long mask[])
{
  for (int r = 0; r < n; r++) {
    int cores = 0, ranks = 0;

    for (int w = 0; w < words; w++) cores += __builtin_popcountl(mask[r * words + w]);
    for (int q = 0; q < n; q++) {
      int inside = 1;

      for (int w = 0; w < words && inside; w++) inside = !(mask[q * words + w] & ~mask[r * words + w]);
      ranks += inside;
    }
    if (cores && ranks > cores) return 1;
  }
  return 0;
}

void CoresPin(void)
{
  unsigned long mask[WORDS], *all;
  MPI_Comm      node;
  int           shared;
  void (*set_yield)(_Bool);

  (void)MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &node);
  (void)MPI_Comm_size(node, &on_node);
  (void)read_mask(0, mask);
  all    = (unsigned long *)calloc((size_t)on_node, sizeof(mask));
  shared = all != NULL;
  (void)MPI_Allreduce(MPI_IN_PLACE, &shared, 1, MPI_INT, MPI_MIN, node);
  if (shared) {
    (void)MPI_Allgather(mask, WORDS, MPI_UNSIGNED_LONG, all, WORDS, MPI_UNSIGNED_LONG, node);
    shared = CoresAreShared(on_node, WORDS, all);
    for (int i = WORDS; i < on_node * WORDS; i++) all[i % WORDS] |= all[i];
    for (int w = 0; w < WORDS; w++) on_cores += __builtin_popcountl(all[w]);
  }
  free(all);
  (void)MPI_Comm_free(&node);
  /* Open MPI reads its option when it starts */
  *(void **)&set_yield = dlsym(RTLD_DEFAULT, "opal_progress_set_yield_when_idle");
  if (set_yield && !given) set_yield(shared || (quota > 0 && quota < on_node));
}

/* ---- what ranks get ---- */

static double read_clock(clockid_t clock)
{
  struct timespec t = {0, 0};

  (void)clock_gettime(clock, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Seconds that this process was ready to run while others ran; -1: the system does not tell */
static double read_waited(void)
{
  double ran, waited = -1;
  FILE  *f = fopen("/proc/self/schedstat", "r");

  if (!f) return -1;
  if (fscanf(f, "%lf %lf", &ran, &waited) != 2) waited = -1e9;
  (void)fclose(f);
  return 1e-9 * waited;
}

PetscErrorCode CoresBegin(Cores *c)
{
  PetscFunctionBeginUser;
  *c = (Cores){.wall      = read_clock(CLOCK_MONOTONIC),
               .processor = read_clock(CLOCK_PROCESS_CPUTIME_ID),
               .waited    = read_waited(),
               .next      = FIRST_STEP};
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Wall clock since the beginning; of it: processor time, time lost to others */
static void get_times(const Cores *c, double *wall, double *got, double *lost)
{
  const double waited = read_waited();

  *wall = read_clock(CLOCK_MONOTONIC) - c->wall;
  *got  = *wall > 0 ? (read_clock(CLOCK_PROCESS_CPUTIME_ID) - c->processor) / *wall : 1;
  *lost = waited >= 0 && c->waited >= 0 ? (waited - c->waited) / PetscMax(*wall, 1e-9) : 1 - *got;
}

/* What to do, on rank 0 */
static void advise(PetscMPIInt size, char text[], size_t len)
{
  const double cores = quota > 0 && quota < on_cores ? quota : on_cores;

  if (cores > 0 && cores < on_node)
    (void)snprintf(text, len, "%d ranks share %.3g core%s. Use at most %d (mpiexec -n), or more cores", on_node, cores,
                   cores > 1 ? "s" : "", (int)PetscMax(cores, 1));
  else if (size > 1)
    (void)snprintf(text, len, "other programs run there. One rank (mpiexec -n 1) may be faster, or other cores");
  else (void)snprintf(text, len, "other programs run there, and the run takes so much longer");
}

PetscErrorCode CoresStep(Cores *c, MPI_Comm comm)
{
  double      v[3]; /* least wall clock and share, largest loss negative */
  PetscMPIInt size;
  char        advice[160];

  PetscFunctionBeginUser;
  if (++c->steps != c->next) PetscFunctionReturn(PETSC_SUCCESS);
  get_times(c, v, v + 1, v + 2);
  v[2] = -v[2];
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, v, 3, MPI_DOUBLE, MPI_MIN, comm));
  c->next = v[0] < CORE_WALL ? 2 * c->steps : -1;
  if (c->next > 0 || v[1] > CORE_FRACTION || -v[2] < CORE_WAIT) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallMPI(MPI_Comm_size(comm, &size));
  advise(size, advice, sizeof(advice));
  PetscCall(PetscPrintf(comm, "remark: %s %.2f of %s core, processor time over wall time: %s\n",
                        size > 1 ? "the slowest rank got" : "the run got", v[1], size > 1 ? "its" : "a", advice));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoresFinish(Cores *c, Monitor monitor)
{
  double wall, got, lost;

  PetscFunctionBeginUser;
  get_times(c, &wall, &got, &lost);
  PetscCall(MonitorBalance(monitor, "core_share", (PetscReal)got));
  PetscCall(MonitorBalance(monitor, "core_wait", (PetscReal)PetscMax(lost, 0)));
  PetscFunctionReturn(PETSC_SUCCESS);
}
