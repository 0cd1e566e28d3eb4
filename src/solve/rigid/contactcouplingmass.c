/* ContactCoupling: the system of masses (see contactcouplingimpl.h). */
#include "compat.h"
#include "contactcouplingimpl.h"
#include "base/algebra.h"
#include "base/pivots.h"
#include "base/sparse.h"

#define AS_EXACT 1e-3 /* tolerance of iterated solves, which stand for factors in preconditioners */
#define MAX_OPEN 2000 /* bodies that every rank solves for; more are iterated */

/* ---- which rank solves for a body ---- */

static PetscInt find_root(PetscInt parent[], PetscInt k)
{
  while (parent[k] != k) k = parent[k] = parent[parent[k]];
  return k;
}

/* open [nbodies] of own tied bodies: in a cluster of this rank with a body that another rank knows, or has */
static PetscErrorCode find_open(ContactCoupling t, const PetscBool own[], const PetscBool shared[], PetscBool open[])
{
  const ConstraintView *c = ConstraintGetView(t->constraint);
  PetscInt             *parent;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->nbodies, &parent));
  for (PetscInt k = 0; k < c->nbodies; k++) parent[k] = k;
  for (PetscInt i = 0; i < t->n; i++) {
    const PetscInt a = t->spring[i].body[0], b = t->spring[i].body[1];

    if (a >= 0 && b >= 0 && ConstraintHasUnknown(c, a) && ConstraintHasUnknown(c, b))
      parent[find_root(parent, a)] = find_root(parent, b);
  }
  for (PetscInt k = 0; k < c->nbodies; k++)
    if (!own[k] || shared[k]) open[find_root(parent, k)] = PETSC_TRUE;
  for (PetscInt k = 0; k < c->nbodies; k++) {
    const PetscInt root = find_root(parent, k);

    if (root != k) open[k] = open[root];
  }
  PetscCall(PetscFree(parent));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rows of the open bodies on each rank; *first: number of the first one here */
static PetscErrorCode count_open(ContactCoupling t, PetscInt nopen, PetscInt *first)
{
  const PetscInt nr = ConstraintGetView(t->constraint)->nr;
  PetscMPIInt    n, size, rank;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(ContactCouplingComm(t), &size));
  PetscCallMPI(MPI_Comm_rank(ContactCouplingComm(t), &rank));
  PetscCall(PetscMPIIntCast(nopen * nr, &n));
  if (size > 1) PetscCallMPI(MPI_Allgather(&n, 1, MPI_INT, t->length, 1, MPI_INT, ContactCouplingComm(t)));
  else t->length[0] = n;
  t->open.n = 0;
  for (PetscMPIInt r = 0; r < size; r++) {
    PetscCall(PetscMPIIntCast(t->open.n * nr, &t->begin[r]));
    t->open.n += t->length[r] / nr;
  }
  *first = t->begin[rank] / nr;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Numbers of own tied bodies, then of those of other ranks that are known here */
