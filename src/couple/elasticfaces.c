/* ElasticFaces: see elasticfaces.h. */
#include "compat.h"
#include "elasticfaces.h"
#include "base/algebra.h"
#include "fem/element.h"

#define FIRST 1e-6 /* faces whose middles' distances differ by such a share are as near */
#define BULGE 1.2  /* a face lies in so many times the ball about its middle that holds its nodes */

struct _p_ElasticFaces {
  const SolidsState *s;
  PetscInt          *first;  /* [n + 1] faces of a solid */
  PetscInt          *node;   /* [][9] of all solids */
  PetscReal         *half;   /* [] radius of a ball about the middle node */
  PetscReal         *normal; /* [nnode][3] sum of the unit normals of the faces that meet there */
  const PetscReal   *x;
};

PetscErrorCode ElasticFacesCreate(const SolidsState *s, ElasticFaces *faces)
{
  ElasticFaces b;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->s = s;
  PetscCall(PetscMalloc1(s->n + 1, &b->first));
  b->first[0] = 0;
  for (PetscInt k = 0; k < s->n; k++) b->first[k + 1] = b->first[k] + s->group[s->group_of[k]].mesh.nside;
  PetscCall(PetscMalloc3(9 * b->first[s->n], &b->node, b->first[s->n], &b->half, 3 * s->nnode, &b->normal));
  for (PetscInt k = 0; k < s->n; k++) {
    const SolidMesh *m = &s->group[s->group_of[k]].mesh;

    for (PetscInt e = 0; e < 9 * m->nside; e++) b->node[9 * b->first[k] + e] = s->first[k] + m->side[e];
  }
  *faces = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticFacesDestroy(ElasticFaces *faces)
{
  PetscFunctionBeginUser;
  if (!*faces) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree((*faces)->first));
  PetscCall(PetscFree3((*faces)->node, (*faces)->half, (*faces)->normal));
  PetscCall(PetscFree(*faces));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void points_of(const struct _p_ElasticFaces *b, const PetscInt node[9], PetscReal x[9][3])
{
  for (PetscInt j = 0; j < 9; j++)
    for (PetscInt a = 0; a < 3; a++) x[j][a] = b->x[3 * node[j] + a];
}

static PetscReal distance_of(const PetscReal x[3], const PetscReal y[3])
{
  const PetscReal r[3] = {x[0] - y[0], x[1] - y[1], x[2] - y[2]};

  return PetscSqrtReal(dot3(r, r));
}

void ElasticFacesSet(ElasticFaces b, const PetscReal x[])
{
  b->x = x;
  for (PetscInt i = 0; i < 3 * b->s->nnode; i++) b->normal[i] = 0;
  for (PetscInt f = 0; f < b->first[b->s->n]; f++) {
    const PetscInt *node = b->node + 9 * f;
    PetscReal       p[9][3];

    points_of(b, node, p);
    b->half[f] = 0;
    for (PetscInt j = 0; j < 9; j++) {
      PetscReal n[3];

      FaceNodeNormal(p, j, n);
      for (PetscInt a = 0; a < 3; a++) b->normal[3 * node[j] + a] += n[a];
      b->half[f] = PetscMax(b->half[f], BULGE * distance_of(p[j], p[4]));
    }
  }
}

/* Normal of all faces that meet at a place, on an edge or at a node of the face: between nodes in parts */
static void mean_normal(const struct _p_ElasticFaces *b, const PetscInt node[9], const FacePoint *at, PetscReal n[3])
{
  PetscReal phi[9], dphi[18];

  ElementBasis(2, at->s, phi, dphi);
  for (PetscInt a = 0; a < 3; a++) {
    n[a] = 0;
    for (PetscInt j = 0; j < 9; j++) n[a] += phi[j] * b->normal[3 * node[j] + a];
  }
}

PetscReal ElasticFacesNearest(ElasticFaces b, PetscInt k, const PetscReal p[3], FacePoint *nearest,
                              const PetscInt **face)
{
  PetscReal best  = PETSC_MAX_REAL, n[3], r[3];
  PetscInt  start = b->first[k], which;

  for (PetscInt f = b->first[k]; f < b->first[k + 1]; f++) {
    const PetscReal far = distance_of(p, b->x + 3 * b->node[9 * f + 4]);

    if (far >= (1 - FIRST) * best) continue;
    best  = far;
    start = f;
  }
  which = start;
  best  = PETSC_MAX_REAL;
  for (PetscInt i = b->first[k] - 1; i < b->first[k + 1]; i++) {
    const PetscInt f = i < b->first[k] ? start : i; /* first the one whose middle is nearest */
    PetscReal      x[9][3];
    FacePoint      at;

    if (i == start || distance_of(p, b->x + 3 * b->node[9 * f + 4]) - b->half[f] > best) continue;
    points_of(b, b->node + 9 * f, x);
    FaceNearest(3, x, p, &at);
    if (f != start && !FaceIsNearer(&at, nearest, b->half[f])) continue;
    best     = at.distance;
    which    = f;
    *nearest = at;
  }
  *face = b->node + 9 * which;
  if (nearest->side[0] || nearest->side[1]) mean_normal(b, *face, nearest, n);
  else FaceNormal(3, nearest, n);
  for (PetscInt a = 0; a < 3; a++) r[a] = p[a] - nearest->x[a];
  return dot3(r, n) < 0 ? -best : best;
}

void ElasticFacesGetAreas(ElasticFaces b, const PetscInt face[9], PetscReal area[9])
{
  static const PetscReal SIMPSON[3] = {1 / 3.0, 4 / 3.0, 1 / 3.0}; /* over [-1, 1] */
  PetscReal              p[9][3];

  points_of(b, face, p);
  for (PetscInt j = 0; j < 9; j++) {
    const PetscReal at[2] = {(PetscReal)(j % 3) - 1, (PetscReal)(j / 3) - 1};
    PetscReal       n[3];
    FacePoint       place;

    FaceEvaluate(3, p, at, &place);
    cross(place.t[0], place.t[1], n);
    area[j] = SIMPSON[j % 3] * SIMPSON[j / 3] * PetscSqrtReal(dot3(n, n));
  }
}
