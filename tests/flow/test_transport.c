/* What the fluid carries along: the conformation of a polymer on the mesh against exact solutions, fields of all
   kinds on a mesh that is made anew, viscosities continued into cells that bodies cover. */
/* ranks: 1 2 */
#include "fluidcase.h"
#include "impl.h"
#include "material/generalised.h"
#include "material/viscoelastic.h"
#include "mesh/carry.h"
#include "raised.h"

/* ---- conformation ---- */

#define POLYMER      "-flow_viscosity 2 -flow_rheology_solvent 0.5 -flow_rheology oldroyd_b "
#define REMEMBERS    POLYMER "-flow_rheology_time 1e9 " /* nothing relaxes */
#define RELAXES      POLYMER "-flow_rheology_time 1 "
#define ALL_PERIODIC "-mesh_periodic x,y "

/* u^n and u^{n-1} */
static void set_velocity(Case *c, Field field)
{
  fill_field(c->l, field, c->flow->u);
  fill_field(c->l, field, c->flow->u_old);
}

/* The fluid goes on as it does; psi one step further */
static void step(Case *c, PetscReal time, PetscReal dt)
{
  PetscReal *u;

  OK(FlowBeginStep(c->flow, time, dt));
  OK(ConformationPredict(FlowViscoelastic(c->flow)->conformation));
  OK(PetscMalloc1(c->l->nnode_all * c->dim, &u));
  OK(PetscArraycpy(u, c->flow->u, c->l->nnode_all * c->dim));
  OK(FlowAcceptStep(c->flow, u, c->flow->p_old));
  OK(PetscFree(u));
}

/* Round and as good as Gaussian, of deviation 1/2 pi, in a periodic box of sides 2 and 1; (1, 1/2) t further on */
static PetscReal gaussian(const PetscReal x[], PetscReal t)
{
  return PetscExpReal(4 * (PetscCosReal(PETSC_PI * (x[0] - 0.5 - t)) - 1) +
                      PetscCosReal(2 * PETSC_PI * (x[1] - 0.5 - 0.5 * t)) - 1);
}

static void wind(const PetscReal x[], PetscReal v[])
{
  (void)x;
  v[0] = 1;
  v[1] = 0.5;
}

/* Largest error after going 0.3 with the wind; what is carried keeps its integral */
static PetscReal carry_gaussian(const char cells[])
{
  Case             c;
  char             options[256];
  PetscReal       *psi, before = 0, after = 0, error = 0;
  const PetscReal *m;

  snprintf(options, sizeof(options), REMEMBERS ALL_PERIODIC "-mesh_upper 2,1 -mesh_cells %s", cells);
  open_case(&c, options);
  set_velocity(&c, wind);
  OK(FlowGetLogConformation(c.flow, &psi, NULL));
  OK(FlowGetLumpedMass(c.flow, &m));
  for (PetscInt i = 0; i < c.l->nnode_all * 4; i++) psi[i] = (1 + i % 4) * gaussian(c.l->x + i / 4 * 2, 0);
  for (PetscInt i = 0; i < c.l->nnode * 4; i++) before += m[i / 4] * psi[i];
  for (PetscInt n = 1; n <= 3; n++) step(&c, 0.1 * n, 0.1);
  OK(FlowGetLogConformation(c.flow, &psi, NULL));
  for (PetscInt i = 0; i < c.l->nnode * 4; i++) {
    after += m[i / 4] * psi[i];
    error = PetscMax(error, PetscAbsReal(psi[i] / (1 + i % 4) - gaussian(c.l->x + i / 4 * 2, 0.3)));
  }
  NEAR(total(after), total(before), 1e-9 * total(before));
  close_case(&c);
  return largest(error);
}

static void test_gaussian(void **state)
{
  const PetscReal coarse = carry_gaussian("16,8"), fine = carry_gaussian("32,16");

  (void)state;
  BELOW(coarse, 0.1);
  expect_rate("psi carried by the wind", coarse, fine, 2); /* that of projections with a lumped mass */
}

