/* Feet: see feet.h. */
#include "compat.h"
#include "feet.h"
#include "scalarfields.h"

#define NEAR 3 /* cells: chi is 1 */

/* Where the nodes will be, all */
static PetscErrorCode new_places(const MeshLocal *l, const AlignResult *r, PetscReal x[])
{
  const PetscInt dim = l->dim;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(x, l->x, dim * l->nnode_all));
  for (PetscInt e = 0; e < r->nnode; e++)
    for (PetscInt a = 0; a < dim; a++) x[dim * r->node[e] + a] = r->x[dim * e + a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal weight_at(const FeetMesh *m, const PetscReal x[])
{
  const PetscReal d = (*m->distance)(m->ctx, m->loc, x);

  return PetscMax(0, PetscMin(1, (FEET_FAR - d / m->loc->h) / (FEET_FAR - NEAR)));
}

/* Does node i move, or did it in the step before? */
static PetscBool is_moved(const FeetMesh *m, const PetscReal x[], PetscInt i)
{
  for (PetscInt a = m->loc->dim * i; a < m->loc->dim * (i + 1); a++)
    if (m->loc->x[a] != x[a] || m->shift[a] != 0) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* Of t->value */
static PetscErrorCode find_velocity(const FeetMesh *m, const FlowStep *s, const Feet *t)
{
  const PetscInt dim = m->loc->dim, n = dim * m->loc->nnode_all;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(m->velocity, n));
  PetscCall(PetscArrayzero(m->shift, n));
  for (PetscInt e = 0; e < t->n; e++)
    for (PetscInt a = 0; a < dim; a++) {
      const PetscReal *v   = t->value + t->width * e + a;
      const PetscReal  now = v[0], before = now + v[t->width - dim];

      m->shift[dim * t->node[e] + a]    = now;
      m->velocity[dim * t->node[e] + a] = s->d0 * now + s->d1 * before;
    }
  PetscCall(MeshSyncNodes(m->mesh, dim, m->velocity));
  PetscCall(MeshSyncNodes(m->mesh, dim, m->shift));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of t->value, behind nfield fields */
static PetscErrorCode set_scalars(const FeetMesh *m, PetscInt nfield, const Feet *t)
{
  const PetscInt dim = m->loc->dim;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < t->n; e++) {
    const PetscReal *v = t->value + t->width * e;

    PetscCall(ScalarFieldsSet(m->scalars, dim, t->node[e], v, v + (1 + nfield) * dim));
  }
  PetscCall(ScalarFieldsSync(m->scalars, m->mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FeetFind(const FeetMesh *m, const FlowStep *s, const AlignResult *r, PetscInt nfield,
                        const PetscReal *const field[], Feet *t)
{
  const MeshLocal  *l   = m->loc;
  const PetscInt    dim = l->dim, nscalar = m->scalars ? ScalarsCount(m->scalars) : 0, nall = nfield + nscalar + 1;
  const PetscReal **all;
  PetscReal        *x, *at, *chi, **scalar;

  PetscFunctionBeginUser;
  *t = (Feet){.width = (1 + nall) * dim};
  PetscCall(PetscMalloc5(dim * l->nnode_all, &x, dim * l->nnode, &at, l->nnode, &chi, nall, &all, nscalar, &scalar));
  PetscCall(PetscMalloc1(l->nnode, &t->node));
  PetscCall(new_places(l, r, x));
  for (PetscInt i = 0; i < l->nnode; i++) {
    chi[t->n] = weight_at(m, x + dim * i);
    if (chi[t->n] == 0 && !is_moved(m, x, i)) continue;
    t->node[t->n] = i;
    PetscCall(PetscArraycpy(at + dim * t->n, x + dim * i, dim));
    t->n++;
  }
  if (nscalar) PetscCall(ScalarFieldsPack(m->scalars, l, scalar));
  for (PetscInt i = 0; i < nall; i++)
    all[i] = i < nfield ? field[i] : i < nall - 1 ? scalar[i - nfield] : m->shift; /* the shift last: find_velocity */
  PetscCall(PetscMalloc1(t->width * t->n, &t->value));
  PetscCall(RemapEvaluateFeet(m->remap, t->n, t->node, at, m->way, chi, nall, all, t->value));
  PetscCall(find_velocity(m, s, t));
  if (nscalar) PetscCall(set_scalars(m, nfield, t));
  for (PetscInt i = 0; i < nscalar; i++) PetscCall(PetscFree(scalar[i]));
  PetscCall(PetscFree5(x, at, chi, all, scalar));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FeetDestroy(Feet *t)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(t->node));
  PetscCall(PetscFree(t->value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FeetPredict(Flow flow, const FlowStep *s, PetscBool first_order, PetscInt n, PetscReal way[])
{
  const PetscReal r = first_order || s->dt_old <= 0 ? 0 : 0.5 * s->dt / s->dt_old;
  PetscReal      *u, *u_old;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(flow, &u, &u_old, NULL));
  for (PetscInt i = 0; i < n; i++) way[i] = s->dt * (u[i] + r * (u[i] - u_old[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}
