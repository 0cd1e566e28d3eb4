/* Flow: B, S, convection, right-hand side, boundary values and time-step coefficients against exact integrals and
   against each other, on boxes and on meshes whose cells are no parallelograms, in 2D and 3D. */
/* ranks: 1 2 3 */
#include "core.h"
#include "flow/flow.h"
#include "raised.h"

typedef struct {
  Mesh             mesh;
  Flow             flow;
  const MeshLocal *l;
  PetscInt         dim, own; /* own: number of own nodal values */
  PetscBool        skewed;
  PetscInt         degree; /* of polynomials whose square the quadrature integrates exactly (det J of a skewed
                              hexahedron has degree 2 an axis) */
  PetscReal        length[3];
} Case;

/* The fluid domain is [0, 1.5] x [0, 1] (x [0, 1]) */
static void open_case(Case *c, PetscInt dim, PetscBool skewed, const char options[])
{
  const PetscInt n[3] = {dim == 2 ? 5 : 3, dim == 2 ? 4 : 3, 3};

  give(options);
  c->dim       = dim;
  c->skewed    = skewed;
  c->degree    = dim == 3 && skewed ? 1 : 2;
  c->length[0] = 1.5;
  c->length[1] = c->length[2] = 1;
  if (skewed) create_skewed_mesh(dim, n, &c->mesh);
  else {
    OK(PetscOptionsSetValue(NULL, "-mesh_dimension", dim == 2 ? "2" : "3"));
    OK(PetscOptionsSetValue(NULL, "-mesh_cells", dim == 2 ? "5,4" : "3,3,3"));
    OK(PetscOptionsSetValue(NULL, "-mesh_upper", dim == 2 ? "1.5,1" : "1.5,1,1"));
    OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  }
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  c->own = c->l->nnode * dim;
}

static void close_case(Case *c)
{
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

static void for_all(void (*check)(Case *), const char options[])
{
  for (PetscInt i = 0; i < 4; i++) {
    Case c;

    open_case(&c, 2 + i / 2, (PetscBool)(i % 2), options);
    check(&c);
    close_case(&c);
  }
}

static PetscReal *new_field(const Case *c)
{
  PetscReal *v;

  OK(PetscCalloc1(c->l->nnode_all * c->dim, &v));
  return v;
}

static PetscReal *new_pressure(const Case *c)
{
  PetscReal *p;

  OK(PetscCalloc1(c->l->ncell * (c->dim + 1), &p));
  return p;
}

/* ---- polynomials of degree 1 or 2 with coefficients from noise ---- */

static PetscReal polynomial(PetscInt seed, PetscInt degree, PetscInt dim, const PetscReal x[], PetscReal grad[])
{
  PetscReal v = noise(100 * seed);

  for (PetscInt d = 0; d < dim; d++) {
    grad[d] = noise(100 * seed + 1 + d);
    v += grad[d] * x[d];
  }
  for (PetscInt d = 0; d < dim && degree > 1; d++) {
    for (PetscInt e = 0; e < dim; e++) {
      const PetscReal h = noise(100 * seed + 10 + 3 * d + e);

      v += h * x[d] * x[e];
      grad[d] += h * x[e];
      grad[e] += h * x[d];
    }
  }
  return v;
}

static void fill_polynomial(const Case *c, PetscInt seed, PetscInt degree, PetscReal factor, PetscReal v[])
{
  PetscReal grad[3];

  for (PetscInt i = 0; i < c->l->nnode_all; i++)
    for (PetscInt a = 0; a < c->dim; a++)
      v[i * c->dim + a] = factor * polynomial(10 * seed + a, degree, c->dim, c->l->x + i * c->dim, grad);
}

/* Values and gradients of a vector of polynomials at a point */
static void eval(const Case *c, PetscInt seed, PetscInt degree, const PetscReal x[], PetscReal v[3],
                 PetscReal grad[3][3])
{
  for (PetscInt a = 0; a < c->dim; a++) v[a] = polynomial(10 * seed + a, degree, c->dim, x, grad[a]);
}

/* Integral over the box by a Gauss rule of its own (exact to degree 9 an axis) */
typedef PetscReal (*Integrand)(const Case *, const PetscReal x[]);
static PetscReal integrate(const Case *c, Integrand f)
{
  PetscQuadrature  quad;
  const PetscReal *x, *w;
  PetscInt         n;
  PetscReal        sum = 0;

  OK(PetscDTGaussTensorQuadrature(c->dim, 1, 5, 0, 1, &quad));
  OK(PetscQuadratureGetData(quad, NULL, NULL, &n, &x, &w));
  for (PetscInt q = 0; q < n; q++) {
    PetscReal y[3] = {0, 0, 0};

    for (PetscInt d = 0; d < c->dim; d++) y[d] = x[q * c->dim + d] * c->length[d];
    sum += w[q] * f(c, y);
  }
  OK(PetscQuadratureDestroy(&quad));
  return 1.5 * sum;
}

/* y = S u for every component, own nodes */
static void apply_matrix(const Case *c, const PetscReal u[], PetscReal y[])
{
  Mat              S;
  Vec              x, z;
  PetscReal       *xa;
  const PetscReal *za;

  OK(FlowGetMatrix(c->flow, &S));
  OK(MatCreateVecs(S, &x, &z));
  for (PetscInt a = 0; a < c->dim; a++) {
    OK(VecGetArrayWrite(x, &xa));
    for (PetscInt i = 0; i < c->l->nnode; i++) xa[i] = u[i * c->dim + a];
    OK(VecRestoreArrayWrite(x, &xa));
    OK(MatMult(S, x, z));
    OK(VecGetArrayRead(z, &za));
    for (PetscInt i = 0; i < c->l->nnode; i++) y[i * c->dim + a] = za[i];
    OK(VecRestoreArrayRead(z, &za));
  }
  OK(VecDestroy(&x));
  OK(VecDestroy(&z));
}

/* ---- products without a matrix ---- */

/* Product and diagonal are those of the assembled matrix, with a further term in the first cell and the last */
static void check_product(Case *c)
{
  const PetscInt nb = c->l->nb, cells[2] = {0, c->l->ncell_all - 1};
  PetscReal     *u = new_field(c), *p = new_pressure(c), *y = new_field(c), *z = new_field(c), *d = new_field(c), *term;
  Mat            S;
  Vec            diagonal;
  PetscReal      size;

  OK(PetscMalloc1(2 * nb * nb, &term));
  for (PetscInt e = 0; e < 2 * nb * nb; e++) term[e] = 0.1 * noise(e);
  fill_noise(c->l, 5, u);
  OK(MeshSyncNodes(c->mesh, c->dim, u));
  OK(FlowBeginStep(c->flow, 0.1, 0.1));
  OK(FlowAcceptStep(c->flow, u, p));
  if (c->l->ncell_global == c->l->ncell) OK(FlowAddCellTerms(c->flow, c, 2, cells, term)); /* ranks share cells */
  OK(FlowBeginStep(c->flow, 0.25, 0.15));
  OK(FlowAssemble(c->flow));
  fill_noise(c->l, 6, u);
  assert_true(FlowIsMatrixFree(c->flow));
  OK(FlowMultiply(c->flow, PETSC_FALSE, u, z));
  OK(FlowGetDiagonal(c->flow, d));
  apply_matrix(c, u, y);
  size = 0;
  for (PetscInt i = 0; i < c->own; i++) size = PetscMax(size, PetscAbsReal(y[i]));
  BELOW(max_difference(c->own, y, z), 1e-13 * size);
  OK(FlowGetMatrix(c->flow, &S));
  OK(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, c->l->nnode, PETSC_DETERMINE, z, &diagonal));
  OK(MatGetDiagonal(S, diagonal));
  OK(VecDestroy(&diagonal));
  BELOW(max_difference(c->l->nnode, d, z), 1e-13 * size);
  OK(FlowAddCellTerms(c->flow, c, 0, NULL, NULL));
  OK(PetscFree(term));
  OK(PetscFree(u));
  OK(PetscFree(p));
  OK(PetscFree(y));
  OK(PetscFree(z));
  OK(PetscFree(d));
}