/* Seen from a box that travels with the fluid nothing moves */
static void test_travelling_box(void **state)
{
  const PetscReal v[3] = {1, 0.5, 0};
  Case            c;
  PetscReal      *psi;

  (void)state;
  open_case(&c, REMEMBERS ALL_PERIODIC "-mesh_upper 2,1 -mesh_cells 4,3");
  set_velocity(&c, wind);
  OK(FlowGetLogConformation(c.flow, &psi, NULL));
  for (PetscInt i = 0; i < c.l->nnode_all * 4; i++) psi[i] = gaussian(c.l->x + i / 4 * 2, 0);
  OK(FlowBeginStep(c.flow, 0.2, 0.2));
  OK(FlowSetFrame(c.flow, v));
  OK(ConformationPredict(FlowViscoelastic(c.flow)->conformation));
  OK(FlowAcceptStep(c.flow, c.flow->u_old, c.flow->p_old));
  OK(FlowGetLogConformation(c.flow, &psi, NULL));
  for (PetscInt i = 0; i < c.l->nnode_all * 4; i++) NEAR(psi[i], gaussian(c.l->x + i / 4 * 2, 0), 1e-8);
  close_case(&c);
}

/* A point of a surface keeps its psi: what the node's was shifted by goes back in the step, all of it, once */
static void test_shift(void **state)
{
  Case       c;
  PetscReal *psi, *shift;

  (void)state;
  open_case(&c, REMEMBERS "-mesh_cells 3,3");
  OK(FlowGetLogConformation(c.flow, &psi, &shift));
  for (PetscInt i = 0; i < c.l->nnode_all * 4; i++) {
    const PetscInt k = 4 * c.l->node_global[i / 4] + i % 4;

    psi[i]   = 0.5 * noise(k);
    shift[i] = c.l->node_global[i / 4] % 3 ? 0 : 0.3 * noise(900 + k);
  }
  for (PetscInt n = 1; n <= 2; n++) {
    step(&c, 0.3 * n, 0.3);
    OK(FlowGetLogConformation(c.flow, &psi, &shift));
    for (PetscInt i = 0; i < c.l->nnode_all * 4; i++) {
      const PetscInt k = 4 * c.l->node_global[i / 4] + i % 4;

      NEAR(psi[i], 0.5 * noise(k) - (c.l->node_global[i / 4] % 3 ? 0 : 0.3 * noise(900 + k)), 1e-8);
      NEAR(shift[i], 0, 0);
    }
  }
  close_case(&c);
}

#define SHEAR 2 /* of the fluid between plates, with the relaxation time 1: Weissenberg number */

static void shear(const PetscReal x[], PetscReal v[])
{
  v[0] = SHEAR * x[1];
  v[1] = 0;
}

/* The polymer between plates that start to move: psi is that of the exact c in every node, tau* that at the end of the
   step, energy and trace those of the whole */
static void test_start_of_a_shear(void **state)
{
  const PetscReal       e = PetscExpReal(-0.8), xx = 1 + 2 * SHEAR * SHEAR * (1 - 1.8 * e), xy = SHEAR * (1 - e);
  Case                  c;
  PetscReal            *conformation;
  const PetscReal      *tau;
  const FlowElasticity *elastic;
  FlowDiagnostics       d;

  (void)state;
  open_case(&c, RELAXES
            "-mesh_periodic x -mesh_upper 1.5,1 -mesh_cells 3,2 -flow_bc_top_type moving_wall -flow_bc_top_velocity 2,0");
  set_velocity(&c, shear);
  for (PetscInt n = 1; n <= 8; n++) step(&c, 0.1 * n, 0.1);
  OK(PetscMalloc1(c.l->nnode_all * 6, &conformation));
  OK(FlowGetConformation(c.flow, conformation));
  tau = ConformationStress(FlowViscoelastic(c.flow)->conformation);
  for (PetscInt i = 0; i < c.l->nnode_all; i++) {
    NEAR(conformation[6 * i], xx, 1e-3);
    NEAR(conformation[6 * i + 1], xy, 1e-3);
    NEAR(conformation[6 * i + 3], 1, 1e-3);
    NEAR(conformation[6 * i + 5], 1, 1e-12);
    NEAR(tau[4 * i + 1], xy, 2e-3); /* the modulus is 1 */
  }
  OK(FlowBeginStep(c.flow, 0.9, 0.1));
  OK(ConformationPredict(FlowViscoelastic(c.flow)->conformation));
  OK(FlowDiagnose(c.flow, c.flow->u, NULL, &d));
  OK(FlowGetElasticity(c.flow, &elastic));
  NEAR(elastic->trace, xx + 2, 2.0);
  assert_true(elastic->trace > xx + 2 && elastic->c_min < 1 && elastic->c_min > 0);
  OK(PetscFree(conformation));
  close_case(&c);
}

