/* Flow: what the solution of a step amounts to: residual, derivative, pressure and stress of single cells, diagnostics
   of the whole (see flow.h).

   Quadrature, form of the convection and coefficients of the step are those of the assembly; the terms of
   FlowAddCellTerms and other owners are not part. Only FlowDiagnose is collective, and keeps what the next step wants:
   the CFL number and the momentum that convection took. */
#include "compat.h"
#include "impl.h"
#include "lanes.h"
#include "base/inline.h"

_Static_assert(FLOW_CELLS <= BATCH_LANES, "cells that are cheap together stand side by side");

/* Nodal acceleration, theta-velocity and convecting velocity of a cell for the step's solution u */
static void gather_step(const struct _p_Flow *f, PetscInt c, const PetscReal u[], PetscReal al[], PetscReal vl[],
                        PetscReal wl[])
{
  const MeshLocal *l = f->loc;
  const FlowStep  *s = &f->step;

  for (PetscInt j = 0; j < l->nb; j++) {
    for (PetscInt a = 0; a < l->dim; a++) {
      const PetscInt i = l->cell_node[c * l->nb + j] * l->dim + a, k = j * l->dim + a;

      al[k] = s->ct * u[i] - s->d0 * f->u[i] - s->d1 * f->u_old[i] -
              (f->force.source ? f->force.source[i] / FlowDensity(f, c) : 0);
      vl[k] = s->theta * u[i] + (1 - s->theta) * f->u[i];
      wl[k] = f->w[i];
    }
  }
  MeshCellGather(l, c, l->dim, al);
  MeshCellGather(l, c, l->dim, vl);
  MeshCellGather(l, c, l->dim, wl);
}

/* What was found beside u and p (finer.c) */
static void add_finer(Flow f, PetscInt c, PetscReal r[])
{
  const PetscInt n = f->loc->nb * f->loc->dim;

  for (PetscInt i = 0; i < n && f->finer && c < f->loc->ncell; i++) r[i] += f->finer[c * n + i];
}

