/* Options of the room phase: see base/opt.h. */
#include "base/opt.h"

#define FLUID "-particle_<group>_material fluid"

static const OptSpec SPECS[] = {
  {"-particle_<group>_viscosity", OPT_REAL, "mass/(length time)", OPT_ABOVE_ZERO, "that of the fluid around",
   .help = "viscosity of a drop or bubble", .when = FLUID, .also = "mu, drop_viscosity"},
  {"-particle_<group>_surface_tension", OPT_REAL, "force/length", OPT_FROM(0), "",
   .help = "surface tension of a drop or bubble", .when = FLUID, .also = "sigma, tension, gamma",
   .find = "drop, bubble, interface, two-phase, capillary"},
};
OPT_TABLE("phase: drops and bubbles", SPECS)
