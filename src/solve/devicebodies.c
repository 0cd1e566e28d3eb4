/* FlowSolver on a device: what bodies have in its operators. Lists of pairs of nodes and bodies go over once a step;
   rigid slots, six numbers a body, come to the host in every product, where ties and the rows of bodies are made as
   without a device. Fields stay where they are. */
#include "compat.h"
#include "impl.h"
#include "base/array.h"

/* Pairs as they are collected, on the host */
typedef struct {
  PetscInt   n, *body, *node;
  PetscReal *arm; /* [n][4] */
} Pairs;

static PetscErrorCode open_pairs(PetscInt most, Pairs *p)
{
  PetscFunctionBeginUser;
  p->n = 0;
  PetscCall(PetscMalloc3(most, &p->body, most, &p->node, most * 4, &p->arm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* without: bits of components that have no part */
static void add_pair(Pairs *p, PetscInt body, PetscInt node, PetscInt without, PetscReal weight, const PetscReal arm[])
{
  PetscReal *to = p->arm + p->n * 4;

  p->body[p->n]   = body;
  p->node[p->n++] = node | without << DEVICE_NODE_BITS;
  to[0]           = weight;
  for (PetscInt a = 0; a < 3; a++) to[1 + a] = arm[a];
}

/* Over to the device, by bodies */
static PetscErrorCode close_pairs(FlowSolver fs, Pairs *p, RigidList *list)
{
  PetscFunctionBeginUser;
  PetscCall(DevicePairsRenew(FlowGetQueue(fs->flow), p->n, ConstraintGetView(fs->constraint)->nlocal, 4, p->body,
                             p->node, p->arm, &list->on, list->capacity));
  PetscCall(PetscFree3(p->body, p->node, p->arm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- lists of a step ---- */

static void find_arm(const ConstraintView *c, PetscInt i, PetscInt k, PetscReal arm[3])
{
  for (PetscInt a = 0; a < 3; a++) arm[a] = MeshNearest(c->loc, a, c->loc->x[i * 3 + a] - c->X[k][a]);
}

/* Own nodes that bodies hold, or that follow one: rows of P, and of the latter what M_r^{-1} adds */
static PetscErrorCode list_rigid_nodes(FlowSolver fs)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  Pairs                 place, relative;

  PetscFunctionBeginUser;
  PetscCall(open_pairs(c->nbody_nodes, &place));
  PetscCall(open_pairs(c->nbody_nodes, &relative));
  for (PetscInt e = 0; e < c->nbody_nodes; e++) {
    const PetscInt i = c->body_node[e], k = ConstraintGetMover(c, i), held = c->node_body[i] >= 0;
    const PetscInt without = held ? 0 : c->fixed[i];
    PetscReal      arm[3], fraction;

    if (i >= fs->loc->nnode || !ConstraintHasUnknown(c, k) || without == 7) continue;
    find_arm(c, i, k, arm);
    add_pair(&place, c->local_index[k], i, without, 1, arm);
    if (held) continue;
    fraction = 1 - fs->body.fraction[i];
    for (PetscInt a = 0; a < 3; a++) arm[a] *= fraction;
    add_pair(&relative, c->local_index[k], i, without, fraction, arm);
  }
  PetscCall(close_pairs(fs, &place, &fs->device.body.place));
  PetscCall(close_pairs(fs, &relative, &fs->device.body.relative));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverListPenaltyOnDevice(FlowSolver fs)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  const PenaltyTerm    *s = FlowSolverHasPenalty(fs) ? fs->body.penalty : NULL;
  Pairs                 p;

  PetscFunctionBeginUser;
  PetscCall(open_pairs(s ? s->n : 0, &p));
  for (PetscInt e = 0; s && e < s->n; e++)
    if (ConstraintHasUnknown(c, s->body[e]))
      add_pair(&p, c->local_index[s->body[e]], s->node[e], 0, s->g[e * 4], s->g + e * 4 + 1);
  PetscCall(close_pairs(fs, &p, &fs->device.body.penalty));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes whose mass a penalty adds to, each once: it is relative to one body */
static PetscErrorCode list_cut_nodes(FlowSolver fs)
{
  const PenaltyTerm *s = FlowSolverHasPenalty(fs) ? fs->body.penalty : NULL;
  BodiesOnDevice    *b = &fs->device.body;

  PetscFunctionBeginUser;
  b->ncut = 0;
  PetscCall(ArrayReserve(s ? s->n : 0, &b->cut_capacity, &b->cut, sizeof(*b->cut), NULL));
  for (PetscInt e = 0; s && e < s->n; e++)
    if (s->body[e] == s->relative_to[s->node[e]]) b->cut[b->ncut++] = s->node[e];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Pressures of cells all of whose nodes bodies hold, the one in the middle too */
static PetscErrorCode list_rigid_cells(FlowSolver fs)
{
  const ConstraintView *c  = ConstraintGetView(fs->constraint);
  const PetscInt        nk = fs->loc->dim + 1;
  BodiesOnDevice       *b  = &fs->device.body;
  int                  *slot;

  PetscFunctionBeginUser;
  b->nrigid = 0;
  PetscCall(PetscMalloc1(c->nbody_nodes * nk, &slot));
  for (PetscInt e = 0; e < c->nbody_nodes; e++) {
    const PetscInt cell = fs->loc->centre_cell[c->body_node[e]];

    if (cell < 0 || cell >= fs->loc->ncell || !FlowSolverCellIsRigid(fs, cell)) continue;
    for (PetscInt k = 0; k < nk; k++) slot[b->nrigid++] = (int)(cell * nk + k);
  }
  PetscCall(DeviceRenew(FlowGetQueue(fs->flow), b->nrigid, slot, &b->rigid, &b->rigid_capacity));
  PetscCall(PetscFree(slot));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode list_coupling(FlowSolver fs)
{
  struct _p_BodyCouplingView v;
  Pairs                      p;

  PetscFunctionBeginUser;
  BodyCouplingGetView(fs->body.coupling, &v);
  PetscCall(open_pairs(v.nnode ? v.start[v.nnode] : 0, &p));
  for (PetscInt i = 0; i < v.nnode; i++)
    for (PetscInt e = v.start[i]; e < v.start[i + 1]; e++)
      add_pair(&p, v.body[e], v.node[i], 0, v.e[e * 4], v.e + e * 4 + 1);
  PetscCall(close_pairs(fs, &p, &fs->device.body.coupling));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverListBodiesOnDevice(FlowSolver fs)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  const size_t       n = (size_t)(ConstraintGetView(fs->constraint)->nlocal * fs->nr);
  BodiesOnDevice    *b = &fs->device.body;

  PetscFunctionBeginUser;
  if (!fs->nbodies) PetscFunctionReturn(PETSC_SUCCESS);
  if (!b->here)
    PetscCall(PetscCalloc2(2 * fs->capacity * fs->nr, &b->here, 2 * ConstraintGetView(fs->constraint)->count * fs->nr,
                           &b->slots));
  PetscCall(DeviceRenew(q, n, NULL, &b->U, &b->capacity[0]));
  PetscCall(DeviceRenew(q, 2 * n, NULL, &b->sum, &b->capacity[1]));
  PetscCall(list_rigid_nodes(fs));
  if (!FlowSolverCouplesOnDevice(fs)) {
    PetscCall(FlowSolverListPenaltyOnDevice(fs));
    PetscCall(list_coupling(fs));
  }
  PetscCall(list_cut_nodes(fs));
  PetscCall(list_rigid_cells(fs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverFreeBodiesOnDevice(FlowSolver fs)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  BodiesOnDevice    *b = &fs->device.body;

  PetscFunctionBeginUser;
  PetscCall(DevicePairsDestroy(q, &b->place.on));
  PetscCall(DevicePairsDestroy(q, &b->penalty.on));
  PetscCall(DevicePairsDestroy(q, &b->coupling.on));
  PetscCall(DevicePairsDestroy(q, &b->relative.on));
  PetscCall(DeviceFree(q, &b->U));
  PetscCall(DeviceFree(q, &b->sum));
  PetscCall(DeviceFree(q, &b->rigid));
  PetscCall(PetscFree2(b->here, b->slots));
  PetscCall(PetscFree(b->cut));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- between the host and the device ---- */

/* v [nlocal][nr] without what is known */
static void leave_unknown(const ConstraintView *c, PetscReal v[])
{
  for (PetscInt e = 0; e < c->nlocal * c->nr; e++)
    if (!ConstraintIsUnknown(c, c->local_list[e / c->nr], e % c->nr)) v[e] = 0;
}

/* Rigid velocities of the slots here go over to the local bodies */
PetscErrorCode FlowSolverSpreadSlots(FlowSolver fs, const PetscReal slots[])
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  const DeviceQueue    *q = FlowGetQueue(fs->flow);
  PetscReal            *U = fs->device.body.here;

  PetscFunctionBeginUser;
  PetscCall(ConstraintFetchRigid(fs->constraint, slots));
  PetscCall(PetscArraycpy(U, c->local_rigid, c->nlocal * c->nr));
  leave_unknown(c, U);
  PetscCallDevice(q, (*q->run->upload)(q, (size_t)(c->nlocal * c->nr) * sizeof(*U), U, fs->device.body.U));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* n sums of local bodies come here, [n][nlocal][nr] */
static PetscErrorCode bring_sums(FlowSolver fs, PetscInt n, PetscReal here[])
{
  const ConstraintView *c    = ConstraintGetView(fs->constraint);
  const DeviceQueue    *q    = FlowGetQueue(fs->flow);
  const PetscInt        size = c->nlocal * c->nr;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->download)(q, (size_t)(n * size) * sizeof(*here), fs->device.body.sum, here));
  for (PetscInt i = 0; i < n; i++) leave_unknown(c, here + i * size);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the velocity operator ---- */

PetscErrorCode FlowSolverExpandOnDevice(FlowSolver fs, PetscReal v[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  BodiesOnDevice    *b = &fs->device.body;

  PetscFunctionBeginUser;
  if (!fs->nbodies) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowSolverBringSlots(fs, v, b->slots));
  PetscCall(FlowSolverSpreadSlots(fs, b->slots));
  PetscCallDevice(q, (*q->run->body.add_rigid)(q, &b->place.on, 1, b->U, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverReduceOnDevice(FlowSolver fs, const PetscReal v[], PetscReal y[])
{
  const ConstraintView *c    = ConstraintGetView(fs->constraint);
  const DeviceQueue    *q    = FlowGetQueue(fs->flow);
  BodiesOnDevice       *b    = &fs->device.body;
  const PetscInt        n    = c->nlocal * fs->nr;
  PetscReal            *rows = b->slots + c->count * fs->nr;

  PetscFunctionBeginUser;
  if (!fs->nbodies) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallDevice(q, (*q->run->body.add_rigid)(q, &b->penalty.on, -1, b->U, y));
  PetscCallDevice(q, (*q->run->body.sum_rigid)(q, &b->penalty.on, -1, v, b->sum));
  PetscCallDevice(q, (*q->run->body.sum_rigid)(q, &b->place.on, 1, y, b->sum + n));
  PetscCall(bring_sums(fs, 2, b->here));
  for (PetscInt e = 0; e < n; e++) b->here[e] += b->here[n + e];
  ContactCouplingMultAdd(fs->body.contact_coupling, PETSC_FALSE, 1, c->local_rigid, b->here);
  FlowSolverMultBodies(fs, b->slots, rows);
  PetscCall(ConstraintDeliverRigid(fs->constraint, b->here, rows));
  PetscCall(FlowSolverSendSlots(fs, rows, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverReduceIntoOnDevice(FlowSolver fs, PetscReal slots[], PetscReal y[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  BodiesOnDevice    *b = &fs->device.body;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->body.sum_rigid)(q, &b->place.on, 1, y, b->sum));
  PetscCall(bring_sums(fs, 1, b->here));
  PetscCall(ConstraintDeliverRigid(fs->constraint, b->here, slots));
  PetscCall(FlowSolverSendSlots(fs, slots, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverReducePlainOnDevice(FlowSolver fs, PetscReal y[])
{
  PetscReal *slots = fs->device.body.slots;

  PetscFunctionBeginUser;
  if (!fs->nbodies) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArrayzero(slots, ConstraintGetView(fs->constraint)->count * fs->nr));
  PetscCall(FlowSolverReduceIntoOnDevice(fs, slots, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- its preconditioner ---- */

PetscErrorCode FlowSolverBodiesBeforeOnDevice(FlowSolver fs, const PetscReal b[], PetscReal r[])
{
  const DeviceQueue *q    = FlowGetQueue(fs->flow);
  BodiesOnDevice    *d    = &fs->device.body;
  PetscReal         *rows = d->slots + ConstraintGetView(fs->constraint)->count * fs->nr;

  PetscFunctionBeginUser;
  PetscCall(FlowSolverBringSlots(fs, b, rows));
  FlowSolverSolveBodies(fs, rows, d->slots);
  PetscCall(FlowSolverSpreadSlots(fs, d->slots));
  PetscCallDevice(q, (*q->run->body.add_rigid)(q, &d->coupling.on, -1, d->U, r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverBodiesAfterOnDevice(FlowSolver fs, PetscReal x[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  BodiesOnDevice    *d = &fs->device.body;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->body.sum_rigid)(q, &d->coupling.on, -1, x, d->sum));
  PetscCall(bring_sums(fs, 1, d->here));
  PetscCall(BodyCouplingAnswerBodies(fs->body.coupling, ConstraintGetView(fs->constraint)->local_rigid, d->here));
  PetscCall(FlowSolverAnswerBodies(fs, d->here, d->slots));
  PetscCall(FlowSolverSendSlots(fs, d->slots, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the mass ---- */

PetscErrorCode FlowSolverMassOfBodiesOnDevice(FlowSolver fs, const PetscReal x[], PetscReal y[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  BodiesOnDevice    *b = &fs->device.body;
  PetscReal         *t = b->slots, *out = t + ConstraintGetView(fs->constraint)->count * fs->nr;

  PetscFunctionBeginUser;
  if (!fs->nbodies) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowSolverBringSlots(fs, x, t));
  if (FlowSolverHasPenalty(fs)) {
    PetscCallDevice(q, (*q->run->body.sum_rigid)(q, &b->relative.on, -1, x, b->sum));
    PetscCall(bring_sums(fs, 1, b->here));
    PetscCall(ConstraintDeliverRigid(fs->constraint, b->here, t));
  }
  PetscCall(FlowSolverInvertMasses(fs, t, out));
  PetscCall(FlowSolverSendSlots(fs, out, y));
  if (!FlowSolverHasPenalty(fs)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowSolverSpreadSlots(fs, out));
  PetscCallDevice(q, (*q->run->body.add_rigid)(q, &b->relative.on, -1, b->U, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}
