/* Coarse: see coarse.h. Ghost cells are known: every rank builds the rows of its cells and its nodes' part alone. */
#include "compat.h"
#include "coarse.h"
#include "base/opt.h"
#include "base/array.h"
#include "lagged.h"
#include "laplacian.h"
#include "thinrows.h"
#include "transfer.h"

#define MAX_ASPECT 1.5 /* see choose_operator */

/* Of the bodies' part W W^T, by dimension: vertices that are small beside the largest of their body, and bodies that
   fill much and change little, drop out. W W^T beside the diagonal of the operator, times the number of vertices (in
   space its root), is 1 to 4 of a body of the fluid's density alone, in crowds up to hundreds of times that
   (runs/studies/flow-solver, "What the coarse level needs of a body"). */
static const ThinRule RULE[] = {[2] = {.nr = 3, .few = 24, .max = 128, .tol = 0.25, .weak = 5, .power = 1},
                                [3] = {.nr = 6, .few = 64, .max = 128, .tol = 0.25, .weak = 2.5, .power = 0.5}};

struct _p_Coarse {
  MPI_Comm         comm; /* of the mesh */
  Mesh             mesh;
  const MeshLocal *loc;
  PetscInt         nk;                 /* pressures a cell */
  PetscBool        floating, definite; /* known up to a constant; the operator has got its share of the diagonal */
  PetscReal        keep;               /* of the solver on this level, see lagged.h */
  PC               solver;             /* borrowed, of the PCMG that CoarseSetUpPC saw */
  PetscBool        changed;            /* the matrix, since then */
  Transfer         transfer;
  Mat              interpolation, matrix; /* interpolation: of the PCMG, or NULL */
  Laplacian        laplacian;             /* NULL: the operator is I^T S_p I */
  const PetscInt  *vertex, *global;       /* the transfer's: [nnode_all] at a node; [all] */
  PetscReal       *b, *x;                 /* [all] right-hand side and solution at vertices, of CoarseCorrect */
  Vec              from, to;              /* their own parts */
  PetscBool        own_solver;            /* there is no PCMG: the solver is ours */
  PetscBool       *inactive;              /* [nnode_all] vertex without fluid around */
  PetscInt        *col;                   /* [max] vertices of the cells around a node, 9 (27) on regular meshes, */
  PetscReal       *g, *block;             /* [max][dim], [max][max] and what they see of it: CoarseAddNode's */
  PetscBool        keeps;                 /* changes, for CoarseTakeChanges; entries so far: */
  PetscInt         nentry, entry_capacity, *row, *column;
  PetscReal       *value;
  /* the bodies' part, see CoarseSetBodies */
  PetscBool        crowded; /* the operator has had a part of bodies */
  Constraint       bodies;
  PetscInt         nr, ncut;
  const PetscInt  *cell, *body;
  const PetscReal *w;
};

/* ---- operator ---- */

/* g = I^T b_i for component a of node i: what the node sees of the vertices around it. The Galerkin operator I^T S_p I
   is the sum of weight g g^T over all slots. */
