/* Contact, bonds of bodies without a flow: their forces over a sub-step h, solved for together. With W the inverse
   masses of the bodies, W = L L^T, and U* what all other forces make of their velocities, U = U* + L y, where

     (1 + h sum rate (L^T r) (L^T r)^T) y = h sum (L^T r) (value - rate r.U*),

   r the rows of the modes. Symmetric, definite, and well for bodies that are held in part (L has zeros there). Up
   to MANY bodies every rank factorises the system of all bonded ones, from the same numbers in the same order: the same
   bits on any number of ranks. Beyond it is spread and solved by iterations (bondsolve.c). Bodies move by the new
   velocities, which is leap-frog: a bond that the sub-step resolves counts h/4 of the change of speed ahead (Newmark's
   beta = 1/4), so that it keeps its energy and is stable; momentum and angular momentum are kept to round-off. */
#include "compat.h"
#include "bondalone.h"
#include "base/array.h"
#include "base/log.h"
#include "base/pivots.h"
#include "base/rigid.h"
#include "base/sparse.h"
#include "bodies/local.h"
#include <petscksp.h>

#define MANY 2000 /* bodies from which on iterations solve the system */

PetscErrorCode BondBeginAlone(Contact c, PetscReal h)
{
  const BondRule rule = {.h = h, .next = 0.25 * h, .before = -0.25 * h, .end = h, .damped = 1};

  PetscFunctionBeginUser;
  PetscCall(BondList(c));
  PetscCall(ContactSetInertias(c));
  for (PetscInt e = 0; e < c->bonds->n; e++) {
    Bond *b = &c->bonds->bond[e];

    for (PetscInt side = 0; side < (b->j >= 0 ? 2 : 1); side++) {
      const PetscInt k = side ? b->j : b->i;

      PetscCheck(!ContactPivots(c, k), PETSC_COMM_SELF, PETSC_ERR_SUP,
                 "Group '%s' has a pivot, and a bond: remove -particle_%s_pivot, or give a flow",
                 BodiesGetGroup(c->state, k)->name, BodiesGetGroup(c->state, k)->name);
    }
    PetscCall(BondMakeSprings(c, &rule, b));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

void BondFreeVelocity(Contact c, PetscInt k, PetscReal h, PetscReal v[6])
{
  PetscReal dw[3];

  ContactSpin(c, k, c->at_once.torque[k], dw);
  for (PetscInt a = 0; a < 3; a++) {
    v[a]     = c->u[k][a] + h * ContactKind(c, k)->inverse_mass[a] * c->at_once.force[k][a];
    v[3 + a] = c->w[k][a] + h * dw[a];
  }
  BodiesKeepAxes(c->state, k, v, v + 3);
}

void BondGetRoot(Contact c, PetscInt k, BodyRoot *root)
{
  const Kind *kind = ContactKind(c, k);
  PetscReal   M[9] = {0};

  for (PetscInt a = 0; a < 3; a++) root->move[a] = PetscSqrtReal(kind->inverse_mass[a]);
  if (c->dim == 2) {
    root->turn[0] = PetscSqrtReal(kind->inverse_moment);
    return;
  }
  for (PetscInt a = 0; a < 3; a++) M[4 * a] = c->inverse_inertia[k][a];
  M[1] = M[3] = c->inverse_inertia[k][3];
  M[2] = M[6] = c->inverse_inertia[k][4];
  M[5] = M[7] = c->inverse_inertia[k][5];
  DenseFactor(3, M, root->turn);
}

void BondApplyRoot(PetscInt dim, const BodyRoot *root, const PetscReal y[], PetscReal v[6])
{
  const PetscReal *L = root->turn;

  for (PetscInt a = 0; a < dim; a++) v[a] = root->move[a] * y[a];
  if (dim == 2) {
    v[2] = v[3] = v[4] = 0;
    v[5]               = L[0] * y[2];
    return;
  }
  v[3] = L[0] * y[3];
  v[4] = L[3] * y[3] + L[4] * y[4];
  v[5] = L[6] * y[3] + L[7] * y[4] + L[8] * y[5];
}

void BondApplyRootTransposed(PetscInt dim, const BodyRoot *root, const PetscReal f[6], PetscReal y[])
{
  const PetscReal *L = root->turn;

  for (PetscInt a = 0; a < dim; a++) y[a] = root->move[a] * f[a];
  if (dim == 2) {
    y[2] = L[0] * f[5];
    return;
  }
  y[3] = L[0] * f[3] + L[3] * f[4] + L[6] * f[5];
  y[4] = L[4] * f[4] + L[7] * f[5];
  y[5] = L[8] * f[5];
}

/* wall: speed of the wall */
static void make_spring(Contact c, const Bond *b, PetscInt mode, PetscReal h, PetscReal (*v)[6], const BodyRoot root[],
                        PetscReal wall, AloneSpring *t)
{
  Impulse unit;

  BondGetImpulse(b, mode, 1, &unit);
  *t = (AloneSpring){.body  = {c->s->number[b->i], b->j >= 0 ? c->s->number[b->j] : -1},
                     .index = {b->i, b->j},
                     .order = {b->j >= 0 ? c->s->number[b->j] : b->j, mode},
                     .rate  = h * b->rate[mode],
                     .free  = wall};
  for (PetscInt side = 0; side < (b->j >= 0 ? 2 : 1); side++) {
    const PetscInt k = side ? b->j : b->i;
    PetscReal      r[6];

    for (PetscInt a = 0; a < 3; a++) {
      r[a]     = side ? -unit.f[a] : unit.f[a];
      r[3 + a] = side ? unit.tj[a] : unit.ti[a];
    }
    for (PetscInt a = 0; a < 6; a++) t->free -= r[a] * v[k][a];
    BondApplyRootTransposed(c->dim, &root[k], r, t->row[side]);
  }
  t->load = h * (b->value[mode] + b->rate[mode] * t->free);
}

PetscErrorCode BondMakeAloneSprings(Contact c, const Bond *b, PetscReal h, PetscReal (*v)[6], const BodyRoot root[],
                                    AloneSpring t[])
{
  PetscReal wall[BOND_MODES];

  PetscFunctionBeginUser;
  PetscCall(BondGetWallSpeeds(c, b, wall));
  for (PetscInt m = 0; m < b->n; m++) make_spring(c, b, m, h, v, root, wall[m], &t[m]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int compare_springs(const void *a, const void *b)
{
  const AloneSpring *p = (const AloneSpring *)a, *q = (const AloneSpring *)b;

  if (p->body[0] != q->body[0]) return p->body[0] < q->body[0] ? -1 : 1;
  if (p->order[0] != q->order[0]) return p->order[0] < q->order[0] ? -1 : 1;
  return p->order[1] < q->order[1] ? -1 : p->order[1] > q->order[1];
}

/* The places of the bonded bodies, by their numbers */
static PetscErrorCode place_bodies(PetscInt n, AloneSpring spring[], PetscInt *nbodies)
{
  PetscInt *number;

  PetscFunctionBeginUser;
  *nbodies = 0;
  PetscCall(PetscMalloc1(2 * n + 1, &number));
  for (PetscInt e = 0; e < 2 * n; e++)
    if (spring[e / 2].body[e % 2] >= 0) number[(*nbodies)++] = spring[e / 2].body[e % 2];
  PetscCall(PetscSortRemoveDupsInt(nbodies, number));
  for (PetscInt e = 0; e < 2 * n; e++)
    if (spring[e / 2].body[e % 2] >= 0)
      PetscCall(PetscFindInt(spring[e / 2].body[e % 2], *nbodies, number, &spring[e / 2].index[e % 2]));
  PetscCall(PetscFree(number));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode assemble(PetscInt n, const AloneSpring spring[], PetscInt nr, PetscInt nbodies, Mat A, Vec b)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < nr * nbodies; i++) PetscCall(MatSetValue(A, i, i, 1, ADD_VALUES));
  for (PetscInt e = 0; e < n; e++) {
    PetscReal row[12], block[144], load[12];
    PetscInt  at[12], m = 0;

    for (PetscInt s = 0; s < 2; s++)
      for (PetscInt a = 0; a < nr && spring[e].body[s] >= 0; a++) {
        row[m]  = spring[e].row[s][a];
        at[m++] = spring[e].index[s] * nr + a;
      }
    for (PetscInt i = 0; i < m * m; i++) block[i] = spring[e].rate * row[i / m] * row[i % m];
    for (PetscInt i = 0; i < m; i++) load[i] = spring[e].load * row[i];
    PetscCall(MatSetValues(A, m, at, m, at, block, ADD_VALUES));
    PetscCall(VecSetValues(b, m, at, load, ADD_VALUES));
  }
  PetscCall(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  PetscCall(VecAssemblyBegin(b));
  PetscCall(VecAssemblyEnd(b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y [nbodies][nr], the caller's to free */
static PetscErrorCode solve_springs(PetscInt n, const AloneSpring spring[], PetscInt nr, PetscInt nbodies,
                                    PetscReal *y[])
{
  const PetscInt   rows = nr * nbodies;
  PetscInt        *near;
  Mat              A;
  Vec              b, x;
  KSP              ksp;
  PC               pc;
  const PetscReal *v;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(rows, &near));
  for (PetscInt i = 0; i < rows; i++) near[i] = nr;
  for (PetscInt e = 0; e < n; e++)
    for (PetscInt i = 0; i < 2 * nr && spring[e].order[1] == 0; i++)
      if (spring[e].body[i / nr] >= 0) near[spring[e].index[i / nr] * nr + i % nr] += nr;
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, rows, rows, 0, near, &A));
  PetscCall(PetscFree(near));
  PetscCall(MatCreateVecs(A, &x, &b));
  PetscCall(assemble(n, spring, nr, nbodies, A, b));
  PetscCall(KSPCreate(PETSC_COMM_SELF, &ksp));
  PetscCall(KSPSetType(ksp, KSPPREONLY));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCLU));
  PetscCall(PivotsOfAnySize(ksp));
  PetscCall(KSPSetOperators(ksp, A, A));
  PetscCall(KSPSolve(ksp, b, x));
  PetscCall(PetscMalloc1(rows, y));
  PetscCall(VecGetArrayRead(x, &v));
  PetscCall(PetscArraycpy(*y, v, rows));
  PetscCall(VecRestoreArrayRead(x, &v));
  PetscCall(KSPDestroy(&ksp));
  PetscCall(MatDestroy(&A));
  PetscCall(VecDestroy(&x));
  PetscCall(VecDestroy(&b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Forces of a mode that parts at this speed in the end */
static void take_speed(Contact c, Bond *bond, PetscInt mode, PetscReal speed)
{
  const Pair      pair = {bond->i, bond->j};
  const PetscReal pull = bond->value[mode] + bond->rate[mode] * speed;
  Impulse         sum;

  BondTake(bond, mode, speed, pull);
  BondGetImpulse(bond, mode, pull, &sum);
  ContactScatter(&pair, &sum, 1, c->at_once.force, c->at_once.torque);
}

/* Of the bonds that this rank lists, from the speeds [n] of the springs of all ranks */
static PetscErrorCode take_solution(Contact c, PetscInt n, const AloneSpring spring[], const PetscReal speed[])
{
  Bonds b = c->bonds;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < b->n; e++) {
    Bond *bond = &b->bond[e];

    for (PetscInt m = 0; m < bond->n; m++) {
      const PetscInt     partner = bond->j >= 0 ? c->s->number[bond->j] : bond->j;
      const AloneSpring  key     = {.body = {c->s->number[bond->i], -1}, .order = {partner, m}};
      const AloneSpring *t = (const AloneSpring *)bsearch(&key, spring, (size_t)n, sizeof(*spring), compare_springs);

      PetscCheck(t, PETSC_COMM_SELF, PETSC_ERR_PLIB, "A bond is missing among those of all ranks");
      take_speed(c, bond, m, speed[t - spring]);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* speed [n] at which the springs part in the end */
static PetscErrorCode find_speeds(Bonds b, PetscInt n, AloneSpring spring[], PetscInt nr, PetscReal speed[])
{
  PetscInt   nbodies;
  PetscReal *y;

  PetscFunctionBeginUser;
  PetscCall(place_bodies(n, spring, &nbodies));
  if (nbodies > MANY && !b->many) {
    b->many = PETSC_TRUE;
    PetscCall(
      LogRemark("the bonds of %" PetscInt_FMT
                " bodies without a flow are too stiff for iterations: every rank factorises the system of all of "
                "them in every sub-step. A shorter -sim_dt or softer bonds are cheaper",
                nbodies));
  }
  PetscCall(solve_springs(n, spring, nr, nbodies, &y));
  for (PetscInt e = 0; e < n; e++) {
    speed[e] = spring[e].free;
    for (PetscInt i = 0; i < 2 * nr; i++)
      if (spring[e].body[i / nr] >= 0)
        speed[e] -= spring[e].row[i / nr][i % nr] * y[spring[e].index[i / nr] * nr + i % nr];
  }
  PetscCall(PetscFree(y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode solve_at_once(Contact c, PetscReal h)
{
  Bonds        b = c->bonds;
  PetscInt     n = 0, own = 0;
  AloneSpring *mine, *spring;
  BodyRoot    *root;
  PetscReal   *speed, (*v)[6];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(BOND_MODES * b->n + 1, &mine, c->s->n, &v, c->s->n, &root));
  for (PetscInt k = 0; k < c->s->n && b->n; k++) {
    BondFreeVelocity(c, k, h, v[k]);
    BondGetRoot(c, k, &root[k]);
  }
  for (PetscInt e = 0; e < b->n; e++) {
    if (!c->s->own[b->bond[e].i]) continue;
    PetscCall(BondMakeAloneSprings(c, &b->bond[e], h, v, root, mine + own));
    own += b->bond[e].n;
  }
  PetscCall(SparseGather(BodiesComm(c->bodies), own, sizeof(*mine), mine, &n, &spring, NULL));
  PetscCall(PetscFree3(mine, v, root));
  qsort(spring, (size_t)n, sizeof(*spring), compare_springs);
  PetscCall(PetscMalloc1(n + 1, &speed));
  if (n) PetscCall(find_speeds(b, n, spring, RigidSize(c->dim), speed));
  PetscCall(take_solution(c, n, spring, speed));
  PetscCall(PetscFree(speed));
  PetscCall(PetscFree(spring));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondSolveAlone(Contact c, PetscReal h)
{
  PetscBool good = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->at_once.force));
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->at_once.torque));
  if (c->s->nall > MANY) PetscCall(BondSolveSpread(c, h, &good));
  if (!good) PetscCall(solve_at_once(c, h));
  PetscFunctionReturn(PETSC_SUCCESS);
}
