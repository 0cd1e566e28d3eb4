/* History: numbers sampled over time, and what is read from such a signal: extrema, period, values between the
   samples. No physics.

   Samples are kept in memory (8 bytes each). Between samples a signal is a parabola (extrema), a straight line
   (crossings) or a cubic (values), so that times and extrema are more accurate than the step by two to four orders.
   Nothing here is collective: every rank holds the same numbers. */
#pragma once
#include <petscsys.h>

typedef struct _p_History *History;

PetscErrorCode HistoryCreate(PetscInt ncolumns, History *);
PetscErrorCode HistoryDestroy(History *);
/* Samples of all columns, value [ncolumns], at a time later than the last one, or in place of the last one at the same
   time (steady problems solved again on finer meshes). Values that are not finite are kept,
   and ignored below. */
PetscErrorCode HistoryAdd(History, PetscReal time, const PetscReal value[]);

/* Time of the last sample, or -PETSC_MAX_REAL. */
PetscErrorCode HistoryGetEnd(History, PetscReal *time);
/* Largest (sign 1) or smallest (sign -1) value of a column at times from .. until, and its time: vertex of the
   parabola through the extreme sample and its neighbours; the sample itself where it is the first or the last of all,
   or on a flank at the end of the range. *found is false if there is no sample. */
PetscErrorCode HistoryGetExtremum(History, PetscInt column, PetscInt sign, PetscReal from, PetscReal until,
                                  PetscReal *time, PetscReal *value, PetscBool *found);
/* Mean period from time `from` on: distance between the first and the last upward crossing of the middle between the
   extrema, over the number of periods *n between them (0: fewer than two crossings, *period is 0). Crossings by
   linear interpolation; a signal with several crossings a period (noise) is not recognised. */
PetscErrorCode HistoryGetPeriod(History, PetscInt column, PetscReal from, PetscReal *period, PetscInt *n);
/* Value of a column at a time inside the sampled range, by the cubic through the four nearest samples (fewer at the
   ends). *found is false outside. */
PetscErrorCode HistoryGetValue(History, PetscInt column, PetscReal time, PetscReal *value, PetscBool *found);
