/* BodiesLocal: which bodies a rank knows. Called by run (set-up), couple and contact (every step), report (rows of
   files).

   A body is *owned* by the rank in whose sub-domain its centre lies, and is a *ghost* on other ranks that need it:
   those whose own bodies may touch it, with a flow those whose nodes see it. All arrays per body hold owned bodies
   and ghosts alone, in the order of their permanent numbers (BodyState: n, number, own). A rank that knows all
   bodies is the special case number[k] = k, in which nothing below communicates. Loops run over k < n; sums count
   owned bodies alone. How the box is cut, large bodies, what ghosts may do: src/bodies/README.md, "Who knows which
   bodies". Measurements: runs/studies/scaling/README.md.

   Collective: on BodiesComm. Local: without communication. */
#pragma once
#include "base/curve.h"
#include "base/exact.h"
#include "bodies/write.h"

/* ---- set-up of a scene: run, couple ---- */

/* Boxes, lowest and highest corner, that cover this rank's part of a mesh; everything that the rank looks at is no
   farther than `beyond` from one. curve tells whose a position is; NULL: of those with a box that holds it the
   first. */
typedef struct {
  PetscInt n;
  PetscReal (*box)[2][3], beyond;
  Curve curve;
} BodyBoxes;
/* BodiesCreate for bodies that are spread over the ranks of comm, if there are several; period [3] of the domain's
   axes, 0: none. The box is cut by the counts of bodies until BodiesSetBoxes. A rank lists all bodies only of
   groups that are not all free, that come from tables or that are placed at random. Collective. Errors: those of
   BodiesCreate. */
PetscErrorCode BodiesCreateLocal(MPI_Comm comm, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                                 const PetscReal period[3], Bodies *);
/* All ranks know the bodies of a group from the next BodiesMigrate on. Local, the same calls on all ranks. */
PetscErrorCode BodiesSetEverywhere(Bodies, PetscInt group);
/* The sub-domains become those of a mesh; bodies move there with the next BodiesMigrate. The boxes are copied, the
   curve is taken over. Only where bodies are spread. Collective. */
PetscErrorCode BodiesSetBoxes(Bodies, const BodyBoxes *);
/* From the next BodiesMigrate on ranks need bodies up to `reach` farther than `beyond` of their boxes; the largest
   reach of any rank counts. Nothing happens where all ranks know all bodies. Collective. */
PetscErrorCode BodiesLookFarther(Bodies, PetscReal reach);
/* After BodiesSetInitialPositions: all ranks receive the initial positions of groups that are not all free, which every
   rank keeps. Collective. */
PetscErrorCode BodiesGatherStarts(Bodies);
/* The ranks among which bodies are spread; PETSC_COMM_SELF where all ranks know all bodies. Local. */
MPI_Comm BodiesComm(Bodies);

/* ---- arrays per body: couple, contact, run ---- */

/* A further array per known body, [n] entries of `bytes`, that moves with the bodies and begins as zeros. The address
   `array` must stay valid until BodiesDetach: *array changes when bodies change ranks. Local. */
PetscErrorCode BodiesAttach(Bodies, size_t bytes, void **array);
/* As BodiesAttach, for what is filled again in every step: its entries do not move with the bodies, and are undefined
   after BodiesMigrate. Local. */
PetscErrorCode BodiesAttachWork(Bodies, size_t bytes, void **array);
/* Frees an attached array and sets *array to NULL. Local. */
PetscErrorCode BodiesDetach(Bodies, void **array);

/* ---- one step: bodies change their owners, ghosts are updated: run, contact ---- */

/* After bodies have moved: they go to their owners, and as ghosts to ranks that own a body whose centre may be nearer
   than range + skin (r_i + r_j). All arrays of the state and the attached ones are reordered: k is another body
   afterwards. Nothing happens where all ranks know all bodies. Collective. */
