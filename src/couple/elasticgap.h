/* ElasticGap: elastic solids that come so close to something that no cell is left between. Nothing keeps them apart,
   solids have no contact, and the flow in such a gap is not resolved: the run ends with an error. */
#pragma once
#include "elastic.h"

/* Solids at their predicted positions, after ElasticMap, against boundaries of the mesh, other solids (periodic images
   too) and rigid bodies: every node of an outline, with the size of the cell it lies in. Nodes within two cells of
   those that are held are left out: a solid may be fixed to what it touches there. Collective. */
PetscErrorCode ElasticCheckGaps(Elastic *, Couple);
