/* Remap: fields where nodes will be: in a cell, beside the cells that a body has left, on the side that may answer, far
   from all; any ranks. */
/* ranks: 3 */
#include "core.h"
#include "mesh/remap.h"

typedef struct {
  Mesh             mesh;
  Remap            remap;
  const MeshLocal *l;
  PetscInt        *inactive, *side; /* [ncell_all] */
  PetscReal       *v;               /* [nnode_all][dim] */
} Case;

/* A different quadratic for every component */
static PetscReal quadratic(PetscInt dim, PetscInt a, const PetscReal x[])
{
  const PetscReal z = dim == 3 ? x[2] : 0;

  return 1 + a + x[0] - 2 * (1 + a) * x[1] + 3 * z + x[0] * x[0] + (2 - a) * x[0] * x[1] - x[1] * x[1] + x[1] * z -
         (1 + a) * z * z;
}

/* Six cells along every axis of the unit box, those in the middle inactive: |x - 1/2| < 1/6 along all axes */
static void open_case(Case *c, PetscInt dim)
{
  give(dim == 2 ? "-mesh_cells 6,6" : "-mesh_cells 6,6,6");
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(RemapCreate(c->mesh, &c->remap));
  OK(PetscCalloc3(c->l->ncell_all, &c->inactive, c->l->ncell_all, &c->side, c->l->nnode_all * dim, &c->v));
  for (PetscInt e = 0; e < c->l->ncell_all; e++) {
    const PetscReal *x = c->l->x + c->l->cell_node[e * c->l->nb + c->l->nb / 2] * dim;

    c->inactive[e] = 0;
    for (PetscInt a = 0; a < dim; a++)
      if (PetscAbsReal(x[a] - 0.5) > 1. / 6) c->inactive[e] = -1;
    c->side[e] = x[0] < 0.5 ? -1 : 1;
  }
  for (PetscInt i = 0; i < c->l->nnode_all * dim; i++) c->v[i] = quadratic(dim, i % dim, c->l->x + i / dim * dim);
}

static void close_case(Case *c)
{
  OK(PetscFree3(c->inactive, c->side, c->v));
  OK(RemapDestroy(&c->remap));
  OK(MeshDestroy(&c->mesh));
}

/* out [dim] at a place, as all ranks ask for it */
static RemapCount ask(Case *c, const PetscReal x[], PetscInt side, PetscReal out[])
{
  const PetscReal *field[1] = {c->v}, size = 1. / 6;
  RemapCount       count;

  OK(RemapEvaluateAt(c->remap, 1, x, &size, &side, (RemapCells){c->inactive, c->side}, 1, field, out, &count));
  return count;
}

static PetscInt ranks(void)
{
  PetscMPIInt size;

  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  return size;
}

/* A quadratic is what it is in every cell of the fluid */
static void test_inside(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    Case c;

    open_case(&c, dim);
    for (PetscInt k = 0; k < 10; k++) {
      PetscReal  x[3], out[3];
      RemapCount count;

      for (PetscInt a = 0; a < dim; a++) x[a] = 0.16 + 0.16 * noise(10 * k + a); /* in the lower corner */
      count = ask(&c, x, 0, out);
      assert_int_equal(count.inside, ranks());
      for (PetscInt a = 0; a < dim; a++) NEAR(out[a], quadratic(dim, a, x), 1e-12);
    }
    close_case(&c);
  }
}

/* Where the body was, the polynomial of the cell beside it goes on: a quadratic is exact there, too, up to 0.4 cells
   in */
static void test_uncovered(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    Case c;

    open_case(&c, dim);
    for (PetscInt k = 0; k < 8; k++) {
      PetscReal  x[3], out[3];
      RemapCount count;

      for (PetscInt a = 0; a < dim; a++) x[a] = 0.5 + 0.1 * noise(10 * k + a);
      x[k % dim] = 0.5 + (k / dim % 2 ? 1 : -1) * (1 - 0.35 * (1 + k % 3) / 3) / 6;
      count      = ask(&c, x, 0, out);
      assert_int_equal(count.extended, ranks());
      for (PetscInt a = 0; a < dim; a++) NEAR(out[a], quadratic(dim, a, x), 1e-11);
    }
    close_case(&c);
  }
}

/* A place of one side hears nothing from cells of the other, however near they are */
static void test_sides(void **state)
{
  Case       c;
  PetscReal  x[2] = {0.45, 0.2}, out[2];
  RemapCount count;

  (void)state;
  open_case(&c, 2);
  for (PetscInt i = 0; i < c.l->nnode_all; i++) /* the upper half goes at 7, but for the nodes that both halves have */
    if (c.l->x[2 * i] > 0.5 + 1e-9) c.v[2 * i] = c.v[2 * i + 1] = 7;
  count = ask(&c, x, -1, out);
  assert_int_equal(count.inside, ranks());
  for (PetscInt a = 0; a < 2; a++) NEAR(out[a], quadratic(2, a, x), 1e-12);
  count = ask(&c, x, 1, out); /* in a cell of side -1: from the other side, 0.3 cells beyond */
  assert_int_equal(count.extended, ranks());
  assert_true(PetscAbsReal(out[0] - quadratic(2, 0, x)) > 1);
  close_case(&c);
}

