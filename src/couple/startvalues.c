/* Couple: start values of a step around bodies that move (a participant).

   Hardly any equation knows the pressure of a cell inside a body, and a solve leaves it wrong, by more in every
   step. As the body moves on, such cells come out at its rear and hand that pressure to the fluid. So these cells
   begin with the mean of the fluid beside them, a layer of cells at a time. And what is around a body goes with it:
   pressures, in full out to a cell from the surface and fading within a radius, and velocities close to the surface,
   with the change of the body's own. Extrapolated in time at one place these would slip at cells that the surface
   has come to. Only start values depend on this, which then lie so near that one iteration may do
   (runs/studies/flow-solver, "One iteration").

   Cells of other ranks are known in one layer: a body that goes farther in a step takes the value of the nearest known
   cell. Where the mesh follows bodies (-mesh_deform) fields go along anyway; where a method moves nodes onto bodies,
   cells inside are no part of the fluid, and velocities meet the surface. */
#include "compat.h"
#include "impl.h"
#include "nearcell.h"
#include "base/algebra.h"
#include "base/array.h"
#include "bodies/local.h"
#include "fem/element.h"
#include "flow/device.h"

#define DEPTH  0.5 /* cells that a centre is inside of a body whose pressure is not believed */
#define LAYERS 4   /* of such cells; a body does not go farther in a step */
#define NEAR   1.0 /* cells from the surface within which velocities go along, and where none does any more */
#define FAR    1.5
#define MAX_XI 1.2 /* reference coordinates at which a cell is asked for velocities */
#define CHUNK  256

/* A cell near a body, the place that it was at before, seen from the body, and the cell there */
typedef struct {
  PetscInt  cell, body, from;
  PetscReal weight, position[3];
} Rider;

/* A node close to the surface of a body, the cell and the place in it that it was at before, and by how much its
   velocity becomes that of there; P: reference point of the body */
typedef struct {
  PetscInt  node, body, from;
  PetscReal weight, xi[3], P[3];
} Passenger;

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
  PetscInt         npassenger, room;
  Passenger       *passenger;
  PetscReal       *u, *best;        /* start velocity; [nnode] largest weight so far */
  const PetscReal *before;          /* velocity of the last step */
  PetscReal        Q[9], change[6]; /* of the body visited: how its vectors turn back; of its rigid velocity */
} Start;

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
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->nlist; i++) PetscCall(PetscArrayzero(dp + s->list[i] * s->nk, s->nk));
  PetscCall(sync_cells(s));
  PetscCall(PetscMalloc1(s->nlist, &s->mean));
  for (PetscInt layer = 0; layer < LAYERS; layer++) {
    PetscCall(fill_layer(s));
    PetscCall(sync_cells(s));
  }
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
  *r = (Rider){e, k, -1, weight, {0, 0, 0}};
  find_position(s, k, node, shift, r->position);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own node i close to body k, if the cell that it was in is known */
