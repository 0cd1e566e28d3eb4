/* Eddy: see eddy.h for the laws. Below them, what they add to the flow: viscosity at the quadrature points, and the
   stress that is not in the scalar operator. */
#include "compat.h"
#include "../impl.h"
#include "base/opt.h"

#define KAPPA      0.4 /* of the law of the wall, with B */
#define B          5.5
#define VAN_DRIEST 25  /* A+ */
#define FAR        500 /* y+ from where on there is no damping to speak of */
#define FAR_SPEED  21  /* u+ there */

/* ---- laws ---- */

static const char *const DAMPINGS[] = {"van_driest", "none", NULL};

PetscErrorCode FlowFindReach(PetscInt *reach)
{
  char      law[64];
  PetscBool looks;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-flow_rheology", law, sizeof(law)));
  PetscCall(PetscStrcasecmp(law, "smagorinsky", &looks));
  *reach = looks ? EDDY_REACH : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode EddyCreate(const char name[], Eddy *e)
{
  PetscInt damping = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscStrcmp(name, "wale", &e->wale));
  e->name     = name;
  e->constant = e->wale ? 0.5 : 0.1;
  e->filter   = 0.5;
  e->friction = 0;
  PetscCall(OptReal("-flow_les_constant", &e->constant));
  PetscCall(OptReal("-flow_les_filter", &e->filter));
  if (!e->wale) PetscCall(OptChoice("-flow_les_damping", DAMPINGS, &damping));
  e->damped = (PetscBool)(!e->wale && damping == 0);
  if (e->damped) PetscCall(OptReal("-flow_les_friction", &e->friction));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode EddyView(const Eddy *e, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer, "  large-eddy simulation: %s, constant %g, filter %g of a cell", e->name,
                                   (double)e->constant, (double)e->filter));
  if (e->damped && e->friction > 0)
    PetscCall(PetscViewerASCIIPrintf(viewer, ", damped at walls and bodies with the friction velocity %g",
                                     (double)e->friction));
  else if (e->damped)
    PetscCall(PetscViewerASCIIPrintf(viewer, ", damped at walls and bodies with the law of the wall"));
  PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal EddyRate(const Eddy *e, PetscReal g[3][3])
{
  PetscReal S2 = 0, Sd2 = 0, trace = 0, square[3][3], below;

  for (PetscInt a = 0; a < 3; a++)
    for (PetscInt b = 0; b < 3; b++) S2 += 0.25 * PetscSqr(g[a][b] + g[b][a]);
  if (!e->wale) return PetscSqrtReal(2 * S2);
  for (PetscInt a = 0; a < 3; a++)
    for (PetscInt b = 0; b < 3; b++) square[a][b] = g[a][0] * g[0][b] + g[a][1] * g[1][b] + g[a][2] * g[2][b];
  for (PetscInt a = 0; a < 3; a++) trace += square[a][a] / 3;
  for (PetscInt a = 0; a < 3; a++)
    for (PetscInt b = 0; b < 3; b++) Sd2 += PetscSqr(0.5 * (square[a][b] + square[b][a]) - (a == b ? trace : 0));
  below = S2 * S2 * PetscSqrtReal(S2) + Sd2 * PetscSqrtReal(PetscSqrtReal(Sd2));
  return below > 0 ? Sd2 * PetscSqrtReal(Sd2) / below : 0;
}

/* y+ at u+ and, if wanted, its slope */
static PetscReal spalding(PetscReal u, PetscReal *slope)
{
  const PetscReal k = KAPPA * u, e = PetscExpReal(k), c = PetscExpReal(-KAPPA * B);

  *slope = 1 + c * KAPPA * (e - 1 - k - 0.5 * k * k);
  return u + c * (e - 1 - k - 0.5 * k * k - k * k * k / 6);
}

