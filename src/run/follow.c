/* Follow: see follow.h. */
#include "compat.h"
#include "follow.h"
#include "base/algebra.h"
#include "bodies/local.h"
#include "fem/element.h"

/* Integrals over what lies in the body, r from its centre: 1, r, u, r x u, r^2 1 - r r (xx yy zz xy xz yz) */
typedef struct {
  PetscReal volume, r[3], u[3], omega[3], inertia[6];
} Fluid;
#define NFLUID ((PetscInt)(sizeof(Fluid) / sizeof(PetscReal)))

static void add_point(const PetscReal r[3], const PetscReal u[3], PetscReal weight, Fluid *f)
{
  PetscReal s[3];

  cross(r, u, s);
  f->volume += weight;
  for (PetscInt a = 0; a < 3; a++) {
    f->r[a] += weight * r[a];
    f->u[a] += weight * u[a];
    f->omega[a] += weight * s[a];
  }
  add_point_inertia(weight, r, f->inertia);
}

/* Points of a lattice in cell c that lie in body k */
static PetscErrorCode add_cell(Mesh mesh, Bodies bodies, PetscInt k, PetscInt c, const PetscReal u[], Fluid *f)
{
  const PetscInt   n = 10; /* points an axis */
  const MeshLocal *l;
  BodyState       *s;
  PetscReal        xc[MESH_MAX_NB * 3], uc[MESH_MAX_NB * 3], shift[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(BodiesGetState(bodies, &s));
  PetscCall(MeshCellCoordinates(mesh, c, xc));
  MeshCellValues(l, c, l->dim, u, uc);
  for (PetscInt a = 0; a < l->dim; a++) {
    const PetscReal r = xc[(l->nb / 2) * l->dim + a] - s->x[k][a];

    shift[a] = MeshNearest(l, a, r) - r;
  }
  for (PetscInt i = 0; i < (l->dim == 2 ? n * n : n * n * n); i++) {
    const PetscInt at[3] = {i % n, i / n % n, i / n / n};
    PetscReal      xi[3], x[3], J[9], phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB], v[3] = {0, 0, 0}, r[3] = {0, 0, 0}, d;

    for (PetscInt a = 0; a < l->dim; a++) xi[a] = (2 * at[a] + 1) / (PetscReal)n - 1;
    ElementMap(l->dim, xc, xi, x, J);
    for (PetscInt a = 0; a < l->dim; a++) x[a] += shift[a];
    PetscCall(BodiesDistance(bodies, k, NULL, NULL, 1, x, &d));
    if (d > 0) continue;
    ElementBasis(l->dim, xi, phi, dphi);
    for (PetscInt a = 0; a < l->dim; a++) {
      r[a] = x[a] - s->x[k][a];
      for (PetscInt j = 0; j < l->nb; j++) v[a] += phi[j] * uc[j * l->dim + a];
    }
    add_point(r, v, DenseDeterminant(l->dim, J) * PetscPowRealInt(2. / n, (int)l->dim), f);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own cells with a node near body k; `reach`: half the diagonal of the largest cell */
static PetscErrorCode add_body(Mesh mesh, Bodies bodies, PetscInt k, PetscReal reach, PetscInt stamp[],
                               const PetscReal u[], Fluid *f)
{
  const MeshLocal *l;
  BodyState       *s;
  DomainImages     image = {0};
  PetscReal        half;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(BodiesGetState(bodies, &s));
  half = BodiesGetRadius(s, k) + reach;
  while (MeshNextImage(l, s->x[k], half, &image)) {
    const PetscInt *list;
    PetscInt        n;

    PetscCall(MeshNodesInBox(mesh, image.at, half, &n, &list));
    for (PetscInt i = 0; i < n; i++) {
      for (PetscInt e = l->node_cell_ptr[list[i]]; e < l->node_cell_ptr[list[i] + 1]; e++) {
        const PetscInt c = l->node_cell[e];

        if (c >= l->ncell || stamp[c] == k + 1) continue;
        stamp[c] = k + 1;
        PetscCall(add_cell(mesh, bodies, k, c, u, f));
      }
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A x = b for a symmetric A (xx yy zz xy xz yz), in the plane about z alone */
static void solve_rotation(PetscInt dim, const PetscReal A[6], const PetscReal b[3], PetscReal x[3])
{
  const PetscReal M[9] = {A[0], A[3], A[4], A[3], A[1], A[5], A[4], A[5], A[2]};

  x[0] = x[1] = 0;
  x[2]        = A[2] > 0 ? b[2] / A[2] : 0;
  if (dim == 3 && DenseDeterminant(3, M) > 0) solve3(M, b, x);
}

/* Velocity of the centre and angular velocity of the rigid motion with the momenta of f */
static void fit_motion(PetscInt dim, const Fluid *f, PetscReal u[3], PetscReal w[3])
{
  PetscReal mean[3], r[3], omega[3], arm[3];
  Fluid     centre = {0};

  for (PetscInt a = 0; a < 3; a++) {
    mean[a] = f->u[a] / f->volume;
    r[a]    = f->r[a] / f->volume;
  }
  add_point(r, mean, f->volume, &centre); /* Steiner */
  for (PetscInt a = 0; a < 3; a++) omega[a] = f->omega[a] - centre.omega[a];
  for (PetscInt i = 0; i < 6; i++) centre.inertia[i] = f->inertia[i] - centre.inertia[i];
  solve_rotation(dim, centre.inertia, omega, w);
  cross(w, r, arm);
  for (PetscInt a = 0; a < 3; a++) u[a] = mean[a] - arm[a];
}

static PetscErrorCode set_motion(Bodies bodies, PetscInt k, const Fluid *f)
{
  BodyState *s;
  PetscReal  u[3], w[3];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  PetscCheck(f->volume > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_initial_velocity fluid: the mesh has no point in body %" PetscInt_FMT
             ": refine it, or give the velocities",
             BodiesGetGroup(s, k)->name, s->number[k]);
  fit_motion(s->dim, f, u, w);
  for (PetscInt a = 0; a < 3; a++) {
    if (!BodiesIsFree(bodies, k, a) || BodiesGetGroup(s, k)->motion.has_pivot) u[a] = s->u[k][a];
    if (!BodiesIsFree(bodies, k, 3)) w[a] = s->w[k][a];
  }
  PetscCall(BodiesSetVelocity(bodies, k, u, w));
  PetscCall(BodiesStepVelocity(bodies, k, u, w)); /* the one before, too */
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StartWithFlow(Mesh mesh, Flow flow, Bodies bodies)
{
  const MeshLocal *l;
  BodyState       *s;
  PetscReal       *u, reach = 0;
  PetscInt        *stamp;
  Fluid           *fluid;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(BodiesMigrate(bodies, 0, 1)); /* every rank that a body reaches into is to know it */
  PetscCall(BodiesGetState(bodies, &s));
  PetscCall(FlowGetFields(flow, &u, NULL, NULL));
  PetscCall(PetscCalloc2(l->ncell, &stamp, s->n, &fluid));
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal xc[MESH_MAX_NB * 3], square = 0;

    PetscCall(MeshCellCoordinates(mesh, c, xc));
    for (PetscInt a = 0; a < l->dim; a++) square += PetscSqr(xc[(l->nb - 1) * l->dim + a] - xc[a]);
    reach = PetscMax(reach, 0.6 * PetscSqrtReal(square));
  }
  for (PetscInt k = 0; k < s->n; k++)
    if (BodiesGetGroup(s, k)->with_fluid) PetscCall(add_body(mesh, bodies, k, reach, stamp, u, &fluid[k]));
  PetscCall(BodiesSumLocal(bodies, NFLUID, (PetscReal *)fluid));
  for (PetscInt k = 0; k < s->n; k++)
    if (BodiesGetGroup(s, k)->with_fluid) PetscCall(set_motion(bodies, k, &fluid[k]));
  PetscCall(PetscFree2(stamp, fluid));
  PetscFunctionReturn(PETSC_SUCCESS);
}
