/* Contact, walls: the sides of a box in closed form, walls 0 to 5, and the pieces of a border (base/border.h) from 6
   on. Discs touch a piece where it is nearest, or in two places where it bends towards them; of other shapes each
   surface point does where the piece is nearest to it. Walls stay where they are: what a wall has of velocity is
   along it. */
#include "compat.h"
#include "impl.h"

#define BELT (2 * CONTACT_SKIN) /* beyond the horizon in which gaps to pieces are known, in radii */

PetscErrorCode ContactSetWalls(Contact c, const ContactWalls *walls)
{
  PetscFunctionBeginUser;
  c->domain.wall = *walls;
  c->list.valid  = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Boundary of the border that a wall is part of, -1: it has no name there */
static PetscErrorCode find_boundary(Contact c, PetscInt wall, PetscInt *boundary)
{
  PetscFunctionBeginUser;
  *boundary = -1;
  if (c->domain.wall.border && wall < CONTACT_SIDES) *boundary = c->domain.wall.side[wall];
  if (wall >= CONTACT_SIDES) PetscCall(BorderGetBoundary(c->domain.wall.border, wall - CONTACT_SIDES, boundary));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetWallName(Contact c, PetscInt wall, const char **name)
{
  PetscInt boundary;

  PetscFunctionBeginUser;
  *name = wall < CONTACT_SIDES ? DOMAIN_SIDE[wall] : "";
  PetscCall(find_boundary(c, wall, &boundary));
  if (boundary >= 0) PetscCall(BorderGetName(c->domain.wall.border, boundary, name));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactViewWalls(Contact c, PetscViewer viewer)
{
  PetscInt    n = 0, boundary, last = -1;
  PetscBool   any = PETSC_FALSE;
  const char *name;

  PetscFunctionBeginUser;
  if (c->domain.wall.border) PetscCall(BorderGetPieces(c->domain.wall.border, &n));
  for (PetscInt w = 0; w < CONTACT_SIDES + n; w++) {
    PetscBool solid = PETSC_TRUE;

    if (w < CONTACT_SIDES && !(c->domain.sides >> w & 1)) continue;
    PetscCall(find_boundary(c, w, &boundary));
    if (w >= CONTACT_SIDES) PetscCall(BorderIsSolid(c->domain.wall.border, boundary, &solid));
    if (!solid || (w >= CONTACT_SIDES && boundary == last)) continue;
    last = boundary;
    any  = PETSC_TRUE;
    PetscCall(ContactGetWallName(c, w, &name));
    PetscCall(PetscViewerASCIIPrintf(viewer, " %s", name));
  }
  PetscCall(PetscViewerASCIIPrintf(viewer, "%s\n", any ? "" : " none"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactFindWalls(Contact c, PetscInt k, PetscReal reach)
{
  const PetscInt *piece;
  PetscInt        n;

  PetscFunctionBeginUser;
  for (PetscInt face = 0; face < 2 * c->dim; face++) {
    const PetscInt  a = face / 2;
    const PetscReal d = face % 2 ? c->domain.upper[a] - c->x[k][a] : c->x[k][a] - c->domain.lower[a];

    if ((c->domain.sides >> face & 1) && d < reach) PetscCall(ContactAddPair(c, k, -1 - face));
  }
  if (!c->domain.wall.border) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BorderFindNear(c->domain.wall.border, c->x[k], reach, &n, &piece));
  for (PetscInt i = 0; i < n; i++) PetscCall(ContactAddPair(c, k, -1 - CONTACT_SIDES - piece[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactIsNearWall(Contact c, PetscInt i, PetscInt j, PetscReal reach, PetscBool *is_near)
{
  PetscFunctionBeginUser;
  if (ContactIsPiece(j)) {
    BorderPoint point;

    PetscCall(BorderNearest(c->domain.wall.border, ContactPiece(j), c->x[i], reach, &point));
    *is_near = (PetscBool)(point.gap < reach);
  } else {
    const PetscInt face = -1 - j, a = face / 2;

    *is_near = (PetscBool)((face % 2 ? c->domain.upper[a] - c->x[i][a] : c->x[i][a] - c->domain.lower[a]) < reach);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetWallNormal(Contact c, PetscInt i, PetscInt j, PetscReal normal[3])
{
  BorderPoint point;

  PetscFunctionBeginUser;
  normal[0] = normal[1] = normal[2] = 0;
  if (!ContactIsPiece(j)) {
    normal[(-1 - j) / 2] = (-1 - j) % 2 ? -1 : 1;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(
    BorderNearest(c->domain.wall.border, ContactPiece(j), c->x[i], 2 * ContactKind(c, i)->radius + c->horizon, &point));
  if (point.gap < PETSC_MAX_REAL) PetscCall(PetscArraycpy(normal, point.normal, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- touches ---- */

static void fill_touch(const BorderPoint *point, PetscReal radius, Touch *t)
{
  t->gap = point->gap - radius;
  for (PetscInt a = 0; a < 3; a++) {
    t->normal[a] = point->normal[a];
    t->rj[a]     = 0;
  }
}

static PetscErrorCode touch_piece(Contact c, PetscInt i, PetscInt piece, PetscInt *n, Touch t[])
{
  const Kind     *kind = ContactKind(c, i);
  BorderPoint     point[PetscMax(BORDER_TOUCHES, CONTACT_BATCH)];
  const PetscReal reach = c->horizon + BELT * kind->radius;
  PetscReal       x[CONTACT_BATCH][3];

  PetscFunctionBeginUser;
  if (kind->disc > 0) {
    PetscCall(BorderTouch(c->domain.wall.border, piece, c->x[i], kind->disc + reach, n, point));
    for (PetscInt e = 0; e < *n; e++) {
      fill_touch(&point[e], kind->disc, &t[e]);
      for (PetscInt a = 0; a < 3; a++) t[e].ri[a] = -kind->disc * t[e].normal[a];
    }
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  *n = 0;
  for (PetscInt first = 0; first < kind->npoints; first += CONTACT_BATCH) {
    const PetscInt m = PetscMin(CONTACT_BATCH, kind->npoints - first);

    ContactPlacePoints(c, i, first, m, x);
    for (PetscInt p = 0; p < m; p++)
      for (PetscInt a = 0; a < 3; a++) x[p][a] += c->x[i][a];
    PetscCall(BorderTouchPoints(c->domain.wall.border, piece, c->x[i], kind->radius, reach, m, (const PetscReal(*)[3])x,
                                point));
    for (PetscInt p = 0; p < m; p++) {
      if (point[p].gap == PETSC_MAX_REAL) continue;
      for (PetscInt a = 0; a < 3; a++) t[*n].ri[a] = x[p][a] - c->x[i][a];
      fill_touch(&point[p], 0, &t[(*n)++]);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Surface points against the plane */
static PetscInt touch_side(Contact c, PetscInt i, PetscInt face, Touch t[])
{
  const Kind     *kind = ContactKind(c, i);
  const PetscInt  a    = face / 2;
  const PetscReal sign = face % 2 ? -1 : 1, wall = face % 2 ? c->domain.upper[a] : c->domain.lower[a];
  PetscReal       r[CONTACT_BATCH][3];

  for (PetscInt first = 0; first < kind->npoints; first += CONTACT_BATCH) {
    const PetscInt m = PetscMin(CONTACT_BATCH, kind->npoints - first);

    ContactPlacePoints(c, i, first, m, r);
    for (PetscInt p = 0; p < m; p++) {
      Touch *touch = &t[first + p];

      touch->gap = sign * (c->x[i][a] + r[p][a] - wall);
      for (PetscInt b = 0; b < 3; b++) {
        touch->ri[b]     = r[p][b];
        touch->normal[b] = b == a ? sign : 0;
        touch->rj[b]     = 0;
      }
    }
  }
  return kind->npoints;
}

PetscErrorCode ContactTouchWall(Contact c, PetscInt i, PetscInt j, PetscInt *n, Touch t[])
{
  PetscFunctionBeginUser;
  if (ContactIsPiece(j)) PetscCall(touch_piece(c, i, ContactPiece(j), n, t));
  else *n = touch_side(c, i, -1 - j, t);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactPlaceOnWall(Contact c, PetscInt i, PetscInt j, const PetscReal r[3], PetscReal *gap,
                                  PetscReal normal[3], PetscReal K[9])
{
  const PetscReal x[3] = {c->x[i][0] + r[0], c->x[i][1] + r[1], c->x[i][2] + r[2]};

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(K, 9));
  if (ContactIsPiece(j)) {
    BorderPoint point;

    PetscCall(BorderNearest(c->domain.wall.border, ContactPiece(j), x, ContactKind(c, i)->radius + c->horizon, &point));
    *gap = point.gap;
    if (point.gap == PETSC_MAX_REAL) PetscCall(PetscMemzero(&point, sizeof(point)));
    PetscCall(PetscArraycpy(normal, point.normal, 3));
    PetscCall(PetscArraycpy(K, point.K, 9));
  } else {
    const PetscInt face = -1 - j, a = face / 2;

    PetscCall(PetscArrayzero(normal, 3));
    normal[a] = face % 2 ? -1 : 1;
    *gap      = normal[a] * (x[a] - (face % 2 ? c->domain.upper[a] : c->domain.lower[a]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetWallVelocity(Contact c, PetscInt j, const PetscReal x[3], const PetscReal normal[3],
                                      PetscReal v[3])
{
  PetscReal point[3] = {0, 0, 0}, along;
  PetscInt  boundary = -1;

  PetscFunctionBeginUser;
  v[0] = v[1] = v[2] = 0;
  if (!c->domain.wall.velocity) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_boundary(c, -1 - j, &boundary));
  if (boundary < 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < c->dim; a++) point[a] = DomainWrap(c->domain.period[a], x[a], c->domain.lower[a]);
  PetscCall(c->domain.wall.velocity(c->domain.wall.context, boundary, point, v));
  along = dot3(v, normal);
  for (PetscInt a = 0; a < 3; a++) v[a] -= along * normal[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the start ---- */

PetscErrorCode ContactCheckInside(Contact c)
{
  const BodyArrays *s = c->s;

  PetscFunctionBeginUser;
  if (!c->domain.wall.border) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g = BodiesGetGroup(c->state, k);
    PetscInt         boundary;
    PetscReal        gap;
    const char      *name;

    if (!s->own[k] || s->removed[k] || g->obstacle || g->body_fitted) continue;
    PetscCall(BorderLocate(c->domain.wall.border, s->x[k], PETSC_MAX_REAL, &boundary, &gap));
    if (boundary < 0 || gap >= 0) continue;
    PetscCall(BorderGetName(c->domain.wall.border, boundary, &name));
    SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
            "Body %" PetscInt_FMT
            " of group '%s' starts outside the domain: its centre %g,%g,%g lies %g beyond boundary '%s': move the body (-particle_%s_*), make it an obstacle "
            "(-particle_%s_obstacle), or, if it is the body behind that boundary, give it its shape and place, alone in its group",
            BodiesIndexInGroup(c->state, k), g->name, (double)s->x[k][0], (double)s->x[k][1], (double)s->x[k][2],
            (double)-gap, name, g->name, g->name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
