/* Fitted: see fitted.h. The mesh does not move, so the cells at the boundary are listed once; the work of a step is
   proportional to their number. */
#include "compat.h"
#include "fitted.h"
#include "base/algebra.h"
#include "bodies/local.h"

typedef struct {
  PetscInt        body, nnode, ncell; /* permanent number; own and ghost nodes; own cells with a node on the boundary */
  const PetscInt *node;               /* of the mesh */
  PetscInt       *cell;
  PetscReal       x[3], volume; /* of the body; 0 where it is not known */
} Surface;

struct _p_Fitted {
  Mesh             mesh;
  Flow             flow;
  Bodies           bodies;
  BodyState       *s;
  const MeshLocal *loc;
  PetscInt         n;
  Surface         *surface;
  PetscInt        *on; /* [nnode_all] number of the body on whose surface the node lies, or -1 */
};

/* ---- set-up ---- */

static PetscErrorCode check_surface(Fitted h, const BodyGroup *g, const Surface *s)
{
  const PetscInt dim = h->loc->dim, k = BodiesFind(h->s, s->body);
  PetscReal      worst = 0, radius = g->largest * g->radius;

  PetscFunctionBeginUser;
  PetscCheck(k >= 0 || !s->nnode, PETSC_COMM_SELF, PETSC_ERR_PLIB, "A rank at the surface of body %" PetscInt_FMT " does not know it", s->body);
  for (PetscInt i = 0; i < s->nnode; i++) {
    PetscReal d;

    PetscCall(BodiesDistance(h->bodies, k, h->s->x[k], NULL, 1, h->loc->x + s->node[i] * dim, &d));
    worst = PetscMax(worst, PetscAbsReal(d));
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &worst, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  PetscCheck(worst <= 0.1 * radius, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "Boundary '%s' of the mesh is no surface of group '%s': it has points %g away from the surface, the limit is a tenth of the radius %g. "
             "Correct -particle_%s_position, _angle and the size of the shape, or rename the group",
             g->name, g->name, (double)worst, (double)radius, g->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode list_cells(Fitted h, Surface *s)
{
  const MeshLocal *l = h->loc;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->nnode; i++) h->on[s->node[i]] = s->body;
  PetscCall(PetscMalloc1(l->ncell, &s->cell));
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscBool touches = PETSC_FALSE;

    for (PetscInt j = 0; j < l->nb; j++) touches = (PetscBool)(touches || h->on[l->cell_node[c * l->nb + j]] == s->body);
    if (touches) s->cell[s->ncell++] = c;
  }
  PetscCall(PetscRealloc(PetscMax(1, s->ncell) * sizeof(PetscInt), &s->cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_surface(Fitted h, const BodyGroup *g, PetscInt boundary)
{
  Surface *s = h->surface + h->n;
  PetscInt k;

  PetscFunctionBeginUser;
  PetscCheck(g->count == 1 && !g->free, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "Boundary '%s' of the mesh is the surface of group '%s', which has %" PetscInt_FMT
             " bodies%s. A group with the name of a boundary is the body behind it: one body, which does not move: set -particle_%s_free none and one position, or "
             "rename the group",
             g->name, g->name, g->count, g->free ? ", free to move" : "", g->name);
  if (!g->hole) PetscCall(BodiesMigrate(h->bodies, 0, 1)); /* known where its surface is */
  PetscCall(BodiesSetHole(h->bodies, (PetscInt)(g - h->s->group)));
  s->body = g->first;
  k       = BodiesFind(h->s, s->body);
  if (k >= 0) {
    PetscCall(PetscArraycpy(s->x, h->s->x[k], 3));
    PetscCall(BodiesGetVolume(h->bodies, k, &s->volume));
  }
  PetscCall(MeshGetBoundaryNodes(h->mesh, boundary, &s->nnode, &s->node));
  PetscCall(check_surface(h, g, s));
  PetscCall(list_cells(h, s));
  h->n++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FittedCreate(Flow flow, Bodies bodies, Fitted *hole)
{
  Fitted h;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&h));
  h->flow   = flow;
  h->bodies = bodies;
  PetscCall(FlowGetMesh(flow, &h->mesh));
  PetscCall(MeshGetLocal(h->mesh, &h->loc));
  PetscCall(BodiesGetState(bodies, &h->s));
  PetscCall(PetscCalloc2(h->s->ngroups, &h->surface, h->loc->nnode_all, &h->on));
  for (PetscInt i = 0; i < h->loc->nnode_all; i++) h->on[i] = -1;
  for (PetscInt g = 0; g < h->s->ngroups; g++) {
    PetscInt boundary;

    PetscCall(MeshFindBoundary(h->mesh, h->s->group[g].name, &boundary));
    if (boundary >= 0) PetscCall(add_surface(h, h->s->group + g, boundary));
  }
  *hole = h;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FittedDestroy(Fitted *hole)
{
  Fitted h = *hole;

  PetscFunctionBeginUser;
  if (!h) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < h->n; i++) PetscCall(PetscFree(h->surface[i].cell));
  PetscCall(PetscFree2(h->surface, h->on));
  PetscCall(PetscFree(*hole));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FittedGetNodeBody(Fitted h, const PetscInt *node_body[])
{
  PetscFunctionBeginUser;
  *node_body = h->on;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- motion ---- */

static void add_moment(const PetscReal r[3], const PetscReal f[3], PetscReal torque[3])
{
  for (PetscInt d = 0; d < 3; d++) torque[d] += r[(d + 1) % 3] * f[(d + 2) % 3] - r[(d + 2) % 3] * f[(d + 1) % 3];
}

/* Angular velocity of the rigid motion nearest to the values v on the own nodes: J w = sum of r x v, with r from the
   nodes' mean */
static PetscErrorCode fit_rotation(Fitted h, const Surface *s, const PetscReal v[], PetscReal w[3])
{
  const MeshLocal *l       = h->loc;
  PetscReal        mean[4] = {0, 0, 0, 0}, sum[9] = {0}; /* x, number of nodes; r x v, then |r|^2 - r r^T as xx yy zz xy
                                                            xz yz */

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->nnode; i++) {
    if (s->node[i] >= l->nnode) continue;
    for (PetscInt d = 0; d < l->dim; d++) mean[d] += l->x[s->node[i] * l->dim + d];
    mean[3]++;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, mean, 4, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  for (PetscInt i = 0; i < s->nnode; i++) {
    PetscReal r[3] = {0, 0, 0}, a[3] = {0, 0, 0};

    if (s->node[i] >= l->nnode) continue;
    for (PetscInt d = 0; d < l->dim; d++) {
      r[d] = l->x[s->node[i] * l->dim + d] - mean[d] / mean[3];
      a[d] = v[s->node[i] * l->dim + d];
    }
    add_moment(r, a, sum);
    for (PetscInt d = 0; d < 3; d++) {
      sum[3 + d] += r[(d + 1) % 3] * r[(d + 1) % 3] + r[(d + 2) % 3] * r[(d + 2) % 3];
      sum[6 + d] -= r[d == 2] * r[d == 0 ? 1 : 2];
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 9, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  if (l->dim == 2) {
    w[0] = w[1] = 0;
    w[2]        = sum[2] / sum[5];
  } else {
    const PetscReal J[9] = {sum[3], sum[6], sum[7], sum[6], sum[4], sum[8], sum[7], sum[8], sum[5]};
    PetscReal       inv[9];

    DenseInvert(3, J, inv);
    for (PetscInt d = 0; d < 3; d++) w[d] = inv[3 * d] * sum[0] + inv[3 * d + 1] * sum[1] + inv[3 * d + 2] * sum[2];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FittedSetMotion(Fitted h)
{
  const PetscInt  *fixed;
  const PetscReal *value;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(h->flow), &fixed, &value));
  for (PetscInt i = 0; i < h->n; i++) {
    Surface       *s = h->surface + i;
    const PetscInt k = BodiesFind(h->s, s->body);
    PetscReal      w[3];

    PetscCall(fit_rotation(h, s, value, w));
    if (k >= 0) PetscCall(BodiesSetVelocity(h->bodies, k, NULL, w));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- force ---- */

/* What one cell adds: residual to f[0], f[1] (force, torque), volume integral to f[2], f[3] */
static PetscErrorCode add_cell(Fitted h, const Surface *s, PetscInt cell, const PetscReal u[], const PetscReal p[], PetscReal (*f)[3])
{
  const MeshLocal *l    = h->loc;
  const PetscInt  *node = l->cell_node + cell * l->nb, dim = l->dim;
  const PetscReal *X = s->x;
  PetscReal        r[MESH_MAX_NB * 3], alpha[MESH_MAX_NB];

  PetscFunctionBeginUser;
  PetscCall(FlowCellResidual(h->flow, cell, u, p, r));
  for (PetscInt j = 0; j < l->nb; j++) {
    PetscReal arm[3] = {0, 0, 0}, pull[3] = {0, 0, 0};

    alpha[j] = h->on[node[j]] == s->body;
    if (h->on[node[j]] != s->body) continue;
    for (PetscInt d = 0; d < dim; d++) {
      arm[d]  = MeshNearest(l, d, l->x[node[j] * dim + d] - X[d]);
      pull[d] = -r[j * dim + d];
      f[0][d] += pull[d];
    }
    add_moment(arm, pull, f[1]);
  }
  PetscCall(FlowCellStressForce(h->flow, cell, u, p, alpha, X, f[2], f[3]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FittedForce(Fitted h, const PetscReal u[], const PetscReal p[], PetscReal (*force)[3], PetscReal (*torque)[3],
                           PetscReal (*volume_force)[3], PetscReal (*volume_torque)[3])
{
  const FlowParameters *par;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(h->flow, &par));
  for (PetscInt i = 0; i < h->n; i++) {
    const Surface *s       = h->surface + i;
    const PetscInt k       = BodiesFind(h->s, s->body);
    PetscReal      f[4][3] = {{0}};

    for (PetscInt c = 0; c < s->ncell; c++) PetscCall(add_cell(h, s, s->cell[c], u, p, f));
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, f, 12, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
    for (PetscInt d = 0; d < 3 && k >= 0; d++) {
      if (!par->varying) f[1][d] -= 2 * par->solvent * s->volume * h->s->w[k][d]; /* gradient form */
      if (force) force[k][d] = f[0][d];
      if (torque) torque[k][d] = f[1][d];
      if (volume_force) volume_force[k][d] = f[2][d];
      if (volume_torque) volume_torque[k][d] = f[3][d];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FittedView(Fitted h, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < h->s->ngroups; g++)
    if (h->s->group[g].hole)
      PetscCall(PetscViewerASCIIPrintf(viewer,
                                       "  group %s is the body behind boundary %s of the mesh: the flow ends there (-flow_bc_%s_type), nothing is "
                                       "marked inside\n",
                                       h->s->group[g].name, h->s->group[g].name, h->s->group[g].name));
  PetscFunctionReturn(PETSC_SUCCESS);
}
