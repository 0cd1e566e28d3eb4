/* Log classes, stages and events of the program, in one place.

   Stages follow the phases of a step (Setup, Flow, Bodies, Output) so that the summary of -log_view splits into the
   columns of the benchmark tables; events are the kernels within them. Times are in seconds, counted by PETSc.
   It does not push or pop stages: the time loop does. */
#include "compat.h"
#include "base/runcomm.h"
#include "base/log.h"
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

PetscLogStage TB_STAGE_SETUP, TB_STAGE_FLOW, TB_STAGE_BODIES, TB_STAGE_OUTPUT;
PetscLogEvent TB_FLOW_ASSEMBLE, TB_FLOW_CONVECT, TB_FLOW_RHS, TB_FLOW_STRESS, TB_FLOW_DIV, TB_VEL_SMOOTHER,
  TB_VEL_FACTOR, TB_VEL_MULT, TB_PRES_BUILD, TB_FLOW_SOLVE;
PetscLogEvent TB_MARK, TB_PROJECT, TB_FORCE, TB_ADVANCE, TB_CONTACT, TB_SEARCH, TB_MIGRATE, TB_SYNC, TB_OUTPUT,
  TB_CHECKPOINT;

PetscErrorCode LogInitialize(void)
{
  PetscClassId class;

  PetscFunctionBeginUser;
  PetscCall(PetscClassIdRegister("tumble", &class));
  PetscCall(PetscLogStageRegister("Setup", &TB_STAGE_SETUP));
  PetscCall(PetscLogStageRegister("Flow", &TB_STAGE_FLOW));
  PetscCall(PetscLogStageRegister("Bodies", &TB_STAGE_BODIES));
  PetscCall(PetscLogStageRegister("Output", &TB_STAGE_OUTPUT));
  PetscCall(PetscLogEventRegister("FlowAssemble", class, &TB_FLOW_ASSEMBLE));
  PetscCall(PetscLogEventRegister("FlowConvect", class, &TB_FLOW_CONVECT));
  PetscCall(PetscLogEventRegister("FlowRhs", class, &TB_FLOW_RHS));
  PetscCall(PetscLogEventRegister("FlowStress", class, &TB_FLOW_STRESS));
  PetscCall(PetscLogEventRegister("FlowDiv", class, &TB_FLOW_DIV));
  PetscCall(PetscLogEventRegister("VelocitySmoother", class, &TB_VEL_SMOOTHER));
  PetscCall(PetscLogEventRegister("VelocityFactor", class, &TB_VEL_FACTOR));
  PetscCall(PetscLogEventRegister("VelocityMult", class, &TB_VEL_MULT));
  PetscCall(PetscLogEventRegister("PressureBuild", class, &TB_PRES_BUILD));
  PetscCall(PetscLogEventRegister("FlowSolve", class, &TB_FLOW_SOLVE));
  PetscCall(PetscLogEventRegister("BodyMark", class, &TB_MARK));
  PetscCall(PetscLogEventRegister("Projection", class, &TB_PROJECT));
  PetscCall(PetscLogEventRegister("BodyForce", class, &TB_FORCE));
  PetscCall(PetscLogEventRegister("BodyAdvance", class, &TB_ADVANCE));
  PetscCall(PetscLogEventRegister("Contact", class, &TB_CONTACT));
  PetscCall(PetscLogEventRegister("ContactSearch", class, &TB_SEARCH));
  PetscCall(PetscLogEventRegister("BodyMigrate", class, &TB_MIGRATE));
  PetscCall(PetscLogEventRegister("BodySync", class, &TB_SYNC));
  PetscCall(PetscLogEventRegister("Output", class, &TB_OUTPUT));
  PetscCall(PetscLogEventRegister("Checkpoint", class, &TB_CHECKPOINT));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- remarks ---- */

#define MAX_REMARKS 64

static char     *remark[MAX_REMARKS];
static PetscBool is_mute;
static PetscInt  nremark = 0;

void LogMute(PetscBool mute)
{
  is_mute = mute;
}

PetscBool LogIsMute(void)
{
  return is_mute;
}

PetscErrorCode LogRemark(const char format[], ...)
{
  char    text[1024];
  va_list args;

  PetscFunctionBeginUser;
  if (is_mute) PetscFunctionReturn(PETSC_SUCCESS);
  va_start(args, format);
  (void)vsnprintf(text, sizeof(text), format, args);
  va_end(args);
  for (PetscInt i = 0; i < nremark; i++)
    if (!strcmp(remark[i], text)) PetscFunctionReturn(PETSC_SUCCESS);
  if (nremark == MAX_REMARKS) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscStrallocpy(text, &remark[nremark++]));
  PetscCall(PetscPrintf(RunComm(), "remark: %s\n", text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LogGetRemarks(PetscInt *n, const char *const *text[])
{
  PetscFunctionBeginUser;
  *n    = nremark;
  *text = (const char *const *)remark;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LogFinalize(void)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < nremark; i++) PetscCall(PetscFree(remark[i]));
  nremark = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}
