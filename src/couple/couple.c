/* Couple: see couple.h for the method.

   The step with implicit coupling, in the order of the calls: bodies drawn at X* (CoupleDraw); one linear system for
   flow and rigid velocities (CoupleSolve); force from the bodies' own equation, F = rho_s Vol (c_t U - d(U)) - G,
   without an integral (CoupleForce); positions (CoupleAdvance). With explicit coupling (explicit.c), and for degrees
   of freedom that are frozen, the velocity is known, and the force is minus the momentum residual summed over the
   body's nodes, plus the inertia of the fictitious fluid inside. The work a body causes is proportional to the cells
   it touches. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "bodies/mass.h"

#define SURE 3 /* steps before the residual of the last one says something */

static const char *const TYPES[]  = {"implicit", "explicit", NULL};
static const char *const FORCES[] = {"residual", "volume", NULL};

static PetscBool is_free(Couple c, PetscInt k, PetscInt s)
{
  return BodiesIsFree(c->bodies, k, s < c->loc->dim ? s : 3);
}

void CoupleGetHistory(Couple c, PetscInt k, PetscInt i, PetscReal *now, PetscReal *old)
{
  const PetscBool kept = (PetscBool)(i < c->loc->dim && BodiesGetGroup(c->s, k)->motion.has_pivot);

  *now = kept ? c->U_old[k * c->nr + i] : CoupleRigidValue(c, c->s->u, c->s->w, k, i);
  *old = kept ? c->U_older[k * c->nr + i] : CoupleRigidValue(c, c->s->u_old, c->s->w_old, k, i);
}

/* ---- drawing ---- */

/* With explicit coupling, what is free is drawn where it is, and the prescribed part where it will be: prescribed
   bodies are the same under both couplings. */
static PetscErrorCode place_bodies(Couple c, PetscBool *drawn)
{
  PetscReal angle, arm[3];

  PetscFunctionBeginUser;
  PetscCall(BodiesSetTime(c->bodies, c->step->time - c->step->dt));
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscCall(BodiesPredict(c->bodies, k, c->step->dt, c->implicit ? c->step->order : 0, c->X[k], c->q[k], &angle));
    PetscCall(BodiesGetArm(c->bodies, k, c->q[k], arm));
    for (PetscInt a = 0; a < 3; a++) c->P[k][a] = c->X[k][a] - arm[a];
  }
  PetscCall(IndicatorIsCurrent(c->mark, c->X, c->q, c->step->ct, drawn)); /* the strength of a penalty goes by c_t */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Which rigid velocities are unknown; values of the others, and first guesses */
