/* Relax: see relax.h. The kernels take the dimension as a constant, so that the loop over components disappears. */
#include "compat.h"
#include "relax.h"
#include "base/inline.h"
#include "base/rows.h"

struct _p_Relax {
  Mat              S;
  RelaxKind        kind;
  PetscInt         dim, n;
  const PetscReal *diagonal_inverse;
  /* factorisation */
  float    *lu;               /* [entries of the own part] L without its unit diagonal and U; the diagonal of U stands
                                 apart */
  float    *pivot_inverse;    /* [n][dim], zero at inert slots */
  PetscInt *diagonal, *where; /* [n] entry of the diagonal; scratch, -1 */
};

/* The rank's own part of the matrix */
static PetscErrorCode open_own(Relax s, Rows *r)
{
  Mat own;

  PetscFunctionBeginUser;
  PetscCall(MatGetDiagonalBlock(s->S, &own));
  PetscCall(RowsOpen(own, r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- SOR ---- */

INLINE void sor_kernel(const int dim, PetscInt n, PetscBool forward, PetscBool lower_only, const PetscInt *restrict ai,
                       const PetscInt *restrict aj, const PetscReal *restrict aa, const PetscReal *restrict dinv,
                       const PetscReal *restrict b, PetscReal *restrict x)
{
  for (PetscInt k = 0; k < n; k++) {
    const PetscInt i = forward ? k : n - 1 - k;
    PetscReal      s[3];

    for (int a = 0; a < dim; a++) s[a] = b[i * dim + a];
    for (PetscInt q = ai[i]; q < ai[i + 1]; q++) {
      const PetscInt j = aj[q];

      if (lower_only && j >= i) break; /* columns ascend and the rest of x is still zero */
      for (int a = 0; a < dim; a++) s[a] -= aa[q] * x[j * dim + a];
    }
    for (int a = 0; a < dim; a++) x[i * dim + a] += dinv[i * dim + a] * s[a];
  }
}

static void sor(Relax s, PetscBool forward, PetscBool lower_only, const Rows *r, const PetscReal b[], PetscReal x[])
{
  if (s->dim == 2) sor_kernel(2, s->n, forward, lower_only, r->start, r->column, r->value, s->diagonal_inverse, b, x);
  else sor_kernel(3, s->n, forward, lower_only, r->start, r->column, r->value, s->diagonal_inverse, b, x);
}

/* ---- ILU(0) ---- */

/* Inverse diagonal entry of node i; zero: inert */
static PetscReal get_diagonal_inverse(Relax s, PetscInt i)
{
  for (PetscInt a = 0; a < s->dim; a++)
    if (s->diagonal_inverse[i * s->dim + a] != 0) return s->diagonal_inverse[i * s->dim + a];
  return 0;
}

/* Row i of the factors from the rows above it. Entries in columns of inert nodes (pivot inverse zero) drop out. */
static void factorise_row(Relax s, PetscInt i, const PetscInt ai[], const PetscInt aj[], const PetscReal aa[],
                          const PetscReal pivot[], PetscReal row[])
{
  PetscInt *where = s->where, begin = ai[i], diagonal = s->diagonal[i];

  for (PetscInt q = begin; q < ai[i + 1]; q++) {
    row[q - begin] = pivot[aj[q]] == 0 && q != diagonal ? 0 : aa[q];
    where[aj[q]]   = q - begin;
  }
  for (PetscInt q = begin; q < diagonal; q++) {
    const PetscInt  j      = aj[q];
    const PetscReal factor = row[q - begin] * pivot[j];

    row[q - begin] = factor;
    for (PetscInt r = s->diagonal[j] + 1; r < ai[j + 1] && factor != 0; r++)
      if (where[aj[r]] >= 0) row[where[aj[r]]] -= factor * s->lu[r];
  }
  for (PetscInt q = begin; q < ai[i + 1]; q++) where[aj[q]] = -1;
}

/* A pivot that elimination has nearly used up, against the diagonal or against its row of U, is replaced by the
   diagonal, or more where the row is longer: the factors would overflow where convection that the mesh does not resolve
   outweighs the diagonal (runs/studies/flow-solver) */
#define PIVOT_OF_DIAGONAL 0.05
#define PIVOT_OF_ROW      0.03
#define INSTEAD_OF_ROW    0.1

/* Factors that grow by so much in the substitutions solve nothing, and SOR takes their place until the next: drops in
   space on cells of several sizes, 1.3 as a rule, 5e8 on a mesh in some twenty (runs/studies/drops-space) */
#define GROWN 1e3

/* pivot [n]: inverse pivots, at the beginning of the diagonal */
static PetscErrorCode factorise(Relax s, const Rows *r)
{
  const PetscInt  *ai = r->start, *aj = r->column;
  const PetscReal *aa = r->value;
  PetscReal       *pivot, *row;
  PetscInt         longest = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->n; i++) longest = PetscMax(longest, ai[i + 1] - ai[i]);
  PetscCall(PetscMalloc2(s->n, &pivot, longest, &row));
  for (PetscInt i = 0; i < s->n; i++) pivot[i] = get_diagonal_inverse(s, i);
  for (PetscInt i = 0; i < s->n; i++) {
    PetscReal entry, size = 0;

    if (pivot[i] == 0) {
      for (PetscInt q = ai[i]; q < ai[i + 1]; q++) s->lu[q] = 0;
    } else {
      factorise_row(s, i, ai, aj, aa, pivot, row);
      for (PetscInt q = ai[i]; q < ai[i + 1]; q++) {
        s->lu[q] = (float)row[q - ai[i]];
        if (q >= s->diagonal[i]) size += PetscAbsReal(row[q - ai[i]]); /* before it stand factors, which have no unit */
      }
      entry = row[s->diagonal[i] - ai[i]];
      if (entry * pivot[i] > PIVOT_OF_DIAGONAL && entry > PIVOT_OF_ROW * size) pivot[i] = 1 / entry;
      else pivot[i] = PetscMin(pivot[i], 1 / (INSTEAD_OF_ROW * size));
    }
    for (PetscInt a = 0; a < s->dim; a++)
      s->pivot_inverse[i * s->dim + a] = s->diagonal_inverse[i * s->dim + a] != 0 ? (float)pivot[i] : 0;
  }
  PetscCall(PetscFree2(pivot, row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* x = U^{-1} L^{-1} b */
INLINE void solve_kernel(const int dim, PetscInt n, const PetscInt *restrict ai, const PetscInt *restrict aj,
                         const PetscInt *restrict diagonal, const float *restrict lu, const float *restrict pivot,
                         const PetscReal *restrict b, PetscReal *restrict x)
{
  for (PetscInt i = 0; i < n; i++) {
    PetscReal s[3];

    for (int a = 0; a < dim; a++) s[a] = b[i * dim + a];
    for (PetscInt q = ai[i]; q < diagonal[i]; q++)
      for (int a = 0; a < dim; a++) s[a] -= (PetscReal)lu[q] * x[aj[q] * dim + a];
    for (int a = 0; a < dim; a++) x[i * dim + a] = pivot[i * dim + a] != 0 ? s[a] : 0;
  }
  for (PetscInt i = n; i-- > 0;) {
    PetscReal s[3];

    for (int a = 0; a < dim; a++) s[a] = x[i * dim + a];
    for (PetscInt q = ai[i + 1]; q-- > diagonal[i] + 1;) /* ascending, all would wait for the last row */
      for (int a = 0; a < dim; a++) s[a] -= (PetscReal)lu[q] * x[aj[q] * dim + a];
    for (int a = 0; a < dim; a++) x[i * dim + a] = (PetscReal)pivot[i * dim + a] * s[a];
  }
}

static void solve_factors(Relax s, const Rows *r, const PetscReal b[], PetscReal x[])
{
  if (s->dim == 2) solve_kernel(2, r->n, r->start, r->column, s->diagonal, s->lu, s->pivot_inverse, b, x);
  else solve_kernel(3, r->n, r->start, r->column, s->diagonal, s->lu, s->pivot_inverse, b, x);
}

/* Largest entry of (LU)^{-1} S 1, which is about 1 */
static PetscErrorCode measure_growth(Relax s, const Rows *r, PetscReal *growth)
{
  const PetscInt size = r->n * s->dim;
  PetscReal     *b, *x;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(size, &b, size, &x));
  for (PetscInt i = 0; i < size; i++)
    for (PetscInt q = r->start[i / s->dim]; q < r->start[i / s->dim + 1]; q++)
      if (s->pivot_inverse[r->column[q] * s->dim + i % s->dim] != 0) b[i] += r->value[q];
  solve_factors(s, r, b, x);
  *growth = 0;
  for (PetscInt i = 0; i < size; i++) *growth = PetscMax(*growth, PetscAbsReal(x[i]));
  PetscCall(PetscFree2(b, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode RelaxUpdate(Relax s, RelaxKind kind, Mat S, const PetscReal diagonal_inverse[])
{
  PetscReal growth = 0;
  Rows      r;

  PetscFunctionBeginUser;
  s->S                = S;
  s->kind             = kind;
  s->diagonal_inverse = diagonal_inverse;
  if (kind != RELAX_ILU) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(open_own(s, &r));
  if (!s->lu) {
    PetscCall(PetscMalloc4(r.start[r.n], &s->lu, r.n * s->dim, &s->pivot_inverse, r.n, &s->diagonal, r.n, &s->where));
    for (PetscInt i = 0; i < r.n; i++) {
      s->where[i] = -1;
      for (PetscInt q = r.start[i]; q < r.start[i + 1]; q++)
        if (r.column[q] == i) s->diagonal[i] = q;
    }
  }
  PetscCall(factorise(s, &r));
  PetscCall(measure_growth(s, &r, &growth));
  if (!(growth < GROWN)) s->kind = RELAX_SOR;
  PetscCall(RowsClose(&r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RelaxApply(Relax s, MatSORType flag, PetscInt its, const PetscReal b[], PetscReal x[])
{
  const PetscBool zero = (PetscBool)((flag & SOR_ZERO_INITIAL_GUESS) != 0);
  Rows            r;

  PetscFunctionBeginUser;
  PetscCheck(s->kind == RELAX_SOR || (zero && its == 1), PETSC_COMM_SELF, PETSC_ERR_SUP,
             "%s starts from zero and is applied once, not %" PetscInt_FMT
             " times: leave -flow_fieldsplit_velocity_pc_sor_its at 1 or give -flow_velocity_smoother sor",
             s->kind == RELAX_ILU ? "The incomplete factorisation of the velocity" : "The diagonal of the velocity",
             its);
  if (s->kind == RELAX_JACOBI) {
    for (PetscInt i = 0; i < s->n * s->dim; i++) x[i] = s->diagonal_inverse[i] * b[i];
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(open_own(s, &r));
  if (s->kind == RELAX_ILU) solve_factors(s, &r, b, x);
  else {
    if (zero) PetscCall(PetscArrayzero(x, r.n * s->dim));
    for (PetscInt it = 0; it < its; it++) {
      if (flag & (SOR_FORWARD_SWEEP | SOR_LOCAL_FORWARD_SWEEP))
        sor(s, PETSC_TRUE, (PetscBool)(zero && it == 0), &r, b, x);
      if (flag & (SOR_BACKWARD_SWEEP | SOR_LOCAL_BACKWARD_SWEEP)) sor(s, PETSC_FALSE, PETSC_FALSE, &r, b, x);
    }
  }
  PetscCall(RowsClose(&r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RelaxCreate(PetscInt n, PetscInt dim, Relax *sweep)
{
  Relax s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->n   = n;
  s->dim = dim;
  *sweep = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RelaxDestroy(Relax *sweep)
{
  PetscFunctionBeginUser;
  if (!*sweep) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree4((*sweep)->lu, (*sweep)->pivot_inverse, (*sweep)->diagonal, (*sweep)->where));
  PetscCall(PetscFree(*sweep));
  PetscFunctionReturn(PETSC_SUCCESS);
}
