/* Elastic, start: the fluid inside solids and membranes whose velocities are given takes them, as that inside rigid
   bodies does (startinside.c): node i

     u_i += (int_k phi_i / int phi_i) (U_k + w_k x r_i - u_i)

   over what lies in k of its cells. That of cut cells is scaled, so that all sums up to the volume of k, and r is the
   arm from the centre of it all: what comes in is the momentum of the fluid in the true shape. Not inside solids that
   the mesh follows, where the flow has no inertia. Membranes come first, then what may be inside of them. */
#include "compat.h"
#include "elastic.h"
#include "elasticinside.h"
#include "impl.h"
#include "base/rigid.h"

/* What is known of one of them: *inside* of cells, centre and velocities [RigidSize] about it */
typedef struct {
  const ElementTables *tables;
  const PetscReal     *inside, *centre, *U;
  PetscReal            volume;
  PetscReal            scale, shift[3]; /* of parts of cut cells; of the centre of all parts from the true one */
} Inner;

static PetscReal get_part(const Inner *k, PetscInt cell)
{
  return k->inside[cell] < 1 ? k->scale * k->inside[cell] : 1;
}

/* From the centre to node i */
static void find_arm(const Inner *k, const MeshLocal *l, PetscInt i, PetscReal r[3])
{
  for (PetscInt a = 0; a < 3; a++)
    r[a] = a < l->dim ? MeshNearest(l, a, l->x[i * l->dim + a] - k->centre[a]) - k->shift[a] : 0;
}

/* The scale with which volumes are right, and the centre of the parts, about which a turn has no momentum */
static PetscErrorCode measure_inside(Couple c, Inner *k)
{
  const MeshLocal *l         = c->loc;
  PetscReal        sum[2][4] = {{0}}; /* whole cells, cut ones: volume, arm */

  PetscFunctionBeginUser;
  k->scale = 1;
  for (PetscInt cell = 0; cell < l->ncell; cell++) {
    PetscReal whole[MESH_MAX_NB], *to = sum[k->inside[cell] < 1];

    if (k->inside[cell] == 0) continue;
    PetscCall(ElasticIntegrateCell(k->tables, c->mesh, l, cell, whole));
    for (PetscInt j = 0; j < l->nb; j++) {
      PetscReal r[3];

      find_arm(k, l, l->cell_node[cell * l->nb + j], r);
      for (PetscInt a = 0; a < 4; a++) to[a] += k->inside[cell] * whole[j] * (a ? r[a - 1] : 1);
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 8, MPIU_REAL, MPIU_SUM, c->comm));
  if (sum[1][0] > 0) k->scale = (k->volume - sum[0][0]) / sum[1][0];
  for (PetscInt a = 0; a < l->dim; a++) k->shift[a] = (sum[0][1 + a] + k->scale * sum[1][1 + a]) / k->volume;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_velocity(Couple c, const Inner *k, const PetscReal before[], PetscReal u[])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim;
  const PetscReal *mass;
  PetscReal        whole[MESH_MAX_NB];

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(c->flow, &mass));
  for (PetscInt cell = 0; cell < l->ncell_all; cell++) {
    if (k->inside[cell] == 0) continue;
    PetscCall(ElasticIntegrateCell(k->tables, c->mesh, l, cell, whole));
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt i = l->cell_node[cell * l->nb + j];
      PetscReal      r[3], v[3];

      if (i >= l->nnode) continue;
      find_arm(k, l, i, r);
      RigidVelocityAt(dim, k->U, r, v);
      for (PetscInt a = 0; a < dim; a++)
        u[i * dim + a] += get_part(k, cell) * whole[j] / mass[i] * (v[a] - before[i * dim + a]);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Was solid k given a velocity, and is there fluid inside that takes it? The mesh is lined up where it can be. */
static PetscBool starts_inside(const Elastic *e, PetscInt k)
{
  const SolidGroup *g = e->s->group + e->s->group_of[k];

  return (PetscBool)(g->start && (g->membrane || !ElasticIsLined(e, k)));
}

/* Those that are membranes, or that are not: u [nnode_all][dim] changes at own nodes, one after the other */
static PetscErrorCode start_kind(Elastic *e, Couple c, PetscBool membranes, const ElementTables *tables,
                                 ElasticInside t, PetscReal before[], PetscReal u[])
{
  const SolidsState   *s     = e->s;
  const AlignSurfaces *table = ElasticSurfacesGet(e->surfaces);

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const SolidGroup *g = s->group + s->group_of[k];
    const PetscReal  *inside;
    Inner             inner;

    if (!starts_inside(e, k) || g->membrane != membranes) continue;
    PetscCall(ElasticInsideFind(t, k, &inside));
    inner = (Inner){.tables = tables,
                    .inside = inside,
                    .centre = table->centre[k],
                    .U      = g->start + (k - g->first) * RigidSize(s->dim),
                    .volume = g->mesh.volume};
    PetscCall(measure_inside(c, &inner));
    PetscCall(PetscArraycpy(before, u, c->loc->nnode * s->dim));
    PetscCall(take_velocity(c, &inner, before, u));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticStartInside(Elastic *e, Couple c)
{
  const SolidsState *s   = e->s;
  const PetscInt     n   = c->loc->nnode_all * s->dim;
  PetscBool          any = PETSC_FALSE;
  ElasticInside      t;
  ElementTables      tables;
  PetscReal         *flow, *before, *u;

  PetscFunctionBeginUser;
  if (e->once.inside || s->time_dt > 0) PetscFunctionReturn(PETSC_SUCCESS);
  e->once.inside = PETSC_TRUE;
  for (PetscInt k = 0; k < s->n; k++) any = (PetscBool)(any || starts_inside(e, k));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetFields(c->flow, &flow, NULL, NULL));
  PetscCall(PetscMalloc2(n, &before, n, &u));
  PetscCall(PetscArraycpy(u, flow, n));
  PetscCall(ElementCreate(s->dim, &tables));
  PetscCall(ElasticSurfacesSet(e->surfaces, s->x));
  PetscCall(ElasticInsideCreate(c->mesh, e->surfaces, NULL, NULL, &t));
  PetscCall(start_kind(e, c, PETSC_TRUE, &tables, t, before, u));
  PetscCall(start_kind(e, c, PETSC_FALSE, &tables, t, before, u));
  PetscCall(ElasticInsideDestroy(&t));
  PetscCall(ElementDestroy(&tables));
  PetscCall(MeshSyncNodes(c->mesh, s->dim, u));
  PetscCall(FlowStartFrom(c->flow, u, NULL));
  PetscCall(PetscFree2(before, u));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleStartSolids(Couple c)
{
  const Elastic *e = c->elastic;

  PetscFunctionBeginUser;
  if (!e) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArraycpy(e->s->u, e->u, e->s->nnode * e->s->dim));
  PetscCall(PetscArraycpy(e->s->u_old, e->u, e->s->nnode * e->s->dim));
  PetscFunctionReturn(PETSC_SUCCESS);
}
