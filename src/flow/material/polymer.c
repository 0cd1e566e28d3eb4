/* Polymer: see polymer.h. */
#include "compat.h"
#include "polymer.h"
#include "base/opt.h"
#include "base/runcomm.h"

#define ITERATIONS 8 /* of Jacobi's method, which converges quadratically */

typedef PetscReal Tensor[3][3];

/* ---- tensors ---- */

static void unpack(PetscInt dim, const PetscReal v[], Tensor A)
{
  static const int COMPONENT[2][3][3] = {{{0, 2, -1}, {2, 1, -1}, {-1, -1, 3}}, {{0, 3, 4}, {3, 1, 5}, {4, 5, 2}}};

  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++) A[a][b] = COMPONENT[dim - 2][a][b] < 0 ? 0 : v[COMPONENT[dim - 2][a][b]];
}

static void pack(PetscInt dim, Tensor A, PetscReal v[])
{
  v[0] = A[0][0];
  v[1] = A[1][1];
  v[2] = dim == 2 ? A[0][1] : A[2][2];
  v[3] = dim == 2 ? A[2][2] : A[0][1];
  if (dim == 2) return;
  v[4] = A[0][2];
  v[5] = A[1][2];
}

/* A is turned by its elements (p, q) to zero there: A <- J^T A J, R <- R J (Golub & Van Loan, section 8.5) */
static void turn(int p, int q, Tensor A, Tensor R)
{
  const PetscReal half = 0.5 * (A[q][q] - A[p][p]), off = A[p][q];
  const PetscReal root = PetscSqrtReal(half * half + off * off), t = off / (half >= 0 ? half + root : half - root);
  const PetscReal c = 1 / PetscSqrtReal(1 + t * t), s = t * c;

  for (int k = 0; k < 3; k++) {
    const PetscReal x = A[k][p], y = A[k][q], u = R[k][p], v = R[k][q];

    A[k][p] = c * x - s * y;
    A[k][q] = s * x + c * y;
    R[k][p] = c * u - s * v;
    R[k][q] = s * u + c * v;
  }
  for (int k = 0; k < 3; k++) {
    const PetscReal x = A[p][k], y = A[q][k];

    A[p][k] = c * x - s * y;
    A[q][k] = s * x + c * y;
  }
}

/* psi = R diag(value) R^T */
static void decompose(PetscInt dim, const PetscReal psi[], PetscReal value[3], Tensor R)
{
  Tensor A;

  unpack(dim, psi, A);
  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++) R[a][b] = a == b;
  for (int iteration = 0; iteration < (dim == 2 ? 1 : ITERATIONS); iteration++) {
    const PetscReal size = A[0][0] * A[0][0] + A[1][1] * A[1][1] + A[2][2] * A[2][2];
    const PetscReal off  = A[0][1] * A[0][1] + A[0][2] * A[0][2] + A[1][2] * A[1][2];

    if (off <= 1e-32 * size) break;
    for (int p = 0; p < 2; p++)
      for (int q = p + 1; q < 3; q++)
        if (A[p][q] != 0) turn(p, q, A, R);
  }
  for (int a = 0; a < 3; a++) value[a] = A[a][a];
}

/* B = R A R^T, or R^T A R */
static void rotate(Tensor R, Tensor A, PetscBool back, Tensor B)
{
  Tensor T = {{0}};

  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++)
      for (int k = 0; k < 3; k++) T[a][b] += (back ? R[k][a] : R[a][k]) * A[k][b];
  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++) {
      B[a][b] = 0;
      for (int k = 0; k < 3; k++) B[a][b] += T[a][k] * (back ? R[k][b] : R[b][k]);
    }
}

/* x/(exp(x) - 1) */
static PetscReal bernoulli(PetscReal x)
{
  return PetscAbsReal(x) < 1e-4 ? 1 - 0.5 * x + x * x / 12 : x / expm1(x);
}

/* ---- laws ---- */

/* f of FENE-P, 1 for the others; not positive: beyond the extensibility */
static PetscReal spring(const Polymer *p, PetscReal trace)
{
  return p->extensibility > 0 ? (p->extensibility - 3) / (p->extensibility - trace) : 1;
}

void PolymerRate(const Polymer *p, PetscInt dim, const PetscReal psi[], PetscReal L[3][3], PetscReal rate[],
                 PetscReal *speed)
{
  PetscReal value[3], c[3], trace = 0, size = 0, relax = 0, f;
  Tensor    R, M, S;

  decompose(dim, psi, value, R);
  rotate(R, L, PETSC_TRUE, M);
  for (int i = 0; i < 3; i++) {
    c[i] = PetscExpReal(value[i]);
    trace += c[i];
    for (int j = 0; j < 3; j++) size += L[i][j] * L[i][j];
  }
  f = spring(p, trace);
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++)
      S[i][j] = M[i][j] * bernoulli(value[i] - value[j]) + M[j][i] * bernoulli(value[j] - value[i]);
    S[i][i] -= (f - 1 / c[i]) * (1 + p->mobility * (c[i] - 1)) / p->time;
    relax = PetscMax(relax, 1 / c[i] + p->mobility * c[i]);
  }
  if (p->extensibility > 0) relax += f * trace / (p->extensibility - trace);
  rotate(R, S, PETSC_FALSE, M);
  pack(dim, M, rate);
  *speed = f > 0 ? PetscSqrtReal(size) + relax / p->time : -1;
}

