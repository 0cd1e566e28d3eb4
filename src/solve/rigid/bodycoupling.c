/* BodyCoupling: see bodycoupling.h. */
#include "compat.h"
#include "bodycoupling.h"
#include "base/rigid.h"
#include "base/array.h"
#include "base/rows.h"

/* Two bodies that share entries */
typedef struct {
  PetscInt body, other, next; /* next of the same body, or -1 */
} Two;

struct _p_BodyCoupling {
  Flow             flow;
  Constraint       constraint;
  const MeshLocal *loc;
  Rows             rows[2]; /* own rows of the matrix in an update: columns of own nodes, of ghosts */
  PetscInt         nhalves; /* 1 on one rank, 2 on more; gathered rows: 1, with columns of all */
  PetscInt        *ghost;   /* nodes of the columns of the second, or NULL */
  /* nodes that rigid velocities move, c->body_node */
  PetscInt  *index;                    /* [nnode_all] where a node stands there, or -1 */
  PetscInt  *mover, relative_capacity; /* [c->nbody_nodes] the body */
  PetscReal *arm;                      /* [c->nbody_nodes][dim] from its centre */
  /* E: nodes with entries, the pairs of each, and of a pair the local number of the body and its dim + 1 numbers */
  PetscInt   nnode, node_capacity, *node, *start, n, capacity, *body;
  PetscReal *e;
  PetscInt  *at; /* [own nodes] where a node stands in `node`, or -1 */
  /* O: [nbodies] first of a body, or -1; [ntwo][nr][nr] */
  PetscInt   ntwo, two_capacity, first_capacity, *first;
  Two       *two;
  PetscReal *block, *own; /* own [nbodies][nr][nr]: of single bodies */
};

