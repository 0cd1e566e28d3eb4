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

/* How the pieces of an interface are written: quadratic edges in the plane, biquadratic faces in space. Corners come
   before middles, as readers ask for. */
typedef struct {
  PetscInt    dim, nodes, place[9];
  const char *set, *topology;
} PieceKind;

static const PieceKind EDGES = {2, 3, {0, 2, 1}, "edge", "Edge_3"},
                       FACES = {3, 9, {0, 2, 8, 6, 1, 5, 7, 3, 4}, "face", "Quadrilateral_9"};

static const PieceKind *kind_of(const DropsState *s)
{
  return s->interface.sheet.n ? &FACES : &EDGES;
}

/* The i-th piece: nodes x, and the closed curve or surface that it is of; its number in the interface */
static PetscInt piece_at(const PhaseInterface *f, PetscInt i, const PetscReal **x, PetscInt *whole)
{
  const PetscInt e = f->sheet.n ? i : f->curve.edge[i];

  *x     = f->sheet.n ? (const PetscReal *)f->sheet.x[e] : (const PetscReal *)f->curve.x[e];
  *whole = f->sheet.n ? f->sheet.part[e] : f->curve.loop[e];
  return e;
}

/* n pieces: 0 but on rank 0 */
static PetscErrorCode write_pieces(Hdf5 file, const DropsState *s, PetscInt n)
{
  const PieceKind *kind = kind_of(s);
  const PetscInt   m    = kind->nodes;
  PetscReal(*x)[3];
  PetscInt *node, *number;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(m * n, &x));
  PetscCall(PetscMalloc2(m * n, &node, 3 * n, &number));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal *from, *middle;
    const PetscInt   e = piece_at(&s->interface, i, &from, &number[2 * n + i]);
    PetscInt         k;

    for (PetscInt j = 0; j < m; j++) {
      node[m * i + j] = m * i + j;
      for (PetscInt a = 0; a < kind->dim; a++) x[m * i + j][a] = from[kind->dim * kind->place[j] + a];
    }
    (void)PhaseInterfacePiece(&s->interface, e, &number[i], &middle);
    k             = DropsFind(s, number[i]);
    number[n + i] = k < 0 ? -1 : s->drop[k].group;
  }
  PetscCall(Hdf5WriteReals(file, "coordinates", m * n, 3, (PetscReal *)x));
  PetscCall(Hdf5WriteInts(file, kind->set, n, m, node));
  PetscCall(Hdf5WriteInts(file, "drop", n, 1, number));
  PetscCall(Hdf5WriteInts(file, "group", n, 1, number + n));
  PetscCall(Hdf5WriteInts(file, "curve", n, 1, number + 2 * n));
  PetscCall(PetscFree2(node, number));
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int write_xdmf(const PieceKind *kind, PetscInt n, const char path[], const char file[], PetscReal time)
{
  FILE *f;
  int   err = XdmfBegin(path, NULL, &f);

  if (err) return err;
  fprintf(f, "      <Grid Name=\"drops\" GridType=\"Uniform\">\n        <Time Value=\"%.15g\"/>\n", (double)time);
  fprintf(f, "        <Topology TopologyType=\"%s\" NumberOfElements=\"%" PetscInt_FMT "\">", kind->topology, n);
  XdmfItem(f, PETSC_TRUE, n, kind->nodes, file, kind->set);
  fprintf(f, "</Topology>\n        <Geometry GeometryType=\"XYZ\">");
  XdmfItem(f, PETSC_FALSE, kind->nodes * n, 3, file, "coordinates");
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
  PetscInt    n;
  int         err = 0;

  PetscFunctionBeginUser;
  if (!drops) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DropsGetState(drops, &s));
  n = PhaseInterfaceSize(&s->interface);
  if (!n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  (void)snprintf(name, sizeof(name), "drops_%" PetscInt_FMT ".h5", step);
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", dir, name));
  PetscCall(Hdf5Create(comm, path, &file));
  PetscCall(Hdf5WriteReals(file, "time", rank ? 0 : 1, 1, &time));
  PetscCall(write_pieces(file, s, rank ? 0 : n));
  PetscCall(FileCloseHdf5(comm, path, &file));
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/drops_%" PetscInt_FMT ".xdmf", dir, step));
  if (!rank) err = write_xdmf(kind_of(s), n, path, name, time);
  PetscCall(FileCheck(comm, err, path));
  PetscFunctionReturn(PETSC_SUCCESS);
}
