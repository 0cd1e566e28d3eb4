/* Viscosity that varies: its derivative against differences, rigid motions against zero, the matrix of all components
   against residuals, in 2D and 3D. */
/* ranks: 1 2 3 */
#include "core.h"
#include "flow/flow.h"
#include "laws.h"

typedef struct {
  Mesh             mesh;
  Flow             flow;
  const MeshLocal *l;
  PetscReal       *u, *v, *w, *p;
} Case;

static void open_case(Case *c, PetscInt dim, const char law[])
{
  const PetscInt n[3] = {3, 2, 2};
  char           options[512];

  OK(PetscSNPrintf(options, sizeof(options), "-flow_density 1.3 -flow_viscosity 0.1 -flow_convection false %s", law));
  give(options);
  create_skewed_mesh(dim, n, &c->mesh);
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(FlowBeginSteady(c->flow, 0));
  const PetscInt size = c->l->nnode_all * dim;

  OK(PetscCalloc4(size, &c->u, size, &c->v, size, &c->w, c->l->ncell_all * (dim + 1), &c->p));
}

static void close_case(Case *c)
{
  OK(PetscFree4(c->u, c->v, c->w, c->p));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

/* Smooth, and different at every node of all ranks alike */
static void fill(const Case *c, PetscReal phase, PetscReal u[])
{
  for (PetscInt i = 0; i < c->l->nnode_all * c->l->dim; i++) {
    const PetscReal *x = c->l->x + i / c->l->dim * c->l->dim;

    u[i] = PetscSinReal(3 * x[0] + 2 * x[1] + (c->l->dim == 3 ? x[2] : 0) + phase * (1 + i % c->l->dim));
  }
}

static void set_strain(Case *c, const PetscReal u[])
{
  OK(FlowSetRheologyVelocity(c->flow, u));
  OK(FlowGetViscosity(c->flow, NULL, NULL));
}

/* The derivative of the residual at u along v is the residual of v with the viscosity of u, and what the matrix of
   Newton's method has that is not in that of the viscosity of u: against central differences */
static void check_derivative(Case *c)
{
  const MeshLocal *l    = c->l;
  const PetscInt   rows = l->nb * l->dim;
  const PetscReal  e    = 1e-4;
  PetscReal       *change, *with, *without, size = 0, error = 0;

  fill(c, 1, c->u);
  fill(c, 2, c->v);
  OK(PetscCalloc3(l->ncell * rows, &change, rows * rows, &with, rows * rows, &without));
  for (PetscInt sign = -1; sign <= 1; sign += 2) {
    for (PetscInt i = 0; i < l->nnode_all * l->dim; i++) c->w[i] = c->u[i] + sign * e * c->v[i];
    set_strain(c, c->w);
    for (PetscInt cell = 0; cell < l->ncell; cell++) {
      PetscReal r[81];

      OK(FlowCellResidual(c->flow, cell, c->w, c->p, r));
      for (PetscInt i = 0; i < rows; i++) change[cell * rows + i] += sign * r[i] / (2 * e);
    }
  }
  set_strain(c, c->u);
  for (PetscInt cell = 0; cell < l->ncell; cell++) {
    PetscReal r[81];

    OK(FlowCellResidual(c->flow, cell, c->v, c->p, r));
    OK(FlowCellNewton(c->flow, cell, c->u, with));
    OK(FlowCellNewton(c->flow, cell, NULL, without));
    for (PetscInt i = 0; i < rows; i++) {
      for (PetscInt j = 0; j < rows; j++)
        r[i] += (with[i * rows + j] - without[i * rows + j]) *
                c->v[l->cell_node[cell * l->nb + j / l->dim] * l->dim + j % l->dim];
      error = PetscMax(error, PetscAbsReal(r[i] - change[cell * rows + i]));
      size  = PetscMax(size, PetscAbsReal(change[cell * rows + i]));
    }
  }
  OK(PetscFree3(change, with, without));
  BELOW(error, 1e-6 * size);
}

/* A rigid motion has no stress, whatever the viscosity */
static void check_rigid(Case *c)
{
  const MeshLocal *l = c->l;

  fill(c, 1, c->u);
  set_strain(c, c->u);
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    for (PetscInt a = 0; a < l->dim; a++) c->v[i * l->dim + a] = 0.3 * a;
    c->v[i * l->dim] -= l->x[i * l->dim + 1];
    c->v[i * l->dim + 1] += l->x[i * l->dim];
  }
  for (PetscInt cell = 0; cell < l->ncell; cell++) {
    PetscReal r[81];

    OK(FlowCellResidual(c->flow, cell, c->v, c->p, r));
    for (PetscInt i = 0; i < l->nb * l->dim; i++) BELOW(PetscAbsReal(r[i]), 1e-12);
  }
}

/* The assembled matrix times v is the sum of the cells' residuals */
static void check_matrix(Case *c)
{
  const MeshLocal *l   = c->l;
  const PetscInt   own = l->nnode * l->dim;
  PetscReal       *sum, error = 0, size = 0;
  const PetscReal *y;
  Mat              A;
  Vec              in, out;

  fill(c, 1, c->u);
  fill(c, 2, c->v);
  OK(FlowSetRheologyVelocity(c->flow, c->u));
  OK(FlowAssemble(c->flow));
  OK(FlowGetComponents(c->flow, &A));
  assert_non_null(A);
  OK(PetscCalloc1(l->nnode_all * l->dim, &sum));
  for (PetscInt cell = 0; cell < l->ncell; cell++) {
    PetscReal r[81];

    OK(FlowCellResidual(c->flow, cell, c->v, c->p, r));
    for (PetscInt i = 0; i < l->nb * l->dim; i++)
      sum[l->cell_node[cell * l->nb + i / l->dim] * l->dim + i % l->dim] += r[i];
  }
  OK(MeshSumNodes(c->mesh, l->dim, sum));
  OK(MatCreateVecs(A, &out, &in));
  OK(VecPlaceArray(out, c->v));
  OK(MatMult(A, out, in));
  OK(VecResetArray(out));
  OK(VecGetArrayRead(in, &y));
  for (PetscInt i = 0; i < own; i++) {
    error = PetscMax(error, PetscAbsReal(y[i] - sum[i]));
    size  = PetscMax(size, PetscAbsReal(sum[i]));
  }
  OK(VecRestoreArrayRead(in, &y));
  BELOW(error, 1e-12 * size);
  OK(VecDestroy(&in));
  OK(VecDestroy(&out));
  OK(PetscFree(sum));
}

static void for_all(void (*check)(Case *))
{
  for (PetscInt dim = 2; dim <= 3; dim++)
    for (size_t i = 0; i < (size_t)NLAWS; i++) {
      Case c;

      open_case(&c, dim, LAWS[i]);
      check(&c);
      close_case(&c);
    }
}

static void test_derivative(void **state)
{
  (void)state;
  for_all(check_derivative);
}

static void test_rigid(void **state)
{
  (void)state;
  for_all(check_rigid);
}

static void test_matrix(void **state)
{
  (void)state;
  for_all(check_matrix);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_derivative), cmocka_unit_test(test_rigid),
                                     cmocka_unit_test(test_matrix)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("rheology", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