void PolymerConformation(PetscInt dim, const PetscReal psi[], PetscReal c[3][3])
{
  PetscReal value[3];
  Tensor    R, C = {{0}};

  decompose(dim, psi, value, R);
  for (int i = 0; i < 3; i++) C[i][i] = PetscExpReal(value[i]);
  rotate(R, C, PETSC_FALSE, c);
}

void PolymerStiffness(const Polymer *p, PetscInt dim, const PetscReal psi[], PetscReal c[3][3])
{
  PetscReal f;

  PolymerConformation(dim, psi, c);
  f = spring(p, c[0][0] + c[1][1] + c[2][2]);
  for (int i = 0; i < 9; i++) c[i / 3][i % 3] *= f;
}

void PolymerStress(const Polymer *p, PetscInt dim, const PetscReal psi[], PetscReal tau[3][3])
{
  PolymerStiffness(p, dim, psi, tau);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) tau[i][j] = p->viscosity / p->time * (tau[i][j] - (i == j));
}

void PolymerState(const Polymer *p, PetscInt dim, const PetscReal psi[], PetscReal *energy, PetscReal *trace,
                  PetscReal *c_min)
{
  PetscReal value[3], c[3], sum, stored;
  Tensor    R;

  decompose(dim, psi, value, R);
  for (int i = 0; i < 3; i++) c[i] = PetscExpReal(value[i]);
  sum    = c[0] + c[1] + c[2];
  stored = p->extensibility > 0 ? (p->extensibility - 3) * PetscLogReal(spring(p, sum)) : sum - 3;
  if (energy) *energy = 0.5 * p->viscosity / p->time * (stored - value[0] - value[1] - value[2]);
  if (trace) *trace = sum;
  if (c_min) *c_min = PetscMin(c[0], PetscMin(c[1], c[2]));
}

/* ---- options ---- */

static const char *const IMPLICIT[] = {"auto", "none", "rest", "stretched", NULL};

static PetscErrorCode require(const char name[], const char option[], const char example[])
{
  PetscBool given;

  PetscFunctionBeginUser;
  PetscCall(OptHas(option, &given));
  PetscCheck(given, RunComm(), PETSC_ERR_USER_INPUT,
             "Option -flow_rheology %s needs %s, such as %s: give it, or use -flow_rheology newton", name, option,
             example);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PolymerCreate(const char name[], PetscReal viscosity, PetscReal time, Polymer *p)
{
  PetscReal fraction = 0;
  PetscBool giesekus, fene;

  PetscFunctionBeginUser;
  *p = (Polymer){.name = name, .time = time};
  PetscCall(require(name, "-flow_rheology_time", "1 (the relaxation time)"));
  PetscCall(require(name, "-flow_rheology_solvent", "0.5 (the solvent's share of -flow_viscosity)"));
  PetscCall(OptReal("-flow_rheology_solvent", &fraction));
  PetscCheck(fraction < 1, RunComm(), PETSC_ERR_USER_INPUT,
             "Option -flow_rheology_solvent %g leaves nothing of -flow_viscosity to the polymer: lower it below 1, or use -flow_rheology newton",
             (double)fraction);
  p->solvent   = fraction * viscosity;
  p->viscosity = viscosity - p->solvent;
  PetscCall(PetscStrcmp(name, "giesekus", &giesekus));
  PetscCall(PetscStrcmp(name, "fene_p", &fene));
  if (giesekus) PetscCall(require(name, "-flow_rheology_mobility", "0.2"));
  if (giesekus) PetscCall(OptReal("-flow_rheology_mobility", &p->mobility));
  if (fene) PetscCall(require(name, "-flow_rheology_extensibility", "100 (the square of the largest extension)"));
  if (fene) PetscCall(OptReal("-flow_rheology_extensibility", &p->extensibility));
  PetscCall(OptChoice("-flow_rheology_implicit", IMPLICIT, &p->implicit));
  PetscCall(OptReal("-flow_rheology_devss", &p->devss));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PolymerView(const Polymer *p, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer,
                                   "  rheology: %s, relaxation time %g, viscosity of the solvent %g, of the polymer %g",
                                   p->name, (double)p->time, (double)p->solvent, (double)p->viscosity));
  if (p->mobility > 0) PetscCall(PetscViewerASCIIPrintf(viewer, ", mobility %g", (double)p->mobility));
  if (p->extensibility > 0) PetscCall(PetscViewerASCIIPrintf(viewer, ", extensibility %g", (double)p->extensibility));
  PetscCall(PetscViewerASCIIPrintf(viewer, "; logarithm of the conformation at the nodes\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}
