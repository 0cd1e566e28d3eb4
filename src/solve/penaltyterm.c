/* PenaltyTerm: see penaltyterm.h. */
#include "compat.h"
#include "impl.h"

void PenaltyTermGetBlock(const PenaltyTerm *s, PetscInt e, PetscReal G[])
{
  const PetscReal *g = s->g + e * (s->dim + 1), *r = g + 1;

  for (PetscInt a = 0; a < s->dim; a++) {
    PetscReal *row = G + a * s->nr;

    for (PetscInt d = 0; d < s->dim; d++) row[d] = d == a ? g[0] : 0;
    if (s->dim == 2) row[2] = a == 0 ? -r[1] : r[0];
    else {
      row[3 + a]           = 0; /* (w x r)_a = w_{a+1} r_{a+2} - w_{a+2} r_{a+1} */
      row[3 + (a + 1) % 3] = r[(a + 2) % 3];
      row[3 + (a + 2) % 3] = -r[(a + 1) % 3];
    }
  }
}

PetscErrorCode PenaltyTermMultAdd(const PenaltyTerm *s, Constraint c, PetscBool of_unknown, const PetscReal U[], const PetscReal u[], PetscReal r[],
                                  PetscReal rigid[])
{
  const PetscInt nr = s->nr, dim = s->dim;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->n; e++) {
    const PetscInt   k = s->body[e], bits = c->unknown[k];
    const PetscReal *ue = u + s->node[e] * dim;
    PetscReal       *re = r + s->node[e] * dim, G[18];

    if (!bits && of_unknown) continue;
    PenaltyTermGetBlock(s, e, G);
    for (PetscInt m = 0; m < nr; m++) {
      const PetscBool is_unknown = (PetscBool)((bits >> m) & 1);

      for (PetscInt a = 0; a < dim; a++) {
        if (is_unknown == of_unknown) re[a] -= G[a * nr + m] * U[c->local_index[k] * nr + m];
        if (is_unknown) rigid[c->local_index[k] * nr + m] -= G[a * nr + m] * ue[a];
      }
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyTermSum(const PenaltyTerm *s, Constraint c)
{
  PetscFunctionBeginUser;
  PetscCall(ConstraintSumRows(c, s->nr * s->nr, s->H, s->whole));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyTermAddForce(const PenaltyTerm *s, Constraint c, const PetscReal u[], const PetscReal U[], PetscReal out[])
{
  const PetscInt nr = s->nr, dim = s->dim;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->n; e++) {
    PetscReal G[18];

    PenaltyTermGetBlock(s, e, G);
    for (PetscInt m = 0; m < nr; m++)
      for (PetscInt a = 0; a < dim; a++) out[s->body[e] * nr + m] += G[a * nr + m] * u[s->node[e] * dim + a];
  }
  for (PetscInt i = 0; i < c->nown; i++)
    for (PetscInt m = 0; m < nr * nr; m++) out[c->own[i] * nr + m / nr] -= s->whole[i * nr * nr + m] * U[c->own[i] * nr + m % nr];
  PetscFunctionReturn(PETSC_SUCCESS);
}
