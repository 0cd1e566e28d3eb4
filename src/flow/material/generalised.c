/* Generalised Newtonian fluids (rheology.h) as a material: the viscosity goes with the rate of strain, the stress has
   its symmetric form (viscosity.c). The derivative of mu 2 D_u, for Newton's method, adds

     A           4 (s (D_u : D) D_u, D_v) with s = (dmu/dg)/g */
#include "compat.h"
#include "generalised.h"

Generalised *FlowGeneralised(const struct _p_Flow *f)
{
  return f->material == &FLOW_GENERALISED ? f->material_data : NULL;
}

/* ---- viscosity ---- */

/* Of every local cell: rates of strain at the quadrature points in f->viscosity.mu; *rate_max: the largest */
static PetscErrorCode compute_rates(Flow f, PetscReal *rate_max)
{
  const MeshLocal *l  = f->loc;
  const PetscInt   nq = f->element.nq;

  PetscFunctionBeginUser;
  *rate_max = 0;
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal     ul[MESH_MAX_NB * 3];
    ElementMetric m;

    if (f->cells.det[c] == 0) continue; /* no cell of the fluid */
    MeshCellValues(l, c, l->dim, f->viscosity.velocity, ul);
    PetscCall(FlowCellMetric(f, c, &m));
    for (PetscInt q = 0; q < nq; q++) {
      FlowGradients g;
      PetscReal     grad[3][3], D[3][3];

      ElementGradients(&f->element, &m, q, g);
      FlowVelocityGradient(f, g, ul, grad);
      f->viscosity.mu[c * nq + q] = ViscosityStrain(l->dim, grad, D);
      *rate_max                   = PetscMax(*rate_max, f->viscosity.mu[c * nq + q]);
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, rate_max, 1, MPIU_REAL, MPIU_MAX, f->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update(Flow f)
{
  const PetscInt nq = f->element.nq;
  PetscReal      rate_max;
  Generalised   *g = f->material_data;

  PetscFunctionBeginUser;
  if (f->viscosity.current) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(compute_rates(f, &rate_max));
  ExtensionKeepRates(f);
  for (PetscInt i = 0; i < f->loc->ncell_all * nq; i++) {
    if (f->cells.det[i / nq] == 0 || (rate_max == 0 && f->step.dt == 0)) f->viscosity.mu[i] = f->par.viscosity;
    else RheologyEvaluate(g->law, f->viscosity.mu[i], &f->viscosity.mu[i], NULL);
  }
  PetscCall(ExtensionApply(f));
  PetscCall(ViscosityAverage(f));
  f->viscosity.current = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetRegularisation(Flow f, PetscReal rigid, PetscBool *less)
{
  Generalised *g = FlowGeneralised(f);

  PetscFunctionBeginUser;
  PetscCall(RheologySetRegularisation(g ? g->law : NULL, rigid, less));
  if (g) f->viscosity.current = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool FlowHasYield(Flow f)
{
  const Generalised *g = FlowGeneralised(f);

  return RheologyHasYield(g ? g->law : NULL);
}

PetscBool FlowIsShearThinning(Flow f)
{
  const Generalised *g  = FlowGeneralised(f);
  PetscReal          mu = 0;

  if (g) RheologyEvaluate(g->law, 0, &mu, NULL);
  return (PetscBool)(mu > f->par.viscosity);
}

/* ---- forms ---- */

/* n [nb*dim][nb*dim] += weight 4 s (D grad phi_i) (D grad phi_j)^T */
static void add_derivative(const struct _p_Flow *f, FlowGradients g, const PetscReal ul[], PetscReal weight,
                           PetscReal n[])
{
  const PetscInt dim = f->loc->dim, rows = f->loc->nb * dim;
  PetscReal      grad[3][3], D[3][3], v[MESH_MAX_NB * 3], mu, slope, rate;

  FlowVelocityGradient(f, g, ul, grad);
  rate = ViscosityStrain(dim, grad, D);
  RheologyEvaluate(FlowGeneralised(f)->law, rate, &mu, &slope);
  for (PetscInt i = 0; i < rows; i++) {
    v[i] = 0;
    for (PetscInt b = 0; b < dim; b++) v[i] += D[i % dim][b] * g[b][i / dim];
  }
  for (PetscInt i = 0; i < rows; i++)
    for (PetscInt j = 0; j < rows; j++) n[i * rows + j] += 4 * slope * weight * v[i] * v[j];
}

static void tangent(Flow f, PetscInt c, const ElementMetric *m, const PetscReal ul[], PetscReal n[])
{
  const PetscBool cut = ExtensionHas(FlowGeneralised(f)->extension, c); /* there mu is not that of the velocity */

  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal weight = f->step.theta * m->weight[q];
    FlowGradients   g;

    if (weight == 0) continue;
    ElementGradients(&f->element, m, q, g);
    ViscosityTangentAt(f, c, q, weight, g, n);
    if (ul && !cut) add_derivative(f, g, ul, weight, n);
  }
}

/* ---- life cycle ---- */

static PetscErrorCode remesh(Flow f, Mesh old)
{
  PetscFunctionBeginUser;
  PetscCall(ExtensionDestroy(&FlowGeneralised(f)->extension));
  PetscCall(ViscosityRemesh(f, old));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Flow f)
{
  Generalised *g = f->material_data;

  PetscFunctionBeginUser;
  PetscCall(ExtensionDestroy(&g->extension));
  PetscCall(RheologyDestroy(&g->law));
  PetscCall(PetscFree(f->material_data));
  PetscCall(ViscosityDestroy(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view(Flow f, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(RheologyView(FlowGeneralised(f)->law, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const FlowMaterial FLOW_GENERALISED = {
  .name      = "generalised Newtonian",
  .symmetric = PETSC_TRUE,
  .varies    = PETSC_TRUE,
  .linear    = PETSC_TRUE,
  .factor    = 1,
  .create    = ViscosityCreate,
  .remesh    = remesh,
  .destroy   = destroy,
  .outdate   = ViscosityOutdate,
  .update    = update,
  .residual  = ViscosityResidual,
  .scalar    = ViscosityScalar,
  .tangent   = tangent,
  .stress    = ViscosityStress,
  .view      = view,
};
