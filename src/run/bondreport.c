/* BondReport: see bondreport.h. */
#include "compat.h"
#include "bondreport.h"
#include "aggregates.h"
#include "base/sparse.h"
#include "bodies/local.h"
#include "contact/bonds.h"
#include "report/bondfields.h"
#include "report/eventtable.h"

struct _p_BondReport {
  MPI_Comm    comm;
  Bodies      bodies;
  Contact     contact;
  Monitor     monitor;
  Outlines    outlines;
  BondFields  fields;
  BodyState  *s;
  PetscMPIInt rank;
  PetscInt    column[3];
  PetscBool   opened;
  EventTable  events, aggregates;
  char        dir[PETSC_MAX_PATH_LEN];
};

PetscErrorCode BondReportCreate(const SimComponents *sim, BondReport *report)
{
  static const char *const COLUMNS[] = {"bonds", "bonds_broken", "bond_energy"};
  BondReport               r;
  const char              *dir;

  PetscFunctionBeginUser;
  *report = NULL;
  if (!sim->contact || !ContactHasBonds(sim->contact)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&r));
  r->comm     = sim->comm;
  r->bodies   = sim->bodies;
  r->contact  = sim->contact;
  r->monitor  = sim->monitor;
  r->outlines = sim->outlines;
  PetscCall(BodiesGetState(sim->bodies, &r->s));
  PetscCallMPI(MPI_Comm_rank(r->comm, &r->rank));
  for (PetscInt i = 0; i < 3; i++) PetscCall(MonitorAddColumn(sim->monitor, COLUMNS[i], &r->column[i]));
  PetscCall(FieldsGetDirectory(sim->fields, &dir));
  PetscCall(PetscStrncpy(r->dir, dir, sizeof(r->dir)));
  PetscCall(BondFieldsCreate(r->comm, &r->fields));
  OutlinesAddAggregates(r->outlines);
  PetscCall(MonitorAddFile(sim->monitor, "bonds.csv"));
  PetscCall(MonitorAddFile(sim->monitor, "aggregates.csv"));
  *report = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondReportDestroy(BondReport *report)
{
  PetscFunctionBeginUser;
  if (!*report) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BondFieldsDestroy(&(*report)->fields));
  PetscCall(EventTableClose(&(*report)->events));
  PetscCall(EventTableClose(&(*report)->aggregates));
  PetscCall(PetscFree(*report));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- files ---- */

static PetscErrorCode open_tables(BondReport r, PetscReal time)
{
  PetscFunctionBeginUser;
  if (r->opened) PetscFunctionReturn(PETSC_SUCCESS);
  r->opened = PETSC_TRUE;
  PetscCall(EventTableOpen(r->comm, r->dir, "bonds.csv", EVENT_BONDS, time, &r->events));
  PetscCall(EventTableOpen(r->comm, r->dir, "aggregates.csv", EVENT_AGGREGATES, time, &r->aggregates));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_events(BondReport r, PetscInt n, const BondEvent event[])
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n && !r->rank; e++) {
    const BondEvent *b = &event[e];
    const char      *name;
    char             partner[32];

    if (b->j >= 0) (void)snprintf(partner, sizeof(partner), "%" PetscInt_FMT, b->j);
    else {
      PetscCall(ContactGetWallName(r->contact, -1 - b->j, &name));
      PetscCall(PetscStrncpy(partner, name, sizeof(partner)));
    }
    (void)fprintf(r->events.file, "%.12g,%s,%" PetscInt_FMT ",%s,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g\n", (double)b->time,
                  BOND_CAUSES[b->cause], b->i, partner, (double)b->load[0], (double)b->load[1], (double)b->load[2],
                  (double)b->load[3], (double)b->x[0], (double)b->x[1], (double)b->x[2]);
  }
  if (n) PetscCall(EventTableFlush(&r->events));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- aggregates ---- */

static int compare_bonds(const void *a, const void *b)
{
  const BondView *p = (const BondView *)a, *q = (const BondView *)b;

  if (p->i != q->i) return p->i < q->i ? -1 : 1;
  return p->j < q->j ? -1 : p->j > q->j;
}

