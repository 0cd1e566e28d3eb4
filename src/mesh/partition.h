/* Partition: which rank gets which cell.

   Adds "metis" to PETSc's mesh partitioners (PETSc itself reaches METIS only through ParMETIS, which Debian does not
   build): -petscpartitioner_type metis | ptscotch | simple | ... ; metis is the default of this program.
   The dual graph of the mesh (cells that share a face) is gathered on rank 0 and cut there by serial METIS, k-way,
   every cell with weight one. Good to some ten million cells; beyond that take a parallel partitioner. */
#pragma once
#include <petscdmplex.h>

/* Set the partitioner of a DMPlex from -petscpartitioner_type (with the options prefix of the dm; default metis), and
   for metis compute the partition. Call when the cells exist, last thing before DMSetFromOptions or DMPlexDistribute;
   the cells must not change in between (-dm_refine is applied after distribution and is fine, -dm_refine_pre is not).
   Collective. Errors: unknown type (lists the known ones), mesh without cells, fewer cells than ranks, ranks left
   without cells. */
PetscErrorCode PartitionPrepare(DM dm);

/* After distribution, for every partitioner: error that names the number of cells and the options to change if a rank
   has no cells. Collective. */
PetscErrorCode PartitionCheck(DM dm);
