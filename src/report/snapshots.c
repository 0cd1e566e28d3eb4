/* Snapshots: see snapshots.h. */
#include "compat.h"
#include "snapshots.h"
#include "base/array.h"
#include "files.h"

void SnapshotsCut(Snapshots *s, PetscInt step)
{
  while (s->n && s->snapshot[s->n - 1].step >= step) s->n--;
}

PetscErrorCode SnapshotsAdd(Snapshots *s, const Snapshot *snapshot)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(s->n + 1, &s->capacity, &s->snapshot, sizeof(*s->snapshot), NULL));
  s->snapshot[s->n++] = *snapshot;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapshotsVisitState(Snapshots *s, State state)
{
  const PetscInt width = 1 + s->counts;
  PetscInt       n     = s->n, *number;
  PetscReal     *time;

  PetscFunctionBeginUser;
  if (StateIsLoading(state)) {
    PetscCall(StateGetSize(state, "snapshot_time", &n));
    n = PetscMax(n, 0);
    PetscCall(ArrayReserve(n, &s->capacity, &s->snapshot, sizeof(*s->snapshot), NULL));
    s->n = n;
  }
  if (!n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc2(width * n, &number, n, &time));
  for (PetscInt i = 0; i < n && !StateIsLoading(state); i++) {
    number[width * i] = s->snapshot[i].step;
    PetscCall(PetscArraycpy(number + width * i + 1, s->snapshot[i].count, s->counts));
    time[i] = s->snapshot[i].time;
  }
  PetscCall(StateInts(state, "snapshot", width * n, number));
  PetscCall(StateReals(state, "snapshot_time", n, time));
  for (PetscInt i = 0; i < n && StateIsLoading(state); i++) {
    s->snapshot[i] = (Snapshot){.step = number[width * i], .time = time[i]};
    PetscCall(PetscArraycpy(s->snapshot[i].count, number + width * i + 1, s->counts));
  }
  PetscCall(PetscFree2(number, time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapshotsFindIndex(Snapshots *s, MPI_Comm comm, const char dir[], const char kind[], PetscBool *there)
{
  PetscMPIInt rank;
  int         found = 0;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  if (!rank) found = XdmfExists(dir, kind);
  PetscCallMPI(MPI_Bcast(&found, 1, MPI_INT, 0, comm));
  if (!found) s->n = 0;
  *there = (PetscBool)(found != 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}
