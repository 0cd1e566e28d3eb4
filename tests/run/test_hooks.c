/* What a step of rigid bodies in a Newtonian fluid asks of the extension points: every operation of the participants at
   most once, owners, operators and properties not at all. The functions that loop over them are counted in whole runs:
   those of the library find these here in their place. */
/* ranks: 1 2 */
#ifndef _GNU_SOURCE
  #define _GNU_SOURCE
#endif
#include "foldercase.h"
#include "couple/couple.h"
#include "run/scene.h"
#include <dlfcn.h>

#define STEPS 4
#define DISCS \
  "-mesh_cells 8,16 -mesh_lower 0,0 -mesh_upper 1,2 -flow_viscosity 0.1 -flow_density 1 -flow_gravity 0,-981 -particle_groups a,b " \
  "-particle_a_shape circle -particle_a_radius 0.2 -particle_a_density 1.5 -particle_a_position 0.5,1.3 -particle_b_shape circle " \
  "-particle_b_radius 0.15 -particle_b_density 1.2 -particle_b_position 0.45,0.5 -sim_dt 0.001 -sim_steps 4 -output_every 0 " \
  "-output_overwrite -output_dir "

enum {
  GEOMETRY,
  ASSEMBLE,
  SOLVE,
  FORCE,
  MOMENTUM,
  POWER,
  LIMIT,
  ADVANCE,
  TERMS,
  NEVER, /* all below */
  NCALLS
};

static PetscInt calls[NCALLS];

/* The library's own */
#define COUNTED(call, name, given, passed) \
  PetscErrorCode name given \
  { \
    PetscErrorCode(*next) given; \
    *(void **)&next = dlsym(RTLD_NEXT, #name); \
    calls[call]++; \
    return next passed; \
  }

COUNTED(GEOMETRY, CoupleUpdateGeometry, (Couple c), (c))
COUNTED(ASSEMBLE, CoupleAssemble, (Couple c), (c))
COUNTED(SOLVE, CoupleSolve, (Couple c, PetscInt *its, KSPConvergedReason *reason), (c, its, reason))
COUNTED(FORCE, CoupleForce, (Couple c), (c))
COUNTED(MOMENTUM, CoupleMomentum, (Couple c, const FlowDiagnostics *d, CoupleBalance *b), (c, d, b))
COUNTED(POWER, CoupleGetPower, (Couple c, CouplePower *p), (c, p))
COUNTED(LIMIT, CoupleLimitStep, (Couple c, PetscReal *dt, const char **who), (c, dt, who))
COUNTED(ADVANCE, CoupleAdvance, (Couple c), (c))
COUNTED(TERMS, FlowAddCellTerms, (Flow f, const void *owner, PetscInt n, const PetscInt cell[], const PetscReal m[]),
        (f, owner, n, cell, m))
COUNTED(NEVER, FlowAddForce, (Flow f, const void *owner, const PetscReal force[]), (f, owner, force))
COUNTED(NEVER, FlowAddOperator, (Flow f, const void *owner, const FlowOperator *of), (f, owner, of))
COUNTED(NEVER, FlowMultiplyOperators, (Flow f, Vec x, Vec y), (f, x, y))
COUNTED(NEVER, FlowSetProperties, (Flow f, const PetscReal density[], const PetscReal viscosity[]),
        (f, density, viscosity))

static void count(const char method[])
{
  char text[2048];

  memset(calls, 0, sizeof(calls));
  OK(PetscOptionsClear(NULL));
  snprintf(text, sizeof(text), DISCS "%s/%s -couple_method %s", folder, method, method);
  OK(PetscOptionsInsertString(NULL, text));
  OK(SceneRun(PETSC_COMM_WORLD, method));
}

static void test_once_a_step(void **state)
{
  static const char *const METHOD[] = {"nodal", "penalty", "aligned"};

  (void)state;
  for (PetscInt m = 0; m < 3; m++) {
    count(METHOD[m]);
    assert_in_range(calls[GEOMETRY], STEPS, STEPS + 1); /* before the first step the solver is set up */
    assert_int_equal(calls[ASSEMBLE], STEPS);
    assert_int_equal(calls[SOLVE], STEPS);
    assert_int_equal(calls[FORCE], STEPS);
    assert_int_equal(calls[ADVANCE], STEPS);
    assert_int_equal(calls[LIMIT], STEPS);
    assert_int_equal(calls[MOMENTUM], STEPS);
    assert_in_range(calls[POWER], 0, STEPS + 1);
    assert_in_range(calls[TERMS], 0, m == 1 ? STEPS + 2 : 1); /* of the penalty, and when it goes */
    assert_int_equal(calls[NEVER], 0);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_once_a_step)};
  int                     failed;

  if (begin_folder(&argc, &argv, "hooks")) return 1;
  failed = cmocka_run_group_tests_name("hooks", tests, NULL, NULL);
  return end_folder(failed);
}
