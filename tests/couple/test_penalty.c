/* Penalty: the parts of cells add up to the body and are the sums of their samples, a rigid motion meets no penalty,
   momentum is balanced for fixed and free bodies, at walls and in shared cells; 3D. */
/* ranks: 1 2 3 */
#include "couple/couple.h"
#include "flowcase.h"
#include "penalty.h"

#define BOX  "-mesh_cells 20,20 -flow_density 1.3 -flow_viscosity 0.05 -flow_gravity 0.5,-9 "
#define RUNG "-couple_method penalty -flow_ksp_rtol 1e-11 -flow_ksp_max_it 300 "
#define DISC "-particle_groups disc -particle_disc_shape circle "

/* ---- the term itself ---- */

static PetscReal volume_of_parts(const Case *c, Penalty p)
{
  const CutCell *part;
  CutCells       parts;
  PetscReal      sum = 0;
  PetscInt       n;

  OK(PenaltyGetCutCells(p, &parts));
  OK(CutCellsGet(parts, &n, &part));
  for (PetscInt i = 0; i < n; i++) sum += part[i].cell < c->l->ncell ? part[i].volume : 0;
  return total(sum);
}

/* One step's penalty of bodies as placed by the options */
static void draw(Case *c, Penalty *p, Indicator *mark)
{
  OK(PenaltyCreate(c->flow, c->bodies, p));
  OK(IndicatorCreate(c->mesh, c->bodies, mark));
  OK(FlowBeginStep(c->flow, 0.01, 0.01));
  OK(PenaltyUpdateGeometry(*p, c->s->x, c->s->q, c->s->x, NULL, *mark));
  OK(IndicatorFinish(*mark));
}

static void test_volume(void **state)
{
  (void)state;
  const struct {
    const char *options;
    PetscReal   volume, tolerance;
  } body[] = {{BOX DISC "-particle_disc_radius 0.2 -particle_disc_free none -particle_disc_position 0.437,0.521",
               PETSC_PI * 0.04, 2e-4},
              {BOX DISC "-particle_disc_radius 0.02 -particle_disc_free none -particle_disc_position 0.437,0.521",
               PETSC_PI * 4e-4, 2e-2},
              {BOX "-mesh_periodic x,y " DISC
                   "-particle_disc_radius 0.2 -particle_disc_free none -particle_disc_position 0.97,0.04",
               PETSC_PI * 0.04, 2e-4},
              {"-mesh_dimension 3 -mesh_cells 5,5,5 " DISC
               "-particle_disc_radius 0.27 -particle_disc_free none -particle_disc_position 0.46,0.52,0.5",
               4 / 3.0 * PETSC_PI * 0.27 * 0.27 * 0.27, 2e-3}};

  for (PetscInt i = 0; i < (PetscInt)PETSC_STATIC_ARRAY_LENGTH(body); i++) {
    Case      c;
    Penalty   p;
    Indicator mark;

    open_case(&c, body[i].options);
    draw(&c, &p, &mark);
    NEAR(volume_of_parts(&c, p) / body[i].volume, 1, body[i].tolerance);
    OK(IndicatorDestroy(&mark));
    OK(PenaltyDestroy(&p));
    close_case(&c);
  }
}

/* Moments [6][6][6] of a cell that is a box, by all n^3 samples one after the other */
static void sum_samples(const Case *c, PetscInt cell, PetscInt n, PetscReal m[])
{
  const PetscReal *size;
  PetscReal        xc[MESH_MAX_NB * 3], x[3], d;

  OK(FlowGetCellSize(c->flow, &size));
  OK(MeshCellCoordinates(c->mesh, cell, xc));
  for (PetscInt e = 0; e < CUT_MOMENTS; e++) m[e] = 0;
  for (PetscInt q = 0; q < n * n * n; q++) {
    const PetscInt at[3] = {q % n, q / n % n, q / n / n};
    PetscReal      pair[3][6], w = 1;

    for (PetscInt a = 0; a < 3; a++) {
      const PetscReal s = (2 * at[a] + 1.0) / n - 1, edge = xc[26 * 3 + a] - xc[a];
      const PetscReal f[3] = {s * (s - 1) / 2, 1 - s * s, s * (s + 1) / 2};

      x[a] = xc[a] + edge * (s + 1) / 2;
      w *= edge / n;
      for (PetscInt i = 0, p = 0; i < 3; i++)
        for (PetscInt j = i; j < 3; j++) pair[a][p++] = f[i] * f[j];
    }
    OK(BodiesDistance(c->bodies, 0, NULL, NULL, 1, x, &d));
    w *= PetscMax(0, PetscMin(1, 0.5 - d * n / size[cell]));
    for (PetscInt e = 0; e < CUT_MOMENTS; e++) m[e] += w * pair[0][e % 6] * pair[1][e / 6 % 6] * pair[2][e / 36];
  }
}

