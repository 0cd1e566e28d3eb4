/* Options of the room bodies: see base/opt.h. */
#include "base/opt.h"

#define GROUP     "-particle_groups"
#define MOTION    "-particle_<group>_motion"
#define MOORING   "-particle_<group>_mooring_stiffness or -particle_<group>_mooring_damping"
#define LOAD      "x, y, z, t, u, v, w, angle, omega"
#define OSCILLATE "-particle_<group>_motion oscillate"

/* How the numbers of a distribution are spread */
#define SPREAD(what, unit, mean) \
  {"-particle_<group>_" what "_range", \
   OPT_REALS, \
   unit, \
   OPT_ANY, \
   "mean -+ 3 deviations", \
   .help = "lowest and highest of the " what "; bimodal: the two of them", \
   .when = "-particle_<group>_" what " other than same"}, \
    {"-particle_<group>_" what "_mean", \
     OPT_REAL, \
     unit, \
     OPT_ABOVE_ZERO, \
     mean, \
     .help = "mean of the " what, \
     .when = "-particle_<group>_" what " normal or lognormal"}, \
    {"-particle_<group>_" what "_deviation", \
     OPT_REAL, \
     unit, \
     OPT_ABOVE_ZERO, \
     "", \
     .help = "standard deviation of the " what, \
     .when = "-particle_<group>_" what " normal or lognormal"}, \
  { \
    "-particle_<group>_" what "_fraction", OPT_REAL, "", 0, 1, "0.5", \
      .old  = "-particle_<group>_" what "_share", \
      .help = "fraction by number of bodies that have the first of the two " what, \
      .when = "-particle_<group>_" what " bimodal" \
  }

