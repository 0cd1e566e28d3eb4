/* Contact, the system of many bonded bodies without a flow (bondalone.c), spread over the ranks as the bodies are:
   conjugate gradients, preconditioned by the factorised blocks of the bodies. Rows are summed up in the order of the
   bonds' carriers, scalar products exactly (base/exact.h): the same bits on any number of ranks. A block is that of a
   body among others at rest, so that the number of iterations goes by how far a force is felt within a step: by
   frequency times step, and at most by the length of the aggregate. Whatever is left over changes pulls, which act on
   both bodies alike: momentum is kept to round-off all the same. */
#include "compat.h"
#include "bondalone.h"
#include "base/algebra.h"
#include "base/exact.h"
#include "base/rigid.h"
#include "bodies/local.h"

#define ITERATIONS 5000
#define TOLERANCE  1e-10 /* of the residual, in the norm of the preconditioner */

typedef struct {
  Contact   c;
  PetscInt  nr, nown, *own;                     /* own: bonded bodies of this rank */
  PetscReal h, *factor;                         /* [bodies][nr][nr] block of the matrix, factorised */
  BodyRoot *root;                               /* [bodies] */
  PetscReal (*x)[6], (*r)[6], (*z)[6], (*p)[6]; /* [bodies]; z: A p, and the residual with the preconditioner */
  PetscReal (*v)[6], (*f)[6];                   /* [bodies] velocities, forces */
} Spread;

/* ---- products ---- */

/* How the ends of a bond part by the velocities v: motion in the middle between them, and turn */
static inline void find_parting(const Bond *b, PetscReal (*v)[6], PetscReal motion[3], PetscReal turn[3])
{
  const PetscReal *i = v[b->i], *li = b->frame.lever[0], *lj = b->frame.lever[1];

  motion[0] = -(i[0] + i[4] * li[2] - i[5] * li[1]);
  motion[1] = -(i[1] + i[5] * li[0] - i[3] * li[2]);
  motion[2] = -(i[2] + i[3] * li[1] - i[4] * li[0]);
  for (PetscInt a = 0; a < 3; a++) turn[a] = -i[3 + a];
  if (b->j < 0) return;
  i = v[b->j];
  motion[0] += i[0] + i[4] * lj[2] - i[5] * lj[1];
  motion[1] += i[1] + i[5] * lj[0] - i[3] * lj[2];
  motion[2] += i[2] + i[3] * lj[1] - i[4] * lj[0];
  for (PetscInt a = 0; a < 3; a++) turn[a] += i[3 + a];
}

/* The force F at the end of a body with this lever, and the couple T; side: its sign */
static inline void pull_end(const PetscReal F[3], const PetscReal T[3], const PetscReal lever[3], PetscReal side,
                            PetscReal f[6])
{
  for (PetscInt a = 0; a < 3; a++) f[a] += side * F[a];
  f[3] += side * (lever[1] * F[2] - lever[2] * F[1] + T[0]);
  f[4] += side * (lever[2] * F[0] - lever[0] * F[2] + T[1]);
  f[5] += side * (lever[0] * F[1] - lever[1] * F[0] + T[2]);
}

/* f = sum of r rate r.v over the modes of all bonds; dim: a constant of the call, so that loops are unrolled */
static inline void add_pulls(Spread *s, PetscInt dim)
{
  const struct _p_Bonds *bonds = s->c->bonds;

  for (PetscInt e = 0; e < bonds->n; e++) {
    const Bond *b = &bonds->bond[e];
    PetscReal   motion[3], turn[3], F[3] = {0, 0, 0}, T[3] = {0, 0, 0};

    find_parting(b, s->v, motion, turn);
    for (PetscInt m = 0; m < dim; m++) {
      const PetscReal *n = b->frame.axis[m], pull = b->rate[m] * dot3(n, motion);

      for (PetscInt a = 0; a < 3; a++) F[a] += pull * n[a];
    }
    for (PetscInt m = dim == 2 ? 2 : 0; m < 3; m++) {
      const PetscReal *n = b->frame.axis[m], pull = b->rate[dim == 2 ? 2 : 3 + m] * dot3(n, turn);

      for (PetscInt a = 0; a < 3; a++) T[a] += pull * n[a];
    }
    pull_end(F, T, b->frame.lever[0], -1, s->f[b->i]);
    if (b->j >= 0) pull_end(F, T, b->frame.lever[1], 1, s->f[b->j]);
  }
}

