/* Bodies: the options of the groups, see bodies.h; where the bodies of a group start.

   Every group is read by itself, and its bodies are placed singly, in rows or from a table (place.h). Random groups
   come last, because they keep clear of all others. The same on every rank; only tables are read by one rank. Does not
   know the state of the bodies, which is made from this in bodies.c. */
#include "compat.h"
#include "impl.h"
#include "joint.h"
#include "spread.h"
#include "base/algebra.h"
#include "base/log.h"
#include "base/opt.h"
#include "base/array.h"
#include "bodies/slip.h"
#include "shape/material.h"

#define MAX_COUNT 10000000 /* bodies that a fraction may ask for */
#define BETWEEN   ", []"   /* names of a list, as files and arguments have them */

/* What the options of a group say about the start of its bodies. */
typedef struct {
  PetscInt   place, count, seed;
  PetscReal  lower[3], upper[3], margin, fraction;
  Spread     spread;
  Placement  base; /* position, angle and velocities given for all bodies */
  PetscBool  has_position, has_count, has_fraction, has_density;
  char       table[PETSC_MAX_PATH_LEN];
  PetscBool  streams; /* no list of all its bodies is wanted */
  Placement *body;    /* [count of the group], or as in Placed */
  PetscInt   n, *number;
} Start;

/* ---- options of one group ---- */

