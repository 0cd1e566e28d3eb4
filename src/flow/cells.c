/* Flow: what it keeps of the cells (metric, size, cell matrices of B, masses), and their change when nodes move or
   cells join and leave the fluid (see flow.h). */
#include "compat.h"
#include "base/agree.h"
#include "impl.h"
#include "base/algebra.h"

/* An inactive cell, no part of the fluid, has zero weights: every kernel then gives zero. Its size stays as it was. */
static PetscErrorCode set_inactive(Flow f, PetscInt c)
{
  PetscFunctionBeginUser;
  f->cells.affine[c] = PETSC_TRUE;
  f->cells.det[c]    = 0;
  f->cells.b[c]      = f->cells.kind[0].b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Most forms of cells whose matrices of B are shared: sizes of refined meshes times codes of hanging nodes */
#define MAX_KINDS 1024
#define ALIKE     1e-11 /* of the largest entry: round-off of coordinates, in units of a cell */

static PetscReal find_largest(PetscInt n, const PetscReal a[])
{
  PetscReal largest = 0;

  for (PetscInt i = 0; i < n; i++) largest = PetscMax(largest, PetscAbsReal(a[i]));
  return largest;
}

static PetscBool is_alike(PetscInt n, const PetscReal a[], const PetscReal b[], PetscReal difference)
{
  for (PetscInt i = 0; i < n; i++)
    if (PetscAbsReal(a[i] - b[i]) > difference) return PETSC_FALSE;
  return PETSC_TRUE;
}

/* Matrix b of cell c and its inverse mass of the pressure: those of a kind where b is alike, else its own, or when all
   are computed for the first time a new kind (what comes later would depend on the past) */
static PetscErrorCode keep_divergence(Flow f, PetscInt c, const PetscReal b[], const PetscReal mass[],
                                      PetscBool first_time)
{
  const PetscInt  n = FlowDivergenceSize(f), nn = PetscSqr(f->loc->dim + 1);
  const PetscReal difference = ALIKE * find_largest(n, b);

  PetscFunctionBeginUser;
  for (PetscInt k = 1; k < f->cells.nkind; k++) {
    if (PetscAbsReal(f->cells.size[c] - f->cells.kind[k].size) > ALIKE * f->cells.size[c] ||
        !is_alike(n, b, f->cells.kind[k].b, difference))
      continue;
    f->cells.b[c] = f->cells.kind[k].b;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (first_time && f->cells.nkind < MAX_KINDS) {
    f->cells.kind[f->cells.nkind].size = f->cells.size[c];
    PetscCall(PetscCalloc1(n + nn + f->loc->nb, &f->cells.kind[f->cells.nkind].b));
    f->cells.b[c] = f->cells.kind[f->cells.nkind++].b;
  } else {
    if (!f->cells.b_own[c]) PetscCall(PetscMalloc1(n + nn, &f->cells.b_own[c]));
    f->cells.b[c] = f->cells.b_own[c];
  }
  PetscCall(PetscArraycpy(f->cells.b[c], b, n));
  PetscCall(PetscArraycpy(f->cells.b[c] + n, mass, nn));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCreateCells(Flow f)
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc5(l->ncell_all, &f->cells.affine, l->ncell_all * dim * dim, &f->cells.inverse, l->ncell_all,
                         &f->cells.det, l->ncell_all, &f->cells.size, l->nnode_all, &f->cells.lumped));
  PetscCall(PetscCalloc4(l->nnode_all, &f->cells.open, l->ncell_all, &f->cells.visited, l->ncell_all,
                         &f->cells.neighbour, l->ncell_all * dim, &f->cells.centre));
  PetscCall(PetscCalloc3(l->ncell_all, &f->cells.b, l->ncell_all, &f->cells.b_own, MAX_KINDS, &f->cells.kind));
  PetscCall(PetscCalloc1(FlowDivergenceSize(f) + PetscSqr(dim + 1) + l->nb, &f->cells.kind[0].b));
  f->cells.nkind = 1;
  f->cells.ncell = l->ncell_all;
  f->cells.now   = 0;
  PetscCall(FlowComputeCells(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDestroyCells(Flow f)
{
  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < f->cells.ncell; c++) PetscCall(PetscFree(f->cells.b_own[c])); /* the mesh may have changed */
  for (PetscInt k = 0; k < f->cells.nkind; k++) PetscCall(PetscFree(f->cells.kind[k].b));
  PetscCall(PetscFree3(f->cells.b, f->cells.b_own, f->cells.kind));
  PetscCall(PetscFree4(f->cells.open, f->cells.visited, f->cells.neighbour, f->cells.centre));
  PetscCall(PetscFree5(f->cells.affine, f->cells.inverse, f->cells.det, f->cells.size, f->cells.lumped));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What hangs in a cell, -1: nothing */
static PetscInt get_hang_code(const MeshLocal *l, PetscInt c)
{
  return MeshCellHang(l, c) ? MeshCellHang(l, c)->code : -1;
}

/* A box like one of a kind takes over all that is kept of it; false: there is none */
static PetscBool copy_box(Flow f, PetscInt c, const PetscReal edge[3])
{
  const PetscInt dim = f->loc->dim, code = get_hang_code(f->loc, c);

  for (PetscInt k = 1; k < f->cells.nkind; k++) {
    const CellKind *kind = &f->cells.kind[k];
    PetscBool       same = (PetscBool)(kind->hang_code == code);

    for (PetscInt d = 0; d < dim && same; d++)
      same = (PetscBool)(same && PetscAbsReal(edge[d] - kind->edge[d]) <= ALIKE * edge[d]);
    if (!same) continue;
    f->cells.affine[c] = PETSC_TRUE;
    f->cells.det[c]    = kind->det;
    f->cells.size[c]   = kind->size;
    f->cells.b[c]      = kind->b;
    for (PetscInt i = 0; i < dim * dim; i++)
      f->cells.inverse[c * dim * dim + i] = i % (dim + 1) == 0 ? 2 / kind->edge[i / dim] : 0;
    return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* Metric of cell c with nodes xc [nb][dim]: whether it is affine, its Jacobian, its size */
static PetscErrorCode measure_cell(Flow f, PetscInt c, const PetscReal xc[], ElementMetric *m)
{
  const PetscInt   dim    = f->loc->dim;
  const PetscReal *centre = xc + (f->loc->nb / 2) * dim;
  PetscReal        first[9], volume = 0;

  PetscFunctionBeginUser;
  f->cells.affine[c] = PETSC_FALSE;
  PetscCall(FlowCellMetric(f, c, m));
  PetscCall(PetscArraycpy(first, m->inverse[0], dim * dim));
  f->cells.affine[c] = PETSC_TRUE;
  for (PetscInt q = 0; q < f->element.nq; q++) {
    PetscReal scale = 0, diff = 0;

    PetscCheck(m->weight[q] > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Mesh cell near (%g, %g) has a Jacobian of %g at a quadrature point: the mesh is tangled there",
               (double)centre[0], (double)centre[1], (double)(m->weight[q] / f->element.weight[q]));
    volume += m->weight[q];
    for (PetscInt i = 0; i < dim * dim; i++) {
      scale = PetscMax(scale, PetscAbsReal(first[i]));
      diff  = PetscMax(diff, PetscAbsReal(first[i] - m->inverse[q][i]));
    }
    if (diff > 1e-10 * scale) f->cells.affine[c] = PETSC_FALSE;
  }
  PetscCall(PetscArraycpy(f->cells.inverse + c * dim * dim, first, dim * dim));
  f->cells.det[c]  = m->weight[0] / f->element.weight[0];
  f->cells.size[c] = PetscPowReal(volume, 1.0 / dim);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of a cell that shares what a kind keeps: where the lumped masses are kept, 0 in the middle if it is no box */
static PetscReal *get_kind_mass(Flow f, PetscInt c)
{
  return f->cells.b[c] == f->cells.b_own[c] ? NULL : f->cells.b[c] + FlowDivergenceSize(f) + PetscSqr(f->loc->dim + 1);
}

/* Lumped mass of a cell, in its slots: mass [nb] += */
static PetscErrorCode lump_slots(Flow f, PetscInt c, PetscReal mass[])
{
  ElementMetric m;

  PetscFunctionBeginUser;
  PetscCall(FlowCellMetric(f, c, &m));
  for (PetscInt j = 0; j < f->loc->nb; j++)
    for (PetscInt q = 0; q < f->element.nq; q++) mass[j] += m.weight[q] * f->element.phi[q * f->element.nbp + j];
  MeshCellScatter(f->loc, c, 1, mass);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Affine test, size, cell matrices of B and inverse pressure mass of a cell */
static PetscErrorCode compute_cell(Flow f, PetscInt c, PetscBool first_time)
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, nb = l->nb, nk           = dim + 1;
  PetscReal        xc[MESH_MAX_NB * 3], edge[3], mass[16] = {0}, pmass[16], b[4 * MESH_MAX_NB * 3] = {0};
  const PetscReal *centre = xc + (nb / 2) * dim;
  const PetscInt   before = f->cells.nkind;
  PetscBool        box;
  ElementMetric    m;

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(f->mesh, c, xc));
  PetscCall(PetscArraycpy(f->cells.centre + c * dim, centre, dim));
  box = MeshIsBox(l->dim, l->nb, xc, ALIKE, edge);
  if (box && copy_box(f, c, edge)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(measure_cell(f, c, xc, &m));
  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal *phi = f->element.phi + q * f->element.nbp;
    PetscReal        g[3][ELEMENT_MAX_NBP], x[3] = {0, 0, 0}, psi[4];

    ElementGradients(&f->element, &m, q, g);
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) x[a] += phi[j] * xc[j * dim + a];
    psi[0] = 1;
    for (PetscInt a = 0; a < dim; a++) psi[1 + a] = (x[a] - centre[a]) / f->cells.size[c];
    for (PetscInt k = 0; k < nk; k++) {
      for (PetscInt n = 0; n < nk; n++) mass[k * nk + n] += m.weight[q] * psi[k] * psi[n];
      for (PetscInt j = 0; j < nb; j++)
        for (PetscInt a = 0; a < dim; a++) b[k * nb * dim + j * dim + a] += m.weight[q] * psi[k] * g[a][j];
    }
  }
  for (PetscInt k = 0; k < nk; k++) MeshCellScatter(l, c, dim, b + k * nb * dim);
  DenseInvert(nk, mass, pmass);
  PetscCall(keep_divergence(f, c, b, pmass, first_time));
  if (box && f->cells.nkind > before) {
    f->cells.kind[before].det       = f->cells.det[c];
    f->cells.kind[before].hang_code = get_hang_code(l, c);
    PetscCall(PetscArraycpy(f->cells.kind[before].edge, edge, dim));
    if (l->hang) PetscCall(lump_slots(f, c, get_kind_mass(f, c)));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Add the lumped mass of cell c to those of its nodes whose mass is being computed */
static PetscErrorCode lump_cell(Flow f, PetscInt c)
{
  const PetscInt  *node              = f->loc->cell_node + c * f->loc->nb;
  const PetscReal *kept              = get_kind_mass(f, c);
  PetscReal        mass[MESH_MAX_NB] = {0};
  ElementMetric    m;

  PetscFunctionBeginUser;
  if (f->loc->hang) {
    if (!f->cells.affine[c] || !kept || kept[f->loc->nb / 2] == 0) {
      PetscCall(lump_slots(f, c, mass));
      kept = mass;
    }
    for (PetscInt j = 0; j < f->loc->nb; j++)
      if (f->cells.open[node[j]] == f->cells.now) f->cells.lumped[node[j]] += kept[j];
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(FlowCellMetric(f, c, &m));
  for (PetscInt j = 0; j < f->loc->nb; j++)
    for (PetscInt q = 0; q < f->element.nq && f->cells.open[node[j]] == f->cells.now; q++)
      f->cells.lumped[node[j]] += m.weight[q] * f->element.phi[q * f->element.nbp + j];
  PetscFunctionReturn(PETSC_SUCCESS);
}

#define MIN_ROW 0.2 /* of the mass in proportion to the diagonal, 1 or so away from interfaces */

/* The mass of a cell in proportion to the diagonal of its mass matrix (Hinton, Rock & Zienkiewicz 1976), in its slots:
   mass [nb] += ; an inactive one has none */
static PetscErrorCode scale_diagonal(Flow f, PetscInt c, PetscReal mass[])
{
  const PetscInt nb                    = f->loc->nb;
  PetscReal      diagonal[MESH_MAX_NB] = {0}, volume = 0, sum = 0;
  ElementMetric  m;

  PetscFunctionBeginUser;
  PetscCall(FlowCellMetric(f, c, &m));
  for (PetscInt q = 0; q < f->element.nq; q++) {
    volume += m.weight[q];
    for (PetscInt j = 0; j < nb; j++) diagonal[j] += m.weight[q] * PetscSqr(f->element.phi[q * f->element.nbp + j]);
  }
  for (PetscInt j = 0; j < nb; j++) sum += diagonal[j];
  for (PetscInt j = 0; j < nb; j++) diagonal[j] *= sum > 0 ? volume / sum : 0;
  MeshCellScatter(f->loc, c, 1, diagonal);
  for (PetscInt j = 0; j < nb; j++) mass[j] += diagonal[j];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowUpdateInertia(Flow f)
{
  const MeshLocal *l = f->loc;
  Properties      *p = &f->properties;

  PetscFunctionBeginUser;
  if (!p->density) PetscFunctionReturn(PETSC_SUCCESS);
  if (!p->inertia) PetscCall(PetscMalloc2(l->nnode_all, &p->inertia, l->nnode_all, &p->mass));
  PetscCall(PetscArrayzero(p->inertia, l->nnode_all));
  PetscCall(PetscArrayzero(p->mass, l->nnode_all));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal row[MESH_MAX_NB] = {0}, mass[MESH_MAX_NB] = {0};

    PetscCall(lump_slots(f, c, row));
    PetscCall(scale_diagonal(f, c, mass));
    for (PetscInt j = 0; j < l->nb; j++) {
      p->inertia[l->cell_node[c * l->nb + j]] += FlowDensityRatio(f, c) * row[j];
      p->mass[l->cell_node[c * l->nb + j]] += FlowDensityRatio(f, c) * mass[j];
    }
  }
  PetscCall(MeshSyncNodes(f->mesh, 1, p->inertia));
  PetscCall(MeshSyncNodes(f->mesh, 1, p->mass));
  for (PetscInt i = 0; i < l->nnode_all; i++) /* row sums keep momentum */
    if (p->inertia[i] > MIN_ROW * p->mass[i]) p->mass[i] = p->inertia[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowComputeCells(Flow f)
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(f->cells.lumped, f->loc->nnode_all));
  for (PetscInt c = 0; c < f->loc->ncell_all; c++) {
    PetscCall(compute_cell(f, c, PETSC_TRUE));
    PetscCall(lump_cell(f, c));
  }
  PetscCall(MeshSyncNodes(f->mesh, 1, f->cells.lumped)); /* own nodes see all their cells; outer ghosts do not */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Pressures about `centre` with cell size `size`, as the same polynomial about the present ones of cell c */
static void carry_pressure(const struct _p_Flow *f, PetscInt c, const PetscReal centre[], PetscReal size, PetscReal p[])
{
  const PetscInt dim = f->loc->dim;

  for (PetscInt a = 0; a < dim; a++) {
    p[0] += p[1 + a] * MeshNearest(f->loc, a, f->cells.centre[c * dim + a] - centre[a]) / size;
    p[1 + a] *= f->cells.size[c] / size;
  }
}

/* pc [dim + 1] = mean of what the own cells around c that were fluid before, visited != before, say about its centre;
   those of its own material alone; *n: how many */
static void average_around(const struct _p_Flow *f, PetscInt c, PetscInt before, const PetscInt *cell_material,
                           const PetscReal p[], PetscReal pc[], PetscReal *n)
{
  const MeshLocal *l  = f->loc;
  const PetscInt   nk = l->dim + 1;

  *n = 0;
  for (PetscInt k = 0; k < nk; k++) pc[k] = 0;
  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscInt i = l->cell_node[c * l->nb + j];

    for (PetscInt t = l->node_cell_ptr[i]; t < l->node_cell_ptr[i + 1]; t++) {
      const PetscInt from = l->node_cell[t];
      PetscReal      q[4];

      if (from >= l->ncell || f->cells.det[from] == 0 || f->cells.visited[from] == before) continue;
      if (cell_material && cell_material[from] != cell_material[c]) continue;
      for (PetscInt k = 0; k < nk; k++) q[k] = p[from * nk + k];
      carry_pressure(f, c, f->cells.centre + from * l->dim, f->cells.size[from], q);
      for (PetscInt k = 0; k < nk; k++) pc[k] += q[k];
      (*n)++;
    }
  }
  for (PetscInt k = 0; k<nk && * n> 0; k++) pc[k] /= *n;
}

/* Pressures of an own cell that has joined the fluid: of its own material, or where none is around of any */
static void start_pressure(const struct _p_Flow *f, PetscInt c, PetscInt before, const PetscInt cell_material[],
                           PetscReal p[])
{
  PetscReal *pc = p + c * (f->loc->dim + 1), n;

  average_around(f, c, before, cell_material, p, pc, &n);
  if (n == 0) average_around(f, c, before, NULL, p, pc, &n);
}

/* Cells that have moved; pressures stay the same polynomials, except in those that were inactive. Not collective: it
   may find a tangled cell. */
static PetscErrorCode move_cells(Flow f, PetscInt n, const PetscInt cells[], const PetscInt cell_material[])
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt  c = cells[e], dim = l->dim;
    const PetscReal size = f->cells.size[c], centre[3] = {f->cells.centre[c * dim], f->cells.centre[c * dim + 1],
                                                          dim == 3 ? f->cells.centre[c * dim + 2] : 0};
    const PetscBool inactive_before = (PetscBool)(f->cells.det[c] == 0);

    if (cell_material[c] < 0) PetscCall(set_inactive(f, c));
    else PetscCall(compute_cell(f, c, PETSC_FALSE));
    if (inactive_before) f->cells.visited[c] = f->cells.now;
    for (PetscInt s = 0; s < 2 && c < l->ncell; s++) {
      PetscReal *pc = (s ? f->p_old : f->p) + c * (dim + 1);

      if (cell_material[c] < 0) PetscCall(PetscArrayzero(pc, dim + 1));
      else if (!inactive_before) carry_pressure(f, c, centre, size, pc);
    }
    for (PetscInt j = 0; j < l->nb; j++) {
      f->cells.open[l->cell_node[cells[e] * l->nb + j]]   = f->cells.now + 1;
      f->cells.lumped[l->cell_node[cells[e] * l->nb + j]] = 0;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowUpdateCells(Flow f, PetscInt n, const PetscInt cells[], const PetscInt cell_material[])
{
  const MeshLocal *l          = f->loc;
  PetscInt         nneighbour = 0;

  PetscFunctionBeginUser;
  f->cells.now++;
  if (f->material && f->material->move) PetscCall((*f->material->move)(f, n, cells));
  AgreeEnter();
  PetscCall(AgreeReturn(move_cells(f, n, cells, cell_material)));
  for (PetscInt e = 0; e < n; e++) {
    if (cells[e] >= l->ncell || f->cells.visited[cells[e]] != f->cells.now || cell_material[cells[e]] < 0) continue;
    start_pressure(f, cells[e], f->cells.now, cell_material, f->p);
    start_pressure(f, cells[e], f->cells.now, cell_material, f->p_old);
  }
  f->cells.now++;
  for (PetscInt e = 0; e < n * l->nb; e++) { /* cells around, each once, in the order of FlowComputeCells: sums do not
                                                depend on the past */
    const PetscInt i = l->cell_node[cells[e / l->nb] * l->nb + e % l->nb];

    for (PetscInt t = l->node_cell_ptr[i]; t < l->node_cell_ptr[i + 1]; t++) {
      if (f->cells.visited[l->node_cell[t]] == f->cells.now) continue;
      f->cells.visited[l->node_cell[t]] = f->cells.now;
      f->cells.neighbour[nneighbour++]  = l->node_cell[t];
    }
  }
  PetscCall(PetscSortInt(nneighbour, f->cells.neighbour));
  for (PetscInt e = 0; e < nneighbour; e++) PetscCall(lump_cell(f, f->cells.neighbour[e]));
  PetscCall(MeshSyncNodes(f->mesh, 1, f->cells.lumped));
  f->matrix.ct = 0;
  PetscCall(FlowUpdateInertia(f));
  FlowExtrapolateConvection(f);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowRestoreCells(Flow f, PetscInt n, const PetscInt cells[], const PetscInt cell_material[])
{
  const PetscInt np = f->loc->ncell * (f->loc->dim + 1);
  PetscReal     *keep;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(2 * np, &keep));
  PetscCall(PetscArraycpy(keep, f->p, np));
  PetscCall(PetscArraycpy(keep + np, f->p_old, np));
  PetscCall(FlowUpdateCells(f, n, cells, cell_material));
  PetscCall(PetscArraycpy(f->p, keep, np));
  PetscCall(PetscArraycpy(f->p_old, keep + np, np));
  PetscCall(PetscFree(keep));
  PetscFunctionReturn(PETSC_SUCCESS);
}
