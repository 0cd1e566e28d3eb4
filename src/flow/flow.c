/* Flow: assembly of the Navier-Stokes equations and their time schemes (see flow.h); what is evaluated cell by cell from a solution is in evaluate.c.

   The velocity matrix is assembled in one pass over the cells, own and ghost, straight into the rows of own nodes: no communication, and no second matrix for the constant part,
   which costs less to compute (element.h) than to load. Units: any consistent system. Not here: bodies, solvers, stabilisation, turbulence. */
#include "compat.h"
#include "impl.h"
#include "base/dense.h"
#include "base/log.h"
#include "base/opt.h"

#define MAX_NB MESH_MAX_NB

/* Orders of the names below */
enum {
  SCHEME_BE,
  SCHEME_CN,
  SCHEME_BDF2,
  SCHEME_FSTHETA
};

#define FSTHETA 0.29289321881345247560 /* 1 - sqrt(1/2) */

static const char *const SCHEMES[]        = {"be", "cn", "bdf2", "fstheta", NULL};
static const char *const EXTRAPOLATIONS[] = {"linear", "quadratic", NULL};
static const char *const FORMS[]          = {"convective", "skew", NULL};

/* ---- geometry ---- */

/* A cell that is no part of the fluid has zero weights: every kernel then gives zero. Its size stays as it was. */
static PetscErrorCode empty_cell(Flow f, PetscInt c)
{
  const PetscInt dim = f->loc->dim, nk = dim + 1;

  PetscFunctionBeginUser;
  f->affine[c] = PETSC_TRUE;
  f->det[c]    = 0;
  PetscCall(PetscArrayzero(f->b + c * nk * f->loc->nb * dim, nk * f->loc->nb * dim));
  if (c < f->loc->ncell) PetscCall(PetscArrayzero(f->pmass + c * nk * nk, nk * nk));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Affine test, size, cell matrices of B and inverse pressure mass of a cell */
static PetscErrorCode compute_cell(Flow f, PetscInt c)
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, nb = l->nb, nk     = dim + 1;
  PetscReal        xc[MAX_NB * 3], first[9], volume = 0, mass[16] = {0}, *b = f->b + c * nk * nb * dim;
  const PetscReal *centre = xc + (nb / 2) * dim;
  ElementMetric    m;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(b, nk * nb * dim));
  PetscCall(MeshCellCoordinates(f->mesh, c, xc));
  f->affine[c] = PETSC_FALSE;
  PetscCall(PetscArraycpy(f->centre + c * dim, centre, dim));
  PetscCall(FlowCellMetric(f, c, &m));
  PetscCall(PetscArraycpy(first, m.inverse[0], dim * dim));
  f->affine[c] = PETSC_TRUE;
  for (PetscInt q = 0; q < f->element.nq; q++) {
    PetscReal scale = 0, diff = 0;

    PetscCheck(m.weight[q] > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Mesh cell near (%g, %g) has a Jacobian of %g at a quadrature point: the mesh is tangled there", (double)centre[0], (double)centre[1],
               (double)(m.weight[q] / f->element.weight[q]));
    volume += m.weight[q];
    for (PetscInt i = 0; i < dim * dim; i++) {
      scale = PetscMax(scale, PetscAbsReal(first[i]));
      diff  = PetscMax(diff, PetscAbsReal(first[i] - m.inverse[q][i]));
    }
    if (diff > 1e-10 * scale) f->affine[c] = PETSC_FALSE;
  }
  PetscCall(PetscArraycpy(f->inverse + c * dim * dim, first, dim * dim));
  f->det[c]  = m.weight[0] / f->element.weight[0];
  f->size[c] = PetscPowReal(volume, 1.0 / dim);
  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal *phi = f->element.phi + q * f->element.nbp;
    PetscReal        g[3][ELEMENT_MAX_NBP], x[3] = {0, 0, 0}, psi[4];

    ElementGradients(&f->element, &m, q, g);
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) x[a] += phi[j] * xc[j * dim + a];
    psi[0] = 1;
    for (PetscInt a = 0; a < dim; a++) psi[1 + a] = (x[a] - centre[a]) / f->size[c];
    for (PetscInt k = 0; k < nk; k++) {
      for (PetscInt n = 0; n < nk; n++) mass[k * nk + n] += m.weight[q] * psi[k] * psi[n];
      for (PetscInt j = 0; j < nb; j++)
        for (PetscInt a = 0; a < dim; a++) b[k * nb * dim + j * dim + a] += m.weight[q] * psi[k] * g[a][j];
    }
  }
  if (c < l->ncell) DenseInvert(nk, mass, f->pmass + c * nk * nk);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Add the lumped mass of cell c to those of its nodes whose mass is being computed */
