/* ScalarLayers: is the layer of a scalar around bodies that move against the fluid as thick as presets need it
   (scalar/layer.h)? And, where bodies move through cells (penalty, nodal): is their way of a step short beside the
   length D/U that conduction reaches ahead of them?

   Before a run by what is known: the stream that bodies are held in (stream.h), how fast they would fall, their
   velocity at the start. During it by the fastest fluid near each body, every few steps, since what settles, swims or
   is carried is known then alone. A preset that was asked for is refused before, with the remedy; otherwise remarks,
   for the 1 % of the default where none was asked for. Fewest cells: quantity scalar_layer_cells_<scalar>_<group>. */
#pragma once
#include "promise.h"
#include "sim.h"

/* Boundary methods, what cells in a layer are asked for by */
enum {
  SCALAR_LAYER_PENALTY,
  SCALAR_LAYER_ALIGNED,
  SCALAR_LAYER_NODAL,
  SCALAR_LAYER_NMETHODS
};
/* By the options. Local. */
PetscErrorCode ScalarLayersFindMethod(PetscInt *method);

/* Before there is a flow: refusal [len], unless that says something, or a remark (asked: the preset was asked for).
   Collective. */
PetscErrorCode ScalarLayersCheck(const MeshLocal *, Bodies, PetscInt preset, PetscBool asked, const PromiseScene *,
                                 char refusal[], size_t len);
/* NULL without bodies or scalars. Collective. */
PetscErrorCode ScalarLayersCreate(const SimComponents *, ScalarLayers *);
PetscErrorCode ScalarLayersDestroy(ScalarLayers *);
/* The step of that number was taken. Collective; NULL: nothing. */
PetscErrorCode ScalarLayersStep(ScalarLayers, PetscInt step, PetscReal time);
/* Quantities of the summary; NULL: nothing. */
PetscErrorCode ScalarLayersFinish(ScalarLayers);
