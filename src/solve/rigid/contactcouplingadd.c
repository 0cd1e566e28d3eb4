/* ContactCoupling: what ties add to matrices over bodies (see contactcoupling.h). */
#include "compat.h"
#include "contactcouplingimpl.h"
#include "base/algebra.h"

/* out = L^T row of body k, with L of mass_inverse [nbodies][nr][nr]; NULL: the row in the units of its slots */
void ContactCouplingTransformRow(const ConstraintView *c, const PetscReal mass_inverse[], PetscInt k,
                                 const PetscReal row[], PetscReal out[])
{
  const PetscInt nr = c->nr;
  PetscReal      L[36];

  if (mass_inverse) {
    DenseFactor(nr, mass_inverse + k * nr * nr, L);
    DenseMultiply(nr, L, PETSC_TRUE, row, out);
  } else {
    for (PetscInt a = 0; a < nr; a++) out[a] = row[a] * ConstraintSlotUnit(c, k, a);
  }
}

PetscErrorCode ContactCouplingAdd(ContactCoupling t, const PetscInt column[], const PetscReal mass_inverse[],
                                  PetscReal scale, Mat mat)
{
  const ConstraintView *c  = ConstraintGetView(t->constraint);
  const PetscInt        nr = c->nr;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < t->n; i++) {
    const BodySpring *spring = &t->spring[i];
    PetscReal         row[2][6], block[144];
    PetscInt          at[12], n = 0;

    for (PetscInt s = 0; s < 2; s++) {
      if (spring->body[s] < 0 || !ConstraintHasUnknown(c, spring->body[s]) || column[spring->body[s]] < 0) continue;
      ContactCouplingTransformRow(c, mass_inverse, spring->body[s], spring->row[s], row[n / nr]);
      for (PetscInt a = 0; a < nr; a++) at[n + a] = column[spring->body[s]] + a;
      n += nr;
    }
    for (PetscInt e = 0; e < n * n; e++)
      block[e] = spring->stiffness / scale * row[e / n / nr][e / n % nr] * row[e % n / nr][e % n % nr];
    PetscCall(MatSetValues(mat, n, at, n, at, block, ADD_VALUES));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
