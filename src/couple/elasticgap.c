/* ElasticGap: see elasticgap.h. */
#include "compat.h"
#include "elasticgap.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/array.h"
#include "base/face.h"
#include "base/log.h"
#include "bodies/local.h"
#include "bodies/mass.h"
#include "fem/edge.h"
#include "fem/element.h"
#include "fem/side.h"

#define CLAMP_REACH 2    /* cells */
#define CLOSED      0.01 /* of a cell: a gap that contact has not kept open */
#define SAME        1e-9 /* gaps that differ by such a share are as wide: at the start one may be a cell */

enum {
  TO_BOUNDARY,
  TO_SOLID,
  TO_BODY,
  NKIND
};

/* A node of an outline and the nearest of a kind: the narrowest gap, in cells, and the closest point y there. away: of
   a solid, the way from its own place to the image that is near */
typedef struct {
  PetscReal cells, gap, x[3], y[3], away[3];
  PetscInt  kind, solid, other, body;
} Gap;

static PetscBool is_narrower(PetscReal gap, PetscReal size, const Gap *best)
{
  return (PetscBool)(gap < (1 - SAME) * best->cells * size);
}

static void note(Gap *best, PetscReal gap, PetscReal size, const PetscReal y[3], const Gap *which)
{
  *best       = *which;
  best->gap   = gap;
  best->cells = gap / size;
  for (PetscInt a = 0; a < 3; a++) best->y[a] = y[a];
}

static PetscReal distance2(PetscInt dim, const PetscReal x[], const PetscReal y[])
{
  PetscReal sum = 0;

  for (PetscInt a = 0; a < dim; a++) sum += PetscSqr(x[a] - y[a]);
  return sum;
}

/* Before nodes move: the reach of contact does not change with the mesh that follows solids */
static PetscReal cell_size(const MeshLocal *l, PetscInt cell)
{
  const PetscInt *node = l->cell_node + cell * l->nb;
  PetscReal       d[3][3];

  for (PetscInt a = 0; a < l->dim && l->dim == 2; a++) { /* the diagonals */
    d[0][a] = MeshNearest(l, a, l->x_start[2 * node[8] + a] - l->x_start[2 * node[0] + a]);
    d[1][a] = MeshNearest(l, a, l->x_start[2 * node[6] + a] - l->x_start[2 * node[2] + a]);
  }
  if (l->dim == 2) return PetscSqrtReal(0.5 * PetscAbsReal(d[0][0] * d[1][1] - d[0][1] * d[1][0]));
  for (PetscInt a = 0; a < 3; a++) /* between the middles of faces */
    for (PetscInt e = 0; e < 3; e++) {
      static const PetscInt MIDDLE[3][2] = {{12, 14}, {10, 16}, {4, 22}};

      d[e][a] = MeshNearest(l, a, l->x_start[3 * node[MIDDLE[e][1]] + a] - l->x_start[3 * node[MIDDLE[e][0]] + a]);
    }
  return PetscCbrtReal(PetscAbsReal(DenseDeterminant(3, d[0])));
}

/* Is the node, where the solid starts, beside one that is held? */
static PetscBool is_near_clamp(const SolidGroup *g, PetscInt node, PetscReal size)
{
  for (PetscInt i = 0; i < g->mesh.nnode && g->nclamped; i++)
    if (g->clamped[i] && distance2(g->mesh.dim, g->mesh.X + g->mesh.dim * i, g->mesh.X + g->mesh.dim * node) <=
                           PetscSqr(CLAMP_REACH * size))
      return PETSC_TRUE;
  return PETSC_FALSE;
}

/* ---- boundaries ---- */

/* Distance from x to the straight pieces between nodes of an edge of a cell that is on the boundary, and the closest
   point there */
