/* Eddy: eddy viscosity of large-eddy simulation (-flow_rheology smagorinsky, wale).

   The stress of the eddies that the mesh does not carry is mu_t (grad u + grad u^T), with mu_t = rho l^2 rate and, for
   G = grad u, S its symmetric part:

     smagorinsky  l = C D W, rate = sqrt(2 S:S) (Smagorinsky, Mon. Weather Rev. 91, 1963), D = 1 - exp(-y+/25) near
                  walls (van Driest, J. Aeronaut. Sci. 23, 1956); C = 0.1 in channels (Deardorff 1970)
     wale         l = C W, rate = (Sd:Sd)^(3/2)/((S:S)^(5/2) + (Sd:Sd)^(5/4)), Sd the symmetric part of G G without
                  its trace (Nicoud & Ducros, Flow Turbul. Combust. 62, 1999): none in pure shear, ~ y^3 at a wall, and
                  it knows no walls; C = 0.5

   Filter width W = -flow_les_filter times the cube root of the volume of the cell (in the plane the square root of its
   area); 1/2 by default, the distance of the nodes of the Q2 element: the sides over the polynomial order, as is usual
   with elements of higher order. C is -flow_les_constant.

   Wall distance y: to walls of the mesh (walls.h) and to bodies, the latter within EDDY_REACH cell sizes, beyond which
   their D is 1. y+ = y u_tau/nu with u_tau = -flow_les_friction, or, without it, with that of the law of the wall that
   goes through the velocity at the point, relative to the wall (Spalding, J. Appl. Mech. 28, 1961): in the viscous
   sublayer that is the local wall gradient, further out it needs no look at the wall.

   Time: mu_t by the velocity w extrapolated to the step, the stress as mu_t (2 grad u + grad w^T - grad w): components
   stay uncoupled, one scalar operator serves all of them, as for a Newtonian fluid. The part of w is the rotation, so
   that bdf2 is stable for any mu_t; with grad u + grad w^T it is not from mu_t dt lambda = 2 on, lambda the largest
   eigenvalue of the Laplacian (runs/studies/turbulence). The molecular stress keeps its gradient form. */
#pragma once
#include <petscsys.h>

#define EDDY_REACH 5

struct _p_Flow;
struct _p_Walls;

typedef struct {
  const char *name; /* NULL: no large-eddy simulation */
  PetscBool   wale, damped;
  PetscReal   constant, filter, friction;
} Eddy;

/* Read the options of the law `name`, one of the two above. Collective. */
PetscErrorCode EddyCreate(const char name[], Eddy *);
PetscErrorCode EddyView(const Eddy *, PetscViewer);

/* rate [1/time] of the velocity gradient g [a][b] = du_a/dx_b, zeros beyond the dimension. Local. */
PetscReal EddyRate(const Eddy *, PetscReal g[3][3]);
/* y+ at the distance y of a wall relative to which the fluid moves at this speed, by Spalding's law of the wall; 500
   stands for all beyond. Local. */
PetscReal EddyWallUnits(PetscReal speed, PetscReal y, PetscReal nu);
/* van Driest's D. Local. */
PetscReal EddyDamping(PetscReal y_plus);

/* The material FLOW_EDDIES (material.h) of a flow. Local. */
PetscErrorCode EddiesCreate(struct _p_Flow *, const Eddy *);
/* NULL: not needed yet */
struct _p_Walls *FlowGetWalls(struct _p_Flow *);
