/* FlowSolver: see system.h for the system and the method.

   Layout of all vectors of the system: on every rank the reduced velocity (own nodes x dim, then the rigid slots of own bodies), then the pressure of own cells. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "base/opt.h"
#include "assembled.h"

/* Viscous number nu theta/(c_t h^2) from which the commutator pays where rigid nodes form a staircase: one settling disc, seconds a step without and with it, 0.034: .31 and .34, 0.068: .70 and .54
   (24 and 11 outer iterations), 0.68: .61 and .39 (22 and 9). Not for 250 discs, whose pressures are dearer: fluidization, 0.053: .26 and .67 (7 and 6), 0.27: .56 and .79, 2.7: 1.70 and 2.11. Otherwise
   it does not, being half as dear again: cavity, 64 x 64 cells, CFL 0.9, 0.23 / 0.9 / 3.7: 3.6 / 4.2 / 4.7 and 4.7 / 5.2 / 5.6; settling disc under penalty: 10 and 12 */
#define COMMUTATOR_FROM 0.1
/* Alike with bodies that do not move or whose motion is given. Cylinder in a channel, nodal, 3.4 / 66 / 660: outer iterations of the sixth step 27 / 37 / 57 and 23 / 26 / 19, six steps at 0.75 / 0.9 /
   1.6 of the commutator's cost; 610,030 unknowns, 0.15: 6 and 6 at half its cost */
#define COMMUTATOR_FROM_KNOWN 100
/* Convective number |u| theta/(c_t h) alike, in under-resolved flows (cell Reynolds number above 50) and in all: cavity, nu 1e-6, 32 x 32 cells, 0.67: 15 and 7;
   nu 1e-2, 16 x 16 cells, 6.7: 22 and 8 */
#define COMMUTATOR_FROM_UNRESOLVED 0.5
#define COMMUTATOR_FROM_CONVECTION 2
/* Viscous number from which, without bodies and where a time step's diffusion outruns convection, p += mu theta Mp^{-1} follows in place of the commutator (Cahouet & Chabard 1988):
   the commutator fails at walls, the more the finer the mesh: 10, 19, 41 iterations on 8 x 8, 32 x 32, 64 x 64 cells, 12, 13, 12 with it; with bodies Mp^{-1} fails in cut cells */
#define VISCOUS_FROM 20
/* The single sweep of recipe fast is a fixed point iteration for the pressure: B M^{-1} B^T of the consistent mass is up to some 3 times that of the lumped one where viscosity does not
   damp the difference, and the whole correction then overshoots. Below this viscous number, of the largest cell, the pressure takes a share of it (the velocity all). Cavity, CFL 0.1 to 0.5: stable with
   the whole at 0.019, not at 0.009; with 0.9 at 0.009, not at 0.005; with 0.6 at 0.005 and with hardly any viscosity. Around bodies the whole fails too, slowly: 2D-3 under penalty blows up with it at
   t = 3.1, with 0.6 at 6, not with 0.5; two falling discs, 6 cells a diameter, penalty: trailing one at most 17.2 cm/s with the whole, 18.7 with 0.25 to 0.6, 18.7 solved to the end */
#define WHOLE_FROM  0.015
#define SHARE_BELOW 0.5
/* The incomplete factorisation pays from either number on, and earlier where convection is under-resolved. Cavity, 64 x 64 cells, sweeps and factorisation (iterations of the velocity
   solve): nu 1e-2, CFL 50: 31 and 18; nu 1e-3, CFL 50: 191 and 6.5 (sweeps fail); nu 1e-2, CFL 1.3: 3.5 and 2.5; 470 x 470, recipe fast, CFL 0.9: 3 and 2, 0.11 s a step of sweeps against
   0.05 s, and 0.19 s for the factorisation */
#define FACTORISE_FROM            1
#define FACTORISE_FROM_UNRESOLVED 0.3

/* Diagonal entries of A in the sweeps, at least, in lumped masses. Convection that the mesh does not resolve takes from the entry, and at CFL numbers of 3 and more leaves next to nothing,
   or less (two falling discs, snap, 8 cells a diameter, dt 2e-3: -0.04 among rows of 8, and the factors overflow) */
#define LEAST_DIAGONAL 0.1

typedef enum {
  SCHUR_AUTO,
  SCHUR_PROJECTION,
  SCHUR_COMMUTATOR
} SchurType;

typedef enum {
  SWEEP_AUTO,
  SWEEP_SOR,
  SWEEP_ILU
} RelaxType;

static const char *const RECIPES[] = {"fast", "balanced", "accurate", "direct", NULL};
static const char *const SCHURS[]  = {"auto", "projection", "commutator", NULL};
static const char *const SWEEPS[]  = {"auto", "sor", "ilu", NULL};

/* ---- numeric set-up ---- */

