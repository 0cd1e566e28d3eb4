/* Options of the room couple: see base/opt.h. */
#include "base/opt.h"

#define BODIES  "-particle_groups and -flow_active true"
#define PENALTY "-couple_method penalty or aligned"

static const OptSpec SPECS[] = {
  {"-couple_type", OPT_CHOICE, "", OPT_ANY, "implicit",
   .help = "bodies and flow in one system, or bodies with the force of the step before", .when = BODIES,
   .choices = "implicit, explicit", .also = "coupling, scheme",
   .words = "weak explicit, strong implicit, loose explicit, monolithic implicit"},
  {"-couple_method", OPT_CHOICE, "", OPT_ANY, "by -preset: penalty", .old = "-couple_boundary",
   .help =
     "boundary method: nodes inside a body, a penalty by the volume fraction of cut cells, or nodes moved onto the surface",
   .when = BODIES, .choices = "nodal, penalty, aligned", .old_words = "snap aligned", .also = "boundary_method, ibm",
   .words = "fitted aligned, alignment aligned, ibm penalty, fbm nodal, immersed penalty, fictitious nodal",
   .find  = "fictitious boundary, immersed boundary"},
  {"-couple_drops", OPT_CHOICE, "", OPT_ANY, "aligned",
   .help =
     "drops in the plane: the mesh is lined up with their interface, or it stays and the interface is smeared over three cells: less "
     "accurate, and nothing that cannot be lined up stops it",
   .when = "-particle_<group>_material fluid", .choices = "aligned, regularised", .also = "drop_method",
   .words = "csf regularised, regularized regularised, unaligned regularised, smeared regularised, snap aligned",
   .find  = "continuum surface force, level set, volume of fluid, bubble"},
  {"-couple_drops_steps", OPT_REAL, "", OPT_FROM(0), "by -preset: 60, 120, 300",
   .help =
     "drops in the plane: the fewest steps in a period of their slowest oscillation at the start, and 28 (viscosity inside and outside) "
     "radius/tension; 0: no such limit, as without a preset",
   .when = "-particle_<group>_material fluid", .also = "drop_steps",
   .find = "capillary time, time step of a drop, bubble"},
  {"-couple_anchored", OPT_BOOL, "", OPT_ANY, "true where all elastic particles are held (-particle_<group>_clamp)",
   .help =
     "elastic particles: the mesh is lined up with them once and follows their material, or it is lined up in every step",
   .when = "-couple_method aligned and elastic particles"},
  {"-couple_force", OPT_CHOICE, "", OPT_ANY, "residual", .help = "form of the hydrodynamic force", .when = BODIES,
   .choices = "residual, volume"},
  {"-couple_backflow", OPT_CHOICE, "", OPT_ANY, "none",
   .help =
     "what balances the weight of bodies along periodic axes: nothing, zero net flux of fluid and bodies, or zero mean force on both",
   .when = BODIES, .choices = "none, flux, force"},
  {"-couple_penalty_viscous", OPT_REAL, "", OPT_FROM(0), "200",
   .help = "viscous part of the penalty, in multiples of viscosity/h^2", .when = PENALTY, .expert = PETSC_TRUE},
  {"-couple_penalty_inertial", OPT_REAL, "", OPT_FROM(0), "12",
   .help = "inertial part of the penalty, in multiples of fluid density/time step", .when = PENALTY,
   .expert = PETSC_TRUE},
  {"-couple_penalty_samples", OPT_INT, "", 2, 20, "10, for bodies that stand still 20",
   .help = "sub-cells an axis in cells that a body cuts", .when = PENALTY, .expert = PETSC_TRUE},
  {"-flow_viscosity_of_scalars", OPT_REALS, "mass/(length time)", OPT_ANY, "-flow_viscosity",
   .help =
     "viscosity of the fluid by what it carries, such as \"0.01*exp(-heat)\", one number a cell; -flow_viscosity stays what others go by",
   .when = "-scalars", .variables = "x, y, z, t, scalars", .also = "temperature_dependent_viscosity, arrhenius"},
  {"-particle_<group_scalar>_condition", OPT_CHOICE, "", OPT_ANY, "conjugate",
   .help    = "what a body of the group is for the scalar (particle: {disc: {heat: {condition: value}}})",
   .choices = "conjugate, value, flux, transfer, lumped", .when = "-scalars", .find = "heat, temperature, conjugate"},
  {"-particle_<group_scalar>_value", OPT_REAL, "scalar", OPT_ANY, "", .help = "value of the body",
   .when = "-particle_<group_scalar>_condition value or transfer"},
  {"-particle_<group_scalar>_flux", OPT_REALS, "energy/(length^(dim-1) time)", OPT_ANY, "0",
   .help = "flux from its surface into the fluid; by place in the frame of the shape, and by the "
           "scalars' names there (a surface reaction)",
   .when = "-particle_<group_scalar>_condition flux", .variables = "x, y, z, t, scalars", .find = "janus, catalyst"},
  {"-particle_<group_scalar>_transfer", OPT_REAL, "energy/(length^(dim-1) time scalar)", OPT_FROM(0), "0",
   .help = "transfer coefficient h: flux h (value of the body - value there) into the fluid",
   .when = "-particle_<group_scalar>_condition transfer"},
  {"-particle_<group_scalar>_conductivity", OPT_REAL, "energy/(length time scalar)", OPT_FROM(0), "the fluid's",
   .help = "conductivity of the body", .when = "-particle_<group_scalar>_condition conjugate"},
  {"-particle_<group_scalar>_capacity", OPT_REAL, "energy/(length^dim scalar)", OPT_ABOVE_ZERO, "the fluid's",
   .help = "its heat capacity by volume", .when = "-particle_<group_scalar>_condition conjugate or lumped"},
  {"-particle_<group_scalar>_source", OPT_REAL, "energy/(length^dim time)", OPT_ANY, "0", .help = "source in the body",
   .when = "-particle_<group_scalar>_condition conjugate or lumped"},
  {"-particle_<group_scalar>_decay", OPT_REAL, "1/time", OPT_FROM(0), "0",
   .help = "rate of a first-order reaction in the body that uses it up",
   .when = "-particle_<group_scalar>_condition conjugate", .also = "reaction, rate",
   .find = "reaction, catalyst, thiele"},
  {"-particle_<group_scalar>_expansion", OPT_REAL, "1/scalar", OPT_ANY, "0",
   .help = "the body weighs less by this part of its density for each unit above the reference; mass and size stay",
   .when = "-particle_<group_scalar>_condition conjugate, value or lumped", .also = "beta, thermal_expansion"},
  {"-particle_<group_scalar>_dissolves", OPT_REAL, "length^dim/amount", OPT_ANY, "0",
   .help =
     "volume by which the body shrinks for each amount (energy) of the scalar that its surface lets into the fluid: "
     "1/(content - value) for a content by volume; melting by heat that it takes: -1/(latent heat by volume). Below "
     "the size of a cell it is removed",
   .when = "-particle_<group_scalar>_condition value, flux or transfer", .also = "melts, shrinks, grows, stefan",
   .find = "dissolve, dissolution, melting, growth"},
  {"-particle_<group_scalar>_reference", OPT_REAL, "scalar", OPT_ANY, "the scalar's",
   .help = "value at which it weighs what its density says", .when = "-particle_<group_scalar>_expansion"},
  {"-particle_<group_scalar>_initial", OPT_REAL, "scalar", OPT_ANY, "the scalar's", .help = "its value at the start",
   .when = "-particle_<group_scalar>_condition conjugate or lumped"},
};
OPT_TABLE("couple: bodies in the flow", SPECS)
