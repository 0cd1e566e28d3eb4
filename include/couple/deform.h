/* Deform: concentrates the cells of a mesh near bodies, without changing its topology.

   Wanted: cell c, of size |c| on the mesh as it was, gets the size k |c| m, where the monitor m(x) is s^dim on the
   surface of a body, rises with the distance to 1 at -mesh_deform_width and k makes the sizes fill the domain: N_c =
   int_c 1/(k m) = |c|. Deformation method (Moser 1965; Liao & Anderson 1992; Grajewski, Koester & Turek 2009): a
   potential w gives the displacement of the vertices that carries the density 1/(k m) to where it is wanted, as
   pseudo-time goes from 0 to 1. In exact form here: the derivatives N' of the integrals N_c by the places of the
   vertices, of constant sum, are a divergence that takes vertices to cells, and their transpose a gradient that
   takes cells to vertices, so that

     N' E N'^T w = |c| - N_c,   displacement E N'^T w,   E = 1/(rho^2 mass) of a vertex, no displacement through the
     boundary

   is Newton's method for the sizes with the least displacement, and the Poisson problem of the method. On the way,
   displacements are smoothed (twice the mean of the cells' means), which keeps cells from shearing; steps without it
   follow until sizes are within 2 %. A potential on the vertices, whose gradient is a mean over cells, stalls at 10
   to 20 % (runs/studies/deformation). The problem is solved anew in every step, on the mesh as it then is: nothing
   has to be looked up in a mesh left behind, on whatever rank that part of it lies. Cells stay straight-sided;
   vertices on the boundary slide along it. A step that would leave a Jacobian below a tenth of its cell's mean is
   shortened.

   CG with GAMG under the prefix deform_. Boundaries must be planes along axes; s is -mesh_deform_size. */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"

typedef struct {
  PetscReal area[2];  /* smallest and largest ratio of achieved to wanted size of a cell */
  PetscReal jacobian; /* smallest Jacobian at Gauss points (3 an axis) and corners over the mean of its cell */
  PetscInt  steps;    /* of pseudo-time, corrections included */
} DeformResult;

typedef struct _p_Deform *Deform;

/* For the mesh as it is, whose sizes count as those at the start; NULL if -mesh_deform does not ask for it. Collective.
   Errors: no bodies, curved cells or boundaries that are no planes along axes. */
PetscErrorCode DeformCreate(Mesh, Bodies, Deform *);
PetscErrorCode DeformDestroy(Deform *);

/* Deform the mesh for the bodies where they are, which go to the ranks whose nodes come near them. Before anything else
   looks at places of nodes. Collective. Error: a mesh that would tangle. */
PetscErrorCode DeformMesh(Deform, DeformResult *);
/* The nodes are where a step begins: ranks know the bodies that these may come near in the step from the next
   BodiesMigrate on, which is given the ways of the bodies (bodies/local.h). After DeformMesh it is so. Collective. */
PetscErrorCode DeformLook(Deform);
/* From the mesh as it is now to one for known bodies that have moved by about a small cell, drawn at X [n][3], q [n][4]
   (borrowed until the next call): as many of the last steps as bring sizes within 5 % of the wanted ones, one to four.
   The first relaxes the mesh too: it adds, in proportion to the way of the bodies, what smoothing would change in the
   displacements from the mesh at the start, and w is taken for the sizes after that. Of the meshes with these sizes one
   of little shear is approached so, and bodies that travel leave no trail. The caller sees to MeshRebase. Collective.
   Error: a mesh that would tangle. */
PetscErrorCode DeformFollow(Deform, PetscReal (*X)[3], PetscReal (*q)[4], DeformResult *);
