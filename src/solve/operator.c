/* FlowSolver: products with the projected operators and the mass of the preconditioner (see impl.h). For all
   components in one pass, over the scalar matrix and the cells' matrices of B; nothing is assembled. */
#include "compat.h"
#include "impl.h"
#include "solidblock.h"
#include "base/algebra.h"
#include "base/log.h"

static void add_small(PetscInt n, const PetscReal M[], const PetscReal x[], PetscReal y[])
{
  for (PetscInt i = 0; i < n * n; i++) y[i / n] += M[i] * x[i % n];
}

/* ---- the projected velocity operator ---- */

/* Do bodies known here have rows beside those of their nodes? */
static PetscBool has_more_rows(FlowSolver fs)
{
  return (PetscBool)(FlowSolverHasPenalty(fs) || ContactCouplingAny(fs->body.contact_coupling));
}

/* The penalty's part outside the scalar matrix and the ties: y -= G U, rigid_work = -G^T x + ties U, with x and the
   rigid velocities as ConstraintExpandInPlace left them */
static PetscErrorCode mult_more_rows(FlowSolver fs, const PetscReal x[], PetscReal y[])
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(fs->body.rigid_work, c->nlocal * fs->nr));
  if (FlowSolverHasPenalty(fs))
    PetscCall(
      PenaltyTermMultAdd(fs->body.penalty, fs->constraint, PETSC_TRUE, c->local_rigid, x, y, fs->body.rigid_work));
  ContactCouplingMultAdd(fs->body.contact_coupling, PETSC_FALSE, 1, c->local_rigid, fs->body.rigid_work);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = (D + H) x of own body i, from and to its slots */
static void mult_body(FlowSolver fs, PetscInt i, const PetscReal x[], PetscReal y[])
{
  const ConstraintView *c  = ConstraintGetView(fs->constraint);
  const PetscInt        nr = fs->nr, k = c->own[i];
  PetscReal             U[6];

  for (PetscInt s = 0; s < nr; s++) U[s] = ConstraintSlotUnit(c, k, s) * x[s];
  DenseMultiply(nr, fs->body.D + k * nr * nr, PETSC_FALSE, U, y);
  if (FlowSolverHasPenalty(fs)) add_small(nr, fs->body.penalty->whole + i * nr * nr, U, y);
  for (PetscInt s = 0; s < nr; s++) y[s] *= ConstraintSlotUnit(c, k, s);
}

void FlowSolverMultBodies(FlowSolver fs, const PetscReal x[], PetscReal y[])
{
  const ConstraintView *c  = ConstraintGetView(fs->constraint);
  const PetscInt        nr = fs->nr;

  for (PetscInt k = 0; k < c->nown; k++) {
    mult_body(fs, k, x + k * nr, y + k * nr);
    for (PetscInt s = 0; s < nr; s++)
      if (!ConstraintIsUnknown(c, c->own[k], s)) y[k * nr + s] = x[k * nr + s];
  }
  for (PetscInt i = c->nown * nr; i < c->count * nr; i++) y[i] = x[i];
}

