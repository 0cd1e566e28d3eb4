/* Ale: takes the mesh along with bodies that move (deform.h), in arbitrary Lagrangian-Eulerian form. A client of
   meshupdate.h.

   In every step, bodies drawn at their predicted places: from the places x^n the mesh is deformed to x^{n+1}, in as
   many parts as the bodies go smallest cells; the velocity of its nodes c_t x^{n+1} - d(x), as the time scheme
   differentiates, goes into the convection (FlowSetMeshVelocity). u^n and u^{n-1} stay with their nodes: nothing is
   interpolated, no node is looked up. Everything of the step is solved on the mesh x^{n+1}; topology, numbering and
   pattern are those of any other mesh. The result depends on x^n, x^{n-1} (which a checkpoint holds) and the bodies
   alone, however often a step is begun. Bodies that rest: the mesh rests too.

   Costs: one or two linear systems of the size of the cells, and all operators anew (runs/studies/deformation). Not
   here: method aligned, schemes other than be and bdf2. */
#pragma once
#include "bodies/bodies.h"
#include "mesh/deform.h"
#include "flow/flow.h"
#include "meshupdate.h"

typedef struct _p_Ale *Ale;

/* All but the result are borrowed. Collective. */
PetscErrorCode AleCreate(MeshUpdate, Flow, Bodies, Deform, Ale *);
PetscErrorCode AleDestroy(Ale *);

/* Between FlowBeginStep and FlowAssemble: bodies are drawn at X, q; X NULL: where they were drawn last. Collective.
   Errors: those of DeformUpdate and FlowSetMeshVelocity. */
PetscErrorCode AleUpdate(Ale, PetscReal (*X)[3], PetscReal (*q)[4]);
/* The step is accepted. Collective. */
PetscErrorCode AleAccept(Ale);
/* Borrowed. */
PetscErrorCode AleGetResult(Ale, const DeformResult **);
