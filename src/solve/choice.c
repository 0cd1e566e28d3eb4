/* FlowSolver: what a step takes, by its viscous and its convective number (see system.h). All of it is decided in
   choose(), from the table of thresholds. */
#include "compat.h"
#include "impl.h"
#include "flow/device.h"
#include "base/log.h"

/* Numbers of a step: nu theta/(c_t h^2) with the smallest and with the largest cell, |u| theta/(c_t h) */
typedef enum {
  VISCOUS,
  VISCOUS_OF_LARGEST,
  CONVECTIVE
} Number;

typedef enum {
  COMMUTATOR_FREE,
  COMMUTATOR_PRESCRIBED,
  STAGES_UNRESOLVED,
  STAGES_CONVECTION,
  MASS_ALONE,
  RELAX_PENALTY,
  RELAX_RIGID,
  WHOLE_PRESSURE,
  FACTORISE_VISCOUS,
  FACTORISE_CONVECTION,
  FACTORISE_UNRESOLVED,
  ASSEMBLE_VISCOUS,
  ASSEMBLE_CONVECTION,
  LARGE_CFL,
  NTHRESHOLDS
} Threshold;

#define STUDY "runs/studies/flow-solver"

/* From which number on a method is taken, and where that was found out */
static const struct {
  Number      number;
  PetscReal   from;
  const char *what, *study;
} THRESHOLDS[NTHRESHOLDS] = {
  [COMMUTATOR_FREE] = {VISCOUS, 0.1, "commutator around bodies that move freely, rigid nodes in a staircase", STUDY},
  [COMMUTATOR_PRESCRIBED] = {VISCOUS, 100, "commutator around bodies whose motion is known, rigid nodes in a staircase",
                             STUDY},
  [STAGES_UNRESOLVED]     = {CONVECTIVE, 0.5,
                             "two stages without bodies in under-resolved flow (cell Reynolds number above 50)", STUDY},
  [STAGES_CONVECTION]     = {CONVECTIVE, 2, "two stages without bodies in any flow", STUDY},
  [MASS_ALONE]     = {VISCOUS, 20, "pressure mass alone, without bodies and two stages, diffusion ahead of convection",
                      STUDY},
  [RELAX_PENALTY]  = {VISCOUS, 0.06, "relaxation of cut cells under a penalty, with two_stage", STUDY},
  [RELAX_RIGID]    = {VISCOUS, 0.3, "relaxation of cells with rigid nodes in a staircase, with two_stage", STUDY},
  [WHOLE_PRESSURE] = {VISCOUS_OF_LARGEST, 0.015, "the whole pressure correction in solver fast, below it a share",
                      STUDY},
  [FACTORISE_VISCOUS]    = {VISCOUS, 1, "incomplete factorisation of the velocity", STUDY},
  [FACTORISE_CONVECTION] = {CONVECTIVE, 1, "incomplete factorisation of the velocity", STUDY},
  [FACTORISE_UNRESOLVED] = {CONVECTIVE, 0.3, "incomplete factorisation in under-resolved flow", STUDY},
  [ASSEMBLE_VISCOUS] = {VISCOUS, 2, "the same where it is matrix-free and would have to be assembled for that", STUDY},
  [ASSEMBLE_CONVECTION] = {CONVECTIVE, 2, "the same where it is matrix-free", STUDY},
  [LARGE_CFL]           = {CONVECTIVE, 2, "twice the care where the velocities' error ends a solve", STUDY},
};

#define FRACTION_BELOW 0.5 /* of the pressure correction, below WHOLE_PRESSURE */
#define MASS_STEADY    0.9 /* of the pressure's mass beside the commutator where the viscosity varies */
#define MASS_OTHER     0.6 /* with convection or a penalty, which that does not know (runs/studies/rheology) */

/* What the choice of a step goes by; the same on all ranks */
typedef struct {
  PetscReal number[CONVECTIVE + 1];
  PetscBool above[NTHRESHOLDS];
  PetscBool moves, light; /* is there a body that moves freely, and one lighter than the fluid? */
  PetscBool timeless;     /* steady, without a shift that makes it a step */
  PetscBool shifted;
} StepMeasure;

/* Is the velocity of some body that this rank knows unknown? */
static PetscBool has_free_bodies(const ConstraintView *c)
{
  PetscInt k = 0;

  while (k < c->nbodies && !ConstraintHasUnknown(c, k)) k++;
  return (PetscBool)(k < c->nbodies);
}

