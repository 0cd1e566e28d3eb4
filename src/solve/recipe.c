/* FlowSolver: choice of methods and tolerances (see system.h): the recipes, and what depends on the numbers of a step.
   */
#include "compat.h"
#include "impl.h"
#include "krylov/lean.h"
#include "base/opt.h"

/* Numbers of a step: nu theta/(c_t h^2) with the smallest and with the largest cell, |u| theta/(c_t h) */
typedef enum {
  VISCOUS,
  VISCOUS_OF_LARGEST,
  CONVECTIVE
} Number;

typedef enum {
  COMMUTATOR_FREE,
  COMMUTATOR_KNOWN,
  STAGES_UNRESOLVED,
  STAGES_CONVECTION,
  MASS_ALONE,
  RELAX_SOFT,
  RELAX_RIGID,
  WHOLE_PRESSURE,
  FACTORISE_VISCOUS,
  FACTORISE_CONVECTION,
  FACTORISE_UNRESOLVED,
  ASSEMBLE_VISCOUS,
  ASSEMBLE_CONVECTION,
  SWIFT,
  NTHRESHOLDS
} Threshold;

#define STUDY "runs/studies/flow-solver"

/* From which number on a method is taken, and where that was found out */
static const struct {
  Number      number;
  PetscReal   from;
  const char *what, *study;
} THRESHOLDS[NTHRESHOLDS] = {
  [COMMUTATOR_FREE]      = {VISCOUS, 0.1, "commutator around bodies that move freely, rigid nodes in a staircase", STUDY},
  [COMMUTATOR_KNOWN]     = {VISCOUS, 100, "commutator around bodies whose motion is known, rigid nodes in a staircase", STUDY},
  [STAGES_UNRESOLVED]    = {CONVECTIVE, 0.5, "two stages without bodies in under-resolved flow (cell Reynolds number above 50)", STUDY},
  [STAGES_CONVECTION]    = {CONVECTIVE, 2, "two stages without bodies in any flow", STUDY},
  [MASS_ALONE]           = {VISCOUS, 20, "pressure mass alone, without bodies and two stages, diffusion ahead of convection", STUDY},
  [RELAX_SOFT]           = {VISCOUS, 0.06, "relaxation of cut cells under a penalty, with two_stage", STUDY},
  [RELAX_RIGID]          = {VISCOUS, 0.3, "relaxation of cells with rigid nodes in a staircase, with two_stage", STUDY},
  [WHOLE_PRESSURE]       = {VISCOUS_OF_LARGEST, 0.015, "the whole pressure correction in solver fast, below it a share", STUDY},
  [FACTORISE_VISCOUS]    = {VISCOUS, 1, "incomplete factorisation of the velocity", STUDY},
  [FACTORISE_CONVECTION] = {CONVECTIVE, 1, "incomplete factorisation of the velocity", STUDY},
  [FACTORISE_UNRESOLVED] = {CONVECTIVE, 0.3, "incomplete factorisation in under-resolved flow", STUDY},
  [ASSEMBLE_VISCOUS]     = {VISCOUS, 2, "the same where it is matrix-free and would have to be assembled for that", STUDY},
  [ASSEMBLE_CONVECTION]  = {CONVECTIVE, 2, "the same where it is matrix-free", STUDY},
  [SWIFT]                = {CONVECTIVE, 2, "twice the care where the velocities' error ends a solve", STUDY},
};

#define SHARE_BELOW 0.5  /* of the pressure correction, below WHOLE_PRESSURE */
#define MASS_STEADY 0.9  /* of the pressure's mass beside the commutator where the viscosity varies */
#define MASS_OTHER  0.6  /* with convection or a penalty, which that does not know (runs/studies/rheology) */
#define LOOSE       1e-3 /* tolerance from which a single projection is enough around bodies */

/* Recipe fast around bodies: iterations at least, and residual that they leave as share of the start value's
   (runs/studies/fast) */
#define FAST_ITERATIONS "2"
#define FAST_RESIDUAL   "0.1"
/* Of the right-hand side, with which one iteration is enough where bodies move (runs/studies/flow-solver) */
#define FAST_ONCE      "1e-2"
#define BALANCED_PLANE "2e-3"
#define BALANCED_SPACE "3e-3"
static const char *const RECIPES[] = {"fast", "balanced", "accurate", "direct", NULL};
static const char *const SCHURS[]  = {"auto", "projection", "commutator", "two_stage", NULL};
static const char *const SWEEPS[]  = {"jacobi", "sor", "ilu", "auto", NULL}; /* in the order of RelaxKind */
#define SWEEP_AUTO (RELAX_ILU + 1)

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

