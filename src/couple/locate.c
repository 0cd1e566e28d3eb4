/* Couple: which nodes lie in a body, and which cells in none, whatever the boundary method. */
#include "compat.h"
#include "impl.h"

PetscErrorCode CoupleMarkInside(Couple c, PetscInt body[])
{
  const PetscInt *inside, *rigid;
  Indicator       indicator;

  PetscFunctionBeginUser;
  PetscCall(IndicatorGetNodes(c->indicator, &rigid, NULL, NULL));
  PetscCall(IndicatorCreate(c->mesh, c->bodies, &indicator));
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscBool predicted = (PetscBool)(c->rigid.q[k][0] != 0 || c->rigid.q[k][1] != 0 || c->rigid.q[k][2] != 0 ||
                                            c->rigid.q[k][3] != 0);

    PetscCall(IndicatorInsideBody(indicator, k, predicted ? c->rigid.X[k] : c->s->x[k],
                                  predicted ? c->rigid.q[k] : c->s->q[k]));
  }
  PetscCall(IndicatorGetNodes(indicator, &inside, NULL, NULL));
  /* nodes that a method has put onto the surface lie there up to rounding */
  for (PetscInt i = 0; i < c->loc->nnode_all; i++) body[i] = rigid[i] >= 0 ? rigid[i] : inside[i];
  PetscCall(IndicatorDestroy(&indicator));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleMarkFluid(Couple c, PetscBool fluid[])
{
  const MeshLocal *l = c->loc;
  PetscInt        *body;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all, &body));
  PetscCall(CoupleMarkInside(c, body));
  for (PetscInt e = 0; e < l->ncell; e++) {
    fluid[e] = PETSC_TRUE;
    for (PetscInt j = 0; j < l->nb; j++) fluid[e] = (PetscBool)(fluid[e] && body[l->cell_node[e * l->nb + j]] < 0);
  }
  PetscCall(PetscFree(body));
  PetscFunctionReturn(PETSC_SUCCESS);
}
