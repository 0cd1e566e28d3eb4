/* Shapes as the program uses them: what a plugin has no need to see. Points are stored [n][dim], in the body frame.
   Only ShapeView and ShapeDescribe are collective. */
#pragma once
#include "shape.h"

PetscErrorCode ShapeView(Shape, PetscViewer);
/* The line of parameters of the plugin alone (ShapeOps.view), if it has one. */
PetscErrorCode ShapeDescribe(Shape, PetscViewer);
/* Is its geometry read from a file (ShapeOptionPath)? */
PetscErrorCode ShapeIsFromFile(Shape, PetscBool *yes);
PetscErrorCode ShapeGetType(Shape, const char *type[]);
/* Closest surface points y [n][dim]: x - d grad d, iterated until |d(y)| <= 1e-12 r. */
PetscErrorCode ShapeProject(Shape, PetscInt n, const PetscReal x[], PetscReal y[]);
PetscErrorCode ShapeGetRadius(Shape, PetscReal *r);                           /* bounding radius about the CENTROID */
PetscErrorCode ShapeSurface(Shape, PetscInt n, PetscReal x[], PetscReal w[]); /* see ShapeOps.surface */
/* Corners (see ShapeOps.corners): x [n][dim], owned by the shape, found once. */
PetscErrorCode ShapeGetCorners(Shape, PetscInt *n, const PetscReal *x[]);
/* Is the shape a disc/sphere about its centroid? Then *r is its radius, otherwise 0. Closed forms in contact use it. */
PetscErrorCode ShapeGetDisc(Shape, PetscReal *r);
/* Numeric option i = 0, 1, ... that the plugin read, without prefix, and its closed range; *name is NULL past the last
   one. For test suites. */
PetscErrorCode ShapeGetOption(Shape, PetscInt i, const char *name[], PetscReal *lower, PetscReal *upper);
/* Has the shape called ShapeSetBound? */
PetscErrorCode ShapeIsBound(Shape, PetscBool *bound);
/* From now on a crash inside of a plugin, or one call that takes more than -shape_patience seconds of processor time,
   ends the process with status 1 and one line that names file and operation; crashes elsewhere go where they went
   before. For programs, after PetscInitialize; takes over SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGVTALRM and its
   timer. */
PetscErrorCode ShapeGuardInstall(void);
/* From now on ShapeCreate does not check whether distances are distances. For test suites that do so themselves. */
PetscErrorCode ShapeTrustDistances(void);
/* What the plugin says of itself. */
PetscErrorCode ShapeGetPlugin(Shape, const ShapePlugin **plugin);
/* For pictures. Outline: the closed curve *x [*n][2], counter-clockwise, at most `tolerance` bounding radii off,
   corners exact; it begins straight ahead of the centroid, along the first axis of the body. 2D; in 3D ShapeTriangulate
   (shape.h). Free it with PetscFree. Error: no surface found. */
PetscErrorCode ShapeOutline(Shape, PetscReal tolerance, PetscInt *n, PetscReal *x[]);
