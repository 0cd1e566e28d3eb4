/* Cover: boxes around the cells of a rank (MeshCover of mesh.h). Cells are halved at the median of their centres along
   the longer axis, or where these leave half of it empty, as on both sides of a periodic seam; three times: the parts
   of a curve through the mesh are no boxes, but few pieces of them are. */
#include "compat.h"
#include "impl.h"
#include "tree/leaves.h"

#define HALVINGS 3

typedef struct {
  const MeshLocal *l;
  PetscReal (*lower)[3], (*upper)[3]; /* [ncell_all] corners of cells */
  PetscReal *middle;                  /* [ncell] work */
} Cover;

static void bound(const Cover *v, PetscInt n, const PetscInt cell[], PetscReal box[2][3])
{
  for (PetscInt a = 0; a < 3; a++) {
    box[0][a] = a < v->l->dim ? PETSC_MAX_REAL : 0;
    box[1][a] = a < v->l->dim ? -PETSC_MAX_REAL : 0;
  }
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt a = 0; a < v->l->dim; a++) {
      box[0][a] = PetscMin(box[0][a], v->lower[cell[i]][a]);
      box[1][a] = PetscMax(box[1][a], v->upper[cell[i]][a]);
    }
}

static PetscErrorCode halve(const Cover *v, PetscInt n, PetscInt cell[], PetscInt left, PetscInt *nbox,
                            PetscReal (*box)[2][3])
{
  PetscReal whole[2][3];
  PetscInt  axis = 0, half = n / 2;

  PetscFunctionBeginUser;
  if (!n) PetscFunctionReturn(PETSC_SUCCESS);
  bound(v, n, cell, whole);
  if (!left || n == 1) {
    PetscCall(PetscMemcpy(box[(*nbox)++], whole, sizeof(whole)));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt a = 1; a < v->l->dim; a++)
    if (whole[1][a] - whole[0][a] > whole[1][axis] - whole[0][axis]) axis = a;
  for (PetscInt i = 0; i < n; i++) v->middle[i] = v->lower[cell[i]][axis] + v->upper[cell[i]][axis];
  PetscCall(PetscSortRealWithArrayInt(n, v->middle, cell));
  for (PetscInt i = 1; i < n; i++) /* middles are sums of two places: twice the distance */
    if (v->middle[i] - v->middle[i - 1] > whole[1][axis] - whole[0][axis]) half = i;
  PetscCall(halve(v, half, cell, left - 1, nbox, box));
  PetscCall(halve(v, n - half, cell + half, left - 1, nbox, box));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of cell c from the boxes */
static PetscReal distance_to(const Cover *v, PetscInt c, PetscInt nbox, PetscReal (*box)[2][3])
{
  PetscReal min = PETSC_MAX_REAL;

  for (PetscInt i = 0; i < nbox; i++) {
    PetscReal sum = 0;

    for (PetscInt a = 0; a < v->l->dim; a++) {
      const PetscReal half = 0.5 * (box[i][1][a] - box[i][0][a]), middle = 0.5 * (box[i][0][a] + box[i][1][a]);
      const PetscReal low  = MeshNearest(v->l, a, v->lower[c][a] - middle),
                      high = MeshNearest(v->l, a, v->upper[c][a] - middle);

      sum += PetscSqr(PetscMax(0, PetscMax(PetscAbsReal(low), PetscAbsReal(high)) - half));
    }
    min = PetscMin(min, sum);
  }
  return PetscSqrtReal(min);
}

PetscErrorCode MeshCover(Mesh mesh, PetscInt reach, PetscInt *n, PetscReal (**box)[2][3], PetscReal *beyond)
{
  Cover     v      = {0};
  PetscReal widest = 0; /* square of the diagonal of a cell */
  PetscInt *cell;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &v.l));
  PetscCall(PetscMalloc4(v.l->ncell_all, &v.lower, v.l->ncell_all, &v.upper, v.l->ncell, &v.middle, v.l->ncell, &cell));
  for (PetscInt c = 0; c < v.l->ncell_all; c++) {
    PetscReal x[MESH_MAX_NB * 3], diagonal = 0;

    PetscCall(MeshCellCoordinates(mesh, c, x));
    for (PetscInt a = 0; a < v.l->dim; a++) {
      v.lower[c][a] = v.upper[c][a] = x[a];
      for (PetscInt j = 1; j < v.l->nb; j++) {
        v.lower[c][a] = PetscMin(v.lower[c][a], x[j * v.l->dim + a]);
        v.upper[c][a] = PetscMax(v.upper[c][a], x[j * v.l->dim + a]);
      }
      diagonal += PetscSqr(v.upper[c][a] - v.lower[c][a]);
    }
    if (c < v.l->ncell) cell[c] = c;
    widest = PetscMax(widest, diagonal);
  }
  *n      = 0;
  *beyond = 0;
  PetscCall(PetscMalloc1(1 << HALVINGS, box));
  PetscCall(halve(&v, v.l->ncell, cell, HALVINGS, n, *box));
  for (PetscInt c = v.l->ncell; c < v.l->ncell_all; c++) *beyond = PetscMax(*beyond, distance_to(&v, c, *n, *box));
  *beyond += (PetscReal)reach * PetscSqrtReal(widest);
  PetscCall(PetscFree4(v.lower, v.upper, v.middle, cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCreateCurve(Mesh mesh, Curve *curve)
{
  PetscFunctionBeginUser;
  *curve = NULL;
  if (mesh->leaves && mesh->leaves->first) PetscCall(LeavesCreateCurve(mesh->leaves, curve));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCreateRankBoxes(Mesh mesh, PetscInt reach, RankBoxes *regions, PetscReal *beyond)
{
  const MeshLocal *l;
  PetscInt         n;
  PetscReal(*box)[2][3];

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshCover(mesh, reach, &n, &box, beyond));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, beyond, 1, MPIU_REAL, MPIU_MAX, mesh->comm));
  PetscCall(RankBoxesCreate(mesh->comm, l->dim, l->lower, l->upper, l->period, n, box, regions));
  PetscCall(PetscFree(box));
  PetscFunctionReturn(PETSC_SUCCESS);
}
