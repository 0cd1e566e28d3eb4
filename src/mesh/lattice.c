/* Mesh: which points of a DMPlex lie at which lattice positions of a cell, and where they are. */
#include "compat.h"
#include "impl.h"

/* ---- lattice ---- */

/* pos += lattice positions of the vertices below point p, each as often as paths lead to it (equally often), *count of
   them; vertex [nv] of the cell in the order of MeshCornerPosition */
static PetscErrorCode add_corners(DM dm, PetscInt dim, PetscInt p, PetscInt nv, const PetscInt vertex[],
                                  PetscInt pos[3], PetscInt *count)
{
  const PetscInt *cone;
  PetscInt        n, corner[3], v = 0;

  PetscFunctionBeginUser;
  while (v < nv && vertex[v] != p) v++;
  if (v < nv) {
    MeshCornerPosition(dim, v, corner);
    for (PetscInt d = 0; d < 3; d++) pos[d] += corner[d];
    *count += 1;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(DMPlexGetConeSize(dm, p, &n));
  PetscCall(DMPlexGetCone(dm, p, &cone));
  for (PetscInt i = 0; i < n; i++) PetscCall(add_corners(dm, dim, cone[i], nv, vertex, pos, count));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCellLattice(DM dm, PetscInt dim, PetscInt c, PetscInt point[], PetscInt vertex[])
{
  PetscInt *closure = NULL, n, vStart, vEnd, nv = 0;

  PetscFunctionBeginUser;
  PetscCall(DMPlexGetDepthStratum(dm, 0, &vStart, &vEnd));
  PetscCall(DMPlexGetTransitiveClosure(dm, c, PETSC_TRUE, &n, &closure));
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt p = closure[2 * i];

    if (p >= vStart && p < vEnd && nv < 1 << dim) vertex[nv++] = p;
  }
  PetscCheck(nv == 1 << dim && n == (dim == 2 ? 9 : 27), PETSC_COMM_SELF, PETSC_ERR_SUP,
             "Cell %" PetscInt_FMT " has %" PetscInt_FMT
             " vertices: the mesh must consist of quadrilaterals (2D) or hexahedra (3D)",
             c, nv);
  for (PetscInt i = 0; i < n; i++) {
    PetscInt count = 0, pos[3] = {0, 0, 0};

    PetscCall(add_corners(dm, dim, closure[2 * i], nv, vertex, pos, &count));
    point[pos[0] / count + 3 * (pos[1] / count) + 9 * (pos[2] / count)] = closure[2 * i];
  }
  PetscCall(DMPlexRestoreTransitiveClosure(dm, c, PETSC_TRUE, &n, &closure));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- coordinates ---- */

/* Multilinear reference position of lattice point j of a cell with corners qv [2^dim][dim] in closure order */
static void interpolate_corners(PetscInt dim, const PetscReal qv[], PetscInt j, PetscReal q[])
{
  const PetscInt lattice[3] = {j % 3, (j / 3) % 3, j / 9};

  for (PetscInt d = 0; d < dim; d++) q[d] = 0;
  for (PetscInt v = 0; v < 1 << dim; v++) {
    PetscInt  corner[3];
    PetscReal weight = 1;

    MeshCornerPosition(dim, v, corner);
    for (PetscInt d = 0; d < dim; d++) weight *= corner[d] == 2 ? 0.5 * lattice[d] : 1 - 0.5 * lattice[d];
    for (PetscInt d = 0; d < dim; d++) q[d] += weight * qv[v * dim + d];
  }
}

/* Coordinates of vertices; section NULL: only by cells, as in periodic meshes, or not of vertices alone */
typedef struct {
  PetscSection       section;
  const PetscScalar *x;
  Vec                v;
  Curved             curved; /* cells of a file that bend, or NULL */
} Corners;

static PetscErrorCode open_corners(DM dm, PetscInt dim, Corners *k)
{
  PetscInt vStart, vEnd, size;
  Vec      by_cell;

  PetscFunctionBeginUser;
  PetscCall(DMGetCellCoordinatesLocal(dm, &by_cell));
  PetscCall(DMGetCoordinatesLocal(dm, &k->v));
  PetscCall(DMGetCoordinateSection(dm, &k->section));
  PetscCall(DMPlexGetDepthStratum(dm, 0, &vStart, &vEnd));
  PetscCall(PetscSectionGetStorageSize(k->section, &size));
  if (by_cell || size != (vEnd - vStart) * dim) k->section = NULL;
  PetscCall(VecGetArrayRead(k->v, &k->x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same of a bent cell of a file, or of a part of one, with corners qv [2^dim][dim] as if it had straight edges */
static PetscErrorCode place_bent_nodes(Mesh m, Curved curved, PetscInt point, const PetscReal qv[], PetscReal xc[])
{
  const PetscInt dim = m->loc.dim;
  PetscReal      corner[24];

  PetscFunctionBeginUser;
  for (PetscInt v = 0; v < 1 << dim; v++) PetscCall(CurvedFind(curved, point, qv + v * dim, corner + v * dim));
  for (PetscInt j = 0; j < m->loc.nb; j++) {
    PetscReal xi[3];

    interpolate_corners(dim, corner, j, xi);
    CurvedEvaluate(curved, point, xi, xc + j * dim);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Q2 nodes of a cell, which is `point` in the DM, with its vertices: xc [nb][dim], not unwrapped into the period */
static PetscErrorCode place_cell_nodes(Mesh m, const Corners *k, PetscInt point, const PetscInt vertex[],
                                       PetscReal xc[])
{
  const PetscInt     dim = m->loc.dim;
  PetscBool          dg;
  PetscInt           n;
  const PetscScalar *array;
  PetscScalar       *qv = NULL, near[24];

  PetscFunctionBeginUser;
  for (PetscInt v = 0; v < 1 << dim && k->section; v++) {
    PetscInt at;

    PetscCall(PetscSectionGetOffset(k->section, vertex[v], &at));
    for (PetscInt d = 0; d < dim; d++) near[v * dim + d] = k->x[at + d];
  }
  if (!k->section) {
    PetscCall(DMPlexGetCellCoordinates(m->dm, point, &dg, &n, &array, &qv));
    PetscCheck(n == dim << dim, PETSC_COMM_SELF, PETSC_ERR_SUP,
               "A mesh cell has %" PetscInt_FMT " coordinates instead of %" PetscInt_FMT
               ": save the mesh with first-order elements",
               n, dim << dim);
  }
  if (k->curved) PetscCall(place_bent_nodes(m, k->curved, point, qv ? qv : near, xc));
  for (PetscInt j = 0; j < m->loc.nb && !k->curved; j++) {
    PetscReal q[3];

    interpolate_corners(dim, qv ? qv : near, j, q);
    PetscCall(MeshKindEvaluate(m->kind, q, xc + j * dim));
  }
  if (!k->section) PetscCall(DMPlexRestoreCellCoordinates(m->dm, point, &dg, &n, &array, &qv));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshSetCoordinates(Mesh m, const PetscInt order[], const PetscInt vertex[])
{
  MeshLocal       *l   = &m->loc;
  const PetscInt   dim = l->dim;
  Corners          corners;
  const PetscReal *period, *end;
  PetscReal        hmin = PETSC_MAX_REAL, lower[3] = {PETSC_MAX_REAL, PETSC_MAX_REAL, PETSC_MAX_REAL},
            upper[3] = {-PETSC_MAX_REAL, -PETSC_MAX_REAL, -PETSC_MAX_REAL};

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all * dim, &m->x));
  PetscCall(MeshKindGetPeriod(m->kind, &period, &end));
  PetscCall(PetscArraycpy(l->period, period, 3));
  PetscCall(open_corners(m->dm, dim, &corners));
  PetscCall(MeshKindGetCurved(m->kind, &corners.curved));
  if (corners.curved) PetscCall(CurvedFetch(corners.curved, m->dm));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xc[MESH_MAX_NB * 3], smallest, volume;

    PetscCall(place_cell_nodes(m, &corners, order[c], vertex + (c << dim), xc));
    MeshMeasureCell(dim, xc, &smallest, &volume);
    PetscCheck(smallest > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Mesh cell %" PetscInt_FMT
               " near (%g, %g) is inverted or flat (Jacobian %g at a corner): repair the mesh",
               c, (double)xc[0], (double)xc[1], (double)smallest);
    hmin = PetscMin(hmin, PetscPowReal(volume, 1.0 / dim));
    for (PetscInt j = 0; j < l->nb; j++) {
      PetscReal *x = m->x + m->cell_node[c * l->nb + j] * dim;

      for (PetscInt d = 0; d < dim; d++) {
        x[d]     = xc[j * dim + d];
        lower[d] = PetscMin(lower[d], x[d]);
        upper[d] = PetscMax(upper[d], x[d]);
        if (period[d] > 0 && x[d] > end[d] - 1e-9 * period[d]) x[d] -= period[d];
      }
    }
  }
  PetscCall(VecRestoreArrayRead(corners.v, &corners.x));
  if (corners.curved) PetscCall(MeshSyncNodes(m, dim, m->x)); /* the last digit may depend on the cell */
  PetscCallMPI(MPI_Allreduce(&hmin, &l->h, 1, MPIU_REAL, MPIU_MIN, m->comm));
  PetscCallMPI(MPI_Allreduce(lower, l->lower, 3, MPIU_REAL, MPIU_MIN, m->comm));
  PetscCallMPI(MPI_Allreduce(upper, l->upper, 3, MPIU_REAL, MPIU_MAX, m->comm));
  PetscCall(MeshKindPlaceVertices(m->kind, m->dm));
  PetscCall(DMViewFromOptions(m->dm, NULL, "-dm_view"));
  PetscFunctionReturn(PETSC_SUCCESS);
}
