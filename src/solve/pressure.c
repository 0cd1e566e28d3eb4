/* Pressure: see pressure.h. All entries of a row belong to cells that share a node with the row's cell, and ghost cells are known, so every rank builds its rows alone. */
#include "compat.h"
#include "pressure.h"
#include "blockgs.h"
#include "coarse.h"
#include "base/dense.h"
#include "base/log.h"
#include "base/opt.h"

#define MAX_CELLS 32 /* other ranks at a node */

struct _p_Pressure {
  Flow             flow;
  Constraint       constraint;
  const MeshLocal *loc;
  Mesh             mesh;
  PetscInt         nk, nr, nbodies; /* pressures a cell; rigid slots a body */
  PetscReal        eps;
  Mat              sweeps;  /* single-precision smoother of the matrix, or NULL: another one was asked for */
  PetscReal       *overlap; /* [ncell][nk][nk] or NULL on one rank, see set_overlap() */
  PetscBool        smoothers_set;
  Coarse           coarse; /* of the default preconditioner, PCMG with levels P1 discontinuous -> Q1; or NULL */
  Mat              matrix, shell;
  PetscInt        *neighbour_ptr, *neighbour; /* [ncell + 1]; local cells that share a node with a cell */
  PetscReal       *weight;                    /* as of the last update; zero before the first */
  /* bodies: cells where B R_k is not zero */
  PetscInt   ncut, room, *cut_cell, *cut_body;
  PetscReal *cut_w; /* [ncut][nk][nr] B R_k L_k with L_k L_k^T = M_k^{-1} */
  PetscReal *work;  /* [nbodies][nr] */
  /* cells between two constrained surfaces, see find_shared_cells() */
  PetscReal    eps_shared, *shared_block; /* [nshared][nk][nk] */
  PetscInt     nshared, shared_room, *shared_cell;
  PetscBool    any_shared, floating; /* on any rank; pressure determined up to a constant without C */
  MatNullSpace constant;
  /* own cells near something that changes, each once */
  PetscInt *stamp, stamp_now, ntouched, *touched; /* [ncell]; touched: with a body node, ascending */
  PetscInt  nlisted, *listed;                     /* scratch [ncell] */
  /* cells that are no part of the fluid */
  PetscInt        nsoft; /* the first of the shared cells; the others are dead */
  const PetscInt *cell_body;
  PetscBool      *resolved; /* [nbodies] the mesh lines up with the body */
  PetscInt       *changed, nchanged, changed_room;
  PetscBool       refresh; /* cells have changed on some rank since the last update */
};

#define UNKNOWN -1 /* weight of a node whose cells have changed */

/* ---- the matrix ---- */

static PetscErrorCode find_neighbours(Pressure p)
{
  const MeshLocal *l = p->loc;
  PetscInt         n = 0, room = 10 * l->ncell + 64;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->ncell + 1, &p->neighbour_ptr));
  PetscCall(PetscMalloc1(room, &p->neighbour));
  p->neighbour_ptr[0] = 0;
  for (PetscInt c = 0; c < l->ncell; c++) {
    const PetscInt begin = n;

    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt i = l->cell_node[c * l->nb + j];

      for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
        PetscInt k = begin;

        while (k < n && p->neighbour[k] != l->node_cell[q]) k++;
        if (k < n) continue;
        if (n == room) {
          room = 2 * room;
          PetscCall(PetscRealloc(room * sizeof(PetscInt), &p->neighbour));
        }
        p->neighbour[n++] = l->node_cell[q];
      }
    }
    p->neighbour_ptr[c + 1] = n;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Blocks in own and in other ranks' columns, for every own cell */
