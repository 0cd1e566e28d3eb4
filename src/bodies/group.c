/* Bodies: the options of the groups, see bodies.h; where the bodies of a group start.

   Every group is read by itself, and its bodies are placed singly, in rows or from a table (place.h). Random groups
   come last, because they keep clear of all others. The same on every rank; only tables are read by one rank. Does not
   know the state of the bodies, which is made from this in bodies.c. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "base/opt.h"

/* What the options of a group say about the start of its bodies. */
typedef struct {
  PetscInt   place, count, seed;
  PetscReal  lower[3], upper[3], margin;
  Placement  base; /* position, angle and velocities given for all bodies */
  PetscBool  has_position, has_count;
  char       table[PETSC_MAX_PATH_LEN];
  Placement *body; /* [count of the group] */
} Start;

enum {
  PLACE_SINGLE,
  PLACE_LATTICE,
  PLACE_RANDOM,
  PLACE_TABLE
};
static const char *const place_names[] = {"single", "lattice", "random", "table", NULL};

/* ---- options of one group ---- */

static PetscErrorCode read_free(const char group[], PetscInt dim, const Motion *m, PetscInt *bits)
{
  const char *const word[] = {"x", "y", "z", "rotation", "none", "all"};
  const PetscInt    mask[] = {BODY_FREE_X,        BODY_FREE_Y, BODY_FREE_Z,
                              BODY_FREE_ROTATION, 0,           BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z | BODY_FREE_ROTATION};
  char              name[OPT_NAME], *list[16];
  PetscInt          n = 16;

  PetscFunctionBeginUser;
  (void)OptJoin("-particle_", group, "_free", name);
  *bits = m->has_pivot ? BODY_FREE_ROTATION : mask[5];
  if (m->given) *bits = 0;
  PetscCall(OptStringArray(name, &n, list));
  if (n) *bits = 0;
  for (PetscInt i = 0; i < n; i++) {
    PetscInt k = 0;

    while (k < 6 && strcmp(list[i], word[k])) k++;
    PetscCheck(k < 6, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "%s: '%s' is not known (known: x, y, z, rotation, all, none)", name, list[i]);
    PetscCheck(k < 4 || n == 1, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "%s: '%s' stands alone, remove the other %" PetscInt_FMT " entries", name,
               list[i], n - 1);
    *bits |= mask[k];
    PetscCall(PetscFree(list[i]));
  }
  if (dim == 2 && n && *bits != mask[5] && (*bits & BODY_FREE_Z))
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
               "Group '%s': -particle_%s_%s prescribes %s, and -particle_%s_free sets it free: remove it from one of them", g->name, g->name,
               MotionOscillates(m, a) ? "motion"
               : a < 3                ? "velocity"
                                      : "angular_velocity",
               word[a], g->name);
  PetscCheck(!m->has_pivot || !moves, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s' turns about -particle_%s_pivot, which does not move freely: give -particle_%s_free rotation or none", g->name, g->name,
             g->name);
  PetscCheck(!m->has_stops || (!moves && g->free), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_stops needs a body that turns freely about a point: give -particle_%s_free rotation", g->name, g->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_shape(BodyGroup *g, PetscInt dim, Start *s)
{
  char      name[OPT_NAME], type[64] = "", prefix[128];
  PetscBool has_density;

  PetscFunctionBeginUser;
  PetscCall(OptString(OptJoin("-particle_", g->name, "_shape", name), type, sizeof(type)));
  PetscCheck(type[0], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "Group '%s' has no shape: give %s", g->name, name);
  (void)snprintf(prefix, sizeof(prefix), "particle_%s_", g->name);
  PetscCall(ShapeCreate(type, prefix, dim, &g->shape));
  PetscCall(ShapeGetMass(g->shape, &g->mass));
  PetscCall(ShapeGetRadius(g->shape, &g->radius));
  PetscCall(ShapeGetDisc(g->shape, &g->disc));
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_angle", name), &s->base.angle));
  PetscCall(MotionRead(g->name, dim, &g->motion, s->base.u, s->base.omega));
  PetscCall(read_free(g->name, dim, &g->motion, &g->free));
  PetscCall(check_motion(g));
  for (PetscInt a = 0; a < dim && g->motion.has_pivot; a++) g->arm[a] = g->mass.centroid[a] - g->motion.pivot[a];
  PetscCall(OptHas(OptJoin("-particle_", g->name, "_density", name), &has_density));
  g->density = 1;
  PetscCall(OptReal(name, &g->density));
  PetscCheck(has_density || !g->free, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s' moves but has no density: give %s, or -particle_%s_free none", g->name, name, g->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_place(const char group[], PetscInt dim, Start *s)
{
  char name[OPT_NAME];

  PetscFunctionBeginUser;
  PetscCall(OptChoice(OptJoin("-particle_", group, "_place", name), place_names, &s->place));
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_position", name), dim, s->base.x, &s->has_position));
  PetscCall(OptHas(OptJoin("-particle_", group, "_count", name), &s->has_count));
  PetscCall(OptInt(name, &s->count));
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_lower", name), dim, s->lower, NULL));
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_upper", name), dim, s->upper, NULL));
  PetscCall(OptReal(OptJoin("-particle_", group, "_margin", name), &s->margin));
  PetscCall(OptInt(OptJoin("-particle_", group, "_seed", name), &s->seed));
  PetscCall(OptString(OptJoin("-particle_", group, "_table", name), s->table, sizeof(s->table)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_place(const BodyGroup *g, const Start *s)
{
  const char *place = place_names[s->place], *group = g->name;

  PetscFunctionBeginUser;
  PetscCheck(s->place != PLACE_SINGLE || s->has_position, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s' has no position: give -particle_%s_position, or another -particle_%s_place", group, group, group);
  PetscCheck(s->place != PLACE_SINGLE || !s->has_count || s->count == 1, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_count %" PetscInt_FMT " needs -particle_%s_place lattice, random or table", group, s->count, group);
  PetscCheck(s->place == PLACE_SINGLE || !s->has_position, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_position has no meaning with -particle_%s_place %s: remove one of them", group, group, place);
  PetscCheck((s->place != PLACE_LATTICE && s->place != PLACE_RANDOM) || s->has_count, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_place %s needs -particle_%s_count", group, place, group);
  PetscCheck((s->place != PLACE_LATTICE && s->place != PLACE_RANDOM) || !g->motion.has_pivot, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_pivot needs -particle_%s_place single or table, which place the pivot", group, group);
  PetscCheck(s->place != PLACE_TABLE || s->table[0], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_place table needs -particle_%s_table file.csv", group, group);
  PetscCheck(s->place == PLACE_TABLE || !s->table[0], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "-particle_%s_table needs -particle_%s_place table",
             group, group);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Everything but random positions, which need to know where the other bodies are. */
static PetscErrorCode start_group(BodyGroup *g, PetscInt dim, Start *s)
{
  PetscFunctionBeginUser;
  if (s->place == PLACE_TABLE) {
    PetscCall(PlaceTable(s->table, dim, &s->base, &g->count, &s->body));
    PetscCheck(!s->has_count || s->count == g->count, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "-particle_%s_count is %" PetscInt_FMT ", the table %s has %" PetscInt_FMT " bodies: remove the option", g->name, s->count, s->table,
               g->count);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  g->count = s->place == PLACE_SINGLE ? 1 : s->count;
  PetscCall(PetscMalloc1(g->count + 1, &s->body));
  for (PetscInt i = 0; i < g->count; i++) s->body[i] = s->base;
  if (s->place == PLACE_LATTICE) PetscCall(PlaceLattice(g->name, dim, s->lower, s->upper, g->radius, s->margin, g->count, s->body));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* All about one group but its place among the others. */
static PetscErrorCode read_group(BodyGroup *g, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3], Start *s)
{
  PetscFunctionBeginUser;
  PetscCall(read_shape(g, dim, s));
  s->count = 1;
  PetscCall(PetscArraycpy(s->lower, lower, 3));
  PetscCall(PetscArraycpy(s->upper, upper, 3));
  PetscCall(read_place(g->name, dim, s));
  PetscCall(check_place(g, s));
  PetscCall(start_group(g, dim, s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- all groups ---- */

static PetscErrorCode name_groups(BodyArrays *s)
{
  char    *list[BODIES_MAX_GROUPS + 1];
  PetscInt n = BODIES_MAX_GROUPS + 1;

  PetscFunctionBeginUser;
  PetscCall(OptStringArray("-particle_groups", &n, list));
  PetscCheck(n <= BODIES_MAX_GROUPS, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_groups has more than %d names: join bodies of one shape in one group with -particle_<group>_place table", BODIES_MAX_GROUPS);
  s->ngroups = n;
  PetscCall(PetscCalloc1(n, &s->group));
  for (PetscInt g = 0; g < n; g++) {
    PetscCheck(list[g][0] && strlen(list[g]) < sizeof(s->group[g].name), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "-particle_groups: '%s' must have 1 to %d characters", list[g], (int)sizeof(s->group[g].name) - 1);
    PetscCall(PetscStrncpy(s->group[g].name, list[g], sizeof(s->group[g].name)));
    for (PetscInt f = 0; f < g; f++)
      PetscCheck(strcmp(s->group[f].name, s->group[g].name), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "-particle_groups names '%s' twice: remove one",
                 list[g]);
    PetscCall(PetscFree(list[g]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Random groups come last, one after the other, and keep clear of everything placed before. */
static PetscErrorCode start_random(BodyArrays *s, Start start[])
{
  PetscReal(*x)[3], *radius;
  PetscInt n = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(s->n, &x));
  PetscCall(PetscMalloc1(s->n, &radius));
  for (PetscInt pass = 0; pass < 2; pass++)
    for (PetscInt g = 0; g < s->ngroups; g++) {
      const BodyGroup *group = &s->group[g];
      const Start     *t     = &start[g];

      if ((t->place == PLACE_RANDOM) != (pass == 1)) continue;
      if (pass)
        PetscCall(PlaceRandom(group->name, s->dim, t->lower, t->upper, group->radius, t->margin, t->seed, n, x, radius, group->count, t->body));
      for (PetscInt i = 0; i < group->count; i++, n++) {
        PetscCall(PetscArraycpy(x[n], t->body[i].x, 3));
        radius[n] = group->radius;
      }
    }
  PetscCall(PetscFree(x));
  PetscCall(PetscFree(radius));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyGroupsRead(BodyArrays *s, const PetscReal lower[3], const PetscReal upper[3], Placement ***body)
{
  Start *start;

  PetscFunctionBeginUser;
  PetscCall(name_groups(s));
  PetscCall(PetscCalloc1(s->ngroups, &start));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCall(read_group(&s->group[g], s->dim, lower, upper, &start[g]));
    s->group[g].first = s->n;
    s->n += s->group[g].count;
  }
  PetscCall(start_random(s, start));
  PetscCall(PetscCalloc1(s->ngroups, body));
  for (PetscInt g = 0; g < s->ngroups; g++) (*body)[g] = start[g].body;
  PetscCall(PetscFree(start));
  PetscFunctionReturn(PETSC_SUCCESS);
}
