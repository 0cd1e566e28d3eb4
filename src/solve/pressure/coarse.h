/* Coarse: the level of continuous Q1 pressures on the vertices below the cells' discontinuous P1 pressures, for the
   preconditioner of S_p (pressure.h).

   Interpolation I: on every cell the linear function that fits its vertex values (transfer.h). The operator is
   I^T S_p I (Galerkin), a sum over velocity slots of inverse mass times g g^T with g what the slot sees of the vertices
   around it, or the Q1 Laplacian (laplacian.h), by -flow_pressure_coarse; either is kept up to date by what changes.
   The bodies' part is added when the solver of this level is set up. No units of its own. */
#pragma once
#include "mesh/mesh.h"
#include "../rigid/projection.h"
#include "transfer.h"
#include <petscksp.h>

typedef struct _p_Coarse *Coarse;

/* nk pressures a cell; floating: known up to a constant; keep: fraction of the vertices that may change before the
   solver of this level is set up anew (lagged.h). Collective. */
PetscErrorCode CoarseCreate(Mesh, PetscInt nk, PetscBool floating, PetscReal keep, Coarse *);
PetscErrorCode CoarseDestroy(Coarse *);

/* operator += sum over the components a of own node i of change[a] g_a g_a^T; b [ncell_all][nk][nb dim]: the cells'
   divergence. Not collective. */
PetscErrorCode CoarseAddNode(Coarse, const PetscReal *const b[], PetscInt i, const PetscReal change[]);
/* What CoarseAddNode gathered becomes part of the operator: before cells change their shape. Not collective. */
PetscErrorCode CoarseFlush(Coarse);
/* operator += scale times sum of I^T block I over n own cells; block [n][nk][nk]. Not collective. */
PetscErrorCode CoarseAddCells(Coarse, PetscReal scale, PetscInt n, const PetscInt cell[], const PetscReal block[]);
/* The n listed local cells have changed their shape or have become inactive: cell_material [ncell_all] < 0 for
   inactive ones, or NULL. Their rows of I anew; vertices among inactive cells only get the identity. Collective. */
PetscErrorCode CoarseUpdateCells(Coarse, PetscInt n, const PetscInt cell[], const PetscInt cell_material[]);
/* After additions. Collective. */
PetscErrorCode CoarseAssemble(Coarse);

/* From now on the operator is somebody else's, who adds its changes to it: CoarseFlush and CoarseAssemble leave the
   matrix alone. *kept: the operator is a Laplacian, whose changes are those of cells; else nothing happens. Taken are n
   cells with changes [n][dim] of their coefficients (laplacian.h), and entries, row and column [nentry], by the numbers
   of vertices; all are to be freed. On one rank, in space; cells do not change their shape. */
typedef struct {
  PetscInt   n, nentry, *cell, *row, *column;
  PetscReal *change, *value;
} CoarseChanges;
PetscErrorCode CoarseKeepChanges(Coarse, PetscBool *kept);
PetscErrorCode CoarseTakeChanges(Coarse, CoarseChanges *);

/* The bodies' part W W^T of S_p: n blocks w [n][nk][nr] of own cells cell [n] and bodies body [n] of the constraint
   that this rank knows. Borrowed until the next call. Not collective. */
PetscErrorCode CoarseSetBodies(Coarse, Constraint, PetscInt n, const PetscInt cell[], const PetscInt body[],
                               const PetscReal w[]);

/* W^T I of the bodies set, rows by slots, all of it, and the part that matters (thinrows.h), of which the operator has
   the product thin^T thin. Where no cell is cut, or nothing matters, NULL; the caller destroys both. After
   CoarseAssemble. Collective. */
PetscErrorCode CoarseCreateMoments(Coarse, Mat *all, Mat *thin);

/* Give interpolation and operator to a PCMG of two levels, always the same one. Its solver on this level is set up
   where too much has changed. Collective. */
PetscErrorCode CoarseSetUpPC(Coarse, PC);
/* Without a PCMG: the solver with options of that prefix, set up where too much has changed. Collective. */
PetscErrorCode CoarseSetUp(Coarse, const char prefix[]);
/* After CoarseSetUp: x [ncell][nk] += what this level makes of the residual r [ncell][nk], and on several ranks ghost
   [ncell_all - ncell][nk] of the ghost cells likewise. Collective. */
PetscErrorCode CoarseCorrect(Coarse, const PetscReal r[], PetscReal x[], PetscReal ghost[]);
/* The operator, and the transfer to the vertices. Borrowed. After CoarseAssemble. */
PetscErrorCode CoarseGetMatrix(Coarse, Mat *);
PetscErrorCode CoarseGetTransfer(Coarse, Transfer *);
PetscErrorCode CoarseView(Coarse, PetscViewer);
