/* Couple: start values of a step around bodies that move (a participant).

   Hardly any equation knows the pressure of a cell inside a body, and a solve leaves it wrong, by more in every
   step. As the body moves on, such cells come out at its rear and hand that pressure to the fluid. So these cells
   begin with the mean of the fluid beside them, a layer of cells at a time. And what is around a body goes with it:
   pressures, in full out to a cell from the surface and fading within a radius, and velocities close to the surface,
   with the change of the body's own. Extrapolated in time at one place these would slip at cells that the surface
   has come to. Only start values depend on this, which then lie so near that one iteration may do
   (runs/studies/flow-solver, "One iteration").

   Cells of other ranks are known in one layer: a body that goes farther than that in a step takes the value of the
   nearest known cell there. Where the mesh follows bodies itself (-mesh_deform) fields go along anyway; where a method
   moves nodes onto bodies, cells inside are no part of the fluid, and velocities meet the surface. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/array.h"
#include "bodies/local.h"
#include "fem/element.h"

#define DEPTH  0.5 /* cells that a centre is inside of a body whose pressure is not believed */
#define LAYERS 4   /* of such cells; a body does not go farther in a step */
#define NEAR   1.0 /* cells from the surface within which velocities go along, and where none does any more */
#define FAR    1.5
#define MAX_XI 1.2 /* reference coordinates at which a cell is asked for velocities */
#define BOX    1e-6
#define CHUNK  256

/* A cell near a body, and the place that it was at before, seen from the body */
typedef struct {
  PetscInt  cell, body;
  PetscReal weight, position[3];
} Rider;

typedef struct {
  Couple           c;
  const MeshLocal *l;
  const PetscReal *h;
  PetscInt         nk;
  PetscBool        many;                  /* ranks */
  PetscReal       *p, *field;             /* [ncell_all][nk]; for exchange [nnode_all][nk + 1], NULL on one rank */
  PetscInt        *open, nlist, *list;    /* [ncell_all] of such a cell not yet filled; own ones of them */
  PetscReal       *mean;                  /* [nlist] */
  PetscInt         nrider, capacity, *at; /* at [ncell]: rider of a cell, or -1 */
  Rider           *rider;
  PetscReal       *u, *best;        /* start velocity; [nnode] largest weight so far */
  const PetscReal *before;          /* velocity of the last step */
  PetscReal        Q[9], change[6]; /* of the body visited: how its vectors turn back; of its rigid velocity */
} Start;

static inline const PetscReal *centre_of(const MeshLocal *l, PetscInt e)
{
  return l->x + l->cell_node[e * l->nb + l->nb / 2] * l->dim;
}

/* Does body k go somewhere in this step? */
static PetscBool goes(Couple c, PetscInt k)
{
  PetscBool moved = PETSC_FALSE;

  if (c->s->removed[k] || BodiesGetGroup(c->s, k)->body_fitted) return PETSC_FALSE;
  for (PetscInt a = 0; a < 3; a++) moved = (PetscBool)(moved || c->rigid.X[k][a] != c->s->x[k][a]);
  for (PetscInt a = 0; a < 4 && BodiesGetDisc(c->s, k) == 0; a++)
    moved = (PetscBool)(moved || c->rigid.q[k][a] != c->s->q[k][a]);
  return moved;
}

/* How the vectors of body k turn back to where it was: Q [3][3]; round ones do not turn the flow around them */
static void turn_back(Couple c, PetscInt k, PetscReal Q[9])
{
  PetscReal now[9], old[9];

  RotationMatrix(c->rigid.q[k], now);
  RotationMatrix(c->s->q[k], old);
  for (PetscInt i = 0; i < 9; i++)
    Q[i] = BodiesGetDisc(c->s, k) > 0 ? i % 4 == 0 : dot3(old + i / 3 * 3, now + i % 3 * 3);
}

/* Where local node i was, seen from body k, whose image is shifted */
static void find_position(const Start *s, PetscInt k, PetscInt i, const PetscReal shift[3], PetscReal position[3])
{
  const PetscInt dim    = s->l->dim;
  PetscReal      arm[3] = {0, 0, 0};

  for (PetscInt a = 0; a < dim; a++) arm[a] = s->l->x[i * dim + a] - s->c->rigid.X[k][a] - shift[a];
  for (PetscInt a = 0; a < dim; a++) position[a] = s->c->s->x[k][a] + shift[a] + dot3(s->Q + 3 * a, arm);
}

