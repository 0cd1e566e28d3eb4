/* Scalars, points of a cell at which terms of the balance are summed, and its nodal values. */
#include "compat.h"
#include "impl.h"

PetscErrorCode ScalarCellPoints(Scalars all, const Scalar *s, PetscInt c, ScalarPoints *p)
{
  const PetscInt sample = s->cells.sample ? s->cells.sample[c] : -1;

  PetscFunctionBeginUser;
  p->sample   = sample >= 0 ? s->cells.samples + sample : NULL;
  p->n        = p->sample ? PetscPowInt(p->sample->n, all->loc->dim) : all->element.nq;
  p->capacity = !ScalarCellIsActive(s, c) ? 0 : s->cells.capacity ? s->cells.capacity[c] : s->par.capacity;
  if (p->sample) PetscCall(ScalarCellCoordinates(all, c, p->xc));
  else PetscCall(ScalarCellMetric(all, c, &p->m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCellPoint(Scalars all, const ScalarPoints *p, PetscInt q, ScalarPoint *at)
{
  const PetscInt nb = all->loc->nb;
  PetscReal      g[3][ELEMENT_MAX_NBP];

  PetscFunctionBeginUser;
  at->capacity = p->sample ? p->sample->capacity[q] : p->capacity;
  if (p->sample) {
    at->weight = ScalarSampleBasis(all, p->sample->n, q, p->xc, at->phi, at->g);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  at->weight = p->m.weight[q];
  PetscCall(PetscArraycpy(at->phi, all->element.phi + q * all->element.nbp, nb));
  ElementGradients(&all->element, &p->m, q, g);
  for (PetscInt a = 0; a < all->loc->dim; a++) PetscCall(PetscArraycpy(at->g[a], g[a], nb));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCellValues(Scalars all, const Scalar *s, PetscInt c, ScalarValues *v)
{
  const MeshLocal  *l = all->loc;
  const ScalarStep *p = &all->step;

  PetscFunctionBeginUser;
  MeshCellValues(l, c, 1, s->x, v->x);
  MeshCellValues(l, c, 1, s->T, v->now);
  MeshCellValues(l, c, 1, s->T_old, v->old);
  PetscCall(ScalarCellLinear(all, s, c, v->linear));
  for (PetscInt j = 0; j < l->nb; j++) v->theta[j] = p->theta * v->x[j] + (1 - p->theta) * v->now[j] + v->linear[j];
  v->convects = (PetscBool)(s->w != NULL);
  if (s->w) MeshCellValues(l, c, l->dim, s->w, v->w);
  PetscFunctionReturn(PETSC_SUCCESS);
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
