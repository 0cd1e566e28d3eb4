/* Options of the room solid: see base/opt.h. */
#include "base/opt.h"

#define ELASTIC  "-particle_<group>_material neo_hookean or st_venant_kirchhoff"
#define MEMBRANE "-particle_<group>_material membrane"

static const OptSpec SPECS[] = {
  {"-particle_<group>_shear_modulus", OPT_REAL, "force/length^2", OPT_ABOVE_ZERO, "",
   .help = "shear modulus of the law", .when = ELASTIC, .also = "mu_s, g, stiffness, modulus"},
  {"-particle_<group>_poisson", OPT_REAL, "", 0, 0.5, "0.5", .help = "Poisson's number; 0.5 is incompressible",
   .when = ELASTIC, .also = "nu_s, poisson_ratio, poissons_ratio"},
  {"-particle_<group>_solid_viscosity", OPT_REAL, "mass/(length time)", OPT_FROM(0), "0",
   .help = "viscosity of the solid beyond that of the fluid", .when = ELASTIC, .also = "eta_s"},
  {"-particle_<group>_solid_cells", OPT_INTS, "", 1, 100000, "",
   .help = "cells of the box around the shape of which the solid's mesh is made, along each axis", .when = ELASTIC},
  {"-particle_<group>_solid_size", OPT_REAL, "length", OPT_ABOVE_ZERO,
   "2/3 of the smallest cell of the flow, without a flow that cell",
   .help =
     "size of the solid's cells, where their numbers are not given; in a flow smaller than the flow's, which moves in ways that coarser ones do not see",
   .when = ELASTIC},
  {"-particle_<group>_membrane_law", OPT_CHOICE, "", OPT_ANY, "neo_hookean",
   .help =
     "law of a membrane: neo_hookean, an incompressible sheet that thins, zero_thickness, the same for small strains and stiffer where the area grows, or skalak, which resists changes of area",
   .when = MEMBRANE, .choices = "neo_hookean, skalak, zero_thickness"},
  {"-particle_<group>_surface_modulus", OPT_REAL, "force/length", OPT_ABOVE_ZERO, "",
   .help = "surface shear modulus of a membrane; of neo_hookean and zero_thickness a third of the surface Young modulus",
   .when = MEMBRANE, .also = "g_s, surface_shear_modulus, membrane_modulus"},
  {"-particle_<group>_area_modulus", OPT_REAL, "force/length", OPT_FROM(0), "0; of skalak the surface modulus",
   .help = "what a membrane has against a change of area: C times the surface modulus in Skalak's law",
   .when = MEMBRANE, .also = "area_dilatation, dilatation_modulus"},
  {"-particle_<group>_bending", OPT_REAL, "force length; in the plane force length^2 by length", OPT_FROM(0), "0",
   .help =
     "bending modulus of a membrane: the energy is half of it times the square of the curvature, the sum of both principal ones",
   .when = MEMBRANE, .also = "bending_modulus, bending_stiffness, bending_rigidity"},
  {"-particle_<group>_global_area_modulus", OPT_REAL, "force/length; in the plane force", OPT_FROM(0), "0",
   .help =
     "what a membrane has against a change of its whole area (in the plane length): the energy is half of it times the square of the change, over the area at the start; large values hold the area",
   .when = MEMBRANE, .also = "area_constraint, length_constraint, total_area_modulus, inextensible",
   .find = "keep the area, surface area, global area, perimeter"},
  {"-particle_<group>_clamp", OPT_REALS, "", OPT_ANY, "",
   .help = "expression of the position in space at the start: the solid's nodes where it is above zero are held",
   .when = ELASTIC, .variables = "x, y, z", .also = "anchor, hold, fix", .find = "clamped, anchored"},
  {"-particle_<group>_watch", OPT_REALS, "length", OPT_ANY, "",
   .help =
     "points in space at the start, one after the other: displacements of the solid's nodes there become columns of series.csv",
   .when = ELASTIC, .also = "probe, points, monitor"},
};
OPT_TABLE("solid: elastic particles", SPECS)
