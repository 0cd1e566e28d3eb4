/* Couple: does what bodies and walls take add up to the force that drives the flow?

   The balance of momentum (force.c) holds for the mesh as it is: what a mesh lined up with bodies has lost or won
   beside them, such as a gap that it closed, is missing on both of its sides. Here the driving force is that on the
   domain: of its volume before anything moved, bodies counted with theirs. What is compared is

       f V - (what bodies, walls and openings take, and what accelerates fluid and bodies)

   for a uniform f (-flow_force, -flow_rate, -couple_backflow). With nodal and penalty, whose fluid fills the domain,
   that is the error of the balance of momentum once more. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "bodies/local.h"
#include "fem/element.h"

#define REMARKABLE 5e-3 /* of the driving force: bodies of 4 cells are drawn to 3e-4 of their volume */

PetscBool CoupleIsDriven(Couple c)
{
  PetscBool driven = (PetscBool)(c->flow_rate != NULL);

  for (PetscInt a = 0; a < c->loc->dim; a++) driven = (PetscBool)(driven || c->par->force[a] != 0);
  return driven;
}

/* Volume of all cells, inactive ones too: nodes move only within the domain, so that it is that of the domain */
static PetscErrorCode measure_domain(Couple c, PetscReal *volume)
{
  ElementTables t;
  PetscReal     sum = 0;

  PetscFunctionBeginUser;
  PetscCall(ElementCreate(c->loc->dim, &t));
  for (PetscInt cell = 0; cell < c->loc->ncell; cell++) {
    PetscReal     xc[MESH_MAX_NB * 3];
    ElementMetric m;

    PetscCall(MeshCellCoordinates(c->mesh, cell, xc));
    ElementSetMetric(&t, xc, &m);
    for (PetscInt q = 0; q < t.nq; q++) sum += m.weight[q];
  }
  PetscCall(ElementDestroy(&t));
  PetscCall(MPIU_Allreduce(&sum, volume, 1, MPIU_REAL, MPIU_SUM, c->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode remark_driving(Couple c, PetscReal error)
{
  PetscFunctionBeginUser;
  if (c->driving.told || PetscAbsReal(error) < REMARKABLE) PetscFunctionReturn(PETSC_SUCCESS);
  c->driving.told = PETSC_TRUE;
  PetscCall(
    LogRemark("bodies and walls take %.2g %% %s than the force that drives the flow at t = %g (column driving_error of series.csv): the mesh has %s next to "
              "bodies, or bodies overlap, and the flow there is wrong. Refine the mesh around them, or use -couple_method penalty",
              (double)(100 * PetscAbsReal(error)), error > 0 ? "less" : "more", (double)c->step->time,
              error > 0 ? "closed gaps" : "opened gaps"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleMeasureDriving(Couple c, const FlowDiagnostics *d, CoupleBalance *b)
{
  PetscReal inside, size = 0;

  PetscFunctionBeginUser;
  b->driving = 0;
  if (!CoupleIsDriven(c) || c->method.sides_move)
    PetscFunctionReturn(PETSC_SUCCESS); /* or who knows what of them is within */
  if (c->driving.domain == 0) PetscCall(measure_domain(c, &c->driving.domain));
  PetscCall(CoupleGetInactiveVolume(c, &inside));
  for (PetscInt a = 0; a < c->loc->dim; a++) size = PetscMax(size, PetscAbsReal(c->par->force[a]) * c->driving.domain);
  size = PetscMax(size, 0.5 * b->size);
  for (PetscInt a = 0; a < c->loc->dim && size > 0; a++) {
    const PetscReal lost = (c->par->force[a] * (c->driving.domain - d->volume - inside) + b->residual[a]) / size *
                           (c->par->force[a] < 0 ? -1 : 1);

    if (PetscAbsReal(lost) > PetscAbsReal(b->driving)) b->driving = lost;
  }
  PetscCall(remark_driving(c, b->driving));
  PetscFunctionReturn(PETSC_SUCCESS);
}
