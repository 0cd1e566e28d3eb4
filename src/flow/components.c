/* Flow, matrix A of all components (flow.h): S for every component, with what couples components. Rows and columns are
   numbered by node, then component; every row of a node has the pattern of its row in S for each component. Values go
   straight to their positions, found from those of S: rows of own nodes from own and ghost cells, no communication. */
#include "compat.h"
#include "impl.h"
#include "base/array.h"
#include "base/rows.h"

static PetscErrorCode create_matrix(Flow f)
{
  const PetscInt dim = f->loc->dim, n = f->loc->nnode;
  PetscInt      *row, *column = NULL, begin, length = 0;
  MatInfo        info;

  PetscFunctionBeginUser;
  PetscCall(MatGetInfo(f->matrix.S, MAT_LOCAL, &info));
  PetscCall(ArrayCheckSize(f->comm, "a matrix of all components", info.nz_used * (PetscReal)(dim * dim)));
  PetscCall(MatGetOwnershipRange(f->matrix.S, &begin, NULL));
  PetscCall(PetscMalloc1(n * dim + 1, &row));
  row[0] = 0;
  for (PetscInt pass = 0; pass < 2; pass++) {
    length = 0;
    for (PetscInt i = 0; i < n; i++) {
      const PetscInt *col;
      PetscInt        m;

      PetscCall(MatGetRow(f->matrix.S, begin + i, &m, &col, NULL));
      for (PetscInt a = 0; a < dim; a++) {
        for (PetscInt j = 0; j < m * dim && pass; j++) column[length + j] = col[j / dim] * dim + j % dim;
        length += m * dim;
        row[i * dim + a + 1] = length;
      }
      PetscCall(MatRestoreRow(f->matrix.S, begin + i, &m, &col, NULL));
    }
    if (!pass) PetscCall(PetscMalloc1(length, &column));
  }
  PetscCall(MatCreate(f->comm, &f->matrix.A));
  PetscCall(MatSetSizes(f->matrix.A, n * dim, n * dim, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetType(f->matrix.A, MATAIJ));
  PetscCall(MatSeqAIJSetPreallocationCSR(f->matrix.A, row, column, NULL));
  PetscCall(MatMPIAIJSetPreallocationCSR(f->matrix.A, row, column, NULL));
  PetscCall(PetscFree(row));
  PetscCall(PetscFree(column));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A block, of own or of other columns, of S and A: rows of S, values of A */
typedef struct {
  Rows       S;
  Mat        A;
  PetscReal *a;
} MatrixBlock;

static PetscErrorCode open_block(Mat S, Mat A, MatrixBlock *p)
{
  PetscFunctionBeginUser;
  p->A = A;
  PetscCall(RowsOpen(S, &p->S));
  PetscCall(MatSeqAIJGetArray(A, &p->a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode close_block(MatrixBlock *p)
{
  PetscFunctionBeginUser;
  PetscCall(MatSeqAIJRestoreArray(p->A, &p->a));
  PetscCall(RowsClose(&p->S));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The values in A that belong to entry `at` in row i of S: component b of row a is [a * stride + b] */
static inline PetscReal *block_values(const MatrixBlock *p, PetscInt dim, PetscInt i, PetscInt at, PetscInt *stride)
{
  *stride = dim * (p->S.start[i + 1] - p->S.start[i]);
  return p->a + dim * dim * p->S.start[i] + dim * (at - p->S.start[i]);
}

static void copy_components(const MatrixBlock *p, PetscInt dim)
{
  for (PetscInt i = 0; i < p->S.n; i++)
    for (PetscInt at = p->S.start[i]; at < p->S.start[i + 1]; at++) {
      PetscInt   stride;
      PetscReal *v = block_values(p, dim, i, at, &stride);

      for (PetscInt a = 0; a < dim; a++)
        for (PetscInt b = 0; b < dim; b++) v[a * stride + b] = a == b ? p->S.value[at] : 0;
    }
}

/* block += matrix n [nb*dim][nb*dim] of cell c */
static void add_cell(const struct _p_Flow *f, PetscInt c, const PetscReal n[], const MatrixBlock block[2])
{
  const PetscInt nb = f->loc->nb, dim = f->loc->dim, *node = f->loc->cell_node + c * nb;

  for (PetscInt i = 0; i < nb; i++)
    for (PetscInt j = 0; j < nb; j++) {
      PetscBool      other;
      const PetscInt at = FlowEntry(f, f->matrix.wide, c, i, j, &other);
      PetscInt       stride;
      PetscReal     *v;

      if (at < 0) continue;
      v = block_values(&block[other], dim, node[i], block[other].S.start[node[i]] + at, &stride);
      for (PetscInt a = 0; a < dim; a++)
        for (PetscInt b = 0; b < dim; b++) v[a * stride + b] += n[(i * dim + a) * nb * dim + j * dim + b];
    }
}

/* n += rho theta int phi_i (phi_j du_a/dx_b + skew u_a dphi_j/dx_b) */
static void add_convective(const struct _p_Flow *f, PetscInt c, const ElementMetric *m, const PetscReal ul[],
                           PetscReal n[])
{
  const PetscInt dim = f->loc->dim, nb = f->loc->nb, rows = nb * dim;

  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal *phi  = f->element.phi + q * f->element.nbp,
                    scale = FlowDensity(f, c) * f->step.theta * m->weight[q];
    PetscReal g[3][ELEMENT_MAX_NBP], grad[3][3] = {{0}}, v[3] = {0, 0, 0}, row[MESH_MAX_NB * 3];

    ElementGradients(&f->element, m, q, g);
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) v[a] += phi[j] * ul[j * dim + a];
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++)
        for (PetscInt b = 0; b < dim; b++) grad[a][b] += scale * g[b][j] * ul[j * dim + a];
    for (PetscInt a = 0; a < dim; a++) {
      for (PetscInt j = 0; j < rows; j++)
        row[j] = phi[j / dim] * grad[a][j % dim] + f->par.skew * scale * g[j % dim][j / dim] * v[a];
      for (PetscInt i = 0; i < nb; i++)
        for (PetscInt j = 0; j < rows; j++) n[(i * dim + a) * rows + j] += phi[i] * row[j];
    }
  }
}

PetscErrorCode FlowCellNewton(Flow f, PetscInt c, const PetscReal u[], PetscReal n[])
{
  const PetscInt rows = f->loc->nb * f->loc->dim;
  PetscReal      ul[MESH_MAX_NB * 3];
  ElementMetric  m;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(n, rows * rows));
  if (u) MeshCellValues(f->loc, c, f->loc->dim, u, ul);
  PetscCall(FlowCellMetric(f, c, &m));
  if (u && f->par.convection) add_convective(f, c, &m, ul, n);
  if (f->material && f->material->tangent) (*f->material->tangent)(f, c, &m, u ? ul : NULL, n);
  MeshCellMatrix(f->loc, c, f->loc->dim, rows, n);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAssembleComponents(Flow f, const PetscReal u[], Mat *A)
{
  MatrixBlock     block[2] = {{.A = NULL}, {.A = NULL}};
  Mat             S, s[2], a[2];
  const PetscInt *unused;
  PetscReal      *n;

  PetscFunctionBeginUser;
  PetscCall(FlowGetMatrix(f, &S));
  if (!f->matrix.A) PetscCall(create_matrix(f));
  *A = f->matrix.A;
  PetscCall(FlowGetMatrixBlocks(f, s, &unused));
  a[0] = f->matrix.A;
  a[1] = NULL;
  if (s[1]) PetscCall(MatMPIAIJGetSeqAIJ(f->matrix.A, &a[0], &a[1], NULL));
  for (PetscInt k = 0; k < 2 && s[k]; k++) {
    PetscCall(open_block(s[k], a[k], &block[k]));
    copy_components(&block[k], f->loc->dim);
  }
  PetscCall(PetscMalloc1(PetscSqr(f->loc->nb * f->loc->dim), &n));
  for (PetscInt c = 0; c < f->loc->ncell_all; c++) {
    PetscCall(FlowCellNewton(f, c, u, n));
    add_cell(f, c, n, block);
  }
  PetscCall(PetscFree(n));
  for (PetscInt k = 0; k < 2 && s[k]; k++) PetscCall(close_block(&block[k]));
  PetscCall(MatAssemblyBegin(f->matrix.A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(f->matrix.A, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetComponents(Flow f, Mat *A)
{
  PetscFunctionBeginUser;
  *A = FlowVaries(f) ? f->matrix.A : NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}
