/* Align in space: valid cells around bodies wherever they lie and however they are turned, surfaces met exactly,
   volume, with sharp edges too, gaps, passages through sides, plates refused, and the same mesh on any number of ranks.
   */
/* ranks: 1 2 3 */
#include "alignedcase.h"
#include "fem/element.h"

#define BALL "-particle_groups a -particle_a_free none -particle_a_position 0.5,0.5,0.5 -particle_a_shape "

static void open_case(Case *c, PetscInt cells, const char options[])
{
  char text[1024];

  snprintf(text, sizeof(text), "-mesh_cells %d,%d,%d -mesh_lower 0,0,0 -mesh_upper 1,1,1 %s", (int)cells, (int)cells,
           (int)cells, options);
  give(text);
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(BodiesCreate(3, c->l->lower, c->l->upper, &c->bodies));
  open_align(c);
  c->quality = 1;
  c->failed  = 0;
}

static void fit_all(Case *c, PetscInt nbody)
{
  fit(c);
  c->quality = PetscMin(c->quality, c->r.quality);
  for (PetscInt k = 0; k < nbody; k++) c->failed += c->wanted[k] && !c->aligned[k];
}

static void turn(Case *c, PetscInt k, PetscInt key)
{
  PetscReal size = 0;

  for (PetscInt a = 0; a < 4; a++) {
    c->state->q[k][a] = noise(key + a) + (a ? 0 : 0.1);
    size += PetscSqr(c->state->q[k][a]);
  }
  for (PetscInt a = 0; a < 4; a++) c->state->q[k][a] /= PetscSqrtReal(size);
}

/* Volume of the fluid by the quadrature of the flow; no cell of it may have a Jacobian <= 0 there */
static PetscReal fluid_volume(Case *c)
{
  ElementTables t;
  PetscReal     sum = 0;

  OK(ElementCreate(3, &t));
  for (PetscInt cell = 0; cell < c->l->ncell; cell++) {
    PetscReal     xc[81];
    ElementMetric m;

    if (c->r.cell_surface[cell] >= 0) continue;
    OK(MeshCellCoordinates(c->mesh, cell, xc));
    ElementSetMetric(&t, xc, &m);
    for (PetscInt q = 0; q < t.nq; q++) {
      assert_true(m.weight[q] > 0);
      sum += m.weight[q];
    }
  }
  OK(ElementDestroy(&t));
  return total(sum);
}

/* A number that changes with every displacement */
static PetscReal signature(Case *c)
{
  PetscReal sum = 0;

  for (PetscInt i = 0; i < c->l->nnode; i++)
    for (PetscInt a = 0; a < 3; a++)
      sum += (c->l->x[3 * i + a] - c->l->x_start[3 * i + a]) * PetscSinReal(40 * c->l->x_start[3 * i + a] + a);
  return total(sum);
}

/* A shape at random places and angles: valid cells, surface met, volume within tolerance (0: not measured), and the
   mesh that one rank makes (sign) */
typedef struct {
  const char *shape;
  PetscInt    cells;
  PetscReal   volume, tolerance, sign;
} Kind;

