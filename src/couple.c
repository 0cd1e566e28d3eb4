/* Couple: see couple.h for the method.

   The step with implicit coupling, in the order of the calls: bodies drawn at X* (CoupleDraw); one linear system for flow and rigid velocities (CoupleSolve); force from the
   bodies' own equation, F = rho_s Vol (c_t U - d(U)) - G, without an integral (CoupleForce); positions (CoupleAdvance). With explicit coupling, and for degrees of freedom that
   are frozen, the velocity is known, and the force is minus the momentum residual summed over the body's nodes, plus the inertia of the fictitious fluid inside.
   The work a body causes is proportional to the cells it touches. */
#include "compat.h"
#include "couple.h"
#include "fit.h"
#include "hole.h"
#include "log.h"
#include "mark.h"
#include "opt.h"
#include "penalty.h"
#include "rigid.h"

/* A boundary rung: how the flow sees the surface of a body. Operations may be NULL. */
typedef struct {
  const char *name;
  PetscBool   dead;                    /* cells inside are no part of the fluid; otherwise fictitious fluid fills them */
  PetscErrorCode (*draw)(Couple);      /* bodies are at c->X, c->q: claim the nodes that move rigidly in c->mark, prepare the rung's own terms */
  PetscErrorCode (*add_rigid)(Couple); /* add to the rigid rows c->D, c->g */
  PetscErrorCode (*add_force)(Couple, PetscReal out[]); /* add to [n][nr] what the rung's own terms exert on the bodies */
} Rung;

struct _p_Couple {
  Flow             flow;
  Bodies           bodies;
  BodyState       *s;
  Mesh             mesh;
  const MeshLocal *loc;
  Constraint       constraint;
  FlowSolver       solver;
  Hole             hole;                     /* bodies that are holes of the mesh: nothing is marked, forces are read at the boundary */
  PetscInt         nprescribed, *prescribed; /* own cells with nodes of prescribed velocity */
  PetscInt         implicit, use_volume, nr;
  Rung             rung;
  Fit              fit; /* rung snap */
  CoupleSnapCount  snap;
  const PetscBool *fitted;             /* [n] the mesh lines up with the body, whose inside is no part of the fluid; NULL: none */
  Mark             mark;               /* nodes that move rigidly */
  PetscReal (*X)[3], (*q)[4], (*P)[3]; /* where the bodies are drawn: centre, orientation, reference point (of the rigid velocities) */
  Penalty    penalty;                  /* NULL unless the rung needs it */
  PetscInt  *unknown;
  PetscReal *U, *U_old, *U_older; /* [n][nr]: rigid velocities that the flow sees in this step and saw in the two before */
  PetscReal *D, *g;               /* [n][nr][nr] inertia, [n][nr] right-hand side of the rigid rows */
  PetscReal *residual;            /* [n][nr]: -sum of the momentum residual over the body's nodes */
  PetscReal *u, *p, *dp, *rhs;
  PetscReal *du_old; /* [n] explicit coupling: size of the last velocity change, for the detection of blow-up */
  PetscInt  *growth;
  PetscReal *force_old; /* [n][3][2] force and torque of the last step */
};

static const char *const TYPES[]  = {"implicit", "explicit", NULL};
static const char *const FORCES[] = {"residual", "volume", NULL};

/* Component s (0 .. nr - 1) of a rigid velocity as element of 3-vectors: translation s < dim, otherwise rotation */
static PetscReal *rigid_component(Couple c, PetscReal (*u)[3], PetscReal (*w)[3], PetscInt k, PetscInt s)
{
  const PetscInt dim = c->loc->dim;

  return s < dim ? &u[k][s] : dim == 2 ? &w[k][2] : &w[k][s - dim];
}

static PetscBool is_free(Couple c, PetscInt k, PetscInt s)
{
  return BodiesIsFree(c->bodies, k, s < c->loc->dim ? s : 3);
}

/* Rigid velocity of slot i of body k at the last two times. A pivot's translation is prescribed, and is kept here, not in the state of the body. */
static void get_history(Couple c, PetscInt k, PetscInt i, PetscReal *now, PetscReal *old)
{
  const PetscBool kept = (PetscBool)(i < c->loc->dim && c->s->group[c->s->body_group[k]].motion.has_pivot);

  *now = kept ? c->U_old[k * c->nr + i] : *rigid_component(c, c->s->u, c->s->w, k, i);
  *old = kept ? c->U_older[k * c->nr + i] : *rigid_component(c, c->s->u_old, c->s->w_old, k, i);
}

/* ---- drawing ---- */

/* With explicit coupling, what is free is drawn where it is, and the prescribed part where it will be: prescribed bodies are the same under both couplings. */
static PetscErrorCode place_bodies(Couple c, PetscBool *drawn)
{
  const FlowStep *step;
  PetscReal       angle, arm[3];

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(c->flow, &step));
  c->s->time = step->time - step->dt;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscCall(BodiesPredict(c->bodies, k, step->dt, c->implicit ? step->order : 0, c->X[k], c->q[k], &angle));
    PetscCall(BodiesGetArm(c->bodies, k, c->q[k], arm));
    for (PetscInt a = 0; a < 3; a++) c->P[k][a] = c->X[k][a] - arm[a];
  }
  PetscCall(MarkIsCurrent(c->mark, c->X, c->q, step->ct, drawn)); /* the strength of a penalty goes by c_t */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Which rigid velocities are unknown; values of the others, and first guesses */
