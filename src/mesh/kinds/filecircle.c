/* Mesh files: boundaries that are polygons in the file and circles in truth (-mesh_round_<boundary>,
   see kindimpl.h). */
#include "compat.h"
#include "kindimpl.h"

/* Move the vertices of the faces of a label onto the circle; worst: largest distance from it before, over its radius;
   n: number of faces */
static PetscErrorCode move_to_circle(DM dm, DMLabel label, const PetscReal circle[3], PetscReal *worst, PetscInt *n)
{
  PetscInt     fStart, fEnd;
  PetscSection section;
  Vec          coordinates;
  PetscScalar *x;

  PetscFunctionBeginUser;
  PetscCall(DMPlexGetHeightStratum(dm, 1, &fStart, &fEnd));
  PetscCall(DMGetCoordinateSection(dm, &section));
  PetscCall(DMGetCoordinatesLocal(dm, &coordinates));
  PetscCall(VecGetArray(coordinates, &x));
  for (PetscInt f = fStart; f < fEnd; f++) {
    const PetscInt *vertex;
    PetscInt        value, offset;

    PetscCall(DMLabelGetValue(label, f, &value));
    if (value < 0) continue;
    (*n)++;
    PetscCall(DMPlexGetCone(dm, f, &vertex));
    for (PetscInt i = 0; i < 2; i++) {
      PetscReal r;

      PetscCall(PetscSectionGetOffset(section, vertex[i], &offset));
      r      = PetscSqrtReal(PetscSqr(x[offset] - circle[0]) + PetscSqr(x[offset + 1] - circle[1]));
      *worst = PetscMax(*worst, PetscAbsReal(r / circle[2] - 1));
      for (PetscInt d = 0; d < 2 && r > 0; d++) x[offset + d] = circle[d] + (x[offset + d] - circle[d]) * circle[2] / r;
    }
  }
  PetscCall(VecRestoreArray(coordinates, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The cells at the faces of a label, each turned so that its first edge is the face: appended to bent */
static PetscErrorCode bend_cells(DM dm, DMLabel label, const PetscReal circle[3], MeshMapBent bent[])
{
  PetscInt fStart, fEnd, n = 0;

  PetscFunctionBeginUser;
  PetscCall(DMPlexGetHeightStratum(dm, 1, &fStart, &fEnd));
  for (PetscInt f = fStart; f < fEnd; f++) {
    const PetscInt    *cell, *edge;
    PetscInt           value, ncoordinate, first = 0;
    PetscBool          dg;
    const PetscScalar *array;
    PetscScalar       *x = NULL;

    PetscCall(DMLabelGetValue(label, f, &value));
    if (value < 0) continue;
    PetscCall(DMPlexGetSupport(dm, f, &cell));
    PetscCall(DMPlexGetCone(dm, cell[0], &edge));
    while (first < 3 && edge[first] != f) first++;
    PetscCall(DMPlexGetCellCoordinates(dm, cell[0], &dg, &ncoordinate, &array, &x));
    PetscCheck(ncoordinate == 8, PETSC_COMM_SELF, PETSC_ERR_SUP,
               "A mesh cell has %" PetscInt_FMT
               " coordinates instead of 8: save the mesh as quadrilaterals of first order",
               ncoordinate);
    for (PetscInt i = 0; i < 4; i++)
      for (PetscInt d = 0; d < 2; d++) bent[n].corner[i][d] = x[2 * ((first + i) % 4) + d];
    PetscCall(DMPlexRestoreCellCoordinates(dm, cell[0], &dg, &ncoordinate, &array, &x));
    MeshMapBend(&bent[n++], circle, circle[2]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindMakeRound(MeshKind k, DM dm, const char name[], const PetscReal circle[3])
{
  PetscReal   worst = 0;
  PetscInt    n     = 0;
  DMLabel     label;
  PetscMPIInt rank, bytes;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(k->comm, &rank));
  PetscCall(DMGetLabel(dm, name, &label));
  if (rank == 0) PetscCall(move_to_circle(dm, label, circle, &worst, &n));
  PetscCallMPI(MPI_Bcast(&worst, 1, MPIU_REAL, 0, k->comm));
  PetscCallMPI(MPI_Bcast(&n, 1, MPIU_INT, 0, k->comm));
  PetscCheck(worst < 0.05, k->comm, PETSC_ERR_USER_INPUT,
             "A vertex of boundary '%s' of '%s' is %g radii off the circle with centre (%g, %g) and radius %g: correct -mesh_round_%s",
             name, k->file, (double)worst, (double)circle[0], (double)circle[1], (double)circle[2], name);
  PetscCall(PetscRealloc(sizeof(MeshMapBent) * (k->map.nbent + n), &k->map.bent));
  if (rank == 0) PetscCall(bend_cells(dm, label, circle, k->map.bent + k->map.nbent));
  PetscCall(PetscMPIIntCast(sizeof(MeshMapBent) * n, &bytes));
  PetscCallMPI(MPI_Bcast(k->map.bent + k->map.nbent, bytes, MPI_BYTE, 0, k->comm));
  k->map.nbent += n;
  k->map.type = MESHMAP_ROUND;
  PetscFunctionReturn(PETSC_SUCCESS);
}
