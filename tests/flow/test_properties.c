/* Flow: fluids side by side, whose densities and viscosities differ from cell to cell (FlowSetProperties). The step's
   solution is checked by its residual, the sum over cells at nodes without a condition. */
/* ranks: 1 2 */
#include "fluidcase.h"
#include "impl.h"
#include "raised.h"

typedef struct {
  PetscReal *density, *viscosity, *u, *p, *r;
} Two;

/* Below and above y = 0.5 */
static void create_two(const Case *c, PetscReal below, PetscReal above, PetscReal mu_below, PetscReal mu_above, Two *t)
{
  const MeshLocal *l = c->l;

  OK(PetscCalloc5(l->ncell_all, &t->density, l->ncell_all, &t->viscosity, l->nnode_all * l->dim, &t->u,
                  l->ncell * (l->dim + 1), &t->p, l->nnode_all * l->dim, &t->r));
  for (PetscInt e = 0; e < l->ncell_all; e++) {
    const PetscBool up = (PetscBool)(c->flow->cells.centre[e * l->dim + 1] > 0.5);

    t->density[e]   = up ? above : below;
    t->viscosity[e] = up ? mu_above : mu_below;
  }
}

static void destroy_two(Two *t)
{
  OK(PetscFree5(t->density, t->viscosity, t->u, t->p, t->r));
}

/* Largest residual at nodes without a condition */
static PetscReal find_residual(Case *c, Two *t)
{
  const MeshLocal     *l = c->l;
  const unsigned char *fixed;
  PetscReal            top = 0;

  OK(FlowAssemble(c->flow));
  OK(PetscArrayzero(t->r, l->nnode_all * l->dim));
  for (PetscInt e = 0; e < l->ncell; e++) {
    PetscReal r[MESH_MAX_NB * 3];

    OK(FlowCellResidual(c->flow, e, t->u, t->p, r));
    for (PetscInt j = 0; j < l->nb * l->dim; j++)
      t->r[l->cell_node[e * l->nb + j / l->dim] * l->dim + j % l->dim] += r[j];
  }
  OK(MeshSumNodes(c->mesh, l->dim, t->r));
  OK(ConditionsGetValues(FlowConditions(c->flow), &fixed, NULL));
  for (PetscInt i = 0; i < l->nnode * l->dim; i++)
    if (!((fixed[i / l->dim] >> (i % l->dim)) & 1)) top = PetscMax(top, PetscAbsReal(t->r[i]));
  return largest(top);
}

#define LAYERS "-mesh_upper 1.5,1 -mesh_cells 3,4 -flow_density 2 -flow_viscosity 0.5 "

/* Between plates of which the upper one moves, the profile is linear in each fluid and the stress the same in both */
static void test_couette(void **state)
{
  const PetscReal  mu[2] = {0.5, 4}, middle = mu[1] / (mu[0] + mu[1]); /* speed at y = 0.5 of the upper plate's 1 */
  Case             c;
  Two              t;
  Mat              A;
  Vec              x, y;
  PetscReal       *a, *rhs, top = 0;
  const PetscReal *got;

  (void)state;
  open_case(&c, LAYERS "-mesh_periodic x -flow_bc_top_type moving_wall -flow_bc_top_velocity 1,0");
  create_two(&c, 2, 2, mu[0], mu[1], &t);
  OK(FlowSetProperties(c.flow, NULL, t.viscosity));
  assert_true(FlowHasSymmetricStress(c.flow));
  OK(FlowBeginSteady(c.flow, 0));
  for (PetscInt i = 0; i < c.l->nnode_all; i++) {
    const PetscReal h = c.l->x[2 * i + 1];

    t.u[2 * i] = h < 0.5 ? 2 * middle * h : middle + (1 - middle) * (2 * h - 1);
  }
  BELOW(find_residual(&c, &t), 1e-14);
  /* the operator of all components and the right-hand side say the same */
  OK(FlowGetComponents(c.flow, &A));
  OK(MatCreateVecs(A, &x, &y));
  OK(VecGetArrayWrite(x, &a));
  OK(PetscArraycpy(a, t.u, c.l->nnode * 2));
  OK(VecRestoreArrayWrite(x, &a));
  OK(MatMult(A, x, y));
  OK(PetscMalloc1(c.l->nnode_all * 2, &rhs));
  OK(FlowRhs(c.flow, rhs));
  OK(VecGetArrayRead(y, &got));
  for (PetscInt i = 0; i < c.l->nnode * 2; i++) top = PetscMax(top, PetscAbsReal(got[i] - rhs[i] - t.r[i]));
  BELOW(largest(top), 1e-13);
  OK(VecRestoreArrayRead(y, &got));
  OK(VecDestroy(&x));
  OK(VecDestroy(&y));
  OK(PetscFree(rhs));
  for (PetscInt e = 0; e < c.l->ncell_all; e++) t.viscosity[e] = mu[t.viscosity[e] < 1]; /* the other way round */
  OK(FlowSetProperties(c.flow, NULL, t.viscosity));
  assert_true(find_residual(&c, &t) > 0.1);
  OK(FlowSetProperties(c.flow, NULL, NULL));
  assert_false(FlowHasSymmetricStress(c.flow));
  destroy_two(&t);
  close_case(&c);
}

