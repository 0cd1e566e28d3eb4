/* Statistics: see statistics.h. Planes are told apart by the places of nodes before any of them moved. All ranks hold
   all planes; their sums are the same on any number of ranks up to round-off. */
#include "compat.h"
#include "report/statistics.h"
#include "base/opt.h"
#include "files.h"
#include "probes.h"

#define ALIKE 1e-8 /* of the extent: places of one plane */

/* Sums of a plane */
enum {
  U,
  UU = 3,
  UV = 6,
  NU = 9,
  NSUMS
};

const MonitorColumn STATISTICS[] = {{"position", "length", 12, "of a plane of nodes along -output_statistics"},
                                    {"u", "length/time", 12, "mean velocity, over the plane and in time"},
                                    {"v", "length/time", 12, ""},
                                    {"w", "length/time", 12, ""},
                                    {"uu", "length^2/time^2", 12, "Reynolds stress: variance"},
                                    {"vv", "length^2/time^2", 12, ""},
                                    {"ww", "length^2/time^2", 12, ""},
                                    {"uv", "length^2/time^2", 12, "Reynolds stress: covariance"},
                                    {"uw", "length^2/time^2", 12, ""},
                                    {"vw", "length^2/time^2", 12, ""},
                                    {"eddy_viscosity", "length^2/time", 12,
                                     "mean of the eddy viscosity over density, 0 without large-eddy simulation"},
                                    {NULL, NULL, 0, NULL}};

struct _p_Statistics {
  MPI_Comm    comm;
  Flow        flow;
  Monitor     monitor;
  Probes      probes;
  PetscInt    axis, n;                           /* planes; 0: no averages are wanted */
  PetscReal   from, time, *position, *sum, *now; /* time averaged over; [n], [n][NSUMS], [n][NSUMS + 1] scratch */
  PetscInt    meshes, *plane;                    /* [nnode] of own nodes, on the mesh that was made as this one */
  PetscReal  *nu;
  PetscInt    ends; /* of the axis: are they walls? bit 0, bit 1 */
  PetscMPIInt rank;
};

/* ---- planes ---- */

static void remove_duplicates(PetscReal tolerance, PetscInt *n, PetscReal x[])
{
  PetscInt m = 0;

  for (PetscInt i = 0; i < *n; i++)
    if (!m || x[i] > x[m - 1] + tolerance) x[m++] = x[i];
  *n = m;
}

