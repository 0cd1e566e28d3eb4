/* Parts of the domain, one a rank: the box is cut along its axes, so that as many bodies lie between two cuts as
   between any other two; or each is what the boxes of a rank cover (BodyBoxes). For files of the room only. */
#pragma once
#include "impl.h"
#include "base/rankboxes.h"

struct _p_BodySubdomains {
  MPI_Comm     comm;
  PetscMPIInt  rank, size;
  PetscInt     dim, n[3], at[3]; /* parts along the axes, place of this rank's one */
  PetscReal   *cut[3];           /* [n + 1] */
  RankBoxes    regions;          /* boxes of all ranks; NULL: parts are cut */
  Curve        curve;            /* or NULL: where boxes overlap, the first one counts */
  PetscReal    beyond, farther, lower[3], upper[3], period[3];
  PetscSF      ghosts; /* from known to known bodies; NULL before the first BodiesMigrate */
  PetscMPIInt  tag;
  MPI_Datatype unit[2]; /* 3 and 4 reals */
};

/* Centres outside of the domain count as on its face, but for an axis that is periodic */
void        BodySubdomainsInside(const BodySubdomains *, const PetscReal x[3], PetscReal y[3]);
PetscMPIInt BodySubdomainsRank(const BodySubdomains *, const PetscReal x[3]);
/* Is part i of an axis nearer to y than reach? */
PetscBool BodySubdomainsNear(const BodySubdomains *, PetscInt axis, PetscInt i, PetscReal y, PetscReal reach);
/* Is y in the own part, farther than reach from all others? */
PetscBool BodySubdomainsDeep(const BodySubdomains *, const PetscReal y[3], PetscReal reach);
/* Cuts between which there are as many bodies, from counts in bins. Collective. */
PetscErrorCode BodySubdomainsBalance(Bodies);
