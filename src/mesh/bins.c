/* Bins: a background grid of points, sorted once, which answers which nodes lie in a box in their order in memory
   (MeshNodesInBox). The search grid of base/grid.h is for boxes that come and go; it gives them in another order. */
#include "compat.h"
#include "impl.h"

static PetscInt bin_index(Mesh m, PetscInt d, PetscReal x)
{
  const PetscReal i = PetscFloorReal((x - m->bin_lower[d]) / m->bin_size[d]);

  return (PetscInt)PetscMax(0, PetscMin(m->nbin[d] - 1, i));
}

static PetscInt bin_of_node(Mesh m, PetscInt i)
{
  PetscInt b = 0;

  for (PetscInt d = m->loc.dim - 1; d >= 0; d--) b = b * m->nbin[d] + bin_index(m, d, m->x_start[i * m->loc.dim + d]);
  return b;
}

/* Of about two cells a side, counted on the rank's own part of the domain */
PetscErrorCode MeshCreateBins(Mesh m)
{
  MeshLocal *l     = &m->loc;
  PetscInt   total = 1, *fill;
  PetscReal  lo[3], hi[3], size, volume = 1;

  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < 3; d++) {
    lo[d]      = PETSC_MAX_REAL;
    hi[d]      = -PETSC_MAX_REAL;
    m->nbin[d] = 1;
  }
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    for (PetscInt d = 0; d < l->dim; d++) {
      lo[d] = PetscMin(lo[d], m->x[i * l->dim + d]);
      hi[d] = PetscMax(hi[d], m->x[i * l->dim + d]);
    }
  }
  for (PetscInt d = 0; d < l->dim; d++) volume *= PetscMax(hi[d] - lo[d], 0);
  size = 2 * PetscPowReal(volume / PetscMax(l->ncell_all, 1), 1.0 / l->dim);
  for (PetscInt d = 0; d < l->dim; d++) {
    m->bin_lower[d] = lo[d];
    m->nbin[d]      = l->nnode_all ? PetscMax(1, (PetscInt)((hi[d] - lo[d]) / size)) : 1;
    m->bin_size[d]  = l->nnode_all ? (hi[d] - lo[d]) / m->nbin[d] : 1;
    total *= m->nbin[d];
  }
  PetscCall(PetscCalloc1(total + 1, &m->bin_ptr));
  PetscCall(PetscMalloc2(l->nnode_all, &m->bin_node, l->nnode_all, &m->found));
  PetscCall(PetscMalloc1(total, &fill));
  for (PetscInt i = 0; i < l->nnode_all; i++) m->bin_ptr[bin_of_node(m, i) + 1]++;
  for (PetscInt b = 0; b < total; b++) m->bin_ptr[b + 1] += m->bin_ptr[b];
  for (PetscInt b = 0; b < total; b++) fill[b] = m->bin_ptr[b];
  for (PetscInt i = 0; i < l->nnode_all; i++) m->bin_node[fill[bin_of_node(m, i)]++] = i;
  PetscCall(PetscFree(fill));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshDestroyBins(Mesh m)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(m->bin_ptr));
  PetscCall(PetscFree2(m->bin_node, m->found));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshNodesInBox(Mesh m, const PetscReal centre[], PetscReal half, PetscInt *n, const PetscInt *list[])
{
  const PetscInt dim  = m->loc.dim;
  PetscInt       a[3] = {0, 0, 0}, b[3] = {0, 0, 0};
  PetscReal      lo[3], hi[3];

  PetscFunctionBeginUser;
  *n    = 0;
  *list = m->found;
  if (!m->loc.nnode_all) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt d = 0; d < dim; d++) {
    lo[d] = centre[d] - half;
    hi[d] = centre[d] + half;
    if (hi[d] < m->bin_lower[d] || lo[d] > m->bin_lower[d] + m->nbin[d] * m->bin_size[d])
      PetscFunctionReturn(PETSC_SUCCESS);
    a[d] = bin_index(m, d, lo[d]);
    b[d] = bin_index(m, d, hi[d]);
  }
  for (PetscInt k = a[2]; k <= b[2]; k++) {
    for (PetscInt j = a[1]; j <= b[1]; j++) {
      const PetscInt row = (k * m->nbin[1] + j) * m->nbin[0];

      for (PetscInt q = m->bin_ptr[row + a[0]]; q < m->bin_ptr[row + b[0] + 1]; q++) {
        const PetscInt   i  = m->bin_node[q];
        const PetscReal *x  = m->x_start + i * dim;
        PetscBool        in = PETSC_TRUE;

        for (PetscInt d = 0; d < dim; d++) in = (PetscBool)(in && x[d] >= lo[d] && x[d] <= hi[d]);
        if (in) m->found[(*n)++] = i;
      }
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
