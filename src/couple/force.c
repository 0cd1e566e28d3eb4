/* Couple, forces: what the flow exerts on the bodies, in both forms; defined in couple.h. */
#include "compat.h"
#include "impl.h"
#include "bodies/local.h"
#include "base/algebra.h"
#include "bodies/mass.h"
#include "flow/device.h"

enum {
  EVERY  = -1,
  NOBODY = -2
};

/* What does not stand in the residuals of cells, on the bodies of this rank: out [n][nr] += the method's own terms, and
   what others give the bodies' nodes (buoyancy by scalars, tension of drops) */
static PetscErrorCode add_given(Couple c, PetscReal out[])
{
  const PetscInt *body, nr = c->nr, dim = c->loc->dim;
  PetscReal      *given;

  PetscFunctionBeginUser;
  if (c->method.terms) PetscCall(PenaltyTermAddForce(c->method.terms, c->constraint, c->field.u, c->rigid.U, out));
  PetscCall(CoupleGetGiven(c, &given));
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  for (PetscInt i = 0; i < c->loc->nnode_all && given; i++) {
    PetscReal R[18];

    if (body[i] < 0) continue;
    PetscCall(ConstraintRigidMap(c->constraint, i, body[i], R));
    for (PetscInt s = 0; s < nr; s++)
      for (PetscInt a = 0; a < dim; a++) out[body[i] * nr + s] += R[a * nr + s] * given[i * dim + a];
  }
  PetscCall(PetscFree(given));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* -sum over the body's nodes of R^T (momentum residual), and what add_given adds, for all bodies: out [n][nr] */
static PetscErrorCode sum_residuals(Couple c, PetscReal out[])
{
  const MeshLocal *l = c->loc;
  const PetscInt  *body, *touched, nr = c->nr, dim = l->dim;
  PetscInt         ntouched;
  PetscReal        several[FLOW_CELLS * MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  PetscCall(IndicatorGetCells(c->indicator, &ntouched, &touched));
  PetscCall(PetscArrayzero(out, c->s->n * nr));
  for (PetscInt t = 0; t < ntouched; t++) {
    const PetscInt  *node = l->cell_node + touched[t] * l->nb;
    const PetscReal *r    = several + t % FLOW_CELLS * l->nb * dim;
    PetscReal        R[18];

    if (t % FLOW_CELLS == 0)
      PetscCall(
        FlowCellResiduals(c->flow, PetscMin(FLOW_CELLS, ntouched - t), touched + t, c->field.u, c->field.p, several));
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt k = body[node[j]];

      if (k < 0) continue;
      PetscCall(ConstraintRigidMap(c->constraint, node[j], k, R));
      for (PetscInt s = 0; s < nr; s++)
        for (PetscInt a = 0; a < dim; a++) out[k * nr + s] -= R[a * nr + s] * r[j * dim + a];
    }
  }
  PetscCall(add_given(c, out));
  PetscCall(BodiesSumLocal(c->bodies, nr, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is a velocity of body k prescribed? */
static PetscBool is_prescribed(Couple c, PetscInt k)
{
  return (PetscBool)(c->rigid.unknown[k] != (1 << c->nr) - 1);
}

/* Nodes of such bodies in touched cells: the cells [n], and as points of these (FlowListCreate) [cells n][nb] */
static PetscErrorCode list_points(Couple c, PetscInt *ncell, PetscInt cell[], PetscInt *npoint, PetscInt point[])
{
  const PetscInt *body, *touched, nb = c->loc->nb;
  PetscInt        ntouched;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  PetscCall(IndicatorGetCells(c->indicator, &ntouched, &touched));
  *ncell = *npoint = 0;
  for (PetscInt t = 0; t < ntouched; t++) {
    const PetscInt before = *npoint;

    for (PetscInt j = 0; j < nb; j++) {
      const PetscInt k = body[c->loc->cell_node[touched[t] * nb + j]];

      if (k >= 0 && is_prescribed(c, k)) point[(*npoint)++] = *ncell * nb + j;
    }
    if (*npoint > before) cell[(*ncell)++] = touched[t];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* u of a device at the nodes that a penalty ties to such bodies */
static PetscErrorCode fetch_entries(Couple c)
{
  const PenaltyTerm *s = c->method.terms;
  FlowDeviceStep     step;
  PetscInt           n = 0, *node;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(s->n, &node));
  for (PetscInt e = 0; e < s->n; e++)
    if (is_prescribed(c, s->body[e])) node[n++] = s->node[e];
  PetscCall(FlowGetStepOnDevice(c->flow, &step));
  PetscCall(FlowFetchRows(c->flow, n, c->loc->dim, node, step.u, c->field.u));
  PetscCall(PetscFree(node));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* sum_residuals where fields stay on a device, of bodies with a prescribed velocity: what others have is not asked for
   */
static PetscErrorCode sum_residuals_on_device(Couple c, PetscReal out[])
{
  const PetscInt *body, nr = c->nr, dim = c->loc->dim, nb = c->loc->nb;
  PetscInt        ntouched, ncell = 0, npoint = 0, *cell, *point;
  PetscReal      *r;
  FlowDeviceList  list = NULL;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  PetscCall(IndicatorGetCells(c->indicator, &ntouched, NULL));
  PetscCall(PetscArrayzero(out, c->s->n * nr));
  PetscCall(PetscMalloc2(ntouched, &cell, ntouched * nb, &point));
  PetscCall(list_points(c, &ncell, cell, &npoint, point));
  PetscCall(PetscMalloc1(npoint * dim, &r));
  if (ncell > 0) {
    PetscCall(FlowListCreate(c->flow, 0, NULL, ncell, cell, npoint, point, &list));
    PetscCall(FlowListTake(c->flow, list, c->field.u, c->field.p, r));
    PetscCall(FlowListDestroy(c->flow, &list));
  }
  for (PetscInt i = 0; i < npoint; i++) {
    const PetscInt node = c->loc->cell_node[cell[point[i] / nb] * nb + point[i] % nb], k = body[node];
    PetscReal      R[18];

    PetscCall(ConstraintRigidMap(c->constraint, node, k, R));
    for (PetscInt s = 0; s < nr; s++)
      for (PetscInt a = 0; a < dim; a++) out[k * nr + s] -= R[a * nr + s] * r[i * dim + a];
  }
  PetscCall(PetscFree(r));
  PetscCall(PetscFree2(cell, point));
  PetscCall(fetch_entries(c));
  PetscCall(add_given(c, out));
  PetscCall(BodiesSumLocal(c->bodies, nr, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* int alpha_k f over the fluid, added to force and torque [n][3] before they are summed over ranks */
static PetscErrorCode add_volume_force(Couple c, PetscInt only, PetscReal (*force)[3], PetscReal (*torque)[3])
{
  const PetscReal *m, *source;
  const PetscInt  *body, *node, dim = c->loc->dim;
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(c->flow, &m));
  PetscCall(FlowGetSource(c->flow, &source));
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  PetscCall(IndicatorGetNodes(c->indicator, NULL, &n, &node));
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt k = body[node[e]];
    PetscReal      R[18];

    if (k < 0 || node[e] >= c->loc->nnode || (only != EVERY && k != only)) continue;
    ConstraintRigidAt(c->loc, node[e], c->rigid.X[k], R);
    for (PetscInt a = 0; a < dim; a++) {
      const PetscReal load = m[node[e]] * (c->par->force[a] + (source ? source[node[e] * dim + a] : 0));

      force[k][a] += load;
      for (PetscInt i = dim; i < c->nr; i++)
        *RigidComponent(c->loc->dim, force[k], torque[k], i) += R[a * c->nr + i] * load;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Force and torque about the centre, of generalised forces on the rigid slots: added */
static PetscErrorCode add_slots(Couple c, PetscInt k, const PetscReal f[], PetscReal force[3], PetscReal torque[3])
{
  PetscReal F[3] = {0}, T[3] = {0}, arm[3], moment[3];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->nr; i++) *RigidComponent(c->loc->dim, F, T, i) = f[i];
  PetscCall(BodiesGetArm(c->bodies, k, c->rigid.q[k], arm));
  cross(arm, F, moment);
  for (PetscInt a = 0; a < 3; a++) {
    force[a] += F[a];
    torque[a] += T[a] - moment[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the stress does not hold, added to force and torque [n][3] before they are summed. The penalty in cells that the
   surface cuts: alpha_k is one at the nodes held whole alone, well inside of the body, and the stress there is the
   smaller part. */
static PetscErrorCode add_other_force(Couple c, PetscInt only, PetscReal (*force)[3], PetscReal (*torque)[3])
{
  PetscReal *other;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(c->s->n * c->nr, &other));
  PetscCall(add_given(c, other));
  for (PetscInt k = 0; k < c->s->n; k++)
    if (only == EVERY || k == only) PetscCall(add_slots(c, k, other + k * c->nr, force[k], torque[k]));
  PetscCall(PetscFree(other));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The volume integral -int (sigma . grad alpha_k - alpha_k f) of all bodies (only = EVERY), of one or of none that this
   rank knows (NOBODY), with what the penalty holds, and f where there is no fluid inside: force and torque [n][3] */
static PetscErrorCode integrate_stress(Couple c, PetscInt only, PetscReal (*force)[3], PetscReal (*torque)[3])
{
  const MeshLocal *l = c->loc;
  const PetscInt  *body, *touched;
  PetscInt         ntouched;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  PetscCall(IndicatorGetCells(c->indicator, &ntouched, &touched));
  PetscCall(PetscMemzero(force, c->s->n * sizeof(*force)));
  PetscCall(PetscMemzero(torque, c->s->n * sizeof(*torque)));
  for (PetscInt t = 0; t < ntouched; t++) {
    const PetscInt *node = l->cell_node + touched[t] * l->nb;

    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt k = body[node[j]];
      PetscReal      alpha[MESH_MAX_NB];
      PetscBool      first = PETSC_TRUE, whole = PETSC_TRUE;

      if (k < 0 || (only != EVERY && k != only)) continue;
      for (PetscInt m = 0; m < l->nb; m++) {
        alpha[m] = body[node[m]] == k;
        if (m < j && alpha[m] > 0) first = PETSC_FALSE;
        if (alpha[m] == 0) whole = PETSC_FALSE;
      }
      if (first && !whole)
        PetscCall(
          FlowCellStressForce(c->flow, touched[t], c->field.u, c->field.p, alpha, c->rigid.X[k], force[k], torque[k]));
    }
  }
  PetscCall(add_volume_force(c, only, force, torque));
  PetscCall(add_other_force(c, only, force, torque));
  PetscCall(BodiesSumLocal(c->bodies, 3, (PetscReal *)force));
  PetscCall(BodiesSumLocal(c->bodies, 3, (PetscReal *)torque));
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal inside[6];

    PetscCall(RigidInteriorForce(c, k, inside));
    for (PetscInt a = 0; a < l->dim && (only == EVERY || k == only); a++) force[k][a] += inside[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Residual-form force of body k on its rigid slots (torque about its reference point): own equation where the
   velocity was unknown, nodal residual plus inertia of the fluid inside otherwise */
static PetscErrorCode residual_force(Couple c, PetscInt k, PetscReal out[])
{
  const PetscInt  nr    = c->nr;
  const PetscReal rho_s = c->s->density[k];
  PetscReal       M[36], K[36], momentum[6], extra[3], inside[6], rho_i, spin;

  PetscFunctionBeginUser;
  PetscCall(RigidGetMass(c->bodies, k, c->rigid.q[k], M));
  rho_i = CoupleInnerDensity(c, k);
  PetscCall(RigidInteriorForce(c, k, inside));
  PetscCall(RigidGradientFormTorque(c, k, &spin));
  (void)CoupleConstrainAxes(c, k, M, K);
  PetscCall(RigidCentripetal(c->bodies, k, c->rigid.q[k], c->rigid.U + k * c->nr + c->loc->dim, extra));
  PetscCall(CoupleHistory(c, k, M, c->rigid.U_old + k * nr, c->rigid.U_older + k * nr, momentum));
  for (PetscInt i = 0; i < nr; i++) {
    PetscReal inertia = inside[i] + (i < c->loc->dim ? rho_i * M[0] * extra[i] : 0) - rho_i * momentum[i], excess = 0;

    for (PetscInt j = 0; j < nr; j++) {
      inertia += rho_i * M[i * nr + j] * c->step->ct * c->rigid.U[k * nr + j];
      if ((c->rigid.unknown[k] >> j) & 1)
        excess += (c->step->ct * (rho_s - rho_i) * M[i * nr + j] + K[i * nr + j]) * c->rigid.U[k * nr + j];
      if (c->rigid.joint && ((c->rigid.unknown[k] >> j) & 1))
        excess += c->rigid.joint[k * nr * (nr + 1) + i * nr + j] * c->rigid.U[k * nr + j];
    }
    /* rows of the solved system: R^T residual = g - D U = g - excess */
    out[i] = inertia +
             ((c->rigid.unknown[k] >> i) & 1 ? excess - c->rigid.g[k * nr + i] : c->rigid.residual[k * nr + i]);
    if (c->rigid.slip) out[i] -= c->rigid.slip[k * nr + i];
    if (i >= c->loc->dim && spin > 0)
      out[i] -= spin * ((c->rigid.unknown[k] >> i) & 1 ? (1 - c->step->theta) * c->rigid.U_old[k * nr + i]
                                                       : c->step->theta * c->rigid.U[k * nr + i] +
                                                           (1 - c->step->theta) * c->rigid.U_old[k * nr + i]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode store_force(Couple c, PetscInt k, const PetscReal f[], PetscReal (*force)[3],
                                  PetscReal (*torque)[3])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(force[k], 3));
  PetscCall(PetscArrayzero(torque[k], 3));
  PetscCall(add_slots(c, k, f, force[k], torque[k]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleForceOnBodies(Couple c)
{
  PetscBool prescribed = PETSC_FALSE;
  PetscReal(*force)[3], (*torque)[3];

  PetscFunctionBeginUser;
  PetscCall(BodiesWriteForces(c->bodies, &force, &torque));
  for (PetscInt k = 0; k < c->s->n; k++) prescribed = (PetscBool)(prescribed || is_prescribed(c, k));
  PetscCall(BodiesAny(c->bodies, &prescribed));
  if (c->force_form == FORCE_VOLUME) {
    PetscCall(integrate_stress(c, EVERY, force, torque));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (prescribed && FlowStaysOnDevice(c->flow)) PetscCall(sum_residuals_on_device(c, c->rigid.residual));
  else if (prescribed) PetscCall(sum_residuals(c, c->rigid.residual));
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal f[6];

    PetscCall(residual_force(c, k, f));
    PetscCall(store_force(c, k, f, force, torque));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleForceForms(Couple c, PetscInt number, PetscReal force[3], PetscReal residual[6],
                                PetscReal volume[6])
{
  const PetscInt local = BodiesFind(c->s, number), k = BodiesFindOwn(c->s, number);
  PetscReal(*f)[3], (*torque)[3], *given, slots[6], out[15] = {0}; /* of the owner */

  PetscFunctionBeginUser;
  PetscCall(FlowTakeSolution(c->flow, c->field.u, c->field.p));
  PetscCall(PetscMalloc2(c->s->n, &f, c->s->n, &torque));
  PetscCall(CoupleGetGiven(c, &given));
  PetscCall(integrate_stress(c, local >= 0 ? local : NOBODY, f, torque));
  PetscCall(FittedForce(c->fitted, c->field.u, c->field.p, given, NULL, NULL, f, torque));
  for (PetscInt a = 0; a < 3 && k >= 0; a++) {
    out[a]      = c->s->force[k][a];
    out[9 + a]  = f[k][a];
    out[12 + a] = torque[k][a];
  }
  PetscCall(sum_residuals(c, c->rigid.residual));
  if (k >= 0) PetscCall(residual_force(c, k, slots));
  if (k >= 0) PetscCall(store_force(c, k, slots, f, torque));
  PetscCall(FittedForce(c->fitted, c->field.u, c->field.p, given, f, torque, NULL, NULL));
  for (PetscInt a = 0; a < 3 && k >= 0; a++) {
    out[3 + a] = f[k][a];
    out[6 + a] = torque[k][a];
  }
  PetscCall(BodiesSum(c->bodies, 15, out));
  if (force) PetscCall(PetscArraycpy(force, out, 3));
  PetscCall(PetscArraycpy(residual, out + 3, 6));
  PetscCall(PetscArraycpy(volume, out + 9, 6));
  if (c->loc->dim == 2) residual[2] = residual[3] = residual[4] = 0;
  PetscCall(PetscFree2(f, torque));
  PetscCall(PetscFree(given));
  PetscFunctionReturn(PETSC_SUCCESS);
}
