/* Couple: energy of flow and bodies, and the power of what acts on them from outside (CoupleGetPower). Costs one
   pass over nodes and bodies: what prescribed nodes supply is known from the balance of momentum. And where the energy
   goes within (CoupleGetLosses): the equations of the step tested with the velocities in the middle of it. */
#include "compat.h"
#include "impl.h"
#include "bodies/local.h"
#include "bodies/mass.h"

/* How many own nodes have a normal longer than `least`, and which (rim, or NULL) */
static PetscInt list_rim(const MeshLocal *l, const PetscReal normal[], PetscReal least, PetscInt rim[])
{
  PetscInt n = 0;

  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal size = 0;

    for (PetscInt a = 0; a < l->dim; a++) size = PetscMax(size, PetscAbsReal(normal[i * l->dim + a]));
    if (size <= least) continue;
    if (rim) rim[n] = i;
    n++;
  }
  return n;
}

/* Nodal normals, area included and pointing out: int phi_i n over the boundary of the domain, as B^T 1, at the own
   nodes where it is more than round-off */
PetscErrorCode CoupleFindNormals(Couple c)
{
  const MeshLocal *l  = c->loc;
  const PetscInt   nk = l->dim + 1;
  PetscReal       *one, *normal, largest = 0;
  PetscInt         nrim;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(l->ncell * nk, &one, l->nnode_all * l->dim, &normal));
  for (PetscInt e = 0; e < l->ncell; e++) one[e * nk] = 1;
  PetscCall(FlowGradient(c->flow, 1, one, normal));
  for (PetscInt i = 0; i < l->nnode * l->dim; i++) largest = PetscMax(largest, PetscAbsReal(normal[i]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &largest, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  nrim = list_rim(l, normal, 1e-12 * largest, NULL);
  PetscCall(PetscMalloc2(nrim, &c->rim, nrim * l->dim, &c->outward));
  c->nrim = list_rim(l, normal, 1e-12 * largest, c->rim);
  for (PetscInt i = 0; i < nrim; i++) PetscCall(PetscArraycpy(c->outward + i * l->dim, normal + c->rim[i] * l->dim, l->dim));
  PetscCall(PetscFree2(one, normal));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Power of the pressure at openings */
static PetscErrorCode add_traction(Couple c, PetscReal *power)
{
  const MeshLocal *l = c->loc;
  PetscReal       *force;

  PetscFunctionBeginUser;
  if (!FlowHasTraction(c->flow)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(l->nnode_all * l->dim, &force));
  PetscCall(FlowAddTraction(c->flow, force));
  for (PetscInt i = 0; i < l->nnode_all * l->dim; i++) *power += force[i] * c->u[i];
  PetscCall(PetscFree(force));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Kinetic energy that flows in through the boundary, and the power of -flow_force */
static PetscErrorCode add_fluid(Couple c, const FlowParameters *par, PetscReal *power, PetscReal *inflow)
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim;
  const PetscReal *m, *source;
  PetscBool        driven = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(c->flow, &m));
  PetscCall(FlowGetSource(c->flow, &source));
  for (PetscInt a = 0; a < dim; a++) driven = (PetscBool)(driven || source || par->force[a] != 0);
  for (PetscInt i = 0; i < l->nnode && driven; i++)
    for (PetscInt a = 0; a < dim; a++) *power += (par->force[a] + (source ? source[i * dim + a] : 0)) * m[i] * c->u[i * dim + a];
  for (PetscInt i = 0; i < c->nrim; i++) {
    const PetscReal *u   = c->u + c->rim[i] * dim;
    PetscReal        out = 0, square = 0;

    for (PetscInt a = 0; a < dim; a++) {
      out += c->outward[i * dim + a] * (u[a] - c->step->frame[a]);
      square += u[a] * u[a];
    }
    if (out < 0) *inflow -= 0.5 * par->density * square * out;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is every degree of freedom of body k free or at rest? Others are moved by somebody outside. */
static PetscBool is_inside(Couple c, PetscInt k)
{
  for (PetscInt i = 0; i < c->nr; i++)
    if (!BodiesIsFree(c->bodies, k, i < c->loc->dim ? i : 3) && c->U[k * c->nr + i] != 0) return PETSC_FALSE;
  return PETSC_TRUE;
}

static PetscErrorCode add_body(Couple c, PetscInt k, const FlowParameters *par, CouplePower *w)
{
  const PetscInt   nr = c->nr;
  const PetscReal *U = c->U + k * nr, density = c->s->density[k], inside = CoupleInnerDensity(c, k, par);
  const PetscBool  free = is_inside(c, k);
  PetscReal        M[36], force[3], torque[3], g[6], joint[6], square = 0;

  PetscFunctionBeginUser;
  PetscCall(RigidGetMass(c->bodies, k, c->q[k], M));
  for (PetscInt i = 0; i < nr; i++)
    for (PetscInt j = 0; j < nr; j++) square += 0.5 * U[i] * M[i * nr + j] * U[j];
  w->size += density * square;
  w->energy += ((free ? density : 0) - inside) * square;
  PetscCall(BodiesGetLoad(c->bodies, k, par->density, par->gravity, force, torque));
  for (PetscInt a = 0; a < 3; a++) {
    force[a]  = free ? force[a] + c->s->contact_force[k][a] : -c->s->force[k][a];
    torque[a] = free ? torque[a] + c->s->contact_torque[k][a] : -c->s->torque[k][a];
  }
  PetscCall(RigidReduceForce(c->bodies, k, c->q[k], force, torque, g));
  PetscCall(CoupleGetJointForce(c, k, joint));
  for (PetscInt i = 0; i < nr; i++) w->power += (free ? g[i] + joint[i] : g[i]) * U[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool CoupleCountsFirst(Couple c)
{
  PetscMPIInt rank;

  (void)MPI_Comm_rank(BodiesComm(c->bodies), &rank);
  return (PetscBool)(rank == 0);
}

PetscErrorCode CoupleGetPower(Couple c, CouplePower *w)
{
  const FlowParameters *par;
  PetscReal             power[2] = {c->supplied, 0}, sum[3];

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(c->flow, &par));
  PetscCall(add_fluid(c, par, power, power + 1));
  PetscCall(add_traction(c, power));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, power, 2, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  *w = (CouplePower){.power = CoupleCountsFirst(c) ? power[0] + power[1] : 0};
  for (PetscInt k = 0; k < c->s->n; k++)
    if (c->s->own[k] && !c->s->gone[k] && !BodiesGetGroup(c->s, k)->hole) PetscCall(add_body(c, k, par, w));
  sum[0] = w->energy;
  sum[1] = w->power;
  sum[2] = w->size;
  PetscCall(BodiesSum(c->bodies, 3, sum));
  *w = (CouplePower){.energy = sum[0], .power = sum[1], .size = sum[2], .inflow = power[1]};
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- where it goes ---- */

/* v = theta u + (1 - theta) u^n, V likewise of the bodies */
static PetscErrorCode find_middle(Couple c, PetscReal v[], PetscReal V[])
{
  const PetscReal theta = c->step->theta;
  PetscReal      *u;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < c->loc->nnode_all * c->loc->dim; i++) v[i] = theta * c->u[i] + (1 - theta) * u[i];
  for (PetscInt k = 0; k < c->s->n; k++)
    for (PetscInt i = 0; i < c->nr; i++) {
      PetscReal now, old;

      CoupleGetHistory(c, k, i, &now, &old);
      V[k * c->nr + i] = theta * c->U[k * c->nr + i] + (1 - theta) * now;
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* -v . G U - V . (G^T u - H U) of the penalty, to which the flow's terms are the rest (solve/penaltyterm.h) */
static PetscErrorCode power_of_ties(Couple c, const PetscReal v[], const PetscReal V[], PetscReal *power)
{
  const PetscInt n = c->s->n * c->nr;
  PetscReal     *held, *drawn, *still;

  PetscFunctionBeginUser;
  if (!c->terms) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc3(n, &held, n, &drawn, n, &still));
  PetscCall(PenaltyTermAddForce(c->terms, c->constraint, c->u, c->U, held));
  PetscCall(PenaltyTermAddForce(c->terms, c->constraint, v, still, drawn));
  for (PetscInt i = 0; i < n; i++) *power -= V[i] * held[i] + c->U[i] * drawn[i];
  PetscCall(PetscFree3(held, drawn, still));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* -p . B u: nothing but in cells between two surfaces, which give way (-flow_pressure_gap_compressibility) */
static PetscErrorCode power_of_gaps(Couple c, PetscReal *power)
{
  const PetscInt n = c->loc->ncell * (c->loc->dim + 1);
  PetscReal     *divergence;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &divergence));
  PetscCall(FlowDivergence(c->flow, c->u, divergence));
  for (PetscInt i = 0; i < n; i++) *power -= c->p[i] * divergence[i];
  PetscCall(PetscFree(divergence));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_losses_of_body(Couple c, PetscInt k, const PetscReal V[], CoupleLosses *w)
{
  const PetscInt  nr  = c->nr;
  const PetscReal own = is_inside(c, k) ? c->s->density[k] : 0, excess = own - CoupleInnerDensity(c, k, c->par);
  PetscReal       M[36], now[6], old[6], momentum[6], g[6];

  PetscFunctionBeginUser;
  PetscCall(RigidGetMass(c->bodies, k, c->q[k], M));
  for (PetscInt i = 0; i < nr; i++) CoupleGetHistory(c, k, i, &now[i], &old[i]);
  PetscCall(CoupleHistory(c, k, M, now, old, momentum));
  PetscCall(RigidReduceForce(c->bodies, k, c->q[k], c->s->contact_force[k], c->s->contact_torque[k], g));
  for (PetscInt i = 0; i < nr; i++) {
    for (PetscInt j = 0; j < nr; j++) w->inertia += excess * V[i] * c->step->ct * M[i * nr + j] * c->U[k * nr + j];
    w->inertia -= excess * V[i] * momentum[i];
    if (own <= 0) continue;
    w->contact += V[i] * g[i];
    w->counted += c->U[k * nr + i] * g[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetLosses(Couple c, CoupleLosses *w)
{
  FlowPower p;
  PetscReal sum[4] = {0, 0, 0, 0}, *v, *V;

  PetscFunctionBeginUser;
  *w = (CoupleLosses){0};
  PetscCall(PetscMalloc2(c->loc->nnode_all * c->loc->dim, &v, c->s->n * c->nr, &V));
  PetscCall(find_middle(c, v, V));
  PetscCall(FlowGetPower(c->flow, c->u, v, &p));
  PetscCall(power_of_ties(c, v, V, &sum[2]));
  PetscCall(power_of_gaps(c, &sum[2]));
  for (PetscInt k = 0; k < c->s->n; k++)
    if (c->s->own[k] && !c->s->gone[k] && !BodiesGetGroup(c->s, k)->hole) PetscCall(add_losses_of_body(c, k, V + k * c->nr, w));
  PetscCall(PetscFree2(v, V));
  sum[0] = w->inertia;
  sum[1] = w->contact;
  sum[3] = w->counted;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 4, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  *w = (CoupleLosses){.inertia = p.inertia + sum[0], .viscous = p.viscous, .boundary = p.terms + sum[2], .contact = sum[1], .counted = sum[3]};
  PetscFunctionReturn(PETSC_SUCCESS);
}
