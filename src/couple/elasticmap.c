/* Elastic, map: positions predicted for a step, the flow's cells that they lie in, and the interpolation P. */
#include "compat.h"
#include "elastic.h"
#include "impl.h"
#include "base/array.h"
#include "fem/element.h"

PetscErrorCode ElasticPredict(Elastic *e, Couple c)
{
  const SolidsState *s     = e->s;
  const FlowStep    *step  = c->step;
  const PetscReal    ratio = step->order == 2 && step->dt_old > 0 ? step->dt / step->dt_old : 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->nnode * s->dim; i++) {
    e->a[i] = (step->d0 * s->x[i] + step->d1 * s->x_old[i]) / step->ct;
    e->x[i] = e->a[i] + (s->u[i] + ratio * (s->u[i] - s->u_old[i])) / step->ct;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Points x [n][dim], the same on all ranks: each is answered by the rank in whose cell it is deepest, of several by the
   first; *lost: one that is in no cell, or -1 */
static PetscErrorCode find_points(Elastic *e, Couple c, PointCells cells, PetscInt n, const PetscReal x[],
                                  ElasticPoints *p, PetscInt *lost)
{
  struct best {
    double far;
    int    rank;
  } * mine, *all;
  const PetscInt dim = e->s->dim;
  PetscMPIInt    rank;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(c->comm, &rank));
  PetscCall(ArrayReserve(n, &p->capacity, &p->cell, sizeof(*p->cell), &p->xi, (size_t)dim * sizeof(*p->xi), NULL));
  PetscCall(PetscMalloc2(n, &mine, n, &all));
  p->n  = n;
  *lost = -1;
  for (PetscInt i = 0; i < n; i++) {
    PetscReal far;

    PetscCall(PointCellsFind(cells, x + dim * i, &p->cell[i], p->xi + dim * i, &far));
    mine[i] = (struct best){PetscMax(1, far), rank};
  }
  PetscCallMPI(MPI_Allreduce(mine, all, (PetscMPIInt)n, MPI_DOUBLE_INT, MPI_MINLOC, c->comm));
  for (PetscInt i = 0; i < n; i++) {
    if (all[i].rank != rank) p->cell[i] = -1;
    if (all[i].far == PETSC_MAX_REAL && *lost < 0) *lost = i;
  }
  PetscCall(PetscFree2(mine, all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const SolidGroup *group_of_node(const SolidsState *s, PetscInt i, PetscInt *k, PetscInt *node)
{
  *k = 0;
  while (s->first[*k + 1] <= i) (*k)++;
  *node = i - s->first[*k];
  return s->group + s->group_of[*k];
}

/* Rows of P: the flow's basis at the nodes; none of those that are held */
static PetscErrorCode fill_map(Elastic *e, Couple c)
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim;

  PetscFunctionBeginUser;
  PetscCall(MatDestroy(&e->P));
  PetscCall(MatCreateAIJ(c->comm, dim * (e->nodes[1] - e->nodes[0]), dim * l->nnode, PETSC_DETERMINE, PETSC_DETERMINE,
                         l->nb, NULL, l->nb, NULL, &e->P));
  for (PetscInt i = 0; i < e->node.n; i++) {
    const PetscInt cell = e->node.cell[i];
    PetscInt       k, node, column[MESH_MAX_NB];
    PetscReal      phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB];

    if (cell < 0 || group_of_node(e->s, i, &k, &node)->clamped[node]) continue;
    ElementBasis(dim, e->node.xi + dim * i, phi, dphi);
    MeshCellScatter(l, cell, 1, phi); /* from lattice positions to the nodes in the slots */
    for (PetscInt a = 0; a < dim; a++) {
      const PetscInt row = dim * i + a;

      for (PetscInt j = 0; j < l->nb; j++) column[j] = dim * l->node_global[l->cell_node[cell * l->nb + j]] + a;
      PetscCall(MatSetValues(e->P, 1, &row, l->nb, column, phi, ADD_VALUES));
    }
  }
  PetscCall(MatAssemblyBegin(e->P, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(e->P, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Positions of the quadrature points of all solids, [][dim] in the order of solids, cells, points */
static PetscErrorCode list_points(const Elastic *e, PetscInt *n, PetscReal **x)
{
  const SolidsState *s   = e->s;
  const PetscInt     dim = s->dim;

  PetscFunctionBeginUser;
  *n = 0;
  for (PetscInt k = 0; k < s->n; k++) *n += s->group[s->group_of[k]].mesh.ncell * s->group[s->group_of[k]].mesh.nq;
  PetscCall(PetscCalloc1(*n * dim, x));
  *n = 0;
  for (PetscInt k = 0; k < s->n; k++) {
    const SolidMesh *m  = &s->group[s->group_of[k]].mesh;
    const PetscReal *at = e->x + dim * s->first[k];

    for (PetscInt cell = 0; cell < m->ncell; cell++) {
      PetscReal xc[SOLID_MAX_N];

      SolidGather(m, cell, at, xc);
      for (PetscInt q = 0; q < m->nq; q++, (*n)++)
        for (PetscInt j = 0; j < m->nb; j++)
          for (PetscInt a = 0; a < dim; a++) (*x)[*n * dim + a] += m->phi[q * m->nb + j] * xc[dim * j + a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticMap(Elastic *e, Couple c)
{
  const SolidsState *s = e->s;
  PointCells         cells;
  PetscInt           lost, n;
  PetscReal         *x;

  PetscFunctionBeginUser;
  PetscCall(PointCellsCreate(c->mesh, NULL, 0.02, &cells));
  PetscCall(find_points(e, c, cells, s->nnode, e->x, &e->node, &lost));
  if (lost >= 0) {
    PetscInt          k, node;
    const SolidGroup *g = group_of_node(s, lost, &k, &node);

    SETERRQ(c->comm, PETSC_ERR_USER_INPUT,
            "The elastic solid of group '%s' leaves the domain at t = %g, at (%g, %g): keep it inside, or lower -sim_dt (%g)",
            g->name, (double)c->step->time, (double)e->x[s->dim * lost], (double)e->x[s->dim * lost + 1],
            (double)c->step->dt);
  }
  PetscCall(list_points(e, &n, &x));
  PetscCall(find_points(e, c, cells, n, x, &e->point, &lost));
  PetscCall(PetscFree(x));
  PetscCall(PointCellsDestroy(&cells));
  PetscCall(fill_map(e, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}
