/* Deform, potential: the displacements that give cells their wanted sizes, see deform.h. */
#include "compat.h"
#include "impl.h"

/* Of the mass, over the square of the domain: makes the Neumann problem definite; what it does to the displacement the
   next steps correct */
#define REGULARISE 1e-2
/* of the Laplacian, against potentials that alternate from cell to cell, which move next to nothing */
#define SMOOTH 0.05

/* 1/m at the vertices; mass and 1/m there, for how willingly they move */
static PetscErrorCode set_vertex_weights(Deform d)
{
  const MeshLocal *l = d->l;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(d->node.mobility, l->nnode_all));
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    PetscReal m;

    if (!d->node.vertex[i]) continue;
    PetscCall(DeformEvaluateMonitor(d, l->x + i * d->dim, &m));
    d->node.inverse[i] = 1 / m;
  }
  for (PetscInt c = 0; c < l->ncell_all; c++)
    for (PetscInt j = 0; j < d->element.nv; j++)
      d->node.mobility[DeformVertex(d, c, j)] += d->cell.now[c] / d->element.nv;
  for (PetscInt i = 0; i < l->nnode_all; i++)
    if (d->node.vertex[i]) d->node.mobility[i] = PetscSqr(d->scale / d->node.inverse[i]) / d->node.mobility[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Derivatives of the cells' integrals by the positions of their vertices: int div(phi_j e_a/m), with 1/m interpolated
   between the vertices, so that what one cell gains its neighbours lose */
static PetscErrorCode differentiate(Deform d)
{
  const PetscInt dim = d->dim;

  PetscFunctionBeginUser;
  PetscCall(set_vertex_weights(d));
  PetscCall(PetscArrayzero(d->cell.slope, d->l->ncell_all * d->element.nv * dim));
  for (PetscInt c = 0; c < d->l->ncell_all; c++) {
    PetscReal xv[MAX_NV][3], *slope = d->cell.slope + c * d->element.nv * dim;

    PetscCall(DeformGetVertices(d, c, xv));
    for (PetscInt q = 0; q < d->element.nq; q++) {
      PetscReal jac[9], inv[9], g[MAX_NV][3], f = 0, df[3] = {0, 0, 0}, weight;

      DeformMapGradient(d, xv, d->element.dphi[q], jac);
      weight = d->element.weight[q] * DenseInvertMap(dim, jac, inv) / d->scale;
      for (PetscInt j = 0; j < d->element.nv; j++) {
        const PetscReal fj = d->node.inverse[DeformVertex(d, c, j)];

        f += d->element.phi[q][j] * fj;
        for (PetscInt a = 0; a < dim; a++) {
          g[j][a] = 0;
          for (PetscInt b = 0; b < dim; b++) g[j][a] += inv[b * dim + a] * d->element.dphi[q][j][b];
          df[a] += fj * g[j][a];
        }
      }
      for (PetscInt j = 0; j < d->element.nv; j++)
        for (PetscInt a = 0; a < dim; a++) slope[j * dim + a] += weight * (f * g[j][a] + d->element.phi[q][j] * df[a]);
    }
    for (PetscInt i = 0; i < d->element.nv * dim; i++)
      if (d->node.fixed[DeformVertex(d, c, i / dim)] >> i % dim & 1) slope[i] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The derivatives of cell c by the position of node i, one of its vertices */
static const PetscReal *slope_at(const struct _p_Deform *d, PetscInt c, PetscInt i)
{
  PetscInt j = 0;

  while (DeformVertex(d, c, j) != i) j++;
  return d->cell.slope + (c * d->element.nv + j) * d->dim;
}

/* Strength of SMOOTH at the vertices of own cells: that of the Laplacian there, in the mean over the cells around */
static void find_damping(Deform d)
{
  const MeshLocal *l = d->l;

  for (PetscInt i = 0; i < l->nnode_all; i++) {
    const PetscInt first = l->node_cell_ptr[i], last = l->node_cell_ptr[i + 1];

    d->node.damp[i] = 0;
    for (PetscInt e = first; e < last && d->node.vertex[i]; e++) {
      const PetscReal *s = slope_at(d, l->node_cell[e], i);

      for (PetscInt a = 0; a < d->dim; a++)
        d->node.damp[i] += SMOOTH * d->node.mobility[i] * s[a] * s[a] / (last - first);
    }
  }
}

/* Rows of own cells of slope mobility slope^T, the Laplacian of a potential in the cells */
static PetscErrorCode assemble(Deform d)
{
  const MeshLocal *l        = d->l;
  PetscReal        diameter = 0;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < d->dim; a++) diameter = PetscMax(diameter, l->upper[a] - l->lower[a]);
  find_damping(d);
  PetscCall(MatZeroEntries(d->K));
  for (PetscInt c = 0; c < l->ncell; c++) {
    const PetscInt row = l->cell_global[c];

    PetscCall(MatSetValue(d->K, row, row, REGULARISE / (diameter * diameter) * d->cell.now[c], ADD_VALUES));
    for (PetscInt j = 0; j < d->element.nv; j++) {
      const PetscInt   i = DeformVertex(d, c, j), first = l->node_cell_ptr[i], last = l->node_cell_ptr[i + 1];
      const PetscReal *mine = d->cell.slope + (c * d->element.nv + j) * d->dim;

      for (PetscInt e = first; e < last; e++) {
        const PetscReal *other = slope_at(d, l->node_cell[e], i);
        PetscReal        value = d->node.damp[i] * ((l->node_cell[e] == c) - 1. / (last - first));

        for (PetscInt a = 0; a < d->dim; a++) value += d->node.mobility[i] * mine[a] * other[a];
        PetscCall(MatSetValue(d->K, row, l->cell_global[l->node_cell[e]], value, ADD_VALUES));
      }
    }
  }
  PetscCall(MatAssemblyBegin(d->K, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(d->K, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeformSolvePotential(Deform d)
{
  const PetscInt     bs = d->element.nv * d->dim;
  PetscScalar       *b;
  KSPConvergedReason reason;

  PetscFunctionBeginUser;
  PetscCall(differentiate(d));
  PetscCall(assemble(d));
  PetscCall(VecGetArrayWrite(d->b, &b));
  for (PetscInt c = 0; c < d->l->ncell; c++) b[c] = d->cell.start[c] - d->cell.count[c] / d->scale;
  for (PetscInt i = 0; i < d->l->ncell * bs; i++)
    b[i / bs] -= d->cell.slope[i] *
                 d->node.relax[DeformVertex(d, i / bs, i / d->dim % d->element.nv) * d->dim + i % d->dim];
  PetscCall(VecRestoreArrayWrite(d->b, &b));
  PetscCall(KSPSolve(d->ksp, d->b, d->x));
  PetscCall(KSPGetConvergedReason(d->ksp, &reason));
  PetscCheck(reason > 0, d->comm, PETSC_ERR_NOT_CONVERGED,
             "The potential of -mesh_deform was not found (%s): raise -deform_ksp_max_it, or choose another -deform_pc_type",
             KSPConvergedReasons[reason]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeformFindDisplacement(Deform d)
{
  const MeshLocal   *l = d->l;
  const PetscScalar *w;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(d->node.v, l->nnode_all * d->dim));
  PetscCall(VecGetArrayRead(d->x, &w));
  for (PetscInt i = 0; i < l->ncell * d->element.nv * d->dim; i++) {
    const PetscInt c = i / (d->element.nv * d->dim);

    d->node.v[DeformVertex(d, c, i / d->dim % d->element.nv) * d->dim + i % d->dim] += d->cell.slope[i] *
                                                                                       PetscRealPart(w[c]);
  }
  PetscCall(VecRestoreArrayRead(d->x, &w));
  PetscCall(MeshSumNodes(d->mesh, d->dim, d->node.v));
  for (PetscInt i = 0; i < l->nnode * d->dim; i++)
    d->node.v[i] = d->node.vertex[i / d->dim] ? d->node.mobility[i / d->dim] * d->node.v[i] + d->node.relax[i] : 0;
  PetscCall(MeshSyncNodes(d->mesh, d->dim, d->node.v));
  PetscFunctionReturn(PETSC_SUCCESS);
}
