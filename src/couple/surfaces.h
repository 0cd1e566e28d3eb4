/* Surfaces: distance and velocity of the nearest body for laws of the flow that want them (FlowSurfaces of flow.h, for
   -flow_rheology smagorinsky), bodies where the flow sees them in this step and with the velocities known then: of free
   bodies those extrapolated to its end. Only bodies within reach are looked at closely, by the distance of their shape;
   the velocity is that of the rigid motion continued to the point. */
#pragma once
#include "couple/couple.h"

typedef struct _p_Surfaces *Surfaces;

/* NULL, where the flow does not ask for them or there are no bodies. Tells the flow. Collective. */
PetscErrorCode SurfacesCreate(Couple, Surfaces *);
PetscErrorCode SurfacesDestroy(Surfaces *);
/* Bodies are elsewhere. Not collective. */
PetscErrorCode SurfacesForget(Surfaces);
