/* Promise: see promise.h. */
#include "compat.h"
#include "promise.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* What each preset promises, and for it: how many cells thick a body must be (balanced: a disc of 4 cells is 1.7 to
   2.5 % off, of 5 cells 0.6 %, an ellipse of 2 cells 1.9 %; accurate: 0.14 % there; a flap of 1.6 cells 1.6, 1.5 and
   1.2 %), also in other fluids (balanced: a disc of 7 cells 2.4 % off in a Carreau fluid, 2.1 % in Oldroyd-B, of 10
   cells .1 and .8 %), and the boundary layer of a falling one (two discs with 0.43 cells, at 8 cells a diameter: fast
   3 % off, accurate 3.6 %; an ellipse with 0.64 within 0.14 %), or of several that fall in each other's wakes (two
   discs with 0.64 cells: fast 1.6, balanced 1.6, accurate 1.3 % off; with 1.3 cells 0.5, 0.5, 0.3 %; with 2.6
   accurate 0.06 %) */
const char *const PROMISE_PRESETS[] = {"fast", "balanced", "accurate", NULL};
static const struct {
  const char *percent;
  PetscReal   cells, other, layer, wakes;
} PROMISE[] = {{"5", 1.5, 1.5, 0.25, 0.25}, {"1", 5, 10, 0.5, 1}, {"0.2", 2, 2, 0.5, 2}};

