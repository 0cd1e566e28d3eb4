/* ScalarMaterial: see scalarmaterial.h. */
#include "compat.h"
#include "impl.h"
#include "scalarmaterial.h"
#include "base/algebra.h"
#include "base/opt.h"

#define PENALTY 200  /* of a value in a cut cell, in k/h^2 */
#define EMPTY   1e-3 /* what is left of conductivity and capacity where nothing is solved for */
#define SMOOTH  1.25 /* cells: widest zone over which a conductivity passes into that of the fluid */

static const char *const CONDITIONS[] = {"conjugate", "value", "flux", "transfer", "lumped", NULL};

/* Of the group g */
static const char *name_option(const char g[], const char scalar[], const char ending[], char name[OPT_NAME])
{
  (void)snprintf(name, OPT_NAME, "-particle_%s_%s_%s", g, scalar, ending);
  return name;
}

PetscBool ScalarMaterialIsFluid(const ScalarMaterial *m, const ScalarParameters *par)
{
  return (PetscBool)(m->condition == SCALAR_BODY_CONJUGATE && m->conductivity == par->conductivity &&
                     m->capacity == par->capacity && m->source == 0 && m->decay == 0);
}

PetscBool ScalarGroupMoves(const BodyGroup *g)
{
  PetscBool steady = PETSC_FALSE;

  (void)OptPeekBool("-sim_steady", &steady);
  return (PetscBool)(!steady && (g->free || g->motion.given || g->motion.has_u || g->motion.has_w || g->grows));
}

