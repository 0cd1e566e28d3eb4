/* AlignDriver: keeps the mesh lined up with moving bodies, for the boundary method aligned. A client of
   meshupdate.h.

   In every step: the mesh is aligned to the bodies (align/align.h); u^n and u^{n-1} are evaluated where nodes will be
   (remap.h); nodes move; cells near bodies are computed anew; cells inside leave the fluid. */
#pragma once
#include "bodies/bodies.h"
#include "flow/flow.h"
#include "mesh/remap.h"
#include "meshupdate.h"
#include "align/align.h"
#include "base/state.h"

typedef struct _p_AlignDriver *AlignDriver;

/* Error: in space, a body thinner than a cell. Collective. */
PetscErrorCode AlignDriverCreate(Flow, Bodies, MeshUpdate, AlignDriver *);
PetscErrorCode AlignDriverDestroy(AlignDriver *);

/* Fit to the bodies drawn at X, q (AlignFit), between FlowBeginStep and FlowAssemble. aligned [nbodies], *result and
   *count are borrowed. Collective. */
PetscErrorCode AlignDriverUpdate(AlignDriver, PetscReal (*X)[3], PetscReal (*q)[4], const PetscBool *aligned[],
                                 const AlignResult **result, const RemapCount **count);

/* Vertices are to lie on these points x [n][2], borrowed, of surfaces of bodies (BodySurfacesSetPoints). */
PetscErrorCode AlignDriverSetPoints(AlignDriver, PetscInt n, const PetscReal x[]);
/* Others with fields on nodes that move: called in every update but the first, before nodes move, with the new fit, and
   how bodies have moved since the last one: displacement [nbodies][3], rotation [nbodies][9] from axes now to axes
   then, times the size then over that now; before: were they aligned then? Collective. Borrowed. */
typedef struct _n_AlignMotion {
  const AlignResult *result;
  const PetscReal (*displacement)[3], (*rotation)[9];
  const PetscBool *before;
  Remap            remap;
} AlignMotion;
typedef PetscErrorCode (*AlignCarry)(void *ctx, const AlignMotion *);
PetscErrorCode AlignDriverSetCarry(AlignDriver, AlignCarry, void *ctx);

/* When the cells of a mesh are made anew (mesh/carry.h): what the driver knows of the old one and the velocities there,
   taken before the flow forgets them, then given to the driver of the new mesh with the old mesh. Its next update
   takes from there what belongs where the old mesh was lined up, or where nodes will be; elsewhere the flow has
   brought its values over. What was kept, and the old mesh, are taken over. Collective. */
typedef struct _n_AlignDriverKept AlignDriverKept;
PetscErrorCode                    AlignDriverBeforeRemesh(AlignDriver, AlignDriverKept **);
PetscErrorCode                    AlignDriverAfterRemesh(AlignDriver, AlignDriverKept **, Mesh *old);

/* Part of the state of the coupling, visited after that of the flow. Loading lines the mesh up as it was; fields
   that were loaded before belong to that mesh. The flow's solver must then be made anew (MeshUpdateSetSolver).
   Collective. */
PetscErrorCode AlignDriverVisitState(AlignDriver, State);
