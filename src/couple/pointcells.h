/* PointCells: in which cells points lie, own ones of a mesh or others, by a grid of bins over the cells' boxes. */
#pragma once
#include "mesh/mesh.h"

typedef struct _p_PointCells *PointCells;

/* Of the mesh as it is now; wanted [ncell]: of these own cells alone (NULL: all), which answer for points up to
   `beyond` of their half-width outside too. Not collective. */
PetscErrorCode PointCellsCreate(Mesh, const PetscBool wanted[], PetscReal beyond, PointCells *);
/* Q2 cells by themselves, [ncell][nb] nodes of `node` in the order of fem/element.h, at x [nodes][dim]: borrowed while
   they are asked. Not collective. */
PetscErrorCode PointCellsCreateOf(PetscInt dim, PetscInt ncell, const PetscInt node[], const PetscReal x[],
                                  PetscReal beyond, PointCells *cells);
PetscErrorCode PointCellsDestroy(PointCells *);
/* May one of the cells answer for a point of this ball (of its image in a periodic box)? Not collective. */
PetscBool PointCellsReach(PointCells, const PetscReal centre[], PetscReal radius);
/* The own cell in whose reference frame x [dim] is deepest, and xi [dim] there; *far: the largest |xi|. *cell -1: none
   within reach, *far is the largest number. Not collective. */
PetscErrorCode PointCellsFind(PointCells, const PetscReal x[], PetscInt *cell, PetscReal xi[], PetscReal *far);
