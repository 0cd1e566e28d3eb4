/* Couple, boundary method: how the flow sees the surfaces of rigid bodies (boundarymethod.h), as a participant. Finds
   nodes and cells of bodies that have moved since the last step; what stands still is found once. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"

static PetscErrorCode find_nodes(Couple c, void *data)
{
  CoupleMethod *m = (CoupleMethod *)data;

  PetscFunctionBeginUser;
  m->current = (PetscBool)(m->current && !m->others);
  m->others  = PETSC_FALSE;
  if (m->current) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_MARK, 0, 0, 0, 0));
  PetscCall(IndicatorClear(c->indicator));
  PetscCall((*m->table->update)(c, m->data, &m->terms));
  PetscCall(IndicatorFinish(c->indicator));
  if (m->terms) {
    PetscCall(ConstraintSetRelative(c->constraint, m->terms->relative_to, m->terms->nmore, m->terms->more));
    PetscCall(FlowSolverSetPenalty(c->solver, m->terms));
  }
  PetscCall(PetscLogEventEnd(TB_MARK, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode sum_terms(Couple c, void *data)
{
  const CoupleMethod *m = (const CoupleMethod *)data;

  PetscFunctionBeginUser;
  if (c->s->nall && m->terms && (!m->current || m->rows_changed)) PetscCall(PenaltyTermSum(m->terms, c->constraint));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode stiffen(Couple c, void *data)
{
  const CoupleMethod *m       = (const CoupleMethod *)data;
  PetscBool           changed = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (FlowHasSymmetricStress(c->flow) && m->terms && m->table->stiffen)
    PetscCall((*m->table->stiffen)(m->data, &changed));
  if (changed) PetscCall(PenaltyTermSum(m->terms, c->constraint));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode accept_step(Couple c, void *data)
{
  const CoupleMethod *m = (const CoupleMethod *)data;

  PetscFunctionBeginUser;
  if (m->table->accept) PetscCall((*m->table->accept)(c, m->data));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update_mesh_data(Couple c, void *data)
{
  const CoupleMethod *m = (const CoupleMethod *)data;

  PetscFunctionBeginUser;
  (void)c;
  if (m->table->mesh_updated) PetscCall((*m->table->mesh_updated)(m->data));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- meshes, state ---- */

static PetscErrorCode keep_of_mesh(Couple c, void *data)
{
  CoupleMethod *m = (CoupleMethod *)data;

  PetscFunctionBeginUser;
  (void)c;
  if (m->table->before_remesh) PetscCall((*m->table->before_remesh)(m->data, &m->left));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode discard(Couple c, void *data)
{
  CoupleMethod *m = (CoupleMethod *)data;

  PetscFunctionBeginUser;
  (void)c;
  if (m->table->destroy && m->data) PetscCall((*m->table->destroy)(m->data));
  m->data            = NULL;
  m->terms           = NULL;
  m->inactive_inside = NULL;
  m->on_surface      = NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_on_mesh(Couple c, void *data, Mesh *old)
{
  CoupleMethod *m = (CoupleMethod *)data;

  PetscFunctionBeginUser;
  if (m->table->create) PetscCall((*m->table->create)(c, &m->data));
  if (m->left) PetscCall((*m->table->after_remesh)(m->data, &m->left, old));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit(Couple c, void *data, State state)
{
  const CoupleMethod *m = (const CoupleMethod *)data;

  PetscFunctionBeginUser;
  if (!m->table->state) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall((*m->table->state)(m->data, state));
  PetscCall(CoupleNeedsSolver(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view(Couple c, void *data, PetscViewer viewer)
{
  const CoupleMethod *m = (const CoupleMethod *)data;

  PetscFunctionBeginUser;
  (void)c;
  if (m->table->view) PetscCall((*m->table->view)(m->data, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant METHOD = {.name          = "boundary method",
                                         .prepare       = find_nodes,
                                         .rows          = sum_terms,
                                         .assemble      = stiffen,
                                         .advance       = accept_step,
                                         .mesh_updated  = update_mesh_data,
                                         .before_remesh = keep_of_mesh,
                                         .discard       = discard,
                                         .after_remesh  = make_on_mesh,
                                         .visit         = visit,
                                         .view          = view};

PetscErrorCode CoupleAddMethod(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(CoupleAddParticipant(c, &METHOD, &c->method));
  PetscFunctionReturn(PETSC_SUCCESS);
}
