/* A Newtonian fluid whose viscosity differs from cell to cell (FlowSetProperties), as a material: the stress has its
   symmetric form, since across a jump of mu the gradient form would balance mu du/dn in place of the traction. */
#include "compat.h"
#include "../impl.h"

static PetscErrorCode update(Flow f)
{
  const PetscInt   nq = f->element.nq;
  const PetscReal *mu = f->properties.viscosity;

  PetscFunctionBeginUser;
  if (f->viscosity.current) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < f->loc->ncell_all * nq; i++) f->viscosity.mu[i] = mu ? mu[i / nq] : f->par.viscosity;
  PetscCall(ViscosityAverage(f));
  f->viscosity.current = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void outdate(Flow f)
{
  (void)f; /* it does not depend on the velocity */
}

static PetscErrorCode view(Flow f, PetscViewer viewer)
{
  (void)f;
  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer, "  viscosity by cell; stress in symmetric form\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const FlowMaterial FLOW_PER_CELL = {
  .name      = "viscosity by cell",
  .symmetric = PETSC_TRUE,
  .factor    = 1,
  .create    = ViscosityCreate,
  .remesh    = ViscosityRemesh,
  .destroy   = ViscosityDestroy,
  .outdate   = outdate,
  .update    = update,
  .residual  = ViscosityResidual,
  .scalar    = ViscosityScalar,
  .tangent   = ViscosityTangent,
  .stress    = ViscosityStress,
  .view      = view,
};
