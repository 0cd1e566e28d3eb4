/* Transfer: see transfer.h. */
#include "compat.h"
#include "transfer.h"
#include "base/algebra.h"
#include "base/inline.h"
#include "base/array.h"

#define ALIKE 1e-12 /* of fits, which have no unit */
#define MEANT 8     /* of the forms before, that a cell's fit is compared with */

struct _p_Transfer {
  MPI_Comm         comm; /* of the mesh */
  Mesh             mesh;
  const MeshLocal *loc;
  PetscInt         nk, nv;
  PetscInt        *at_node;  /* [nnode_all] global number of the vertex at a node, or -1 */
  PetscInt         own, all; /* vertices here */
  PetscInt        *global;   /* [all] */
  PetscInt        *vertex;   /* [ncell_all][nv] */
  PetscInt        *form;     /* [ncell_all] place of its fit */
  PetscInt         nform, capacity;
  PetscReal       *fit; /* [nform][nk][nv]; the first is that of inactive cells */
  PetscSF          sf;  /* NULL on one rank */
};

/* ---- fits ---- */

static void list_corners(PetscInt dim, PetscInt corner[])
{
  for (PetscInt v = 0; v < 1 << dim; v++) corner[v] = 2 * (v & 1) + 6 * ((v >> 1) & 1) + 18 * (v >> 2);
}

