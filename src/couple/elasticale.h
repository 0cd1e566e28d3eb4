/* ElasticAle: the flow's mesh goes along with elastic solids that are held somewhere (-particle_<group>_clamp), with
   -couple_method aligned. A client of meshupdate.h.

   Lined up once, at the start. From then on all nodes of the cells inside a solid are points of its material (Q2
   basis of its reference mesh), and the vertices around follow so that the integral of the square of Laplace's operator
   on the displacement is least, solids included: it goes on across their surface without a kink, so that cells beside a
   beam turn with it (the biharmonic equation, Helenbrook 2003; Wick 2011). Nodes between vertices stay in the middle.
   Velocities stay with their nodes, the velocity of these is in the convection (FlowSetMeshVelocity), as for
   -mesh_deform: no label changes, nothing is interpolated. It ends when a cell folds.
   On a mesh of several levels (mesh/hang.h) the vertices are those of their own; a corner beside a larger cell stays in
   the middle of its edge.

   With bilinear functions on the mesh as it was, of which the operator is exact for a turn. The matrix is factorised
   once. Boundaries of the domain and rigid bodies stay where they are. */
#pragma once
#include "solid/solid.h"
#include "meshupdate.h"
#include "flow/flow.h"

typedef struct _p_ElasticAle *ElasticAle;

/* On the mesh as it is, lined up with the solids where they were at the start; cell_solid [ncell_all] is copied,
   node_body [nnode_all]: nodes of rigid bodies. Collective. */
PetscErrorCode ElasticAleCreate(Flow, MeshUpdate, const SolidsState *, const PetscInt cell_solid[],
                                const PetscInt node_body[], ElasticAle *);
PetscErrorCode ElasticAleDestroy(ElasticAle *);
/* The solids' nodes are predicted at x [nnode][dim]. Between FlowBeginStep and FlowAssemble. Collective. Error: a cell
   folds. */
PetscErrorCode ElasticAleUpdate(ElasticAle, const FlowStep *, const PetscReal x[]);
/* A checkpoint: where the nodes were at the last two times. Loading moves them there. Collective. */
PetscErrorCode ElasticAleVisitState(ElasticAle, State);
/* The step is accepted. */
PetscErrorCode ElasticAleAccept(ElasticAle);
