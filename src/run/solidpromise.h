/* SolidPromise: on which meshes presets keep their promise of elastic particles: deformation, displacements, drag and
   speed of one that touches no other (runs/studies/elastic/presets.md has the errors that the numbers come from).

   Known are how many cells of the flow a particle is thick about its centre, with the mesh lined up with it, held,
   or immersed, and how many its boundary layer is: of one that falls as of rigid bodies (promise.h), of one that is
   held in a stream sqrt(thickness nu/U), U the stream of stream.h. */
#pragma once
#include "promise.h"
#include "solid/solid.h"

/* Can the mesh be lined up with all of them in this scene (-couple_method aligned), and is more promised so (not of
   membranes in space)? Collective. */
PetscErrorCode SolidPromiseCanAlign(const MeshLocal *, Bodies, Solids, PetscBool *);
/* Is there one, and no second one or moving rigid body that it could touch? Collective. */
PetscErrorCode SolidPromiseIsAlone(Bodies, Solids, PetscBool *);
/* A preset, asked for or the default one, with -couple_method as it is now. Where it is known not to keep its promise:
   refusal [len], unless that says something, if it was asked for, else a remark. NULL solids: nothing happens.
   Collective. */
PetscErrorCode SolidPromiseCheck(Mesh, Bodies, Solids, PetscInt preset, PetscBool asked, char refusal[], size_t len);
