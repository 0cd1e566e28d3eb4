/* Laws of viscoelastic fluids at a point: the conformation against exact solutions in steady and in starting flows, in
   any frame, positive whatever it is the exponential of, and the balance of its energy. */
#include "core.h"
#include "material/polymer.h"

typedef PetscReal Tensor[3][3];

#define G  0.8 /* modulus: viscosity over time */
#define LT 2.5 /* relaxation time */
static const Polymer        OLDROYD  = {.name = "oldroyd_b", .viscosity = G * LT, .time = LT};
static const Polymer        GIESEKUS = {.name = "giesekus", .viscosity = G * LT, .time = LT, .mobility = 0.2};
static const Polymer        FENE     = {.name = "fene_p", .viscosity = G * LT, .time = LT, .extensibility = 30};
static const Polymer *const FLUID[]  = {&OLDROYD, &GIESEKUS, &FENE};

static void multiply(Tensor A, Tensor B, Tensor C)
{
  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++) C[a][b] = A[a][0] * B[0][b] + A[a][1] * B[1][b] + A[a][2] * B[2][b];
}

/* A frame: in the plane turned by an angle, in space out of all planes */
static void set_frame(PetscInt dim, Tensor R)
{
  const PetscReal t = 0.7, s = dim == 3 ? 1.9 : 0;
  Tensor          P = {{cos(t), -sin(t), 0}, {sin(t), cos(t), 0}, {0, 0, 1}},
         Q          = {{1, 0, 0}, {0, cos(s), -sin(s)}, {0, sin(s), cos(s)}};

  multiply(P, Q, R);
}

/* B = R A R^T */
static void turn(Tensor R, Tensor A, Tensor B)
{
  Tensor T;

  multiply(R, A, T);
  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++) {
      B[a][b] = 0;
      for (int k = 0; k < 3; k++) B[a][b] += T[a][k] * R[b][k];
    }
}

static void pack(PetscInt dim, Tensor A, PetscReal v[])
{
  const PetscReal plane[4] = {A[0][0], A[1][1], A[0][1], A[2][2]},
                  space[6] = {A[0][0], A[1][1], A[2][2], A[0][1], A[0][2], A[1][2]};

  for (int k = 0; k < 2 * dim; k++) v[k] = dim == 2 ? plane[k] : space[k];
}

static void invert(Tensor A, Tensor B)
{
  PetscReal det = 0;

  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++) {
      const int i = (b + 1) % 3, j = (b + 2) % 3, k = (a + 1) % 3, l = (a + 2) % 3;

      B[a][b] = A[i][k] * A[j][l] - A[i][l] * A[j][k];
    }
  for (int k = 0; k < 3; k++) det += A[0][k] * B[k][0];
  for (int e = 0; e < 9; e++) B[e / 3][e % 3] /= det;
}

/* A = A^(1/2) by the iteration of Denman and Beavers */
static void take_root(Tensor A)
{
  Tensor Z = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, P, Q;

  for (int it = 0; it < 40; it++) {
    invert(A, P);
    invert(Z, Q);
    for (int e = 0; e < 9; e++) {
      A[e / 3][e % 3] = 0.5 * (A[e / 3][e % 3] + Q[e / 3][e % 3]);
      Z[e / 3][e % 3] = 0.5 * (Z[e / 3][e % 3] + P[e / 3][e % 3]);
    }
  }
}

#define ROOTS 6

