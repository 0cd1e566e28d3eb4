/* Flow, stress that is not Newtonian (flow.h): viscosity at the quadrature points, and what the symmetric form
   mu (grad u + grad u^T) adds to residuals, to the scalar matrix S and to the matrix A of all components.

     residual    (mu (grad u + grad u^T), grad v)
     S           (mu grad u, grad v): that of a component alone, for the preconditioner
     A           S for every component + (mu grad u^T, grad v); for Newton's method also (s (D_u : D) D_u, D_v) 4 with
                 s = (dmu/dg)/g, which is the derivative of mu 2 D_u

   And the stress of viscoelastic fluids (conformation.h) in the same places. */
#include "compat.h"
#include "../impl.h"

/* D = (grad + grad^T)/2; returns sqrt(2 D:D) */
static PetscReal get_strain(PetscInt dim, PetscReal grad[3][3], PetscReal D[3][3])
{
  PetscReal square = 0;

  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt b = 0; b < dim; b++) {
      D[a][b] = 0.5 * (grad[a][b] + grad[b][a]);
      square += D[a][b] * D[a][b];
    }
  return PetscSqrtReal(2 * square);
}

/* ---- viscosity ---- */

/* Of every local cell: rates of strain at the quadrature points in f->mu; *most: the largest */
static PetscErrorCode compute_rates(Flow f, PetscReal *most)
{
  const MeshLocal *l  = f->loc;
  const PetscInt   nq = f->element.nq;

  PetscFunctionBeginUser;
  *most = 0;
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal     ul[MESH_MAX_NB * 3];
    ElementMetric m;

    if (f->det[c] == 0) continue; /* no cell of the fluid */
    FlowCellGather(l, c, f->strain, ul);
    PetscCall(FlowCellMetric(f, c, &m));
    for (PetscInt q = 0; q < nq; q++) {
      FlowGradients g;
      PetscReal     grad[3][3], D[3][3];

      ElementGradients(&f->element, &m, q, g);
      FlowVelocityGradient(f, g, ul, grad);
      f->mu[c * nq + q] = get_strain(l->dim, grad, D);
      *most             = PetscMax(*most, f->mu[c * nq + q]);
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Means over cells, and over the cells of a node: mean logarithms, which favour neither end */
static PetscErrorCode compute_means(Flow f)
{
  const MeshLocal *l  = f->loc;
  const PetscInt   nq = f->element.nq;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal sum = 0;

    for (PetscInt q = 0; q < nq; q++) sum += PetscLogReal(f->mu[c * nq + q]);
    f->mu_cell[c] = PetscExpReal(sum / nq);
  }
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscInt begin = l->node_cell_ptr[i], end = l->node_cell_ptr[i + 1];
    PetscReal      sum = 0;

    for (PetscInt t = begin; t < end; t++) sum += PetscLogReal(f->mu_cell[l->node_cell[t]]);
    f->mu_node[i] = end > begin ? PetscExpReal(sum / (end - begin)) : f->par.viscosity;
  }
  PetscCall(MeshSyncNodes(f->mesh, 1, f->mu_node));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowUpdateViscosity(Flow f)
{
  const PetscInt nq = f->element.nq;
  PetscReal      most;

  PetscFunctionBeginUser;
  if (!f->mu || f->mu_current) PetscFunctionReturn(PETSC_SUCCESS);
  if (f->eddy.name) {
    PetscCall(FlowUpdateEddies(f));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(compute_rates(f, &most));
  FlowKeepRates(f);
  for (PetscInt i = 0; i < f->loc->ncell_all * nq; i++) {
    if (f->det[i / nq] == 0 || (most == 0 && f->step.dt == 0)) f->mu[i] = f->par.viscosity;
    else RheologyEvaluate(f->rheology, f->mu[i], &f->mu[i], NULL);
  }
  PetscCall(FlowExtendViscosity(f));
  PetscCall(compute_means(f));
  f->mu_current = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetRheologyVelocity(Flow f, const PetscReal v[])
{
  PetscFunctionBeginUser;
  if (!f->strain) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArraycpy(f->strain, v, f->loc->nnode_all * f->loc->dim));
  f->mu_current = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetRegularisation(Flow f, PetscReal rigid, PetscBool *less)
{
  PetscFunctionBeginUser;
  PetscCall(RheologySetRegularisation(f->rheology, rigid, less));
  if (f->rheology) f->mu_current = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool FlowHasYield(Flow f)
{
  return RheologyHasYield(f->rheology);
}

PetscBool FlowIsShearThinning(Flow f)
{
  PetscReal mu = 0;

  if (f->rheology) RheologyEvaluate(f->rheology, 0, &mu, NULL);
  return (PetscBool)(mu > f->par.viscosity);
}

PetscErrorCode FlowGetViscosity(Flow f, const PetscReal *cell[], const PetscReal *node[])
{
  PetscFunctionBeginUser;
  PetscCall(FlowUpdateViscosity(f));
  if (cell) *cell = f->rheology ? f->mu_cell : NULL;
  if (node) *node = f->rheology ? f->mu_node : NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- forms ---- */

void FlowGetStiffness(const struct _p_Flow *f, PetscInt c, PetscReal E[9])
{
  const PetscInt   dim = f->loc->dim, n = dim * dim;
  const PetscReal *tensor = ConformationTensors(f->conformation), rest = ConformationImplicit(f->conformation);

  for (PetscInt k = 0; k < n; k++) E[k] = tensor ? tensor[c * n + k] : k % (dim + 1) ? 0 : rest;
}

/* tau and P(grad u^n) at the lattice places of cell c: [nb][dim*dim] each; returns whether a node is one of an
   outflow */
static PetscBool gather_polymer(const struct _p_Flow *f, PetscInt c, PetscReal tau[], PetscReal grad[])
{
  const PetscInt   nb = f->loc->nb, n = f->loc->dim * f->loc->dim, *node = f->loc->cell_node + c * nb;
  const PetscReal *stress = ConformationStress(f->conformation), *gradient = ConformationGradient(f->conformation);
  const PetscBool *open = ConformationOpen(f->conformation);
  PetscBool        any  = PETSC_FALSE;

  for (PetscInt j = 0; j < nb; j++) {
    any = (PetscBool)(any || open[node[j]]);
    for (PetscInt k = 0; k < n; k++) {
      tau[j * n + k]  = stress[node[j] * n + k];
      grad[j * n + k] = gradient[node[j] * n + k];
    }
  }
  MeshCellGather(f->loc, c, n, tau);
  MeshCellGather(f->loc, c, n, grad);
  return any;
}

/* tau [nb][dim*dim] becomes T: less what devss adds to the matrix */
static void combine_polymer(PetscInt n, PetscReal devss, const PetscReal grad[], PetscReal tau[])
{
  for (PetscInt k = 0; k < n && devss > 0; k++) tau[k] -= devss * grad[k];
}

/* s [dim*dim] += weight grad F */
static void add_product(PetscInt dim, PetscReal weight, PetscReal grad[3][3], const PetscReal F[9], PetscReal s[9])
{
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt b = 0; b < dim; b++)
      for (PetscInt e = 0; e < dim; e++) s[a * dim + b] += weight * grad[a][e] * F[e * dim + b];
}

void FlowAddPolymer(Flow f, PetscInt c, const ElementMetric *m, const PetscReal ul[], PetscReal r[])
{
  const PetscInt   dim = f->loc->dim, nb = f->loc->nb, n = dim * dim, *node = f->loc->cell_node + c * nb;
  const PetscBool *open = ConformationOpen(f->conformation);
  const PetscReal  rest = ConformationImplicit(f->conformation), devss = ConformationDevss(f->conformation);
  PetscReal        T[MESH_MAX_NB * 9], G[MESH_MAX_NB * 9], E[9], F[9], un[MESH_MAX_NB * 3];
  PetscBool        any;

  if (f->det[c] == 0) return;
  any = gather_polymer(f, c, T, G);
  FlowCellGather(f->loc, c, f->u, un);
  FlowGetStiffness(f, c, E);
  PetscCallAbort(PETSC_COMM_SELF, PetscArraycpy(F, E, n));
  combine_polymer(nb * n, devss, G, T);
  for (PetscInt a = 0; a < dim; a++) {
    E[a * dim + a] -= rest;
    F[a * dim + a] -= devss;
  }
  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal *phi  = f->element.phi + q * f->element.nbp;
    PetscReal        t[9] = {0}, s[9] = {0}, div[3] = {0, 0, 0}, grad[3][3];
    FlowGradients    g;

    ElementGradients(&f->element, m, q, g);
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt k = 0; k < n; k++) t[k] += m->weight[q] * phi[j] * T[j * n + k];
    for (PetscInt j = 0; j < nb && any; j++)
      for (PetscInt k = 0; k < n; k++) div[k / dim] += m->weight[q] * g[k % dim][j] * T[j * n + k];
    FlowVelocityGradient(f, g, un, grad);
    add_product(dim, -m->weight[q], grad, F, s);
    if (ul && f->tensors) {
      FlowVelocityGradient(f, g, ul, grad);
      add_product(dim, m->weight[q], grad, E, s);
    }
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt k = 0; k < n; k++) {
        r[j * dim + k / dim] += s[k] * g[k % dim][j];
        if (!open[node[j]]) r[j * dim + k / dim] += t[k] * g[k % dim][j];
        else if (k % dim == 0) r[j * dim + k / dim] -= phi[j] * div[k / dim];
      }
  }
}

void FlowAddStiffness(Flow f, PetscInt c, const ElementMetric *m, PetscReal ce[])
{
  const PetscInt  dim = f->loc->dim, nb = f->loc->nb, nbp = f->element.nbp;
  const PetscReal rest = ConformationImplicit(f->conformation);
  PetscReal       E[9];

  if (f->det[c] == 0) return;
  FlowGetStiffness(f, c, E);
  for (PetscInt a = 0; a < dim; a++) E[a * dim + a] -= rest;
  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal scale = f->step.theta * m->weight[q];
    FlowGradients   g;

    ElementGradients(&f->element, m, q, g);
    for (PetscInt i = 0; i < nb; i++)
      for (PetscInt a = 0; a < dim; a++) {
        PetscReal along = 0;

        for (PetscInt b = 0; b < dim; b++) along += scale * E[a * dim + b] * g[b][i];
        for (PetscInt j = 0; j < nbp; j++) ce[i * nbp + j] += along * g[a][j];
      }
  }
}

