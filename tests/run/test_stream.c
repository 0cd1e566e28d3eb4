/* The stream that a scene gives, and the size of a body in it that its boundary layer goes by: of what lies along it
   the length, of what it goes around the thickness, of those put together that of the bluffest part. */
/* ranks: 1 */
#include "base/algebra.h"
#include "core.h"
#include "stream.h"

#define ALL "-particle_groups b -particle_b_free none -particle_b_density 1 "

static StreamEdge edge; /* of the body that was measured last */

/* Size of the body of these options in a stream along (c, s, 0), or in space (c, 0, s) */
static PetscReal measure(PetscInt dim, const char options[], PetscReal degrees)
{
  const PetscReal lower[3] = {-5, -5, -5}, upper[3] = {5, 5, 5}, angle = degrees * PETSC_PI / 180;
  PetscReal       direction[3] = {PetscCosReal(angle), PetscSinReal(angle), 0}, size;
  Bodies          bodies;
  char            text[1024];

  if (dim == 3) direction[2] = direction[1], direction[1] = 0;
  snprintf(text, sizeof(text), ALL "-particle_b_position %s %s", dim == 2 ? "0,0" : "0,0,0", options);
  give(text);
  OK(BodiesCreate(dim, lower, upper, &bodies));
  OK(StreamMeasureBody(bodies, 0, direction, &size, &edge));
  OK(BodiesDestroy(&bodies));
  return size;
}

static void near(PetscReal is, PetscReal should, PetscReal share)
{
  if (PetscAbsReal(is - should) > share * should) fail_msg("%g, and should be %g", (double)is, (double)should);
}

/* Of the options as they are */
static void find(PetscBool steady, Stream *stream)
{
  const MeshLocal *l;
  Mesh             mesh;
  Bodies           bodies;

  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(MeshGetLocal(mesh, &l));
  OK(BodiesCreate(l->dim, l->lower, l->upper, &bodies));
  OK(StreamFind(mesh, bodies, steady, stream));
  OK(BodiesDestroy(&bodies));
  OK(MeshDestroy(&mesh));
}

static void test_plane(void **state)
{
  const char *ellipse = "-particle_b_shape ellipse -particle_b_a .5 -particle_b_b .125 ",
             *airfoil = "-particle_b_shape airfoil ";
  const char *plate   = "-particle_b_shape box -particle_b_size 1,.05 ";

  (void)state;
  near(measure(2, "-particle_b_shape circle -particle_b_radius .3 ", 10), 0.6, 1e-12);
  near(measure(2, ellipse, 0), 1, 0.02);
  near(measure(2, ellipse, 90), 0.25, 0.02);
  assert_int_equal(edge, STREAM_NO_EDGE);
  near(measure(2, ellipse, 45), 0.25, 0.02);
  assert_int_equal(edge, STREAM_LIFTS);
  near(measure(2, airfoil, 0), 0.81, 0.05); /* its width is .12 */
  assert_int_equal(edge, STREAM_EDGE);
  near(measure(2, airfoil, 180), 0.81, 0.05);
  assert_int_equal(edge, STREAM_EDGE);
  for (PetscInt i = 0; i < 4; i++) {
    near(measure(2, airfoil, (PetscReal[]){3, 5, 10, 20}[i]), 0.12, 0.01);
    assert_int_equal(edge, STREAM_EDGE_LIFTS);
  }
  (void)measure(2, "-particle_b_shape polygon -particle_b_points -.5,0,.5,-.1,.5,.1 ", 0.5);
  assert_int_equal(edge, STREAM_EDGE);
  (void)measure(2, "-particle_b_shape polygon -particle_b_points -.5,0,.5,-.1,.5,.1 ", 4);
  assert_int_equal(edge, STREAM_EDGE_LIFTS);
  near(measure(2, plate, 0), 1, 0.02);
  near(measure(2, plate, 30), 0.05, 0.02);
  assert_int_equal(edge, STREAM_LIFTS); /* by right angles a mesh is lined up */
  near(measure(2, plate, 90), 0.05, 0.02);
  near(measure(2, "-particle_b_shape polygon -particle_b_points -.3,-.3,.3,-.3,.3,.3,-.3,.3 ", 0), 0.6, 0.02);
}

