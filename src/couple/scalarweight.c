/* ScalarWeight: see scalarweight.h. */
#include "compat.h"
#include "impl.h"
#include "scalarweight.h"
#include "bodies/local.h"

#define NUMBERS 3

PetscErrorCode ScalarWeightCreate(Couple c, PetscInt n, const ScalarMaterial *material, ScalarWeight *w)
{
  PetscBool any = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < c->s->ngroups * n; e++) any = (PetscBool)(any || material[e].expansion != 0);
  *w = (ScalarWeight){any ? n : 0, material, NULL};
  if (any) PetscCall(BodiesAttach(c->bodies, sizeof(PetscReal) * NUMBERS * (size_t)n, (void **)&w->last));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarWeightDestroy(Couple c, ScalarWeight *w)
{
  PetscFunctionBeginUser;
  if (w->n) PetscCall(BodiesDetach(c->bodies, (void **)&w->last));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarWeightBegin(ScalarWeight *w, Couple c, PetscReal extrapolation)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n && w->n; k++) {
    PetscReal less = 0;

    for (PetscInt i = 0; i < w->n; i++) {
      const ScalarMaterial *m    = w->material + c->s->body_group[k] * w->n + i;
      const PetscReal      *last = w->last + (k * w->n + i) * NUMBERS;
      const PetscReal T = last[0] == 0 ? m->initial : last[1] + (last[0] > 1 ? extrapolation : 0) * (last[1] - last[2]);

      less += m->expansion * (T - m->reference);
    }
    PetscCall(BodiesSetLighter(c->bodies, k, less * c->s->density[k]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* volume [nnode_all] that nodes stand for, of own cells */
static PetscErrorCode find_volumes(Couple c, Scalars scalars, PetscReal volume[])
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < l->ncell; e++) {
    PetscReal each[MESH_MAX_NB];

    PetscCall(ScalarsIntegrateBasis(scalars, e, each));
    MeshCellScatter(l, e, 1, each);
    for (PetscInt j = 0; j < l->nb; j++) volume[l->cell_node[e * l->nb + j]] += each[j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* sum [nbodies][n + 1]: over the nodes inside, of all ranks, of their values and of 1 */
static PetscErrorCode sum_nodes(const ScalarWeight *w, Couple c, Scalars scalars, PetscReal sum[])
{
  PetscReal *volume, *T;
  PetscInt  *body;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->loc->nnode_all, &body));
  PetscCall(PetscCalloc1(c->loc->nnode_all, &volume));
  PetscCall(CoupleMarkInside(c, body));
  PetscCall(find_volumes(c, scalars, volume));
  for (PetscInt i = 0; i <= w->n; i++) {
    if (i < w->n) PetscCall(ScalarsGetSolution(scalars, i, &T));
    for (PetscInt e = 0; e < c->loc->nnode_all; e++)
      if (body[e] >= 0) sum[body[e] * (w->n + 1) + i] += volume[e] * (i < w->n ? T[e] : 1);
  }
  PetscCall(BodiesSumLocal(c->bodies, w->n + 1, sum));
  PetscCall(PetscFree(volume));
  PetscCall(PetscFree(body));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarWeightAccept(ScalarWeight *w, Couple c, Scalars scalars)
{
  PetscReal *sum;

  PetscFunctionBeginUser;
  if (!w->n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(c->s->n * (w->n + 1), &sum));
  PetscCall(sum_nodes(w, c, scalars, sum));
  for (PetscInt e = 0; e < c->s->n * w->n; e++) {
    const PetscInt        k = e / w->n, i = e % w->n;
    const ScalarMaterial *m    = w->material + c->s->body_group[k] * w->n + i;
    const PetscReal       all  = sum[k * (w->n + 1) + w->n];
    PetscReal            *last = w->last + e * NUMBERS;
    const PetscReal       now  = last[0] == 0 ? m->initial : last[1];

    last[2] = now;
    last[1] = m->condition == SCALAR_BODY_VALUE ? m->value : all > 0 ? sum[k * (w->n + 1) + i] / all : now;
    last[0] = 2;
  }
  PetscCall(PetscFree(sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarWeightVisit(ScalarWeight *w, Couple c, State state)
{
  PetscFunctionBeginUser;
  if (!w->n) PetscFunctionReturn(PETSC_SUCCESS);
  /* after a run without they begin anew */
  PetscCall(BodiesVisitOptional(c->bodies, state, "body_weight", NUMBERS * w->n, w->last));
  PetscFunctionReturn(PETSC_SUCCESS);
}
