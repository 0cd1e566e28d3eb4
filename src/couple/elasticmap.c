/* Elastic, map: positions predicted for a step, the flow's cells that they lie in, and the interpolation P. */
#include "compat.h"
#include "elastic.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/array.h"
#include "base/log.h"
#include "fem/element.h"

#define OUTSIDE  0.02 /* of a half-width: so far out of the domain a node may be */
#define BEYOND   0.8  /* likewise, out of the cells of its solid */
#define STRAINED 0.1  /* stiffness of a step over the viscosity, times a strain that is not there */
#define ROUND_IT 1.1  /* balls of outlines, so much larger, hold all points of the solids */
#define SMALLER  0.95 /* cells of the flow: so small at most a solid's are to be */

/* Of a point: how deep in a cell it is, and on which rank, as MPI has it */
typedef struct {
  double far;
  int    rank;
} Answer;

/* Before points of solids with their nodes at x are looked for: cells of this rank, all of them and those inside of
   solids that the mesh follows (NULL: none), and which solids its cells may hold points of */
static PetscErrorCode begin_search(Elastic *e, Couple c, const PetscReal x[], PointCells cells[2])
{
  const AlignSurfaces *t;
  PetscBool           *inside;

  PetscFunctionBeginUser;
  PetscCall(PointCellsCreate(c->mesh, NULL, OUTSIDE, &cells[0]));
  cells[1] = NULL;
  PetscCall(ElasticSurfacesSet(e->surfaces, x));
  t = ElasticSurfacesGet(e->surfaces);
  if (!e->node.reached) PetscCall(PetscMalloc1(e->s->n, &e->node.reached));
  for (PetscInt k = 0; k < e->s->n; k++)
    e->node.reached[k] = PointCellsReach(cells[0], t->centre[k], ROUND_IT * t->radius[k]);
  if (!e->align || !e->labels.cell_solid) PetscFunctionReturn(PETSC_SUCCESS); /* not lined up so far */
  PetscCall(PetscMalloc1(c->loc->ncell, &inside));
  for (PetscInt i = 0; i < c->loc->ncell; i++) inside[i] = (PetscBool)(e->labels.cell_solid[i] >= 0);
  PetscCall(PointCellsCreate(c->mesh, inside, BEYOND, &cells[1]));
  PetscCall(PetscFree(inside));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Points of the solids, x [][dim], those of solid k from point[k] to before point[k + 1]: each is answered by the rank
   in whose cell it is deepest, of several by the first; of a solid that the mesh follows by cells inside of it if they
   can. *lost: a point that is in no cell, or -1 */
static PetscErrorCode find_points(Elastic *e, Couple c, PointCells cells[2], const PetscInt point[],
                                  const PetscReal x[], ElasticPoints *p, PetscInt *lost)
{
  const PetscInt dim = e->s->dim, n = point[e->s->n];
  PetscMPIInt    rank;
  Answer        *mine, *all;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(c->comm, &rank));
  PetscCall(ArrayReserve(n, &p->capacity, &p->cell, sizeof(*p->cell), &p->xi, (size_t)dim * sizeof(*p->xi), NULL));
  PetscCall(PetscMalloc2(n, &mine, n, &all));
  p->n  = n;
  *lost = -1;
  for (PetscInt i = 0; i < n; i++) all[i].far = PETSC_MAX_REAL;
  for (PetscInt pass = cells[1] ? 0 : 1; pass < 2; pass++) {
    for (PetscInt k = 0; k < e->s->n; k++) {
      const PetscBool here = (PetscBool)(e->node.reached[k] && (pass || ElasticIsLined(e, k)));

      for (PetscInt i = point[k]; i < point[k + 1]; i++) {
        PetscReal far = PETSC_MAX_REAL;

        if (all[i].far < PETSC_MAX_REAL) continue;
        p->cell[i] = -1;
        if (here) PetscCall(PointCellsFind(cells[!pass], x + dim * i, &p->cell[i], p->xi + dim * i, &far));
        mine[i] = (Answer){PetscMax(1, far), rank};
      }
    }
    PetscCallMPI(MPI_Allreduce(mine, all, (PetscMPIInt)n, MPI_DOUBLE_INT, MPI_MINLOC, c->comm));
  }
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
  Mat              one; /* of one component */

  PetscFunctionBeginUser;
  PetscCall(MatDestroy(&e->P));
  PetscCall(MatCreateAIJ(c->comm, e->nodes[1] - e->nodes[0], l->nnode, PETSC_DETERMINE, PETSC_DETERMINE, l->nb, NULL,
                         l->nb, NULL, &one));
  for (PetscInt i = 0, k = 0; i < e->node.n; i++) {
    const PetscInt cell = e->node.cell[i];
    PetscInt       column[MESH_MAX_NB];
    PetscReal      phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB];

    while (e->s->first[k + 1] <= i) k++;
    if (cell < 0 || e->s->group[e->s->group_of[k]].clamped[i - e->s->first[k]]) continue;
    ElementBasis(dim, e->node.xi + dim * i, phi, dphi);
    MeshCellScatter(l, cell, 1, phi); /* from lattice positions to the nodes in the slots */
    for (PetscInt j = 0; j < l->nb; j++) column[j] = l->node_global[l->cell_node[cell * l->nb + j]];
    PetscCall(MatSetValues(one, 1, &i, l->nb, column, phi, ADD_VALUES));
  }
  PetscCall(MatAssemblyBegin(one, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(one, MAT_FINAL_ASSEMBLY));
  PetscCall(MatCreateMAIJ(one, dim, &e->P));
  PetscCall(MatDestroy(&one));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Positions of the quadrature points of all solids but membranes, [][dim] in the order of solids, cells, points, as
   find_points takes them; of solids that are reached alone */
static PetscErrorCode list_points(const Elastic *e, PetscInt **point, PetscReal **x)
{
  const SolidsState *s   = e->s;
  const PetscInt     dim = s->dim;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(s->n + 1, point));
  (*point)[0] = 0;
  for (PetscInt k = 0; k < s->n; k++) {
    const SolidMesh *m = &s->group[s->group_of[k]].mesh;

    (*point)[k + 1] = (*point)[k] + (SolidIsMembrane(m) ? 0 : m->ncell * m->nq);
  }
  PetscCall(PetscCalloc1((*point)[s->n] * dim, x));
  for (PetscInt k = 0; k < s->n; k++) {
    const SolidMesh *m  = &s->group[s->group_of[k]].mesh;
    const PetscReal *at = e->x + dim * s->first[k];
    PetscReal       *to = *x + (*point)[k] * dim;

    for (PetscInt cell = 0; cell < m->ncell && !SolidIsMembrane(m) && e->node.reached[k]; cell++) {
      PetscReal xc[SOLID_MAX_N];

      SolidGather(m, cell, at, xc);
      for (PetscInt q = 0; q < m->nq; q++, to += dim)
        for (PetscInt j = 0; j < m->nb; j++)
          for (PetscInt a = 0; a < dim; a++) to[a] += m->phi[q * m->nb + j] * xc[dim * j + a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode stop_lost(Elastic *e, Couple c, PetscInt i)
{
  PetscInt          k, node;
  const SolidGroup *g         = group_of_node(e->s, i, &k, &node);
  char              third[32] = "";

  PetscFunctionBeginUser;
  if (e->s->dim == 3) (void)snprintf(third, sizeof(third), ", %g", (double)e->x[3 * i + 2]);
  SETERRQ(c->comm, PETSC_ERR_USER_INPUT,
          "The elastic solid of group '%s' leaves the domain at t = %g, at (%g, %g%s): keep it inside, or lower -sim_dt (%g)",
          g->name, (double)c->step->time, (double)e->x[e->s->dim * i], (double)e->x[e->s->dim * i + 1], third,
          (double)c->step->dt);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Once: groups whose cells are not smaller than the flow's cells that they are in, on the mean over their nodes */
static PetscErrorCode remark_coarse(Elastic *e, Couple c)
{
  const SolidsState *s = e->s;
  PetscReal         *size; /* [ngroups] sum and number of cells */

  PetscFunctionBeginUser;
  if (e->once.compared) PetscFunctionReturn(PETSC_SUCCESS);
  e->once.compared = PETSC_TRUE;
  PetscCall(PetscCalloc1(2 * s->ngroups, &size));
  for (PetscInt i = 0; i < e->node.n; i++) {
    PetscReal xc[MESH_MAX_NB * 3], x[3], J[9];
    PetscInt  k, node, g;

    if (e->node.cell[i] < 0) continue;
    g = (PetscInt)(group_of_node(s, i, &k, &node) - s->group);
    PetscCall(MeshCellCoordinates(c->mesh, e->node.cell[i], xc));
    ElementMap(s->dim, xc, e->node.xi + s->dim * i, x, J);
    size[2 * g] += 2 * (s->dim == 2 ? PetscSqrtReal(PetscAbsReal(DenseDeterminant(2, J)))
                                    : PetscCbrtReal(PetscAbsReal(DenseDeterminant(3, J))));
    size[2 * g + 1] += 1;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, size, (PetscMPIInt)(2 * s->ngroups), MPIU_REAL, MPIU_SUM, c->comm));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    const PetscReal mean = size[2 * g] / size[2 * g + 1];

    if (s->group[g].mesh.h > SMALLER * mean)
      PetscCall(
        LogRemark("group '%s' has cells of size %.3g in cells of the flow of %.3g: what the flow can do between its nodes has no stiffness, and it is "
                  "too soft by an amount that depends on the mesh; give -particle_%s_solid_size %.2g, or -particle_%s_solid_cells likewise",
                  s->group[g].name, (double)s->group[g].mesh.h, (double)mean, s->group[g].name,
                  (double)(SOLID_FINER * mean), s->group[g].name));
  }
  PetscCall(PetscFree(size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticMap(Elastic *e, Couple c)
{
  PointCells cells[2];
  PetscInt   lost, *point;
  PetscReal *x;

  PetscFunctionBeginUser;
  PetscCall(begin_search(e, c, e->x, cells));
  PetscCall(find_points(e, c, cells, e->s->first, e->x, &e->node, &lost));
  if (lost >= 0) PetscCall(stop_lost(e, c, lost));
  PetscCall(list_points(e, &point, &x));
  PetscCall(find_points(e, c, cells, point, x, &e->point, &lost));
  PetscCall(PetscFree(point));
  PetscCall(PetscFree(x));
  for (PetscInt i = 0; i < 2; i++) PetscCall(PointCellsDestroy(&cells[i]));
  PetscCall(fill_map(e, c));
  PetscCall(remark_coarse(e, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the first step ---- */

/* Solids whose velocity is not given start with that of the flow at their nodes: another one would be a kick */
static PetscErrorCode start_with_flow(Elastic *e, Couple c)
{
  SolidsState *s = e->s;
  PointCells   cells[2];
  PetscInt     lost;
  PetscReal   *u;

  PetscFunctionBeginUser;
  e->once.started = PETSC_TRUE;
  PetscCall(PetscArraycpy(e->x, s->x, s->nnode * s->dim));
  PetscCall(begin_search(e, c, s->x, cells));
  PetscCall(find_points(e, c, cells, s->first, s->x, &e->node, &lost));
  if (lost >= 0) PetscCall(stop_lost(e, c, lost));
  for (PetscInt i = 0; i < 2; i++) PetscCall(PointCellsDestroy(&cells[i]));
  PetscCall(fill_map(e, c));
  PetscCall(FlowGetFields(c->flow, &u, NULL, NULL));
  PetscCall(ElasticTakeVelocity(e, c, u));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscInt at = s->dim * s->first[k], n = s->dim * s->first[k + 1] - at;

    if (s->group[s->group_of[k]].start) continue;
    PetscCall(PetscArraycpy(s->u + at, e->u + at, n));
    PetscCall(PetscArraycpy(s->u_old + at, e->u + at, n));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is the strain with which solid k is predicted as it turns, the square of the angle, so much for its stiffness that
   the force of it drives the next step? Held ones cannot go round. */
static PetscBool is_strained(const Elastic *e, Couple c, PetscInt k)
{
  const SolidsState *s   = e->s;
  const SolidGroup  *g   = s->group + s->group_of[k];
  const PetscReal   *u   = s->u + s->dim * s->first[k];
  PetscReal          far = 0, mean[3];

  if (g->membrane || g->nclamped) return PETSC_FALSE;
  SolidMeanVelocity(&g->mesh, s->x + s->dim * s->first[k], u, mean);
  for (PetscInt i = 0; i < g->mesh.nnode; i++) {
    PetscReal v2 = 0;

    for (PetscInt a = 0; a < s->dim; a++) v2 += PetscSqr(u[s->dim * i + a] - mean[a]);
    far = PetscMax(far, v2);
  }
  return (PetscBool)(g->stiffness * c->step->dt / c->par->viscosity * far * PetscSqr(c->step->dt / g->mesh.radius) >
                     STRAINED);
}

PetscErrorCode ElasticPredict(Elastic *e, Couple c)
{
  const SolidsState *s       = e->s;
  const FlowStep    *step    = c->step;
  const PetscReal    ratio   = step->order == 2 && step->dt_old > 0 ? step->dt / step->dt_old : 0;
  PetscBool          relaxed = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (s->time_dt == 0 && !e->once.started) PetscCall(start_with_flow(e, c));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal more = s->group[s->group_of[k]].membrane ? 0 : ratio;

    for (PetscInt i = s->dim * s->first[k]; i < s->dim * s->first[k + 1]; i++) {
      e->a[i] = (step->d0 * s->x[i] + step->d1 * s->x_old[i]) / step->ct;
      e->x[i] = e->a[i] + (s->u[i] + more * (s->u[i] - s->u_old[i])) / step->ct;
    }
  }
  for (PetscInt k = s->own[0]; k < s->own[1]; k++) {
    if (!is_strained(e, c, k)) continue;
    relaxed = PETSC_TRUE;
    PetscCall(SolidsRelax(e->solids, k, 1 / step->ct, e->x + s->dim * s->first[k]));
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &relaxed, 1, COMPAT_MPI_BOOL, MPI_LOR, c->comm));
  if (relaxed) PetscCall(SolidsExchangeNodes(s, s->dim, e->x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticFindEnd(Elastic *e, Couple c)
{
  const SolidsState *s = e->s;

  PetscFunctionBeginUser;
  for (PetscInt k = s->own[0]; k < s->own[1]; k++) {
    const SolidGroup *g     = s->group + s->group_of[k];
    const PetscInt    first = s->dim * s->first[k], last = s->dim * s->first[k + 1];

    for (PetscInt i = first; i < last; i++) e->end[i] = e->a[i] + e->u[i] / c->step->ct;
    if (g->membrane || (!g->compressible && !g->nclamped))
      PetscCall(SolidKeepVolume(&g->mesh, g->clamped, ElasticTensionsGetArea(e, k), e->end + first, e->kept + k));
  }
  PetscCall(SolidsExchangeNodes(s, s->dim, e->end));
  PetscCall(SolidsExchange(s, 1, e->kept));
  PetscFunctionReturn(PETSC_SUCCESS);
}
