/* Flow: element kernels and assembly of the Navier-Stokes equations (see flow.h).

   The kernels are written for a general dimension and inlined for quadrilaterals and hexahedra with constants, so that the compiler vectorises them: a row of the
   element matrix is a sum over quadrature points of phi_i times a vector over j, padded to a multiple of four. Cells that are parallelograms (most cells of most
   meshes) keep one inverse Jacobian. Units: any consistent system. Not here: bodies, solvers, stabilisation, turbulence. */
#include "compat.h"
#include "flow.h"
#include "dense.h"
#include "log.h"
#include "opt.h"
#include <petscfe.h>

#define MAX_NB  27
#define MAX_NBP 28 /* padded to a multiple of 4 */
#define MAX_NQ  27

/* Inverse Jacobian and weight x det J at the quadrature points of a cell; one set when affine */
typedef struct {
  PetscBool affine;
  PetscReal inverse[MAX_NQ][9], weight[MAX_NQ];
} Metric;

struct _p_Flow {
  Mesh             mesh;
  const MeshLocal *loc;
  FlowParameters   par;
  FlowStep         step;
  PetscInt         scheme, nsteps;
  PetscReal        dt_old;
  Boundary         boundary;
  /* element tables: phi [nq][nbp], dphi [nq][dim][nbp] (padding zero) */
  PetscInt   nq, nbp;
  PetscReal *phi, *dphi, *qweight;
  /* geometry of the cells */
  PetscBool *affine;
  PetscReal *inverse, *det, *size, *b, *lumped,
    *pmass; /* [ncell_all][dim*dim], [ncell_all], [ncell_all], cell matrices of B, nodal mass, inverse mass matrices of the pressure [ncell][dim+1][dim+1] */
  /* operators */
  Mat       S, S0; /* whole; constant part */
  PetscReal s0_ct, s0_theta, *coo;
  PetscBool s_is_s0;
  /* fields */
  PetscReal *u, *u_old, *w, *p, *p_old;
};

static const char *const SCHEMES[] = {"be", "cn", "bdf2", NULL};

/* ---- geometry ---- */

static PetscReal invert_jacobian(PetscInt dim, const PetscReal J[], PetscReal inv[])
{
  if (dim == 2) {
    const PetscReal det = J[0] * J[3] - J[1] * J[2];

    inv[0] = J[3] / det;
    inv[1] = -J[1] / det;
    inv[2] = -J[2] / det;
    inv[3] = J[0] / det;
    return det;
  } else {
    const PetscReal c0 = J[4] * J[8] - J[5] * J[7], c1 = J[5] * J[6] - J[3] * J[8], c2 = J[3] * J[7] - J[4] * J[6];
    const PetscReal det = J[0] * c0 + J[1] * c1 + J[2] * c2;

    inv[0] = c0 / det;
    inv[3] = c1 / det;
    inv[6] = c2 / det;
    inv[1] = (J[2] * J[7] - J[1] * J[8]) / det;
    inv[4] = (J[0] * J[8] - J[2] * J[6]) / det;
    inv[7] = (J[1] * J[6] - J[0] * J[7]) / det;
    inv[2] = (J[1] * J[5] - J[2] * J[4]) / det;
    inv[5] = (J[2] * J[3] - J[0] * J[5]) / det;
    inv[8] = (J[0] * J[4] - J[1] * J[3]) / det;
    return det;
  }
}

/* dx_a/dxi_e at quadrature point q: J [a][e]; inverse is [e][a] */
static PetscReal jacobian_at(const struct _p_Flow *f, PetscInt q, const PetscReal xc[], PetscReal inv[])
{
  const PetscInt dim = f->loc->dim, nb = f->loc->nb;
  PetscReal      J[9] = {0};

  for (PetscInt e = 0; e < dim; e++) {
    const PetscReal *d = f->dphi + (q * dim + e) * f->nbp;

    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) J[a * dim + e] += xc[j * dim + a] * d[j];
  }
  return invert_jacobian(dim, J, inv);
}