/* z = A p, of own bodies */
static PetscErrorCode multiply(Spread *s)
{
  const PetscInt dim = s->c->dim;

  PetscFunctionBeginUser;
  PetscCall(BodiesUpdateGhosts(s->c->bodies, 6, s->p));
  for (PetscInt k = 0; k < s->c->s->n; k++) BondApplyRoot(dim, &s->root[k], s->p[k], s->v[k]);
  PetscCall(PetscArrayzero(s->f, s->c->s->n));
  if (dim == 2) add_pulls(s, 2);
  else add_pulls(s, 3);
  for (PetscInt i = 0; i < s->nown; i++) {
    const PetscInt k = s->own[i];

    BondApplyRootTransposed(dim, &s->root[k], s->f[k], s->z[k]);
    for (PetscInt a = 0; a < s->nr; a++) s->z[k][a] = s->p[k][a] + s->h * s->z[k][a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode dot(const Spread *s, PetscReal (*u)[6], PetscReal (*v)[6], PetscReal *sum)
{
  Exact e = {{0}, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->nown; i++) {
    PetscReal of_body = 0;

    for (PetscInt a = 0; a < s->nr; a++) of_body += u[s->own[i]][a] * v[s->own[i]][a];
    ExactAdd(&e, of_body);
  }
  PetscCall(ExactGetSum(BodiesComm(s->c->bodies), &e, sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* z = D^-1 r, from factors with the inverse of their diagonal; nr: a constant of the call */
static inline void solve_blocks(const Spread *s, PetscInt nr)
{
  for (PetscInt i = 0; i < s->nown; i++) {
    const PetscInt   k = s->own[i];
    const PetscReal *L = s->factor + k * nr * nr, *r = s->r[k];
    PetscReal        z[6];

    for (PetscInt a = 0; a < nr; a++) {
      z[a] = r[a];
      for (PetscInt b = 0; b < a; b++) z[a] -= L[a * nr + b] * z[b];
      z[a] *= L[a * nr + a];
    }
    for (PetscInt a = nr - 1; a >= 0; a--) {
      for (PetscInt b = a + 1; b < nr; b++) z[a] -= L[b * nr + a] * z[b];
      z[a] *= L[a * nr + a];
    }
    for (PetscInt a = 0; a < nr; a++) s->z[k][a] = z[a];
  }
}

static void precondition(const Spread *s)
{
  if (s->nr == 3) solve_blocks(s, 3);
  else solve_blocks(s, 6);
}

/* ---- the system ---- */

/* Of the n modes of a bond: lower triangles of blocks, right-hand side; nr: a constant of the call */
static inline void add_modes(Spread *s, PetscInt nr, const AloneSpring spring[])
{
  for (PetscInt side = 0; side < (spring->index[1] >= 0 ? 2 : 1); side++) {
    PetscReal *D = s->factor + spring->index[side] * nr * nr, *r = s->r[spring->index[side]];

    for (PetscInt m = 0; m < nr; m++) {
      const PetscReal *row = spring[m].row[side];

      for (PetscInt i = 0; i < nr; i++) r[i] += spring[m].load * row[i];
      for (PetscInt i = 0; i < nr; i++) {
        const PetscReal scaled = spring[m].rate * row[i];

        for (PetscInt j = 0; j <= i; j++) D[i * nr + j] += scaled * row[j];
      }
    }
  }
}

/* Factors of the blocks, right-hand side, list of own bonded bodies */
static PetscErrorCode set_up(Spread *s)
{
  const PetscInt nr = s->nr, n = s->c->s->n;
  Bonds          b = s->c->bonds;
  PetscBool     *bonded;
  PetscReal      block[36];
  AloneSpring    spring[BOND_MODES];

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(n, &bonded));
  for (PetscInt e = 0; e < b->n; e++) {
    bonded[b->bond[e].i] = PETSC_TRUE;
    if (b->bond[e].j >= 0) bonded[b->bond[e].j] = PETSC_TRUE;
  }
  for (PetscInt k = 0; k < n; k++) {
    if (!bonded[k]) continue;
    BondFreeVelocity(s->c, k, s->h, s->v[k]);
    BondGetRoot(s->c, k, &s->root[k]);
  }
  for (PetscInt e = 0; e < b->n; e++) {
    PetscCall(BondMakeAloneSprings(s->c, &b->bond[e], s->h, s->v, s->root, spring));
    if (nr == 3) add_modes(s, 3, spring);
    else add_modes(s, 6, spring);
  }
  for (PetscInt k = 0; k < n; k++) {
    PetscReal *D = s->factor + k * nr * nr;

    if (!bonded[k] || !s->c->s->own[k]) continue;
    s->own[s->nown++] = k;
    for (PetscInt i = 0; i < nr; i++)
      for (PetscInt j = 0; j <= i; j++) block[i * nr + j] = block[j * nr + i] = D[i * nr + j] + (i == j);
    DenseFactor(nr, block, D);
    for (PetscInt a = 0; a < nr; a++) D[a * nr + a] = 1 / D[a * nr + a];
  }
  PetscCall(PetscFree(bonded));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Forces of a bond whose ends part so in the end */
static void take_bond(Contact c, Bond *b, const PetscReal motion[3], const PetscReal turn[3], const PetscReal wall[])
{
  PetscReal F[3] = {0, 0, 0}, T[3] = {0, 0, 0};

  for (PetscInt m = 0; m < b->n; m++) {
    const PetscReal *n     = BondDirection(&b->frame, m);
    const PetscReal  speed = wall[m] + dot3(m < c->dim ? motion : turn, n), pull = b->value[m] + b->rate[m] * speed;

    BondTake(b, m, speed, pull);
    for (PetscInt a = 0; a < 3; a++) *(m < c->dim ? &F[a] : &T[a]) += pull * n[a];
  }
  for (PetscInt side = 0; side < (b->j >= 0 ? 2 : 1); side++) {
    const PetscInt k    = side ? b->j : b->i;
    PetscReal      f[6] = {0};

    pull_end(F, T, b->frame.lever[side], side ? -1 : 1, f);
    for (PetscInt a = 0; a < 3; a++) {
      c->at_once.force[k][a] += f[a];
      c->at_once.torque[k][a] += f[3 + a];
    }
  }
}

/* Forces, by the speeds at which the modes part in the end */
static PetscErrorCode take_solution(Spread *s)
{
  const PetscInt dim = s->c->dim;
  Bonds          b   = s->c->bonds;

  PetscFunctionBeginUser;
  PetscCall(BodiesUpdateGhosts(s->c->bodies, 6, s->x));
  for (PetscInt k = 0; k < s->c->s->n; k++) {
    PetscReal gained[6];

    BondFreeVelocity(s->c, k, s->h, s->v[k]);
    BondApplyRoot(dim, &s->root[k], s->x[k], gained);
    for (PetscInt a = 0; a < 6; a++) s->v[k][a] += gained[a];
  }
  for (PetscInt e = 0; e < b->n; e++) {
    Bond     *bond = &b->bond[e];
    PetscReal motion[3], turn[3], wall[BOND_MODES];

    find_parting(bond, s->v, motion, turn);
    PetscCall(BondGetWallSpeeds(s->c, bond, wall));
    take_bond(s->c, bond, motion, turn, wall);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* x from zero */
static PetscErrorCode iterate(Spread *s, PetscBool *good)
{
  PetscReal rho, first, curvature, next;

  PetscFunctionBeginUser;
  precondition(s);
  for (PetscInt i = 0; i < s->nown; i++) PetscCall(PetscArraycpy(s->p[s->own[i]], s->z[s->own[i]], s->nr));
  PetscCall(dot(s, s->r, s->z, &rho));
  first = rho;
  *good = (PetscBool)(rho <= 0);
  for (PetscInt it = 0; it < ITERATIONS && !*good; it++) {
    PetscCall(multiply(s));
    PetscCall(dot(s, s->p, s->z, &curvature));
    for (PetscInt i = 0; i < s->nown; i++)
      for (PetscInt a = 0; a < s->nr; a++) {
        const PetscInt k = s->own[i];

        s->x[k][a] += rho / curvature * s->p[k][a];
        s->r[k][a] -= rho / curvature * s->z[k][a];
      }
    precondition(s);
    PetscCall(dot(s, s->r, s->z, &next));
    *good = (PetscBool)(next <= PetscSqr(TOLERANCE) * first);
    for (PetscInt i = 0; i < s->nown; i++)
      for (PetscInt a = 0; a < s->nr; a++) s->p[s->own[i]][a] = s->z[s->own[i]][a] + next / rho * s->p[s->own[i]][a];
    rho = next;
    PetscCall(PetscLogFlops(150. * (PetscLogDouble)s->c->bonds->n));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondSolveSpread(Contact c, PetscReal h, PetscBool *good)
{
  const PetscInt n = c->s->n, nr = RigidSize(c->dim);
  Spread         s = {.c = c, .nr = nr, .h = h};

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc6(n, &s.x, n, &s.r, n, &s.z, n, &s.p, n, &s.v, n, &s.f));
  PetscCall(PetscCalloc3(n * nr * nr, &s.factor, n, &s.root, n, &s.own));
  PetscCall(set_up(&s));
  PetscCall(iterate(&s, good));
  if (*good) PetscCall(take_solution(&s));
  PetscCall(PetscFree6(s.x, s.r, s.z, s.p, s.v, s.f));
  PetscCall(PetscFree3(s.factor, s.root, s.own));
  PetscFunctionReturn(PETSC_SUCCESS);
}
