/* Meshkind: options that several kinds read (see kindimpl.h). */
#include "compat.h"
#include "kindimpl.h"
#include "base/opt.h"
#include "mesh/mesh.h"
#include <strings.h>

PetscErrorCode MeshKindReadPeriodic(MeshKind k)
{
  PetscInt n = 3;
  char    *names[3];

  PetscFunctionBeginUser;
  PetscCall(OptStringArray("-mesh_periodic", &n, names));
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt axis = names[i][0] - 'x';

    PetscCheck(axis >= 0 && axis < k->dim && !names[i][1], k->comm, PETSC_ERR_USER_INPUT,
               "Option -mesh_periodic: '%s' is not an axis of a %" PetscInt_FMT "D mesh: use x, y or z", names[i],
               k->dim);
    k->period[axis] = k->upper[axis] - k->lower[axis];
    PetscCall(PetscFree(names[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscInt MeshDefaultResolution(const char kind[])
{
  return !strcasecmp(kind, "channel") ? 10 : !strcasecmp(kind, "fitted") ? 16 : 4;
}

/* Layers of an O-grid in space, from lower to upper along z, and their periodicity; n: as many unless told otherwise */
PetscErrorCode MeshKindReadLayers(MeshKind k, PetscInt n)
{
  PetscReal ratio = 1;

  PetscFunctionBeginUser;
  PetscCall(OptInt("-mesh_layers", &n));
  PetscCall(OptReal("-mesh_layer_ratio", &ratio));
  PetscCall(MeshKindReadPeriodic(k));
  for (PetscInt d = 0; d < 2; d++) {
    PetscCheck(k->period[d] == 0, k->comm, PETSC_ERR_USER_INPUT,
               "-mesh_periodic %c: -mesh_kind %s can be periodic along z only", (char)('x' + d), k->name);
  }
  PetscCheck(k->period[2] == 0 || n >= 3, k->comm, PETSC_ERR_USER_INPUT,
             "Axis z is periodic with %" PetscInt_FMT " cells: -mesh_layers needs at least 3 there", n);
  PetscCall(MeshMapSetLayers(&k->map, 2, k->lower[2], k->upper[2], n, ratio));
  k->cells[2] = n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindReadCentre(MeshKind k, PetscInt axes)
{
  PetscFunctionBeginUser;
  PetscCall(OptRealArray("-mesh_centre", axes, k->map.centre, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindReadRadius(MeshKind k)
{
  PetscFunctionBeginUser;
  PetscCall(OptReal("-mesh_radius", &k->map.radius[0]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindReadCircle(MeshKind k)
{
  PetscFunctionBeginUser;
  PetscCall(MeshKindReadCentre(k, 2));
  PetscCall(MeshKindReadRadius(k));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindReadRatio(MeshKind k)
{
  PetscFunctionBeginUser;
  PetscCall(OptReal("-mesh_ring_ratio", &k->map.ring_ratio));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindReadResolution(MeshKind k, PetscInt min, PetscInt *resolution)
{
  PetscFunctionBeginUser;
  PetscCall(OptInt("-mesh_resolution", resolution));
  PetscCheck(*resolution >= min, k->comm, PETSC_ERR_USER_INPUT,
             "-mesh_resolution %" PetscInt_FMT " is too coarse for this mesh: at least %" PetscInt_FMT, *resolution,
             min);
  PetscFunctionReturn(PETSC_SUCCESS);
}
