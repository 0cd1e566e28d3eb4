/* Curved: see curved.h. The number of a cell is written in digits, a label each, since a label with a value for every
   cell would be slow. */
#include "compat.h"
#include "curved.h"
#include "fem/element.h"

#define BASE 256 /* of the digits */

struct _p_Curved {
  MPI_Comm   comm;
  PetscInt   dim, nb, ncell;
  PetscReal *x;    /* [ncell][nb][dim], on rank 0 */
  PetscInt  *slot; /* [cells of the DM] which of those here it came from */
  PetscReal *here; /* [..][nb][dim] */
};

PetscErrorCode CurvedCreate(MPI_Comm comm, PetscInt dim, PetscInt ncell, PetscReal *x, Curved *curved)
{
  Curved c;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  c->comm  = comm;
  c->dim   = dim;
  c->nb    = dim == 2 ? 9 : 27;
  c->ncell = ncell;
  c->x     = x;
  PetscCallMPI(MPI_Bcast(&c->ncell, 1, MPIU_INT, 0, comm));
  *curved = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CurvedDestroy(Curved *c)
{
  PetscFunctionBeginUser;
  if (!*c) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree((*c)->x));
  PetscCall(PetscFree((*c)->slot));
  PetscCall(PetscFree((*c)->here));
  PetscCall(PetscFree(*c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Label of the digits at base^i; FALSE: numbers have no more */
static PetscBool name_label(Curved c, PetscInt i, char name[32])
{
  PetscInt rest = c->ncell - 1;

  for (PetscInt k = 0; k < i; k++) rest /= BASE;
  (void)snprintf(name, 32, "curved cell %" PetscInt_FMT, i);
  return (PetscBool)(rest > 0 || i == 0);
}

PetscErrorCode CurvedMark(Curved c, DM dm)
{
  PetscInt cStart, cEnd, base = 1;
  char     name[32];

  PetscFunctionBeginUser;
  PetscCall(DMPlexGetHeightStratum(dm, 0, &cStart, &cEnd));
  for (PetscInt i = 0; name_label(c, i, name); i++, base *= BASE) {
    DMLabel label;

    PetscCall(DMCreateLabel(dm, name));
    PetscCall(DMGetLabel(dm, name, &label));
    for (PetscInt p = cStart; p < cEnd; p++) PetscCall(DMLabelSetValue(label, p, (p - cStart) / base % BASE));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Number of the cell of the file that each cell of the DM came from: source [cells] */
static PetscErrorCode read_numbers(Curved c, DM dm, PetscInt source[])
{
  PetscInt cStart, cEnd, base = 1;
  char     name[32];

  PetscFunctionBeginUser;
  PetscCall(DMPlexGetHeightStratum(dm, 0, &cStart, &cEnd));
  PetscCall(PetscArrayzero(source, cEnd - cStart));
  for (PetscInt i = 0; name_label(c, i, name); i++, base *= BASE) {
    for (PetscInt digit = 1; digit < BASE; digit++) {
      IS              points;
      PetscInt        n;
      const PetscInt *p;

      PetscCall(DMGetStratumIS(dm, name, digit, &points));
      if (!points) continue;
      PetscCall(ISGetLocalSize(points, &n));
      PetscCall(ISGetIndices(points, &p));
      for (PetscInt k = 0; k < n; k++)
        if (p[k] >= cStart && p[k] < cEnd) source[p[k] - cStart] += digit * base;
      PetscCall(ISRestoreIndices(points, &p));
      PetscCall(ISDestroy(&points));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CurvedFetch(Curved c, DM dm)
{
  PetscInt     cStart, cEnd, n, *wanted;
  PetscMPIInt  rank, width;
  PetscSFNode *root;
  PetscSF      sf;
  MPI_Datatype cell;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(c->comm, &rank));
  PetscCall(DMPlexGetHeightStratum(dm, 0, &cStart, &cEnd));
  n = cEnd - cStart;
  PetscCall(PetscMalloc1(n, &c->slot));
  PetscCall(PetscMalloc1(n, &wanted));
  PetscCall(read_numbers(c, dm, c->slot));
  PetscCall(PetscArraycpy(wanted, c->slot, n));
  PetscCall(PetscSortRemoveDupsInt(&n, wanted));
  for (PetscInt i = 0; i < cEnd - cStart; i++) PetscCall(PetscFindInt(c->slot[i], n, wanted, c->slot + i));
  PetscCall(PetscMalloc1(n, &root));
  for (PetscInt i = 0; i < n; i++) root[i] = (PetscSFNode){.rank = 0, .index = wanted[i]};
  PetscCall(PetscFree(wanted));
  PetscCall(PetscMalloc1(n * c->nb * c->dim, &c->here));
  PetscCall(PetscSFCreate(c->comm, &sf));
  PetscCall(PetscSFSetGraph(sf, rank == 0 ? c->ncell : 0, n, NULL, PETSC_OWN_POINTER, root, PETSC_OWN_POINTER));
  PetscCall(PetscMPIIntCast(c->nb * c->dim, &width));
  PetscCallMPI(MPI_Type_contiguous(width, MPIU_REAL, &cell));
  PetscCallMPI(MPI_Type_commit(&cell));
  PetscCall(PetscSFBcastBegin(sf, cell, c->x, c->here, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(sf, cell, c->x, c->here, MPI_REPLACE));
  PetscCallMPI(MPI_Type_free(&cell));
  PetscCall(PetscSFDestroy(&sf));
  PetscCall(PetscFree(c->x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CurvedFind(Curved c, PetscInt point, const PetscReal q[], PetscReal xi[])
{
  const PetscInt   dim = c->dim, corner[8] = {0, 2, 6, 8, 18, 20, 24, 26};
  const PetscReal *x = c->here + c->slot[point] * c->nb * dim;
  PetscReal        straight[27 * 3];

  PetscFunctionBeginUser;
  for (PetscInt v = 0; v < 1 << dim; v++) {
    PetscBool same = PETSC_TRUE;

    for (PetscInt d = 0; d < dim; d++) same = (PetscBool)(same && x[corner[v] * dim + d] == q[d]);
    for (PetscInt d = 0; d < dim; d++) xi[d] = (v >> d) & 1 ? 1 : -1;
    if (same) PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt j = 0; j < c->nb; j++) {
    const PetscInt at[3] = {j % 3, j / 3 % 3, j / 9};

    for (PetscInt a = 0; a < dim; a++) straight[j * dim + a] = 0;
    for (PetscInt v = 0; v < 1 << dim; v++) {
      PetscReal weight = 1;

      for (PetscInt d = 0; d < dim; d++) weight *= (v >> d) & 1 ? 0.5 * at[d] : 1 - 0.5 * at[d];
      for (PetscInt a = 0; a < dim; a++) straight[j * dim + a] += weight * x[corner[v] * dim + a];
    }
  }
  PetscCheck(ElementLocate(dim, straight, q, xi), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "A bent cell of the mesh file near (%g, %g) is inverted where its edges are straight, and cannot be halved: remove -dm_refine, or repair the mesh",
             (double)q[0], (double)q[1]);
  for (PetscInt d = 0; d < dim; d++) { /* cells are halved: the digits of round-off go */
    const PetscReal near = PetscFloorReal(xi[d] * 4096 + 0.5) / 4096;

    if (PetscAbsReal(near - xi[d]) < 1e-9) xi[d] = near;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

void CurvedEvaluate(Curved c, PetscInt point, const PetscReal xi[], PetscReal x[])
{
  PetscReal J[9];

  ElementMap(c->dim, c->here + c->slot[point] * c->nb * c->dim, xi, x, J);
}
