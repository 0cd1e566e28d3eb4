/* ContactCoupling: ties between bodies, see contactcoupling.h. Every tie is on one rank, that of the slots of its first
   body that may move. */
#include "compat.h"
#include "contactcouplingimpl.h"
#include "base/algebra.h"
#include "base/array.h"

PetscErrorCode ContactCouplingCreate(Constraint constraint, ContactCoupling *contact_coupling)
{
  const ConstraintView *c  = ConstraintGetView(constraint);
  const PetscInt        nr = c->nr, nn = nr * nr;
  ContactCoupling       t;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&t));
  t->constraint = constraint;
  PetscCall(PetscMalloc5(c->capacity, &t->number, c->count, &t->coupled, c->count * nn, &t->factor, c->count * (2 + nn),
                         &t->sum, c->count * nr, &t->slots));
  PetscCall(ContactCouplingCreateSystems(t));
  *contact_coupling = t;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCouplingDestroy(ContactCoupling *contact_coupling)
{
  PetscFunctionBeginUser;
  if (!*contact_coupling) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactCouplingDestroySystems(*contact_coupling));
  PetscCall(PetscFree((*contact_coupling)->spring));
  PetscCall(PetscFree5((*contact_coupling)->number, (*contact_coupling)->coupled, (*contact_coupling)->factor,
                       (*contact_coupling)->sum, (*contact_coupling)->slots));
  PetscCall(PetscFree(*contact_coupling));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ContactCouplingAny(ContactCoupling t)
{
  return t->any;
}

/* ---- which ones ---- */

/* Is the tie this rank's? */
static PetscBool is_mine(const ConstraintView *c, PetscMPIInt rank, const BodySpring *spring)
{
  for (PetscInt s = 0; s < 2; s++) {
    const PetscInt k = spring->body[s];

    if (k >= 0 && ConstraintHasUnknown(c, k))
      return (PetscBool)(c->local_index[k] >= 0 && c->local_slot[c->local_index[k]] / c->count == rank);
  }
  return PETSC_FALSE;
}

static void mask_rows(const ConstraintView *c, BodySpring *spring)
{
  for (PetscInt s = 0; s < 2; s++)
    for (PetscInt i = 0; i < c->nr; i++)
      if (spring->body[s] < 0 || !ConstraintIsUnknown(c, spring->body[s], i)) spring->row[s][i] = 0;
}

