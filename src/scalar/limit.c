/* Scalars, stabilisation where convection dominates a cell (cell Peclet number above 1) and the solution is not smooth:
   there the cell's matrix passes into one of low order. The low-order matrix has a lumped mass and, for each pair of
   nodes, as much diffusion as makes its entries outside the diagonal negative (discrete upwinding, Kuzmin & Turek
   2002), so that no new extremum arises. Of what this adds as much is taken back, pair by pair, as leaves each node
   within the values that its cells had (algebraic flux correction with the limiter of Barrenechea, John & Knobloch
   2016). It is symmetric and its columns add up to zero: nothing appears or is lost, the balance closes as without.

   Smooth is what has continuous gradients: their jumps between cells, over the gradients, are of higher order in h, at
   extrema too, and nothing is limited where they are small. Limits go by the solution: by the extrapolated one at
   first, then by what was solved for, until that stays within its bounds.

   Bounds go by the values that the step began with; one that was out of its own counts as at them, or what is tolerated
   in a step adds up (an inlet whose jump lies on a node: 1.4 % in five steps, .6 % so). Not where nodes are shifted.

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
#define ADDED  2    /* bounds are wider by so many times f/(c c_t) of a source f, which adds 1.5 in a step of BDF2 */
#define CLOSER 0.05 /* limits that close in by less do not help, */
#define HALF   0.5  /* nor, where none is far, do those of values that are out by less than this part of the farthest */

enum {
  COUNT,
  SQUARE,
  OTHERS,
  SLOPE,
  NUMBERS = SLOPE + 3
};

/* Of lattice points along the axes */
static const PetscInt STEP[] = {1, 3, 9};

/* Largest of all ranks, of n numbers */
static PetscErrorCode find_largest(Scalars all, PetscMPIInt n, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, v, n, MPIU_REAL, MPIU_MAX, all->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Convecting over conducting in cell c with velocities w [nb][dim] at its lattice points: |w|^2/(|J^-1 w| D), which is
   |w| h/(2 D) with h its length along w; 0 where the fastest |w| |J|/D, which is no less, is below the bound */
static PetscErrorCode find_peclet(Scalars all, const Scalar *s, PetscInt c, const PetscReal w[], PetscReal *peclet)
{
  const PetscInt  dim = all->loc->dim, nb = all->loc->nb, middle = nb / 2;
  const PetscReal capacity     = s->cells.capacity ? s->cells.capacity[c] : s->par.capacity,
                  conductivity = s->cells.conductivity ? s->cells.conductivity[c] : s->par.conductivity,
                  ratio        = capacity / PetscMax(conductivity, PETSC_MIN_REAL);
  const PetscReal *edge;
  PetscReal        xc[MESH_MAX_NB * 3], speed[MESH_MAX_NB], J[9], inverse[9], size = 0, fastest = 0, largest = 0;

  PetscFunctionBeginUser;
  PetscCall(ScalarCellBox(all, c, &edge));
  if (!edge) PetscCall(ScalarCellCoordinates(all, c, xc));
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt e = 0; e < dim; e++) {
      if (edge) J[a * dim + e] = a == e ? 0.5 * edge[a] : 0;
      else J[a * dim + e] = 0.5 * (xc[(middle + STEP[e]) * dim + a] - xc[(middle - STEP[e]) * dim + a]);
      size += PetscSqr(J[a * dim + e]);
    }
  for (PetscInt j = 0; j < nb; j++) {
    speed[j] = 0;
    for (PetscInt e = 0; e < dim; e++) speed[j] += PetscSqr(w[j * dim + e]);
    fastest = PetscMax(fastest, speed[j]);
  }
  *peclet = 0;
  if (ratio * PetscSqrtReal(fastest * size) < PECLET) PetscFunctionReturn(PETSC_SUCCESS);
  (void)DenseInvertMap(dim, J, inverse);
  for (PetscInt j = 0; j < nb; j++) {
    PetscReal along = 0;

    for (PetscInt e = 0; e < dim; e++) {
      PetscReal a = 0;

      for (PetscInt k = 0; k < dim; k++) a += inverse[e * dim + k] * w[j * dim + k];
      along += a * a;
    }
    if (along > 0) largest = PetscMax(largest, speed[j] / PetscSqrtReal(along));
  }
  *peclet = largest * ratio;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Derivatives of v [nb] along the axes of the cell at its lattice points: dv [dim][nb] */
static void differentiate(PetscInt dim, PetscInt nb, PetscInt stride, const PetscReal v[], PetscReal dv[])
{
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt first = 0; first < nb; first += 3 * STEP[a])
      for (PetscInt i = first; i < first + STEP[a]; i++) {
        const PetscReal x = v[i * stride], y = v[(i + STEP[a]) * stride], z = v[(i + 2 * STEP[a]) * stride];
        PetscReal      *d = dv + a * nb + i;

        d[0]           = -1.5 * x + 2 * y - 0.5 * z;
        d[STEP[a]]     = 0.5 * z - 0.5 * x;
        d[2 * STEP[a]] = 0.5 * x - 2 * y + 1.5 * z;
      }
}

