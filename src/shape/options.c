/* Options of the room shape: see base/opt.h. Those of a shape itself are declared by its plugin as it is created. */
#include "base/opt.h"

static const OptSpec SPECS[] = {
  {"-shape_path", OPT_STRING, "", OPT_ANY, "",
   .help = "folders to search for shape plugins, separated by colons, before the program's own",
   .when = "-particle_groups", .path = OPT_PATHS},
  {"-shape_patience", OPT_REAL, "s", OPT_FROM(0), "60",
   .help = "processor time after which a call into a plugin counts as endless, 0: never", .expert = PETSC_TRUE},
};
OPT_TABLE("shape: plugins", SPECS)