/* Which thresholds of the table the step exceeds */
static PetscErrorCode compare_numbers(FlowSolver fs, StepMeasure *s)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < NTHRESHOLDS; i++) {
    const PetscReal value = s->number[THRESHOLDS[i].number];

    s->above[i] = (PetscBool)(value > THRESHOLDS[i].from);
    PetscCall(PetscInfo(fs->ksp, "%s: %s number %g, from %g on (%s)\n", THRESHOLDS[i].what,
                        THRESHOLDS[i].number == CONVECTIVE ? "convective" : "viscous", (double)value,
                        (double)THRESHOLDS[i].from, THRESHOLDS[i].study));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure_step(FlowSolver fs, const FlowParameters *par, const FlowStep *step, StepMeasure *s)
{
  /* speed; are there bodies of these kinds? */
  PetscReal *u = NULL, t, max[3] = {0, has_free_bodies(ConstraintGetView(fs->constraint)), FlowSolverHasLightBody(fs)};

  PetscFunctionBeginUser;
  if (FlowStaysOnDevice(fs->flow)) PetscCall(FlowGetSpeedOnDevice(fs->flow, step->frame, &max[0]));
  else PetscCall(FlowGetFields(fs->flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < fs->nodal && u; i++)
    max[0] = PetscMax(max[0], PetscAbsReal(u[i] - step->frame[i % fs->loc->dim]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, max, 3, MPIU_REAL, MPIU_MAX, fs->comm));
  t                             = step->ct > 0 ? step->theta / (step->ct * fs->loc->h) : PETSC_MAX_REAL;
  s->number[VISCOUS]            = par->matrix * t / (par->density * fs->loc->h);
  s->number[VISCOUS_OF_LARGEST] = s->number[VISCOUS] * PetscSqr(fs->loc->h / fs->step.h_max);
  s->number[CONVECTIVE]         = max[0] * t;
  s->moves                      = (PetscBool)(max[1] > 0);
  s->light                      = (PetscBool)(max[2] > 0);
  s->shifted                    = (PetscBool)(fs->step.steady && fs->step.shift > 0);
  s->timeless                   = (PetscBool)(fs->step.steady && !s->shifted);
  PetscCall(compare_numbers(fs, s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static RelaxKind choose_smoother(FlowSolver fs, const StepMeasure *s)
{
  const PetscBool *above = s->above, matrix_free = FlowIsMatrixFree(fs->flow);
  PetscBool        factorise;

  if (FlowSolverIsOnDevice(fs)) return RELAX_JACOBI;
  if (fs->set.smoother != SMOOTHER_AUTO) return (RelaxKind)fs->set.smoother;
  if (s->shifted) factorise = PETSC_TRUE; /* large cells convect far */
  else if (matrix_free) factorise = (PetscBool)(above[ASSEMBLE_CONVECTION] || above[ASSEMBLE_VISCOUS]);
  else
    factorise = (PetscBool)(above[FACTORISE_CONVECTION] || above[FACTORISE_VISCOUS] ||
                            (above[FACTORISE_UNRESOLVED] && s->number[CONVECTIVE] > 5 * s->number[VISCOUS]));
  return factorise ? RELAX_ILU : matrix_free ? RELAX_JACOBI : RELAX_SOR;
}

static SchurType choose_schur(FlowSolver fs, const StepMeasure *s)
{
  const PetscReal  viscous = s->number[VISCOUS], convective = s->number[CONVECTIVE];
  const PetscBool *above      = s->above;
  const PetscBool  convection = (PetscBool)(above[STAGES_CONVECTION] ||
                                           (above[STAGES_UNRESOLVED] && convective > 50 * viscous));
  const PetscBool  staircase  = (PetscBool)(fs->nbodies > 0 && !fs->body.aligned && !FlowSolverHasPenalty(fs));

  if (s->timeless) return SCHUR_COMMUTATOR; /* the projection is for time steps only */
  if (fs->set.schur != SCHUR_AUTO) return (SchurType)fs->set.schur;
  /* with bodies at any number */
  if (fs->set.stages || (FlowHasOperators(fs->flow) && !fs->set.need_whole) || s->shifted ||
      (convection && !fs->set.need_whole))
    return SCHUR_TWO_STAGE;
  if (fs->nbodies == 0 && above[MASS_ALONE] && convective * convective < 10 * viscous) return SCHUR_MASS;
  return staircase && above[s->moves ? COMMUTATOR_FREE : COMMUTATOR_PRESCRIBED] ? SCHUR_COMMUTATOR : SCHUR_PROJECTION;
}

static StepChoice choose(FlowSolver fs, const FlowParameters *par, const StepMeasure *s)
{
  StepChoice c = {.schur = choose_schur(fs, s), .smoother = choose_smoother(fs, s), .pressure_fraction = 1};

  c.relax_cells    = s->above[FlowSolverHasPenalty(fs) ? RELAX_PENALTY : RELAX_RIGID];
  c.large_cfl      = s->above[LARGE_CFL];
  c.loose_pressure = (PetscBool)(fs->set.kind == SOLVER_FAST && fs->set.moving && fs->set.schur == SCHUR_TWO_STAGE &&
                                 c.schur == SCHUR_TWO_STAGE && fs->loc->dim == 3 && !s->light);
  if (fs->set.single_projection && !s->above[WHOLE_PRESSURE]) c.pressure_fraction = FRACTION_BELOW;
  if (fs->set.schur == SCHUR_AUTO && fs->step.steady && FlowHasSymmetricStress(fs->flow))
    c.mass_fraction = par->convection || FlowSolverHasPenalty(fs) ? MASS_OTHER : MASS_STEADY;
  return c;
}

/* ---- what is said of it ---- */

static PetscBool is_same(const StepChoice *a, const StepChoice *b)
{
  return (PetscBool)(a->schur == b->schur && a->smoother == b->smoother && a->relax_cells == b->relax_cells &&
                     a->large_cfl == b->large_cfl && a->loose_pressure == b->loose_pressure &&
                     a->mass_fraction == b->mass_fraction && a->pressure_fraction == b->pressure_fraction);
}

/* One line on rank 0: what this step and those after it take, until the next such line. */
static PetscErrorCode print_choice(FlowSolver fs, const StepMeasure *s, PetscReal time)
{
  static const char *const SCHUR[]    = {[SCHUR_PROJECTION] = "projection",
                                         [SCHUR_COMMUTATOR] = "commutator",
                                         [SCHUR_TWO_STAGE]  = "two stages",
                                         [SCHUR_MASS]       = "pressure mass"};
  static const char *const SMOOTHER[] = {[RELAX_JACOBI] = "jacobi", [RELAX_SOR] = "sor", [RELAX_ILU] = "ilu"};
  const StepChoice        *c          = &fs->choice;

  PetscFunctionBeginUser;
  if (LogIsMute()) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscPrintf(fs->comm, "solver from time %g: %s, velocity %s%s%s%s", (double)time, SCHUR[c->schur],
                        SMOOTHER[c->smoother],
                        c->schur == SCHUR_TWO_STAGE && c->relax_cells && fs->nbodies ? ", cut cells relaxed" : "",
                        c->large_cfl ? ", large steps of the flow" : "",
                        c->loose_pressure ? ", loose first pressures" : ""));
  if (c->mass_fraction > 0) PetscCall(PetscPrintf(fs->comm, ", pressure mass %g", (double)c->mass_fraction));
  if (c->pressure_fraction < 1) PetscCall(PetscPrintf(fs->comm, ", %g of the pressure", (double)c->pressure_fraction));
  if (s->number[VISCOUS] < PETSC_MAX_REAL / 2)
    PetscCall(PetscPrintf(fs->comm, " (viscous number %.3g, convective %.3g)", (double)s->number[VISCOUS],
                          (double)s->number[CONVECTIVE]));
  PetscCall(PetscPrintf(fs->comm, "\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverChooseStep(FlowSolver fs)
{
  const FlowParameters *par;
  const FlowStep       *step;
  const StepChoice      before = fs->choice;
  StepMeasure           s;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(fs->flow, &par));
  PetscCall(FlowGetStep(fs->flow, &step));
  PetscCall(measure_step(fs, par, step, &s));
  fs->choice = choose(fs, par, &s);
  if (fs->set.print_choice && !is_same(&before, &fs->choice)) PetscCall(print_choice(fs, &s, step->time));
  PetscFunctionReturn(PETSC_SUCCESS);
}
