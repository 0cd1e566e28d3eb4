/* Books: where the energy of fluid and bodies goes (-monitor_energy; by default with -contact_law spring in a flow).

   Columns of series.csv, sums since the end of the first step: energy = what it was + energy_supplied + contact_work -
   energy_dissipated - energy_boundary - energy_scheme. All are found from the terms of the equations tested with the
   velocity of the step (CoupleGetLosses), so that the sum tells how well these are solved. energy_scheme is what the
   error of the time step takes: the power of the inertia less the growth of the energy; bodies that are stopped within
   a step lose that of the fluid which is tied to them, and what a mesh that moves carries over counts here, too. In
   domains with an outflow it holds what flows out. What supplies energy is taken with the velocity of the end of the
   step: with cn and fstheta the books lack what that is beyond the mean, where it changes (an inflow that grows). */
#pragma once
#include "sim.h"

typedef struct _p_Books *Books;

/* Reads the options; adds the columns. NULL: not wanted. Collective. Errors: no constant viscosity, explicit coupling.
   */
PetscErrorCode BooksCreate(const SimComponents *, Books *);
PetscErrorCode BooksDestroy(Books *);
/* After CoupleMomentum, before CoupleAdvance; after ContactCountWork. Collective; NULL: nothing. */
PetscErrorCode BooksStep(Books, const FlowDiagnostics *, const CouplePower *, PetscReal dt);
PetscErrorCode BooksClose(Books);
/* At the end of a run, before MonitorEnd: energy_error, what the books lack of the energy that was lost; a remark where
   the boundary method took much of it from bodies that met. Not collective, the same on all ranks. */
PetscErrorCode BooksFinish(Books);
/* Sets the columns */
PetscErrorCode BooksReport(Books);
PetscErrorCode BooksVisitState(void *books, State);
