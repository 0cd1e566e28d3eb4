/* ElasticSurfaces: see elasticsurfaces.h. */
#include "compat.h"
#include "elasticfaces.h"
#include "couple/elasticsurfaces.h"
#include "base/algebra.h"
#include "fem/edge.h"
#include "fem/element.h"

#define CORNER 0.9 /* cosine between edges of the reference mesh: more is smooth (26 degrees, as corners of shapes) */

/* An edge of an outline */
typedef struct {
  PetscInt  node[3];         /* of all solids */
  PetscInt  before, after;   /* edges that share its first and last node */
  PetscReal middle[2], half; /* a circle that holds it */
} Side;

struct _p_ElasticSurfaces {
  const SolidsState *s;
  PetscInt          *first; /* [n + 1] sides of a solid */
  Side              *side;
  PetscInt          *corner, *first_corner; /* nodes; [n + 1] */
  ElasticFaces       faces;                 /* in space, where there are no edges; NULL: in the plane */
  PetscBool          known;                 /* all below, of these x */
  PetscReal         *x;                     /* [nnode][dim] */
  PetscInt          *number;
  PetscBool         *own, *inactive;
  PetscReal (*centre)[3], *radius, *round, *volume;
  AlignSurfaces table;
};

/* ---- what the table asks ---- */

static void points_of(const struct _p_ElasticSurfaces *b, const Side *s, PetscReal p[3][2])
{
  for (PetscInt i = 0; i < 6; i++) p[i / 2][i % 2] = b->x[2 * s->node[i / 2] + i % 2];
}

/* Unit normal, outwards: the solid is on the left */
static void normal_at(const struct _p_ElasticSurfaces *b, const Side *s, PetscReal t, PetscReal n[2])
{
  PetscReal p[3][2];

  points_of(b, s, p);
  EdgeNormal(p, t, n);
}

/* Closest point y to x on outline k: the edge, the parameter there, the square of the distance */
static PetscInt find_edge(const struct _p_ElasticSurfaces *b, PetscInt k, const PetscReal x[2], PetscReal y[2],
                          PetscReal *at, PetscReal *far2)
{
  PetscReal best  = PETSC_MAX_REAL;
  PetscInt  which = b->first[k];

  *at = 0;
  for (PetscInt e = b->first[k]; e < b->first[k + 1]; e++) {
    const Side *s = b->side + e;
    PetscReal   p[3][2], t, z[2], dz[2], far;

    if (best < PETSC_MAX_REAL && PetscSqrtReal(EdgeDistance2(x, s->middle)) - s->half > PetscSqrtReal(best)) continue;
    points_of(b, s, p);
    t = EdgeClosest(p, x);
    EdgeEvaluate(p, t, z, dz);
    far = EdgeDistance2(x, z);
    if (far >= best) continue;
    best  = far;
    which = e;
    *at   = t;
    y[0]  = z[0];
    y[1]  = z[1];
  }
  *far2 = best;
  return which;
}

/* Closest point y to x on outline k, signed distance d */
static void find_closest(const struct _p_ElasticSurfaces *b, PetscInt k, const PetscReal x[2], PetscReal y[2],
                         PetscReal *d)
{
  PetscReal      best, at, n[2], more[2];
  const PetscInt which = find_edge(b, k, x, y, &at, &best);

  normal_at(b, b->side + which, at, n);
  if (PetscAbsReal(at) == 1) { /* at a node */
    normal_at(b, b->side + (at < 0 ? b->side[which].before : b->side[which].after), -at, more);
    n[0] += more[0];
    n[1] += more[1];
  }
  *d = ((x[0] - y[0]) * n[0] + (x[1] - y[1]) * n[1] < 0 ? -1 : 1) * PetscSqrtReal(best);
}

