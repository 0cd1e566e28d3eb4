/* Flow, finer: what elements of the next order would make of a steady flow (flow/finer.h), on the mesh.

   To Q2 and P1 come, in a cell, the functions of Q3 and P2 that they lack (hierarchical basis: Bank & Smith, SIAM J.
   Numer. Anal. 30, 921, 1993). Functions of a side belong to the node in its middle, with the sense of the numbers of
   its vertices. Every cell solves an own problem with the residual there, of which cells that share a side have equal
   parts, and what they find on it is averaged (Neumann-Neumann). Where cells of two sizes meet the sides have none. */
#include "compat.h"
#include "finer.h"

#define SHARED 3 /* functions of a face; an edge has one */

struct _p_FlowFiner {
  Flow             f;
  const MeshLocal *l;
  FinerTables      t;
  PetscInt         ns;                 /* functions of a node in the middle of a side */
  unsigned char   *given;              /* [nnode_all] */
  PetscReal       *solution;           /* velocity of the flow [nnode_all][dim] */
  PetscReal       *count;              /* [nnode_all] cells of the fluid around a node; 0: sides of two sizes meet */
  PetscReal       *v, *p, *cell;       /* found [ncell][nw][dim], [ncell][nl]; answer [ncell][nb][dim] */
  PetscReal       *residual, *average; /* [nnode_all][ns][dim] */
  PetscInt         sweeps;
  FlowFinerResult  result;
};

/* Where a function of a cell belongs */
typedef struct {
  PetscInt  node, which; /* -1: to the cell */
  PetscReal sign;
} Place;

static const PetscInt STRIDE[3] = {1, 3, 9};

/* On a face with free axes[2] about lattice point j: of the two along which the function is odd[2], in the sense of
   the face, whose first axis goes from its vertex of the lowest number to the lower one of its neighbours */
static void place_on_face(const MeshLocal *l, PetscInt c, PetscInt j, const PetscInt axis[], const PetscBool odd[],
                          Place *p)
{
  PetscInt  lowest = 0, number[4];
  PetscBool swap;

  for (PetscInt k = 0; k < 4; k++) {
    const PetscInt at = j + STRIDE[axis[0]] * (k % 2 ? 1 : -1) + STRIDE[axis[1]] * (k / 2 ? 1 : -1);

    number[k] = l->node_global[FlowCellNode(l, c, at)];
    if (number[k] < number[lowest]) lowest = k;
  }
  swap     = (PetscBool)(number[lowest ^ 2] < number[lowest ^ 1]);
  p->which = odd[0] && odd[1] ? 2 : odd[swap ? 0 : 1];
  if (odd[0] && lowest & 1) p->sign = -p->sign;
  if (odd[1] && lowest & 2) p->sign = -p->sign;
}

static Place get_place(FlowFiner s, PetscInt c, PetscInt i)
{
  const MeshLocal *l = s->l;
  Place            p = {-1, 0, 1};
  PetscInt         axis[3], n = 0, j = 0;
  PetscBool        odd[3];

  for (PetscInt d = 0; d < l->dim; d++) {
    const PetscInt digit = s->t.digit[i][d] == FINER_ODD ? 1 : s->t.digit[i][d];

    j += STRIDE[d] * digit;
    if (digit != 1) continue;
    odd[n]    = (PetscBool)(s->t.digit[i][d] == FINER_ODD);
    axis[n++] = d;
  }
  if (n == l->dim) return p;
  p.node = FlowCellNode(l, c, j);
  if (p.node < 0) return p;
  if (n == 1) {
    const PetscInt a = FlowCellNode(l, c, j - STRIDE[axis[0]]), b = FlowCellNode(l, c, j + STRIDE[axis[0]]);

    if (l->node_global[a] > l->node_global[b]) p.sign = -1;
  } else place_on_face(l, c, j, axis, odd, &p);
  return p;
}

/* Is function i of a cell one of its own? */
static PetscBool is_inner(FlowFiner s, PetscInt i)
{
  for (PetscInt d = 0; d < s->l->dim; d++)
    if (s->t.digit[i][d] % 2 == 0) return PETSC_FALSE;
  return PETSC_TRUE;
}

/* Values v [nw][dim] of cell c, on its sides: to what all have, or (back) from it; shared: an equal part of it */
static void exchange(FlowFiner s, PetscInt c, PetscBool back, PetscBool shared, PetscReal v[], PetscReal all[])
{
  const PetscInt dim = s->l->dim;

  for (PetscInt i = 0; i < s->t.nw; i++) {
    const Place     p    = get_place(s, c, i);
    const PetscBool none = (PetscBool)(p.node < 0 || s->count[p.node] == 0);
    const PetscReal part = none ? 0 : p.sign / (shared ? s->count[p.node] : 1);

    if (is_inner(s, i)) continue;
    for (PetscInt a = 0; a < dim; a++) {
      PetscReal *value = none ? NULL : all + (p.node * s->ns + p.which) * dim + a;

      if (back) v[i * dim + a] = none ? 0 : part * *value;
      else if (!none) *value += part * v[i * dim + a];
    }
  }
}