/* psi = log c: log X = 2 artanh((X - 1)/(X + 1)) of its 64th root X */
static void take_log(PetscInt dim, Tensor c, PetscReal psi[])
{
  Tensor X, more, less, inverse, E, square, power, next, log = {{0}};

  memcpy(X, c, sizeof(X));
  for (int k = 0; k < ROOTS; k++) take_root(X);
  for (int e = 0; e < 9; e++) {
    more[e / 3][e % 3] = X[e / 3][e % 3] + (e % 4 == 0);
    less[e / 3][e % 3] = X[e / 3][e % 3] - (e % 4 == 0);
  }
  invert(more, inverse);
  multiply(less, inverse, E);
  multiply(E, E, square);
  memcpy(power, E, sizeof(power));
  for (int n = 1; n < 16; n += 2) {
    for (int e = 0; e < 9; e++) log[e / 3][e % 3] += 2. * (1 << ROOTS) / n * power[e / 3][e % 3];
    multiply(power, square, next);
    memcpy(power, next, sizeof(power));
  }
  pack(dim, log, psi);
}

static PetscReal factor(const Polymer *p, Tensor c)
{
  return p->extensibility > 0 ? (p->extensibility - 3) / (p->extensibility - c[0][0] - c[1][1] - c[2][2]) : 1;
}

/* c stays as it is under the velocity gradient L, and has the stress that belongs to it; in two frames */
static void check_steady(const Polymer *p, Tensor c, Tensor L)
{
  for (PetscInt i = 0; i < 4; i++) {
    const PetscInt dim = 2 + i / 2;
    Tensor         R   = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, d, M, got, tau;
    PetscReal      psi[6], rate[6], speed, f = factor(p, c);

    if (i % 2) set_frame(dim, R);
    turn(R, c, d);
    turn(R, L, M);
    take_log(dim, d, psi);
    PolymerRate(p, dim, psi, M, rate, &speed);
    for (int k = 0; k < 2 * dim; k++) BELOW(rate[k], 1e-12 * speed);
    PolymerConformation(dim, psi, got);
    PolymerStress(p, dim, psi, tau);
    for (int a = 0; a < 3; a++)
      for (int b = 0; b < 3; b++) {
        NEAR(got[a][b], d[a][b], 1e-12 * c[0][0]);
        NEAR(tau[a][b], G * (f * d[a][b] - (a == b)), 1e-12 * f * c[0][0]);
      }
  }
}

#define SHEAR(rate) \
  { \
    {0, (rate), 0}, {0, 0, 0}, \
    { \
      0, 0, 0 \
    } \
  }

static void test_oldroyd_in_shear(void **state)
{
  (void)state;
  for (PetscReal W = 0.1; W < 20; W *= 3) { /* Weissenberg number */
    Tensor c = {{1 + 2 * W * W, W, 0}, {W, 1, 0}, {0, 0, 1}}, L = SHEAR(W / LT);

    check_steady(&OLDROYD, c, L);
  }
}

/* Plane extension: c = 1/(1 -+ 2 W); at W = 1/2 it would grow for ever */
static void test_oldroyd_in_extension(void **state)
{
  (void)state;
  for (PetscInt i = 1; i < 5; i++) {
    const PetscReal W = 0.1 * i;
    Tensor          c = {{1 / (1 - 2 * W), 0, 0}, {0, 1 / (1 + 2 * W), 0}, {0, 0, 1}},
           L          = {{W / LT, 0, 0}, {0, -W / LT, 0}, {0, 0, 0}};

    check_steady(&OLDROYD, c, L);
  }
}

/* Giesekus, J. Non-Newtonian Fluid Mech. 11, 1982: by n_2 = -N_2/G */
static void test_giesekus_in_shear(void **state)
{
  const PetscReal a = GIESEKUS.mobility;

  (void)state;
  for (PetscReal W = 0.1; W < 20; W *= 3) {
    const PetscReal x = PetscSqrtReal((PetscSqrtReal(1 + 16 * a * (1 - a) * W * W) - 1) / (8 * a * (1 - a) * W * W));
    const PetscReal n = (1 - x) / (1 + (1 - 2 * a) * x), xy = W * PetscSqr(1 - n) / (1 + (1 - 2 * a) * n);
    const PetscReal first = 2 * n * (1 - a * n) / (a * (1 - n)); /* N_1/G */
    Tensor          c = {{1 - n + first, xy, 0}, {xy, 1 - n, 0}, {0, 0, 1}}, L = SHEAR(W / LT);

    check_steady(&GIESEKUS, c, L);
  }
}