static void test_product_without_matrix(void **state)
{
#define FREE "-flow_velocity_operator matrix_free -flow_density 3 -flow_viscosity 0.7 "
  Case c;

  (void)state;
  for_all(check_product, FREE);
  for_all(check_product, FREE "-flow_convection 0");
  for_all(check_product, FREE "-flow_convection_form skew");
  for (PetscInt dim = 2; dim <= 3; dim++) { /* with nodes that hang */
    open_case(&c, dim, PETSC_FALSE,
              dim == 2 ? FREE "-mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0.4,0.4"
                       : FREE "-mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.4,0.4,0.4");
    assert_non_null(c.l->hang);
    check_product(&c);
    close_case(&c);
  }
#undef FREE
}

/* ---- B ---- */

/* Translation, rotations, and quadratics without divergence */
static void solenoidal(PetscInt kind, PetscInt dim, const PetscReal x[], PetscReal v[])
{
  const PetscReal z    = dim == 3 ? x[2] : 0;
  PetscReal       t[3] = {1, -2, 3};

  if (kind == 1) t[0] = -x[1] + 2 * z, t[1] = x[0] - 3 * z, t[2] = 3 * x[1] - 2 * x[0];
  if (kind == 2) t[0] = x[0] * x[0] + x[1] * z, t[1] = -2 * x[0] * x[1] + z * z, t[2] = x[0] * x[1];
  if (kind == 3) t[0] = x[1] * x[1] + x[0] * x[1], t[1] = x[0] - 0.5 * x[1] * x[1], t[2] = x[0] * x[0] + x[1] * x[1];
  for (PetscInt d = 0; d < dim; d++) v[d] = t[d];
}

static void check_solenoidal(Case *c)
{
  PetscReal *u = new_field(c), *y = new_pressure(c);

  for (PetscInt kind = 0; kind < 4; kind++) {
    for (PetscInt i = 0; i < c->l->nnode_all; i++) solenoidal(kind, c->dim, c->l->x + i * c->dim, u + i * c->dim);
    OK(FlowDivergence(c->flow, u, y));
    BELOW(max_abs(c->l->ncell * (c->dim + 1), y), 1e-14);
  }
  OK(PetscFree(u));
  OK(PetscFree(y));
}

static void test_solenoidal_fields(void **state)
{
  (void)state;
  for_all(check_solenoidal, "");
}