static PetscErrorCode find_planes(Statistics s)
{
  const MeshLocal *l;
  PetscMPIInt      size, mine, *count, *start;
  PetscInt         n, total;
  PetscReal       *x, extent;
  Mesh             mesh;

  PetscFunctionBeginUser;
  PetscCall(FlowGetMesh(s->flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &l));
  extent = l->upper[s->axis] - l->lower[s->axis];
  PetscCallMPI(MPI_Comm_size(s->comm, &size));
  PetscCall(PetscMalloc3(size, &count, size, &start, l->nnode, &x));
  for (PetscInt i = 0; i < l->nnode; i++) x[i] = l->x_start[i * l->dim + s->axis];
  n = l->nnode;
  PetscCall(PetscSortReal(n, x));
  remove_duplicates(0.5 * ALIKE * extent, &n, x);
  PetscCall(PetscMPIIntCast(n, &mine));
  PetscCallMPI(MPI_Allgather(&mine, 1, MPI_INT, count, 1, MPI_INT, s->comm));
  start[0] = 0;
  for (PetscMPIInt r = 1; r < size; r++) start[r] = start[r - 1] + count[r - 1];
  total = start[size - 1] + count[size - 1];
  PetscCall(PetscFree(s->position));
  PetscCall(PetscMalloc1(total, &s->position));
  PetscCallMPI(MPI_Allgatherv(x, mine, MPIU_REAL, s->position, count, start, MPIU_REAL, s->comm));
  PetscCall(PetscFree3(count, start, x));
  PetscCall(PetscSortReal(total, s->position));
  remove_duplicates(ALIKE * extent, &total, s->position);
  PetscCheck(total <= 16 + l->nnode_global / 4, s->comm, PETSC_ERR_USER_INPUT,
             "Option -output_statistics %c averages over planes of nodes, and this mesh has none across %c (%" PetscInt_FMT
             " places of %" PetscInt_FMT " nodes): use a box, or remove it",
             (char)('x' + s->axis), (char)('x' + s->axis), total, l->nnode_global);
  s->n = total;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The plane of each own node; on another mesh its nodes count with the nearest plane of the first one */
static PetscErrorCode assign_nodes(Statistics s, const MeshLocal *l)
{
  PetscFunctionBeginUser;
  if (s->plane && s->meshes == l->meshes) PetscFunctionReturn(PETSC_SUCCESS);
  s->meshes = l->meshes;
  PetscCall(PetscFree(s->plane));
  PetscCall(PetscFree(s->nu));
  PetscCall(PetscMalloc1(l->nnode, &s->plane));
  PetscCall(PetscMalloc1(l->nnode_all, &s->nu));
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscReal x = l->x_start[i * l->dim + s->axis];
    PetscInt        k;

    PetscCall(PetscFindReal(x, s->n, s->position, 0, &k));
    if (k < 0) {
      k = PetscMin(s->n - 1, -(k + 1));
      if (k > 0 && x - s->position[k - 1] < s->position[k] - x) k--;
    }
    s->plane[i] = k;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- creation ---- */

static PetscErrorCode find_walls(Statistics s, const MeshLocal *l)
{
  PetscInt faces;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetSolidFaces(FlowConditions(s->flow), &faces));
  s->ends = l->period[s->axis] > 0 ? 0 : (faces >> (2 * s->axis)) & 3;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StatisticsCreate(Flow flow, Monitor monitor, Statistics *statistics)
{
  static const char *const AXES[] = {"none", "x", "y", "z", NULL};
  const MeshLocal         *l;
  Statistics               s;
  PetscInt                 axis = 0;
  Probes                   probes;
  Mesh                     mesh;

  PetscFunctionBeginUser;
  *statistics = NULL;
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(ProbesCreate(flow, monitor, &probes));
  PetscCall(OptChoice("-output_statistics", AXES, &axis));
  if (!axis && !probes) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&s));
  s->comm     = MonitorComm(monitor);
  s->flow     = flow;
  s->monitor  = monitor;
  s->probes   = probes;
  *statistics = s;
  PetscCallMPI(MPI_Comm_rank(s->comm, &s->rank));
  if (!axis) PetscFunctionReturn(PETSC_SUCCESS);
  s->axis = axis - 1;
  PetscCheck(s->axis < l->dim, s->comm, PETSC_ERR_USER_INPUT,
             "-output_statistics z: the scene has two dimensions, give x or y");
  PetscCall(OptReal("-output_statistics_from", &s->from));
  PetscCall(find_planes(s));
  PetscCall(find_walls(s, l));
  PetscCall(PetscCalloc2(s->n * NSUMS, &s->sum, s->n * (NSUMS + 1), &s->now));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StatisticsDestroy(Statistics *statistics)
{
  Statistics s = *statistics;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ProbesDestroy(&s->probes));
  PetscCall(PetscFree(s->position));
  PetscCall(PetscFree(s->plane));
  PetscCall(PetscFree(s->nu));
  PetscCall(PetscFree2(s->sum, s->now));
  PetscCall(PetscFree(*statistics));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- steps ---- */

PetscErrorCode StatisticsStep(Statistics s, PetscReal time, PetscReal dt)
{
  const MeshLocal *l;
  const PetscReal *m;
  PetscReal       *u;
  Mesh             mesh;
  PetscMPIInt      count;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ProbesStep(s->probes));
  if (!s->n || time - dt < s->from - 1e-9 * dt) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetMesh(s->flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(assign_nodes(s, l));
  PetscCall(FlowGetLumpedMass(s->flow, &m));
  PetscCall(FlowGetFields(s->flow, &u, NULL, NULL));
  PetscCall(FlowGetEddies(s->flow, s->nu));
  PetscCall(PetscArrayzero(s->now, s->n * (NSUMS + 1)));
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal *now = s->now + s->plane[i] * (NSUMS + 1), v[3] = {0, 0, 0};

    for (PetscInt a = 0; a < l->dim; a++) v[a] = u[i * l->dim + a];
    for (PetscInt a = 0; a < 3; a++) {
      now[U + a] += m[i] * v[a];
      now[UU + a] += m[i] * v[a] * v[a];
      now[UV + a] += m[i] * v[a == 2 ? 1 : 0] * v[a == 0 ? 1 : 2];
    }
    now[NU] += m[i] * s->nu[i];
    now[NSUMS] += m[i];
  }
  PetscCall(PetscMPIIntCast(s->n * (NSUMS + 1), &count));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, s->now, count, MPIU_REAL, MPIU_SUM, s->comm));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal *now = s->now + k * (NSUMS + 1);

    for (PetscInt i = 0; i < NSUMS && now[NSUMS] > 0; i++) s->sum[k * NSUMS + i] += dt * now[i] / now[NSUMS];
  }
  s->time += dt;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the end ---- */