/* Uniform tensors in a fluid that turns about the middle go round with it */
static void turning(const PetscReal x[], PetscReal v[])
{
  v[0] = -(x[1] - 0.5);
  v[1] = x[0] - 0.5;
}

static void test_turning(void **state)
{
  const PetscReal c2 = PetscCosReal(0.8), s2 = PetscSinReal(0.8);
  Case            c;
  PetscReal      *psi;

  (void)state;
  open_case(&c, REMEMBERS "-mesh_cells 3,3");
  set_velocity(&c, turning);
  OK(FlowGetLogConformation(c.flow, &psi, NULL));
  for (PetscInt i = 0; i < c.l->nnode_all; i++) {
    psi[4 * i]     = 0.7;
    psi[4 * i + 1] = -0.3;
  }
  for (PetscInt n = 1; n <= 4; n++) step(&c, 0.1 * n, 0.1);
  OK(FlowGetLogConformation(c.flow, &psi, NULL));
  for (PetscInt i = 0; i < c.l->nnode_all; i++) { /* by 0.4: mean 0.2, half of the difference 0.5 */
    NEAR(psi[4 * i], 0.2 + 0.5 * c2, 1e-4);
    NEAR(psi[4 * i + 1], 0.2 - 0.5 * c2, 1e-4);
    NEAR(psi[4 * i + 2], 0.5 * s2, 1e-4);
    NEAR(psi[4 * i + 3], 0, 1e-12);
  }
  close_case(&c);
}

/* What stands for the polymer in the matrix: modulus times the step, or its viscosity in long steps, or nothing; a
   tensor where it is stretched */
static void test_implicit_part(void **state)
{
  static const char *const option[]  = {"-flow_rheology_implicit rest", "-flow_rheology_implicit none",
                                        "-flow_rheology_devss 0.5 -flow_rheology_implicit none"};
  const PetscReal          want[][2] = {{1.1, 2}, {1, 1}, {1.5, 1.5}};

  (void)state;
  for (PetscInt i = 0; i < 3; i++) {
    char options[256];
    Case c;

    snprintf(options, sizeof(options), RELAXES "-mesh_cells 2,2 %s", option[i]);
    open_case(&c, options);
    for (PetscInt k = 0; k < 2; k++) {
      OK(FlowBeginStep(c.flow, 1, k ? 5 : 0.1));
      NEAR(c.flow->par.matrix, want[i][k], 1e-14);
      assert_null(ConformationTensors(FlowViscoelastic(c.flow)->conformation));
    }
    close_case(&c);
  }
}

