/* Surfaces: large-eddy simulation knows how far bodies are. */
/* ranks: 1 2 3 */
#include "core.h"
#include "bodies/write.h"
#include "couple/couple.h"

#define SLIP "-flow_bc_left_type slip -flow_bc_right_type slip -flow_bc_bottom_type slip -flow_bc_top_type slip "
#define DISC \
  "-particle_groups disc -particle_disc_shape circle -particle_disc_radius 0.2 -particle_disc_position 0.5,0.5 -particle_disc_free none "
#define CELLS 32
#define WALL  0.1 /* distance of 25 wall units: 25 viscosity/(density friction velocity) */

/* Eddy viscosity over its undamped value at the own nodes of a shear past a disc that rests, without walls of the mesh:
   the largest error against van Driest's damping by the distance from the disc, near it and beyond EDDY_REACH cells */
static void measure(const char damping[], PetscReal before[], PetscReal *near_error, PetscReal *far_error)
{
  Mesh               mesh;
  Flow               flow;
  Bodies             bodies;
  Couple             couple;
  const MeshLocal   *l;
  char               options[1024];
  PetscReal         *u, *nu;
  PetscInt           its;
  KSPConvergedReason reason;

  snprintf(options, sizeof(options),
           "-mesh_cells 32,32 -flow_viscosity 1e-3 -flow_density 1 -flow_rheology smagorinsky " SLIP DISC
           "-flow_les_damping %s",
           damping);
  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(MeshGetLocal(mesh, &l));
  OK(FlowCreate(mesh, &flow));
  OK(BodiesCreate(l->dim, l->lower, l->upper, &bodies));
  OK(CoupleCreate(flow, bodies, &couple));
  OK(FlowGetFields(flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < l->nnode_all; i++) u[2 * i] = l->x[2 * i + 1];
  OK(FlowBeginStep(flow, 1e-6, 1e-6));
  OK(CoupleUpdateGeometry(couple));
  OK(CoupleSolve(couple, &its, &reason));
  assert_true(reason > 0);
  OK(PetscCalloc1(l->nnode_all, &nu));
  OK(FlowGetEddies(flow, nu));
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscReal y = hypot(l->x[2 * i] - 0.5, l->x[2 * i + 1] - 0.5) - 0.2, D = 1 - exp(-y / WALL);

    if (near_error && y > 1.5 / CELLS && y < 3.5 / CELLS)
      *near_error = PetscMax(*near_error, PetscAbsReal(nu[i] / before[i] - D * D));
    if (far_error && y > 7. / CELLS) *far_error = PetscMax(*far_error, PetscAbsReal(nu[i] / before[i] - 1));
    before[i] = nu[i];
  }
  OK(PetscFree(nu));
  OK(CoupleDestroy(&couple));
  OK(BodiesDestroy(&bodies));
  OK(FlowDestroy(&flow));
  OK(MeshDestroy(&mesh));
}

static void test_damping_at_a_body(void **state)
{
  static PetscReal nu[(2 * CELLS + 1) * (2 * CELLS + 1)];
  PetscReal        error[2] = {0, 0};

  (void)state;
  measure("none", nu, NULL, NULL);
  measure("van_driest -flow_les_friction 0.25", nu, &error[0], &error[1]);
  MPI_Allreduce(MPI_IN_PLACE, error, 2, MPIU_REAL, MPI_MAX, PETSC_COMM_WORLD);
  NEAR(error[0], 0, 0.03); /* means over the cells around a node */
  NEAR(error[1], 0, 1e-8); /* 500 wall units stand for far */
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_damping_at_a_body)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("surfaces", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
