/* Owners: see owners.h. */
#include "compat.h"
#include "impl.h"
#include "base/project.h"

/* Where `owner` stands among n entries of `size` bytes that begin with their owner, or n */
static PetscInt find_owner(const void *list, size_t size, PetscInt n, const void *owner)
{
  PetscInt i = 0;

  while (i < n && *(const void *const *)((const char *)list + (size_t)i * size) != owner) i++;
  return i;
}

PetscErrorCode OwnersAssign(PetscInt max, void *list, size_t size, PetscInt *n, const void *owner, PetscBool add,
                            PetscInt *at)
{
  char *entry = list;

  PetscFunctionBeginUser;
  *at = find_owner(list, size, *n, owner);
  if (add) {
    PetscCheck(*at < max, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
               "More than %" PetscInt_FMT " owners have a part in a flow", max);
    *n = PetscMax(*n, *at + 1);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (*at < *n) memmove(entry + (size_t)*at * size, entry + (size_t)(*at + 1) * size, (size_t)(*n - *at - 1) * size);
  if (*at < *n) --*n;
  *at = -1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* He knows of the present mesh */
static void find_again(Owners *o, const void *owner)
{
  for (PetscInt i = o->nlost - 1; i >= 0; i--)
    if (o->lost[i] == owner) o->lost[i] = o->lost[--o->nlost];
}

static void lose(Owners *o, const void *owner)
{
  find_again(o, owner); /* once */
  o->lost[o->nlost++] = owner;
}

void OwnersLose(const Owners *before, Owners *now)
{
  for (PetscInt i = 0; i < before->nlost; i++) lose(now, before->lost[i]);
  for (PetscInt i = 0; i < before->nterms; i++) lose(now, before->terms[i].owner);
  for (PetscInt i = 0; i < before->noperators; i++) lose(now, before->operators[i].owner);
  for (PetscInt i = 0; i < before->nforces; i++) lose(now, before->forces[i].owner);
  for (PetscInt i = 0; i < before->nvolumes; i++) lose(now, before->volumes[i].owner);
}

PetscErrorCode OwnersCheck(const struct _p_Flow *f)
{
  PetscFunctionBeginUser;
  PetscCheck(!f->owners.nlost, f->comm, PETSC_ERR_ORDER,
             "The mesh has been rebuilt, and %" PetscInt_FMT
             " owner(s) of terms, operators, forces or volumes of the old one have given none for the new one, nor taken them back (FlowAddCellTerms, FlowAddOperator, FlowAddForce, FlowAddVolume with NULL)",
             f->owners.nlost);
  PetscCheck(!f->properties.lost, f->comm, PETSC_ERR_ORDER,
             "The mesh has been rebuilt, and its cells have no density and viscosity: call FlowSetProperties again");
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAddCellTerms(Flow f, const void *owner, PetscInt n, const PetscInt cell[], const PetscReal matrix[])
{
  Owners  *o = &f->owners;
  PetscInt at;

  PetscFunctionBeginUser;
  find_again(&f->owners, owner);
  PetscCall(OwnersAssign(FLOW_OWNERS, o->terms, sizeof(*o->terms), &o->nterms, owner, (PetscBool)(n > 0), &at));
  if (at >= 0) o->terms[at] = (CellTerms){.owner = owner, .n = n, .cell = cell, .matrix = matrix};
  f->matrix.ct = 0; /* assemble anew, also without convection */
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDescribeCellTerms(Flow f, const void *owner, const FlowMoments *moments)
{
  Owners        *o  = &f->owners;
  const PetscInt at = find_owner(o->terms, sizeof(*o->terms), o->nterms, owner);

  PetscFunctionBeginUser;
  if (at == o->nterms) PetscFunctionReturn(PETSC_SUCCESS);
  o->terms[at].moments = *moments;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCountCellTerms(Flow f, const void *owner, const PetscReal lumped[])
{
  Owners        *o      = &f->owners;
  const PetscInt before = o->nterms;
  PetscInt       at;

  PetscFunctionBeginUser;
  PetscCall(OwnersAssign(FLOW_OWNERS, o->terms, sizeof(*o->terms), &o->nterms, owner, PETSC_TRUE, &at));
  if (at == before) o->terms[at] = (CellTerms){.owner = owner}; /* none of its terms is on this rank */
  o->terms[at].lumped = lumped;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAddForce(Flow f, const void *owner, const PetscReal force[])
{
  Owners  *o = &f->owners;
  PetscInt at;

  PetscFunctionBeginUser;
  find_again(&f->owners, owner);
  PetscCall(
    OwnersAssign(FLOW_OWNERS, o->forces, sizeof(*o->forces), &o->nforces, owner, (PetscBool)(force != NULL), &at));
  if (at >= 0) o->forces[at] = (OwnedForce){owner, force};
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* r -= terms u, cells of this rank */
static void subtract_terms(const MeshLocal *l, const CellTerms *terms, const PetscReal u[], PetscReal r[])
{
  const PetscInt nb = l->nb, dim = l->dim;

  for (PetscInt t = 0; t < terms->n; t++) {
    const PetscInt  *node = l->cell_node + terms->cell[t] * nb;
    const PetscReal *M    = terms->matrix + t * nb * nb;

    if (terms->cell[t] >= l->ncell) continue;
    for (PetscInt i = 0; i < nb * nb; i++)
      for (PetscInt a = 0; a < dim; a++) r[dim * node[i / nb] + a] -= M[i] * u[dim * node[i % nb] + a];
  }
}

PetscErrorCode FlowGetGiven(Flow f, const void *except, const PetscReal u[], PetscReal *given[])
{
  const Owners *o = &f->owners;
  PetscInt      n = 0;

  PetscFunctionBeginUser;
  *given = NULL;
  for (PetscInt i = 0; i < o->nforces; i++) n += o->forces[i].owner != except;
  for (PetscInt i = 0; i < o->nterms; i++) n += o->terms[i].owner != except;
  if (!n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(f->loc->nnode_all * f->loc->dim, given));
  for (PetscInt i = 0; i < o->nforces; i++) {
    if (o->forces[i].owner == except) continue;
    for (PetscInt j = 0; j < f->loc->nnode_all * f->loc->dim; j++) (*given)[j] += o->forces[i].f[j];
  }
  for (PetscInt i = 0; i < o->nterms; i++)
    if (o->terms[i].owner != except) subtract_terms(f->loc, o->terms + i, u, *given);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What was made of it */
static PetscErrorCode clear_operator(OwnedOperator *o)
{
  PetscFunctionBeginUser;
  PetscCall(MatDestroy(&o->formed));
  for (PetscInt i = 0; i < 2; i++) PetscCall(VecDestroy(&o->work[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAddOperator(Flow f, const void *owner, const FlowOperator *of)
{
  Owners  *o  = &f->owners;
  PetscInt at = find_owner(o->operators, sizeof(*o->operators), o->noperators, owner);

  PetscFunctionBeginUser;
  find_again(&f->owners, owner);
  if (at < o->noperators) PetscCall(clear_operator(&o->operators[at]));
  PetscCall(OwnersAssign(FLOW_OWNERS, o->operators, sizeof(*o->operators), &o->noperators, owner,
                         (PetscBool)(of != NULL), &at));
  if (at >= 0) o->operators[at] = (OwnedOperator){.owner = owner, .is = *of};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAddVolume(Flow f, const void *owner, const FlowVolume *of)
{
  Owners  *o = &f->owners;
  PetscInt at;

  PetscFunctionBeginUser;
  find_again(o, owner);
  PetscCall(
    OwnersAssign(FLOW_OWNERS, o->volumes, sizeof(*o->volumes), &o->nvolumes, owner, (PetscBool)(of != NULL), &at));
  if (at >= 0) o->volumes[at] = (OwnedVolume){owner, *of};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool FlowGetVolume(Flow f, PetscInt i, const FlowVolume **volume)
{
  *volume = i < f->owners.nvolumes ? &f->owners.volumes[i].is : NULL;
  return (PetscBool)(*volume != NULL);
}

PetscErrorCode OwnersSumVolumes(const struct _p_Flow *f, const PetscReal p[], PetscReal *imposed[])
{
  const PetscInt nk = f->loc->dim + 1;

  PetscFunctionBeginUser;
  *imposed = NULL;
  if (!f->owners.nvolumes) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(f->loc->ncell, imposed));
  for (PetscInt i = 0; i < f->owners.nvolumes; i++) {
    const FlowVolume *v = &f->owners.volumes[i].is;

    PetscCheck(!v->C || p, f->comm, PETSC_ERR_ARG_NULL, "Cells that give way to the pressure: it has to be known");
    for (PetscInt e = 0; v->g && e < v->n; e++) (*imposed)[v->cell[e]] += v->g[e * nk];
    for (PetscInt e = 0; v->C && e < v->n; e++)
      for (PetscInt k = 0; k < nk; k++) (*imposed)[v->cell[e]] -= v->C[e * nk * nk + k] * p[v->cell[e] * nk + k];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* As a matrix, which get_matrix then has */
static PetscErrorCode form_operator(OwnedOperator *o)
{
  Mat E, P;

  PetscFunctionBeginUser;
  if (!o->is.P || o->formed) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatConvert(o->is.E, MATAIJ, MAT_INITIAL_MATRIX, &E));
  PetscCall(MatConvert(o->is.P, MATAIJ, MAT_INITIAL_MATRIX, &P));
  PetscCall(MatrixProject(E, P, &o->formed));
  PetscCall(MatDestroy(&E));
  PetscCall(MatDestroy(&P));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static Mat get_matrix(const OwnedOperator *o)
{
  return o->is.P ? o->formed : o->is.E;
}

/* For products, if it has fewer entries than what it is made of */
static PetscErrorCode keep_cheaper(OwnedOperator *o)
{
  MatInfo P, E, formed;
  Mat     one;

  PetscFunctionBeginUser;
  if (!o->formed) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatMAIJGetAIJ(o->is.P, &one));
  PetscCall(MatGetInfo(one, MAT_GLOBAL_SUM, &P));
  PetscCall(MatGetInfo(o->is.E, MAT_GLOBAL_SUM, &E));
  PetscCall(MatGetInfo(o->formed, MAT_GLOBAL_SUM, &formed));
  if (formed.nz_used > E.nz_used + 2 * P.nz_used) PetscCall(MatDestroy(&o->formed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAddOperatorsTo(Flow f, Mat A)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < f->owners.noperators; i++) {
    OwnedOperator *o = &f->owners.operators[i];

    PetscCall(form_operator(o));
    PetscCall(MatAXPY(A, 1, get_matrix(o), DIFFERENT_NONZERO_PATTERN));
    PetscCall(keep_cheaper(o));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool FlowHasOperators(Flow f)
{
  return (PetscBool)(f->owners.noperators > 0);
}

PetscBool FlowHasStiffOperators(Flow f)
{
  PetscBool stiff = PETSC_FALSE;

  for (PetscInt i = 0; i < f->owners.noperators; i++) stiff = (PetscBool)(stiff || f->owners.operators[i].is.stiff);
  return stiff;
}

PetscErrorCode FlowMarkOperators(Flow f, PetscBool marked[])
{
  const PetscInt dim = f->loc->dim;

  PetscFunctionBeginUser;
  for (PetscInt o = 0; o < f->owners.noperators; o++) {
    PetscInt start;
    Mat      E;

    if (f->owners.operators[o].is.compliant) continue;
    PetscCall(form_operator(&f->owners.operators[o]));
    E = get_matrix(&f->owners.operators[o]);
    PetscCall(MatGetOwnershipRange(E, &start, NULL));
    for (PetscInt i = 0; i < f->loc->nnode * dim; i++) {
      const PetscScalar *v;
      PetscInt           n;

      PetscCall(MatGetRow(E, start + i, &n, NULL, &v));
      for (PetscInt j = 0; j < n; j++) marked[i / dim] = (PetscBool)(marked[i / dim] || v[j] != 0);
      PetscCall(MatRestoreRow(E, start + i, &n, NULL, &v));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y += P^T E P x */
static PetscErrorCode multiply_mapped(OwnedOperator *o, Vec x, Vec y)
{
  PetscFunctionBeginUser;
  if (!o->work[0]) {
    PetscCall(MatCreateVecs(o->is.P, NULL, &o->work[0]));
    PetscCall(VecDuplicate(o->work[0], &o->work[1]));
  }
  PetscCall(MatMult(o->is.P, x, o->work[0]));
  PetscCall(MatMult(o->is.E, o->work[0], o->work[1]));
  PetscCall(MatMultTransposeAdd(o->is.P, o->work[1], y, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowMultiplyOperators(Flow f, Vec x, Vec y)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < f->owners.noperators; i++) {
    OwnedOperator *o = &f->owners.operators[i];
    const Mat      E = get_matrix(o);

    if (E) PetscCall(MatMultAdd(E, x, y, y));
    else PetscCall(multiply_mapped(o, x, y));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetOperatorDiagonal(Flow f, const PetscReal *diagonal[])
{
  Owners   *o   = &f->owners;
  PetscBool any = (PetscBool)(o->noperators > 0);

  PetscFunctionBeginUser;
  *diagonal = NULL;
  for (PetscInt i = 0; i < o->nterms; i++) any = (PetscBool)(any || o->terms[i].lumped);
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  if (!o->lumped) PetscCall(PetscMalloc1(f->loc->nnode_all, &o->lumped));
  PetscCall(PetscArrayzero(o->lumped, f->loc->nnode_all));
  for (PetscInt i = 0; i < o->noperators; i++)
    for (PetscInt j = 0; j < f->loc->nnode_all && o->operators[i].is.lumped; j++)
      o->lumped[j] += o->operators[i].is.lumped[j];
  for (PetscInt i = 0; i < o->nterms; i++)
    for (PetscInt j = 0; j < f->loc->nnode_all && o->terms[i].lumped; j++) o->lumped[j] += o->terms[i].lumped[j];
  *diagonal = o->lumped;
  PetscFunctionReturn(PETSC_SUCCESS);
}

void OwnersAddForces(const struct _p_Flow *f, PetscReal r[])
{
  const PetscInt dim = f->loc->dim;

  for (PetscInt i = 0; i < f->owners.nforces; i++)
    for (PetscInt j = 0; j < f->loc->nnode_all * dim; j++) r[j] += f->owners.forces[i].f[j];
  for (PetscInt i = 0; i < f->owners.noperators; i++)
    for (PetscInt j = 0; j < f->loc->nnode * dim && f->owners.operators[i].is.force; j++)
      r[j] += f->owners.operators[i].is.force[j];
}

PetscErrorCode OwnersClear(Owners *o)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < o->noperators; i++) PetscCall(clear_operator(&o->operators[i]));
  PetscCall(PetscFree(o->lumped));
  o->nterms = o->noperators = o->nforces = o->nvolumes = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}