static PetscErrorCode vertex_gradient(Coarse s, const PetscReal *const b[], PetscInt i, PetscInt *n, PetscInt col[],
                                      PetscReal g[])
{
  const MeshLocal *l  = s->loc;
  const PetscInt   nv = 1 << l->dim, dim = l->dim, nd = l->nb * dim;

  PetscFunctionBeginUser;
  *n = 0;
  for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
    const PetscInt   c = l->node_cell[q];
    PetscInt         j = 0;
    const PetscInt  *vertex;
    const PetscReal *fit;

    while (l->cell_node[c * l->nb + j] != i) j++;
    TransferGetCell(s->transfer, c, &vertex, &fit);
    for (PetscInt v = 0; v < nv; v++) {
      const PetscInt global = s->global[vertex[v]];
      PetscInt       at     = 0;

      while (at < *n && col[at] != global) at++;
      if (at == *n) {
        col[(*n)++] = global;
        for (PetscInt a = 0; a < dim; a++) g[at * dim + a] = 0;
      }
      for (PetscInt k = 0; k < s->nk; k++)
        for (PetscInt a = 0; a < dim; a++) g[at * dim + a] += fit[k * nv + v] * b[c][k * nd + j * dim + a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where the pressure is known up to a constant, the coarse operator is singular but for round-off, and a solver that
   reduces it to a single unknown divides by that. A small share of the diagonal, put in once, keeps it definite; what
   it does to the constant is projected out. */
static PetscErrorCode make_definite(Coarse s)
{
  Vec diagonal;

  PetscFunctionBeginUser;
  if (!s->floating || s->definite) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatCreateVecs(s->matrix, &diagonal, NULL));
  PetscCall(MatGetDiagonal(s->matrix, diagonal));
  PetscCall(VecScale(diagonal, 1e-7));
  PetscCall(MatDiagonalSet(s->matrix, diagonal, ADD_VALUES));
  PetscCall(VecDestroy(&diagonal));
  s->definite = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own vertices all of whose cells are inactive have an empty row in the operator: they get the identity */
static PetscErrorCode set_inactive_row(Coarse s, PetscInt i, const PetscInt cell_material[])
{
  const MeshLocal *l        = s->loc;
  PetscBool        inactive = PETSC_TRUE;

  PetscFunctionBeginUser;
  if (i >= l->nnode || s->vertex[i] < 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++)
    inactive = (PetscBool)(inactive && cell_material && cell_material[l->node_cell[q]] < 0);
  if (inactive != s->inactive[i])
    PetscCall(MatSetValue(s->matrix, s->vertex[i], s->vertex[i], inactive ? 1 : -1, ADD_VALUES));
  s->inactive[i] = inactive;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The matrix W^T I, rows by slots, with room for what the cells of all ranks have for it: entries (a vertex as often
   as a cut cell has it) in the columns of the slot's rank and in others, which the ranks that know a body tell it */
static PetscErrorCode create_rows(Coarse s, Mat *moments)
{
  const ConstraintView *P     = ConstraintGetView(s->bodies);
  const PetscInt        nrows = P->count * s->nr, nv = 1 << s->loc->dim;
  const PetscInt       *range;
  PetscInt              n, *need[2], *all[2], *capacity[2];

  PetscFunctionBeginUser;
  PetscCall(MatGetLocalSize(s->matrix, &n, NULL));
  PetscCall(MatGetOwnershipRanges(s->matrix, &range));
  PetscCall(PetscCalloc4(P->nlocal, &need[0], P->nlocal, &need[1], P->count, &all[0], P->count, &all[1]));
  PetscCall(PetscMalloc2(nrows, &capacity[0], nrows, &capacity[1]));
  for (PetscInt i = 0; i < s->ncut; i++) {
    const PetscInt   l = P->local_index[s->body[i]], owner = P->local_slot[l] / P->count;
    const PetscInt  *vertex;
    const PetscReal *fit;

    TransferGetCell(s->transfer, s->cell[i], &vertex, &fit);
    for (PetscInt v = 0; v < nv; v++)
      need[s->global[vertex[v]] < range[owner] || s->global[vertex[v]] >= range[owner + 1]][l]++;
  }
  for (PetscInt o = 0; o < 2; o++) {
    PetscCall(ConstraintSumCounts(s->bodies, need[o], all[o]));
    for (PetscInt k = 0; k < nrows; k++) capacity[o][k] = o ? all[o][k / s->nr] : PetscMin(n, all[o][k / s->nr]);
  }
  PetscCall(MatCreate(s->comm, moments));
  PetscCall(MatSetSizes(*moments, nrows, n, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetType(*moments, MATAIJ));
  PetscCall(MatSeqAIJSetPreallocation(*moments, 0, capacity[0]));
  PetscCall(MatMPIAIJSetPreallocation(*moments, 0, capacity[0], 0, capacity[1]));
  PetscCall(PetscFree2(capacity[0], capacity[1]));
  PetscCall(PetscFree4(need[0], need[1], all[0], all[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The vertices around one body, in the order in which its cells name them, and what they have of its rows */
typedef struct {
  PetscInt   n, capacity, *node, *col;
  PetscReal *value; /* [n][nr] */
  PetscInt  *where; /* [nnode_all] place of a local vertex, or -1 */
} BodyVertices;

/* += what cut cell i has */
static PetscErrorCode add_cut(Coarse s, PetscInt i, BodyVertices *a)
{
  const PetscInt   nv = 1 << s->loc->dim, nr = s->nr;
  const PetscInt  *node;
  const PetscReal *fit;

  PetscFunctionBeginUser;
  TransferGetCell(s->transfer, s->cell[i], &node, &fit);
  for (PetscInt v = 0; v < nv; v++) {
    if (a->where[node[v]] < 0) {
      PetscCall(ArrayReserve(a->n + 1, &a->capacity, &a->node, sizeof(*a->node), &a->col, sizeof(*a->col), &a->value,
                             (size_t)nr * sizeof(*a->value), NULL));
      PetscCall(PetscArrayzero(a->value + a->n * nr, nr));
      a->col[a->n]      = s->global[node[v]];
      a->where[node[v]] = a->n;
      a->node[a->n++]   = node[v];
    }
    for (PetscInt k = 0; k < s->nk; k++)
      for (PetscInt r = 0; r < nr; r++)
        a->value[a->where[node[v]] * nr + r] += s->w[(i * s->nk + k) * nr + r] * fit[k * nv + v];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The rows of a body, which begin at row, with ascending columns: PETSc appends these */
static PetscErrorCode insert_vertices(Coarse s, PetscInt row, BodyVertices *a, Mat moments)
{
  PetscInt  *order;
  PetscReal *value;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(a->n, &order, a->n, &value));
  for (PetscInt i = 0; i < a->n; i++) order[i] = i;
  PetscCall(PetscSortIntWithArray(a->n, a->col, order));
  for (PetscInt r = 0; r < s->nr; r++, row++) {
    for (PetscInt i = 0; i < a->n; i++) value[i] = a->value[order[i] * s->nr + r];
    PetscCall(MatSetValues(moments, 1, &row, a->n, a->col, value, ADD_VALUES));
  }
  for (PetscInt i = 0; i < a->n; i++) a->where[a->node[i]] = -1;
  a->n = 0;
  PetscCall(PetscFree2(order, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode fill_rows(Coarse s, Mat moments)
{
  PetscInt    *body, *cut;
  BodyVertices a = {0};

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(s->ncut, &body, s->ncut, &cut, s->loc->nnode_all, &a.where));
  for (PetscInt i = 0; i < s->loc->nnode_all; i++) a.where[i] = -1;
  for (PetscInt i = 0; i < s->ncut; i++) {
    body[i] = s->body[i];
    cut[i]  = i;
  }
  PetscCall(PetscSortIntWithArray(s->ncut, body, cut));
  for (PetscInt i = 0; i < s->ncut; i++) {
    PetscCall(add_cut(s, cut[i], &a));
    if (i + 1 < s->ncut && body[i + 1] == body[i]) continue;
    PetscCall(
      insert_vertices(s,
                      ConstraintGetView(s->bodies)->local_slot[ConstraintGetView(s->bodies)->local_index[body[i]]] *
                        s->nr,
                      &a, moments));
  }
  PetscCall(PetscFree3(body, cut, a.where));
  PetscCall(PetscFree(a.node));
  PetscCall(PetscFree(a.col));
  PetscCall(PetscFree(a.value));
  PetscCall(MatAssemblyBegin(moments, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(moments, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseCreateMoments(Coarse s, Mat *all, Mat *thin)
{
  PetscInt any = s->ncut > 0;
  Vec      inverse;

  PetscFunctionBeginUser;
  *all = *thin = NULL;
  if (!s->bodies) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &any, 1, MPIU_INT, MPI_MAX, s->comm));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(create_rows(s, all));
  PetscCall(fill_rows(s, *all));
  PetscCall(MatCreateVecs(s->matrix, &inverse, NULL));
  PetscCall(MatGetDiagonal(s->matrix, inverse));
  PetscCall(VecReciprocal(inverse));
  PetscCall(ThinRows(*all, &RULE[s->loc->dim], inverse, thin));
  PetscCall(VecDestroy(&inverse));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* whole = matrix + the bodies' part, or NULL where there is none */
static PetscErrorCode add_bodies(Coarse s, Mat *whole)
{
  Mat all, thin;

  PetscFunctionBeginUser;
  *whole = NULL;
  PetscCall(CoarseCreateMoments(s, &all, &thin));
  PetscCall(MatDestroy(&all));
  if (!thin) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatTransposeMatMult(thin, thin, MAT_INITIAL_MATRIX, PETSC_DEFAULT, whole));
  PetscCall(MatDestroy(&thin));
  PetscCall(MatAXPY(*whole, 1, s->matrix, DIFFERENT_NONZERO_PATTERN));
  PetscCall(MatSetOption(*whole, MAT_SYMMETRIC, PETSC_TRUE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Longest over shortest side of the cell that is stretched most. Collective. */
static PetscErrorCode find_aspect(Coarse s, PetscReal *aspect)
{
  const PetscInt dim = s->loc->dim;

  PetscFunctionBeginUser;
  *aspect = 1;
  for (PetscInt c = 0; c < s->loc->ncell; c++) {
    PetscReal J[9], max = 0, min = PETSC_MAX_REAL;

    PetscCall(TransferMapCell(s->mesh, c, J));
    for (PetscInt e = 0; e < dim; e++) {
      PetscReal side = 0;

      for (PetscInt a = 0; a < dim; a++) side += PetscSqr(J[a * dim + e]);
      max = PetscMax(max, side);
      min = PetscMin(min, side);
    }
    *aspect = PetscMax(*aspect, PetscSqrtReal(max / min));
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, aspect, 1, MPIU_REAL, MPIU_MAX, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Space: 27 entries a row in place of 125. Plane: 9 in place of 25, for as many iterations where cells are nearly
   square and a third more where they are stretched (runs/studies/flow-solver). */
static PetscErrorCode choose_operator(Coarse s)
{
  static const char *const OPERATORS[] = {"auto", "galerkin", "laplacian", NULL};
  PetscInt                 choice      = 0;
  PetscReal                aspect      = 1;

  PetscFunctionBeginUser;
  PetscCall(OptChoice("-flow_pressure_coarse", OPERATORS, &choice));
  if (choice == 0 && s->loc->dim == 2) PetscCall(find_aspect(s, &aspect));
  if (choice == 0) choice = aspect <= MAX_ASPECT ? 2 : 1;
  if (choice == 2) PetscCall(LaplacianCreate(s->mesh, &s->laplacian));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Arrays of CoarseAddNode for the node with most cells: a mesh from a file may have any number of them */
static PetscErrorCode reserve_node(Coarse s)
{
  const MeshLocal *l   = s->loc;
  PetscInt         max = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode_all; i++) max = PetscMax(max, l->node_cell_ptr[i + 1] - l->node_cell_ptr[i]);
  max *= 1 << l->dim;
  PetscCall(PetscMalloc3(max, &s->col, max * l->dim, &s->g, max * max, &s->block));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode CoarseCreate(Mesh mesh, PetscInt nk, PetscBool floating, PetscReal keep, Coarse *coarse)
{
  Coarse   s;
  PetscInt n, all, capacity;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->mesh     = mesh;
  s->nk       = nk;
  s->floating = floating;
  s->keep     = keep;
  PetscCall(MeshGetLocal(mesh, &s->loc));
  PetscCall(MeshGetComm(mesh, &s->comm));
  PetscCall(PetscCalloc1(s->loc->nnode_all, &s->inactive));
  PetscCall(TransferCreate(mesh, nk, &s->transfer));
  PetscCall(TransferGetVertices(s->transfer, &n, &all, &s->global, &s->vertex));
  PetscCall(choose_operator(s));
  if (!s->laplacian) PetscCall(reserve_node(s));
  if (s->laplacian) capacity = s->loc->dim == 2 ? 9 : 27;
  else capacity = s->loc->dim == 2 ? 25 : 125; /* vertices within two cells */
  if (s->loc->hang) capacity *= 2;             /* small cells around a large one */
  PetscCall(MatCreateAIJ(s->comm, n, n, PETSC_DETERMINE, PETSC_DETERMINE, capacity, NULL, capacity, NULL, &s->matrix));
  PetscCall(MatSetOption(s->matrix, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE)); /* irregular meshes may have more */
  PetscCall(MatSetOption(s->matrix, MAT_SYMMETRIC, PETSC_TRUE));
  *coarse = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseDestroy(Coarse *coarse)
{
  Coarse s = *coarse;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(TransferDestroy(&s->transfer));
  PetscCall(MatDestroy(&s->interpolation));
  PetscCall(PetscFree2(s->b, s->x));
  PetscCall(VecDestroy(&s->from));
  PetscCall(VecDestroy(&s->to));
  if (s->own_solver) PetscCall(PCDestroy(&s->solver));
  PetscCall(MatDestroy(&s->matrix));
  PetscCall(LaplacianDestroy(&s->laplacian));
  PetscCall(PetscFree3(s->col, s->g, s->block));
  PetscCall(PetscFree(s->row));
  PetscCall(PetscFree(s->column));
  PetscCall(PetscFree(s->value));
  PetscCall(PetscFree(s->inactive));
  PetscCall(PetscFree(*coarse));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseAddNode(Coarse s, const PetscReal *const b[], PetscInt i, const PetscReal change[])
{
  const PetscInt dim = s->loc->dim;
  PetscInt       n, *col = s->col;
  PetscReal     *g = s->g, *block = s->block;

  PetscFunctionBeginUser;
  if (s->laplacian) {
    PetscCall(LaplacianAddNode(s->laplacian, b, s->nk, i, change));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(vertex_gradient(s, b, i, &n, col, g));
  for (PetscInt e = 0; e < n * n; e++) {
    block[e] = 0;
    for (PetscInt a = 0; a < dim; a++) block[e] += change[a] * g[e / n * dim + a] * g[e % n * dim + a];
  }
  PetscCall(MatSetValues(s->matrix, n, col, n, col, block, ADD_VALUES));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode keep_entries(Coarse s, PetscInt n, const PetscInt at[], const PetscReal block[])
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(s->nentry + n * n, &s->entry_capacity, &s->row, sizeof(*s->row), &s->column,
                         sizeof(*s->column), &s->value, sizeof(*s->value), NULL));
  for (PetscInt e = 0; e < n * n; e++, s->nentry++) {
    s->row[s->nentry]    = at[e / n];
    s->column[s->nentry] = at[e % n];
    s->value[s->nentry]  = block[e];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseAddCells(Coarse s, PetscReal scale, PetscInt n, const PetscInt cell[], const PetscReal block[])
{
  const PetscInt nv = 1 << s->loc->dim, nk = s->nk;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) {
    PetscInt         col[8];
    PetscReal        sum[64] = {0};
    const PetscInt  *vertex;
    const PetscReal *fit;

    TransferGetCell(s->transfer, cell[i], &vertex, &fit);
    for (PetscInt e = 0; e < nk * nk; e++)
      for (PetscInt v = 0; v < nv * nv; v++)
        sum[v] += scale * fit[e / nk * nv + v / nv] * block[i * nk * nk + e] * fit[e % nk * nv + v % nv];
    for (PetscInt v = 0; v < nv; v++) col[v] = s->global[vertex[v]];
    if (s->keeps) PetscCall(keep_entries(s, nv, col, sum));
    else PetscCall(MatSetValues(s->matrix, nv, col, nv, col, sum, ADD_VALUES));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseUpdateCells(Coarse s, PetscInt n, const PetscInt cell[], const PetscInt cell_material[])
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  PetscCall(TransferUpdateCells(s->transfer, n, cell, cell_material));
  PetscCall(MatDestroy(&s->interpolation));
  for (PetscInt e = 0; e < n; e++) {
    for (PetscInt j = 0; j < l->nb; j++)
      PetscCall(set_inactive_row(s, l->cell_node[cell[e] * l->nb + j], cell_material));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseFlush(Coarse s)
{
  PetscFunctionBeginUser;
  if (s->laplacian && !s->keeps) PetscCall(LaplacianFlush(s->laplacian, s->vertex, s->matrix));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseAssemble(Coarse s)
{
  PetscFunctionBeginUser;
  if (s->keeps) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoarseFlush(s));
  PetscCall(MatAssemblyBegin(s->matrix, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(s->matrix, MAT_FINAL_ASSEMBLY));
  PetscCall(make_definite(s));
  s->changed = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseKeepChanges(Coarse s, PetscBool *kept)
{
  PetscFunctionBeginUser;
  s->keeps = *kept = (PetscBool)(s->laplacian != NULL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseTakeChanges(Coarse s, CoarseChanges *c)
{
  PetscInt   n, *row;
  PetscReal *value;

  PetscFunctionBeginUser;
  PetscCall(LaplacianTake(s->laplacian, s->vertex, &c->n, &c->cell, &c->change, &n, &row, &value));
  for (PetscInt v = 0; v < n; v++) PetscCall(keep_entries(s, 1, row + v, value + v));
  PetscCall(PetscFree(row));
  PetscCall(PetscFree(value));
  c->nentry = s->nentry;
  c->row    = s->row;
  c->column = s->column;
  c->value  = s->value;
  s->nentry = s->entry_capacity = 0;
  s->row = s->column = NULL;
  s->value           = NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseSetBodies(Coarse s, Constraint bodies, PetscInt n, const PetscInt cell[], const PetscInt body[],
                               const PetscReal w[])
{
  PetscFunctionBeginUser;
  s->bodies = bodies;
  s->nr     = ConstraintGetView(bodies)->nr;
  s->ncut   = n;
  s->cell   = cell;
  s->body   = body;
  s->w      = w;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* coarse: the KSP that applies the solver, or NULL */
static PetscErrorCode set_up_solver(Coarse s, KSP coarse)
{
  Mat         whole, A;
  PetscBool   iterates;
  const char *prefix;

  PetscFunctionBeginUser;
  PetscCall(add_bodies(s, &whole));
  s->changed = (PetscBool)(s->changed || s->crowded || whole); /* the bodies' part is another one every time */
  s->crowded = (PetscBool)(whole != NULL);
  A          = whole ? whole : s->matrix;
  if (coarse) {
    PetscCall(KSPGetOptionsPrefix(coarse, &prefix)); /* a single application reads nothing of the operator */
    PetscCall(PetscOptionsHasName(NULL, prefix, "-ksp_type", &iterates));
    PetscCall(KSPSetOperators(coarse, iterates ? A : s->matrix, iterates ? A : s->matrix));
  }
  if (s->changed) PetscCall(LaggedUpdate(s->solver, A));
  PetscCall(MatDestroy(&whole));
  s->changed = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseSetUpPC(Coarse s, PC pc)
{
  KSP coarse;

  PetscFunctionBeginUser;
  if (!s->interpolation) PetscCall(TransferCreateMat(s->transfer, &s->interpolation));
  PetscCall(PCMGSetGalerkin(pc, PC_MG_GALERKIN_NONE));
  PetscCall(PCMGSetInterpolation(pc, 1, s->interpolation));
  PetscCall(PCMGGetCoarseSolve(pc, &coarse));
  if (!s->solver) {
    PetscCall(KSPGetPC(coarse, &s->solver));
    PetscCall(LaggedCreate(s->solver, s->keep));
  }
  PetscCall(set_up_solver(s, coarse));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseSetUp(Coarse s, const char prefix[])
{
  PetscInt        own, all;
  const PetscInt *global, *at_node;

  PetscFunctionBeginUser;
  if (!s->solver) {
    s->own_solver = PETSC_TRUE;
    PetscCall(PCCreate(s->comm, &s->solver));
    PetscCall(PCSetOptionsPrefix(s->solver, prefix));
    PetscCall(PCSetOperators(s->solver, s->matrix, s->matrix));
    PetscCall(LaggedCreate(s->solver, s->keep));
    PetscCall(TransferGetVertices(s->transfer, &own, &all, &global, &at_node));
    PetscCall(PetscCalloc2(all, &s->b, all, &s->x));
    PetscCall(VecCreateMPIWithArray(s->comm, 1, own, PETSC_DETERMINE, s->b, &s->from));
    PetscCall(VecCreateMPIWithArray(s->comm, 1, own, PETSC_DETERMINE, s->x, &s->to));
  }
  PetscCall(set_up_solver(s, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseCorrect(Coarse s, const PetscReal r[], PetscReal x[], PetscReal ghost[])
{
  PetscFunctionBeginUser;
  PetscCall(TransferRestrict(s->transfer, r, s->b));
  PetscCall(PCApply(s->solver, s->from, s->to));
  PetscCall(TransferInterpolateAdd(s->transfer, s->x, x, ghost));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarseGetMatrix(Coarse s, Mat *A)
{
  *A = s->matrix;
  return PETSC_SUCCESS;
}

PetscErrorCode CoarseGetTransfer(Coarse s, Transfer *t)
{
  *t = s->transfer;
  return PETSC_SUCCESS;
}

PetscErrorCode CoarseView(Coarse s, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  if (s->solver) PetscCall(PCView(s->solver, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}
