/* BondFields: see report/bondfields.h. The rows are written in even shares of the ranks. */
#include "compat.h"
#include "report/bondfields.h"
#include "base/hdf5.h"
#include "files.h"
#include "snapshots.h"

struct _p_BondFields {
  MPI_Comm    comm;
  PetscMPIInt rank, size;
  Snapshots   list; /* a count each: of its bonds */
};

#define NREALS 6
static const char *const REALS[NREALS] = {"tension", "shear", "twist", "bending", "energy", "formed"};
static const char *const INTS[]        = {"body", "partner", "aggregate"};

PetscErrorCode BondFieldsCreate(MPI_Comm comm, BondFields *fields)
{
  BondFields b;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->comm        = comm;
  b->list.counts = 1;
  PetscCallMPI(MPI_Comm_rank(comm, &b->rank));
  PetscCallMPI(MPI_Comm_size(comm, &b->size));
  *fields = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondFieldsDestroy(BondFields *b)
{
  PetscFunctionBeginUser;
  if (!*b) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree((*b)->list.snapshot));
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
  for (PetscInt i = 0; i < b->list.n; i++) {
    const Snapshot *s = &b->list.snapshot[i];
    const PetscInt  n = s->count[0];
    char            file[64];

    (void)snprintf(file, sizeof(file), "bonds_%" PetscInt_FMT ".h5", s->step);
    fprintf(f, "      <Grid Name=\"step %" PetscInt_FMT "\" GridType=\"Uniform\">\n        <Time Value=\"%.15g\"/>\n",
            s->step, (double)s->time);
    fprintf(f,
            "        <Topology TopologyType=\"Polyline\" NumberOfElements=\"%" PetscInt_FMT "\" NodesPerElement=\"2\">",
            n);
    XdmfItem(f, PETSC_TRUE, n, 2, file, "line");
    fprintf(f, "</Topology>\n        <Geometry GeometryType=\"XYZ\">");
    XdmfItem(f, PETSC_FALSE, 2 * n, 3, file, "end");
    fprintf(f, "</Geometry>\n");
    for (PetscInt k = 0; k < NREALS; k++) XdmfAttribute(f, PETSC_FALSE, n, 1, "Cell", REALS[k], file, REALS[k]);
    for (PetscInt k = 0; k < 3; k++) XdmfAttribute(f, PETSC_TRUE, n, 1, "Cell", INTS[k], file, INTS[k]);
    fprintf(f, "      </Grid>\n");
  }
  return XdmfEnd(path, "bonds", &f);
}

static PetscErrorCode rewrite_index(BondFields b, const char dir[])
{
  char path[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/bonds" XDMF_ENDING, dir));
  if (!b->list.n && !b->rank) XdmfRemove(dir, "bonds");
  PetscCall(FileCheck(b->comm, b->rank || !b->list.n ? 0 : write_index(b, path), path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode BondFieldsWrite(BondFields b, const char dir[], PetscInt step, PetscReal time, PetscInt n,
                               const BondView bond[], const PetscInt aggregate[], const PetscReal frame[3])
{
  const PetscInt start    = n / b->size * b->rank + PetscMin(b->rank, n % b->size),
                 own      = n / b->size + (b->rank < n % b->size);
  const Snapshot snapshot = {.step = step, .count = {n}, .time = time};
  char           path[PETSC_MAX_PATH_LEN];
  Hdf5           file;

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/bonds_%" PetscInt_FMT ".h5", dir, step));
  PetscCall(Hdf5Create(b->comm, path, &file));
  PetscCall(Hdf5WriteReals(file, "time", b->rank ? 0 : 1, 1, &time));
  PetscCall(write_lines(file, start, own, bond, frame));
  PetscCall(write_values(file, own, bond + start, aggregate + start));
  PetscCall(FileCloseHdf5(b->comm, path, &file));
  SnapshotsCut(&b->list, step);
  if (n) PetscCall(SnapshotsAdd(&b->list, &snapshot)); /* readers refuse grids without cells */
  PetscCall(rewrite_index(b, dir));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondFieldsRewind(BondFields b, const char dir[])
{
  PetscBool there;

  PetscFunctionBeginUser;
  PetscCall(SnapshotsFindIndex(&b->list, b->comm, dir, "bonds", &there));
  if (there) PetscCall(rewrite_index(b, dir));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondFieldsVisitState(void *fields, State state)
{
  PetscFunctionBeginUser;
  PetscCall(SnapshotsVisitState(&((BondFields)fields)->list, state));
  PetscFunctionReturn(PETSC_SUCCESS);
}
