/* Couple, carry: the residual that the solve of a step leaves is added to the right-hand side of the next
   (FlowSolverGetResidualImpulse), so that errors of single steps do not add up (runs/studies/flow-solver, "Residual
   carried to the next step"). With a penalty only: where nodes are rigid, residuals sit beside surfaces that move on,
   and a body would receive what belongs to a node there. */
#include "compat.h"
#include "impl.h"
#include "bodies/local.h"
#include "flow/device.h"

#define SURE 3 /* steps before the residual of the last one says something */

struct _p_Carry {
  /* momentum of the last step [nnode_all][dim], and of the bodies' own inertia [n][nr]; that of this one,
     [nnode][dim] and [n][nr]. nodes NULL: nothing is carried. */
  PetscReal *nodes, *nodes_next, *U, *U_next;
  PetscReal *there, *there_next; /* nodes and nodes_next of steps whose fields stay on a device, there; NULL so far */
  PetscBool  is_there;           /* the last step's */
  /* left: of FlowSolverGetLeft in the last step; steps so far; those whose residual was dropped, since a new mesh
     followed or it was too large. Reals alone: they are visited as an array. */
  struct {
    PetscReal left, steps, meshes, large;
  } residue;
};

/* Does a step leave the next one something? */
static PetscBool carries(Couple c)
{
  PetscBool free = PETSC_FALSE;

  for (PetscInt g = 0; g < c->s->ngroups; g++) free = (PetscBool)(free || c->s->group[g].free);
  return (PetscBool)(free && c->implicit && c->method.table->own_velocities);
}

/* The force of a body is that of its equation with the velocities of the step, without the residual: what the body
   receives then, the fluid gives */
static void add_to_bodies(Couple c, const struct _p_Carry *y, PetscReal factor)
{
  for (PetscInt i = 0; i < c->s->n * c->nr; i++) c->rigid.g[i] += factor * y->U[i];
}

static size_t node_bytes(Couple c)
{
  return (size_t)(c->loc->nnode * c->loc->dim) * sizeof(PetscReal);
}

