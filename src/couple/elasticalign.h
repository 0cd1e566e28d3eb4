/* ElasticAlign: elastic solids as owner of surfaces that the mesh is lined up with in every step (-couple_method
   aligned; aligned.h), alone or beside rigid bodies that move.

   Cells inside a solid stay in the flow for its viscosity, pressure and continuity, and have no inertia, convection or
   weight of the fluid: their density is zero (FlowSetProperties), since the solid brings its own. Old velocities of the
   nodes that move come from the flow's side alone, at the surface too: they have two values there. A solid that the
   mesh cannot follow is immersed in that step and the ten after it, and the fluid inside begins with its velocities
   (elasticlineup.c). */
#pragma once
#include "aligned.h"
#include "couple/elasticsurfaces.h"
#include "couple/couple.h"

typedef struct _p_ElasticAlign *ElasticAlign;

typedef struct {
  const PetscBool *lined;      /* [solids] does the mesh follow it in this step? */
  const PetscInt  *cell_solid; /* [ncell_all] solid that a cell is inside of, -1: fluid; for solids it follows */
  const PetscBool *left;       /* [solids] does it not, after it did in the last one? */
  PetscInt         immersed;   /* solids that it does not follow */
  const PetscReal *density;    /* [ncell_all] for FlowSetProperties, NULL: the fluid's everywhere */
} ElasticLabels;

/* The surfaces, of the same solids, are borrowed: ElasticAlignPlace sets them. beside: the driver of rigid bodies that
   move, which lines the mesh up with both; NULL: solids have their own. Collective. */
PetscErrorCode ElasticAlignCreate(Flow, MeshUpdate, const SolidsState *, ElasticSurfaces, AlignDriver beside,
                                  ElasticAlign *);
/* For who has nodal fields to carry to the new mesh, while nodes are where they were. Collective. */
typedef PetscErrorCode (*ElasticCarry)(void *ctx, Remap, const AlignResult *);
PetscErrorCode ElasticAlignSetCarry(ElasticAlign, ElasticCarry, void *ctx);
/* Nodes [nnode_all] that stay where they are, of rigid bodies (AlignHold). Before the first update. */
PetscErrorCode ElasticAlignHold(ElasticAlign, const PetscBool held[]);
PetscErrorCode ElasticAlignDestroy(ElasticAlign *);
/* The solids' nodes are predicted at x [nnode][dim], for the next update of the driver. */
PetscErrorCode ElasticAlignPlace(ElasticAlign, const PetscReal x[]);
/* The same, and the mesh follows, but where the driver of rigid bodies has had it do so with these positions; labels
   borrowed until the next. Between FlowBeginStep and FlowAssemble. Collective. */
PetscErrorCode ElasticAlignUpdate(ElasticAlign, const PetscReal x[], ElasticLabels *);
/* Those of the last update or load. */
PetscErrorCode ElasticAlignGetLabels(ElasticAlign, ElasticLabels *);
/* When the cells of the mesh are made anew: which solids it follows, and what it was (AlignDriverBeforeRemesh), taken
   before, then given to those of the new mesh, which take the old mesh over. Collective. */
typedef struct _n_ElasticAlignKept ElasticAlignKept;
PetscErrorCode                     ElasticAlignBeforeRemesh(ElasticAlign, ElasticAlignKept **);
PetscErrorCode                     ElasticAlignAfterRemesh(ElasticAlign, ElasticAlignKept **, Mesh *old);
/* A checkpoint: where solids were in the last update. Loading moves the mesh there (AlignDriverRestore). Collective. */
PetscErrorCode ElasticAlignVisitState(ElasticAlign, State);