static PetscErrorCode set_rigid_velocities(Couple c)
{
  PetscReal ratio;

  PetscFunctionBeginUser;
  ratio = c->step->dt_old > 0 ? c->step->dt / c->step->dt_old : 0;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal u[1][3], w[1][3];

    PetscCall(BodiesGetKnownVelocity(c->bodies, k, c->step->time, u[0], w[0]));
    c->unknown[k] = 0;
    for (PetscInt i = 0; i < c->nr; i++) {
      PetscReal now, old;

      CoupleGetHistory(c, k, i, &now, &old);
      if (c->implicit && is_free(c, k, i)) c->unknown[k] |= 1 << i;
      c->U[k * c->nr + i] = (c->unknown[k] >> i) & 1 ? (c->step->order == 2 ? now + ratio * (now - old) : now) : *CoupleRigidComponent(c, u, w, 0, i);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

#define HOLD 1e8 /* stiffness of what holds a hinge or slide, in inertias of body and fluid */

static void hold_block(PetscInt nr, PetscInt first, PetscInt n, const PetscReal e[3], PetscReal scale, const PetscReal M[], PetscReal K[])
{
  PetscReal largest = 0;

  for (PetscInt i = first; i < first + n; i++) largest = PetscMax(largest, M[i * (nr + 1)]);
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt j = 0; j < n; j++) K[(first + i) * nr + first + j] = HOLD * scale * largest * ((i == j) - e[i] * e[j]);
}

PetscBool CoupleHoldAxes(Couple c, PetscInt k, const PetscReal M[], PetscReal K[])
{
  const Motion   *m     = &BodiesGetGroup(c->s, k)->motion;
  const PetscReal scale = c->step->ct * (c->s->density[k] + c->par->density);

  for (PetscInt i = 0; i < c->nr * c->nr; i++) K[i] = 0;
  if (m->has_slide) hold_block(c->nr, 0, c->loc->dim, m->slide, scale, M, K);
  if (m->has_hinge) hold_block(c->nr, c->loc->dim, 3, m->hinge, scale, M, K);
  return (PetscBool)(m->has_slide || m->has_hinge);
}

PetscErrorCode CoupleHistory(Couple c, PetscInt k, const PetscReal M[], const PetscReal now[], const PetscReal old[], PetscReal out[])
{
  const PetscInt nr = c->nr, dim = c->loc->dim;
  PetscReal      M0[36], M1[36];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < nr; i++) {
    out[i] = 0;
    for (PetscInt j = 0; j < nr; j++) out[i] += M[i * nr + j] * (c->step->d0 * now[j] + c->step->d1 * old[j]);
  }
  if (dim == 2) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(RigidGetMass(c->bodies, k, c->s->q[k], M0));
  PetscCall(RigidGetMass(c->bodies, k, c->s->q_old[k], M1));
  for (PetscInt i = dim; i < nr; i++)
    for (PetscInt j = dim; j < nr; j++) {
      const PetscInt e = i * nr + j;

      out[i] += c->step->d0 * (M0[e] - M[e]) * now[j] + c->step->d1 * (M1[e] - M[e]) * old[j];
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inertia D = c_t (rho_s - rho_i) (Vol; I) and right-hand side (rho_s - rho_i) (Vol; I) d(U) + (rho_s - rho_f) Vol g
   + contact + load of the rigid rows, rho_i: density of the fluid inside. Known velocities that share an inertia
   with unknown ones (a pivot that moves) count on the right. */
static PetscErrorCode fill_rigid_rows(Couple c)
{
  const PetscInt nr = c->nr, dim = c->loc->dim;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal excess = c->s->density[k] - CoupleInnerDensity(c, k, c->par);
    PetscReal       M[36], K[36], *g = c->g + k * nr, spin, force[3], torque[3], dead[6], now[6], old[6], momentum[6];

    PetscCall(RigidGetMass(c->bodies, k, c->q[k], M));
    PetscCall(BodiesGetLoadAt(c->bodies, k, CoupleLoadTime(c), c->par->density, c->par->gravity, force, torque));
    for (PetscInt a = 0; a < 3; a++) {
      force[a] += c->s->contact_force[k][a];
      torque[a] += c->s->contact_torque[k][a];
    }
    PetscCall(RigidReduceForce(c->bodies, k, c->q[k], force, torque, g));
    PetscCall(CoupleDeadForce(c, k, c->par, dead));
    for (PetscInt i = 0; i < nr; i++) CoupleGetHistory(c, k, i, &now[i], &old[i]);
    PetscCall(CoupleHistory(c, k, M, now, old, momentum));
    for (PetscInt i = 0; i < nr; i++) {
      g[i] += dead[i] + excess * momentum[i];
      for (PetscInt j = 0; j < nr; j++) {
        c->D[(k * nr + i) * nr + j] = c->step->ct * excess * M[i * nr + j];
        if (!((c->unknown[k] >> j) & 1)) g[i] -= c->D[(k * nr + i) * nr + j] * c->U[k * nr + j];
      }
    }
    if (CoupleHoldAxes(c, k, M, K))
      for (PetscInt i = 0; i < nr * nr; i++) c->D[k * nr * nr + i] += K[i];
    PetscCall(CoupleAddJoint(c, k, M));
    PetscCall(CoupleSpinStress(c, k, c->par, &spin));
    for (PetscInt i = dim; i < nr && spin > 0; i++) {
      c->D[(k * nr + i) * nr + i] += c->step->theta * spin;
      g[i] -= (1 - c->step->theta) * spin * c->U_old[k * nr + i];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes and cells of bodies that have moved since they were drawn; what stands still is drawn once (*drawn: before) */
static PetscErrorCode draw_bodies(Couple c, PetscBool *drawn)
{
  PetscFunctionBeginUser;
  *drawn = PETSC_TRUE;
  PetscCall(place_bodies(c, drawn));
  if (c->follow) PetscCall(AleUpdate(c->follow, *drawn ? NULL : c->X, c->q));
  *drawn = (PetscBool)(*drawn && !c->met);
  c->met = PETSC_FALSE;
  if (*drawn) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_MARK, 0, 0, 0, 0));
  PetscCall(IndicatorClear(c->mark));
  PetscCall((*c->rung->draw)(c, c->rung_data, &c->terms));
  PetscCall(IndicatorFinish(c->mark));
  if (c->terms) {
    PetscCall(ConstraintSetRelative(c->constraint, c->terms->follow, c->terms->nmore, c->terms->more));
    PetscCall(FlowSolverSetSoft(c->solver, c->terms));
  }
  PetscCall(PetscLogEventEnd(TB_MARK, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocities that the conditions prescribe, but for nodes on the surface of or inside a body that passes through a side
   of the domain: these belong to the body. Elsewhere walls win over bodies. */
static PetscErrorCode set_boundary(Couple c, const PetscInt node_body[], const unsigned char fixed[], const PetscReal value[])
{
  unsigned char *rest;

  PetscFunctionBeginUser;
  if (!c->sides_move) {
    PetscCall(ConstraintSetBoundary(c->constraint, fixed, value));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscMalloc1(c->loc->nnode_all, &rest));
  for (PetscInt i = 0; i < c->loc->nnode_all; i++) rest[i] = node_body[i] >= 0 && c->hollow && c->hollow[node_body[i]] ? 0 : fixed[i];
  PetscCall(ConstraintSetBoundary(c->constraint, rest, value));
  PetscCall(PetscFree(rest));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleDraw(Couple c)
{
  const unsigned char *fixed;
  const PetscInt      *node_body;
  const PetscReal     *value;
  PetscBool            drawn, changed;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(c->flow), &fixed, &value));
  PetscCall(FittedSetMotion(c->hole));
  PetscCall(draw_bodies(c, &drawn));
  PetscCall(SurfacesForget(c->surfaces));
  PetscCall(IndicatorGetNodes(c->mark, &node_body, NULL, NULL));
  PetscCall(set_rigid_velocities(c));
  PetscCall(set_boundary(c, node_body, fixed, value));
  if (c->drive) PetscCall(DriveDraw(c->drive));
  if (c->s->nall) {
    PetscCall(CoupleTellPartners(c));
    PetscCall(ConstraintSetBodies(c->constraint, node_body, c->P, c->unknown, c->U, &changed));
    if (c->terms && (!drawn || changed)) PetscCall(PenaltyTermSum(c->terms, c->constraint));
    PetscCall(fill_rigid_rows(c));
    PetscCall(CoupleAddTies(c));
    PetscCall(FlowSolverSetRigid(c->solver, c->D));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAssemble(Couple c)
{
  PetscBool changed = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (FlowHasSymmetricStress(c->flow) && c->terms && c->rung->stiffen) PetscCall((*c->rung->stiffen)(c->rung_data, &changed));
  if (changed) PetscCall(PenaltyTermSum(c->terms, c->constraint));
  PetscCall(FlowAssemble(c->flow));
  PetscCall(FlowSolverSetVelocity(c->solver, NULL));
  PetscCall(FlowRhs(c->flow, c->rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleSolve(Couple c, PetscInt *its, KSPConvergedReason *reason)
{
  PetscFunctionBeginUser;
  PetscCall(CoupleAssemble(c));
  CoupleAddOwed(c);
  PetscCall(FlowSolverSetUp(c->solver));
  PetscCall(FlowExtrapolate(c->flow, c->u, c->p, c->dp));
  PetscCall(FlowSolverSetBefore(c->solver, c->residue.steps >= SURE ? c->residue.left : 0));
  PetscCall(CoupleStartValues(c, c->u, c->p, c->dp));
  PetscCall(FlowSolverSolve(c->solver, c->rhs, c->g, c->u, c->p, c->dp, c->U, its, reason));
  PetscCall(CoupleFindOwed(c));
  PetscCall(CoupleTakeTies(c));
  if (c->drive) PetscCall(DriveTake(c->drive));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- advancing ---- */

/* Velocities and positions of the bodies at the end of the step; bodies that stand still are left alone */
static PetscErrorCode advance_bodies(Couple c)
{
  BodyState *s = c->s;
  PetscBool  still;

  PetscFunctionBeginUser;
  PetscCall(BodiesAreStill(c->bodies, &still));
  if (still) {
    PetscCall(BodiesSetTime(c->bodies, c->step->time));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscLogEventBegin(TB_ADVANCE, 0, 0, 0, 0));
  if (c->implicit) {
    for (PetscInt k = 0; k < s->n; k++) {
      PetscReal u[1][3] = {{0}}, w[1][3] = {{0}};

      for (PetscInt i = 0; i < c->nr; i++) *CoupleRigidComponent(c, u, w, 0, i) = c->U[k * c->nr + i];
      PetscCall(BodiesStepVelocity(c->bodies, k, u[0], w[0]));
    }
    PetscCall(BodiesAdvancePosition(c->bodies, c->step->dt, c->step->order == 2 ? 0.5 : 1));
    for (PetscInt k = 0; k < s->n; k++) PetscCall(BodiesRelease(c->bodies, k, c->par->density, c->par->gravity));
  } else PetscCall(CoupleAdvanceExplicitly(c));
  PetscCall(PetscLogEventEnd(TB_ADVANCE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAdvance(Couple c)
{
  PetscBool solved;

  PetscFunctionBeginUser;
  PetscCall(advance_bodies(c));
  if (c->rung->accept) PetscCall((*c->rung->accept)(c, c->rung_data));
  PetscCall(PetscArraycpy(c->U_older, c->U_old, c->s->n * c->nr));
  PetscCall(PetscArraycpy(c->U_old, c->U, c->s->n * c->nr));
  PetscCall(CoupleAcceptOwed(c));
  PetscCall(FlowSolverGetLeft(c->solver, &c->residue.left, &solved));
  c->residue.steps++;
  if (c->owed && !solved) c->residue.large++;
  PetscCall(FlowAcceptStep(c->flow, c->u, c->p));
  if (c->follow) PetscCall(AleAccept(c->follow));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

/* A parabola in time: refused where bodies move, else allowed */
static PetscErrorCode check_extrapolation(Couple c)
{
  PetscBool still;

  PetscFunctionBeginUser;
  PetscCall(BodiesAreStill(c->bodies, &still));
  for (PetscInt i = 0; i < c->s->ngroups; i++) {
    const BodyGroup *g = c->s->group + i;

    PetscCheck((!g->free && !g->motion.given) || c->par->extrapolation != FLOW_QUADRATIC, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
               "Option -flow_extrapolation quadratic: group '%s' moves, and a parabola in time does not hold where bodies pass: use linear", g->name);
  }
  PetscCall(FlowAllowParabola(c->flow, still));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies that the mesh hardly sees: runs/extremes, axis diameter */
static PetscErrorCode remark_small_bodies(Couple c)
{
  const BodyState *s      = c->s;
  PetscReal        radius = PETSC_MAX_REAL, number = PETSC_MAX_REAL; /* of the smallest */
  const BodyGroup *g = s->group;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) radius = PetscMin(radius, BodiesGetRadius(s, k));
  PetscCall(BodiesMin(c->bodies, 1, &radius));
  if (!s->nall || radius >= 0.999 * c->loc->h) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < s->n; k++)
    if (radius == BodiesGetRadius(s, k)) number = PetscMin(number, (PetscReal)s->number[k]);
  PetscCall(BodiesMin(c->bodies, 1, &number));
  while (number >= g->first + g->count) g++;
  PetscCall(
    LogRemark("body %" PetscInt_FMT
              " (group '%s') is %.2g of the smallest cells long; below 2 its force is off by 20 %% and more: refine the mesh, such as by -mesh_cells",
              (PetscInt)number, g->name, (double)(2 * radius / c->loc->h)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Before the first step bodies have always moved as they do at its beginning */
static PetscErrorCode set_history(Couple c)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal u[1][3], w[1][3];

    PetscCall(BodiesGetKnownVelocity(c->bodies, k, 0, u[0], w[0]));
    for (PetscInt i = 0; i < c->nr; i++) c->U_old[k * c->nr + i] = c->U_older[k * c->nr + i] = *CoupleRigidComponent(c, u, w, 0, i);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleCreate(Flow flow, Bodies bodies, Couple *couple)
{
  Couple   c;
  PetscInt type = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  c->flow   = flow;
  c->bodies = bodies;
  PetscCall(BodiesGetState(bodies, &c->s));
  PetscCall(FlowGetMesh(flow, &c->mesh));
  PetscCall(MeshGetLocal(c->mesh, &c->loc));
  PetscCall(FlowGetStep(flow, &c->step));
  PetscCall(FlowGetParameters(flow, &c->par));
  if (c->s->nall) {
    PetscCall(OptChoice("-couple_type", TYPES, &type));
    PetscCall(OptChoice("-couple_force", FORCES, &c->use_volume));
  }
  PetscCall(check_extrapolation(c));
  c->rung = rungs[0];
  if (c->s->nall) PetscCall(RungChoose(&c->rung));
  PetscCall(remark_small_bodies(c));
  c->implicit = type == 0;
  PetscCall(CoupleCreateParts(c));
  PetscCall(CoupleAttachArrays(c));
  PetscCall(set_history(c));
  PetscCall(SurfacesCreate(c, &c->surfaces));
  *couple = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleSetDeform(Couple c, Deform deform)
{
  char others[256] = "";

  PetscFunctionBeginUser;
  for (PetscInt i = 0; rungs[i]; i++) {
    if (rungs[i]->moves) continue;
    if (others[0]) PetscCall(PetscStrlcat(others, " or ", sizeof(others)));
    PetscCall(PetscStrlcat(others, rungs[i]->name, sizeof(others)));
  }
  PetscCheck(!c->rung->moves, PETSC_COMM_WORLD, PETSC_ERR_SUP,
             "-couple_method %s moves the nodes around bodies itself, and -mesh_deform would have to follow bodies that move with the same nodes: use "
             "-couple_method %s, or remove -mesh_deform",
             c->rung->name, others);
  PetscCall(AleCreate(c->moved, c->flow, c->bodies, deform, &c->follow));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetDeform(Couple c, const DeformResult **result)
{
  PetscFunctionBeginUser;
  *result = NULL;
  if (c->follow) PetscCall(AleGetResult(c->follow, result));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleDestroy(Couple *couple)
{
  Couple c = *couple;

  PetscFunctionBeginUser;
  if (!c) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoupleDestroyParts(c));
  PetscCall(SurfacesDestroy(&c->surfaces));
  PetscCall(DriveDestroy(&c->drive));
  PetscCall(CoupleDetachArrays(c));
  PetscCall(PetscFree(c->spring));
  PetscCall(PetscFree(c->tie));
  PetscCall(PetscFree(c->pushed));
  PetscCall(PetscFree(*couple));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleView(Couple c, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  if (c->s->nall)
    PetscCall(
      PetscViewerASCIIPrintf(viewer, "coupling: %s, boundary %s, force in %s form\n", TYPES[!c->implicit], c->rung->name, FORCES[c->use_volume]));
  else PetscCall(PetscViewerASCIIPrintf(viewer, "coupling: none (no bodies)\n"));
  PetscCall(FittedView(c->hole, viewer));
  if (c->rung->view) PetscCall((*c->rung->view)(c->rung_data, viewer));
  if (c->drive) PetscCall(DriveView(c->drive, viewer));
  if (c->follow) PetscCall(PetscViewerASCIIPrintf(viewer, "  the mesh follows the bodies (-mesh_deform), its velocity is part of the convection\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleIsImplicit(Couple c, PetscBool *implicit)
{
  PetscFunctionBeginUser;
  *implicit = (PetscBool)c->implicit;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetSolver(Couple c, FlowSolver *solver)
{
  PetscFunctionBeginUser;
  *solver = c->solver;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetCounts(Couple c, PetscInt *n, const CoupleCount *count[])
{
  PetscFunctionBeginUser;
  *n     = c->ncount;
  *count = c->count;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetBoundaries(Couple c, PetscInt *n, const CoupleBoundary *boundary[])
{
  PetscFunctionBeginUser;
  PetscCall(BoundariesGet(c->boundaries, n, boundary));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetDrive(Couple c, const CoupleDrive **drive)
{
  PetscFunctionBeginUser;
  *drive = NULL;
  if (c->drive) PetscCall(DriveGet(c->drive, drive));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetNodeBody(Couple c, const PetscInt *node_body[])
{
  PetscFunctionBeginUser;
  PetscCall(IndicatorGetNodes(c->mark, node_body, NULL, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleIsLinedUp(Couple c, PetscBool *lined_up)
{
  PetscFunctionBeginUser;
  *lined_up = c->rung->moves;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetRecess(Couple c, PetscReal *recess)
{
  PetscFunctionBeginUser;
  *recess = c->rung->recess;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetLoad(Couple c, PetscInt *ncells, PetscInt *nbodies)
{
  const PetscInt *node_body, *node;
  PetscInt        n;
  PetscBool      *seen;

  PetscFunctionBeginUser;
  PetscCall(IndicatorGetCells(c->mark, ncells, NULL));
  PetscCall(IndicatorGetNodes(c->mark, &node_body, &n, &node));
  *nbodies = 0;
  PetscCall(PetscCalloc1(c->s->n, &seen));
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt k = node_body[node[i]];

    if (node[i] >= c->loc->nnode || seen[k]) continue;
    seen[k] = PETSC_TRUE;
    (*nbodies)++;
  }
  PetscCall(PetscFree(seen));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetSolution(Couple c, const PetscReal *u[], const PetscReal *p[])
{
  PetscFunctionBeginUser;
  *u = c->u;
  *p = c->p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetSystem(Couple c, PetscReal *u[], PetscReal *p[], PetscReal *U[], PetscReal *rhs[], PetscReal *g[])
{
  PetscFunctionBeginUser;
  if (u) *u = c->u;
  if (p) *p = c->p;
  if (U) *U = c->U;
  if (rhs) *rhs = c->rhs;
  if (g) *g = c->g;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleRenewSolver(Couple c)
{
  PetscFunctionBeginUser;
  c->renewed = PETSC_TRUE;
  PetscCall(FlowSolverDestroy(&c->solver));
  PetscCall(CoupleCreateSolver(c));
  PetscCall(MovedSetSolver(c->moved, c->solver));
  PetscCall(IndicatorForget(c->mark)); /* the solver learns of a rung's terms when it draws */
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleVisitState(void *couple, State state)
{
  Couple    c = couple;
  PetscBool has;
  BodyRows  rows;

  PetscFunctionBeginUser;
  PetscCall(BodiesBeginRows(c->bodies, &rows));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "U_old", c->nr, c->U_old));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "U_older", c->nr, c->U_older));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "owed", c->nr, c->owed_U));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "du_old", 3, c->du_old));
  PetscCall(BodiesVisitIntegers(c->bodies, &rows, state, "growth", c->growth));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "force_old", 6, c->force_old));
  PetscCall(BodiesEndRows(&rows));
  PetscCall(StateHas(state, "residue", &has));
  if (has) PetscCall(StateReals(state, "residue", 4, &c->residue.left));
  PetscCall(StateHas(state, "momentum_owed", &has));
  if (c->owed && has) PetscCall(StateNodes(state, "momentum_owed", c->loc->dim, c->owed));
  if (c->drive) PetscCall(DriveVisitState(c->drive, state));
  if (c->rung->state) PetscCall((*c->rung->state)(c->rung_data, state));
  if (c->follow) PetscCall(AleVisitState(c->follow, state));
  if ((c->rung->state || c->follow) && StateIsLoading(state)) PetscCall(CoupleRenewSolver(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}