static PetscErrorCode distance(void *ctx, PetscInt k, const PetscReal at[3], PetscInt m, const PetscReal x[],
                               PetscReal d[])
{
  const struct _p_ElasticSurfaces *b = (const struct _p_ElasticSurfaces *)ctx;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m; i++) {
    const PetscReal r[2] = {x[2 * i] - at[0] + b->centre[k][0], x[2 * i + 1] - at[1] + b->centre[k][1]};
    PetscReal       y[2];

    find_closest(b, k, r, y, &d[i]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode project(void *ctx, PetscInt k, PetscInt m, const PetscReal x[], PetscReal y[])
{
  PetscReal d;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m; i++) find_closest((const struct _p_ElasticSurfaces *)ctx, k, x + 2 * i, y + 2 * i, &d);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode corners(void *ctx, PetscInt k, PetscInt max, PetscInt *m, PetscReal x[])
{
  const struct _p_ElasticSurfaces *b = (const struct _p_ElasticSurfaces *)ctx;

  PetscFunctionBeginUser;
  *m = b->first_corner[k + 1] - b->first_corner[k];
  for (PetscInt i = 0; i < PetscMin(max, *m); i++)
    PetscCall(PetscArraycpy(x + 2 * i, b->x + 2 * b->corner[b->first_corner[k] + i], 2));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode distance_in_space(void *ctx, PetscInt k, const PetscReal at[3], PetscInt m, const PetscReal x[],
                                        PetscReal d[])
{
  const struct _p_ElasticSurfaces *b = (const struct _p_ElasticSurfaces *)ctx;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m; i++) {
    PetscReal       r[3];
    FacePoint       y;
    const PetscInt *face;

    for (PetscInt a = 0; a < 3; a++) r[a] = x[3 * i + a] - at[a] + b->centre[k][a];
    d[i] = ElasticFacesNearest(b->faces, k, r, &y, &face);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode project_in_space(void *ctx, PetscInt k, PetscInt m, const PetscReal x[], PetscReal y[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m; i++) {
    FacePoint       at;
    const PetscInt *face;

    (void)ElasticFacesNearest(((struct _p_ElasticSurfaces *)ctx)->faces, k, x + 3 * i, &at, &face);
    PetscCall(PetscArraycpy(y + 3 * i, at.x, 3));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

/* Sides of all solids, who is next to whom, and nodes where the reference mesh has a corner */
static PetscErrorCode list_sides(ElasticSurfaces b)
{
  const SolidsState *s = b->s;
  PetscInt          *from, *to, ncorner = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(s->nnode, &from, s->nnode, &to));
  for (PetscInt k = 0; k < s->n; k++) {
    const SolidMesh *m = &s->group[s->group_of[k]].mesh;

    for (PetscInt e = 0; e < m->nside; e++) {
      Side *side = b->side + b->first[k] + e;

      for (PetscInt j = 0; j < 3; j++) side->node[j] = s->first[k] + m->side[3 * e + j];
      from[side->node[0]] = b->first[k] + e; /* begins there */
      to[side->node[2]]   = b->first[k] + e; /* ends there */
    }
  }
  PetscCall(PetscArraycpy(b->x, s->X, 2 * s->nnode));
  for (PetscInt k = 0; k < s->n; k++) {
    b->first_corner[k] = ncorner;
    for (PetscInt e = b->first[k]; e < b->first[k + 1]; e++) {
      PetscReal n[2], m[2];

      b->side[e].before = to[b->side[e].node[0]];
      b->side[e].after  = from[b->side[e].node[2]];
      normal_at(b, b->side + e, -1, n);
      normal_at(b, b->side + b->side[e].before, 1, m);
      if (n[0] * m[0] + n[1] * m[1] < CORNER) b->corner[ncorner++] = b->side[e].node[0];
    }
  }
  b->first_corner[s->n] = ncorner;
  PetscCall(PetscFree2(from, to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticSurfacesCreate(const SolidsState *s, ElasticSurfaces *surfaces)
{
  ElasticSurfaces b;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->s = s;
  PetscCall(PetscCalloc2(s->n + 1, &b->first, s->n + 1, &b->first_corner));
  b->first[0] = 0;
  for (PetscInt k = 0; k < s->n; k++)
    b->first[k + 1] = b->first[k] + (s->dim == 2 ? s->group[s->group_of[k]].mesh.nside : 0);
  PetscCall(PetscMalloc3(b->first[s->n], &b->side, b->first[s->n], &b->corner, s->dim * s->nnode, &b->x));
  PetscCall(PetscCalloc7(s->n, &b->number, s->n, &b->own, s->n, &b->inactive, s->n, &b->centre, s->n, &b->radius, s->n,
                         &b->round, s->n, &b->volume));
  if (s->dim == 2) PetscCall(list_sides(b));
  else PetscCall(ElasticFacesCreate(s, &b->faces));
  for (PetscInt k = 0; k < s->n; k++) {
    b->number[k] = k;
    b->own[k]    = PETSC_TRUE;
  }
  b->table = (AlignSurfaces){.ctx             = b,
                             .n               = s->n,
                             .nall            = s->n,
                             .number          = b->number,
                             .own             = b->own,
                             .inactive_inside = b->inactive,
                             .centre          = (const PetscReal(*)[3])b->centre,
                             .radius          = b->radius,
                             .round           = b->round,
                             .volume          = b->volume,
                             .distance        = s->dim == 2 ? distance : distance_in_space,
                             .project         = s->dim == 2 ? project : project_in_space,
                             .corners         = s->dim == 2 ? corners : NULL};
  for (PetscInt k = 0; k < s->n; k++) /* stretched twice it would still be known */
    b->table.largest = PetscMax(b->table.largest, 2 * s->group[s->group_of[k]].mesh.radius);
  *surfaces = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticSurfacesDestroy(ElasticSurfaces *surfaces)
{
  ElasticSurfaces b = *surfaces;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ElasticFacesDestroy(&b->faces));
  PetscCall(PetscFree2(b->first, b->first_corner));
  PetscCall(PetscFree3(b->side, b->corner, b->x));
  PetscCall(PetscFree7(b->number, b->own, b->inactive, b->centre, b->radius, b->round, b->volume));
  PetscCall(PetscFree(*surfaces));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The circles around the edges of solid k */
static void set_sides(ElasticSurfaces b, PetscInt k)
{
  for (PetscInt e = b->first[k]; e < b->first[k + 1]; e++) {
    Side     *side = b->side + e;
    PetscReal p[3][2];

    points_of(b, side, p);
    for (PetscInt a = 0; a < 2; a++) side->middle[a] = p[1][a];
    side->half = EdgeRadius(p);
    for (PetscInt j = 0; j < 3; j++)
      b->radius[k] = PetscMax(b->radius[k], 1.0001 * PetscSqrtReal(EdgeDistance2(p[j], b->centre[k])));
  }
}

/* In space: the ball of all nodes, with some room for what bulges between them */
static void set_ball(ElasticSurfaces b, PetscInt k)
{
  for (PetscInt i = b->s->first[k]; i < b->s->first[k + 1]; i++) {
    PetscReal r[3];

    for (PetscInt a = 0; a < 3; a++) r[a] = b->x[3 * i + a] - b->centre[k][a];
    b->radius[k] = PetscMax(b->radius[k], 1.01 * PetscSqrtReal(dot3(r, r)));
  }
}

PetscErrorCode ElasticSurfacesSet(ElasticSurfaces b, const PetscReal x[])
{
  const SolidsState *s = b->s;
  PetscBool          same;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycmp(b->x, x, s->dim * s->nnode, &same));
  if (b->known && same) PetscFunctionReturn(PETSC_SUCCESS);
  b->known = PETSC_TRUE;
  PetscCall(PetscArraycpy(b->x, x, s->dim * s->nnode));
  if (b->faces) ElasticFacesSet(b->faces, b->x);
  for (PetscInt k = s->own[0]; k < s->own[1]; k++)
    b->volume[k] = SolidFindVolume(&s->group[s->group_of[k]].mesh, x + s->dim * s->first[k], b->centre[k]);
  PetscCall(SolidsExchange(s, 1, b->volume));
  PetscCall(SolidsExchange(s, 3, b->centre[0]));
  for (PetscInt k = 0; k < s->n; k++) {
    b->radius[k] = 0;
    if (b->faces) set_ball(b, k);
    else set_sides(b, k);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

const AlignSurfaces *ElasticSurfacesGet(ElasticSurfaces b)
{
  return &b->table;
}

PetscErrorCode ElasticSurfacesGetCorners(ElasticSurfaces b, PetscInt *n, const PetscInt *node[])
{
  PetscFunctionBeginUser;
  *n    = b->first_corner[b->s->n];
  *node = b->corner;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticSurfacesEvaluate(ElasticSurfaces b, PetscInt k, const PetscReal x[], PetscInt node[ELASTIC_SIDE],
                                       PetscReal weight[ELASTIC_SIDE])
{
  PetscFunctionBeginUser;
  if (b->faces) {
    FacePoint       at;
    const PetscInt *face;
    PetscReal       slope[18];

    (void)ElasticFacesNearest(b->faces, k, x, &at, &face);
    PetscCall(PetscArraycpy(node, face, 9));
    ElementBasis(2, at.s, weight, slope);
  } else {
    PetscReal      y[2], t, far2, slope[3];
    const PetscInt e = find_edge(b, k, x, y, &t, &far2);

    PetscCall(PetscArraycpy(node, b->side[e].node, 3));
    ElementLine(t, weight, slope);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ElasticSurfacesGetSizes(ElasticSurfaces b, const PetscInt node[], PetscReal weight[ELASTIC_SIDE])
{
  static const PetscReal SIMPSON[3] = {1 / 6.0, 4 / 6.0, 1 / 6.0};
  PetscReal              length     = 0;

  if (b->faces) {
    ElasticFacesGetAreas(b->faces, node, weight);
    return;
  }
  for (PetscInt i = 0; i < 2; i++) length += PetscSqrtReal(EdgeDistance2(b->x + 2 * node[i], b->x + 2 * node[i + 1]));
  for (PetscInt j = 0; j < 3; j++) weight[j] = SIMPSON[j] * length;
}
