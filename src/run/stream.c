/* Stream: see stream.h. */
#include "compat.h"
#include "stream.h"
#include "base/algebra.h"
#include "base/opt.h"
#include "bodies/local.h"
#include <stdio.h>
#include <string.h>

#define FRACTION 0.6 /* of the largest width, that of the bluff part; of a disc over ROUND of its diameter */
#define ROUND    0.8
#define LINES    64 /* across the stream, and points on each; in space LINES_3D, in one of PLANES */
#define LINES_3D 32
#define PLANES   180
#define COARSE   10  /* points along each axis, among which the centre of the bluff part is looked for */
#define SURFACE  300 /* points, for extents */
#define FEW      8   /* bodies of a group that are looked at, if they are not round */

#define SHARP       30  /* degrees */
#define ANGLES      720 /* points around a corner, so many bounding radii away */
#define NEAR_CORNER 0.02
#define CORNERS_MAX 64
#define LOPSIDED    0.1 /* of the thickness, beyond points and rounding */
#define INCIDENCE   2   /* degrees between an edge and the stream, of what has lift */

/* ---- the size of a body in it ---- */

/* A rectangle in a plane: from its corner along two unit vectors, the stream's and one across */
typedef struct {
  PetscReal corner[3], axis[2][3], extent[2];
  PetscInt  n; /* lines across, and points on each */
} Rectangle;

/* Around n points x [n][dim] as they are seen along the normal of the plane through `centre` */
static void fit_rectangle(PetscInt dim, PetscInt n, const PetscReal x[], const PetscReal centre[3], Rectangle *r)
{
  PetscReal low[2] = {0, 0}, high[2] = {0, 0};

  for (PetscInt i = 0; i < n; i++) {
    for (PetscInt e = 0; e < 2; e++) {
      PetscReal at = 0;

      for (PetscInt a = 0; a < dim; a++) at += (x[i * dim + a] - centre[a]) * r->axis[e][a];
      low[e]  = PetscMin(low[e], at);
      high[e] = PetscMax(high[e], at);
    }
  }
  for (PetscInt e = 0; e < 2; e++) r->extent[e] = high[e] - low[e];
  for (PetscInt a = 0; a < 3; a++) r->corner[a] = centre[a] + low[0] * r->axis[0][a] + low[1] * r->axis[1][a];
}

/* How much of a line of n points with these distances is inside, in steps */
static PetscReal find_width(PetscInt n, const PetscReal d[])
{
  PetscReal width = 0;

  for (PetscInt i = 0; i < n; i++) {
    const PetscReal before = i ? d[i - 1] : 0, after = i + 1 < n ? d[i + 1] : 0;

    if (d[i] >= 0) continue;
    width += before < 0 ? 0.5 : i ? d[i] / (d[i] - before) : 0.5;
    width += after < 0 ? 0.5 : i + 1 < n ? d[i] / (d[i] - after) : 0.5;
  }
  return width;
}

/* Over how many lines in a row the width is at least FRACTION of the largest one */
static PetscReal find_stretch(PetscInt n, const PetscReal width[])
{
  PetscInt  widest = 0, from, to;
  PetscReal bound, length;

  for (PetscInt i = 1; i < n; i++)
    if (width[i] > width[widest]) widest = i;
  bound = FRACTION * width[widest];
  for (from = widest; from > 0 && width[from - 1] >= bound;) from--;
  for (to = widest; to + 1 < n && width[to + 1] >= bound;) to++;
  length = (PetscReal)(to - from);
  length += from ? (width[from] - bound) / (width[from] - width[from - 1]) : 0.5;
  return length + (to + 1 < n ? (width[to] - bound) / (width[to] - width[to + 1]) : 0.5);
}

/* Length along the stream of the part that is nearly as wide as any, in the plane of the rectangle; 0: nothing of the
   body was seen there */
