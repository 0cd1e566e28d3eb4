/* ElasticInertia: inertia and weight of the elastic solids that the flow's mesh follows, over the flow's cells inside
   of them, with the flow's own quadrature: int rho (c_t u - d(u_s) - g) . phi_i, u_s the velocity of the material at
   the point. A uniform acceleration and the weight are then gradients to the last digit, which the pressure takes;
   summed over the nodes of the solid's mesh they would push at the scale of cells with a third of their size. rho is
   that of the solid, of a compressible one over J. */
#pragma once
#include "fem/element.h"
#include "solid/solid.h"
#include "couple/couple.h"

typedef struct {
  ElementTables tables;
  PetscInt      n, capacity;
  PetscInt     *cell, *solid;   /* [n] local cells, and whose */
  PetscReal    *matrix, *force; /* [n][nb][nb] c_t rho int phi_i phi_j, [n][nb][dim] of own cells: the rest */
  PetscReal    *nodal;          /* [nnode_all][dim] sum of `force` */
} ElasticInertia;

PetscErrorCode ElasticInertiaCreate(const MeshLocal *, ElasticInertia *);
PetscErrorCode ElasticInertiaDestroy(ElasticInertia *);
/* Of the step, solids at x [nnode][dim], in cells of cell_solid [ncell_all] (-1: fluid); given to the flow under the
   address of ElasticInertia. lumped [nnode_all] += c_t rho int phi_i, own nodes, the part of own cells. Not
   collective. */
PetscErrorCode ElasticInertiaAssemble(ElasticInertia *, Flow, const FlowStep *, const SolidsState *,
                                      const PetscReal x[], const PetscInt cell_solid[], PetscReal lumped[]);
/* push [solids][dim] += what it exerts on the flow whose velocity is u [nnode_all][dim], own cells. Not collective. */
void ElasticInertiaAddForce(const ElasticInertia *, const MeshLocal *, const PetscReal u[], PetscReal push[]);
/* Power, against velocity u, of what stands for own cells: *terms by their matrices, *force by the other side; flux
   [dim] = int u over them. Not collective. */
PetscErrorCode ElasticInertiaPower(const ElasticInertia *, Mesh, const MeshLocal *, const PetscReal u[],
                                   PetscReal *terms, PetscReal *force, PetscReal flux[]);
/* whole [nb]: the integrals over a cell of the functions of its nodes. Not collective. */
PetscErrorCode ElasticIntegrateCell(const ElementTables *, Mesh, const MeshLocal *, PetscInt cell, PetscReal whole[]);