static PetscErrorCode lump_cell(Flow f, PetscInt c)
{
  const PetscInt *node = f->loc->cell_node + c * f->loc->nb;
  ElementMetric   m;

  PetscFunctionBeginUser;
  PetscCall(FlowCellMetric(f, c, &m));
  for (PetscInt j = 0; j < f->loc->nb; j++)
    for (PetscInt q = 0; q < f->element.nq && f->open[node[j]] == f->now; q++)
      f->lumped[node[j]] += m.weight[q] * f->element.phi[q * f->element.nbp + j];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* All local cells. Collective. */
static PetscErrorCode compute_cells(Flow f)
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(f->lumped, f->loc->nnode_all));
  for (PetscInt c = 0; c < f->loc->ncell_all; c++) {
    PetscCall(compute_cell(f, c));
    PetscCall(lump_cell(f, c));
  }
  PetscCall(MeshSyncNodes(f->mesh, 1, f->lumped)); /* own nodes see all their cells (own or ghost); outer ghosts do not */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- assembly ---- */

/* Rows of own nodes as compressed rows with global columns in ascending order; the caller frees both. */
static PetscErrorCode find_pattern(Flow f, PetscInt **row_start, PetscInt **column)
{
  const MeshLocal *l    = f->loc;
  PetscInt         room = 18 * l->nnode + 125, n = 0, *start, *col;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode + 1, &start));
  PetscCall(PetscMalloc1(room, &col));
  start[0] = 0;
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscInt first = l->node_cell_ptr[i], last = l->node_cell_ptr[i + 1];
    PetscInt       m = (last - first) * l->nb;

    if (n + m > room) {
      room = 2 * room + m;
      PetscCall(PetscRealloc(room * sizeof(PetscInt), &col));
    }
    for (PetscInt q = 0; q < m; q++) col[n + q] = l->node_global[l->cell_node[l->node_cell[first + q / l->nb] * l->nb + q % l->nb]];
    PetscCall(PetscSortRemoveDupsInt(&m, col + n));
    n += m;
    start[i + 1] = n;
  }
  *row_start = start;
  *column    = col;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The rank's values of S: own columns, other columns (NULL on one rank), and the global numbers of the latter */
