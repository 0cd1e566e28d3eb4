/* Contact, end of a step of the flow: gaps are read, and bodies that overlap are moved apart.

   Bodies that meet in the same cut cells have no fluid between them there: the flow answers their contact force with an
   equal one, and a pair that overlaps stays so however stiff the law is (runs/studies/contact). So the places are
   projected on those without overlap: the smallest sum of m |dx|^2 under the linearised gaps, by Gauss-Seidel over the
   pairs, as Maury (2006, Numer. Math. 102, 649) does with velocities. Velocities stay, and so does the momentum; a pair
   moves apart about its common centre of mass. Bodies move, they do not turn: pairs that cannot travel along their
   normal are left to the law. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"

#define OVERLAP  1e-3 /* that may be left, in radii of the smaller body */
#define MARGIN   0.05 /* gaps watched during the sweeps, in radii of the smaller body */
#define SWEEPS   200
#define RENEWALS 5

static PetscReal smaller_radius(Contact c, const Pair *p)
{
  const PetscReal r = ContactKind(c, p->i)->radius;

  return p->j >= 0 ? PetscMin(r, ContactKind(c, p->j)->radius) : r;
}

/* Gap of a pair and the direction from its partner to body i, that of the deepest point */
static PetscErrorCode find_gap(Contact c, const Pair *p, PetscReal normal[3], PetscReal *gap)
{
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(ContactFindTouch(c, p->i, p->j, &n, gap));
  for (PetscInt k = 0; k < n; k++)
    if (c->touch[k].gap <= *gap) PetscCall(PetscArraycpy(normal, c->touch[k].normal, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same where a body slides: its mobility is a tensor, not one number an axis */
static void push_along(Contact c, const Pair *p, const PetscReal normal[3], PetscReal gap)
{
  PetscReal way[2][3] = {{0}}, inverse;

  ContactMobility(c, p->i, normal, way[0]);
  if (p->j >= 0) ContactMobility(c, p->j, normal, way[1]);
  inverse = dot3(way[0], normal) + dot3(way[1], normal);
  if (inverse <= 1e-3 / ContactKind(c, p->i)->mass) return;
  for (PetscInt a = 0; a < 3; a++) {
    c->x[p->i][a] -= gap / inverse * way[0][a];
    if (p->j >= 0) c->x[p->j][a] += gap / inverse * way[1][a];
  }
}

static PetscBool slides(Contact c, PetscInt k)
{
  return (PetscBool)(k >= 0 && BodiesGetGroup(c->state, k)->motion.has_slide);
}

/* Move a pair apart by its overlap; returns the overlap in radii of the smaller body */
static PetscErrorCode push_apart(Contact c, const Pair *p, PetscReal *overlap)
{
  const Kind *ki = ContactKind(c, p->i), *kj = p->j >= 0 ? ContactKind(c, p->j) : NULL;
  PetscReal   normal[3] = {0, 0, 0}, gap, inverse = 0;

  PetscFunctionBeginUser;
  *overlap = 0;
  PetscCall(find_gap(c, p, normal, &gap));
  if (gap >= 0) PetscFunctionReturn(PETSC_SUCCESS);
  if (slides(c, p->i) || slides(c, p->j)) {
    push_along(c, p, normal, gap);
    *overlap = -gap / smaller_radius(c, p);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt a = 0; a < 3; a++) inverse += (ki->inverse_mass[a] + (kj ? kj->inverse_mass[a] : 0)) * normal[a] * normal[a];
  if (inverse <= 1e-3 * (kj ? PetscMin(1 / ki->mass, 1 / kj->mass) : 1 / ki->mass)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < 3; a++) {
    c->x[p->i][a] -= gap / inverse * ki->inverse_mass[a] * normal[a];
    if (kj) c->x[p->j][a] += gap / inverse * kj->inverse_mass[a] * normal[a];
  }
  *overlap = -gap / smaller_radius(c, p);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The gaps of all bodies; pairs that overlap, or may come to during the sweeps; the largest overlap, in radii */
static PetscErrorCode look_at_pairs(Contact c, PetscInt close[], PetscInt *nclose, PetscReal *worst)
{
  PetscReal normal[3], gap;

  PetscFunctionBeginUser;
  *nclose = 0;
  *worst  = 0;
  for (PetscInt k = 0; k < c->s->n; k++) c->s->gap[k] = PETSC_MAX_REAL;
  for (PetscInt p = 0; p < c->npairs; p++) {
    const Pair     *pair = &c->pair[p];
    const PetscReal r    = smaller_radius(c, pair);

    PetscCall(find_gap(c, pair, normal, &gap));
    ContactNoteGap(pair, gap, c->s->gap);
    if (gap < MARGIN * r) close[(*nclose)++] = p;
    *worst = PetscMax(*worst, -gap / r);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode sweep_pairs(Contact c, const PetscInt close[], PetscInt nclose)
{
  PetscReal worst = 1, overlap;

  PetscFunctionBeginUser;
  for (PetscInt sweep = 0; sweep < SWEEPS && worst > OVERLAP; sweep++) {
    worst = 0;
    for (PetscInt p = 0; p < nclose; p++) {
      PetscCall(push_apart(c, &c->pair[close[p]], &overlap));
      worst = PetscMax(worst, overlap);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactFinishStep(Contact c)
{
  PetscInt *close, nclose;
  PetscReal worst;

  PetscFunctionBeginUser;
  if (!c->have_list) PetscFunctionReturn(PETSC_SUCCESS); /* no law, no bodies */
  PetscCall(PetscLogEventBegin(TB_CONTACT, 0, 0, 0, 0));
  c->x = c->s->x;
  c->q = c->s->q;
  PetscCall(PetscFree(c->reach)); /* nobody moves further in this step */
  PetscCall(ContactFindPairs(c));
  PetscCall(PetscMalloc1(c->npairs, &close));
  PetscCall(look_at_pairs(c, close, &nclose, &worst));
  c->separation = PetscMax(c->separation, 0.5 * worst);
  for (PetscInt i = 0; i < RENEWALS && c->separate && worst > OVERLAP; i++) {
    PetscCall(sweep_pairs(c, close, nclose));
    PetscCall(ContactFindPairs(c));
    PetscCall(look_at_pairs(c, close, &nclose, &worst));
  }
  PetscCall(PetscFree(close));
  PetscCall(PetscLogEventEnd(TB_CONTACT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