PetscErrorCode TransferMapCell(Mesh mesh, PetscInt c, PetscReal J[])
{
  const MeshLocal *l;
  PetscReal        xc[MESH_MAX_NB * 3];
  PetscInt         corner[8];

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshCellCoordinates(mesh, c, xc));
  list_corners(l->dim, corner);
  PetscCall(PetscArrayzero(J, l->dim * l->dim));
  for (PetscInt v = 0; v < 1 << l->dim; v++)
    for (PetscInt e = 0; e < l->dim; e++)
      for (PetscInt a = 0; a < l->dim; a++)
        J[a * l->dim + e] += ((v >> e) & 1 ? 1.0 : -1.0) / (1 << l->dim) * xc[corner[v] * l->dim + a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From values at the corners of a cell to those in its corner slots, the vertices of large faces where these hang */
static void fit_slots(const MeshHang *h, PetscInt nv, PetscInt nk, PetscReal fit[])
{
  for (PetscInt k = 0; k < nk; k++) {
    PetscReal row[8] = {0};

    for (PetscInt v = 0; v < nv; v++)
      for (PetscInt s = 0; s < nv; s++) row[s] += fit[k * nv + v] * h->corner[v][s];
    for (PetscInt s = 0; s < nv; s++) fit[k * nv + s] = row[s];
  }
}

/* Linear function on a cell (value and scaled slopes at the centre) that fits the vertex values: for a parallelogram
   the multilinear interpolant at its centre */
static PetscErrorCode fit_vertices(Transfer t, PetscInt c, PetscReal fit[])
{
  const MeshLocal *l   = t->loc;
  const PetscInt   dim = l->dim, nv = t->nv;
  PetscReal        J[9], inv[9], size, det;

  PetscFunctionBeginUser;
  PetscCall(TransferMapCell(t->mesh, c, J));
  det  = DenseInvertMap(dim, J, inv);
  size = PetscPowReal(PetscAbsReal(det) * nv, 1.0 / dim);
  for (PetscInt v = 0; v < nv; v++) {
    fit[v] = 1.0 / nv;
    for (PetscInt a = 0; a < dim; a++) {
      fit[(1 + a) * nv + v] = 0;
      for (PetscInt e = 0; e < dim; e++)
        fit[(1 + a) * nv + v] += size * inv[e * dim + a] * ((v >> e) & 1 ? 1.0 : -1.0) / nv;
    }
  }
  if (MeshCellHang(l, c)) fit_slots(MeshCellHang(l, c), nv, dim + 1, fit);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool are_alike(PetscInt n, const PetscReal a[], const PetscReal b[])
{
  for (PetscInt i = 0; i < n; i++)
    if (!(PetscAbsReal(a[i] - b[i]) <= ALIKE)) return PETSC_FALSE;
  return PETSC_TRUE;
}

/* The form of a fit, one of the last or a new one */
static PetscErrorCode find_form(Transfer t, const PetscReal fit[], PetscInt *form)
{
  const PetscInt n = t->nk * t->nv;

  PetscFunctionBeginUser;
  for (*form = t->nform - 1; *form > 0 && *form >= t->nform - MEANT; (*form)--)
    if (are_alike(n, fit, t->fit + *form * n)) PetscFunctionReturn(PETSC_SUCCESS);
  *form = t->nform++;
  PetscCall(ArrayReserve(t->nform, &t->capacity, &t->fit, n * sizeof(*t->fit), NULL));
  PetscCall(PetscArraycpy(t->fit + *form * n, fit, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Forms that no cell has any more go, once they are more than cells */
static PetscErrorCode drop_forms(Transfer t)
{
  const PetscInt n = t->nk * t->nv;
  PetscInt      *index, kept = 1;

  PetscFunctionBeginUser;
  if (t->nform <= 2 * t->loc->ncell_all + MEANT) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(t->nform, &index));
  for (PetscInt c = 0; c < t->loc->ncell_all; c++) index[t->form[c]] = 1;
  for (PetscInt f = 1; f < t->nform; f++) {
    if (!index[f]) continue;
    index[f] = kept++;
    PetscCall(PetscArraymove(t->fit + index[f] * n, t->fit + f * n, n));
  }
  for (PetscInt c = 0; c < t->loc->ncell_all; c++) t->form[c] = index[t->form[c]];
  t->nform = kept;
  PetscCall(PetscFree(index));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TransferUpdateCells(Transfer t, PetscInt n, const PetscInt cell[], const PetscInt cell_material[])
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt c = cell ? cell[e] : e;
    PetscReal      fit[4 * 8];

    t->form[c] = 0;
    if (cell_material && cell_material[c] < 0) continue;
    PetscCall(fit_vertices(t, c, fit));
    PetscCall(find_form(t, fit, &t->form[c]));
  }
  PetscCall(drop_forms(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- vertices ---- */

static PetscErrorCode number_vertices(Transfer t)
{
  const MeshLocal *l = t->loc;
  PetscInt         n = 0, begin, corner[8], *list;
  PetscMPIInt      size;
  PetscLayout      layout;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all, &t->at_node));
  PetscCall(MeshNumberVertices(t->mesh, t->at_node, &t->own));
  PetscCall(PetscLayoutCreateFromSizes(t->comm, t->own, PETSC_DETERMINE, 1, &layout));
  begin = layout->rstart;
  list_corners(l->dim, corner);
  PetscCall(PetscMalloc1(l->ncell_all * t->nv, &list));
  for (PetscInt e = 0; e < l->ncell_all * t->nv; e++) {
    const PetscInt g = t->at_node[l->cell_node[e / t->nv * l->nb + corner[e % t->nv]]];

    t->vertex[e] = g;
    if (g < begin || g >= begin + t->own) list[n++] = g;
  }
  PetscCall(PetscSortRemoveDupsInt(&n, list));
  t->all = t->own + n;
  PetscCall(PetscMalloc1(t->all, &t->global));
  for (PetscInt i = 0; i < t->all; i++) t->global[i] = i < t->own ? begin + i : list[i - t->own];
  for (PetscInt e = 0; e < l->ncell_all * t->nv; e++) {
    const PetscInt g = t->vertex[e];
    PetscInt       index;

    if (g >= begin && g < begin + t->own) t->vertex[e] = g - begin;
    else {
      PetscCall(PetscFindInt(g, n, list, &index));
      t->vertex[e] = t->own + index;
    }
  }
  PetscCallMPI(MPI_Comm_size(t->comm, &size));
  if (size > 1) {
    PetscCall(PetscSFCreate(t->comm, &t->sf));
    PetscCall(PetscSFSetGraphLayout(t->sf, layout, n, NULL, PETSC_COPY_VALUES, list));
    PetscCall(PetscSFSetUp(t->sf));
  }
  PetscCall(PetscLayoutDestroy(&layout));
  PetscCall(PetscFree(list));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TransferCreate(Mesh mesh, PetscInt nk, Transfer *transfer)
{
  Transfer        t;
  const PetscReal none[4 * 8] = {0};

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&t));
  t->mesh = mesh;
  t->nk   = nk;
  PetscCall(MeshGetLocal(mesh, &t->loc));
  PetscCall(MeshGetComm(mesh, &t->comm));
  t->nv = 1 << t->loc->dim;
  PetscCall(PetscMalloc2(t->loc->ncell_all * t->nv, &t->vertex, t->loc->ncell_all, &t->form));
  PetscCall(number_vertices(t));
  PetscCall(ArrayReserve(1, &t->capacity, &t->fit, nk * t->nv * sizeof(*t->fit), NULL));
  PetscCall(PetscArraycpy(t->fit, none, nk * t->nv));
  t->nform = 1;
  PetscCall(PetscArrayzero(t->form, t->loc->ncell_all));
  PetscCall(TransferUpdateCells(t, t->loc->ncell_all, NULL, NULL));
  *transfer = t;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TransferDestroy(Transfer *transfer)
{
  Transfer t = *transfer;

  PetscFunctionBeginUser;
  if (!t) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree(t->at_node));
  PetscCall(PetscFree(t->global));
  PetscCall(PetscFree2(t->vertex, t->form));
  PetscCall(PetscFree(t->fit));
  PetscCall(PetscSFDestroy(&t->sf));
  PetscCall(PetscFree(*transfer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TransferGetVertices(Transfer t, PetscInt *own, PetscInt *all, const PetscInt *global[],
                                   const PetscInt *node[])
{
  PetscFunctionBeginUser;
  *own    = t->own;
  *all    = t->all;
  *global = t->global;
  *node   = t->at_node;
  PetscFunctionReturn(PETSC_SUCCESS);
}

void TransferGetCell(Transfer t, PetscInt c, const PetscInt *vertex[], const PetscReal *fit[])
{
  *vertex = t->vertex + c * t->nv;
  *fit    = t->fit + t->form[c] * t->nk * t->nv;
}

/* ---- down and up ---- */

INLINE void scatter(const int nk, const int nv, Transfer t, const PetscReal *restrict r, PetscReal *restrict b)
{
  for (PetscInt c = 0; c < t->loc->ncell; c++) {
    const PetscInt  *vertex = t->vertex + c * nv;
    const PetscReal *fit    = t->fit + t->form[c] * nk * nv;
    PetscReal        sum[8] = {0};

    for (int k = 0; k < nk; k++)
      for (int v = 0; v < nv; v++) sum[v] += fit[k * nv + v] * r[c * nk + k];
    for (int v = 0; v < nv; v++) b[vertex[v]] += sum[v];
  }
}

/* x += fit v, of cells [begin, end) */
INLINE void gather(const int nk, const int nv, Transfer t, PetscInt begin, PetscInt end,
                   const PetscReal *restrict value, PetscReal *restrict x)
{
  for (PetscInt c = begin; c < end; c++, x += nk) {
    const PetscInt  *vertex = t->vertex + c * nv;
    const PetscReal *fit    = t->fit + t->form[c] * nk * nv;
    PetscReal        at[8];

    for (int v = 0; v < nv; v++) at[v] = value[vertex[v]];
    for (int k = 0; k < nk; k++)
      for (int v = 0; v < nv; v++) x[k] += fit[k * nv + v] * at[v];
  }
}

PetscErrorCode TransferRestrict(Transfer t, const PetscReal r[], PetscReal b[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(b, t->all));
  if (t->nk == 3) scatter(3, 4, t, r, b);
  else scatter(4, 8, t, r, b);
  if (!t->sf) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscSFReduceBegin(t->sf, MPIU_REAL, b + t->own, b, MPIU_SUM));
  PetscCall(PetscSFReduceEnd(t->sf, MPIU_REAL, b + t->own, b, MPIU_SUM));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TransferInterpolateAdd(Transfer t, PetscReal v[], PetscReal x[], PetscReal ghost[])
{
  const PetscInt n = t->loc->ncell, all = t->loc->ncell_all;

  PetscFunctionBeginUser;
  if (t->sf) PetscCall(PetscSFBcastBegin(t->sf, MPIU_REAL, v, v + t->own, MPI_REPLACE));
  if (t->sf) PetscCall(PetscSFBcastEnd(t->sf, MPIU_REAL, v, v + t->own, MPI_REPLACE));
  if (t->nk == 3) gather(3, 4, t, 0, n, v, x);
  else gather(4, 8, t, 0, n, v, x);
  if (!t->sf) PetscFunctionReturn(PETSC_SUCCESS);
  if (t->nk == 3) gather(3, 4, t, n, all, v, ghost);
  else gather(4, 8, t, n, all, v, ghost);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TransferCreateMat(Transfer t, Mat *A)
{
  const PetscInt nk = t->nk, nv = t->nv;

  PetscFunctionBeginUser;
  PetscCall(MatCreateAIJ(t->comm, t->loc->ncell * nk, t->own, PETSC_DETERMINE, PETSC_DETERMINE, nv, NULL, nv, NULL, A));
  for (PetscInt c = 0; c < t->loc->ncell; c++) {
    PetscInt row[4], col[8];

    for (PetscInt k = 0; k < nk; k++) row[k] = (t->loc->cell_start + c) * nk + k;
    for (PetscInt v = 0; v < nv; v++) col[v] = t->global[t->vertex[c * nv + v]];
    PetscCall(MatSetValues(*A, nk, row, nv, col, t->fit + t->form[c] * nk * nv, INSERT_VALUES));
  }
  PetscCall(MatAssemblyBegin(*A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*A, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}
