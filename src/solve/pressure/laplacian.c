/* Laplacian: see laplacian.h. */
#include "compat.h"
#include "laplacian.h"
#include "base/algebra.h"
#include "mesh/hang.h"

struct _p_Laplacian {
  Mesh             mesh;
  const MeshLocal *loc;
  unsigned char   *wall;              /* [nnode_all] on the boundary of the domain */
  PetscReal       *inner;             /* [ncell_all] shares of the nodes that are not */
  PetscReal (*fraction)[MESH_MAX_NB]; /* by way of hanging, see node_fractions(); 0: not asked for yet */
  /* gathered since the last flush */
  PetscReal *volume;           /* [ncell_all] or 0: not asked for yet */
  PetscReal *change;           /* [ncell_all][dim] of the coefficients */
  PetscReal *diagonal;         /* [nnode_all] of the diagonal, at vertices */
  PetscInt   ncell, *cell;     /* cells with a change */
  PetscInt   nvertex, *vertex; /* vertices with one */
  PetscBool *listed, *listed_vertex;
};

/* ---- geometry ---- */

/* Share of place j in its cell's volume: what Simpson's rule gives it */
static PetscReal node_fraction(PetscInt dim, PetscInt j)
{
  const PetscInt at[3]    = {j % 3, (j / 3) % 3, j / 9};
  PetscReal      fraction = 1;

  for (PetscInt a = 0; a < dim; a++) fraction *= at[a] == 1 ? 4.0 / 6 : 1.0 / 6;
  return fraction;
}

/* Shares of the nodes in the slots of cell c. Where a cell hangs, places on its faces give theirs to the nodes of the
   larger one; a node that the cell does not touch may get up to -1/12 along an axis. */
static const PetscReal *node_fractions(Laplacian s, PetscInt c)
{
  const MeshLocal *l        = s->loc;
  const MeshHang  *h        = MeshCellHang(l, c);
  PetscReal       *fraction = s->fraction[h ? 1 + h->code : 0];

  if (fraction[l->nb / 2] != 0) return fraction; /* a middle never hangs */
  for (PetscInt i = 0; i < l->nb; i++) fraction[i] = node_fraction(l->dim, i);
  if (h) MeshHangScatter(h, 1, fraction);
  return fraction;
}

/* Local numbers in the cell of its corners, first axis fastest */
static void list_corners(PetscInt dim, PetscInt corner[])
{
  for (PetscInt v = 0; v < 1 << dim; v++) corner[v] = 2 * (v & 1) + 6 * ((v >> 1) & 1) + 18 * (v >> 2);
}

/* Jacobian J of the multilinear map at xi, slopes slope [2^dim][dim] of its corner functions along reference axes */
static void corner_slopes(PetscInt dim, const PetscReal xc[], const PetscReal xi[], PetscReal J[], PetscReal slope[])
{
  PetscInt corner[8];

  list_corners(dim, corner);
  for (PetscInt i = 0; i < dim * dim; i++) J[i] = 0;
  for (PetscInt v = 0; v < 1 << dim; v++) {
    for (PetscInt e = 0; e < dim; e++) {
      PetscReal s = 1;

      for (PetscInt o = 0; o < dim; o++) {
        const PetscReal sign = (v >> o) & 1 ? 1 : -1;

        s *= o == e ? 0.5 * sign : 0.5 * (1 + sign * xi[o]);
      }
      slope[v * dim + e] = s;
      for (PetscInt a = 0; a < dim; a++) J[a * dim + e] += s * xc[corner[v] * dim + a];
    }
  }
}

