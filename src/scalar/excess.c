/* Scalars, what bodies bring into the balance as they cover and free cells: integrals with the capacity in excess of
   the fluid's (scalar.h). Same quadrature as the matrix. */
#include "compat.h"
#include "impl.h"

/* Nodal values of a cell */
typedef struct {
  PetscReal x[MESH_MAX_NB], history[MESH_MAX_NB], theta[MESH_MAX_NB], w[MESH_MAX_NB * 3];
} Values;

static void get_values(Scalars all, const Scalar *s, PetscInt c, const PetscReal xc[], Values *v)
{
  const MeshLocal  *l = all->loc;
  const ScalarStep *p = &all->step;
  PetscReal         now[MESH_MAX_NB], old[MESH_MAX_NB];

  ScalarCellGather(l, c, 1, s->x, v->x);
  ScalarCellGather(l, c, 1, s->T, now);
  ScalarCellGather(l, c, 1, s->T_old, old);
  for (PetscInt j = 0; j < l->nb; j++) {
    v->history[j] = p->d0 * now[j] + p->d1 * old[j];
    v->theta[j]   = p->theta * v->x[j] + (1 - p->theta) * now[j];
    for (PetscInt a = 0; a < l->dim; a++) v->theta[j] += s->par.gradient[a] * xc[j * l->dim + a];
  }
  if (s->w) ScalarCellGather(l, c, l->dim, s->w, v->w);
}

/* A point of weight c' */
static void add_point(PetscInt dim, PetscInt nb, PetscReal weight, const PetscReal phi[],
                      const PetscReal g[3][MESH_MAX_NB], const Values *v, PetscBool convects, ScalarExcess *e)
{
  PetscReal x = 0, history = 0, along = 0;

  for (PetscInt j = 0; j < nb; j++) {
    x += phi[j] * v->x[j];
    history += phi[j] * v->history[j];
  }
  for (PetscInt a = 0; a < dim && convects; a++) {
    PetscReal w = 0, slope = 0;

    for (PetscInt j = 0; j < nb; j++) {
      w += phi[j] * v->w[j * dim + a];
      slope += g[a][j] * v->theta[j];
    }
    along += w * slope;
  }
  e->capacity += weight;
  e->content += weight * x;
  e->history += weight * history;
  e->convected += weight * along;
}

