/* Laplacian: its energy is that of Q1 functions (linear ones exactly), open boundaries hold it, what is added and taken
   back leaves nothing, also where nodes have moved. */
/* ranks: 1 2 3 */
#include "core.h"
#include "pressure/laplacian.h"
#include "flow/flow.h"
#include "mesh/hang.h"

#define CORNER "-mesh_refine corner -mesh_box_corner_corners "

typedef struct {
  Mesh             mesh;
  Flow             flow;
  const MeshLocal *l;
  Laplacian        laplacian;
  PetscInt        *vertex;
  Mat              A;
  PetscReal       *mass; /* [nnode_all] volumes of the nodes */
} Case;

/* Volumes of the nodes of cell c, a box */
static void weigh_cell(const Case *c, PetscInt cell, PetscReal share[])
{
  const MeshLocal *l = c->l;
  PetscReal        xc[MESH_MAX_NB * 3], volume = 1;

  OK(MeshCellCoordinates(c->mesh, cell, xc));
  for (PetscInt a = 0; a < l->dim; a++) volume *= xc[(l->nb - 1) * l->dim + a] - xc[a];
  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscInt at[3] = {j % 3, (j / 3) % 3, j / 9};

    share[j] = volume;
    for (PetscInt a = 0; a < l->dim; a++) share[j] *= at[a] == 1 ? 4.0 / 6 : 1.0 / 6;
  }
  if (MeshCellHang(l, cell)) MeshHangScatter(MeshCellHang(l, cell), 1, share);
}

static void weigh_nodes(Case *c)
{
  const MeshLocal *l = c->l;

  OK(PetscCalloc1(l->nnode_all, &c->mass));
  for (PetscInt cell = 0; cell < l->ncell_all; cell++) {
    PetscReal share[MESH_MAX_NB];

    weigh_cell(c, cell, share);
    for (PetscInt j = 0; j < l->nb; j++) c->mass[l->cell_node[cell * l->nb + j]] += share[j];
  }
  OK(MeshSyncNodes(c->mesh, 1, c->mass));
}

static void open_case(Case *c, const char options[])
{
  PetscInt nown;

  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(LaplacianCreate(c->mesh, &c->laplacian));
  OK(PetscMalloc1(c->l->nnode_all, &c->vertex));
  OK(MeshNumberVertices(c->mesh, c->vertex, &nown));
  OK(MatCreateAIJ(PETSC_COMM_WORLD, nown, nown, PETSC_DETERMINE, PETSC_DETERMINE, 54, NULL, 54, NULL, &c->A));
  weigh_nodes(c);
}

static void close_case(Case *c)
{
  OK(PetscFree(c->mass));
  OK(MatDestroy(&c->A));
  OK(PetscFree(c->vertex));
  OK(LaplacianDestroy(&c->laplacian));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

/* Inverse masses grow by `by` / volume, on the boundary of the domain by `wall` / volume */
static void add_all(Case *c, PetscReal by, PetscReal wall)
{
  const MeshLocal        *l = c->l;
  const PetscReal *const *b;

  OK(FlowGetCellDivergence(c->flow, &b));
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal change[3];
    PetscBool side = PETSC_FALSE;

    for (PetscInt a = 0; a < l->dim; a++)
      side = (PetscBool)(side || l->x_start[i * l->dim + a] < l->lower[a] + 1e-9 ||
                         l->x_start[i * l->dim + a] > l->upper[a] - 1e-9);
    for (PetscInt a = 0; a < l->dim; a++) change[a] = (side ? wall : by) / c->mass[i];
    OK(LaplacianAddNode(c->laplacian, b, l->dim + 1, i, change));
  }
  OK(LaplacianFlush(c->laplacian, c->vertex, c->A));
  OK(MatAssemblyBegin(c->A, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(c->A, MAT_FINAL_ASSEMBLY));
}

/* v^T A v for the function with value s[0] + s[1 + a] x_a at the vertices */
static PetscReal energy(const Case *c, const PetscReal s[])
{
  const MeshLocal *l = c->l;
  PetscReal        e;
  Vec              v, Av;

  OK(MatCreateVecs(c->A, &v, &Av));
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal value = s[0];

    for (PetscInt a = 0; a < l->dim; a++) value += s[1 + a] * l->x[i * l->dim + a];
    if (c->vertex[i] >= 0) OK(VecSetValue(v, c->vertex[i], value, INSERT_VALUES));
  }
  OK(VecAssemblyBegin(v));
  OK(VecAssemblyEnd(v));
  OK(MatMult(c->A, v, Av));
  OK(VecDot(v, Av, &e));
  OK(VecDestroy(&v));
  OK(VecDestroy(&Av));
  return e;
}

