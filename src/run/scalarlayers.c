/* ScalarLayers: see scalarlayers.h. */
#include "compat.h"
#include "scalarlayers.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "couple/scalars.h"
#include "scalar/layer.h"
#include "scalar/scalar.h"
#include <stdio.h>
#include <string.h>
#include <strings.h>

#define EVERY 10  /* steps from one look to the next, */
#define FIRST 10  /* beyond the first ones */
#define WORSE 0.5 /* of the cells that were remarked: it is remarked again */

static const char *const METHODS[] = {"penalty", "aligned", "nodal"};

/* Cells in the layer. Mean Nusselt number of a disc at a value, held in a stream at Re 10, per cent off: Pe 100 with
   .59, 1.2, 2.4, 4.7 cells penalty 4.1, .8, .2, .04, aligned .4, .02, .001, nodal -21, -7, -5, -2.3; Pe 1000 with .27,
   .54, 1.1, 2.2 penalty 31, 4.5, .8, .2, aligned 16, 1, .06, .002, nodal -27, -13, -10, -5; Pe 10 with 1.3, 2.5, 5
   penalty .7, .2, .05, nodal -11, -4, -2 (runs/studies/scalars/notes.md) */
static const PetscReal CELLS[SCALAR_LAYER_NMETHODS][PROMISE_NPRESETS] = {{0.6, 1.2, 2.5},
                                                                         {0.4, 0.6, 0.9},
                                                                         {2.5, 12, 60}};

/* Way of a step over D/U, of bodies that move through cells: nodes that they cover and free. A disc that moves at Re 10
   through fluid at rest, penalty: 6, 3, 1.6, .8 are 10, 3.5, 1.2 % beside none, likewise nodal (1.4 % from 3 to 1.6);
   125 is some 80 % above the finest run lined up at Pe 1000 (not converged). Lined up it has no such error. */
static const PetscReal WAY[PROMISE_NPRESETS] = {4, 1.2, 0.4};

struct _p_ScalarLayers {
  Couple              couple;
  Monitor             monitor;
  BodyState          *s;
  PetscInt            n, preset, method;
  ScalarLayer        *worst;    /* [n][ngroups] */
  PetscReal          *remarked; /* [n][ngroups] cells, or inverse of a way, that a remark has been made of */
  ScalarLayer        *layer;    /* [ngroups] */
  const CoupleScalar *scalar;
};

