/* Pressure: the cycle over cells and vertices as one preconditioner, as PCMG with the default options does it, in
   place: a forward sweep whose residual is known behind it, the coarse pressures, a backward sweep. On several ranks
   the ghosts of the cells are corrected where they are, which is one exchange less. */
#include "compat.h"
#include "pressureimpl.h"
#include "blockgs.h"

#define PREFIX "-flow_fieldsplit_pressure_"

static PetscErrorCode apply(PC pc, Vec b, Vec x)
{
  Pressure         p;
  const PetscReal *ba;
  PetscReal       *xa, *ghost;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &p));
  if (p->device) {
    PetscCall(PressureApplyOnDevice(p, b, x));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(VecGetArrayRead(b, &ba));
  PetscCall(VecGetArrayWrite(x, &xa));
  PetscCall(BlockGSGetGhosts(p->nodes.matrix, &ghost));
  PetscCall(BlockGSSweepDown(p->nodes.matrix, ba, xa, p->cycle.residual));
  PetscCall(CoarseCorrect(p->coarse, p->cycle.residual, xa, ghost));
  PetscCall(BlockGSSweepUp(p->nodes.matrix, ba, xa));
  PetscCall(VecRestoreArrayWrite(x, &xa));
  PetscCall(VecRestoreArrayRead(b, &ba));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view(PC pc, PetscViewer viewer)
{
  Pressure p;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &p));
  PetscCall(
    PetscViewerASCIIPrintf(viewer, "block Gauss-Seidel there and back over cells, between them on the vertices:\n"));
  PetscCall(PetscViewerASCIIPushTab(viewer));
  PetscCall(CoarseView(p->coarse, viewer));
  PetscCall(PetscViewerASCIIPopTab(viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Do the options say something else about the levels than their number? */
static PetscErrorCode are_asked(PetscBool *asked)
{
  static const char *const OTHER[] = {PREFIX "mg_levels_", PREFIX "mg_coarse_ksp_", PREFIX "pc_use_amat"};
  char                    *all;

  PetscFunctionBeginUser;
  PetscCall(PetscOptionsGetAll(NULL, &all));
  *asked = PETSC_FALSE;
  for (size_t k = 0; k < PETSC_STATIC_ARRAY_LENGTH(OTHER); k++) *asked = (PetscBool)(*asked || strstr(all, OTHER[k]));
  for (const char *at = all; (at = strstr(at, PREFIX "pc_mg_")); at++)
    *asked = (PetscBool)(*asked || strncmp(at, PREFIX "pc_mg_levels ", strlen(PREFIX "pc_mg_levels ")));
  PetscCall(PetscFree(all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureTakeCycle(Pressure p, PC pc)
{
  PetscBool mg, asked = PETSC_TRUE;
  PetscInt  levels;

  PetscFunctionBeginUser;
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCMG, &mg));
  if (!mg || !p->nodes.block_gs || p->cycle.smoothers_set) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PCMGGetLevels(pc, &levels));
  PetscCall(are_asked(&asked));
  if (levels != 2 || asked) PetscFunctionReturn(PETSC_SUCCESS);
  p->cycle.own = PETSC_TRUE;
  PetscCall(PetscMalloc1(p->loc->ncell * p->nk, &p->cycle.residual));
  PetscCall(PCSetOptionsPrefix(pc, "flow_fieldsplit_pressure_cycle_")); /* the type in the options is the one it had */
  PetscCall(PCSetType(pc, PCSHELL));
  PetscCall(PCShellSetName(pc, "two levels"));
  PetscCall(PCShellSetContext(pc, p));
  PetscCall(PCShellSetApply(pc, apply));
  PetscCall(PCShellSetView(pc, view));
  PetscFunctionReturn(PETSC_SUCCESS);
}
