/* Hang: see mesh/hang.h, hangimpl.h. */
#include "compat.h"
#include "hangimpl.h"
#include "mesh/mesh.h"

/* Steps of lattice position j along axis a from the corner that cell and parent share: 0, 1, 2 */
static PetscInt steps(PetscInt child, PetscInt j, PetscInt a)
{
  const PetscInt at[3] = {j % 3, j / 3 % 3, j / 9};

  return (child >> a) & 1 ? 2 - at[a] : at[a];
}

PetscBool HangStretched(PetscInt dim, PetscInt code, PetscInt j, PetscInt a)
{
  const PetscInt child = code & 7, face = (code >> 3) & 7, edge = code >> 6;
  PetscBool      on_edge = (PetscBool)((edge >> a) & 1);

  for (PetscInt b = 0; b < dim; b++) {
    if (b == a) continue;
    if (steps(child, j, b)) on_edge = PETSC_FALSE;
    else if ((face >> b) & 1) return PETSC_TRUE;
  }
  return on_edge;
}

/* Multilinear functions: the vertices of a stretched edge are at 0 and 4 steps of a cell's lattice, a corner at 2 */
static void fill_corners(PetscInt dim, PetscInt code, MeshHang *h)
{
  const PetscInt child = code & 7;

  for (PetscInt v = 0; v < 1 << dim; v++) {
    PetscInt j = 0, from[8], n = 1;

    for (PetscInt a = 0, s = 1; a < dim; a++, s *= 3) j += ((v >> a) & 1 ? 2 : 0) * s;
    from[0] = v;
    for (PetscInt a = 0; a < dim; a++) {
      if (!steps(child, j, a) || !HangStretched(dim, code, j, a)) continue;
      for (PetscInt i = 0; i < n; i++) from[n + i] = from[i] ^ (1 << a);
      n *= 2;
    }
    for (PetscInt i = 0; i < 1 << dim; i++) h->corner[v][i] = 0;
    for (PetscInt i = 0; i < n; i++) h->corner[v][from[i]] = 1.0 / (PetscReal)n;
  }
}

void HangCreate(PetscInt dim, PetscInt code, MeshHang *h)
{
  static const PetscReal weight[3][3] = {{1, 0, 0}, {0.375, 0.75, -0.125}, {0, 1, 0}};
  const PetscInt         child = code & 7, power[3] = {1, 3, 9};

  h->code     = code;
  h->nb       = dim == 2 ? 9 : 27;
  h->n        = 0;
  h->start[0] = 0;
  for (PetscInt j = 0; j < h->nb; j++) {
    PetscInt  n = 1, from[9] = {j};
    PetscReal w[9] = {1};

    for (PetscInt a = 0; a < dim; a++) {
      const PetscInt s = steps(child, j, a), sign = (child >> a) & 1 ? -1 : 1;
      PetscInt       m = 0, more[9];
      PetscReal      wm[9];

      if (!s || !HangStretched(dim, code, j, a)) continue;
      for (PetscInt i = 0; i < n; i++) {
        for (PetscInt k = 0; k < 3; k++) {
          if (weight[s][k] == 0) continue;
          more[m] = from[i] + sign * (k - s) * power[a];
          wm[m++] = w[i] * weight[s][k];
        }
      }
      for (n = 0; n < m; n++) {
        from[n] = more[n];
        w[n]    = wm[n];
      }
    }
    if (n == 1 && from[0] == j) continue;
    h->slot[h->n] = j;
    for (PetscInt i = 0, at = h->start[h->n]; i < n; i++, at++) {
      h->from[at]   = from[i];
      h->weight[at] = w[i];
    }
    h->start[h->n + 1] = h->start[h->n] + n;
    h->n++;
  }
  fill_corners(dim, code, h);
}

