/* Bodyblocks: the small blocks of the preconditioners that belong to one body's unknown rigid velocities.

   For every body the blocks [nr][nr] R^T A R + D of the velocity operator and R^T (fraction m) R + D/scale of the
   projected lumped mass, and their inverses; R maps rigid velocities to the nodes that lie in the body or follow
   it. A node of lumped mass m that follows the body by a penalty W has with it the mass matrix [m + W, m R; R^T m,
   R^T m R]; eliminating the node leaves R^T (fraction m) R with fraction = W/(m + W); fraction = 1 inside. Unknown
   degrees of freedom only; the rest is the identity (zero in the mass). */
#pragma once
#include "projection.h"
#include "flow/flow.h"
#include "solve/penaltyterm.h"

/* fraction [nnode_all]; stiff [nbodies][nr][nr]: R^T A R of the rows of own nodes (bodycoupling.h); penalty (may be
   NULL): the penalty in the flow's matrix, of which it lacks H; D [nbodies][nr][nr] inertia; masses are divided by
   scale. Collective. stiff_inverse [own bodies][nr][nr], mass_inverse [nbodies][nr][nr] of these and of the bodies
   this rank knows (see projection.h). Error: a light body covers no node. */
PetscErrorCode BodyBlocksInvert(Flow, Constraint, const PetscReal fraction[], const PetscReal stiff[],
                                const PenaltyTerm *penalty, const PetscReal D[], PetscReal scale,
                                PetscReal stiff_inverse[], PetscReal mass_inverse[]);