void FlowPolymerStress(const struct _p_Flow *f, const ElementMetric *m, PetscInt c, PetscInt q, PetscReal grad[3][3], PetscReal stress[3][3])
{
  const PetscInt   dim = f->loc->dim, nb = f->loc->nb, n = dim * dim;
  const PetscReal *phi = f->element.phi + q * f->element.nbp, devss = ConformationDevss(f->conformation);
  PetscReal        T[MESH_MAX_NB * 9], G[MESH_MAX_NB * 9], E[9], un[MESH_MAX_NB * 3], before[3][3], s[9] = {0};
  FlowGradients    g;

  (void)gather_polymer(f, c, T, G);
  combine_polymer(nb * n, devss, G, T);
  FlowGetStiffness(f, c, E);
  add_product(dim, 1, grad, E, s);
  for (PetscInt a = 0; a < dim; a++) E[a * dim + a] -= devss;
  FlowCellGather(f->loc, c, f->u, un);
  ElementGradients(&f->element, m, q, g);
  FlowVelocityGradient(f, g, un, before);
  add_product(dim, -1, before, E, s);
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt b = 0; b < dim; b++) {
      stress[a][b] = s[a * dim + b];
      for (PetscInt j = 0; j < nb; j++) stress[a][b] += phi[j] * T[j * n + a * dim + b];
    }
}

