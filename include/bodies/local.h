/* BodiesLocal: which bodies a rank knows.

   A body is *owned* by the rank in whose part of the domain its centre lies, and is a *ghost* on the ranks whose bodies
   it may meet. Owned bodies and ghosts together are the *known* ones: all arrays per body hold these alone, in the
   order of their permanent numbers (BodyState: n, number, own). A rank that knows all bodies is the special case: there
   number[k] = k, and nothing below communicates. So loops over k < n stay what they are, and only sums count own ones.

   Parts: the box is cut along its axes, so that as many bodies lie between two cuts as between any other two; the rank
   of a position is found by bisection. Bodies that are large beside a part are known to all ranks, and the ranks that
   own them know all that may touch them. With a flow the parts are those of the mesh, so that a rank knows what its
   nodes see; what moves the bodies then does so on all ranks that know them, from the same numbers: a copy has the
   bits of its owner in all columns, and is never sent but by BodiesMigrate, contact forces excepted
   (BodiesUpdateGhosts).

   Design and measurements: runs/studies/scaling/README.md. */
#pragma once
#include "base/curve.h"
#include "base/exact.h"
#include "bodies/write.h"

/* Boxes, lowest and highest corner, that cover this rank's part of a mesh; everything that the rank looks at is no
   farther than `beyond` from one. curve tells whose a position is; NULL: of those with a box that holds it the
   first. */
typedef struct {
  PetscInt n;
  PetscReal (*box)[2][3], beyond;
  Curve curve;
} BodyBoxes;

/* BodiesCreate for bodies that are spread over the ranks of comm, if there are several: each knows those of its part,
   cut by the counts of bodies (until BodiesSetBoxes); period [3] of the domain's axes, 0: none. No rank holds a list of
   all, but of groups that are not all free, that come from tables or that are placed at random. Collective. Errors:
   those of BodiesCreate. */
PetscErrorCode BodiesCreateLocal(MPI_Comm comm, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                                 const PetscReal period[3], Bodies *);
/* After BodiesSetInitialPositions: all ranks hear where the bodies of groups start that are not all free, which every
   rank keeps (so many bytes as one has numbers to place it). Collective. */
PetscErrorCode BodiesGatherStarts(Bodies);
/* All ranks know the bodies of a group from the next BodiesMigrate on. */
PetscErrorCode BodiesSetEverywhere(Bodies, PetscInt group);
/* The parts are others from now on, as those of another mesh; bodies go there with the next BodiesMigrate. The boxes
   are copied, the curve is the bodies' from then on. Not where all know all. Collective. */
PetscErrorCode BodiesSetBoxes(Bodies, const BodyBoxes *);
/* From the next BodiesMigrate on ranks look farther than `beyond` of their boxes, by the largest reach of any. Nothing
   happens where all know all. Collective. */
PetscErrorCode BodiesLookFarther(Bodies, PetscReal reach);
/* The ranks among which bodies are spread; PETSC_COMM_SELF where all know all. */
MPI_Comm BodiesComm(Bodies);

/* Arrays of others per known body: [n] entries of so many bytes, which move with the body and begin as zeros; *array
   is moved when bodies move between ranks. Detach frees it. Not collective. */
PetscErrorCode BodiesAttach(Bodies, size_t bytes, void **array);
/* The same for what is filled again in every step: it does not move with the bodies, and holds anything after
   BodiesMigrate. */
PetscErrorCode BodiesAttachWork(Bodies, size_t bytes, void **array);
PetscErrorCode BodiesDetach(Bodies, void **array);

/* Bodies have moved: they go to their owners, and come as ghosts to whoever owns a body whose centre may be nearer than
   range + skin (r_i + r_j). All arrays of the state and the attached ones are reordered; k is another body
   afterwards. Nothing happens where all know all. Collective. */
PetscErrorCode BodiesMigrate(Bodies, PetscReal range, PetscReal skin);
/* Ghosts get x and u of their owners, if `turns` also q and w. Collective. */
PetscErrorCode BodiesSync(Bodies, PetscBool turns);
/* v [n][width]: ghosts get what their owners have. Collective. */
PetscErrorCode BodiesUpdateGhosts(Bodies, PetscInt width, void *v);
/* v [n][width] of every rank that knows a body becomes their sum, the same on all of them; where all know all, of those
   of the world. Collective. */
PetscErrorCode BodiesSumLocal(Bodies, PetscInt width, PetscReal v[]);
/* The same with the largest in place of the sum. */
PetscErrorCode BodiesMaxLocal(Bodies, PetscInt width, PetscReal v[]);
/* Of the known bodies [n]: the rank of the owner, and which of its own ones, in ascending order of their numbers, it is
   there. Not where all know all. Collective. */
PetscErrorCode BodiesGetOwners(Bodies, PetscMPIInt rank[], PetscInt which[]);
/* Parcels out [n] of so many bytes go to the ranks to [n], ascending, of BodiesComm; *in [*comes] come from the ranks
   *from [*comes], both the caller's to free; in: a pointer to a pointer. Not where all know all. Collective. */
PetscErrorCode BodiesExchange(Bodies, PetscInt n, const PetscMPIInt to[], size_t bytes, const void *out,
                              PetscInt *comes, void *in, PetscMPIInt **from);
/* Centres of bodies that have not left: of those that lie in the part of this rank (mine), whoever owns them, and
   after them of those nearer to it than reach. *x [*n] is the caller's to free. Collective. */
PetscErrorCode BodiesGetInitialPositions(Bodies, PetscReal reach, PetscInt *mine, PetscInt *n, PetscReal (**x)[3]);

/* v [n] over all ranks: the largest, the smallest. Collective. */
PetscErrorCode BodiesMax(Bodies, PetscInt n, PetscReal v[]);
PetscErrorCode BodiesMin(Bodies, PetscInt n, PetscReal v[]);
/* v [n] over all ranks: the sum, of parts that count own bodies alone. Collective. */
PetscErrorCode BodiesSum(Bodies, PetscInt n, PetscReal v[]);
/* Is something of bodies so on any rank? Without bodies all say the same, and none is asked. Collective. */
PetscErrorCode BodiesAny(Bodies, PetscBool *any);

/* Rows: all bodies by their numbers, in even shares of the ranks of the world, for files. BeginRows tells this rank's
   share. Gather: unit of `bytes` of every own body at from [n] goes to row [own rows]; Scatter: back to own bodies,
   ghosts keep what they have (`bytes`: a multiple of the size of a real). Where all know all, rank 0 has all rows.
   Collective. */
typedef struct {
  PetscInt n, start;
  PetscSF  sf; /* NULL: all know all */
} BodyRows;
PetscErrorCode BodiesBeginRows(Bodies, BodyRows *);
PetscErrorCode BodiesGatherRows(Bodies, const BodyRows *, size_t bytes, const void *from, void *row);
PetscErrorCode BodiesScatterRows(Bodies, const BodyRows *, size_t bytes, const void *row, void *to);
PetscErrorCode BodiesEndRows(BodyRows *);
/* Arrays per known body, saved or loaded: the same file where all know all and where not. Collective. */
PetscErrorCode BodiesVisitReals(Bodies, const BodyRows *, State, const char name[], PetscInt width, PetscReal v[]);
PetscErrorCode BodiesVisitIntegers(Bodies, const BodyRows *, State, const char name[], PetscInt v[]);
