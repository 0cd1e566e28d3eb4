/* Defaults: see defaults.h. Those of PETSc's solver objects stand where these are made. */
#include "compat.h"
#include "defaults.h"
#include "base/opt.h"
#include "bodies/local.h"

/* Situations of a scene, to be or-ed */
enum {
  UNSTEADY = 1,
  STEADY   = 2,
  PLANE    = 4,
  SPATIAL  = 8,
  SMALL    = 16,  /* for a direct solver */
  MOVING   = 32,  /* bodies that do not all stand still */
  LED      = 64,  /* bodies that are led to and fro */
  EMPTY    = 128, /* no bodies */
  STILL    = 256, /* bodies, and all of them stand still */
  EVEN     = 512  /* no cell has neighbours of half its size */
};

/* In all of these situations, and with this option at this value (NULL: any scene), the default of `name` is `then`
   (NULL: what its room says; STEP, HALF_STEP: by the step of the scene). Of two rows that hold the later wins. Presets:
   runs/studies/tradeoff, runs/validate/presets.md. A preset of the command line replaces what the scene gives for the
   names of its rows. */
#define STEP      "-sim_dt"
#define HALF_STEP "-sim_dt / 2"
static const struct {
  const char *option, *value;
  int         situation;
  const char *name, *then;
} RULES[] = {
  {"-preset", "fast", UNSTEADY, "-flow_recipe", "fast"},
  {"-preset", "fast", UNSTEADY, "-flow_ksp_rtol", NULL},
  {"-preset", "fast", 0, "-couple_boundary", "penalty"},
  {"-preset", "fast", UNSTEADY, "-flow_time", "bdf2"},
  /* two iterations a step: 0.3 % off at one and at two cells' way, 3 % at three (runs/studies/fast) */
  {"-preset", "fast", UNSTEADY | MOVING, "-sim_adapt", "true"},
  {"-preset", "fast", UNSTEADY | MOVING, "-sim_adapt_tolerance", "1e-2"},
  {"-preset", "fast", UNSTEADY | MOVING, "-sim_adapt_move", "1"},
  {"-preset", "fast", UNSTEADY | MOVING, "-sim_adapt_max", STEP},
  /* vortex streets (2D-3): 0.6 % off with less than half of the steps; a parabola in time needs a CFL number below 2 */
  {"-preset", "fast", UNSTEADY | STILL, "-sim_adapt", "true"},
  {"-preset", "fast", UNSTEADY | STILL, "-sim_adapt_tolerance", "1e-3"},
  {"-preset", "fast", UNSTEADY | STILL, "-sim_adapt_cfl", "2"},
  {"-preset", "fast", STEADY, "-flow_snes_rtol", "1e-5"}, /* at 1e-4 cL of 2D-1 is 35 % off */
  {"-preset", "balanced", UNSTEADY, "-flow_recipe", "balanced"},
  {"-preset", "balanced", UNSTEADY, "-flow_ksp_rtol", NULL},
  {"-preset", "balanced", 0, "-couple_boundary", "penalty"},
  {"-preset", "balanced", UNSTEADY, "-flow_time", "bdf2"},
  /* a tighter solver changes nothing in six digits; the surface and the step do */
  {"-preset", "accurate", UNSTEADY, "-flow_recipe", "balanced"},
  {"-preset", "accurate", UNSTEADY, "-flow_ksp_rtol", NULL},
  {"-preset", "accurate", UNSTEADY | MOVING, "-flow_rtol_most", "1e-6"},
  {"-preset", "accurate", PLANE, "-couple_boundary", "snap"},
  {"-preset", "accurate", SPATIAL, "-couple_boundary", "penalty"},
  /* penalty is 1.4 % off at 8 cells a diameter, snap 0.02 % (sphere-array) */
  {"-preset", "balanced", SPATIAL | STILL | EVEN, "-couple_boundary", "snap"},
  {"-preset", "accurate", SPATIAL | STILL | EVEN, "-couple_boundary", "snap"},
  {"-preset", "accurate", UNSTEADY | MOVING, "-sim_adapt", "true"},
  {"-preset", "accurate", UNSTEADY | MOVING, "-sim_adapt_tolerance", "1e-4"},
  {"-preset", "accurate", UNSTEADY | MOVING, "-sim_adapt_move", "0.5"},
  /* the force on a body that is led: 0.57, 0.24, 0.16 % off at .5, .2, .15 cells a step (oscillating cylinder) */
  {"-preset", "accurate", UNSTEADY | MOVING | LED, "-sim_adapt_move", "0.15"},
  {"-preset", "accurate", UNSTEADY | MOVING, "-sim_adapt_max", STEP},
  /* an instability makes more of the error of a step than its size tells: cL of 2D-3 0.31, 0.18 % off with whole and
     half the step, 0.28 % with a tolerance of 5e-7 */
  {"-preset", "accurate", UNSTEADY | STILL, "-sim_adapt", "true"},
  {"-preset", "accurate", UNSTEADY | STILL, "-sim_adapt_tolerance", "1e-5"},
  {"-preset", "accurate", UNSTEADY | STILL, "-sim_adapt_max", HALF_STEP},
  {"-preset", "accurate", UNSTEADY, "-flow_time", "bdf2"},
  /* a single sweep leaves more: largest of 5 steps in a row in the scenes of runs/ that it solves 0.011, 0.032 */
  {"-flow_recipe", "fast", UNSTEADY | EMPTY, "-sim_judge_momentum", "0.3"},
  /* the added mass, one step late, counts 3/2 times in bdf2: stable for added mass / body mass < 1 with be, about 1/2
     with bdf2 */
  {"-couple_type", "explicit", 0, "-flow_time", "be"},
  {NULL, NULL, STEADY | SMALL, "-flow_recipe", "direct"},
  {NULL, NULL, STEADY, "-flow_ksp_rtol", "1e-6"}, /* of a correction; the tolerance of the solution is
                                                     -flow_snes_rtol */
};
#define NRULES PETSC_STATIC_ARRAY_LENGTH(RULES)

