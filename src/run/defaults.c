/* Defaults: see defaults.h. Those of PETSc's solver objects stand where these are made. */
#include "compat.h"
#include "defaults.h"
#include "base/opt.h"

/* Situations of a scene, to be or-ed */
enum {
  UNSTEADY = 1,
  STEADY   = 2,
  PLANE    = 4,
  SPATIAL  = 8,
  SMALL    = 16 /* for a direct solver */
};

/* In all of these situations, and with this option at this value (NULL: any scene), the default of `name` is `then`. Of
   two rows that hold the later wins. Presets: runs/studies/tradeoff. */
static const struct {
  const char *option, *value;
  int         situation;
  const char *name, *then;
} RULES[] = {
  {"-preset", "fast", UNSTEADY, "-flow_recipe", "fast"},
  {"-preset", "fast", 0, "-couple_boundary", "penalty"},
  {"-preset", "fast", UNSTEADY, "-flow_time", "bdf2"},
  {"-preset", "balanced", UNSTEADY, "-flow_recipe", "balanced"},
  {"-preset", "balanced", 0, "-couple_boundary", "penalty"},
  {"-preset", "balanced", UNSTEADY, "-flow_time", "bdf2"},
  {"-preset", "accurate", UNSTEADY, "-flow_recipe", "accurate"},
  {"-preset", "accurate", PLANE, "-couple_boundary", "snap"},
  {"-preset", "accurate", SPATIAL, "-couple_boundary", "penalty"},
  {"-preset", "accurate", UNSTEADY, "-flow_time", "bdf2"},
  /* a single sweep leaves more: largest of 5 steps in a row in the scenes of runs/ that it solves 0.011, 0.032 */
  {"-flow_recipe", "fast", UNSTEADY, "-sim_judge_divergence", "0.1"},
  {"-flow_recipe", "fast", UNSTEADY, "-sim_judge_momentum", "0.3"},
  /* the added mass, one step late, counts 3/2 times in bdf2: stable for added mass / body mass < 1 with be, about 1/2
     with bdf2 */
  {"-couple_type", "explicit", 0, "-flow_time", "be"},
  {NULL, NULL, STEADY | SMALL, "-flow_recipe", "direct"},
  {NULL, NULL, STEADY, "-flow_ksp_rtol", "1e-6"}, /* of a correction; the tolerance of the solution is
                                                     -flow_snes_rtol */
};

static PetscErrorCode apply_rule(size_t i, int situation)
{
  char      text[64];
  PetscBool same = PETSC_TRUE;

  PetscFunctionBeginUser;
  if (RULES[i].option) {
    PetscCall(OptPeek(RULES[i].option, text, sizeof(text)));
    PetscCall(PetscStrcasecmp(text, RULES[i].value, &same));
  }
  if (same && (situation & RULES[i].situation) == RULES[i].situation) PetscCall(OptDefault(RULES[i].name, RULES[i].then));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode refuse_fast(void)
{
  char      recipe[64];
  PetscBool fast;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-flow_recipe", recipe, sizeof(recipe)));
  PetscCall(PetscStrcasecmp(recipe, "fast", &fast));
  PetscCheck(!fast, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "-flow_recipe fast is one projection sweep of a time step and solves no steady problem: use direct, balanced or accurate with -sim_steady");
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DefaultsApply(const MeshLocal *l, PetscBool steady)
{
  static const char *const PRESETS[] = {"fast", "balanced", "accurate", NULL};
  const PetscReal          unknowns  = (PetscReal)l->nnode_global * l->dim + (PetscReal)l->ncell_global * (l->dim + 1);
  int                      situation = (steady ? STEADY : UNSTEADY) | (l->dim == 2 ? PLANE : SPATIAL);
  PetscInt                 preset    = -1; /* none */

  PetscFunctionBeginUser;
  PetscCall(OptChoice("-preset", PRESETS, &preset));
  if (steady) PetscCall(refuse_fast());
  if (unknowns < (l->dim == 2 ? 1.5e6 : 2e5)) situation |= SMALL;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(RULES); i++) PetscCall(apply_rule(i, situation));
  PetscFunctionReturn(PETSC_SUCCESS);
}
