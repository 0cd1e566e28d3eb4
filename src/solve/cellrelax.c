/* CellRelax: see cellrelax.h. Every rank relaxes its own cells. A row of the matrix that belongs to a node of another
   rank is fetched from there unless it was gathered here, residuals are copied to ghost nodes, and corrections of ghost
   nodes go back to their owners: the result does not depend on the number of ranks. */
#include "compat.h"
#include "cellrelax.h"
#include "base/algebra.h"
#include "base/array.h"
#include "flow/device.h"
#include <petscblaslapack.h>

#define MAX_NB MESH_MAX_NB

/* What keeps T definite where no free velocity serves some pressure, as fraction of its size in a free cell */
#define REGULARISATION 1e-6
/* Diagonal entry of the stiffness in lumped masses over h^2, roughly: for that size only */
#define STIFF 20

struct _p_CellRelax {
  MPI_Comm         comm; /* of the mesh */
  Flow             flow;
  Constraint       constraint;
  Mesh             mesh;
  const MeshLocal *loc;
  const Rows      *rows; /* around the cells, during an update, or NULL: the matrix */
  Mat              S;
  PetscInt         nk, n, capacity, *cell; /* relaxed own cells, ascending */
  PetscReal        scale;
  PetscReal       *L;       /* [n][nb][nb], zero rows and columns at nodes that are not free */
  PetscReal       *T;       /* [n][nk][nk] inverse */
  PetscInt        *free;    /* [nnode_all] bits of the components that are free */
  PetscReal       *average; /* [nnode_all] 1 / number of relaxed cells at the node, 0 if there is none */
  PetscReal       *e, *v;   /* [nnode_all][dim] work; v is zero in between */
  PetscInt         nrelaxed_node, *relaxed_node; /* own nodes of relaxed cells, of any rank */
  PetscInt         total;                        /* relaxed cells on all ranks */
  PetscReal       *r, *p; /* [ncell][nk] rows of cells on their way to and from a device; NULL: none */
};

/* ---- which cells ---- */

static PetscBool is_cut(const MeshLocal *l, Pressure pressure, const PenaltyTerm *penalty, const PetscInt body[],
                        PetscInt cell)
{
  const PetscInt *node = l->cell_node + cell * l->nb, centre = node[l->nb / 2];
  PetscBool       inside = PETSC_FALSE, outside = PETSC_FALSE;

  if (penalty && body[centre] < 0 && penalty->weight[centre] > 0)
    return PETSC_TRUE; /* a centre node belongs to one cell */
  for (PetscInt j = 0; j < l->nb; j++) {
    if (body[node[j]] < 0) outside = PETSC_TRUE;
    else if (PetscAbsReal(PressureGetRegularisation(pressure, body[node[j]])) > 0) inside = PETSC_TRUE;
  }
  return (PetscBool)(!penalty && inside && outside);
}

