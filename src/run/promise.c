/* Promise: see promise.h. */
#include "compat.h"
#include "promise.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "bodies/slip.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* What each preset promises, and for it: how many cells thick a body must be (balanced: a disc of 4 cells is 1.7 to
   2.5 % off, of 5 cells 0.6 %, an ellipse of 2 cells 1.9 %; accurate: 0.14 % there; a flap of 1.6 cells 1.6, 1.5 and
   1.2 %), also in other fluids (balanced: a disc of 7 cells 2.4 % off in a Carreau fluid, 2.1 % in Oldroyd-B, of 10
   cells .1 and .8 %), and the boundary layer of a falling one (two discs with 0.43 cells, at 8 cells a diameter: fast
   3 % off, accurate 3.6 %; an ellipse with 0.64 within 0.14 %), or of several that fall in each other's wakes (two
   discs with 0.64 cells: fast 1.6, balanced 1.6, accurate 1.3 % off; with 1.3 cells 0.5, 0.5, 0.3 %; with 2.6
   accurate 0.06 %). In space the same layers. Swimmers, their speed: squirmers in periodic boxes with 2, 3, 5, 6, 8 and
   10 cells a diameter, disc: fast -2.1, -1.5 %, balanced -1.2 (5), -1.2 (6), -.3, -.4 %, accurate .75 (3), .19 (4),
   -.02 (6), -.05 % (8); sphere: fast .8 (4), balanced 1.1 (5), .7 (8), accurate .18 (4), .01 % (8) */
const char *const PROMISE_PRESETS[] = {"fast", "balanced", "accurate", NULL};
static const struct {
  const char *percent;
  PetscReal   cells, other, layer, wakes, swims;
} PROMISE[] = {{"5", 1.5, 1.5, 0.25, 0.25, 2}, {"1", 5, 10, 0.5, 1, 8}, {"0.2", 2, 2, 0.5, 2, 5}};

/* Cells that a gap which lasts needs, by preset: with the penalty and with the mesh lined up, in the plane and in
   space. Plane arrays of discs: penalty 8.5, 4.8, 4.4, 1.4 % off at gaps of 1.8, 1.5, 2, 3 cells, 1 % at 7, .5 % at
   9; lined up 1.5, .8, .3, .05 % at .7, 1.1, 1.3, 1.8 cells. An ellipse in an annulus, lined up: torque .6, .3, .06 %
   off at 1.5, 1.9, 2.3 cells; its free spin 2 % up to 2.3, .06 % at 2.7. Cubic arrays of spheres: penalty .5, .3, .25
   % at 1.6, 2.1, 3.1; lined up .04 % at .6 and 1.6, body-centred ones .7, .4, .2, .15 % at 1, 1.2, 1.4, 1.55. A
   sphere that comes to a wall: lined up .14 % at .8 cells (runs/studies/boundary) */
static const PetscReal GAP[2][2][3] = {{{3, 8, 20}, {0.5, 1.5, 2.7}}, {{1.2, 3, 8}, {0.4, 1, 1.5}}};
static const PetscReal WALL_GAP[3]  = {0.4, 0.5, 0.8}; /* from walls, lined up in space */

/* Cells that a body needs which is led to and fro, mostly against the inertia of the fluid, with the penalty: the force
   on a cylinder with 6, 12, 24 cells a diameter 9.5, 2.7, .8 % off, lined up .9, .13, 0 %. The last are those of the
   layer that swings with it, of .56, 1.1, 2.3 cells (runs/studies/boundary) */
static const PetscReal SWINGS[3] = {9, 24, 48}, SWING_LAYER[3] = {0.3, 0.6, 1};
/* Cells that the boundary layer of a body needs that is held in a stream (stream.h): steady, in time; with the penalty,
   lined up. Drag: a sphere at Re 100 with .8 cells 1.4 % off, lined up .08 %, with .6 .5 %; a cylinder in a channel
   with .7, 1.1 cells 1.5, .4 % off, lined up .6, .1 %; one with a flag behind it, .7 cells, 1.1 %, lined up .3 %, with
   1.4 .2, .02 %; an ellipse of 4 : 1 along the stream, .7 cells, 2.1, .3 %, with 1.4 .4, .02 %. Lift in a street of
   vortices (CFD3) with .9 cells 9 %, lined up 1.6 % off; of an airfoil at 10 degrees, which no mesh is lined up with,
   with 1, 2 cells by its thickness 3.6, .8 % */
