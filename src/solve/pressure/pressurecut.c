/* Pressure: cells that bodies cut (see pressure.h): those between two surfaces, whose pressures are made compressible,
   inactive ones, and the bodies' part W W^T of S_p. */
#include "compat.h"
#include "pressureimpl.h"
#include "blockgs.h"
#include "base/algebra.h"
#include "base/inline.h"
#include "base/array.h"

/* Block C = eps B_c M_c^{-1} B_c^T of one cell over its constrained nodes */
static PetscErrorCode shared_block(Pressure p, const unsigned char fixed[], PetscInt c, PetscReal block[])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, n = l->nb * dim, nk = p->nk;
  const PetscReal *m, *const *b;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(p->flow, &b));
  PetscCall(FlowGetInertialMass(p->flow, &m));
  for (PetscInt e = 0; e < nk * nk; e++) block[e] = 0;
  for (PetscInt j = 0; j < n; j++) {
    const PetscInt i = l->cell_node[c * l->nb + j / dim];

    if (ConstraintGetView(p->constraint)->node_body[i] < 0 && !((fixed[i] >> (j % dim)) & 1)) continue;
    for (PetscInt e = 0; e < nk * nk; e++) block[e] += p->gap.eps / m[i] * b[c][e / nk * n + j] * b[c][e % nk * n + j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own cells with a node of a body: nothing else can be cut or shared. */
static PetscErrorCode find_touched_cells(Pressure p)
{
  const ConstraintView *c = ConstraintGetView(p->constraint);

  PetscFunctionBeginUser;
  PressureStartList(p);
  for (PetscInt i = 0; i < c->nbody_nodes; i++) PressureListCellsOfNode(p, c->body_node[i]);
  p->list.ntouched = p->list.n;
  PetscCall(PetscArraycpy(p->list.touched, p->list.cell, p->list.ntouched));
  PetscCall(PetscSortInt(p->list.ntouched, p->list.touched));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode reserve_shared(Pressure p)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(p->gap.n + 1, &p->gap.capacity, &p->gap.cell, sizeof(*p->gap.cell), &p->gap.block,
                         (size_t)(p->nk * p->nk) * sizeof(*p->gap.block), NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The pressure of an inactive cell stands alone with the identity as its block, of the size that other blocks have */
static PetscErrorCode add_inactive_cells(Pressure p)
{
  const PetscReal scale = PetscPowReal(p->loc->h, p->loc->dim - 2);

  PetscFunctionBeginUser;
  for (PetscInt t = 0; t < p->list.ntouched && p->inactive.cell_material; t++) {
    if (p->inactive.cell_material[p->list.touched[t]] >= 0) continue;
    PetscCall(reserve_shared(p));
    p->gap.cell[p->gap.n] = p->list.touched[t];
    for (PetscInt e = 0; e < p->nk * p->nk; e++)
      p->gap.block[p->gap.n * p->nk * p->nk + e] = e % (p->nk + 1) ? 0 : scale;
    p->gap.n++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A cell whose nodes belong to two bodies, or to a body and a wall, may have pressures that no free velocity can serve:
   its divergence rows are then inconsistent (boundary-evidence, checked claims). Such cells get a small compressibility
   in the operator itself, as if their constrained nodes yielded a little to the pressure: B u + C p = 0. */
PetscErrorCode PressureFindShared(Pressure p)
{
  const MeshLocal      *l = p->loc;
  const ConstraintView *P = ConstraintGetView(p->constraint);
  const unsigned char  *fixed;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(p->flow), &fixed, NULL));
  PetscCall(find_touched_cells(p));
  p->gap.n = 0;
  for (PetscInt t = 0; t < p->list.ntouched; t++) {
    const PetscInt c = p->list.touched[t], *node = l->cell_node + c * l->nb;
    PetscInt       owner = -1; /* the first body met */
    PetscBool      wall = PETSC_FALSE, two = PETSC_FALSE, cut = PETSC_FALSE;

    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt k = P->node_body[node[j]];

      if (k >= 0 && owner >= 0 && k != owner && !(P->united[k] && P->united[owner])) two = PETSC_TRUE;
      if (k >= 0) owner = k;
      else if (fixed[node[j]]) wall = PETSC_TRUE;
      /* between resolved walls every pressure meets a free velocity */
      cut = (PetscBool)(cut || (k >= 0 && !p->inactive.resolved[k]));
    }
    if (!cut || (!two && !wall)) continue;
    PetscCall(reserve_shared(p));
    p->gap.cell[p->gap.n] = c;
    PetscCall(shared_block(p, fixed, c, p->gap.block + p->gap.n * p->nk * p->nk));
    p->gap.n++;
  }
  p->gap.ncompressible = p->gap.n;
  PetscCall(add_inactive_cells(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureKeepShared(Pressure p, Shared *old)
{
  PetscFunctionBeginUser;
  *old = (Shared){.n = p->gap.n, .ncompressible = p->gap.ncompressible};
  PetscCall(PetscMalloc2(old->n, &old->cell, old->n * p->nk * p->nk, &old->block));
  PetscCall(PetscArraycpy(old->cell, p->gap.cell, old->n));
  PetscCall(PetscArraycpy(old->block, p->gap.block, old->n * p->nk * p->nk));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Entries [i, iend) of the old list against [j, jend) of the new one, both ascending; compressible: the coarse
   operator has them */
static PetscErrorCode change_range(Pressure p, const Shared *old, PetscInt i, PetscInt iend, PetscInt j, PetscInt jend,
                                   PetscBool compressible, PetscInt *n, PetscInt changed[])
{
  const PetscInt nn = p->nk * p->nk;

  PetscFunctionBeginUser;
  while (i < iend || j < jend) {
    const PetscInt  a = i < iend ? old->cell[i] : PETSC_MAX_INT, b = j < jend ? p->gap.cell[j] : PETSC_MAX_INT;
    PetscBool       same = PETSC_FALSE;
    const PetscBool goes = (PetscBool)(a <= b), comes = (PetscBool)(b <= a);

    if (goes && comes) PetscCall(PetscArraycmp(old->block + i * nn, p->gap.block + j * nn, nn, &same));
    if (!same) changed[(*n)++] = PetscMin(a, b);
    if (!same && compressible && p->coarse && goes)
      PetscCall(CoarseAddCells(p->coarse, -1, 1, old->cell + i, old->block + i * nn));
    if (!same && compressible && p->coarse && comes)
      PetscCall(CoarseAddCells(p->coarse, 1, 1, p->gap.cell + j, p->gap.block + j * nn));
    i += goes;
    j += comes;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies that move a little leave most of these cells with the nodes that they had */
PetscErrorCode PressureChangeShared(Pressure p, Shared *old, PetscInt *n, PetscInt *changed[])
{
  PetscFunctionBeginUser;
  *n = 0;
  PetscCall(PetscMalloc1(old->n + p->gap.n, changed));
  PetscCall(change_range(p, old, 0, old->ncompressible, 0, p->gap.ncompressible, PETSC_TRUE, n, *changed));
  PetscCall(change_range(p, old, old->ncompressible, old->n, p->gap.ncompressible, p->gap.n, PETSC_FALSE, n, *changed));
  PetscCall(PetscFree2(old->cell, old->block));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureFindInterior(Pressure p)
{
  const MeshLocal *l    = p->loc;
  const PetscInt  *body = ConstraintGetView(p->constraint)->node_body;

  PetscFunctionBeginUser;
  p->interior.n = 0;
  for (PetscInt t = 0; t < p->list.ntouched; t++) {
    const PetscInt *node = l->cell_node + p->list.touched[t] * l->nb;
    PetscInt        j    = 0;

    while (j < l->nb && body[node[j]] >= 0 && body[node[j]] == body[node[0]]) j++;
    if (j < l->nb || (p->inactive.cell_material && p->inactive.cell_material[p->list.touched[t]] < 0)) continue;
    PetscCall(
      ArrayReserve(p->interior.n + 1, &p->interior.capacity, &p->interior.cell, sizeof(*p->interior.cell), NULL));
    p->interior.cell[p->interior.n++] = p->list.touched[t];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The body that node i moves with, or -1; fraction NULL: no node takes a part of the motion */
static PetscInt moving_body(const ConstraintView *c, const PetscReal fraction[], PetscInt i)
{
  return fraction ? ConstraintGetMover(c, i) : c->node_body[i];
}

/* w [nk][nr] = B_c R_k L over the nodes of cell c that move with body k, times their fraction; fixed components do not
   move, whatever part of a wall's node the body covers */
INLINE void cut_rows(const int dim, Pressure p, const unsigned char fixed[], const PetscReal fraction[],
                     const PetscReal *const b[], PetscInt c, PetscInt k, const PetscReal L[], PetscReal w[])
{
  const ConstraintView *P  = ConstraintGetView(p->constraint);
  const MeshLocal      *l  = p->loc;
  const int             nb = dim == 2 ? 9 : 27, n = nb * dim, nk = dim + 1, nr = dim == 2 ? 3 : 6;
  PetscReal             q[4 * 6];

  for (int e = 0; e < nk * nr; e++) q[e] = w[e] = 0;
  for (int j = 0; j < nb; j++) {
    const PetscInt  i      = l->cell_node[c * nb + j];
    const PetscReal weight = fraction ? fraction[i] : 1;
    PetscReal       R[18];

    if (moving_body(P, fraction, i) != k) continue;
    ConstraintRigidAt(l, i, P->X[k], R);
    for (int a = 0; a < dim; a++) {
      if ((fixed[i] >> a) & 1) continue;
      for (int m = 0; m < nk; m++)
        for (int s = 0; s < nr; s++) q[m * nr + s] += weight * b[c][m * n + j * dim + a] * R[a * nr + s];
    }
  }
  for (int e = 0; e < nk * nr; e++)
    for (int s = 0; s < nr; s++) w[e] += q[e / nr * nr + s] * L[s * nr + e % nr];
}

/* Do nodes of a cell move with k, number j the first of them, and not all are its own? */
static PetscBool begins_cut(const ConstraintView *P, const PetscReal fraction[], PetscInt nb, const PetscInt node[],
                            PetscInt j, PetscInt k)
{
  PetscBool whole = PETSC_TRUE;

  for (PetscInt m = 0; m < nb; m++) {
    if (m < j && moving_body(P, fraction, node[m]) == k) return PETSC_FALSE;
    if (P->node_body[node[m]] != k) whole = PETSC_FALSE;
  }
  return (PetscBool)!whole;
}

PetscErrorCode PressureFindCut(Pressure p, const PetscReal fraction[], const PetscReal mass_inverse[])
{
  const ConstraintView   *P    = ConstraintGetView(p->constraint);
  const MeshLocal        *l    = p->loc;
  const size_t            size = (size_t)(p->nk * p->nr) * sizeof(PetscReal);
  const PetscReal *const *b;
  const unsigned char    *fixed;
  PetscInt                last = -1; /* the body that L is of */
  PetscReal               L[36];

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(p->flow, &b));
  PetscCall(ConditionsGetValues(FlowConditions(p->flow), &fixed, NULL));
  p->cut.n = 0;
  for (PetscInt t = 0; t < p->list.ntouched; t++) {
    const PetscInt c = p->list.touched[t], *node = l->cell_node + c * l->nb;

    for (PetscInt j = 0, before = -1; j < l->nb; j++) {
      const PetscInt k = moving_body(P, fraction, node[j]);

      if (k < 0 || k == before || !ConstraintHasUnknown(P, k)) continue;
      before = k;
      if (!begins_cut(P, fraction, l->nb, node, j, k)) continue;
      PetscCall(ArrayReserve(p->cut.n + 1, &p->cut.capacity, &p->cut.cell, sizeof(*p->cut.cell), &p->cut.body,
                             sizeof(*p->cut.body), &p->cut.local, sizeof(*p->cut.local), &p->cut.w, size, NULL));
      p->cut.cell[p->cut.n]  = c;
      p->cut.body[p->cut.n]  = k;
      p->cut.local[p->cut.n] = P->local_index[k];
      if (k != last) DenseFactor(p->nr, mass_inverse + k * p->nr * p->nr, L);
      last = k;
      if (l->dim == 2) cut_rows(2, p, fixed, fraction, b, c, k, L, p->cut.w + p->cut.n * p->nk * p->nr);
      else cut_rows(3, p, fixed, fraction, b, c, k, L, p->cut.w + p->cut.n * p->nk * p->nr);
      p->cut.n++;
    }
  }
  PetscCall(ArrayTrim(p->cut.n, &p->cut.capacity, &p->cut.cell, sizeof(*p->cut.cell), &p->cut.body,
                      sizeof(*p->cut.body), &p->cut.local, sizeof(*p->cut.local), &p->cut.w, size, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* t += W^T x and y += W t, entry by entry of W, with dimensions as constants */
INLINE void gather_bodies(const PetscInt nk, const PetscInt nr, Pressure p, const PetscReal *restrict x,
                          PetscReal *restrict t)
{
  for (PetscInt i = 0; i < p->cut.n; i++) {
    const PetscReal *w = p->cut.w + i * nk * nr, *xi = x + p->cut.cell[i] * nk;
    PetscReal       *ti = t + p->cut.local[i] * nr;

    for (PetscInt k = 0; k < nk; k++)
      for (PetscInt s = 0; s < nr; s++) ti[s] += w[k * nr + s] * xi[k];
  }
}

INLINE void spread_bodies(const PetscInt nk, const PetscInt nr, Pressure p, const PetscReal *restrict t,
                          PetscReal *restrict y)
{
  for (PetscInt i = 0; i < p->cut.n; i++) {
    const PetscReal *w = p->cut.w + i * nk * nr, *ti = t + p->cut.local[i] * nr;
    PetscReal       *yi = y + p->cut.cell[i] * nk;

    for (PetscInt k = 0; k < nk; k++)
      for (PetscInt s = 0; s < nr; s++) yi[k] += w[k * nr + s] * ti[s];
  }
}

PetscErrorCode PressureMult(Mat mat, Vec x, Vec y)
{
  const ConstraintView *P;
  Pressure              p;
  const PetscReal      *xa;
  PetscReal            *ya;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &p));
  P = ConstraintGetView(p->constraint);
  if (p->nbodies && p->device) {
    PetscCall(PressureMultOnDevice(p, x, y));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (p->nbodies) {
    PetscCall(VecGetArrayRead(x, &xa));
    PetscCall(PetscArrayzero(p->cut.work, P->nlocal * p->nr));
    if (p->nk == 3) gather_bodies(3, 3, p, xa, p->cut.work);
    else gather_bodies(4, 6, p, xa, p->cut.work);
    PetscCall(VecRestoreArrayRead(x, &xa));
    if (p->contact_coupling) PetscCall(ContactCouplingSolveBegin(p->contact_coupling, p->cut.work));
    PetscCall(SharedReductionSumBegin(P->shared_reduction, p->nr, p->cut.work));
  }
  if (p->nodes.block_gs) PetscCall(BlockGSMultiplySparse(p->nodes.matrix, x, y));
  else PetscCall(MatMult(p->nodes.matrix, x, y));
  if (!p->nbodies) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SharedReductionSumEnd(P->shared_reduction, p->nr, p->cut.work));
  PetscCall(VecGetArray(y, &ya));
  if (p->contact_coupling) PetscCall(ContactCouplingSolveEnd(p->contact_coupling, p->cut.work));
  if (p->nk == 3) spread_bodies(3, 3, p, p->cut.work, ya);
  else spread_bodies(4, 6, p, p->cut.work, ya);
  PetscCall(VecRestoreArray(y, &ya));
  PetscFunctionReturn(PETSC_SUCCESS);
}
