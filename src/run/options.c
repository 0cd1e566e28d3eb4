/* Options of the room run: see base/opt.h. */
#include "base/opt.h"

#define ADAPT  "-sim_adapt true"
#define FLOW   "-flow_active true and without -sim_steady"
#define STEADY "-sim_steady true or -flow_initial steady"

static const OptSpec SPECS[] = {
  {"-preset", OPT_CHOICE, "", OPT_ANY, "balanced",
   .help = "what a run should be: sets recipe, rung, time scheme and step; on the command line it replaces those of the scene",
   .when = "-flow_active true", .choices = "fast, balanced, accurate"},
  {"-scene_dry_run", OPT_BOOL, "", OPT_ANY, "false", .help = "build everything, describe it, and stop before the first step"},
  {"-flow_active", OPT_BOOL, "", OPT_ANY, "true",
   .help = "solve for the flow; without it bodies move under gravity and contact alone, and the mesh gives the box"},
  {"-sim_dt", OPT_REAL, "time", OPT_ABOVE_ZERO, "0.01", .help = "time step; with -sim_adapt the first one"},
  {"-sim_time", OPT_REAL, "time", OPT_FROM(0), "", .help = "time at which the run ends"},
  {"-sim_steps", OPT_INT, "", OPT_FROM(0), "", .help = "number of steps after which the run ends"},
  {"-sim_steady", OPT_BOOL, "", OPT_ANY, "false", .help = "solve for the steady state, without time steps", .when = "-flow_active true"},
  {"-flow_linearization", OPT_CHOICE, "", OPT_ANY, "newton", .help = "Jacobian of steady problems", .when = STEADY, .choices = "newton, picard"},
  {"-flow_picard_steps", OPT_INT, "", OPT_FROM(0), "3", .help = "Picard iterations before those of Newton's method",
   .when = STEADY " and -flow_linearization newton", .expert = PETSC_TRUE},
  {"-flow_pseudo_steps", OPT_INT, "", OPT_FROM(0), "200", .help = "largest number of pseudo-time steps when the iteration fails (0: none)",
   .when = STEADY, .expert = PETSC_TRUE},
  {"-sim_move_max", OPT_REAL, "radii", OPT_FROM(0), "1", .help = "largest way of a body in a step, 0: any; beyond it the run stops", .when = FLOW,
   .expert = PETSC_TRUE},
  {"-sim_judge_divergence", OPT_REAL, "", OPT_FROM(0), "0.1", .help = "largest divergence in velocities a cell, 0: any", .when = FLOW,
   .expert = PETSC_TRUE},
  {"-sim_judge_momentum", OPT_REAL, "", OPT_FROM(0), "0.05 (recipe fast: 0.3)", .help = "largest error of the balance of momentum, relative, 0: any",
   .when = FLOW, .expert = PETSC_TRUE},
  {"-sim_judge_growth", OPT_REAL, "", OPT_FROM(0), "0.2", .help = "largest growth of the kinetic energy in a step without a source, relative, 0: any",
   .when = FLOW, .expert = PETSC_TRUE},
  {"-sim_judge_backflow", OPT_REAL, "", OPT_FROM(0), "1e-3", .help = "largest error of the back-flow condition (column backflow_error), 0: any",
   .when = "-couple_backflow flux or force", .expert = PETSC_TRUE},
  {"-sim_judge_steps", OPT_INT, "", OPT_FROM(0), "5", .help = "steps in a row beyond these bounds after which the run stops, 0: never", .when = FLOW,
   .expert = PETSC_TRUE},
  {"-sim_adapt", OPT_BOOL, "", OPT_ANY, "false", .help = "choose the time step by its error, the CFL number, and the way and the gaps of bodies",
   .when = "-flow_active true and without -sim_steady"},
  {"-sim_adapt_tolerance", OPT_REAL, "", OPT_POSITIVE, 1, "1e-4", .help = "local error of a step, relative to the largest speed", .when = ADAPT},
  {"-sim_adapt_speed", OPT_REAL, "length/time", OPT_FROM(0), "0", .help = "speed that errors refer to, 0: the largest so far", .when = ADAPT},
  {"-sim_adapt_cfl", OPT_REAL, "", OPT_FROM(0), "5", .help = "largest CFL number of a step, 0: any", .when = ADAPT},
  {"-sim_adapt_min", OPT_REAL, "time", OPT_ABOVE_ZERO, "-sim_dt / 100", .help = "smallest step", .when = ADAPT},
  {"-sim_adapt_max", OPT_REAL, "time", OPT_ABOVE_ZERO, "", .help = "largest step", .when = ADAPT},
  {"-sim_adapt_move", OPT_REAL, "cells", OPT_POSITIVE, 1, "0.5", .help = "largest way of a body in a step", .when = ADAPT, .expert = PETSC_TRUE},
  {"-sim_adapt_gap", OPT_REAL, "", 0, 1, "0.5", .help = "largest part of its gap that a body closes in a step, 0: any", .when = ADAPT,
   .expert = PETSC_TRUE},
  {"-sim_adapt_growth", OPT_REAL, "", 1.01, 2.4, "1.5", .help = "largest ratio of a step to the one before (bdf2 is stable below 2.41)",
   .when = ADAPT, .expert = PETSC_TRUE},
  {"-sim_adapt_hysteresis", OPT_REAL, "", 1, 2.4, "1.2", .help = "smallest ratio by which a step grows", .when = ADAPT, .expert = PETSC_TRUE},
};
OPT_TABLE("run: what is computed, time steps", SPECS)
