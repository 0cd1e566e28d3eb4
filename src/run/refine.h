/* Refine: the particles of a scene, rigid and elastic bodies and drops, as what a mesh refines around (-mesh_levels,
   MeshSurface), and meshes that follow them.

   With -mesh_track cells are made anew, at the beginning of a step, as soon as a point of a body could in it be more
   than half of -mesh_track_distance finest cells from where the present mesh has the bodies. A new mesh has them that
   half ahead, as far as they go in ten steps, so that they come through its middle; all bands are wider by it, and the
   surface keeps its clearance from jumps of levels. Velocities of both times are carried over, nothing is projected,
   and the scheme goes on: with a step of first order after each change the force is four times as rough. */
#pragma once
#include "adapt.h"
#include "bodies/bodies.h"
#include "couple/couple.h"
#include "steplimits.h"
#include "mesh/mesh.h"
#include "report/checkpoint.h"
#include "report/monitor.h"
#include "solid/solid.h"

typedef struct _p_Refine *Refine;

/* Bodies first, spread over the ranks but not yet by the mesh, then the mesh, around them, solids and drops (borrowed,
   NULL: none), or in boxes alone (MeshReadLevels). Bodies that stand still, and solids that are held, are fine at their
   surface, others also inside. Collective. Errors: those of both; a body that moves away from its fine cells;
   -mesh_track in a steady scene, where none moves. */
PetscErrorCode RefineCreateMesh(MPI_Comm, PetscBool with_bodies, PetscBool steady, Solids, Drops, Bodies *, Mesh *,
                                Refine *);
/* -mesh_adapt: is it refined by the flow (meshadapt.h)? Collective. */
PetscErrorCode RefineIsByFlow(PetscBool *wanted);
PetscErrorCode RefineDestroy(Refine *); /* before its bodies */
/* In all that follows NULL, and a mesh that does not follow where that is asked for, does nothing. */

/* The bodies from now on, where they start; their parts are to be those of every mesh that follows, `reach` as for
   MeshCover. Collective. */
PetscErrorCode RefineSetBodies(Refine, Bodies, PetscInt reach);
/* What stands on the mesh and is made anew with it (any may be NULL), and the state of a checkpoint, after that of the
   bodies and before those above: its tree, which the mesh has again before anything is loaded, and where the mesh has
   the bodies. Borrowed. Not collective. */
PetscErrorCode RefineConnect(Refine, Flow, Couple, Adapt, Limits, Checkpoint, Monitor);
/* One more that stands on it: renew(client, old) after the flow knows the new mesh. Borrowed. Not collective. */
PetscErrorCode RefineSetClient(Refine, PetscErrorCode (*renew)(void *client, Mesh old), void *client);
/* After all is loaded: cells that the options want otherwise are made anew, and the fields carried over. Collective. */
PetscErrorCode RefineMatch(Refine);
/* For meshes refined by the flow (meshadapt.h). What the mesh was made around at first; not collective. Another mesh in
   its place, with what stands on it; takes it over; collective. */
PetscErrorCode RefineGetSurface(Refine, MeshSurface *);
PetscErrorCode RefineReplace(Refine, Mesh now);
/* Before a step of length dt: where cells are to be made anew, mesh and what stands on it are. Collective. */
PetscErrorCode RefineTrack(Refine, PetscReal dt);
/* Quantity of the run: how often */
PetscErrorCode RefineReport(Refine);
