/* Hang, construction: see mesh/hang.h. A cell is told by its place in its parent and by what hangs: bit a of `child`:
   it is in the upper half along axis a; bit a of `face`: the face across axis a that lies on the surface of the
   parent belongs to a larger cell; bit a of `edge`: so does the edge along axis a that lies on an edge of the parent
   (space only; edges of faces that hang are included by themselves). */
#pragma once
#include "mesh/hang.h"

#define HANG_CODE(child, face, edge) ((child) | (face) << 3 | (edge) << 6)

/* Is slot j of a cell with this code a node of the parent along axis a? Its coordinate then counts in steps of the
   parent from the corner that cell and parent share. Always at index 0 from that corner, where it means nothing. */
PetscBool HangStretched(PetscInt dim, PetscInt code, PetscInt j, PetscInt a);
void      HangCreate(PetscInt dim, PetscInt code, MeshHang *);