/* What a preset of the command line took from the scene, for the rows that did */
typedef struct {
  char was[NRULES][64];
} Replaced;

static PetscErrorCode applies(size_t i, int situation, PetscBool *yes)
{
  char      text[64];
  PetscBool same = PETSC_TRUE;

  PetscFunctionBeginUser;
  if (RULES[i].option) {
    PetscCall(OptPeek(RULES[i].option, text, sizeof(text)));
    PetscCall(PetscStrcasecmp(text, RULES[i].value, &same));
  }
  *yes = (PetscBool)(same && (situation & RULES[i].situation) == RULES[i].situation);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Crank-Nicolson is of second order as well: a scene that has chosen it keeps it. */
static PetscErrorCode is_as_good(size_t i, PetscBool *good)
{
  char      text[64];
  PetscBool scheme, cn;

  PetscFunctionBeginUser;
  PetscCall(OptPeek(RULES[i].name, text, sizeof(text)));
  PetscCall(PetscStrcmp(RULES[i].name, "-flow_time", &scheme));
  PetscCall(PetscStrcasecmp(text, "cn", &cn));
  *good = (PetscBool)(scheme && cn);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_from_scene(int situation, Replaced *replaced)
{
  PetscBool yes, preset, good = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (size_t i = 0; i < NRULES; i++) {
    PetscCall(applies(i, situation, &yes));
    PetscCall(PetscStrcmp(RULES[i].option, "-preset", &preset));
    if (!yes || !preset) continue;
    PetscCall(is_as_good(i, &good));
    if (!good) PetscCall(OptTake(RULES[i].name, replaced->was[i], sizeof(replaced->was[i])));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode apply_rules(int situation)
{
  char        text[64];
  const char *then;
  PetscBool   yes, whole, half;
  double      step;

  PetscFunctionBeginUser;
  for (size_t i = 0; i < NRULES; i++) {
    PetscCall(applies(i, situation, &yes));
    if (!yes || !RULES[i].then) continue;
    then = RULES[i].then;
    PetscCall(PetscStrcmp(then, STEP, &whole));
    PetscCall(PetscStrcmp(then, HALF_STEP, &half));
    if (whole || half) {
      PetscCall(OptPeek(STEP, text, sizeof(text)));
      if (!text[0]) continue;
      if (half && sscanf(text, "%lf", &step) == 1) PetscCall(PetscSNPrintf(text, sizeof(text), "%.15g", step / 2));
      then = text;
    }
    PetscCall(OptDefault(RULES[i].name, then));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One line of what the scene said and the preset overrules */
static PetscErrorCode list_replaced(const char preset[], const Replaced *replaced)
{
  char      line[1024] = "", item[160], now[64];
  PetscBool same;

  PetscFunctionBeginUser;
  for (size_t i = 0; i < NRULES; i++) {
    if (!replaced->was[i][0]) continue;
    PetscCall(OptPeek(RULES[i].name, now, sizeof(now)));
    PetscCall(PetscStrcasecmp(now, replaced->was[i], &same));
    if (same) continue;
    PetscCall(PetscSNPrintf(item, sizeof(item), "%s %s %s", line[0] ? "," : "", RULES[i].name + 1, replaced->was[i]));
    PetscCall(PetscStrlcat(line, item, sizeof(line)));
  }
  if (line[0]) PetscCall(PetscPrintf(PETSC_COMM_WORLD, "preset %s replaces%s of the scene\n", preset, line));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Neither for a steady scene nor for a start from a steady flow */
static PetscErrorCode refuse_sweep(PetscBool steady)
{
  char      recipe[64], initial[64];
  PetscBool fast, start;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-flow_recipe", recipe, sizeof(recipe)));
  PetscCall(OptPeek("-flow_initial", initial, sizeof(initial)));
  PetscCall(PetscStrcasecmp(recipe, "fast", &fast));
  PetscCall(PetscStrcasecmp(initial, "steady", &start));
  PetscCheck(!fast || !(steady || start), PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "-flow_recipe fast takes a sweep or two of a time step and solves no steady problem: use direct, balanced or accurate with %s",
             steady ? "-sim_steady" : "-flow_initial steady");
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_situation(const MeshLocal *l, Bodies bodies, PetscBool steady, int *situation)
{
  const PetscReal unknowns = (PetscReal)l->nnode_global * l->dim + (PetscReal)l->ncell_global * (l->dim + 1);
  PetscBool       still    = PETSC_TRUE;
  BodyState      *s        = NULL;

  PetscFunctionBeginUser;
  if (bodies) PetscCall(BodiesAreStill(bodies, &still));
  if (bodies) PetscCall(BodiesGetState(bodies, &s));
  if (steady) { /* without time no body goes anywhere, whatever its velocity, unless that is sought */
    still = PETSC_TRUE;
    for (PetscInt g = 0; s && g < s->ngroups; g++)
      if (s->group[g].free) still = PETSC_FALSE;
  }
  *situation = (steady ? STEADY : UNSTEADY) | (l->dim == 2 ? PLANE : SPATIAL) | (l->hang ? 0 : EVEN);
  /* in space MUMPS costs 12 times as much as iterations at 14,000 unknowns (runs/README.md, sphere-array) */
  if (unknowns < (l->dim == 2 ? 1.5e6 : 1e4)) *situation |= SMALL;
  if (!still) *situation |= MOVING;
  for (PetscInt g = 0; bodies && g < s->ngroups; g++)
    for (PetscInt d = 0; d < l->dim; d++)
      if (s->group[g].motion.given && s->group[g].motion.amplitude[d] != 0) *situation |= LED;
  if (!s || s->nall == 0) *situation |= EMPTY;
  else if (still) *situation |= STILL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What each preset promises, and for it: how many cells thick a body must be (balanced: a disc of 4 cells is 1.7 to
   2.5 % off, of 5 cells 0.6 %, an ellipse of 2 cells 1.9 %; accurate: 0.14 % there; a flap of 1.6 cells 1.6, 1.5 and
   1.2 %), also in other fluids (balanced: a disc of 7 cells 2.4 % off in a Carreau fluid, 2.1 % in Oldroyd-B, of 10
   cells .1 and .8 %), and the boundary layer of a falling one (two discs with 0.43 cells, at 8 cells a diameter: fast
   3 % off, accurate 3.6 %; an ellipse with 0.64 within 0.14 %), or of several that fall in each other's wakes (two
   discs with 0.64 cells: fast 1.6, balanced 1.6, accurate 1.3 % off; with 1.3 cells 0.5, 0.5, 0.3 %; with 2.6
   accurate 0.06 %) */
static const char *const PRESETS[] = {"fast", "balanced", "accurate", NULL};
static const struct {
  const char *percent;
  PetscReal   cells, other, layer, wakes;
} PROMISE[] = {{"5", 1.5, 1.5, 0.25, 0.25}, {"1", 5, 10, 0.5, 1}, {"0.2", 2, 2, 0.5, 2}};

/* Has the fluid a law that is not Newtonian, and not one of eddies? */
static PetscErrorCode is_other_fluid(PetscBool *other)
{
  const char *const names[] = {"", "newton", "smagorinsky", "wale"};
  char              law[64];

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-flow_rheology", law, sizeof(law)));
  *other = PETSC_TRUE;
  for (int i = 0; i < 4; i++) *other = (PetscBool)(*other && strcmp(law, names[i]) != 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Thickness in cells about the centre of the smallest body of a group; 0: the centre is not inside */
static PetscErrorCode measure_thickness(const MeshLocal *l, Bodies bodies, PetscInt group, PetscReal *cells)
{
  BodyState *s;
  PetscReal  d = 0, scale = PETSC_MAX_REAL; /* of the smallest */
  PetscInt   smallest = -1;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  for (PetscInt k = 0; k < s->n; k++) {
    if (s->body_group[k] != group || s->scale[k] >= scale) continue;
    smallest = k;
    scale    = s->scale[k];
  }
  PetscCall(BodiesMin(bodies, 1, &scale));
  if (smallest >= 0 && s->scale[smallest] == scale) PetscCall(BodiesDistance(bodies, smallest, NULL, NULL, 1, s->x[smallest], &d));
  *cells = d < 0 ? -2 * d / l->h : 0;
  PetscCall(BodiesMax(bodies, 1, cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Diameter/sqrt(Re) in cells of a free body that falls with a drag coefficient of 1; infinite for one that does not, or
   where a number is an expression. Planes only: no measurements in space. */
static PetscErrorCode measure_layer(const MeshLocal *l, Bodies bodies, PetscInt group, PetscReal *cells)
{
  const char *const names[3] = {"-flow_density", "-flow_viscosity", "-flow_gravity"};
  BodyState        *s;
  char              text[3][64];
  double            density = 1, viscosity = 0.01, x = 0, y = 0;
  PetscReal         first[2] = {0, 0}, d, speed; /* size and density of its first body */
  PetscInt          k;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  *cells = PETSC_MAX_REAL;
  for (PetscInt i = 0; i < 3; i++) PetscCall(OptPeek(names[i], text[i], sizeof(text[i])));
  if (text[0][0] && sscanf(text[0], "%lf", &density) != 1) PetscFunctionReturn(PETSC_SUCCESS);
  if (text[1][0] && sscanf(text[1], "%lf", &viscosity) != 1) PetscFunctionReturn(PETSC_SUCCESS);
  if (l->dim != 2 || !s->group[group].count || sscanf(text[2], "%lf%*[ ,]%lf", &x, &y) != 2) PetscFunctionReturn(PETSC_SUCCESS);
  if (!(s->group[group].free & (BODY_FREE_X | BODY_FREE_Y)) || s->group[group].motion.has_pivot) PetscFunctionReturn(PETSC_SUCCESS);
  k = BodiesFind(s, s->group[group].first);
  if (k >= 0) first[0] = BodiesGetRadius(s, k);
  if (k >= 0) first[1] = s->density[k];
  PetscCall(BodiesMax(bodies, 2, first));
  d     = 2 * first[0];
  speed = PetscSqrtReal(0.5 * PETSC_PI * d * PetscAbsReal(first[1] / density - 1) * PetscSqrtReal(x * x + y * y));
  if (speed > 0) *cells = d / PetscSqrtReal(density * speed * d / viscosity) / l->h;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A preset that was asked for stops where it is known not to keep its promise; the default one does not. */
static PetscErrorCode refuse_promise(const MeshLocal *l, Bodies bodies, PetscInt preset, int situation)
{
  BodyState *s;
  PetscReal  cells = 0, thick, least = PROMISE[preset].layer;
  PetscInt   fall  = 0;
  PetscBool  other = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(is_other_fluid(&other));
  thick = other ? PROMISE[preset].other : PROMISE[preset].cells;
  PetscCall(BodiesGetState(bodies, &s));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCall(measure_layer(l, bodies, g, &cells));
    if (cells < PETSC_MAX_REAL) fall += s->group[g].count;
  }
  if (fall > 1) least = PROMISE[preset].wakes;
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCall(measure_thickness(l, bodies, g, &cells));
    PetscCheck(cells == 0 || cells >= thick * (1 - 1e-6), PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
               "-preset %s cannot keep its %s %% here: group '%s' is %.1f cells thick and needs %.1f. Refine the mesh (-mesh_cells, -mesh_focus_h, "
               "-dm_refine)%s, or remove -preset",
               PRESETS[preset], PROMISE[preset].percent, s->group[g].name, (double)cells, (double)thick,
               preset == 1 && cells >= PROMISE[2].cells && (situation & PLANE) ? ", use -preset accurate" : "");
    PetscCall(measure_layer(l, bodies, g, &cells));
    PetscCheck(cells >= least, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
               "-preset %s cannot keep its %s %% here: the boundary layer of a falling body of group '%s' is %.2f cells thick and needs %.2g. Refine the "
               "mesh (-mesh_cells, -mesh_focus_h, -mesh_levels), or remove -preset",
               PRESETS[preset], PROMISE[preset].percent, s->group[g].name, (double)cells, (double)least);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DefaultsApply(const MeshLocal *l, Bodies bodies, PetscBool steady)
{
  Replaced  replaced = {0};
  PetscInt  preset   = 1;
  PetscBool given, commanded;
  int       situation = 0;

  PetscFunctionBeginUser;
  PetscCall(OptHas("-preset", &given));
  PetscCall(OptChoice("-preset", PRESETS, &preset));
  PetscCall(OptDefault("-preset", PRESETS[preset]));
  commanded = OptIsArgument("-preset");
  PetscCall(find_situation(l, bodies, steady, &situation));
  if (commanded) PetscCall(take_from_scene(situation, &replaced));
  if (given && bodies) PetscCall(refuse_promise(l, bodies, preset, situation));
  PetscCall(apply_rules(situation));
  PetscCall(refuse_sweep(steady));
  PetscCall(list_replaced(PRESETS[preset], &replaced));
  /* options.txt, run again, promises no more than the run did */
  if (!given) PetscCall(PetscOptionsClearValue(NULL, "-preset"));
  PetscFunctionReturn(PETSC_SUCCESS);
}