/* auto: stretched so far that half of the viscosity would be explicit */
static void test_stretched(void **state)
{
  Case             c;
  PetscReal       *psi;
  const PetscReal *E;

  (void)state;
  open_case(&c, RELAXES "-mesh_cells 2,2");
  OK(FlowGetLogConformation(c.flow, &psi, NULL));
  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt i = 0; i < c.l->nnode_all; i++) psi[4 * i] = PetscLogReal(pass ? 40 : 2);
    OK(FlowBeginStep(c.flow, 0.1, 0.1));
    OK(ConformationPredict(FlowViscoelastic(c.flow)->conformation));
    E = ConformationTensors(FlowViscoelastic(c.flow)->conformation);
    if (!pass) assert_null(E);
    if (!pass) continue;
    assert_non_null(E);
    for (PetscInt e = 0; e < c.l->ncell_all; e++) { /* G dt c */
      NEAR(E[4 * e], 0.1 * 40, 1e-12);
      NEAR(E[4 * e + 1], 0, 1e-12);
      NEAR(E[4 * e + 3], 0.1, 1e-12);
    }
  }
  close_case(&c);
}

static void extension(const PetscReal x[], PetscReal v[])
{
  v[0] = 3000 * x[0];
  v[1] = -3000 * x[1];
}

static void test_too_fast_for_it(void **state)
{
  Case c;

  (void)state;
  open_case(&c, RELAXES "-mesh_cells 2,2");
  set_velocity(&c, extension);
  OK(FlowBeginStep(c.flow, 0.5, 0.5));
  begin_error();
  expect_error(ConformationPredict(FlowViscoelastic(c.flow)->conformation), PETSC_ERR_NOT_CONVERGED,
               "oldroyd_b would need more than 200 substeps", "Lower -sim_dt", NULL);
  close_case(&c);
}

/* ---- the mesh made anew ---- */

static PetscErrorCode point_distance(void *context, const PetscReal x[3], PetscReal reach, PetscReal *d)
{
  const PetscReal *at = context;

  (void)reach;
  *d = PetscSqrtReal(PetscSqr(x[0] - at[0]) + PetscSqr(x[1] - at[1]) + PetscSqr(x[2] - at[2]));
  return PETSC_SUCCESS;
}

/* Cells of unequal sides, halved around a point; then around another one */
static void open_around(Case *c, PetscInt dim, const char options[], PetscReal at[3])
{
  char text[512];

  snprintf(text, sizeof(text), "-mesh_refine_distance 1 %s -mesh_levels 2 %s",
           dim == 2 ? "-mesh_cells 4,6 -mesh_upper 2,1" : "-mesh_cells 3,4,3 -mesh_upper 2,1,1", options);
  give(text);
  OK(MeshCreateAround(PETSC_COMM_WORLD, &(MeshSurface){.distance = point_distance, .context = at}, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  c->dim = dim;
}

static void make_anew(Case *c, PetscReal at[3])
{
  const PetscInt cells = c->l->ncell_global;
  Mesh           old;

  OK(MeshRemesh(c->mesh, &(MeshSurface){.distance = point_distance, .context = at}, &old));
  OK(FlowRemesh(c->flow, old));
  OK(MeshDestroy(&old));
  assert_true(c->l->ncell_global != cells);
}

static PetscReal line(PetscInt dim, const PetscReal x[])
{
  return 2 + 3 * x[0] - 5 * x[1] + (dim == 3 ? 7 * x[2] : 0);
}

/* A linear pressure stays what it is, value and slope, now and in the step before */
static void test_carried_pressure(void **state)
{
  const PetscReal slope[3] = {3, -5, 7};

  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    Case           c;
    PetscReal      from[3] = {0.3, 0.3, 0}, to[3] = {1.45, 0.62, dim == 3 ? 0.4 : 0}, *p, *out, *change, *u;
    const PetscInt nk = dim + 1;

    open_around(&c, dim, "", from);
    for (PetscInt n = 1; n <= 3; n++) { /* p^n = n times the line */
      OK(FlowBeginStep(c.flow, n, 1));
      OK(PetscCalloc1(c.l->ncell * nk, &p));
      for (PetscInt i = 0; i < c.l->ncell; i++) {
        p[i * nk] = n * line(dim, c.flow->cells.centre + i * dim);
        for (PetscInt a = 0; a < dim; a++) p[i * nk + 1 + a] = n * slope[a] * c.flow->cells.size[i];
      }
      OK(FlowAcceptStep(c.flow, c.flow->w, p));
      OK(PetscFree(p));
    }
    make_anew(&c, to);
    OK(PetscMalloc4(c.l->ncell * nk, &p, c.l->ncell * nk, &out, c.l->ncell * nk, &change, c.l->nnode_all * dim, &u));
    OK(FlowExtrapolate(c.flow, u, p, change));
    for (PetscInt k = 0; k < 2; k++) {
      OK(FlowGetPressureGradient(c.flow, k ? change : p, out));
      for (PetscInt i = 0; i < c.l->ncell; i++) {
        NEAR(out[i * nk], (k ? 1 : 3) * line(dim, c.flow->cells.centre + i * dim), 1e-12);
        for (PetscInt a = 0; a < dim; a++) NEAR(out[i * nk + 1 + a], (k ? 1 : 3) * slope[a], 1e-11);
      }
    }
    OK(PetscFree4(p, out, change, u));
    close_case(&c);
  }
}

/* Of any pressure the mean stays where cells are halved once and joined */
static void test_carried_mean(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    Case      c;
    PetscReal from[3] = {0.3, 0.3, 0}, to[3] = {1.45, 0.62, dim == 3 ? 0.4 : 0}, mean[2];

    open_around(&c, dim, "-mesh_levels 1", from);
    fill_noise_pressure(c.l, 5, c.flow->p);
    for (PetscInt k = 0; k < 2; k++) {
      mean[k] = 0;
      for (PetscInt i = 0; i < c.l->ncell; i++)
        mean[k] += c.flow->p[i * (dim + 1)] * PetscPowReal(c.flow->cells.size[i], dim);
      mean[k] = total(mean[k]);
      if (!k) make_anew(&c, to);
    }
    assert_true(PetscAbsReal(mean[0]) > 1e-3);
    NEAR(mean[1], mean[0], 1e-13);
    close_case(&c);
  }
}

