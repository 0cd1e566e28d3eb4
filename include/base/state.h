/* State: what a module must remember to go on later.

   A module has one function that visits its state, for saving and for loading alike, so that the two cannot differ:

     PetscErrorCode FlowVisitState(void *flow, State s)
     {
       PetscCall(StateNodes(s, "velocity", dim, f->u));
       PetscCall(StateReals(s, "dt_old", 1, &f->dt_old));
       ...

   Names are unique within the module. What can be computed from other state is not visited; arrays whose length is
   itself state are allocated when StateIsLoading. Modules below the time loop hand their function to checkpoint.h; a
   part of a module is visited by the function of its owner.

   The file is HDF5, written by all ranks together, independent of their number: nodes and cells are found again by
   their position in space, as it was when the State was created (a mesh that moves later keeps these keys). Every array
   carries a checksum. Reals are 64-bit, integers are stored with 64 bits. What a mesh is, a State does not know:
   MeshCreateState (mesh/state.h) gives it the keys. */
#pragma once
#include <petscsys.h>

typedef struct _p_State *State;
typedef PetscErrorCode (*StateVisit)(void *module, State);

enum {
  STATE_NODE,
  STATE_CELL
};

/* What nodes and cells are told apart by */
typedef struct {
  PetscInt dim;
  /* own on this rank, on the ranks before it, on all */
  PetscInt   n[2], start[2], total[2];
  PetscReal *x[2]; /* [n][dim] positions of the own ones */
  /* distance within which a position is found again, m */
  PetscReal tolerance;
  PetscErrorCode (*sync)(void *context, PetscInt bs, PetscReal v[]); /* own nodal values -> ghosts, v [nnode_all][bs] */
  void *sync_context;
} StateKeys;

/* The arrays x of the keys belong to the State from now on (PetscMalloc). Collective. */
PetscErrorCode StateCreate(MPI_Comm, const StateKeys *, State *);
PetscErrorCode StateDestroy(State *);

/* Begin saving into path, or loading from it. Collective. Errors of loading: no file, not HDF5, truncated, not a
   checkpoint, another format, another mesh. */
PetscErrorCode StateBeginSave(State, const char path[]);
PetscErrorCode StateBeginLoad(State, const char path[]);
/* Look into a file whose mesh may be any: what is the same on all ranks can be visited (an array of nodes or cells with
   one value each by StateReals: all of it on every rank). Collective. Errors: those of StateBeginLoad but another
   mesh. */
PetscErrorCode StateBeginLook(State, const char path[]);
/* End either. Saving: the file appears under its name when it is complete and on disk (written as path.part,
   synchronised, renamed). Collective.
   Errors: the file could not be written (disk full). */
PetscErrorCode StateEnd(State);

/* The following visits are for all modules alike under the module's name; NULL: end of the module. Not nested. */
PetscErrorCode StateModule(State, const char name[]);
PetscBool      StateIsLoading(State);
/* Loading: was the file written on the same number of ranks with the same distribution of the mesh? */
PetscBool StateIsSamePartition(State);
/* Loading: rows of an array of the present module in the file, -1 if it has none of this name. Collective. */
PetscErrorCode StateGetSize(State, const char name[], PetscInt *rows);

/* Is there an array of this name? Saving: yes. For what a run with other options begins with. Collective. */
PetscErrorCode StateHas(State, const char name[], PetscBool *has);

/* v is saved or loaded. Collective, same calls on all ranks. Errors of loading: not in the file, other length, wrong
   checksum.
   Reals, Ints, Text: the same on all ranks, n values, in the file those of rank 0. Text: zero-terminated; loading
   allocates *text, free it with PetscFree.
   Rows: n values of 64 bits of each rank, reals or PetscInt64, one rank after the other; loading: as many altogether.
   Nodes: v [nnode_all][bs], own values saved, ghosts synchronised after loading. Cells: v [ncell][bs], own cells. */
PetscErrorCode StateReals(State, const char name[], PetscInt n, PetscReal v[]);
PetscErrorCode StateInts(State, const char name[], PetscInt n, PetscInt v[]);
PetscErrorCode StateRows(State, const char name[], PetscBool integers, PetscInt n, void *v);
PetscErrorCode StateText(State, const char name[], char **text);
PetscErrorCode StateNodes(State, const char name[], PetscInt bs, PetscReal v[]);
PetscErrorCode StateCells(State, const char name[], PetscInt bs, PetscReal v[]);
