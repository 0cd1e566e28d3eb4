/* FlowSolver on a device: E of the preconditioner and the blocks of bodies (bodycoupling.h), made there. Around each
   body stand the cells at nodes that it moves, with nodes of their own, the entries: pairs of a node and the body. Two
   products with them, of 1 and of the way from the body's centre at the nodes that it moves, are all of E, for all
   bodies at once, in reach of each other or not. The host lists cells and entries, and has sums of pairs of bodies
   back. */
#include "compat.h"
#include "impl.h"
#include "base/array.h"
#include "base/rigid.h"

/* Lists of a step, on the host */
typedef struct {
  /* nodes that rigid velocities move, by bodies */
  PetscInt   narm, *first, *node; /* first [nlocal + 1] */
  PetscReal *arm;                 /* [narm][4] */
  PetscInt  *of_node;             /* [nnode_all] arm of a node, or -1 */
  int       *entry;               /* [narm] with the body that moves it */
  /* cells around bodies, and entries */
  PetscInt ncell, *cell, *cell_node, cell_capacity, nentry, *entry_node, entry_capacity;
  /* of the step's other lists: that of each pair of the penalty; of E: body, node and entry */
  PetscInt npenalty, npair, *body, *at, pair_capacity;
  int     *of_penalty, *of_pair;
  /* sums: pairs of bodies (moves the node, has the entry), and terms: pair, arm, entry */
  PetscInt ntwo, *two, two_capacity, nterm, *term, term_capacity;
  /* work: -1, or where a cell, a node, a pair of the body at hand stands */
  PetscInt *at_cell, *at_node, *at_two;
} Lists;

static PetscErrorCode create_work(const MeshLocal *l, CouplingOnDevice *d)
{
  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(l->nnode_all, &d->of_node, l->nnode_all, &d->at_node, l->ncell, &d->at_cell));
  for (PetscInt i = 0; i < l->nnode_all; i++) d->of_node[i] = d->at_node[i] = -1;
  for (PetscInt i = 0; i < l->ncell; i++) d->at_cell[i] = -1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode open_lists(FlowSolver fs, PetscInt npenalty, Lists *s)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  CouplingOnDevice     *d = &fs->device.coupling;

  PetscFunctionBeginUser;
  if (!d->of_node) PetscCall(create_work(fs->loc, d));
  *s = (Lists){.npenalty = npenalty, .of_node = d->of_node, .at_node = d->at_node, .at_cell = d->at_cell};
  PetscCall(PetscCalloc1(c->nlocal + 2, &s->first));
  PetscCall(PetscMalloc3(c->nbody_nodes, &s->node, c->nbody_nodes * 4, &s->arm, c->nbody_nodes, &s->entry));
  PetscCall(PetscMalloc2(c->nlocal, &s->at_two, npenalty, &s->of_penalty));
  for (PetscInt k = 0; k < c->nlocal; k++) s->at_two[k] = -1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode close_lists(Lists *s)
{
  PetscFunctionBeginUser;
  for (PetscInt m = 0; m < s->narm; m++) s->of_node[s->node[m]] = -1;
  PetscCall(PetscFree(s->first));
  PetscCall(PetscFree3(s->node, s->arm, s->entry));
  PetscCall(PetscFree2(s->at_two, s->of_penalty));
  PetscCall(PetscFree(s->cell));
  PetscCall(PetscFree(s->cell_node));
  PetscCall(PetscFree(s->entry_node));
  PetscCall(PetscFree(s->body));
  PetscCall(PetscFree(s->at));
  PetscCall(PetscFree(s->of_pair));
  PetscCall(PetscFree(s->two));
  PetscCall(PetscFree(s->term));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- lists ---- */

/* By bodies, in ascending order of nodes */
static void list_arms(FlowSolver fs, Lists *s)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);

  for (PetscInt e = 0; e < c->nbody_nodes; e++) {
    const PetscInt k = BodyCouplingGetMover(c, c->body_node[e]);

    if (k >= 0) s->first[c->local_index[k] + 2]++;
  }
  for (PetscInt k = 0; k < c->nlocal; k++) s->first[k + 1] += s->first[k];
  for (PetscInt e = 0; e < c->nbody_nodes; e++) { /* first[k + 1]: where the next of body k goes */
    const PetscInt i = c->body_node[e], k = BodyCouplingGetMover(c, i);
    PetscInt       m;

    if (k < 0) continue;
    m             = s->first[c->local_index[k] + 1]++;
    s->node[m]    = i;
    s->of_node[i] = m;
    s->arm[m * 4] = 1;
    for (PetscInt a = 0; a < 3; a++) s->arm[m * 4 + 1 + a] = MeshNearest(c->loc, a, c->loc->x[i * 3 + a] - c->X[k][a]);
  }
  s->narm = s->first[c->nlocal];
}