/* Those of all ranks, on every rank in the same order; the caller's to free */
static PetscErrorCode gather_bonds(BondReport r, PetscInt *n, BondView *bond[])
{
  PetscInt  own;
  BondView *mine;

  PetscFunctionBeginUser;
  PetscCall(ContactGetBonds(r->contact, &own, &mine));
  PetscCall(SparseGather(BodiesComm(r->bodies), own, sizeof(*mine), mine, n, bond, NULL));
  PetscCall(PetscFree(mine));
  qsort(*bond, (size_t)*n, sizeof(**bond), compare_bonds);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_aggregates(BondReport r, PetscReal time)
{
  PetscInt   n;
  BondView  *bond;
  Aggregates a;

  PetscFunctionBeginUser;
  PetscCall(gather_bonds(r, &n, &bond));
  if (!r->rank) {
    PetscCall(AggregatesFind(r->s->nall, n, bond, &a, NULL));
    (void)fprintf(r->aggregates.file,
                  "%.12g,%" PetscInt_FMT ",%" PetscInt_FMT ",%" PetscInt_FMT ",%.9g,%" PetscInt_FMT ",%.9g,%.6g,%.9g\n",
                  (double)time, n, a.aggregates, r->s->nall - a.bonded,
                  a.aggregates ? (double)a.bonded / (double)a.aggregates : 0., a.largest, (double)a.rg,
                  (double)a.dimension, a.bonded ? 2. * (double)n / (double)a.bonded : 0.);
  }
  PetscCall(EventTableFlush(&r->aggregates));
  PetscCall(PetscFree(bond));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- snapshots ---- */

PetscErrorCode BondReportSnapshot(BondReport r, const char dir[], PetscInt step, PetscReal time)
{
  PetscInt   n, *number, *of_bond;
  BondView  *bond;
  PetscReal *of_body;
  Aggregates a;

  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(gather_bonds(r, &n, &bond));
  PetscCall(PetscMalloc3(r->s->nall, &number, n, &of_bond, r->s->n, &of_body));
  PetscCall(AggregatesFind(r->s->nall, n, bond, &a, number));
  for (PetscInt e = 0; e < n; e++) of_bond[e] = number[bond[e].i];
  for (PetscInt k = 0; k < r->s->n; k++) of_body[k] = (PetscReal)number[r->s->number[k]];
  PetscCall(BondFieldsWrite(r->fields, dir, step, time, n, bond, of_bond, r->s->frame));
  PetscCall(OutlinesWrite(r->outlines, dir, step, time, of_body));
  PetscCall(PetscFree3(number, of_bond, of_body));
  PetscCall(PetscFree(bond));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondReportRewind(BondReport r, const char dir[])
{
  PetscFunctionBeginUser;
  if (r) PetscCall(BondFieldsRewind(r->fields, dir));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondReportVisitState(void *report, State state)
{
  PetscFunctionBeginUser;
  PetscCall(BondFieldsVisitState(((BondReport)report)->fields, state));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondReportStep(BondReport r, PetscReal time)
{
  PetscInt   n;
  BondEvent *event;
  BondTotals t;

  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactTakeBondEvents(r->contact, &n, &event));
  PetscCall(open_tables(r, n && event[0].time < time ? 0 : time));
  PetscCall(write_events(r, n, event));
  PetscCall(PetscFree(event));
  if (n) PetscCall(write_aggregates(r, time));
  PetscCall(ContactGetBondTotals(r->contact, &t));
  PetscCall(MonitorSetColumn(r->monitor, r->column[0], (PetscReal)t.n));
  PetscCall(MonitorSetColumn(r->monitor, r->column[1], (PetscReal)t.broken));
  PetscCall(MonitorSetColumn(r->monitor, r->column[2], t.stored));
  PetscCall(MonitorQuantity(r->monitor, "bonds", (PetscReal)t.n));
  PetscCall(MonitorQuantity(r->monitor, "bonds_formed", (PetscReal)t.formed));
  PetscCall(MonitorQuantity(r->monitor, "bonds_broken", (PetscReal)t.broken));
  PetscCall(MonitorQuantity(r->monitor, "bond_energy_released", t.released));
  PetscFunctionReturn(PETSC_SUCCESS);
}
