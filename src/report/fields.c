/* Fields: see fields.h. Snapshots of the fields as HDF5, described by one XDMF file for ParaView, and
   by one of the newest alone.

   mesh.h5 holds the points [n][3] and the cells [n][3^dim] in the node order of VTK; fields_<step>.h5 holds the
   fields. Vectors have three components also in 2D (third zero), because glyphs and stream tracers of ParaView ask
   for them. On a periodic mesh cells share their points but across the period (points.h).
   The file is not made for restarts and holds no history of the bodies: see checkpoint and monitor. */
#include "compat.h"
#include "base/algebra.h"
#include "base/array.h"
#include "base/hdf5.h"
#include "report/fields.h"
#include "base/log.h"
#include "base/opt.h"
#include "derived.h"
#include "files.h"
#include "points.h"
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define LAST "fields_last" /* the newest snapshot alone, for readers of one grid */

typedef struct {
  PetscInt  step, mesh; /* mesh: see mesh_step below */
  PetscInt  ncell, npoint;
  PetscReal time;
  PetscBool body, error, conformation, scalars, phase;
} Snapshot;

struct _p_Fields {
  Mesh             mesh;
  const MeshLocal *loc;
  MPI_Comm         comm;
  PetscMPIInt      rank;
  char             dir[PETSC_MAX_PATH_LEN];
  PetscInt         every;
  PetscReal        interval;
  PetscBool        overwrite, restarted, mesh_written;
  /* snapshots refer to mesh.h5 (0) or mesh_<mesh_step>.h5 */
  PetscInt  mesh_step;
  PetscInt  moves;                     /* those of MeshLocal when it was written */
  PetscReal offset[3], offset_mesh[3]; /* of the box in the laboratory: now, when it was written */
  Points    points;                    /* while a snapshot is written */
  PetscInt  nsnap, capacity;
  Snapshot *snapshot;
  PetscInt  nscalar, scalar_capacity; /* of FieldsAddScalar */
  struct Carried {
    const char      *name;
    const PetscReal *gradient;
  } * carried;
  const PetscReal *scalar;
  const PetscInt  *phase; /* NULL: there are no drops */
};

/* ---- files and directories ---- */

static PetscErrorCode join_path(const Fields o, const char name[], char path[], size_t len)
{
  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(path, len, "%s/%s", o->dir, name));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Returns 0 or errno; an existing directory is fine */
static int make_directory(const char dir[])
{
  char        partial[PETSC_MAX_PATH_LEN];
  struct stat s;

  snprintf(partial, sizeof(partial), "%s", dir);
  for (char *c = partial + 1;; c++) {
    const char end = *c;

    if (end && end != '/') continue;
    *c = 0;
    if (mkdir(partial, 0777) && errno != EEXIST) return errno;
    if (!end) break;
    *c = end;
  }
  if (stat(dir, &s)) return errno;
  if (!S_ISDIR(s.st_mode)) return ENOTDIR;
  return access(dir, W_OK) ? errno : 0;
}

