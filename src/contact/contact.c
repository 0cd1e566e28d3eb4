/* Contact: the object, its options, and the questions about it, see contact.h. Steps in step.c and alone.c, what they
   share in momentum.c; laws in law.c, search in search.c, geometry in touch.c. */
#include "compat.h"
#include "bond.h"
#include "cohesion.h"
#include "impl.h"
#include "base/opt.h"
#include "base/array.h"

/* ---- the start ---- */

static PetscBool can_travel(Contact c, PetscInt k)
{
  return (PetscBool)(k >= 0 && (BodiesGetGroup(c->state, k)->free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z)) != 0);
}

static PetscErrorCode refuse_overlap(Contact c, const Pair *p, PetscReal overlap)
{
  const BodyGroup *i = BodiesGetGroup(c->state, p->i), *j = p->j >= 0 ? BodiesGetGroup(c->state, p->j) : NULL;
  char             partner[128];
  const char      *name;

  PetscFunctionBeginUser;
  if (j)
    (void)snprintf(partner, sizeof(partner), "body %" PetscInt_FMT " of group '%s'", BodiesIndexInGroup(c->state, p->j),
                   j->name);
  else {
    PetscCall(ContactGetWallName(c, -1 - p->j, &name));
    (void)snprintf(partner, sizeof(partner), "wall '%s'", name);
  }
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
          "Body %" PetscInt_FMT
          " of group '%s' overlaps %s by %g at the start, where its centre is %g,%g,%g: move one of them (-particle_%s_position, _lower, _upper, _margin, _table)",
          BodiesIndexInGroup(c->state, p->i), i->name, partner, (double)overlap, (double)c->x[p->i][0],
          (double)c->x[p->i][1], (double)c->x[p->i][2], i->name);
}

