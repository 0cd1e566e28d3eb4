/* Flow: rows of S around marked nodes, from the matrices of cells, without a matrix (FlowGatherRows of flow.h).

   A preconditioner wants the rows of S near bodies alone, and where products go without a matrix the rest would be
   made for nothing: pattern, sort and assembly of the whole are far dearer than these rows. A row gathers the
   matrices of the cells around its node; a scratch array knows where a column stands in the row at hand. A cell's
   matrix is computed when the first row asks for it and dropped after the last: as nodes are numbered along the
   cells, few live at once. All cells around a node of an own cell are there, as ghosts at least, so rows of ghost
   nodes need no exchange. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "base/array.h"
#include "flow/device.h"

struct _p_NearRows {
  PetscBool *has_row; /* [nnode_all] own nodes, and ghost nodes of own cells */
  PetscInt  *start;   /* [nnode_all + 1] */
  PetscInt   n, capacity, *column;
  PetscReal *value;
  PetscInt  *at; /* [nnode_all] where a column stands in the row at hand, if not before its beginning */
  /* matrices of cells: slot of each, -1: not computed, and the number of rows that still want it [ncell_all] */
  PetscInt         *slot, *wanting, nslot, slot_capacity, nspare, *spare;
  PetscReal        *matrix;             /* [slot_capacity][nb][nbp] */
  PetscInt         *term, *next, nterm; /* terms of owners in a cell: first [ncell_all], next [nterm], -1: none */
  const PetscReal **entry;              /* [nterm] their matrices */
};

