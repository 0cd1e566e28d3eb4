/* Coarser: the options of the same scene on a coarser mesh, in longer steps or lined up with the bodies, until they are
   put back; for accuracy.h. */
#pragma once
#include <petscsys.h>

#define COARSER_MAX 12 /* options that are changed at once */

/* Options as they were */
typedef struct {
  PetscInt n;
  struct {
    char      name[64], was[256];
    PetscBool given;
  } option[COARSER_MAX];
} Coarser;

/* Cells about `factor` times as large as the options say now (-mesh_cells, -mesh_focus_h, -mesh_resolution; twice as
   large by -dm_refine); *ratio: how much larger, 0: there is no such mesh, and nothing was changed. Collective. */
PetscErrorCode CoarserMesh(Coarser *, PetscReal factor, PetscReal *ratio);
/* The mesh lined up with the bodies (-couple_method aligned). Collective. */
PetscErrorCode CoarserLineUp(Coarser *);
/* A run in time until `end`, gauged from `from` on, with steps `longer` times as long on cells `larger` times as
   large: -sim_dt, and what -sim_adapt goes by, errors of a step by the power order + 1 of its length. Collective. */
PetscErrorCode CoarserSteps(Coarser *, PetscReal longer, PetscReal larger, PetscInt order, PetscReal from,
                            PetscReal end);
/* Options as they were before, but for the first n changes. Collective. */
PetscErrorCode CoarserPutBack(Coarser *, PetscInt n);
