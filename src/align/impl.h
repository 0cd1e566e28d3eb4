/* Inside of the room align; for its files only. fit.c: the fit and its result. cover.c: the cells of thick surfaces.
   repair.c: a staircase of hexahedra that is a surface. place.c: walls, gaps, rings. sides.c: surfaces
   through sides of the domain. corners.c: vertices on corners; edges.c: in space on edges. check.c:
   is it a mesh? levels.c: has one of several sizes room? mend.c: hexahedra that would be too flat. images.c: which
   image of a surface. path.c, graph.c: surfaces thinner than a cell. */
#pragma once
#include "align/align.h"
#include "align/midline.h"
#include "base/array.h"
#include "clearance.h"
#include "fem/element.h"

#define CHUNK       256
#define CLEAR       0.25     /* smallest width of a gap in the mesh, cell sizes */
#define SIDE_CURVED (1 << 6) /* a boundary that is no plane across an axis */
#define NPOINT      27       /* at most: 4 x 4 and 3 x 3 Gauss points, in space 3 x 3 x 3 */

typedef struct {
  PetscInt n, capacity, *i;
} List;

typedef enum {
  NODE_VERTEX,
  NODE_EDGE,
  NODE_FACE, /* in space */
  NODE_CENTRE
} NodeKind;

/* Vertices on the mid-line of a surface, the same on all ranks */
typedef struct {
  PetscInt   n, *id, *index; /* global vertices, ascending, and their places along the path; n = 0: there is none */
  PetscReal *t;              /* [n] in the order of the path: length along the mid-line */
} AlignPath;

/* Slots of a cell: corners in the order of their bits, middles of edges and their ends, faces as 3 x 3 lattices (in the
   plane the one face is the cell), its middle */
typedef struct {
  PetscInt dim, ncorner, nedge, nface, centre;
  PetscInt edge[12], end[12][2], face[6][9];
} AlignCell;

/* The mesh before nodes move */
typedef struct {
  AlignCell  cell;
  NodeKind  *kind;   /* [nnode_all] */
  PetscInt  *side;   /* [nnode_all] sides of the domain it is on: bits 2 axis + (upper one), SIDE_CURVED */
  PetscReal *size;   /* [nnode_all] AlignNodeSize() */
  PetscBool *held;   /* [nnode_all] AlignHold() */
  PetscInt   npoint; /* of the check */
  PetscReal  dphi[NPOINT][3 * MESH_MAX_NB], weight[NPOINT];
} AlignGrid;

/* Periodic images, images.c */
typedef struct {
  PetscBool periodic, wide; /* are there periods? surfaces at least as wide as one? */
  PetscInt *copy;           /* [nnode_all] with wide: of wall nodes, 1 + their periods as in AlignCopyOf */
  PetscInt *joined;         /* [n] bits of the axes along which it is one with its images */
} AlignImages;

/* What a fit counts for every surface [n] */
typedef struct {
  PetscInt  *flags;  /* [3 n], see AlignCheckCells */
  PetscReal *area;   /* (volume) of the covered cells and of what the walls were drawn back */
  PetscReal *lost;   /* area that its walls were drawn back */
  PetscInt  *passes; /* bits of the sides of the domain that it passes through */
  PetscInt  *stray;  /* nodes on sides for which there was no place on the surface */
  PetscReal *inside; /* volume within the domain */
  PetscBool *could;  /* aligned, but for its patience */
} AlignTally;

/* Vertices on corners of surfaces; in space, wall vertices at their edges */
typedef struct {
  PetscBool *wanted;        /* [n] do wall vertices go there? */
  PetscInt  *count, *taken; /* [n] how many there are, how many have a vertex */
  PetscReal *at;            /* [nnode_all] 0, there: where on an edge its middle node goes, 1/2 or less */
  List       node;          /* local nodes with an entry there */
  List       left;          /* own vertices that stay off the edges in this fit */
} AlignCorners;

