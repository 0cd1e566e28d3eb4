/* E and the blocks of bodies as a device makes them are those of rows of the matrix that are gathered around bodies:
   bodies that share nodes, under a penalty or with nodes of their own, at walls, where nodes hang, in convection. */
#include "core.h"
#include "couple/couple.h"
#include "flow/device.h"
#include "flowcase.h"
#include "impl.h"

#define CLOSE 1e-12 /* of the largest */

#define BALLS \
  "-mesh_dimension 3 -mesh_cells 7,7,7 -flow_density 1.3 -flow_viscosity 0.05 -flow_gravity 0.5,-9,1 -flow_velocity 0.5*y,0.3*z,0.2*x " \
  "-flow_velocity_operator matrix_free -device emulate -particle_groups a,b -particle_a_shape circle -particle_a_density 1.5 -particle_b_density 2 " \
  "-particle_a_radius 0.17 -particle_b_shape circle -particle_b_radius 0.18 "
#define APART     "-particle_a_position 0.25,0.3,0.5 -particle_b_position 0.7,0.65,0.53 "
#define NEAR_EACH "-particle_a_position 0.31,0.42,0.5 -particle_b_position 0.67,0.46,0.53 "

static const char *const SCENES[] =
  {BALLS APART "-couple_method penalty",
   BALLS NEAR_EACH "-couple_method penalty",
   BALLS NEAR_EACH "-couple_method nodal",
   BALLS NEAR_EACH "-couple_method penalty -particle_a_free x",
   BALLS NEAR_EACH "-couple_method penalty -particle_a_free none",
   BALLS
   "-couple_method penalty -particle_a_position 0.18,0.19,0.5 -particle_b_position 0.82,0.46,0.53 -mesh_periodic x",
   BALLS NEAR_EACH
   "-couple_method penalty -mesh_cells 4,4,4 -mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.4,0.7,1"};

/* What the pairs hold, by nodes and bodies, dense: e [nlocal][nnode][4] */
typedef struct {
  PetscReal *e, *own, *answer;
} Coupled;

static void open_coupled(FlowSolver fs, Coupled *d)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);

  OK(PetscCalloc3(c->nlocal * fs->loc->nnode * 4, &d->e, c->nbodies * 36, &d->own, c->nlocal * 6, &d->answer));
}

/* The blocks of single bodies, and what bodies answer to each other */
static void take_blocks(FlowSolver fs, const PetscReal own[], Coupled *d)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  PetscReal            *U;

  OK(PetscArraycpy(d->own, own, c->nbodies * 36));
  OK(PetscMalloc1(c->nlocal * 6, &U));
  for (PetscInt i = 0; i < c->nlocal * 6; i++) U[i] = noise(i);
  OK(BodyCouplingAnswerBodies(fs->body.coupling, U, d->answer));
  OK(PetscFree(U));
}

static void take_device(FlowSolver fs, const PenaltyTerm *penalty, Coupled *d)
{
  const DevicePairs *p = &fs->device.body.coupling.on; /* the emulation's memory is the processor's */
  const PetscReal   *own;

  assert_true(FlowSolverCouplesOnDevice(fs));
  OK(FlowSolverListPenaltyOnDevice(fs));
  OK(FlowSolverCoupleOnDevice(fs, penalty, &own));
  open_coupled(fs, d);
  take_blocks(fs, own, d);
  for (int k = 0; k < p->nbody; k++)
    for (int i = p->start[k]; i < p->start[k + 1]; i++) {
      assert_int_equal(p->body[i], k);
      for (PetscInt m = 0; m < 4; m++) {
        PetscReal *to = d->e + ((PetscInt)k * fs->loc->nnode + p->at[i]) * 4 + m;

        assert_true(*to == 0);
        *to = p->value[m * p->n + i];
      }
    }
}

static void take_host(FlowSolver fs, const PenaltyTerm *penalty, Coupled *d)
{
  struct _p_BodyCouplingView v;
  const PetscReal           *own;

  OK(FlowSolverGatherRows(fs));
  OK(BodyCouplingUpdate(fs->body.coupling, fs->body.near, penalty, &own));
  open_coupled(fs, d);
  take_blocks(fs, own, d);
  BodyCouplingGetView(fs->body.coupling, &v);
  for (PetscInt i = 0; i < v.nnode; i++)
    for (PetscInt e = v.start[i]; e < v.start[i + 1]; e++)
      OK(PetscArraycpy(d->e + (v.body[e] * fs->loc->nnode + v.node[i]) * 4, v.e + e * 4, 4));
}

static void compare(PetscInt n, const PetscReal a[], const PetscReal b[])
{
  BELOW(max_difference(n, a, b), CLOSE * max_abs(n, b));
}

static void check_scene(const char scene[])
{
  Case                  s;
  Couple                couple;
  FlowSolver            fs;
  PetscInt              its;
  KSPConvergedReason    reason;
  Coupled               there, here;
  const ConstraintView *c;
  const PenaltyTerm    *penalty;

  open_case(&s, scene);
  OK(CoupleCreate(s.flow, s.bodies, &couple));
  OK(FlowBeginStep(s.flow, 0.001, 0.001));
  OK(CoupleUpdateGeometry(couple));
  OK(CoupleSolve(couple, &its, &reason));
  assert_true(reason > 0);
  OK(CoupleGetSolver(couple, &fs));
  c       = ConstraintGetView(fs->constraint);
  penalty = FlowSolverHasPenalty(fs) ? fs->body.penalty : NULL;
  take_device(fs, penalty, &there);
  take_host(fs, penalty, &here);
  assert_true(max_abs(c->nlocal * fs->loc->nnode * 4, here.e) > 0);
  compare(c->nlocal * fs->loc->nnode * 4, there.e, here.e);
  compare(c->nbodies * 36, there.own, here.own);
  compare(c->nlocal * 6, there.answer, here.answer);
  OK(PetscFree3(there.e, there.own, there.answer));
  OK(PetscFree3(here.e, here.own, here.answer));
  OK(CoupleDestroy(&couple));
  close_case(&s);
}

static void test_coupling(void **state)
{
  (void)state;
  for (PetscInt i = 0; i < (PetscInt)PETSC_STATIC_ARRAY_LENGTH(SCENES); i++) check_scene(SCENES[i]);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_coupling)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("devicecoupling", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
