/* SolidBlock: its struct, for solidblock.c, solidbodies.c, solidcycle.c. */
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
  PetscBool *inside;          /* [nnode] own nodes of the block */
  PetscReal *with;            /* [nbodies] 1: the rigid velocities of the body are in it */
  Vec        t;               /* as u_r, NULL: no body is in it */
  PC         pc[2], inner[2]; /* of the inner solvers: ours, theirs */
};

/* Bodies with nodes in the block, which `at` [nnode_all] marks: inside, with. Collective. */
PetscErrorCode SolidBlockFindBodies(FlowSolver, const PetscReal at[]);
/* Own slots of u_r of these, from `start` on, into `slot`; returns their number. Local. */
PetscInt SolidBlockListBodies(FlowSolver, PetscInt start, PetscInt slot[]);
/* wanted [nnode] = true at own nodes that bodies in the block move, as a whole or in part. Local. */
void SolidBlockMarkMoved(FlowSolver, PetscBool wanted[]);
/* What the nodes outside of the block put into the bodies' rows of A. Collective. */
PetscErrorCode SolidBlockReduceBodies(FlowSolver, Mat A);
/* X of the slots with what ties the nodes outside to the bodies, in its place. Collective. */
PetscErrorCode SolidBlockCoupleBodies(FlowSolver, IS slots, Mat *X);