PetscErrorCode ScalarsMeasureExcess(Scalars all, PetscInt i, PetscInt c, ScalarExcess *e)
{
  const Scalar        *s   = all->scalar + i;
  const PetscInt       dim = all->loc->dim, nb = all->loc->nb;
  const ScalarSamples *sample = s->cells.sample && s->cells.sample[c] >= 0 ? s->cells.samples + s->cells.sample[c]
                                                                           : NULL;
  PetscReal            xc[MESH_MAX_NB * 3], excess;
  Values               v;

  PetscFunctionBeginUser;
  *e = (ScalarExcess){0};
  PetscCall(ScalarCellCoordinates(all, c, xc));
  get_values(all, s, c, xc, &v);
  if (sample) {
    for (PetscInt q = 0; q < PetscPowInt(sample->n, dim); q++) {
      PetscReal       phi[MESH_MAX_NB], g[3][MESH_MAX_NB];
      const PetscReal weight = ScalarSampleBasis(all, sample->n, q, xc, phi, g);

      add_point(dim, nb, weight * (sample->capacity[q] - s->par.capacity), phi, g, &v, (PetscBool)(s->w != NULL), e);
    }
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  excess = (!ScalarCellIsActive(s, c) ? 0
            : s->cells.capacity       ? s->cells.capacity[c]
                                      : s->par.capacity) -
           s->par.capacity;
  if (excess != 0) {
    ElementMetric m;

    PetscCall(ScalarCellMetric(all, xc, &m));
    for (PetscInt q = 0; q < all->element.nq; q++) {
      PetscReal g[3][ELEMENT_MAX_NBP], h[3][MESH_MAX_NB];

      ElementGradients(&all->element, &m, q, g);
      for (PetscInt a = 0; a < dim; a++) PetscCall(PetscArraycpy(h[a], g[a], nb));
      add_point(dim, nb, m.weight[q] * excess, all->element.phi + q * all->element.nbp, h, &v,
                (PetscBool)(s->w != NULL), e);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A point of weight c */
static void add_growth(PetscInt dim, PetscInt nb, PetscReal weight, const PetscReal phi[],
                       const PetscReal g[3][MESH_MAX_NB], const Values *v, const PetscReal V[], PetscReal sum[3])
{
  PetscReal x = 0, history = 0, theta = 0, div = 0;

  for (PetscInt j = 0; j < nb; j++) {
    x += phi[j] * v->x[j];
    history += phi[j] * v->history[j];
    theta += phi[j] * v->theta[j];
    for (PetscInt a = 0; a < dim && V; a++) div += g[a][j] * V[j * dim + a];
  }
  sum[0] += weight * x;
  sum[1] += weight * history;
  sum[2] += weight * theta * div;
}

PetscErrorCode ScalarsMeasureGrowth(Scalars all, PetscInt i, const PetscReal V[], const PetscInt skip[],
                                    PetscReal sum[3])
{
  const Scalar  *s   = all->scalar + i;
  const PetscInt dim = all->loc->dim, nb = all->loc->nb;

  PetscFunctionBeginUser;
  sum[0] = sum[1] = sum[2] = 0;
  for (PetscInt c = 0; c < all->loc->ncell; c++) {
    const PetscInt       at = s->cells.sample ? s->cells.sample[c] : -1;
    const ScalarSamples *p  = at >= 0 ? s->cells.samples + at : NULL;
    PetscReal xc[MESH_MAX_NB * 3], vc[MESH_MAX_NB * 3], phi[MESH_MAX_NB], g[3][ELEMENT_MAX_NBP], h[3][MESH_MAX_NB];
    const PetscReal *velocity = skip[c] < 0 ? vc : NULL;
    ElementMetric    m;
    Values           v;

    if (!ScalarCellIsActive(s, c)) continue;
    PetscCall(ScalarCellCoordinates(all, c, xc));
    get_values(all, s, c, xc, &v);
    ScalarCellGather(all->loc, c, dim, V, vc);
    for (PetscInt q = 0; p && q < PetscPowInt(p->n, dim); q++) {
      const PetscReal weight = ScalarSampleBasis(all, p->n, q, xc, phi, h);

      add_growth(dim, nb, weight * p->capacity[q], phi, h, &v, velocity, sum);
    }
    if (p) continue;
    PetscCall(ScalarCellMetric(all, xc, &m));
    for (PetscInt q = 0; q < all->element.nq; q++) {
      const PetscReal capacity = s->cells.capacity ? s->cells.capacity[c] : s->par.capacity;

      ElementGradients(&all->element, &m, q, g);
      for (PetscInt a = 0; a < dim; a++) PetscCall(PetscArraycpy(h[a], g[a], nb));
      add_growth(dim, nb, m.weight[q] * capacity, all->element.phi + q * all->element.nbp, h, &v, velocity, sum);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsIntegrate(Scalars all, PetscInt c, PetscInt n, const PetscReal v[], PetscReal *sum)
{
  PetscReal     xc[MESH_MAX_NB * 3], phi[MESH_MAX_NB], g[3][MESH_MAX_NB];
  ElementMetric m;

  PetscFunctionBeginUser;
  *sum = 0;
  PetscCall(ScalarCellCoordinates(all, c, xc));
  for (PetscInt q = 0; q < PetscPowInt(n, all->loc->dim) && n; q++)
    *sum += v[q] * ScalarSampleBasis(all, n, q, xc, phi, g);
  if (n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarCellMetric(all, xc, &m));
  for (PetscInt q = 0; q < all->element.nq; q++) *sum += *v * m.weight[q];
  PetscFunctionReturn(PETSC_SUCCESS);
}