static PetscErrorCode compute_metric(Flow f, PetscInt c, Metric *m)
{
  const PetscInt dim = f->loc->dim;

  PetscFunctionBeginUser;
  m->affine = f->affine[c];
  if (m->affine) {
    for (PetscInt q = 0; q < f->nq; q++) {
      for (PetscInt i = 0; i < dim * dim; i++) m->inverse[q][i] = f->inverse[c * dim * dim + i];
      m->weight[q] = f->qweight[q] * f->det[c];
    }
  } else {
    PetscReal xc[MAX_NB * 3];

    PetscCall(MeshCellCoordinates(f->mesh, c, xc));
    for (PetscInt q = 0; q < f->nq; q++) m->weight[q] = f->qweight[q] * jacobian_at(f, q, xc, m->inverse[q]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Gradients of the basis at quadrature point q in space: g [dim][nbp] */
static void space_gradients(const struct _p_Flow *f, const Metric *m, PetscInt q, PetscReal g[3][MAX_NBP])
{
  const PetscInt dim = f->loc->dim, nb = f->loc->nb;

  for (PetscInt a = 0; a < dim; a++) {
    for (PetscInt j = 0; j < nb; j++) g[a][j] = 0;
    for (PetscInt e = 0; e < dim; e++) {
      const PetscReal  inv = m->inverse[q][e * dim + a];
      const PetscReal *d   = f->dphi + (q * dim + e) * f->nbp;

      for (PetscInt j = 0; j < nb; j++) g[a][j] += inv * d[j];
    }
  }
}

/* Affine test, size, cell matrices of B and lumped mass of all local cells. Collective. */
static PetscErrorCode compute_cells(Flow f)
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, nb = l->nb, nk = dim + 1;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(f->lumped, l->nnode_all));
  PetscCall(PetscArrayzero(f->b, l->ncell_all * nk * nb * dim));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal        xc[MAX_NB * 3], first[9], volume = 0, mass[16] = {0}, *b = f->b + c * nk * nb * dim;
    const PetscReal *centre = xc + (nb / 2) * dim;
    Metric           m;

    PetscCall(MeshCellCoordinates(f->mesh, c, xc));
    f->affine[c] = PETSC_FALSE;
    PetscCall(compute_metric(f, c, &m));
    PetscCall(PetscArraycpy(first, m.inverse[0], dim * dim));
    f->affine[c] = PETSC_TRUE;
    for (PetscInt q = 0; q < f->nq; q++) {
      PetscReal scale = 0, diff = 0;

      PetscCheck(m.weight[q] > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
                 "Mesh cell near (%g, %g) has a Jacobian of %g at a quadrature point: the mesh is tangled there", (double)centre[0],
                 (double)centre[1], (double)(m.weight[q] / f->qweight[q]));
      volume += m.weight[q];
      for (PetscInt i = 0; i < dim * dim; i++) {
        scale = PetscMax(scale, PetscAbsReal(first[i]));
        diff  = PetscMax(diff, PetscAbsReal(first[i] - m.inverse[q][i]));
      }
      if (diff > 1e-10 * scale) f->affine[c] = PETSC_FALSE;
    }
    PetscCall(PetscArraycpy(f->inverse + c * dim * dim, first, dim * dim));
    f->det[c]  = m.weight[0] / f->qweight[0];
    f->size[c] = PetscPowReal(volume, 1.0 / dim);
    for (PetscInt q = 0; q < f->nq; q++) {
      const PetscReal *phi = f->phi + q * f->nbp;
      PetscReal        g[3][MAX_NBP], x[3] = {0, 0, 0}, psi[4];

      space_gradients(f, &m, q, g);
      for (PetscInt j = 0; j < nb; j++) {
        f->lumped[l->cell_node[c * nb + j]] += m.weight[q] * phi[j];
        for (PetscInt a = 0; a < dim; a++) x[a] += phi[j] * xc[j * dim + a];
      }
      psi[0] = 1;
      for (PetscInt a = 0; a < dim; a++) psi[1 + a] = (x[a] - centre[a]) / f->size[c];
      for (PetscInt k = 0; k < nk; k++) {
        for (PetscInt n = 0; n < nk; n++) mass[k * nk + n] += m.weight[q] * psi[k] * psi[n];
        for (PetscInt j = 0; j < nb; j++)
          for (PetscInt a = 0; a < dim; a++) b[k * nb * dim + j * dim + a] += m.weight[q] * psi[k] * g[a][j];
      }
    }
    if (c < l->ncell) DenseInvert(nk, mass, f->pmass + c * nk * nk);
  }
  PetscCall(MeshSyncNodes(f->mesh, 1, f->lumped)); /* own nodes see all their cells (own or ghost); outer ghosts do not */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- element tables ---- */

/* Which PETSc basis function belongs to lattice position j: the one that is 1 there */
static PetscErrorCode match_basis(PetscFE fe, PetscInt dim, PetscInt nb, PetscInt basis_of_lattice[])
{
  PetscReal       points[MAX_NB * 3];
  PetscTabulation T;

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < nb; j++) {
    const PetscInt lattice[3] = {j % 3, (j / 3) % 3, j / 9};

    for (PetscInt d = 0; d < dim; d++) points[j * dim + d] = lattice[d] - 1.0;
  }
  PetscCall(PetscFECreateTabulation(fe, 1, nb, points, 0, &T));
  PetscCheck(T->Nb == nb, PETSC_COMM_SELF, PETSC_ERR_PLIB, "PetscFE has %" PetscInt_FMT " basis functions, expected %" PetscInt_FMT, T->Nb, nb);
  for (PetscInt j = 0; j < nb; j++)
    for (PetscInt i = 0; i < nb; i++)
      if (T->T[0][j * nb + i] > 0.5) basis_of_lattice[j] = i;
  PetscCall(PetscTabulationDestroy(&T));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode tabulate(Flow f)
{
  const PetscInt   dim = f->loc->dim, nb = f->loc->nb;
  PetscInt         order[MAX_NB];
  PetscFE          fe;
  PetscQuadrature  quad;
  PetscTabulation  T;
  const PetscReal *points, *weights;

  PetscFunctionBeginUser;
  f->nbp = 4 * ((nb + 3) / 4);
  PetscCall(PetscFECreateLagrange(PETSC_COMM_SELF, dim, 1, PETSC_FALSE, 2, PETSC_DETERMINE, &fe));
  PetscCall(match_basis(fe, dim, nb, order));
  PetscCall(PetscDTGaussTensorQuadrature(dim, 1, 3, -1, 1, &quad));
  PetscCall(PetscQuadratureGetData(quad, NULL, NULL, &f->nq, &points, &weights));
  PetscCall(PetscFECreateTabulation(fe, 1, f->nq, points, 1, &T));
  PetscCall(PetscCalloc3(f->nq * f->nbp, &f->phi, f->nq * dim * f->nbp, &f->dphi, f->nq, &f->qweight));
  for (PetscInt q = 0; q < f->nq; q++) {
    f->qweight[q] = weights[q];
    for (PetscInt j = 0; j < nb; j++) {
      f->phi[q * f->nbp + j] = T->T[0][q * nb + order[j]];
      for (PetscInt e = 0; e < dim; e++) f->dphi[(q * dim + e) * f->nbp + j] = T->T[1][(q * nb + order[j]) * dim + e];
    }
  }
  PetscCall(PetscTabulationDestroy(&T));
  PetscCall(PetscQuadratureDestroy(&quad));
  PetscCall(PetscFEDestroy(&fe));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- kernels ---- */

/* ce [nb][nb] = rho int phi_i w.grad phi_j, wl [nb][dim] */
static inline __attribute__((always_inline)) void convection_kernel(const int dim, const int nb, const int nbp, const int nq,
                                                                    const PetscReal *restrict phi, const PetscReal *restrict dphi,
                                                                    const Metric *restrict m, PetscReal rho, const PetscReal *restrict wl,
                                                                    PetscReal *restrict ce)
{
  PetscReal g[MAX_NQ][MAX_NBP];

  for (int q = 0; q < nq; q++) {
    PetscReal w[3] = {0, 0, 0}, s[3];

    for (int j = 0; j < nb; j++)
      for (int a = 0; a < dim; a++) w[a] += phi[q * nbp + j] * wl[j * dim + a];
    for (int e = 0; e < dim; e++) {
      s[e] = 0;
      for (int a = 0; a < dim; a++) s[e] += m->inverse[q][e * dim + a] * w[a];
      s[e] *= rho * m->weight[q];
    }
    for (int j = 0; j < nbp; j++) g[q][j] = s[0] * dphi[(q * dim) * nbp + j];
    for (int e = 1; e < dim; e++)
      for (int j = 0; j < nbp; j++) g[q][j] += s[e] * dphi[(q * dim + e) * nbp + j];
  }
  for (int i = 0; i < nb; i++) {
    PetscReal row[MAX_NBP];

    for (int j = 0; j < nbp; j++) row[j] = 0;
    for (int q = 0; q < nq; q++)
      for (int j = 0; j < nbp; j++) row[j] += phi[q * nbp + i] * g[q][j];
    for (int j = 0; j < nb; j++) ce[i * nb + j] = row[j];
  }
}

static void convection_matrix(const struct _p_Flow *f, const Metric *m, const PetscReal wl[], PetscReal ce[])
{
  if (f->loc->dim == 2) convection_kernel(2, 9, 12, 9, f->phi, f->dphi, m, f->par.density, wl, ce);
  else convection_kernel(3, 27, 28, 27, f->phi, f->dphi, m, f->par.density, wl, ce);
}

/* ke [nb][nb] = a int phi_i phi_j + b int grad phi_i . grad phi_j */
static void constant_matrix(const struct _p_Flow *f, const Metric *m, PetscReal a, PetscReal b, PetscReal ke[])
{
  const PetscInt dim = f->loc->dim, nb = f->loc->nb;

  for (PetscInt i = 0; i < nb * nb; i++) ke[i] = 0;
  for (PetscInt q = 0; q < f->nq; q++) {
    const PetscReal *phi = f->phi + q * f->nbp;
    PetscReal        g[3][MAX_NBP];

    space_gradients(f, m, q, g);
    for (PetscInt i = 0; i < nb; i++) {
      for (PetscInt j = 0; j < nb; j++) {
        PetscReal dot = 0;

        for (PetscInt d = 0; d < dim; d++) dot += g[d][i] * g[d][j];
        ke[i * nb + j] += m->weight[q] * (a * phi[i] * phi[j] + b * dot);
      }
    }
  }
}

/* r [nb][dim] of one cell: (rho a, v) + rho (w.grad v_, v) + mu (grad v_, grad v) - (p, div v) - (force, v) from nodal acceleration a, velocity v_, convection w (may be NULL).
   bp [dim+1][nb*dim] with pressure coefficients pl, or NULL. */
static void residual_kernel(const struct _p_Flow *f, const Metric *m, const PetscReal al[], const PetscReal vl[], const PetscReal wl[],
                            const PetscReal b[], const PetscReal pl[], PetscReal r[])
{
  const PetscInt  dim = f->loc->dim, nb = f->loc->nb;
  const PetscReal rho = f->par.density, mu = f->par.viscosity;

  for (PetscInt i = 0; i < nb * dim; i++) r[i] = 0;
  for (PetscInt q = 0; q < f->nq; q++) {
    const PetscReal *phi = f->phi + q * f->nbp;
    PetscReal        g[3][MAX_NBP], a[3] = {0, 0, 0}, w[3] = {0, 0, 0}, grad[3][3] = {{0}};

    space_gradients(f, m, q, g);
    for (PetscInt j = 0; j < nb; j++) {
      for (PetscInt d = 0; d < dim; d++) {
        a[d] += phi[j] * al[j * dim + d];
        if (wl) w[d] += phi[j] * wl[j * dim + d];
        for (PetscInt e = 0; e < dim; e++) grad[d][e] += g[e][j] * vl[j * dim + d];
      }
    }
    for (PetscInt d = 0; d < dim; d++) {
      PetscReal s = rho * a[d] - f->par.force[d];

      for (PetscInt e = 0; e < dim; e++) s += rho * w[e] * grad[d][e];
      s *= m->weight[q];
      for (PetscInt j = 0; j < nb; j++) {
        PetscReal t = s * phi[j];

        for (PetscInt e = 0; e < dim; e++) t += m->weight[q] * mu * grad[d][e] * g[e][j];
        r[j * dim + d] += t;
      }
    }
  }
  if (pl)
    for (PetscInt k = 0; k <= dim; k++)
      for (PetscInt i = 0; i < nb * dim; i++) r[i] -= pl[k] * b[k * nb * dim + i];
}

static void gather(const MeshLocal *l, PetscInt c, const PetscReal v[], PetscReal vl[])
{
  for (PetscInt j = 0; j < l->nb; j++)
    for (PetscInt a = 0; a < l->dim; a++) vl[j * l->dim + a] = v[l->cell_node[c * l->nb + j] * l->dim + a];
}

/* ---- assembly ---- */

static PetscErrorCode create_matrix(Flow f)
{
  const MeshLocal *l  = f->loc;
  const PetscInt   nb = l->nb;
  const PetscCount n  = (PetscCount)l->ncell * nb * nb;
  PetscInt        *row, *col;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(n, &row, n, &col));
  for (PetscInt c = 0; c < l->ncell; c++) {
    const PetscInt *node = l->cell_node + c * nb;

    for (PetscInt i = 0; i < nb; i++) {
      for (PetscInt j = 0; j < nb; j++) {
        row[(PetscCount)c * nb * nb + i * nb + j] = l->node_global[node[i]];
        col[(PetscCount)c * nb * nb + i * nb + j] = l->node_global[node[j]];
      }
    }
  }
  PetscCall(MatCreate(PETSC_COMM_WORLD, &f->S));
  PetscCall(MatSetSizes(f->S, l->nnode, l->nnode, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetType(f->S, MATAIJ));
  PetscCall(MatSetPreallocationCOO(f->S, n, row, col));
  PetscCall(PetscFree2(row, col));
  PetscCall(PetscMalloc1(n, &f->coo));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode assemble_constant(Flow f)
{
  const PetscInt nb = f->loc->nb;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < f->loc->ncell; c++) {
    Metric m;

    PetscCall(compute_metric(f, c, &m));
    constant_matrix(f, &m, f->par.density * f->step.ct, f->step.theta * f->par.viscosity, f->coo + (PetscCount)c * nb * nb);
  }
  PetscCall(MatSetValuesCOO(f->S, f->coo, INSERT_VALUES));
  if (f->par.convection) {
    if (!f->S0) PetscCall(MatDuplicate(f->S, MAT_DO_NOT_COPY_VALUES, &f->S0));
    PetscCall(MatCopy(f->S, f->S0, SAME_NONZERO_PATTERN));
  }
  f->s0_ct    = f->step.ct;
  f->s0_theta = f->step.theta;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode assemble_convection(Flow f)
{
  const MeshLocal *l  = f->loc;
  const PetscInt   nb = l->nb;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell; c++) {
    Metric    m;
    PetscReal wl[MAX_NB * 3];

    PetscCall(compute_metric(f, c, &m));
    gather(l, c, f->w, wl);
    for (PetscInt i = 0; i < nb * l->dim; i++) wl[i] *= f->step.theta;
    convection_matrix(f, &m, wl, f->coo + (PetscCount)c * nb * nb);
  }
  PetscCall(MatCopy(f->S0, f->S, SAME_NONZERO_PATTERN));
  PetscCall(MatSetValuesCOO(f->S, f->coo, ADD_VALUES));
  PetscCall(PetscLogFlops(2.0 * l->ncell * f->nq * nb * (nb + 3 * l->dim)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAssemble(Flow f)
{
  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_ASSEMBLE, 0, 0, 0, 0));
  if (f->s0_ct != f->step.ct || f->s0_theta != f->step.theta) PetscCall(assemble_constant(f));
  if (f->par.convection) PetscCall(assemble_convection(f));
  PetscCall(PetscLogEventEnd(TB_FLOW_ASSEMBLE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowRhs(Flow f, PetscReal r[])
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, nb = l->nb;
  const FlowStep  *s = &f->step;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_RHS, 0, 0, 0, 0));
  PetscCall(PetscArrayzero(r, l->nnode_all * dim));
  for (PetscInt c = 0; c < l->ncell; c++) {
    const PetscInt *node = l->cell_node + c * nb;
    PetscReal       al[MAX_NB * 3], vl[MAX_NB * 3], wl[MAX_NB * 3], rl[MAX_NB * 3];
    Metric          m;

    for (PetscInt j = 0; j < nb; j++) {
      for (PetscInt a = 0; a < dim; a++) {
        const PetscInt i = node[j] * dim + a;

        al[j * dim + a] = -(s->d0 * f->u[i] + s->d1 * f->u_old[i]);
        vl[j * dim + a] = (1 - s->theta) * f->u[i];
        wl[j * dim + a] = f->w[i];
      }
    }
    PetscCall(compute_metric(f, c, &m));
    residual_kernel(f, &m, al, vl, f->par.convection && s->theta < 1 ? wl : NULL, NULL, NULL, rl);
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) r[node[j] * dim + a] -= rl[j * dim + a];
  }
  PetscCall(MeshSumNodes(f->mesh, dim, r));
  PetscCall(PetscLogEventEnd(TB_FLOW_RHS, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDivergence(Flow f, const PetscReal u[], PetscReal y[])
{
  const MeshLocal *l = f->loc;
  const PetscInt   n = l->nb * l->dim, nk = l->dim + 1;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_DIV, 0, 0, 0, 0));
  for (PetscInt c = 0; c < l->ncell; c++) {
    const PetscReal *b = f->b + c * nk * n;
    PetscReal        ul[MAX_NB * 3];

    gather(l, c, u, ul);
    for (PetscInt k = 0; k < nk; k++) {
      PetscReal sum = 0;

      for (PetscInt i = 0; i < n; i++) sum += b[k * n + i] * ul[i];
      y[c * nk + k] = sum;
    }
  }
  PetscCall(PetscLogFlops(2.0 * l->ncell * nk * n));
  PetscCall(PetscLogEventEnd(TB_FLOW_DIV, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGradient(Flow f, PetscReal scale, const PetscReal p[], PetscReal r[])
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, nb = l->nb, n = nb * dim, nk = dim + 1;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_DIV, 0, 0, 0, 0));
  PetscCall(PetscArrayzero(r, l->nnode_all * dim));
  for (PetscInt c = 0; c < l->ncell; c++) {
    const PetscReal *b = f->b + c * nk * n;
    PetscReal        rl[MAX_NB * 3];

    for (PetscInt i = 0; i < n; i++) rl[i] = 0;
    for (PetscInt k = 0; k < nk; k++) {
      const PetscReal pk = scale * p[c * nk + k];

      for (PetscInt i = 0; i < n; i++) rl[i] += pk * b[k * n + i];
    }
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) r[l->cell_node[c * nb + j] * dim + a] += rl[j * dim + a];
  }
  PetscCall(MeshSumNodes(f->mesh, dim, r));
  PetscCall(PetscLogFlops(2.0 * l->ncell * nk * n));
  PetscCall(PetscLogEventEnd(TB_FLOW_DIV, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowPressureMassSolve(Flow f, PetscReal scale, const PetscReal r[], PetscReal y[])
{
  const PetscInt nk = f->loc->dim + 1;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < f->loc->ncell; c++)
    for (PetscInt k = 0; k < nk; k++)
      for (PetscInt n = 0; n < nk; n++) y[c * nk + k] += scale * f->pmass[(c * nk + k) * nk + n] * r[c * nk + n];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode read_parameters(Flow f)
{
  FlowParameters *p   = &f->par;
  const PetscInt  dim = f->loc->dim;

  PetscFunctionBeginUser;
  p->density    = 1;
  p->viscosity  = 0.01;
  p->convection = PETSC_TRUE;
  f->scheme     = 2;
  PetscCall(OptReal("-flow_density", "density of the fluid", "mass/length^dim", OPT_POSITIVE, PETSC_MAX_REAL, &p->density));
  PetscCall(OptReal("-flow_viscosity", "dynamic viscosity of the fluid", "mass/(length time)", OPT_POSITIVE, PETSC_MAX_REAL, &p->viscosity));
  PetscCall(OptRealArray("-flow_gravity", "acceleration of gravity (acts on bodies through M - M_f)", "length/time^2", PETSC_MIN_REAL, PETSC_MAX_REAL,
                         dim, p->gravity, NULL));
  PetscCall(OptRealArray("-flow_force", "body force on the fluid", "force/volume", PETSC_MIN_REAL, PETSC_MAX_REAL, dim, p->force, NULL));
  PetscCall(OptBool("-flow_convection", "convection term; false gives the unsteady Stokes equations", &p->convection));
  PetscCall(OptChoice("-flow_time", "time scheme", SCHEMES, &f->scheme));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCreate(Mesh mesh, Flow *flow)
{
  Flow             f;
  const MeshLocal *l;
  PetscInt         dim;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  f->mesh = mesh;
  PetscCall(MeshGetLocal(mesh, &f->loc));
  l   = f->loc;
  dim = l->dim;
  PetscCall(read_parameters(f));
  PetscCall(tabulate(f));
  PetscCall(PetscMalloc5(l->ncell_all, &f->affine, l->ncell_all * dim * dim, &f->inverse, l->ncell_all, &f->det, l->ncell_all, &f->size, l->nnode_all,
                         &f->lumped));
  PetscCall(PetscMalloc1(l->ncell_all * (dim + 1) * l->nb * dim, &f->b));
  PetscCall(PetscMalloc1(l->ncell * (dim + 1) * (dim + 1), &f->pmass));
  PetscCall(compute_cells(f));
  PetscCall(BoundaryCreate(mesh, &f->boundary));
  PetscCall(PetscCalloc1(l->nnode_all * dim, &f->u)); /* each on its own: accepted steps swap them */
  PetscCall(PetscCalloc1(l->nnode_all * dim, &f->u_old));
  PetscCall(PetscCalloc1(l->nnode_all * dim, &f->w));
  PetscCall(PetscCalloc1(l->ncell * (dim + 1), &f->p));
  PetscCall(PetscCalloc1(l->ncell * (dim + 1), &f->p_old));
  PetscCall(create_matrix(f));
  *flow = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDestroy(Flow *flow)
{
  Flow f = *flow;

  PetscFunctionBeginUser;
  if (!f) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatDestroy(&f->S));
  PetscCall(MatDestroy(&f->S0));
  PetscCall(PetscFree(f->coo));
  PetscCall(PetscFree(f->b));
  PetscCall(PetscFree(f->pmass));
  PetscCall(PetscFree3(f->phi, f->dphi, f->qweight));
  PetscCall(PetscFree5(f->affine, f->inverse, f->det, f->size, f->lumped));
  PetscCall(BoundaryDestroy(&f->boundary));
  PetscCall(PetscFree(f->u));
  PetscCall(PetscFree(f->u_old));
  PetscCall(PetscFree(f->w));
  PetscCall(PetscFree(f->p));
  PetscCall(PetscFree(f->p_old));
  PetscCall(PetscFree(*flow));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowView(Flow f, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer, "flow: density %g, viscosity %g, time scheme %s, %s\n", (double)f->par.density, (double)f->par.viscosity,
                                   SCHEMES[f->scheme],
                                   f->par.convection ? "Navier-Stokes (convection extrapolated)" : "Stokes (no convection assembled)"));
  PetscCall(BoundaryView(f->boundary, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetParameters(Flow f, const FlowParameters **par)
{
  PetscFunctionBeginUser;
  *par = &f->par;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetMesh(Flow f, Mesh *mesh)
{
  PetscFunctionBeginUser;
  *mesh = f->mesh;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowBeginStep(Flow f, PetscReal time, PetscReal dt)
{
  FlowStep       *s     = &f->step;
  const PetscInt  n     = f->loc->nnode_all * f->loc->dim;
  const PetscBool first = (PetscBool)(f->nsteps == 0);
  const PetscReal r     = first ? 0 : dt / f->dt_old; /* ratio of steps */
  PetscReal       ahead = 0;                          /* extrapolation of w in units of the old step */

  PetscFunctionBeginUser;
  s->time  = time;
  s->dt    = dt;
  s->ct    = 1 / dt;
  s->d0    = 1 / dt;
  s->d1    = 0;
  s->theta = f->scheme == 1 ? 0.5 : 1;
  s->order = 1;
  if (f->scheme == 2 && !first) {
    s->ct    = (1 + 2 * r) / ((1 + r) * dt);
    s->d0    = (1 + r) / dt;
    s->d1    = -r * r / ((1 + r) * dt);
    ahead    = r;
    s->order = 2;
  } else if (f->scheme == 1) {
    ahead    = 0.5 * r;
    s->order = first ? 1 : 2;
  }
  if (f->par.convection)
    for (PetscInt i = 0; i < n; i++) f->w[i] = f->u[i] + ahead * (f->u[i] - f->u_old[i]);
  PetscCall(BoundarySetTime(f->boundary, time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetStep(Flow f, const FlowStep **step)
{
  PetscFunctionBeginUser;
  *step = &f->step;
  PetscFunctionReturn(PETSC_SUCCESS);
}

Boundary FlowBoundary(Flow f)
{
  return f->boundary;
}

PetscErrorCode FlowGetMatrix(Flow f, Mat *S)
{
  PetscFunctionBeginUser;
  *S = f->S;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetCellDivergence(Flow f, const PetscReal *b[])
{
  PetscFunctionBeginUser;
  *b = f->b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetLumpedMass(Flow f, const PetscReal *m[])
{
  PetscFunctionBeginUser;
  *m = f->lumped;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetFields(Flow f, PetscReal *u[], PetscReal *u_old[], PetscReal *p[])
{
  PetscFunctionBeginUser;
  if (u) *u = f->u;
  if (u_old) *u_old = f->u_old;
  if (p) *p = f->p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetPressureGradient(Flow f, const PetscReal p[], PetscReal out[])
{
  const PetscInt nk = f->loc->dim + 1;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < f->loc->ncell * nk; i++) out[i] = i % nk ? p[i] / f->size[i / nk] : p[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowExtrapolate(Flow f, PetscReal u[], PetscReal p[])
{
  const PetscReal r = f->nsteps > 1 ? f->step.dt / f->dt_old : 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < f->loc->nnode_all * f->loc->dim; i++) u[i] = f->u[i] + r * (f->u[i] - f->u_old[i]);
  for (PetscInt i = 0; i < f->loc->ncell * (f->loc->dim + 1); i++) p[i] = f->p[i] + (f->nsteps > 2 ? r : 0) * (f->p[i] - f->p_old[i]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAcceptStep(Flow f, const PetscReal u[], const PetscReal p[])
{
  PetscReal *swap;

  PetscFunctionBeginUser;
  swap     = f->u_old;
  f->u_old = f->u;
  f->u     = swap;
  swap     = f->p_old;
  f->p_old = f->p;
  f->p     = swap;
  PetscCall(PetscArraycpy(f->u, u, f->loc->nnode_all * f->loc->dim));
  PetscCall(PetscArraycpy(f->p, p, f->loc->ncell * (f->loc->dim + 1)));
  f->dt_old = f->step.dt;
  f->nsteps++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- evaluation ---- */

/* Nodal acceleration, theta-velocity and convecting velocity of a cell for the step's solution u */
static void gather_step(const struct _p_Flow *f, PetscInt c, const PetscReal u[], PetscReal al[], PetscReal vl[], PetscReal wl[])
{
  const MeshLocal *l = f->loc;
  const FlowStep  *s = &f->step;

  for (PetscInt j = 0; j < l->nb; j++) {
    for (PetscInt a = 0; a < l->dim; a++) {
      const PetscInt i = l->cell_node[c * l->nb + j] * l->dim + a, k = j * l->dim + a;

      al[k] = s->ct * u[i] - s->d0 * f->u[i] - s->d1 * f->u_old[i];
      vl[k] = s->theta * u[i] + (1 - s->theta) * f->u[i];
      wl[k] = f->w[i];
    }
  }
}

PetscErrorCode FlowCellResidual(Flow f, PetscInt c, const PetscReal u[], const PetscReal p[], PetscReal r[])
{
  const PetscInt nk = f->loc->dim + 1, n = f->loc->nb * f->loc->dim;
  PetscReal      al[MAX_NB * 3], vl[MAX_NB * 3], wl[MAX_NB * 3];
  Metric         m;

  PetscFunctionBeginUser;
  gather_step(f, c, u, al, vl, wl);
  PetscCall(compute_metric(f, c, &m));
  residual_kernel(f, &m, al, vl, f->par.convection ? wl : NULL, f->b + c * nk * n, p + c * nk, r);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCellStressForce(Flow f, PetscInt c, const PetscReal u[], const PetscReal p[], const PetscReal alpha[], const PetscReal X[3],
                                   PetscReal force[3], PetscReal torque[3])
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, nb = l->nb, nk = dim + 1;
  PetscReal        ul[MAX_NB * 3], xc[MAX_NB * 3];
  Metric           m;

  PetscFunctionBeginUser;
  gather(l, c, u, ul);
  PetscCall(MeshCellCoordinates(f->mesh, c, xc));
  PetscCall(compute_metric(f, c, &m));
  for (PetscInt q = 0; q < f->nq; q++) {
    const PetscReal *phi = f->phi + q * f->nbp, *centre = xc + (nb / 2) * dim;
    PetscReal        g[3][MAX_NBP], grad[3][3] = {{0}}, ga[3] = {0, 0, 0}, x[3] = {0, 0, 0}, t[3] = {0, 0, 0}, r[3] = {0, 0, 0}, pressure = p[c * nk];

    space_gradients(f, &m, q, g);
    for (PetscInt j = 0; j < nb; j++) {
      for (PetscInt d = 0; d < dim; d++) {
        x[d] += phi[j] * xc[j * dim + d];
        ga[d] += alpha[j] * g[d][j];
        for (PetscInt e = 0; e < dim; e++) grad[d][e] += g[e][j] * ul[j * dim + d];
      }
    }
    for (PetscInt d = 0; d < dim; d++) {
      pressure += p[c * nk + 1 + d] * (x[d] - centre[d]) / f->size[c];
      r[d] = x[d] - X[d];
      if (l->period[d] > 0) r[d] -= l->period[d] * PetscFloorReal(r[d] / l->period[d] + 0.5);
    }
    for (PetscInt d = 0; d < dim; d++) {
      t[d] = pressure * ga[d];
      for (PetscInt e = 0; e < dim; e++) t[d] -= f->par.viscosity * (grad[d][e] + grad[e][d]) * ga[e];
      t[d] *= m.weight[q];
    }
    for (PetscInt d = 0; d < 3; d++) {
      force[d] += t[d];
      torque[d] += r[(d + 1) % 3] * t[(d + 2) % 3] - r[(d + 2) % 3] * t[(d + 1) % 3];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDiagnose(Flow f, const PetscReal u[], FlowDiagnostics *out)
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, nb = l->nb, n = nb * dim;
  PetscReal        sum[5] = {0, 0, 0, 0, 0}, top[2] = {0, 0}; /* energy, divergence^2, momentum; cfl, speed */

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal        al[MAX_NB * 3], vl[MAX_NB * 3], wl[MAX_NB * 3], r[MAX_NB * 3], div = 0, ul[MAX_NB * 3];
    const PetscReal *b = f->b + c * (dim + 1) * n;
    Metric           m;

    gather(l, c, u, ul);
    gather_step(f, c, u, al, vl, wl);
    PetscCall(compute_metric(f, c, &m));
    residual_kernel(f, &m, al, vl, f->par.convection ? wl : NULL, NULL, NULL, r);
    for (PetscInt i = 0; i < n; i++) {
      sum[2 + i % dim] += r[i]; /* viscous parts add up to zero over a cell */
      div += b[i] * ul[i];
    }
    sum[1] += div * div / PetscPowReal(f->size[c], dim);
    for (PetscInt q = 0; q < f->nq; q++) {
      PetscReal v[3] = {0, 0, 0};

      for (PetscInt j = 0; j < nb; j++)
        for (PetscInt a = 0; a < dim; a++) v[a] += f->phi[q * f->nbp + j] * ul[j * dim + a];
      sum[0] += 0.5 * f->par.density * m.weight[q] * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    }
    for (PetscInt j = 0; j < nb; j++) {
      PetscReal speed = 0;

      for (PetscInt a = 0; a < dim; a++) speed += ul[j * dim + a] * ul[j * dim + a];
      speed  = PetscSqrtReal(speed);
      top[1] = PetscMax(top[1], speed);
      top[0] = PetscMax(top[0], speed * f->step.dt / f->size[c]);
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 5, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, top, 2, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  out->kinetic_energy = sum[0];
  out->divergence     = PetscSqrtReal(sum[1]);
  for (PetscInt d = 0; d < 3; d++) out->momentum_rate[d] = sum[2 + d];
  out->cfl       = top[0];
  out->speed_max = top[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}
