/* Outlines: see outlines.h. The state is replicated: rank 0 hands over all rows and the others none. */
#include "compat.h"
#include "base/hdf5.h"
#include "report/outlines.h"
#include "base/algebra.h"
#include "files.h"
#include <stdio.h>

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

/* ---- datasets: those of rank 0 ---- */

static PetscErrorCode write_scalars(Outlines b, Hdf5 file)
{
  const BodyState *s = b->s;
  PetscReal       *radius;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(s->n, &radius));
  for (PetscInt k = 0; k < s->n; k++) radius[k] = s->gone[k] ? 0 : BodiesGetGroup(s, k)->radius;
  PetscCall(Hdf5WriteReals(file, "radius", b->rank ? 0 : s->n, 1, radius));
  PetscCall(Hdf5WriteReals(file, "angle", b->rank ? 0 : s->n, 1, s->angle));
  PetscCall(Hdf5WriteInts(file, "group", b->rank ? 0 : s->n, 1, s->body_group));
  PetscCall(PetscFree(radius));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_vectors(Outlines b, Hdf5 file)
{
  const BodyState *s = b->s;

  PetscFunctionBeginUser;
  PetscCall(Hdf5WriteReals(file, "position", b->rank ? 0 : s->n, 3, &s->x[0][0]));
  PetscCall(Hdf5WriteReals(file, "velocity", b->rank ? 0 : s->n, 3, &s->u[0][0]));
  PetscCall(Hdf5WriteReals(file, "angular_velocity", b->rank ? 0 : s->n, 3, &s->w[0][0]));
  PetscCall(Hdf5WriteReals(file, "force", b->rank ? 0 : s->n, 3, &s->force[0][0]));
  PetscCall(Hdf5WriteReals(file, "contact_force", b->rank ? 0 : s->n, 3, &s->contact_force[0][0]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_outlines(Outlines b, Hdf5 file)
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
  PetscCall(Hdf5WriteReals(file, "outline", b->rank ? 0 : m * s->n, 3, x));
  PetscCall(Hdf5WriteInts(file, "line", b->rank ? 0 : s->n, m + 1, line));
  PetscCall(PetscFree2(x, line));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_file(Outlines b, const char path[], PetscReal time)
{
  Hdf5 file;
  char reason[256];

  PetscFunctionBeginUser;
  PetscCall(Hdf5Create(PETSC_COMM_WORLD, path, &file));
  PetscCall(Hdf5WriteReals(file, "time", b->rank ? 0 : 1, 1, &time));
  PetscCall(write_scalars(b, file));
  PetscCall(write_vectors(b, file));
  if (b->npoint) PetscCall(write_outlines(b, file));
  PetscCall(Hdf5Close(&file, reason, sizeof(reason)));
  PetscCheck(!reason[0], PETSC_COMM_WORLD, PETSC_ERR_FILE_WRITE, "Cannot write '%s': %s. Check the disk or choose another -output_dir", path, reason);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- XDMF ---- */

static void print_attributes(FILE *f, PetscInt n, const char centre[], const char file[])
{
  static const char *const names[] = {"velocity", "angular_velocity", "force", "contact_force", "radius", "angle", "group"};

  for (PetscInt i = 0; i < 7; i++) XdmfAttribute(f, (PetscBool)(i == 6), n, i < 4 ? 3 : 1, centre, file, names[i]);
}

static void print_snapshot(FILE *f, Outlines b, PetscInt step, PetscReal time)
{
  const PetscInt n = b->s->n, m = b->npoint;
  char           file[64];

  (void)snprintf(file, sizeof(file), "bodies_%" PetscInt_FMT ".h5", step);
  fprintf(f, "      <Grid Name=\"step %" PetscInt_FMT "\" GridType=\"Collection\" CollectionType=\"Spatial\">\n        <Time Value=\"%.15g\"/>\n",
          step, (double)time);
  fprintf(f,
          "        <Grid Name=\"centres\" GridType=\"Uniform\">\n          <Topology TopologyType=\"Polyvertex\" NumberOfElements=\"%" PetscInt_FMT
          "\"/>\n",
          n);
  fprintf(f, "          <Geometry GeometryType=\"XYZ\">");
  XdmfItem(f, PETSC_FALSE, n, 3, file, "position");
  fprintf(f, "</Geometry>\n");
  print_attributes(f, n, "Node", file);
  fprintf(f, "        </Grid>\n");
  if (m) {
    fprintf(f,
            "        <Grid Name=\"outlines\" GridType=\"Uniform\">\n          <Topology TopologyType=\"Polyline\" NumberOfElements=\"%" PetscInt_FMT
            "\" NodesPerElement=\"%" PetscInt_FMT "\">",
            n, m + 1);
    XdmfItem(f, PETSC_TRUE, n, m + 1, file, "line");
    fprintf(f, "</Topology>\n          <Geometry GeometryType=\"XYZ\">");
    XdmfItem(f, PETSC_FALSE, n * m, 3, file, "outline");
    fprintf(f, "</Geometry>\n");
    print_attributes(f, n, "Cell", file);
    fprintf(f, "        </Grid>\n");
  }
  fprintf(f, "      </Grid>\n");
}

/* Rank 0; returns 0 or errno */
static int write_index(Outlines b, const char path[])
{
  FILE *f;
  int   err = XdmfBegin(path, "bodies", &f);

  if (err) return err;
  for (PetscInt i = 0; i < b->nsnap; i++) print_snapshot(f, b, b->step[i], b->time[i]);
  return XdmfEnd(path, &f);
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

  PetscFunctionBeginUser;
  if (!b->s->n) PetscFunctionReturn(PETSC_SUCCESS);
  while (b->nsnap && b->step[b->nsnap - 1] >= step) b->nsnap--;
  PetscCall(make_room(b, b->nsnap + 1));
  b->step[b->nsnap]   = step;
  b->time[b->nsnap++] = time;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/bodies_%" PetscInt_FMT ".h5", dir, step));
  PetscCall(write_file(b, path, time));
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/bodies.xmf", dir));
  PetscCall(FileCheck(b->rank ? 0 : write_index(b, path), path));
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
