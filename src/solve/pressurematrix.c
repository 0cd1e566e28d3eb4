/* Pressure: the nodes' part of S_p as a matrix, and its smoother (see pressure.h). All entries of a row belong to cells
   that share a node with the row's cell, and ghost cells are known, so every rank builds its rows alone. */
#include "compat.h"
#include "pressureimpl.h"
#include "blockgs.h"

#define MAX_CELLS 32 /* other ranks at a node */

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

/* Blocks of nk x nk: BAIJ for the default preconditioner (block SOR, less memory traffic), AIJ for those that know
   nothing else */
PetscErrorCode PressureCreateMatrix(Pressure p)
{
  const PetscInt n = p->loc->ncell;
  PetscInt      *own, *other;

  PetscFunctionBeginUser;
  PetscCall(find_neighbours(p));
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
static PetscErrorCode set_row(Pressure p, const PetscReal *const b[], const PetscReal weight[], PetscInt c)
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
      for (PetscInt a = 0; a < dim; a++) wb[k][a] = weight[i * dim + a] * b[c][k * n + j * dim + a];
    for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
      const PetscInt c2 = l->node_cell[q];
      PetscInt       j2 = 0, at = 0;

      while (l->cell_node[c2 * nb + j2] != i) j2++;
      while (neighbour[at] != c2) at++;
      for (PetscInt k = 0; k < nk; k++)
        for (PetscInt m = 0; m < nk; m++)
          for (PetscInt a = 0; a < dim; a++) out[(k * nn + at) * nk + m] += wb[k][a] * b[c2][m * n + j2 * dim + a];
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

void PressureListCellsOfNode(Pressure p, PetscInt i)
{
  for (PetscInt q = p->loc->node_cell_ptr[i]; q < p->loc->node_cell_ptr[i + 1]; q++) list_cell(p, p->loc->node_cell[q]);
}

void PressureStartList(Pressure p)
{
  p->stamp_now++;
  p->nlisted = 0;
}

/* (ranks other than this one with cells at node i) times (own cells at it) less one, at least zero; ranges: first rows
   of the ranks */
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

/* What the sweeps add to the diagonal block of cell c, because the ranks sweep at the same time. With g_a what cell a
   sees of a component of node i, and s_r the sum of g_a.p_a over the cells of rank r around it, the node's part of S is
   w (sum_r s_r)^2, and the couplings between R ranks at most (R - 1) w sum_r s_r^2 <= (R - 1) w sum_r n_r sum_a
   (g_a.p_a)^2; the diagonal has w (g_a.p_a)^2 of that, and half of the rest is to be added for a sweep there and back
   to be definite. Only nodes of more than two cells have any. Without it a sweep may be indefinite on several ranks
   (runs/studies/flow-solver, "Many bodies"). */
static PetscErrorCode set_overlap(Pressure p, const PetscInt ranges[], const PetscReal *const b[], const PetscReal weight[], PetscInt c)
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
        block[e] += 0.5 * excess * weight[i * dim + a] * b[c][e / nk * n + j * dim + a] * b[c][e % nk * n + j * dim + a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The single-precision copy of the listed rows; the first call creates it (the matrix has its pattern then). */
static PetscErrorCode update_sweeps(Pressure p, const PetscReal *const b[], const PetscReal weight[])
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
    PressureStartList(p);
    for (PetscInt c = 0; c < p->loc->ncell; c++) list_cell(p, c);
  }
  if (p->overlap) {
    PetscCall(MatGetOwnershipRanges(p->matrix, &ranges));
    for (PetscInt i = 0; i < p->nlisted; i++) PetscCall(set_overlap(p, ranges, b, weight, p->listed[i]));
  }
  PetscCall(BlockGSUpdate(p->sweeps, p->nlisted, p->listed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureUpdateMatrix(Pressure p, const PetscReal weight[], PetscInt nold, const PetscInt old[])
{
  const MeshLocal        *l   = p->loc;
  const PetscInt          dim = l->dim;
  const PetscReal *const *b;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(p->flow, &b));
  PressureStartList(p);
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    PetscBool changed = PETSC_FALSE;

    for (PetscInt a = 0; a < dim; a++) changed = (PetscBool)(changed || weight[i * dim + a] != p->weight[i * dim + a]);
    if (changed) PressureListCellsOfNode(p, i);
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
