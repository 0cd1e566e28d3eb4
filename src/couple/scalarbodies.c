/* ScalarBodies: see scalarbodies.h. */
#include "compat.h"
#include "impl.h"
#include "scalarbodies.h"
#include "scalarcarry.h"
#include "scalarcover.h"
#include "scalargrowth.h"
#include "scalarheat.h"
#include "scalarlumps.h"
#include "scalarmaterial.h"
#include "scalarsides.h"
#include "scalarshift.h"
#include "scalarstart.h"
#include "scalarweight.h"

#define FAR 0.2 /* volume of a body in its cells that is not the exact one by more: it leaves the domain */

struct _p_ScalarBodies {
  PetscInt        n;        /* scalars */
  ScalarMaterial *material; /* [ngroup][n] */
  PetscBool       nodal;    /* method nodal: values at nodes */
  PetscBool       on_sides; /* method aligned, and a group with a flux or exchange */
  PetscBool       decays;   /* has a group a reaction inside? */
  ScalarCover     cover;
  ScalarHeat      heat;
  PetscBool       carries; /* is the mesh lined up with bodies that move? */
  ScalarCarry     carry;   /* made with the first step on a mesh */
  PetscBool       moves;   /* is a body of those whose heat is in the books? */
  PetscReal      *flux;    /* [nbodies] of a scalar into the fluid */
  PetscReal      *freed;   /* [n] ScalarGrowthFreed of the step */
  PetscReal (*room)[2];    /* [nbodies] volume of a body in its cells, and of fluid in those cut */
  ScalarWeight weight;
  ScalarGrowth growth;
  BodyLumps    lumps;   /* NULL: no body has one value */
  PetscReal   *fluid;   /* [ncell_all] NULL: all is */
  PetscReal   *outside; /* [cover.ndistance] part of a sub-cell outside */
  PetscReal   *shift;   /* [nnode_all][dim] of nodes inside bodies that the mesh is lined up with */
  struct CellData {
    PetscReal     *capacity, *conductivity, *source; /* [ncell_all] */
    PetscReal     *decay;                            /* [ncell_all] NULL: no group has a reaction */
    PetscInt      *sample, *counts, *fluid;          /* [ncell_all] */
    PetscBool     *fixed;                            /* [nnode_all] */
    PetscReal     *value;                            /* [nnode_all] */
    PetscInt      *lump;                             /* [nnode_all] body with one value, -1 */
    PetscInt      *body;                             /* [nnode_all] whose fixed node it is */
    ScalarSide    *side;                             /* on surfaces that the mesh is lined up with, */
    ScalarSurface *surface;                          /* [nbodies] with fluxes by expressions */
    ScalarSamples *samples;
    PetscReal     *pool;
  } * data; /* [n] */
};

/* Are books kept of what the group has of the scalar, and is given back what appears? */
static void keep_books(ScalarBodies s, Couple c, PetscInt g, PetscInt i, const ScalarParameters *par)
{
  const ScalarMaterial *m = s->material + g * s->n + i;

  /* with a flux or exchange, lined up, the fluid's heat is all there is (scalarcarry.h) */
  s->heat.keeps[g * s->n + i] = (PetscBool)(ScalarGroupMoves(c->s->group + g) && !c->s->group[g].body_fitted &&
                                            !par->periodic_gradient &&
                                            !(c->method.table->moves_nodes &&
                                              (ScalarMaterialIsSurface(m) || m->condition == SCALAR_BODY_LUMPED)) &&
                                            (m->condition != SCALAR_BODY_CONJUGATE || m->capacity != par->capacity));
  s->heat.pays[g * s->n + i]  = (PetscBool)(s->heat.keeps[g * s->n + i] && m->condition != SCALAR_BODY_VALUE);
  s->moves                    = (PetscBool)(s->moves || s->heat.keeps[g * s->n + i]);
}

