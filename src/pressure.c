/* Pressure: see pressure.h. All entries of a row belong to cells that share a node with the row's cell, and ghost cells are known, so every rank builds its rows alone. */
#include "compat.h"
#include "pressure.h"
#include "log.h"
#include "opt.h"

struct _p_Pressure {
  Flow             flow;
  Constraint       constraint;
  const MeshLocal *loc;
  Mesh             mesh;
  PetscInt         nk, nr, nbodies; /* pressures a cell; rigid slots a body */
  PetscReal        eps;
  Mat              matrix, shell, interpolation;
  PetscInt        *neighbour_ptr, *neighbour; /* [ncell + 1]; local cells that share a node with a cell, ascending global index */
  PetscReal       *coo;                       /* [neighbours][nk][nk] */
  PetscReal       *weight;                    /* as of the last update */
  PetscBool        built;
  /* bodies: cells where B R_k is not zero */
  PetscInt   ncut, room, *cut_cell, *cut_body;
  PetscReal *cut_q; /* [ncut][nk][nr] */
  PetscReal *mass_inverse, *work;
};

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

/* Preallocation by coordinates makes the diagonal part of a parallel matrix without a block size, but point-block Jacobi asks the part for it. */
static PetscErrorCode set_part_block_size(Mat mat, PetscInt bs)
{
  PetscBool parallel;
  Mat       diagonal;

  PetscFunctionBeginUser;
  PetscCall(PetscObjectTypeCompare((PetscObject)mat, MATMPIAIJ, &parallel));
  if (!parallel) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatMPIAIJGetSeqAIJ(mat, &diagonal, NULL, NULL));
  PetscCall(MatSetBlockSizes(diagonal, bs, bs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_matrix(Pressure p)
{
  const MeshLocal *l  = p->loc;
  const PetscInt   nk = p->nk;
  const PetscCount n  = (PetscCount)p->neighbour_ptr[l->ncell] * nk * nk;
  PetscInt        *row, *col;
  PetscBool        floating;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(n, &row, n, &col));
  for (PetscInt c = 0; c < l->ncell; c++) {
    for (PetscInt q = p->neighbour_ptr[c]; q < p->neighbour_ptr[c + 1]; q++) {
      for (PetscInt e = 0; e < nk * nk; e++) {
        row[(PetscCount)q * nk * nk + e] = (l->cell_start + c) * nk + e / nk;
        col[(PetscCount)q * nk * nk + e] = l->cell_global[p->neighbour[q]] * nk + e % nk;
      }
    }
  }
  PetscCall(MatCreate(PETSC_COMM_WORLD, &p->matrix));
  PetscCall(MatSetSizes(p->matrix, l->ncell * nk, l->ncell * nk, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetBlockSize(p->matrix, nk));
  PetscCall(MatSetType(p->matrix, MATAIJ));
  PetscCall(MatSetPreallocationCOO(p->matrix, n, row, col));
  PetscCall(set_part_block_size(p->matrix, nk));
  PetscCall(MatSetOption(p->matrix, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(p->matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscCall(PetscFree2(row, col));
  PetscCall(PetscCalloc1(n, &p->coo));
  PetscCall(FlowPressureIsFloating(p->flow, &floating));
  if (floating) {
    Vec          constant;
    MatNullSpace null;
    PetscReal   *a;

    PetscCall(MatCreateVecs(p->matrix, &constant, NULL));
    PetscCall(VecGetArrayWrite(constant, &a));
    for (PetscInt i = 0; i < l->ncell * nk; i++) a[i] = i % nk == 0;
    PetscCall(VecRestoreArrayWrite(constant, &a));
    PetscCall(VecNormalize(constant, NULL));
    PetscCall(MatNullSpaceCreate(PETSC_COMM_WORLD, PETSC_FALSE, 1, &constant, &null));
    PetscCall(MatSetNullSpace(p->matrix, null));
    PetscCall(MatNullSpaceDestroy(&null));
    PetscCall(VecDestroy(&constant));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Blocks of the row of cell c: sum over shared nodes of B_c weight B_c2^T */
static void build_row(Pressure p, const PetscReal b[], const PetscReal weight[], PetscInt c)
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, nb = l->nb, n = nb * dim, nk = p->nk;
  PetscReal       *out = p->coo + (PetscCount)p->neighbour_ptr[c] * nk * nk;
  const PetscInt   nn  = p->neighbour_ptr[c + 1] - p->neighbour_ptr[c], *neighbour = p->neighbour + p->neighbour_ptr[c];

  for (PetscInt i = 0; i < nn * nk * nk; i++) out[i] = 0;
  for (PetscInt j = 0; j < nb; j++) {
    const PetscInt i = l->cell_node[c * nb + j];
    PetscReal      wb[4][3];

    for (PetscInt k = 0; k < nk; k++)
      for (PetscInt a = 0; a < dim; a++) wb[k][a] = weight[i * dim + a] * b[c * nk * n + k * n + j * dim + a];
    for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
      const PetscInt c2 = l->node_cell[q];
      PetscInt       j2 = 0, at = 0;
      PetscReal     *block;

      while (l->cell_node[c2 * nb + j2] != i) j2++;
      while (neighbour[at] != c2) at++;
      block = out + at * nk * nk;
      for (PetscInt k = 0; k < nk; k++) {
        for (PetscInt m = 0; m < nk; m++) {
          PetscReal sum = 0;

          for (PetscInt a = 0; a < dim; a++) sum += wb[k][a] * b[c2 * nk * n + m * n + j2 * dim + a];
          block[k * nk + m] += sum;
        }
      }
    }
  }
}

/* Rebuild the rows of cells with a node whose weight has changed. *any: was there one on any rank? */
static PetscErrorCode update_matrix(Pressure p, const PetscReal weight[], PetscBool *any)
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim;
  const PetscReal *b;

  PetscFunctionBeginUser;
  *any = PETSC_FALSE;
  PetscCall(FlowGetCellDivergence(p->flow, &b));
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscBool changed = (PetscBool)!p->built;

    for (PetscInt j = 0; j < l->nb && !changed; j++) {
      const PetscInt i = l->cell_node[c * l->nb + j];

      for (PetscInt a = 0; a < dim; a++) changed = (PetscBool)(changed || weight[i * dim + a] != p->weight[i * dim + a]);
    }
    if (!changed) continue;
    build_row(p, b, weight, c);
    *any = PETSC_TRUE;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, any, 1, MPIU_BOOL, MPI_LOR, PETSC_COMM_WORLD));
  if (*any) {
    PetscCall(PetscArraycpy(p->weight, weight, l->nnode_all * dim));
    PetscCall(MatSetValuesCOO(p->matrix, p->coo, INSERT_VALUES));
  }
  p->built = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the bodies' part ---- */

/* q [nk][nr] = B_c R_k over the nodes of cell c that lie in body k */
static PetscErrorCode cut_rows(Pressure p, const PetscInt body[], const PetscReal b[], PetscInt c, PetscInt k, PetscReal q[])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, n = l->nb * dim;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < p->nk * p->nr; e++) q[e] = 0;
  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscInt i = l->cell_node[c * l->nb + j];
    PetscReal      R[18];

    if (body[i] != k) continue;
    PetscCall(ConstraintRigidMap(p->constraint, i, k, R));
    for (PetscInt m = 0; m < p->nk; m++)
      for (PetscInt s = 0; s < p->nr; s++)
        for (PetscInt a = 0; a < dim; a++) q[m * p->nr + s] += b[c * p->nk * n + m * n + j * dim + a] * R[a * p->nr + s];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* List (cell, body) pairs where the body covers some but not all nodes. A cell may meet two bodies. */
static PetscErrorCode find_cut_cells(Pressure p)
{
  const MeshLocal *l = p->loc;
  const PetscInt  *body, *unknown;
  const PetscReal *b;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(p->constraint, &body));
  PetscCall(ConstraintGetUnknown(p->constraint, &unknown));
  PetscCall(FlowGetCellDivergence(p->flow, &b));
  p->ncut = 0;
  for (PetscInt c = 0; c < l->ncell; c++) {
    const PetscInt *node = l->cell_node + c * l->nb;

    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt k = body[node[j]];
      PetscBool      first = PETSC_TRUE, whole = PETSC_TRUE;

      if (k < 0 || !unknown[k]) continue;
      for (PetscInt m = 0; m < l->nb; m++) {
        if (m < j && body[node[m]] == k) first = PETSC_FALSE;
        if (body[node[m]] != k) whole = PETSC_FALSE;
      }
      if (!first || whole) continue;
      if (p->ncut == p->room) {
        p->room = 2 * p->room + 64;
        PetscCall(PetscRealloc(p->room * sizeof(PetscInt), &p->cut_cell));
        PetscCall(PetscRealloc(p->room * sizeof(PetscInt), &p->cut_body));
        PetscCall(PetscRealloc(p->room * p->nk * p->nr * sizeof(PetscReal), &p->cut_q));
      }
      p->cut_cell[p->ncut] = c;
      p->cut_body[p->ncut] = k;
      PetscCall(cut_rows(p, body, b, c, k, p->cut_q + p->ncut * p->nk * p->nr));
      p->ncut++;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = matrix x + sum_k (B R_k) M_k^{-1} (B R_k)^T x */
static PetscErrorCode mult_shell(Mat mat, Vec x, Vec y)
{
  Pressure         p;
  const PetscReal *xa;
  PetscReal       *ya, *t, *s;
  PetscInt         nr, nk;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &p));
  nr = p->nr;
  nk = p->nk;
  t  = p->work;
  s  = p->work + p->nbodies * nr;
  PetscCall(MatMult(p->matrix, x, y));
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(VecGetArray(y, &ya));
  PetscCall(PetscArrayzero(t, p->nbodies * nr));
  for (PetscInt i = 0; i < p->ncut; i++)
    for (PetscInt e = 0; e < nk * nr; e++) t[p->cut_body[i] * nr + e % nr] += p->cut_q[i * nk * nr + e] * xa[p->cut_cell[i] * nk + e / nr];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, t, (PetscMPIInt)(p->nbodies * nr), MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  for (PetscInt k = 0; k < p->nbodies; k++) {
    for (PetscInt a = 0; a < nr; a++) {
      s[k * nr + a] = 0;
      for (PetscInt e = 0; e < nr; e++) s[k * nr + a] += p->mass_inverse[(k * nr + a) * nr + e] * t[k * nr + e];
    }
  }
  for (PetscInt i = 0; i < p->ncut; i++)
    for (PetscInt e = 0; e < nk * nr; e++) ya[p->cut_cell[i] * nk + e / nr] += p->cut_q[i * nk * nr + e] * s[p->cut_body[i] * nr + e % nr];
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscCall(VecRestoreArray(y, &ya));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_shell(Pressure p)
{
  const PetscInt n = p->loc->ncell * p->nk;
  MatNullSpace   null;

  PetscFunctionBeginUser;
  PetscCall(MatCreateShell(PETSC_COMM_WORLD, n, n, PETSC_DETERMINE, PETSC_DETERMINE, p, &p->shell));
  PetscCall(MatShellSetOperation(p->shell, MATOP_MULT, (void (*)(void))mult_shell));
  PetscCall(MatSetOption(p->shell, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatGetNullSpace(p->matrix, &null));
  if (null) PetscCall(MatSetNullSpace(p->shell, null));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- two levels ---- */

/* Numbers of the mesh vertices among all vertices: own ones count up; vertex [nnode_all] global number or -1. */
static PetscErrorCode number_vertices(Pressure p, PetscInt vertex[], PetscInt *nown)
{
  const MeshLocal *l = p->loc;
  PetscInt         start = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode_all; i++) vertex[i] = -1;
  for (PetscInt i = 0; i < l->ncell_all * l->nb; i++) {
    const PetscInt j = i % l->nb;

    if (j % 3 != 1 && (j / 3) % 3 != 1 && (l->dim == 2 || j / 9 != 1)) vertex[l->cell_node[i]] = 0;
  }
  *nown = 0;
  for (PetscInt i = 0; i < l->nnode; i++)
    if (vertex[i] == 0) vertex[i] = (*nown)++;
  PetscCallMPI(MPI_Exscan(nown, &start, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD));
  for (PetscInt i = 0; i < l->nnode; i++)
    if (vertex[i] >= 0) vertex[i] += start;
  PetscCall(MeshSyncNodesInt(p->mesh, vertex));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Linear function on a cell (value and scaled slopes at the centre) that fits the vertex values: for a parallelogram the multilinear interpolant at its centre */
static PetscErrorCode fit_vertices(Pressure p, PetscInt c, PetscInt node[], PetscReal fit[])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, nv = 1 << dim;
  PetscReal        xc[MESH_MAX_NB * 3], J[3][3] = {{0}}, inv[3][3], size, det;
  PetscInt         n = 0, corner[8];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(p->mesh, c, xc));
  for (PetscInt j = 0; j < l->nb; j++)
    if (j % 3 != 1 && (j / 3) % 3 != 1 && (dim == 2 || j / 9 != 1)) corner[n++] = j;
  for (PetscInt v = 0; v < nv; v++) {
    node[v] = l->cell_node[c * l->nb + corner[v]];
    for (PetscInt e = 0; e < dim; e++)
      for (PetscInt a = 0; a < dim; a++) J[a][e] += ((v >> e) & 1 ? 1.0 : -1.0) / nv * xc[corner[v] * dim + a];
  }
  if (dim == 2) J[2][2] = 1;
  for (PetscInt a = 0; a < 3; a++)
    for (PetscInt e = 0; e < 3; e++) inv[e][a] = J[(a + 1) % 3][(e + 1) % 3] * J[(a + 2) % 3][(e + 2) % 3] - J[(a + 1) % 3][(e + 2) % 3] * J[(a + 2) % 3][(e + 1) % 3];
  det  = J[0][0] * inv[0][0] + J[0][1] * inv[1][0] + J[0][2] * inv[2][0];
  size = PetscPowReal(PetscAbsReal(det) * nv, 1.0 / dim);
  for (PetscInt v = 0; v < nv; v++) {
    fit[v] = 1.0 / nv;
    for (PetscInt a = 0; a < dim; a++) {
      fit[(1 + a) * nv + v] = 0;
      for (PetscInt e = 0; e < dim; e++) fit[(1 + a) * nv + v] += size * inv[e][a] / det * ((v >> e) & 1 ? 1.0 : -1.0) / nv;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_interpolation(Pressure p)
{
  const MeshLocal *l  = p->loc;
  const PetscInt   nv = 1 << l->dim;
  PetscInt        *vertex, nown;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all, &vertex));
  PetscCall(number_vertices(p, vertex, &nown));
  PetscCall(MatCreateAIJ(PETSC_COMM_WORLD, l->ncell * p->nk, nown, PETSC_DETERMINE, PETSC_DETERMINE, nv, NULL, nv, NULL, &p->interpolation));
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscInt  row[4], col[8];
    PetscReal fit[4 * 8];

    PetscCall(fit_vertices(p, c, col, fit));
    for (PetscInt v = 0; v < nv; v++) col[v] = vertex[col[v]];
    for (PetscInt k = 0; k < p->nk; k++) row[k] = (l->cell_start + c) * p->nk + k;
    PetscCall(MatSetValues(p->interpolation, p->nk, row, nv, col, fit, INSERT_VALUES));
  }
  PetscCall(MatAssemblyBegin(p->interpolation, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(p->interpolation, MAT_FINAL_ASSEMBLY));
  PetscCall(PetscFree(vertex));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureSetUpPC(Pressure p, KSP ksp)
{
  PC        pc;
  PetscBool mg;
  PetscInt  levels;
  Mat       present;

  PetscFunctionBeginUser;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCMG, &mg));
  if (!mg) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PCMGGetLevels(pc, &levels));
  if (levels != 2) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PCMGGetInterpolation(pc, 1, &present));
  if (present == p->interpolation && present) PetscFunctionReturn(PETSC_SUCCESS);
  if (!p->interpolation) PetscCall(create_interpolation(p));
  PetscCall(PCMGSetInterpolation(pc, 1, p->interpolation));
  PetscCall(PCSetUseAmat(pc, PETSC_FALSE)); /* the matrix on both levels, not the operator with the bodies' part */
  PetscCall(PCMGSetGalerkin(pc, PC_MG_GALERKIN_PMAT));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode PressureSetDefaults(void)
{
#define PREFIX "-flow_fieldsplit_pressure_"
  PetscFunctionBeginUser;
  PetscCall(OptDefault(PREFIX "pc_type", "mg"));
  PetscCall(OptDefault(PREFIX "pc_mg_levels", "2"));
  PetscCall(OptDefault(PREFIX "mg_levels_ksp_type", "chebyshev"));
  PetscCall(OptDefault(PREFIX "mg_levels_ksp_max_it", "1"));
  PetscCall(OptDefault(PREFIX "mg_levels_pc_type", "pbjacobi"));
#if defined(PETSC_HAVE_HYPRE)
  PetscCall(OptDefault(PREFIX "mg_coarse_pc_type", "hypre"));
#else
  PetscCall(OptDefault(PREFIX "mg_coarse_pc_type", "gamg"));
#endif
  PetscFunctionReturn(PETSC_SUCCESS);
#undef PREFIX
}

PetscErrorCode PressureCreate(Flow flow, Constraint constraint, Pressure *pressure)
{
  Pressure p;
  PetscInt first, count;

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
  p->eps = 1e-4;
  PetscCall(OptReal("-flow_pressure_softness", "share of their inverse mass that body nodes keep in the pressure preconditioner", "", 0, 1, &p->eps));
  PetscCall(PetscCalloc3(p->loc->nnode_all * p->loc->dim, &p->weight, p->nbodies * p->nr * p->nr, &p->mass_inverse, 2 * p->nbodies * p->nr, &p->work));
  PetscCall(find_neighbours(p));
  PetscCall(create_matrix(p));
  if (p->nbodies) PetscCall(create_shell(p));
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
  PetscCall(MatDestroy(&p->interpolation));
  PetscCall(PetscFree(p->neighbour_ptr));
  PetscCall(PetscFree(p->neighbour));
  PetscCall(PetscFree(p->coo));
  PetscCall(PetscFree3(p->weight, p->mass_inverse, p->work));
  PetscCall(PetscFree(p->cut_cell));
  PetscCall(PetscFree(p->cut_body));
  PetscCall(PetscFree(p->cut_q));
  PetscCall(PetscFree(*pressure));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal PressureGetSoftness(Pressure p)
{
  return p->eps;
}

PetscErrorCode PressureUpdate(Pressure p, const PetscReal weight[], const PetscReal mass_inverse[])
{
  PetscBool changed;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_PRES_BUILD, 0, 0, 0, 0));
  PetscCall(update_matrix(p, weight, &changed));
  if (p->shell) {
    PetscCall(find_cut_cells(p));
    PetscCall(PetscArraycpy(p->mass_inverse, mass_inverse, p->nbodies * p->nr * p->nr));
    PetscCall(MatAssemblyBegin(p->shell, MAT_FINAL_ASSEMBLY)); /* its values have changed */
    PetscCall(MatAssemblyEnd(p->shell, MAT_FINAL_ASSEMBLY));
  }
  PetscCall(PetscLogEventEnd(TB_PRES_BUILD, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureGetMats(Pressure p, Mat *operator, Mat * matrix)
{
  PetscFunctionBeginUser;
  *operator= p->shell ? p->shell : p->matrix;
  *matrix = p->matrix;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureGetDiagonal(Pressure p, Vec d)
{
  PetscFunctionBeginUser;
  PetscCall(MatGetDiagonal(p->matrix, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}