/* INLINE keeps last digits: called out of line, gcc 12 contracts other sums of add_entries to multiply-adds */
INLINE PetscErrorCode place_nodes(BodyCoupling b)
{
  const ConstraintView *c   = ConstraintGetView(b->constraint);
  const MeshLocal      *l   = b->loc;
  const PetscInt        dim = l->dim;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(c->nbody_nodes, &b->relative_capacity, &b->mover, sizeof(*b->mover), &b->arm,
                         (size_t)dim * sizeof(*b->arm), NULL));
  for (PetscInt i = 0; i < l->nnode_all; i++) b->index[i] = -1;
  for (PetscInt e = 0; e < c->nbody_nodes; e++) {
    const PetscInt i = c->body_node[e], k = BodyCouplingGetMover(c, i);

    if (k < 0) continue;
    b->index[i] = e;
    b->mover[e] = k;
    for (PetscInt d = 0; d < dim; d++) b->arm[e * dim + d] = MeshNearest(l, d, l->x[i * dim + d] - c->X[k][d]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes of the n columns of other ranks, with these global numbers */
static PetscErrorCode map_ghosts(BodyCoupling b, PetscInt n, const PetscInt number[])
{
  const MeshLocal *l      = b->loc;
  PetscInt         nghost = l->nnode_all - l->nnode, *sorted, *where;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &b->ghost));
  PetscCall(PetscMalloc2(nghost, &sorted, nghost, &where));
  for (PetscInt i = 0; i < nghost; i++) {
    sorted[i] = l->node_global[l->nnode + i];
    where[i]  = l->nnode + i;
  }
  PetscCall(PetscSortIntWithArray(nghost, sorted, where));
  for (PetscInt j = 0; j < n; j++) {
    PetscInt at;

    PetscCall(PetscFindInt(number[j], nghost, sorted, &at));
    PetscCheck(at >= 0, PETSC_COMM_SELF, PETSC_ERR_PLIB,
               "Node %" PetscInt_FMT " is coupled to own nodes but is no ghost node", number[j]);
    b->ghost[j] = where[at];
  }
  PetscCall(PetscFree2(sorted, where));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode open_rows(BodyCoupling b, const Rows *gathered)
{
  const PetscInt *number = NULL;
  PetscInt        n;
  Mat             S, half[2];

  PetscFunctionBeginUser;
  if (gathered) {
    b->nhalves = 1;
    b->rows[0] = *gathered;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(FlowGetMatrix(b->flow, &S));
  PetscCall(FlowGetMatrixBlocks(b->flow, half, &number));
  b->nhalves = half[1] ? 2 : 1;
  if (half[1] && !b->ghost) {
    PetscCall(MatGetLocalSize(half[1], NULL, &n));
    PetscCall(map_ghosts(b, n, number));
  }
  for (PetscInt s = 0; s < b->nhalves; s++) PetscCall(RowsOpen(half[s], &b->rows[s]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Node of entry q of a part */
static inline PetscInt get_node(BodyCoupling b, PetscInt half, PetscInt q)
{
  return half ? b->ghost[b->rows[1].column[q]] : b->rows[0].column[q];
}

static PetscErrorCode add_node(BodyCoupling b, PetscInt i)
{
  PetscFunctionBeginUser;
  if (b->at[i] >= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ArrayReserve(b->nnode + 2, &b->node_capacity, &b->node, sizeof(*b->node), &b->start, sizeof(*b->start),
                         NULL)); /* one more in start */
  b->at[i]            = b->nnode;
  b->node[b->nnode++] = i;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- between nodes and bodies ---- */

/* Which own nodes have a part of E; first those that no body holds, *nfree */
static PetscErrorCode find_nodes(BodyCoupling b, const PenaltyTerm *penalty, PetscInt *nfree)
{
  const ConstraintView *c = ConstraintGetView(b->constraint);
  const PetscInt        n = b->loc->nnode, last = b->nhalves - 1;
  const Rows           *own = &b->rows[0], *other = &b->rows[last]; /* with columns of own nodes, of ghosts */

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < c->nbody_nodes; e++) {
    const PetscInt i = c->body_node[e];

    if (b->index[i] < 0 || i >= n) continue;
    for (PetscInt q = own->start[i]; q < own->start[i + 1]; q++)
      if (own->column[q] < n && b->at[own->column[q]] < 0 && c->node_body[own->column[q]] < 0)
        PetscCall(add_node(b, own->column[q]));
  }
  for (PetscInt i = 0; i < n && n < b->loc->nnode_all; i++)
    for (PetscInt q = other->start[i]; q < other->start[i + 1] && c->node_body[i] < 0; q++)
      if (get_node(b, last, q) >= n && b->index[get_node(b, last, q)] >= 0) PetscCall(add_node(b, i));
  for (PetscInt e = 0; penalty && e < penalty->n; e++)
    if (ConstraintHasUnknown(c, penalty->body[e]) && c->node_body[penalty->node[e]] < 0)
      PetscCall(add_node(b, penalty->node[e]));
  *nfree = b->nnode;
  for (PetscInt e = 0; e < c->nbody_nodes; e++) {
    const PetscInt i = c->body_node[e];

    if (b->index[i] >= 0 && i < n && c->node_body[i] >= 0) PetscCall(add_node(b, i));
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
    PetscCall(
      ArrayReserve(b->n + 1, &b->capacity, &b->body, sizeof(*b->body), &b->e, (size_t)nm * sizeof(*b->e), NULL));
    b->body[b->n++] = k;
    PetscCall(PetscArrayzero(b->e + at * nm, nm));
  }
  *e = b->e + at * nm;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* e += the entries of a row at nodes that body k moves, from q on until one of another body; returns its number */
INLINE PetscInt add_entries(const int dim, BodyCoupling b, PetscInt half, PetscInt q, PetscInt end, PetscInt k,
                            PetscReal e[])
{
  const PetscReal *value = b->rows[half].value;
  PetscReal        one = e[0], way[3] = {0};

  for (int d = 0; d < dim; d++) way[d] = e[1 + d];
  for (; q < end; q++) {
    const PetscInt at = b->index[get_node(b, half, q)];

    if (at < 0) continue;
    if (b->mover[at] != k) break;
    one += value[q];
    for (int d = 0; d < dim; d++) way[d] += value[q] * b->arm[at * dim + d];
  }
  e[0] = one;
  for (int d = 0; d < dim; d++) e[1 + d] = way[d];
  return q;
}

/* E of node i; penalty_first, penalty_next: entries of the penalty by nodes */
static PetscErrorCode add_pairs(BodyCoupling b, PetscInt i, const PenaltyTerm *penalty, PetscInt penalty_first,
                                const PetscInt penalty_next[])
{
  const PetscInt dim = b->loc->dim, begin = b->n;
  PetscReal     *e = NULL;

  PetscFunctionBeginUser;
  for (PetscInt half = 0; half < b->nhalves; half++) {
    const Rows    *rows = &b->rows[half];
    const PetscInt end  = rows->start[i + 1];

    for (PetscInt q = rows->start[i]; q < end;) {
      const PetscInt at = b->index[get_node(b, half, q)];

      if (at < 0) {
        q++;
        continue;
      }
      PetscCall(get_pair(b, begin, b->mover[at], &e));
      q = dim == 2 ? add_entries(2, b, half, q, end, b->mover[at], e)
                   : add_entries(3, b, half, q, end, b->mover[at], e);
    }
  }
  for (PetscInt s = penalty_first; s >= 0; s = penalty_next[s]) {
    PetscCall(get_pair(b, begin, penalty->body[s], &e));
    for (PetscInt m = 0; m <= dim; m++) e[m] -= penalty->g[s * (dim + 1) + m];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* E of these nodes, with what the penalty adds */
static PetscErrorCode find_pairs(BodyCoupling b, const PenaltyTerm *penalty)
{
  const PetscInt n = penalty ? penalty->n : 0;
  PetscInt      *first, *next;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(b->nnode, &first, n, &next));
  for (PetscInt i = 0; i < b->nnode; i++) first[i] = -1;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt at = b->at[penalty->node[e]];

    if (at < 0 || !ConstraintHasUnknown(ConstraintGetView(b->constraint), penalty->body[e])) continue;
    next[e]   = first[at];
    first[at] = e;
  }
  for (PetscInt i = 0; i < b->nnode; i++) {
    b->start[i] = b->n;
    PetscCall(add_pairs(b, b->node[i], penalty, first[i], next));
    b->start[i + 1] = b->n;
  }
  PetscCall(PetscFree2(first, next));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- between bodies ---- */

/* Where the block in the rows of body k and the columns of another stands; zero if it is new */
static PetscErrorCode get_block(BodyCoupling b, PetscInt k, PetscInt other, PetscReal **block)
{
  const PetscInt nn = ConstraintGetView(b->constraint)->nr * ConstraintGetView(b->constraint)->nr;
  PetscInt       at = b->first[k];

  PetscFunctionBeginUser;
  if (other == k) {
    *block = b->own + k * nn;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  while (at >= 0 && b->two[at].other != other) at = b->two[at].next;
  if (at < 0) {
    PetscCall(ArrayReserve(b->ntwo + 1, &b->two_capacity, &b->two, sizeof(*b->two), &b->block,
                           (size_t)nn * sizeof(*b->block), NULL));
    at          = b->ntwo++;
    b->two[at]  = (Two){k, other, b->first[k]};
    b->first[k] = at;
    PetscCall(PetscArrayzero(b->block + at * nn, nn));
  }
  *block = b->block + at * nn;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* block [nr][nr] += sign S^T T, S and T [dim][nr] */
INLINE void add_product(const int dim, PetscReal sign, const PetscReal *restrict S, const PetscReal *restrict T,
                        PetscReal *restrict block)
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
    const PetscInt at = b->index[b->node[i]];
    PetscReal      R[18], E[18], *block;

    if (at < 0) continue;
    RigidMapFill(dim, 1, b->arm + at * dim, R);
    for (PetscInt q = b->start[i]; q < b->start[i + 1]; q++) {
      PetscCall(get_block(b, b->mover[at], b->body[q], &block));
      RigidMapFill(dim, b->e[q * (dim + 1)], b->e + q * (dim + 1) + 1, E);
      add_product(dim, 1, R, E, block);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* And -G^T R in the rows of the bodies that hold a node by a penalty */
INLINE PetscErrorCode subtract_penalty(const int dim, BodyCoupling b, const PenaltyTerm *penalty)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < penalty->n; e++) {
    const PetscInt at = b->index[penalty->node[e]];
    PetscReal      R[18], G[18], *block;

    if (at < 0 || !ConstraintHasUnknown(ConstraintGetView(b->constraint), penalty->body[e])) continue;
    RigidMapFill(dim, 1, b->arm + at * dim, R);
    RigidMapFill(dim, penalty->g[e * (dim + 1)], penalty->g + e * (dim + 1) + 1, G);
    PetscCall(get_block(b, penalty->body[e], b->mover[at], &block));
    add_product(dim, -1, G, R, block);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode clear(BodyCoupling b)
{
  const PetscInt nbodies = ConstraintGetView(b->constraint)->nbodies,
                 nn      = ConstraintGetView(b->constraint)->nr * ConstraintGetView(b->constraint)->nr;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < b->nnode; i++) b->at[b->node[i]] = -1;
  b->n = b->nnode = b->ntwo = 0;
  PetscCall(ArrayReserve(nbodies, &b->first_capacity, &b->first, sizeof(*b->first), &b->own,
                         (size_t)nn * sizeof(*b->own), NULL));
  PetscCall(PetscArrayzero(b->own, nbodies * nn));
  for (PetscInt k = 0; k < nbodies; k++) b->first[k] = -1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyCouplingMarkNodes(Constraint constraint, PetscBool marked[])
{
  const ConstraintView *c = ConstraintGetView(constraint);

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < c->nbody_nodes; e++)
    if (BodyCouplingGetMover(c, c->body_node[e]) >= 0) marked[c->body_node[e]] = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode trim(BodyCoupling b)
{
  const PetscInt dim = b->loc->dim, nn = PetscSqr(ConstraintGetView(b->constraint)->nr);

  PetscFunctionBeginUser;
  PetscCall(ArrayTrim(ConstraintGetView(b->constraint)->nbody_nodes, &b->relative_capacity, &b->mover,
                      sizeof(*b->mover), &b->arm, (size_t)dim * sizeof(*b->arm), NULL));
  PetscCall(ArrayTrim(b->nnode + 2, &b->node_capacity, &b->node, sizeof(*b->node), &b->start, sizeof(*b->start), NULL));
  PetscCall(ArrayTrim(b->n, &b->capacity, &b->body, sizeof(*b->body), &b->e, (size_t)(dim + 1) * sizeof(*b->e), NULL));
  PetscCall(
    ArrayTrim(b->ntwo, &b->two_capacity, &b->two, sizeof(*b->two), &b->block, (size_t)nn * sizeof(*b->block), NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyCouplingUpdate(BodyCoupling b, const Rows *rows, const PenaltyTerm *penalty, const PetscReal *own[])
{
  const PetscInt *local = ConstraintGetView(b->constraint)->local_index, plane = b->loc->dim == 2;
  PetscInt        nfree = 0;

  PetscFunctionBeginUser;
  PetscCall(clear(b));
  PetscCall(place_nodes(b));
  PetscCall(open_rows(b, rows));
  PetscCall(find_nodes(b, penalty, &nfree));
  PetscCall(find_pairs(b, penalty));
  for (PetscInt s = 0; s < b->nhalves && !rows; s++) PetscCall(RowsClose(&b->rows[s]));
  PetscCall(plane ? add_blocks(2, b) : add_blocks(3, b));
  if (penalty) PetscCall(plane ? subtract_penalty(2, b, penalty) : subtract_penalty(3, b, penalty));
  for (PetscInt i = nfree; i < b->nnode; i++) b->at[b->node[i]] = -1;
  b->nnode = nfree;
  for (PetscInt e = 0; e < b->n; e++) b->body[e] = local[b->body[e]];
  for (PetscInt e = 0; e < b->ntwo; e++) {
    b->two[e].body  = local[b->two[e].body];
    b->two[e].other = local[b->two[e].other];
  }
  *own = b->own;
  PetscCall(trim(b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyCouplingSetBlocks(BodyCoupling b, const PenaltyTerm *penalty, PetscInt n, const PetscInt two[],
                                     const PetscReal block[], const PetscReal *own[])
{
  const ConstraintView *c  = ConstraintGetView(b->constraint);
  const PetscInt        nn = PetscSqr(c->nr);

  PetscFunctionBeginUser;
  PetscCall(clear(b));
  PetscCall(place_nodes(b));
  for (PetscInt e = 0; e < n; e++) {
    PetscReal *to = NULL;

    PetscCall(get_block(b, c->local_list[two[2 * e]], c->local_list[two[2 * e + 1]], &to));
    PetscCall(PetscArraycpy(to, block + e * nn, nn));
  }
  if (penalty) PetscCall(subtract_penalty(3, b, penalty));
  for (PetscInt e = 0; e < b->ntwo; e++) {
    b->two[e].body  = c->local_index[b->two[e].body];
    b->two[e].other = c->local_index[b->two[e].other];
  }
  *own = b->own;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- products ---- */

INLINE void subtract(const int dim, const struct _p_BodyCoupling *b, const PetscReal *restrict U,
                     PetscReal *restrict rhs)
{
  const int nr = dim == 2 ? 3 : 6;

  for (PetscInt i = 0; i < b->nnode; i++) {
    PetscReal *r = rhs + b->node[i] * dim;

    for (PetscInt q = b->start[i]; q < b->start[i + 1]; q++) {
      const PetscReal *e = b->e + q * (dim + 1), *arm = e + 1, *V = U + b->body[q] * nr;

      for (int a = 0; a < dim; a++) r[a] -= e[0] * V[a];
      if (dim == 2) {
        r[0] += arm[1] * V[2];
        r[1] -= arm[0] * V[2];
      } else
        for (int a = 0; a < 3; a++)
          r[a] -= V[3 + (a + 1) % 3] * arm[(a + 2) % 3] - V[3 + (a + 2) % 3] * arm[(a + 1) % 3];
    }
  }
}

INLINE void subtract_transposed(const int dim, const struct _p_BodyCoupling *b, const PetscReal *restrict x,
                                PetscReal *restrict rigid)
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

void BodyCouplingGetView(BodyCoupling b, struct _p_BodyCouplingView *v)
{
  *v = (struct _p_BodyCouplingView){b->nnode, b->node, b->start, b->body, b->e};
}

PetscErrorCode BodyCouplingAnswer(BodyCoupling b, const PetscReal x[], const PetscReal U[], PetscReal rigid[])
{
  PetscFunctionBeginUser;
  if (b->loc->dim == 2) subtract_transposed(2, b, x, rigid);
  else subtract_transposed(3, b, x, rigid);
  PetscCall(BodyCouplingAnswerBodies(b, U, rigid));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyCouplingAnswerBodies(BodyCoupling b, const PetscReal U[], PetscReal rigid[])
{
  const PetscInt nr = ConstraintGetView(b->constraint)->nr, nn = nr * nr;

  PetscFunctionBeginUser;
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
  PetscCall(PetscMalloc2(b->loc->nnode_all, &b->index, b->loc->nnode, &b->at));
  for (PetscInt i = 0; i < b->loc->nnode; i++) b->at[i] = -1;
  *coupling = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyCouplingDestroy(BodyCoupling *coupling)
{
  BodyCoupling b = *coupling;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree2(b->index, b->at));
  PetscCall(PetscFree(b->mover));
  PetscCall(PetscFree(b->arm));
  PetscCall(PetscFree(b->node));
  PetscCall(PetscFree(b->start));
  PetscCall(PetscFree(b->body));
  PetscCall(PetscFree(b->e));
  PetscCall(PetscFree(b->first));
  PetscCall(PetscFree(b->two));
  PetscCall(PetscFree(b->block));
  PetscCall(PetscFree(b->own));
  PetscCall(PetscFree(b->ghost));
  PetscCall(PetscFree(*coupling));
  PetscFunctionReturn(PETSC_SUCCESS);
}