/* Nodes that move with bodies are known from step to step alone */
static PetscErrorCode refuse_motion(Couple c, const BodyGroup *g, const ScalarParameters *par)
{
  PetscBool tracks = PETSC_FALSE, given;
  char      frame[64];

  PetscFunctionBeginUser;
  if (!ScalarGroupMoves(g) || !c->method.table->moves_nodes) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptPeekBool("-mesh_track", &tracks));
  PetscCheck(!tracks, c->comm, PETSC_ERR_SUP,
             "-mesh_track true with -couple_method %s and -scalars %s: group '%s' moves, and scalars on nodes that go along with it are not "
             "carried to other cells: refine all that it passes through (-mesh_track false), or use -couple_method penalty",
             c->method.table->name, par->name, g->name);
  PetscCall(OptHas("-sim_frame", &given));
  PetscCall(OptPeek("-sim_frame", frame, sizeof(frame)));
  PetscCheck(!given || !strcmp(frame, "none"), c->comm, PETSC_ERR_SUP,
             "-sim_frame %s with -couple_method %s and -scalars %s: nodes that go along with group '%s' know no moving frame: leave it out, "
             "or use -couple_method penalty",
             frame, c->method.table->name, par->name, g->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What surfaces do not do yet, one message each */
static PetscErrorCode refuse(Couple c, const BodyGroup *g, const ScalarMaterial *m, const ScalarParameters *par)
{
  PetscFunctionBeginUser;
  PetscCheck(!g->body_fitted || (m->condition == SCALAR_BODY_CONJUGATE && ScalarMaterialIsFluid(m, par)), c->comm,
             PETSC_ERR_USER_INPUT,
             "-particle_%s_%s_condition %s: group '%s' is a hole of the mesh, whose surface is boundary '%s': give its "
             "-scalar_%s_bc_%s_value (or _flux, _transfer) and leave -particle_%s_%s_* out",
             g->name, par->name, CONDITIONS[m->condition], g->name, g->surface, par->name, g->surface, g->name,
             par->name);
  PetscCheck(m->condition != SCALAR_BODY_LUMPED || c->method.table != &method_nodal || !ScalarGroupMoves(g), c->comm,
             PETSC_ERR_SUP,
             "-particle_%s_%s_condition lumped: under -couple_method nodal a body that moves does not keep its heat: use "
             "-couple_method penalty or aligned",
             g->name, par->name);
  PetscCall(refuse_motion(c, g, par));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What its weight goes by */
static PetscErrorCode read_expansion(Couple c, const BodyGroup *g, const ScalarParameters *par, ScalarMaterial *m)
{
  char name[OPT_NAME];

  PetscFunctionBeginUser;
  m->reference = par->reference;
  PetscCall(OptReal(name_option(g->name, par->name, "expansion", name), &m->expansion));
  if (m->expansion == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(!ScalarMaterialIsSurface(m), c->comm, PETSC_ERR_USER_INPUT,
             "%s %g: group '%s' is in %s, nothing is known of the scalar inside: give it -particle_%s_%s_condition value, lumped or "
             "conjugate, or leave the expansion out",
             name, (double)m->expansion, g->name, m->condition == SCALAR_BODY_FLUX ? "flux" : "exchange", g->name,
             par->name);
  PetscCheck(m->starts, c->comm, PETSC_ERR_USER_INPUT,
             "%s %g: the weight of group '%s' goes by its own value from the start: give -particle_%s_%s_initial", name,
             (double)m->expansion, g->name, g->name, par->name);
  PetscCheck(c->par->gravity[0] != 0 || c->par->gravity[1] != 0 || c->par->gravity[2] != 0, c->comm,
             PETSC_ERR_USER_INPUT, "%s %g changes a weight and needs gravity: give -flow_gravity", name,
             (double)m->expansion);
  PetscCall(OptReal(name_option(g->name, par->name, "reference", name), &m->reference));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What its size goes by */
static PetscErrorCode read_growth(Couple c, const BodyGroup *g, const ScalarParameters *par, ScalarMaterial *m)
{
  char      name[OPT_NAME];
  PetscBool steady = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(OptReal(name_option(g->name, par->name, "dissolves", name), &m->dissolves));
  if (m->dissolves == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(m->condition == SCALAR_BODY_VALUE || ScalarMaterialIsSurface(m), c->comm, PETSC_ERR_SUP,
             "%s %g: group '%s' is %s, and sizes go by the flux of bodies at a value, with a flux or in exchange: give it "
             "-particle_%s_%s_condition value, flux or transfer",
             name, (double)m->dissolves, g->name, CONDITIONS[m->condition], g->name, par->name);
  PetscCall(OptPeekBool("-sim_steady", &steady));
  PetscCheck(!steady, c->comm, PETSC_ERR_USER_INPUT,
             "%s %g changes the size of group '%s' in time, and -sim_steady has none: remove one of them", name,
             (double)m->dissolves, g->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of what is solved for inside, of the group of that name */
static PetscErrorCode read_inside(const char g[], const ScalarParameters *par, ScalarMaterial *m)
{
  char name[OPT_NAME];

  PetscFunctionBeginUser;
  PetscCall(OptReal(name_option(g, par->name, "conductivity", name), &m->conductivity));
  PetscCall(OptReal(name_option(g, par->name, "decay", name), &m->decay));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of what has heat inside */
static PetscErrorCode read_content(const char g[], const ScalarParameters *par, ScalarMaterial *m)
{
  char name[OPT_NAME];

  PetscFunctionBeginUser;
  PetscCall(OptReal(name_option(g, par->name, "capacity", name), &m->capacity));
  PetscCall(OptReal(name_option(g, par->name, "source", name), &m->source));
  PetscCall(OptHas(name_option(g, par->name, "initial", name), &m->starts));
  PetscCall(OptReal(name, &m->initial));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarMaterialReadPhase(Couple c, const char g[], const ScalarParameters *par, ScalarMaterial *m)
{
  char name[OPT_NAME];

  PetscFunctionBeginUser;
  m->conductivity = par->conductivity;
  m->capacity     = par->capacity;
  PetscCall(OptChoice(name_option(g, par->name, "condition", name), CONDITIONS, &m->condition));
  PetscCheck(m->condition == SCALAR_BODY_CONJUGATE, c->comm, PETSC_ERR_SUP,
             "%s %s: group '%s' is no rigid body, and its inside is always solved for: leave it out (conjugate)", name,
             CONDITIONS[m->condition], g);
  PetscCall(read_inside(g, par, m));
  PetscCall(read_content(g, par, m));
  PetscCall(OptReal(name_option(g, par->name, "expansion", name), &m->expansion));
  PetscCheck(par->expansion != 0 || m->expansion == 0, c->comm, PETSC_ERR_USER_INPUT,
             "%s %g: buoyancy goes by that of the fluid around: give -scalar_%s_expansion too, as small as it may be",
             name, (double)m->expansion, par->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarMaterialRead(Couple c, const BodyGroup *g, const ScalarParameters *par, ScalarMaterial *m)
{
  char      name[OPT_NAME];
  PetscBool given;

  PetscFunctionBeginUser;
  m->conductivity = par->conductivity;
  m->capacity     = par->capacity;
  PetscCall(OptChoice(name_option(g->name, par->name, "condition", name), CONDITIONS, &m->condition));
  if (m->condition == SCALAR_BODY_CONJUGATE) PetscCall(read_inside(g->name, par, m));
  if (m->condition == SCALAR_BODY_CONJUGATE || m->condition == SCALAR_BODY_LUMPED) {
    PetscCall(read_content(g->name, par, m));
    name_option(g->name, par->name, "initial", name);
    PetscCheck(m->starts || m->condition != SCALAR_BODY_LUMPED, c->comm, PETSC_ERR_USER_INPUT,
               "Group '%s' is lumped for scalar '%s', one value a body: give %s, its value at the start", g->name,
               par->name, name);
  }
  if (m->condition == SCALAR_BODY_VALUE || m->condition == SCALAR_BODY_TRANSFER) {
    PetscCall(OptHas(name_option(g->name, par->name, "value", name), &given));
    PetscCheck(given, c->comm, PETSC_ERR_USER_INPUT, "Group '%s' is %s for scalar '%s': give %s", g->name,
               m->condition == SCALAR_BODY_VALUE ? "held at a value" : "in exchange", par->name, name);
    PetscCall(OptReal(name, &m->value));
    m->starts  = (PetscBool)(m->condition == SCALAR_BODY_VALUE);
    m->initial = m->value;
  }
  if (m->condition == SCALAR_BODY_FLUX)
    PetscCall(ExprRead(name_option(g->name, par->name, "flux", name), c->loc->dim, 1, &m->flux, &m->flux_of, NULL));
  if (m->condition == SCALAR_BODY_TRANSFER)
    PetscCall(OptReal(name_option(g->name, par->name, "transfer", name), &m->transfer));
  PetscCall(read_expansion(c, g, par, m));
  PetscCall(read_growth(c, g, par, m));
  PetscCall(refuse(c, g, m, par));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Conductivity of a sample of a cell of this size at the distance d from the surface, of which chi lies inside. A
   function without a kink is too stiff where a body conducts better than the fluid: as if it were larger. There both
   conduct in series over a zone around the surface, wider as they differ more, which sets the dipole right
   (runs/studies/scalars); what conducts worse than the fluid is taken as it lies. */
static PetscReal get_conductivity(PetscReal inside, PetscReal fluid, PetscReal chi, PetscReal d, PetscReal size)
{
  PetscReal zone, deep;

  if (inside <= fluid || fluid == 0) return chi * inside + (1 - chi) * fluid;
  zone = PetscMin(0.5 * PetscLog10Real(inside / fluid), SMOOTH);
  deep = ScalarCoverPart(d, zone * size);
  return 1 / (deep / inside + (1 - deep) / fluid);
}

void ScalarMaterialSamples(const ScalarMaterial *m, const ScalarParameters *par, const ScalarCover *cover,
                           const CoveredCell *at, PetscReal size, PetscReal scale, const ScalarSurface surface[],
                           PetscReal *pool, ScalarSamples *out)
{
  const PetscInt   n = cover->count;
  const PetscReal *d = cover->distance + at->distance, width = size / cover->nsample;
  PetscReal       *capacity = pool, *reaction = pool + n, *source = pool + 2 * n, *conductivity = pool + 3 * n,
            *layer = pool + 4 * n;

  for (PetscInt p = 0; p < n; p++) {
    const PetscReal chi = ScalarCoverPart(d[p], width), left = PetscMax(EMPTY, 1 - chi),
                    sigma = PENALTY * par->conductivity / PetscSqr(size) * chi;

    layer[p]        = PetscAbsReal(d[p]) < 0.5 * width ? 1 / width : 0;
    capacity[p]     = m->condition == SCALAR_BODY_CONJUGATE ? scale == 1
                                                              ? chi * m->capacity + (1 - chi) * par->capacity
                                                              : par->capacity + scale * chi * (m->capacity - par->capacity)
                    : m->condition == SCALAR_BODY_VALUE ? par->capacity
                                                            : left * par->capacity;
    conductivity[p] = m->condition == SCALAR_BODY_CONJUGATE
                      ? get_conductivity(m->conductivity, par->conductivity, chi, d[p], size)
                    : ScalarMaterialHasValue(m) ? par->conductivity
                                                : left * par->conductivity;
    reaction[p]     = ScalarMaterialHasValue(m)            ? sigma
                    : m->condition == SCALAR_BODY_TRANSFER ? m->transfer * layer[p]
                                                           : chi * m->decay * m->capacity;
    source[p]       = m->condition == SCALAR_BODY_VALUE    ? sigma * m->value
                    : m->condition == SCALAR_BODY_TRANSFER ? m->transfer * m->value * layer[p]
                    : m->condition == SCALAR_BODY_FLUX     ? m->flux * layer[p]
                    : m->condition == SCALAR_BODY_LUMPED   ? 0
                                                           : chi * m->source;
  }
  *out = (ScalarSamples){.n            = cover->nsample,
                         .cell         = at->cell,
                         .capacity     = capacity,
                         .conductivity = conductivity,
                         .reaction     = reaction,
                         .source       = source,
                         .lump         = m->condition == SCALAR_BODY_LUMPED ? at->body : -1,
                         .body         = at->body,
                         .surface      = m->flux_of ? surface + at->body : NULL,
                         .layer        = layer};
}

PetscErrorCode ScalarMaterialForget(ScalarMaterial *m)
{
  PetscFunctionBeginUser;
  PetscCall(ExprDestroy(&m->flux_of));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ScalarMaterialSurface(Couple c, const ScalarMaterial material[], PetscInt n, PetscInt i, PetscInt k,
                           ScalarSurface *s)
{
  const PetscReal      *centroid = BodiesGetGroup(c->s, k)->mass.centroid;
  const ScalarMaterial *m        = material + c->s->body_group[k] * n + i;

  *s = (ScalarSurface){.flux = m->flux_of};
  if (!m->flux_of) return;
  RotationMatrix(c->rigid.q[k], s->R);
  for (PetscInt a = 0; a < c->loc->dim; a++) {
    s->X[a]      = c->rigid.X[k][a];
    s->origin[a] = centroid[a];
  }
}
