/* Points: see points.h. The owner of a node has all cells around it, and so knows which images of it are needed. */
#include "compat.h"
#include "points.h"

/* Position in the cell's lattice (ix + 3 iy + 9 iz) of VTK's k-th node: corners, edges, (3D: faces,) centre */
static const PetscInt VTK_QUAD[9] = {0, 2, 8, 6, 1, 5, 7, 3, 4};
static const PetscInt VTK_HEX[27] = {0,  2,  8, 6,  18, 20, 26, 24, 1,  5,  7, 3,  19, 23,
                                     25, 21, 9, 11, 17, 15, 12, 14, 10, 16, 4, 22, 13};

const PetscInt *PointsVtkOrder(PetscInt dim)
{
  return dim == 2 ? VTK_QUAD : VTK_HEX;
}

#define HERE 13 /* the code of no shift */

static PetscInt power3(PetscInt a)
{
  return a == 0 ? 1 : a == 1 ? 3 : 9;
}

/* Where cell c needs its nodes: code [nb] */
static PetscErrorCode get_codes(Mesh mesh, const MeshLocal *m, PetscInt c, PetscInt code[])
{
  PetscReal xc[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(MeshSlotCoordinates(mesh, c, xc));
  for (PetscInt j = 0; j < m->nb; j++) {
    const PetscReal *x = m->x + m->cell_node[c * m->nb + j] * m->dim;

    code[j] = HERE;
    for (PetscInt a = 0; a < m->dim; a++)
      if (m->period[a] > 0)
        code[j] += power3(a) * (PetscInt)PetscFloorReal((xc[j * m->dim + a] - x[a]) / m->period[a] + 0.5);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Which shifts of its nodes the cells of this rank, ghosts too, need: bits [nnode_all] */
static PetscErrorCode collect_codes(Mesh mesh, const MeshLocal *m, PetscInt bits[])
{
  PetscInt code[MESH_MAX_NB];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m->nnode_all; i++) bits[i] = 1 << HERE;
  if (m->period[0] <= 0 && m->period[1] <= 0 && m->period[2] <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt c = 0; c < m->ncell_all; c++) {
    PetscCall(get_codes(mesh, m, c, code));
    for (PetscInt j = 0; j < m->nb; j++) bits[m->cell_node[c * m->nb + j]] |= 1 << code[j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own points: nodes first, then their images */
static PetscErrorCode list_points(const MeshLocal *m, const PetscInt bits[], Points *p)
{
  PetscInt n = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m->nnode; i++)
    for (PetscInt k = 0; k < POINTS_MAX_CODES; k++) n += (bits[i] >> k) & 1;
  PetscCall(PetscMalloc2(n, &p->node, n, &p->code));
  p->n = m->nnode;
  for (PetscInt i = 0; i < m->nnode; i++) {
    p->node[i] = i;
    p->code[i] = HERE;
    for (PetscInt k = 0; k < POINTS_MAX_CODES; k++) {
      if (k == HERE || !((bits[i] >> k) & 1)) continue;
      p->node[p->n]   = i;
      p->code[p->n++] = k;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Hanging places of own cells that are no node */
static PetscErrorCode list_hanging(const MeshLocal *m, Points *p)
{
  PetscFunctionBeginUser;
  for (PetscInt pass = 0; pass < 2; pass++) {
    PetscInt n = 0;

    for (PetscInt c = 0; c < m->ncell; c++) {
      const MeshHang *h = MeshCellHang(m, c);

      for (PetscInt r = 0; h && r < h->n; r++) {
        if (h->start[r + 1] - h->start[r] == 1) continue;
        if (pass) {
          p->cell[n] = c;
          p->row[n]  = r;
        }
        n++;
      }
    }
    if (!pass) PetscCall(PetscMalloc2(n, &p->cell, n, &p->row));
    p->nhang = n;
  }
  p->n += p->nhang;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PointsCreate(Mesh mesh, Points *p)
{
  const MeshLocal *m;
  MPI_Comm         comm;
  PetscInt        *bits, any = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(p, sizeof(*p)));
  PetscCall(MeshGetLocal(mesh, &m));
  PetscCall(MeshGetComm(mesh, &comm));
  PetscCall(PetscMalloc1(m->nnode_all, &bits));
  PetscCall(collect_codes(mesh, m, bits));
  PetscCall(list_points(m, bits, p));
  PetscCall(list_hanging(m, p));
  for (PetscInt i = 0; i < m->nnode_all; i++) any |= bits[i];
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &any, 1, MPIU_INT, MPI_BOR, comm));
  PetscCallMPI(MPI_Scan(&p->n, &p->start, 1, MPIU_INT, MPI_SUM, comm));
  p->start -= p->n;
  PetscCallMPI(MPI_Allreduce(&p->n, &p->total, 1, MPIU_INT, MPI_SUM, comm));
  for (PetscInt k = 0; k < POINTS_MAX_CODES; k++) {
    if (!((any >> k) & 1)) continue;
    PetscCall(PetscMalloc1(m->nnode_all, &p->number[k]));
    for (PetscInt i = 0; i < m->nnode_all; i++) p->number[k][i] = -1;
    for (PetscInt i = 0; i < p->n - p->nhang; i++)
      if (p->code[i] == k) p->number[k][p->node[i]] = p->start + i;
    PetscCall(MeshSyncNodesInt(mesh, p->number[k]));
  }
  PetscCall(PetscFree(bits));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PointsDestroy(Points *p)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < POINTS_MAX_CODES; k++) PetscCall(PetscFree(p->number[k]));
  PetscCall(PetscFree2(p->node, p->code));
  PetscCall(PetscFree2(p->cell, p->row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PointsGetPositions(const Points *p, Mesh mesh, PetscReal x[])
{
  const MeshLocal *m;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &m));
  for (PetscInt i = 0; i < p->n - p->nhang; i++) {
    for (PetscInt a = 0; a < 3; a++)
      x[3 * i + a] = a < m->dim
                     ? m->x[p->node[i] * m->dim + a] + m->period[a] * (PetscReal)(p->code[i] / power3(a) % 3 - 1)
                     : 0;
  }
  for (PetscInt k = 0; k < p->nhang; k++) {
    const PetscInt j = MeshCellHang(m, p->cell[k])->slot[p->row[k]];
    PetscReal      xc[MESH_MAX_NB * 3];

    PetscCall(MeshCellCoordinates(mesh, p->cell[k], xc));
    for (PetscInt a = 0; a < 3; a++) x[3 * (p->n - p->nhang + k) + a] = a < m->dim ? xc[j * m->dim + a] : 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PointsEvaluate(const Points *p, Mesh mesh, PetscInt bs, const PetscReal v[], PetscReal w[])
{
  const MeshLocal *m;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &m));
  for (PetscInt i = 0; i < p->n - p->nhang; i++)
    for (PetscInt b = 0; b < bs; b++) w[i * bs + b] = v[p->node[i] * bs + b];
  for (PetscInt k = 0; k < p->nhang; k++) {
    const MeshHang *h    = MeshCellHang(m, p->cell[k]);
    const PetscInt *node = m->cell_node + p->cell[k] * m->nb;
    PetscReal      *out  = w + (p->n - p->nhang + k) * bs;

    for (PetscInt b = 0; b < bs; b++) {
      out[b] = 0;
      for (PetscInt e = h->start[p->row[k]]; e < h->start[p->row[k] + 1]; e++)
        out[b] += h->weight[e] * v[node[h->from[e]] * bs + b];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PointsPick(const Points *p, Mesh mesh, const PetscInt v[], PetscInt w[])
{
  const MeshLocal *m;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &m));
  for (PetscInt i = 0; i < p->n - p->nhang; i++) w[i] = v[p->node[i]];
  for (PetscInt k = 0; k < p->nhang; k++) {
    const MeshHang *h    = MeshCellHang(m, p->cell[k]);
    PetscInt        best = h->start[p->row[k]];

    for (PetscInt e = best; e < h->start[p->row[k] + 1]; e++)
      if (h->weight[e] > h->weight[best]) best = e;
    w[p->n - p->nhang + k] = v[m->cell_node[p->cell[k] * m->nb + h->from[best]]];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where the points of the hanging places of cell c begin, among all of this rank: cells come in order */
static PetscInt first_hanging(const Points *p, PetscInt c)
{
  PetscInt lo = 0, hi = p->nhang;

  while (lo < hi) {
    const PetscInt mid = (lo + hi) / 2;

    if (p->cell[mid] < c) lo = mid + 1;
    else hi = mid;
  }
  return p->n - p->nhang + lo;
}

PetscErrorCode PointsOfCell(const Points *p, Mesh mesh, PetscInt c, PetscInt number[])
{
  const MeshLocal *m;
  const MeshHang  *h;
  PetscInt         code[MESH_MAX_NB], slot[MESH_MAX_NB], at = 0;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &m));
  PetscCall(get_codes(mesh, m, c, code));
  h = MeshCellHang(m, c);
  for (PetscInt j = 0; j < m->nb; j++) slot[j] = number[j] = p->number[code[j]][m->cell_node[c * m->nb + j]];
  if (h) at = p->start + first_hanging(p, c);
  for (PetscInt r = 0; h && r < h->n; r++)
    number[h->slot[r]] = h->start[r + 1] - h->start[r] == 1 ? slot[h->from[h->start[r]]] : at++;
  PetscFunctionReturn(PETSC_SUCCESS);
}
