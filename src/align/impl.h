/* Inside of the snap module; for its files only. snap.c: the fit and its result. cover.c: the cells of thick bodies.
   repair.c: a staircase of hexahedra that is a surface. place.c: walls, gaps, rings. sides.c: bodies
   through sides of the domain. corners.c: vertices on corners; edges.c: in space on edges. check.c:
   is it a mesh? levels.c: has one of several sizes room? mend.c: hexahedra that would be too flat. images.c: which
   image of a body. path.c, graph.c: bodies thinner than a cell. */
#pragma once
#include "align/align.h"
#include "align/midline.h"
#include "base/room.h"
#include "clearance.h"
#include "fem/element.h"

#define CHUNK       256
#define CLEAR       0.25     /* smallest width of a gap in the mesh, cell sizes */
#define SIDE_CURVED (1 << 6) /* a boundary that is no plane across an axis */
#define NPOINT      27       /* at most: 4 x 4 and 3 x 3 Gauss points, in space 3 x 3 x 3 */

typedef struct {
  PetscInt n, room, *i;
} List;

typedef enum {
  NODE_VERTEX,
  NODE_EDGE,
  NODE_FACE, /* in space */
  NODE_CENTRE
} NodeKind;

/* Vertices on the mid-line of a body, the same on all ranks */
typedef struct {
  PetscInt   n, *id, *place; /* global vertices, ascending, and their places along the path; n = 0: there is none */
  PetscReal *t;              /* [n] in the order of the path: length along the mid-line */
} SnapPath;

/* Slots of a cell: corners in the order of their bits, middles of edges and their ends, faces as 3 x 3 lattices (in the
   plane the one face is the cell), its middle */
typedef struct {
  PetscInt dim, ncorner, nedge, nface, centre;
  PetscInt edge[12], end[12][2], face[6][9];
} SnapCell;

struct _p_Snap {
  Mesh                 mesh;
  const MeshLocal     *loc;
  MPI_Comm             comm;
  const AlignSurfaces *surfaces;
  PetscInt             room;           /* surfaces for which there is room below */
  PetscBool            periodic, wide; /* are there periods? bodies at least as wide as one? */
  PetscInt            *solid;          /* [nnode_all] with wide: of wall nodes, 1 + their periods as in SnapSolid */
  PetscInt            *joined;         /* [nbodies] bits of the axes along which it is one with its images */
  PetscInt             nbodies;        /* known to this rank in the fit in work; k speaks of these */
  NodeKind            *kind;           /* [nnode_all] */
  /* [nnode_all] sides of the domain it is on: bits 2 axis + (upper one), SIDE_CURVED */
  PetscInt *side;
  SnapCell  cell_kind;
  PetscInt  npoint; /* of the check */
  PetscReal dphi[NPOINT][3 * MESH_MAX_NB], weight[NPOINT];
  /* the fit in work; entries that are not listed are zero */
  PetscInt        *cover;    /* [ncell_all] body + 1 */
  PetscInt        *image;    /* [ncell_all] of dead cells: which image of the body it is in, as DomainImages counts */
  PetscInt        *code;     /* [nnode_all] 2 body + 1: on its wall, 2 body + 2: inside */
  PetscInt        *level;    /* [nnode_all] vertices: 8 body + ring + 1, ring 0 = wall */
  PetscReal       *d;        /* [nnode_all][dim] displacement */
  PetscReal       *depth;    /* [nnode_all] distance at centre nodes of covered cells */
  PetscReal       *work;     /* [nnode_all] zero between uses */
  PetscInt        *stamp[2]; /* [nnode_all], [ncell_all] */
  PetscInt         now;
  List             dead, marked, ring, touched, placed, bad;
  PetscInt        *flags; /* [3 nbodies] */
  PetscReal       *area;  /* [nbodies] (volume) of the dead cells and of what the walls were drawn back */
  Clearance        clearance;
  PetscReal       *lost;   /* [nbodies] area that their walls were drawn back */
  PetscReal       *size;   /* [nnode_all] SnapNodeSize() */
  const PetscBool *fitted; /* [nbodies] in the fit in work */
  /* bodies that pass through sides of the domain */
  PetscInt  *passes; /* [nbodies] bits of the sides */
  PetscInt  *stray;  /* [nbodies] nodes on sides for which there was no place on the surface */
  PetscReal *inside; /* [nbodies] volume within the domain */
  /* corners of bodies; in space, wall vertices at their edges */
  const PetscInt *waits;            /* [nbodies] see SnapSetPatience; borrowed, NULL: all are followed */
  PetscBool      *could;            /* [nbodies] fitted, but for its patience */
  PetscBool      *follow;           /* [nbodies] do wall vertices go there? */
  PetscInt       *ncorner, *ntaken; /* [nbodies] how many there are, how many have a vertex */
  PetscReal      *at_corner;        /* [nnode_all] 0, there: where on an edge its middle node goes, 1/2 or less */
  List            corner;           /* local nodes with an entry there */
  List            left;             /* own vertices that stay off the edges in this fit */
  /* the last result, in which k speaks of the bodies that were known then: number */
  PetscInt  *node_body, *cell_body, *cell_before, *number, number_room;
  PetscBool *on_wall;
  List       old_dead, older_dead, old_placed, node, cell;
  PetscReal *x;
  PetscInt   x_room;
  PetscBool *hollow; /* [nbodies] */
  /* bodies thinner than a cell */
  Midline   *line;                     /* [nbodies] NULL: bodies that are never that thin */
  PetscReal  coarsest;                 /* largest cell of the mesh */
  PetscBool *is_path;                  /* [nbodies] */
  PetscReal *smallest;                 /* [nbodies] cell along a body */
  SnapPath  *path;                     /* [nbodies] */
  PetscInt  *node_side, *cell_side[2]; /* see SnapResult; of this fit and of the one before */
  List       side_node, side_cell[2];
  List       path_edge; /* local mid-edge nodes on paths */
};

