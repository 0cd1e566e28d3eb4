/* Boundary method aligned: a disc turning in Couette flow (exact), fixed and carried along by a uniform stream, free
   with three densities; values at moved nodes; forces in both forms; bodies that the mesh cannot follow. */
/* ranks: 1 2 */
#include "core.h"
#include "bodies/write.h"
#include "couple/couple.h"
#include "mesh/remap.h"

#define MU     0.1
#define TORQUE (16 * PETSC_PI * MU / 3) /* on the fluid, for radius 1, outer radius 2, angular velocity 1 */

typedef struct {
  Mesh             mesh;
  Flow             flow;
  Bodies           bodies;
  Couple           couple;
  BodyArrays      *s;
  const MeshLocal *l;
  PetscReal        U[2], time;
} Case;

static void open_case(Case *c, PetscInt n, const char options[])
{
  char all[2048];

  snprintf(all, sizeof(all),
           "-mesh_cells %d,%d -mesh_lower -2,-2 -mesh_upper 2,2 -flow_viscosity 0.1 -flow_ksp_rtol 1e-9 -flow_ksp_max_it 300 -couple_method aligned "
           "-particle_groups disc -particle_disc_shape circle -particle_disc_radius 1 -particle_disc_position 0.013,-0.0047 -particle_disc_angular_velocity 1 %s",
           (int)n, (int)n, options);
  give(all);
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(BodiesCreate(2, c->l->lower, c->l->upper, &c->bodies));
  OK(BodiesGetArrays(c->bodies, &c->s));
  OK(CoupleCreate(c->flow, c->bodies, &c->couple));
  c->U[0] = c->U[1] = c->time = 0;
}