/* div u = 1 for u = x: row 0 is the cell's volume, the others its first moments, and all volumes add up to the box */
static void check_volume(Case *c)
{
  const PetscInt   nk = c->dim + 1;
  PetscReal       *u = new_field(c), *y = new_pressure(c), sum = 0, top = 0, sum_lumped = 0;
  const PetscReal *m;

  for (PetscInt i = 0; i < c->l->nnode_all; i++) u[i * c->dim] = c->l->x[i * c->dim];
  OK(FlowDivergence(c->flow, u, y));
  for (PetscInt cell = 0; cell < c->l->ncell; cell++) {
    sum += y[cell * nk];
    for (PetscInt k = 1; k < nk && !c->skewed; k++) top = PetscMax(top, PetscAbsReal(y[cell * nk + k]));
    if (!c->skewed) NEAR(y[cell * nk], 1.5 / c->l->ncell_global, 1e-14);
  }
  NEAR(total(sum), 1.5, 1e-13);
  BELOW(largest(top), 1e-15);
  OK(FlowGetLumpedMass(c->flow, &m));
  for (PetscInt i = 0; i < c->l->nnode; i++) sum_lumped += m[i];
  NEAR(total(sum_lumped), 1.5, 1e-13);
  OK(PetscFree(u));
  OK(PetscFree(y));
}

static void test_volume(void **state)
{
  (void)state;
  for_all(check_volume, "");
}

static void check_adjoint(Case *c)
{
  const PetscInt np = c->l->ncell * (c->dim + 1);
  PetscReal     *u = new_field(c), *r = new_field(c), *p = new_pressure(c), *y = new_pressure(c), left, right;

  fill_noise(c->l, 1, u);
  fill_noise_pressure(c->l, 2, p);
  OK(FlowDivergence(c->flow, u, y));
  OK(FlowGradient(c->flow, 3, p, r));
  left  = 3 * dot(np, y, p);
  right = dot(c->own, u, r);
  assert_true(PetscAbsReal(left) > 1e-3);
  NEAR(left, right, 1e-13 * PetscSqrtReal(dot(c->own, u, u) * dot(c->own, r, r)));
  OK(PetscFree(u));
  OK(PetscFree(r));
  OK(PetscFree(p));
  OK(PetscFree(y));
}

static void test_divergence_and_gradient_are_adjoint(void **state)
{
  (void)state;
  for_all(check_adjoint, "");
}

/* ---- S ---- */

static PetscReal square(const Case *c, const PetscReal x[])
{
  PetscReal v[3], g[3][3], sum = 0;

  eval(c, 1, c->degree, x, v, g);
  for (PetscInt a = 0; a < c->dim; a++) sum += v[a] * v[a];
  return sum;
}

static PetscReal square_gradient(const Case *c, const PetscReal x[])
{
  PetscReal v[3], g[3][3], sum = 0;

  eval(c, 1, c->degree, x, v, g);
  for (PetscInt a = 0; a < c->dim; a++)
    for (PetscInt e = 0; e < c->dim; e++) sum += g[a][e] * g[a][e];
  return sum;
}

/* rho = 3, mu = 0.7, first step of length 0.2: c_t = 5 */
static void check_matrix(Case *c)
{
  PetscReal       *u = new_field(c), *v = new_field(c), *y = new_field(c), *z = new_field(c), mass, stiffness;
  const PetscReal *m;
  const FlowStep  *step;

  OK(FlowBeginStep(c->flow, 0.2, 0.2));
  OK(FlowAssemble(c->flow));
  OK(FlowGetStep(c->flow, &step));
  OK(FlowGetLumpedMass(c->flow, &m));
  for (PetscInt i = 0; i < c->own; i++) u[i] = 1;
  apply_matrix(c, u, y);
  for (PetscInt i = 0; i < c->own; i++) z[i] = 15 * m[i / c->dim];
  BELOW(max_difference(c->own, y, z), 1e-13);

  fill_polynomial(c, 1, c->degree, 1, u);
  apply_matrix(c, u, y);
  mass      = integrate(c, square);
  stiffness = integrate(c, square_gradient);
  NEAR(dot(c->own, u, y), 15 * mass + step->theta * 0.7 * stiffness, 1e-12 * (15 * mass + stiffness));

  fill_noise(c->l, 3, u);
  fill_noise(c->l, 4, v);
  apply_matrix(c, u, y);
  apply_matrix(c, v, z);
  NEAR(dot(c->own, v, y), dot(c->own, u, z), 1e-12 * dot(c->own, y, y));
  OK(PetscFree(u));
  OK(PetscFree(v));
  OK(PetscFree(y));
  OK(PetscFree(z));
}

static void test_mass_and_stiffness(void **state)
{
  (void)state;
  for_all(check_matrix, "-flow_density 3 -flow_viscosity 0.7 -flow_convection 0 -flow_time be");
  for_all(check_matrix, "-flow_density 3 -flow_viscosity 0.7 -flow_convection 0 -flow_time cn");
}

/* A second step of another length must not reuse the matrix of the first */
static void test_matrix_follows_the_step(void **state)
{
  (void)state;
  Case             c;
  PetscReal       *u, *y, *p;
  const PetscReal *m;

  open_case(&c, 2, PETSC_FALSE, "-flow_time bdf2 -flow_convection 0");
  u = new_field(&c);
  y = new_field(&c);
  p = new_pressure(&c);
  OK(FlowGetLumpedMass(c.flow, &m));
  for (PetscInt i = 0; i < c.l->nnode_all * 2; i++) u[i] = 1;
  for (PetscInt k = 0; k < 3; k++) { /* be, then bdf2 with equal steps, then with a ratio of 1/2 */
    const PetscReal dt = k < 2 ? 0.2 : 0.1, ct = k == 0 ? 5 : k == 1 ? 7.5 : 2 / (1.5 * 0.1);

    OK(FlowBeginStep(c.flow, 0.2 * (k + 1), dt));
    OK(FlowAssemble(c.flow));
    apply_matrix(&c, u, y);
    for (PetscInt i = 0; i < c.own; i++) NEAR(y[i], ct * m[i / 2], 1e-13);
    OK(FlowAcceptStep(c.flow, u, p));
  }
  OK(PetscFree(u));
  OK(PetscFree(y));
  OK(PetscFree(p));
  close_case(&c);
}

