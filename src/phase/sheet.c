/* PhaseSheet: see phase/sheet.h. Faces are handed round as they are (56 numbers each), sorted by the key of their
   middle; nodes are those of one key. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/face.h"
#include "base/sparse.h"
#include "fem/edge.h"

#define AGAINST -0.2 /* cosine: such a face faces the other way */
#define FLAT    0.25 /* sine of the angle to a wall that a shift reckons with */
#define SAME    1e-9 /* share by which distances of faces that meet at a closest point may differ */

#define OPEN   1e-6 /* share of what adds up to a volume by which one that closes may differ from itself */
#define NEAR   0.25 /* of half a face: where so near, its normal tells the sides */
#define INWARD 1e-3 /* of a distance: from walls, to tell the sides */

#define NPLACE  9    /* along a direction of a face, where it is measured */
#define ON_TOP  1.05 /* factor on what is found there */
#define NCOMMON 16   /* faces that meet at a closest point, at most */

/* A direction that is none of a mesh's (third), and two across it: right-handed */
static const PetscReal RAY[3][3] = {{0.7989054715127468, 0, -0.6014566049076158},
                                    {-0.1981872424549764, 0.9441513444078835, -0.2632490375687604},
                                    {0.5678660621265266, 0.32951212246711986, 0.7542876749835739}};

/* ---- faces ---- */

static PetscReal distance2(const PetscReal x[3], const PetscReal y[3])
{
  const PetscReal r[3] = {x[0] - y[0], x[1] - y[1], x[2] - y[2]};

  return dot3(r, r);
}

/* Square of the distance of the nearest node */
static PetscReal nearest_node2(PetscReal (*const x)[3], const PetscReal y[3])
{
  PetscReal best = distance2(x[0], y);

  for (PetscInt i = 1; i < 9; i++) best = PetscMin(best, distance2(x[i], y));
  return best;
}

/* A ball about the middle node, and the farthest from a node, by a lattice of places with something on top */
static void find_ball(PetscReal (*const x)[3], PetscReal ball[5])
{
  PetscReal radius2 = 0, far2 = 0;

  for (PetscInt i = 0; i < NPLACE * NPLACE; i++) {
    const PetscReal s[2] = {-1 + 2. / (NPLACE - 1) * (PetscReal)(i % NPLACE),
                            -1 + 2. / (NPLACE - 1) * (PetscReal)(i / NPLACE)};
    FacePoint       p;

    FaceEvaluate(3, x, s, &p);
    radius2 = PetscMax(radius2, distance2(p.x, x[4]));
    far2    = PetscMax(far2, nearest_node2(x, p.x));
  }
  for (PetscInt a = 0; a < 3; a++) ball[a] = x[4][a];
  ball[3] = ON_TOP * PetscSqrtReal(radius2);
  ball[4] = ON_TOP * PetscSqrtReal(far2);
}

/* May a face be nearer to x than best? */
static PetscBool may_be_nearer(const PetscReal ball[5], PetscReal (*const face)[3], const PetscReal x[3],
                               PetscReal best)
{
  return (PetscBool)(distance2(x, ball) <= PetscSqr(best + ball[3]) &&
                     nearest_node2(face, x) <= PetscSqr(best + ball[4]));
}

/* ---- life cycle ---- */

