/* Couple: rigid bodies in a Newtonian fluid pay nothing for other materials. Each operation of each participant is
   called at most once a step, and participants of other materials are not there. */
/* ranks: 1 2 */
#include "core.h"
#include "calls.h"
#include "couple/couple.h"
#include "impl.h"

#define MAX_ENTRIES 32
#define STEPS       4
#define SCENE \
  "-mesh_cells 16,16 -flow_density 1 -flow_viscosity 0.1 -flow_gravity 0,-9 -particle_groups disc -particle_disc_shape circle " \
  "-particle_disc_radius 0.15 -particle_disc_density 2 -particle_disc_position 0.5,0.6 "

/* A participant as it is, with a table that counts its calls */
typedef struct {
  CoupleEntry       is;
  CoupleParticipant table;
  PetscInt          n[NCALLS];
} Counted;

static Counted counted[MAX_ENTRIES];

#define COUNT(verb, which, parameters, ...) \
  static PetscErrorCode verb parameters \
  { \
    Counted *e = (Counted *)data; \
\
    e->n[which]++; \
    return (*e->is.op->verb)(c, e->is.data, ##__VA_ARGS__); \
  }
COUNT(begin, BEGIN, (Couple c, void *data))
COUNT(prepare, PREPARE, (Couple c, void *data))
COUNT(rows, ROWS, (Couple c, void *data))
COUNT(assemble, ASSEMBLE, (Couple c, void *data))
COUNT(start, START, (Couple c, void *data))
COUNT(solved, SOLVED, (Couple c, void *data))
COUNT(force, FORCE, (Couple c, void *data))
COUNT(balance, BALANCE, (Couple c, void *data, const FlowDiagnostics *d, CoupleBalance *b), d, b)
COUNT(energy, ENERGY, (Couple c, void *data, CouplePower *w), w)
COUNT(limit, LIMIT, (Couple c, void *data, PetscReal *dt), dt)
COUNT(advance, ADVANCE, (Couple c, void *data))
COUNT(mesh_updated, MESH_UPDATED, (Couple c, void *data))

/* The tables of all participants are replaced by such that count, or come back */
static void count_calls(Couple c, PetscBool on)
{
  assert_true(c->nparticipants <= MAX_ENTRIES);
  for (PetscInt i = 0; i < c->nparticipants; i++) {
    Counted *e = &counted[i];

    if (!on) {
      c->participant[i] = e->is;
      continue;
    }
    *e = (Counted){.is = c->participant[i]};
#define REPLACE(verb) .verb = e->is.op->verb ? verb : NULL
    e->table          = (CoupleParticipant){.name = e->is.op->name,
                                            REPLACE(begin),
                                            REPLACE(prepare),
                                            REPLACE(rows),
                                            REPLACE(assemble),
                                            REPLACE(start),
                                            REPLACE(solved),
                                            REPLACE(force),
                                            REPLACE(balance),
                                            REPLACE(energy),
                                            REPLACE(limit),
                                            REPLACE(advance),
                                            REPLACE(mesh_updated)};
    c->participant[i] = (CoupleEntry){&e->table, e};
  }
}

static void check_calls(Couple c)
{
  const char *const absent[] = {"drops", "elastic", "joints", "scalars", "slip"};
  PetscInt          all      = 0;

  for (PetscInt i = 0; i < c->nparticipants; i++) {
    const Counted *e = &counted[i];

    for (size_t j = 0; j < sizeof(absent) / sizeof(absent[0]); j++) assert_string_not_equal(e->is.op->name, absent[j]);
    for (PetscInt j = 0; j < NCALLS; j++) {
      if (e->n[j] > STEPS)
        print_error("%s: operation %d, %d calls in %d steps\n", e->is.op->name, (int)j, (int)e->n[j], STEPS);
      assert_true(e->n[j] <= STEPS);
      all += e->n[j];
    }
  }
  assert_true(all >= 8 * STEPS); /* it does count */
}

static void check(const char options[])
{
  const PetscReal *u, *p;
  Mesh             mesh;
  Flow             flow;
  Bodies           bodies;
  Couple           couple;
  const MeshLocal *l;

  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(MeshGetLocal(mesh, &l));
  OK(FlowCreate(mesh, &flow));
  OK(BodiesCreate(l->dim, l->lower, l->upper, &bodies));
  OK(CoupleCreate(flow, bodies, &couple));
  assert_false(FlowHasSymmetricStress(flow) || FlowIsViscoelastic(flow) || FlowSeesSurfaces(flow));
  count_calls(couple, PETSC_TRUE);
  for (PetscInt i = 1; i <= STEPS; i++) {
    PetscReal          dt = 0.01;
    const char        *who;
    PetscInt           its;
    KSPConvergedReason reason;
    FlowDiagnostics    d;
    CoupleBalance      b;
    CouplePower        w;

    OK(CoupleLimitStep(couple, &dt, &who));
    OK(FlowBeginStep(flow, 0.01 * (PetscReal)i, 0.01));
    OK(CoupleUpdateGeometry(couple));
    OK(CoupleSolve(couple, &its, &reason));
    assert_true(reason > 0);
    OK(CoupleForce(couple));
    OK(CoupleGetSolution(couple, &u, &p));
    OK(FlowDiagnose(flow, u, p, &d));
    OK(CoupleMomentum(couple, &d, &b));
    OK(CoupleGetPower(couple, &w));
    OK(CoupleAdvance(couple));
  }
  check_calls(couple);
  assert_false(FlowHasOperators(flow));
  count_calls(couple, PETSC_FALSE);
  OK(CoupleDestroy(&couple));
  OK(BodiesDestroy(&bodies));
  OK(FlowDestroy(&flow));
  OK(MeshDestroy(&mesh));
}

static void test_nodal(void **state)
{
  (void)state;
  check(SCENE "-couple_method nodal");
  check(SCENE "-couple_method nodal -couple_type explicit");
}

static void test_penalty(void **state)
{
  (void)state;
  check(SCENE "-couple_method penalty");
}

static void test_aligned(void **state)
{
  (void)state;
  check(SCENE "-couple_method aligned");
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_nodal), cmocka_unit_test(test_penalty),
                                     cmocka_unit_test(test_aligned)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("hooks", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
