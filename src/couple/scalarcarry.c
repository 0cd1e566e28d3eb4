/* ScalarCarry: see scalarcarry.h. */
#include "compat.h"
#include "impl.h"
#include "alignbodies.h"
#include "cutcells.h"
#include "scalarbooks.h"
#include "scalarcarry.h"
#include "scalarfields.h"
#include "scalarshift.h"
#include "base/algebra.h"

#define RINGS 3.0  /* cells around a body whose nodes go along */
#define NEAR  1e-6 /* cells: nearer than that is on the surface */
#define CHUNK 256

struct _p_ScalarCarry {
  ScalarBooks books;
  PetscReal  *V; /* [nnode_all][dim] velocity of nodes */
  Couple      c;
  Scalars     scalars;
  PetscReal  *P1, *P2; /* [nnode_all][dim] */
  PetscReal  *x, *y;   /* [nnode_all][dim] where nodes will be, and where they were */
  PetscReal  *shift;   /* [nnode_all][dim] of the mesh to come */
  PetscReal  *shift_old;
  PetscReal   reach;    /* of a cell */
  PetscReal  *weight;   /* [nnode_all] sum of those of bodies */
  PetscBool  *boundary; /* [nnode_all] */
  PetscInt   *inside;   /* [nnode_all] is it in no cell of the fluid? */
};

/* ---- where nodes were ---- */

/* How bodies have moved; NULL: from where they started to where they are */
typedef struct {
  const PetscReal (*displacement)[3], (*rotation)[9];
  const PetscBool *moves; /* [n] do nodes go along with it? */
} BodyMotion;

/* d [dim] of a point at the arm r from the centre of body k, as it is now */
static void displace(PetscInt dim, const BodyMotion *m, PetscInt k, const PetscReal r[3], PetscReal d[])
{
  for (PetscInt a = 0; a < dim; a++) d[a] = m->displacement[k][a] + r[a] - dot3(m->rotation[k] + 3 * a, r);
}