/* A coefficient of 1/rho: a linear function of slope s has the energy s.s volume / rho, also where cells are not cubes;
   walls have no part */
static void check_linear(const char options[], PetscReal volume)
{
  const PetscReal constant[4] = {1, 0, 0, 0}, sloped[4] = {0.7, 1, -2, 0.5};
  Case            c;
  PetscReal       s2 = 0;

  open_case(&c, options);
  add_all(&c, 1 / 1.3, 0);
  for (PetscInt a = 0; a < c.l->dim; a++) s2 += PetscSqr(sloped[1 + a]);
  BELOW(PetscAbsReal(energy(&c, constant)), 1e-12);
  BELOW(PetscAbsReal(energy(&c, sloped) - s2 * volume / 1.3), 1e-11 * s2 * volume);
  close_case(&c);
}

static void test_linear_functions(void **state)
{
  (void)state;
  check_linear("-mesh_cells 6,5", 1);
  check_linear("-mesh_cells 3,5 -mesh_upper 4,1", 4);
  check_linear("-mesh_cells 3,4,5 -mesh_upper 1,2,0.5", 1);
  check_linear("-mesh_cells 4,4 -mesh_levels 2 " CORNER "0,0,0.3,0.4", 1); /* vertices that hang are means of others */
  check_linear("-mesh_cells 3,2,3 -mesh_levels 2 " CORNER "0,0,0,0.3,0.4,0.2", 1);
}

/* Slots on an open side hold a constant: (int phi n)^2 / mass of every node of the side, 36 / (6 h) for a unit side */
static void test_open_side(void **state)
{
  (void)state;
  const PetscReal constant[4] = {1, 0, 0, 0};
  Case            c;

  open_case(&c, "-mesh_cells 4,4,4");
  add_all(&c, 1, 1);
  /* for each side, which alone has the flux along its axis: the sum over its nodes of A_i^2 / (A_i h / 6) = 6 / h */
  BELOW(PetscAbsReal(energy(&c, constant) - 6 * 6 * 4), 1e-9);
  close_case(&c);
}

/* Taken back where nodes have moved meanwhile and come again, nothing is left */
static void test_moved_nodes(void **state)
{
  (void)state;
  const PetscReal sloped[4] = {0.7, 1, -2, 0.5};
  PetscInt       *node, n = 0;
  PetscReal      *x, before, moved;
  Case            c;

  open_case(&c, "-mesh_cells 5,6");
  add_all(&c, 1, 0);
  before = energy(&c, sloped);
  add_all(&c, -1, 0);
  BELOW(PetscAbsReal(energy(&c, sloped)), 1e-12 * before);
  OK(PetscMalloc2(c.l->nnode_all, &node, c.l->nnode_all * 2, &x));
  for (PetscInt i = 0; i < c.l->nnode_all; i++) {
    const PetscReal *at = c.l->x + 2 * i, bump = 0.05 * PetscSinReal(PETSC_PI * at[0]) * PetscSinReal(PETSC_PI * at[1]);

    node[n]      = i;
    x[2 * n]     = at[0] + bump;
    x[2 * n + 1] = at[1] - bump;
    n++;
  }
  OK(MeshMoveNodes(c.mesh, n, node, x));
  add_all(&c, 1, 0);
  moved = energy(&c, sloped);
  BELOW(PetscAbsReal(moved - before), 0.05 * before); /* the masses are those of the box */
  assert_true(PetscAbsReal(moved - before) > 1e-9 * before);
  add_all(&c, -1, 0);
  BELOW(PetscAbsReal(energy(&c, sloped)), 1e-12 * before);
  OK(PetscFree2(node, x));
  close_case(&c);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_linear_functions), cmocka_unit_test(test_open_side),
                                     cmocka_unit_test(test_moved_nodes)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("laplacian", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
