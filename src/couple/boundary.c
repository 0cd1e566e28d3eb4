/* Boundaries: see boundary.h. */
#include "compat.h"
#include "boundary.h"

#define MAX_BITS 31

struct _p_Boundaries {
  MPI_Comm         comm;
  Flow             flow;
  Mesh             mesh;
  const MeshLocal *loc;
  PetscInt         n;
  CoupleBoundary  *boundary;
  PetscInt        *begin, *node; /* own nodes of boundary b: [begin[b] .. begin[b + 1]) */
  PetscReal       *weight;       /* [begin[n]][dim] */
  PetscReal       *normal;       /* [n][3] mean outward normal, unit length; 0 where a boundary has none (all around) */
  PetscInt        *uses;         /* [nnode_all] boundaries that the node is on: bits */
  PetscReal       *sum;          /* [n][4]: force, rate */
  /* of BoundariesGetPoints */
  PetscInt       ncell, *cell, npoint;
  BoundaryPoint *point;
};

/* Walls that are surfaces of bodies have their force in bodies.csv */
static PetscErrorCode drop_fitted(Boundaries d, Fitted fitted)
{
  const PetscInt *body, *node;
  PetscInt        n, *found;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(d->n, &found));
  PetscCall(FittedGetNodeBody(fitted, &body));
  for (PetscInt b = 0; b < d->n; b++) {
    PetscCall(MeshGetBoundaryNodes(d->mesh, b, &n, &node));
    for (PetscInt i = 0; i < n; i++) found[b] |= body[node[i]] >= 0;
  }
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, found, (PetscMPIInt)d->n, MPIU_INT, MPI_MAX, d->comm));
  for (PetscInt b = 0; b < d->n; b++)
    if (found[b]) d->boundary[b].wall = PETSC_FALSE;
  PetscCall(PetscFree(found));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode list_nodes(Boundaries d)
{
  PetscInt total = 0;

  PetscFunctionBeginUser;
  for (PetscInt pass = 0; pass < 2; pass++) {
    total = 0;
    for (PetscInt b = 0; b < d->n; b++) {
      const PetscInt *node;
      PetscInt        n;

      d->begin[b] = total;
      PetscCall(MeshGetBoundaryNodes(d->mesh, b, &n, &node));
      for (PetscInt i = 0; i < n; i++) {
        if (b < MAX_BITS) d->uses[node[i]] |= 1 << b;
        if (node[i] >= d->loc->nnode) continue;
        if (pass) d->node[total] = node[i];
        total++;
      }
    }
    d->begin[d->n] = total;
    if (!pass) PetscCall(PetscMalloc2(total, &d->node, total * d->loc->dim, &d->weight));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool is_shared(Boundaries d, PetscInt node)
{
  return (PetscBool)((d->uses[node] & (d->uses[node] - 1)) != 0);
}

/* Mean normals, of nodes on one boundary alone */
static PetscErrorCode find_normals(Boundaries d)
{
  PetscReal *sum;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(4 * d->n, &sum));
  for (PetscInt b = 0; b < d->n; b++) {
    for (PetscInt i = d->begin[b]; i < d->begin[b + 1]; i++) {
      const PetscReal *w  = d->weight + i * d->loc->dim;
      PetscReal        w2 = 0;

      for (PetscInt a = 0; a < d->loc->dim && !is_shared(d, d->node[i]); a++) {
        sum[4 * b + a] += w[a];
        w2 += w[a] * w[a];
      }
      sum[4 * b + 3] += PetscSqrtReal(w2);
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 4 * d->n, MPIU_REAL, MPIU_SUM, d->comm));
  for (PetscInt b = 0; b < d->n; b++) {
    const PetscReal *m = sum + 4 * b, length = PetscSqrtReal(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]);

    for (PetscInt a = 0; a < 3; a++) d->normal[3 * b + a] = length > 0.5 * m[3] && length > 0 ? m[a] / length : 0;
  }
  PetscCall(PetscFree(sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Part of a weight along the normal of a boundary */
static PetscReal component_along(Boundaries d, PetscInt b, const PetscReal w[])
{
  PetscReal along = 0;

  for (PetscInt a = 0; a < d->loc->dim; a++) along += d->normal[3 * b + a] * w[a];
  return along;
}

/* Nodes of several boundaries: each has the part along its own normal */
static void divide_corners(Boundaries d)
{
  const PetscInt dim = d->loc->dim;

  for (PetscInt b = 0; b < d->n; b++) {
    for (PetscInt i = d->begin[b]; i < d->begin[b + 1]; i++) {
      const PetscReal along = component_along(d, b, d->weight + i * dim);

      if (!is_shared(d, d->node[i])) continue;
      for (PetscInt a = 0; a < dim; a++) d->weight[i * dim + a] = along * d->normal[3 * b + a];
    }
  }
}

PetscErrorCode BoundariesUpdate(Boundaries d)
{
  const MeshLocal *l = d->loc;
  PetscReal       *one, *r;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(l->ncell * (l->dim + 1), &one, l->nnode_all * l->dim, &r));
  for (PetscInt c = 0; c < l->ncell; c++) one[c * (l->dim + 1)] = 1;
  PetscCall(FlowGradient(d->flow, 1, one, r));
  for (PetscInt i = 0; i < d->begin[d->n]; i++)
    for (PetscInt a = 0; a < l->dim; a++) d->weight[i * l->dim + a] = r[d->node[i] * l->dim + a];
  PetscCall(PetscFree2(one, r));
  PetscCall(find_normals(d));
  divide_corners(d);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The nodes with prescribed components in own cells; these do not change */
static PetscErrorCode list_points(Boundaries d, Fitted fitted)
{
  const MeshLocal     *l = d->loc;
  const unsigned char *wall;
  const PetscInt      *body;
  PetscInt            *owner;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all * l->dim, &owner));
  PetscCall(ConditionsGetOwners(FlowConditions(d->flow), owner));
  PetscCall(ConditionsGetWalls(FlowConditions(d->flow), &wall));
  PetscCall(FittedGetNodeBody(fitted, &body));
  for (PetscInt pass = 0; pass < 2; pass++) {
    d->ncell = d->npoint = 0;
    for (PetscInt c = 0; c < l->ncell; c++) {
      PetscBool any = PETSC_FALSE;

      for (PetscInt j = 0; j < l->nb; j++) {
        const PetscInt node          = l->cell_node[c * l->nb + j];
        PetscBool      is_prescribed = PETSC_FALSE;
        BoundaryPoint  at            = {.cell   = d->ncell,
                                        .slot   = j,
                                        .node   = node,
                                        .wall   = wall[node],
                                        .fitted = (PetscBool)(body[node] >= 0),
                                        .shared = is_shared(d, node)};

        for (PetscInt a = 0; a < l->dim; a++) {
          at.owner[a]   = owner[node * l->dim + a];
          is_prescribed = (PetscBool)(is_prescribed || at.owner[a] >= 0);
        }
        if (!is_prescribed) continue;
        if (pass) d->point[d->npoint] = at;
        d->npoint++;
        any = PETSC_TRUE;
      }
      if (!any) continue;
      if (pass) d->cell[d->ncell] = c;
      d->ncell++;
    }
    if (!pass) PetscCall(PetscMalloc2(d->ncell, &d->cell, d->npoint, &d->point));
  }
  PetscCall(PetscFree(owner));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BoundariesCreate(Flow flow, Fitted fitted, Boundaries *boundaries)
{
  Boundaries d;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&d));
  d->flow = flow;
  PetscCall(FlowGetMesh(flow, &d->mesh));
  PetscCall(MeshGetComm(d->mesh, &d->comm));
  PetscCall(MeshGetLocal(d->mesh, &d->loc));
  PetscCall(MeshGetBoundaryCount(d->mesh, &d->n));
  PetscCall(PetscCalloc5(d->n, &d->boundary, d->n + 1, &d->begin, 4 * d->n, &d->sum, 3 * d->n, &d->normal,
                         d->loc->nnode_all, &d->uses));
  for (PetscInt b = 0; b < d->n; b++) {
    PetscCall(MeshGetBoundaryName(d->mesh, b, &d->boundary[b].name));
    PetscCall(ConditionsGetKind(FlowConditions(flow), b, &d->boundary[b].wall, &d->boundary[b].open));
  }
  PetscCall(drop_fitted(d, fitted));
  PetscCall(list_nodes(d));
  PetscCall(list_points(d, fitted));
  PetscCall(BoundariesUpdate(d));
  *boundaries = d;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BoundariesDestroy(Boundaries *boundaries)
{
  Boundaries d = *boundaries;

  PetscFunctionBeginUser;
  if (!d) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree5(d->boundary, d->begin, d->sum, d->normal, d->uses));
  PetscCall(PetscFree2(d->node, d->weight));
  PetscCall(PetscFree2(d->cell, d->point));
  PetscCall(PetscFree(*boundaries));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BoundariesBegin(Boundaries d)
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(d->sum, 4 * d->n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Divide the pressure among the boundaries that meet at a place; that outside of an opening is not in the residual */
static PetscErrorCode spread_pressure(Boundaries d, const BoundaryPoint *at, const PetscReal p[])
{
  const PetscInt   c = d->cell[at->cell], dim = d->loc->dim;
  const PetscReal *w, *const *B;
  PetscReal xc[MESH_MAX_NB * 3], pressure;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellDivergence(d->flow, &B));
  PetscCall(MeshSlotCoordinates(d->mesh, c, xc));
  PetscCall(FlowCellPressure(d->flow, c, p, xc + at->slot * dim, &pressure));
  w = B[c] + at->slot * dim;
  for (PetscInt b = 0; b < PetscMin(d->n, MAX_BITS); b++) {
    const PetscReal along = component_along(d, b, w);

    if (!((d->uses[at->node] >> b) & 1) || ConditionsHasPressure(FlowConditions(d->flow), b)) continue;
    for (PetscInt a = 0; a < dim; a++) {
      const PetscInt  from = at->owner[a];
      const PetscReal load = -pressure * along * d->normal[3 * b + a];

      if (from < 0 || from == b) continue;
      d->sum[4 * from + a] -= load;
      d->sum[4 * b + a] += load;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BoundariesAdd(Boundaries d, const BoundaryPoint *at, const PetscReal residual[], const PetscReal p[])
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < d->loc->dim; a++)
    if (at->owner[a] >= 0) d->sum[4 * at->owner[a] + a] += residual[a];
  if (at->shared) PetscCall(spread_pressure(d, at, p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BoundariesGetPoints(Boundaries d, PetscInt *ncell, const PetscInt *cell[], PetscInt *n,
                                   const BoundaryPoint *point[])
{
  PetscFunctionBeginUser;
  *ncell = d->ncell;
  *cell  = d->cell;
  *n     = d->npoint;
  *point = d->point;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BoundariesFinish(Boundaries d, const PetscReal u[])
{
  const PetscInt  dim = d->loc->dim;
  const FlowStep *step;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(d->flow, &step));
  for (PetscInt b = 0; b < d->n; b++) {
    for (PetscInt i = d->begin[b]; i < d->begin[b + 1] && d->boundary[b].open; i++)
      for (PetscInt a = 0; a < dim; a++)
        d->sum[4 * b + 3] += d->weight[i * dim + a] * (u[d->node[i] * dim + a] - step->frame[a]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, d->sum, 4 * d->n, MPIU_REAL, MPIU_SUM, d->comm));
  for (PetscInt b = 0; b < d->n; b++) {
    for (PetscInt a = 0; a < 3; a++) d->boundary[b].force[a] = -d->sum[4 * b + a];
    d->boundary[b].rate = d->sum[4 * b + 3];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BoundariesAddForce(Boundaries d, PetscInt b, const PetscReal force[3])
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) d->boundary[b].force[a] += force[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BoundariesGet(Boundaries d, PetscInt *n, const CoupleBoundary *boundary[])
{
  PetscFunctionBeginUser;
  *n        = d->n;
  *boundary = d->boundary;
  PetscFunctionReturn(PETSC_SUCCESS);
}
