/* Conformation: the polymer stress of viscoelastic fluids on the mesh.

   psi, the logarithm of the conformation (polymer.h), is a continuous Q2 field like the velocity: one set of 2 dim
   numbers a node, so that halos, hanging nodes, snapped and remeshed cells carry it as they carry a velocity. Its rate
   at a node is -P(w . grad psi) - P'(tau (w . grad psi - P(w . grad psi)), w . grad v) + rate at a point with L =
   P(grad u), where P is the projection with the lumped mass (project.h, also for L at surfaces) and the second term the
   orthogonal subscale stabilisation (Codina 2002; tau = 1/(4 |w|) in units of the node distance), consistent to the
   order of the element; at a surface that rests nothing is convected. It is advanced explicitly by the third-order
   Runge-Kutta method of Shu & Osher in as many substeps as its rates want: no matrix, no solve.

   One step is a predictor and a corrector around the linear solve for the flow:
     psi*      from psi^n with u^n all through the step, when the step's matrix is asked for
     u^{n+1}   from the momentum with solvent grad u^{n+1} + tau(psi*) + (grad u^{n+1} - grad u^n) E
     psi^{n+1} from psi^n with the velocity linear in time from u^n to u^{n+1}, when the step is accepted
   E stands for what the stress gains by a change of the velocity in the step (-flow_rheology_implicit): none; rest:
   G dt (at most G L), a number, and the matrix of a Stokes flow stays; stretched: G dt f c, a tensor a cell, with
   the c of its node where that is largest: that is how stiff stretched polymers are along their stretch (the other
   half of the derivative, c grad u^T, has no divergence where c is uniform). auto: stretched where rest would leave
   more than half of the viscosity to explicit stretch. All are of second order in time. By modes, with any solvent,
   none and no inertia included, E >= G dt is stable for any step; without E, or with half of it, it is not
   (runs/studies/rheology). -flow_rheology_devss adds a share of the polymer's viscosity times grad u^{n+1} - P(grad
   u^n): the difference of the gradient and its projection stays in steady states, too (Liu et al. 1998), at first
   order in time.

   At an inflow nothing changes along streamlines: psi there is that of the developed flow with the prescribed profile.
   At an outflow the condition is that of the Newtonian part, -p n + mu du/dn = 0: the test functions of its nodes take
   -(div tau, v) in place of (tau, grad v). */
#pragma once
#include "polymer.h"

typedef struct _p_Flow         *Flow;
typedef struct _p_Conformation *Conformation;

/* At rest. Collective. */
PetscErrorCode ConformationCreate(Flow, const Polymer *, Conformation *);
PetscErrorCode ConformationDestroy(Conformation *);
/* A step of length dt begins: is E a tensor in it, and else what number is it? Collective. */
PetscErrorCode ConformationBegin(Conformation, PetscReal dt);
/* Fields, cells or frame changed: what was predicted is void. Local. */
void ConformationForget(Conformation);
/* Predict the stress of the step, and E, unless they are current. Collective. Error: it cannot be advanced. */
PetscErrorCode ConformationPredict(Conformation);
/* The step's velocity is u. Collective. Errors as above. */
PetscErrorCode ConformationAccept(Conformation, const PetscReal u[]);
/* What E is at rest, a number; its tensors [ncell_all][dim*dim], which contain it, or NULL if it is that number. */
PetscReal        ConformationImplicit(Conformation);
PetscReal        ConformationDevss(Conformation); /* the part of it that -flow_rheology_devss adds */
const PetscReal *ConformationTensors(Conformation);
/* psi^n [nnode_all][2 dim], synced; writable */
PetscReal *ConformationField(Conformation);
/* [nnode_all][2 dim], synced; writable; 0 once a step is accepted: psi^n at a node of a surface that moves in this
   step, less psi^n at the point of the surface that comes there. That point keeps its own: the shift goes back in the
   step. */
PetscReal *ConformationShift(Conformation);
/* psi*, what T was made of */
const PetscReal *ConformationPredicted(Conformation);
/* Of the step: tau(psi*) and P(grad u^n), [nnode_all][dim*dim] */
const PetscReal *ConformationStress(Conformation);
const PetscReal *ConformationGradient(Conformation);
/* Nodes of an outflow [nnode_all] */
const PetscBool *ConformationOpen(Conformation);
