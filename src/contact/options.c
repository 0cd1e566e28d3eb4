/* Options of the room contact: see base/opt.h. */
#include "base/opt.h"

#define REPULSIVE   "-contact_law repulsive"
#define SPRING      "-contact_law spring"
#define LUBRICATION "-contact_lubrication true"
#define BODIES      "-particle_groups"

static const OptSpec SPECS[] = {
  {"-contact_law", OPT_CHOICE, "", OPT_ANY, "repulsive", .help = "law of the contact force",
   .choices = "repulsive, spring, none", .also = "model, type, force_model",
   .words =
     "dem spring, hertz spring, linear spring, spring_dashpot spring, hookean spring, off none, false none, soft repulsive, glowinski repulsive, repulsion repulsive",
   .find = "collision, dem, friction, lubrication"},
  {"-contact_range", OPT_REAL, "length", OPT_ABOVE_ZERO, "half a cell",
   .help = "gap below which bodies repel each other", .also = "cutoff, distance, gap"},
  {"-contact_substeps", OPT_INT, "", 0, PETSC_MAX_INT / 2, "0",
   .help = "sub-steps of the contact in a time step, 0: from the stiffness"},
  {"-contact_coupling", OPT_CHOICE, "", OPT_ANY, "implicit",
   .help =
     "forces of contact: solved with the flow, or found in sub-steps before it (with -couple_type explicit always)",
   .choices = "implicit, explicit", .when = REPULSIVE},
  {"-contact_remove_overlap", OPT_BOOL, "", OPT_ANY, "true", .old = "-contact_separate",
   .help = "move bodies apart that overlap after a step of the flow", .when = BODIES, .expert = PETSC_TRUE},
  {"-contact_stiffness", OPT_REAL, "", OPT_ABOVE_ZERO, "1",
   .help = "multiple of the default stiffness, which stops a body that arrives at terminal speed", .when = REPULSIVE},
  {"-contact_damping", OPT_REAL, "", OPT_FROM(0), "0.1",
   .help = "speed of approach that doubles the force, in the speed scale; 0: no damping", .when = REPULSIVE,
   .also = "dashpot, gamma"},
  {"-contact_eps", OPT_REAL, "length^3/force", OPT_ABOVE_ZERO, "",
   .help =
     "stiffness parameter within the range: force = centre distance (range - gap)^2/eps; replaces the default stiffness",
   .when = REPULSIVE, .expert = PETSC_TRUE},
  {"-contact_eps_overlap", OPT_REAL, "length^2/force", OPT_ABOVE_ZERO, "eps/(2 range): no kink",
   .help = "stiffness parameter of the overlap: slope = centre distance/eps", .when = REPULSIVE, .expert = PETSC_TRUE},
  {"-contact_wall_factor", OPT_REAL, "", OPT_ABOVE_ZERO, "1", .help = "stiffness against walls in that between bodies",
   .when = REPULSIVE, .expert = PETSC_TRUE},
  {"-contact_spring_stiffness", OPT_REAL, "force/length", OPT_ABOVE_ZERO,
   "stops a body at terminal speed within half the range", .help = "stiffness of the normal spring", .when = SPRING,
   .also = "k, kn, k_n, spring"},
  {"-contact_restitution", OPT_REAL, "", 0, 1, "0.5", .help = "speed after a dry collision in that before",
   .when = SPRING, .also = "e, cor, restitution_coefficient, coefficient_of_restitution"},
  {"-contact_friction", OPT_REAL, "", OPT_FROM(0), "0", .help = "coefficient of Coulomb friction", .when = SPRING,
   .also = "mu, friction_coefficient"},
  {"-contact_tangential", OPT_REAL, "", OPT_POSITIVE, 1, "2/7",
   .help = "stiffness of the tangential spring in that of the normal one", .when = SPRING, .expert = PETSC_TRUE},
  {"-contact_lubrication", OPT_BOOL, "", OPT_ANY, "false",
   .help = "add the resistance of films that are thinner than the mesh resolves",
   .when = "-contact_law repulsive or spring"},
  {"-contact_lubrication_range", OPT_REAL, "length", OPT_ABOVE_ZERO, "one cell",
   .help =
     "gap from which on the mesh resolves the film (in 3D it resolves part of thinner ones; method penalty resolves all from twice that gap)",
   .when = LUBRICATION},
  {"-contact_roughness", OPT_REAL, "length", OPT_ABOVE_ZERO, "1/50 of -contact_lubrication_range, its upper bound",
   .help = "gap below which the resistance of the film grows no more", .when = LUBRICATION},
};
OPT_TABLE("contact: laws, lubrication", SPECS)
