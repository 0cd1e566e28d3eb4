/* Couple: the bodies that this rank knows, in the arrays of the coupling and in the constraint. Bodies that are spread
   (bodies/local.h) go to their owners before every step, and k then stands for others: what a step needs of the one
   before goes with them, all else is filled anew. */
#include "compat.h"
#include "impl.h"
#include "bodies/local.h"

PetscErrorCode CoupleFindReach(Mesh mesh, Bodies bodies, PetscInt *reach)
{
  const BoundaryMethod *method;

  PetscFunctionBeginUser;
  PetscCall(BoundaryMethodChoose(&method));
  *reach = method->reach;
  if (method->spread) PetscCall((*method->spread)(mesh, bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleSetSubdomains(Mesh mesh, Bodies bodies, PetscInt reach)
{
  BodyBoxes boxes = {0};

  PetscFunctionBeginUser;
  if (BodiesComm(bodies) == PETSC_COMM_SELF) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MeshCover(mesh, reach, &boxes.n, &boxes.box, &boxes.beyond));
  PetscCall(MeshCreateCurve(mesh, &boxes.curve));
  PetscCall(BodiesSetBoxes(bodies, &boxes));
  PetscCall(PetscFree(boxes.box));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Slots for the own bodies of the fullest rank: a function of where the bodies are, so that a restart has as many. */
static PetscErrorCode choose_slots(Couple c, PetscInt *slots, PetscBool *small)
{
  PetscInt  capacity, count;
  PetscReal max[2] = {0, 0}; /* own bodies; does a rank know more than there is capacity for? */

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetCapacity(c->constraint, &capacity, &count));
  for (PetscInt k = 0; k < c->s->n; k++) max[0] += c->s->own[k];
  max[1] = c->s->n > capacity;
  PetscCall(BodiesMax(c->bodies, 2, max));
  *slots = ConstraintSlots(c->comm, c->s->nall);
  *small = (PetscBool)(max[1] > 0);
  while (*slots < max[0]) *slots *= 2;
  if (!c->renewed) *slots = PetscMax(*slots, count);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleUpdateLocalBodies(Couple c)
{
  PetscInt     slots = 0, *which;
  PetscMPIInt *rank;
  PetscBool    small = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (BodiesComm(c->bodies) == PETSC_COMM_SELF) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(choose_slots(c, &slots, &small));
  if (small || slots != c->slots) {
    c->slots = slots;
    PetscCall(FlowSolverDestroy(&c->solver));
    PetscCall(ConstraintDestroy(&c->constraint));
    PetscCall(CoupleCreateConstraint(c));
    PetscCall(CoupleCreateSolver(c));
  }
  c->renewed = PETSC_FALSE;
  PetscCall(PetscMalloc2(c->s->n, &rank, c->s->n, &which));
  PetscCall(BodiesGetOwners(c->bodies, rank, which));
  PetscCall(ConstraintSetLocal(c->constraint, c->s->n, rank, which));
  PetscCall(PetscFree2(rank, which));
  PetscCall(PetscInfo(NULL, "couple: %" PetscInt_FMT " bodies known\n", c->s->n));
  PetscCall(CoupleDescribeBodies(c));
  c->method.others          = PETSC_TRUE;
  c->method.inactive_inside = NULL; /* until they are drawn */
  PetscFunctionReturn(PETSC_SUCCESS);
}
