/* Align: valid cells around circles and ellipses wherever they lie, walls met exactly, gaps, wall, period, fallback,
   and the same mesh on any number of ranks. */
/* ranks: 1 2 */
#include "alignedcase.h"

static void open_case(Case *c, const char options[])
{
  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(BodiesCreate(2, c->l->lower, c->l->upper, &c->bodies));
  open_align(c);
}

static void turn(Case *c, PetscInt k, PetscReal angle)
{
  c->state->q[k][0] = PetscCosReal(angle / 2);
  c->state->q[k][1] = c->state->q[k][2] = 0;
  c->state->q[k][3]                     = PetscSinReal(angle / 2);
}

static PetscReal area(Case *c, PetscBool dead)
{
  const PetscReal g[3] = {-PetscSqrtReal(0.6), 0, PetscSqrtReal(0.6)}, w[3] = {5 / 9.0, 8 / 9.0, 5 / 9.0};
  PetscReal       sum = 0;

  for (PetscInt cell = 0; cell < c->l->ncell; cell++) {
    PetscReal xc[18];

    if ((c->r.cell_surface[cell] >= 0) != dead) continue;
    OK(MeshCellCoordinates(c->mesh, cell, xc));
    for (PetscInt q = 0; q < 9; q++) {
      const PetscReal s = g[q % 3], t = g[q / 3], a[3] = {0.5 * s * (s - 1), 1 - s * s, 0.5 * s * (s + 1)},
                      b[3]  = {0.5 * t * (t - 1), 1 - t * t, 0.5 * t * (t + 1)};
      const PetscReal da[3] = {s - 0.5, -2 * s, s + 0.5}, db[3] = {t - 0.5, -2 * t, t + 0.5};
      PetscReal       J[4] = {0};

      for (PetscInt j = 0; j < 9; j++)
        for (PetscInt e = 0; e < 4; e++)
          J[e] += (e % 2 ? a[j % 3] * db[j / 3] : da[j % 3] * b[j / 3]) * xc[2 * j + e / 2];
      sum += w[q % 3] * w[q / 3] * (J[0] * J[3] - J[1] * J[2]);
    }
  }
  return total(sum);
}

static void test_circles(void **state)
{
  const PetscReal size[] = {0.75, 1, 1.5, 2, 3, 4.5, 6, 9, 14};
  PetscReal       worst  = 1;

  (void)state;
  for (PetscInt n = 0; n < 9; n++) {
    Case c;
    char options[256];

    snprintf(options, sizeof(options),
             "-mesh_cells 40,40 -mesh_upper 1,1 -particle_groups a -particle_a_shape circle -particle_a_radius %g -particle_a_free none -particle_a_position 0.5,0.5",
             (double)(size[n] / 40));
    open_case(&c, options);
    for (PetscInt trial = 0; trial < 40; trial++) {
      for (PetscInt a = 0; a < 2; a++) c.state->x[0][a] = 0.5 + 0.025 * noise(1000 * n + 2 * trial + a);
      fit(&c);
      assert_true(c.aligned[0]);
      worst = PetscMin(worst, c.r.quality);
      BELOW(miss(&c), 1e-13);
    }
    NEAR(area(&c, PETSC_FALSE), 1 - PETSC_PI * PetscSqr(size[n] / 40),
         (size[n] < 2 ? 3e-2 : 1e-3) * PetscSqr(size[n] / 40));
    c.wanted[0] = PETSC_FALSE; /* the mesh goes back to what it was */
    fit(&c);
    for (PetscInt i = 0; i < 2 * c.l->nnode_all; i++) assert_true(c.l->x[i] == c.l->x_start[i]);
    assert_int_equal(c.r.nmarked, 0);
    close_case(&c);
  }
  assert_true(worst > 0.015);
}

