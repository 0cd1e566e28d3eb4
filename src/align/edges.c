/* Align, edges: in space wall vertices lie on the edges and corners of a surface.

   Closest points alone cut an edge off. So every face of the staircase gets the normal of the surface where the line
   between the centres of its two cells crosses it, and edges of the mesh between two faces whose normals are far apart
   become chains: their vertices go to where the smooth parts beside them meet, those with three or more of these to a
   corner (dual contouring: Ju, Losasso, Schaefer, Warren 2002, with the cell of their method for our vertex). A face
   with three or four sides in chains is taken to the other side of them, lest it be drawn out to a line. What is sharp
   on the scale of a cell only, a tip or a rounded edge, is left as it is. Vertices along an edge are spread along it,
   and the wall vertices beside them within their smooth part: more than one may have had the edge as closest point. The
   middle nodes of mesh edges from there are not drawn towards them, as they are in the plane
   (runs/studies/aligned-corners). */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"

#define ONE     0.9 /* normals less than 26 degrees apart, the cosine, are of one smooth part */
#define SAME    0.8 /* seen from closer by, of the same one */
#define REACH   1.5 /* farthest that a vertex goes, cells */
#define NBISECT 12  /* where lines cross the surface, to 1/4096 of a cell */
#define NTURN   3   /* rounds in which faces change sides */
#define NSLIDE  6   /* Jacobi sweeps along edges and beside them */
#define NEXT    2   /* wall vertices beside edges that are spread */
#define ON_EDGE 0.5 /* mark of vertices and mid-edge nodes: middles of mesh edges stay in the middle */

/* Faces of the staircase with both cells on this rank, by their middle nodes */
typedef struct {
  List       list;
  PetscReal *plane; /* [nnode_all][6] normal and place of the surface there; of middles of edges: sums of both faces */
  PetscInt  *covered; /* [nnode_all] of them: the covered cell + 1 */
} Faces;

typedef enum {
  SHARP,
  SMOOTH,   /* one smooth part after all */
  ELSEWHERE /* others are there */
} Meeting;

/* A vertex on an edge (of two smooth parts) or a corner (of three) */
typedef struct {
  PetscInt  vertex, n, next[2];
  PetscReal normal[3][3];
} Crease;

typedef struct {
  PetscInt n, capacity;
  Crease  *c;
} Creases;

/* ---- where surfaces meet ---- */

/* The least way from x to where n planes through y with these normals meet; false: they do not */
static PetscBool intersect_planes(PetscInt n, PetscReal normal[][3], PetscReal y[][3], PetscReal x[3])
{
  PetscReal M[9], inverse[9], r[3], move[3] = {0, 0, 0};

  for (PetscInt i = 0; i < n; i++) {
    PetscReal to[3];

    for (PetscInt a = 0; a < 3; a++) to[a] = y[i][a] - x[a];
    r[i] = dot3(normal[i], to);
    for (PetscInt j = 0; j < n; j++) M[n * i + j] = dot3(normal[i], normal[j]);
  }
  if (DenseDeterminant(n, M) < 0.02) return PETSC_FALSE;
  DenseInvert(n, M, inverse);
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt j = 0; j < n; j++)
      for (PetscInt a = 0; a < 3; a++) move[a] += normal[i][a] * inverse[n * i + j] * r[j];
  for (PetscInt a = 0; a < 3; a++) x[a] += move[a];
  return PETSC_TRUE;
}

