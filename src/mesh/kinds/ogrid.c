/* Ogrid: lists of cells in index coordinates, where every cell is a unit square or a trapezoid (see ogrid.h). */
#include "compat.h"
#include "ogrid.h"
#include "celllist.h"

/* Unit squares with corners (i, j) + origin, but for the n x n cells of a hole from line hole[0], hole[1] on (n = 0:
   none). vertex [(nx + 1)(ny + 1)], -1 in the hole */
static PetscErrorCode add_squares(CellList *l, PetscInt nx, PetscInt ny, PetscReal origin, const PetscInt hole[2],
                                  PetscInt n, PetscInt vertex[])
{
  const PetscInt row = nx + 1;

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j <= ny; j++) {
    for (PetscInt i = 0; i <= nx; i++) {
      const PetscBool out = (PetscBool)(i > hole[0] && i < hole[0] + n && j > hole[1] && j < hole[1] + n);

      vertex[j * row + i] = -1;
      if (!out) PetscCall(CellListAddVertex(l, (const PetscReal[]){origin + i, origin + j}, &vertex[j * row + i]));
    }
  }
  for (PetscInt j = 0; j < ny; j++) {
    for (PetscInt i = 0; i < nx; i++) {
      const PetscInt *v = vertex + j * row + i;

      if (i >= hole[0] && i < hole[0] + n && j >= hole[1] && j < hole[1] + n) continue;
      PetscCall(CellListAddCell(l, (const PetscInt[]){v[0], v[1], v[row + 1], v[row]}));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Number of vertex p = 0..4n-1 around an n x n block of squares, counter-clockwise from the lower right corner */
static PetscInt vertex_of_square(const PetscInt vertex[], PetscInt row, PetscInt i0, PetscInt j0, PetscInt n,
                                 PetscInt p)
{
  const PetscInt k = p % n;

  switch (p / n) {
  case 0: return vertex[(j0 + k) * row + i0 + n];
  case 1: return vertex[(j0 + n) * row + i0 + n - k];
  case 2: return vertex[(j0 + n - k) * row + i0];
  default: return vertex[j0 * row + i0 + k];
  }
}

/* The vertices of a square ring of half-width s, in the order of vertex_of_square */
static PetscErrorCode add_ring(CellList *l, const PetscReal middle[2], PetscReal s, PetscInt n, PetscInt ring[])
{
  PetscFunctionBeginUser;
  for (PetscInt p = 0; p < 4 * n; p++) {
    const PetscReal t       = -1 + 2.0 * (p % n) / n;
    const PetscReal q[4][2] = {{1, t}, {-t, 1}, {-1, -t}, {t, -1}};

    PetscCall(
      CellListAddVertex(l, (const PetscReal[]){middle[0] + s * q[p / n][0], middle[1] + s * q[p / n][1]}, &ring[p]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode join_rings(CellList *l, PetscInt n, const PetscInt in[], const PetscInt out[])
{
  PetscFunctionBeginUser;
  for (PetscInt p = 0; p < 4 * n; p++) {
    const PetscInt next = (p + 1) % (4 * n);

    PetscCall(CellListAddCell(l, (const PetscInt[]){in[p], out[p], out[next], in[next]}));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Layers of cells from half-width map.inner to map.outer. first and last [4n] are the vertices there; NULL: new ones */
static PetscErrorCode add_rings(CellList *l, const MeshMap *map, PetscInt n, PetscInt nring, const PetscInt first[],
                                const PetscInt last[])
{
  PetscInt *in, *out;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(4 * n, &in, 4 * n, &out));
  if (first) PetscCall(PetscArraycpy(in, first, 4 * n));
  else PetscCall(add_ring(l, map->middle, map->inner, n, in));
  for (PetscInt k = 1; k <= nring; k++) {
    if (k == nring && last) PetscCall(PetscArraycpy(out, last, 4 * n));
    else PetscCall(add_ring(l, map->middle, map->inner + (map->outer - map->inner) * k / nring, n, out));
    PetscCall(join_rings(l, n, in, out));
    PetscCall(PetscArraycpy(in, out, 4 * n));
  }
  PetscCall(PetscFree2(in, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode list_cells(const OGrid *g, const MeshMap *map, CellList *l)
{
  const PetscInt n = g->n, nx = g->nsquare[0], ny = g->nsquare[1], nvertex = nx ? (nx + 1) * (ny + 1) : 0;
  PetscInt      *vertex, *rim;

  PetscFunctionBeginUser;
  PetscCall(CellListCreate(2, nvertex + 4 * n * (g->nring + 1), nx * ny + 4 * n * g->nring, l));
  PetscCall(PetscMalloc2(nvertex, &vertex, 4 * n, &rim));
  if (nx) {
    PetscCall(add_squares(l, nx, ny, g->middle ? -0.5 * n : 0, g->block, g->middle ? 0 : n, vertex));
    for (PetscInt p = 0; p < 4 * n; p++) rim[p] = vertex_of_square(vertex, nx + 1, g->block[0], g->block[1], n, p);
  }
  PetscCall(add_rings(l, map, n, g->nring, nx && g->middle ? rim : NULL, nx && !g->middle ? rim : NULL));
  PetscCall(PetscFree2(vertex, rim));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OGridCreate(MPI_Comm comm, const OGrid *g, const MeshMap *map, DM *dm)
{
  CellList    plane = {0}, solid = {0};
  PetscMPIInt rank;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  if (rank == 0) PetscCall(list_cells(g, map, &plane));
  if (rank == 0 && g->nlayer) PetscCall(CellListExtrude(&plane, g->nlayer, g->periodic, &solid));
  if (g->nlayer) PetscCall(CellListCreateDM(comm, 3, &solid, g->periodic ? (PetscReal)g->nlayer : 0, dm));
  else PetscCall(CellListCreateDM(comm, 2, &plane, 0, dm));
  PetscCall(CellListClear(&plane));
  PetscCall(CellListClear(&solid));
  PetscFunctionReturn(PETSC_SUCCESS);
}
