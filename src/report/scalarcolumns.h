/* ScalarColumns: what a run says of its scalars in series.csv, and at the end in summary.json. */
#pragma once
#include "couple/scalars.h"

/* Columns of all scalars in order: add is called with their names. */
PetscErrorCode ScalarColumnsAdd(Couple, Mesh, PetscErrorCode (*add)(void *ctx, const char name[]), void *ctx);
/* Their values in the step, in the same order. */
PetscErrorCode ScalarColumnsGet(Couple, Mesh, PetscReal value[]);
