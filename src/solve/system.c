/* FlowSolver: see system.h for the system and the method.

   Layout of all vectors of the system: on every rank the reduced velocity (own nodes x dim, then the rigid slots of own
   bodies), then the pressure of own cells. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "base/opt.h"
#include "assembled.h"
#include "krylov/lean.h"

/* Diagonal entries of A in the sweeps, at least, in lumped masses: convection that the mesh does not resolve takes from
   the entry, and would leave nothing or less (runs/studies/flow-solver) */
#define LEAST_DIAGONAL 0.1
/* Weight of the continuity rows, see system.h, in mean cell sizes (runs/studies/flow-solver, "Rows of one unit") */
#define BALANCE 12
#define RESTART 60 /* directions of the outer iteration before it starts anew */

/* ---- numeric set-up ---- */

static PetscErrorCode find_thinnest(FlowSolver fs, const PetscReal m[], const PetscReal mu[])
{
  PetscFunctionBeginUser;
  fs->thinnest = PETSC_MAX_REAL;
  for (PetscInt i = 0; i < fs->loc->nnode; i++)
    if (ConstraintGetView(fs->constraint)->node_body[i] < 0 && m[i] > 0) fs->thinnest = PetscMin(fs->thinnest, mu[i]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &fs->thinnest, 1, MPIU_REAL, MPIU_MIN, PETSC_COMM_WORLD));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inverse diagonal of A (zero at inert slots) and inverse lumped mass of M_r with softness at body nodes, weight
   [nnode_all][dim], which PressureUpdate compares with the last */
