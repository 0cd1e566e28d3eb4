/* Contact, kinds: what is common to the bodies of one group, size and density that this rank knows. One kind for all
   bodies of a group that are alike; of a group of many sizes or densities each body has its own. */
#include "compat.h"
#include "bond.h"
#include "impl.h"
#include "base/array.h"

#define ALIKE 16 /* kinds of a group that a further body is compared with */

static PetscReal terminal_speed(Contact c, PetscReal radius, PetscReal density)
{
  /* 2 Vol/A of a disc, a sphere */
  const PetscReal d = 2 * radius, height = c->dim == 2 ? PETSC_PI / 2 * d : 4. / 3. * d;
  /* without a fluid: a fall of some diameters */
  const PetscReal excess = PetscAbsReal(density - c->fluid.density) / PetscMax(c->fluid.density, 0.1 * density);

  if (excess < 1e-6) return 0; /* meant to be neutrally buoyant */
  return PetscSqrtReal(height * excess * PetscSqrtReal(dot3(c->g, c->g)));
}

/* That of body b */
static void fill_kind(Contact c, PetscInt b, Kind *k)
{
  const BodyGroup *g = BodiesGetGroup(c->state, b);

  k->group    = c->s->body_group[b];
  k->moves    = g->free ? PETSC_TRUE : PETSC_FALSE;
  k->mass     = ContactMass(c, b);
  k->density  = c->s->density[b];
  k->scale    = c->s->scale[b];
  k->radius   = BodiesGetRadius(c->state, b);
  k->disc     = BodiesGetDisc(c->state, b);
  k->terminal = terminal_speed(c, k->radius, c->s->density[b]);
  for (PetscInt a = 0; a < c->dim; a++)
    if (g->free & (BODY_FREE_X << a)) k->inverse_mass[a] = 1 / k->mass;
  if (g->free & BODY_FREE_ROTATION)
    k->inverse_moment = 1 / (PetscPowRealInt(k->scale, c->dim + 2) * g->mass.inertia[2] *
                             (c->s->density[b] + 0.1 * c->fluid.density));
}

static void pack_kinds(Contact c)
{
  for (PetscInt i = 0; i < c->kinds.n; i++) {
    Kind *k = &c->kinds.kind[i];

    k->moves = c->s->group[k->group].pack.wanted;
    if (!k->moves) continue;
    k->scale *= c->packed_size;
    k->radius *= c->packed_size;
    k->disc *= c->packed_size;
  }
}

PetscErrorCode ContactCreateKinds(Contact c)
{
  const BodyArrays *s     = c->s;
  PetscInt          first = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscRealloc(PetscMax(1, s->n) * sizeof(*c->kinds.of_body), &c->kinds.of_body));
  c->kinds.n = 0;
  for (PetscInt b = 0; b < s->n; b++) {
    PetscInt i = c->kinds.n - 1, oldest;

    if (!b || s->body_group[b] != s->body_group[b - 1]) first = c->kinds.n;
    oldest = PetscMax(first, c->kinds.n - ALIKE);
    while (i >= oldest && (s->scale[b] != c->kinds.kind[i].scale || s->density[b] != c->kinds.kind[i].density)) i--;
    if (i < oldest) {
      PetscCall(ArrayReserve(c->kinds.n + 1, &c->kinds.capacity, &c->kinds.kind, sizeof(*c->kinds.kind), NULL));
      i = c->kinds.n++;
      PetscCall(PetscMemzero(&c->kinds.kind[i], sizeof(c->kinds.kind[i])));
      fill_kind(c, b, &c->kinds.kind[i]);
    }
    c->kinds.of_body[b] = i;
  }
  if (c->packed_size > 0) pack_kinds(c);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactUpdateLocalBodies(Contact c)
{
  PetscFunctionBeginUser;
  if (c->bonds) c->bonds->listed = PETSC_FALSE;
  PetscCall(ContactCreateKinds(c));
  ContactCopyPoints(c);
  ContactScaleKinds(c);
  c->x = c->s->x;
  c->q = c->s->q;
  c->u = c->s->u;
  c->w = c->s->w;
  PetscCall(ContactSetInertias(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}