/* u+ y+ = speed y/nu by Newton's method from above, where it is convex */
PetscReal EddyWallUnits(PetscReal speed, PetscReal y, PetscReal nu)
{
  const PetscReal product = speed * y / nu;
  PetscReal       u = PetscMin(PetscSqrtReal(product), FAR_SPEED), at = 0, slope;

  if (product >= FAR * FAR_SPEED) return FAR;
  if (u < 1e-3) return u; /* there is the sublayer alone */
  for (PetscInt i = 0; i < 50; i++) {
    PetscReal step;

    at   = spalding(u, &slope);
    step = (u * at - product) / (at + u * slope);
    u -= step;
    if (PetscAbsReal(step) < 1e-10 * u) break;
  }
  return PetscMin(at, FAR);
}

PetscReal EddyDamping(PetscReal y_plus)
{
  return -expm1(-y_plus / VAN_DRIEST);
}

/* ---- viscosity ---- */

typedef struct {
  void        *owner;
  FlowSurfaces find;
} Surface;

#define MAX_SURFACES 8 /* owners: rigid bodies, solids, drops ... */

typedef struct {
  Eddy     law;
  Walls    walls; /* NULL: not needed, or not yet */
  PetscInt nsurface;
  Surface  surface[MAX_SURFACES];
} Eddies;

static inline Eddies *eddies_of(const struct _p_Flow *f)
{
  return f->material_data;
}

/* Velocity gradients grad [a][b][q] at all quadrature points of a cell */
typedef PetscReal Gradients[3][3][ELEMENT_MAX_NQ];

static void find_gradients(const ElementTables *t, const ElementMetric *m, const PetscReal ul[], Gradients grad)
{
  const PetscInt dim = t->dim, n = t->nqp;
  PetscReal      ref[3][3][ELEMENT_MAX_NQ];

  for (PetscInt i = 0; i < 9; i++)
    for (PetscInt q = 0; q < n; q++) ref[i / 3][i % 3][q] = grad[i / 3][i % 3][q] = 0;
  for (PetscInt j = 0; j < t->nb; j++)
    for (PetscInt e = 0; e < dim; e++) {
      const PetscReal *restrict d = t->dphi_t + (j * dim + e) * n;

      for (PetscInt a = 0; a < dim; a++)
        for (PetscInt q = 0; q < n; q++) ref[a][e][q] += d[q] * ul[j * dim + a];
    }
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt b = 0; b < dim; b++)
      for (PetscInt e = 0; e < dim; e++)
        for (PetscInt q = 0; q < t->nq; q++) grad[a][b][q] += ref[a][e][q] * ElementInverse(m, q)[e * dim + b];
}

