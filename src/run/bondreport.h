/* BondReport: what bonds do, in files and columns (contact/bonds.h). bonds.csv: a line for each bond that has formed or
   broken. aggregates.csv: a line for each step in which one has; bodies that bonds hold together are an aggregate.
   series.csv: bonds, bonds_broken, bond_energy. Snapshots: bonds as lines (report/bondfields.h), bodies with the
   aggregate they belong to. Rank 0 writes tables; every rank has the list of all bonds then. */
#pragma once
#include "base/state.h"
#include "sim.h"

typedef struct _p_BondReport *BondReport;

/* NULL without bonds. Before MonitorOpen. Collective, as all others. */
PetscErrorCode BondReportCreate(const SimComponents *, BondReport *);
PetscErrorCode BondReportDestroy(BondReport *);
/* After a step, at this time */
PetscErrorCode BondReportStep(BondReport, PetscReal time);
/* A snapshot of the bonds, and the bodies' (OutlinesWrite); does nothing without bonds */
PetscErrorCode BondReportSnapshot(BondReport, const char dir[], PetscInt step, PetscReal time);
/* As OutlinesRewind and OutlinesVisitState, of the bonds' snapshots */
PetscErrorCode BondReportRewind(BondReport, const char dir[]);
PetscErrorCode BondReportVisitState(void *report, State);