/* Gradients g [nb][3] of x in cell c at its lattice points */
static PetscErrorCode find_gradients(Scalars all, const Scalar *s, PetscInt c, const PetscReal x[], PetscReal g[][3])
{
  const PetscInt   dim = all->loc->dim, nb = all->loc->nb;
  const PetscReal *edge;
  PetscReal        xc[MESH_MAX_NB * 3], dT[3 * MESH_MAX_NB], dx[3][3 * MESH_MAX_NB];

  PetscFunctionBeginUser;
  PetscCall(ScalarCellBox(all, c, &edge));
  differentiate(dim, nb, 1, x, dT);
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt j = 0; j < nb && edge; j++) g[j][a] = s->par.gradient[a] + 2 / edge[a] * dT[a * nb + j];
  if (edge) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarCellCoordinates(all, c, xc));
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
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is it of the fluid as a whole? */
static PetscBool is_plain(const Scalar *s, PetscInt c)
{
  return (PetscBool)((!s->cells.sample || s->cells.sample[c] < 0) &&
                     (!s->cells.conductivity || s->cells.conductivity[c] == s->par.conductivity));
}

/* sum [nnode_all][NUMBERS] over the cells around a node of those beyond the bound: their number, gradients and squares
   of these; number of those that are not of the fluid */
static PetscErrorCode sum_gradients(Scalars all, const Scalar *s, PetscReal sum[])
{
  const MeshLocal *l = all->loc;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(sum, l->nnode_all * NUMBERS));
  for (PetscInt k = 0; k < s->limit.nnear; k++) {
    const PetscInt c = s->limit.near[k];
    PetscReal      x[MESH_MAX_NB], g[MESH_MAX_NB][3];

    for (PetscInt j = 0; j < l->nb && !is_plain(s, c); j++) sum[l->cell_node[c * l->nb + j] * NUMBERS + OTHERS]++;
    if (!is_plain(s, c)) continue;
    MeshCellValues(l, c, 1, s->x, x);
    PetscCall(find_gradients(all, s, c, x, g));
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

/* At a node: sum of fluxes that raise it, and that lower it; what scales its room for them */
typedef struct {
  PetscReal rise, fall, weight;
  PetscBool low; /* nothing is taken back there */
} NodeLimits;

/* Bounds of cell c, values x [nb] at its lattice points, by what a source f and a reaction r of a material with
   capacity c change in a step */
static void widen(const ScalarStep *p, PetscReal c, PetscReal r, PetscReal f, PetscReal x, PetscReal *bottom,
                  PetscReal *top)
{
  const PetscReal weight = p->ct * c + ADDED * p->theta * r;

  if (!(weight > 0)) return;
  *top    = PetscMax(*top, x + ADDED * (f - r * x) / weight);
  *bottom = PetscMin(*bottom, x + ADDED * (f - r * x) / weight);
}

/* The same by all sources and reactions of cell c, for its values x */
static void add_sources(Scalars all, const Scalar *s, PetscInt c, const PetscReal x[], PetscReal *bottom,
                        PetscReal *top)
{
  const PetscInt  nb = all->loc->nb, sample = s->cells.sample ? s->cells.sample[c] : -1;
  const PetscReal capacity = s->cells.capacity ? s->cells.capacity[c] : s->par.capacity,
                  uniform = s->cells.source ? s->cells.source[c] : 0, low = *bottom, high = *top;
  const ScalarSamples *p = sample >= 0 ? s->cells.samples + sample : NULL;
  ScalarCellInput      in;

  for (PetscInt k = 0; p && k < PetscPowInt(p->n, all->loc->dim); k++) {
    PetscReal r, f;

    ScalarSampleTerms(s, c, k, &r, &f);
    if (p->lump >= 0) r = 0;
    if (r == 0 && f == 0) continue;
    widen(&all->step, p->capacity[k], r, f, low, bottom, top);
    widen(&all->step, p->capacity[k], r, f, high, bottom, top);
  }
  ScalarCellGetInput(all, s, c, &in);
  for (PetscInt j = 0; j < nb && (in.acts || uniform != 0 || in.decay != 0); j++)
    widen(&all->step, capacity, in.decay * capacity + (in.acts ? in.slope[j] : 0), (in.acts ? in.q[j] : 0) + uniform,
          x[j], bottom, top);
}

/* Value that the step began with, where it was out of its bounds these: what is tolerated in a step does not add up */
static PetscReal get_value(const Scalar *s, PetscInt i)
{
  return s->T[i] - (s->excess ? s->excess[i] : 0);
}

/* Of the values of a cell: those that the step began with, or is given; without time those of now */
static void add_bounds(Scalars all, const Scalar *s, PetscInt c, const PetscInt node[], PetscReal x[],
                       PetscReal bound[][2])
{
  PetscReal top = -PETSC_MAX_REAL, bottom = PETSC_MAX_REAL;

  for (PetscInt j = 0; j < all->loc->nb; j++) {
    if (node[j] >= 0 && s->owner[node[j]] < 0 && all->step.ct > 0) x[j] = get_value(s, node[j]);
    top    = PetscMax(top, x[j]);
    bottom = PetscMin(bottom, x[j]);
  }
  if (all->step.ct > 0) add_sources(all, s, c, x, &bottom, &top);
  for (PetscInt j = 0; j < all->loc->nb; j++) {
    if (node[j] < 0) continue;
    bound[node[j]][0] = PetscMin(bottom, bound[node[j]][0]);
    bound[node[j]][1] = PetscMax(top, bound[node[j]][1]);
  }
}

/* Fluxes that cell c would take away */
static PetscErrorCode add_fluxes(Scalars all, const Scalar *s, PetscInt c, const PetscInt node[], const PetscReal x[],
                                 const PetscReal r[], NodeLimits at[])
{
  const PetscInt nb = all->loc->nb;
  ScalarCell     cell;

  PetscFunctionBeginUser;
  PetscCall(ScalarCellMatrices(all, s, c, &cell));
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
    const PetscReal up = s->limit.bound[i][1] - s->x[i], down = s->x[i] - s->limit.bound[i][0], weight = at[i].weight;

    a[2 * i] = a[2 * i + 1] = at[i].low ? 0 : 1;
    if (s->owner[i] >= 0) continue;
    if (at[i].rise > 0) a[2 * i] = PetscMin(a[2 * i], weight * PetscMax(0, up) / at[i].rise);
    if (at[i].fall > 0) a[2 * i + 1] = PetscMin(a[2 * i + 1], weight * PetscMax(0, down) / at[i].fall);
  }
}

