/* Options of the room shape: see base/opt.h. Those of a shape itself are declared by its plugin as it is created. */
#include "base/opt.h"

static const OptSpec SPECS[] = {
  {"-shape_path", OPT_STRING, "", OPT_ANY, "",
   .help = "folders to search for shape plugins, separated by colons, before the program's own",
   .when = "-particle_groups", .path = OPT_PATHS},
  {"-shape_patience", OPT_REAL, "s", OPT_FROM(0), "60",
   .help = "processor time after which a call into a plugin counts as endless, 0: never", .expert = PETSC_TRUE},
  {"-particle_<group>_material", OPT_CHOICE, "", OPT_ANY, "rigid",
   .help =
     "what the particles are made of: rigid bodies, elastic solids with this law, an elastic membrane around the fluid (capsules, vesicles), or a fluid (drops, bubbles)",
   .when = "-particle_groups", .choices = "rigid, neo_hookean, st_venant_kirchhoff, membrane, fluid",
   .also = "law, elastic, constitutive_law, solid",
   .words =
     "svk st_venant_kirchhoff, nh neo_hookean, elastic neo_hookean, hyperelastic neo_hookean, soft neo_hookean, stvk st_venant_kirchhoff, capsule membrane, vesicle membrane, shell membrane, red_cell membrane, liquid fluid, gas fluid, drop fluid, bubble fluid",
   .find = "elastic, drop, bubble, deformable, soft, flexible, fluid-structure interaction, fsi"},
};
OPT_TABLE("shape: plugins, materials", SPECS)