static const Kind KINDS[] = {
  {"circle -particle_a_radius 0.25", 8, 0.06544984694978735, 3e-3, -1.810456861275},
  {"circle -particle_a_radius 0.25", 16, 0.06544984694978735, 1e-4, -4.148680735705},
  {"circle -particle_a_radius 0.125", 8, 0, 0, -1.530138132467},
  {"ellipse -particle_a_a 0.25 -particle_a_b 0.125 -particle_a_c 0.125", 8, 0, 0, -0.414706599543},
  {"ellipse -particle_a_a 0.25 -particle_a_b 0.125 -particle_a_c 0.125", 16, 0.016362461737446838, 4e-3,
   -2.804016471366},
  {"ellipse -particle_a_a 0.3 -particle_a_b 0.3 -particle_a_c 0.15", 12, 0, 0, 0.784254777358},
  {"box -particle_a_size 0.4,0.4,0.4 -particle_a_rounding 0.06", 16, 0, 0, -7.347441496957},
  {"box -particle_a_size 0.4,0.4,0.4 -particle_a_rounding 0.1", 16, 0, 0, 0.625435322019},
  {"leaflet -particle_a_length 0.5 -particle_a_thickness 0.2 -particle_a_origin 0.5", 16, 0, 0, -4.154165223544},
  {"cylinder -particle_a_radius 0.2 -particle_a_length 0.4 -particle_a_rounding 0.06", 16, 0, 0, -2.132914368456},
  {"torus -particle_a_radius 0.25 -particle_a_tube 0.12", 16, 0, 0, -2.051902672317},
  {"box -particle_a_size 0.4,0.4,0.4", 16, 0.064, 1e-3, 1.328772007772},
  {"cylinder -particle_a_radius 0.2 -particle_a_length 0.4", 16, 0.05026548245743669, 2e-3, 2.748018619088},
};

/* ALIGN_SURVEY=200: that many placements of each shape, and what came of them (runs/studies/aligned-space) */
static void test_shapes(void **state)
{
  const char    *many = getenv("ALIGN_SURVEY");
  const PetscInt n    = many ? atoi(many) : 2;
  PetscMPIInt    size;

  (void)state;
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  for (size_t kind = 0; kind < PETSC_STATIC_ARRAY_LENGTH(KINDS); kind++) {
    const Kind    *g    = KINDS + kind;
    const PetscInt key  = 100 * (PetscInt)(kind + 1) - (kind > 5 ? 100 : kind == 5 ? 50 : 0);
    PetscReal      sign = 0;
    Case           c;
    char           options[512];

    if (size > 1 && (PetscMPIInt)(kind % 3) != size - 1) continue; /* several ranks: every third, not the same ones */
    snprintf(options, sizeof(options), BALL "%s", g->shape);
    open_case(&c, g->cells, options);
    for (PetscInt t = 0; t < n; t++) {
      for (PetscInt a = 0; a < 3; a++) c.state->x[0][a] = 0.5 + 0.5 / (PetscReal)g->cells * noise(key + 7 * t + a);
      turn(&c, 0, key + 7 * t + 3);
      fit_all(&c, 1);
      BELOW(miss(&c), 1e-9);
      if (g->volume > 0) NEAR(1 - fluid_volume(&c), g->volume, g->tolerance * g->volume);
      sign += signature(&c);
    }
    if (many)
      print_message("%s, %d cells: %d placements, %d left alone, smallest ratio %.4f, sum %.12f\n", g->shape,
                    (int)g->cells, (int)n, (int)c.failed, (double)c.quality, (double)sign);
    else NEAR(sign, g->sign, 1e-9);
    assert_int_equal(c.failed, 0);
    assert_true(c.quality > 0.0049);
    close_case(&c);
  }
}

#define PAIR \
  "-particle_groups a,b -particle_a_shape circle -particle_a_radius 0.2 -particle_a_free none -particle_a_position 0.3,0.5,0.5 " \
  "-particle_b_shape circle -particle_b_radius 0.2 -particle_b_free none -particle_b_position 0.7,0.5,0.5 -mesh_periodic x,y,z"

/* Two spheres close together, across periodic boundaries as well: surfaces are met down to half a cell, and drawn back
   by an eighth of a cell at most below */