static void test_ellipses(void **state)
{
  PetscReal worst = 1;

  (void)state;
  for (PetscInt n = 0; n < 4; n++) {
    Case c;
    char options[256];

    snprintf(options, sizeof(options),
             "-mesh_cells 48,48 -mesh_upper 1,1 -particle_groups a -particle_a_shape ellipse -particle_a_a %g -particle_a_b %g -particle_a_free none -particle_a_position 0.5,0.5",
             (double)((n + 2) * 2.0 / 48), (double)(2.0 / 48));
    open_case(&c, options);
    for (PetscInt trial = 0; trial < 40; trial++) {
      for (PetscInt a = 0; a < 2; a++) c.state->x[0][a] = 0.5 + 0.02 * noise(3000 * n + 3 * trial + a);
      turn(&c, 0, PETSC_PI * noise(3000 * n + 3 * trial + 2));
      fit(&c);
      assert_true(c.aligned[0]);
      worst = PetscMin(worst, c.r.quality);
      BELOW(miss(&c), 1e-12);
    }
    close_case(&c);
  }
  assert_true(worst > 0.005);
}

#define PAIR \
  "-mesh_cells 40,40 -mesh_upper 1,1 -particle_groups a,b -particle_a_shape circle -particle_a_radius 0.1 -particle_a_free none -particle_a_position 0.3,0.5 " \
  "-particle_b_shape circle -particle_b_radius 0.1 -particle_b_free none -particle_b_position 0.7,0.5 "

/* Two discs close together, in the middle or across a periodic boundary: both walls are met exactly down to half a
   cell, and drawn back by an eighth of a cell at most below */
static void test_gaps(void **state)
{
  const PetscReal gap[] = {1, 0.5, 0.3, 0.2};
  Case            c;

  (void)state;
  for (PetscInt periodic = 0; periodic < 2; periodic++) {
    open_case(&c, periodic ? PAIR "-mesh_periodic x,y" : PAIR);
    for (PetscInt t = 0; t < 120; t++) {
      const PetscReal angle = PETSC_PI * noise(3 * t + 1), D = 0.2 + gap[t % 4] / 40;

      for (PetscInt k = 0; k < 2; k++) {
        c.state->x[k][0] = (periodic ? 0.95 : 0.5) + 0.0125 * noise(3 * t + 2) +
                           (k ? 0.5 : -0.5) * D * PetscCosReal(angle);
        c.state->x[k][1] = (periodic ? 0.02 : 0.5) + 0.0125 * noise(3 * t + 3) +
                           (k ? 0.5 : -0.5) * D * PetscSinReal(angle);
      }
      fit(&c);
      assert_true(c.aligned[0] && c.aligned[1]);
      assert_int_equal(c.r.nnarrow, t % 4 < 2 ? 0 : 2);
      BELOW(miss(&c), t % 4 < 2 ? 1e-13 : 0.125 / 40);
    }
    NEAR(area(&c, PETSC_FALSE), 1 - 2 * PETSC_PI * 0.01, 5e-4);
    close_case(&c);
  }
}

/* Distance of the closest wall node from point x */
static PetscReal nearest_node(Case *c, const PetscReal x[])
{
  PetscReal best = PETSC_MAX_REAL;

  for (PetscInt e = 0; e < c->r.nmarked; e++) {
    const PetscInt i = c->r.marked[e];

    if (c->r.on_wall[i]) best = PetscMin(best, PetscHypotReal(c->l->x[2 * i] - x[0], c->l->x[2 * i + 1] - x[1]));
  }
  return -largest(-best);
}

/* A box, one of 1.5 cells, and an L with its re-entrant corner, anywhere and at any angle: nodes on all corners, and
   then the mesh has the area of the body to round-off, as its sides are straight */
static void test_corners(void **state)
{
  const char *shape[] =
    {"box -particle_a_size 0.3,0.11 ", "box -particle_a_size 0.0375,0.0375 ",
     "composite -particle_a_parts b,c -particle_a_b_shape box -particle_a_b_size 0.3,0.11 -particle_a_c_shape box -particle_a_c_size "
     "0.11,0.3 -particle_a_c_offset -0.095,0.095 "};
  const PetscReal volume[] = {0.033, 0.0375 * 0.0375, 0.0539};
  PetscReal       worst    = 1;

  (void)state;
  for (PetscInt n = 0; n < 3; n++) {
    Case c;
    char options[512];

    snprintf(options, sizeof(options),
             "-mesh_cells 40,40 -mesh_upper 1,1 -particle_groups a -particle_a_free none -particle_a_position 0.5,0.5 -particle_a_shape %s",
             shape[n]);
    open_case(&c, options);
    for (PetscInt trial = 0; trial < 60; trial++) {
      PetscReal x[2 * 6];
      PetscInt  ncorner;

      for (PetscInt a = 0; a < 2; a++) c.state->x[0][a] = 0.5 + 0.0125 * noise(3 * trial + a);
      turn(&c, 0, PETSC_PI * noise(3 * trial + 2));
      fit(&c);
      OK(BodiesGetCorners(c.bodies, 0, c.state->x[0], c.state->q[0], 6, &ncorner, x));
      assert_int_equal(ncorner, n == 2 ? 6 : 4);
      assert_true(c.aligned[0]);
      assert_int_equal(c.r.ncut, 0);
      worst = PetscMin(worst, c.r.quality);
      BELOW(miss(&c), 1e-12);
      NEAR(area(&c, PETSC_TRUE), volume[n], 1e-12);
      for (PetscInt i = 0; i < ncorner; i++) BELOW(nearest_node(&c, x + 2 * i), 1e-12);
    }
    close_case(&c);
    assert_true(worst > 0.003);
  }
}

