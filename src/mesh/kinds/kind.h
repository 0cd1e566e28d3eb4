/* Meshkind: the meshes a scene can ask for by name, those of a DMPlex still serial and not refined.

     box      [lower, upper] with -mesh_cells nx,ny[,nz] equal cells, -mesh_lower, -mesh_upper, -mesh_periodic x,y,z,
              -mesh_dimension 2|3. With -mesh_focus lo..,hi.. cells of size -mesh_focus_h inside that box, outside
              h (1 + growth d/h) at distance d: -mesh_growth, up to h times -mesh_coarsest (one value an axis).
              -mesh_stretch sx,sy[,sz]: cells gather at both ends of an axis
     channel  the Schaefer-Turek channel [0,2.2] x [0,0.41] without hole, fine around the cylinder: -mesh_resolution
              cells a diameter (10: 2,211 cells)
     fitted   the same channel with the cylinder (centre (0.2,0.2), radius 0.05) as a hole in an O-grid:
              -mesh_resolution cells a quarter of the circle (16: 2,176 cells; 4: 136, a coarse mesh for -dm_refine),
              -mesh_ring_ratio thickness of the outermost layer of the O-grid over the innermost. With -mesh_dimension 3
              the same in layers of cells along z, -mesh_layers n, -mesh_layer_ratio thickness of the middle one over
              those at the ends, -mesh_periodic z
     disc     -mesh_centre, -mesh_radius, -mesh_resolution cells a quarter of the circle (4)
     annulus  -mesh_centre, -mesh_radii inner,outer, -mesh_resolution
     tube     the disc in layers of cells along z from 0 to -mesh_length; -mesh_layers, -mesh_layer_ratio,
              -mesh_periodic z, -mesh_ring_ratio
     ball     -mesh_centre x,y,z, -mesh_radius, -mesh_resolution cells a quarter of a great circle, -mesh_ring_ratio
     shell    -mesh_centre x,y,z, -mesh_radii inner,outer, -mesh_resolution, -mesh_ring_ratio
     file     -mesh_file name.msh of quadrilaterals or hexahedra of order 1 or 2; its physical names (without names:
              numbers) are the boundaries; -mesh_scale, -mesh_offset x,y[,z]: places are offset + scale times those of
              the file; -mesh_unnamed: the boundary of outer edges or faces without a name; -mesh_plates: names of edges
              or faces inside that are thin walls; -mesh_round_<boundary> cx,cy,r bends a boundary that is a polygon in
              the file to the circle, on every level of refinement (2D)
   -mesh_shift_seed n (box with focus, channel) moves the fine part by a random fraction of h, -1/2 to 1/2 along each
   axis; 0 does not.

   Boundaries are DMLabels on faces: left right bottom top back front, cylinder, inner, outer. The coordinates of the DM
   are reference coordinates, to be kept until the mesh is refined and distributed; MeshKindEvaluate then gives true
   ones (map.h). All functions but MeshKindEvaluate are collective. */
#pragma once
#include "curved.h"
#include "base/border.h"
#include <petscdmplex.h>

typedef struct _p_MeshKind *MeshKind;

/* Read options. Errors: empty box, no file. */
PetscErrorCode MeshKindRead(MPI_Comm, MeshKind *);
/* A box of equal cells without options: cells, lower, upper [dim] */
PetscErrorCode MeshKindCreateBox(MPI_Comm, PetscInt dim, const PetscInt cells[], const PetscReal lower[],
                                 const PetscReal upper[], MeshKind *);
/* Cells of a box or channel; 0: another kind */
PetscErrorCode MeshKindGetBoxCells(MeshKind, PetscReal *n);
/* Build the mesh on rank 0. The caller destroys dm. Errors: what a mesh file must not have (MeshKindCreateFromFile), a
   rounded boundary that is not near its circle. */
PetscErrorCode MeshKindBuild(MeshKind, DM *dm);
/* Read the options of a box or channel, of which a refined mesh is made. Errors: another kind. */
PetscErrorCode MeshKindReadBox(MPI_Comm, MeshKind *);
PetscErrorCode MeshKindDestroy(MeshKind *);
/* Other base cells of a box. Error: it is graded (-mesh_focus, channel) and has others. */
PetscErrorCode MeshKindSetCells(MeshKind, const PetscInt cells[3]);

PetscErrorCode MeshKindGetBoundaries(MeshKind, PetscInt *n, const char (**names)[64]);
/* Are the sides of the box boundaries of their names, as in all kinds but files? The circle, cylinder or sphere that
   boundary b is; *round: is it one? */
PetscErrorCode MeshKindHasSides(MeshKind, PetscBool *);
PetscErrorCode MeshKindGetRound(MeshKind, PetscInt b, PetscBool *round, BorderRound *);
/* Longest side of the smallest cell of a box or channel */
PetscErrorCode MeshKindGetSmallest(MeshKind, PetscReal *h);
PetscErrorCode MeshKindGetBox(MeshKind, PetscInt *dim, PetscReal lower[3], PetscReal upper[3], PetscReal period[3]);
/* Length of the period along each axis [3] (0: not periodic) and upper end of the period [3]. */
PetscErrorCode MeshKindGetPeriod(MeshKind, const PetscReal *period[], const PetscReal *upper[]);

/* Of a mesh file whose cells bend, else NULL: where their nodes are. Borrowed. */
PetscErrorCode MeshKindGetCurved(MeshKind, Curved *);
/* True coordinates x [dim] of a point with reference coordinates q. Not collective. */
PetscErrorCode MeshKindEvaluate(MeshKind, const PetscReal q[], PetscReal x[]);
/* Replace the reference coordinates of the vertices of a mesh (refined, distributed) by true ones. */
PetscErrorCode MeshKindPlaceVertices(MeshKind, DM);