/* Blocks of samples that are far from a surface are not measured, whole cells are summed by axes: the moments are those
   of all samples, and no cell is missing */
static void check_samples(const char options[], PetscInt n)
{
  Case             c;
  CutCells         parts;
  const CutCell   *part;
  const PetscReal *got;
  PetscReal        want[CUT_MOMENTS], volume = 0, sum = 0;
  PetscInt         npart, whole = 0;

  open_case(&c, options);
  OK(CutCellsCreate(c.flow, c.bodies, n, &parts));
  OK(CutCellsCut(parts, c.s->x, c.s->q, c.s->x, NULL));
  OK(CutCellsGet(parts, &npart, &part));
  for (PetscInt t = 0; t < npart; t++) {
    OK(CutCellsGetMoments(parts, part + t, &got));
    sum_samples(&c, part[t].cell, n, want);
    for (PetscInt e = 0; e < CUT_MOMENTS; e++) BELOW(got[e] - want[e], 1e-12 * part[t].volume);
    whole += part[t].moments < 0;
    volume += part[t].volume;
  }
  for (PetscInt cell = 0; cell < c.l->ncell_all; cell++) {
    sum_samples(&c, cell, n, want); /* functions of an axis add up to 1: so do their products */
    for (PetscInt e = 0; e < CUT_MOMENTS; e++)
      sum += want[e] * (e % 6 % 5 == 0 || e % 6 == 3 ? 1 : 2) * (e / 6 % 6 % 5 == 0 || e / 6 % 6 == 3 ? 1 : 2) *
             (e / 36 % 5 == 0 || e / 36 == 3 ? 1 : 2);
  }
  NEAR(volume, sum, 1e-12 * volume);
  assert_true(total(whole) > 0 && total(npart - whole) > 0);
  OK(CutCellsDestroy(&parts));
  close_case(&c);
}

static void test_samples(void **state)
{
#define SPACE  "-mesh_dimension 3 -mesh_upper 1,1.2,1 -mesh_cells 6,7,5 -particle_groups a -particle_a_free none "
#define TURNED "-particle_a_position 0.46,0.62,0.5 -particle_a_axis 1,2,0 -particle_a_angle 0.5 "
  (void)state;
  check_samples(SPACE TURNED "-particle_a_shape circle -particle_a_radius 0.35", 10);
  check_samples(SPACE TURNED "-particle_a_shape circle -particle_a_radius 0.35", 20);
  check_samples(SPACE TURNED "-particle_a_shape circle -particle_a_radius 0.35", 3);
  check_samples(SPACE TURNED "-particle_a_shape ellipse -particle_a_a 0.4 -particle_a_b 0.3 -particle_a_c 0.35 "
                             "-mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.5,0.6,0.5",
                7);
  check_samples(SPACE TURNED "-particle_a_shape box -particle_a_size 0.6,0.7,0.5", 10);
}

/* What a device draws is what the host has: of whole cells, and of cells that a ball cuts (ball: that all are) */
static void check_drawn(const char options[], PetscInt n, PetscBool ball)
{
  const DeviceQueue q     = {.run = DeviceGetKernels("cpu")};
  const int         place = 37;
  Case              c;
  CutCells          parts;
  const CutCell    *part;
  const PetscReal  *want;
  PetscReal         got[2 * CUT_MOMENTS * DEVICE_GROUP];
  PetscInt          npart, drawn = 0, whole = 0;

  open_case(&c, options);
  OK(CutCellsCreate(c.flow, c.bodies, n, &parts));
  OK(CutCellsCut(parts, c.s->x, c.s->q, c.s->x, NULL));
  OK(CutCellsGet(parts, &npart, &part));
  for (PetscInt t = 0; t < npart; t++) {
    DeviceBall b;

    whole += part[t].moments < 0;
    OK(CutCellsGetBall(parts, part + t, 3, &b));
    if (!(b.edge[0] > 0)) continue;
    drawn++;
    OK((*q.run->body.make_moments)(&q, 1, (int)n, &place, &b, got));
    OK(CutCellsGetMoments(parts, part + t, &want));
    for (PetscInt m = 0; m < CUT_MOMENTS; m++)
      BELOW(got[(CUT_MOMENTS + m) * DEVICE_GROUP + place % DEVICE_GROUP] - 3 * want[m], 1e-12 * 3 * part[t].volume);
  }
  assert_int_equal(drawn, ball ? npart : whole);
  OK(CutCellsDestroy(&parts));
  close_case(&c);
}