/* Far from all cells that may answer the value stays, and that is counted */
static void test_kept(void **state)
{
  Case       c;
  PetscReal  x[2] = {0.5, 0.5}, out[2] = {11, 12};
  RemapCount count;

  (void)state;
  open_case(&c, 2);
  for (PetscInt e = 0; e < c.l->ncell_all; e++) c.inactive[e] = 0;
  count = ask(&c, x, 0, out);
  assert_int_equal(count.kept, ranks());
  NEAR(out[0], 11, 0);
  NEAR(out[1], 12, 0);
  close_case(&c);
}

/* The nodes of a mesh that moves by a third of a cell, of a periodic one across its ends */
static void test_nodes(void **state)
{
  Case             c;
  PetscInt        *node, *side;
  PetscReal       *x, *out;
  const PetscReal *field[1];
  RemapCount       count;

  (void)state;
  give("-mesh_cells 6,6 -mesh_periodic x,y");
  OK(MeshCreate(PETSC_COMM_WORLD, &c.mesh));
  OK(MeshGetLocal(c.mesh, &c.l));
  OK(RemapCreate(c.mesh, &c.remap));
  OK(PetscCalloc3(c.l->ncell_all, &c.inactive, c.l->ncell_all, &c.side, c.l->nnode_all * 2, &c.v));
  OK(PetscMalloc4(c.l->nnode, &node, c.l->nnode, &side, c.l->nnode * 2, &x, c.l->nnode * 2, &out));
  for (PetscInt e = 0; e < c.l->ncell_all; e++) c.inactive[e] = -1;
  for (PetscInt i = 0; i < c.l->nnode_all * 2; i++) c.v[i] = PetscSinReal(2 * PETSC_PI * c.l->x[i]);
  for (PetscInt i = 0; i < c.l->nnode; i++) {
    node[i] = i;
    side[i] = 0;
    for (PetscInt a = 0; a < 2; a++) x[2 * i + a] = c.l->x[2 * i + a] + (a ? -1 : 1) / 18.;
  }
  field[0] = c.v;
  OK(RemapEvaluate(c.remap, c.l->nnode, node, x, side, (RemapCells){c.inactive, c.side}, 1, field, out, &count));
  assert_int_equal(count.inside, c.l->nnode_global);
  for (PetscInt i = 0; i < c.l->nnode * 2; i++) NEAR(out[i], PetscSinReal(2 * PETSC_PI * x[i]), 0.01);
  for (PetscInt i = 0; i < c.l->nnode; i++) NEAR(RemapCellSize(c.remap, i), 1. / 6, 1e-12);
  OK(PetscFree4(node, side, x, out));
  close_case(&c);
}

/* A displacement along the sides of the unit box, but for the two across the first axis, which it enters and leaves */
static PetscReal displacement(PetscInt dim, PetscInt a, const PetscReal x[])
{
  return (a ? 0 : 0.05) + (0.1 - 0.04 * a) * x[a] * (1 - x[a]) * (1 + x[(a + 1) % dim]);
}

/* Feet of it, of which nodes take a half or nothing: exact for a quadratic; what comes from beyond the box has the
   values of its side */
static void test_feet(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    const PetscReal *field[1];
    Case             c;
    PetscInt        *node;
    PetscReal       *x, *part, *way, *out;

    open_case(&c, dim);
    OK(PetscMalloc5(c.l->nnode, &node, c.l->nnode * dim, &x, c.l->nnode, &part, c.l->nnode_all * dim, &way,
                    2 * c.l->nnode * dim, &out));
    for (PetscInt i = 0; i < c.l->nnode_all * dim; i++) way[i] = displacement(dim, i % dim, c.l->x + i / dim * dim);
    for (PetscInt i = 0; i < c.l->nnode; i++) {
      node[i] = i;
      part[i] = i % 2 ? 0.5 : 0;
    }
    OK(PetscArraycpy(x, c.l->x, c.l->nnode * dim));
    field[0] = c.v;
    OK(RemapEvaluateFeet(c.remap, c.l->nnode, node, x, way, part, 1, field, out));
    for (PetscInt i = 0; i < c.l->nnode; i++) {
      PetscReal y[3];

      for (PetscInt a = 0; a < dim; a++) y[a] = x[dim * i + a] - out[2 * dim * i + a];
      for (PetscInt a = 0; a < dim; a++) {
        if (y[0] > 1e-9 || part[i] == 0) NEAR(out[2 * dim * i + a], part[i] * displacement(dim, a, y), 1e-12);
        NEAR(out[2 * dim * i + dim + a], quadratic(dim, a, y), 1e-11);
      }
      assert_true(y[0] > -1e-12 && (y[0] > 1e-9 || x[dim * i] < 0.05));
    }
    OK(PetscFree5(node, x, part, way, out));
    close_case(&c);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_inside), cmocka_unit_test(test_uncovered),
                                     cmocka_unit_test(test_sides),  cmocka_unit_test(test_kept),
                                     cmocka_unit_test(test_nodes),  cmocka_unit_test(test_feet)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("remap", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