/* Nodes list [n] near the image of body k at X: adds weights, and weights times displacements to y */
static PetscErrorCode add_nodes(ScalarCarry s, const BodyMotion *m, PetscInt k, const PetscReal X[3], PetscInt n,
                                const PetscInt node[])
{
  const PetscInt dim = s->c->loc->dim;
  PetscReal      x[CHUNK * 3], d[CHUNK];

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n; e++)
    for (PetscInt a = 0; a < dim; a++) x[e * dim + a] = s->x[node[e] * dim + a];
  PetscCall(BodiesDistance(s->c->bodies, k, X, s->c->rigid.q[k], n, x, d));
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt  i    = node[e];
    const PetscReal near = PetscMax(d[e] / s->c->loc->h, NEAR), f = near > NEAR ? 1 - near / RINGS : 1;
    PetscReal       r[3] = {0, 0, 0}, move[3];

    if (f <= 0 || s->boundary[i]) continue;
    for (PetscInt a = 0; a < dim; a++) r[a] = x[e * dim + a] - X[a];
    displace(dim, m, k, r, move);
    s->weight[i] += 1 / near;
    for (PetscInt a = 0; a < dim; a++) s->y[i * dim + a] += f / near * move[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y <- where nodes, at x and inside at x + shift, were */
static PetscErrorCode find_origins(ScalarCarry s, const BodyMotion *m)
{
  Couple           c   = s->c;
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim;
  PetscReal        reach;

  PetscFunctionBeginUser;
  if (s->reach == 0) PetscCall(CutCellReach(c->mesh, &s->reach));
  reach = s->reach;
  PetscCall(PetscArrayzero(s->y, l->nnode_all * dim));
  PetscCall(PetscArrayzero(s->weight, l->nnode_all));
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal R = BodiesGetRadius(c->s, k);

    if (!m->moves[k]) continue;
    for (DomainImages image = {0}; MeshNextImage(l, c->rigid.X[k], R + RINGS * l->h + reach, &image);) {
      const PetscInt *list;
      PetscInt        n;

      PetscCall(MeshNodesInBox(c->mesh, image.at, R + RINGS * l->h + reach, &n, &list));
      for (PetscInt e = 0; e < n; e += CHUNK) PetscCall(add_nodes(s, m, k, image.at, PetscMin(CHUNK, n - e), list + e));
    }
  }
  for (PetscInt i = 0; i < l->nnode_all; i++)
    for (PetscInt e = i * dim; e < (i + 1) * dim; e++)
      s->y[e] = s->x[e] - (s->weight[i] > 0 ? s->y[e] / s->weight[i] : 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode mark_boundary(ScalarCarry s)
{
  PetscInt nboundary;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryCount(s->c->mesh, &nboundary));
  for (PetscInt b = 0; b < nboundary; b++) {
    const PetscInt *node;
    PetscInt        n;

    PetscCall(MeshGetBoundaryNodes(s->c->mesh, b, &n, &node));
    for (PetscInt e = 0; e < n; e++) s->boundary[node[e]] = PETSC_TRUE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- values there ---- */

/* What the mean gradient of scalar i has between x and y of node k: T = G.x + T' is carried, not T' */
static PetscReal gradient_between(ScalarCarry s, PetscInt i, PetscInt k)
{
  const PetscInt          dim = s->c->loc->dim;
  const ScalarParameters *par;
  PetscReal               sum = 0;

  (void)ScalarsGetParameters(s->scalars, i, &par);
  for (PetscInt a = 0; a < dim; a++) sum += par->gradient[a] * (s->x[k * dim + a] - s->y[k * dim + a]);
  return sum;
}

/* The fields, of dim components each: P1, P2, then T and T_old of each scalar */
static PetscErrorCode pack_fields(ScalarCarry s, PetscReal *field[])
{
  const PetscInt n = s->c->loc->nnode_all * s->c->loc->dim;

  PetscFunctionBeginUser;
  for (PetscInt f = 0; f < 2; f++) {
    PetscCall(PetscMalloc1(n, &field[f]));
    PetscCall(PetscArraycpy(field[f], f ? s->P2 : s->P1, n));
  }
  PetscCall(ScalarFieldsPack(s->scalars, s->c->loc, field + 2));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Values v [nfield][dim] at own node i, moved from y to x */
static PetscErrorCode store(ScalarCarry s, PetscInt i, const PetscReal v[])
{
  const PetscInt dim = s->c->loc->dim;
  PetscReal      way[3];

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < dim; a++) {
    const PetscInt at = i * dim + a;

    way[a]    = s->x[at] - s->y[at];
    s->P1[at] = s->inside[i] ? 0 : way[a] + v[a];
    s->P2[at] = s->inside[i] ? 0 : way[a] + v[dim + a];
  }
  PetscCall(ScalarFieldsSet(s->scalars, dim, i, way, v + 2 * dim));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own nodes of one side of surfaces (inside or not), which cells of that side answer for */
static PetscErrorCode evaluate(ScalarCarry s, const AlignMotion *m, PetscBool side, PetscInt nfield,
                               PetscReal *const field[])
{
  const AlignResult *r   = m->result;
  const MeshLocal   *l   = s->c->loc;
  const PetscInt     dim = l->dim;
  PetscInt           n   = 0, *node, *zero, *closed;
  PetscReal         *x, *v;
  RemapCount         count;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(l->nnode, &node, l->nnode * dim, &x, l->ncell_all, &closed));
  PetscCall(PetscCalloc2(PetscMax(l->nnode, l->ncell_all), &zero, l->nnode * nfield * dim, &v));
  for (PetscInt e = 0; e < l->ncell_all; e++) {
    const PetscInt  k  = r->cell_before[e];
    const PetscBool in = (PetscBool)(k >= 0 && r->inactive[k]); /* followed then and now */

    closed[e] = in == side ? -1 : 0;
  }
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscInt  k     = r->node_surface[i];
    const PetscBool in    = (PetscBool)(s->inside[i] && k >= 0 && m->before[k]);
    PetscBool       moves = (PetscBool)(s->inside[i] || s->weight[i] > 0);

    for (PetscInt a = 0; a < dim; a++) moves = (PetscBool)(moves || s->y[i * dim + a] != l->x[i * dim + a]);
    if (in != side || !moves) continue;
    PetscCall(PetscArraycpy(x + n * dim, s->y + i * dim, dim));
    for (PetscInt f = 0; f < nfield; f++) PetscCall(PetscArraycpy(v + (n * nfield + f) * dim, field[f] + i * dim, dim));
    node[n++] = i;
  }
  PetscCall(RemapEvaluate(m->remap, n, node, x, zero, (RemapCells){closed, zero}, nfield,
                          (const PetscReal *const *)field, v, &count));
  for (PetscInt e = 0; e < n; e++) PetscCall(store(s, node[e], v + e * nfield * dim));
  PetscCall(PetscFree2(zero, v));
  PetscCall(PetscFree3(node, x, closed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes inside, by sign where the scalars have them or back */
static PetscErrorCode move_inside(ScalarCarry s, PetscReal sign)
{
  const MeshLocal *l   = s->c->loc;
  const PetscInt   dim = l->dim;
  PetscInt        *node, n = 0;
  PetscReal       *x;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(l->nnode_all, &node, l->nnode_all * dim, &x));
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    PetscBool any = PETSC_FALSE;

    for (PetscInt a = 0; a < dim; a++) any = (PetscBool)(any || s->shift_old[i * dim + a] != 0);
    if (!any) continue;
    for (PetscInt a = 0; a < dim; a++) x[n * dim + a] = l->x[i * dim + a] + sign * s->shift_old[i * dim + a];
    node[n++] = i;
  }
  PetscCall(MeshMoveNodes(s->c->mesh, n, node, x));
  PetscCall(PetscFree2(node, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode carry(void *ctx, const AlignMotion *m)
{
  ScalarCarry        s   = (ScalarCarry)ctx;
  const AlignResult *r   = m->result;
  const MeshLocal   *l   = s->c->loc;
  const PetscInt     dim = l->dim, nfield = 2 + ScalarsCount(s->scalars);
  PetscReal        **field;
  PetscBool         *moves;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(nfield, &field, s->c->s->n, &moves));
  PetscCall(ScalarShiftInside(s->c, l->x, r->cell_before, &s->shift_old));
  PetscCall(PetscArraycpy(s->x, l->x, l->nnode_all * dim));
  for (PetscInt e = 0; e < r->nnode; e++) PetscCall(PetscArraycpy(s->x + r->node[e] * dim, r->x + e * dim, dim));
  PetscCall(ScalarShiftInside(s->c, s->x, r->cell_surface, &s->shift));
  for (PetscInt i = 0; i < l->nnode_all * dim; i++) s->x[i] += s->shift[i];
  for (PetscInt k = 0; k < s->c->s->n; k++) moves[k] = (PetscBool)(r->inactive[k] && m->before[k]);
  PetscCall(ScalarMarkInside(s->c, r->cell_surface, s->inside));
  PetscCall(find_origins(s, &(BodyMotion){m->displacement, m->rotation, moves}));
  PetscCall(pack_fields(s, field));
  PetscCall(evaluate(s, m, PETSC_FALSE, nfield, field));
  PetscCall(move_inside(s, 1));
  PetscCall(evaluate(s, m, PETSC_TRUE, nfield, field));
  PetscCall(move_inside(s, -1));
  PetscCall(ScalarFieldsSync(s->scalars, s->c->mesh));
  PetscCall(MeshSyncNodes(s->c->mesh, dim, s->P1));
  PetscCall(MeshSyncNodes(s->c->mesh, dim, s->P2));
  for (PetscInt f = 0; f < nfield; f++) PetscCall(PetscFree(field[f]));
  PetscCall(PetscFree2(field, moves));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode ScalarCarryCreate(Couple c, Scalars scalars, ScalarCarry *carry_)
{
  const PetscInt n = c->loc->nnode_all, nd = n * c->loc->dim;
  ScalarCarry    s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->c       = c;
  s->scalars = scalars;
  PetscCall(PetscCalloc5(nd, &s->P1, nd, &s->P2, nd, &s->x, nd, &s->y, nd, &s->V));
  PetscCall(ScalarBooksCreate(c, scalars, &s->books));
  PetscCall(PetscCalloc3(n, &s->weight, n, &s->boundary, n, &s->inside));
  PetscCall(mark_boundary(s));
  PetscCall((*c->method.table->carry)(c->method.data, carry, s));
  *carry_ = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCarryDestroy(ScalarCarry *carry_)
{
  ScalarCarry s = *carry_;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree5(s->P1, s->P2, s->x, s->y, s->V));
  PetscCall(ScalarBooksDestroy(&s->books));
  PetscCall(PetscFree3(s->weight, s->boundary, s->inside));
  PetscCall(PetscFree(s->shift));
  PetscCall(PetscFree(s->shift_old));
  PetscCall(PetscFree(*carry_));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCarryStart(ScalarCarry s, const PetscReal shift[])
{
  Couple           c   = s->c;
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, n = c->s->n, *inactive = MeshUpdateGetInactive(c->mesh_update);
  PetscBool       *moves;
  PetscReal(*displacement)[3], (*rotation)[9];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(n, &moves, n, &displacement, n, &rotation));
  for (PetscInt k = 0; k < n; k++) {
    PetscReal now[9], then[9];

    moves[k] = CoupleIsInactiveInside(c, k);
    RotationMatrix(c->rigid.q[k], now);
    RotationMatrix(c->s->q[k], then);
    for (PetscInt a = 0; a < 3; a++) displacement[k][a] = c->rigid.X[k][a] - c->s->x[k][a];
    for (PetscInt a = 0; a < 9; a++) rotation[k][a] = dot3(then + 3 * (a / 3), now + 3 * (a % 3));
  }
  for (PetscInt i = 0; i < l->nnode_all * dim; i++) s->x[i] = l->x[i] + (shift ? shift[i] : 0);
  PetscCall(ScalarMarkInside(c, inactive, s->inside));
  PetscCall(
    find_origins(s, &(BodyMotion){(const PetscReal(*)[3])displacement, (const PetscReal(*)[9])rotation, moves}));
  for (PetscInt i = 0; i < ScalarsCount(s->scalars); i++) {
    PetscReal *T[2];

    PetscCall(ScalarsStartAt(s->scalars, i, s->y));
    PetscCall(ScalarsGetFields(s->scalars, i, &T[0], &T[1]));
    for (PetscInt e = 0; e < 2 * l->nnode_all; e++) T[e % 2][e / 2] -= gradient_between(s, i, e / 2);
  }
  for (PetscInt i = 0; i < l->nnode_all * dim; i++) s->P1[i] = s->P2[i] = s->inside[i / dim] ? 0 : s->x[i] - s->y[i];
  PetscCall(MeshSyncNodes(c->mesh, dim, s->P1));
  PetscCall(MeshSyncNodes(c->mesh, dim, s->P2));
  PetscCall(PetscFree3(moves, displacement, rotation));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCarryConvect(ScalarCarry s, const ScalarGrowth *g, PetscReal w[])
{
  Couple          c   = s->c;
  const FlowStep *f   = c->step;
  const PetscInt  dim = c->loc->dim;
  const PetscInt *body;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetNodeBody(c, &body));
  PetscCall(PetscArraycpy(s->V, w, c->loc->nnode_all * dim));
  for (PetscInt i = 0; i < c->loc->nnode_all; i++) {
    const PetscInt k = body[i];
    PetscReal      v[3], r[3] = {0, 0, 0};

    for (PetscInt a = 0; a < dim; a++) w[i * dim + a] -= f->d0 * s->P1[i * dim + a] + f->d1 * s->P2[i * dim + a];
    if (k < 0 || !CoupleIsInactiveInside(c, k)) continue;
    for (PetscInt a = 0; a < dim; a++) r[a] = MeshNearest(c->loc, a, c->loc->x[i * dim + a] - c->rigid.P[k][a]);
    RigidVelocityAt(dim, c->rigid.U + k * c->nr, r, v);
    for (PetscInt a = 0; a < dim; a++)
      w[i * dim + a] = s->inside[i] ? 0 : c->field.u[i * dim + a] - v[a] - ScalarGrowthGetRate(g, c, k) * r[a];
  }
  for (PetscInt i = 0; i < c->loc->nnode_all * dim; i++) s->V[i] -= w[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static ScalarMotion get_motion(const struct _p_ScalarCarry *s)
{
  return (ScalarMotion){.V = s->V, .skip = MeshUpdateGetInactive(s->c->mesh_update), .along = s->weight};
}

PetscErrorCode ScalarCarryGiveBack(ScalarCarry s, PetscInt i, PetscReal bodies, PetscReal source[])
{
  const ScalarMotion m = get_motion(s);

  PetscFunctionBeginUser;
  if (m.skip) PetscCall(ScalarBooksGiveBack(s->books, &m, i, bodies, source));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCarryMeasure(ScalarCarry s, PetscInt i, PetscReal bodies, PetscReal *covered)
{
  const ScalarMotion m = get_motion(s);

  PetscFunctionBeginUser;
  if (m.skip) PetscCall(ScalarBooksMeasure(s->books, &m, i, bodies, covered));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCarryAccept(ScalarCarry s)
{
  const PetscInt n = s->c->loc->nnode_all * s->c->loc->dim;

  PetscFunctionBeginUser;
  PetscCall(ScalarBooksAccept(s->books));
  PetscCall(PetscArraycpy(s->P2, s->P1, n));
  PetscCall(PetscArrayzero(s->P1, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCarryVisit(ScalarCarry s, State state)
{
  PetscBool has;

  PetscFunctionBeginUser;
  PetscCall(StateHas(state, "carry_motion", &has));
  if (!has) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(StateNodes(state, "carry_motion", s->c->loc->dim, s->P2));
  PetscCall(ScalarBooksVisit(s->books, "carry_books", state));
  PetscFunctionReturn(PETSC_SUCCESS);
}