static PetscErrorCode choose_cells(CellRelax c, Pressure pressure, const PenaltyTerm *penalty)
{
  const MeshLocal *l = c->loc;
  const PetscInt  *body;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  c->n = 0;
  for (PetscInt cell = 0; cell < l->ncell; cell++) {
    if (!is_cut(l, pressure, penalty, body, cell)) continue;
    PetscCall(ArrayReserve(c->n + 1, &c->capacity, &c->cell, sizeof(PetscInt), &c->L, l->nb * l->nb * sizeof(PetscReal),
                           &c->T, c->nk * c->nk * sizeof(PetscReal), NULL));
    c->cell[c->n++] = cell;
  }
  PetscCall(MPIU_Allreduce(&c->n, &c->total, 1, MPIU_INT, MPI_SUM, c->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Free components of the nodes and the share of a correction that they take */
static PetscErrorCode count_cells(CellRelax c)
{
  const MeshLocal     *l = c->loc;
  const PetscInt       n = l->nnode_all;
  const PetscInt      *body;
  const unsigned char *fixed;

  PetscFunctionBeginUser;
  if (!c->free)
    PetscCall(PetscCalloc5(n, &c->free, n, &c->average, n * l->dim, &c->e, n * l->dim, &c->v, n, &c->relaxed_node));
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  PetscCall(ConditionsGetValues(FlowConditions(c->flow), &fixed, NULL));
  PetscCall(PetscArrayzero(c->average, l->nnode_all));
  for (PetscInt i = 0; i < c->n * l->nb; i++) c->average[l->cell_node[c->cell[i / l->nb] * l->nb + i % l->nb]] += 1;
  PetscCall(MeshSumNodes(c->mesh, 1, c->average));
  PetscCall(MeshSyncNodes(c->mesh, 1, c->average));
  c->nrelaxed_node = 0;
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    c->free[i] = body[i] >= 0 ? 0 : ~fixed[i] & ((1 << l->dim) - 1);
    if (c->average[i] > 0 && i < l->nnode) c->relaxed_node[c->nrelaxed_node++] = i;
    if (c->average[i] > 0) c->average[i] = 1 / c->average[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- their blocks ---- */

/* Rows of S at the ghost nodes of relaxed cells, fetched from their owners */
typedef struct {
  PetscInt nrow, ncolumn, *row, *column; /* global nodes, ascending */
  Mat     *rows;                         /* one sequential matrix */
} Fetched;

static PetscErrorCode fetch_rows(CellRelax c, Fetched *f)
{
  const MeshLocal *l = c->loc;
  PetscMPIInt      size;
  IS               is[2];

  PetscFunctionBeginUser;
  f->rows = NULL;
  f->nrow = f->ncolumn = 0;
  f->row = f->column = NULL;
  PetscCallMPI(MPI_Comm_size(c->comm, &size));
  if (size == 1) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc2(c->n * l->nb, &f->row, c->n * l->nb, &f->column));
  for (PetscInt i = 0; i < c->n; i++) {
    const PetscInt *node = l->cell_node + c->cell[i] * l->nb, before = f->nrow;

    for (PetscInt j = 0; j < l->nb; j++)
      if (node[j] >= l->nnode && c->free[node[j]]) f->row[f->nrow++] = l->node_global[node[j]];
    for (PetscInt j = 0; j < l->nb && f->nrow > before; j++) f->column[f->ncolumn++] = l->node_global[node[j]];
  }
  PetscCall(PetscSortRemoveDupsInt(&f->nrow, f->row));
  PetscCall(PetscSortRemoveDupsInt(&f->ncolumn, f->column));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, f->nrow, f->row, PETSC_USE_POINTER, &is[0]));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, f->ncolumn, f->column, PETSC_USE_POINTER, &is[1]));
  PetscCall(MatCreateSubMatrices(c->S, 1, &is[0], &is[1], MAT_INITIAL_MATRIX, &f->rows));
  PetscCall(ISDestroy(&is[0]));
  PetscCall(ISDestroy(&is[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* out [n] at the columns column [n] (ascending) of a row with entries in ascending columns col, which name[col]
   translates (NULL: as they are) */
static void take_entries(PetscInt m, const PetscInt col[], const PetscReal value[], const PetscInt name[], PetscInt n,
                         const PetscInt column[], PetscReal out[])
{
  PetscInt q = 0;

  for (PetscInt j = 0; j < n; j++) {
    while (q < m && (name ? name[col[q]] : col[q]) < column[j]) q++;
    out[j] = q < m && (name ? name[col[q]] : col[q]) == column[j] ? value[q] : 0;
  }
}

/* One row of the block from gathered rows: all columns are there, as the nodes share a cell; c->e is scratch */
static void take_gathered(CellRelax c, PetscInt i, PetscInt n, const PetscInt node[], PetscReal out[])
{
  const Rows *r = c->rows;

  for (PetscInt q = r->start[i]; q < r->start[i + 1]; q++) c->e[r->column[q]] = r->value[q];
  for (PetscInt j = 0; j < n; j++) out[j] = c->e[node[j]];
}

/* The same from the matrix: entries of S in the row of local node i at the n global columns */
static PetscErrorCode take_row(CellRelax c, const Fetched *f, PetscInt i, PetscInt n, const PetscInt column[],
                               PetscReal out[])
{
  const MeshLocal *l     = c->loc;
  const PetscBool  ghost = (PetscBool)(i >= l->nnode);
  Mat              S     = ghost ? f->rows[0] : c->S;
  PetscInt         row   = l->node_global[i], m;
  const PetscInt  *col;
  const PetscReal *value;

  PetscFunctionBeginUser;
  if (ghost) PetscCall(PetscFindInt(l->node_global[i], f->nrow, f->row, &row));
  PetscCall(MatGetRow(S, row, &m, &col, &value));
  take_entries(m, col, value, ghost ? f->column : NULL, n, column, out);
  PetscCall(MatRestoreRow(S, row, &m, &col, &value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* a [n][n] <- its inverse; a singular one becomes zero */
static PetscErrorCode invert(PetscInt n, PetscReal a[])
{
  PetscBLASInt bn, info, pivot[MAX_NB], lwork = MAX_NB * MAX_NB;
  PetscReal    work[MAX_NB * MAX_NB];

  PetscFunctionBeginUser;
  if (n == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscBLASIntCast(n, &bn));
  PetscCallBLAS("LAPACKgetrf", LAPACKgetrf_(&bn, &bn, a, &bn, pivot, &info));
  if (!info) PetscCallBLAS("LAPACKgetri", LAPACKgetri_(&bn, a, &bn, pivot, work, &lwork, &info));
  if (info) PetscCall(PetscArrayzero(a, n * n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* L of relaxed cell i */
static PetscErrorCode invert_velocity(CellRelax c, const Fetched *f, PetscInt i)
{
  const MeshLocal *l    = c->loc;
  const PetscInt  *node = l->cell_node + c->cell[i] * l->nb;
  PetscReal        a[MAX_NB * MAX_NB], *L = c->L + i * l->nb * l->nb;
  PetscInt         n = 0, local[MAX_NB], column[MAX_NB], there[MAX_NB];

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < l->nb; j++) {
    if (!c->free[node[j]]) continue;
    local[n]    = j;
    column[n++] = l->node_global[node[j]];
  }
  PetscCall(PetscSortIntWithArray(n, column, local));
  for (PetscInt k = 0; k < n; k++) there[k] = node[local[k]];
  for (PetscInt k = 0; k < n; k++) {
    if (c->rows) take_gathered(c, there[k], n, there, a + k * n);
    else PetscCall(take_row(c, f, there[k], n, column, a + k * n));
  }
  PetscCall(invert(n, a)); /* the inverse of the transpose is the transpose of the inverse */
  PetscCall(PetscArrayzero(L, l->nb * l->nb));
  for (PetscInt k = 0; k < n * n; k++) L[local[k / n] * l->nb + local[k % n]] = a[k];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* b_a [nk][nb] of a cell without what is prescribed */
static void get_divergence(CellRelax c, const PetscReal *const b[], PetscInt cell, PetscInt a, PetscReal ba[])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, nb = l->nb, *node = l->cell_node + cell * nb;

  for (PetscInt k = 0; k < c->nk; k++)
    for (PetscInt j = 0; j < nb; j++)
      ba[k * nb + j] = (c->free[node[j]] >> a) & 1 ? b[cell][(k * nb + j) * dim + a] : 0;
}

/* T of relaxed cell i without C */
static PetscErrorCode project_cell(CellRelax c, PetscInt i)
{
  const MeshLocal *l  = c->loc;
  const PetscInt   nb = l->nb, nk = c->nk;
  PetscReal       *T = c->T + i * nk * nk, *L = c->L + i * nb * nb, ba[4 * MAX_NB], size = 0, stiff;
  const PetscReal *m, *h, *const *b;
  const FlowParameters *par;
  const FlowStep       *step;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(c->flow, &b));
  PetscCall(FlowGetInertialMass(c->flow, &m));
  PetscCall(FlowGetCellSize(c->flow, &h));
  PetscCall(FlowGetParameters(c->flow, &par));
  PetscCall(FlowGetStep(c->flow, &step));
  stiff = STIFF * par->matrix * step->theta / PetscSqr(h[c->cell[i]]);
  PetscCall(PetscArrayzero(T, nk * nk));
  for (PetscInt a = 0; a < l->dim; a++) {
    get_divergence(c, b, c->cell[i], a, ba);
    for (PetscInt k = 0; k < nk; k++) {
      for (PetscInt j = 0; j < nb; j++) {
        PetscReal s = 0;

        for (PetscInt q = 0; q < nb; q++) s += ba[k * nb + q] * L[q * nb + j];
        for (PetscInt n = 0; n < nk; n++) T[k * nk + n] += s * ba[n * nb + j];
      }
    }
    for (PetscInt k = 0; k < nk * nb; k++)
      size += PetscSqr(b[c->cell[i]][k * l->dim + a]) /
              ((c->scale + stiff) * m[l->cell_node[c->cell[i] * nb + k % nb]]);
  }
  for (PetscInt k = 0; k < nk; k++) T[k * (nk + 1)] += REGULARISATION * size / nk;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_shared(CellRelax c, Pressure pressure)
{
  const PetscInt  *cell, nn = c->nk * c->nk;
  const PetscReal *block;
  PetscInt         n, ncompressible;

  PetscFunctionBeginUser;
  PetscCall(PressureGetShared(pressure, &n, &ncompressible, &cell, &block));
  for (PetscInt s = 0; s < n; s++) {
    PetscInt i;

    PetscCall(PetscFindInt(cell[s], c->n, c->cell, &i));
    for (PetscInt e = 0; e < nn && i >= 0; e++) c->T[i * nn + e] += block[s * nn + e] / c->scale;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode CellRelaxMarkNodes(const MeshLocal *l, Constraint constraint, Pressure pressure,
                                  const PenaltyTerm *penalty, PetscBool marked[])
{
  const PetscInt *body;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(constraint, &body));
  for (PetscInt cell = 0; cell < l->ncell; cell++) {
    const PetscInt *node = l->cell_node + cell * l->nb;

    if (!is_cut(l, pressure, penalty, body, cell)) continue;
    for (PetscInt j = 0; j < l->nb; j++)
      if (body[node[j]] < 0) marked[node[j]] = PETSC_TRUE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CellRelaxUpdate(CellRelax c, const Rows *rows, Pressure pressure, const PenaltyTerm *penalty,
                               PetscReal scale)
{
  const PetscInt nn      = c->nk * c->nk;
  Fetched        fetched = {0};

  PetscFunctionBeginUser;
  c->scale = scale;
  c->rows  = rows;
  PetscCall(choose_cells(c, pressure, penalty));
  if (c->total == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(count_cells(c));
  if (!rows) {
    PetscCall(FlowGetMatrix(c->flow, &c->S));
    PetscCall(fetch_rows(c, &fetched));
  }
  for (PetscInt i = 0; i < c->n; i++) PetscCall(invert_velocity(c, &fetched, i));
  for (PetscInt i = 0; i < c->n; i++) PetscCall(project_cell(c, i));
  PetscCall(add_shared(c, pressure));
  for (PetscInt i = 0; i < c->n; i++) {
    PetscReal T[16];

    PetscCall(PetscArraycpy(T, c->T + i * nn, nn));
    DenseInvert(c->nk, T, c->T + i * nn);
  }
  if (fetched.rows) PetscCall(MatDestroySubMatrices(1, &fetched.rows));
  PetscCall(PetscFree2(fetched.row, fetched.column));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CellRelaxGetCount(CellRelax c, PetscInt *n)
{
  PetscFunctionBeginUser;
  *n = c->total;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = L x for all components: y, x [nb][dim] */
static void apply_inverse(PetscInt nb, PetscInt dim, const PetscReal L[], const PetscReal x[], PetscReal y[])
{
  for (PetscInt i = 0; i < nb; i++) {
    PetscReal s[3] = {0, 0, 0};

    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) s[a] += L[i * nb + j] * x[j * dim + a];
    for (PetscInt a = 0; a < dim; a++) y[i * dim + a] = s[a];
  }
}

/* Correction v [nb][dim] and q [nk] of relaxed cell i; b [nk][nb dim] is its divergence, r [nk] the residual of its
   continuity rows */
static void relax_cell(CellRelax c, PetscInt i, const PetscReal b[], const PetscReal r[], PetscReal v[], PetscReal q[])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, nb = l->nb, n = nb * dim, nk = c->nk, *node = l->cell_node + c->cell[i] * nb;
  const PetscReal *L = c->L + i * nb * nb, *T = c->T + i * nk * nk;
  PetscReal        x[MAX_NB * 3], w[MAX_NB * 3], d[4];
  PetscBool        free[MAX_NB * 3];

  for (PetscInt j = 0; j < n; j++) free[j] = (PetscBool)((c->free[node[j / dim]] >> (j % dim)) & 1);
  for (PetscInt j = 0; j < n; j++) x[j] = free[j] ? c->e[node[j / dim] * dim + j % dim] : 0;
  apply_inverse(nb, dim, L, x, v);
  for (PetscInt k = 0; k < nk; k++) {
    d[k] = r[k] / c->scale;
    for (PetscInt j = 0; j < n; j++)
      if (free[j]) d[k] -= b[k * n + j] * v[j];
  }
  for (PetscInt k = 0; k < nk; k++) {
    q[k] = 0;
    for (PetscInt m = 0; m < nk; m++) q[k] += T[k * nk + m] * d[m];
  }
  for (PetscInt j = 0; j < n; j++) {
    x[j] = 0;
    for (PetscInt k = 0; k < nk && free[j]; k++) x[j] += b[k * n + j] * q[k];
  }
  apply_inverse(nb, dim, L, x, w);
  for (PetscInt j = 0; j < n; j++) v[j] = free[j] ? v[j] + w[j] : 0;
}

/* c->v = sums of corrections at the nodes of relaxed cells; p += those of cells, for the residual in c->e */
static PetscErrorCode relax_cells(CellRelax c, const PetscReal r[], PetscReal p[])
{
  const MeshLocal        *l   = c->loc;
  const PetscInt          dim = l->dim, nb = l->nb, nk = c->nk;
  const PetscReal *const *b;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(c->flow, &b));
  PetscCall(MeshSyncNodes(c->mesh, dim, c->e));
  for (PetscInt i = 0; i < c->n; i++) {
    const PetscInt cell = c->cell[i], *node = l->cell_node + cell * nb;
    PetscReal      v[MESH_MAX_NB * 3], q[4];

    relax_cell(c, i, b[cell], r + cell * nk, v, q);
    for (PetscInt j = 0; j < nb * dim; j++) c->v[node[j / dim] * dim + j % dim] += v[j];
    for (PetscInt k = 0; k < nk; k++) p[cell * nk + k] += q[k];
  }
  PetscCall(MeshSumNodes(c->mesh, dim, c->v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Zeros in c->v again */
static PetscErrorCode clear_nodes(CellRelax c)
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->n * l->nb; i++)
    PetscCall(PetscArrayzero(c->v + l->cell_node[c->cell[i / l->nb] * l->nb + i % l->nb] * l->dim, l->dim));
  for (PetscInt i = 0; i < c->nrelaxed_node; i++) PetscCall(PetscArrayzero(c->v + c->relaxed_node[i] * l->dim, l->dim));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CellRelaxApply(CellRelax c, const PetscReal e[], const PetscReal r[], PetscReal u[], PetscReal p[])
{
  const PetscInt dim = c->loc->dim;

  PetscFunctionBeginUser;
  if (c->total == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArraycpy(c->e, e, c->loc->nnode * dim));
  PetscCall(relax_cells(c, r, p));
  for (PetscInt i = 0; i < c->nrelaxed_node; i++)
    for (PetscInt a = 0; a < dim; a++)
      u[c->relaxed_node[i] * dim + a] += c->average[c->relaxed_node[i]] * c->v[c->relaxed_node[i] * dim + a];
  PetscCall(clear_nodes(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CellRelaxApplyOnDevice(CellRelax c, const PetscReal e[], const PetscReal r[], PetscReal u[],
                                      PetscReal p[])
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  if (c->total == 0) PetscFunctionReturn(PETSC_SUCCESS);
  if (!c->r) PetscCall(PetscMalloc2(l->ncell * c->nk, &c->r, l->ncell * c->nk, &c->p));
  PetscCall(FlowFetchRows(c->flow, c->nrelaxed_node, l->dim, c->relaxed_node, e, c->e));
  PetscCall(FlowFetchRows(c->flow, c->n, c->nk, c->cell, r, c->r));
  for (PetscInt i = 0; i < c->n; i++) PetscCall(PetscArrayzero(c->p + c->cell[i] * c->nk, c->nk));
  PetscCall(relax_cells(c, c->r, c->p));
  for (PetscInt i = 0; i < c->nrelaxed_node; i++)
    for (PetscInt a = 0; a < l->dim; a++) c->v[c->relaxed_node[i] * l->dim + a] *= c->average[c->relaxed_node[i]];
  PetscCall(FlowAddRows(c->flow, c->nrelaxed_node, l->dim, c->relaxed_node, c->v, u));
  PetscCall(FlowAddRows(c->flow, c->n, c->nk, c->cell, c->p, p));
  PetscCall(clear_nodes(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CellRelaxCreate(Flow flow, Constraint constraint, CellRelax *relax)
{
  CellRelax c;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  c->flow       = flow;
  c->constraint = constraint;
  PetscCall(FlowGetMesh(flow, &c->mesh));
  PetscCall(MeshGetLocal(c->mesh, &c->loc));
  PetscCall(MeshGetComm(c->mesh, &c->comm));
  c->nk  = c->loc->dim + 1;
  *relax = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CellRelaxDestroy(CellRelax *relax)
{
  CellRelax c = *relax;

  PetscFunctionBeginUser;
  if (!c) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree5(c->free, c->average, c->e, c->v, c->relaxed_node));
  PetscCall(PetscFree2(c->r, c->p));
  PetscCall(PetscFree(c->cell));
  PetscCall(PetscFree(c->L));
  PetscCall(PetscFree(c->T));
  PetscCall(PetscFree(*relax));
  PetscFunctionReturn(PETSC_SUCCESS);
}
