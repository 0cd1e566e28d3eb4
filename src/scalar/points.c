/* Scalars, points of a cell at which terms of the balance are summed, and its nodal values. */
#include "compat.h"
#include "impl.h"

PetscErrorCode ScalarCellPoints(Scalars all, const Scalar *s, PetscInt c, const PetscReal xc[], ScalarPoints *p)
{
  const PetscInt sample = s->cells.sample ? s->cells.sample[c] : -1;

  PetscFunctionBeginUser;
  p->sample   = sample >= 0 ? s->cells.samples + sample : NULL;
  p->n        = p->sample ? PetscPowInt(p->sample->n, all->loc->dim) : all->element.nq;
  p->capacity = !ScalarCellIsActive(s, c) ? 0 : s->cells.capacity ? s->cells.capacity[c] : s->par.capacity;
  if (!p->sample) PetscCall(ScalarCellMetric(all, xc, &p->m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCellPoint(Scalars all, const ScalarPoints *p, PetscInt q, const PetscReal xc[], ScalarPoint *at)
{
  const PetscInt nb = all->loc->nb;
  PetscReal      g[3][ELEMENT_MAX_NBP];

  PetscFunctionBeginUser;
  at->capacity = p->sample ? p->sample->capacity[q] : p->capacity;
  if (p->sample) {
    at->weight = ScalarSampleBasis(all, p->sample->n, q, xc, at->phi, at->g);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  at->weight = p->m.weight[q];
  PetscCall(PetscArraycpy(at->phi, all->element.phi + q * all->element.nbp, nb));
  ElementGradients(&all->element, &p->m, q, g);
  for (PetscInt a = 0; a < all->loc->dim; a++) PetscCall(PetscArraycpy(at->g[a], g[a], nb));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ScalarCellValues(Scalars all, const Scalar *s, PetscInt c, const PetscReal xc[], ScalarValues *v)
{
  const MeshLocal  *l = all->loc;
  const ScalarStep *p = &all->step;

  ScalarCellGather(l, c, 1, s->x, v->x);
  ScalarCellGather(l, c, 1, s->T, v->now);
  ScalarCellGather(l, c, 1, s->T_old, v->old);
  for (PetscInt j = 0; j < l->nb; j++) {
    v->linear[j] = 0;
    for (PetscInt a = 0; a < l->dim; a++) v->linear[j] += s->par.gradient[a] * xc[j * l->dim + a];
    v->theta[j] = p->theta * v->x[j] + (1 - p->theta) * v->now[j] + v->linear[j];
  }
  v->convects = (PetscBool)(s->w != NULL);
  if (s->w) ScalarCellGather(l, c, l->dim, s->w, v->w);
}

PetscReal ScalarConvected(PetscInt dim, PetscInt nb, const ScalarPoint *p, const ScalarValues *v)
{
  PetscReal along = 0;

  for (PetscInt a = 0; a < dim && v->convects; a++) {
    PetscReal w = 0, slope = 0;

    for (PetscInt j = 0; j < nb; j++) {
      w += p->phi[j] * v->w[j * dim + a];
      slope += p->g[a][j] * v->theta[j];
    }
    along += w * slope;
  }
  return along;
}