/* ---- convection ---- */

static PetscReal conv_total(const Case *c, const PetscReal x[])
{
  PetscReal w[3], u[3], g[3][3], sum = 0;

  eval(c, 2, 2, x, w, g);
  eval(c, 3, 2, x, u, g);
  for (PetscInt a = 0; a < c->dim; a++)
    for (PetscInt e = 0; e < c->dim; e++) sum += w[e] * g[a][e];
  return sum;
}

static PetscReal conv_tested(const Case *c, const PetscReal x[])
{
  PetscReal w[3], u[3], v[3], g[3][3], gv[3][3], sum = 0;

  eval(c, 2, 2, x, w, g);
  eval(c, 4, 1, x, v, gv);
  eval(c, 3, 2, x, u, g);
  for (PetscInt a = 0; a < c->dim; a++)
    for (PetscInt e = 0; e < c->dim; e++) sum += v[a] * w[e] * g[a][e];
  return sum;
}

/* The difference between S with and without convection, applied to quadratic u for quadratic w: its sum and its product
   with linear v are exact integrals. theta and the time to which w is extrapolated come with the scheme; w grows as 1 +
   2 t, with quadratic extrapolation as 1 + 2 t + 5 t^2, and in steps of large CFL numbers (`large`), which choose that
   for themselves. */
static PetscBool large;

static PetscReal growth(PetscReal t)
{
  char      name[16];
  PetscBool given;

  OK(PetscOptionsGetString(NULL, NULL, "-flow_extrapolation", name, sizeof(name), &given));
  return 1 + 2 * t + ((given && !strcmp(name, "quadratic")) || large ? 5 * t * t : 0);
}

static void check_convection(Case *c)
{
  PetscReal *u = new_field(c), *w = new_field(c), *v = new_field(c), *p = new_pressure(c), *y = new_field(c),
            *z = new_field(c), ahead, sum = 0;
  PetscReal        times[5] = {0, 0.1, 0.25, 0.3, 0.42};
  FlowDiagnostics  d;
  const PetscReal *fields;
  const FlowStep  *step;
  const char      *scheme;
  char             name[8];

  OK(PetscOptionsGetString(NULL, NULL, "-flow_time", name, sizeof(name), NULL));
  scheme = name;
  for (PetscInt k = 0; k < 5 && large; k++) times[k] *= 10;
  OK(FlowAllowParabola(c->flow, large));
  for (PetscInt k = 1; k < 4; k++) {
    OK(FlowBeginStep(c->flow, times[k], times[k] - times[k - 1]));
    fill_polynomial(c, 2, 2, growth(times[k]), w);
    OK(FlowDiagnose(c->flow, w, NULL, &d));
    fill_polynomial(c, 2, 2, growth(times[k]) * 2.05 / d.cfl, z); /* of CFL number 2.05, in the last step 4.9 */
    if (large) OK(FlowDiagnose(c->flow, z, NULL, &d));
    OK(FlowAcceptStep(c->flow, w, p));
  }
  OK(FlowBeginStep(c->flow, times[4], times[4] - times[3]));
  OK(FlowAssemble(c->flow));
  OK(FlowGetStep(c->flow, &step));
  ahead = !strcmp(scheme, "be") ? times[3] : !strcmp(scheme, "cn") ? 0.5 * (times[3] + times[4]) : times[4];
  fill_polynomial(c, 3, 2, 1, u);
  fill_polynomial(c, 4, 1, 1, v);
  apply_matrix(c, u, y);
  { /* the same without convection, from a second flow on the same mesh */
    Flow with = c->flow;

    OK(PetscOptionsSetValue(NULL, "-flow_convection", "0"));
    OK(FlowCreate(c->mesh, &c->flow));
    for (PetscInt k = 1; k < 5; k++) {
      OK(FlowBeginStep(c->flow, times[k], times[k] - times[k - 1]));
      if (k < 4) OK(FlowAcceptStep(c->flow, w, p));
    }
    OK(FlowAssemble(c->flow));
    apply_matrix(c, u, z);
    OK(FlowDestroy(&c->flow));
    c->flow = with;
    OK(PetscOptionsSetValue(NULL, "-flow_convection", "1"));
  }
  for (PetscInt i = 0; i < c->own; i++) {
    y[i] -= z[i];
    sum += y[i];
  }
  fields = y;
  NEAR(total(sum), 3 * step->theta * growth(ahead) * integrate(c, conv_total), 1e-11);
  if (!c->skewed) NEAR(dot(c->own, v, fields), 3 * step->theta * growth(ahead) * integrate(c, conv_tested), 1e-11);
  OK(PetscFree(u));
  OK(PetscFree(w));
  OK(PetscFree(v));
  OK(PetscFree(p));
  OK(PetscFree(y));
  OK(PetscFree(z));
}

/* In the skew-symmetric form v . C(w) v = 0 for every v and every w that is zero at the boundary, whatever its
   divergence */
