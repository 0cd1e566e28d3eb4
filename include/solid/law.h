/* SolidLaw: hyperelastic laws at a point.

   With the deformation gradient F, J = det F and E = (F^T F - 1)/2 the energy per reference volume is
     neo_hookean           mu/2 (F : F - dim - 2 ln J) + lambda/2 (J - 1)^2
     st_venant_kirchhoff   mu E : E + lambda/2 (tr E)^2
   mu is the shear modulus, lambda = 2 mu nu/(1 - 2 nu) Lame's first one; in the plane strain is plane. Poisson's number
   1/2 is an incompressible solid: lambda is 0 here, and what holds the volume is the pressure of others; `bulk` adds
   bulk/4 (J^2 - 1 - 2 ln J) for what that does not see (Vadala-Roth, Acharya, Patankar, Rossi & Griffith 2020), bulk/2
   (J - 1)^2 near 1 and without a bound at 0, so that points are not pressed flat. Where others carry the isotropic part
   of a compressible solid, p = -kappa (J - 1), `kappa` is taken off: P - kappa (J - 1) J F^-T. Stresses in the unit of
   mu.

   Of membranes F [dim][dim - 1] is the gradient along the surface, C = F^T F, I1 = tr C - 2, I2 = det C - 1 (in the
   plane the surface is not stretched across: I1 = I2 = C - 1), and the energy per reference area
     neo_hookean           mu/2 (I1 - 1 + 1/(I2 + 1)) + area/4 I2^2
     skalak                mu/4 (I1^2 + 2 I1 - 2 I2) + area/4 I2^2
     zero_thickness        mu/2 (I1 - L + L^2/2) + area/4 I2^2, L = log(I2 + 1)
   mu is the surface shear modulus: of an incompressible sheet, and of zero_thickness, a third of the surface Young
   modulus. `area` is C mu of Skalak, Tozeren, Zarda & Chien 1973 as Barthes-Biesel, Diaz & Dhenin 2002 write it.
   Nothing is collective. */
#pragma once
#include <petscsys.h>

typedef enum {
  SOLID_NEO_HOOKEAN,
  SOLID_ST_VENANT_KIRCHHOFF,
  SOLID_MEMBRANE_NEO_HOOKEAN, /* membranes from here on, in the order of -particle_<group>_membrane_law */
  SOLID_MEMBRANE_SKALAK,
  SOLID_MEMBRANE_ZERO_THICKNESS
} SolidLaw;

typedef struct {
  SolidLaw  law;
  PetscReal mu, lambda;
  PetscReal bulk;    /* of what holds the volume at a point, 0: nothing does */
  PetscReal kappa;   /* of the isotropic part that others carry, 0: none */
  PetscReal area;    /* of a membrane: what resists a change of area */
  PetscReal bending; /* likewise, force times length: see solid/element.h */
  PetscReal global;  /* likewise, of the area as a whole: see solid/element.h */
  PetscReal tension; /* likewise, what that has it pull with, the same everywhere */
} SolidMaterial;

/* First Piola stress P [dim][dim] (P_iA by space i, reference A) at F [dim][dim], and its derivative by F, C
   [dim][dim][dim][dim] (C_iAjB; NULL: not wanted); of membranes with dim - 1 reference directions. Returns J, which has
   to be positive for neo_hookean and with bulk, of membranes that of the area. */
PetscReal SolidLawStress(PetscInt dim, const SolidMaterial *, const PetscReal F[], PetscReal P[], PetscReal C[]);
/* Energy per reference volume, of the whole law: with what kappa has taken off. */
PetscReal SolidLawEnergy(PetscInt dim, const SolidMaterial *, const PetscReal F[]);