static PetscErrorCode find_entry(Lists *s, PetscInt i, PetscInt *e)
{
  PetscFunctionBeginUser;
  if (s->at_node[i] < 0) {
    PetscCall(ArrayReserve(s->nentry + 1, &s->entry_capacity, &s->entry_node, sizeof(*s->entry_node), NULL));
    s->at_node[i]              = s->nentry;
    s->entry_node[s->nentry++] = i;
  }
  *e = s->at_node[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_cell(const MeshLocal *l, Lists *s, PetscInt c)
{
  PetscFunctionBeginUser;
  if (s->at_cell[c] >= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ArrayReserve(s->ncell + 1, &s->cell_capacity, &s->cell, sizeof(*s->cell), &s->cell_node,
                         27 * sizeof(*s->cell_node), NULL));
  s->at_cell[c]     = s->ncell;
  s->cell[s->ncell] = c;
  for (PetscInt j = 0; j < 27; j++)
    PetscCall(find_entry(s, l->cell_node[c * 27 + j], &s->cell_node[s->ncell * 27 + j]));
  s->ncell++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One more product in the sums of bodies k, which moves the node, and `other`, which has the entry */
static PetscErrorCode add_term(Lists *s, PetscInt k, PetscInt other, PetscInt arm, PetscInt entry)
{
  PetscInt *to;

  PetscFunctionBeginUser;
  if (s->at_two[k] < 0) {
    PetscCall(ArrayReserve(s->ntwo + 1, &s->two_capacity, &s->two, 2 * sizeof(*s->two), NULL));
    s->two[2 * s->ntwo]     = k;
    s->two[2 * s->ntwo + 1] = other;
    s->at_two[k]            = s->ntwo++;
  }
  PetscCall(ArrayReserve(s->nterm + 1, &s->term_capacity, &s->term, 3 * sizeof(*s->term), NULL));
  to    = s->term + 3 * s->nterm++;
  to[0] = s->at_two[k];
  to[1] = arm;
  to[2] = entry;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The entries of local body k from `begin` on: E where no body holds the node, a term of sums where one moves it */
static PetscErrorCode sort_entries(FlowSolver fs, Lists *s, PetscInt k, PetscInt begin)
{
  const ConstraintView *c    = ConstraintGetView(fs->constraint);
  const PetscInt        ntwo = s->ntwo;

  PetscFunctionBeginUser;
  for (PetscInt e = begin; e < s->nentry; e++) {
    const PetscInt i = s->entry_node[e], m = s->of_node[i];

    s->at_node[i] = -1;
    if (m >= 0) PetscCall(add_term(s, c->local_index[BodyCouplingGetMover(c, i)], k, m, e));
    if (c->node_body[i] >= 0) continue;
    PetscCall(ArrayReserve(s->npair + 1, &s->pair_capacity, &s->body, sizeof(*s->body), &s->at, sizeof(*s->at),
                           &s->of_pair, sizeof(*s->of_pair), NULL));
    s->body[s->npair]      = k;
    s->at[s->npair]        = i;
    s->of_pair[s->npair++] = (int)e;
  }
  for (PetscInt t = ntwo; t < s->ntwo; t++) s->at_two[s->two[2 * t]] = -1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Entries of the penalty by local bodies: of body k those from start[k] on of order */
static PetscErrorCode sort_penalty(FlowSolver fs, const PenaltyTerm *penalty, PetscInt **start, PetscInt **order)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  const PetscInt        n = penalty ? penalty->n : 0;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(c->nlocal + 2, start));
  PetscCall(PetscMalloc1(n, order));
  for (PetscInt e = 0; e < n; e++)
    if (ConstraintHasUnknown(c, penalty->body[e])) (*start)[c->local_index[penalty->body[e]] + 2]++;
  for (PetscInt k = 0; k < c->nlocal; k++) (*start)[k + 1] += (*start)[k];
  for (PetscInt e = 0; e < n; e++)
    if (ConstraintHasUnknown(c, penalty->body[e])) (*order)[(*start)[c->local_index[penalty->body[e]] + 1]++] = e;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode fill_lists(FlowSolver fs, const PenaltyTerm *penalty, Lists *s)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  const MeshLocal      *l = fs->loc;
  PetscInt             *start, *order;

  PetscFunctionBeginUser;
  list_arms(fs, s);
  PetscCall(sort_penalty(fs, penalty, &start, &order));
  for (PetscInt k = 0; k < c->nlocal; k++) {
    const PetscInt begin = s->nentry, cells = s->ncell;

    for (PetscInt m = s->first[k]; m < s->first[k + 1]; m++)
      for (PetscInt q = l->node_cell_ptr[s->node[m]]; q < l->node_cell_ptr[s->node[m] + 1]; q++)
        PetscCall(add_cell(l, s, l->node_cell[q]));
    for (PetscInt m = s->first[k]; m < s->first[k + 1]; m++) s->entry[m] = (int)s->at_node[s->node[m]];
    for (PetscInt e = start[k]; e < start[k + 1]; e++) {
      PetscInt entry = -1;

      PetscCall(find_entry(s, penalty->node[order[e]], &entry));
      s->of_penalty[e] = (int)entry;
    }
    for (PetscInt i = cells; i < s->ncell; i++) s->at_cell[s->cell[i]] = -1;
    PetscCall(sort_entries(fs, s, k, begin));
  }
  PetscCall(PetscFree(start));
  PetscCall(PetscFree(order));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- over to the device ---- */

static PetscErrorCode send_entries(FlowSolver fs, const Lists *s, DeviceEntries *on)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  CouplingOnDevice  *d = &fs->device.coupling;

  PetscFunctionBeginUser;
  PetscCall(FlowNearRenew(fs->flow, s->nentry, s->ncell, s->cell, s->cell_node, &d->near));
  PetscCall(DeviceRenew(q, s->narm, s->entry, &d->on.entry, &d->capacity[0]));
  PetscCall(DeviceRenew(q, s->narm * 4, s->arm, &d->on.arm, &d->capacity[1]));
  PetscCall(DeviceRenew(q, s->nentry * 6, NULL, &d->on.x, &d->capacity[2]));
  PetscCall(DeviceRenew(q, s->nentry * 6, NULL, &d->on.y, &d->capacity[3]));
  d->on.n    = (int)s->nentry;
  d->on.narm = (int)s->narm;
  *on        = d->on;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y of the entries = the operator times the arms, less G */
static PetscErrorCode multiply(FlowSolver fs, const Lists *s, const DeviceEntries *on)
{
  const DeviceQueue *q    = FlowGetQueue(fs->flow);
  CouplingOnDevice  *d    = &fs->device.coupling;
  const size_t       half = (size_t)s->nentry * 3;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->body.place_arms)(q, on));
  for (PetscInt k = 0; k < 2; k++) PetscCall(FlowNearMultiply(fs->flow, &d->near, on->x + k * half, on->y + k * half));
  PetscCall(DeviceRenew(q, s->npenalty, s->of_penalty, &d->list[0], &d->capacity[4]));
  PetscCallDevice(q, (*q->run->body.subtract_pairs)(q, &fs->device.body.penalty.on, d->list[0], on));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_pairs(FlowSolver fs, const Lists *s, const DeviceEntries *on)
{
  const DeviceQueue *q    = FlowGetQueue(fs->flow);
  CouplingOnDevice  *d    = &fs->device.coupling;
  RigidList         *list = &fs->device.body.coupling;

  PetscFunctionBeginUser;
  PetscCall(DevicePairsRenew(q, s->npair, ConstraintGetView(fs->constraint)->nlocal, 4, s->body, s->at, NULL, &list->on,
                             list->capacity));
  PetscCall(DeviceRenew(q, s->npair, s->of_pair, &d->list[0], &d->capacity[4]));
  PetscCallDevice(q, (*q->run->body.take_pairs)(q, on, (int)s->npair, d->list[0], (double *)list->on.value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* block [6][6] = R^T E summed over nodes, from sums [4][4] of the products of 1, x - X and the numbers of E */
static void fill_block(const PetscReal sum[], PetscReal block[])
{
  for (PetscInt e = 0; e < 36; e++) block[e] = 0;
  for (PetscInt k = 0; k < 4; k++) { /* the part of 1, and of the way along each axis */
    const PetscReal way[3] = {k == 1, k == 2, k == 3};
    PetscReal       R[18], E[18];

    RigidMapFill(3, k == 0, way, R);
    RigidMapFill(3, sum[k * 4], sum + k * 4 + 1, E);
    for (PetscInt e = 0; e < 36; e++)
      for (PetscInt a = 0; a < 3; a++) block[e] += R[a * 6 + e / 6] * E[a * 6 + e % 6];
  }
}

/* block [ntwo][6][6] on the host */
static PetscErrorCode sum_bodies(FlowSolver fs, const Lists *s, const DeviceEntries *on, PetscReal block[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  CouplingOnDevice  *d = &fs->device.coupling;
  int               *start, *arm, *entry;
  PetscReal         *sum;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(s->ntwo + 2, &start));
  PetscCall(PetscMalloc3(s->nterm, &arm, s->nterm, &entry, s->ntwo * 16, &sum));
  for (PetscInt t = 0; t < s->nterm; t++) start[s->term[3 * t] + 2]++;
  for (PetscInt k = 0; k < s->ntwo; k++) start[k + 1] += start[k];
  for (PetscInt t = 0; t < s->nterm; t++) {
    const int to = start[s->term[3 * t] + 1]++;

    arm[to]   = (int)s->term[3 * t + 1];
    entry[to] = (int)s->term[3 * t + 2];
  }
  PetscCall(DeviceRenew(q, s->ntwo + 1, start, &d->list[0], &d->capacity[4]));
  PetscCall(DeviceRenew(q, s->nterm, arm, &d->list[1], &d->capacity[5]));
  PetscCall(DeviceRenew(q, s->nterm, entry, &d->list[2], &d->capacity[6]));
  PetscCall(DeviceRenew(q, s->ntwo * 16, NULL, &d->sum, &d->capacity[7]));
  PetscCallDevice(q, (*q->run->body.sum_entries)(q, on, (int)s->ntwo, (int)s->nterm, d->list[0], d->list[1], d->list[2],
                                                 d->sum));
  PetscCallDevice(q, (*q->run->download)(q, (size_t)s->ntwo * 16 * sizeof(*sum), d->sum, sum));
  for (PetscInt k = 0; k < s->ntwo; k++) fill_block(sum + k * 16, block + k * 36);
  PetscCall(PetscFree(start));
  PetscCall(PetscFree3(arm, entry, sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverCoupleOnDevice(FlowSolver fs, const PenaltyTerm *penalty, const PetscReal *own[])
{
  Lists         s;
  DeviceEntries on;
  PetscReal    *block;

  PetscFunctionBeginUser;
  PetscCall(open_lists(fs, fs->device.body.penalty.on.n, &s));
  PetscCall(fill_lists(fs, penalty, &s));
  PetscCall(send_entries(fs, &s, &on));
  PetscCall(multiply(fs, &s, &on));
  PetscCall(take_pairs(fs, &s, &on));
  PetscCall(PetscMalloc1(s.ntwo * 36, &block));
  PetscCall(sum_bodies(fs, &s, &on, block));
  PetscCall(BodyCouplingSetBlocks(fs->body.coupling, penalty, s.ntwo, s.two, block, own));
  PetscCall(PetscFree(block));
  PetscCall(close_lists(&s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverFreeCouplingOnDevice(FlowSolver fs)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  CouplingOnDevice  *d = &fs->device.coupling;

  PetscFunctionBeginUser;
  PetscCall(FlowNearDestroy(fs->flow, &d->near));
  PetscCall(DeviceFree(q, &d->on.entry));
  PetscCall(DeviceFree(q, &d->on.arm));
  PetscCall(DeviceFree(q, &d->on.x));
  PetscCall(DeviceFree(q, &d->on.y));
  for (PetscInt k = 0; k < 3; k++) PetscCall(DeviceFree(q, &d->list[k]));
  PetscCall(DeviceFree(q, &d->sum));
  PetscCall(PetscFree3(d->of_node, d->at_node, d->at_cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}