/* y+ at the quadrature points of cell c, of which the velocity is ul */
static PetscErrorCode find_wall_units(Flow f, PetscInt c, const PetscReal ul[], PetscReal y_plus[])
{
  const PetscInt  dim = f->loc->dim, nb = f->loc->nb, nq = f->element.nq;
  const PetscReal nu = f->par.viscosity / FlowDensity(f, c);
  const Eddies   *e  = eddies_of(f);
  PetscReal       y[ELEMENT_MAX_NQ], v[ELEMENT_MAX_NQ * 3];

  PetscFunctionBeginUser;
  for (PetscInt q = 0; q < nq; q++) y[q] = WallsDistance(e->walls, c, q, v + 3 * q);
  if (e->nsurface) {
    PetscReal xc[MESH_MAX_NB * 3], x[ELEMENT_MAX_NQ * 3];

    PetscCall(MeshCellCoordinates(f->mesh, c, xc));
    for (PetscInt i = 0; i < nq * dim; i++) {
      x[i] = 0;
      for (PetscInt j = 0; j < nb; j++) x[i] += f->element.phi[i / dim * f->element.nbp + j] * xc[j * dim + i % dim];
    }
    for (PetscInt s = 0; s < e->nsurface; s++)
      PetscCall((*e->surface[s].find)(e->surface[s].owner, EDDY_REACH * f->cells.size[c], nq, x, y, v));
  }
  for (PetscInt q = 0; q < nq; q++) {
    PetscReal speed = 0, u[3] = {0, 0, 0};

    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) u[a] += f->element.phi[q * f->element.nbp + j] * ul[j * dim + a];
    for (PetscInt a = 0; a < dim; a++) speed += PetscSqr(u[a] - v[3 * q + a]);
    if (y[q] == PETSC_MAX_REAL) y_plus[q] = FAR;
    else y_plus[q] = e->law.friction > 0 ? y[q] * e->law.friction / nu : EddyWallUnits(PetscSqrtReal(speed), y[q], nu);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update_cell(Flow f, PetscInt c)
{
  const PetscInt  nq    = f->element.nq;
  const Eddy     *law   = &eddies_of(f)->law;
  const PetscReal width = law->constant * law->filter * f->cells.size[c];
  PetscReal       ul[MESH_MAX_NB * 3], y_plus[ELEMENT_MAX_NQ], sum = 0, volume = 0, *mu = f->viscosity.mu + c * nq;
  ElementMetric   m;
  Gradients       grad;

  PetscFunctionBeginUser;
  MeshCellValues(f->loc, c, f->loc->dim, f->viscosity.velocity, ul);
  PetscCall(FlowCellMetric(f, c, &m));
  find_gradients(&f->element, &m, ul, grad);
  if (law->damped) PetscCall(find_wall_units(f, c, ul, y_plus));
  for (PetscInt q = 0; q < nq; q++) {
    PetscReal g[3][3], length = width;

    for (PetscInt i = 0; i < 9; i++) g[i / 3][i % 3] = grad[i / 3][i % 3][q];
    if (law->damped) length *= EddyDamping(y_plus[q]);
    mu[q] = FlowDensity(f, c) * length * length * EddyRate(law, g);
    sum += m.weight[q] * mu[q];
    volume += m.weight[q];
  }
  f->viscosity.cell[c] = sum / volume;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update(Flow f)
{
  Eddies *e = f->material_data;

  PetscFunctionBeginUser;
  if (f->viscosity.current) PetscFunctionReturn(PETSC_SUCCESS);
  if (e->law.damped && !e->walls) PetscCall(WallsCreate(f, &e->walls));
  if (e->walls) PetscCall(WallsUpdate(e->walls));
  for (PetscInt c = 0; c < f->loc->ncell_all; c++) {
    if (f->cells.det[c] == 0) { /* no cell of the fluid */
      f->viscosity.cell[c] = 0;
      PetscCall(PetscArrayzero(f->viscosity.mu + c * f->element.nq, f->element.nq));
    } else PetscCall(update_cell(f, c));
  }
  f->viscosity.current = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- stress ---- */

static void add_residual(Flow f, PetscInt c, const ElementMetric *m, const PetscReal ul[], PetscReal r[])
{
  const ElementTables *t   = &f->element;
  const PetscInt       dim = t->dim, nbp                              = t->nbp;
  PetscReal            before[MESH_MAX_NB * 3], R[3][ELEMENT_MAX_NBP] = {{0}};
  Gradients            now, old;

  if (f->cells.det[c] == 0) return;
  MeshCellValues(f->loc, c, f->loc->dim, f->viscosity.velocity, before);
  find_gradients(t, m, before, old);
  if (ul) find_gradients(t, m, ul, now);
  for (PetscInt q = 0; q < t->nq; q++) {
    const PetscReal *inverse = ElementInverse(m, q), scale = m->weight[q] * f->viscosity.mu[c * t->nq + q];

    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt e = 0; e < dim; e++) {
        const PetscReal *restrict d = t->dphi + (q * dim + e) * nbp;
        PetscReal s                 = 0;

        for (PetscInt b = 0; b < dim; b++)
          s += (old[b][a][q] - old[a][b][q] + (ul ? 2 * now[a][b][q] : 0)) * inverse[e * dim + b];
        s *= scale;
        for (PetscInt j = 0; j < nbp; j++) R[a][j] += s * d[j];
      }
  }
  for (PetscInt j = 0; j < t->nb; j++)
    for (PetscInt a = 0; a < dim; a++) r[j * dim + a] += R[a][j];
}

PetscErrorCode FlowGetEddies(Flow f, PetscReal nu[])
{
  const MeshLocal *l       = f->loc;
  const PetscReal *inertia = FlowInertia(f);

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(nu, l->nnode_all));
  if (f->material != &FLOW_EDDIES || !f->viscosity.current) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal     r[MESH_MAX_NB] = {0};
    ElementMetric m;

    PetscCall(FlowCellMetric(f, c, &m));
    for (PetscInt q = 0; q < f->element.nq; q++)
      for (PetscInt j = 0; j < l->nb; j++)
        r[j] += m.weight[q] * f->element.phi[q * f->element.nbp + j] * f->viscosity.mu[c * f->element.nq + q];
    MeshCellScatter(l, c, 1, r);
    for (PetscInt j = 0; j < l->nb; j++) nu[l->cell_node[c * l->nb + j]] += r[j];
  }
  PetscCall(MeshSumNodes(f->mesh, 1, nu));
  for (PetscInt i = 0; i < l->nnode; i++) nu[i] = f->cells.lumped[i] > 0 ? nu[i] / (f->par.density * inertia[i]) : 0;
  PetscCall(MeshSyncNodes(f->mesh, 1, nu));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal get_stress(const struct _p_Flow *f, PetscInt c, const ElementMetric *m, PetscInt q,
                            PetscReal grad[3][3], PetscReal extra[3][3])
{
  (void)m;
  (void)grad;
  (void)extra;
  return f->par.solvent + f->viscosity.mu[c * f->element.nq + q];
}

/* ---- surfaces ---- */

PetscBool FlowSeesSurfaces(Flow f)
{
  return (PetscBool)(f->material == &FLOW_EDDIES && eddies_of(f)->law.damped);
}

PetscErrorCode FlowSetSurfaces(Flow f, void *owner, FlowSurfaces find)
{
  Eddies  *e = eddies_of(f);
  PetscInt at;

  PetscFunctionBeginUser;
  if (!FlowSeesSurfaces(f)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(
    OwnersAssign(MAX_SURFACES, e->surface, sizeof(*e->surface), &e->nsurface, owner, (PetscBool)(find != NULL), &at));
  if (at >= 0) e->surface[at] = (Surface){owner, find};
  PetscFunctionReturn(PETSC_SUCCESS);
}

Walls FlowGetWalls(Flow f)
{
  return f->material == &FLOW_EDDIES ? eddies_of(f)->walls : NULL;
}

/* ---- life cycle ---- */

PetscErrorCode EddiesCreate(Flow f, const Eddy *law)
{
  Eddies *e;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&e));
  e->law           = *law;
  f->material_data = e;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode move(Flow f, PetscInt n, const PetscInt cells[])
{
  Eddies *e = f->material_data;

  PetscFunctionBeginUser;
  if (e->walls) PetscCall(WallsForget(e->walls, n, cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode remesh(Flow f, Mesh old)
{
  Eddies *e = f->material_data;

  PetscFunctionBeginUser;
  PetscCall(WallsDestroy(&e->walls));
  PetscCall(ViscosityRemesh(f, old));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Flow f)
{
  Eddies *e = f->material_data;

  PetscFunctionBeginUser;
  PetscCall(WallsDestroy(&e->walls));
  PetscCall(PetscFree(f->material_data));
  PetscCall(ViscosityDestroy(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode refuse_steady(Flow f)
{
  SETERRQ(f->comm, PETSC_ERR_SUP,
          "-flow_rheology %s models a flow that changes in time and has no steady state: remove -sim_steady (and -flow_initial steady), and run with -sim_dt",
          eddies_of(f)->law.name);
}

static PetscErrorCode view(Flow f, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(EddyView(&eddies_of(f)->law, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const FlowMaterial FLOW_EDDIES = {
  .name          = "large-eddy simulation",
  .matrix_free   = PETSC_TRUE,
  .varies        = PETSC_TRUE,
  .linear        = PETSC_TRUE,
  .factor        = 2,
  .create        = ViscosityCreate,
  .remesh        = remesh,
  .destroy       = destroy,
  .refuse_steady = refuse_steady,
  .outdate       = ViscosityOutdate,
  .move          = move,
  .update        = update,
  .residual      = add_residual,
  .scalar        = ViscosityScalar,
  .stress        = get_stress,
  .view          = view,
};
