/* Rung penalty: the body's part of cut cells is held at its velocity by a force (penalty.h), fictitious fluid
   inside. The force on a body is that of the penalty plus the residual of the nodes that move rigidly. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "penalty.h"

static PetscErrorCode create_penalty(Couple c, void **rung)
{
  PetscBool immersed = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < c->s->ngroups; g++)
    immersed = (PetscBool)(immersed || (c->s->group[g].count && !c->s->group[g].hole));
  if (FlowIsViscoelastic(c->flow) && immersed) /* the polymer relaxes there (runs/studies/rheology) */
    PetscCall(LogRemark(
      "-couple_method penalty blurs the polymer of -flow_rheology next to bodies: the drag of a cylinder is 0.4 %% low at 12 cells a "
      "radius and Weissenberg number 0.4, 0.2 %% high with -couple_method aligned"));
  PetscCall(PenaltyCreate(c->flow, c->bodies, (Penalty *)rung));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode draw_penalty(Couple c, void *rung, const PenaltyTerm **terms)
{
  PetscFunctionBeginUser;
  PetscCall(PenaltyDraw((Penalty)rung, c->rigid.X, c->rigid.q, c->rigid.P, NULL, c->indicator));
  PetscCall(PenaltyGetSoft((Penalty)rung, terms));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode stiffen_penalty(void *rung, PetscBool *changed)
{
  PetscFunctionBeginUser;
  PetscCall(PenaltyStiffen((Penalty)rung, changed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_force(Couple c, void *rung, const unsigned char fixed[], PetscReal out[3])
{
  PetscFunctionBeginUser;
  PetscCall(PenaltyAddPrescribed((Penalty)rung, fixed, c->field.u, c->rigid.U, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure_cells(void *rung)
{
  Parts parts;

  PetscFunctionBeginUser;
  PetscCall(PenaltyGetParts((Penalty)rung, &parts));
  PetscCall(PartsMeasureCells(parts));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view_penalty(void *rung, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PenaltyView((Penalty)rung, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_penalty(void *rung)
{
  Penalty p = (Penalty)rung;

  PetscFunctionBeginUser;
  PetscCall(PenaltyDestroy(&p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const Rung rung_penalty = {.name    = "penalty",
                           .soft    = PETSC_TRUE,
                           .recess  = 0.035, /* runs/studies/contact, "Films" */
                           .create  = create_penalty,
                           .draw    = draw_penalty,
                           .stiffen = stiffen_penalty,
                           .force   = add_force,
                           .moved   = measure_cells,
                           .view    = view_penalty,
                           .destroy = destroy_penalty};
