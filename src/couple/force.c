/* Couple, forces: what the flow exerts on the bodies in both forms, balance of momentum; defined in couple.h. */
#include "compat.h"
#include "impl.h"
#include "bodies/local.h"
#include "base/algebra.h"
#include "base/log.h"
#include "bodies/mass.h"

enum {
  EVERY  = -1,
  NOBODY = -2
};

PetscErrorCode CoupleSpinStress(Couple c, PetscInt k, const FlowParameters *par, PetscReal *coefficient)
{
  PetscFunctionBeginUser;
  *coefficient = 0;
  if (!c->hollow || !c->hollow[k] || FlowHasSymmetricStress(c->flow)) PetscFunctionReturn(PETSC_SUCCESS); /* symmetric form: none */
  PetscCall(BodiesGetVolume(c->bodies, k, coefficient));
  *coefficient *= 2 * par->solvent;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleDeadForce(Couple c, PetscInt k, const FlowParameters *par, PetscReal out[])
{
  const PetscReal none[3] = {0, 0, 0};
  PetscReal       volume, force[3];

  PetscFunctionBeginUser;
  (void)par;
  PetscCall(PetscArrayzero(out, c->nr));
  if (!c->hollow || !c->hollow[k]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesGetVolume(c->bodies, k, &volume));
  PetscCall(FlowForceAt(c->flow, c->X[k], force)); /* one that varies: that at the centre */
  for (PetscInt a = 0; a < 3; a++) force[a] *= volume;
  PetscCall(RigidReduceForce(c->bodies, k, c->q[k], force, none, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleHollowWeights(Couple c, PetscInt k, PetscReal weight[3][6])
{
  const PetscReal none[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(weight[0], 18));
  if (!c->hollow || !c->hollow[k] || c->s->gone[k]) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < c->loc->dim; a++) {
    PetscReal force[3] = {0, 0, 0};

    force[a] = BodiesVolume(c->s, k);
    PetscCall(RigidReduceForce(c->bodies, k, c->q[k], force, none, weight[a]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- forces ---- */

/* -sum over the body's nodes of R^T (momentum residual), and the rung's own terms, for all bodies: out [n][nr] */
static PetscErrorCode sum_residuals(Couple c, PetscReal out[])
{
  const MeshLocal *l = c->loc;
  const PetscInt  *body, *touched, nr = c->nr, dim = l->dim;
  PetscInt         ntouched;
  PetscReal        several[FLOW_CELLS * MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  PetscCall(IndicatorGetCells(c->mark, &ntouched, &touched));
  PetscCall(PetscArrayzero(out, c->s->n * nr));
  for (PetscInt t = 0; t < ntouched; t++) {
    const PetscInt  *node = l->cell_node + touched[t] * l->nb;
    const PetscReal *r    = several + t % FLOW_CELLS * l->nb * dim;
    PetscReal        R[18];

    if (t % FLOW_CELLS == 0) PetscCall(FlowCellResiduals(c->flow, PetscMin(FLOW_CELLS, ntouched - t), touched + t, c->u, c->p, several));
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt k = body[node[j]];

      if (k < 0) continue;
      PetscCall(ConstraintRigidMap(c->constraint, node[j], k, R));
      for (PetscInt s = 0; s < nr; s++)
        for (PetscInt a = 0; a < dim; a++) out[k * nr + s] -= R[a * nr + s] * r[j * dim + a];
    }
  }
  if (c->terms) PetscCall(PenaltyTermAddForce(c->terms, c->constraint, c->u, c->U, out));
  PetscCall(BodiesSumKnown(c->bodies, nr, out));
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
  PetscCall(IndicatorGetNodes(c->mark, NULL, &n, &node));
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt k = body[node[e]];
    PetscReal      R[18];

    if (k < 0 || node[e] >= c->loc->nnode || (only != EVERY && k != only)) continue;
    ConstraintRigidAt(c->loc, node[e], c->X[k], R);
    for (PetscInt a = 0; a < dim; a++) {
      const PetscReal share = m[node[e]] * (c->par->force[a] + (source ? source[node[e] * dim + a] : 0));

      force[k][a] += share;
      for (PetscInt i = dim; i < c->nr; i++) *CoupleRigidComponent(c, force, torque, k, i) += R[a * c->nr + i] * share;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Force and torque about the centre, of generalised forces on the rigid slots: added */
static PetscErrorCode add_slots(Couple c, PetscInt k, const PetscReal f[], PetscReal force[3], PetscReal torque[3])
{
  PetscReal part[2][1][3] = {{{0}}}, arm[3], moment[3];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->nr; i++) *CoupleRigidComponent(c, part[0], part[1], 0, i) = f[i];
  PetscCall(BodiesGetArm(c->bodies, k, c->q[k], arm));
  cross(arm, part[0][0], moment);
  for (PetscInt a = 0; a < 3; a++) {
    force[a] += part[0][0][a];
    torque[a] += part[1][0][a] - moment[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the penalty holds in cells that the surface cuts: alpha_k is one at the nodes held whole alone, well inside of
   the body, and the stress there is the smaller part. Added to force and torque [n][3] before they are summed. */
static PetscErrorCode add_penalty_force(Couple c, PetscInt only, PetscReal (*force)[3], PetscReal (*torque)[3])
{
  PetscReal *held;

  PetscFunctionBeginUser;
  if (!c->terms) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(c->s->n * c->nr, &held));
  PetscCall(PenaltyTermAddForce(c->terms, c->constraint, c->u, c->U, held));
  for (PetscInt k = 0; k < c->s->n; k++)
    if (only == EVERY || k == only) PetscCall(add_slots(c, k, held + k * c->nr, force[k], torque[k]));
  PetscCall(PetscFree(held));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The volume integral -int (sigma . grad alpha_k - alpha_k f) of all bodies (only = EVERY), of one or of none that this
   rank knows (NOBODY), with what the penalty holds, and f on dead insides: force and torque [n][3] */
static PetscErrorCode integrate_stress(Couple c, PetscInt only, PetscReal (*force)[3], PetscReal (*torque)[3])
{
  const MeshLocal *l = c->loc;
  const PetscInt  *body, *touched;
  PetscInt         ntouched;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  PetscCall(IndicatorGetCells(c->mark, &ntouched, &touched));
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
      if (first && !whole) PetscCall(FlowCellStressForce(c->flow, touched[t], c->u, c->p, alpha, c->X[k], force[k], torque[k]));
    }
  }
  PetscCall(add_volume_force(c, only, force, torque));
  PetscCall(add_penalty_force(c, only, force, torque));
  PetscCall(BodiesSumKnown(c->bodies, 3, (PetscReal *)force));
  PetscCall(BodiesSumKnown(c->bodies, 3, (PetscReal *)torque));
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal dead[6];

    PetscCall(CoupleDeadForce(c, k, c->par, dead));
    for (PetscInt a = 0; a < l->dim && (only == EVERY || k == only); a++) force[k][a] += dead[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Residual-form force of body k on its rigid slots (torque about its reference point): own equation where the
   velocity was unknown, nodal residual plus inertia of the fluid inside otherwise */
static PetscErrorCode residual_force(Couple c, PetscInt k, PetscReal out[])
{
  const PetscInt  nr    = c->nr;
  const PetscReal rho_s = c->s->density[k];
  PetscReal       M[36], K[36], momentum[6], extra[3], dead[6], rho_i, spin;

  PetscFunctionBeginUser;
  PetscCall(RigidGetMass(c->bodies, k, c->q[k], M));
  rho_i = CoupleInnerDensity(c, k, c->par);
  PetscCall(CoupleDeadForce(c, k, c->par, dead));
  PetscCall(CoupleSpinStress(c, k, c->par, &spin));
  (void)CoupleHoldAxes(c, k, M, K);
  PetscCall(RigidCentripetal(c->bodies, k, c->q[k], c->U + k * c->nr + c->loc->dim, extra));
  PetscCall(CoupleHistory(c, k, M, c->U_old + k * nr, c->U_older + k * nr, momentum));
  for (PetscInt i = 0; i < nr; i++) {
    PetscReal inertia = dead[i] + (i < c->loc->dim ? rho_i * M[0] * extra[i] : 0) - rho_i * momentum[i], excess = 0;

    for (PetscInt j = 0; j < nr; j++) {
      inertia += rho_i * M[i * nr + j] * c->step->ct * c->U[k * nr + j];
      if ((c->unknown[k] >> j) & 1) excess += (c->step->ct * (rho_s - rho_i) * M[i * nr + j] + K[i * nr + j]) * c->U[k * nr + j];
      if (c->joint && ((c->unknown[k] >> j) & 1)) excess += c->joint[k * nr * (nr + 1) + i * nr + j] * c->U[k * nr + j];
    }
    /* rows of the solved system: R^T residual = g - D U = g - excess */
    out[i] = inertia + ((c->unknown[k] >> i) & 1 ? excess - c->g[k * nr + i] : c->residual[k * nr + i]);
    if (i >= c->loc->dim && spin > 0)
      out[i] -= spin * ((c->unknown[k] >> i) & 1 ? (1 - c->step->theta) * c->U_old[k * nr + i]
                                                 : c->step->theta * c->U[k * nr + i] + (1 - c->step->theta) * c->U_old[k * nr + i]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode store_force(Couple c, PetscInt k, const PetscReal f[], PetscReal (*force)[3], PetscReal (*torque)[3])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(force[k], 3));
  PetscCall(PetscArrayzero(torque[k], 3));
  PetscCall(add_slots(c, k, f, force[k], torque[k]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleForce(Couple c)
{
  PetscBool known = PETSC_FALSE;
  PetscReal(*force)[3], (*torque)[3];

  PetscFunctionBeginUser;
  if (!c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_FORCE, 0, 0, 0, 0));
  PetscCall(BodiesWriteForces(c->bodies, &force, &torque));
  for (PetscInt k = 0; k < c->s->n; k++) known = (PetscBool)(known || c->unknown[k] != (1 << c->nr) - 1);
  PetscCall(BodiesAny(c->bodies, &known));
  if (c->use_volume) {
    PetscCall(integrate_stress(c, EVERY, force, torque));
    PetscCall(FittedForce(c->hole, c->u, c->p, NULL, NULL, force, torque));
  } else {
    if (known) PetscCall(sum_residuals(c, c->residual));
    for (PetscInt k = 0; k < c->s->n; k++) {
      PetscReal f[6];

      PetscCall(residual_force(c, k, f));
      PetscCall(store_force(c, k, f, force, torque));
    }
    PetscCall(FittedForce(c->hole, c->u, c->p, force, torque, NULL, NULL));
  }
  PetscCall(PetscLogEventEnd(TB_FORCE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleForceForms(Couple c, PetscInt number, PetscReal force[3], PetscReal residual[6], PetscReal volume[6])
{
  const PetscInt known = BodiesFind(c->s, number), k = BodiesFindOwn(c->s, number);
  PetscReal(*f)[3], (*torque)[3], slots[6], out[15] = {0}; /* of the owner */

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(c->s->n, &f, c->s->n, &torque));
  PetscCall(integrate_stress(c, known >= 0 ? known : NOBODY, f, torque));
  PetscCall(FittedForce(c->hole, c->u, c->p, NULL, NULL, f, torque));
  for (PetscInt a = 0; a < 3 && k >= 0; a++) {
    out[a]      = c->s->force[k][a];
    out[9 + a]  = f[k][a];
    out[12 + a] = torque[k][a];
  }
  PetscCall(sum_residuals(c, c->residual));
  if (k >= 0) PetscCall(residual_force(c, k, slots));
  if (k >= 0) PetscCall(store_force(c, k, slots, f, torque));
  PetscCall(FittedForce(c->hole, c->u, c->p, f, torque, NULL, NULL));
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
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- momentum ---- */

/* What prescribed components supply: sums of the momentum residual over walls and over openings (holes are bodies
   and left out, as are nodes that belong to a body), and *size, the sum of the sizes, by which errors are measured (in
   a closed box the forces of the walls cancel); kept for CoupleGetPower the power of all of them, holes too */
static PetscErrorCode sum_prescribed(Couple c, PetscReal walls[3], PetscReal openings[3], PetscReal *size)
{
  const PetscInt       dim = c->loc->dim, nr = c->loc->nb * dim, *cell, *body;
  const unsigned char *fixed;
  const BoundaryPlace *place;
  PetscInt             ncell, n, done = 0;
  PetscReal            sum[8] = {0}, several[FLOW_CELLS * MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  if (c->follow || c->sides_move) PetscCall(BoundariesUpdate(c->boundaries));
  PetscCall(BoundariesBegin(c->boundaries));
  PetscCall(BoundariesGetPlaces(c->boundaries, &ncell, &cell, &n, &place));
  for (const BoundaryPlace *at = place; at < place + n; at++) {
    const PetscReal *u = c->u + at->node * dim, *r = several + at->cell % FLOW_CELLS * nr + at->slot * dim;

    if (at->cell == done) {
      PetscCall(FlowCellResiduals(c->flow, PetscMin(FLOW_CELLS, ncell - done), cell + done, c->u, c->p, several));
      done += FLOW_CELLS;
    }
    if (body[at->node] >= 0) continue;
    if (!at->hole) PetscCall(BoundariesAdd(c->boundaries, at, r, c->p));
    for (PetscInt a = 0; a < dim; a++) {
      if (at->owner[a] < 0) continue;
      sum[7] += r[a] * u[a];
      if (at->hole) continue;
      sum[((at->wall >> a) & 1 ? 0 : 3) + a] += r[a];
      sum[6] += PetscAbsReal(r[a]);
    }
  }
  if (c->rung->force) {
    PetscCall(ConditionsGetValues(FlowConditions(c->flow), &fixed, NULL));
    PetscCall((*c->rung->force)(c, c->rung_data, fixed, sum));
  }
  PetscCall(BoundariesFinish(c->boundaries, c->u));
  c->supplied = sum[7];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 7, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscCall(PetscArraycpy(walls, sum, 3));
  PetscCall(PetscArraycpy(openings, sum + 3, 3));
  *size = sum[6];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleBodyPush(Couple c, PetscInt k, PetscReal inertia[3], PetscReal push[3])
{
  const PetscReal inside = BodiesGetGroup(c->s, k)->hole ? 0 : CoupleInnerDensity(c, k, c->par);
  PetscReal       M[36], extra[3], dead[6];

  PetscFunctionBeginUser;
  PetscCall(CoupleDeadForce(c, k, c->par, dead));
  PetscCall(RigidGetMass(c->bodies, k, c->q[k], M));
  PetscCall(RigidCentripetal(c->bodies, k, c->q[k], c->U + k * c->nr + c->loc->dim, extra));
  for (PetscInt a = 0; a < c->loc->dim; a++) {
    inertia[a] = M[0] * extra[a];
    for (PetscInt j = 0; j < c->nr; j++)
      inertia[a] += M[a * c->nr + j] *
                    (c->step->ct * c->U[k * c->nr + j] - c->step->d0 * c->U_old[k * c->nr + j] - c->step->d1 * c->U_older[k * c->nr + j]);
    push[a] = inside * inertia[a] + dead[a] - c->s->force[k][a]; /* -F + inertia of the fluid inside */
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Forces of the bodies on the fluid; adds their sizes to *size */
static PetscErrorCode sum_bodies(Couple c, PetscReal out[3], PetscReal *size)
{
  PetscReal sum[4] = {0, 0, 0, CoupleCountsFirst(c) ? *size : 0};

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal inertia[3], push[3];

    if (!c->s->own[k]) continue;
    PetscCall(CoupleBodyPush(c, k, inertia, push));
    for (PetscInt a = 0; a < c->loc->dim; a++) {
      sum[a] += push[a];
      sum[3] += PetscAbsReal(c->s->force[k][a]);
    }
  }
  PetscCall(BodiesSum(c->bodies, 4, sum));
  PetscCall(PetscArraycpy(out, sum, 3));
  *size = sum[3];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mean velocity of fluid and bodies */
static PetscErrorCode take_mean(Couple c, const FlowDiagnostics *d, PetscReal mean[3])
{
  PetscReal inside[4] = {0, 0, 0, 0}; /* of hollow bodies: velocity over volume, volume */

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal weight[3][6];

    if (!c->hollow || !c->hollow[k] || !c->s->own[k] || c->s->gone[k]) continue; /* else u inside is the body's */
    inside[3] += BodiesVolume(c->s, k);
    PetscCall(CoupleHollowWeights(c, k, weight));
    for (PetscInt a = 0; a < c->loc->dim; a++)
      for (PetscInt j = 0; j < c->nr; j++) inside[a] += weight[a][j] * c->U[k * c->nr + j];
  }
  PetscCall(BodiesSum(c->bodies, 4, inside));
  for (PetscInt a = 0; a < 3; a++) mean[a] = (d->velocity[a] + inside[a]) / (d->volume + inside[3]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleMomentum(Couple c, const FlowDiagnostics *d, CoupleBalance *b)
{
  PetscReal size = 0, diff = 0, rest[3];

  PetscFunctionBeginUser;
  PetscCall(sum_prescribed(c, b->walls, b->openings, &size));
  PetscCall(sum_bodies(c, b->bodies, &size));
  PetscCall(take_mean(c, d, b->mean));
  for (PetscInt a = 0; a < 3; a++) {
    const PetscReal rate = d->change[a] + d->flux[a] - d->driven[a] - d->traction[a];

    size += PetscAbsReal(rate);
    rest[a]      = rate - b->walls[a] - b->openings[a] - b->bodies[a];
    diff         = PetscMax(diff, PetscAbsReal(rest[a]));
    b->fluid[a]  = d->change[a];
    b->volume[a] = d->driven[a];
    b->openings[a] += d->traction[a] - d->flux[a];
  }
  b->size  = size;
  b->error = size > 0 ? diff / size : 0;
  PetscCall(CoupleMeasureDriving(c, d, rest, b));
  if (c->drive) PetscCall(DriveMeasure(c->drive, b));
  PetscFunctionReturn(PETSC_SUCCESS);
}