/* A cylinder with a flag behind it, before it, beside it, and about another pivot; a plate across with one behind */
static void test_put_together(void **state)
{
  const char *flag =
    "-particle_b_shape composite -particle_b_parts cyl,flag -particle_b_cyl_shape circle -particle_b_cyl_radius .05 "
    "-particle_b_flag_shape box -particle_b_flag_size .4,.02 -particle_b_flag_offset .2,0 ";
  const char *
    tee = "-particle_b_shape composite -particle_b_parts one,two -particle_b_one_shape box -particle_b_one_size .02,.4 "
          "-particle_b_two_shape box -particle_b_two_size .4,.02 -particle_b_two_offset .2,0 ";
  const char *pivot = "-particle_b_pivot 0,0 ";
  char        text[512];

  (void)state;
  snprintf(text, sizeof(text), "%s%s", flag, pivot);
  near(measure(2, flag, 0), 0.1, 0.05);
  near(measure(2, flag, 180), 0.1, 0.05);
  near(measure(2, text, 0), 0.1, 0.05);
  near(measure(2, flag, 90), 0.1, 0.05);
  near(measure(2, tee, 0), 0.02, 0.2);
  near(measure(2, tee, 180), 0.02, 0.2);
}

static void test_space(void **state)
{
  const char *cigar = "-particle_b_shape ellipse -particle_b_a .5 -particle_b_b .1 -particle_b_c .1 ",
             *plate = "-particle_b_shape box -particle_b_size .05,1,1 ";
  const char *fin =
    "-particle_b_shape composite -particle_b_parts ball,fin -particle_b_ball_shape circle -particle_b_ball_radius .1 "
    "-particle_b_fin_shape box -particle_b_fin_size .6,.02,.3 -particle_b_fin_offset .3,0,0 ";

  (void)state;
  near(measure(3, "-particle_b_shape circle -particle_b_radius .3 ", 25), 0.6, 1e-12);
  near(measure(3, cigar, 0), 1, 0.05);
  near(measure(3, cigar, 90), 0.2, 0.05); /* as a cylinder across */
  near(measure(3, plate, 0), 0.05, 0.05);
  near(measure(3, plate, 90), 1, 0.05);
  near(measure(3, fin, 0), 0.2, 0.15);
}

/* The fastest inflow or moving wall, that of a formula where it is fastest on its boundary */
static void test_stream(void **state)
{
  Stream stream;

  (void)state;
  give(
    "-mesh_cells 4,4 -flow_bc_left_type inflow -flow_bc_left_velocity 1,0 -flow_bc_top_type moving_wall -flow_bc_top_velocity 0,-2 "
    "-flow_bc_right_type outflow -flow_bc_bottom_type inflow -flow_bc_bottom_velocity 9*x,0");
  find(PETSC_TRUE, &stream);
  assert_true(stream.speed == 9 && stream.direction[0] == 1);
  give(
    "-mesh_cells 4,4 -flow_bc_left_type inflow -flow_bc_left_velocity 1,0 -flow_bc_top_type moving_wall -flow_bc_top_velocity 0,-2 ");
  find(PETSC_TRUE, &stream);
  assert_true(stream.speed == 2 && stream.direction[0] == 0 && stream.direction[1] == -1);
  give("-mesh_cells 4,4");
  find(PETSC_TRUE, &stream);
  assert_true(stream.speed == 0);
}

/* Formulas over the time of the run, factors of it; what is worked out */
static void test_stream_of_a_formula(void **state)
{
  static const struct {
    const char *velocity;
    PetscReal   speed;
  } inflow[] = {{"1+0.5*sin(t),0", 1.5},
                {"0,1-t", 3},
                {"1,0.5*sin(t)", 1.118},
                {"1+0.5,2", 2.5},
                {"6*y*(1-y),0", 1.5},
                {"0,-3", 3},
                {"1,0 -flow_bc_left_factor 1,-0.5,3", 1.5}};
  Stream stream;
  char   text[256];

  (void)state;
  for (size_t i = 0; i < sizeof(inflow) / sizeof(inflow[0]); i++) {
    snprintf(text, sizeof(text), "-mesh_cells 4,4 -sim_time 4 -flow_bc_left_type inflow -flow_bc_left_velocity %s",
             inflow[i].velocity);
    give(text);
    find(PETSC_FALSE, &stream);
    near(stream.speed, inflow[i].speed, 1e-3);
  }
}

#define ARRAY \
  "-mesh_cells 6,6 -mesh_lower -.5,-.5 -mesh_upper .5,.5 -mesh_periodic x,y -flow_density 1 " ALL \
  "-particle_b_shape circle -particle_b_position 0,0 "

/* Driven by a force. Slow: the mean velocity of Sangani & Acrivos (1982), force over 15.56 mu and 51.53 mu, in the
   section that is left; fast: steady solutions on 64 x 64 cells lined up with the disc. Estimates of a layer that goes
   by the root of it. */
