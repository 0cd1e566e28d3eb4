/* Couple: does what bodies and walls take add up to the force that drives the flow?

   The balance of momentum (force.c) holds for the mesh as it is: what a mesh lined up with bodies has lost or won
   beside them, such as a gap that it closed, is missing on both of its sides. Here the driving force is that on the
   domain: of its volume before anything moved, bodies counted with theirs. What is compared is

       f V - (what bodies, walls and openings take, and what accelerates fluid and bodies)

   for a uniform f (-flow_force, -flow_rate, -couple_backflow). With nodal and penalty, whose fluid fills the domain,
   that is the error of the balance of momentum once more.

   Convection moves momentum about, and takes none where nothing flows in or out and bodies stand still. What it does
   take there is the error of cells too coarse for the flow (flow/README.md); no balance shows it. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "fem/element.h"

#define REMARKABLE 5e-3 /* of the driving force: bodies of 4 cells are drawn to 3e-4 of their volume */
#define TAKEN      1e-2 /* of it, by convection, over the run (runs/studies/turbulence) */
#define ENOUGH     50   /* steps of it: a start from rest takes nothing, one from noise some */

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

/* Adds up what convection took of the driving force; a remark (once) where it is much */
static PetscErrorCode watch_convection(Couple c, const FlowDiagnostics *d)
{
  char      form[32];
  PetscBool still;
  PetscReal taken = 0, pulled = 0;

  PetscFunctionBeginUser;
  if (c->driving.settled || c->step->dt == 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < c->loc->dim; a++) {
    c->driving.taken[a] += d->flux[a] * c->step->dt;
    c->driving.pulled[a] += c->par->force[a] * c->driving.domain * c->step->dt;
    if (PetscAbsReal(c->driving.pulled[a]) <= pulled) continue;
    pulled = PetscAbsReal(c->driving.pulled[a]);
    taken  = c->driving.taken[a] * (c->driving.pulled[a] < 0 ? -1 : 1);
  }
  if (++c->driving.steps < ENOUGH || PetscAbsReal(taken) <= TAKEN * pulled) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptPeek("-flow_convection_form", form, sizeof(form)));
  PetscCall(BodiesAreStill(c->bodies, &still));
  c->driving.settled = PETSC_TRUE;
  if (!still || ConditionsHaveOpening(FlowConditions(c->flow)) || !strcmp(form, "conservative"))
    PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(
    LogRemark("convection has %s %.2g %% of the force that drives the flow by t = %g: the flow is finer than the cells, and friction %s by as much. "
              "Refine the mesh, or use -flow_convection_form conservative where -flow_rate does not hold the mean velocity",
              taken > 0 ? "taken" : "added", (double)(100 * PetscAbsReal(taken) / pulled), (double)c->step->time,
              taken > 0 ? "falls short" : "exceeds it"));
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
  PetscCall(watch_convection(c, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}
