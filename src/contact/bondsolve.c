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
#define TOLERANCE  1e-12 /* of the residual, in the norm of the preconditioner */

typedef struct {
  PetscInt  index[2]; /* local numbers; the second < 0: a wall */
  PetscReal block[36];
} Coupling; /* of the two bodies of a bond: [nr][nr], rows of the first */

typedef struct {
  Contact    c;
  PetscInt   nr, nown, *own;                             /* own: bonded bodies of this rank */
  Coupling  *coupling;                                   /* [bonds] */
  PetscReal *block, *factor;                             /* [bodies][nr][nr] of the matrix; factorised */
  PetscReal (*x)[6], (*r)[6], (*z)[6], (*p)[6], (*q)[6]; /* [bodies] */
} Spread;

/* ---- products ---- */

/* q = A p, of own bodies; nr: a constant of the call, so that loops are unrolled */
static inline void multiply_blocks(Spread *s, PetscInt nr)
{
  for (PetscInt i = 0; i < s->nown; i++) {
    const PetscInt   k = s->own[i];
    const PetscReal *D = s->block + k * nr * nr;

    for (PetscInt a = 0; a < nr; a++) {
      s->q[k][a] = 0;
      for (PetscInt b = 0; b < nr; b++) s->q[k][a] += D[a * nr + b] * s->p[k][b];
    }
  }
  for (PetscInt e = 0; e < s->c->bonds->n; e++) {
    const Coupling *A = &s->coupling[e];
    PetscReal      *qi, *qj;
    PetscReal       pi[6], pj[6];

    if (A->index[1] < 0) continue;
    qi = s->q[A->index[0]];
    qj = s->q[A->index[1]];
    for (PetscInt a = 0; a < nr; a++) pi[a] = s->p[A->index[0]][a];
    for (PetscInt a = 0; a < nr; a++) pj[a] = s->p[A->index[1]][a];
    for (PetscInt a = 0; a < nr; a++)
      for (PetscInt b = 0; b < nr; b++) {
        qi[a] += A->block[a * nr + b] * pj[b];
        qj[b] += A->block[a * nr + b] * pi[a];
      }
  }
}

