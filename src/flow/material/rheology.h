/* Rheology: viscosity of generalised Newtonian fluids as a function of the rate of strain (-flow_rheology).

   With g = sqrt(2 D:D), D the symmetric gradient of the velocity, mu_0 = -flow_viscosity, L = -flow_rheology_time,
   n = -flow_rheology_index, mu_i = -flow_rheology_viscosity_infinity, t_0 = -flow_rheology_yield and
   m = -flow_rheology_papanastasiou, all of them positive:

     power_law         mu_0 (L g)^(n-1), that is K g^(n-1) with the consistency K = mu_0 L^(n-1)
     carreau           mu_i + (mu_0 - mu_i) (1 + (L g)^a)^((n-1)/a), a = -flow_rheology_yasuda (Yasuda 1979; a = 2:
                       Carreau 1972)
     cross             mu_i + (mu_0 - mu_i)/(1 + (L g)^(1-n)) (Cross 1965)
     bingham           mu_0 + t_0 (1 - exp(-m g))/g
     herschel_bulkley  mu_0 (L g)^(n-1) + t_0 (1 - exp(-m g))/g

   A yield stress is regularised after Papanastasiou (J. Rheol. 31, 1987): below it the fluid creeps with the viscosity
   m t_0, which is -flow_rheology_max_viscosity_ratio times mu_0 unless m itself is given.
   A power has no value at g = 0: sqrt(g^2 + e^2) takes the place of g there, with e such that the viscosity at rest is
   the largest (n < 1) or the smallest (n > 1) of -flow_rheology_viscosity_bounds; at large g it is cut at the other
   limit. Limits are multiples of mu_0. Viscoelastic fluids are the subject of polymer.h, large-eddy simulation that of
   eddy.h. */
#pragma once
#include "eddy.h"
#include "polymer.h"

typedef struct _p_Rheology *Rheology;

/* Read the options for a fluid of reference viscosity mu_0. *rheology is NULL for a Newtonian or a viscoelastic fluid;
   the latter has a polymer with a name, large-eddy simulation an eddy. Collective.
   Errors: a yield stress or a viscosity at infinity that does not fit, see the messages. */
PetscErrorCode RheologyCreate(PetscReal viscosity, Rheology *, Polymer *, Eddy *);
/* A yield stress is regularised as with -flow_rheology_max_viscosity_ratio `rigid`, a power below 1 as with that as the
   largest of -flow_rheology_viscosity_bounds, if it is less than what the options say; *less: it is. Others: FALSE.
   Local. */
PetscErrorCode RheologySetRegularisation(Rheology, PetscReal rigid, PetscBool *less);
/* NULL: no */
PetscBool      RheologyHasYield(Rheology);
PetscErrorCode RheologyDestroy(Rheology *);
PetscErrorCode RheologyView(Rheology, PetscViewer);

/* Viscosity mu at the rate of strain g >= 0, and slope = (dmu/dg)/g, which is finite for g > 0 (NULL: not wanted). At
   g = 0 the slope is that of a rate so small that slope g^2 vanishes. Local. */
void RheologyEvaluate(Rheology, PetscReal g, PetscReal *mu, PetscReal *slope);
