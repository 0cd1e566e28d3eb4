/* Align, closest: points of a surface for nodes that go there. */
#include "compat.h"
#include "impl.h"

/* Direction at local node i on a wall, from the middles of covered cells around it to those of others */
static void find_outward(Align s, PetscInt i, PetscReal out[2])
{
  const MeshLocal *l         = s->loc;
  PetscReal        sum[2][3] = {{0}}, x[2];

  for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
    PetscReal *to = sum[s->cover[l->node_cell[q]] != 0];

    AlignPositionNear(s, AlignCentre(s, l->node_cell[q]), l->x_start + 2 * i, x);
    to[0] += x[0];
    to[1] += x[1];
    to[2] += 1;
  }
  for (PetscInt a = 0; a < 2; a++) {
    const PetscReal here = l->x_start[2 * i + a];

    out[a] = (sum[0][2] > 0 ? sum[0][a] / sum[0][2] : here) - (sum[1][2] > 0 ? sum[1][a] / sum[1][2] : here);
  }
}

PetscErrorCode AlignClosest(Align s, PetscInt k, PetscInt m, const PetscInt node[], const PetscReal x[], PetscReal y[])
{
  PetscReal out[2 * CHUNK];

  PetscFunctionBeginUser;
  if (!s->pull) {
    PetscCall(AlignProject(s, k, m, x, y));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt e = 0; e < m; e++) find_outward(s, node[e], out + 2 * e);
  PetscCall((*s->surfaces->approach)(s->surfaces->ctx, k, m, x, out, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}
