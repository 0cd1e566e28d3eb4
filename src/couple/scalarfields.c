/* ScalarFields: see scalarfields.h. */
#include "compat.h"
#include "scalarfields.h"

PetscErrorCode ScalarFieldsPack(Scalars s, const MeshLocal *l, PetscReal *field[])
{
  PetscFunctionBeginUser;
  for (PetscInt f = 0; f < ScalarsCount(s); f++) {
    PetscReal *T[2];

    PetscCall(ScalarsGetFields(s, f, &T[0], &T[1]));
    PetscCall(PetscCalloc1(l->nnode_all * l->dim, &field[f]));
    for (PetscInt e = 0; e < 2 * l->nnode_all; e++) field[f][e / 2 * l->dim + e % 2] = T[e % 2][e / 2];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarFieldsSet(Scalars s, PetscInt dim, PetscInt i, const PetscReal way[], const PetscReal v[])
{
  PetscFunctionBeginUser;
  for (PetscInt f = 0; f < ScalarsCount(s); f++) {
    const ScalarParameters *par;
    PetscReal              *T[2], more = 0;

    PetscCall(ScalarsGetParameters(s, f, &par));
    PetscCall(ScalarsGetFields(s, f, &T[0], &T[1]));
    for (PetscInt a = 0; a < dim; a++) more += par->gradient[a] * way[a];
    for (PetscInt t = 0; t < 2; t++) T[t][i] = v[f * dim + t] - more;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarFieldsSync(Scalars s, Mesh mesh)
{
  PetscFunctionBeginUser;
  for (PetscInt f = 0; f < ScalarsCount(s); f++) {
    PetscReal *T[2];

    PetscCall(ScalarsGetFields(s, f, &T[0], &T[1]));
    for (PetscInt t = 0; t < 2; t++) PetscCall(MeshSyncNodes(mesh, 1, T[t]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
