/* ElasticAle: see elasticale.h. In the plane. */
#include "compat.h"
#include "elasticale.h"
#include "base/algebra.h"
#include "base/pivots.h"
#include "fem/element.h"
#include "fem/gauss.h"
#include <petscksp.h>

#define ROW 20 /* vertices that share a cell with one, and more where levels jump */

static const PetscInt CORNER[4] = {0, 2, 6, 8};

struct _p_ElasticAle {
  Flow               flow;
  MeshUpdate         mesh_update;
  Mesh               mesh;
  MPI_Comm           comm;
  const MeshLocal   *loc;
  const SolidsState *s;
  PetscReal         *start;     /* [nnode_all][2] positions at the start */
  PetscReal         *d;         /* [nnode_all][2] displacement from there */
  PetscReal         *now, *old; /* [nnode_all][2] positions at the last two times */
  PetscReal         *velocity;
  PetscInt          *all;
  PetscInt           n, *node; /* nodes of solids */
  PetscInt          *solid_cell, *solid;
  PetscReal         *phi, *offset; /* [n][9], [n][2] */
  PetscInt          *kind;         /* [nnode_all] 1: of a solid, 2: stays, 0: follows */
  PetscInt          *vertex;       /* [nnode_all] global number among vertices, -1: none */
  Mat                L, fixed;     /* rows of followers; what fixed vertices add */
  KSP                ksp;
  Vec                x, b;
};

/* ---- points of the material ---- */

