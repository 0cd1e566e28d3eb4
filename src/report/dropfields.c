/* DropFields: see report/dropfields.h. */
#include "compat.h"
#include "report/dropfields.h"
#include "base/hdf5.h"
#include "files.h"

void DropFieldsPhase(const DropsState *s, PetscInt n, PetscInt phase[])
{
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt k = DropsFind(s, s->cell_drop[e]);

    phase[e] = k < 0 ? 0 : 1 + s->drop[k].group;
  }
}

/* n edges: 0 but on rank 0. The ends of an edge come before its middle, as readers ask for. */
static PetscErrorCode write_edges(Hdf5 file, const DropsState *s, PetscInt n)
{
  static const PetscInt PLACE[3] = {0, 2, 1};
  const PhaseCurve     *c        = &s->curve;
  PetscReal(*x)[3];
  PetscInt(*edge)[3], *number;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(3 * n, &x));
  PetscCall(PetscMalloc2(n, &edge, 3 * n, &number));
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt e = c->edge[i], k = DropsFind(s, c->drop[e]);

    for (PetscInt j = 0; j < 3; j++) {
      edge[i][j] = 3 * i + j;
      for (PetscInt a = 0; a < 2; a++) x[3 * i + j][a] = c->x[e][PLACE[j]][a];
    }
    number[i]         = c->drop[e];
    number[n + i]     = k < 0 ? -1 : s->drop[k].group;
    number[2 * n + i] = c->loop[e];
  }
  PetscCall(Hdf5WriteReals(file, "coordinates", 3 * n, 3, (PetscReal *)x));
  PetscCall(Hdf5WriteInts(file, "edge", n, 3, (PetscInt *)edge));
  PetscCall(Hdf5WriteInts(file, "drop", n, 1, number));
  PetscCall(Hdf5WriteInts(file, "group", n, 1, number + n));
  PetscCall(Hdf5WriteInts(file, "curve", n, 1, number + 2 * n));
  PetscCall(PetscFree2(edge, number));
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int write_xdmf(PetscInt n, const char path[], const char file[], PetscReal time)
{
  FILE *f;
  int   err = XdmfBegin(path, NULL, &f);

  if (err) return err;
  fprintf(f, "      <Grid Name=\"drops\" GridType=\"Uniform\">\n        <Time Value=\"%.15g\"/>\n", (double)time);
  fprintf(f, "        <Topology TopologyType=\"Edge_3\" NumberOfElements=\"%" PetscInt_FMT "\">", n);
  XdmfItem(f, PETSC_TRUE, n, 3, file, "edge");
  fprintf(f, "</Topology>\n        <Geometry GeometryType=\"XYZ\">");
  XdmfItem(f, PETSC_FALSE, 3 * n, 3, file, "coordinates");
  fprintf(f, "</Geometry>\n");
  XdmfAttribute(f, PETSC_TRUE, n, 1, "Cell", "drop", file, "drop");
  XdmfAttribute(f, PETSC_TRUE, n, 1, "Cell", "group", file, "group");
  XdmfAttribute(f, PETSC_TRUE, n, 1, "Cell", "curve", file, "curve");
  fprintf(f, "      </Grid>\n");
  return XdmfEnd(path, NULL, &f);
}

PetscErrorCode DropFieldsWrite(MPI_Comm comm, Drops drops, const char dir[], PetscInt step, PetscReal time)
{
  DropsState *s;
  PetscMPIInt rank;
  Hdf5        file;
  char        name[64], path[PETSC_MAX_PATH_LEN];
  int         err = 0;

  PetscFunctionBeginUser;
  if (!drops) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DropsGetState(drops, &s));
  if (!s->curve.n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  (void)snprintf(name, sizeof(name), "drops_%" PetscInt_FMT ".h5", step);
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", dir, name));
  PetscCall(Hdf5Create(comm, path, &file));
  PetscCall(Hdf5WriteReals(file, "time", rank ? 0 : 1, 1, &time));
  PetscCall(write_edges(file, s, rank ? 0 : s->curve.n));
  PetscCall(FileCloseHdf5(comm, path, &file));
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/drops_%" PetscInt_FMT ".xdmf", dir, step));
  if (!rank) err = write_xdmf(s->curve.n, path, name, time);
  PetscCall(FileCheck(comm, err, path));
  PetscFunctionReturn(PETSC_SUCCESS);
}
