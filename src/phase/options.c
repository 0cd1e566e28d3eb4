/* Options of the room phase: see base/opt.h. */
#include "base/opt.h"

#define FLUID "-particle_<group>_material fluid"

static const OptSpec SPECS[] = {
  {"-particle_<group>_viscosity", OPT_REAL, "mass/(length time)", OPT_ABOVE_ZERO, "that of the fluid around",
   .help = "viscosity of a drop or bubble, or of what a membrane encloses", .when = FLUID " or membrane",
   .also = "mu, drop_viscosity, inner_viscosity, viscosity_ratio"},
  {"-particle_<group>_surface_tension", OPT_REAL, "force/length", OPT_FROM(0), "",
   .help = "surface tension of a drop or bubble", .when = FLUID, .also = "sigma, tension, gamma",
   .find = "drop, bubble, interface, two-phase, capillary"},
  {"-particle_<group>_contact_angle", OPT_REAL, "rad", PETSC_PI / 12, 11 * PETSC_PI / 12, "",
   .help = "angle inside the drop between its interface and what it wets: of a drop, walls of type slip; of a rigid "
           "particle, its surface (not given: a film of the fluid around stays between)",
   .also = "wetting_angle, young_angle, theta", .find = "wetting, contact line, drop on a wall"},
  {"-particle_<group>_coalescence", OPT_CHOICE, "", OPT_ANY, "film",
   .help = "what drops that meet do: merge when the film between them breaks, or never; then a cell of the fluid around "
           "stays between them",
   .choices = "film, never", .when = FLUID, .also = "merge, merging",
   .find = "drops that do not merge, surfactant, emulsion"},
  {"-particle_<group>_film", OPT_REAL, "length", OPT_FROM(0), "0",
   .help = "thickness at which the film between drops breaks, at most two cells (0: about a cell)", .when = FLUID,
   .also = "film_thickness", .find = "coalescence, merging drops"},
  {"-particle_<group>_drainage", OPT_REAL, "time", OPT_FROM(0), "0",
   .help = "how long drops are nearer than a cell, or a thicker film, before they merge", .when = FLUID,
   .also = "drainage_time", .find = "coalescence, merging drops"},
  {"-particle_<group>_region", OPT_REALS, "", OPT_ANY, "",
   .help = "where the fluid is at the start: an expression that is negative there, in place of a shape", .when = FLUID,
   .variables = "x, y, z", .also = "level_set, initial_region",
   .find = "layer, free surface, pool, wave, sloshing, dam break"},
};
OPT_TABLE("phase: drops and bubbles", SPECS)