static void close_case(Case *c)
{
  OK(CoupleDestroy(&c->couple));
  OK(BodiesDestroy(&c->bodies));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

/* The exact velocity at time t, which the uniform stream carries along, and its continuation a little way inside */
static void exact(const Case *c, PetscReal t, const PetscReal x[], PetscReal u[])
{
  const PetscReal r[2] = {x[0] - 0.013 - c->U[0] * t, x[1] + 0.0047 - c->U[1] * t}, r2 = r[0] * r[0] + r[1] * r[1];
  const PetscReal turn = r2 < 0.5 ? 1 : -1 / 3.0 + 4 / (3 * r2);

  u[0] = c->U[0] - turn * r[1];
  u[1] = c->U[1] + turn * r[0];
}

/* The box has the exact velocity on its boundary */
static void set_walls(Case *c)
{
  const unsigned char *fixed;
  const PetscReal     *value;

  OK(ConditionsGetValues(FlowConditions(c->flow), &fixed, &value));
  for (PetscInt i = 0; i < c->l->nnode_all; i++)
    if (fixed[i]) exact(c, c->time, c->l->x + 2 * i, (PetscReal *)value + 2 * i);
}

static void take_step(Case *c, PetscReal dt, PetscBool advance)
{
  PetscInt           its;
  KSPConvergedReason reason;

  c->time += dt;
  OK(FlowBeginStep(c->flow, c->time, dt));
  set_walls(c);
  OK(CoupleUpdateGeometry(c->couple));
  OK(CoupleSolve(c->couple, &its, &reason));
  assert_true(reason > 0);
  OK(CoupleForce(c->couple));
  if (advance) OK(CoupleAdvance(c->couple));
}

static PetscReal velocity_error(Case *c)
{
  const PetscReal *u, *p, *m;
  const PetscInt  *body;
  PetscReal        sum = 0;

  OK(CoupleGetSolution(c->couple, &u, &p));
  OK(CoupleGetNodeBody(c->couple, &body));
  OK(FlowGetLumpedMass(c->flow, &m));
  for (PetscInt i = 0; i < c->l->nnode; i++) {
    PetscReal v[2];

    if (body[i] >= 0) continue;
    exact(c, c->time, c->l->x + 2 * i, v);
    for (PetscInt a = 0; a < 2; a++) sum += PetscAbsReal(m[i]) * PetscSqr(u[2 * i + a] - v[a]);
  }
  return PetscSqrtReal(total(sum));
}

/* Steady: third order in the velocity, a torque right to five digits, no net force, and the volume form close by */
static void test_turning(void **state)
{
  PetscReal error[2];

  (void)state;
  for (PetscInt level = 0; level < 2; level++) {
    Case      c;
    PetscReal residual[6], volume[6];

    open_case(&c, 24 << level, "-particle_disc_free none -flow_time be -flow_solver direct");
    for (PetscInt step = 0; step < 6; step++) take_step(&c, 1e4, step < 5);
    error[level] = velocity_error(&c);
    OK(CoupleForceForms(c.couple, 0, NULL, residual, volume));
    NEAR(residual[5], -TORQUE, (level ? 3e-6 : 1e-5) * TORQUE);
    NEAR(volume[5], -TORQUE, (level ? 2e-4 : 2e-3) * TORQUE);
    BELOW(PetscAbsReal(residual[0]) + PetscAbsReal(residual[1]), 1e-5);
    close_case(&c);
  }
  assert_true(PetscLogReal(error[0] / error[1]) / PetscLogReal(2.0) > 2.9);
}

/* A free disc under a torque that keeps it turning, in the stream: stays on its course whatever its density */
static void run_free(PetscReal density, PetscInt steps, PetscReal dU[2], PetscReal *dw)
{
  Case       c;
  char       options[256];
  PetscReal *u;

  snprintf(options, sizeof(options), "-particle_disc_density %g -particle_disc_velocity 0.5,0.2", (double)density);
  open_case(&c, 24, options);
  c.U[0] = 0.5;
  c.U[1] = 0.2;
  OK(FlowBeginStep(c.flow, 0.02, 0.02));
  OK(CoupleUpdateGeometry(c.couple)); /* the mesh of the first step, on which the field before it is given */
  OK(FlowGetFields(c.flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < c.l->nnode_all; i++) exact(&c, 0, c.l->x + 2 * i, u + 2 * i);
  for (PetscInt step = 0; step < steps; step++) {
    c.s->contact_torque[0][2] = TORQUE;
    take_step(&c, 0.02, PETSC_TRUE);
  }
  for (PetscInt a = 0; a < 2; a++) dU[a] = c.s->u[0][a] - c.U[a];
  *dw = c.s->w[0][2] - 1;
  close_case(&c);
}

static void test_carried(void **state)
{
  const PetscReal density[] = {0.01, 1, 10};

  (void)state;
  for (PetscInt d = 0; d < 3; d++) {
    PetscReal dU[2], dw;

    run_free(density[d], 10, dU, &dw);
    BELOW(dU[0], 2e-5);
    BELOW(dU[1], 2e-5);
    BELOW(dw, 2e-5);
  }
}

/* A free disc between the centres of the cells, sinking across the stream */
static void run_small(const char method[], PetscReal out[3], PetscBool *fallback)
{
  Case               c;
  char               options[256];
  const CoupleCount *count;
  PetscInt           n;

  snprintf(options, sizeof(options),
           "-particle_disc_radius 0.07 -particle_disc_position 0,0 -particle_disc_density 2 -flow_gravity 0,-10 -flow_ksp_rtol 1e-10 -couple_method %s",
           method);
  open_case(&c, 24, options);
  for (PetscInt step = 0; step < 3; step++) take_step(&c, 0.02, PETSC_TRUE);
  OK(CoupleGetCounts(c.couple, &n, &count));
  if (n) assert_string_equal(count[0].name, "aligned_penalty_bodies");
  *fallback = (PetscBool)(n && count[0].value == 1);
  out[0]    = c.s->u[0][0];
  out[1]    = c.s->u[0][1];
  out[2]    = c.s->w[0][2];
  close_case(&c);
}

/* A body without a cell of its own is held by the penalty, as under that method */
static void test_fallback(void **state)
{
  PetscReal snap[3], penalty[3];
  PetscBool fallback;

  (void)state;
  run_small("penalty", penalty, &fallback);
  assert_false(fallback);
  run_small("aligned", snap, &fallback);
  assert_true(fallback);
  for (PetscInt i = 0; i < 3; i++) NEAR(snap[i], penalty[i], 1e-8);
  assert_true(penalty[1] < -0.01);
}

/* In a closed box constant pressures are in the null space of the pressure operator, so that its solver, which projects
   them out, reaches any tolerance */
static void test_closed_box(void **state)
{
  Case c;

  (void)state;
  open_case(&c, 16,
            "-flow_schur projection -flow_ksp_rtol 1e-6 -flow_fieldsplit_pressure_ksp_rtol 1e-10 -flow_fieldsplit_pressure_ksp_max_it 60 -particle_disc_density 2");
  for (PetscInt step = 0; step < 2; step++) take_step(&c, 0.02, PETSC_TRUE);
  close_case(&c);
}

static void quadratic(const PetscReal x[], PetscReal v[])
{
  v[0] = 1 + x[0] - 2 * x[1] + 3 * x[0] * x[0] - x[0] * x[1];
  v[1] = 2 - x[0] + x[1] + x[1] * x[1] + 0.5 * x[0] * x[1];
}

/* Quadratic fields are carried exactly on parallelograms: inside cells, and beyond the dead ones as far as (b) reaches;
   then by Taylor's formula; without fluid the old value is kept */
static void test_remap(void **state)
{
  Mesh             mesh;
  const MeshLocal *l;
  Remap            remap;
  PetscReal       *u, *x, *out;
  PetscInt        *side, *dead, *node, n = 0;
  RemapCount       count;

  (void)state;
  give("-mesh_cells 12,12");
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(MeshGetLocal(mesh, &l));
  OK(RemapCreate(mesh, &remap));
  OK(PetscMalloc5(2 * l->nnode_all, &u, 2 * l->nnode, &x, 2 * l->nnode, &out, l->ncell_all, &dead, l->nnode, &node));
  OK(PetscCalloc1(PetscMax(l->ncell_all, l->nnode), &side));
  fill_field(l, quadratic, u);
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    const PetscReal *at = l->x + 2 * l->cell_node[9 * c + 4];

    dead[c] = PetscSqr(at[0] - 0.5) + PetscSqr(at[1] - 0.5) < PetscSqr(0.1) ? 0 : -1;
  }
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal at[2];

    for (PetscInt a = 0; a < 2; a++)
      at[a] = l->x[2 * i + a] + 0.05 * PetscSinReal(40 * l->x[2 * i + a] + 30 * l->x[2 * i + 1 - a]);
    if (PetscMin(PetscMin(at[0], 1 - at[0]), PetscMin(at[1], 1 - at[1])) < 0) continue;
    x[2 * n]     = at[0];
    x[2 * n + 1] = at[1];
    node[n++]    = i;
  }
  OK(RemapEvaluate(remap, n, node, x, side, (RemapCells){dead, side}, 1, (const PetscReal *const *)&u, out, &count));
  assert_int_equal((PetscInt)total(n), count.inside + count.extended + count.taylor + count.kept);
  assert_true(count.extended > 0 && count.taylor > 0 && count.inside > 10 * count.extended);
  assert_int_equal(count.kept, 0);
  for (PetscInt e = 0; e < n; e++) {
    PetscReal want[2];

    quadratic(x + 2 * e, want);
    for (PetscInt a = 0; a < 2; a++)
      NEAR(out[2 * e + a], want[a],
           PetscSqr(x[2 * e] - 0.5) + PetscSqr(x[2 * e + 1] - 0.5) < PetscSqr(0.08) ? 0.05 : 1e-12);
  }
  for (PetscInt c = 0; c < l->ncell_all; c++) dead[c] = 0; /* no fluid at all */
  OK(RemapEvaluate(remap, n, node, x, side, (RemapCells){dead, side}, 1, (const PetscReal *const *)&u, out, &count));
  assert_int_equal((PetscInt)total(n), count.kept);
  for (PetscInt e = 0; e < 2 * n; e++) assert_true(out[e] == u[2 * node[e / 2] + e % 2]);
  OK(PetscFree5(u, x, out, dead, node));
  OK(PetscFree(side));
  OK(RemapDestroy(&remap));
  OK(MeshDestroy(&mesh));
}

