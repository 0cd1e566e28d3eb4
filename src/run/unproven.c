/* Unproven: see unproven.h. */
#include "compat.h"
#include "unproven.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "promise.h"
#include "scalar/scalar.h"
#include <string.h>
#include <strings.h>

/* Cells that the layer of heat needs. Nusselt number of a cavity (Pr .71), cells in the layer, per cent off: Ra 1e4 .37
   -1.1, .55 -.08, .73 -.03; Ra 1e5 .21 -15, .31 -4.2, .41 -1.1, .62 -.13, .83 -.04; Ra 1e6 .23 -11, .35 -2.9, .46 -.67
   (runs/studies/scalars/notes.md) */
static const PetscReal LAYER[PROMISE_NPRESETS] = {0.35, 0.5, 0.65};

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

/* text [len]: "elastic particles (flap), scalars (heat)", all but one scalar that is known; "": nothing */
static PetscErrorCode list_unknown(const char known[], char text[], size_t len)
{
  char elastic[128] = "", drops[128] = "", scalars[128] = "", list[1024], name[OPT_NAME], material[64], *word, *rest;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-particle_groups", list, sizeof(list)));
  for (word = strtok_r(list, BETWEEN, &rest); word; word = strtok_r(NULL, BETWEEN, &rest)) {
    PetscCall(OptPeek(OptJoin("-particle_", word, "_material", name), material, sizeof(material)));
    if (!strcasecmp(material, "fluid")) PetscCall(append(drops, sizeof(drops), word));
    else if (material[0] && strcasecmp(material, "rigid") != 0) PetscCall(append(elastic, sizeof(elastic), word));
  }
  PetscCall(OptPeek("-scalars", list, sizeof(list)));
  for (word = strtok_r(list, BETWEEN, &rest); word; word = strtok_r(NULL, BETWEEN, &rest))
    if (strcmp(word, known) != 0) PetscCall(append(scalars, sizeof(scalars), word));
  text[0] = 0;
  PetscCall(append_kind(text, len, "elastic particles", elastic));
  PetscCall(append_kind(text, len, "drops", drops));
  PetscCall(append_kind(text, len, "scalars", scalars));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Largest difference of values at boundaries; 0 where there are less than two, or one that is an expression, and where
   the flow has an inflow or anything else at a boundary */
static PetscErrorCode find_difference(const char scalar[], PetscReal *difference)
{
  const char after[] = "_value", flow[] = "-flow_bc_";
  char      *all, *line, *rest, start[OPT_NAME];
  PetscReal  low = PETSC_MAX_REAL, high = -PETSC_MAX_REAL, value;
  PetscBool  known = PETSC_TRUE;
  PetscInt   n;

  PetscFunctionBeginUser;
  PetscCall(OptGetAll(&all));
  PetscCall(PetscSNPrintf(start, sizeof(start), "-scalar_%s_bc_", scalar));
  for (line = strtok_r(all, "\n", &rest); line; line = strtok_r(NULL, "\n", &rest)) {
    line[strcspn(line, " ")] = 0;
    if (!strncasecmp(line, flow, strlen(flow))) known = PETSC_FALSE;
    if (strncasecmp(line, start, strlen(start)) != 0 || strlen(line) < strlen(start) + strlen(after) ||
        strcasecmp(line + strlen(line) - strlen(after), after) != 0)
      continue;
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

/* cells: of the thinnest layer, which is that of scalar [len] */
static PetscErrorCode measure_layer(const MeshLocal *l, Bodies bodies, PetscReal *cells, char scalar[], size_t len)
{
  BodyState *s;
  char       list[1024], groups[64], kind[64], *word, *rest;
  PetscReal  gravity[3], layer;
  PetscInt   n;

  PetscFunctionBeginUser;
  *cells    = PETSC_MAX_REAL;
  scalar[0] = 0;
  if (bodies) {
    PetscCall(BodiesGetState(bodies, &s));
    if (s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(OptPeek("-scalars", list, sizeof(list)));
  PetscCall(OptPeek("-particle_groups", groups, sizeof(groups)));
  PetscCall(OptPeek("-mesh_kind", kind, sizeof(kind)));
  PetscCall(OptPeekReals("-flow_gravity", 3, gravity, &n));
  if (l->hang || n < l->dim || groups[0] || (kind[0] && strcasecmp(kind, "box") != 0))
    PetscFunctionReturn(PETSC_SUCCESS);
  for (word = strtok_r(list, BETWEEN, &rest); word; word = strtok_r(NULL, BETWEEN, &rest)) {
    PetscCall(measure_scalar(l, word, gravity, &layer));
    if (layer / l->h >= *cells) continue;
    *cells = layer / l->h;
    PetscCall(PetscStrncpy(scalar, word, len));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode UnprovenCheck(const MeshLocal *l, Bodies bodies, PetscInt preset, PetscBool asked, char refusal[],
                             size_t len)
{
  char      scalar[64], unknown[512], text[512], less[64] = "";
  PetscReal cells;

  PetscFunctionBeginUser;
  PetscCall(measure_layer(l, bodies, &cells, scalar, sizeof(scalar)));
  if (cells < LAYER[preset]) {
    for (PetscInt p = 0; p < preset; p++)
      if (cells >= LAYER[p])
        PetscCall(PetscSNPrintf(less, sizeof(less), ", use -preset %s (%s %%)", PROMISE_PRESETS[p], PromiseText(p)));
    PetscCall(PetscSNPrintf(text, sizeof(text),
                            "the boundary layer of scalar '%s', which drives the flow, is %.2f cells thick and needs "
                            "%.2g. Refine the mesh (-mesh_cells)%s",
                            scalar, (double)cells, (double)LAYER[preset], less));
    PetscCall(PromiseSay(preset, asked, text, refusal, len));
  }
  if (!asked) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(list_unknown(scalar, unknown, sizeof(unknown)));
  if (unknown[0])
    PetscCall(
      LogRemark("-preset %s promises its %s %% of the flow and of rigid bodies, and nothing of %s: compare with "
                "a finer mesh and a shorter step",
                PROMISE_PRESETS[preset], PromiseText(preset), unknown));
  PetscFunctionReturn(PETSC_SUCCESS);
}
