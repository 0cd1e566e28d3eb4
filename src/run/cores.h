/* Cores: a machine that is shared. Ranks that wait for each other spin, which is fastest where each has a core of its
   own, and up to fifty times slower where one spins on the core that the other needs: such ranks give way
   (sched_yield). Where others' programs keep the cores busy giving way is the worst that a rank can do, so ranks that
   have a core each do not. */
#pragma once
#include "report/monitor.h"

/* Before MPI_Init: ranks that outnumber the cores they may use, by affinity, a container's quota and what the launcher
   says of ranks on this node, are told to give way (OMPI_MCA_mpi_yield_when_idle, unless it is set). */
void CoresPrepare(void);

/* After MPI_Init: the same where only a look at all ranks of the node tells, such as two that are bound to one core.
   Collective on MPI_COMM_WORLD. */
void CoresPin(void);

/* What CoresPrepare goes by. Cores that the processes of a control group may use, such as 1.5, or 0 where nothing
   limits them: the least of cpu.max, cpu.cfs_quota_us over cpu.cfs_period_us in the group and those above it; file as
   /proc/self/cgroup, root as /sys/fs/cgroup. And ranks on this node by the environment, 0 if it says nothing. */
double CoresReadQuota(const char file[], const char root[]);
int    CoresReadLocalSize(void);

/* Do more ranks than cores share some? mask [n][words]: the cores that each rank may use, as bits. */
int CoresAreShared(int n, int words, const unsigned long mask[]);

/* Processor time of the steps so far against wall clock */
typedef struct {
  double   wall, processor, waited; /* at the beginning of the first step, s; waited: ready to run, and another ran */
  PetscInt steps, next;             /* next: step after which the shares are judged */
} Cores;

/* At the first step; after each step, which says in a line when ranks get less than 0.7 of their cores and what to do;
   at the end: balance.core_share of the summary, and core_wait, the share that others had of a core that a rank was
   ready to use. All collective. */
PetscErrorCode CoresBegin(Cores *);
PetscErrorCode CoresStep(Cores *, MPI_Comm);
PetscErrorCode CoresFinish(Cores *, Monitor);
