/* Solids, alone: steps without a flow. Newton's method for M (c_t u - d) + f(x) = M g with x = a + b dt u: bdf2 with
   variable steps, the first one implicit Euler. A sparse direct solver, on every rank the same. Positions are relaxed
   with d = a = 0 and few steps. */
#include "compat.h"
#include "impl.h"
#include "base/pivots.h"

#define MAX_IT  60
#define TOL     1e-10 /* of a correction, in sizes of the solid */
#define LONGEST 0.05  /* correction of a position, likewise */
#define RELAX   3     /* steps of Newton's method */

/* Coefficients of the step: du/dt = ct u - d0 u^n - d1 u^(n-1), x = a0 x^n + a1 x^(n-1) + bdt u */
typedef struct {
  PetscReal ct, d0, d1, a0, a1, bdt;
} Scheme;

static Scheme get_scheme(PetscReal dt, PetscReal dt_old)
{
  const PetscReal r = dt_old > 0 ? dt / dt_old : 0;
  Scheme          s = {.ct = 1 / dt, .d0 = 1 / dt, .a0 = 1, .bdt = dt};

  if (dt_old <= 0) return s;
  s.ct  = (1 + 2 * r) / ((1 + r) * dt);
  s.d0  = (1 + r) / dt;
  s.d1  = -r * r / ((1 + r) * dt);
  s.a0  = s.d0 / s.ct;
  s.a1  = s.d1 / s.ct;
  s.bdt = 1 / s.ct;
  return s;
}