static PetscErrorCode create(Flow f)
{
  const MeshLocal    *l = f->loc;
  struct _p_NearRows *r;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&r));
  PetscCall(PetscCalloc3(l->nnode_all, &r->has_row, l->nnode_all + 1, &r->start, l->nnode_all, &r->at));
  PetscCall(PetscMalloc3(l->ncell_all, &r->slot, l->ncell_all, &r->wanting, l->ncell_all, &r->term));
  for (PetscInt i = 0; i < l->nnode; i++) r->has_row[i] = PETSC_TRUE;
  for (PetscInt e = 0; e < l->ncell * l->nb; e++) r->has_row[l->cell_node[e]] = PETSC_TRUE;
  f->matrix.near_rows = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDestroyRows(Flow f)
{
  struct _p_NearRows *r = f->matrix.near_rows;

  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree3(r->has_row, r->start, r->at));
  PetscCall(PetscFree3(r->slot, r->wanting, r->term));
  PetscCall(PetscFree(r->column));
  PetscCall(PetscFree(r->value));
  PetscCall(PetscFree(r->spare));
  PetscCall(PetscFree(r->matrix));
  PetscCall(PetscFree(r->next));
  PetscCall(PetscFree(r->entry));
  PetscCall(PetscFree(f->matrix.near_rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* How many rows want each cell, and its further terms */
static PetscErrorCode choose_cells(Flow f, struct _p_NearRows *r, const PetscBool marked[])
{
  const MeshLocal *l = f->loc;
  PetscInt         n = 0;

  PetscFunctionBeginUser;
  for (PetscInt o = 0; o < f->owners.nterms; o++) n += f->owners.terms[o].n;
  PetscCall(ArrayReserve(n, &r->nterm, &r->next, sizeof(*r->next), &r->entry, sizeof(*r->entry), NULL));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    const PetscInt *node = l->cell_node + c * l->nb;
    PetscInt        j    = 0;

    r->slot[c] = r->term[c] = -1;
    r->wanting[c]           = 0;
    while (j < l->nb && !marked[node[j]]) j++;
    if (j == l->nb) continue;
    for (j = 0; j < l->nb; j++) r->wanting[c] += r->has_row[node[j]];
  }
  for (PetscInt o = f->owners.nterms - 1; o >= 0; o--) { /* in their order, as the matrix adds them */
    const CellTerms *terms = &f->owners.terms[o];

    for (PetscInt t = terms->n - 1; t >= 0; t--) {
      r->next[--n]            = r->term[terms->cell[t]];
      r->entry[n]             = terms->matrix + t * l->nb * l->nb;
      r->term[terms->cell[t]] = n;
    }
  }
  r->nslot = r->nspare = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The matrix of a cell for one more row, computed if it is the first */
static PetscErrorCode take_cell(Flow f, struct _p_NearRows *r, PetscInt c, const PetscReal **k)
{
  const PetscInt nb = f->loc->nb, stride = f->element.nbp;
  PetscReal     *ce;

  PetscFunctionBeginUser;
  if (r->slot[c] < 0) {
    if (!r->nspare)
      PetscCall(ArrayReserve(r->nslot + 1, &r->slot_capacity, &r->matrix, (size_t)(nb * stride) * sizeof(*r->matrix),
                             &r->spare, sizeof(*r->spare), NULL));
    r->slot[c] = r->nspare ? r->spare[--r->nspare] : r->nslot++;
    ce         = r->matrix + r->slot[c] * nb * stride;
    PetscCall(FlowCellMatrix(f, c, ce));
    for (PetscInt t = r->term[c]; t >= 0; t = r->next[t])
      for (PetscInt i = 0; i < nb; i++)
        for (PetscInt j = 0; j < nb; j++) ce[i * stride + j] += r->entry[t][i * nb + j];
    PetscCall(PetscLogFlops(2.0 * f->element.nq * nb * (nb + 3 * f->loc->dim)));
  }
  *k = r->matrix + r->slot[c] * nb * stride;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A row, whose entries begin at begin and end at n, += k [nb], the row of a cell; only: columns that it takes, or NULL.
   Returns where it ends then. */
static PetscInt add_to_row(PetscInt        nb, const PetscInt *restrict node, const PetscReal *restrict k,
                           const PetscBool only[], PetscInt begin, PetscInt n, PetscInt *restrict at,
                           PetscInt *restrict column, PetscReal *restrict value)
{
  for (PetscInt m = 0; m < nb; m++) {
    const PetscInt to = at[node[m]];

    if (only && !only[node[m]]) continue;
    if (to >= begin) value[to] += k[m];
    else {
      at[node[m]] = n;
      column[n]   = node[m];
      value[n++]  = k[m];
    }
  }
  return n;
}

/* The row of node i; of an unmarked one columns of marked nodes alone */
static PetscErrorCode gather_row(Flow f, struct _p_NearRows *r, const PetscBool marked[], PetscInt i)
{
  const MeshLocal *l  = f->loc;
  const PetscInt   nb = l->nb, begin = r->n;
  const PetscBool  whole = marked[i];

  PetscFunctionBeginUser;
  for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
    const PetscInt   c = l->node_cell[q], *node = l->cell_node + c * nb;
    const PetscReal *k = NULL;
    PetscInt         j = 0;

    if (r->wanting[c] == 0) continue;
    PetscCall(take_cell(f, r, c, &k));
    if (r->n + nb > r->capacity)
      PetscCall(
        ArrayReserve(r->n + nb, &r->capacity, &r->column, sizeof(*r->column), &r->value, sizeof(*r->value), NULL));
    while (node[j] != i) j++;
    k += j * f->element.nbp;
    r->n = add_to_row(nb, node, k, whole ? NULL : marked, begin, r->n, r->at, r->column, r->value);
    if (--r->wanting[c] == 0) r->spare[r->nspare++] = r->slot[c];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* w at the nodes of these cells, where it is on a device */
static PetscErrorCode fetch_convection(Flow f, const struct _p_NearRows *r)
{
  const MeshLocal *l = f->loc;
  PetscInt         n = 0, *node;
  PetscBool       *listed;

  PetscFunctionBeginUser;
  if (!FlowStaysOnDevice(f) || !f->par.convection) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(l->nnode_all, &listed));
  for (PetscInt e = 0; e < l->ncell_all * l->nb; e++)
    if (r->wanting[e / l->nb] > 0) listed[l->cell_node[e]] = PETSC_TRUE;
  for (PetscInt i = 0; i < l->nnode_all; i++) n += listed[i];
  PetscCall(PetscMalloc1(n, &node));
  n = 0;
  for (PetscInt i = 0; i < l->nnode_all; i++)
    if (listed[i]) node[n++] = i;
  PetscCall(OnDeviceFetchConvection(f, n, node));
  PetscCall(PetscFree(node));
  PetscCall(PetscFree(listed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGatherRows(Flow f, const PetscBool marked[], Rows *rows)
{
  const MeshLocal    *l = f->loc;
  struct _p_NearRows *r;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_ASSEMBLE, 0, 0, 0, 0));
  if (!f->matrix.near_rows) PetscCall(create(f));
  r = f->matrix.near_rows;
  PetscCall(choose_cells(f, r, marked));
  PetscCall(fetch_convection(f, r));
  for (PetscInt i = 0; i < l->nnode_all; i++) r->at[i] = -1;
  r->n = 0;
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    if (r->has_row[i]) PetscCall(gather_row(f, r, marked, i));
    r->start[i + 1] = r->n;
  }
  *rows = (Rows){NULL, l->nnode_all, r->start, r->column, r->value};
  PetscCall(PetscLogEventEnd(TB_FLOW_ASSEMBLE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