PetscErrorCode ScalarBodiesCreate(Couple c, Scalars scalars, ScalarBodies *bodies)
{
  ScalarBodies s;

  PetscFunctionBeginUser;
  *bodies = NULL;
  if (!c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&s));
  s->n     = ScalarsCount(scalars);
  s->nodal = (PetscBool)(c->method.table == &method_nodal);
  PetscCall(ScalarCoverCreate(c->loc->dim, &s->cover));
  PetscCall(PetscCalloc1(s->n * c->s->ngroups, &s->material));
  PetscCall(PetscCalloc2(s->n, &s->data, s->n, &s->freed));
  PetscCall(ScalarHeatCreate(c, s->n, &s->heat));
  PetscCall(BodiesAttachWork(c->bodies, sizeof(*s->room), (void **)&s->room));
  PetscCall(BodiesAttachWork(c->bodies, sizeof(*s->flux), (void **)&s->flux));
  for (PetscInt g = 0; g < c->s->ngroups; g++) {
    const BodyGroup *group = c->s->group + g;

    if (c->method.table->moves_nodes && ScalarGroupMoves(group) && !group->body_fitted) s->carries = PETSC_TRUE;
    for (PetscInt i = 0; i < s->n; i++) {
      const ScalarParameters *par;

      PetscCall(ScalarsGetParameters(scalars, i, &par));
      PetscCall(ScalarMaterialRead(c, group, par, s->material + g * s->n + i));
      keep_books(s, c, g, i, par);
      s->decays = (PetscBool)(s->decays || s->material[g * s->n + i].decay > 0);
      if (ExprUsesFields(s->material[g * s->n + i].flux_of)) PetscCall(ScalarsReact(scalars, i));
      if (c->method.table->moves_nodes && ScalarMaterialIsSurface(s->material + g * s->n + i)) s->on_sides = PETSC_TRUE;
      if (s->heat.keeps[g * s->n + i]) PetscCall(ScalarsExtend(scalars, i));
    }
  }
  PetscCall(BodyLumpsCreate(c, s->n, s->material, &s->lumps));
  PetscCall(ScalarWeightCreate(c, s->n, s->material, &s->weight));
  PetscCall(ScalarGrowthCreate(c, s->n, s->material, &s->growth));
  *bodies = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode free_data(struct CellData *d)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree6(d->capacity, d->conductivity, d->source, d->sample, d->counts, d->fluid));
  PetscCall(PetscFree4(d->fixed, d->value, d->lump, d->body));
  PetscCall(PetscFree(d->decay));
  PetscCall(PetscFree(d->samples));
  PetscCall(PetscFree(d->side));
  PetscCall(PetscFree(d->surface));
  PetscCall(PetscFree(d->pool));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesDiscard(ScalarBodies s)
{
  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < s->n; i++) PetscCall(free_data(s->data + i));
  PetscCall(PetscFree(s->fluid));
  PetscCall(PetscFree(s->outside));
  PetscCall(PetscFree(s->shift));
  PetscCall(ScalarCarryDestroy(&s->carry));
  s->cover.reach = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesDestroy(Couple c, ScalarBodies *bodies)
{
  ScalarBodies s = *bodies;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarBodiesDiscard(s));
  PetscCall(ScalarCoverDestroy(&s->cover));
  PetscCall(ScalarHeatDestroy(c, &s->heat));
  PetscCall(BodyLumpsDestroy(c, &s->lumps));
  PetscCall(ScalarWeightDestroy(c, &s->weight));
  PetscCall(ScalarGrowthDestroy(c, &s->growth));
  PetscCall(BodiesDetach(c->bodies, (void **)&s->room));
  PetscCall(BodiesDetach(c->bodies, (void **)&s->flux));
  for (PetscInt i = 0; i < s->n * c->s->ngroups; i++) PetscCall(ScalarMaterialForget(s->material + i));
  PetscCall(PetscFree(s->material));
  PetscCall(PetscFree2(s->data, s->freed));
  PetscCall(PetscFree(*bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const PetscReal *ScalarBodiesFluid(ScalarBodies s)
{
  return s ? s->fluid : NULL;
}

void ScalarBodiesGetOpen(ScalarBodies s, Couple c, const ScalarParameters *par, PetscInt i, PetscBool open[])
{
  for (PetscInt g = 0; g < c->s->ngroups; g++) {
    const ScalarMaterial *m = s ? s->material + g * s->n + i : NULL;

    open[g] = (PetscBool)(m && !c->s->group[g].body_fitted && (!ScalarMaterialIsFluid(m, par) || m->starts));
  }
}

/* ---- what they are made of ---- */

static PetscErrorCode create_data(ScalarBodies s, Couple c)
{
  const PetscInt nc = c->loc->ncell_all, nn = c->loc->nnode_all;

  PetscFunctionBeginUser;
  if (s->fluid) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(nc, &s->fluid));
  for (PetscInt i = 0; i < s->n; i++) {
    struct CellData *d = s->data + i;

    PetscCall(PetscMalloc6(nc, &d->capacity, nc, &d->conductivity, nc, &d->source, nc, &d->sample, nc, &d->counts, nc,
                           &d->fluid));
    if (s->decays) PetscCall(PetscMalloc1(nc, &d->decay));
    PetscCall(PetscMalloc4(nn, &d->fixed, nn, &d->value, nn, &d->lump, nn, &d->body));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Volumes of bodies in their cells, with the sub-cells of the samples; after ScalarCoverOutside */
static PetscErrorCode measure_room(ScalarBodies s, Couple c, Scalars scalars)
{
  const PetscInt   n = s->cover.nsample;
  const PetscReal *size, one = 1;
  PetscReal        part[SCALAR_MAX_SAMPLES];

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(c->flow, &size));
  PetscCall(PetscArrayzero((PetscReal *)s->room, 2 * c->s->n));
  for (PetscInt e = 0; e < s->cover.n; e++) {
    const CoveredCell *at = s->cover.covered + e;
    PetscReal          inside, outside;

    if (at->cell >= c->loc->ncell || !at->first) continue;
    for (PetscInt p = 0; p < s->cover.count && at->distance >= 0; p++)
      part[p] = ScalarCoverPart(s->cover.distance[at->distance + p], size[at->cell] / n);
    PetscCall(ScalarsIntegrate(scalars, at->cell, at->distance >= 0 ? n : 0, at->distance >= 0 ? part : &one, &inside));
    s->room[at->body][0] += inside;
    if (at->distance < 0) continue;
    PetscCall(ScalarsIntegrate(scalars, at->cell, n, s->outside + at->distance, &outside));
    s->room[at->body][1] += outside;
  }
  PetscCall(BodiesSumLocal(c->bodies, 2, (PetscReal *)s->room));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* By how much the capacity of a body that moves, in excess of the fluid's, is scaled: to that of its exact volume */
static PetscReal get_scale(const struct _p_ScalarBodies *s, Couple c, PetscInt k, PetscInt i, const ScalarMaterial *m)
{
  const PetscReal volume = BodiesVolume(c->s, k);

  if (!s->heat.keeps[c->s->body_group[k] * s->n + i] || m->condition != SCALAR_BODY_CONJUGATE) return 1;
  return PetscAbsReal(s->room[k][0] / volume - 1) < FAR ? volume / s->room[k][0] : 1;
}

/* Of a cell inside as a whole */
static void set_inside(Couple c, const CoveredCell *at, const ScalarMaterial *m, const ScalarParameters *par,
                       PetscReal scale, struct CellData *d)
{
  const PetscInt *node = c->loc->cell_node + at->cell * c->loc->nb;

  d->capacity[at->cell]     = scale == 1 ? m->capacity : par->capacity + scale * (m->capacity - par->capacity);
  d->conductivity[at->cell] = m->condition == SCALAR_BODY_CONJUGATE ? m->conductivity : -1;
  d->source[at->cell]       = m->condition == SCALAR_BODY_LUMPED ? 0 : m->source; /* its own equation has it */
  if (d->decay) d->decay[at->cell] = m->decay;
  for (PetscInt j = 0; j < c->loc->nb && m->condition == SCALAR_BODY_LUMPED; j++) d->lump[node[j]] = at->body;
  for (PetscInt j = 0; j < c->loc->nb && m->condition == SCALAR_BODY_VALUE; j++) {
    d->fixed[node[j]] = PETSC_TRUE;
    d->value[node[j]] = m->value;
    d->body[node[j]]  = at->body;
  }
}

/* Method nodal: nodes inside have the value, and cells around them are fluid */
static PetscErrorCode fix_inside(Couple c, ScalarBodies s, PetscInt i, struct CellData *d)
{
  const PetscInt *body;
  PetscInt        n;
  const PetscInt *node;

  PetscFunctionBeginUser;
  PetscCall(IndicatorGetNodes(c->indicator, &body, &n, &node));
  for (PetscInt e = 0; e < n; e++) {
    const ScalarMaterial *m = s->material + c->s->body_group[body[node[e]]] * s->n + i;

    if (m->condition == SCALAR_BODY_LUMPED) d->lump[node[e]] = body[node[e]];
    if (m->condition != SCALAR_BODY_VALUE) continue;
    d->fixed[node[e]] = PETSC_TRUE;
    d->value[node[e]] = m->value;
    d->body[node[e]]  = body[node[e]];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* All is fluid */
static void set_fluid(const MeshLocal *l, const ScalarParameters *par, struct CellData *d)
{
  for (PetscInt e = 0; e < l->ncell_all; e++) {
    d->capacity[e]     = par->capacity;
    d->conductivity[e] = par->conductivity;
    d->source[e]       = 0;
    if (d->decay) d->decay[e] = 0;
    d->sample[e] = -1;
    d->counts[e] = SCALAR_COUNTS_ALL;
    d->fluid[e]  = SCALAR_COUNTS_ALL;
  }
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    d->fixed[i] = PETSC_FALSE;
    d->lump[i]  = -1;
  }
}

static PetscErrorCode set_scalar(ScalarBodies s, Couple c, Scalars scalars, PetscInt i)
{
  const PetscInt          each = 5 * s->cover.count;
  const ScalarParameters *par;
  const PetscReal        *size;
  struct CellData        *d = s->data + i;
  PetscInt                n = 0;
  ScalarCells             cells;
  ScalarNodes             nodes = {d->fixed, d->value, d->body};

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(c->flow, &size));
  PetscCall(ScalarsGetParameters(scalars, i, &par));
  set_fluid(c->loc, par, d);
  PetscCall(PetscRealloc(PetscMax(1, (size_t)c->s->n) * sizeof(*d->surface), &d->surface));
  for (PetscInt k = 0; k < c->s->n; k++) ScalarMaterialSurface(c, s->material, s->n, i, k, d->surface + k);
  for (PetscInt e = 0; e < s->cover.n; e++) n += s->cover.covered[e].distance >= 0;
  PetscCall(PetscRealloc(PetscMax(1, n) * sizeof(*d->samples), &d->samples));
  PetscCall(PetscRealloc((size_t)PetscMax(1, n) * (size_t)each * sizeof(PetscReal), &d->pool));
  n = 0;
  for (PetscInt e = 0; e < s->cover.n; e++) {
    const CoveredCell    *at    = s->cover.covered + e;
    const ScalarMaterial *m     = s->material + c->s->body_group[at->body] * s->n + i;
    const PetscReal       scale = get_scale(s, c, at->body, i, m);

    if (at->first && m->condition != SCALAR_BODY_CONJUGATE)
      d->counts[at->cell] = at->distance < 0 ? SCALAR_COUNTS_NOTHING : at->distance;
    if (at->first) d->fluid[at->cell] = at->distance < 0 ? SCALAR_COUNTS_NOTHING : at->distance;
    if (s->nodal && ScalarMaterialHasValue(m)) continue;
    if (at->distance < 0 && (at->first || ScalarMaterialHasValue(m))) set_inside(c, at, m, par, scale, d);
    else if (at->first) {
      ScalarMaterialSamples(m, par, &s->cover, at, size[at->cell], scale, d->surface,
                            d->pool + (size_t)n * (size_t)each, d->samples + n);
      d->sample[at->cell] = n++;
    }
  }
  if (s->nodal) PetscCall(fix_inside(c, s, i, d));
  cells = (ScalarCells){.capacity     = d->capacity,
                        .conductivity = d->conductivity,
                        .source       = d->source,
                        .decay        = d->decay,
                        .nsample      = n,
                        .sample       = d->sample,
                        .samples      = d->samples,
                        .counts       = d->counts,
                        .outside      = s->outside,
                        .noutside     = s->cover.nsample,
                        .fluid        = d->fluid};
  PetscCall(ScalarsSetCells(scalars, i, &cells));
  PetscCall(ScalarsSetNodes(scalars, i, &nodes));
  PetscCall(BodyLumpsSet(s->lumps, c, scalars, i, par, d->lump, s->nodal));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Flux and exchange through surfaces that the mesh is lined up with */
static PetscErrorCode set_sides(ScalarBodies s, Couple c, Scalars scalars)
{
  PetscInt    n;
  ScalarSide *side;

  PetscFunctionBeginUser;
  if (!s->on_sides) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarSidesFind(c, &n, &side));
  for (PetscInt i = 0; i < s->n; i++) {
    struct CellData *d    = s->data + i;
    PetscInt         kept = 0;

    PetscCall(PetscRealloc(PetscMax(1, (size_t)n) * sizeof(*d->side), &d->side));
    for (PetscInt e = 0; e < n; e++) {
      const ScalarMaterial *m = s->material + c->s->body_group[side[e].body] * s->n + i;

      if (!ScalarMaterialIsSurface(m)) continue;
      d->side[kept]   = side[e];
      d->side[kept].q = m->condition == SCALAR_BODY_FLUX ? m->flux : m->transfer * m->value;
      d->side[kept].h = m->condition == SCALAR_BODY_FLUX ? 0 : m->transfer;
      if (m->flux_of) d->side[kept].surface = d->surface + side[e].body;
      kept++;
    }
    PetscCall(ScalarsSetSides(scalars, i, kept, d->side));
  }
  PetscCall(PetscFree(side));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies are at X, q: cells and nodes */
static PetscErrorCode set_cells(ScalarBodies s, Couple c, Scalars scalars, const PetscReal (*X)[3],
                                const PetscReal (*q)[4])
{
  PetscFunctionBeginUser;
  PetscCall(create_data(s, c));
  PetscCall(ScalarCoverFind(&s->cover, c, X, q));
  for (PetscInt e = 0; e < c->loc->ncell_all; e++) s->fluid[e] = 1;
  for (const CoveredCell *at = s->cover.covered; at < s->cover.covered + s->cover.n; at++)
    s->fluid[at->cell] = PetscMax(0, s->fluid[at->cell] - at->inside);
  PetscCall(ScalarCoverOutside(&s->cover, c, &s->outside));
  if (s->moves) PetscCall(measure_room(s, c, scalars));
  for (PetscInt i = 0; i < s->n; i++) PetscCall(set_scalar(s, c, scalars, i));
  PetscCall(set_sides(s, c, scalars));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_shift(ScalarBodies s, Couple c, Scalars scalars)
{
  const PetscInt *inactive = MeshUpdateGetInactive(c->mesh_update);

  PetscFunctionBeginUser;
  if (inactive) PetscCall(ScalarShiftInside(c, c->loc->x, inactive, &s->shift));
  PetscCall(ScalarsSetShift(scalars, s->shift));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesUpdate(ScalarBodies s, Couple c, Scalars scalars)
{
  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(set_shift(s, c, scalars));
  PetscCall(set_cells(s, c, scalars, (const PetscReal(*)[3])c->rigid.X, (const PetscReal(*)[4])c->rigid.q));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesBegin(ScalarBodies s, Couple c, Scalars scalars, PetscReal extrapolation)
{
  PetscFunctionBeginUser;
  if (s) PetscCall(ScalarWeightBegin(&s->weight, c, extrapolation));
  if (s && c->step->dt > 0) PetscCall(ScalarGrowthBegin(&s->growth, c));
  if (s && s->carries && !s->carry) PetscCall(ScalarCarryCreate(c, scalars, &s->carry));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* On a mesh lined up with bodies: values of the options where the nodes are now, and those that go along were at the
   start */
static PetscErrorCode start_aligned(ScalarBodies s, Couple c, Scalars scalars)
{
  const PetscInt dim = c->loc->dim;
  PetscReal     *x;

  PetscFunctionBeginUser;
  PetscCall(set_shift(s, c, scalars));
  if (s->carry) {
    PetscCall(ScalarCarryStart(s->carry, s->shift));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscMalloc1(c->loc->nnode_all * dim, &x));
  for (PetscInt i = 0; i < c->loc->nnode_all * dim; i++) x[i] = c->loc->x[i] + s->shift[i];
  for (PetscInt i = 0; i < s->n; i++) PetscCall(ScalarsStartAt(scalars, i, x));
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Scalar i begins with the values that bodies have: of those held the nodes inside, body [nnode_all] */
static PetscErrorCode start_values(ScalarBodies s, Couple c, Scalars scalars, PetscInt i, const PetscInt body[])
{
  PetscReal *T[3];

  PetscFunctionBeginUser;
  PetscCall(ScalarsGetFields(scalars, i, &T[0], &T[1]));
  PetscCall(ScalarsGetSolution(scalars, i, &T[2]));
  PetscCall(ScalarStartBodies(c, scalars, i, &s->cover, s->material, T[0]));
  for (PetscInt k = 0; k < c->loc->nnode_all; k++) {
    const ScalarMaterial *m = body[k] >= 0 ? s->material + c->s->body_group[body[k]] * s->n + i : NULL;

    if (m && ScalarMaterialHasValue(m)) T[0][k] = m->initial;
    T[1][k] = T[2][k] = T[0][k];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesStart(ScalarBodies s, Couple c, Scalars scalars)
{
  const PetscBool aligned = (PetscBool)(MeshUpdateGetInactive(c->mesh_update) != NULL);
  PetscBool       any     = s ? s->moves : PETSC_FALSE;
  PetscInt       *body;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  if (aligned) PetscCall(start_aligned(s, c, scalars));
  for (PetscInt g = 0; g < c->s->ngroups * s->n; g++) any = (PetscBool)(any || s->material[g].starts);
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  if (aligned)
    PetscCall(set_cells(s, c, scalars, (const PetscReal(*)[3])c->rigid.X, (const PetscReal(*)[4])c->rigid.q));
  else PetscCall(set_cells(s, c, scalars, (const PetscReal(*)[3])c->s->x, (const PetscReal(*)[4])c->s->q));
  PetscCall(PetscMalloc1(c->loc->nnode_all, &body));
  PetscCall(CoupleMarkInside(c, body));
  for (PetscInt i = 0; i < s->n; i++) PetscCall(start_values(s, c, scalars, i, body));
  PetscCall(PetscFree(body));
  if (!s->moves) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarHeatBegin(&s->heat, c, scalars, &s->cover));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What bodies give back, as sources of their cells */
static PetscErrorCode give_back(ScalarBodies s, Couple c, Scalars scalars, PetscInt i)
{
  const PetscReal *size;
  struct CellData *d;

  PetscFunctionBeginUser;
  PetscCall(ScalarHeatPredict(&s->heat, c, scalars, i, &s->cover));
  PetscCall(FlowGetCellSize(c->flow, &size));
  d = s->data + i;
  for (PetscInt e = 0; e < s->cover.n; e++) {
    const CoveredCell *at = s->cover.covered + e;
    const PetscInt     k = at->body, g = c->s->body_group[k] * s->n + i;
    const PetscBool    inside = (PetscBool)(s->material[g].condition == SCALAR_BODY_CONJUGATE);
    const PetscReal    room = s->room[k][inside ? 0 : 1], rate = room > 0 ? s->heat.given[k * s->n + i] / room : 0;

    if (!at->first || rate == 0) continue;
    if (at->distance < 0) d->source[at->cell] += inside ? rate : 0;
    for (PetscInt p = 0; p < s->cover.count && at->distance >= 0; p++) {
      const PetscReal part = ScalarCoverPart(s->cover.distance[at->distance + p], size[at->cell] / s->cover.nsample);
      const ScalarSamples *samples = d->samples + d->sample[at->cell];

      ((PetscReal *)samples->source)[p] += rate * (inside ? part : 1 - part);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesGiveBack(ScalarBodies s, Couple c, Scalars scalars, PetscInt i)
{
  PetscFunctionBeginUser;
  if (!s || c->step->dt == 0) PetscFunctionReturn(PETSC_SUCCESS);
  if (s->moves && ScalarHeatKeeps(&s->heat, c, i)) PetscCall(give_back(s, c, scalars, i));
  PetscCall(ScalarGrowthFreed(&s->growth, c, scalars, i, s->freed + i));
  if (s->carry) PetscCall(ScalarCarryGiveBack(s->carry, i, s->heat.appears[i] - s->freed[i], s->data[i].source));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesMeasure(ScalarBodies s, Couple c, Scalars scalars, PetscReal covered[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < ScalarsCount(scalars); i++) covered[i] = 0;
  if (!s || c->step->dt == 0) PetscFunctionReturn(PETSC_SUCCESS);
  if (s->moves) PetscCall(ScalarHeatMeasure(&s->heat, c, scalars, &s->cover));
  for (PetscInt i = 0; i < s->n; i++) {
    covered[i] = s->heat.covered[i];
    if (s->carry) PetscCall(ScalarCarryMeasure(s->carry, i, s->heat.appears[i] - s->freed[i], covered + i));
    else covered[i] += s->freed[i]; /* the fluid inside has had it before, and did not count */
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ScalarBodiesLetsOut(ScalarBodies s, Couple c, PetscInt i, PetscInt g)
{
  return (PetscBool)(s && !c->s->group[g].body_fitted && s->material[g * s->n + i].condition != SCALAR_BODY_CONJUGATE);
}

PetscErrorCode ScalarBodiesBalance(ScalarBodies s, Couple c, Scalars scalars, PetscInt i, ScalarBalance *b,
                                   PetscReal boundary[], PetscReal group[])
{
  PetscFunctionBeginUser;
  if (!s) {
    PetscCall(ScalarsMeasure(scalars, i, b, boundary, NULL));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscArrayzero(s->flux, c->s->n));
  PetscCall(ScalarsMeasure(scalars, i, b, boundary, s->flux));
  PetscCall(BodiesSumLocal(c->bodies, 1, s->flux));
  PetscCall(PetscArrayzero(group, c->s->ngroups));
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscInt g = c->s->body_group[k];

    /* what it gives back is not its own */
    if (s->moves && c->step->dt > 0 && s->heat.pays[g * s->n + i]) s->flux[k] -= s->heat.given[k * s->n + i];
    if (c->s->own[k] && !c->s->removed[k]) group[g] += s->flux[k];
  }
  PetscCall(BodiesSum(c->bodies, c->s->ngroups, group));
  if (c->step->dt > 0) ScalarGrowthMeasure(&s->growth, c, i, s->flux);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesLimit(ScalarBodies s, Couple c, PetscReal *dt)
{
  PetscFunctionBeginUser;
  if (s) PetscCall(ScalarGrowthLimit(&s->growth, c, dt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesConvect(ScalarBodies s, PetscReal w[])
{
  PetscFunctionBeginUser;
  if (s && s->carry) PetscCall(ScalarCarryConvect(s->carry, &s->growth, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesAccept(ScalarBodies s, Couple c, Scalars scalars)
{
  PetscFunctionBeginUser;
  if (s) PetscCall(ScalarWeightAccept(&s->weight, c, scalars));
  if (s) PetscCall(ScalarGrowthAccept(&s->growth, c));
  if (s && s->moves) ScalarHeatAccept(&s->heat, c);
  if (s && s->carry) PetscCall(ScalarCarryAccept(s->carry));
  if (s) PetscCall(BodyLumpsAccept(s->lumps, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesVisit(ScalarBodies s, Couple c, Scalars scalars, State state)
{
  PetscFunctionBeginUser;
  if (s && s->carries && !s->carry) PetscCall(ScalarCarryCreate(c, scalars, &s->carry));
  if (s && s->moves) PetscCall(ScalarHeatVisit(&s->heat, c, state));
  if (s && s->carry) PetscCall(ScalarCarryVisit(s->carry, state));
  if (s) PetscCall(BodyLumpsVisit(s->lumps, c, state));
  if (s) PetscCall(ScalarWeightVisit(&s->weight, c, state));
  if (s) PetscCall(ScalarGrowthVisit(&s->growth, c, state));
  PetscFunctionReturn(PETSC_SUCCESS);
}
