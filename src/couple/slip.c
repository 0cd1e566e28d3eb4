/* Couple, slip: velocities of surfaces beside the rigid motion of their bodies (bodies/slip.h), as a participant.

   Nodes of a body move with R U + s: s goes into the prescribed part c of u = P u_r + c (solve/constraint.h), so that a
   body that swims without a force is found in the one solve of the step. Method aligned: s at the nodes of the surface,
   exact there. Methods with fluid inside of bodies: s is continued without divergence to the nodes inside; a penalty
   holds its cut cells at R U + s, whose part in s is a load on the flow and, with the opposite sign, on the body.

   Torque in gradient form: where the inside is no part of the fluid the viscous term leaves out mu int u x n over the
   surface, for w 2 mu Vol w (RigidGradientFormTorque), for s the same integral of s. As a sum over nodes: int phi_j n
   over the surface is minus the row of B of the constant pressure at j, summed over the cells of the fluid.

   Power, what the surface does to the fluid beyond the work of force and torque on the rigid motion: s times the
   momentum residual, and in gradient form mu int du_b/dx_a ds_a/dx_b, which makes the stress the whole one. With fluid
   inside of bodies less what that dissipates, known for modes. */
#include "compat.h"
#include "impl.h"
#include "penalty.h"
#include "base/algebra.h"
#include "base/opt.h"
#include "bodies/slip.h"

struct _p_CoupleSlip {
  PetscReal *velocity;                      /* [nnode_all][dim] */
  PetscReal *normal;                        /* [nnode_all][dim] of surfaces, outward */
  PetscReal *load;                          /* [nnode_all][dim] of the penalty on the flow */
  PetscReal (*torque)[3], (*torque_old)[4]; /* [n] mu int n x s of this step; of the one before, and is there one? */
  PetscReal *penalty_force;                 /* [n][nr] what bodies lose to the penalty */
  PetscReal *power, *work; /* [n] of the whole stress on the fluid around; as the equations of the step have it */
};

/* ---- velocities ---- */

static Penalty get_penalty(Couple c)
{
  return (*c->method.table->penalty)(c->method.data);
}

