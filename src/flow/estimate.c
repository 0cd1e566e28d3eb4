/* Flow, estimate: where a steady solution is wrong (FlowEstimate of flow.h).

   Of a cell with size h: eta^2 = h^2/mu int |rho u.grad u - div sigma - f|^2 + h/mu int over its surface |sigma -
   s|^2, s the mean at a node of the stresses of the cells around it (Verfuerth, A Posteriori Error Estimation
   Techniques, 2013, in which the second term is the jump between two cells). With elements of even degree the first
   term is the larger one (Yu, Math. Numer. Sinica 13, 1991). The stress in a cell is taken at its lattice points; its
   divergence is that of the polynomial through them, exact in parallelograms. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"

typedef struct {
  Flow             f;
  const MeshLocal *l;
  const PetscReal *u, *p; /* p by value and gradient [ncell][dim + 1] */
  PetscInt         ns;    /* components of a stress, dim^2 */
} Estimate;

/* Of one cell, at its lattice points */
typedef struct {
  PetscReal x[MESH_MAX_NB * 3], u[MESH_MAX_NB * 3], source[MESH_MAX_NB * 3], stress[MESH_MAX_NB * 9], h;
} CellFields;

static void set_lattice_point(PetscInt dim, PetscInt j, PetscReal xi[3])
{
  const PetscInt at[3] = {j % 3, j / 3 % 3, j / 9};

  for (PetscInt a = 0; a < dim; a++) xi[a] = (PetscReal)(at[a] - 1);
}

/* Derivatives in space g [nb][dim] of the basis at xi */
static void gradients(PetscInt dim, PetscInt nb, const PetscReal xc[], const PetscReal xi[], PetscReal g[])
{
  PetscReal J[9], inverse[9], x[3], phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB];

  ElementBasis(dim, xi, phi, dphi);
  ElementMap(dim, xc, xi, x, J);
  (void)DenseInvertMap(dim, J, inverse);
  for (PetscInt j = 0; j < nb; j++)
    for (PetscInt a = 0; a < dim; a++) {
      g[j * dim + a] = 0;
      for (PetscInt e = 0; e < dim; e++) g[j * dim + a] += dphi[e * nb + j] * inverse[e * dim + a];
    }
}

static PetscErrorCode gather(const Estimate *e, PetscInt c, CellFields *cell)
{
  const MeshLocal *l  = e->l;
  const PetscInt   nb = l->nb, dim = l->dim;
  const PetscReal *p = e->p + c * (dim + 1), mu = e->f->par.viscosity, *centre;

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(e->f->mesh, c, cell->x));
  MeshCellValues(l, c, l->dim, e->u, cell->u);
  if (e->f->force.source) MeshCellValues(l, c, l->dim, e->f->force.source, cell->source);
  centre  = cell->x + (nb / 2) * dim;
  cell->h = e->f->cells.size[c];
  for (PetscInt j = 0; j < nb; j++) {
    PetscReal xi[3], g[3 * MESH_MAX_NB], *s = cell->stress + j * e->ns, pressure = p[0];

    set_lattice_point(dim, j, xi);
    gradients(dim, nb, cell->x, xi, g);
    for (PetscInt a = 0; a < dim; a++) pressure += p[1 + a] * (cell->x[j * dim + a] - centre[a]);
    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt b = 0; b < dim; b++) {
        s[a * dim + b] = a == b ? -pressure : 0;
        for (PetscInt i = 0; i < nb; i++)
          s[a * dim + b] += mu * (g[i * dim + b] * cell->u[i * dim + a] + g[i * dim + a] * cell->u[i * dim + b]);
      }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mean stress of the cells of the fluid at every node, mean [nnode_all][ns + 1], last their number */
