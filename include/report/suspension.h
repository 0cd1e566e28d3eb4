/* Suspension: statistics of many bodies, with -output_suspension. Called by run.

   Columns of series.csv: bodies_velocity_<x|y|z>, mean velocity by volume of the bodies that are free to travel; less
   mean_velocity_<x|y|z>, that of fluid and bodies together, it is the speed of settling.
   Tables, at every snapshot and after the last step (columns in runs/reference/OUTPUT.md):
     pairs_<step>.csv    pair distribution of the centres up to five mean diameters: pairs found over those of as many
                         independent points in the box, walls being accounted for (set covariance of the box);
     profile_<step>.csv  volume fraction and mean velocity of the bodies in slabs across an axis;
     contacts_<step>.csv network of contacts: pairs, and bodies at walls, with a gap below the range of the contact law.
   Options: -output_suspension, _axis (of the slabs; the last one), _bins. */
#pragma once
#include "contact/contact.h"
#include "report/monitor.h"

/* The columns of the tables, which end with name NULL. */
extern const MonitorColumn SUSPENSION_PAIRS[], SUSPENSION_PROFILE[], SUSPENSION_CONTACTS[];

typedef struct _p_Suspension *Suspension;

/* The box of the domain and its periods (0: none), [3]. Adds the columns: after DiagnosticsCreate, before MonitorOpen.
   Nothing is owned. NULL without -output_suspension. Collective, as all others. Error: no bodies. */
PetscErrorCode SuspensionCreate(Bodies, Contact, Monitor, const PetscReal lower[], const PetscReal upper[],
                                const PetscReal period[], Suspension *);
/* Frees it and sets it to NULL. */
PetscErrorCode SuspensionDestroy(Suspension *);
/* Sets the columns; before MonitorWrite. Does nothing with NULL. */
PetscErrorCode SuspensionStep(Suspension);
/* Write the tables of a step into dir, once a step. Does nothing with NULL. Error: the disk. */
PetscErrorCode SuspensionWrite(Suspension, const char dir[], PetscInt step);
