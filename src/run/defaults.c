/* Defaults: see defaults.h. Those of PETSc's solver objects stand where these are made. */
#include "compat.h"
#include "base/runcomm.h"
#include "defaults.h"
#include "dropcells.h"
#include "promise.h"
#include "scalarlayers.h"
#include "solidpromise.h"
#include "swing.h"
#include "unproven.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "bodies/slip.h"
#include "couple/couple.h"
#include <string.h>

/* Situations of a scene, to be or-ed */
enum {
  UNSTEADY = 1,
  STEADY   = 2,
  PLANE    = 4,
  SPATIAL  = 8,
  SMALL    = 16,    /* for a direct solver */
  MOVING   = 32,    /* bodies that do not all stand still */
  LED      = 64,    /* bodies that are led to and fro */
  EMPTY    = 128,   /* no particles of any kind */
  STILL    = 256,   /* bodies that all stand still, beside nothing elastic */
  EVEN     = 512,   /* no cell has neighbours of half its size */
  ASKED    = 1024,  /* for a preset, in the scene or on the command line: all others are as they always were */
  LINES_UP = 2048,  /* the mesh can be lined up: cells of one size around bodies, wherever these go */
  START    = 16384, /* at least where they start */
  SPINS    = 4096,  /* a body that is free to turn and stays where it is */
  NARROW   = 8192,  /* a gap that lasts is too narrow for the penalty of the preset, or a body that swings too thin */
  BODIES   = 32768,
  SWIMS    = 65536,  /* a body whose surface moves in its own frame (bodies/slip.h) */
  ADRIFT   = 131072, /* nothing holds the fluid: periodic along all axes, nobody pulls, no -flow_rate */
  DROPS    = 262144,
  SOLIDS   = 524288,  /* elastic particles */
  FLUIDS   = 1048576, /* several, each with its viscosity */
  FOLLOWED = 2097152, /* elastic particles that the mesh can be lined up with, */
  IMMERSED = 4194304, /* and those that it cannot */
  COMPRESSIBLE = 8388608
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
  {"-preset", "fast", UNSTEADY, "-flow_solver", "fast"},
  {"-preset", "fast", UNSTEADY, "-flow_ksp_rtol", NULL},
  {"-preset", "fast", BODIES, "-couple_method", "penalty"},
  {"-preset", "fast", UNSTEADY, "-flow_time", "bdf2"},
  /* two iterations a step: 0.3 % off at one and at two cells' way, 3 % at three (runs/studies/fast) */
  {"-preset", "fast", UNSTEADY | MOVING, "-sim_adapt", "true"},
  {"-preset", "fast", UNSTEADY | MOVING, "-sim_adapt_tolerance", "1e-2"},
  {"-preset", "fast", UNSTEADY | MOVING, "-sim_adapt_displacement", "1"},
  {"-preset", "fast", UNSTEADY | MOVING, "-sim_adapt_max", STEP},
  /* vortex streets (2D-3): 0.6 % off with less than half of the steps; a parabola in time needs a CFL number below 2 */
  {"-preset", "fast", UNSTEADY | STILL, "-sim_adapt", "true"},
  {"-preset", "fast", UNSTEADY | STILL, "-sim_adapt_tolerance", "1e-3"},
  {"-preset", "fast", UNSTEADY | STILL, "-sim_adapt_cfl", "2"},
  {"-preset", "fast", STEADY, "-flow_snes_rtol", "1e-5"}, /* at 1e-4 cL of 2D-1 is 35 % off */
  {"-preset", "balanced", UNSTEADY, "-flow_solver", "balanced"},
  {"-preset", "balanced", UNSTEADY, "-flow_ksp_rtol", NULL},
  {"-preset", "balanced", BODIES, "-couple_method", "penalty"},
  {"-preset", "balanced", UNSTEADY, "-flow_time", "bdf2"},
  /* a tighter solver changes nothing in six digits; the surface and the step do */
  {"-preset", "accurate", UNSTEADY, "-flow_solver", "balanced"},
  {"-preset", "accurate", UNSTEADY, "-flow_ksp_rtol", NULL},
  {"-preset", "accurate", UNSTEADY | MOVING, "-flow_rtol_max", "1e-6"},
  {"-preset", "accurate", PLANE | BODIES, "-couple_method", "aligned"},
  {"-preset", "accurate", SPATIAL | BODIES, "-couple_method", "penalty"},
  /* penalty is 1.4 % off at 8 cells a diameter, aligned 0.02 % (sphere-array) */
  {"-preset", "balanced", SPATIAL | STILL | EVEN, "-couple_method", "aligned"},
  {"-preset", "accurate", SPATIAL | STILL | EVEN, "-couple_method", "aligned"},
  /* at 200, the viscous part of the plane, spheres are too small by .021 to .024 cells, at 280 right to .003: cubic
     arrays are .2, .1 % off at 6, 8 cells a diameter instead of 1.9, 1.3 % (runs/studies/boundary) */
  {"-preset", "fast", SPATIAL | ASKED, "-couple_penalty_viscous", "280"},
  {"-preset", "balanced", SPATIAL | ASKED, "-couple_penalty_viscous", "280"},
  {"-preset", "accurate", SPATIAL | ASKED, "-couple_penalty_viscous", "280"},
  /* lined up: where it costs the same (steady scenes; lift by the penalty is 2.5 % off in a bearing), where the penalty
     cannot do it (narrow gaps; torque-free bodies, 1.1 %), and for .2 % in space */
  {"-preset", "fast", NARROW | LINES_UP | ASKED, "-couple_method", "aligned"},
  {"-preset", "balanced", NARROW | LINES_UP | ASKED, "-couple_method", "aligned"},
  /* at rest it costs the same: lift of a cylinder with a flag of 3 cells (CFD3) 9, .3 % off with fast, arrays .5,
     .005 % */
  {"-preset", "fast", PLANE | UNSTEADY | STILL | LINES_UP | ASKED, "-couple_method", "aligned"},
  {"-preset", "fast", STEADY | STILL | LINES_UP | ASKED, "-couple_method", "aligned"},
  {"-preset", "balanced", PLANE | UNSTEADY | STILL | LINES_UP | ASKED, "-couple_method", "aligned"},
  {"-preset", "balanced", PLANE | SPINS | LINES_UP | ASKED, "-couple_method", "aligned"},
  {"-preset", "balanced", PLANE | STEADY | STILL | LINES_UP | ASKED, "-couple_method", "aligned"},
  {"-preset", "balanced", SPATIAL | STILL | LINES_UP | ASKED, "-couple_method", "aligned"},
  {"-preset", "accurate", SPATIAL | START | ASKED, "-couple_method", "aligned"},
  {"-preset", "accurate", UNSTEADY | MOVING, "-sim_adapt", "true"},
  {"-preset", "accurate", UNSTEADY | MOVING, "-sim_adapt_tolerance", "1e-4"},
  {"-preset", "accurate", UNSTEADY | MOVING, "-sim_adapt_displacement", "0.5"},
  /* the force on a body that is led: 0.57, 0.24, 0.16 % off at .5, .2, .15 cells a step (oscillating cylinder) */
  {"-preset", "accurate", UNSTEADY | MOVING | LED, "-sim_adapt_displacement", "0.15"},
  {"-preset", "accurate", UNSTEADY | MOVING, "-sim_adapt_max", STEP},
  /* an instability makes more of the error of a step than its size tells: cL of 2D-3 0.31, 0.18 % off with whole and
     half the step, 0.28 % with a tolerance of 5e-7 */
  {"-preset", "accurate", UNSTEADY | STILL, "-sim_adapt", "true"},
  {"-preset", "accurate", UNSTEADY | STILL, "-sim_adapt_tolerance", "1e-5"},
  {"-preset", "accurate", UNSTEADY | STILL, "-sim_adapt_max", HALF_STEP},
  {"-preset", "accurate", UNSTEADY, "-flow_time", "bdf2"},
  /* swimmers exert no force, so that what a solve leaves moves them: sweeps alone 13 % */
  {"-preset", "fast", UNSTEADY | SWIMS | ASKED, "-flow_solver", "balanced"},
  /* nor do they carry the stress of an elastic body, or an interface: drop-static breaks within 8 steps */
  {"-preset", "fast", UNSTEADY | SOLIDS | ASKED, "-flow_solver", "balanced"},
  {"-preset", "fast", UNSTEADY | DROPS | ASKED, "-flow_solver", "balanced"},
  /* a disc in shear, 3 to 8 cells across, .34 to .09 % off lined up, 5.9 to 1.6 % immersed (runs/studies/elastic) */
  {"-preset", "fast", UNSTEADY | FOLLOWED | ASKED, "-couple_method", "aligned"},
  {"-preset", "balanced", UNSTEADY | FOLLOWED | ASKED, "-couple_method", "aligned"},
  {"-preset", "accurate", UNSTEADY | FOLLOWED | ASKED, "-couple_method", "aligned"},
  {"-preset", "fast", UNSTEADY | IMMERSED | ASKED, "-couple_method", "penalty"},
  {"-preset", "balanced", UNSTEADY | IMMERSED | ASKED, "-couple_method", "penalty"},
  {"-preset", "accurate", UNSTEADY | IMMERSED | ASKED, "-couple_method", "penalty"},
  /* the only one that knows them */
  {"-preset", "fast", UNSTEADY | COMPRESSIBLE | ASKED, "-flow_solver", "direct"},
  {"-preset", "balanced", UNSTEADY | COMPRESSIBLE | ASKED, "-flow_solver", "direct"},
  {"-preset", "accurate", UNSTEADY | COMPRESSIBLE | ASKED, "-flow_solver", "direct"},
  /* decay of a drop in a gas 1.3, .15, .01 % off by the step (couple/droplimit.c) */
  {"-preset", "fast", UNSTEADY | PLANE | DROPS | ASKED, "-couple_drops_steps", "60"},
  {"-preset", "balanced", UNSTEADY | PLANE | DROPS | ASKED, "-couple_drops_steps", "120"},
  {"-preset", "accurate", UNSTEADY | PLANE | DROPS | ASKED, "-couple_drops_steps", "300"},
  /* nothing holds the mean velocity there, and it gathers errors of momentum: 1 % of the speed of a disc in a box of 12
     radii, while it swims one */
  {NULL, NULL, UNSTEADY | SWIMS | ASKED | ADRIFT | PLANE, "-flow_rate", "0,0"},
  {NULL, NULL, UNSTEADY | SWIMS | ASKED | ADRIFT | SPATIAL, "-flow_rate", "0,0,0"},
  /* where elastic bodies are immersed the fields jump from cell to cell: steps differ by .003 of the speed, however
     short they are (soft-suspension; at 1e-4 and 1e-3 they shrank a hundredfold). Lined up they are smooth. */
  {"-sim_adapt", "true", UNSTEADY | SOLIDS, "-sim_adapt_tolerance", "1e-2"},
  {"-couple_method", "aligned", UNSTEADY | SOLIDS, "-sim_adapt_tolerance", "1e-4"},
  /* a step with drops cannot be taken again, and the penalty holds what is rigid beside them */
  {NULL, NULL, UNSTEADY | DROPS, "-sim_adapt", "false"},
  {NULL, NULL, DROPS | BODIES, "-couple_method", "penalty"},
  /* viscosities by cell, on cells of which some are nearly flat; tension is stiff along the interface: 2.6 to 4 sweeps
     of a velocity solve for 5 to 13 */
  {NULL, NULL, SPATIAL | FLUIDS, "-flow_velocity_operator", "assembled"},
  {NULL, NULL, DROPS, "-flow_velocity_smoother", "ilu"},
  /* air in water: the most iterations of a step 30, 46 at 1e-2, 15, 19 so, at no cost; elsewhere as many */
  {NULL, NULL, PLANE | DROPS, "-flow_fieldsplit_pressure_ksp_rtol", "1e-3"},
  /* a single sweep leaves more: largest of 5 steps in a row in the scenes of runs/ that it solves 0.011, 0.032 */
  {"-flow_solver", "fast", UNSTEADY | EMPTY, "-sim_check_momentum", "0.3"},
  /* the added mass, one step late, counts 3/2 times in bdf2: stable for added mass / body mass < 1 with be, about 1/2
     with bdf2 */
  {"-couple_type", "explicit", 0, "-flow_time", "be"},
  {NULL, NULL, STEADY | SMALL, "-flow_solver", "direct"},
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
  PetscBool   yes, whole, half, number;
  PetscReal   step;