/* Along each axis by itself: a c^2 + (1 - 2 a -+ 2 W) c = 1 - a */
static void test_giesekus_in_extension(void **state)
{
  const PetscReal a = GIESEKUS.mobility;

  (void)state;
  for (PetscReal W = 0.1; W < 20; W *= 3) {
    PetscReal x[3];

    for (int k = 0; k < 3; k++) {
      const PetscReal b = 1 - 2 * a - 2 * W * (k == 0 ? 1 : k == 1 ? -1 : 0);

      x[k] = (-b + PetscSqrtReal(b * b + 4 * a * (1 - a))) / (2 * a);
    }
    Tensor c = {{x[0], 0, 0}, {0, x[1], 0}, {0, 0, x[2]}}, L = {{W / LT, 0, 0}, {0, -W / LT, 0}, {0, 0, 0}};

    check_steady(&GIESEKUS, c, L);
  }
}

/* c_yy = c_zz = 1/f, c_xy = W/f^2, c_xx = 1/f + 2 W^2/f^3, with f by bisection: trace < extensibility */
static void test_fene_in_shear(void **state)
{
  const PetscReal b = FENE.extensibility;

  (void)state;
  for (PetscReal W = 0.1; W < 40; W *= 3) {
    PetscReal lo = 1, hi = 1e6, f = 1;

    for (int it = 0; it < 200; it++) {
      f = 0.5 * (lo + hi);
      if (f * (b - 3 / f - 2 * W * W / (f * f * f)) > b - 3) hi = f;
      else lo = f;
    }
    Tensor c = {{1 / f + 2 * W * W / (f * f * f), W / (f * f), 0}, {W / (f * f), 1 / f, 0}, {0, 0, 1 / f}},
           L = SHEAR(W / LT);

    check_steady(&FENE, c, L);
  }
}

/* At rest nothing; at once c follows the rate of strain alone */
static void test_rest(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++)
    for (PetscInt i = 0; i < 3; i++) {
      PetscReal psi[6] = {0}, rate[6], speed, energy, trace, least, want[6];
      Tensor    still = {{0}}, L = {{0.3, -1.1, 0}, {0.4, -0.3, 0}, {0, 0, 0}}, D, tau;

      PolymerRate(FLUID[i], dim, psi, still, rate, &speed);
      for (int k = 0; k < 2 * dim; k++) BELOW(rate[k], 1e-15);
      PolymerStress(FLUID[i], dim, psi, tau);
      for (int k = 0; k < 9; k++) BELOW(tau[k / 3][k % 3], 1e-15);
      PolymerState(FLUID[i], dim, psi, &energy, &trace, &least);
      BELOW(energy, 1e-15);
      NEAR(trace, 3, 1e-15);
      NEAR(least, 1, 1e-15);
      PolymerRate(FLUID[i], dim, psi, L, rate, &speed);
      for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) D[a][b] = L[a][b] + L[b][a];
      pack(dim, D, want);
      for (int k = 0; k < 2 * dim; k++) NEAR(rate[k], want[k], 1e-14);
    }
}

/* From psi over a time by the classical Runge-Kutta method; L is uniform */
static void integrate(const Polymer *p, PetscInt dim, Tensor L, PetscReal time, PetscInt n, PetscReal psi[])
{
  static const PetscReal part[4] = {0, 0.5, 0.5, 1}, weight[4] = {1. / 6, 1. / 3, 1. / 3, 1. / 6};

  for (PetscInt step = 0; step < n; step++) {
    PetscReal k[4][6], at[6], speed, h = time / n;

    for (int s = 0; s < 4; s++) {
      for (int e = 0; e < 2 * dim; e++) at[e] = psi[e] + (s ? part[s] * h * k[s - 1][e] : 0);
      PolymerRate(p, dim, at, L, k[s], &speed);
    }
    for (int s = 0; s < 4; s++)
      for (int e = 0; e < 2 * dim; e++) psi[e] += weight[s] * h * k[s][e];
  }
}

