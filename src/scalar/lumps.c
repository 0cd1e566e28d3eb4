/* Scalars, bodies of one value each (ScalarLumps): their nodes share an unknown, in whose row theirs are added up with
   the body's own equation. In terms of nodal vectors that are equal on the nodes of a body the matrix is Q (A + D) Q, Q
   the mean over these nodes, D the body's capacity and what cut cells exchange with it: a product without a matrix;
   the preconditioner is made of A with the rows of the nodes replaced by the diagonal of the sum. */
#include "compat.h"
#include "impl.h"

static PetscInt find_lump(const Scalar *s, PetscInt i)
{
  return s->owner[i] < 0 && s->lumps ? s->lumps->of_node[i] : -1;
}

PetscBool ScalarIsLumped(const Scalar *s, PetscInt i)
{
  return (PetscBool)(find_lump(s, i) >= 0);
}

PetscBool ScalarIsFree(const Scalar *s, PetscInt i)
{
  return (PetscBool)(s->owner[i] < 0 && (s->seen[i] || ScalarIsLumped(s, i)));
}

static PetscReal *get_values(const Scalar *s, PetscInt b)
{
  return s->lumps->value + b * s->lumps->stride;
}

PetscErrorCode ScalarsSetLumps(Scalars all, PetscInt i, const ScalarLumps *lumps)
{
  PetscFunctionBeginUser;
  all->scalar[i].lumps = lumps;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode sum_over_ranks(const Scalar *s, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall((*s->lumps->sum)(s->lumps->ctx, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLumpsForget(Scalar *s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree2(s->lump_count, s->lump_nodal));
  PetscCall(PetscFree(s->lump_cell));
  PetscCall(MatDestroy(&s->lump_product));
  PetscCall(MatDestroy(&s->lump_rows));
  s->nlump_cell = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is a cell cut by a body with one value? */
static PetscBool is_cut(const Scalar *s, PetscInt c)
{
  return (PetscBool)(s->cells.sample && s->cells.sample[c] >= 0 && s->cells.samples[s->cells.sample[c]].lump >= 0);
}

/* What a cut cell exchanges with its body a unit of the difference: per node, and whole */
static PetscErrorCode find_exchange(Scalars all, const Scalar *s, PetscInt c, ScalarLumpCell *e)
{
  const ScalarSamples *p = s->cells.samples + s->cells.sample[c];
  PetscReal            xc[MESH_MAX_NB * 3], phi[MESH_MAX_NB], g[3][MESH_MAX_NB];

  PetscFunctionBeginUser;
  *e = (ScalarLumpCell){.cell = c, .lump = p->lump};
  PetscCall(ScalarCellCoordinates(all, c, xc));
  for (PetscInt q = 0; q < PetscPowInt(p->n, all->loc->dim); q++) {
    const PetscReal weight = p->reaction[q] * ScalarSampleBasis(all, p->n, q, xc, phi, g);

    for (PetscInt j = 0; j < all->loc->nb; j++) e->each[j] += weight * phi[j];
    e->whole += weight;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Adds with scale what cut cells give: to rows y [nnode_all] of their nodes, and to rows of bodies sum [n], at nodal
   values v [nnode_all] and those of bodies T [n] */
static void add_exchange(Scalars all, const Scalar *s, PetscReal scale, const PetscReal v[], const PetscReal T[],
                         PetscReal y[], PetscReal sum[])
{
  const MeshLocal *l = all->loc;

  for (PetscInt i = 0; i < s->nlump_cell; i++) {
    const ScalarLumpCell *e = s->lump_cell + i;
    PetscReal             at[MESH_MAX_NB], r[MESH_MAX_NB], all_of_it = e->whole * T[e->lump];

    MeshCellValues(l, e->cell, 1, v, at);
    for (PetscInt j = 0; j < l->nb; j++) {
      r[j] = -scale * e->each[j] * T[e->lump];
      all_of_it -= e->each[j] * at[j];
    }
    if (e->cell < l->ncell) sum[e->lump] += scale * all_of_it;
    MeshCellScatter(l, e->cell, 1, r);
    for (PetscInt j = 0; j < l->nb; j++) y[l->cell_node[e->cell * l->nb + j]] += r[j];
  }
}

PetscErrorCode ScalarLumpsBegin(Scalars all, Scalar *s)
{
  const MeshLocal   *l    = all->loc;
  const ScalarLumps *p    = s->lumps;
  const PetscReal    r    = all->step.theta > 0 ? all->step.extrapolation / all->step.theta : 0;
  PetscBool          lost = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (!p) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarLumpsForget(s));
  PetscCall(PetscCalloc2(p->n, &s->lump_count, 2 * l->nnode_all, &s->lump_nodal));
  for (PetscInt i = 0; i < l->nnode; i++)
    if (find_lump(s, i) >= 0) s->lump_count[find_lump(s, i)]++;
  PetscCall(sum_over_ranks(s, s->lump_count));
  for (PetscInt b = 0; b < p->n; b++) {
    PetscReal *T = get_values(s, b);

    if (!p->is[b]) continue;
    lost = (PetscBool)(lost || s->lump_count[b] == 0);
    T[2] = T[0] + r * (T[0] - T[1]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &lost, 1, COMPAT_MPI_BOOL, MPI_LOR, all->comm));
  PetscCheck(!lost, all->comm, PETSC_ERR_USER_INPUT,
             "A body of one value of scalar '%s' has no node of the mesh inside: refine the mesh around it (-mesh_cells, "
             "-mesh_focus_h), or use -couple_method aligned",
             s->name);
  for (PetscInt i = 0; i < l->nnode_all; i++)
    if (find_lump(s, i) >= 0) s->x[i] = get_values(s, find_lump(s, i))[2];
  for (PetscInt c = 0; c < l->ncell_all; c++) s->nlump_cell += is_cut(s, c);
  PetscCall(PetscMalloc1(s->nlump_cell, &s->lump_cell));
  s->nlump_cell = 0;
  for (PetscInt c = 0; c < l->ncell_all; c++)
    if (is_cut(s, c)) PetscCall(find_exchange(all, s, c, s->lump_cell + s->nlump_cell++));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* rows y of the nodes of bodies <- their sum [n] over the number of nodes */
static void spread(Scalars all, const Scalar *s, const PetscReal sum[], PetscReal y[])
{
  for (PetscInt i = 0; i < all->loc->nnode; i++) {
    const PetscInt b = find_lump(s, i);

    if (b >= 0) y[i] = sum[b] / s->lump_count[b];
  }
}

/* Values of bodies [n] <- mean of own nodes v over all ranks */
static PetscErrorCode find_means(Scalars all, const Scalar *s, const PetscReal v[], PetscReal T[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(T, s->lumps->n));
  for (PetscInt i = 0; i < all->loc->nnode; i++)
    if (find_lump(s, i) >= 0) T[find_lump(s, i)] += v[i];
  PetscCall(sum_over_ranks(s, T));
  for (PetscInt b = 0; b < s->lumps->n; b++)
    if (s->lump_count[b] > 0) T[b] /= s->lump_count[b];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Adds rows of own nodes of bodies to their sums; all ranks */
static PetscErrorCode sum_rows(Scalars all, const Scalar *s, const PetscReal y[], PetscReal sum[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < all->loc->nnode; i++)
    if (find_lump(s, i) >= 0) sum[find_lump(s, i)] += y[i];
  PetscCall(sum_over_ranks(s, sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = Q (A + D) Q v */
static PetscErrorCode multiply(Mat product, Vec v, Vec y)
{
  ScalarLumpProduct *p;
  Scalar            *s;
  PetscReal         *T, *sum, *nodal, *rows;
  const PetscReal   *in;
  PetscReal         *out;
  PetscInt           n;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(product, &p));
  s     = p->scalar;
  n     = p->all->loc->nnode;
  nodal = s->lump_nodal;
  rows  = nodal + p->all->loc->nnode_all;
  PetscCall(PetscCalloc2(s->lumps->n, &T, s->lumps->n, &sum));
  PetscCall(VecGetArrayRead(v, &in));
  PetscCall(PetscArraycpy(nodal, in, n));
  PetscCall(VecRestoreArrayRead(v, &in));
  PetscCall(find_means(p->all, s, nodal, T));
  for (PetscInt i = 0; i < n; i++)
    if (find_lump(s, i) >= 0) nodal[i] = T[find_lump(s, i)];
  PetscCall(VecPlaceArray(p->in, nodal));
  PetscCall(MatMult(s->A, p->in, y));
  PetscCall(VecResetArray(p->in));
  PetscCall(MeshSyncNodes(p->all->mesh, 1, nodal));
  PetscCall(PetscArrayzero(rows, p->all->loc->nnode_all));
  add_exchange(p->all, s, p->all->step.theta, nodal, T, rows, sum);
  PetscCall(VecGetArray(y, &out));
  for (PetscInt i = 0; i < n; i++)
    if (s->owner[i] < 0) out[i] += rows[i];
  PetscCall(sum_rows(p->all, s, out, sum));
  for (PetscInt b = 0; b < s->lumps->n; b++) sum[b] += s->lumps->capacity[b] * p->all->step.ct * T[b];
  spread(p->all, s, sum, out);
  PetscCall(VecRestoreArray(y, &out));
  PetscCall(PetscFree2(T, sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode forget_product(Mat product)
{
  ScalarLumpProduct *p;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(product, &p));
  PetscCall(VecDestroy(&p->in));
  PetscCall(PetscFree(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Right-hand side: rows of bodies, and what the step began with of the exchange */
static PetscErrorCode add_history(Scalars all, Scalar *s)
{
  const ScalarStep *f = &all->step;
  PetscReal        *T, *sum, *rows = s->lump_nodal;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(s->lumps->n, &T, s->lumps->n, &sum));
  PetscCall(PetscArrayzero(rows, all->loc->nnode_all));
  for (PetscInt b = 0; b < s->lumps->n; b++) T[b] = get_values(s, b)[0];
  if (f->theta < 1) add_exchange(all, s, -(1 - f->theta), s->T, T, rows, sum);
  for (PetscInt i = 0; i < all->loc->nnode; i++)
    if (s->owner[i] < 0) s->rhs[i] += rows[i];
  PetscCall(sum_rows(all, s, s->rhs, sum));
  for (PetscInt b = 0; b < s->lumps->n; b++) {
    const PetscReal *has = get_values(s, b);

    if (s->lumps->is[b]) sum[b] += s->lumps->capacity[b] * (f->d0 * has[0] + f->d1 * has[1]) + s->lumps->source[b];
  }
  spread(all, s, sum, s->rhs);
  PetscCall(PetscFree2(T, sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* For the preconditioner: A with the rows of bodies replaced by the diagonal of their sum */
static PetscErrorCode set_rows(Scalars all, Scalar *s)
{
  PetscReal       *sum, *d;
  const PetscReal *a;
  PetscInt         n = 0, *row;
  Vec              diagonal;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(s->lumps->n, &sum));
  PetscCall(PetscMalloc2(all->loc->nnode, &row, all->loc->nnode, &d));
  PetscCall(MatCreateVecs(s->A, NULL, &diagonal));
  PetscCall(MatGetDiagonal(s->A, diagonal));
  PetscCall(VecGetArrayRead(diagonal, &a));
  PetscCall(sum_rows(all, s, a, sum));
  PetscCall(VecRestoreArrayRead(diagonal, &a));
  for (PetscInt b = 0; b < s->lumps->n; b++) sum[b] += s->lumps->capacity[b] * all->step.ct;
  spread(all, s, sum, d);
  for (PetscInt i = 0; i < all->loc->nnode; i++)
    if (find_lump(s, i) >= 0) row[n++] = all->loc->node_start + i;
  PetscCall(MatDuplicate(s->A, MAT_COPY_VALUES, &s->lump_rows));
  PetscCall(MatZeroRows(s->lump_rows, n, row, 1, NULL, NULL));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal v = d[row[i] - all->loc->node_start];

    PetscCall(MatSetValue(s->lump_rows, row[i], row[i], v > 0 ? v : 1, INSERT_VALUES));
  }
  PetscCall(MatAssemblyBegin(s->lump_rows, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(s->lump_rows, MAT_FINAL_ASSEMBLY));
  PetscCall(VecDestroy(&diagonal));
  PetscCall(PetscFree2(row, d));
  PetscCall(PetscFree(sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLumpsAssemble(Scalars all, Scalar *s)
{
  const PetscInt     n = all->loc->nnode;
  ScalarLumpProduct *p;

  PetscFunctionBeginUser;
  if (!s->lumps) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(add_history(all, s));
  PetscCall(set_rows(all, s));
  PetscCall(PetscNew(&p));
  p->all    = all;
  p->scalar = s;
  PetscCall(VecCreateMPIWithArray(all->comm, 1, n, PETSC_DETERMINE, NULL, &p->in));
  PetscCall(MatCreateShell(all->comm, n, n, PETSC_DETERMINE, PETSC_DETERMINE, p, &s->lump_product));
  PetscCall(MatShellSetOperation(s->lump_product, MATOP_MULT, (void (*)(void))multiply));
  PetscCall(MatShellSetOperation(s->lump_product, MATOP_DESTROY, (void (*)(void))forget_product));
  PetscFunctionReturn(PETSC_SUCCESS);
}

Mat ScalarGetProduct(const Scalar *s)
{
  return s->lumps ? s->lump_product : s->A;
}

PetscErrorCode ScalarLumpsTake(Scalars all, Scalar *s)
{
  PetscReal *T;

  PetscFunctionBeginUser;
  if (!s->lumps) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(s->lumps->n, &T));
  PetscCall(find_means(all, s, s->x, T));
  for (PetscInt b = 0; b < s->lumps->n; b++)
    if (s->lumps->is[b]) get_values(s, b)[2] = T[b];
  for (PetscInt i = 0; i < all->loc->nnode; i++)
    if (find_lump(s, i) >= 0) s->x[i] = T[find_lump(s, i)];
  PetscCall(PetscFree(T));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ScalarLumpsMeasure(Scalars all, const Scalar *s, ScalarBalance *b, PetscReal flux[])
{
  for (PetscInt k = 0; s->lumps && k < s->lumps->n; k++) {
    const ScalarLumps *p   = s->lumps;
    const PetscReal   *has = get_values(s, k);
    const PetscReal change = p->capacity[k] * (all->step.ct * has[2] - all->step.d0 * has[0] - all->step.d1 * has[1]);

    if (!p->is[k] || !p->own[k]) continue;
    b->mean += p->content[k];
    b->content += p->content[k] * has[2];
    b->change += change;
    b->source += p->source[k];
    b->size += PetscAbsReal(change);
    if (flux) flux[k] += p->source[k] - change;
  }
}
