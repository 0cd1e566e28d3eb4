/* BodySurfaces: see bodysurfaces.h. */
#include "compat.h"
#include "couple/bodysurfaces.h"
#include "base/agree.h"
#include "base/algebra.h"
#include "base/array.h"
#include "bodies/local.h"
#include "couple/couple.h"

#define TOUCH 1e-4 /* radii of a body: a point is on its surface */
#define WIDE  3    /* from how many cells on a body thinner than one is a plate */

struct _p_BodySurfaces {
  Bodies         bodies;
  BodyState     *s;
  AlignSurfaces  table;
  DeformSurfaces deform;
  PetscInt       capacity;
  PetscReal (*X)[3], (*q)[4];               /* [n] where they are */
  PetscReal       *radius, *round, *volume; /* [n] */
  Midline         *line;                    /* [ngroups] of the shape, NULL: it has none */
  PetscBool       *asked;                   /* [ngroups] has it been looked for? */
  PetscInt         npoint;
  const PetscReal *point; /* [npoint][2] of BodySurfacesSetPoints */
};

/* ---- what the table asks ---- */

static PetscErrorCode distance(void *ctx, PetscInt k, const PetscReal at[3], PetscInt m, const PetscReal x[],
                               PetscReal d[])
{
  const BodySurfaces b = (BodySurfaces)ctx;

  PetscFunctionBeginUser;
  PetscCall(BodiesDistance(b->bodies, k, at, b->q[k], m, x, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode project(void *ctx, PetscInt k, PetscInt m, const PetscReal x[], PetscReal y[])
{
  const BodySurfaces b = (BodySurfaces)ctx;

  PetscFunctionBeginUser;
  PetscCall(BodiesProject(b->bodies, k, b->X[k], b->q[k], m, x, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode corners(void *ctx, PetscInt k, PetscInt capacity, PetscInt *m, PetscReal x[])
{
  const BodySurfaces b = (BodySurfaces)ctx;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetCorners(b->bodies, k, b->X[k], b->q[k], capacity, m, x));
  for (PetscInt i = 0; i < b->npoint; i++) {
    PetscReal d;

    PetscCall(BodiesDistance(b->bodies, k, b->X[k], b->q[k], 1, b->point + 2 * i, &d));
    if (PetscAbsReal(d) > TOUCH * b->radius[k]) continue;
    if (*m < capacity) PetscCall(BodiesProject(b->bodies, k, b->X[k], b->q[k], 1, b->point + 2 * i, x + 2 * *m));
    (*m)++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode points(void *ctx, PetscInt k, PetscInt capacity, PetscInt *m, PetscReal **x)
{
  const BodySurfaces b = (BodySurfaces)ctx;

  PetscFunctionBeginUser;
  PetscCall(BodiesSurfacePoints(b->bodies, k, b->X[k], b->q[k], capacity, m, x, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode midline(void *ctx, PetscInt k, PetscReal limit, Midline *line)
{
  const BodySurfaces b = (BodySurfaces)ctx;
  const PetscInt     g = b->s->body_group[k];
  PetscReal          thickness;

  PetscFunctionBeginUser;
  *line = NULL;
  if (!b->asked[g]) PetscCall(BodyMidlineCreate(b->s->group[g].shape, &b->line[g]));
  b->asked[g] = PETSC_TRUE;
  if (!b->line[g] || b->s->group[g].body_fitted) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MidlineGetSize(b->line[g], NULL, &thickness));
  if (b->s->scale[k] * thickness >= limit) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(BodiesComm(b->bodies) == PETSC_COMM_SELF || b->s->group[g].everywhere, PETSC_COMM_SELF, PETSC_ERR_PLIB,
             "Body %" PetscInt_FMT " is thinner than a cell, and not all ranks know it", b->s->number[k]);
  PetscCall(MidlineScale(b->line[g], b->s->scale[k], line));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode frame(void *ctx, PetscInt k, PetscReal R[9], PetscReal centre[2])
{
  const BodySurfaces b        = (BodySurfaces)ctx;
  const PetscReal   *centroid = BodiesGetGroup(b->s, k)->mass.centroid;

  PetscFunctionBeginUser;
  RotationMatrix(b->q[k], R);
  for (PetscInt a = 0; a < 2; a++) centre[a] = b->s->scale[k] * centroid[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode sum(void *ctx, PetscInt width, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(BodiesSumLocal(((BodySurfaces)ctx)->bodies, width, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode max(void *ctx, PetscInt width, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(BodiesMaxLocal(((BodySurfaces)ctx)->bodies, width, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- mid-lines ---- */

static PetscErrorCode figure_distance(void *shape, const PetscReal x[2], PetscReal *d)
{
  PetscFunctionBeginUser;
  PetscCall(ShapeDistance((Shape)shape, 1, x, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The line is begun across from the surface point that is closest to the centroid, or to a point beside it, which is
   not on the ridge of the distance */
PetscErrorCode BodyMidlineCreate(Shape shape, Midline *line)
{
  MidlineFigure f = {.ctx = shape, .distance = figure_distance};
  ShapeMass     mass;
  PetscReal     disc, beside[2];

  PetscFunctionBeginUser;
  *line = NULL;
  PetscCall(ShapeGetDisc(shape, &disc));
  if (disc > 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ShapeGetRadius(shape, &f.radius));
  PetscCall(ShapeGetMass(shape, &mass));
  f.area    = mass.volume;
  beside[0] = mass.centroid[0] + 1e-4 * f.radius;
  beside[1] = mass.centroid[1] + 1.3e-4 * f.radius;
  PetscCall(ShapeProject(shape, 1, beside, f.wall));
  PetscCall(ShapeNormal(shape, 1, f.wall, f.normal));
  PetscCall(MidlineCreate(&f, line));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

PetscErrorCode BodySurfacesCreate(Bodies bodies, BodySurfaces *surfaces)
{
  const PetscBool spread = (PetscBool)(BodiesComm(bodies) != PETSC_COMM_SELF);
  BodySurfaces    b;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->bodies = bodies;
  PetscCall(BodiesGetState(bodies, &b->s));
  b->table = (AlignSurfaces){.ctx      = b,
                             .nall     = b->s->nall,
                             .distance = distance,
                             .project  = project,
                             .corners  = corners,
                             .points   = points,
                             .midline  = midline,
                             .frame    = frame,
                             .sum      = spread ? sum : NULL,
                             .max      = spread ? max : NULL};
  PetscCall(PetscCalloc2(b->s->ngroups, &b->line, b->s->ngroups, &b->asked));
  *surfaces = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodySurfacesDestroy(BodySurfaces *surfaces)
{
  BodySurfaces b = *surfaces;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt g = 0; g < b->s->ngroups; g++) PetscCall(MidlineDestroy(&b->line[g]));
  PetscCall(PetscFree2(b->line, b->asked));
  PetscCall(PetscFree(b->radius));
  PetscCall(PetscFree(b->round));
  PetscCall(PetscFree(b->volume));
  PetscCall(PetscFree(*surfaces));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodySurfacesSet(BodySurfaces b, PetscReal (*X)[3], PetscReal (*q)[4])
{
  const PetscInt n = b->s->n;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(n, &b->capacity, &b->radius, sizeof(*b->radius), &b->round, sizeof(*b->round), &b->volume,
                         sizeof(*b->volume), NULL));
  for (PetscInt k = 0; k < n; k++) {
    b->radius[k] = BodiesGetRadius(b->s, k);
    b->round[k]  = BodiesGetDisc(b->s, k);
    PetscCall(BodiesGetVolume(b->bodies, k, &b->volume[k]));
  }
  for (PetscInt g = 0; g < b->s->ngroups; g++) /* those that grow have become larger */
    b->table.largest = PetscMax(b->table.largest, b->s->group[g].radius * b->s->group[g].largest);
  b->X            = X;
  b->q            = q;
  b->table.n      = n;
  b->table.number = b->s->number;
  b->table.own    = b->s->own;
  b->table.centre = (const PetscReal(*)[3])X;
  b->table.radius = b->radius;
  b->table.round  = b->round;
  b->table.volume = b->volume;

  b->deform.n       = n;
  b->deform.centre  = b->table.centre;
  b->deform.radius  = b->radius;
  b->deform.removed = b->s->removed;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodySurfacesSetPoints(BodySurfaces b, PetscInt n, const PetscReal x[])
{
  PetscFunctionBeginUser;
  b->npoint = n;
  b->point  = x;
  PetscFunctionReturn(PETSC_SUCCESS);
}

const AlignSurfaces *BodySurfacesGet(BodySurfaces b)
{
  return &b->table;
}

/* ---- for a Deform ---- */

static PetscErrorCode look(void *ctx, PetscReal reach)
{
  PetscFunctionBeginUser;
  PetscCall(BodiesLookFarther(((BodySurfaces)ctx)->bodies, reach));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode place_all(BodySurfaces b)
{
  PetscFunctionBeginUser;
  PetscCall(BodySurfacesSet(b, (PetscReal(*)[3])b->s->x, (PetscReal(*)[4])b->s->q));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update_local(void *ctx)
{
  PetscFunctionBeginUser;
  PetscCall(BodiesMigrate(((BodySurfaces)ctx)->bodies, 0, 1));
  PetscCall(place_all((BodySurfaces)ctx));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(void *ctx)
{
  BodySurfaces b = (BodySurfaces)ctx;

  PetscFunctionBeginUser;
  PetscCall(BodySurfacesDestroy(&b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodySurfacesGiveDeform(BodySurfaces b, const DeformSurfaces **surfaces)
{
  PetscFunctionBeginUser;
  PetscCall(place_all(b));
  b->deform.ctx          = b;
  b->deform.nall         = b->s->nall;
  b->deform.distance     = distance;
  b->deform.look         = look;
  b->deform.update_local = update_local;
  b->deform.destroy      = destroy;
  for (PetscInt k = 0; k < b->s->n; k++) b->deform.largest = PetscMax(b->deform.largest, b->radius[k]);
  PetscCall(BodiesMax(b->bodies, 1, &b->deform.largest));
  *surfaces = &b->deform;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodySurfacesCreateDeform(Mesh mesh, Bodies bodies, Deform *deform)
{
  BodySurfaces          b;
  const DeformSurfaces *surfaces;

  PetscFunctionBeginUser;
  PetscCall(BodySurfacesCreate(bodies, &b));
  PetscCall(BodySurfacesGiveDeform(b, &surfaces));
  PetscCall(DeformCreate(mesh, surfaces, deform));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- bodies thinner than a cell ---- */

/* Size of the smallest body of a group, on any rank */
static PetscErrorCode find_thinnest(Bodies bodies, const BodyState *s, PetscInt group, PetscReal *min)
{
  PetscFunctionBeginUser;
  *min = PETSC_MAX_REAL;
  for (PetscInt k = 0; k < s->n; k++)
    if (s->body_group[k] == group) *min = PetscMin(*min, s->scale[k]);
  PetscCall(BodiesMin(bodies, 1, min));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The smallest body of a group, if it is known here. Its size is `min`. */
static PetscErrorCode refuse_plate(BodySurfaces b, Mesh mesh, const BodyGroup *group, PetscReal min)
{
  const MeshLocal *l;
  PetscInt         k = -1;
  PetscReal        depth;
  MPI_Comm         comm;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshGetComm(mesh, &comm));
  for (PetscInt j = 0; j < b->s->n && k < 0; j++)
    if (BodiesGetGroup(b->s, j) == group && b->s->scale[j] == min) k = j;
  if (k < 0 || 2 * BodiesGetRadius(b->s, k) < WIDE * l->h) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(AlignFindDepth(&b->table, k, 0.5 * l->h, &depth));
  PetscCheck(depth >= 0.5 * l->h, b->s->n < b->s->nall ? PETSC_COMM_SELF : comm, PETSC_ERR_SUP,
             "Group '%s' has bodies that are %.2g thick, thinner than a cell (%.2g), and wider than %d cells: -couple_method aligned follows such "
             "plates in the plane only. Use smaller cells (-mesh_cells, at most %.2g), a thicker body, or -couple_method penalty",
             group->name, (double)(2 * depth), (double)l->h, WIDE, (double)(2 * depth));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodySurfacesRefusePlates(BodySurfaces b, Mesh mesh)
{
  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < b->s->ngroups && b->s->dim == 3; g++) {
    const BodyGroup *group = &b->s->group[g];
    PetscReal        min;

    if (group->body_fitted || !group->count) continue;
    PetscCall(find_thinnest(b->bodies, b->s, g, &min));
    AgreeEnter();
    PetscCall(AgreeReturn(refuse_plate(b, mesh, group, min)));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Root of the area of the largest cell, or more */
static PetscErrorCode find_largest_cell(Mesh mesh, PetscReal *size)
{
  const MeshLocal *l;
  MPI_Comm         comm;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshGetComm(mesh, &comm));
  *size = 0;
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal x[MESH_MAX_NB * 3], area = 1;

    PetscCall(MeshCellCoordinates(mesh, c, x));
    for (PetscInt a = 0; a < 2; a++) {
      PetscReal lower = x[a], upper = x[a];

      for (PetscInt j = 1; j < l->nb; j++) {
        lower = PetscMin(lower, x[2 * j + a]);
        upper = PetscMax(upper, x[2 * j + a]);
      }
      area *= upper - lower;
    }
    *size = PetscMax(*size, PetscSqrtReal(area));
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, size, 1, MPIU_REAL, MPIU_MAX, comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodySurfacesSpreadThin(Mesh mesh, Bodies bodies)
{
  BodyState *s;
  PetscReal  cell;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  if (s->dim == 3) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_largest_cell(mesh, &cell));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    Midline   line      = NULL;
    PetscReal thickness = PETSC_MAX_REAL, min;

    if (!s->group[g].body_fitted && s->group[g].count) PetscCall(BodyMidlineCreate(s->group[g].shape, &line));
    if (!line) continue;
    PetscCall(MidlineGetSize(line, NULL, &thickness));
    PetscCall(MidlineDestroy(&line));
    PetscCall(find_thinnest(bodies, s, g, &min));
    if (min * thickness < ALIGN_THIN * cell) PetscCall(BodiesSetEverywhere(bodies, g));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- cells of a refined mesh ---- */

PetscErrorCode CoupleHasEvenCells(Mesh mesh, Bodies bodies, PetscBool *even)
{
  BodySurfaces surfaces;

  PetscFunctionBeginUser;
  PetscCall(BodySurfacesCreate(bodies, &surfaces));
  PetscCall(place_all(surfaces));
  PetscCall(AlignHasEvenCells(mesh, &surfaces->table, even));
  PetscCall(BodySurfacesDestroy(&surfaces));
  PetscFunctionReturn(PETSC_SUCCESS);
}
