/* Align, pull: fluid surfaces (AlignSurfaces.approach), which come as near to each other as they like.
   Wall vertices go to the side of the surface that they are on the way to, and where a cell could not be used they go
   part of the way only. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"

#define KEPT     0.6  /* of its way that a vertex of a bad cell keeps, each time */
#define FARTHEST 1.2  /* cells that a vertex goes */
#define AWAY     0.35 /* of a cell: middles whose surface is farther stay on the chord, */
#define ALONG    0.15 /* as do those that would go so much of their edge along it, where it folds, */
#define ROUNDS   4    /* looks at what lies across */

static PetscReal length_of(PetscInt dim, const PetscReal r[])
{
  return dim == 2 ? PetscHypotReal(r[0], r[1]) : PetscSqrtReal(dot3(r, r));
}

/* Of own wall vertices that have got their places */
void AlignPullVertices(Align s, PetscInt n, const PetscInt list[])
{
  const PetscInt dim = s->loc->dim;

  for (PetscInt e = 0; e < n; e++) {
    PetscReal      *d = s->d + dim * list[e], *rest = s->rest + dim * list[e];
    const PetscReal distance = length_of(dim, d), limit = FARTHEST * s->grid.size[list[e]];
    const PetscReal cut = distance > limit ? limit / distance : 1;

    for (PetscInt a = 0; a < dim; a++) {
      rest[a] = s->pull[list[e]] * cut * d[a];
      d[a]    = (1 - s->pull[list[e]]) * cut * d[a];
    }
  }
}

/* Of a middle that was put onto the surface, and of its edge as it is without the pull: from the chord's middle, how
   much of that along the edge, from end to end */
typedef struct {
  PetscReal off[3], along, edge[3], length;
} Middle;

static void measure_middle(Align s, PetscInt i, const PetscInt end[2], const PetscReal chord[], Middle *m)
{
  const PetscInt dim = s->loc->dim;

  *m = (Middle){.along = 0};
  for (PetscInt a = 0; a < dim; a++) {
    const PetscInt p = dim * end[0] + a, q = dim * end[1] + a;

    m->off[a]  = s->d[dim * i + a] - chord[a] - 0.5 * (s->rest[p] + s->rest[q]);
    m->edge[a] = MeshNearest(s->loc, a, s->loc->x_start[q] - s->loc->x_start[p]) + s->d[q] + s->rest[q] - s->d[p] -
                 s->rest[p];
  }
  m->length = length_of(dim, m->edge);
  for (PetscInt a = 0; a < dim && m->length > 0; a++) m->along += m->off[a] * m->edge[a] / PetscSqr(m->length);
}

/* Middles of wall edges that were put onto the surface: where that is far along their edge, as where a bend is sharp,
   to what of the surface lies across from the chord; back to the chord where that is not near. Where an end of the
   edge of the mesh is off the surface, its middle is on the chord, and only what is left knows of the surface. */
PetscErrorCode AlignPullMiddles(Align s, PetscInt n, const PetscInt list[])
{
  const PetscInt dim = s->loc->dim;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt i = list[e];
    PetscReal     *d = s->d + dim * i, *rest = s->rest + dim * i, chord[3];
    PetscBool      near, pulled;
    PetscInt       end[2];
    Middle         m;

    AlignEdgeEnds(s, i, end);
    AlignPlaceOnChord(s, end[0], end[1], chord);
    measure_middle(s, i, end, chord, &m);
    for (PetscInt round = 0; round < ROUNDS && PetscAbsReal(m.along) > ALONG; round++) {
      for (PetscInt a = 0; a < dim; a++) d[a] -= m.along * m.edge[a];
      PetscCall(AlignProjectNodes(s, 1, list + e, PETSC_FALSE));
      measure_middle(s, i, end, chord, &m);
    }
    near   = (PetscBool)(length_of(dim, m.off) <= AWAY * s->grid.size[i] && PetscAbsReal(m.along) <= ALONG);
    pulled = (PetscBool)(s->pull[end[0]] != 0 || s->pull[end[1]] != 0);
    for (PetscInt a = 0; a < dim; a++) {
      rest[a] = 0.5 * (s->rest[dim * end[0] + a] + s->rest[dim * end[1] + a]) + (near && pulled ? m.off[a] : 0);
      if (!near || pulled) d[a] = chord[a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* In space the same for middles of wall faces, from [n][3] where they were within the edges of the face */
void AlignPullFaces(Align s, PetscInt n, const PetscInt list[], const PetscReal from[])
{
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt  i    = list[e];
    const PetscInt *node = AlignCellNodes(s, s->loc->node_cell[s->loc->node_cell_ptr[i]]), *face;
    PetscInt        f = 0, pulled = 0;
    PetscReal       off[3];

    while (node[s->grid.cell.face[f][4]] != i) f++;
    face = s->grid.cell.face[f];
    for (PetscInt v = 0; v < 4; v++) pulled += s->pull[node[face[CORNER[v]]]] != 0;
    for (PetscInt a = 0; a < 3; a++) {
      off[a]             = s->d[3 * i + a] - from[3 * e + a];
      s->rest[3 * i + a] = 0;
      for (PetscInt v = 0; v < 4; v++)
        s->rest[3 * i + a] += 0.5 * s->rest[3 * node[face[EDGE[v]]] + a] -
                              0.25 * s->rest[3 * node[face[CORNER[v]]] + a];
    }
    if (!pulled && length_of(3, off) <= AWAY * s->grid.size[i]) continue;
    for (PetscInt a = 0; a < 3; a++) s->d[3 * i + a] = from[3 * e + a];
  }
}

/* Vertices of bad cells are pulled back; *any: are there such? */
PetscErrorCode AlignPullBack(Align s, PetscBool *any)
{
  PetscFunctionBeginUser;
  *any = (PetscBool)(s->bad.n > 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, any, 1, COMPAT_MPI_BOOL, MPI_LOR, s->comm));
  if (!*any) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < s->bad.n; e++)
    for (PetscInt v = 0; v < s->grid.cell.ncorner; v++) s->work[AlignCellNodes(s, s->bad.i[e])[CORNER[v]]] = 1;
  PetscCall(MeshSumNodes(s->mesh, 1, s->work));
  PetscCall(MeshSyncNodes(s->mesh, 1, s->work));
  for (PetscInt i = 0; i < s->loc->nnode_all; i++) {
    if (s->work[i] > 0) s->pull[i] = 1 - KEPT * (1 - s->pull[i]);
    s->work[i] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A new attempt with all vertices on the surface */
PetscErrorCode AlignPullBegin(Align s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(s->pull, s->loc->nnode_all));
  PetscCall(PetscArrayzero(s->rest, s->loc->dim * s->loc->nnode_all));
  PetscFunctionReturn(PETSC_SUCCESS);
}
