/* Align, the graph of a surface thinner than a cell: vertices and edges of the cells around it, and the cheapest path
   of edges along its mid-line (Dijkstra 1959). Ties are broken by positions, never by numbers, so that all
   partitions give the same path. An edge costs its length times (1 + 4 (distance from the mid-line / length)^2); a path
   begins and ends at any vertices near the tips, which cost twice their squared distance over the cell size, or at a
   side of the domain, which costs nothing (a path that steps sideways at its foot leaves flatter cells). */
#pragma once
#include "align/midline.h"

#define ALIGN_NEAR 1.2 /* a path ends that close to the tip, cell sizes */
/* numbers that describe a cell to other ranks: surface, cell size, four times global vertex, place, CornerKind */
#define ALIGN_RECORD 18

typedef enum {
  CORNER_FREE,
  CORNER_TAKEN, /* by another surface */
  CORNER_SIDE   /* on a side of the domain: for the ends of a path only */
} CornerKind;

/* A corner of the cells around a surface */
typedef struct {
  PetscReal  x[2], s, d; /* place in the surface frame; along and from the mid-line */
  PetscInt   id;
  CornerKind kind;
} Corner;

typedef struct {
  PetscInt  a, b;
  PetscReal cost;
} Edge;

typedef struct {
  PetscInt  ncorner, nedge;
  Corner   *corner;
  Edge     *edge;
  PetscReal size; /* smallest cell */
} Graph;

/* From the count records of all surfaces [count][ALIGN_RECORD]: the corners of surface k, each once, by their places,
   and the smallest cell. g->corner [4 count]. */
PetscErrorCode AlignGraphListCorners(Midline, PetscInt k, PetscInt count, const PetscReal record[], Graph *g);
/* Edges that a path may take, each in both directions, by the corner they leave. g->edge [8 count]. */
PetscErrorCode AlignGraphListEdges(PetscInt k, PetscInt count, const PetscReal record[], Graph *g);
/* From tip to tip [4], which end at corners of the given kinds [2]: from [ncorner] the corner before, *last the end
   of the cheapest path, -1: there is none. cost, done [ncorner]: work. */
PetscErrorCode AlignGraphFindPath(const Graph *, const PetscReal tip[], const CornerKind kind[], PetscInt from[],
                                  PetscReal cost[], PetscBool done[], PetscInt *last);
/* Places t [n] along a line of the given length for the vertices of a path, from their closest points: tips at the
   ends, the others averaged over neighbours, because a step across the line would have next to no length there;
   averaging gives such an edge about half of the length of the others. */
PetscErrorCode AlignGraphSpread(PetscInt n, PetscReal length, PetscReal t[]);
