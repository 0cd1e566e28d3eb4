/* Shape, triangles: a triangulation of its surface in space, for pictures (see shape.h). Marching tetrahedra (Doi &
   Koide 1991) over the cells of the tree, corners projected onto the surface. */
#include "compat.h"
#include "guard.h"
#include "tree.h"
#include "base/array.h"
#include <stdlib.h>

typedef struct {
  PetscInt64 key;  /* of the grid edge */
  PetscInt   slot; /* corner of a triangle */
  PetscReal  x[3];
} Cut;

typedef struct {
  PetscInt n, capacity; /* cuts, three a triangle */
  Cut     *cut;
} Cuts;

/* Corners of the tetrahedra of a cell, as bit patterns; bits are nested along every edge */
static const int TETRAHEDRON[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                                      {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};

/* The cut of the edge between corners a and b of a cell; x, d: its corners */
static void cut_edge(const Tree *t, const PetscInt cell[], const PetscReal x[], const PetscReal d[], int a, int b,
                     Cut *cut)
{
  const int        low = PetscMin(a, b), high = PetscMax(a, b);
  const PetscReal  at  = d[low] / (d[low] - d[high]);
  const PetscInt64 m   = ((PetscInt64)1 << t->level) + 1;
  PetscInt64       key = 0;

  for (int e = 2; e >= 0; e--) key = key * m + cell[e] + (low >> e & 1);
  cut->key = key * 8 + (low ^ high);
  for (int e = 0; e < 3; e++) cut->x[e] = x[3 * low + e] + at * (x[3 * high + e] - x[3 * low + e]);
}

/* A triangle, turned so that its normal points to `outside` */
static PetscErrorCode add_triangle(Cuts *c, Cut corner[3], const PetscReal outside[])
{
  PetscReal e[2][3], r[3], turn;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) {
    e[0][a] = corner[1].x[a] - corner[0].x[a];
    e[1][a] = corner[2].x[a] - corner[0].x[a];
    r[a]    = outside[a] - corner[0].x[a];
  }
  turn = r[0] * (e[0][1] * e[1][2] - e[0][2] * e[1][1]) + r[1] * (e[0][2] * e[1][0] - e[0][0] * e[1][2]) +
         r[2] * (e[0][0] * e[1][1] - e[0][1] * e[1][0]);
  PetscCall(ArrayReserve(c->n + 3, &c->capacity, &c->cut, sizeof(*c->cut), NULL));
  for (PetscInt i = 0; i < 3; i++) {
    c->cut[c->n]      = corner[turn < 0 ? 2 - i : i];
    c->cut[c->n].slot = c->n;
    c->n++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode cut_tetrahedron(const Tree *t, const PetscInt cell[], const PetscReal x[], const PetscReal d[],
                                      const int corner[4], Cuts *c)
{
  int in[4], out[4], nin = 0, nout = 0;
  Cut p[4];

  PetscFunctionBeginUser;
  for (int i = 0; i < 4; i++) {
    if (d[corner[i]] < 0) in[nin++] = corner[i];
    else out[nout++] = corner[i];
  }
  if (!nin || !nout) PetscFunctionReturn(PETSC_SUCCESS);
  if (nin == 2) { /* around the quadrilateral */
    cut_edge(t, cell, x, d, in[0], out[0], p);
    cut_edge(t, cell, x, d, in[0], out[1], p + 1);
    cut_edge(t, cell, x, d, in[1], out[1], p + 2);
    cut_edge(t, cell, x, d, in[1], out[0], p + 3);
    PetscCall(add_triangle(c, p, x + 3 * out[0]));
    p[1] = p[0];
    PetscCall(add_triangle(c, p + 1, x + 3 * out[1]));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (int i = 0; i < 3; i++) cut_edge(t, cell, x, d, in[nin == 1 ? 0 : i], out[nin == 1 ? i : 0], p + i);
  PetscCall(add_triangle(c, p, x + 3 * out[0]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode cut_cells(const Tree *t, Cuts *c)
{
  PetscReal x[SHAPE_CHUNK * 8 * 3], d[SHAPE_CHUNK * 8];

  PetscFunctionBeginUser;
  c->n = 0;
  for (PetscInt start = 0; start < t->n; start += SHAPE_CHUNK) {
    const PetscInt m = PetscMin(SHAPE_CHUNK, t->n - start);

    PetscCall(TreeEvaluateCorners(t, m, t->cell + start * 3, x, d));
    for (PetscInt i = 0; i < m; i++)
      for (PetscInt k = 0; k < 6; k++)
        PetscCall(cut_tetrahedron(t, t->cell + (start + i) * 3, x + i * 24, d + i * 8, TETRAHEDRON[k], c));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int compare_cuts(const void *a, const void *b)
{
  const Cut *p = a, *q = b;

  return p->key < q->key ? -1 : p->key > q->key ? 1 : p->slot < q->slot ? -1 : 1;
}

/* Triangles that share an edge of the grid share a point */
static PetscErrorCode join_cuts(Shape s, Cuts *c, PetscInt *npoint, PetscReal *x[], PetscInt *ntriangle,
                                PetscInt *triangle[])
{
  PetscFunctionBeginUser;
  qsort(c->cut, c->n, sizeof(Cut), compare_cuts);
  PetscCall(PetscMalloc1(3 * c->n, x));
  PetscCall(PetscMalloc1(c->n, triangle));
  *npoint = 0;
  for (PetscInt i = 0; i < c->n; i++) {
    if (i == 0 || c->cut[i].key != c->cut[i - 1].key) PetscCall(PetscArraycpy(*x + 3 * (*npoint)++, c->cut[i].x, 3));
    (*triangle)[c->cut[i].slot] = *npoint - 1;
  }
  *ntriangle = c->n / 3;
  PetscCall(ShapeProject(s, *npoint, *x, *x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Volume inside of triangles */
static PetscReal get_volume(const PetscReal x[], PetscInt ntriangle, const PetscInt triangle[])
{
  PetscReal v = 0;

  for (PetscInt i = 0; i < ntriangle; i++) {
    const PetscReal *a = x + 3 * triangle[3 * i], *b = x + 3 * triangle[3 * i + 1], *d = x + 3 * triangle[3 * i + 2];

    v += a[0] * (b[1] * d[2] - b[2] * d[1]) + a[1] * (b[2] * d[0] - b[0] * d[2]) + a[2] * (b[0] * d[1] - b[1] * d[0]);
  }
  return v / 6;
}

/* The cells of one level */
static PetscErrorCode draw_cells(Shape s, Tree *t, Cuts *c, PetscInt *npoint, PetscReal *x[], PetscInt *ntriangle,
                                 PetscInt *triangle[])
{
  PetscFunctionBeginUser;
  PetscCheck(c->n, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Shape '%s' has no surface to draw: its distance does not change sign on a grid of width %g within its bounding radius %g",
             s->loaded->type, (double)TreeCellWidth(t), (double)s->radius);
  PetscCall(join_cuts(s, c, npoint, x, ntriangle, triangle));
  PetscCall(ShapeSharpen(s, npoint, x, ntriangle, triangle));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeTriangulate(Shape s, PetscInt max, PetscInt *npoint, PetscReal *x[], PetscInt *ntriangle,
                                PetscInt *triangle[])
{
  const PetscInt  last = 7;
  const PetscReal good = 0.98; /* of the volume: parts that the grid misses are not drawn */
  ShapeMass       mass;
  Tree            t;
  Cuts            c = {0, 0, NULL};

  PetscFunctionBeginUser;
  *ntriangle = 0;
  if (s->ops.triangles) GUARDED(s, triangles, (s, max, npoint, x, ntriangle, triangle));
  if (*ntriangle) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ShapeGetMass(s, &mass));
  PetscCall(TreeCreate(s, s->radius, 3, &t));
  do {
    PetscCall(TreeRefine(&t));
    PetscCall(cut_cells(&t, &c));
    /* the next level has four times as many */
  } while (t.level < last && (4 * c.n <= 3 * max || !c.n));
  PetscCall(draw_cells(s, &t, &c, npoint, x, ntriangle, triangle));
  while (t.level < last && get_volume(*x, *ntriangle, *triangle) < good * mass.volume) {
    PetscCall(PetscFree(*x));
    PetscCall(PetscFree(*triangle));
    PetscCall(TreeRefine(&t));
    PetscCall(cut_cells(&t, &c));
    PetscCall(draw_cells(s, &t, &c, npoint, x, ntriangle, triangle));
  }
  PetscCall(PetscFree(c.cut));
  PetscCall(TreeDestroy(&t));
  PetscFunctionReturn(PETSC_SUCCESS);
}
