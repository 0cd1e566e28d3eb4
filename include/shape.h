/* Shapes: the geometry of a rigid body.

   A shape answers "inside or outside, how far, which normal" for batches of points in its own body frame. One C file is
   one shape is one shared object, found by type name ("circle" -> circle.so) in the folders of -shape_path.
   This header is all that a plugin includes; what the program asks of shapes beyond it is in shape/host.h.

   Conventions: points are stored [n][dim] (dim = 2 or 3), lengths are in the length unit of the scene (any consistent
   unit), the body frame is fixed to the body; its origin is wherever the plugin puts it (the centroid need not be
   there). Signed distance: negative inside, zero on the surface, positive outside; exact sign everywhere; Euclidean
   near the surface; 1-Lipschitz. The plugin never sees time, position, mesh or other bodies. */
#pragma once
#include "compat.h"

/* Changes when ShapeOps or ShapePlugin change. A plugin built for 1, before there was `corners`, or for 2, before
   `triangles` and `reach`, is loaded as one without them; one built for another number is refused. */
#define SHAPE_INTERFACE 3

#define SHAPE_POSITIVE 2.2250738585072014e-308 /* as lower bound of an option: must be > 0 */

typedef struct _p_Shape *Shape;

/* The ranks that create shapes together, and so agree on what is wrong with a plugin or a file: those of the run, which
   a program sets (base/runcomm.h). Not collective. */
MPI_Comm ShapeComm(void);

/* Mass properties for unit density. In 2D per unit depth. */
typedef struct {
  PetscReal volume;      /* area in 2D, volume in 3D */
  PetscReal centroid[3]; /* in the body frame; unused components zero */
  PetscReal inertia[6];  /* about the centroid, xx yy zz xy xz yz of the integral of |r|^2 I - r r^T;
                            2D: only zz (polar second moment of area) */
} ShapeMass;

/* Operations of a plugin. NULL means "use the default" where a default exists. All are deterministic and must
   accept n = 0. create, options and setup run inside ShapeCreate on every rank of ShapeComm and may communicate there;
   all others are not collective. `data` memory belongs to the plugin: allocate in create, free in destroy (which also
   runs when options or setup failed). */
typedef struct {
  PetscErrorCode (*create)(Shape);  /* optional: allocate data, set defaults */
  PetscErrorCode (*options)(Shape); /* optional: read options with ShapeOption*() */
  PetscErrorCode (*setup)(Shape);   /* optional: derived data, after options */
  /* REQUIRED: x [n][dim] -> d [n] */
  PetscErrorCode (*distance)(Shape, PetscInt n, const PetscReal x[], PetscReal d[]);
  PetscErrorCode (*radius)(Shape, PetscReal *r); /* REQUIRED: all surface points have |x| <= r */
  /* optional: grad d, unit, outward [n][dim]; default central differences */
  PetscErrorCode (*normal)(Shape, PetscInt n, const PetscReal x[], PetscReal normal[]);
  PetscErrorCode (*mass)(Shape, ShapeMass *m); /* optional; default adaptive quadrature of the distance */
  /* optional: n points on the surface [n][dim], counter-clockwise in 2D, with weights w [n] that add up to the
     perimeter (area in 3D); default by projection */
  PetscErrorCode (*surface)(Shape, PetscInt n, PetscReal x[], PetscReal w[]);
  PetscErrorCode (*view)(Shape, PetscViewer); /* optional: one line of parameters, ASCII */
  PetscErrorCode (*destroy)(Shape);           /* optional: free data */
  /* optional: *n = number of points of the surface where its normal jumps (3D: where edges meet), of which the first
     `max` go to x [max][dim]; outline corners that turn by less than 26 degrees are none. Default 2D: found on the
     outline; 3D: none are known */
  PetscErrorCode (*corners)(Shape, PetscInt max, PetscInt *n, PetscReal x[]);
  /* optional, 3D: the surface as it is to be drawn, points [*npoint][3] and triangles [*ntriangle][3], outwards, which
     the caller frees with PetscFree; at most about `max` triangles. *ntriangle = 0: the default, which is drawn from
     the distance (triangulate.c) */
  PetscErrorCode (*triangles)(Shape, PetscInt max, PetscInt *npoint, PetscReal *x[], PetscInt *ntriangle,
                              PetscInt *triangle[]);
  /* optional: the largest |x - c| of the surface, c in the body frame; *r = 0: the default, an upper bound within 1e-4
     of it, found from the distance */
  PetscErrorCode (*reach)(Shape, const PetscReal c[], PetscReal *r);
} ShapeOps;

