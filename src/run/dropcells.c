/* DropCells: see dropcells.h. */
#include "compat.h"
#include "dropcells.h"
#include "base/opt.h"
#include "promise.h"
#include <strings.h>

/* Cells a radius. Per cent off, with steps that presets take: decay of a drop in a gas with 2, 3, 4, 6 cells 25, 4.8,
   .9, .5; height of a rising bubble with 2, 3, 4, 5 cells .4, .15, .13, .05; crest of a gravity wave with 2.3, 4.6, 9.2
   cells 5.7, .4, .1 (runs/studies/drops/notes.md) */
static const PetscReal CELLS[PROMISE_NPRESETS] = {3, 4, 8};

PetscErrorCode DropCellsArePromised(const MeshLocal *l, PetscBool *promised)
{
  char form[32];

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-couple_drops", form, sizeof(form)));
  *promised = (PetscBool)(l->dim == 2 && (!form[0] || !strcasecmp(form, "aligned")));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropCellsCheck(const MeshLocal *l, Drops drops, Bodies bodies, PetscInt preset, char refusal[],
                              size_t len)
{
  DropsState *s;
  BodyState  *b = NULL;
  PetscReal   cells, fewest = PETSC_MAX_REAL;
  PetscInt    group = -1;
  PetscBool   promised;
  char        less[64] = "", text[512];

  PetscFunctionBeginUser;
  PetscCall(DropCellsArePromised(l, &promised));
  if (!promised) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DropsGetState(drops, &s));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCall(DropsGetRadius(drops, g, l, &cells));
    cells /= l->h;
    if (cells >= fewest) continue;
    fewest = cells;
    group  = g;
  }
  for (PetscInt p = 0; p < preset; p++)
    if (fewest >= CELLS[p]) PetscCall(PromiseOffer(p, less, sizeof(less)));
  if (bodies) PetscCall(BodiesGetState(bodies, &b));
  if (fewest < CELLS[preset] * (1 - 1e-6))
    PetscCall(
      PetscSNPrintf(text, sizeof(text),
                    "drops of group '%s' have %.2g cells a radius and need %.2g. Refine the mesh (-mesh_cells)%s",
                    s->group[group].name, (double)fewest, (double)CELLS[preset], less));
  else if (b && b->nall && preset == PROMISE_ACCURATE)
    PetscCall(
      PetscSNPrintf(text, sizeof(text),
                    "beside drops rigid bodies are held by the penalty (-couple_method), which is up to 1 %% off. "
                    "Leave them out%s",
                    less));
  else PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PromiseSay(preset, PETSC_TRUE, text, refusal, len));
  PetscFunctionReturn(PETSC_SUCCESS);
}
