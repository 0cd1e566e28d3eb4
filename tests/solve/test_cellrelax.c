/* CellRelax: a single relaxed cell meets its own equations whatever the ranks around it hold; where cells overlap, each
   node takes the mean of their corrections; inert slots and other cells stay as they are; which cells are chosen;
   gathered rows serve as the matrix does. */
/* ranks: 1 2 3 */
#include "core.h"
#include "cellrelax.h"

typedef struct {
  Mesh                 mesh;
  Flow                 flow;
  Constraint           constraint;
  Pressure             pressure;
  CellRelax            relax;
  const MeshLocal     *l;
  const unsigned char *fixed;
  const PetscInt      *body;
  PetscInt             nu, np;
  PetscReal            scale, *e, *r, *u, *p; /* residuals (ghosts agree), corrections */
} Case;

/* The first step of a flow with one body of the given nodes, which stands still; residuals are noise */
static void open_case(Case *c, const char options[], PetscBool (*inside)(const PetscReal x[], void *ctx), void *ctx)
{
  PetscReal             X[1][3] = {{0.5, 0.5, 0.5}}, U[6] = {0}, *weight, none[36] = {0};
  PetscInt             *node, unknown = 0;
  const FlowStep       *step;
  const PetscReal      *m;
  PetscInt              dim;
  const FlowParameters *par;

  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(FlowBeginStep(c->flow, 0.05, 0.05));
  OK(ConditionsGetValues(FlowConditions(c->flow), &c->fixed, &m));
  OK(ConstraintCreate(c->mesh, 1, &c->constraint));
  OK(ConstraintSetBoundary(c->constraint, c->fixed, m));
  dim = c->l->dim;
  OK(PetscMalloc2(c->l->nnode_all, &node, c->l->nnode_all * dim, &weight));
  for (PetscInt i = 0; i < c->l->nnode_all; i++) node[i] = inside(c->l->x + i * dim, ctx) ? 0 : -1;
  OK(ConstraintSetBodies(c->constraint, node, X, &unknown, U, NULL));
  OK(ConstraintGetNodeBody(c->constraint, &c->body));
  OK(FlowAssemble(c->flow));
  OK(FlowGetLumpedMass(c->flow, &m));
  OK(PressureSetDefaults());
  OK(PressureCreate(c->flow, c->constraint, &c->pressure));
  for (PetscInt i = 0; i < c->l->nnode_all * dim; i++) {
    const PetscBool held = (PetscBool)((c->fixed[i / dim] >> i % dim) & 1);

    weight[i] = (c->body[i / dim] >= 0 ? PressureGetRegularisation(c->pressure, 0) : !held) / m[i / dim];
  }
  OK(PressureUpdate(c->pressure, weight, NULL, none));
  OK(PetscFree2(node, weight));
  OK(FlowGetStep(c->flow, &step));
  OK(FlowGetParameters(c->flow, &par));
  c->scale = par->density * step->ct;
  OK(CellRelaxCreate(c->flow, c->constraint, &c->relax));
  OK(CellRelaxUpdate(c->relax, NULL, c->pressure, NULL, c->scale));
  c->nu = c->l->nnode_all * dim;
  c->np = c->l->ncell * (dim + 1);
  OK(PetscCalloc4(c->nu, &c->e, c->np, &c->r, c->nu, &c->u, c->np, &c->p));
  fill_noise(c->l, 3, c->e);
  fill_noise_pressure(c->l, 4, c->r);
  for (PetscInt i = 0; i < c->nu; i++)
    if (c->body[i / dim] >= 0 || (c->fixed[i / dim] >> i % dim) & 1) c->e[i] = 0;
}