/* Of body k, at a node */
static PetscErrorCode evaluate(Couple c, PetscInt k, PetscBool surface, PetscInt i, PetscReal v[], PetscReal n[])
{
  PetscReal x[3];

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < c->loc->dim; a++)
    x[a] = c->rigid.X[k][a] + MeshNearest(c->loc, a, c->loc->x[i * c->loc->dim + a] - c->rigid.X[k][a]);
  PetscCall(BodiesGetSlip(c->bodies, k, c->rigid.X[k], c->rigid.q[k], c->step->time, surface, x, v, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode evaluate_continued(void *couple, PetscInt k, PetscInt node, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(evaluate((Couple)couple, k, PETSC_FALSE, node, v, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode evaluate_nodes(Couple c, CoupleSlip s)
{
  const PetscInt  dim = c->loc->dim;
  const PetscInt *body, *node;
  PetscInt        n;

  PetscFunctionBeginUser;
  PetscCall(IndicatorGetNodes(c->indicator, &body, &n, &node));
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt  i = node[e], k = body[i];
    const PetscBool surface = (PetscBool)(k >= 0 && CoupleIsInactiveInside(c, k));

    if (k < 0 || !BodiesGetGroup(c->s, k)->slip || (surface && !c->method.on_surface[i])) continue;
    PetscCall(evaluate(c, k, surface, i, s->velocity + i * dim, s->normal + i * dim));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is node j of cell e on the surface of a body with slip whose inside is no part of the fluid? Its number, and the
   part of this cell in int phi n over the surface */
static PetscBool get_surface(Couple c, PetscInt e, PetscInt j, const PetscInt body[], const PetscReal *const B[],
                             PetscInt *node, PetscReal normal[3])
{
  const PetscInt dim = c->loc->dim, i = c->loc->cell_node[e * c->loc->nb + j], k = body[i];

  *node = i;
  if (k < 0 || !CoupleIsInactiveInside(c, k) || !BodiesGetGroup(c->s, k)->slip) return PETSC_FALSE;
  for (PetscInt a = 0; a < 3; a++) normal[a] = a < dim ? -B[e][j * dim + a] : 0;
  return PETSC_TRUE;
}

/* The mesh's surface is not quite the body's (narrow gaps above all): what flows through it is taken back, evenly */
static PetscErrorCode close_surfaces(Couple c, CoupleSlip s)
{
  const MeshLocal        *l   = c->loc;
  const PetscInt          dim = l->dim;
  const PetscReal *const *B;
  const PetscInt         *body, *cell, *node;
  PetscReal(*sum)[2], normal[3]; /* [n] flow, area */
  PetscInt n, i;

  PetscFunctionBeginUser;
  if (!c->method.inactive_inside) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetCellDivergence(c->flow, &B));
  PetscCall(IndicatorGetCells(c->indicator, &n, &cell));
  PetscCall(IndicatorGetNodes(c->indicator, &body, NULL, NULL));
  PetscCall(PetscCalloc1(c->s->n, &sum));
  for (PetscInt e = 0; e < n * l->nb; e++) {
    if (!get_surface(c, cell[e / l->nb], e % l->nb, body, B, &i, normal)) continue;
    for (PetscInt a = 0; a < dim; a++) {
      sum[body[i]][0] += normal[a] * s->velocity[i * dim + a];
      sum[body[i]][1] += normal[a] * s->normal[i * dim + a];
    }
  }
  PetscCall(BodiesSumLocal(c->bodies, 2, (PetscReal *)sum));
  PetscCall(IndicatorGetNodes(c->indicator, NULL, &n, &node));
  for (PetscInt e = 0; e < n * dim; e++) {
    const PetscInt k = body[node[e / dim]], at = node[e / dim] * dim + e % dim;

    if (k >= 0 && sum[k][1] > 0 && c->method.on_surface[node[e / dim]])
      s->velocity[at] -= sum[k][0] / sum[k][1] * s->normal[at];
  }
  PetscCall(PetscFree(sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* int n x s over the surfaces of bodies whose inside is no part of the fluid, times mu */
static PetscErrorCode find_torques(Couple c, CoupleSlip s)
{
  const MeshLocal        *l   = c->loc;
  const PetscInt          dim = l->dim;
  const PetscReal *const *B;
  const PetscInt         *body, *cell;
  PetscInt                n, i;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero((PetscReal *)s->torque, 3 * c->s->n));
  if (!c->method.inactive_inside || FlowHasSymmetricStress(c->flow)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetCellDivergence(c->flow, &B));
  PetscCall(IndicatorGetNodes(c->indicator, &body, NULL, NULL));
  PetscCall(IndicatorGetCells(c->indicator, &n, &cell));
  for (PetscInt t = 0; t < n; t++)
    for (PetscInt j = 0; j < l->nb; j++) {
      PetscReal normal[3], v[3] = {0, 0, 0}, moment[3];

      if (!get_surface(c, cell[t], j, body, B, &i, normal)) continue;
      for (PetscInt a = 0; a < dim; a++) v[a] = s->velocity[i * dim + a];
      cross(normal, v, moment);
      for (PetscInt a = 0; a < 3; a++) s->torque[body[i]][a] += c->par->solvent * moment[a];
    }
  PetscCall(BodiesSumLocal(c->bodies, 3, (PetscReal *)s->torque));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_slip(Couple c, void *data)
{
  CoupleSlip      s     = (CoupleSlip)data;
  const PetscReal theta = c->step->theta;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(s->velocity, c->loc->nnode_all * c->loc->dim));
  PetscCall(evaluate_nodes(c, s));
  for (PetscInt g = 0; g < c->s->ngroups; g++)
    if (c->s->group[g].slip && BodySlipScalar(c->s->group[g].slip))
      PetscCall(CoupleAddPhoreticSlip(c, g, s->normal, s->velocity));
  PetscCall(close_surfaces(c, s));
  PetscCall(ConstraintSetSlip(c->constraint, s->velocity));
  PetscCall(find_torques(c, s));
  PetscCall(PetscArrayzero(c->rigid.slip, c->s->n * c->nr));
  PetscCall(PetscArrayzero(s->penalty_force, c->s->n * c->nr));
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal *old     = s->torque_old[k][3] != 0 ? s->torque_old[k] : s->torque[k];
    const PetscReal  none[3] = {0, 0, 0};

    for (PetscInt i = c->loc->dim; i < c->nr; i++)
      c->rigid.slip[k * c->nr + i] += theta * RigidValue(c->loc->dim, none, s->torque[k], i) +
                                      (1 - theta) * RigidValue(c->loc->dim, none, old, i);
    for (PetscInt i = 0; i < c->nr; i++) c->rigid.g[k * c->nr + i] -= c->rigid.slip[k * c->nr + i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the penalty holds in this step; perhaps several times, when the viscosity has changed it */
static PetscErrorCode load_penalty(Couple c, void *data)
{
  CoupleSlip s = (CoupleSlip)data;

  PetscFunctionBeginUser;
  if (!c->method.terms) {
    PetscCall(FlowAddForce(c->flow, s, NULL));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt i = 0; i < c->s->n * c->nr; i++) {
    c->rigid.slip[i] -= s->penalty_force[i];
    c->rigid.g[i] += s->penalty_force[i];
    s->penalty_force[i] = 0;
  }
  PetscCall(PetscArrayzero(s->load, c->loc->nnode_all * c->loc->dim));
  PetscCall(PenaltySetSlip(get_penalty(c), evaluate_continued, c, s->load, s->penalty_force));
  PetscCall(BodiesSumLocal(c->bodies, c->nr, s->penalty_force));
  for (PetscInt i = 0; i < c->s->n * c->nr; i++) {
    c->rigid.slip[i] += s->penalty_force[i];
    c->rigid.g[i] -= s->penalty_force[i];
  }
  PetscCall(FlowAddForce(c->flow, s, s->load));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- power ---- */

/* Of cell e, with its residual r, into the bodies of its nodes */
static PetscErrorCode add_power(Couple c, CoupleSlip s, PetscInt e, const PetscInt body[], const PetscReal r[])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, *node = l->cell_node + e * l->nb;
  PetscReal        v[MESH_MAX_NB * 3], transposed;
  PetscInt         done = -1; /* bodies up to this number */

  PetscFunctionBeginUser;
  for (;;) {
    PetscInt k = PETSC_MAX_INT;

    for (PetscInt j = 0; j < l->nb; j++)
      if (body[node[j]] > done && body[node[j]] < k && BodiesGetGroup(c->s, body[node[j]])->slip) k = body[node[j]];
    if (k == PETSC_MAX_INT) PetscFunctionReturn(PETSC_SUCCESS);
    done = k;
    for (PetscInt j = 0; j < l->nb; j++)
      for (PetscInt a = 0; a < dim; a++) {
        v[j * dim + a] = body[node[j]] == k ? s->velocity[node[j] * dim + a] : 0;
        s->work[k] += v[j * dim + a] * r[j * dim + a];
      }
    if (!CoupleIsInactiveInside(c, k)) continue;
    PetscCall(FlowCellTransposedPower(c->flow, e, c->field.u, v, &transposed));
    s->power[k] += transposed;
  }
}

static PetscErrorCode find_power(Couple c, void *data)
{
  CoupleSlip       s  = (CoupleSlip)data;
  const MeshLocal *l  = c->loc;
  const PetscInt   nr = l->nb * l->dim, *body, *cell;
  PetscReal        several[FLOW_CELLS * MESH_MAX_NB * 3];
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(IndicatorGetNodes(c->indicator, &body, NULL, NULL));
  PetscCall(IndicatorGetCells(c->indicator, &n, &cell));
  PetscCall(PetscArrayzero(s->power, c->s->n));
  PetscCall(PetscArrayzero(s->work, c->s->n));
  for (PetscInt t = 0; t < n; t++) {
    if (t % FLOW_CELLS == 0)
      PetscCall(FlowCellResiduals(c->flow, PetscMin(FLOW_CELLS, n - t), cell + t, c->field.u, c->field.p, several));
    PetscCall(add_power(c, s, cell[t], body, several + t % FLOW_CELLS * nr));
  }
  if (c->method.terms) PetscCall(PenaltyAddSlipPower(get_penalty(c), c->field.u, c->rigid.U, s->work, NULL));
  PetscCall(BodiesSumLocal(c->bodies, 1, s->power));
  PetscCall(BodiesSumLocal(c->bodies, 1, s->work));
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal inside = 0;

    if (!CoupleIsInactiveInside(c, k)) PetscCall(BodiesGetSlipInside(c->bodies, k, c->step->time, &inside));
    s->power[k] += s->work[k] - c->par->viscosity * inside;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_energy(Couple c, void *data, CouplePower *w)
{
  CoupleSlip s   = (CoupleSlip)data;
  PetscReal  sum = 0;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++)
    if (c->s->own[k] && !c->s->removed[k]) sum += s->work[k];
  PetscCall(BodiesSum(c->bodies, 1, &sum));
  w->power += sum;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* No force holds a swimmer, and the sum of forces by which the error of momentum is measured would be next to nothing:
   its tractions count as the drag of a sphere (disc: 4 pi mu) that is towed by the power of its slip */
static PetscErrorCode add_size(Couple c, void *data, const FlowDiagnostics *d, CoupleBalance *b)
{
  CoupleSlip s   = (CoupleSlip)data;
  PetscReal  sum = 0;

  PetscFunctionBeginUser;
  (void)d;
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal drag = (c->loc->dim == 2 ? 4 : 6 * BodiesGetRadius(c->s, k)) * PETSC_PI * c->par->viscosity;

    if (!c->s->own[k] || c->s->removed[k] || !BodiesGetGroup(c->s, k)->slip) continue;
    sum += PetscSqrtReal(drag * PetscMax(0, s->power[k]));
  }
  PetscCall(BodiesSum(c->bodies, 1, &sum));
  b->size += sum;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAddSlipLoss(Couple c, const PetscReal v[], const PetscReal V[], PetscReal *power)
{
  PetscReal *work, *penalty_force;

  PetscFunctionBeginUser;
  if (!c->method.terms) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc2(c->s->n, &work, c->s->n, &penalty_force));
  PetscCall(PenaltyAddSlipPower(get_penalty(c), c->field.u, c->rigid.U, work, NULL));
  PetscCall(PenaltyAddSlipPower(get_penalty(c), v, V, NULL, penalty_force));
  for (PetscInt k = 0; k < c->s->n; k++) *power += work[k] - penalty_force[k];
  PetscCall(PetscFree2(work, penalty_force));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool CoupleHasSlip(Couple c)
{
  return (PetscBool)(c->slip != NULL);
}

PetscErrorCode CoupleGetSwimming(Couple c, PetscReal *speed, PetscReal *power)
{
  PetscReal sum[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal e[3];

    if (!c->s->own[k] || c->s->removed[k] || !BodiesGetGroup(c->s, k)->slip) continue;
    PetscCall(BodiesGetSwimDirection(c->bodies, k, c->rigid.q[k], e));
    for (PetscInt a = 0; a < c->loc->dim; a++) sum[0] += e[a] * c->rigid.U[k * c->nr + a];
    sum[1] += 1;
    sum[2] += c->slip->power[k];
  }
  PetscCall(BodiesSum(c->bodies, 3, sum));
  *speed = sum[1] > 0 ? sum[0] / sum[1] : 0;
  *power = sum[2];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode keep_torques(Couple c, void *data)
{
  CoupleSlip s = (CoupleSlip)data;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscCall(PetscArraycpy(s->torque_old[k], s->torque[k], 3));
    s->torque_old[k][3] = 1;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode discard(Couple c, void *data)
{
  CoupleSlip s = (CoupleSlip)data;

  PetscFunctionBeginUser;
  (void)c;
  PetscCall(PetscFree3(s->velocity, s->normal, s->load));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_on_mesh(Couple c, void *data, Mesh *old)
{
  CoupleSlip     s = (CoupleSlip)data;
  const PetscInt n = c->loc->nnode_all * c->loc->dim;

  PetscFunctionBeginUser;
  (void)old;
  PetscCall(PetscCalloc3(n, &s->velocity, n, &s->normal, n, &s->load));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit(Couple c, void *data, State state)
{
  BodyRows rows;

  PetscFunctionBeginUser;
  PetscCall(BodiesBeginRows(c->bodies, &rows));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "slip_torque", 4, (PetscReal *)((CoupleSlip)data)->torque_old));
  PetscCall(BodiesEndRows(&rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Couple c, void *data)
{
  CoupleSlip s = (CoupleSlip)data;

  PetscFunctionBeginUser;
  PetscCall(discard(c, s));
  PetscCall(BodiesDetach(c->bodies, (void **)&s->torque));
  PetscCall(BodiesDetach(c->bodies, (void **)&s->torque_old));
  PetscCall(BodiesDetach(c->bodies, (void **)&s->penalty_force));
  PetscCall(BodiesDetach(c->bodies, (void **)&s->power));
  PetscCall(BodiesDetach(c->bodies, (void **)&s->work));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->rigid.slip));
  PetscCall(PetscFree(c->slip));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant SLIP = {.name         = "slip",
                                       .rows         = set_slip,
                                       .assemble     = load_penalty,
                                       .force        = find_power,
                                       .energy       = add_energy,
                                       .balance      = add_size,
                                       .advance      = keep_torques,
                                       .discard      = discard,
                                       .after_remesh = make_on_mesh,
                                       .visit        = visit,
                                       .destroy      = destroy};

/* Modes are continued to the inside of bodies, other slip only to the surface */
static PetscErrorCode check_group(Couple c, const BodyGroup *g)
{
  const char *name;
  PetscInt    scalar = 0;

  PetscFunctionBeginUser;
  if (!g->slip) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(!g->body_fitted, c->comm, PETSC_ERR_USER_INPUT,
             "Group '%s' is a hole of the mesh, whose surface takes no -particle_%s_slip_*: give the velocity of its boundary, -flow_bc_%s_velocity",
             g->name, g->name, g->surface);
  PetscCheck(c->method.table->moves_nodes || BodySlipHasModes(g->slip), c->comm, PETSC_ERR_USER_INPUT,
             "-couple_method %s has fluid inside of bodies, to which -particle_%s_slip_velocity and _slip_mobility are not continued: use -couple_method aligned, or for a disc or sphere -particle_%s_slip_modes",
             c->method.table->name, g->name, g->name);
  name = BodySlipScalar(g->slip);
  if (name) PetscCall(CoupleFindScalar(c, name, &scalar));
  PetscCheck(scalar >= 0, c->comm, PETSC_ERR_USER_INPUT,
             "-particle_%s_slip_scalar %s is none of -scalars: name one of them", g->name, name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Arrays per local body, zeros */
static PetscErrorCode attach_arrays(Couple c, CoupleSlip s)
{
  const size_t real = sizeof(PetscReal), slots = (size_t)c->nr * sizeof(PetscReal);

  PetscFunctionBeginUser;
  PetscCall(BodiesAttachWork(c->bodies, sizeof(*s->torque), (void **)&s->torque));
  PetscCall(BodiesAttach(c->bodies, sizeof(*s->torque_old), (void **)&s->torque_old));
  PetscCall(BodiesAttachWork(c->bodies, slots, (void **)&s->penalty_force));
  PetscCall(BodiesAttachWork(c->bodies, real, (void **)&s->power));
  PetscCall(BodiesAttachWork(c->bodies, real, (void **)&s->work));
  PetscCall(BodiesAttachWork(c->bodies, slots, (void **)&c->rigid.slip));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAddSlip(Couple c)
{
  PetscBool steady = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (!BodiesHaveSlip(c->bodies)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptPeekBool("-sim_steady", &steady));
  PetscCheck(!steady || !BodiesSlipChanges(c->bodies), c->comm, PETSC_ERR_USER_INPUT,
             "-particle_<group>_slip_* changes in time, and such a flow has no steady state: remove t, or run in time without -sim_steady");
  for (PetscInt g = 0; g < c->s->ngroups; g++) PetscCall(check_group(c, c->s->group + g));
  PetscCall(PetscNew(&c->slip));
  PetscCall(attach_arrays(c, c->slip));
  PetscCall(CoupleAddParticipant(c, &SLIP, c->slip));
  PetscFunctionReturn(PETSC_SUCCESS);
}
