/* Suspension: see suspension.h. Where all ranks know all bodies, rank 0 computes the tables; else each rank does for
   its own bodies, or those in its part, and sums of fixed length go over the ranks. Rank 0 writes.

   Volume in slabs: points inside of each shape, evenly spread, stand for equal parts of a body's volume. Pairs: a
   grid of the centres, each listed within the largest distance. Expected pairs: the share of the box that is still
   in the box after a shift by r, averaged over directions (Stoyan, Kendall & Mecke 1995, Stochastic geometry, ch.
   4). */
#include "compat.h"
#include "report/suspension.h"
#include "base/algebra.h"
#include "base/domain.h"
#include "base/grid.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "files.h"
#include <errno.h>

#define REACH      5 /* mean diameters, of the pair distribution */
#define DIRECTIONS 2000
#define FILL(dim)  ((dim) == 2 ? 40 : 16) /* points along a bounding box */

const MonitorColumn SUSPENSION_PAIRS[] = {{"r", "length", 8, "distance of two centres: middle of an interval"},
                                          {"g", "", 8,
                                           "pairs at that distance over those of independent points in the box"},
                                          {"pairs", "", 12, "number of pairs in the interval"},
                                          {NULL, NULL, 0, NULL}};
const MonitorColumn SUSPENSION_PROFILE[] =
  {{"position", "length", 8, "middle of the slab along -output_suspension_axis"},
   {"fraction", "", 8, "share of the slab's volume that bodies fill"},
   {"u", "length/time", 8, "mean velocity of the bodies in the slab, by volume; 0 where there are none"},
   {"v", "length/time", 8, ""},
   {"w", "length/time", 8, ""},
   {NULL, NULL, 0, NULL}};
const MonitorColumn SUSPENSION_CONTACTS[] =
  {{"body", "", 12, "number of the body, from 0"},
   {"partner", "", 12, "the other body, which has a smaller or larger number, or the name of a wall"},
   {"gap", "length", 8, "below -contact_range; negative: overlap"},
   {"x", "length", 8, "where they are nearest"},
   {"y", "length", 8, ""},
   {"z", "length", 8, ""},
   {"normal_x", "", 8, "direction from the partner to the body"},
   {"normal_y", "", 8, ""},
   {"normal_z", "", 8, ""},
   {NULL, NULL, 0, NULL}};

struct _p_Suspension {
  MPI_Comm    comm;
  Bodies      bodies;
  BodyState  *s;
  Contact     contact;
  Monitor     monitor;
  PetscReal   lower[3], upper[3], period[3];
  PetscInt    column, axis, bins, written; /* step whose tables are there */
  PetscInt   *nfill;                       /* [ngroups] */
  PetscReal **fill;                        /* [ngroups][nfill][dim] points inside of a shape, from its centroid */
  PetscMPIInt rank;
  PetscBool   computes; /* not where rank 0 does it for all */
};

/* ---- creation ---- */

/* A square lattice in the bounding box of a shape, of which the points inside are kept; then the same with more, if
   they are few */
