/* ScalarPhases: particles that are no rigid bodies, drops or elastic solids, as materials of cells: by group and scalar
   a conductivity, a capacity by volume, a source and a decay of their own (-particle_<group>_<scalar>_*, conjugate
   alone), and a value at the start. Where the mesh ends at their surface materials jump exactly there; cells that a
   surface cuts have a mean, as their parts lie, in series where the particle conducts better (ScalarMaterial). What
   moves of nodes and parts makes of the heat is in the books (scalarbooks.h). */
#pragma once
#include "couple/couple.h"
#include "scalar/scalar.h"

typedef struct _p_ScalarPhases *ScalarPhases;

typedef struct {
  const char *name;    /* of the group, borrowed */
  PetscReal   density; /* 0: its weight does not go by scalars */
} ScalarPhase;

/* Reads the options of all. Collective. Errors: conditions that only rigid bodies have. */
PetscErrorCode ScalarPhasesCreate(Couple, Scalars, PetscInt n, const ScalarPhase phase[], ScalarPhases *);
PetscErrorCode ScalarPhasesDestroy(ScalarPhases *);
/* Cells are others. Not collective. */
PetscErrorCode ScalarPhasesDiscard(ScalarPhases);
/* cell [ncell_all] whose phase it is, -1: the fluid's; part [ncell_all] of it that is (NULL: all); V [nnode_all][dim]
   velocity of the nodes, borrowed until the next (NULL: that of the flow's mesh). Local. */
PetscErrorCode ScalarPhasesSetCells(ScalarPhases, const PetscInt cell[], const PetscReal part[], const PetscReal V[]);
/* Velocity of the nodes; NULL: they stand still. Borrowed. */
PetscErrorCode ScalarPhasesGetVelocity(ScalarPhases, const PetscReal *V[]);
/* The scalars begin with the values of the phases inside. Collective. */
PetscErrorCode ScalarPhasesStart(ScalarPhases);
/* Tells the scalars their cells. Local. */
PetscErrorCode ScalarPhasesUpdate(ScalarPhases);
/* Weight of each local cell by scalar i, as part of the fluid's [ncell_all]; NULL: of all the fluid's. Borrowed until
   the next. Local. */
const PetscReal *ScalarPhasesWeight(ScalarPhases, PetscInt i);
/* As CouplePhasesAreAlike */
PetscBool ScalarPhasesAreAlike(ScalarPhases, PetscInt a, PetscInt b);
/* As of scalarbooks.h. Collective. */
PetscErrorCode ScalarPhasesGiveBack(ScalarPhases, PetscInt i);
PetscErrorCode ScalarPhasesCorrect(ScalarPhases, PetscInt i, PetscBool *again);
PetscErrorCode ScalarPhasesMeasure(ScalarPhases, PetscReal covered[]);
PetscErrorCode ScalarPhasesAccept(ScalarPhases);
PetscErrorCode ScalarPhasesVisit(ScalarPhases, State);

/* ---- for those who have such particles (scalars.c); without -scalars nothing happens ---- */

/* Once, before the first step; n 0: nodes move, and what is in there is the fluid. Collective. Errors: of
   ScalarPhasesCreate; there are rigid bodies too. */
PetscErrorCode CoupleAddPhases(Couple, PetscInt n, const ScalarPhase phase[]);
/* Have phases a and b the same numbers for all scalars, but for what they start with? Not collective. */
PetscBool CouplePhasesAreAlike(Couple, PetscInt a, PetscInt b);
/* In every step, when the mesh is that of the step, as ScalarPhasesSetCells. Local. */
PetscErrorCode CoupleSetPhases(Couple, const PetscInt cell[], const PetscReal part[], const PetscReal V[]);
/* Cells as last told are those that the scalars begin with, if they have not begun; without this, it is those of the
   first step. For solids, which pass cells that stand still. Collective. */
PetscErrorCode CoupleStartPhases(Couple);
PetscBool      CouplePhasesHaveBegun(Couple);
/* The scalars, whose fields go along with the nodes (scalarfields.h); NULL: there are none */
Scalars CoupleCarriedScalars(Couple);
