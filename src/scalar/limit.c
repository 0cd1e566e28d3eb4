/* Scalars, stabilisation where convection dominates a cell (cell Peclet number above 1) and the solution is not smooth:
   there the cell's matrix passes into one of low order. The low-order matrix has a lumped mass and, for each pair of
   nodes, as much diffusion as makes its entries outside the diagonal negative (discrete upwinding, Kuzmin & Turek
   2002), so that no new extremum arises. Of what this adds as much is taken back, pair by pair, as leaves each node
   within the values that its cells had (algebraic flux correction with the limiter of Barrenechea, John & Knobloch
   2016). It is symmetric and its columns add up to zero: nothing appears or is lost, the balance closes as without.

   Smooth is what has continuous gradients: their jumps between cells, over the gradients, are of higher order in h, at
   extrema too, and nothing is limited where they are small. Limits go by the solution: by the extrapolated one at
   first, then by what was solved for, until that stays within its bounds.

   Not beside bodies, where gradients may jump, unless values leave their bounds; not with a mean gradient, under which
   extrema arise. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"

#define PECLET 1    /* cell Peclet number |w| h/(2 D) at which it begins; it is whole at twice that */
#define JUMP   0.3  /* jump of the gradient over the gradient of a cell that is not smooth, */
#define POWER  8    /* the part of a smoother one goes with this power */
#define SMALL  1e-3 /* part that is none */
#define NOISE  2e-3 /* changes over a cell by less than this part of the range of the field do not count */
#define FLAT   1e-9 /* a range by less of its values is round-off */
#define BEYOND 1e-3 /* nor do values that are out of bounds by less; */
#define FAR    1e-2 /* cells with one that is by more are of low order altogether */

enum {
  COUNT,
  SQUARE,
  OTHERS,
  SLOPE,
  NUMBERS = SLOPE + 3
};

/* Convecting over conducting in cell c with velocities w [nb][dim] at its lattice points: |w|^2/(|J^-1 w| D), which is
   |w| h/(2 D) with h its length along w */
static PetscReal find_peclet(Scalars all, const Scalar *s, PetscInt c, const PetscReal xc[], const PetscReal w[])
{
  const PetscInt  dim = all->loc->dim, nb = all->loc->nb;
  const PetscReal capacity     = s->cells.capacity ? s->cells.capacity[c] : s->par.capacity,
                  conductivity = s->cells.conductivity ? s->cells.conductivity[c] : s->par.conductivity;
  PetscReal xi[3] = {0, 0, 0}, x[3], J[9], inverse[9], largest = 0;

  ElementMap(dim, xc, xi, x, J);
  (void)DenseInvertMap(dim, J, inverse);
  for (PetscInt j = 0; j < nb; j++) {
    PetscReal speed = 0, along = 0;

    for (PetscInt e = 0; e < dim; e++) {
      PetscReal a = 0;

      for (PetscInt k = 0; k < dim; k++) a += inverse[e * dim + k] * w[j * dim + k];
      along += a * a;
      speed += PetscSqr(w[j * dim + e]);
    }
    if (along > 0) largest = PetscMax(largest, speed / PetscSqrtReal(along));
  }
  return largest * capacity / PetscMax(conductivity, PETSC_MIN_REAL);
}

/* Derivatives of v [nb] along the axes of the cell at its lattice points: dv [dim][nb] */
static void differentiate(PetscInt dim, PetscInt nb, PetscInt stride, const PetscReal v[], PetscReal dv[])
{
  static const PetscReal D[3][3]  = {{-1.5, 2, -0.5}, {-0.5, 0, 0.5}, {0.5, -2, 1.5}};
  static const PetscInt  POWER3[] = {1, 3, 9};

  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt j = 0; j < nb; j++) {
      const PetscInt at = j / POWER3[a] % 3, first = j - at * POWER3[a];

      dv[a * nb + j] = 0;
      for (PetscInt k = 0; k < 3; k++) dv[a * nb + j] += D[at][k] * v[(first + k * POWER3[a]) * stride];
    }
}

/* Gradients g [nb][3] of x in a cell at its lattice points, and its size */
static void find_gradients(Scalars all, const Scalar *s, const PetscReal xc[], const PetscReal x[], PetscReal g[][3])
{
  const PetscInt dim = all->loc->dim, nb = all->loc->nb;
  PetscReal      dT[3 * MESH_MAX_NB], dx[3][3 * MESH_MAX_NB];

  differentiate(dim, nb, 1, x, dT);
  for (PetscInt a = 0; a < dim; a++) differentiate(dim, nb, dim, xc + a, dx[a]);
  for (PetscInt j = 0; j < nb; j++) {
    PetscReal J[9], inverse[9];

    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt e = 0; e < dim; e++) J[a * dim + e] = dx[a][e * nb + j];
    (void)DenseInvertMap(dim, J, inverse);
    for (PetscInt a = 0; a < dim; a++) {
      g[j][a] = s->par.gradient[a];
      for (PetscInt e = 0; e < dim; e++) g[j][a] += inverse[e * dim + a] * dT[e * nb + j];
    }
  }
}

