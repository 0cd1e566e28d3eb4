/* Remap: see remap.h. Candidates are the cells of a patch of 5 x 5 (x 5) around the place, found by their centre nodes
   in the background grid of the mesh. */
#include "compat.h"
#include "mesh/remap.h"
#include "base/algebra.h"
#include "base/sparse.h"
#include "base/rankboxes.h"
#include "fem/element.h"

_Static_assert(MESH_MAX_NB == ELEMENT_MAX_NB, "nodes of a cell");

#define MAX_PATCH 128
#define REACH     1.8  /* of (b), reference coordinates */
#define TAYLOR    1.5  /* of (c), cell sizes */
#define POINT     0.77 /* of (c) */

/* How good an answer is: kind 0 (a) .. 3 (d), then a measure, the smaller the better */
typedef struct {
  PetscReal key; /* 1000 kind + measure */
  PetscInt  cell;
  PetscReal xi[3], offset[3]; /* (c): evaluate at xi and go on by offset in space */
} Answer;

struct _p_Remap {
  Mesh             mesh;
  const MeshLocal *loc;
  MPI_Comm         comm;
  PetscMPIInt      tag;
  RankBoxes        regions; /* where the ranks' own cells were when it was made; nodes move by less than pad */
  PetscReal        pad;
};

/* The mesh as it is, or (way not NULL) its nodes moved by part times way [nnode_all][dim]: places are looked for there
   and values taken where they came from */
typedef struct {
  const PetscReal *way;
  PetscReal        part;
} Moved;

/* ---- one cell ---- */

static PetscErrorCode place_cell(Remap r, Moved moved, PetscInt c, PetscReal xc[])
{
  const MeshLocal *l    = r->loc;
  const PetscInt  *node = l->cell_node + c * l->nb, dim = l->dim;
  PetscReal        d[3 * MESH_MAX_NB];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(r->mesh, c, xc));
  if (!moved.way || moved.part == 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < dim * l->nb; e++) d[e] = moved.part * moved.way[dim * node[e / dim] + e % dim];
  MeshCellGather(l, c, dim, d);
  for (PetscInt e = 0; e < dim * l->nb; e++) xc[e] += d[e];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Place y and Jacobian J[a][e] = dx_a/dxi_e of a cell with nodes xc; returns det J */
static PetscReal map_cell(PetscInt dim, const PetscReal xc[], const PetscReal xi[], PetscReal y[], PetscReal J[])
{
  ElementMap(dim, xc, xi, y, J);
  return DenseDeterminant(dim, J);
}

/* J dxi = r */
static void solve_map(PetscInt dim, const PetscReal J[], PetscReal det, const PetscReal r[], PetscReal dxi[])
{
  if (dim == 3) solve3(J, r, dxi);
  else {
    dxi[0] = (J[3] * r[0] - J[1] * r[1]) / det;
    dxi[1] = (J[0] * r[1] - J[2] * r[0]) / det;
  }
}

static PetscReal largest_of(PetscInt dim, const PetscReal v[])
{
  PetscReal top = 0;

  for (PetscInt a = 0; a < dim; a++) top = PetscMax(top, PetscAbsReal(v[a]));
  return top;
}

/* Newton's method for x(xi) = x from the middle of the cell; false if it goes too far or meets a Jacobian <= 0 */
static PetscBool invert_map(PetscInt dim, const PetscReal xc[], const PetscReal x[], PetscReal xi[])
{
  PetscReal change = 1;

  for (PetscInt e = 0; e < dim; e++) xi[e] = 0;
  for (PetscInt it = 0; it < 25 && change > 1e-13; it++) {
    PetscReal y[3], J[9], det = map_cell(dim, xc, xi, y, J), r[3], dxi[3];

    if (det <= 0) return PETSC_FALSE;
    for (PetscInt a = 0; a < dim; a++) r[a] = x[a] - y[a];
    solve_map(dim, J, det, r, dxi);
    for (PetscInt e = 0; e < dim; e++) xi[e] += dxi[e];
    change = largest_of(dim, dxi);
    if (!(largest_of(dim, xi) < 4)) return PETSC_FALSE;
  }
  return (PetscBool)(change < 1e-9 && largest_of(dim, xi) <= REACH);
}