/* The last step's momentum goes to where this step's fields are */
static PetscErrorCode place_momentum(Couple c, Carry y, PetscBool there)
{
  const DeviceQueue *q = FlowGetQueue(c->flow);

  PetscFunctionBeginUser;
  if (y->is_there == there) PetscFunctionReturn(PETSC_SUCCESS);
  if (!y->there) {
    PetscCall(DeviceTake(q, c->loc->nnode * c->loc->dim, NULL, &y->there));
    PetscCall(DeviceTake(q, c->loc->nnode * c->loc->dim, NULL, &y->there_next));
  }
  if (there) PetscCallDevice(q, (*q->run->upload)(q, node_bytes(c), y->nodes, y->there));
  else PetscCallDevice(q, (*q->run->download)(q, node_bytes(c), y->there, y->nodes));
  y->is_there = there;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Into the right-hand sides; how much to expect */
static PetscErrorCode add_residual(Couple c, void *data)
{
  Carry y = (Carry)data;

  PetscFunctionBeginUser;
  PetscCall(FlowSolverSetBefore(c->solver, y->residue.steps >= SURE ? y->residue.left : 0));
  if (!y->nodes || c->step->dt == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(place_momentum(c, y, FlowStaysOnDevice(c->flow)));
  if (y->is_there) PetscCall(FlowAddRhsOnDevice(c->flow, c->step->ct, y->there));
  for (PetscInt i = 0; i < c->loc->nnode * c->loc->dim && !y->is_there; i++)
    c->field.rhs[i] += c->step->ct * y->nodes[i];
  add_to_bodies(c, y, c->step->ct);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_residual(Couple c, void *data)
{
  Carry y = (Carry)data;

  PetscFunctionBeginUser;
  if (!y->nodes || c->step->dt == 0) PetscFunctionReturn(PETSC_SUCCESS);
  add_to_bodies(c, y, -c->step->ct);
  if (FlowStaysOnDevice(c->flow)) PetscCall(FlowSolverGetImpulseOnDevice(c->solver, y->there_next, y->U_next));
  else PetscCall(FlowSolverGetResidualImpulse(c->solver, y->nodes_next, y->U_next));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode accept_residual(Couple c, void *data)
{
  Carry      y    = (Carry)data;
  PetscReal *swap = y->there;
  PetscBool  solved;

  PetscFunctionBeginUser;
  if (y->is_there) {
    y->there      = y->there_next;
    y->there_next = swap;
  } else if (y->nodes) PetscCall(PetscArraycpy(y->nodes, y->nodes_next, c->loc->nnode * c->loc->dim));
  if (y->nodes) PetscCall(PetscArraycpy(y->U, y->U_next, c->s->n * c->nr));
  PetscCall(FlowSolverGetLeft(c->solver, &y->residue.left, &solved));
  y->residue.steps++;
  if (y->nodes && !solved) y->residue.large++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode connect_solver(Couple c, void *data, FlowSolver solver)
{
  PetscFunctionBeginUser;
  (void)data;
  PetscCall(FlowSolverSetCarry(solver, carries(c)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode discard(Couple c, void *data)
{
  Carry y = (Carry)data;

  PetscFunctionBeginUser;
  PetscCall(DeviceFree(FlowGetQueue(c->flow), &y->there));
  PetscCall(DeviceFree(FlowGetQueue(c->flow), &y->there_next));
  y->is_there = PETSC_FALSE;
  PetscCall(PetscFree2(y->nodes, y->nodes_next));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Zeros: nothing is carried to a new mesh */
static PetscErrorCode make_on_mesh(Couple c, void *data, Mesh *old)
{
  Carry y = (Carry)data;

  PetscFunctionBeginUser;
  (void)old;
  if (carries(c))
    PetscCall(PetscCalloc2(c->loc->nnode_all * c->loc->dim, &y->nodes, c->loc->nnode * c->loc->dim, &y->nodes_next));
  if (y->nodes && y->residue.steps > 0) y->residue.meshes++;
  PetscCall(PetscArrayzero(y->U, c->s->n * c->nr));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit(Couple c, void *data, State state)
{
  Carry     y = (Carry)data;
  PetscBool has;
  BodyRows  rows;

  PetscFunctionBeginUser;
  PetscCall(BodiesBeginRows(c->bodies, &rows));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "owed", c->nr, y->U));
  PetscCall(BodiesEndRows(&rows));
  PetscCall(StateHas(state, "residue", &has));
  if (has) PetscCall(StateReals(state, "residue", 4, &y->residue.left));
  PetscCall(StateHas(state, "momentum_owed", &has));
  if (y->nodes && has) PetscCall(place_momentum(c, y, PETSC_FALSE));
  if (y->nodes && has) PetscCall(StateNodes(state, "momentum_owed", c->loc->dim, y->nodes));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Couple c, void *data)
{
  Carry y = (Carry)data;

  PetscFunctionBeginUser;
  PetscCall(BodiesDetach(c->bodies, (void **)&y->U));
  PetscCall(BodiesDetach(c->bodies, (void **)&y->U_next));
  PetscCall(PetscFree(c->carry));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant CARRY = {.name         = "carry",
                                        .start        = add_residual,
                                        .solved       = find_residual,
                                        .advance      = accept_residual,
                                        .connect      = connect_solver,
                                        .discard      = discard,
                                        .after_remesh = make_on_mesh,
                                        .visit        = visit,
                                        .destroy      = destroy};

PetscErrorCode CoupleAddCarry(Couple c)
{
  const size_t slots = (size_t)c->nr * sizeof(PetscReal);

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c->carry));
  PetscCall(BodiesAttach(c->bodies, slots, (void **)&c->carry->U));
  PetscCall(BodiesAttachWork(c->bodies, slots, (void **)&c->carry->U_next));
  PetscCall(CoupleAddParticipant(c, &CARRY, c->carry));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetDropped(Couple c, PetscReal *meshes, PetscReal *residuals)
{
  PetscFunctionBeginUser;
  *meshes    = c->carry->residue.meshes;
  *residuals = c->carry->residue.large;
  PetscFunctionReturn(PETSC_SUCCESS);
}
