/* Polygon: any closed outline without crossings, from a list of points, or from a text file with one corner "x y" a
   line.

   '#' starts a comment; empty lines are skipped, so is a heading "x,y" of a CSV file; the last corner is joined to
   the first, which may be repeated at the end. Convex or not, in either sense of rotation. A file with crossing or
   touching edges is refused, naming the lines of both. Distance: smallest distance to all edges; sign: crossing
   number of a ray. Cost per point is proportional to the number of corners. 2D only. Mass and surface points in
   closed form (Green's theorem). The outline is scaled by `scale`; its frame is the file's own. */
#include "shape.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define MAX_CORNERS 100000
#define COS_TURN    0.9 /* of an edge against the one before, below which they make a corner */

typedef struct {
  char       file[PETSC_MAX_PATH_LEN], points[32768];
  PetscReal  scale;
  PetscInt   n;              /* corners, counter-clockwise */
  PetscReal *x, *y;          /* [n + 1], the first repeated at the end, m */
  PetscReal *ex, *ey, *inv2; /* [n] edge vectors, 1/length^2 */
  PetscReal  radius;
} Polygon;

static PetscErrorCode ShapeCreate_Polygon(Shape s)
{
  Polygon *p;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&p));
  PetscCall(ShapeSetData(s, p));
  p->scale = 1.0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Polygon(Shape s)
{
  Polygon *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  PetscCall(ShapeOptionPath(s, "file", "Text file with the corners, one 'x y' a line", p->file, sizeof(p->file)));
  PetscCall(ShapeOptionString(s, "points",
                              "Corners in place of a file: x, y of one after the other, or [[x, y], [x, y], ...]",
                              p->points, sizeof(p->points)));
  PetscCall(ShapeOptionReal(s, "scale", "Factor on the coordinates of the corners", "length", SHAPE_POSITIVE,
                            PETSC_MAX_REAL, &p->scale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- reading, on rank 0 only; errors are text for all ranks ---- */

/* Does the rest of a line hold nothing but blanks, separators or a comment? */
static PetscBool IsBlank(const char *c)
{
  while (*c == ' ' || *c == '\t' || *c == '\r' || *c == '\n' || *c == ',') c++;
  return *c == 0 || *c == '#' ? PETSC_TRUE : PETSC_FALSE;
}

/* "x,y" above the numbers, as spreadsheets write it, in quotes or not */
static PetscBool IsHeading(const char *c)
{
  char   word[4] = "";
  size_t n       = 0;

  for (; *c && *c != '#'; c++)
    if (!strchr(" \t\r\n\",", *c) && n < 3) word[n++] = *c;
  return strcasecmp(word, "xy") ? PETSC_FALSE : PETSC_TRUE;
}

static PetscErrorCode ReadCorners(const char file[], PetscInt *n, PetscReal xy[], int line_of[], char error[],
                                  size_t len)
{
  FILE *f = fopen(file, "r");
  char  line[512], *at, *end;

  PetscFunctionBeginUser;
  *n = 0;
  if (!f) {
    PetscCall(
      PetscSNPrintf(error, len,
                    "Outline file '%s' of shape 'polygon' cannot be read: set its option file to a text file with one 'x y' a line, or its option points to a list of corners",
                    file));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (int number = 1; fgets(line, sizeof(line), f) && !error[0]; number++) {
    PetscReal v[2];
    int       k;

    at = strncmp(line, "\xef\xbb\xbf", 3) ? line : line + 3; /* the mark of UTF-8 */
    if (IsBlank(at) || (*n == 0 && IsHeading(at))) continue;
    for (k = 0; k < 2; k++, at = end) {
      while (*at == ',') at++;
      v[k] = (PetscReal)strtod(at, &end);
      if (end == at || !(PetscAbsReal(v[k]) <= PETSC_MAX_REAL)) break;
    }
    if (k < 2 || !IsBlank(at))
      PetscCall(
        PetscSNPrintf(error, len, "%s:%d: expected two finite numbers 'x y', found '%.60s'", file, number, line));
    else if (*n == MAX_CORNERS)
      PetscCall(
        PetscSNPrintf(error, len, "%s:%d: more than %d corners: thin out the outline", file, number, MAX_CORNERS));
    else if (*n == 0 || v[0] != xy[2 * *n - 2] || v[1] != xy[2 * *n - 1]) { /* not a repeated one */ xy[2 * *n] = v[0];
      xy[2 * *n + 1]                                                                                            = v[1];
      line_of[(*n)++] = number;
    }
  }
  fclose(f);
  if (*n > 1 && xy[0] == xy[2 * *n - 2] && xy[1] == xy[2 * *n - 1]) (*n)--;
  if (!error[0] && *n < 3)
    PetscCall(PetscSNPrintf(error, len, "%s: an outline needs at least 3 different corners, found %d", file, (int)*n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same from "x, y, x, y, ..."; line_of: numbers of the corners */
static PetscErrorCode ReadPoints(const char text[], PetscInt *n, PetscReal xy[], int line_of[], char error[],
                                 size_t len)
{
  const char *at = text;
  char       *end;
  PetscInt    m = 0;

  PetscFunctionBeginUser;
  while (!error[0] && *(at += strspn(at, " ,\t\n"))) {
    const PetscReal v = (PetscReal)strtod(at, &end);

    if (end == at || !(PetscAbsReal(v) <= PETSC_MAX_REAL))
      PetscCall(PetscSNPrintf(error, len, "Option points of shape 'polygon': '%.20s' is not a finite number", at));
    else if (m == 2 * MAX_CORNERS)
      PetscCall(PetscSNPrintf(error, len, "Option points of shape 'polygon': more than %d corners", MAX_CORNERS));
    else xy[m++] = v;
    at = end;
  }
  *n = m / 2;
  for (PetscInt i = 0; i < *n; i++) line_of[i] = (int)i + 1;
  if (*n > 1 && xy[0] == xy[2 * *n - 2] && xy[1] == xy[2 * *n - 1]) (*n)--;
  if (!error[0] && m % 2)
    PetscCall(
      PetscSNPrintf(error, len,
                    "Option points of shape 'polygon' has %d numbers: give x and y of each corner, [[x, y], [x, y], ...]",
                    (int)m));
  if (!error[0] && *n < 3)
    PetscCall(PetscSNPrintf(error, len,
                            "Option points of shape 'polygon': an outline needs at least 3 different corners, found %d",
                            (int)*n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Twice the signed area of the triangle a b c. */
static PetscReal Turn(const PetscReal a[], const PetscReal b[], const PetscReal c[])
{
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static PetscBool Within(const PetscReal a[], const PetscReal b[], const PetscReal p[])
{
  return p[0] >= PetscMin(a[0], b[0]) && p[0] <= PetscMax(a[0], b[0]) && p[1] >= PetscMin(a[1], b[1]) &&
             p[1] <= PetscMax(a[1], b[1])
         ? PETSC_TRUE
         : PETSC_FALSE;
}

/* Do the closed segments a-b and c-d have a point in common? */
static PetscBool EdgesMeet(const PetscReal a[], const PetscReal b[], const PetscReal c[], const PetscReal d[])
{
  const PetscReal t1 = Turn(a, b, c), t2 = Turn(a, b, d), t3 = Turn(c, d, a), t4 = Turn(c, d, b);

  if (((t1 > 0 && t2 < 0) || (t1 < 0 && t2 > 0)) && ((t3 > 0 && t4 < 0) || (t3 < 0 && t4 > 0))) return PETSC_TRUE;
  return (t1 == 0 && Within(a, b, c)) || (t2 == 0 && Within(a, b, d)) || (t3 == 0 && Within(c, d, a)) ||
             (t4 == 0 && Within(c, d, b))
         ? PETSC_TRUE
         : PETSC_FALSE;
}

/* Neighbouring edges a-b, b-c share b; they overlap if c turns straight back. */
static PetscBool TurnsBack(const PetscReal a[], const PetscReal b[], const PetscReal c[])
{
  return Turn(a, b, c) == 0 && (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0 ? PETSC_TRUE
                                                                                                 : PETSC_FALSE;
}

typedef struct {
  PetscReal left, right;
  PetscInt  edge;
} Extent;

static int CompareExtents(const void *a, const void *b)
{
  const PetscReal l = ((const Extent *)a)->left, r = ((const Extent *)b)->left;

  return (l > r) - (l < r);
}

/* Sweep in x: only edges whose x-ranges overlap are compared. */
static PetscErrorCode CheckCrossings(const char file[], const char line[], PetscInt n, const PetscReal xy[],
                                     const int line_of[], char error[], size_t len)
{
  Extent *e;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &e));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal x0 = xy[2 * i], x1 = xy[2 * ((i + 1) % n)];

    e[i].left  = PetscMin(x0, x1);
    e[i].right = PetscMax(x0, x1);
    e[i].edge  = i;
  }
  qsort(e, (size_t)n, sizeof(e[0]), CompareExtents);
  for (PetscInt k = 0; k < n && !error[0]; k++)
    for (PetscInt l = k + 1; l < n && e[l].left <= e[k].right && !error[0]; l++) {
      const PetscInt   i = PetscMin(e[k].edge, e[l].edge), j = PetscMax(e[k].edge, e[l].edge);
      const PetscReal *a = xy + 2 * i, *b = xy + 2 * ((i + 1) % n), *c = xy + 2 * j, *d = xy + 2 * ((j + 1) % n);
      PetscBool        bad;

      if (j == i + 1) bad = TurnsBack(a, b, d);
      else if (i == 0 && j == n - 1) bad = TurnsBack(c, d, b);
      else bad = EdgesMeet(a, b, c, d);
      if (bad)
        PetscCall(
          PetscSNPrintf(error, len,
                        "%s: the edge from %s %d to %s %d meets the edge from %s %d to %s %d: an outline must not cross or touch itself",
                        file, line, line_of[i], line, line_of[(i + 1) % n], line, line_of[j], line,
                        line_of[(j + 1) % n]));
    }
  PetscCall(PetscFree(e));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- set-up ---- */

/* Corners to all ranks, scaled and counter-clockwise, with what distance needs of every edge. */
static PetscErrorCode StoreOutline(Polygon *p, PetscInt n, const PetscReal xy[])
{
  PetscReal area2 = 0;

  PetscFunctionBeginUser;
  p->n = n;
  PetscCall(PetscMalloc5(n + 1, &p->x, n + 1, &p->y, n, &p->ex, n, &p->ey, n, &p->inv2));
  for (PetscInt i = 0, j = n - 1; i < n; j = i++)
    area2 += (xy[2 * j] - xy[0]) * (xy[2 * i + 1] - xy[1]) - (xy[2 * i] - xy[0]) * (xy[2 * j + 1] - xy[1]);
  p->radius = 0;
  for (PetscInt i = 0; i <= n; i++) {
    const PetscInt k = area2 > 0 ? i % n : (n - i) % n;

    p->x[i]   = p->scale * xy[2 * k];
    p->y[i]   = p->scale * xy[2 * k + 1];
    p->radius = PetscMax(p->radius, PetscSqrtReal(PetscSqr(p->x[i]) + PetscSqr(p->y[i])));
  }
  for (PetscInt i = 0; i < n; i++) {
    p->ex[i]   = p->x[i + 1] - p->x[i];
    p->ey[i]   = p->y[i + 1] - p->y[i];
    p->inv2[i] = 1.0 / (PetscSqr(p->ex[i]) + PetscSqr(p->ey[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeSetUp_Polygon(Shape s)
{
  Polygon    *p;
  PetscReal  *xy;
  int        *line_of;
  char        error[1024];
  PetscInt    n = 0;
  PetscMPIInt rank;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  PetscCallMPI(MPI_Comm_rank(ShapeComm(), &rank));
  PetscCall(PetscMemzero(error, sizeof(error)));
  PetscCall(PetscMalloc2(2 * (MAX_CORNERS + 1), &xy, MAX_CORNERS + 1, &line_of));
  if (rank == 0) {
    const PetscBool listed = (PetscBool)(p->points[0] != 0);

    if (listed && p->file[0])
      PetscCall(PetscSNPrintf(error, sizeof(error),
                              "Shape 'polygon' has both its options file and points: remove one of them"));
    else if (listed) PetscCall(ReadPoints(p->points, &n, xy, line_of, error, sizeof(error)));
    else PetscCall(ReadCorners(p->file, &n, xy, line_of, error, sizeof(error)));
    if (!error[0])
      PetscCall(CheckCrossings(listed ? "Option points of shape 'polygon'" : p->file, listed ? "corner" : "line", n, xy,
                               line_of, error, sizeof(error)));
  }
  PetscCallMPI(MPI_Bcast(error, (int)sizeof(error), MPI_CHAR, 0, ShapeComm()));
  if (!error[0]) {
    PetscCallMPI(MPI_Bcast(&n, 1, MPIU_INT, 0, ShapeComm()));
    PetscCallMPI(MPI_Bcast(xy, (int)(2 * n), MPIU_REAL, 0, ShapeComm()));
    PetscCall(StoreOutline(p, n, xy));
  }
  PetscCall(PetscFree2(xy, line_of));
  PetscCheck(!error[0], ShapeComm(), PETSC_ERR_USER_INPUT, "%s", error);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- geometry ---- */

/* Squared distance to the outline and whether the point is inside. The ray test counts an edge for y in [low, high), so
   corners count once. */
static PetscReal MeasurePoint(const Polygon *p, PetscReal px, PetscReal py, PetscInt *inside)
{
  PetscReal best      = PETSC_MAX_REAL;
  PetscInt  crossings = 0;

  for (PetscInt i = 0; i < p->n; i++) {
    const PetscReal rx = px - p->x[i], ry = py - p->y[i];
    const PetscReal t  = PetscMin(PetscMax((rx * p->ex[i] + ry * p->ey[i]) * p->inv2[i], 0.0), 1.0);
    const PetscReal dx = rx - t * p->ex[i], dy = ry - t * p->ey[i], d2 = dx * dx + dy * dy;
    const PetscReal side = p->ex[i] * ry - p->ey[i] * rx; /* > 0: left of the edge */
    const PetscInt  up = (p->y[i] <= py) & (p->y[i + 1] > py), down = (p->y[i] > py) & (p->y[i + 1] <= py);

    best = d2 < best ? d2 : best;
    crossings += (up & (side > 0)) - (down & (side < 0));
  }
  *inside = crossings;
  return best;
}

static PetscErrorCode ShapeDistance_Polygon(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Polygon *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  for (PetscInt i = 0; i < n; i++) {
    PetscInt        inside;
    const PetscReal r = PetscSqrtReal(MeasurePoint(p, x[2 * i], x[2 * i + 1], &inside));

    d[i] = inside ? -r : r;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Polygon(Shape s, PetscReal *r)
{
  Polygon *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  *r = p->radius;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sums over the triangles (first corner, i, i + 1), relative to the first corner so that a far-away outline keeps its
   digits. */
static PetscErrorCode ShapeMass_Polygon(Shape s, ShapeMass *m)
{
  Polygon  *p;
  PetscReal area = 0, sx = 0, sy = 0, polar = 0;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  for (PetscInt i = 1; i < p->n - 1; i++) {
    const PetscReal ax = p->x[i] - p->x[0], ay = p->y[i] - p->y[0], bx = p->x[i + 1] - p->x[0],
                    by = p->y[i + 1] - p->y[0];
    const PetscReal a  = 0.5 * (ax * by - ay * bx);

    area += a;
    sx += a * (ax + bx) / 3.0;
    sy += a * (ay + by) / 3.0;
    polar += a * (ax * ax + ay * ay + bx * bx + by * by + ax * bx + ay * by) / 6.0;
  }
  m->volume      = area;
  m->centroid[0] = p->x[0] + sx / area;
  m->centroid[1] = p->y[0] + sy / area;
  m->inertia[2]  = polar - (sx * sx + sy * sy) / area;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Evenly spaced in arc length, half a spacing after the first corner. */
static PetscErrorCode ShapeSurface_Polygon(Shape s, PetscInt n, PetscReal x[], PetscReal w[])
{
  Polygon  *p;
  PetscReal total = 0, start = 0;
  PetscInt  k = 0;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  for (PetscInt i = 0; i < p->n; i++) total += 1.0 / PetscSqrtReal(p->inv2[i]);
  for (PetscInt i = 0; i < p->n; i++) {
    const PetscReal len = 1.0 / PetscSqrtReal(p->inv2[i]);

    for (; k < n; k++) {
      const PetscReal at = ((PetscReal)k + 0.5) * total / (PetscReal)n - start;

      if (at > len && i < p->n - 1) break;
      x[2 * k]     = p->x[i] + PetscMin(at / len, 1.0) * p->ex[i];
      x[2 * k + 1] = p->y[i] + PetscMin(at / len, 1.0) * p->ey[i];
      w[k]         = total / (PetscReal)n;
    }
    start += len;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A smooth curve drawn with many short edges has none. */
static PetscErrorCode ShapeCorners_Polygon(Shape s, PetscInt max, PetscInt *n, PetscReal x[])
{
  Polygon *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  *n = 0;
  for (PetscInt i = 0, j = p->n - 1; i < p->n; j = i++) {
    if (p->ex[i] * p->ex[j] + p->ey[i] * p->ey[j] > COS_TURN / PetscSqrtReal(p->inv2[i] * p->inv2[j])) continue;
    if (*n < max) {
      x[2 * *n]     = p->x[i];
      x[2 * *n + 1] = p->y[i];
    }
    (*n)++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Polygon(Shape s, PetscViewer viewer)
{
  Polygon *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  PetscCall(
    PetscViewerASCIIPrintf(viewer, "%" PetscInt_FMT " corners from %s, scale %g m\n", p->n, p->file, (double)p->scale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Polygon(Shape s)
{
  Polygon *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  PetscCall(PetscFree5(p->x, p->y, p->ex, p->ey, p->inv2));
  PetscCall(PetscFree(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "polygon",
  .description = "closed outline read from a text file",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 1,
  .ops         = {.create   = ShapeCreate_Polygon,
                  .options  = ShapeOptions_Polygon,
                  .setup    = ShapeSetUp_Polygon,
                  .distance = ShapeDistance_Polygon,
                  .radius   = ShapeRadius_Polygon,
                  .mass     = ShapeMass_Polygon,
                  .surface  = ShapeSurface_Polygon,
                  .view     = ShapeView_Polygon,
                  .destroy  = ShapeDestroy_Polygon,
                  .corners  = ShapeCorners_Polygon},
};
