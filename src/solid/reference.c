/* SolidMesh: see solid/reference.h. */
#include "compat.h"
#include "solid/reference.h"
#include "align/align.h"
#include "base/algebra.h"
#include "fem/element.h"
#include "fem/gauss.h"
#include "fem/side.h"
#include "mesh/mesh.h"
#include "figure.h"
#include "shape/host.h"
#include "space.h"

#define MARGIN    5 /* cells of the box mesh beyond the shape: what follows a surface, and one more */
#define MIN_CELLS 2 /* cells across it */

/* ---- the box ---- */

static PetscErrorCode create_box(const Figure *f, PetscInt dim, const PetscInt cells[], PetscReal size, Mesh *mesh,
                                 PetscReal *h)
{
  PetscReal lower[3] = {0}, upper[3] = {0};
  PetscInt  n[3] = {0};

  PetscFunctionBeginUser;
  PetscCall(FigureFindBox(f, dim, lower, upper));
  *h = 0;
  for (PetscInt d = 0; d < dim; d++) {
    const PetscReal length = upper[d] - lower[d];

    n[d] = cells[d] > 0 ? cells[d] : PetscMax(MIN_CELLS, (PetscInt)PetscFloorReal(length / size + 0.5));
    *h   = PetscMax(*h, length / (PetscReal)n[d]);
    lower[d] -= MARGIN * length / (PetscReal)n[d];
    upper[d] += MARGIN * length / (PetscReal)n[d];
    n[d] += 2 * MARGIN;
  }
  PetscCall(MeshCreateBox(PETSC_COMM_SELF, dim, n, lower, upper, mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what follows from cells and nodes ---- */

/* Gradients and weights at the quadrature points of cell c; *det the smallest determinant so far */
static void measure_cell(SolidMesh *m, PetscInt c, PetscReal *min)
{
  const PetscInt dim = m->dim, nb = m->nb;
  PetscReal      xc[27 * 3];

  for (PetscInt j = 0; j < nb; j++)
    for (PetscInt a = 0; a < dim; a++) xc[dim * j + a] = m->X[dim * m->cell_node[c * nb + j] + a];
  for (PetscInt q = 0; q < m->nq; q++) {
    const PetscReal xi[3] = {GAUSS3_POINT[q % 3], GAUSS3_POINT[q / 3 % 3], GAUSS3_POINT[q / 9]};
    PetscReal      *g = m->grad + (c * m->nq + q) * nb * dim, dphi[3 * 27], J[9] = {0}, inv[9], det;

    ElementBasis(dim, xi, m->phi + q * nb, dphi);
    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt e = 0; e < dim; e++)
        for (PetscInt j = 0; j < nb; j++) J[a * dim + e] += xc[dim * j + a] * dphi[e * nb + j];
    det                      = DenseInvertMap(dim, J, inv);
    *min                     = PetscMin(*min, det);
    m->weight[c * m->nq + q] = det * GAUSS3_WEIGHT[q % 3] * GAUSS3_WEIGHT[q / 3 % 3] *
                               (dim == 2 ? 1 : GAUSS3_WEIGHT[q / 9]);
    m->volume += m->weight[c * m->nq + q];
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) {
        g[dim * j + a] = 0;
        for (PetscInt e = 0; e < dim; e++) g[dim * j + a] += dphi[e * nb + j] * inv[e * dim + a];
      }
  }
}

/* Nodes of side k of a cell: in the plane one after the other around it, in space their normal outwards */
static void list_side(PetscInt dim, PetscInt k, PetscInt slot[SIDE_MAX])
{
  static const PetscInt EDGE[4][3] = {{0, 1, 2}, {2, 5, 8}, {8, 7, 6}, {6, 3, 0}};

  if (dim == 3) SideListOutward(k, slot);
  else
    for (PetscInt j = 0; j < 3; j++) slot[j] = EDGE[k][j];
}

/* Sides that one cell alone has: their middle nodes belong to it alone */
static PetscErrorCode find_sides(SolidMesh *m)
{
  const PetscInt ns = 2 * m->dim, nb = m->dim == 2 ? 3 : 9, middle = nb / 2;
  PetscInt      *cells, slot[6][SIDE_MAX];

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < ns; k++) list_side(m->dim, k, slot[k]);
  PetscCall(PetscCalloc1(m->nnode, &cells));
  for (PetscInt e = 0; e < m->ncell * ns; e++) cells[m->cell_node[e / ns * m->nb + slot[e % ns][middle]]]++;
  for (PetscInt e = 0; e < m->ncell * ns; e++)
    m->nside += cells[m->cell_node[e / ns * m->nb + slot[e % ns][middle]]] == 1;
  m->nb_side = nb;
  PetscCall(PetscMalloc1(nb * m->nside, &m->side));
  m->nside = 0;
  for (PetscInt e = 0; e < m->ncell * ns; e++) {
    const PetscInt *node = m->cell_node + e / ns * m->nb;

    if (cells[node[slot[e % ns][middle]]] != 1) continue;
    for (PetscInt j = 0; j < nb; j++) m->side[nb * m->nside + j] = node[slot[e % ns][j]];
    m->nside++;
  }
  PetscCall(PetscFree(cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells [ncell][nb] of nodes X [nnode][dim], copied. Error: a cell is inverted. */
static PetscErrorCode create_from(PetscInt dim, PetscInt nnode, const PetscReal X[], PetscInt ncell,
                                  const PetscInt cell_node[], SolidMesh *m)
{
  PetscReal min = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  PetscCall(SolidMeshAllocate(dim, dim, nnode, ncell, m));
  PetscCall(PetscArraycpy(m->cell_node, cell_node, ncell * m->nb));
  PetscCall(PetscArraycpy(m->X, X, nnode * dim));
  for (PetscInt c = 0; c < ncell; c++) measure_cell(m, c, &min);
  PetscCheck(ncell > 0 && min > 0, PETSC_COMM_SELF, PETSC_ERR_ARG_WRONG, "A cell of a solid's mesh is inverted");
  SolidMeshFindRadius(m);
  PetscCall(SolidMeshFindNeighbours(m));
  PetscCall(find_sides(m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- nodes ---- */

/* Of a cell with nodes x [9][2]: mid-edge nodes halfway, those of the surface (on) on it; the centre by transfinite
   interpolation */
static PetscErrorCode place_middles(Shape shape, const PetscBool on[], PetscReal x[])
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < 4; e++) {
    PetscReal half[2];

    for (PetscInt a = 0; a < 2; a++) half[a] = 0.5 * (x[2 * ELEMENT_EDGE[e][0] + a] + x[2 * ELEMENT_EDGE[e][2] + a]);
    PetscCall(PetscArraycpy(x + 2 * ELEMENT_EDGE[e][1], half, 2));
    if (on[ELEMENT_EDGE[e][1]]) PetscCall(ShapeProject(shape, 1, half, x + 2 * ELEMENT_EDGE[e][1]));
  }
  for (PetscInt a = 0; a < 2; a++)
    x[8 + a] = 0.5 * (x[2 + a] + x[6 + a] + x[10 + a] + x[14 + a]) - 0.25 * (x[a] + x[4 + a] + x[12 + a] + x[16 + a]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells inside the shape, and their nodes about its centroid */
static PetscErrorCode take_inside(Mesh mesh, const Figure *f, const AlignResult *r, SolidMesh *m)
{
  const MeshLocal *l   = NULL;
  PetscInt         dim = 0, *number, *cell_node, ncell = 0, nnode = 0;
  PetscReal       *X;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  dim = l->dim;
  PetscCall(PetscMalloc3(l->nnode_all, &number, l->ncell_all * l->nb, &cell_node, l->nnode_all * dim, &X));
  for (PetscInt i = 0; i < l->nnode_all; i++) number[i] = -1;
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal x[3 * 27];
    PetscBool on[27];

    if (r->cell_surface[c] < 0) continue;
    PetscCall(MeshCellCoordinates(mesh, c, x));
    for (PetscInt j = 0; j < l->nb; j++) on[j] = r->on_wall[l->cell_node[c * l->nb + j]];
    if (dim == 2) PetscCall(place_middles(f->shape, on, x));
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt i = l->cell_node[c * l->nb + j];

      if (number[i] < 0) {
        number[i] = nnode++;
        for (PetscInt a = 0; a < dim; a++) X[dim * number[i] + a] = x[dim * j + a] - f->centre[0][a];
      }
      cell_node[ncell * l->nb + j] = number[i];
    }
    ncell++;
  }
  PetscCall(create_from(dim, nnode, X, ncell, cell_node, m));
  PetscCall(PetscFree3(number, cell_node, X));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* In space, where it is needed */
static PetscErrorCode add_layer(SolidMesh *m)
{
  const PetscReal h = m->h;
  PetscInt        nnode, ncell, *cell_node;
  PetscReal      *X;

  PetscFunctionBeginUser;
  PetscCall(SolidAddLayer(m, &nnode, &X, &ncell, &cell_node));
  if (!ncell) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SolidMeshDestroy(m));
  PetscCall(create_from(3, nnode, X, ncell, cell_node, m));
  m->h = h;
  PetscCall(PetscFree2(X, cell_node));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidMeshCreate(Shape shape, const char name[], PetscInt dim, const PetscInt cells[], PetscReal size,
                               SolidMesh *m)
{
  const PetscBool wanted = PETSC_TRUE;
  Figure          f;
  Mesh            mesh;
  Align           align;
  AlignResult     r;
  PetscBool       fitted = PETSC_FALSE;
  PetscReal       h      = 0;

  PetscFunctionBeginUser;
  PetscCall(FigureDescribe(shape, dim, &f));
  PetscCall(create_box(&f, dim, cells, size, &mesh, &h));
  PetscCall(AlignCreate(mesh, &f.table, &align));
  PetscCall(AlignFit(align, &wanted, NULL, &fitted, &r));
  PetscCheck(fitted && r.ncut == 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s': cells of size %g cannot follow its shape: give more of them, such as -particle_%s_solid_size %g",
             name, (double)h, name, (double)(0.5 * h));
  PetscCall(MeshMoveNodes(mesh, r.nnode, r.node, r.x));
  PetscCall(take_inside(mesh, &f, &r, m));
  m->h = h;
  if (dim == 3) PetscCall(add_layer(m));
  PetscCall(AlignDestroy(&align));
  PetscCall(MeshDestroy(&mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidMeshAllocate(PetscInt dim, PetscInt nd, PetscInt nnode, PetscInt ncell, SolidMesh *m)
{
  const PetscInt nb = nd == 1 ? 3 : nd == 2 ? 9 : 27;

  PetscFunctionBeginUser;
  *m = (SolidMesh){.dim = dim, .nd = nd, .nb = nb, .nq = nb, .nnode = nnode, .ncell = ncell};
  PetscCall(PetscMalloc3(ncell * nb, &m->cell_node, nnode * dim, &m->X, nb * nb, &m->phi));
  PetscCall(PetscMalloc2(ncell * nb * nb * nd, &m->grad, ncell * nb, &m->weight));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void SolidMeshFindRadius(SolidMesh *m)
{
  for (PetscInt i = 0; i < m->nnode; i++) {
    PetscReal r = 0;

    for (PetscInt a = 0; a < m->dim; a++) r += PetscSqr(m->X[m->dim * i + a]);
    m->radius = PetscMax(m->radius, PetscSqrtReal(r));
  }
}

PetscErrorCode SolidMeshFindNeighbours(SolidMesh *m)
{
  PetscInt *count, *cells, total = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(m->nnode + 1, &count, m->ncell * m->nb, &cells));
  for (PetscInt e = 0; e < m->ncell * m->nb; e++) count[m->cell_node[e] + 1]++;
  for (PetscInt i = 0; i < m->nnode; i++) count[i + 1] += count[i];
  for (PetscInt e = 0; e < m->ncell * m->nb; e++) cells[count[m->cell_node[e]]++] = e / m->nb;
  PetscCall(PetscMalloc2(m->nnode + 1, &m->around, m->ncell * m->nb * m->nb, &m->neighbour));
  m->around[0] = 0;
  for (PetscInt i = 0; i < m->nnode; i++) { /* count[i] is now where the cells around i end */
    for (PetscInt k = i ? count[i - 1] : 0; k < count[i]; k++)
      for (PetscInt j = 0; j < m->nb; j++) {
        const PetscInt node = m->cell_node[cells[k] * m->nb + j];
        PetscInt       e    = m->around[i];

        while (e < total && m->neighbour[e] != node) e++;
        if (e == total) m->neighbour[total++] = node;
      }
    m->around[i + 1] = total;
  }
  PetscCall(PetscFree2(count, cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidMeshDestroy(SolidMesh *m)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree3(m->cell_node, m->X, m->phi));
  PetscCall(PetscFree2(m->grad, m->weight));
  PetscCall(PetscFree(m->side));
  PetscCall(PetscFree2(m->around, m->neighbour));
  PetscCall(PetscFree2(m->laplace, m->curvature));
  *m = (SolidMesh){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}