static PetscReal edge_distance(const PetscReal *p[3], const PetscReal x[2], PetscReal closest[2])
{
  PetscReal best = PETSC_MAX_REAL;

  for (PetscInt i = 0; i < 2; i++) {
    const PetscReal d[2] = {p[i + 1][0] - p[i][0], p[i + 1][1] - p[i][1]}, r[2] = {x[0] - p[i][0], x[1] - p[i][1]};
    const PetscReal t    = PetscMax(0, PetscMin(1, (r[0] * d[0] + r[1] * d[1]) / (d[0] * d[0] + d[1] * d[1])));
    const PetscReal y[2] = {p[i][0] + t * d[0], p[i][1] + t * d[1]};

    if (EdgeDistance2(x, y) >= best) continue;
    best       = EdgeDistance2(x, y);
    closest[0] = y[0];
    closest[1] = y[1];
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
    const PetscReal *p[3], x[2]     = {at->x[0], at->x[1]};
    PetscReal        image[2], y[3] = {0, 0, 0}, gap;

    at->other = on[node[ELEMENT_EDGE[e][1]]]; /* the middle of an edge is on one boundary alone */
    if (at->other < 0) continue;
    PetscCall(MeshCellCoordinates(c->mesh, cell, xc));
    for (PetscInt j = 0; j < 3; j++) p[j] = xc + 2 * ELEMENT_EDGE[e][j];
    for (PetscInt a = 0; a < 2; a++) image[a] = p[1][a] + MeshNearest(c->loc, a, x[a] - p[1][a]);
    gap = edge_distance(p, image, y);
    if (!is_narrower(gap, size, best)) continue;
    for (PetscInt a = 0; a < 2; a++) y[a] += x[a] - image[a];
    note(best, gap, size, y, at);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Faces of a cell in space, as check_edges */
static PetscErrorCode check_faces(Couple c, PetscInt cell, const PetscInt on[], PetscReal size, Gap *at, Gap *best)
{
  const PetscInt *node = c->loc->cell_node + cell * c->loc->nb;
  PetscReal       xc[3 * MESH_MAX_NB];

  PetscFunctionBeginUser;
  for (PetscInt side = 0; side < 6; side++) {
    PetscReal p[9][3], image[3], y[3];
    PetscInt  slot[SIDE_MAX];
    FacePoint near;

    SideList(3, side, slot);
    at->other = on[node[slot[4]]]; /* the middle of a face is on one boundary alone */
    if (at->other < 0) continue;
    PetscCall(MeshCellCoordinates(c->mesh, cell, xc));
    for (PetscInt j = 0; j < 27; j++) p[j / 3][j % 3] = xc[3 * slot[j / 3] + j % 3];
    for (PetscInt a = 0; a < 3; a++) image[a] = p[4][a] + MeshNearest(c->loc, a, at->x[a] - p[4][a]);
    FaceNearest(3, p, image, &near);
    if (!is_narrower(near.distance, size, best)) continue;
    for (PetscInt a = 0; a < 3; a++) y[a] = near.x[a] + at->x[a] - image[a];
    note(best, near.distance, size, y, at);
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
      PetscCall((l->dim == 2 ? check_edges : check_faces)(c, l->node_cell[q], on, size, &at, best));
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

/* The image `to` of another solid enters the list of those near solid k, if it comes within `reach` of it */
static PetscErrorCode list_image(Elastic *e, const MeshLocal *l, PetscInt k, PetscInt other, const PetscInt to[3],
                                 PetscReal reach)
{
  const AlignSurfaces *t = ElasticSurfacesGet(e->surfaces);
  PetscReal            image[3];

  PetscFunctionBeginUser;
  if (other == k && !to[0] && !to[1] && !to[2]) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < 3; a++)
    image[a] = t->centre[k][a] + MeshNearest(l, a, t->centre[other][a] - t->centre[k][a]) +
               (PetscReal)to[a] * l->period[a];
  if (distance2(3, t->centre[k], image) > PetscSqr(t->radius[k] + t->radius[other] + reach))
    PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ArrayReserve(e->contacts.nnear + 1, &e->contacts.near_capacity, &e->contacts.near,
                         sizeof(*e->contacts.near), &e->contacts.image, sizeof(*e->contacts.image), NULL));
  e->contacts.near[e->contacts.nnear] = other;
  PetscCall(PetscArraycpy(e->contacts.image[e->contacts.nnear++], image, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Other solids, and images of any in a periodic box, that a node of solid k may be within a cell of */
static PetscErrorCode list_near(Elastic *e, Couple c, PetscInt k)
{
  const SolidsState *s = e->s;
  const SolidMesh   *m = &s->group[s->group_of[k]].mesh;
  const MeshLocal   *l = c->loc;
  const PetscInt n[3]  = {l->period[0] > 0 ? 1 : 0, l->period[1] > 0 ? 1 : 0, l->dim == 3 && l->period[2] > 0 ? 1 : 0};
  PetscReal      reach = 0;

  PetscFunctionBeginUser;
  e->contacts.nnear = 0;
  for (PetscInt i = 0; i < m->nb_side * m->nside; i++) {
    const PetscInt cell = e->node.cell[s->first[k] + m->side[i]];

    if (cell >= 0) reach = PetscMax(reach, cell_size(l, cell));
  }
  for (PetscInt other = 0; other < s->n; other++)
    for (PetscInt z = -n[2]; z <= n[2]; z++)
      for (PetscInt y = -n[1]; y <= n[1]; y++)
        for (PetscInt x = -n[0]; x <= n[0]; x++) PetscCall(list_image(e, l, k, other, (PetscInt[3]){x, y, z}, reach));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Those in the list; a membrane that the solid started in from within */
static PetscErrorCode check_solids(const Elastic *e, Couple c, PetscReal size, const Gap *which, Gap *best)
{
  const AlignSurfaces *t   = ElasticSurfacesGet(e->surfaces);
  const PetscInt       dim = c->loc->dim;
  Gap                  at  = *which;

  PetscFunctionBeginUser;
  at.kind = TO_SOLID;
  for (PetscInt i = 0; i < e->contacts.nnear; i++) {
    const PetscReal *image = e->contacts.image[i];
    PetscReal        d, x[3], y[3] = {0, 0, 0};

    at.other = e->contacts.near[i];
    if (distance2(dim, at.x, image) > PetscSqr(t->radius[at.other] + size)) continue;
    PetscCall((*t->distance)(t->ctx, at.other, image, 1, at.x, &d));
    if (e->within && e->within[at.solid * t->n + at.other]) d = -d;
    if (!is_narrower(d, size, best)) continue;
    for (PetscInt a = 0; a < 3; a++) at.away[a] = image[a] - t->centre[at.other][a];
    for (PetscInt a = 0; a < 3; a++) x[a] = at.x[a] - at.away[a];
    PetscCall((*t->project)(t->ctx, at.other, 1, x, y));
    for (PetscInt a = 0; a < dim; a++) y[a] += at.away[a];
    note(best, d, size, y, &at);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_bodies(Couple c, PetscReal size, const Gap *which, Gap *best)
{
  Gap at = *which;

  PetscFunctionBeginUser;
  at.kind = TO_BODY;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal x[3], y[3] = {0, 0, 0}, d, r2 = 0;

    if (c->s->removed[k]) continue;
    for (PetscInt a = 0; a < c->loc->dim; a++) {
      const PetscReal r = MeshNearest(c->loc, a, at.x[a] - c->rigid.X[k][a]);

      x[a] = c->rigid.X[k][a] + r;
      r2 += r * r;
    }
    if (r2 > PetscSqr(BodiesGetRadius(c->s, k) + size)) continue;
    PetscCall(BodiesDistance(c->bodies, k, c->rigid.X[k], c->rigid.q[k], 1, x, &d));
    if (!is_narrower(d, size, best)) continue;
    PetscCall(BodiesProject(c->bodies, k, c->rigid.X[k], c->rigid.q[k], 1, x, y));
    for (PetscInt a = 0; a < c->loc->dim; a++) y[a] += at.x[a] - x[a];
    at.other = c->s->body_group[k];
    at.body  = k;
    note(best, d, size, y, &at);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Once: which solid starts in which membrane, and has it around */
static PetscErrorCode find_within(Elastic *e)
{
  const SolidsState   *s = e->s;
  const AlignSurfaces *t = ElasticSurfacesGet(e->surfaces);

  PetscFunctionBeginUser;
  if (e->within || !SolidsHave(s, PETSC_TRUE)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ElasticSurfacesSet(e->surfaces, s->X));
  PetscCall(PetscCalloc1(s->n * s->n, &e->within));
  for (PetscInt i = 0; i < s->n * s->n; i++) {
    const PetscInt k = i / s->n, other = i % s->n;
    PetscReal      d = 0;

    if (k == other || !s->group[s->group_of[other]].membrane) continue;
    if (distance2(s->dim, t->centre[k], t->centre[other]) < PetscSqr(t->radius[other]))
      PetscCall((*t->distance)(t->ctx, other, t->centre[other], 1, s->X + s->dim * s->first[k], &d));
    e->within[i] = (PetscBool)(d < 0);
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
  char               what[256], third[32] = "";
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
  if (s->dim == 3) (void)snprintf(third, sizeof(third), ", %.4g", (double)gap.x[2]);
  SETERRQ(c->comm, PETSC_ERR_USER_INPUT,
          "An elastic particle of group '%s' comes to %.3g from %s at t = %g, near (%.4g, %.4g%s), less than a hundredth of a cell (%.3g): contact does not "
          "keep it open. Use a shorter step (-sim_dt %g), smaller cells there (-mesh_cells, -mesh_focus_h), or let it start apart "
          "(-particle_%s_position)",
          group, (double)gap.gap, what, (double)c->step->time, (double)gap.x[0], (double)gap.x[1], third,
          (double)(gap.cells != 0 ? gap.gap / gap.cells : 0), (double)(0.5 * c->step->dt), group);
}

/* ---- contact ---- */

/* The part `length` of an outline (area of a surface) at that node pushes what is nearest, of each kind: of two solids
   each side half, as both have nodes that see the other */
static PetscErrorCode add_contact(Elastic *e, PetscInt node, PetscReal length, const Gap *g)
{
  const SolidGroup *group = e->s->group + e->s->group_of[g->solid];
  const PetscReal   size = g->gap / g->cells, part = g->kind == TO_SOLID ? 0.5 * length : length;
  const PetscReal   there[3] = {g->y[0] - g->away[0], g->y[1] - g->away[1], g->y[2] - g->away[2]};
  ElasticContact   *t;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(e->contacts.n + 1, &e->contacts.capacity, &e->contacts.list, sizeof(*e->contacts.list), NULL));
  t  = e->contacts.list + e->contacts.n++;
  *t = (ElasticContact){.node  = node,
                        .body  = g->kind == TO_BODY ? g->body : -1,
                        .force = part * group->stiffness * (1 - g->cells),
                        .rate  = part * group->stiffness / size,
                        .y     = {g->y[0], g->y[1], g->y[2]}};
  for (PetscInt a = 0; a < 3; a++) t->n[a] = (g->x[a] - g->y[a]) / g->gap;
  if (g->kind == TO_SOLID) PetscCall(ElasticSurfacesEvaluate(e->surfaces, g->other, there, t->other, t->weight));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Node j of side i of solid k */
static PetscErrorCode look_around(Elastic *e, Couple c, const PetscInt on[], PetscInt k, PetscInt i, PetscInt j,
                                  Gap *narrowest)
{
  const SolidGroup *g   = e->s->group + e->s->group_of[k];
  const PetscInt    dim = g->mesh.dim, *side = g->mesh.side + g->mesh.nb_side * i;
  const PetscInt    node = e->s->first[k] + side[j], cell = e->node.cell[node];
  Gap               at = {.solid = k}, best[NKIND];
  PetscInt          all[ELASTIC_SIDE];
  PetscReal         size, weight[ELASTIC_SIDE];

  PetscFunctionBeginUser;
  if (cell < 0) PetscFunctionReturn(PETSC_SUCCESS); /* of another rank */
  for (PetscInt a = 0; a < dim; a++) at.x[a] = e->x[dim * node + a];
  for (PetscInt b = 0; b < g->mesh.nb_side; b++) all[b] = e->s->first[k] + side[b];
  size = cell_size(c->loc, cell);
  if (is_near_clamp(g, side[j], size)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt kind = 0; kind < NKIND; kind++) best[kind] = (Gap){.cells = 1};
  PetscCall(check_boundary(c, cell, on, size, &at, &best[TO_BOUNDARY]));
  PetscCall(check_solids(e, c, size, &at, &best[TO_SOLID]));
  PetscCall(check_bodies(c, size, &at, &best[TO_BODY]));
  for (PetscInt kind = 0; kind < NKIND; kind++) {
    if (best[kind].cells >= 1) continue;
    if (best[kind].cells < narrowest->cells) *narrowest = best[kind];
    if (best[kind].gap <= 0) continue;
    ElasticSurfacesGetSizes(e->surfaces, all, weight);
    PetscCall(add_contact(e, node, weight[j], &best[kind]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* That it was needed, once */
static PetscErrorCode remark_contact(Elastic *e, Couple c, PetscReal narrowest)
{
  PetscFunctionBeginUser;
  if (e->contacts.touched || narrowest >= 1) PetscFunctionReturn(PETSC_SUCCESS);
  e->contacts.touched = PETSC_TRUE;
  PetscCall(
    LogRemark("an elastic particle comes closer than a cell to something at t = %g: a pressure that grows to its shear modulus as the gap closes keeps "
              "it away; the flow in the gap is not resolved",
              (double)c->step->time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticFindContacts(Elastic *e, Couple c)
{
  const SolidsState *s    = e->s;
  Gap                best = {.cells = 1};
  PetscReal          narrowest;
  PetscInt          *on;

  PetscFunctionBeginUser;
  e->contacts.n = 0;
  PetscCall(PetscMalloc1(c->loc->nnode_all, &on));
  PetscCall(mark_boundaries(c, on));
  PetscCall(find_within(e));
  PetscCall(ElasticSurfacesSet(e->surfaces, e->x));
  for (PetscInt k = 0; k < s->n; k++) {
    const SolidMesh *m = &s->group[s->group_of[k]].mesh;

    if (!e->node.reached[k]) continue;
    PetscCall(list_near(e, c, k));
    for (PetscInt i = 0; i < m->nb_side * m->nside; i++)
      PetscCall(look_around(e, c, on, k, i / m->nb_side, i % m->nb_side, &best));
  }
  PetscCall(PetscFree(on));
  PetscCall(MPIU_Allreduce(&best.cells, &narrowest, 1, MPIU_REAL, MPIU_MIN, c->comm));
  if (narrowest < CLOSED) PetscCall(stop(e, c, &best, narrowest));
  PetscCall(remark_contact(e, c, narrowest));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Contact t pushes the unknowns row[n] along v[n], with force[n] less rate v . (the way from x*) */
static PetscInt list_unknowns(const Elastic *e, const ElasticContact *t, PetscInt row[], PetscReal v[])
{
  const PetscInt dim = e->s->dim, nb = dim == 2 ? 3 : 9;
  PetscBool      both = PETSC_FALSE;

  for (PetscInt j = 0; j < nb; j++) both = (PetscBool)(both || t->weight[j] != 0);
  for (PetscInt i = 0; i < dim * (both ? 1 + nb : 1); i++) {
    const PetscInt j = i / dim, a = i % dim;

    row[i] = dim * (j ? t->other[j - 1] : t->node) + a;
    v[i]   = (j ? -t->weight[j - 1] : 1) * t->n[a];
  }
  return dim * (both ? 1 + nb : 1);
}

PetscErrorCode ElasticCountContacts(const Elastic *e, Vec entries)
{
  PetscFunctionBeginUser;
  for (PetscInt m = 0; m < e->contacts.n; m++) {
    PetscInt  n, row[3 * (1 + ELASTIC_SIDE)];
    PetscReal v[3 * (1 + ELASTIC_SIDE)];

    n = list_unknowns(e, e->contacts.list + m, row, v) / e->s->dim;
    for (PetscInt i = 0; i < n; i++) {
      row[i] = row[i * e->s->dim] / e->s->dim;
      v[i]   = n > 1 ? n : 0; /* a node by itself has these entries */
    }
    PetscCall(VecSetValues(entries, n, row, v, ADD_VALUES));
  }
  PetscCall(VecAssemblyBegin(entries));
  PetscCall(VecAssemblyEnd(entries));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Spring on the way from x*, in matrix and force */
PetscErrorCode ElasticAddContacts(const Elastic *e, PetscReal bdt)
{
  PetscFunctionBeginUser;
  for (PetscInt m = 0; m < e->contacts.n; m++) {
    const ElasticContact *t = e->contacts.list + m;
    PetscInt              n, row[3 * (1 + ELASTIC_SIDE)];
    PetscReal             v[3 * (1 + ELASTIC_SIDE)], f[3 * (1 + ELASTIC_SIDE)], A[9 * PetscSqr(1 + ELASTIC_SIDE)];
    PetscReal             force = t->force;

    n = list_unknowns(e, t, row, v);
    for (PetscInt i = 0; i < n; i++) force -= t->rate * v[i] * (e->a[row[i]] - e->x[row[i]]);
    for (PetscInt i = 0; i < n; i++) {
      f[i] = force * v[i];
      for (PetscInt j = 0; j < n; j++) A[i * n + j] = bdt * t->rate * v[i] * v[j];
    }
    PetscCall(MatSetValues(e->K, n, row, n, row, A, ADD_VALUES));
    PetscCall(VecSetValues(e->fs, n, row, f, ADD_VALUES));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal ElasticContactPower(const Elastic *e)
{
  PetscReal power = 0;

  for (PetscInt m = 0; m < e->contacts.n; m++) {
    const ElasticContact *t = e->contacts.list + m;
    PetscInt              n, row[3 * (1 + ELASTIC_SIDE)];
    PetscReal             v[3 * (1 + ELASTIC_SIDE)], force = t->force, speed = 0;

    n = list_unknowns(e, t, row, v);
    for (PetscInt i = 0; i < n; i++) {
      force -= t->rate * v[i] * (e->end[row[i]] - e->x[row[i]]);
      speed += v[i] * e->u[row[i]];
    }
    power += force * speed;
  }
  return power;
}

PetscErrorCode ElasticPushBodies(const Elastic *e, Couple c, PetscReal rows[])
{
  const PetscInt nr = c->nr;
  PetscReal     *push, sum[6];

  PetscFunctionBeginUser;
  if (!c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(c->s->n * nr, &push));
  for (PetscInt i = 0; i < e->contacts.n; i++) {
    const ElasticContact *t = e->contacts.list + i;
    PetscReal             force[3], arm[3] = {0, 0, 0}, torque[3];

    if (t->body < 0) continue;
    for (PetscInt a = 0; a < 3; a++) force[a] = -t->force * t->n[a];
    for (PetscInt a = 0; a < c->loc->dim; a++) arm[a] = MeshNearest(c->loc, a, t->y[a] - c->rigid.P[t->body][a]);
    cross(arm, force, torque);
    PetscCall(RigidReduceForce(c->bodies, t->body, c->rigid.q[t->body], force, torque, sum));
    for (PetscInt j = 0; j < nr; j++) push[t->body * nr + j] += sum[j];
  }
  PetscCall(BodiesSumLocal(c->bodies, nr, push));
  for (PetscInt i = 0; i < c->s->n * nr; i++) rows[i] += push[i];
  PetscCall(PetscFree(push));
  PetscFunctionReturn(PETSC_SUCCESS);
}
