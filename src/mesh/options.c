/* Options of the room mesh: see base/opt.h. */
#include "base/opt.h"

#define BOX     "-mesh_kind box"
#define CORNERS "-mesh_kind box or fitted"
#define LAYERED "-mesh_kind tube, or fitted with -mesh_dimension 3"
#define LEVELED "-mesh_kind box or channel"
#define FOCUS   "-mesh_focus"
#define GRADED  "-mesh_focus, or -mesh_kind channel or fitted"

static const OptSpec SPECS[] = {
  {"-mesh_kind", OPT_CHOICE, "", OPT_ANY, "box", .help = "where the mesh comes from",
   .choices = "box, channel, fitted, disc, annulus, tube, ball, shell, file"},
  {"-mesh_dimension", OPT_INT, "", 2, 3, "3 if -mesh_cells, -mesh_lower or -mesh_upper have three numbers, else 2",
   .help = "space dimension of a box, or of the channel around a cylinder (along z in space)", .when = CORNERS},
  {"-mesh_lower", OPT_REALS, "length", OPT_ANY, "0", .help = "lower corner of the box", .when = CORNERS},
  {"-mesh_upper", OPT_REALS, "length", OPT_ANY, "by mesh: box 1, fitted 2.2,0.41,0.41", .help = "upper corner of the box", .when = CORNERS},
  {"-mesh_cells", OPT_INTS, "", 1, 1000000, "16", .help = "cells along each axis", .when = BOX " and without -mesh_focus"},
  {"-mesh_memory", OPT_REAL, "", OPT_FROM(0), "1",
   .help = "largest share of the machines' memory that a mesh of this many cells may need in a run, 0: any",
   .when = "-mesh_kind box, tube, ball or shell, or fitted with -mesh_dimension 3", .expert = PETSC_TRUE},
  {"-mesh_periodic", OPT_STRINGS, "", OPT_ANY, "", .help = "periodic axes, out of x, y, z (z alone, but for a box)",
   .when = "-mesh_kind box or tube, or fitted with -mesh_dimension 3"},
  {"-mesh_focus", OPT_REALS, "length", OPT_ANY, "", .help = "box of fine cells: its lower, then its upper corner", .when = BOX},
  {"-mesh_focus_h", OPT_REAL, "length", OPT_ABOVE_ZERO, "", .help = "size of the cells in the focus box", .when = FOCUS},
  {"-mesh_growth", OPT_REALS, "", 0, 10, "by mesh: focus 0.1, channel 0.08,0.12, fitted 0.3",
   .help = "growth of the cell size per distance from the fine part, one value an axis", .when = GRADED},
  {"-mesh_coarsest", OPT_REALS, "", OPT_FROM(1), "by mesh: 8, channel 8,2", .help = "largest cell size over that of the fine part, one value an axis",
   .when = GRADED},
  {"-mesh_stretch", OPT_REALS, "", 0, 6, "0",
   .help =
     "cells gather at both ends of an axis, at walls: lines at tanh(s eta)/tanh(s), s one value an axis (2: the outermost a fifth of equal ones)",
   .when = BOX " and without -mesh_focus"},
  {"-mesh_shift_seed", OPT_INT, "", 0, 1000000000, "0",
   .help = "moves the fine part of the mesh by a random fraction of its cell size, another for each number; 0 for none",
   .when = "-mesh_focus, or -mesh_kind channel"},
  {"-mesh_resolution", OPT_INT, "", 1, 10000, "by mesh: channel 10, fitted 16, others 4",
   .help = "cells along the diameter (channel, from 2 on) or a quarter (fitted, from 2 on; others) of the circle, of a great circle of a sphere",
   .when = "-mesh_kind channel, fitted, disc, annulus, tube, ball or shell"},
  {"-mesh_ring_ratio", OPT_REAL, "", 0.01, 100, "by mesh: fitted 3, others 1",
   .help = "thickness of the outermost ring of cells around the centre over that of the innermost", .when = "-mesh_kind fitted, tube, ball or shell"},
  {"-mesh_length", OPT_REAL, "length", OPT_ABOVE_ZERO, "1", .help = "length of the tube, along z from 0 on", .when = "-mesh_kind tube"},
  {"-mesh_layers", OPT_INT, "", 1, 100000, "by mesh: tube about as thick as long, fitted twice as thick as cells beside the cylinder",
   .help = "layers of cells along z", .when = LAYERED},
  {"-mesh_layer_ratio", OPT_REAL, "", 0.01, 100, "1", .help = "thickness of the layer in the middle over that of those at the ends", .when = LAYERED},
  {"-mesh_centre", OPT_REALS, "length", OPT_ANY, "by mesh: 0, fitted 0.2,0.2", .help = "centre of the circles, spheres or the cylinder",
   .when = "-mesh_kind disc, annulus, fitted, tube, ball or shell"},
  {"-mesh_radius", OPT_REAL, "length", OPT_ABOVE_ZERO, "by mesh: fitted 0.05, others 1", .help = "radius of the disc, tube, ball or cylinder",
   .when = "-mesh_kind disc, fitted, tube or ball"},
  {"-mesh_radii", OPT_REALS, "length", OPT_ABOVE_ZERO, "1,2", .help = "radii of the inner and the outer circle or sphere",
   .when = "-mesh_kind annulus or shell"},
  {"-mesh_file", OPT_STRING, "", OPT_ANY, "", .help = "Gmsh file of quadrilaterals or hexahedra", .when = "-mesh_kind file", .path = OPT_PATH},
  {"-mesh_round_<boundary>", OPT_REALS, "length", OPT_ANY, "", .help = "the boundary is this circle: centre x, y and radius",
   .when = "-mesh_kind file"},
  {"-mesh_levels", OPT_INT, "", 0, 12, "0", .help = "how often cells are halved where -mesh_refine asks for it", .when = LEVELED},
  {"-mesh_refine", OPT_STRINGS, "", OPT_ANY, "bodies", .help = "where: around bodies, by an expression, and in boxes of these names",
   .when = "-mesh_levels"},
  {"-mesh_band", OPT_REAL, "", 0.7, 1000, "3", .help = "a cell is halved whose centre is closer to a surface than this many of its sides",
   .when = "-mesh_levels"},
  {"-mesh_distance", OPT_REALS, "length", OPT_ANY, "",
   .help = "distance of a place to what is to be fine, negative inside: a formula that changes by at most the way", .when = "-mesh_refine expression",
   .variables = "x, y, z"},
  {"-mesh_box_<box>_corners", OPT_REALS, "length", OPT_ANY, "", .help = "lower, then upper corner of a box that -mesh_refine names",
   .when = "-mesh_levels"},
  {"-mesh_box_<box>_group", OPT_STRING, "", OPT_ANY, "",
   .help = "the box goes with every body of this group: its corners are measured from the body's centre", .when = "-mesh_levels"},
  {"-mesh_box_<box>_along", OPT_CHOICE, "", OPT_ANY, "axes", .help = "x axis of the box: that of the domain, or against the velocity of the body",
   .choices = "axes, motion", .when = "-mesh_box_<box>_group"},
  {"-mesh_box_<box>_levels", OPT_INT, "", 1, 12, "by mesh: -mesh_levels", .help = "how often the cells in it are halved", .when = "-mesh_levels"},
  {"-mesh_order", OPT_CHOICE, "", OPT_ANY, "natural", .help = "order of cells and nodes in memory (rcm helps meshes from files)",
   .choices = "natural, rcm", .expert = PETSC_TRUE},
};
OPT_TABLE("mesh: domain and cells", SPECS)
