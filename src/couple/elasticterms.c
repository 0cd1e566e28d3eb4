/* Elastic, terms: matrix, force and continuity of the solids at their predicted positions, for the flow. */
#include "compat.h"
#include "elastic.h"
#include "elasticgap.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/array.h"
#include "bodies/local.h"
#include "fem/element.h"

#define AWAY     2     /* cells */
#define ROUNDING 1e-13 /* of a solid's cell */
/* Stress of immersed solids over that of the fluid in a step: so much the solver takes without a block
   (runs/studies/elastic), and so much without factors of pressures (runs/studies/elastic-space) */
#define COMPLIANT 3
#define STIFF     100

/* Numbers of a step that cells of a solid need */
typedef struct {
  PetscReal ct, bdt, d0, d1, excess, gravity[3]; /* excess: density that is counted here */
  PetscBool at_rest;                             /* the solid stays where it was made */
} StepNumbers;

PetscReal ElasticExcess(const Elastic *e, Couple c, PetscInt k)
{
  const SolidGroup *g = e->s->group + e->s->group_of[k];

  return g->membrane ? 0 : g->density - c->par->density;
}

/* Is solid k predicted to stay where it was made? Its stress is nothing but rounding then, of which no flow is to
   come. */
static PetscBool is_at_rest(const Elastic *e, PetscInt k)
{
  const SolidsState *s   = e->s;
  const PetscInt     dim = s->dim;
  const PetscReal    h   = s->group[s->group_of[k]].mesh.h;

  for (PetscInt i = dim * s->first[k]; i < dim * s->first[k + 1]; i++)
    if (PetscMax(PetscAbsReal(e->x[i] - s->X[i]), PetscAbsReal(e->a[i] - s->X[i])) > ROUNDING * h) return PETSC_FALSE;
  return PETSC_TRUE;
}

static StepNumbers get_numbers(const Elastic *e, Couple c, PetscInt k)
{
  const FlowStep *s = c->step;
  StepNumbers     n = {s->ct, 1 / s->ct,       s->d0, s->d1, ElasticIsLined(e, k) ? 0 : ElasticExcess(e, c, k),
                       {0},   is_at_rest(e, k)};

  for (PetscInt a = 0; a < 3; a++) n.gravity[a] = c->par->gravity[a];
  return n;
}

/* Matrix A [n][n] and force r [n] of cell `cell` of solid k */
static void add_cell(const Elastic *e, const StepNumbers *s, PetscInt k, PetscInt cell, PetscReal A[], PetscReal r[])
{
  const SolidGroup *g   = e->s->group + e->s->group_of[k];
  const SolidMesh  *m   = &g->mesh;
  SolidMaterial     law = g->material;
  const PetscInt    dim = m->dim, nb = m->nb, n = nb * dim, at = dim * e->s->first[k];
  PetscReal         x[SOLID_MAX_N], a[SOLID_MAX_N], now[SOLID_MAX_N], old[SOLID_MAX_N], M[27 * 27],
    V[SOLID_MAX_N * SOLID_MAX_N];

  SolidGather(m, cell, e->x + at, x);
  SolidGather(m, cell, e->a + at, a);
  SolidGather(m, cell, e->s->u + at, now);
  SolidGather(m, cell, e->s->u_old + at, old);
  law.kappa   = law.lambda; /* the pressure's */
  law.tension = e->s->tension[k];
  (void)SolidCellForce(m, &law, cell, x, r, A);
  for (PetscInt i = 0; i < n; i++) {
    r[i] = s->at_rest ? 0 : -r[i];
    for (PetscInt j = 0; j < n && !s->at_rest; j++) r[i] -= A[i * n + j] * (a[j] - x[j]);
  }
  for (PetscInt i = 0; i < n * n; i++) A[i] *= s->bdt;
  if (s->excess != 0) SolidCellMass(m, cell, M);
  for (PetscInt i = 0; i < n && s->excess != 0; i++)
    for (PetscInt j = 0; j < nb; j++) {
      const PetscInt  to = j * dim + i % dim;
      const PetscReal w  = s->excess * M[i / dim * nb + j];

      A[i * n + to] += s->ct * w;
      r[i] += w * (s->d0 * now[to] + s->d1 * old[to] + s->gravity[i % dim]);
    }
  if (g->viscosity == 0) return;
  SolidCellViscosity(m, cell, x, V);
  for (PetscInt i = 0; i < n * n; i++) A[i] += g->viscosity * V[i];
}

