/* Devicegrid: vertices of boxes and of trees as points of a lattice, and interpolation from lattices of twice the
   width, for geometric multigrid (devicelevels.h). A vertex of the wider lattice keeps its value, others have the mean
   of their neighbours there; where a neighbour hangs, that of its own neighbours, and so on. One rank, in space. */
#pragma once
#include "transfer.h"
#include <petscmat.h>

typedef struct {
  PetscInt n;
  PetscInt (*at)[3];   /* [n] lattice points; NULL: no lattice */
  PetscInt  size[3];   /* intervals along the axes */
  PetscBool period[3]; /* does the last end where the first begins? */
  PetscReal h[3];      /* widths of the intervals */
  PetscBool tree;      /* something hangs */
} DeviceGrid;

/* Of all vertices; at NULL where they are no lattice. The caller destroys it. Not collective. */
PetscErrorCode DeviceGridCreate(Mesh, Transfer, DeviceGrid *);
PetscErrorCode DeviceGridDestroy(DeviceGrid *);
/* The lattice of twice the width, along axes whose intervals are short, and P from it to this one; *P NULL: there is
   none. The caller destroys both. Not collective. */
PetscErrorCode DeviceGridCoarsen(const DeviceGrid *, DeviceGrid *coarse, Mat *P);
