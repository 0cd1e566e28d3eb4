/* What a closed surface must be: each edge between two triangles, outwards, nowhere through itself. */
#include "compat.h"
#include "triangles.h"

#define SAMPLES 100 /* places where the sign is compared with the winding number */
#define REMEDY  "Repair it with a mesh program, or take it as it is with -%ssurface robust"

#define POSITION(t, x) \
  (double)((x)[0] / (t)->scale + (t)->origin[0]), (double)((x)[1] / (t)->scale + (t)->origin[1]), \
    (double)((x)[2] / (t)->scale + (t)->origin[2])

PetscErrorCode TrianglesJoinEdges(Triangles t, char error[])
{
  Surface *f        = &t->f;
  PetscInt wrong[3] = {0, 0, 0}, at = -1; /* open, crowded, turned; first place */
  TriEdge *e;

  PetscFunctionBeginUser;
  if (!f->next) PetscCall(PetscMalloc1(f->n, &f->next));
  PetscCall(SurfaceGetEdges(f, &e));
  for (PetscInt i = 0, j; i < 3 * f->n; i = j) {
    PetscInt kind = -1;

    for (j = i; j < 3 * f->n && e[j].low == e[i].low && e[j].high == e[i].high; j++)
      ;
    if (j - i == 1) kind = 0;
    else if (j - i > 2) kind = 1;
    else if (TriEdgeIsUp(f, e + i) == TriEdgeIsUp(f, e + i + 1)) kind = 2;
    else {
      f->next[e[i].side / 3][e[i].side % 3]         = e[i + 1].side / 3;
      f->next[e[i + 1].side / 3][e[i + 1].side % 3] = e[i].side / 3;
    }
    if (kind < 0) continue;
    wrong[kind]++;
    if (at < 0) at = e[i].low;
  }
  if (at >= 0)
    TRI_SAY("The surface in '%s' does not bound a body: of its edges, %" PetscInt_FMT
            " have a triangle on one side only (holes), %" PetscInt_FMT " have more than two, at %" PetscInt_FMT
            " the triangles face to opposite sides (turned normals); the first at (%g, %g, %g) of the file%s. "
            "Its box is %g x %g x %g. " REMEDY,
            t->file, wrong[0], wrong[1], wrong[2], (double)(f->x[at][0] / t->scale), (double)(f->x[at][1] / t->scale),
            (double)(f->x[at][2] / t->scale), t->fault.unfinished ? ", which has no 'endsolid' and may be cut off" : "",
            (double)(t->upper[0] - t->lower[0]), (double)(t->upper[1] - t->lower[1]),
            (double)(t->upper[2] - t->lower[2]), t->prefix);
  PetscCall(PetscFree(e));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- does the surface cross itself? ---- */

/* Does the segment from p to q pass through the inside of triangle t? (Moeller & Trumbore 1997) */
static PetscBool passes_through(const Surface *f, PetscInt t, const Vec3 p, const Vec3 q)
{
  const PetscReal tolerance = 1e-9, *a = f->x[f->triangle[t][0]];
  Vec3            e1, e2, d, h, s, k;
  PetscReal       det, u, v, w;

  subtract3(f->x[f->triangle[t][1]], a, e1);
  subtract3(f->x[f->triangle[t][2]], a, e2);
  subtract3(q, p, d);
  cross(d, e2, h);
  det = dot3(e1, h);
  if (PetscAbsReal(det) <= tolerance * PetscSqrtReal(dot3(e1, e1) * dot3(e2, e2) * dot3(d, d))) return PETSC_FALSE;
  subtract3(p, a, s);
  u = dot3(s, h) / det;
  cross(s, e1, k);
  v = dot3(d, k) / det;
  w = dot3(e2, k) / det;
  return u > tolerance && v > tolerance && u + v < 1 - tolerance && w > tolerance && w < 1 - tolerance ? PETSC_TRUE
                                                                                                       : PETSC_FALSE;
}

/* Some triangle that edge e of triangle t passes through, or -1 */
static PetscInt find_crossed(const Surface *f, PetscInt t, int e)
{
  const PetscInt   v = f->triangle[t][e], w = f->triangle[t][(e + 1) % 3];
  const PetscReal *p = f->x[v], *q       = f->x[w];
  PetscInt         stack[TRI_DEPTH], top = 0;

  stack[top++] = 0;
  while (top) {
    const TriNode *b     = &f->node[stack[--top]];
    PetscBool      apart = PETSC_FALSE;

    for (int a = 0; a < 3; a++)
      if (PetscMax(p[a], q[a]) < b->lower[a] || PetscMin(p[a], q[a]) > b->upper[a]) apart = PETSC_TRUE;
    if (apart) continue;
    for (PetscInt i = b->first; i < b->first + b->count; i++) {
      PetscBool shared = PETSC_FALSE;

      for (int c = 0; c < 3; c++)
        if (f->triangle[i][c] == v || f->triangle[i][c] == w) shared = PETSC_TRUE;
      if (!shared && passes_through(f, i, p, q)) return i;
    }
    if (b->count) continue;
    stack[top++] = (PetscInt)(b - f->node) + 1;
    stack[top++] = b->first;
  }
  return -1;
}

/* The sign of the distance is that of the winding number at a sample of places, which finds parts that lie in one
   another the wrong way */
static PetscErrorCode check_winding(Triangles t, char error[])
{
  const Surface *f     = &t->f;
  PetscInt       guess = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 1; i <= SAMPLES && !error[0]; i++) {
    Vec3 x;

    for (int a = 0; a < 3; a++) { /* an even spread: powers of the root of g^4 = g + 1 */
      const PetscReal u = (PetscReal)i * PetscPowReal(1.220744084605760, -(PetscReal)(a + 1));

      x[a] = f->node[0].lower[a] + (u - PetscFloorReal(u)) * (f->node[0].upper[a] - f->node[0].lower[a]);
    }
    const PetscReal d = SurfaceMeasure(f, x, &guess, NULL), winding = SurfaceWinding(f, x);

    if (PetscAbsReal(d) > 1e-6 * f->radius && PetscAbsReal(winding - (d < 0)) > 0.01)
      TRI_SAY("The surface in '%s' winds %.2g times around (%g, %g, %g) of the file, where its closest triangle says %s: a part lies inside of another, "
              "or faces inwards. " REMEDY,
              t->file, (double)winding, POSITION(t, x), d < 0 ? "inside" : "outside", t->prefix);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrianglesCheck(Triangles t, char error[])
{
  const Surface *f      = &t->f;
  PetscReal      volume = 0, second[6] = {0, 0, 0, 0, 0, 0};
  Vec3           first = {0, 0, 0};

  PetscFunctionBeginUser;
  SurfaceAddMoments(f, &volume, first, second);
  if (!(volume > 0))
    TRI_SAY("The surface in '%s' faces inwards (its volume is %g): turn all normals with a mesh program, or take it as it is with -%ssurface robust",
            t->file, (double)volume, t->prefix);
  for (PetscInt i = 0; i < 3 * f->n && !error[0]; i++) {
    const PetscInt   hit = find_crossed(f, i / 3, (int)(i % 3));
    const PetscReal *x   = f->x[f->triangle[i / 3][i % 3]];

    if (hit >= 0)
      TRI_SAY("The surface in '%s' crosses itself, at (%g, %g, %g) of the file or close to it: join its parts with a mesh program, or take it as it is "
              "with -%ssurface robust",
              t->file, POSITION(t, x), t->prefix);
  }
  if (!error[0]) PetscCall(check_winding(t, error));
  PetscFunctionReturn(PETSC_SUCCESS);
}
