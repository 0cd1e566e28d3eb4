/* BoundaryMethod penalty: the body's part of cut cells is held at its velocity by a force (penalty.h), fictitious fluid
   inside. The force on a body is that of the penalty plus the residual of the nodes that move rigidly. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "penalty.h"
#include "flow/device.h"

static PetscErrorCode create_penalty(Couple c, void **method)
{
  PetscBool immersed = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < c->s->ngroups; g++)
    immersed = (PetscBool)(immersed || (c->s->group[g].count && !c->s->group[g].body_fitted));
  if (FlowIsViscoelastic(c->flow) && immersed) /* the polymer relaxes there (runs/studies/rheology) */
    PetscCall(LogRemark(
      "-couple_method penalty blurs the polymer of -flow_rheology next to bodies: the drag of a cylinder is 0.4 %% low at 12 cells a "
      "radius and Weissenberg number 0.4, 0.2 %% high with -couple_method aligned"));
  PetscCall(PenaltyCreate(c->flow, c->bodies, (Penalty *)method));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update_penalty(Couple c, void *method, const PenaltyTerm **terms)
{
  PetscFunctionBeginUser;
  PetscCall(PenaltyUpdateGeometry((Penalty)method, c->rigid.X, c->rigid.q, c->rigid.P, NULL, c->indicator));
  PetscCall(PenaltyGetTerm((Penalty)method, terms));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode stiffen_penalty(void *method, PetscBool *changed)
{
  PetscFunctionBeginUser;
  PetscCall(PenaltyStiffen((Penalty)method, changed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_force(Couple c, void *method, const unsigned char fixed[], PetscReal out[3])
{
  FlowDeviceStep step;
  PetscInt       n, *node;

  PetscFunctionBeginUser;
  if (FlowStaysOnDevice(c->flow)) {
    PetscCall(PenaltyListPrescribed((Penalty)method, fixed, &n, &node));
    PetscCall(FlowGetStepOnDevice(c->flow, &step));
    PetscCall(FlowFetchRows(c->flow, n, c->loc->dim, node, step.u, c->field.u));
    PetscCall(PetscFree(node));
  }
  PetscCall(PenaltyAddPrescribed((Penalty)method, fixed, c->field.u, c->rigid.U, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static Penalty get_penalty(void *method)
{
  return (Penalty)method;
}

static PetscErrorCode measure_cells(void *method)
{
  CutCells cut_cells;

  PetscFunctionBeginUser;
  PetscCall(PenaltyGetCutCells((Penalty)method, &cut_cells));
  PetscCall(CutCellsMeasureCells(cut_cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view_penalty(void *method, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PenaltyView((Penalty)method, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_penalty(void *method)
{
  Penalty p = (Penalty)method;

  PetscFunctionBeginUser;
  PetscCall(PenaltyDestroy(&p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const BoundaryMethod method_penalty = {.name            = "penalty",
                                       .own_velocities  = PETSC_TRUE,
                                       .film_gap_offset = 0.035, /* runs/studies/contact, "Films" */
                                       .create          = create_penalty,
                                       .update          = update_penalty,
                                       .stiffen         = stiffen_penalty,
                                       .force           = add_force,
                                       .penalty         = get_penalty,
                                       .mesh_updated    = measure_cells,
                                       .view            = view_penalty,
                                       .destroy         = destroy_penalty};
