/* Remap: see remap.h. Candidates are the cells of a patch of 5 x 5 around the place, found by their centre nodes in the
   background grid of the mesh. */
#include "compat.h"
#include "mesh/remap.h"
#include "base/algebra.h"
#include "mesh/element.h"

#define MAX_PATCH 64
#define REACH     1.8  /* of (b), reference coordinates */
#define TAYLOR    1.5  /* of (c), cell sizes */
#define POINT     0.77 /* of (c) */
#define PLACE     4    /* numbers that describe a place to other ranks: itself, cell size, side */

/* How good an answer is: kind 0 (a) .. 3 (d), then a measure, the smaller the better */
typedef struct {
  PetscReal key; /* 1000 kind + measure */
  PetscInt  cell;
  PetscReal xi[2], offset[2]; /* (c): evaluate at xi and go on by offset in space */
} Answer;

struct _p_Remap {
  Mesh             mesh;
  const MeshLocal *loc;
};

/* ---- one cell ---- */

/* Place y and Jacobian J[a][e] = dx_a/dxi_e of a cell with nodes xc; returns det J */
static PetscReal map_cell(const PetscReal xc[], const PetscReal xi[2], PetscReal y[2], PetscReal J[4])
{
  ElementMap(2, xc, xi, y, J);
  return DenseDeterminant(2, J);
}

/* Newton's method for x(xi) = x from the middle of the cell; false if it goes too far or meets a Jacobian <= 0 */
static PetscBool invert_map(const PetscReal xc[], const PetscReal x[2], PetscReal xi[2])
{
  PetscReal change = 1;

  xi[0] = xi[1] = 0;
  for (PetscInt it = 0; it < 25 && change > 1e-13; it++) {
    PetscReal y[2], J[4], det = map_cell(xc, xi, y, J), dxi[2];

    if (det <= 0) return PETSC_FALSE;
    dxi[0] = (J[3] * (x[0] - y[0]) - J[1] * (x[1] - y[1])) / det;
    dxi[1] = (J[0] * (x[1] - y[1]) - J[2] * (x[0] - y[0])) / det;
    for (PetscInt e = 0; e < 2; e++) xi[e] += dxi[e];
    change = PetscMax(PetscAbsReal(dxi[0]), PetscAbsReal(dxi[1]));
    if (!(PetscMax(PetscAbsReal(xi[0]), PetscAbsReal(xi[1])) < 4)) return PETSC_FALSE;
  }
  return (PetscBool)(change < 1e-9 && PetscMax(PetscAbsReal(xi[0]), PetscAbsReal(xi[1])) <= REACH);
}

