/* Scalars, boundaries: faces, and what is prescribed there. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "fem/side.h"

/* Counts, or (list) notes the faces of boundary b */
static PetscErrorCode find_boundary(Scalars all, PetscInt b, PetscBool list, PetscBool on[])
{
  const MeshLocal *l = all->loc;
  const PetscInt  *node;
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryNodes(all->mesh, b, &n, &node));
  for (PetscInt i = 0; i < n; i++) on[node[i]] = PETSC_TRUE;
  for (PetscInt c = 0; c < l->ncell_all && n; c++)
    for (PetscInt side = 0; side < 2 * l->dim; side++) {
      if (!SideIsMarked(l->dim, side, l->cell_node + c * l->nb, on)) continue;
      if (list) {
        all->face[all->nface]      = (ScalarFace){c, side, b};
        all->next_face[all->nface] = all->cell_face[c];
        all->cell_face[c]          = all->nface;
      }
      all->nface++;
    }
  for (PetscInt i = 0; i < n; i++) on[node[i]] = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsFindFaces(Scalars all)
{
  const MeshLocal *l = all->loc;
  PetscBool       *on;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(l->nnode_all, &on));
  PetscCall(PetscMalloc1(l->ncell_all, &all->cell_face));
  for (PetscInt c = 0; c < l->ncell_all; c++) all->cell_face[c] = -1;
  for (PetscInt pass = 0; pass < 2; pass++) {
    all->nface = 0;
    for (PetscInt b = 0; b < all->nboundary; b++) PetscCall(find_boundary(all, b, (PetscBool)(pass == 1), on));
    if (pass == 0) PetscCall(PetscMalloc2(all->nface, &all->face, all->nface, &all->next_face));
  }
  PetscCall(PetscFree(on));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarSidePoints(Scalars all, PetscInt c, PetscInt side, PetscReal x[], PetscReal weight[],
                                PetscReal phi[], PetscReal normal[])
{
  const PetscInt dim = all->loc->dim, axis = side / 2, nq = dim == 2 ? 3 : 9;
  PetscReal      xc[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(all->mesh, c, xc));
  for (PetscInt q = 0; q < nq; q++) {
    PetscReal xi[3], J[9], inverse[9], dphi[3 * MESH_MAX_NB], area = 0, det;

    weight[q] = SidePoint(dim, side, q, xi);
    ElementMap(dim, xc, xi, x + q * dim, J);
    det = DenseInvertMap(dim, J, inverse);
    for (PetscInt a = 0; a < dim; a++) area += PetscSqr(det * inverse[axis * dim + a]);
    area = PetscSqrtReal(area);
    weight[q] *= area;
    for (PetscInt a = 0; a < dim && normal; a++)
      normal[q * dim + a] = (side % 2 ? 1 : -1) * det * inverse[axis * dim + a] / area;
    ElementBasis(dim, xi, phi + q * MESH_MAX_NB, dphi);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarFacePoints(Scalars all, PetscInt i, PetscReal x[], PetscReal weight[], PetscReal phi[])
{
  PetscFunctionBeginUser;
  PetscCall(ScalarSidePoints(all, all->face[i].cell, all->face[i].side, x, weight, phi, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Values that boundaries prescribe at their nodes; where two meet, the first that prescribes one */
PetscErrorCode ScalarsSetValues(Scalars all, Scalar *s)
{
  const MeshLocal *l = all->loc;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode_all; i++) s->owner[i] = -1;
  for (PetscInt b = 0; b < all->nboundary; b++) {
    const PetscInt *node;
    PetscInt        n;
    PetscReal      *x, *value;

    if (s->condition[b].kind != SCALAR_VALUE) continue;
    PetscCall(MeshGetBoundaryNodes(all->mesh, b, &n, &node));
    PetscCall(PetscMalloc2(n * l->dim, &x, n, &value));
    for (PetscInt i = 0; i < n * l->dim; i++) x[i] = l->x[node[i / l->dim] * l->dim + i % l->dim];
    PetscCall(ScalarEvaluateNumber(&s->condition[b].value, all->step.time, n, x, value));
    for (PetscInt i = 0; i < n; i++) {
      if (s->owner[node[i]] >= 0) continue;
      s->owner[node[i]] = b;
      s->fixed[node[i]] = value[i];
    }
    PetscCall(PetscFree2(x, value));
  }
  for (PetscInt i = 0; i < l->nnode_all && s->nodes.fixed; i++) {
    if (!s->nodes.fixed[i] || s->owner[i] >= 0) continue;
    s->owner[i] = all->nboundary;
    s->fixed[i] = s->nodes.value[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
