/* ScalarBodies: what bodies are for scalars, told to the room scalar as materials of cells and values of nodes.

   A group is, for each scalar (-particle_<group>_<scalar>_condition):
     conjugate  of a conductivity and capacity of its own, solved for with the fluid
     value      at a given value
     flux       its surface lets a given flux into the fluid, nothing is solved for inside
     lumped     of one value, an unknown of the system (scalarlumps.h)
     transfer   its surface lets h (value - T) into the fluid
   How a surface is seen: aligned: cells end at it, materials jump exactly, sides of cells have the flux. Otherwise
   cells that it cuts conduct as their parts lie, or in series where the body conducts better than the fluid
   (conjugate); the part inside is held by a penalty, under nodal nodes inside have the value (value); sums over
   sub-cells outside, with the surface as a layer one sub-cell thick (flux, transfer: the finite cell method, Parvizian,
   Duester & Rank 2007).
   Bodies that dissolve or grow by what goes through their surface: scalargrowth.h.
   Bodies that move: the inside is convected with the flow there, which moves rigidly, or goes along with the nodes of
   the mesh (scalarcarry.h); scalarheat.h keeps the books.
   Refused: motion under aligned with a moving frame or cells that are rebuilt; conditions of bodies that are holes of
   the mesh, whose boundaries have theirs. */
#pragma once
#include "bodies/bodies.h"
#include "scalar/scalar.h"
#include "couple/couple.h"

typedef struct _p_ScalarBodies *ScalarBodies;

/* Reads the options of all groups. NULL without bodies. Collective. */
PetscErrorCode ScalarBodiesCreate(Couple, Scalars, ScalarBodies *);
PetscErrorCode ScalarBodiesDestroy(Couple, ScalarBodies *);
/* A step begins that extrapolates by so much, bodies have not moved yet: their weight. Collective. */
PetscErrorCode ScalarBodiesBegin(ScalarBodies, Couple, Scalars, PetscReal extrapolation);
/* Bodies are where the step has them: tells the scalars cells and nodes. Collective. */
PetscErrorCode ScalarBodiesUpdate(ScalarBodies, Couple, Scalars);
/* The scalars begin with the values of the bodies inside. Collective. */
PetscErrorCode ScalarBodiesStart(ScalarBodies, Couple, Scalars);
/* Part of each local cell that is fluid [ncell_all]; NULL: all. Borrowed. */
const PetscReal *ScalarBodiesFluid(ScalarBodies);
/* Cells and nodes are others: forget what goes by them. Not collective. */
PetscErrorCode ScalarBodiesDiscard(ScalarBodies);
/* Before scalar i is solved for, after ScalarsPredict: bodies that move give back the heat that their motion would
   make. Collective. */
PetscErrorCode ScalarBodiesGiveBack(ScalarBodies, Couple, Scalars, PetscInt i);
/* After the scalars are solved for: covered [n of scalars] heat a time that appears as bodies cover and free cells,
   with what is given back of it (scalarheat.h). Collective. */
PetscErrorCode ScalarBodiesMeasure(ScalarBodies, Couple, Scalars, PetscReal covered[]);
/* Does group g let scalar i into the fluid through a surface that the program knows the flux of? All but those that are
   solved for inside. */
PetscBool ScalarBodiesLetsOut(ScalarBodies, Couple, PetscInt i, PetscInt g);
/* ScalarsMeasure of scalar i, in order from 0 on, after ScalarBodiesMeasure, and what the bodies of each group let into
   the fluid, group [ngroups]. Collective. */
PetscErrorCode ScalarBodiesBalance(ScalarBodies, Couple, Scalars, PetscInt i, ScalarBalance *, PetscReal boundary[],
                                   PetscReal group[]);
/* *dt becomes no larger than bodies that change their size stand. Collective. */
PetscErrorCode ScalarBodiesLimit(ScalarBodies, Couple, PetscReal *dt);
/* w [nnode_all][dim] less the velocity of nodes that go along with bodies (scalarcarry.h). Local. */
PetscErrorCode ScalarBodiesConvect(ScalarBodies, PetscReal w[]);
/* The step is taken; before ScalarsAccept. Collective. */
PetscErrorCode ScalarBodiesAccept(ScalarBodies, Couple, Scalars);
PetscErrorCode ScalarBodiesVisit(ScalarBodies, Couple, Scalars, State);
/* open [ngroups]: is a group another material than the fluid for scalar i, or does it start with a value of its own? */
void ScalarBodiesGetOpen(ScalarBodies, Couple, const ScalarParameters *, PetscInt i, PetscBool open[]);
