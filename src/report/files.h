/* Files of the output directory: rank 0 writes, and all ranks learn what became of it. */
#pragma once
#include "base/hdf5.h"
#include <stdio.h>

/* Rank 0: remove what a run has left in dir of steps after this one, tables and snapshots of their own files,
   <kind>_<step>.h5, .csv or .xdmf (not checkpoints). Returns how many. */
PetscInt FilesRemoveAfter(const char dir[], PetscInt step);

/* Rank 0: a file that appears under its name when it is complete, so that a reader never meets half of it: written as
   path.part, renamed at its end. 0 or errno; *f is NULL after FileEnd. */
int FileBegin(const char path[], FILE **f);
int FileEnd(const char path[], FILE **f);
/* Close a file of any kind, NULL is fine: 0 or errno of what went wrong since it was opened. */
int FileClose(FILE **f);

/* Rank 0 knows err (0 or errno): all ranks raise the same error, which says what to do. Collective on
   it. */
PetscErrorCode FileCheck(MPI_Comm, int err, const char path[]);
/* Close an HDF5 file that was written: the same error where it failed. Collective on its communicator. */
PetscErrorCode FileCloseHdf5(MPI_Comm, const char path[], Hdf5 *);

/* XDMF, the text beside HDF5 files that tells ParaView, pyvista and meshio what is in them: dir/kind.xdmf, a
   collection over time (its name; NULL: one grid) between XdmfBegin and XdmfEnd (rank 0; 0 or errno). The ending was
   .xmf, which pyvista refuses: a file of that name counts in XdmfExists; XdmfEnd and XdmfRemove take it away. Item:
   dataset `name` [n][bs] of an HDF5 file; Attribute: the same as values at "Node" or "Cell". */
#define XDMF_ENDING ".xdmf"
int  XdmfExists(const char dir[], const char kind[]);
void XdmfRemove(const char dir[], const char kind[]);
int  XdmfBegin(const char path[], const char collection[], FILE **f);
int  XdmfEnd(const char path[], const char collection[], FILE **f);
void XdmfItem(FILE *f, PetscBool integer, PetscInt n, PetscInt bs, const char file[], const char name[]);
void XdmfAttribute(FILE *f, PetscBool integer, PetscInt n, PetscInt bs, const char centre[], const char name[],
                   const char file[], const char item[]);