/* Surfaces thinner than a cell, path.c */
typedef struct {
  Midline   *line;                     /* [n] NULL: those that are never that thin */
  PetscReal  coarsest;                 /* largest cell of the mesh */
  PetscBool *is;                       /* [n] is it a path? */
  PetscReal *smallest;                 /* [n] cell along it */
  AlignPath *of;                       /* [n] */
  PetscInt  *node_side, *cell_side[2]; /* see AlignResult; of this fit and of the one before */
  List       side_node, side_cell[2];
  List       edge; /* local mid-edge nodes on paths */
} AlignPaths;

/* The last result, in which k speaks of the surfaces that were known then */
typedef struct {
  PetscInt  *number, capacity; /* [n] of then */
  PetscInt  *node_surface, *cell_surface, *cell_before;
  PetscBool *on_wall, *inactive;
  List       covered, covered_before, placed, node, cell;
  PetscReal *x;
  PetscInt   x_capacity;
} AlignLast;

struct _p_Align {
  Mesh                 mesh;
  MPI_Comm             comm;
  const MeshLocal     *loc;
  const AlignSurfaces *surfaces;
  PetscInt             n, capacity; /* surfaces in the fit in work, which k speaks of; for which there is memory */
  const PetscInt      *waits;       /* [n] see AlignSetPatience; borrowed, NULL: none */
  const PetscBool     *aligned;     /* [n] in the fit in work */
  /* the fit in work; entries that are not listed are zero */
  PetscInt  *cover; /* [ncell_all] surface + 1 */
  PetscInt  *image; /* [ncell_all] of covered cells: which image of the surface it is in, as DomainImages counts */
  PetscInt  *code;  /* [nnode_all] 2 surface + 1: on its wall, 2 surface + 2: inside */
  PetscInt  *level; /* [nnode_all] vertices: 8 surface + ring + 1, ring 0 = wall */
  PetscReal *d;     /* [nnode_all][dim] displacement */
  PetscReal *depth; /* [nnode_all] distance at centre nodes of covered cells */
  PetscReal *pull, *rest; /* of fluid surfaces (NULL: there are none): part of the way that a vertex does not go, 0 to 1
                             [nnode_all]; what is left of it [nnode_all][dim] */
  PetscReal  flat[3];     /* of fluid surfaces that could not be followed: place of the flattest cell */
  List       covered, marked, ring, touched, placed, bad;
  /* work between its parts */
  PetscReal   *work;     /* [nnode_all] zero between uses */
  PetscInt    *stamp[2]; /* [nnode_all], [ncell_all] */
  PetscInt     now;
  Clearance    clearance;
  AlignGrid    grid;
  AlignImages  images;
  AlignTally   tally;
  AlignCorners corners;
  AlignPaths   paths;
  AlignLast    last;
};

static inline PetscErrorCode AlignListAdd(List *l, PetscInt i)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(l->n + 1, &l->capacity, &l->i, sizeof(*l->i), NULL));
  l->i[l->n++] = i;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const PetscInt CORNER[8] = {0, 2, 6, 8, 18, 20, 24, 26};
static const PetscInt EDGE[4]   = {1, 3, 5, 7}; /* of a cell in the plane, or of a face */

static inline const PetscInt *AlignCellNodes(Align s, PetscInt c)
{
  return s->loc->cell_node + c * s->loc->nb;
}

/* Vertices at the ends of the edge whose middle is local node i */
static inline void AlignEdgeEnds(Align s, PetscInt i, PetscInt end[2])
{
  const PetscInt *node = AlignCellNodes(s, s->loc->node_cell[s->loc->node_cell_ptr[i]]);
  PetscInt        j    = 0;

  while (node[s->grid.cell.edge[j]] != i) j++;
  for (PetscInt v = 0; v < 2; v++) end[v] = node[s->grid.cell.end[j][v]];
}

static inline PetscInt AlignCentre(Align s, PetscInt c)
{
  return AlignCellNodes(s, c)[s->grid.cell.centre];
}

/* Place of local node i as the image that is nearest to y, before it moves */
static inline void AlignPositionNear(Align s, PetscInt i, const PetscReal y[], PetscReal x[])
{
  const PetscInt dim = s->loc->dim;

  for (PetscInt a = 0; a < dim; a++) x[a] = y[a] + MeshNearest(s->loc, a, s->loc->x_start[dim * i + a] - y[a]);
}

