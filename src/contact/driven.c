/* Contact, driven: bodies whose way is prescribed, which nothing can stop. Such a body that comes to lie in a wall or
   in another one leaves the fluid no room that any pressure could make: the run stops and says which. What lay there at
   the start, such as a rod through a wall, may. */
#include "compat.h"
#include "impl.h"

#define DEEP 1e-2 /* in radii */

/* Nothing moves it but the scene */
static PetscBool is_prescribed(Contact c, PetscInt k)
{
  const BodyGroup *g   = BodiesGetGroup(c->state, k);
  const PetscInt   any = BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z | BODY_FREE_ROTATION;

  return (PetscBool)(!(g->free & any) && !g->obstacle && !g->body_fitted && !c->s->removed[k]);
}

/* Does it go somewhere or turn, and cannot be stopped? */
static PetscBool is_driven(Contact c, PetscInt k)
{
  return (PetscBool)(is_prescribed(c, k) && (dot3(c->s->u[k], c->s->u[k]) > 0 || dot3(c->s->w[k], c->s->w[k]) > 0));
}

static PetscErrorCode measure_depth(Contact c, PetscInt i, PetscInt j, PetscReal *depth)
{
  PetscInt  n;
  PetscReal gap;

  PetscFunctionBeginUser;
  PetscCall(ContactFindTouch(c, i, j, &n, &gap));
  *depth = -gap;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The deepest of the walls and other driven bodies that body i lies in; *depth 0: none */
static PetscErrorCode find_deepest(Contact c, PetscInt i, PetscInt *partner, PetscReal *depth)
{
  const PetscReal radius = ContactKind(c, i)->radius;
  const PetscInt *piece;
  PetscInt        npiece = 0;
  PetscReal       deep   = 0;

  PetscFunctionBeginUser;
  *depth = 0;
  if (c->domain.wall.border) PetscCall(BorderFindNear(c->domain.wall.border, c->x[i], radius, &npiece, &piece));
  for (PetscInt w = 0; w < CONTACT_SIDES + npiece; w++) {
    const PetscInt j = w < CONTACT_SIDES ? -1 - w : -1 - CONTACT_SIDES - piece[w - CONTACT_SIDES];

    if (w < CONTACT_SIDES && !(c->domain.sides >> w & 1)) continue;
    PetscCall(measure_depth(c, i, j, &deep));
    if (deep > *depth) *partner = j;
    *depth = PetscMax(*depth, deep);
  }
  for (PetscInt j = 0; j < c->s->n; j++) {
    PetscReal d[3];

    if (j == i || !(is_prescribed(c, j) || BodiesGetGroup(c->state, j)->obstacle)) continue;
    for (PetscInt a = 0; a < 3; a++) d[a] = c->x[i][a] - c->x[j][a];
    ContactWrap(c, d);
    if (dot3(d, d) >= PetscSqr(radius + ContactKind(c, j)->radius)) continue;
    PetscCall(measure_depth(c, i, j, &deep));
    if (deep > *depth) *partner = j;
    *depth = PetscMax(*depth, deep);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode refuse_overlap(Contact c, PetscInt i, PetscInt j, PetscReal depth)
{
  const BodyGroup *g = BodiesGetGroup(c->state, i);
  char             partner[128];
  const char      *name;

  PetscFunctionBeginUser;
  if (j >= 0)
    (void)snprintf(partner, sizeof(partner), "body %" PetscInt_FMT " of group '%s', which cannot give way",
                   BodiesIndexInGroup(c->state, j), BodiesGetGroup(c->state, j)->name);
  else {
    PetscCall(ContactGetWallName(c, -1 - j, &name));
    (void)snprintf(partner, sizeof(partner), "wall '%s'", name);
  }
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
          "Body %" PetscInt_FMT
          " of group '%s' moves into %s: at t = %g it lies %g deep in it, at %g,%g,%g. Its motion is prescribed "
          "(-particle_%s_motion*, _velocity): end the run before (-sim_time), or change the motion",
          BodiesIndexInGroup(c->state, i), g->name, partner, (double)c->state->time, (double)depth, (double)c->x[i][0],
          (double)c->x[i][1], (double)c->x[i][2], g->name);
}

PetscErrorCode ContactCheckDriven(Contact c, PetscBool start)
{
  PetscFunctionBeginUser;
  c->x = c->s->x;
  c->q = c->s->q;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscInt  partner = 0;
    PetscReal depth;

    if (!c->s->own[k] || !is_driven(c, k) || (!start && c->began_deep && c->began_deep[k])) continue;
    PetscCall(find_deepest(c, k, &partner, &depth));
    if (depth <= DEEP * ContactKind(c, k)->radius) continue;
    if (!start) PetscCall(refuse_overlap(c, k, partner, depth));
    c->began_deep[k] = PETSC_TRUE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
