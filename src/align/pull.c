/* Align, pull: fluid surfaces in the plane (AlignSurfaces.approach), which come as near to each other as they like.
   Wall vertices go to the side of the surface that they are on the way to, and where a cell could not be used they go
   part of the way only. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"

#define KEPT     0.6  /* of its way that a vertex of a bad cell keeps, each time */
#define FARTHEST 1.2  /* cells that a vertex goes */
#define AWAY     0.35 /* of a cell: middles whose surface is farther stay on the chord, */
#define ALONG    0.15 /* as do those that would go so much of their edge along it, where it folds */

/* Of own wall vertices that have got their places */
void AlignPullVertices(Align s, PetscInt n, const PetscInt list[])
{
  for (PetscInt e = 0; e < n; e++) {
    PetscReal      *d = s->d + 2 * list[e], *rest = s->rest + 2 * list[e];
    const PetscReal distance = PetscHypotReal(d[0], d[1]), limit = FARTHEST * s->grid.size[list[e]];
    const PetscReal cut = distance > limit ? limit / distance : 1;

    for (PetscInt a = 0; a < 2; a++) {
      rest[a] = s->pull[list[e]] * cut * d[a];
      d[a]    = (1 - s->pull[list[e]]) * cut * d[a];
    }
  }
}

/* Middles of wall edges that were put onto the surface: back to the chord where that is not near, or an end is off the
   surface */
void AlignPullMiddles(Align s, PetscInt n, const PetscInt list[])
{
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt i = list[e];
    PetscInt       end[2];
    PetscReal      chord[2], off[2], edge[2], length, along;

    AlignEdgeEnds(s, i, end);
    AlignPlaceOnChord(s, end[0], end[1], chord);
    for (PetscInt a = 0; a < 2; a++) {
      off[a]  = s->d[2 * i + a] - chord[a];
      edge[a] = MeshNearest(s->loc, a, s->loc->x_start[2 * end[1] + a] - s->loc->x_start[2 * end[0] + a]) +
                s->d[2 * end[1] + a] - s->d[2 * end[0] + a];
      s->rest[2 * i + a] = 0.5 * (s->rest[2 * end[0] + a] + s->rest[2 * end[1] + a]);
    }
    length = PetscHypotReal(edge[0], edge[1]);
    along  = PetscAbsReal(off[0] * edge[0] + off[1] * edge[1]);
    if (s->pull[end[0]] == 0 && s->pull[end[1]] == 0 && PetscHypotReal(off[0], off[1]) <= AWAY * s->grid.size[i] &&
        along <= ALONG * length * length)
      continue;
    for (PetscInt a = 0; a < 2; a++) s->d[2 * i + a] = chord[a];
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
    for (PetscInt v = 0; v < 4; v++) s->work[AlignCellNodes(s, s->bad.i[e])[CORNER[v]]] = 1;
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
  PetscCall(PetscArrayzero(s->rest, 2 * s->loc->nnode_all));
  PetscFunctionReturn(PETSC_SUCCESS);
}
