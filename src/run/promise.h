/* Promise: how close the presets come to the converged value, and on which meshes they do.

   Known are how many cells a body is thick about its centre, how many the narrowest gap that lasts, and how many the
   boundary layer of a falling body (runs/validate/presets.md, runs/studies/tradeoff, runs/studies/boundary). */
#pragma once
#include "bodies/bodies.h"
#include "gaps.h"
#include "mesh/mesh.h"
#include "stream.h"
#include "swing.h"

#define PROMISE_REACH 20 /* cells; wider gaps keep no preset from its promise */

/* In the order of their names; the default, for which no scene need ask */
enum {
  PROMISE_FAST,
  PROMISE_BALANCED,
  PROMISE_ACCURATE,
  PROMISE_NPRESETS,
  PROMISE_DEFAULT = PROMISE_BALANCED
};
extern const char *const PROMISE_PRESETS[]; /* "fast", "balanced", "accurate", NULL */

/* What is known of a scene: its narrowest lasting gaps (between bodies, from walls), and which presets line the mesh
   up with the bodies (-couple_method aligned) if they are asked for */
typedef struct {
  LastingGap gap[2];
  PetscBool  steady;
  Stream     stream;
  PetscBool  spins; /* a body is free to turn, and stays where it is */
  Swing      swing;
  PetscBool  aligned[PROMISE_NPRESETS];
} PromiseScene;

/* Is one of them too narrow for a preset with the penalty, or a body that swings too thin? */
PetscBool   PromiseIsNarrow(const MeshLocal *, PetscInt preset, const PromiseScene *);
PetscInt    PromiseFind(const char name[]); /* the default where none has that name */
PetscReal   PromisePercent(PetscInt preset);
const char *PromiseText(PetscInt preset); /* the same for messages: "0.2" */
/* A preset cannot keep its promise: why, with the remedy. If it was asked for, to refusal [len], unless that says
   something, else as a remark. Collective. */
PetscErrorCode PromiseSay(PetscInt preset, PetscBool asked, const char why[], char refusal[], size_t len);
/* ", use -preset fast (5 %)": another preset, as the middle of a sentence */
PetscErrorCode PromiseOffer(PetscInt preset, char text[], size_t len);
/* Is -couple_method aligned now, by options that stay unread? Local. */
PetscErrorCode PromiseIsAligned(PetscBool *);
/* Terminal speed of a body of this size and density by the options, which stay unread, by its drag coefficient: in the
   plane 1, in space that of Schiller and Naumann (1935) for spheres; 0: nothing pulls, or nothing is known. Local. */
PetscErrorCode PromiseFallSpeed(PetscInt dim, PetscReal size, PetscReal density, PetscReal *speed);
/* Cells that the boundary layer of a body that falls needs, alone or with others */
PetscReal PromiseFallLayer(PetscInt preset, PetscBool several);
/* Thickness in cells about the centre of the smallest body of a group; 0: the centre is not inside. Collective. */
PetscErrorCode PromiseMeasureThickness(const MeshLocal *, Bodies, PetscInt group, PetscReal *cells);
/* Size of the first body of a group, and how fast it would fall by the options, which stay unread; speed 0: it does
   not, or nothing is known. Collective. */
PetscErrorCode PromiseEstimateFall(PetscInt dim, Bodies, PetscInt group, PetscReal *size, PetscReal *speed);
/* A preset that was asked for, with -couple_method as it is now: refusal [len] says why it is known not to keep its
   promise here, and what is offered in its place keeps its own; "" if nothing is known. Collective. */
PetscErrorCode PromiseRefuse(const MeshLocal *, Bodies, PetscInt preset, const PromiseScene *, char refusal[],
                             size_t len);
/* None was asked for: a remark where the default one, balanced, is known not to keep its promise, with
   -couple_method as it is. Collective. */
PetscErrorCode PromiseRemark(const MeshLocal *, Bodies, const PromiseScene *);
