/* BodyCoupling: E, O and the blocks of bodies are what the velocity operator has, under all three methods, with
   bodies that share nodes, in the plane and in space; the preconditioner made of them is symmetric and positive where
   the operator is; rows of the matrix that are gathered around bodies are the matrix's. */
/* ranks: 1 2 3 */
#include "core.h"
#include "couple/couple.h"
#include "flowcase.h"
#include "gathered.h"
#include "cellrelax.h"
#include "impl.h"
#include <sys/mman.h>

#define FLOW "-flow_density 1.3 -flow_viscosity 0.5 -flow_convection 0 "
#define DISCS \
  "-mesh_cells 20,20 -flow_gravity 0.5,-9 -particle_groups a,b -particle_a_shape circle -particle_a_density 1.5 -particle_a_radius 0.14 -particle_a_position 0.33,0.42 " \
  "-particle_b_shape circle -particle_b_radius 0.17 -particle_b_position 0.645,0.46 -particle_b_density 2 "
#define BALLS \
  "-mesh_dimension 3 -mesh_cells 7,7,7 -flow_gravity 0.5,-9,1 -particle_groups a,b -particle_a_shape circle -particle_a_density 1.5 -particle_b_density 2 -particle_a_radius 0.17 " \
  "-particle_a_position 0.31,0.42,0.5 -particle_b_shape circle -particle_b_radius 0.18 -particle_b_position 0.67,0.46,0.53 "

static const char *const SCENES[] = {DISCS "-couple_method penalty", DISCS "-couple_method nodal",
                                     DISCS "-couple_method aligned", DISCS "-couple_method penalty -particle_a_free x",
                                     BALLS "-couple_method penalty"};
#define NSCENES (PetscInt) PETSC_STATIC_ARRAY_LENGTH(SCENES)

typedef struct {
  Case       c;
  Couple     couple;
  FlowSolver fs;
  Vec        x, y;
} Setup;

/* After one step, whose operators stay */
static void open_setup(Setup *s, const char scene[])
{
  PetscInt           its;
  KSPConvergedReason reason;
  char               options[2048];

  OK(PetscSNPrintf(options, sizeof(options), FLOW "%s", scene));
  open_case(&s->c, options);
  OK(CoupleCreate(s->c.flow, s->c.bodies, &s->couple));
  OK(FlowBeginStep(s->c.flow, 0.01, 0.01));
  OK(CoupleUpdateGeometry(s->couple));
  OK(CoupleSolve(s->couple, &its, &reason));
  assert_true(reason > 0);
  OK(CoupleGetSolver(s->couple, &s->fs));
  OK(VecDuplicate(s->fs->vec.t_u, &s->x));
  OK(VecDuplicate(s->fs->vec.t_u, &s->y));
}

static void close_setup(Setup *s)
{
  OK(VecDestroy(&s->x));
  OK(VecDestroy(&s->y));
  OK(CoupleDestroy(&s->couple));
  close_case(&s->c);
}

/* Is this slot of u_r unknown? */
static PetscBool *find_free(const Setup *s)
{
  const ConstraintView *c = ConstraintGetView(s->fs->constraint);
  PetscBool            *free_slot;

  OK(PetscCalloc1(s->fs->nur, &free_slot));
  for (PetscInt i = 0; i < s->fs->nodal; i++) free_slot[i] = PETSC_TRUE;
  for (PetscInt j = 0; j < c->inert.n; j++) free_slot[c->inert.slot[j]] = PETSC_FALSE;
  for (PetscInt e = 0; e < c->nown * c->nr; e++)
    free_slot[s->fs->nodal + e] = (PetscBool)(ConstraintIsUnknown(c, c->own[e / c->nr], e % c->nr));
  return free_slot;
}

/* Noise in the free slots of nodes (nodal), of body `number` (or all), zero in the others */
#define ALL 99
static void fill(const Setup *s, const PetscBool free_slot[], PetscBool nodal, PetscInt number, PetscInt seed, Vec x)
{
  const ConstraintView *c = ConstraintGetView(s->fs->constraint);
  PetscReal            *a;

  OK(VecGetArrayWrite(x, &a));
  for (PetscInt i = 0; i < s->fs->nur; i++) a[i] = nodal && i < s->fs->nodal && free_slot[i] ? noise(seed + i) : 0;
  for (PetscInt e = 0; e < c->nown * c->nr; e++) {
    const PetscInt k = s->c.s->number[c->own[e / c->nr]], i = s->fs->nodal + e;

    if ((number == ALL || number == k) && free_slot[i]) a[i] = noise(seed + 31 * k + e % c->nr);
  }
  OK(VecRestoreArrayWrite(x, &a));
}

/* rigid rows from forces on bodies in local numbers */
static void deliver(FlowSolver fs, const PetscReal local[], PetscReal rigid[])
{
  OK(PetscArrayzero(rigid, ConstraintGetView(fs->constraint)->count * fs->nr));
  OK(ConstraintDeliverRigid(fs->constraint, local, rigid));
}

