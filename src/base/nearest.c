/* Border: what is near a point; see border.h. Faces are compared with their neighbours alone, and with all that are
   near where a point is behind one: it may be in the domain, beyond a thin wall. */
#include "compat.h"
#include "borderimpl.h"
#include "base/algebra.h"
#include "base/array.h"

#define SAME 1e-9 /* of a distance: two faces are as near */

static PetscReal away(const PetscReal a[3], const PetscReal b[3])
{
  return PetscSqrtReal(PetscSqr(a[0] - b[0]) + PetscSqr(a[1] - b[1]) + PetscSqr(a[2] - b[2]));
}

/* ---- lists ---- */

/* Faces that may be nearer to x than reach, solid or not, to b->list */
static PetscErrorCode list_faces(Border b, const PetscReal x[3], PetscReal reach)
{
  const PetscInt *face;
  Grid            grid;

  PetscFunctionBeginUser;
  b->nlist = 0;
  if (!b->nface) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(NearGridGet(b->near, reach, &grid, &face));
  for (PetscInt e = GridFirst(grid, x); e >= 0; e = GridNext(grid, e)) {
    const PetscInt f  = face[GridItem(grid, e)];
    PetscInt       at = b->nlist;

    if (away(b->face[f].centre, x) - b->face[f].r >= reach) continue;
    PetscCall(ArrayReserve(b->nlist + 1, &b->list_capacity, &b->list, sizeof(*b->list), NULL));
    for (; at > 0 && b->list[at - 1] > f; at--) b->list[at] = b->list[at - 1];
    b->list[at] = f;
    b->nlist++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void nearest_of(Border b, PetscInt f, const PetscReal x[3], FacePoint *p)
{
  FaceNearest(b->dim, (const PetscReal(*)[3])b->face[f].f.x, x, p);
}

/* ---- a circle, a sphere, a cylinder ---- */

static void round_point(Border b, const BorderRound *r, const PetscReal x[3], BorderPoint *p)
{
  const PetscReal side = r->inside ? -1 : 1;
  PetscReal       d[3] = {x[0] - r->centre[0], x[1] - r->centre[1], x[2] - r->centre[2]}, length;

  if (r->axis >= 0) d[r->axis] = 0;
  length = PetscSqrtReal(dot3(d, d));
  if (length <= 0) d[r->axis == 0 ? 1 : 0] = length = 1e-30; /* from the centre all places are as near */
  p->gap = side * (length - r->radius);
  for (PetscInt a = 0; a < 3; a++) {
    p->normal[a] = side * d[a] / length;
    p->x[a]      = x[a] - p->gap * p->normal[a];
  }
  for (PetscInt e = 0; e < 9; e++) {
    const PetscInt i = e / 3, j = e % 3;

    p->K[e] = i == r->axis || j == r->axis || i >= b->dim || j >= b->dim
              ? 0
              : side * ((i == j) - p->normal[i] * p->normal[j]) / r->radius;
  }
}

/* ---- a face ---- */

/* The node that holds the end of the face where a place is: a corner, or the middle of an edge */
static PetscInt end_node(Border b, const FacePoint *p)
{
  return 1 + p->side[0] + (b->dim == 3 ? 3 * (1 + p->side[1]) : 0);
}

static PetscBool is_end(Border b, const FacePoint *p)
{
  return (PetscBool)(p->side[0] || (b->dim == 3 && p->side[1]));
}

/* No place of the neighbours where the face ends is nearer, nor as near on a face before it? */
static PetscBool is_nearest_face(Border b, PetscInt f, const FacePoint *p, const PetscReal x[3])
{
  if (!is_end(b, p)) return PETSC_TRUE;
  for (PetscInt e = b->start[f]; e < b->start[f + 1]; e++) {
    const PetscInt g = b->next[e];
    FacePoint      q;

    if (FaceFindNode(b, &b->face[g], b->face[f].f.node[end_node(b, p)]) < 0) continue;
    nearest_of(b, g, x, &q);
    if (q.distance < (1 - SAME) * p->distance) return PETSC_FALSE;
    if (q.distance <= (1 + SAME) * p->distance && (g < f || !is_end(b, &q))) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

/* The mean of all normals at the end of a face */
static void end_normal(Border b, const Face *f, const FacePoint *p, PetscReal n[3])
{
  for (PetscInt a = 0; a < 3; a++) n[a] = f->normal[end_node(b, p)][a];
}

/* Place p of face f as seen from x. At the free end of a wall, beside an opening, all sides are in the domain. */
static void fill_point(Border b, PetscInt f, const FacePoint *p, const PetscReal x[3], BorderPoint *point)
{
  const Face *face = &b->face[f];
  PetscReal   n[3], d[3], side;

  FaceNormal(b->dim, p, point->normal);
  for (PetscInt a = 0; a < 3; a++) {
    point->x[a] = p->x[a];
    point->normal[a] *= face->turn;
    n[a] = point->normal[a];
    d[a] = x[a] - p->x[a];
  }
  if (is_end(b, p)) end_normal(b, face, p, n);
  side       = is_end(b, p) && face->open[end_node(b, p)] && b->solid[face->f.boundary] ? 1 : dot3(d, n) < 0 ? -1 : 1;
  point->gap = side * p->distance;
  for (PetscInt e = 0; e < 9; e++) point->K[e] = 0;
  if (!is_end(b, p)) FaceCurvature(b->dim, p, point->normal, point->K);
  for (PetscInt a = 0; a < 3 && is_end(b, p) && p->distance > 0; a++) point->normal[a] = side * d[a] / p->distance;
}

/* Is no other face that is listed nearer to x? */
static PetscBool is_nearest(Border b, PetscReal distance, const PetscReal x[3])
{
  FacePoint q;

  for (PetscInt i = 0; i < b->nlist; i++) {
    const Face *f = &b->face[b->list[i]];

    if (away(f->centre, x) - f->r >= distance) continue;
    nearest_of(b, b->list[i], x, &q);
    if (q.distance < (1 - SAME) * distance) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

/* ---- questions ---- */

PetscErrorCode BorderFindNear(Border b, const PetscReal x[3], PetscReal reach, PetscInt *n, const PetscInt *list[])
{
  BorderPoint p;

  PetscFunctionBeginUser;
  b->question++;
  b->nfound = 0;
  for (PetscInt i = 0; i < b->nround; i++) {
    if (!b->solid[b->round[i].boundary]) continue;
    round_point(b, &b->round[i].r, x, &p);
    if (p.gap < reach) b->found[b->nfound++] = i;
  }
  PetscCall(list_faces(b, x, reach));
  for (PetscInt i = 0; i < b->nlist; i++) {
    const PetscInt piece = b->face[b->list[i]].piece;
    PetscInt       at    = b->nfound;

    if (piece < 0 || b->asked[piece] == b->question) continue;
    b->asked[piece] = b->question;
    for (; at > 0 && b->found[at - 1] > piece; at--) b->found[at] = b->found[at - 1];
    b->found[at] = piece;
    b->nfound++;
  }
  *n    = b->nfound;
  *list = b->found;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderTouch(Border b, PetscInt piece, const PetscReal x[3], PetscReal reach, PetscInt *n,
                           BorderPoint point[])
{
  FacePoint p;

  PetscFunctionBeginUser;
  *n = 0;
  if (piece < b->nround) {
    round_point(b, &b->round[piece].r, x, point);
    *n = point->gap < reach;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(list_faces(b, x, reach));
  for (PetscInt i = 0; i < b->nlist && *n < BORDER_TOUCHES; i++) {
    const PetscInt f = b->list[i];

    if (b->face[f].piece != piece) continue;
    nearest_of(b, f, x, &p);
    if (p.distance >= reach || !is_nearest_face(b, f, &p, x)) continue;
    fill_point(b, f, &p, x, &point[*n]);
    if (point[*n].gap >= 0 || is_nearest(b, p.distance, x)) (*n)++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of the faces that are listed, the one of a piece (-1: any) that is nearest to x, -1: none nearer than reach */
static PetscInt find_nearest(Border b, PetscInt piece, const PetscReal x[3], PetscReal reach, FacePoint *p)
{
  PetscInt best = -1;

  for (PetscInt i = 0; i < b->nlist; i++) {
    const Face *f = &b->face[b->list[i]];
    FacePoint   q;

    if ((piece >= 0 && f->piece != piece) || away(f->centre, x) - f->r >= (best < 0 ? reach : p->distance)) continue;
    nearest_of(b, b->list[i], x, &q);
    if (q.distance >= (best < 0 ? reach : p->distance)) continue;
    *p   = q;
    best = b->list[i];
  }
  return best;
}

PetscErrorCode BorderTouchPoints(Border b, PetscInt piece, const PetscReal c[3], PetscReal radius, PetscReal reach,
                                 PetscInt n, const PetscReal x[][3], BorderPoint point[])
{
  FacePoint p;

  PetscFunctionBeginUser;
  if (piece >= b->nround) PetscCall(list_faces(b, c, radius + reach));
  for (PetscInt i = 0; i < n; i++) {
    PetscInt f;

    if (piece < b->nround) {
      round_point(b, &b->round[piece].r, x[i], &point[i]);
      continue;
    }
    point[i].gap = PETSC_MAX_REAL;
    f            = find_nearest(b, piece, x[i], radius + reach, &p);
    if (f < 0 || !is_nearest_face(b, f, &p, x[i])) continue;
    fill_point(b, f, &p, x[i], &point[i]);
    if (point[i].gap >= reach || (point[i].gap < 0 && !is_nearest(b, p.distance, x[i]))) point[i].gap = PETSC_MAX_REAL;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderNearest(Border b, PetscInt piece, const PetscReal x[3], PetscReal reach, BorderPoint *point)
{
  FacePoint p;
  PetscInt  f;

  PetscFunctionBeginUser;
  point->gap = PETSC_MAX_REAL;
  if (piece < b->nround) {
    round_point(b, &b->round[piece].r, x, point);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(list_faces(b, x, reach));
  f = find_nearest(b, piece, x, reach, &p);
  if (f >= 0) fill_point(b, f, &p, x, point);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderLocate(Border b, const PetscReal x[3], PetscReal reach, PetscInt *boundary, PetscReal *gap)
{
  BorderPoint point;
  FacePoint   p;
  PetscInt    f;

  PetscFunctionBeginUser;
  *boundary = -1;
  *gap      = PETSC_MAX_REAL;
  for (PetscInt i = 0; i < b->nround; i++) {
    round_point(b, &b->round[i].r, x, &point);
    if (point.gap >= PetscMin(reach, *gap)) continue;
    *gap      = point.gap;
    *boundary = b->round[i].boundary;
  }
  if (!b->nface) PetscFunctionReturn(PETSC_SUCCESS);
  if (reach < PETSC_MAX_REAL) PetscCall(list_faces(b, x, reach));
  else {
    PetscCall(ArrayReserve(b->nface, &b->list_capacity, &b->list, sizeof(*b->list), NULL));
    for (b->nlist = 0; b->nlist < b->nface; b->nlist++) b->list[b->nlist] = b->nlist;
  }
  f = find_nearest(b, -1, x, reach, &p);
  if (f < 0) PetscFunctionReturn(PETSC_SUCCESS);
  fill_point(b, f, &p, x, &point);
  if (is_end(b, &p) && b->face[f].open[end_node(b, &p)]) { /* where a wall ends at an opening, too */
    PetscReal n[3];

    end_normal(b, &b->face[f], &p, n);
    for (PetscInt a = 0; a < 3; a++) n[a] *= x[a] - p.x[a];
    point.gap = n[0] + n[1] + n[2] < 0 ? -p.distance : p.distance;
  }
  *gap      = point.gap;
  *boundary = b->face[f].f.boundary;
  PetscFunctionReturn(PETSC_SUCCESS);
}