/* The record a plugin exports under the symbol `tumble_shape`. */
typedef struct {
  int         interface;   /* SHAPE_INTERFACE */
  const char *type;        /* "circle": also the file name without .so */
  const char *description; /* one line */
  const char *author;
  const char *version;
  int         dims; /* bit mask: 1 = works in 2D, 2 = works in 3D */
  ShapeOps    ops;
} ShapePlugin;

#if defined(__GNUC__)
  #define SHAPE_EXPORT __attribute__((visibility("default")))
#else
  #define SHAPE_EXPORT
#endif
/* At file scope of a plugin: TUMBLE_SHAPE_REGISTER = { SHAPE_INTERFACE, "circle", ... }; */
#define TUMBLE_SHAPE_REGISTER \
  extern SHAPE_EXPORT const ShapePlugin tumble_shape; \
  SHAPE_EXPORT const ShapePlugin        tumble_shape

/* ---- for plugins ---- */
PetscErrorCode ShapeGetDimension(Shape, PetscInt *dim);
PetscErrorCode ShapeSetData(Shape, void *data);
PetscErrorCode ShapeGetData(Shape, void *data); /* pass the address of a pointer */
/* What its options begin with ("particle_disc_"); owned by the shape. */
PetscErrorCode ShapeGetPrefix(Shape, const char *prefix[]);
/* To be called in setup by a shape whose distance is Euclidean near most of its surface only: elsewhere near it (behind
   a seam, at an edge that was cut) its size is a lower bound. Exact sign and 1-Lipschitz are asked of it too. */
PetscErrorCode ShapeSetBound(Shape);
/* Options of a shape, named without prefix ("radius" becomes -particle_<group>_radius). Range as in opt.h. Not given:
   default stays. */
PetscErrorCode ShapeOptionReal(Shape, const char name[], const char help[], const char unit[], PetscReal lower,
                               PetscReal upper, PetscReal *value);
PetscErrorCode ShapeOptionInt(Shape, const char name[], const char help[], PetscInt lower, PetscInt upper,
                              PetscInt *value);
PetscErrorCode ShapeOptionRealArray(Shape, const char name[], const char help[], const char unit[], PetscReal lower,
                                    PetscReal upper, PetscInt n, PetscReal value[]);
PetscErrorCode ShapeOptionString(Shape, const char name[], const char help[], char value[], size_t len);
/* A string that is the path of a file to read: in a scene it is relative to the scene file. */
PetscErrorCode ShapeOptionPath(Shape, const char name[], const char help[], char value[], size_t len);

/* ---- for programs of your own, and shapes made of others ---- */

/* Load `type` from -shape_path (colon-separated folders; the build's shapes folder and the folder `shapes` beside the
   running library are searched after them), read its options under `prefix` ("particle_disc_"), set it up and check it.
   Collective on PETSC_COMM_WORLD. Errors: type not found (lists the known ones), other interface number, missing symbol
   or operation, option out of range, distance not finite. */
PetscErrorCode ShapeCreate(const char type[], const char prefix[], PetscInt dim, Shape *);
PetscErrorCode ShapeDestroy(Shape *);
PetscErrorCode ShapeDistance(Shape, PetscInt n, const PetscReal x[], PetscReal d[]);    /* x [n][dim] -> d [n] */
PetscErrorCode ShapeNormal(Shape, PetscInt n, const PetscReal x[], PetscReal normal[]); /* -> unit outward [n][dim] */
PetscErrorCode ShapeGetReach(Shape, PetscReal *r); /* bounding radius about the body origin */
PetscErrorCode ShapeGetMass(Shape, ShapeMass *m);  /* cached */
/* The surface as it is drawn, 3D: points *x [*npoint][3] on it and *triangle [*ntriangle][3], normals outward; at most
   `max` triangles, but more where so few would miss parts of a thin shape. Free them with PetscFree. Error: no surface
   found. */