static PetscErrorCode open_hdf5(Fields o, const char name[], Hdf5 *file)
{
  char path[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  PetscCall(join_path(o, name, path, sizeof(path)));
  PetscCall(Hdf5Create(o->comm, path, file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode close_hdf5(Fields o, const char name[], Hdf5 *file)
{
  char path[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  PetscCall(join_path(o, name, path, sizeof(path)));
  PetscCall(FileCloseHdf5(o->comm, path, file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- datasets ---- */

/* Nodal values v [nnode_all][bs] -> values at the points of the file */
static PetscErrorCode write_nodal(Fields o, Hdf5 file, const char name[], PetscInt bs, const PetscReal v[])
{
  const Points *p = &o->points;
  PetscReal    *w;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(p->n * bs, &w));
  PetscCall(PointsEvaluate(p, o->mesh, bs, v, w));
  PetscCall(Hdf5WriteReals(file, name, p->n, bs, w));
  PetscCall(PetscFree(w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of those with a mean gradient it counts where the points are: images of nodes across a period have their own */
static PetscErrorCode write_scalar(Fields o, Hdf5 file, PetscInt i)
{
  const Points *p = &o->points;
  PetscReal    *w, *x;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(p->n, &w, 3 * p->n, &x));
  PetscCall(PointsEvaluate(p, o->mesh, 1, o->scalar + i * o->loc->nnode_all, w));
  PetscCall(PointsGetPositions(p, o->mesh, x));
  for (PetscInt k = 0; k < p->n * o->loc->dim; k++)
    w[k / o->loc->dim] += o->carried[i].gradient[k % o->loc->dim] * x[k / o->loc->dim * 3 + k % o->loc->dim];
  PetscCall(Hdf5WriteReals(file, o->carried[i].name, p->n, 1, w));
  PetscCall(PetscFree2(w, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_nodal_integers(Fields o, Hdf5 file, const char name[], const PetscInt v[])
{
  const Points *p = &o->points;
  PetscInt     *w;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(p->n, &w));
  PetscCall(PointsPick(p, o->mesh, v, w));
  PetscCall(Hdf5WriteInts(file, name, p->n, 1, w));
  PetscCall(PetscFree(w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the mesh ---- */

static PetscErrorCode write_points(Fields o, Hdf5 file)
{
  PetscReal *x;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(3 * o->points.n, &x));
  PetscCall(PointsGetPositions(&o->points, o->mesh, x));
  for (PetscInt i = 0; i < 3 * o->points.n; i++) x[i] += o->offset[i % 3];
  PetscCall(Hdf5WriteReals(file, "coordinates", o->points.n, 3, x));
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_cells(Fields o, Hdf5 file)
{
  const MeshLocal *m     = o->loc;
  const PetscInt  *order = PointsVtkOrder(m->dim);
  PetscInt        *cell, number[MESH_MAX_NB];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(m->ncell * m->nb, &cell));
  for (PetscInt c = 0; c < m->ncell; c++) {
    PetscCall(PointsOfCell(&o->points, o->mesh, c, number));
    for (PetscInt k = 0; k < m->nb; k++) cell[c * m->nb + k] = number[order[k]];
  }
  PetscCall(Hdf5WriteInts(file, "cells", m->ncell, m->nb, cell));
  PetscCall(PetscFree(cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void name_mesh(PetscInt step, char name[], size_t len)
{
  if (step) (void)snprintf(name, len, "mesh_%" PetscInt_FMT ".h5", step);
  else (void)snprintf(name, len, "mesh.h5");
}

static PetscErrorCode write_mesh(Fields o)
{
  Hdf5 file;
  char name[64];

  PetscFunctionBeginUser;
  name_mesh(o->mesh_step, name, sizeof(name));
  PetscCall(open_hdf5(o, name, &file));
  PetscCall(write_points(o, file));
  PetscCall(write_cells(o, file));
  PetscCall(close_hdf5(o, name, &file));
  o->mesh_written = PETSC_TRUE;
  o->moves        = o->loc->moves;
  PetscCall(PetscArraycpy(o->offset_mesh, o->offset, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the fields of a snapshot ---- */

/* Dataset of vectors with three components from v [n][stride], of which the first dim count */
static void pad_vectors(PetscInt n, PetscInt dim, PetscInt stride, const PetscReal v[], PetscReal w[])
{
  for (PetscInt i = 0; i < n; i++) {
    for (PetscInt d = 0; d < 3; d++) w[3 * i + d] = d < dim ? v[i * stride + d] : 0;
  }
}

static PetscErrorCode write_velocity(Fields o, Hdf5 file, const PetscReal u[])
{
  const MeshLocal *m = o->loc;
  PetscReal       *v, *w;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(m->nnode_all * m->dim, &v, m->nnode_all * 3, &w));
  PetscCall(PetscArraycpy(v, u, m->nnode * m->dim));
  PetscCall(MeshSyncNodes(o->mesh, m->dim, v));
  pad_vectors(m->nnode_all, m->dim, m->dim, v, w);
  PetscCall(write_nodal(o, file, "velocity", 3, w));
  PetscCall(DerivedVorticity(o->mesh, v, w));
  if (m->dim == 2) {
    for (PetscInt i = 0; i < m->nnode_all; i++) v[i] = w[3 * i + 2];
    PetscCall(write_nodal(o, file, "vorticity", 1, v));
  } else PetscCall(write_nodal(o, file, "vorticity", 3, w));
  PetscCall(PetscFree2(v, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_pressure(Fields o, Hdf5 file, const PetscReal p[], const PetscInt body[])
{
  const MeshLocal *m  = o->loc;
  const PetscInt   bs = m->dim + 1;
  PetscReal       *w, *q;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(m->ncell * 3, &w, m->nnode_all, &q));
  for (PetscInt c = 0; c < m->ncell; c++) w[c] = p[c * bs];
  PetscCall(Hdf5WriteReals(file, "pressure_mean", m->ncell, 1, w));
  pad_vectors(m->ncell, m->dim, bs, p + 1, w);
  PetscCall(Hdf5WriteReals(file, "pressure_gradient", m->ncell, 3, w));
  PetscCall(DerivedPressure(o->mesh, p, body, q));
  PetscCall(write_nodal(o, file, "pressure", 1, q));
  PetscCall(PetscFree2(w, q));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- XDMF ---- */

/* alone: the file has no other, and no time, which meshio.read does not take beside one grid */
static void print_snapshot(FILE *f, const Fields o, const Snapshot *s, PetscBool alone)
{
  const MeshLocal *m = o->loc;
  char             file[64], mesh[64];

  name_mesh(s->mesh, mesh, sizeof(mesh));
  snprintf(file, sizeof(file), "fields_%" PetscInt_FMT ".h5", s->step);
  fprintf(f, "      <Grid Name=\"step %" PetscInt_FMT "\" GridType=\"Uniform\">\n", s->step);
  if (!alone) fprintf(f, "        <Time Value=\"%.15g\"/>\n", (double)s->time);
  fprintf(f, "        <Topology TopologyType=\"%s\" NumberOfElements=\"%" PetscInt_FMT "\">",
          m->dim == 2 ? "Quadrilateral_9" : "Hexahedron_27", s->ncell);
  XdmfItem(f, PETSC_TRUE, s->ncell, m->nb, mesh, "cells");
  fprintf(f, "</Topology>\n        <Geometry GeometryType=\"XYZ\">");
  XdmfItem(f, PETSC_FALSE, s->npoint, 3, mesh, "coordinates");
  fprintf(f, "</Geometry>\n");
  XdmfAttribute(f, PETSC_FALSE, s->npoint, 3, "Node", "velocity", file, "velocity");
  XdmfAttribute(f, PETSC_FALSE, s->npoint, m->dim == 2 ? 1 : 3, "Node", "vorticity", file, "vorticity");
  XdmfAttribute(f, PETSC_FALSE, s->npoint, 1, "Node", "pressure", file, "pressure");
  if (s->body) XdmfAttribute(f, PETSC_TRUE, s->npoint, 1, "Node", "body", file, "body");
  if (s->conformation) XdmfAttribute(f, PETSC_FALSE, s->npoint, 6, "Node", "conformation", file, "conformation");
  for (PetscInt i = 0; i < o->nscalar && s->scalars; i++)
    XdmfAttribute(f, PETSC_FALSE, s->npoint, 1, "Node", o->carried[i].name, file, o->carried[i].name);
  XdmfAttribute(f, PETSC_FALSE, s->ncell, 1, "Cell", "pressure_mean", file, "pressure_mean");
  XdmfAttribute(f, PETSC_FALSE, s->ncell, 3, "Cell", "pressure_gradient", file, "pressure_gradient");
  if (s->phase) XdmfAttribute(f, PETSC_TRUE, s->ncell, 1, "Cell", "phase", file, "phase");
  if (s->error) XdmfAttribute(f, PETSC_FALSE, s->ncell, 1, "Cell", "error_indicator", file, "error_indicator");
  fprintf(f, "      </Grid>\n");
}

/* Rank 0; returns 0 or errno */
static int write_last(const Fields o)
{
  char  path[PETSC_MAX_PATH_LEN];
  FILE *f;
  int   err;

  if (snprintf(path, sizeof(path), "%s/" LAST XDMF_ENDING, o->dir) >= (int)sizeof(path)) return ENAMETOOLONG;
  err = XdmfBegin(path, NULL, &f);
  if (err) return err;
  print_snapshot(f, o, &o->snapshot[o->nsnap - 1], PETSC_TRUE);
  return XdmfEnd(path, NULL, &f);
}

/* Rank 0; returns 0 or errno */
static int write_index(const Fields o, const char path[])
{
  FILE *f;
  int   err = XdmfBegin(path, "tumble", &f);

  if (err) return err;
  for (PetscInt i = 0; i < o->nsnap; i++) print_snapshot(f, o, &o->snapshot[i], PETSC_FALSE);
  err = XdmfEnd(path, "tumble", &f);
  return err ? err : write_last(o);
}

/* Rank 0 */
static void remove_index(const Fields o)
{
  XdmfRemove(o->dir, "fields");
  XdmfRemove(o->dir, LAST);
}

/* A step written twice takes the place of its first version */
static PetscErrorCode add_snapshot(Fields o, PetscInt step, PetscReal time, PetscBool body, PetscBool error,
                                   PetscBool conformation)
{
  char path[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  while (o->nsnap && o->snapshot[o->nsnap - 1].step >= step) o->nsnap--;
  if (o->nsnap == o->capacity) {
    o->capacity = 2 * o->capacity + 16;
    PetscCall(PetscRealloc(o->capacity * sizeof(Snapshot), &o->snapshot));
  }
  o->snapshot[o->nsnap++] = (Snapshot){step,
                                       o->mesh_step,
                                       o->loc->ncell_global,
                                       o->points.total,
                                       time,
                                       body,
                                       error,
                                       conformation,
                                       (PetscBool)(o->nscalar > 0),
                                       (PetscBool)(o->phase != NULL)};
  PetscCall(join_path(o, "fields" XDMF_ENDING, path, sizeof(path)));
  PetscCall(FileCheck(o->comm, o->rank ? 0 : write_index(o, path), path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode FieldsCreate(Mesh mesh, const char scene[], Fields *fields)
{
  Fields o;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&o));
  o->mesh = mesh;
  PetscCall(MeshGetLocal(mesh, &o->loc));
  PetscCall(MeshGetComm(mesh, &o->comm));
  PetscCallMPI(MPI_Comm_rank(o->comm, &o->rank));
  PetscCall(PetscSNPrintf(o->dir, sizeof(o->dir), "out/%s", scene));
  PetscCall(OptString("-output_dir", o->dir, sizeof(o->dir)));
  PetscCall(OptReal("-output_interval", &o->interval));
  PetscCall(OptInt("-output_every", &o->every));
  PetscCall(OptBool("-output_overwrite", &o->overwrite));
  PetscCheck(o->dir[0], o->comm, PETSC_ERR_USER_INPUT,
             "Option -output_dir is empty: give the name of a directory ('.' for the present one)");

  o->moves = o->loc->moves;
  *fields  = o;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsOpen(Fields o)
{
  char series[PETSC_MAX_PATH_LEN];
  int  state[3] = {0, 0, 0}; /* errno; is there a series.csv, a fields.xdmf? Only rank 0 can tell, and all ranks leave
                                with the same error. */

  PetscFunctionBeginUser;
  PetscCall(join_path(o, "series.csv", series, sizeof(series)));
  if (o->rank == 0) {
    state[0] = make_directory(o->dir);
    state[1] = !access(series, F_OK);
    state[2] = XdmfExists(o->dir, "fields");
    if (!state[0] && !o->restarted && (!state[1] || o->overwrite))
      remove_index(o); /* an index left by another run would name snapshots that are not ours */
  }
  PetscCallMPI(MPI_Bcast(state, 3, MPI_INT, 0, o->comm));
  if (!state[2]) o->nsnap = o->mesh_step = 0; /* restarted in another directory: earlier snapshots are elsewhere */
  PetscCheck(!state[0], o->comm, PETSC_ERR_FILE_OPEN,
             "Cannot write into directory '%s': %s. Choose another -output_dir", o->dir, strerror(state[0]));
  PetscCheck(!state[1] || o->overwrite || o->restarted, o->comm, PETSC_ERR_USER_INPUT,
             "Directory '%s' already holds the results of a run (series.csv): choose another -output_dir or allow it with -output_overwrite",
             o->dir);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsRewind(Fields o, PetscInt step)
{
  char     path[PETSC_MAX_PATH_LEN];
  int      err     = 0;
  PetscInt removed = 0;

  PetscFunctionBeginUser;
  PetscCall(join_path(o, "fields" XDMF_ENDING, path, sizeof(path)));
  while (o->nsnap && o->snapshot[o->nsnap - 1].step > step) o->nsnap--;
  if (o->rank == 0) {
    removed = FilesRemoveAfter(o->dir, step);
    if (o->nsnap) err = write_index(o, path);
    else remove_index(o);
  }
  PetscCall(FileCheck(o->comm, err, path));
  if (removed)
    PetscCall(PetscPrintf(o->comm,
                          "Files of steps after %" PetscInt_FMT ", where the run goes on, are removed: %" PetscInt_FMT
                          "\n",
                          step, removed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsGetDirectory(Fields o, const char **dir)
{
  PetscFunctionBeginUser;
  *dir = o->dir;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsGetInterval(Fields o, PetscReal *interval)
{
  PetscFunctionBeginUser;
  *interval = o->interval;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsGetEvery(Fields o, PetscInt *every)
{
  PetscFunctionBeginUser;
  *every = o->every;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsGetOverwrite(Fields o, PetscBool *overwrite)
{
  PetscFunctionBeginUser;
  *overwrite = o->overwrite;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsVisitState(void *fields, State state)
{
  Fields     o = fields;
  PetscInt   n = o->nsnap, *number, *size, sized = 1;
  PetscReal *time;

  PetscFunctionBeginUser;
  if (StateIsLoading(state)) PetscCall(StateGetSize(state, "snapshot_time", &n));
  PetscCall(PetscMalloc3(3 * n, &number, 2 * n, &size, n, &time));
  for (PetscInt i = 0; i < o->nsnap; i++) {
    number[3 * i]     = o->snapshot[i].step;
    number[3 * i + 1] = o->snapshot[i].mesh;
    number[3 * i + 2] = o->snapshot[i].body + 2 * o->snapshot[i].conformation + 4 * o->snapshot[i].scalars +
                        8 * o->snapshot[i].phase;
    size[2 * i]     = o->snapshot[i].ncell;
    size[2 * i + 1] = o->snapshot[i].npoint;
    time[i]         = o->snapshot[i].time;
  }
  PetscCall(StateInts(state, "snapshot", 3 * n, number));
  PetscCall(StateReals(state, "snapshot_time", n, time));
  /* -1: of a version whose meshes stayed */
  if (StateIsLoading(state)) PetscCall(StateGetSize(state, "snapshot_size", &sized));
  if (sized >= 0) PetscCall(StateInts(state, "snapshot_size", 2 * n, size));
  PetscCall(StateInts(state, "mesh_step", 1, &o->mesh_step));
  if (StateIsLoading(state)) {
    o->restarted = PETSC_TRUE;
    if (sized < 0) {
      PetscCall(PointsCreate(o->mesh, &o->points));
      PetscCall(PointsDestroy(&o->points)); /* which keeps their number */
    }
    o->nsnap = o->capacity = n;
    PetscCall(PetscRealloc(n * sizeof(Snapshot), &o->snapshot));
    for (PetscInt i = 0; i < n; i++)
      o->snapshot[i] = (Snapshot){number[3 * i],
                                  number[3 * i + 1],
                                  sized < 0 ? o->loc->ncell_global : size[2 * i],
                                  sized < 0 ? o->points.total : size[2 * i + 1],
                                  time[i],
                                  (PetscBool)(number[3 * i + 2] & 1),
                                  PETSC_FALSE,
                                  (PetscBool)((number[3 * i + 2] & 2) != 0),
                                  (PetscBool)((number[3 * i + 2] & 4) != 0),
                                  (PetscBool)((number[3 * i + 2] & 8) != 0)};
    /* a name that no earlier part of the run has used */
    if (!StateIsSamePartition(state) && n) o->mesh_step = o->snapshot[n - 1].step + 1;
  }
  PetscCall(PetscFree3(number, size, time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsMove(Fields o, const PetscReal offset[3])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(o->offset, offset, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsAddScalar(Fields o, const char name[], const PetscReal gradient[])
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(o->nscalar + 1, &o->scalar_capacity, &o->carried, sizeof(*o->carried), NULL));
  o->carried[o->nscalar++] = (struct Carried){name, gradient};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsSetScalars(Fields o, const PetscReal value[])
{
  PetscFunctionBeginUser;
  o->scalar = value;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsSetPhase(Fields o, const PetscInt phase[])
{
  PetscFunctionBeginUser;
  o->phase = phase;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsWrite(Fields o, PetscInt step, PetscReal time, const PetscReal u[], const PetscReal p[],
                           const PetscInt body[], const PetscReal error[], const PetscReal conformation[])
{
  Hdf5      file;
  char      name[64];
  PetscBool same;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_OUTPUT, 0, 0, 0, 0));
  PetscCall(PetscArraycmp(o->offset, o->offset_mesh, 3, &same));
  if (o->loc->moves != o->moves || !same) {
    o->mesh_written = PETSC_FALSE;
    o->mesh_step    = step;
  }
  PetscCall(PointsCreate(o->mesh, &o->points)); /* for this snapshot */
  if (!o->mesh_written) PetscCall(write_mesh(o));
  PetscCall(PetscSNPrintf(name, sizeof(name), "fields_%" PetscInt_FMT ".h5", step));
  PetscCall(open_hdf5(o, name, &file));
  PetscCall(Hdf5WriteReals(file, "time", o->rank == 0, 1, &time));
  PetscCall(write_velocity(o, file, u));
  PetscCall(write_pressure(o, file, p, body));
  if (body) PetscCall(write_nodal_integers(o, file, "body", body));
  if (o->phase) PetscCall(Hdf5WriteInts(file, "phase", o->loc->ncell, 1, o->phase));
  if (error) PetscCall(Hdf5WriteReals(file, "error_indicator", o->loc->ncell, 1, error));
  if (conformation) PetscCall(write_nodal(o, file, "conformation", 6, conformation));
  for (PetscInt i = 0; i < o->nscalar; i++) PetscCall(write_scalar(o, file, i));
  PetscCall(close_hdf5(o, name, &file));
  PetscCall(add_snapshot(o, step, time, (PetscBool)(body != NULL), (PetscBool)(error != NULL),
                         (PetscBool)(conformation != NULL)));
  PetscCall(PointsDestroy(&o->points));
  PetscCall(PetscLogEventEnd(TB_OUTPUT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FieldsDestroy(Fields *fields)
{
  PetscFunctionBeginUser;
  if (!*fields) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PointsDestroy(&(*fields)->points));
  PetscCall(PetscFree((*fields)->snapshot));
  PetscCall(PetscFree((*fields)->carried));
  PetscCall(PetscFree(*fields));
  PetscFunctionReturn(PETSC_SUCCESS);
}