static PetscErrorCode set_up_diagonals(FlowSolver fs, PetscReal weight[])
{
  const ConstraintView *c   = ConstraintGetView(fs->constraint);
  const MeshLocal      *l   = fs->loc;
  const PetscInt        dim = l->dim;
  const unsigned char  *fixed;
  const PetscReal      *m, *mu;
  const PetscReal       part = fs->two_stage ? TWO_STAGE_SHARE : 1;
  PetscReal             hold = 1, *d;
  PetscBool             weigh;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(fs->flow), &fixed, NULL));
  PetscCall(FlowGetLumpedMass(fs->flow, &m));
  PetscCall(FlowGetViscosity(fs->flow, NULL, &mu));
  weigh = (PetscBool)(mu && (fs->steady || fs->two_stage || fs->commute)); /* a projection has no commutator */
  if (weigh) PetscCall(find_thinnest(fs, m, mu));
  /* strong nodes among soft ones are to yield less than these */
  if (FlowSolverIsSoft(fs)) hold = 1 + fs->soft->strength / fs->scale;
  PetscCall(PetscMalloc1(l->nnode_all, &d));
  PetscCall(FlowGetDiagonal(fs->flow, d));
  for (PetscInt i = 0; i < fs->nodal; i++) {
    const PetscReal least = LEAST_DIAGONAL * fs->scale * m[i / dim];

    fs->diagonal_inverse[i] = d[i / dim] != 0 ? 1 / PetscMax(d[i / dim], least) : 0;
  }
  for (PetscInt j = 0; j < c->inert.n; j++) fs->diagonal_inverse[c->inert.slot[j]] = 0;
  PetscCall(PetscFree(d));
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    const PetscReal lift = weigh ? FlowSolverGetLift(fs, mu[i]) : 1;
    /* the penalty goes with mu, and in a time step is taken as it is */
    const PetscReal soft = FlowSolverIsSoft(fs) ? part * fs->soft->weight[i] / (fs->scale * lift * (fs->steady ? lift : 1)) : 0;
    const PetscReal mass = c->node_body[i] >= 0 ? m[i] : m[i] + soft;
    const PetscReal w    = mass > 0 ? 1 / mass : 0; /* no mass: buried in a dead cell */

    if (fs->share) fs->share[i] = c->node_body[i] >= 0 ? 1 : soft * w;
    for (PetscInt a = 0; a < dim; a++)
      weight[i * dim + a] = (c->node_body[i] >= 0  ? w / hold * PressureGetSoftness(fs->pressure, c->node_body[i])
                             : (fixed[i] >> a) & 1 ? 0
                                                   : w) /
                            lift;
  }
  if (fs->nsaved < c->inert.n + c->moved.n) {
    PetscCall(PetscFree(fs->saved));
    fs->nsaved = c->inert.n + c->moved.n + (c->inert.n + c->moved.n) / 4;
    PetscCall(PetscMalloc1(fs->nsaved, &fs->saved));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What approximates the inverse of the velocity operator */
static PetscErrorCode update_relaxation(FlowSolver fs)
{
  Mat S = NULL;

  PetscFunctionBeginUser;
  if (fs->relax != RELAX_JACOBI) PetscCall(FlowGetMatrix(fs->flow, &S));
  PetscCall(PetscLogEventBegin(TB_VEL_FACTOR, 0, 0, 0, 0));
  PetscCall(RelaxUpdate(fs->sweep, fs->relax, S, fs->diagonal_inverse));
  PetscCall(PetscLogEventEnd(TB_VEL_FACTOR, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update_blocks(FlowSolver fs)
{
  const ConstraintView *c  = ConstraintGetView(fs->constraint);
  const PetscInt        nr = fs->nr, nn = nr * nr;
  const PenaltyTerm    *soft = FlowSolverIsSoft(fs) ? fs->soft : NULL;
  const PetscReal      *stiff;

  PetscFunctionBeginUser;
  PetscCall(FlowSolverGatherRows(fs));
  PetscCall(BodyCouplingUpdate(fs->coupling, fs->near, soft, &stiff));
  PetscCall(BodyBlocksInvert(fs->flow, fs->constraint, fs->share, stiff, soft, fs->D, fs->scale, fs->body_inverse, fs->mass_inverse));
  PetscCall(TiesUpdate(fs->ties, fs->body_inverse, fs->mass_inverse, fs->scale));
  for (PetscInt e = 0; e < c->nown * nn; e++) {
    const PetscInt k = c->own[e / nn], i = e % nn / nr, j = e % nr;

    if (ConstraintIsUnknown(c, k, i) && ConstraintIsUnknown(c, k, j))
      fs->body_inverse[e] /= ConstraintSlotUnit(c, k, i) * ConstraintSlotUnit(c, k, j);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode assemble_on_demand(FlowSolver fs)
{
  Mat P, S;

  PetscFunctionBeginUser;
  if (!fs->need_Ar && !fs->need_whole) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetMatrix(fs->flow, &S)); /* its values, which fs->A looks at */
  PetscCall(MatDestroy(&fs->Ar_assembled));
  PetscCall(MatDestroy(&fs->whole));
  PetscCall(ConstraintCreateMat(fs->constraint, &P));
  PetscCall(AssembledCreateVelocity(fs->constraint, fs->A, P, fs->D, FlowSolverIsSoft(fs) ? fs->soft : NULL, fs->ties, &fs->Ar_assembled));
  if (fs->need_whole)
    PetscCall(AssembledCreateWhole(fs->flow, fs->pressure, fs->scale, fs->balance, FlowSolverEase(fs), P, fs->Ar_assembled, &fs->whole));
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
  PetscCall(VecGetArray(x, &a));
  PetscCall(PressureRemoveConstant(fs->pressure, a + fs->nur));
  PetscCall(VecRestoreArray(x, &a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A vector that is lent its values, as long as v; sizes are known and need not be summed again */
static PetscErrorCode create_empty(Vec v, Vec *empty)
{
  PetscInt bs, n, N;

  PetscFunctionBeginUser;
  PetscCall(VecGetBlockSize(v, &bs));
  PetscCall(VecGetLocalSize(v, &n));
  PetscCall(VecGetSize(v, &N));
  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, bs, n, N, NULL, empty));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_operators(FlowSolver fs)
{
  PetscFunctionBeginUser;
  PetscCall(VecCreateMPI(PETSC_COMM_WORLD, fs->nur + fs->np, PETSC_DETERMINE, &fs->x));
  PetscCall(VecDuplicate(fs->x, &fs->b));
  PetscCall(VecDuplicate(fs->x, &fs->r));
  PetscCall(VecDuplicate(fs->x, &fs->y));
  PetscCall(ConstraintCreateVec(fs->constraint, &fs->t_u));
  PetscCall(VecDuplicate(fs->t_u, &fs->t_u2));
  PetscCall(VecCreateMPI(PETSC_COMM_WORLD, fs->np, PETSC_DETERMINE, &fs->t_p));
  PetscCall(VecDuplicate(fs->t_p, &fs->t_p2));
  PetscCall(VecDuplicate(fs->t_p, &fs->x_p));
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(create_empty(i ? fs->t_p : fs->t_u, &fs->from[i]));
    PetscCall(create_empty(i ? fs->t_p : fs->t_u, &fs->to[i]));
  }
  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, fs->loc->dim, fs->nodal, PETSC_DETERMINE, NULL, &fs->xn));
  PetscCall(create_empty(fs->xn, &fs->yn));
  PetscCall(FlowSolverCreateShells(fs));
  PetscCall(MatNullSpaceCreate(PETSC_COMM_WORLD, PETSC_FALSE, 0, NULL, &fs->constant_pressure));
  PetscCall(MatNullSpaceSetFunction(fs->constant_pressure, remove_constant, fs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_solvers(FlowSolver fs)
{
  PetscBool given, single = PETSC_TRUE;
  PC        pc;

  PetscFunctionBeginUser;
  PetscCall(LeanRegister());
  PetscCall(KSPCreate(PETSC_COMM_WORLD, &fs->ksp));
  PetscCall(KSPSetOptionsPrefix(fs->ksp, "flow_"));
  PetscCall(FlowSolverSetTest(fs));
  PetscCall(KSPGetPC(fs->ksp, &pc));
  if (!fs->need_whole) PetscCall(FlowSolverCreateProjection(fs, pc));
  PetscCall(KSPSetFromOptions(fs->ksp));
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_ksp_gmres_restart", &given));
  if (!given) PetscCall(KSPGMRESSetRestart(fs->ksp, RESTART));
  PetscCall(FlowSolverRemarkMethod(fs));
  PetscCall(OptBool("-flow_krylov_single", &single));
  PetscCall(LeanSetPrecision(fs->ksp, single, fs->np));
  if (fs->sub[0]) PetscCall(LeanSetPrecision(fs->sub[0], single, 0));
  /* a step's right-hand side, which nobody wants afterwards, unless MUMPS asks for more room */
  if (!fs->need_whole) PetscCall(LeanSetWork(fs->ksp, fs->r, NULL));
  PetscCall(KSPGetTolerances(fs->ksp, &fs->rtol, NULL, NULL, NULL));
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
  PetscCall(ConstraintGetSizes(constraint, &fs->nodal, &fs->nur));
  fs->nr      = ConstraintGetView(constraint)->nr;
  fs->nbodies = ConstraintGetView(constraint)->nall;
  fs->room    = PetscMax(ConstraintGetView(constraint)->capacity, ConstraintGetView(constraint)->count);
  fs->np      = fs->loc->ncell * (fs->loc->dim + 1);
  PetscCall(FlowGetCellSize(flow, &h));
  for (PetscInt e = 0; e < fs->loc->ncell; e++) fs->h_max = PetscMax(fs->h_max, h[e]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &fs->h_max, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  fs->balance = BALANCE * mean_size(fs->loc);
  PetscCall(FlowSolverSetRecipe(fs, moving));
  PetscCall(RelaxCreate(fs->loc->nnode, fs->loc->dim, &fs->sweep));
  if (fs->nbodies) PetscCall(BodyCouplingCreate(flow, constraint, &fs->coupling));
  PetscCall(TiesCreate(constraint, &fs->ties));
  PetscCall(PetscCalloc3(fs->room * fs->nr * fs->nr, &fs->D, ConstraintGetView(constraint)->count * fs->nr * fs->nr, &fs->body_inverse,
                         fs->room * fs->nr * fs->nr, &fs->mass_inverse));
  PetscCall(PetscCalloc2(fs->nodal, &fs->diagonal_inverse, fs->loc->nnode_all * fs->loc->dim, &fs->local));
  if (fs->nbodies) PetscCall(PetscCalloc1(fs->loc->nnode_all, &fs->share));
  PetscCall(PetscCalloc1(2 * fs->room * fs->nr, &fs->rigid_work));
  PetscCall(PressureCreate(flow, constraint, &fs->pressure));
  PetscCall(PressureGetWeight(fs->pressure, &fs->weight));
  PetscCall(PressureSetTies(fs->pressure, fs->ties));
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
  PetscCall(TwoStageDestroy(&fs->two));
  PetscCall(FlowSolverDestroyHeld(fs));
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(KSPDestroy(&fs->sub[i]));
    PetscCall(VecDestroy(&fs->from[i]));
    PetscCall(VecDestroy(&fs->to[i]));
  }
  PetscCall(PressureDestroy(&fs->pressure));
  PetscCall(MatNullSpaceDestroy(&fs->constant_pressure));
  PetscCall(MatDestroy(&fs->S_all));
  PetscCall(MatDestroy(&fs->Ar));
  PetscCall(MatDestroy(&fs->G));
  PetscCall(MatDestroy(&fs->B));
  PetscCall(MatDestroy(&fs->C));
  PetscCall(MatDestroy(&fs->K));
  PetscCall(MatDestroy(&fs->Ar_assembled));
  PetscCall(MatDestroy(&fs->whole));
  PetscCall(VecDestroy(&fs->xn));
  PetscCall(VecDestroy(&fs->yn));
  PetscCall(VecDestroy(&fs->b));
  PetscCall(VecDestroy(&fs->x));
  PetscCall(VecDestroy(&fs->r));
  PetscCall(VecDestroy(&fs->y));
  for (PetscInt i = 0; i < 2; i++) PetscCall(VecDestroy(&fs->iterate[i]));
  PetscCall(VecDestroy(&fs->x_p));
  PetscCall(VecDestroy(&fs->t_u));
  PetscCall(VecDestroy(&fs->t_u2));
  PetscCall(VecDestroy(&fs->t_p));
  PetscCall(VecDestroy(&fs->t_p2));
  PetscCall(VecDestroy(&fs->pressed));
  PetscCall(PetscFree3(fs->D, fs->body_inverse, fs->mass_inverse));
  PetscCall(PetscFree2(fs->diagonal_inverse, fs->local));
  PetscCall(PetscFree(fs->share));
  PetscCall(PetscFree(fs->rigid_work));
  PetscCall(PetscFree(fs->saved));
  PetscCall(RelaxDestroy(&fs->sweep));
  PetscCall(BodyCouplingDestroy(&fs->coupling));
  PetscCall(TiesDestroy(&fs->ties));
  PetscCall(PetscFree(*solver));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverView(FlowSolver fs, PetscViewer viewer)
{
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(FlowSolverGetUnknowns(fs, &n));
  PetscCall(PetscViewerASCIIPrintf(viewer, "solver: %" PetscInt_FMT " unknowns, %s, velocity matrix %s\n", n,
                                   fs->need_whole ? "assembled saddle point system" : "fields one after the other with projected operators",
                                   fs->need_Ar || fs->need_whole ? "assembled"
                                   : FlowIsMatrixFree(fs->flow)  ? "matrix-free"
                                                                 : "matrix-free over one scalar matrix"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverGetUnknowns(FlowSolver fs, PetscInt *n)
{
  PetscFunctionBeginUser;
  PetscCall(VecGetSize(fs->x, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetSoft(FlowSolver fs, const PenaltyTerm *soft)
{
  PetscFunctionBeginUser;
  fs->soft = soft;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetRigid(FlowSolver fs, const PetscReal D[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(fs->D, D, ConstraintGetView(fs->constraint)->nbodies * fs->nr * fs->nr));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetTies(FlowSolver fs, PetscInt n, const BodyTie tie[])
{
  PetscFunctionBeginUser;
  PetscCall(TiesSet(fs->ties, n, tie));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverForgetCells(FlowSolver fs, PetscInt n, const PetscInt cells[])
{
  PetscFunctionBeginUser;
  PetscCall(PressureForgetCells(fs->pressure, n, cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetDead(FlowSolver fs, const PetscInt cell_body[], const PetscBool resolved[])
{
  PetscFunctionBeginUser;
  fs->fitted = PETSC_TRUE;
  PetscCall(PressureSetDead(fs->pressure, cell_body, resolved));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetUp(FlowSolver fs)
{
  PetscBool             singular;
  const FlowParameters *par;
  const FlowStep       *step;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(fs->flow, &par));
  PetscCall(FlowGetStep(fs->flow, &step));
  fs->steady    = (PetscBool)(step->dt == 0);
  fs->reference = par->viscosity;
  fs->scale     = step->dt > 0 ? par->density * step->ct : fs->shift > 0 ? par->density * fs->shift : par->matrix / (fs->loc->h * fs->loc->h);
  fs->viscous   = par->matrix * step->theta / fs->scale;
  PetscCall(FlowSolverChooseMethods(fs));
  PetscCall(set_up_diagonals(fs, fs->local)); /* nobody else works there until the pressure has them */
  PetscCall(update_relaxation(fs));
  if (fs->nbodies) PetscCall(update_blocks(fs));
  PetscCall(PressureUpdate(fs->pressure, fs->local, FlowSolverIsSoft(fs) ? fs->share : NULL, fs->mass_inverse));
  if (fs->two_stage && !fs->two) PetscCall(TwoStageCreate(fs, &fs->two));
  if (fs->two_stage) PetscCall(TwoStageSetUp(fs->two, fs));
  PetscCall(PressureIsSingular(fs->pressure, &singular));
  PetscCall(MatSetNullSpace(fs->K, singular ? fs->constant_pressure : NULL));
  PetscCall(assemble_on_demand(fs));
  PetscCall(MatAssemblyBegin(fs->Ar, MAT_FINAL_ASSEMBLY)); /* values behind the shells have changed */
  PetscCall(MatAssemblyEnd(fs->Ar, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyBegin(fs->K, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(fs->K, MAT_FINAL_ASSEMBLY));
  PetscCall(KSPSetOperators(fs->ksp, fs->K, fs->need_whole ? fs->whole : fs->K));
  PetscCall(KSPSetUp(fs->ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The penalty's share in the right-hand side of known velocities U and known nodal values c: y -= G U, rigid -= H U -
   G^T c (own bodies) */
static PetscErrorCode add_known_soft(FlowSolver fs, const PetscReal c[], PetscReal y[], PetscReal rigid[])
{
  const ConstraintView *P  = ConstraintGetView(fs->constraint);
  const PetscInt        nr = fs->nr, nn = nr * nr;
  PetscReal            *local = fs->rigid_work, *U_local = fs->rigid_work + fs->room * nr;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < P->nbodies; k++)
    for (PetscInt s = 0; s < nr && P->local_index[k] >= 0; s++) {
      U_local[P->local_index[k] * nr + s] = P->U[k * nr + s];
      local[P->local_index[k] * nr + s]   = 0;
    }
  PetscCall(PenaltyTermMultAdd(fs->soft, fs->constraint, PETSC_FALSE, U_local, c, y, local));
  for (PetscInt i = 0; i < P->nlocal * nr; i++) local[i] = -local[i];
  PetscCall(ConstraintDeliverRigid(fs->constraint, local, rigid));
  for (PetscInt e = 0; e < P->nown * nn; e++) {
    const PetscInt k = P->own[e / nn], i = e % nn / nr, j = e % nr;

    if (ConstraintIsUnknown(P, k, i) && !ConstraintIsUnknown(P, k, j))
      rigid[e / nn * nr + i] -= ConstraintSlotUnit(P, k, i) * fs->soft->whole[e] * P->U[k * nr + j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where the pressure has an undetermined constant, the flux of the prescribed velocity c through the boundary must
   vanish. What interpolation and round-off leave of it is spread over all cells. */
static PetscErrorCode spread_net_flux(FlowSolver fs, const PetscReal c[])
{
  const MeshLocal *l    = fs->loc;
  PetscReal        flux = 0, speed = 0, length = 0;
  const PetscReal *b;
  MatNullSpace     constant;

  PetscFunctionBeginUser;
  PetscCall(MatGetNullSpace(fs->K, &constant));
  if (!constant) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecGetArrayRead(fs->b, &b));
  for (PetscInt i = fs->nur; i < fs->nur + fs->np; i += l->dim + 1) flux += b[i] / (fs->scale * fs->balance);
  PetscCall(VecRestoreArrayRead(fs->b, &b));
  for (PetscInt i = 0; i < fs->nodal; i++) speed = PetscMax(speed, PetscAbsReal(c[i]));
  for (PetscInt d = 0; d < l->dim; d++) length = PetscMax(length, l->upper[d] - l->lower[d]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &flux, 1, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &speed, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  PetscCheck(PetscAbsReal(flux) <= 1e-3 * speed * PetscPowRealInt(length, l->dim - 1), PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "The prescribed velocities let a net volume of %g per time into a domain without outflow: give a boundary -flow_bc_<boundary>_type outflow, or velocities that balance",
             (double)flux);
  PetscCall(MatNullSpaceRemove(constant, fs->b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverBuildRhs(FlowSolver fs, const PetscReal r[], const PetscReal g[])
{
  const ConstraintView *P   = ConstraintGetView(fs->constraint);
  const PetscInt        dim = fs->loc->dim;
  PetscReal            *b, *c = fs->local;

  PetscFunctionBeginUser;
  PetscCall(VecGetArray(fs->b, &b));
  for (PetscInt i = 0; i < fs->loc->nnode_all; i++)
    for (PetscInt a = 0; a < dim; a++) c[i * dim + a] = ConstraintIsFree(P, i) ? 0 : ConstraintGetPrescribed(fs->constraint, i, a);
  if (FlowIsMatrixFree(fs->flow)) {
    PetscCall(FlowMultiply(fs->flow, PETSC_TRUE, c, b)); /* known: nodes of boundaries and of prescribed bodies */
  } else {
    PetscCall(VecPlaceArray(fs->xn, c));
    PetscCall(VecPlaceArray(fs->yn, b));
    PetscCall(MatMult(fs->A, fs->xn, fs->yn));
    PetscCall(VecResetArray(fs->xn));
    PetscCall(VecResetArray(fs->yn));
  }
  PetscCall(PetscArrayzero(b + fs->nodal, P->count * fs->nr));
  for (PetscInt i = 0; i < P->nown * fs->nr; i++) {
    const PetscInt k = P->own[i / fs->nr], s = i % fs->nr;

    b[fs->nodal + i] = ConstraintIsUnknown(P, k, s) ? g[k * fs->nr + s] * ConstraintSlotUnit(P, k, s) : 0;
  }
  if (FlowSolverIsSoft(fs)) PetscCall(add_known_soft(fs, c, b, b + fs->nodal));
  for (PetscInt i = 0; i < fs->nodal; i++) b[i] = r[i] - b[i];
  PetscCall(ConstraintReduceInPlace(fs->constraint, b, b + fs->nodal));
  PetscCall(FlowDivergence(fs->flow, c, b + fs->nur));
  for (PetscInt i = fs->nur; i < fs->nur + fs->np; i++) b[i] *= -fs->scale * fs->balance;
  PetscCall(VecRestoreArray(fs->b, &b));
  PetscCall(spread_net_flux(fs, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverPack(FlowSolver fs, const PetscReal u[], const PetscReal p[], const PetscReal U[], Vec xv)
{
  PetscReal *x;

  PetscFunctionBeginUser;
  PetscCall(VecGetArray(xv, &x));
  PetscCall(VecPlaceArray(fs->t_u, x));
  PetscCall(ConstraintRestrict(fs->constraint, u, U, fs->t_u));
  PetscCall(VecResetArray(fs->t_u));
  PetscCall(PetscArraycpy(x + fs->nur, p, fs->np));
  PetscCall(VecRestoreArray(xv, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverUnpack(FlowSolver fs, Vec xv, PetscReal u[], PetscReal p[], PetscReal U[])
{
  const PetscReal *x;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(xv, &x));
  PetscCall(PetscArraycpy(p, x + fs->nur, fs->np));
  PetscCall(VecPlaceArray(fs->t_u, x));
  PetscCall(ConstraintExpand(fs->constraint, fs->t_u, u));
  PetscCall(ConstraintGatherRigid(fs->constraint, fs->t_u, U));
  PetscCall(VecResetArray(fs->t_u));
  PetscCall(VecRestoreArrayRead(xv, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverMakeConsistent(FlowSolver fs, Vec r)
{
  MatNullSpace constant;
  PetscReal   *a;

  PetscFunctionBeginUser;
  PetscCall(MatGetNullSpace(fs->K, &constant));
  if (fs->nbodies) {
    PetscCall(VecGetArray(r, &a));
    PetscCall(PressureMakeConsistent(fs->pressure, a + fs->nur));
    PetscCall(VecRestoreArray(r, &a));
  } else if (constant) PetscCall(MatNullSpaceRemove(constant, r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* r = b - K x with the start value x, its pressure improved */
static PetscErrorCode start_from(FlowSolver fs, const PetscReal dp[])
{
  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->K, fs->x, fs->r));
  PetscCall(VecAYPX(fs->r, -1, fs->b));
  if (dp && !fs->single && !fs->need_whole) PetscCall(FlowSolverShiftPressure(fs, dp));
  PetscCall(FlowSolverMakeConsistent(fs, fs->r));
  PetscCall(VecZeroEntries(fs->y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSolve(FlowSolver fs, const PetscReal r[], const PetscReal g[], PetscReal u[], PetscReal p[], const PetscReal dp[],
                               PetscReal U[], PetscInt *its, KSPConvergedReason *reason)
{
  PetscBool enough;
  PetscReal size;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_SOLVE, 0, 0, 0, 0));
  PetscCall(FlowSolverBuildRhs(fs, r, g));
  PetscCall(FlowSolverPack(fs, u, p, U, fs->x));
  PetscCall(start_from(fs, dp));
  PetscCall(FlowSolverSetTolerance(fs, &enough));
  PetscCall(VecNorm(fs->r, NORM_2, &size));
  if (size == 0) enough = PETSC_TRUE; /* all at rest: a fixed number of sweeps, without a test, would divide 0 by 0 */
  *its    = 0;
  *reason = KSP_CONVERGED_RTOL;
  PetscCall(PetscArrayzero(fs->limited, 2));
  if (!enough) {
    fs->of_step = PETSC_TRUE;
    fs->first   = (PetscBool)(fs->moving && fs->two_stage);
    PetscCall(FlowSolverIterate(fs, fs->r, fs->y));
    fs->of_step = fs->first = PETSC_FALSE;
    PetscCall(KSPGetIterationNumber(fs->ksp, its));
    PetscCall(KSPGetConvergedReason(fs->ksp, reason));
    PetscCall(VecAXPY(fs->x, 1, fs->y));
  }
  fs->solved = PETSC_FALSE;
  if (fs->nbodies && !fs->held && *reason >= 0) PetscCall(FlowSolverConserve(fs, fs->x));
  PetscCall(FlowSolverUnpack(fs, fs->x, u, p, U));
  if (fs->held && *reason >= 0) PetscCall(FlowSolverHold(fs, u, p, U, its, reason));
  PetscCall(PetscLogEventEnd(TB_FLOW_SOLVE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