static void check_parts(Setup *s)
{
  FlowSolver            fs = s->fs;
  const ConstraintView *c  = ConstraintGetView(fs->constraint);
  const PetscInt        nr = fs->nr, nodal = fs->nodal;
  PetscBool            *free_slot = find_free(s);
  const PetscReal      *x, *y;
  PetscReal            *b, *local, *still, *rigid, size = 0, between = 0;

  OK(PetscCalloc3(fs->nur, &b, c->nlocal * nr, &local, c->count * nr, &rigid));
  for (PetscInt k = 0; k < 2; k++) { /* one body moves */
    fill(s, free_slot, PETSC_FALSE, k, 3, s->x);
    OK(MatMult(fs->op.Ar, s->x, s->y));
    OK(VecGetArrayRead(s->x, &x));
    OK(VecGetArrayRead(s->y, &y));
    OK(ConstraintFetchRigid(fs->constraint, x + nodal));
    for (PetscInt i = 0; i < nodal; i++) b[i] = y[i];
    size = PetscMax(size, max_abs(nodal, b));
    OK(BodyCouplingSubtract(fs->body.coupling, c->local_rigid, b));
    for (PetscInt i = 0; i < nodal; i++)
      if (free_slot[i]) BELOW(b[i], 1e-12 * size);
    OK(PetscArrayzero(local, c->nlocal * nr));
    OK(PetscArrayzero(b, nodal));
    OK(BodyCouplingAnswer(fs->body.coupling, b, c->local_rigid, local));
    deliver(fs, local, rigid);
    for (PetscInt i = 0; i < c->nown; i++) {
      for (PetscInt m = 0; m < nr && s->c.s->number[c->own[i]] == k; m++) {
        PetscReal sum = 0;

        for (PetscInt q = 0; q < nr; q++) sum += fs->body.body_inverse[(i * nr + m) * nr + q] * y[nodal + i * nr + q];
        NEAR(sum, x[nodal + i * nr + m], 1e-10);
      }
    }
    for (PetscInt e = 0; e < c->nown * nr; e++) {
      if (s->c.s->number[c->own[e / nr]] == k || !free_slot[nodal + e]) continue;
      NEAR(-rigid[e], y[nodal + e], 1e-12 * size);
      between = PetscMax(between, PetscAbsReal(rigid[e]));
    }
    OK(VecRestoreArrayRead(s->x, &x));
    OK(VecRestoreArrayRead(s->y, &y));
  }
  assert_true(largest(between) > 1e-6 * size);
  fill(s, free_slot, PETSC_TRUE, -1, 5, s->x);
  OK(MatMult(fs->op.Ar, s->x, s->y));
  OK(VecGetArrayRead(s->x, &x));
  OK(VecGetArrayRead(s->y, &y));
  OK(PetscArrayzero(local, c->nlocal * nr));
  OK(PetscCalloc1(c->nlocal * nr, &still));
  OK(BodyCouplingAnswer(fs->body.coupling, x, still, local));
  OK(PetscFree(still));
  deliver(fs, local, rigid);
  size = max_abs(c->nown * nr, y + nodal);
  for (PetscInt e = 0; e < c->nown * nr; e++)
    if (free_slot[nodal + e]) NEAR(-rigid[e], y[nodal + e], 1e-11 * size);
  OK(VecRestoreArrayRead(s->x, &x));
  OK(VecRestoreArrayRead(s->y, &y));
  OK(PetscFree3(b, local, rigid));
  OK(PetscFree(free_slot));
}

static void test_parts(void **state)
{
  (void)state;
  for (PetscInt i = 0; i < NSCENES; i++) {
    Setup s;

    open_setup(&s, SCENES[i]);
    check_parts(&s);
    close_setup(&s);
  }
}

/* Also of ghost nodes, with the terms of a penalty; in space a step makes do with them */
static void test_rows(void **state)
{
  static const char *const scenes[] =
    {DISCS "-couple_method penalty", BALLS "-couple_method penalty", BALLS "-couple_method nodal",
     BALLS
     "-couple_method penalty -mesh_cells 4,4,4 -mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.4,0.7,1"};

  (void)state;
  for (PetscInt i = 0; i < (PetscInt)PETSC_STATIC_ARRAY_LENGTH(scenes); i++) {
    Setup       s;
    PetscBool  *marked;
    PetscInt    nghost, nmarked = 0;
    PetscMPIInt size;

    open_setup(&s, scenes[i]);
    assert_int_equal(s.fs->body.near != NULL, i > 0);
    OK(PetscCalloc1(s.c.l->nnode_all, &marked));
    OK(BodyCouplingMarkNodes(s.fs->constraint, marked));
    OK(CellRelaxMarkNodes(s.c.l, s.fs->constraint, s.fs->pressure,
                          FlowSolverHasPenalty(s.fs) ? s.fs->body.penalty : NULL, marked));
    for (PetscInt n = 0; n < s.c.l->nnode_all; n++) nmarked += marked[n];
    assert_true(total((PetscReal)nmarked) > 0);
    nghost = compare_rows(s.c.flow, s.c.l, marked);
    OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
    assert_int_equal(total((PetscReal)nghost) > 0, size > 1);
    OK(PetscFree(marked));
    close_setup(&s);
  }
}

