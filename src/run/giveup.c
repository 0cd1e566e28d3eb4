/* Sim: steps that end a run, and what to do about it. */
#include "compat.h"
#include "simimpl.h"
#include "base/opt.h"

/* From where on a failed solve may be an instability: runs/studies/boundary (flaps), runs/studies/cylinder
   (quadratic) */
/* cell Reynolds number: the convective form may feed on convection that the mesh does not see */
#define UNRESOLVED      20
#define QUADRATIC_UP_TO 2 /* CFL number: quadratic extrapolation of the convecting velocity may blow up */

/* May the skew form help? A model of turbulence needs the momentum that it does not keep. */
static PetscBool may_skew(Flow flow, const FlowParameters *par)
{
  return (PetscBool)(par->skew == 0 && !FlowHasSymmetricStress(flow));
}

/* What the last step tells of why the solve of the next one fails, as further sentences of the message */
static PetscErrorCode explain_failure(Sim s, char why[], size_t size)
{
  const FlowParameters *par;

  PetscFunctionBeginUser;
  why[0] = 0;
  PetscCall(FlowGetParameters(s->components.flow, &par));
  if (!par->convection) PetscFunctionReturn(PETSC_SUCCESS);
  if (par->extrapolation == FLOW_QUADRATIC && s->diag.cfl > QUADRATIC_UP_TO)
    PetscCall(
      PetscSNPrintf(why, size,
                    ". Quadratic extrapolation may be unstable at the CFL number %.2g: use -flow_extrapolation linear",
                    (double)s->diag.cfl));
  else if (par->skew == 0 && s->diag.cell_reynolds > UNRESOLVED)
    PetscCall(PetscSNPrintf(why, size, ". Convection may be unresolved (cell Reynolds number %.0f): refine the mesh%s",
                            (double)s->diag.cell_reynolds,
                            may_skew(s->components.flow, par) ? ", or use -flow_convection_form skew" : ""));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimStopUnsolved(Sim s, KSPConvergedReason reason, PetscInt its, PetscReal dt)
{
  const char *dir;
  char        why[256];

  PetscFunctionBeginUser;
  PetscCall(explain_failure(s, why, sizeof(why)));
  PetscCall(FieldsGetDirectory(s->components.fields, &dir));
  SETERRQ(s->components.comm, PETSC_ERR_NOT_CONVERGED,
          "The flow solve of step %" PetscInt_FMT " failed (%s after %" PetscInt_FMT
          " iterations). The state before it, t = %g, is in %s/fields_%" PetscInt_FMT
          ".h5. Lower %s (the step was %g), raise -flow_ksp_max_it, or use -flow_solver direct; -flow_ksp_monitor shows the iterations%s",
          s->step + 1, KSPConvergedReasons[reason], its, (double)s->time, dir, s->step,
          s->adapt ? "-sim_adapt_min" : "-sim_dt", (double)dt, why);
}

PetscErrorCode SimStopDoubted(Sim s, PetscReal dt, PetscBool last)
{
  const char *dir;
  char why[256], more[256], good[PETSC_MAX_PATH_LEN] = "No fields were written before it (-output_every)", solver[64];
  PetscBool             fast;
  const FlowParameters *par;

  PetscFunctionBeginUser;
  PetscCall(StepCheckResult(s->check, last, why, sizeof(why)));
  if (!why[0]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(explain_failure(s, more, sizeof(more)));
  PetscCall(FlowGetParameters(s->components.flow, &par));
  PetscCall(OptPeek("-flow_solver", solver, sizeof(solver)));
  PetscCall(PetscStrcasecmp(solver, "fast", &fast));
  PetscCall(FieldsGetDirectory(s->components.fields, &dir));
  if (s->fields_good >= 0)
    PetscCall(PetscSNPrintf(good, sizeof(good), "The last good fields are in %s/fields_%" PetscInt_FMT ".h5", dir,
                            s->fields_good));
  SETERRQ(s->components.comm, PETSC_ERR_NOT_CONVERGED,
          "The solution is unreliable: at t = %g, %s. %s. Lower %s (the step was %g)%s%s%s", (double)s->time, why, good,
          s->adapt ? "-sim_adapt_tolerance" : "-sim_dt", (double)dt,
          fast ? ", or leave solver fast: -preset balanced, or -flow_solver balanced" : "",
          may_skew(s->components.flow, par) && !strstr(more, "skew") ? ", or try -flow_convection_form skew" : "",
          more);
}
