/* Snapshots: what an index over time (XDMF) lists, in the order of steps. */
#pragma once
#include "base/state.h"

#define SNAPSHOT_COUNTS 3

typedef struct {
  PetscInt  step, count[SNAPSHOT_COUNTS]; /* count: of what its file holds, in an order of its owner */
  PetscReal time;
} Snapshot;

typedef struct {
  PetscInt  n, capacity, counts; /* counts: how many its owner uses */
  Snapshot *snapshot;            /* [n], the owner frees it */
} Snapshots;

/* Those of this step and later ones go. Local. */
void           SnapshotsCut(Snapshots *, PetscInt step);
PetscErrorCode SnapshotsAdd(Snapshots *, const Snapshot *); /* local */
/* Collective on the communicator of the state. */
PetscErrorCode SnapshotsVisitState(Snapshots *, State);
/* Is the index of that kind in dir? If not, the list is emptied: its snapshots are elsewhere. Collective. */
PetscErrorCode SnapshotsFindIndex(Snapshots *, MPI_Comm, const char dir[], const char kind[], PetscBool *there);