PetscReal PromisePercent(PetscInt preset)
{
  return strtod(PROMISE[preset].percent, NULL);
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

/* Thickness in cells about the centre of the smallest body of a group; 0: the centre is not inside */
static PetscErrorCode measure_thickness(const MeshLocal *l, Bodies bodies, PetscInt group, PetscReal *cells)
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
  if (smallest >= 0 && s->scale[smallest] == scale) PetscCall(BodiesDistance(bodies, smallest, NULL, NULL, 1, s->x[smallest], &d));
  *cells = d < 0 ? -2 * d / l->h : 0;
  PetscCall(BodiesMax(bodies, 1, cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Diameter/sqrt(Re) in cells of a free body that falls with a drag coefficient of 1; infinite for one that does not, or
   where a number is an expression. Planes only: no measurements in space. */
static PetscErrorCode measure_layer(const MeshLocal *l, Bodies bodies, PetscInt group, PetscReal *cells)
{
  BodyState *s;
  char       text[64];
  double     x = 0, y = 0;
  PetscReal  density = 1, viscosity = 0.01;
  PetscBool  known;
  PetscReal  first[2] = {0, 0}, d, speed; /* size and density of its first body */
  PetscInt   k;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  *cells = PETSC_MAX_REAL;
  PetscCall(OptPeekReal("-flow_density", &density, &known));
  PetscCall(OptPeekReal("-flow_viscosity", &viscosity, &known));
  PetscCall(OptPeek("-flow_gravity", text, sizeof(text)));
  if (l->dim != 2 || !s->group[group].count || sscanf(text, "%lf%*[ ,]%lf", &x, &y) != 2) PetscFunctionReturn(PETSC_SUCCESS);
  if (!(s->group[group].free & (BODY_FREE_X | BODY_FREE_Y)) || s->group[group].motion.has_pivot) PetscFunctionReturn(PETSC_SUCCESS);
  k = BodiesFind(s, s->group[group].first);
  if (k >= 0) first[0] = BodiesGetRadius(s, k);
  if (k >= 0) first[1] = s->density[k];
  PetscCall(BodiesMax(bodies, 2, first));
  d     = 2 * first[0];
  speed = PetscSqrtReal(0.5 * PETSC_PI * d * PetscAbsReal(first[1] / density - 1) * PetscSqrtReal(x * x + y * y));
  if (speed > 0) *cells = d / PetscSqrtReal(density * speed * d / viscosity) / l->h;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What keeps a preset from its promise; group -1: nothing that is known */
typedef struct {
  PetscInt  group;
  PetscReal cells, needed;
  PetscBool layer; /* of the boundary layer, not of the body */
} Breach;

/* thick: least number of cells across a body */
static PetscErrorCode find_breach(const MeshLocal *l, Bodies bodies, PetscInt preset, PetscReal thick, Breach *b)
{
  BodyState *s;
  PetscReal  cells = 0, least = PROMISE[preset].layer;
  PetscInt   fall = 0;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  b->group = -1;
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCall(measure_layer(l, bodies, g, &cells));
    if (cells < PETSC_MAX_REAL) fall += s->group[g].count;
  }
  if (fall > 1) least = PROMISE[preset].wakes;
  for (PetscInt g = 0; g < s->ngroups && b->group < 0; g++) {
    PetscCall(measure_thickness(l, bodies, g, &cells));
    if (cells != 0 && cells < thick * (1 - 1e-6)) *b = (Breach){g, cells, thick, PETSC_FALSE};
    if (b->group >= 0) break;
    PetscCall(measure_layer(l, bodies, g, &cells));
    if (cells < least) *b = (Breach){g, cells, least, PETSC_TRUE};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode cells_needed(PetscInt preset, PetscReal *thick)
{
  PetscBool other = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(is_other_fluid(&other));
  *thick = other ? PROMISE[preset].other : PROMISE[preset].cells;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Another preset that keeps its own promise here, as the middle of a sentence: one that promises more, else less; "" if
   there is none. In space accurate draws bodies as balanced does. */
static PetscErrorCode find_other(const MeshLocal *l, Bodies bodies, PetscInt preset, char text[], size_t len)
{
  const PetscInt order[3] = {2, 1, 0};

  PetscFunctionBeginUser;
  text[0] = 0;
  for (PetscInt i = 0; i < 3 && !text[0]; i++) {
    const PetscInt p = order[i];
    PetscReal      thick;
    Breach         b;

    if (p == preset || (p == 2 && l->dim == 3)) continue;
    PetscCall(cells_needed(p, &thick));
    PetscCall(find_breach(l, bodies, p, thick, &b));
    if (b.group < 0) PetscCall(PetscSNPrintf(text, len, ", use -preset %s (%s %%)", PROMISE_PRESETS[p], PROMISE[p].percent));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* "group 'disc' is 1.0 cells thick and needs 5.0. Refine the mesh (...), use -preset accurate" */
static PetscErrorCode describe(const MeshLocal *l, Bodies bodies, PetscInt preset, const Breach *b, char text[], size_t len)
{
  BodyState *s;
  char       other[64];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  PetscCall(find_other(l, bodies, preset, other, sizeof(other)));
  if (b->layer)
    PetscCall(PetscSNPrintf(text, len,
                            "the boundary layer of a falling body of group '%s' is %.2f cells thick and needs %.2g. Refine the mesh (-mesh_cells, "
                            "-mesh_focus_h, -mesh_levels)%s",
                            s->group[b->group].name, (double)b->cells, (double)b->needed, other));
  else
    PetscCall(PetscSNPrintf(text, len, "group '%s' is %.1f cells thick and needs %.1f. Refine the mesh (-mesh_cells, -mesh_focus_h, -mesh_levels)%s",
                            s->group[b->group].name, (double)b->cells, (double)b->needed, other));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PromiseRefuse(const MeshLocal *l, Bodies bodies, PetscInt preset, char refusal[], size_t len)
{
  char      text[512];
  PetscReal thick;
  Breach    b;

  PetscFunctionBeginUser;
  refusal[0] = 0;
  PetscCall(cells_needed(preset, &thick));
  PetscCall(find_breach(l, bodies, preset, thick, &b));
  if (b.group < 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(describe(l, bodies, preset, &b, text, sizeof(text)));
  PetscCall(PetscSNPrintf(refusal, len, "-preset %s cannot keep its %s %% here: %s, or remove -preset", PROMISE_PRESETS[preset],
                          PROMISE[preset].percent, text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PromiseRemark(const MeshLocal *l, Bodies bodies)
{
  char      text[512], boundary[32];
  PetscReal thick;
  PetscBool snap;
  Breach    b;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-couple_boundary", boundary, sizeof(boundary)));
  PetscCall(PetscStrcasecmp(boundary, "snap", &snap));
  PetscCall(cells_needed(snap ? 2 : 1, &thick));
  PetscCall(find_breach(l, bodies, 1, thick, &b));
  if (b.group < 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(describe(l, bodies, 1, &b, text, sizeof(text)));
  PetscCall(LogRemark("preset %s, the default, cannot keep its %s %% here: %s", PROMISE_PRESETS[1], PROMISE[1].percent, text));
  PetscFunctionReturn(PETSC_SUCCESS);
}
