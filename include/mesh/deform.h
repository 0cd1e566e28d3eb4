/* Deform: concentrates the cells of a mesh near surfaces, without changing its topology. Cells stay straight-sided;
   vertices on the boundary slide along it. The method is in src/mesh/README.md.

   CG with GAMG under the prefix deform_. Boundaries must be planes along axes; sizes are set by -mesh_deform_size and
   -mesh_deform_width. */
#pragma once
#include "mesh/mesh.h"

/* Closed surfaces that cells are concentrated at, as their owner shows them; rigid bodies: couple/bodysurfaces.h. A
   rank knows n of them, as they are wherever its nodes come near. */
typedef struct {
  void     *ctx;
  PetscInt  n, nall;                     /* known to this rank; all of them */
  PetscReal largest;                     /* bounding radius of the largest on any rank */
  const PetscReal (*centre)[3], *radius; /* [n] ball that holds it, borrowed */
  const PetscBool *removed;              /* [n] out of the domain: left out */
  /* Signed distances d [m] of points x [m][dim] from surface k with its centre at `at`, an image. Not collective. */
  PetscErrorCode (*distance)(void *ctx, PetscInt k, const PetscReal at[3], PetscInt m, const PetscReal x[],
                             PetscReal d[]);
  /* From the next meet (or from whenever surfaces next go between ranks) a rank knows those that come within reach of
     where its cells were at the start. Collective. NULL: all ranks know all */
  PetscErrorCode (*look)(void *ctx, PetscReal reach);
  /* Now, where the surfaces are: the table is anew. Collective. NULL: likewise */
  PetscErrorCode (*update_local)(void *ctx);
  PetscErrorCode (*destroy)(void *ctx); /* NULL: nothing to do */
} DeformSurfaces;

typedef struct {
  PetscReal area[2];  /* smallest and largest ratio of achieved to wanted size of a cell */
  PetscReal jacobian; /* smallest Jacobian at Gauss points (3 an axis) and corners over the mean of its cell */
  PetscInt  steps;    /* of pseudo-time, corrections included */
} DeformResult;

typedef struct _p_Deform *Deform;

/* For the mesh as it is, whose sizes count as those at the start; NULL if -mesh_deform does not ask for it. Collective.
   The table of surfaces is borrowed and may change between calls; its ctx is taken over, destroyed in any case. Errors:
   no surfaces, curved cells or boundaries that are no planes along axes. */
PetscErrorCode DeformCreate(Mesh, const DeformSurfaces *, Deform *);
/* Others from now on, in place of these: shown by another owner. Taken over as above. Not collective. */
PetscErrorCode DeformSetSurfaces(Deform, const DeformSurfaces *);
PetscErrorCode DeformDestroy(Deform *);

/* Deform the mesh for the surfaces where they are, which go to the ranks whose nodes come near them. Before anything
   else looks at positions of nodes. Collective. Error: a mesh that would tangle. */
PetscErrorCode DeformMesh(Deform, DeformResult *);
/* The nodes are where a step begins: ranks know the surfaces that these may come near in the step from the next
   exchange of the owner on (DeformSurfaces.look). After DeformMesh it is so. Collective. */
PetscErrorCode DeformLook(Deform);
/* From the mesh as it is now to one for the surfaces where they are now, about a small cell farther: as many of the
   last steps as bring sizes within 5 % of the wanted ones, one to four. The first relaxes the mesh too: it adds, in
   proportion to the way of the bodies, what smoothing would change in the displacements from the mesh at the start, and
   w is taken for the sizes after that. Of the meshes with these sizes one of little shear is approached so, and bodies
   that travel leave no trail. The caller sees to MeshRebase. Collective. Error: a mesh that would tangle. */
PetscErrorCode DeformUpdate(Deform, DeformResult *);