/* images.c. Are there images to tell apart, and surfaces as wide as a period? */
void AlignMayMeetImages(Align);
/* Axes along which surfaces touch or overlap their own images: s->images.joined. Not collective. */
PetscErrorCode AlignFindImages(Align);
/* After the nodes of covered cells are marked: s->images.copy. Collective. */
PetscErrorCode AlignShareCopies(Align);
/* Which copy covered cell c beside node i belongs to: two of them around i are of the same surface, and of the same
   image of it, if these agree; 0: c is live. */
PetscInt AlignCopyOf(Align, PetscInt i, PetscInt c);
/* The surface that copy is of */
static inline PetscInt AlignCopySurface(PetscInt copy)
{
  return (copy - 1) / 125;
}
/* The image that copy is as seen from i: that many periods from the surface */
static inline PetscInt AlignCopyStep(PetscInt copy, PetscInt axis)
{
  for (; axis > 0; axis--) copy = (copy - 1) / 5 + 1;
  return (copy - 1) % 5 - 2;
}
/* Place of local node j beside node i, before it moves, in the frame of the surface at X that this copy is of */
void AlignPositionInCopy(Align, PetscInt i, PetscInt copy, PetscInt j, const PetscReal X[], PetscReal x[]);
/* From point y in the frame of surface k to local node i on its wall, before it moves (or where it is now), at the
   image whose wall it is on */
void AlignOffset(Align, PetscInt k, const PetscReal y[], PetscInt i, PetscBool displaced, PetscReal r[]);

/* Is local node i on a side that surface k does not pass through? */
static inline PetscBool AlignIsBarred(Align s, PetscInt i, PetscInt k)
{
  return (PetscBool)((s->grid.side[i] & ~s->tally.passes[k]) != 0);
}

static inline PetscBool AlignIsOnWall(Align s, PetscInt i)
{
  return (PetscBool)(s->code[i] % 2);
}

/* Where ranks know some of the surfaces each */
static inline PetscBool AlignIsSpread(Align s)
{
  return (PetscBool)(s->surfaces->sum != NULL);
}

static inline const PetscReal *AlignCentreOf(Align s, PetscInt k)
{
  return s->surfaces->centre[k];
}

static inline PetscErrorCode AlignDistance(Align s, PetscInt k, const PetscReal at[3], PetscInt n, const PetscReal x[],
                                           PetscReal d[])
{
  return s->surfaces->distance(s->surfaces->ctx, k, at, n, x, d);
}

static inline PetscErrorCode AlignProject(Align s, PetscInt k, PetscInt n, const PetscReal x[], PetscReal y[])
{
  return s->surfaces->project(s->surfaces->ctx, k, n, x, y);
}

/* May no surface cover own cell c? */
static inline PetscBool AlignIsClosed(Align s, PetscInt c)
{
  return (PetscBool)(s->surfaces->closed && s->surfaces->closed[c]);
}

/* Do the cells inside surface k leave the fluid? */
static inline PetscBool AlignIsInactive(Align s, PetscInt k)
{
  return AlignLeavesFluid(s->surfaces, k);
}

/* Has the shape of cell c to be sound? Not if it is inside a surface whose inside is inactive, or held */
static inline PetscBool AlignIsCellActive(Align s, PetscInt c)
{
  return (PetscBool)(!s->grid.held[AlignCentre(s, c)] && (!s->cover[c] || !AlignIsInactive(s, s->cover[c] - 1)));
}

/* sync.c. The known surface with that number, -1: there is none */
PetscInt AlignFind(Align, PetscInt number);
/* The ghosts get v of local nodes, in which the owner says v - 1 = per k + rest of a surface k, 0 of none: k is what
   each rank calls it. Collective. */
PetscErrorCode AlignSyncSurfaces(Align, PetscInt per, PetscInt v[]);
/* v [n][width] of all ranks that know a surface: the sum, the largest. Collective. */
PetscErrorCode AlignSumLocal(Align, PetscInt width, PetscReal v[]);
PetscErrorCode AlignMaxLocal(Align, PetscInt width, PetscReal v[]);
/* Sums v [n] over own surfaces, the largest of a number over the known ones, and whether something is so of one of
   them: the same on all ranks. Collective. */
