/* Bodies bounded by triangles: from a file to the operations of a shape (see the end of shape.h). */
#include "compat.h"
#include "base/log.h"
#include "triangles.h"
#include <string.h>

#define CHECKS 20000 /* places of the quadrature that a robust surface's volume is compared with */
#define VOLUME 1e-2  /* by which they may differ, and by the error of the quadrature: */
#define SPREAD 2e-3  /* of the volume of the box */

/* ---- from a file ---- */

/* Move the origin to its place; the radius about it, and the box */
static void put_origin(Triangles t)
{
  Surface *f = &t->f;

  for (int a = 0; a < 3; a++) {
    PetscReal lower = f->x[0][a], upper = f->x[0][a];

    for (PetscInt v = 1; v < f->nvertex; v++) {
      lower = PetscMin(lower, f->x[v][a]);
      upper = PetscMax(upper, f->x[v][a]);
    }
    t->lower[a] = lower / t->scale;
    t->upper[a] = upper / t->scale;
    if (t->origin[a] == PETSC_MAX_REAL) t->origin[a] = 0.5 * (lower + upper) / t->scale;
  }
  for (PetscInt v = 0; v < f->nvertex; v++) {
    for (int a = 0; a < 3; a++) f->x[v][a] -= t->scale * t->origin[a];
    f->radius = PetscMax(f->radius, PetscSqrtReal(dot3(f->x[v], f->x[v])));
  }
}

static void find_box(Triangles t)
{
  for (int a = 0; a < 3; a++) {
    t->lower[a] = PETSC_MAX_REAL;
    t->upper[a] = -PETSC_MAX_REAL;
    for (PetscInt v = 0; v < t->f.nvertex; v++) {
      t->lower[a] = PetscMin(t->lower[a], t->f.x[v][a] / t->scale);
      t->upper[a] = PetscMax(t->upper[a], t->f.x[v][a] / t->scale);
    }
  }
}

