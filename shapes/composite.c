/* Composite: other shapes put together, in 2D and 3D. `parts` names them; <part>_shape is the type of one, its options
   have the prefix <part>_ (in a scene: nested), <part>_offset and <part>_angle (3D: about <part>_axis) put it into the
   frame of the composite. Parts are taken in their order: the first one as it is, the others by <part>_operation united
   with what is there (default), taken out of it, or intersected with it. `blend` rounds the seams between parts.

   Distance: the smallest or largest of the parts' (with blend the quadratic smooth minimum, which moves the surface out
   of a concave seam by at most blend/4 and no farther than `blend` away from it). The sign is exact and it is
   1-Lipschitz, but where parts meet its size is a lower bound only: inside behind a seam of a union, outside beyond an
   edge that an intersection or difference has cut, and, with blend, along the seam. It says so (ShapeSetBound). Normal:
   that of the part that decides. Mass by quadrature, surface points by projection (the defaults). Drawn by
   the default, too, but for unions with thin parts, which a grid misses: of these the surfaces of the parts are drawn,
   where they do not lie inside of others. */
#include "shape.h"
#include <string.h>

#define MAX_PARTS 32 /* parts */
#define CHUNK     64 /* points handled at a time on the stack */
#define THIN      64 /* a part is thin below the radius over it: twice its volume over its area */

enum {
  UNITE,
  TAKE_OUT,
  INTERSECT
};
static const char *const operation_names[] = {"union", "difference", "intersection"};

typedef struct {
  char      name[64], type[64], operation[16];
  Shape     shape;
  PetscInt  how;
  PetscReal offset[3], angle, axis[3];
  PetscReal R[3][3]; /* from the frame of the part into that of the composite */
} Part;

typedef struct {
  PetscInt  dim, n;
  char      names[2048];
  Part     *part; /* [MAX_PARTS] */
  PetscReal blend, radius;
} Composite;

