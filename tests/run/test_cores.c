/* Cores: who gives way, by quota, by the ranks on a node and by the cores that each may use. */
#include "core.h"
#include "cores.h"
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

static char top[64];

static void write_text(const char name[], const char text[])
{
  char  path[256];
  FILE *f;

  (void)snprintf(path, sizeof(path), "%s%s", top, name);
  f = fopen(path, "w");
  assert_non_null(f);
  (void)fputs(text, f);
  (void)fclose(f);
}

static void make_folder(const char name[])
{
  char path[256];

  (void)snprintf(path, sizeof(path), "%s%s", top, name);
  (void)mkdir(path, 0777);
}

static double read_quota(const char groups[])
{
  char path[256];

  write_text("/groups", groups);
  (void)snprintf(path, sizeof(path), "%s/groups", top);
  return CoresReadQuota(path, top);
}

static void test_quota(void **state)
{
  (void)state;
  assert_true(read_quota("0::/\n") == 0);
  make_folder("/job");
  make_folder("/job/task");
  write_text("/job/cpu.max", "150000 100000\n");
  write_text("/job/task/cpu.max", "max 100000\n");
  assert_true(read_quota("0::/job/task\n") == 1.5); /* of the group above */
  write_text("/job/task/cpu.max", "50000 100000\n");
  assert_true(read_quota("0::/job/task\n") == .5);
  write_text("/cpu.max", "25000 100000\n"); /* a container sees its own group as the root */
  assert_true(read_quota("0::/\n") == .25);
  assert_true(read_quota("0::/../elsewhere\n") == .25);
  write_text("/cpu.max", "max 100000\n");
  assert_true(read_quota("0::/\n") == 0);
  assert_true(CoresReadQuota("/nowhere/cgroup", top) == 0);
}

static void test_old_quota(void **state)
{
  (void)state;
  make_folder("/cpu");
  make_folder("/cpu/box");
  write_text("/cpu/box/cpu.cfs_quota_us", "300000\n");
  write_text("/cpu/box/cpu.cfs_period_us", "100000\n");
  write_text("/cpu/cpu.cfs_quota_us", "-1\n");
  write_text("/cpu/cpu.cfs_period_us", "100000\n");
  assert_true(read_quota("5:cpuset:/\n4:cpu,cpuacct:/box\n") == 3);
  assert_true(read_quota("4:cpuacct,cpu:/box\n") == 3);
  assert_true(read_quota("4:cpuset:/box\n") == 0);
  assert_true(read_quota("4:cpu:/\n") == 0);
}

static void test_local_size(void **state)
{
  static const char *const NAME[] = {"OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS",      "PMI_LOCAL_SIZE",
                                     "SLURM_STEP_TASKS_PER_NODE",  "SLURM_TASKS_PER_NODE", "SLURM_PROCID"};

  (void)state;
  for (int i = 0; i < 6; i++) unsetenv(NAME[i]);
  assert_int_equal(CoresReadLocalSize(), 0);
  setenv("SLURM_TASKS_PER_NODE", "4(x2),3", 1);
  assert_int_equal(CoresReadLocalSize(), 0); /* mpiexec within a job */
  setenv("SLURM_PROCID", "0", 1);
  assert_int_equal(CoresReadLocalSize(), 4);
  setenv("MPI_LOCALNRANKS", "3", 1);
  assert_int_equal(CoresReadLocalSize(), 3);
  setenv("OMPI_COMM_WORLD_LOCAL_SIZE", "2", 1);
  assert_int_equal(CoresReadLocalSize(), 2);
}

static void test_shared(void **state)
{
  (void)state;
  assert_int_equal(CoresAreShared(1, 1, (unsigned long[]){1}), 0);
  assert_int_equal(CoresAreShared(2, 1, (unsigned long[]){1, 2}), 0);        /* each its own */
  assert_int_equal(CoresAreShared(2, 1, (unsigned long[]){1, 1}), 1);        /* both bound to one */
  assert_int_equal(CoresAreShared(2, 1, (unsigned long[]){3, 3}), 0);        /* two of two */
  assert_int_equal(CoresAreShared(3, 1, (unsigned long[]){3, 3, 3}), 1);     /* three of two */
  assert_int_equal(CoresAreShared(3, 1, (unsigned long[]){3, 3, 12}), 0);    /* sockets */
  assert_int_equal(CoresAreShared(4, 1, (unsigned long[]){3, 1, 2, 12}), 1); /* two bound within a third's */
  assert_int_equal(CoresAreShared(2, 2, (unsigned long[]){0, 1, 0, 1}), 1);  /* cores beyond the first word */
  assert_int_equal(CoresAreShared(2, 1, (unsigned long[]){0, 0}), 0);        /* not known */
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_quota), cmocka_unit_test(test_old_quota),
                                     cmocka_unit_test(test_local_size), cmocka_unit_test(test_shared)};
  char                    command[128];
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  (void)snprintf(top, sizeof(top), "/tmp/tumble-cores-%d", (int)getpid());
  (void)mkdir(top, 0777);
  failed = cmocka_run_group_tests_name("cores", tests, NULL, NULL);
  (void)snprintf(command, sizeof(command), "rm -rf %s", top);
  if (system(command)) failed++;
  PetscCall(PetscFinalize());
  return failed;
}