static Answer answer_at(PetscReal key, PetscInt cell, PetscInt dim, const PetscReal xi[])
{
  return (Answer){key, cell, {xi[0], xi[1], dim == 3 ? xi[2] : 0}, {0, 0, 0}};
}

/* Try cell c for x (the image nearest to the cell): a better answer replaces *best */
static PetscErrorCode try_cell(Remap r, Moved moved, PetscInt c, const PetscReal at[], PetscReal size, Answer *best)
{
  const MeshLocal *l   = r->loc;
  const PetscInt   dim = l->dim;
  PetscReal        xc[3 * MESH_MAX_NB], x[3] = {0}, xi[3], outside;
  const PetscReal *centre = xc + dim * (l->nb / 2);

  PetscFunctionBeginUser;
  PetscCall(place_cell(r, moved, c, xc));
  for (PetscInt a = 0; a < dim; a++) x[a] = DomainNearest(l->period[a], at[a], centre[a]);
  if (invert_map(dim, xc, x, xi)) {
    outside = largest_of(dim, xi);
    if (outside < 1 + 1e-10) *best = answer_at(0, c, dim, xi);
    else if (1000 + outside < best->key) *best = answer_at(1000 + outside, c, dim, xi);
  }
  if (best->key < 2000) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt p = 0; p < l->nb; p++) {
    const PetscReal point[3] = {POINT * (p % 3 - 1), POINT * (p / 3 % 3 - 1), POINT * (p / 9 - 1)};
    PetscReal       y[3], J[9], distance = 0;

    (void)map_cell(dim, xc, point, y, J);
    for (PetscInt a = 0; a < dim; a++) distance += PetscSqr(x[a] - y[a]);
    distance = PetscSqrtReal(distance) / size;
    if (distance > TAYLOR || 2000 + distance >= best->key) continue;
    *best = answer_at(2000 + distance, c, dim, point);
    for (PetscInt a = 0; a < dim; a++) best->offset[a] = x[a] - y[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the patch ---- */

static PetscBool may_answer(RemapCells cells, PetscInt c, PetscInt side)
{
  return (PetscBool)(!cells.inactive || (cells.inactive[c] < 0 && (!side || cells.side[c] != -side)));
}

/* Fluid cells of the patch around x, nearest first: cell [MAX_PATCH]. own: only cells of this rank */
static PetscErrorCode find_patch(Remap r, const PetscReal x[], PetscReal size, PetscInt side, RemapCells cells,
                                 PetscBool own, PetscInt *n, PetscInt cell[])
{
  const MeshLocal *l = r->loc;
  PetscReal        distance[MAX_PATCH];

  PetscFunctionBeginUser;
  *n = 0;
  for (DomainImages image = {0};
       MeshNextImage(l, (const PetscReal[3]){x[0], x[1], l->dim == 3 ? x[2] : 0}, 3 * size, &image);) {
    const PetscInt *list;
    PetscInt        m;

    PetscCall(MeshNodesInBox(r->mesh, image.at, 3 * size, &m, &list));
    for (PetscInt e = 0; e < m; e++) {
      const PetscInt c = l->centre_cell[list[e]];
      PetscReal      d = 0;
      PetscInt       at;

      if (c < 0 || !may_answer(cells, c, side) || (own && c >= l->ncell)) continue;
      for (PetscInt a = 0; a < l->dim; a++) d += PetscSqr(l->x[l->dim * list[e] + a] - image.at[a]);
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

/* In the moved mesh an answer is the nearest place of its cell */
static void hold_inside(PetscInt dim, Answer *best)
{
  for (PetscInt a = 0; a < dim; a++) {
    best->xi[a]     = PetscMax(-1, PetscMin(1, best->xi[a]));
    best->offset[a] = 0;
  }
}

static PetscErrorCode find_answer(Remap r, Moved moved, const PetscReal x[], PetscReal size, PetscInt side,
                                  RemapCells cells, PetscBool own, Answer *best)
{
  PetscInt n, cell[MAX_PATCH];

  PetscFunctionBeginUser;
  *best = (Answer){.key = 3000, .cell = -1};
  PetscCall(find_patch(r, x, size, side, cells, own, &n, cell));
  for (PetscInt e = 0; e < n && best->key > 0; e++) PetscCall(try_cell(r, moved, cell[e], x, size, best));
  if (moved.way && best->key > 0) hold_inside(r->loc->dim, best);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* May a cell with these nodes contain x? Edges, parabolas through their nodes, hardly leave the box of the nodes. */
static PetscBool is_in_box(PetscInt dim, PetscInt nb, const PetscReal xc[], const PetscReal x[])
{
  for (PetscInt a = 0; a < dim; a++) {
    PetscReal lo = xc[a], hi = xc[a];

    for (PetscInt j = 1; j < nb; j++) {
      lo = PetscMin(lo, xc[dim * j + a]);
      hi = PetscMax(hi, xc[dim * j + a]);
    }
    if (x[a] < lo - 0.1 * (hi - lo) || x[a] > hi + 0.1 * (hi - lo)) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

/* Most nodes move within the cells around them: is x in one of those of own node i? */
static PetscErrorCode try_around(Remap r, Moved moved, PetscInt i, const PetscReal at[], PetscInt side,
                                 RemapCells cells, Answer *best)
{
  const MeshLocal *l   = r->loc;
  const PetscInt   dim = l->dim;

  PetscFunctionBeginUser;
  best->key = 3000;
  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1] && best->key > 0; e++) {
    const PetscInt c = l->node_cell[e];
    PetscReal      xc[3 * MESH_MAX_NB], x[3], xi[3];

    if (!may_answer(cells, c, side)) continue;
    PetscCall(place_cell(r, moved, c, xc));
    for (PetscInt a = 0; a < dim; a++) x[a] = DomainNearest(l->period[a], at[a], xc[dim * (l->nb / 2) + a]);
    if (is_in_box(dim, l->nb, xc, x) && invert_map(dim, xc, x, xi) && largest_of(dim, xi) < 1 + 1e-10)
      *best = answer_at(0, c, dim, xi);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Values of the fields: v [nfield][dim]; from (or NULL) = x less the place where they are taken */
static PetscErrorCode evaluate(Remap r, const Answer *answer, PetscInt nfield, const PetscReal *const field[],
                               const PetscReal x[], PetscReal from[], PetscReal v[])
{
  const PetscInt *node = r->loc->cell_node + answer->cell * r->loc->nb, dim = r->loc->dim, nb = r->loc->nb;
  PetscReal       xc[3 * MESH_MAX_NB], y[3], J[9], phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB], det, dxi[3];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(r->mesh, answer->cell, xc));
  det = map_cell(dim, xc, answer->xi, y, J);
  for (PetscInt a = 0; a < dim && from; a++) from[a] = DomainNearest(r->loc->period[a], x[a] - y[a], 0);
  solve_map(dim, J, det, answer->offset, dxi);
  ElementBasis(dim, answer->xi, phi, dphi);
  for (PetscInt j = 0; j < nb; j++)
    for (PetscInt e = 0; e < dim; e++) phi[j] += dxi[e] * dphi[e * nb + j];
  MeshCellScatter(r->loc, answer->cell, 1, phi);
  for (PetscInt f = 0; f < nfield; f++) {
    for (PetscInt a = 0; a < dim; a++) {
      v[dim * f + a] = 0;
      for (PetscInt j = 0; j < nb; j++) v[dim * f + a] += phi[j] * field[f][dim * node[j] + a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal RemapCellSize(Remap r, PetscInt i)
{
  const MeshLocal *l       = r->loc;
  const PetscInt   step[3] = {1, 3, 9}, mid = l->nb / 2;
  PetscReal        size = 0;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
    const PetscInt *node = l->cell_node + l->node_cell[e] * l->nb;

    for (PetscInt a = 0; a < l->dim; a++) {
      for (PetscInt j = 0; j < l->dim; j++) { /* along the directions of the lattice */
        PetscReal d = PetscAbsReal(l->x_start[l->dim * node[mid + step[j]] + a] -
                                   l->x_start[l->dim * node[mid - step[j]] + a]);

        if (l->period[a] > 0) d = PetscMin(d, l->period[a] - d);
        size = PetscMax(size, d);
      }
    }
  }
  return size;
}

/* ---- other ranks ---- */

/* A place that no cell of the rank which asks contains; which: its number there */
typedef struct {
  PetscReal x[3], size, side, which, part;
} Question;

#define REPLY 2 /* numbers before the values of a reply: key, which */

/* Where values are wanted, and of which fields */
typedef struct {
  PetscInt                n;
  const PetscInt         *nodes, *side; /* [n] where to look first (NULL: nodes of another mesh); see remap.h */
  const PetscReal        *x, *size;     /* [n][dim], [n] of the cells there */
  RemapCells              cells;
  const PetscReal        *way, *part; /* see RemapEvaluateFeet, or NULL */
  PetscInt                nfield;
  const PetscReal *const *field;
} Wanted;

/* The mesh where place e is looked for */
static Moved moved_for(const Wanted *w, PetscReal part)
{
  return (Moved){w->way, part};
}

/* Of a place x: with a way what it comes by, then the fields */
static PetscErrorCode take_values(Remap r, const Wanted *w, const Answer *answer, const PetscReal x[], PetscReal v[])
{
  PetscReal *from = w->way ? v : NULL;

  PetscFunctionBeginUser;
  PetscCall(evaluate(r, answer, w->nfield, w->field, x, from, from ? v + r->loc->dim : v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Questions [*n], by the ranks to [*n] that they go to: those that may have cells in the patch around a place */
static PetscErrorCode list_questions(Remap r, const Wanted *w, PetscInt nopen, const PetscInt open[], PetscInt *n,
                                     PetscMPIInt **to, Question **question)
{
  const PetscInt dim = r->loc->dim;
  PetscInt      *which;
  PetscReal(*y)[3], *reach;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(nopen, &y, nopen, &reach));
  for (PetscInt e = 0; e < nopen; e++) {
    PetscCall(PetscArraycpy(y[e], w->x + dim * open[e], dim));
    reach[e] = PetscSqrtReal((PetscReal)dim) * (3 * w->size[open[e]] + r->pad);
  }
  PetscCall(RankBoxesSend(r->regions, nopen, (const PetscReal(*)[3])y, reach, n, to, &which));
  PetscCall(PetscMalloc1(*n, question));
  for (PetscInt i = 0; i < *n; i++) {
    const PetscInt e = which[i], at = open[e];

    (*question)[i] = (Question){.x     = {y[e][0], y[e][1], y[e][2]},
                                .size  = w->size[at],
                                .side  = w->side ? (PetscReal)w->side[at] : 0,
                                .which = (PetscReal)e,
                                .part  = w->part ? w->part[at] : 0};
  }
  PetscCall(PetscFree2(y, reach));
  PetscCall(PetscFree(which));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Numbers that a place gets */
static PetscInt width_of(Remap r, const Wanted *w)
{
  return (w->nfield + (w->way ? 1 : 0)) * r->loc->dim;
}

/* Answers of own cells: reply [n][REPLY + width_of] */
static PetscErrorCode answer_questions(Remap r, const Wanted *w, PetscInt n, const Question question[],
                                       PetscReal reply[])
{
  const PetscInt width = REPLY + width_of(r, w);

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) {
    PetscReal *to = reply + width * i;
    Answer     answer;

    PetscCall(find_answer(r, moved_for(w, question[i].part), question[i].x, question[i].size,
                          (PetscInt)question[i].side, w->cells, PETSC_TRUE, &answer));
    PetscCall(PetscArrayzero(to, width));
    to[0] = answer.key;
    to[1] = question[i].which;
    if (answer.key < 3000) PetscCall(take_values(r, w, &answer, question[i].x, to + REPLY));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void count_answer(PetscReal key, RemapCount *count)
{
  if (key >= 3000) count->kept++;
  else if (key >= 2000) count->taylor++;
  else if (key > 0) count->extended++;
  else count->inside++;
}

/* Positions that no local cell contains: open [nopen] of them. The answers of all ranks near by compete, of equal
   ones that of the lowest rank. */
static PetscErrorCode ask_near(Remap r, const Wanted *w, PetscInt nopen, const PetscInt open[], PetscReal out[],
                               RemapCount *count)
{
  const PetscInt bs = width_of(r, w), width = REPLY + bs;
  PetscInt       n = 0, nask, nreply;
  PetscMPIInt   *to, *from, *who, *best;
  PetscReal     *key, *reply, *in;
  Question      *question, *asked;

  PetscFunctionBeginUser;
  PetscCall(list_questions(r, w, nopen, open, &n, &to, &question));
  PetscCall(SparseExchange(r->comm, r->tag, n, to, sizeof(*question), question, &nask, &asked, &from));
  PetscCall(PetscMalloc1(nask * width, &reply));
  PetscCall(answer_questions(r, w, nask, asked, reply));
  PetscCall(SparseExchange(r->comm, r->tag, nask, from, width * sizeof(*reply), reply, &nreply, &in, &who));
  PetscCall(PetscMalloc2(nopen, &key, nopen, &best));
  for (PetscInt e = 0; e < nopen; e++) key[e] = 3000;
  for (PetscInt i = 0; i < nreply; i++) {
    const PetscReal *got = in + width * i;
    const PetscInt   e   = (PetscInt)got[1];

    if (got[0] > key[e] || got[0] >= 3000 || (got[0] == key[e] && who[i] >= best[e])) continue;
    key[e]  = got[0];
    best[e] = who[i];
    PetscCall(PetscArraycpy(out + open[e] * bs, got + REPLY, bs));
  }
  for (PetscInt e = 0; e < nopen; e++) count_answer(key[e], count);
  PetscCall(PetscFree2(key, best));
  PetscCall(PetscFree(reply));
  PetscCall(PetscFree(in));
  PetscCall(PetscFree(who));
  PetscCall(PetscFree(asked));
  PetscCall(PetscFree(from));
  PetscCall(PetscFree(question));
  PetscCall(PetscFree(to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode evaluate_all(Remap r, const Wanted *w, PetscReal out[], RemapCount *count)
{
  const PetscInt dim = r->loc->dim;
  PetscInt      *open, nopen = 0;

  PetscFunctionBeginUser;
  *count = (RemapCount){0, 0, 0, 0};
  PetscCall(PetscMalloc1(w->n, &open));
  for (PetscInt e = 0; e < w->n; e++) {
    const PetscReal *x     = w->x + dim * e;
    const PetscInt   side  = w->side ? w->side[e] : 0;
    const Moved      moved = moved_for(w, w->part ? w->part[e] : 0);
    Answer           best  = {.key = 3000};

    if (w->nodes) PetscCall(try_around(r, moved, w->nodes[e], x, side, w->cells, &best));
    if (best.key > 0) PetscCall(find_answer(r, moved, x, w->size[e], side, w->cells, PETSC_FALSE, &best));
    if (best.key == 0) PetscCall(take_values(r, w, &best, x, out + width_of(r, w) * e));
    else open[nopen++] = e;
  }
  count->inside = w->n - nopen;
  PetscCall(ask_near(r, w, nopen, open, out, count));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, count, 4, MPIU_INT, MPI_SUM, r->comm));
  PetscCall(PetscFree(open));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode RemapCreate(Mesh mesh, Remap *remap)
{
  MPI_Comm comm;
  Remap    r;

  PetscFunctionBeginUser;
  PetscCall(MeshGetComm(mesh, &comm));
  PetscCall(PetscNew(&r));
  r->mesh = mesh;
  PetscCall(MeshGetLocal(mesh, &r->loc));
  PetscCall(PetscCommDuplicate(comm, &r->comm, &r->tag));
  PetscCall(MeshCreateRankBoxes(mesh, 1, &r->regions, &r->pad));
  *remap = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RemapDestroy(Remap *remap)
{
  PetscFunctionBeginUser;
  if (!*remap) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(RankBoxesDestroy(&(*remap)->regions));
  PetscCall(PetscCommDestroy(&(*remap)->comm));
  PetscCall(PetscFree(*remap));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RemapEvaluate(Remap r, PetscInt n, const PetscInt nodes[], const PetscReal x[], const PetscInt side[],
                             RemapCells cells, PetscInt nfield, const PetscReal *const field[], PetscReal out[],
                             RemapCount *count)
{
  const PetscInt dim = r->loc->dim;
  PetscReal     *size;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &size));
  for (PetscInt e = 0; e < n; e++) {
    size[e] = RemapCellSize(r, nodes[e]);
    for (PetscInt f = 0; f < nfield; f++)
      for (PetscInt a = 0; a < dim; a++) out[(e * nfield + f) * dim + a] = field[f][dim * nodes[e] + a];
  }
  PetscCall(evaluate_all(r, &(Wanted){n, nodes, side, x, size, cells, NULL, NULL, nfield, field}, out, count));
  PetscCall(PetscFree(size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RemapEvaluateFeet(Remap r, PetscInt n, const PetscInt nodes[], const PetscReal x[],
                                 const PetscReal way[], const PetscReal part[], PetscInt nfield,
                                 const PetscReal *const field[], PetscReal out[])
{
  const PetscInt dim = r->loc->dim, width = dim * (1 + nfield);
  PetscReal     *size;
  RemapCount     count;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &size));
  for (PetscInt e = 0; e < n; e++) {
    size[e] = RemapCellSize(r, nodes[e]);
    for (PetscInt a = 0; a < dim; a++) {
      out[e * width + a] = DomainNearest(r->loc->period[a], x[dim * e + a] - r->loc->x[dim * nodes[e] + a], 0);
      for (PetscInt f = 0; f < nfield; f++) out[e * width + dim * (1 + f) + a] = field[f][dim * nodes[e] + a];
    }
  }
  PetscCall(evaluate_all(r,
                         &(Wanted){.n      = n,
                                   .nodes  = nodes,
                                   .x      = x,
                                   .size   = size,
                                   .way    = way,
                                   .part   = part,
                                   .nfield = nfield,
                                   .field  = field},
                         out, &count));
  PetscCall(PetscFree(size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RemapEvaluateAt(Remap r, PetscInt n, const PetscReal x[], const PetscReal size[], const PetscInt side[],
                               RemapCells cells, PetscInt nfield, const PetscReal *const field[], PetscReal out[],
                               RemapCount *count)
{
  PetscFunctionBeginUser;
  PetscCall(evaluate_all(r, &(Wanted){n, NULL, side, x, size, cells, NULL, NULL, nfield, field}, out, count));
  PetscFunctionReturn(PETSC_SUCCESS);
}