/* Numbers n of nodes, itself and later ones, that the row of node i of a solid has entries at, those before `end` of it
   and others: what cells tie, or bending, which ties what is around a node. seen [nnode]: at first -1 */
static void count_row(const SolidGroup *g, PetscInt i, PetscInt end, PetscInt seen[], PetscInt n[2])
{
  const SolidMesh *m = &g->mesh;

  n[0] = n[1] = 0;
  for (PetscInt j = m->around[i]; j < m->around[i + 1]; j++) {
    const PetscInt  at   = m->neighbour[j];
    const PetscBool far  = (PetscBool)(g->material.bending > 0);
    const PetscInt *node = far ? m->neighbour + m->around[at] : &at,
                   count = far ? m->around[at + 1] - m->around[at] : 1;

    for (PetscInt e = 0; e < count; e++) {
      if (seen[node[e]] == i || node[e] < i) continue;
      seen[node[e]] = i;
      n[node[e] >= end]++;
    }
  }
}

/* Blocks of the rows of nodes from `start` to `end`, of columns among these and of others */
static PetscErrorCode count_entries(const Elastic *e, PetscInt start, PetscInt end, PetscInt own[], PetscInt others[])
{
  const SolidsState *s = e->s;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const SolidGroup *g = s->group + s->group_of[k];
    PetscInt         *seen, n[2], first = s->first[k];

    PetscCall(PetscMalloc1(g->mesh.nnode, &seen));
    for (PetscInt i = 0; i < g->mesh.nnode; i++) seen[i] = -1;
    for (PetscInt i = PetscMax(start, first); i < PetscMin(end, s->first[k + 1]); i++) {
      count_row(g, i - first, end - first, seen, n);
      own[i - start]    = n[0];
      others[i - start] = n[1];
    }
    PetscCall(PetscFree(seen));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What two solids that touch have in each other's rows comes on top, at most so many; n own nodes */
static PetscErrorCode count_contacts(const Elastic *e, MPI_Comm comm, PetscInt n, PetscInt own[], PetscInt others[])
{
  const PetscReal *more;
  Vec              entries;

  PetscFunctionBeginUser;
  PetscCall(VecCreateMPI(comm, n, PETSC_DETERMINE, &entries));
  PetscCall(ElasticCountContacts(e, entries));
  PetscCall(VecGetArrayRead(entries, &more));
  for (PetscInt i = 0; i < n; i++) {
    own[i]    = PetscMin(n, own[i] + (PetscInt)more[i]);
    others[i] = PetscMin(e->s->nnode - n, others[i] + (PetscInt)more[i]);
  }
  PetscCall(VecRestoreArrayRead(entries, &more));
  PetscCall(VecDestroy(&entries));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticCreateMatrix(Elastic *e, MPI_Comm comm)
{
  const PetscInt dim = e->s->dim;
  PetscInt       n = PETSC_DECIDE, all = e->s->nnode, end, *own, *others;

  PetscFunctionBeginUser;
  PetscCall(PetscSplitOwnership(comm, &n, &all));
  PetscCallMPI(MPI_Scan(&n, &end, 1, MPIU_INT, MPI_SUM, comm));
  PetscCall(PetscMalloc2(n, &own, n, &others));
  PetscCall(count_entries(e, end - n, end, own, others));
  if (e->contacts.joined) PetscCall(count_contacts(e, comm, n, own, others));
  PetscCall(MatCreateSBAIJ(comm, dim, dim * n, dim * n, PETSC_DETERMINE, PETSC_DETERMINE, 0, own, 0, others, &e->K));
  PetscCall(MatSetOption(e->K, MAT_IGNORE_LOWER_TRIANGULAR, PETSC_TRUE));
  PetscCall(MatSetOption(e->K, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
  PetscCall(PetscFree2(own, others));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Empty, with room for what touches in this step, and without the entries of what did in the step before, which a
   restart would not know */
static PetscErrorCode clear_matrix(Elastic *e, Couple c)
{
  const PetscBool before = e->contacts.joined;

  PetscFunctionBeginUser;
  e->contacts.joined = PETSC_FALSE;
  for (PetscInt i = 0; i < e->contacts.n; i++)
    for (PetscInt j = 0; j < ELASTIC_SIDE; j++)
      e->contacts.joined = (PetscBool)(e->contacts.joined || e->contacts.list[i].weight[j] != 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &e->contacts.joined, 1, COMPAT_MPI_BOOL, MPI_LOR, c->comm));
  if (before || e->contacts.joined) {
    PetscCall(MatDestroy(&e->K));
    PetscCall(ElasticCreateMatrix(e, c->comm));
  }
  PetscCall(MatZeroEntries(e->K));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bending of solid k, by the rank that has the row of a node */
static PetscErrorCode add_bending(Elastic *e, PetscInt k, PetscReal bdt)
{
  const SolidGroup *g   = e->s->group + e->s->group_of[k];
  const SolidMesh  *m   = &g->mesh;
  const PetscInt    dim = m->dim, first = e->s->first[k];
  PetscReal        *f;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(dim * m->nnode, &f));
  (void)SolidBend(m, g->material.bending, e->x + dim * first, f);
  for (PetscInt i = PetscMax(0, e->nodes[0] - first); i < PetscMin(m->nnode, e->nodes[1] - first); i++) {
    const PetscInt   n = m->around[i + 1] - m->around[i];
    const PetscReal *v = m->laplace + m->around[i];
    PetscReal        A[SOLID_MAX_AROUND * SOLID_MAX_AROUND], r[SOLID_MAX_AROUND];

    for (PetscInt j = 0; j < n * n; j++) A[j] = bdt * v[j / n] * v[j % n];
    for (PetscInt a = 0; a < dim; a++) {
      const PetscInt own = dim * (first + i) + a;
      PetscInt       row[SOLID_MAX_AROUND];
      PetscReal      way = 0, force = -f[dim * i + a];

      for (PetscInt j = 0; j < n; j++) {
        row[j] = dim * (first + m->neighbour[m->around[i] + j]) + a;
        way += v[j] * (e->a[row[j]] - e->x[row[j]]);
      }
      for (PetscInt j = 0; j < n; j++) r[j] = -v[j] * way;
      PetscCall(MatSetValues(e->K, n, row, n, row, A, ADD_VALUES));
      PetscCall(VecSetValues(e->fs, n, row, r, ADD_VALUES));
      PetscCall(VecSetValue(e->fs, own, force, ADD_VALUES));
    }
  }
  PetscCall(PetscFree(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* K and fs: cells go to the rank that has the row of their first node */
static PetscErrorCode assemble_solids(Elastic *e, Couple c)
{
  const SolidsState *s = e->s;

  PetscFunctionBeginUser;
  PetscCall(clear_matrix(e, c));
  PetscCall(VecZeroEntries(e->fs));
  for (PetscInt k = 0; k < s->n; k++) {
    const SolidMesh  *m       = &s->group[s->group_of[k]].mesh;
    const StepNumbers numbers = get_numbers(e, c, k);

    for (PetscInt cell = 0; cell < m->ncell; cell++) {
      const PetscInt first = s->first[k] + m->cell_node[cell * m->nb];
      PetscReal      A[SOLID_MAX_N * SOLID_MAX_N], r[SOLID_MAX_N];
      PetscInt       node[27];

      if (first < e->nodes[0] || first >= e->nodes[1]) continue;
      add_cell(e, &numbers, k, cell, A, r);
      for (PetscInt i = 0; i < m->nb; i++) node[i] = s->first[k] + m->cell_node[cell * m->nb + i];
      PetscCall(MatSetValuesBlocked(e->K, m->nb, node, m->nb, node, A, ADD_VALUES));
      PetscCall(VecSetValuesBlocked(e->fs, m->nb, node, r, ADD_VALUES));
    }
    if (s->group[s->group_of[k]].material.bending > 0) PetscCall(add_bending(e, k, numbers.bdt));
  }
  PetscCall(ElasticAddContacts(e, 1 / c->step->ct));
  PetscCall(MatAssemblyBegin(e->K, MAT_FINAL_ASSEMBLY));
  PetscCall(VecAssemblyBegin(e->fs));
  PetscCall(VecAssemblyEnd(e->fs));
  PetscCall(MatAssemblyEnd(e->K, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- continuity ---- */

/* The entry of an own cell among the terms of continuity, zeros at first */
static PetscErrorCode find_volume(Elastic *e, PetscInt nk, PetscInt cell, PetscInt entry[], PetscInt *at)
{
  PetscFunctionBeginUser;
  *at = entry[cell];
  if (*at >= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ArrayReserve(e->volumes.n + 1, &e->volumes.capacity, &e->volumes.cell, sizeof(*e->volumes.cell),
                         &e->volumes.C, (size_t)(nk * nk) * sizeof(*e->volumes.C), &e->volumes.g,
                         (size_t)nk * sizeof(*e->volumes.g), NULL));
  *at = entry[cell]    = e->volumes.n++;
  e->volumes.cell[*at] = cell;
  PetscCall(PetscArrayzero(e->volumes.C + *at * nk * nk, nk * nk));
  PetscCall(PetscArrayzero(e->volumes.g + *at * nk, nk));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What a step leaves of the error of incompressible volumes: nothing, but it goes no faster than with the steps that
   were asked for. Shorter ones, taken since something moves too far, would move it the faster the shorter they are. */
static PetscReal find_left(Couple c)
{
  return c->step->dt < c->dt_asked ? 1 - c->step->dt / c->dt_asked : 0;
}

/* At one quadrature point: J and ((J - 1 - left (J_n - 1))/J + div (a - x))/bdt, the rate at which the volume is to
   shrink: of the error that is there, at the positions `now`, that part is left, of what the prediction adds nothing */
static PetscReal shrinking(const SolidMesh *m, PetscInt cell, PetscInt q, const PetscReal x[], const PetscReal a[],
                           const PetscReal now[], PetscReal bdt, PetscReal left, PetscReal *J)
{
  PetscReal       F[9], G[9], inv[9], div = 0;
  const PetscReal error = left > 0 ? left * (SolidGradient(m, cell, q, now, F) - 1) : 0;

  *J = SolidGradient(m, cell, q, x, F);
  (void)DenseInvertMap(m->dim, F, inv);
  (void)SolidGradient(m, cell, q, a, G);
  for (PetscInt i = 0; i < m->dim; i++)
    for (PetscInt A = 0; A < m->dim; A++) div += (G[i * m->dim + A] - F[i * m->dim + A]) * inv[A * m->dim + i];
  return ((*J - 1 - error) / *J + div) / bdt;
}

static PetscErrorCode add_volume_point(Elastic *e, Couple c, const SolidGroup *g, PetscInt point, PetscReal w,
                                       PetscReal rate, PetscReal J, PetscInt entry[])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, nk = dim + 1, cell = e->point.cell[point];
  const PetscReal  give = g->compressible ? w * c->step->ct / (g->material.lambda * J) : 0;
  const PetscReal *h;
  PetscReal        phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB], xc[MESH_MAX_NB * 3], psi[4] = {1};
  PetscInt         at;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(c->flow, &h));
  PetscCall(MeshCellCoordinates(c->mesh, cell, xc));
  ElementBasis(dim, e->point.xi + dim * point, phi, dphi);
  for (PetscInt a = 0; a < dim; a++) {
    for (PetscInt j = 0; j < l->nb; j++) psi[1 + a] += phi[j] * xc[dim * j + a];
    psi[1 + a] = (psi[1 + a] - xc[l->nb / 2 * dim + a]) / h[cell];
  }
  PetscCall(find_volume(e, nk, cell, entry, &at));
  for (PetscInt i = 0; i < nk * nk; i++) e->volumes.C[at * nk * nk + i] += give * psi[i / nk] * psi[i % nk];
  for (PetscInt i = 0; i < nk; i++) e->volumes.g[at * nk + i] -= w * rate * psi[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal cell_width(const MeshLocal *l, PetscInt cell)
{
  const PetscInt *node = l->cell_node + cell * l->nb;
  PetscReal       most = 0;

  for (PetscInt a = 0; a < l->dim; a++)
    most = PetscMax(most,
                    PetscAbsReal(MeshNearest(l, a, l->x[l->dim * node[l->nb - 1] + a] - l->x[l->dim * node[0] + a])));
  return most;
}

/* Is an own cell at some distance from all rigid bodies? */
static PetscBool is_away(Couple c, PetscInt cell)
{
  const MeshLocal *l     = c->loc;
  const PetscReal *x     = l->x + l->dim * l->cell_node[cell * l->nb + l->nb / 2];
  const PetscReal  reach = AWAY * cell_width(l, cell);

  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal r2 = 0;

    if (c->s->removed[k]) continue;
    for (PetscInt a = 0; a < l->dim; a++) r2 += PetscSqr(MeshNearest(l, a, x[a] - c->rigid.X[k][a]));
    if (r2 < PetscSqr(BodiesGetRadius(c->s, k) + reach)) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

/* In a closed domain the volume that solids get back is the fluid's: in equal parts from the own cells at some distance
   from rigid bodies, beside which there may be no velocity that could bring it */
static PetscErrorCode balance_volumes(Elastic *e, Couple c, PetscInt entry[])
{
  const MeshLocal *l      = c->loc;
  const PetscInt   nk     = l->dim + 1;
  PetscReal        sum[2] = {0, 0}; /* volume, cells */
  PetscBool        floating, *away;

  PetscFunctionBeginUser;
  PetscCall(ConditionsPressureIsFloating(FlowConditions(c->flow), &floating));
  if (!floating || !c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(l->ncell, &away));
  for (PetscInt i = 0; i < e->volumes.n; i++) sum[0] += e->volumes.g[i * nk];
  for (PetscInt i = 0; i < l->ncell; i++) {
    away[i] = is_away(c, i);
    sum[1] += away[i];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, c->comm));
  for (PetscInt i = 0; i < l->ncell && sum[1] > 0; i++) {
    PetscInt at;

    if (!away[i]) continue;
    PetscCall(find_volume(e, nk, i, entry, &at));
    e->volumes.g[at * nk] -= sum[0] / sum[1];
  }
  PetscCall(PetscFree(away));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode assemble_volumes(Elastic *e, Couple c, PetscBool *any_C)
{
  const SolidsState *s     = e->s;
  const PetscReal    left  = find_left(c);
  PetscInt           point = 0, *entry;

  PetscFunctionBeginUser;
  e->volumes.n = 0;
  *any_C       = PETSC_FALSE;
  PetscCall(PetscMalloc1(c->loc->ncell, &entry));
  for (PetscInt i = 0; i < c->loc->ncell; i++) entry[i] = -1;
  for (PetscInt k = 0; k < s->n; k++) {
    const SolidGroup *g = s->group + s->group_of[k];
    const SolidMesh  *m = &g->mesh;

    *any_C                  = (PetscBool)(*any_C || g->compressible);
    const PetscBool at_rest = is_at_rest(e, k);

    if (!e->node.reached[k]) point += g->membrane ? 0 : m->ncell * m->nq;
    for (PetscInt cell = 0; cell < m->ncell && !g->membrane && e->node.reached[k]; cell++) {
      PetscReal x[SOLID_MAX_N], a[SOLID_MAX_N], now[SOLID_MAX_N];

      SolidGather(m, cell, e->x + m->dim * s->first[k], x);
      SolidGather(m, cell, e->a + m->dim * s->first[k], a);
      SolidGather(m, cell, s->x + m->dim * s->first[k], now);
      for (PetscInt q = 0; q < m->nq; q++, point++) {
        PetscReal J, rate;

        if (e->point.cell[point] < 0) continue;
        rate = shrinking(m, cell, q, x, a, now, 1 / c->step->ct, g->compressible ? 0 : left, &J);
        if (at_rest) rate = 0;
        PetscCall(add_volume_point(e, c, g, point, m->weight[cell * m->nq + q] * J, rate, J, entry));
      }
    }
  }
  if (!*any_C) PetscCall(balance_volumes(e, c, entry));
  PetscCall(PetscFree(entry));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inertia and weight of solids that the mesh follows: the flow has none inside of them */
static PetscErrorCode assemble_inertia(Elastic *e, Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(e->lumped, c->loc->nnode_all));
  PetscCall(ElasticInertiaAssemble(&e->inertia, c->flow, c->step, e->s, e->x, e->labels.cell_solid, e->lumped));
  PetscCall(MeshSumNodes(c->mesh, 1, e->lumped));
  PetscCall(MeshSyncNodes(c->mesh, 1, e->lumped));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Largest stress of a group in a step over that of the fluid, by the viscosity that it is like */
static PetscReal stiffest(const Elastic *e, Couple c)
{
  const PetscReal bdt  = 1 / c->step->ct;
  PetscReal       most = 0;

  for (PetscInt g = 0; g < e->s->ngroups; g++) {
    const SolidGroup *group     = e->s->group + g;
    const PetscReal   h         = group->mesh.h;
    const PetscReal   stiffness = group->membrane ? group->material.mu / h + group->material.bending / (h * h * h)
                                                  : group->material.mu;

    most = PetscMax(most, bdt * stiffness + group->viscosity);
  }
  return most / c->par->viscosity;
}

/* flat: in space cells inside of a membrane that the mesh is lined up with have flat corners, which the smoother of the
   velocity does not see through (runs/studies/capsules): they are the block's, with their pressures */
PetscErrorCode ElasticAssemble(Elastic *e, Couple c)
{
  const PetscBool lined     = (PetscBool)(e->align && SolidsHave(e->s, PETSC_FALSE));
  const PetscBool cut       = (PetscBool)(!lined || e->labels.immersed || SolidsHave(e->s, PETSC_TRUE));
  const PetscBool flat      = (PetscBool)(e->align && e->s->dim == 3 && SolidsHave(e->s, PETSC_TRUE));
  const PetscReal stiffness = stiffest(e, c);
  PetscBool       any_C;
  Vec             force;

  PetscFunctionBeginUser;
  PetscCall(assemble_solids(e, c));
  PetscCall(
    VecCreateMPIWithArray(c->comm, c->loc->dim, c->loc->nnode * c->loc->dim, PETSC_DETERMINE, e->force, &force));
  PetscCall(MatMultTranspose(e->P, e->fs, force));
  PetscCall(VecDestroy(&force));
  PetscCall(ElasticTensionsSet(e, c));
  if (lined) PetscCall(assemble_inertia(e, c));
  PetscCall(FlowAddOperator(c->flow, e,
                            &(FlowOperator){.E         = e->K,
                                            .P         = e->P,
                                            .lumped    = e->align ? e->lumped : NULL,
                                            .force     = e->force,
                                            .compliant = !lined && !flat && stiffness <= COMPLIANT,
                                            .stiff     = cut && (flat || stiffness > STIFF)}));
  PetscCall(assemble_volumes(e, c, &any_C));
  PetscCall(FlowAddVolume(c->flow, e,
                          &(FlowVolume){.n     = e->volumes.n,
                                        .cell  = e->volumes.cell,
                                        .C     = any_C ? e->volumes.C : NULL,
                                        .g     = e->volumes.g,
                                        .any_C = any_C}));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticTakeVelocity(Elastic *e, Couple c, const PetscReal u[])
{
  Vec              flow;
  const PetscReal *all;

  PetscFunctionBeginUser;
  PetscCall(VecCreateMPIWithArray(c->comm, c->loc->dim, c->loc->nnode * c->loc->dim, PETSC_DETERMINE, u, &flow));
  PetscCall(MatMult(e->P, flow, e->us));
  PetscCall(VecDestroy(&flow));
  PetscCall(VecScatterBegin(e->gather, e->us, e->all, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(VecScatterEnd(e->gather, e->us, e->all, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(VecGetArrayRead(e->all, &all));
  PetscCall(PetscArraycpy(e->u, all, e->s->nnode * e->s->dim));
  PetscCall(VecRestoreArrayRead(e->all, &all));
  PetscFunctionReturn(PETSC_SUCCESS);
}