static void check_energy(Case *c)
{
  PetscReal           *v = new_field(c), *w = new_field(c), *p = new_pressure(c), *y[2];
  const unsigned char *fixed;

  if (!c->skewed) {
    OK(ConditionsGetValues(FlowConditions(c->flow), &fixed, NULL));
    fill_noise(c->l, 5, v);
    fill_noise(c->l, 6, w);
    for (PetscInt i = 0; i < c->l->nnode_all * c->l->dim; i++)
      if (fixed[i / c->l->dim]) w[i] = 0;
    for (PetscInt k = 0; k < 2; k++) {
      y[k] = new_field(c);
      OK(FlowBeginStep(c->flow, 0.1 * (k + 1), 0.1));
      OK(FlowAssemble(c->flow));
      apply_matrix(c, v, y[k]);
      if (k == 0) OK(FlowAcceptStep(c->flow, w, p));
    }
    for (PetscInt i = 0; i < c->own; i++) y[1][i] -= y[0][i];
    assert_true(dot(c->own, y[1], y[1]) > 1e-6);
    NEAR(dot(c->own, v, y[1]), 0, 1e-11);
    OK(PetscFree(y[0]));
    OK(PetscFree(y[1]));
  }
  OK(PetscFree(v));
  OK(PetscFree(w));
  OK(PetscFree(p));
}

static void test_convection(void **state)
{
  (void)state;
  for_all(check_convection, "-flow_density 3 -flow_time be");
  for_all(check_convection, "-flow_density 3 -flow_time cn");
  for_all(check_convection, "-flow_density 3 -flow_time bdf2");
  for_all(check_convection, "-flow_density 3 -flow_time cn -flow_extrapolation quadratic");
  for_all(check_convection, "-flow_density 3 -flow_time bdf2 -flow_extrapolation quadratic");
  large = PETSC_TRUE;
  for_all(check_convection, "-flow_density 3 -flow_time cn");
  for_all(check_convection, "-flow_density 3 -flow_time bdf2");
  large = PETSC_FALSE;
  for_all(check_energy, "-flow_density 3 -flow_convection_form skew -flow_time be");
}

/* ---- right-hand side, residual, integrals ---- */

/* Cells side by side have the residuals that they have alone */
static void check_several(Case *c, const PetscReal u[], const PetscReal p[])
{
  const PetscInt size = c->l->nb * c->dim;
  PetscReal      several[FLOW_CELLS * MESH_MAX_NB * 3], alone[MESH_MAX_NB * 3], worst = 0;

  for (PetscInt first = 0; first < c->l->ncell; first += FLOW_CELLS) {
    PetscInt cells[FLOW_CELLS], n = PetscMin(FLOW_CELLS, c->l->ncell - first);

    for (PetscInt i = 0; i < n; i++) cells[i] = first + n - 1 - i;
    OK(FlowCellResiduals(c->flow, n, cells, u, p, several));
    for (PetscInt i = 0; i < n; i++) {
      OK(FlowCellResidual(c->flow, cells[i], u, p, alone));
      for (PetscInt k = 0; k < size; k++)
        worst = PetscMax(worst, PetscAbsReal(several[i * size + k] - alone[k]) / (1 + PetscAbsReal(alone[k])));
    }
  }
  BELOW(largest(worst), 1e-11);
}

/* The assembled residual of the cells is S u - B^T p - r for any fields */
static void check_residual(Case *c)
{
  const PetscInt nb = c->l->nb, dim = c->dim;
  PetscReal     *u = new_field(c), *p = new_pressure(c), *y = new_field(c), *g = new_field(c), *r = new_field(c),
            *sum        = new_field(c);
  const PetscReal dt[3] = {0.1, 0.15, 0.05};

  for (PetscInt k = 0; k < 3; k++) {
    OK(FlowBeginStep(c->flow, k, dt[k]));
    fill_noise(c->l, k, u);
    fill_noise_pressure(c->l, k, p);
    if (k < 2) OK(FlowAcceptStep(c->flow, u, p));
  }
  OK(FlowAssemble(c->flow));
  OK(FlowRhs(c->flow, r));
  apply_matrix(c, u, y);
  OK(FlowGradient(c->flow, 1, p, g));
  for (PetscInt i = 0; i < c->own; i++) y[i] -= g[i] + r[i];
  for (PetscInt cell = 0; cell < c->l->ncell; cell++) {
    PetscReal rc[MESH_MAX_NB * 3];

    OK(FlowCellResidual(c->flow, cell, u, p, rc));
    for (PetscInt i = 0; i < nb * dim; i++) sum[c->l->cell_node[cell * nb + i / dim] * dim + i % dim] += rc[i];
  }
  OK(MeshSumNodes(c->mesh, dim, sum));
  BELOW(max_difference(c->own, sum, y), 1e-12 * (1 + max_abs(c->own, r)));
  check_several(c, u, p);
  OK(PetscFree(u));
  OK(PetscFree(p));
  OK(PetscFree(y));
  OK(PetscFree(g));
  OK(PetscFree(r));
  OK(PetscFree(sum));
}

static void test_residual_is_the_system(void **state)
{
  (void)state;
  const char *const scheme[] = {"be", "cn", "bdf2"};

  for (PetscInt i = 0; i < 6; i++) {
    char options[160];

    snprintf(options, sizeof(options), "-flow_density 3 -flow_viscosity 0.7 -flow_force 1,-2%s -flow_time %s",
             i < 3 ? "" : ",4", scheme[i % 3]);
    for (PetscInt skewed = 0; skewed < 2; skewed++) {
      Case c;

      open_case(&c, 2 + i / 3, (PetscBool)skewed, options);
      check_residual(&c);
      close_case(&c);
    }
  }
}

static PetscReal linear_pressure(const Case *c, const PetscReal x[], PetscReal grad[])
{
  return polynomial(70, 1, c->dim, x, grad);
}

