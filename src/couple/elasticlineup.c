/* Elastic, line up: the mesh follows solids in every step.

   Where it followed one and does no more, the fluid inside counts again. Its old velocities there are those of the
   material: cells inside a solid that is followed have no inertia of the flow, and nodes in them keep of the step
   before last, or take from the fluid beside, what is not the solid's.

   Old velocities at nodes that move are values at points, and do not conserve momentum. What the momentum of fluid and
   solids changes by, over int rho |u|, is the share that is told. A solid S at rest in its frame takes up the fluid in
   its way with the velocity beside it: - dt int_S rho u.grad u, which the convection of the step gives back, is no
   part of that. */
#include "compat.h"
#include "elastic.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/log.h"
#include "fem/element.h"

#define ROUNDING 1e-9 /* of the half-width of a solid's cell */
#define LARGE    0.01 /* share of the momentum, which is told */
#define STILL    1e-6 /* of the smallest cell in a step: solids that go no farther have nothing to tell */

/* Sums over the ranks; size: int rho |u|, about; turn: int_S rho u.grad u */
typedef struct {
  PetscReal momentum[3], turn[3], size;
} Momentum;

/* u [2] [nnode_all][dim], now and a step before, at own nodes inside solid k where it is */
static PetscErrorCode take_material(const SolidsState *s, const MeshLocal *l, PetscInt k, PetscReal *const u[2])
{
  const SolidMesh       *m   = &s->group[s->group_of[k]].mesh;
  const PetscInt         dim = l->dim, first = dim * s->first[k];
  const PetscReal *const of[] = {s->u + first, s->u_old + first};
  PetscReal              centre[3], x[3], xi[3], far, phi[ELEMENT_MAX_NB], dphi[3 * ELEMENT_MAX_NB];
  PointCells             cells;

  PetscFunctionBeginUser;
  (void)SolidFindVolume(m, s->x + first, centre);
  PetscCall(PointCellsCreateOf(dim, m->ncell, m->cell_node, s->x + first, ROUNDING, &cells));
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscInt cell;

    for (PetscInt a = 0; a < dim; a++) x[a] = centre[a] + MeshNearest(l, a, l->x[dim * i + a] - centre[a]);
    PetscCall(PointCellsFind(cells, x, &cell, xi, &far));
    if (cell < 0) continue;
    ElementBasis(dim, xi, phi, dphi);
    for (PetscInt e = 0; e < 2 * dim; e++) {
      PetscReal *to = u[e / dim] + dim * i + e % dim;

      *to = 0;
      for (PetscInt j = 0; j < m->nb; j++) *to += phi[j] * of[e / dim][dim * m->cell_node[cell * m->nb + j] + e % dim];
    }
  }
  PetscCall(PointCellsDestroy(&cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode give_up(const Elastic *e, Couple c)
{
  const SolidsState *s   = e->s;
  PetscBool          any = PETSC_FALSE;
  PetscReal         *u[2];

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &u[0], &u[1], NULL));
  for (PetscInt k = 0; k < s->n; k++) {
    if (!e->labels.left[k] || s->group[s->group_of[k]].membrane) continue;
    PetscCall(take_material(s, c->loc, k, u));
    any = PETSC_TRUE;
  }
  for (PetscInt i = 0; i < 2 && any; i++) PetscCall(MeshSyncNodes(c->mesh, s->dim, u[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- momentum ---- */

/* The fluid's, as if it filled cell `cell` of a solid: less of it */
static PetscErrorCode subtract_cell(const Elastic *e, Couple c, PetscInt cell, const PetscReal u[], Momentum *to)
{
  const ElementTables *t   = &e->inertia.tables;
  const PetscInt       dim = t->dim, nb = t->nb;
  PetscReal            xc[MESH_MAX_NB * 3], uc[MESH_MAX_NB * 3], g[3][ELEMENT_MAX_NBP];
  ElementMetric        metric;

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(c->mesh, cell, xc));
  MeshCellValues(c->loc, cell, dim, u, uc);
  ElementSetMetric(t, xc, &metric);
  for (PetscInt q = 0; q < t->nq; q++) {
    const PetscReal w = c->par->density * metric.weight[q], *phi = t->phi + q * t->nbp;
    PetscReal       v[3] = {0, 0, 0};

    ElementGradients(t, &metric, q, g);
    for (PetscInt j = 0; j < nb * dim; j++) v[j % dim] += phi[j / dim] * uc[j];
    for (PetscInt a = 0; a < dim; a++) to->momentum[a] -= w * v[a];
    for (PetscInt j = 0; j < nb * dim; j++)
      for (PetscInt a = 0; a < dim; a++) to->turn[j % dim] += w * v[a] * g[a][j / dim] * uc[j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of solid k what it has more than the fluid that counts in its place; an immersed one's excess does not change */
static void add_solid(const Elastic *e, Couple c, PetscInt k, Momentum *to)
{
  const SolidMesh *m = &e->s->group[e->s->group_of[k]].mesh;
  PetscReal        sum[3];

  (void)ElasticMotion(m, e->s->u + m->dim * e->s->first[k], sum);
  for (PetscInt a = 0; a < m->dim && ElasticIsLined(e, k); a++) to->momentum[a] += c->par->density * sum[a];
  to->size += PetscAbsReal(ElasticExcess(e, c, k)) * PetscSqrtReal(dot3(sum, sum)) +
              STILL * e->s->group[e->s->group_of[k]].density * m->volume * c->loc->h / c->step->dt;
}

static PetscErrorCode find_momentum(const Elastic *e, Couple c, Momentum *sum)
{
  const MeshLocal *l = c->loc;
  const PetscReal *mass;
  PetscReal       *u;

  PetscFunctionBeginUser;
  *sum = (Momentum){.size = 0};
  PetscCall(FlowGetFields(c->flow, &u, NULL, NULL));
  PetscCall(FlowGetLumpedMass(c->flow, &mass));
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal v[3] = {0, 0, 0};

    for (PetscInt a = 0; a < l->dim; a++) {
      v[a] = c->par->density * mass[i] * u[l->dim * i + a];
      sum->momentum[a] += v[a];
    }
    sum->size += PetscSqrtReal(dot3(v, v));
  }
  for (PetscInt cell = 0; cell < l->ncell; cell++)
    if (e->labels.cell_solid[cell] >= 0) PetscCall(subtract_cell(e, c, cell, u, sum));
  for (PetscInt k = e->s->own[0]; k < e->s->own[1]; k++) add_solid(e, c, k, sum);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, sizeof(*sum) / sizeof(PetscReal), MPIU_REAL, MPIU_SUM, c->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Not of membranes, inside of which is the fluid, nor beside bodies that move: what these take up is not known here */
static PetscBool is_measured(const Elastic *e)
{
  return (PetscBool)(e->lineup.done && !e->beside && !SolidsHave(e->s, PETSC_TRUE));
}

PetscErrorCode ElasticLineUp(Elastic *e, Couple c)
{
  Momentum before, after;

  PetscFunctionBeginUser;
  e->lineup.change = 0;
  if (is_measured(e)) PetscCall(find_momentum(e, c, &before));
  PetscCall(ElasticAlignUpdate(e->align, e->x, &e->labels));
  PetscCall(give_up(e, c));
  if (is_measured(e)) {
    PetscReal change[3];

    PetscCall(find_momentum(e, c, &after));
    for (PetscInt a = 0; a < 3; a++) change[a] = after.momentum[a] - before.momentum[a] + c->step->dt * before.turn[a];
    e->lineup.change = PetscSqrtReal(dot3(change, change)) / before.size;
  }
  e->lineup.done = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticRemarkLineUp(Elastic *e, Couple c)
{
  PetscFunctionBeginUser;
  e->lineup.largest = PetscMax(e->lineup.largest, e->lineup.change);
  if (e->lineup.told || e->lineup.change < LARGE) PetscFunctionReturn(PETSC_SUCCESS);
  e->lineup.told = PETSC_TRUE;
  PetscCall(
    LogRemark("lining the mesh up with elastic particles changed the momentum of fluid and particles by %.2g %% of it in the step to t = %g "
              "(solid_momentum_carried_max of summary.json): the flow between them, or the way in a step, is too large for the cells: lower -sim_dt (%g), use "
              "smaller cells there, or -couple_method penalty, which keeps it",
              100 * (double)e->lineup.change, (double)c->step->time, (double)c->step->dt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal CoupleGetMomentumCarried(Couple c)
{
  return c->elastic && c->elastic->aligned && !c->elastic->anchored && is_measured(c->elastic)
         ? c->elastic->lineup.largest
         : -1;
}