static const OptSpec SPECS[] = {
  {"-particle_groups", OPT_STRINGS, "", OPT_ANY, "",
   .help =
     "names of the groups of bodies; one with the name of a boundary of the mesh is the body behind it, whose surface that boundary is",
   .also = "group, names, bodies"},
  {"-particle_remove", OPT_STRINGS, "", OPT_ANY, "",
   .help = "boundaries at which bodies that leave the domain are removed; elsewhere the run stops",
   .when = "-particle_groups"},
  {"-particle_<group>_shape", OPT_STRING, "", OPT_ANY, "",
   .help = "type of the shape: the name of a plugin in -shape_path", .when = GROUP, .also = "type, geometry, form"},
  {"-particle_<group>_density", OPT_REAL, "mass/length^3", OPT_ABOVE_ZERO, "1",
   .help = "density of the bodies; those that move need it", .when = GROUP, .also = "rho, rho_p, rhop, mass_density"},
  {"-particle_<group>_free", OPT_STRINGS, "", OPT_ANY, "all, with a pivot rotation, with a motion none",
   .help = "degrees of freedom that move: any of x, y, z, rotation, or all, or none", .when = GROUP,
   .also = "fixed, static, dof, dofs, mobile, moving, freedom", .find = "hinge, degrees of freedom"},
  {"-particle_<group>_place", OPT_CHOICE, "", OPT_ANY, "single", .help = "where the bodies start", .when = GROUP,
   .choices = "single, lattice, random, table, pack", .also = "placement, distribution, arrangement",
   .words =
     "grid lattice, list table, csv table, file table, packed pack, packing pack, pos single, position single, one single"},
  {"-particle_<group>_position", OPT_REALS, "length", OPT_ANY, "",
   .help = "centre of mass at the start, or with -particle_<group>_pivot that point, for place single", .when = GROUP,
   .also = "pos, x, x0, xy, center, centre, location, origin_position, initial_position, coordinates"},
  {"-particle_<group>_count", OPT_INT, "", OPT_FROM(0), "1",
   .help = "number of bodies, for place lattice, random and pack", .when = GROUP, .also = "n, number, num, amount"},
  {"-particle_<group>_lower", OPT_REALS, "length", OPT_ANY, "that of the domain",
   .help = "lower corner of the box for lattice, random and pack", .when = GROUP, .also = "min, box_lower"},
  {"-particle_<group>_upper", OPT_REALS, "length", OPT_ANY, "that of the domain",
   .help = "upper corner of the box for lattice, random and pack", .when = GROUP, .also = "max, box_upper"},
  {"-particle_<group>_margin", OPT_REAL, "length", OPT_FROM(0), "0",
   .help =
     "smallest gap: for lattice and random between bounding circles, for pack between bodies and to the faces of the box",
   .when = GROUP, .also = "gap, spacing, distance"},
  {"-particle_<group>_seed", OPT_INT, "", OPT_FROM(0), "0",
   .help = "seed of random positions, sizes, densities and orientations", .when = GROUP},
  {"-particle_<group>_fraction", OPT_REAL, "", OPT_POSITIVE, 1, "",
   .help = "volume fraction of the box, which gives the number of bodies", .when = "-particle_<group>_place pack",
   .also = "volume_fraction, solid_fraction, packing"},
  {"-particle_<group>_orientation", OPT_CHOICE, "", OPT_ANY, "given",
   .help = "angle at the start: the given one, or uniform over all orientations", .when = GROUP,
   .choices = "given, random"},
  {"-particle_<group>_sizes", OPT_CHOICE, "", OPT_ANY, "same",
   .help = "distribution of sizes, as multiples of the group's shape", .when = GROUP,
   .choices = "same, uniform, normal, lognormal, bimodal"},
  SPREAD("sizes", "", "1"),
  {"-particle_<group>_densities", OPT_CHOICE, "", OPT_ANY, "same", .help = "distribution of densities", .when = GROUP,
   .choices = "same, uniform, normal, lognormal, bimodal"},
  SPREAD("densities", "mass/length^3", "-particle_<group>_density"),
  {"-particle_<group>_table", OPT_STRING, "", OPT_ANY, "",
   .help =
     "CSV file with one line a body, for place table: columns x, y, z; if wanted angle, u, v, w, omega, size (in that of the shape) or radius "
     "(bounding radius), density; in 3D axis_x, axis_y, axis_z of the angle, q_w, q_x, q_y, q_z before it turns",
   .when = GROUP, .path = OPT_PATH, .also = "csv, positions", .find = "csv, positions, many bodies"},
  {"-particle_<group>_angle", OPT_REAL, "rad", OPT_ANY, "0",
   .help = "angle at the start, about z, the axis or the hinge", .when = GROUP,
   .also = "theta, rotation, orientation_angle, phi, aoa, angle_of_attack"},
  {"-particle_<group>_axis", OPT_REALS, "", OPT_ANY, "0,0,1",
   .help = "axis of the angle at the start, and of that of a file, of any length (3D)", .when = GROUP},
  {"-particle_<group>_quaternion", OPT_REALS, "", OPT_ANY, "1,0,0,0",
   .help = "orientation w,x,y,z before the angle turns it (3D)", .when = GROUP},
  {"-particle_<group>_velocity", OPT_REALS, "length/time", OPT_ANY, "0",
   .help =
     "velocity at the start (kept where not free), of elastic particles without it that of the flow; with t that of the prescribed motion",
   .when = GROUP, .variables = "t", .also = "vel, u, v, u0, v0, speed"},
  {"-particle_<group>_angular_velocity", OPT_REALS, "rad/time", OPT_ANY, "0",
   .help =
     "angular velocity at the start (kept where not free; of elastic particles about their centroid); with t that of the prescribed motion",
   .when = GROUP, .variables = "t", .also = "omega, w, rotation_speed, angular_speed, spin, rpm"},
  {"-particle_<group>_initial_velocity", OPT_CHOICE, "", OPT_ANY, "given", .old = "-particle_<group>_start",
   .help =
     "initial velocity of free bodies: as given (-particle_<group>_velocity), or the momentum of the fluid that the body replaces; of elastic ones without a velocity fluid, at every node",
   .when = GROUP, .choices = "given, fluid", .words = "rest given, zero given, flow fluid"},
  {"-particle_<group>_force", OPT_REALS, "force", OPT_ANY, "0",
   .help =
     "external force on each body, at its centre of mass; of that are x, y, z, and u, v, w its velocity; angle and omega as in "
     "-particle_<group>_torque",
   .when = GROUP, .variables = LOAD},
  {"-particle_<group>_torque", OPT_REALS, "force length", OPT_ANY, "0",
   .help =
     "external torque on each body; angle and omega: about z or the hinge. In a flow, terms that decrease with the body's own position or velocity, such as "
     "-c*omega, are implicit, all others are those of the beginning of the step",
   .when = GROUP, .variables = LOAD},
  {"-particle_<group>_spring", OPT_REAL, "force length", OPT_FROM(0), "0",
   .help = "stiffness of a spring that turns the body to its rest angle: torque a rad, about z or the hinge",
   .when = GROUP},
  {"-particle_<group>_spring_damping", OPT_REAL, "force length time", OPT_FROM(0), "0",
   .help = "torque against the angular velocity, a rad a time", .when = GROUP},
  {"-particle_<group>_spring_angle", OPT_REAL, "rad", OPT_ANY, "0", .help = "rest angle of the spring",
   .when = "-particle_<group>_spring"},
  {"-particle_<group>_mooring", OPT_REALS, "length", OPT_ANY, "where it starts",
   .help = "point in space that a spring ties the body to; with several springs one after the other", .when = MOORING},
  {"-particle_<group>_mooring_stiffness", OPT_REALS, "force/length", OPT_FROM(0), "0",
   .help = "stiffness of each mooring, or of all of them; of length 0 it acts along every axis by itself",
   .when = GROUP},
  {"-particle_<group>_mooring_damping", OPT_REALS, "force time/length", OPT_FROM(0), "0",
   .help = "damping of each mooring, or of all: along the line, of length 0 along every axis", .when = GROUP},
  {"-particle_<group>_mooring_length", OPT_REALS, "length", OPT_FROM(0), "0",
   .help = "length of each mooring without force, or of all", .when = MOORING},
  {"-particle_<group>_mooring_at", OPT_REALS, "length", OPT_ANY, "the centre",
   .help = "end of each mooring on the body, or of all, in the frame of the shape", .when = MOORING},
  {"-particle_<group>_mooring_slack", OPT_BOOL, "", OPT_ANY, "false",
   .help = "lines that pull and never push: without force when shorter than their length", .when = MOORING},
  {"-particle_<group>_motion", OPT_STRINGS, "", OPT_ANY, "",
   .help = "prescribed motion, parts that are added up: any of constant, oscillate, rotate", .when = GROUP,
   .find = "prescribed, forced, oscillating, rotating, moving"},
  {"-particle_<group>_motion_amplitude", OPT_REALS, "length", OPT_ANY, "",
   .help = "amplitude of the oscillation along each axis", .when = OSCILLATE, .also = "amplitude"},
  {"-particle_<group>_motion_period", OPT_REALS, "time", OPT_ABOVE_ZERO, "",
   .help = "period of the oscillation along each axis", .when = OSCILLATE " and -particle_<group>_motion_amplitude",
   .also = "period"},
  {"-particle_<group>_motion_phase", OPT_REALS, "rad", OPT_ANY, "0", .help = "phase of the oscillation along each axis",
   .when = OSCILLATE " and -particle_<group>_motion_amplitude"},
  {"-particle_<group>_motion_rotation", OPT_REALS, "rad, time, rad", OPT_ANY, "",
   .old = "-particle_<group>_motion_swing", .help = "amplitude, period and phase of the oscillating angle about z",
   .when = OSCILLATE},
  {"-particle_<group>_motion_file", OPT_STRING, "", OPT_ANY, "",
   .help =
     "CSV file with a line for each time: column t; any of x, y, z or u, v, w, angle or omega; displacements count from the first line",
   .when = GROUP, .path = OPT_PATH},
  {"-particle_<group>_motion_repeat", OPT_BOOL, "", OPT_ANY, "false",
   .help = "repeat the file after its last line; otherwise the body stops, or keeps its velocity",
   .when = "-particle_<group>_motion_file"},
  {"-particle_<group>_motion_ramp", OPT_REAL, "time", OPT_FROM(0), "0",
   .help = "time over which the prescribed motion speeds up from rest", .when = MOTION},
  {"-particle_<group>_pivot", OPT_REALS, "length", OPT_ANY, "",
   .help = "point of the shape about which the body turns, in the shape's frame", .when = GROUP,
   .also = "pivot_point, hinge_point"},
  {"-particle_<group>_hinge", OPT_REALS, "", OPT_ANY, "",
   .help = "axis, fixed in space, about which alone the body turns (3D)", .when = GROUP, .also = "hinge_axis"},
  {"-particle_<group>_slide", OPT_REALS, "", OPT_ANY, "", .help = "the only direction along which the body may move",
   .when = GROUP},
  {"-particle_<group>_obstacle", OPT_BOOL, "", OPT_ANY, "false",
   .help =
     "the bodies are part of the geometry: held, they may overlap walls and other obstacles and stick out of the domain",
   .when = GROUP},
  {"-particle_<group>_stops", OPT_REALS, "rad", OPT_ANY, "", .help = "lower and upper stop of the angle",
   .when = GROUP},
  {"-particle_<group>_slip_modes", OPT_REALS, "length/time", OPT_ANY, "",
   .help =
     "modes B_1, B_2, ... of the slip velocity of a squirmer's surface (disc or sphere): it swims at B_1/2 (2D) or 2 B_1/3 (3D); B_2 above 0 pulls, below 0 pushes",
   .when = GROUP, .variables = "t", .also = "squirmer, B1, B2, beta",
   .find = "squirmer, swimmer, swimming, microswimmer, pusher, puller, active"},
  {"-particle_<group>_slip_direction", OPT_REALS, "", OPT_ANY, "along x",
   .help = "direction of swimming in the frame of the shape, of any length",
   .when = "-particle_<group>_slip_modes, -particle_<group>_slip_velocity or -particle_<group>_slip_mobility"},
  {"-particle_<group>_slip_mobility", OPT_REALS, "length^2/(time scalar)", OPT_ANY, "0",
   .help =
     "phoretic mobility, place in the frame of the shape: the surface slips at minus it times the gradient of the scalar along the surface, and a body of one mobility moves along the gradient",
   .when = GROUP, .variables = "x, y, z, t", .also = "phoretic_mobility, diffusiophoresis, thermophoresis",
   .find = "phoretic, janus, diffusiophoresis, thermophoresis, active"},
  {"-particle_<group>_slip_scalar", OPT_STRING, "", OPT_ANY, "", .help = "name of that scalar, one of -scalars",
   .when = "-particle_<group>_slip_mobility"},
  {"-particle_<group>_slip_velocity", OPT_REALS, "length/time", OPT_ANY, "0",
   .help =
     "velocity of the surface beside the rigid motion, place and components in the frame of the shape; its tangential part acts",
   .when = GROUP, .variables = "x, y, z, t", .also = "slip, surface_velocity, tangential_velocity",
   .find = "swimmer, active, pump, treadmill"},
  {"-particle_<group>_stops_restitution", OPT_REAL, "", 0, 1, "0", .help = "rebound speed over impact speed at a stop",
   .when = "-particle_<group>_stops"},
};
OPT_TABLE("bodies: groups, places, motion", SPECS)