/* Calls visit for the nodes within `reach` of body k drawn at X, q, middles of cells alone or all, with their distance
   d and the shift of the body's image */
typedef PetscErrorCode (*Visit)(Start *, PetscInt k, PetscInt node, PetscReal d, const PetscReal shift[3]);

static PetscErrorCode visit_nodes(Start *s, PetscInt k, PetscBool now, PetscReal reach, PetscBool middles, Visit visit)
{
  const MeshLocal *l = s->l;
  const PetscReal *X = now ? s->c->rigid.X[k] : s->c->s->x[k], *q = now ? s->c->rigid.q[k] : s->c->s->q[k];
  const PetscReal  half = BodiesGetRadius(s->c->s, k) + reach + (l->x != l->x_start ? 2 * l->h : 0);
  PetscReal        x[CHUNK * 3], d[CHUNK];
  PetscInt         wanted[CHUNK], n, size = 0;
  const PetscInt  *node;

  PetscFunctionBeginUser;
  for (DomainImages i = {0}; MeshNextImage(l, X, half, &i);) {
    PetscCall(MeshNodesInBox(s->c->mesh, i.at, half, &n, &node));
    for (PetscInt e = 0; e < n; e++) {
      if (!middles || l->centre_cell[node[e]] >= 0) {
        wanted[size] = node[e];
        PetscCall(PetscArraycpy(x + size++ * l->dim, l->x + node[e] * l->dim, l->dim));
      }
      if (size < CHUNK && e < n - 1) continue;
      PetscCall(BodiesDistance(s->c->bodies, k, i.at, q, size, x, d));
      for (PetscInt j = 0; j < size; j++) PetscCall((*visit)(s, k, wanted[j], d[j], i.shift));
      size = 0;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- cells that were inside ---- */

static PetscErrorCode open_cell(Start *s, PetscInt k, PetscInt node, PetscReal d, const PetscReal shift[3])
{
  const PetscInt e = s->l->centre_cell[node];

  PetscFunctionBeginUser;
  (void)k;
  (void)shift;
  if (d >= -DEPTH * s->h[e] || s->open[e]) PetscFunctionReturn(PETSC_SUCCESS);
  s->open[e] = 1;
  if (e < s->l->ncell) s->list[s->nlist++] = e;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Pressures and marks of ghost cells from their owners, by the node in the middle of a cell. Collective. */
static PetscErrorCode sync_cells(Start *s)
{
  const MeshLocal *l = s->l;
  const PetscInt   n = s->nk + 1;

  PetscFunctionBeginUser;
  if (!s->many) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < l->ncell; e++) {
    PetscReal *v = s->field + l->cell_node[e * l->nb + l->nb / 2] * n;

    PetscCall(PetscArraycpy(v, s->p + e * s->nk, s->nk));
    v[s->nk] = (PetscReal)s->open[e];
  }
  PetscCall(MeshSyncNodes(s->c->mesh, n, s->field));
  for (PetscInt e = l->ncell; e < l->ncell_all; e++) {
    const PetscReal *v = s->field + l->cell_node[e * l->nb + l->nb / 2] * n;

    PetscCall(PetscArraycpy(s->p + e * s->nk, v, s->nk));
    s->open[e] = v[s->nk] > 0.5;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The mean pressure of the cells around cell e that are not open: those that share more nodes count more */
static PetscBool take_mean(const Start *s, PetscInt e, PetscReal *mean)
{
  const MeshLocal *l     = s->l;
  PetscReal        sum   = 0;
  PetscInt         count = 0;

  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscInt i = l->cell_node[e * l->nb + j];

    for (PetscInt m = l->node_cell_ptr[i]; m < l->node_cell_ptr[i + 1]; m++) {
      if (s->open[l->node_cell[m]]) continue;
      sum += s->p[l->node_cell[m] * s->nk];
      count++;
    }
  }
  *mean = count ? sum / (PetscReal)count : 0;
  return (PetscBool)(count > 0);
}

/* One layer of the open cells in the list, which leave it */
static PetscErrorCode fill_layer(Start *s)
{
  PetscInt n = 0, left = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->nlist; i++) { /* those with a mean go to the front */
    const PetscInt e = s->list[i];

    if (!take_mean(s, e, s->mean + n)) continue;
    s->list[i]   = s->list[n];
    s->list[n++] = e;
  }
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt e = s->list[i];

    PetscCall(PetscArrayzero(s->p + e * s->nk, s->nk));
    s->p[e * s->nk] = s->mean[i];
    s->open[e]      = 0;
  }
  for (PetscInt i = n; i < s->nlist; i++) s->list[left++] = s->list[i];
  s->nlist = left;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode fill(Start *s, PetscReal dp[])
{
  Couple c = s->c;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++)
    if (goes(c, k)) PetscCall(visit_nodes(s, k, PETSC_FALSE, 0, PETSC_TRUE, open_cell));
  for (PetscInt i = 0; i < s->nlist; i++) PetscCall(PetscArrayzero(dp + s->list[i] * s->nk, s->nk));
  PetscCall(sync_cells(s));
  PetscCall(PetscMalloc1(s->nlist, &s->mean));
  for (PetscInt layer = 0; layer < LAYERS; layer++) {
    PetscCall(fill_layer(s));
    PetscCall(sync_cells(s));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the cell at a place ---- */

/* How far place y is from the middle of cell e, 1: on its edge */
static PetscReal measure(const Start *s, PetscInt e, const PetscReal y[])
{
  const MeshLocal *l    = s->l;
  const PetscInt  *node = l->cell_node + e * l->nb;
  const PetscReal *x = centre_of(l, e), *a = l->x + node[0] * l->dim, *b = l->x + node[l->nb - 1] * l->dim;
  PetscReal        max = 0;

  for (PetscInt d = 0; d < l->dim; d++) {
    const PetscReal extent = PetscAbsReal(MeshNearest(l, d, b[d] - a[d])),
                    side   = MeshCellHang(l, e) || extent < 0.3 * s->h[e] ? s->h[e] : extent;

    max = PetscMax(max, 2 * PetscAbsReal(MeshNearest(l, d, y[d] - x[d])) / side);
  }
  return max;
}

/* Node in the slot at corner v of cell e */
static inline PetscInt corner_of(const MeshLocal *l, PetscInt e, PetscInt v)
{
  return l->cell_node[e * l->nb + 2 * (v & 1) + 6 * ((v >> 1) & 1) + 18 * (v >> 2)];
}

/* The node among the corners of cell e that is nearest to y */
static PetscInt nearest_corner(const MeshLocal *l, PetscInt e, const PetscReal y[])
{
  PetscReal best = PETSC_MAX_REAL;
  PetscInt  node = -1;

  for (PetscInt v = 0; v < (1 << l->dim); v++) {
    const PetscInt i = corner_of(l, e, v);
    PetscReal      r = 0;

    for (PetscInt d = 0; d < l->dim; d++) r += PetscSqr(MeshNearest(l, d, y[d] - l->x[i * l->dim + d]));
    if (r < best) node = i;
    best = PetscMin(best, r);
  }
  return node;
}

/* The cell, known here, that place y is in or nearest to, from a cell close to it: across the corner nearest to y,
   again and again */
static PetscInt find_cell(const Start *s, PetscInt e, const PetscReal y[])
{
  const MeshLocal *l    = s->l;
  PetscReal        max  = measure(s, e, y);
  PetscInt         last = -1;

  while (max > 1 + 1e-9 && last != e) {
    const PetscInt i = nearest_corner(l, e, y);

    last = e;
    for (PetscInt m = l->node_cell_ptr[i]; m < l->node_cell_ptr[i + 1]; m++) {
      const PetscReal there = l->node_cell[m] == last ? max : measure(s, l->node_cell[m], y);

      if (there < max) e = l->node_cell[m];
      max = PetscMin(max, there);
    }
  }
  return e;
}

/* Reference coordinates of y in cell e, by the middle where the cell is a box along the axes */
static PetscErrorCode locate(const Start *s, PetscInt e, const PetscReal y[], PetscReal xi[3], PetscBool *found)
{
  const MeshLocal *l = s->l;
  const PetscReal *x = centre_of(l, e), *a = l->x + corner_of(l, e, 0) * l->dim;
  PetscBool        box = (PetscBool)!MeshCellHang(l, e);
  PetscReal        xc[MESH_MAX_NB * 3], at[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  *found = PETSC_TRUE;
  for (PetscInt axis = 0; axis < l->dim && box; axis++) {
    const PetscReal *b = l->x + corner_of(l, e, 1 << axis) * l->dim;

    for (PetscInt d = 0; d < l->dim && box; d++) {
      const PetscReal side = MeshNearest(l, d, b[d] - a[d]);

      if (d == axis) {
        xi[d] = 2 * MeshNearest(l, d, y[d] - x[d]) / side;
        box   = (PetscBool)(side > 0 && PetscAbsReal(MeshNearest(l, d, x[d] - a[d]) - 0.5 * side) < BOX * side);
      } else box = (PetscBool)(PetscAbsReal(side) < BOX * s->h[e]);
    }
  }
  if (box) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MeshCellCoordinates(s->c->mesh, e, xc));
  for (PetscInt d = 0; d < l->dim; d++) at[d] = xc[l->nb / 2 * l->dim + d] + MeshNearest(l, d, y[d] - x[d]);
  *found = ElementLocate(l->dim, xc, at, xi);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what goes with a body ---- */

static PetscErrorCode mount(Start *s, PetscInt k, PetscInt node, PetscReal d, const PetscReal shift[3])
{
  const PetscInt  e    = s->l->centre_cell[node];
  const PetscReal fade = PetscMax(BodiesGetRadius(s->c->s, k), s->h[e]), weight = PetscMin(1, 1 - (d - s->h[e]) / fade);
  Rider          *r;

  PetscFunctionBeginUser;
  if (e >= s->l->ncell || weight <= 0 || (s->at[e] >= 0 && s->rider[s->at[e]].weight >= weight))
    PetscFunctionReturn(PETSC_SUCCESS);
  if (s->at[e] < 0) {
    PetscCall(ArrayReserve(s->nrider + 1, &s->capacity, &s->rider, sizeof(*s->rider), NULL));
    s->at[e] = s->nrider++;
  }
  r  = s->rider + s->at[e];
  *r = (Rider){e, k, weight, {0, 0, 0}};
  find_position(s, k, node, shift, r->position);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocity of own node i: that of where it was, seen from body k, and what the body's own changes by */
static PetscErrorCode carry_node(Start *s, PetscInt k, PetscInt i, PetscReal d, const PetscReal shift[3])
{
  const MeshLocal *l   = s->l;
  const PetscInt   dim = l->dim, nr = s->c->nr;
  const PetscReal  weight = PetscMin(1, 1 - (d / l->h - NEAR) / (FAR - NEAR));
  PetscReal        position[3], P[3], xi[3], phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB], v[MESH_MAX_NB * 3], R[18],
    out[3] = {0, 0, 0};
  PetscInt  e;
  PetscBool found;

  PetscFunctionBeginUser;
  if (i >= l->nnode || d < -FAR * l->h || weight <= s->best[i]) PetscFunctionReturn(PETSC_SUCCESS);
  find_position(s, k, i, shift, position);
  e = find_cell(s, l->node_cell[l->node_cell_ptr[i]], position);
  PetscCall(locate(s, e, position, xi, &found));
  for (PetscInt a = 0; a < dim; a++) found = (PetscBool)(found && PetscAbsReal(xi[a]) <= MAX_XI);
  if (!found) PetscFunctionReturn(PETSC_SUCCESS); /* of a rank farther away, or no cell at all */
  ElementBasis(dim, xi, phi, dphi);
  for (PetscInt j = 0; j < l->nb; j++)
    PetscCall(PetscArraycpy(v + j * dim, s->before + l->cell_node[e * l->nb + j] * dim, dim));
  MeshCellGather(l, e, dim, v);
  for (PetscInt j = 0; j < l->nb; j++)
    for (PetscInt a = 0; a < dim; a++) out[a] += phi[j] * v[j * dim + a];
  for (PetscInt a = 0; a < 3; a++) P[a] = s->c->rigid.P[k][a] + shift[a];
  ConstraintRigidAt(l, i, P, R);
  for (PetscInt a = 0; a < dim; a++) {
    for (PetscInt m = 0; m < nr; m++) out[a] += R[a * nr + m] * s->change[m];
    s->u[i * dim + a] += (weight - s->best[i]) / (1 - s->best[i]) * (out[a] - s->u[i * dim + a]);
  }
  s->best[i] = weight;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_out(Start *s, PetscInt k)
{
  PetscReal now, old;

  PetscFunctionBeginUser;
  turn_back(s->c, k, s->Q);
  for (PetscInt m = 0; m < s->c->nr; m++) {
    CoupleGetHistory(s->c, k, m, &now, &old);
    s->change[m] = s->c->rigid.U[k * s->c->nr + m] - now;
  }
  PetscCall(
    visit_nodes(s, k, PETSC_TRUE, PetscMax(BodiesGetRadius(s->c->s, k), s->l->h) + 2 * s->l->h, PETSC_TRUE, mount));
  if (!s->c->method.table->moves_nodes)
    PetscCall(visit_nodes(s, k, PETSC_TRUE, FAR * s->l->h, PETSC_FALSE, carry_node));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ride(Start *s, PetscReal p[], PetscReal dp[])
{
  const MeshLocal *l    = s->l;
  PetscInt         body = -1;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->c->s->n; k++)
    if (goes(s->c, k)) PetscCall(set_out(s, k));
  for (PetscInt i = 0; i < s->nrider; i++) {
    const Rider     *r = s->rider + i;
    const PetscInt   e = r->cell, o = find_cell(s, e, r->position);
    const PetscReal *x = centre_of(l, o), *was = s->p + o * s->nk;
    PetscReal        slope[3] = {0, 0, 0}, now[4] = {was[0]};

    for (PetscInt a = 0; a < l->dim; a++) {
      slope[a] = was[1 + a] / s->h[o];
      now[0] += slope[a] * MeshNearest(l, a, r->position[a] - x[a]);
    }
    if (body != r->body) turn_back(s->c, r->body, s->Q);
    body = r->body;
    for (PetscInt a = 0; a < l->dim; a++)
      now[1 + a] = s->h[e] * (s->Q[a] * slope[0] + s->Q[3 + a] * slope[1] + s->Q[6 + a] * slope[2]);
    for (PetscInt a = 0; a < s->nk; a++) {
      p[e * s->nk + a] += r->weight * (now[a] - s->p[e * s->nk + a]);
      dp[e * s->nk + a] *= 1 - r->weight;
    }
  }
  if (!s->c->method.table->moves_nodes) PetscCall(MeshSyncNodes(s->c->mesh, l->dim, s->u));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* u, p, dp of FlowExtrapolate become start values that go with the bodies, dp counts less where p does. Nothing happens
   where no body moves. */
static PetscErrorCode set_start_values(Couple c, void *data)
{
  const MeshLocal *l = c->loc;
  PetscReal       *p = c->field.p, *dp = c->field.dp, *before;
  Start            s = {.c = c, .l = l, .nk = l->dim + 1, .u = c->field.u};
  PetscMPIInt      size;
  PetscBool        any = PETSC_FALSE;

  PetscFunctionBeginUser;
  (void)data;
  for (PetscInt k = 0; k < c->s->n && !c->ale; k++) any = (PetscBool)(any || goes(c, k));
  PetscCall(BodiesAny(c->bodies, &any));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallMPI(MPI_Comm_size(c->comm, &size));
  s.many = (PetscBool)(size > 1);
  PetscCall(FlowGetCellSize(c->flow, &s.h));
  PetscCall(FlowGetFields(c->flow, &before, NULL, NULL));
  s.before = before;
  PetscCall(PetscCalloc3(l->ncell_all * s.nk, &s.p, l->ncell_all, &s.open, l->nnode, &s.best));
  PetscCall(PetscMalloc2(l->ncell, &s.list, l->ncell, &s.at));
  if (s.many) PetscCall(PetscCalloc1(l->nnode_all * (s.nk + 1), &s.field));
  for (PetscInt e = 0; e < l->ncell; e++) s.at[e] = -1;
  PetscCall(PetscArraycpy(s.p, p, l->ncell * s.nk));
  if (!c->method.table->moves_nodes) PetscCall(fill(&s, dp));
  else PetscCall(sync_cells(&s));
  PetscCall(PetscArraycpy(p, s.p, l->ncell * s.nk));
  PetscCall(ride(&s, p, dp));
  PetscCall(PetscFree3(s.p, s.open, s.best));
  PetscCall(PetscFree2(s.list, s.at));
  PetscCall(PetscFree(s.field));
  PetscCall(PetscFree(s.mean));
  PetscCall(PetscFree(s.rider));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant START_VALUES = {.name = "start values", .start = set_start_values};

PetscErrorCode CoupleAddStartValues(Couple c)
{
  PetscFunctionBeginUser;
  if (c->s->nall) PetscCall(CoupleAddParticipant(c, &START_VALUES, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}