static PetscErrorCode gather(FlowFiner s, PetscInt c, const PetscReal u[], const PetscReal p[], FinerCell *cell,
                             FinerFound *found)
{
  const PetscInt nk = s->l->dim + 1;

  PetscFunctionBeginUser;
  cell->f = s->f;
  cell->t = &s->t;
  cell->h = s->f->cells.size[c];
  PetscCall(MeshCellCoordinates(s->f->mesh, c, cell->x));
  MeshCellValues(s->l, c, s->l->dim, u, cell->u);
  if (s->f->force.source) MeshCellValues(s->l, c, s->l->dim, s->f->force.source, cell->source);
  else PetscCall(PetscArrayzero(cell->source, s->l->nb * s->l->dim));
  PetscCall(PetscArraycpy(cell->p, p + c * nk, nk));
  for (PetscInt i = 0; i < s->t.nw; i++) {
    const Place at = get_place(s, c, i);

    cell->given[i] = 0;
    if (!is_inner(s, i)) cell->given[i] = at.node < 0 || s->count[at.node] == 0 ? 7 : s->given[at.node];
  }
  found->v = s->v + c * s->t.nw * s->l->dim;
  found->p = s->p + c * s->t.nl;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells around nodes; those of sides where cells of two sizes meet have none */
static PetscErrorCode count_cells(FlowFiner s)
{
  const MeshLocal *l = s->l;
  PetscReal       *hung;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(l->nnode_all, &hung));
  for (PetscInt c = 0; c < l->ncell; c++) {
    const MeshHang *h = MeshCellHang(l, c);

    for (PetscInt j = 0; j < l->nb && !FlowIsInactive(s->f, c); j++)
      if (FlowCellNode(l, c, j) >= 0) s->count[FlowCellNode(l, c, j)]++;
    for (PetscInt i = 0; h && i < h->n; i++)
      for (PetscInt k = h->start[i]; k < h->start[i + 1] && h->start[i + 1] - h->start[i] > 1; k++)
        hung[l->cell_node[c * l->nb + h->from[k]]]++;
  }
  PetscCall(MeshSumNodes(s->f->mesh, 1, s->count));
  PetscCall(MeshSumNodes(s->f->mesh, 1, hung));
  for (PetscInt i = 0; i < l->nnode; i++)
    if (hung[i] > 0) s->count[i] = 0;
  PetscCall(MeshSyncNodes(s->f->mesh, 1, s->count));
  PetscCall(PetscFree(hung));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool FlowCanBeFiner(Flow f)
{
  const Owners *o = &f->owners;

  return (PetscBool)(FlowIsPlain(f) && f->par.viscosity > 0 && !f->mesh_velocity && !f->device &&
                     o->nterms + o->noperators + o->nforces + o->nvolumes == 0);
}

PetscErrorCode FlowFinerCreate(Flow f, const unsigned char given[], const PetscReal u[], FlowFiner *finer)
{
  const MeshLocal *l = f->loc;
  FlowFiner        s;
  PetscReal       *load, *source;
  PetscInt        *cell;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->f  = f;
  s->l  = l;
  s->ns = l->dim == 2 ? 1 : SHARED;
  FinerFillTables(l->dim, &s->t);
  PetscCall(PetscMalloc2(l->nnode_all, &s->given, l->nnode_all * l->dim, &s->solution));
  PetscCall(PetscArraycpy(s->given, given, l->nnode_all));
  PetscCall(PetscArraycpy(s->solution, u, l->nnode_all * l->dim));
  PetscCall(
    PetscCalloc3(l->ncell * s->t.nw * l->dim, &s->v, l->ncell * s->t.nl, &s->p, l->ncell * l->nb * l->dim, &s->cell));
  PetscCall(PetscCalloc3(l->nnode_all, &s->count, l->nnode_all * s->ns * l->dim, &s->residual,
                         l->nnode_all * s->ns * l->dim, &s->average));
  PetscCall(PetscCalloc3(l->nnode_all * l->dim, &load, l->ncell * (l->dim + 1), &source, l->ncell, &cell));
  for (PetscInt c = 0; c < l->ncell; c++) cell[c] = c;
  s->result.load   = load;
  s->result.volume = (FlowVolume){.n = l->ncell, .cell = cell, .g = source};
  PetscCall(count_cells(s));
  *finer = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowFinerDestroy(FlowFiner *finer)
{
  FlowFiner  s = *finer;
  PetscReal *load, *source;
  PetscInt  *cell;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  load   = (PetscReal *)s->result.load;
  source = (PetscReal *)s->result.volume.g;
  cell   = (PetscInt *)s->result.volume.cell;
  if (s->f->finer == s->cell) s->f->finer = NULL;
  PetscCall(PetscFree3(load, source, cell));
  PetscCall(PetscFree3(s->v, s->p, s->cell));
  PetscCall(PetscFree3(s->count, s->residual, s->average));
  PetscCall(PetscFree2(s->given, s->solution));
  PetscCall(PetscFree(*finer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the cells find more, averaged on their sides, is added to what was found */
static PetscErrorCode solve_cells(FlowFiner s, const PetscReal u[], const PetscReal p[])
{
  const MeshLocal *l  = s->l;
  const PetscInt   bs = s->ns * l->dim, size = s->t.nw * l->dim;
  PetscReal       *r, v[FINER_W * 3];
  FinerCell        cell;
  FinerFound       found;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->ncell * size, &r));
  PetscCall(PetscArrayzero(s->residual, l->nnode_all * bs));
  PetscCall(PetscArrayzero(s->average, l->nnode_all * bs));
  for (PetscInt c = 0; c < l->ncell; c++) {
    if (FlowIsInactive(s->f, c)) continue;
    PetscCall(gather(s, c, u, p, &cell, &found));
    FinerResidual(&cell, &found, r + c * size);
    exchange(s, c, PETSC_FALSE, PETSC_FALSE, r + c * size, s->residual);
  }
  PetscCall(MeshSumNodes(s->f->mesh, bs, s->residual));
  PetscCall(MeshSyncNodes(s->f->mesh, bs, s->residual));
  for (PetscInt c = 0; c < l->ncell; c++) {
    if (FlowIsInactive(s->f, c)) continue;
    PetscCall(gather(s, c, u, p, &cell, &found));
    exchange(s, c, PETSC_TRUE, PETSC_TRUE, r + c * size, s->residual);
    PetscCall(FinerSolve(&cell, r + c * size, &found, v));
    PetscCall(PetscArraycpy(r + c * size, v, size));
    exchange(s, c, PETSC_FALSE, PETSC_TRUE, v, s->average);
  }
  PetscCall(MeshSumNodes(s->f->mesh, bs, s->average));
  PetscCall(MeshSyncNodes(s->f->mesh, bs, s->average));
  for (PetscInt c = 0; c < l->ncell; c++) {
    if (FlowIsInactive(s->f, c)) continue;
    exchange(s, c, PETSC_TRUE, PETSC_FALSE, r + c * size, s->average);
    for (PetscInt i = 0; i < size; i++) s->v[c * size + i] += r[c * size + i];
  }
  PetscCall(PetscFree(r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Less r [nb][dim] of a cell */
static void subtract(const MeshLocal *l, PetscInt c, PetscReal r[], PetscReal load[])
{
  MeshCellScatter(l, c, l->dim, r);
  for (PetscInt i = 0; i < l->nb * l->dim; i++)
    load[l->cell_node[c * l->nb + i / l->dim] * l->dim + i % l->dim] -= r[i];
}

PetscErrorCode FlowFinerFind(FlowFiner s, const PetscReal u[], const PetscReal p[], const FlowFinerResult **result)
{
  const MeshLocal *l      = s->l;
  PetscReal       *load   = (PetscReal *)s->result.load, sum[6], moved[MESH_MAX_NB * 3], r[MESH_MAX_NB * 3];
  PetscReal       *source = (PetscReal *)s->result.volume.g;
  FinerSums        sums   = {.energy = 0};
  FinerCell        cell;
  FinerFound       found;

  PetscFunctionBeginUser;
  PetscCall(solve_cells(s, u, p));
  PetscCall(PetscArrayzero(load, l->nnode_all * l->dim));
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal *answer = s->cell + c * l->nb * l->dim;

    if (FlowIsInactive(s->f, c)) continue;
    PetscCall(gather(s, c, u, p, &cell, &found));
    FinerAnswer(&cell, &found, answer, source + c * (l->dim + 1), &sums);
    subtract(l, c, answer, load);
    if (s->sweeps == 0 || !s->f->par.convection) continue;
    MeshCellValues(l, c, l->dim, s->solution, moved);
    for (PetscInt i = 0; i < l->nb * l->dim; i++) moved[i] = cell.u[i] - moved[i];
    FinerConvect(&cell, moved, r); /* a system that is linear about the solution lacks it */
    subtract(l, c, r, load);
  }
  s->sweeps++;
  PetscCall(MeshSumNodes(s->f->mesh, l->dim, load));
  PetscCall(PetscArraycpy(sum, sums.velocity, 3));
  sum[3] = sums.energy;
  sum[4] = sums.correction;
  sum[5] = sums.dissipation;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 6, MPIU_REAL, MPIU_SUM, s->f->comm));
  PetscCall(PetscArraycpy(s->result.velocity, sum, 3));
  s->result.energy   = sum[3];
  s->result.fraction = sum[5] > 0 ? sum[4] / sum[5] : 0;
  *result            = &s->result;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowFinerCount(FlowFiner s, PetscBool count)
{
  PetscFunctionBeginUser;
  s->f->finer = count ? s->cell : NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}
