/* Fitted: see fitted.h. The mesh does not move, so the cells at the boundary are listed once; the work of a step is
   proportional to their number. */
#include "compat.h"
#include "fitted.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/domain.h"
#include "bodies/local.h"

/* How far, in radii, places of a boundary may be from the body whose surface it is: by its name, by its place alone */
#define NEAR_BY_NAME     0.1
#define NEAR_BY_POSITION 0.05

typedef struct {
  PetscInt        body, nnode, ncell; /* permanent number; own and ghost nodes; own cells with a node on the boundary */
  const PetscInt *node;               /* of the mesh */
  PetscInt       *cell;
  PetscReal       x[3], volume; /* of the body; 0 where it is not known */
} Surface;

struct _p_Fitted {
  MPI_Comm         comm;
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

/* Largest distance of nodes of a boundary from the surface of a body that is known wherever it may be near (else
   PETSC_MAX_REAL); *outside: the cells at the boundary lie around the body. Collective. */
static PetscErrorCode measure_surface(Fitted h, PetscInt number, PetscInt boundary, PetscReal *worst,
                                      PetscBool *outside)
{
  const MeshLocal *l   = h->loc;
  const PetscInt   dim = l->dim, k = BodiesFind(h->s, number);
  const PetscInt  *node;
  PetscInt         n;
  PetscBool       *on;
  PetscReal        far[2] = {0, 0}, d; /* worst; of the cells' nodes the deepest in the body */

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryNodes(h->mesh, boundary, &n, &node));
  PetscCall(PetscCalloc1(l->nnode_all, &on));
  if (n && k < 0) far[0] = PETSC_MAX_REAL;
  for (PetscInt i = 0; i < n && k >= 0; i++) {
    PetscCall(BodiesDistance(h->bodies, k, h->s->x[k], NULL, 1, l->x + node[i] * dim, &d));
    far[0]      = PetscMax(far[0], PetscAbsReal(d));
    on[node[i]] = PETSC_TRUE;
  }
  for (PetscInt c = 0; c < l->ncell && n && k >= 0; c++) {
    PetscBool touches = PETSC_FALSE;

    for (PetscInt j = 0; j < l->nb; j++) touches = (PetscBool)(touches || on[l->cell_node[c * l->nb + j]]);
    for (PetscInt j = 0; j < l->nb && touches; j++) {
      PetscCall(BodiesDistance(h->bodies, k, h->s->x[k], NULL, 1, l->x + l->cell_node[c * l->nb + j] * dim, &d));
      far[1] = PetscMax(far[1], -d);
    }
  }
  PetscCall(PetscFree(on));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, far, 2, MPIU_REAL, MPIU_MAX, h->comm));
  *worst   = far[0];
  *outside = (PetscBool)(far[1] <= far[0] * (1 + 1e-9));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_surface(Fitted h, const BodyGroup *g, PetscInt boundary, const char name[])
{
  const PetscReal radius = g->largest * g->radius;
  PetscReal       worst;
  PetscBool       outside;

  PetscFunctionBeginUser;
  PetscCall(measure_surface(h, g->first, boundary, &worst, &outside));
  PetscCheck(worst <= NEAR_BY_NAME * radius, h->comm, PETSC_ERR_USER_INPUT,
             "Boundary '%s' of the mesh is no surface of group '%s': it has points %g away from the surface, the limit is a tenth of the radius %g. "
             "Correct -particle_%s_position, _angle and the size of the shape, or rename the group",
             name, g->name, (double)worst, (double)radius, g->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* May the boundary, by its box, be that of the one body of group g? Whoever owns the body tells. Collective. */
static PetscErrorCode may_be_surface(Fitted h, const BodyGroup *g, PetscInt boundary, PetscBool *may)
{
  const MeshLocal *l      = h->loc;
  const PetscReal  radius = g->largest * g->radius;
  const PetscInt   k      = BodiesFindOwn(h->s, g->first);
  const PetscInt  *node;
  PetscInt         n, near = 0;
  PetscReal        box[6];

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryNodes(h->mesh, boundary, &n, &node));
  for (PetscInt e = 0; e < 6; e++) box[e] = PETSC_MAX_REAL; /* lowest, and minus the highest */
  for (PetscInt i = 0; i < n; i++) {
    for (PetscInt a = 0; a < l->dim; a++) {
      box[a]     = PetscMin(box[a], l->x[node[i] * l->dim + a]);
      box[3 + a] = PetscMin(box[3 + a], -l->x[node[i] * l->dim + a]);
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, box, 6, MPIU_REAL, MPIU_MIN, h->comm));
  if (k >= 0) {
    near = 1;
    for (PetscInt a = 0; a < l->dim; a++) {
      const PetscReal reach = (1 + NEAR_BY_POSITION) * radius;

      near &= box[a] >= h->s->x[k][a] - reach && -box[3 + a] <= h->s->x[k][a] + reach;
    }
  }
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &near, 1, MPIU_INT, MPI_MAX, h->comm));
  *may = (PetscBool)(near > 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is boundary b a side of a box, or of a group's name? */
static PetscErrorCode has_other_use(Fitted h, PetscInt b, PetscBool *other)
{
  const char *name;
  PetscBool   sides;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryName(h->mesh, b, &name));
  PetscCall(MeshHasSides(h->mesh, &sides));
  *other = PETSC_FALSE;
  for (PetscInt i = 0; i < 6 && sides && !*other; i++) PetscCall(PetscStrcmp(name, DOMAIN_SIDE[i], other));
  for (PetscInt g = 0; g < h->s->ngroups && !*other; g++) PetscCall(PetscStrcmp(name, h->s->group[g].name, other));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The boundary that is the surface of a group's body: that of its name, else one that lies where the surface is; -1:
   none */
static PetscErrorCode find_boundary(Fitted h, const BodyGroup *g, PetscInt *boundary)
{
  PetscInt  n;
  PetscReal worst;
  PetscBool no, outside, may;

  PetscFunctionBeginUser;
  PetscCall(MeshFindBoundary(h->mesh, g->name, boundary));
  if (*boundary >= 0 || g->count != 1) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MeshGetBoundaryCount(h->mesh, &n));
  for (PetscInt b = 0; b < n && *boundary < 0; b++) {
    PetscCall(has_other_use(h, b, &no));
    if (no) continue;
    PetscCall(may_be_surface(h, g, b, &may));
    if (!may) continue;
    if (!g->body_fitted) PetscCall(BodiesMigrate(h->bodies, 0, 1)); /* known where its surface is */
    PetscCall(measure_surface(h, g->first, b, &worst, &outside));
    if (outside && worst <= NEAR_BY_POSITION * g->largest * g->radius) *boundary = b;
  }
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

    for (PetscInt j = 0; j < l->nb; j++)
      touches = (PetscBool)(touches || h->on[l->cell_node[c * l->nb + j]] == s->body);
    if (touches) s->cell[s->ncell++] = c;
  }
  PetscCall(PetscRealloc(PetscMax(1, s->ncell) * sizeof(PetscInt), &s->cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_surface(Fitted h, const BodyGroup *g, PetscInt boundary)
{
  Surface    *s = h->surface + h->n;
  PetscInt    k;
  const char *name;
  PetscBool   named;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryName(h->mesh, boundary, &name));
  PetscCall(PetscStrcmp(name, g->name, &named));
  PetscCheck(g->count == 1 && !g->free, h->comm, PETSC_ERR_USER_INPUT,
             "Boundary '%s' of the mesh is the surface of group '%s', which has %" PetscInt_FMT
             " bodies%s. A group with the name or in the place of a boundary is the body behind it: one body, which does not move: set -particle_%s_free none and one "
             "position, or %s the group",
             name, g->name, g->count, g->free ? ", free to move" : "", g->name, named ? "rename" : "move");
  if (!g->body_fitted) PetscCall(BodiesMigrate(h->bodies, 0, 1)); /* known where its surface is */
  PetscCall(BodiesSetBodyFitted(h->bodies, (PetscInt)(g - h->s->group), name));
  s->body = g->first;
  k       = BodiesFind(h->s, s->body);
  if (k >= 0) {
    PetscCall(PetscArraycpy(s->x, h->s->x[k], 3));
    PetscCall(BodiesGetVolume(h->bodies, k, &s->volume));
  }
  PetscCall(MeshGetBoundaryNodes(h->mesh, boundary, &s->nnode, &s->node));
  PetscCall(check_surface(h, g, boundary, name));
  PetscCall(list_cells(h, s));
  h->n++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FittedCreate(Flow flow, Bodies bodies, Fitted *fitted)
{
  Fitted h;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&h));
  h->flow   = flow;
  h->bodies = bodies;
  PetscCall(FlowGetMesh(flow, &h->mesh));
  PetscCall(MeshGetComm(h->mesh, &h->comm));
  PetscCall(MeshGetLocal(h->mesh, &h->loc));
  PetscCall(BodiesGetState(bodies, &h->s));
  PetscCall(PetscCalloc2(h->s->ngroups, &h->surface, h->loc->nnode_all, &h->on));
  for (PetscInt i = 0; i < h->loc->nnode_all; i++) h->on[i] = -1;
  for (PetscInt g = 0; g < h->s->ngroups; g++) {
    PetscInt boundary;

    PetscCall(find_boundary(h, h->s->group + g, &boundary));
    if (boundary >= 0) PetscCall(add_surface(h, h->s->group + g, boundary));
  }
  *fitted = h;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FittedDestroy(Fitted *fitted)
{
  Fitted h = *fitted;

  PetscFunctionBeginUser;
  if (!h) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < h->n; i++) PetscCall(PetscFree(h->surface[i].cell));
  PetscCall(PetscFree2(h->surface, h->on));
  PetscCall(PetscFree(*fitted));
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
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, mean, 4, MPIU_REAL, MPIU_SUM, h->comm));
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
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 9, MPIU_REAL, MPIU_SUM, h->comm));
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

