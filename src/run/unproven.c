/* Unproven: see unproven.h. */
#include "compat.h"
#include "unproven.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "dropcells.h"
#include "promise.h"
#include "scalarlayers.h"
#include "solidpromise.h"
#include "scalar/scalar.h"
#include <string.h>
#include <strings.h>

/* Cells that the layer of heat needs. Nusselt number of a cavity (Pr .71), cells in the layer, per cent off: Ra 1e4 .37
   -1.1, .55 -.08, .73 -.03; Ra 1e5 .21 -15, .31 -4.2, .41 -1.1, .62 -.13, .83 -.04; Ra 1e6 .23 -11, .35 -2.9, .46 -.67.
   Of a disc at a value in a cavity, aligned: Ra 1e6 .35 -1.2, .46 -.6, .70 -.06; penalty: Ra 1e5 .62 -4.1, .83 -2.1,
   1.2 -.9, 2.5 -.3; Ra 1e6 .46 -4.6, .70 -3.4, 1.4 -1.3 (runs/studies/scalars/notes.md). Without bodies as aligned. */
static const PetscReal LAYER[SCALAR_LAYER_NMETHODS][PROMISE_NPRESETS] = {{0.6, 2, 5}, {0.35, 0.5, 0.65}, {2.5, 12, 60}};

#define BETWEEN ", []" /* names of a list, as files and arguments have them */