static PetscErrorCode read_free(const char group[], PetscInt dim, const Motion *m, PetscBool held, PetscInt *bits)
{
  const char *const word[] = {"x", "y", "z", "rotation", "none", "all"};
  const PetscInt    mask[] = {BODY_FREE_X, BODY_FREE_Y,
                              BODY_FREE_Z, BODY_FREE_ROTATION,
                              0,           BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z | BODY_FREE_ROTATION};
  char              name[OPT_NAME], *list[16];
  PetscInt          n = 16;

  PetscFunctionBeginUser;
  (void)OptJoin("-particle_", group, "_free", name);
  *bits = m->has_pivot || m->has_hinge ? BODY_FREE_ROTATION : mask[5];
  if (m->given || m->has_slide || held) *bits = 0;
  PetscCall(OptStringArray(name, &n, list));
  if (n) *bits = 0;
  for (PetscInt i = 0; i < n; i++) {
    PetscInt k = 0;

    while (k < 6 && strcmp(list[i], word[k])) k++;
    PetscCheck(k < 6, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s: '%s' is not known (known: x, y, z, rotation, all, none)", name, list[i]);
    PetscCheck(k < 4 || n == 1, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s: '%s' stands alone, remove the other %" PetscInt_FMT " entries", name, list[i], n - 1);
    *bits |= mask[k];
    PetscCall(PetscFree(list[i]));
  }
  PetscCheck(!m->has_slide || !(*bits & ~BODY_FREE_ROTATION), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s names a translation, and -particle_%s_slide leaves only that along itself: give rotation or none, or remove the slide",
             name, group);
  if (m->has_slide) *bits |= BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z;
  if (dim == 2 && n && !m->has_slide && *bits != mask[5] && (*bits & BODY_FREE_Z))
    PetscCall(LogRemark("%s: z means nothing in two dimensions, and sets no motion free", name));
  if (dim == 2) *bits &= ~BODY_FREE_Z;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What is free is not prescribed, a pivot is not free, and stops need an axis that is held. */
static PetscErrorCode check_motion(const BodyGroup *g)
{
  const Motion     *m      = &g->motion;
  const char *const word[] = {"x", "y", "z", "rotation"};
  const PetscInt    moves  = g->free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z);

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 4; a++)
    PetscCheck(!(g->free >> a & 1) || !MotionChanges(m, a), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Group '%s': -particle_%s_%s prescribes %s, and -particle_%s_free sets it free: remove it from one of them",
               g->name, g->name,
               MotionOscillates(m, a) ? "motion"
               : a < 3                ? "velocity"
                                      : "angular_velocity",
               word[a], g->name);
  PetscCheck(!m->has_pivot || !moves, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s' turns about -particle_%s_pivot, which does not move freely: give -particle_%s_free rotation or none",
             g->name, g->name, g->name);
  PetscCheck(!g->obstacle || (!g->free && !m->given), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_obstacle true: the bodies of an obstacle stand still, and those of group '%s' move: remove it, or what moves them",
             g->name, g->name);
  PetscCheck(!m->has_hinge || (!moves && g->free), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_hinge needs a body that turns freely about a point: give -particle_%s_free rotation",
             g->name, g->name);
  PetscCheck(!m->has_slide || !m->given, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s' slides freely along -particle_%s_slide, and -particle_%s_motion prescribes its motion: remove one of them",
             g->name, g->name, g->name);
  PetscCheck(!m->has_stops || (!moves && g->free), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_stops needs a body that turns freely about a point: give -particle_%s_free rotation",
             g->name, g->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_start(BodyGroup *g)
{
  const char *const word[] = {"given", "fluid", NULL};
  char              name[OPT_NAME], other[OPT_NAME];
  PetscInt          start = 0;
  PetscBool         given;

  PetscFunctionBeginUser;
  PetscCall(OptChoice(OptJoin("-particle_", g->name, "_initial_velocity", name), word, &start));
  g->with_fluid = (PetscBool)(start == 1);
  for (PetscInt i = 0; i < 2 && g->with_fluid && !g->motion.given; i++) {
    PetscCall(OptHas(OptJoin("-particle_", g->name, i ? "_angular_velocity" : "_velocity", other), &given));
    PetscCheck(!given, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s fluid sets the velocities at the start, and %s gives one: remove one of them", name, other);
  }
  PetscCheck(!g->with_fluid || g->free, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s fluid: no degree of freedom of group '%s' is free to follow the fluid: remove it, or see -particle_%s_free",
             name, g->name, g->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* See bodies.h. Others fall, turn and slide as they are, contact and weight apart. */
static PetscBool is_guided(const BodyGroup *g)
{
  const Motion *m = &g->motion;

  return (PetscBool)(m->given || (g->free && (m->has_pivot || m->has_stops || JointActs(m))));
}

static PetscErrorCode read_shape(BodyGroup *g, PetscInt dim, Start *s)
{
  char name[OPT_NAME];

  PetscFunctionBeginUser;
  PetscCall(ParticleCreateShape(g->name, dim, &g->shape));
  PetscCall(ShapeGetMass(g->shape, &g->mass));
  PetscCall(ShapeGetRadius(g->shape, &g->radius));
  PetscCall(ShapeGetDisc(g->shape, &g->disc));
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_angle", name), &s->base.angle));
  if (PetscAbsReal(s->base.angle) > 2 * PETSC_PI)
    PetscCall(LogRemark("%s is %g rad, which is %.4g turns: degrees are written with their unit, as in %g deg", name,
                        (double)s->base.angle, (double)(s->base.angle / (2 * PETSC_PI)), (double)s->base.angle));
  PetscCall(MotionRead(g->name, dim, &g->motion, s->base.u, s->base.omega));
  PetscCall(OptBool(OptJoin("-particle_", g->name, "_obstacle", name), &g->obstacle));
  PetscCall(read_free(g->name, dim, &g->motion, g->obstacle, &g->free));
  PetscCall(check_motion(g));
  PetscCall(JointCheck(g->name, &g->motion, g->free));
  JointSetCentre(&g->motion, g->mass.centroid);
  g->guided = is_guided(g);
  for (PetscInt a = 0; a < dim && g->motion.has_pivot; a++) g->arm[a] = g->mass.centroid[a] - g->motion.pivot[a];
  PetscCall(read_start(g));
  PetscCall(BodySlipRead(g->name, dim, g->disc, &g->slip));
  PetscCheck(!g->slip || !(g->motion.has_pivot || g->motion.has_hinge || g->motion.has_slide), PETSC_COMM_SELF,
             PETSC_ERR_SUP,
             "-particle_%s_slip_* is for bodies without -particle_%s_pivot, _hinge or _slide: remove these, or the slip, and say what may move by "
             "-particle_%s_free",
             g->name, g->name, g->name);
  PetscCall(OptHas(OptJoin("-particle_", g->name, "_density", name), &s->has_density));
  g->density = 1;
  PetscCall(OptReal(name, &g->density));
  g->largest = 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Orientation of bodies in space: -particle_<g>_quaternion, then turned by the angle about -particle_<g>_axis (or the
   hinge, or z); a table may give each body its own */
static PetscErrorCode orient_bodies(BodyGroup *g, PetscInt dim, PetscInt n, Placement body[])
{
  PetscReal q[4] = {1, 0, 0, 0};
  PetscBool has_axis, has_q;

  PetscFunctionBeginUser;
  if (dim == 2) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArraycpy(g->motion.axis, g->motion.hinge, 3));
  PetscCall(ParticleReadTurn(g->name, g->motion.axis, &has_axis, q, &has_q));
  PetscCheck(!has_axis || !g->motion.has_hinge, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_axis: the angle of a body with -particle_%s_hinge is that about the hinge: remove it, or turn the body by -particle_%s_quaternion",
             g->name, g->name, g->name);
  for (PetscInt i = 0; i < n; i++) {
    const PetscBool own = (PetscBool)(body[i].has_axis || body[i].has_quaternion);

    PetscCheck(!body[i].has_axis || !g->motion.has_hinge, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "The angle of a body with -particle_%s_hinge is that about the hinge: remove the columns axis_x, axis_y, axis_z of its table, or turn the "
               "bodies by q_w, q_x, q_y, q_z",
               g->name);
    if (body[i].turned) continue; /* at random */
    if (own || has_axis || has_q || g->motion.has_hinge) PlaceTurn(g->motion.axis, q, body + i);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_place(const char group[], PetscInt dim, Start *s)
{
  char name[OPT_NAME];

  PetscFunctionBeginUser;
  PetscCall(OptChoice(OptJoin("-particle_", group, "_place", name), PLACE_NAMES, &s->place));
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_position", name), dim, s->base.x, &s->has_position));
  PetscCall(OptHas(OptJoin("-particle_", group, "_count", name), &s->has_count));
  PetscCall(OptInt(name, &s->count));
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_lower", name), dim, s->lower, NULL));
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_upper", name), dim, s->upper, NULL));
  PetscCall(OptReal(OptJoin("-particle_", group, "_margin", name), &s->margin));
  PetscCall(OptHas(OptJoin("-particle_", group, "_fraction", name), &s->has_fraction));
  PetscCall(OptReal(name, &s->fraction));
  PetscCall(OptInt(OptJoin("-particle_", group, "_seed", name), &s->seed));
  PetscCall(OptString(OptJoin("-particle_", group, "_table", name), s->table, sizeof(s->table)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of bodies that move; a table may have a column of densities */
static PetscErrorCode check_density(const BodyGroup *g, const Start *s)
{
  PetscFunctionBeginUser;
  PetscCheck(s->has_density || !g->free, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s' moves but has no density: give -particle_%s_density, or -particle_%s_free none", g->name,
             g->name, g->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_place(const BodyGroup *g, const Start *s)
{
  const char *place = PLACE_NAMES[s->place], *group = g->name;

  PetscFunctionBeginUser;
  if (s->place != PLACE_TABLE) PetscCall(check_density(g, s));
  PetscCheck(s->place == PLACE_TABLE || !s->table[0], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_table needs -particle_%s_place table", group, group);
  PetscCheck(s->place == PLACE_PACK || !s->has_fraction, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_fraction needs -particle_%s_place pack", group, group);
  PetscCheck(s->place != PLACE_SINGLE || !s->has_count || s->count == 1, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_count %" PetscInt_FMT " needs -particle_%s_place lattice, random, pack or table", group,
             s->count, group);
  PetscCheck(s->place != PLACE_SINGLE || s->has_position, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s' has no position: give -particle_%s_position, or another -particle_%s_place", group, group,
             group);
  PetscCheck(s->place == PLACE_SINGLE || !s->has_position, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_position has no meaning with -particle_%s_place %s: remove one of them", group, group,
             place);
  PetscCheck((s->place != PLACE_LATTICE && s->place != PLACE_RANDOM) || s->has_count, PETSC_COMM_SELF,
             PETSC_ERR_USER_INPUT, "-particle_%s_place %s needs -particle_%s_count", group, place, group);
  PetscCheck(s->place != PLACE_PACK || s->has_count != s->has_fraction, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_place pack needs either -particle_%s_count or -particle_%s_fraction, the share of the box to fill",
             group, group, group);
  PetscCheck(s->place == PLACE_SINGLE || s->place == PLACE_TABLE || !g->motion.has_pivot, PETSC_COMM_SELF,
             PETSC_ERR_USER_INPUT, "-particle_%s_pivot needs -particle_%s_place single or table, which place the pivot",
             group, group);
  PetscCheck(s->place != PLACE_TABLE || s->table[0], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_place table needs -particle_%s_table file.csv", group, group);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* -particle_<g>_motion names parts whose velocities have to come from somewhere; a table may give them */
static PetscErrorCode check_velocities(const BodyGroup *g, const Start *s)
{
  const Motion *m = &g->motion;

  PetscFunctionBeginUser;
  if (!m->named || s->place == PLACE_TABLE || m->track) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(!m->rotate || m->has_w, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_motion rotate turns the body with -particle_%s_angular_velocity, which is not given: give it in radians a time (2*pi/T is "
             "a turn in the time T), or remove rotate",
             g->name, g->name);
  PetscCheck(!m->constant || m->has_u || m->has_w, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_motion constant moves the body with -particle_%s_velocity, which is not given: give it, or for a body that stands still "
             "-particle_%s_free none",
             g->name, g->name, g->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode start_table(BodyGroup *g, PetscInt dim, Start *s)
{
  PetscBool sizes, densities, angles;

  PetscFunctionBeginUser;
  PetscCall(PlaceTable(s->table, dim, &s->base, &g->count, &s->body, &sizes, &densities, &angles));
  PetscCheck(!s->has_count || s->count == g->count, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_count is %" PetscInt_FMT ", the table %s has %" PetscInt_FMT " bodies: remove the option",
             g->name, s->count, s->table, g->count);
  PetscCheck(!sizes || s->spread.size.kind == SPREAD_SAME, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "The table %s gives the sizes of the bodies, and so does -particle_%s_sizes: remove one of them", s->table,
             g->name);
  PetscCheck(!densities || s->spread.density.kind == SPREAD_SAME, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "The table %s gives the densities of the bodies, and so does -particle_%s_densities: remove one of them",
             s->table, g->name);
  PetscCheck(!angles || !s->spread.turned, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "The table %s gives the orientations of the bodies, and -particle_%s_orientation random draws them: remove one of the two",
             s->table, g->name);
  if (!densities) PetscCall(check_density(g, s));
  for (PetscInt i = 0; i < g->count; i++) {
    if (s->body[i].radius > 0) s->body[i].scale = s->body[i].radius / g->radius;
    PetscCall(SpreadNext(g->name, dim, &s->spread, &s->body[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* How many bodies there are, and the size of the largest, from draws of which nothing is kept. A group that is to fill
   a share of its box gets bodies until one more would bring the volume further away from what is wanted. */
static PetscErrorCode draw_sizes(BodyGroup *g, PetscInt dim, Start *s)
{
  const Spread before = s->spread;
  PetscReal    box = 1, sum = 0;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < dim; a++) box *= s->upper[a] - s->lower[a];
  for (g->count = 0; s->has_fraction || g->count < s->count; g->count++) {
    Placement p = s->base;
    PetscReal volume;

    PetscCall(SpreadNext(g->name, dim, &s->spread, &p));
    volume = g->mass.volume * PetscPowRealInt(p.scale, dim);
    if (s->has_fraction && sum + 0.5 * volume > s->fraction * box) break;
    PetscCheck(!s->has_fraction || g->count < MAX_COUNT, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "-particle_%s_fraction %g needs more than %d bodies of volume %g: raise their size or make the box smaller",
               g->name, (double)s->fraction, MAX_COUNT, (double)g->mass.volume);
    g->largest = g->count ? PetscMax(g->largest, p.scale) : p.scale;
    sum += volume;
  }
  PetscCheck(g->count || !s->has_fraction, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_fraction %g is less than half a body: a body has %g of the box. Raise it, or make the bodies smaller",
             g->name, (double)s->fraction, (double)(g->mass.volume / box));
  s->spread = before;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ContactPack finds the places; until then bodies are anywhere in their box */
static PetscErrorCode begin_pack(BodyGroup *g, PetscInt dim, const Start *s)
{
  PetscFunctionBeginUser;
  g->pack = (Packing){.wanted = PETSC_TRUE, .turns = s->spread.turned, .margin = s->margin};
  PetscCheck(g->free, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_place pack moves the bodies to their places, and -particle_%s_free none holds them: use place random",
             g->name, g->name);
  for (PetscInt a = 0; a < dim; a++) {
    PetscCheck(s->upper[a] - s->lower[a] > 2 * g->radius * g->largest, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Packed bodies of group '%s': the box is %g wide along axis %" PetscInt_FMT
               ", one body needs %g. Widen -particle_%s_lower .. _upper",
               g->name, (double)(s->upper[a] - s->lower[a]), a, (double)(2 * g->radius * g->largest), g->name);
    g->pack.lower[a] = s->lower[a];
    g->pack.upper[a] = s->upper[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies on a lattice, or to be packed, of which those that this rank owns stay; sizes and densities are drawn for all
   of them */
static PetscErrorCode start_stream(BodyGroup *g, PetscInt dim, const BodySubdomains *subdomains, Start *s)
{
  const PetscBool lattice = (PetscBool)(s->place == PLACE_LATTICE);
  PetscInt64      state   = PlaceStream(s->seed, 4);
  PetscInt        n[3], capacity = 0;
  PlaceBox        box;

  PetscFunctionBeginUser;
  PetscCall(draw_sizes(g, dim, s));
  box = (PlaceBox){g->name, dim, s->lower, s->upper, g->largest * g->radius, s->margin};
  if (lattice) PetscCall(PlaceLattice(&box, g->count, n));
  else PetscCall(begin_pack(g, dim, s));
  if (!s->streams) PetscCall(PetscMalloc1(g->count + 1, &s->body));
  for (PetscInt i = 0; i < g->count; i++) {
    Placement p = s->base;

    PetscCall(SpreadNext(g->name, dim, &s->spread, &p));
    if (lattice) PlaceOnLattice(&box, n, g->count, i, p.x);
    for (PetscInt a = 0; a < dim && !lattice; a++)
      p.x[a] = s->lower[a] + (s->upper[a] - s->lower[a]) * PlaceUniform(&state);
    if (s->streams && !BodySubdomainsOwn(subdomains, p.x)) continue;
    if (s->streams) {
      PetscCall(ArrayReserve(s->n + 1, &capacity, &s->body, sizeof(*s->body), &s->number, sizeof(*s->number), NULL));
      s->number[s->n] = i;
    }
    s->body[s->n++] = p;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Everything but random positions, which need to know where the other bodies are. */
static PetscErrorCode start_group(BodyGroup *g, PetscInt dim, const BodySubdomains *subdomains, Start *s)
{
  PetscFunctionBeginUser;
  s->base.scale   = 1;
  s->base.density = g->density;
  g->count        = s->place == PLACE_SINGLE ? 1 : s->count;
  if (s->place == PLACE_LATTICE || s->place == PLACE_PACK) {
    PetscCall(start_stream(g, dim, subdomains, s));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (s->place == PLACE_TABLE) PetscCall(start_table(g, dim, s));
  else {
    PetscCall(PetscMalloc1(g->count + 1, &s->body));
    for (PetscInt i = 0; i < g->count; i++) {
      s->body[i] = s->base;
      PetscCall(SpreadNext(g->name, dim, &s->spread, &s->body[i]));
    }
  }
  for (PetscInt i = 0; i < g->count; i++) g->largest = i ? PetscMax(g->largest, s->body[i].scale) : s->body[i].scale;
  s->n = g->count;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A file in other units than the scene: a body that no room is left for, or that is lost in it */
static PetscErrorCode check_size(const BodyGroup *g, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3])
{
  PetscReal diagonal = 0, shortest = PETSC_MAX_REAL;
  PetscBool file;

  PetscFunctionBeginUser;
  PetscCall(ShapeIsFromFile(g->shape, &file));
  if (!file || g->obstacle) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < dim; a++) {
    diagonal += PetscSqr(upper[a] - lower[a]);
    shortest = PetscMin(shortest, upper[a] - lower[a]);
  }
  diagonal = PetscSqrtReal(diagonal);
  PetscCheck(g->radius < diagonal, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s' is far larger than the domain: its bounding radius is %g, the domain's diagonal %g. If its file is in other units, set "
             "-particle_%s_scale, a factor on its coordinates (such as 1e-3 from mm to m)",
             g->name, (double)g->radius, (double)diagonal, g->name);
  if (g->radius < 1e-3 * shortest)
    PetscCall(
      LogRemark("group '%s' is very small in the domain: its bounding radius is %g, the domain's shortest side %g. If its file is in other "
                "units, set -particle_%s_scale, a factor on its coordinates",
                g->name, (double)g->radius, (double)shortest, g->name));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Do its bodies change their size, by -particle_<g>_<scalar>_dissolves (couple/scalargrowth.h)? What depends on it is
   made before what the flow carries is. */
static PetscErrorCode find_growth(BodyGroup *g)
{
  char      list[1024], name[OPT_NAME], *scalar, *rest;
  PetscReal factor = 0;
  PetscBool given;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-scalars", list, sizeof(list)));
  for (scalar = strtok_r(list, BETWEEN, &rest); scalar; scalar = strtok_r(NULL, BETWEEN, &rest)) {
    (void)snprintf(name, sizeof(name), "-particle_%s_%s_dissolves", g->name, scalar);
    PetscCall(OptPeekReal(name, &factor, &given));
    if (given && factor != 0) g->grows = PETSC_TRUE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* All about one group but its place among the others. */
static PetscErrorCode read_group(BodyGroup *g, PetscInt dim, const BodySubdomains *subdomains, const PetscReal lower[3],
                                 const PetscReal upper[3], Start *s)
{
  PetscFunctionBeginUser;
  PetscCall(read_shape(g, dim, s));
  PetscCall(find_growth(g));
  s->count = 1;
  PetscCall(PetscArraycpy(s->lower, lower, 3));
  PetscCall(PetscArraycpy(s->upper, upper, 3));
  PetscCall(read_place(g->name, dim, s));
  PetscCall(check_place(g, s));
  PetscCall(check_velocities(g, s));
  PetscCall(SpreadRead(g->name, g->density, s->seed, &s->spread));
  s->streams = (PetscBool)(s->streams && BodyIsAllFree(g, dim));
  PetscCall(start_group(g, dim, subdomains, s));
  PetscCall(check_size(g, dim, lower, upper));
  PetscCall(orient_bodies(g, dim, s->n, s->body));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- all groups ---- */

/* Random groups come last, one after the other, and keep clear of everything placed before. */
static PetscErrorCode start_random(BodyArrays *s, Start start[])
{
  ParticlesPlaced placed = {.n = 0};
  PetscInt        n      = 0;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->ngroups; g++) n += start[g].place == PLACE_RANDOM;
  if (!n) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt pass = 0; pass < 2; pass++)
    for (PetscInt g = 0; g < s->ngroups; g++) {
      const BodyGroup *group = &s->group[g];
      const Start     *t     = &start[g];

      if ((t->place == PLACE_RANDOM) != (pass == 1)) continue;
      if (pass)
        PetscCall(PlaceRandom(&(PlaceBox){group->name, s->dim, t->lower, t->upper, group->radius, t->margin}, t->seed,
                              &placed, group->count, t->body));
      PetscCall(ParticlesPlacedAdd(&placed, group->radius, group->count, t->body));
    }
  PetscCall(ParticlesPlacedDestroy(&placed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is there a group whose places need those of all others? */
static PetscErrorCode look_for_random(const BodyArrays *s, PetscBool *random)
{
  char name[OPT_NAME], place[16];

  PetscFunctionBeginUser;
  *random = PETSC_FALSE;
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCall(OptPeek(OptJoin("-particle_", s->group[g].name, "_place", name), place, sizeof(place)));
    if (!strcasecmp(place, "random")) *random = PETSC_TRUE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyGroupsRead(BodyArrays *s, const BodySubdomains *subdomains, const PetscReal lower[3],
                              const PetscReal upper[3], Placed **placed)
{
  Start    *start;
  PetscBool random;

  PetscFunctionBeginUser;
  PetscCall(BodyGroupsName(s));
  PetscCall(look_for_random(s, &random));
  PetscCall(PetscCalloc1(s->ngroups, &start));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    start[g].streams = (PetscBool)(subdomains && !random);
    PetscCall(read_group(&s->group[g], s->dim, subdomains, lower, upper, &start[g]));
    s->group[g].first = s->nall;
    s->nall += s->group[g].count;
  }
  PetscCall(start_random(s, start));
  PetscCall(PetscCalloc1(s->ngroups, placed));
  for (PetscInt g = 0; g < s->ngroups; g++) (*placed)[g] = (Placed){start[g].n, start[g].number, start[g].body};
  PetscCall(PetscFree(start));
  PetscFunctionReturn(PETSC_SUCCESS);
}