/* (M^{-1} x, y) = (x, M^{-1} y), (M^{-1} x, x) > 0 */
static void test_symmetric(void **state)
{
  static const char *const sweep[] = {" -flow_velocity_smoother sor", " -flow_velocity_smoother ilu",
                                      " -flow_velocity_smoother jacobi"};

  (void)state;
  for (PetscInt i = 0; i < NSCENES; i++) {
    Setup       s;
    Vec         to[2];
    PetscBool  *free_slot;
    PetscScalar cross[2], own[2];
    char        scene[1024];

    OK(PetscSNPrintf(scene, sizeof(scene), "%s%s", SCENES[i], sweep[i % 3]));
    open_setup(&s, scene);
    free_slot = find_free(&s);
    fill(&s, free_slot, PETSC_TRUE, ALL, 7, s.x);
    fill(&s, free_slot, PETSC_TRUE, ALL, 1007, s.y);
    for (PetscInt k = 0; k < 2; k++) {
      OK(VecDuplicate(s.x, &to[k]));
      OK(MatSOR(s.fs->op.Ar, k ? s.y : s.x, 1, (MatSORType)(SOR_LOCAL_SYMMETRIC_SWEEP | SOR_ZERO_INITIAL_GUESS), 0, 1,
                1, to[k]));
    }
    OK(VecDot(to[0], s.y, &cross[0]));
    OK(VecDot(to[1], s.x, &cross[1]));
    OK(VecDot(to[0], s.x, &own[0]));
    OK(VecDot(to[1], s.y, &own[1]));
    assert_true(own[0] > 0 && own[1] > 0);
    NEAR(cross[0], cross[1], 1e-6 * PetscSqrtReal(own[0] * own[1])); /* factors in single precision */
    OK(VecDestroy(&to[0]));
    OK(VecDestroy(&to[1]));
    OK(PetscFree(free_slot));
    close_setup(&s);
  }
}

/* A vector of another kind than PETSc's own two, such as one with a copy on a device, is read and never written, where
   the others are changed for the moment of a product: here its memory is protected. The same bits. */
static void test_foreign_vectors(void **state)
{
  Setup       s;
  Vec         foreign, z[2];
  PetscBool  *free_slot, same;
  PetscReal  *copy, norm;
  const char *type;
  size_t      bytes;

  (void)state;
  open_setup(&s, SCENES[0]);
  bytes = (size_t)s.fs->nur * sizeof(PetscReal) + 1;
  copy  = (PetscReal *)mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  assert_true(copy != MAP_FAILED);
  free_slot = find_free(&s);
  fill(&s, free_slot, PETSC_TRUE, ALL, 7, s.x);
  OK(VecDuplicate(s.x, &foreign));
  for (PetscInt i = 0; i < 2; i++) OK(VecDuplicate(s.x, &z[i]));
  {
    const PetscReal *x;

    OK(VecGetArrayRead(s.x, &x));
    OK(PetscArraycpy(copy, x, s.fs->nur));
    OK(VecRestoreArrayRead(s.x, &x));
  }
  assert_int_equal(mprotect(copy, bytes, PROT_READ), 0);
  OK(VecPlaceArray(foreign, copy));
  OK(VecGetType(s.x, &type));
  for (PetscInt k = 0; k < 2; k++) {
    for (PetscInt i = 0; i < 2; i++) {
      if (i) OK(PetscObjectChangeTypeName((PetscObject)foreign, "foreign"));
      if (k)
        OK(MatSOR(s.fs->op.Ar, i ? foreign : s.x, 1, (MatSORType)(SOR_LOCAL_SYMMETRIC_SWEEP | SOR_ZERO_INITIAL_GUESS),
                  0, 1, 1, z[i]));
      else OK(MatMult(s.fs->op.Ar, i ? foreign : s.x, z[i]));
    }
    OK(VecEqual(z[0], z[1], &same));
    assert_true(same);
    OK(VecNorm(z[0], NORM_2, &norm));
    assert_true(norm > 0);
  }
  OK(PetscObjectChangeTypeName((PetscObject)foreign, type));
  OK(VecResetArray(foreign));
  OK(VecDestroy(&foreign));
  for (PetscInt i = 0; i < 2; i++) OK(VecDestroy(&z[i]));
  OK(PetscFree(free_slot));
  assert_int_equal(munmap(copy, bytes), 0);
  close_setup(&s);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_parts), cmocka_unit_test(test_rows),
                                     cmocka_unit_test(test_symmetric), cmocka_unit_test(test_foreign_vectors)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("bodycoupling", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
