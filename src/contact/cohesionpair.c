/* Contact, cohesion of a pair: what a law of cohesion.c makes of its gap. A pull is a dashpot without damping, beside
   those of the law of contact; a law that is elastic is split into what presses the bodies together (it is damped, and
   friction goes by it) and the pull.

   In sub-steps the force of a smooth stretch is that where the bodies are, as of all contact (leap-frog, which keeps
   the energy). Where it jumps, as contacts form and tear, it is the work over the way from half a sub-step before to
   half a sub-step after, over that way, which is that of the speeds before and after: so a pair alone gains and loses
   what the jump is worth, wherever in the sub-step it comes.

   A pair holds on from when its surfaces touch until they are farther apart than the reach. What a pair remembers of
   that is the sign of list.slip[3]: negative, it holds on. */
#include "compat.h"
#include "cohesion.h"

#define TRIALS   4      /* trials of the way of a sub-step */
#define SMALLEST 1e-300 /* in place of the zero of a pair that holds on */

PetscReal CohesionRadius(const Kind *i, const Kind *j)
{
  return j ? 1 / (1 / i->radius + 1 / j->radius) : i->radius;
}

PetscReal CohesionDiscRadius(const Kind *i, const Kind *j)
{
  return j ? 1 / (1 / i->disc + 1 / j->disc) : i->disc;
}

PetscBool CohesionHolds(Contact c, PetscInt p)
{
  return (PetscBool)(!c->cohesion->law->latches || c->list.slip[p][3] < 0);
}

static void set_holds(Contact c, PetscInt p, PetscBool holds)
{
  PetscReal *within = &c->list.slip[p][3];

  if (!c->cohesion->law->latches || holds == (PetscBool)(*within < 0)) return;
  *within = holds ? -PetscMax(*within, SMALLEST) : *within < -SMALLEST ? -*within : 0;
}

