/* Pressure: the nodes' part of S_p as a matrix, and its smoother (see pressure.h). All entries of a row belong to cells
   that share a node with the row's cell, and ghost cells are known, so every rank builds its rows alone. */
#include "compat.h"
#include "pressureimpl.h"
#include "blockgs.h"
#include "base/inline.h"
#include "base/array.h"

#define MAX_CELLS 32 /* other ranks at a node */

typedef double wide __attribute__((vector_size(32), aligned(8)));

/* Neighbours of every cell: own ones before it, it, own ones behind it, those of other ranks; each in the order of the
   first node that they share, and of its place in them, which is the same for cells that lie alike */
static PetscErrorCode find_neighbours(Pressure p)
{
  const MeshLocal *l = p->loc;
  PetscInt         n = 0, capacity = 10 * l->ncell + 64, key_capacity = 0, *key = NULL, longest = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->ncell + 1, &p->nodes.neighbour_ptr));
  PetscCall(PetscMalloc1(capacity, &p->nodes.neighbour));
  for (PetscInt c = 0; c < l->ncell_all; c++) p->nodes.where[c] = -1;
  p->nodes.neighbour_ptr[0] = 0;
  for (PetscInt c = 0; c < l->ncell; c++) {
    const PetscInt begin = n, group = l->nb * l->nb;

    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt i = l->cell_node[c * l->nb + j];

      for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
        const PetscInt c2 = l->node_cell[q];

        if (p->nodes.where[c2] == c) continue; /* listed already */
        p->nodes.where[c2] = c;
        if (n == capacity)
          PetscCall(ArrayReserve(n + 1, &capacity, &p->nodes.neighbour, sizeof(*p->nodes.neighbour), NULL));
        if (n - begin == key_capacity) PetscCall(ArrayReserve(n + 1 - begin, &key_capacity, &key, sizeof(*key), NULL));
        key[n - begin]          = c2 == c ? group
                                          : j * l->nb + p->nodes.slot[q] +
                                     (c2 < c          ? 0
                                               : c2 < l->ncell ? group + 1
                                                               : 2 * group + 1);
        p->nodes.neighbour[n++] = c2;
      }
    }
    PetscCall(PetscSortIntWithArray(n - begin, key, p->nodes.neighbour + begin));
    p->nodes.neighbour_ptr[c + 1] = n;
    longest                       = PetscMax(longest, n - begin);
  }
  PetscCall(PetscFree(key));
  PetscCall(ArrayTrim(n, &capacity, &p->nodes.neighbour, sizeof(*p->nodes.neighbour), NULL));
  PetscCall(PetscMalloc1(longest * p->nk * p->nk, &p->nodes.row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* For preconditioners that know nothing else: blocks in own and in other ranks' columns, for every own cell */
static PetscErrorCode create_aij(Pressure p)
{
  const MeshLocal *l = p->loc;
  PetscInt        *own, *other;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(l->ncell, &own, l->ncell, &other));
  for (PetscInt c = 0; c < l->ncell; c++)
    for (PetscInt q = p->nodes.neighbour_ptr[c]; q < p->nodes.neighbour_ptr[c + 1]; q++)
      *(p->nodes.neighbour[q] < l->ncell ? &own[c] : &other[c]) += 1;
  PetscCall(MatCreate(p->comm, &p->nodes.matrix));
  PetscCall(MatSetSizes(p->nodes.matrix, l->ncell * p->nk, l->ncell * p->nk, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetBlockSize(p->nodes.matrix, p->nk));
  PetscCall(MatSetType(p->nodes.matrix, MATAIJ));
  PetscCall(MatXAIJSetPreallocation(p->nodes.matrix, p->nk, own, other, NULL, NULL));
  PetscCall(MatSetOption(p->nodes.matrix, MAT_NO_OFF_PROC_ENTRIES, PETSC_TRUE));
  PetscCall(MatSetOption(p->nodes.matrix, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(p->nodes.matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscCall(PetscFree2(own, other));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* For the default preconditioner: blocks with sweeps */
static PetscErrorCode create_blocks(Pressure p)
{
  const MeshLocal *l = p->loc;
  PetscMPIInt      size;

  PetscFunctionBeginUser;
  PetscCall(BlockGSCreate(p->comm,
                          &(BlockPattern){.nk     = p->nk,
                                          .n      = l->ncell,
                                          .start  = p->nodes.neighbour_ptr,
                                          .column = p->nodes.neighbour,
                                          .nghost = l->ncell_all - l->ncell,
                                          .ghost  = l->cell_global + l->ncell},
                          (PetscBool)(!p->single || p->nbodies > 0), &p->nodes.matrix));
  PetscCall(DeviceVecSetShell(FlowGetQueue(p->flow), p->nodes.matrix));
  PetscCallMPI(MPI_Comm_size(p->comm, &size));
  if (size > 1) PetscCall(PetscCalloc1(l->ncell * p->nk * p->nk, &p->nodes.overlap));
  PetscCall(BlockGSSetExtra(p->nodes.matrix, p->nodes.overlap));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where each node stands in the cells around it, which rows ask for again and again; nodes list their cells in order */
static PetscErrorCode find_slots(Pressure p)
{
  const MeshLocal *l = p->loc;
  PetscInt        *next;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(l->ncell_all, &p->nodes.where, l->node_cell_ptr[l->nnode_all], &p->nodes.slot));
  PetscCall(PetscMalloc1(l->nnode_all, &next));
  PetscCall(PetscArraycpy(next, l->node_cell_ptr, l->nnode_all));
  for (PetscInt e = 0; e < l->ncell_all * l->nb; e++)
    p->nodes.slot[next[l->cell_node[e]]++] = (unsigned char)(e % l->nb);
  PetscCall(PetscFree(next));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureCreateMatrix(Pressure p)
{
  char      type[64];
  PetscBool set;

  PetscFunctionBeginUser;
  PetscCall(PetscOptionsGetString(NULL, NULL, "-flow_fieldsplit_pressure_mg_levels_pc_type", type, sizeof(type), &set));
  p->nodes.block_gs = (PetscBool)(p->coarse != NULL);
  if (set && p->coarse) PetscCall(PetscStrcmp(type, "sor", &p->nodes.block_gs));
  PetscCall(find_slots(p));
  PetscCall(find_neighbours(p));
  if (p->nodes.block_gs) PetscCall(create_blocks(p));
  else PetscCall(create_aij(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* to [nk][nk] += wb^T b2, column by column; b2 [nk][n]. In space a column is a vector. */
INLINE void add_block(const int dim, const PetscReal wb[3][4], const PetscReal *restrict b2, PetscReal *restrict to)
{
  const int nk = dim + 1, n = dim == 2 ? 9 * dim : 27 * dim;

  for (int m = 0; m < nk; m++) {
    if (dim == 3) {
      wide sum = *(const wide *)(to + m * 4);

      for (int a = 0; a < 3; a++) sum += *(const wide *)wb[a] * b2[m * n + a];
      *(wide *)(to + m * 4) = sum;
      continue;
    }
    for (int a = 0; a < dim; a++)
      for (int k = 0; k < nk; k++) to[m * nk + k] += wb[a][k] * b2[m * n + a];
  }
}

/* row [blocks of the row][nk][nk], each block column by column: sum over shared nodes of B_c weight B_c2^T */
INLINE void compute_row_in(const int dim, Pressure p, const PetscReal *const b[], const PetscReal weight[], PetscInt c,
                           PetscReal *restrict row)
{
  const MeshLocal *l  = p->loc;
  const int        nb = dim == 2 ? 9 : 27, n = nb * dim, nk = dim + 1;
  const PetscInt   nn       = p->nodes.neighbour_ptr[c + 1] - p->nodes.neighbour_ptr[c],
                 *neighbour = p->nodes.neighbour + p->nodes.neighbour_ptr[c];

  for (PetscInt e = 0; e < nn * nk * nk; e++) row[e] = 0;
  for (PetscInt q = 0; q < nn; q++) p->nodes.where[neighbour[q]] = q;
  for (int j = 0; j < nb; j++) {
    const PetscInt   i = l->cell_node[c * nb + j];
    const PetscReal *w = weight + i * dim;
    PetscReal        wb[3][4];

    for (int a = 0; a < dim; a++)
      for (int k = 0; k < nk; k++) wb[a][k] = w[a] * b[c][k * n + j * dim + a];
    for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
      const PetscInt c2 = l->node_cell[q];

      add_block(dim, wb, b[c2] + p->nodes.slot[q] * dim, row + p->nodes.where[c2] * nk * nk);
    }
  }
}

static void compute_row(Pressure p, const PetscReal *const b[], const PetscReal weight[], PetscInt c, PetscReal row[])
{
  if (p->loc->dim == 2) compute_row_in(2, p, b, weight, c, row);
  else compute_row_in(3, p, b, weight, c, row);
}

/* Entries become multiples of 1e-11 of the largest: sums of the same numbers in another order are equal then, and with
   them the rows of cells that lie alike */
static void round_row(PetscInt n, PetscReal row[])
{
  int64_t   max = 0; /* sizes are in the order of their bits, which vectors compare several at a time */
  PetscReal size, large;
  int       exponent;

  for (PetscInt e = 0; e < n; e++) {
    int64_t bits;

    memcpy(&bits, row + e, sizeof(bits));
    bits &= INT64_MAX;
    max = bits > max ? bits : max;
  }
  memcpy(&size, &max, sizeof(size));
  (void)frexp(size, &exponent);
  large = ldexp(1.5, exponent - 37 + 52); /* its last bit is worth 2^-37 of the largest entry, or up to twice that */
  for (PetscInt e = 0; e < n; e++) row[e] = row[e] + large - large;
}

/* Add the blocks of shared cell c (those of compressible and of inactive cells, both ascending), which are symmetric */
static PetscErrorCode add_shared(Pressure p, PetscInt c, PetscReal row[])
{
  const PetscInt *neighbour = p->nodes.neighbour + p->nodes.neighbour_ptr[c], nn = p->nk * p->nk,
                 first[3] = {0, p->gap.ncompressible, p->gap.n};
  PetscInt at             = 0;

  PetscFunctionBeginUser;
  while (neighbour[at] != c) at++;
  for (PetscInt s = 0; s < 2; s++) {
    PetscInt i;

    PetscCall(PetscFindInt(c, first[s + 1] - first[s], p->gap.cell + first[s], &i));
    for (PetscInt e = 0; e < nn && i >= 0; e++) row[at * nn + e] += p->gap.block[(first[s] + i) * nn + e];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The row among PETSc's, whose blocks stand side by side */
static PetscErrorCode insert_row(Pressure p, PetscInt c, const PetscReal row[])
{
  const PetscInt nk = p->nk, nn = p->nodes.neighbour_ptr[c + 1] - p->nodes.neighbour_ptr[c],
                 at = p->loc->cell_start + c;
  PetscInt  *column;
  PetscReal *value;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(nn, &column, nn * nk * nk, &value));
  for (PetscInt q = 0; q < nn; q++) column[q] = p->loc->cell_global[p->nodes.neighbour[p->nodes.neighbour_ptr[c] + q]];
  for (PetscInt e = 0; e < nn * nk * nk; e++) value[(e % nk * nn + e / (nk * nk)) * nk + e / nk % nk] = row[e];
  PetscCall(MatSetValuesBlocked(p->nodes.matrix, 1, &at, nn, column, value, INSERT_VALUES));
  PetscCall(PetscFree2(column, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void list_cell(Pressure p, PetscInt c)
{
  if (c >= p->loc->ncell || p->list.stamp[c] == p->list.stamp_now) return;
  p->list.stamp[c]          = p->list.stamp_now;
  p->list.cell[p->list.n++] = c;
}

void PressureListCellsOfNode(Pressure p, PetscInt i)
{
  for (PetscInt q = p->loc->node_cell_ptr[i]; q < p->loc->node_cell_ptr[i + 1]; q++) list_cell(p, p->loc->node_cell[q]);
}

void PressureStartList(Pressure p)
{
  p->list.stamp_now++;
  p->list.n = 0;
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
static PetscErrorCode set_overlap(Pressure p, const PetscInt ranges[], const PetscReal *const b[],
                                  const PetscReal weight[], PetscInt c)
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, n = l->nb * dim, nk = p->nk;
  PetscReal       *block = p->nodes.overlap + c * nk * nk;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(block, nk * nk));
  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscInt  i      = l->cell_node[c * l->nb + j];
    const PetscReal excess = count_excess(p, ranges, i);

    for (PetscInt e = 0; e < nk * nk && excess > 0; e++)
      for (PetscInt a = 0; a < dim; a++)
        block[e] += 0.5 * excess * weight[i * dim + a] * b[c][e / nk * n + j * dim + a] *
                    b[c][e % nk * n + j * dim + a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_rows(Pressure p, const PetscReal *const b[], const PetscReal weight[])
{
  const PetscBool many = (PetscBool)(2 * p->list.n > p->loc->ncell);
  const PetscInt *ranges;
  PetscReal      *row = p->nodes.row;

  PetscFunctionBeginUser;
  PetscCall(MatGetOwnershipRanges(p->nodes.matrix, &ranges));
  if (p->nodes.block_gs && p->list.n == p->loc->ncell) PetscCall(BlockGSClear(p->nodes.matrix));
  for (PetscInt i = 0; i < p->list.n; i++) {
    compute_row(p, b, weight, p->list.cell[i], row);
    PetscCall(add_shared(p, p->list.cell[i], row));
    if (p->nodes.overlap) PetscCall(set_overlap(p, ranges, b, weight, p->list.cell[i]));
    if (p->nodes.block_gs) {
      round_row((p->nodes.neighbour_ptr[p->list.cell[i] + 1] - p->nodes.neighbour_ptr[p->list.cell[i]]) * p->nk * p->nk,
                row);
      PetscCall(BlockGSSetRow(p->nodes.matrix, p->list.cell[i], row, many));
    } else PetscCall(insert_row(p, p->list.cell[i], row));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureUpdateMatrix(Pressure p, const PetscReal weight[], PetscInt n, const PetscInt changed[])
{
  const MeshLocal        *l     = p->loc;
  const PetscInt          dim   = l->dim;
  const PetscBool         there = PressureMakesRowsOnDevice(p);
  const PetscReal *const *b;
  PetscInt               *node, nnode = 0; /* whose weights are others, where rows are made there */

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(p->flow, &b));
  PetscCall(PetscMalloc1(there ? l->nnode_all : 0, &node));
  PressureStartList(p);
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    PetscBool other = PETSC_FALSE;

    for (PetscInt a = 0; a < dim; a++) other = (PetscBool)(other || weight[i * dim + a] != p->weight[i * dim + a]);
    if (other) PressureListCellsOfNode(p, i);
    if (other && there) node[nnode++] = i;
  }
  for (PetscInt i = 0; i < n; i++) list_cell(p, changed[i]);
  if (there) PetscCall(PressureMakeRowsOnDevice(p, weight, nnode, node));
  else PetscCall(set_rows(p, b, weight));
  PetscCall(PetscFree(node));
  if (p->list.n) p->device_stale = PETSC_TRUE;
  p->device_changed += (PetscReal)p->list.n;
  PetscCall(MatAssemblyBegin(p->nodes.matrix, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(p->nodes.matrix, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}
