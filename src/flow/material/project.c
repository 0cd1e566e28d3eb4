/* Projection: see project.h. */
#include "compat.h"
#include "../impl.h"
#include "project.h"
#include "base/algebra.h"

PetscErrorCode ProjectionMetric(const Projection *p, PetscInt c, ElementMetric *m)
{
  const ElementTables *e      = &p->f->element;
  PetscReal            volume = 0, whole = 0;

  PetscFunctionBeginUser;
  PetscCall(FlowCellMetric(p->f, c, m));
  if (m->affine) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt q = 0; q < e->nq; q++) {
    volume += m->weight[q];
    whole += e->weight[q];
  }
  for (PetscInt q = 0; q < e->nq; q++) m->weight[q] = volume / whole * e->weight[q];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ProjectionFinish(const Projection *p, PetscInt bs, PetscReal r[])
{
  const MeshLocal *l = p->f->loc;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscReal m = p->mass[i];

    for (PetscInt k = 0; k < bs; k++) r[i * bs + k] = m > 0 ? r[i * bs + k] / m : 0;
  }
  PetscCall(MeshSyncNodes(p->f->mesh, bs, r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- surfaces ---- */

/* Directions of the integrals of the gradients of the basis, which are 0 but where the fluid ends */
static PetscErrorCode find_normals(const Projection *p)
{
  const struct _p_Flow *f   = p->f;
  const MeshLocal      *l   = f->loc;
  const PetscInt        dim = l->dim;
  PetscBool            *beside[2]; /* [nnode_all] a node of cells of the fluid, and of others */

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(l->nnode_all, &beside[0], l->nnode_all, &beside[1]));
  PetscCall(PetscArrayzero(p->normal, l->nnode_all * dim));
  for (PetscInt c = 0; c < l->ncell_all; c++)
    for (PetscInt j = 0; j < l->nb && !MeshCellHang(l, c); j++)
      beside[f->cells.det[c] == 0][l->cell_node[c * l->nb + j]] = PETSC_TRUE;
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    const PetscInt *node                = l->cell_node + c * l->nb;
    PetscReal       rl[MESH_MAX_NB * 3] = {0};
    PetscBool       any                 = PETSC_FALSE;
    ElementMetric   m;

    for (PetscInt j = 0; j < l->nb; j++) any = (PetscBool)(any || (beside[0][node[j]] && beside[1][node[j]]));
    if (f->cells.det[c] == 0 || !any) continue;
    PetscCall(FlowCellMetric(p->f, c, &m));
    for (PetscInt q = 0; q < f->element.nq; q++) {
      FlowGradients g;

      ElementGradients(&f->element, &m, q, g);
      for (PetscInt k = 0; k < l->nb * dim; k++) rl[k] += m.weight[q] * g[k % dim][k / dim];
    }
    ProjectionScatter(l, c, dim, rl, p->normal);
  }
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal *normal = p->normal + i * dim, length = 0;

    for (PetscInt a = 0; a < dim; a++) length += PetscSqr(normal[a]);
    length = beside[0][i] && beside[1][i] ? PetscSqrtReal(length) : 0;
    for (PetscInt a = 0; a < dim; a++) normal[a] = length > 0 ? normal[a] / length : 0;
  }
  PetscCall(MeshSyncNodes(f->mesh, dim, p->normal));
  PetscCall(PetscFree2(beside[0], beside[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Have nodes i and j normals that point the same way, and not to each other across a gap? */
static PetscBool is_facing(const Projection *p, PetscInt i, PetscInt j)
{
  const PetscInt dim     = p->f->loc->dim;
  PetscReal      product = 0;

  for (PetscInt a = 0; a < dim; a++) product += p->normal[i * dim + a] * p->normal[j * dim + a];
  return (PetscBool)(product > 0);
}

PetscBool ProjectionIsSurface(const Projection *p, PetscInt i)
{
  return is_facing(p, i, i);
}

/* Gradient T [dim][dim] of u at own node i of a surface from the nodes of the surface in its cells alone, by least
   squares: what it is along the surface, exactly where that turns as a whole */
static PetscErrorCode fit_surface(const Projection *p, PetscInt i, const PetscReal u[], PetscReal T[])
{
  const struct _p_Flow *f   = p->f;
  const MeshLocal      *l   = f->loc;
  const PetscInt        dim = l->dim, n = dim * dim;
  PetscReal             X[9] = {0}, V[9] = {0}, inverse[9], trace = 0; /* sums of x x^T, v x^T */

  PetscFunctionBeginUser;
  for (PetscInt t = l->node_cell_ptr[i]; t < l->node_cell_ptr[i + 1]; t++) {
    const PetscInt c = l->node_cell[t], *node = l->cell_node + c * l->nb;
    PetscReal      xs[MESH_MAX_NB * 3];
    PetscInt       at = 0;

    if (f->cells.det[c] == 0) continue;
    PetscCall(MeshSlotCoordinates(f->mesh, c, xs));
    while (node[at] != i) at++;
    for (PetscInt j = 0; j < l->nb; j++)
      for (PetscInt k = 0; k < n && is_facing(p, i, node[j]); k++) {
        const PetscReal x = xs[j * dim + k % dim] - xs[at * dim + k % dim];

        X[k] += x * (xs[j * dim + k / dim] - xs[at * dim + k / dim]);
        V[k] += x * (u[node[j] * dim + k / dim] - u[i * dim + k / dim]);
      }
  }
  for (PetscInt a = 0; a < dim; a++) trace += X[a * (dim + 1)];
  for (PetscInt a = 0; a < dim; a++) X[a * (dim + 1)] += trace > 0 ? 1e-12 * trace : 1; /* flat: 0 across */
  DenseInvert(dim, X, inverse);
  for (PetscInt k = 0; k < n; k++) {
    T[k] = 0;
    for (PetscInt e = 0; e < dim; e++) T[k] += V[k / dim * dim + e] * inverse[e * dim + k % dim];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* grad of own nodes on surfaces: T (1 - n n) + a n, where a is that of P(grad u) n but for its component along n */
static PetscErrorCode fit_surfaces(const Projection *p, const PetscReal u[], PetscReal grad[])
{
  const MeshLocal *l   = p->f->loc;
  const PetscInt   dim = l->dim;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscReal *normal = p->normal + i * dim;
    PetscReal       *L = grad + i * dim * dim, T[9], across[3] = {0}, along[3] = {0}, out = 0;

    if (!ProjectionIsSurface(p, i)) continue;
    PetscCall(fit_surface(p, i, u, T));
    for (PetscInt k = 0; k < dim * dim; k++) {
      across[k / dim] += L[k] * normal[k % dim];
      along[k / dim] += T[k] * normal[k % dim];
    }
    for (PetscInt a = 0; a < dim; a++) out += (along[a] - across[a]) * normal[a] - T[a * (dim + 1)];
    for (PetscInt k = 0; k < dim * dim; k++)
      L[k] = T[k] + (across[k / dim] + out * normal[k / dim] - along[k / dim]) * normal[k % dim];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- fields ---- */

PetscErrorCode ProjectionUpdate(Projection *p)
{
  const struct _p_Flow *f = p->f;
  const MeshLocal      *l = f->loc;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(p->mass, l->nnode_all));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal     rl[MESH_MAX_NB] = {0};
    ElementMetric m;

    if (f->cells.det[c] == 0) continue;
    PetscCall(ProjectionMetric(p, c, &m));
    for (PetscInt q = 0; q < f->element.nq; q++)
      for (PetscInt j = 0; j < l->nb; j++) rl[j] += m.weight[q] * f->element.phi[q * f->element.nbp + j];
    ProjectionScatter(l, c, 1, rl, p->mass);
  }
  PetscCall(MeshSyncNodes(f->mesh, 1, p->mass));
  PetscCall(find_normals(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ProjectionGradient(const Projection *p, const PetscReal u[], PetscReal grad[])
{
  const struct _p_Flow *f   = p->f;
  const MeshLocal      *l   = f->loc;
  const PetscInt        dim = l->dim, n = dim * dim;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(grad, l->nnode_all * n));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal     ul[MESH_MAX_NB * 3], rl[MESH_MAX_NB * 9];
    ElementMetric m;

    if (f->cells.det[c] == 0) continue;
    MeshCellValues(l, c, l->dim, u, ul);
    PetscCall(ProjectionMetric(p, c, &m));
    PetscCall(PetscArrayzero(rl, l->nb * n));
    for (PetscInt q = 0; q < f->element.nq; q++) {
      const PetscReal *phi = f->element.phi + q * f->element.nbp;
      FlowGradients    g;
      PetscReal        L[3][3];

      ElementGradients(&f->element, &m, q, g);
      FlowVelocityGradient(f, g, ul, L);
      for (PetscInt j = 0; j < l->nb; j++)
        for (PetscInt k = 0; k < n; k++) rl[j * n + k] += m.weight[q] * phi[j] * L[k / dim][k % dim];
    }
    ProjectionScatter(l, c, n, rl, grad);
  }
  PetscCall(ProjectionFinish(p, n, grad));
  PetscCall(fit_surfaces(p, u, grad));
  PetscCall(MeshSyncNodes(f->mesh, n, grad));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

PetscErrorCode ProjectionCreate(Flow f, Projection *p)
{
  const PetscInt n = f->loc->nnode_all;

  PetscFunctionBeginUser;
  p->f = f;
  PetscCall(PetscCalloc2(n, &p->mass, n * f->loc->dim, &p->normal));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ProjectionDestroy(Projection *p)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree2(p->mass, p->normal));
  PetscFunctionReturn(PETSC_SUCCESS);
}
