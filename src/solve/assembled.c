/* Assembled: see assembled.h. Written for generality, not speed: everything is built anew when the constraint changes.
   */
#include "compat.h"
#include "assembled.h"
#include "base/project.h"

static PetscReal unit(const ConstraintView *c, PetscInt k, PetscInt i, PetscInt j)
{
  return ConstraintSlotUnit(c, k, i) * ConstraintSlotUnit(c, k, j);
}

/* Entries of the rows of a matrix of all components: of own columns, of others */
static PetscErrorCode count_entries(Mat S, PetscInt dim, const PetscBool wanted[], PetscInt own[], PetscInt others[])
{
  PetscInt start, end;

  PetscFunctionBeginUser;
  PetscCall(MatGetOwnershipRange(S, &start, &end));
  for (PetscInt i = start; i < end; i++) {
    const PetscInt *column;
    PetscInt        n, in = 0;

    for (PetscInt a = 0; a < dim; a++) own[(i - start) * dim + a] = 1;
    if (!wanted[i - start]) continue;
    PetscCall(MatGetRow(S, i, &n, &column, NULL));
    for (PetscInt e = 0; e < n; e++) in += column[e] >= start && column[e] < end;
    for (PetscInt a = 0; a < dim; a++) {
      own[(i - start) * dim + a]    = in;
      others[(i - start) * dim + a] = n - in;
    }
    PetscCall(MatRestoreRow(S, i, &n, &column, NULL));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Row `row` of S for every component */
static PetscErrorCode copy_row(Mat S, PetscInt dim, PetscInt row, Mat A)
{
  const PetscInt    *column;
  const PetscScalar *v;
  PetscInt           n, *to;

  PetscFunctionBeginUser;
  PetscCall(MatGetRow(S, row, &n, &column, &v));
  PetscCall(PetscMalloc1(n, &to));
  for (PetscInt a = 0; a < dim; a++) {
    const PetscInt at = row * dim + a;

    for (PetscInt e = 0; e < n; e++) to[e] = column[e] * dim + a;
    PetscCall(MatSetValues(A, 1, &at, n, to, v, INSERT_VALUES));
  }
  PetscCall(PetscFree(to));
  PetscCall(MatRestoreRow(S, row, &n, &column, &v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AssembledCreateNodes(Flow flow, const PetscBool wanted[], Mat *A)
{
  Mesh             mesh;
  const MeshLocal *l;
  Mat              S;
  PetscInt        *own, *others, n, start;

  PetscFunctionBeginUser;
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(FlowGetMatrix(flow, &S));
  n = l->nnode * l->dim;
  PetscCall(PetscCalloc2(n, &own, n, &others));
  PetscCall(count_entries(S, l->dim, wanted, own, others));
  PetscCall(
    MatCreateAIJ(PetscObjectComm((PetscObject)S), n, n, PETSC_DETERMINE, PETSC_DETERMINE, 0, own, 0, others, A));
  PetscCall(PetscFree2(own, others));
  PetscCall(MatGetOwnershipRange(S, &start, NULL));
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscInt row = (start + i) * l->dim;

    if (wanted[i]) PetscCall(copy_row(S, l->dim, start + i, *A));
    else
      for (PetscInt a = 0; a < l->dim; a++) PetscCall(MatSetValue(*A, row + a, row + a, 0, INSERT_VALUES));
  }
  PetscCall(MatAssemblyBegin(*A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*A, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* D + H (of own bodies, may be NULL) and the identity of inert slots, as a matrix over u_r */
static PetscErrorCode create_rigid_diagonal(Constraint constraint, const PetscReal D[], const PetscReal H[], Mat *E)
{
  const ConstraintView *c  = ConstraintGetView(constraint);
  const PetscInt        nn = c->nr * c->nr;
  PetscInt              start, nodal, total;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetSizes(constraint, &nodal, &total));
  PetscCall(
    MatCreateAIJ(c->comm, total, total, PETSC_DETERMINE, PETSC_DETERMINE, PetscMax(c->nr, 1), NULL, 0, NULL, E));
  PetscCall(MatGetOwnershipRange(*E, &start, NULL));
  for (PetscInt j = 0; j < c->inert.n; j++)
    PetscCall(MatSetValue(*E, start + c->inert.slot[j], start + c->inert.slot[j], 1, INSERT_VALUES));
  for (PetscInt own = 0; own < c->count; own++) {
    const PetscInt k = own < c->nown ? c->own[own] : -1, row = start + nodal + own * c->nr;

    for (PetscInt i = 0; i < c->nr; i++) {
      if (k < 0 || !ConstraintIsUnknown(c, k, i)) PetscCall(MatSetValue(*E, row + i, row + i, 1, INSERT_VALUES));
      else
        for (PetscInt j = 0; j < c->nr; j++) {
          const PetscInt at = i * c->nr + j;

          if (ConstraintIsUnknown(c, k, j))
            PetscCall(MatSetValue(*E, row + i, row + j,
                                  unit(c, k, i, j) * (D[k * nn + at] + (H ? H[own * nn + at] : 0)), INSERT_VALUES));
        }
    }
  }
  PetscCall(MatAssemblyBegin(*E, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*E, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* B as a matrix (own cells x own nodes) */
static PetscErrorCode create_divergence_matrix(Flow flow, MPI_Comm comm, const MeshLocal *l, Mat *B)
{
  const PetscInt          dim = l->dim, n = l->nb * dim, nk = dim + 1;
  const PetscReal *const *b;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(flow, &b));
  PetscCall(MatCreateAIJ(comm, l->ncell * nk, l->nnode * dim, PETSC_DETERMINE, PETSC_DETERMINE, n, NULL, n, NULL, B));
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscInt row[4], col[MESH_MAX_NB * 3];

    for (PetscInt k = 0; k < nk; k++) row[k] = (l->cell_start + c) * nk + k;
    for (PetscInt j = 0; j < n; j++) col[j] = l->node_global[l->cell_node[c * l->nb + j / dim]] * dim + j % dim;
    PetscCall(MatSetValues(*B, nk, row, n, col, b[c], INSERT_VALUES));
  }
  PetscCall(MatAssemblyBegin(*B, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*B, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* G of a penalty as a matrix, rows: own nodes x dim, columns: u_r (unknown rigid velocities) */
static PetscErrorCode create_penalty_matrix(Constraint constraint, const PenaltyTerm *s, Mat *G)
{
  const ConstraintView *c  = ConstraintGetView(constraint);
  const PetscInt        nr = s->nr, dim = s->dim;
  PetscInt              nodal, total, row, *column;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetSizes(constraint, &nodal, &total));
  PetscCall(PetscMalloc1(c->nbodies, &column));
  PetscCall(ConstraintGetRigidColumns(constraint, column));
  PetscCall(MatCreateAIJ(c->comm, nodal, total, PETSC_DETERMINE, PETSC_DETERMINE, 2 * nr, NULL, 2 * nr, NULL,
                         G)); /* rarely more than two bodies at a node */
  PetscCall(MatSetOption(*G, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
  PetscCall(MatGetOwnershipRange(*G, &row, NULL));
  for (PetscInt e = 0; e < s->n; e++) {
    PetscReal block[18];

    PenaltyTermGetBlock(s, e, block);
    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt m = 0; m < nr; m++)
        if (ConstraintIsUnknown(c, s->body[e], m))
          PetscCall(MatSetValue(*G, row + s->node[e] * dim + a, column[s->body[e]] + m,
                                ConstraintSlotUnit(c, s->body[e], m) * block[a * nr + m], INSERT_VALUES));
  }
  PetscCall(MatAssemblyBegin(*G, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*G, MAT_FINAL_ASSEMBLY));
  PetscCall(PetscFree(column));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* out -= P^T G + G^T P */
static PetscErrorCode subtract_penalty_coupling(Constraint c, Mat P, const PenaltyTerm *penalty, Mat out)
{
  Mat G, PtG, GtP;

  PetscFunctionBeginUser;
  PetscCall(create_penalty_matrix(c, penalty, &G));
  PetscCall(MatTransposeMatMult(P, G, MAT_INITIAL_MATRIX, PETSC_DEFAULT, &PtG));
  PetscCall(MatTranspose(PtG, MAT_INITIAL_MATRIX, &GtP));
  PetscCall(MatAXPY(out, -1, PtG, DIFFERENT_NONZERO_PATTERN));
  PetscCall(MatAXPY(out, -1, GtP, DIFFERENT_NONZERO_PATTERN));
  PetscCall(MatDestroy(&G));
  PetscCall(MatDestroy(&PtG));
  PetscCall(MatDestroy(&GtP));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AssembledCreateVelocity(Flow flow, Constraint c, Mat A, Mat P, const PetscReal D[],
                                       const PenaltyTerm *penalty, ContactCoupling contact_coupling, Mat *out)
{
  Mat aij, E;

  PetscFunctionBeginUser;
  PetscCall(MatConvert(A, MATAIJ, MAT_INITIAL_MATRIX, &aij));
  if (FlowHasOperators(flow)) PetscCall(FlowAddOperatorsTo(flow, aij));
  PetscCall(MatrixProject(aij, P, out));
  PetscCall(MatDestroy(&aij));
  PetscCall(create_rigid_diagonal(c, D, penalty ? penalty->whole : NULL, &E));
  PetscCall(MatAXPY(*out, 1, E, DIFFERENT_NONZERO_PATTERN));
  PetscCall(MatDestroy(&E));
  if (ContactCouplingAny(contact_coupling)) {
    PetscCall(ContactCouplingCreateMat(contact_coupling, &E));
    PetscCall(MatAXPY(*out, 1, E, DIFFERENT_NONZERO_PATTERN));
    PetscCall(MatDestroy(&E));
  }
  if (penalty) PetscCall(subtract_penalty_coupling(c, P, penalty, *out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* scale C of cells that give way (FlowAddVolume) */
static PetscErrorCode add_volumes(Flow flow, PetscReal scale, PetscInt nk, PetscInt start, Mat C)
{
  const FlowVolume *v;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; FlowGetVolume(flow, i, &v); i++)
    for (PetscInt e = 0; v->C && e < v->n * nk * nk; e++)
      PetscCall(MatSetValue(C, start + v->cell[e / (nk * nk)] * nk + e % (nk * nk) / nk,
                            start + v->cell[e / (nk * nk)] * nk + e % nk, scale * v->C[e], ADD_VALUES));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* C of shared cells times gap_fraction, plus 1e-10 of the size of the Schur complement, scale (rho c_t S_p^{-1} + mu
   theta M_p^{-1})^{-1} (Cahouet & Chabard 1988), which fixes undetermined pressures for a direct solver. The
   diagonal of S_p alone grows with the time step without bound. */
static PetscErrorCode create_pressure_block(Flow flow, Pressure pressure, PetscReal scale, PetscReal gap_fraction,
                                            MPI_Comm comm, const MeshLocal *l, Mat *C)
{
  const PetscInt        nk = l->dim + 1, np = l->ncell * nk;
  const PetscInt       *cell;
  const PetscReal      *block;
  PetscReal            *d, *one;
  PetscInt              n, ncompressible, start;
  const FlowParameters *par;
  const FlowStep       *step;
  Vec                   t;

  PetscFunctionBeginUser;
  PetscCall(VecCreateMPI(comm, np, PETSC_DETERMINE, &t));
  PetscCall(FlowGetParameters(flow, &par));
  PetscCall(FlowGetStep(flow, &step));
  PetscCall(PressureGetDiagonal(pressure, t));
  PetscCall(PressureGetShared(pressure, &n, &ncompressible, &cell, &block));
  PetscCall(MatCreateAIJ(comm, np, np, PETSC_DETERMINE, PETSC_DETERMINE, nk, NULL, 0, NULL, C));
  PetscCall(MatGetOwnershipRange(*C, &start, NULL));
  PetscCall(PetscMalloc1(np, &one));
  for (PetscInt i = 0; i < np; i++) one[i] = 1;
  PetscCall(VecReciprocal(t));
  PetscCall(VecScale(t, par->density * step->ct / scale));
  PetscCall(VecGetArray(t, &d));
  PetscCall(FlowPressureMassSolve(flow, par->matrix * step->theta / scale, one, d));
  for (PetscInt i = 0; i < np; i++) /* cells that are no part of the fluid have no mass, and a block of their own */
    PetscCall(MatSetValue(*C, start + i, start + i, d[i] > 0 ? 1e-10 / d[i] : 0, ADD_VALUES));
  PetscCall(VecRestoreArray(t, &d));
  PetscCall(PetscFree(one));
  PetscCall(VecDestroy(&t));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt e = 0; e < nk * nk; e++)
      PetscCall(MatSetValue(*C, start + cell[i] * nk + e / nk, start + cell[i] * nk + e % nk,
                            (i < ncompressible ? gap_fraction : 1) * block[i * nk * nk + e], ADD_VALUES));
  PetscCall(add_volumes(flow, scale, nk, start, *C));
  PetscCall(MatAssemblyBegin(*C, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*C, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AssembledCreateDivergence(Flow flow, Mat P, Mat *BP)
{
  Mat              B;
  Mesh             mesh;
  const MeshLocal *l;

  PetscFunctionBeginUser;
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(create_divergence_matrix(flow, PetscObjectComm((PetscObject)P), l, &B));
  PetscCall(MatMatMult(B, P, MAT_INITIAL_MATRIX, PETSC_DEFAULT, BP));
  PetscCall(MatDestroy(&B));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AssembledCreateWhole(Flow flow, Pressure pressure, PetscReal scale, PetscReal balance,
                                    PetscReal gap_fraction, Mat P, Mat Ar, Mat *out)
{
  Mat              Br, G, C, nest, block[4];
  Mesh             mesh;
  const MeshLocal *l;

  PetscFunctionBeginUser;
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(AssembledCreateDivergence(flow, P, &Br));
  PetscCall(MatTranspose(Br, MAT_INITIAL_MATRIX, &G));
  PetscCall(MatScale(G, -1));
  PetscCall(MatScale(Br, scale * balance));
  PetscCall(create_pressure_block(flow, pressure, scale, gap_fraction, PetscObjectComm((PetscObject)P), l, &C));
  PetscCall(MatScale(C, balance));
  block[0] = Ar;
  block[1] = G;
  block[2] = Br;
  block[3] = C;
  PetscCall(MatCreateNest(PetscObjectComm((PetscObject)P), 2, NULL, 2, NULL, block, &nest));
  PetscCall(MatConvert(nest, MATAIJ, MAT_INITIAL_MATRIX, out));
  PetscCall(MatDestroy(&nest));
  PetscCall(MatDestroy(&C));
  PetscCall(MatDestroy(&G));
  PetscCall(MatDestroy(&Br));
  PetscFunctionReturn(PETSC_SUCCESS);
}
