/* Surfaces of triangles: vertices, edges, normals, moments, the tree of boxes. */
#include "compat.h"
#include "triangles.h"
#include <stdlib.h>

/* ---- vertices and edges ---- */

typedef struct {
  Vec3     x;
  PetscInt id;
} Point;

static int compare_points(const void *a, const void *b)
{
  const Point *p = (const Point *)a, *q = (const Point *)b;

  for (int i = 0; i < 3; i++)
    if (p->x[i] != q->x[i]) return p->x[i] < q->x[i] ? -1 : 1;
  return p->id < q->id ? -1 : p->id > q->id;
}

PetscErrorCode SurfaceJoinCorners(Surface *f, PetscInt n, const PetscReal xyz[], PetscReal scale)
{
  Point    *p;
  PetscInt *vertex, kept = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(3 * n, &p, 3 * n, &vertex));
  for (PetscInt i = 0; i < 3 * n; i++) {
    p[i].id = i;
    for (int a = 0; a < 3; a++) p[i].x[a] = xyz[3 * i + a] * scale;
  }
  qsort(p, (size_t)(3 * n), sizeof(*p), compare_points);
  PetscCall(PetscMalloc1(3 * n, &f->x));
  PetscCall(PetscMalloc1(n, &f->triangle));
  for (PetscInt i = 0; i < 3 * n; i++) {
    if (!i || p[i].x[0] != p[i - 1].x[0] || p[i].x[1] != p[i - 1].x[1] || p[i].x[2] != p[i - 1].x[2])
      PetscCall(PetscArraycpy(f->x[f->nvertex++], p[i].x, 3));
    vertex[p[i].id] = f->nvertex - 1;
  }
  for (PetscInt t = 0; t < n; t++) {
    const PetscInt *v = vertex + 3 * t;

    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    PetscCall(PetscArraycpy(f->triangle[kept++], v, 3));
  }
  f->n = kept;
  PetscCall(PetscFree2(p, vertex));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int compare_edges(const void *a, const void *b)
{
  const TriEdge *p = (const TriEdge *)a, *q = (const TriEdge *)b;

  if (p->low != q->low) return p->low < q->low ? -1 : 1;
  if (p->high != q->high) return p->high < q->high ? -1 : 1;
  return p->side < q->side ? -1 : p->side > q->side;
}

PetscErrorCode SurfaceGetEdges(const Surface *f, TriEdge **edges)
{
  TriEdge *e;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(3 * f->n, &e));
  for (PetscInt i = 0; i < 3 * f->n; i++) {
    const PetscInt a = f->triangle[i / 3][i % 3], b = f->triangle[i / 3][(i + 1) % 3];

    e[i] = (TriEdge){PetscMin(a, b), PetscMax(a, b), i};
  }
  qsort(e, (size_t)(3 * f->n), sizeof(*e), compare_edges);
  *edges = e;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- normals and moments ---- */