/* Angular velocities of the holes' bodies from the step's boundary values (best fit of a rigid motion) */
static PetscErrorCode set_rotations(Fitted h)
{
  const unsigned char *fixed;
  const PetscReal     *value;

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
static PetscErrorCode add_cell(Fitted h, const Surface *s, PetscInt cell, const PetscReal u[], const PetscReal p[],
                               PetscReal (*f)[3])
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

/* To both forms what others give the nodes of the surface */
static void add_given(Fitted h, const Surface *s, const PetscReal given[], PetscReal (*f)[3])
{
  const MeshLocal *l = h->loc;

  for (PetscInt i = 0; i < l->nnode_all; i++) {
    PetscReal arm[3] = {0, 0, 0}, pull[3] = {0, 0, 0};

    if (h->on[i] != s->body) continue;
    for (PetscInt d = 0; d < l->dim; d++) {
      arm[d]  = MeshNearest(l, d, l->x[i * l->dim + d] - s->x[d]);
      pull[d] = given[i * l->dim + d];
    }
    for (PetscInt form = 0; form < 4; form += 2) {
      for (PetscInt d = 0; d < 3; d++) f[form][d] += pull[d];
      add_moment(arm, pull, f[form + 1]);
    }
  }
}

PetscErrorCode FittedForce(Fitted h, const PetscReal u[], const PetscReal p[], const PetscReal given[],
                           PetscReal (*force)[3], PetscReal (*torque)[3], PetscReal (*volume_force)[3],
                           PetscReal (*volume_torque)[3])
{
  const FlowParameters *par;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(h->flow, &par));
  for (PetscInt i = 0; i < h->n; i++) {
    const Surface *s       = h->surface + i;
    const PetscInt k       = BodiesFind(h->s, s->body);
    PetscReal      f[4][3] = {{0}};

    for (PetscInt c = 0; c < s->ncell; c++) PetscCall(add_cell(h, s, s->cell[c], u, p, f));
    if (given) add_given(h, s, given, f);
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, f, 12, MPIU_REAL, MPIU_SUM, h->comm));
    for (PetscInt d = 0; d < 3 && k >= 0; d++) {
      if (!FlowHasSymmetricStress(h->flow)) f[1][d] -= 2 * par->solvent * s->volume * h->s->w[k][d]; /* gradient form */
      if (force) force[k][d] = f[0][d];
      if (torque) torque[k][d] = f[1][d];
      if (volume_force) volume_force[k][d] = f[2][d];
      if (volume_torque) volume_torque[k][d] = f[3][d];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- as a participant ---- */

static PetscErrorCode set_motion(Couple c, void *data)
{
  PetscFunctionBeginUser;
  (void)data;
  PetscCall(set_rotations(c->fitted));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* In place of what the rigid bodies gave them */
static PetscErrorCode set_forces(Couple c, void *data)
{
  PetscReal(*force)[3], (*torque)[3], *given;

  PetscFunctionBeginUser;
  (void)data;
  if (!c->fitted->n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesWriteForces(c->bodies, &force, &torque));
  PetscCall(CoupleGetGiven(c, &given));
  if (c->force_form == FORCE_VOLUME)
    PetscCall(FittedForce(c->fitted, c->field.u, c->field.p, given, NULL, NULL, force, torque));
  else PetscCall(FittedForce(c->fitted, c->field.u, c->field.p, given, force, torque, NULL, NULL));
  PetscCall(PetscFree(given));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view_fitted(Couple c, void *data, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  (void)data;
  for (PetscInt g = 0; g < c->s->ngroups; g++) {
    const BodyGroup *group = c->s->group + g;

    if (group->body_fitted)
      PetscCall(
        PetscViewerASCIIPrintf(viewer,
                               "  group %s is the body behind boundary %s of the mesh: the flow ends there (-flow_bc_%s_type), nothing is "
                               "marked inside\n",
                               group->name, group->surface, group->surface));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant FITTED = {.name  = "fitted",
                                         .begin = set_motion,
                                         .force = set_forces,
                                         .view  = view_fitted};

PetscErrorCode CoupleAddFitted(Couple c)
{
  PetscFunctionBeginUser;
  if (c->s->nall) PetscCall(CoupleAddParticipant(c, &FITTED, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}
