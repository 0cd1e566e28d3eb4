/* PenaltyTerm: see penaltyterm.h. */
#include "compat.h"
#include "rigid.h"
#include "base/rigid.h"

void PenaltyTermGetBlock(const PenaltyTerm *s, PetscInt e, PetscReal G[])
{
  if (s->dim == 2) RigidMapFill(2, s->g[e * 3], s->g + e * 3 + 1, G);
  else RigidMapFill(3, s->g[e * 4], s->g + e * 4 + 1, G);
}

/* One entry with block G [dim][nr] of a body whose velocities `bits` are unknown */
INLINE void mult_entry(const PetscInt dim, const PetscInt nr, PetscInt bits, PetscBool of_unknown,
                       const PetscReal *restrict G, const PetscReal *restrict U, const PetscReal *restrict u,
                       PetscReal *restrict r, PetscReal *restrict rigid)
{
  for (PetscInt m = 0; m < nr; m++) {
    const PetscBool is_unknown = (PetscBool)((bits >> m) & 1);

    for (PetscInt a = 0; a < dim; a++) {
      if (is_unknown == of_unknown) r[a] -= G[a * nr + m] * U[m];
      if (is_unknown) rigid[m] -= G[a * nr + m] * u[a];
    }
  }
}

INLINE void mult_entries(const PetscInt dim, const PetscInt nr, const PenaltyTerm *s, const ConstraintView *c,
                         PetscBool of_unknown, const PetscReal *restrict U, const PetscReal *restrict u,
                         PetscReal *restrict r, PetscReal *restrict rigid)
{
  const PetscInt all = (1 << nr) - 1;

  for (PetscInt e = 0; e < s->n; e++) {
    const PetscInt k = s->body[e], bits = c->unknown[k], at = s->node[e] * dim, slot = c->local_index[k] * nr;
    PetscReal      G[18];

    if (!bits && of_unknown) continue;
    RigidMapFill(dim, s->g[e * (dim + 1)], s->g + e * (dim + 1) + 1, G);
    if (bits == all && of_unknown) mult_entry(dim, nr, all, PETSC_TRUE, G, U + slot, u + at, r + at, rigid + slot);
    else mult_entry(dim, nr, bits, of_unknown, G, U + slot, u + at, r + at, rigid + slot);
  }
}

PetscErrorCode PenaltyTermMultAdd(const PenaltyTerm *s, Constraint constraint, PetscBool of_unknown,
                                  const PetscReal U[], const PetscReal u[], PetscReal r[], PetscReal rigid[])
{
  const ConstraintView *c = ConstraintGetView(constraint);

  PetscFunctionBeginUser;
  if (s->dim == 2) mult_entries(2, 3, s, c, of_unknown, U, u, r, rigid);
  else mult_entries(3, 6, s, c, of_unknown, U, u, r, rigid);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyTermSum(const PenaltyTerm *s, Constraint c)
{
  PetscFunctionBeginUser;
  PetscCall(ConstraintSumRows(c, s->nr * s->nr, s->H, s->whole));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyTermAddForce(const PenaltyTerm *s, Constraint constraint, const PetscReal u[],
                                   const PetscReal U[], PetscReal out[])
{
  const ConstraintView *c  = ConstraintGetView(constraint);
  const PetscInt        nr = s->nr, dim = s->dim;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->n; e++) {
    PetscReal G[18];

    PenaltyTermGetBlock(s, e, G);
    for (PetscInt m = 0; m < nr; m++)
      for (PetscInt a = 0; a < dim; a++) out[s->body[e] * nr + m] += G[a * nr + m] * u[s->node[e] * dim + a];
  }
  for (PetscInt i = 0; i < c->nown; i++)
    for (PetscInt m = 0; m < nr * nr; m++)
      out[c->own[i] * nr + m / nr] -= s->whole[i * nr * nr + m] * U[c->own[i] * nr + m % nr];
  PetscFunctionReturn(PETSC_SUCCESS);
}
