/* ScalarStartBodies: see scalarstart.h. */
#include "compat.h"
#include "impl.h"
#include "scalarstart.h"

/* [nnode_all]: heat of a unit at the node in the fluid and in bodies with a value of their own, and that times it */
typedef struct {
  PetscReal *fluid, *body, *value;
} Weights;

/* Of local cell e with the capacity of the fluid, of which a part is of the material m (NULL: of none) */
static PetscErrorCode add_cell(Couple c, Scalars scalars, PetscInt e, const ScalarMaterial *m, PetscReal part,
                               PetscReal capacity, Weights *w)
{
  const MeshLocal *l      = c->loc;
  const PetscBool  starts = (PetscBool)(m && m->starts && m->condition == SCALAR_BODY_CONJUGATE);
  PetscReal        inside[MESH_MAX_NB], all[MESH_MAX_NB], value[MESH_MAX_NB];

  PetscFunctionBeginUser;
  PetscCall(ScalarsIntegrateBasis(scalars, e, all));
  for (PetscInt j = 0; j < l->nb; j++) {
    inside[j] = m ? part * all[j] : 0; /* its own integral over a part could be below zero */
    all[j]    = (all[j] - inside[j]) * capacity + (starts ? 0 : inside[j] * (m ? m->capacity : 0));
    inside[j] = starts ? inside[j] * m->capacity : 0;
    value[j]  = starts ? inside[j] * m->initial : 0;
  }
  MeshCellScatter(l, e, 1, all);
  MeshCellScatter(l, e, 1, inside);
  MeshCellScatter(l, e, 1, value);
  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscInt i = l->cell_node[e * l->nb + j];

    w->fluid[i] += all[j];
    w->body[i] += inside[j];
    w->value[i] += value[j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarStartInside(Couple c, Scalars scalars, PetscInt i, const ScalarMaterial *const material[],
                                 const PetscReal inside[], PetscReal T[])
{
  const PetscInt          n = c->loc->nnode_all;
  const ScalarParameters *par;
  Weights                 w;

  PetscFunctionBeginUser;
  PetscCall(ScalarsGetParameters(scalars, i, &par));
  PetscCall(PetscCalloc3(n, &w.fluid, n, &w.body, n, &w.value));
  for (PetscInt e = 0; e < c->loc->ncell_all; e++)
    PetscCall(add_cell(c, scalars, e, material[e], inside[e], par->capacity, &w));
  for (PetscInt k = 0; k < c->loc->nnode; k++)
    if (w.body[k] > 0) T[k] = (w.value[k] + w.fluid[k] * T[k]) / (w.body[k] + w.fluid[k]);
  PetscCall(MeshSyncNodes(c->mesh, 1, T));
  PetscCall(PetscFree3(w.fluid, w.body, w.value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarStartBodies(Couple c, Scalars scalars, PetscInt i, const ScalarCover *cover,
                                 const ScalarMaterial *material, PetscReal T[])
{
  const PetscInt         n = c->loc->ncell_all;
  const ScalarMaterial **of;
  PetscReal             *inside;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(n, &of, n, &inside));
  for (const CoveredCell *at = cover->covered; at < cover->covered + cover->n; at++) {
    if (!at->first) continue;
    of[at->cell]     = material + c->s->body_group[at->body] * ScalarsCount(scalars) + i;
    inside[at->cell] = at->inside;
  }
  PetscCall(ScalarStartInside(c, scalars, i, of, inside, T));
  PetscCall(PetscFree2(of, inside));
  PetscFunctionReturn(PETSC_SUCCESS);
}