PetscErrorCode AlignSum(Align, PetscInt n, PetscReal v[]);
PetscErrorCode AlignMax(Align, PetscReal *v);
PetscErrorCode AlignAny(Align, PetscBool *any);

/* Slots of a cell of this dimension. */
void AlignDescribeCell(PetscInt dim, AlignCell *);

/* Cells with their centre in an aligned surface that is no path are its own: s->cover, s->covered, s->depth.
   Collective. */
PetscErrorCode AlignCoverCells(Align, const PetscBool aligned[]);
/* Give back the cells that are marked in s->work on some rank; *any: are there any? Collective. */
PetscErrorCode AlignOpenMarkedCells(Align, PetscBool *any);
/* Give covered cells back until no vertex touches two surfaces, two images of one, or a surface and a side that it does
   not pass through. Collective. */
PetscErrorCode AlignOpenGaps(Align);
/* pull.c */
void           AlignPullVertices(Align, PetscInt n, const PetscInt list[]);
PetscErrorCode AlignPullMiddles(Align, PetscInt n, const PetscInt list[]);
void           AlignPullFaces(Align, PetscInt n, const PetscInt list[], const PetscReal from[]);
PetscErrorCode AlignPullBack(Align, PetscBool *any);
PetscErrorCode AlignPullBegin(Align);
/* Tell the ghosts which cells are covered: s->cover, s->covered, s->depth. Collective. */
PetscErrorCode AlignShareCover(Align);
/* In space: live cells become covered until the staircase is a surface without folds, see repair.c. Collective. */
PetscErrorCode AlignRepair(Align);
/* Nodes of covered cells are marked: on the wall if a fluid cell touches them, otherwise inside. Collective. */
PetscErrorCode AlignClassifyNodes(Align);

/* Which nodes are on which sides of the domain: s->grid.side. Collective. */
PetscErrorCode AlignFindSides(Align);
/* Which of the wanted surfaces pass through which sides: s->tally.passes; what of them is within: s->tally.inside.
   After it is known which are paths. Collective. */
PetscErrorCode AlignFindPassages(Align, const PetscBool wanted[]);
/* The displacement of local node i leaves it on its sides. */
void AlignKeepOnSides(Align, PetscInt i);
/* Point y on surface k and on the sides that node i is on, from x there; if there is none, x, and it is
   counted in s->tally.stray. Not collective. */
PetscErrorCode AlignProjectOnSide(Align, PetscInt k, PetscInt i, const PetscReal x[], PetscReal y[]);

/* Size of the cells around own node i before they move: root of their mean area (volume). */
PetscReal AlignNodeSize(Align, PetscInt i);
/* Own wall vertices to the wall; all wall vertices are ring 0. Collective. */
PetscErrorCode AlignPlaceWallVertices(Align);
/* The n own wall vertices have their displacements: in the plane one goes to each corner of a surface with
   s->corners.wanted, its neighbours along the wall are spread anew; counts in s->corners.count, s->corners.taken.
   Collective. */
PetscErrorCode AlignPlaceCorners(Align, PetscInt n, const PetscInt own[]);
/* The other ends of the edges of the mesh at own vertex i that lie on a wall, or that are marked in s->corners.at: at
   most `max`, each once; their number. Not collective. */
PetscInt AlignEdgesAt(Align, PetscInt i, PetscBool marked, PetscInt max, PetscInt ends[]);
/* In space: some of the n own wall vertices, which have their displacements, go to edges and corners of surfaces with
   s->corners.wanted; counts in s->corners.count, s->corners.taken. Collective. */
PetscErrorCode AlignPlaceEdges(Align, PetscInt n, const PetscInt own[]);
/* The farthest vertex on an edge of every bad cell is to stay off in the next attempt; *any: was there one?
   Collective. */
PetscErrorCode AlignLeaveBadEdges(Align, PetscBool *any);
/* Of n placed wall nodes of the plane, those in the middle of an edge to a corner go back to its chord if their closest
   point is on the other side of the corner. Not collective. */
