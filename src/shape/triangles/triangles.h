/* Surfaces of triangles, for the files of this folder; what plugins see of them is at the end of shape.h.
   read.c, read_stl.c, read_ply.c, read_text.c: from a file to corners. join.c: vertices, edges, normals, the tree of
   boxes. closest.c: distance. winding.c: winding number. check.c: what a closed surface must be. repair.c, close.c,
   cut.c: what `robust` does with one that is not. triangles.c: all of it together. */
#pragma once
#include "base/algebra.h"
#include "shape.h"

#define TRI_MAX   2000000 /* triangles */
#define TRI_LEAF  4       /* triangles in a leaf of the tree */
#define TRI_DEPTH 64      /* of the tree: halves, so more than enough */
#define TRI_WHY   1024    /* characters of a message */
/* Errors are text until all ranks can raise them. */
#define TRI_SAY(...) PetscCall(PetscSNPrintf(error, TRI_WHY, __VA_ARGS__))

typedef PetscReal Vec3[3];
typedef PetscInt  Int3[3];

typedef struct {
  Vec3     lower, upper;
  PetscInt first, count; /* triangles of a leaf; count 0: children are the next node and `first` */
} TriNode;

typedef struct {
  PetscInt  n, nvertex, nnode; /* triangles, vertices, nodes of the tree */
  Int3     *triangle;          /* [n] vertices, counter-clockwise seen from outside */
  Int3     *next;              /* [n] the triangle beyond the edge from corner e to e + 1, or NULL */
  Vec3     *x;                 /* [nvertex] */
  Vec3     *face, *corner;     /* [n] unit normals, zero without area; [nvertex] weighted by angles, or NULL */
  TriNode  *node;
  PetscReal radius, area;
} Surface;

/* Expansion of the winding number of the triangles under a node about `centre` (Barill et al. 2018): integrals of n,
   of (n d) and of (n d d), d from the centre, of which only what the formula takes is kept */
typedef struct {
  Vec3      centre;
  PetscReal radius;               /* of the node about its centre */
  PetscReal n[3], trace, nd[6];   /* nd: symmetric part, xx yy zz xy xz yz */
  PetscReal ndd[10], contract[3]; /* ndd: xxx yyy zzz xxy xxz xyy yyz xzz yzz xyz, as often as it occurs */
} Moment;

/* What is wrong with a surface that is taken as it is */
typedef struct {
  PetscInt  open, holes, crowded, turned, duplicate, sheets, crossings, welded;
  PetscReal differ;     /* share of the inside that depends on how holes are closed, unless small */
  PetscBool unfinished; /* a text file without its last line */
} Faults;

struct _p_Triangles {
  char      file[PETSC_MAX_PATH_LEN], prefix[128];
  PetscReal scale;
  Vec3      origin, lower, upper; /* of the body and the box, in coordinates of the file */
  PetscBool robust;
  Surface   f;      /* what bounds the body */
  Surface   all;    /* robust: all triangles and those that close holes; their winding number is the sign */
  Moment   *moment; /* robust: [all.nnode] */
  Faults    fault;
};

/* ---- read.c ---- */

/* Corners xyz [n][3][3] of a file; *unfinished: see Faults. What is wrong is left in `error`. Not collective. */
PetscErrorCode TrianglesReadFile(const char file[], PetscInt *n, PetscReal **xyz, PetscBool *unfinished, char error[]);

/* ---- join.c ---- */

/* Vertices and triangles from n corners: equal corners are one vertex, triangles that lose a corner are dropped. */
PetscErrorCode SurfaceJoinCorners(Surface *, PetscInt n, const PetscReal xyz[], PetscReal scale);
typedef struct {
  PetscInt low, high, side; /* vertices; 3 triangle + edge */
} TriEdge;
/* All edges of all triangles, [3 n], sorted: those of the same vertices follow one another. Free with PetscFree. */
PetscErrorCode SurfaceGetEdges(const Surface *, TriEdge **);
/* Does the triangle run along its edge from the lower vertex to the higher? */
static inline PetscBool TriEdgeIsUp(const Surface *f, const TriEdge *e)
{
  return (PetscBool)(f->triangle[e->side / 3][e->side % 3] == e->low);
}
PetscErrorCode SurfaceMakeNormals(Surface *, PetscBool corners);
/* The tree of boxes; puts the triangles into the order of its leaves. */
PetscErrorCode SurfaceBuildTree(Surface *);
/* Integrals of 1, x_a and x_a x_b (xx yy zz xy xz yz) over the inside: sums over the tetrahedra between the origin and
   the triangles */
void           SurfaceAddMoments(const Surface *, PetscReal *volume, Vec3 first, PetscReal second[6]);
PetscErrorCode SurfaceDestroy(Surface *);

/* ---- closest.c ---- */

typedef struct { /* closest point of a triangle or the surface */
  PetscReal square;
  Vec3      y;
  PetscInt  triangle, feature; /* 0: face, 1..3: edge from corner f - 1, 4..6: corner f - 4 */
} Closest;

/* Closest point to x; *guess: a triangle that may be close, then the closest one. */
void SurfaceFindClosest(const Surface *, const Vec3 x, PetscInt *guess, Closest *);
/* Signed distance of one point by the normal of the closest feature, and if g is not NULL its gradient. Needs next. */
PetscReal SurfaceMeasure(const Surface *, const Vec3 x, PetscInt *guess, PetscReal g[]);

/* ---- winding.c ---- */

/* How often the surface winds around x: the solid angles of its triangles, exact and slow */
PetscReal      SurfaceWinding(const Surface *, const Vec3 x);
PetscReal      TriangleWinding(const Vec3 p, const Vec3 q, const Vec3 r, const Vec3 x);
PetscErrorCode SurfaceMakeMoments(const Surface *, Moment **);
/* The same by the expansions of far nodes: within 5e-3 */
PetscReal SurfaceWindingFast(const Surface *, const Moment[], const Vec3 x);

/* ---- check.c ---- */

/* Two triangles on every edge, which run along it in opposite directions; fills next. Else what is wrong in `error`. */
PetscErrorCode TrianglesJoinEdges(Triangles, char error[]);
/* Faces outwards, crosses itself nowhere, winds once around its inside. Needs tree, normals, next. */
PetscErrorCode TrianglesCheck(Triangles, char error[]);

/* ---- robust ---- */

/* Makes t->all of t->f as it was joined, in coordinates of the file times scale: welds, turns and closes; counts. */
PetscErrorCode TrianglesRepair(Triangles, char error[]);
/* Appends to the surface the triangles that close its holes. *loops: how many, *edges: of how many edges. */
PetscErrorCode SurfaceCloseHoles(Surface *, PetscInt *loops, PetscInt *edges);
/* Cuts a polygon, corners [n] of x, into n - 2 triangles, corners of x as well. */
PetscErrorCode PolygonSplit(const Vec3 x[], PetscInt n, const PetscInt corner[], Int3 triangle[]);
/* Makes t->f of t->all, which needs a tree and moments: the parts of triangles with the inside on one side only,
   outwards. Collective. */
PetscErrorCode TrianglesCut(Triangles, char error[]);

static inline void subtract3(const PetscReal a[3], const PetscReal b[3], PetscReal c[3])
{
  for (int i = 0; i < 3; i++) c[i] = a[i] - b[i];
}

/* Not of unit length: twice the area */
static inline void triangle_normal(const PetscReal p[3], const PetscReal q[3], const PetscReal r[3], PetscReal n[3])
{
  PetscReal e[3], g[3];

  subtract3(q, p, e);
  subtract3(r, p, g);
  cross(e, g, n);
}