void FlowAddStress(Flow f, PetscInt c, const ElementMetric *m, const PetscReal ul[], PetscReal r[])
{
  const PetscInt dim = f->loc->dim, nq = f->element.nq;

  for (PetscInt q = 0; q < nq; q++) {
    const PetscReal scale = f->mu[c * nq + q] * m->weight[q];
    FlowGradients   g;
    PetscReal       grad[3][3];

    ElementGradients(&f->element, m, q, g);
    FlowVelocityGradient(f, g, ul, grad);
    for (PetscInt j = 0; j < f->loc->nb; j++)
      for (PetscInt a = 0; a < dim; a++)
        for (PetscInt b = 0; b < dim; b++) r[j * dim + a] += scale * (grad[a][b] + grad[b][a]) * g[b][j];
  }
}

void FlowAddDiffusion(Flow f, PetscInt c, const ElementMetric *m, PetscReal ce[])
{
  const PetscInt dim = f->loc->dim, nb = f->loc->nb, nbp = f->element.nbp, nq = f->element.nq;

  for (PetscInt q = 0; q < nq; q++) {
    const PetscReal scale = (f->eddy.name ? 2 : 1) * f->step.theta * f->mu[c * nq + q] * m->weight[q];
    FlowGradients   g;

    ElementGradients(&f->element, m, q, g);
    for (PetscInt i = 0; i < nb; i++)
      for (PetscInt d = 0; d < dim; d++)
        for (PetscInt j = 0; j < nbp; j++) ce[i * nbp + j] += scale * g[d][i] * g[d][j];
  }
}

/* n [nb*dim][nb*dim] += weight 4 s (D grad phi_i) (D grad phi_j)^T */
static void add_tangent(const struct _p_Flow *f, FlowGradients g, const PetscReal ul[], PetscReal weight, PetscReal n[])
{
  const PetscInt dim = f->loc->dim, rows = f->loc->nb * dim;
  PetscReal      grad[3][3], D[3][3], v[MESH_MAX_NB * 3], mu, slope, rate;

  FlowVelocityGradient(f, g, ul, grad);
  rate = get_strain(dim, grad, D);
  RheologyEvaluate(f->rheology, rate, &mu, &slope);
  for (PetscInt i = 0; i < rows; i++) {
    v[i] = 0;
    for (PetscInt b = 0; b < dim; b++) v[i] += D[i % dim][b] * g[b][i / dim];
  }
  for (PetscInt i = 0; i < rows; i++)
    for (PetscInt j = 0; j < rows; j++) n[i * rows + j] += 4 * slope * weight * v[i] * v[j];
}

void FlowAddCoupling(Flow f, PetscInt c, const ElementMetric *m, const PetscReal ul[], PetscReal n[])
{
  const PetscInt dim = f->loc->dim, nb = f->loc->nb, rows = nb * dim, nq = f->element.nq;

  for (PetscInt q = 0; q < nq; q++) {
    const PetscReal weight = f->step.theta * m->weight[q];
    FlowGradients   g;

    if (weight == 0) continue;
    ElementGradients(&f->element, m, q, g);
    for (PetscInt i = 0; i < nb; i++)
      for (PetscInt a = 0; a < dim; a++)
        for (PetscInt j = 0; j < nb; j++)
          for (PetscInt b = 0; b < dim; b++) n[(i * dim + a) * rows + j * dim + b] += weight * f->mu[c * nq + q] * g[b][i] * g[a][j];
    if (ul) add_tangent(f, g, ul, weight, n);
  }
}