/* Zero on the line y = 1/2, with another polynomial above (side > 0) than below */
static void kinked(const PetscReal x[], PetscInt side, PetscReal v[])
{
  v[0] = (x[1] - 0.5) * (side > 0 ? 1 + x[0] : 3 - x[1]);
  v[1] = (x[1] - 0.5) * (side > 0 ? -2 : x[0]);
}

/* Places beside a path get the polynomial of their side, also where that side was not */
static void test_remap_sides(void **state)
{
  Mesh             mesh;
  const MeshLocal *l;
  Remap            remap;
  PetscReal       *u, *x, *out;
  PetscInt        *side, *cell_side, *dead, *node, n = 0, across = 0;
  RemapCount       count;

  (void)state;
  give("-mesh_cells 12,12");
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(MeshGetLocal(mesh, &l));
  OK(RemapCreate(mesh, &remap));
  OK(PetscMalloc7(2 * l->nnode_all, &u, 2 * l->nnode, &x, 2 * l->nnode, &out, l->ncell_all, &dead, l->ncell_all,
                  &cell_side, l->nnode, &node, l->nnode, &side));
  for (PetscInt i = 0; i < l->nnode_all; i++) kinked(l->x + 2 * i, l->x[2 * i + 1] > 0.5 ? 1 : -1, u + 2 * i);
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    dead[c]      = -1;
    cell_side[c] = l->x[2 * l->cell_node[9 * c + 4] + 1] > 0.5 ? 3 : -3;
  }
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscReal *at = l->x + 2 * i;

    if (PetscAbsReal(at[1] - 0.5) > 0.1 || PetscAbsReal(at[0] - 0.5) > 0.4) continue;
    x[2 * n]     = at[0] + 0.03 * noise(2 * l->node_global[i]);
    x[2 * n + 1] = at[1] + 0.03 * noise(2 * l->node_global[i] + 1);
    side[n]      = l->node_global[i] % 2 ? 3 : -3;
    if (PetscAbsReal(x[2 * n + 1] - 0.5) > 0.03) side[n] = x[2 * n + 1] > 0.5 ? 3 : -3;
    across += (x[2 * n + 1] > 0.5) != (side[n] > 0);
    node[n++] = i;
  }
  OK(RemapEvaluate(remap, n, node, x, side, (RemapCells){dead, cell_side}, 1, (const PetscReal *const *)&u, out,
                   &count));
  assert_true(total(across) > 10);
  assert_int_equal(count.extended, (PetscInt)total(across));
  assert_int_equal(count.taylor + count.kept, 0);
  for (PetscInt e = 0; e < n; e++) {
    PetscReal want[2];

    kinked(x + 2 * e, side[e], want);
    for (PetscInt a = 0; a < 2; a++) NEAR(out[2 * e + a], want[a], 1e-12);
  }
  OK(PetscFree7(u, x, out, dead, cell_side, node, side));
  OK(RemapDestroy(&remap));
  OK(MeshDestroy(&mesh));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_remap),    cmocka_unit_test(test_remap_sides),
                                     cmocka_unit_test(test_turning),  cmocka_unit_test(test_carried),
                                     cmocka_unit_test(test_fallback), cmocka_unit_test(test_closed_box)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (OptFinalize() || ShapeFinalize() || PetscFinalize()) return 1;
  return failed;
}
