/* Flow: what the solution of a step amounts to: residual, derivative, pressure and stress of single cells, diagnostics
   of the whole (see flow.h).

   Quadrature, form of the convection and coefficients of the step are those of the assembly; the terms of
   FlowSetCellTerms are not part of it. Changes nothing in the Flow. Only FlowDiagnose is collective. */
#include "compat.h"
#include "impl.h"

/* Nodal acceleration, theta-velocity and convecting velocity of a cell for the step's solution u */
static void gather_step(const struct _p_Flow *f, PetscInt c, const PetscReal u[], PetscReal al[], PetscReal vl[], PetscReal wl[])
{
  const MeshLocal *l = f->loc;
  const FlowStep  *s = &f->step;

  for (PetscInt j = 0; j < l->nb; j++) {
    for (PetscInt a = 0; a < l->dim; a++) {
      const PetscInt i = l->cell_node[c * l->nb + j] * l->dim + a, k = j * l->dim + a;

      al[k] = s->ct * u[i] - s->d0 * f->u[i] - s->d1 * f->u_old[i] - (f->source ? f->source[i] / f->par.density : 0);
      vl[k] = s->theta * u[i] + (1 - s->theta) * f->u[i];
      wl[k] = f->w[i];
    }
  }
  MeshCellGather(l, c, l->dim, al);
  MeshCellGather(l, c, l->dim, vl);
  MeshCellGather(l, c, l->dim, wl);
}