/* Friction velocity at an end: the slope there of the parabola through the first three planes, which is that of the
   element */
static PetscErrorCode find_friction(Statistics s, PetscBool upper, PetscReal *friction)
{
  const FlowParameters *par;
  const PetscInt        at[3] = {upper ? s->n - 1 : 0, upper ? s->n - 2 : 1, upper ? s->n - 3 : 2};
  const PetscReal       h1 = s->position[at[1]] - s->position[at[0]], h2 = s->position[at[2]] - s->position[at[0]];
  PetscReal             square = 0;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(s->flow, &par));
  for (PetscInt a = 0; a < 3; a++) {
    const PetscReal *u  = s->sum + U + a;
    const PetscReal  d1 = (u[at[1] * NSUMS] - u[at[0] * NSUMS]) / s->time,
                    d2  = (u[at[2] * NSUMS] - u[at[0] * NSUMS]) / s->time;

    if (a != s->axis) square += PetscSqr((d1 * h2 / h1 - d2 * h1 / h2) / (h2 - h1));
  }
  *friction = PetscSqrtReal(par->viscosity / par->density * PetscSqrtReal(square));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode report_friction(Statistics s)
{
  const FlowParameters *par;
  PetscReal             u[2] = {0, 0};

  PetscFunctionBeginUser;
  if (!s->ends || s->n < 3) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < 2; e++) {
    if (!((s->ends >> e) & 1)) continue;
    PetscCall(find_friction(s, (PetscBool)e, &u[e]));
    PetscCall(MonitorQuantity(s->monitor, e ? "friction_velocity_upper" : "friction_velocity_lower", u[e]));
  }
  if (s->ends != 3) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetParameters(s->flow, &par));
  PetscCall(MonitorQuantity(s->monitor, "re_tau",
                            PetscSqrtReal(0.5 * (u[0] * u[0] + u[1] * u[1])) * 0.5 *
                              (s->position[s->n - 1] - s->position[0]) * par->density / par->viscosity));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void print_table(Statistics s, FILE *f)
{
  for (const MonitorColumn *c = STATISTICS; c->name; c++) fprintf(f, "%s%s", c == STATISTICS ? "" : ",", c->name);
  fprintf(f, "\n");
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal v[NSUMS];

    for (PetscInt i = 0; i < NSUMS; i++) v[i] = s->sum[k * NSUMS + i] / s->time;
    for (PetscInt a = 0; a < 3; a++) {
      v[UU + a] -= v[U + a] * v[U + a];
      v[UV + a] -= v[U + (a == 2 ? 1 : 0)] * v[U + (a == 0 ? 1 : 2)];
    }
    fprintf(f, "%.12g", (double)s->position[k]);
    for (PetscInt i = 0; i < NSUMS; i++) fprintf(f, ",%.12g", (double)v[i]);
    fprintf(f, "\n");
  }
}

PetscErrorCode StatisticsWrite(Statistics s, const char dir[])
{
  char  path[PETSC_MAX_PATH_LEN];
  FILE *f   = NULL;
  int   err = 0;

  PetscFunctionBeginUser;
  if (!s || !s->n || s->time <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MonitorQuantity(s->monitor, "statistics_time", s->time));
  PetscCall(report_friction(s));
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/statistics.csv", dir));
  if (!s->rank) err = FileBegin(path, &f);
  if (f) print_table(s, f);
  if (f) err = FileEnd(path, &f);
  PetscCall(FileCheck(s->comm, err, path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StatisticsVisitState(void *statistics, State state)
{
  Statistics s    = statistics;
  PetscInt   rows = s->n * NSUMS;

  PetscFunctionBeginUser;
  if (!s->n) PetscFunctionReturn(PETSC_SUCCESS);
  if (StateIsLoading(state)) PetscCall(StateGetSize(state, "sums", &rows)); /* else they begin with this run */
  if (rows != s->n * NSUMS) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(StateReals(state, "sums", s->n * NSUMS, s->sum));
  PetscCall(StateReals(state, "time", 1, &s->time));
  PetscFunctionReturn(PETSC_SUCCESS);
}