/* A disc that comes to a side of the domain, and touches it at last */
static void test_side(void **state)
{
  Case c;

  (void)state;
  open_case(&c, PAIR);
  c.wanted[1] = PETSC_FALSE;
  for (PetscInt t = 0; t < 60; t++) {
    c.state->x[0][0] = 0.1 + (60 - t) / 60.0 * 0.05;
    c.state->x[0][1] = 0.4 + 0.025 * noise(t);
    fit(&c);
    assert_true(c.aligned[0]);
    BELOW(miss(&c), 0.25 / 40);
  }
  assert_int_equal(c.r.nnarrow, 1);
  for (PetscInt t = 0; t <= 40; t++) { /* and on through it: from a cell deep on, the side ends on the disc */
    c.state->x[0][0] = 0.1 - t / 400.0;
    fit(&c);
    if (t > 8 && t <= 10) continue; /* drawn back by a cell and more: left alone */
    assert_true(c.aligned[0]);
    assert_int_equal(c.r.npass, t > 10);
    BELOW(miss(&c), t > 10 ? 1e-10 : 1.3 / 40);
    for (PetscInt i = 0; i < c.l->nnode_all; i++)
      if (c.l->x_start[2 * i] == 0) assert_true(c.l->x[2 * i] == 0);
  }
  close_case(&c);
}

/* ---- bodies thinner than a cell ---- */

/* Own path nodes by kind, how far they are from the mid-line of a straight leaflet (along x in its frame, a long on
   both sides of its middle), and the smallest distances to its tips */
typedef struct {
  PetscReal vertices, edges, off, tip[2], moment;
} Plate;

static void measure_plate(Case *c, PetscInt k, PetscReal angle, PetscReal a, Plate *p)
{
  const MeshLocal *l = c->l;

  *p = (Plate){0, 0, 0, {1, 1}, 0};
  for (PetscInt e = 0; e < c->r.nmarked; e++) {
    const PetscInt i = c->r.marked[e], cell = l->node_cell[l->node_cell_ptr[i]];
    PetscReal      r[2], along, across;
    PetscInt       j = 0;

    if (c->r.node_surface[i] != k) continue;
    assert_true(c->r.on_wall[i]);
    for (PetscInt b = 0; b < 2; b++) {
      r[b] = l->x[2 * i + b] - c->state->x[k][b];
      if (l->period[b] > 0) r[b] -= l->period[b] * PetscFloorReal(r[b] / l->period[b] + 0.5);
    }
    along  = r[0] * PetscCosReal(angle) + r[1] * PetscSinReal(angle);
    across = r[1] * PetscCosReal(angle) - r[0] * PetscSinReal(angle);
    p->off = PetscMax(p->off, PetscAbsReal(across));
    for (PetscInt b = 0; b < 2; b++) p->tip[b] = PetscMin(p->tip[b], PetscAbsReal(along + (b ? a : -a)));
    if (i >= l->nnode) continue;
    while (l->cell_node[9 * cell + j] != i) j++;
    if (j % 2) p->edges++;
    else p->vertices++;
    p->moment += along * along;
  }
  p->vertices = total(p->vertices);
  p->edges    = total(p->edges);
  p->moment   = total(p->moment);
  p->off      = largest(p->off);
  for (PetscInt b = 0; b < 2; b++) p->tip[b] = -largest(-p->tip[b]);
}

