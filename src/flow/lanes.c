/* Lanes: see lanes.h */
#include "compat.h"
#include "lanes.h"
#include "base/inline.h"

/* Edges along the axes: nothing beside the diagonal of the inverse Jacobian but round-off of coordinates, which counts
   as it does where cells are found affine */
static PetscBool is_box(const struct _p_Flow *f, PetscInt c)
{
  const PetscInt   dim     = f->loc->dim;
  const PetscReal *inverse = f->cells.inverse + c * dim * dim;

  if (!f->cells.affine[c]) return PETSC_FALSE;
  for (PetscInt e = 0; e < dim; e++)
    for (PetscInt a = 0; a < dim; a++)
      if (a != e && PetscAbsReal(inverse[e * dim + a]) > 1e-10 * PetscAbsReal(inverse[e * dim + e])) return PETSC_FALSE;
  return PETSC_TRUE;
}

/* Fewer cells of a hanging code than this, when all have been seen, go with those of other codes */
#define FEW (BATCH_LANES / 2)

enum {
  OTHERS,
  BOXES,
  MIXED,
  NOPEN
};

PetscInt LanesMax(const MeshLocal *l)
{
  return l->ncell / BATCH_LANES + NOPEN + (l->hang ? PetscMin(MESH_HANG_CODES, l->ncell / FEW) : 0);
}

/* Cell c to those of its kind; are they complete? */
static PetscBool add_cell(LaneCells *b, PetscInt c)
{
  if (b->n == BATCH_LANES) b->n = 0;
  b->cell[b->n++] = c;
  return (PetscBool)(b->n == BATCH_LANES);
}

/* Where a cell waits for others of its kind */
static LaneCells *find_open(const MeshLocal *l, PetscInt c, PetscBool box, LaneWalk *walk)
{
  const MeshHang *h = MeshCellHang(l, c);
  LaneCells      *b = &walk->open[box ? BOXES : OTHERS];

  if (h && box) b = &walk->hanging[h->code];
  b->box   = box;
  b->mixed = (PetscBool)!box;
  b->hang  = box ? h : NULL;
  return b;
}

/* The next of those that are not complete */
static PetscBool take_incomplete(LaneWalk *walk, LaneCells *next)
{
  LaneCells *mixed = &walk->open[MIXED];

  mixed->box = mixed->mixed = PETSC_TRUE;
  for (; walk->code < MESH_HANG_CODES; walk->code++) {
    LaneCells *b = &walk->hanging[walk->code];

    if (b->n == BATCH_LANES) continue;
    if (b->n >= FEW) {
      *next = *b;
      walk->code++;
      return PETSC_TRUE;
    }
    while (b->n > 0)
      if (add_cell(mixed, b->cell[--b->n])) {
        *next = *mixed;
        return PETSC_TRUE;
      }
  }
  for (PetscInt k = 0; k < NOPEN; k++) {
    LaneCells *b = &walk->open[k];

    if (b->n > 0 && b->n < BATCH_LANES) {
      *next = *b;
      b->n  = 0;
      return PETSC_TRUE;
    }
  }
  return PETSC_FALSE;
}

PetscBool LanesNext(const struct _p_Flow *f, LaneWalk *walk, LaneCells *next)
{
  next->n = 0;
  while (walk->at < f->loc->ncell) {
    const PetscInt c = walk->at++;
    LaneCells     *b;

    if (FlowIsInactive(f, c)) continue;
    b = find_open(f->loc, c, is_box(f, c), walk);
    if (!add_cell(b, c)) continue;
    *next = *b;
    return PETSC_TRUE;
  }
  return take_incomplete(walk, next);
}

void LanesTake(const struct _p_Flow *f, PetscInt n, const PetscInt cells[], LaneCells *b)
{
  b->n   = n;
  b->box = b->mixed = PETSC_TRUE;
  b->hang           = NULL;
  for (PetscInt k = 0; k < n; k++) {
    b->cell[k] = cells[k];
    b->box     = (PetscBool)(b->box && is_box(f, cells[k]));
  }
}