static PetscErrorCode make_closed(Triangles t, char error[])
{
  Surface *f = &t->f;

  PetscFunctionBeginUser;
  find_box(t);
  PetscCall(TrianglesJoinEdges(t, error));
  if (error[0]) PetscFunctionReturn(PETSC_SUCCESS);
  put_origin(t);
  PetscCall(SurfaceBuildTree(f));
  PetscCall(TrianglesJoinEdges(t, error)); /* again: the tree has changed their order */
  PetscCall(SurfaceMakeNormals(f, PETSC_TRUE));
  PetscCall(TrianglesCheck(t, error));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What is wrong with a surface that is taken as it is, in one line */
static PetscErrorCode report_faults(Triangles t)
{
  const Faults *k = &t->fault;
  const struct {
    PetscInt    n;
    const char *what;
  } line[]       = {{k->open, "open edges"},
                    {k->holes, "holes, closed"},
                    {k->crowded, "edges of three or more triangles"},
                    {k->crossings, "triangles that others go through, cut"},
                    {k->turned, "turned triangles"},
                    {k->duplicate, "doubled triangles, dropped"},
                    {k->sheets, "inner sheets, dropped"},
                    {k->welded, "corners welded"}};
  char text[512] = "";

  PetscFunctionBeginUser;
  for (size_t i = 0; i < sizeof(line) / sizeof(line[0]); i++)
    if (line[i].n) {
      const size_t n = strlen(text);

      PetscCall(
        PetscSNPrintf(text + n, sizeof(text) - n, "%s%" PetscInt_FMT " %s", n ? ", " : "", line[i].n, line[i].what));
    }
  if (k->differ > 0) {
    const size_t n = strlen(text);

    PetscCall(PetscSNPrintf(text + n, sizeof(text) - n,
                            ", and about %.0f %% of its inside depends on how they are closed",
                            (double)(100 * k->differ)));
  }
  if (k->unfinished)
    PetscCall(PetscStrlcat(text, text[0] ? ", no 'endsolid': it may be cut off" : "no 'endsolid': it may be cut off",
                           sizeof(text)));
  if (text[0])
    PetscCall(LogRemark("the surface in '%s' is taken as it is (-%ssurface robust): %s", t->file, t->prefix, text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_robust(Triangles t, char error[])
{
  Surface *f = &t->f;

  PetscFunctionBeginUser;
  put_origin(t);
  PetscCall(TrianglesRepair(t, error));
  if (!error[0]) PetscCall(TrianglesCut(t, error));
  if (error[0]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SurfaceBuildTree(f));
  PetscCall(SurfaceMakeNormals(f, PETSC_FALSE));
  f->radius = 0;
  for (PetscInt i = 0; i < 3 * f->n; i++) {
    const PetscReal *x = f->x[f->triangle[i / 3][i % 3]];

    f->radius = PetscMax(f->radius, PetscSqrtReal(dot3(x, x)));
  }
  PetscCall(report_faults(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* All that follows from the corners; every rank does the same */
static PetscErrorCode make_surface(Triangles t, PetscInt n, const PetscReal xyz[], char error[])
{
  PetscFunctionBeginUser;
  PetscCall(SurfaceJoinCorners(&t->f, n, xyz, t->scale));
  if (t->f.n < 4)
    TRI_SAY("Surface file '%s' has %" PetscInt_FMT " triangles with three different corners: a body needs 4", t->file,
            t->f.n);
  else if (t->robust) PetscCall(make_robust(t, error));
  else PetscCall(make_closed(t, error));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrianglesRead(const TrianglesInput *in, Triangles *triangles)
{
  Triangles   t;
  char        error[TRI_WHY] = "";
  PetscReal  *xyz            = NULL;
  PetscInt    n              = 0;
  PetscMPIInt rank;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&t));
  *triangles = t;
  PetscCall(PetscStrncpy(t->file, in->file, sizeof(t->file)));
  PetscCall(PetscStrncpy(t->prefix, in->prefix, sizeof(t->prefix)));
  t->scale  = in->scale;
  t->robust = in->robust;
  PetscCall(PetscArraycpy(t->origin, in->origin, 3));
  PetscCallMPI(MPI_Comm_rank(ShapeComm(), &rank));
  if (!rank) PetscCall(TrianglesReadFile(t->file, &n, &xyz, &t->fault.unfinished, error));
  PetscCallMPI(MPI_Bcast(error, (int)sizeof(error), MPI_CHAR, 0, ShapeComm()));
  if (!error[0]) {
    PetscCallMPI(MPI_Bcast(&n, 1, MPIU_INT, 0, ShapeComm()));
    PetscCallMPI(MPI_Bcast(&t->fault.unfinished, 1, COMPAT_MPI_BOOL, 0, ShapeComm()));
    if (rank) PetscCall(PetscMalloc1(9 * n, &xyz));
    PetscCallMPI(MPI_Bcast(xyz, (int)(9 * n), MPIU_REAL, 0, ShapeComm()));
    PetscCall(make_surface(t, n, xyz, error));
  }
  PetscCall(PetscFree(xyz));
  PetscCheck(!error[0], ShapeComm(), PETSC_ERR_USER_INPUT, "%s", error);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrianglesDestroy(Triangles *triangles)
{
  Triangles t = *triangles;

  PetscFunctionBeginUser;
  if (!t) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SurfaceDestroy(&t->f));
  PetscCall(SurfaceDestroy(&t->all));
  PetscCall(PetscFree(t->moment));
  PetscCall(PetscFree(*triangles));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- distance ---- */

static PetscReal measure_distance(Triangles t, const Vec3 x, PetscInt *guess, PetscReal g[])
{
  Closest          c;
  PetscReal        d;
  const PetscReal *face;

  if (!t->robust) return SurfaceMeasure(&t->f, x, guess, g);
  SurfaceFindClosest(&t->f, x, guess, &c);
  d = PetscSqrtReal(c.square);
  if (SurfaceWindingFast(&t->all, t->moment, x) > 0.5) d = -d;
  if (!g) return d;
  face = t->f.face[c.triangle];
  for (int a = 0; a < 3; a++)
    g[a] = PetscAbsReal(d) > 1e-9 * t->f.radius ? (x[a] - c.y[a]) / d : dot3(face, face) > 0 ? face[a] : a == 0;
  return d;
}

PetscErrorCode TrianglesDistance(Triangles t, PetscInt n, const PetscReal x[], PetscReal d[])
{
  PetscInt guess = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) d[i] = measure_distance(t, x + 3 * i, &guess, NULL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrianglesNormal(Triangles t, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  PetscInt guess = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) (void)measure_distance(t, x + 3 * i, &guess, normal + 3 * i);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrianglesRadius(Triangles t, PetscReal *r)
{
  PetscFunctionBeginUser;
  *r = t->f.radius;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrianglesReach(Triangles t, const PetscReal c[], PetscReal *r)
{
  PetscFunctionBeginUser;
  *r = 0;
  for (PetscInt i = 0; i < 3 * t->f.n && t->robust; i++) {
    Vec3 d;

    subtract3(t->f.x[t->f.triangle[i / 3][i % 3]], c, d);
    *r = PetscMax(*r, PetscSqrtReal(dot3(d, d)) * (1 + 1e-12));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- mass ---- */

/* Integrals as of SurfaceAddMoments, by the sign at an even spread of n places in the box of the surface */
static void sample_moments(Triangles t, PetscInt n, PetscReal *volume, Vec3 first, PetscReal second[6])
{
  const int      row[6] = {0, 1, 2, 0, 0, 1}, col[6] = {0, 1, 2, 1, 2, 2};
  const TriNode *box    = &t->f.node[0];
  PetscReal      weight = 1 / (PetscReal)n;

  for (int a = 0; a < 3; a++) weight *= box->upper[a] - box->lower[a];
  for (PetscInt i = 1; i <= n; i++) {
    Vec3 x;

    for (int a = 0; a < 3; a++) { /* as in check.c */
      const PetscReal u = (PetscReal)i * PetscPowReal(1.220744084605760, -(PetscReal)(a + 1));

      x[a] = box->lower[a] + (u - PetscFloorReal(u)) * (box->upper[a] - box->lower[a]);
    }
    if (SurfaceWindingFast(&t->all, t->moment, x) <= 0.5) continue;
    *volume += weight;
    for (int a = 0; a < 3; a++) first[a] += weight * x[a];
    for (int k = 0; k < 6; k++) second[k] += weight * x[row[k]] * x[col[k]];
  }
}

/* The pieces of a robust surface may have slits where triangles hardly touch: their volume is checked. */
static PetscErrorCode add_moments(Triangles t, PetscReal *volume, Vec3 first, PetscReal second[6])
{
  PetscReal sample = 0, box = 1, other[6] = {0, 0, 0, 0, 0, 0};
  Vec3      middle = {0, 0, 0};

  PetscFunctionBeginUser;
  SurfaceAddMoments(&t->f, volume, first, second);
  if (!t->robust) PetscFunctionReturn(PETSC_SUCCESS);
  for (int a = 0; a < 3; a++) box *= t->f.node[0].upper[a] - t->f.node[0].lower[a];
  sample_moments(t, CHECKS, &sample, middle, other);
  if (PetscAbsReal(sample - *volume) <= VOLUME * sample + SPREAD * box) PetscFunctionReturn(PETSC_SUCCESS);
  *volume = 0;
  for (int a = 0; a < 3; a++) first[a] = second[a] = second[3 + a] = 0;
  sample_moments(t, 10 * CHECKS, volume, first, second);
  PetscCall(
    LogRemark("volume and inertia of the surface in '%s' are by quadrature, %.2g uncertain: its pieces do not quite meet",
              t->file, (double)(SPREAD / 5 * box / *volume)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrianglesMass(Triangles t, ShapeMass *m)
{
  const int row[6] = {0, 1, 2, 0, 0, 1}, col[6] = {0, 1, 2, 1, 2, 2};
  PetscReal second[6] = {0, 0, 0, 0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(add_moments(t, &m->volume, m->centroid, second));
  for (int a = 0; a < 3; a++) m->centroid[a] /= m->volume;
  for (int k = 0; k < 6; k++) second[k] -= m->volume * m->centroid[row[k]] * m->centroid[col[k]];
  for (int k = 0; k < 6; k++) m->inertia[k] = k < 3 ? second[0] + second[1] + second[2] - second[k] : -second[k];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- surface points, pictures ---- */

/* Equal areas in the order of the triangles, which is that of the tree; in a triangle by an even spread */
PetscErrorCode TrianglesSurface(Triangles triangles, PetscInt n, PetscReal x[], PetscReal w[])
{
  const Surface *f      = &triangles->f;
  PetscReal      before = 0, here = 0;
  PetscInt       t = -1;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < n; k++) {
    PetscReal u = (k + 1) * 0.7548776662466927, v = (k + 1) * 0.5698402909980532;

    w[k] = f->area / (PetscReal)n;
    while (t < f->n - 1 && (t < 0 || before + here < (k + 0.5) * w[k])) {
      Vec3 c;

      before += here;
      t++;
      triangle_normal(f->x[f->triangle[t][0]], f->x[f->triangle[t][1]], f->x[f->triangle[t][2]], c);
      here = 0.5 * PetscSqrtReal(dot3(c, c));
    }
    u -= PetscFloorReal(u);
    v -= PetscFloorReal(v);
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    for (int a = 0; a < 3; a++)
      x[3 * k + a] = (1 - u - v) * f->x[f->triangle[t][0]][a] + u * f->x[f->triangle[t][1]][a] +
                     v * f->x[f->triangle[t][2]][a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The triangles themselves. Too many are left to the default, which is drawn from the distance. */
PetscErrorCode TrianglesDraw(Triangles t, PetscInt max, PetscInt *npoint, PetscReal *x[], PetscInt *ntriangle,
                             PetscInt *triangle[])
{
  const Surface *f = &t->f;

  PetscFunctionBeginUser;
  *npoint = *ntriangle = 0;
  *x                   = NULL;
  *triangle            = NULL;
  if (f->n > max) PetscFunctionReturn(PETSC_SUCCESS);
  *npoint    = f->nvertex;
  *ntriangle = f->n;
  PetscCall(PetscMalloc1(3 * f->nvertex, x));
  PetscCall(PetscMalloc1(3 * f->n, triangle));
  PetscCall(PetscArraycpy(*x, &f->x[0][0], 3 * f->nvertex));
  PetscCall(PetscArraycpy(*triangle, &f->triangle[0][0], 3 * f->n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrianglesView(Triangles t, PetscViewer viewer)
{
  const Surface *f = &t->f;
  const TriNode *b = f->node;

  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer,
                                   "%s: %" PetscInt_FMT " triangles, %" PetscInt_FMT
                                   " vertices, area %g, box %g x %g x %g (scale %g), "
                                   "origin at (%g, %g, %g) of the file\n",
                                   t->file, f->n, f->nvertex, (double)f->area, (double)(b->upper[0] - b->lower[0]),
                                   (double)(b->upper[1] - b->lower[1]), (double)(b->upper[2] - b->lower[2]),
                                   (double)t->scale, (double)t->origin[0], (double)t->origin[1], (double)t->origin[2]));
  PetscFunctionReturn(PETSC_SUCCESS);
}