/* Quadratic velocities of two times, and the scheme goes on with them: of second order, w what it would have been */
static void test_carried_velocity(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    Case            c;
    PetscReal       from[3] = {0.3, 0.3, 0}, to[3] = {1.45, 0.62, dim == 3 ? 0.4 : 0}, *u;
    const FlowStep *s;

    open_around(&c, dim, "-flow_time bdf2", from);
    OK(PetscMalloc1(c.l->nnode_all * dim, &u));
    for (PetscInt n = 1; n <= 2; n++) { /* n times the square of the line, and other shares of it */
      OK(FlowBeginStep(c.flow, n, 1));
      for (PetscInt i = 0; i < c.l->nnode_all * dim; i++)
        u[i] = n * (1 + i % dim) * PetscSqr(line(dim, c.l->x + i / dim * dim));
      OK(FlowAcceptStep(c.flow, u, c.flow->p_old));
    }
    OK(PetscFree(u));
    make_anew(&c, to);
    OK(FlowBeginStep(c.flow, 2.5, 0.5));
    OK(FlowGetStep(c.flow, &s));
    assert_int_equal(s->order, 2);
    for (PetscInt i = 0; i < c.l->nnode_all * dim; i++)
      NEAR(c.flow->w[i], 2.5 * (1 + i % dim) * PetscSqr(line(dim, c.l->x + i / dim * dim)), 1e-10);
    close_case(&c);
  }
}

static void test_carried_conformation(void **state)
{
  Case      c;
  PetscReal from[3] = {0.3, 0.3, 0}, to[3] = {1.45, 0.62, 0}, *psi;

  (void)state;
  open_around(&c, 2, RELAXES, from);
  OK(FlowGetLogConformation(c.flow, &psi, NULL));
  for (PetscInt i = 0; i < c.l->nnode_all * 4; i++) psi[i] = (1 + i % 4) * 0.1 * line(2, c.l->x + i / 4 * 2);
  make_anew(&c, to);
  OK(FlowGetLogConformation(c.flow, &psi, NULL));
  for (PetscInt i = 0; i < c.l->nnode_all * 4; i++)
    NEAR(psi[i], (1 + i % 4) * 0.1 * line(2, c.l->x + i / 4 * 2), 1e-12);
  close_case(&c);
}

