/* Options of the room report: see base/opt.h. */
#include "base/opt.h"

#define FLOW "-flow_active true"

static const OptSpec SPECS[] = {
  {"-units_length", OPT_CHOICE, "", OPT_ANY, "", .help = "unit of the scene's lengths, for headings and labels; nothing is converted",
   .choices = "km, m, cm, mm, um, nm"},
  {"-units_time", OPT_CHOICE, "", OPT_ANY, "", .help = "unit of the scene's times", .choices = "h, min, s, ms, us, ns"},
  {"-units_mass", OPT_CHOICE, "", OPT_ANY, "", .help = "unit of the scene's masses", .choices = "t, kg, g, mg, ug, ng, pg"},
  {"-output_dir", OPT_STRING, "", OPT_ANY, "out/<scene>", .help = "directory of the results, created if need be"},
  {"-output_overwrite", OPT_BOOL, "", OPT_ANY, "false", .help = "write into a directory that holds the results of another run"},
  {"-output_every", OPT_INT, "steps", OPT_FROM(0), "0", .help = "steps between two snapshots of the fields, 0 for none"},
  {"-output_interval", OPT_REAL, "time", OPT_FROM(0), "0", .help = "time between two snapshots, at which time steps end, 0 for none"},
  {"-output_series", OPT_INT, "steps", OPT_FROM(1), "1", .help = "steps between two lines of series.csv and bodies.csv"},
  {"-output_bodies", OPT_INTS, "", OPT_FROM(0), "all of at most 64, else none", .help = "first and last body in bodies.csv"},
  {"-output_bodies_format", OPT_CHOICE, "", OPT_ANY, "auto",
   .help    = "lines of bodies.csv, or datasets of table_<step>.h5, which all ranks write together; auto: csv up to 10000 bodies",
   .choices = "auto, csv, hdf5"},
  {"-output_progress", OPT_INT, "steps", OPT_FROM(0), "0", .help = "steps between two lines of progress, 0 for some 20 to 50 lines in a run"},
  {"-output_suspension", OPT_BOOL, "", OPT_ANY, "false",
   .help =
     "mean velocity of the bodies in series.csv; pair distribution, profile of the volume fraction and contacts as tables at snapshots and at the "
     "end",
   .when = "-particle_groups"},
  {"-output_suspension_axis", OPT_CHOICE, "", OPT_ANY, "y, in 3D z", .help = "axis of the profile", .choices = "x, y, z",
   .when = "-output_suspension true"},
  {"-output_suspension_bins", OPT_INT, "", 1, 100000, "50", .help = "intervals of the pair distribution and of the profile",
   .when = "-output_suspension true"},
  {"-output_statistics", OPT_CHOICE, "", OPT_ANY, "none",
   .help = "means, Reynolds stresses and eddy viscosity over time and over planes across this axis, in statistics.csv", .choices = "none, x, y, z",
   .when = FLOW " and without -sim_steady"},
  {"-output_statistics_from", OPT_REAL, "time", OPT_FROM(0), "0", .help = "steps that begin at this time or later count",
   .when = "-output_statistics"},
  {"-output_yardstick", OPT_BOOL, "", OPT_ANY, "false",
   .help = "measure memory bandwidth and one product with the velocity matrix after the last step", .expert = PETSC_TRUE},
  {"-checkpoint_every", OPT_INT, "steps", OPT_FROM(0), "0", .help = "steps between two checkpoints, 0 for none"},
  {"-checkpoint_minutes", OPT_REAL, "min", OPT_FROM(0), "0", .help = "wall clock between two checkpoints, 0 for none"},
  {"-sim_restart", OPT_STRING, "", OPT_ANY, "", .help = "checkpoint to continue from, or latest for the newest in -output_dir"},
  {"-monitor_dp", OPT_REALS, "length", OPT_ANY, "", .help = "two points between which the pressure difference is taken", .when = FLOW},
  {"-monitor_probes", OPT_REALS, "length", OPT_ANY, "", .help = "places, one after another, whose velocity is in series.csv",
   .when = FLOW " and without -sim_steady"},
  {"-monitor_momentum", OPT_BOOL, "", OPT_ANY, "false", .help = "balance of momentum of the flow by its parts in series.csv", .when = FLOW},
  {"-monitor_from", OPT_REAL, "time", OPT_ANY, "0", .help = "extrema and periods count from this time on", .when = FLOW},
  {"-particle_<group>_reference_speed", OPT_REAL, "length/time", OPT_ABOVE_ZERO, "",
   .help = "speed U of the coefficients 2 F / (rho U^2 L), asks for them", .when = FLOW},
  {"-particle_<group>_reference_length", OPT_REAL, "length", OPT_ABOVE_ZERO, "diameter of the bounding circle",
   .help = "length L of the coefficients", .when = "-particle_<group>_reference_speed"},
};
OPT_TABLE("report: output, checkpoints, diagnostics", SPECS)