/* A shear that starts: c_xy = W (1 - e^-t), c_xx = 1 + 2 W^2 (1 - (1 + t) e^-t), t in relaxation times */
static void test_start_of_a_shear(void **state)
{
  const PetscReal W = 2, e = PetscExpReal(-1.5);
  Tensor          L = SHEAR(W / LT), c;

  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    PetscReal psi[6] = {0};

    integrate(&OLDROYD, dim, L, 1.5 * LT, 200, psi);
    PolymerConformation(dim, psi, c);
    NEAR(c[0][1], W * (1 - e), 1e-7);
    NEAR(c[0][0], 1 + 2 * W * W * (1 - 2.5 * e), 1e-7);
    NEAR(c[1][1], 1, 1e-7);
    NEAR(c[2][2], 1, 1e-14);
  }
}

/* Left alone: c - 1 falls as e^-t in Oldroyd's fluid, whatever it was */
static void test_relaxation(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    Tensor    R, c = {{5, 0, 0}, {0, 0.3, 0}, {0, 0, dim == 2 ? 1 : 2}}, d, still = {{0}}, got;
    PetscReal psi[6];

    set_frame(dim, R);
    turn(R, c, d);
    take_log(dim, d, psi);
    integrate(&OLDROYD, dim, still, LT, 100, psi);
    PolymerConformation(dim, psi, got);
    for (int k = 0; k < 9; k++)
      NEAR(got[k / 3][k % 3], (k % 4 == 0) + (d[k / 3][k % 3] - (k % 4 == 0)) * PetscExpReal(-1), 1e-8);
  }
}

/* A rigid rotation takes c along */
static void test_rotation(void **state)
{
  Polymer p = OLDROYD;

  (void)state;
  p.time = 1e12;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    Tensor c = {{5, 0.4, 0}, {0.4, 0.3, 0}, {0, 0, dim == 2 ? 1 : 2}}, L = {{0, -1, 0}, {1, 0, 0}, {0, 0, 0}}, d, got;
    PetscReal psi[6], t                                                  = 2;

    Tensor Q = {{cos(t), -sin(t), 0}, {sin(t), cos(t), 0}, {0, 0, 1}};

    take_log(dim, c, psi);
    integrate(&p, dim, L, t, 200, psi);
    PolymerConformation(dim, psi, got);
    turn(Q, c, d);
    for (int k = 0; k < 9; k++) NEAR(got[k / 3][k % 3], d[k / 3][k % 3], 1e-7);
  }
}

/* The free energy W = G/2 (...) grows by the power of the stress less what relaxation dissipates:
   dW/dt = tau : L - G/(2 time) tr((f - c^-1) (f c - 1) (1 + a (c - 1))), in any frame */
static void test_energy(void **state)
{
  (void)state;
  for (PetscInt i = 0; i < 6; i++) {
    const Polymer  *p   = FLUID[i / 2];
    const PetscInt  dim = 2 + i % 2;
    const PetscReal h   = 1e-5;
    Tensor          R, c = {{6, 0, 0}, {0, 0.4, 0}, {0, 0, dim == 2 ? 1.1 : 2.2}}, d,
              L = {{0.3, -1.1, 0}, {0.4, -0.3, 0}, {0, 0, 0}}, tau;
    PetscReal psi[6], rate[6], speed, power = 0, lost = 0, energy[2], f = factor(p, c);

    set_frame(dim, R);
    turn(R, c, d);
    take_log(dim, d, psi);
    PolymerRate(p, dim, psi, L, rate, &speed);
    PolymerStress(p, dim, psi, tau);
    for (int k = 0; k < 9; k++) power += tau[k / 3][k % 3] * L[k / 3][k % 3];
    for (int k = 0; k < 3; k++)
      lost += G / (2 * LT) * (f - 1 / c[k][k]) * (f * c[k][k] - 1) * (1 + p->mobility * (c[k][k] - 1));
    for (int s = 0; s < 2; s++) {
      PetscReal at[6];

      for (int k = 0; k < 2 * dim; k++) at[k] = psi[k] + (s ? h : -h) * rate[k];
      PolymerState(p, dim, at, &energy[s], NULL, NULL);
    }
    NEAR((energy[1] - energy[0]) / (2 * h), power - lost, 1e-8);
    assert_true(lost > 0);
  }
}

