/* Books: see books.h. */
#include "compat.h"
#include "base/runcomm.h"
#include "books.h"
#include "base/log.h"
#include "base/opt.h"

#define REMARKABLE 0.2 /* share of the energy lost that the boundary method takes */

enum {
  ENERGY,
  SUPPLIED,
  DISSIPATED,
  BOUNDARY,
  SCHEME,
  EVENTS, /* of drops */
  NENTRIES
};

static const char *const COLUMNS[NENTRIES] = {"energy",          "energy_supplied", "energy_dissipated",
                                              "energy_boundary", "energy_scheme",   "energy_events"};

struct _p_Books {
  Flow        flow;
  Couple      couple;
  Contact     contact;
  Monitor     monitor;
  DropsState *drops; /* NULL: there are none, and no column of their events */
  PetscInt    column, started;
  PetscReal   entry[NENTRIES], work; /* work: of contact before the step */
  PetscReal   taken;                 /* by events of drops before the step */
  PetscReal   begin;                 /* energy at the end of the first step, less the work of contact until then */
};

/* Law spring moves the bodies of this flow? */
static PetscErrorCode is_default(const SimComponents *sim, PetscBool *wanted)
{
  BodyState *s;
  char       law[64] = "";

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(sim->bodies, &s));
  PetscCall(OptPeek("-contact_law", law, sizeof(law)));
  PetscCall(PetscStrcasecmp(law, "spring", wanted));
  *wanted = (PetscBool)(*wanted && s->nall);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BooksCreate(const SimComponents *sim, Books *books)
{
  PetscBool wanted = PETSC_FALSE, implicit, constant, fluids;
  Books     b;

  PetscFunctionBeginUser;
  *books = NULL;
  if (!sim->flow || sim->steady) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoupleIsImplicit(sim->couple, &implicit));
  fluids   = (PetscBool)(sim->drops || (sim->solids && SolidsHaveInnerFluid(sim->solids)));
  constant = (PetscBool)((fluids || !FlowHasSymmetricStress(sim->flow)) && !FlowIsViscoelastic(sim->flow));
  if (constant && implicit) PetscCall(is_default(sim, &wanted));
  PetscCall(OptBool("-monitor_energy", &wanted));
  if (!wanted) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(constant, RunComm(), PETSC_ERR_SUP,
             "-monitor_energy true needs a constant viscosity: remove it, or -flow_rheology");
  PetscCheck(implicit, RunComm(), PETSC_ERR_SUP,
             "-monitor_energy true needs bodies and flow that are solved together: remove it, or -couple_type explicit");
  PetscCall(PetscNew(&b));
  b->flow    = sim->flow;
  b->couple  = sim->couple;
  b->contact = sim->contact;
  b->monitor = sim->monitor;
  if (sim->drops) PetscCall(DropsGetState(sim->drops, &b->drops));
  for (PetscInt i = 0; i < (b->drops ? NENTRIES : EVENTS); i++) {
    PetscInt column;

    PetscCall(MonitorAddColumn(sim->monitor, COLUMNS[i], &column));
    if (!i) b->column = column;
  }
  *books = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BooksDestroy(Books *books)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(*books));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BooksStep(Books b, const FlowDiagnostics *d, const CouplePower *p, PetscReal dt)
{
  PetscReal    before, taken;
  CoupleLosses w;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactGetEnergy(b->contact, NULL, &b->work));
  PetscCall(CoupleGetLosses(b->couple, &w));
  before = b->entry[ENERGY];
  taken  = b->drops ? b->drops->taken - b->taken : 0;
  b->taken += taken;
  b->entry[ENERGY] = d->kinetic_energy + p->energy;
  if (!b->started) PetscFunctionReturn(PETSC_SUCCESS);
  b->entry[SUPPLIED] += dt * (p->power - w.counted);
  b->entry[DISSIPATED] += dt * w.viscous;
  b->entry[BOUNDARY] += dt * w.boundary;
  b->entry[SCHEME] += dt * (w.inertia - w.contact + p->inflow) - (b->entry[ENERGY] - before) - taken;
  b->entry[EVENTS] += taken;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the scheme makes of a force of contact is another work than that of the force on the way of the bodies */
PetscErrorCode BooksClose(Books b)
{
  PetscReal work;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactGetEnergy(b->contact, NULL, &work));
  if (b->started) b->entry[SCHEME] += work - b->work;
  else b->begin = b->entry[ENERGY] - work;
  b->work    = work;
  b->started = 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BooksReport(Books b)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; b && i < (b->drops ? NENTRIES : EVENTS); i++)
    PetscCall(MonitorSetColumn(b->monitor, b->column + i, b->entry[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BooksFinish(Books b)
{
  PetscReal lost, open;

  PetscFunctionBeginUser;
  if (!b || !b->started) PetscFunctionReturn(PETSC_SUCCESS);
  lost = PetscAbsReal(b->work) + b->entry[DISSIPATED] + b->entry[BOUNDARY] + PetscAbsReal(b->entry[SCHEME]) +
         PetscAbsReal(b->entry[EVENTS]);
  open = b->entry[ENERGY] - b->begin - b->entry[SUPPLIED] - b->work + b->entry[DISSIPATED] + b->entry[BOUNDARY] +
         b->entry[SCHEME] + b->entry[EVENTS];
  if (lost <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MonitorQuantity(b->monitor, "energy_error", PetscAbsReal(open) / lost));
  if (b->work == 0 || b->entry[BOUNDARY] < REMARKABLE * lost) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(
    LogRemark("%.0f %% of the energy that bodies and fluid lost went into what -couple_method makes of surfaces and of gaps below a cell (energy_boundary %.3g, "
              "contact_work %.3g): bodies part slower than by -contact_restitution and a resolved film. Finer cells, -couple_method aligned, or a "
              "-contact_range of a cell keep it",
              (double)(100 * b->entry[BOUNDARY] / lost), (double)b->entry[BOUNDARY], (double)b->work));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BooksVisitState(void *books, State state)
{
  Books     b = books;
  PetscBool has;
  PetscReal events[2] = {b->entry[EVENTS], b->taken};

  PetscFunctionBeginUser;
  PetscCall(StateHas(state, "started", &has));
  if (!has) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(StateInts(state, "started", 1, &b->started));
  PetscCall(StateReals(state, "entries", EVENTS, b->entry));
  if (StateIsLoading(state)) PetscCall(StateHas(state, "events", &has));
  if (has) PetscCall(StateReals(state, "events", 2, events));
  b->entry[EVENTS] = events[0];
  b->taken         = events[1];
  PetscCall(StateReals(state, "begin", 1, &b->begin));
  PetscFunctionReturn(PETSC_SUCCESS);
}