void MeshHangGather(const MeshHang *h, PetscInt bs, PetscReal v[])
{
  PetscReal out[MESH_HANG_SLOTS * 3];

  for (PetscInt r = 0; r < h->n; r++) {
    for (PetscInt k = 0; k < bs; k++) out[r * bs + k] = 0;
    for (PetscInt e = h->start[r]; e < h->start[r + 1]; e++)
      for (PetscInt k = 0; k < bs; k++) out[r * bs + k] += h->weight[e] * v[h->from[e] * bs + k];
  }
  for (PetscInt r = 0; r < h->n; r++)
    for (PetscInt k = 0; k < bs; k++) v[h->slot[r] * bs + k] = out[r * bs + k];
}

void MeshHangScatter(const MeshHang *h, PetscInt bs, PetscReal r[])
{
  PetscReal in[MESH_HANG_SLOTS * 3];

  for (PetscInt s = 0; s < h->n; s++) {
    for (PetscInt k = 0; k < bs; k++) {
      in[s * bs + k]         = r[h->slot[s] * bs + k];
      r[h->slot[s] * bs + k] = 0;
    }
  }
  for (PetscInt s = 0; s < h->n; s++)
    for (PetscInt e = h->start[s]; e < h->start[s + 1]; e++)
      for (PetscInt k = 0; k < bs; k++) r[h->from[e] * bs + k] += h->weight[e] * in[s * bs + k];
}

/* Rows K[slot] of all columns at once would need room for a copy of the matrix: column by column for rows */
void MeshHangMatrix(const MeshHang *h, PetscInt bs, PetscInt stride, PetscReal K[])
{
  const PetscInt n = h->nb * bs;
  PetscReal      line[MESH_HANG_SLOTS * 3];

  for (PetscInt i = 0; i < n; i++) MeshHangScatter(h, bs, K + i * stride);
  for (PetscInt j = 0; j < n; j++) {
    for (PetscInt i = 0; i < n; i++) line[i] = K[i * stride + j];
    MeshHangScatter(h, bs, line);
    for (PetscInt i = 0; i < n; i++) K[i * stride + j] = line[i];
  }
}

/* Places whose values have a share of a slot: those of slot j are [start[j], start[j + 1]) */
static void list_slots(const MeshHang *h, PetscInt start[], PetscInt index_of[], PetscReal weight[])
{
  PetscInt row[MESH_HANG_SLOTS], at[MESH_HANG_SLOTS];

  for (PetscInt j = 0; j < h->nb; j++) row[j] = -1;
  for (PetscInt j = 0; j <= h->nb; j++) start[j] = 0;
  for (PetscInt r = 0; r < h->n; r++) row[h->slot[r]] = r;
  for (PetscInt j = 0; j < h->nb; j++) start[j + 1] += row[j] < 0;
  for (PetscInt e = 0; e < h->start[h->n]; e++) start[h->from[e] + 1]++;
  for (PetscInt j = 0; j < h->nb; j++) start[j + 1] += start[j];
  for (PetscInt j = 0; j < h->nb; j++) at[j] = start[j];
  for (PetscInt j = 0; j < h->nb; j++) {
    if (row[j] < 0) {
      index_of[at[j]] = j;
      weight[at[j]++] = 1;
      continue;
    }
    for (PetscInt e = h->start[row[j]]; e < h->start[row[j] + 1]; e++) {
      index_of[at[h->from[e]]] = j;
      weight[at[h->from[e]]++] = h->weight[e];
    }
  }
}

void MeshHangDiagonal(const MeshHang *h, PetscInt stride, const PetscReal K[], PetscReal d[])
{
  PetscInt  start[MESH_HANG_SLOTS + 1], index_of[MESH_HANG_SLOTS * 10];
  PetscReal weight[MESH_HANG_SLOTS * 10];

  list_slots(h, start, index_of, weight);
  for (PetscInt j = 0; j < h->nb; j++) {
    d[j] = 0;
    for (PetscInt a = start[j]; a < start[j + 1]; a++)
      for (PetscInt b = start[j]; b < start[j + 1]; b++)
        d[j] += weight[a] * weight[b] * K[index_of[a] * stride + index_of[b]];
  }
}