static PetscErrorCode cell_volume(Laplacian s, PetscInt c, PetscReal *volume)
{
  const PetscInt  dim       = s->loc->dim;
  const PetscReal centre[3] = {0, 0, 0};
  PetscReal       xc[MESH_MAX_NB * 3], J[9], slope[24];

  PetscFunctionBeginUser;
  if (s->volume[c] == 0) {
    PetscCall(MeshCellCoordinates(s->mesh, c, xc));
    corner_slopes(dim, xc, centre, J, slope);
    s->volume[c] = PetscAbsReal(DenseDeterminant(dim, J)) * (1 << dim);
  }
  *volume = s->volume[c];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From the corners of a cell to its corner slots, the vertices of large faces where these hang: K <- T^T K T */
static void move_to_slots(const MeshHang *h, PetscInt nv, PetscReal K[])
{
  PetscReal KT[64] = {0};

  for (PetscInt e = 0; e < nv * nv; e++)
    for (PetscInt v = 0; v < nv; v++) KT[e] += K[e / nv * nv + v] * h->corner[v][e % nv];
  for (PetscInt e = 0; e < nv * nv; e++) {
    K[e] = 0;
    for (PetscInt v = 0; v < nv; v++) K[e] += h->corner[v][e / nv] * KT[v * nv + e % nv];
  }
}

/* Is a cell in space a box along the axes? */
static PetscBool is_box(const PetscReal xc[])
{
  for (PetscInt j = 0; j < 27; j++)
    for (PetscInt a = 0; a < 3; a++) {
      const PetscInt  side = a == 0 ? j % 3 : a == 1 ? j / 3 % 3 : j / 9;
      const PetscReal h    = xc[26 * 3 + a] - xc[a];

      if (side != 1 && PetscAbsReal(xc[j * 3 + a] - (side ? xc[26 * 3 + a] : xc[a])) > 1e-10 * h) return PETSC_FALSE;
    }
  return PETSC_TRUE;
}

/* The matrix below of a box: integrals are products of those along the axes */
static void box_matrix(const PetscReal xc[], const PetscReal k[], PetscReal K[])
{
  PetscReal h[3], f[3];

  for (int a = 0; a < 3; a++) h[a] = xc[26 * 3 + a] - xc[a];
  for (int a = 0; a < 3; a++) f[a] = k[a] * h[0] * h[1] * h[2] / (36 * h[a] * h[a]);
  for (int e = 0; e < 64; e++) {
    const int       apart    = (e / 8) ^ (e % 8); /* bits: axes along which the two vertices differ */
    const PetscReal mass[3]  = {apart & 1 ? 1 : 2, apart & 2 ? 1 : 2, apart & 4 ? 1 : 2};
    const PetscReal slope[3] = {apart & 1 ? -1 : 1, apart & 2 ? -1 : 1, apart & 4 ? -1 : 1};

    K[e] = f[0] * slope[0] * mass[1] * mass[2] + f[1] * mass[0] * slope[1] * mass[2] +
           f[2] * mass[0] * mass[1] * slope[2];
  }
}

/* K [2^dim][2^dim] = sum over axes a of k[a] int (d phi_u/da) (d phi_v/da) over a cell, by two points an axis */
static PetscErrorCode cell_matrix(Laplacian s, PetscInt c, const PetscReal k[], PetscReal K[])
{
  const PetscInt  dim = s->loc->dim, nv = 1 << dim;
  const PetscReal gauss = PetscSqrtReal(1.0 / 3);
  PetscReal       xc[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(s->mesh, c, xc));
  for (PetscInt e = 0; e < nv * nv; e++) K[e] = 0;
  if (dim == 3 && s->loc->hang && is_box(xc)) {
    box_matrix(xc, k, K);
    if (MeshCellHang(s->loc, c)) move_to_slots(MeshCellHang(s->loc, c), nv, K);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt q = 0; q < nv; q++) {
    const PetscReal xi[3] = {q & 1 ? gauss : -gauss, (q >> 1) & 1 ? gauss : -gauss, q >> 2 ? gauss : -gauss};
    PetscReal       J[9], inv[9], slope[24], grad[24], weight;

    corner_slopes(dim, xc, xi, J, slope);
    weight = PetscAbsReal(DenseInvertMap(dim, J, inv));
    for (PetscInt v = 0; v < nv; v++) {
      for (PetscInt a = 0; a < dim; a++) {
        grad[v * dim + a] = 0;
        for (PetscInt e = 0; e < dim; e++) grad[v * dim + a] += inv[e * dim + a] * slope[v * dim + e];
      }
    }
    for (PetscInt u = 0; u < nv; u++)
      for (PetscInt v = 0; v < nv; v++)
        for (PetscInt a = 0; a < dim; a++) K[u * nv + v] += weight * k[a] * grad[u * dim + a] * grad[v * dim + a];
  }
  if (MeshCellHang(s->loc, c)) move_to_slots(MeshCellHang(s->loc, c), nv, K);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- changes ---- */

/* Cells within a body have lost their divergence; they have no coefficient */
static PetscBool is_inactive(const MeshLocal *l, const PetscReal *const b[], PetscInt nk, PetscInt c)
{
  const PetscInt   dim = l->dim, nd = l->nb * dim;
  const PetscReal *slopes = b[c] + (l->nb / 2) * dim; /* at the centre node */

  for (PetscInt k = 1; k < nk; k++)
    for (PetscInt a = 0; a < dim; a++)
      if (slopes[k * nd + a] != 0) return PETSC_FALSE;
  return PETSC_TRUE;
}

static void touch(PetscBool listed[], PetscInt *n, PetscInt list[], PetscInt i)
{
  if (!listed[i]) list[(*n)++] = i;
  listed[i] = PETSC_TRUE;
}

/* The diagonal's part of boundary node i, number j in cell c: to the vertices at it in equal parts */
static void set_vertices(Laplacian s, PetscInt c, PetscInt j, PetscReal value)
{
  const MeshLocal *l     = s->loc;
  const PetscInt   at[3] = {j % 3, (j / 3) % 3, j / 9};
  PetscInt         n     = 0, corner[8], mine[8];

  list_corners(l->dim, corner);
  for (PetscInt v = 0; v < 1 << l->dim; v++) {
    PetscBool near = PETSC_TRUE;

    for (PetscInt a = 0; a < l->dim; a++) near = (PetscBool)(near && (at[a] == 1 || at[a] == 2 * ((v >> a) & 1)));
    if (near) mine[n++] = l->cell_node[c * l->nb + corner[v]];
  }
  for (PetscInt v = 0; v < n; v++) {
    s->diagonal[mine[v]] += value / n;
    touch(s->listed_vertex, &s->nvertex, s->vertex, mine[v]);
  }
}

static PetscErrorCode add_boundary_node(Laplacian s, const PetscReal *const b[], PetscInt i, const PetscReal change[])
{
  const MeshLocal *l       = s->loc;
  const PetscInt   dim     = l->dim;
  PetscReal        flux[3] = {0, 0, 0}, value = 0;
  PetscInt         c = -1, j = 0;

  PetscFunctionBeginUser;
  for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
    c = l->node_cell[q];
    for (j = 0; l->cell_node[c * l->nb + j] != i;) j++;
    for (PetscInt a = 0; a < dim; a++) flux[a] += b[c][j * dim + a];
  }
  for (PetscInt a = 0; a < dim; a++) value += change[a] * PetscSqr(flux[a]);
  if (value != 0) set_vertices(s, c, j, value);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LaplacianAddNode(Laplacian s, const PetscReal *const b[], PetscInt nk, PetscInt i,
                                const PetscReal change[])
{
  const MeshLocal *l   = s->loc;
  const PetscInt   dim = l->dim, begin = l->node_cell_ptr[i], n = l->node_cell_ptr[i + 1] - begin;
  PetscReal        volume = 0;

  PetscFunctionBeginUser;
  if (s->wall[i]) {
    PetscCall(add_boundary_node(s, b, i, change));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt pass = 0; pass < 2; pass++) { /* the node's volume, then its part in the cells' coefficients */
    for (PetscInt q = 0; q < n; q++) {
      const PetscInt c = l->node_cell[begin + q];
      PetscInt       j = 0;
      PetscReal      size, fraction;

      if (is_inactive(l, b, nk, c)) continue;
      while (l->cell_node[c * l->nb + j] != i) j++;
      fraction = node_fractions(s, c)[j];
      if (pass == 0) {
        PetscCall(cell_volume(s, c, &size));
        volume += fraction * size;
        continue;
      }
      for (PetscInt a = 0; a < dim; a++)
        s->change[c * dim + a] += change[a] * volume * PetscAbsReal(fraction) / s->inner[c];
      touch(s->listed, &s->ncell, s->cell, c);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nothing is gathered any more */
static void forget_changes(Laplacian s)
{
  const PetscInt dim = s->loc->dim;

  for (PetscInt n = 0; n < s->ncell; n++) {
    const PetscInt c = s->cell[n];

    for (PetscInt a = 0; a < dim; a++) s->change[c * dim + a] = 0;
    s->listed[c] = PETSC_FALSE;
    s->volume[c] = 0;
  }
  for (PetscInt n = 0; n < s->nvertex; n++) {
    s->diagonal[s->vertex[n]]      = 0;
    s->listed_vertex[s->vertex[n]] = PETSC_FALSE;
  }
  s->ncell = s->nvertex = 0;
}

PetscErrorCode LaplacianFlush(Laplacian s, const PetscInt vertex[], Mat A)
{
  const MeshLocal *l   = s->loc;
  const PetscInt   dim = l->dim, nv = 1 << dim;
  PetscInt         corner[8], row[8];
  PetscReal        K[64];

  PetscFunctionBeginUser;
  list_corners(dim, corner);
  for (PetscInt n = 0; n < s->ncell; n++) {
    const PetscInt c = s->cell[n];

    PetscCall(cell_matrix(s, c, s->change + c * dim, K));
    for (PetscInt v = 0; v < nv; v++) row[v] = vertex[l->cell_node[c * l->nb + corner[v]]];
    PetscCall(MatSetValues(A, nv, row, nv, row, K, ADD_VALUES));
  }
  for (PetscInt n = 0; n < s->nvertex; n++) {
    const PetscInt i = s->vertex[n];

    PetscCall(MatSetValue(A, vertex[i], vertex[i], s->diagonal[i], ADD_VALUES));
  }
  forget_changes(s);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LaplacianTake(Laplacian s, const PetscInt vertex[], PetscInt *n, PetscInt *cell[], PetscReal *change[],
                             PetscInt *nvertex, PetscInt *row[], PetscReal *value[])
{
  const PetscInt dim = s->loc->dim;

  PetscFunctionBeginUser;
  *n       = s->ncell;
  *nvertex = s->nvertex;
  PetscCall(PetscMalloc1(s->ncell, cell));
  PetscCall(PetscMalloc1(s->ncell * dim, change));
  PetscCall(PetscMalloc1(s->nvertex, row));
  PetscCall(PetscMalloc1(s->nvertex, value));
  for (PetscInt i = 0; i < s->ncell; i++) {
    (*cell)[i] = s->cell[i];
    PetscCall(PetscArraycpy(*change + i * dim, s->change + s->cell[i] * dim, dim));
  }
  for (PetscInt v = 0; v < s->nvertex; v++) {
    (*row)[v]   = vertex[s->vertex[v]];
    (*value)[v] = s->diagonal[s->vertex[v]];
  }
  forget_changes(s);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode find_walls(Laplacian s)
{
  const MeshLocal *l = s->loc;
  PetscInt         count;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryCount(s->mesh, &count));
  for (PetscInt b = 0; b < count; b++) {
    const PetscInt *node;
    PetscInt        n;

    PetscCall(MeshGetBoundaryNodes(s->mesh, b, &n, &node));
    for (PetscInt i = 0; i < n; i++) s->wall[node[i]] = PETSC_TRUE;
  }
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    const PetscReal *fraction = node_fractions(s, c);

    for (PetscInt j = 0; j < l->nb; j++)
      if (!s->wall[l->cell_node[c * l->nb + j]]) s->inner[c] += PetscAbsReal(fraction[j]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LaplacianCreate(Mesh mesh, Laplacian *laplacian)
{
  const MeshLocal *l;
  Laplacian        s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->mesh = mesh;
  PetscCall(MeshGetLocal(mesh, &s->loc));
  l = s->loc;
  PetscCall(PetscCalloc4(l->nnode_all, &s->wall, l->nnode_all, &s->diagonal, l->nnode_all, &s->vertex, l->nnode_all,
                         &s->listed_vertex));
  PetscCall(PetscCalloc5(l->ncell_all, &s->inner, l->ncell_all * l->dim, &s->change, l->ncell_all, &s->volume,
                         l->ncell_all, &s->cell, l->ncell_all, &s->listed));
  PetscCall(PetscCalloc1(l->hang ? 1 + MESH_HANG_CODES : 1, &s->fraction));
  PetscCall(find_walls(s));
  *laplacian = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LaplacianDestroy(Laplacian *laplacian)
{
  Laplacian s = *laplacian;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree4(s->wall, s->diagonal, s->vertex, s->listed_vertex));
  PetscCall(PetscFree5(s->inner, s->change, s->volume, s->cell, s->listed));
  PetscCall(PetscFree(s->fraction));
  PetscCall(PetscFree(*laplacian));
  PetscFunctionReturn(PETSC_SUCCESS);
}
