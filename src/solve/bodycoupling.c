/* BodyCoupling: see bodycoupling.h. */
#include "compat.h"
#include "bodycoupling.h"
#include "base/inline.h"

/* Two bodies that share entries */
typedef struct {
  PetscInt body, other, next; /* next of the same body, or -1 */
} Two;

/* Own rows of the matrix, compressed: columns of own nodes, then of ghosts */
typedef struct {
  Mat              part[2];                      /* the second NULL on one rank */
  const PetscInt  *start[2], *column[2], *ghost; /* ghost: nodes of the second part's columns, or NULL */
  const PetscReal *value[2];
} Rows;

struct _p_BodyCoupling {
  Flow             flow;
  Constraint       constraint;
  const MeshLocal *loc;
  PetscInt        *ghost; /* nodes of the matrix' columns of other ranks */
  /* nodes that rigid velocities move, c->body_node */
  PetscInt  *place;             /* [nnode_all] where a node stands there, or -1 */
  PetscInt  *mover, moved_room; /* [c->nbody_nodes] the body */
  PetscReal *arm;               /* [c->nbody_nodes][dim] from its centre */
  /* E: nodes with entries, the pairs of each, and of a pair the local number of the body and its dim + 1 numbers */
  PetscInt   nnode, node_room, *node, *start, n, room, *body;
  PetscReal *e, *saved; /* saved [nnode][dim] */
  PetscInt  *at;        /* [own nodes] where a node stands in `node`, or -1 */
  /* O: [nbodies] first of a body, or -1; [ntwo][nr][nr] */
  PetscInt   ntwo, two_room, first_room, *first;
  Two       *two;
  PetscReal *block, *own; /* own [nbodies][nr][nr]: of single bodies */
};

/* The body whose rigid velocities move node i, or -1; at a wall none */
static inline PetscInt get_body(const struct _p_Constraint *c, PetscInt i)
{
  const PetscInt  k    = c->node_body[i] >= 0 ? c->node_body[i] : c->follow[i];
  const PetscBool wall = (PetscBool)(c->node_body[i] < 0 && c->fixed[i] == (1 << c->loc->dim) - 1);

  return k >= 0 && c->unknown[k] && !wall ? k : -1;
}