static const PetscReal STREAM[2][2][3] = {{{0.25, 1, 2}, {0.3, 0.5, 1.1}}, {{0.25, 1.5, 2}, {0.25, 1.1, 2}}};

/* The same by edges (stream.h). Lift of bodies that are not the same from both sides, penalty, lined up: an ellipse of
   4 : 1 at 45 degrees with .7 cells by its thickness 2.3, 7.1 % off, with 1.4 .7, .005 %, penalty with 2, 2.4, 2.8 .4,
   .2, .1 %; a plate at 30 degrees with .45 8.6 %, with .9 2.3, .03 %. No mesh is lined up with an airfoil: along the
   stream drag with .6, 1.3 cells by its length 2.6, .05 % off; lift at 5 to 20 degrees with 1, 2, 4 cells by its
   thickness 4 to 4.7, .8 to 1.5, .3 to .5 %, of a wedge of 23 degrees 6.8, 2.4, 1 % */
static const PetscReal LIFTS[2][3] = {{0.7, 1.4, 2.8}, {0.85, 1, 1.4}}, EDGE[3] = {0.6, 1, 1.2},
                       EDGE_LIFTS[3] = {1.25, 4, 10};

#define EDGE_TURNS \
  0.5 /* by edges, fast, of a body that turns freely: with .55 cells the period .3, the mean angle 1.6 % off */
#define ROTATION_GAP  2.7 /* of a body that is free to turn, lined up, balanced and accurate */
#define SPACE_DEFAULT 10  /* cells across a body in space, by the default, whose penalty is that of the plane */

const char *PromiseText(PetscInt preset)
{
  return PROMISE[preset].percent;
}

PetscInt PromiseFind(const char name[])
{
  for (PetscInt p = 0; p < PROMISE_NPRESETS; p++)
    if (!strcasecmp(name, PROMISE_PRESETS[p])) return p;
  return PROMISE_DEFAULT;
}

PetscReal PromisePercent(PetscInt preset)
{
  return strtod(PROMISE[preset].percent, NULL);
}

PetscErrorCode PromiseOffer(PetscInt preset, char text[], size_t len)
{
  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(text, len, ", use -preset %s (%s %%)", PROMISE_PRESETS[preset], PROMISE[preset].percent));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Has the fluid a law that is not Newtonian, and not one of eddies? */
