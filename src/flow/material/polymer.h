/* Polymer: constitutive laws of viscoelastic fluids at a point, in terms of the logarithm psi of the conformation c
   (Fattal & Kupferman 2004), so that c = exp(psi) is positive whatever psi is:

     oldroyd_b   tau = G (c - 1),     c' = -(c - 1)/L,                       G = viscosity (1 - solvent fraction)/L
     giesekus    tau = G (c - 1),     c' = -(1 + a (c - 1)) (c - 1)/L
     fene_p      tau = G (f c - 1),   c' = -(f c - 1)/L,                     f = (b - 3)/(b - tr c)

   with c' the upper convected derivative, L the relaxation time, a the mobility, b the extensibility (square of the
   largest extension, that at rest being 3). psi has 2 dim numbers: xx yy xy zz in the plane, where zz is not zero with
   fene_p alone, and xx yy zz xy xz yz in space. Velocity gradients are L[a][b] = du_a/dx_b. Nothing is collective but
   creation. */
#pragma once
#include <petscviewer.h>

typedef struct {
  const char *name;
  PetscReal   viscosity, solvent; /* of polymer and of solvent: their sum is -flow_viscosity */
  PetscReal   time;               /* L */
  PetscReal   mobility;           /* a, 0: not Giesekus */
  PetscReal   extensibility;      /* b, 0: not FENE-P */
  PetscInt    implicit;           /* POLYMER_AUTO ...: see conformation.h */
  PetscReal   devss;              /* likewise */
} Polymer;

#define POLYMER_MAX_NC 6

/* In the order of the values of -flow_rheology_implicit */
enum {
  POLYMER_AUTO,
  POLYMER_NONE,
  POLYMER_REST,
  POLYMER_STRETCHED
};

/* Read the options of the law `name`, time: what -flow_rheology_time says. Collective. Errors: an option without which
   the law means nothing is missing. */
PetscErrorCode PolymerCreate(const char name[], PetscReal viscosity, PetscReal time, Polymer *);
PetscErrorCode PolymerView(const Polymer *, PetscViewer);

/* Rate of psi of a particle that is deformed by L: stretch, rotation and relaxation. *speed: an upper bound of the
   rates at which psi changes and relaxes, for the choice of a time step; < 0: c is beyond what the law knows. */
void PolymerRate(const Polymer *, PetscInt dim, const PetscReal psi[], PetscReal L[3][3], PetscReal rate[],
                 PetscReal *speed); /* Extra stress tau [3][3] */
void PolymerStress(const Polymer *, PetscInt dim, const PetscReal psi[], PetscReal tau[3][3]);
/* f c [3][3], which times the modulus is the stiffness of the polymer against a change of the velocity gradient */
void PolymerStiffness(const Polymer *, PetscInt dim, const PetscReal psi[], PetscReal c[3][3]);
/* c itself, [3][3] */
void PolymerConformation(PetscInt dim, const PetscReal psi[], PetscReal c[3][3]);
/* Free energy per volume, 0 at rest; trace (three axes) and smallest eigenvalue of c. May be NULL. */
void PolymerState(const Polymer *, PetscInt dim, const PetscReal psi[], PetscReal *energy, PetscReal *trace,
                  PetscReal *c_min);