static PetscErrorCode place_nodes(BodyCoupling b)
{
  const struct _p_Constraint *c   = b->constraint;
  const MeshLocal            *l   = b->loc;
  const PetscInt              dim = l->dim;

  PetscFunctionBeginUser;
  if (b->moved_room < c->nbody_nodes) {
    b->moved_room = c->nbody_nodes + c->nbody_nodes / 4;
    PetscCall(PetscRealloc(b->moved_room * sizeof(PetscInt), &b->mover));
    PetscCall(PetscRealloc(b->moved_room * dim * sizeof(PetscReal), &b->arm));
  }
  for (PetscInt i = 0; i < l->nnode_all; i++) b->place[i] = -1;
  for (PetscInt e = 0; e < c->nbody_nodes; e++) {
    const PetscInt i = c->body_node[e], k = get_body(c, i);

    if (k < 0) continue;
    b->place[i] = e;
    b->mover[e] = k;
    for (PetscInt d = 0; d < dim; d++) b->arm[e * dim + d] = MeshNearest(l, d, l->x[i * dim + d] - c->X[k][d]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode map_ghosts(BodyCoupling b)
{
  const MeshLocal *l = b->loc;
  const PetscInt  *garray;
  PetscInt         n, nghost = l->nnode_all - l->nnode, *sorted, *where;
  Mat              part[2];

  PetscFunctionBeginUser;
  if (b->ghost) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetMatrixParts(b->flow, part, &garray));
  if (!part[1]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatGetLocalSize(part[1], NULL, &n));
  PetscCall(PetscMalloc1(n, &b->ghost));
  PetscCall(PetscMalloc2(nghost, &sorted, nghost, &where));
  for (PetscInt i = 0; i < nghost; i++) {
    sorted[i] = l->node_global[l->nnode + i];
    where[i]  = l->nnode + i;
  }
  PetscCall(PetscSortIntWithArray(nghost, sorted, where));
  for (PetscInt j = 0; j < n; j++) {
    PetscInt at;

    PetscCall(PetscFindInt(garray[j], nghost, sorted, &at));
    PetscCheck(at >= 0, PETSC_COMM_SELF, PETSC_ERR_PLIB, "Node %" PetscInt_FMT " is coupled to own nodes but is no ghost node", garray[j]);
    b->ghost[j] = where[at];
  }
  PetscCall(PetscFree2(sorted, where));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode open_rows(BodyCoupling b, Rows *rows)
{
  const PetscInt *map;
  PetscInt        n;
  Mat             S;
  PetscBool       done;

  PetscFunctionBeginUser;
  PetscCall(FlowGetMatrix(b->flow, &S));
  PetscCall(map_ghosts(b));
  *rows = (Rows){.ghost = b->ghost};
  PetscCall(FlowGetMatrixParts(b->flow, rows->part, &map));
  for (PetscInt s = 0; s < 2 && rows->part[s]; s++) {
    PetscCall(MatGetRowIJ(rows->part[s], 0, PETSC_FALSE, PETSC_FALSE, &n, &rows->start[s], &rows->column[s], &done));
    PetscCall(MatSeqAIJGetArrayRead(rows->part[s], &rows->value[s]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode close_rows(Rows *rows)
{
  PetscInt  n;
  PetscBool done;

  PetscFunctionBeginUser;
  for (PetscInt s = 0; s < 2 && rows->part[s]; s++) {
    PetscCall(MatSeqAIJRestoreArrayRead(rows->part[s], &rows->value[s]));
    PetscCall(MatRestoreRowIJ(rows->part[s], 0, PETSC_FALSE, PETSC_FALSE, &n, &rows->start[s], &rows->column[s], &done));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Node of entry q of a part */
static inline PetscInt get_node(const Rows *rows, PetscInt part, PetscInt q)
{
  return part ? rows->ghost[rows->column[1][q]] : rows->column[0][q];
}

static PetscErrorCode add_node(BodyCoupling b, PetscInt i)
{
  PetscFunctionBeginUser;
  if (b->at[i] >= 0) PetscFunctionReturn(PETSC_SUCCESS);
  if (b->nnode == b->node_room) {
    b->node_room = 2 * b->node_room + 256;
    PetscCall(PetscRealloc(b->node_room * sizeof(PetscInt), &b->node));
    PetscCall(PetscRealloc((b->node_room + 1) * sizeof(PetscInt), &b->start));
    PetscCall(PetscRealloc(b->node_room * b->loc->dim * sizeof(PetscReal), &b->saved));
  }
  b->at[i]            = b->nnode;
  b->node[b->nnode++] = i;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- between nodes and bodies ---- */

/* Which own nodes have a part of E; first those that no body holds, *nfree */
static PetscErrorCode find_nodes(BodyCoupling b, const Rows *rows, const PenaltyTerm *soft, PetscInt *nfree)
{
  const struct _p_Constraint *c = b->constraint;
  const PetscInt              n = b->loc->nnode;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < c->nbody_nodes; e++) {
    const PetscInt i = c->body_node[e];

    if (b->place[i] < 0 || i >= n) continue;
    for (PetscInt q = rows->start[0][i]; q < rows->start[0][i + 1]; q++)
      if (c->node_body[rows->column[0][q]] < 0) PetscCall(add_node(b, rows->column[0][q]));
  }
  for (PetscInt i = 0; i < n && rows->part[1]; i++)
    for (PetscInt q = rows->start[1][i]; q < rows->start[1][i + 1] && c->node_body[i] < 0; q++)
      if (b->place[get_node(rows, 1, q)] >= 0) PetscCall(add_node(b, i));
  for (PetscInt e = 0; soft && e < soft->n; e++)
    if (c->unknown[soft->body[e]] && c->node_body[soft->node[e]] < 0) PetscCall(add_node(b, soft->node[e]));
  *nfree = b->nnode;
  for (PetscInt e = 0; e < c->nbody_nodes; e++) {
    const PetscInt i = c->body_node[e];

    if (b->place[i] >= 0 && i < n && c->node_body[i] >= 0) PetscCall(add_node(b, i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The numbers of body k among the pairs of the last node, which begin at `begin` */
static PetscErrorCode get_pair(BodyCoupling b, PetscInt begin, PetscInt k, PetscReal **e)
{
  const PetscInt nm = b->loc->dim + 1;
  PetscInt       at = begin;

  PetscFunctionBeginUser;
  while (at < b->n && b->body[at] != k) at++;
  if (at == b->n) {
    if (b->n == b->room) {
      b->room = 2 * b->room + 256;
      PetscCall(PetscRealloc(b->room * sizeof(PetscInt), &b->body));
      PetscCall(PetscRealloc(b->room * nm * sizeof(PetscReal), &b->e));
    }
    b->body[b->n++] = k;
    PetscCall(PetscArrayzero(b->e + at * nm, nm));
  }
  *e = b->e + at * nm;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* E of node i; soft_first, soft_next: entries of the penalty by nodes */
static PetscErrorCode add_pairs(BodyCoupling b, const Rows *rows, PetscInt i, const PenaltyTerm *soft, PetscInt soft_first,
                                const PetscInt soft_next[])
{
  const PetscInt dim = b->loc->dim, begin = b->n;
  PetscInt       last = -1;
  PetscReal     *e    = NULL;

  PetscFunctionBeginUser;
  for (PetscInt part = 0; part < 2 && rows->part[part]; part++) {
    for (PetscInt q = rows->start[part][i]; q < rows->start[part][i + 1]; q++) {
      const PetscInt  at = b->place[get_node(rows, part, q)], k = at >= 0 ? b->mover[at] : -1;
      const PetscReal a = rows->value[part][q];

      if (k < 0) continue;
      if (k != last) PetscCall(get_pair(b, begin, k, &e));
      last = k;
      e[0] += a;
      for (PetscInt d = 0; d < dim; d++) e[1 + d] += a * b->arm[at * dim + d];
    }
  }
  for (PetscInt s = soft_first; s >= 0; s = soft_next[s]) {
    PetscCall(get_pair(b, begin, soft->body[s], &e));
    for (PetscInt m = 0; m <= dim; m++) e[m] -= soft->g[s * (dim + 1) + m];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* E of these nodes, with what the penalty adds */
static PetscErrorCode find_pairs(BodyCoupling b, const Rows *rows, const PenaltyTerm *soft)
{
  const PetscInt n = soft ? soft->n : 0;
  PetscInt      *first, *next;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(b->nnode, &first, n, &next));
  for (PetscInt i = 0; i < b->nnode; i++) first[i] = -1;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt at = b->at[soft->node[e]];

    if (at < 0 || !b->constraint->unknown[soft->body[e]]) continue;
    next[e]   = first[at];
    first[at] = e;
  }
  for (PetscInt i = 0; i < b->nnode; i++) {
    b->start[i] = b->n;
    PetscCall(add_pairs(b, rows, b->node[i], soft, first[i], next));
    b->start[i + 1] = b->n;
  }
  PetscCall(PetscFree2(first, next));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- between bodies ---- */

/* Where the block in the rows of body k and the columns of another stands; zero if it is new */
static PetscErrorCode get_block(BodyCoupling b, PetscInt k, PetscInt other, PetscReal **block)
{
  const PetscInt nn = b->constraint->nr * b->constraint->nr;
  PetscInt       at = b->first[k];

  PetscFunctionBeginUser;
  if (other == k) {
    *block = b->own + k * nn;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  while (at >= 0 && b->two[at].other != other) at = b->two[at].next;
  if (at < 0) {
    if (b->ntwo == b->two_room) {
      b->two_room = 2 * b->two_room + 64;
      PetscCall(PetscRealloc(b->two_room * sizeof(Two), &b->two));
      PetscCall(PetscRealloc(b->two_room * nn * sizeof(PetscReal), &b->block));
    }
    at          = b->ntwo++;
    b->two[at]  = (Two){k, other, b->first[k]};
    b->first[k] = at;
    PetscCall(PetscArrayzero(b->block + at * nn, nn));
  }
  *block = b->block + at * nn;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* M [dim][nr]: M U = m_0 V + w x (m_1, ...) for rigid velocities (V, w) */
INLINE void get_map(const int dim, const PetscReal m0, const PetscReal *restrict r, PetscReal *restrict M)
{
  const int nr = dim == 2 ? 3 : 6;

  for (int e = 0; e < dim * nr; e++) M[e] = e % nr == e / nr ? m0 : 0;
  if (dim == 2) {
    M[2] = -r[1];
    M[5] = r[0];
  } else
    for (int a = 0; a < 3; a++) {
      M[a * 6 + 3 + (a + 1) % 3] = r[(a + 2) % 3];
      M[a * 6 + 3 + (a + 2) % 3] = -r[(a + 1) % 3];
    }
}

/* block [nr][nr] += sign S^T T, S and T [dim][nr] */
INLINE void add_product(const int dim, PetscReal sign, const PetscReal *restrict S, const PetscReal *restrict T, PetscReal *restrict block)
{
  const int nr = dim == 2 ? 3 : 6;

  for (int i = 0; i < nr; i++)
    for (int j = 0; j < nr; j++)
      for (int d = 0; d < dim; d++) block[i * nr + j] += sign * S[d * nr + i] * T[d * nr + j];
}

/* Blocks of the bodies: R^T E of the nodes that they move */
INLINE PetscErrorCode add_blocks(const int dim, BodyCoupling b)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < b->nnode; i++) {
    const PetscInt at = b->place[b->node[i]];
    PetscReal      R[18], E[18], *block;

    if (at < 0) continue;
    get_map(dim, 1, b->arm + at * dim, R);
    for (PetscInt q = b->start[i]; q < b->start[i + 1]; q++) {
      PetscCall(get_block(b, b->mover[at], b->body[q], &block));
      get_map(dim, b->e[q * (dim + 1)], b->e + q * (dim + 1) + 1, E);
      add_product(dim, 1, R, E, block);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* And -G^T R in the rows of the bodies that hold a node by a penalty */
INLINE PetscErrorCode subtract_soft(const int dim, BodyCoupling b, const PenaltyTerm *soft)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < soft->n; e++) {
    const PetscInt at = b->place[soft->node[e]];
    PetscReal      R[18], G[18], *block;

    if (at < 0 || !b->constraint->unknown[soft->body[e]]) continue;
    get_map(dim, 1, b->arm + at * dim, R);
    get_map(dim, soft->g[e * (dim + 1)], soft->g + e * (dim + 1) + 1, G);
    PetscCall(get_block(b, soft->body[e], b->mover[at], &block));
    add_product(dim, -1, G, R, block);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode clear(BodyCoupling b)
{
  const PetscInt nbodies = b->constraint->nbodies, nn = b->constraint->nr * b->constraint->nr;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < b->nnode; i++) b->at[b->node[i]] = -1;
  b->n = b->nnode = b->ntwo = 0;
  if (b->first_room < nbodies) {
    b->first_room = nbodies + nbodies / 4;
    PetscCall(PetscRealloc(b->first_room * sizeof(PetscInt), &b->first));
    PetscCall(PetscRealloc(b->first_room * nn * sizeof(PetscReal), &b->own));
  }
  PetscCall(PetscArrayzero(b->own, nbodies * nn));
  for (PetscInt k = 0; k < nbodies; k++) b->first[k] = -1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyCouplingUpdate(BodyCoupling b, const PenaltyTerm *soft, const PetscReal *own[])
{
  const PetscInt *local = b->constraint->local_index, plane = b->loc->dim == 2;
  PetscInt        nfree = 0;
  Rows            rows;

  PetscFunctionBeginUser;
  PetscCall(clear(b));
  PetscCall(place_nodes(b));
  PetscCall(open_rows(b, &rows));
  PetscCall(find_nodes(b, &rows, soft, &nfree));
  PetscCall(find_pairs(b, &rows, soft));
  PetscCall(close_rows(&rows));
  PetscCall(plane ? add_blocks(2, b) : add_blocks(3, b));
  if (soft) PetscCall(plane ? subtract_soft(2, b, soft) : subtract_soft(3, b, soft));
  for (PetscInt i = nfree; i < b->nnode; i++) b->at[b->node[i]] = -1;
  b->nnode = nfree;
  for (PetscInt e = 0; e < b->n; e++) b->body[e] = local[b->body[e]];
  for (PetscInt e = 0; e < b->ntwo; e++) {
    b->two[e].body  = local[b->two[e].body];
    b->two[e].other = local[b->two[e].other];
  }
  *own = b->own;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- products ---- */

INLINE void subtract(const int dim, const struct _p_BodyCoupling *b, const PetscReal *restrict U, PetscReal *restrict rhs)
{
  const int nr = dim == 2 ? 3 : 6;

  for (PetscInt i = 0; i < b->nnode; i++) {
    PetscReal *r = rhs + b->node[i] * dim;

    for (int a = 0; a < dim; a++) b->saved[i * dim + a] = r[a];
    for (PetscInt q = b->start[i]; q < b->start[i + 1]; q++) {
      const PetscReal *e = b->e + q * (dim + 1), *arm = e + 1, *V = U + b->body[q] * nr;

      for (int a = 0; a < dim; a++) r[a] -= e[0] * V[a];
      if (dim == 2) {
        r[0] += arm[1] * V[2];
        r[1] -= arm[0] * V[2];
      } else
        for (int a = 0; a < 3; a++) r[a] -= V[3 + (a + 1) % 3] * arm[(a + 2) % 3] - V[3 + (a + 2) % 3] * arm[(a + 1) % 3];
    }
  }
}

INLINE void subtract_transposed(const int dim, const struct _p_BodyCoupling *b, const PetscReal *restrict x, PetscReal *restrict rigid)
{
  const int nr = dim == 2 ? 3 : 6;

  for (PetscInt i = 0; i < b->nnode; i++) {
    const PetscReal *v = x + b->node[i] * dim;

    for (PetscInt q = b->start[i]; q < b->start[i + 1]; q++) {
      const PetscReal *e = b->e + q * (dim + 1), *arm = e + 1;
      PetscReal       *V = rigid + b->body[q] * nr;

      for (int a = 0; a < dim; a++) V[a] -= e[0] * v[a];
      if (dim == 2) V[2] -= arm[0] * v[1] - arm[1] * v[0];
      else
        for (int a = 0; a < 3; a++) V[3 + a] -= arm[(a + 1) % 3] * v[(a + 2) % 3] - arm[(a + 2) % 3] * v[(a + 1) % 3];
    }
  }
}

PetscErrorCode BodyCouplingSubtract(BodyCoupling b, const PetscReal U[], PetscReal rhs[])
{
  PetscFunctionBeginUser;
  if (b->loc->dim == 2) subtract(2, b, U, rhs);
  else subtract(3, b, U, rhs);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyCouplingPutBack(BodyCoupling b, PetscReal rhs[])
{
  const PetscInt dim = b->loc->dim;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < b->nnode; i++)
    for (PetscInt a = 0; a < dim; a++) rhs[b->node[i] * dim + a] = b->saved[i * dim + a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyCouplingAnswer(BodyCoupling b, const PetscReal x[], const PetscReal U[], PetscReal rigid[])
{
  const PetscInt nr = b->constraint->nr, nn = nr * nr;

  PetscFunctionBeginUser;
  if (b->loc->dim == 2) subtract_transposed(2, b, x, rigid);
  else subtract_transposed(3, b, x, rigid);
  for (PetscInt e = 0; e < b->ntwo; e++) {
    const PetscReal *V = U + b->two[e].other * nr;
    PetscReal       *r = rigid + b->two[e].body * nr;

    for (PetscInt m = 0; m < nn; m++) r[m / nr] -= b->block[e * nn + m] * V[m % nr];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyCouplingCreate(Flow flow, Constraint constraint, BodyCoupling *coupling)
{
  BodyCoupling b;
  Mesh         mesh;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->flow       = flow;
  b->constraint = constraint;
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &b->loc));
  PetscCall(PetscMalloc2(b->loc->nnode_all, &b->place, b->loc->nnode, &b->at));
  for (PetscInt i = 0; i < b->loc->nnode; i++) b->at[i] = -1;
  *coupling = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyCouplingDestroy(BodyCoupling *coupling)
{
  BodyCoupling b = *coupling;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree2(b->place, b->at));
  PetscCall(PetscFree(b->mover));
  PetscCall(PetscFree(b->arm));
  PetscCall(PetscFree(b->node));
  PetscCall(PetscFree(b->start));
  PetscCall(PetscFree(b->body));
  PetscCall(PetscFree(b->e));
  PetscCall(PetscFree(b->saved));
  PetscCall(PetscFree(b->first));
  PetscCall(PetscFree(b->two));
  PetscCall(PetscFree(b->block));
  PetscCall(PetscFree(b->own));
  PetscCall(PetscFree(b->ghost));
  PetscCall(PetscFree(*coupling));
  PetscFunctionReturn(PETSC_SUCCESS);
}
