/* Flow: assembly of the velocity matrix and the right-hand side, products with B (see flow.h).

   The velocity matrix is assembled in one pass over the cells, own and ghost, straight into the rows of own nodes: no
   communication, and no second matrix for the constant part, which costs less to compute (element.h) than to load. */
#include "compat.h"
#include "flow/device.h"
#include "impl.h"
#include "lanes.h"
#include "base/inline.h"
#include "base/log.h"
#include "base/array.h"
#include "base/rows.h"
#include "mesh/pattern.h"

PetscErrorCode FlowGetMatrixBlocks(Flow f, Mat block[2], const PetscInt *columns[])
{
  PetscBool seq;

  PetscFunctionBeginUser;
  PetscCall(PetscObjectTypeCompare((PetscObject)f->matrix.S, MATSEQAIJ, &seq));
  block[0] = f->matrix.S;
  block[1] = NULL;
  if (!seq) PetscCall(MatMPIAIJGetSeqAIJ(f->matrix.S, &block[0], &block[1], columns));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void set_entry(Flow f, PetscInt k, PetscInt position, PetscBool other)
{
  const PetscInt half = f->matrix.wide ? 0x8000 : 0x80, e = position < 0 ? 2 * half - 1 : position + (other ? half : 0);

  if (f->matrix.wide) ((unsigned short *)f->matrix.entry)[k] = (unsigned short)e;
  else ((unsigned char *)f->matrix.entry)[k] = (unsigned char)e;
}

/* Array of positions in rows, all of other ranks' rows so far */
static PetscErrorCode create_entries(Flow f, const Mat block[2])
{
  const MeshLocal *l       = f->loc;
  const size_t     n       = (size_t)l->ncell_all * (size_t)l->nb * (size_t)l->nb;
  PetscInt         longest = 0;

  PetscFunctionBeginUser;
  for (PetscInt s = 0; s < 2 && block[s]; s++) {
    Rows r;

    PetscCall(RowsOpen(block[s], &r));
    for (PetscInt i = 0; i < r.n; i++) longest = PetscMax(longest, r.start[i + 1] - r.start[i]);
    PetscCall(RowsClose(&r));
  }
  PetscCheck(longest < 0x7fff, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "A row of the velocity matrix has %" PetscInt_FMT " entries, at most 32766 are possible", longest);
  f->matrix.wide = (PetscBool)(longest >= 0x7f);
  PetscCall(PetscMalloc(n * (f->matrix.wide ? 2 : 1), &f->matrix.entry));
  memset(f->matrix.entry, 0xff, n * (f->matrix.wide ? 2 : 1));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_entries(Flow f)
{
  const MeshLocal *l  = f->loc;
  const PetscInt   nb = l->nb, *global = NULL;
  PetscInt         nother = 0, *column, *at;
  Mat              block[2];
  Rows             r[2];

  PetscFunctionBeginUser;
  PetscCall(FlowGetMatrixBlocks(f, block, &global));
  PetscCall(create_entries(f, block));
  for (PetscInt s = 0; s < 2 && block[s]; s++) PetscCall(RowsOpen(block[s], &r[s]));
  if (block[1]) PetscCall(MatGetSize(block[1], NULL, &nother));
  /* column of a node, those of other ranks after own ones; where the row at hand has it */
  PetscCall(PetscMalloc2(l->nnode_all, &column, l->nnode + nother, &at));
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    column[i] = i;
    if (i >= l->nnode && nother) PetscCall(PetscFindInt(l->node_global[i], nother, global, &column[i]));
    if (i >= l->nnode) column[i] = column[i] < 0 ? -1 : l->nnode + column[i];
  }
  for (PetscInt i = 0; i < l->nnode; i++) {
    for (PetscInt s = 0; s < 2 && block[s]; s++)
      for (PetscInt q = r[s].start[i]; q < r[s].start[i + 1]; q++)
        at[r[s].column[q] + s * l->nnode] = q - r[s].start[i];
    for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
      const PetscInt *node = l->cell_node + l->node_cell[q] * nb;
      PetscInt        j    = 0;

      while (node[j] != i) j++;
      for (PetscInt k = 0; k < nb; k++)
        set_entry(f, (l->node_cell[q] * nb + j) * nb + k, at[column[node[k]]],
                  (PetscBool)(column[node[k]] >= l->nnode));
    }
  }
  for (PetscInt s = 0; s < 2 && block[s]; s++) PetscCall(RowsClose(&r[s]));
  PetscCall(PetscFree2(column, at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCreateMatrix(Flow f)
{
  const MeshLocal *l         = f->loc;
  PetscInt        *row_start = NULL, *column = NULL;

  PetscFunctionBeginUser;
  PetscCall(ArrayCheckSize(f->comm, "a velocity matrix", (PetscReal)l->ncell_all * l->nb * l->nb));
  PetscCall(MeshFindPattern(f->mesh, &row_start, &column));
  PetscCall(MatCreate(f->comm, &f->matrix.S));
  PetscCall(MatSetSizes(f->matrix.S, l->nnode, l->nnode, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetType(f->matrix.S, MATAIJ));
  PetscCall(MatSeqAIJSetPreallocationCSR(f->matrix.S, row_start, column, NULL));
  PetscCall(MatMPIAIJSetPreallocationCSR(f->matrix.S, row_start, column, NULL));
  PetscCall(PetscFree(row_start));
  PetscCall(PetscFree(column));
  PetscCall(find_entries(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Values of own and of other columns, and where their rows begin */
typedef struct {
  const PetscInt *start[2];
  PetscReal      *value[2];
} BlockValues;

/* p += the matrix ce [nb][stride] of cell c */
INLINE void add_cell_as(const PetscBool wide, const struct _p_Flow *f, PetscInt c, PetscInt stride,
                        const PetscReal *restrict ce, const BlockValues *p)
{
  const PetscInt nb = f->loc->nb, *node = f->loc->cell_node + c * nb;

  for (PetscInt i = 0; i < nb; i++) {
    PetscReal *own, *other;

    if (node[i] >= f->loc->nnode) continue;
    own   = p->value[0] + p->start[0][node[i]];
    other = p->value[1] ? p->value[1] + p->start[1][node[i]] : NULL;
    for (PetscInt j = 0; j < nb; j++) {
      PetscBool      far;
      const PetscInt at = FlowEntry(f, wide, c, i, j, &far);

      if (at >= 0) (far ? other : own)[at] += ce[i * stride + j];
    }
  }
}

static void add_cell(const struct _p_Flow *f, PetscInt c, PetscInt stride, const PetscReal ce[], const BlockValues *p)
{
  if (f->matrix.wide) add_cell_as(PETSC_TRUE, f, c, stride, ce, p);
  else add_cell_as(PETSC_FALSE, f, c, stride, ce, p);
}

PetscErrorCode FlowCellLatticeMatrix(Flow f, PetscInt c, PetscReal ce[])
{
  const MeshLocal *l    = f->loc;
  const PetscInt   size = l->nb * l->dim;
  const FlowStep  *s    = &f->step;
  PetscReal        wl[MESH_MAX_NB * 3];
  ElementMetric    m;

  PetscFunctionBeginUser;
  PetscCall(FlowCellMetric(f, c, &m));
  if (f->par.convection) {
    MeshCellValues(l, c, l->dim, f->w, wl);
    for (PetscInt i = 0; i < size; i++) wl[i] *= FlowDensity(f, c) * s->theta;
  }
  ElementOperator(&f->element, &m, FlowDensity(f, c) * s->ct, FlowNumber(f) * s->theta, f->par.convection ? wl : NULL,
                  f->par.skew, ce);
  if (f->material) (*f->material->scalar)(f, c, &m, ce);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCellMatrix(Flow f, PetscInt c, PetscReal ce[])
{
  PetscFunctionBeginUser;
  PetscCall(FlowCellLatticeMatrix(f, c, ce));
  MeshCellMatrix(f->loc, c, 1, f->element.nbp, ce);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode assemble_matrix(Flow f)
{
  const MeshLocal *l = f->loc;
  BlockValues      p = {{NULL, NULL}, {NULL, NULL}};
  PetscInt         n;
  PetscBool        done;
  Mat              block[2];
  const PetscInt  *columns;

  PetscFunctionBeginUser;
  PetscCall(FlowGetMatrixBlocks(f, block, &columns));
  PetscCall(MatZeroEntries(f->matrix.S));
  for (PetscInt k = 0; k < 2 && block[k]; k++) {
    PetscCall(MatGetRowIJ(block[k], 0, PETSC_FALSE, PETSC_FALSE, &n, &p.start[k], NULL, &done));
    PetscCall(MatSeqAIJGetArray(block[k], &p.value[k]));
  }
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal ce[MESH_MAX_NB * ELEMENT_MAX_NBP];

    PetscCall(FlowCellMatrix(f, c, ce));
    add_cell(f, c, f->element.nbp, ce, &p);
  }
  for (PetscInt o = 0; o < f->owners.nterms; o++) {
    const CellTerms *terms = &f->owners.terms[o];

    for (PetscInt t = 0; t < terms->n; t++) add_cell(f, terms->cell[t], l->nb, terms->matrix + t * l->nb * l->nb, &p);
  }
  for (PetscInt k = 0; k < 2 && block[k]; k++) {
    PetscCall(MatSeqAIJRestoreArray(block[k], &p.value[k]));
    PetscCall(MatRestoreRowIJ(block[k], 0, PETSC_FALSE, PETSC_FALSE, &n, &p.start[k], NULL, &done));
  }
  PetscCall(MatAssemblyBegin(f->matrix.S, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(f->matrix.S, MAT_FINAL_ASSEMBLY));
  f->matrix.current = PETSC_TRUE;
  PetscCall(PetscLogFlops(2.0 * l->ncell_all * f->element.nq * l->nb * (l->nb + 3 * l->dim)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAssemble(Flow f)
{
  Mat A;

  PetscFunctionBeginUser;
  if (!f->par.convection && !(f->material && f->material->varies) && f->matrix.ct == f->step.ct &&
      f->matrix.theta == f->step.theta)
    PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(f->par.convection ? TB_FLOW_CONVECT : TB_FLOW_ASSEMBLE, 0, 0, 0, 0));
  PetscCall(FlowUpdateMaterial(f));
  if (f->matrix.product) {
    PetscCall(FlowUpdateProduct(f));
    f->matrix.current = PETSC_FALSE;
  } else PetscCall(assemble_matrix(f));
  f->matrix.ct    = f->step.ct;
  f->matrix.theta = f->step.theta;
  if (FlowVaries(f)) PetscCall(FlowAssembleComponents(f, NULL, &A));
  PetscCall(PetscLogEventEnd(f->par.convection ? TB_FLOW_CONVECT : TB_FLOW_ASSEMBLE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetMatrix(Flow f, Mat *S)
{
  PetscFunctionBeginUser;
  if (!f->matrix.S) PetscCall(FlowCreateMatrix(f));
  if (f->matrix.product && !f->matrix.current) PetscCall(assemble_matrix(f));
  *S = f->matrix.S;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* r -= residual of the right-hand side in cell c, of fluids whose stress is their own */
static PetscErrorCode take_residual(Flow f, PetscInt c, PetscReal r[])
{
  const MeshLocal *l   = f->loc;
  const FlowStep  *s   = &f->step;
  const PetscInt   dim = l->dim, nb = l->nb, *node = l->cell_node + c * nb;
  PetscReal        al[MESH_MAX_NB * 3], vl[MESH_MAX_NB * 3], wl[MESH_MAX_NB * 3], rl[MESH_MAX_NB * 3];
  ElementMetric    m;

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < nb; j++) {
    for (PetscInt a = 0; a < dim; a++) {
      const PetscInt i = node[j] * dim + a;

      al[j * dim + a] = -(s->d0 * f->u[i] + s->d1 * f->u_old[i]) -
                        (f->force.source ? f->force.source[i] / FlowDensity(f, c) : 0);
      vl[j * dim + a] = (1 - s->theta) * f->u[i];
      wl[j * dim + a] = f->w[i];
    }
  }
  MeshCellGather(l, c, dim, al);
  MeshCellGather(l, c, dim, vl);
  MeshCellGather(l, c, dim, wl);
  PetscCall(FlowCellMetric(f, c, &m));
  FlowCellMomentum(f, c, &m, al, s->theta < 1 ? vl : NULL, wl, rl);
  MeshCellScatter(l, c, dim, rl);
  for (PetscInt j = 0; j < nb; j++)
    for (PetscInt a = 0; a < dim; a++) r[node[j] * dim + a] -= rl[j * dim + a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where fields stay on a device: what boundaries and others add is made on the host */
static PetscErrorCode make_on_device(Flow f)
{
  const PetscInt n = f->loc->nnode_all * f->loc->dim;
  PetscReal     *r;

  PetscFunctionBeginUser;
  PetscCall(OnDeviceRhs(f));
  if (!f->force.traction && !f->owners.nforces) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(n, &r));
  if (f->force.traction) {
    PetscCall(TractionEvaluate(f->force.traction));
    TractionAdd(f->force.traction, r);
    PetscCall(OnDeviceAddRhs(f, r));
    PetscCall(PetscArrayzero(r, n));
  }
  if (f->owners.nforces) {
    OwnersAddForces(f, r);
    PetscCall(OnDeviceAddRhs(f, r));
  }
  PetscCall(PetscFree(r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowRhs(Flow f, PetscReal r[])
{
  const MeshLocal *l    = f->loc;
  const PetscInt   n    = l->nb * l->dim;
  LaneWalk         walk = {0};
  LaneCells        next;

  PetscFunctionBeginUser;
  PetscCall(OwnersCheck(f));
  PetscCall(PetscLogEventBegin(TB_FLOW_RHS, 0, 0, 0, 0));
  PetscCall(FlowUpdateMaterial(f));
  if (FlowStaysOnDevice(f)) {
    PetscCall(make_on_device(f));
    PetscCall(PetscLogEventEnd(TB_FLOW_RHS, 0, 0, 0, 0));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(FlowBringFields(f));
  PetscCall(PetscArrayzero(r, l->nnode_all * l->dim));
  if (OnDeviceHelps(f)) PetscCall(OnDeviceTakeRhs(f, r));
  for (PetscInt c = 0; c < l->ncell && !FlowIsPlain(f); c++) PetscCall(take_residual(f, c, r));
  while (FlowIsPlain(f) && !OnDeviceHelps(f) && LanesNext(f, &walk, &next)) {
    Lanes x[MESH_MAX_NB * 3];

    PetscCall(LanesMomentum(f, &next, NULL, x));
    for (PetscInt i = 0; i < n; i++) x[i] = -x[i];
    LanesScatter(l, &next, l->dim, x, r);
  }
  if (f->force.traction) PetscCall(TractionEvaluate(f->force.traction));
  if (f->force.traction) TractionAdd(f->force.traction, r);
  OwnersAddForces(f, r);
  PetscCall(MeshSumNodes(f->mesh, l->dim, r));
  PetscCall(PetscLogEventEnd(TB_FLOW_RHS, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDivergence(Flow f, const PetscReal u[], PetscReal y[])
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_DIV, 0, 0, 0, 0));
  ElementDivergence(l->dim, l->ncell, l->cell_node, (const PetscReal *const *)f->cells.b, u, y);
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
  ElementGradient(l->dim, l->ncell, l->cell_node, (const PetscReal *const *)f->cells.b, scale, p, r);
  PetscCall(MeshSumNodes(f->mesh, l->dim, r));
  PetscCall(PetscLogFlops(2.0 * l->ncell * (l->dim + 1) * l->nb * l->dim));
  PetscCall(PetscLogEventEnd(TB_FLOW_DIV, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowPressureMassSolve(Flow f, PetscReal scale, const PetscReal r[], PetscReal y[])
{
  const PetscInt nk = f->loc->dim + 1;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < f->loc->ncell; c++) {
    const PetscReal factor = FlowVaries(f) ? scale * f->viscosity.cell[c] / f->par.viscosity : scale,
                    *mass  = FlowPressureMass(f, c);

    for (PetscInt k = 0; k < nk; k++)
      for (PetscInt n = 0; n < nk; n++) y[c * nk + k] += factor * mass[k * nk + n] * r[c * nk + n];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