/* x goes to where the smooth parts of surface k meet that have about these normals beside x; SMOOTH: they are one */
static PetscErrorCode find_crease(Align s, PetscInt k, PetscReal h, PetscInt n, PetscReal normal[][3], PetscReal x[3],
                                  Meeting *how)
{
  const PetscReal offset[2] = {0.1 * h, 0.02 * h};
  PetscReal       start[3];

  PetscFunctionBeginUser;
  *how = SHARP;
  PetscCall(PetscArraycpy(start, x, 3));
  PetscCall(AlignProject(s, k, 1, start, x));
  for (PetscInt round = 0; round < 2; round++) {
    PetscReal beside[9], y[9], fresh[3][3];

    for (PetscInt i = 0; i < n; i++) { /* into each part, away from the others; edges all convex or all concave */
      PetscReal t[3] = {0, 0, 0}, d, size;

      for (PetscInt j = 0; j < n; j++)
        for (PetscInt a = 0; a < 3; a++) t[a] -= j == i ? 0 : normal[j][a] - dot3(normal[i], normal[j]) * normal[i][a];
      size = PetscMax(PetscSqrtReal(dot3(t, t)), PETSC_SMALL);
      for (PetscInt a = 0; a < 3; a++) beside[3 * i + a] = x[a] + offset[round] / size * t[a];
      PetscCall(AlignDistance(s, k, AlignCentreOf(s, k), 1, beside + 3 * i, &d));
      if (PetscAbsReal(d) < 0.3 * offset[round]) continue;
      for (PetscInt a = 0; a < 3; a++) beside[3 * i + a] = x[a] - offset[round] / size * t[a];
    }
    PetscCall(AlignProject(s, k, n, beside, y));
    for (PetscInt i = 0; i < n; i++) PetscCall(AlignWallNormal(s, k, y + 3 * i, 1e-3 * h, fresh[i]));
    for (PetscInt i = 0; i < n; i++) {
      for (PetscInt j = 0; j < i && *how == SHARP; j++)
        if (dot3(fresh[i], fresh[j]) >= ONE) *how = SMOOTH;
      if (dot3(fresh[i], normal[i]) < SAME) *how = ELSEWHERE;
    }
    if (*how != SHARP || !intersect_planes(n, fresh, (PetscReal(*)[3])y, x)) PetscFunctionReturn(PETSC_SUCCESS);
    PetscCall(PetscArraycpy(&normal[0][0], &fresh[0][0], 3 * n));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- faces of the staircase ---- */

/* Place of node i on the wall of surface k, before it moves, in the frame of the surface */
static void place_wall(Align s, PetscInt k, PetscInt i, PetscReal x[3])
{
  AlignOffset(s, k, AlignCentreOf(s, k), i, PETSC_FALSE, x);
  for (PetscInt a = 0; a < 3; a++) x[a] += AlignCentreOf(s, k)[a];
}

static PetscErrorCode add_face(Align s, PetscInt middle, Faces *faces)
{
  const MeshLocal *l    = s->loc;
  const PetscInt  *pair = l->node_cell + l->node_cell_ptr[middle], k = (s->code[middle] - 1) / 2,
                 covered = s->cover[pair[0]] ? 0 : 1;
  const PetscInt copy    = AlignCopyOf(s, middle, pair[covered]);
  PetscReal     *plane   = faces->plane + 6 * middle, at[2][3], x[3], d[2];

  PetscFunctionBeginUser;
  PetscCall(AlignListAdd(&faces->list, middle));
  faces->covered[middle] = pair[covered] + 1;
  for (PetscInt e = 0; e < 2; e++) {
    AlignPositionInCopy(s, middle, copy, AlignCentre(s, pair[e ? 1 - covered : covered]), AlignCentreOf(s, k), at[e]);
    PetscCall(AlignDistance(s, k, AlignCentreOf(s, k), 1, at[e], &d[e]));
  }
  AlignPositionInCopy(s, middle, copy, middle, AlignCentreOf(s, k), x);
  for (PetscInt i = 0; i < NBISECT && d[0] < 0 && d[1] >= 0; i++) {
    PetscReal between;

    for (PetscInt a = 0; a < 3; a++) x[a] = 0.5 * (at[0][a] + at[1][a]);
    PetscCall(AlignDistance(s, k, AlignCentreOf(s, k), 1, x, &between));
    PetscCall(PetscArraycpy(at[between < 0 ? 0 : 1], x, 3));
  }
  PetscCall(AlignProject(s, k, 1, x, plane + 3));
  PetscCall(AlignWallNormal(s, k, plane + 3, 1e-3 * s->grid.size[middle], plane));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* May surface k have edges? */
static PetscBool has_edges(Align s, PetscInt k)
{
  return (PetscBool)(s->aligned[k] && !s->paths.is[k] && s->surfaces->round[k] == 0);
}

static PetscErrorCode list_faces(Align s, Faces *faces)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->marked.n; e++) {
    const PetscInt i = s->marked.i[e];

    if (s->grid.kind[i] != NODE_FACE || !AlignIsOnWall(s, i) || !has_edges(s, (s->code[i] - 1) / 2)) continue;
    if (l->node_cell_ptr[i + 1] - l->node_cell_ptr[i] == 2) PetscCall(add_face(s, i, faces));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The faces of the staircase around node i, a vertex or the middle of an edge, at most `max`: their planes */
static PetscInt faces_around(Align s, const Faces *faces, PetscInt i, PetscInt max, const PetscReal *plane[])
{
  const MeshLocal *l = s->loc;
  PetscInt         n = 0;

  for (PetscInt m = l->node_cell_ptr[i]; m < l->node_cell_ptr[i + 1]; m++) {
    const PetscInt *node = AlignCellNodes(s, l->node_cell[m]);

    if (!s->cover[l->node_cell[m]]) continue;
    for (PetscInt f = 0; f < s->grid.cell.nface && n < max; f++) {
      const PetscInt *face = s->grid.cell.face[f], middle = node[face[4]];

      for (PetscInt v = 0; faces->covered[middle] && v < 9; v++)
        if (node[face[v]] == i) plane[n++] = faces->plane + 6 * middle;
    }
  }
  return n;
}

/* Is there an edge of the surface between the planes of two faces beside the edge with middle i? */
static PetscErrorCode are_apart(Align s, PetscInt i, const PetscReal *const plane[2], PetscBool *apart)
{
  const PetscInt k   = (s->code[i] - 1) / 2;
  Meeting        how = SHARP;
  PetscReal      normal[2][3], y[2][3], x[3];

  PetscFunctionBeginUser;
  *apart = (PetscBool)(dot3(plane[0], plane[1]) < ONE);
  if (!*apart) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < 2; e++) {
    PetscCall(PetscArraycpy(normal[e], plane[e], 3));
    PetscCall(PetscArraycpy(y[e], plane[e] + 3, 3));
  }
  place_wall(s, k, i, x);
  if (intersect_planes(2, normal, y, x)) PetscCall(find_crease(s, k, s->grid.size[i], 2, normal, x, &how));
  *apart = (PetscBool)(how != SMOOTH);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Middles of edges get the sums of both faces, and are marked in s->corners.at where these are far apart */
static PetscErrorCode mark_chains(Align s, Faces *faces, PetscBool *any)
{
  PetscFunctionBeginUser;
  *any = PETSC_FALSE;
  for (PetscInt e = 0; e < s->marked.n; e++) {
    const PetscInt   i = s->marked.i[e];
    const PetscReal *plane[3];
    PetscBool        apart;

    if (i >= s->loc->nnode || s->grid.kind[i] != NODE_EDGE || !AlignIsOnWall(s, i) ||
        faces_around(s, faces, i, 3, plane) != 2)
      continue;
    for (PetscInt a = 0; a < 6; a++) faces->plane[6 * i + a] = plane[0][a] + plane[1][a];
    PetscCall(are_apart(s, i, plane, &apart));
    s->corners.at[i] = apart ? ON_EDGE : 0;
    *any             = (PetscBool)(*any || s->corners.at[i] > 0);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, any, 1, COMPAT_MPI_BOOL, MPI_LOR, s->comm));
  PetscCall(MeshSyncNodes(s->mesh, 1, s->corners.at));
  PetscCall(MeshSyncNodes(s->mesh, 6, faces->plane));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What face `middle` becomes: the plane that most of its sides have across, if three of them are in chains */
static void choose_side(Align s, const Faces *faces, PetscInt middle, PetscReal plane[6])
{
  const PetscInt *node = AlignCellNodes(s, faces->covered[middle] - 1);
  PetscReal       across[4][6];
  PetscInt        n = 0, f = 0, best = 0;

  for (PetscInt a = 0; a < 6; a++) plane[a] = faces->plane[6 * middle + a];
  while (node[s->grid.cell.face[f][4]] != middle) f++;
  for (PetscInt v = 0; v < 4; v++) {
    const PetscInt edge = node[s->grid.cell.face[f][EDGE[v]]];

    if (s->corners.at[edge] == 0) continue;
    for (PetscInt a = 0; a < 6; a++) across[n][a] = faces->plane[6 * edge + a] - faces->plane[6 * middle + a];
    n++;
  }
  for (PetscInt v = 0; v < n && n >= 3; v++) {
    PetscInt alike = 0;

    for (PetscInt w = 0; w < n; w++) alike += dot3(across[v], across[w]) >= ONE;
    for (PetscInt a = 0; a < 6 && alike > best; a++) plane[a] = across[v][a];
    best = PetscMax(best, alike);
  }
}

/* Faces with three sides in chains change sides */
static PetscErrorCode turn_faces(Align s, Faces *faces)
{
  PetscReal(*plane)[6];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(faces->list.n, &plane));
  for (PetscInt e = 0; e < faces->list.n; e++) choose_side(s, faces, faces->list.i[e], plane[e]);
  for (PetscInt e = 0; e < faces->list.n; e++)
    PetscCall(PetscArraycpy(faces->plane + 6 * faces->list.i[e], plane[e], 6));
  PetscCall(PetscFree(plane));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- vertices ---- */

/* Of the planes around a vertex the two or three that are farthest apart, in order; false: they are not */
static PetscBool choose_planes(PetscInt n, const PetscReal *const plane[], PetscInt want, const PetscReal *pick[3])
{
  PetscReal best = 0;

  for (PetscInt i = 0; i < n; i++)
    for (PetscInt j = 0; j < i; j++)
      for (PetscInt m = 0; m < (want == 3 ? j : 1); m++) {
        PetscReal c[3], apart;

        cross(plane[i], plane[j], c);
        apart = want == 3 ? PetscAbsReal(dot3(c, plane[m])) : 1 - dot3(plane[i], plane[j]);
        if (apart <= best * (1 + 1e-9)) continue;
        best    = apart;
        pick[0] = plane[i];
        pick[1] = plane[j];
        pick[2] = plane[m];
      }
  return (PetscBool)(best > (want == 3 ? 0.2 : 1 - ONE));
}

/* Own wall vertex i on a chain: where does it go? *found: it goes there */
static PetscErrorCode place_vertex(Align s, const Faces *faces, PetscInt i, PetscInt want, Crease *c, PetscBool *found)
{
  const PetscInt   k = (s->code[i] - 1) / 2, n = 24;
  const PetscReal  h = s->grid.size[i];
  const PetscReal *plane[24], *pick[3];
  PetscReal        x[3], start[3], y[3][3], gap[2], square = 0;
  Meeting          how;

  PetscFunctionBeginUser;
  *found = PETSC_FALSE;
  if (!choose_planes(faces_around(s, faces, i, n, plane), plane, want, pick)) PetscFunctionReturn(PETSC_SUCCESS);
  *c = (Crease){.vertex = i, .n = want};
  for (PetscInt e = 0; e < want; e++) {
    PetscCall(PetscArraycpy(c->normal[e], pick[e], 3));
    PetscCall(PetscArraycpy(y[e], pick[e] + 3, 3));
  }
  place_wall(s, k, i, start);
  PetscCall(PetscArraycpy(x, start, 3));
  if (!intersect_planes(want, c->normal, y, x)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_crease(s, k, h, want, c->normal, x, &how));
  for (PetscInt a = 0; a < 3; a++) square += PetscSqr(x[a] - start[a]);
  if (how != SHARP || square > PetscSqr(REACH * h)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ClearanceMeasure(s->clearance, s->aligned, k, x, gap));
  if (AlignFilmGapOffset(gap[0], CLEAR * h) > 0 || AlignFilmGapOffset(gap[1], CLEAR * h) > 0)
    PetscFunctionReturn(PETSC_SUCCESS);
  *found = PETSC_TRUE;
  for (PetscInt a = 0; a < 3; a++) s->d[3 * i + a] = x[a] - start[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool is_left(Align s, PetscInt i)
{
  for (PetscInt e = 0; e < s->corners.left.n; e++)
    if (s->corners.left.i[e] == i) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* Own wall vertices on chains go to edges and corners, which are listed; all local nodes of chains then are marked in
   s->corners.at: vertices that did so, and edges between two of them */
static PetscErrorCode place_vertices(Align s, const Faces *faces, PetscInt n, const PetscInt own[], Creases *list)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt i = own[e], k = (s->code[i] - 1) / 2;
    PetscInt       ends[8], nend;
    PetscBool      found = PETSC_FALSE;
    Crease         c;

    nend = AlignEdgesAt(s, i, PETSC_TRUE, 8, ends);
    if (nend == 0) continue;
    s->corners.count[k]++;
    if (!s->corners.wanted[k] || nend == 1 || s->grid.side[i] || is_left(s, i)) continue;
    if (nend > 2) PetscCall(place_vertex(s, faces, i, 3, &c, &found));
    if (!found) PetscCall(place_vertex(s, faces, i, 2, &c, &found));
    if (!found) continue;
    s->corners.taken[k]++;
    c.next[0] = nend == 2 ? ends[0] : -1;
    c.next[1] = nend == 2 ? ends[1] : -1;
    PetscCall(ArrayReserve(list->n + 1, &list->capacity, &list->c, sizeof(*list->c), NULL));
    list->c[list->n++] = c;
    s->corners.at[i]   = ON_EDGE;
  }
  PetscCall(MeshSyncNodes(s->mesh, 1, s->corners.at));
  for (PetscInt e = 0; e < s->marked.n; e++) {
    const PetscInt i = s->marked.i[e];
    PetscInt       end[2];

    if (s->corners.at[i] == 0) continue;
    PetscCall(AlignListAdd(&s->corners.node, i));
    if (s->grid.kind[i] != NODE_EDGE) continue;
    AlignEdgeEnds(s, i, end);
    if (s->corners.at[end[0]] == 0 || s->corners.at[end[1]] == 0) s->corners.at[i] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- along edges and beside them ---- */

/* Mean displaced place of vertices around x */
static void add_position(Align s, PetscInt i, PetscInt j, PetscReal weight, PetscReal sum[3])
{
  for (PetscInt a = 0; a < 3; a++)
    sum[a] += weight *
              (MeshNearest(s->loc, a, s->loc->x_start[3 * j + a] - s->loc->x_start[3 * i + a]) + s->d[3 * j + a]);
}

/* Own wall vertices that are at most NEXT edges away from an edge of a surface; s->work has their number on the way */
static PetscErrorCode list_beside(Align s, PetscInt n, const PetscInt own[], List *near)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->corners.node.n; e++)
    if (s->grid.kind[s->corners.node.i[e]] == NODE_VERTEX) s->work[s->corners.node.i[e]] = 1;
  for (PetscInt step = 1; step <= NEXT; step++) {
    const PetscInt begin = near->n;

    for (PetscInt e = 0; e < n; e++) {
      PetscInt  ends[12], m;
      PetscBool reached = PETSC_FALSE;

      if (s->work[own[e]] != 0 || s->grid.side[own[e]]) continue;
      m = AlignEdgesAt(s, own[e], PETSC_FALSE, 12, ends);
      for (PetscInt v = 0; v < m; v++) reached = (PetscBool)(reached || s->work[ends[v]] == step);
      if (reached) PetscCall(AlignListAdd(near, own[e]));
    }
    for (PetscInt e = begin; e < near->n; e++) s->work[near->i[e]] = step + 1;
    PetscCall(MeshSyncNodes(s->mesh, 1, s->work));
  }
  for (PetscInt e = 0; e < s->marked.n; e++) s->work[s->marked.i[e]] = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode slide(Align s, Creases *list, const List *near)
{
  PetscReal(*mean)[3];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(list->n + near->n, &mean));
  for (PetscInt sweep = 0; sweep < NSLIDE; sweep++) {
    PetscCall(MeshSyncNodes(s->mesh, 3, s->d));
    PetscCall(PetscArrayzero((PetscReal *)mean, 3 * (list->n + near->n)));
    for (PetscInt e = 0; e < list->n; e++) {
      const Crease *c = list->c + e;

      if (c->n == 2 && c->next[0] >= 0 && s->corners.at[c->next[0]] > 0 && s->corners.at[c->next[1]] > 0)
        for (PetscInt v = 0; v < 2; v++) add_position(s, c->vertex, c->next[v], 0.5, mean[e]);
      else PetscCall(PetscArraycpy(mean[e], s->d + 3 * c->vertex, 3));
    }
    for (PetscInt e = 0; e < near->n; e++) {
      PetscInt ends[12], m = AlignEdgesAt(s, near->i[e], PETSC_FALSE, 12, ends);

      for (PetscInt v = 0; v < m; v++) add_position(s, near->i[e], ends[v], 1.0 / m, mean[list->n + e]);
    }
    for (PetscInt e = 0; e < list->n; e++) {
      Crease        *c = list->c + e;
      const PetscInt i = c->vertex, k = (s->code[i] - 1) / 2;
      PetscReal      x[3], start[3];
      Meeting        how;

      place_wall(s, k, i, start);
      for (PetscInt a = 0; a < 3; a++) x[a] = start[a] + mean[e][a];
      PetscCall(find_crease(s, k, s->grid.size[i], c->n, c->normal, x, &how));
      if (how == SHARP)
        for (PetscInt a = 0; a < 3; a++) s->d[3 * i + a] = x[a] - start[a];
    }
    for (PetscInt e = 0; e < near->n; e++) PetscCall(PetscArraycpy(s->d + 3 * near->i[e], mean[list->n + e], 3));
    PetscCall(AlignProjectNodes(s, near->n, near->i, PETSC_FALSE));
  }
  PetscCall(PetscFree(mean));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Vertices at edges of all ranks */
static PetscErrorCode sum_counts(Align s)
{
  PetscReal(*sum)[2];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(s->n, &sum));
  for (PetscInt k = 0; k < s->n; k++) {
    sum[k][0] = (PetscReal)s->corners.count[k];
    sum[k][1] = (PetscReal)s->corners.taken[k];
  }
  PetscCall(AlignSumLocal(s, 2, (PetscReal *)sum));
  for (PetscInt k = 0; k < s->n; k++) {
    s->corners.count[k] = (PetscInt)sum[k][0];
    s->corners.taken[k] = (PetscInt)sum[k][1];
  }
  PetscCall(PetscFree(sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignPlaceEdges(Align s, PetscInt n, const PetscInt own[])
{
  Faces     faces = {{0, 0, NULL}, NULL, NULL};
  Creases   list  = {0, 0, NULL};
  List      near  = {0, 0, NULL};
  PetscBool any, edgy = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(s->corners.count, s->n));
  PetscCall(PetscArrayzero(s->corners.taken, s->n));
  for (PetscInt k = 0; k < s->n; k++) edgy = (PetscBool)(edgy || has_edges(s, k));
  PetscCall(AlignAny(s, &edgy));
  if (!edgy) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc2(6 * s->loc->nnode_all, &faces.plane, s->loc->nnode_all, &faces.covered));
  PetscCall(list_faces(s, &faces));
  PetscCall(mark_chains(s, &faces, &any));
  if (any) {
    for (PetscInt round = 0; round < NTURN && any; round++) {
      PetscCall(turn_faces(s, &faces));
      PetscCall(mark_chains(s, &faces, &any));
    }
    PetscCall(place_vertices(s, &faces, n, own, &list));
    PetscCall(list_beside(s, n, own, &near));
    PetscCall(slide(s, &list, &near));
    PetscCall(sum_counts(s));
  }
  PetscCall(PetscFree(near.i));
  PetscCall(PetscFree(list.c));
  PetscCall(PetscFree(faces.list.i));
  PetscCall(PetscFree2(faces.plane, faces.covered));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignLeaveBadEdges(Align s, PetscBool *any)
{
  PetscFunctionBeginUser;
  *any = PETSC_FALSE;
  for (PetscInt k = 0; k < s->n; k++) *any = (PetscBool)(*any || s->corners.taken[k]);
  PetscCall(AlignAny(s, any));
  if (!*any) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < s->bad.n; e++) {
    PetscReal longest = 0;
    PetscInt  at      = -1;

    for (PetscInt v = 0; v < s->grid.cell.ncorner; v++) {
      const PetscInt  i      = AlignCellNodes(s, s->bad.i[e])[CORNER[v]];
      const PetscReal square = dot3(s->d + 3 * i, s->d + 3 * i);

      if (s->corners.at[i] == 0 || square <= longest * (1 + 1e-9)) continue;
      longest = square;
      at      = i;
    }
    if (at >= 0) s->work[at] = 1;
  }
  PetscCall(MeshSumNodes(s->mesh, 1, s->work));
  *any = PETSC_FALSE;
  for (PetscInt e = 0; e < s->corners.node.n; e++) {
    const PetscInt i = s->corners.node.i[e];

    if (i < s->loc->nnode && s->work[i] > 0) {
      PetscCall(AlignListAdd(&s->corners.left, i));
      *any = PETSC_TRUE;
    }
    s->work[i] = 0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, any, 1, COMPAT_MPI_BOOL, MPI_LOR, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}
