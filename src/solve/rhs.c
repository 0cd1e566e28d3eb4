/* FlowSolver: the right-hand side of the system (see system.h). */
#include "compat.h"
#include "impl.h"

PetscErrorCode FlowSolverAddPrescribedPenalty(FlowSolver fs, const PetscReal c[], PetscReal y[], PetscReal rigid[])
{
  const ConstraintView *P  = ConstraintGetView(fs->constraint);
  const PetscInt        nr = fs->nr, nn = nr * nr;
  PetscReal            *local = fs->body.rigid_work, *U_local = fs->body.rigid_work + fs->capacity * nr;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < P->nbodies; k++)
    for (PetscInt s = 0; s < nr && P->local_index[k] >= 0; s++) {
      U_local[P->local_index[k] * nr + s] = P->U[k * nr + s];
      local[P->local_index[k] * nr + s]   = 0;
    }
  PetscCall(PenaltyTermMultAdd(fs->body.penalty, fs->constraint, PETSC_FALSE, U_local, c, y, local));
  for (PetscInt i = 0; i < P->nlocal * nr; i++) local[i] = -local[i];
  PetscCall(ConstraintDeliverRigid(fs->constraint, local, rigid));
  for (PetscInt e = 0; e < P->nown * nn; e++) {
    const PetscInt k = P->own[e / nn], i = e % nn / nr, j = e % nr;

    if (ConstraintIsUnknown(P, k, i) && !ConstraintIsUnknown(P, k, j))
      rigid[e / nn * nr + i] -= ConstraintSlotUnit(P, k, i) * fs->body.penalty->whole[e] * P->U[k * nr + j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

void FlowSolverTakeLoads(FlowSolver fs, const PetscReal g[], PetscReal rigid[])
{
  const ConstraintView *P = ConstraintGetView(fs->constraint);

  for (PetscInt i = 0; i < P->count * fs->nr; i++) rigid[i] = 0;
  for (PetscInt i = 0; i < P->nown * fs->nr; i++) {
    const PetscInt k = P->own[i / fs->nr], s = i % fs->nr;

    rigid[i] = ConstraintIsUnknown(P, k, s) ? g[k * fs->nr + s] * ConstraintSlotUnit(P, k, s) : 0;
  }
}

/* Sources of continuity: b += scale g, b the rows of own cells */
static void add_sources(FlowSolver fs, PetscReal b[])
{
  const PetscInt    nk = fs->loc->dim + 1;
  const FlowVolume *v;

  for (PetscInt i = 0; FlowGetVolume(fs->flow, i, &v); i++)
    for (PetscInt e = 0; v->g && e < v->n * nk; e++)
      b[v->cell[e / nk] * nk + e % nk] += fs->step.scale * fs->step.continuity_scale * v->g[e];
}

/* Where the pressure has an undetermined constant, the flux of the prescribed velocity c through the boundary, whose
   part of own cells is in the rows b, must vanish but for interpolation and round-off */
static PetscErrorCode measure_net_flux(FlowSolver fs, const PetscReal c[], const PetscReal b[])
{
  const MeshLocal *l    = fs->loc;
  PetscReal        flux = 0, speed = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < fs->np; i += l->dim + 1) flux += b[i] / (fs->step.scale * fs->step.continuity_scale);
  for (PetscInt i = 0; i < fs->nodal; i++) speed = PetscMax(speed, PetscAbsReal(c[i]));
  PetscCall(FlowSolverCheckFlux(fs, flux, speed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverCheckFlux(FlowSolver fs, PetscReal flux, PetscReal speed)
{
  const MeshLocal *l      = fs->loc;
  PetscReal        length = 0;

  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < l->dim; d++) length = PetscMax(length, l->upper[d] - l->lower[d]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &flux, 1, MPIU_REAL, MPIU_SUM, fs->comm));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &speed, 1, MPIU_REAL, MPIU_MAX, fs->comm));
  PetscCheck(PetscAbsReal(flux) <= 1e-3 * speed * PetscPowRealInt(length, l->dim - 1), fs->comm, PETSC_ERR_USER_INPUT,
             "The prescribed velocities let a net volume of %g per time into a domain without outflow: give a boundary -flow_bc_<boundary>_type outflow, or velocities that balance",
             (double)flux);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverBuildRhs(FlowSolver fs, const PetscReal r[], const PetscReal g[])
{
  const ConstraintView *P   = ConstraintGetView(fs->constraint);
  const PetscInt        dim = fs->loc->dim;
  PetscReal            *b, *c = fs->vec.local;
  MatNullSpace          constant;

  PetscFunctionBeginUser;
  PetscCall(VecGetArray(fs->vec.b, &b));
  for (PetscInt i = 0; i < fs->loc->nnode_all; i++)
    for (PetscInt a = 0; a < dim; a++)
      c[i * dim + a] = ConstraintIsFree(P, i) ? 0 : ConstraintGetPrescribed(fs->constraint, i, a);
  PetscCall(VecPlaceArray(fs->vec.xn, c));
  PetscCall(VecPlaceArray(fs->vec.yn, b));
  if (FlowIsMatrixFree(fs->flow))
    PetscCall(FlowMultiply(fs->flow, PETSC_TRUE, c, b)); /* prescribed: nodes of boundaries and of such bodies */
  else PetscCall(MatMult(fs->op.A, fs->vec.xn, fs->vec.yn));
  if (FlowHasOperators(fs->flow)) PetscCall(FlowMultiplyOperators(fs->flow, fs->vec.xn, fs->vec.yn));
  PetscCall(VecResetArray(fs->vec.xn));
  PetscCall(VecResetArray(fs->vec.yn));
  FlowSolverTakeLoads(fs, g, b + fs->nodal);
  if (FlowSolverHasPenalty(fs)) PetscCall(FlowSolverAddPrescribedPenalty(fs, c, b, b + fs->nodal));
  for (PetscInt i = 0; i < fs->nodal; i++) b[i] = r[i] - b[i];
  PetscCall(ConstraintReduceInPlace(fs->constraint, b, b + fs->nodal));
  PetscCall(FlowDivergence(fs->flow, c, b + fs->nur));
  for (PetscInt i = fs->nur; i < fs->nur + fs->np; i++) b[i] *= -fs->step.scale * fs->step.continuity_scale;
  PetscCall(MatGetNullSpace(fs->op.K, &constant));
  if (constant) PetscCall(measure_net_flux(fs, c, b + fs->nur));
  add_sources(fs, b + fs->nur);
  PetscCall(VecRestoreArray(fs->vec.b, &b));
  if (constant) PetscCall(MatNullSpaceRemove(constant, fs->vec.b)); /* what is left of the flux, the sum of sources */
  PetscFunctionReturn(PETSC_SUCCESS);
}
