/* AlignDriver: keeps the mesh lined up with surfaces that move, of one owner or several: rigid bodies (alignbodies.h),
   elastic solids (elasticalign.h). A client of meshupdate.h.

   In every step: the mesh is aligned to the surfaces of all owners at once (align/align.h); u^n and u^{n-1} are
   evaluated where nodes will be (remap.h), from the fluid's side alone; nodes move; cells near surfaces are computed
   anew; cells inside bodies leave the fluid. A surface that the mesh cannot follow is left out in that step, and until
   it could have been followed ALIGN_PATIENCE times in a row. */
#pragma once
#include "align/align.h"
#include "base/state.h"
#include "flow/flow.h"
#include "mesh/remap.h"
#include "alignkept.h"
#include "meshupdate.h"

typedef struct _p_AlignDriver *AlignDriver;

/* What is inside of an owner's surfaces: nothing (cells leave the fluid), a material whose velocity is not carried over
   to nodes of the fluid, or fluid, as outside */
typedef enum {
  ALIGN_NOTHING,
  ALIGN_MATERIAL,
  ALIGN_FLUID
} AlignInside;

/* Between a fit and the moment that nodes move */
typedef struct {
  const AlignResult *result; /* of all owners' surfaces, in the order of the owners */
  const PetscBool   *before; /* [n] of this owner's: were they aligned then? */
  Remap              remap;
  PetscBool          first; /* the first fit of a run */
} AlignChange;

/* Owner of surfaces; belongs to who adds it. Operations may be NULL. k: his surface, table->n of them. */
typedef struct {
  const AlignSurfaces *table;
  AlignInside          inside;
  void                *ctx;
  PetscBool           *aligned; /* [n] in the last fit, for the driver to write */
  PetscInt            *waits;   /* [n] steps until the mesh may follow it again, 0: it may; likewise */
  /* wanted [n]: is the mesh to follow it? (default: yes) still [n]: it waits for nothing (default: no) */
  PetscErrorCode (*ask)(void *ctx, PetscBool wanted[], PetscBool still[]);
  /* Where the point of surface k that is now at x [dim] was in the last fit (viscoelastic fluids) */
  void (*came_from)(void *ctx, PetscInt k, const PetscReal x[], PetscReal y[]);
  /* Fields of others on nodes that move. Collective. */
  PetscErrorCode (*carry)(void *ctx, const AlignChange *);
} AlignOwner;

/* aligned and waits of n surfaces as one number each, for checkpoints and other meshes: 1, or minus the steps that it
   waits; and back. */
void AlignOwnerPack(const AlignOwner *, PetscInt n, PetscInt v[]);
void AlignOwnerUnpack(const AlignOwner *, PetscInt n, const PetscInt v[]);

/* Collective. */
PetscErrorCode AlignDriverCreate(Flow, MeshUpdate, AlignDriver *);
PetscErrorCode AlignDriverDestroy(AlignDriver *);
/* Borrowed; before the first fit. Who has nothing inside comes first. */
PetscErrorCode AlignDriverAdd(AlignDriver, AlignOwner *);
/* Nodes [nnode_all] that stay where they are (AlignHold). Before the first fit. Collective. */
PetscErrorCode AlignDriverHold(AlignDriver, const PetscBool held[]);

/* Fit to the surfaces as the tables have them, between FlowBeginStep and FlowAssemble. Collective. */
PetscErrorCode AlignDriverUpdate(AlignDriver);
/* Of the last fit. *result: of all surfaces; *count (may be NULL) of the last update. */
PetscErrorCode AlignDriverGetResult(AlignDriver, const AlignResult **result, const RemapCount **count);
/* The first surface of an owner among those of the result. */
PetscInt AlignDriverGetFirst(AlignDriver, const AlignOwner *);

/* When the cells of a mesh are made anew (mesh/carry.h): what the driver knows of the old one and the velocities there,
   taken before the flow forgets them, then given to the driver of the new mesh with the old mesh. Its next update
   takes from there what belongs where the old mesh was lined up, or where nodes will be; elsewhere the flow has
   brought its values over. What was kept, and the old mesh, are taken over; aligned and waits are the owners'.
   Collective. */
PetscErrorCode AlignDriverBeforeRemesh(AlignDriver, AlignKept **);
PetscErrorCode AlignDriverAfterRemesh(AlignDriver, AlignKept **, Mesh *old);

/* Parts of the state of owners, visited after that of the flow. Has there been a fit, under the owner's name for it?
   *known false: the checkpoint is of a run with another method, whose mesh is as at the start. */
PetscErrorCode AlignDriverVisitState(AlignDriver, State, const char name[], PetscBool *known);
PetscBool      AlignDriverIsDone(AlignDriver);
/* Loading, once for each owner, whose surfaces and aligned are as in the last fit: the last of them lines the mesh up
   as it was; fields that were loaded before belong to that mesh. The flow's solver must then be made anew
   (MeshUpdateSetSolver). Collective. */
PetscErrorCode AlignDriverRestore(AlignDriver);