/* The narrowest place of the gap from the touches of a pair, t [n]; *R there */
static PetscErrorCode find_narrowest(Contact c, const Pair *p, PetscInt n, const Touch t[], Touch *at, PetscReal *R)
{
  const Kind *ki = ContactKind(c, p->i), *kj = p->j >= 0 ? ContactKind(c, p->j) : NULL;
  Curvature   k;

  PetscFunctionBeginUser;
  if (ki->disc > 0 && (kj ? kj->disc > 0 : !ContactIsPiece(p->j))) {
    *at = t[0];
    *R  = CohesionDiscRadius(ki, kj);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  ContactMeanTouch(n, t, at);
  PetscCall(ContactFindNarrowest(c, p->i, p->j, at, &k));
  *R = c->dim == 2 ? 1 / k.principal[0] : 1 / PetscSqrtReal(k.principal[0] * k.principal[1]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mean force over a sub-step h of a pair that approaches with w at separation s */
static PetscReal force_over_step(const struct _p_Cohesion *co, const Dashpot *dashpot, PetscReal R, PetscReal s,
                                 PetscReal w, PetscReal h, PetscBool *holds)
{
  const PetscBool before = *holds;
  PetscReal       force = 0, after = w;

  for (PetscInt i = 0; i < TRIALS; i++) {
    *holds = before;
    force  = CohesionMeanForce(co, R, s, s + 0.5 * h * w, s - 0.5 * h * after, holds);
    after  = w - h * dashpot->inverse_mass * force;
  }
  return force;
}

PetscErrorCode CohesionAddDashpots(Contact c, PetscInt p, const Dashpot *dashpot, PetscReal R, PetscReal s, PetscReal h,
                                   PetscInt *n, PetscReal *pressing, PetscReal *stiffness)
{
  const struct _p_Cohesion *co    = c->cohesion;
  const PetscReal           pull  = (*co->law->pull)(co, R);
  PetscBool                 holds = CohesionHolds(c, p);
  PetscReal                 force, push = 0;
  Meeting                   m;

  PetscFunctionBeginUser;
  force = force_over_step(co, dashpot, R, s, h > 0 ? ContactApproach(c, &c->list.pair[p], dashpot) : 0, h, &holds);
  if (h > 0) set_holds(c, p, holds);
  if (force == 0 && !(co->law->elastic && s < 0)) PetscFunctionReturn(PETSC_SUCCESS);
  if (co->law->latches) push = PetscMax(0, force + 2 * pull);
  else if (s < 0) push = PetscMax(0, force + pull);
  if (!co->law->elastic) push = 0;
  c->dashpot[*n]          = *dashpot;
  c->dashpot[*n].value    = force - push;
  c->dashpot[*n].rate     = 0;
  c->dashpot[(*n)++].film = PETSC_TRUE; /* friction does not go by it */
  if (push <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactFillMeeting(c, &c->list.pair[p], &m));
  *pressing             = push;
  *stiffness            = CohesionStiffness(co, R, s);
  c->dashpot[*n]        = *dashpot;
  c->dashpot[*n].value  = push;
  c->dashpot[*n].gap    = s + c->range;
  c->dashpot[*n].weight = 1;
  c->dashpot[*n].film   = PETSC_FALSE;
  c->dashpot[*n].rate   = 0;
  if (h > 0 && dashpot->inverse_mass > 0)
    c->dashpot[*n].rate = 2 * c->spring.damping_ratio *
                          PetscSqrtReal(5. / 6 * m.heavier * *stiffness / dashpot->inverse_mass);
  (*n)++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CohesionAddAtTouches(Contact c, PetscInt p, PetscInt touches, PetscReal within, PetscReal h, PetscInt *n,
                                    PetscReal *pressing, PetscReal *stiffness)
{
  const Pair *pair = &c->list.pair[p];
  PetscReal   R    = 0;
  Touch       at;
  Dashpot     dashpot = {0};

  PetscFunctionBeginUser;
  PetscCall(find_narrowest(c, pair, touches, c->touch, &at, &R));
  ContactPlaceDashpot(c, pair, &at, &dashpot);
  dashpot.has_levers = ContactTurns(c);
  PetscCall(CohesionAddDashpots(c, p, &dashpot, R, at.gap + within - c->range, h, n, pressing, stiffness));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CohesionPairEnergy(Contact c, PetscInt p, PetscInt n, const Touch t[], PetscReal within,
                                  PetscReal *energy)
{
  PetscReal R = 0;
  Touch     at;

  PetscFunctionBeginUser;
  PetscCall(find_narrowest(c, &c->list.pair[p], n, t, &at, &R));
  *energy = CohesionEnergy(c->cohesion, R, at.gap + within - c->range, CohesionHolds(c, p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CohesionPull(Contact c, PetscInt p, Dashpot *dashpot, PetscReal *s, PetscReal *pull)
{
  const struct _p_Cohesion *co    = c->cohesion;
  const Pair               *pair  = &c->list.pair[p];
  PetscBool                 holds = CohesionHolds(c, p);
  PetscInt                  n;
  PetscReal                 gap, R = 0;
  Touch                     at;

  PetscFunctionBeginUser;
  *pull = 0;
  PetscCall(ContactFindTouch(c, pair->i, pair->j, &n, &gap));
  if (gap >= c->horizon) {
    set_holds(c, p, PETSC_FALSE);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(find_narrowest(c, pair, n, c->touch, &at, &R));
  *s    = at.gap - c->range;
  *pull = -CohesionMeanForce(co, R, *s, *s, *s, &holds);
  set_holds(c, p, holds);
  ContactPlaceDashpot(c, pair, &at, dashpot);
  dashpot->has_levers = ContactTurns(c);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal CohesionSlope(Contact c, const Kind *i, const Kind *j)
{
  const struct _p_Cohesion *co    = c->cohesion;
  const PetscReal           slope = (*co->law->slope)(co, CohesionRadius(i, j));

  /* in the stiffness of the law, see its time */
  return c->law->impulses ? slope : 0.5 * c->range * slope;
}

PetscReal CohesionDepth(Contact c, const Pair *p)
{
  const struct _p_Cohesion *co = c->cohesion;
  const PetscReal           R  = CohesionRadius(ContactKind(c, p->i), p->j >= 0 ? ContactKind(c, p->j) : NULL);

  return PetscAbsReal((*co->law->energy)(co, R, 0)) + (*co->law->pull)(co, R) * c->range;
}
