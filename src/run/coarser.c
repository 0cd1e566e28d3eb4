/* Coarser: see coarser.h. */
#include "compat.h"
#include "base/runcomm.h"
#include "coarser.h"
#include "base/opt.h"
#include "mesh/mesh.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CELLS_MIN 4   /* along an axis, which a coarser mesh is made of */
#define BAND      "4" /* cells of one size around bodies that the aligned mesh needs */

/* text NULL: as if it were not given */
static PetscErrorCode change(Coarser *c, const char name[], const char text[])
{
  PetscInt i = c->n;

  PetscFunctionBeginUser;
  PetscCheck(i < COARSER_MAX, RunComm(), PETSC_ERR_PLIB, "Option %s is one too many to be changed for a trial", name);
  PetscCall(PetscStrncpy(c->option[i].name, name, sizeof(c->option[i].name)));
  PetscCall(PetscOptionsHasName(NULL, NULL, name, &c->option[i].given));
  PetscCall(OptPeek(name, c->option[i].was, sizeof(c->option[i].was)));
  if (text) PetscCall(PetscOptionsSetValue(NULL, name, text));
  else PetscCall(PetscOptionsClearValue(NULL, name));
  c->n++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarserPutBack(Coarser *c, PetscInt n)
{
  PetscFunctionBeginUser;
  while (c->n > n) {
    c->n--;
    if (c->option[c->n].given) PetscCall(PetscOptionsSetValue(NULL, c->option[c->n].name, c->option[c->n].was));
    else PetscCall(PetscOptionsClearValue(NULL, c->option[c->n].name));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the mesh ---- */

/* "44,8" -> "22,4" by a factor 2, and by how much cells become larger; 0: too few */
static void thin_out(const char cells[], PetscInt fewest, PetscReal factor, char half[], size_t len, PetscReal *ratio)
{
  PetscInt n = 0;

  *ratio  = 1;
  half[0] = 0;
  for (const char *at = cells; *at; at += strspn(at, ", ")) {
    char      *end;
    const long now = strtol(at, &end, 10), then = (long)((PetscReal)now / factor + 0.5 + 1e-9);
    size_t     used = strlen(half);

    if (end == at || now < fewest || then == now) *ratio = 0;
    if (*ratio == 0) return;
    (void)snprintf(half + used, len - used, "%s%ld", n ? "," : "", then);
    *ratio *= (PetscReal)now / (PetscReal)then;
    n++;
    at = end;
  }
  *ratio = n ? PetscPowReal(*ratio, 1. / (PetscReal)n) : 0;
}

PetscErrorCode CoarserMesh(Coarser *kept, PetscReal factor, PetscReal *ratio)
{
  char      kind[64], text[64], half[128];
  PetscInt  refined = 0;
  PetscReal h;
  PetscBool file, box, found;

  PetscFunctionBeginUser;
  *ratio = 2;
  PetscCall(PetscOptionsGetInt(NULL, NULL, "-dm_refine", &refined, NULL));
  PetscCall(PetscSNPrintf(half, sizeof(half), "%" PetscInt_FMT, refined - 1));
  if (refined > 0) PetscCall(change(kept, "-dm_refine", half));
  if (refined > 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptPeek("-mesh_kind", kind, sizeof(kind)));
  PetscCall(PetscStrcasecmp(kind, "file", &file));
  PetscCall(PetscStrcasecmp(kind[0] ? kind : "box", "box", &box));
  PetscCall(OptPeekReal("-mesh_focus_h", &h, &found));
  if (box && found) {
    (void)snprintf(half, sizeof(half), "%.17g", (double)(factor * h));
    *ratio = factor;
    PetscCall(change(kept, "-mesh_focus_h", half));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(OptPeek(box ? "-mesh_cells" : "-mesh_resolution", text, sizeof(text)));
  if (!box && !text[0]) PetscCall(PetscSNPrintf(text, sizeof(text), "%" PetscInt_FMT, MeshDefaultResolution(kind)));
  thin_out(text, box ? CELLS_MIN : 2, factor, half, sizeof(half), ratio);
  if (file) *ratio = 0;
  if (*ratio > 0) PetscCall(change(kept, box ? "-mesh_cells" : "-mesh_resolution", half));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the method ---- */

PetscErrorCode CoarserLineUp(Coarser *c)
{
  PetscFunctionBeginUser;
  PetscCall(change(c, "-couple_method", "aligned"));
  PetscCall(change(c, "-mesh_refine_distance", BAND));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- steps ---- */

/* The option times a factor, at most `most` (0: any), where it is given or has a default */
static PetscErrorCode scale(Coarser *c, const char name[], PetscReal usual, PetscReal factor, PetscReal upper)
{
  char      text[64];
  PetscReal value = usual;
  PetscBool given;

  PetscFunctionBeginUser;
  PetscCall(OptPeekReal(name, &value, &given));
  if (!given) value = usual;
  if (value <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  value *= factor;
  if (upper > 0) value = PetscMin(value, upper);
  (void)snprintf(text, sizeof(text), "%.17g", (double)value);
  PetscCall(change(c, name, text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoarserSteps(Coarser *c, PetscReal longer, PetscReal larger, PetscInt order, PetscReal from,
                            PetscReal end)
{
  char text[64];

  PetscFunctionBeginUser;
  (void)snprintf(text, sizeof(text), "%.17g", (double)end);
  PetscCall(change(c, "-sim_time", text));
  (void)snprintf(text, sizeof(text), "%.17g", (double)from);
  PetscCall(change(c, "-monitor_from", text));
  PetscCall(change(c, "-sim_steps", NULL));
  PetscCall(change(c, "-sim_restart", NULL));
  /* a parabola that the run may take is not stable in longer steps */
  PetscCall(OptPeek("-flow_extrapolation", text, sizeof(text)));
  if (!strcasecmp(text, "quadratic")) PetscCall(change(c, "-flow_extrapolation", "auto"));
  PetscCall(scale(c, "-sim_dt", 0.01, longer, 0));
  PetscCall(scale(c, "-sim_adapt_max", 0, longer, 0));
  PetscCall(scale(c, "-sim_adapt_min", 0, longer, 0));
  PetscCall(scale(c, "-sim_adapt_tolerance", 1e-4, PetscPowReal(longer, order + 1), 1));
  PetscCall(scale(c, "-sim_adapt_displacement", 0.5, longer / larger, 1)); /* in cells, as the next */
  PetscCall(scale(c, "-sim_adapt_cfl", 5, longer / larger, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
