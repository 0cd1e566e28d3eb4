/* Pressure: life cycle, update and two levels (see pressure.h). */
#include "compat.h"
#include "pressureimpl.h"
#include "blockgs.h"
#include "base/array.h"
#include "base/log.h"
#include "base/opt.h"
#include "flow/device.h"

/* Tolerance from which the operator in single precision does: its error is some 1e-7 of its largest entries. Cells that
   bodies touch, whose entries may be smaller than that, want it as it is. */
#define MIN_SINGLE 1e-4

PetscErrorCode PressureHasShared(Pressure p, PetscBool *any)
{
  PetscFunctionBeginUser;
  *any = p->gap.any;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureGetShared(Pressure p, PetscInt *n, PetscInt *ncompressible, const PetscInt *cell[],
                                 const PetscReal *block[])
{
  PetscFunctionBeginUser;
  *n             = p->gap.n;
  *ncompressible = p->gap.ncompressible;
  *cell          = p->gap.cell;
  *block         = p->gap.block;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is cell e of the fluid's pressure? */
static PetscBool is_live(Pressure p, PetscInt e)
{
  return (PetscBool) !(p->inactive.cell_material && p->inactive.cell_material[e] < 0);
}

PetscErrorCode PressureRemoveConstant(Pressure p, PetscReal pressure[])
{
  PetscReal sum[2] = {0, 0};

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < p->loc->ncell; e++) {
    if (!is_live(p, e)) continue;
    sum[0] += pressure[e * p->nk];
    sum[1] += 1;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, p->comm));
  for (PetscInt e = 0; e < p->loc->ncell; e++)
    if (is_live(p, e)) pressure[e * p->nk] -= sum[0] / sum[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_constant(Pressure p)
{
  Vec        constant;
  PetscReal *a;

  PetscFunctionBeginUser;
  if (!p->floating) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatNullSpaceDestroy(&p->constant));
  PetscCall(MatCreateVecs(p->nodes.shell, &constant, NULL));
  PetscCall(VecGetArrayWrite(constant, &a));
  for (PetscInt i = 0; i < p->loc->ncell * p->nk; i++) a[i] = i % p->nk == 0 && is_live(p, i / p->nk);
  PetscCall(VecRestoreArrayWrite(constant, &a));
  PetscCall(VecNormalize(constant, NULL));
  PetscCall(MatNullSpaceCreate(p->comm, PETSC_FALSE, 1, &constant, &p->constant));
  PetscCall(VecDestroy(&constant));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The operator knows that constants are its null space; the matrix, which smoothers use, does not, to save their
   projections. */
static PetscErrorCode create_shell(Pressure p)
{
  const PetscInt n = p->loc->ncell * p->nk;

  PetscFunctionBeginUser;
  PetscCall(MatCreateShell(p->comm, n, n, PETSC_DETERMINE, PETSC_DETERMINE, p, &p->nodes.shell));
  PetscCall(MatShellSetOperation(p->nodes.shell, MATOP_MULT, (void (*)(void))PressureMult));
  PetscCall(DeviceVecSetShell(FlowGetQueue(p->flow), p->nodes.shell));
  PetscCall(MatSetOption(p->nodes.shell, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(find_constant(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- two levels ---- */

/* Changes of weights are added, so a moving body costs what it touches. */
static PetscErrorCode update_coarse(Pressure p, const PetscReal weight[])
{
  const MeshLocal        *l   = p->loc;
  const PetscInt          dim = l->dim;
  const PetscReal *const *b;

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

/* Down: one forward block Gauss-Seidel sweep, up: one backward sweep; together symmetric, at the cost of one and a half
   products with the matrix. Options win. */
static PetscErrorCode set_smoothers(Pressure p, PC pc)
{
  const MatSORType sweep[2] = {SOR_LOCAL_FORWARD_SWEEP, SOR_LOCAL_BACKWARD_SWEEP};
  KSP              ksp[2];

  PetscFunctionBeginUser;
  PetscCall(PCMGGetSmootherDown(pc, 1, &ksp[0]));
  PetscCall(PCMGGetSmootherUp(pc, 1, &ksp[1]));
  for (int i = 0; i < 2; i++) {
    PC smoother;

    PetscCall(KSPSetOperators(ksp[i], p->nodes.matrix, p->nodes.matrix));
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
  if (p->coarse && !p->cycle.own) PetscCall(PressureTakeCycle(p, pc));
  PetscCheck(p->cycle.own || !FlowGetQueue(p->flow), p->comm, PETSC_ERR_SUP,
             "Option -device: a device carries the pressure's own preconditioner alone: leave -flow_fieldsplit_pressure_pc_type and -flow_fieldsplit_pressure_mg_ options out");
  if (p->cycle.own && PressureIsOnDevice(p)) PetscCall(PressureSetUpDevice(p));
  if (p->cycle.own && (!PressureIsOnDevice(p) || p->device->cycle.ranks.ctx))
    PetscCall(CoarseSetUp(p->coarse, "flow_fieldsplit_pressure_mg_coarse_"));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCMG, &mg));
  if (!mg || !p->coarse) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PCMGGetLevels(pc, &levels));
  PetscCheck(levels == 2, p->comm, PETSC_ERR_USER_INPUT,
             "-flow_fieldsplit_pressure_pc_mg_levels %" PetscInt_FMT
             ": the pressure has exactly 2 levels; more come from -flow_fieldsplit_pressure_mg_coarse_pc_type",
             levels);
  PetscCall(PCSetUseAmat(pc, PETSC_FALSE)); /* the matrix on both levels, not the operator with the bodies' part */
  PetscCall(CoarseSetUpPC(p->coarse, pc));
  if (!p->cycle.smoothers_set) PetscCall(set_smoothers(p, pc));
  p->cycle.smoothers_set = PETSC_TRUE;
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
  /* GAMG chooses its levels, and later releases of PETSc refuse a number */
  if (two_level) PetscCall(OptDefault(PREFIX "pc_mg_levels", "2"));
#if defined(PETSC_HAVE_HYPRE)
  PetscCall(OptDefault(PREFIX "mg_coarse_pc_type", "hypre"));
  /* elimination would divide by round-off where the pressure is known up to a constant */
  PetscCall(OptDefault(BOOMERAMG "relax_type_coarse", "symmetric-SOR/Jacobi"));
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
  PetscBool two_level;
  PetscReal keep = 0.03, rtol = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&p));
  p->flow       = flow;
  p->constraint = constraint;
  PetscCall(FlowGetMesh(flow, &p->mesh));
  PetscCall(MeshGetLocal(p->mesh, &p->loc));
  PetscCall(MeshGetComm(p->mesh, &p->comm));
  p->nr      = ConstraintGetView(constraint)->nr;
  p->nbodies = ConstraintGetView(constraint)->nall;
  p->nk      = p->loc->dim + 1;
  p->eps     = 1e-6;
  PetscCall(OptReal("-flow_pressure_regularisation", &p->eps));
  PetscCall(PetscCalloc2(p->loc->nnode_all * p->loc->dim, &p->weight, ConstraintGetView(constraint)->capacity * p->nr,
                         &p->cut.work));
  PetscCall(PetscCalloc3(p->loc->ncell, &p->list.stamp, p->loc->ncell, &p->list.touched, p->loc->ncell, &p->list.cell));
  PetscCall(PetscCalloc1(ConstraintGetView(constraint)->capacity, &p->inactive.resolved));
  p->gap.eps = 1e-3;
  PetscCall(OptReal("-flow_pressure_gap_compressibility", &p->gap.eps));
  PetscCall(PetscOptionsGetReal(NULL, NULL, "-flow_fieldsplit_pressure_ksp_rtol", &rtol, NULL));
  p->single = (PetscBool)(rtol >= MIN_SINGLE);
  PetscCall(find_two_level(&two_level));
  PetscCall(ConditionsPressureIsFloating(FlowConditions(flow), &p->floating));
  if (two_level) {
    PetscCall(OptReal("-flow_pressure_reuse", &keep));
    PetscCall(CoarseCreate(p->mesh, p->nk, p->floating, keep, &p->coarse));
  }
  PetscCall(PressureCreateMatrix(p));
  PetscCall(create_shell(p));
  *pressure = p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureDestroy(Pressure *pressure)
{
  Pressure p = *pressure;

  PetscFunctionBeginUser;
  if (!p) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PressureDestroyDevice(p));
  PetscCall(MatDestroy(&p->nodes.matrix));
  PetscCall(MatDestroy(&p->nodes.shell));
  PetscCall(PetscFree(p->nodes.overlap));
  PetscCall(PetscFree(p->cycle.residual));
  PetscCall(MatNullSpaceDestroy(&p->constant));
  PetscCall(CoarseDestroy(&p->coarse));
  PetscCall(PetscFree(p->nodes.neighbour_ptr));
  PetscCall(PetscFree2(p->nodes.where, p->nodes.slot));
  PetscCall(PetscFree(p->nodes.neighbour));
  PetscCall(PetscFree(p->nodes.row));
  PetscCall(PetscFree2(p->weight, p->cut.work));
  PetscCall(PetscFree(p->interior.cell));
  PetscCall(PetscFree(p->cut.cell));
  PetscCall(PetscFree(p->cut.body));
  PetscCall(PetscFree(p->cut.local));
  PetscCall(PetscFree(p->cut.w));
  PetscCall(PetscFree3(p->list.stamp, p->list.touched, p->list.cell));
  PetscCall(PetscFree(p->inactive.resolved));
  PetscCall(PetscFree(p->inactive.changed));
  PetscCall(PetscFree(p->gap.cell));
  PetscCall(PetscFree(p->gap.block));
  PetscCall(PetscFree(*pressure));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal PressureGetRegularisation(Pressure p, PetscInt k)
{
  return p->inactive.resolved[k] ? 0 : p->eps;
}

PetscErrorCode PressureForgetCells(Pressure p, PetscInt n, const PetscInt cells[])
{
  const MeshLocal        *l   = p->loc;
  const PetscInt          dim = l->dim;
  const PetscReal *const *b;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(p->flow, &b));
  if (p->coarse) PetscCall(CoarseAddCells(p->coarse, -1, p->gap.ncompressible, p->gap.cell, p->gap.block));
  p->gap.ncompressible = 0; /* the list stays: rows of these cells are to be built anew */
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
  if (p->coarse) PetscCall(CoarseFlush(p->coarse));
  PetscCall(ArrayReserve(p->inactive.nchanged + n, &p->inactive.capacity, &p->inactive.changed,
                         sizeof(*p->inactive.changed), NULL));
  for (PetscInt e = 0; e < n; e++) p->inactive.changed[p->inactive.nchanged++] = cells[e];
  p->refresh = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureGetWeight(Pressure p, const PetscReal *weight[])
{
  PetscFunctionBeginUser;
  *weight = p->weight;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureSetInactive(Pressure p, const PetscInt cell_material[], const PetscBool resolved[])
{
  PetscFunctionBeginUser;
  p->inactive.cell_material = cell_material;
  PetscCall(PetscArraycpy(p->inactive.resolved, resolved, ConstraintGetView(p->constraint)->nbodies));
  PetscCall(find_constant(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureUpdate(Pressure p, const PetscReal weight[], const PetscReal fraction[],
                              const PetscReal mass_inverse[])
{
  const PetscBool rows = (PetscBool)(p->nodes.block_gs && !PressureMakesRowsOnDevice(p)); /* of the host */
  PetscBool       same, flags[2];
  PetscInt        nchanged, *changed;
  Shared          old;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_PRES_BUILD, 0, 0, 0, 0));
  PetscCall(PressureKeepShared(p, &old));
  if (p->refresh && p->coarse)
    PetscCall(CoarseUpdateCells(p->coarse, p->inactive.nchanged, p->inactive.changed, p->inactive.cell_material));
  p->refresh           = PETSC_FALSE;
  p->inactive.nchanged = 0;
  PetscCall(PetscArraycmp(p->weight, weight, p->loc->nnode_all * p->loc->dim, &same));
  flags[0] = (PetscBool)(!same || p->gap.n);
  if (p->nbodies) PetscCall(PressureFindShared(p));
  PetscCall(PressureChangeShared(p, &old, &nchanged, &changed));
  flags[0] = (PetscBool)(flags[0] || p->gap.n);
  flags[1] = (PetscBool)(p->gap.ncompressible > 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, flags, 2, COMPAT_MPI_BOOL, MPI_LOR, p->comm));
  p->gap.any = flags[1];
  if (flags[0]) {
    PetscCall(PressureUpdateMatrix(p, weight, nchanged, changed));
    if (p->coarse) PetscCall(update_coarse(p, weight));
    PetscCall(PetscArraycpy(p->weight, weight, p->loc->nnode_all * p->loc->dim));
  }
  PetscCall(PetscFree(changed));
  PetscCall(MatSetNullSpace(p->nodes.shell, p->gap.any ? NULL : p->constant)); /* C sees constants */
  /* makes every inner right-hand side consistent */
  PetscCall(MatSetTransposeNullSpace(p->nodes.shell, p->gap.any ? NULL : p->constant));
  if (p->nbodies) {
    PetscCall(PressureFindInterior(p));
    PetscCall(PressureFindCut(p, fraction, mass_inverse));
    if (rows && p->single) PetscCall(BlockGSSetFine(p->nodes.matrix, p->list.ntouched, p->list.touched));
    if (rows)
      PetscCall(BlockGSSetLowRank(p->nodes.matrix, ConstraintGetView(p->constraint)->shared_reduction,
                                  ConstraintGetView(p->constraint)->nlocal, p->cut.n, p->cut.cell, p->cut.local,
                                  p->cut.w));
    if (p->coarse) PetscCall(CoarseSetBodies(p->coarse, p->constraint, p->cut.n, p->cut.cell, p->cut.body, p->cut.w));
  }
  PetscCall(MatAssemblyBegin(p->nodes.shell, MAT_FINAL_ASSEMBLY)); /* its values have changed */
  PetscCall(MatAssemblyEnd(p->nodes.shell, MAT_FINAL_ASSEMBLY));
  PetscCall(PetscLogEventEnd(TB_PRES_BUILD, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureSetContactCoupling(Pressure p, ContactCoupling contact_coupling)
{
  PetscFunctionBeginUser;
  p->contact_coupling = contact_coupling;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureIsSingular(Pressure p, PetscBool *singular)
{
  PetscFunctionBeginUser;
  *singular = (PetscBool)(p->floating && !p->gap.any);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureMakeConsistent(Pressure p, PetscReal r[])
{
  const MeshLocal *l      = p->loc;
  PetscReal        sum[2] = {0, 0};

  PetscFunctionBeginUser;
  if (PressureIsOnDevice(p)) {
    PetscCall(PressureMakeConsistentOnDevice(p, r));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt i = 0; i < p->interior.n; i++) PetscCall(PetscArrayzero(r + p->interior.cell[i] * p->nk, p->nk));
  if (!p->floating || p->gap.any) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt c = 0; c < l->ncell; c++) {
    if (p->inactive.cell_material && p->inactive.cell_material[c] < 0) continue;
    sum[0] += r[c * p->nk];
    sum[1]++;
  }
  sum[1] -= (PetscReal)p->interior.n;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, p->comm));
  if (sum[1] <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt c = 0; c < l->ncell; c++)
    if (!(p->inactive.cell_material && p->inactive.cell_material[c] < 0)) r[c * p->nk] -= sum[0] / sum[1];
  for (PetscInt i = 0; i < p->interior.n; i++) r[p->interior.cell[i] * p->nk] = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureGetMats(Pressure p, Mat *operator, Mat * matrix)
{
  PetscFunctionBeginUser;
  *operator= p->nodes.shell;
  *matrix = p->nodes.matrix;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureGetDiagonal(Pressure p, Vec d)
{
  PetscFunctionBeginUser;
  if (p->nodes.block_gs) PetscCall(BlockGSGetDiagonal(p->nodes.matrix, d));
  else PetscCall(MatGetDiagonal(p->nodes.matrix, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}