/* Inverse diagonal of A (zero at inert slots) and inverse lumped mass of M_r with softness at body nodes */
static PetscErrorCode set_up_diagonals(FlowSolver fs)
{
  const MeshLocal *l   = fs->loc;
  const PetscInt   dim = l->dim, *body, *fixed, *slot;
  const PetscReal *m, *d;
  PetscInt         ninert, nfollow;
  PetscReal        hold = 1;
  Vec              diagonal;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(fs->constraint, &body));
  PetscCall(ConstraintGetInert(fs->constraint, &ninert, &slot));
  PetscCall(ConstraintGetFollowers(fs->constraint, &nfollow, NULL, NULL, NULL));
  PetscCall(ConditionsGetValues(FlowConditions(fs->flow), &fixed, NULL));
  PetscCall(FlowGetLumpedMass(fs->flow, &m));
  /* strong nodes among soft ones are to yield less than these (outer iterations at viscous number 1, 100, 1e5: 12, 19, 27; with eps alone 23, 79, none) */
  if (FlowSolverIsSoft(fs)) hold = 1 + fs->soft->strength / fs->scale;
  PetscCall(MatCreateVecs(fs->S, &diagonal, NULL));
  PetscCall(MatGetDiagonal(fs->S, diagonal));
  PetscCall(VecGetArrayRead(diagonal, &d));
  for (PetscInt i = 0; i < fs->nodal; i++) {
    const PetscReal least = LEAST_DIAGONAL * fs->scale * m[i / dim];

    fs->diagonal_inverse[i] = d[i / dim] != 0 ? 1 / PetscMax(d[i / dim], least) : 0;
  }
  for (PetscInt j = 0; j < ninert; j++) fs->diagonal_inverse[slot[j]] = 0;
  PetscCall(VecRestoreArrayRead(diagonal, &d));
  PetscCall(VecDestroy(&diagonal));
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    const PetscReal soft = FlowSolverIsSoft(fs) ? fs->soft->weight[i] / fs->scale : 0, mass = body[i] >= 0 ? m[i] : m[i] + soft;
    const PetscReal w = mass > 0 ? 1 / mass : 0; /* no mass: buried in a dead cell */

    fs->share[i] = body[i] >= 0 ? 1 : soft * w;
    for (PetscInt a = 0; a < dim; a++)
      fs->weight[i * dim + a] = body[i] >= 0 ? w / hold * PressureGetSoftness(fs->pressure, body[i]) : (fixed[i] >> a) & 1 ? 0 : w;
  }
  if (fs->nsaved < ninert + nfollow) {
    PetscCall(PetscFree(fs->saved));
    fs->nsaved = ninert + nfollow + (ninert + nfollow) / 4;
    PetscCall(PetscMalloc1(fs->nsaved, &fs->saved));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode assemble_on_demand(FlowSolver fs)
{
  Mat P;

  PetscFunctionBeginUser;
  if (!fs->need_Ar && !fs->need_whole) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatDestroy(&fs->Ar_assembled));
  PetscCall(MatDestroy(&fs->whole));
  PetscCall(ConstraintCreateMat(fs->constraint, &P));
  PetscCall(AssembledCreateVelocity(fs->constraint, fs->A, P, fs->D, FlowSolverIsSoft(fs) ? fs->soft : NULL, &fs->Ar_assembled));
  if (fs->need_whole) PetscCall(AssembledCreateWhole(fs->flow, fs->pressure, fs->scale, P, fs->Ar_assembled, &fs->whole));
  PetscCall(MatDestroy(&P));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the preconditioner ---- */

/* p += mu theta Mp^{-1} (x_p - B u) */
static PetscErrorCode add_viscous(FlowSolver fs, Vec x, Vec u, Vec p)
{
  const PetscReal *xa;
  PetscReal       *pa, *r;

  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->B, u, fs->t_p));
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(VecGetArray(p, &pa));
  PetscCall(VecGetArray(fs->t_p, &r));
  for (PetscInt i = 0; i < fs->np; i++) r[i] = xa[fs->nur + i] - r[i];
  PetscCall(FlowPressureMassSolve(fs->flow, fs->viscous, r, pa));
  PetscCall(VecRestoreArray(p, &pa));
  PetscCall(VecRestoreArray(fs->t_p, &r));
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* u += M_r^{-1} P^T B^T p, and the viscous part with the u before: the projection step with the rotational pressure update */
static PetscErrorCode project(FlowSolver fs, Vec x, Vec u, Vec p)
{
  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->G, p, fs->t_u));
  PetscCall(FlowSolverApplyMassInverse(fs, fs->t_u, fs->t_u2));
  if (fs->share_of_pressure < 1) PetscCall(VecScale(p, fs->share_of_pressure));
  PetscCall(add_viscous(fs, x, u, p));
  PetscCall(VecAXPY(u, -1, fs->t_u2));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* p <- S_p^{-1} (B M_r^{-1} A_r M_r^{-1} P^T B^T + C) p, the least-squares commutator */