static void test_gaps(void **state)
{
  const PetscReal gap[] = {1, 0.5, 0.3, 0.2, 0.1};
  Case            c;

  (void)state;
  open_case(&c, 14, PAIR);
  for (PetscInt t = 0; t < 10; t++) {
    const PetscReal D = 0.4 + gap[t % 5] / 14;
    PetscReal       r[3], size = 0;

    for (PetscInt a = 0; a < 3; a++) {
      r[a] = noise(11 * t + a);
      size += PetscSqr(r[a]);
    }
    for (PetscInt k = 0; k < 2; k++)
      for (PetscInt a = 0; a < 3; a++)
        c.state->x[k][a] = (a ? 0.5 : 0.95) + noise(11 * t + 5 + a) / 28 +
                           (k ? 0.5 : -0.5) * D * r[a] / PetscSqrtReal(size);
    fit_all(&c, 2);
    assert_int_equal(c.failed, 0);
    assert_int_equal(c.r.nnarrow, t % 5 < 2 ? 0 : 2);
    BELOW(miss(&c), t % 5 < 2 ? 1e-13 : 0.125 / 14);
  }
  assert_true(c.quality > 0.002);
  close_case(&c);
}

/* Dead cells of one body that meet at a vertex are of one image of it */
static void check_layer(Case *c)
{
  for (PetscInt i = 0; i < c->l->nnode; i++) {
    PetscReal low[3]  = {PETSC_MAX_REAL, PETSC_MAX_REAL, PETSC_MAX_REAL},
              high[3] = {-PETSC_MAX_REAL, -PETSC_MAX_REAL, -PETSC_MAX_REAL};

    for (PetscInt e = c->l->node_cell_ptr[i]; e < c->l->node_cell_ptr[i + 1]; e++) {
      const PetscInt cell = c->l->node_cell[e], *node = c->l->cell_node + cell * c->l->nb;

      if (c->r.cell_surface[cell] < 0) continue;
      for (PetscInt a = 0; a < 3; a++) { /* from the node, on to the nearest centre of a small body */
        const PetscReal to = DomainNearest(1, c->l->x_start[3 * node[13] + a] - c->l->x_start[3 * i + a], 0);
        const PetscReal at = to + DomainNearest(1, c->state->x[0][a] - c->l->x_start[3 * node[13] + a], 0);

        low[a]  = PetscMin(low[a], at);
        high[a] = PetscMax(high[a], at);
      }
    }
    for (PetscInt a = 0; a < 3 && low[a] < PETSC_MAX_REAL; a++) BELOW(high[a] - low[a], 1e-9);
  }
}

/* A body and its own images: a layer of cells is kept between them, none of it filled, surfaces are met, across the
   boundary as well; drawn back below half a cell; what is longer than half a period along a diagonal */
static void test_images(void **state)
{
  static const struct {
    const char *shape;
    PetscReal   volume, angle;
    PetscInt    narrow;
  } kinds[] = {{"circle -particle_a_radius 0.434245", 0.343, 0, 0},
               {"circle -particle_a_radius 0.49237", 0.5, 0, 1},
               {"ellipse -particle_a_a 0.47 -particle_a_b 0.3 -particle_a_c 0.3", 0.177185812805, 0, 0},
               {"ellipse -particle_a_a 0.66 -particle_a_b 0.2 -particle_a_c 0.2", 0.110584061406, 0.6, 0}};
  Case        c;
  PetscMPIInt size;

  (void)state;
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  for (PetscInt kind = size - 1; kind < (size > 1 ? size : 4); kind++) { /* several ranks: one of them */
    char options[256];

    snprintf(options, sizeof(options), BALL "%s -mesh_periodic x,y,z", kinds[kind].shape);
    open_case(&c, kind == 3 ? 14 : 12, options);
    c.state->q[0][0] = PetscCosReal(kinds[kind].angle / 2);
    c.state->q[0][2] = PetscSinReal(kinds[kind].angle / 2);
    for (PetscInt t = 0; t < 2; t++) {
      for (PetscInt a = 0; a < 3; a++) c.state->x[0][a] = t ? 0.99 - 0.43 * (PetscReal)a : 5.5 / 12;
      fit_all(&c, 1);
      assert_int_equal(c.failed, 0);
      assert_int_equal(c.r.nnarrow, kinds[kind].narrow);
      if (!kinds[kind].narrow) NEAR(1 - fluid_volume(&c), kinds[kind].volume, 2e-4 * kinds[kind].volume);
      if (kind < 3) check_layer(&c);
    }
    close_case(&c);
  }
}