/* Farthest of the nodes of cell c */
static PetscReal find_farthest(const MeshLocal *l, PetscInt c, const PetscReal out[])
{
  PetscReal far = 0;

  for (PetscInt j = 0; j < l->nb; j++) far = PetscMax(far, out[l->cell_node[c * l->nb + j]]);
  return far;
}

/* Bounds of nodes of cells beyond the bound; in a step they stay */
static PetscErrorCode find_bounds(Scalars all, Scalar *s)
{
  const MeshLocal *l = all->loc;

  PetscFunctionBeginUser;
  if (s->limit.bound && all->step.ct > 0) PetscFunctionReturn(PETSC_SUCCESS);
  if (!s->limit.bound) PetscCall(PetscMalloc1(l->nnode_all, &s->limit.bound));
  for (PetscInt i = 0; i < l->nnode_all; i++)
    s->limit.bound[i][0] = s->limit.bound[i][1] = all->step.ct > 0 ? get_value(s, i) : s->x[i];
  for (PetscInt k = 0; k < s->limit.nnear; k++) {
    const PetscInt c = s->limit.near[k];
    PetscInt       node[MESH_MAX_NB];
    PetscReal      x[MESH_MAX_NB];

    if (!ScalarCellIsActive(s, c)) continue;
    MeshCellValues(l, c, 1, s->x, x);
    for (PetscInt j = 0; j < l->nb; j++) node[j] = ScalarLimitNode(l, c, j);
    add_bounds(all, s, c, node, x, s->limit.bound);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLimitAccept(Scalars all, Scalar *s)
{
  const MeshLocal *l = all->loc;

  PetscFunctionBeginUser;
  if (!s->limit.part || all->step.ct == 0 || all->shift) {
    PetscCall(PetscFree(s->excess));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (!s->excess) PetscCall(PetscMalloc1(l->nnode_all, &s->excess));
  PetscCall(PetscArrayzero(s->excess, l->nnode_all));
  for (PetscInt c = 0; c < l->ncell_all; c++)
    for (PetscInt j = 0; j < l->nb && s->limit.part[c] > 0; j++) {
      const PetscInt i = l->cell_node[c * l->nb + j];

      s->excess[i] = s->x[i] - PetscClipInterval(s->x[i], s->limit.bound[i][0], s->limit.bound[i][1]);
    }
  PetscCall(MeshSyncNodes(all->mesh, 1, s->excess));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* How far nodes are out of their bounds, out [nnode_all], and the farthest here */
static PetscErrorCode find_beyond(Scalars all, const Scalar *s, PetscReal out[], PetscReal *farthest)
{
  const MeshLocal *l = all->loc;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode; i++)
    out[i] = s->owner[i] < 0 ? PetscMax(0, PetscMax(s->x[i] - s->limit.bound[i][1], s->limit.bound[i][0] - s->x[i]))
                             : 0;
  PetscCall(MeshSyncNodes(all->mesh, 1, out));
  *farthest = 0;
  for (PetscInt k = 0; k < s->limit.nnear; k++)
    if (s->limit.peclet[s->limit.near[k]] > 0) *farthest = PetscMax(*farthest, find_farthest(l, s->limit.near[k], out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells that have values far out of their bounds are of low order altogether; *beyond: how far values in cells with a
   part are out */
static void set_low(const MeshLocal *l, const PetscReal peclet[], const PetscReal out[], PetscReal range,
                    NodeLimits at[], PetscReal part[], PetscReal *beyond)
{
  *beyond = 0;
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    const PetscReal far = peclet[c] > 0 ? find_farthest(l, c, out) : 0;

    if (part[c] > 0) *beyond = PetscMax(*beyond, far);
    if (far <= FAR * range) continue;
    *beyond = PetscMax(*beyond, far);
    part[c] = peclet[c];
    for (PetscInt j = 0; j < l->nb; j++) at[l->cell_node[c * l->nb + j]].low = PETSC_TRUE;
  }
}

/* Of limits with parts of cells: those of nodes */
static PetscErrorCode find_limits(Scalars all, const Scalar *s, NodeLimits at[], ScalarLimits *limit)
{
  const MeshLocal *l = all->loc;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscInt  node[MESH_MAX_NB];
    PetscReal x[MESH_MAX_NB], r[MESH_MAX_NB];

    if (limit->part[c] == 0) continue;
    ScalarLimitValues(all, s, c, s->x, node, x, r);
    PetscCall(add_fluxes(all, s, c, node, x, r, at));
  }
  set_limits(all, s, at, limit->node);
  PetscCall(MeshSyncNodes(all->mesh, 2, limit->node));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode free_limits(ScalarLimits *p)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree3(p->part, p->node, p->x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLimitForget(Scalar *s)
{
  PetscFunctionBeginUser;
  PetscCall(free_limits(&s->limit));
  PetscCall(PetscFree2(s->limit.peclet, s->limit.near));
  PetscCall(PetscFree(s->limit.bound));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells beyond the bound, of these flow and mesh, and those that share a node with one */
static PetscErrorCode find_cells(Scalars all, const Scalar *s, ScalarLimits *limit)
{
  const MeshLocal *l       = all->loc;
  PetscReal        largest = 0;
  PetscBool       *wanted;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(l->ncell_all, &limit->peclet, l->ncell_all, &limit->near));
  PetscCall(PetscCalloc1(l->nnode_all, &wanted));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal w[MESH_MAX_NB * 3], peclet = 0;

    if (!is_plain(s, c)) continue;
    MeshCellValues(l, c, l->dim, s->w, w);
    PetscCall(find_peclet(all, s, c, w, &peclet));
    limit->peclet[c] = PetscMin(1, PetscMax(0, peclet / PECLET - 1));
    largest          = PetscMax(largest, limit->peclet[c]);
    for (PetscInt j = 0; j < l->nb && limit->peclet[c] > 0; j++) wanted[l->cell_node[c * l->nb + j]] = PETSC_TRUE;
  }
  limit->nnear = 0;
  for (PetscInt c = 0; c < l->ncell_all; c++)
    for (PetscInt j = 0; j < l->nb; j++) {
      if (!wanted[l->cell_node[c * l->nb + j]]) continue;
      limit->near[limit->nnear++] = c;
      break;
    }
  PetscCall(PetscFree(wanted));
  PetscCall(find_largest(all, 1, &largest));
  limit->any = (PetscBool)(largest > 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of the values; 0 if it is round-off */
static PetscErrorCode find_range(Scalars all, const Scalar *s, PetscReal *range)
{
  PetscReal v[2] = {-PETSC_MAX_REAL, -PETSC_MAX_REAL};

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < all->loc->nnode; i++) {
    v[0] = PetscMax(v[0], s->x[i]);
    v[1] = PetscMax(v[1], -s->x[i]);
  }
  PetscCall(find_largest(all, 2, v));
  *range = v[0] + v[1];
  if (!(*range > FLAT * PetscMax(PetscAbsReal(v[0]), PetscAbsReal(v[1])))) *range = 0;
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
  PetscCall(find_largest(all, 2, v));
  *change = v[1] > 0 ? v[0] : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Do limits next to the last ones close in on a value that is out of its bounds? */
static PetscBool close_in(const MeshLocal *l, const PetscReal x[], const ScalarLimits *last, const ScalarLimits *next,
                          PetscReal tolerance)
{
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    const PetscReal part = last->part ? last->part[c] : 0;

    if (next->part[c] == 0) continue;
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt   i = l->cell_node[c * l->nb + j], side = 2 * i + (x[i] < next->bound[i][0]);
      const PetscReal *bound = next->bound[i], limit = last->node ? last->node[side] : 1;

      if (i >= l->nnode || (x[i] <= bound[1] + tolerance && x[i] >= bound[0] - tolerance)) continue;
      if (next->part[c] > part + CLOSER || next->node[side] < limit - CLOSER) return PETSC_TRUE;
    }
  }
  return PETSC_FALSE;
}

/* Limits next to those that there are, with bounds that values are `out` of, the farthest by so much */
static PetscErrorCode renew(Scalars all, Scalar *s, PetscBool again, PetscReal range, const PetscReal out[],
                            PetscReal farthest, PetscBool *more)
{
  const MeshLocal *l    = all->loc;
  ScalarLimits     last = s->limit, next = s->limit;
  PetscReal        beyond;
  NodeLimits      *at;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(l->nnode_all, &at));
  PetscCall(PetscCalloc3(l->ncell_all, &next.part, 2 * l->nnode_all, &next.node, l->nnode_all, &next.x));
  PetscCall(find_weights(all, s, s->limit.peclet, NOISE * range / l->h, next.part));
  for (PetscInt c = 0; c < l->ncell_all && last.part; c++) next.part[c] = PetscMax(next.part[c], last.part[c]);
  set_low(l, s->limit.peclet, out, range, at, next.part, &beyond);
  PetscCall(find_limits(all, s, at, &next));
  for (PetscInt i = 0; i < 2 * l->nnode_all && last.part; i++) next.node[i] = PetscMin(next.node[i], last.node[i]);
  PetscCall(PetscArraycpy(next.x, s->x, l->nnode_all));
  if (all->step.ct == 0) PetscCall(find_change(all, s, next.part, &beyond));
  else if (again) {
    if (!close_in(l, s->x, &last, &next,
                  farthest > FAR * range ? BEYOND * range : PetscMax(BEYOND * range, HALF * farthest)))
      beyond = 0;
    PetscCall(find_largest(all, 1, &beyond));
  }
  *more = (PetscBool)(beyond > BEYOND * range);
  PetscCall(free_limits(again && !*more ? &next : &last));
  if (!again || *more) s->limit = next;
  PetscCall(PetscFree(at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLimit(Scalars all, Scalar *s, PetscBool again, PetscBool *more)
{
  const MeshLocal *l = all->loc;
  PetscReal       *out, range = 0, farthest;

  PetscFunctionBeginUser;
  *more = PETSC_FALSE;
  if (!again) PetscCall(ScalarLimitForget(s));
  if (!again && all->step.ct == 0) PetscFunctionReturn(PETSC_SUCCESS); /* nothing is known yet */
  if (!s->limit.wanted || !s->w || s->par.periodic_gradient) PetscFunctionReturn(PETSC_SUCCESS);
  if (!s->limit.peclet) PetscCall(find_cells(all, s, &s->limit));
  if (!s->limit.any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_range(all, s, &range));
  if (range == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(l->nnode_all, &out));
  PetscCall(find_bounds(all, s));
  PetscCall(find_beyond(all, s, out, &farthest));
  if (again) PetscCall(find_largest(all, 1, &farthest));
  if (!again || all->step.ct == 0 || farthest > BEYOND * range)
    PetscCall(renew(all, s, again, range, out, farthest, more));
  PetscCall(PetscFree(out));
  PetscFunctionReturn(PETSC_SUCCESS);
}