static PetscErrorCode commute(FlowSolver fs, Vec p)
{
  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->G, p, fs->t_u));
  PetscCall(VecScale(fs->t_u, -1));
  PetscCall(FlowSolverApplyMassInverse(fs, fs->t_u, fs->t_u2));
  PetscCall(MatMult(fs->Ar, fs->t_u2, fs->t_u));
  PetscCall(FlowSolverApplyMassInverse(fs, fs->t_u, fs->t_u2));
  PetscCall(MatMult(fs->B, fs->t_u2, fs->t_p));
  if (fs->C) {
    PetscCall(MatMult(fs->C, p, fs->t_p2));
    PetscCall(VecAXPY(fs->t_p, 1, fs->t_p2));
  }
  PetscCall(KSPSolve(fs->sub[1], fs->t_p, p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = fieldsplit (x), then projection or commutator, see the header */
static PetscErrorCode apply_projection(PC pc, Vec x, Vec y)
{
  FlowSolver fs;
  PetscReal *a;
  Vec        u, p;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &fs));
  PetscCall(PCApply(fs->split, x, y));
  PetscCall(VecGetArray(y, &a));
  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, fs->nur, PETSC_DETERMINE, a, &u));
  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, fs->np, PETSC_DETERMINE, a + fs->nur, &p));
  if (fs->viscous_only) PetscCall(add_viscous(fs, x, u, p));
  else if (fs->commute) PetscCall(commute(fs, p));
  else PetscCall(project(fs, x, u, p));
  PetscCall(VecDestroy(&u));
  PetscCall(VecDestroy(&p));
  PetscCall(VecRestoreArray(y, &a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view_projection(PC pc, PetscViewer viewer)
{
  FlowSolver fs;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &fs));
  PetscCall(PetscViewerASCIIPrintf(viewer, "  fieldsplit, then %s\n", fs->commute ? "least-squares commutator" : "projection with the lumped mass"));
  PetscCall(PetscViewerASCIIPushTab(viewer));
  PetscCall(PCView(fs->split, viewer));
  PetscCall(PetscViewerASCIIPopTab(viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Set up the inner fieldsplit and point its pressure solver at S_p instead of the true Schur complement. */
static PetscErrorCode set_up_projection(PC pc)
{
  FlowSolver fs;
  PetscInt   n;
  Mat        Sp, Sp_pre;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &fs));
  PetscCall(PressureGetMats(fs->pressure, &Sp, &Sp_pre));
  PetscCall(PCFieldSplitSetSchurPre(fs->split, PC_FIELDSPLIT_SCHUR_PRE_USER, Sp_pre));
  PetscCall(PCSetUp(fs->split));
  PetscCall(PetscFree(fs->sub));
  PetscCall(PCFieldSplitSchurGetSubKSP(fs->split, &n, &fs->sub));
  PetscCall(KSPSetOperators(fs->sub[1], Sp, Sp_pre));
  PetscCall(PressureSetUpPC(fs->pressure, fs->sub[1]));
  PetscCall(KSPSetUp(fs->sub[0]));
  PetscCall(KSPSetUp(fs->sub[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- creation ---- */

static PetscErrorCode set_recipe(FlowSolver fs, PetscBool moving)
{
  const char *outer[][2] = {{"1", "1e-10"}, {"200", "1e-8"}, {"200", "1e-9"}, {"20", "1e-10"}};
  const char *inner[][2] = {{"1e-2", "1e-1"}, {"1e-2", "1e-2"}, {"1e-2", "1e-2"}, {"1e-2", "1e-2"}};
  PetscInt    recipe     = 1;
  PetscBool   sweep_only, given;

  PetscFunctionBeginUser;
  PetscCall(OptChoice("-flow_recipe", RECIPES, &recipe));
  fs->fixed = (PetscBool)(recipe == 0);
  if (recipe == 0) fs->schur = SCHUR_PROJECTION; /* a single sweep must end with the projection */
  PetscCall(OptChoice("-flow_schur", SCHURS, &fs->schur));
  PetscCall(OptChoice("-flow_velocity_sweep", SWEEPS, &fs->sweep_type));
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_ksp_rtol", &given));
  if (recipe == 1 && !given) PetscCall(OptDefault("-flow_rtol_start", "1e-2")); /* as an option: a restart finds both in its checkpoint */
  if (moving) PetscCall(OptDefault("-flow_rtol_most", "1e-6"));                 /* the momentum of a heavy body is most of the right-hand side */
  fs->rtol_most = 1e-5;
  PetscCall(OptReal("-flow_rtol_start", &fs->rtol_start));
  PetscCall(OptReal("-flow_rtol_most", &fs->rtol_most));
  /* with bodies that move the sweep must not add to the residual: two falling discs blow up within 20 steps otherwise */
  sweep_only = (PetscBool)(recipe == 0 && !moving);
  PetscCall(OptDefault("-flow_ksp_type", sweep_only ? "richardson" : "fgmres"));
  PetscCall(OptDefault("-flow_ksp_max_it", outer[recipe][0]));
  PetscCall(OptDefault("-flow_ksp_rtol", outer[recipe][1]));
  if (recipe == 0) PetscCall(OptDefault("-flow_ksp_convergence_test", "skip"));
  if (sweep_only) PetscCall(OptDefault("-flow_ksp_norm_type", "none")); /* or the sweep would run a second time for the norm */
  if (recipe > 0) PetscCall(OptDefault("-flow_ksp_gmres_restart", "60"));
  if (recipe == 3) {
    PetscCall(OptDefault("-flow_pc_type", "lu"));
    PetscCall(OptDefault("-flow_pc_factor_mat_solver_type", "mumps"));
    PetscCall(OptDefault("-flow_mat_mumps_icntl_24", "1")); /* leave null pivots out: pressures of cut cells without a free velocity */
  } else {
    PetscCall(OptDefault("-flow_fieldsplit_velocity_ksp_type", "gcr")); /* 3 sweeps where bcgs does 5 (viscous number 0.4), 43 for 61 (70) */
    PetscCall(OptDefault("-flow_fieldsplit_velocity_ksp_gcr_restart", "10"));
    PetscCall(OptDefault("-flow_fieldsplit_velocity_ksp_rtol", inner[recipe][0]));
    PetscCall(OptDefault("-flow_fieldsplit_velocity_ksp_max_it", "200"));
    PetscCall(OptDefault("-flow_fieldsplit_velocity_pc_type", "sor"));
    PetscCall(OptDefault("-flow_fieldsplit_pressure_ksp_type", "cg"));
    PetscCall(OptDefault("-flow_fieldsplit_pressure_ksp_rtol", inner[recipe][1]));
    PetscCall(OptDefault("-flow_fieldsplit_pressure_ksp_max_it", "200"));
    PetscCall(PressureSetDefaults());
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Which preconditioners need assembled matrices */
static PetscErrorCode choose_assembly(FlowSolver fs)
{
  char      type[64];
  PetscBool set, in;

  PetscFunctionBeginUser;
  PetscCall(PetscOptionsGetString(NULL, NULL, "-flow_pc_type", type, sizeof(type), &set));
  fs->need_whole = set;
  PetscCall(PetscOptionsGetString(NULL, NULL, "-flow_fieldsplit_velocity_pc_type", type, sizeof(type), &set));
  if (fs->need_whole || !set) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscStrInList(type, "none,jacobi,sor", ',', &in));
  fs->need_Ar = (PetscBool)!in;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The pressure that is constant in the fluid and zero in dead cells */
static PetscErrorCode find_constant_pressure(FlowSolver fs)
{
  Vec        constant;
  PetscReal *a;

  PetscFunctionBeginUser;
  PetscCall(MatNullSpaceDestroy(&fs->constant_pressure));
  PetscCall(VecDuplicate(fs->x, &constant));
  PetscCall(VecGetArrayWrite(constant, &a));
  PetscCall(PetscArrayzero(a, fs->nur));
  PetscCall(PressureGetConstant(fs->pressure, a + fs->nur));
  PetscCall(VecRestoreArrayWrite(constant, &a));
  PetscCall(VecNormalize(constant, NULL));
  PetscCall(MatNullSpaceCreate(PETSC_COMM_WORLD, PETSC_FALSE, 1, &constant, &fs->constant_pressure));
  PetscCall(VecDestroy(&constant));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_operators(FlowSolver fs)
{
  Mat block[4];

  PetscFunctionBeginUser;
  PetscCall(FlowSolverCreateShells(fs));
  block[0] = fs->Ar;
  block[1] = fs->G;
  block[2] = fs->B;
  block[3] = NULL;
  if (fs->nbodies) block[3] = fs->C;
  PetscCall(MatCreateNest(PETSC_COMM_WORLD, 2, NULL, 2, NULL, block, &fs->nest));
  PetscCall(MatCreateVecs(fs->nest, &fs->x, &fs->b));
  PetscCall(VecDuplicate(fs->x, &fs->r));
  PetscCall(VecDuplicate(fs->x, &fs->y));
  PetscCall(ConstraintCreateVec(fs->constraint, &fs->t_u));
  PetscCall(VecDuplicate(fs->t_u, &fs->t_u2));
  PetscCall(VecCreateMPI(PETSC_COMM_WORLD, fs->np, PETSC_DETERMINE, &fs->t_p));
  PetscCall(VecDuplicate(fs->t_p, &fs->t_p2));
  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, fs->loc->dim, fs->nodal, PETSC_DETERMINE, NULL, &fs->xn));
  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, fs->loc->dim, fs->nodal, PETSC_DETERMINE, NULL, &fs->yn));
  PetscCall(find_constant_pressure(fs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_solvers(FlowSolver fs)
{
  PC pc;
  IS is[2];

  PetscFunctionBeginUser;
  PetscCall(KSPCreate(PETSC_COMM_WORLD, &fs->ksp));
  PetscCall(KSPSetOptionsPrefix(fs->ksp, "flow_"));
  PetscCall(KSPGetPC(fs->ksp, &pc));
  if (!fs->need_whole) {
    PetscCall(PCSetType(pc, PCSHELL));
    PetscCall(PCShellSetContext(pc, fs));
    PetscCall(PCShellSetName(pc, "projection"));
    PetscCall(PCShellSetSetUp(pc, set_up_projection));
    PetscCall(PCShellSetApply(pc, apply_projection));
    PetscCall(PCShellSetView(pc, view_projection));
    PetscCall(PCCreate(PETSC_COMM_WORLD, &fs->split));
    PetscCall(PCSetOptionsPrefix(fs->split, "flow_"));
    PetscCall(PCSetType(fs->split, PCFIELDSPLIT));
    PetscCall(MatNestGetISs(fs->nest, is, NULL));
    PetscCall(PCFieldSplitSetIS(fs->split, "velocity", is[0]));
    PetscCall(PCFieldSplitSetIS(fs->split, "pressure", is[1]));
    PetscCall(PCFieldSplitSetType(fs->split, PC_COMPOSITE_SCHUR));
    PetscCall(PCFieldSplitSetSchurFactType(fs->split, PC_FIELDSPLIT_SCHUR_FACT_LOWER));
    PetscCall(PCSetFromOptions(fs->split));
  }
  PetscCall(KSPSetFromOptions(fs->ksp));
  PetscCall(KSPGetTolerances(fs->ksp, &fs->rtol, NULL, NULL, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverCreate(Flow flow, Constraint constraint, PetscBool moving, FlowSolver *solver)
{
  FlowSolver       fs;
  PetscInt         first, count;
  const PetscReal *h;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&fs));
  fs->flow       = flow;
  fs->constraint = constraint;
  PetscCall(FlowGetMesh(flow, &fs->mesh));
  PetscCall(MeshGetLocal(fs->mesh, &fs->loc));
  PetscCall(ConstraintGetSizes(constraint, &fs->nodal, &fs->nur));
  PetscCall(ConstraintGetRigidSize(constraint, &fs->nr));
  PetscCall(ConstraintGetOwnBodies(constraint, &first, &count));
  PetscCall(MPIU_Allreduce(&count, &fs->nbodies, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD));
  fs->np = fs->loc->ncell * (fs->loc->dim + 1);
  PetscCall(FlowGetCellSize(flow, &h));
  for (PetscInt e = 0; e < fs->loc->ncell; e++) fs->h_max = PetscMax(fs->h_max, h[e]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &fs->h_max, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  PetscCall(set_recipe(fs, moving));
  PetscCall(choose_assembly(fs));
  PetscCall(FlowGetMatrix(flow, &fs->S));
  PetscCall(MatCreateMAIJ(fs->S, fs->loc->dim, &fs->S_all));
  fs->A = fs->S_all;
  PetscCall(RelaxCreate(fs->S, fs->loc->dim, &fs->sweep));
  PetscCall(BodyBlocksCreate(flow, constraint, &fs->blocks));
  PetscCall(PetscCalloc3(fs->nbodies * fs->nr * fs->nr, &fs->D, count * fs->nr * fs->nr, &fs->body_inverse, fs->nbodies * fs->nr * fs->nr,
                         &fs->mass_inverse));
  PetscCall(
    PetscCalloc3(fs->nodal, &fs->diagonal_inverse, fs->loc->nnode_all * fs->loc->dim, &fs->weight, fs->loc->nnode_all * fs->loc->dim, &fs->local));
  PetscCall(PetscCalloc2(fs->loc->nnode_all, &fs->share, 2 * fs->nbodies * fs->nr, &fs->rigid_work));
  PetscCall(PressureCreate(flow, constraint, &fs->pressure));
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
  PetscCall(PetscFree(fs->sub));
  PetscCall(PCDestroy(&fs->split));
  PetscCall(PressureDestroy(&fs->pressure));
  PetscCall(MatNullSpaceDestroy(&fs->constant_pressure));
  PetscCall(MatDestroy(&fs->S_all));
  PetscCall(MatDestroy(&fs->Ar));
  PetscCall(MatDestroy(&fs->G));
  PetscCall(MatDestroy(&fs->B));
  PetscCall(MatDestroy(&fs->C));
  PetscCall(MatDestroy(&fs->nest));
  PetscCall(MatDestroy(&fs->Ar_assembled));
  PetscCall(MatDestroy(&fs->whole));
  PetscCall(VecDestroy(&fs->xn));
  PetscCall(VecDestroy(&fs->yn));
  PetscCall(VecDestroy(&fs->b));
  PetscCall(VecDestroy(&fs->x));
  PetscCall(VecDestroy(&fs->r));
  PetscCall(VecDestroy(&fs->y));
  PetscCall(VecDestroy(&fs->t_u));
  PetscCall(VecDestroy(&fs->t_u2));
  PetscCall(VecDestroy(&fs->t_p));
  PetscCall(VecDestroy(&fs->t_p2));
  PetscCall(PetscFree3(fs->D, fs->body_inverse, fs->mass_inverse));
  PetscCall(PetscFree3(fs->diagonal_inverse, fs->weight, fs->local));
  PetscCall(PetscFree2(fs->share, fs->rigid_work));
  PetscCall(PetscFree(fs->saved));
  PetscCall(RelaxDestroy(&fs->sweep));
  PetscCall(BodyBlocksDestroy(&fs->blocks));
  PetscCall(PetscFree(*solver));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverView(FlowSolver fs, PetscViewer viewer)
{
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(FlowSolverGetUnknowns(fs, &n));
  PetscCall(PetscViewerASCIIPrintf(viewer, "solver: %" PetscInt_FMT " unknowns, %s, velocity matrix %s\n", n,
                                   fs->need_whole ? "assembled saddle point system" : "fieldsplit with projected operators",
                                   fs->need_Ar || fs->need_whole ? "assembled" : "matrix-free over one scalar matrix"));
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
  PetscCall(PetscArraycpy(fs->D, D, fs->nbodies * fs->nr * fs->nr));
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
  PetscCall(find_constant_pressure(fs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sets *has if the velocity of some body is unknown */
static PetscErrorCode find_free_bodies(FlowSolver fs, PetscBool *has)
{
  const PetscInt *unknown;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetUnknown(fs->constraint, &unknown));
  for (PetscInt k = 0; k < fs->nbodies; k++)
    if (unknown[k]) *has = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What follows the pressure solve, and the preconditioner of the velocity, by the viscous and the convective number of the step with the smallest cell */
static PetscErrorCode choose_methods(FlowSolver fs)
{
  const FlowParameters *par;
  const FlowStep       *step;
  PetscReal            *u, speed = 0, t, viscous, convective;
  PetscBool             moves = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(find_free_bodies(fs, &moves));
  PetscCall(FlowGetParameters(fs->flow, &par));
  PetscCall(FlowGetStep(fs->flow, &step));
  PetscCall(FlowGetFields(fs->flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < fs->nodal; i++) speed = PetscMax(speed, PetscAbsReal(u[i]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &speed, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  t                     = step->ct > 0 ? step->theta / (step->ct * fs->loc->h) : PETSC_MAX_REAL;
  viscous               = par->viscosity * t / (par->density * fs->loc->h);
  convective            = speed * t;
  fs->factorise         = (PetscBool)(fs->sweep_type == SWEEP_ILU ||
                              (fs->sweep_type == SWEEP_AUTO && (convective > FACTORISE_FROM || viscous > FACTORISE_FROM ||
                                                                convective > PetscMax(FACTORISE_FROM_UNRESOLVED, 5 * viscous))));
  fs->commute           = (PetscBool)(fs->schur == SCHUR_COMMUTATOR || step->dt == 0); /* the projection is for time steps only */
  fs->viscous_only      = PETSC_FALSE;
  fs->share_of_pressure = fs->fixed && viscous * PetscSqr(fs->loc->h / fs->h_max) < WHOLE_FROM ? SHARE_BELOW : 1;
  if (fs->commute || fs->schur == SCHUR_PROJECTION) PetscFunctionReturn(PETSC_SUCCESS);
  fs->viscous_only = (PetscBool)(fs->nbodies == 0 && viscous > VISCOUS_FROM && convective * convective < 10 * viscous);
  fs->commute      = (PetscBool)((fs->nbodies > 0 && !fs->fitted && !FlowSolverIsSoft(fs) &&
                             viscous > (moves ? COMMUTATOR_FROM : COMMUTATOR_FROM_KNOWN)) ||
                            convective > COMMUTATOR_FROM_CONVECTION || (convective > COMMUTATOR_FROM_UNRESOLVED && convective > 50 * viscous));
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
  fs->scale   = step->dt > 0 ? par->density * step->ct : par->viscosity / (fs->loc->h * fs->loc->h);
  fs->viscous = par->viscosity * step->theta / fs->scale;
  PetscCall(choose_methods(fs));
  PetscCall(set_up_diagonals(fs));
  PetscCall(PetscLogEventBegin(TB_VEL_FACTOR, 0, 0, 0, 0));
  PetscCall(RelaxUpdate(fs->sweep, fs->diagonal_inverse, fs->factorise));
  PetscCall(PetscLogEventEnd(TB_VEL_FACTOR, 0, 0, 0, 0));
  if (fs->nbodies)
    PetscCall(BodyBlocksUpdate(fs->blocks, fs->share, FlowSolverIsSoft(fs) ? fs->soft : NULL, fs->D, fs->scale, fs->body_inverse, fs->mass_inverse));
  PetscCall(PressureUpdate(fs->pressure, fs->weight, FlowSolverIsSoft(fs) ? fs->share : NULL, fs->mass_inverse));
  PetscCall(PressureIsSingular(fs->pressure, &singular));
  PetscCall(MatSetNullSpace(fs->nest, singular ? fs->constant_pressure : NULL));
  PetscCall(assemble_on_demand(fs));
  PetscCall(MatAssemblyBegin(fs->Ar, MAT_FINAL_ASSEMBLY)); /* tell PETSc that the values behind the shells have changed */
  PetscCall(MatAssemblyEnd(fs->Ar, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyBegin(fs->nest, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(fs->nest, MAT_FINAL_ASSEMBLY));
  if (fs->split) PetscCall(PCSetOperators(fs->split, fs->nest, fs->nest));
  if (fs->need_Ar) {
    Mat block[4] = {fs->Ar_assembled, fs->G, fs->B, fs->C}, pre;

    PetscCall(MatCreateNest(PETSC_COMM_WORLD, 2, NULL, 2, NULL, block, &pre));
    PetscCall(PCSetOperators(fs->split, fs->nest, pre));
    PetscCall(MatDestroy(&pre));
    PetscCall(PCFieldSplitSetDiagUseAmat(fs->split, PETSC_TRUE));
    PetscCall(PCFieldSplitSetOffDiagUseAmat(fs->split, PETSC_TRUE));
  }
  PetscCall(KSPSetOperators(fs->ksp, fs->nest, fs->need_whole ? fs->whole : fs->nest));
  PetscCall(KSPSetUp(fs->ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The penalty's share in the right-hand side of known velocities U and known nodal values c: y -= G U, rigid -= H U - G^T c (own bodies) */
static PetscErrorCode add_known_soft(FlowSolver fs, const PetscReal c[], PetscReal y[], PetscReal rigid[])
{
  const PetscInt  *unknown, *index, nr = fs->nr, nn = nr * nr;
  const PetscReal *U;
  PetscReal       *local = fs->rigid_work, *U_local = fs->rigid_work + fs->nbodies * nr;
  PetscInt         n, first, count;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetUnknown(fs->constraint, &unknown));
  PetscCall(ConstraintGetRigid(fs->constraint, &U));
  PetscCall(ConstraintGetOwnBodies(fs->constraint, &first, &count));
  PetscCall(ConstraintGetLocalRigid(fs->constraint, &n, &index, NULL));
  for (PetscInt k = 0; k < fs->nbodies; k++)
    for (PetscInt s = 0; s < nr && index[k] >= 0; s++) {
      U_local[index[k] * nr + s] = U[k * nr + s];
      local[index[k] * nr + s]   = 0;
    }
  PetscCall(PenaltyTermMultAdd(fs->soft, fs->constraint, PETSC_FALSE, U_local, c, y, local));
  for (PetscInt i = 0; i < n * nr; i++) local[i] = -local[i];
  PetscCall(ConstraintDeliverRigid(fs->constraint, local, rigid));
  for (PetscInt k = 0; k < count; k++)
    for (PetscInt m = 0; m < nn; m++)
      if ((unknown[first + k] >> (m / nr)) & 1 && !((unknown[first + k] >> (m % nr)) & 1))
        rigid[k * nr + m / nr] -= fs->soft->H[(first + k) * nn + m] * U[(first + k) * nr + m % nr];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where the pressure has an undetermined constant, the flux of the prescribed velocity c through the boundary must vanish. What interpolation and round-off leave of it is spread
   over all cells. */
static PetscErrorCode spread_net_flux(FlowSolver fs, const PetscReal c[])
{
  const MeshLocal *l    = fs->loc;
  PetscReal        flux = 0, speed = 0, length = 0;
  const PetscReal *b;
  MatNullSpace     constant;

  PetscFunctionBeginUser;
  PetscCall(MatGetNullSpace(fs->nest, &constant));
  if (!constant) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecGetArrayRead(fs->b, &b));
  for (PetscInt i = fs->nur; i < fs->nur + fs->np; i += l->dim + 1) flux += b[i] / fs->scale;
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

/* b = [P^T (r - A c) + g; -B c] */
static PetscErrorCode build_rhs(FlowSolver fs, const PetscReal r[], const PetscReal g[])
{
  const PetscReal *known;
  const PetscInt  *unknown;
  PetscReal       *b, *c = fs->local;
  PetscInt         first, count;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetKnown(fs->constraint, &known));
  PetscCall(ConstraintGetUnknown(fs->constraint, &unknown));
  PetscCall(ConstraintGetOwnBodies(fs->constraint, &first, &count));
  PetscCall(VecGetArray(fs->b, &b));
  PetscCall(PetscArraycpy(c, known, fs->loc->nnode_all * fs->loc->dim));
  PetscCall(VecPlaceArray(fs->xn, c));
  PetscCall(VecPlaceArray(fs->yn, b));
  PetscCall(MatMult(fs->A, fs->xn, fs->yn));
  PetscCall(VecResetArray(fs->xn));
  PetscCall(VecResetArray(fs->yn));
  for (PetscInt i = 0; i < count * fs->nr; i++) b[fs->nodal + i] = (unknown[first + i / fs->nr] >> (i % fs->nr)) & 1 ? g[first * fs->nr + i] : 0;
  if (FlowSolverIsSoft(fs)) PetscCall(add_known_soft(fs, c, b, b + fs->nodal));
  for (PetscInt i = 0; i < fs->nodal; i++) b[i] = r[i] - b[i];
  PetscCall(ConstraintReduceInPlace(fs->constraint, b, b + fs->nodal));
  PetscCall(FlowDivergence(fs->flow, c, b + fs->nur));
  for (PetscInt i = fs->nur; i < fs->nur + fs->np; i++) b[i] *= -fs->scale;
  PetscCall(VecRestoreArray(fs->b, &b));
  PetscCall(spread_net_flux(fs, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverCreateVec(FlowSolver fs, Vec *x)
{
  PetscFunctionBeginUser;
  PetscCall(VecDuplicate(fs->x, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverGetOperator(FlowSolver fs, Mat *K)
{
  PetscFunctionBeginUser;
  *K = fs->nest;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetVelocity(FlowSolver fs, Mat A)
{
  PetscFunctionBeginUser;
  fs->A = A ? A : fs->S_all;
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

PetscErrorCode FlowSolverResidual(FlowSolver fs, const PetscReal r[], const PetscReal g[], Vec x, Vec f)
{
  PetscFunctionBeginUser;
  PetscCall(build_rhs(fs, r, g));
  PetscCall(MatMult(fs->nest, x, f));
  PetscCall(VecAXPY(f, -1, fs->b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverCorrect(FlowSolver fs, Vec f, Vec y, PetscInt *its, KSPConvergedReason *reason)
{
  MatNullSpace constant;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_SOLVE, 0, 0, 0, 0));
  PetscCall(VecCopy(f, fs->b));
  PetscCall(MatGetNullSpace(fs->nest, &constant));
  if (constant) PetscCall(MatNullSpaceRemove(constant, fs->b)); /* the round-off of a small residual would dominate */
  PetscCall(VecZeroEntries(y));
  PetscCall(KSPSetTolerances(fs->ksp, fs->rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPSolve(fs->ksp, fs->b, y));
  PetscCall(KSPGetIterationNumber(fs->ksp, its));
  PetscCall(KSPGetConvergedReason(fs->ksp, reason));
  PetscCall(PetscLogEventEnd(TB_FLOW_SOLVE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* q = dp without the pressures of cells that lie in bodies: no equation knows them, and what is added once would be added in every step */
static PetscErrorCode take_known_pressures(FlowSolver fs, const PetscReal dp[], PetscReal q[])
{
  const MeshLocal *l = fs->loc;
  const PetscInt  *body, nk = l->dim + 1;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(fs->constraint, &body));
  PetscCall(PetscArraycpy(q, dp, fs->np));
  for (PetscInt c = 0; c < l->ncell && fs->nbodies; c++) {
    PetscInt j = 0;

    while (j < l->nb && body[l->cell_node[c * l->nb + j]] >= 0) j++;
    for (PetscInt k = 0; k < nk && j == l->nb; k++) q[c * nk + k] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Go along dp from the start value's pressure to where its residual r is smallest, at most a whole step and never back: longer ones follow the noise of a pressure that hardly changes,
   and grow from step to step. Where the flow changes smoothly it is a whole step (a second one would follow from the first by solving for it); where bodies move, the pressure jumps and
   the step is short. */
static PetscErrorCode shift_pressure(FlowSolver fs, const PetscReal dp[])
{
  PetscReal       *x, *r, *known, sum[2] = {0, 0};
  const PetscReal *q, *g, *c = NULL; /* a whole step adds q to the pressure and takes g, c from r */

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayWrite(fs->t_p, &known));
  PetscCall(take_known_pressures(fs, dp, known));
  PetscCall(VecRestoreArrayWrite(fs->t_p, &known));
  PetscCall(MatMult(fs->G, fs->t_p, fs->t_u));
  if (fs->C) PetscCall(MatMult(fs->C, fs->t_p, fs->t_p2));
  PetscCall(VecGetArray(fs->x, &x));
  PetscCall(VecGetArray(fs->r, &r));
  PetscCall(VecGetArrayRead(fs->t_u, &g));
  PetscCall(VecGetArrayRead(fs->t_p, &q));
  if (fs->C) PetscCall(VecGetArrayRead(fs->t_p2, &c));
  for (PetscInt i = 0; i < fs->nur; i++) {
    sum[0] += g[i] * r[i];
    sum[1] += g[i] * g[i];
  }
  for (PetscInt i = 0; i < fs->np && c; i++) {
    sum[0] += c[i] * r[fs->nur + i];
    sum[1] += c[i] * c[i];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  if (sum[1] > 0) {
    const PetscReal step = PetscMin(1, PetscMax(0, sum[0] / sum[1]));

    for (PetscInt i = 0; i < fs->nur; i++) r[i] -= step * g[i];
    for (PetscInt i = 0; i < fs->np && c; i++) r[fs->nur + i] -= step * c[i];
    for (PetscInt i = 0; i < fs->np; i++) x[fs->nur + i] += step * q[i];
  }
  if (fs->C) PetscCall(VecRestoreArrayRead(fs->t_p2, &c));
  PetscCall(VecRestoreArrayRead(fs->t_p, &q));
  PetscCall(VecRestoreArrayRead(fs->t_u, &g));
  PetscCall(VecRestoreArray(fs->r, &r));
  PetscCall(VecRestoreArray(fs->x, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* r = b - K x with the start value x, its pressure improved */
static PetscErrorCode start_from(FlowSolver fs, const PetscReal dp[])
{
  MatNullSpace constant;

  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->nest, fs->x, fs->r));
  PetscCall(VecAYPX(fs->r, -1, fs->b));
  if (dp && !fs->fixed && !fs->need_whole) PetscCall(shift_pressure(fs, dp));
  PetscCall(MatGetNullSpace(fs->nest, &constant));
  if (constant) PetscCall(MatNullSpaceRemove(constant, fs->r)); /* the round-off of a small residual would dominate */
  PetscCall(VecZeroEntries(fs->y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The tolerance of the correction y; enough: the start value (or zero, if that is better) meets it. */
static PetscErrorCode set_tolerance(FlowSolver fs, PetscBool *enough)
{
  PetscReal start, rhs, target;

  PetscFunctionBeginUser;
  *enough = PETSC_FALSE;
  if (fs->fixed) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecNorm(fs->r, NORM_2, &start));
  PetscCall(VecNorm(fs->b, NORM_2, &rhs));
  if (start > rhs) { /* such as when all comes to rest within a step */
    PetscCall(VecZeroEntries(fs->x));
    PetscCall(VecCopy(fs->b, fs->r));
    start = rhs;
  }
  target  = PetscMax(fs->rtol * rhs, PetscMin(fs->rtol_start * start, fs->rtol_most * rhs));
  *enough = (PetscBool)(start <= target);
  if (!*enough && start < PETSC_MAX_REAL) PetscCall(KSPSetTolerances(fs->ksp, target / start, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSolve(FlowSolver fs, const PetscReal r[], const PetscReal g[], PetscReal u[], PetscReal p[], const PetscReal dp[],
                               PetscReal U[], PetscInt *its, KSPConvergedReason *reason)
{
  PetscBool enough;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_SOLVE, 0, 0, 0, 0));
  PetscCall(build_rhs(fs, r, g));
  PetscCall(FlowSolverPack(fs, u, p, U, fs->x));
  PetscCall(start_from(fs, dp));
  PetscCall(set_tolerance(fs, &enough));
  *its    = 0;
  *reason = KSP_CONVERGED_RTOL;
  if (!enough) {
    PetscCall(KSPSolve(fs->ksp, fs->r, fs->y));
    PetscCall(KSPGetIterationNumber(fs->ksp, its));
    PetscCall(KSPGetConvergedReason(fs->ksp, reason));
    PetscCall(VecAXPY(fs->x, 1, fs->y));
  }
  PetscCall(FlowSolverUnpack(fs, fs->x, u, p, U));
  PetscCall(PetscLogEventEnd(TB_FLOW_SOLVE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
