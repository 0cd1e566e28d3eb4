/* SolidMesh of a membrane: see solid/reference.h. In space the surface of a lattice box around the shape goes along
   rays from the centroid onto that of the shape, with lines at equal angles (of a sphere: Ronchi, Iacono & Paolucci
   1996); in the plane nodes stand at equal distances along the outline. */
#include "compat.h"
#include "solid/reference.h"
#include "base/algebra.h"
#include "fem/element.h"
#include "fem/gauss.h"
#include "figure.h"
#include "membrane.h"
#include "shape/host.h"

#define MIN_CELLS 2    /* across the box */
#define FINE      1e-5 /* of the radius: how far off the outline on which nodes are counted out may be */
#define HALVINGS  52

/* Cells of the box whose surface they are: as many as edges of that size make of a quarter of a circle along a face */
static void count_cells(PetscInt dim, const PetscReal length[], const PetscInt cells[], PetscReal size, PetscInt n[3])
{
  for (PetscInt d = 0; d < dim; d++)
    n[d] = cells[d] > 0 ? cells[d]
                        : PetscMax(MIN_CELLS, (PetscInt)PetscFloorReal(PETSC_PI / 4 * length[d] / size + 0.5));
}

/* ---- in the plane ---- */

/* X [nnode][2]: along the outline, counter-clockwise, at equal distances */
static PetscErrorCode divide_outline(Shape shape, PetscInt nnode, PetscReal X[])
{
  PetscReal *at, *x, total = 0, done = 0;
  PetscInt   n, k = 0;

  PetscFunctionBeginUser;
  PetscCall(ShapeOutline(shape, FINE, &n, &x));
  PetscCall(PetscMalloc1(n, &at)); /* length of the piece after a point */
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt j = (i + 1) % n;

    at[i] = PetscHypotReal(x[2 * j] - x[2 * i], x[2 * j + 1] - x[2 * i + 1]);
    total += at[i];
  }
  for (PetscInt i = 0; i < nnode; i++) {
    const PetscReal s = total * (PetscReal)i / (PetscReal)nnode;

    while (k < n - 1 && done + at[k] < s) done += at[k++];
    for (PetscInt a = 0; a < 2; a++)
      X[2 * i + a] = x[2 * k + a] + (s - done) / at[k] * (x[2 * ((k + 1) % n) + a] - x[2 * k + a]);
  }
  PetscCall(ShapeProject(shape, nnode, X, X));
  PetscCall(PetscFree(at));
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_curve(Shape shape, const PetscInt n[], SolidMesh *m)
{
  const PetscInt ncell = 2 * (n[0] + n[1]);

  PetscFunctionBeginUser;
  PetscCall(SolidMeshAllocate(2, 1, 2 * ncell, ncell, m));
  for (PetscInt e = 0; e < 3 * ncell; e++) m->cell_node[e] = (2 * (e / 3) + e % 3) % (2 * ncell);
  PetscCall(divide_outline(shape, m->nnode, m->X));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- in space ---- */

/* Node `at` of the lattice of a box of n cells an axis */
static PetscInt lattice(const PetscInt n[3], const PetscInt at[3])
{
  return at[0] + (2 * n[0] + 1) * (at[1] + (2 * n[1] + 1) * at[2]);
}

/* Faces of the lattice's surface, normal outwards; number [lattice]: of their nodes */
static void list_faces(const PetscInt n[3], const PetscInt number[], PetscInt cell_node[])
{
  PetscInt f = 0;

  for (PetscInt side = 0; side < 6; side++) {
    const PetscInt d = side / 2, a = (d + 1) % 3, b = (d + 2) % 3;

    for (PetscInt i = 0; i < n[a] * n[b]; i++, f++)
      for (PetscInt j = 0; j < 9; j++) {
        const PetscInt along = side % 2 ? j % 3 : j / 3, across = side % 2 ? j / 3 : j % 3;
        PetscInt       at[3];

        at[d]                = side % 2 ? 2 * n[d] : 0;
        at[a]                = 2 * (i % n[a]) + along;
        at[b]                = 2 * (i / n[a]) + across;
        cell_node[9 * f + j] = number[lattice(n, at)];
      }
  }
}

/* The points of rays from c to X [n][3] that are on the surface; X is outside of the shape, or on it */
static PetscErrorCode draw_onto(Shape shape, const PetscReal c[3], PetscInt n, PetscReal X[])
{
  PetscReal *low, *high, *x, *d;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc4(n, &low, n, &high, 3 * n, &x, n, &d));
  for (PetscInt i = 0; i < n; i++) {
    low[i]  = 0;
    high[i] = 1;
  }
  for (PetscInt it = 0; it < HALVINGS; it++) {
    for (PetscInt i = 0; i < 3 * n; i++) x[i] = c[i % 3] + 0.5 * (low[i / 3] + high[i / 3]) * (X[i] - c[i % 3]);
    PetscCall(ShapeDistance(shape, n, x, d));
    for (PetscInt i = 0; i < n; i++) *(d[i] < 0 ? &low[i] : &high[i]) = 0.5 * (low[i] + high[i]);
  }
  PetscCall(PetscArraycpy(X, x, 3 * n));
  PetscCall(PetscFree4(low, high, x, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is every ray from c to a node of the surface out of the shape there, with nothing of it beyond? */
static PetscErrorCode check_rays(Shape shape, const char name[], const PetscReal c[3], PetscInt n, const PetscReal X[])
{
  PetscReal *normal, cosine = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(3 * n, &normal));
  PetscCall(ShapeNormal(shape, n, X, normal));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal r[3] = {X[3 * i] - c[0], X[3 * i + 1] - c[1], X[3 * i + 2] - c[2]};

    cosine = PetscMin(cosine, dot3(r, normal + 3 * i));
  }
  PetscCall(PetscFree(normal));
  PetscCheck(cosine > 0, PETSC_COMM_SELF, PETSC_ERR_SUP,
             "Group '%s': a membrane in space needs a shape whose surface is seen whole from its centroid, and not from within it: give "
             "-particle_%s_shape another one",
             name, name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_surface(const Figure *f, const char name[], const PetscInt n[3], const PetscReal lower[3],
                                     const PetscReal upper[3], SolidMesh *m)
{
  const PetscInt total = (2 * n[0] + 1) * (2 * n[1] + 1) * (2 * n[2] + 1);
  const PetscInt ncell = 2 * (n[0] * n[1] + n[1] * n[2] + n[2] * n[0]);
  PetscInt      *number, nnode = 0;
  PetscReal      inside;

  PetscFunctionBeginUser;
  PetscCall(ShapeDistance(f->shape, 1, f->centre[0], &inside));
  PetscCheck(inside < 0, PETSC_COMM_SELF, PETSC_ERR_SUP,
             "Group '%s': a membrane in space needs a shape that holds its own centroid: give -particle_%s_shape another one",
             name, name);
  PetscCall(PetscMalloc1(total, &number));
  PetscCall(SolidMeshAllocate(3, 2, 4 * ncell + 2, ncell, m));
  for (PetscInt e = 0; e < total; e++) {
    const PetscInt at[3] = {e % (2 * n[0] + 1), e / (2 * n[0] + 1) % (2 * n[1] + 1),
                            e / ((2 * n[0] + 1) * (2 * n[1] + 1))};
    PetscBool      on    = PETSC_FALSE;

    for (PetscInt d = 0; d < 3; d++) on = (PetscBool)(on || at[d] % (2 * n[d]) == 0);
    number[e] = on ? nnode++ : -1;
    for (PetscInt d = 0; d < 3 && on; d++) {
      const PetscReal s = PetscTanReal(PETSC_PI / 4 * ((PetscReal)at[d] / (PetscReal)n[d] - 1));

      m->X[3 * number[e] + d] = 0.5 * (lower[d] + upper[d]) + 1.01 * s * 0.5 * (upper[d] - lower[d]);
    }
  }
  list_faces(n, number, m->cell_node);
  PetscCall(PetscFree(number));
  PetscCall(draw_onto(f->shape, f->centre[0], nnode, m->X));
  PetscCall(check_rays(f->shape, name, f->centre[0], nnode, m->X));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what follows from nodes ---- */

/* The tangents t [nd][3] of a place become two orthogonal directions along the surface, of which a step in xi is
   J [direction][xi]; normal [3] outwards, times the area. */
static void make_frame(PetscInt nd, PetscReal t[2][3], PetscReal J[4], PetscReal normal[3])
{
  J[1] = J[2] = 0;
  J[3]        = 1;
  J[0]        = PetscSqrtReal(dot3(t[0], t[0]));
  if (nd == 1) {
    normal[0] = t[0][1];
    normal[1] = -t[0][0];
    normal[2] = 0;
    return;
  }
  cross(t[0], t[1], normal);
  J[1] = dot3(t[0], t[1]) / J[0];
  J[3] = PetscSqrtReal(dot3(normal, normal)) / J[0];
}

static void measure_cell(SolidMesh *m, PetscInt c, PetscReal *largest)
{
  const PetscInt dim = m->dim, nd = m->nd, nb = m->nb;
  PetscReal      size = 0;

  for (PetscInt q = 0; q < m->nq; q++) {
    const PetscReal xi[2]  = {GAUSS3_POINT[q % 3], GAUSS3_POINT[q / 3 % 3]};
    const PetscReal weight = GAUSS3_WEIGHT[q % 3] * (nd == 2 ? GAUSS3_WEIGHT[q / 3] : 1);
    PetscReal      *g = m->grad + (c * m->nq + q) * nb * nd, *phi = m->phi + q * nb, dphi[2 * 9];
    PetscReal       t[2][3] = {{0}}, x[3] = {0}, J[4], normal[3], area;

    if (nd == 2) ElementBasis(2, xi, phi, dphi);
    else ElementLine(xi[0], phi, dphi);
    for (PetscInt i = 0; i < nb * dim; i++) {
      const PetscReal at = m->X[dim * m->cell_node[c * nb + i / dim] + i % dim];

      x[i % dim] += phi[i / dim] * at;
      for (PetscInt e = 0; e < nd; e++) t[e][i % dim] += dphi[e * nb + i / dim] * at;
    }
    make_frame(nd, t, J, normal);
    area                     = J[0] * J[3];
    m->weight[c * m->nq + q] = weight * area;
    m->volume += weight * dot3(x, normal) / (PetscReal)dim;
    size += weight * area;
    m->area += weight * area;
    for (PetscInt j = 0; j < nb; j++) { /* J^T g = dphi, J upper triangular */
      g[nd * j] = dphi[j] / J[0];
      if (nd == 2) g[nd * j + 1] = (dphi[nb + j] - J[1] * g[nd * j]) / J[3];
    }
  }
  *largest = PetscMax(*largest, size);
}

PetscErrorCode SolidMeshCreateMembrane(Shape shape, const char name[], PetscInt dim, const PetscInt cells[],
                                       PetscReal size, SolidMesh *m)
{
  PetscReal lower[3] = {0}, upper[3] = {0}, length[3], largest = 0;
  PetscInt  n[3] = {0};
  Figure    f;

  PetscFunctionBeginUser;
  PetscCall(FigureDescribe(shape, dim, &f));
  PetscCall(FigureFindBox(&f, dim, lower, upper));
  for (PetscInt d = 0; d < dim; d++) length[d] = upper[d] - lower[d];
  count_cells(dim, length, cells, size, n);
  if (dim == 2) PetscCall(create_curve(shape, n, m));
  else PetscCall(create_surface(&f, name, n, lower, upper, m));
  for (PetscInt i = 0; i < dim * m->nnode; i++) m->X[i] -= f.centre[0][i % dim];
  m->nside   = m->ncell; /* all of it is surface */
  m->nb_side = m->nb;
  PetscCall(PetscMalloc1(m->nb * m->ncell, &m->side));
  PetscCall(PetscArraycpy(m->side, m->cell_node, m->ncell * m->nb));
  for (PetscInt c = 0; c < m->ncell; c++) measure_cell(m, c, &largest);
  PetscCall(SolidMeshFindNeighbours(m));
  PetscCall(BendingCreate(m));
  m->h = dim == 2 ? largest : PetscSqrtReal(largest);
  SolidMeshFindRadius(m);
  PetscFunctionReturn(PETSC_SUCCESS);
}
