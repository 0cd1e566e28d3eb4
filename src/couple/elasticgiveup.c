/* Elastic, give up: where the mesh was lined up with a solid and is no more, the fluid inside counts again. Its old
   velocities there are those of the material: cells inside a solid that is followed have no inertia of the flow, and
   nodes in them keep of the step before last, or take from the fluid beside, what is not the solid's (elastic.h). */
#include "compat.h"
#include "elastic.h"
#include "impl.h"
#include "fem/element.h"

#define ROUNDING 1e-9 /* of the half-width of a solid's cell */

/* u [2] [nnode_all][dim], now and a step before, at own nodes inside solid k where it is */
static PetscErrorCode take_material(const SolidsState *s, const MeshLocal *l, PetscInt k, PetscReal *const u[2])
{
  const SolidMesh       *m   = &s->group[s->group_of[k]].mesh;
  const PetscInt         dim = l->dim, first = dim * s->first[k];
  const PetscReal *const of[] = {s->u + first, s->u_old + first};
  PetscReal              centre[3], x[3], xi[3], far, phi[ELEMENT_MAX_NB], dphi[3 * ELEMENT_MAX_NB];
  PointCells             cells;

  PetscFunctionBeginUser;
  (void)SolidFindVolume(m, s->x + first, centre);
  PetscCall(PointCellsCreateOf(dim, m->ncell, m->cell_node, s->x + first, ROUNDING, &cells));
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscInt cell;

    for (PetscInt a = 0; a < dim; a++) x[a] = centre[a] + MeshNearest(l, a, l->x[dim * i + a] - centre[a]);
    PetscCall(PointCellsFind(cells, x, &cell, xi, &far));
    if (cell < 0) continue;
    ElementBasis(dim, xi, phi, dphi);
    for (PetscInt e = 0; e < 2 * dim; e++) {
      PetscReal *to = u[e / dim] + dim * i + e % dim;

      *to = 0;
      for (PetscInt j = 0; j < m->nb; j++) *to += phi[j] * of[e / dim][dim * m->cell_node[cell * m->nb + j] + e % dim];
    }
  }
  PetscCall(PointCellsDestroy(&cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticGiveUp(const Elastic *e, Couple c)
{
  const SolidsState *s   = e->s;
  PetscBool          any = PETSC_FALSE;
  PetscReal         *u[2];

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &u[0], &u[1], NULL));
  for (PetscInt k = 0; k < s->n; k++) {
    if (!e->labels.left[k] || s->group[s->group_of[k]].membrane) continue;
    PetscCall(take_material(s, c->loc, k, u));
    any = PETSC_TRUE;
  }
  for (PetscInt i = 0; i < 2 && any; i++) PetscCall(MeshSyncNodes(c->mesh, s->dim, u[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}