/* At rest in a closed box the pressure carries each fluid's weight: exactly, since it is linear in every cell */
static void test_hydrostatic(void **state)
{
  const PetscReal g = -9.81;
  Case            c;
  Two             t;

  (void)state;
  open_case(&c, LAYERS "-flow_gravity 0,-9.81");
  create_two(&c, 5, 1, 1, 1, &t);
  OK(FlowSetProperties(c.flow, t.density, NULL));
  OK(FlowBeginStep(c.flow, 0.1, 0.1));
  for (PetscInt e = 0; e < c.l->ncell; e++) { /* what goes beyond the weight of density 2, 0 at y = 0.5 */
    t.p[3 * e]     = (t.density[e] - 2) * g * (c.flow->cells.centre[2 * e + 1] - 0.5);
    t.p[3 * e + 2] = (t.density[e] - 2) * g * c.flow->cells.size[e];
  }
  BELOW(find_residual(&c, &t), 1e-13);
  for (PetscInt e = 0; e < c.l->ncell_all; e++) t.density[e] = 6 - t.density[e];
  OK(FlowSetProperties(c.flow, t.density, NULL));
  assert_true(find_residual(&c, &t) > 0.1);
  destroy_two(&t);
  close_case(&c);
}

/* Energy, inertia and weight are those of the densities, and the residual's sum is the balance that FlowDiagnose has */
static void test_mass(void **state)
{
  Case             c;
  Two              t;
  FlowDiagnostics  d;
  FlowPower        power;
  const PetscReal *m, *volume;
  PetscReal        mass = 0, sum[2] = {0, 0};

  (void)state;
  open_case(&c, LAYERS "-mesh_periodic x,y -flow_gravity 3,-9.81 -flow_force 0.5,0");
  create_two(&c, 5, 1, 1, 1, &t);
  OK(FlowGetInertialMass(c.flow, &m));
  OK(FlowGetLumpedMass(c.flow, &volume));
  assert_ptr_equal(m, volume);
  OK(FlowSetProperties(c.flow, t.density, NULL));
  OK(FlowGetInertialMass(c.flow, &m));
  for (PetscInt i = 0; i < c.l->nnode; i++) {
    mass += 2 * m[i];
    assert_true(m[i] > 0);
  }
  NEAR(total(mass), 1.5 * 3, 1e-13);
  OK(FlowBeginStep(c.flow, 0.1, 0.1));
  for (PetscInt i = 0; i < c.l->nnode_all; i++) t.u[2 * i] = 0.2;
  (void)find_residual(&c, &t);
  for (PetscInt i = 0; i < c.l->nnode * 2; i++) sum[i % 2] += t.r[i];
  OK(FlowDiagnose(c.flow, t.u, NULL, &d));
  NEAR(d.kinetic_energy, 0.5 * 4.5 * 0.04, 1e-13);
  NEAR(d.change[0], 4.5 * 0.2 / 0.1, 1e-11);
  NEAR(d.driven[0], 0.5 * 1.5 + 3 * (4.5 - 2 * 1.5), 1e-12);
  NEAR(d.driven[1], -9.81 * (4.5 - 2 * 1.5), 1e-12);
  for (PetscInt a = 0; a < 2; a++) NEAR(total(sum[a]), d.change[a] + d.flux[a] - d.driven[a], 1e-11);
  OK(FlowGetPower(c.flow, t.u, t.u, &power));
  NEAR(power.inertia, 4.5 * 0.2 / 0.1 * 0.2, 1e-11);
  destroy_two(&t);
  close_case(&c);
}

/* And the diagonal d */
static void multiply_assembled(const Case *c, PetscReal x[], PetscReal y[], PetscReal d[])
{
  OK(FlowAssemble(c->flow));
  OK(FlowGetDiagonal(c->flow, d));
  multiply(c, x, y);
}