static inline PetscErrorCode SnapListAdd(List *l, PetscInt i)
{
  PetscFunctionBeginUser;
  PetscCall(RoomFor(l->n + 1, &l->room, &l->i, sizeof(*l->i), NULL));
  l->i[l->n++] = i;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const PetscInt CORNER[8] = {0, 2, 6, 8, 18, 20, 24, 26};
static const PetscInt EDGE[4]   = {1, 3, 5, 7}; /* of a cell in the plane, or of a face */

static inline const PetscInt *SnapCellNodes(Snap s, PetscInt c)
{
  return s->loc->cell_node + c * s->loc->nb;
}

/* Vertices at the ends of the edge whose middle is local node i */
static inline void SnapEdgeEnds(Snap s, PetscInt i, PetscInt end[2])
{
  const PetscInt *node = SnapCellNodes(s, s->loc->node_cell[s->loc->node_cell_ptr[i]]);
  PetscInt        j    = 0;

  while (node[s->cell_kind.edge[j]] != i) j++;
  for (PetscInt v = 0; v < 2; v++) end[v] = node[s->cell_kind.end[j][v]];
}

static inline PetscInt SnapCentre(Snap s, PetscInt c)
{
  return SnapCellNodes(s, c)[s->cell_kind.centre];
}

/* Place of local node i as the image that is nearest to y, before it moves */
static inline void SnapPlaceNear(Snap s, PetscInt i, const PetscReal y[], PetscReal x[])
{
  const PetscInt dim = s->loc->dim;

  for (PetscInt a = 0; a < dim; a++) x[a] = y[a] + MeshNearest(s->loc, a, s->loc->x_start[dim * i + a] - y[a]);
}

/* images.c. Are there images to tell apart, and bodies as wide as a period? */
void SnapMayMeetImages(Snap);
/* Axes along which bodies touch or overlap their own images: s->joined. Not collective. */
PetscErrorCode SnapFindImages(Snap);
/* After the nodes of dead cells are marked: s->solid. Collective. */
PetscErrorCode SnapShareSolids(Snap);
/* Which solid dead cell c beside node i belongs to: two of them around i are of the same body, and of the same image of
   it, if these agree; 0: c is live. */
PetscInt SnapSolid(Snap, PetscInt i, PetscInt c);
/* The body that solid is of */
static inline PetscInt SnapSolidBody(PetscInt solid)
{
  return (solid - 1) / 125;
}
/* The image that solid is as seen from i: that many periods from the body */
static inline PetscInt SnapSolidStep(PetscInt solid, PetscInt axis)
{
  for (; axis > 0; axis--) solid = (solid - 1) / 5 + 1;
  return (solid - 1) % 5 - 2;
}
/* Place of local node j beside node i, before it moves, in the frame of the body at X that this solid is of */
void SnapPlaceInSolid(Snap, PetscInt i, PetscInt solid, PetscInt j, const PetscReal X[], PetscReal x[]);
/* From point y in the frame of body k to local node i on its wall, before it moves (or where it is now), at the image
   whose wall it is on */
void SnapWayTo(Snap, PetscInt k, const PetscReal y[], PetscInt i, PetscBool displaced, PetscReal r[]);

/* Is local node i on a side that body k does not pass through? */
static inline PetscBool SnapIsBarred(Snap s, PetscInt i, PetscInt k)
{
  return (PetscBool)((s->side[i] & ~s->passes[k]) != 0);
}

static inline PetscBool SnapIsOnWall(Snap s, PetscInt i)
{
  return (PetscBool)(s->code[i] % 2);
}

/* Where ranks know some of the surfaces each */
static inline PetscBool SnapIsSpread(Snap s)
{
  return (PetscBool)(s->surfaces->sum != NULL);
}

static inline const PetscReal *SnapCentreOf(Snap s, PetscInt k)
{
  return s->surfaces->centre[k];
}

static inline PetscErrorCode SnapDistance(Snap s, PetscInt k, const PetscReal at[3], PetscInt n, const PetscReal x[], PetscReal d[])
{
  return s->surfaces->distance(s->surfaces->ctx, k, at, n, x, d);
}

static inline PetscErrorCode SnapProject(Snap s, PetscInt k, PetscInt n, const PetscReal x[], PetscReal y[])
{
  return s->surfaces->project(s->surfaces->ctx, k, n, x, y);
}

/* sync.c. The known surface with that number, -1: there is none */
PetscInt SnapFind(Snap, PetscInt number);
/* The ghosts get v of local nodes, in which the owner says v - 1 = per k + rest of a surface k, 0 of none: k is what each
   rank calls it. Collective. */
PetscErrorCode SnapSyncBodies(Snap, PetscInt per, PetscInt v[]);
/* v [n][width] of all ranks that know a surface: the sum, the largest. Collective. */
PetscErrorCode SnapSumKnown(Snap, PetscInt width, PetscReal v[]);
PetscErrorCode SnapMaxKnown(Snap, PetscInt width, PetscReal v[]);
/* Sums v [n] over own surfaces, the largest of a number over the known ones, and whether something is so of one of them:
   the same on all ranks. Collective. */
PetscErrorCode SnapSum(Snap, PetscInt n, PetscReal v[]);
PetscErrorCode SnapMax(Snap, PetscReal *v);
PetscErrorCode SnapAny(Snap, PetscBool *any);

/* Slots of a cell of this dimension. */
void SnapDescribeCell(PetscInt dim, SnapCell *);

/* Cells with their centre in a fitted body that is no path are its own: s->cover, s->dead, s->depth. Collective. */
PetscErrorCode SnapCoverCells(Snap, const PetscBool fitted[]);
/* Give back the cells that are marked in s->work on some rank; *any: are there any? Collective. */
PetscErrorCode SnapOpenMarkedCells(Snap, PetscBool *any);
/* Give dead cells back until no vertex touches two bodies, two images of one, or a body and a side that it does not
   pass through. Collective. */
PetscErrorCode SnapOpenGaps(Snap);
/* Tell the ghosts which cells are dead: s->cover, s->dead, s->depth. Collective. */
PetscErrorCode SnapShareCover(Snap);
/* In space: live cells become dead until the staircase is a surface without folds, see repair.c. Collective. */
PetscErrorCode SnapRepair(Snap);
/* Nodes of dead cells are marked: on the wall if a fluid cell touches them, otherwise inside. Collective. */
PetscErrorCode SnapClassifyNodes(Snap);

/* Which nodes are on which sides of the domain: s->side. Collective. */
PetscErrorCode SnapFindSides(Snap);
/* Which of the wanted bodies pass through which sides: s->passes; what of them is within: s->inside. After it is known
   which are paths. Collective. */
PetscErrorCode SnapFindPassages(Snap, const PetscBool wanted[]);
/* The displacement of local node i leaves it on its sides. */
void SnapKeepOnSides(Snap, PetscInt i);
/* Point y on the surface of body k and on the sides that node i is on, from x there; if there is none, x, and it is
   counted in s->stray. Not collective. */
PetscErrorCode SnapProjectOnSide(Snap, PetscInt k, PetscInt i, const PetscReal x[], PetscReal y[]);

/* Size of the cells around own node i before they move: root of their mean area (volume). */
PetscReal SnapNodeSize(Snap, PetscInt i);
/* Own wall vertices to the wall; all wall vertices are ring 0. Collective. */
PetscErrorCode SnapPlaceWallVertices(Snap);
/* The n own wall vertices have their displacements: in the plane one goes to each corner of a body with s->follow, its
   neighbours along the wall are spread anew; counts in s->ncorner, s->ntaken. Collective. */
PetscErrorCode SnapPlaceCorners(Snap, PetscInt n, const PetscInt own[]);
/* The other ends of the edges of the mesh at own vertex i that lie on a wall, or that are marked in s->at_corner: at
   most `most`, each once; their number. Not collective. */
PetscInt SnapEdgesAt(Snap, PetscInt i, PetscBool marked, PetscInt most, PetscInt ends[]);
/* In space: some of the n own wall vertices, which have their displacements, go to edges and corners of bodies with
   s->follow; counts in s->ncorner, s->ntaken. Collective. */
PetscErrorCode SnapPlaceEdges(Snap, PetscInt n, const PetscInt own[]);
/* The farthest vertex on an edge of every bad cell is to stay off in the next attempt; *any: was there one?
   Collective. */
PetscErrorCode SnapLeaveBadEdges(Snap, PetscBool *any);
/* Of n placed wall nodes of the plane, those in the middle of an edge to a corner go back to its chord if their closest
   point is on the other side of the corner. Not collective. */
void SnapKeepSides(Snap, PetscInt n, const PetscInt list[]);
/* Displacement d of the node in the middle of the edge between vertices a and b: nearer to one that lies on a corner */
void SnapPlaceOnChord(Snap, PetscInt a, PetscInt b, PetscReal d[]);
/* Rings of fluid vertices around the walls, by cells that share a vertex with the ring before. Collective. */
PetscErrorCode SnapFindRings(Snap);
/* Jacobi sweeps: own ring vertices take the mean displacement of their neighbours along edges (every edge is seen
   from two cells). Collective. */
PetscErrorCode SnapSmoothRings(Snap);
/* All nodes but the vertices of all cells with a displaced vertex. Not collective. */
PetscErrorCode SnapPlaceOtherNodes(Snap);
/* Again in n of these cells, where vertices have been displaced anew. Not collective. */
PetscErrorCode SnapPlaceAgain(Snap, PetscInt n, const PetscInt cells[]);
/* Displacements of the n listed wall nodes to the closest point of their wall, or behind it in narrow gaps; count: what
   the walls were drawn back is added up in s->lost. Not collective. */
PetscErrorCode SnapProjectNodes(Snap, PetscInt n, const PetscInt list[], PetscBool count);
/* Outward normal of body k at point y on or beside its wall, by differences of the distance. */
PetscErrorCode SnapWallNormal(Snap, PetscInt k, const PetscReal y[], PetscReal step, PetscReal normal[]);

/* Derivatives of the Q2 basis at the points of the check. */
void SnapTabulate(Snap);
/* Error: a cell that moves has nodes of a larger one. Collective. */
PetscErrorCode SnapCheckLevels(Snap);
/* Smallest Jacobian of cell c at these points over the largest one, with the displacements added; area (may be NULL):
   its area or volume by 3 points an axis. */
PetscReal SnapCellQuality(Snap, PetscInt c, PetscReal *area);
/* In space: vertices of cells that are too flat take small steps to better places, see mend.c. Collective. */
PetscErrorCode SnapMend(Snap);
/* Bodies with a cell around them that cannot be used: those whose wall the cell has a vertex on, or, where there is
   none, those whose rings it is in. s->flags [nbodies]: bad cells; [nbodies] those that are bad only for bodies that
   were left alone before; [2 nbodies]: is its wall drawn back?; s->area [nbodies]: of the dead cells; summed over
   ranks. Collective. */
PetscErrorCode SnapCheckCells(Snap, PetscReal *quality);
/* A cell beside every bad one is given back, *any: was there one? Collective. */
PetscErrorCode SnapOpenBadCorners(Snap, PetscBool *any);
/* Does the mesh follow body k, after SnapCheckCells? strict: it was left alone before. */
PetscErrorCode SnapJudgeBody(Snap, PetscInt k, PetscBool strict, PetscBool *good);

/* How much wider a gap is in the mesh than it is, see align/align.h */
PetscReal SnapWidening(PetscReal gap, PetscReal width);

/* Around the life of s. After the node sizes are known. Collective. */
PetscErrorCode SnapPathSetUp(Snap);
PetscErrorCode SnapPathTearDown(Snap);
/* Around a fit where bodies are spread, and k stands for others in each: mid-lines of those that are known; away with
   these and the paths. */
PetscErrorCode SnapPathMeetBodies(Snap);
PetscErrorCode SnapPathPartBodies(Snap);
/* Which of the wanted bodies are paths rather than cells: s->is_path. Collective. */
PetscErrorCode SnapPathChoose(Snap, const PetscBool wanted[]);
/* Paths of those of them that s->fitted has: their nodes are marked, their vertices displaced and ring 0. After the
   nodes of all other bodies are marked; takes back the paths of the last call. A body for which there is no path
   gets none. Collective. */
PetscErrorCode SnapPathPlaceVertices(Snap);
/* On which side of a path are nodes and cells in their new places? Also forgets those of the fit before the last
   one. Not collective. */
PetscErrorCode SnapPathFindSides(Snap);
/* Displacements of the mid-edge nodes on paths. Not collective. */
PetscErrorCode SnapPathPlaceEdges(Snap);
