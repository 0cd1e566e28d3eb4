/* Mesh: construction, distribution and numbering of the Q2 nodes (see mesh.h).

   A DMPlex of quadrilaterals or hexahedra (kind.h) is distributed, refined, and given one layer of ghost cells. Every
   mesh point then gets one node, numbered in the order in which the cells (in cache-friendly order) touch them:
   neighbours in space are neighbours in memory. Lengths are in the unit of the scene. Refined boxes (-mesh_levels),
   boxes on one rank, and large ones on many, which one rank should not have to hold, come from refined.c instead. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"
#include "base/array.h"
#include "base/rowtype.h"
#include "partition.h"
#include "tree/refined.h"

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
    PetscCall(MeshCellLattice(m->dm, m->loc.dim, order[c], m->cell_node + c * m->loc.nb, vertex + (c << m->loc.dim)));
  PetscCall(MeshNumberNodes(m, ghost, pEnd, number));
  PetscCall(MeshNumberGlobally(m, pEnd, order, number));
  PetscCall(MeshSetCoordinates(m, order, vertex));
  PetscCall(PetscFree(vertex));
  PetscCall(collect_boundary_nodes(m, number));
  PetscCall(PetscFree2(order, number));
  PetscCall(PetscFree(ghost));
  PetscCall(DMDestroy(&m->dm)); /* all that is needed of it stands in the mesh now */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* To be made without a DMPlex? Not if options ask for what one can do. */
static PetscErrorCode is_bare_box(Mesh m, PetscBool *bare)
{
  const char *const other[] = {"-petscpartitioner_type", "-dm_refine", "-mesh_order"};
  PetscMPIInt       size;
  PetscReal         n;
  PetscBool         given = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(m->comm, &size));
  PetscCall(MeshKindGetBoxCells(m->kind, &n));
  for (size_t i = 0; i < sizeof(other) / sizeof(other[0]) && !given; i++)
    PetscCall(PetscOptionsHasName(NULL, NULL, other[i], &given));
  *bare = (PetscBool)(n >= (size > 1 ? LARGE_BOX : 1) && !given);
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
static PetscErrorCode complete_mesh(Mesh m)
{
  PetscFunctionBeginUser;
  /* the largest of what a rank has by its cells (flow/assemble.c) */
  PetscCall(
    ArrayCheckSize(m->comm, "matrices of cells", (PetscReal)m->loc.ncell_all * (PetscReal)(m->loc.nb * m->loc.nb)));
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
  PetscBool around, bare = PETSC_FALSE;
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
    PetscCall(is_bare_box(m, &bare));
    if (bare) PetscCall(LeavesCreateEqual(comm, m->kind, &leaves));
  }
  if (levels || bare) PetscCall(RefinedBuild(m, &leaves));
  else PetscCall(build_plain(m));
  PetscCall(complete_mesh(m));
  *mesh = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCreateOf(MPI_Comm comm, const PetscInt cells[3], PetscInt levels, PetscInt64 total,
                            const Leaf leaf[], Mesh *mesh)
{
  Mesh   m;
  Leaves leaves;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&m));
  m->comm = comm;
  PetscCall(MeshKindReadBox(comm, &m->kind));
  PetscCall(MeshKindSetCells(m->kind, cells));
  PetscCall(LeavesCreateFromList(comm, m->kind, levels, total, leaf, &leaves));
  PetscCall(RefinedBuild(m, &leaves));
  PetscCall(complete_mesh(m));
  *mesh = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCreate(MPI_Comm comm, Mesh *mesh)
{
  PetscFunctionBeginUser;
  PetscCall(MeshCreateAround(comm, NULL, mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCreateBox(MPI_Comm comm, PetscInt dim, const PetscInt cells[], const PetscReal lower[],
                             const PetscReal upper[], Mesh *mesh)
{
  Mesh   m;
  Leaves leaves;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&m));
  m->comm = comm;
  PetscCall(MeshKindCreateBox(comm, dim, cells, lower, upper, &m->kind));
  PetscCall(LeavesCreateEqual(comm, m->kind, &leaves));
  PetscCall(RefinedBuild(m, &leaves));
  PetscCall(complete_mesh(m));
  *mesh = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshDestroy(Mesh *mesh)
{
  Mesh m = *mesh;

  PetscFunctionBeginUser;
  if (!m) PetscFunctionReturn(PETSC_SUCCESS);
  for (int bs = 0; bs < MESH_MAX_BLOCK; bs++) PetscCall(RowTypeDestroy(&m->block[bs]));
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

PetscErrorCode MeshFindBoundary(Mesh m, const char name[], PetscInt *b)
{
  PetscFunctionBeginUser;
  *b = -1;
  for (PetscInt i = 0; i < m->nboundary; i++) {
    PetscBool same;

    PetscCall(PetscStrcmp(name, m->boundary_name[i], &same));
    if (same) *b = i;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshGetBoundaryNodes(Mesh m, PetscInt b, PetscInt *n, const PetscInt *nodes[])
{
  PetscFunctionBeginUser;
  *n     = m->boundary_count[b];
  *nodes = m->boundary_node[b];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshGetBoundarySides(Mesh m, PetscInt b, PetscInt *sides)
{
  const MeshLocal *l = &m->loc;

  PetscFunctionBeginUser;
  *sides = (1 << 2 * l->dim) - 1;
  for (PetscInt i = 0; i < m->boundary_count[b]; i++)
    for (PetscInt a = 0; a < l->dim; a++) {
      const PetscReal x         = l->x_start[l->dim * m->boundary_node[b][i] + a],
                      tolerance = 1e-10 * (l->upper[a] - l->lower[a]);

      if (PetscAbsReal(x - l->lower[a]) > tolerance) *sides &= ~(1 << 2 * a);
      if (PetscAbsReal(x - l->upper[a]) > tolerance) *sides &= ~(2 << 2 * a);
    }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sides, 1, MPIU_INT, MPI_BAND, m->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshSlotCoordinates(Mesh m, PetscInt c, PetscReal xc[])
{
  const MeshLocal *l   = &m->loc;
  const PetscInt   dim = l->dim, *node = m->cell_node + c * l->nb;
  const PetscReal *centre = m->x + node[l->nb / 2] * dim;

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < l->nb; j++)
    for (PetscInt d = 0; d < dim; d++)
      xc[j * dim + d] = DomainNearest(l->period[d], m->x[node[j] * dim + d], centre[d]);
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
    MeshMeasureCell(l->dim, xc, &smallest, &volume);
    hmin = PetscMin(hmin, PetscPowReal(volume, 1.0 / l->dim));
  }
  PetscCallMPI(MPI_Allreduce(&hmin, &l->h, 1, MPIU_REAL, MPIU_MIN, m->comm));
  PetscCall(MeshDestroyBins(m));
  PetscCall(MeshCreateBins(m));
  PetscFunctionReturn(PETSC_SUCCESS);
}
