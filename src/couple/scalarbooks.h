/* ScalarBooks: heat that appears in cells whose nodes move.

   Cells that deform and values that are carried to other nodes do not keep the heat exactly: what appears, d(T) over
   the new cells less that of the old ones and of T div V, V the velocity of nodes, is predicted with T extrapolated and
   given back in the same step, as a source in the cells that go along; the rest in the next. */
#pragma once
#include "couple/couple.h"
#include "scalar/scalar.h"

typedef struct _p_ScalarBooks *ScalarBooks;

/* How the mesh moves in a step */
typedef struct {
  const PetscReal *V;     /* [nnode_all][dim] */
  const PetscInt  *skip;  /* [ncell_all] cells >= 0 move as a whole, and get nothing; NULL: there are none */
  const PetscReal *along; /* [nnode_all] > 0: cells of such nodes get back what appears */
} ScalarMotion;

PetscErrorCode ScalarBooksCreate(Couple, Scalars, ScalarBooks *);
PetscErrorCode ScalarBooksDestroy(ScalarBooks *);
/* What the solution of scalar i has on the mesh as it is is its heat at the start; without this, it is what the first
   step takes its history for. Collective. */
PetscErrorCode ScalarBooksBegin(ScalarBooks, const ScalarMotion *, PetscInt i);
/* After ScalarsPredict of scalar i: adds to source [ncell_all] what is given back; others: what appears that is in
   other books. Collective. */
PetscErrorCode ScalarBooksGiveBack(ScalarBooks, const ScalarMotion *, PetscInt i, PetscReal others, PetscReal source[]);
/* After it is solved for: what appears is another one than predicted by so much (*again) that the source is put right,
   and the scalar is to be solved for again. Collective. */
PetscErrorCode ScalarBooksCorrect(ScalarBooks, const ScalarMotion *, PetscInt i, PetscReal others, PetscReal source[],
                                  PetscBool *again);
/* After it is solved for: covered += what appears, with what was given back. Collective. */
PetscErrorCode ScalarBooksMeasure(ScalarBooks, const ScalarMotion *, PetscInt i, PetscReal others, PetscReal *covered);
/* The step is taken. Local. */
PetscErrorCode ScalarBooksAccept(ScalarBooks);
/* what: under which name. Collective. */
PetscErrorCode ScalarBooksVisit(ScalarBooks, const char what[], State);