static void check_matrix_free(const char options[])
{
  PetscReal *x, *y[3], *d[3];
  PetscInt   n = 0;

  for (PetscInt i = 0; i < 3; i++) { /* matrix-free; assembled; with one density */
    Case       c;
    Two        t;
    PetscReal *now;
    char       all[512];

    snprintf(all, sizeof(all), "%s -flow_density 2 -flow_viscosity 0.5 -flow_velocity_operator %s", options,
             i == 1 ? "assembled" : "matrix_free");
    open_case(&c, all);
    create_two(&c, 5, 1, 1, 1, &t);
    if (i < 2) OK(FlowSetProperties(c.flow, t.density, NULL));
    OK(FlowGetFields(c.flow, &now, NULL, NULL));
    fill_noise(c.l, 1, now);
    OK(FlowBeginStep(c.flow, 0.1, 0.1));
    n = c.l->nnode;
    OK(PetscMalloc1(c.l->nnode_all * c.dim, &x));
    OK(PetscMalloc1(c.l->nnode_all * c.dim, &y[i]));
    OK(PetscMalloc1(c.l->nnode_all, &d[i]));
    fill_noise(c.l, 2, x);
    multiply_assembled(&c, x, y[i], d[i]);
    if (i == 1) {
      BELOW(max_difference(n * c.dim, y[0], y[1]), 1e-12 * max_abs(n * c.dim, y[1]));
      BELOW(max_difference(n, d[0], d[1]), 1e-12 * max_abs(n, d[1]));
    } else if (i == 2) assert_true(max_difference(n * c.dim, y[0], y[2]) > 0.1 * max_abs(n * c.dim, y[0]));
    destroy_two(&t);
    close_case(&c);
    OK(PetscFree(x));
  }
  for (PetscInt i = 0; i < 3; i++) {
    OK(PetscFree(y[i]));
    OK(PetscFree(d[i]));
  }
}

/* Without a matrix the product is that of the assembled one: boxes, cells of any form, in space, where cells hang */
static void test_matrix_free(void **state)
{
  (void)state;
  check_matrix_free("-mesh_cells 4,6");
  check_matrix_free("-mesh_kind disc -mesh_resolution 4 -flow_convection_form skew");
  check_matrix_free("-mesh_dimension 3 -mesh_cells 3,4,2");
}

/* A cell that joins the fluid starts with the pressure of its own material */
static void test_joining(void **state)
{
  Case       c;
  PetscInt  *material, at = -1;
  PetscReal *p;

  (void)state;
  open_case(&c, LAYERS);
  OK(PetscMalloc1(c.l->ncell_all, &material));
  OK(FlowGetFields(c.flow, NULL, NULL, &p));
  for (PetscInt e = 0; e < c.l->ncell_all; e++) {
    const PetscReal *x = c.flow->cells.centre + 2 * e;

    material[e] = x[1] > 0.5;
    if (PetscAbsReal(x[0] - 0.75) < 0.1 && PetscAbsReal(x[1] - 0.375) < 0.1) at = e; /* cells of both around it */
    if (e < c.l->ncell) p[3 * e] = material[e] ? 7 : 2;
  }
  for (PetscInt now = 0; now < 3; now++) { /* of each material, then of one that is nowhere else */
    if (at >= 0) material[at] = -1;
    OK(FlowUpdateCells(c.flow, at >= 0, &at, material));
    if (at >= 0 && at < c.l->ncell) NEAR(p[3 * at], 0, 0);
    if (at >= 0) material[at] = now;
    OK(FlowUpdateCells(c.flow, at >= 0, &at, material));
    if (c.l->ncell < c.l->ncell_global) continue; /* cells of other ranks do not count */
    if (now < 2) NEAR(p[3 * at], now ? 7 : 2, 1e-14);
    else assert_true(p[3 * at] > 2.5 && p[3 * at] < 6.5);
  }
  OK(PetscFree(material));
  close_case(&c);
}

static void test_refusals(void **state)
{
  Case            c;
  const PetscReal none = 0;

  (void)state;
  open_case(&c, LAYERS "-flow_velocity_operator matrix_free");
  begin_error();
  expect_error(FlowSetProperties(c.flow, NULL, &none), PETSC_ERR_SUP, "use -flow_velocity_operator assembled", NULL);
  close_case(&c);
  open_case(&c, LAYERS "-flow_rheology bingham -flow_rheology_yield 1");
  begin_error();
  expect_error(FlowSetProperties(c.flow, NULL, &none), PETSC_ERR_SUP, "remove -flow_rheology", NULL);
  close_case(&c);
}

/* One Newtonian fluid: nobody is asked, and nothing is kept by cell */
static void test_newtonian(void **state)
{
  Case          c;
  const Owners *o;

  (void)state;
  open_case(&c, LAYERS);
  o = &c.flow->owners;
  assert_null(c.flow->material);
  assert_null(c.flow->properties.density);
  assert_null(c.flow->properties.viscosity);
  assert_null(c.flow->viscosity.mu);
  assert_int_equal(o->nterms + o->noperators + o->nforces + o->nvolumes, 0);
  close_case(&c);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_newtonian),   cmocka_unit_test(test_couette),
                                     cmocka_unit_test(test_hydrostatic), cmocka_unit_test(test_mass),
                                     cmocka_unit_test(test_matrix_free), cmocka_unit_test(test_joining),
                                     cmocka_unit_test(test_refusals)};

  int failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("properties", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