/* ---- viscosity ---- */

#define POWER "-flow_viscosity 0.3 -flow_rheology_viscosity_bounds 1e-9,1e9 -flow_rheology power_law "

/* Of g and of 1/g the mean viscosities have the product that they have at every point: neither end is favoured */
static void bent(const PetscReal x[], PetscReal v[])
{
  v[0] = 0.5 * PetscSqr(x[1] + 0.1);
  v[1] = 0;
}

static void test_mean_viscosity(void **state)
{
  Case             c[2];
  const PetscReal *cell[2], *node[2];

  (void)state;
  for (PetscInt k = 0; k < 2; k++) {
    open_case(&c[k],
              k ? POWER "-flow_rheology_index 1.8 -mesh_cells 2,2" : POWER "-flow_rheology_index 0.2 -mesh_cells 2,2");
    set_velocity(&c[k], bent);
    OK(FlowBeginStep(c[k].flow, 0.1, 0.1));
    OK(FlowGetViscosity(c[k].flow, &cell[k], &node[k]));
  }
  for (PetscInt i = 0; i < c[0].l->ncell_all; i++) NEAR(cell[0][i] * cell[1][i], 0.09, 1e-7);
  for (PetscInt i = 0; i < c[0].l->nnode; i++) NEAR(node[0][i] * node[1][i], 0.09, 1e-7);
  for (PetscInt k = 0; k < 2; k++) close_case(&c[k]);
}

/* Three of five cells along every axis are covered */
static void cover(Case *c, PetscBool covered[])
{
  PetscInt n = 0, *cell;

  OK(PetscMalloc1(c->l->ncell_all, &cell));
  for (PetscInt e = 0; e < c->l->ncell_all; e++) {
    covered[e] = PETSC_TRUE;
    for (PetscInt a = 0; a < c->dim; a++)
      covered[e] = (PetscBool)(covered[e] && PetscAbsReal(c->flow->cells.centre[e * c->dim + a] - 0.5) < 0.3);
    if (covered[e]) cell[n++] = e;
  }
  OK(FlowSetCutCells(c->flow, n, cell));
  OK(PetscFree(cell));
}

/* The place of quadrature point q of box e */
static void find_point(const Case *c, PetscInt e, PetscInt q, PetscReal x[3])
{
  PetscReal xc[MESH_MAX_NB * 3];

  OK(MeshCellCoordinates(c->mesh, e, xc));
  for (PetscInt a = 0; a < 3; a++) x[a] = 0;
  for (PetscInt j = 0; j < c->l->nb; j++)
    for (PetscInt a = 0; a < c->dim; a++)
      x[a] += c->flow->element.phi[q * c->flow->element.nbp + j] * xc[j * c->dim + a];
}

/* exp of a line beside a body goes on as one through the cells that it covers */
static void test_continued_viscosity(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    Case       c;
    PetscBool *covered;
    PetscReal  x[3];

    open_case(&c, dim == 2 ? POWER "-flow_rheology_index 0.5 -mesh_cells 5,5"
                           : POWER "-flow_rheology_index 0.5 -mesh_cells 5,5,5");
    OK(PetscMalloc1(c.l->ncell_all, &covered));
    cover(&c, covered);
    for (PetscInt e = 0; e < c.l->ncell_all; e++)
      for (PetscInt q = 0; q < c.flow->element.nq; q++) {
        find_point(&c, e, q, x);
        c.flow->viscosity.mu[e * c.flow->element.nq + q] = covered[e] ? 1e3 : PetscExpReal(0.2 * line(dim, x));
      }
    OK(ExtensionApply(c.flow));
    for (PetscInt e = 0; e < c.l->ncell_all; e++)
      for (PetscInt q = 0; q < c.flow->element.nq && covered[e]; q++) {
        find_point(&c, e, q, x);
        NEAR(PetscLogReal(c.flow->viscosity.mu[e * c.flow->element.nq + q]), 0.2 * line(dim, x), 1e-12);
      }
    OK(PetscFree(covered));
    close_case(&c);
  }
}

