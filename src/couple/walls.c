/* Couple, walls: the boundary of the domain as a participant. What its walls and openings add to the balance of
   momentum, and the power of what acts on the fluid from outside. */
#include "compat.h"
#include "impl.h"
#include "flow/device.h"

struct _p_Walls {
  Boundaries boundaries;
  PetscInt   nrim, *rim; /* own nodes of the boundary, and their normals [nrim][dim], of the domain without bodies */
  PetscReal *outward;
  PetscReal  supplied; /* power of prescribed nodes on this rank, of the last balance */
  /* where fields stay on a device, or NULL: nodes of the boundary, its points, residuals there */
  FlowDeviceList list;
  PetscInt      *node, *point;
  PetscReal     *residual;
};

/* How many own nodes have a normal longer than `min`, and which (rim, or NULL) */
static PetscInt list_rim(const MeshLocal *l, const PetscReal normal[], PetscReal min, PetscInt rim[])
{
  PetscInt n = 0;

  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal size = 0;

    for (PetscInt a = 0; a < l->dim; a++) size = PetscMax(size, PetscAbsReal(normal[i * l->dim + a]));
    if (size <= min) continue;
    if (rim) rim[n] = i;
    n++;
  }
  return n;
}

/* Nodal normals, area included and pointing out: int phi_i n over the boundary of the domain, as B^T 1, at the own
   nodes where it is more than round-off */
static PetscErrorCode find_normals(Couple c, Walls w)
{
  const MeshLocal *l  = c->loc;
  const PetscInt   nk = l->dim + 1;
  PetscReal       *one, *normal, largest = 0;
  PetscInt         nrim;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(l->ncell * nk, &one, l->nnode_all * l->dim, &normal));
  for (PetscInt e = 0; e < l->ncell; e++) one[e * nk] = 1;
  PetscCall(FlowGradient(c->flow, 1, one, normal));
  for (PetscInt i = 0; i < l->nnode * l->dim; i++) largest = PetscMax(largest, PetscAbsReal(normal[i]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &largest, 1, MPIU_REAL, MPIU_MAX, c->comm));
  nrim = list_rim(l, normal, 1e-12 * largest, NULL);
  PetscCall(PetscMalloc2(nrim, &w->rim, nrim * l->dim, &w->outward));
  w->nrim = list_rim(l, normal, 1e-12 * largest, w->rim);
  for (PetscInt i = 0; i < nrim; i++)
    PetscCall(PetscArraycpy(w->outward + i * l->dim, normal + w->rim[i] * l->dim, l->dim));
  PetscCall(PetscFree2(one, normal));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- where fields stay on a device ---- */

