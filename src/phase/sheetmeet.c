/* PhaseSheet, solids: how a sheet meets the surface of something solid (phase/sheet.h), as curves do in the plane
   (meet.c). Faces stay; their nodes inside of what is solid, and so far before it, are moved along the sheet's normal.
   From every node around them that stays a line goes on smoothly and meets the surface at the contact angle, with
   curvatures that change as in fluids at rest: where all is, a node stays where it is. A moved node goes onto the
   parabola that is nearest to both ends of these lines and to the normals there, near ones counting most. Deep inside,
   where nothing is known, that flattens out. Walls that the sheet meets at a right angle are mirrors: a node near them
   sees the images of all that. */
#include "compat.h"
#include "phase/sheet.h"
#include "base/algebra.h"
#include "base/face.h"

#define DIFFER  1e-5 /* of a length: for normals of the surface */
#define ROUNDS  40
#define PASSES  3   /* times that lines are drawn, which know how the contact line bends */
#define MOVES   4   /* times that nodes go to where the parabolas say, which know where they were */
#define INWARD  0.2 /* cosine: so much towards the surface a line goes at nearest */
#define STEEP   0.2 /* cosine between normals of the sheet: so little at least */
#define KEEPS   1   /* lengths, inside: so far the sheet goes on as outside, */
#define FADES   2   /* and so much farther half of what it rises is left */
#define CLOSE   1e-12
#define FLATTER 1e-9 /* of the trace: curvature where points are in a row */
#define NEAREST 1e-3 /* of squares of lengths, in weights, */
#define NEAR    4    /* and their power: with 2 nodes are 3 to 8 times farther off (a ball of 4 faces a radius) */
#define AROUND  0.5  /* in place of NEAREST for places that say how the surface bends */
#define TURN    0.2  /* of the chord of a line, at most */
#define MIRRORS 3    /* at most, no two across one axis */

typedef struct {
  PetscReal x[3], n[3], d; /* a node that stays, the normal of what stays of the sheet there, how far it is outside */
  PetscReal c[3], m[3];    /* where its line meets the surface, normal of the sheet there */
  PetscInt  drop;
  PetscReal turn; /* of the line's chord, outwards */
} Rim;

typedef struct {
  PhaseSheet       *sheet;
  const PhaseSolid *solid;
  PetscReal (*x)[3], *d; /* [nnode] */
  PetscBool *moves;      /* [nnode] */
  PetscInt  *fixed;      /* [nnode] by walls */
  PetscInt   nmirror, axis[MIRRORS];
  PetscReal  mirror[MIRRORS]; /* place along that axis */
  PetscInt   nrim;
  Rim       *rim; /* [nnode << nmirror] */
} Meet;

static void normalise(PetscReal n[3])
{
  const PetscReal size = PetscMax(PETSC_SMALL, PetscSqrtReal(dot3(n, n)));

  for (PetscInt a = 0; a < 3; a++) n[a] /= size;
}

static PetscErrorCode normal_at(const PhaseSolid *s, const PetscReal x[3], PetscReal n[3])
{
  const PetscReal e = DIFFER * s->h;
  PetscReal       y[18], d[6];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 18; i++) y[i] = x[i % 3] + (i / 6 == i % 3 ? (i / 3 % 2 ? -e : e) : 0);
  PetscCall((*s->distance)(s->ctx, 6, y, d, NULL));
  for (PetscInt a = 0; a < 3; a++) n[a] = d[2 * a] - d[2 * a + 1];
  normalise(n);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Part of v across n, of length 1 */
static void across(const PetscReal v[3], const PetscReal n[3], PetscReal t[3])
{
  const PetscReal along = dot3(v, n);

  for (PetscInt a = 0; a < 3; a++) t[a] = v[a] - along * n[a];
  normalise(t);
}

/* ---- which nodes ---- */

