/* Meshkind: discs, annuli, tubes, balls and shells (see kindimpl.h). */
#include "compat.h"
#include "../memory.h"
#include "kindimpl.h"
#include "ogrid.h"
#include "cubed.h"
#include "base/opt.h"
#include "mesh/mesh.h"

/* Rings of cells that are about as thick as long */
PetscErrorCode MeshKindReadDisc(MeshKind k)
{
  k->block[2]      = MeshDefaultResolution(k->name);
  k->map.radius[0] = 1;
  k->map.type      = MESHMAP_DISC;
  PetscFunctionBeginUser;
  PetscCall(MeshKindReadCircle(k));
  PetscCall(MeshKindReadResolution(k, 1, &k->block[2]));
  k->nring     = MeshKindCount(0.3 * k->block[2]);
  k->map.inner = 0.5 * k->block[2];
  k->map.outer = k->map.inner + k->nring;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_radii(MeshKind k)
{
  PetscReal *r = k->map.radius;

  PetscFunctionBeginUser;
  r[0] = 1;
  r[1] = 2;
  PetscCall(OptRealArray("-mesh_radii", 2, r, NULL));
  PetscCheck(r[1] > r[0], k->comm, PETSC_ERR_USER_INPUT,
             "-mesh_radii %g,%g: the outer radius must be larger than the inner one", (double)r[0], (double)r[1]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindReadAnnulus(MeshKind k)
{
  const PetscReal *r = k->map.radius;

  PetscFunctionBeginUser;
  k->block[2] = MeshDefaultResolution(k->name);
  k->map.type = MESHMAP_ANNULUS;
  PetscCall(MeshKindReadCentre(k, 2));
  PetscCall(read_radii(k));
  PetscCall(MeshKindReadResolution(k, 1, &k->block[2]));
  k->nring     = MeshKindCount((r[1] - r[0]) / (0.25 * PETSC_PI * (r[0] + r[1])) * k->block[2]);
  k->map.inner = 0.5 * k->block[2];
  k->map.outer = k->map.inner + k->nring;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The disc in layers of cells */
PetscErrorCode MeshKindReadTube(MeshKind k)
{
  PetscInt n = MeshDefaultResolution(k->name);

  PetscFunctionBeginUser;
  k->dim           = 3;
  k->map.radius[0] = 1;
  k->map.type      = MESHMAP_DISC;
  k->upper[2]      = 1;
  PetscCall(MeshKindReadCircle(k));
  for (PetscInt d = 0; d < 2; d++) {
    k->lower[d] = k->map.centre[d] - k->map.radius[0];
    k->upper[d] = k->map.centre[d] + k->map.radius[0];
  }
  PetscCall(OptReal("-mesh_length", &k->upper[2]));
  PetscCall(MeshKindReadRatio(k));
  PetscCall(MeshKindReadResolution(k, 1, &n));
  k->block[2]  = n;
  k->nring     = MeshKindCount(0.3 * n);
  k->map.inner = 0.5 * n;
  k->map.outer = k->map.inner + k->nring;
  PetscCall(MeshKindReadLayers(k, PetscMax(3, MeshKindCount(k->upper[2] / (0.5 * PETSC_PI * k->map.radius[0]) * n))));
  PetscCall(MeshCheckMemory(k->comm, 3, (PetscReal)k->cells[2] * n * ((PetscReal)n + 4 * (PetscReal)k->nring)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Ball and shell: layers from the cube of half-width n/2 on */
static PetscErrorCode read_cubes(MeshKind k, PetscReal layers)
{
  PetscInt n = MeshDefaultResolution(k->name);

  PetscFunctionBeginUser;
  k->dim = 3;
  PetscCall(MeshKindReadCentre(k, 3));
  PetscCall(MeshKindReadRatio(k));
  PetscCall(MeshKindReadResolution(k, 1, &n));
  k->block[2]  = n;
  k->nring     = MeshKindCount(layers * n);
  k->map.inner = 0.5 * n;
  k->map.outer = k->map.inner + k->nring;
  PetscCall(MeshCheckMemory(k->comm, 3, (PetscReal)n * n * ((k->kind == KIND_BALL ? n : 0) + 6 * (PetscReal)k->nring)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindReadBall(MeshKind k)
{
  PetscFunctionBeginUser;
  k->map.type      = MESHMAP_BALL;
  k->map.radius[0] = 1;
  PetscCall(MeshKindReadRadius(k));
  PetscCall(read_cubes(k, 0.3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindReadShell(MeshKind k)
{
  const PetscReal *r = k->map.radius;

  PetscFunctionBeginUser;
  k->map.type = MESHMAP_SHELL;
  PetscCall(read_radii(k));
  PetscCall(read_cubes(k, (r[1] - r[0]) / (0.25 * PETSC_PI * (r[0] + r[1]))));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindCreateRound(MeshKind k, DM *dm)
{
  OGrid g = {.nring    = k->nring,
             .n        = k->block[2],
             .middle   = (PetscBool)(k->kind == KIND_DISC || k->kind == KIND_TUBE),
             .nlayer   = k->dim == 3 ? k->cells[2] : 0,
             .periodic = (PetscBool)(k->period[2] > 0)};

  PetscFunctionBeginUser;
  if (k->kind == KIND_BALL || k->kind == KIND_SHELL) {
    const Cubed c = {.n = k->block[2], .nring = k->nring, .middle = (PetscBool)(k->kind == KIND_BALL)};

    PetscCall(CubedCreate(k->comm, &c, &k->map, dm));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt d = 0; d < 2; d++) {
    if (k->kind == KIND_FITTED) {
      g.nsquare[d] = k->map.ncell[d];
      g.block[d]   = k->block[d];
    } else if (g.middle) g.nsquare[d] = g.n;
  }
  PetscCall(OGridCreate(k->comm, &g, &k->map, dm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindGetRound(MeshKind k, PetscInt b, PetscBool *round, BorderRound *r)
{
  PetscBool inner, outer, cylinder;

  PetscFunctionBeginUser;
  *round = PETSC_FALSE;
  *r     = (BorderRound){.axis = -1};
  PetscCall(PetscStrcmp(k->boundary[b], "inner", &inner));
  PetscCall(PetscStrcmp(k->boundary[b], "outer", &outer));
  PetscCall(PetscStrcmp(k->boundary[b], "cylinder", &cylinder));
  if (k->kind == KIND_FILE || k->kind == KIND_BOX || k->kind == KIND_CHANNEL || !(inner || outer || cylinder))
    PetscFunctionReturn(PETSC_SUCCESS);
  *round    = PETSC_TRUE;
  r->inside = outer;
  r->radius = k->map.radius[outer && (k->kind == KIND_ANNULUS || k->kind == KIND_SHELL)];
  if (k->kind == KIND_TUBE || (k->kind == KIND_FITTED && k->dim == 3)) r->axis = 2;
  for (PetscInt a = 0; a < k->dim && a != r->axis; a++) r->centre[a] = k->map.centre[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}
