/* MeshUpdate: see meshupdate.h. */
#include "compat.h"
#include "meshupdate.h"

struct _p_MeshUpdate {
  MPI_Comm         comm;
  Flow             flow;
  FlowSolver       solver;
  Mesh             mesh;
  const MeshLocal *loc;
  PetscErrorCode (*told)(void *);
  void            *ctx;
  PetscInt         n; /* the transaction under way */
  const PetscInt  *cell;
  PetscBool        any;
  PetscInt        *material;     /* [ncell_all] -1: no part of the fluid, else 0 */
  const PetscInt  *cell_surface; /* of the last commit that had them; NULL: no cell has left the fluid so far */
  const PetscBool *resolved;
};

PetscErrorCode MeshUpdateCreate(Flow flow, PetscErrorCode (*told)(void *), void *ctx, MeshUpdate *mesh_update)
{
  MeshUpdate m;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&m));
  m->flow = flow;
  m->told = told;
  m->ctx  = ctx;
  PetscCall(FlowGetMesh(flow, &m->mesh));
  PetscCall(MeshGetComm(m->mesh, &m->comm));
  PetscCall(MeshGetLocal(m->mesh, &m->loc));
  PetscCall(PetscCalloc1(m->loc->ncell_all, &m->material));
  *mesh_update = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshUpdateDestroy(MeshUpdate *mesh_update)
{
  PetscFunctionBeginUser;
  if (!*mesh_update) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree((*mesh_update)->material));
  PetscCall(PetscFree(*mesh_update));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshUpdateSetSolver(MeshUpdate m, FlowSolver solver)
{
  PetscInt n = 0, *inactive;

  PetscFunctionBeginUser;
  m->solver = solver;
  if (!m->cell_surface) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(m->loc->ncell_all, &inactive));
  for (PetscInt c = 0; c < m->loc->ncell_all; c++)
    if (m->material[c] < 0) inactive[n++] = c;
  PetscCall(FlowSolverForgetCells(solver, n, inactive));
  PetscCall(FlowSolverSetInactive(solver, m->material, m->resolved));
  PetscCall(PetscFree(inactive));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const PetscInt *MeshUpdateGetInactive(MeshUpdate m)
{
  return m->cell_surface;
}

PetscErrorCode MeshUpdateBegin(MeshUpdate m, PetscInt n, const PetscInt cell[], PetscBool *any)
{
  PetscFunctionBeginUser;
  m->n    = n;
  m->cell = cell;
  m->any  = (PetscBool)(n > 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &m->any, 1, COMPAT_MPI_BOOL, MPI_LOR, m->comm));
  if (m->any) PetscCall(FlowSolverForgetCells(m->solver, n, cell));
  if (any) *any = m->any;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* New places and old velocities */
static PetscErrorCode move_nodes(MeshUpdate m, const MeshUpdateMesh *to)
{
  const PetscInt dim = m->loc->dim;
  PetscReal     *u[2], *psi, *shift;
  PetscInt       nfield;

  PetscFunctionBeginUser;
  if (to->nnode || !to->whole) PetscCall(MeshMoveNodes(m->mesh, to->nnode, to->node, to->x));
  if (to->whole) {
    PetscCall(MeshRebase(m->mesh));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(FlowGetFields(m->flow, &u[0], &u[1], NULL));
  PetscCall(FlowGetLogConformation(m->flow, &psi, &shift));
  nfield = psi ? 4 : 2;
  for (PetscInt e = 0; e < to->ncarried; e++) {
    const PetscReal *value = to->value + e * nfield * dim;

    for (PetscInt k = 0; k < 2; k++) PetscCall(PetscArraycpy(u[k] + dim * to->carried[e], value + k * dim, dim));
    if (psi) PetscCall(PetscArraycpy(psi + 2 * dim * to->carried[e], value + 2 * dim, 2 * dim));
  }
  for (PetscInt e = 0; e < to->nalong; e++)
    for (PetscInt k = 0; k < 2 * dim; k++) {
      const PetscInt at = 2 * dim * to->along[e] + k;

      shift[at] = psi[at] - to->kept[2 * dim * e + k];
    }
  for (PetscInt k = 0; k < 2; k++) PetscCall(MeshSyncNodes(m->mesh, dim, u[k]));
  if (psi) PetscCall(MeshSyncNodes(m->mesh, 2 * dim, psi));
  if (psi) PetscCall(MeshSyncNodes(m->mesh, 2 * dim, shift));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Values that are prescribed at nodes which move within their boundary */
static PetscErrorCode renew_conditions(MeshUpdate m, const MeshUpdateMesh *to)
{
  const unsigned char *fixed;
  PetscBool            any = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(m->flow), &fixed, NULL));
  for (PetscInt e = 0; e < to->nnode && !to->whole; e++) any = (PetscBool)(any || fixed[to->node[e]]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &any, 1, COMPAT_MPI_BOOL, MPI_LOR, m->comm));
  if (any) PetscCall(ConditionsRenew(FlowConditions(m->flow)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void remember_inactive(MeshUpdate m, const MeshUpdateMesh *to)
{
  if (!to->cell_surface) return;
  for (PetscInt c = 0; c < m->loc->ncell_all; c++) m->material[c] = to->cell_surface[c] >= 0 ? -1 : 0;
  m->cell_surface = to->cell_surface;
  m->resolved     = to->resolved;
}

PetscErrorCode MeshUpdateCommit(MeshUpdate m, const MeshUpdateMesh *to)
{
  PetscFunctionBeginUser;
  remember_inactive(m, to);
  if (!m->any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(move_nodes(m, to));
  PetscCall(renew_conditions(m, to));
  PetscCall(FlowUpdateCells(m->flow, m->n, m->cell, m->material));
  if (m->cell_surface) PetscCall(FlowSolverSetInactive(m->solver, m->material, m->resolved));
  if (m->told && to->whole) PetscCall((*m->told)(m->ctx));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshUpdateBodies(MeshUpdate m)
{
  PetscFunctionBeginUser;
  if (m->cell_surface) PetscCall(FlowSolverSetInactive(m->solver, m->material, m->resolved));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshUpdateRestore(MeshUpdate m, PetscInt n, const PetscInt cell[], const MeshUpdateMesh *to)
{
  PetscFunctionBeginUser;
  remember_inactive(m, to);
  PetscCall(MeshMoveNodes(m->mesh, to->nnode, to->node, to->x));
  PetscCall(renew_conditions(m, to));
  if (to->whole) PetscCall(MeshRebase(m->mesh));
  PetscCall(FlowRestoreCells(m->flow, n, cell, m->material));
  if (m->told && to->whole) PetscCall((*m->told)(m->ctx));
  PetscFunctionReturn(PETSC_SUCCESS);
}