static PetscErrorCode list_boundary(Couple c, Walls w)
{
  const MeshLocal     *l = c->loc;
  const BoundaryPoint *point;
  const PetscInt      *cell;
  PetscInt             ncell, npoint, n = 0;
  PetscBool           *on;

  PetscFunctionBeginUser;
  PetscCall(BoundariesGetPoints(w->boundaries, &ncell, &cell, &npoint, &point));
  PetscCall(PetscMalloc3(l->nnode, &w->node, npoint, &w->point, npoint * l->dim, &w->residual));
  PetscCall(PetscCalloc1(l->nnode_all, &on));
  for (PetscInt i = 0; i < w->nrim; i++) on[w->rim[i]] = PETSC_TRUE;
  for (PetscInt i = 0; i < npoint; i++) {
    on[point[i].node] = PETSC_TRUE;
    w->point[i]       = point[i].cell * l->nb + point[i].slot;
  }
  for (PetscInt i = 0; i < l->nnode; i++)
    if (on[i]) w->node[n++] = i;
  PetscCall(PetscFree(on));
  PetscCall(FlowListCreate(c->flow, n, w->node, ncell, cell, npoint, w->point, &w->list));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocities and pressures that the boundary wants, and its residuals */
static PetscErrorCode take_boundary(Couple c, Walls w)
{
  PetscFunctionBeginUser;
  if (!w->list) PetscCall(list_boundary(c, w));
  PetscCall(FlowListTake(c->flow, w->list, c->field.u, c->field.p, w->residual));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- momentum ---- */

/* out [dim] = residual r at a node less what others give it there, which the first cell of the node takes */
static void take_given(PetscInt dim, const PetscReal r[], PetscReal given[], PetscReal out[])
{
  for (PetscInt a = 0; a < dim; a++) out[a] = r[a] - (given ? given[a] : 0);
  for (PetscInt a = 0; a < dim && given; a++) given[a] = 0;
}

/* What prescribed components supply: sums of the momentum residual over walls and over openings (holes are bodies
   and left out, as are nodes that belong to a body), and *size, the sum of the sizes, by which errors are measured
   (in a closed box the forces of the walls cancel); kept for CoupleGetPower the power of all of them, holes too */
static PetscErrorCode sum_prescribed(Couple c, Walls w, PetscReal walls[3], PetscReal openings[3], PetscReal *size)
{
  const PetscInt       dim = c->loc->dim, nr = c->loc->nb * dim, *cell, *body;
  const unsigned char *fixed;
  const BoundaryPoint *point;
  const PetscBool      there = FlowStaysOnDevice(c->flow);
  PetscInt             ncell, n, done = 0;
  PetscReal            sum[8] = {0}, several[FLOW_CELLS * MESH_MAX_NB * 3], r[3], *given;

  PetscFunctionBeginUser;
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  if (c->ale || c->method.sides_move) PetscCall(BoundariesUpdate(w->boundaries));
  PetscCall(BoundariesBegin(w->boundaries));
  PetscCall(BoundariesGetPoints(w->boundaries, &ncell, &cell, &n, &point));
  if (there) PetscCall(take_boundary(c, w));
  PetscCall(CoupleGetGiven(c, &given));
  for (const BoundaryPoint *at = point; at < point + n; at++) {
    const PetscReal *u  = c->field.u + at->node * dim;
    const PetscReal *of = there ? w->residual + (at - point) * dim
                                : several + at->cell % FLOW_CELLS * nr + at->slot * dim;

    if (at->cell == done && !there) {
      PetscCall(
        FlowCellResiduals(c->flow, PetscMin(FLOW_CELLS, ncell - done), cell + done, c->field.u, c->field.p, several));
      done += FLOW_CELLS;
    }
    if (body[at->node] >= 0) continue;
    take_given(dim, of, given ? given + at->node * dim : NULL, r);
    if (!at->fitted) PetscCall(BoundariesAdd(w->boundaries, at, r, c->field.p));
    for (PetscInt a = 0; a < dim; a++) {
      if (at->owner[a] < 0) continue;
      sum[7] += r[a] * u[a];
      if (at->fitted) continue;
      sum[((at->wall >> a) & 1 ? 0 : 3) + a] += r[a];
      sum[6] += PetscAbsReal(r[a]);
    }
  }
  if (c->method.table->force) {
    PetscCall(ConditionsGetValues(FlowConditions(c->flow), &fixed, NULL));
    PetscCall((*c->method.table->force)(c, c->method.data, fixed, sum));
  }
  PetscCall(BoundariesFinish(w->boundaries, c->field.u));
  PetscCall(PetscFree(given));
  w->supplied = sum[7];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 7, MPIU_REAL, MPIU_SUM, c->comm));
  PetscCall(PetscArraycpy(walls, sum, 3));
  PetscCall(PetscArraycpy(openings, sum + 3, 3));
  *size = sum[6];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode balance_walls(Couple c, void *data, const FlowDiagnostics *d, CoupleBalance *b)
{
  PetscReal openings[3];

  PetscFunctionBeginUser;
  (void)d;
  PetscCall(sum_prescribed(c, (Walls)data, b->walls, openings, &b->size));
  for (PetscInt a = 0; a < 3; a++) {
    b->openings[a] += openings[a];
    b->residual[a] -= b->walls[a];
    b->residual[a] -= openings[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- power ---- */

/* Power of the pressure at openings */
static PetscErrorCode add_traction(Couple c, PetscReal *power)
{
  const MeshLocal *l = c->loc;
  PetscReal       *force;

  PetscFunctionBeginUser;
  if (!FlowHasTraction(c->flow)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowTakeSolution(c->flow, c->field.u, c->field.p));
  PetscCall(PetscCalloc1(l->nnode_all * l->dim, &force));
  PetscCall(FlowAddTraction(c->flow, force));
  for (PetscInt i = 0; i < l->nnode_all * l->dim; i++) *power += force[i] * c->field.u[i];
  PetscCall(PetscFree(force));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Kinetic energy that flows in through the boundary, and the power of -flow_force */
static PetscErrorCode add_fluid(Couple c, const struct _p_Walls *w, PetscReal *power, PetscReal *inflow)
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim;
  const PetscReal *m, *source;
  PetscBool        driven = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(c->flow, &m));
  PetscCall(FlowGetSource(c->flow, &source));
  for (PetscInt a = 0; a < dim; a++) driven = (PetscBool)(driven || source || c->par->force[a] != 0);
  if (driven) PetscCall(FlowTakeSolution(c->flow, c->field.u, c->field.p));
  for (PetscInt i = 0; i < l->nnode && driven; i++)
    for (PetscInt a = 0; a < dim; a++)
      *power += (c->par->force[a] + (source ? source[i * dim + a] : 0)) * m[i] * c->field.u[i * dim + a];
  for (PetscInt i = 0; i < w->nrim; i++) {
    const PetscReal *u   = c->field.u + w->rim[i] * dim;
    PetscReal        out = 0, square = 0;

    for (PetscInt a = 0; a < dim; a++) {
      out += w->outward[i * dim + a] * (u[a] - c->step->frame[a]);
      square += u[a] * u[a];
    }
    if (out < 0) *inflow -= 0.5 * c->par->density * square * out;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_power(Couple c, void *data, CouplePower *out)
{
  Walls     w        = (Walls)data;
  PetscReal power[2] = {w->supplied, 0};

  PetscFunctionBeginUser;
  PetscCall(add_fluid(c, w, power, power + 1));
  PetscCall(add_traction(c, power));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, power, 2, MPIU_REAL, MPIU_SUM, c->comm));
  out->power += power[0] + power[1];
  out->inflow += power[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode discard(Couple c, void *data)
{
  Walls w = (Walls)data;

  PetscFunctionBeginUser;
  PetscCall(FlowListDestroy(c->flow, &w->list));
  PetscCall(PetscFree3(w->node, w->point, w->residual));
  PetscCall(BoundariesDestroy(&w->boundaries));
  PetscCall(PetscFree2(w->rim, w->outward));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_on_mesh(Couple c, void *data, Mesh *old)
{
  Walls w = (Walls)data;

  PetscFunctionBeginUser;
  (void)old;
  PetscCall(BoundariesCreate(c->flow, c->fitted, &w->boundaries));
  PetscCall(find_normals(c, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Couple c, void *data)
{
  PetscFunctionBeginUser;
  (void)data;
  PetscCall(PetscFree(c->walls));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant WALLS = {.name         = "walls",
                                        .balance      = balance_walls,
                                        .energy       = add_power,
                                        .discard      = discard,
                                        .after_remesh = make_on_mesh,
                                        .destroy      = destroy};

PetscErrorCode CoupleAddWalls(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c->walls));
  PetscCall(CoupleAddParticipant(c, &WALLS, c->walls));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAddWallForce(Couple c, PetscInt b, const PetscReal force[3])
{
  PetscFunctionBeginUser;
  PetscCall(BoundariesAddForce(c->walls->boundaries, b, force));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetBoundaries(Couple c, PetscInt *n, const CoupleBoundary *boundary[])
{
  PetscFunctionBeginUser;
  PetscCall(BoundariesGet(c->walls->boundaries, n, boundary));
  PetscFunctionReturn(PETSC_SUCCESS);
}
