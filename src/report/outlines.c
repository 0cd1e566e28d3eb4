/* Bodyfile: see outlines.h. The state is replicated, so rank 0 hands all rows to PETSc's parallel HDF5 viewer and the others none. */
#include "compat.h"
#include "base/hdf5.h"
#include "report/outlines.h"
#include "base/rotation.h"
#include <errno.h>
#include <stdio.h>
#include <string.h>

#define POINTS      48 /* of an outline */
#define POINTS_MANY 16 /* beyond MANY bodies */
#define MANY        2000

struct _p_Outlines {
  Bodies      bodies;
  BodyState  *s;
  PetscMPIInt rank;
  PetscInt    npoint; /* of an outline; 0 in 3D */
  PetscReal **shape;  /* [ngroups][npoint][2] about the centre, body axes */
  PetscInt    nsnap, room;
  PetscInt   *step; /* [nsnap] */
  PetscReal  *time; /* [nsnap] */
};

/* ---- datasets ---- */

/* v [n][bs] of rank 0 */
static PetscErrorCode write_reals(Outlines b, PetscViewer viewer, const char name[], PetscInt n, PetscInt bs, const PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(Hdf5WriteReals(PETSC_COMM_WORLD, viewer, name, b->rank ? 0 : n, bs, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_integers(Outlines b, PetscViewer viewer, const char name[], PetscInt n, PetscInt bs, const PetscInt v[])
{
  PetscFunctionBeginUser;
  PetscCall(Hdf5WriteInts(PETSC_COMM_WORLD, viewer, name, b->rank ? 0 : n, bs, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_scalars(Outlines b, PetscViewer viewer)
{
  const BodyState *s = b->s;
  PetscReal       *radius;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(s->n, &radius));
  for (PetscInt k = 0; k < s->n; k++) radius[k] = s->gone[k] ? 0 : BodiesGetGroup(s, k)->radius;
  PetscCall(write_reals(b, viewer, "radius", s->n, 1, radius));
  PetscCall(write_reals(b, viewer, "angle", s->n, 1, s->angle));
  PetscCall(write_integers(b, viewer, "group", s->n, 1, s->body_group));
  PetscCall(PetscFree(radius));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_vectors(Outlines b, PetscViewer viewer)
{
  const BodyState *s = b->s;

  PetscFunctionBeginUser;
  PetscCall(write_reals(b, viewer, "position", s->n, 3, &s->x[0][0]));
  PetscCall(write_reals(b, viewer, "velocity", s->n, 3, &s->u[0][0]));
  PetscCall(write_reals(b, viewer, "angular_velocity", s->n, 3, &s->w[0][0]));
  PetscCall(write_reals(b, viewer, "force", s->n, 3, &s->force[0][0]));
  PetscCall(write_reals(b, viewer, "contact_force", s->n, 3, &s->contact_force[0][0]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_outlines(Outlines b, PetscViewer viewer)
{
  const BodyState *s = b->s;
  const PetscInt   m = b->npoint;
  PetscReal       *x;
  PetscInt        *line;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(3 * m * s->n, &x, (m + 1) * s->n, &line));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal *p = b->shape[s->body_group[k]];
    PetscReal        R[9];

    RotationMatrix(s->q[k], R);
    for (PetscInt i = 0; i < m; i++) {
      PetscReal *y = x + 3 * (m * k + i);

      for (PetscInt a = 0; a < 2; a++) y[a] = s->x[k][a] + (s->gone[k] ? 0 : R[3 * a] * p[2 * i] + R[3 * a + 1] * p[2 * i + 1]);
      y[2] = 0;
    }
    for (PetscInt i = 0; i <= m; i++) line[(m + 1) * k + i] = m * k + i % m;
  }
  PetscCall(write_reals(b, viewer, "outline", m * s->n, 3, x));
  PetscCall(write_integers(b, viewer, "line", s->n, m + 1, line));
  PetscCall(PetscFree2(x, line));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_file(Outlines b, const char path[], PetscReal time)
{
  PetscViewer viewer;

  PetscFunctionBeginUser;
  PetscCall(PetscViewerCreate(PETSC_COMM_WORLD, &viewer));
  PetscCall(PetscViewerSetType(viewer, PETSCVIEWERHDF5));
  PetscCall(PetscViewerFileSetMode(viewer, FILE_MODE_WRITE));
  PetscCall(PetscViewerFileSetName(viewer, path));
  PetscCall(write_reals(b, viewer, "time", 1, 1, &time));
  PetscCall(write_scalars(b, viewer));
  PetscCall(write_vectors(b, viewer));
  if (b->npoint) PetscCall(write_outlines(b, viewer));
  PetscCall(PetscViewerDestroy(&viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- XDMF ---- */

static void print_item(FILE *f, PetscBool integer, PetscInt n, PetscInt bs, PetscInt step, const char name[])
{
  fprintf(f, "<DataItem Format=\"HDF\" NumberType=\"%s\" Precision=\"%d\" Dimensions=\"%" PetscInt_FMT, integer ? "Int" : "Float",
          (int)(integer ? sizeof(PetscInt) : sizeof(PetscReal)), n);
  if (bs > 1) fprintf(f, " %" PetscInt_FMT, bs);
  fprintf(f, "\">bodies_%" PetscInt_FMT ".h5:/%s</DataItem>", step, name);
}

static void print_attributes(FILE *f, PetscInt n, PetscInt step, const char centre[])
{
  static const char *const names[] = {"velocity", "angular_velocity", "force", "contact_force", "radius", "angle", "group"};

  for (PetscInt i = 0; i < 7; i++) {
    fprintf(f, "          <Attribute Name=\"%s\" AttributeType=\"%s\" Center=\"%s\">", names[i], i < 4 ? "Vector" : "Scalar", centre);
    print_item(f, (PetscBool)(i == 6), n, i < 4 ? 3 : 1, step, names[i]);
    fprintf(f, "</Attribute>\n");
  }
}

static void print_snapshot(FILE *f, Outlines b, PetscInt step, PetscReal time)
{
  const PetscInt n = b->s->n, m = b->npoint;

  fprintf(f, "      <Grid Name=\"step %" PetscInt_FMT "\" GridType=\"Collection\" CollectionType=\"Spatial\">\n        <Time Value=\"%.15g\"/>\n",
          step, (double)time);
  fprintf(f,
          "        <Grid Name=\"centres\" GridType=\"Uniform\">\n          <Topology TopologyType=\"Polyvertex\" NumberOfElements=\"%" PetscInt_FMT
          "\"/>\n",
          n);
  fprintf(f, "          <Geometry GeometryType=\"XYZ\">");
  print_item(f, PETSC_FALSE, n, 3, step, "position");
  fprintf(f, "</Geometry>\n");
  print_attributes(f, n, step, "Node");
  fprintf(f, "        </Grid>\n");
  if (m) {
    fprintf(f,
            "        <Grid Name=\"outlines\" GridType=\"Uniform\">\n          <Topology TopologyType=\"Polyline\" NumberOfElements=\"%" PetscInt_FMT
            "\" NodesPerElement=\"%" PetscInt_FMT "\">",
            n, m + 1);
    print_item(f, PETSC_TRUE, n, m + 1, step, "line");
    fprintf(f, "</Topology>\n          <Geometry GeometryType=\"XYZ\">");
    print_item(f, PETSC_FALSE, n * m, 3, step, "outline");
    fprintf(f, "</Geometry>\n");
    print_attributes(f, n, step, "Cell");
    fprintf(f, "        </Grid>\n");
  }
  fprintf(f, "      </Grid>\n");
}

/* Rank 0; returns 0 or errno. Written beside and renamed: a reader never meets half a file. */
static int write_index(Outlines b, const char dir[])
{
  char  path[PETSC_MAX_PATH_LEN], scratch[PETSC_MAX_PATH_LEN];
  FILE *f;

  snprintf(path, sizeof(path), "%s/bodies.xmf", dir);
  snprintf(scratch, sizeof(scratch), "%s/bodies.xmf.part", dir);
  f = fopen(scratch, "w");
  if (!f) return errno;
  fprintf(f, "<?xml version=\"1.0\" ?>\n<!DOCTYPE Xdmf SYSTEM \"Xdmf.dtd\" []>\n<Xdmf Version=\"2.0\">\n  <Domain>\n");
  fprintf(f, "    <Grid Name=\"bodies\" GridType=\"Collection\" CollectionType=\"Temporal\">\n");
  for (PetscInt i = 0; i < b->nsnap; i++) print_snapshot(f, b, b->step[i], b->time[i]);
  fprintf(f, "    </Grid>\n  </Domain>\n</Xdmf>\n");
  const PetscBool bad = (PetscBool)(ferror(f) != 0);
  if (fclose(f) || bad) return errno ? errno : EIO;
  return rename(scratch, path) ? errno : 0;
}

/* ---- public ---- */

PetscErrorCode OutlinesCreate(Bodies bodies, Outlines *file)
{
  Outlines   b;
  PetscReal *weight;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->bodies = bodies;
  PetscCall(BodiesGetState(bodies, &b->s));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &b->rank));
  b->npoint = b->s->dim == 3 ? 0 : b->s->n > MANY ? POINTS_MANY : POINTS;
  PetscCall(PetscCalloc1(b->s->ngroups, &b->shape));
  PetscCall(PetscMalloc1(b->npoint, &weight));
  for (PetscInt g = 0; g < b->s->ngroups && b->npoint; g++) {
    const BodyGroup *group = &b->s->group[g];

    PetscCall(PetscMalloc1(2 * b->npoint, &b->shape[g]));
    PetscCall(ShapeSurface(group->shape, b->npoint, b->shape[g], weight));
    for (PetscInt i = 0; i < 2 * b->npoint; i++) b->shape[g][i] -= group->mass.centroid[i % 2];
  }
  PetscCall(PetscFree(weight));
  *file = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OutlinesDestroy(Outlines *file)
{
  Outlines b = *file;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt g = 0; g < b->s->ngroups; g++) PetscCall(PetscFree(b->shape[g]));
  PetscCall(PetscFree(b->shape));
  PetscCall(PetscFree(b->step));
  PetscCall(PetscFree(b->time));
  PetscCall(PetscFree(*file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_room(Outlines b, PetscInt n)
{
  PetscFunctionBeginUser;
  if (n <= b->room) PetscFunctionReturn(PETSC_SUCCESS);
  b->room = 2 * n + 16;
  PetscCall(PetscRealloc(b->room * sizeof(PetscInt), &b->step));
  PetscCall(PetscRealloc(b->room * sizeof(PetscReal), &b->time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OutlinesWrite(Outlines b, const char dir[], PetscInt step, PetscReal time)
{
  char path[PETSC_MAX_PATH_LEN];
  int  err = 0;

  PetscFunctionBeginUser;
  if (!b->s->n) PetscFunctionReturn(PETSC_SUCCESS);
  while (b->nsnap && b->step[b->nsnap - 1] >= step) b->nsnap--;
  PetscCall(make_room(b, b->nsnap + 1));
  b->step[b->nsnap]   = step;
  b->time[b->nsnap++] = time;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/bodies_%" PetscInt_FMT ".h5", dir, step));
  PetscCall(write_file(b, path, time));
  if (!b->rank) err = write_index(b, dir);
  PetscCallMPI(MPI_Bcast(&err, 1, MPI_INT, 0, PETSC_COMM_WORLD));
  PetscCheck(!err, PETSC_COMM_WORLD, PETSC_ERR_FILE_WRITE, "Cannot write '%s/bodies.xmf': %s. Check the disk or choose another -output_dir", dir,
             strerror(err));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OutlinesVisitState(void *file, State state)
{
  Outlines b = file;

  PetscFunctionBeginUser;
  if (StateIsLoading(state)) {
    PetscCall(StateGetSize(state, "snapshot_time", &b->nsnap));
    b->nsnap = PetscMax(b->nsnap, 0);
    PetscCall(make_room(b, b->nsnap));
  }
  if (!b->nsnap) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(StateInts(state, "snapshot_step", b->nsnap, b->step));
  PetscCall(StateReals(state, "snapshot_time", b->nsnap, b->time));
  PetscFunctionReturn(PETSC_SUCCESS);
}
