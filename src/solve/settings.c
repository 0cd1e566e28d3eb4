/* FlowSolver: the recipes, as options of all solvers (see system.h). What depends on the numbers of a step is in
   choice.c. */
#include "compat.h"
#include "impl.h"
#include "krylov/lean.h"
#include "base/opt.h"

#define LOOSE 1e-3 /* tolerance from which a single projection is enough around bodies */

/* Solver fast around bodies: iterations at least, and residual that they leave as fraction of the start value's
   (runs/studies/fast) */
#define FAST_ITERATIONS "2"
#define FAST_RESIDUAL   "0.1"
/* Of the right-hand side, with which one iteration is enough where bodies move (runs/studies/flow-solver) */
#define FAST_ONCE      "1e-2"
#define BALANCED_PLANE "2e-3"
#define BALANCED_SPACE "3e-3"

static const char *const KINDS[]     = {"fast", "balanced", "accurate", "direct", NULL};
static const char *const SCHURS[]    = {"auto", "projection", "commutator", "two_stage", NULL};
static const char *const SMOOTHERS[] = {"jacobi", "sor", "ilu", "auto", NULL}; /* in the order of RelaxKind */

/* Which preconditioners need assembled matrices */
static PetscErrorCode choose_assembly(FlowSolver fs)
{
  char      type[64];
  PetscBool set, in;

  PetscFunctionBeginUser;
  PetscCall(PetscOptionsGetString(NULL, NULL, "-flow_pc_type", type, sizeof(type), &set));
  fs->set.need_whole = set;
  PetscCall(PetscOptionsGetString(NULL, NULL, VELOCITY "pc_type", type, sizeof(type), &set));
  if (fs->set.need_whole || !set) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscStrInList(type, "none,jacobi,sor", ',', &in));
  fs->set.need_Ar = (PetscBool)!in;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Two stages around bodies, unless one projection meets the tolerance, for which two are too dear */