/* From node to node by a factor e at most, however steep it is beside: three nodes to the middle, not 6 a node */
static void test_steep_viscosity(void **state)
{
  Case       c;
  PetscBool *covered;
  PetscReal  x[3], top = 0;

  (void)state;
  open_case(&c, POWER "-flow_rheology_index 0.5 -mesh_cells 5,5");
  OK(PetscMalloc1(c.l->ncell_all, &covered));
  cover(&c, covered);
  for (PetscInt e = 0; e < c.l->ncell_all; e++)
    for (PetscInt q = 0; q < 9; q++) {
      find_point(&c, e, q, x);
      c.flow->viscosity.mu[e * 9 + q] = PetscExpReal(60 * PetscMin(0, PetscMin(x[0] - 0.2, 0.8 - x[0])));
    }
  OK(ExtensionApply(c.flow));
  for (PetscInt e = 0; e < c.l->ncell_all; e++)
    for (PetscInt q = 0; q < 9 && covered[e]; q++) top = PetscMax(top, PetscLogReal(c.flow->viscosity.mu[e * 9 + q]));
  top = largest(top);
  if (top < 1 || top > 3.1) fail_msg("the logarithm rises by %g, expected 1 to 3", (double)top);
  OK(PetscFree(covered));
  close_case(&c);
}

/* Held cells keep theirs while the fluid changes, free ones follow; the change that was wanted is told */
static void test_held_viscosity(void **state)
{
  Case             c;
  PetscBool       *covered;
  const PetscReal *cell;
  PetscReal        change, before = 0;
  PetscInt         at = -1;

  (void)state;
  open_case(&c, POWER "-flow_rheology_index 0.5 -mesh_cells 5,5");
  OK(PetscMalloc1(c.l->ncell_all, &covered));
  cover(&c, covered);
  for (PetscInt e = 0; e < c.l->ncell_all; e++) at = covered[e] ? e : at;
  for (PetscInt k = 0; k < 3; k++) {
    set_velocity(&c, shear);
    for (PetscInt i = 0; i < c.l->nnode_all * 2; i++) c.flow->u[i] *= k ? 4 : 1;
    OK(FlowSetCutViscosity(c.flow, k == 1 ? CUT_FROZEN : CUT_UPDATE, NULL));
    OK(FlowSetRheologyVelocity(c.flow, c.flow->u));
    OK(FlowGetViscosity(c.flow, &cell, NULL));
    if (at < 0) continue;
    if (!k) before = cell[at];
    else NEAR(cell[at], k == 1 ? before : 0.5 * before, 1e-8); /* mu ~ g^(-1/2) */
  }
  OK(FlowSetCutViscosity(c.flow, CUT_FROZEN, &change));
  assert_true(change > 0);
  OK(PetscFree(covered));
  close_case(&c);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_gaussian),
                                     cmocka_unit_test(test_travelling_box),
                                     cmocka_unit_test(test_shift),
                                     cmocka_unit_test(test_start_of_a_shear),
                                     cmocka_unit_test(test_turning),
                                     cmocka_unit_test(test_implicit_part),
                                     cmocka_unit_test(test_stretched),
                                     cmocka_unit_test(test_too_fast_for_it),
                                     cmocka_unit_test(test_carried_pressure),
                                     cmocka_unit_test(test_carried_mean),
                                     cmocka_unit_test(test_carried_velocity),
                                     cmocka_unit_test(test_carried_conformation),
                                     cmocka_unit_test(test_mean_viscosity),
                                     cmocka_unit_test(test_continued_viscosity),
                                     cmocka_unit_test(test_steep_viscosity),
                                     cmocka_unit_test(test_held_viscosity)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("transport", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