static void test_drawn(void **state)
{
#define THERE "-device emulate -flow_velocity_operator matrix_free "
#define BALL  "-particle_a_shape circle -particle_a_radius 0.35 "
  (void)state;
  check_drawn(THERE SPACE TURNED BALL, 10, PETSC_TRUE);
  check_drawn(THERE SPACE TURNED BALL
              "-mesh_periodic x -mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.5,0.6,0.5",
              20, PETSC_TRUE);
  check_drawn(THERE SPACE TURNED "-particle_a_shape ellipse -particle_a_a 0.4 -particle_a_b 0.3 -particle_a_c 0.35", 10,
              PETSC_FALSE);
}

/* y = (S with the penalty - S without) x at own nodes, one component */
static void multiply_penalty(Case *c, Penalty p, const PetscReal x[], PetscReal y[])
{
  Mat S;
  Vec a, b;

  for (PetscInt pass = 0; pass < 2; pass++) {
    const PetscReal *v;
    PetscReal       *w;

    if (pass == 1) OK(FlowAddCellTerms(c->flow, p, 0, NULL, NULL));
    OK(FlowAssemble(c->flow));
    OK(FlowGetMatrix(c->flow, &S));
    OK(MatCreateVecs(S, &a, &b));
    OK(VecGetArrayWrite(a, &w));
    OK(PetscArraycpy(w, x, c->l->nnode));
    OK(VecRestoreArrayWrite(a, &w));
    OK(MatMult(S, a, b));
    OK(VecGetArrayRead(b, &v));
    for (PetscInt i = 0; i < c->l->nnode; i++) y[i] = pass == 0 ? v[i] : y[i] - v[i];
    OK(VecRestoreArrayRead(b, &v));
    OK(VecDestroy(&a));
    OK(VecDestroy(&b));
  }
}

/* In a rigid motion of the body the matrix and the entries cancel at every node, and so do they in the body's own
   equation: what the flow receives the body gives */
static void test_rigid_motion_is_free(void **state)
{
  (void)state;
  for (PetscInt m = 0; m < 3; m++) {
    Case               c;
    Penalty            p;
    Indicator          mark;
    const PenaltyTerm *soft;
    const PetscInt    *strong;
    PetscReal          U[3] = {m == 0, m == 1, m == 2}, out[3] = {0, 0, 0}, *u, *y, largest_term = 0;
    Constraint         constraint;

    open_case(&c, BOX "-mesh_periodic x " DISC
                      "-particle_disc_radius 0.2 -particle_disc_free none -particle_disc_position 0.91,0.521");
    draw(&c, &p, &mark);
    OK(PenaltyGetTerm(p, &soft));
    OK(IndicatorGetNodes(mark, &strong, NULL, NULL));
    OK(ConstraintCreate(c.mesh, 1, &constraint));
    OK(PetscCalloc2(c.l->nnode * 2, &u, c.l->nnode, &y));
    for (PetscInt i = 0; i < c.l->nnode; i++) {
      PetscReal R[6];

      if (soft->relative_to[i] < 0) continue;
      assert_int_equal(strong[i], -1);
      assert_true(soft->weight[i] > 0);
      ConstraintRigidAt(c.l, i, c.s->x[0], R);
      for (PetscInt a = 0; a < 2; a++) u[2 * i + a] = R[3 * a + m];
    }
    for (PetscInt a = 0; a < 2; a++) {
      PetscReal *x;

      OK(PetscMalloc1(c.l->nnode, &x));
      for (PetscInt i = 0; i < c.l->nnode; i++) x[i] = u[2 * i + a];
      if (a == 1) OK(PenaltyUpdateGeometry(p, c.s->x, c.s->q, c.s->x, NULL, mark)); /* the terms were taken off */
      multiply_penalty(&c, p, x, y);
      for (PetscInt e = 0; e < soft->n; e++) {
        PetscReal G[6];

        PenaltyTermGetBlock(soft, e, G);
        largest_term = PetscMax(largest_term, PetscAbsReal(G[3 * a + m]));
        y[soft->node[e]] -= G[3 * a + m];
      }
      for (PetscInt i = 0; i < c.l->nnode; i++) BELOW(y[i], 1e-11);
      OK(PetscFree(x));
    }
    assert_true(largest(largest_term) > 1e-2);
    for (PetscInt e = 0; e < 9; e++) soft->whole[e] = total(soft->H[e]); /* as PenaltyTermSum does */
    OK(PenaltyTermAddForce(soft, constraint, u, U, out));
    for (PetscInt s = 0; s < 3; s++) BELOW(total(out[s]), 1e-11);
    OK(PetscFree2(u, y));
    OK(ConstraintDestroy(&constraint));
    OK(IndicatorDestroy(&mark));
    OK(PenaltyDestroy(&p));
    close_case(&c);
  }
}

/* ---- in the coupled system ---- */

/* Steps, then the error of the balance of momentum, which knows the force on the bodies, walls and the fluid's inertia
   from different sources */
