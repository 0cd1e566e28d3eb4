/* Walls: see walls.h. */
#include "compat.h"
#include "../impl.h"
#include "base/sparse.h"
#include "fem/side.h"

#define BLOCK  32 /* faces that a cell rejects at once */
#define ROUNDS 30 /* of the descent, at most; planes with edges along the axes need two */

typedef struct {
  PetscReal x[3], r; /* ball around them */
} Ball;

struct _p_Walls {
  Flow       flow;
  PetscInt   dim, m;      /* nodes of a face */
  PetscInt   nown, *node; /* faces of own cells: their nodes [nown][m] */
  PetscInt   n, nblock;   /* faces of all ranks */
  PetscReal *x, *v;       /* [n][m][dim] positions and velocities of their nodes; v: NULL, all stand still */
  Ball      *ball, *block;
  PetscBool *current;  /* [ncell_all] */
  PetscReal *distance; /* [ncell_all][nq] */
  PetscInt  *face;     /* the nearest one, and where on it: [ncell_all][nq], [..][2]; only with v */
  PetscReal *at;
};

/* ---- faces ---- */

/* wall [nnode_all]: is the node on a wall? *moves: does any wall of this rank's mesh move? */
static PetscErrorCode mark_walls(Flow f, PetscBool wall[], PetscBool *moves)
{
  PetscInt nboundary;

  PetscFunctionBeginUser;
  *moves = PETSC_FALSE;
  PetscCall(PetscArrayzero(wall, f->loc->nnode_all));
  PetscCall(MeshGetBoundaryCount(f->mesh, &nboundary));
  for (PetscInt b = 0; b < nboundary; b++) {
    const PetscInt *node;
    PetscInt        n;
    PetscBool       sticks, led;

    PetscCall(ConditionsSticks(f->boundary, b, &sticks, &led));
    if (!sticks) continue;
    *moves = (PetscBool)(*moves || led);
    PetscCall(MeshGetBoundaryNodes(f->mesh, b, &n, &node));
    for (PetscInt i = 0; i < n; i++) wall[node[i]] = PETSC_TRUE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A face is on a boundary if the node in its middle is. xf: positions of the nodes of own faces; the caller frees it */
static PetscErrorCode find_own(Walls w, const PetscBool wall[], PetscReal *xf[])
{
  const MeshLocal *l   = w->flow->loc;
  const PetscInt   dim = l->dim, m = w->m;

  PetscFunctionBeginUser;
  for (PetscInt pass = 0; pass < 2; pass++) {
    w->nown = 0;
    for (PetscInt c = 0; c < l->ncell; c++) {
      PetscReal xc[MESH_MAX_NB * 3];
      PetscInt  slot[9];
      PetscBool have = PETSC_FALSE;

      for (PetscInt side = 0; side < 2 * dim; side++) {
        SideList(dim, side, slot);
        if (!wall[l->cell_node[c * l->nb + slot[m / 2]]]) continue;
        if (pass && !have) PetscCall(MeshCellCoordinates(w->flow->mesh, c, xc));
        have = PETSC_TRUE;
        for (PetscInt i = 0; i < m && pass; i++) {
          w->node[w->nown * m + i] = l->cell_node[c * l->nb + slot[i]];
          for (PetscInt a = 0; a < dim; a++) (*xf)[(w->nown * m + i) * dim + a] = xc[slot[i] * dim + a];
        }
        w->nown++;
      }
    }
    if (!pass) PetscCall(PetscMalloc1(w->nown * m, &w->node));
    if (!pass) PetscCall(PetscMalloc1(w->nown * m * dim, xf));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* *all [n][m][dim], to be freed, of own [nown][m][dim] of all ranks, in their order */
static PetscErrorCode gather_faces(Walls w, const PetscReal own[], PetscReal **all)
{
  PetscFunctionBeginUser;
  PetscCall(SparseGather(w->flow->comm, w->nown, (size_t)(w->m * w->dim) * sizeof(*own), own, &w->n, all, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal away(PetscInt dim, const PetscReal x[], const PetscReal y[])
{
  PetscReal s = 0;

  for (PetscInt a = 0; a < dim; a++) s += PetscSqr(x[a] - y[a]);
  return PetscSqrtReal(s);
}

static void set_balls(Walls w)
{
  const PetscInt dim = w->dim, m = w->m;

  for (PetscInt i = 0; i < w->n; i++) {
    Ball *b = &w->ball[i];

    b->r = 0;
    for (PetscInt a = 0; a < dim; a++) b->x[a] = w->x[(i * m + m / 2) * dim + a];
    for (PetscInt j = 0; j < m; j++) b->r = PetscMax(b->r, away(dim, b->x, w->x + (i * m + j) * dim));
    b->r *= 1.25; /* a curved face leaves the ball of its nodes */
  }
  for (PetscInt k = 0; k < w->nblock; k++) {
    const PetscInt end = PetscMin(w->n, (k + 1) * BLOCK);
    Ball          *b   = &w->block[k];

    *b = w->ball[(k * BLOCK + end) / 2];
    for (PetscInt i = k * BLOCK; i < end; i++) b->r = PetscMax(b->r, away(dim, b->x, w->ball[i].x) + w->ball[i].r);
  }
}

PetscErrorCode WallsCreate(Flow f, Walls *walls)
{
  const MeshLocal *l = f->loc;
  Walls            w;
  PetscBool       *wall, moves;
  PetscReal       *xf = NULL;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&w));
  w->flow = f;
  w->dim  = l->dim;
  w->m    = l->dim == 2 ? 3 : 9;
  PetscCall(PetscMalloc1(l->nnode_all, &wall));
  PetscCall(mark_walls(f, wall, &moves));
  PetscCall(find_own(w, wall, &xf));
  PetscCall(PetscFree(wall));
  PetscCall(gather_faces(w, xf, &w->x));
  w->nblock = (w->n + BLOCK - 1) / BLOCK;
  PetscCall(PetscFree(xf));
  PetscCall(PetscMalloc2(w->n, &w->ball, w->nblock, &w->block));
  set_balls(w);
  PetscCall(PetscCalloc1(l->ncell_all, &w->current));
  PetscCall(PetscMalloc1(l->ncell_all * f->element.nq, &w->distance));
  if (moves) {
    PetscCall(PetscCalloc1(w->n * w->m * w->dim, &w->v));
    PetscCall(PetscMalloc2(l->ncell_all * f->element.nq, &w->face, 2 * l->ncell_all * f->element.nq, &w->at));
  }
  *walls = w;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode WallsDestroy(Walls *walls)
{
  Walls w = *walls;

  PetscFunctionBeginUser;
  if (!w) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree(w->node));
  PetscCall(PetscFree(w->x));
  PetscCall(PetscFree2(w->ball, w->block));
  PetscCall(PetscFree(w->current));
  PetscCall(PetscFree(w->distance));
  if (w->v) PetscCall(PetscFree2(w->face, w->at));
  PetscCall(PetscFree(w->v));
  PetscCall(PetscFree(*walls));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode WallsForget(Walls w, PetscInt n, const PetscInt cells[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) w->current[cells[i]] = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- distances ---- */

/* The centre of a ball less the point x, of the nearest image */
static PetscReal ball_away(const MeshLocal *l, const Ball *b, const PetscReal x[], PetscReal shift[3])
{
  PetscReal s = 0;

  for (PetscInt a = 0; a < l->dim; a++) {
    const PetscReal d = b->x[a] - x[a], nearest = MeshNearest(l, a, d);

    shift[a] = nearest - d;
    s += nearest * nearest;
  }
  return PetscSqrtReal(s);
}

/* r = (point s of the face, nodes xf [m][dim]) - x, and its derivatives t [k] */
static void evaluate_face(PetscInt dim, const PetscReal xf[], const PetscReal s[2], const PetscReal x[3],
                          PetscReal r[3], PetscReal t[2][3])
{
  PetscReal v[2][3] = {{0}}, dv[2][3];

  ElementLine(s[0], v[0], dv[0]);
  if (dim == 3) ElementLine(s[1], v[1], dv[1]);
  for (PetscInt a = 0; a < dim; a++) {
    r[a]    = -x[a];
    t[0][a] = t[1][a] = 0;
  }
  for (PetscInt j = 0; j < (dim == 3 ? 9 : 3); j++) {
    const PetscInt  j0 = j % 3, j1 = j / 3;
    const PetscReal p = v[0][j0] * (dim == 3 ? v[1][j1] : 1), p0 = dv[0][j0] * (dim == 3 ? v[1][j1] : 1),
                    p1 = dim == 3 ? v[0][j0] * dv[1][j1] : 0;

    for (PetscInt a = 0; a < dim; a++) {
      r[a] += p * xf[j * dim + a];
      t[0][a] += p0 * xf[j * dim + a];
      t[1][a] += p1 * xf[j * dim + a];
    }
  }
}

/* Distance of x from a face: coordinates s in turn, each to where the face, taken as straight there, is nearest */
static PetscReal face_distance(PetscInt dim, const PetscReal xf[], const PetscReal x[3], PetscReal s[2])
{
  PetscReal r[3], t[2][3], square = 0;

  s[0] = s[1] = 0;
  for (PetscInt round = 0; round < ROUNDS; round++) {
    PetscReal change = 0;

    for (PetscInt k = 0; k < dim - 1; k++) {
      PetscReal along = 0, length = 0, next;

      evaluate_face(dim, xf, s, x, r, t);
      for (PetscInt a = 0; a < dim; a++) {
        along += r[a] * t[k][a];
        length += t[k][a] * t[k][a];
      }
      next   = PetscMin(1, PetscMax(-1, s[k] - along / length));
      change = PetscMax(change, PetscAbsReal(next - s[k]));
      s[k]   = next;
    }
    if (change < 1e-12) break;
  }
  evaluate_face(dim, xf, s, x, r, t);
  for (PetscInt a = 0; a < dim; a++) square += r[a] * r[a];
  return PetscSqrtReal(square);
}

/* Faces that may hold the nearest point to any point within `radius` of x: list [..]; returns their number */
static PetscInt find_near(Walls w, const PetscReal x[], PetscReal radius, PetscInt list[])
{
  const MeshLocal *l     = w->flow->loc;
  PetscReal        bound = PETSC_MAX_REAL, shift[3]; /* a point of a wall is that near to x */
  PetscInt         n     = 0;

  for (PetscInt k = 0; k < w->nblock; k++) {
    if (ball_away(l, &w->block[k], x, shift) - w->block[k].r > bound) continue;
    for (PetscInt i = k * BLOCK; i < PetscMin(w->n, (k + 1) * BLOCK); i++)
      bound = PetscMin(bound, ball_away(l, &w->ball[i], x, shift));
  }
  for (PetscInt k = 0; k < w->nblock; k++) {
    if (ball_away(l, &w->block[k], x, shift) - w->block[k].r > bound + 2 * radius) continue;
    for (PetscInt i = k * BLOCK; i < PetscMin(w->n, (k + 1) * BLOCK); i++)
      if (ball_away(l, &w->ball[i], x, shift) - w->ball[i].r <= bound + 2 * radius) list[n++] = i;
  }
  return n;
}

static void measure_point(Walls w, PetscInt at, const PetscReal x[3], PetscInt n, const PetscInt list[])
{
  const MeshLocal *l    = w->flow->loc;
  const PetscInt   dim  = w->dim;
  PetscReal        best = PETSC_MAX_REAL;

  for (PetscInt i = 0; i < n; i++) {
    PetscReal shift[3], y[3], s[2], d;

    if (ball_away(l, &w->ball[list[i]], x, shift) - w->ball[list[i]].r >= best) continue;
    for (PetscInt a = 0; a < dim; a++) y[a] = x[a] - shift[a];
    d = face_distance(dim, w->x + list[i] * w->m * dim, y, s);
    if (d >= best * (1 - 1e-12)) continue;
    best = d;
    if (!w->v) continue;
    w->face[at]       = list[i];
    w->at[2 * at]     = s[0];
    w->at[2 * at + 1] = s[1];
  }
  w->distance[at] = best;
}

static PetscErrorCode measure_cell(Walls w, PetscInt c, PetscInt list[])
{
  const Flow       f   = w->flow;
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, nb            = l->nb;
  PetscReal        xc[MESH_MAX_NB * 3], radius = 0;
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(f->mesh, c, xc));
  for (PetscInt j = 0; j < nb; j++) radius = PetscMax(radius, away(dim, xc + j * dim, xc + nb / 2 * dim));
  n = find_near(w, xc + nb / 2 * dim, radius, list);
  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal *phi  = f->element.phi + q * f->element.nbp;
    PetscReal        x[3] = {0, 0, 0};

    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) x[a] += phi[j] * xc[j * dim + a];
    measure_point(w, c * f->element.nq + q, x, n, list);
  }
  w->current[c] = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode gather_velocities(Walls w)
{
  const PetscReal     *value;
  const unsigned char *fixed;
  PetscReal           *own;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(w->flow->boundary, &fixed, &value));
  PetscCall(PetscMalloc1(w->nown * w->m * w->dim, &own));
  for (PetscInt i = 0; i < w->nown * w->m * w->dim; i++) own[i] = value[w->node[i / w->dim] * w->dim + i % w->dim];
  PetscCall(PetscFree(w->v));
  PetscCall(gather_faces(w, own, &w->v));
  PetscCall(PetscFree(own));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode WallsUpdate(Walls w)
{
  PetscInt *list;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(w->n, &list));
  for (PetscInt c = 0; c < w->flow->loc->ncell_all; c++)
    if (!w->current[c]) PetscCall(measure_cell(w, c, list));
  PetscCall(PetscFree(list));
  if (w->v) PetscCall(gather_velocities(w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal WallsDistance(Walls w, PetscInt c, PetscInt q, PetscReal v[3])
{
  const PetscInt  at      = c * w->flow->element.nq + q;
  const PetscReal zero[3] = {0, 0, 0};
  PetscReal       t[2][3];

  v[0] = v[1] = v[2] = 0;
  if (w->v && w->n) evaluate_face(w->dim, w->v + w->face[at] * w->m * w->dim, w->at + 2 * at, zero, v, t);
  return w->distance[at];
}