static void close_case(Case *c)
{
  OK(PetscFree4(c->e, c->r, c->u, c->p));
  OK(CellRelaxDestroy(&c->relax));
  OK(PressureDestroy(&c->pressure));
  OK(ConstraintDestroy(&c->constraint));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

static PetscInt count(PetscInt n)
{
  return (PetscInt)(total((PetscReal)n) + 0.5);
}

/* y = S u - B^T p on own nodes */
static void momentum(const Case *c, PetscReal y[])
{
  const PetscInt   dim = c->l->dim;
  Mat              S;
  Vec              a, b;
  PetscReal       *w;
  const PetscReal *v;

  OK(FlowGetMatrix(c->flow, &S));
  OK(MatCreateVecs(S, &a, &b));
  OK(FlowGradient(c->flow, -1, c->p, y));
  for (PetscInt d = 0; d < dim; d++) {
    OK(VecGetArrayWrite(a, &w));
    for (PetscInt i = 0; i < c->l->nnode; i++) w[i] = c->u[i * dim + d];
    OK(VecRestoreArrayWrite(a, &w));
    OK(MatMult(S, a, b));
    OK(VecGetArrayRead(b, &v));
    for (PetscInt i = 0; i < c->l->nnode; i++) y[i * dim + d] += v[i];
    OK(VecRestoreArrayRead(b, &v));
  }
  OK(VecDestroy(&a));
  OK(VecDestroy(&b));
}

static PetscBool at_point(const PetscReal x[], void *point)
{
  const PetscReal *X = (const PetscReal *)point;

  return (PetscBool)(PetscAbsReal(x[0] - X[0]) + PetscAbsReal(x[1] - X[1]) < 1e-6);
}

/* No compressibility of cells between wall and body */
#define RIGID "-flow_pressure_gap_compressibility 0"

/* A body that holds the centre node of one cell: afterwards all rows of this cell hold, and nothing else has moved */
static void check_cell(PetscReal X[], const char options[])
{
  Case       c;
  PetscReal *y, *d, worst = 0, away = 0;
  PetscInt   n;

  open_case(&c, options, at_point, X);
  OK(CellRelaxGetCount(c.relax, &n));
  assert_int_equal(n, 1);
  OK(CellRelaxApply(c.relax, c.e, c.r, c.u, c.p));
  OK(MeshSyncNodes(c.mesh, c.l->dim, c.u));
  OK(PetscCalloc2(c.nu, &y, c.np, &d));
  momentum(&c, y);
  OK(FlowDivergence(c.flow, c.u, d));
  for (PetscInt i = 0; i < c.l->nnode; i++) {
    const PetscBool near = (PetscBool)(PetscAbsReal(c.l->x[2 * i] - X[0]) < 0.126 &&
                                       PetscAbsReal(c.l->x[2 * i + 1] - X[1]) < 0.126);

    for (PetscInt a = 0; a < 2; a++) {
      const PetscBool free = (PetscBool)(near && c.body[i] < 0 && !((c.fixed[i] >> a) & 1));

      if (free) worst = PetscMax(worst, PetscAbsReal(y[2 * i + a] - c.e[2 * i + a]));
      else away = PetscMax(away, PetscAbsReal(c.u[2 * i + a]));
    }
  }
  for (PetscInt cell = 0; cell < c.l->ncell; cell++) {
    const PetscInt centre = c.l->cell_node[cell * c.l->nb + c.l->nb / 2];

    for (PetscInt k = 0; k < 3; k++) {
      if (c.body[centre] >= 0) worst = PetscMax(worst, PetscAbsReal(c.scale * d[3 * cell + k] - c.r[3 * cell + k]));
      else away = PetscMax(away, PetscAbsReal(c.p[3 * cell + k]));
    }
  }
  BELOW(largest(worst), 1e-4);
  BELOW(largest(away), 0);
  OK(PetscFree2(y, d));
  close_case(&c);
}

static void test_one_cell(void **state)
{
  (void)state;
  for (PetscInt i = 0; i < 4; i++) {
    PetscReal X[3] = {0.375, 0.125 + 0.25 * i, 0};

    check_cell(X, "-mesh_cells 4,4 -flow_density 1.3 -flow_viscosity 0.02 " RIGID);
    X[0] = 0.625;
    check_cell(X, "-mesh_cells 4,4 -flow_density 1.3 -flow_viscosity 2 -flow_bc_right_type outflow " RIGID);
  }
}

static PetscBool in_ball(const PetscReal x[], void *ctx)
{
  const PetscInt dim = *(PetscInt *)ctx;
  PetscReal      r2  = 0;

  for (PetscInt a = 0; a < dim; a++) r2 += PetscSqr(x[a] - 0.51);
  return (PetscBool)(r2 < PetscSqr(0.26));
}

/* Cells with nodes inside and outside are relaxed, also beside a wall that lets the fluid slip; inert slots stay
   zero */
static void check_ball(PetscInt dim, const char options[])
{
  Case      c;
  PetscInt  n, cut = 0;
  PetscReal size = 0;

  open_case(&c, options, in_ball, &dim);
  for (PetscInt cell = 0; cell < c.l->ncell; cell++) {
    PetscInt in = 0;

    for (PetscInt j = 0; j < c.l->nb; j++) in += c.body[c.l->cell_node[cell * c.l->nb + j]] >= 0;
    cut += in > 0 && in < c.l->nb;
  }
  OK(CellRelaxGetCount(c.relax, &n));
  assert_int_equal(n, count(cut));
  OK(CellRelaxApply(c.relax, c.e, c.r, c.u, c.p));
  for (PetscInt i = 0; i < c.l->nnode * dim; i++) {
    if (c.e[i] == 0) BELOW(c.u[i], 0);
    size = PetscMax(size, PetscAbsReal(c.u[i]));
  }
  assert_true(largest(size) > 1e-6 && largest(size) < 1e6);
  close_case(&c);
}

static void test_balls(void **state)
{
  (void)state;
  check_ball(2, "-mesh_cells 8,8 -flow_viscosity 0.02");
  check_ball(2, "-mesh_cells 8,8 -flow_viscosity 0.02 -flow_bc_right_type slip -mesh_upper 0.75,1");
  check_ball(3, "-mesh_dimension 3 -mesh_cells 5,5,5 -flow_viscosity 0.02");
}

/* With rows that are gathered around the cells, corrections are those with the matrix */
static void check_gathered(PetscInt dim, const char options[])
{
  Case       c;
  PetscReal *u, *p, size[2];
  PetscBool *marked;
  PetscInt   n;
  Rows       rows;

  open_case(&c, options, in_ball, &dim);
  OK(CellRelaxGetCount(c.relax, &n));
  assert_true(n > 0);
  OK(CellRelaxApply(c.relax, c.e, c.r, c.u, c.p));
  OK(PetscCalloc3(c.l->nnode_all, &marked, c.nu, &u, c.np, &p));
  OK(CellRelaxMarkNodes(c.l, c.constraint, c.pressure, NULL, marked));
  OK(FlowGatherRows(c.flow, marked, &rows));
  OK(CellRelaxUpdate(c.relax, &rows, c.pressure, NULL, c.scale));
  OK(CellRelaxApply(c.relax, c.e, c.r, u, p));
  size[0] = max_abs(c.l->nnode * dim, c.u);
  size[1] = max_abs(c.np, c.p);
  for (PetscInt i = 0; i < c.l->nnode * dim; i++) NEAR(u[i], c.u[i], 1e-8 * size[0]);
  for (PetscInt i = 0; i < c.np; i++) NEAR(p[i], c.p[i], 1e-8 * size[1]);
  OK(PetscFree3(marked, u, p));
  close_case(&c);
}

static void test_gathered(void **state)
{
  (void)state;
  check_gathered(2, "-mesh_cells 8,8 -flow_viscosity 0.02");
  check_gathered(3, "-mesh_dimension 3 -mesh_cells 5,5,5 -flow_viscosity 0.02");
  check_gathered(3,
                 "-mesh_dimension 3 -mesh_cells 3,3,3 -flow_viscosity 0.02 -mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.5,0.5,0.5");
}

/* Twice the residual gives twice the correction; none without cells */
static void test_linear(void **state)
{
  (void)state;
  PetscReal  X[2] = {5, 5};
  PetscInt   dim  = 2, n;
  PetscReal *u, *p, size;
  Case       c;

  open_case(&c, "-mesh_cells 6,6 -flow_viscosity 0.1", in_ball, &dim);
  OK(PetscCalloc2(c.nu, &u, c.np, &p));
  OK(CellRelaxApply(c.relax, c.e, c.r, c.u, c.p));
  for (PetscInt i = 0; i < c.nu; i++) c.e[i] *= 2;
  for (PetscInt i = 0; i < c.np; i++) c.r[i] *= 2;
  OK(CellRelaxApply(c.relax, c.e, c.r, u, p));
  size = max_abs(c.np, p);
  for (PetscInt i = 0; i < c.l->nnode * 2; i++) NEAR(u[i], 2 * c.u[i], 1e-10 * PetscAbsReal(u[i]));
  for (PetscInt i = 0; i < c.np; i++) NEAR(p[i], 2 * c.p[i], 1e-10 * size);
  OK(PetscFree2(u, p));
  close_case(&c);
  open_case(&c, "-mesh_cells 6,6 -flow_viscosity 0.1", at_point, X);
  OK(CellRelaxGetCount(c.relax, &n));
  assert_int_equal(n, 0);
  OK(CellRelaxApply(c.relax, c.e, c.r, c.u, c.p));
  BELOW(max_abs(c.nu, c.u), 0);
  BELOW(max_abs(c.np, c.p), 0);
  close_case(&c);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_one_cell), cmocka_unit_test(test_balls),
                                     cmocka_unit_test(test_gathered), cmocka_unit_test(test_linear)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("cellrelax", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
