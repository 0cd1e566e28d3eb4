/* Scalars, what bodies bring into the balance as they cover and free cells: integrals with the capacity in excess of
   the fluid's (scalar.h). Same quadrature as the matrix. */
#include "compat.h"
#include "impl.h"

typedef struct {
  PetscReal    history[MESH_MAX_NB]; /* d0 T^n + d1 T^{n-1} at the nodes */
  ScalarValues v;
  ScalarPoints points;
} Cell;

static PetscErrorCode begin_cell(Scalars all, const Scalar *s, PetscInt c, Cell *cell)
{
  const ScalarStep   *p = &all->step;
  const ScalarValues *v = &cell->v;

  PetscFunctionBeginUser;
  PetscCall(ScalarCellValues(all, s, c, &cell->v));
  for (PetscInt j = 0; j < all->loc->nb; j++) cell->history[j] = p->d0 * v->now[j] + p->d1 * v->old[j];
  PetscCall(ScalarCellPoints(all, s, c, &cell->points));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Point q, value and history there */
static PetscErrorCode take_point(Scalars all, const Cell *cell, PetscInt q, ScalarPoint *p, PetscReal *x,
                                 PetscReal *history)
{
  PetscFunctionBeginUser;
  *x = *history = 0;
  PetscCall(ScalarCellPoint(all, &cell->points, q, p));
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

/* A box of one material whose nodes stand still: weights int c phi of its nodes */
static PetscBool add_still(Scalars all, Scalar *s, PetscInt c, const PetscReal V[])
{
  const MeshLocal *l   = all->loc;
  const PetscInt   dim = l->dim, nb = l->nb, *node = l->cell_node + c * nb;
  const PetscReal *edge;
  PetscReal        weight[MESH_MAX_NB], volume = s->cells.capacity ? s->cells.capacity[c] : s->par.capacity;

  if (s->cells.sample && s->cells.sample[c] >= 0) return PETSC_FALSE;
  for (PetscInt j = 0; j < nb && V; j++)
    for (PetscInt a = 0; a < dim; a++)
      if (V[node[j] * dim + a] != 0) return PETSC_FALSE;
  if (ScalarCellBox(all, c, &edge) || !edge) return PETSC_FALSE;
  for (PetscInt a = 0; a < dim; a++) volume *= 0.5 * edge[a];
  for (PetscInt j = 0; j < nb; j++) weight[j] = volume * all->integral[j];
  MeshCellScatter(l, c, 1, weight);
  for (PetscInt j = 0; j < nb; j++) s->growth_weight[node[j]] += weight[j];
  return PETSC_TRUE;
}

PetscErrorCode ScalarsFindGrowing(Scalars all, PetscInt i, const PetscReal V[], const PetscInt skip[])
{
  Scalar *s = all->scalar + i;

  PetscFunctionBeginUser;
  if (!s->growth_cell)
    PetscCall(PetscMalloc2(all->loc->nnode_all, &s->growth_weight, all->loc->ncell, &s->growth_cell));
  PetscCall(PetscArrayzero(s->growth_weight, all->loc->nnode_all));
  s->ngrowth_cell = 0;
  for (PetscInt c = 0; c < all->loc->ncell; c++)
    if (ScalarCellIsActive(s, c) && !add_still(all, s, c, !skip || skip[c] < 0 ? V : NULL))
      s->growth_cell[s->ngrowth_cell++] = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes of boundaries may be those of a fluid that goes through: int c T_theta V.n over a face of cell c */
static PetscErrorCode measure_through(Scalars all, const Scalar *s, PetscInt c, PetscInt side, const PetscReal V[],
                                      PetscReal *sum)
{
  const PetscInt  dim = all->loc->dim, nb = all->loc->nb;
  const PetscReal capacity = s->cells.capacity ? s->cells.capacity[c] : s->par.capacity;
  PetscReal       x[9 * 3], weight[9], phi[9 * MESH_MAX_NB], normal[9 * 3];
  ScalarValues    v;

  PetscFunctionBeginUser;
  PetscCall(ScalarSidePoints(all, c, side, x, weight, phi, normal));
  PetscCall(ScalarCellValues(all, s, c, &v));
  for (PetscInt q = 0; q < (dim == 2 ? 3 : 9); q++) {
    PetscReal theta = 0, along = 0;

    for (PetscInt j = 0; j < nb; j++) {
      theta += phi[q * MESH_MAX_NB + j] * v.theta[j];
      for (PetscInt a = 0; a < dim; a++) along += phi[q * MESH_MAX_NB + j] * normal[q * dim + a] * V[j * dim + a];
    }
    *sum += weight[q] * capacity * theta * along;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsMeasureGrowth(Scalars all, PetscInt i, const PetscReal V[], const PetscInt skip[],
                                    PetscReal sum[3])
{
  const Scalar *s = all->scalar + i;

  PetscFunctionBeginUser;
  sum[0] = sum[1] = sum[2] = 0;
  for (PetscInt k = 0; k < all->loc->nnode_all; k++) {
    sum[0] += s->growth_weight[k] * s->x[k];
    sum[1] += s->growth_weight[k] * (all->step.d0 * s->T[k] + all->step.d1 * s->T_old[k]);
  }
  for (PetscInt k = 0; k < s->ngrowth_cell; k++) {
    const PetscInt c = s->growth_cell[k];
    PetscReal      vc[MESH_MAX_NB * 3];

    MeshCellValues(all->loc, c, all->loc->dim, V, vc);
    PetscCall(add_growth(all, s, c, !skip || skip[c] < 0 ? vc : NULL, sum));
  }
  for (PetscInt k = 0; k < all->nface; k++) {
    const PetscInt c     = all->face[k].cell;
    PetscBool      moves = PETSC_FALSE;
    PetscReal      vc[MESH_MAX_NB * 3], through = 0;

    if (c >= all->loc->ncell || !ScalarCellIsActive(s, c) || (skip && skip[c] >= 0)) continue;
    MeshCellValues(all->loc, c, all->loc->dim, V, vc);
    for (PetscInt j = 0; j < all->loc->nb * all->loc->dim; j++) moves = (PetscBool)(moves || vc[j] != 0);
    if (!moves) continue;
    PetscCall(measure_through(all, s, c, all->face[k].side, vc, &through));
    sum[2] -= through;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsIntegrate(Scalars all, PetscInt c, PetscInt n, const PetscReal v[], PetscReal *sum)
{
  PetscReal     xc[MESH_MAX_NB * 3], phi[MESH_MAX_NB], g[3][MESH_MAX_NB];
  ElementMetric m;

  PetscFunctionBeginUser;
  *sum = 0;
  if (n) PetscCall(ScalarCellCoordinates(all, c, xc));
  for (PetscInt q = 0; q < PetscPowInt(n, all->loc->dim) && n; q++)
    *sum += v[q] * ScalarSampleBasis(all, n, q, xc, phi, g);
  if (n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarCellMetric(all, c, &m));
  for (PetscInt q = 0; q < all->element.nq; q++) *sum += *v * m.weight[q];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsIntegrateBasis(Scalars all, PetscInt c, PetscReal sum[])
{
  const PetscInt nb = all->loc->nb;
  ElementMetric  m;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(sum, nb));
  PetscCall(ScalarCellMetric(all, c, &m));
  for (PetscInt q = 0; q < all->element.nq; q++)
    for (PetscInt j = 0; j < nb; j++) sum[j] += m.weight[q] * all->element.phi[q * all->element.nbp + j];
  PetscFunctionReturn(PETSC_SUCCESS);
}