/* y = A x without a matrix, own nodes */
static PetscErrorCode mult_free(Mat mat, Vec x, Vec y)
{
  FlowSolver       fs;
  const PetscReal *xa;
  PetscReal       *ya;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(VecGetArrayWrite(y, &ya));
  PetscCall(FlowMultiply(fs->flow, PETSC_FALSE, xa, ya));
  PetscCall(VecRestoreArrayWrite(y, &ya));
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = (P^T A P + D) x with identity on inert slots */
static PetscErrorCode mult_velocity(Mat mat, Vec x, Vec y)
{
  const ConstraintView *c;
  FlowSolver            fs;
  const PetscReal      *xr;
  PetscReal            *xa, *ya, norm;
  PetscBool             has_norm;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  PetscCall(VecNormAvailable(x, NORM_INFINITY, &has_norm, &norm));
  if (has_norm && norm == 0) { /* PETSc's gcr multiplies its start value, too */
    PetscCall(VecZeroEntries(y));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscLogEventBegin(TB_VEL_MULT, 0, 0, 0, 0));
  c = ConstraintGetView(fs->constraint);
  PetscCall(VecGetArrayRead(x, &xr));
  PetscCall(VecGetArrayWrite(y, &ya));
  xa = fs->vec.nodal;
  PetscCall(PetscArraycpy(xa, xr, fs->nodal));
  PetscCall(ConstraintExpandInPlace(fs->constraint, xr + fs->nodal, xa));
  PetscCall(VecPlaceArray(fs->vec.xn, xa));
  PetscCall(VecPlaceArray(fs->vec.yn, ya));
  PetscCall(MatMult(fs->op.outer && fs->op.A_outer ? fs->op.A_outer : fs->op.A, fs->vec.xn, fs->vec.yn));
  if (FlowHasOperators(fs->flow)) PetscCall(FlowMultiplyOperators(fs->flow, fs->vec.xn, fs->vec.yn));
  PetscCall(VecResetArray(fs->vec.xn));
  PetscCall(VecResetArray(fs->vec.yn));
  if (has_more_rows(fs)) PetscCall(mult_more_rows(fs, xa, ya));
  FlowSolverMultBodies(fs, xr + fs->nodal, ya + fs->nodal);
  if (has_more_rows(fs)) PetscCall(ConstraintDeliverRigid(fs->constraint, fs->body.rigid_work, ya + fs->nodal));
  PetscCall(ConstraintReduceInPlace(fs->constraint, ya, ya + fs->nodal));
  for (PetscInt j = 0; j < c->inert.n; j++) ya[c->inert.slot[j]] = xr[c->inert.slot[j]];
  PetscCall(VecRestoreArrayWrite(y, &ya));
  PetscCall(VecRestoreArrayRead(x, &xr));
  PetscCall(PetscLogEventEnd(TB_VEL_MULT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode diagonal_velocity(Mat mat, Vec d)
{
  const ConstraintView *c;
  FlowSolver            fs;
  PetscReal            *a;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  c = ConstraintGetView(fs->constraint);
  PetscCall(VecGetArrayWrite(d, &a));
  for (PetscInt i = 0; i < fs->nodal; i++) a[i] = fs->diagonal_inverse[i] > 0 ? 1 / fs->diagonal_inverse[i] : 1;
  for (PetscInt i = fs->nodal; i < fs->nur; i++) a[i] = 1;
  for (PetscInt i = 0; i < c->nown * fs->nr; i++)
    a[fs->nodal + i] = 1 / fs->body.body_inverse[i / fs->nr * fs->nr * fs->nr + (i % fs->nr) * (fs->nr + 1)];
  PetscCall(VecRestoreArrayWrite(d, &a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void FlowSolverSolveBodies(FlowSolver fs, const PetscReal b[], PetscReal x[])
{
  const ConstraintView *c  = ConstraintGetView(fs->constraint);
  const PetscInt        nr = fs->nr;

  for (PetscInt k = 0; k < c->nown; k++)
    DenseMultiply(nr, fs->body.body_inverse + k * nr * nr, PETSC_FALSE, b + k * nr, x + k * nr);
  for (PetscInt i = c->nown * nr; i < c->count * nr; i++) x[i] = b[i];
}

PetscErrorCode FlowSolverAnswerBodies(FlowSolver fs, PetscReal sum[], PetscReal x[])
{
  const ConstraintView *c     = ConstraintGetView(fs->constraint);
  const PetscInt        nr    = fs->nr;
  PetscReal            *force = fs->body.rigid_work + fs->capacity * nr, U[6];

  PetscFunctionBeginUser;
  ContactCouplingMultAdd(fs->body.contact_coupling, PETSC_TRUE, -1, c->local_rigid, sum);
  PetscCall(PetscArrayzero(force, c->count * nr));
  PetscCall(ConstraintDeliverRigid(fs->constraint, sum, force));
  for (PetscInt k = 0; k < c->nown; k++) {
    for (PetscInt s = 0; s < nr; s++)
      if (!ConstraintIsUnknown(c, c->own[k], s)) force[k * nr + s] = 0;
    DenseMultiply(nr, fs->body.body_inverse + k * nr * nr, PETSC_FALSE, force + k * nr, U);
    for (PetscInt s = 0; s < nr; s++) x[k * nr + s] += U[s];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* x -= S_b^{-1} (E^T x + O U) at the bodies' slots, U what stood there: what nodes and other bodies mean for them */
static PetscErrorCode apply_body_rows(FlowSolver fs, PetscReal x[])
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(fs->body.rigid_work, c->nlocal * fs->nr));
  PetscCall(BodyCouplingAnswer(fs->body.coupling, x, c->local_rigid, fs->body.rigid_work));
  PetscCall(FlowSolverAnswerBodies(fs, fs->body.rigid_work, x + fs->nodal));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies, then nodes by sweeps or the factorisation for all components at once, then bodies again: symmetric block
   Gauss-Seidel (bodycoupling.h). Inert slots stay as they are. */
static PetscErrorCode sor_velocity(Mat mat, Vec bv, PetscReal omega, MatSORType flag, PetscReal shift, PetscInt its,
                                   PetscInt lits, Vec xv)
{
  const ConstraintView *c;
  FlowSolver            fs;
  const PetscReal      *b, *rhs;
  PetscReal            *x;

  PetscFunctionBeginUser;
  PetscCheck(omega == 1 && shift == 0, PetscObjectComm((PetscObject)mat), PETSC_ERR_SUP,
             "The velocity sweep knows no over-relaxation or shift (omega %g, shift %g): leave -flow_fieldsplit_velocity_pc_sor_omega at 1 or choose another pc_type",
             (double)omega, (double)shift);
  PetscCall(MatShellGetContext(mat, &fs));
  PetscCall(PetscLogEventBegin(TB_VEL_SMOOTHER, 0, 0, 0, 0));
  c = ConstraintGetView(fs->constraint);
  PetscCall(VecGetArrayRead(bv, &b));
  PetscCall(VecGetArray(xv, &x));
  rhs = b;
  FlowSolverSolveBodies(fs, b + fs->nodal, x + fs->nodal);
  if (fs->nbodies) {
    PetscCall(ConstraintFetchRigid(fs->constraint, x + fs->nodal));
    PetscCall(PetscArraycpy(fs->vec.nodal, b, fs->nodal));
    PetscCall(BodyCouplingSubtract(fs->body.coupling, c->local_rigid, fs->vec.nodal));
    rhs = fs->vec.nodal;
  }
  PetscCall(RelaxApply(fs->smoother, flag, its * lits, rhs, x));
  if (fs->nbodies) PetscCall(apply_body_rows(fs, x));
  for (PetscInt j = 0; j < c->inert.n; j++) x[c->inert.slot[j]] = b[c->inert.slot[j]];
  PetscCall(VecRestoreArray(xv, &x));
  PetscCall(VecRestoreArrayRead(bv, &b));
  PetscCall(PetscLogEventEnd(TB_VEL_SMOOTHER, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- B and its transpose, projected ---- */

/* y = scale B P x */
static PetscErrorCode mult_divergence(Mat mat, Vec x, Vec y)
{
  FlowSolver       fs;
  const PetscReal *xr;
  PetscReal       *ya;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  PetscCall(VecGetArrayRead(x, &xr));
  PetscCall(VecGetArrayWrite(y, &ya));
  PetscCall(PetscArraycpy(fs->vec.local, xr, fs->nodal));
  PetscCall(ConstraintExpandInPlace(fs->constraint, xr + fs->nodal, fs->vec.local));
  PetscCall(MeshSyncNodes(fs->mesh, fs->loc->dim, fs->vec.local));
  PetscCall(FlowDivergence(fs->flow, fs->vec.local, ya));
  for (PetscInt i = 0; i < fs->np; i++) ya[i] *= fs->step.scale;
  PetscCall(VecRestoreArrayRead(x, &xr));
  PetscCall(VecRestoreArrayWrite(y, &ya));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = -P^T B^T x */
static PetscErrorCode mult_gradient(Mat mat, Vec x, Vec y)
{
  FlowSolver       fs;
  const PetscReal *xr;
  PetscReal       *ya;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  PetscCall(VecGetArrayRead(x, &xr));
  PetscCall(VecGetArrayWrite(y, &ya));
  PetscCall(FlowGradient(fs->flow, -1, xr, fs->vec.local));
  PetscCall(PetscArrayzero(ya + fs->nodal, fs->nur - fs->nodal));
  PetscCall(ConstraintReduceInPlace(fs->constraint, fs->vec.local, ya + fs->nodal));
  PetscCall(PetscArraycpy(ya, fs->vec.local, fs->nodal));
  PetscCall(VecRestoreArrayRead(x, &xr));
  PetscCall(VecRestoreArrayWrite(y, &ya));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = C x: compressibility of cells between two constrained surfaces */
static PetscErrorCode mult_shared(Mat mat, Vec x, Vec y)
{
  FlowSolver       fs;
  const PetscInt  *cell;
  const PetscReal *xa, *block;
  PetscReal       *ya;
  PetscInt         n, ncompressible, nk;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  nk = fs->loc->dim + 1;
  PetscCall(PressureGetShared(fs->pressure, &n, &ncompressible, &cell, &block));
  PetscCall(VecSet(y, 0));
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(VecGetArray(y, &ya));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal gap_fraction = i < ncompressible ? FlowSolverGapFraction(fs) : 1;

    for (PetscInt e = 0; e < nk * nk; e++)
      ya[cell[i] * nk + e / nk] += gap_fraction * block[i * nk * nk + e] * xa[cell[i] * nk + e % nk];
  }
  PetscCall(VecRestoreArray(y, &ya));
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What relative slots add to M_r^{-1}: with F = 1 - fraction, M_r^{-1} = diag(weight) + [-F R; 1] M^{-1} [-F R; 1]^T
   for node and body (see bodyblocks.h). Before: rigid -= R^T F x; after: y -= F R U. */
static PetscErrorCode add_relative_rows(FlowSolver fs, PetscBool before, const PetscReal x[], PetscReal y[],
                                        PetscReal rigid[])
{
  const ConstraintView *c  = ConstraintGetView(fs->constraint);
  const PetscInt        nr = fs->nr;

  PetscFunctionBeginUser;
  if (!before) PetscCall(ConstraintFetchRigid(fs->constraint, rigid));
  PetscCall(PetscArrayzero(fs->body.rigid_work, c->nlocal * nr));
  for (PetscInt j = 0; j < c->relative_rows.n; j++) {
    const PetscReal fraction = 1 - fs->body.fraction[c->relative_rows.slot[j] / fs->loc->dim];

    if (fs->solid && SolidBlockHas(fs->solid, c->relative_rows.slot[j] / fs->loc->dim)) continue;
    for (PetscInt s = 0; s < nr; s++) {
      if (before)
        fs->body.rigid_work[c->local_index[c->relative_rows.body[j]] * nr + s] -= fraction *
                                                                                  c->relative_rows.coef[j * nr + s] *
                                                                                  x[c->relative_rows.slot[j]];
      else
        y[c->relative_rows.slot[j]] -= fraction * c->relative_rows.coef[j * nr + s] *
                                       c->local_rigid[c->local_index[c->relative_rows.body[j]] * nr + s];
    }
  }
  if (before) PetscCall(ConstraintDeliverRigid(fs->constraint, fs->body.rigid_work, rigid));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = mass_inverse x of body k, from and to its slots */
static void invert_mass(FlowSolver fs, PetscInt k, const PetscReal x[], PetscReal y[])
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  PetscReal             force[6];

  for (PetscInt s = 0; s < fs->nr; s++) force[s] = x[s] / ConstraintSlotUnit(c, k, s);
  DenseMultiply(fs->nr, fs->body.mass_inverse + k * fs->nr * fs->nr, PETSC_FALSE, force, y);
  for (PetscInt s = 0; s < fs->nr; s++) y[s] /= ConstraintSlotUnit(c, k, s);
}

PetscErrorCode FlowSolverInvertMasses(FlowSolver fs, const PetscReal x[], PetscReal y[])
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  const PetscInt        n = c->count * fs->nr;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(y, n));
  for (PetscInt k = 0; k < c->nown; k++) invert_mass(fs, c->own[k], x + k * fs->nr, y + k * fs->nr);
  PetscCall(ContactCouplingSolveMass(fs->body.contact_coupling, x, y));
  for (PetscInt i = 0; i < n; i++) y[i] /= fs->step.scale;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverApplyMassInverse(FlowSolver fs, Vec x, Vec y)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  const PetscReal      *xr;
  PetscReal            *ya, *t = fs->body.rigid_work + fs->capacity * fs->nr;
  Vec                   from = x;

  PetscFunctionBeginUser;
  if (FlowSolverIsOnDevice(fs)) {
    PetscCall(FlowSolverApplyMassOnDevice(fs, x, y));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(VecGetArrayRead(x, &xr));
  PetscCall(VecGetArray(y, &ya));
  for (PetscInt i = 0; i < fs->nodal; i++) ya[i] = fs->weight[i] / fs->step.scale * xr[i];
  /* the softness of body nodes belongs to S_p only */
  for (PetscInt j = 0; j < c->inert.n; j++) ya[c->inert.slot[j]] = 0;
  PetscCall(PetscArraycpy(t, xr + fs->nodal, c->count * fs->nr));
  if (FlowSolverHasPenalty(fs)) PetscCall(add_relative_rows(fs, PETSC_TRUE, xr, NULL, t));
  if (fs->solid) PetscCall(SolidBlockTakeBodies(fs, x, t, &from));
  PetscCall(FlowSolverInvertMasses(fs, t, ya + fs->nodal));
  PetscCall(VecRestoreArrayRead(x, &xr));
  if (fs->solid) { /* before what bodies add, at nodes of both too: the operator stays symmetric */
    PetscCall(VecRestoreArray(y, &ya));
    PetscCall(SolidBlockSolve(fs->solid, from, y));
    PetscCall(VecGetArray(y, &ya));
  }
  if (FlowSolverHasPenalty(fs)) PetscCall(add_relative_rows(fs, PETSC_FALSE, NULL, ya, ya + fs->nodal));
  PetscCall(VecRestoreArray(y, &ya));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverAddPressureMass(FlowSolver fs, PetscReal factor, Vec r, Vec p)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  const PetscReal   *ra;
  PetscReal         *pa;

  PetscFunctionBeginUser;
  PetscCall(DeviceVecGetRead(q, r, &ra));
  PetscCall(DeviceVecGet(q, p, &pa));
  if (q) PetscCall(FlowPressureMassOnDevice(fs->flow, factor, ra, pa));
  else PetscCall(FlowPressureMassSolve(fs->flow, factor, ra, pa));
  PetscCall(VecRestoreArrayAndMemType(p, &pa));
  PetscCall(VecRestoreArrayReadAndMemType(r, &ra));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y += scale C p of cells that give way */
static void add_volumes(FlowSolver fs, const PetscReal p[], PetscReal y[])
{
  const PetscInt    nk = fs->loc->dim + 1;
  const FlowVolume *v;

  for (PetscInt i = 0; FlowGetVolume(fs->flow, i, &v); i++)
    for (PetscInt e = 0; v->C && e < v->n * nk * nk; e++)
      y[v->cell[e / (nk * nk)] * nk + e % (nk * nk) / nk] += fs->step.scale * v->C[e] *
                                                             p[v->cell[e / (nk * nk)] * nk + e % nk];
}

/* y = K x with balanced rows */
static PetscErrorCode mult_whole(Mat mat, Vec x, Vec y)
{
  FlowSolver         fs;
  const DeviceQueue *q;
  const PetscReal   *xa;
  PetscReal         *ya;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  q = FlowGetQueue(fs->flow);
  PetscCall(DeviceVecGetRead(q, x, &xa));
  PetscCall(DeviceVecGetWrite(q, y, &ya));
  PetscCall(FlowSolverPlaceFields(fs, xa, ya));
  fs->op.outer = PETSC_TRUE;
  PetscCall(MatMult(fs->op.Ar, fs->vec.from[0], fs->vec.to[0]));
  fs->op.outer = PETSC_FALSE;
  PetscCall(MatMult(fs->op.G, fs->vec.from[1], fs->vec.t_u));
  PetscCall(VecAXPY(fs->vec.to[0], 1, fs->vec.t_u));
  PetscCall(MatMult(fs->op.B, fs->vec.from[0], fs->vec.to[1]));
  if (fs->op.C) { /* a shell's MatMultAdd keeps a vector for itself */
    PetscCall(MatMult(fs->op.C, fs->vec.from[1], fs->vec.t_p2));
    PetscCall(VecAXPY(fs->vec.to[1], 1, fs->vec.t_p2));
  }
  add_volumes(fs, xa + fs->nur, ya + fs->nur); /* none on a device */
  PetscCall(VecScale(fs->vec.to[1], fs->step.continuity_scale));
  PetscCall(FlowSolverResetFields(fs));
  PetscCall(VecRestoreArrayWriteAndMemType(y, &ya));
  PetscCall(VecRestoreArrayReadAndMemType(x, &xa));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Which rows a rank has, ranks ask each other once */
static PetscErrorCode create_shell(FlowSolver fs, PetscLayout rows, PetscLayout columns,
                                   PetscErrorCode (*mult)(Mat, Vec, Vec), Mat *mat)
{
  PetscFunctionBeginUser;
  PetscCall(MatCreate(fs->comm, mat));
  PetscCall(MatSetLayouts(*mat, rows, columns));
  PetscCall(MatSetType(*mat, MATSHELL));
  PetscCall(MatShellSetContext(*mat, fs));
  PetscCall(MatSetUp(*mat));
  PetscCall(MatShellSetOperation(*mat, MATOP_MULT, (void (*)(void))mult));
  PetscCall(DeviceVecSetShell(FlowGetQueue(fs->flow), *mat));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverUpdateMatrix(FlowSolver fs)
{
  Mat S;

  PetscFunctionBeginUser;
  if (fs->set.need_Ar || fs->set.need_whole) PetscCall(FlowGetMatrix(fs->flow, &S));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverCreateShells(FlowSolver fs)
{
  Mat         S;
  PetscLayout nodal, u, p, whole;

  PetscFunctionBeginUser;
  PetscCall(VecGetLayout(fs->vec.xn, &nodal));
  PetscCall(VecGetLayout(fs->vec.t_u, &u));
  PetscCall(VecGetLayout(fs->vec.t_p, &p));
  PetscCall(VecGetLayout(fs->vec.x, &whole));
  if (FlowIsMatrixFree(fs->flow) && !fs->set.need_Ar && !fs->set.need_whole) {
    PetscCall(create_shell(fs, nodal, nodal, mult_free, &fs->op.S_all));
  } else {
    PetscCall(FlowGetMatrix(fs->flow, &S));
    PetscCall(MatCreateMAIJ(S, fs->loc->dim, &fs->op.S_all));
  }
  fs->op.A = fs->op.S_all;
  PetscCall(create_shell(fs, u, u, mult_velocity, &fs->op.Ar));
  PetscCall(MatShellSetOperation(fs->op.Ar, MATOP_GET_DIAGONAL, (void (*)(void))diagonal_velocity));
  PetscCall(MatShellSetOperation(fs->op.Ar, MATOP_SOR, (void (*)(void))sor_velocity));
  PetscCall(create_shell(fs, whole, whole, mult_whole, &fs->op.K));
  PetscCall(create_shell(fs, u, p, mult_gradient, &fs->op.G));
  PetscCall(create_shell(fs, p, u, mult_divergence, &fs->op.B));
  if (fs->nbodies) PetscCall(create_shell(fs, p, p, mult_shared, &fs->op.C));
  PetscCall(FlowSolverCreateOnDevice(fs));
  PetscFunctionReturn(PETSC_SUCCESS);
}
