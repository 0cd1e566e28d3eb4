/* Hdf5: arrays that are spread over the ranks as datasets of one HDF5 file, which all ranks write or read together,
   each its own rows, without MPI-IO: a disk that is full for one rank holds up no other. All ranks must see the file
   (a shared file system with POSIX calls).

   While writing, HDF5's errors are remembered and told by Hdf5Close; while reading, each function says whether it went
   well, the same on all ranks. Between opening and closing HDF5 itself prints nothing. Used directly, because PETSc's
   viewer neither tells why a file is refused nor keeps checksums with an array. */
#pragma once
#include <petscsys.h>

typedef struct _p_Hdf5 *Hdf5;

/* A value in memory; in the file little-endian, of the same size */
typedef enum {
  HDF5_REAL, /* PetscReal */
  HDF5_INT,  /* PetscInt */
  HDF5_INT64,
  HDF5_UINT64,
  HDF5_BYTE
} Hdf5Type;

/* This rank's rows of an array: how many, on the ranks before it, on all */
typedef struct {
  PetscInt n, start, total;
} Hdf5Rows;

/* Rows of arrays that hold the n rows of every rank, one rank after the other. Collective. */
PetscErrorCode Hdf5SpreadRows(MPI_Comm, PetscInt n, Hdf5Rows *);

/* Create (or replace) the file, or open it to read: *good, is it open? If not, it can only be closed. Collective. */
PetscErrorCode Hdf5Create(MPI_Comm, const char path[], Hdf5 *);
PetscErrorCode Hdf5Open(MPI_Comm, const char path[], Hdf5 *, PetscBool *good);
/* Close, on disk if written. reason (NULL if read): "" if everything has been written, or what was not, as in "HDF5
   fails at /velocity (No space left on device)". Collective, the same on all ranks. */
PetscErrorCode Hdf5Close(Hdf5 *, char reason[], size_t len);

/* v [rows.n][bs] <-> dataset [rows.total][bs]; bs 0: v [rows.n] <-> dataset [rows.total]. Names may lead through
   groups, which are made. Rows that several ranks read may overlap. Collective. */
PetscErrorCode Hdf5Write(Hdf5, const char name[], Hdf5Type, Hdf5Rows rows, PetscInt bs, const void *v);
PetscErrorCode Hdf5Read(Hdf5, const char name[], Hdf5Type, Hdf5Rows rows, PetscInt bs, void *v, PetscBool *good);
/* The same for v [n][bs] of every rank, one after the other. Reals with bs 1 make a dataset of one dimension.
   Collective; n may be 0 on some ranks. */
PetscErrorCode Hdf5WriteReals(Hdf5, const char name[], PetscInt n, PetscInt bs, const PetscReal v[]);
PetscErrorCode Hdf5WriteInts(Hdf5, const char name[], PetscInt n, PetscInt bs, const PetscInt v[]);
/* Rows and columns of a dataset, 0 columns where it has one dimension; -1: there is none of one or two. Collective. */
PetscErrorCode Hdf5GetSize(Hdf5, const char name[], PetscInt *rows, PetscInt *bs);

/* Attribute of a dataset, or of the file ("/"): one value, or a text of n bytes with its zero (HDF5_BYTE), the same
   on all ranks. Collective. */
PetscErrorCode Hdf5WriteAttribute(Hdf5, const char object[], const char name[], Hdf5Type, PetscInt n, const void *v);
PetscErrorCode Hdf5ReadAttribute(Hdf5, const char object[], const char name[], Hdf5Type, PetscInt n, void *v,
                                 PetscBool *good);

/* NULL, or why the file at path cannot be a whole HDF5 file, from its first bytes and its length. Not collective;
   `reason` has room for len characters. */
const char *Hdf5CheckFile(const char path[], char reason[], size_t len);