PetscErrorCode LanesGeometry(const struct _p_Flow *f, const LaneCells *b, BatchGeometry *g)
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < BATCH_LANES; k++) {
    const PetscInt c = b->cell[k < b->n ? k : 0];
    PetscReal      x[MESH_MAX_NB * 3];

    if (b->box) {
      *Lane(&g->det, k) = f->cells.det[c];
      for (PetscInt e = 0; e < dim; e++) *Lane(&g->inverse[e], k) = f->cells.inverse[(c * dim + e) * dim + e];
    } else {
      PetscCall(MeshCellCoordinates(f->mesh, c, x));
      for (PetscInt i = 0; i < l->nb * dim; i++) *Lane(&g->xc[i], k) = x[i];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

_Static_assert(BATCH_LANES == 8, "what load() lists");

/* The numbers at[k] of v side by side: eight loads and one store, not eight of both */
INLINE Lanes load(const PetscReal *v, const PetscInt at[])
{
  return (Lanes){v[at[0]], v[at[1]], v[at[2]], v[at[3]], v[at[4]], v[at[5]], v[at[6]], v[at[7]]};
}

/* x = (add: +=) factor times nodal values of cells without anything that hangs; dimensions as constants */
INLINE void gather_cells(const int dim, const int nb, const PetscBool add, const PetscInt *const node[],
                         const PetscReal factor, const PetscReal v[], Lanes x[])
{
  for (int j = 0; j < nb; j++) {
    PetscInt at[BATCH_LANES];

    for (int k = 0; k < BATCH_LANES; k++) at[k] = node[k][j] * dim;
    for (int a = 0; a < dim; a++)
      x[j * dim + a] = add ? x[j * dim + a] + factor * load(v + a, at) : factor * load(v + a, at);
  }
}

static void gather_hanging(const MeshLocal *l, PetscInt c, PetscInt n, const PetscReal *const v[],
                           const PetscReal factor[], PetscReal to[])
{
  const PetscInt size = l->nb * l->dim, *node = l->cell_node + c * l->nb;
  PetscReal      xl[MESH_MAX_NB * 3];

  for (PetscInt i = 0; i < size; i++) {
    xl[i] = 0;
    for (PetscInt m = 0; m < n; m++) xl[i] += factor[m] * v[m][node[i / l->dim] * l->dim + i % l->dim];
  }
  MeshCellGather(l, c, l->dim, xl);
  for (PetscInt i = 0; i < size; i++) to[i * BATCH_LANES] = xl[i];
}

/* MeshHangGather and MeshHangScatter of cells side by side in which the same hangs */
INLINE void hang_gather(const int dim, const MeshHang *h, Lanes v[])
{
  Lanes out[MESH_HANG_SLOTS * 3];

  for (int r = 0; r < h->n; r++) {
    Lanes s[3] = {{0}, {0}, {0}};

    for (int e = h->start[r]; e < h->start[r + 1]; e++)
      for (int a = 0; a < dim; a++) s[a] += h->weight[e] * v[h->from[e] * dim + a];
    for (int a = 0; a < dim; a++) out[r * dim + a] = s[a];
  }
  for (int r = 0; r < h->n; r++)
    for (int a = 0; a < dim; a++) v[h->slot[r] * dim + a] = out[r * dim + a];
}

INLINE void hang_scatter(const int dim, const MeshHang *h, Lanes r[])
{
  Lanes in[MESH_HANG_SLOTS * 3];

  for (int s = 0; s < h->n; s++)
    for (int a = 0; a < dim; a++) {
      in[s * dim + a]         = r[h->slot[s] * dim + a];
      r[h->slot[s] * dim + a] = (Lanes){0};
    }
  for (int s = 0; s < h->n; s++)
    for (int e = h->start[s]; e < h->start[s + 1]; e++)
      for (int a = 0; a < dim; a++) r[h->from[e] * dim + a] += h->weight[e] * in[s * dim + a];
}

void LanesGather(const MeshLocal *l, const LaneCells *b, PetscInt n, const PetscReal *const v[],
                 const PetscReal factor[], Lanes x[])
{
  const PetscInt *node[BATCH_LANES];

  for (PetscInt k = 0; k < BATCH_LANES; k++) node[k] = l->cell_node + b->cell[k < b->n ? k : 0] * l->nb;
  for (PetscInt m = 0; m < n; m++) {
    if (l->dim == 2) gather_cells(2, 9, (PetscBool)(m > 0), node, factor[m], v[m], x);
    else if (m == 0) gather_cells(3, 27, PETSC_FALSE, node, factor[m], v[m], x);
    else gather_cells(3, 27, PETSC_TRUE, node, factor[m], v[m], x);
  }
  if (!b->mixed) {
    if (b->hang && l->dim == 2) hang_gather(2, b->hang, x);
    else if (b->hang) hang_gather(3, b->hang, x);
    return;
  }
  for (PetscInt k = 0; k < BATCH_LANES; k++) {
    const PetscInt c = b->cell[k < b->n ? k : 0];

    if (MeshCellHang(l, c)) gather_hanging(l, c, n, v, factor, Lane(x, k));
  }
}

INLINE void scatter_lane(const int bs, const int nb, const PetscInt *restrict node, const PetscReal *restrict from,
                         PetscReal *restrict v)
{
  for (int j = 0; j < nb; j++)
    for (int a = 0; a < bs; a++) v[node[j] * bs + a] += from[(j * bs + a) * BATCH_LANES];
}

void LanesScatter(const MeshLocal *l, const LaneCells *b, PetscInt bs, Lanes x[], PetscReal v[])
{
  const PetscInt nb = l->nb;

  if (!b->mixed && b->hang) {
    if (bs == 3) hang_scatter(3, b->hang, x);
    else hang_scatter((int)bs, b->hang, x);
  }
  for (PetscInt k = 0; k < b->n; k++) {
    const PetscInt   c = b->cell[k], *node = l->cell_node + c * nb;
    const PetscReal *from = Lane(x, k);
    PetscReal        xl[MESH_MAX_NB * 3];

    if (b->mixed && MeshCellHang(l, c)) {
      for (PetscInt i = 0; i < nb * bs; i++) xl[i] = from[i * BATCH_LANES];
      MeshCellScatter(l, c, bs, xl);
      for (PetscInt i = 0; i < nb * bs; i++) v[node[i / bs] * bs + i % bs] += xl[i];
    } else if (bs == 3) scatter_lane(3, 27, node, from, v);
    else scatter_lane((int)bs, (int)nb, node, from, v);
  }
}

PetscErrorCode LanesMomentum(Flow f, const LaneCells *b, const PetscReal u[], Lanes r[])
{
  const MeshLocal *l   = f->loc;
  const FlowStep  *s   = &f->step;
  const PetscInt   n   = l->nb * l->dim;
  const PetscReal *v[] = {f->u, f->u_old, f->force.source ? f->force.source : u, u}, rho = f->par.density,
                  theta = s->theta;
  BatchForm     mass = {.box = b->box, .a = rho}, motion = {.box = b->box, .b = f->par.matrix, .skew = f->par.skew};
  BatchGeometry g;
  Lanes         x[MESH_MAX_NB * 3], coefficient[1 + 3 + MESH_MAX_NB * (1 + 6 + 4)];
  PetscInt      nv        = 2;
  PetscReal     factor[4] = {-s->d0, -s->d1};

  PetscFunctionBeginUser;
  PetscCall(LanesGeometry(f, b, &g));
  if (f->force.source) factor[nv++] = -1 / rho;
  if (u) {
    v[nv]        = u;
    factor[nv++] = s->ct;
  }
  LanesGather(l, b, nv, v, factor, r);
  for (PetscInt i = 0; i < n; i++) r[i] -= f->par.force[i % l->dim] / rho;
  BatchSet(f->tables, &mass, &g, NULL, NULL, coefficient);
  BatchMultiply(f->tables, &mass, coefficient, r);
  if (!u && theta == 1) PetscFunctionReturn(PETSC_SUCCESS);
  motion.convection = f->par.convection;
  if (motion.convection) LanesGather(l, b, 1, (const PetscReal *[]){f->w}, &rho, x);
  BatchSet(f->tables, &motion, &g, x, NULL, coefficient);
  LanesGather(l, b, u && theta < 1 ? 2 : 1, (const PetscReal *[]){u ? u : f->u, f->u},
              (PetscReal[]){u ? theta : 1 - theta, 1 - theta}, x);
  BatchMultiply(f->tables, &motion, coefficient, x);
  for (PetscInt i = 0; i < n; i++) r[i] += x[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}