PetscErrorCode FlowCellResidual(Flow f, PetscInt c, const PetscReal u[], const PetscReal p[], PetscReal r[])
{
  const PetscInt nk = f->loc->dim + 1, n = f->loc->nb * f->loc->dim;
  PetscReal      al[MESH_MAX_NB * 3], vl[MESH_MAX_NB * 3], wl[MESH_MAX_NB * 3];
  ElementMetric  m;

  PetscFunctionBeginUser;
  PetscCall(FlowBringFields(f));
  gather_step(f, c, u, al, vl, wl);
  PetscCall(FlowCellMetric(f, c, &m));
  FlowCellMomentum(f, c, &m, al, vl, wl, r);
  MeshCellScatter(f->loc, c, f->loc->dim, r);
  if (f->force.traction) TractionAddCell(f->force.traction, c, -1, r);
  for (PetscInt k = 0; k < nk; k++)
    for (PetscInt i = 0; i < n; i++) r[i] -= p[c * nk + k] * f->cells.b[c][k * n + i];
  add_finer(f, c, r);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* r [size] -= B^T p of a cell, dimensions as constants */
INLINE void subtract_pressure(const int dim, const int size, const PetscReal *restrict b, const PetscReal p[],
                              PetscReal *restrict r)
{
  for (int i = 0; i < size; i++) {
    PetscReal sum = 0;

    for (int k = 0; k <= dim; k++) sum += p[k] * b[k * size + i];
    r[i] -= sum;
  }
}

PetscErrorCode FlowCellResiduals(Flow f, PetscInt n, const PetscInt cells[], const PetscReal u[], const PetscReal p[],
                                 PetscReal r[])
{
  const MeshLocal *l    = f->loc;
  const PetscInt   size = l->nb * l->dim;
  LaneCells        gathered;
  Lanes            x[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n && !FlowIsPlain(f); i++) PetscCall(FlowCellResidual(f, cells[i], u, p, r + i * size));
  if (!FlowIsPlain(f) || n == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowBringFields(f));
  LanesTake(f, n, cells, &gathered);
  PetscCall(LanesMomentum(f, &gathered, u, x));
  for (PetscInt k = 0; k < n; k++) {
    const PetscInt   c  = cells[k];
    const PetscReal *pc = p + c * (l->dim + 1);
    PetscReal       *rl = r + k * size;

    for (PetscInt i = 0; i < size; i++) rl[i] = FlowIsInactive(f, c) ? 0 : Lane(x, k)[i * BATCH_LANES];
    MeshCellScatter(l, c, l->dim, rl);
    if (f->force.traction) TractionAddCell(f->force.traction, c, -1, rl);
    if (l->dim == 2) subtract_pressure(2, 18, f->cells.b[c], pc, rl);
    else subtract_pressure(3, 81, f->cells.b[c], pc, rl);
    add_finer(f, c, rl);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCellPressure(Flow f, PetscInt c, const PetscReal p[], const PetscReal x[], PetscReal *value)
{
  const MeshLocal *l      = f->loc;
  const PetscReal *centre = l->x + l->cell_node[c * l->nb + l->nb / 2] * l->dim, *pc = p + c * (l->dim + 1);

  PetscFunctionBeginUser;
  *value = pc[0];
  for (PetscInt d = 0; d < l->dim; d++) {
    *value += pc[1 + d] * MeshNearest(l, d, x[d] - centre[d]) / f->cells.size[c];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCellStressForce(Flow f, PetscInt c, const PetscReal u[], const PetscReal p[],
                                   const PetscReal alpha[], const PetscReal X[3], PetscReal force[3],
                                   PetscReal torque[3])
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, nb = l->nb, nk = dim + 1;
  PetscReal        ul[MESH_MAX_NB * 3], xc[MESH_MAX_NB * 3], al[MESH_MAX_NB];
  ElementMetric    m;

  PetscFunctionBeginUser;
  MeshCellValues(l, c, l->dim, u, ul);
  PetscCall(PetscArraycpy(al, alpha, nb));
  MeshCellGather(l, c, 1, al);
  PetscCall(MeshCellCoordinates(f->mesh, c, xc));
  PetscCall(FlowCellMetric(f, c, &m));
  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal *phi = f->element.phi + q * f->element.nbp, *centre = xc + (nb / 2) * dim;
    FlowGradients    g;
    PetscReal grad[3][3], extra[3][3] = {{0}}, ga[3] = {0, 0, 0}, x[3] = {0, 0, 0}, t[3] = {0, 0, 0}, r[3] = {0, 0, 0},
                          pressure = p[c * nk], mu;

    ElementGradients(&f->element, &m, q, g);
    FlowVelocityGradient(f, g, ul, grad);
    mu = f->material ? (*f->material->stress)(f, c, &m, q, grad, extra) : f->par.viscosity;
    for (PetscInt j = 0; j < nb; j++) {
      for (PetscInt d = 0; d < dim; d++) {
        x[d] += phi[j] * xc[j * dim + d];
        ga[d] += al[j] * g[d][j];
      }
    }
    for (PetscInt d = 0; d < dim; d++) {
      pressure += p[c * nk + 1 + d] * (x[d] - centre[d]) / f->cells.size[c];
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

PetscErrorCode FlowCellTransposedPower(Flow f, PetscInt c, const PetscReal u[], const PetscReal s[], PetscReal *power)
{
  const PetscInt dim = f->loc->dim, n = f->loc->nb * dim;
  PetscReal      al[MESH_MAX_NB * 3], vl[MESH_MAX_NB * 3], wl[MESH_MAX_NB * 3], sl[MESH_MAX_NB * 3];
  ElementMetric  m;

  PetscFunctionBeginUser;
  *power = 0;
  if (FlowIsInactive(f, c) || FlowHasSymmetricStress(f)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowBringFields(f));
  gather_step(f, c, u, al, vl, wl);
  PetscCall(PetscArraycpy(sl, s, n));
  MeshCellGather(f->loc, c, dim, sl);
  PetscCall(FlowCellMetric(f, c, &m));
  for (PetscInt q = 0; q < f->element.nq; q++) {
    FlowGradients g;
    PetscReal     of_v[3][3], of_s[3][3], sum = 0;

    ElementGradients(&f->element, &m, q, g);
    FlowVelocityGradient(f, g, vl, of_v);
    FlowVelocityGradient(f, g, sl, of_s);
    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt b = 0; b < dim; b++) sum += of_v[b][a] * of_s[a][b];
    *power += m.weight[q] * f->par.solvent * sum;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

typedef long long Chosen __attribute__((vector_size(sizeof(Lanes))));

static inline Lanes larger(Lanes a, Lanes b)
{
  const Chosen second = a < b;

  return (Lanes)((second & (Chosen)b) | (~second & (Chosen)a));
}

/* With nodal values x of u */
static void add_speeds(const struct _p_Flow *f, const LaneCells *b, Lanes x[], FlowAmounts *sum)
{
  const PetscInt dim     = f->loc->dim;
  Lanes          fastest = {0}, through = {0}; /* squares; the latter as the cells see it */

  for (PetscInt j = 0; j < f->loc->nb; j++) {
    Lanes speed = {0}, seen = {0};

    for (PetscInt a = 0; a < dim; a++) {
      const Lanes v = x[j * dim + a], relative = v - f->step.frame[a];

      speed += v * v;
      seen += relative * relative;
    }
    fastest = larger(fastest, speed);
    through = larger(through, seen);
  }
  for (PetscInt k = 0; k < b->n; k++) {
    const PetscInt  c    = b->cell[k];
    const PetscReal seen = PetscSqrtReal(*Lane(&through, k));

    sum->speed      = PetscMax(sum->speed, *Lane(&fastest, k));
    sum->cfl        = PetscMax(sum->cfl, seen * f->step.dt / f->cells.size[c]);
    sum->speed_size = PetscMax(sum->speed_size, seen * f->cells.size[c] * FlowDensityRatio(f, c) *
                                                  (FlowVaries(f) ? f->par.viscosity / f->viscosity.cell[c] : 1));
  }
}

/* imposed [ncell]: int div u that owners ask for, NULL: none do */
static PetscErrorCode add_amounts(Flow f, const LaneCells *b, const PetscReal u[], const PetscReal imposed[],
                                  FlowAmounts *sum)
{
  const MeshLocal *l     = f->loc;
  const PetscReal  theta = f->step.theta, one = 1;
  Lanes            x[MESH_MAX_NB * 3], v[MESH_MAX_NB * 3], w[MESH_MAX_NB * 3];
  BatchGeometry    g;
  BatchIntegrals   out;

  PetscFunctionBeginUser;
  PetscCall(LanesGeometry(f, b, &g));
  LanesGather(l, b, 1, &u, &one, x);
  if (theta < 1) LanesGather(l, b, 2, (const PetscReal *[]){u, f->u}, (PetscReal[]){theta, 1 - theta}, v);
  if (f->par.convection) LanesGather(l, b, 1, (const PetscReal *[]){f->w}, &one, w);
  BatchIntegrate(f->tables, b->box, &g, f->par.skew, x, theta < 1 ? v : NULL, f->par.convection ? w : NULL, &out);
  for (PetscInt k = 0; k < b->n; k++) {
    const PetscReal ratio  = FlowDensityRatio(f, b->cell[k]);
    const PetscReal excess = *Lane(&out.divergence, k) - (imposed ? imposed[b->cell[k]] : 0);

    sum->square += ratio * *Lane(&out.square, k);
    sum->divergence += PetscSqr(excess) / PetscPowRealInt(f->cells.size[b->cell[k]], (int)l->dim);
    for (PetscInt d = 0; d < l->dim; d++) sum->flux[d] += ratio * *Lane(&out.flux[d], k);
  }
  add_speeds(f, b, x, sum);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Row sums of the mass matrix integrate nodal fields exactly; a constant dimension keeps the sums in registers */
INLINE void add_nodes(const int dim, const struct _p_Flow *f, const PetscReal u[], FlowAmounts *sum)
{
  const FlowStep  *s         = &f->step;
  const PetscReal *inertia   = FlowInertia(f);
  PetscReal        weight    = 0; /* that is not in the pressure, over density and gravity */
  PetscReal        change[3] = {0}, driven[3] = {0}, velocity[3] = {0}, volume = 0;

  for (PetscInt i = 0; i < f->loc->nnode; i++) {
    const PetscReal m = f->cells.lumped[i], inertial = inertia[i];

    for (PetscInt a = 0, k = i * dim; a < dim; a++, k++) {
      change[a] += inertial * (s->ct * u[k] - s->d0 * f->u[k] - s->d1 * f->u_old[k]);
      velocity[a] += m * u[k];
      if (f->force.source) driven[a] += m * f->force.source[k];
    }
    volume += m;
    weight += inertial - m;
  }
  for (PetscInt a = 0; a < dim; a++) {
    sum->change[a]   = change[a];
    sum->velocity[a] = velocity[a];
    sum->driven[a]   = driven[a] + f->par.force[a] * volume;
    if (f->properties.density) sum->driven[a] += weight * f->par.density * f->par.gravity[a];
  }
  sum->volume = volume;
}

PetscErrorCode FlowDiagnose(Flow f, const PetscReal u[], const PetscReal p[], FlowDiagnostics *out)
{
  const PetscReal rho     = f->par.density;
  FlowAmounts     of      = {0};
  LaneWalk        walk    = {0};
  PetscReal      *imposed = NULL;
  LaneCells       next;

  PetscFunctionBeginUser;
  if (u && !OnDeviceHelps(f)) {
    PetscCall(FlowBringFields(f));
    PetscCall(OwnersSumVolumes(f, p, &imposed));
    while (LanesNext(f, &walk, &next)) PetscCall(add_amounts(f, &next, u, imposed, &of));
    PetscCall(PetscFree(imposed));
    if (f->loc->dim == 2) add_nodes(2, f, u, &of);
    else add_nodes(3, f, u, &of);
  } else {
    if (u) PetscCall(OnDeviceSendSolution(f, u));
    PetscCall(OnDeviceMeasure(f, &of));
  }
  for (PetscInt d = 0; d < 3; d++) of.flux[d] *= rho;
  if (f->material && f->material->diagnose) PetscCall((*f->material->diagnose)(f, of.flux));
  if (f->force.traction) TractionSum(f->force.traction, of.traction);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &of, AMOUNTS_SUMMED, MPIU_REAL, MPIU_SUM, f->comm));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &of.cfl, 3, MPIU_REAL, MPIU_MAX, f->comm));
  for (PetscInt d = 0; d < 3; d++) {
    out->change[d]   = rho * of.change[d];
    out->flux[d]     = of.flux[d];
    out->driven[d]   = of.driven[d];
    out->traction[d] = of.traction[d];
    out->velocity[d] = of.velocity[d];
  }
  FlowKeepMomentum(f, out->flux, of.volume);
  out->volume         = of.volume;
  out->kinetic_energy = 0.5 * rho * of.square;
  out->divergence     = PetscSqrtReal(of.divergence);
  out->cfl = f->time.cfl = of.cfl;
  out->speed_max         = PetscSqrtReal(of.speed);
  out->cell_reynolds     = rho * of.speed_size / f->par.viscosity;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetGradientNorm(Flow f, const PetscReal u[], PetscReal *norm)
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim;
  PetscReal        sum = 0;

  PetscFunctionBeginUser;
  if (!u) PetscCall(OnDeviceGradientNorm(f, &sum));
  for (PetscInt c = 0; c < l->ncell && u; c++) {
    const PetscInt *node = l->cell_node + c * l->nb;
    PetscReal       g[9] = {0}; /* int du_i/dx_a: the row of B of the constant pressure, for every component */
    PetscReal       square_of_cell = 0;

    for (PetscInt j = 0; j < l->nb; j++)
      for (PetscInt a = 0; a < dim; a++)
        for (PetscInt i = 0; i < dim; i++) g[i * dim + a] += f->cells.b[c][j * dim + a] * u[node[j] * dim + i];
    for (PetscInt k = 0; k < dim * dim; k++) square_of_cell += PetscSqr(g[k]);
    sum += square_of_cell / PetscPowRealInt(f->cells.size[c], (int)dim);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &sum, 1, MPIU_REAL, MPIU_SUM, f->comm));
  *norm = PetscSqrtReal(sum);
  PetscFunctionReturn(PETSC_SUCCESS);
}