/* Try cell c for x (the image nearest to the cell): a better answer replaces *best */
static PetscErrorCode try_cell(Remap r, PetscInt c, const PetscReal at[2], PetscReal size, Answer *best)
{
  const MeshLocal *l = r->loc;
  PetscReal        xc[18], x[2], xi[2], outside;
  const PetscReal *centre = xc + 8;

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(r->mesh, c, xc));
  for (PetscInt a = 0; a < 2; a++) x[a] = DomainNearest(l->period[a], at[a], centre[a]);
  if (invert_map(xc, x, xi)) {
    outside = PetscMax(PetscAbsReal(xi[0]), PetscAbsReal(xi[1]));
    if (outside < 1 + 1e-10) *best = (Answer){0, c, {xi[0], xi[1]}, {0, 0}};
    else if (1000 + outside < best->key) *best = (Answer){1000 + outside, c, {xi[0], xi[1]}, {0, 0}};
  }
  if (best->key < 2000) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt p = 0; p < 9; p++) {
    const PetscReal point[2] = {POINT * (p % 3 - 1), POINT * (p / 3 - 1)};
    PetscReal       y[2], J[4], distance;

    (void)map_cell(xc, point, y, J);
    distance = PetscSqrtReal(PetscSqr(x[0] - y[0]) + PetscSqr(x[1] - y[1])) / size;
    if (distance <= TAYLOR && 2000 + distance < best->key) *best = (Answer){2000 + distance, c, {point[0], point[1]}, {x[0] - y[0], x[1] - y[1]}};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the patch ---- */

static PetscBool may_answer(RemapCells cells, PetscInt c, PetscInt side)
{
  return (PetscBool)(cells.dead[c] < 0 && (!side || cells.side[c] != -side));
}

/* Fluid cells of the patch around x, nearest first: cell [MAX_PATCH]. own: only cells of this rank */
static PetscErrorCode find_patch(Remap r, const PetscReal x[2], PetscReal size, PetscInt side, RemapCells cells, PetscBool own, PetscInt *n,
                                 PetscInt cell[])
{
  const MeshLocal *l = r->loc;
  PetscReal        distance[MAX_PATCH];

  PetscFunctionBeginUser;
  *n = 0;
  for (DomainImages image = {0}; MeshNextImage(l, (const PetscReal[3]){x[0], x[1], 0}, 3 * size, &image);) {
    const PetscInt *list;
    PetscInt        m;

    PetscCall(MeshNodesInBox(r->mesh, image.at, 3 * size, &m, &list));
    for (PetscInt e = 0; e < m; e++) {
      const PetscInt c = l->centre_cell[list[e]];
      PetscReal      d = 0;
      PetscInt       at;

      if (c < 0 || !may_answer(cells, c, side) || (own && c >= l->ncell)) continue;
      for (PetscInt a = 0; a < 2; a++) d += PetscSqr(l->x[2 * list[e] + a] - image.at[a]);
      if (*n == MAX_PATCH && d >= distance[MAX_PATCH - 1]) continue;
      for (at = *n == MAX_PATCH ? MAX_PATCH - 1 : *n; at > 0 && distance[at - 1] > d; at--) {
        distance[at] = distance[at - 1];
        cell[at]     = cell[at - 1];
      }
      distance[at] = d;
      cell[at]     = c;
      if (*n < MAX_PATCH) (*n)++;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_answer(Remap r, const PetscReal x[2], PetscReal size, PetscInt side, RemapCells cells, PetscBool own, Answer *best)
{
  PetscInt n, cell[MAX_PATCH];

  PetscFunctionBeginUser;
  *best = (Answer){3000, -1, {0, 0}, {0, 0}};
  PetscCall(find_patch(r, x, size, side, cells, own, &n, cell));
  for (PetscInt e = 0; e < n && best->key > 0; e++) PetscCall(try_cell(r, cell[e], x, size, best));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* May a cell with these nodes contain x? Edges, parabolas through their nodes, hardly leave the box of the nodes. */
static PetscBool is_in_box(const PetscReal xc[], const PetscReal x[2])
{
  for (PetscInt a = 0; a < 2; a++) {
    PetscReal lo = xc[a], hi = xc[a];

    for (PetscInt j = 1; j < 9; j++) {
      lo = PetscMin(lo, xc[2 * j + a]);
      hi = PetscMax(hi, xc[2 * j + a]);
    }
    if (x[a] < lo - 0.1 * (hi - lo) || x[a] > hi + 0.1 * (hi - lo)) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

/* Most nodes move within the cells around them: is x in one of those of own node i? */
static PetscErrorCode try_around(Remap r, PetscInt i, const PetscReal at[2], PetscInt side, RemapCells cells, Answer *best)
{
  const MeshLocal *l = r->loc;

  PetscFunctionBeginUser;
  best->key = 3000;
  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1] && best->key > 0; e++) {
    const PetscInt c = l->node_cell[e];
    PetscReal      xc[18], x[2], xi[2];

    if (!may_answer(cells, c, side)) continue;
    PetscCall(MeshCellCoordinates(r->mesh, c, xc));
    for (PetscInt a = 0; a < 2; a++) x[a] = DomainNearest(l->period[a], at[a], xc[8 + a]);
    if (is_in_box(xc, x) && invert_map(xc, x, xi) && PetscMax(PetscAbsReal(xi[0]), PetscAbsReal(xi[1])) < 1 + 1e-10)
      *best = (Answer){0, c, {xi[0], xi[1]}, {0, 0}};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Values of the fields: v [nfield][2] */
static PetscErrorCode evaluate(Remap r, const Answer *answer, PetscInt nfield, const PetscReal *const field[], PetscReal v[])
{
  const PetscInt *node = r->loc->cell_node + answer->cell * r->loc->nb;
  PetscReal       xc[18], y[2], J[4], phi[9], dphi[2][9], det, dxi[2];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(r->mesh, answer->cell, xc));
  det    = map_cell(xc, answer->xi, y, J);
  dxi[0] = (J[3] * answer->offset[0] - J[1] * answer->offset[1]) / det;
  dxi[1] = (J[0] * answer->offset[1] - J[2] * answer->offset[0]) / det;
  ElementBasis(2, answer->xi, phi, &dphi[0][0]);
  for (PetscInt j = 0; j < 9; j++) phi[j] += dxi[0] * dphi[0][j] + dxi[1] * dphi[1][j];
  MeshCellScatter(r->loc, answer->cell, 1, phi);
  for (PetscInt f = 0; f < nfield; f++) {
    for (PetscInt a = 0; a < 2; a++) {
      v[2 * f + a] = 0;
      for (PetscInt j = 0; j < 9; j++) v[2 * f + a] += phi[j] * field[f][2 * node[j] + a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal RemapCellSize(Remap r, PetscInt i)
{
  const MeshLocal *l    = r->loc;
  PetscReal        size = 0;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
    const PetscInt *node = l->cell_node + l->node_cell[e] * l->nb;

    for (PetscInt a = 0; a < 2; a++) {
      for (PetscInt j = 0; j < 2; j++) { /* along both directions of the lattice */
        PetscReal d = PetscAbsReal(l->x_start[2 * node[j ? 5 : 7] + a] - l->x_start[2 * node[j ? 3 : 1] + a]);

        if (l->period[a] > 0) d = PetscMin(d, l->period[a] - d);
        size = PetscMax(size, d);
      }
    }
  }
  return size;
}

/* ---- all ranks ---- */

typedef struct {
  PetscReal key;
  int       rank;
} KeyRank;

/* Places that no local cell contains, on every rank: open [nopen] indices into x; the answers of all ranks compete.
   counts of (b), (c), (d) are added. */
static PetscErrorCode ask_all(Remap r, PetscInt nopen, const PetscInt open[], const PetscReal x[], const PetscReal cell_size[], const PetscInt side[],
                              RemapCells cells, PetscInt nfield, const PetscReal *const field[], PetscReal out[], RemapCount *count)
{
  const PetscInt bs = 2 * nfield;
  PetscMPIInt    size, rank, mine = (PetscMPIInt)(PLACE * nopen), *n, *start, total = 0;
  PetscReal     *send, *place, *value;
  Answer        *answer;
  KeyRank       *key;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCall(PetscMalloc3(size, &n, size, &start, PLACE * nopen, &send));
  for (PetscInt e = 0; e < nopen; e++) {
    send[PLACE * e]     = x[2 * open[e]];
    send[PLACE * e + 1] = x[2 * open[e] + 1];
    send[PLACE * e + 2] = cell_size[open[e]];
    send[PLACE * e + 3] = (PetscReal)side[open[e]];
  }
  PetscCallMPI(MPI_Allgather(&mine, 1, MPI_INT, n, 1, MPI_INT, PETSC_COMM_WORLD));
  for (PetscMPIInt i = 0; i < size; i++) {
    start[i] = total;
    total += n[i];
  }
  PetscCall(PetscMalloc4(total, &place, total / PLACE, &answer, total / PLACE, &key, total / PLACE * bs, &value));
  PetscCallMPI(MPI_Allgatherv(send, mine, MPIU_REAL, place, n, start, MPIU_REAL, PETSC_COMM_WORLD));
  total /= PLACE;
  for (PetscInt i = 0; i < total; i++) {
    PetscCall(find_answer(r, place + PLACE * i, place[PLACE * i + 2], (PetscInt)place[PLACE * i + 3], cells, PETSC_TRUE, &answer[i]));
    key[i] = (KeyRank){answer[i].key, rank};
  }
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, key, total, MPI_DOUBLE_INT, MPI_MINLOC, PETSC_COMM_WORLD));
  PetscCall(PetscArrayzero(value, total * bs));
  for (PetscInt i = 0; i < total; i++)
    if (key[i].rank == rank && key[i].key < 3000) PetscCall(evaluate(r, &answer[i], nfield, field, value + i * bs));
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, value, total * (int)bs, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  for (PetscInt i = 0; i < total; i++) {
    const PetscInt e = i - start[rank] / PLACE;

    if (key[i].key >= 3000) count->kept++;
    else if (key[i].key >= 2000) count->taylor++;
    else if (key[i].key > 0) count->extended++;
    else count->inside++;
    if (e >= 0 && e < nopen && key[i].key < 3000) PetscCall(PetscArraycpy(out + open[e] * bs, value + i * bs, bs));
  }
  PetscCall(PetscFree4(place, answer, key, value));
  PetscCall(PetscFree3(n, start, send));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* At places x [n] in cells of these sizes; nodes [n] (NULL: of another mesh) are where to look first */
static PetscErrorCode evaluate_all(Remap r, PetscInt n, const PetscInt nodes[], const PetscReal x[], const PetscReal size[], const PetscInt side[],
                                   RemapCells cells, PetscInt nfield, const PetscReal *const field[], PetscReal out[], RemapCount *count)
{
  PetscInt *open, nopen = 0, inside;

  PetscFunctionBeginUser;
  *count = (RemapCount){0, 0, 0, 0};
  PetscCall(PetscMalloc1(n, &open));
  for (PetscInt e = 0; e < n; e++) {
    Answer best = {.key = 3000};

    if (nodes) PetscCall(try_around(r, nodes[e], x + 2 * e, side[e], cells, &best));
    if (best.key > 0) PetscCall(find_answer(r, x + 2 * e, size[e], side[e], cells, PETSC_FALSE, &best));
    if (best.key == 0) PetscCall(evaluate(r, &best, nfield, field, out + 2 * e * nfield));
    else open[nopen++] = e;
  }
  inside = n - nopen;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &inside, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD));
  PetscCall(ask_all(r, nopen, open, x, size, side, cells, nfield, field, out, count));
  count->inside += inside;
  PetscCall(PetscFree(open));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode RemapCreate(Mesh mesh, Remap *remap)
{
  Remap r;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&r));
  r->mesh = mesh;
  PetscCall(MeshGetLocal(mesh, &r->loc));
  PetscCheck(r->loc->dim == 2, PETSC_COMM_WORLD, PETSC_ERR_SUP,
             "Fields are carried to moved nodes on plane meshes only, this one has dimension %" PetscInt_FMT, r->loc->dim);
  *remap = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RemapDestroy(Remap *remap)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(*remap));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RemapEvaluate(Remap r, PetscInt n, const PetscInt nodes[], const PetscReal x[], const PetscInt side[], RemapCells cells,
                             PetscInt nfield, const PetscReal *const field[], PetscReal out[], RemapCount *count)
{
  PetscReal *size;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &size));
  for (PetscInt e = 0; e < n; e++) {
    size[e] = RemapCellSize(r, nodes[e]);
    for (PetscInt f = 0; f < nfield; f++)
      for (PetscInt a = 0; a < 2; a++) out[(e * nfield + f) * 2 + a] = field[f][2 * nodes[e] + a];
  }
  PetscCall(evaluate_all(r, n, nodes, x, size, side, cells, nfield, field, out, count));
  PetscCall(PetscFree(size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RemapEvaluateAt(Remap r, PetscInt n, const PetscReal x[], const PetscReal size[], const PetscInt side[], RemapCells cells,
                               PetscInt nfield, const PetscReal *const field[], PetscReal out[], RemapCount *count)
{
  PetscFunctionBeginUser;
  PetscCall(evaluate_all(r, n, NULL, x, size, side, cells, nfield, field, out, count));
  PetscFunctionReturn(PETSC_SUCCESS);
}
