/* Options of the room scalar: see base/opt.h. <scalar_bc_boundary> is heat_bc_left, of heat and left. */
#include "base/opt.h"

#define NAMED "-scalars"

static const OptSpec SPECS[] = {
  {"-scalars", OPT_STRINGS, "", OPT_ANY, "", .help = "names of the scalars that the flow carries, such as heat",
   .when = "-flow_active true", .also = "temperature, concentration, species, tracer", .find = "heat, temperature"},
  {"-scalars_rtol", OPT_REAL, "", OPT_FROM(0), "1e-3",
   .help = "solve until the residual is so much of that of the start value, which is extrapolated (at least 1e-10, at "
           "most 1e-7 of the size of the terms)",
   .when = NAMED, .also = "tolerance"},
  {"-scalar_<scalar>_conductivity", OPT_REAL, "energy/(length time scalar)", OPT_FROM(0), "0.01",
   .help = "conductivity of the fluid (of a concentration: its diffusivity)", .when = NAMED, .also = "lambda, k"},
  {"-scalar_<scalar>_diffusivity", OPT_REAL, "length^2/time", OPT_FROM(0), "",
   .help = "conductivity over capacity, in place of the conductivity", .when = NAMED, .also = "alpha, diffusion"},
  {"-scalar_<scalar>_capacity", OPT_REAL, "energy/(length^dim scalar)", OPT_ABOVE_ZERO, "1",
   .help = "heat capacity of the fluid by volume (of a concentration: 1)", .when = NAMED,
   .also = "heat_capacity, specific_heat, cp"},
  {"-scalar_<scalar>_initial", OPT_REALS, "scalar", OPT_ANY, "the reference", .help = "value at the start",
   .when = NAMED, .variables = "x, y, z"},
  {"-scalar_<scalar>_initial_run", OPT_STRING, "", OPT_ANY, "",
   .help =
     "output folder of another run in the same domain (its last fields), or one of its fields_<step>.h5: values at "
     "the start",
   .when = NAMED, .path = OPT_PATH},
  {"-scalar_<scalar>_source", OPT_REALS, "energy/(length^dim time)", OPT_ANY, "0",
   .help = "source in the fluid; a reaction by the scalars' names: \"-2*heat*oxygen\"", .when = NAMED,
   .variables = "x, y, z, t, scalars", .also = "reaction, rate", .find = "reaction, chemistry"},
  {"-scalar_<scalar>_decay", OPT_REAL, "1/time", OPT_FROM(0), "0",
   .help = "rate of a first-order reaction that uses it up", .when = NAMED, .also = "reaction"},
  {"-scalar_<scalar>_reaction", OPT_REALS, "1/time", OPT_ANY, "0",
   .help = "reactions of first order: rates at which it grows for each unit of every scalar, in the order of -scalars "
           "(below zero: it is used up)",
   .when = NAMED, .also = "rate, reactions, kinetics", .find = "reaction, chemistry"},
  {"-scalar_<scalar>_stabilise", OPT_CHOICE, "", OPT_ANY, "auto",
   .help =
     "against new extrema where convection dominates a cell (cell Peclet number above 1) and the scalar is not smooth",
   .choices = "auto, none", .when = NAMED, .also = "limiter, upwind, supg, stabilisation, stabilization",
   .find = "oscillation, overshoot, limiter, upwind"},
  {"-scalar_<scalar>_gradient", OPT_REALS, "scalar/length", OPT_ANY, "0",
   .help = "mean gradient on a periodic mesh; the field is what differs from it", .when = NAMED},
  {"-scalar_<scalar>_expansion", OPT_REAL, "1/scalar", OPT_ANY, "0",
   .help = "buoyancy: the fluid is lighter by this part of its density for each unit above the reference",
   .when = NAMED, .also = "beta, thermal_expansion", .find = "boussinesq, buoyancy"},
  {"-scalar_<scalar>_reference", OPT_REAL, "scalar", OPT_ANY, "0", .help = "value at which the fluid has its density",
   .when = NAMED},
  {"-scalar_<scalar>_reference_difference", OPT_REAL, "scalar", OPT_ABOVE_ZERO, "",
   .help = "difference that Nusselt (Sherwood) numbers of boundaries and bodies go by; asks for them", .when = NAMED,
   .find = "nusselt, sherwood"},
  {"-scalar_<scalar>_reference_length", OPT_REAL, "length", OPT_ABOVE_ZERO, "1", .help = "length that they go by",
   .when = "-scalar_<scalar>_reference_difference"},
  {"-scalar_<scalar_bc_boundary>_value", OPT_REALS, "scalar", OPT_ANY, "", .help = "value at the boundary",
   .when = NAMED, .variables = "x, y, z, t"},
  {"-scalar_<scalar_bc_boundary>_flux", OPT_REALS, "energy/(length^(dim-1) time)", OPT_ANY, "0",
   .help = "flux into the domain; a surface reaction by the scalars' names: \"-2*oxygen\"", .when = NAMED,
   .variables = "x, y, z, t, scalars"},
  {"-scalar_<scalar_bc_boundary>_transfer", OPT_REAL, "energy/(length^(dim-1) time scalar)", OPT_FROM(0), "",
   .help = "transfer coefficient h: flux h (ambient - value) into the domain", .when = NAMED},
  {"-scalar_<scalar_bc_boundary>_ambient", OPT_REALS, "scalar", OPT_ANY, "the reference",
   .help = "value of what is outside", .when = "-scalar_<scalar_bc_boundary>_transfer", .variables = "x, y, z, t"},
};

OPT_TABLE("scalar: what the flow carries", SPECS)
