/* Mesh: construction, distribution and numbering of the Q2 nodes (see mesh.h).

   A DMPlex of quadrilaterals or hexahedra (kind.h) is distributed, refined, and given one layer of ghost cells. Every
   mesh point then gets one node, numbered in the order in which the cells (in cache-friendly order) touch them:
   neighbours in space are neighbours in memory. Lengths are in the unit of the scene. Refined boxes (-mesh_levels), and
   large ones on many ranks, which one rank should not have to hold, come from refined.c instead. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"
#include "partition.h"
#include "refined.h"

#define LARGE_BOX 2e5 /* cells; on many ranks such a box is made distributed, smaller ones are cut better by METIS */

/* ---- the DMPlex ---- */

static PetscErrorCode create_dm(Mesh m)
{
  DM overlap;

  PetscFunctionBeginUser;
  PetscCall(MeshKindBuild(m->kind, &m->dm));
  PetscCall(MeshKindGetBoundaries(m->kind, &m->nboundary, &m->boundary_name));
  PetscCall(PetscCalloc2(m->nboundary, &m->boundary_node, m->nboundary, &m->boundary_count));
  PetscCall(DMSetBasicAdjacency(m->dm, PETSC_FALSE, PETSC_TRUE)); /* ghost cells: all that share a vertex */
  PetscCall(PartitionPrepare(m->dm));
  PetscCall(DMSetFromOptions(m->dm));
  PetscCall(PartitionCheck(m->dm));
  PetscCall(DMPlexDistributeOverlap(m->dm, 1, NULL, &overlap));
  if (overlap) {
    PetscCall(DMDestroy(&m->dm));
    m->dm = overlap;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- cells ---- */

/* Lattice corner (0 or 2 along each axis) of vertex v in the closure of a PETSc quadrilateral or hexahedron */
static void corner_position(PetscInt dim, PetscInt v, PetscInt pos[3])
{
  static const PetscInt quad[4][3] = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
  static const PetscInt hex[8][3]  = {{0, 0, 0}, {0, 2, 0}, {2, 2, 0}, {2, 0, 0}, {0, 0, 2}, {2, 0, 2}, {2, 2, 2}, {0, 2, 2}};

  for (PetscInt d = 0; d < 3; d++) pos[d] = dim == 2 ? quad[v][d] : hex[v][d];
}

/* pos += lattice positions of the vertices below point p, each as often as paths lead to it (equally often), *count of
   them; vertex [nv] of the cell in the order of corner_position */
static PetscErrorCode add_corners(DM dm, PetscInt dim, PetscInt p, PetscInt nv, const PetscInt vertex[], PetscInt pos[3], PetscInt *count)
{
  const PetscInt *cone;
  PetscInt        n, corner[3], v = 0;

  PetscFunctionBeginUser;
  while (v < nv && vertex[v] != p) v++;
  if (v < nv) {
    corner_position(dim, v, corner);
    for (PetscInt d = 0; d < 3; d++) pos[d] += corner[d];
    *count += 1;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(DMPlexGetConeSize(dm, p, &n));
  PetscCall(DMPlexGetCone(dm, p, &cone));
  for (PetscInt i = 0; i < n; i++) PetscCall(add_corners(dm, dim, cone[i], nv, vertex, pos, count));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Points of the closure of cell c by lattice position, the mean of that of their vertices: point [nb]; vertex [2^dim] in
   the order of corner_position */
static PetscErrorCode cell_lattice(DM dm, PetscInt dim, PetscInt c, PetscInt point[], PetscInt vertex[])
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
             "Cell %" PetscInt_FMT " has %" PetscInt_FMT " vertices: the mesh must consist of quadrilaterals (2D) or hexahedra (3D)", c, nv);
  for (PetscInt i = 0; i < n; i++) {
    PetscInt count = 0, pos[3] = {0, 0, 0};

    PetscCall(add_corners(dm, dim, closure[2 * i], nv, vertex, pos, &count));
    point[pos[0] / count + 3 * (pos[1] / count) + 9 * (pos[2] / count)] = closure[2 * i];
  }
  PetscCall(DMPlexRestoreTransitiveClosure(dm, c, PETSC_TRUE, &n, &closure));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mark the points that another rank owns: ghost [pEnd]. */
static PetscErrorCode find_ghost_points(DM dm, PetscInt pEnd, PetscBool **ghost)
{
  PetscSF         sf;
  PetscInt        nleaf;
  const PetscInt *leaf;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(pEnd, ghost));
  PetscCall(DMGetPointSF(dm, &sf));
  PetscCall(PetscSFGetGraph(sf, NULL, &nleaf, &leaf, NULL));
  for (PetscInt i = 0; i < nleaf; i++) (*ghost)[leaf ? leaf[i] : i] = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own cells first (in cache-friendly order), then ghost cells: order [ncell_all] of plex cells. */
static PetscErrorCode order_cells(Mesh m, const PetscBool ghost[], PetscInt order[])
{
  const char *const choices[] = {"natural", "rcm", NULL};
  PetscInt          choice = 0, cStart, cEnd, own = 0, other = 0, *seq;

  PetscFunctionBeginUser;
  PetscCall(OptChoice("-mesh_order", choices, &choice));
  PetscCall(DMPlexGetHeightStratum(m->dm, 0, &cStart, &cEnd));
  PetscCall(PetscMalloc1(cEnd - cStart, &seq));
  for (PetscInt c = cStart; c < cEnd; c++) seq[c - cStart] = c;
  if (choice == 1 && cEnd > cStart) {
    IS              perm;
    const PetscInt *p;

    PetscCall(DMPlexGetOrdering(m->dm, MATORDERINGRCM, NULL, &perm));
    PetscCall(ISGetIndices(perm, &p));
    for (PetscInt c = cStart; c < cEnd; c++) seq[p[c] - cStart] = c;
    PetscCall(ISRestoreIndices(perm, &p));
    PetscCall(ISDestroy(&perm));
  }
  for (PetscInt i = 0; i < cEnd - cStart; i++) m->loc.ncell += !ghost[seq[i]];
  for (PetscInt i = 0; i < cEnd - cStart; i++) order[ghost[seq[i]] ? m->loc.ncell + other++ : own++] = seq[i];
  m->loc.ncell_all = cEnd - cStart;
  PetscCall(PetscFree(seq));
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

    corner_position(dim, v, corner);
    for (PetscInt d = 0; d < dim; d++) weight *= corner[d] == 2 ? 0.5 * lattice[d] : 1 - 0.5 * lattice[d];
    for (PetscInt d = 0; d < dim; d++) q[d] += weight * qv[v * dim + d];
  }
}

/* Jacobian determinant on [0,1]^dim of the Q2 map of a cell at its corner (0 or 2 along each axis). xc [nb][dim] */
static PetscReal corner_jacobian(PetscInt dim, const PetscReal xc[], const PetscInt corner[3])
{
  const PetscInt stride[3] = {1, 3, 9};
  PetscReal      e[3][3];
  PetscInt       at = 0;

  for (PetscInt k = 0; k < dim; k++) at += corner[k] * stride[k];
  for (PetscInt k = 0; k < dim; k++) {
    const PetscInt step = corner[k] ? -stride[k] : stride[k];

    for (PetscInt d = 0; d < dim; d++)
      e[k][d] = (corner[k] ? -1 : 1) * (4 * xc[(at + step) * dim + d] - 3 * xc[at * dim + d] - xc[(at + 2 * step) * dim + d]);
  }
  if (dim == 2) return e[0][0] * e[1][1] - e[0][1] * e[1][0];
  return e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) - e[0][1] * (e[1][0] * e[2][2] - e[1][2] * e[2][0]) +
         e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
}

/* Smallest Jacobian over the corners, and a size: their mean (the volume where the edges are straight in 2D or the cell
   a parallelepiped) */
static void measure_cell(PetscInt dim, const PetscReal xc[], PetscReal *smallest, PetscReal *volume)
{
  *smallest = PETSC_MAX_REAL;
  *volume   = 0;
  for (PetscInt v = 0; v < 1 << dim; v++) {
    PetscInt  corner[3];
    PetscReal J;

    corner_position(dim, v, corner);
    J         = corner_jacobian(dim, xc, corner);
    *smallest = PetscMin(*smallest, J);
    *volume += J / (1 << dim);
  }
}

/* Coordinates of vertices; section NULL: only by cells, as in periodic meshes, or not of vertices alone */
typedef struct {
  PetscSection       section;
  const PetscScalar *x;
  Vec                v;
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

/* Q2 nodes of a cell, which is `point` in the DM, with its vertices: xc [nb][dim], not unwrapped into the period */
static PetscErrorCode place_cell_nodes(Mesh m, const Corners *k, PetscInt point, const PetscInt vertex[], PetscReal xc[])
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
               "A mesh cell has %" PetscInt_FMT " coordinates instead of %" PetscInt_FMT ": save the mesh with first-order elements", n, dim << dim);
  }
  for (PetscInt j = 0; j < m->loc.nb; j++) {
    PetscReal q[3];

    interpolate_corners(dim, qv ? qv : near, j, q);
    PetscCall(MeshKindEvaluate(m->kind, q, xc + j * dim));
  }
  if (!k->section) PetscCall(DMPlexRestoreCellCoordinates(m->dm, point, &dg, &n, &array, &qv));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_coordinates(Mesh m, const PetscInt order[], const PetscInt vertex[])
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
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xc[MESH_MAX_NB * 3], smallest, volume;

    PetscCall(place_cell_nodes(m, &corners, order[c], vertex + (c << dim), xc));
    measure_cell(dim, xc, &smallest, &volume);
    PetscCheck(smallest > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Mesh cell %" PetscInt_FMT " near (%g, %g) is inverted or flat (Jacobian %g at a corner): repair the mesh", c, (double)xc[0],
               (double)xc[1], (double)smallest);
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
  PetscCallMPI(MPI_Allreduce(&hmin, &l->h, 1, MPIU_REAL, MPIU_MIN, PETSC_COMM_WORLD));
  PetscCallMPI(MPI_Allreduce(lower, l->lower, 3, MPIU_REAL, MPIU_MIN, PETSC_COMM_WORLD));
  PetscCallMPI(MPI_Allreduce(upper, l->upper, 3, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  PetscCall(MeshKindPlaceVertices(m->kind, m->dm));
  PetscCall(DMViewFromOptions(m->dm, NULL, "-dm_view"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- boundaries ---- */

static PetscErrorCode collect_boundary_nodes(Mesh m, const PetscInt number[])
{
  MeshLocal *l = &m->loc;
  PetscInt  *bits, fStart, fEnd;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(l->nnode_all, &bits));
  PetscCall(DMPlexGetHeightStratum(m->dm, 1, &fStart, &fEnd));
  for (PetscInt b = 0; b < m->nboundary; b++) {
    DMLabel label;

    PetscCall(DMGetLabel(m->dm, m->boundary_name[b], &label));
    for (PetscInt f = fStart; f < fEnd; f++) {
      PetscInt value, n, *closure = NULL;

      PetscCall(DMLabelGetValue(label, f, &value));
      if (value < 0) continue;
      PetscCall(DMPlexGetTransitiveClosure(m->dm, f, PETSC_TRUE, &n, &closure));
      for (PetscInt i = 0; i < n; i++)
        if (number[closure[2 * i]] >= 0) bits[number[closure[2 * i]]] |= 1 << b;
      PetscCall(DMPlexRestoreTransitiveClosure(m->dm, f, PETSC_TRUE, &n, &closure));
    }
  }
  PetscCall(MeshSyncNodesInt(m, bits)); /* a ghost node may lie on a boundary none of whose faces are here */
  for (PetscInt b = 0; b < m->nboundary; b++) {
    PetscInt n = 0;

    for (PetscInt i = 0; i < l->nnode_all; i++) n += (bits[i] >> b) & 1;
    PetscCall(PetscMalloc1(n, &m->boundary_node[b]));
    for (PetscInt i = 0; i < l->nnode_all; i++)
      if ((bits[i] >> b) & 1) m->boundary_node[b][m->boundary_count[b]++] = i;
  }
  PetscCall(PetscFree(bits));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

/* Of the cells of a DMPlex */
static PetscErrorCode build_plain(Mesh m)
{
  PetscInt   pStart, pEnd, *order, *number, *vertex;
  PetscBool *ghost;

  PetscFunctionBeginUser;
  PetscCall(create_dm(m));
  PetscCall(DMGetDimension(m->dm, &m->loc.dim));
  m->loc.nb = m->loc.dim == 2 ? 9 : 27;
  PetscCall(DMPlexGetChart(m->dm, &pStart, &pEnd));
  PetscCall(find_ghost_points(m->dm, pEnd, &ghost));
  PetscCall(PetscMalloc2(pEnd, &order, pEnd, &number));
  PetscCall(order_cells(m, ghost, order));
  PetscCall(PetscMalloc2(m->loc.ncell_all * m->loc.nb, &m->cell_node, m->loc.ncell_all, &m->cell_global));
  PetscCall(PetscMalloc1(m->loc.ncell_all << m->loc.dim, &vertex));
  for (PetscInt c = 0; c < m->loc.ncell_all; c++)
    PetscCall(cell_lattice(m->dm, m->loc.dim, order[c], m->cell_node + c * m->loc.nb, vertex + (c << m->loc.dim)));
  PetscCall(MeshNumberNodes(m, ghost, pEnd, number));
  PetscCall(MeshNumberGlobally(m, pEnd, order, number));
  PetscCall(set_coordinates(m, order, vertex));
  PetscCall(PetscFree(vertex));
  PetscCall(collect_boundary_nodes(m, number));
  PetscCall(PetscFree2(order, number));
  PetscCall(PetscFree(ghost));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* To be made without rank 0? Not if options ask for what a DMPlex can do. */
static PetscErrorCode is_large_box(Mesh m, PetscBool *large)
{
  const char *const other[] = {"-petscpartitioner_type", "-dm_refine"};
  PetscMPIInt       size;
  PetscReal         n;
  PetscBool         given = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(m->comm, &size));
  PetscCall(MeshKindGetBoxCells(m->kind, &n));
  for (size_t i = 0; i < 2 && !given; i++) PetscCall(PetscOptionsHasName(NULL, NULL, other[i], &given));
  *large = (PetscBool)(size > 1 && n >= LARGE_BOX && !given);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshReadLevels(PetscInt *levels, PetscBool *around)
{
  BoxesNames names;

  PetscFunctionBeginUser;
  *levels = 0;
  *around = PETSC_FALSE;
  PetscCall(OptInt("-mesh_levels", levels));
  if (!*levels) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BoxesReadNames(&names));
  *around = (PetscBool)(names.bodies || names.carried);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshReadBox(MPI_Comm comm, PetscInt *dim, PetscReal lower[3], PetscReal upper[3], PetscReal period[3])
{
  MeshKind k;

  PetscFunctionBeginUser;
  PetscCall(MeshKindReadBox(comm, &k));
  PetscCall(MeshKindGetBox(k, dim, lower, upper, period));
  PetscCall(MeshKindDestroy(&k));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshReadFinest(MPI_Comm comm, PetscReal *h)
{
  MeshKind  k;
  PetscInt  levels;
  PetscBool around;

  PetscFunctionBeginUser;
  PetscCall(MeshReadLevels(&levels, &around));
  PetscCall(MeshKindReadBox(comm, &k));
  PetscCall(MeshKindGetSmallest(k, h));
  PetscCall(MeshKindDestroy(&k));
  *h /= (PetscReal)((PetscInt)1 << levels);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What follows from cells and nodes */
static PetscErrorCode complete(Mesh m)
{
  PetscFunctionBeginUser;
  m->x_start = m->x;
  PetscCall(MeshCreateBins(m));
  m->loc.cell_node     = m->cell_node;
  m->loc.cell_global   = m->cell_global;
  m->loc.node_global   = m->node_global;
  m->loc.node_cell_ptr = m->node_cell_ptr;
  m->loc.node_cell     = m->node_cell;
  m->loc.centre_cell   = m->centre_cell;
  m->loc.x             = m->x;
  m->loc.x_start       = m->x_start;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCreateAround(MPI_Comm comm, const MeshSurface *surface, Mesh *mesh)
{
  Mesh      m;
  PetscInt  levels;
  PetscBool around, large = PETSC_FALSE;
  Leaves    leaves;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&m));
  m->comm = comm;
  PetscCall(MeshReadLevels(&levels, &around));
  if (levels) {
    PetscCall(MeshKindReadBox(comm, &m->kind));
    PetscCall(LeavesCreate(comm, m->kind, levels, surface, &leaves));
  } else {
    PetscCall(MeshKindRead(comm, &m->kind));
    PetscCall(is_large_box(m, &large));
    if (large) PetscCall(LeavesCreateEqual(comm, m->kind, &leaves));
  }
  if (levels || large) PetscCall(RefinedBuild(m, &leaves));
  else PetscCall(build_plain(m));
  PetscCall(complete(m));
  *mesh = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCreateOf(MPI_Comm comm, const PetscInt cells[3], PetscInt levels, PetscInt n, const Leaf leaf[], Mesh *mesh)
{
  Mesh   m;
  Leaves leaves;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&m));
  m->comm = comm;
  PetscCall(MeshKindReadBox(comm, &m->kind));
  PetscCall(MeshKindSetCells(m->kind, cells));
  PetscCall(LeavesCreateFromList(comm, m->kind, levels, n, leaf, &leaves));
  PetscCall(RefinedBuild(m, &leaves));
  PetscCall(complete(m));
  *mesh = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCreate(MPI_Comm comm, Mesh *mesh)
{
  PetscFunctionBeginUser;
  PetscCall(MeshCreateAround(comm, NULL, mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshDestroy(Mesh *mesh)
{
  Mesh m = *mesh;

  PetscFunctionBeginUser;
  if (!m) PetscFunctionReturn(PETSC_SUCCESS);
  for (int bs = 0; bs < MESH_MAX_BLOCK; bs++) PetscCallMPI(MPI_Type_free(&m->block[bs]));
  for (PetscInt b = 0; b < m->nboundary; b++) PetscCall(PetscFree(m->boundary_node[b]));
  PetscCall(PetscFree2(m->boundary_node, m->boundary_count));
  PetscCall(MeshDestroyBins(m));
  PetscCall(PetscFree2(m->cell_node, m->cell_global));
  PetscCall(PetscFree(m->node_global));
  PetscCall(PetscFree(m->node_cell_ptr));
  PetscCall(PetscFree(m->node_cell));
  PetscCall(PetscFree(m->centre_cell));
  if (m->x_start != m->x) PetscCall(PetscFree(m->x_start));
  PetscCall(PetscFree(m->x));
  PetscCall(PetscSFDestroy(&m->node_sf));
  PetscCall(RefinedDestroy(m));
  PetscCall(DMDestroy(&m->dm));
  PetscCall(MeshKindDestroy(&m->kind));
  PetscCall(PetscFree(*mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshView(Mesh m, PetscViewer viewer)
{
  const MeshLocal *l = &m->loc;

  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer,
                                   "mesh: %" PetscInt_FMT "D, %" PetscInt_FMT " cells, %" PetscInt_FMT
                                   " Q2 nodes, smallest cell size %g, box [%g, %g] x [%g, %g]\n",
                                   l->dim, l->ncell_global, l->nnode_global, (double)l->h, (double)l->lower[0], (double)l->upper[0],
                                   (double)l->lower[1], (double)l->upper[1]));
  for (PetscInt i = 0; i <= m->levels && m->level_count; i++) {
    PetscCall(PetscViewerASCIIPrintf(viewer, "%s%" PetscInt_FMT, i ? ", " : "  cells by level: ", m->level_count[i]));
    if (i == m->levels) PetscCall(PetscViewerASCIIPrintf(viewer, "; %" PetscInt_FMT " hanging nodes\n", m->hanging));
  }
  if (m->leaves && m->leaves->boxes.carried)
    PetscCall(PetscViewerASCIIPrintf(viewer, "  fine boxes that go with bodies: %" PetscInt_FMT "\n", m->leaves->boxes.carried));
  PetscCall(PetscViewerASCIIPrintf(viewer, "  boundaries:"));
  for (PetscInt b = 0; b < m->nboundary; b++) PetscCall(PetscViewerASCIIPrintf(viewer, " %s", m->boundary_name[b]));
  for (PetscInt d = 0; d < l->dim; d++)
    if (l->period[d] > 0) PetscCall(PetscViewerASCIIPrintf(viewer, " (periodic %c)", (char)('x' + d)));
  PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshGetLocal(Mesh m, const MeshLocal **loc)
{
  PetscFunctionBeginUser;
  *loc = &m->loc;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshGetComm(Mesh m, MPI_Comm *comm)
{
  PetscFunctionBeginUser;
  *comm = m->comm;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshGetBoundaryCount(Mesh m, PetscInt *n)
{
  PetscFunctionBeginUser;
  *n = m->nboundary;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshGetBoundaryName(Mesh m, PetscInt b, const char **name)
{
  PetscFunctionBeginUser;
  *name = m->boundary_name[b];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshGetBoundaryNodes(Mesh m, PetscInt b, PetscInt *n, const PetscInt *nodes[])
{
  PetscFunctionBeginUser;
  *n     = m->boundary_count[b];
  *nodes = m->boundary_node[b];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshSlotCoordinates(Mesh m, PetscInt c, PetscReal xc[])
{
  const MeshLocal *l   = &m->loc;
  const PetscInt   dim = l->dim, *node = m->cell_node + c * l->nb;
  const PetscReal *centre = m->x + node[l->nb / 2] * dim;

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < l->nb; j++)
    for (PetscInt d = 0; d < dim; d++) xc[j * dim + d] = DomainNearest(l->period[d], m->x[node[j] * dim + d], centre[d]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCellCoordinates(Mesh m, PetscInt c, PetscReal xc[])
{
  PetscFunctionBeginUser;
  PetscCall(MeshSlotCoordinates(m, c, xc));
  MeshCellGather(&m->loc, c, m->loc.dim, xc);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshMoveNodes(Mesh m, PetscInt n, const PetscInt nodes[], const PetscReal x[])
{
  const PetscInt dim = m->loc.dim, size = m->loc.nnode_all * dim;

  PetscFunctionBeginUser;
  if (m->x_start == m->x) {
    PetscCall(PetscMalloc1(size, &m->x_start));
    PetscCall(PetscArraycpy(m->x_start, m->x, size));
    m->loc.x_start = m->x_start;
  }
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt d = 0; d < dim; d++) m->x[nodes[i] * dim + d] = x[i * dim + d];
  m->loc.moves++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshRebase(Mesh m)
{
  MeshLocal *l    = &m->loc;
  PetscReal  hmin = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  if (m->x_start != m->x) PetscCall(PetscFree(m->x_start));
  m->x_start = m->x;
  l->x_start = m->x_start;
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xc[MESH_MAX_NB * 3], smallest, volume;

    PetscCall(MeshCellCoordinates(m, c, xc));
    measure_cell(l->dim, xc, &smallest, &volume);
    hmin = PetscMin(hmin, PetscPowReal(volume, 1.0 / l->dim));
  }
  PetscCallMPI(MPI_Allreduce(&hmin, &l->h, 1, MPIU_REAL, MPIU_MIN, PETSC_COMM_WORLD));
  PetscCall(MeshDestroyBins(m));
  PetscCall(MeshCreateBins(m));
  PetscFunctionReturn(PETSC_SUCCESS);
}