/* -sigma . grad(alpha) and its moment about X: component `which` of force, then torque */
static const PetscReal CENTRE[3] = {0.4, 0.7, 0.2};
static PetscInt        which;
static PetscReal       traction(const Case *c, const PetscReal x[])
{
  PetscReal u[3], g[3][3], ga[3] = {0, 0, 0}, gp[3], t[3] = {0, 0, 0}, r[3] = {0, 0, 0};

  eval(c, 5, 2, x, u, g);
  (void)polynomial(80, 2, c->dim, x, ga);
  for (PetscInt d = 0; d < c->dim; d++) {
    r[d] = x[d] - CENTRE[d];
    t[d] = linear_pressure(c, x, gp) * ga[d];
    for (PetscInt e = 0; e < c->dim; e++) t[d] -= 0.7 * (g[d][e] + g[e][d]) * ga[e];
  }
  return which < 3 ? t[which] : r[(which + 1) % 3] * t[(which + 2) % 3] - r[(which + 2) % 3] * t[(which + 1) % 3];
}

static void check_stress(Case *c)
{
  const PetscInt nb = c->l->nb, dim = c->dim, nk = dim + 1;
  PetscReal     *u = new_field(c), *p = new_pressure(c), *size = new_pressure(c), force[6] = {0}, grad[3];

  fill_polynomial(c, 5, 2, 1, u);
  for (PetscInt i = 0; i < c->l->ncell * nk; i++) p[i] = 1;
  OK(FlowGetPressureGradient(c->flow, p, size)); /* 1/h for the slopes */
  for (PetscInt cell = 0; cell < c->l->ncell; cell++) {
    p[cell * nk] = linear_pressure(c, c->l->x + c->l->cell_node[cell * nb + nb / 2] * dim, grad);
    for (PetscInt k = 1; k < nk; k++) p[cell * nk + k] = grad[k - 1] / size[cell * nk + k];
  }
  for (PetscInt cell = 0; cell < c->l->ncell; cell++) {
    PetscReal alpha[MESH_MAX_NB];

    for (PetscInt j = 0; j < nb; j++)
      alpha[j] = polynomial(80, 2, dim, c->l->x + c->l->cell_node[cell * nb + j] * dim, grad);
    OK(FlowCellStressForce(c->flow, cell, u, p, alpha, CENTRE, force, force + 3));
  }
  for (which = 0; which < 6; which++) {
    if (dim == 2 && which >= 2 && which < 5) BELOW(force[which], 0);
    else NEAR(total(force[which]), integrate(c, traction), 1e-12);
  }
  OK(PetscFree(u));
  OK(PetscFree(p));
  OK(PetscFree(size));
}

static void test_stress_integral(void **state)
{
  (void)state;
  for_all(check_stress, "-flow_viscosity 0.7");
}

static PetscReal speed_square(const Case *c, const PetscReal x[])
{
  PetscReal v[3], g[3][3], sum = 0;

  eval(c, 2, c->degree, x, v, g);
  for (PetscInt a = 0; a < c->dim; a++) sum += v[a] * v[a];
  return sum;
}

static PetscReal momentum(const Case *c, const PetscReal x[]) /* rho (u - 0)/dt + rho w.grad u - f with w = u^n = 0 */
{
  PetscReal v[3], g[3][3];

  eval(c, 2, c->degree, x, v, g);
  return 3 * v[which] / 0.1 - (which + 1);
}

static void check_diagnose(Case *c)
{
  PetscReal      *u = new_field(c);
  FlowDiagnostics d;
  PetscReal       top = 0;

  fill_polynomial(c, 2, c->degree, 1, u);
  OK(FlowBeginStep(c->flow, 0.1, 0.1));
  OK(FlowDiagnose(c->flow, u, NULL, &d));
  NEAR(d.kinetic_energy, 1.5 * integrate(c, speed_square), 1e-12);
  for (which = 0; which < c->dim; which++)
    NEAR(d.change[which] + d.flux[which] - d.driven[which], integrate(c, momentum), 1e-11);
  for (PetscInt i = 0; i < c->l->nnode; i++) {
    PetscReal s = 0;

    for (PetscInt a = 0; a < c->dim; a++) s += u[i * c->dim + a] * u[i * c->dim + a];
    top = PetscMax(top, PetscSqrtReal(s));
  }
  NEAR(d.speed_max, largest(top), 1e-14);
  for (PetscInt i = 0; i < c->l->nnode_all * c->dim; i++) u[i] = i % c->dim == 0 ? 2 * c->l->x[i] : 0;
  OK(FlowDiagnose(c->flow, u, NULL, &d));
  NEAR(d.divergence, 2 * PetscSqrtReal(1.5), 1e-13);
  OK(FlowGetGradientNorm(c->flow, u, &top));
  NEAR(top, d.divergence, 1e-13);
  for (PetscInt i = 0; i < c->l->nnode_all; i++) u[i * c->dim] += 3 * c->l->x[i * c->dim + 1];
  OK(FlowGetGradientNorm(c->flow, u, &top));
  NEAR(top, PetscSqrtReal(13 * 1.5), 1e-12);
  if (!c->skewed) NEAR(d.cfl, 0.3 / PetscPowReal(1.5 / c->l->ncell_global, 1.0 / c->dim), 1e-13);
  OK(PetscFree(u));
}

static void test_diagnose(void **state)
{
  (void)state;
  Case c;

  for (PetscInt i = 0; i < 4; i++) {
    open_case(&c, 2 + i / 2, (PetscBool)(i % 2),
              i < 2 ? "-flow_density 3 -flow_force 1,2" : "-flow_density 3 -flow_force 1,2,3");
    check_diagnose(&c);
    close_case(&c);
  }
}

