/* ElasticGap: see elasticgap.h. In the plane. */
#include "compat.h"
#include "elasticgap.h"
#include "impl.h"
#include "bodies/local.h"
#include "fem/edge.h"
#include "fem/element.h"

#define CLAMP_REACH 2 /* cells */

enum {
  TO_BOUNDARY,
  TO_SOLID,
  TO_BODY
};

/* The narrowest gap on this rank, in cells */
typedef struct {
  PetscReal cells, gap, x[2];
  PetscInt  kind, solid, other;
} Gap;

static void note(Gap *best, PetscReal gap, PetscReal size, const Gap *which)
{
  if (gap >= best->cells * size) return;
  *best       = *which;
  best->gap   = gap;
  best->cells = gap / size;
}

static PetscReal cell_size(Couple c, PetscInt cell)
{
  const PetscReal centre[2] = {0, 0};
  PetscReal       xc[2 * MESH_MAX_NB], x[2], J[4];

  PetscCallAbort(PETSC_COMM_SELF, MeshCellCoordinates(c->mesh, cell, xc));
  ElementMap(2, xc, centre, x, J);
  return PetscMax(c->loc->h, 2 * PetscSqrtReal(PetscAbsReal(J[0] * J[3] - J[1] * J[2])));
}

/* Is the node, where the solid starts, beside one that is held? */
static PetscBool is_near_clamp(const SolidGroup *g, PetscInt node, PetscReal size)
{
  for (PetscInt i = 0; i < g->mesh.nnode && g->nclamped; i++)
    if (g->clamped[i] && EdgeDistance2(g->mesh.X + 2 * i, g->mesh.X + 2 * node) <= PetscSqr(CLAMP_REACH * size))
      return PETSC_TRUE;
  return PETSC_FALSE;
}

/* ---- boundaries ---- */

/* Distance from x to the straight pieces between nodes of an edge of a cell that is on the boundary */
static PetscReal edge_distance(const PetscReal *p[3], const PetscReal x[2])
{
  PetscReal best = PETSC_MAX_REAL;

  for (PetscInt i = 0; i < 2; i++) {
    const PetscReal d[2] = {p[i + 1][0] - p[i][0], p[i + 1][1] - p[i][1]}, r[2] = {x[0] - p[i][0], x[1] - p[i][1]};
    const PetscReal t    = PetscMax(0, PetscMin(1, (r[0] * d[0] + r[1] * d[1]) / (d[0] * d[0] + d[1] * d[1])));
    const PetscReal y[2] = {p[i][0] + t * d[0], p[i][1] + t * d[1]};

    best = PetscMin(best, EdgeDistance2(x, y));
  }
  return PetscSqrtReal(best);
}

