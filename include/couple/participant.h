/* CoupleParticipant: whoever takes part in a step of flow and bodies, as a table of operations. The rigid bodies with
   their boundary method are participants, and so is everything else of src/couple that a step asks
   (src/couple/participants.c lists them in the order of their calls). A further one is a file with its table, and a
   line there or a CoupleAddParticipant.

   Operations that are NULL cost nothing; all are collective and are called in the order of the list. `data` is what
   CoupleAddParticipant was given. Who wants what, and what elastic solids, drops and scalars will need:
   src/couple/README.md, "How to add a participant". */
#pragma once
#include "base/state.h"
#include "couple/couple.h"

typedef struct {
  const char *name;
  /* CoupleUpdateGeometry, after FlowBeginStep. begin: what the step prescribes, and surfaces where they are predicted
     to be. prepare: what depends on all surfaces: the mesh, nodes and cells of bodies, properties of cells. rows: the
     participant's own equations, when the geometry stands. */
  PetscErrorCode (*begin)(Couple, void *data);
  PetscErrorCode (*prepare)(Couple, void *data);
  PetscErrorCode (*rows)(Couple, void *data);
  /* Before the flow assembles, perhaps several times a step (nonlinear solvers): terms of the matrix, and forces
     (FlowAddForce), for the present velocities. */
  PetscErrorCode (*assemble)(Couple, void *data);
  /* Once a solve, before it begins: into the right-hand sides and the start values (CoupleGetSystem) */
  PetscErrorCode (*start)(Couple, void *data);
  /* The system is solved, nothing is accepted: takes its part of the solution. */
  PetscErrorCode (*solved)(Couple, void *data);
  /* CoupleForce: forces of the flow on what the participant owns */
  PetscErrorCode (*force)(Couple, void *data);
  PetscBool others; /* its force is in CoupleBalance.others: columns momentum_others_<x|y|z> of -monitor_momentum */
  /* CoupleMomentum: adds its force on the fluid to one of the sums of the balance (others, if it has none of its
     own), takes it from `rest`, and adds its size to `size`. Values of all ranks, at all nodes: whoever prescribes the
     velocity of a node gives back what FlowAddForce and FlowAddCellTerms have there (FlowGetGiven). What an operator
     (FlowAddOperator) exerts on such nodes does not reach the fluid and does not count. */
  PetscErrorCode (*balance)(Couple, void *data, const FlowDiagnostics *, CoupleBalance *);
  /* CoupleGetPower: adds energies and powers of all ranks. */
  PetscErrorCode (*energy)(Couple, void *data, CouplePower *);
  /* CoupleGetLosses: its part of them, of all ranks; what others have counted with the flow's own viscosity, or as
     terms of cells, it puts right. */
  PetscErrorCode (*losses)(Couple, void *data, CoupleLosses *);
  /* CoupleLimitStep, before a step: *dt becomes no larger than the participant stands (the same on all ranks). */
  PetscErrorCode (*limit)(Couple, void *data, PetscReal *dt);
  /* CoupleOverstep: of the step solved, *ratio becomes no smaller than its length over what the participant stands with
     the velocities that it brought. */
  PetscErrorCode (*overstep)(Couple, void *data, PetscReal *ratio);
  /* CoupleAdvance: the step is taken; the flow accepts its fields after this. */
  PetscErrorCode (*advance)(Couple, void *data);
  /* The mesh has another form as a whole, its cells are the same. */
  PetscErrorCode (*mesh_updated)(Couple, void *data);
  /* There is a new solver: what it has to know. Before after_remesh. */
  PetscErrorCode (*connect)(Couple, void *data, FlowSolver);
  /* Cells are rebuilt. before_remesh: the old mesh is still there, keep what is to be carried over (not called where
     fields are about to be loaded). discard: free what depends on the old mesh. after_remesh: there is a new mesh
     (CoupleAddParticipant: the first one, old NULL), make what depends on it and put on it what was kept; *old may be
     taken over, then it is NULL. */
  PetscErrorCode (*before_remesh)(Couple, void *data);
  PetscErrorCode (*discard)(Couple, void *data);
  PetscErrorCode (*after_remesh)(Couple, void *data, Mesh *old);
  /* Checkpoints: names are unique among all participants. Whoever moves nodes when loading says CoupleNeedsSolver. */
  PetscErrorCode (*visit)(Couple, void *data, State);
  PetscErrorCode (*view)(Couple, void *data, PetscViewer);
  PetscErrorCode (*destroy)(Couple, void *data);
} CoupleParticipant;

/* Takes part from now on, after all others; the table is borrowed, `data` is given to destroy at the end. Calls its
   connect and its after_remesh. Collective. */
PetscErrorCode CoupleAddParticipant(Couple, const CoupleParticipant *, void *data);
/* The solver depends on what a participant has just loaded: it is rebuilt when all have. Not collective, the same
   on all ranks. */
PetscErrorCode CoupleNeedsSolver(Couple);
