/* STL: a body bounded by triangles, from a file in the STL, OBJ, PLY or OFF format. 3D only (in 2D: polygon).

   Reading, distance and mass are those of Triangles, at the end of shape.h, where the methods are described. By default
   the surface must be closed, face outwards and not cross itself; a file that breaks this is refused with what is wrong
   and where. `surface: robust` takes it as it is. The body frame has the axes of the file, times `scale`; its origin is
   at `origin` of the file, by default the middle of the bounding box. */
#include "shape.h"

typedef struct {
  char           file[PETSC_MAX_PATH_LEN], surface[32];
  TrianglesInput in;
  Triangles      triangles;
} Stl;

static PetscErrorCode ShapeCreate_Stl(Shape s)
{
  Stl *f;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  PetscCall(ShapeSetData(s, f));
  f->in.scale = 1.0;
  for (int a = 0; a < 3; a++) f->in.origin[a] = PETSC_MAX_REAL;
  PetscCall(PetscStrncpy(f->surface, "closed", sizeof(f->surface)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Stl(Shape s)
{
  Stl *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(ShapeOptionPath(s, "file", "Surface of triangles: STL (text or binary), OBJ, PLY or OFF", f->file,
                            sizeof(f->file)));
  PetscCall(ShapeOptionReal(s, "scale", "Factor on the coordinates of the file", "length", SHAPE_POSITIVE,
                            PETSC_MAX_REAL, &f->in.scale));
  PetscCall(ShapeOptionRealArray(s, "origin", "Body origin in coordinates of the file; default: the middle of its box",
                                 "", PETSC_MIN_REAL, PETSC_MAX_REAL, 3, f->in.origin));
  PetscCall(
    ShapeOptionString(s, "surface",
                      "closed: must be closed, face outwards, not cross itself; robust: holes, crossings, turned and doubled triangles are taken",
                      f->surface, sizeof(f->surface)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeSetUp_Stl(Shape s)
{
  Stl      *f;
  PetscBool closed;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(ShapeGetPrefix(s, &f->in.prefix));
  PetscCall(PetscStrcmp(f->surface, "closed", &closed));
  PetscCall(PetscStrcmp(f->surface, "robust", &f->in.robust));
  PetscCheck(closed || f->in.robust, ShapeComm(), PETSC_ERR_USER_INPUT,
             "Option -%ssurface '%s' is none of closed, robust", f->in.prefix, f->surface);
  PetscCheck(f->file[0], ShapeComm(), PETSC_ERR_USER_INPUT,
             "Shape 'stl' has no surface: set its option -%sfile to an STL, OBJ, PLY or OFF file", f->in.prefix);
  f->in.file = f->file;
  PetscCall(TrianglesRead(&f->in, &f->triangles));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDistance_Stl(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Stl *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(TrianglesDistance(f->triangles, n, x, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeNormal_Stl(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Stl *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(TrianglesNormal(f->triangles, n, x, normal));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Stl(Shape s, PetscReal *r)
{
  Stl *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(TrianglesRadius(f->triangles, r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeReach_Stl(Shape s, const PetscReal c[], PetscReal *r)
{
  Stl *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(TrianglesReach(f->triangles, c, r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeMass_Stl(Shape s, ShapeMass *m)
{
  Stl *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(TrianglesMass(f->triangles, m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeSurface_Stl(Shape s, PetscInt n, PetscReal x[], PetscReal w[])
{
  Stl *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(TrianglesSurface(f->triangles, n, x, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeTriangles_Stl(Shape s, PetscInt max, PetscInt *npoint, PetscReal *x[], PetscInt *ntriangle,
                                         PetscInt *triangle[])
{
  Stl *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(TrianglesDraw(f->triangles, max, npoint, x, ntriangle, triangle));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Stl(Shape s, PetscViewer viewer)
{
  Stl *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(TrianglesView(f->triangles, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Stl(Shape s)
{
  Stl *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(TrianglesDestroy(&f->triangles));
  PetscCall(PetscFree(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "stl",
  .description = "body bounded by the triangles of an STL, OBJ, PLY or OFF file",
  .author      = "tumble",
  .version     = "2.0",
  .dims        = 2,
  .ops         = {.create    = ShapeCreate_Stl,
                  .options   = ShapeOptions_Stl,
                  .setup     = ShapeSetUp_Stl,
                  .distance  = ShapeDistance_Stl,
                  .radius    = ShapeRadius_Stl,
                  .normal    = ShapeNormal_Stl,
                  .mass      = ShapeMass_Stl,
                  .surface   = ShapeSurface_Stl,
                  .view      = ShapeView_Stl,
                  .destroy   = ShapeDestroy_Stl,
                  .triangles = ShapeTriangles_Stl,
                  .reach     = ShapeReach_Stl},
};