/* A sphere that comes to a side of the domain, and touches it at last; that is unwanted then, and the mesh goes back */
static void test_side(void **state)
{
  Case c;

  (void)state;
  open_case(&c, 8, BALL "circle -particle_a_radius 0.25");
  for (PetscInt t = 0; t <= 8; t++) {
    c.state->x[0][0] = 0.25 + (8 - t) / 8.0 * 0.1;
    c.state->x[0][1] = 0.5 + 0.1 * noise(t);
    fit_all(&c, 1);
    BELOW(miss(&c), 0.25 / 8);
    for (PetscInt i = 0; i < c.l->nnode_all; i++)
      if (c.l->x_start[3 * i] == 0) assert_true(c.l->x[3 * i] == 0);
  }
  assert_int_equal(c.failed, 0);
  assert_int_equal(c.r.nnarrow, 1);
  c.wanted[0] = PETSC_FALSE;
  fit_all(&c, 1);
  for (PetscInt i = 0; i < 3 * c.l->nnode_all; i++) assert_true(c.l->x[i] == c.l->x_start[i]);
  assert_int_equal(c.r.nmarked, 0);
  close_case(&c);
}

/* Volume that an aligned case is off by from what it should be, and nodes of sides are still on them */
static void check_passage(Case *c, PetscReal inside, PetscReal tolerance)
{
  fit_all(c, 1);
  assert_int_equal(c->failed, 0);
  BELOW(miss(c), 1e-8);
  NEAR(1 - fluid_volume(c), inside, tolerance * inside);
  for (PetscInt i = 0; i < 3 * c->l->nnode_all; i++)
    if (c->l->period[i % 3] == 0 && (c->l->x_start[i] == 0 || c->l->x_start[i] == 1))
      assert_true(c->l->x[i] == c->l->x_start[i]);
}

/* A cylinder through two sides, straight and at an angle, the same round a period; a ball cut by one side and by two */
static void test_passages(void **state)
{
  const PetscReal angle = 0.2, R = 0.25, cut = 0.1, half = PETSC_PI * (R + cut) * (R + cut) * (2 * R - cut) / 3;
  Case            c;

  (void)state;
  open_case(&c, 8, BALL "cylinder -particle_a_radius 0.25 -particle_a_length 1.6");
  c.state->x[0][0] = 0.51;
  check_passage(&c, PETSC_PI * R * R, 1e-3);
  assert_int_equal(c.r.npass, 1);
  c.state->q[0][0] = PetscCosReal(angle / 2);
  c.state->q[0][1] = PetscSinReal(angle / 2);
  check_passage(&c, PETSC_PI * R * R / PetscCosReal(angle), 2e-3);
  close_case(&c);
  open_case(&c, 8, BALL "cylinder -particle_a_radius 0.25 -particle_a_length 1.2 -mesh_periodic z");
  check_passage(&c, PETSC_PI * R * R, 1e-3);
  assert_int_equal(c.r.npass, 0);
  close_case(&c);
  open_case(&c, 8, BALL "circle -particle_a_radius 0.25");
  for (PetscInt t = 0; t < 3; t++) {
    c.state->x[0][0] = 0.5 + 0.06 * noise(t);
    c.state->x[0][1] = t < 2 ? 0.1 : 0.9;
    check_passage(&c, half, 5e-3);
  }
  c.state->x[0][0] = c.state->x[0][1] = 0;
  check_passage(&c, PETSC_PI * R * R * R / 3, 5e-3);
  close_case(&c);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_shapes), cmocka_unit_test(test_gaps),
                                     cmocka_unit_test(test_images), cmocka_unit_test(test_side),
                                     cmocka_unit_test(test_passages)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (OptFinalize() || ShapeFinalize() || PetscFinalize()) return 1;
  return failed;
}
