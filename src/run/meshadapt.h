/* Meshadapt: cells halved where the steady solution is wrong (-sim_steady with -mesh_adapt).

   Solve, estimate (FlowEstimate), halve the cells with the largest errors, go on from the solution there. Of the sum of
   the squares those cells are taken that together make -mesh_adapt_fraction (Doerfler, SIAM J. Numer. Anal. 33, 1996).
   Surfaces of bodies are cut by cells of one size: where a cell near one is wrong, all of them get a level more, with
   the clearance of -mesh_levels. The first mesh has at least eight cells along the smallest body, or all levels. Ends
   when the error is below -mesh_adapt_tolerance, or where the next mesh would have more than -mesh_adapt_unknowns. */
#pragma once
#include "refine.h"
#include "steady.h"

typedef struct _p_MeshAdapt *MeshAdapt;

/* Reads the other options; *adapt is NULL without -mesh_adapt. Adds columns to series.csv. Collective. Errors: no
   -sim_steady, no -mesh_levels, no target. */
PetscErrorCode MeshAdaptCreate(Refine, PetscBool steady, Flow, Couple, Bodies, Contact, Monitor, MeshAdapt *adapt);
PetscErrorCode MeshAdaptDestroy(MeshAdapt *);
PetscErrorCode MeshAdaptView(MeshAdapt, PetscViewer);
/* Of the accepted solution: eta [own cells], borrowed until the next mesh; prints the round. NULL: nothing, eta NULL.
   Collective. */
PetscErrorCode MeshAdaptEstimate(MeshAdapt, PetscInt unknowns, const PetscReal *eta[]);
/* After it: the next mesh, with all that stands on it; *more: there is one. Collective. */
PetscErrorCode MeshAdaptRefine(MeshAdapt, Steady, PetscBool *more);