/* Is it of the fluid as a whole? */
static PetscBool is_plain(const Scalar *s, PetscInt c)
{
  return (PetscBool)((!s->cells.sample || s->cells.sample[c] < 0) &&
                     (!s->cells.conductivity || s->cells.conductivity[c] == s->par.conductivity));
}

/* sum [nnode_all][NUMBERS] over the cells around a node: their number, gradients and squares of these; number of those
   that are not of the fluid */
static PetscErrorCode sum_gradients(Scalars all, const Scalar *s, PetscReal sum[])
{
  const MeshLocal *l = all->loc;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(sum, l->nnode_all * NUMBERS));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xc[MESH_MAX_NB * 3], x[MESH_MAX_NB], g[MESH_MAX_NB][3];

    for (PetscInt j = 0; j < l->nb && !is_plain(s, c); j++) sum[l->cell_node[c * l->nb + j] * NUMBERS + OTHERS]++;
    if (!is_plain(s, c)) continue;
    PetscCall(ScalarCellCoordinates(all, c, xc));
    ScalarCellGather(l, c, 1, s->x, x);
    find_gradients(all, s, xc, x, g);
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt node = ScalarLimitNode(l, c, j);

      if (node < 0) continue;
      sum[node * NUMBERS + COUNT]++;
      for (PetscInt a = 0; a < l->dim; a++) {
        sum[node * NUMBERS + SLOPE + a] += g[j][a];
        sum[node * NUMBERS + SQUARE] += PetscSqr(g[j][a]);
      }
    }
  }
  PetscCall(MeshSyncNodes(all->mesh, NUMBERS, sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Part of cell c by the sums at its nodes; noise: gradient that does not count. Beside bodies gradients may jump. */
static PetscReal find_part(const MeshLocal *l, PetscInt c, const PetscReal sum[], PetscReal noise)
{
  PetscReal slope = 0, jump = 0;

  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscReal *at   = sum + l->cell_node[c * l->nb + j] * NUMBERS;
    PetscReal        mean = 0;

    if (at[OTHERS] > 0) return 0;
    if (at[COUNT] == 0) continue;
    for (PetscInt a = 0; a < l->dim; a++) mean += PetscSqr(at[SLOPE + a] / at[COUNT]);
    slope = PetscMax(slope, at[SQUARE] / at[COUNT]);
    jump  = PetscMax(jump, at[SQUARE] / at[COUNT] - mean);
  }
  jump = PetscPowRealInt(PetscSqrtReal(jump) / (JUMP * (PetscSqrtReal(slope) + noise)), POWER);
  return jump < SMALL ? 0 : PetscMin(1, jump);
}

/* At a node: sum of fluxes that raise it, and that lower it; what scales its room for them; bounds */
typedef struct {
  PetscReal rise, fall, weight, top, bottom;
  PetscBool low; /* nothing is taken back there */
} NodeLimits;

/* Of the values of a cell: those that the step began with, or is given; without time those of now */
static void add_bounds(Scalars all, const Scalar *s, const PetscInt node[], const PetscReal x[], NodeLimits at[])
{
  PetscReal top = -PETSC_MAX_REAL, bottom = PETSC_MAX_REAL;

  for (PetscInt j = 0; j < all->loc->nb; j++) {
    const PetscReal v = node[j] >= 0 && s->owner[node[j]] < 0 && all->step.ct > 0 ? s->T[node[j]] : x[j];

    top    = PetscMax(top, v);
    bottom = PetscMin(bottom, v);
  }
  for (PetscInt j = 0; j < all->loc->nb; j++) {
    if (node[j] < 0) continue;
    at[node[j]].top    = PetscMax(top, at[node[j]].top);
    at[node[j]].bottom = PetscMin(bottom, at[node[j]].bottom);
  }
}

/* Fluxes that cell c would take away */
static PetscErrorCode add_fluxes(Scalars all, const Scalar *s, PetscInt c, const PetscInt node[], const PetscReal x[],
                                 const PetscReal r[], NodeLimits at[])
{
  const PetscInt nb   = all->loc->nb;
  Scalar         full = *s;
  ScalarCell     cell;

  PetscFunctionBeginUser;
  full.limit.part = NULL;
  PetscCall(ScalarCellSet(all, &full, c, &cell));
  ScalarLimitAddMass(all, -1, cell.A, cell.M);
  for (PetscInt i = 0; i < nb; i++)
    for (PetscInt j = 0; j < nb && node[i] >= 0; j++) {
      PetscReal d, f;

      if (i == j) continue;
      f = ScalarLimitFlux(all, i, j, cell.A, cell.M, x, r, &d);
      *(f > 0 ? &at[node[i]].rise : &at[node[i]].fall) += PetscAbsReal(f);
      at[node[i]].weight += d / all->step.theta + all->step.ct * PetscAbsReal(cell.M[i * all->element.nbp + j]);
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* a [nnode_all][2]: parts of fluxes into own nodes that are left, none into an extremum */
static void set_limits(Scalars all, const Scalar *s, const NodeLimits at[], PetscReal a[])
{
  for (PetscInt i = 0; i < all->loc->nnode; i++) {
    const PetscReal up = at[i].top - s->x[i], down = s->x[i] - at[i].bottom, weight = at[i].weight;

    a[2 * i] = a[2 * i + 1] = at[i].low ? 0 : 1;
    if (s->owner[i] >= 0) continue;
    if (at[i].rise > 0) a[2 * i] = PetscMin(a[2 * i], weight * PetscMax(0, up) / at[i].rise);
    if (at[i].fall > 0) a[2 * i + 1] = PetscMin(a[2 * i + 1], weight * PetscMax(0, down) / at[i].fall);
  }
}

/* Bounds of nodes. Cells that have values far out of theirs are of low order as peclet [ncell_all] has them;
   *beyond: how far values in cells with a part are out. work [nnode_all] */
static PetscErrorCode find_bounds(Scalars all, const Scalar *s, const PetscReal peclet[], PetscReal range,
                                  NodeLimits at[], PetscReal work[], PetscReal part[], PetscReal *beyond)
{
  const MeshLocal *l = all->loc;

  PetscFunctionBeginUser;
  *beyond = 0;
  for (PetscInt i = 0; i < l->nnode_all; i++) at[i].top = at[i].bottom = all->step.ct > 0 ? s->T[i] : s->x[i];
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscInt  node[MESH_MAX_NB];
    PetscReal x[MESH_MAX_NB], r[MESH_MAX_NB];

    if (!ScalarCellIsActive(s, c)) continue;
    ScalarLimitValues(all, s, c, s->x, node, x, r);
    add_bounds(all, s, node, x, at);
  }
  for (PetscInt i = 0; i < l->nnode; i++)
    work[i] = s->owner[i] < 0 ? PetscMax(0, PetscMax(s->x[i] - at[i].top, at[i].bottom - s->x[i])) : 0;
  PetscCall(MeshSyncNodes(all->mesh, 1, work));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal out = 0;

    for (PetscInt j = 0; j < l->nb && peclet[c] > 0; j++) out = PetscMax(out, work[l->cell_node[c * l->nb + j]]);
    if (part[c] > 0) *beyond = PetscMax(*beyond, out);
    if (out <= FAR * range) continue;
    *beyond = PetscMax(*beyond, out);
    part[c] = peclet[c];
    for (PetscInt j = 0; j < l->nb; j++) at[l->cell_node[c * l->nb + j]].low = PETSC_TRUE;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, beyond, 1, MPIU_REAL, MPIU_MAX, all->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of limits with parts of cells: those of nodes */
static PetscErrorCode find_limits(Scalars all, const Scalar *s, const PetscReal peclet[], PetscReal range,
                                  ScalarLimits *limit, PetscReal *beyond)
{
  const MeshLocal *l = all->loc;
  NodeLimits      *at;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(l->nnode_all, &at));
  PetscCall(find_bounds(all, s, peclet, range, at, limit->node, limit->part, beyond));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscInt  node[MESH_MAX_NB];
    PetscReal x[MESH_MAX_NB], r[MESH_MAX_NB];

    if (limit->part[c] == 0) continue;
    ScalarLimitValues(all, s, c, s->x, node, x, r);
    PetscCall(add_fluxes(all, s, c, node, x, r, at));
  }
  set_limits(all, s, at, limit->node);
  PetscCall(MeshSyncNodes(all->mesh, 2, limit->node));
  PetscCall(PetscFree(at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLimitForget(Scalar *s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree3(s->limit.part, s->limit.node, s->limit.x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* peclet [ncell_all]: by how much cells are beyond the bound, 0 to 1; range of the values; is a cell beyond it? */
static PetscErrorCode find_cells(Scalars all, const Scalar *s, PetscReal peclet[], PetscReal *range, PetscBool *any)
{
  const MeshLocal *l    = all->loc;
  PetscReal        v[3] = {0, -PETSC_MAX_REAL, -PETSC_MAX_REAL};

  PetscFunctionBeginUser;
  *any   = PETSC_FALSE;
  *range = 0;
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xc[MESH_MAX_NB * 3], w[MESH_MAX_NB * 3];

    if (!is_plain(s, c)) continue;
    PetscCall(ScalarCellCoordinates(all, c, xc));
    ScalarCellGather(l, c, l->dim, s->w, w);
    peclet[c] = PetscMin(1, PetscMax(0, find_peclet(all, s, c, xc, w) / PECLET - 1));
    v[0]      = PetscMax(v[0], peclet[c]);
  }
  for (PetscInt i = 0; i < l->nnode; i++) {
    v[1] = PetscMax(v[1], s->x[i]);
    v[2] = PetscMax(v[2], -s->x[i]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, v, 3, MPIU_REAL, MPIU_MAX, all->comm));
  *range = v[1] + v[2];
  *any   = (PetscBool)(v[0] > 0 && *range > FLAT * PetscMax(PetscAbsReal(v[1]), PetscAbsReal(v[2])));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Parts of cells of low order */
static PetscErrorCode find_weights(Scalars all, const Scalar *s, const PetscReal peclet[], PetscReal noise,
                                   PetscReal part[])
{
  PetscReal *sum;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(all->loc->nnode_all * NUMBERS, &sum));
  PetscCall(sum_gradients(all, s, sum));
  for (PetscInt c = 0; c < all->loc->ncell_all; c++)
    if (peclet[c] > 0) part[c] = peclet[c] * find_part(all->loc, c, sum, noise);
  PetscCall(PetscFree(sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Without time bounds are those of the solution, which is found when it is that of the limits it has; *change: by how
   much it is not, 0 if nothing is limited */
static PetscErrorCode find_change(Scalars all, const Scalar *s, const PetscReal part[], PetscReal *change)
{
  PetscReal v[2] = {s->limit.x ? 0 : PETSC_MAX_REAL, 0};

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < all->loc->nnode && s->limit.x; i++)
    v[0] = PetscMax(v[0], PetscAbsReal(s->x[i] - s->limit.x[i]));
  for (PetscInt c = 0; c < all->loc->ncell; c++) v[1] = PetscMax(v[1], part[c]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, v, 2, MPIU_REAL, MPIU_MAX, all->comm));
  *change = v[1] > 0 ? v[0] : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLimit(Scalars all, Scalar *s, PetscBool again, PetscBool *more)
{
  const MeshLocal *l    = all->loc;
  ScalarLimits     last = s->limit, next = {.wanted = s->limit.wanted};
  PetscReal       *peclet, range = 0, beyond = 0;
  PetscBool        any;

  PetscFunctionBeginUser;
  *more = PETSC_FALSE;
  if (!again) PetscCall(ScalarLimitForget(s));
  if (!again) last = s->limit;
  if (!again && all->step.ct == 0) PetscFunctionReturn(PETSC_SUCCESS); /* nothing is known yet */
  if (!s->limit.wanted || !s->w || s->par.periodic_gradient) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(l->ncell_all, &peclet));
  PetscCall(find_cells(all, s, peclet, &range, &any));
  if (any) {
    PetscCall(PetscCalloc3(l->ncell_all, &next.part, 2 * l->nnode_all, &next.node, l->nnode_all, &next.x));
    PetscCall(find_weights(all, s, peclet, NOISE * range / l->h, next.part));
    for (PetscInt c = 0; c < l->ncell_all && last.part; c++) next.part[c] = PetscMax(next.part[c], last.part[c]);
    PetscCall(find_limits(all, s, peclet, range, &next, &beyond));
    for (PetscInt i = 0; i < 2 * l->nnode_all && last.part; i++) next.node[i] = PetscMin(next.node[i], last.node[i]);
    PetscCall(PetscArraycpy(next.x, s->x, l->nnode_all));
    if (all->step.ct == 0) PetscCall(find_change(all, s, next.part, &beyond));
    *more = (PetscBool)(beyond > BEYOND * range);
    if (again && *more) PetscCall(ScalarLimitForget(s));
    if (!again || *more) s->limit = next;
    else PetscCall(PetscFree3(next.part, next.node, next.x));
  }
  PetscCall(PetscFree(peclet));
  PetscFunctionReturn(PETSC_SUCCESS);
}
