/* Accuracy: how far the force of a run is from that on an endless mesh, and whether its preset keeps what it promises.

   Steady. On the mesh of the run, lined up with bodies or without any: what elements of the next order, Q3 with P2,
   find beside the solution, in sweeps over cells with problems of their own, each followed by one linear solve with the
   last Jacobian (SteadyFiner). The error is 1.3 times what the values change by. Bodies with corners, where that tells
   half of the error: the energy of what is found is added, and it is a bound. Bodies that are drawn (nodal, penalty)
   have errors of no order: the scene is solved on the same mesh lined up with them, and what is estimated is the
   difference to that and the error of that.

   Where that does not do - a stress that is not Newtonian, forces of scalars, bodies so thin that no mesh follows them,
   cells so large for the flow that sweeps go astray - the scene is solved twice more, on meshes two thirds and half as
   fine (-mesh_cells, -mesh_resolution or -dm_refine). Of the difference D to the first |D| / (r^p - 1) is left, r the
   ratio of the cells (Richardson 1911; Roache 1994), with the order p that the two differences show, 2.5 to 3.5, with
   corners from 1.1 on; where they have other signs, or do not grow, the least order, and what is found is a bound
   (extrapolate.h). Not so for mesh files without -dm_refine and meshes that are refined by the flow. What is judged:
   subject.h. Not for bodies whose velocity is sought and meshes that are deformed.

   In time. The scene is run twice more on a mesh half as fine, with the same steps and with steps twice as long; the
   difference of the run to the first tells the error of space, that of these two the error of time, by the orders above
   (drawn: 1.25) and that of the scheme. Judged is what is gauged (gauge.h). Costs about half of the run, in space a
   quarter.

   runs/studies/accuracy has true errors and estimates. What such a mesh refuses, all ranks hear (base/agree.h). */
#pragma once
#include "sim.h"

/* Reads -monitor_accuracy; a steady run with -preset wants it unless that says no. Collective. */
PetscErrorCode AccuracyIsWanted(PetscBool steady, PetscBool *wanted);
/* After the run: writes estimated_error_<what> into the summary, and a remark where the preset that was asked for
   promises less. make: builds and solves the scene of the present options, destroy: takes it away; both collective.
   Nothing happens unless -preset or -monitor_accuracy asks for it, or if there is no such mesh. Collective. */
PetscErrorCode AccuracyEstimate(const SimComponents *);
/* In time: does a run gauge what it tells of itself, for AccuracyEstimateInTime? trial: one of its own runs.
   Collective. */
PetscErrorCode AccuracyIsGauged(const SimComponents *, PetscBool trial, PetscBool *gauged);
/* As AccuracyEstimate; also estimated_error_<what>_space and _time. Collective. */
PetscErrorCode AccuracyEstimateInTime(const SimComponents *);
