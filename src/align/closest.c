/* Align, closest: points of a surface for nodes that go there. */
#include "compat.h"
#include "impl.h"

/* Direction at local node i on a wall, from the middles of covered cells around it to those of others */
static void find_outward(Align s, PetscInt i, PetscReal out[])
{
  const MeshLocal *l         = s->loc;
  const PetscInt   dim       = l->dim;
  PetscReal        sum[2][3] = {{0}}, count[2] = {0}, x[3];

  for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
    const PetscInt side = s->cover[l->node_cell[q]] != 0;

    AlignPositionNear(s, AlignCentre(s, l->node_cell[q]), l->x_start + dim * i, x);
    for (PetscInt a = 0; a < dim; a++) sum[side][a] += x[a];
    count[side]++;
  }
  for (PetscInt a = 0; a < dim; a++) {
    const PetscReal here = l->x_start[dim * i + a];

    out[a] = (count[0] > 0 ? sum[0][a] / count[0] : here) - (count[1] > 0 ? sum[1][a] / count[1] : here);
  }
}

PetscErrorCode AlignClosest(Align s, PetscInt k, PetscInt m, const PetscInt node[], const PetscReal x[], PetscReal y[])
{
  PetscReal out[3 * CHUNK];

  PetscFunctionBeginUser;
  if (!s->pull) {
    PetscCall(AlignProject(s, k, m, x, y));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt e = 0; e < m; e++) find_outward(s, node[e], out + s->loc->dim * e);
  PetscCall((*s->surfaces->approach)(s->surfaces->ctx, k, m, x, out, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}
