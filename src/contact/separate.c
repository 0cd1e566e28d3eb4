/* Contact, end of a step of the flow: gaps are read, and bodies that overlap are moved apart.

   Bodies that meet in the same cut cells have no fluid between them there: the flow answers their contact force with an
   equal one, and a pair that overlaps stays so however stiff the law is (runs/studies/contact). So the places are
   projected on those without overlap: the smallest sum of m |dx|^2 under the linearised gaps, as Maury (2006, Numer.
   Math. 102, 649) does with velocities, by sweeps in which all pairs act at once: a body takes part in each of its
   pairs with an equal fraction of its mass, as in atonce.c, so that no sweep makes more overlap than it takes away, and
   any number of ranks gives the same bits. Velocities stay, and so does the momentum; a pair moves apart about its
   common centre of mass. Bodies move, they do not turn: pairs that cannot travel along their normal are left to the
   law. */
#include "compat.h"
#include "bond.h"
#include "impl.h"
#include "base/log.h"

#define OVERLAP  1e-3 /* that may be left, in radii of the smaller body */
#define MARGIN   0.05 /* gaps watched during the sweeps, in radii of the smaller body */
#define SWEEPS   200
#define BORNE    0.25 /* of the range that a pair of law spring began within */
#define RENEWALS 5
#define FIXED    1e-3 /* mobility of a pair along its normal, by that of its lighter body, below which it stays */

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

/* A pair that overlaps: the direction to body i, and how far bodies i and j move along it, or as they slide, under a
   unit force */
typedef struct {
  PetscReal gap, normal[3], of_i, of_j, mobility[2][3];
} Overlap;

/* Overlap that is the law's to bear: a pair that began at a gap of nothing carries loads below it */
static PetscReal allowance(Contact c, const Pair *p)
{
  return c->list.slip ? BORNE * PetscAbsReal(c->list.slip[p - c->list.pair][3]) : 0;
}

static PetscErrorCode find_overlap(Contact c, const Pair *p, Overlap *o)
{
  PetscFunctionBeginUser;
  *o = (Overlap){0};
  PetscCall(find_gap(c, p, o->normal, &o->gap));
  o->gap += allowance(c, p);
  if (o->gap >= 0) PetscFunctionReturn(PETSC_SUCCESS);
  ContactMobility(c, p->i, o->normal, o->mobility[0]);
  if (p->j >= 0) ContactMobility(c, p->j, o->normal, o->mobility[1]);
  o->of_i = dot3(o->mobility[0], o->normal);
  o->of_j = dot3(o->mobility[1], o->normal);
  if (o->of_i + o->of_j <= FIXED * (p->j >= 0 ? PetscMin(1 / ContactKind(c, p->i)->mass, 1 / ContactKind(c, p->j)->mass)
                                              : 1 / ContactKind(c, p->i)->mass))
    o->gap = 0;
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
  for (PetscInt p = 0; p < c->list.n; p++) {
    const Pair     *pair = &c->list.pair[p];
    const PetscReal r    = ContactSmallerRadius(c, pair);

    if (ContactIsBonded(c, p)) continue;
    PetscCall(find_gap(c, pair, normal, &gap));
    ContactNoteGap(pair, gap, c->s->gap);
    if (gap < MARGIN * r) close[(*nclose)++] = p;
    *worst = PetscMax(*worst, -(gap + allowance(c, pair)) / r);
  }
  PetscCall(BodiesMax(c->bodies, 1, worst));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* npair [n]: pairs in which a body overlaps; displacement [n]: its sum of theirs. worst: the largest overlap before, in
   radii of the smaller body */
static PetscErrorCode sweep_once(Contact c, const PetscInt close[], PetscInt nclose, Overlap *overlap,
                                 PetscReal (*npair)[3], PetscReal (*displacement)[3], PetscReal *worst)
{
  const PetscInt n = c->s->n;

  PetscFunctionBeginUser;
  *worst = 0;
  PetscCall(PetscArrayzero(npair, n));
  PetscCall(PetscArrayzero(displacement, n));
  for (PetscInt m = 0; m < nclose; m++) {
    const Pair *p = &c->list.pair[close[m]];

    PetscCall(find_overlap(c, p, &overlap[m]));
    if (overlap[m].gap >= 0) continue;
    npair[p->i][0]++;
    if (p->j >= 0) npair[p->j][0]++;
    *worst = PetscMax(*worst, -overlap[m].gap / ContactSmallerRadius(c, p));
  }
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, npair));
  for (PetscInt m = 0; m < nclose; m++) {
    const Pair    *p = &c->list.pair[close[m]];
    const Overlap *o = &overlap[m];
    PetscReal      shift;

    if (o->gap >= 0) continue;
    shift = -o->gap / (o->of_i * npair[p->i][0] + (p->j >= 0 ? o->of_j * npair[p->j][0] : 0));
    for (PetscInt a = 0; a < c->dim; a++) {
      displacement[p->i][a] += shift * o->mobility[0][a];
      if (p->j >= 0) displacement[p->j][a] -= shift * o->mobility[1][a];
    }
  }
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, displacement));
  for (PetscInt k = 0; k < n; k++)
    for (PetscInt a = 0; a < c->dim; a++) c->x[k][a] += displacement[k][a];
  PetscCall(BodiesMax(c->bodies, 1, worst));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode sweep_pairs(Contact c, const PetscInt close[], PetscInt nclose)
{
  const PetscInt n     = c->s->n;
  PetscReal      worst = 1;
  Overlap       *overlap;
  PetscReal(*npair)[3], (*displacement)[3];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(nclose, &overlap, n, &npair, n, &displacement));
  for (PetscInt sweep = 0; sweep < SWEEPS && worst > OVERLAP; sweep++)
    PetscCall(sweep_once(c, close, nclose, overlap, npair, displacement, &worst));
  PetscCall(PetscFree3(overlap, npair, displacement));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode separate_pairs(Contact c)
{
  PetscInt *close, nclose;
  PetscReal worst;

  PetscFunctionBeginUser;
  PetscCall(ContactAcceptForces(c));
  c->x = c->s->x;
  c->q = c->s->q;
  PetscCall(PetscFree(c->list.reach)); /* nobody moves further in this step */
  PetscCall(ContactFindPairs(c));
  PetscCall(PetscMalloc1(c->list.n, &close));
  PetscCall(look_at_pairs(c, close, &nclose, &worst));
  c->separation.largest = PetscMax(c->separation.largest, 0.5 * worst);
  for (PetscInt i = 0; i < RENEWALS && c->separation.wanted && worst > OVERLAP; i++) {
    PetscCall(sweep_pairs(c, close, nclose));
    PetscCall(ContactFindPairs(c));
    PetscCall(look_at_pairs(c, close, &nclose, &worst));
  }
  PetscCall(PetscFree(close));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactFinishStep(Contact c)
{
  PetscFunctionBeginUser;
  PetscCall(ContactCheckImages(c, PETSC_FALSE));
  PetscCall(ContactCheckDriven(c, PETSC_FALSE));
  if (!c->list.valid && !c->bonds) PetscFunctionReturn(PETSC_SUCCESS); /* no law, no bodies */
  PetscCall(PetscLogEventBegin(TB_CONTACT, 0, 0, 0, 0));
  if (c->list.valid) PetscCall(separate_pairs(c));
  if (c->bonds) PetscCall(BondFinishStep(c, c->s->time, c->s->dt_old));
  PetscCall(PetscLogEventEnd(TB_CONTACT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
