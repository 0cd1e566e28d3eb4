/* Inside of a Border, for border.c (boundaries, pieces) and nearest.c (what is near a point). */
#pragma once
#include "base/border.h"
#include "base/neargrid.h"
#include "base/face.h"

typedef struct {
  BorderFace f;
  PetscReal  centre[3], r;            /* ball around it */
  PetscReal  turn;                    /* 1, or -1: its normal by tangents points out of the domain */
  PetscReal  normal[BORDER_NODES][3]; /* at the nodes: sum of those of all faces there */
  PetscBool  open[BORDER_NODES];      /* is a node on a boundary that is not solid, too? */
  PetscInt   piece;                   /* -1: not solid */
} Face;

typedef struct {
  PetscInt    boundary;
  BorderRound r;
} Round;

struct _p_Border {
  PetscInt dim, m; /* m: nodes of a face */
  PetscInt n;      /* boundaries */
  PetscInt capacity, nround, round_capacity, nface, npiece;
  char (*name)[64];
  PetscBool *solid;
  Round     *round;          /* the first pieces, those that are not solid too */
  Face      *face;           /* sorted */
  PetscInt  *start, *next;   /* [nface + 1] into next: solid faces that share a node */
  PetscInt  *piece_boundary; /* [npiece] */
  NearGrid   near;
  /* of the last question: faces, ascending; pieces, and when one was listed */
  PetscInt nlist, list_capacity, *list, nfound, *found, question, *asked;
};

/* Index of node `number` of the mesh in a face, -1: it has none */
static inline PetscInt FaceFindNode(const struct _p_Border *b, const Face *f, PetscInt number)
{
  for (PetscInt i = 0; i < b->m; i++)
    if (f->f.node[i] == number) return i;
  return -1;
}
