/* ElasticTensions: see elastictension.h. */
#include "compat.h"
#include "elastic.h"
#include "impl.h"

#define STUCK \
  "The tension that holds the area of a membrane does not move it, or the wrong way: it is nearly round, or it buckles: use a shorter step (-sim_dt), a smaller -particle_<group>_global_area_modulus or more -particle_<group>_bending"

PetscErrorCode ElasticTensionsCreate(Elastic *e)
{
  ElasticTensions *t = &e->tensions;

  PetscFunctionBeginUser;
  *t = (ElasticTensions){.n = SolidsCountGlobalAreas(e->solids)};
  if (!t->n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc2(t->n, &t->solid, t->n, &t->row));
  PetscCall(PetscCalloc2(e->s->nnode * e->s->dim, &t->l, e->s->n, &t->tension));
  for (PetscInt k = 0, i = 0; k < e->s->n; k++) {
    if (!(e->s->group[e->s->group_of[k]].material.global > 0)) continue;
    t->solid[i] = k;
    t->row[i++] = (FlowIntegral){.stuck = STUCK};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticTensionsMakeOnMesh(Elastic *e, Couple c)
{
  ElasticTensions *t   = &e->tensions;
  const PetscInt   all = c->loc->nnode * c->loc->dim;

  PetscFunctionBeginUser;
  if (!t->n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(t->n * all, &t->weight));
  for (PetscInt i = 0; i < t->n; i++) t->row[i].nodal = t->weight + i * all;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticTensionsConnect(Couple c, void *elastic, FlowSolver solver)
{
  const ElasticTensions *t = &((Elastic *)elastic)->tensions;

  PetscFunctionBeginUser;
  (void)c;
  if (t->n) PetscCall(FlowSolverAddIntegrals(solver, t->n, t->row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticTensionsDiscard(Elastic *e)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(e->tensions.weight));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticTensionsDestroy(Elastic *e)
{
  PetscFunctionBeginUser;
  PetscCall(ElasticTensionsDiscard(e));
  PetscCall(PetscFree2(e->tensions.solid, e->tensions.row));
  PetscCall(PetscFree2(e->tensions.l, e->tensions.tension));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own rows of solid k in the vectors of all, from where to where */
static void find_rows(const Elastic *e, PetscInt k, PetscInt rows[2])
{
  const PetscInt dim = e->s->dim;

  rows[0] = dim * PetscMax(e->nodes[0], e->s->first[k]);
  rows[1] = dim * PetscMin(e->nodes[1], e->s->first[k + 1]);
}

/* P^T l of solid k; work: a vector like us */
static PetscErrorCode find_weights(Elastic *e, Couple c, PetscInt k, Vec work, PetscReal weight[])
{
  PetscInt   rows[2];
  PetscReal *v;
  Vec        of_flow;

  PetscFunctionBeginUser;
  find_rows(e, k, rows);
  PetscCall(VecZeroEntries(work));
  PetscCall(VecGetArray(work, &v));
  for (PetscInt i = rows[0]; i < rows[1]; i++) v[i - e->s->dim * e->nodes[0]] = e->tensions.l[i];
  PetscCall(VecRestoreArray(work, &v));
  PetscCall(
    VecCreateMPIWithArray(c->comm, c->loc->dim, c->loc->nnode * c->loc->dim, PETSC_DETERMINE, weight, &of_flow));
  PetscCall(MatMultTranspose(e->P, work, of_flow));
  PetscCall(VecDestroy(&of_flow));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticTensionsSet(Elastic *e, Couple c)
{
  ElasticTensions *t = &e->tensions;
  Vec              work;

  PetscFunctionBeginUser;
  if (!t->n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecDuplicate(e->us, &work));
  for (PetscInt i = 0; i < t->n; i++) {
    const PetscInt    k = t->solid[i], first = e->s->dim * e->s->first[k], end = e->s->dim * e->s->first[k + 1];
    const SolidGroup *g    = e->s->group + e->s->group_of[k];
    const PetscReal   give = g->mesh.area / g->material.global;
    PetscReal         area = SolidFindArea(&g->mesh, e->x + first, t->l + first);

    for (PetscInt j = first; j < end; j++) area += t->l[j] * (e->a[j] - e->x[j]);
    t->row[i].target = c->step->ct * (g->mesh.area - area + give * e->s->tension[k]);
    t->row[i].give   = c->step->ct * give;
    PetscCall(find_weights(e, c, k, work, t->weight + i * c->loc->nnode * c->loc->dim));
  }
  PetscCall(VecDestroy(&work));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticTensionsTake(Elastic *e, Couple c)
{
  ElasticTensions *t   = &e->tensions;
  const PetscInt   all = c->loc->nnode * c->loc->dim;
  PetscReal       *fs;

  PetscFunctionBeginUser;
  if (!t->n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecGetArray(e->fs, &fs));
  for (PetscInt i = 0; i < t->n; i++) {
    const PetscReal force = t->row[i].force;
    PetscInt        rows[2];

    find_rows(e, t->solid[i], rows);
    for (PetscInt j = rows[0]; j < rows[1]; j++) fs[j - e->s->dim * e->nodes[0]] += force * t->l[j];
    for (PetscInt j = 0; j < all; j++) e->force[j] += force * t->row[i].nodal[j];
    t->tension[t->solid[i]] = e->s->tension[t->solid[i]] - force;
  }
  PetscCall(VecRestoreArray(e->fs, &fs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal ElasticTensionsGetArea(const Elastic *e, PetscInt k)
{
  const SolidGroup *g = e->s->group + e->s->group_of[k];

  return g->material.global > 0 ? g->mesh.area * (1 + e->tensions.tension[k] / g->material.global) : 0;
}