/* Two stages around bodies, unless one projection meets the tolerance, for which two are too dear */
static PetscErrorCode choose_stages(FlowSolver fs, PetscBool direct)
{
  PetscReal rtol = 0;
  PetscBool whole;

  PetscFunctionBeginUser;
  PetscCall(PetscOptionsGetReal(NULL, NULL, "-flow_ksp_rtol", &rtol, NULL));
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_pc_type", &whole));
  fs->stages = (PetscBool)(fs->schur == SCHUR_TWO_STAGE || (fs->schur == SCHUR_AUTO && fs->nbodies > 0 && !whole && !direct &&
                                                            PetscMax(rtol, fs->rtol_start > 0 ? fs->rtol_most : 0) < LOOSE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Recipe fast: without bodies a single sweep, which must end with the projection; around bodies some iterations with
   two stages, unless another preconditioner of the whole system is wanted */
static PetscErrorCode choose_fast(FlowSolver fs)
{
  PetscBool whole;

  PetscFunctionBeginUser;
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_pc_type", &whole));
  fs->fast   = PETSC_TRUE;
  fs->single = (PetscBool)(fs->nbodies == 0);
  if (fs->single) fs->schur = SCHUR_PROJECTION;
  else if (!whole) fs->schur = SCHUR_TWO_STAGE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The outer iteration: how far, and how many at least. What depends on the recipe is set as options, which a restart
   finds in its checkpoint. */
static PetscErrorCode set_outer(FlowSolver fs, PetscInt recipe, PetscBool moving)
{
  const char *rtol[] = {"1e-8", "1e-8", "1e-9", "1e-10"};
  PetscBool   sweeps, given, bound, error;
  PetscBool   closed; /* elsewhere nothing but the residual balances the momentum: conserve.c */

  PetscFunctionBeginUser;
  PetscCall(ConditionsPressureIsFloating(FlowConditions(fs->flow), &closed));
  for (PetscInt a = 0; a < fs->loc->dim; a++) closed = (PetscBool)(closed && fs->loc->period[a] == 0);
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_ksp_rtol", &given));
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_rtol_max", &bound));
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_velocity_tol", &error));
  if (recipe == 0 && !fs->single) {
    if (!given) PetscCall(OptDefault("-flow_rtol_start", FAST_RESIDUAL));
    PetscCall(OptDefault("-flow_rtol_max", "1"));
    PetscCall(OptDefault("-flow_min_it", FAST_ITERATIONS));
    if (moving && closed && !given) PetscCall(OptDefault("-flow_one_it_rtol", FAST_ONCE));
  } else if (moving) {
    PetscCall(OptDefault("-flow_rtol_max", recipe == 1 ? PetscStringize(FLOW_BALANCED_MOST) : "1e-6"));
  }
  if (recipe == 1 && moving && closed && !given && !bound)
    PetscCall(OptDefault("-flow_one_it_rtol", fs->loc->dim == 2 ? BALANCED_PLANE : BALANCED_SPACE));
  if (recipe == 1 && !given) PetscCall(OptDefault("-flow_rtol_start", PetscStringize(FLOW_BALANCED_RESIDUAL)));
  fs->moving    = moving;
  fs->rtol_most = 1e-5;
  PetscCall(OptReal("-flow_rtol_start", &fs->rtol_start));
  PetscCall(OptReal("-flow_rtol_max", &fs->rtol_most));
  if (moving && recipe == 1 && !given && !bound && closed) PetscCall(OptDefault("-flow_velocity_tol", PetscStringize(FLOW_BALANCED_ERROR)));
  PetscCall(OptReal("-flow_velocity_tol", &fs->error_most));
  /* by what it is content with, since a restart finds all options given */
  fs->judge_tied = (PetscBool)(moving && recipe == 1 && !error && fs->rtol_start > 0 && fs->rtol_most == FLOW_BALANCED_MOST);
  PetscCall(OptInt("-flow_min_it", &fs->least));
  PetscCall(OptReal("-flow_one_it_rtol", &fs->once_most));
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_ksp_max_it", &sweeps));
  PetscCall(OptDefault("-flow_ksp_type", !fs->single ? LEAN_FGMRES : sweeps ? "richardson" : "preonly"));
  PetscCall(OptDefault("-flow_ksp_max_it", fs->single ? "1" : recipe == 3 ? "20" : "200"));
  PetscCall(OptDefault("-flow_ksp_rtol", rtol[recipe]));
  if (fs->single) {
    PetscCall(OptDefault("-flow_ksp_convergence_test", "skip"));
    PetscCall(OptDefault("-flow_ksp_norm_type", "none")); /* or the sweep would run a second time for it */
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_inner(FlowSolver fs, PetscInt recipe)
{
  const FlowParameters *par;
  char                  type[64] = "";
  PetscBool             gmres, cg;
  PetscMPIInt           size;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(fs->flow, &par));
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  /* half the vectors of gcr, for one sweep more where a solve takes several. Where viscosities differ every restart
     loses what is needed (runs/studies/rheology). */
  if (FlowHasSymmetricStress(fs->flow) && !par->convection) PetscCall(OptDefault(VELOCITY "ksp_type", "cg"));
  else PetscCall(OptDefault(VELOCITY "ksp_type", LEAN_GMRES));
  PetscCall(PetscOptionsGetString(NULL, NULL, VELOCITY "ksp_type", type, sizeof(type), NULL));
  PetscCall(PetscStrcmp(type, "gmres", &gmres));
  PetscCall(PetscStrcmp(type, "cg", &cg));
  /* the norm that the tolerance speaks of */
  if (gmres) PetscCall(OptDefault(VELOCITY "ksp_pc_side", "right"));
  if (cg && FlowHasSymmetricStress(fs->flow)) PetscCall(OptDefault(VELOCITY "ksp_norm_type", "unpreconditioned"));
  PetscCall(OptDefault(VELOCITY "ksp_gcr_restart", "10"));
  if (FlowHasSymmetricStress(fs->flow)) PetscCall(OptDefault(VELOCITY "ksp_gmres_restart", "100"));
  PetscCall(OptDefault(VELOCITY "ksp_rtol", PetscStringize(LOOSE_VELOCITY)));
  PetscCall(OptDefault(VELOCITY "ksp_max_it", FlowHasSymmetricStress(fs->flow) ? "1000" : "200"));
  PetscCall(OptDefault(VELOCITY "pc_type", "sor"));
  PetscCall(OptDefault("-flow_fieldsplit_pressure_ksp_type", size > 1 ? LEAN_CG : "cg"));
  /* what the first solve leaves, the outer iteration takes up the more slowly the more viscosities differ */
  PetscCall(OptDefault("-flow_fieldsplit_pressure_ksp_rtol", FlowHasSymmetricStress(fs->flow) && recipe ? "1e-2"
                                                             : fs->stages                               ? "3e-2"
                                                             : recipe == 0                              ? "1e-1"
                                                                                                        : "1e-2"));
  /* what two stages leave of the divergence is the residual itself, which falls faster than that of the preconditioned
     system and is known before the last application (runs/studies/flow-solver) */
  if (fs->stages) PetscCall(OptDefault("-flow_fieldsplit_pressure_ksp_norm_type", "unpreconditioned"));
  PetscCall(OptDefault("-flow_fieldsplit_pressure_ksp_max_it", "200"));
  PetscCall(PressureSetDefaults());
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetRecipe(FlowSolver fs, PetscBool moving)
{
  PetscInt recipe = 1;

  PetscFunctionBeginUser;
  PetscCall(OptChoice("-flow_solver", RECIPES, &recipe));
  if (recipe == 0) PetscCall(choose_fast(fs));
  PetscCall(OptChoice("-flow_schur", SCHURS, &fs->schur));
  fs->sweep_type = SWEEP_AUTO;
  PetscCall(OptChoice("-flow_velocity_smoother", SWEEPS, &fs->sweep_type));
  PetscCall(set_outer(fs, recipe, moving));
  PetscCall(choose_stages(fs, (PetscBool)(recipe == 3)));
  if (recipe == 3) {
    PetscCall(OptDefault("-flow_pc_type", "lu"));
    PetscCall(OptDefault("-flow_pc_factor_mat_solver_type", "mumps"));
    PetscCall(OptDefault("-flow_mat_mumps_icntl_14", "100")); /* 64 ranks: runs/studies/scaling; more: direct.c */
    PetscCall(OptDefault("-flow_mat_mumps_icntl_24", "1"));   /* leave null pivots out: pressures of cut cells without a
                                                               free velocity */
  } else PetscCall(set_inner(fs, recipe));
  PetscCall(choose_assembly(fs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is the velocity of some body that this rank knows unknown? */
static PetscBool has_free_bodies(const ConstraintView *c)
{
  PetscInt k = 0;

  while (k < c->nbodies && !ConstraintHasUnknown(c, k)) k++;
  return (PetscBool)(k < c->nbodies);
}

/* Which thresholds of the table the step exceeds */
static PetscErrorCode compare_numbers(FlowSolver fs, const PetscReal number[], PetscBool above[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < NTHRESHOLDS; i++) {
    const PetscReal value = number[THRESHOLDS[i].number];

    above[i] = (PetscBool)(value > THRESHOLDS[i].from);
    PetscCall(PetscInfo(fs->ksp, "%s: %s number %g, from %g on (%s)\n", THRESHOLDS[i].what,
                        THRESHOLDS[i].number == CONVECTIVE ? "convective" : "viscous", (double)value, (double)THRESHOLDS[i].from,
                        THRESHOLDS[i].study));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverChooseMethods(FlowSolver fs)
{
  const FlowParameters *par;
  const FlowStep       *step;
  PetscReal            *u, most[3] = {0, has_free_bodies(ConstraintGetView(fs->constraint)), FlowSolverHasLightBody(fs)}; /* speed; any? */
  PetscReal             t, viscous, convective;
  PetscBool             moves, staircase, convection, factorise, shifted, above[NTHRESHOLDS];

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(fs->flow, &par));
  PetscCall(FlowGetStep(fs->flow, &step));
  PetscCall(FlowGetFields(fs->flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < fs->nodal; i++) most[0] = PetscMax(most[0], PetscAbsReal(u[i] - step->frame[i % fs->loc->dim]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 3, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  moves      = (PetscBool)(most[1] > 0);
  t          = step->ct > 0 ? step->theta / (step->ct * fs->loc->h) : PETSC_MAX_REAL;
  viscous    = par->matrix * t / (par->density * fs->loc->h);
  convective = most[0] * t;
  PetscCall(compare_numbers(fs,
                            (const PetscReal
                               []){[VISCOUS] = viscous, [VISCOUS_OF_LARGEST] = viscous * PetscSqr(fs->loc->h / fs->h_max), [CONVECTIVE] = convective},
                            above));
  shifted = (PetscBool)(step->dt == 0 && fs->shift > 0);
  if (shifted) factorise = PETSC_TRUE; /* large cells convect far */
  else if (FlowIsMatrixFree(fs->flow)) factorise = (PetscBool)(above[ASSEMBLE_CONVECTION] || above[ASSEMBLE_VISCOUS]);
  else factorise = (PetscBool)(above[FACTORISE_CONVECTION] || above[FACTORISE_VISCOUS] || (above[FACTORISE_UNRESOLVED] && convective > 5 * viscous));
  fs->relax = factorise ? RELAX_ILU : FlowIsMatrixFree(fs->flow) ? RELAX_JACOBI : RELAX_SOR;
  if (fs->sweep_type != SWEEP_AUTO) fs->relax = (RelaxKind)fs->sweep_type;
  fs->swift             = above[SWIFT];
  fs->share_of_pressure = fs->single && !above[WHOLE_PRESSURE] ? SHARE_BELOW : 1;
  /* the projection is for time steps only */
  fs->commute       = (PetscBool)(fs->schur == SCHUR_COMMUTATOR || (step->dt == 0 && !shifted));
  fs->viscous_only  = PETSC_FALSE;
  fs->share_of_mass = fs->schur == SCHUR_AUTO && step->dt == 0 && FlowHasSymmetricStress(fs->flow)
                      ? (par->convection || FlowSolverIsSoft(fs) ? MASS_OTHER : MASS_STEADY)
                      : 0;
  fs->two_stage     = (PetscBool)(fs->schur == SCHUR_TWO_STAGE && !fs->commute);
  fs->loose         = (PetscBool)(fs->fast && fs->moving && fs->two_stage && fs->loc->dim == 3 && most[2] == 0);
  fs->relax_cells   = above[FlowSolverIsSoft(fs) ? RELAX_SOFT : RELAX_RIGID];
  if (fs->schur != SCHUR_AUTO || fs->commute) PetscFunctionReturn(PETSC_SUCCESS);
  convection       = (PetscBool)(above[STAGES_CONVECTION] || (above[STAGES_UNRESOLVED] && convective > 50 * viscous));
  fs->two_stage    = (PetscBool)(fs->stages || shifted || (convection && !fs->need_whole)); /* bodies: at any number */
  fs->viscous_only = (PetscBool)(!fs->two_stage && fs->nbodies == 0 && above[MASS_ALONE] && convective * convective < 10 * viscous);
  staircase        = (PetscBool)(fs->nbodies > 0 && !fs->fitted && !FlowSolverIsSoft(fs));
  fs->commute      = (PetscBool)(!fs->two_stage && staircase && above[moves ? COMMUTATOR_FREE : COMMUTATOR_KNOWN]);
  PetscFunctionReturn(PETSC_SUCCESS);
}
