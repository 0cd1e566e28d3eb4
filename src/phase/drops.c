/* Drops: see phase/drops.h. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/array.h"
#include "base/log.h"
#include "base/opt.h"
#include "shape/host.h"
#include "shape/material.h"

#define FINE      20 /* edges of the curve at the start in a cell's length */
#define MIN_EDGES 64 /* such edges of a drop */
#define MAX_EDGES 2000
#define WAVE      0.289 /* 6^(1/3)/(2 pi): of a wave, as sigma k^3 is 6 sigma/R^3 */
#define TOLD      0.999 /* of its volume: with less of it in the domain it is told, */
#define NOTHING   1e-6  /* and with less than this there is none */

/* ---- options ---- */

static PetscErrorCode read_material(DropGroup *g)
{
  static const char *const COALESCENCE[] = {"film", "never", NULL};
  char                     name[OPT_NAME];
  PetscInt                 never = 0;
  PetscBool                given;

  PetscFunctionBeginUser;
  g->density = 1;
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_density", name), &g->density));
  g->viscosity = 0; /* the fluid's */
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_viscosity", name), &g->viscosity));
  PetscCall(OptHas(OptJoin("-particle_", g->name, "_surface_tension", name), &given));
  PetscCheck(given, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "Group '%s' is a fluid and has no surface tension: give %s",
             g->name, name);
  PetscCall(OptReal(name, &g->tension));
  PetscCall(OptHas(OptJoin("-particle_", g->name, "_contact_angle", name), &g->wets));
  PetscCall(OptReal(name, &g->contact));
  PetscCall(OptChoice(OptJoin("-particle_", g->name, "_coalescence", name), COALESCENCE, &never));
  g->never = (PetscBool)(never == 1);
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_film", name), &g->film));
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_drainage", name), &g->drainage));
  PetscCheck(!g->never || (g->film == 0 && g->drainage == 0), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_coalescence never: its drops do not merge, whatever the film: remove -particle_%s_film and _drainage",
             g->name, g->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode list_groups(Drops d)
{
  ParticleGroup *list;

  PetscFunctionBeginUser;
  PetscCall(ParticleListGroups(MATERIAL_FLUID, MATERIAL_FLUID, &d->s.ngroups, &list));
  PetscCall(PetscCalloc1(d->s.ngroups, &d->group));
  for (PetscInt g = 0; g < d->s.ngroups; g++)
    PetscCall(PetscStrncpy(d->group[g].name, list[g].name, sizeof(d->group[g].name)));
  PetscCall(PetscFree(list));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* How it is turned, in space about an axis */
static PetscErrorCode read_turn(DropGroup *g, PetscInt dim, PetscReal angle)
{
  const PetscReal c = PetscCosReal(angle), s = PetscSinReal(angle), about_z[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
  PetscReal       axis[3] = {0, 0, 1}, q[4] = {1, 0, 0, 0};
  Placement       place = {.angle = angle};

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(g->turn, about_z, 9));
  if (dim == 2) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ParticleReadTurn(g->name, axis, NULL, q, NULL));
  PlaceTurn(axis, q, &place);
  RotationMatrix(place.q, g->turn);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where it is at the start: a region, or a shape at a place */
static PetscErrorCode read_place(Drops d, PetscInt g, PetscInt dim)
{
  DropGroup *group = d->group + g;
  ShapeMass  mass;
  char       name[OPT_NAME], shape[OPT_NAME];
  PetscReal  constant = 0, angle;
  PetscBool  region, both;

  PetscFunctionBeginUser;
  d->s.drop[g] = (Drop){.number = g, .group = g};
  PetscCall(ExprRead(OptJoin("-particle_", group->name, "_region", name), dim, 1, &constant, &group->region, &region));
  PetscCheck(!region || group->region, d->comm, PETSC_ERR_USER_INPUT,
             "%s %g is a number: give an expression of the position that is negative where the fluid is, as \"y - 1\"",
             name, (double)constant);
  PetscCall(OptHas(OptJoin("-particle_", group->name, "_shape", shape), &both));
  PetscCheck(!region || !both, d->comm, PETSC_ERR_USER_INPUT, "Group '%s' has %s and %s: remove one of them",
             group->name, name, shape);
  if (region) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ParticleCreateShape(group->name, dim, &group->shape));
  PetscCall(ParticleReadPosition(group->name, "drops", dim, group->x, &angle));
  PetscCall(read_turn(group, dim, angle));
  PetscCall(ShapeGetMass(group->shape, &mass));
  d->s.drop[g].target = mass.volume;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsCreate(MPI_Comm comm, PetscInt dim, Drops *drops)
{
  Drops d;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&d));
  d->comm       = comm;
  d->s.vanished = -1;
  *drops        = d;
  PetscCall(list_groups(d));
  if (!d->s.ngroups) {
    PetscCall(DropsDestroy(drops));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscCalloc1(d->s.ngroups, &d->s.drop));
  d->s.group = d->group;
  d->s.n = d->s.numbers = d->s.ngroups;
  for (PetscInt g = 0; g < d->s.ngroups; g++) {
    PetscCall(read_material(&d->group[g]));
    PetscCall(read_place(d, g, dim));
    PetscCheck(d->group[g].wets == d->group[0].wets, comm, PETSC_ERR_SUP,
               "Groups '%s' and '%s': one has a contact angle and one has none, so that walls would have to be wetted and not: give both "
               "-particle_<group>_contact_angle, or none",
               d->group[0].name, d->group[g].name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsDestroy(Drops *drops)
{
  Drops d = *drops;

  PetscFunctionBeginUser;
  if (!d) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt g = 0; g < d->s.ngroups; g++) {
    PetscCall(ShapeDestroy(&d->group[g].shape));
    PetscCall(ExprDestroy(&d->group[g].region));
  }
  PetscCall(PetscFree(d->group));
  PetscCall(PetscFree(d->s.drop));
  PetscCall(PetscFree(d->s.pair));
  PetscCall(PhaseInterfaceDestroy(&d->s.interface));
  PetscCall(PetscFree(*drops));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsGetState(Drops d, DropsState **state)
{
  PetscFunctionBeginUser;
  *state = &d->s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsGetRadius(Drops d, PetscInt group, const MeshLocal *l, PetscReal *radius)
{
  const DropGroup *g = d->group + group;
  PetscReal        depth;
  ShapeMass        mass;

  PetscFunctionBeginUser;
  *radius = PETSC_MAX_REAL;
  for (PetscInt a = 0; a < l->dim && g->region; a++)
    *radius = PetscMin(*radius, WAVE * (l->period[a] > 0 ? l->period[a] : 2 * (l->upper[a] - l->lower[a])));
  if (g->region) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ShapeGetMass(g->shape, &mass));
  PetscCall(ShapeDistance(g->shape, 1, mass.centroid, &depth));
  *radius = PetscSqrtReal(mass.volume / PETSC_PI);
  if (depth < 0) *radius = PetscMin(*radius, -depth);
  PetscFunctionReturn(PETSC_SUCCESS);
}

void DropsSetCarried(Drops d, PetscInt group, PetscInt like)
{
  d->group[group].carries = like;
}

PetscErrorCode DropsView(Drops d, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < d->s.ngroups; g++)
    PetscCall(PetscViewerASCIIPrintf(viewer, "drop group '%s': density %g, viscosity %g, surface tension %g\n",
                                     d->group[g].name, (double)d->group[g].density, (double)d->group[g].viscosity,
                                     (double)d->group[g].tension));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the start ---- */

/* Points of the surface, an even number *n, in space: x [*n][2], the caller's to free */
static PetscErrorCode sample(const DropGroup *g, PetscReal h, PetscInt *n, PetscReal **x)
{
  const PetscReal c = g->turn[0], s = g->turn[3];
  PetscReal       first[2 * MIN_EDGES], weight[MIN_EDGES], length = 0, *w;
  ShapeMass       mass;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetMass(g->shape, &mass));
  PetscCall(ShapeSurface(g->shape, MIN_EDGES, first, weight));
  for (PetscInt i = 0; i < MIN_EDGES; i++) length += weight[i];
  *n = 2 * (PetscInt)PetscMin(MAX_EDGES, PetscMax(MIN_EDGES, FINE * length / h));
  PetscCall(PetscMalloc1(2 * *n, x));
  PetscCall(PetscMalloc1(*n, &w));
  PetscCall(ShapeSurface(g->shape, *n, *x, w));
  PetscCall(PetscFree(w));
  for (PetscInt i = 0; i < *n; i++) {
    const PetscReal r[2] = {(*x)[2 * i] - mass.centroid[0], (*x)[2 * i + 1] - mass.centroid[1]};

    (*x)[2 * i]     = g->x[0] + c * r[0] - s * r[1];
    (*x)[2 * i + 1] = g->x[1] + s * r[0] + c * r[1];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal area_of(PetscInt n, const PetscReal x[])
{
  PetscReal sum = 0;

  for (PetscInt i = 0, j = n - 1; i < n; j = i++) sum += 0.5 * (x[2 * j] * x[2 * i + 1] - x[2 * j + 1] * x[2 * i]);
  return sum;
}

/* Of n points of a line round a shape, those beyond or near a side that it does not wet go to where a film of a cell
   begins; those that then coincide are left out, an even number stays */
static PetscInt cut_short(const PhaseBox *box, PetscInt n, PetscReal x[])
{
  PetscInt m = 0;

  for (PetscInt i = 0; i < n; i++) {
    PetscReal y[2];

    for (PetscInt a = 0; a < 2; a++) {
      const PetscBool bound = (PetscBool)(box->period[a] == 0);

      y[a] = x[2 * i + a];
      if (bound && !(box->wets >> 2 * a & 1)) y[a] = PetscMax(y[a], box->lower[a] + box->h);
      if (bound && !(box->wets >> (2 * a + 1) & 1)) y[a] = PetscMin(y[a], box->upper[a] - box->h);
    }
    if (m && y[0] == x[2 * m - 2] && y[1] == x[2 * m - 1]) continue;
    x[2 * m]     = y[0];
    x[2 * m + 1] = y[1];
    m++;
  }
  while (m > 1 && x[0] == x[2 * m - 2] && x[1] == x[2 * m - 1]) m--;
  return m - m % 2;
}

/* Does any of it lie beyond a side of the box? */
static PetscBool reaches_out(const PhaseBox *box, PetscInt n, const PetscReal x[])
{
  for (PetscInt i = 0; i < 2 * n; i++) {
    const PetscInt a = i % 2;

    if (box->period[a] == 0 && (x[i] < box->lower[a] || x[i] > box->upper[a])) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* Edges of a closed line of n points, every second one a middle */
static PetscErrorCode add_line(PetscInt g, PetscInt n, const PetscReal x[], Edges *to)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(to->n + n / 2, &to->capacity, &to->edge, sizeof(*to->edge), NULL));
  for (PetscInt k = 0; k < n / 2; k++) {
    PhaseEdge *e = to->edge + to->n++;

    e->drop = (PetscReal)g;
    e->wall = 0;
    for (PetscInt j = 0; j < 3; j++) {
      const PetscInt at = (2 * k + j) % n;

      e->key[j][0] = (PetscReal)(j == 1 ? g : at);
      e->key[j][1] = (PetscReal)(j == 1 ? k : g);
      for (PetscInt a = 0; a < 2; a++) e->x[j][a] = x[2 * at + a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode shape_field(void *group, PetscInt n, const PetscReal x[], PetscReal value[])
{
  const DropGroup *g = (const DropGroup *)group;
  const PetscReal  c = g->turn[0], s = g->turn[3];
  PetscReal       *r;
  ShapeMass        mass;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetMass(g->shape, &mass));
  PetscCall(PetscMalloc1(2 * n, &r));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal d[2] = {x[2 * i] - g->x[0], x[2 * i + 1] - g->x[1]};

    r[2 * i]     = mass.centroid[0] + c * d[0] + s * d[1];
    r[2 * i + 1] = mass.centroid[1] - s * d[0] + c * d[1];
  }
  PetscCall(ShapeDistance(g->shape, n, r, value));
  PetscCall(PetscFree(r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode region_field(void *group, PetscInt n, const PetscReal x[], PetscReal value[])
{
  PetscFunctionBeginUser;
  PetscCall(ExprEvaluate(((const DropGroup *)group)->region, 0, n, x, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Error: the edges from `begin` on, of group g, run along a side that is none, or that it may not wet */
static PetscErrorCode check_sides(Drops d, PetscInt g, const PhaseBox *box, const Edges *all, PetscInt begin)
{
  PetscFunctionBeginUser;
  for (PetscInt e = begin; e < all->n; e++)
    for (PetscInt a = 0; a < 2; a++) {
      const PhaseEdge *edge  = all->edge + e;
      const PetscBool  upper = (PetscBool)(edge->x[0][a] > 0.5 * (box->lower[a] + box->upper[a]));

      if (edge->wall == 0 || edge->x[0][a] != edge->x[2][a]) continue;
      PetscCheck(box->period[a] == 0, d->comm, PETSC_ERR_SUP,
                 "-particle_%s_region reaches over a period of the mesh, which drops given by a region cannot yet: remove -mesh_periodic, or keep the region inside",
                 d->group[g].name);
      PetscCheck(box->wets >> (2 * a + upper) & 1, d->comm, PETSC_ERR_USER_INPUT,
                 "The fluid '%s' reaches the side %c = %g of the domain, which it does not wet: keep it a cell away from there, or give -particle_%s_contact_angle, "
                 "and that side -flow_bc_<boundary>_type slip",
                 d->group[g].name, "xy"[a], (double)edge -> x[0][a], d -> group[g].name);
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_group(Drops d, PetscInt g, const PhaseBox *box, Edges *all)
{
  DropGroup     *group = d->group + g;
  const PetscInt begin = all->n;
  PetscReal     *x     = NULL;
  PetscInt       n     = 0;

  PetscFunctionBeginUser;
  if (group->shape) {
    PetscReal whole, left;

    PetscCall(sample(group, box->h, &n, &x));
    whole = area_of(n, x);
    n     = cut_short(box, n, x);
    left  = area_of(n, x);
    if (left < TOLD * whole)
      PetscCall(
        LogRemark("the fluid '%s' reaches within a cell of a side of the domain that it does not wet: it is cut short there, and starts with %.4g of its "
                  "volume: move it (-particle_%s_position), or have it wet the side (-particle_%s_contact_angle)",
                  group->name, (double)(left / whole), group->name, group->name));
    if (left < NOTHING * whole) n = 0;
  }
  if (group->shape && !reaches_out(box, n, x)) PetscCall(add_line(g, n, x, all));
  else
    PetscCall(
      PhaseContourTrace(box, group->shape ? shape_field : region_field, group, g, &all->n, &all->capacity, &all->edge));
  PetscCall(PetscFree(x));
  PetscCheck(all->n > begin, d->comm, PETSC_ERR_USER_INPUT,
             "There is nothing of the fluid '%s' in the domain: see -particle_%s_%s", group->name, group->name,
             group->shape ? "position" : "region");
  PetscCall(check_sides(d, g, box, all, begin));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsStart(Drops d, const PhaseBox *box, PhaseCurve *curve)
{
  Edges all = {0};

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < d->s.ngroups; g++) PetscCall(add_group(d, g, box, &all));
  PetscCall(PhaseCurveGather(PETSC_COMM_SELF, all.n, all.edge, NULL, curve));
  PetscCall(PetscFree(all.edge));
  for (PetscInt k = 0; k < d->s.n; k++) {
    PhaseSums sums;

    PhaseCurveMeasure(curve, d->s.drop[k].number, &sums);
    d->s.drop[k].target = sums.area;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool DropsWet(const DropsState *s)
{
  return (PetscBool)(s->ngroups && s->group[0].wets);
}

/* ---- checkpoint ---- */

PetscErrorCode DropsVisitState(void *drops, State state)
{
  DropsState *s    = &((Drops)drops)->s;
  PetscInt    n[4] = {s->n, s->numbers, s->merged, s->broken}, *which;
  PetscReal  *value;
  PetscBool   has = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCall(StateInts(state, "counts", 4, n));
  if (StateIsLoading(state)) {
    s->n       = n[0];
    s->numbers = n[1];
    s->merged  = n[2];
    s->broken  = n[3];
    PetscCall(PetscFree(s->drop));
    PetscCall(PetscCalloc1(s->n, &s->drop));
  }
  PetscCall(StateReals(state, "lost", 1, &s->lost));
  if (StateIsLoading(state)) PetscCall(StateHas(state, "left", &has)); /* a checkpoint of before has none */
  if (has) PetscCall(StateInts(state, "left", 1, &s->left));
  if (has) PetscCall(StateReals(state, "left_volume", 1, &s->left_volume));
  if (StateIsLoading(state)) PetscCall(StateHas(state, "taken", &has));
  if (has) PetscCall(StateReals(state, "taken", 1, &s->taken));
  if (DropsMayStayApart(s)) PetscCall(DropsVisitPairs(s, state));
  PetscCall(PetscMalloc2(2 * s->n, &which, s->n, &value));
  for (PetscInt i = 0; i < s->n; i++) {
    which[2 * i]     = s->drop[i].number;
    which[2 * i + 1] = s->drop[i].group;
    value[i]         = s->drop[i].target;
  }
  PetscCall(StateInts(state, "drops", 2 * s->n, which));
  PetscCall(StateReals(state, "targets", s->n, value));
  for (PetscInt i = 0; i < s->n && StateIsLoading(state); i++)
    s->drop[i] = (Drop){.number = which[2 * i], .group = which[2 * i + 1], .target = value[i]};
  PetscCall(PetscFree2(which, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}
