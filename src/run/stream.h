/* Stream: the fastest flow that a scene gives, and the boundary layer of bodies that are held in it.

   What boundaries prescribe (inflow, moving wall; formulas at their nodes, over the time of the run) is the stream.
   Where they prescribe none it is the mean velocity in the sections that bodies leave, were they a square array: that
   of -flow_rate, or the one that -flow_force or the pressures of openings can keep up against the drag of the held
   bodies (slow: cells of Kuwabara 1959 and Happel 1958; beyond that a drag coefficient) and the friction of the box's
   walls, but no more than the impulse of the force gives from rest. Forces whose mean over the box is zero drive
   nothing here.

   The layer of a body of size d is d / sqrt(Re) = sqrt(d nu / U) thick. What lies along the stream has a layer that
   grows over the length of its thick part: the lines across it that are at least FRACTION as wide as the widest (an
   airfoil at no incidence; of a cylinder with a flag the cylinder alone, which its layer leaves). Where the
   stream goes around edges, the body being seen twice as wide as it is thick or more, they are as fine as it is thick
   (an ellipse at 45 degrees: .9 % off with a layer of .7 cells by its thickness, .02 % with 1.4, lined up). Between
   these in proportion. A disc has its diameter. Edges too sharp for a mesh to be lined up with are told apart: those
   that point along the stream, and those that do not, of a body with lift, whose size is its thickness. */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"

typedef struct {
  PetscReal speed, direction[3]; /* unit vector; speed 0: there is none, or none is known */
} Stream;

/* Of a body, in the plane: it looks the same from both sides of the stream; not so, it has lift; an edge too sharp for
   a mesh to be lined up with, along the stream; at an angle to it. In the order of what layers need. */
typedef enum {
  STREAM_NO_EDGE,
  STREAM_LIFTS,
  STREAM_EDGE,
  STREAM_EDGE_LIFTS
} StreamEdge;

/* Density and viscosity of the flow, by options that stay unread. Local. */
PetscErrorCode StreamPeekFluid(PetscReal *density, PetscReal *viscosity);
/* Before there is a flow: by options, which stay unread. Collective. */
PetscErrorCode StreamFind(Mesh, Bodies, PetscBool steady, Stream *);
/* That size of body k, which this rank knows, as it is turned now, and its edge. Not collective. */
PetscErrorCode StreamMeasureBody(Bodies, PetscInt k, const PetscReal direction[3], PetscReal *size, StreamEdge *);
/* Cells in the thinnest layer of the bodies of a group (of its first ones, if they are not round) that is held in the
   stream, in meshes that are not fitted to bodies; PETSC_MAX_REAL: it has none, or nothing is known; the sharpest of
   their edges, of bodies that are free to turn without lift. Collective. */
PetscErrorCode StreamMeasureLayer(const MeshLocal *, Bodies, PetscInt group, const Stream *, PetscReal *cells,
                                  StreamEdge *);