static PetscErrorCode number_coupled(ContactCoupling t, const PetscBool open[])
{
  const ConstraintView *c     = ConstraintGetView(t->constraint);
  PetscInt              nopen = 0, first = 0;
  PetscReal            *own, *value;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < t->ncoupled; i++) nopen += open[c->own[t->coupled[i]]];
  PetscCall(count_open(t, nopen, &first));
  t->iterated = (PetscBool)(t->asked || t->open.n > MAX_OPEN);
  t->first    = 0;
  if (t->iterated) PetscCallMPI(MPI_Exscan(&t->ncoupled, &t->first, 1, MPIU_INT, MPI_SUM, c->comm));
  PetscCall(PetscMalloc2(c->count, &own, c->nbodies, &value));
  for (PetscInt i = 0; i < c->nown; i++) own[i] = -1;
  t->closed.n = 0;
  for (PetscInt i = 0; i < t->ncoupled; i++) {
    if (t->iterated) t->index[i] = t->first + i;
    else t->index[i] = open[c->own[t->coupled[i]]] ? -2 - first++ : t->closed.n++;
    own[t->coupled[i]] = (PetscReal)t->index[i];
  }
  for (PetscInt k = 0; k < c->nbodies; k++) value[k] = -1;
  if (t->iterated || t->open.n > 0) PetscCall(ConstraintCopyRows(t->constraint, 1, own, value));
  for (PetscInt k = 0; k < c->nbodies; k++) t->number[k] = (PetscInt)value[k];
  for (PetscInt i = 0; i < t->ncoupled; i++) t->number[c->own[t->coupled[i]]] = t->index[i];
  PetscCall(PetscFree2(own, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Are its bodies others than those of the tie before? A bond has as many ties as modes, one after the other. */
static PetscBool is_another_pair(ContactCoupling t, PetscInt i)
{
  const PetscInt *body = t->spring[i].body, *last = i > 0 ? t->spring[i - 1].body : NULL;

  return (PetscBool)(!last || last[0] != body[0] || last[1] != body[1]);
}

PetscErrorCode ContactCouplingNumber(ContactCoupling t)
{
  const ConstraintView *c  = ConstraintGetView(t->constraint);
  const PetscInt        nr = c->nr, width = 2 + nr * nr;
  PetscReal            *value, max        = 0;
  PetscBool            *own, *shared, *open;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc4(c->nbodies * width, &value, c->nbodies, &own, c->nbodies, &shared, c->nbodies, &open));
  for (PetscInt i = 0; i < 2 * t->n; i++) {
    const BodySpring *spring = &t->spring[i / 2];
    const PetscReal  *row    = spring->row[i % 2];
    const PetscInt    at     = spring->body[i % 2] * width;

    if (at < 0) continue;
    value[at] += is_another_pair(t, i / 2);
    for (PetscInt e = 0; e < nr * nr; e++) value[at + 1 + e] += spring->stiffness * row[e / nr] * row[e % nr];
  }
  for (PetscInt i = 0; i < c->nown; i++) own[c->own[i]] = PETSC_TRUE;
  for (PetscInt l = 0; l < c->nlocal; l++)
    if (!own[c->local_list[l]]) value[c->local_list[l] * width + width - 1] = 1;
  PetscCall(ConstraintSumRows(t->constraint, width, value, t->sum));
  t->ncoupled = 0;
  for (PetscInt i = 0; i < c->nown; i++) {
    max               = PetscMax(max, t->sum[i * width]);
    shared[c->own[i]] = (PetscBool)(t->sum[i * width + width - 1] > 0);
    if (t->sum[i * width] > 0 && ConstraintHasUnknown(c, c->own[i])) t->coupled[t->ncoupled++] = i;
  }
  t->nblock = (PetscInt)max + 1;
  PetscCall(find_open(t, own, shared, open));
  PetscCall(number_coupled(t, open));
  PetscCall(PetscFree4(value, own, shared, open));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- a system of this rank alone ---- */

static PetscErrorCode forget_system(SpringSystem *s)
{
  PetscFunctionBeginUser;
  if (s->ksp) PetscCall(KSPReset(s->ksp));
  PetscCall(MatDestroy(&s->mat));
  PetscCall(VecDestroy(&s->b));
  PetscCall(VecDestroy(&s->x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The identity, to which ties are added, with room for most entries a row */
static PetscErrorCode begin_system(SpringSystem *s, PetscInt rows, PetscInt max)
{
  PetscFunctionBeginUser;
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, rows, rows, max, NULL, &s->mat));
  PetscCall(MatSetOption(s->mat, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
  PetscCall(MatCreateVecs(s->mat, &s->x, &s->b));
  for (PetscInt i = 0; i < rows; i++) PetscCall(MatSetValue(s->mat, i, i, 1, ADD_VALUES));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Factorise it */
static PetscErrorCode end_system(SpringSystem *s)
{
  PC pc;

  PetscFunctionBeginUser;
  PetscCall(MatAssemblyBegin(s->mat, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(s->mat, MAT_FINAL_ASSEMBLY));
  if (!s->ksp) {
    PetscCall(KSPCreate(PETSC_COMM_SELF, &s->ksp));
    PetscCall(KSPSetType(s->ksp, KSPPREONLY));
    PetscCall(KSPGetPC(s->ksp, &pc));
    PetscCall(PCSetType(pc, PCLU));
    PetscCall(PivotsOfAnySize(s->ksp));
  }
  PetscCall(KSPSetOperators(s->ksp, s->mat, s->mat));
  PetscCall(KSPSetUp(s->ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the open ones ---- */

#define RECORD_WIDTH(nr) (3 + 2 * (nr)) /* numbers of two bodies, stiffness/scale, their rows */

/* Open ties of this rank as numbers; NULL: how many numbers */
static PetscInt pack_springs(ContactCoupling t, const PetscReal mass_inverse[], PetscReal scale, PetscReal out[])
{
  const ConstraintView *c = ConstraintGetView(t->constraint);
  PetscInt              n = 0;

  for (PetscInt i = 0; i < t->n; i++) {
    const BodySpring *spring = &t->spring[i];
    PetscReal         dummy[RECORD_WIDTH(6)], *v = out ? out + n : dummy;
    PetscBool         open = PETSC_FALSE;

    for (PetscInt s = 0; s < 2; s++) {
      const PetscInt k = spring->body[s];

      v[s] = -1;
      if (k < 0 || !ConstraintHasUnknown(c, k) || t->number[k] > -2) continue;
      open = PETSC_TRUE;
      v[s] = (PetscReal)(-2 - t->number[k]);
      if (out) ContactCouplingTransformRow(c, mass_inverse, k, spring->row[s], v + 3 + s * c->nr);
    }
    v[2] = spring->stiffness / scale;
    if (open) n += RECORD_WIDTH(c->nr);
  }
  return n;
}

/* As ContactCouplingAdd does it, of a tie as numbers */
static PetscErrorCode add_record(PetscInt nr, const PetscReal v[], Mat mat)
{
  PetscReal row[12], block[144];
  PetscInt  at[12], n = 0;

  PetscFunctionBeginUser;
  for (PetscInt s = 0; s < 2; s++)
    for (PetscInt a = 0; a < nr && v[s] >= 0; a++) {
      row[n]  = v[3 + s * nr + a];
      at[n++] = (PetscInt)v[s] * nr + a;
    }
  for (PetscInt e = 0; e < n * n; e++) block[e] = v[2] * row[e / n] * row[e % n];
  PetscCall(MatSetValues(mat, n, at, n, at, block, ADD_VALUES));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The system of all open bodies on every rank */
static PetscErrorCode update_open(ContactCoupling t, const PetscReal mass_inverse[], PetscReal scale)
{
  const PetscInt nr = ConstraintGetView(t->constraint)->nr,
                 n  = pack_springs(t, mass_inverse, scale, NULL) / RECORD_WIDTH(nr);
  PetscInt   total;
  PetscReal *own, *all;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1((n + 1) * RECORD_WIDTH(nr), &own));
  (void)pack_springs(t, mass_inverse, scale, own);
  PetscCall(SparseGather(ContactCouplingComm(t), n, RECORD_WIDTH(nr) * sizeof(*own), own, &total, &all, NULL));
  PetscCall(begin_system(&t->open, t->open.n * nr, t->nblock * nr));
  for (PetscInt e = 0; e < total; e++) PetscCall(add_record(nr, all + e * RECORD_WIDTH(nr), t->open.mat));
  PetscCall(end_system(&t->open));
  PetscCall(PetscFree(all));
  PetscCall(PetscFree(own));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The system of the closed bodies of this rank */
static PetscErrorCode update_closed(ContactCoupling t, const PetscReal mass_inverse[], PetscReal scale)
{
  const PetscInt nr = ConstraintGetView(t->constraint)->nr;
  PetscInt      *column;

  PetscFunctionBeginUser;
  if (t->closed.n == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(begin_system(&t->closed, t->closed.n * nr, t->nblock * nr));
  PetscCall(PetscMalloc1(ConstraintGetView(t->constraint)->nbodies, &column));
  for (PetscInt k = 0; k < ConstraintGetView(t->constraint)->nbodies; k++)
    column[k] = t->number[k] >= 0 ? t->number[k] * nr : -1;
  PetscCall(ContactCouplingAdd(t, column, mass_inverse, scale, t->closed.mat));
  PetscCall(PetscFree(column));
  PetscCall(end_system(&t->closed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- across ranks, iterated ---- */

/* By CG with one reduction an iteration over the factors of each rank's own part */
static PetscErrorCode create_iteration(ContactCoupling t, KSP *ksp, PetscBool *asked)
{
  PC          pc;
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(ContactCouplingComm(t), &size));
  PetscCall(KSPCreate(ContactCouplingComm(t), ksp));
  PetscCall(KSPSetOptionsPrefix(*ksp, "flow_ties_"));
  PetscCall(KSPGetPC(*ksp, &pc));
  PetscCall(PCSetType(pc, size == 1 ? PCLU : PCBJACOBI));
  if (size == 1) PetscCall(PivotsOfAnySize(*ksp));
  PetscCall(KSPSetType(*ksp, size == 1 ? KSPPREONLY : KSPCG));
  if (size > 1) PetscCall(KSPSetNormType(*ksp, KSP_NORM_NATURAL));
  if (size > 1) PetscCall(KSPCGUseSingleReduction(*ksp, PETSC_TRUE));
  PetscCall(KSPSetTolerances(*ksp, AS_EXACT, 0, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(PetscOptionsHasName(NULL, "flow_ties_", "-ksp_type", asked));
  if (*asked) PetscCall(KSPSetFromOptions(*ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The ties of a rank's own bodies are solved for at once */
static PetscErrorCode factor_blocks(KSP ksp)
{
  PetscInt  n;
  PetscBool blocks;
  KSP      *sub;
  PC        pc;

  PetscFunctionBeginUser;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCBJACOBI, &blocks));
  if (!blocks) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PCBJacobiGetSubKSP(pc, &n, NULL, &sub));
  for (PetscInt i = 0; i < n; i++) {
    PetscCall(KSPGetPC(sub[i], &pc));
    PetscCall(PCSetType(pc, PCLU));
    PetscCall(PivotsOfAnySize(sub[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update_iteration(ContactCoupling t, const PetscReal mass_inverse[], PetscReal scale)
{
  const ConstraintView *c  = ConstraintGetView(t->constraint);
  const PetscInt        nr = c->nr, n = t->ncoupled * nr, max = t->nblock * nr;
  PetscInt             *column;

  PetscFunctionBeginUser;
  PetscCall(MatCreateAIJ(c->comm, n, n, PETSC_DETERMINE, PETSC_DETERMINE, max, NULL, max, NULL, &t->mat));
  PetscCall(MatSetOption(t->mat, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
  PetscCall(MatCreateVecs(t->mat, &t->x, &t->b));
  for (PetscInt row = t->first * nr; row < t->first * nr + n; row++)
    PetscCall(MatSetValue(t->mat, row, row, 1, ADD_VALUES));
  PetscCall(PetscMalloc1(c->nbodies, &column));
  for (PetscInt k = 0; k < c->nbodies; k++) column[k] = t->number[k] * nr;
  PetscCall(ContactCouplingAdd(t, column, mass_inverse, scale, t->mat));
  PetscCall(PetscFree(column));
  PetscCall(MatAssemblyBegin(t->mat, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(t->mat, MAT_FINAL_ASSEMBLY));
  PetscCall(KSPSetOperators(t->ksp, t->mat, t->mat));
  PetscCall(KSPSetUp(t->ksp));
  PetscCall(factor_blocks(t->ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- all ---- */

PetscErrorCode ContactCouplingCreateSystems(ContactCoupling t)
{
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(ContactCouplingComm(t), &size));
  PetscCall(create_iteration(t, &t->ksp, &t->asked));
  PetscCall(PetscMalloc3(size, &t->length, size, &t->begin, ConstraintGetView(t->constraint)->count, &t->index));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCouplingForgetSystems(ContactCoupling t)
{
  PetscFunctionBeginUser;
  PetscCall(KSPReset(t->ksp));
  PetscCall(MatDestroy(&t->mat));
  PetscCall(VecDestroy(&t->b));
  PetscCall(VecDestroy(&t->x));
  PetscCall(forget_system(&t->closed));
  PetscCall(forget_system(&t->open));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCouplingDestroySystems(ContactCoupling t)
{
  PetscFunctionBeginUser;
  PetscCall(ContactCouplingForgetSystems(t));
  PetscCall(KSPDestroy(&t->ksp));
  PetscCall(KSPDestroy(&t->closed.ksp));
  PetscCall(KSPDestroy(&t->open.ksp));
  PetscCall(PetscFree3(t->length, t->begin, t->index));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCouplingUpdateSystems(ContactCoupling t, const PetscReal mass_inverse[], PetscReal scale)
{
  const PetscInt nr = ConstraintGetView(t->constraint)->nr;

  PetscFunctionBeginUser;
  if (t->iterated) PetscCall(update_iteration(t, mass_inverse, scale));
  else {
    PetscCall(update_closed(t, mass_inverse, scale));
    if (t->open.n > 0) PetscCall(update_open(t, mass_inverse, scale));
  }
  for (PetscInt i = 0; i < t->ncoupled; i++)
    DenseFactor(nr, mass_inverse + ConstraintGetView(t->constraint)->own[t->coupled[i]] * nr * nr,
                t->factor + i * nr * nr);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own bodies of a system: slots to its right-hand side, or (back) its solution to slots */
static PetscErrorCode move_slots(ContactCoupling t, SpringSystem *s, PetscBool back, PetscReal slots[])
{
  const PetscInt  nr   = ConstraintGetView(t->constraint)->nr;
  const PetscBool open = (PetscBool)(s == &t->open);
  PetscReal      *v;

  PetscFunctionBeginUser;
  PetscCall(VecGetArray(back ? s->x : s->b, &v));
  for (PetscInt i = 0; i < t->ncoupled; i++) {
    PetscReal *slot = slots + t->coupled[i] * nr, *at = v + (open ? -2 - t->index[i] : t->index[i]) * nr;

    if ((t->index[i] < 0) == open) PetscCall(PetscArraycpy(back ? slot : at, back ? at : slot, nr));
  }
  PetscCall(VecRestoreArray(back ? s->x : s->b, &v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode solve_system(ContactCoupling t, SpringSystem *s, PetscReal slots[])
{
  PetscFunctionBeginUser;
  PetscCall(KSPSolve(s->ksp, s->b, s->x));
  PetscCall(move_slots(t, s, PETSC_TRUE, slots));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode solve_closed(ContactCoupling t, PetscReal slots[])
{
  PetscFunctionBeginUser;
  if (t->closed.n == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(move_slots(t, &t->closed, PETSC_FALSE, slots));
  PetscCall(solve_system(t, &t->closed, slots));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCouplingSumBegin(ContactCoupling t, const PetscReal partial[])
{
  const ConstraintView *c = ConstraintGetView(t->constraint);
  PetscReal            *b;
  PetscMPIInt           n;

  PetscFunctionBeginUser;
  t->sum_request = MPI_REQUEST_NULL;
  if (t->open.n == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMPIIntCast(t->open.n * c->nr, &n));
  PetscCall(VecGetArrayWrite(t->open.b, &b));
  PetscCall(PetscArrayzero(b, n));
  for (PetscInt l = 0; l < c->nlocal; l++) {
    const PetscInt number = t->number[c->local_list[l]];

    if (number <= -2) PetscCall(PetscArraycpy(b + (-2 - number) * c->nr, partial + l * c->nr, c->nr));
  }
  PetscCallMPI(MPI_Iallreduce(MPI_IN_PLACE, b, n, MPIU_REAL, MPIU_SUM, c->comm, &t->sum_request));
  PetscCall(VecRestoreArrayWrite(t->open.b, &b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCouplingSumEnd(ContactCoupling t, PetscReal slots[])
{
  PetscFunctionBeginUser;
  PetscCall(solve_closed(t, slots));
  PetscCallMPI(MPI_Wait(&t->sum_request, MPI_STATUS_IGNORE));
  if (t->open.n > 0) PetscCall(solve_system(t, &t->open, slots));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCouplingSolveSystems(ContactCoupling t, PetscReal slots[])
{
  const PetscInt   nr = ConstraintGetView(t->constraint)->nr;
  PetscReal       *b;
  const PetscReal *x;

  PetscFunctionBeginUser;
  if (!t->iterated) {
    PetscCall(solve_closed(t, slots));
    if (t->open.n == 0) PetscFunctionReturn(PETSC_SUCCESS);
    PetscCall(move_slots(t, &t->open, PETSC_FALSE, slots));
    PetscCall(VecGetArray(t->open.b, &b));
    PetscCallMPI(
      MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, b, t->length, t->begin, MPIU_REAL, ContactCouplingComm(t)));
    PetscCall(VecRestoreArray(t->open.b, &b));
    PetscCall(solve_system(t, &t->open, slots));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(VecGetArrayWrite(t->b, &b));
  for (PetscInt i = 0; i < t->ncoupled; i++) PetscCall(PetscArraycpy(b + i * nr, slots + t->coupled[i] * nr, nr));
  PetscCall(VecRestoreArrayWrite(t->b, &b));
  PetscCall(KSPSolve(t->ksp, t->b, t->x));
  PetscCall(VecGetArrayRead(t->x, &x));
  for (PetscInt i = 0; i < t->ncoupled; i++) PetscCall(PetscArraycpy(slots + t->coupled[i] * nr, x + i * nr, nr));
  PetscCall(VecRestoreArrayRead(t->x, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}