  PetscFunctionBeginUser;
  for (size_t i = 0; i < NRULES; i++) {
    PetscCall(applies(i, situation, &yes));
    if (!yes || !RULES[i].then) continue;
    then = RULES[i].then;
    PetscCall(PetscStrcmp(then, STEP, &whole));
    PetscCall(PetscStrcmp(then, HALF_STEP, &half));
    if (whole || half) {
      PetscCall(OptPeek(STEP, text, sizeof(text)));
      PetscCall(OptPeekReal(STEP, &step, &number));
      if (!text[0]) continue;
      if (half && number) PetscCall(PetscSNPrintf(text, sizeof(text), "%.15g", (double)(step / 2)));
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
  if (line[0]) PetscCall(PetscPrintf(RunComm(), "preset %s replaces%s of the scene\n", preset, line));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Neither for a steady scene nor for a start from a steady flow */
static PetscErrorCode refuse_smoother(PetscBool steady)
{
  char      solver[64], initial[64];
  PetscBool fast, start;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-flow_solver", solver, sizeof(solver)));
  PetscCall(OptPeek("-flow_initial", initial, sizeof(initial)));
  PetscCall(PetscStrcasecmp(solver, "fast", &fast));
  PetscCall(PetscStrcasecmp(initial, "steady", &start));
  PetscCheck(!fast || !(steady || start), RunComm(), PETSC_ERR_USER_INPUT,
             "-flow_solver fast takes a sweep or two of a time step and solves no steady problem: use direct, balanced or accurate with %s",
             steady ? "-sim_steady" : "-flow_initial steady");
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_situation(const MeshLocal *l, Bodies bodies, int others, PetscBool steady, int *situation)
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
  /* in space MUMPS costs 12 times as much as iterations at 14,000 unknowns (runs/validate/scenes.md) */
  if (unknowns < (l->dim == 2 ? 1.5e6 : 1e4)) *situation |= SMALL;
  if (!still) *situation |= MOVING;
  for (PetscInt g = 0; bodies && g < s->ngroups; g++)
    for (PetscInt d = 0; d < l->dim; d++)
      if (s->group[g].motion.given && s->group[g].motion.amplitude[d] != 0) *situation |= LED;
  *situation |= others;
  if (s && s->nall) *situation |= BODIES | (still && !(others & SOLIDS) ? STILL : 0);
  else if (!others) *situation |= EMPTY;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is there nothing that drives or holds the fluid but bodies that go where they want? */
static PetscErrorCode find_drift(const MeshLocal *l, Bodies bodies, PetscBool *adrift)
{
  static const char *const OTHER[] = {"-flow_rate", "-flow_force", "-flow_gravity", "-couple_backflow"};
  const int                goes    = BODY_FREE_X | BODY_FREE_Y | (l->dim == 3 ? BODY_FREE_Z : 0);
  BodyState               *s;
  PetscBool                given;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  *adrift = PETSC_TRUE;
  for (PetscInt g = 0; g < s->ngroups; g++)
    if ((s->group[g].free & goes) != goes || s->group[g].motion.has_pivot) *adrift = PETSC_FALSE;
  for (PetscInt a = 0; a < l->dim; a++) *adrift = (PetscBool)(*adrift && l->period[a] > 0);
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(OTHER); i++) {
    PetscCall(OptHas(OTHER[i], &given));
    if (given) *adrift = PETSC_FALSE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does no body travel? *spins: one is free to turn */
static PetscErrorCode find_stay(Bodies bodies, PetscBool steady, PetscBool *stay, PetscBool *spins)
{
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  *stay  = PETSC_TRUE;
  *spins = PETSC_FALSE;
  for (PetscInt g = 0; g < s->ngroups; g++) {
    const BodyGroup *b       = &s->group[g];
    const PetscBool  jointed = (PetscBool)(b->motion.has_pivot || b->motion.has_hinge || b->motion.has_slide);

    if (b->free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z) || (b->free && jointed)) *stay = PETSC_FALSE;
    else if (!steady && (b->motion.given || jointed)) *stay = PETSC_FALSE;
    else if (b->free & BODY_FREE_ROTATION && b->count) *spins = PETSC_TRUE;
  }
  for (PetscInt k = 0; k < s->n && !steady; k++)
    for (PetscInt a = 0; a < 3; a++) *stay = (PetscBool)(*stay && s->u[k][a] == 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, stay, 1, COMPAT_MPI_BOOL, MPI_LAND, RunComm()));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Which presets line the mesh up in this situation, if they are asked for */
static PetscErrorCode find_aligned(int situation, PromiseScene *scene, const MeshLocal *l)
{
  PetscFunctionBeginUser;
  for (PetscInt p = 0; p < PROMISE_NPRESETS; p++) {
    const int narrow = PromiseIsNarrow(l, p, scene) ? NARROW : 0, here = situation | ASKED | narrow;

    for (size_t i = 0; i < NRULES; i++)
      if (RULES[i].option && !strcmp(RULES[i].option, "-preset") && !strcmp(RULES[i].value, PROMISE_PRESETS[p]) &&
          !strcmp(RULES[i].name, "-couple_method") && (here & RULES[i].situation) == RULES[i].situation)
        scene->aligned[p] = (PetscBool)!strcmp(RULES[i].then, "aligned");
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells that are made anew around bodies that travel: is their band wide enough in space, wherever they come to be? */
static PetscErrorCode will_line_up(PetscBool *lines_up)
{
  PetscBool track = PETSC_FALSE, has_option;
  PetscReal band  = 3;

  PetscFunctionBeginUser;
  PetscCall(OptPeekBool("-mesh_track", &track));
  PetscCall(OptPeekReal("-mesh_refine_distance", &band, &has_option));
  *lines_up = (PetscBool)(!track || band >= 4);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What presets that are asked for go by, beyond the situation */
static PetscErrorCode find_scene(Mesh mesh, Bodies bodies, PetscBool steady, PetscInt preset, int *situation,
                                 PromiseScene *scene)
{
  const MeshLocal *l;
  PetscBool        lines_up = PETSC_TRUE, stay = PETSC_TRUE, spins = PETSC_FALSE, adrift = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(find_stay(bodies, steady, &stay, &spins));
  if (l->hang) PetscCall(CoupleHasEvenCells(mesh, bodies, &lines_up));
  if (lines_up && l->hang && !stay) PetscCall(will_line_up(&lines_up));
  if (lines_up) *situation |= START;
  if (lines_up && (stay || !l->hang)) *situation |= LINES_UP;
  if (spins) *situation |= SPINS;
  if (BodiesHaveSlip(bodies)) *situation |= SWIMS;
  PetscCall(find_drift(l, bodies, &adrift));
  if (adrift) *situation |= ADRIFT;
  scene->spins  = spins;
  scene->steady = steady;
  PetscCall(StreamFind(mesh, bodies, steady, &scene->stream));
  if (!steady) PetscCall(SwingFind(l, bodies, &scene->swing));
  PetscCall(GapsFindNarrowest(mesh, bodies, steady, PROMISE_REACH, scene->gap));
  PetscCall(find_aligned(*situation, scene, l));
  if (PromiseIsNarrow(l, preset, scene)) *situation |= NARROW;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_solids(const MeshLocal *l, Bodies bodies, Solids solids, int *situation)
{
  SolidsState *s;
  PetscBool    can;

  PetscFunctionBeginUser;
  if (!solids) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SolidsGetState(solids, &s));
  PetscCall(SolidPromiseCanAlign(l, bodies, solids, &can));
  *situation |= SOLIDS | (can ? FOLLOWED : IMMERSED);
  if (SolidsHaveInnerFluid(solids)) *situation |= FLUIDS;
  for (PetscInt g = 0; g < s->ngroups; g++)
    if (s->group[g].compressible) *situation |= COMPRESSIBLE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DefaultsApply(Mesh mesh, Bodies bodies, Solids solids, Drops drops, PetscBool steady, char refusal[],
                             size_t len)
{
  const MeshLocal *l;
  LastingGap       none     = {.cells = PETSC_MAX_REAL, .group = -1};
  PromiseScene     scene    = {.gap = {none, none}, .swing = SWING_NONE};
  Replaced         replaced = {0};
  PetscInt         preset   = PROMISE_DEFAULT;
  PetscBool        given, commanded;
  int              situation = 0, others = 0;

  PetscFunctionBeginUser;
  PetscCall(OptHas("-preset", &given));
  PetscCall(OptChoice("-preset", PROMISE_PRESETS, &preset));
  PetscCall(OptDefault("-preset", PROMISE_PRESETS[preset]));
  commanded = OptIsArgument("-preset");
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(find_solids(l, bodies, solids, &others));
  if (drops) others |= DROPS | FLUIDS;
  PetscCall(find_situation(l, bodies, others, steady, &situation));
  if (situation & BODIES) PetscCall(find_scene(mesh, bodies, steady, preset, &situation, &scene));
  if (given) situation |= ASKED;
  if (commanded) PetscCall(take_from_scene(situation, &replaced));
  refusal[0] = 0;
  PetscCall(apply_rules(situation));
  if (given && bodies) PetscCall(PromiseRefuse(l, bodies, preset, &scene, refusal, len));
  if (!given && bodies) PetscCall(PromiseRemark(l, bodies, &scene));
  PetscCall(SolidPromiseCheck(mesh, bodies, solids, preset, given, refusal, len));
  if (given && drops) PetscCall(DropCellsCheck(l, drops, bodies, preset, refusal, len));
  PetscCall(UnprovenCheck(l, bodies, solids, preset, given, refusal, len));
  PetscCall(ScalarLayersCheck(l, bodies, preset, given, &scene, refusal, len));
  PetscCall(refuse_smoother(steady));
  PetscCall(list_replaced(PROMISE_PRESETS[preset], &replaced));
  /* options.txt, run again, promises no more than the run did */
  if (!given) PetscCall(PetscOptionsClearValue(NULL, "-preset"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DefaultsSetBand(PetscInt dim, PetscBool drops)
{
  static const char *const option       = "-mesh_refine_distance";
  char                     boundary[32] = "", preset[32] = "";
  PetscBool                penalty, aligned, accurate;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-couple_method", boundary, sizeof(boundary)));
  PetscCall(OptPeek("-preset", preset, sizeof(preset)));
  PetscCall(PetscStrcmp(preset, "accurate", &accurate));
  PetscCall(PetscStrcmp(boundary[0] ? boundary : "penalty", "penalty", &penalty));
  PetscCall(PetscStrcmp(boundary, "aligned", &aligned));
  if (dim == 3 && penalty && !accurate && !drops) PetscCall(OptDefault(option, "1.5"));
  if (aligned) PetscCall(OptDefault(option, "4")); /* four cells of one size around a surface */
  PetscFunctionReturn(PETSC_SUCCESS);
}