static PetscReal balance_error(const char options[], PetscInt steps, PetscReal dt, PetscReal velocity[3])
{
  Case             c;
  Couple           couple;
  CoupleBalance    balance = {.error = 0};
  const PetscReal *u, *p;
  FlowDiagnostics  d;

  open_case(&c, options);
  OK(CoupleCreate(c.flow, c.bodies, &couple));
  for (PetscInt i = 0; i < steps; i++) {
    PetscInt           its;
    KSPConvergedReason reason;

    OK(FlowBeginStep(c.flow, (i + 1) * dt, dt));
    OK(CoupleUpdateGeometry(couple));
    OK(CoupleSolve(couple, &its, &reason));
    assert_true(reason > 0);
    OK(CoupleForce(couple));
    OK(CoupleGetSolution(couple, &u, &p));
    OK(FlowDiagnose(c.flow, u, NULL, &d));
    OK(CoupleMomentum(couple, &d, &balance));
    OK(CoupleAdvance(couple));
  }
  for (PetscInt a = 0; a < 3; a++) velocity[a] = a < 2 ? c.s->u[0][a] : c.s->w[0][2];
  OK(CoupleDestroy(&couple));
  close_case(&c);
  return balance.error;
}

static void test_balance(void **state)
{
  (void)state;
  const char *const options[] =
    {DISC BOX RUNG
     "-particle_disc_radius 0.15 -particle_disc_density 2 -particle_disc_position 0.42,0.53 -flow_bc_top_type moving_wall -flow_bc_top_velocity 1,0",
     DISC BOX RUNG
     "-particle_disc_radius 0.15 -particle_disc_density 0.01 -particle_disc_position 0.42,0.53 -flow_time be",
     DISC BOX RUNG
     "-particle_disc_radius 0.15 -particle_disc_free none -particle_disc_position 0.42,0.53 -flow_bc_top_type moving_wall -flow_bc_top_velocity 1,0 -flow_time cn",
     DISC BOX RUNG
     "-particle_disc_radius 0.15 -particle_disc_free y -particle_disc_density 2 -particle_disc_position 0.42,0.53 -particle_disc_velocity 0.4,0",
     /* at the wall */
     DISC BOX RUNG
     "-particle_disc_radius 0.15 -particle_disc_density 2 -particle_disc_position 0.156,0.53 -flow_convection 0",
     DISC BOX RUNG
     /* covers parts of cells at the floor */
     "-particle_disc_radius 0.15 -particle_disc_density 1.6 -particle_disc_position 0.42,0.16 -flow_schur projection",
     DISC BOX RUNG
     "-particle_disc_radius 0.1 -particle_disc_density 2 -particle_disc_count 2 -particle_disc_place lattice -particle_disc_lower 0.3,0.4 "
     "-particle_disc_upper 0.73,0.64", /* a gap of a third of a cell */
     "-mesh_dimension 3 -mesh_cells 4,4,4 -flow_gravity 0.5,-9,1 " DISC RUNG
     "-particle_disc_radius 0.27 -particle_disc_density 2 -particle_disc_position 0.46,0.52,0.5"};

  for (PetscInt i = 0; i < (PetscInt)PETSC_STATIC_ARRAY_LENGTH(options); i++) {
    PetscReal velocity[3];

    BELOW(balance_error(options[i], 3, 0.01, velocity), 1e-8);
  }
}

/* A body of the fluid's density stays where it is; with a direct solver the motion of another is the same */
static void test_rest_and_solvers(void **state)
{
  (void)state;
  PetscReal a[3], b[3];

  (void)balance_error(DISC BOX RUNG
                      "-particle_disc_radius 0.15 -particle_disc_density 1.3 -particle_disc_position 0.42,0.53",
                      2, 0.01, a);
  for (PetscInt d = 0; d < 3; d++) BELOW(a[d], 1e-14);
  (void)
    balance_error(DISC BOX RUNG
                  "-particle_disc_radius 0.15 -particle_disc_density 2 -particle_disc_position 0.42,0.53 -particle_disc_angular_velocity 3",
                  3, 0.02, a);
  (void)
    balance_error(DISC BOX RUNG
                  "-flow_solver direct -particle_disc_radius 0.15 -particle_disc_density 2 -particle_disc_position 0.42,0.53 -particle_disc_angular_velocity 3",
                  3, 0.02, b);
  assert_true(a[1] < -0.05 && a[2] > 0.1);
  for (PetscInt d = 0; d < 3; d++) NEAR(a[d], b[d], 1e-8);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_volume),  cmocka_unit_test(test_samples),
                                     cmocka_unit_test(test_drawn),   cmocka_unit_test(test_rigid_motion_is_free),
                                     cmocka_unit_test(test_balance), cmocka_unit_test(test_rest_and_solvers)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("penalty", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
