/* BondFields: see report/bondfields.h. The rows are written in even shares of the ranks. */
#include "compat.h"
#include "report/bondfields.h"
#include "base/array.h"
#include "base/hdf5.h"
#include "files.h"

typedef struct {
  PetscInt  step, n;
  PetscReal time;
} Snapshot;

struct _p_BondFields {
  MPI_Comm    comm;
  PetscMPIInt rank, size;
  PetscInt    nsnap, capacity;
  Snapshot   *snapshot;
};

#define NREALS 6
static const char *const REALS[NREALS] = {"tension", "shear", "twist", "bending", "energy", "formed"};
static const char *const INTS[]        = {"body", "partner", "aggregate"};

PetscErrorCode BondFieldsCreate(MPI_Comm comm, BondFields *fields)
{
  BondFields b;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->comm = comm;
  PetscCallMPI(MPI_Comm_rank(comm, &b->rank));
  PetscCallMPI(MPI_Comm_size(comm, &b->size));
  *fields = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondFieldsDestroy(BondFields *b)
{
  PetscFunctionBeginUser;
  if (!*b) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree((*b)->snapshot));
  PetscCall(PetscFree(*b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- datasets ---- */

static PetscErrorCode write_lines(Hdf5 file, PetscInt start, PetscInt n, const BondView bond[],
                                  const PetscReal frame[3])
{
  PetscReal(*end)[3];
  PetscInt *line;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(2 * n, &end, 2 * n, &line));
  for (PetscInt e = 0; e < 2 * n; e++) {
    const BondView *b = &bond[start + e / 2];

    line[e] = 2 * start + e;
    for (PetscInt a = 0; a < 3; a++) end[e][a] = b->x[a] + frame[a] + (e % 2 ? b->offset[a] : 0);
  }
  PetscCall(Hdf5WriteReals(file, "end", 2 * n, 3, &end[0][0]));
  PetscCall(Hdf5WriteInts(file, "line", n, 2, line));
  PetscCall(PetscFree2(end, line));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_values(Hdf5 file, PetscInt n, const BondView bond[], const PetscInt aggregate[])
{
  PetscReal *value;
  PetscInt  *number;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(n, &value, n, &number));
  for (PetscInt i = 0; i < NREALS; i++) {
    for (PetscInt e = 0; e < n; e++) value[e] = i < 4 ? bond[e].load[i] : i == 4 ? bond[e].stored : bond[e].formed;
    PetscCall(Hdf5WriteReals(file, REALS[i], n, 1, value));
  }
  for (PetscInt i = 0; i < 3; i++) {
    for (PetscInt e = 0; e < n; e++) number[e] = i == 0 ? bond[e].i : i == 1 ? bond[e].j : aggregate[e];
    PetscCall(Hdf5WriteInts(file, INTS[i], n, 1, number));
  }
  PetscCall(PetscFree2(value, number));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- XDMF ---- */

/* Rank 0; 0 or errno */
static int write_index(BondFields b, const char path[])
{
  FILE *f;
  int   err = XdmfBegin(path, "bonds", &f);

  if (err) return err;
  for (PetscInt i = 0; i < b->nsnap; i++) {
    const Snapshot *s = &b->snapshot[i];
    char            file[64];

    (void)snprintf(file, sizeof(file), "bonds_%" PetscInt_FMT ".h5", s->step);
    fprintf(f, "      <Grid Name=\"step %" PetscInt_FMT "\" GridType=\"Uniform\">\n        <Time Value=\"%.15g\"/>\n",
            s->step, (double)s->time);
    fprintf(f,
            "        <Topology TopologyType=\"Polyline\" NumberOfElements=\"%" PetscInt_FMT "\" NodesPerElement=\"2\">",
            s->n);
    XdmfItem(f, PETSC_TRUE, s->n, 2, file, "line");
    fprintf(f, "</Topology>\n        <Geometry GeometryType=\"XYZ\">");
    XdmfItem(f, PETSC_FALSE, 2 * s->n, 3, file, "end");
    fprintf(f, "</Geometry>\n");
    for (PetscInt k = 0; k < NREALS; k++) XdmfAttribute(f, PETSC_FALSE, s->n, 1, "Cell", REALS[k], file, REALS[k]);
    for (PetscInt k = 0; k < 3; k++) XdmfAttribute(f, PETSC_TRUE, s->n, 1, "Cell", INTS[k], file, INTS[k]);
    fprintf(f, "      </Grid>\n");
  }
  return XdmfEnd(path, "bonds", &f);
}

static PetscErrorCode rewrite_index(BondFields b, const char dir[])
{
  char path[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/bonds" XDMF_ENDING, dir));
  if (!b->nsnap && !b->rank) XdmfRemove(dir, "bonds");
  PetscCall(FileCheck(b->comm, b->rank || !b->nsnap ? 0 : write_index(b, path), path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode BondFieldsWrite(BondFields b, const char dir[], PetscInt step, PetscReal time, PetscInt n,
                               const BondView bond[], const PetscInt aggregate[], const PetscReal frame[3])
{
  const PetscInt start = n / b->size * b->rank + PetscMin(b->rank, n % b->size),
                 own   = n / b->size + (b->rank < n % b->size);
  char path[PETSC_MAX_PATH_LEN], reason[256];
  Hdf5 file;

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/bonds_%" PetscInt_FMT ".h5", dir, step));
  PetscCall(Hdf5Create(b->comm, path, &file));
  PetscCall(Hdf5WriteReals(file, "time", b->rank ? 0 : 1, 1, &time));
  PetscCall(write_lines(file, start, own, bond, frame));
  PetscCall(write_values(file, own, bond + start, aggregate + start));
  PetscCall(Hdf5Close(&file, reason, sizeof(reason)));
  PetscCheck(!reason[0], b->comm, PETSC_ERR_FILE_WRITE,
             "Cannot write '%s': %s. Check the disk or choose another -output_dir", path, reason);
  while (b->nsnap && b->snapshot[b->nsnap - 1].step >= step) b->nsnap--;
  PetscCall(ArrayReserve(b->nsnap + 1, &b->capacity, &b->snapshot, sizeof(*b->snapshot), NULL));
  if (n) b->snapshot[b->nsnap++] = (Snapshot){step, n, time}; /* readers refuse grids without cells */
  PetscCall(rewrite_index(b, dir));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondFieldsRewind(BondFields b, const char dir[])
{
  int there = 0;

  PetscFunctionBeginUser;
  if (!b->rank) there = XdmfExists(dir, "bonds");
  PetscCallMPI(MPI_Bcast(&there, 1, MPI_INT, 0, b->comm));
  if (!there) b->nsnap = 0; /* earlier snapshots are elsewhere */
  else PetscCall(rewrite_index(b, dir));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondFieldsVisitState(void *fields, State state)
{
  BondFields b = fields;
  PetscInt   n = b->nsnap, *number;
  PetscReal *time;

  PetscFunctionBeginUser;
  if (StateIsLoading(state)) {
    PetscCall(StateGetSize(state, "snapshot_time", &n));
    n = PetscMax(n, 0);
    PetscCall(ArrayReserve(n, &b->capacity, &b->snapshot, sizeof(*b->snapshot), NULL));
    b->nsnap = n;
  }
  if (!n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc2(2 * n, &number, n, &time));
  for (PetscInt i = 0; i < n && !StateIsLoading(state); i++) {
    number[2 * i]     = b->snapshot[i].step;
    number[2 * i + 1] = b->snapshot[i].n;
    time[i]           = b->snapshot[i].time;
  }
  PetscCall(StateInts(state, "snapshot", 2 * n, number));
  PetscCall(StateReals(state, "snapshot_time", n, time));
  for (PetscInt i = 0; i < n && StateIsLoading(state); i++)
    b->snapshot[i] = (Snapshot){number[2 * i], number[2 * i + 1], time[i]};
  PetscCall(PetscFree2(number, time));
  PetscFunctionReturn(PETSC_SUCCESS);
}
