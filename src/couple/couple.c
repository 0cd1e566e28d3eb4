/* Couple: see couple.h for the method.

   The step, in the order of the calls: surfaces predicted, the mesh and the rows of the bodies made for them
   (CoupleUpdateGeometry); one linear system for flow and rigid velocities (CoupleSolve); forces (CoupleForce), those
   of bodies solved for from their own equation, F = rho_s Vol (c_t U - d(U)) - G, without an integral; velocities
   and positions (CoupleAdvance). Each is a loop over the participants (participant.h). With explicit coupling
   (explicit.c), and for degrees of freedom that are frozen, the velocity is known, and the force is minus the
   momentum residual summed over the body's nodes, plus the inertia of the fictitious fluid inside. The work a body
   causes is proportional to the cells it touches. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "flow/device.h"

static const char *const TYPES[]  = {"implicit", "explicit", NULL};
static const char *const FORCES[] = {"residual", "volume", NULL};

/* ---- a step ---- */

PetscErrorCode CoupleUpdateGeometry(Couple c)
{
  PetscFunctionBeginUser;
  CoupleEach(c, begin);
  CoupleEach(c, prepare);
  CoupleEach(c, rows);
  if (c->s->nall) PetscCall(FlowSolverSetRigid(c->solver, c->rigid.D));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleSetUpGeometry(Couple c)
{
  PetscFunctionBeginUser;
  c->sets_up = PETSC_TRUE;
  PetscCall(CoupleUpdateGeometry(c));
  c->sets_up = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAssemble(Couple c)
{
  PetscFunctionBeginUser;
  CoupleEach(c, assemble);
  PetscCall(FlowAssemble(c->flow));
  PetscCall(FlowSolverSetVelocity(c->solver, NULL));
  PetscCall(FlowRhs(c->flow, c->field.rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleSolve(Couple c, PetscInt *its, KSPConvergedReason *reason)
{
  PetscFunctionBeginUser;
  PetscCall(CoupleAssemble(c));
  PetscCall(FlowSolverSetUp(c->solver));
  PetscCall(FlowExtrapolate(c->flow, c->field.u, c->field.p, c->field.dp));
  CoupleEach(c, start);
  PetscCall(
    FlowSolverSolve(c->solver, c->field.rhs, c->rigid.g, c->field.u, c->field.p, c->field.dp, c->rigid.U, its, reason));
  CoupleEach(c, solved);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleForce(Couple c)
{
  PetscFunctionBeginUser;
  if (c->s->nall) PetscCall(PetscLogEventBegin(TB_FORCE, 0, 0, 0, 0));
  CoupleEach(c, force);
  if (c->s->nall) PetscCall(PetscLogEventEnd(TB_FORCE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAdvance(Couple c)
{
  PetscFunctionBeginUser;
  CoupleEach(c, advance);
  PetscCall(FlowAcceptStep(c->flow, c->field.u, c->field.p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleDiagnose(Couple c, FlowDiagnostics *d)
{
  const PetscBool there = FlowStaysOnDevice(c->flow);

  PetscFunctionBeginUser;
  PetscCall(FlowDiagnose(c->flow, there ? NULL : c->field.u, there ? NULL : c->field.p, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleMomentum(Couple c, const FlowDiagnostics *d, CoupleBalance *b)
{
  PetscReal diff = 0;

  PetscFunctionBeginUser;
  *b = (CoupleBalance){0};
  for (PetscInt a = 0; a < 3; a++) {
    b->fluid[a]    = d->change[a];
    b->volume[a]   = d->driven[a];
    b->openings[a] = d->traction[a] - d->flux[a];
    b->residual[a] = d->change[a] + d->flux[a] - d->driven[a] - d->traction[a];
  }
  CoupleEach(c, balance, d, b);
  for (PetscInt a = 0; a < 3; a++) {
    b->size += PetscAbsReal(d->change[a] + d->flux[a] - d->driven[a] - d->traction[a]);
    diff = PetscMax(diff, PetscAbsReal(b->residual[a]));
  }
  b->error = b->size > 0 ? diff / b->size : 0;
  PetscCall(CoupleMeasureDriving(c, d, b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetPower(Couple c, CouplePower *w)
{
  PetscFunctionBeginUser;
  *w = (CouplePower){0};
  CoupleEach(c, energy, w);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleLimitStep(Couple c, PetscReal *dt, const char **who)
{
  PetscFunctionBeginUser;
  if (who) *who = NULL;
  for (PetscInt i = 0; i < c->nparticipants; i++) {
    const CoupleEntry *e      = c->participant + i;
    const PetscReal    before = *dt;

    if (!e->op->limit) continue;
    PetscCall((*e->op->limit)(c, e->data, dt));
    if (who && *dt < before) *who = e->op->name;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleOverstep(Couple c, PetscReal *ratio, const char **who)
{
  PetscFunctionBeginUser;
  *ratio = 0;
  if (who) *who = NULL;
  for (PetscInt i = 0; i < c->nparticipants; i++) {
    const CoupleEntry *e      = c->participant + i;
    const PetscReal    before = *ratio;

    if (!e->op->overstep) continue;
    PetscCall((*e->op->overstep)(c, e->data, ratio));
    if (who && *ratio > before) *who = e->op->name;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

const char *CoupleLimitName(Couple c, PetscInt i)
{
  for (PetscInt e = 0; e < c->nparticipants; e++)
    if (c->participant[e].op->limit && i-- == 0) return c->participant[e].op->name;
  return NULL;
}

PetscBool CoupleHasOthers(Couple c)
{
  for (PetscInt e = 0; e < c->nparticipants; e++)
    if (c->participant[e].op->others) return PETSC_TRUE;
  return PETSC_FALSE;
}

PetscErrorCode CoupleGetBound(Couple c, const CoupleBound **bound)
{
  PetscFunctionBeginUser;
  *bound = c->method.bound.name ? &c->method.bound : NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- between steps ---- */

PetscErrorCode CoupleVisitState(void *couple, State state)
{
  Couple c = (Couple)couple;

  PetscFunctionBeginUser;
  c->needs_solver = PETSC_FALSE;
  CoupleEach(c, visit, state);
  if (c->needs_solver && StateIsLoading(state)) PetscCall(CoupleRenewSolver(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleView(Couple c, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  if (c->s->nall)
    PetscCall(PetscViewerASCIIPrintf(viewer, "coupling: %s, boundary %s, force in %s form\n", TYPES[!c->implicit],
                                     c->method.table->name, FORCES[c->force_form]));
  else PetscCall(PetscViewerASCIIPrintf(viewer, "coupling: none (no bodies)\n"));
  CoupleEach(c, view, viewer);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleBeforeRemesh(Couple c)
{
  PetscFunctionBeginUser;
  CoupleEach(c, before_remesh);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode discard_mesh(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(FlowSolverDestroy(&c->solver)); /* first: the most memory */
  CoupleEach(c, discard);
  PetscCall(CoupleDestroySystem(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAfterRemesh(Couple c, Mesh *old)
{
  PetscFunctionBeginUser;
  PetscCall(discard_mesh(c));
  PetscCall(CoupleCreateSystem(c));
  c->driving.domain = 0;
  CoupleEach(c, after_remesh, old);
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

    PetscCheck((!g->free && !g->motion.given) || c->par->extrapolation != FLOW_QUADRATIC, c->comm, PETSC_ERR_USER_INPUT,
               "Option -flow_extrapolation quadratic: group '%s' moves, and a parabola in time does not hold where bodies pass: use linear",
               g->name);
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

/* Fields do not stay on a device where somebody reads all of them in every step */
static PetscErrorCode leave_device(Couple c)
{
  PetscBool leaves = (PetscBool)(c->slip || (c->s->nall && (c->scalars || c->force_form == FORCE_VOLUME)));

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < c->s->ngroups; g++) leaves = (PetscBool)(leaves || c->s->group[g].body_fitted);
  if (leaves && FlowGetQueue(c->flow)) PetscCall(FlowLeaveDevice(c->flow));
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
  PetscCall(MeshGetComm(c->mesh, &c->comm));
  PetscCall(MeshGetLocal(c->mesh, &c->loc));
  PetscCall(FlowGetStep(flow, &c->step));
  PetscCall(FlowGetParameters(flow, &c->par));
  if (c->s->nall) {
    PetscCall(OptChoice("-couple_type", TYPES, &type));
    PetscCall(OptChoice("-couple_force", FORCES, &c->force_form));
  }
  c->implicit = (PetscBool)(type == 0);
  PetscCall(check_extrapolation(c));
  c->method.table = methods[0];
  if (c->s->nall) PetscCall(BoundaryMethodChoose(&c->method.table));
  PetscCall(remark_small_bodies(c));
  PetscCall(CoupleCreateSystem(c));
  PetscCall(CoupleAddParticipants(c));
  PetscCall(leave_device(c));
  *couple = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleDestroy(Couple *couple)
{
  Couple c = *couple;

  PetscFunctionBeginUser;
  if (!c) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(discard_mesh(c));
  CoupleEach(c, destroy);
  PetscCall(PetscFree(c->participant));
  PetscCall(PetscFree(*couple));
  PetscFunctionReturn(PETSC_SUCCESS);
}