#define PLATE \
  "-particle_a_shape leaflet -particle_a_origin 0.5 -particle_a_free none -particle_a_position 0.5,0.5 -mesh_upper 1,1 -particle_groups a "

/* A plate anywhere, also across a periodic boundary: one connected path of edges on its mid-line with ends on its tips,
   no dead cell, all cells valid */
static void test_plates(void **state)
{
  const char     *options[] = {PLATE "-mesh_cells 40,40 -particle_a_length 0.5 -particle_a_thickness 0.01",
                               PLATE
                               "-mesh_cells 40,40 -mesh_periodic x,y -particle_a_length 0.35 -particle_a_thickness 0.02",
                               PLATE "-mesh_cells 32,48 -particle_a_length 0.2 -particle_a_thickness 1e-4"};
  const PetscReal length[3] = {0.5, 0.35, 0.2};
  PetscReal       worst     = 1;

  (void)state;
  for (PetscInt n = 0; n < 3; n++) {
    Case c;

    open_case(&c, options[n]);
    for (PetscInt trial = 0; trial < 120; trial++) {
      const PetscReal angle = trial < 60 ? PETSC_PI * noise(500 * n + 3 * trial) : 0.003 * (trial - 60);
      Plate           p;

      for (PetscInt b = 0; b < 2; b++)
        c.state->x[0][b] = (n == 1 ? 0.98 : 0.5) + 0.05 * noise(500 * n + 3 * trial + 1 + b);
      turn(&c, 0, angle);
      fit(&c);
      assert_true(c.aligned[0]);
      assert_false(c.r.inactive[0]);
      measure_plate(&c, 0, angle, length[n] / 2, &p);
      NEAR(p.edges, p.vertices - 1, 0);
      BELOW(p.off, 1e-13);
      BELOW(p.tip[0], 1e-13);
      BELOW(p.tip[1], 1e-13);
      worst = PetscMin(worst, c.r.quality);
    }
    NEAR(area(&c, PETSC_FALSE), 1, 1e-12);
    c.wanted[0] = PETSC_FALSE;
    fit(&c);
    for (PetscInt i = 0; i < 2 * c.l->nnode_all; i++) assert_true(c.l->x[i] == c.l->x_start[i]);
    close_case(&c);
  }
  assert_true(worst > 0.05);
}

/* A plate hinged at the floor, its foot in it or close to it: the path ends at a vertex of the floor, which stays in
   its place, so that one edge more than vertices are the plate's own */
static void test_hinged_plates(void **state)
{
  const PetscReal h = 1.0 / 40, a = 0.25;
  PetscReal       worst = 1;
  Case            c;

  (void)state;
  open_case(&c, PLATE "-mesh_cells 40,40 -particle_a_length 0.5 -particle_a_thickness 0.001");
  for (PetscInt trial = 0; trial < 200; trial++) {
    const PetscReal angle = 0.5 * PETSC_PI + 1.2 * noise(3 * trial), foot = h * (0.05 + 0.33 * noise(3 * trial + 1));
    Plate           p;

    c.state->x[0][0] = 0.5 + 0.05 * noise(3 * trial + 2);
    c.state->x[0][1] = foot + a * PetscSinReal(angle);
    turn(&c, 0, angle);
    fit(&c);
    assert_true(c.aligned[0]);
    measure_plate(&c, 0, angle, a, &p);
    NEAR(p.edges, p.vertices, 0);
    BELOW(p.off, 0.5 * h);
    BELOW(p.tip[0], 1e-13);
    worst = PetscMin(worst, c.r.quality);
  }
  assert_true(worst > 0.04);
  for (PetscInt i = 0; i < c.l->nnode_all; i++)
    if (c.l->x_start[2 * i + 1] == 0) assert_true(c.l->x[2 * i] == c.l->x_start[2 * i] && c.l->x[2 * i + 1] == 0);
  close_case(&c);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_circles),      cmocka_unit_test(test_ellipses),
                                     cmocka_unit_test(test_gaps),         cmocka_unit_test(test_corners),
                                     cmocka_unit_test(test_side),         cmocka_unit_test(test_plates),
                                     cmocka_unit_test(test_hinged_plates)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (OptFinalize() || ShapeFinalize() || PetscFinalize()) return 1;
  return failed;
}