static PetscErrorCode ShapeCreate_Composite(Shape s)
{
  Composite *c;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  PetscCall(ShapeSetData(s, c));
  PetscCall(ShapeGetDimension(s, &c->dim));
  PetscCall(PetscCalloc1(MAX_PARTS, &c->part));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- options ---- */

static PetscErrorCode ReadPart(Shape s, PetscInt dim, Part *p)
{
  char name[128];

  PetscFunctionBeginUser;
  PetscCall(PetscStrncpy(p->operation, operation_names[UNITE], sizeof(p->operation)));
  p->axis[2] = 1;
  PetscCall(PetscSNPrintf(name, sizeof(name), "%s_shape", p->name));
  PetscCall(ShapeOptionString(s, name, "Type of the part: any shape; its options follow with the prefix of the part",
                              p->type, sizeof(p->type)));
  PetscCall(PetscSNPrintf(name, sizeof(name), "%s_operation", p->name));
  PetscCall(ShapeOptionString(s, name, "What the part does to those before it: union, difference or intersection",
                              p->operation, sizeof(p->operation)));
  PetscCall(PetscSNPrintf(name, sizeof(name), "%s_offset", p->name));
  PetscCall(ShapeOptionRealArray(s, name, "Where the origin of the part lies", "length", PETSC_MIN_REAL, PETSC_MAX_REAL,
                                 dim, p->offset));
  PetscCall(PetscSNPrintf(name, sizeof(name), "%s_angle", p->name));
  PetscCall(ShapeOptionReal(s, name, "Angle by which the part is turned, about z or its axis", "rad", PETSC_MIN_REAL,
                            PETSC_MAX_REAL, &p->angle));
  if (dim == 2) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscSNPrintf(name, sizeof(name), "%s_axis", p->name));
  PetscCall(ShapeOptionRealArray(s, name, "Axis of the angle, of any length (default z)", "", PETSC_MIN_REAL,
                                 PETSC_MAX_REAL, 3, p->axis));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* "hub, b1" names b1, not " b1" */
static void TakeBlanks(char text[])
{
  char *o = text;

  for (const char *c = text; *c; c++)
    if (*c != ' ' && *c != '\t') *o++ = *c;
  *o = 0;
}

static PetscErrorCode ShapeOptions_Composite(Shape s)
{
  Composite *c;
  char     **name;
  int        n;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(ShapeOptionString(s, "parts", "Names of the parts, separated by commas", c->names, sizeof(c->names)));
  TakeBlanks(c->names);
  PetscCall(ShapeOptionReal(s, "blend", "Width over which the seams between parts are rounded", "length", 0.0,
                            PETSC_MAX_REAL, &c->blend));
  /* none given: for the list of options */
  PetscCall(PetscStrToArray(c->names[0] ? c->names : "<part>", ',', &n, &name));
  PetscCheck(n <= MAX_PARTS, ShapeComm(), PETSC_ERR_USER_INPUT,
             "Shape 'composite' has %d parts, %d are the most: make composites of composites", n, MAX_PARTS);
  for (int i = 0; i < n; i++) {
    const char *first = name[i] + strspn(name[i], " \t"); /* "hub, b1" */

    PetscCall(PetscStrncpy(c->part[i].name, first, sizeof(c->part[i].name)));
    c->part[i].name[strcspn(c->part[i].name, " \t")] = 0;
    PetscCall(ReadPart(s, c->dim, &c->part[i]));
  }
  PetscCall(PetscStrToArrayDestroy(n, name));
  c->n = c->names[0] ? n : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- setup ---- */

/* Rodrigues' formula */
static PetscErrorCode TurnPart(Part *p)
{
  const PetscReal *a = p->axis, length = PetscSqrtReal(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
  const PetscReal  c = PetscCosReal(p->angle), s = PetscSinReal(p->angle);

  PetscFunctionBeginUser;
  PetscCheck(length > 0, ShapeComm(), PETSC_ERR_USER_INPUT,
             "The axis of part '%s' of shape 'composite' has no length: correct its option %s_axis", p->name, p->name);
  const PetscReal u[3]    = {a[0] / length, a[1] / length, a[2] / length};
  const PetscReal K[3][3] = {{0, -u[2], u[1]}, {u[2], 0, -u[0]}, {-u[1], u[0], 0}};

  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) p->R[i][j] = (i == j ? c : 0) + s * K[i][j] + (1 - c) * u[i] * u[j];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode SetUpPart(Shape s, PetscInt dim, PetscInt i, Part *p)
{
  const char *prefix;
  char        full[256];

  PetscFunctionBeginUser;
  PetscCall(ShapeGetPrefix(s, &prefix));
  PetscCheck(p->type[0], ShapeComm(), PETSC_ERR_USER_INPUT,
             "Part '%s' of shape 'composite' has no type: give -%s%s_shape", p->name, prefix, p->name);
  p->how = -1;
  for (PetscInt k = 0; k < 3; k++)
    if (!strcmp(p->operation, operation_names[k])) p->how = k;
  PetscCheck(p->how >= 0, ShapeComm(), PETSC_ERR_USER_INPUT,
             "-%s%s_operation: '%s' is not known (known: union, difference, intersection)", prefix, p->name,
             p->operation);
  PetscCheck(i || p->how == UNITE, ShapeComm(), PETSC_ERR_USER_INPUT,
             "-%s%s_operation %s: there is nothing before the first part: put it further back in -%sparts", prefix,
             p->name, p->operation, prefix);
  PetscCall(TurnPart(p));
  PetscCall(PetscSNPrintf(full, sizeof(full), "%s%s_", prefix, p->name));
  PetscCall(ShapeCreate(p->type, full, dim, &p->shape));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Whatever adds to the body reaches no farther than its own bounding ball, and what blending adds. */
static PetscErrorCode ShapeSetUp_Composite(Shape s)
{
  Composite  *c;
  const char *prefix;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(ShapeGetPrefix(s, &prefix));
  PetscCheck(c->n, ShapeComm(), PETSC_ERR_USER_INPUT, "Shape 'composite' has no parts: name them in -%sparts", prefix);
  for (PetscInt i = 0; i < c->n; i++) {
    Part     *p = &c->part[i];
    PetscReal r;

    for (PetscInt j = 0; j < i; j++)
      PetscCheck(strcmp(c->part[j].name, p->name), ShapeComm(), PETSC_ERR_USER_INPUT,
                 "-%sparts names '%s' twice: remove one", prefix, p->name);
    PetscCall(SetUpPart(s, c->dim, i, p));
    PetscCall(ShapeGetReach(p->shape, &r));
    r += PetscSqrtReal(PetscSqr(p->offset[0]) + PetscSqr(p->offset[1]) + PetscSqr(p->offset[2]));
    if (p->how == UNITE) c->radius = PetscMax(c->radius, r);
    c->radius += i ? 0.25 * c->blend : 0;
  }
  if (c->n > 1) PetscCall(ShapeSetBound(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- geometry ---- */

static void IntoPart(const Part *p, PetscInt dim, PetscInt n, const PetscReal x[], PetscReal y[])
{
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt a = 0; a < dim; a++) {
      PetscReal sum = 0;

      for (PetscInt b = 0; b < dim; b++) sum += p->R[b][a] * (x[i * dim + b] - p->offset[b]);
      y[i * dim + a] = sum;
    }
}

/* d, of what is there, and e, of the part, to that of both; *weight: of the part in the gradient, with its sign. The
   smooth minimum (Quilez) is a mean of both with the shares of its gradient, less what makes it smooth, so that it
   stays 1-Lipschitz. */
static PetscReal Combine(PetscInt how, PetscReal blend, PetscReal d, PetscReal e, PetscReal *weight)
{
  const PetscReal side = how == UNITE ? 1 : -1, sign = how == TAKE_OUT ? -1 : 1; /* max(a, b) = -min(-a, -b) */
  const PetscReal a = side * d, b = side * sign * e,
                  over = blend > 0 ? PetscMax(1 - PetscAbsReal(a - b) / blend, 0.0) : 0;
  const PetscReal part = b < a ? 1 - 0.5 * over : 0.5 * over;

  *weight = sign * part;
  return side * (PetscMin(a, b) - 0.25 * blend * over * over);
}

/* Distances of up to CHUNK points and, if wanted, gradients, not of unit length */
static PetscErrorCode MeasureChunk(const Composite *c, PetscInt n, const PetscReal x[], PetscReal d[], PetscReal g[])
{
  const PetscInt dim = c->dim;
  PetscReal      y[CHUNK * 3], e[CHUNK], normal[CHUNK * 3];

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->n; k++) {
    const Part *p = &c->part[k];

    IntoPart(p, dim, n, x, y);
    PetscCall(ShapeDistance(p->shape, n, y, e));
    if (g) PetscCall(ShapeNormal(p->shape, n, y, normal));
    for (PetscInt i = 0; i < n; i++) {
      PetscReal weight = 1;

      d[i] = k ? Combine(p->how, c->blend, d[i], e[i], &weight) : e[i];
      for (PetscInt a = 0; a < dim && g; a++) {
        PetscReal turned = 0;

        for (PetscInt b = 0; b < dim; b++) turned += p->R[a][b] * normal[i * dim + b];
        g[i * dim + a] = (k ? (1 - PetscAbsReal(weight)) * g[i * dim + a] : 0) + weight * turned;
      }
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDistance_Composite(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Composite *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  for (PetscInt i = 0; i < n; i += CHUNK)
    PetscCall(MeasureChunk(c, PetscMin(CHUNK, n - i), x + i * c->dim, d + i, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeNormal_Composite(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Composite *c;
  PetscReal  d[CHUNK];

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  for (PetscInt i = 0; i < n; i += CHUNK)
    PetscCall(MeasureChunk(c, PetscMin(CHUNK, n - i), x + i * c->dim, d, normal + i * c->dim));
  for (PetscInt i = 0; i < n; i++) { /* without length between opposite sides */
    PetscReal *g = normal + i * c->dim, length = 0;

    for (PetscInt a = 0; a < c->dim; a++) length += g[a] * g[a];
    for (PetscInt a = 0; a < c->dim; a++) g[a] = length > 0 ? g[a] / PetscSqrtReal(length) : a == 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- drawn ---- */

static PetscReal TriangleArea(const PetscReal *a, const PetscReal *b, const PetscReal *c)
{
  PetscReal n[3], sum = 0;

  for (int i = 0; i < 3; i++) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;

    n[i] = (b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j]);
    sum += n[i] * n[i];
  }
  return 0.5 * PetscSqrtReal(sum);
}

/* The surface of a part, x [n][3] in the frame of the composite; is it thin beside a body of that radius? */
static PetscErrorCode DrawPart(const Part *p, PetscReal radius, PetscInt max, PetscInt *n, PetscReal *x[], PetscInt *nt,
                               PetscInt *t[], PetscBool *thin)
{
  ShapeMass mass;
  PetscReal area = 0, y[3];

  PetscFunctionBeginUser;
  PetscCall(ShapeTriangulate(p->shape, max, n, x, nt, t));
  PetscCall(ShapeGetMass(p->shape, &mass));
  for (PetscInt i = 0; i < *nt; i++)
    area += TriangleArea(*x + 3 * (*t)[3 * i], *x + 3 * (*t)[3 * i + 1], *x + 3 * (*t)[3 * i + 2]);
  *thin = (PetscBool)(2 * mass.volume * THIN < area * radius);
  for (PetscInt i = 0; i < *n; i++) {
    for (int a = 0; a < 3; a++) y[a] = (*x)[3 * i + a];
    for (int a = 0; a < 3; a++)
      (*x)[3 * i + a] = p->offset[a] + p->R[a][0] * y[0] + p->R[a][1] * y[1] + p->R[a][2] * y[2];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Add those of the triangles t [nt][3] of points y [n][3] that have a corner which does not lie inside of the body */
static PetscErrorCode AddTriangles(Shape s, PetscReal min, PetscInt n, const PetscReal y[], PetscInt nt,
                                   const PetscInt t[], PetscInt *npoint, PetscReal *x[], PetscInt *ntriangle,
                                   PetscInt *triangle[])
{
  PetscReal *d;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &d));
  PetscCall(ShapeDistance(s, n, y, d));
  PetscCall(PetscRealloc((*npoint + n) * 3 * sizeof(**x), x));
  PetscCall(PetscRealloc((*ntriangle + nt) * 3 * sizeof(**triangle), triangle));
  PetscCall(PetscArraycpy(*x + *npoint * 3, y, n * 3));
  for (PetscInt i = 0; i < nt; i++) {
    if (PetscMax(d[t[3 * i]], PetscMax(d[t[3 * i + 1]], d[t[3 * i + 2]])) < min) continue;
    for (int a = 0; a < 3; a++) (*triangle)[*ntriangle * 3 + a] = *npoint + t[3 * i + a];
    (*ntriangle)++;
  }
  *npoint += n;
  PetscCall(PetscFree(d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeTriangles_Composite(Shape s, PetscInt max, PetscInt *npoint, PetscReal *x[],
                                               PetscInt *ntriangle, PetscInt *triangle[])
{
  Composite *c;
  PetscBool  any = PETSC_FALSE, only_united;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  *npoint = *ntriangle = 0;
  *x                   = NULL;
  *triangle            = NULL;
  only_united          = (PetscBool)(c->blend <= 0);
  for (PetscInt k = 0; k < c->n; k++) only_united = (PetscBool)(only_united && c->part[k].how == UNITE);
  for (PetscInt k = 0; k < c->n && only_united; k++) {
    PetscReal *y;
    PetscInt   n, nt, *t;
    PetscBool  thin = PETSC_FALSE;

    PetscCall(DrawPart(&c->part[k], c->radius, max / c->n, &n, &y, &nt, &t, &thin));
    any = (PetscBool)(any || thin);
    PetscCall(AddTriangles(s, -1e-6 * c->radius, n, y, nt, t, npoint, x, ntriangle, triangle));
    PetscCall(PetscFree(y));
    PetscCall(PetscFree(t));
  }
  if (any) PetscFunctionReturn(PETSC_SUCCESS);
  *npoint = *ntriangle = 0;
  PetscCall(PetscFree(*x));
  PetscCall(PetscFree(*triangle));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Composite(Shape s, PetscReal *r)
{
  Composite *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  *r = c->radius;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Composite(Shape s, PetscViewer viewer)
{
  Composite *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  for (PetscInt i = 0; i < c->n; i++) {
    const Part *p = &c->part[i];

    PetscCall(PetscViewerASCIIPrintf(viewer, "%s: %s, %s, at (%g, %g, %g), turned by %g rad\n", p->name, p->type,
                                     p->operation, (double)p->offset[0], (double)p->offset[1], (double)p->offset[2],
                                     (double)p->angle));
  }
  if (c->blend > 0) PetscCall(PetscViewerASCIIPrintf(viewer, "seams rounded over %g m\n", (double)c->blend));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Composite(Shape s)
{
  Composite *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  for (PetscInt i = 0; i < c->n; i++) PetscCall(ShapeDestroy(&c->part[i].shape));
  PetscCall(PetscFree(c->part));
  PetscCall(PetscFree(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "composite",
  .description = "other shapes united, cut out of one another or intersected",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 3,
  .ops         = {.create    = ShapeCreate_Composite,
                  .options   = ShapeOptions_Composite,
                  .setup     = ShapeSetUp_Composite,
                  .distance  = ShapeDistance_Composite,
                  .radius    = ShapeRadius_Composite,
                  .normal    = ShapeNormal_Composite,
                  .view      = ShapeView_Composite,
                  .destroy   = ShapeDestroy_Composite,
                  .triangles = ShapeTriangles_Composite},
};
