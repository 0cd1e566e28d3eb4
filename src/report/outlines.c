/* Outlines: see outlines.h. Bodies are written and drawn in the order of their numbers, in even shares of the ranks;
   where all ranks know all, by rank 0. */
#include "compat.h"
#include "base/hdf5.h"
#include "report/outlines.h"
#include "base/algebra.h"
#include "base/array.h"
#include "bodies/local.h"
#include "files.h"
#include "snapshots.h"
#include <stdio.h>
#include <unistd.h>

#define MANY 2000 /* bodies: with more, pictures are coarser */
/* how far an outline may be off, in bounding radii */
#define TOLERANCE      1e-3
#define TOLERANCE_MANY 2e-2
#define TRIANGLES      400000 /* of all bodies */
#define TRIANGLES_BODY 4000

/* What is drawn of a group: about the centre, body axes */
typedef struct {
  PetscInt   n, ncell; /* points; 2D: 1 line, 3D: triangles */
  PetscReal *x;        /* [n][dim] */
  PetscInt  *cell;     /* 3D: [ncell][3] */
} Picture;

/* Counts of a snapshot */
enum {
  NPOINT,
  NCELL,
  NLINE, /* points of a line, 0 in 3D */
  NCOUNTS
};

struct _p_Outlines {
  MPI_Comm         comm;
  Bodies           bodies;
  BodyState       *s;
  PetscMPIInt      rank;
  PetscReal        lower[3], upper[3], period[3];
  Picture         *picture; /* [ngroups]; in 2D all have as many points */
  Snapshots        list;
  const PetscReal *aggregate;  /* [n] of the snapshot that is being written, NULL: none */
  PetscBool        aggregates; /* snapshots have them */
};

/* What is known of a body to draw it */
typedef struct {
  PetscReal x[3], q[4], velocity[2][3], scale, radius, group, aggregate; /* radius 0: has left */
} Drawn;

/* What this rank draws in a snapshot: every body of its rows with its images across the period */
typedef struct {
  PetscInt  n, capacity, npoint, ncell;
  BodyRows  rows;
  Drawn    *drawn; /* [rows.n] */
  PetscInt *body;  /* [n] row */
  PetscReal (*shift)[3];
} Scene;

/* ---- images ---- */