static PetscErrorCode fill_shape(const BodyGroup *g, PetscInt dim, PetscInt *n, PetscReal *point[])
{
  PetscFunctionBeginUser;
  for (PetscInt m = FILL(dim); m <= 8 * FILL(dim); m *= 2) {
    const PetscInt all = dim == 2 ? m * m : m * m * m;

    *n = 0;
    PetscCall(PetscMalloc1(all * dim, point));
    for (PetscInt i = 0; i < all; i++) {
      const PetscInt at[3] = {i % m, i / m % m, i / m / m};
      PetscReal      y[3], d;

      for (PetscInt a = 0; a < dim; a++) y[a] = g->mass.centroid[a] + g->radius * (2 * (at[a] + 0.5) / m - 1);
      PetscCall(ShapeDistance(g->shape, 1, y, &d));
      if (d >= 0) continue;
      for (PetscInt a = 0; a < dim; a++) (*point)[*n * dim + a] = y[a] - g->mass.centroid[a];
      (*n)++;
    }
    if (*n >= FILL(dim)) PetscFunctionReturn(PETSC_SUCCESS);
    PetscCall(PetscFree(*point));
  }
  *n = 1; /* thinner than that: the centre stands for all */
  PetscCall(PetscCalloc1(dim, point));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_options(Suspension b)
{
  static const char *const axes[] = {"x", "y", "z", NULL};

  PetscFunctionBeginUser;
  b->axis = b->s->dim - 1;
  b->bins = 50;
  PetscCall(OptChoice("-output_suspension_axis", axes, &b->axis));
  PetscCall(OptInt("-output_suspension_bins", &b->bins));
  PetscCheck(b->axis < b->s->dim, b->comm, PETSC_ERR_USER_INPUT,
             "-output_suspension_axis z: the scene has two dimensions, give x or y");
  PetscCheck(b->s->nall, b->comm, PETSC_ERR_USER_INPUT,
             "-output_suspension needs bodies: give -particle_groups, or remove the option");
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SuspensionCreate(Bodies bodies, Contact contact, Monitor monitor, const PetscReal lower[],
                                const PetscReal upper[], const PetscReal period[], Suspension *suspension)
{
  Suspension b;
  PetscBool  wanted = PETSC_FALSE;

  PetscFunctionBeginUser;
  *suspension = NULL;
  PetscCall(OptBool("-output_suspension", &wanted));
  if (!wanted) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&b));
  b->comm    = MonitorComm(monitor);
  b->bodies  = bodies;
  b->contact = contact;
  b->monitor = monitor;
  b->written = -1;
  PetscCall(BodiesGetState(bodies, &b->s));
  PetscCallMPI(MPI_Comm_rank(b->comm, &b->rank));
  b->computes = (PetscBool)(!b->rank || BodiesComm(bodies) != PETSC_COMM_SELF);
  PetscCall(read_options(b));
  for (PetscInt a = 0; a < b->s->dim; a++) {
    char           name[32];
    const PetscInt first = b->column;

    b->lower[a]  = lower[a];
    b->upper[a]  = upper[a];
    b->period[a] = period[a];
    (void)snprintf(name, sizeof(name), "bodies_velocity_%c", (int)"xyz"[a]);
    PetscCall(MonitorAddColumn(monitor, name, &b->column));
    if (a) b->column = first;
  }
  PetscCall(PetscCalloc2(b->s->ngroups, &b->nfill, b->s->ngroups, &b->fill));
  for (PetscInt g = 0; g < b->s->ngroups && b->computes; g++)
    PetscCall(fill_shape(&b->s->group[g], b->s->dim, &b->nfill[g], &b->fill[g]));
  *suspension = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SuspensionDestroy(Suspension *suspension)
{
  Suspension b = *suspension;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt g = 0; g < b->s->ngroups; g++) PetscCall(PetscFree(b->fill[g]));
  PetscCall(PetscFree2(b->nfill, b->fill));
  PetscCall(PetscFree(*suspension));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- columns ---- */

PetscErrorCode SuspensionStep(Suspension b)
{
  Exact     sum[4] = {{{0}, 0, 0}}; /* volume times velocity; volume */
  PetscReal value[4];

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < b->s->n; k++) {
    const PetscReal v = BodiesVolume(b->s, k);

    if (!b->s->own[k] || b->s->removed[k] ||
        !(BodiesGetGroup(b->s, k)->free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z)))
      continue;
    for (PetscInt a = 0; a < 3; a++) ExactAdd(&sum[a], v * b->s->u[k][a]);
    ExactAdd(&sum[3], v);
  }
  for (PetscInt a = 0; a < 4; a++) PetscCall(ExactGetSum(BodiesComm(b->bodies), &sum[a], &value[a]));
  for (PetscInt a = 0; a < b->s->dim; a++)
    PetscCall(MonitorSetColumn(b->monitor, b->column + a, value[3] > 0 ? value[a] / value[3] : 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- tables ---- */

static void print_heading(FILE *f, const MonitorColumn *c)
{
  for (PetscInt i = 0; c[i].name; i++) fprintf(f, "%s%s", i ? "," : "", c[i].name);
  fprintf(f, "\n");
}

/* Mean over directions of the part of a box of these sides that a shift by r keeps inside; periodic axes keep all */
static PetscReal get_kept_fraction(Suspension b, const PetscReal side[3], PetscReal r)
{
  const PetscInt dim = b->s->dim;
  PetscReal      sum = 0;

  for (PetscInt i = 0; i < DIRECTIONS; i++) {
    const PetscReal angle = 2 * PETSC_PI * (dim == 2 ? (i + 0.5) / DIRECTIONS : i * 0.6180339887498949),
                    z     = dim == 2 ? 0 : (2 * i + 1.) / DIRECTIONS - 1;
    const PetscReal flat = PetscSqrtReal(1 - z * z), e[3] = {flat * PetscCosReal(angle), flat * PetscSinReal(angle), z};
    PetscReal       kept = 1;

    for (PetscInt a = 0; a < dim; a++)
      if (b->period[a] <= 0) kept *= PetscMax(0, 1 - r * PetscAbsReal(e[a]) / side[a]);
    sum += kept / DIRECTIONS;
  }
  return sum;
}

/* Pairs nearer than reach in intervals, half a pair on either side, and the bodies. Collective. */
static PetscErrorCode count_pairs(Suspension b, PetscReal reach, PetscReal count[], PetscReal *bodies)
{
  PetscReal(*x)[3], lower[3], upper[3];
  PetscInt mine, n;
  Grid     cells;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetCentres(b->bodies, reach, &mine, &n, &x));
  for (PetscInt a = 0; a < 3; a++) {
    lower[a] = upper[a] = n ? x[0][a] : 0;
    for (PetscInt i = 1; i < n; i++) {
      lower[a] = PetscMin(lower[a], x[i][a]);
      upper[a] = PetscMax(upper[a], x[i][a]);
    }
  }
  PetscCall(GridCreate(b->s->dim, lower, upper, 2 * reach, 4 * n + 64, &cells));
  for (PetscInt i = 0; i < n; i++) PetscCall(GridInsert(cells, i, x[i], reach));
  for (PetscInt k = 0; k < mine; k++)
    for (DomainImages i = {0}; DomainNextImage(b->period, b->lower, b->upper, x[k], reach, &i);)
      for (PetscInt e = GridFirst(cells, i.at); e >= 0; e = GridNext(cells, e)) {
        const PetscReal *y    = x[GridItem(cells, e)];
        const PetscReal  d[3] = {i.at[0] - y[0], i.at[1] - y[1], i.at[2] - y[2]}, r = PetscSqrtReal(dot3(d, d));

        if (GridItem(cells, e) != k && r < reach) count[(PetscInt)(r / reach * b->bins)] += 0.5;
      }
  PetscCall(GridDestroy(&cells));
  PetscCall(PetscFree(x));
  *bodies = mine;
  PetscCall(BodiesSum(b->bodies, 1, bodies));
  PetscCall(BodiesSum(b->bodies, b->bins, count));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_mean_radius(Suspension b, PetscReal *mean)
{
  Exact sum = {{0}, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < b->s->n; k++)
    if (b->s->own[k]) ExactAdd(&sum, BodiesGetRadius(b->s, k));
  PetscCall(ExactGetSum(BodiesComm(b->bodies), &sum, mean));
  *mean /= b->s->nall;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode print_pairs(Suspension b, FILE *f)
{
  const PetscInt dim = b->s->dim;
  PetscReal      reach, *count, box = 1, width, side[3] = {0, 0, 0}, n;

  PetscFunctionBeginUser;
  PetscCall(find_mean_radius(b, &reach));
  reach *= 2 * REACH;
  for (PetscInt a = 0; a < dim; a++) { /* centres keep a radius away from walls */
    side[a] = PetscMax(b->upper[a] - b->lower[a] - (b->period[a] > 0 ? 0 : reach / REACH), reach / REACH);
    box *= side[a];
  }
  for (PetscInt a = 0; a < dim; a++) reach = PetscMin(reach, 0.5 * side[a]);
  width = reach / b->bins;
  PetscCall(PetscCalloc1(b->bins, &count));
  PetscCall(count_pairs(b, reach, count, &n));
  for (PetscInt i = 0; i < b->bins && f; i++) {
    const PetscReal r = (i + 0.5) * width, r0 = i * width, r1 = r0 + width;
    const PetscReal shell    = dim == 2 ? PETSC_PI * (r1 * r1 - r0 * r0)
                                        : 4 * PETSC_PI / 3 * (r1 * r1 * r1 - r0 * r0 * r0);
    const PetscReal expected = 0.5 * n * (n - 1.) * shell * get_kept_fraction(b, side, r) / box;

    fprintf(f, "%.8g,%.8g,%.12g\n", (double)r, (double)(expected > 0 ? count[i] / expected : 0), (double)count[i]);
  }
  PetscCall(PetscFree(count));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Adds volume, and volume times velocity, of body k to the slabs [bins][4] */
static void add_body(Suspension b, PetscInt k, PetscReal slab[])
{
  const BodyState *s = b->s;
  const PetscInt   g = s->body_group[k], a = b->axis, dim = s->dim;
  const PetscReal  point_volume = BodiesVolume(s, k) / b->nfill[g];
  PetscReal        R[9];

  RotationMatrix(s->q[k], R);
  for (PetscInt i = 0; i < b->nfill[g]; i++) {
    const PetscReal *y  = b->fill[g] + i * dim;
    const PetscReal  at = s->x[k][a] +
                         s->scale[k] * (R[3 * a] * y[0] + R[3 * a + 1] * y[1] + (dim == 3 ? R[3 * a + 2] * y[2] : 0));
    const PetscReal fraction = (DomainWrap(b->period[a], at, b->lower[a]) - b->lower[a]) / (b->upper[a] - b->lower[a]);
    PetscReal      *here     = slab + 4 * PetscMax(0, PetscMin(b->bins - 1, (PetscInt)(fraction * b->bins)));

    here[0] += point_volume;
    for (PetscInt d = 0; d < 3; d++) here[1 + d] += point_volume * s->u[k][d];
  }
}

static PetscErrorCode print_profile(Suspension b, FILE *f)
{
  const PetscReal width = (b->upper[b->axis] - b->lower[b->axis]) / b->bins;
  PetscReal      *slab, volume = 1;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < b->s->dim; a++) volume *= a == b->axis ? width : b->upper[a] - b->lower[a];
  PetscCall(PetscCalloc1(4 * b->bins, &slab));
  for (PetscInt k = 0; k < b->s->n; k++)
    if (b->s->own[k] && !b->s->removed[k]) add_body(b, k, slab);
  PetscCall(BodiesSum(b->bodies, 4 * b->bins, slab));
  for (PetscInt i = 0; i < b->bins && f; i++) {
    const PetscReal *here = slab + 4 * i, scale = here[0] > 0 ? 1 / here[0] : 0;

    fprintf(f, "%.8g,%.8g,%.8g,%.8g,%.8g\n", (double)(b->lower[b->axis] + (i + 0.5) * width),
            (double)(here[0] / volume), (double)(scale * here[1]), (double)(scale * here[2]),
            (double)(scale * here[3]));
  }
  PetscCall(PetscFree(slab));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int compare_links(const void *a, const void *b)
{
  const ContactLink *one = a, *two = b;

  if (one->i != two->i) return one->i < two->i ? -1 : 1;
  return one->j < two->j ? -1 : one->j > two->j;
}

/* Even shares of the numbers: links go to the rank in whose share i is, so that ranks have them in the order of the
   table */
static PetscErrorCode order_links(Suspension b, PetscInt *n, ContactLink **link)
{
  PetscMPIInt  size, *to, *from;
  ContactLink *in;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(BodiesComm(b->bodies), &size));
  PetscCall(PetscMalloc1(*n, &to));
  for (PetscInt i = 0; i < *n; i++) to[i] = (PetscMPIInt)((PetscInt64)(*link)[i].i * size / b->s->nall);
  PetscCall(BodiesExchange(b->bodies, *n, to, sizeof(**link), *link, n, &in, &from));
  PetscCall(PetscFree(to));
  PetscCall(PetscFree(from));
  PetscCall(PetscFree(*link));
  qsort(in, (size_t)*n, sizeof(*in), compare_links);
  *link = in;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode print_links(Contact contact, FILE *f, PetscInt n, const ContactLink link[])
{
  const char *wall;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n && f; i++) {
    const ContactLink *l = &link[i];

    if (l->j >= 0) fprintf(f, "%" PetscInt_FMT ",%" PetscInt_FMT, l->i, l->j);
    else {
      PetscCall(ContactGetWallName(contact, -1 - l->j, &wall));
      fprintf(f, "%" PetscInt_FMT ",%s", l->i, wall);
    }
    fprintf(f, ",%.8g", (double)l->gap);
    for (PetscInt a = 0; a < 3; a++) fprintf(f, ",%.8g", (double)l->x[a]);
    for (PetscInt a = 0; a < 3; a++) fprintf(f, ",%.8g", (double)l->normal[a]);
    fprintf(f, "\n");
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rank 0 prints what the ranks have, one after the other: never more than one share of it is there. Collective. */
static PetscErrorCode print_fractions(Suspension b, PetscInt n, ContactLink link[], FILE *f)
{
  const MPI_Comm comm = BodiesComm(b->bodies);
  PetscMPIInt    size, tag, m, mine;
  MPI_Datatype   type;
  MPI_Status     status;
  ContactLink   *other;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscCommGetNewTag(comm, &tag));
  PetscCallMPI(MPI_Type_contiguous((int)sizeof(*link), MPI_BYTE, &type));
  PetscCallMPI(MPI_Type_commit(&type));
  PetscCall(PetscMPIIntCast(n, &mine));
  if (b->rank) PetscCallMPI(MPI_Send(link, mine, type, 0, tag, comm));
  else PetscCall(print_links(b->contact, f, n, link));
  for (PetscMPIInt r = 1; r < size && !b->rank; r++) {
    PetscCallMPI(MPI_Probe(r, tag, comm, &status));
    PetscCallMPI(MPI_Get_count(&status, type, &m));
    PetscCall(PetscMalloc1(m, &other));
    PetscCallMPI(MPI_Recv(other, m, type, r, tag, comm, MPI_STATUS_IGNORE));
    PetscCall(print_links(b->contact, f, m, other));
    PetscCall(PetscFree(other));
  }
  PetscCallMPI(MPI_Type_free(&type));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode print_contacts(Suspension b, FILE *f)
{
  ContactLink *link;
  PetscInt     n;

  PetscFunctionBeginUser;
  PetscCall(ContactGetLinks(b->contact, &n, &link));
  if (BodiesComm(b->bodies) == PETSC_COMM_SELF) PetscCall(print_links(b->contact, f, n, link));
  else {
    PetscCall(order_links(b, &n, &link));
    PetscCall(print_fractions(b, n, link, f));
  }
  PetscCall(PetscFree(link));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SuspensionWrite(Suspension b, const char dir[], PetscInt step)
{
  const struct {
    const char          *name;
    const MonitorColumn *column;
    PetscErrorCode (*print)(Suspension, FILE *);
  } table[] = {{"pairs", SUSPENSION_PAIRS, print_pairs},
               {"profile", SUSPENSION_PROFILE, print_profile},
               {"contacts", SUSPENSION_CONTACTS, print_contacts}};

  PetscFunctionBeginUser;
  if (!b || b->written == step) PetscFunctionReturn(PETSC_SUCCESS);
  b->written = step;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(table); i++) {
    char  path[PETSC_MAX_PATH_LEN];
    FILE *f   = NULL;
    int   err = 0;

    PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s_%" PetscInt_FMT ".csv", dir, table[i].name, step));
    if (!b->rank) err = FileBegin(path, &f);
    if (f) print_heading(f, table[i].column);
    /* all ranks look at the contacts: the list of pairs stays the same on all of them; f may be NULL on rank 0 too */
    if (b->computes || table[i].print == print_contacts) PetscCall(table[i].print(b, f));
    if (f) err = FileEnd(path, &f);
    PetscCall(FileCheck(b->comm, err, path));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