PetscErrorCode BodiesMigrate(Bodies, PetscReal range, PetscReal skin);
/* Ghosts receive x and u of their owners, if `turns` also q and w. Collective. */
PetscErrorCode BodiesSync(Bodies, PetscBool turns);
/* Ghosts receive the values of their owners in v [n][width]. Collective. */
PetscErrorCode BodiesUpdateGhosts(Bodies, PetscInt width, void *v);
/* v [n][width]: sum over all ranks that know a body, the same on all of them; where all ranks know all bodies, over the
   ranks of the world. Collective. */
PetscErrorCode BodiesSumLocal(Bodies, PetscInt width, PetscReal v[]);
/* As BodiesSumLocal, the largest in place of the sum. Collective. */
PetscErrorCode BodiesMaxLocal(Bodies, PetscInt width, PetscReal v[]);
/* Of the known bodies [n]: rank of the owner, and the index among the owner's bodies in ascending order of their
   numbers. Only where bodies are spread. Collective. */
PetscErrorCode BodiesGetOwners(Bodies, PetscMPIInt rank[], PetscInt which[]);
/* Sparse exchange: records out [n] of `bytes` go to the ranks to [n], ascending, of BodiesComm; *in [*comes] arrive
   from the ranks *from [*comes], both freed by the caller. `in` is a pointer to a pointer. Only where bodies are
   spread. Collective. */
PetscErrorCode BodiesExchange(Bodies, PetscInt n, const PetscMPIInt to[], size_t bytes, const void *out,
                              PetscInt *comes, void *in, PetscMPIInt **from);
/* Centres of bodies that have not left: first the *mine ones in the sub-domain of this rank, whoever owns them, then
   those nearer to it than `reach`. *x [*n], freed by the caller. Collective. */
PetscErrorCode BodiesGetCentres(Bodies, PetscReal reach, PetscInt *mine, PetscInt *n, PetscReal (**x)[3]);

/* ---- reductions over all bodies: all rooms ---- */

/* v [n]: largest over all ranks. Collective. */
PetscErrorCode BodiesMax(Bodies, PetscInt n, PetscReal v[]);
/* v [n]: smallest over all ranks. Collective. */
PetscErrorCode BodiesMin(Bodies, PetscInt n, PetscReal v[]);
/* v [n]: sum over all ranks, of sums over own bodies. Collective. */
PetscErrorCode BodiesSum(Bodies, PetscInt n, PetscReal v[]);
/* *any: is it TRUE on any rank? Without bodies all ranks say the same, and nothing is communicated. Collective. */
PetscErrorCode BodiesAny(Bodies, PetscBool *any);

/* ---- rows of files, restart: report, run ---- */

/* Rows: all bodies in the order of their numbers, in even ranges over the ranks of the world */
typedef struct {
  PetscInt n, start;
  PetscSF  sf; /* NULL: all know all */
} BodyRows;
/* This rank's rows. Freed by BodiesEndRows. Collective. */
PetscErrorCode BodiesBeginRows(Bodies, BodyRows *);
/* `bytes` of every own body, from [n], go to its row, row [rows->n]. Where all ranks know all bodies rank 0 has all
   rows. Collective. */
PetscErrorCode BodiesGatherRows(Bodies, const BodyRows *, size_t bytes, const void *from, void *row);
/* As BodiesGatherRows, from rows back to own bodies; ghosts keep what they have. `bytes`: a multiple of the size of a
   real. Collective. */
PetscErrorCode BodiesScatterRows(Bodies, const BodyRows *, size_t bytes, const void *row, void *to);
/* Frees them. Collective. */
PetscErrorCode BodiesEndRows(BodyRows *);
/* Saves or loads v [n][width] under `name`: the same file whether bodies are spread or not. Collective. */
PetscErrorCode BodiesVisitReals(Bodies, const BodyRows *, State, const char name[], PetscInt width, PetscReal v[]);
/* As BodiesVisitReals, with rows of its own, of what a file may lack: v stays then. Collective. */
PetscErrorCode BodiesVisitOptional(Bodies, State, const char name[], PetscInt width, PetscReal v[]);
/* As BodiesVisitReals, v [n]. Collective. */
PetscErrorCode BodiesVisitIntegers(Bodies, const BodyRows *, State, const char name[], PetscInt v[]);
