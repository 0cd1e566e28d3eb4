/* Align: lines a mesh up with surfaces, without changing its topology.

   Cells whose centre lies inside a surface are its own ("covered"). The vertices of the staircase between them and the
   fluid go to the closest point of the wall, the vertices of three rings around follow (Jacobi sweeps on the
   displacement, which leave a graded or shifted mesh graded), the mid-edge nodes of the staircase go onto the wall too
   (isoparametric Q2), all other nodes follow by transfinite interpolation of the displacement. Vertices on the
   boundary of the domain stay. Inactive cells that meet a covered cell of another surface or the boundary are given
   back to the fluid, until at least one layer of fluid cells is left between two walls; those at a corner that leaves
   a fluid cell no room as well. A surface that reaches a cell or more beyond a plane side of the domain passes through
   it (sides.c): its covered cells stay there, and vertices of that side move within it. In the plane a wall vertex
   goes onto every corner that a shape has (corners.c); where the mesh then has a cell that cannot be used, the surface
   is aligned once more without. In space vertices go to edges and corners (edges.c), but for those of cells that cannot
   be used then. On a refined mesh (mesh/hang.h) all of this happens in cells of one size around the surface; the
   outermost ring stays where it meets larger cells. Walls closer than half a cell to another wall are drawn back, so
   that the gap g in the mesh is w + g^2/(4w) with w = 1/4 cell (w where they overlap). The resistance of a closing gap
   then grows to that of w without a jump, and the cells in the gap stay valid; what is missing below about a quarter
   of a cell belongs to the contact forces. Falling back to the penalty in a gap instead loses resistance at once, a
   fifth at half a cell and more below (study runs/studies/boundary). A surface that is nowhere thicker than the cells
   around it, and longer than three of them, is taken for its mid-line (midline.h): a path of edges goes from tip to
   tip, its vertices and mid-edge nodes onto the mid-line, its ends onto the tips. All cells stay fluid; the pressure,
   which is discontinuous between cells, has its jump across the path. What the surface displaces is carried along by
   the fluid on both sides. In narrow gaps the path is drawn aside as walls are drawn back; a tip within 0.4 cells of a
   side of the domain closes the gap, its path ends at a vertex of the side. In space the same holds for hexahedra,
   whose mid-face nodes on the staircase go onto the surface, too. Before, live cells are filled in until the staircase
   is a surface (repair.c); after it, vertices of cells that are too flat are shifted a little (mend.c), instead of
   giving back covered ones. There is no path: surfaces thinner than a cell are refused. Periodic images of one surface
   are to each other what two surfaces are (images.c), unless they touch or overlap: a fibre through the box is one. A
   surface is left alone when no cell is its own, when a cell around it would get a Jacobian that is not positive (4 x
   4 and 3 x 3 Gauss points; in space the 27 of the flow alone, runs/studies/aligned-space), or when its cells would
   not have its size (parts thinner than a cell). For a surface that was left alone before the limits are stricter, so
   that it does not change sides in every step; the driver has it wait as well (AlignSetPatience).

   Pure geometry: nothing here knows the flow, and nothing is moved; the caller moves the nodes (MeshMoveNodes) after
   he has read what he needs at the old positions. The result does not depend on the number of ranks. Method and tests:
   design section 6; snapping of vertices to surfaces is old (snapper of cfMesh, snappyHexMesh). */
#pragma once
#include "align/surfaces.h"
#include "mesh/mesh.h"

typedef struct _p_Align *Align;

/* Aligned meshes need cells of one size around a surface: has the mesh as it is that, around the surfaces where they
   are? Collective. */
PetscErrorCode AlignHasEvenCells(Mesh, const AlignSurfaces *, PetscBool *even);

/* In the plane a surface thinner than this is a path, smallest cell size along it */
#define ALIGN_THIN 1.0

/* So many rings of vertices around a wall follow it; ranks are to know surfaces one cell farther from their own
   cells */
#define ALIGN_RINGS 3

/* What the last AlignFit found; arrays are borrowed, valid until the next one. */
typedef struct {
  PetscInt         nmarked;
  const PetscInt  *marked;       /* [nmarked] local nodes on a wall or inside a surface */
  const PetscInt  *node_surface; /* [nnode_all] the surface they belong to, -1 elsewhere */
  const PetscBool *on_wall;      /* [nnode_all] node on the staircase */
  const PetscInt  *cell_surface; /* [ncell_all] owner of a covered cell, -1: fluid */
  const PetscInt  *cell_before;  /* [ncell_all] the same of the fit before */
  const PetscInt  *node_side; /* [nnode_all] number + 1 of a surface: left of its path, minus that: right; 0: neither */
  const PetscInt  *cell_side; /* [ncell_all] the same of the cells */
  const PetscInt  *side_before; /* [ncell_all] and in the fit before */
  const PetscBool *inactive;    /* [n] aligned, and its inside is no part of the fluid: not so a surface that is a
                                   path of edges */
  const PetscBool *could;       /* [n] not followed for its patience alone */
  PetscInt         nnode;
  const PetscInt  *node; /* [nnode] local nodes (own and ghost) that are elsewhere than now */
  const PetscReal *x;    /* [nnode][dim] their new positions */
  PetscInt         ncell;
  const PetscInt  *cell;    /* [ncell] local cells with such a node, or covered only before or only now */
  PetscInt         nnarrow; /* surfaces whose wall was drawn back from another one */
  PetscInt         npass;   /* surfaces that pass through a side of the domain */
  PetscInt         ncut;    /* corners of aligned surfaces that are not followed; in space, vertices off their edges */
  const PetscReal *rest;    /* [nnode_all][dim] of a fluid surface, else NULL: what vertices and middles are off it */
  PetscReal flat[3]; /* of a fluid surface that the mesh cannot follow: where its flattest cell is, before it moves */
  PetscReal quality; /* smallest over largest Jacobian of a cell, smallest over all cells that were touched */
} AlignResult;

/* The table of surfaces is borrowed, and what it says may change between fits. Collective. */
PetscErrorCode AlignCreate(Mesh, const AlignSurfaces *, Align *);
/* In space: largest distance from inside surface k to the surface, or more than enough. Not collective. */
PetscErrorCode AlignFindDepth(const AlignSurfaces *, PetscInt k, PetscReal depth_max, PetscReal *depth);
PetscErrorCode AlignDestroy(Align *);

/* Nodes with held [nnode_all], copied, stay where they are from now on: those in and on other surfaces that the mesh is
   lined up with already. Cells whose middle is held are of no surface and need not be sound; a corner of a surface at
   such a vertex has it, and another one only what is not held. The same on all ranks that know a node. Not
   collective. */
PetscErrorCode AlignHold(Align, const PetscBool held[]);
/* Until the next call the mesh does not follow surfaces k with waits[k] > 0, even where it could, which the result
   tells; borrowed, NULL (default): none. */
PetscErrorCode AlignSetPatience(Align, const PetscInt waits[]);
/* Fit the mesh to the surfaces k with wanted[k]; aligned [n] tells which were. before [n]: were they in the last step
   (NULL: all)? Compares with the present positions of the nodes and with the covered cells of the last call.
   Collective. */
PetscErrorCode AlignFit(Align, const PetscBool wanted[], const PetscBool before[], PetscBool aligned[], AlignResult *);