static PetscErrorCode average(const Estimate *e, const PetscBool fluid[], PetscReal mean[])
{
  const MeshLocal *l  = e->l;
  const PetscInt   bs = e->ns + 1;
  CellFields       cell;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell; c++) {
    if (!fluid[c]) continue;
    PetscCall(gather(e, c, &cell));
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt i = FlowCellNode(l, c, j);

      if (i < 0) continue;
      for (PetscInt s = 0; s < e->ns; s++) mean[i * bs + s] += cell.stress[j * e->ns + s];
      mean[i * bs + e->ns]++;
    }
  }
  PetscCall(MeshSumNodes(e->f->mesh, bs, mean));
  PetscCall(MeshSyncNodes(e->f->mesh, bs, mean));
  for (PetscInt i = 0; i < l->nnode_all; i++)
    for (PetscInt s = 0; s < e->ns; s++) mean[i * bs + s] /= PetscMax(1, mean[i * bs + e->ns]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* int |residual|^2 over a cell; adds the dissipation, mu int |grad u|^2 */
static void integrate_residual(const Estimate *e, const CellFields *cell, PetscReal *sum, PetscReal *dissipation)
{
  const ElementTables  *t   = &e->f->element;
  const FlowParameters *par = &e->f->par;
  const PetscInt        nb = e->l->nb, dim = e->l->dim;
  ElementMetric         m;

  ElementSetMetric(t, cell->x, &m);
  *sum = 0;
  for (PetscInt q = 0; q < t->nq; q++) {
    const PetscReal *phi = t->phi + q * t->nbp, w = m.weight[q];
    PetscReal        g[3][ELEMENT_MAX_NBP], u[3]  = {0, 0, 0}, r[3];

    ElementGradients(t, &m, q, g);
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) u[a] += phi[j] * cell->u[j * dim + a];
    for (PetscInt a = 0; a < dim; a++) {
      r[a] = -par->force[a];
      for (PetscInt j = 0; j < nb && e->f->force.source; j++) r[a] -= phi[j] * cell->source[j * dim + a];
      for (PetscInt b = 0; b < dim; b++) {
        PetscReal slope = 0;

        for (PetscInt j = 0; j < nb; j++) {
          slope += g[b][j] * cell->u[j * dim + a];
          r[a] -= g[b][j] * cell->stress[j * e->ns + a * dim + b];
        }
        if (par->convection) r[a] += par->density * u[b] * slope;
        *dissipation += w * par->viscosity * slope * slope;
      }
      *sum += w * r[a] * r[a];
    }
  }
}

/* int over the surface of a cell of what its stress differs from the mean by (Simpson's rule on faces of size h) */
static void integrate_jumps(const Estimate *e, PetscInt c, const CellFields *cell, const PetscReal mean[],
                            PetscReal *sum)
{
  const MeshLocal *l  = e->l;
  const PetscInt   bs = e->ns + 1;

  *sum = 0;
  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscInt at[3] = {j % 3, j / 3 % 3, l->dim == 3 ? j / 9 : 1}, i = FlowCellNode(l, c, j);
    PetscReal      w = 0, d = 0;

    if (i < 0) continue;
    for (PetscInt a = 0; a < l->dim; a++) { /* a face across axis a */
      PetscReal face = at[a] == 1 ? 0 : 1;

      for (PetscInt b = 0; b < l->dim; b++)
        if (b != a) face *= at[b] == 1 ? 2. / 3 : 1. / 6;
      w += face;
    }
    for (PetscInt s = 0; s < e->ns; s++) d += PetscSqr(cell->stress[j * e->ns + s] - mean[i * bs + s]);
    *sum += w * d * PetscPowRealInt(cell->h, (int)l->dim - 1);
  }
}

PetscErrorCode FlowEstimate(Flow f, const PetscBool fluid[], PetscReal eta[], PetscReal *relative)
{
  const MeshLocal *l = f->loc;
  Estimate         e = {.f = f, .l = l, .ns = l->dim * l->dim};
  PetscReal       *mean, *p, sum[2] = {0, 0};
  CellFields       cell;

  PetscFunctionBeginUser;
  PetscCall(FlowBringFields(f));
  e.u = f->u;
  PetscCheck(!f->properties.density && !FlowVaries(f), f->comm, PETSC_ERR_SUP,
             "The error of a flow of several fluids is not estimated");
  PetscCall(PetscMalloc1(l->ncell * (l->dim + 1), &p));
  PetscCall(PetscCalloc1(l->nnode_all * (e.ns + 1), &mean));
  PetscCall(FlowGetPressureGradient(f, f->p, p));
  e.p = p;
  PetscCall(average(&e, fluid, mean));
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal inner, outer;

    eta[c] = 0;
    if (!fluid[c]) continue;
    PetscCall(gather(&e, c, &cell));
    integrate_residual(&e, &cell, &inner, &sum[1]);
    integrate_jumps(&e, c, &cell, mean, &outer);
    eta[c] = (cell.h * cell.h * inner + cell.h * outer) / f->par.viscosity;
    sum[0] += eta[c];
    eta[c] = PetscSqrtReal(eta[c]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, f->comm));
  *relative = sum[1] > 0 ? PetscSqrtReal(sum[0] / sum[1]) : 0;
  PetscCall(PetscFree(p));
  PetscCall(PetscFree(mean));
  PetscFunctionReturn(PETSC_SUCCESS);
}
