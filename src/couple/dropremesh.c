/* CoupleDrops, remesh: cells are rebuilt between two steps (-mesh_track). The new mesh is lined up with the interface
   as the old one had it, and what the next step begins with is taken from there, at the places of the new nodes. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "scalarphases.h"
#include "mesh/carry.h"

enum {
  NOW,
  OLD,
  CORRECTION,
  SHIFT,
  NFIELD
};

/* [NFIELD] what goes over */
static PetscErrorCode get_fields(CoupleDrops *f, Couple c, PetscReal *field[])
{
  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &field[NOW], &field[OLD], NULL));
  field[CORRECTION] = f->corr;
  field[SHIFT]      = f->shift;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsCheckRemesh(const CoupleDrops *f, Couple c)
{
  PetscFunctionBeginUser;
  PetscCheck(!c->s->nall, c->comm, PETSC_ERR_SUP,
             "Drops beside rigid bodies on a mesh that follows are not possible yet: remove -mesh_track");
  PetscCheck(!CoupleCarriedScalars(c), c->comm, PETSC_ERR_SUP,
             "Drops with -scalars on a mesh that follows are not possible yet: remove -mesh_track");
  PetscCheck(!DropsMayStayApart(f->s), c->comm, PETSC_ERR_SUP,
             "Drops that stay apart (-particle_<group>_coalescence, _film, _drainage) on a mesh that follows are not possible yet: remove "
             "-mesh_track");
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsKeepMesh(CoupleDrops *f, Couple c)
{
  const PetscInt n = c->loc->dim * c->loc->nnode_all;
  PetscReal     *field[NFIELD];
  PhaseInterface now;

  PetscFunctionBeginUser;
  PetscCall(DropsCheckRemesh(f, c)); /* that of a checkpoint may be another */
  if (!f->lined_up) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DropsGather(f, c, f->cell_drop, NULL, &now));
  PetscCall(PhaseInterfaceDestroy(&f->interface));
  f->interface = now;
  PetscCall(PetscNew(&f->kept));
  PetscCall(AlignKeptCreate(c->loc, NULL, f->kept));
  PetscCall(get_fields(f, c, field));
  for (PetscInt k = 0; k < NFIELD; k++) {
    PetscCall(PetscMalloc1(n, &f->kept->field[k]));
    PetscCall(PetscArraycpy(f->kept->field[k], field[k], n));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* At the nodes of the new mesh, as f->result will have them */
static PetscErrorCode take_fields(CoupleDrops *f, Couple c)
{
  const PetscInt dim = c->loc->dim;
  AlignResult    all = f->result; /* in which all cells are fluid, as they are */
  PetscInt      *none;
  PetscReal     *field[NFIELD];
  AlignTargets   t;
  RemapCount     count;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->loc->ncell_all, &none));
  for (PetscInt e = 0; e < c->loc->ncell_all; e++) none[e] = -1;
  all.cell_surface = none;
  PetscCall(AlignTargetsCreate(c->loc, PhaseSurfacesGet(f->surfaces), NFIELD, &t));
  PetscCall(get_fields(f, c, field));
  for (PetscInt k = CORRECTION; k < NFIELD; k++)
    PetscCall(MeshCarryNodes(f->kept->mesh, c->mesh, dim, f->kept->field[k], field[k]));
  PetscCall(AlignKeptEvaluate(f->kept, &all, f->remap, (const PetscReal *const *)field, &t, &count));
  for (PetscInt e = 0; e < t.n; e++)
    for (PetscInt k = 0; k < NFIELD; k++)
      PetscCall(PetscArraycpy(field[k] + dim * t.node[e], t.value + (NFIELD * e + k) * dim, dim));
  for (PetscInt k = 0; k < NFIELD; k++) PetscCall(MeshSyncNodes(c->mesh, dim, field[k]));
  PetscCall(AlignTargetsDestroy(&t));
  PetscCall(PetscFree(none));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsArrive(CoupleDrops *f, Couple c, Mesh *old)
{
  PetscFunctionBeginUser;
  if (!f->kept) PetscFunctionReturn(PETSC_SUCCESS); /* the first step has not been, or a checkpoint comes */
  PetscCall(AlignKeptArrive(f->kept, old, c->mesh));
  PetscCall(DropsLineUp(f, c));
  PetscCall(take_fields(f, c));
  PetscCall(DropsPlaceNodes(f, c));
  ConstraintMoveNodes(c->constraint);
  PetscCall(DropsNameCells(f, c));
  PetscCall(AlignKeptDestroy(f->kept));
  PetscCall(PetscFree(f->kept));
  PetscFunctionReturn(PETSC_SUCCESS);
}
