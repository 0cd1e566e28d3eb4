/* Cubed: see cubed.h. Vertices of a cube have the numbers of a lattice of (n + 1)^3, of which a layer uses the
   surface. */
#include "compat.h"
#include "cubed.h"
#include "celllist.h"

static PetscInt lattice(PetscInt n, const PetscInt at[3])
{
  return (at[2] * (n + 1) + at[1]) * (n + 1) + at[0];
}

/* The vertices of a cube of half-width s: id [(n + 1)^3], -1 inside unless `filled` */
static PetscErrorCode add_cube(CellList *l, PetscInt n, PetscReal s, PetscBool filled, PetscInt id[])
{
  PetscInt at[3];

  PetscFunctionBeginUser;
  for (at[2] = 0; at[2] <= n; at[2]++) {
    for (at[1] = 0; at[1] <= n; at[1]++) {
      for (at[0] = 0; at[0] <= n; at[0]++) {
        PetscBool inside = PETSC_TRUE;
        PetscReal x[3];

        for (PetscInt d = 0; d < 3; d++) {
          inside = (PetscBool)(inside && at[d] > 0 && at[d] < n);
          x[d]   = s * (-1 + 2.0 * at[d] / n);
        }
        id[lattice(n, at)] = -1;
        if (filled || !inside) PetscCall(CellListAddVertex(l, x, &id[lattice(n, at)]));
      }
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells from the squares of side `side` = 0, 1 along an axis of one cube to those of the next */
static PetscErrorCode add_block(CellList *l, PetscInt n, PetscInt axis, PetscInt side, const PetscInt in[],
                                const PetscInt out[])
{
  /* counter-clockwise, seen from outside */
  const PetscInt corner[2][4][2] = {{{0, 0}, {0, 1}, {1, 1}, {1, 0}}, {{0, 0}, {1, 0}, {1, 1}, {0, 1}}};

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < n; j++) {
    for (PetscInt i = 0; i < n; i++) {
      PetscInt vertex[8], at[3];

      at[axis] = side * n;
      for (PetscInt v = 0; v < 4; v++) {
        at[(axis + 1) % 3] = i + corner[side][v][0];
        at[(axis + 2) % 3] = j + corner[side][v][1];
        vertex[v]          = in[lattice(n, at)];
        vertex[4 + v]      = out[lattice(n, at)];
      }
      PetscCall(CellListAddCell(l, vertex));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_middle(CellList *l, PetscInt n, const PetscInt id[])
{
  const PetscInt corner[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < n * n * n; c++) {
    PetscInt vertex[8];

    for (PetscInt v = 0; v < 8; v++)
      vertex[v] = id[lattice(n, (const PetscInt[]){c % n + corner[v % 4][0], c / n % n + corner[v % 4][1],
                                                   c / n / n + v / 4})];
    PetscCall(CellListAddCell(l, vertex));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode list_cells(const Cubed *g, const MeshMap *map, CellList *l)
{
  const PetscInt n = g->n, cube = (n + 1) * (n + 1) * (n + 1), surface = 6 * n * n + 2;
  PetscInt      *in, *out;

  PetscFunctionBeginUser;
  PetscCall(CellListCreate(3, (g->middle ? cube : surface) + g->nring * surface,
                           (g->middle ? n * n * n : 0) + 6 * n * n * g->nring, l));
  PetscCall(PetscMalloc2(cube, &in, cube, &out));
  PetscCall(add_cube(l, n, map->inner, g->middle, in));
  if (g->middle) PetscCall(add_middle(l, n, in));
  for (PetscInt k = 1; k <= g->nring; k++) {
    PetscCall(add_cube(l, n, map->inner + (map->outer - map->inner) * k / g->nring, PETSC_FALSE, out));
    for (PetscInt b = 0; b < 6; b++) PetscCall(add_block(l, n, b / 2, b % 2, in, out));
    PetscCall(PetscArraycpy(in, out, cube));
  }
  PetscCall(PetscFree2(in, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CubedCreate(MPI_Comm comm, const Cubed *g, const MeshMap *map, DM *dm)
{
  CellList    l = {0};
  PetscMPIInt rank;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  if (rank == 0) PetscCall(list_cells(g, map, &l));
  PetscCall(CellListCreateDM(comm, 3, &l, 0, dm));
  PetscCall(CellListClear(&l));
  PetscFunctionReturn(PETSC_SUCCESS);
}
