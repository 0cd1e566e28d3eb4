/* Lanes: own cells of the mesh side by side, as the kernels of batch.h want them. Nothing here is collective. */
#pragma once
#include "fem/batch.h"
#include "impl.h"

/* Cells of one kind in the first lanes; the others repeat the first */
typedef struct {
  PetscInt        n, cell[BATCH_LANES];
  PetscBool       box, mixed; /* mixed: things hang in different ways */
  const MeshHang *hang;       /* else in this one, or NULL: nothing does */
} LaneCells;

/* Walks over the own cells of the fluid; start with zeros */
typedef struct {
  PetscInt  at, code;
  LaneCells open[3]; /* others; boxes in which nothing hangs; boxes of ways that are left with few */
  LaneCells hanging[MESH_HANG_CODES];
} LaneWalk;

/* The next cells, of one kind in ascending order; false: there are no more */
PetscBool LanesNext(const struct _p_Flow *, LaneWalk *, LaneCells *next);
/* Most of LanesNext in a walk */
PetscInt LanesMax(const MeshLocal *);
/* n <= BATCH_LANES cells, as boxes if all are */
void           LanesTake(const struct _p_Flow *, PetscInt n, const PetscInt cells[], LaneCells *);
PetscErrorCode LanesGeometry(const struct _p_Flow *, const LaneCells *, BatchGeometry *);
/* x [nb][dim] <- sum over k < n of factor[k] v[k], nodal arrays [nnode_all][dim] */
void LanesGather(const MeshLocal *, const LaneCells *, PetscInt n, const PetscReal *const v[], const PetscReal factor[],
                 Lanes x[]);
/* v [nnode_all][bs] += x [nb][bs] */
void LanesScatter(const MeshLocal *, const LaneCells *, PetscInt bs, Lanes x[], PetscReal v[]);
/* r [nb][dim] = momentum residual without pressure of a Newtonian fluid for the step's solution u [nnode_all][dim]; u
   NULL: without the part of u, which is the right-hand side times -1 */
PetscErrorCode LanesMomentum(Flow, const LaneCells *, const PetscReal u[], Lanes r[]);

/* x [n] of the cells *= their density over that of the parameters */
void FlowScaleByDensity(const struct _p_Flow *, const LaneCells *, PetscInt n, Lanes x[]);

static inline PetscReal *Lane(Lanes v[], PetscInt k)
{
  return (PetscReal *)v + k;
}
