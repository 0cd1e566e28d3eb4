/* Viscosity at the quadrature points, and what the symmetric form mu (grad u + grad u^T) adds to residuals, to the
   scalar matrix S and to the matrix A of all components (material.h):

     residual    (mu (grad u + grad u^T), grad v)
     S           (mu grad u, grad v): that of a component alone, for the preconditioner
     A           S for every component + (mu grad u^T, grad v) */
#include "compat.h"
#include "../impl.h"

PetscReal ViscosityStrain(PetscInt dim, PetscReal grad[3][3], PetscReal D[3][3])
{
  PetscReal square = 0;

  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt b = 0; b < dim; b++) {
      D[a][b] = 0.5 * (grad[a][b] + grad[b][a]);
      square += D[a][b] * D[a][b];
    }
  return PetscSqrtReal(2 * square);
}

/* ---- arrays ---- */

PetscErrorCode ViscosityCreate(Flow f)
{
  const MeshLocal *l = f->loc;
  Viscosity       *v = &f->viscosity;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc4(l->nnode_all * l->dim, &v->velocity, l->ncell_all * f->element.nq, &v->mu, l->ncell_all,
                         &v->cell, l->nnode_all, &v->node));
  v->current = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ViscosityDestroy(Flow f)
{
  Viscosity *v = &f->viscosity;

  PetscFunctionBeginUser;
  PetscCall(PetscFree4(v->velocity, v->mu, v->cell, v->node));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ViscosityRemesh(Flow f, Mesh old)
{
  PetscFunctionBeginUser;
  (void)old;
  PetscCall(ViscosityDestroy(f));
  PetscCall(ViscosityCreate(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ViscosityOutdate(Flow f)
{
  for (PetscInt i = 0; i < f->loc->nnode_all * f->loc->dim; i++)
    f->viscosity.velocity[i] = f->u[i] + f->time.extrapolation * (f->u[i] - f->u_old[i]);
  f->viscosity.current = PETSC_FALSE;
}

PetscErrorCode FlowSetRheologyVelocity(Flow f, const PetscReal v[])
{
  PetscFunctionBeginUser;
  if (!f->viscosity.velocity) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArraycpy(f->viscosity.velocity, v, f->loc->nnode_all * f->loc->dim));
  f->viscosity.current = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Means over cells, and over the cells of a node: mean logarithms, which favour neither end */
PetscErrorCode ViscosityAverage(Flow f)
{
  const MeshLocal *l  = f->loc;
  const PetscInt   nq = f->element.nq;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal sum = 0;

    for (PetscInt q = 0; q < nq; q++) sum += PetscLogReal(f->viscosity.mu[c * nq + q]);
    f->viscosity.cell[c] = PetscExpReal(sum / nq);
  }
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscInt begin = l->node_cell_ptr[i], end = l->node_cell_ptr[i + 1];
    PetscReal      sum = 0;

    for (PetscInt t = begin; t < end; t++) sum += PetscLogReal(f->viscosity.cell[l->node_cell[t]]);
    f->viscosity.node[i] = end > begin ? PetscExpReal(sum / (end - begin)) : f->par.viscosity;
  }
  PetscCall(MeshSyncNodes(f->mesh, 1, f->viscosity.node));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A fluid whose viscosity is of this kind tells it; others know only whether they are current */
PetscErrorCode FlowGetViscosity(Flow f, const PetscReal *cell[], const PetscReal *node[])
{
  PetscFunctionBeginUser;
  if (f->viscosity.mu) PetscCall((*f->material->update)(f));
  if (cell) *cell = FlowVaries(f) ? f->viscosity.cell : NULL;
  if (node) *node = FlowVaries(f) ? f->viscosity.node : NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- forms ---- */

void ViscosityResidual(Flow f, PetscInt c, const ElementMetric *m, const PetscReal ul[], PetscReal r[])
{
  const PetscInt dim = f->loc->dim, nq = f->element.nq;

  for (PetscInt q = 0; q < nq && ul; q++) {
    const PetscReal scale = f->viscosity.mu[c * nq + q] * m->weight[q];
    FlowGradients   g;
    PetscReal       grad[3][3];

    ElementGradients(&f->element, m, q, g);
    FlowVelocityGradient(f, g, ul, grad);
    for (PetscInt j = 0; j < f->loc->nb; j++)
      for (PetscInt a = 0; a < dim; a++)
        for (PetscInt b = 0; b < dim; b++) r[j * dim + a] += scale * (grad[a][b] + grad[b][a]) * g[b][j];
  }
}

void ViscosityScalar(Flow f, PetscInt c, const ElementMetric *m, PetscReal ce[])
{
  const PetscInt dim = f->loc->dim, nb = f->loc->nb, nbp = f->element.nbp, nq = f->element.nq;

  for (PetscInt q = 0; q < nq; q++) {
    const PetscReal scale = f->material->factor * f->step.theta * f->viscosity.mu[c * nq + q] * m->weight[q];
    FlowGradients   g;

    ElementGradients(&f->element, m, q, g);
    for (PetscInt i = 0; i < nb; i++)
      for (PetscInt d = 0; d < dim; d++)
        for (PetscInt j = 0; j < nbp; j++) ce[i * nbp + j] += scale * g[d][i] * g[d][j];
  }
}

void ViscosityTangentAt(const struct _p_Flow *f, PetscInt c, PetscInt q, PetscReal weight, FlowGradients g,
                        PetscReal n[])
{
  const PetscInt dim = f->loc->dim, nb = f->loc->nb, rows = nb * dim, nq = f->element.nq;

  for (PetscInt i = 0; i < nb; i++)
    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt j = 0; j < nb; j++)
        for (PetscInt b = 0; b < dim; b++)
          n[(i * dim + a) * rows + j * dim + b] += weight * f->viscosity.mu[c * nq + q] * g[b][i] * g[a][j];
}

void ViscosityTangent(Flow f, PetscInt c, const ElementMetric *m, const PetscReal ul[], PetscReal n[])
{
  (void)ul; /* it does not depend on the velocity */
  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal weight = f->step.theta * m->weight[q];
    FlowGradients   g;

    if (weight == 0) continue;
    ElementGradients(&f->element, m, q, g);
    ViscosityTangentAt(f, c, q, weight, g, n);
  }
}

PetscReal ViscosityStress(const struct _p_Flow *f, PetscInt c, const ElementMetric *m, PetscInt q, PetscReal grad[3][3],
                          PetscReal extra[3][3])
{
  (void)m;
  (void)grad;
  (void)extra;
  return f->viscosity.mu[c * f->element.nq + q];
}