static PetscErrorCode choose_stages(FlowSolver fs)
{
  PetscReal rtol = 0;
  PetscBool whole;

  PetscFunctionBeginUser;
  PetscCall(PetscOptionsGetReal(NULL, NULL, "-flow_ksp_rtol", &rtol, NULL));
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_pc_type", &whole));
  fs->set.stages = (PetscBool)(fs->set.schur == SCHUR_TWO_STAGE ||
                               (fs->set.schur == SCHUR_AUTO && fs->nbodies > 0 && !whole &&
                                fs->set.kind != SOLVER_DIRECT &&
                                PetscMax(rtol, fs->stop.rtol_start > 0 ? fs->stop.rtol_max : 0) < LOOSE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Solver fast: without bodies a single sweep, which must end with the projection; around bodies some iterations with
   two stages, unless another preconditioner of the whole system is wanted */
static PetscErrorCode choose_fast_schur(FlowSolver fs)
{
  PetscBool whole;

  PetscFunctionBeginUser;
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_pc_type", &whole));
  fs->set.single_projection = (PetscBool)(fs->nbodies == 0);
  if (fs->set.single_projection) fs->set.schur = SCHUR_PROJECTION;
  else if (!whole) fs->set.schur = SCHUR_TWO_STAGE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The outer iteration: how far, and how many at least. What depends on the recipe is set as options, which a restart
   finds in its checkpoint. */
static PetscErrorCode set_outer(FlowSolver fs)
{
  const SolverKind  kind   = (SolverKind)fs->set.kind;
  const PetscBool   moving = fs->set.moving;
  const char *const rtol[] = {"1e-8", "1e-8", "1e-9", "1e-10"}; /* by kind */
  PetscBool         sweeps, given, bound, error;
  PetscBool         closed; /* elsewhere nothing but the residual balances the momentum: conserve.c */

  PetscFunctionBeginUser;
  PetscCall(ConditionsPressureIsFloating(FlowConditions(fs->flow), &closed));
  for (PetscInt a = 0; a < fs->loc->dim; a++) closed = (PetscBool)(closed && fs->loc->period[a] == 0);
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_ksp_rtol", &given));
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_rtol_max", &bound));
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_velocity_tol", &error));
  if (kind == SOLVER_FAST && !fs->set.single_projection) {
    if (!given) PetscCall(OptDefault("-flow_rtol_start", FAST_RESIDUAL));
    PetscCall(OptDefault("-flow_rtol_max", "1"));
    PetscCall(OptDefault("-flow_min_it", FAST_ITERATIONS));
    if (moving && closed && !given) PetscCall(OptDefault("-flow_one_it_rtol", FAST_ONCE));
  } else if (moving) {
    PetscCall(OptDefault("-flow_rtol_max", kind == SOLVER_BALANCED ? PetscStringize(FLOW_BALANCED_MAX) : "1e-6"));
  }
  if (kind == SOLVER_BALANCED && moving && closed && !given && !bound)
    PetscCall(OptDefault("-flow_one_it_rtol", fs->loc->dim == 2 ? BALANCED_PLANE : BALANCED_SPACE));
  if (kind == SOLVER_BALANCED && !given)
    PetscCall(OptDefault("-flow_rtol_start", PetscStringize(FLOW_BALANCED_RESIDUAL)));
  fs->stop.rtol_max = 1e-5;
  PetscCall(OptReal("-flow_rtol_start", &fs->stop.rtol_start));
  PetscCall(OptReal("-flow_rtol_max", &fs->stop.rtol_max));
  if (moving && kind == SOLVER_BALANCED && !given && !bound && closed)
    PetscCall(OptDefault("-flow_velocity_tol", PetscStringize(FLOW_BALANCED_ERROR)));
  PetscCall(OptReal("-flow_velocity_tol", &fs->stop.velocity_tol));
  /* by what it is content with, since a restart finds all options given */
  fs->stop.check_contact = (PetscBool)(moving && kind == SOLVER_BALANCED && !error && fs->stop.rtol_start > 0 &&
                                       fs->stop.rtol_max == FLOW_BALANCED_MAX);
  PetscCall(OptInt("-flow_min_it", &fs->stop.min_it));
  PetscCall(OptReal("-flow_one_it_rtol", &fs->stop.once_max));
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_ksp_max_it", &sweeps));
  PetscCall(OptDefault("-flow_ksp_type", !fs->set.single_projection
                                           ? (FlowSolverIsOnDevice(fs) ? "fgmres" : LEAN_FGMRES)
                                         : sweeps ? "richardson"
                                                  : "preonly"));
  PetscCall(OptDefault("-flow_ksp_max_it", fs->set.single_projection ? "1" : kind == SOLVER_DIRECT ? "20" : "200"));
  PetscCall(OptDefault("-flow_ksp_rtol", rtol[kind]));
  if (fs->set.single_projection) {
    PetscCall(OptDefault("-flow_ksp_convergence_test", "skip"));
    PetscCall(OptDefault("-flow_ksp_norm_type", "none")); /* or the sweep would run a second time for it */
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_inner(FlowSolver fs)
{
  const FlowParameters *par;
  char                  type[64] = "";
  PetscBool             gmres, cg;
  PetscMPIInt           size;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(fs->flow, &par));
  PetscCallMPI(MPI_Comm_size(fs->comm, &size));
  /* half the vectors of gcr, for one sweep more where a solve takes several. Where viscosities differ every restart
     loses what is needed (runs/studies/rheology). */
  if (FlowHasSymmetricStress(fs->flow) && !par->convection) PetscCall(OptDefault(VELOCITY "ksp_type", "cg"));
  else PetscCall(OptDefault(VELOCITY "ksp_type", FlowSolverIsOnDevice(fs) ? "bcgs" : LEAN_GMRES));
  PetscCall(PetscOptionsGetString(NULL, NULL, VELOCITY "ksp_type", type, sizeof(type), NULL));
  PetscCall(PetscStrInList(type, "gmres,bcgs", ',', &gmres));
  PetscCall(PetscStrcmp(type, "cg", &cg));
  /* the norm that the tolerance speaks of */
  if (gmres) PetscCall(OptDefault(VELOCITY "ksp_pc_side", "right"));
  if (cg && FlowHasSymmetricStress(fs->flow)) PetscCall(OptDefault(VELOCITY "ksp_norm_type", "unpreconditioned"));
  PetscCall(OptDefault(VELOCITY "ksp_gcr_restart", "10"));
  if (FlowHasSymmetricStress(fs->flow)) PetscCall(OptDefault(VELOCITY "ksp_gmres_restart", "100"));
  PetscCall(OptDefault(VELOCITY "ksp_rtol", PetscStringize(LOOSE_VELOCITY)));
  PetscCall(OptDefault(VELOCITY "ksp_max_it", FlowHasSymmetricStress(fs->flow) ? "1000" : "200"));
  PetscCall(OptDefault(VELOCITY "pc_type", "sor"));
  PetscCall(OptDefault("-flow_fieldsplit_pressure_ksp_type", size > 1 && !FlowSolverIsOnDevice(fs) ? LEAN_CG : "cg"));
  /* what the first solve leaves, the outer iteration takes up the more slowly the more viscosities differ */
  PetscCall(OptDefault("-flow_fieldsplit_pressure_ksp_rtol",
                       FlowHasSymmetricStress(fs->flow) && fs->set.kind != SOLVER_FAST ? "1e-2"
                       : fs->set.stages                                                ? "3e-2"
                       : fs->set.kind == SOLVER_FAST                                   ? "1e-1"
                                                                                       : "1e-2"));
  /* what two stages leave of the divergence is the residual itself, which falls faster than that of the preconditioned
     system and is known before the last application (runs/studies/flow-solver) */
  if (fs->set.stages) PetscCall(OptDefault("-flow_fieldsplit_pressure_ksp_norm_type", "unpreconditioned"));
  PetscCall(OptDefault("-flow_fieldsplit_pressure_ksp_max_it", "200"));
  PetscCall(PressureSetDefaults());
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverReadSettings(FlowSolver fs, PetscBool moving)
{
  PetscFunctionBeginUser;
  fs->set.moving = moving;
  fs->set.kind   = SOLVER_BALANCED;
  PetscCall(OptChoice("-flow_solver", KINDS, &fs->set.kind));
  if (fs->set.kind == SOLVER_FAST) PetscCall(choose_fast_schur(fs));
  PetscCall(OptChoice("-flow_schur", SCHURS, &fs->set.schur));
  fs->set.smoother = SMOOTHER_AUTO;
  PetscCall(OptChoice("-flow_velocity_smoother", SMOOTHERS, &fs->set.smoother));
  PetscCall(set_outer(fs));
  PetscCall(choose_stages(fs));
  if (fs->set.kind == SOLVER_DIRECT) {
    PetscCall(OptDefault("-flow_pc_type", "lu"));
    PetscCall(OptDefault("-flow_pc_factor_mat_solver_type", "mumps"));
    PetscCall(OptDefault("-flow_mat_mumps_icntl_14", "100")); /* 64 ranks: runs/studies/scaling; more: direct.c */
    PetscCall(OptDefault("-flow_mat_mumps_icntl_24", "1"));   /* leave null pivots out: pressures of cut cells without a
                                                               free velocity */
  } else PetscCall(set_inner(fs));
  PetscCall(choose_assembly(fs));
  PetscCall(OptBool("-flow_print_choice", &fs->set.print_choice));
  PetscFunctionReturn(PETSC_SUCCESS);
}
