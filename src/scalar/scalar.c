/* Scalars: see scalar.h. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"
#include "mesh/carry.h"

PetscInt ScalarsCount(Scalars all)
{
  return all ? all->n : 0;
}

PetscErrorCode ScalarsGetParameters(Scalars all, PetscInt s, const ScalarParameters **par)
{
  PetscFunctionBeginUser;
  *par = &all->scalar[s].par;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsGetFields(Scalars all, PetscInt s, PetscReal *T[], PetscReal *T_old[])
{
  PetscFunctionBeginUser;
  *T = all->scalar[s].T;
  if (T_old) *T_old = all->scalar[s].T_old;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsGetSolution(Scalars all, PetscInt s, PetscReal *T[])
{
  PetscFunctionBeginUser;
  *T = all->scalar[s].x;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ScalarsIsOpen(Scalars all, PetscInt s, PetscInt b)
{
  return (PetscBool)(all->scalar[s].condition[b].kind != SCALAR_NONE);
}

/* ---- on a mesh ---- */

static PetscErrorCode create_arrays(Scalars all, Scalar *s)
{
  const PetscInt n = all->loc->nnode_all;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(n, &s->T)); /* each on its own: accepted steps swap them */
  PetscCall(PetscCalloc1(n, &s->T_old));
  PetscCall(PetscCalloc1(n, &s->x));
  PetscCall(PetscCalloc4(n, &s->fixed, n, &s->rhs, n, &s->owner, n, &s->seen));
  s->cells = (ScalarCells){0};
  s->nodes = (ScalarNodes){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsSetUp(Scalars all)
{
  PetscFunctionBeginUser;
  if (all->ready) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarsFindFaces(all));
  PetscCall(ScalarsFindPattern(all));
  all->ready = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsDiscard(Scalars all)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < all->n; i++) {
    Scalar *s = all->scalar + i;

    PetscCall(ScalarForgetSolver(s));
    PetscCall(MatDestroy(&s->A));
    PetscCall(ScalarForgetInput(&s->input));
    PetscCall(PetscFree(s->cell_side));
    PetscCall(ScalarLimitForget(s));
    PetscCall(PetscFree2(s->sums, s->has_sums));
    PetscCall(PetscFree2(s->growth_weight, s->growth_cell));
    s->nside = 0;
    PetscCall(ScalarLumpsForget(s));
    s->lumps = NULL;
    s->cells = (ScalarCells){0};
    s->nodes = (ScalarNodes){0};
  }
  PetscCall(PetscFree(all->edge));
  all->moves = -1;
  if (!all->ready) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree2(all->face, all->next_face));
  PetscCall(PetscFree(all->cell_face));
  PetscCall(PetscFree(all->row_start));
  PetscCall(PetscFree(all->column));
  PetscCall(PetscFree(all->entry));
  all->ready = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsRenewSolvers(Scalars all)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < all->n; i++) PetscCall(ScalarForgetSolver(all->scalar + i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_arrays(Scalar *s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(s->T));
  PetscCall(PetscFree(s->T_old));
  PetscCall(PetscFree(s->excess));
  PetscCall(PetscFree(s->x));
  PetscCall(PetscFree4(s->fixed, s->rhs, s->owner, s->seen));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsRemesh(Scalars all, Mesh old)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < all->n; i++) {
    Scalar *s = all->scalar + i, was = *s;

    PetscCall(create_arrays(all, s));
    PetscCall(MeshCarryNodes(old, all->mesh, 1, was.T, s->T));
    PetscCall(MeshCarryNodes(old, all->mesh, 1, was.T_old, s->T_old));
    s->excess = NULL;
    if (was.excess) PetscCall(PetscCalloc1(all->loc->nnode_all, &s->excess));
    if (was.excess) PetscCall(MeshCarryNodes(old, all->mesh, 1, was.excess, s->excess));
    PetscCall(destroy_arrays(&was));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

PetscErrorCode ScalarsStartAt(Scalars all, PetscInt i, const PetscReal x[])
{
  Scalar *s = all->scalar + i;

  PetscFunctionBeginUser;
  if (s->run[0] && all->read) {
    char option[OPT_NAME];

    (void)snprintf(option, sizeof(option), "-scalar_%s_initial_run", s->name); /* read elsewhere */
    PetscCall((*all->read)(all->mesh, option, s->run, s->name, x, s->T));
  } else PetscCall(ScalarEvaluateNumber(&s->initial, 0, all->loc->nnode_all, x, s->T));
  PetscCall(PetscArraycpy(s->T_old, s->T, all->loc->nnode_all));
  PetscCall(PetscArraycpy(s->x, s->T, all->loc->nnode_all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsSetReader(Scalars all, ScalarsReader read)
{
  PetscFunctionBeginUser;
  all->read = read;
  for (PetscInt i = 0; i < all->n; i++)
    if (all->scalar[i].run[0]) PetscCall(ScalarsStartAt(all, i, all->loc->x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsCreate(Mesh mesh, Scalars *scalars)
{
  Scalars all;

  PetscFunctionBeginUser;
  *scalars = NULL;
  PetscCall(PetscNew(&all));
  all->mesh  = mesh;
  all->moves = -1;
  PetscCall(MeshGetLocal(mesh, &all->loc));
  PetscCall(MeshGetComm(mesh, &all->comm));
  PetscCall(MeshGetBoundaryCount(mesh, &all->nboundary));
  PetscCall(ScalarsRead(all));
  if (!all->n) {
    PetscCall(PetscFree(all));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(ElementCreate(all->loc->dim, &all->element));
  for (PetscInt e = 0; e < all->loc->nb * all->loc->nb; e++)
    all->integral[e / all->loc->nb] += all->element.mass[e / all->loc->nb * all->element.nbp + e % all->loc->nb];
  for (PetscInt i = 0; i < all->n; i++) PetscCall(create_arrays(all, all->scalar + i));
  for (PetscInt i = 0; i < all->n; i++) PetscCall(ScalarsStartAt(all, i, all->loc->x));
  *scalars = all;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsDestroy(Scalars *scalars)
{
  Scalars all = *scalars;

  PetscFunctionBeginUser;
  if (!all) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarsDiscard(all));
  for (PetscInt i = 0; i < all->n; i++) {
    PetscCall(destroy_arrays(all->scalar + i));
    PetscCall(ScalarForgetOptions(all, all->scalar + i));
  }
  PetscCall(ElementDestroy(&all->element));
  PetscCall(PetscFree(all->scalar));
  PetscCall(PetscFree(*scalars));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- steps ---- */

PetscErrorCode ScalarsBeginStep(Scalars all, const ScalarStep *step)
{
  PetscFunctionBeginUser;
  all->step = *step;
  PetscCall(ScalarsSetUp(all));
  for (PetscInt i = 0; i < all->n; i++) {
    all->scalar[i].solved = PETSC_FALSE;
    PetscCall(ScalarCreateSolver(all, all->scalar + i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsSetCells(Scalars all, PetscInt s, const ScalarCells *cells)
{
  PetscFunctionBeginUser;
  all->scalar[s].cells = cells ? *cells : (ScalarCells){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsSetShift(Scalars all, const PetscReal shift[])
{
  PetscFunctionBeginUser;
  all->shift = shift;
  all->moves = -1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsSetNodes(Scalars all, PetscInt s, const ScalarNodes *nodes)
{
  PetscFunctionBeginUser;
  all->scalar[s].nodes = nodes ? *nodes : (ScalarNodes){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsSetSides(Scalars all, PetscInt i, PetscInt n, const ScalarSide side[])
{
  Scalar *s = all->scalar + i;

  PetscFunctionBeginUser;
  if (n && !s->cell_side) PetscCall(PetscMalloc1(all->loc->ncell_all, &s->cell_side));
  for (PetscInt c = 0; c < all->loc->ncell_all && s->cell_side; c++) s->cell_side[c] = -1;
  PetscCall(PetscFree(s->input.side));
  s->nside = n;
  s->side  = side;
  for (PetscInt k = n - 1; k >= 0; k--) s->cell_side[side[k].cell] = k;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsReact(Scalars all, PetscInt i)
{
  PetscFunctionBeginUser;
  all->scalar[i].input.reacts = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsAccept(Scalars all)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < all->n; i++) {
    Scalar    *s    = all->scalar + i;
    PetscReal *swap = s->T_old;

    PetscCall(ScalarLimitAccept(all, s));
    s->T_old = s->T;
    s->T     = swap;
    PetscCall(PetscArraycpy(s->T, s->x, all->loc->nnode_all));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsVisitState(void *scalars, State state)
{
  Scalars all = scalars;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < all->n; i++) {
    Scalar   *s = all->scalar + i;
    char      name[128];
    PetscBool has;

    PetscCall(PetscSNPrintf(name, sizeof(name), "scalar_%s", s->name));
    PetscCall(StateHas(state, name, &has));
    if (!has) continue; /* a run without it: it starts as the options say */
    PetscCall(StateNodes(state, name, 1, s->T));
    PetscCall(PetscSNPrintf(name, sizeof(name), "scalar_%s_old", s->name));
    PetscCall(StateNodes(state, name, 1, s->T_old));
    PetscCall(PetscSNPrintf(name, sizeof(name), "scalar_%s_excess", s->name));
    has = (PetscBool)(s->excess != NULL);
    if (StateIsLoading(state)) PetscCall(StateHas(state, name, &has));
    if (has && !s->excess) PetscCall(PetscMalloc1(all->loc->nnode_all, &s->excess));
    if (has) PetscCall(StateNodes(state, name, 1, s->excess));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- on the flow ---- */

PetscErrorCode ScalarsAddBuoyancy(Scalars all, PetscInt i, PetscReal density, const PetscReal gravity[3],
                                  const PetscReal fluid[], PetscReal force[])
{
  const MeshLocal *l   = all->loc;
  const PetscInt   dim = l->dim, nb = l->nb;
  const Scalar    *s = all->scalar + i;

  PetscFunctionBeginUser;
  if (s->par.expansion == 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt c = 0; c < l->ncell; c++) {
    const PetscReal scale = -density * s->par.expansion * (fluid ? fluid[c] : 1);
    const PetscInt *node  = l->cell_node + c * nb;
    PetscReal       linear[MESH_MAX_NB], now[MESH_MAX_NB], old[MESH_MAX_NB], r[MESH_MAX_NB];

    if (scale == 0) continue;
    PetscCall(ScalarCellLinear(all, s, c, linear));
    MeshCellValues(l, c, 1, s->T, now);
    MeshCellValues(l, c, 1, s->T_old, old);
    for (PetscInt j = 0; j < nb; j++)
      now[j] += all->step.extrapolation * (now[j] - old[j]) - s->par.reference + linear[j];
    PetscCall(ScalarCellIntegrate(all, c, scale, now, r));
    MeshCellScatter(l, c, 1, r);
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) force[node[j] * dim + a] += r[j] * gravity[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