/* ---- time ---- */

/* c_t q^{n+1} - d0 q^n - d1 q^{n-1} is the derivative: at the end of the step for be (degree 1) and bdf2 (degree 2, any
   step lengths), in its middle for cn (degree 2) */
static void check_scheme(const char scheme[], PetscInt degree, PetscReal where)
{
  const PetscReal times[] = {0, 0.1, 0.25, 0.3, 0.5, 0.7};
  char            options[32];
  Case            c;
  PetscReal      *u, *p, *guess, *guess_p, *change;
  const FlowStep *s;

  snprintf(options, sizeof(options), "-flow_time %s", scheme);
  open_case(&c, 2, PETSC_FALSE, options);
  u       = new_field(&c);
  p       = new_pressure(&c);
  guess   = new_field(&c);
  guess_p = new_pressure(&c);
  change  = new_pressure(&c);
  for (PetscInt k = 1; k < 6; k++) {
    const PetscReal dt = times[k] - times[k - 1], at = times[k] - (1 - where) * dt,
                    q[3] = {times[k], times[k - 1], k > 1 ? times[k - 2] : 0};

    OK(FlowBeginStep(c.flow, times[k], dt));
    OK(FlowGetStep(c.flow, &s));
    NEAR(s->time, times[k], 0);
    NEAR(s->dt, dt, 0);
    assert_int_equal(s->order, degree == 2 && k > 1 ? 2 : 1);
    NEAR(s->theta, where < 1 ? 0.5 : 1, 0);
    NEAR(s->ct - s->d0 - s->d1, 0, 1e-12);
    NEAR(s->ct * q[0] - s->d0 * q[1] - s->d1 * q[2], 1, 1e-13);
    if (degree == 2 && (k > 1 || where < 1))
      NEAR(s->ct * q[0] * q[0] - s->d0 * q[1] * q[1] - s->d1 * q[2] * q[2], 2 * at, 1e-13);
    /* the start value is exact for fields that are linear in time, as soon as two are known; the pressure is that of
       the last step, with its last change */
    OK(FlowExtrapolate(c.flow, guess, guess_p, change));
    for (PetscInt i = 0; i < c.l->nnode_all * 2; i++) u[i] = (2 + 3 * times[k]) * noise(i);
    if (k > 1) BELOW(max_difference(c.l->ncell * 3, p, guess_p), 1e-13);
    for (PetscInt i = 0; i < c.l->ncell * 3; i++)
      BELOW(PetscAbsReal(change[i] - (k > 2 ? 3 * (times[k - 1] - times[k - 2]) * noise(i) : 0)), 1e-13);
    for (PetscInt i = 0; i < c.l->ncell * 3; i++) p[i] = (2 + 3 * times[k]) * noise(i);
    if (k > 2) BELOW(max_difference(c.l->nnode_all * 2, u, guess), 1e-13);
    OK(FlowAcceptStep(c.flow, u, p));
  }
  OK(PetscFree(u));
  OK(PetscFree(p));
  OK(PetscFree(guess));
  OK(PetscFree(guess_p));
  OK(PetscFree(change));
  close_case(&c);
}

static void test_time_schemes(void **state)
{
  (void)state;
  check_scheme("be", 1, 1);
  check_scheme("cn", 2, 0.5);
  check_scheme("bdf2", 2, 1);
}

/* ---- boundary values ---- */

/* The prescribed components (bits) and values that a node should have */
typedef PetscInt (*Wanted)(const PetscReal x[], PetscReal t, PetscReal v[3]);

static void check_boundary(PetscInt dim, const char options[], PetscReal t, Wanted wanted, PetscBool floating,
                           PetscInt solid)
{
  Case                 c;
  const unsigned char *fixed;
  const PetscReal     *value;
  PetscBool            got_floating;
  PetscInt             got_solid;

  open_case(&c, dim, PETSC_FALSE, options);
  OK(FlowBeginStep(c.flow, 2 * t + 1, 0.1)); /* an earlier time must leave nothing behind */
  OK(FlowBeginStep(c.flow, t, 0.1));
  OK(ConditionsGetValues(FlowConditions(c.flow), &fixed, &value));
  for (PetscInt i = 0; i < c.l->nnode_all; i++) {
    PetscReal v[3] = {0, 0, 0};

    assert_int_equal(fixed[i], wanted(c.l->x + i * dim, t, v));
    for (PetscInt a = 0; a < dim; a++)
      if ((fixed[i] >> a) & 1) NEAR(value[i * dim + a], v[a], 1e-14);
  }
  OK(ConditionsPressureIsFloating(FlowConditions(c.flow), &got_floating));
  assert_int_equal(got_floating, floating);
  OK(ConditionsGetSolidFaces(FlowConditions(c.flow), &got_solid));
  assert_int_equal(got_solid, solid);
  close_case(&c);
}

static PetscBool at(PetscReal x, PetscReal y)
{
  return (PetscBool)(PetscAbsReal(x - y) < 1e-10);
}

/* no_slip over moving_wall over inflow over outflow where they meet */
static PetscInt want_channel(const PetscReal x[], PetscReal t, PetscReal v[3])
{
  (void)t;
  if (at(x[1], 0)) return 3;
  if (at(x[1], 1)) {
    v[0] = 7;
    return 3;
  }
  if (at(x[0], 0)) {
    v[0] = 2;
    v[1] = 1;
    return 3;
  }
  return 0;
}

static PetscInt want_cavity(const PetscReal x[], PetscReal t, PetscReal v[3])
{
  (void)t;
  if (at(x[0], 0) || at(x[0], 1.5) || at(x[1], 0)) return 3;
  v[0] = 7;
  return at(x[1], 1) ? 3 : 0;
}