static PetscErrorCode set_rigid_velocities(Couple c)
{
  const FlowStep *step;
  PetscReal       ratio;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(c->flow, &step));
  ratio = step->dt_old > 0 ? step->dt / step->dt_old : 0;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal u[1][3], w[1][3];

    PetscCall(BodiesGetKnownVelocity(c->bodies, k, step->time, u[0], w[0]));
    c->unknown[k] = 0;
    for (PetscInt i = 0; i < c->nr; i++) {
      PetscReal now, old;

      get_history(c, k, i, &now, &old);
      if (c->implicit && is_free(c, k, i)) c->unknown[k] |= 1 << i;
      c->U[k * c->nr + i] = (c->unknown[k] >> i) & 1 ? (step->order == 2 ? now + ratio * (now - old) : now) : *rigid_component(c, u, w, 0, i);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* rung nodal: every node inside moves with the body */
static PetscErrorCode draw_nodal(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(MarkInside(c->mark, c->X, c->q));
  PetscCall(MarkCheckSeen(c->mark));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode draw_penalty(Couple c)
{
  const Soft *soft;

  PetscFunctionBeginUser;
  PetscCall(PenaltyDraw(c->penalty, c->X, c->q, c->P, c->fitted, c->mark));
  PetscCall(PenaltyGetSoft(c->penalty, &soft));
  PetscCall(ConstraintSetFollowers(c->constraint, soft->follow, soft->nmore, soft->more));
  PetscCall(FlowSolverSetSoft(c->solver, soft));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_penalty_force(Couple c, PetscReal out[])
{
  const Soft *soft;

  PetscFunctionBeginUser;
  PetscCall(PenaltyGetSoft(c->penalty, &soft));
  PetscCall(SoftAddForce(soft, c->constraint, c->u, c->U, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* rung snap: the mesh lines up with the bodies; those it cannot follow are held by the penalty in this step */
static PetscErrorCode draw_snap(Couple c)
{
  const SnapResult *r;
  const PetscInt    before = c->snap.fallback;
  const RemapCount *count;

  PetscFunctionBeginUser;
  PetscCall(FitUpdate(c->fit, c->solver, c->X, c->q, &c->fitted, &r, &count));
  for (PetscInt e = 0; e < r->nmarked; e++) PetscCall(MarkClaim(c->mark, r->marked[e], r->node_body[r->marked[e]]));
  c->snap = (CoupleSnapCount){PETSC_TRUE, 0, r->nnarrow, c->snap.taylor + count->taylor, c->snap.kept + count->kept};
  for (PetscInt k = 0; k < c->s->n; k++)
    if (!c->fitted[k] && !c->s->gone[k] && !c->s->group[c->s->body_group[k]].hole) c->snap.fallback++;
  if (c->snap.fallback || before) PetscCall(draw_penalty(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The density of the fluid inside body k */
static PetscReal inner_density(Couple c, PetscInt k, const FlowParameters *par)
{
  return c->fitted && c->fitted[k] ? 0 : par->density;
}

/* In gradient form a rotating wall seems to feel 2 mu w Vol more than the true torque, which the gradient form inside would take away again; where the inside is no part of the
   fluid, this coefficient of w does (plane bodies; design section 2) */
static PetscErrorCode get_spin_stress(Couple c, PetscInt k, const FlowParameters *par, PetscReal *coefficient)
{
  PetscFunctionBeginUser;
  *coefficient = 0;
  if (!c->fitted || !c->fitted[k]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesGetVolume(c->bodies, k, coefficient));
  *coefficient *= 2 * par->viscosity;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* -flow_force on the fluid that body k displaces, on its rigid slots: it stands for a pressure gradient, which acts on bodies too. Fluid inside receives it; where there is none, the
   body does. */
static PetscErrorCode get_dead_force(Couple c, PetscInt k, const FlowParameters *par, PetscReal out[])
{
  const PetscReal none[3] = {0, 0, 0};
  PetscReal       volume, force[3];

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(out, c->nr));
  if (!c->fitted || !c->fitted[k]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesGetVolume(c->bodies, k, &volume));
  for (PetscInt a = 0; a < 3; a++) force[a] = volume * par->force[a];
  PetscCall(RigidReduceForce(c->bodies, k, c->q[k], force, none, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inertia D = c_t (rho_s - rho_i) (Vol; I) and right-hand side (rho_s - rho_i) (Vol; I) d(U) + (rho_s - rho_f) Vol g + contact + load of the rigid rows, rho_i: density of
   the fluid inside. Known velocities that share an inertia with unknown ones (a pivot that moves) count on the right. */
static PetscErrorCode fill_rigid_rows(Couple c)
{
  const FlowStep       *step;
  const FlowParameters *par;
  const PetscInt        nr = c->nr, dim = c->loc->dim;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(c->flow, &step));
  PetscCall(FlowGetParameters(c->flow, &par));
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal excess = c->s->group[c->s->body_group[k]].density - inner_density(c, k, par);
    PetscReal       M[36], *g = c->g + k * nr, spin, L[3], force[3], torque[3], dead[6];

    PetscCall(RigidGetMass(c->bodies, k, c->q[k], M));
    PetscCall(BodiesGetLoad(c->bodies, k, par->density, par->gravity, force, torque));
    for (PetscInt a = 0; a < 3; a++) {
      force[a] += c->s->contact_force[k][a];
      torque[a] += c->s->contact_torque[k][a];
    }
    PetscCall(RigidReduceForce(c->bodies, k, c->q[k], force, torque, g));
    PetscCall(get_dead_force(c, k, par, dead));
    for (PetscInt i = 0; i < nr; i++) {
      g[i] += dead[i];
      for (PetscInt j = 0; j < nr; j++) {
        PetscReal now, old;

        get_history(c, k, j, &now, &old);
        c->D[(k * nr + i) * nr + j] = step->ct * excess * M[i * nr + j];
        g[i] += excess * M[i * nr + j] * (step->d0 * now + step->d1 * old);
        if (!((c->unknown[k] >> j) & 1)) g[i] -= c->D[(k * nr + i) * nr + j] * c->U[k * nr + j];
      }
    }
    PetscCall(get_spin_stress(c, k, par, &spin));
    if (spin > 0) {
      c->D[(k * nr + dim) * nr + dim] += step->theta * spin;
      g[dim] -= (1 - step->theta) * spin * c->U_old[k * nr + dim];
    }
    if (dim == 3) { /* gyroscopic torque - w x (J w), at the beginning of the step */
      for (PetscInt a = 0; a < 3; a++)
        L[a] = M[(3 + a) * nr + 3] * c->s->w[k][0] + M[(3 + a) * nr + 4] * c->s->w[k][1] + M[(3 + a) * nr + 5] * c->s->w[k][2];
      for (PetscInt a = 0; a < 3; a++) g[3 + a] -= excess * (c->s->w[k][(a + 1) % 3] * L[(a + 2) % 3] - c->s->w[k][(a + 2) % 3] * L[(a + 1) % 3]);
    }
  }
  if (c->rung.add_rigid) PetscCall((*c->rung.add_rigid)(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes and cells of bodies that have moved since they were drawn; what stands still is drawn once */
static PetscErrorCode draw_bodies(Couple c)
{
  PetscBool drawn = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCall(place_bodies(c, &drawn));
  if (drawn) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_MARK, 0, 0, 0, 0));
  PetscCall(MarkClear(c->mark));
  PetscCall((*c->rung.draw)(c));
  PetscCall(MarkFinish(c->mark));
  PetscCall(PetscLogEventEnd(TB_MARK, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleDraw(Couple c)
{
  const PetscInt  *fixed, *node_body;
  const PetscReal *value;

  PetscFunctionBeginUser;
  PetscCall(BoundaryGetValues(FlowBoundary(c->flow), &fixed, &value));
  PetscCall(HoleSetMotion(c->hole));
  PetscCall(draw_bodies(c));
  PetscCall(MarkGetNodes(c->mark, &node_body, NULL, NULL));
  PetscCall(set_rigid_velocities(c));
  PetscCall(ConstraintSetBoundary(c->constraint, fixed, value));
  if (c->s->n) {
    PetscCall(ConstraintSetBodies(c->constraint, node_body, c->P, c->unknown, c->U, NULL));
    PetscCall(fill_rigid_rows(c));
    PetscCall(FlowSolverSetRigid(c->solver, c->D));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAssemble(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(FlowAssemble(c->flow));
  PetscCall(FlowRhs(c->flow, c->rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleSolve(Couple c, PetscInt *its, KSPConvergedReason *reason)
{
  PetscFunctionBeginUser;
  PetscCall(CoupleAssemble(c));
  PetscCall(FlowSolverSetUp(c->solver));
  PetscCall(FlowExtrapolate(c->flow, c->u, c->p, c->dp));
  PetscCall(FlowSolverSolve(c->solver, c->rhs, c->g, c->u, c->p, c->dp, c->U, its, reason));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- forces ---- */

/* -sum over the body's nodes of R^T (momentum residual), and the rung's own terms, for all bodies: out [n][nr] */
static PetscErrorCode sum_residuals(Couple c, PetscReal out[])
{
  const MeshLocal *l = c->loc;
  const PetscInt  *body, *touched, nr = c->nr, dim = l->dim;
  PetscInt         ntouched;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  PetscCall(MarkGetCells(c->mark, &ntouched, &touched));
  PetscCall(PetscArrayzero(out, c->s->n * nr));
  for (PetscInt t = 0; t < ntouched; t++) {
    const PetscInt *node = l->cell_node + touched[t] * l->nb;
    PetscReal       r[MESH_MAX_NB * 3], R[18];

    PetscCall(FlowCellResidual(c->flow, touched[t], c->u, c->p, r));
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt k = body[node[j]];

      if (k < 0) continue;
      PetscCall(ConstraintRigidMap(c->constraint, node[j], k, R));
      for (PetscInt s = 0; s < nr; s++)
        for (PetscInt a = 0; a < dim; a++) out[k * nr + s] -= R[a * nr + s] * r[j * dim + a];
    }
  }
  if (c->rung.add_force) PetscCall((*c->rung.add_force)(c, out));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, out, (PetscMPIInt)(c->s->n * nr), MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* int alpha_k f over the fluid, added to force and torque [n][3] before they are summed over ranks */
static PetscErrorCode add_volume_force(Couple c, PetscInt only, const FlowParameters *par, PetscReal (*force)[3], PetscReal (*torque)[3])
{
  const PetscReal *m;
  const PetscInt  *body, *node, dim = c->loc->dim;
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(c->flow, &m));
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  PetscCall(MarkGetNodes(c->mark, NULL, &n, &node));
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt k = body[node[e]];
    PetscReal      R[18];

    if (k < 0 || node[e] >= c->loc->nnode || (only >= 0 && k != only)) continue;
    ConstraintRigidAt(c->loc, node[e], c->X[k], R);
    for (PetscInt a = 0; a < dim; a++) {
      force[k][a] += m[node[e]] * par->force[a];
      for (PetscInt i = dim; i < c->nr; i++) *rigid_component(c, force, torque, k, i) += R[a * c->nr + i] * m[node[e]] * par->force[a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The volume integral -int (sigma . grad alpha_k - alpha_k f) of all bodies (only = -1) or of one, with f on dead insides: force and torque [n][3] */
static PetscErrorCode integrate_stress(Couple c, PetscInt only, PetscReal (*force)[3], PetscReal (*torque)[3])
{
  const MeshLocal      *l = c->loc;
  const FlowParameters *par;
  const PetscInt       *body, *touched;
  PetscInt              ntouched;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(c->flow, &par));
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  PetscCall(MarkGetCells(c->mark, &ntouched, &touched));
  PetscCall(PetscMemzero(force, c->s->n * sizeof(*force)));
  PetscCall(PetscMemzero(torque, c->s->n * sizeof(*torque)));
  for (PetscInt t = 0; t < ntouched; t++) {
    const PetscInt *node = l->cell_node + touched[t] * l->nb;

    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt k = body[node[j]];
      PetscReal      alpha[MESH_MAX_NB];
      PetscBool      first = PETSC_TRUE, whole = PETSC_TRUE;

      if (k < 0 || (only >= 0 && k != only)) continue;
      for (PetscInt m = 0; m < l->nb; m++) {
        alpha[m] = body[node[m]] == k;
        if (m < j && alpha[m] > 0) first = PETSC_FALSE;
        if (alpha[m] == 0) whole = PETSC_FALSE;
      }
      if (first && !whole) PetscCall(FlowCellStressForce(c->flow, touched[t], c->u, c->p, alpha, c->X[k], force[k], torque[k]));
    }
  }
  PetscCall(add_volume_force(c, only, par, force, torque));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, force, (PetscMPIInt)(3 * c->s->n), MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, torque, (PetscMPIInt)(3 * c->s->n), MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal dead[6];

    PetscCall(get_dead_force(c, k, par, dead));
    for (PetscInt a = 0; a < l->dim && (only < 0 || k == only); a++) force[k][a] += dead[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Residual-form force of body k on its rigid slots (torque about its reference point): own equation where the velocity was unknown, nodal residual plus inertia of the fluid inside otherwise */
static PetscErrorCode residual_force(Couple c, PetscInt k, PetscReal out[])
{
  const FlowStep       *step;
  const FlowParameters *par;
  const PetscInt        nr    = c->nr;
  const PetscReal       rho_s = c->s->group[c->s->body_group[k]].density;
  PetscReal             M[36], a[6], extra[3], dead[6], rho_i, spin;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(c->flow, &step));
  PetscCall(FlowGetParameters(c->flow, &par));
  PetscCall(RigidGetMass(c->bodies, k, c->q[k], M));
  rho_i = inner_density(c, k, par);
  PetscCall(get_dead_force(c, k, par, dead));
  PetscCall(get_spin_stress(c, k, par, &spin));
  PetscCall(RigidCentripetal(c->bodies, k, c->q[k], c->U + k * c->nr + c->loc->dim, extra));
  for (PetscInt i = 0; i < nr; i++) a[i] = step->ct * c->U[k * nr + i] - step->d0 * c->U_old[k * nr + i] - step->d1 * c->U_older[k * nr + i];
  for (PetscInt i = 0; i < nr; i++) {
    PetscReal inertia = dead[i] + (i < c->loc->dim ? rho_i * M[0] * extra[i] : 0), excess = 0;

    for (PetscInt j = 0; j < nr; j++) {
      inertia += rho_i * M[i * nr + j] * a[j];
      if ((c->unknown[k] >> j) & 1) excess += step->ct * (rho_s - rho_i) * M[i * nr + j] * c->U[k * nr + j];
    }
    /* rows of the solved system: R^T residual = g - D U = g - excess */
    out[i] = inertia + ((c->unknown[k] >> i) & 1 ? excess - c->g[k * nr + i] : c->residual[k * nr + i]);
    if (i == c->loc->dim && spin > 0)
      out[i] -= spin * ((c->unknown[k] >> i) & 1 ? (1 - step->theta) * c->U_old[k * nr + i]
                                                 : step->theta * c->U[k * nr + i] + (1 - step->theta) * c->U_old[k * nr + i]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Force and torque about the centre, of generalised forces on the rigid slots */
static PetscErrorCode store_force(Couple c, PetscInt k, const PetscReal f[], PetscReal (*force)[3], PetscReal (*torque)[3])
{
  PetscReal arm[3];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->nr; i++) *rigid_component(c, force, torque, k, i) = f[i];
  PetscCall(BodiesGetArm(c->bodies, k, c->q[k], arm));
  for (PetscInt a = 0; a < 3; a++) torque[k][a] -= arm[(a + 1) % 3] * force[k][(a + 2) % 3] - arm[(a + 2) % 3] * force[k][(a + 1) % 3];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleForce(Couple c)
{
  PetscBool known = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (!c->s->n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_FORCE, 0, 0, 0, 0));
  for (PetscInt k = 0; k < c->s->n; k++) known = (PetscBool)(known || c->unknown[k] != (1 << c->nr) - 1);
  if (c->use_volume) {
    PetscCall(integrate_stress(c, -1, c->s->force, c->s->torque));
    PetscCall(HoleForce(c->hole, c->u, c->p, NULL, NULL, c->s->force, c->s->torque));
  } else {
    if (known) PetscCall(sum_residuals(c, c->residual));
    for (PetscInt k = 0; k < c->s->n; k++) {
      PetscReal f[6];

      PetscCall(residual_force(c, k, f));
      PetscCall(store_force(c, k, f, c->s->force, c->s->torque));
    }
    PetscCall(HoleForce(c->hole, c->u, c->p, c->s->force, c->s->torque, NULL, NULL));
  }
  PetscCall(PetscLogEventEnd(TB_FORCE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleForceForms(Couple c, PetscInt k, PetscReal residual[6], PetscReal volume[6])
{
  PetscReal(*force)[3], (*torque)[3], f[6];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(c->s->n, &force, c->s->n, &torque));
  PetscCall(integrate_stress(c, k, force, torque));
  PetscCall(HoleForce(c->hole, c->u, c->p, NULL, NULL, force, torque));
  for (PetscInt a = 0; a < 3; a++) {
    volume[a]     = force[k][a];
    volume[3 + a] = torque[k][a];
  }
  PetscCall(sum_residuals(c, c->residual));
  PetscCall(residual_force(c, k, f));
  PetscCall(store_force(c, k, f, force, torque));
  PetscCall(HoleForce(c->hole, c->u, c->p, force, torque, NULL, NULL));
  for (PetscInt a = 0; a < 3; a++) {
    residual[a]     = force[k][a];
    residual[3 + a] = torque[k][a];
  }
  if (c->loc->dim == 2) residual[2] = residual[3] = residual[4] = 0;
  PetscCall(PetscFree2(force, torque));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- momentum ---- */

/* Own cells with prescribed nodes; these do not change */
static PetscErrorCode list_prescribed_cells(Couple c)
{
  const MeshLocal *l = c->loc;
  const PetscInt  *fixed;

  PetscFunctionBeginUser;
  PetscCall(BoundaryGetValues(FlowBoundary(c->flow), &fixed, NULL));
  PetscCall(PetscMalloc1(l->ncell, &c->prescribed));
  for (PetscInt cell = 0; cell < l->ncell; cell++) {
    PetscInt any = 0;

    for (PetscInt j = 0; j < l->nb; j++) any |= fixed[l->cell_node[cell * l->nb + j]];
    if (any) c->prescribed[c->nprescribed++] = cell;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What prescribed components supply: sums of the momentum residual over walls and over openings (holes are bodies and left out), and *size, the sum of the sizes, by which
   errors are measured (in a closed box the forces of the walls cancel) */
static PetscErrorCode sum_prescribed(Couple c, PetscReal walls[3], PetscReal openings[3], PetscReal *size)
{
  const MeshLocal *l = c->loc;
  const PetscInt  *fixed, *wall, *hole;
  PetscReal        sum[7] = {0};

  PetscFunctionBeginUser;
  PetscCall(BoundaryGetValues(FlowBoundary(c->flow), &fixed, NULL));
  PetscCall(BoundaryGetWalls(FlowBoundary(c->flow), &wall));
  PetscCall(HoleGetNodeBody(c->hole, &hole));
  for (PetscInt i = 0; i < c->nprescribed; i++) {
    const PetscInt *node = l->cell_node + c->prescribed[i] * l->nb;
    PetscReal       r[MESH_MAX_NB * 3];

    PetscCall(FlowCellResidual(c->flow, c->prescribed[i], c->u, c->p, r));
    for (PetscInt j = 0; j < l->nb; j++) {
      for (PetscInt a = 0; a < l->dim; a++) {
        if (!((fixed[node[j]] >> a) & 1) || hole[node[j]] >= 0) continue;
        sum[((wall[node[j]] >> a) & 1 ? 0 : 3) + a] += r[j * l->dim + a];
        sum[6] += PetscAbsReal(r[j * l->dim + a]);
      }
    }
  }
  if (c->penalty) PetscCall(PenaltyAddPrescribed(c->penalty, fixed, c->u, c->U, sum));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 7, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscCall(PetscArraycpy(walls, sum, 3));
  PetscCall(PetscArraycpy(openings, sum + 3, 3));
  *size = sum[6];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Forces of the bodies on the fluid: -F + inertia of the fluid inside; adds their sizes to *size */
static PetscErrorCode sum_bodies(Couple c, PetscReal out[3], PetscReal *size)
{
  const FlowParameters *par;
  const FlowStep       *step;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(c->flow, &par));
  PetscCall(FlowGetStep(c->flow, &step));
  out[0] = out[1] = out[2] = 0;
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal inside = c->s->group[c->s->body_group[k]].hole ? 0 : inner_density(c, k, par);
    PetscReal       M[36], extra[3], dead[6];

    PetscCall(get_dead_force(c, k, par, dead));
    PetscCall(RigidGetMass(c->bodies, k, c->q[k], M));
    PetscCall(RigidCentripetal(c->bodies, k, c->q[k], c->U + k * c->nr + c->loc->dim, extra));
    for (PetscInt a = 0; a < c->loc->dim; a++) {
      PetscReal inertia = M[0] * extra[a]; /* of what moves with the body */

      for (PetscInt j = 0; j < c->nr; j++)
        inertia += M[a * c->nr + j] * (step->ct * c->U[k * c->nr + j] - step->d0 * c->U_old[k * c->nr + j] - step->d1 * c->U_older[k * c->nr + j]);
      out[a] += inside * inertia + dead[a] - c->s->force[k][a];
      *size += PetscAbsReal(c->s->force[k][a]);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* rho int (c_t u - d) and int f over the fluid; the row sums of the mass matrix integrate Q2 functions exactly */
static PetscErrorCode sum_fluid(Couple c, PetscReal change[3], PetscReal volume[3])
{
  const FlowParameters *par;
  const FlowStep       *step;
  const PetscReal      *m;
  const PetscInt        dim = c->loc->dim;
  PetscReal            *u, *u_old, sum[4] = {0};

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(c->flow, &par));
  PetscCall(FlowGetStep(c->flow, &step));
  PetscCall(FlowGetLumpedMass(c->flow, &m));
  PetscCall(FlowGetFields(c->flow, &u, &u_old, NULL));
  for (PetscInt i = 0; i < c->loc->nnode; i++) {
    for (PetscInt a = 0; a < dim; a++) {
      const PetscInt j = i * dim + a;

      sum[a] += m[i] * (step->ct * c->u[j] - step->d0 * u[j] - step->d1 * u_old[j]);
    }
    sum[3] += m[i];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 4, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  for (PetscInt a = 0; a < 3; a++) {
    change[a] = par->density * sum[a];
    volume[a] = par->force[a] * sum[3];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleMomentum(Couple c, const PetscReal rate[3], CoupleBalance *b)
{
  PetscReal size = 0, diff = 0;

  PetscFunctionBeginUser;
  PetscCall(sum_prescribed(c, b->walls, b->openings, &size));
  PetscCall(sum_bodies(c, b->bodies, &size));
  PetscCall(sum_fluid(c, b->fluid, b->volume));
  for (PetscInt a = 0; a < 3; a++) {
    const PetscReal flux = rate[a] - b->fluid[a] + b->volume[a]; /* rho int w.grad u: what leaves through the openings */

    size += PetscAbsReal(rate[a]);
    diff = PetscMax(diff, PetscAbsReal(rate[a] - b->walls[a] - b->openings[a] - b->bodies[a]));
    b->openings[a] -= flux;
  }
  b->error = size > 0 ? diff / size : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleMomentumError(Couple c, const PetscReal rate[3], PetscReal *error)
{
  CoupleBalance b;

  PetscFunctionBeginUser;
  PetscCall(CoupleMomentum(c, rate, &b));
  *error = b.error;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- advancing ---- */

/* Explicit coupling of a light body: the velocity change alternates in sign and grows from step to step (the added mass acts one step late). */
static PetscErrorCode detect_blow_up(Couple c)
{
  const FlowStep       *step;
  const FlowParameters *par;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(c->flow, &step));
  PetscCall(FlowGetParameters(c->flow, &par));
  for (PetscInt k = 0; k < c->s->n; k++) {
    const BodyGroup *group = c->s->group + c->s->body_group[k];
    PetscReal        du[3], size = 0, dot = 0;

    if (!group->free) continue;
    for (PetscInt a = 0; a < 3; a++) {
      du[a] = c->s->u[k][a] - c->s->u_old[k][a];
      size += du[a] * du[a];
      dot += du[a] * c->du_old[3 * k + a];
      size = PetscIsInfOrNanReal(du[a]) ? PETSC_INFINITY : size;
    }
    {
      const PetscReal *o        = c->du_old + 3 * k;
      const PetscReal  old_size = o[0] * o[0] + o[1] * o[1] + o[2] * o[2];

      c->growth[k] = dot < 0 && size > 1.1 * old_size ? c->growth[k] + 1 : 0;
    }
    PetscCheck(size < PETSC_INFINITY && c->growth[k] < 4 && PetscSqrtReal(size) * step->dt < 2 * group->radius, PETSC_COMM_WORLD,
               PETSC_ERR_USER_INPUT,
               "Body %" PetscInt_FMT
               " (group '%s', density ratio %g) oscillates with growing velocity, |dU| = %g in one step: explicit coupling is unstable for light bodies because the added mass acts one step late, "
               "and a smaller -sim_dt makes it worse. Use -couple_type implicit",
               k, group->name, (double)(group->density / par->density), (double)PetscSqrtReal(size));
    for (PetscInt a = 0; a < 3; a++) c->du_old[3 * k + a] = du[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Explicit coupling moves the bodies under the mean of the present and the last hydrodynamic force, as Wan & Turek (2006) do. Force and torque act one step late; with their
   added inertia m (added mass and what the boundary layer gains in a step) the mean is stable for m < 2 M, the present force alone only for m < M. */
static PetscErrorCode advance_explicitly(Couple c, const FlowStep *step, const FlowParameters *par)
{
  BodyState *s = c->s;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 3 * s->n; i++) {
    PetscReal *f[2] = {&s->force[i / 3][i % 3], &s->torque[i / 3][i % 3]}, *old[2] = {&c->force_old[2 * i], &c->force_old[2 * i + 1]};

    for (PetscInt j = 0; j < 2; j++) {
      const PetscReal now = *f[j];

      *f[j]   = 0.5 * (now + *old[j]);
      *old[j] = now;
    }
  }
  PetscCall(BodiesAdvanceVelocity(c->bodies, step->dt, par->density, par->gravity));
  for (PetscInt i = 0; i < 3 * s->n; i++) {
    s->force[i / 3][i % 3]  = c->force_old[2 * i];
    s->torque[i / 3][i % 3] = c->force_old[2 * i + 1];
  }
  PetscCall(detect_blow_up(c));
  PetscCall(BodiesAdvancePosition(c->bodies, step->dt, 1));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocities and positions of the bodies at the end of the step; bodies that stand still are left alone */
static PetscErrorCode advance_bodies(Couple c)
{
  const FlowStep       *step;
  const FlowParameters *par;
  BodyState            *s = c->s;
  PetscBool             still;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(c->flow, &step));
  PetscCall(FlowGetParameters(c->flow, &par));
  PetscCall(BodiesAreStill(c->bodies, &still));
  if (still) {
    s->time = step->time;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscLogEventBegin(TB_ADVANCE, 0, 0, 0, 0));
  if (c->implicit) {
    for (PetscInt k = 0; k < s->n; k++) {
      for (PetscInt i = 0; i < c->nr; i++) {
        *rigid_component(c, s->u_old, s->w_old, k, i) = *rigid_component(c, s->u, s->w, k, i);
        *rigid_component(c, s->u, s->w, k, i)         = c->U[k * c->nr + i];
      }
    }
    PetscCall(BodiesAdvancePosition(c->bodies, step->dt, step->order == 2 ? 0.5 : 1));
    for (PetscInt k = 0; k < s->n; k++) PetscCall(BodiesRelease(c->bodies, k, par->density, par->gravity));
  } else PetscCall(advance_explicitly(c, step, par));
  PetscCall(PetscLogEventEnd(TB_ADVANCE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAdvance(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(advance_bodies(c));
  PetscCall(PetscArraycpy(c->U_older, c->U_old, c->s->n * c->nr));
  PetscCall(PetscArraycpy(c->U_old, c->U, c->s->n * c->nr));
  PetscCall(FlowAcceptStep(c->flow, c->u, c->p));
  c->snap.taylor = c->snap.kept = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

PetscErrorCode CoupleSetDefaults(void)
{
  char      type[32] = "";
  PetscBool is_explicit;

  PetscFunctionBeginUser;
  PetscCall(PetscOptionsGetString(NULL, NULL, "-couple_type", type, sizeof(type), NULL));
  PetscCall(PetscStrcmp(type, "explicit", &is_explicit));
  if (is_explicit) PetscCall(OptDefault("-flow_time", "be"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const Rung RUNGS[] = {
  {"nodal", PETSC_FALSE, draw_nodal, NULL, NULL},
  {"penalty", PETSC_FALSE, draw_penalty, NULL, add_penalty_force},
  {"snap", PETSC_TRUE, draw_snap, NULL, add_penalty_force},
};

/* -couple_boundary */
static PetscErrorCode choose_rung(Couple c)
{
  const PetscInt n = PETSC_STATIC_ARRAY_LENGTH(RUNGS);
  const char    *name[PETSC_STATIC_ARRAY_LENGTH(RUNGS) + 1];
  PetscInt       choice = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) name[i] = RUNGS[i].name;
  name[n] = NULL;
  if (c->s->n) PetscCall(OptChoice("-couple_boundary", "how the flow sees the surface of a body", name, &choice));
  c->rung = RUNGS[choice];
  if (c->rung.draw == draw_penalty || c->rung.draw == draw_snap) PetscCall(PenaltyCreate(c->flow, c->bodies, &c->penalty));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_extrapolation(Couple c)
{
  const FlowParameters *par;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(c->flow, &par));
  for (PetscInt i = 0; i < c->s->ngroups && par->quadratic; i++) {
    const BodyGroup *g = c->s->group + i;

    PetscCheck(!g->free && !g->motion.given, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
               "Option -flow_extrapolation quadratic: group '%s' moves, and a parabola in time does not hold where bodies pass: use linear", g->name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleCreate(Flow flow, Bodies bodies, Couple *couple)
{
  Couple   c;
  PetscInt n, nn, type = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  c->flow   = flow;
  c->bodies = bodies;
  PetscCall(BodiesGetState(bodies, &c->s));
  PetscCall(FlowGetMesh(flow, &c->mesh));
  PetscCall(MeshGetLocal(c->mesh, &c->loc));
  n = c->s->n;
  if (n) {
    PetscCall(OptChoice("-couple_type", "bodies and flow in one system, or the bodies' velocity known from the last step", TYPES, &type));
    PetscCall(OptChoice("-couple_force", "form of the hydrodynamic force", FORCES, &c->use_volume));
  }
  PetscCall(check_extrapolation(c));
  PetscCall(choose_rung(c));
  c->implicit = type == 0;
  PetscCall(HoleCreate(flow, bodies, &c->hole));
  PetscCall(list_prescribed_cells(c));
  PetscCall(ConstraintCreate(c->mesh, n, &c->constraint));
  PetscCall(ConstraintGetRigidSize(c->constraint, &c->nr));
  PetscCall(FlowSolverCreate(flow, c->constraint, &c->solver));
  nn = n * c->nr;
  PetscCall(MarkCreate(c->mesh, bodies, &c->mark));
  if (c->rung.dead) PetscCall(FitCreate(flow, bodies, &c->fit));
  PetscCall(PetscCalloc7(n, &c->X, n, &c->q, n, &c->P, n, &c->unknown, 3 * n, &c->du_old, n, &c->growth, 6 * n, &c->force_old));
  PetscCall(PetscCalloc6(nn, &c->U, nn, &c->U_old, nn, &c->U_older, nn * c->nr, &c->D, nn, &c->g, nn, &c->residual));
  for (PetscInt k = 0; k < n; k++) {
    PetscReal u[1][3], w[1][3];

    PetscCall(BodiesGetKnownVelocity(bodies, k, 0, u[0], w[0]));
    for (PetscInt i = 0; i < c->nr; i++) c->U_old[k * c->nr + i] = c->U_older[k * c->nr + i] = *rigid_component(c, u, w, 0, i);
  }
  PetscCall(PetscCalloc4(c->loc->nnode_all * c->loc->dim, &c->u, c->loc->ncell * (c->loc->dim + 1), &c->p, c->loc->ncell * (c->loc->dim + 1), &c->dp,
                         c->loc->nnode_all * c->loc->dim, &c->rhs));
  *couple = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleDestroy(Couple *couple)
{
  Couple c = *couple;

  PetscFunctionBeginUser;
  if (!c) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowSolverDestroy(&c->solver));
  PetscCall(HoleDestroy(&c->hole));
  PetscCall(PetscFree(c->prescribed));
  PetscCall(ConstraintDestroy(&c->constraint));
  PetscCall(MarkDestroy(&c->mark));
  PetscCall(FitDestroy(&c->fit));
  PetscCall(PetscFree7(c->X, c->q, c->P, c->unknown, c->du_old, c->growth, c->force_old));
  PetscCall(PenaltyDestroy(&c->penalty));
  PetscCall(PetscFree6(c->U, c->U_old, c->U_older, c->D, c->g, c->residual));
  PetscCall(PetscFree4(c->u, c->p, c->dp, c->rhs));
  PetscCall(PetscFree(*couple));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleView(Couple c, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  if (c->s->n)
    PetscCall(
      PetscViewerASCIIPrintf(viewer, "coupling: %s, boundary %s, force in %s form\n", TYPES[!c->implicit], c->rung.name, FORCES[c->use_volume]));
  else PetscCall(PetscViewerASCIIPrintf(viewer, "coupling: none (no bodies)\n"));
  if (c->penalty) PetscCall(PenaltyView(c->penalty, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetSolver(Couple c, FlowSolver *solver)
{
  PetscFunctionBeginUser;
  *solver = c->solver;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetSnapCount(Couple c, CoupleSnapCount *count)
{
  PetscFunctionBeginUser;
  *count         = c->snap;
  count->present = (PetscBool)(c->fit != NULL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetNodeBody(Couple c, const PetscInt *node_body[])
{
  PetscFunctionBeginUser;
  PetscCall(MarkGetNodes(c->mark, node_body, NULL, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetLoad(Couple c, PetscInt *ncells, PetscInt *nbodies)
{
  const PetscInt *node_body, *node;
  PetscInt        n;
  PetscBool      *seen;

  PetscFunctionBeginUser;
  PetscCall(MarkGetCells(c->mark, ncells, NULL));
  PetscCall(MarkGetNodes(c->mark, &node_body, &n, &node));
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
  PetscCall(FlowSolverDestroy(&c->solver));
  PetscCall(FlowSolverCreate(c->flow, c->constraint, &c->solver));
  if (c->fit) PetscCall(FitAttach(c->fit, c->solver));
  PetscCall(MarkForget(c->mark)); /* the rungs tell the solver of what they draw */
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleVisitState(void *couple, State state)
{
  Couple         c  = couple;
  const PetscInt nn = c->s->n * c->nr;

  PetscFunctionBeginUser;
  PetscCall(StateReals(state, "U_old", nn, c->U_old));
  PetscCall(StateReals(state, "U_older", nn, c->U_older));
  PetscCall(StateReals(state, "du_old", 3 * c->s->n, c->du_old));
  PetscCall(StateInts(state, "growth", c->s->n, c->growth));
  PetscCall(StateReals(state, "force_old", 6 * c->s->n, c->force_old));
  if (c->fit) {
    PetscCall(FitVisitState(c->fit, state));
    if (StateIsLoading(state)) PetscCall(CoupleRenewSolver(c));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