static PetscErrorCode multiply(Spread *s)
{
  PetscFunctionBeginUser;
  PetscCall(BodiesUpdateGhosts(s->c->bodies, 6, s->p));
  if (s->nr == 3) multiply_blocks(s, 3);
  else multiply_blocks(s, 6);
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

/* z = D^-1 r */
static void precondition(const Spread *s)
{
  const PetscInt nr = s->nr;

  for (PetscInt i = 0; i < s->nown; i++) {
    const PetscInt   k = s->own[i];
    const PetscReal *L = s->factor + k * nr * nr;
    PetscReal       *z = s->z[k];

    for (PetscInt a = 0; a < nr; a++) {
      z[a] = s->r[k][a];
      for (PetscInt b = 0; b < a; b++) z[a] -= L[a * nr + b] * z[b];
      z[a] /= L[a * nr + a];
    }
    for (PetscInt a = nr - 1; a >= 0; a--) {
      for (PetscInt b = a + 1; b < nr; b++) z[a] -= L[b * nr + a] * z[b];
      z[a] /= L[a * nr + a];
    }
  }
}

/* ---- the system ---- */

/* Of the n modes of a bond: blocks, right-hand side */
static void add_bond(Spread *s, PetscInt n, const AloneSpring spring[], Coupling *A)
{
  const PetscInt nr = s->nr;

  *A = (Coupling){.index = {spring->index[0], spring->index[1]}};
  for (PetscInt m = 0; m < n; m++) {
    const AloneSpring *t = &spring[m];

    for (PetscInt side = 0; side < (A->index[1] >= 0 ? 2 : 1); side++) {
      PetscReal *D = s->block + A->index[side] * nr * nr;

      for (PetscInt i = 0; i < nr; i++) s->r[A->index[side]][i] += t->load * t->row[side][i];
      for (PetscInt i = 0; i < nr * nr; i++) D[i] += t->rate * t->row[side][i / nr] * t->row[side][i % nr];
    }
    for (PetscInt i = 0; i < nr * nr && A->index[1] >= 0; i++)
      A->block[i] += t->rate * t->row[0][i / nr] * t->row[1][i % nr];
  }
}

/* Blocks and their factors, right-hand side, list of own bonded bodies */
static PetscErrorCode set_up(Spread *s, PetscReal h)
{
  const PetscInt nr = s->nr, n = s->c->s->n;
  Bonds          b = s->c->bonds;
  PetscBool     *bonded;
  AloneSpring    spring[BOND_MODES];

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(n, &bonded));
  for (PetscInt e = 0; e < b->n; e++) {
    PetscCall(BondMakeAloneSprings(s->c, &b->bond[e], h, spring));
    add_bond(s, b->bond[e].strain.n, spring, &s->coupling[e]);
    bonded[b->bond[e].i] = PETSC_TRUE;
    if (b->bond[e].j >= 0) bonded[b->bond[e].j] = PETSC_TRUE;
  }
  for (PetscInt k = 0; k < n; k++) {
    if (!bonded[k] || !s->c->s->own[k]) continue;
    s->own[s->nown++] = k;
    for (PetscInt a = 0; a < nr; a++) s->block[k * nr * nr + a * (nr + 1)] += 1;
    DenseFactor(nr, s->block + k * nr * nr, s->factor + k * nr * nr);
  }
  PetscCall(PetscFree(bonded));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Speeds at which the springs part in the end */
static PetscErrorCode find_speeds(Spread *s, PetscReal h, PetscReal speed[])
{
  Bonds       b = s->c->bonds;
  AloneSpring spring[BOND_MODES];

  PetscFunctionBeginUser;
  PetscCall(BodiesUpdateGhosts(s->c->bodies, 6, s->x));
  for (PetscInt e = 0; e < b->n; e++) {
    PetscCall(BondMakeAloneSprings(s->c, &b->bond[e], h, spring));
    for (PetscInt m = 0; m < b->bond[e].strain.n; m++) {
      PetscReal v = spring[m].free;

      for (PetscInt side = 0; side < (spring->index[1] >= 0 ? 2 : 1); side++)
        for (PetscInt a = 0; a < s->nr; a++) v -= spring[m].row[side][a] * s->x[spring->index[side]][a];
      *speed++ = v;
    }
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
    PetscCall(dot(s, s->p, s->q, &curvature));
    for (PetscInt i = 0; i < s->nown; i++)
      for (PetscInt a = 0; a < s->nr; a++) {
        const PetscInt k = s->own[i];

        s->x[k][a] += rho / curvature * s->p[k][a];
        s->r[k][a] -= rho / curvature * s->q[k][a];
      }
    precondition(s);
    PetscCall(dot(s, s->r, s->z, &next));
    *good = (PetscBool)(next <= PetscSqr(TOLERANCE) * first);
    for (PetscInt i = 0; i < s->nown; i++)
      for (PetscInt a = 0; a < s->nr; a++) s->p[s->own[i]][a] = s->z[s->own[i]][a] + next / rho * s->p[s->own[i]][a];
    rho = next;
    PetscCall(PetscLogFlops(4. * (PetscLogDouble)(s->c->bonds->n * s->nr * s->nr)));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondSolveSpread(Contact c, PetscReal h, PetscReal speed[], PetscBool *good)
{
  const PetscInt n = c->s->n, nr = RigidSize(c->dim);
  Spread         s = {.c = c, .nr = nr};

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc5(n, &s.x, n, &s.r, n, &s.z, n, &s.p, n, &s.q));
  PetscCall(PetscCalloc2(n * nr * nr, &s.block, n * nr * nr, &s.factor));
  PetscCall(PetscMalloc2(n, &s.own, c->bonds->n, &s.coupling));
  PetscCall(set_up(&s, h));
  PetscCall(iterate(&s, good));
  if (*good) PetscCall(find_speeds(&s, h, speed));
  PetscCall(PetscFree5(s.x, s.r, s.z, s.p, s.q));
  PetscCall(PetscFree2(s.block, s.factor));
  PetscCall(PetscFree2(s.own, s.coupling));
  PetscFunctionReturn(PETSC_SUCCESS);
}