PetscErrorCode SurfaceMakeNormals(Surface *f, PetscBool corners)
{
  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(f->n, &f->face));
  if (corners) PetscCall(PetscCalloc1(f->nvertex, &f->corner));
  f->area = 0;
  for (PetscInt t = 0; t < f->n; t++) {
    Vec3      e[3], n;
    PetscReal twice;

    for (int i = 0; i < 3; i++) subtract3(f->x[f->triangle[t][(i + 1) % 3]], f->x[f->triangle[t][i]], e[i]);
    cross(e[0], e[1], n);
    twice = PetscSqrtReal(dot3(n, n));
    f->area += 0.5 * twice;
    if (twice <= 0) continue;
    for (int a = 0; a < 3; a++) f->face[t][a] = n[a] / twice;
    for (int i = 0; i < 3 && corners; i++) {
      const PetscReal angle = PetscAtan2Real(twice, -dot3(e[i], e[(i + 2) % 3]));

      for (int a = 0; a < 3; a++) f->corner[f->triangle[t][i]][a] += angle * f->face[t][a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

void SurfaceAddMoments(const Surface *f, PetscReal *volume, Vec3 first, PetscReal second[6])
{
  const int row[6] = {0, 1, 2, 0, 0, 1}, col[6] = {0, 1, 2, 1, 2, 2};

  for (PetscInt t = 0; t < f->n; t++) {
    const PetscReal *p = f->x[f->triangle[t][0]], *q = f->x[f->triangle[t][1]], *r = f->x[f->triangle[t][2]];
    Vec3             n, sum;
    PetscReal        det;

    cross(q, r, n);
    det = dot3(p, n);
    *volume += det / 6;
    for (int a = 0; a < 3; a++) {
      sum[a] = p[a] + q[a] + r[a];
      first[a] += det / 24 * sum[a];
    }
    for (int k = 0; k < 6; k++) {
      const int a = row[k], b = col[k];

      second[k] += det / 120 * (sum[a] * sum[b] + p[a] * p[b] + q[a] * q[b] + r[a] * r[b]);
    }
  }
}

/* ---- tree of bounding boxes ---- */

typedef struct {
  PetscReal key;
  PetscInt  triangle;
} Key;

static int compare_keys(const void *a, const void *b)
{
  const Key *p = (const Key *)a, *q = (const Key *)b;

  return p->key != q->key ? (p->key < q->key ? -1 : 1) : p->triangle < q->triangle ? -1 : p->triangle > q->triangle;
}

/* The node over triangles [first, first + count) of key, which are sorted along the longest side of their box and
   halved. */
static PetscErrorCode build_node(Surface *f, PetscInt first, PetscInt count, Key key[])
{
  TriNode *b    = &f->node[f->nnode++];
  PetscInt axis = 0, half = count / 2;

  PetscFunctionBeginUser;
  for (int a = 0; a < 3; a++) {
    b->lower[a] = PETSC_MAX_REAL;
    b->upper[a] = -PETSC_MAX_REAL;
  }
  for (PetscInt i = 3 * first; i < 3 * (first + count); i++)
    for (int a = 0; a < 3; a++) {
      const PetscReal x = f->x[f->triangle[key[i / 3].triangle][i % 3]][a];

      b->lower[a] = PetscMin(b->lower[a], x);
      b->upper[a] = PetscMax(b->upper[a], x);
    }
  b->first = first;
  b->count = count;
  if (count <= TRI_LEAF) PetscFunctionReturn(PETSC_SUCCESS);
  for (int a = 1; a < 3; a++)
    if (b->upper[a] - b->lower[a] > b->upper[axis] - b->lower[axis]) axis = a;
  for (PetscInt i = first; i < first + count; i++) {
    const PetscInt *v = f->triangle[key[i].triangle];

    key[i].key = f->x[v[0]][axis] + f->x[v[1]][axis] + f->x[v[2]][axis];
  }
  qsort(key + first, (size_t)count, sizeof(*key), compare_keys);
  b->count = 0;
  PetscCall(build_node(f, first, half, key));
  b->first = f->nnode;
  PetscCall(build_node(f, first + half, count - half, key));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SurfaceBuildTree(Surface *f)
{
  Key  *key;
  Int3 *triangle;

  PetscFunctionBeginUser;
  f->nnode = 0;
  PetscCall(PetscFree(f->node));
  PetscCall(PetscMalloc1(2 * f->n, &f->node));
  PetscCall(PetscMalloc2(f->n, &key, f->n, &triangle));
  for (PetscInt t = 0; t < f->n; t++) key[t].triangle = t;
  PetscCall(build_node(f, 0, f->n, key));
  for (PetscInt t = 0; t < f->n; t++) PetscCall(PetscArraycpy(triangle[t], f->triangle[key[t].triangle], 3));
  PetscCall(PetscArraycpy((PetscInt *)f->triangle, (PetscInt *)triangle, 3 * f->n));
  PetscCall(PetscFree2(key, triangle));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SurfaceDestroy(Surface *f)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(f->x));
  PetscCall(PetscFree(f->triangle));
  PetscCall(PetscFree(f->next));
  PetscCall(PetscFree(f->face));
  PetscCall(PetscFree(f->corner));
  PetscCall(PetscFree(f->node));
  f->n = f->nvertex = f->nnode = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}