/* Pairs within the range remember that they began there */
static PetscErrorCode remember_start(Contact c)
{
  PetscFunctionBeginUser;
  c->list.remembers = PETSC_TRUE;
  if (!c->list.slip) PetscCall(PetscCalloc1(c->list.n + 1, &c->list.slip));
  for (PetscInt k = 0; k < c->list.n; k++) {
    PetscInt  n;
    PetscReal gap;

    PetscCall(ContactFindTouch(c, c->list.pair[k].i, c->list.pair[k].j, &n, &gap));
    c->list.slip[k][3] = PetscMax(0, c->range - gap);
    if (c->cohesion && c->cohesion->law->latches) c->list.slip[k][3] *= -1; /* they touch */
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCheckStart(Contact c)
{
  PetscBool found = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(ContactMigrate(c, 0, NULL));
  PetscCall(ContactCheckInside(c));
  c->x = c->s->x;
  c->q = c->s->q;
  PetscCall(PetscFree(c->list.reach));
  PetscCall(ContactCheckImages(c, PETSC_TRUE));
  PetscCall(BodiesAttach(c->bodies, sizeof(*c->began_deep), (void **)&c->began_deep));
  PetscCall(ContactCheckDriven(c, PETSC_TRUE));
  PetscCall(ContactFindPairs(c));
  for (PetscInt k = 0; k < c->list.n; k++) {
    const Pair *p = &c->list.pair[k];
    PetscInt    n;
    PetscReal   gap;

    if (!can_travel(c, p->i) && !can_travel(c, p->j)) continue;
    PetscCall(ContactFindTouch(c, p->i, p->j, &n, &gap));
    if (c->s->own[p->i] && gap < -1e-6 * ContactKind(c, p->i)->radius) PetscCall(refuse_overlap(c, p, -gap));
    found = (PetscBool)(found || gap < c->range);
  }
  PetscCall(BodiesAny(c->bodies, &found));
  if (found && c->law->impulses) PetscCall(remember_start(c));
  PetscCall(ContactStartBonds(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- energy ---- */

PetscErrorCode ContactCountWork(Contact c, PetscReal dt)
{
  const BodyArrays *s = c->s;
  PetscMPIInt       rank;

  PetscFunctionBeginUser;
  if (!s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallMPI(MPI_Comm_rank(BodiesComm(c->bodies), &rank));
  if (rank) c->work = 0; /* the first rank begins with what all have */
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal force[3], torque[3];

    PetscCall(ContactGetMean(c, k, force, torque, NULL));
    for (PetscInt a = 0; a < 3 && c->bonds; a++) {
      force[a] += c->bonds->force[k][a];
      torque[a] += c->bonds->force[k][3 + a];
    }
    for (PetscInt a = 0; a < 3 && s->own[k]; a++)
      c->work += 0.5 * dt * (force[a] * (s->u[k][a] + s->u_old[k][a]) + torque[a] * (s->w[k][a] + s->w_old[k][a]));
  }
  PetscCall(BodiesSum(c->bodies, 1, &c->work));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetEnergy(Contact c, PetscReal *stored, PetscReal *work)
{
  Exact     sum   = {{0}, 0, 0};
  PetscReal bonds = 0;

  PetscFunctionBeginUser;
  *work = c->work;
  if (!stored) PetscFunctionReturn(PETSC_SUCCESS);
  if (c->bonds) PetscCall(BondGetEnergy(c, &bonds));
  *stored = bonds;
  if (!c->list.valid) PetscFunctionReturn(PETSC_SUCCESS); /* nothing has been near anything */
  c->x = c->s->x;
  c->q = c->s->q;
  for (PetscInt p = 0; p < c->list.n; p++) {
    PetscReal energy;

    if (ContactIsBonded(c, p)) continue;
    if (!c->s->own[c->list.pair[p].i]) continue;
    PetscCall(ContactPairEnergy(c, p, &energy));
    ExactAdd(&sum, energy);
  }
  PetscCall(ExactGetSum(BodiesComm(c->bodies), &sum, stored));
  *stored += bonds;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- questions ---- */

PetscErrorCode ContactGetRange(Contact c, PetscReal *range)
{
  PetscFunctionBeginUser;
  *range = c->range;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetWork(Contact c, PetscInt *tests, PetscInt *pairs, PetscInt *substeps)
{
  PetscFunctionBeginUser;
  if (tests) *tests = c->count.tests;
  if (pairs) *pairs = c->count.near;
  if (substeps) *substeps = c->count.substeps;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetSeparation(Contact c, PetscReal *overlap)
{
  PetscFunctionBeginUser;
  *overlap = c->separation.largest;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetLinks(Contact c, PetscInt *n, ContactLink *link[])
{
  PetscInt capacity = 0;

  PetscFunctionBeginUser;
  *n    = 0;
  *link = NULL;
  c->x  = c->s->x;
  c->q  = c->s->q;
  PetscCall(PetscFree(c->list.reach));
  PetscCall(ContactFindPairs(c));
  for (PetscInt p = 0; p < c->list.n; p++) {
    const Touch *best = NULL;
    PetscInt     m;
    PetscReal    gap;

    if (!c->s->own[c->list.pair[p].i]) continue;
    PetscCall(ContactFindTouch(c, c->list.pair[p].i, c->list.pair[p].j, &m, &gap));
    for (PetscInt t = 0; t < m; t++)
      if (c->touch[t].gap < c->range && (!best || c->touch[t].gap < best->gap)) best = &c->touch[t];
    if (!best) continue;
    PetscCall(ArrayReserve(*n + 1, &capacity, link, sizeof(**link), NULL));
    (*link)[*n] = (ContactLink){.i = c->s->number[c->list.pair[p].i], .j = c->list.pair[p].j, .gap = best->gap};
    if (c->list.pair[p].j >= 0) (*link)[*n].j = c->s->number[c->list.pair[p].j];
    for (PetscInt a = 0; a < 3; a++) {
      (*link)[*n].x[a]      = c->x[c->list.pair[p].i][a] + best->ri[a];
      (*link)[*n].normal[a] = best->normal[a];
    }
    (*n)++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactIsImplicit(Contact c, PetscBool *implicit)
{
  PetscFunctionBeginUser;
  *implicit = c->repulsive.implicit;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactView(Contact c, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer, "contact: law %s, range %g, walls", c->law->name, (double)c->range));
  PetscCall(ContactViewWalls(c, viewer));
  if (c->film.wanted)
    PetscCall(PetscViewerASCIIPrintf(viewer, "  lubrication below gap %g, roughness %g, viscosity %g\n",
                                     (double)c->film.begin, (double)c->film.roughness, (double)c->fluid.viscosity));
  for (PetscInt g = 0; g < c->s->ngroups; g++) {
    const BodyGroup *group = &c->s->group[g];
    PetscReal        top   = 0;

    if (!group->count) continue;
    for (PetscInt i = 0; i < c->kinds.n; i++)
      if (c->kinds.kind[i].group == g) top = PetscMax(top, c->kinds.kind[i].terminal);
    PetscCall(BodiesMax(c->bodies, 1, &top));
    PetscCall(PetscViewerASCIIPrintf(viewer, "  group %s: terminal speed scale %g, %" PetscInt_FMT " surface points\n",
                                     group->name, (double)top, c->kinds.npoints[g]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- creation ---- */

static PetscErrorCode check_scale(Contact c)
{
  PetscReal top = 0;

  PetscFunctionBeginUser;
  PetscCall(ContactFastest(c, &c->spring.speed));
  for (PetscInt i = 0; i < c->kinds.n; i++) top = PetscMax(top, c->kinds.kind[i].terminal);
  PetscCall(BodiesMax(c->bodies, 1, &top));
  c->spring.speed = PetscMax(c->spring.speed, top);
  PetscCheck(c->law->lookahead != 1 || c->spring.stiffness > 0 || c->spring.speed > 0 || !c->s->nall || c->cohesion,
             PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_law %s finds no scale for its stiffness (no buoyancy, no initial velocity): give -contact_spring_stiffness",
             c->law->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies in a box: all but kinds, which go by the fluid */
static PetscErrorCode create_without_kinds(Bodies bodies, const PetscReal lower[3], const PetscReal upper[3],
                                           Contact *contact)
{
  Contact c;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  c->bodies = bodies;
  PetscCall(BodiesGetState(bodies, &c->state));
  PetscCall(BodiesGetArrays(bodies, &c->s));
  c->dim = c->s->dim;
  for (PetscInt a = 0; a < c->dim; a++) {
    c->domain.lower[a] = lower[a];
    c->domain.upper[a] = upper[a];
  }
  PetscCall(PetscCalloc1(c->s->ngroups, &c->kinds.point));
  PetscCall(PetscCalloc1(c->s->ngroups, &c->kinds.npoints));
  PetscCall(BodiesAttach(bodies, sizeof(*c->speed.of_body), (void **)&c->speed.of_body));
  *contact = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCreateBare(Bodies bodies, const PetscReal lower[3], const PetscReal upper[3], Contact *contact)
{
  Contact c;

  PetscFunctionBeginUser;
  PetscCall(create_without_kinds(bodies, lower, upper, &c));
  c->law = contact_laws[0];
  c->x   = c->s->x;
  c->q   = c->s->q;
  PetscCall(ContactCreateKinds(c));
  *contact = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCreate(Bodies bodies, PetscReal h, PetscReal rho_f, const PetscReal gravity[3],
                             const PetscReal lower[3], const PetscReal upper[3], PetscInt walls, Contact *contact)
{
  Contact c;

  PetscFunctionBeginUser;
  PetscCheck(h > 0 && rho_f >= 0, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "Contact needs a positive cell size and a fluid density, not %g and %g", (double)h, (double)rho_f);
  PetscCall(create_without_kinds(bodies, lower, upper, &c));
  c->h             = h;
  c->fluid.density = rho_f;
  c->domain.sides  = walls;
  PetscCall(ContactSetGravity(c, gravity));
  PetscCall(ContactReadLaws(c));
  PetscCall(OptInt("-contact_substeps", &c->substeps));
  c->impulse.scheme    = (ContactScheme){.weight = 1, .theta = 1, .implicit = PETSC_TRUE};
  c->separation.wanted = PETSC_TRUE;
  if (c->s->nall) PetscCall(OptBool("-contact_remove_overlap", &c->separation.wanted));
  PetscCall(ContactCreateCohesion(c));
  PetscCall(ContactCreateKinds(c));
  PetscCall(ContactCheckCohesion(c));
  PetscCall(ContactCreateBonds(c));
  PetscCall(ContactCreatePoints(c, CONTACT_MAX_POINTS));
  PetscCall(check_scale(c));
  if (c->dim == 3) PetscCall(BodiesAttach(bodies, sizeof(*c->inverse_inertia), (void **)&c->inverse_inertia));
  *contact = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactSetPeriod(Contact c, const PetscReal period[3])
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < c->dim; a++) c->domain.period[a] = period[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactSetGravity(Contact c, const PetscReal gravity[])
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < c->dim; a++) c->g[a] = gravity[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactSetViscosity(Contact c, PetscReal viscosity)
{
  PetscFunctionBeginUser;
  c->fluid.viscosity = viscosity;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactSetFilmGapOffset(Contact c, PetscReal offset)
{
  PetscFunctionBeginUser;
  if (!c->film.wanted || c->dim == 2) PetscFunctionReturn(PETSC_SUCCESS);
  c->film.offset = c->film.step_offset = offset;
  c->film.begin                        = (offset > 0 ? FILM_OPEN : 1) * c->film.range;
  c->horizon                           = PetscMax(c->range, c->film.begin);
  PetscCall(ContactCheckCohesion(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactDestroy(Contact *contact)
{
  Contact c = *contact;

  PetscFunctionBeginUser;
  if (!c) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt g = 0; g < c->s->ngroups; g++) PetscCall(PetscFree(c->kinds.point[g]));
  PetscCall(PetscFree(c->kinds.point));
  PetscCall(PetscFree(c->kinds.kind));
  PetscCall(PetscFree(c->kinds.of_body));
  PetscCall(PetscFree(c->kinds.npoints));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->speed.of_body));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->began_deep));
  PetscCall(ContactForgetAtOnce(c));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->copy.x));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->copy.q));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->copy.u));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->copy.w));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->inverse_inertia));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->guided));
  PetscCall(ContactDestroyBonds(c));
  PetscCall(PetscFree(c->cohesion));
  PetscCall(PetscFree(c->list.pair));
  PetscCall(PetscFree(c->list.slip));
  PetscCall(PetscFree(c->springs.spring));
  PetscCall(ContactForgetSlips(c, &c->list.carried));
  PetscCall(ContactForgetSlips(c, &c->kept.slips));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->kept.force));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->impulse.mean));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->impulse.mean_next));
  PetscCall(BodiesDetach(c->bodies, (void **)&c->impulse.shift));
  PetscCall(PetscFree(c->list.listed));
  PetscCall(PetscFree(c->list.reach));
  PetscCall(PetscFree(*contact));
  PetscFunctionReturn(PETSC_SUCCESS);
}