static void test_driven(void **state)
{
  static const struct {
    const char *options;
    PetscReal   radius, speed, share;
  } scene[] = {{"-flow_force 0,-.01 -flow_viscosity 1 -sim_steady", 0.126157, 0.01 / 15.56, 0.05},
               {"-flow_force .01,0 -flow_viscosity 1 -sim_steady", 0.25231325, 0.01 / 51.53, 0.05},
               {"-flow_force 1,0 -flow_viscosity .01 -sim_steady", 0.1262, 4.449, 0.2},
               {"-flow_force 1,0 -flow_viscosity .01 -sim_steady", 0.25231, 1.494, 0.2},
               {"-flow_force 1,0 -flow_viscosity .005 -sim_steady", 0.25231, 2.700, 0.2},
               {"-flow_force 1,0 -flow_viscosity .01 -sim_time .1", 0.1262, 0.1 * 0.95, 0.01},
               {"-flow_force cos(20*t),0 -flow_viscosity .01 -sim_time 1", 0.1262, 0.05 * 0.95, 0.03},
               {"-flow_force 1+sin(2*pi*x),0 -flow_viscosity .01 -sim_steady", 0.25231, 1.494, 0.2},
               {"-flow_rate 3,0 -flow_viscosity .01 -sim_time 1", 0.25231, 3, 0.01},
               {"-flow_force sin(2*pi*y),0 -flow_viscosity .01 -sim_steady", 0.25231, 0, 0.01}};
  Stream stream;
  char   text[1024];

  (void)state;
  for (size_t i = 0; i < sizeof(scene) / sizeof(scene[0]); i++) {
    snprintf(text, sizeof(text), ARRAY "-particle_b_radius %g %s", (double)scene[i].radius, scene[i].options);
    give(text);
    find((PetscBool)(strstr(text, "steady") != NULL), &stream);
    if (scene[i].speed == 0) assert_true(stream.speed < 1e-12);
    else near(stream.speed, scene[i].speed / (1 - 2 * scene[i].radius), scene[i].share);
    if (i == 0) assert_true(stream.direction[1] == -1);
  }
}

/* By the pressures of openings: Poiseuille flow between walls, whose mean is H^2 dp / (12 mu L), and through a box
   that slips, where all of it is spent on the speed; a box with one opening */
static void test_pressure(void **state)
{
  const char *ends = "-mesh_cells 6,6 -mesh_upper 4,1 -flow_density 1 -flow_bc_left_type pressure -flow_bc_right_type "
                     "outflow -flow_bc_left_pressure ";
  Stream      stream;
  char        text[1024];

  (void)state;
  snprintf(text, sizeof(text), "%s .004 -flow_viscosity 1", ends);
  give(text);
  find(PETSC_TRUE, &stream);
  near(stream.speed, 0.001 / 12, 1e-3);
  assert_true(stream.direction[0] == 1);
  snprintf(text, sizeof(text), "%s 2*cos(t) -flow_viscosity 1e-6 -flow_bc_bottom_type slip -flow_bc_top_type slip",
           ends);
  give(text);
  find(PETSC_TRUE, &stream);
  near(stream.speed, 2, 1e-3);
  give("-mesh_cells 6,6 -flow_force 1,0 -flow_bc_left_type outflow");
  find(PETSC_TRUE, &stream);
  assert_true(stream.speed == 0);
}

/* Cells of the layer, sqrt(d nu / U) / h; none where the body may travel, or without convection */
static void test_layer(void **state)
{
  const MeshLocal *l;
  const Stream     stream   = {.speed = 4, .direction = {1, 0, 0}};
  const PetscReal  lower[3] = {0, 0, 0}, upper[3] = {1, 1, 0};
  Mesh             mesh;
  Bodies           bodies;
  PetscReal        cells;

  (void)state;
  for (PetscInt i = 0; i < 3; i++) {
    char text[512];

    snprintf(text, sizeof(text),
             "-mesh_cells 10,10 -flow_viscosity .04 -flow_density 2 %s-particle_groups b -particle_b_shape circle -particle_b_radius .1 -particle_b_density 1 -particle_b_position "
             ".3,.3 -particle_b_free %s",
             i == 2 ? "-flow_convection false " : "", i == 1 ? "all" : "none");
    give(text);
    OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
    OK(MeshGetLocal(mesh, &l));
    OK(BodiesCreate(2, lower, upper, &bodies));
    OK(StreamMeasureLayer(l, bodies, 0, &stream, &cells, &edge));
    if (i == 0) near(cells, PetscSqrtReal(0.2 * 0.02 / 4) / 0.1, 1e-12);
    else assert_true(cells == PETSC_MAX_REAL);
    OK(BodiesDestroy(&bodies));
    OK(MeshDestroy(&mesh));
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_plane),
                                     cmocka_unit_test(test_put_together),
                                     cmocka_unit_test(test_space),
                                     cmocka_unit_test(test_stream),
                                     cmocka_unit_test(test_stream_of_a_formula),
                                     cmocka_unit_test(test_driven),
                                     cmocka_unit_test(test_pressure),
                                     cmocka_unit_test(test_layer)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("stream", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