/* slip fixes the normal component only; inflow wins over it; two slip planes meet in a corner */
static PetscInt want_slip(const PetscReal x[], PetscReal t, PetscReal v[3])
{
  (void)t;
  if (at(x[0], 0)) {
    v[0] = 2;
    v[1] = 1;
    return 3;
  }
  return (at(x[0], 1.5) ? 1 : 0) | (at(x[1], 0) || at(x[1], 1) ? 2 : 0);
}

/* parabola, factor 1 + 0.5 sin(2 pi t / 4), ramp over 3 */
static PetscReal pulse(PetscReal t)
{
  return (1 + 0.5 * PetscSinReal(PETSC_PI * t / 2)) * (t < 3 ? 0.5 * (1 - PetscCosReal(PETSC_PI * t / 3)) : 1);
}

static PetscInt want_pulse(const PetscReal x[], PetscReal t, PetscReal v[3])
{
  if (at(x[1], 0) || at(x[1], 1)) return 3;
  if (!at(x[0], 0)) return 0;
  v[0] = 2 * 4 * x[1] * (1 - x[1]) * pulse(t);
  return 3;
}

static PetscInt want_pulse_3d(const PetscReal x[], PetscReal t, PetscReal v[3])
{
  if (at(x[1], 0) || at(x[1], 1) || at(x[2], 0) || at(x[2], 1)) return 7;
  if (!at(x[0], 0)) return 0;
  v[0] = 2 * 16 * x[1] * (1 - x[1]) * x[2] * (1 - x[2]) * pulse(t);
  return 7;
}

static PetscInt want_periodic(const PetscReal x[], PetscReal t, PetscReal v[3])
{
  (void)t;
  v[0] = 7;
  return at(x[1], 1) ? 3 : (v[0] = 0, at(x[1], 0) ? 3 : 0);
}

static PetscInt want_none(const PetscReal x[], PetscReal t, PetscReal v[3])
{
  (void)x, (void)t, (void)v;
  return 0;
}

static void test_boundary_values(void **state)
{
  (void)state;
  const char *channel =
    "-flow_bc_left_type inflow -flow_bc_left_velocity 2,1 -flow_bc_right_type outflow -flow_bc_top_type moving_wall -flow_bc_top_velocity 7,0";
  const char *pulsed =
    "-flow_bc_left_type inflow -flow_bc_left_velocity 2,0 -flow_bc_left_profile parabolic -flow_bc_left_factor 1,0.5,4 -flow_bc_left_ramp 3 -flow_bc_right_type outflow";
  const char *pulsed3 =
    "-flow_bc_left_type inflow -flow_bc_left_velocity 2,0,0 -flow_bc_left_profile parabolic -flow_bc_left_factor 1,0.5,4 -flow_bc_left_ramp 3 -flow_bc_right_type outflow";

  check_boundary(2, channel, 1, want_channel, PETSC_FALSE, 4 + 8);
  check_boundary(2, "-flow_bc_top_type moving_wall -flow_bc_top_velocity 7,0", 1, want_cavity, PETSC_TRUE, 15);
  check_boundary(2,
                 "-flow_bc_left_type inflow -flow_bc_left_velocity 2,1 -flow_bc_right_type slip -flow_bc_top_type slip -flow_bc_bottom_type slip",
                 1, want_slip, PETSC_TRUE, 0);
  for (PetscInt i = 0; i < 4; i++) {
    check_boundary(2, pulsed, 1.7 * i, want_pulse, PETSC_FALSE, 12);
    check_boundary(3, pulsed3, 1.7 * i, want_pulse_3d, PETSC_FALSE, 4 + 8 + 16 + 32);
  }
  check_boundary(2, "-mesh_periodic x -flow_bc_top_type moving_wall -flow_bc_top_velocity 7,0", 1, want_periodic,
                 PETSC_TRUE, 12);
  check_boundary(2, "-mesh_periodic x,y", 1, want_none, PETSC_TRUE, 0);
}

static void refuse(const char options[], const char text[])
{
  Mesh mesh;
  Flow flow;

  give(options);
  create_skewed_mesh(2, (const PetscInt[]){3, 3, 0}, &mesh);
  begin_error();
  expect_error(FlowCreate(mesh, &flow), 0, text, NULL);
  OK(MeshDestroy(&mesh));
}

static void test_refused_boundaries(void **state)
{
  (void)state;
  refuse("-flow_bc_wall_type inflow", "-flow_bc_wall_velocity");
  refuse("-flow_bc_wall_type slip", "not a plane");
  refuse("-flow_bc_wall_type inflow -flow_bc_wall_velocity 1,0 -flow_bc_wall_factor 1,1,0", "period");
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_solenoidal_fields),
                                     cmocka_unit_test(test_volume),
                                     cmocka_unit_test(test_divergence_and_gradient_are_adjoint),
                                     cmocka_unit_test(test_mass_and_stiffness),
                                     cmocka_unit_test(test_matrix_follows_the_step),
                                     cmocka_unit_test(test_convection),
                                     cmocka_unit_test(test_product_without_matrix),
                                     cmocka_unit_test(test_residual_is_the_system),
                                     cmocka_unit_test(test_stress_integral),
                                     cmocka_unit_test(test_diagnose),
                                     cmocka_unit_test(test_time_schemes),
                                     cmocka_unit_test(test_boundary_values),
                                     cmocka_unit_test(test_refused_boundaries)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("flow", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
