/* FlowSolver: see system.h for the system and the method.

   Layout of all vectors of the system: on every rank the reduced velocity (own nodes x dim, then the rigid slots of own
   bodies), then the pressure of own cells. */
#include "compat.h"
#include "impl.h"
#include "solidblock.h"
#include "base/log.h"
#include "base/opt.h"
#include "assembled.h"
#include "krylov/lean.h"

/* Weight of the continuity rows, see system.h, in mean cell sizes (runs/studies/flow-solver, "Rows of one unit") */
#define BALANCE    12
#define KEPT_ITS   7 /* see keeps_factor */
#define KEPT_STEPS 40
#define KEPT_WAIT  8
#define RESTART    60 /* directions of the outer iteration before it starts anew */

/* ---- numeric set-up ---- */

static PetscErrorCode find_lowest_viscosity(FlowSolver fs, const PetscReal m[], const PetscReal mu[])
{
  PetscFunctionBeginUser;
  fs->step.mu_min = PETSC_MAX_REAL;
  for (PetscInt i = 0; i < fs->loc->nnode; i++)
    if (ConstraintGetView(fs->constraint)->node_body[i] < 0 && m[i] > 0)
      fs->step.mu_min = PetscMin(fs->step.mu_min, mu[i]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &fs->step.mu_min, 1, MPIU_REAL, MPIU_MIN, fs->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inverse diagonal of A (zero at inert slots); m: lumped mass */
static PetscErrorCode invert_diagonal(FlowSolver fs, const PetscReal m[])
{
  const ConstraintView *c   = ConstraintGetView(fs->constraint);
  const PetscInt        dim = fs->loc->dim;
  PetscReal            *d;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(fs->loc->nnode_all, &d));
  PetscCall(FlowGetDiagonal(fs->flow, d));
  for (PetscInt i = 0; i < fs->nodal; i++) {
    const PetscReal min = MIN_DIAGONAL * fs->step.scale * m[i / dim];

    fs->diagonal_inverse[i] = d[i / dim] != 0 ? 1 / PetscMax(d[i / dim], min) : 0;
  }
  for (PetscInt j = 0; j < c->inert.n; j++) fs->diagonal_inverse[c->inert.slot[j]] = 0;
  PetscCall(PetscFree(d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inverse diagonal of A, unless a device has its own, and inverse lumped mass of M_r with softness at body nodes,
   weight [nnode_all][dim], which PressureUpdate compares with the last */
static PetscErrorCode set_up_diagonals(FlowSolver fs, PetscReal weight[])
{
  const ConstraintView *c   = ConstraintGetView(fs->constraint);
  const MeshLocal      *l   = fs->loc;
  const PetscInt        dim = l->dim;
  const unsigned char  *fixed;
  const PetscReal      *m, *mu, *more;
  const PetscReal       tol_weight    = FlowSolverTwoStages(fs) ? TWO_STAGE_WEIGHT : 1;
  PetscReal             penalty_bound = 1;
  PetscBool             weighted;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(fs->flow), &fixed, NULL));
  PetscCall(FlowGetInertialMass(fs->flow, &m));
  PetscCall(FlowGetViscosity(fs->flow, NULL, &mu));
  /* a projection has no commutator */
  weighted = (PetscBool)(mu && (fs->step.steady || FlowSolverTwoStages(fs) || fs->choice.schur == SCHUR_COMMUTATOR));
  if (weighted) PetscCall(find_lowest_viscosity(fs, m, mu));
  /* strong nodes among soft ones are to yield less than these */
  if (FlowSolverHasPenalty(fs)) penalty_bound = 1 + fs->body.penalty->strength / fs->step.scale;
  if (!FlowSolverIsOnDevice(fs)) PetscCall(invert_diagonal(fs, m));
  PetscCall(FlowGetOperatorDiagonal(fs->flow, &more));
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    const PetscReal mass_weight = weighted ? FlowSolverMassWeight(fs, mu[i]) : 1;
    /* the penalty goes with mu, and in a time step is taken as it is */
    const PetscReal penalty = FlowSolverHasPenalty(fs)
                              ? tol_weight * fs->body.penalty->weight[i] /
                                  (fs->step.scale * mass_weight * (fs->step.steady ? mass_weight : 1))
                              : 0;
    const PetscReal mass    = c->node_body[i] >= 0 ? m[i] : m[i] + penalty + (more ? more[i] / fs->step.scale : 0);
    const PetscReal w       = mass > 0 ? 1 / mass : 0; /* no mass: buried in an inactive cell */

    if (fs->body.fraction) fs->body.fraction[i] = c->node_body[i] >= 0 ? 1 : penalty * w;
    for (PetscInt a = 0; a < dim; a++)
      weight[i * dim + a] = (c->node_body[i] >= 0
                               ? w / penalty_bound * PressureGetRegularisation(fs->pressure, c->node_body[i])
                             : (fixed[i] >> a) & 1 ? 0
                                                   : w) /
                            mass_weight;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What approximates the inverse of the velocity operator */
static PetscErrorCode update_relaxation(FlowSolver fs)
{
  Mat S = NULL;

  PetscFunctionBeginUser;
  if (fs->choice.smoother != RELAX_JACOBI) PetscCall(FlowGetMatrix(fs->flow, &S));
  PetscCall(PetscLogEventBegin(TB_VEL_FACTOR, 0, 0, 0, 0));
  PetscCall(RelaxUpdate(fs->smoother, fs->choice.smoother, S, fs->diagonal_inverse));
  PetscCall(PetscLogEventEnd(TB_VEL_FACTOR, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update_blocks(FlowSolver fs)
{
  const ConstraintView *c  = ConstraintGetView(fs->constraint);
  const PetscInt        nr = fs->nr, nn = nr * nr;
  const PenaltyTerm    *penalty = FlowSolverHasPenalty(fs) ? fs->body.penalty : NULL;
  const PetscReal      *stiff;

  PetscFunctionBeginUser;
  if (FlowSolverCouplesOnDevice(fs)) {
    PetscCall(FlowSolverListPenaltyOnDevice(fs));
    PetscCall(FlowSolverCoupleOnDevice(fs, penalty, &stiff));
  } else {
    PetscCall(FlowSolverGatherRows(fs));
    PetscCall(BodyCouplingUpdate(fs->body.coupling, fs->body.near, penalty, &stiff));
  }
  PetscCall(BodyBlocksInvert(fs->flow, fs->constraint, fs->body.fraction, stiff, penalty, fs->body.D, fs->step.scale,
                             fs->body.body_inverse, fs->body.mass_inverse));
  PetscCall(
    ContactCouplingUpdate(fs->body.contact_coupling, fs->body.body_inverse, fs->body.mass_inverse, fs->step.scale));
  for (PetscInt e = 0; e < c->nown * nn; e++) {
    const PetscInt k = c->own[e / nn], i = e % nn / nr, j = e % nr;

    if (ConstraintIsUnknown(c, k, i) && ConstraintIsUnknown(c, k, j))
      fs->body.body_inverse[e] /= ConstraintSlotUnit(c, k, i) * ConstraintSlotUnit(c, k, j);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* With operators of others the factors of a step before do for this one, while few iterations are enough: what a
   factorisation costs is some 15 iterations (runs/studies/elastic). Others factorise in every step. */
static PetscBool keeps_factor(FlowSolver fs)
{
  return (PetscBool)(fs->set.need_whole && fs->op.whole && FlowHasOperators(fs->flow) && !fs->step.steady &&
                     fs->kept.scale == fs->step.scale && fs->kept.wait <= 0 && fs->kept.its <= KEPT_ITS &&
                     fs->kept.age < KEPT_STEPS);
}

static PetscErrorCode assemble_on_demand(FlowSolver fs)
{
  Mat       P;
  PetscBool keeps;

  PetscFunctionBeginUser;
  if (!fs->set.need_Ar && !fs->set.need_whole) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowSolverUpdateMatrix(fs));
  keeps = keeps_factor(fs);
  if (fs->set.need_whole) PetscCall(KSPSetReusePreconditioner(fs->ksp, keeps));
  fs->kept.age++;
  if (keeps) PetscFunctionReturn(PETSC_SUCCESS);
  fs->kept = (KeptFactor){.wait = fs->kept.wait - 1, .scale = fs->step.scale};
  PetscCall(MatDestroy(&fs->op.Ar_assembled));
  PetscCall(MatDestroy(&fs->op.whole));
  PetscCall(ConstraintCreateMat(fs->constraint, &P));
  PetscCall(AssembledCreateVelocity(fs->flow, fs->constraint, fs->op.A, P, fs->body.D,
                                    FlowSolverHasPenalty(fs) ? fs->body.penalty : NULL, fs->body.contact_coupling,
                                    &fs->op.Ar_assembled));
  if (fs->set.need_whole)
    PetscCall(AssembledCreateWhole(fs->flow, fs->pressure, fs->step.scale, fs->step.continuity_scale,
                                   FlowSolverGapFraction(fs), P, fs->op.Ar_assembled, &fs->op.whole));
  PetscCall(MatDestroy(&P));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- creation ---- */

static PetscErrorCode remove_constant(MatNullSpace space, Vec x, void *solver)
{
  FlowSolver fs = (FlowSolver)solver;
  PetscReal *a;

  PetscFunctionBeginUser;
  (void)space;
  if (FlowSolverIsOnDevice(fs)) {
    PetscCall(FlowSolverRemoveConstantOnDevice(fs, x));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(VecGetArray(x, &a));
  PetscCall(PressureRemoveConstant(fs->pressure, a + fs->nur));
  PetscCall(VecRestoreArray(x, &a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_operators(FlowSolver fs)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  PetscCall(DeviceVecCreate(fs->comm, q, 1, fs->nur + fs->np, PETSC_FALSE, &fs->vec.x));
  PetscCall(VecDuplicate(fs->vec.x, &fs->vec.b));
  PetscCall(VecDuplicate(fs->vec.x, &fs->vec.r));
  PetscCall(VecDuplicate(fs->vec.x, &fs->vec.y));
  PetscCall(DeviceVecCreate(fs->comm, q, 1, fs->nur, PETSC_FALSE, &fs->vec.t_u));
  PetscCall(VecDuplicate(fs->vec.t_u, &fs->vec.t_u2));
  PetscCall(DeviceVecCreate(fs->comm, q, 1, fs->np, PETSC_FALSE, &fs->vec.t_p));
  PetscCall(VecDuplicate(fs->vec.t_p, &fs->vec.t_p2));
  PetscCall(VecDuplicate(fs->vec.t_p, &fs->vec.x_p));
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(DeviceVecCreate(fs->comm, q, 1, i ? fs->np : fs->nur, PETSC_TRUE, &fs->vec.from[i]));
    PetscCall(DeviceVecCreate(fs->comm, q, 1, i ? fs->np : fs->nur, PETSC_TRUE, &fs->vec.to[i]));
  }
  PetscCall(DeviceVecCreate(fs->comm, NULL, fs->loc->dim, fs->nodal, PETSC_TRUE, &fs->vec.xn));
  PetscCall(DeviceVecCreate(fs->comm, NULL, fs->loc->dim, fs->nodal, PETSC_TRUE, &fs->vec.yn));
  PetscCall(FlowSolverCreateShells(fs));
  PetscCall(MatNullSpaceCreate(fs->comm, PETSC_FALSE, 0, NULL, &fs->op.constant_pressure));
  PetscCall(MatNullSpaceSetFunction(fs->op.constant_pressure, remove_constant, fs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_solvers(FlowSolver fs)
{
  PetscBool given, single = PETSC_TRUE;
  PC        pc;

  PetscFunctionBeginUser;
  PetscCall(LeanRegister());
  PetscCall(KSPCreate(fs->comm, &fs->ksp));
  PetscCall(KSPSetOptionsPrefix(fs->ksp, "flow_"));
  PetscCall(FlowSolverSetTest(fs));
  PetscCall(KSPGetPC(fs->ksp, &pc));
  if (!fs->set.need_whole) PetscCall(FlowSolverCreateProjection(fs, pc));
  PetscCall(KSPSetFromOptions(fs->ksp));
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_ksp_gmres_restart", &given));
  if (!given) PetscCall(KSPGMRESSetRestart(fs->ksp, RESTART));
  PetscCall(FlowSolverRemarkMethod(fs));
  PetscCall(OptBool("-flow_krylov_single", &single));
  PetscCall(LeanSetPrecision(fs->ksp, single, fs->np));
  if (fs->sub[0]) PetscCall(LeanSetPrecision(fs->sub[0], single, 0));
  /* a step's right-hand side, which nobody wants afterwards, unless MUMPS asks for more room */
  if (!fs->set.need_whole) PetscCall(LeanSetWork(fs->ksp, fs->vec.r, NULL));
  PetscCall(KSPGetTolerances(fs->ksp, &fs->stop.rtol, NULL, NULL, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Edge of a cube that is this share of the domain's box: nothing that moving nodes, a restart or the number of ranks
   could change */
static PetscReal mean_size(const MeshLocal *l)
{
  PetscReal volume = 1;

  for (PetscInt d = 0; d < l->dim; d++) volume *= l->upper[d] - l->lower[d];
  return PetscPowReal(volume / (PetscReal)l->ncell_global, 1 / (PetscReal)l->dim);
}

PetscErrorCode FlowSolverCreate(Flow flow, Constraint constraint, PetscBool moving, FlowSolver *solver)
{
  FlowSolver       fs;
  const PetscReal *h;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&fs));
  fs->flow       = flow;
  fs->constraint = constraint;
  PetscCall(FlowGetMesh(flow, &fs->mesh));
  PetscCall(MeshGetLocal(fs->mesh, &fs->loc));
  PetscCall(MeshGetComm(fs->mesh, &fs->comm));
  PetscCall(ConstraintGetSizes(constraint, &fs->nodal, &fs->nur));
  fs->nr       = ConstraintGetView(constraint)->nr;
  fs->nbodies  = ConstraintGetView(constraint)->nall;
  fs->capacity = PetscMax(ConstraintGetView(constraint)->capacity, ConstraintGetView(constraint)->count);
  fs->np       = fs->loc->ncell * (fs->loc->dim + 1);
  PetscCall(FlowGetCellSize(flow, &h));
  for (PetscInt e = 0; e < fs->loc->ncell; e++) fs->step.h_max = PetscMax(fs->step.h_max, h[e]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &fs->step.h_max, 1, MPIU_REAL, MPIU_MAX, fs->comm));
  fs->step.continuity_scale = BALANCE * mean_size(fs->loc);
  PetscCall(FlowSolverReadSettings(fs, moving));
  PetscCall(RelaxCreate(fs->loc->nnode, fs->loc->dim, &fs->smoother));
  if (fs->nbodies) PetscCall(BodyCouplingCreate(flow, constraint, &fs->body.coupling));
  PetscCall(ContactCouplingCreate(constraint, &fs->body.contact_coupling));
  PetscCall(PetscCalloc3(fs->capacity * fs->nr * fs->nr, &fs->body.D,
                         ConstraintGetView(constraint)->count * fs->nr * fs->nr, &fs->body.body_inverse,
                         fs->capacity * fs->nr * fs->nr, &fs->body.mass_inverse));
  PetscCall(PetscCalloc3(fs->nodal, &fs->diagonal_inverse, fs->nodal, &fs->vec.nodal, fs->loc->nnode_all * fs->loc->dim,
                         &fs->vec.local));
  if (fs->nbodies) PetscCall(PetscCalloc1(fs->loc->nnode_all, &fs->body.fraction));
  PetscCall(PetscCalloc1(2 * fs->capacity * fs->nr, &fs->body.rigid_work));
  PetscCall(PressureCreate(flow, constraint, &fs->pressure));
  PetscCall(PressureGetWeight(fs->pressure, &fs->weight));
  PetscCall(PressureSetContactCoupling(fs->pressure, fs->body.contact_coupling));
  PetscCall(create_operators(fs));
  PetscCall(create_solvers(fs));
  *solver = fs;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverDestroy(FlowSolver *solver)
{
  FlowSolver fs = *solver;

  PetscFunctionBeginUser;
  if (!fs) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(KSPDestroy(&fs->ksp));
  PetscCall(SolidBlockDestroy(&fs->solid));
  PetscCall(TwoStageDestroy(&fs->two));
  PetscCall(FlowSolverDestroyOnDevice(fs));
  PetscCall(FlowSolverDestroyIntegrals(fs));
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(KSPDestroy(&fs->sub[i]));
    PetscCall(VecDestroy(&fs->vec.from[i]));
    PetscCall(VecDestroy(&fs->vec.to[i]));
  }
  PetscCall(PressureDestroy(&fs->pressure));
  PetscCall(MatNullSpaceDestroy(&fs->op.constant_pressure));
  PetscCall(MatDestroy(&fs->op.S_all));
  PetscCall(MatDestroy(&fs->op.Ar));
  PetscCall(MatDestroy(&fs->op.G));
  PetscCall(MatDestroy(&fs->op.B));
  PetscCall(MatDestroy(&fs->op.C));
  PetscCall(MatDestroy(&fs->op.K));
  PetscCall(MatDestroy(&fs->op.Ar_assembled));
  PetscCall(MatDestroy(&fs->op.whole));
  PetscCall(VecDestroy(&fs->vec.xn));
  PetscCall(VecDestroy(&fs->vec.yn));
  PetscCall(VecDestroy(&fs->vec.b));
  PetscCall(VecDestroy(&fs->vec.x));
  PetscCall(VecDestroy(&fs->vec.r));
  PetscCall(VecDestroy(&fs->vec.y));
  for (PetscInt i = 0; i < 2; i++) PetscCall(VecDestroy(&fs->stop.iterate[i]));
  PetscCall(VecDestroy(&fs->vec.x_p));
  PetscCall(VecDestroy(&fs->vec.t_u));
  PetscCall(VecDestroy(&fs->vec.t_u2));
  PetscCall(VecDestroy(&fs->vec.t_p));
  PetscCall(VecDestroy(&fs->vec.t_p2));
  PetscCall(VecDestroy(&fs->vec.gap_reference));
  PetscCall(PetscFree3(fs->body.D, fs->body.body_inverse, fs->body.mass_inverse));
  PetscCall(PetscFree3(fs->diagonal_inverse, fs->vec.nodal, fs->vec.local));
  PetscCall(PetscFree(fs->body.fraction));
  PetscCall(PetscFree(fs->body.rigid_work));
  PetscCall(RelaxDestroy(&fs->smoother));
  PetscCall(BodyCouplingDestroy(&fs->body.coupling));
  PetscCall(ContactCouplingDestroy(&fs->body.contact_coupling));
  PetscCall(PetscFree(*solver));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverView(FlowSolver fs, PetscViewer viewer)
{
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(FlowSolverGetUnknowns(fs, &n));
  PetscCall(PetscViewerASCIIPrintf(viewer, "solver: %" PetscInt_FMT " unknowns, %s, velocity matrix %s\n", n,
                                   fs->set.need_whole ? "assembled saddle point system"
                                                      : "fields one after the other with projected operators",
                                   fs->set.need_Ar || fs->set.need_whole ? "assembled"
                                   : FlowIsMatrixFree(fs->flow)          ? "matrix-free"
                                                                         : "matrix-free over one scalar matrix"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverGetUnknowns(FlowSolver fs, PetscInt *n)
{
  PetscFunctionBeginUser;
  PetscCall(VecGetSize(fs->vec.x, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetPenalty(FlowSolver fs, const PenaltyTerm *penalty)
{
  PetscFunctionBeginUser;
  fs->body.penalty = penalty;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetRigid(FlowSolver fs, const PetscReal D[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(fs->body.D, D, ConstraintGetView(fs->constraint)->nbodies * fs->nr * fs->nr));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetContactCoupling(FlowSolver fs, PetscInt n, const BodySpring spring[])
{
  PetscFunctionBeginUser;
  PetscCall(ContactCouplingSet(fs->body.contact_coupling, n, spring));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverForgetCells(FlowSolver fs, PetscInt n, const PetscInt cells[])
{
  PetscFunctionBeginUser;
  PetscCall(PressureForgetCells(fs->pressure, n, cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetInactive(FlowSolver fs, const PetscInt cell_material[], const PetscBool resolved[])
{
  PetscFunctionBeginUser;
  PetscCheck(!FlowSolverIsOnDevice(fs), fs->comm, PETSC_ERR_SUP,
             "Option -device: a device carries no bodies that the mesh lines up with: use -couple_method penalty or nodal, or remove it");
  fs->body.aligned = PETSC_TRUE;
  PetscCall(PressureSetInactive(fs->pressure, cell_material, resolved));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the step makes of diagonals, bodies and the pressure operator */
static PetscErrorCode update_blocks_and_pressure(FlowSolver fs)
{
  PetscFunctionBeginUser;
  PetscCall(set_up_diagonals(fs, fs->vec.local)); /* nobody else works there until the pressure has them */
  PetscCall(update_relaxation(fs));
  if (fs->nbodies) PetscCall(update_blocks(fs));
  PetscCall(PressureUpdate(fs->pressure, fs->vec.local, FlowSolverHasPenalty(fs) ? fs->body.fraction : NULL,
                           fs->body.mass_inverse));
  PetscCall(SolidBlockUpdate(fs));
  PetscCall(FlowSolverSetUpOnDevice(fs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetUp(FlowSolver fs)
{
  PetscBool             singular, kept;
  const FlowParameters *par;
  const FlowStep       *step;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(fs->flow, &par));
  PetscCall(FlowGetStep(fs->flow, &step));
  fs->step.steady       = (PetscBool)(step->dt == 0);
  fs->step.mu_reference = par->viscosity;
  fs->step.scale        = step->dt > 0       ? par->density * step->ct
                        : fs->step.shift > 0 ? par->density * fs->step.shift
                                             : par->matrix / (fs->loc->h * fs->loc->h);
  fs->step.viscous      = par->matrix * step->theta / fs->step.scale;
  PetscCall(FlowSolverChooseStep(fs));
  PetscCall(FlowSolverDiagonalsOnDevice(fs, &kept));
  if (!kept) PetscCall(update_blocks_and_pressure(fs));
  if (FlowSolverTwoStages(fs) && !fs->two) PetscCall(TwoStageCreate(fs, &fs->two));
  if (FlowSolverTwoStages(fs)) PetscCall(TwoStageSetUp(fs->two, fs));
  PetscCall(PressureIsSingular(fs->pressure, &singular));
  singular = (PetscBool)(singular && !FlowSolverIsCompressible(fs));
  PetscCall(MatSetNullSpace(fs->op.K, singular ? fs->op.constant_pressure : NULL));
  PetscCall(assemble_on_demand(fs));
  PetscCall(MatAssemblyBegin(fs->op.Ar, MAT_FINAL_ASSEMBLY)); /* values behind the shells have changed */
  PetscCall(MatAssemblyEnd(fs->op.Ar, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyBegin(fs->op.K, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(fs->op.K, MAT_FINAL_ASSEMBLY));
  PetscCall(KSPSetOperators(fs->ksp, fs->op.K, fs->set.need_whole ? fs->op.whole : fs->op.K));
  PetscCall(KSPSetUp(fs->ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool FlowSolverIsCompressible(FlowSolver fs)
{
  const FlowVolume *v;
  PetscBool         any = PETSC_FALSE;

  for (PetscInt i = 0; FlowGetVolume(fs->flow, i, &v); i++) any = (PetscBool)(any || v->any_C);
  return any;
}

/* r = b - K x with the start value x, its pressure improved */
static PetscErrorCode start_from(FlowSolver fs, const PetscReal dp[])
{
  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->op.K, fs->vec.x, fs->vec.r));
  PetscCall(VecAYPX(fs->vec.r, -1, fs->vec.b));
  if (dp && !fs->set.single_projection && !fs->set.need_whole)
    PetscCall(FlowStaysOnDevice(fs->flow) ? FlowSolverShiftOnDevice(fs) : FlowSolverShiftPressure(fs, dp));
  PetscCall(FlowSolverMakeConsistent(fs, fs->vec.r));
  PetscCall(VecZeroEntries(fs->vec.y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* fs->vec.y = K^{-1} fs->vec.r; with factors of its own step if those of another one fail */
static PetscErrorCode iterate(FlowSolver fs, KSPConvergedReason *reason)
{
  PetscFunctionBeginUser;
  PetscCall(FlowSolverIterate(fs, fs->vec.r, fs->vec.y));
  PetscCall(KSPGetConvergedReason(fs->ksp, reason));
  if (*reason >= 0 || fs->kept.age == 0) PetscFunctionReturn(PETSC_SUCCESS);
  fs->kept.its  = PETSC_MAX_INT;
  fs->kept.wait = KEPT_WAIT;
  PetscCall(assemble_on_demand(fs));
  PetscCall(KSPSetOperators(fs->ksp, fs->op.K, fs->op.whole));
  PetscCall(VecZeroEntries(fs->vec.y));
  PetscCall(FlowSolverIterate(fs, fs->vec.r, fs->vec.y));
  PetscCall(KSPGetConvergedReason(fs->ksp, reason));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSolve(FlowSolver fs, const PetscReal r[], const PetscReal g[], PetscReal u[], PetscReal p[],
                               const PetscReal dp[], PetscReal U[], PetscInt *its, KSPConvergedReason *reason)
{
  const PetscBool there = FlowStaysOnDevice(fs->flow);
  PetscBool       converged;
  PetscReal       size;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_SOLVE, 0, 0, 0, 0));
  if (there) {
    PetscCall(FlowSolverBuildRhsOnDevice(fs, g));
    PetscCall(FlowSolverPackOnDevice(fs, U));
  } else {
    PetscCall(FlowSolverBuildRhs(fs, r, g));
    PetscCall(FlowSolverPack(fs, u, p, U, fs->vec.x));
  }
  PetscCall(start_from(fs, dp));
  PetscCall(FlowSolverSetTolerance(fs, &converged));
  PetscCall(VecNorm(fs->vec.r, NORM_2, &size));
  if (size == 0)
    converged = PETSC_TRUE; /* all at rest: a fixed number of sweeps, without a test, would divide 0 by 0 */
  *its    = 0;
  *reason = KSP_CONVERGED_RTOL;
  PetscCall(PetscArrayzero(fs->limited, 2));
  if (!converged) {
    fs->stop.is_time_step         = PETSC_TRUE;
    fs->stop.first_velocity_solve = (PetscBool)(fs->set.moving && FlowSolverTwoStages(fs));
    PetscCall(iterate(fs, reason));
    fs->stop.is_time_step = fs->stop.first_velocity_solve = PETSC_FALSE;
    PetscCall(KSPGetIterationNumber(fs->ksp, its));
    fs->kept.its = *reason < 0 ? PETSC_MAX_INT : *its;
    PetscCall(VecAXPY(fs->vec.x, 1, fs->vec.y));
  }
  fs->carry.solved = PETSC_FALSE;
  if (fs->nbodies && !fs->integrals.n && *reason >= 0) PetscCall(FlowSolverConserve(fs, fs->vec.x));
  if (there) PetscCall(FlowSolverUnpackOnDevice(fs, U));
  else PetscCall(FlowSolverUnpack(fs, fs->vec.x, u, p, U));
  if (fs->integrals.n && *reason >= 0) PetscCall(FlowSolverHoldIntegrals(fs, u, p, U, its, reason));
  PetscCall(PetscLogEventEnd(TB_FLOW_SOLVE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
