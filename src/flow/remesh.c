/* Flow: what goes by the mesh, made and made anew (FlowRemesh of flow.h). */
#include "compat.h"
#include "impl.h"
#include "mesh/carry.h"

PetscErrorCode FlowCreateComponents(Flow f)
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim;

  PetscFunctionBeginUser;
  PetscCall(FlowCreateCells(f));
  PetscCall(ConditionsCreate(f->mesh, &f->boundary));
  PetscCall(TractionCreate(f, &f->force.traction));
  PetscCall(PetscCalloc1(l->nnode_all * dim, &f->u)); /* each on its own: accepted steps swap them */
  PetscCall(PetscCalloc1(l->nnode_all * dim, &f->u_old));
  if (f->par.extrapolation == FLOW_QUADRATIC || f->u_older) /* or the mesh before had one */
    PetscCall(PetscCalloc1(l->nnode_all * dim, &f->u_older));
  PetscCall(PetscCalloc1(l->nnode_all * dim, &f->w));
  PetscCall(PetscCalloc2(l->ncell * (dim + 1), &f->p, l->ncell * (dim + 1), &f->p_old));
  f->force.source     = NULL;
  f->matrix.A         = NULL;
  f->matrix.S         = NULL;
  f->matrix.entry     = NULL;
  f->matrix.product   = NULL;
  f->matrix.near_rows = NULL;
  f->matrix.current   = PETSC_FALSE;
  if (f->matrix.free) PetscCall(FlowCreateProduct(f));
  else PetscCall(FlowCreateMatrix(f));
  f->matrix.ct     = 0;
  f->mesh_velocity = NULL;
  f->owners        = (Owners){0};
  f->properties    = (Properties){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDestroyComponents(Flow f)
{
  PetscFunctionBeginUser;
  PetscCall(MatDestroy(&f->matrix.S));
  PetscCall(FlowDestroyProduct(f));
  PetscCall(FlowDestroyRows(f));
  PetscCall(MatDestroy(&f->matrix.A));
  PetscCall(PetscFree(f->matrix.entry));
  PetscCall(OwnersClear(&f->owners));
  PetscCall(PetscFree2(f->properties.inertia, f->properties.mass));
  PetscCall(FlowDestroyCells(f));
  PetscCall(TractionDestroy(&f->force.traction));
  PetscCall(ConditionsDestroy(&f->boundary));
  PetscCall(PetscFree(f->u));
  PetscCall(PetscFree(f->u_old));
  PetscCall(PetscFree(f->u_older));
  PetscCall(PetscFree(f->w));
  PetscCall(PetscFree(f->force.source));
  PetscCall(PetscFree2(f->p, f->p_old));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Slopes of two pressures in units of the cell size, to those by reference coordinate, or back */
static PetscErrorCode scale_slopes(Mesh mesh, const PetscReal size[], PetscBool back, PetscReal *const p[2])
{
  const MeshLocal *l;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal xc[MESH_MAX_NB * 3];

    PetscCall(MeshCellCoordinates(mesh, c, xc));
    for (PetscInt a = 0; a < l->dim; a++) {
      const PetscReal half  = 0.5 * (xc[(l->nb - 1) * l->dim + a] - xc[a]),
                      scale = back ? size[c] / half : half / size[c];

      for (PetscInt i = 0; i < 2; i++) p[i][c * (l->dim + 1) + 1 + a] *= scale;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowRemesh(Flow f, Mesh old)
{
  struct _p_Flow   was;
  const PetscReal *from[3];
  PetscReal       *to[3];

  PetscFunctionBeginUser;
  if (f->device) PetscCall(OnDeviceForgetConvection(f)); /* the next step has another */
  PetscCall(FlowBringFields(f));
  was = *f;
  PetscCall(FlowCreateComponents(f));
  OwnersLose(&was.owners, &f->owners);
  f->properties.lost = (PetscBool)(was.properties.density || was.properties.viscosity || was.properties.lost);
  from[0]            = was.u;
  from[1]            = was.u_old;
  from[2]            = was.u_older;
  to[0]              = f->u;
  to[1]              = f->u_old;
  to[2]              = f->u_older;
  PetscCall(MeshCarryVelocities(old, f->mesh, 3, from, to));
  if (f->material) PetscCall((*f->material->remesh)(f, old));
  PetscCall(scale_slopes(old, was.cells.size, PETSC_FALSE, (PetscReal *const[]){was.p, was.p_old}));
  PetscCall(MeshCarryCells(old, f->mesh, was.p, f->p));
  PetscCall(MeshCarryCells(old, f->mesh, was.p_old, f->p_old));
  PetscCall(scale_slopes(f->mesh, f->cells.size, PETSC_TRUE, (PetscReal *const[]){f->p, f->p_old}));
  PetscCall(FlowDestroyComponents(&was));
  if (f->device) PetscCall(OnDeviceRemesh(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}