static PetscErrorCode is_other_fluid(PetscBool *other)
{
  const char *const names[] = {"", "newton", "smagorinsky", "wale"};
  char              law[64];

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-flow_rheology", law, sizeof(law)));
  *other = PETSC_TRUE;
  for (int i = 0; i < 4; i++) *other = (PetscBool)(*other && strcmp(law, names[i]) != 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal PromiseFallLayer(PetscInt preset, PetscBool several)
{
  return several ? PROMISE[preset].wakes : PROMISE[preset].layer;
}

PetscErrorCode PromiseMeasureThickness(const MeshLocal *l, Bodies bodies, PetscInt group, PetscReal *cells)
{
  BodyState *s;
  PetscReal  d = 0, scale = PETSC_MAX_REAL; /* of the smallest */
  PetscInt   smallest = -1;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  for (PetscInt k = 0; k < s->n; k++) {
    if (s->body_group[k] != group || s->scale[k] >= scale) continue;
    smallest = k;
    scale    = s->scale[k];
  }
  PetscCall(BodiesMin(bodies, 1, &scale));
  if (smallest >= 0 && s->scale[smallest] == scale)
    PetscCall(BodiesDistance(bodies, smallest, NULL, NULL, 1, s->x[smallest], &d));
  *cells = d < 0 ? -2 * d / l->h : 0;
  PetscCall(BodiesMax(bodies, 1, cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* pull: gravity on what a body is denser than the fluid, over the density of that */
static PetscReal estimate_fall(PetscInt dim, PetscReal d, PetscReal pull, PetscReal nu)
{
  PetscReal speed = PetscSqrtReal((dim == 2 ? PETSC_PI / 2 : 4. / 3) * d * pull);

  for (PetscInt i = 0; dim == 3 && i < 50; i++) {
    const PetscReal re   = PetscMax(speed * d / nu, 1e-12),
                    drag = PetscMax(24 / re * (1 + 0.15 * PetscPowReal(re, 0.687)), 0.44);

    speed = PetscSqrtReal(speed * PetscSqrtReal(4. / 3 * d * pull / drag));
  }
  return speed;
}

PetscErrorCode PromiseFallSpeed(PetscInt dim, PetscReal size, PetscReal density, PetscReal *speed)
{
  PetscReal g[3] = {0, 0, 0}, fluid, viscosity;
  PetscInt  n;

  PetscFunctionBeginUser;
  *speed = 0;
  PetscCall(StreamPeekFluid(&fluid, &viscosity));
  PetscCall(OptPeekReals("-flow_gravity", 3, g, &n));
  if (n < dim) PetscFunctionReturn(PETSC_SUCCESS);
  *speed = estimate_fall(dim, size,
                         PetscAbsReal(density / fluid - 1) *
                           PetscSqrtReal(g[0] * g[0] + g[1] * g[1] + (dim == 3 ? g[2] * g[2] : 0)),
                         viscosity / fluid);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PromiseEstimateFall(PetscInt dim, Bodies bodies, PetscInt group, PetscReal *size, PetscReal *speed)
{
  BodyState *s;
  PetscReal  first[2] = {0, 0}; /* size and density of its first body */
  PetscInt   k;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  *size = *speed = 0;
  if (!s->group[group].count) PetscFunctionReturn(PETSC_SUCCESS);
  if (!(s->group[group].free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z)) || s->group[group].motion.has_pivot)
    PetscFunctionReturn(PETSC_SUCCESS);
  k = BodiesFind(s, s->group[group].first);
  if (k >= 0) first[0] = BodiesGetRadius(s, k);
  if (k >= 0) first[1] = s->density[k];
  PetscCall(BodiesMax(bodies, 2, first));
  *size = 2 * first[0];
  PetscCall(PromiseFallSpeed(dim, *size, first[1], speed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Diameter/sqrt(Re) in cells of a free body that falls; infinite for one that does not, or where a number is an
   expression */
static PetscErrorCode measure_layer(const MeshLocal *l, Bodies bodies, PetscInt group, PetscReal *cells)
{
  PetscReal d, speed, density, viscosity;

  PetscFunctionBeginUser;
  *cells = PETSC_MAX_REAL;
  PetscCall(PromiseEstimateFall(l->dim, bodies, group, &d, &speed));
  PetscCall(StreamPeekFluid(&density, &viscosity));
  if (speed > 0) *cells = d / PetscSqrtReal(density * speed * d / viscosity) / l->h;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What keeps a preset from its promise; group -1: nothing that is known */
typedef struct {
  PetscInt  group;
  PetscReal cells, needed;
  enum {
    THICKNESS,
    LAYER,
    STREAM_LAYER,
    SWING,
    SWINGING_LAYER,
    GAP_WIDTH,
    WALL_WIDTH,
    METHOD /* the penalty is not good enough, and there is no room to line up */
  } what;
} Breach;

PetscBool PromiseIsNarrow(const MeshLocal *l, PetscInt preset, const PromiseScene *scene)
{
  return (PetscBool)(PetscMin(scene->gap[0].cells, scene->gap[1].cells) < GAP[l->dim - 2][0][preset] ||
                     scene->swing.cells < SWINGS[preset]);
}

/* Is the layer of a group in the stream too thin? */
static PetscErrorCode find_stream_breach(const MeshLocal *l, Bodies bodies, PetscInt group, PetscInt preset,
                                         PetscBool aligned, const PromiseScene *scene, Breach *b)
{
  PetscReal  cells, needed;
  StreamEdge edge;
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  PetscCall(StreamMeasureLayer(l, bodies, group, &scene->stream, &cells, &edge));
  needed = STREAM[scene->steady ? 0 : 1][aligned && edge < STREAM_EDGE ? 1 : 0][preset];
  if (edge == STREAM_LIFTS) needed = PetscMax(needed, LIFTS[aligned ? 1 : 0][preset]);
  if (edge == STREAM_EDGE) needed = scene->steady ? EDGE[preset] : PetscMax(needed, EDGE[preset]);
  if (edge == STREAM_EDGE && s->group[group].free && preset == PROMISE_FAST) needed = EDGE_TURNS;
  if (edge == STREAM_EDGE_LIFTS) needed = PetscMax(needed, EDGE_LIFTS[preset]);
  if (cells < needed) *b = (Breach){group, cells, needed, STREAM_LAYER};
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* thick: least number of cells across a body; aligned: the mesh is lined up with them */
static PetscErrorCode find_breach(const MeshLocal *l, Bodies bodies, PetscInt preset, PetscReal thick,
                                  PetscBool aligned, const PromiseScene *scene, Breach *b)
{
  BodyState *s;
  PetscReal  cells = 0, min, wide = GAP[l->dim - 2][aligned ? 1 : 0][preset];
  PetscInt   fall = 0;
  PetscBool  unfit;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  b->group = -1;
  unfit    = (PetscBool)(s->nall && l->dim == 3 && preset == PROMISE_ACCURATE && !aligned);
  if (aligned && scene->spins && preset != PROMISE_FAST) wide = PetscMax(wide, ROTATION_GAP);
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCall(measure_layer(l, bodies, g, &cells));
    if (cells < PETSC_MAX_REAL) fall += s->group[g].count;
  }
  min = PromiseFallLayer(preset, (PetscBool)(fall > 1));
  for (PetscInt g = 0; g < s->ngroups && b->group < 0; g++) {
    PetscCall(PromiseMeasureThickness(l, bodies, g, &cells));
    if (cells != 0 && cells < thick * (1 - 1e-6)) *b = (Breach){g, cells, thick, THICKNESS};
    if (b->group >= 0) break;
    PetscCall(measure_layer(l, bodies, g, &cells));
    if (cells < min) *b = (Breach){g, cells, min, LAYER};
    if (b->group < 0 && !unfit) PetscCall(find_stream_breach(l, bodies, g, preset, aligned, scene, b));
  }
  if (b->group < 0 && unfit) *b = (Breach){0, 0, 0, METHOD};
  if (b->group < 0 && !aligned && scene->swing.cells < SWINGS[preset])
    *b = (Breach){scene->swing.group, scene->swing.cells, SWINGS[preset], SWING};
  if (b->group < 0 && scene->swing.group >= 0 && scene->swing.layer < SWING_LAYER[preset])
    *b = (Breach){scene->swing.layer_group, scene->swing.layer, SWING_LAYER[preset], SWINGING_LAYER};
  for (PetscInt wall = 0; wall < 2 && b->group < 0; wall++) {
    const PetscReal need = wall && aligned && l->dim == 3 ? WALL_GAP[preset] : wide;

    if (scene->gap[wall].cells < need)
      *b = (Breach){scene->gap[wall].group, scene->gap[wall].cells, need, wall ? WALL_WIDTH : GAP_WIDTH};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode cells_needed(Bodies bodies, PetscInt preset, PetscReal *thick)
{
  PetscBool other = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(is_other_fluid(&other));
  *thick = other ? PROMISE[preset].other : PROMISE[preset].cells;
  if (BodiesHaveSlip(bodies)) *thick = PetscMax(*thick, PROMISE[preset].swims);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Another preset that keeps its own promise here, as the middle of a sentence: one that promises more, else less; "" if
   there is none. */
static PetscErrorCode find_other(const MeshLocal *l, Bodies bodies, PetscInt preset, const PromiseScene *scene,
                                 char text[], size_t len)
{
  const PetscInt order[PROMISE_NPRESETS] = {PROMISE_ACCURATE, PROMISE_BALANCED, PROMISE_FAST};

  PetscFunctionBeginUser;
  text[0] = 0;
  for (PetscInt i = 0; i < PROMISE_NPRESETS && !text[0]; i++) {
    const PetscInt p = order[i];
    PetscReal      thick;
    Breach         b;

    if (p == preset) continue;
    PetscCall(cells_needed(bodies, p, &thick));
    PetscCall(find_breach(l, bodies, p, thick, scene->aligned[p], scene, &b));
    if (b.group >= 0) continue;
    if (preset < 0 && p == PROMISE_DEFAULT)
      PetscCall(PetscSNPrintf(text, len, ", ask for -preset %s, which then fits its method to that (%s %%)",
                              PROMISE_PRESETS[p], PROMISE[p].percent));
    else PetscCall(PromiseOffer(p, text, len));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* "group 'disc' is 1.0 cells thick and needs 5.0. Refine the mesh (...), use -preset accurate"; preset -1: the default
   one, for which it may be asked */
static PetscErrorCode describe(const MeshLocal *l, Bodies bodies, PetscInt preset, const Breach *b,
                               const PromiseScene *scene, char text[], size_t len)
{
  const char *const refine = "Refine the mesh (-mesh_cells, -mesh_focus_h, -mesh_levels)";
  BodyState        *s;
  const char       *band = "";
  char              other[128];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  PetscCall(find_other(l, bodies, preset, scene, other, sizeof(other)));
  if (b->what == STREAM_LAYER && l->dim == 3 && preset >= 0 && !scene->aligned[preset])
    band = ", or raise -mesh_refine_distance to 4, where the mesh can be lined up";
  if (b->what == LAYER || b->what == STREAM_LAYER)
    PetscCall(
      PetscSNPrintf(text, len,
                    "the boundary layer of a body of group '%s' that %s is %.2f cells thick and needs %.2g. %s%s%s",
                    s->group[b->group].name, b->what == LAYER ? "falls" : "is held in a stream", (double)b->cells,
                    (double)b->needed, refine, band, other));
  else if (b->what == METHOD)
    PetscCall(
      PetscSNPrintf(text, len,
                    "in space it needs the mesh lined up with the bodies (-couple_method aligned), and that four cells of one size around "
                    "them: raise -mesh_refine_distance to 4, or enlarge the boxes of -mesh_refine%s",
                    other));
  else if (b->what == SWING)
    PetscCall(
      PetscSNPrintf(text, len,
                    "group '%s' swings, is %.1f cells thick and needs %.0f where the mesh is not lined up with it "
                    "(-couple_method aligned). %s%s",
                    s->group[b->group].name, (double)b->cells, (double)b->needed, refine, other));
  else if (b->what == SWINGING_LAYER)
    PetscCall(PetscSNPrintf(text, len, "the layer that swings with group '%s' is %.2f cells thick and needs %.2g. %s%s",
                            s->group[b->group].name, (double)b->cells, (double)b->needed, refine, other));
  else if (b->what == GAP_WIDTH || b->what == WALL_WIDTH)
    PetscCall(PetscSNPrintf(text, len, "the gap between %s is %.2g cells wide and needs %.2g. %s%s",
                            scene->gap[b->what == WALL_WIDTH].between, (double)b->cells, (double)b->needed, refine,
                            other));
  else
    PetscCall(PetscSNPrintf(text, len, "group '%s' is %.1f cells thick and needs %.1f. %s%s", s->group[b->group].name,
                            (double)b->cells, (double)b->needed, refine, other));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PromiseIsAligned(PetscBool *aligned)
{
  char boundary[32];

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-couple_method", boundary, sizeof(boundary)));
  PetscCall(PetscStrcasecmp(boundary, "aligned", aligned));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PromiseSay(PetscInt preset, PetscBool asked, const char why[], char refusal[], size_t len)
{
  PetscFunctionBeginUser;
  if (!asked)
    PetscCall(LogRemark("preset %s, the default, cannot keep its %s %% here: %s", PROMISE_PRESETS[preset],
                        PROMISE[preset].percent, why));
  else if (!refusal[0])
    PetscCall(PetscSNPrintf(refusal, len, "-preset %s cannot keep its %s %% here: %s, or remove -preset",
                            PROMISE_PRESETS[preset], PROMISE[preset].percent, why));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PromiseRefuse(const MeshLocal *l, Bodies bodies, PetscInt preset, const PromiseScene *scene,
                             char refusal[], size_t len)
{
  char      text[640];
  PetscReal thick;
  PetscBool aligned;
  Breach    b;

  PetscFunctionBeginUser;
  refusal[0] = 0;
  PetscCall(PromiseIsAligned(&aligned));
  PetscCall(cells_needed(bodies, preset, &thick));
  PetscCall(find_breach(l, bodies, preset, thick, aligned, scene, &b));
  if (b.group < 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(describe(l, bodies, preset, &b, scene, text, sizeof(text)));
  PetscCall(PromiseSay(preset, PETSC_TRUE, text, refusal, len));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PromiseRemark(const MeshLocal *l, Bodies bodies, const PromiseScene *scene)
{
  char      text[640];
  PetscReal thick;
  PetscBool aligned;
  Breach    b;

  PetscFunctionBeginUser;
  PetscCall(PromiseIsAligned(&aligned));
  PetscCall(cells_needed(bodies, aligned ? PROMISE_ACCURATE : PROMISE_DEFAULT, &thick));
  if (l->dim == 3 && !aligned) thick = PetscMax(thick, SPACE_DEFAULT);
  PetscCall(find_breach(l, bodies, PROMISE_DEFAULT, thick, aligned, scene, &b));
  if (b.group < 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(describe(l, bodies, -1, &b, scene, text, sizeof(text)));
  PetscCall(PromiseSay(PROMISE_DEFAULT, PETSC_FALSE, text, NULL, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
