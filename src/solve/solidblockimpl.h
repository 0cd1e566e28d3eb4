/* SolidBlock: its struct, for solidblock.c and solidcycle.c. */
#pragma once
#include "solidblock.h"

struct _p_SolidBlock {
  KSP        nodes, cells; /* factors of A of the block; of [X, -B^T; B, 0] around it */
  IS         in_nodes;     /* slots of u_r in the block */
  VecScatter to_nodes, to_cells;
  Vec        x, y;       /* of the block */
  Vec        f, g;       /* of the cells around it: velocities and pressures together */
  Vec        u[2], p[3]; /* work */
  Mat        S_p;
  PC         pc[2], inner[2]; /* of the inner solvers: ours, theirs */
};
