/* VCycle: life cycle and application, see vcycle.h. */
#include "compat.h"
#include "vcycleimpl.h"

#define MAX_REPLICATED 4096 /* rows of a level that all ranks hold, at most */

/* ---- application ---- */

static PetscErrorCode fetch(const VRows *A, PetscReal x[])
{
  PetscFunctionBeginUser;
  if (!A->ghosts) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscSFBcastBegin(A->ghosts, MPIU_REAL, x, x + A->own, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(A->ghosts, MPIU_REAL, x, x + A->own, MPI_REPLACE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* sum - value x over entries [from, to) */
static inline PetscReal subtract(const VRows *A, PetscInt from, PetscInt to, const PetscReal x[], PetscReal sum)
{
  for (PetscInt e = from; e < to; e++) sum -= (PetscReal)A->value[e] * x[A->col[e]];
  return sum;
}

/* Sweep from zero */
static void sweep_forward(VLevel *l, const PetscReal b[])
{
  const PetscInt *start = l->A.start;

  for (PetscInt i = 0; i < l->A.n; i++)
    l->x[i] = l->inverse[i] * subtract(&l->A, start[3 * i], start[3 * i + 1], l->x, b[i]);
}

static void sweep_backward(VLevel *l, const PetscReal b[])
{
  const PetscInt *start = l->A.start;

  for (PetscInt i = l->A.n - 1; i >= 0; i--)
    l->x[i] = l->inverse[i] *
              subtract(&l->A, start[3 * i], start[3 * i + 3], l->x, b[i] + (PetscReal)l->more[i] * l->x[i]);
}

/* Behind sweep_forward, which has left nothing but what it has not seen yet: below->b = P^T D (b - A x) */
static PetscErrorCode restrict_down(VCycle s, VLevel *l, VLevel *below, const PetscReal d[])
{
  const PetscInt *start = l->A.start, *p = l->P.start;
  PetscMPIInt     n;

  PetscFunctionBeginUser;
  if (!l->replicated) PetscCall(fetch(&l->A, l->x));
  PetscCall(PetscArrayzero(below->b, l->P.own + l->P.nghost));
  for (PetscInt i = 0; i < l->A.n; i++) {
    PetscReal r = subtract(&l->A, start[3 * i + 1], start[3 * i + 3], l->x, (PetscReal)l->more[i] * l->x[i]);

    if (d) r *= d[i];
    for (PetscInt e = p[i]; e < p[i + 1]; e++) below->b[l->P.col[e]] += (PetscReal)l->P.value[e] * r;
  }
  if (l->replicated || s->alone) PetscFunctionReturn(PETSC_SUCCESS);
  if (below->replicated) {
    PetscCall(PetscMPIIntCast(below->A.n, &n));
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, below->b, n, MPIU_REAL, MPIU_SUM, s->comm));
  } else if (l->P.ghosts) {
    PetscCall(PetscSFReduceBegin(l->P.ghosts, MPIU_REAL, below->b + l->P.own, below->b, MPIU_SUM));
    PetscCall(PetscSFReduceEnd(l->P.ghosts, MPIU_REAL, below->b + l->P.own, below->b, MPIU_SUM));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* x += D P x below, at ghosts as well; below->b is free for what comes from other ranks */
static PetscErrorCode prolong_up(VCycle s, VLevel *l, VLevel *below, const PetscReal d[])
{
  const PetscInt *p = l->P.start;
  PetscReal      *x = below->x;

  PetscFunctionBeginUser;
  if (!below->replicated && l->P.ghosts) { /* other ghosts than those of the matrix there */
    x = below->b;
    PetscCall(PetscArraycpy(x, below->x, l->P.own));
    PetscCall(fetch(&l->P, x));
  }
  for (PetscInt i = 0; i < l->A.n; i++) l->x[i] -= (d ? d[i] : 1) * subtract(&l->P, p[i], p[i + 1], x, 0);
  if (l->replicated || s->alone) PetscFunctionReturn(PETSC_SUCCESS);
  if (!below->replicated) PetscCall(fetch(&l->A, l->x));
  p = l->ghost.start;
  for (PetscInt i = 0, k = l->A.own; below->replicated && i < l->A.nghost; i++, k++)
    l->x[k] -= (d ? d[k] : 1) * subtract(&l->ghost, p[i], p[i + 1], x, 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode VCycleApply(VCycle s, Vec b, Vec x)
{
  const PetscReal *from, inverse = 1 / s->unit;
  PetscReal       *to;
  VLevel          *top = s->level, *last = top + s->n - 1;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(b, &from));
  for (PetscInt i = 0; i < top->A.n; i++) top->b[i] = inverse * from[i];
  PetscCall(VecRestoreArrayRead(b, &from));
  for (VLevel *l = top; l <= last; l++) {
    sweep_forward(l, l->b);
    if (l < last) PetscCall(restrict_down(s, l, l + 1, l == top ? s->d : NULL));
    else if (!l->replicated) PetscCall(fetch(&l->A, l->x));
  }
  sweep_backward(last, last->b);
  for (VLevel *l = last - 1; l >= top; l--) {
    PetscCall(prolong_up(s, l, l + 1, l == top ? s->d : NULL));
    sweep_backward(l, l->b);
  }
  PetscCall(VecGetArrayWrite(x, &to));
  PetscCall(PetscArraycpy(to, top->x, top->A.n));
  PetscCall(VecRestoreArrayWrite(x, &to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

PetscErrorCode VCycleFits(PC pc, PetscBool *fits)
{
#define OPTION "-pc_hypre_boomeramg_"
  static const char *const SAME[][2] = {{OPTION "relax_type_down", "l1-Gauss-Seidel"},
                                        {OPTION "relax_type_up", "backward-l1-Gauss-Seidel"},
                                        {OPTION "relax_type_coarse", "symmetric-SOR/Jacobi"}};
  static const char *const NONE[]    = {"relax_type_all",
                                        "cycle_type",
                                        "max_iter",
                                        "tol",
                                        "grid_sweeps_all",
                                        "grid_sweeps_down",
                                        "grid_sweeps_up",
                                        "grid_sweeps_coarse",
                                        "relax_weight_all",
                                        "relax_weight_level",
                                        "outer_relax_weight_all",
                                        "outer_relax_weight_level",
                                        "smooth_type",
                                        "smooth_num_levels",
                                        "nodal_coarsen",
                                        "print_statistics"};
  const char              *prefix, *type = NULL;
  PetscBool                is, given;
  char                     name[64], value[64];

  PetscFunctionBeginUser;
  PetscCall(PCGetOptionsPrefix(pc, &prefix));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCHYPRE, fits));
  if (!*fits) PetscFunctionReturn(PETSC_SUCCESS);
#if defined(PETSC_HAVE_HYPRE)
  PetscCall(PCHYPREGetType(pc, &type));
#endif
  PetscCall(PetscStrcmp(type, "boomeramg", fits));
  for (size_t k = 0; k < PETSC_STATIC_ARRAY_LENGTH(SAME); k++) {
    PetscCall(PetscOptionsGetString(NULL, prefix, SAME[k][0], value, sizeof(value), &given));
    PetscCall(PetscStrcasecmp(value, SAME[k][1], &is));
    *fits = (PetscBool)(*fits && given && is);
  }
  for (size_t k = 0; k < PETSC_STATIC_ARRAY_LENGTH(NONE); k++) {
    PetscCall(PetscSNPrintf(name, sizeof(name), OPTION "%s", NONE[k]));
    PetscCall(PetscOptionsHasName(NULL, prefix, name, &given));
    *fits = (PetscBool)(*fits && !given);
  }
  PetscCall(PetscOptionsHasName(NULL, prefix, OPTION "no_CF", &given));
  *fits = (PetscBool)(*fits && given);
  PetscFunctionReturn(PETSC_SUCCESS);
#undef OPTION
}

/* A power of two near the largest entry of the diagonal on all ranks */
static PetscErrorCode find_unit(VCycle s, Mat A)
{
  Vec       diagonal;
  PetscReal max;
  int       power;

  PetscFunctionBeginUser;
  PetscCall(MatCreateVecs(A, &diagonal, NULL));
  PetscCall(MatGetDiagonal(A, diagonal));
  PetscCall(VecNorm(diagonal, NORM_INFINITY, &max));
  PetscCall(VecDestroy(&diagonal));
  (void)frexp(max, &power);
  s->unit = max > 0 && max < PETSC_MAX_REAL ? ldexp(1, power) : 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_vectors(VCycle s)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    VLevel        *l = s->level + k;
    const PetscInt n = k ? l[-1].P.own + l[-1].P.nghost : 0;

    PetscCall(PetscCalloc1(PetscMax(l->A.n, n), &l->b));
    if (k) PetscCall(PetscCalloc1(l->A.n + l->A.nghost, &l->x)); /* else with the finest matrix */
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode VCycleCreate(PC pc, Mat A, VCycle *cycle)
{
  VCycle      s;
  PetscInt    n, m, replicated = 0;
  Mat        *coarse, *P;
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  PetscCall(PetscCommDuplicate(PetscObjectComm((PetscObject)pc), &s->comm, NULL));
  PetscCallMPI(MPI_Comm_size(s->comm, &size));
  s->alone = (PetscBool)(size == 1);
  PetscCall(PCGetCoarseOperators(pc, &n, &coarse)); /* lowest first */
  PetscCall(PCGetInterpolations(pc, &m, &P));
  PetscCheck(n == m, s->comm, PETSC_ERR_PLIB,
             "%" PetscInt_FMT " levels of matrices, %" PetscInt_FMT " of interpolations", n, m);
  s->n = PetscMax(1, n);
  n    = s->n - 1;
  PetscCall(PetscCalloc1(s->n, &s->level));
  PetscCall(find_unit(s, A));
  while (replicated < n) {
    PetscInt rows;

    PetscCall(MatGetSize(coarse[replicated], &rows, NULL));
    if (rows > MAX_REPLICATED) break;
    replicated++;
  }
  PetscCall(VCycleSetMatrix(s, A, NULL));
  for (PetscInt k = 0; k < n - replicated; k++) {
    PetscCall(VRowsTake(P[n - 1 - k], PETSC_FALSE, &s->level[k].P));
    PetscCall(VLevelTake(s, coarse[n - 1 - k], &s->level[k + 1]));
  }
  if (replicated) {
    PetscCall(VRowsTake(P[replicated - 1], PETSC_TRUE, &s->level[n - replicated].P));
    PetscCall(VLevelsGather(s, replicated, coarse, P, s->level + n - replicated + 1));
    PetscCall(VLevelFetchGhosts(s, s->level + n - replicated));
  }
  PetscCall(create_vectors(s));
  for (PetscInt k = 0; k < n; k++) {
    PetscCall(MatDestroy(&coarse[k]));
    PetscCall(MatDestroy(&P[k]));
  }
  PetscCall(PetscFree(coarse));
  PetscCall(PetscFree(P));
  *cycle = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode VCycleSetMatrix(VCycle s, Mat A, Vec scale)
{
  const PetscReal *d;

  PetscFunctionBeginUser;
  PetscCall(VLevelTakeFinest(s, A));
  if (!scale) PetscCall(PetscFree(s->d));
  else {
    if (!s->d) PetscCall(PetscMalloc1(s->level->A.n + s->level->A.nghost, &s->d));
    PetscCall(VecGetArrayRead(scale, &d));
    PetscCall(PetscArraycpy(s->d, d, s->level->A.n));
    PetscCall(VecRestoreArrayRead(scale, &d));
    PetscCall(fetch(&s->level->A, s->d));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode VCycleGetLevels(VCycle s, PetscInt *n, PetscInt *replicated)
{
  PetscFunctionBeginUser;
  *n          = s->n;
  *replicated = 0;
  for (PetscInt k = 0; k < s->n; k++) *replicated += s->level[k].replicated;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode VCycleDestroy(VCycle *cycle)
{
  VCycle s = *cycle;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < s->n; k++) {
    PetscCall(VRowsDestroy(&s->level[k].A));
    PetscCall(VRowsDestroy(&s->level[k].P));
    PetscCall(VRowsDestroy(&s->level[k].ghost));
    PetscCall(PetscFree2(s->level[k].inverse, s->level[k].more));
    PetscCall(PetscFree(s->level[k].x));
    PetscCall(PetscFree(s->level[k].b));
  }
  PetscCall(PetscFree(s->level));
  PetscCall(PetscFree(s->d));
  PetscCall(PetscFree(s->ghost));
  PetscCall(PetscCommDestroy(&s->comm));
  PetscCall(PetscFree(*cycle));
  PetscFunctionReturn(PETSC_SUCCESS);
}