static PetscErrorCode get_parts(Flow f, Mat *own, Mat *other, const PetscInt **columns)
{
  PetscBool seq;

  PetscFunctionBeginUser;
  PetscCall(PetscObjectTypeCompare((PetscObject)f->S, MATSEQAIJ, &seq));
  *own   = f->S;
  *other = NULL;
  if (!seq) PetscCall(MatMPIAIJGetSeqAIJ(f->S, own, other, columns));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_entries(Flow f)
{
  const MeshLocal *l  = f->loc;
  const PetscInt   nb = l->nb, *start[2] = {NULL, NULL}, *col[2] = {NULL, NULL}, *global = NULL;
  PetscInt         n[2] = {0, 0}, nother = 0, at;
  Mat              part[2];
  PetscBool        done;

  PetscFunctionBeginUser;
  PetscCall(get_parts(f, &part[0], &part[1], &global));
  for (PetscInt s = 0; s < 2 && part[s]; s++) PetscCall(MatGetRowIJ(part[s], 0, PETSC_FALSE, PETSC_FALSE, &n[s], &start[s], &col[s], &done));
  if (part[1]) PetscCall(MatGetSize(part[1], NULL, &nother));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    const PetscInt *node = l->cell_node + c * nb;
    PetscInt        column[MAX_NB];

    for (PetscInt j = 0; j < nb; j++) {
      column[j] = node[j];
      if (node[j] >= l->nnode && nother) PetscCall(PetscFindInt(l->node_global[node[j]], nother, global, &column[j]));
    }
    for (PetscInt e = 0; e < nb * nb; e++) {
      const PetscInt i = node[e / nb], s = node[e % nb] >= l->nnode;

      f->entry[c * nb * nb + e] = -1;
      if (i >= l->nnode) continue;
      PetscCall(PetscFindInt(column[e % nb], start[s][i + 1] - start[s][i], col[s] + start[s][i], &at));
      PetscCheck(at >= 0, PETSC_COMM_SELF, PETSC_ERR_PLIB, "The velocity matrix has no entry for nodes %" PetscInt_FMT " and %" PetscInt_FMT, i,
                 node[e % nb]);
      f->entry[c * nb * nb + e] = s ? -2 - (start[s][i] + at) : start[s][i] + at;
    }
  }
  for (PetscInt s = 0; s < 2 && part[s]; s++) PetscCall(MatRestoreRowIJ(part[s], 0, PETSC_FALSE, PETSC_FALSE, &n[s], &start[s], &col[s], &done));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_matrix(Flow f)
{
  const MeshLocal *l         = f->loc;
  PetscInt        *row_start = NULL, *column = NULL;

  PetscFunctionBeginUser;
  PetscCall(find_pattern(f, &row_start, &column));
  PetscCall(MatCreate(PETSC_COMM_WORLD, &f->S));
  PetscCall(MatSetSizes(f->S, l->nnode, l->nnode, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetType(f->S, MATAIJ));
  PetscCall(MatSeqAIJSetPreallocationCSR(f->S, row_start, column, NULL));
  PetscCall(MatMPIAIJSetPreallocationCSR(f->S, row_start, column, NULL));
  PetscCall(PetscFree(row_start));
  PetscCall(PetscFree(column));
  PetscCall(PetscMalloc1(l->ncell_all * l->nb * l->nb, &f->entry));
  PetscCall(find_entries(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* own, other += the matrix ce [nb][stride] of cell c */
static void add_cell(const struct _p_Flow *f, PetscInt c, PetscInt stride, const PetscReal *restrict ce, PetscReal *restrict own,
                     PetscReal *restrict other)
{
  const PetscInt nb = f->loc->nb, *entry = f->entry + c * nb * nb;

  for (PetscInt i = 0; i < nb; i++) {
    for (PetscInt j = 0; j < nb; j++) {
      const PetscInt at = entry[i * nb + j];

      if (at >= 0) own[at] += ce[i * stride + j];
      else if (at < -1) other[-2 - at] += ce[i * stride + j];
    }
  }
}

static PetscErrorCode assemble_matrix(Flow f)
{
  const MeshLocal *l    = f->loc;
  const PetscInt   size = l->nb * l->dim, nbp = f->element.nbp;
  const FlowStep  *s        = &f->step;
  PetscReal       *value[2] = {NULL, NULL};
  Mat              part[2];
  const PetscInt  *columns;

  PetscFunctionBeginUser;
  PetscCall(get_parts(f, &part[0], &part[1], &columns));
  PetscCall(MatZeroEntries(f->S));
  for (PetscInt k = 0; k < 2 && part[k]; k++) PetscCall(MatSeqAIJGetArray(part[k], &value[k]));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    ElementMetric m;
    PetscReal     wl[MAX_NB * 3], ce[MAX_NB * ELEMENT_MAX_NBP];

    PetscCall(FlowCellMetric(f, c, &m));
    if (f->par.convection) {
      FlowCellGather(l, c, f->w, wl);
      for (PetscInt i = 0; i < size; i++) wl[i] *= f->par.density * s->theta;
    }
    ElementOperator(&f->element, &m, f->par.density * s->ct, f->par.viscosity * s->theta, f->par.convection ? wl : NULL, f->par.skew, ce);
    add_cell(f, c, nbp, ce, value[0], value[1]);
  }
  for (PetscInt t = 0; t < f->nterm; t++) add_cell(f, f->term_cell[t], l->nb, f->term + t * l->nb * l->nb, value[0], value[1]);
  for (PetscInt k = 0; k < 2 && part[k]; k++) PetscCall(MatSeqAIJRestoreArray(part[k], &value[k]));
  PetscCall(MatAssemblyBegin(f->S, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(f->S, MAT_FINAL_ASSEMBLY));
  f->s_ct    = s->ct;
  f->s_theta = s->theta;
  PetscCall(PetscLogFlops(2.0 * l->ncell_all * f->element.nq * l->nb * (l->nb + 3 * l->dim)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAssemble(Flow f)
{
  PetscFunctionBeginUser;
  if (!f->par.convection && f->s_ct == f->step.ct && f->s_theta == f->step.theta) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(f->par.convection ? TB_FLOW_CONVECT : TB_FLOW_ASSEMBLE, 0, 0, 0, 0));
  PetscCall(assemble_matrix(f));
  PetscCall(PetscLogEventEnd(f->par.convection ? TB_FLOW_CONVECT : TB_FLOW_ASSEMBLE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetCellTerms(Flow f, PetscInt n, const PetscInt cell[], const PetscReal matrix[])
{
  PetscFunctionBeginUser;
  f->nterm     = n;
  f->term_cell = cell;
  f->term      = matrix;
  f->s_ct      = 0; /* assemble anew, also without convection */
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
    ElementMetric   m;

    for (PetscInt j = 0; j < nb; j++) {
      for (PetscInt a = 0; a < dim; a++) {
        const PetscInt i = node[j] * dim + a;

        al[j * dim + a] = -(s->d0 * f->u[i] + s->d1 * f->u_old[i]) - (f->source ? f->source[i] / f->par.density : 0);
        vl[j * dim + a] = (1 - s->theta) * f->u[i];
        wl[j * dim + a] = f->w[i];
      }
    }
    PetscCall(FlowCellMetric(f, c, &m));
    ElementResidual(&f->element, &m, f->par.density, f->par.viscosity, f->par.force, al, s->theta < 1 ? vl : NULL, f->par.convection ? wl : NULL,
                    f->par.skew, rl);
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

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_DIV, 0, 0, 0, 0));
  ElementDivergence(l->dim, l->ncell, l->cell_node, f->b, u, y);
  PetscCall(PetscLogFlops(2.0 * l->ncell * (l->dim + 1) * l->nb * l->dim));
  PetscCall(PetscLogEventEnd(TB_FLOW_DIV, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGradient(Flow f, PetscReal scale, const PetscReal p[], PetscReal r[])
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_DIV, 0, 0, 0, 0));
  PetscCall(PetscArrayzero(r, l->nnode_all * l->dim));
  ElementGradient(l->dim, l->ncell, l->cell_node, f->b, scale, p, r);
  PetscCall(MeshSumNodes(f->mesh, l->dim, r));
  PetscCall(PetscLogFlops(2.0 * l->ncell * (l->dim + 1) * l->nb * l->dim));
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

static void extrapolate_convection(Flow f)
{
  for (PetscInt i = 0; i < f->loc->nnode_all * f->loc->dim && f->par.convection; i++) f->w[i] = f->u[i] + f->ahead * (f->u[i] - f->u_old[i]);
  for (PetscInt i = 0; i < f->loc->nnode_all * f->loc->dim && f->bend > 0; i++)
    f->w[i] += f->bend * ((f->u[i] - f->u_old[i]) / f->dt_old - (f->u_old[i] - f->u_older[i]) / f->dt_older);
  for (PetscInt i = 0; i < f->loc->nnode_all * f->loc->dim && f->drift; i++) f->w[i] -= f->drift[i];
}

/* ---- life cycle ---- */

PetscErrorCode FlowReadFluid(PetscInt dim, PetscReal *density, PetscReal gravity[])
{
  PetscFunctionBeginUser;
  PetscCall(OptReal("-flow_density", density));
  PetscCall(OptRealArray("-flow_gravity", dim, gravity, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_parameters(Flow f)
{
  FlowParameters *p    = &f->par;
  const PetscInt  dim  = f->loc->dim;
  PetscInt        form = 0;

  PetscFunctionBeginUser;
  p->density    = 1;
  p->viscosity  = 0.01;
  p->convection = PETSC_TRUE;
  f->scheme     = SCHEME_BDF2;
  PetscCall(FlowReadFluid(dim, &p->density, p->gravity));
  PetscCall(OptReal("-flow_viscosity", &p->viscosity));
  PetscCall(OptRealArray("-flow_force", dim, p->force, NULL));
  PetscCall(OptRealArray("-flow_velocity", dim, p->velocity, NULL));
  PetscCall(OptBool("-flow_convection", &p->convection));
  PetscCall(OptChoice("-flow_convection_form", FORMS, &form));
  p->skew = form == 1 ? 0.5 : 0;
  PetscCall(OptChoice("-flow_time", SCHEMES, &f->scheme));
  PetscCall(OptChoice("-flow_extrapolation", EXTRAPOLATIONS, &p->quadratic));
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
  PetscCall(ElementCreate(dim, &f->element));
  PetscCall(PetscMalloc5(l->ncell_all, &f->affine, l->ncell_all * dim * dim, &f->inverse, l->ncell_all, &f->det, l->ncell_all, &f->size, l->nnode_all,
                         &f->lumped));
  PetscCall(PetscMalloc1(l->ncell_all * (dim + 1) * l->nb * dim, &f->b));
  PetscCall(PetscMalloc1(l->ncell * (dim + 1) * (dim + 1), &f->pmass));
  PetscCall(PetscCalloc4(l->nnode_all, &f->open, l->ncell_all, &f->visited, l->ncell_all, &f->around, l->ncell_all * dim, &f->centre));
  PetscCall(compute_cells(f));
  PetscCall(ConditionsCreate(mesh, &f->boundary));
  PetscCall(PetscCalloc1(l->nnode_all * dim, &f->u)); /* each on its own: accepted steps swap them */
  PetscCall(PetscCalloc1(l->nnode_all * dim, &f->u_old));
  if (f->par.quadratic) PetscCall(PetscCalloc1(l->nnode_all * dim, &f->u_older));
  for (PetscInt i = 0; i < l->nnode_all * dim; i++) f->u[i] = f->u_old[i] = f->par.velocity[i % dim];
  PetscCall(PetscCalloc1(l->nnode_all * dim, &f->w));
  PetscCall(PetscCalloc2(l->ncell * (dim + 1), &f->p, l->ncell * (dim + 1), &f->p_old));
  PetscCall(create_matrix(f));
  *flow = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Pressures given about `centre` with cell size `size`, as the same polynomial about the present centre and size of cell c */
static void carry_pressure(const struct _p_Flow *f, PetscInt c, const PetscReal centre[], PetscReal size, PetscReal p[])
{
  const PetscInt dim = f->loc->dim;

  for (PetscInt a = 0; a < dim; a++) {
    p[0] += p[1 + a] * MeshNearest(f->loc, a, f->centre[c * dim + a] - centre[a]) / size;
    p[1 + a] *= f->size[c] / size;
  }
}

/* Pressures of an own cell that has joined the fluid: the mean of what the own cells around it that were fluid before, visited == before, say about its centre */
static void adopt_pressure(const struct _p_Flow *f, PetscInt c, PetscInt before, PetscReal p[])
{
  const MeshLocal *l  = f->loc;
  const PetscInt   nk = l->dim + 1;
  PetscReal       *pc = p + c * nk, n = 0;

  for (PetscInt k = 0; k < nk; k++) pc[k] = 0;
  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscInt i = l->cell_node[c * l->nb + j];

    for (PetscInt t = l->node_cell_ptr[i]; t < l->node_cell_ptr[i + 1]; t++) {
      const PetscInt from = l->node_cell[t];
      PetscReal      q[4];

      if (from >= l->ncell || f->det[from] == 0 || f->visited[from] == before) continue;
      for (PetscInt k = 0; k < nk; k++) q[k] = p[from * nk + k];
      carry_pressure(f, c, f->centre + from * l->dim, f->size[from], q);
      for (PetscInt k = 0; k < nk; k++) pc[k] += q[k];
      n++;
    }
  }
  for (PetscInt k = 0; k < nk && n > 0; k++) pc[k] /= n;
}

PetscErrorCode FlowUpdateCells(Flow f, PetscInt n, const PetscInt cells[], const PetscInt cell_body[])
{
  const MeshLocal *l       = f->loc;
  PetscInt         naround = 0;

  PetscFunctionBeginUser;
  f->now++;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt  c = cells[e], dim = l->dim;
    const PetscReal size = f->size[c], centre[3] = {f->centre[c * dim], f->centre[c * dim + 1], dim == 3 ? f->centre[c * dim + 2] : 0};
    const PetscBool dead = (PetscBool)(f->det[c] == 0);

    if (cell_body[c] >= 0) PetscCall(empty_cell(f, c));
    else PetscCall(compute_cell(f, c));
    if (dead) f->visited[c] = f->now;
    for (PetscInt s = 0; s < 2 && c < l->ncell; s++) {
      PetscReal *pc = (s ? f->p_old : f->p) + c * (dim + 1);

      if (cell_body[c] >= 0) PetscCall(PetscArrayzero(pc, dim + 1));
      else if (!dead) carry_pressure(f, c, centre, size, pc);
    }
    for (PetscInt j = 0; j < l->nb; j++) {
      f->open[l->cell_node[cells[e] * l->nb + j]]   = f->now + 1;
      f->lumped[l->cell_node[cells[e] * l->nb + j]] = 0;
    }
  }
  for (PetscInt e = 0; e < n; e++) {
    if (cells[e] >= l->ncell || f->visited[cells[e]] != f->now || cell_body[cells[e]] >= 0) continue;
    adopt_pressure(f, cells[e], f->now, f->p);
    adopt_pressure(f, cells[e], f->now, f->p_old);
  }
  f->now++;
  for (PetscInt e = 0; e < n * l->nb;
       e++) { /* cells around changed cells, each once, in the order of compute_cells: sums do not depend on what changed before */
    const PetscInt i = l->cell_node[cells[e / l->nb] * l->nb + e % l->nb];

    for (PetscInt t = l->node_cell_ptr[i]; t < l->node_cell_ptr[i + 1]; t++) {
      if (f->visited[l->node_cell[t]] == f->now) continue;
      f->visited[l->node_cell[t]] = f->now;
      f->around[naround++]        = l->node_cell[t];
    }
  }
  PetscCall(PetscSortInt(naround, f->around));
  for (PetscInt e = 0; e < naround; e++) PetscCall(lump_cell(f, f->around[e]));
  PetscCall(MeshSyncNodes(f->mesh, 1, f->lumped));
  f->s_ct = 0;
  extrapolate_convection(f);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowRestoreCells(Flow f, PetscInt n, const PetscInt cells[], const PetscInt cell_body[])
{
  const PetscInt np = f->loc->ncell * (f->loc->dim + 1);
  PetscReal     *keep;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(2 * np, &keep));
  PetscCall(PetscArraycpy(keep, f->p, np));
  PetscCall(PetscArraycpy(keep + np, f->p_old, np));
  PetscCall(FlowUpdateCells(f, n, cells, cell_body));
  PetscCall(PetscArraycpy(f->p, keep, np));
  PetscCall(PetscArraycpy(f->p_old, keep + np, np));
  PetscCall(PetscFree(keep));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDestroy(Flow *flow)
{
  Flow f = *flow;

  PetscFunctionBeginUser;
  if (!f) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatDestroy(&f->S));
  PetscCall(PetscFree(f->entry));
  PetscCall(PetscFree(f->b));
  PetscCall(PetscFree(f->pmass));
  PetscCall(ElementDestroy(&f->element));
  PetscCall(PetscFree4(f->open, f->visited, f->around, f->centre));
  PetscCall(PetscFree5(f->affine, f->inverse, f->det, f->size, f->lumped));
  PetscCall(ConditionsDestroy(&f->boundary));
  PetscCall(PetscFree(f->u));
  PetscCall(PetscFree(f->u_old));
  PetscCall(PetscFree(f->u_older));
  PetscCall(PetscFree(f->w));
  PetscCall(PetscFree(f->source));
  PetscCall(PetscFree2(f->p, f->p_old));
  PetscCall(PetscFree(*flow));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowView(Flow f, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer, "flow: density %g, viscosity %g, time scheme %s, %s\n", (double)f->par.density, (double)f->par.viscosity,
                                   SCHEMES[f->scheme],
                                   f->par.convection ? "Navier-Stokes (convection extrapolated)" : "Stokes (no convection assembled)"));
  PetscCall(ConditionsView(f->boundary, viewer));
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

PetscErrorCode FlowGetSubsteps(Flow f, PetscInt *n, const PetscReal *fraction[])
{
  static const PetscReal whole[1] = {1}, parts[3] = {FSTHETA, 1 - 2 * FSTHETA, FSTHETA};

  PetscFunctionBeginUser;
  *n = f->scheme == SCHEME_FSTHETA ? 3 : 1;
  if (fraction) *fraction = f->scheme == SCHEME_FSTHETA ? parts : whole;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetSource(Flow f, VectorField field, void *ctx)
{
  PetscFunctionBeginUser;
  f->source_field = field;
  f->source_ctx   = ctx;
  PetscCall(PetscFree(f->source));
  if (field) PetscCall(PetscCalloc1(f->loc->nnode_all * f->loc->dim, &f->source));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* theta times the source at the end of the step + (1 - theta) times that at its beginning */
static PetscErrorCode evaluate_source(Flow f)
{
  const PetscInt  dim = f->loc->dim;
  const FlowStep *s   = &f->step;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < f->loc->nnode_all && f->source; i++) {
    PetscReal end[3], begin[3] = {0, 0, 0};

    PetscCall(f->source_field(f->source_ctx, s->time, f->loc->x + i * dim, end));
    if (s->theta < 1) PetscCall(f->source_field(f->source_ctx, s->time - s->dt, f->loc->x + i * dim, begin));
    for (PetscInt a = 0; a < dim; a++) f->source[i * dim + a] = s->theta * end[a] + (1 - s->theta) * begin[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowBeginStep(Flow f, PetscReal time, PetscReal dt)
{
  FlowStep       *s     = &f->step;
  const PetscBool first = (PetscBool)(f->nsteps == 0);
  const PetscReal r     = first ? 0 : dt / f->dt_old; /* ratio of steps */

  PetscFunctionBeginUser;
  s->time   = time;
  s->dt     = dt;
  s->dt_old = first ? 0 : f->dt_old;
  s->error  = 0.5;
  s->ct     = 1 / dt;
  s->d0     = 1 / dt;
  s->d1     = 0;
  s->theta  = 1;
  s->order  = 1;
  f->ahead  = 0;
  if (f->scheme == SCHEME_BDF2 && !first) {
    s->ct    = (1 + 2 * r) / ((1 + r) * dt);
    s->d0    = (1 + r) / dt;
    s->d1    = -r * r / ((1 + r) * dt);
    f->ahead = r;
    s->order = 2;
    s->error = PetscSqr(1 + 1 / r) / (6 * (2 + 1 / r));
  } else if (f->scheme == SCHEME_CN || f->scheme == SCHEME_FSTHETA) {
    s->theta = f->scheme == SCHEME_CN ? 0.5 : (f->substep == 1 ? FSTHETA : 1 - 2 * FSTHETA) / (1 - FSTHETA);
    f->ahead = s->theta * r;
    s->order = first ? 1 : 2;
    s->error = f->scheme == SCHEME_CN ? 1. / 12 : 0;
  }
  f->bend = f->dt_older > 0 ? f->ahead * (f->ahead + 1) * f->dt_old * f->dt_old / (f->dt_old + f->dt_older) : 0; /* Newton's interpolation */
  extrapolate_convection(f);
  PetscCall(evaluate_source(f));
  PetscCall(ConditionsSetTime(f->boundary, time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowBeginSteady(Flow f, PetscReal rate)
{
  FlowStep *s = &f->step;

  PetscFunctionBeginUser;
  s->time  = 0;
  s->dt    = 0;
  s->ct    = rate;
  s->d0    = rate;
  s->d1    = 0;
  s->theta = 1;
  s->order = 1;
  f->ahead = 0;
  PetscCall(FlowSetConvection(f, f->u));
  PetscCall(evaluate_source(f));
  PetscCall(ConditionsSetTime(f->boundary, PETSC_MAX_REAL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetDrift(Flow f, const PetscReal drift[])
{
  PetscFunctionBeginUser;
  PetscCheck(f->step.theta == 1 && f->par.convection && f->par.skew == 0 && !f->par.quadratic, PETSC_COMM_WORLD, PETSC_ERR_SUP,
             "A mesh that follows bodies (-mesh_deform) carries its velocity in the convection at the end of a step: use -flow_time bdf2 or be, -flow_convection true, "
             "-flow_convection_form convective and -flow_extrapolation linear, or remove -mesh_deform");
  f->drift = drift;
  extrapolate_convection(f);
  PetscCall(evaluate_source(f));
  PetscCall(ConditionsSetTime(f->boundary, f->step.time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetConvection(Flow f, const PetscReal w[])
{
  PetscFunctionBeginUser;
  if (f->par.convection) PetscCall(PetscArraycpy(f->w, w, f->loc->nnode_all * f->loc->dim));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetStep(Flow f, const FlowStep **step)
{
  PetscFunctionBeginUser;
  *step = &f->step;
  PetscFunctionReturn(PETSC_SUCCESS);
}

Conditions FlowConditions(Flow f)
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

PetscErrorCode FlowGetCellSize(Flow f, const PetscReal *h[])
{
  PetscFunctionBeginUser;
  *h = f->size;
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

PetscErrorCode FlowExtrapolate(Flow f, PetscReal u[], PetscReal p[], PetscReal dp[])
{
  const PetscReal r = f->nsteps > 1 ? f->step.dt / f->dt_old : 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < f->loc->nnode_all * f->loc->dim; i++) u[i] = f->u[i] + r * (f->u[i] - f->u_old[i]);
  PetscCall(PetscArraycpy(p, f->p, f->loc->ncell * (f->loc->dim + 1)));
  for (PetscInt i = 0; i < f->loc->ncell * (f->loc->dim + 1) && dp; i++) dp[i] = f->nsteps > 1 ? f->p[i] - f->p_old[i] : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAcceptStep(Flow f, const PetscReal u[], const PetscReal p[])
{
  PetscReal *swap;

  PetscFunctionBeginUser;
  swap        = f->u_older ? f->u_older : f->u_old;
  f->u_older  = f->u_older ? f->u_old : NULL;
  f->dt_older = f->u_older && f->nsteps ? f->dt_old : 0;
  f->u_old    = f->u;
  f->u        = swap;
  PetscCall(PetscArraycpy(f->u, u, f->loc->nnode_all * f->loc->dim));
  PetscCall(PetscArraycpy(f->p_old, f->p, f->loc->ncell * (f->loc->dim + 1)));
  PetscCall(PetscArraycpy(f->p, p, f->loc->ncell * (f->loc->dim + 1)));
  f->dt_old = f->step.dt;
  f->nsteps++;
  f->substep = f->scheme == SCHEME_FSTHETA ? (f->substep + 1) % 3 : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowVisitState(void *flow, State state)
{
  Flow           f     = flow;
  const PetscInt dim   = f->loc->dim;
  PetscInt       older = f->u_older ? 1 : -1; /* as loaded: -1 if the run had linear extrapolation; then the first step is linear too */

  PetscFunctionBeginUser;
  PetscCall(StateNodes(state, "velocity", dim, f->u));
  PetscCall(StateNodes(state, "velocity_old", dim, f->u_old));
  PetscCall(StateCells(state, "pressure", dim + 1, f->p));
  PetscCall(StateCells(state, "pressure_old", dim + 1, f->p_old));
  PetscCall(StateReals(state, "dt_old", 1, &f->dt_old));
  if (f->u_older && StateIsLoading(state)) PetscCall(StateGetSize(state, "velocity_older", &older));
  if (older >= 0) PetscCall(StateNodes(state, "velocity_older", dim, f->u_older));
  if (older >= 0) PetscCall(StateReals(state, "dt_older", 1, &f->dt_older));
  PetscCall(StateInts(state, "steps", 1, &f->nsteps));
  PetscCall(StateInts(state, "substep", 1, &f->substep));
  PetscFunctionReturn(PETSC_SUCCESS);
}