void AlignKeepSides(Align, PetscInt n, const PetscInt list[]);
/* Displacement d of the node in the middle of the edge between vertices a and b: nearer to one that lies on a corner */
void AlignPlaceOnChord(Align, PetscInt a, PetscInt b, PetscReal d[]);
/* Rings of fluid vertices around the walls, by cells that share a vertex with the ring before. Collective. */
PetscErrorCode AlignFindRings(Align);
/* Jacobi sweeps: own ring vertices take the mean displacement of their neighbours along edges (every edge is seen
   from two cells). Collective. */
PetscErrorCode AlignSmoothRings(Align);
/* All nodes but the vertices of all cells with a displaced vertex. Not collective. */
PetscErrorCode AlignPlaceOtherNodes(Align);
/* Again in n of these cells, where vertices have been displaced anew. Not collective. */
PetscErrorCode AlignPlaceAgain(Align, PetscInt n, const PetscInt cells[]);
/* Displacements of the n listed wall nodes to the closest point of their wall, or behind it in narrow gaps; count: what
   the walls were drawn back is added up in s->tally.lost. Not collective. */
PetscErrorCode AlignProjectNodes(Align, PetscInt n, const PetscInt list[], PetscBool count);
/* closest.c. Closest points y of surface k to x, for m nodes, at most CHUNK: of a fluid surface on the side that the
   node is on. Not collective. */
PetscErrorCode AlignClosest(Align, PetscInt k, PetscInt m, const PetscInt node[], const PetscReal x[], PetscReal y[]);
/* Outward normal of surface k at point y on or beside its wall, by differences of the distance. */
PetscErrorCode AlignWallNormal(Align, PetscInt k, const PetscReal y[], PetscReal step, PetscReal normal[]);

/* Derivatives of the Q2 basis at the points of the check. */
void AlignTabulate(Align);
/* Error: a cell that moves has nodes of a larger one. Collective. */
PetscErrorCode AlignCheckLevels(Align);
/* Smallest Jacobian of cell c at these points over the largest one, with the displacements added; area (may be NULL):
   its area or volume by 3 points an axis. */
PetscReal AlignCellQuality(Align, PetscInt c, PetscReal *area);
/* In space: vertices of cells that are too flat take small steps to better places, see mend.c. Collective. */
PetscErrorCode AlignMend(Align);
/* Surfaces with a cell around them that cannot be used: those whose wall the cell has a vertex on, or, where there is
   none, those whose rings it is in. s->tally.flags [n]: bad cells; [n] those that are bad only for surfaces that
   were left alone before; [2 n]: is its wall drawn back?; s->tally.area [n]: of the covered cells; summed over
   ranks. Collective. */
PetscErrorCode AlignCheckCells(Align, PetscReal *quality);
/* A cell beside every bad one is given back, *any: was there one? Collective. */
PetscErrorCode AlignOpenBadCorners(Align, PetscBool *any);
/* Does the mesh follow surface k, after AlignCheckCells? strict: it was left alone before. */
PetscErrorCode AlignIsFollowed(Align, PetscInt k, PetscBool strict, PetscBool *good);

/* How much wider a gap is in the mesh than it is, see align/align.h */
PetscReal AlignFilmGapOffset(PetscReal gap, PetscReal width);

/* Around the life of s. After the node sizes are known. Collective. */
PetscErrorCode AlignPathSetUp(Align);
PetscErrorCode AlignPathTearDown(Align);
/* Around a fit where surfaces are spread, and k stands for others in each: mid-lines of those that are known; away with
   these and the paths. */
PetscErrorCode AlignPathBegin(Align);
PetscErrorCode AlignPathEnd(Align);
/* Which of the wanted surfaces are paths rather than cells: s->paths.is. Collective. */
PetscErrorCode AlignPathChoose(Align, const PetscBool wanted[]);
/* Paths of those of them that s->aligned has: their nodes are marked, their vertices displaced and ring 0. After the
   nodes of all other surfaces are marked; takes back the paths of the last call. A surface for which there is no path
   gets none. Collective. */
PetscErrorCode AlignPathPlaceVertices(Align);
/* On which side of a path are nodes and cells in their new places? Also forgets those of the fit before the last
   one. Not collective. */
PetscErrorCode AlignPathFindSides(Align);
/* Displacements of the mid-edge nodes on paths. Not collective. */
PetscErrorCode AlignPathPlaceEdges(Align);
