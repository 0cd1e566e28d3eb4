/* Accuracy: how far the force of a steady run is from that on an endless mesh, and whether its preset keeps what it
   promises.

   At the end the scene is solved once more on a mesh half as fine (-mesh_cells, -mesh_resolution or -dm_refine), and on
   one half as fine as that, with the same methods. Of the difference D of the first two |D| / (2^p - 1) is left
   (Richardson 1911; Roache 1994), on aligned meshes and without bodies with the order p that the three show, 2.5 to
   3.5, else (nodal, penalty, whose errors go by no order) 1.25; runs/studies/accuracy has true errors and estimates.
   Where -flow_force drives the fluid, and so gives all forces, the mean velocity is judged, without forces the kinetic
   energy. Costs about a tenth of the run, less in space. Not for bodies whose velocity is sought, mesh files without
   -dm_refine, meshes that are deformed or refined by the flow. What such a mesh refuses, all ranks hear
   (base/agree.h). */
#pragma once
#include "sim.h"

/* Reads -monitor_accuracy, given or not with -preset; of a steady run. Collective. */
PetscErrorCode AccuracyIsWanted(PetscBool *wanted);
/* After the run: writes estimated_error_<what> into the summary, and a remark where the preset that was asked for
   promises less. make: builds and solves the scene of the present options, destroy: takes it away; both collective.
   Nothing happens unless -preset or -monitor_accuracy asks for it, or if there is no such mesh. Collective. */
PetscErrorCode AccuracyEstimate(const SimParts *);
