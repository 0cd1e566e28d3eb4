/* MeshUpdate: the one transaction by which a mesh changes under a flow and its solver, for those who move nodes (ale.h,
   aligned.h).

   Begin names the cells that will change, while they still have their old shape: the solver takes their parts out.
   The client reads what he needs at the old places. Commit moves nodes, stores what was carried over to them, and
   tells the flow, the solver and the boundary method. The pressure of a cell stays the same polynomial in space.
   Pattern, numbering and symmetry are as on a fixed mesh.
   Cells that left the fluid stay out of it until a commit brings others: a client that knows of none leaves those of
   another alone. */
#pragma once
#include "flow/flow.h"
#include "solve/system.h"

typedef struct _p_MeshUpdate *MeshUpdate;

/* What a commit brings. Arrays are borrowed: cell_surface, resolved until the next commit with any, others
   for the call. */
typedef struct {
  PetscInt         nnode; /* local nodes (own and ghost) that get new places; 0: the client has moved them himself */
  const PetscInt  *node;
  const PetscReal *x;            /* [nnode][dim] */
  PetscBool        whole;        /* the mesh has another form as a whole (MeshRebase), and velocities stay with their
                                nodes */
  const PetscInt  *cell_surface; /* [ncell_all] body that a cell is inside of, and no part of the fluid, -1: fluid;
                                    NULL: as before */
  const PetscBool *resolved;     /* [nbodies] bodies whose surface the mesh follows; goes with cell_surface */
  PetscInt         ncarried;     /* own nodes that get other old velocities */
  const PetscInt  *carried;
  const PetscReal *value;  /* [ncarried][nfield][dim] u^n, u^(n-1) there, and of a viscoelastic fluid (nfield 4, else 2)
                             the logarithm of the conformation, first and second half */
  PetscInt         nalong; /* own nodes, carried, that are now where another point of a surface comes to */
  const PetscInt  *along;
  const PetscReal *kept; /* [nalong][2][dim] logarithm of the conformation of that point */
} MeshUpdateMesh;

/* told: after a change of the whole mesh, may be NULL. Collective. */
PetscErrorCode MeshUpdateCreate(Flow, PetscErrorCode (*told)(void *), void *ctx, MeshUpdate *);
PetscErrorCode MeshUpdateDestroy(MeshUpdate *);
/* From now on this solver, which learns what cells are no part of the fluid. Borrowed. Collective. */
PetscErrorCode MeshUpdateSetSolver(MeshUpdate, FlowSolver);

/* Body that each local cell is inside of, -1: fluid; NULL: there is none. Borrowed. */
const PetscInt *MeshUpdateGetInactive(MeshUpdate);

/* The n local cells (own and ghost) will change, between FlowBeginStep and FlowAssemble. *any (may be NULL): is
   there one on any rank? Collective. */
PetscErrorCode MeshUpdateBegin(MeshUpdate, PetscInt n, const PetscInt cell[], PetscBool *any);
/* Where no cell of any rank changes, only the inactive cells are remembered. Collective. Error: FlowUpdateCells'. */
PetscErrorCode MeshUpdateCommit(MeshUpdate, const MeshUpdateMesh *);
/* k stands for other bodies than before, and no cell changes: the solver learns again which of them are resolved.
   Collective. */
PetscErrorCode MeshUpdateBodies(MeshUpdate);
/* Begin and commit for fields that already belong to the mesh as it will be, as those of a checkpoint do. The solver
   is not told: it must be made anew and set. Collective. */
PetscErrorCode MeshUpdateRestore(MeshUpdate, PetscInt n, const PetscInt cell[], const MeshUpdateMesh *);
