/* Derived: see derived.h. */
#include "compat.h"
#include "derived.h"

/* d/dxi_a at lattice node j of the Q2 function with nodal values f, stride bs */
static PetscReal lattice_derivative(PetscInt j, PetscInt a, PetscInt bs, const PetscReal f[])
{
  static const PetscReal D[3][3]   = {{-1.5, 2, -0.5}, {-0.5, 0, 0.5}, {0.5, -2, 1.5}};
  static const PetscInt  stride[3] = {1, 3, 9};
  const PetscInt         s = stride[a], i = (j / s) % 3, base = j - i * s;

  return D[i][0] * f[base * bs] + D[i][1] * f[(base + s) * bs] + D[i][2] * f[(base + 2 * s) * bs];
}

static void cross(const PetscReal a[3], const PetscReal b[3], PetscReal c[3])
{
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

/* r = (det J curl u, det J) at node j of a cell; no division, so a flat corner is harmless. 2D is the 3D formula with
   x_zeta = e_z, u_z = 0. */
static void curl_at_node(PetscInt dim, PetscInt j, const PetscReal xc[], const PetscReal uc[], PetscReal r[4])
{
  /* J[a] = dx/dxi_a, G[a] = du/dxi_a, C[a] = det J grad xi_a */
  PetscReal J[3][3] = {{0}}, G[3][3] = {{0}}, C[3][3], grad[3][3];

  J[2][2] = 1;
  for (PetscInt a = 0; a < dim; a++) {
    for (PetscInt d = 0; d < dim; d++) {
      J[a][d] = lattice_derivative(j, a, dim, xc + d);
      G[a][d] = lattice_derivative(j, a, dim, uc + d);
    }
  }
  for (PetscInt a = 0; a < 3; a++) cross(J[(a + 1) % 3], J[(a + 2) % 3], C[a]);
  for (PetscInt d = 0; d < 3; d++) {
    /* det J du_c/dx_d */
    for (PetscInt c = 0; c < 3; c++) grad[d][c] = C[0][d] * G[0][c] + C[1][d] * G[1][c] + C[2][d] * G[2][c];
  }
  for (PetscInt d = 0; d < 3; d++) {
    const PetscInt e = (d + 1) % 3, f = (d + 2) % 3;

    r[d] = grad[e][f] - grad[f][e];
  }
  r[3] = J[0][0] * C[0][0] + J[0][1] * C[0][1] + J[0][2] * C[0][2];
}

/* Is the node in slot j another one than that at place j? */
static PetscBool hangs(const MeshLocal *m, PetscInt c, PetscInt j)
{
  const MeshHang *h = MeshCellHang(m, c);

  for (PetscInt r = 0; h && r < h->n; r++)
    if (h->slot[r] == j) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* sum [nnode_all][n + 1] of weighted values and weights over own cells -> v [nnode_all][n] averages, ghosts up to
   date */
static PetscErrorCode finish_average(Mesh mesh, const MeshLocal *m, PetscInt n, PetscReal sum[], PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(MeshSumNodes(mesh, n + 1, sum));
  for (PetscInt i = 0; i < m->nnode; i++) {
    const PetscReal weight = sum[i * (n + 1) + n];

    for (PetscInt k = 0; k < n; k++) v[i * n + k] = weight > 0 ? sum[i * (n + 1) + k] / weight : 0;
  }
  PetscCall(MeshSyncNodes(mesh, n, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DerivedVorticity(Mesh mesh, const PetscReal u[], PetscReal w[])
{
  const MeshLocal *m;
  PetscReal       *sum, xc[MESH_MAX_NB * 3], uc[MESH_MAX_NB * 3], r[4];

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &m));
  PetscCall(PetscCalloc1(4 * m->nnode_all, &sum));
  for (PetscInt c = 0; c < m->ncell; c++) {
    const PetscInt *node = m->cell_node + c * m->nb;

    PetscCall(MeshCellCoordinates(mesh, c, xc));
    MeshCellValues(m, c, m->dim, u, uc);
    for (PetscInt j = 0; j < m->nb; j++) {
      if (hangs(m, c, j)) continue; /* the large cell speaks for its nodes */
      curl_at_node(m->dim, j, xc, uc, r);
      for (PetscInt k = 0; k < 4 && r[3] > 0; k++) sum[4 * node[j] + k] += r[k];
    }
  }
  PetscCall(finish_average(mesh, m, 3, sum, w));
  PetscCall(PetscFree(sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool cell_is_solid(const MeshLocal *m, PetscInt c, const PetscInt body[])
{
  if (!body) return PETSC_FALSE;
  for (PetscInt j = 0; j < m->nb; j++) {
    if (body[m->cell_node[c * m->nb + j]] < 0) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

/* Solid cells get a weight that matters only where there is no fluid cell */
PetscErrorCode DerivedPressure(Mesh mesh, const PetscReal p[], const PetscInt body[], PetscReal q[])
{
  const MeshLocal *m;
  PetscReal       *sum, x[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &m));
  PetscCall(PetscCalloc1(2 * m->nnode_all, &sum));
  for (PetscInt c = 0; c < m->ncell; c++) {
    const PetscReal *pc = p + c * (m->dim + 1), *centre = x + (m->nb / 2) * m->dim;
    const PetscReal  weight = cell_is_solid(m, c, body) ? 1e-12 : 1;

    PetscCall(MeshCellCoordinates(mesh, c, x));
    for (PetscInt j = 0; j < m->nb; j++) {
      const PetscInt i     = m->cell_node[c * m->nb + j];
      PetscReal      value = pc[0];

      if (hangs(m, c, j)) continue;
      for (PetscInt d = 0; d < m->dim; d++) value += pc[1 + d] * (x[j * m->dim + d] - centre[d]);
      sum[2 * i] += weight * value;
      sum[2 * i + 1] += weight;
    }
  }
  PetscCall(finish_average(mesh, m, 1, sum, q));
  PetscCall(PetscFree(sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}