PetscErrorCode ScalarLayersFindMethod(PetscInt *method)
{
  char text[32];

  PetscFunctionBeginUser;
  *method = SCALAR_LAYER_PENALTY;
  PetscCall(OptPeek("-couple_method", text, sizeof(text)));
  for (PetscInt m = 0; m < SCALAR_LAYER_NMETHODS; m++)
    if (!strcasecmp(text, METHODS[m])) *method = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool is_too_thin(const ScalarLayer *layer, PetscInt method, PetscInt preset)
{
  return (PetscBool)(layer->cells < CELLS[method][preset]);
}

static PetscBool goes_too_far(const ScalarLayer *layer, PetscInt method, PetscInt preset)
{
  return (PetscBool)(method != SCALAR_LAYER_ALIGNED && layer->way > WAY[preset]);
}

/* "the layer of scalar 'heat' around ... is 0.45 cells thick and needs 1.2. Refine the mesh (...)" */
static PetscErrorCode describe(const char scalar[], const char group[], const ScalarLayer *layer, PetscInt method,
                               PetscInt preset, char text[], size_t len)
{
  const char *other = "";

  PetscFunctionBeginUser;
  if (method != SCALAR_LAYER_ALIGNED && !is_too_thin(layer, SCALAR_LAYER_ALIGNED, preset))
    other = ", or use -couple_method aligned";
  else if (method == SCALAR_LAYER_NODAL && !is_too_thin(layer, SCALAR_LAYER_PENALTY, preset))
    other = ", or use -couple_method penalty";
  if (is_too_thin(layer, method, preset))
    PetscCall(
      PetscSNPrintf(text, len,
                    "the layer of scalar '%s' around a body of group '%s' (Peclet number %.3g) is %.2g cells thick and with "
                    "-couple_method %s needs %.2g. Refine the mesh (-mesh_cells, -mesh_focus_h, -mesh_levels)%s",
                    scalar, group, (double)layer->peclet, (double)layer->cells, METHODS[method],
                    (double)CELLS[method][preset], other));
  else
    PetscCall(
      PetscSNPrintf(text, len,
                    "a body of group '%s' (Peclet number %.3g of scalar '%s') goes %.2g times as far in a step as conduction "
                    "reaches ahead of it, and with -couple_method %s may go %.2g. Lower -sim_dt, let the box go along "
                    "(-sim_frame)%s",
                    group, (double)layer->peclet, scalar, (double)layer->way, METHODS[method], (double)WAY[preset],
                    other));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- before a run ---- */

/* Is group g of its own material for the scalar, by its options, which stay unread? */
static PetscErrorCode is_open(const char group[], const char scalar[], PetscBool *open)
{
  static const char *const WHAT[] = {"condition", "conductivity", "capacity", "source", "initial"};

  PetscFunctionBeginUser;
  *open = PETSC_FALSE;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(WHAT); i++) {
    char name[OPT_NAME], text[64];

    (void)snprintf(name, sizeof(name), "-particle_%s_%s_%s", group, scalar, WHAT[i]);
    PetscCall(OptPeek(name, text, sizeof(text)));
    *open = (PetscBool)(*open || text[0]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* In the plane PromiseEstimateFall takes a drag coefficient of 1; at this one of a disc (White, Viscous Fluid Flow,
   1991) a slow one falls slower */
static PetscReal slow_down(PetscReal speed, PetscReal size, PetscReal nu)
{
  PetscReal now = speed;

  for (PetscInt i = 0; i < 30 && speed > 0; i++)
    now = speed / PetscSqrtReal(1 + 10 * PetscPowReal(PetscMax(now * size / nu, 1e-9), -2. / 3));
  return now;
}

/* Size of the first body of a group, how fast it is known to move against the fluid, and through the mesh */
static PetscErrorCode estimate_speed(const MeshLocal *l, Bodies bodies, PetscInt g, const PromiseScene *scene,
                                     PetscReal *size, PetscReal *speed, PetscReal *through)
{
  BodyState *s;
  PetscReal  of[2] = {0, 0}, layer, density, viscosity; /* size, speed */
  StreamEdge edge;
  PetscInt   k;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  PetscCall(PromiseEstimateFall(l->dim, bodies, g, size, through));
  PetscCall(StreamPeekFluid(&density, &viscosity));
  if (l->dim == 2 && viscosity > 0) *through = slow_down(*through, *size, viscosity / density);
  k = BodiesFind(s, s->group[g].first);
  if (k >= 0) of[0] = 2 * BodiesGetRadius(s, k);
  if (k >= 0) of[1] = PetscSqrtReal(PetscSqr(s->u[k][0]) + PetscSqr(s->u[k][1]) + PetscSqr(s->u[k][2]));
  PetscCall(BodiesMax(bodies, 2, of));
  PetscCall(StreamMeasureLayer(l, bodies, g, &scene->stream, &layer, &edge));
  *size    = of[0];
  *through = PetscMax(*through, of[1]);
  *speed   = *through;
  if (layer < PETSC_MAX_REAL) *speed = PetscMax(*speed, scene->stream.speed);
  else if (scene->stream.speed != 0) *speed = 0; /* it may be carried along */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What is known of the layer around the first body of group g */
static PetscErrorCode predict_layer(const MeshLocal *l, Bodies bodies, PetscInt g, const char scalar[],
                                    const PromiseScene *scene, ScalarLayer *layer)
{
  BodyState *s;
  PetscReal  size = 0, speed = 0, through = 0, density, viscosity, D = 0, dt = 0;
  PetscBool  open, given;
  char       frame[32];

  PetscFunctionBeginUser;
  *layer = (ScalarLayer){PETSC_MAX_REAL, 0, 0};
  PetscCall(BodiesGetState(bodies, &s));
  if (s->group[g].body_fitted || !s->group[g].count) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(is_open(s->group[g].name, scalar, &open));
  if (!open) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(estimate_speed(l, bodies, g, scene, &size, &speed, &through));
  PetscCall(StreamPeekFluid(&density, &viscosity));
  PetscCall(ScalarsPeekDiffusivity(scalar, &D));
  PetscCall(OptPeekReal("-sim_dt", &dt, &given));
  PetscCall(OptPeek("-sim_frame", frame, sizeof(frame)));
  if (speed == 0 || D <= 0 || viscosity <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  layer->peclet = speed * size / D;
  layer->cells  = ScalarLayerThickness(size, speed * size * density / viscosity, layer->peclet) / l->h;
  if ((!frame[0] || !strcasecmp(frame, "none")) && !scene->steady) layer->way = through * through * dt / D;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLayersCheck(const MeshLocal *l, Bodies bodies, PetscInt preset, PetscBool asked,
                                 const PromiseScene *scene, char refusal[], size_t len)
{
  BodyState *s;
  char       list[1024], text[640] = "", *word, *rest;
  PetscInt   method;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-scalars", list, sizeof(list)));
  if (!bodies || !list[0]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesGetState(bodies, &s));
  PetscCall(ScalarLayersFindMethod(&method));
  for (word = strtok_r(list, ", []", &rest); word; word = strtok_r(NULL, ", []", &rest))
    for (PetscInt g = 0; g < s->ngroups && !text[0]; g++) {
      ScalarLayer layer;

      PetscCall(predict_layer(l, bodies, g, word, scene, &layer));
      if (is_too_thin(&layer, method, preset) || goes_too_far(&layer, method, preset))
        PetscCall(describe(word, s->group[g].name, &layer, method, preset, text, sizeof(text)));
    }
  if (!text[0]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PromiseSay(preset, asked, text, refusal, len));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- during it ---- */

/* What ScalarLayersCheck has remarked */
static PetscErrorCode find_remarked(ScalarLayers s, const SimComponents *p)
{
  const MeshLocal *l;
  PromiseScene     scene = {.steady = (PetscBool)(p->steady != NULL)};

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(p->mesh, &l));
  PetscCall(StreamFind(p->mesh, p->bodies, scene.steady, &scene.stream));
  for (PetscInt at = 0; at < s->n * s->s->ngroups; at++) {
    ScalarLayer layer;

    PetscCall(predict_layer(l, p->bodies, at % s->s->ngroups, s->scalar[at / s->s->ngroups].par->name, &scene, &layer));
    s->remarked[at] = is_too_thin(&layer, s->method, s->preset)  ? layer.cells
                    : goes_too_far(&layer, s->method, s->preset) ? 1 / layer.way
                                                                 : PETSC_MAX_REAL;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLayersCreate(const SimComponents *p, ScalarLayers *layers)
{
  ScalarLayers s;
  BodyState   *state;
  PetscInt     n;
  char         text[32];

  PetscFunctionBeginUser;
  *layers = NULL;
  PetscCall(BodiesGetState(p->bodies, &state));
  PetscCall(PetscNew(&s));
  PetscCall(CoupleGetScalars(p->couple, &s->n, &s->scalar));
  if (!s->n || !state->nall) {
    PetscCall(PetscFree(s));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  s->couple  = p->couple;
  s->monitor = p->monitor;
  s->s       = state;
  PetscCall(ScalarLayersFindMethod(&s->method));
  PetscCall(OptPeek("-preset", text, sizeof(text)));
  s->preset = PromiseFind(text);
  n         = s->n * state->ngroups;
  PetscCall(PetscMalloc3(n, &s->worst, n, &s->remarked, state->ngroups, &s->layer));
  for (PetscInt i = 0; i < n; i++) s->worst[i] = (ScalarLayer){PETSC_MAX_REAL, 0, 0};
  PetscCall(find_remarked(s, p));
  *layers = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLayersDestroy(ScalarLayers *layers)
{
  PetscFunctionBeginUser;
  if (!*layers) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree3((*layers)->worst, (*layers)->remarked, (*layers)->layer));
  PetscCall(PetscFree(*layers));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A remark on group g where the worst is too bad, and much worse than what was remarked */
static PetscErrorCode remark_worst(ScalarLayers s, PetscInt i, PetscInt g, const char when[])
{
  const PetscInt     at    = i * s->s->ngroups + g;
  const ScalarLayer *worst = s->worst + at;
  const PetscBool    thin  = is_too_thin(worst, s->method, s->preset);
  PetscReal          now;
  char               text[640];

  PetscFunctionBeginUser;
  if (!thin && !goes_too_far(worst, s->method, s->preset)) PetscFunctionReturn(PETSC_SUCCESS);
  now = thin ? worst->cells : 1 / worst->way;
  if (now >= WORSE * s->remarked[at]) PetscFunctionReturn(PETSC_SUCCESS);
  s->remarked[at] = now;
  PetscCall(describe(s->scalar[i].par->name, s->s->group[g].name, worst, s->method, s->preset, text, sizeof(text)));
  PetscCall(
    LogRemark("%s, for the %s %% of preset %s: %s", when, PromiseText(s->preset), PROMISE_PRESETS[s->preset], text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLayersStep(ScalarLayers s, PetscInt step, PetscReal time)
{
  char when[64];

  PetscFunctionBeginUser;
  if (!s || (step > FIRST && step % EVERY != 0)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscSNPrintf(when, sizeof(when), "at t = %.4g", (double)time));
  for (PetscInt i = 0; i < s->n; i++) {
    PetscCall(CoupleMeasureScalarLayers(s->couple, i, s->layer));
    for (PetscInt g = 0; g < s->s->ngroups; g++) {
      ScalarLayer *worst = s->worst + i * s->s->ngroups + g;

      if (s->layer[g].cells < worst->cells) {
        worst->cells  = s->layer[g].cells;
        worst->peclet = s->layer[g].peclet;
      }
      worst->way = PetscMax(worst->way, s->layer[g].way);
      PetscCall(remark_worst(s, i, g, when));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLayersFinish(ScalarLayers s)
{
  char name[192];

  PetscFunctionBeginUser;
  for (PetscInt at = 0; s && at < s->n * s->s->ngroups; at++) {
    const PetscInt i = at / s->s->ngroups, g = at % s->s->ngroups;

    if (s->worst[at].cells == PETSC_MAX_REAL) continue;
    PetscCall(
      PetscSNPrintf(name, sizeof(name), "scalar_layer_cells_%s_%s", s->scalar[i].par->name, s->s->group[g].name));
    PetscCall(MonitorQuantity(s->monitor, name, s->worst[at].cells));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