PetscErrorCode FlowCellResidual(Flow f, PetscInt c, const PetscReal u[], const PetscReal p[], PetscReal r[])
{
  const PetscInt nk = f->loc->dim + 1, n = f->loc->nb * f->loc->dim;
  PetscReal      al[MESH_MAX_NB * 3], vl[MESH_MAX_NB * 3], wl[MESH_MAX_NB * 3];
  ElementMetric  m;

  PetscFunctionBeginUser;
  gather_step(f, c, u, al, vl, wl);
  PetscCall(FlowCellMetric(f, c, &m));
  FlowCellMomentum(f, c, &m, al, vl, wl, r);
  MeshCellScatter(f->loc, c, f->loc->dim, r);
  for (PetscInt k = 0; k < nk; k++)
    for (PetscInt i = 0; i < n; i++) r[i] -= p[c * nk + k] * f->b[c][k * n + i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCellPressure(Flow f, PetscInt c, const PetscReal p[], const PetscReal x[], PetscReal *value)
{
  const MeshLocal *l      = f->loc;
  const PetscReal *centre = l->x + l->cell_node[c * l->nb + l->nb / 2] * l->dim, *pc = p + c * (l->dim + 1);

  PetscFunctionBeginUser;
  *value = pc[0];
  for (PetscInt d = 0; d < l->dim; d++) { *value += pc[1 + d] * MeshNearest(l, d, x[d] - centre[d]) / f->size[c]; }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCellStressForce(Flow f, PetscInt c, const PetscReal u[], const PetscReal p[], const PetscReal alpha[], const PetscReal X[3],
                                   PetscReal force[3], PetscReal torque[3])
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, nb = l->nb, nk = dim + 1;
  PetscReal        ul[MESH_MAX_NB * 3], xc[MESH_MAX_NB * 3], al[MESH_MAX_NB];
  ElementMetric    m;

  PetscFunctionBeginUser;
  FlowCellGather(l, c, u, ul);
  PetscCall(PetscArraycpy(al, alpha, nb));
  MeshCellGather(l, c, 1, al);
  PetscCall(MeshCellCoordinates(f->mesh, c, xc));
  PetscCall(FlowCellMetric(f, c, &m));
  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal *phi = f->element.phi + q * f->element.nbp, *centre = xc + (nb / 2) * dim;
    const PetscReal  mu = f->rheology ? f->mu[c * f->element.nq + q] : f->par.solvent + (f->eddy.name ? f->mu[c * f->element.nq + q] : 0);
    FlowGradients    g;
    PetscReal        grad[3][3], extra[3][3] = {{0}}, ga[3] = {0, 0, 0}, x[3] = {0, 0, 0}, t[3] = {0, 0, 0}, r[3] = {0, 0, 0}, pressure = p[c * nk];

    ElementGradients(&f->element, &m, q, g);
    FlowVelocityGradient(f, g, ul, grad);
    if (f->conformation) FlowPolymerStress(f, c, q, grad, extra);
    for (PetscInt j = 0; j < nb; j++) {
      for (PetscInt d = 0; d < dim; d++) {
        x[d] += phi[j] * xc[j * dim + d];
        ga[d] += al[j] * g[d][j];
      }
    }
    for (PetscInt d = 0; d < dim; d++) {
      pressure += p[c * nk + 1 + d] * (x[d] - centre[d]) / f->size[c];
      r[d] = MeshNearest(l, d, x[d] - X[d]);
    }
    for (PetscInt d = 0; d < dim; d++) {
      t[d] = pressure * ga[d];
      for (PetscInt e = 0; e < dim; e++) t[d] -= (mu * (grad[d][e] + grad[e][d]) + extra[d][e]) * ga[e];
      t[d] *= m.weight[q];
    }
    for (PetscInt d = 0; d < 3; d++) {
      force[d] += t[d];
      torque[d] += r[(d + 1) % 3] * t[(d + 2) % 3] - r[(d + 2) % 3] * t[(d + 1) % 3];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Force of the polymer at outflows on the own cells: rate [dim] += sum of its residual over all test functions, which
   is zero in cells without a node there */
static PetscErrorCode add_outflow(Flow f, PetscReal rate[])
{
  const MeshLocal *l    = f->loc;
  const PetscBool *open = ConformationOpen(f->conformation);

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal     r[MESH_MAX_NB * 3] = {0};
    PetscBool     any                = PETSC_FALSE;
    ElementMetric m;

    for (PetscInt j = 0; j < l->nb; j++) any = (PetscBool)(any || open[l->cell_node[c * l->nb + j]]);
    if (!any) continue;
    PetscCall(FlowCellMetric(f, c, &m));
    FlowAddPolymer(f, c, &m, NULL, r);
    for (PetscInt i = 0; i < l->nb * l->dim; i++) rate[i % l->dim] += r[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure_elasticity(Flow f)
{
  const MeshLocal *l      = f->loc;
  const PetscReal *psi    = ConformationPredicted(f->conformation);
  PetscReal        top[2] = {0, 0};
  FlowElasticity  *e      = &f->elastic;

  PetscFunctionBeginUser;
  e->energy = 0;
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal energy, trace, least;

    if (f->lumped[i] <= 0) continue;
    PolymerState(&f->polymer, l->dim, psi + 2 * l->dim * i, &energy, &trace, &least);
    e->energy += f->lumped[i] * energy;
    top[0] = PetscMax(top[0], trace);
    top[1] = PetscMax(top[1], 1 / least);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &e->energy, 1, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, top, 2, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  e->trace = top[0];
  e->least = top[1] > 0 ? 1 / top[1] : 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDiagnose(Flow f, const PetscReal u[], FlowDiagnostics *out)
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, nb = l->nb, n = nb * dim;
  /* energy, divergence^2, momentum; cfl, speed, speed times size */
  PetscReal sum[5] = {0, 0, 0, 0, 0}, top[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal        al[MESH_MAX_NB * 3], vl[MESH_MAX_NB * 3], wl[MESH_MAX_NB * 3], ul[MESH_MAX_NB * 3], us[MESH_MAX_NB * 3];
    PetscReal        rate[3], div = 0, fastest = 0, through = 0;
    const PetscReal *b = f->b[c];
    ElementMetric    m;

    FlowCellSlots(l, c, u, us);
    FlowCellGather(l, c, u, ul);
    gather_step(f, c, u, al, vl, wl);
    PetscCall(FlowCellMetric(f, c, &m));
    ElementRate(&f->element, &m, f->par.density, f->par.force, al, vl, f->par.convection ? wl : NULL, f->par.skew, rate);
    for (PetscInt d = 0; d < dim; d++) sum[2 + d] += rate[d];
    for (PetscInt i = 0; i < n; i++) div += b[i] * us[i];
    sum[1] += div * div / PetscPowRealInt(f->size[c], (int)dim);
    sum[0] += 0.5 * f->par.density * ElementSquare(&f->element, &m, ul);
    for (PetscInt j = 0; j < nb; j++) {
      PetscReal speed = 0, seen = 0; /* squares; as the cells see it */

      for (PetscInt a = 0; a < dim; a++) {
        speed += ul[j * dim + a] * ul[j * dim + a];
        seen += PetscSqr(ul[j * dim + a] - f->step.frame[a]);
      }
      fastest = PetscMax(fastest, speed);
      through = PetscMax(through, seen);
    }
    top[1] = PetscMax(top[1], PetscSqrtReal(fastest));
    if (f->det[c] == 0) continue; /* no cell of the fluid */
    through = PetscSqrtReal(through);
    top[0]  = PetscMax(top[0], through * f->step.dt / f->size[c]);
    top[2]  = PetscMax(top[2], through * f->size[c] * (f->rheology ? f->par.viscosity / f->mu_cell[c] : 1));
  }
  if (f->conformation) PetscCall(add_outflow(f, sum + 2));
  if (f->conformation) PetscCall(measure_elasticity(f));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 5, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, top, 3, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  out->kinetic_energy = sum[0];
  out->divergence     = PetscSqrtReal(sum[1]);
  for (PetscInt d = 0; d < 3; d++) out->momentum_rate[d] = sum[2 + d];
  out->cfl           = top[0];
  out->speed_max     = top[1];
  out->cell_reynolds = f->par.density * top[2] / f->par.viscosity;
  PetscFunctionReturn(PETSC_SUCCESS);
}
