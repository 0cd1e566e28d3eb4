/* BondReport: see bondreport.h. Aggregates: components of the graph of bonds, by union and find; positions in them are
   followed along bonds, so that those across periodic faces are whole. The fractal dimension D of N ~ R^D is the slope
   of a straight line through log N over log R of the aggregates (least squares), 0 where fewer than two sizes are. */
#include "compat.h"
#include "bondreport.h"
#include "base/algebra.h"
#include "base/sparse.h"
#include "bodies/local.h"
#include "contact/bonds.h"
#include <unistd.h>

#define LINE 512

static const char BONDS_HEADING[] = "time,event,body,partner,tension,shear,twist,bending,x,y,z\n";
static const char AGGREGATES_HEADING
  [] = "time,bonds,aggregates,single,mean_size,largest,radius_of_gyration,fractal_dimension,coordination\n";

struct _p_BondReport {
  MPI_Comm    comm;
  Bodies      bodies;
  Contact     contact;
  Monitor     monitor;
  BodyState  *s;
  PetscMPIInt rank;
  PetscInt    column[3];
  PetscBool   opened;
  FILE       *events, *aggregates; /* of rank 0 */
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
  r->comm    = sim->comm;
  r->bodies  = sim->bodies;
  r->contact = sim->contact;
  r->monitor = sim->monitor;
  PetscCall(BodiesGetState(sim->bodies, &r->s));
  PetscCallMPI(MPI_Comm_rank(r->comm, &r->rank));
  for (PetscInt i = 0; i < 3; i++) PetscCall(MonitorAddColumn(sim->monitor, COLUMNS[i], &r->column[i]));
  PetscCall(FieldsGetDirectory(sim->fields, &dir));
  PetscCall(PetscStrncpy(r->dir, dir, sizeof(r->dir)));
  *report = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondReportDestroy(BondReport *report)
{
  PetscFunctionBeginUser;
  if (!*report) PetscFunctionReturn(PETSC_SUCCESS);
  if ((*report)->events) (void)fclose((*report)->events);
  if ((*report)->aggregates) (void)fclose((*report)->aggregates);
  PetscCall(PetscFree(*report));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- files ---- */

/* Rank 0: a table without lines from `time` on, which a run that goes on from a checkpoint makes again */
static FILE *open_table(const BondReport r, const char name[], const char heading[], PetscReal time)
{
  char  path[PETSC_MAX_PATH_LEN + 32], line[LINE];
  FILE *file;
  long  end = -1;

  (void)snprintf(path, sizeof(path), "%s/%s", r->dir, name);
  file = time > 0 ? fopen(path, "r+") : NULL;
  if (file && fgets(line, LINE, file) && !strcmp(line, heading)) {
    end = ftell(file);
    while (fgets(line, LINE, file) && strtod(line, NULL) < time) end = ftell(file);
    if (fseek(file, end, SEEK_SET) || ftruncate(fileno(file), (off_t)end)) end = -1;
  }
  if (end < 0 && file) (void)fclose(file);
  if (end >= 0) return file;
  file = fopen(path, "w");
  if (file && fputs(heading, file) < 0) (void)fclose(file);
  return file;
}

static PetscErrorCode open_tables(BondReport r, PetscReal time)
{
  int failed = 0;

  PetscFunctionBeginUser;
  if (r->opened) PetscFunctionReturn(PETSC_SUCCESS);
  r->opened = PETSC_TRUE;
  if (!r->rank) {
    r->events     = open_table(r, "bonds.csv", BONDS_HEADING, time);
    r->aggregates = open_table(r, "aggregates.csv", AGGREGATES_HEADING, time);
    failed        = !r->events || !r->aggregates;
  }
  PetscCallMPI(MPI_Bcast(&failed, 1, MPI_INT, 0, r->comm));
  PetscCheck(!failed, r->comm, PETSC_ERR_FILE_OPEN, "Cannot write bonds.csv into '%s': choose another -output_dir",
             r->dir);
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
    (void)fprintf(r->events, "%.12g,%s,%" PetscInt_FMT ",%s,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g\n", (double)b->time,
                  BOND_CAUSES[b->cause], b->i, partner, (double)b->load[0], (double)b->load[1], (double)b->load[2],
                  (double)b->load[3], (double)b->x[0], (double)b->x[1], (double)b->x[2]);
  }
  if (!r->rank) (void)fflush(r->events);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- aggregates ---- */

typedef struct {
  PetscInt  aggregates, largest, bonded;
  PetscReal rg, dimension;
} Aggregates;

/* The root of body k, and in d its place relative to that of the root: parent and offset [n][3] */
static PetscInt find_root(PetscInt parent[], PetscReal (*offset)[3], PetscInt k, PetscReal d[3])
{
  d[0] = d[1] = d[2] = 0;
  while (parent[k] != k) {
    for (PetscInt a = 0; a < 3; a++) d[a] += offset[k][a];
    k = parent[k];
  }
  return k;
}

static void unite(PetscInt parent[], PetscInt size[], PetscReal (*offset)[3], const BondView *b)
{
  PetscReal      di[3], dj[3];
  const PetscInt i = find_root(parent, offset, b->i, di), j = find_root(parent, offset, b->j, dj);
  const PetscInt up = size[i] >= size[j] ? i : j, down = up == i ? j : i;

  if (i == j) return;
  for (PetscInt a = 0; a < 3; a++) { /* place of root j in that of root i */
    const PetscReal d = di[a] + b->offset[a] - dj[a];

    offset[down][a] = down == j ? d : -d;
  }
  parent[down] = up;
  size[up] += size[down];
}

/* Sums of all aggregates: squares of distances, and the line through log N over log R */
static void measure(PetscInt n, PetscInt parent[], const PetscInt size[], PetscReal (*offset)[3], PetscReal (*sum)[4],
                    Aggregates *out)
{
  PetscReal x = 0, y = 0, xx = 0, xy = 0, d[3];
  PetscInt  m = 0;

  for (PetscInt k = 0; k < n; k++) {
    const PetscInt root = find_root(parent, offset, k, d);

    for (PetscInt a = 0; a < 3; a++) sum[root][a] += d[a];
    sum[root][3] += dot3(d, d);
  }
  for (PetscInt k = 0; k < n; k++) {
    const PetscReal N = (PetscReal)size[k];
    PetscReal       R;

    if (parent[k] != k || size[k] < 2) continue;
    R = PetscSqrtReal(PetscMax(0, sum[k][3] / N - dot3(sum[k], sum[k]) / (N * N)));
    out->aggregates++;
    out->bonded += size[k];
    out->largest = PetscMax(out->largest, size[k]);
    out->rg += R * N;
    if (R <= 0) continue;
    m++;
    x += PetscLogReal(R);
    y += PetscLogReal(N);
    xx += PetscSqr(PetscLogReal(R));
    xy += PetscLogReal(R) * PetscLogReal(N);
  }
  if (out->bonded) out->rg /= (PetscReal)out->bonded;
  if (m > 1 && m * xx - x * x > PETSC_SQRT_MACHINE_EPSILON * m * xx)
    out->dimension = (m * xy - x * y) / (m * xx - x * x);
}

static PetscErrorCode find_aggregates(BondReport r, PetscInt nbonds, const BondView bond[], Aggregates *out)
{
  const PetscInt n = r->s->nall;
  PetscInt      *parent, *size;
  PetscReal(*offset)[3], (*sum)[4];

  PetscFunctionBeginUser;
  *out = (Aggregates){0};
  PetscCall(PetscMalloc2(n, &parent, n, &size));
  PetscCall(PetscCalloc2(n, &offset, n, &sum));
  for (PetscInt k = 0; k < n; k++) parent[k] = k;
  for (PetscInt k = 0; k < n; k++) size[k] = 1;
  for (PetscInt e = 0; e < nbonds; e++)
    if (bond[e].j >= 0) unite(parent, size, offset, &bond[e]);
  measure(n, parent, size, offset, sum, out);
  PetscCall(PetscFree2(parent, size));
  PetscCall(PetscFree2(offset, sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_aggregates(BondReport r, PetscReal time)
{
  PetscInt   own, n;
  BondView  *mine, *bond;
  Aggregates a;

  PetscFunctionBeginUser;
  PetscCall(ContactGetBonds(r->contact, &own, &mine));
  PetscCall(SparseGather(BodiesComm(r->bodies), own, sizeof(*mine), mine, &n, &bond, NULL));
  PetscCall(PetscFree(mine));
  if (!r->rank) {
    PetscCall(find_aggregates(r, n, bond, &a));
    (void)fprintf(r->aggregates,
                  "%.12g,%" PetscInt_FMT ",%" PetscInt_FMT ",%" PetscInt_FMT ",%.9g,%" PetscInt_FMT ",%.9g,%.6g,%.9g\n",
                  (double)time, n, a.aggregates, r->s->nall - a.bonded,
                  a.aggregates ? (double)a.bonded / (double)a.aggregates : 0., a.largest, (double)a.rg,
                  (double)a.dimension, a.bonded ? 2. * (double)n / (double)a.bonded : 0.);
    (void)fflush(r->aggregates);
  }
  PetscCall(PetscFree(bond));
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
