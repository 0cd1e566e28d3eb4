/* Deformation of meshes: sizes follow the monitor, cells stay sound, boundaries stay where they are, for random
   placements of two bodies (20; TUMBLE_PLACEMENTS=1000 for more). */
/* ranks: 1 2 */
#include "core.h"
#include "couple/bodysurfaces.h"

typedef struct {
  Mesh             mesh;
  Bodies           bodies;
  Deform           deform;
  const MeshLocal *l;
  DeformResult     result;
} Case;

static PetscErrorCode create(Case *c, const char options[])
{
  PetscFunctionBeginUser;
  give(options);
  PetscCall(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  PetscCall(MeshGetLocal(c->mesh, &c->l));
  PetscCall(BodiesCreate(c->l->dim, c->l->lower, c->l->upper, &c->bodies));
  PetscCall(BodySurfacesCreateDeform(c->mesh, c->bodies, &c->deform));
  PetscCall(DeformMesh(c->deform, &c->result));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void destroy(Case *c)
{
  OK(DeformDestroy(&c->deform));
  OK(BodiesDestroy(&c->bodies));
  OK(MeshDestroy(&c->mesh));
}

/* Size of the cells around the own node nearest to x, whose distance comes with it; the smaller over all ranks that are
   nearest */
static PetscReal size_at(const Case *c, const PetscReal x[2])
{
  PetscReal best = PETSC_MAX_REAL, size = PETSC_MAX_REAL, all;

  for (PetscInt cell = 0; cell < c->l->ncell; cell++) {
    PetscReal xc[MESH_MAX_NB * 3], distance, area;

    OK(MeshCellCoordinates(c->mesh, cell, xc));
    distance = PetscSqr(xc[8] - x[0]) + PetscSqr(xc[9] - x[1]);
    area     = 0.5 * PetscAbsReal((xc[16] - xc[0]) * (xc[13] - xc[5]) - (xc[17] - xc[1]) * (xc[12] - xc[4]));
    if (distance < best) {
      best = distance;
      size = area;
    }
  }
  OK(MPI_Allreduce(&best, &all, 1, MPIU_REAL, MPIU_MIN, PETSC_COMM_WORLD));
  if (best > all) size = PETSC_MAX_REAL;
  OK(MPI_Allreduce(MPI_IN_PLACE, &size, 1, MPIU_REAL, MPIU_MIN, PETSC_COMM_WORLD));
  return size;
}

#define TWO \
  "-mesh_deform -particle_groups a,b -particle_a_shape circle -particle_a_radius 0.12 -particle_a_free none -particle_b_shape ellipse -particle_b_a 0.16 -particle_b_b 0.1 " \
  "-particle_b_free none "

static void test_sizes(void **state)
{
  Case            c;
  PetscReal       area    = 0;
  const PetscReal wall[2] = {0.62, 0.5}, corner[2] = {0.02, 0.02};

  (void)state;
  OK(
    create(&c,
           "-mesh_cells 24,24 -mesh_deform -mesh_deform_size 0.5 -mesh_deform_width 0.25 -particle_groups a -particle_a_shape circle "
           "-particle_a_radius 0.12 -particle_a_position 0.5,0.5 -particle_a_free none"));
  if (c.result.area[0] < 0.97 || c.result.area[1] > 1.03)
    fail_msg("sizes %g to %g of the wanted ones", (double)c.result.area[0], (double)c.result.area[1]);
  for (PetscInt cell = 0; cell < c.l->ncell; cell++) {
    PetscReal xc[MESH_MAX_NB * 3];

    OK(MeshCellCoordinates(c.mesh, cell, xc));
    area += 0.5 * ((xc[16] - xc[0]) * (xc[13] - xc[5]) - (xc[17] - xc[1]) * (xc[12] - xc[4]));
    for (PetscInt a = 0; a < 2; a++) {
      NEAR(xc[2 + a], 0.5 * (xc[a] + xc[4 + a]), 1e-14); /* straight sides */
      NEAR(xc[8 + a], 0.25 * (xc[a] + xc[4 + a] + xc[12 + a] + xc[16 + a]), 1e-14);
    }
  }
  NEAR(total(area), 1, 1e-12);
  NEAR(size_at(&c, corner) / size_at(&c, wall), 4, 0.6); /* the wanted ratio, between the places of two cells */
  assert_true(c.l->h < 0.8 / 24 && c.l->x == c.l->x_start);
  for (PetscInt i = 0; i < c.l->nnode_all; i++)
    for (PetscInt a = 0; a < 2; a++) assert_true(c.l->x[2 * i + a] >= 0 && c.l->x[2 * i + a] <= 1);
  destroy(&c);
}

static void test_placements(void **state)
{
  const char *many  = getenv("TUMBLE_PLACEMENTS");
  PetscInt    n     = many ? atoi(many) : 20;
  PetscReal   least = PETSC_MAX_REAL, low = PETSC_MAX_REAL, high = 0;

  (void)state;
  for (PetscInt k = 0; k < n; k++) {
    char      options[1024];
    PetscReal x[5];
    Case      c;

    for (PetscInt i = 0; i < 5; i++) x[i] = noise(5 * k + i);
    snprintf(options, sizeof(options),
             TWO
             "-mesh_cells 24,24 -mesh_deform_size 0.5 -mesh_deform_width 0.25 -particle_a_position %g,%g -particle_b_position %g,%g -particle_b_angle %g",
             0.5 + 0.4 * x[0], 0.5 + 0.4 * x[1], 0.5 + 0.4 * x[2], 0.5 + 0.4 * x[3], 3 * x[4]);
    OK(create(&c, options));
    least = PetscMin(least, c.result.jacobian);
    low   = PetscMin(low, c.result.area[0]);
    high  = PetscMax(high, c.result.area[1]);
    destroy(&c);
  }
  if (many)
    OK(PetscPrintf(PETSC_COMM_WORLD,
                   "%" PetscInt_FMT
                   " placements: smallest Jacobian %g of the mean, sizes %g to %g of the wanted ones\n",
                   n, (double)least, (double)low, (double)high));
  if (least <= 0.1) fail_msg("smallest Jacobian %g", (double)least);
  if (low < 0.95 || high > 1.05) fail_msg("sizes %g to %g of the wanted ones", (double)low, (double)high);
}

/* Steps so long that cells would turn inside out are shortened */
static void test_long_steps(void **state)
{
  Case c;

  (void)state;
  OK(
    create(&c,
           "-mesh_cells 24,24 -mesh_deform -mesh_deform_size 0.15 -mesh_deform_width 0.1 -mesh_deform_steps 2 -particle_groups a -particle_a_shape circle "
           "-particle_a_radius 0.12 -particle_a_position 0.5,0.5 -particle_a_free none"));
  assert_true(c.result.jacobian > 0.1 && c.result.area[0] > 0);
  destroy(&c);
}

static void expect_refusal(const char options[])
{
  Case c = {0};

  OK(PetscPushErrorHandler(PetscReturnErrorHandler, NULL));
  assert_int_not_equal(create(&c, options), 0);
  OK(PetscPopErrorHandler());
  destroy(&c);
}

static void test_refusals(void **state)
{
  (void)state;
  expect_refusal("-mesh_cells 8,8 -mesh_deform");
  expect_refusal(
    "-mesh_kind fitted -mesh_deform -particle_groups a -particle_a_shape circle -particle_a_radius 0.05 -particle_a_position 0.2,0.2 -particle_a_free none");
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_sizes), cmocka_unit_test(test_placements),
                                     cmocka_unit_test(test_long_steps), cmocka_unit_test(test_refusals)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("deform", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
