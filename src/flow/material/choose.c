/* Which material a flow has (material.h): the law of -flow_rheology. */
#include "compat.h"
#include "generalised.h"
#include "viscoelastic.h"

PetscErrorCode FlowChooseMaterial(Flow f)
{
  Rheology law;
  Polymer  polymer;
  Eddy     eddy;

  PetscFunctionBeginUser;
  PetscCall(RheologyCreate(f->par.viscosity, &law, &polymer, &eddy));
  if (law) {
    Generalised *g;

    PetscCall(PetscNew(&g));
    g->law           = law;
    f->material      = &FLOW_GENERALISED;
    f->material_data = g;
  } else if (polymer.name) {
    Viscoelastic *v;

    PetscCall(PetscNew(&v));
    v->law           = polymer;
    f->material      = &FLOW_VISCOELASTIC;
    f->material_data = v;
    f->par.solvent = f->par.matrix = polymer.solvent;
  } else if (eddy.name) {
    PetscCall(EddiesCreate(f, &eddy));
    f->material = &FLOW_EDDIES;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
