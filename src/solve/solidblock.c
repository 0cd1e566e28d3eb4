/* SolidBlock: see solidblock.h. */
#include "compat.h"
#include "solidblockimpl.h"
#include "assembled.h"

#define WORK_SPACE   200 /* per cent more than MUMPS expects: pivots of a saddle point move about */
#define PREFIX       "solid_"
#define ORDERING     "-solid_mat_mumps_icntl_7"
#define MINIMUM_FILL "2" /* approximate */

/* ---- which ---- */

/* Is there an unknown velocity in own slot i, of a node? */
static PetscBool has_unknown(FlowSolver fs, PetscInt i)
{
  const ConstraintView *c    = ConstraintGetView(fs->constraint);
  const PetscInt        node = i / fs->loc->dim;

  return (PetscBool)(!c->fixed[node] && c->node_body[node] < 0 && fs->weight[i] > 0);
}

/* at [nnode_all]: 1 at nodes of the block; own slots of u_r in `list`. Nodes that are tied to a rigid body are among
   them, as their velocity beside it is unknown. */
static PetscErrorCode mark_nodes(FlowSolver fs, PetscReal at[], PetscInt *n, PetscInt list[])
{
  const PetscInt dim = fs->loc->dim;
  PetscInt       start;
  PetscBool     *marked;

  PetscFunctionBeginUser;
  PetscCall(VecGetOwnershipRange(fs->vec.t_u, &start, NULL));
  PetscCall(PetscCalloc1(fs->loc->nnode, &marked));
  PetscCall(FlowMarkOperators(fs->flow, marked));
  *n = 0;
  for (PetscInt i = 0; i < fs->loc->nnode; i++) {
    at[i] = marked[i];
    for (PetscInt a = 0; a < dim; a++) at[i] = at[i] != 0 && has_unknown(fs, i * dim + a);
    for (PetscInt a = 0; a < dim && at[i] != 0; a++) list[(*n)++] = start + i * dim + a;
  }
  PetscCall(PetscFree(marked));
  PetscCall(MeshSyncNodes(fs->mesh, 1, at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is node i tied to a rigid body that is not in the block? S_p has its mass there, which the factors do not know, and a
   block that corrects too much makes the preconditioner of the pressure indefinite. */
static PetscBool is_foreign(FlowSolver fs, PetscInt i)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  const PetscInt        k = c->relative[i];

  return (PetscBool)(k >= 0 && ConstraintHasUnknown(c, k) && fs->solid->with[k] == 0);
}

/* Own pressures of the cells that have a node in the block, own slots of their nodes and of all of the block */
static PetscErrorCode mark_cells(FlowSolver fs, const PetscReal at[], PetscInt *nslot, PetscInt slot[], PetscInt *np,
                                 PetscInt pressure[])
{
  const MeshLocal *l   = fs->loc;
  const PetscInt   dim = l->dim, nk = dim + 1;
  PetscInt         start[2];
  PetscBool       *near;

  PetscFunctionBeginUser;
  PetscCall(VecGetOwnershipRange(fs->vec.t_u, &start[0], NULL));
  PetscCall(VecGetOwnershipRange(fs->vec.t_p, &start[1], NULL));
  PetscCall(PetscCalloc1(l->nnode_all, &near));
  *nslot = *np = 0;
  for (PetscInt cell = 0; cell < l->ncell_all; cell++) {
    const PetscInt *node = l->cell_node + cell * l->nb;
    PetscBool       any = PETSC_FALSE, foreign = PETSC_FALSE;

    for (PetscInt j = 0; j < l->nb; j++) any = (PetscBool)(any || at[node[j]] != 0);
    for (PetscInt j = 0; j < l->nb; j++) foreign = (PetscBool)(foreign || is_foreign(fs, node[j]));
    if (!any || foreign) continue;
    for (PetscInt j = 0; j < l->nb; j++) near[node[j]] = PETSC_TRUE;
    for (PetscInt k = 0; k < nk && cell < l->ncell; k++) pressure[(*np)++] = start[1] + cell * nk + k;
  }
  for (PetscInt i = 0; i < l->nnode * dim; i++)
    if (at[i / dim] != 0 || (near[i / dim] && has_unknown(fs, i))) slot[(*nslot)++] = start[0] + i;
  *nslot += SolidBlockListBodies(fs, start[0], slot + *nslot);
  PetscCall(PetscFree(near));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- factors ---- */

/* Of the factors of A, in space: MUMPS would order it by PORD where it has no other dissection, which takes ten times
   as long as the factors. PETSc sets MUMPS's default again as the analysis begins, so it is said by an option. */
static PetscErrorCode choose_ordering(Mat A, PetscBool *chosen)
{
  PetscBool given;

  PetscFunctionBeginUser;
  PetscCall(MatSetOptionsPrefixFactor(A, PREFIX));
  PetscCall(PetscOptionsHasName(NULL, NULL, ORDERING, &given));
  *chosen = (PetscBool)!given;
  if (*chosen) PetscCall(PetscOptionsSetValue(NULL, ORDERING, MINIMUM_FILL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode factorise(MPI_Comm comm, PetscInt dim, Mat A, KSP *ksp)
{
  PC        pc;
  Mat       factors;
  PetscBool ordering = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(KSPDestroy(ksp));
  PetscCall(KSPCreate(comm, ksp));
  PetscCall(KSPSetType(*ksp, KSPPREONLY));
  PetscCall(KSPGetPC(*ksp, &pc));
  PetscCall(PCSetType(pc, PCLU));
#if defined(PETSC_HAVE_MUMPS)
  PetscCall(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
  if (dim == 3) PetscCall(choose_ordering(A, &ordering));
#endif
  PetscCall(KSPSetErrorIfNotConverged(*ksp, PETSC_TRUE));
  PetscCall(KSPSetOperators(*ksp, A, A));
  PetscCall(PCFactorSetUpMatSolverType(pc));
  PetscCall(PCFactorGetMatrix(pc, &factors));
#if defined(PETSC_HAVE_MUMPS)
  PetscCall(MatMumpsSetIcntl(factors, 14, WORK_SPACE));
  PetscCall(MatMumpsSetIcntl(factors, 24, 1)); /* null pivots are left out: a constant pressure, inactive cells */
#endif
  PetscCall(KSPSetUp(*ksp));
  if (ordering) PetscCall(PetscOptionsClearValue(NULL, ORDERING));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* X of the slots: A within the block, the mass elsewhere, without what is between them */
static PetscErrorCode create_mass(FlowSolver fs, const PetscReal at[], Mat A, IS slots, Mat *X)
{
  const PetscInt *slot;
  const PetscInt  dim = fs->loc->dim;
  PetscInt        n, start, first, m = 0, *row;
  PetscReal      *d;
  Vec             diagonal;

  PetscFunctionBeginUser;
  PetscCall(VecGetOwnershipRange(fs->vec.t_u, &start, NULL));
  PetscCall(MatCreateSubMatrix(A, slots, slots, MAT_INITIAL_MATRIX, X));
  PetscCall(MatGetOwnershipRange(*X, &first, NULL));
  PetscCall(ISGetLocalSize(slots, &n));
  PetscCall(ISGetIndices(slots, &slot));
  PetscCall(PetscMalloc1(n, &row));
  PetscCall(MatCreateVecs(*X, &diagonal, NULL));
  PetscCall(MatGetDiagonal(*X, diagonal));
  PetscCall(VecGetArray(diagonal, &d));
  for (PetscInt e = 0; e < n; e++)
    if (slot[e] - start < fs->nodal && at[(slot[e] - start) / dim] == 0) {
      row[m++] = first + e;
      d[e]     = fs->step.scale / fs->weight[slot[e] - start];
    }
  PetscCall(VecRestoreArray(diagonal, &d));
  PetscCall(MatZeroRowsColumns(*X, m, row, 1, NULL, NULL));
  PetscCall(MatDiagonalSet(*X, diagonal, INSERT_VALUES));
  PetscCall(VecDestroy(&diagonal));
  PetscCall(PetscFree(row));
  PetscCall(ISRestoreIndices(slots, &slot));
  PetscCall(SolidBlockCoupleBodies(fs, slots, X));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Factors of [X, -B^T; scale B, 0] of the cells around the block */
static PetscErrorCode factorise_cells(SolidBlock b, FlowSolver fs, const PetscReal at[], Mat A, Mat P)
{
  Mat      B, block[4] = {NULL, NULL, NULL, NULL}, nest, J;
  IS       in[2], slots, pressures;
  PetscInt n[2] = {0, 0}, *slot, *pressure;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(fs->nur, &slot, fs->np, &pressure));
  PetscCall(mark_cells(fs, at, &n[0], slot, &n[1], pressure));
  PetscCall(ISCreateGeneral(fs->comm, n[0], slot, PETSC_USE_POINTER, &slots));
  PetscCall(ISCreateGeneral(fs->comm, n[1], pressure, PETSC_USE_POINTER, &pressures));
  PetscCall(create_mass(fs, at, A, slots, &block[0]));
  PetscCall(AssembledCreateDivergence(fs->flow, P, &B));
  PetscCall(MatCreateSubMatrix(B, pressures, slots, MAT_INITIAL_MATRIX, &block[2]));
  PetscCall(MatDestroy(&B));
  PetscCall(MatTranspose(block[2], MAT_INITIAL_MATRIX, &block[1]));
  PetscCall(MatScale(block[1], -1));
  PetscCall(MatScale(block[2], fs->step.scale));
  PetscCall(MatCreateNest(fs->comm, 2, NULL, 2, NULL, block, &nest));
  PetscCall(MatConvert(nest, MATAIJ, MAT_INITIAL_MATRIX, &J));
  PetscCall(factorise(fs->comm, fs->loc->dim, J, &b->cells));
  PetscCall(MatCreateVecs(J, &b->f, &b->g));
  PetscCall(MatNestGetISs(nest, in, NULL));
  PetscCall(VecScatterCreate(fs->vec.t_p, pressures, b->f, in[1], &b->to_cells));
  PetscCall(MatDestroy(&J));
  PetscCall(MatDestroy(&nest));
  PetscCall(ISDestroy(&slots));
  PetscCall(ISDestroy(&pressures));
  PetscCall(PetscFree2(slot, pressure));
  for (PetscInt i = 0; i < 3; i++) PetscCall(MatDestroy(&block[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode clear(SolidBlock b)
{
  PetscFunctionBeginUser;
  PetscCall(VecScatterDestroy(&b->to_nodes));
  PetscCall(VecScatterDestroy(&b->to_cells));
  PetscCall(ISDestroy(&b->in_nodes));
  PetscCall(VecDestroy(&b->x));
  PetscCall(VecDestroy(&b->y));
  PetscCall(VecDestroy(&b->f));
  PetscCall(VecDestroy(&b->g));
  PetscCall(VecDestroy(&b->t));
  PetscCall(PetscFree2(b->inside, b->with));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what they do ---- */

PetscErrorCode SolidBlockSolve(SolidBlock b, Vec x, Vec y)
{
  PetscFunctionBeginUser;
  PetscCall(VecScatterBegin(b->to_nodes, x, b->x, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(VecScatterEnd(b->to_nodes, x, b->x, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(KSPSolve(b->nodes, b->x, b->y));
  PetscCall(VecScatterBegin(b->to_nodes, b->y, y, INSERT_VALUES, SCATTER_REVERSE));
  PetscCall(VecScatterEnd(b->to_nodes, b->y, y, INSERT_VALUES, SCATTER_REVERSE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool SolidBlockHas(SolidBlock b, PetscInt i)
{
  return b->inside[i];
}

/* ---- life cycle ---- */

PetscErrorCode SolidBlockDestroy(SolidBlock *block)
{
  SolidBlock b = *block;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(clear(b));
  PetscCall(KSPDestroy(&b->nodes));
  PetscCall(KSPDestroy(&b->cells));
  for (PetscInt i = 0; i < 3; i++) PetscCall(VecDestroy(&b->p[i]));
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(VecDestroy(&b->u[i]));
    PetscCall(PCDestroy(&b->pc[i]));
    PetscCall(PCDestroy(&b->inner[i]));
  }
  PetscCall(MatDestroy(&b->S_p));
  PetscCall(PetscFree(*block));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The velocity's matrix with P, as far as it is the block's: of the nodes in it and those that its bodies move. The
   caller destroys both. */
static PetscErrorCode assemble_velocity(FlowSolver fs, Mat *A, Mat *P)
{
  Mat        all;
  PetscBool *wanted;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(fs->loc->nnode, &wanted));
  PetscCall(PetscArraycpy(wanted, fs->solid->inside, fs->loc->nnode));
  SolidBlockMarkMoved(fs, wanted);
  PetscCall(AssembledCreateNodes(fs->flow, wanted, &all));
  PetscCall(PetscFree(wanted));
  PetscCall(ConstraintCreateMat(fs->constraint, P));
  PetscCall(AssembledCreateVelocity(fs->flow, fs->constraint, all, *P, fs->body.D,
                                    FlowSolverHasPenalty(fs) ? fs->body.penalty : NULL, fs->body.contact_coupling, A));
  PetscCall(MatDestroy(&all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Are there operators without an entry that is not 0, on all ranks? n: own slots of the block */
static PetscErrorCode is_empty(FlowSolver fs, PetscInt n, PetscBool *empty)
{
  PetscFunctionBeginUser;
  *empty = (PetscBool)(n == 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, empty, 1, COMPAT_MPI_BOOL, MPI_LAND, fs->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode remove_block(FlowSolver fs)
{
  PetscFunctionBeginUser;
  PetscCall(SolidBlockRestorePC(fs));
  PetscCall(SolidBlockDestroy(&fs->solid));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* at, n, list: see mark_nodes */
static PetscErrorCode update_block(FlowSolver fs, const PetscReal at[], PetscInt n, PetscInt list[])
{
  SolidBlock b;
  PetscInt   start;
  Mat        A, P, Ab;

  PetscFunctionBeginUser;
  if (!fs->solid) PetscCall(PetscNew(&fs->solid));
  b = fs->solid;
  PetscCall(clear(b));
  PetscCall(SolidBlockFindBodies(fs, at));
  PetscCall(VecGetOwnershipRange(fs->vec.t_u, &start, NULL));
  n += SolidBlockListBodies(fs, start, list + n);
  PetscCall(ISCreateGeneral(fs->comm, n, list, PETSC_COPY_VALUES, &b->in_nodes));
  PetscCall(assemble_velocity(fs, &A, &P));
  PetscCall(SolidBlockReduceBodies(fs, A));
  PetscCall(MatCreateSubMatrix(A, b->in_nodes, b->in_nodes, MAT_INITIAL_MATRIX, &Ab));
  PetscCall(factorise(fs->comm, fs->loc->dim, Ab, &b->nodes));
  PetscCall(MatCreateVecs(Ab, &b->x, &b->y));
  PetscCall(VecScatterCreate(fs->vec.t_u, b->in_nodes, b->x, NULL, &b->to_nodes));
  if (FlowHasStiffOperators(fs->flow)) PetscCall(factorise_cells(b, fs, at, A, P));
  else PetscCall(KSPDestroy(&b->cells));
  PetscCall(MatDestroy(&Ab));
  PetscCall(MatDestroy(&A));
  PetscCall(MatDestroy(&P));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidBlockUpdate(FlowSolver fs)
{
  PetscInt   n = 0, *list;
  PetscReal *at;
  PetscBool  empty;

  PetscFunctionBeginUser;
  if (fs->set.need_whole || fs->step.steady || !FlowHasOperators(fs->flow)) {
    PetscCall(remove_block(fs));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscCalloc1(fs->loc->nnode_all, &at));
  PetscCall(PetscMalloc1(fs->nur, &list));
  PetscCall(mark_nodes(fs, at, &n, list));
  PetscCall(is_empty(fs, n, &empty));
  if (empty) PetscCall(remove_block(fs));
  else PetscCall(update_block(fs, at, n, list));
  PetscCall(PetscFree(list));
  PetscCall(PetscFree(at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidBlockRestorePC(FlowSolver fs)
{
  SolidBlock b = fs->solid;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 2 && b; i++) {
    if (!b->inner[i]) continue;
    PetscCall(KSPSetPC(fs->sub[i], b->inner[i]));
    PetscCall(PCDestroy(&b->inner[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
