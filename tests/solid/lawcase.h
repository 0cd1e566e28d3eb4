/* What all laws of solids and membranes are asked, for tests: see solid/law.h. */
#pragma once
#include "solid/law.h"

/* The tangent is the derivative of the stress at F [n], that (where kappa has taken nothing off) the one of the
   energy. */
static void check_tangent(PetscInt dim, const SolidMaterial *m, PetscInt n, const PetscReal F[])
{
  const PetscReal h = 1e-6;
  PetscReal       P[9], C[81], up[9], down[9], G[9];

  (void)SolidLawStress(dim, m, F, P, C);
  for (PetscInt f = 0; f < n; f++) {
    PetscReal energy[2];

    for (PetscInt side = 0; side < 2; side++) {
      for (PetscInt e = 0; e < n; e++) G[e] = F[e];
      G[f] += side ? h : -h;
      (void)SolidLawStress(dim, m, G, side ? up : down, NULL);
      energy[side] = SolidLawEnergy(dim, m, G);
    }
    for (PetscInt e = 0; e < n; e++) NEAR(C[e * n + f], (up[e] - down[e]) / (2 * h), 2e-8);
    if (m->kappa == 0) NEAR(P[f], (energy[1] - energy[0]) / (2 * h), 2e-8);
  }
}