static PetscErrorCode create_newton(const SolidMesh *m, SolidNewton *w)
{
  const PetscInt n = m->nnode * m->dim;
  PetscInt      *entries;
  PC             pc;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &entries));
  for (PetscInt i = 0; i < n; i++) entries[i] = (m->around[i / m->dim + 1] - m->around[i / m->dim]) * m->dim;
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, n, n, 0, entries, &w->J));
  PetscCall(PetscFree(entries));
  PetscCall(MatCreateVecs(w->J, &w->d, &w->r));
  PetscCall(KSPCreate(PETSC_COMM_SELF, &w->ksp));
  PetscCall(KSPSetType(w->ksp, KSPPREONLY));
  PetscCall(KSPGetPC(w->ksp, &pc));
  PetscCall(PCSetType(pc, PCLU));
  PetscCall(PivotsOfAnySize(w->ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidNewtonDestroy(Solids b)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < b->s.n && b->newton; k++) {
    PetscCall(MatDestroy(&b->newton[k].J));
    PetscCall(VecDestroy(&b->newton[k].d));
    PetscCall(VecDestroy(&b->newton[k].r));
    PetscCall(KSPDestroy(&b->newton[k].ksp));
  }
  PetscCall(PetscFree(b->newton));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* J = K + rho M ct/bdt, r = M (g rho - rho (ct u - d)) - f at x; u = (x - a)/bdt. Rows of held nodes: identity, 0 */
static PetscErrorCode assemble(const SolidGroup *g, const Scheme *s, const PetscReal gravity[], const PetscReal x[],
                               const PetscReal a[], const PetscReal d[], SolidNewton *w)
{
  const SolidMesh *m   = &g->mesh;
  const PetscInt   dim = m->dim, nb = m->nb, n = nb * dim;
  PetscReal       *r;

  PetscFunctionBeginUser;
  PetscCall(MatZeroEntries(w->J));
  PetscCall(VecZeroEntries(w->r));
  PetscCall(VecGetArray(w->r, &r));
  for (PetscInt c = 0; c < m->ncell; c++) {
    PetscReal xc[SOLID_MAX_N], f[SOLID_MAX_N], K[SOLID_MAX_N * SOLID_MAX_N], M[27 * 27];
    PetscInt  row[SOLID_MAX_N];

    SolidGather(m, c, x, xc);
    (void)SolidCellForce(m, &g->material, c, xc, f, K);
    SolidCellMass(m, c, M);
    for (PetscInt e = 0; e < n; e++) {
      const PetscInt i = m->cell_node[c * nb + e / dim];

      row[e] = g->clamped[i] ? -1 : dim * i + e % dim;
      for (PetscInt j = 0; j < nb; j++) {
        const PetscInt at = dim * m->cell_node[c * nb + j] + e % dim;

        f[e] += g->density * M[e / dim * nb + j] * (s->ct * (x[at] - a[at]) / s->bdt - d[at] - gravity[e % dim]);
        K[e * n + j * dim + e % dim] += g->density * s->ct / s->bdt * M[e / dim * nb + j];
      }
      if (row[e] >= 0) r[row[e]] -= f[e];
    }
    PetscCall(MatSetValues(w->J, n, row, n, row, K, ADD_VALUES));
  }
  PetscCall(VecRestoreArray(w->r, &r));
  for (PetscInt e = 0; e < m->nnode * dim; e++)
    if (g->clamped[e / dim]) PetscCall(MatSetValue(w->J, e, e, g->material.mu, ADD_VALUES));
  PetscCall(MatAssemblyBegin(w->J, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(w->J, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A step of Newton's method for x [nnode][dim] of solid k; the largest correction, not a number: there is none */
static PetscErrorCode correct(Solids b, PetscInt k, const Scheme *s, const PetscReal gravity[], const PetscReal a[],
                              const PetscReal d[], PetscReal x[], PetscReal *size)
{
  const SolidGroup *g = b->group + b->group_of[k];
  SolidNewton      *w = b->newton + k;
  const PetscReal  *step;
  PetscReal         fraction;

  PetscFunctionBeginUser;
  if (!w->ksp) PetscCall(create_newton(&g->mesh, w));
  PetscCall(assemble(g, s, gravity, x, a, d, w));
  PetscCall(KSPSetOperators(w->ksp, w->J, w->J));
  PetscCall(KSPSolve(w->ksp, w->r, w->d));
  PetscCall(VecNorm(w->d, NORM_INFINITY, size));
  if (PetscIsInfOrNanReal(*size)) PetscFunctionReturn(PETSC_SUCCESS);
  fraction = PetscMin(1, LONGEST * g->mesh.radius / PetscMax(*size, PETSC_SMALL * g->mesh.radius));
  PetscCall(VecGetArrayRead(w->d, &step));
  for (PetscInt e = 0; e < g->mesh.nnode * g->mesh.dim; e++) x[e] += fraction * step[e];
  PetscCall(VecRestoreArrayRead(w->d, &step));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* x [nnode][dim] of solid k becomes that of the end of the step */
static PetscErrorCode solve(Solids b, PetscInt k, const Scheme *s, const PetscReal gravity[], const PetscReal a[],
                            const PetscReal d[], PetscReal x[])
{
  const SolidGroup *g    = b->group + b->group_of[k];
  PetscReal         size = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  for (PetscInt it = 0; it < MAX_IT && size > TOL * g->mesh.radius; it++) {
    PetscCall(correct(b, k, s, gravity, a, d, x, &size));
    if (PetscIsInfOrNanReal(size)) break;
  }
  PetscCheck(size <= TOL * g->mesh.radius, b->comm, PETSC_ERR_NOT_CONVERGED,
             "The elastic solid of group '%s' has no equilibrium that Newton's method finds in %d iterations: lower -sim_dt (%g), or the load",
             g->name, MAX_IT, (double)s->bdt);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidsRelax(Solids b, PetscInt k, PetscReal dt, PetscReal x[])
{
  static const PetscReal none[3] = {0, 0, 0};
  const Scheme           sc      = {.ct = 1 / dt, .bdt = dt};
  const PetscInt         n       = b->s.dim * (b->first[k + 1] - b->first[k]);
  PetscReal             *from, *zero, *to, size = 0;

  PetscFunctionBeginUser;
  if (!b->newton) PetscCall(PetscCalloc1(b->s.n, &b->newton));
  PetscCall(PetscMalloc2(n, &from, n, &to));
  PetscCall(PetscCalloc1(n, &zero));
  PetscCall(PetscArraycpy(from, x, n));
  PetscCall(PetscArraycpy(to, x, n));
  for (PetscInt it = 0; it < RELAX && !PetscIsInfOrNanReal(size); it++)
    PetscCall(correct(b, k, &sc, none, from, zero, to, &size));
  if (!PetscIsInfOrNanReal(size)) PetscCall(PetscArraycpy(x, to, n));
  PetscCall(PetscFree2(from, to));
  PetscCall(PetscFree(zero));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidsAdvance(Solids b, PetscReal dt, const PetscReal gravity[])
{
  SolidsState   *s  = &b->s;
  const Scheme   sc = get_scheme(dt, s->time_dt);
  const PetscInt n  = s->nnode * s->dim;
  PetscReal     *x, *a, *d;

  PetscFunctionBeginUser;
  if (!b->newton) PetscCall(PetscCalloc1(s->n, &b->newton));
  PetscCall(PetscMalloc3(n, &x, n, &a, n, &d));
  for (PetscInt e = 0; e < n; e++) {
    a[e] = sc.a0 * s->x[e] + sc.a1 * s->x_old[e];
    d[e] = sc.d0 * s->u[e] + sc.d1 * s->u_old[e];
    x[e] = s->x[e];
  }
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscInt at = s->dim * b->first[k];

    PetscCall(solve(b, k, &sc, gravity, a + at, d + at, x + at));
  }
  for (PetscInt e = 0; e < n; e++) a[e] = (x[e] - a[e]) / sc.bdt;
  PetscCall(SolidsAccept(b, dt, x, a, NULL));
  PetscCall(PetscFree3(x, a, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}
