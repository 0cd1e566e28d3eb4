/* ScalarBodies: see scalarbodies.h. */
#include "compat.h"
#include "impl.h"
#include "cutcells.h"
#include "scalarbodies.h"
#include "scalarshift.h"
#include "base/array.h"
#include "base/opt.h"
#include "fem/element.h"

#define PENALTY     200  /* of a value in a cut cell, in k/h^2 */
#define EMPTY       1e-3 /* what is left of conductivity and capacity where nothing is solved for */
#define CHUNK       256
#define MAX_SAMPLES 216 /* of a cell */

enum {
  CONJUGATE,
  VALUE,
  FLUX,
  TRANSFER
};
static const char *const CONDITIONS[] = {"conjugate", "value", "flux", "transfer", NULL};

typedef struct {
  PetscInt  condition;
  PetscReal value, flux, transfer, conductivity, capacity, source, initial;
  PetscBool starts; /* with a value of its own */
} Material;

/* A cell that is not all fluid */
typedef struct {
  PetscInt  cell, body, distance; /* distance: offset of its samples, -1: all inside */
  PetscReal inside;               /* part inside */
} Covered;

struct _p_ScalarBodies {
  PetscInt   n, nsample, count; /* scalars; samples an axis, of a cell */
  Material  *material;          /* [ngroup][n] */
  PetscBool  by_centre;         /* method nodal */
  PetscInt   ncovered, capacity, ndistance, distance_capacity;
  Covered   *covered;
  PetscReal *distance; /* of samples */
  PetscReal  reach;    /* CutCellReach */
  PetscReal *fluid;    /* [ncell_all] NULL: all is */
  PetscReal *shift;    /* [nnode_all][dim] of nodes inside bodies that the mesh is lined up with */
  struct CellData {
    PetscReal     *capacity, *conductivity, *source; /* [ncell_all] */
    PetscInt      *sample;                           /* [ncell_all] */
    PetscBool     *fixed;                            /* [nnode_all] */
    PetscReal     *value;                            /* [nnode_all] */
    PetscInt       nsamples;
    ScalarSamples *samples;
    PetscReal     *pool;
  } * data; /* [n] */
};

/* ---- options ---- */

static const char *name_option(const BodyGroup *g, const char scalar[], const char ending[], char name[OPT_NAME])
{
  (void)snprintf(name, OPT_NAME, "-particle_%s_%s_%s", g->name, scalar, ending);
  return name;
}

