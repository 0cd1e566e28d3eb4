/* ThinRows: rows of a matrix W without the entries that are small beside the others, for a product W^T W that stays
   sparse. */
#pragma once
#include <petscmat.h>

/* What stays of W. Rows come in groups of nr (own rows: a multiple of nr) with the same columns. The size of a group is
   the largest sum of weight times square (weight: by columns) of its rows. The columns stay in which it is larger than
   `tol` times its largest column, in the 2-norm, or tol/sqrt(size) where its size is above 1, so that what is
   dropped is below a size as well; the sum of each row stays as it is, by changes in proportion to what stays. Where n
   columns would stay, more than `max`, or more than `few` of a size of at most weak/n^power, the group becomes
   empty. */
typedef struct {
  PetscInt  nr, few, max;
  PetscReal tol, weak, power;
} ThinRule;

/* *thin: NULL where nothing stays on any rank; caller destroys. Collective. */
PetscErrorCode ThinRows(Mat W, const ThinRule *, Vec weight, Mat *thin);
