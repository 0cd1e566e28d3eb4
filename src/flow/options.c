/* Options of the room flow: see base/opt.h. */
#include "base/opt.h"

#define FLOW      "-flow_active true"
#define RUNS_IN   "-flow_bc_<boundary>_type inflow or moving_wall"
#define ROTATES   "-flow_bc_<boundary>_type rotating_wall"
#define ANY_LAW   "-flow_rheology power_law, carreau, cross or herschel_bulkley"
#define POWER     "-flow_rheology power_law or herschel_bulkley"
#define BOUNDED   "-flow_rheology carreau or cross"
#define ELASTIC   "-flow_rheology oldroyd_b, giesekus or fene_p"
#define YIELDS    "-flow_rheology bingham or herschel_bulkley"
#define EDDIES    "-flow_rheology smagorinsky or wale"
#define HAS_SPEED "-flow_bc_<boundary>_type inflow, moving_wall, rotating_wall or pressure"

static const OptSpec SPECS[] = {
  {"-flow_density", OPT_REAL, "mass/length^dim", OPT_ABOVE_ZERO, "1 or, without a flow, 0",
   .help = "density of the fluid (without a flow: for buoyancy and added mass)", .also = "rho"},
  {"-flow_viscosity", OPT_REAL, "mass/(length time)", OPT_ABOVE_ZERO, "0.01",
   .help = "dynamic viscosity of the fluid; with -flow_rheology that of the law", .when = FLOW,
   .also = "nu, mu, eta, visc, dynamic_viscosity, kinematic_viscosity, re, reynolds, reynolds_number"},
  {"-flow_rheology", OPT_CHOICE, "", OPT_ANY, "newton",
   .help =
     "material law: viscosity as a function of the shear rate g, polymer stress, or subgrid eddies of a turbulent flow",
   .when = FLOW,
   .choices =
     "newton, power_law, carreau, cross, bingham, herschel_bulkley, oldroyd_b, giesekus, fene_p, smagorinsky, wale",
   .also = "model, law, fluid_model",
   .words =
     "newtonian newton, powerlaw power_law, power power_law, bird_carreau carreau, carreau_yasuda carreau, herschel herschel_bulkley, herschelbulkley herschel_bulkley, oldroyd oldroyd_b, oldroydb oldroyd_b, oldroyd-b oldroyd_b, fene fene_p, les smagorinsky",
   .find = "non_newtonian, turbulence, les, viscoelastic, yield stress"},
  {"-flow_rheology_index", OPT_REAL, "", 0.1, 4, "",
   .help = "exponent n of the stress g^n: shear-thinning below 1, shear-thickening above (cross: below 1)",
   .when = ANY_LAW},
  {"-flow_rheology_time", OPT_REAL, "time", OPT_ABOVE_ZERO, "1",
   .help =
     "time L of the law: a power law has the consistency viscosity L^(n-1), carreau and cross leave -flow_viscosity where g L is 1; "
     "relaxation time of a polymer",
   .when = ANY_LAW ", or a polymer: oldroyd_b, giesekus, fene_p"},
  {"-flow_rheology_solvent", OPT_REAL, "", 0, 1, "",
   .help = "fraction of -flow_viscosity that is the solvent's; the rest is the polymer's", .when = ELASTIC},
  {"-flow_rheology_mobility", OPT_REAL, "", 0, 1, "", .help = "mobility a: relaxation is faster by 1 + a (c - 1)",
   .when = "-flow_rheology giesekus"},
  {"-flow_rheology_extensibility", OPT_REAL, "", 3.001, INFINITY, "",
   .help = "largest trace of the conformation tensor (3 at rest)", .when = "-flow_rheology fene_p"},
  {"-flow_rheology_implicit", OPT_CHOICE, "", OPT_ANY, "auto",
   .help =
     "change of the stress with the velocity of the step in the matrix: none, that at rest, or that of the stretched state",
   .choices = "auto, none, rest, stretched", .when = ELASTIC},
  {"-flow_rheology_devss", OPT_REAL, "", OPT_FROM(0), "0",
   .help =
     "DEVSS: fraction of the polymer viscosity times the difference of the velocity gradient and its projection, added to the momentum",
   .when = ELASTIC, .expert = PETSC_TRUE},
  {"-flow_rheology_viscosity_bounds", OPT_REALS, "", OPT_ABOVE_ZERO, "1e-3,1e3", .old = "-flow_rheology_limits",
   .help = "smallest and largest viscosity of a power law, in multiples of -flow_viscosity", .when = POWER},
  {"-flow_rheology_viscosity_infinity", OPT_REAL, "mass/(length time)", OPT_FROM(0), "0",
   .help = "viscosity at large g", .when = BOUNDED},
  {"-flow_rheology_yasuda", OPT_REAL, "", 0.1, 20, "2", .help = "exponent a of (1 + (L g)^a)^((n-1)/a)",
   .when = "-flow_rheology carreau"},
  {"-flow_rheology_yield", OPT_REAL, "mass/(length time^2)", OPT_ABOVE_ZERO, "", .help = "yield stress",
   .when = YIELDS},
  {"-flow_rheology_max_viscosity_ratio", OPT_REAL, "", 1, INFINITY, "1000", .old = "-flow_rheology_rigid",
   .help = "viscosity of the unyielded fluid, in multiples of -flow_viscosity", .when = YIELDS},
  {"-flow_rheology_papanastasiou", OPT_REAL, "time", OPT_ABOVE_ZERO, "rigid viscosity/yield",
   .help = "m of the regularised yield stress (1 - exp(-m g)) yield, in place of -flow_rheology_max_viscosity_ratio",
   .when = YIELDS},
  {"-flow_les_constant", OPT_REAL, "", OPT_FROM(0), "smagorinsky 0.1, wale 0.5",
   .help = "constant of the eddy viscosity, the length over the filter width (isotropic turbulence: smagorinsky 0.17)",
   .when = EDDIES},
  {"-flow_les_filter", OPT_REAL, "", OPT_POSITIVE, 10, "0.5",
   .help = "filter width in cube roots of the volume of a cell (square roots of its area)", .when = EDDIES},
  {"-flow_les_damping", OPT_CHOICE, "", OPT_ANY, "van_driest",
   .help = "how the length falls to zero at walls and bodies", .when = "-flow_rheology smagorinsky",
   .choices = "van_driest, none"},
  {"-flow_les_friction", OPT_REAL, "length/time", OPT_FROM(0), "0",
   .help =
     "friction velocity of the wall units in the damping, 0: by the law of the wall through the velocity at that point",
   .when = "-flow_les_damping van_driest"},
  {"-flow_gravity", OPT_REALS, "length/time^2", OPT_ANY, "0",
   .help      = "gravity: acts on bodies as weight minus buoyancy; the pressure excludes the hydrostatic part",
   .variables = "t", .also = "g, grav"},
  {"-flow_force", OPT_REALS, "force/volume", OPT_ANY, "0",
   .help = "body force per volume on the fluid and on the bodies in it", .when = FLOW, .variables = "x, y, z, t",
   .also = "body_force, bodyforce, source, forcing", .find = "pressure gradient, body force"},
  {"-flow_rate", OPT_REALS, "length/time", OPT_ANY, "",
   .help = "mean velocity over the box, bodies included, kept in every step by a uniform force (column flow_force)",
   .when = "-flow_active true and without -sim_steady", .also = "flow_rate, mean_velocity, bulk_velocity"},
  {"-flow_rate_axes", OPT_STRINGS, "", OPT_ANY, "all along which a force can change it",
   .help = "axes along which -flow_rate holds the mean velocity, out of x, y, z", .when = "-flow_rate"},
  {"-flow_velocity", OPT_REALS, "length/time", OPT_ANY, "0, or -flow_rate",
   .help = "velocity at the start; with -flow_initial poiseuille the largest", .when = FLOW, .variables = "x, y, z",
   .also = "initial_velocity, u0"},
  {"-flow_initial", OPT_CHOICE, "", OPT_ANY, "uniform or expression with -flow_velocity, else rest",
   .help = "initial flow: linear between walls, parabolic, the steady solution with bodies held, fields of another run",
   .when = FLOW, .choices = "rest, uniform, shear, poiseuille, expression, steady, run"},
  {"-flow_initial_run", OPT_STRING, "", OPT_ANY, "",
   .help = "output folder of another run (its last fields), or one of its fields_<step>.h5",
   .when = "-flow_initial run", .path = OPT_PATH},
  {"-flow_convection", OPT_BOOL, "", OPT_ANY, "true",
   .help = "convection term; false gives the unsteady Stokes equations", .when = FLOW},
  {"-flow_velocity_operator", OPT_CHOICE, "", OPT_ANY, "auto",
   .help = "products with the velocity matrix (auto: matrix_free in 3D for a Newtonian fluid)", .when = FLOW,
   .choices = "auto, matrix_free, assembled"},
  {"-device", OPT_CHOICE, "", OPT_ANY, "none",
   .help =
     "where vectors lie and products are made: cuda, on a GPU, for scenes in space; emulate: its kernels on the processor, to test them",
   .when = FLOW, .choices = "none, emulate, cuda", .also = "gpu, accelerator", .words = "gpu cuda, cpu none",
   .find = "graphics card, nvidia"},
  {"-device_table", OPT_BOOL, "", OPT_ANY, "false",
   .help =
     "at the end a table of the kernels: calls, bytes that they read and write at least, seconds (each is waited for)",
   .when = "-device"},
  {"-flow_convection_form", OPT_CHOICE, "", OPT_ANY, "convective",
   .help =
     "w.grad u; with half of (div w) u, which keeps the energy whatever the divergence of w; or w.grad u, and what it takes of the momentum along periodic axes comes back as a uniform force in the next step",
   .when = FLOW, .choices = "convective, skew, conservative"},
  {"-flow_time", OPT_CHOICE, "", OPT_ANY, "bdf2", .help = "time scheme (default with -couple_type explicit: be)",
   .when = FLOW, .choices = "be, cn, bdf2, fstheta", .also = "scheme, time_scheme, time_integration, timestepping",
   .words =
     "euler be, backward_euler be, implicit_euler be, implicit be, crank_nicolson cn, crank-nicolson cn, cranknicolson cn, bdf bdf2, theta fstheta, fractional_step fstheta, fractional_step_theta fstheta"},
  {"-flow_extrapolation", OPT_CHOICE, "", OPT_ANY, "auto",
   .help =
     "convecting velocity from two or (bodies that stay) three steps (auto: from three, limited, in steps of CFL numbers from 2 to 5, else from two)",
   .when = FLOW, .choices = "linear, quadratic, auto"},
  {"-flow_bc_<boundary>_type", OPT_CHOICE, "", OPT_ANY, "no_slip",
   .help =
     "condition on this boundary of the mesh (a physical name 'left wall' of a mesh file: left_wall); bodies need none, they are no-slip",
   .when = FLOW, .choices = "no_slip, moving_wall, rotating_wall, inflow, outflow, slip, pressure",
   .also = "kind, condition",
   .words =
     "symmetry slip, symmetric slip, free_slip slip, freeslip slip, slip_wall slip, wall no_slip, noslip no_slip, no-slip no_slip, fixed no_slip, stick no_slip, solid no_slip, lid moving_wall, moving moving_wall, moving_lid moving_wall, belt moving_wall, rotating rotating_wall, dirichlet inflow, velocity inflow, inlet inflow, velocity_inlet inflow, in inflow, outlet outflow, pressure_outlet pressure, pressure_outflow pressure, do_nothing outflow, donothing outflow, neumann outflow, zero_gradient outflow, open outflow, opening outflow, out outflow, free outflow"},
  {"-flow_bc_<boundary>_pressure", OPT_REALS, "mass/(length time^2)", OPT_ANY, "",
   .help = "pressure outside an opening, which drives the flow: mu du/dn - p n = -pressure n (outflow: the same with 0)",
   .when = "-flow_bc_<boundary>_type pressure", .variables = "x, y, z, t"},
  {"-flow_bc_<boundary>_velocity", OPT_REALS, "length/time", OPT_ANY, "",
   .help = "prescribed velocity (largest one of a profile)", .when = RUNS_IN, .variables = "x, y, z, t",
   .also = "value, u, v, speed, velocities"},
  {"-flow_bc_<boundary>_profile", OPT_CHOICE, "", OPT_ANY, "uniform", .help = "shape of the velocity profile",
   .when = RUNS_IN, .choices = "uniform, parabolic",
   .words = "parabola parabolic, poiseuille parabolic, flat uniform, constant uniform, plug uniform"},
  {"-flow_bc_<boundary>_navier", OPT_REAL, "length", OPT_FROM(0), "0",
   .help =
     "slip length of a wall of type slip (Navier): its friction is viscosity times velocity over this length (0: free slip)",
   .when = "-particle_<group>_contact_angle and -flow_bc_<boundary>_type slip", .also = "slip_length, navier_slip"},
  {"-flow_bc_<boundary>_omega", OPT_REALS, "1/time", OPT_ANY, "", .help = "angular velocity of the wall",
   .when = ROTATES, .also = "angular_velocity"},
  {"-flow_bc_<boundary>_centre", OPT_REALS, "length", OPT_ANY, "0",
   .help = "point about which the wall turns (default: origin)", .when = ROTATES},
  {"-flow_bc_<boundary>_factor", OPT_REALS, "-, -, time", OPT_ANY, "1,0,1",
   .help = "a, b, T: velocity or pressure is multiplied by a + b sin(2 pi t / T)", .when = HAS_SPEED},
  {"-flow_bc_<boundary>_ramp", OPT_REAL, "time", OPT_FROM(0), "0",
   .help = "time over which the velocity or pressure rises smoothly from zero", .when = HAS_SPEED},
};
OPT_TABLE("flow: fluid, time scheme, boundary conditions", SPECS)
