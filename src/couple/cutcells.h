/* CutCells: the part of every cell that lies in a body, integrated with n x n (x n) sub-cells and an indicator that
   falls linearly from 1 to 0 over the width of a sub-cell about the surface. Cells that lie inside as a whole are
   parts as well.

   Own and ghost cells are treated alike, so that sums at own nodes are complete without communication. Products of
   basis functions factorise over the axes, so the integrals of all phi_i phi_j follow from the 6^dim moments of the
   samples with the six products of the one-dimensional functions. */
#pragma once
#include "bodies/bodies.h"
#include "flow/device.h"
#include "flow/flow.h"

typedef struct _p_CutCells *CutCells;

typedef struct {
  PetscInt  cell, body, moments; /* moments: offset in the pool, -1 for a whole cell */
  PetscReal volume;              /* of the part */
  PetscReal P[3], X[3];          /* reference point and place of the body, as the image that meets the cell */
  PetscReal radius;              /* of the body, if its distance is that of a ball; 0: of others */
} CutCell;

#define CUT_MAX_SAMPLES 20

/* Radius of the ball about the centre node that holds the cell (1.1: curved edges): the signed distance changes by at
   most the way, so the ball decides what is far. The largest of this rank's cells. Local. */
PetscErrorCode CutCellRadius(Mesh, PetscInt cell, PetscReal *radius);
PetscErrorCode CutCellReach(Mesh, PetscReal *reach);

/* nsample: n. Collective. */
PetscErrorCode CutCellsCreate(Flow, Bodies, PetscInt nsample, CutCells *);
PetscErrorCode CutCellsDestroy(CutCells *);
/* All cells have changed (MeshRebase). Local. */
PetscErrorCode CutCellsMeasureCells(CutCells);
/* Bodies drawn at X, q, with rigid velocities about the points P; not those with omit[k] (NULL: none). Local. */
PetscErrorCode CutCellsCut(CutCells, PetscReal (*X)[3], PetscReal (*q)[4], PetscReal (*P)[3], const PetscBool omit[]);
/* The n parts, by bodies. Borrowed. */
PetscErrorCode CutCellsGet(CutCells, PetscInt *n, const CutCell *cut[]);
/* Moments of the part, [CUT_MOMENTS] in space: of products of 6 pairs of functions along the axes (00 01 02 11 12 22,
   the last axis slowest). Borrowed until the next call. */
#define CUT_MOMENTS 216
PetscErrorCode CutCellsGetMoments(CutCells, const CutCell *, const PetscReal *moment[]);
/* What a device draws them from, times sigma: of parts of balls and whole cells, in cells that are boxes in space; of
   others edge[0] is 0. */
PetscErrorCode CutCellsGetBall(CutCells, const CutCell *, PetscReal sigma, DeviceBall *);
/* From them pen [nb][nb]: sigma int phi_i phi_j over the part. */
void CutCellsGetMatrix(CutCells, const CutCell *, const PetscReal moment[], PetscReal sigma, PetscReal pen[]);