PetscErrorCode PhaseSheetCreate(PetscInt n, PetscInt nnode, PetscInt npart, PhaseSheet *s)
{
  PetscFunctionBeginUser;
  *s = (PhaseSheet){.n = n, .nnode = nnode, .npart = npart};
  PetscCall(PetscMalloc6(n, &s->x, n, &s->ball, n, &s->node, n, &s->drop, n, &s->part, n, &s->wall));
  PetscCall(PetscMalloc2(npart, &s->volume, npart, &s->closes));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseSheetDestroy(PhaseSheet *s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree6(s->x, s->ball, s->node, s->drop, s->part, s->wall));
  PetscCall(PetscFree2(s->volume, s->closes));
  *s = (PhaseSheet){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* At quadrature point q of 25, exact for moments of what faces bound: the place y, and the normal n times weight and
   area */
static void face_point(PetscReal (*const x)[3], PetscInt q, PetscReal y[3], PetscReal n[3])
{
  const PetscReal s[2] = {EDGE_GAUSS[q % EDGE_NGAUSS], EDGE_GAUSS[q / EDGE_NGAUSS]};
  FacePoint       p;

  FaceEvaluate(3, x, s, &p);
  cross(p.t[0], p.t[1], n);
  for (PetscInt a = 0; a < 3; a++) {
    y[a] = p.x[a];
    n[a] *= EDGE_WEIGHT[q % EDGE_NGAUSS] * EDGE_WEIGHT[q / EDGE_NGAUSS];
  }
}

#define NPOINT (EDGE_NGAUSS * EDGE_NGAUSS)

/* The ball about the middle of all that holds all faces */
static void find_whole(PhaseSheet *s)
{
  PhaseBoundBalls(3, s->n, 5, (const PetscReal *)s->ball, s->whole);
  s->whole[3] = 0;
  for (PetscInt e = 0; e < s->n; e++)
    s->whole[3] = PetscMax(s->whole[3], PetscSqrtReal(distance2(s->ball[e], s->whole)) + s->ball[e][3]);
}

/* Volume of a part, along each axis by itself: other ones where it is open, as over a period */
static void measure_part(PhaseSheet *s, PetscInt part)
{
  PetscReal volume[3] = {0}, size = 0;

  for (PetscInt e = 0; e < s->n; e++) {
    if (s->part[e] != part) continue;
    for (PetscInt q = 0; q < NPOINT; q++) {
      PetscReal y[3], n[3];

      face_point(s->x[e], q, y, n);
      for (PetscInt a = 0; a < 3; a++) {
        volume[a] += (y[a] - s->x[0][4][a]) * n[a];
        size += PetscAbsReal((y[a] - s->x[0][4][a]) * n[a]);
      }
    }
  }
  s->volume[part] = (volume[0] + volume[1] + volume[2]) / 3;
  s->closes[part] = PETSC_TRUE;
  for (PetscInt a = 0; a < 3; a++)
    if (PetscAbsReal(volume[a] - s->volume[part]) > OPEN * size) s->closes[part] = PETSC_FALSE;
}

void PhaseSheetUpdate(PhaseSheet *s)
{
  for (PetscInt e = 0; e < s->n; e++) find_ball(s->x[e], s->ball[e]);
  for (PetscInt p = 0; p < s->npart; p++) measure_part(s, p);
  find_whole(s);
}

/* ---- from all ranks ---- */

static int compare_keys(const PetscReal a[3], const PetscReal b[3])
{
  for (PetscInt i = 0; i < 3; i++)
    if (a[i] != b[i]) return a[i] < b[i] ? -1 : 1;
  return 0;
}

static int by_middle(const void *a, const void *b)
{
  return compare_keys(((const PhaseFace *)a)->key[4], ((const PhaseFace *)b)->key[4]);
}

typedef struct {
  PetscReal key[3];
  PetscInt  at; /* 9 face + node of it */
} Corner;

static int by_key(const void *a, const void *b)
{
  const Corner *s = a, *t = b;
  const int     order = compare_keys(s->key, t->key);

  return order ? order : (s->at > t->at) - (s->at < t->at);
}

/* Nodes of one key are one: corner [9 n] in order, node [n][9] */
static PetscErrorCode number_nodes(PetscInt n, const PhaseFace face[], Corner corner[], PetscInt node[],
                                   PetscInt *nnode)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 9 * n; i++) {
    corner[i].at = i;
    PetscCall(PetscArraycpy(corner[i].key, face[i / 9].key[i % 9], 3));
  }
  qsort(corner, (size_t)(9 * n), sizeof(*corner), by_key);
  *nnode = 0;
  for (PetscInt i = 0; i < 9 * n; i++) {
    if (i && compare_keys(corner[i - 1].key, corner[i].key)) (*nnode)++;
    node[corner[i].at] = *nnode;
  }
  if (n) (*nnode)++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Face e is of part p; it goes next to the face that it was reached from, whose node there is at y */
static void take_face(PhaseSheet *s, PetscInt e, PetscInt j, PetscInt p, const PetscReal y[3],
                      const PetscReal period[3])
{
  PetscReal way[3];

  s->part[e] = p;
  for (PetscInt a = 0; a < 3; a++)
    way[a] = period[a] > 0 ? period[a] * PetscFloorReal((y[a] - s->x[e][j][a]) / period[a] + 0.5) : 0;
  for (PetscInt i = 0; i < 27; i++) s->x[e][i / 3][i % 3] += way[i % 3];
}

/* Faces that share nodes are one surface; first [nnode + 1] into corner */
static void find_surfaces(PhaseSheet *s, const PetscInt first[], const Corner corner[], const PetscReal period[3],
                          PetscInt queue[])
{
  for (PetscInt e = 0; e < s->n; e++) s->part[e] = -1;
  s->npart = 0;
  for (PetscInt e = 0; e < s->n; e++) {
    PetscInt n = 1;

    if (s->part[e] >= 0) continue;
    queue[0]   = e;
    s->part[e] = s->npart;
    for (PetscInt at = 0; at < n; at++)
      for (PetscInt j = 0; j < 9; j++) {
        const PetscInt i = s->node[queue[at]][j];

        for (PetscInt q = first[i]; q < first[i + 1]; q++) {
          const PetscInt other = corner[q].at / 9;

          if (s->part[other] >= 0) continue;
          take_face(s, other, corner[q].at % 9, s->npart, s->x[queue[at]][j], period);
          queue[n++] = other;
        }
      }
    s->npart++;
  }
}

/* Nodes in the middle of edges are of an even number of faces */
static PetscErrorCode check_closed(MPI_Comm comm, const PhaseSheet *s, const PetscInt first[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 9 * s->n; i++) {
    const PetscInt node = s->node[i / 9][i % 9];

    PetscCheck(i % 9 % 2 == 0 || (first[node + 1] - first[node]) % 2 == 0, comm, PETSC_ERR_PLIB,
               "The interface of a drop is not closed at (%g, %g, %g)", (double)s->x[i / 9][i % 9][0],
               (double)s->x[i / 9][i % 9][1], (double)s->x[i / 9][i % 9][2]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode link_faces(MPI_Comm comm, PetscInt n, const PhaseFace face[], const PetscReal period[],
                                 PhaseSheet *s)
{
  Corner  *corner;
  PetscInt nnode, *node, *first, *queue;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc4(9 * n, &corner, 9 * n, &node, 9 * n + 1, &first, n, &queue));
  PetscCall(number_nodes(n, face, corner, node, &nnode));
  PetscCall(PhaseSheetCreate(n, nnode, n, s)); /* at most a part a face */
  PetscCall(PetscArraycpy((PetscInt *)s->node, node, 9 * n));
  for (PetscInt e = 0; e < n; e++) {
    PetscCall(PetscArraycpy((PetscReal *)s->x[e], (const PetscReal *)face[e].x, 27));
    s->drop[e] = (PetscInt)face[e].drop;
    s->wall[e] = (PetscBool)(face[e].wall != 0);
  }
  for (PetscInt i = 0; i < 9 * n; i++)
    if (!i || node[corner[i].at] != node[corner[i - 1].at]) first[node[corner[i].at]] = i;
  first[nnode] = 9 * n;
  PetscCall(check_closed(comm, s, first));
  find_surfaces(s, first, corner, period, queue);
  PetscCall(PetscFree4(corner, node, first, queue));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseSheetGather(MPI_Comm comm, PetscInt n, const PhaseFace face[], const PetscReal period[],
                                PhaseSheet *s)
{
  PetscInt   total;
  PhaseFace *all;

  PetscFunctionBeginUser;
  PetscCall(SparseGather(comm, n, sizeof(*face), face, &total, &all, NULL));
  qsort(all, (size_t)total, sizeof(*all), by_middle);
  PetscCall(link_faces(comm, total, all, period, s));
  PhaseSheetUpdate(s);
  PetscCall(PetscFree(all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- questions ---- */

/* The face of a part with the nearest middle */
static PetscInt nearest_middle(const PhaseSheet *s, PetscInt part, const PetscReal x[3])
{
  PetscReal best  = PETSC_MAX_REAL;
  PetscInt  which = -1;

  for (PetscInt e = 0; e < s->n; e++) {
    if (s->part[e] != part || s->wall[e] || distance2(x, s->ball[e]) >= best) continue;
    best  = distance2(x, s->ball[e]);
    which = e;
  }
  return which;
}

/* Faces that have a closest point in common */
typedef struct {
  PetscInt  n, face[NCOMMON];
  FacePoint at[NCOMMON];
} Common;

/* Sum of the normals of all faces in common that are no farther than the best */
static void common_normal(const PhaseSheet *s, const Common *common, PetscReal best, PetscReal n[3])
{
  n[0] = n[1] = n[2] = 0;
  for (PetscInt i = 0; i < common->n; i++) {
    PetscReal more[3];

    if (common->at[i].distance > best * (1 + SAME)) continue;
    FaceNormalAt(s->x[common->face[i]], common->at[i].s, more);
    for (PetscInt a = 0; a < 3; a++) n[a] += more[a];
  }
}

/* How often a triangle goes round the line through x, in front of it: 1 where the line leaves what it bounds */
static PetscInt crosses(PetscReal (*const corner)[3], const PetscReal x[3])
{
  PetscReal p[3][2], depth[3], area[3], at = 0;
  PetscInt  turns = 0;

  for (PetscInt i = 0; i < 3; i++) {
    const PetscReal r[3] = {corner[i][0] - x[0], corner[i][1] - x[1], corner[i][2] - x[2]};

    p[i][0]  = dot3(r, RAY[0]);
    p[i][1]  = dot3(r, RAY[1]);
    depth[i] = dot3(r, RAY[2]);
  }
  for (PetscInt i = 0; i < 3; i++) {
    const PetscReal *a = p[i], *b = p[(i + 1) % 3];

    area[i] = a[0] * b[1] - a[1] * b[0];
    if (a[1] <= 0 && b[1] > 0 && area[i] > 0) turns++;
    if (a[1] > 0 && b[1] <= 0 && area[i] < 0) turns--;
    at += area[i] * depth[(i + 2) % 3];
  }
  return at * (area[0] + area[1] + area[2]) > 0 ? turns : 0;
}

/* How often a part goes round x, which lies in the domain that walls bound: a little farther inside, since faces along
   walls count, by a line and the triangles of nodes */
static PetscInt count_turns(const PhaseSheet *s, PetscInt part, const PetscReal at[3], PetscReal distance)
{
  static const PetscInt TRIANGLE[8][3] = {{0, 1, 4}, {0, 4, 3}, {1, 2, 5}, {1, 5, 4},
                                          {3, 4, 7}, {3, 7, 6}, {4, 5, 8}, {4, 8, 7}};
  const PetscReal       away           = PetscSqrtReal(distance2(at, s->whole));
  const PetscReal       way            = away > 0 ? PetscMin(1, INWARD * distance / away) : 0;
  PetscInt              turns          = 0;
  PetscReal             x[3];

  for (PetscInt a = 0; a < 3; a++) x[a] = at[a] + way * (s->whole[a] - at[a]);
  for (PetscInt e = 0; e < s->n; e++) {
    const PetscReal r[3]  = {s->ball[e][0] - x[0], s->ball[e][1] - x[1], s->ball[e][2] - x[2]};
    const PetscReal depth = dot3(r, RAY[2]), radius = s->ball[e][3];

    if (s->part[e] != part || depth < -radius || dot3(r, r) - depth * depth > radius * radius) continue;
    for (PetscInt t = 0; t < 8; t++) {
      PetscReal corner[3][3];

      for (PetscInt i = 0; i < 9; i++) corner[i / 3][i % 3] = s->x[e][TRIANGLE[t][i / 3]][i % 3];
      turns += crosses(corner, x);
    }
  }
  return turns;
}

/* Of one part, nearer than reach. Next to it the normal tells the sides; farther off that is wrong where faces are
   folded, as in search_loop of curve.c. */
static PetscBool search_part(const PhaseSheet *s, PetscInt part, const PetscReal x[3], PetscReal reach, PhasePoint *p)
{
  const PetscInt start  = nearest_middle(s, part, x);
  PetscReal      best   = reach, n[3], r[3];
  Common         common = {0};

  p->edge = -1;
  for (PetscInt i = -1; i < s->n; i++) {
    const PetscInt e = i < 0 ? start : i;
    FacePoint      at;

    if (e < 0 || s->part[e] != part || s->wall[e] || i == start ||
        !may_be_nearer(s->ball[e], s->x[e], x, best * (1 + SAME)))
      continue;
    FaceNearest(3, s->x[e], x, &at);
    if (at.distance > best * (1 + SAME) || at.distance >= reach) continue;
    if (at.distance < best * (1 - SAME)) common.n = 0;
    if (common.n < NCOMMON) {
      common.face[common.n] = e;
      common.at[common.n++] = at;
    }
    if (at.distance >= best) continue;
    best    = at.distance;
    p->edge = e;
    for (PetscInt a = 0; a < 3; a++) p->y[a] = at.x[a];
  }
  if (p->edge < 0) return PETSC_FALSE;
  common_normal(s, &common, best, n);
  for (PetscInt a = 0; a < 3; a++) r[a] = x[a] - p->y[a];
  p->d = dot3(r, n) < 0 ? -best : best;
  if (best > NEAR * s->ball[p->edge][3] && s->closes[part]) {
    const PetscInt turns = count_turns(s, part, x, best);

    p->d = (s->volume[part] < 0 ? turns >= 0 : turns > 0) ? -best : best;
  }
  return PETSC_TRUE;
}

/* Are all faces farther from x than reach? */
static PetscBool is_beyond(const PhaseSheet *s, const PetscReal x[3], PetscReal reach)
{
  return (PetscBool)(distance2(x, s->whole) > PetscSqr(reach + s->whole[3]));
}

PetscReal PhaseSheetNear(const PhaseSheet *s, const PetscReal x[3], PetscReal reach)
{
  PetscReal best = reach;

  if (is_beyond(s, x, reach)) return reach;
  for (PetscInt e = 0; e < s->n; e++)
    if (!s->wall[e] && distance2(x, s->ball[e]) < PetscSqr(best + s->ball[e][3]))
      best = PetscMin(best, PetscSqrtReal(nearest_node2(s->x[e], x)));
  return best;
}

void PhaseSheetClosest(const PhaseSheet *s, const PetscReal x[3], PetscReal reach, PhasePoint *p)
{
  PhasePoint is;

  *p = (PhasePoint){.d = reach, .edge = -1};
  if (is_beyond(s, x, reach)) return;
  for (PetscInt hole = 0; hole < 2; hole++)
    for (PetscInt k = 0; k < s->npart; k++) {
      if ((s->volume[k] < 0) != hole || !search_part(s, k, x, reach, &is)) continue;
      if (p->edge < 0 || (hole ? is.d > p->d : is.d < p->d)) *p = is;
    }
}

/* Cosine between the normal in the middle of a face and a direction */
static PetscReal faces(PetscReal (*const x)[3], const PetscReal out[3])
{
  const PetscReal middle[2] = {0, 0}, size = PetscSqrtReal(dot3(out, out));
  PetscReal       n[3];

  FaceNormalAt(x, middle, n);
  return size > 0 ? dot3(n, out) / size : 0;
}

void PhaseSheetApproach(const PhaseSheet *s, const PetscReal x[3], const PetscReal out[3], PhasePoint *p)
{
  PetscInt start = -1;

  *p = (PhasePoint){.d = PETSC_MAX_REAL / 4, .edge = -1};
  for (PetscInt e = 0; e < s->n; e++)
    if (!s->wall[e] && (start < 0 || distance2(x, s->ball[e]) < distance2(x, s->ball[start])) &&
        (!out || faces(s->x[e], out) >= AGAINST))
      start = e;
  for (PetscInt i = start < 0 ? 0 : -1; i < s->n; i++) {
    const PetscInt e = i < 0 ? start : i;
    FacePoint      at;

    if (s->wall[e] || !may_be_nearer(s->ball[e], s->x[e], x, p->d)) continue;
    if (out && faces(s->x[e], out) < AGAINST) continue;
    FaceNearest(3, s->x[e], x, &at);
    if (at.distance >= p->d) continue;
    *p = (PhasePoint){.d = at.distance, .y = {at.x[0], at.x[1], at.x[2]}, .edge = e};
  }
  if (p->edge < 0 && out) PhaseSheetApproach(s, x, NULL, p);
}

/* Places in a matrix of what a symmetric tensor holds */
static const PetscInt ROW[6] = {0, 1, 2, 0, 0, 1}, COL[6] = {0, 1, 2, 1, 2, 2};

/* What a place on the surface, n the normal times the area there, adds to the moments; the place from o */
static void add_moments(PetscBool wall, const PetscReal y[3], const PetscReal n[3], PetscReal first[3],
                        PetscReal second[6], PhaseSums *s)
{
  s->area += dot3(y, n) / 3;
  *(wall ? &s->wet : &s->length) += PetscSqrtReal(dot3(n, n));
  for (PetscInt a = 0; a < 3; a++) first[a] += 0.5 * y[a] * y[a] * n[a];
  for (PetscInt i = 0; i < 6; i++) second[i] += y[ROW[i]] * y[COL[i]] * dot3(y, n) / 5;
}

void PhaseSheetMeasure(const PhaseSheet *s, PetscInt drop, PhaseSums *sums)
{
  PetscReal o[3], first[3] = {0}, second[6] = {0};
  PetscBool found = PETSC_FALSE;

  *sums = (PhaseSums){0};
  for (PetscInt e = 0; e < s->n; e++) {
    if (s->drop[e] != drop) continue;
    for (PetscInt a = 0; a < 3 && !found; a++) o[a] = s->x[e][4][a];
    found = PETSC_TRUE;
    for (PetscInt q = 0; q < NPOINT; q++) {
      PetscReal y[3], n[3];

      face_point(s->x[e], q, y, n);
      for (PetscInt a = 0; a < 3; a++) y[a] -= o[a];
      add_moments(s->wall[e], y, n, first, second, sums);
    }
  }
  if (sums->area == 0) return;
  for (PetscInt a = 0; a < 3; a++) first[a] /= sums->area;
  for (PetscInt a = 0; a < 3; a++) sums->centre[a] = o[a] + first[a];
  for (PetscInt i = 0; i < 6; i++) sums->second[i] = second[i] / sums->area - first[ROW[i]] * first[COL[i]];
}

void PhaseSheetGetFixed(const PhaseSheet *s, PetscInt fixed[])
{
  const PetscReal middle[2] = {0, 0};

  for (PetscInt i = 0; i < s->nnode; i++) fixed[i] = 0;
  for (PetscInt i = 0; i < 9 * s->n; i++) {
    PetscReal n[3];

    if (!s->wall[i / 9]) continue;
    FaceNormalAt(s->x[i / 9], middle, n);
    for (PetscInt a = 0; a < 3; a++) fixed[s->node[i / 9][i % 9]] |= PetscAbsReal(n[a]) > 0.9 ? 1 << a : 0;
  }
}

void PhaseSheetSlide(PetscInt fixed, PetscReal n[3])
{
  PetscReal along;

  for (PetscInt a = 0; a < 3; a++) n[a] = fixed >> a & 1 ? 0 : n[a];
  along = PetscSqrtReal(dot3(n, n));
  for (PetscInt a = 0; a < 3 && fixed && along > 0; a++) n[a] /= along * PetscMax(FLAT, along);
}

/* By what nodes move if the sheet is shifted by 1: along their normal n [nnode], of length 1 where it is smooth; at a
   wall, whose faces hold them, along it and farther, as the sheet meets it at an angle */
static void shift_of_nodes(const PhaseSheet *s, const PetscInt fixed[], PetscReal (*n)[3])
{
  for (PetscInt i = 0; i < 9 * s->n; i++) {
    const PetscInt to = s->node[i / 9][i % 9];
    PetscReal      more[3];

    if (s->wall[i / 9]) continue;
    FaceNodeNormal(s->x[i / 9], i % 9, more);
    for (PetscInt a = 0; a < 3; a++) n[to][a] += more[a];
  }
  for (PetscInt i = 0; i < s->nnode; i++) {
    const PetscReal whole = PetscMax(PETSC_SMALL, PetscSqrtReal(dot3(n[i], n[i])));

    for (PetscInt a = 0; a < 3; a++) n[i][a] /= whole;
    PhaseSheetSlide(fixed[i], n[i]);
  }
}

PetscErrorCode PhaseSheetShift(PhaseSheet *s, PetscInt drop, PetscReal way)
{
  PetscReal(*n)[3];
  PetscInt *fixed;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(s->nnode, &n, s->nnode, &fixed));
  PhaseSheetGetFixed(s, fixed);
  shift_of_nodes(s, fixed, n);
  for (PetscInt i = 0; i < 27 * s->n; i++)
    if (s->drop[i / 27] == drop) s->x[i / 27][i % 27 / 3][i % 3] += way * n[s->node[i / 27][i % 27 / 3]][i % 3];
  PetscCall(PetscFree2(n, fixed));
  PetscFunctionReturn(PETSC_SUCCESS);
}
