/* Flow, properties by cell (flow.h, FlowSetProperties): several fluids in one velocity field. */
#include "compat.h"
#include "impl.h"
#include "lanes.h"

PetscErrorCode FlowSetProperties(Flow f, const PetscReal density[], const PetscReal viscosity[])
{
  PetscFunctionBeginUser;
  PetscCheck(!viscosity || !f->matrix.free, f->comm, PETSC_ERR_SUP,
             "A flow of fluids with several viscosities has an assembled velocity matrix: use -flow_velocity_operator assembled");
  PetscCheck(!viscosity || !f->material || f->material == &FLOW_PER_CELL, f->comm, PETSC_ERR_SUP,
             "A flow of several fluids knows one viscosity each: remove -flow_rheology (%s)", f->material->name);
  f->properties.density   = density;
  f->properties.viscosity = viscosity;
  f->properties.lost      = PETSC_FALSE;
  if (viscosity && !f->material) {
    f->material = &FLOW_PER_CELL;
    PetscCall((*f->material->create)(f));
  } else if (!viscosity && f->material == &FLOW_PER_CELL) {
    PetscCall((*f->material->destroy)(f));
    f->material = NULL;
  }
  if (viscosity) f->viscosity.current = PETSC_FALSE;
  f->matrix.ct = 0; /* another matrix */
  PetscCall(FlowUpdateInertia(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetInertialMass(Flow f, const PetscReal *m[])
{
  PetscFunctionBeginUser;
  *m = f->properties.density ? f->properties.mass : f->cells.lumped;
  PetscFunctionReturn(PETSC_SUCCESS);
}

void FlowScaleByDensity(const struct _p_Flow *f, const LaneCells *b, PetscInt n, Lanes x[])
{
  if (!f->properties.density) return;
  for (PetscInt k = 0; k < b->n; k++) {
    const PetscReal ratio = FlowDensityRatio(f, b->cell[k]);

    for (PetscInt i = 0; i < n; i++) *Lane(&x[i], k) *= ratio;
  }
}
