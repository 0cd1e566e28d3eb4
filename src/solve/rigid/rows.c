/* Constraint: the rows of the projection P (see constraint.h, constraintimpl.h). */
#include "compat.h"
#include "constraintimpl.h"
#include "base/array.h"
#include "base/rigid.h"

static PetscInt bit_count(PetscInt bits)
{
  PetscInt n = 0;

  for (; bits; bits &= bits - 1) n++;
  return n;
}

/* Row a of the rigid map at node i about centre X: velocity component a for unit rigid velocities, without regard to
   what is unknown */
static void map_row(const MeshLocal *l, PetscInt i, PetscInt a, const PetscReal X[3], PetscReal row[])
{
  PetscReal r[3] = {0, 0, 0};

  for (PetscInt d = 0; d < l->dim; d++) { r[d] = MeshNearest(l, d, l->x[i * l->dim + d] - X[d]); }
  for (PetscInt d = 0; d < l->dim; d++) row[d] = d == a;
  RigidSpinRow(l->dim, a, r, row + l->dim);
}

/* The same of body k, zero where its velocity is known */
static void unknown_row(Constraint c, PetscInt i, PetscInt a, PetscInt k, PetscReal row[])
{
  map_row(c->view.loc, i, a, c->X[k], row);
  for (PetscInt s = 0; s < c->view.nr; s++)
    if (!ConstraintIsUnknown(&c->view, k, s)) row[s] = 0;
}

PetscErrorCode ConstraintCollectInert(Constraint c)
{
  const MeshLocal *l = c->view.loc;
  PetscInt         n = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode; i++) n += c->node_body[i] >= 0 ? l->dim : bit_count(c->fixed[i]);
  if (n > c->view.inert.n || !c->inert.slot) {
    PetscCall(PetscFree4(c->inert.slot, c->inert.body, c->inert.local_body, c->inert.coef));
    PetscCall(
      PetscMalloc4(n, &c->inert.slot, n, &c->inert.body, n, &c->inert.local_body, n * c->view.nr, &c->inert.coef));
    c->view.inert = (ConstraintRows){.slot       = c->inert.slot,
                                     .body       = c->inert.body,
                                     .local_body = c->inert.local_body,
                                     .coef       = c->inert.coef};
  }
  c->view.inert.n = 0;
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscInt k = c->node_body[i];

    if (k < 0 && !c->fixed[i]) continue;
    for (PetscInt a = 0; a < l->dim; a++) {
      PetscReal *row = c->inert.coef + c->view.inert.n * c->view.nr;

      if (k < 0 && !((c->fixed[i] >> a) & 1)) continue;
      if (k >= 0) unknown_row(c, i, a, k, row);
      else
        for (PetscInt s = 0; s < c->view.nr; s++) row[s] = 0;
      c->inert.slot[c->view.inert.n]         = i * l->dim + a;
      c->inert.body[c->view.inert.n]         = k >= 0 && c->unknown[k] ? k : -1;
      c->inert.local_body[c->view.inert.n++] = -1;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintListBodyNodes(Constraint c)
{
  PetscInt n = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->view.loc->nnode_all; i++) n += c->node_body[i] >= 0 || c->relative[i] >= 0;
  PetscCall(ArrayReserve(n, &c->body_node_capacity, &c->body_node, sizeof(*c->body_node), NULL));
  c->view.body_node   = c->body_node;
  c->view.nbody_nodes = 0;
  for (PetscInt i = 0; i < c->view.loc->nnode_all; i++)
    if (c->node_body[i] >= 0 || c->relative[i] >= 0) c->body_node[c->view.nbody_nodes++] = i;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConstraintCollectRelative(Constraint c)
{
  const MeshLocal *l = c->view.loc;

  PetscFunctionBeginUser;
  c->view.relative_rows.n = 0;
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscInt k = c->relative[i];

    if (k < 0 || c->node_body[i] >= 0 || !c->unknown[k]) continue;
    PetscCall(ArrayReserve(c->view.relative_rows.n + l->dim, &c->relative_rows.capacity, &c->relative_rows.slot,
                           sizeof(*c->relative_rows.slot), &c->relative_rows.body, sizeof(*c->relative_rows.body),
                           &c->relative_rows.coef, c->view.nr * sizeof(*c->relative_rows.coef), NULL));
    for (PetscInt a = 0; a < l->dim; a++) {
      PetscReal *row = c->relative_rows.coef + c->view.relative_rows.n * c->view.nr;

      if ((c->fixed[i] >> a) & 1) continue;
      unknown_row(c, i, a, k, row);
      c->relative_rows.slot[c->view.relative_rows.n]   = i * l->dim + a;
      c->relative_rows.body[c->view.relative_rows.n++] = k;
    }
  }
  c->view.relative_rows = (ConstraintRows){.n    = c->view.relative_rows.n,
                                           .slot = c->relative_rows.slot,
                                           .body = c->relative_rows.body,
                                           .coef = c->relative_rows.coef};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal ConstraintGetPrescribed(Constraint c, PetscInt i, PetscInt a)
{
  const PetscBool fixed = (PetscBool)((c->fixed[i] >> a) & 1);
  const PetscInt  k     = c->node_body[i] >= 0                                       ? c->node_body[i]
                        : fixed || c->relative[i] < 0 || !c->unknown[c->relative[i]] ? -1
                                                                                     : c->relative[i];
  PetscReal       row[6], v = 0;

  if (k < 0) return fixed ? c->value[i * c->view.loc->dim + a] : 0;
  if (c->slip && c->node_body[i] >= 0) v = c->slip[i * c->view.loc->dim + a];
  map_row(c->view.loc, i, a, c->X[k], row);
  for (PetscInt s = 0; s < c->view.nr; s++)
    if (!ConstraintIsUnknown(&c->view, k, s)) v += row[s] * c->U[k * c->view.nr + s];
  return v;
}

PetscErrorCode ConstraintRigidMap(Constraint c, PetscInt i, PetscInt k, PetscReal R[])
{
  PetscFunctionBeginUser;
  ConstraintRigidAt(c->view.loc, i, c->X[k], R);
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ConstraintRigidAt(const MeshLocal *l, PetscInt i, const PetscReal X[3], PetscReal R[])
{
  for (PetscInt a = 0; a < l->dim; a++) map_row(l, i, a, X, R + a * RigidSize(l->dim));
}