/* Nodes inside, and from there all that are near, by faces; *any: are there such? */
static PetscErrorCode find_moving(Meet *m, PetscBool *any)
{
  const PhaseSheet *s     = m->sheet;
  PetscBool         again = PETSC_TRUE;

  PetscFunctionBeginUser;
  *any = PETSC_FALSE;
  PetscCall(PetscArrayzero(m->moves, s->nnode));
  for (PetscInt i = 0; i < 9 * s->n; i++)
    if (!s->wall[i / 9] && m->d[s->node[i / 9][i % 9]] < 0) m->moves[s->node[i / 9][i % 9]] = *any = PETSC_TRUE;
  while (again) {
    again = PETSC_FALSE;
    for (PetscInt e = 0; e < s->n; e++) {
      PetscBool reached = PETSC_FALSE;

      for (PetscInt j = 0; j < 9; j++) reached = (PetscBool)(reached || m->moves[s->node[e][j]]);
      for (PetscInt j = 0; j < 9 && reached && !s->wall[e]; j++) {
        const PetscInt i = s->node[e][j];

        if (m->moves[i] || m->d[i] >= m->solid->h) continue;
        m->moves[i] = again = PETSC_TRUE;
      }
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Walls that moving nodes are on */
static void find_mirrors(Meet *m)
{
  for (PetscInt a = 0; a < 3 && m->solid->mirrors; a++)
    for (PetscInt i = 0; i < m->sheet->nnode; i++) {
      if (!m->moves[i] || !(m->fixed[i] >> a & 1)) continue;
      m->axis[m->nmirror]     = a;
      m->mirror[m->nmirror++] = m->x[i][a];
      break;
    }
}

/* Nodes that stay beside those that move */
static PetscErrorCode find_rim(Meet *m)
{
  const PhaseSheet *s = m->sheet;
  PetscBool        *beside;
  PetscInt         *drop;
  PetscReal(*n)[3];

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc3(s->nnode, &beside, s->nnode, &drop, s->nnode, &n));
  for (PetscInt e = 0; e < s->n; e++) {
    PetscBool touched = PETSC_FALSE;

    for (PetscInt j = 0; j < 9; j++) touched = (PetscBool)(touched || m->moves[s->node[e][j]]);
    for (PetscInt j = 0; j < 9 && !s->wall[e]; j++) {
      PetscReal more[3];

      drop[s->node[e][j]] = s->drop[e];
      if (touched) beside[s->node[e][j]] = (PetscBool)!m->moves[s->node[e][j]];
      if (touched) continue;
      FaceNodeNormal(s->x[e], j, more);
      for (PetscInt a = 0; a < 3; a++) n[s->node[e][j]][a] += more[a];
    }
  }
  for (PetscInt i = 0; i < s->nnode; i++) {
    Rim *r = m->rim + m->nrim;

    for (PetscInt a = 0; a < 3 && m->solid->mirrors; a++)
      if (m->fixed[i] >> a & 1) n[i][a] = 0;
    if (!beside[i] || dot3(n[i], n[i]) == 0) continue;
    normalise(n[i]);
    *r = (Rim){.d = m->d[i], .drop = drop[i]};
    for (PetscInt a = 0; a < 3; a++) {
      r->x[a] = m->x[i][a];
      r->n[a] = n[i][a];
    }
    m->nrim++;
  }
  PetscCall(PetscFree3(beside, drop, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- lines ---- */

/* From a node that stays to the surface: a chord between its tangent and the one there, turned, as in the plane */
static PetscErrorCode find_contact(const PhaseSolid *s, Rim *r)
{
  PetscReal n[3], d, angle, t[3];

  PetscFunctionBeginUser;
  PetscCall((*s->distance)(s->ctx, 1, r->x, &d, &angle));
  PetscCall(normal_at(s, r->x, n));
  across(n, r->n, t);
  for (PetscInt a = 0; a < 3; a++) r->c[a] = r->x[a];
  for (PetscInt round = 0; round < ROUNDS; round++) {
    PetscReal along[3], own[3], e[3], y[3] = {r->x[0], r->x[1], r->x[2]}, in, way[3];

    across(r->n, n, along);
    for (PetscInt a = 0; a < 3; a++) r->m[a] = PetscCosReal(angle) * n[a] + PetscSinReal(angle) * along[a];
    across(n, r->m, own);
    for (PetscInt a = 0; a < 3; a++) e[a] = -t[a] - own[a];
    normalise(e);
    for (PetscInt a = 0; a < 3; a++) e[a] += r->turn * (r->n[a] + r->m[a]) / 2;
    in = dot3(e, n);
    for (PetscInt a = 0; a < 3; a++) e[a] -= PetscMax(0, in + INWARD) * n[a];
    for (PetscInt i = 0; i < ROUNDS; i++) {
      PetscCall((*s->distance)(s->ctx, 1, y, &d, NULL));
      PetscCall(normal_at(s, y, n));
      if (PetscAbsReal(d) < CLOSE * s->h) break;
      in = PetscMax(INWARD, -dot3(e, n));
      for (PetscInt a = 0; a < 3; a++) y[a] += d / in * e[a];
    }
    for (PetscInt a = 0; a < 3; a++) way[a] = y[a] - r->c[a];
    for (PetscInt a = 0; a < 3; a++) r->c[a] = y[a];
    if (dot3(way, way) < PetscSqr(CLOSE * s->h)) break;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Behind every mirror the images of all before it; what is on it has none */
static void add_images(Meet *m)
{
  for (PetscInt p = 0; p < m->nmirror; p++) {
    const PetscInt a = m->axis[p], n = m->nrim;

    for (PetscInt k = 0; k < n; k++) {
      Rim *r = m->rim + m->nrim;

      if (PetscAbsReal(m->rim[k].x[a] - m->mirror[p]) < CLOSE * m->solid->h) continue;
      *r      = m->rim[k];
      r->x[a] = 2 * m->mirror[p] - r->x[a];
      r->c[a] = 2 * m->mirror[p] - r->c[a];
      r->n[a] = -r->n[a];
      r->m[a] = -r->m[a];
      m->nrim++;
    }
  }
}

/* ---- parabolas ---- */

static PetscReal weight_of(const PetscReal y[3], const PetscReal p[3], PetscReal h, PetscReal nearest)
{
  const PetscReal way[3] = {(p[0] - y[0]) / h, (p[1] - y[1]) / h, (p[2] - y[2]) / h};

  return 1 / PetscPowRealInt(dot3(way, way) + nearest, NEAR);
}

/* Least squares for a parabola over the plane through y with normal n: z = a0 + a1 u + a2 v + a3 u^2 + a4 u v + a5 v^2,
   lengths in h */
typedef struct {
  PetscReal y[3], frame[3][3], h; /* two tangents, n */
  PetscReal A[36], b[6];
} Parabola;

/* along: u goes there, as far as it is across n */
static void begin_parabola(Parabola *f, const PetscReal y[3], const PetscReal n[3], const PetscReal along[3],
                           PetscReal h)
{
  *f = (Parabola){.h = h};
  for (PetscInt a = 0; a < 3; a++) {
    f->y[a]        = y[a];
    f->frame[2][a] = n[a];
  }
  across(along, n, f->frame[0]);
  cross(n, f->frame[0], f->frame[1]);
}

static void add_equation(Parabola *f, PetscReal weight, const PetscReal row[6], PetscReal value)
{
  for (PetscInt i = 0; i < 36; i++) f->A[i] += weight * row[i / 6] * row[i % 6];
  for (PetscInt i = 0; i < 6; i++) f->b[i] += weight * row[i] * value;
}

/* It goes through p, where its normal is q; its height there */
static PetscReal add_point(Parabola *f, PetscReal weight, const PetscReal p[3], const PetscReal q[3])
{
  PetscReal way[3], r[3], m[3];

  for (PetscInt a = 0; a < 3; a++) way[a] = (p[a] - f->y[a]) / f->h;
  for (PetscInt a = 0; a < 3; a++) {
    r[a] = dot3(way, f->frame[a]);
    m[a] = dot3(q, f->frame[a]);
  }
  m[2] = PetscMax(STEEP, m[2]);
  add_equation(f, weight, (PetscReal[6]){1, r[0], r[1], r[0] * r[0], r[0] * r[1], r[1] * r[1]}, r[2]);
  add_equation(f, weight, (PetscReal[6]){0, 1, 0, 2 * r[0], r[1], 0}, -m[0] / m[2]);
  add_equation(f, weight, (PetscReal[6]){0, 0, 1, 0, r[0], 2 * r[1]}, -m[1] / m[2]);
  return r[2];
}

static void solve_parabola(Parabola *f, PetscReal x[6])
{
  PetscReal inverse[36], trace = 0;

  for (PetscInt i = 0; i < 6; i++) trace += f->A[7 * i];
  for (PetscInt i = 3; i < 6; i++) f->A[7 * i] += FLATTER * trace;
  DenseInvert(6, f->A, inverse);
  DenseMultiply(6, inverse, PETSC_FALSE, f->b, x);
}

/* ---- how much the chord of a line is turned ---- */

/* How much the sheet bends outwards across a line, at its end on the surface or at the other, by all such ends */
static PetscReal bend_across(const Meet *m, const Rim *of, PetscBool end)
{
  const PetscReal h = m->solid->h, *y = end ? of->c : of->x;
  PetscReal       way[3], x[6];
  Parabola        f;

  for (PetscInt a = 0; a < 3; a++) way[a] = of->c[a] - of->x[a];
  begin_parabola(&f, y, end ? of->m : of->n, way, h);
  for (PetscInt k = 0; k < m->nrim; k++) {
    const Rim       *r = m->rim + k;
    const PetscReal *p = end ? r->c : r->x;

    (void)add_point(&f, weight_of(y, p, h, AROUND), p, end ? r->m : r->n);
  }
  solve_parabola(&f, x);
  return 2 * x[5] / h;
}

/* The curvature along a line changes evenly from end to end: as both curvatures do together at rest, less what that
   across it does */
static void find_turn(const Meet *m, Rim *r)
{
  const PetscReal way[3] = {r->c[0] - r->x[0], r->c[1] - r->x[1], r->c[2] - r->x[2]},
                  length = PetscSqrtReal(dot3(way, way));
  PetscReal gradient[3]  = {0}, change;

  if (length < CLOSE * m->solid->h) return;
  if (m->solid->level) (*m->solid->level)(m->solid->ctx, r->drop, gradient);
  change  = dot3(gradient, way) - bend_across(m, r, PETSC_TRUE) + bend_across(m, r, PETSC_FALSE);
  r->turn = PetscMax(-TURN, PetscMin(TURN, -change * length / 12));
}

/* Lines from all nodes that stay, and their images */
static PetscErrorCode find_lines(Meet *m)
{
  const PetscInt n = m->nrim;

  PetscFunctionBeginUser;
  for (PetscInt pass = 0; pass < PASSES; pass++) {
    for (PetscInt k = 0; k < n && pass; k++) find_turn(m, m->rim + k);
    m->nrim = n;
    for (PetscInt k = 0; k < n; k++) PetscCall(find_contact(m->solid, m->rim + k));
    add_images(m);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- where nodes go ---- */

static void move_node(const Meet *m, PetscInt i)
{
  const PetscReal h = m->solid->h, d = m->d[i], deep = PetscMax(0, -d / h - KEEPS) / FADES;
  PetscReal       n[3] = {0}, contact = 0, sum = 0, up, *x = m->x[i], axis[3] = {0}, height[6];
  Parabola        f;

  for (PetscInt k = 0; k < m->nrim; k++)
    for (PetscInt a = 0; a < 3; a++) n[a] += weight_of(x, m->rim[k].x, h, NEAREST) * m->rim[k].n[a];
  normalise(n);
  axis[PetscAbsReal(n[0]) < 0.6 ? 0 : 1] = 1;
  begin_parabola(&f, x, n, axis, h);
  for (PetscInt k = 0; k < m->nrim; k++) {
    const Rim      *r = m->rim + k;
    const PetscReal v = weight_of(x, r->c, h, NEAREST);

    (void)add_point(&f, weight_of(x, r->x, h, NEAREST), r->x, r->n);
    contact += v * add_point(&f, v, r->c, r->m);
    sum += v;
  }
  contact /= sum;
  solve_parabola(&f, height);
  up = h * (contact + (height[0] - contact) / (1 + deep * deep));
  PhaseSheetSlide(m->fixed[i], n);
  for (PetscInt a = 0; a < 3; a++) x[a] += up * n[a];
}

PetscErrorCode PhaseSheetMeet(PhaseSheet *s, const PhaseSolid *solid)
{
  Meet      m   = {.sheet = s, .solid = solid};
  PetscBool any = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc4(s->nnode, &m.x, s->nnode, &m.d, s->nnode, &m.moves, s->nnode, &m.fixed));
  for (PetscInt i = 0; i < 27 * s->n; i++) m.x[s->node[i / 27][i % 27 / 3]][i % 3] = s->x[i / 27][i % 27 / 3][i % 3];
  PetscCall((*solid->distance)(solid->ctx, s->nnode, (const PetscReal *)m.x, m.d, NULL));
  PhaseSheetGetFixed(s, m.fixed);
  PetscCall(find_moving(&m, &any));
  find_mirrors(&m);
  PetscCall(PetscMalloc1(s->nnode << m.nmirror, &m.rim));
  if (any) PetscCall(find_rim(&m));
  PetscCall(find_lines(&m));
  for (PetscInt round = 0; round < MOVES && m.nrim; round++) {
    for (PetscInt i = 0; i < s->nnode; i++)
      if (m.moves[i]) move_node(&m, i);
    PetscCall((*solid->distance)(solid->ctx, s->nnode, (const PetscReal *)m.x, m.d, NULL));
  }
  for (PetscInt i = 0; i < 27 * s->n; i++) s->x[i / 27][i % 27 / 3][i % 3] = m.x[s->node[i / 27][i % 27 / 3]][i % 3];
  PetscCall(PetscFree(m.rim));
  PetscCall(PetscFree4(m.x, m.d, m.moves, m.fixed));
  PhaseSheetUpdate(s);
  PetscFunctionReturn(PETSC_SUCCESS);
}
