/* Projection: a field at the quadrature points of the cells becomes one at the nodes, P, by the lumped mass of the
   element; and the velocity gradient at the nodes that is made so, with what is known of it on surfaces.

   The measure of a cell is that of the reference cell times its volume. With its own one the lumped mass of a node at a
   corner that is nearly flat, as on surfaces in space, is next to nothing, or negative.

   At the surface of a body whose cells are no part of the fluid P(grad u) keeps what is sheared across the surface.
   Along it the gradient is that of the surface's own nodes, and the stretch across follows from div u = 0. Particles
   there never leave, so that the least error of these lets their conformation grow or relax exponentially
   (runs/studies/rheology; at walls of the mesh, whose cells are regular, P is right enough). */
#pragma once
#include "fem/element.h"

typedef struct _p_Flow *Flow;

typedef struct {
  Flow       f;
  PetscReal *mass;   /* [nnode_all] lumped */
  PetscReal *normal; /* [nnode_all][dim] of unit length at surfaces of bodies, else 0 */
} Projection;

/* Collective. The flow is borrowed. */
PetscErrorCode ProjectionCreate(Flow, Projection *);
PetscErrorCode ProjectionDestroy(Projection *);
/* Masses and normals of the cells as they are now. Collective. */
PetscErrorCode ProjectionUpdate(Projection *);
/* Metric of cell c with the weights of the projection. Local. */
PetscErrorCode ProjectionMetric(const Projection *, PetscInt c, ElementMetric *);
/* r [nnode_all][bs], summed with these weights and the basis over cells own and ghost, becomes its projection: complete
   at own nodes, synced. Collective. */
PetscErrorCode ProjectionFinish(const Projection *, PetscInt bs, PetscReal r[]);
/* grad [nnode_all][dim*dim] of the velocity u [nnode_all][dim], synced. Collective. */
PetscErrorCode ProjectionGradient(const Projection *, const PetscReal u[], PetscReal grad[]);
/* Is local node i one of the surface of a body? */
PetscBool ProjectionIsSurface(const Projection *, PetscInt i);

/* Values rl [nb][bs] at the lattice points of cell c, added to a nodal field [nnode_all][bs] */
static inline void ProjectionScatter(const MeshLocal *l, PetscInt c, PetscInt bs, PetscReal rl[], PetscReal r[])
{
  MeshCellScatter(l, c, bs, rl);
  for (PetscInt j = 0; j < l->nb; j++)
    for (PetscInt k = 0; k < bs; k++) r[l->cell_node[c * l->nb + j] * bs + k] += rl[j * bs + k];
}