static PetscErrorCode gather_drawn(Outlines b, Scene *d)
{
  const BodyState *s = b->s;
  Drawn           *last;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(s->n, &last));
  PetscCall(PetscMalloc1(d->rows.n, &d->drawn));
  for (PetscInt k = 0; k < s->n; k++) {
    last[k] = (Drawn){.scale  = s->scale[k],
                      .radius = s->removed[k] ? 0 : BodiesGetRadius(s, k),
                      .group  = s->body_group[k]};
    if (b->aggregate) last[k].aggregate = b->aggregate[k];
    PetscCall(PetscArraycpy(last[k].q, s->q[k], 4));
    for (PetscInt a = 0; a < 3; a++) {
      last[k].x[a]           = s->x[k][a];
      last[k].velocity[0][a] = s->u[k][a];
      last[k].velocity[1][a] = s->w[k][a];
    }
  }
  PetscCall(BodiesGatherRows(b->bodies, &d->rows, sizeof(Drawn), last, d->drawn));
  PetscCall(PetscFree(last));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode list_images(Outlines b, Scene *d)
{
  const PetscInt nimage = b->s->dim == 2 ? 9 : 27;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < d->rows.n; k++) {
    const Drawn *body = d->drawn + k;

    for (PetscInt i = 0, found = 0; i < nimage && found < 8; i++) {
      const PetscInt middle = b->s->dim == 2 ? 4 : 13, which = i ? i - (i <= middle) : middle; /* itself first */
      const PetscInt digit[3] = {which % 3 - 1, which / 3 % 3 - 1, b->s->dim == 2 ? 0 : which / 9 - 1};
      PetscBool      seen     = (PetscBool)(!i || body->radius > 0);

      PetscCall(ArrayReserve(d->n + 1, &d->capacity, &d->body, sizeof(*d->body), &d->shift, sizeof(*d->shift), NULL));
      for (PetscInt a = 0; a < 3; a++) {
        const PetscReal x = body->x[a] + digit[a] * b->period[a];

        d->shift[d->n][a] = digit[a] * b->period[a];
        if (digit[a] && (b->period[a] <= 0 || x + body->radius < b->lower[a] || x - body->radius > b->upper[a]))
          seen = PETSC_FALSE;
      }
      if (!seen) continue;
      d->body[d->n++] = k;
      found++;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What a body of a picture has: its cells, or one line */
static const Picture *get_picture(Outlines b, const Scene *d, PetscInt i)
{
  return b->picture + (PetscInt)d->drawn[d->body[i]].group;
}

static PetscErrorCode begin_scene(Outlines b, Scene *d)
{
  PetscFunctionBeginUser;
  PetscCall(BodiesBeginRows(b->bodies, &d->rows));
  PetscCall(gather_drawn(b, d));
  PetscCall(list_images(b, d));
  for (PetscInt i = 0; i < d->n; i++) {
    d->npoint += get_picture(b, d, i)->n;
    d->ncell += get_picture(b, d, i)->ncell;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- datasets: those of rank 0 ---- */

/* A number or vector of each body */
typedef struct {
  const char      *name;
  PetscInt         bs;
  const PetscReal *value;
} Field;

#define NFIELDS 7
static void list_fields(const BodyState *s, const PetscReal radius[], Field f[NFIELDS])
{
  const Field all[NFIELDS] = {{"velocity", 3, &s->u[0][0]},    {"angular_velocity", 3, &s->w[0][0]},
                              {"force", 3, &s->force[0][0]},   {"contact_force", 3, &s->contact_force[0][0]},
                              {"orientation", 4, &s->q[0][0]}, {"radius", 1, radius},
                              {"angle", 1, s->angle}};

  for (PetscInt i = 0; i < NFIELDS; i++) f[i] = all[i];
}

/* v [known][bs] of all bodies, in the order of their numbers */
static PetscErrorCode write_rows(Outlines b, const BodyRows *rows, Hdf5 file, const char name[], PetscInt bs,
                                 const PetscReal v[])
{
  PetscReal *row;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(rows->n * bs, &row));
  PetscCall(BodiesGatherRows(b->bodies, rows, bs * sizeof(*row), v, row));
  PetscCall(Hdf5WriteReals(file, name, rows->n, bs, row));
  PetscCall(PetscFree(row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_groups(Outlines b, const Scene *d, Hdf5 file)
{
  const BodyRows *rows = &d->rows;
  PetscInt       *number;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(rows->n, &number));
  for (PetscInt i = 0; i < rows->n; i++) number[i] = (PetscInt)d->drawn[i].group;
  PetscCall(Hdf5WriteInts(file, "group", rows->n, 1, number));
  for (PetscInt i = 0; i < rows->n; i++) number[i] = (PetscInt)d->drawn[i].aggregate;
  if (b->aggregates) PetscCall(Hdf5WriteInts(file, "aggregate", rows->n, 1, number));
  for (PetscInt i = 0; i < rows->n; i++) number[i] = rows->start + i;
  PetscCall(Hdf5WriteInts(file, "body", rows->n, 1, number));
  PetscCall(PetscFree(number));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_bodies(Outlines b, Hdf5 file, const Scene *d, const Field f[NFIELDS])
{
  const BodyState *s    = b->s;
  const BodyRows  *rows = &d->rows;
  PetscReal(*x)[3];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(s->n, &x));
  for (PetscInt i = 0; i < 3 * s->n; i++) x[i / 3][i % 3] = s->x[i / 3][i % 3] + s->frame[i % 3];
  PetscCall(write_rows(b, rows, file, "position", 3, &x[0][0]));
  PetscCall(PetscFree(x));
  for (PetscInt i = 0; i < NFIELDS; i++) PetscCall(write_rows(b, rows, file, f[i].name, f[i].bs, f[i].value));
  PetscCall(write_groups(b, d, file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Points of what is drawn, in space; a body that has left shrinks to its centre */
static PetscErrorCode write_points(Outlines b, Hdf5 file, const Scene *d, const char name[])
{
  const PetscInt dim = b->s->dim;
  PetscReal     *x, *y;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(3 * d->npoint, &x));
  y = x;
  for (PetscInt i = 0; i < d->n; i++) {
    const Drawn   *body = d->drawn + d->body[i];
    const Picture *p    = get_picture(b, d, i);
    PetscReal      R[9];

    RotationMatrix(body->q, R);
    for (PetscInt j = 0; j < p->n; j++, y += 3) {
      for (PetscInt a = 0; a < 3; a++) {
        y[a] = body->x[a] + b->s->frame[a] + d->shift[i][a];
        for (PetscInt e = 0; e < dim && a < dim && body->radius > 0; e++)
          y[a] += body->scale * R[3 * a + e] * p->x[j * dim + e];
      }
    }
  }
  PetscCall(Hdf5WriteReals(file, name, d->npoint, 3, x));
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Lines that close, or triangles */
static PetscErrorCode write_cells(Outlines b, Hdf5 file, const Scene *d, PetscInt bs)
{
  PetscInt *cell, *c, first = 0;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Exscan(&d->npoint, &first, 1, MPIU_INT, MPI_SUM, b->comm));
  PetscCall(PetscMalloc1(d->ncell * bs, &cell));
  c = cell;
  for (PetscInt i = 0; i < d->n; i++) {
    const Picture *p = get_picture(b, d, i);

    for (PetscInt j = 0; j < p->ncell * bs; j++) *c++ = first + (p->cell ? p->cell[j] : j % p->n);
    first += p->n;
  }
  PetscCall(Hdf5WriteInts(file, b->s->dim == 2 ? "line" : "triangle", d->ncell, bs, cell));
  PetscCall(PetscFree(cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Which body a line or triangle belongs to, and what this body has */
static PetscErrorCode write_cell_fields(Outlines b, Hdf5 file, const Scene *d)
{
  static const char *const name[] = {"cell_velocity", "cell_angular_velocity"};
  PetscInt                *body, *number, n = 0;
  PetscReal(*value)[3];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(d->ncell, &body, d->ncell, &number, d->ncell, &value));
  for (PetscInt i = 0; i < d->n; i++)
    for (PetscInt j = 0; j < get_picture(b, d, i)->ncell; j++) body[n++] = d->body[i];
  for (PetscInt j = 0; j < n; j++) number[j] = d->rows.start + body[j];
  PetscCall(Hdf5WriteInts(file, "cell_body", n, 1, number));
  for (PetscInt i = 0; i < 2; i++) {
    for (PetscInt j = 0; j < n; j++) PetscCall(PetscArraycpy(value[j], d->drawn[body[j]].velocity[i], 3));
    PetscCall(Hdf5WriteReals(file, name[i], n, 3, &value[0][0]));
  }
  for (PetscInt j = 0; j < n; j++) number[j] = (PetscInt)d->drawn[body[j]].group;
  PetscCall(Hdf5WriteInts(file, "cell_group", n, 1, number));
  for (PetscInt j = 0; j < n; j++) number[j] = (PetscInt)d->drawn[body[j]].aggregate;
  if (b->aggregates) PetscCall(Hdf5WriteInts(file, "cell_aggregate", n, 1, number));
  PetscCall(PetscFree3(body, number, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* All of a snapshot; tells what is drawn */
static PetscErrorCode write_file(Outlines b, const char path[], Snapshot *snapshot)
{
  const BodyState *s = b->s;
  Scene            d = {0};
  Hdf5             file;
  Field            f[NFIELDS];
  PetscReal       *radius;

  PetscFunctionBeginUser;
  PetscCall(begin_scene(b, &d));
  PetscCallMPI(MPI_Allreduce(&d.npoint, &snapshot->count[NPOINT], 1, MPIU_INT, MPI_SUM, b->comm));
  PetscCallMPI(MPI_Allreduce(&d.ncell, &snapshot->count[NCELL], 1, MPIU_INT, MPI_SUM, b->comm));
  snapshot->count[NLINE] = s->dim == 2 ? b->picture[0].n + 1 : 0;
  PetscCall(PetscMalloc1(s->n, &radius));
  for (PetscInt k = 0; k < s->n; k++) radius[k] = s->removed[k] ? 0 : BodiesGetRadius(s, k);
  list_fields(s, radius, f);
  PetscCall(Hdf5Create(b->comm, path, &file));
  PetscCall(Hdf5WriteReals(file, "time", b->rank ? 0 : 1, 1, &snapshot->time));
  PetscCall(write_bodies(b, file, &d, f));
  PetscCall(write_points(b, file, &d, s->dim == 2 ? "outline" : "surface"));
  PetscCall(write_cells(b, file, &d, s->dim == 2 ? snapshot->count[NLINE] : 3));
  PetscCall(write_cell_fields(b, file, &d));
  PetscCall(PetscFree(radius));
  PetscCall(BodiesEndRows(&d.rows));
  PetscCall(PetscFree(d.drawn));
  PetscCall(PetscFree(d.body));
  PetscCall(PetscFree(d.shift));
  PetscCall(FileCloseHdf5(b->comm, path, &file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- XDMF ---- */

static void print_grid(FILE *f, const Snapshot *s, const char topology[], PetscInt n, PetscInt nodes, const char file[],
                       const char cells[])
{
  fprintf(f, "      <Grid Name=\"step %" PetscInt_FMT "\" GridType=\"Uniform\">\n        <Time Value=\"%.15g\"/>\n",
          s->step, (double)s->time);
  fprintf(f,
          "        <Topology TopologyType=\"%s\" NumberOfElements=\"%" PetscInt_FMT
          "\" NodesPerElement=\"%" PetscInt_FMT "\">",
          topology, n, nodes);
  XdmfItem(f, PETSC_TRUE, n, nodes, file, cells);
  fprintf(f, "</Topology>\n        <Geometry GeometryType=\"XYZ\">");
}

/* What is drawn: lines or triangles */
static void print_drawn(FILE *f, const Snapshot *s, PetscBool aggregates, const char file[])
{
  const PetscInt ncell = s->count[NCELL], nline = s->count[NLINE];

  print_grid(f, s, nline ? "Polyline" : "Triangle", ncell, nline ? nline : 3, file, nline ? "line" : "triangle");
  XdmfItem(f, PETSC_FALSE, s->count[NPOINT], 3, file, nline ? "outline" : "surface");
  fprintf(f, "</Geometry>\n");
  XdmfAttribute(f, PETSC_FALSE, ncell, 3, "Cell", "velocity", file, "cell_velocity");
  XdmfAttribute(f, PETSC_FALSE, ncell, 3, "Cell", "angular_velocity", file, "cell_angular_velocity");
  XdmfAttribute(f, PETSC_TRUE, ncell, 1, "Cell", "body", file, "cell_body");
  XdmfAttribute(f, PETSC_TRUE, ncell, 1, "Cell", "group", file, "cell_group");
  if (aggregates) XdmfAttribute(f, PETSC_TRUE, ncell, 1, "Cell", "aggregate", file, "cell_aggregate");
  fprintf(f, "      </Grid>\n");
}

static void print_centres(FILE *f, const Snapshot *s, PetscInt n, PetscBool aggregates, const char file[])
{
  static const char *const names[] = {"velocity", "angular_velocity",
                                      "force",    "contact_force",
                                      "radius",   "angle",
                                      "group",    "body",
                                      "aggregate"};

  print_grid(f, s, "Polyvertex", n, 1, file, "body");
  XdmfItem(f, PETSC_FALSE, n, 3, file, "position");
  fprintf(f, "</Geometry>\n");
  for (PetscInt i = 0; i < (aggregates ? 9 : 8); i++)
    XdmfAttribute(f, (PetscBool)(i > 5), n, i < 4 ? 3 : 1, "Node", names[i], file, names[i]);
  fprintf(f, "      </Grid>\n");
}

/* Rank 0; returns 0 or errno */
static int write_index(Outlines b, const char path[], PetscBool drawn)
{
  const char *name = drawn ? "bodies" : "centres";
  FILE       *f;
  char        file[64];
  int         err = XdmfBegin(path, name, &f);

  if (err) return err;
  for (PetscInt i = 0; i < b->list.n; i++) {
    const Snapshot *s = b->list.snapshot + i;

    (void)snprintf(file, sizeof(file), "bodies_%" PetscInt_FMT ".h5", s->step);
    if (drawn) print_drawn(f, s, b->aggregates, file);
    else print_centres(f, s, b->s->nall, b->aggregates, file);
  }
  return XdmfEnd(path, name, &f);
}

/* ---- public ---- */

/* All outlines get as many points as the one that needs most: the longest pieces are halved */
static PetscErrorCode fill_outline(Picture *p, PetscInt n)
{
  PetscReal *x;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(2 * n, &x));
  PetscCall(PetscArraycpy(x, p->x, 2 * p->n));
  for (; p->n < n; p->n++) {
    PetscReal far = -1, middle[2] = {0};
    PetscInt  at = 0;

    for (PetscInt i = 0; i < p->n; i++) {
      const PetscReal *a = x + 2 * i, *c = x + 2 * ((i + 1) % p->n), d2 = PetscSqr(a[0] - c[0]) + PetscSqr(a[1] - c[1]);

      if (d2 <= far) continue;
      far       = d2;
      at        = i;
      middle[0] = 0.5 * (a[0] + c[0]);
      middle[1] = 0.5 * (a[1] + c[1]);
    }
    for (PetscInt i = p->n; i > at + 1; i--) PetscCall(PetscArraycpy(x + 2 * i, x + 2 * (i - 1), 2));
    PetscCall(PetscArraycpy(x + 2 * (at + 1), middle, 2));
  }
  PetscCall(PetscFree(p->x));
  p->x = x;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode draw_groups(Outlines b)
{
  const BodyState *s             = b->s;
  const PetscInt   triangles_max = PetscMin(TRIANGLES_BODY, TRIANGLES / PetscMax(1, s->nall));
  PetscInt         n             = 0;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->ngroups; g++) {
    const BodyGroup *group = &s->group[g];
    Picture         *p     = b->picture + g;

    p->ncell = 1;
    if (s->dim == 2) PetscCall(ShapeOutline(group->shape, s->nall > MANY ? TOLERANCE_MANY : TOLERANCE, &p->n, &p->x));
    else PetscCall(ShapeTriangulate(group->shape, triangles_max, &p->n, &p->x, &p->ncell, &p->cell));
    for (PetscInt i = 0; i < s->dim * p->n; i++) p->x[i] -= group->mass.centroid[i % s->dim];
    n = PetscMax(n, p->n);
  }
  for (PetscInt g = 0; g < s->ngroups && s->dim == 2; g++) PetscCall(fill_outline(b->picture + g, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OutlinesCreate(MPI_Comm comm, Bodies bodies, const PetscReal lower[], const PetscReal upper[],
                              const PetscReal period[], Outlines *file)
{
  Outlines b;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->comm        = comm;
  b->bodies      = bodies;
  b->list.counts = NCOUNTS;
  PetscCall(BodiesGetState(bodies, &b->s));
  PetscCallMPI(MPI_Comm_rank(b->comm, &b->rank));
  for (PetscInt a = 0; a < 3; a++) {
    b->lower[a]  = lower[a];
    b->upper[a]  = upper[a];
    b->period[a] = period[a];
  }
  *file = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OutlinesDestroy(Outlines *file)
{
  Outlines b = *file;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt g = 0; g < b->s->ngroups && b->picture; g++) {
    PetscCall(PetscFree(b->picture[g].x));
    PetscCall(PetscFree(b->picture[g].cell));
  }
  PetscCall(PetscFree(b->picture));
  PetscCall(PetscFree(b->list.snapshot));
  PetscCall(PetscFree(*file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode write_indices(Outlines b, const char dir[])
{
  static const char *const index[] = {"centres", "bodies"};
  char                     path[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s" XDMF_ENDING, dir, index[i]));
    if (!b->list.n && !b->rank) XdmfRemove(dir, index[i]);
    PetscCall(FileCheck(b->comm, b->rank || !b->list.n ? 0 : write_index(b, path, (PetscBool)i), path));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

void OutlinesAddAggregates(Outlines b)
{
  b->aggregates = PETSC_TRUE;
}

PetscErrorCode OutlinesRewind(Outlines b, const char dir[])
{
  PetscBool there;

  PetscFunctionBeginUser;
  PetscCall(SnapshotsFindIndex(&b->list, b->comm, dir, "bodies", &there));
  if (there) PetscCall(write_indices(b, dir));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OutlinesWrite(Outlines b, const char dir[], PetscInt step, PetscReal time, const PetscReal aggregate[])
{
  Snapshot snapshot = {.step = step, .time = time};
  char     path[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  if (!b->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  if (!b->picture) { /* not before the first snapshot: many runs write none */
    PetscCall(PetscCalloc1(b->s->ngroups, &b->picture));
    PetscCall(draw_groups(b));
  }
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/bodies_%" PetscInt_FMT ".h5", dir, step));
  b->aggregate = aggregate;
  PetscCall(write_file(b, path, &snapshot));
  b->aggregate = NULL;
  SnapshotsCut(&b->list, step);
  PetscCall(SnapshotsAdd(&b->list, &snapshot));
  PetscCall(write_indices(b, dir));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OutlinesVisitState(void *file, State state)
{
  PetscFunctionBeginUser;
  PetscCall(SnapshotsVisitState(&((Outlines)file)->list, state));
  PetscFunctionReturn(PETSC_SUCCESS);
}