PetscErrorCode ContactCouplingSet(ContactCoupling t, PetscInt n, const BodySpring spring[])
{
  const ConstraintView *c = ConstraintGetView(t->constraint);
  PetscMPIInt           rank;

  PetscFunctionBeginUser;
  PetscCall(ContactCouplingForgetSystems(t));
  PetscCallMPI(MPI_Comm_rank(c->comm, &rank));
  t->n = 0;
  PetscCall(ArrayReserve(n, &t->capacity, &t->spring, sizeof(*t->spring), NULL));
  for (PetscInt i = 0; i < n; i++) {
    if (spring[i].stiffness <= 0 || !is_mine(c, rank, &spring[i])) continue;
    t->spring[t->n] = spring[i];
    mask_rows(c, &t->spring[t->n++]);
  }
  t->any = (PetscBool)(t->n > 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &t->any, 1, COMPAT_MPI_BOOL, MPI_LOR, c->comm));
  if (t->any) PetscCall(ContactCouplingNumber(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- products ---- */

void ContactCouplingMultAdd(ContactCoupling t, PetscBool others, PetscReal scale, const PetscReal U[], PetscReal out[])
{
  const ConstraintView *c  = ConstraintGetView(t->constraint);
  const PetscInt        nr = c->nr;

  for (PetscInt i = 0; i < t->n; i++) {
    const BodySpring *spring   = &t->spring[i];
    PetscReal         speed[2] = {0, 0};
    PetscInt          local[2] = {-1, -1};

    for (PetscInt s = 0; s < 2; s++) {
      if (spring->body[s] < 0 || !ConstraintHasUnknown(c, spring->body[s])) continue;
      local[s] = c->local_index[spring->body[s]] * nr;
      for (PetscInt a = 0; a < nr; a++) speed[s] += spring->row[s][a] * U[local[s] + a];
    }
    for (PetscInt s = 0; s < 2; s++)
      for (PetscInt a = 0; a < nr && local[s] >= 0; a++)
        out[local[s] + a] += scale * spring->stiffness * (speed[!s] + (others ? 0 : speed[s])) * spring->row[s][a];
  }
}

PetscErrorCode ContactCouplingCreateMat(ContactCoupling t, Mat *mat)
{
  const ConstraintView *c = ConstraintGetView(t->constraint);
  PetscInt              total, *column;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetSizes(t->constraint, NULL, &total));
  PetscCall(PetscMalloc1(c->nbodies, &column));
  PetscCall(ConstraintGetRigidColumns(t->constraint, column));
  PetscCall(MatCreateAIJ(c->comm, total, total, PETSC_DETERMINE, PETSC_DETERMINE, c->nr, NULL, c->nr, NULL, mat));
  PetscCall(MatSetOption(*mat, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
  PetscCall(ContactCouplingAdd(t, column, NULL, 1, *mat));
  PetscCall(MatAssemblyBegin(*mat, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*mat, MAT_FINAL_ASSEMBLY));
  PetscCall(PetscFree(column));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the blocks of bodies ---- */

/* The block of an own body with what the ties add to it; identity where it is known */
static void get_block(const ConstraintView *c, PetscInt k, const PetscReal inverse[], const PetscReal added[],
                      PetscReal block[])
{
  PetscReal M[36];

  for (PetscInt e = 0; e < c->nr * c->nr; e++) {
    const PetscInt i = e / c->nr, j = e % c->nr;

    M[e] = ConstraintIsUnknown(c, k, i) && ConstraintIsUnknown(c, k, j) ? inverse[e] : (PetscReal)(i == j);
  }
  DenseInvert(c->nr, M, block);
  for (PetscInt e = 0; e < c->nr * c->nr; e++) block[e] += added[e];
}

static void stiffen_blocks(ContactCoupling t, PetscReal inverse[])
{
  const ConstraintView *c  = ConstraintGetView(t->constraint);
  const PetscInt        nr = c->nr, nn = nr * nr;

  for (PetscInt i = 0; i < t->ncoupled; i++) {
    const PetscInt at = t->coupled[i], k = c->own[at];
    PetscReal      block[36], with[36];

    get_block(c, k, inverse + at * nn, t->sum + at * (2 + nn) + 1, block);
    DenseInvert(nr, block, with);
    for (PetscInt e = 0; e < nn; e++)
      if (ConstraintIsUnknown(c, k, e / nr) && ConstraintIsUnknown(c, k, e % nr)) inverse[at * nn + e] = with[e];
  }
}

/* ---- public ---- */

PetscErrorCode ContactCouplingUpdate(ContactCoupling t, PetscReal inverse[], const PetscReal mass_inverse[],
                                     PetscReal scale)
{
  PetscFunctionBeginUser;
  if (!t->any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactCouplingForgetSystems(t));
  stiffen_blocks(t, inverse);
  PetscCall(ContactCouplingUpdateSystems(t, mass_inverse, scale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCouplingSolveMass(ContactCoupling t, const PetscReal x[], PetscReal y[])
{
  const ConstraintView *c  = ConstraintGetView(t->constraint);
  const PetscInt        nr = c->nr;

  PetscFunctionBeginUser;
  if (!t->any) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < t->ncoupled; i++) {
    PetscReal force[6];

    for (PetscInt a = 0; a < nr; a++)
      force[a] = x[t->coupled[i] * nr + a] / ConstraintSlotUnit(c, c->own[t->coupled[i]], a);
    DenseMultiply(nr, t->factor + i * nr * nr, PETSC_TRUE, force, t->slots + t->coupled[i] * nr);
  }
  PetscCall(ContactCouplingSolveSystems(t, t->slots));
  for (PetscInt i = 0; i < t->ncoupled; i++) {
    PetscReal *u = y + t->coupled[i] * nr;

    DenseMultiply(nr, t->factor + i * nr * nr, PETSC_FALSE, t->slots + t->coupled[i] * nr, u);
    for (PetscInt a = 0; a < nr; a++) u[a] /= ConstraintSlotUnit(c, c->own[t->coupled[i]], a);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The solutions to the bodies known here: own ones from their slots, others from the open system */
static PetscErrorCode copy_to_local(ContactCoupling t, PetscReal z[])
{
  const ConstraintView *c  = ConstraintGetView(t->constraint);
  const PetscInt        nr = c->nr;
  const PetscReal      *x  = NULL;

  PetscFunctionBeginUser;
  if (t->open.n > 0) PetscCall(VecGetArrayRead(t->open.x, &x));
  for (PetscInt l = 0; l < c->nlocal; l++) {
    const PetscInt number = t->number[c->local_list[l]];

    if (number <= -2) PetscCall(PetscArraycpy(z + l * nr, x + (-2 - number) * nr, nr));
  }
  if (x) PetscCall(VecRestoreArrayRead(t->open.x, &x));
  for (PetscInt i = 0; i < t->ncoupled; i++)
    if (t->index[i] >= 0)
      PetscCall(PetscArraycpy(z + c->local_index[c->own[t->coupled[i]]] * nr, t->slots + t->coupled[i] * nr, nr));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCouplingSolveBegin(ContactCoupling t, const PetscReal partial[])
{
  PetscFunctionBeginUser;
  if (t->any && !t->iterated) PetscCall(ContactCouplingSumBegin(t, partial));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCouplingSolveEnd(ContactCoupling t, PetscReal z[])
{
  const ConstraintView *c  = ConstraintGetView(t->constraint);
  const PetscInt        nr = c->nr;
  const PetscReal      *local;

  PetscFunctionBeginUser;
  if (!t->any) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < t->ncoupled; i++)
    PetscCall(PetscArraycpy(t->slots + t->coupled[i] * nr, z + c->local_index[c->own[t->coupled[i]]] * nr, nr));
  if (!t->iterated) {
    PetscCall(ContactCouplingSumEnd(t, t->slots));
    PetscCall(copy_to_local(t, z));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(ContactCouplingSolveSystems(t, t->slots));
  PetscCall(ConstraintFetchSlots(t->constraint, t->slots, &local));
  for (PetscInt l = 0; l < c->nlocal; l++)
    if (t->number[c->local_list[l]] >= 0) PetscCall(PetscArraycpy(z + l * nr, local + l * nr, nr));
  PetscFunctionReturn(PETSC_SUCCESS);
}