/* list [len]: "a, b" and one more */
static PetscErrorCode append(char list[], size_t len, const char word[])
{
  PetscFunctionBeginUser;
  if (list[0]) PetscCall(PetscStrlcat(list, ", ", len));
  PetscCall(PetscStrlcat(list, word, len));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* "drops (bubble)" to the list text [len] */
static PetscErrorCode append_kind(char text[], size_t len, const char kind[], const char names[])
{
  char word[192];

  PetscFunctionBeginUser;
  if (!names[0]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscSNPrintf(word, sizeof(word), "%s (%s)", kind, names));
  PetscCall(append(text, len, word));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* text [len]: "elastic particles that touch (flap), scalars (heat)", all but one scalar, and solids, that are known,
   and drops that are promised; "": nothing */
static PetscErrorCode list_unknown(const MeshLocal *l, const char known[], PetscBool alone, char text[], size_t len)
{
  char elastic[128] = "", drops[128] = "", scalars[128] = "", list[1024], name[OPT_NAME], material[64], *word, *rest;
  PetscBool promised;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-particle_groups", list, sizeof(list)));
  for (word = strtok_r(list, BETWEEN, &rest); word; word = strtok_r(NULL, BETWEEN, &rest)) {
    PetscCall(OptPeek(OptJoin("-particle_", word, "_material", name), material, sizeof(material)));
    if (!strcasecmp(material, "fluid")) PetscCall(append(drops, sizeof(drops), word));
    else if (material[0] && strcasecmp(material, "rigid") != 0 && !alone)
      PetscCall(append(elastic, sizeof(elastic), word));
  }
  PetscCall(OptPeek("-scalars", list, sizeof(list)));
  for (word = strtok_r(list, BETWEEN, &rest); word; word = strtok_r(NULL, BETWEEN, &rest))
    if (strcmp(word, known) != 0) PetscCall(append(scalars, sizeof(scalars), word));
  text[0] = 0;
  PetscCall(append_kind(text, len, "elastic particles that touch", elastic));
  PetscCall(DropCellsArePromised(l, &promised));
  if (!promised) PetscCall(append_kind(text, len, "drops", drops));
  PetscCall(append_kind(text, len, "scalars", scalars));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is an option the value of a scalar at a boundary, or of a body? */
static PetscBool gives_value(const char option[], const char scalar[])
{
  char         start[OPT_NAME], end[OPT_NAME];
  const size_t length = strlen(option);

  (void)snprintf(start, sizeof(start), "-scalar_%s_bc_", scalar);
  (void)snprintf(end, sizeof(end), "_%s_value", scalar);
  if (!strncasecmp(option, start, strlen(start)))
    return (PetscBool)(length > strlen(start) + 6 && !strcasecmp(option + length - 6, "_value"));
  return (PetscBool)(!strncasecmp(option, "-particle_", 10) && length > 10 + strlen(end) &&
                     !strcasecmp(option + length - strlen(end), end));
}

/* Largest difference of values at boundaries and of bodies; 0 where there are less than two, or one that is an
   expression, and where the flow has an inflow or anything else at a boundary */
static PetscErrorCode find_difference(const char scalar[], PetscReal *difference)
{
  const char flow[] = "-flow_bc_";
  char      *all, *line, *rest;
  PetscReal  low = PETSC_MAX_REAL, high = -PETSC_MAX_REAL, value;
  PetscBool  known = PETSC_TRUE;
  PetscInt   n;

  PetscFunctionBeginUser;
  PetscCall(OptGetAll(&all));
  for (line = strtok_r(all, "\n", &rest); line; line = strtok_r(NULL, "\n", &rest)) {
    line[strcspn(line, " ")] = 0;
    if (!strncasecmp(line, flow, strlen(flow))) known = PETSC_FALSE;
    if (!gives_value(line, scalar)) continue;
    PetscCall(OptPeekReals(line, 1, &value, &n));
    if (n != 1) known = PETSC_FALSE;
    low  = PetscMin(low, value);
    high = PetscMax(high, value);
  }
  PetscCall(PetscFree(all));
  *difference = known && high > low ? high - low : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Thickness of the layer of a scalar that drives the flow; infinite where nothing is known */
static PetscErrorCode measure_scalar(const MeshLocal *l, const char scalar[], const PetscReal gravity[],
                                     PetscReal *layer)
{
  PetscReal density, viscosity, expansion = 0, diffusivity, difference = 0;
  PetscReal pull = 0, height = 0, prandtl, rayleigh;
  PetscBool given;
  char      name[OPT_NAME];

  PetscFunctionBeginUser;
  *layer = PETSC_MAX_REAL;
  PetscCall(StreamPeekFluid(&density, &viscosity));
  PetscCall(OptPeekReal(OptJoin("-scalar_", scalar, "_expansion", name), &expansion, &given));
  PetscCall(ScalarsPeekDiffusivity(scalar, &diffusivity));
  PetscCall(find_difference(scalar, &difference));
  for (PetscInt a = 0; a < l->dim; a++) {
    pull += gravity[a] * gravity[a];
    height += PetscAbsReal(gravity[a]) * (l->upper[a] - l->lower[a]);
  }
  pull = PetscSqrtReal(pull);
  if (pull == 0 || expansion == 0 || difference == 0 || diffusivity <= 0 || viscosity <= 0)
    PetscFunctionReturn(PETSC_SUCCESS);
  height /= pull;
  prandtl  = viscosity / density / diffusivity;
  rayleigh = pull * PetscAbsReal(expansion) * difference * height * height * height * density /
             (viscosity * diffusivity);
  *layer = height / PetscPowReal(rayleigh / PetscMin(1, prandtl), 0.25);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Are all particles rigid bodies that stand still at a value of the scalar? */
static PetscErrorCode stand_at_value(Bodies bodies, const char scalar[], PetscBool *all)
{
  char list[1024], name[OPT_NAME], text[64], *word, *rest;

  PetscFunctionBeginUser;
  *all = PETSC_TRUE;
  if (bodies) PetscCall(BodiesAreStill(bodies, all));
  PetscCall(OptPeek("-particle_groups", list, sizeof(list)));
  for (word = strtok_r(list, BETWEEN, &rest); word; word = strtok_r(NULL, BETWEEN, &rest)) {
    PetscCall(OptPeek(OptJoin("-particle_", word, "_material", name), text, sizeof(text)));
    if (text[0] && strcasecmp(text, "rigid") != 0) *all = PETSC_FALSE;
    (void)snprintf(name, sizeof(name), "-particle_%s_%s_condition", word, scalar);
    PetscCall(OptPeek(name, text, sizeof(text)));
    if (strcasecmp(text, "value") != 0) *all = PETSC_FALSE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* cells: of the thinnest layer, which is that of scalar [len] */
static PetscErrorCode measure_layer(const MeshLocal *l, Bodies bodies, PetscReal *cells, char scalar[], size_t len)
{
  char      list[1024], kind[64], *word, *rest;
  PetscReal gravity[3], layer;
  PetscBool all;
  PetscInt  n;

  PetscFunctionBeginUser;
  *cells    = PETSC_MAX_REAL;
  scalar[0] = 0;
  PetscCall(OptPeek("-scalars", list, sizeof(list)));
  PetscCall(OptPeek("-mesh_kind", kind, sizeof(kind)));
  PetscCall(OptPeekReals("-flow_gravity", 3, gravity, &n));
  if (l->hang || n < l->dim || (kind[0] && strcasecmp(kind, "box") != 0)) PetscFunctionReturn(PETSC_SUCCESS);
  for (word = strtok_r(list, BETWEEN, &rest); word; word = strtok_r(NULL, BETWEEN, &rest)) {
    PetscCall(stand_at_value(bodies, word, &all));
    if (!all) continue;
    PetscCall(measure_scalar(l, word, gravity, &layer));
    if (layer / l->h >= *cells) continue;
    *cells = layer / l->h;
    PetscCall(PetscStrncpy(scalar, word, len));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode UnprovenCheck(const MeshLocal *l, Bodies bodies, Solids solids, PetscInt preset, PetscBool asked,
                             char refusal[], size_t len)
{
  char        scalar[64], unknown[512], text[512], less[64] = "";
  PetscInt    method = SCALAR_LAYER_ALIGNED;
  const char *other  = "";
  BodyState  *s      = NULL;
  PetscReal   cells;
  PetscBool   alone = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(measure_layer(l, bodies, &cells, scalar, sizeof(scalar)));
  if (bodies) PetscCall(BodiesGetState(bodies, &s));
  if (s && s->nall) PetscCall(ScalarLayersFindMethod(&method));
  if (cells < LAYER[method][preset]) {
    for (PetscInt p = 0; p < preset; p++)
      if (cells >= LAYER[method][p]) PetscCall(PromiseOffer(p, less, sizeof(less)));
    if (cells >= LAYER[SCALAR_LAYER_ALIGNED][preset]) other = ", or use -couple_method aligned";
    PetscCall(PetscSNPrintf(text, sizeof(text),
                            "the boundary layer of scalar '%s', which drives the flow, is %.2f cells thick and needs "
                            "%.2g. Refine the mesh (-mesh_cells)%s%s",
                            scalar, (double)cells, (double)LAYER[method][preset], less, other));
    PetscCall(PromiseSay(preset, asked, text, refusal, len));
  }
  if (!asked) PetscFunctionReturn(PETSC_SUCCESS);
  if (solids) PetscCall(SolidPromiseIsAlone(bodies, solids, &alone));
  PetscCall(list_unknown(l, scalar, alone, unknown, sizeof(unknown)));
  if (unknown[0])
    PetscCall(LogRemark("-preset %s promises its %s %% of the flow and of bodies, and nothing of %s: compare with "
                        "a finer mesh and a shorter step",
                        PROMISE_PRESETS[preset], PromiseText(preset), unknown));
  PetscFunctionReturn(PETSC_SUCCESS);
}