PetscErrorCode ShapeTriangulate(Shape, PetscInt max, PetscInt *npoint, PetscReal *x[], PetscInt *ntriangle,
                                PetscInt *triangle[]);
/* Close the shared objects; called before PetscFinalize. */
PetscErrorCode ShapeFinalize(void);
/* Declare what all plugins of the search path read, under the prefix particle_<group>_, for -help. Collective. */
PetscErrorCode ShapeDeclareOptions(void);

/* ---- for shapes bounded by triangles ---- */

/* A surface of triangles from a file: STL (text of any case and binary), OBJ, PLY (text and binary) or OFF; what the
   file holds decides, then its extension. Polygons are cut into triangles, equal corners are one vertex, triangles
   without area between equal corners are dropped. The body frame has the axes of the file, times scale.

   closed: the surface must be closed, face outwards and cross itself nowhere; several closed parts are one body, a part
   inside of another that faces inwards is a hollow. Distance: closest point over all triangles by a tree of boxes,
   exact; sign by the normal of the closest feature, which at edges and vertices is the sum of its triangles' normals,
   weighted by their angles (Baerentzen & Aanaes 2005). Volume, centroid and inertia are those of the polyhedron,
   exactly (divergence theorem).

   robust: holes, edges of three triangles, crossings, turned and doubled triangles are taken. A point is inside where
   the winding number exceeds 1/2 (Jacobson, Kavan, Sorkine-Hornung 2013). To know where that is without doubt the
   surface is made a cycle first: corners within 1e-6 of its size (more where it falls apart otherwise, at most 4e-3)
   are welded, neighbours turned alike, inner sheets dropped, and each hole is closed by triangles between its own
   edges. Where the hole is plane these lie exactly where the winding number of the file's triangles is 1/2; elsewhere
   they are as good a choice. The winding number is then a whole number everywhere; it is found by a tree with
   second-order expansions (Barill, Dickson, Schmidt, Levin, Jacobson 2018), within 5e-3. Triangles are cut where they
   cross each other; the body's surface is the pieces with the inside on one side only, and the distance is the exact
   one to these: 1-Lipschitz, Euclidean, its sign changes on them alone. Volume and inertia by the divergence theorem
   over the pieces; where these disagree by more than 1 % with a sample of the sign, by quadrature. A remark tells what
   was wrong. */
typedef struct _p_Triangles *Triangles;

typedef struct {
  const char *file;
  const char *prefix;    /* of the shape's options, for messages */
  PetscReal   scale;     /* factor on the coordinates of the file */
  PetscReal   origin[3]; /* of the body, in coordinates of the file; PETSC_MAX_REAL: the middle of the box */
  PetscBool   robust;
} TrianglesInput;

/* Collective on PETSC_COMM_WORLD; rank 0 reads. Errors: not readable, broken (with line or byte), not closed. */
PetscErrorCode TrianglesRead(const TrianglesInput *, Triangles *);
PetscErrorCode TrianglesDestroy(Triangles *);
/* The operations of a shape; not collective. Surface points: equal areas in the order of the triangles. */
PetscErrorCode TrianglesDistance(Triangles, PetscInt n, const PetscReal x[], PetscReal d[]);
PetscErrorCode TrianglesNormal(Triangles, PetscInt n, const PetscReal x[], PetscReal normal[]);
PetscErrorCode TrianglesRadius(Triangles, PetscReal *r);
PetscErrorCode TrianglesReach(Triangles, const PetscReal c[], PetscReal *r); /* robust only; closed: 0 */
PetscErrorCode TrianglesMass(Triangles, ShapeMass *m);
PetscErrorCode TrianglesSurface(Triangles, PetscInt n, PetscReal x[], PetscReal w[]);
PetscErrorCode TrianglesDraw(Triangles, PetscInt max, PetscInt *npoint, PetscReal *x[], PetscInt *ntriangle,
                             PetscInt *triangle[]);
PetscErrorCode TrianglesView(Triangles, PetscViewer);
