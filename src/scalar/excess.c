/* Scalars, what bodies bring into the balance as they cover and free cells: integrals with the capacity in excess of
   the fluid's (scalar.h). Same quadrature as the matrix. */
#include "compat.h"
#include "impl.h"

typedef struct {
  PetscReal    xc[MESH_MAX_NB * 3];
  PetscReal    history[MESH_MAX_NB]; /* d0 T^n + d1 T^{n-1} at the nodes */
  ScalarValues v;
  ScalarPoints points;
} Cell;

static PetscErrorCode begin_cell(Scalars all, const Scalar *s, PetscInt c, Cell *cell)
{
  const ScalarStep   *p = &all->step;
  const ScalarValues *v = &cell->v;

  PetscFunctionBeginUser;
  PetscCall(ScalarCellCoordinates(all, c, cell->xc));
  ScalarCellValues(all, s, c, cell->xc, &cell->v);
  for (PetscInt j = 0; j < all->loc->nb; j++) cell->history[j] = p->d0 * v->now[j] + p->d1 * v->old[j];
  PetscCall(ScalarCellPoints(all, s, c, cell->xc, &cell->points));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Point q, value and history there */
static PetscErrorCode take_point(Scalars all, const Cell *cell, PetscInt q, ScalarPoint *p, PetscReal *x,
                                 PetscReal *history)
{
  PetscFunctionBeginUser;
  *x = *history = 0;
  PetscCall(ScalarCellPoint(all, &cell->points, q, cell->xc, p));
  for (PetscInt j = 0; j < all->loc->nb; j++) {
    *x += p->phi[j] * cell->v.x[j];
    *history += p->phi[j] * cell->history[j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsMeasureExcess(Scalars all, PetscInt i, PetscInt c, ScalarExcess *e)
{
  const Scalar *s = all->scalar + i;
  Cell          cell;

  PetscFunctionBeginUser;
  *e = (ScalarExcess){0};
  PetscCall(begin_cell(all, s, c, &cell));
  for (PetscInt q = 0; q < cell.points.n; q++) {
    ScalarPoint p;
    PetscReal   weight, along, x, history;

    PetscCall(take_point(all, &cell, q, &p, &x, &history));
    weight = p.weight * (p.capacity - s->par.capacity);
    along  = ScalarConvected(all->loc->dim, all->loc->nb, &p, &cell.v);
    e->capacity += weight;
    e->content += weight * x;
    e->history += weight * history;
    e->convected += weight * along;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of cell c; V [nb][dim], NULL: it moves as a whole */
static PetscErrorCode add_growth(Scalars all, const Scalar *s, PetscInt c, const PetscReal V[], PetscReal sum[3])
{
  const PetscInt dim = all->loc->dim;
  Cell           cell;

  PetscFunctionBeginUser;
  PetscCall(begin_cell(all, s, c, &cell));
  for (PetscInt q = 0; q < cell.points.n; q++) {
    ScalarPoint p;
    PetscReal   x, history, theta = 0, div = 0;

    PetscCall(take_point(all, &cell, q, &p, &x, &history));
    for (PetscInt j = 0; j < all->loc->nb; j++) {
      theta += p.phi[j] * cell.v.theta[j];
      for (PetscInt a = 0; a < dim && V; a++) div += p.g[a][j] * V[j * dim + a];
    }
    sum[0] += p.weight * p.capacity * x;
    sum[1] += p.weight * p.capacity * history;
    sum[2] += p.weight * p.capacity * theta * div;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsMeasureGrowth(Scalars all, PetscInt i, const PetscReal V[], const PetscInt skip[],
                                    PetscReal sum[3])
{
  const Scalar *s = all->scalar + i;

  PetscFunctionBeginUser;
  sum[0] = sum[1] = sum[2] = 0;
  for (PetscInt c = 0; c < all->loc->ncell; c++) {
    PetscReal vc[MESH_MAX_NB * 3];

    if (!ScalarCellIsActive(s, c)) continue;
    ScalarCellGather(all->loc, c, all->loc->dim, V, vc);
    PetscCall(add_growth(all, s, c, skip[c] < 0 ? vc : NULL, sum));
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

PetscErrorCode ScalarsIntegrateBasis(Scalars all, PetscInt c, PetscReal sum[])
{
  const PetscInt nb = all->loc->nb;
  PetscReal      xc[MESH_MAX_NB * 3];
  ElementMetric  m;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(sum, nb));
  PetscCall(ScalarCellCoordinates(all, c, xc));
  PetscCall(ScalarCellMetric(all, xc, &m));
  for (PetscInt q = 0; q < all->element.nq; q++)
    for (PetscInt j = 0; j < nb; j++) sum[j] += m.weight[q] * all->element.phi[q * all->element.nbp + j];
  PetscFunctionReturn(PETSC_SUCCESS);
}