static PetscErrorCode take_node(Start *s, PetscInt k, PetscInt i, PetscReal d, const PetscReal shift[3])
{
  const MeshLocal *l      = s->l;
  const PetscReal  weight = PetscMin(1, 1 - (d / l->h - NEAR) / (FAR - NEAR));
  Passenger        p      = {.node = i, .body = k};
  PetscReal        position[3];
  PetscBool        found;

  PetscFunctionBeginUser;
  if (i >= l->nnode || d < -FAR * l->h || weight <= s->best[i]) PetscFunctionReturn(PETSC_SUCCESS);
  find_position(s, k, i, shift, position);
  p.from = NearCellFind(s->l, s->h, l->node_cell[l->node_cell_ptr[i]], position);
  PetscCall(NearCellLocate(s->c->mesh, l, s->h, p.from, position, p.xi, &found));
  for (PetscInt a = 0; a < l->dim; a++) found = (PetscBool)(found && PetscAbsReal(p.xi[a]) <= MAX_XI);
  if (!found) PetscFunctionReturn(PETSC_SUCCESS); /* of a rank farther away, or no cell at all */
  p.weight = (weight - s->best[i]) / (1 - s->best[i]);
  for (PetscInt a = 0; a < 3; a++) p.P[a] = s->c->rigid.P[k][a] + shift[a];
  PetscCall(ArrayReserve(s->npassenger + 1, &s->room, &s->passenger, sizeof(*s->passenger), NULL));
  s->passenger[s->npassenger++] = p;
  s->best[i]                    = weight;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells and nodes that go with bodies, and cells that were inside of them */
static PetscErrorCode set_out(Start *s)
{
  Couple          c       = s->c;
  const PetscBool aligned = c->method.table->moves_nodes;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal reach = PetscMax(BodiesGetRadius(c->s, k), s->l->h) + 2 * s->l->h;

    if (!goes(c, k)) continue;
    turn_back(c, k, s->Q);
    PetscCall(visit_nodes(s, k, PETSC_TRUE, reach, PETSC_TRUE, mount));
    if (aligned) continue;
    PetscCall(visit_nodes(s, k, PETSC_FALSE, 0, PETSC_TRUE, open_cell));
    PetscCall(visit_nodes(s, k, PETSC_TRUE, FAR * s->l->h, PETSC_FALSE, take_node));
  }
  for (PetscInt i = 0; i < s->nrider; i++)
    s->rider[i].from = NearCellFind(s->l, s->h, s->rider[i].cell, s->rider[i].position);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Its velocity: that of where it was, and what the body's own changes by */
static PetscErrorCode carry(Start *s, const Passenger *p)
{
  const MeshLocal *l   = s->l;
  const PetscInt   dim = l->dim, nr = s->c->nr, i = p->node;
  PetscReal        phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB], v[MESH_MAX_NB * 3], R[18], out[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  ElementBasis(dim, p->xi, phi, dphi);
  MeshCellValues(l, p->from, dim, s->before, v);
  for (PetscInt j = 0; j < l->nb; j++)
    for (PetscInt a = 0; a < dim; a++) out[a] += phi[j] * v[j * dim + a];
  ConstraintRigidAt(l, i, p->P, R);
  for (PetscInt a = 0; a < dim; a++) {
    for (PetscInt m = 0; m < nr; m++) out[a] += R[a * nr + m] * s->change[m];
    s->u[i * dim + a] += p->weight * (out[a] - s->u[i * dim + a]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode carry_all(Start *s)
{
  PetscReal now, old;
  PetscInt  body = -1;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->npassenger; i++) {
    const Passenger *p = s->passenger + i;

    for (PetscInt m = 0; m < s->c->nr && p->body != body; m++) {
      CoupleGetHistory(s->c, p->body, m, &now, &old);
      s->change[m] = s->c->rigid.U[p->body * s->c->nr + m] - now;
    }
    body = p->body;
    PetscCall(carry(s, p));
  }
  if (!s->c->method.table->moves_nodes) PetscCall(MeshSyncNodes(s->c->mesh, s->l->dim, s->u));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ride(Start *s, PetscReal p[], PetscReal dp[])
{
  const MeshLocal *l    = s->l;
  PetscInt         body = -1;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->nrider; i++) {
    const Rider     *r = s->rider + i;
    const PetscInt   e = r->cell, o = r->from;
    const PetscReal *x = NearCellMiddle(l, o), *was = s->p + o * s->nk;
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
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- where fields stay on a device ---- */

/* What is read and what is written of them, each once */
typedef struct {
  PetscInt nread, *read, nwritten, *written; /* cells, of pressures; written: of p and dp */
  PetscInt nbefore, *before, nnode, *node;   /* nodes, of velocities */
  char    *listed[4];                        /* those that a list has */
} Lists;

static void list_once(PetscInt i, char listed[], PetscInt *n, PetscInt list[])
{
  if (listed[i]) return;
  listed[i]    = 1;
  list[(*n)++] = i;
}

/* Cells that were inside, and those around them */
static void list_opened(const Start *s, Lists *w)
{
  const MeshLocal *l = s->l;

  for (PetscInt i = 0; i < s->nlist; i++) {
    list_once(s->list[i], w->listed[1], &w->nwritten, w->written);
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt n = l->cell_node[s->list[i] * l->nb + j];

      for (PetscInt m = l->node_cell_ptr[n]; m < l->node_cell_ptr[n + 1]; m++)
        list_once(l->node_cell[m], w->listed[0], &w->nread, w->read);
    }
  }
}

static PetscErrorCode make_lists(const Start *s, Lists *w)
{
  const MeshLocal *l = s->l;
  const PetscInt   n = l->ncell_all, m = l->nnode_all;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc4(n, &w->read, n, &w->written, m, &w->before, m, &w->node));
  PetscCall(PetscCalloc4(n, &w->listed[0], n, &w->listed[1], m, &w->listed[2], m, &w->listed[3]));
  list_opened(s, w);
  for (PetscInt i = 0; i < s->nrider; i++) {
    list_once(s->rider[i].cell, w->listed[1], &w->nwritten, w->written);
    list_once(s->rider[i].cell, w->listed[0], &w->nread, w->read);
    list_once(s->rider[i].from, w->listed[0], &w->nread, w->read);
  }
  for (PetscInt i = 0; i < s->npassenger; i++) {
    const PetscInt *before = l->cell_node + s->passenger[i].from * l->nb;

    list_once(s->passenger[i].node, w->listed[3], &w->nnode, w->node);
    for (PetscInt j = 0; j < l->nb; j++) list_once(before[j], w->listed[2], &w->nbefore, w->before);
  }
  PetscCall(PetscFree4(w->listed[0], w->listed[1], w->listed[2], w->listed[3]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What is read comes here: p, dp, u of the start value and, for s->before, of the step before */
static PetscErrorCode fetch(Start *s, const Lists *w, PetscReal p[], PetscReal dp[], PetscReal before[])
{
  const Flow     flow = s->c->flow;
  FlowDeviceStep step;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStepOnDevice(flow, &step));
  PetscCall(FlowFetchRows(flow, w->nread, s->nk, w->read, step.p, p));
  PetscCall(FlowFetchRows(flow, w->nwritten, s->nk, w->written, step.dp, dp));
  PetscCall(FlowFetchRows(flow, w->nbefore, s->l->dim, w->before, step.before, before));
  PetscCall(FlowFetchRows(flow, w->nnode, s->l->dim, w->node, step.u, s->u));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode send(Start *s, Lists *w, const PetscReal p[], const PetscReal dp[])
{
  Flow           flow = s->c->flow;
  FlowDeviceStep step;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStepOnDevice(flow, &step));
  PetscCall(FlowSendRows(flow, w->nwritten, s->nk, w->written, p, step.p));
  PetscCall(FlowSendRows(flow, w->nwritten, s->nk, w->written, dp, step.dp));
  PetscCall(FlowSendRows(flow, w->nnode, s->l->dim, w->node, s->u, step.u));
  PetscCall(PetscFree4(w->read, w->written, w->before, w->node));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- a step ---- */

/* With lists of cells and nodes made: start values from those of FlowExtrapolate */
static PetscErrorCode change_values(Start *s, PetscReal p[], PetscReal dp[])
{
  const MeshLocal *l = s->l;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(s->p, p, l->ncell * s->nk));
  if (!s->c->method.table->moves_nodes) PetscCall(fill(s, dp));
  else PetscCall(sync_cells(s));
  PetscCall(PetscArraycpy(p, s->p, l->ncell * s->nk));
  PetscCall(carry_all(s));
  PetscCall(ride(s, p, dp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* u, p, dp of FlowExtrapolate become start values that go with the bodies, dp counts less where p does. Nothing happens
   where no body moves. */
static PetscErrorCode set_start_values(Couple c, void *data)
{
  const MeshLocal *l     = c->loc;
  const PetscBool  there = FlowStaysOnDevice(c->flow);
  PetscReal       *p = c->field.p, *dp = c->field.dp, *before;
  Start            s     = {.c = c, .l = l, .nk = l->dim + 1, .u = c->field.u};
  Lists            lists = {0};
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
  PetscCall(PetscCalloc3(l->ncell_all * s.nk, &s.p, l->ncell_all, &s.open, l->nnode, &s.best));
  PetscCall(PetscMalloc2(l->ncell, &s.list, l->ncell, &s.at));
  if (s.many) PetscCall(PetscCalloc1(l->nnode_all * (s.nk + 1), &s.field));
  for (PetscInt e = 0; e < l->ncell; e++) s.at[e] = -1;
  PetscCall(set_out(&s));
  if (there) {
    PetscCall(PetscMalloc1(l->nnode_all * l->dim, &before));
    PetscCall(make_lists(&s, &lists));
    PetscCall(fetch(&s, &lists, p, dp, before));
  } else PetscCall(FlowGetFields(c->flow, &before, NULL, NULL));
  s.before = before;
  PetscCall(change_values(&s, p, dp));
  if (there) {
    PetscCall(send(&s, &lists, p, dp));
    PetscCall(PetscFree(before));
  }
  PetscCall(PetscFree3(s.p, s.open, s.best));
  PetscCall(PetscFree2(s.list, s.at));
  PetscCall(PetscFree(s.field));
  PetscCall(PetscFree(s.mean));
  PetscCall(PetscFree(s.rider));
  PetscCall(PetscFree(s.passenger));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant START_VALUES = {.name = "start values", .start = set_start_values};

PetscErrorCode CoupleAddStartValues(Couple c)
{
  PetscFunctionBeginUser;
  if (c->s->nall) PetscCall(CoupleAddParticipant(c, &START_VALUES, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}