/* on: number of the boundary of a node, -1: none */
static PetscErrorCode check_edges(Couple c, PetscInt cell, const PetscInt on[], PetscReal size, Gap *at, Gap *best)
{
  const PetscInt *node = c->loc->cell_node + cell * c->loc->nb;
  PetscReal       xc[2 * MESH_MAX_NB];

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < 4; e++) {
    const PetscReal *p[3], x[2] = {at->x[0], at->x[1]};
    PetscReal        image[2];

    at->other = on[node[ELEMENT_EDGE[e][1]]]; /* the middle of an edge is on one boundary alone */
    if (at->other < 0) continue;
    PetscCall(MeshCellCoordinates(c->mesh, cell, xc));
    for (PetscInt j = 0; j < 3; j++) p[j] = xc + 2 * ELEMENT_EDGE[e][j];
    for (PetscInt a = 0; a < 2; a++) image[a] = p[1][a] + MeshNearest(c->loc, a, x[a] - p[1][a]);
    note(best, edge_distance(p, image), size, at);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of the cell and those around it: a mesh that is lined up has squeezed ones between */
static PetscErrorCode check_boundary(Couple c, PetscInt cell, const PetscInt on[], PetscReal size, const Gap *which,
                                     Gap *best)
{
  const MeshLocal *l  = c->loc;
  Gap              at = *which;

  PetscFunctionBeginUser;
  at.kind = TO_BOUNDARY;
  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscInt node = l->cell_node[cell * l->nb + j];

    for (PetscInt q = l->node_cell_ptr[node]; q < l->node_cell_ptr[node + 1]; q++)
      PetscCall(check_edges(c, l->node_cell[q], on, size, &at, best));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode mark_boundaries(Couple c, PetscInt on[])
{
  PetscInt nboundary;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->loc->nnode_all; i++) on[i] = -1;
  PetscCall(MeshGetBoundaryCount(c->mesh, &nboundary));
  for (PetscInt b = 0; b < nboundary; b++) {
    PetscInt        n;
    const PetscInt *node;

    PetscCall(MeshGetBoundaryNodes(c->mesh, b, &n, &node));
    for (PetscInt i = 0; i < n; i++) on[node[i]] = b;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- solids and bodies ---- */

/* Another solid, or an image of any in a periodic box */
static PetscErrorCode check_solids(Couple c, const AlignSurfaces *t, PetscReal size, const Gap *which, Gap *best)
{
  const MeshLocal *l    = c->loc;
  const PetscInt   n[2] = {l->period[0] > 0, l->period[1] > 0};
  Gap              at   = *which;

  PetscFunctionBeginUser;
  at.kind = TO_SOLID;
  for (at.other = 0; at.other < t->n; at.other++)
    for (PetscInt i = -n[0]; i <= n[0]; i++)
      for (PetscInt j = -n[1]; j <= n[1]; j++) {
        const PetscReal *own = t->centre[at.solid], *other = t->centre[at.other];
        const PetscReal  image[3] = {own[0] + MeshNearest(l, 0, other[0] - own[0]) + (PetscReal)i * l->period[0],
                                     own[1] + MeshNearest(l, 1, other[1] - own[1]) + (PetscReal)j * l->period[1], 0};
        PetscReal        d;

        if (at.other == at.solid && !i && !j) continue;
        if (EdgeDistance2(at.x, image) > PetscSqr(t->radius[at.other] + size)) continue;
        PetscCall((*t->distance)(t->ctx, at.other, image, 1, at.x, &d));
        note(best, d, size, &at);
      }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_bodies(Couple c, PetscReal size, const Gap *which, Gap *best)
{
  Gap at = *which;

  PetscFunctionBeginUser;
  at.kind = TO_BODY;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal x[2], d, r2 = 0;

    if (c->s->removed[k]) continue;
    for (PetscInt a = 0; a < 2; a++) {
      const PetscReal r = MeshNearest(c->loc, a, at.x[a] - c->rigid.X[k][a]);

      x[a] = c->rigid.X[k][a] + r;
      r2 += r * r;
    }
    if (r2 > PetscSqr(BodiesGetRadius(c->s, k) + size)) continue;
    PetscCall(BodiesDistance(c->bodies, k, c->rigid.X[k], c->rigid.q[k], 1, x, &d));
    at.other = c->s->body_group[k];
    note(best, d, size, &at);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the error ---- */

/* On all ranks what the rank with the narrowest gap found */
static PetscErrorCode stop(Elastic *e, Couple c, const Gap *mine, PetscReal narrowest)
{
  const SolidsState *s = e->s;
  PetscMPIInt        rank, from;
  Gap                gap = *mine;
  char               what[256];
  const char        *name, *group;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(c->comm, &rank));
  from = gap.cells == narrowest ? rank : PETSC_MPI_INT_MAX;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &from, 1, MPI_INT, MPI_MIN, c->comm));
  PetscCallMPI(MPI_Bcast(&gap, (PetscMPIInt)sizeof(gap), MPI_BYTE, from, c->comm));
  group = s->group[s->group_of[gap.solid]].name;
  if (gap.kind == TO_BOUNDARY) {
    PetscCall(MeshGetBoundaryName(c->mesh, gap.other, &name));
    (void)snprintf(what, sizeof(what), "boundary '%s'", name);
  } else if (gap.kind == TO_SOLID)
    (void)snprintf(what, sizeof(what), "an elastic particle of group '%s'", s->group[s->group_of[gap.other]].name);
  else (void)snprintf(what, sizeof(what), "a body of group '%s'", c->s->group[gap.other].name);
  SETERRQ(c->comm, PETSC_ERR_USER_INPUT,
          "An elastic particle of group '%s' comes to %.3g from %s at t = %g, near (%.4g, %.4g), less than a cell (%.3g): elastic particles have no "
          "contact, and the flow between is not resolved. Use smaller cells there (-mesh_cells, -mesh_focus_h), keep them apart "
          "(-particle_%s_position), or end the run before (-sim_time)",
          group, (double)gap.gap, what, (double)c->step->time, (double)gap.x[0], (double)gap.x[1],
          (double)(gap.cells != 0 ? gap.gap / gap.cells : 0), group);
}

PetscErrorCode ElasticCheckGaps(Elastic *e, Couple c)
{
  const SolidsState   *s    = e->s;
  Gap                  best = {.cells = 1};
  const AlignSurfaces *table;
  PetscReal            narrowest;
  PetscInt            *on;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->loc->nnode_all, &on));
  PetscCall(mark_boundaries(c, on));
  PetscCall(ElasticSurfacesSet(e->surfaces, e->x));
  table = ElasticSurfacesGet(e->surfaces);
  for (PetscInt k = 0; k < s->n; k++) {
    const SolidGroup *g = s->group + s->group_of[k];

    for (PetscInt i = 0; i < 3 * g->mesh.nside; i++) {
      const PetscInt node = s->first[k] + g->mesh.side[i], cell = e->node.cell[node];
      const Gap      at = {.solid = k, .x = {e->x[2 * node], e->x[2 * node + 1]}};
      PetscReal      size;

      if (i % 3 == 2 || cell < 0) continue; /* the first node of another side; of another rank */
      size = cell_size(c, cell);
      if (is_near_clamp(g, g->mesh.side[i], size)) continue;
      PetscCall(check_boundary(c, cell, on, size, &at, &best));
      PetscCall(check_solids(c, table, size, &at, &best));
      PetscCall(check_bodies(c, size, &at, &best));
    }
  }
  PetscCall(PetscFree(on));
  PetscCall(MPIU_Allreduce(&best.cells, &narrowest, 1, MPIU_REAL, MPIU_MIN, c->comm));
  if (narrowest < 1) PetscCall(stop(e, c, &best, narrowest));
  PetscFunctionReturn(PETSC_SUCCESS);
}