/* The cell of a solid that x lies deepest in, where the solid is at the start */
static PetscErrorCode find_material(const struct _p_ElasticAle *f, PetscInt k, const PetscReal x[2], PetscInt *cell,
                                    PetscReal xi[2])
{
  const SolidMesh *m    = &f->s->group[f->s->group_of[k]].mesh;
  PetscReal        best = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  *cell = -1;
  for (PetscInt c = 0; c < m->ncell; c++) {
    PetscReal xc[18], y[2], far, size = 0, away = 0;

    SolidGather(m, c, f->s->X + 2 * f->s->first[k], xc);
    for (PetscInt a = 0; a < 2; a++) {
      size = PetscMax(size, PetscAbsReal(xc[16 + a] - xc[a]));
      away = PetscMax(away, PetscAbsReal(x[a] - xc[8 + a]));
    }
    if (away > 2 * size || !ElementLocate(2, xc, x, y)) continue;
    far = PetscMax(PetscAbsReal(y[0]), PetscAbsReal(y[1]));
    if (far >= best) continue;
    best  = far;
    *cell = c;
    xi[0] = y[0];
    xi[1] = y[1];
  }
  PetscCheck(*cell >= 0, f->comm, PETSC_ERR_PLIB, "A node at (%g, %g) is in no cell of its solid", (double)x[0],
             (double)x[1]);
  for (PetscInt a = 0; a < 2; a++) xi[a] = PetscMax(-1, PetscMin(1, xi[a]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode list_material(ElasticAle f, const PetscInt cell_solid[])
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < l->ncell_all * l->nb; e++)
    if (cell_solid[e / l->nb] >= 0) f->kind[l->cell_node[e]] = 1;
  for (PetscInt i = 0; i < l->nnode_all; i++) f->n += f->kind[i] == 1;
  PetscCall(
    PetscMalloc5(f->n, &f->node, f->n, &f->solid, f->n, &f->solid_cell, 9 * f->n, &f->phi, 2 * f->n, &f->offset));
  f->n = 0;
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    PetscReal xi[2], dphi[18], *phi = f->phi + 9 * f->n;
    PetscInt  k = -1;

    if (f->kind[i] != 1) continue;
    for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++)
      k = PetscMax(k, cell_solid[l->node_cell[q]]);
    f->node[f->n]  = i;
    f->solid[f->n] = k;
    PetscCall(find_material(f, k, l->x + 2 * i, &f->solid_cell[f->n], xi));
    ElementBasis(2, xi, phi, dphi);
    for (PetscInt a = 0; a < 2; a++) {
      const SolidMesh *m = &f->s->group[f->s->group_of[k]].mesh;

      f->offset[2 * f->n + a] = l->x[2 * i + a];
      for (PetscInt j = 0; j < 9; j++)
        f->offset[2 * f->n + a] -= phi[j] *
                                   f->s->X[2 * (f->s->first[k] + m->cell_node[f->solid_cell[f->n] * 9 + j]) + a];
    }
    f->n++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Displacements of the nodes of solids, with the solids' nodes at x */
static void move_material(ElasticAle f, const PetscReal x[])
{
  for (PetscInt e = 0; e < f->n; e++) {
    const SolidMesh *m = &f->s->group[f->s->group_of[f->solid[e]]].mesh;

    for (PetscInt a = 0; a < 2; a++) {
      PetscReal at = f->offset[2 * e + a];

      for (PetscInt j = 0; j < 9; j++)
        at += f->phi[9 * e + j] * x[2 * (f->s->first[f->solid[e]] + m->cell_node[f->solid_cell[e] * 9 + j]) + a];
      f->d[2 * f->node[e] + a] = at - f->start[2 * f->node[e] + a];
    }
  }
}

/* ---- vertices that follow ---- */

/* Positions of the corners of local cell c from the vertices in its corner slots: beside a larger cell a corner lies
   halfway between two of them */
static const PetscReal (*corners_of(const MeshLocal *l, PetscInt c))[8]
{
  static const PetscReal THEMSELVES[8][8] = {{1}, {0, 1}, {0, 0, 1}, {0, 0, 0, 1}};
  const MeshHang        *h                = MeshCellHang(l, c);

  return h ? h->corner : THEMSELVES;
}

/* int grad phi_p . grad phi_q and int phi of the bilinear functions of a cell with corners x */
static void bilinear(const PetscReal x[4][2], PetscReal K[4][4], PetscReal *area)
{
  const PetscReal at = 0.5 * (1 - 1 / PetscSqrtReal(3));

  *area = 0;
  for (PetscInt e = 0; e < 16; e++) K[e / 4][e % 4] = 0;
  for (PetscInt q = 0; q < 4; q++) {
    const PetscReal r = q % 2 ? 1 - at : at, t = q / 2 ? 1 - at : at;
    const PetscReal d[4][2] = {{t - 1, r - 1}, {1 - t, -r}, {-t, 1 - r}, {t, r}};
    PetscReal       J[4]    = {0}, inv[4], g[4][2], det;

    for (PetscInt v = 0; v < 16; v++) J[v % 4] += x[v / 4][v % 4 / 2] * d[v / 4][v % 2];
    det = DenseInvertMap(2, J, inv);
    for (PetscInt v = 0; v < 8; v++) g[v / 2][v % 2] = d[v / 2][0] * inv[v % 2] + d[v / 2][1] * inv[2 + v % 2];
    for (PetscInt e = 0; e < 16; e++)
      K[e / 4][e % 4] += 0.25 * det * (g[e / 4][0] * g[e % 4][0] + g[e / 4][1] * g[e % 4][1]);
    *area += 0.25 * det;
  }
}

/* Laplace's operator on the mesh as it is, and the area around vertices */
static PetscErrorCode add_cell(ElasticAle f, PetscInt c, Mat laplace, Vec area)
{
  const MeshLocal *l          = f->loc;
  const PetscReal(*corner)[8] = corners_of(l, c);
  PetscReal xc[18], x[4][2], K[4][4], mine[16] = {0}, part[4] = {0}, size;
  PetscInt  row[4];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(f->mesh, c, xc));
  for (PetscInt v = 0; v < 4; v++) {
    PetscCall(PetscArraycpy(x[v], xc + 2 * CORNER[v], 2));
    row[v] = f->vertex[l->cell_node[c * l->nb + CORNER[v]]];
  }
  bilinear(x, K, &size);
  for (PetscInt e = 0; e < 16; e++) {
    part[e % 4] += 0.25 * size * corner[e / 4][e % 4];
    for (PetscInt k = 0; k < 16; k++) mine[k] += K[e / 4][e % 4] * corner[e / 4][k / 4] * corner[e % 4][k % 4];
  }
  PetscCall(MatSetValues(laplace, 4, row, 4, row, mine, ADD_VALUES));
  PetscCall(VecSetValues(area, 4, row, part, ADD_VALUES));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Vertices of this rank that do not follow */
static PetscErrorCode list_fixed(const struct _p_ElasticAle *f, PetscInt *n, PetscInt **row)
{
  PetscFunctionBeginUser;
  *n = 0;
  PetscCall(PetscMalloc1(f->loc->nnode, row));
  for (PetscInt i = 0; i < f->loc->nnode; i++)
    if (f->vertex[i] >= 0 && f->kind[i]) (*row)[(*n)++] = f->vertex[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rows of laplace over the root of the areas; without those of vertices that stay, where the displacement may bend */
static PetscErrorCode scale_rows(const struct _p_ElasticAle *f, Mat laplace, Vec area)
{
  PetscReal *s;
  PetscInt   first;

  PetscFunctionBeginUser;
  PetscCall(VecSqrtAbs(area));
  PetscCall(VecReciprocal(area));
  PetscCall(VecGetOwnershipRange(area, &first, NULL));
  PetscCall(VecGetArray(area, &s));
  for (PetscInt i = 0; i < f->loc->nnode; i++)
    if (f->vertex[i] >= 0 && f->kind[i] == 2) s[f->vertex[i] - first] = 0;
  PetscCall(VecRestoreArray(area, &s));
  PetscCall(MatDiagonalScale(laplace, area, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Derivatives of the sum of the squares */
static PetscErrorCode assemble(ElasticAle f, PetscInt nown)
{
  Mat       laplace;
  PetscInt *row, n;

  PetscFunctionBeginUser;
  PetscCall(MatCreateAIJ(f->comm, nown, nown, PETSC_DETERMINE, PETSC_DETERMINE, ROW, NULL, ROW, NULL, &laplace));
  PetscCall(MatSetOption(laplace, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
  PetscCall(MatCreateVecs(laplace, &f->x, &f->b));
  for (PetscInt c = 0; c < f->loc->ncell; c++) PetscCall(add_cell(f, c, laplace, f->b));
  PetscCall(MatAssemblyBegin(laplace, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(laplace, MAT_FINAL_ASSEMBLY));
  PetscCall(VecAssemblyBegin(f->b));
  PetscCall(VecAssemblyEnd(f->b));
  PetscCall(scale_rows(f, laplace, f->b));
  PetscCall(MatTransposeMatMult(laplace, laplace, MAT_INITIAL_MATRIX, PETSC_DEFAULT, &f->L));
  PetscCall(MatDestroy(&laplace));
  PetscCall(MatDuplicate(f->L, MAT_COPY_VALUES, &f->fixed));
  PetscCall(MatScale(f->fixed, -1));
  PetscCall(list_fixed(f, &n, &row));
  PetscCall(MatZeroRows(f->fixed, n, row, 0, NULL, NULL));
  PetscCall(MatZeroRowsColumns(f->L, n, row, 1, NULL, NULL));
  PetscCall(PetscFree(row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_solver(ElasticAle f)
{
  PC          pc;
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(f->comm, &size));
  PetscCall(KSPCreate(f->comm, &f->ksp));
  PetscCall(KSPSetOptionsPrefix(f->ksp, "couple_elastic_"));
  PetscCall(KSPSetType(f->ksp, KSPPREONLY));
  PetscCall(KSPGetPC(f->ksp, &pc));
  PetscCall(PCSetType(pc, PCLU));
  PetscCall(PivotsOfAnySize(f->ksp));
  if (size > 1) PetscCall(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
  PetscCall(KSPSetOperators(f->ksp, f->L, f->L));
  PetscCall(KSPSetFromOptions(f->ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Who stays: boundaries of the domain and rigid bodies */
static PetscErrorCode mark_fixed(ElasticAle f, const PetscInt node_body[])
{
  PetscInt nboundary;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryCount(f->mesh, &nboundary));
  for (PetscInt b = 0; b < nboundary; b++) {
    PetscInt        n;
    const PetscInt *node;

    PetscCall(MeshGetBoundaryNodes(f->mesh, b, &n, &node));
    for (PetscInt i = 0; i < n; i++)
      if (!f->kind[node[i]]) f->kind[node[i]] = 2;
  }
  for (PetscInt i = 0; i < f->loc->nnode_all; i++)
    if (!f->kind[i] && node_body[i] >= 0) f->kind[i] = 2;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Displacements of the vertices that follow those that do not */
static PetscErrorCode smooth_displacements(ElasticAle f)
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 2; a++) {
    PetscReal *x;
    PetscInt   first;

    PetscCall(VecGetOwnershipRange(f->x, &first, NULL));
    PetscCall(VecGetArray(f->x, &x));
    for (PetscInt i = 0; i < l->nnode; i++)
      if (f->vertex[i] >= 0) x[f->vertex[i] - first] = f->kind[i] ? f->d[2 * i + a] : 0;
    PetscCall(VecRestoreArray(f->x, &x));
    PetscCall(MatMult(f->fixed, f->x, f->b));
    PetscCall(VecAXPY(f->b, 1, f->x));
    PetscCall(KSPSolve(f->ksp, f->b, f->x));
    PetscCall(VecGetArray(f->x, &x));
    for (PetscInt i = 0; i < l->nnode; i++)
      if (f->vertex[i] >= 0 && !f->kind[i]) f->d[2 * i + a] = x[f->vertex[i] - first];
    PetscCall(VecRestoreArray(f->x, &x));
  }
  PetscCall(MeshSyncNodes(f->mesh, 2, f->d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does slot j of local cell c hold a node of a larger cell that lies elsewhere? */
static PetscBool hangs(const MeshLocal *l, PetscInt c, PetscInt j)
{
  const MeshHang *h = MeshCellHang(l, c);

  for (PetscInt r = 0; h && r < h->n; r++)
    if (h->slot[r] == j) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* Of local cell c: middles of edges between vertices that follow, of those that it shares with a larger cell that one
   moves the middle; the centre by transfinite interpolation */
static void place_middles_of(ElasticAle f, PetscInt c)
{
  const PetscInt *node        = f->loc->cell_node + c * f->loc->nb;
  const PetscReal(*corner)[8] = corners_of(f->loc, c);
  PetscReal d[18]             = {0};

  for (PetscInt v = 0; v < 16; v++)
    for (PetscInt a = 0; a < 2; a++)
      d[2 * CORNER[v / 4] + a] += corner[v / 4][v % 4] * f->d[2 * node[CORNER[v % 4]] + a];
  for (PetscInt e = 0; e < 4; e++) {
    const PetscInt  m   = ELEMENT_EDGE[e][1];
    const PetscBool its = (PetscBool)!hangs(f->loc, c, m);

    for (PetscInt a = 0; a < 2; a++) {
      d[2 * m + a] = its && f->kind[node[m]] ? f->d[2 * node[m] + a]
                                             : 0.5 * (d[2 * ELEMENT_EDGE[e][0] + a] + d[2 * ELEMENT_EDGE[e][2] + a]);
      if (its) f->d[2 * node[m] + a] = d[2 * m + a];
    }
  }
  for (PetscInt a = 0; a < 2 && !f->kind[node[4]]; a++) {
    PetscReal sum = 0;

    for (PetscInt j = 0; j < 9; j++) sum += j == 4 ? 0 : (j % 2 ? 0.5 : -0.25) * d[2 * j + a];
    f->d[2 * node[4] + a] = sum;
  }
}

/* Nodes between vertices that follow */
static PetscErrorCode place_middles(ElasticAle f)
{
  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < f->loc->ncell_all; c++) place_middles_of(f, c);
  PetscCall(MeshSyncNodes(f->mesh, 2, f->d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode ElasticAleCreate(Flow flow, MeshUpdate update, const SolidsState *s, const PetscInt cell_solid[],
                                const PetscInt node_body[], ElasticAle *ale)
{
  ElasticAle f;
  PetscInt   n, nown;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  f->flow        = flow;
  f->mesh_update = update;
  f->s           = s;
  PetscCall(FlowGetMesh(flow, &f->mesh));
  PetscCall(MeshGetLocal(f->mesh, &f->loc));
  PetscCall(MeshGetComm(f->mesh, &f->comm));
  n = f->loc->nnode_all;
  PetscCall(PetscCalloc5(2 * n, &f->start, 2 * n, &f->d, 2 * n, &f->now, 2 * n, &f->old, 2 * n, &f->velocity));
  PetscCall(PetscCalloc3(n, &f->all, n, &f->kind, n, &f->vertex));
  for (PetscInt i = 0; i < n; i++) f->all[i] = i;
  PetscCall(PetscArraycpy(f->start, f->loc->x, 2 * n));
  PetscCall(PetscArraycpy(f->now, f->loc->x, 2 * n));
  PetscCall(PetscArraycpy(f->old, f->loc->x, 2 * n));
  PetscCall(list_material(f, cell_solid));
  PetscCall(mark_fixed(f, node_body));
  PetscCall(MeshNumberVertices(f->mesh, f->vertex, &nown));
  PetscCall(assemble(f, nown));
  PetscCall(create_solver(f));
  *ale = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAleDestroy(ElasticAle *ale)
{
  ElasticAle f = *ale;

  PetscFunctionBeginUser;
  if (!f) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree5(f->start, f->d, f->now, f->old, f->velocity));
  PetscCall(PetscFree5(f->node, f->solid, f->solid_cell, f->phi, f->offset));
  PetscCall(PetscFree3(f->all, f->kind, f->vertex));
  PetscCall(MatDestroy(&f->L));
  PetscCall(MatDestroy(&f->fixed));
  PetscCall(VecDestroy(&f->x));
  PetscCall(VecDestroy(&f->b));
  PetscCall(KSPDestroy(&f->ksp));
  PetscCall(PetscFree(*ale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* No cell may fold: Jacobian at the 3 x 3 points of the flow */
static PetscErrorCode check_cells(ElasticAle f, const FlowStep *step)
{
  const MeshLocal *l        = f->loc;
  PetscReal        worst[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell && worst[0] == 0; c++) {
    PetscReal xc[18];

    PetscCall(MeshCellCoordinates(f->mesh, c, xc));
    for (PetscInt q = 0; q < 9; q++) {
      const PetscReal xi[2] = {GAUSS3_POINT[q % 3], GAUSS3_POINT[q / 3]};
      PetscReal       x[2], J[4];

      ElementMap(2, xc, xi, x, J);
      if (DenseDeterminant(2, J) > 0) continue;
      worst[0] = 1;
      worst[1] = x[0];
      worst[2] = x[1];
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, worst, 3, MPIU_REAL, MPIU_MAX, f->comm));
  PetscCheck(worst[0] == 0, f->comm, PETSC_ERR_USER_INPUT,
             "The mesh that follows the elastic particles folds at t = %g, near (%g, %g): their stroke is too large for it. Use -couple_anchored "
             "false, with which it is lined up with them anew in every step and no node goes beyond a cell in one, or larger cells beside them",
             (double)step->time, (double)worst[1], (double)worst[2]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAleUpdate(ElasticAle f, const FlowStep *s, const PetscReal x[])
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  PetscCall(MeshUpdateBegin(f->mesh_update, l->ncell_all, f->all, NULL)); /* a mesh has more nodes than cells */
  move_material(f, x);
  PetscCall(smooth_displacements(f));
  PetscCall(place_middles(f));
  for (PetscInt i = 0; i < 2 * l->nnode_all; i++) f->velocity[i] = f->start[i] + f->d[i];
  PetscCall(MeshMoveNodes(f->mesh, l->nnode_all, f->all, f->velocity));
  PetscCall(check_cells(f, s));
  PetscCall(MeshUpdateCommit(f->mesh_update, &(MeshUpdateMesh){.whole = PETSC_TRUE}));
  for (PetscInt i = 0; i < 2 * l->nnode_all; i++)
    f->velocity[i] = s->ct * l->x[i] - s->d0 * f->now[i] - s->d1 * f->old[i];
  PetscCall(FlowSetMeshVelocity(f->flow, f->velocity));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAleAccept(ElasticAle f)
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(f->old, f->now, 2 * f->loc->nnode_all));
  PetscCall(PetscArraycpy(f->now, f->loc->x, 2 * f->loc->nnode_all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAleVisitState(ElasticAle f, State state)
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  PetscCall(StateNodes(state, "elastic_place", 2, f->now));
  PetscCall(StateNodes(state, "elastic_place_old", 2, f->old));
  if (!StateIsLoading(state)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(
    MeshUpdateRestore(f->mesh_update, l->ncell_all, f->all,
                      &(MeshUpdateMesh){.nnode = l->nnode_all, .node = f->all, .x = f->now, .whole = PETSC_TRUE}));
  PetscFunctionReturn(PETSC_SUCCESS);
}
