/* ScalarCarry: scalars on a mesh that is lined up with bodies which move (alignbodies.h), arbitrary
   Lagrangian-Eulerian.

   Inside bodies nodes are points of the body, around them they go along, less with the distance, to a standstill three
   cells away: node x of the end of the step was at y = x - f d(x) at its beginning, d the displacement of the body, f 1
   at its surface. The values of the step before are taken there on the mesh as it was, of its own side of the surface:
   no node changes sides, the kink of a scalar stays on the surface. The mesh moves at

     V = c_t x - d(x) = d0 P1 + d1 P2,   P1, P2: from where the node was one and two steps before to where it is,

   against which the scalar is convected; inside and on the surface at the rigid velocity itself. P1 and P2 are fields
   of nodes that are carried as scalars are, since the nodes of every step are others.

   What appears in the fluid beyond that of bodies (scalarheat.h) is given back to the cells that go along
   (scalarbooks.h). */
#pragma once
#include "couple/couple.h"
#include "scalar/scalar.h"
#include "scalargrowth.h"

typedef struct _p_ScalarCarry *ScalarCarry;

/* From now on the method tells it what moves. Collective. */
PetscErrorCode ScalarCarryCreate(Couple, Scalars, ScalarCarry *);
PetscErrorCode ScalarCarryDestroy(ScalarCarry *);
/* The mesh is lined up with bodies for the first time: the scalars begin with their options' values, nodes where the
   bodies began. shift [nnode_all][dim]: that of ScalarShiftInside, or NULL. Collective. */
PetscErrorCode ScalarCarryStart(ScalarCarry, const PetscReal shift[]);
/* w [nnode_all][dim] less the velocity of the mesh. Local. */
PetscErrorCode ScalarCarryConvect(ScalarCarry, const ScalarGrowth *, PetscReal w[]);
/* After ScalarsPredict of scalar i: adds to source [ncell_all] what is given back; bodies: what appears in them.
   Collective. */
PetscErrorCode ScalarCarryGiveBack(ScalarCarry, PetscInt i, PetscReal bodies, PetscReal source[]);
/* After it is solved for: covered += what appears, with what was given back. Collective. */
PetscErrorCode ScalarCarryMeasure(ScalarCarry, PetscInt i, PetscReal bodies, PetscReal *covered);
/* The step is taken. Local. */
PetscErrorCode ScalarCarryAccept(ScalarCarry);
PetscErrorCode ScalarCarryVisit(ScalarCarry, State);