static PetscErrorCode measure_length(Bodies bodies, PetscInt k, const Rectangle *r, PetscReal *length)
{
  BodyState *s;
  PetscReal *x, *d, width[LINES], step[2], width_max = 0;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  for (PetscInt e = 0; e < 2; e++) step[e] = r->extent[e] / r->n;
  PetscCall(PetscMalloc2(r->n * s->dim, &x, r->n, &d));
  for (PetscInt i = 0; i < r->n; i++) { /* lines across, one behind the other */
    for (PetscInt j = 0; j < r->n; j++)
      for (PetscInt a = 0; a < s->dim; a++)
        x[j * s->dim + a] = r->corner[a] + (i + 0.5) * step[0] * r->axis[0][a] + (j + 0.5) * step[1] * r->axis[1][a];
    PetscCall(BodiesDistance(bodies, k, NULL, NULL, r->n, x, d));
    width[i]  = find_width(r->n, d);
    width_max = PetscMax(width_max, width[i]);
  }
  PetscCall(PetscFree2(x, d));
  *length = width_max > 0 ? PetscMin(r->extent[0], find_stretch(r->n, width) * step[0] / ROUND) : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* To the deepest of the neighbours of a point at that distance along the axes, if one is deeper than itself */
static PetscErrorCode move_deeper(Bodies bodies, PetscInt k, PetscReal step, PetscReal centre[3], PetscReal *bound,
                                  PetscBool *deeper)
{
  BodyState *s;
  PetscReal  x[6][3], d;
  PetscInt   best = -1;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  for (PetscInt i = 0; i < 2 * s->dim; i++) {
    for (PetscInt a = 0; a < 3; a++) x[i][a] = centre[a] + (a == i / 2 ? (i % 2 ? step : -step) : 0);
    PetscCall(BodiesDistance(bodies, k, NULL, NULL, 1, x[i], &d));
    if (d >= *bound) continue;
    *bound = d;
    best   = i;
  }
  for (PetscInt a = 0; a < 3 && best >= 0; a++) centre[a] = x[best][a];
  *deeper = (PetscBool)(best >= 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The deepest point inside of the body, the centre of its bluffest part, which is so thick there; its own centre and 0
   where points miss the body */
static PetscErrorCode find_deepest(Bodies bodies, PetscInt k, PetscReal centre[3], PetscReal *thick)
{
  BodyState *s;
  PetscReal *x, *d, bound = 0, r, step;
  PetscInt   n      = 1;
  PetscBool  deeper = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  r = BodiesGetRadius(s, k);
  for (PetscInt a = 0; a < s->dim; a++) n *= COARSE;
  PetscCall(PetscMalloc2(n * s->dim, &x, n, &d));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt a = 0, index = i; a < s->dim; a++, index /= COARSE)
      x[i * s->dim + a] = s->x[k][a] + r * (2 * (index % COARSE + 0.5) / COARSE - 1);
  PetscCall(BodiesDistance(bodies, k, NULL, NULL, n, x, d));
  for (PetscInt a = 0; a < 3; a++) centre[a] = s->x[k][a];
  PetscCall(BodiesDistance(bodies, k, NULL, NULL, 1, centre, &bound));
  for (PetscInt i = 0; i < n; i++) {
    if (d[i] >= bound - 1e-9 * r) continue;
    bound = d[i];
    for (PetscInt a = 0; a < s->dim; a++) centre[a] = x[i * s->dim + a];
  }
  PetscCall(PetscFree2(x, d));
  step = r / COARSE;
  for (PetscInt i = 0; i < 20 && bound < 0; i++) {
    PetscCall(move_deeper(bodies, k, step, centre, &bound, &deeper));
    if (!deeper) step *= 0.5;
  }
  *thick = PetscMax(0, -2 * bound);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The plane of a stream through the centre, of those turned about it, in which the body looks narrowest */
static PetscErrorCode find_narrowest(Bodies bodies, PetscInt k, const PetscReal e[3], const PetscReal centre[3],
                                     Rectangle *narrowest)
{
  BodyState *s;
  PetscReal *x, one[3], first[3] = {-e[1], e[0], 0}, second[3] = {0, 0, 0};
  PetscInt   n;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  if (s->dim == 3) {
    PetscReal norm;
    PetscInt  bound = 0;

    for (PetscInt a = 1; a < 3; a++)
      if (PetscAbsReal(e[a]) < PetscAbsReal(e[bound])) bound = a;
    for (PetscInt a = 0; a < 3; a++) one[a] = a == bound; /* not along the stream */
    cross(e, one, first);
    norm = PetscSqrtReal(dot3(first, first));
    for (PetscInt a = 0; a < 3; a++) first[a] /= norm;
    cross(e, first, second);
  }
  PetscCall(BodiesSurfacePoints(bodies, k, s->x[k], s->q[k], SURFACE, &n, &x, NULL));
  for (PetscInt i = 0; i < (s->dim == 3 ? PLANES : 1); i++) {
    const PetscReal c = PetscCosReal(i * PETSC_PI / PLANES), w = PetscSinReal(i * PETSC_PI / PLANES);
    Rectangle       r = {.n = s->dim == 3 ? LINES_3D : LINES};

    for (PetscInt a = 0; a < 3; a++) {
      r.axis[0][a] = e[a];
      r.axis[1][a] = c * first[a] + w * second[a];
    }
    fit_rectangle(s->dim, n, x, centre, &r);
    if (i == 0 || r.extent[1] < narrowest->extent[1]) *narrowest = r;
  }
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The corner at x: is it sharper than SHARP degrees, and does it point elsewhere than along the stream? */
static PetscErrorCode look_at_corner(Bodies bodies, PetscInt k, const PetscReal corner[2], const PetscReal e[3],
                                     StreamEdge *edge)
{
  BodyState *s;
  PetscReal *x, *d, inside = 0, to[2] = {0, 0}; /* into the body, along the middle of the corner */

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  PetscCall(PetscMalloc2(2 * ANGLES, &x, ANGLES, &d));
  for (PetscInt j = 0; j < ANGLES; j++) {
    x[2 * j]     = corner[0] + NEAR_CORNER * BodiesGetRadius(s, k) * PetscCosReal(2 * PETSC_PI * j / ANGLES);
    x[2 * j + 1] = corner[1] + NEAR_CORNER * BodiesGetRadius(s, k) * PetscSinReal(2 * PETSC_PI * j / ANGLES);
  }
  PetscCall(BodiesDistance(bodies, k, NULL, NULL, ANGLES, x, d));
  for (PetscInt j = 0; j < ANGLES; j++) {
    if (d[j] >= 0) continue;
    inside += 1;
    to[0] += PetscCosReal(2 * PETSC_PI * j / ANGLES);
    to[1] += PetscSinReal(2 * PETSC_PI * j / ANGLES);
  }
  PetscCall(PetscFree2(x, d));
  if (360 * inside >= SHARP * ANGLES || inside == 0) PetscFunctionReturn(PETSC_SUCCESS);
  *edge = PetscMax(*edge, STREAM_EDGE);
  if (PetscAbsReal(to[0] * e[1] - to[1] * e[0]) >
      PetscSinReal(INCIDENCE * PETSC_PI / 180) * PetscSqrtReal(to[0] * to[0] + to[1] * to[1]))
    *edge = STREAM_EDGE_LIFTS;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is its surface, mirrored at the stream through its centre, another one? In the plane */
static PetscErrorCode is_lopsided(Bodies bodies, PetscInt k, const PetscReal e[3], PetscReal thick, PetscBool *lopsided)
{
  BodyState *s;
  PetscReal *x, *d, largest = 0, low = PETSC_MAX_REAL, high = -PETSC_MAX_REAL;
  PetscInt   n;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  PetscCall(BodiesSurfacePoints(bodies, k, s->x[k], s->q[k], SURFACE, &n, &x, NULL));
  PetscCall(PetscMalloc1(n, &d));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal across = e[0] * x[2 * i + 1] - e[1] * x[2 * i];

    low  = PetscMin(low, across);
    high = PetscMax(high, across);
  }
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal across = e[0] * x[2 * i + 1] - e[1] * x[2 * i] - 0.5 * (low + high);

    x[2 * i] += 2 * across * e[1];
    x[2 * i + 1] -= 2 * across * e[0];
  }
  PetscCall(BodiesDistance(bodies, k, NULL, NULL, n, x, d));
  for (PetscInt i = 0; i < n; i++) largest = PetscMax(largest, PetscAbsReal(d[i]));
  *lopsided = (PetscBool)(largest > LOPSIDED * thick);
  PetscCall(PetscFree(d));
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Has the body, in the plane, an edge that no mesh is lined up with? */
static PetscErrorCode find_edge(Bodies bodies, PetscInt k, const PetscReal e[3], StreamEdge *edge)
{
  BodyState *s;
  PetscReal  corner[2 * CORNERS_MAX];
  PetscInt   n;

  PetscFunctionBeginUser;
  *edge = STREAM_NO_EDGE;
  PetscCall(BodiesGetState(bodies, &s));
  if (s->dim != 2) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesGetCorners(bodies, k, s->x[k], s->q[k], CORNERS_MAX, &n, corner));
  for (PetscInt i = 0; i < PetscMin(n, CORNERS_MAX); i++) PetscCall(look_at_corner(bodies, k, corner + 2 * i, e, edge));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StreamMeasureBody(Bodies bodies, PetscInt k, const PetscReal direction[3], PetscReal *size,
                                 StreamEdge *edge)
{
  BodyState *s;
  Rectangle  r = {.n = LINES};
  PetscReal  centre[3], thick = 0, length = 0, blunt;
  PetscBool  lifts = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  *edge = STREAM_NO_EDGE;
  *size = 2 * BodiesGetDisc(s, k);
  if (*size > 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_deepest(bodies, k, centre, &thick));
  PetscCall(find_narrowest(bodies, k, direction, centre, &r));
  PetscCall(measure_length(bodies, k, &r, &length));
  if (thick == 0) thick = r.extent[1]; /* thinner than points are apart */
  if (length == 0) length = thick;
  blunt = PetscMax(0, PetscMin(1, r.extent[1] / thick - 1)); /* does the stream go around edges? */
  *size = blunt * thick + (1 - blunt) * PetscMax(thick, length);
  PetscCall(find_edge(bodies, k, direction, edge));
  if (*edge == STREAM_EDGE_LIFTS) *size = thick;
  if (s->dim == 2 && *edge == STREAM_NO_EDGE && blunt > 0) PetscCall(is_lopsided(bodies, k, direction, thick, &lifts));
  if (lifts) *edge = STREAM_LIFTS;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- its boundary layer ---- */

/* Is there such a layer, and does the mesh not fit the bodies? */
static PetscErrorCode has_layer(const BodyGroup *g, const Stream *stream, PetscBool *yes)
{
  char      kind[32];
  PetscBool convection = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-mesh_kind", kind, sizeof(kind)));
  PetscCall(PetscStrcasecmp(kind[0] ? kind : "box", "box", yes));
  PetscCall(OptPeekBool("-flow_convection", &convection));
  if (!convection || !g->count || g->free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z) || stream->speed == 0)
    *yes = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StreamPeekFluid(PetscReal *density, PetscReal *viscosity)
{
  PetscBool given;

  PetscFunctionBeginUser;
  *density   = 1;
  *viscosity = 0.01;
  PetscCall(OptPeekReal("-flow_density", density, &given));
  PetscCall(OptPeekReal("-flow_viscosity", viscosity, &given));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StreamMeasureLayer(const MeshLocal *l, Bodies bodies, PetscInt group, const Stream *stream,
                                  PetscReal *cells, StreamEdge *edge)
{
  BodyState *s;
  PetscReal  density, viscosity, bound = PETSC_MAX_REAL, size, sharpest = STREAM_NO_EDGE;
  PetscBool  yes;
  StreamEdge one;

  PetscFunctionBeginUser;
  *cells = PETSC_MAX_REAL;
  *edge  = STREAM_NO_EDGE;
  PetscCall(BodiesGetState(bodies, &s));
  PetscCall(has_layer(&s->group[group], stream, &yes));
  if (!yes) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(StreamPeekFluid(&density, &viscosity));
  for (PetscInt k = 0; k < s->n; k++) {
    if (s->body_group[k] != group || (BodiesGetDisc(s, k) == 0 && BodiesIndexInGroup(s, k) >= FEW)) continue;
    PetscCall(StreamMeasureBody(bodies, k, stream->direction, &size, &one));
    bound    = PetscMin(bound, size);
    sharpest = PetscMax(sharpest, (PetscReal)one);
  }
  PetscCall(BodiesMax(bodies, 1, &sharpest));
  *edge = (StreamEdge)sharpest;
  if (s->group[group].free && *edge == STREAM_LIFTS) *edge = STREAM_NO_EDGE;
  if (s->group[group].free && *edge == STREAM_EDGE_LIFTS) *edge = STREAM_EDGE;
  PetscCall(BodiesMin(bodies, 1, &bound));
  if (bound > 0 && bound < PETSC_MAX_REAL) *cells = PetscSqrtReal(bound * viscosity / (density * stream->speed)) / l->h;
  PetscFunctionReturn(PETSC_SUCCESS);
}
