/* Couple: forces of contact that are solved with the flow (contact/contact.h: ContactSpring). A spring that parts with
   the speed v = sum over its two bodies of row . U, row its unit force on the rigid slots of a body, is its value on
   the right of these rows and a tie of its rate in the matrix. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/room.h"
#include "bodies/local.h"
#include "bodies/mass.h"

PetscErrorCode CoupleSetContact(Couple c, PetscInt n, const ContactSpring spring[])
{
  PetscFunctionBeginUser;
  PetscCall(RoomFor(n, &c->spring_room, &c->spring, sizeof(*c->spring), &c->tie, sizeof(*c->tie), &c->pushed, sizeof(*c->pushed), NULL));
  if (n) PetscCall(PetscArraycpy(c->spring, spring, n));
  c->nspring = n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleTellPartners(Couple c)
{
  PetscInt(*pair)[2];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->nspring, &pair));
  for (PetscInt i = 0; i < c->nspring; i++) {
    pair[i][0] = c->spring[i].i;
    pair[i][1] = PetscMax(-1, c->spring[i].j);
  }
  PetscCall(ConstraintSetPairs(c->constraint, c->nspring, (const PetscInt(*)[2])pair));
  PetscCall(PetscFree(pair));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The tie of a spring, all rows filled */
static PetscErrorCode make_tie(Couple c, const ContactSpring *s, BodyTie *tie)
{
  PetscFunctionBeginUser;
  *tie = (BodyTie){.body = {s->i, PetscMax(-1, s->j)}, .stiffness = s->rate};
  for (PetscInt side = 0; side < 2; side++) {
    const PetscInt k = tie->body[side];
    PetscReal      force[3], torque[3];

    if (k < 0) continue;
    for (PetscInt a = 0; a < 3; a++) force[a] = side ? -s->normal[a] : s->normal[a];
    cross(side ? s->rj : s->ri, force, torque);
    PetscCall(RigidReduceForce(c->bodies, k, c->q[k], force, torque, tie->row[side]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Speed at which a tie's bodies part by their known velocities, and by those that are not known yet */
static PetscReal parting_speed(Couple c, const BodyTie *tie, PetscBool of_unknown)
{
  PetscReal speed = 0;

  for (PetscInt side = 0; side < 2; side++) {
    const PetscInt k = tie->body[side];

    for (PetscInt i = 0; i < c->nr && k >= 0; i++)
      if (of_unknown || !((c->unknown[k] >> i) & 1)) speed += tie->row[side][i] * c->U[k * c->nr + i];
  }
  return speed;
}

/* To the right-hand side of the rigid rows */
static void add_force(Couple c, const BodyTie *tie, PetscReal force)
{
  for (PetscInt e = 0; e < 2 * c->nr; e++)
    if (tie->body[e / c->nr] >= 0) c->g[tie->body[e / c->nr] * c->nr + e % c->nr] += force * tie->row[e / c->nr][e % c->nr];
}

PetscErrorCode CoupleAddTies(Couple c)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->nspring; i++) {
    PetscCall(make_tie(c, &c->spring[i], &c->tie[i]));
    c->pushed[i] = c->spring[i].value - c->spring[i].rate * parting_speed(c, &c->tie[i], PETSC_FALSE);
    add_force(c, &c->tie[i], c->pushed[i]);
  }
  PetscCall(FlowSolverSetTies(c->solver, c->nspring, c->tie));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleTakeTies(Couple c)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->nspring; i++) {
    const PetscReal force = c->spring[i].value - c->spring[i].rate * parting_speed(c, &c->tie[i], PETSC_TRUE);

    add_force(c, &c->tie[i], force - c->pushed[i]);
    c->pushed[i] = force;
  }
  PetscCall(BodiesUpdateGhosts(c->bodies, c->nr, c->g));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetContact(Couple c, const PetscReal *force[])
{
  PetscFunctionBeginUser;
  *force = c->pushed;
  PetscFunctionReturn(PETSC_SUCCESS);
}
