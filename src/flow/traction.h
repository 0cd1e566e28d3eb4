/* Traction: what acts on openings of type pressure: -P n, where P is a pressure outside and n the normal outwards.

   Natural condition of the momentum: mu du/dn - p n = -P n (with -flow_rheology sigma n = -P n), so that the term
   int P n.v over the opening joins the residual. Three-point Gauss quadrature an axis on the bent faces: exact for a P
   linear in space where faces are of second order in the plane, straight ones in space. As body forces P is
   theta times that at the end of the step + (1 - theta) times that at its beginning. */
#pragma once
#include <petscsys.h>

typedef struct _p_Traction *Traction;

/* NULL if no boundary is of this type. Collective. */
PetscErrorCode TractionCreate(struct _p_Flow *, Traction *);
PetscErrorCode TractionDestroy(Traction *);
/* Of the step, for the positions of the nodes as they are. Collective. */
PetscErrorCode TractionEvaluate(Traction);
/* Add it times `scale` in the slots of own cell c: r [nb][dim]. Not collective. */
void TractionAddCell(Traction, PetscInt c, PetscReal scale, PetscReal r[]);
/* Add the whole of own cells: force [dim]. Local. */
void TractionSum(Traction, PetscReal force[]);
/* Add it at the nodes of own cells: r [nnode_all][dim]. Local. */
void TractionAdd(Traction, PetscReal r[]);
