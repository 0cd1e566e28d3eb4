/* Couple: what others ask of it between steps. */
#include "compat.h"
#include "impl.h"
#include "flow/device.h"

PetscErrorCode CoupleIsImplicit(Couple c, PetscBool *implicit)
{
  PetscFunctionBeginUser;
  *implicit = (PetscBool)c->implicit;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleSetStep(Couple c, PetscReal dt)
{
  PetscFunctionBeginUser;
  c->dt_asked = dt;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetSolver(Couple c, FlowSolver *solver)
{
  PetscFunctionBeginUser;
  *solver = c->solver;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetCounts(Couple c, PetscInt *n, const CoupleCount *count[])
{
  PetscFunctionBeginUser;
  *n     = c->method.ncount;
  *count = c->method.count;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetNodeBody(Couple c, const PetscInt *node_body[])
{
  PetscFunctionBeginUser;
  PetscCall(IndicatorGetNodes(c->indicator, node_body, NULL, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetGiven(Couple c, PetscReal *given[])
{
  const void *own = c->method.table->penalty ? (*c->method.table->penalty)(c->method.data) : NULL;

  PetscFunctionBeginUser;
  PetscCall(FlowGetGiven(c->flow, own, c->field.u, given));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleIsLinedUp(Couple c, PetscBool *lined_up)
{
  PetscFunctionBeginUser;
  *lined_up = c->method.table->moves_nodes;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetFilmGapOffset(Couple c, PetscReal *film_gap_offset)
{
  PetscFunctionBeginUser;
  *film_gap_offset = c->method.table->film_gap_offset;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetLoad(Couple c, PetscInt *ncells, PetscInt *nbodies)
{
  const PetscInt *node_body, *node;
  PetscInt        n;
  PetscBool      *seen;

  PetscFunctionBeginUser;
  PetscCall(IndicatorGetCells(c->indicator, ncells, NULL));
  PetscCall(IndicatorGetNodes(c->indicator, &node_body, &n, &node));
  *nbodies = 0;
  PetscCall(PetscCalloc1(c->s->n, &seen));
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt k = node_body[node[i]];

    if (node[i] >= c->loc->nnode || seen[k]) continue;
    seen[k] = PETSC_TRUE;
    (*nbodies)++;
  }
  PetscCall(PetscFree(seen));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetSolution(Couple c, const PetscReal *u[], const PetscReal *p[])
{
  PetscFunctionBeginUser;
  PetscCall(FlowTakeSolution(c->flow, c->field.u, c->field.p));
  *u = c->field.u;
  *p = c->field.p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetSystem(Couple c, PetscReal *u[], PetscReal *p[], PetscReal *U[], PetscReal *rhs[],
                               PetscReal *g[])
{
  PetscFunctionBeginUser;
  PetscCall(FlowTakeSolution(c->flow, c->field.u, c->field.p));
  if (u) *u = c->field.u;
  if (p) *p = c->field.p;
  if (U) *U = c->rigid.U;
  if (rhs) *rhs = c->field.rhs;
  if (g) *g = c->rigid.g;
  PetscFunctionReturn(PETSC_SUCCESS);
}