static PetscErrorCode read_material(Couple c, const BodyGroup *g, const ScalarParameters *par, Material *m)
{
  char      name[OPT_NAME];
  PetscBool given;

  PetscFunctionBeginUser;
  m->conductivity = par->conductivity;
  m->capacity     = par->capacity;
  PetscCall(OptChoice(name_option(g, par->name, "condition", name), CONDITIONS, &m->condition));
  if (m->condition == CONJUGATE) {
    PetscCall(OptReal(name_option(g, par->name, "conductivity", name), &m->conductivity));
    PetscCall(OptReal(name_option(g, par->name, "capacity", name), &m->capacity));
    PetscCall(OptReal(name_option(g, par->name, "source", name), &m->source));
    PetscCall(OptHas(name_option(g, par->name, "initial", name), &m->starts));
    PetscCall(OptReal(name, &m->initial));
  }
  if (m->condition == VALUE || m->condition == TRANSFER) {
    PetscCall(OptHas(name_option(g, par->name, "value", name), &given));
    PetscCheck(given, c->comm, PETSC_ERR_USER_INPUT, "Group '%s' is %s for scalar '%s': give %s", g->name,
               m->condition == VALUE ? "held at a value" : "in exchange", par->name, name);
    PetscCall(OptReal(name, &m->value));
    m->starts  = (PetscBool)(m->condition == VALUE);
    m->initial = m->value;
  }
  if (m->condition == FLUX) PetscCall(OptReal(name_option(g, par->name, "flux", name), &m->flux));
  if (m->condition == TRANSFER) PetscCall(OptReal(name_option(g, par->name, "transfer", name), &m->transfer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is it what the fluid is made of? Then it may move: nothing is stored that it would take along. */
static PetscBool is_as_fluid(const Material *m, const ScalarParameters *par)
{
  return (PetscBool)(m->condition == CONJUGATE && m->conductivity == par->conductivity &&
                     m->capacity == par->capacity && m->source == 0);
}

/* Heat that bodies cover and free as they move is not booked, nor are scalars carried to nodes that move with them */
static PetscErrorCode refuse_motion(Couple c, const BodyGroup *g, const Material *m, const ScalarParameters *par)
{
  const PetscBool moves  = (PetscBool)(g->free || g->motion.given || g->motion.has_u || g->motion.has_w);
  PetscBool       steady = PETSC_FALSE, found;
  PetscReal       steps  = 0;

  PetscFunctionBeginUser;
  PetscCall(OptPeekBool("-sim_steady", &steady));
  if (!moves || steady) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(is_as_fluid(m, par) && !g->body_fitted, c->comm, PETSC_ERR_SUP,
             "-particle_%s_%s_condition %s: group '%s' moves, and what a body that moves stores of '%s' is not in the balance: hold it "
             "(-particle_%s_free none, without velocity and motion), or give it the conductivity and capacity of the fluid (leave all "
             "-particle_%s_%s_* out)",
             g->name, par->name, CONDITIONS[m->condition], g->name, par->name, g->name, g->name, par->name);
  PetscCall(OptPeekReal("-sim_steps", &steps, &found));
  PetscCheck(!c->method.table->moves_nodes || steps == 1, c->comm, PETSC_ERR_SUP,
             "-couple_method %s with -scalars %s: group '%s' moves, and scalars are not carried to nodes that move with it: take one step "
             "(-sim_steps 1, not %g), hold it (-particle_%s_free none), or use -couple_method penalty",
             c->method.table->name, par->name, g->name, (double)steps, g->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells that a surface cuts, and those inside, do not tell what acts in the fluid alone */
static PetscErrorCode refuse_fluid_terms(Couple c, const BodyGroup *g, const Material *m, const ScalarParameters *par)
{
  static const char *const TERM[] = {"source", "decay"};
  const PetscBool apart = (PetscBool)(g->body_fitted || (m->condition == VALUE && c->method.table != &method_penalty));

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 2; i++) {
    char      name[OPT_NAME], text[256];
    PetscBool given;

    (void)snprintf(name, OPT_NAME, "-scalar_%s_%s", par->name, TERM[i]);
    PetscCall(OptHas(name, &given));
    PetscCall(OptPeek(name, text, sizeof(text)));
    PetscCheck(!given || apart, c->comm, PETSC_ERR_SUP,
               "%s %s acts in the fluid, and with group '%s' its cells are not told apart: leave it out, or use "
               "-couple_method aligned with -particle_%s_%s_condition value",
               name, text, g->name, g->name, par->name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What surfaces do not do yet, one message each */
static PetscErrorCode refuse(Couple c, const BodyGroup *g, const Material *m, const ScalarParameters *par)
{
  const PetscBool surface = (PetscBool)(m->condition == FLUX || m->condition == TRANSFER);

  PetscFunctionBeginUser;
  PetscCheck(!g->body_fitted || (m->condition == CONJUGATE && is_as_fluid(m, par)), c->comm, PETSC_ERR_USER_INPUT,
             "-particle_%s_%s_condition %s: group '%s' is a hole of the mesh, whose surface is boundary '%s': give its "
             "-scalar_%s_bc_%s_value (or _flux, _transfer) and leave -particle_%s_%s_* out",
             g->name, par->name, CONDITIONS[m->condition], g->name, g->surface, par->name, g->surface, g->name,
             par->name);
  PetscCheck(!surface || c->method.table == &method_penalty, c->comm, PETSC_ERR_SUP,
             "-particle_%s_%s_condition %s: -couple_method %s has no %s through surfaces of bodies: use -couple_method penalty, or "
             "-particle_%s_%s_condition value or conjugate (with a source)",
             g->name, par->name, CONDITIONS[m->condition], c->method.table->name, CONDITIONS[m->condition], g->name,
             par->name);
  PetscCall(refuse_motion(c, g, m, par));
  PetscCall(refuse_fluid_terms(c, g, m, par));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesCreate(Couple c, Scalars scalars, ScalarBodies *bodies)
{
  ScalarBodies s;

  PetscFunctionBeginUser;
  *bodies = NULL;
  if (!c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&s));
  s->n         = ScalarsCount(scalars);
  s->nsample   = c->loc->dim == 2 ? 10 : 6;
  s->count     = PetscPowInt(s->nsample, c->loc->dim);
  s->by_centre = (PetscBool)(c->method.table == &method_nodal);
  PetscCall(PetscCalloc1(s->n * c->s->ngroups, &s->material));
  PetscCall(PetscCalloc1(s->n, &s->data));
  for (PetscInt g = 0; g < c->s->ngroups; g++)
    for (PetscInt i = 0; i < s->n; i++) {
      const ScalarParameters *par;

      PetscCall(ScalarsGetParameters(scalars, i, &par));
      PetscCall(read_material(c, c->s->group + g, par, s->material + g * s->n + i));
      PetscCall(refuse(c, c->s->group + g, s->material + g * s->n + i, par));
    }
  *bodies = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode free_data(struct CellData *d)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree4(d->capacity, d->conductivity, d->source, d->sample));
  PetscCall(PetscFree2(d->fixed, d->value));
  PetscCall(PetscFree(d->samples));
  PetscCall(PetscFree(d->pool));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesDiscard(ScalarBodies s)
{
  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < s->n; i++) PetscCall(free_data(s->data + i));
  PetscCall(PetscFree(s->fluid));
  PetscCall(PetscFree(s->shift));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesDestroy(ScalarBodies *bodies)
{
  ScalarBodies s = *bodies;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarBodiesDiscard(s));
  PetscCall(PetscFree(s->covered));
  PetscCall(PetscFree(s->distance));
  PetscCall(PetscFree(s->material));
  PetscCall(PetscFree(s->data));
  PetscCall(PetscFree(*bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const PetscReal *ScalarBodiesFluid(ScalarBodies s)
{
  return s ? s->fluid : NULL;
}

/* ---- which cells ---- */

/* Distances at the samples of a cell, and its part inside */
static PetscErrorCode sample_cell(ScalarBodies s, Couple c, PetscInt cell, PetscInt k, const PetscReal X[3],
                                  const PetscReal q[4], Covered *at)
{
  const PetscInt dim = c->loc->dim, n = s->nsample, nb = c->loc->nb;
  PetscReal      xc[MESH_MAX_NB * 3], x[MAX_SAMPLES * 3], J[9], *d, size = 0, h;
  PetscReal      inside = 0;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(s->ndistance + s->count, &s->distance_capacity, &s->distance, sizeof(*s->distance), NULL));
  d = s->distance + s->ndistance;
  PetscCall(MeshCellCoordinates(c->mesh, cell, xc));
  for (PetscInt p = 0; p < s->count; p++) {
    const PetscReal xi[3] = {(2 * (p % n) + 1.0) / n - 1, (2 * (p / n % n) + 1.0) / n - 1,
                             (2 * (p / (n * n)) + 1.0) / n - 1};

    ElementMap(dim, xc, xi, x + p * dim, J);
  }
  PetscCall(BodiesDistance(c->bodies, k, X, q, s->count, x, d));
  for (PetscInt a = 0; a < dim; a++) size += PetscSqr(xc[(nb - 1) * dim + a] - xc[a]);
  h = PetscSqrtReal(size / dim) / n;
  for (PetscInt p = 0; p < s->count; p++) inside += PetscMin(1, PetscMax(0, 0.5 - d[p] / h));
  at->inside = inside / s->count;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode cover(ScalarBodies s, Couple c, PetscInt cell, PetscInt k, const PetscReal X[3],
                            const PetscReal q[4], PetscReal d)
{
  PetscReal r;
  Covered   at = {.cell = cell, .body = k, .distance = -1, .inside = 1};

  PetscFunctionBeginUser;
  PetscCall(CutCellRadius(c->mesh, cell, &r));
  if (d > r || (s->by_centre && d > 0)) PetscFunctionReturn(PETSC_SUCCESS);
  if (d > -r && !s->by_centre) {
    PetscCall(sample_cell(s, c, cell, k, X, q, &at));
    if (at.inside == 0) PetscFunctionReturn(PETSC_SUCCESS);
    at.distance = at.inside < 1 ? s->ndistance : -1;
    if (at.inside < 1) s->ndistance += s->count;
  }
  PetscCall(ArrayReserve(s->ncovered + 1, &s->capacity, &s->covered, sizeof(*s->covered), NULL));
  s->covered[s->ncovered++] = at;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells that the image of body k at X meets */
static PetscErrorCode cover_image(ScalarBodies s, Couple c, PetscInt k, const PetscReal X[3], const PetscReal q[4])
{
  const MeshLocal *l = c->loc;
  PetscReal        x[CHUNK * 3], d[CHUNK];
  PetscInt         n, cell[CHUNK];
  const PetscInt  *list;

  PetscFunctionBeginUser;
  PetscCall(MeshNodesInBox(c->mesh, X, BodiesGetRadius(c->s, k) + s->reach, &n, &list));
  for (PetscInt i = 0; i < n;) {
    PetscInt m = 0;

    for (; i < n && m < CHUNK; i++) {
      if (l->centre_cell[list[i]] < 0) continue;
      for (PetscInt a = 0; a < l->dim; a++) x[m * l->dim + a] = l->x[list[i] * l->dim + a];
      cell[m++] = l->centre_cell[list[i]];
    }
    PetscCall(BodiesDistance(c->bodies, k, X, q, m, x, d));
    for (PetscInt j = 0; j < m; j++) PetscCall(cover(s, c, cell[j], k, X, q, d[j]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_covered(ScalarBodies s, Couple c)
{
  const PetscInt *inactive = MeshUpdateGetInactive(c->mesh_update);

  PetscFunctionBeginUser;
  s->ncovered = s->ndistance = 0;
  for (PetscInt k = 0; k < c->s->n; k++) {
    if (c->s->removed[k] || BodiesGetGroup(c->s, k)->body_fitted || CoupleIsInactiveInside(c, k)) continue;
    for (DomainImages i = {0}; MeshNextImage(c->loc, c->rigid.X[k], BodiesGetRadius(c->s, k), &i);)
      PetscCall(cover_image(s, c, k, i.at, c->rigid.q[k]));
  }
  for (PetscInt e = 0; e < c->loc->ncell_all && inactive; e++) {
    if (inactive[e] < 0 || !CoupleIsInactiveInside(c, inactive[e])) continue;
    PetscCall(ArrayReserve(s->ncovered + 1, &s->capacity, &s->covered, sizeof(*s->covered), NULL));
    s->covered[s->ncovered++] = (Covered){.cell = e, .body = inactive[e], .distance = -1, .inside = 1};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what they are made of ---- */

static PetscErrorCode create_data(ScalarBodies s, Couple c)
{
  const PetscInt nc = c->loc->ncell_all, nn = c->loc->nnode_all;

  PetscFunctionBeginUser;
  if (s->fluid) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CutCellReach(c->mesh, &s->reach));
  PetscCall(PetscMalloc1(nc, &s->fluid));
  for (PetscInt i = 0; i < s->n; i++) {
    struct CellData *d = s->data + i;

    PetscCall(PetscMalloc4(nc, &d->capacity, nc, &d->conductivity, nc, &d->source, nc, &d->sample));
    PetscCall(PetscMalloc2(nn, &d->fixed, nn, &d->value));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Samples of a cut cell; pool has room for 4 count numbers */
static void set_samples(const struct _p_ScalarBodies *s, Couple c, const Covered *at, const Material *m,
                        const ScalarParameters *par, PetscReal *pool, ScalarSamples *out)
{
  const PetscInt   n = s->count;
  const PetscReal *size, *d = s->distance + at->distance;
  PetscReal       *capacity = pool, *reaction = pool + n, *source = pool + 2 * n, *conductivity = pool + 3 * n, width;
  /* A function without a kink is too stiff where a part conducts better than the fluid: there the cell conducts as its
     parts in series; a part that conducts worse than the fluid is taken as it lies. */
  const PetscReal series = 1 / (at->inside / PetscMax(m->conductivity, EMPTY * par->conductivity) +
                                (1 - at->inside) / par->conductivity);

  (void)FlowGetCellSize(c->flow, &size);
  width = size[at->cell] / s->nsample;
  for (PetscInt p = 0; p < n; p++) {
    const PetscReal chi   = PetscMin(1, PetscMax(0, 0.5 - d[p] / width)),
                    layer = PetscAbsReal(d[p]) < 0.5 * width ? 1 / width : 0, left = PetscMax(EMPTY, 1 - chi),
                    sigma = PENALTY * par->conductivity / PetscSqr(size[at->cell]) * chi,
                    mixed = chi * m->conductivity + (1 - chi) * par->conductivity;

    capacity[p]     = m->condition == CONJUGATE ? chi * m->capacity + (1 - chi) * par->capacity
                    : m->condition == VALUE     ? par->capacity
                                                : left * par->capacity;
    conductivity[p] = m->condition == CONJUGATE ? (m->conductivity > par->conductivity ? series : mixed)
                    : m->condition == VALUE     ? par->conductivity
                                                : left * par->conductivity;
    reaction[p]     = m->condition == VALUE ? sigma : m->condition == TRANSFER ? m->transfer * layer : 0;
    source[p]       = m->condition == VALUE    ? sigma * m->value
                    : m->condition == TRANSFER ? m->transfer * m->value * layer
                    : m->condition == FLUX     ? m->flux * layer
                                               : chi * m->source;
  }
  *out = (ScalarSamples){s->nsample, at->cell, capacity, conductivity, reaction, source};
}

/* Of a cell inside as a whole */
static void set_inside(Couple c, const Covered *at, const Material *m, struct CellData *d)
{
  const PetscInt *node = c->loc->cell_node + at->cell * c->loc->nb;

  d->capacity[at->cell]     = m->capacity;
  d->conductivity[at->cell] = m->condition == CONJUGATE ? m->conductivity : -1;
  d->source[at->cell]       = m->source;
  for (PetscInt j = 0; j < c->loc->nb && m->condition == VALUE; j++) {
    d->fixed[node[j]] = PETSC_TRUE;
    d->value[node[j]] = m->value;
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
    const Material *m = s->material + c->s->body_group[body[node[e]]] * s->n + i;

    if (m->condition != VALUE) continue;
    d->fixed[node[e]] = PETSC_TRUE;
    d->value[node[e]] = m->value;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_scalar(ScalarBodies s, Couple c, Scalars scalars, PetscInt i)
{
  const PetscInt          each = 4 * s->count;
  const ScalarParameters *par;
  struct CellData        *d = s->data + i;
  PetscInt                n = 0;
  ScalarCells             cells;
  ScalarNodes             nodes = {d->fixed, d->value};

  PetscFunctionBeginUser;
  PetscCall(ScalarsGetParameters(scalars, i, &par));
  for (PetscInt e = 0; e < c->loc->ncell_all; e++) {
    d->capacity[e]     = par->capacity;
    d->conductivity[e] = par->conductivity;
    d->source[e]       = 0;
    d->sample[e]       = -1;
  }
  PetscCall(PetscArrayzero(d->fixed, c->loc->nnode_all));
  for (PetscInt e = 0; e < s->ncovered; e++) n += s->covered[e].distance >= 0;
  PetscCall(PetscRealloc(PetscMax(1, n) * sizeof(*d->samples), &d->samples));
  PetscCall(PetscRealloc((size_t)PetscMax(1, n) * (size_t)each * sizeof(PetscReal), &d->pool));
  n = 0;
  for (PetscInt e = 0; e < s->ncovered; e++) {
    const Covered  *at = s->covered + e;
    const Material *m  = s->material + c->s->body_group[at->body] * s->n + i;

    if (s->by_centre && m->condition == VALUE) continue;
    if (at->distance < 0) set_inside(c, at, m, d);
    else if (d->sample[at->cell] < 0) {
      set_samples(s, c, at, m, par, d->pool + (size_t)n * (size_t)each, d->samples + n);
      d->sample[at->cell] = n++;
    }
  }
  if (s->by_centre) PetscCall(fix_inside(c, s, i, d));
  cells = (ScalarCells){d->capacity, d->conductivity, d->source, d->sample, d->samples};
  PetscCall(ScalarsSetCells(scalars, i, &cells));
  PetscCall(ScalarsSetNodes(scalars, i, &nodes));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesUpdate(ScalarBodies s, Couple c, Scalars scalars)
{
  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(create_data(s, c));
  PetscCall(find_covered(s, c));
  for (PetscInt e = 0; e < c->loc->ncell_all; e++) s->fluid[e] = 1;
  for (PetscInt e = 0; e < s->ncovered; e++)
    s->fluid[s->covered[e].cell] = PetscMax(0, s->fluid[s->covered[e].cell] - s->covered[e].inside);
  for (PetscInt i = 0; i < s->n; i++) PetscCall(set_scalar(s, c, scalars, i));
  if (MeshUpdateGetInactive(c->mesh_update)) PetscCall(ScalarShiftInside(c, &s->shift));
  PetscCall(ScalarsSetShift(scalars, s->shift));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBodiesStart(ScalarBodies s, Couple c, Scalars scalars)
{
  PetscInt *body;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(c->loc->nnode_all, &body));
  PetscCall(CoupleMarkInside(c, body));
  for (PetscInt i = 0; i < s->n; i++) {
    PetscReal *T[3];

    PetscCall(ScalarsGetFields(scalars, i, &T[0], &T[1]));
    PetscCall(ScalarsGetSolution(scalars, i, &T[2]));
    for (PetscInt k = 0; k < c->loc->nnode_all; k++) {
      const Material *m = body[k] >= 0 ? s->material + c->s->body_group[body[k]] * s->n + i : NULL;

      for (PetscInt t = 0; t < 3 && m && m->starts; t++) T[t][k] = m->initial;
    }
  }
  PetscCall(PetscFree(body));
  PetscFunctionReturn(PETSC_SUCCESS);
}