static PetscErrorCode count_blocks(Pressure p, PetscInt own[], PetscInt other[])
{
  const MeshLocal *l = p->loc;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell; c++) {
    own[c] = other[c] = 0;
    for (PetscInt q = p->neighbour_ptr[c]; q < p->neighbour_ptr[c + 1]; q++) *(p->neighbour[q] < l->ncell ? &own[c] : &other[c]) += 1;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Blocks of nk x nk: BAIJ for the default preconditioner (block SOR, less memory traffic), AIJ for those that know nothing else */
static PetscErrorCode create_matrix(Pressure p)
{
  const PetscInt n = p->loc->ncell;
  PetscInt      *own, *other;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(n, &own, n, &other));
  PetscCall(count_blocks(p, own, other));
  PetscCall(MatCreate(PETSC_COMM_WORLD, &p->matrix));
  PetscCall(MatSetSizes(p->matrix, n * p->nk, n * p->nk, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetBlockSize(p->matrix, p->nk));
  PetscCall(MatSetType(p->matrix, p->coarse ? MATBAIJ : MATAIJ));
  PetscCall(MatXAIJSetPreallocation(p->matrix, p->nk, own, other, NULL, NULL));
  PetscCall(MatSetOption(p->matrix, MAT_NO_OFF_PROC_ENTRIES, PETSC_TRUE));
  PetscCall(MatSetOption(p->matrix, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(p->matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscCall(PetscFree2(own, other));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Set the row of blocks of cell c: sum over shared nodes of B_c weight B_c2^T */
static PetscErrorCode set_row(Pressure p, const PetscReal b[], const PetscReal weight[], PetscInt c)
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, nb = l->nb, n = nb * dim, nk = p->nk;
  const PetscInt   nn = p->neighbour_ptr[c + 1] - p->neighbour_ptr[c], *neighbour = p->neighbour + p->neighbour_ptr[c], row = l->cell_start + c;
  PetscInt        *col;
  PetscReal       *out; /* [nk][nn][nk] */

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(nn, &col, nn * nk * nk, &out));
  PetscCall(PetscArrayzero(out, nn * nk * nk));
  for (PetscInt q = 0; q < nn; q++) col[q] = l->cell_global[neighbour[q]];
  for (PetscInt j = 0; j < nb; j++) {
    const PetscInt i = l->cell_node[c * nb + j];
    PetscReal      wb[4][3];

    for (PetscInt k = 0; k < nk; k++)
      for (PetscInt a = 0; a < dim; a++) wb[k][a] = weight[i * dim + a] * b[c * nk * n + k * n + j * dim + a];
    for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
      const PetscInt c2 = l->node_cell[q];
      PetscInt       j2 = 0, at = 0;

      while (l->cell_node[c2 * nb + j2] != i) j2++;
      while (neighbour[at] != c2) at++;
      for (PetscInt k = 0; k < nk; k++)
        for (PetscInt m = 0; m < nk; m++)
          for (PetscInt a = 0; a < dim; a++) out[(k * nn + at) * nk + m] += wb[k][a] * b[c2 * nk * n + m * n + j2 * dim + a];
    }
  }
  PetscCall(MatSetValuesBlocked(p->matrix, 1, &row, nn, col, out, INSERT_VALUES));
  PetscCall(PetscFree2(col, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void list_cell(Pressure p, PetscInt c)
{
  if (c >= p->loc->ncell || p->stamp[c] == p->stamp_now) return;
  p->stamp[c]             = p->stamp_now;
  p->listed[p->nlisted++] = c;
}

static void list_cells_of_node(Pressure p, PetscInt i)
{
  for (PetscInt q = p->loc->node_cell_ptr[i]; q < p->loc->node_cell_ptr[i + 1]; q++) list_cell(p, p->loc->node_cell[q]);
}

static void start_list(Pressure p)
{
  p->stamp_now++;
  p->nlisted = 0;
}

/* (ranks other than this one with cells at node i) times (own cells at it) less one, at least zero; ranges: first rows of the ranks */
static PetscReal count_excess(Pressure p, const PetscInt ranges[], PetscInt i)
{
  const MeshLocal *l   = p->loc;
  PetscInt         own = 0, n = 0, other[MAX_CELLS];

  for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
    PetscInt rank = 0, k = 0;

    if (l->node_cell[q] < l->ncell) {
      own++;
      continue;
    }
    while (ranges[rank + 1] <= l->cell_global[l->node_cell[q]] * p->nk) rank++;
    while (k < n && other[k] != rank) k++;
    if (k == n && n < MAX_CELLS) other[n++] = rank;
  }
  return PetscMax(0, n * own - 1);
}

/* What the sweeps add to the diagonal block of cell c, because the ranks sweep at the same time. With g_a what cell a sees of a component of node i, and s_r the sum of g_a.p_a over the cells of
   rank r around it, the node's part of S is w (sum_r s_r)^2, and the couplings between R ranks at most (R - 1) w sum_r s_r^2 <= (R - 1) w sum_r n_r sum_a (g_a.p_a)^2; the diagonal has
   w (g_a.p_a)^2 of that, and half of the rest is to be added for a sweep there and back to be definite. Only nodes of more than two cells have any. Without it 504 discs of 1.5 cells on
   4 ranks stop with an indefinite preconditioner; the sum of the absolute values of the couplings, an easier bound, costs a settling disc on 2 ranks half as many iterations again. */
static PetscErrorCode set_overlap(Pressure p, const PetscInt ranges[], const PetscReal b[], const PetscReal weight[], PetscInt c)
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, n = l->nb * dim, nk = p->nk;
  PetscReal       *block = p->overlap + c * nk * nk;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(block, nk * nk));
  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscInt  i      = l->cell_node[c * l->nb + j];
    const PetscReal excess = count_excess(p, ranges, i);

    for (PetscInt e = 0; e < nk * nk && excess > 0; e++)
      for (PetscInt a = 0; a < dim; a++)
        block[e] += 0.5 * excess * weight[i * dim + a] * b[(c * nk + e / nk) * n + j * dim + a] * b[(c * nk + e % nk) * n + j * dim + a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The single-precision copy of the listed rows; the first call creates it (the matrix has its pattern then). */
static PetscErrorCode update_sweeps(Pressure p, const PetscReal b[], const PetscReal weight[])
{
  char            type[64];
  PetscBool       set, sor = PETSC_TRUE;
  PetscMPIInt     size;
  const PetscInt *ranges;

  PetscFunctionBeginUser;
  if (!p->coarse) PetscFunctionReturn(PETSC_SUCCESS);
  if (!p->sweeps) {
    PetscCall(PetscOptionsGetString(NULL, NULL, "-flow_fieldsplit_pressure_mg_levels_pc_type", type, sizeof(type), &set));
    if (set) PetscCall(PetscStrcmp(type, "sor", &sor));
    if (!sor) PetscFunctionReturn(PETSC_SUCCESS);
    PetscCall(BlockGSCreate(p->matrix, &p->sweeps));
    PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
    if (size > 1) PetscCall(PetscCalloc1(p->loc->ncell * p->nk * p->nk, &p->overlap));
    PetscCall(BlockGSSetExtra(p->sweeps, p->overlap));
    start_list(p);
    for (PetscInt c = 0; c < p->loc->ncell; c++) list_cell(p, c);
  }
  if (p->overlap) {
    PetscCall(MatGetOwnershipRanges(p->matrix, &ranges));
    for (PetscInt i = 0; i < p->nlisted; i++) PetscCall(set_overlap(p, ranges, b, weight, p->listed[i]));
  }
  PetscCall(BlockGSUpdate(p->sweeps, p->nlisted, p->listed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rebuild the rows of cells with a node whose weight has changed, and of those that are or were (old) shared. */
static PetscErrorCode update_matrix(Pressure p, const PetscReal weight[], PetscInt nold, const PetscInt old[])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim;
  const PetscReal *b;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(p->flow, &b));
  start_list(p);
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    PetscBool changed = PETSC_FALSE;

    for (PetscInt a = 0; a < dim; a++) changed = (PetscBool)(changed || weight[i * dim + a] != p->weight[i * dim + a]);
    if (changed) list_cells_of_node(p, i);
  }
  for (PetscInt i = 0; i < nold; i++) list_cell(p, old[i]);
  for (PetscInt i = 0; i < p->nshared; i++) list_cell(p, p->shared_cell[i]);
  for (PetscInt i = 0; i < p->nlisted; i++) PetscCall(set_row(p, b, weight, p->listed[i]));
  PetscCall(MatAssemblyBegin(p->matrix, MAT_FLUSH_ASSEMBLY));
  PetscCall(MatAssemblyEnd(p->matrix, MAT_FLUSH_ASSEMBLY));
  for (PetscInt i = 0; i < p->nshared; i++) {
    const PetscInt row = l->cell_start + p->shared_cell[i];

    PetscCall(MatSetValuesBlocked(p->matrix, 1, &row, 1, &row, p->shared_block + i * p->nk * p->nk, ADD_VALUES));
  }
  PetscCall(MatAssemblyBegin(p->matrix, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(p->matrix, MAT_FINAL_ASSEMBLY));
  PetscCall(update_sweeps(p, b, weight));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- cells between two surfaces ---- */

/* Block C = eps_shared B_c M_c^{-1} B_c^T of one cell over its constrained nodes */
static PetscErrorCode shared_block(Pressure p, const PetscInt body[], const PetscInt fixed[], PetscInt c, PetscReal block[])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, n = l->nb * dim, nk = p->nk;
  const PetscReal *b, *m;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(p->flow, &b));
  PetscCall(FlowGetLumpedMass(p->flow, &m));
  for (PetscInt e = 0; e < nk * nk; e++) block[e] = 0;
  for (PetscInt j = 0; j < n; j++) {
    const PetscInt i = l->cell_node[c * l->nb + j / dim];

    if (body[i] < 0 && !((fixed[i] >> (j % dim)) & 1)) continue;
    for (PetscInt e = 0; e < nk * nk; e++) block[e] += p->eps_shared / m[i] * b[(c * nk + e / nk) * n + j] * b[(c * nk + e % nk) * n + j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own cells with a node of a body: nothing else can be cut or shared. */
static PetscErrorCode find_touched_cells(Pressure p)
{
  const PetscInt *node;
  PetscInt        n;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetBodyNodes(p->constraint, &n, &node));
  start_list(p);
  for (PetscInt i = 0; i < n; i++) list_cells_of_node(p, node[i]);
  p->ntouched = p->nlisted;
  PetscCall(PetscArraycpy(p->touched, p->listed, p->ntouched));
  PetscCall(PetscSortInt(p->ntouched, p->touched));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode reserve_shared(Pressure p)
{
  PetscFunctionBeginUser;
  if (p->nshared == p->shared_room) {
    p->shared_room = 2 * p->shared_room + 16;
    PetscCall(PetscRealloc(p->shared_room * sizeof(PetscInt), &p->shared_cell));
    PetscCall(PetscRealloc(p->shared_room * p->nk * p->nk * sizeof(PetscReal), &p->shared_block));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The pressure of a dead cell stands alone with the identity as its block, of the size that other blocks have */
static PetscErrorCode add_dead_cells(Pressure p)
{
  const PetscReal scale = PetscPowReal(p->loc->h, p->loc->dim - 2);

  PetscFunctionBeginUser;
  for (PetscInt t = 0; t < p->ntouched && p->cell_body; t++) {
    if (p->cell_body[p->touched[t]] < 0) continue;
    PetscCall(reserve_shared(p));
    p->shared_cell[p->nshared] = p->touched[t];
    for (PetscInt e = 0; e < p->nk * p->nk; e++) p->shared_block[p->nshared * p->nk * p->nk + e] = e % (p->nk + 1) ? 0 : scale;
    p->nshared++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A cell whose nodes belong to two bodies, or to a body and a wall, may have pressures that no free velocity can serve: its divergence rows are then inconsistent
   (boundary-evidence, checked claims). Such cells get a small compressibility in the operator itself, as if their constrained nodes yielded a little to the pressure: B u + C p = 0. */
static PetscErrorCode find_shared_cells(Pressure p)
{
  const MeshLocal *l = p->loc;
  const PetscInt  *body, *fixed;
  const PetscReal *value;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(p->constraint, &body));
  PetscCall(ConditionsGetValues(FlowConditions(p->flow), &fixed, &value));
  p->nshared = 0;
  for (PetscInt t = 0; t < p->ntouched; t++) {
    const PetscInt c = p->touched[t], *node = l->cell_node + c * l->nb;
    PetscInt       owner = -1; /* the first body met */
    PetscBool      wall = PETSC_FALSE, two = PETSC_FALSE, cut = PETSC_FALSE;

    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt k = body[node[j]];

      if (k >= 0 && owner >= 0 && k != owner) two = PETSC_TRUE;
      if (k >= 0) owner = k;
      else if (fixed[node[j]]) wall = PETSC_TRUE;
      cut = (PetscBool)(cut || (k >= 0 && !p->resolved[k])); /* between resolved walls every pressure meets a free velocity */
    }
    if (!cut || (!two && !wall)) continue;
    PetscCall(reserve_shared(p));
    p->shared_cell[p->nshared] = c;
    PetscCall(shared_block(p, body, fixed, c, p->shared_block + p->nshared * p->nk * p->nk));
    p->nshared++;
  }
  p->nsoft = p->nshared;
  PetscCall(add_dead_cells(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureGetShared(Pressure p, PetscInt *n, const PetscInt *cell[], const PetscReal *block[])
{
  PetscFunctionBeginUser;
  *n     = p->nshared;
  *cell  = p->shared_cell;
  *block = p->shared_block;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the bodies' part ---- */

/* The body that node i moves with, if it is unknown, and its share in the motion */
static PetscInt holder(const PetscInt body[], const PetscInt follow[], const PetscReal share[], PetscInt i, PetscReal *part)
{
  const PetscInt k = body[i] >= 0 || !share ? body[i] : follow[i];

  *part = !share ? 1 : share[i];
  return k;
}

/* w [nk][nr] = B_c R_k L over the nodes of cell c that move with body k, times their share; fixed components do not move, whatever share of a wall's node the body covers */
static PetscErrorCode cut_rows(Pressure p, const PetscInt body[], const PetscInt follow[], const PetscReal share[], const PetscReal b[], PetscInt c,
                               PetscInt k, const PetscReal L[], PetscReal w[])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, n = l->nb * dim, *fixed;
  const PetscReal *value;
  PetscReal        q[4 * 6];

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(p->flow), &fixed, &value));
  for (PetscInt e = 0; e < p->nk * p->nr; e++) q[e] = w[e] = 0;
  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscInt i = l->cell_node[c * l->nb + j];
    PetscReal      R[18], part;

    if (holder(body, follow, share, i, &part) != k) continue;
    PetscCall(ConstraintRigidMap(p->constraint, i, k, R));
    for (PetscInt m = 0; m < p->nk; m++)
      for (PetscInt s = 0; s < p->nr; s++)
        for (PetscInt a = 0; a < dim; a++)
          if (!((fixed[i] >> a) & 1)) q[m * p->nr + s] += part * b[c * p->nk * n + m * n + j * dim + a] * R[a * p->nr + s];
  }
  for (PetscInt e = 0; e < p->nk * p->nr; e++)
    for (PetscInt s = 0; s < p->nr; s++) w[e] += q[e / p->nr * p->nr + s] * L[s * p->nr + e % p->nr];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* List (cell, body) pairs where the body moves some nodes, but not all of them rigidly. A cell may meet two bodies. */
static PetscErrorCode find_cut_cells(Pressure p, const PetscReal share[], const PetscReal mass_inverse[])
{
  const MeshLocal *l = p->loc;
  const PetscInt  *body, *follow, *unknown;
  const PetscReal *b;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(p->constraint, &body));
  PetscCall(ConstraintGetFollow(p->constraint, &follow));
  PetscCall(ConstraintGetUnknown(p->constraint, &unknown));
  PetscCall(FlowGetCellDivergence(p->flow, &b));
  p->ncut = 0;
  for (PetscInt t = 0; t < p->ntouched; t++) {
    const PetscInt c = p->touched[t], *node = l->cell_node + c * l->nb;

    for (PetscInt j = 0; j < l->nb; j++) {
      PetscReal      part;
      const PetscInt k     = holder(body, follow, share, node[j], &part);
      PetscBool      first = PETSC_TRUE, whole = PETSC_TRUE;
      PetscReal      L[36];

      if (k < 0 || !unknown[k]) continue;
      for (PetscInt m = 0; m < l->nb; m++) {
        if (m < j && holder(body, follow, share, node[m], &part) == k) first = PETSC_FALSE;
        if (body[node[m]] != k) whole = PETSC_FALSE;
      }
      if (!first || whole) continue;
      if (p->ncut == p->room) {
        p->room = 2 * p->room + 64;
        PetscCall(PetscRealloc(p->room * sizeof(PetscInt), &p->cut_cell));
        PetscCall(PetscRealloc(p->room * sizeof(PetscInt), &p->cut_body));
        PetscCall(PetscRealloc(p->room * p->nk * p->nr * sizeof(PetscReal), &p->cut_w));
      }
      p->cut_cell[p->ncut] = c;
      p->cut_body[p->ncut] = k;
      DenseFactor(p->nr, mass_inverse + k * p->nr * p->nr, L);
      PetscCall(cut_rows(p, body, follow, share, b, c, k, L, p->cut_w + p->ncut * p->nk * p->nr));
      p->ncut++;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = matrix x + W W^T x = matrix x + sum_k (B R_k) M_k^{-1} (B R_k)^T x */
static PetscErrorCode mult_shell(Mat mat, Vec x, Vec y)
{
  Pressure         p;
  const PetscReal *xa;
  PetscReal       *ya, *t;
  PetscInt         nr, nk;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &p));
  nr = p->nr;
  nk = p->nk;
  t  = p->work;
  PetscCall(MatMult(p->matrix, x, y));
  if (!p->nbodies) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(VecGetArray(y, &ya));
  PetscCall(PetscArrayzero(t, p->nbodies * nr));
  for (PetscInt i = 0; i < p->ncut; i++)
    for (PetscInt e = 0; e < nk * nr; e++) t[p->cut_body[i] * nr + e % nr] += p->cut_w[i * nk * nr + e] * xa[p->cut_cell[i] * nk + e / nr];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, t, (PetscMPIInt)(p->nbodies * nr), MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  for (PetscInt i = 0; i < p->ncut; i++)
    for (PetscInt e = 0; e < nk * nr; e++) ya[p->cut_cell[i] * nk + e / nr] += p->cut_w[i * nk * nr + e] * t[p->cut_body[i] * nr + e % nr];
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscCall(VecRestoreArray(y, &ya));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The null space: constant in the fluid, zero in dead cells */
static PetscErrorCode find_constant(Pressure p)
{
  Vec        constant;
  PetscReal *a;

  PetscFunctionBeginUser;
  PetscCall(MatNullSpaceDestroy(&p->constant));
  PetscCall(MatCreateVecs(p->matrix, &constant, NULL));
  PetscCall(VecGetArrayWrite(constant, &a));
  PetscCall(PressureGetConstant(p, a));
  PetscCall(VecRestoreArrayWrite(constant, &a));
  PetscCall(VecNormalize(constant, NULL));
  PetscCall(MatNullSpaceCreate(PETSC_COMM_WORLD, PETSC_FALSE, 1, &constant, &p->constant));
  PetscCall(VecDestroy(&constant));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The operator knows that constants are its null space; the matrix, which smoothers use, does not, to save their projections. */
static PetscErrorCode create_shell(Pressure p)
{
  const PetscInt n = p->loc->ncell * p->nk;

  PetscFunctionBeginUser;
  PetscCall(MatCreateShell(PETSC_COMM_WORLD, n, n, PETSC_DETERMINE, PETSC_DETERMINE, p, &p->shell));
  PetscCall(MatShellSetOperation(p->shell, MATOP_MULT, (void (*)(void))mult_shell));
  PetscCall(MatSetOption(p->shell, MAT_SYMMETRIC, PETSC_TRUE));
  if (p->floating) PetscCall(find_constant(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- two levels ---- */

/* Changes of weights are added, so a moving body costs what it touches. */
static PetscErrorCode update_coarse(Pressure p, const PetscReal weight[])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim;
  const PetscReal *b;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(p->flow, &b));
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal change[3] = {0, 0, 0};
    PetscBool any       = PETSC_FALSE;

    for (PetscInt a = 0; a < dim; a++) {
      change[a] = weight[i * dim + a] - (p->weight[i * dim + a] == UNKNOWN ? 0 : p->weight[i * dim + a]);
      any       = (PetscBool)(any || change[a] != 0);
    }
    if (any) PetscCall(CoarseAddNode(p->coarse, b, i, change));
  }
  PetscCall(CoarseAssemble(p->coarse));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Down: one forward block Gauss-Seidel sweep, up: one backward sweep; together symmetric, at the cost of one and a half products with the matrix. Options win. */
static PetscErrorCode set_smoothers(PC pc, Mat sweeps)
{
  const MatSORType sweep[2] = {SOR_LOCAL_FORWARD_SWEEP, SOR_LOCAL_BACKWARD_SWEEP};
  KSP              ksp[2];

  PetscFunctionBeginUser;
  PetscCall(PCMGGetSmootherDown(pc, 1, &ksp[0]));
  PetscCall(PCMGGetSmootherUp(pc, 1, &ksp[1]));
  for (int i = 0; i < 2; i++) {
    PC smoother;

    if (sweeps) PetscCall(KSPSetOperators(ksp[i], sweeps, sweeps));
    PetscCall(KSPSetType(ksp[i], KSPRICHARDSON));
    PetscCall(KSPSetTolerances(ksp[i], PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT, 1));
    PetscCall(KSPGetPC(ksp[i], &smoother));
    PetscCall(PCSetType(smoother, PCSOR));
    PetscCall(PCSORSetSymmetric(smoother, sweep[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureSetUpPC(Pressure p, KSP ksp)
{
  PC        pc;
  PetscBool mg;
  PetscInt  levels;

  PetscFunctionBeginUser;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCMG, &mg));
  if (!mg || !p->coarse) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PCMGGetLevels(pc, &levels));
  PetscCheck(levels == 2, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "-flow_fieldsplit_pressure_pc_mg_levels %" PetscInt_FMT
             ": the pressure has exactly 2 levels; more come from -flow_fieldsplit_pressure_mg_coarse_pc_type",
             levels);
  PetscCall(PCSetUseAmat(pc, PETSC_FALSE)); /* the matrix on both levels, not the operator with the bodies' part */
  PetscCall(CoarseSetUpPC(p->coarse, pc));
  if (!p->smoothers_set) PetscCall(set_smoothers(pc, p->sweeps));
  p->smoothers_set = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is the preconditioner that the options name the one of this module? */
static PetscErrorCode find_two_level(PetscBool *two_level)
{
  char type[64] = "";

  PetscFunctionBeginUser;
  PetscCall(PetscOptionsGetString(NULL, NULL, "-flow_fieldsplit_pressure_pc_type", type, sizeof(type), NULL));
  PetscCall(PetscStrcmp(type, "mg", two_level));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode PressureSetDefaults(void)
{
#define PREFIX    "-flow_fieldsplit_pressure_"
#define BOOMERAMG PREFIX "mg_coarse_pc_hypre_boomeramg_"
  PetscBool two_level;

  PetscFunctionBeginUser;
  PetscCall(OptDefault(PREFIX "pc_type", "mg"));
  PetscCall(find_two_level(&two_level));
  if (two_level) PetscCall(OptDefault(PREFIX "pc_mg_levels", "2")); /* GAMG chooses its levels, and later releases of PETSc refuse a number */
#if defined(PETSC_HAVE_HYPRE)
  PetscCall(OptDefault(PREFIX "mg_coarse_pc_type", "hypre"));
  PetscCall(OptDefault(BOOMERAMG "relax_type_coarse",
                       "symmetric-SOR/Jacobi")); /* elimination would divide by round-off where the pressure is known up to a constant */
  PetscCall(OptDefault(BOOMERAMG "coarsen_type", "PMIS"));
  PetscCall(OptDefault(BOOMERAMG "interp_type", "ext+i"));
  PetscCall(OptDefault(BOOMERAMG "P_max", "4"));
  PetscCall(OptDefault(BOOMERAMG "agg_nl", "1"));
  PetscCall(OptDefault(BOOMERAMG "no_CF", "1"));
  PetscCall(OptDefault(BOOMERAMG "relax_type_down", "l1-Gauss-Seidel"));
  PetscCall(OptDefault(BOOMERAMG "relax_type_up", "backward-l1-Gauss-Seidel"));
#else
  PetscCall(OptDefault(PREFIX "mg_coarse_pc_type", "gamg"));
#endif
  PetscFunctionReturn(PETSC_SUCCESS);
#undef PREFIX
#undef BOOMERAMG
}

PetscErrorCode PressureCreate(Flow flow, Constraint constraint, Pressure *pressure)
{
  Pressure  p;
  PetscInt  first, count;
  PetscBool two_level;
  PetscReal keep = 0.03;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&p));
  p->flow       = flow;
  p->constraint = constraint;
  PetscCall(FlowGetMesh(flow, &p->mesh));
  PetscCall(MeshGetLocal(p->mesh, &p->loc));
  PetscCall(ConstraintGetRigidSize(constraint, &p->nr));
  PetscCall(ConstraintGetOwnBodies(constraint, &first, &count));
  PetscCall(MPIU_Allreduce(&count, &p->nbodies, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD));
  p->nk  = p->loc->dim + 1;
  p->eps = 1e-6;
  PetscCall(OptReal("-flow_pressure_softness", &p->eps));
  PetscCall(PetscCalloc2(p->loc->nnode_all * p->loc->dim, &p->weight, p->nbodies * p->nr, &p->work));
  PetscCall(PetscCalloc3(p->loc->ncell, &p->stamp, p->loc->ncell, &p->touched, p->loc->ncell, &p->listed));
  PetscCall(PetscCalloc1(p->nbodies, &p->resolved));
  p->eps_shared = 1e-3;
  PetscCall(OptReal("-flow_pressure_shared", &p->eps_shared));
  PetscCall(find_two_level(&two_level));
  PetscCall(ConditionsPressureIsFloating(FlowConditions(flow), &p->floating));
  if (two_level) {
    PetscCall(OptReal("-flow_pressure_keep", &keep));
    PetscCall(CoarseCreate(p->mesh, p->nk, p->floating, keep, &p->coarse));
  }
  PetscCall(find_neighbours(p));
  PetscCall(create_matrix(p));
  PetscCall(create_shell(p));
  *pressure = p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureDestroy(Pressure *pressure)
{
  Pressure p = *pressure;

  PetscFunctionBeginUser;
  if (!p) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatDestroy(&p->matrix));
  PetscCall(MatDestroy(&p->shell));
  PetscCall(MatDestroy(&p->sweeps));
  PetscCall(PetscFree(p->overlap));
  PetscCall(MatNullSpaceDestroy(&p->constant));
  PetscCall(CoarseDestroy(&p->coarse));
  PetscCall(PetscFree(p->neighbour_ptr));
  PetscCall(PetscFree(p->neighbour));
  PetscCall(PetscFree2(p->weight, p->work));
  PetscCall(PetscFree(p->cut_cell));
  PetscCall(PetscFree(p->cut_body));
  PetscCall(PetscFree(p->cut_w));
  PetscCall(PetscFree3(p->stamp, p->touched, p->listed));
  PetscCall(PetscFree(p->resolved));
  PetscCall(PetscFree(p->changed));
  PetscCall(PetscFree(p->shared_cell));
  PetscCall(PetscFree(p->shared_block));
  PetscCall(PetscFree(*pressure));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal PressureGetSoftness(Pressure p, PetscInt k)
{
  return p->resolved[k] ? 0 : p->eps;
}

PetscErrorCode PressureForgetCells(Pressure p, PetscInt n, const PetscInt cells[])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim;
  const PetscReal *b;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(p->flow, &b));
  if (p->coarse) PetscCall(CoarseAddCells(p->coarse, -1, p->nsoft, p->shared_cell, p->shared_block));
  p->nsoft = 0; /* the list stays: rows of these cells are to be built anew */
  for (PetscInt e = 0; e < n * l->nb; e++) {
    const PetscInt i      = l->cell_node[cells[e / l->nb] * l->nb + e % l->nb];
    PetscReal     *weight = p->weight + i * dim, change[3];
    PetscBool      any    = PETSC_FALSE;

    if (weight[0] == UNKNOWN) continue;
    for (PetscInt a = 0; a < dim; a++) {
      any       = (PetscBool)(any || weight[a] != 0);
      change[a] = -weight[a];
      weight[a] = UNKNOWN;
    }
    if (any && i < l->nnode && p->coarse) PetscCall(CoarseAddNode(p->coarse, b, i, change));
  }
  if (p->nchanged + n > p->changed_room) {
    p->changed_room = 2 * (p->nchanged + n);
    PetscCall(PetscRealloc(p->changed_room * sizeof(PetscInt), &p->changed));
  }
  for (PetscInt e = 0; e < n; e++) p->changed[p->nchanged++] = cells[e];
  p->refresh = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureSetDead(Pressure p, const PetscInt cell_body[], const PetscBool resolved[])
{
  PetscFunctionBeginUser;
  p->cell_body = cell_body;
  PetscCall(PetscArraycpy(p->resolved, resolved, p->nbodies));
  if (p->floating) PetscCall(find_constant(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureUpdate(Pressure p, const PetscReal weight[], const PetscReal share[], const PetscReal mass_inverse[])
{
  PetscBool same, flags[2];
  PetscInt  nold = p->nshared, *old;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_PRES_BUILD, 0, 0, 0, 0));
  PetscCall(PetscMalloc1(nold, &old));
  PetscCall(PetscArraycpy(old, p->shared_cell, nold));
  if (p->refresh && p->coarse) PetscCall(CoarseUpdateCells(p->coarse, p->nchanged, p->changed, p->cell_body));
  p->refresh  = PETSC_FALSE;
  p->nchanged = 0;
  PetscCall(PetscArraycmp(p->weight, weight, p->loc->nnode_all * p->loc->dim, &same));
  flags[0] = (PetscBool)(!same || p->nshared);
  if (p->coarse) PetscCall(CoarseAddCells(p->coarse, -1, p->nsoft, p->shared_cell, p->shared_block));
  if (p->nbodies) {
    PetscCall(find_touched_cells(p));
    PetscCall(find_shared_cells(p));
  }
  if (p->coarse) PetscCall(CoarseAddCells(p->coarse, 1, p->nsoft, p->shared_cell, p->shared_block));
  flags[0] = (PetscBool)(flags[0] || p->nshared);
  flags[1] = (PetscBool)(p->nsoft > 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, flags, 2, COMPAT_MPI_BOOL, MPI_LOR, PETSC_COMM_WORLD));
  p->any_shared = flags[1];
  if (flags[0]) {
    PetscCall(update_matrix(p, weight, nold, old));
    if (p->coarse) PetscCall(update_coarse(p, weight));
    PetscCall(PetscArraycpy(p->weight, weight, p->loc->nnode_all * p->loc->dim));
  }
  PetscCall(PetscFree(old));
  PetscCall(MatSetNullSpace(p->shell, p->any_shared ? NULL : p->constant));          /* C sees constants */
  PetscCall(MatSetTransposeNullSpace(p->shell, p->any_shared ? NULL : p->constant)); /* makes every inner right-hand side consistent */
  if (p->nbodies) {
    PetscCall(find_cut_cells(p, share, mass_inverse));
    if (p->sweeps) PetscCall(BlockGSSetLowRank(p->sweeps, p->nbodies, p->ncut, p->cut_cell, p->cut_body, p->cut_w));
    if (p->coarse) PetscCall(CoarseSetBodies(p->coarse, p->nbodies, p->nr, p->ncut, p->cut_cell, p->cut_body, p->cut_w));
  }
  PetscCall(MatAssemblyBegin(p->shell, MAT_FINAL_ASSEMBLY)); /* its values have changed */
  PetscCall(MatAssemblyEnd(p->shell, MAT_FINAL_ASSEMBLY));
  PetscCall(PetscLogEventEnd(TB_PRES_BUILD, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureGetConstant(Pressure p, PetscReal a[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < p->loc->ncell * p->nk; i++) a[i] = i % p->nk == 0 && !(p->cell_body && p->cell_body[i / p->nk] >= 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureIsSingular(Pressure p, PetscBool *singular)
{
  PetscFunctionBeginUser;
  *singular = (PetscBool)(p->floating && !p->any_shared);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureGetMats(Pressure p, Mat *operator, Mat * matrix)
{
  PetscFunctionBeginUser;
  *operator= p->shell;
  *matrix = p->matrix;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureGetDiagonal(Pressure p, Vec d)
{
  PetscFunctionBeginUser;
  PetscCall(MatGetDiagonal(p->matrix, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}
