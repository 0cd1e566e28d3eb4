/* Ties: see ties.h. Every tie is on one rank, that of the slots of its first body that may move. */
#include "compat.h"
#include "ties.h"
#include "base/algebra.h"
#include "base/room.h"

#define AS_EXACT 1e-3 /* tolerance of solves on several ranks, which stand for factors in preconditioners */

struct _p_Ties {
  Constraint constraint;
  PetscInt   n, room;
  PetscBool  any;
  BodyTie   *tie;                 /* [n] of this rank; rows without known degrees of freedom */
  PetscInt  *number;              /* [nbodies] of a body among the tied ones of all ranks, -1: it is none */
  PetscInt   ntied, *tied, first; /* own tied bodies, of which are in which own slots; number of the first */
  PetscInt   nblock;              /* largest number of blocks in a row */
  PetscReal *factor;              /* [ntied][nr][nr] L of the own ones */
  PetscReal *sum;                 /* [count][1 + nr^2] of own bodies: number of ties, what they add to the block */
  PetscReal *slots;               /* [count][nr] work */
  Mat        mat;                 /* of the masses */
  KSP        ksp;
  Vec        b, x;
};

/* By factors; on several ranks the ties of a rank's own bodies so, and those across ranks by CG with one reduction an
   iteration */
static PetscErrorCode create_solver(KSP *ksp)
{
  PC          pc;
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  PetscCall(KSPCreate(PETSC_COMM_WORLD, ksp));
  PetscCall(KSPSetOptionsPrefix(*ksp, "flow_ties_"));
  PetscCall(KSPGetPC(*ksp, &pc));
  PetscCall(PCSetType(pc, size == 1 ? PCLU : PCBJACOBI));
  PetscCall(KSPSetType(*ksp, size == 1 ? KSPPREONLY : KSPCG));
  if (size > 1) PetscCall(KSPSetNormType(*ksp, KSP_NORM_NATURAL));
  if (size > 1) PetscCall(KSPCGUseSingleReduction(*ksp, PETSC_TRUE));
  PetscCall(KSPSetTolerances(*ksp, AS_EXACT, 0, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPSetFromOptions(*ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TiesCreate(Constraint constraint, Ties *ties)
{
  Ties t;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&t));
  t->constraint = constraint;
  PetscCall(PetscMalloc5(constraint->room, &t->number, constraint->count, &t->tied, constraint->count * constraint->nr * constraint->nr, &t->factor,
                         constraint->count * (1 + constraint->nr * constraint->nr), &t->sum, constraint->count * constraint->nr, &t->slots));
  PetscCall(create_solver(&t->ksp));
  *ties = t;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode forget_system(Ties t)
{
  PetscFunctionBeginUser;
  PetscCall(KSPReset(t->ksp));
  PetscCall(MatDestroy(&t->mat));
  PetscCall(VecDestroy(&t->b));
  PetscCall(VecDestroy(&t->x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TiesDestroy(Ties *ties)
{
  PetscFunctionBeginUser;
  if (!*ties) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(forget_system(*ties));
  PetscCall(KSPDestroy(&(*ties)->ksp));
  PetscCall(PetscFree((*ties)->tie));
  PetscCall(PetscFree5((*ties)->number, (*ties)->tied, (*ties)->factor, (*ties)->sum, (*ties)->slots));
  PetscCall(PetscFree(*ties));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool TiesAny(Ties t)
{
  return t->any;
}

/* ---- which ones ---- */

/* Is the tie this rank's? */
static PetscBool is_mine(Constraint c, PetscMPIInt rank, const BodyTie *tie)
{
  for (PetscInt s = 0; s < 2; s++) {
    const PetscInt k = tie->body[s];

    if (k >= 0 && c->unknown[k]) return (PetscBool)(c->local_index[k] >= 0 && c->local_slot[c->local_index[k]] / c->count == rank);
  }
  return PETSC_FALSE;
}

static void mask_rows(Constraint c, BodyTie *tie)
{
  for (PetscInt s = 0; s < 2; s++)
    for (PetscInt i = 0; i < c->nr; i++)
      if (tie->body[s] < 0 || !((c->unknown[tie->body[s]] >> i) & 1)) tie->row[s][i] = 0;
}

/* What the ties of a body come to, summed over ranks, and numbers of the tied bodies, by ranks */
static PetscErrorCode number_bodies(Ties t)
{
  Constraint     c  = t->constraint;
  const PetscInt nr = c->nr, width = 1 + nr * nr;
  PetscReal     *value, *own, most = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(c->nbodies * width, &value, c->count, &own));
  for (PetscInt i = 0; i < 2 * t->n; i++) {
    const BodyTie   *tie = &t->tie[i / 2];
    const PetscReal *row = tie->row[i % 2];
    const PetscInt   at  = tie->body[i % 2] * width;

    if (at < 0) continue;
    value[at]++;
    for (PetscInt e = 0; e < nr * nr; e++) value[at + 1 + e] += tie->stiffness * row[e / nr] * row[e % nr];
  }
  PetscCall(ConstraintSumRows(c, width, value, t->sum));
  t->ntied = 0;
  for (PetscInt i = 0; i < c->nown; i++) {
    most = PetscMax(most, t->sum[i * width]);
    if (t->sum[i * width] > 0 && c->unknown[c->own[i]]) t->tied[t->ntied++] = i;
    own[i] = -1;
  }
  t->nblock = (PetscInt)most + 1;
  t->first  = 0;
  PetscCallMPI(MPI_Exscan(&t->ntied, &t->first, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD));
  for (PetscInt i = 0; i < t->ntied; i++) own[t->tied[i]] = (PetscReal)(t->first + i);
  for (PetscInt k = 0; k < c->nbodies; k++) value[k] = -1;
  PetscCall(ConstraintCopyRows(c, 1, own, value));
  for (PetscInt k = 0; k < c->nbodies; k++) t->number[k] = (PetscInt)value[k];
  PetscCall(PetscFree2(value, own));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TiesSet(Ties t, PetscInt n, const BodyTie tie[])
{
  Constraint  c = t->constraint;
  PetscMPIInt rank;

  PetscFunctionBeginUser;
  PetscCall(forget_system(t));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  t->n = 0;
  PetscCall(RoomFor(n, &t->room, &t->tie, sizeof(*t->tie), NULL));
  for (PetscInt i = 0; i < n; i++) {
    if (tie[i].stiffness <= 0 || !is_mine(c, rank, &tie[i])) continue;
    t->tie[t->n] = tie[i];
    mask_rows(c, &t->tie[t->n++]);
  }
  t->any = (PetscBool)(t->n > 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &t->any, 1, COMPAT_MPI_BOOL, MPI_LOR, PETSC_COMM_WORLD));
  if (t->any) PetscCall(number_bodies(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- products ---- */

void TiesMultAdd(Ties t, PetscBool others, PetscReal scale, const PetscReal U[], PetscReal out[])
{
  const Constraint c  = t->constraint;
  const PetscInt   nr = c->nr;

  for (PetscInt i = 0; i < t->n; i++) {
    const BodyTie *tie      = &t->tie[i];
    PetscReal      speed[2] = {0, 0};
    PetscInt       local[2] = {-1, -1};

    for (PetscInt s = 0; s < 2; s++) {
      if (tie->body[s] < 0 || !c->unknown[tie->body[s]]) continue;
      local[s] = c->local_index[tie->body[s]] * nr;
      for (PetscInt a = 0; a < nr; a++) speed[s] += tie->row[s][a] * U[local[s] + a];
    }
    for (PetscInt s = 0; s < 2; s++)
      for (PetscInt a = 0; a < nr && local[s] >= 0; a++)
        out[local[s] + a] += scale * tie->stiffness * (speed[!s] + (others ? 0 : speed[s])) * tie->row[s][a];
  }
}

/* y = L x, or L^T x */
static void times_factor(PetscInt nr, const PetscReal L[], PetscBool transposed, const PetscReal x[], PetscReal y[])
{
  for (PetscInt a = 0; a < nr; a++) {
    y[a] = 0;
    for (PetscInt b = 0; b < nr; b++) y[a] += L[transposed ? b * nr + a : a * nr + b] * x[b];
  }
}

/* out = L^T row of body k, with L of mass_inverse [nbodies][nr][nr]; NULL: the row in the units of its slots */
static void transform_row(Constraint c, const PetscReal mass_inverse[], PetscInt k, const PetscReal row[], PetscReal out[])
{
  const PetscInt nr = c->nr;
  PetscReal      L[36];

  if (mass_inverse) {
    DenseFactor(nr, mass_inverse + k * nr * nr, L);
    times_factor(nr, L, PETSC_TRUE, row, out);
  } else {
    for (PetscInt a = 0; a < nr; a++) out[a] = row[a] * ConstraintSlotUnit(c, k, a);
  }
}

/* mat += ties/scale, at the columns of bodies [nbodies], with rows as transform_row makes them */
static PetscErrorCode add_ties(Ties t, const PetscInt column[], const PetscReal mass_inverse[], PetscReal scale, Mat mat)
{
  const Constraint c  = t->constraint;
  const PetscInt   nr = c->nr;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < t->n; i++) {
    const BodyTie *tie = &t->tie[i];
    PetscReal      row[2][6], block[144];
    PetscInt       at[12], n = 0;

    for (PetscInt s = 0; s < 2; s++) {
      if (tie->body[s] < 0 || !c->unknown[tie->body[s]]) continue;
      transform_row(c, mass_inverse, tie->body[s], tie->row[s], row[n / nr]);
      for (PetscInt a = 0; a < nr; a++) at[n + a] = column[tie->body[s]] + a;
      n += nr;
    }
    for (PetscInt e = 0; e < n * n; e++) block[e] = tie->stiffness / scale * row[e / n / nr][e / n % nr] * row[e % n / nr][e % n % nr];
    PetscCall(MatSetValues(mat, n, at, n, at, block, ADD_VALUES));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TiesCreateMat(Ties t, Mat *mat)
{
  Constraint c = t->constraint;
  PetscInt   total, *column;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetSizes(c, NULL, &total));
  PetscCall(PetscMalloc1(c->nbodies, &column));
  PetscCall(ConstraintGetRigidColumns(c, column));
  PetscCall(MatCreateAIJ(PETSC_COMM_WORLD, total, total, PETSC_DETERMINE, PETSC_DETERMINE, c->nr, NULL, c->nr, NULL, mat));
  PetscCall(MatSetOption(*mat, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
  PetscCall(add_ties(t, column, NULL, 1, *mat));
  PetscCall(MatAssemblyBegin(*mat, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*mat, MAT_FINAL_ASSEMBLY));
  PetscCall(PetscFree(column));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the blocks of bodies ---- */

/* The block of an own body with what the ties add to it; identity where it is known */
static void get_block(Constraint c, PetscInt k, const PetscReal inverse[], const PetscReal added[], PetscReal block[])
{
  PetscReal M[36];

  for (PetscInt e = 0; e < c->nr * c->nr; e++) {
    const PetscInt i = e / c->nr, j = e % c->nr;

    M[e] = (c->unknown[k] >> i) & 1 && (c->unknown[k] >> j) & 1 ? inverse[e] : (PetscReal)(i == j);
  }
  DenseInvert(c->nr, M, block);
  for (PetscInt e = 0; e < c->nr * c->nr; e++) block[e] += added[e];
}

static void stiffen_blocks(Ties t, PetscReal inverse[])
{
  Constraint     c  = t->constraint;
  const PetscInt nr = c->nr, nn = nr * nr;

  for (PetscInt i = 0; i < t->ntied; i++) {
    const PetscInt at = t->tied[i], k = c->own[at];
    PetscReal      block[36], with[36];

    get_block(c, k, inverse + at * nn, t->sum + at * (1 + nn) + 1, block);
    DenseInvert(nr, block, with);
    for (PetscInt e = 0; e < nn; e++)
      if ((c->unknown[k] >> e / nr) & 1 && (c->unknown[k] >> e % nr) & 1) inverse[at * nn + e] = with[e];
  }
}

/* ---- the system of masses ---- */

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
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update_masses(Ties t, const PetscReal mass_inverse[], PetscReal scale)
{
  Constraint     c  = t->constraint;
  const PetscInt nr = c->nr, n = t->ntied * nr, most = t->nblock * nr;
  PetscInt      *column;

  PetscFunctionBeginUser;
  PetscCall(MatCreateAIJ(PETSC_COMM_WORLD, n, n, PETSC_DETERMINE, PETSC_DETERMINE, most, NULL, most, NULL, &t->mat));
  PetscCall(MatSetOption(t->mat, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
  PetscCall(MatCreateVecs(t->mat, &t->x, &t->b));
  for (PetscInt row = t->first * nr; row < t->first * nr + n; row++) PetscCall(MatSetValue(t->mat, row, row, 1, ADD_VALUES));
  PetscCall(PetscMalloc1(c->nbodies, &column));
  for (PetscInt k = 0; k < c->nbodies; k++) column[k] = t->number[k] * nr;
  PetscCall(add_ties(t, column, mass_inverse, scale, t->mat));
  PetscCall(PetscFree(column));
  PetscCall(MatAssemblyBegin(t->mat, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(t->mat, MAT_FINAL_ASSEMBLY));
  PetscCall(KSPSetOperators(t->ksp, t->mat, t->mat));
  PetscCall(KSPSetUp(t->ksp));
  PetscCall(factor_blocks(t->ksp));
  for (PetscInt i = 0; i < t->ntied; i++) DenseFactor(nr, mass_inverse + c->own[t->tied[i]] * nr * nr, t->factor + i * nr * nr);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TiesUpdate(Ties t, PetscReal inverse[], const PetscReal mass_inverse[], PetscReal scale)
{
  PetscFunctionBeginUser;
  if (!t->any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(forget_system(t));
  stiffen_blocks(t, inverse);
  PetscCall(update_masses(t, mass_inverse, scale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Q of tied own bodies, in place in their slots [count][nr] */
static PetscErrorCode solve_masses(Ties t, PetscReal slots[])
{
  const PetscInt   nr = t->constraint->nr;
  PetscReal       *b;
  const PetscReal *x;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayWrite(t->b, &b));
  for (PetscInt i = 0; i < t->ntied; i++) PetscCall(PetscArraycpy(b + i * nr, slots + t->tied[i] * nr, nr));
  PetscCall(VecRestoreArrayWrite(t->b, &b));
  PetscCall(KSPSolve(t->ksp, t->b, t->x));
  PetscCall(VecGetArrayRead(t->x, &x));
  for (PetscInt i = 0; i < t->ntied; i++) PetscCall(PetscArraycpy(slots + t->tied[i] * nr, x + i * nr, nr));
  PetscCall(VecRestoreArrayRead(t->x, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TiesSolveMass(Ties t, const PetscReal x[], PetscReal y[])
{
  const Constraint c  = t->constraint;
  const PetscInt   nr = c->nr;

  PetscFunctionBeginUser;
  if (!t->any) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < t->ntied; i++) {
    PetscReal force[6];

    for (PetscInt a = 0; a < nr; a++) force[a] = x[t->tied[i] * nr + a] / ConstraintSlotUnit(c, c->own[t->tied[i]], a);
    times_factor(nr, t->factor + i * nr * nr, PETSC_TRUE, force, t->slots + t->tied[i] * nr);
  }
  PetscCall(solve_masses(t, t->slots));
  for (PetscInt i = 0; i < t->ntied; i++) {
    PetscReal *u = y + t->tied[i] * nr;

    times_factor(nr, t->factor + i * nr * nr, PETSC_FALSE, t->slots + t->tied[i] * nr, u);
    for (PetscInt a = 0; a < nr; a++) u[a] /= ConstraintSlotUnit(c, c->own[t->tied[i]], a);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TiesFilter(Ties t, PetscReal z[])
{
  Constraint     c  = t->constraint;
  const PetscInt nr = c->nr;

  PetscFunctionBeginUser;
  if (!t->any) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < t->ntied; i++) PetscCall(PetscArraycpy(t->slots + t->tied[i] * nr, z + c->local_index[c->own[t->tied[i]]] * nr, nr));
  PetscCall(solve_masses(t, t->slots));
  PetscCall(PetscSFBcastBegin(c->rigid_sf, c->rigid_type, t->slots, c->packed, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(c->rigid_sf, c->rigid_type, t->slots, c->packed, MPI_REPLACE));
  for (PetscInt l = 0; l < c->nlocal; l++)
    if (t->number[c->local_list[l]] >= 0) PetscCall(PetscArraycpy(z + l * nr, c->packed + l * nr, nr));
  PetscFunctionReturn(PETSC_SUCCESS);
}
