/* Deform: concentrates the cells of a mesh near bodies that stand still, without changing its topology. Layer 2.

   Wanted: cell c, of size |c| on the mesh as it was, gets the size k |c| m, where the monitor m(x) is s^dim on the surface of a body, rises with the distance to 1 at -mesh_deform_width
   and k makes the sizes fill the domain. Deformation method (Moser 1965; Liao & Anderson 1992; Grajewski, Koester & Turek 2009): with the density rho = |c|/(present size) of what the
   cells carry, a potential from

     (grad w, grad q) = (1/(k m) - rho, q),   no flow through the boundary

   moves every vertex with the velocity grad w / rho, which carries rho into 1/(k m) as pseudo-time goes from 0 to 1. Here the potential is solved anew in every step of pseudo-time, on the
   mesh as it then is: nothing has to be looked up in a mesh left behind, on whatever rank that part of it lies (the price of the one solve of the method is that search), and each
   step corrects the errors of those before. Cells stay straight-sided; vertices on the boundary slide along it. A step that would leave a Jacobian below a tenth of its cell's mean
   is shortened.

   Bilinear elements on the vertices, CG with GAMG under the prefix deform_. Boundaries must be planes along axes. Options: -mesh_deform, -mesh_deform_size s,
   -mesh_deform_width, -mesh_deform_steps (from 0 to 1; a few further ones correct what is left). */
#pragma once
#include "bodies.h"
#include "mesh.h"

typedef struct {
  PetscReal area[2];  /* smallest and largest ratio of achieved to wanted size of a cell */
  PetscReal jacobian; /* smallest Jacobian at Gauss points (3 an axis) and corners over the mean of its cell */
  PetscInt  steps;    /* of pseudo-time, corrections included */
} DeformResult;

/* Deform the mesh for the bodies where they are, if -mesh_deform asks for it; *done: it did. Before anything else looks at places of nodes. Collective.
   Errors: no bodies, bodies that move, curved cells or boundaries that are no planes along axes, a mesh that would tangle. */
PetscErrorCode DeformMesh(Mesh, Bodies, PetscBool *done, DeformResult *);