/* Whatever psi is, c is positive, with the determinant e^(tr psi); stress symmetric */
static void test_positive(void **state)
{
  (void)state;
  for (PetscInt i = 0; i < 40; i++) {
    const PetscInt dim = 2 + i % 2;
    PetscReal      psi[6], trace, least, det, sum = 0;
    Tensor         c, tau;

    for (int k = 0; k < 2 * dim; k++) psi[k] = (i < 20 ? 1 : 6) * noise(10 * i + k);
    for (int k = 0; k < 3; k++) sum += dim == 3 ? psi[k] : psi[k == 2 ? 3 : k];
    PolymerConformation(dim, psi, c);
    PolymerState(&OLDROYD, dim, psi, NULL, &trace, &least);
    PolymerStress(&OLDROYD, dim, psi, tau);
    det = c[0][0] * (c[1][1] * c[2][2] - c[1][2] * c[2][1]) - c[0][1] * (c[1][0] * c[2][2] - c[1][2] * c[2][0]) +
          c[0][2] * (c[1][0] * c[2][1] - c[1][1] * c[2][0]);
    assert_true(least > 0);
    NEAR(trace, c[0][0] + c[1][1] + c[2][2], 1e-12 * trace);
    NEAR(det, PetscExpReal(sum), 1e-12 * trace * trace * trace);
    for (int k = 0; k < 9; k++) NEAR(tau[k / 3][k % 3], tau[k % 3][k / 3], 1e-13 * trace);
  }
}

/* Beyond its extensibility the fluid is not known, and says so; just below it is very stiff */
static void test_extensibility(void **state)
{
  PetscReal psi[4] = {PetscLogReal(28.5), 0, 0, 0}, rate[4], speed, energy;
  Tensor    still  = {{0}}, c;

  (void)state;
  PolymerRate(&FENE, 2, psi, still, rate, &speed); /* trace 30.5 */
  assert_true(speed < 0);
  psi[0] = PetscLogReal(27.9); /* 29.9: f = 27/0.1 */
  PolymerRate(&FENE, 2, psi, still, rate, &speed);
  assert_true(speed > 0);
  PolymerStiffness(&FENE, 2, psi, c);
  NEAR(c[0][0], 270 * 27.9, 1e-8);
  PolymerState(&FENE, 2, psi, &energy, NULL, NULL);
  NEAR(energy, 0.5 * G * (27 * PetscLogReal(270) - psi[0]), 1e-10);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] =
    {cmocka_unit_test(test_oldroyd_in_shear),  cmocka_unit_test(test_oldroyd_in_extension),
     cmocka_unit_test(test_giesekus_in_shear), cmocka_unit_test(test_giesekus_in_extension),
     cmocka_unit_test(test_fene_in_shear),     cmocka_unit_test(test_rest),
     cmocka_unit_test(test_start_of_a_shear),  cmocka_unit_test(test_relaxation),
     cmocka_unit_test(test_rotation),          cmocka_unit_test(test_energy),
     cmocka_unit_test(test_positive),          cmocka_unit_test(test_extensibility)};
  int failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("polymer", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
