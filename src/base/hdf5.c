/* Hdf5: see hdf5.h. */
#include "compat.h"
#include "base/hdf5.h"
#include <errno.h>
#include <hdf5.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#if !defined(H5_HAVE_PARALLEL)
  #error "tumble needs an HDF5 that is built for MPI"
#endif

struct _p_Hdf5 {
  MPI_Comm    comm;
  hid_t       file, together; /* transfer property: all ranks take part */
  PetscBool   writing;
  char        failed[256]; /* writing: what failed first on this rank */
  H5E_auto2_t printer;     /* of HDF5's own stack of errors, off while the file is open */
  void       *printer_data;
};

static hid_t memory_type(Hdf5Type t)
{
  switch (t) {
  case HDF5_REAL: return sizeof(PetscReal) == 8 ? H5T_NATIVE_DOUBLE : H5T_NATIVE_FLOAT;
  case HDF5_INT: return sizeof(PetscInt) == 8 ? H5T_NATIVE_INT64 : H5T_NATIVE_INT32;
  case HDF5_INT64: return H5T_NATIVE_INT64;
  case HDF5_UINT64: return H5T_NATIVE_UINT64;
  default: return H5T_NATIVE_UCHAR;
  }
}

static hid_t file_type(Hdf5Type t)
{
  switch (t) {
  case HDF5_REAL: return sizeof(PetscReal) == 8 ? H5T_IEEE_F64LE : H5T_IEEE_F32LE;
  case HDF5_INT: return sizeof(PetscInt) == 8 ? H5T_STD_I64LE : H5T_STD_I32LE;
  case HDF5_INT64: return H5T_STD_I64LE;
  case HDF5_UINT64: return H5T_STD_U64LE;
  default: return H5T_STD_U8LE;
  }
}

static void note_failure(Hdf5 h, const char what[])
{
  if (!h->failed[0]) (void)snprintf(h->failed, sizeof(h->failed), "%s", what);
}

/* Does it hold on every rank? */
static PetscErrorCode agree(Hdf5 h, PetscBool *good)
{
  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, good, 1, COMPAT_MPI_BOOL, MPI_LAND, h->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- files ---- */

static PetscErrorCode open_file(MPI_Comm comm, const char path[], PetscBool writing, Hdf5 *file)
{
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  Hdf5        h;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&h));
  h->comm    = comm;
  h->writing = writing;
  H5Eget_auto2(H5E_DEFAULT, &h->printer, &h->printer_data);
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
  H5Pset_fapl_mpio(access, comm, MPI_INFO_NULL);
  h->file = writing ? H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, access) : H5Fopen(path, H5F_ACC_RDONLY, access);
  H5Pclose(access);
  h->together = H5Pcreate(H5P_DATASET_XFER);
  H5Pset_dxpl_mpio(h->together, H5FD_MPIO_COLLECTIVE);
  if (h->file < 0) note_failure(h, "the file");
  *file = h;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode Hdf5Create(MPI_Comm comm, const char path[], Hdf5 *file)
{
  PetscFunctionBeginUser;
  PetscCall(open_file(comm, path, PETSC_TRUE, file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode Hdf5Open(MPI_Comm comm, const char path[], Hdf5 *file, PetscBool *good)
{
  PetscFunctionBeginUser;
  PetscCall(open_file(comm, path, PETSC_FALSE, file));
  *good = (PetscBool)((*file)->file >= 0);
  PetscCall(agree(*file, good));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode Hdf5Close(Hdf5 *file, char reason[], size_t len)
{
  Hdf5      h = *file;
  PetscBool good;

  PetscFunctionBeginUser;
  if (h->file >= 0 && h->writing && H5Fflush(h->file, H5F_SCOPE_GLOBAL) < 0) note_failure(h, "the file");
  if (h->file >= 0 && H5Fclose(h->file) < 0) note_failure(h, "the file");
  H5Pclose(h->together);
  H5Eset_auto2(H5E_DEFAULT, h->printer, h->printer_data);
  good = (PetscBool)!h->failed[0];
  PetscCall(agree(h, &good));
  if (reason) (void)snprintf(reason, len, "%s%s%s", good ? "" : "HDF5 fails ", good ? "" : h->failed[0] ? "at " : "on another rank", h->failed);
  PetscCall(PetscFree(*file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static uint64_t little_endian(const unsigned char b[])
{
  uint64_t v = 0;

  for (int i = 7; i >= 0; i--) v = v << 8 | b[i];
  return v;
}

const char *Hdf5CheckFile(const char path[], char reason[], size_t len)
{
  static const unsigned char signature[8] = {0x89, 'H', 'D', 'F', '\r', '\n', 0x1a, '\n'};
  unsigned char              head[64]     = {0};
  FILE                      *f            = fopen(path, "rb");
  size_t                     n;
  struct stat                st;
  uint64_t                   end;

  if (!f) {
    (void)snprintf(reason, len, "%s", strerror(errno));
    return reason;
  }
  n = fread(head, 1, sizeof(head), f);
  if (fstat(fileno(f), &st)) memset(&st, 0, sizeof(st));
  (void)fclose(f);
  if (S_ISDIR(st.st_mode)) {
    (void)snprintf(reason, len,
                   "it is a folder, and a file is needed (for a checkpoint: one in it, or -sim_restart latest with -output_dir at the folder)");
    return reason;
  }
  if (n < 8 || memcmp(head, signature, 8)) {
    (void)snprintf(reason, len, n == 0 ? "the file is empty" : "it is no HDF5 file");
    return reason;
  }
  end = little_endian(head + (head[8] == 0   ? 40
                              : head[8] == 1 ? 44
                                             : 28)); /* end of file as the superblock of this version has it, with
                                                        offsets of 8 bytes */
  if (n < sizeof(head) || (uint64_t)st.st_size < end) {
    (void)snprintf(reason, len, "it is truncated: %lld bytes of %llu", (long long)st.st_size, (unsigned long long)end);
    return reason;
  }
  return NULL;
}

/* ---- datasets ---- */

PetscErrorCode Hdf5SpreadRows(MPI_Comm comm, PetscInt n, Hdf5Rows *rows)
{
  PetscFunctionBeginUser;
  *rows = (Hdf5Rows){n, 0, 0};
  PetscCallMPI(MPI_Scan(&n, &rows->start, 1, MPIU_INT, MPI_SUM, comm));
  rows->start -= n;
  PetscCallMPI(MPI_Allreduce(&n, &rows->total, 1, MPIU_INT, MPI_SUM, comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Select this rank's rows of an array in the file, and the same number in memory */
static void select_rows(Hdf5Rows rows, PetscInt bs, hid_t *in_file, hid_t *in_memory)
{
  const hsize_t total[2] = {(hsize_t)rows.total, (hsize_t)bs}, n[2] = {(hsize_t)rows.n, (hsize_t)bs}, start[2] = {(hsize_t)rows.start, 0};
  const int     ndim = bs ? 2 : 1;

  *in_file   = H5Screate_simple(ndim, total, NULL);
  *in_memory = H5Screate_simple(ndim, n, NULL);
  if (rows.n > 0) H5Sselect_hyperslab(*in_file, H5S_SELECT_SET, start, NULL, n, NULL);
  else {
    H5Sselect_none(*in_file);
    H5Sselect_none(*in_memory);
  }
}

PetscErrorCode Hdf5Write(Hdf5 h, const char name[], Hdf5Type t, Hdf5Rows rows, PetscInt bs, const void *v)
{
  const hid_t make_groups = H5Pcreate(H5P_LINK_CREATE);
  hid_t       in_file, in_memory, set;

  PetscFunctionBeginUser;
  select_rows(rows, bs, &in_file, &in_memory);
  H5Pset_create_intermediate_group(make_groups, 1);
  set = H5Dcreate2(h->file, name, file_type(t), in_file, make_groups, H5P_DEFAULT, H5P_DEFAULT);
  if (set < 0 || (rows.total > 0 && H5Dwrite(set, memory_type(t), in_memory, in_file, h->together, v) < 0)) note_failure(h, name);
  if (set >= 0) H5Dclose(set);
  H5Pclose(make_groups);
  H5Sclose(in_file);
  H5Sclose(in_memory);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode Hdf5Read(Hdf5 h, const char name[], Hdf5Type t, Hdf5Rows rows, PetscInt bs, void *v, PetscBool *good)
{
  const hid_t set = H5Dopen2(h->file, name, H5P_DEFAULT);
  hid_t       in_file, in_memory;

  PetscFunctionBeginUser;
  select_rows(rows, bs, &in_file, &in_memory);
  *good = (PetscBool)(set >= 0 && (rows.total == 0 || H5Dread(set, memory_type(t), in_memory, in_file, h->together, v) >= 0));
  if (set >= 0) H5Dclose(set);
  H5Sclose(in_file);
  H5Sclose(in_memory);
  PetscCall(agree(h, good));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode Hdf5WriteReals(Hdf5 h, const char name[], PetscInt n, PetscInt bs, const PetscReal v[])
{
  Hdf5Rows rows;

  PetscFunctionBeginUser;
  PetscCall(Hdf5SpreadRows(h->comm, n, &rows));
  PetscCall(Hdf5Write(h, name, HDF5_REAL, rows, bs > 1 ? bs : 0, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode Hdf5WriteInts(Hdf5 h, const char name[], PetscInt n, PetscInt bs, const PetscInt v[])
{
  Hdf5Rows rows;

  PetscFunctionBeginUser;
  PetscCall(Hdf5SpreadRows(h->comm, n, &rows));
  PetscCall(Hdf5Write(h, name, HDF5_INT, rows, bs, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is the name there, and are the groups that lead to it? */
static PetscErrorCode find_name(Hdf5 h, const char name[], PetscBool *found)
{
  char part[256];

  PetscFunctionBeginUser;
  *found = PETSC_TRUE;
  PetscCall(PetscStrncpy(part, name, sizeof(part)));
  for (char *c = part + 1; *found && *c; c++) {
    if (*c != '/') continue;
    *c     = 0;
    *found = (PetscBool)(H5Lexists(h->file, part, H5P_DEFAULT) > 0);
    *c     = '/';
  }
  if (*found) *found = (PetscBool)(H5Lexists(h->file, part, H5P_DEFAULT) > 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode Hdf5GetSize(Hdf5 h, const char name[], PetscInt *rows, PetscInt *bs)
{
  hsize_t   extent[2] = {0, 0};
  hid_t     set, space;
  PetscBool found;

  PetscFunctionBeginUser;
  *rows = *bs = -1;
  PetscCall(find_name(h, name, &found));
  set = found ? H5Dopen2(h->file, name, H5P_DEFAULT) : -1;
  if (set < 0) PetscFunctionReturn(PETSC_SUCCESS);
  space = H5Dget_space(set);
  if (H5Sget_simple_extent_ndims(space) == 2) {
    H5Sget_simple_extent_dims(space, extent, NULL);
    *rows = (PetscInt)extent[0];
    *bs   = (PetscInt)extent[1];
  }
  H5Sclose(space);
  H5Dclose(set);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- attributes ---- */

/* Of one value; n bytes are one text */
static hid_t attribute_type(Hdf5Type t, PetscInt n)
{
  const hid_t type = H5Tcopy(t == HDF5_BYTE ? H5T_C_S1 : memory_type(t));

  if (t == HDF5_BYTE) H5Tset_size(type, (size_t)n);
  return type;
}

PetscErrorCode Hdf5WriteAttribute(Hdf5 h, const char object[], const char name[], Hdf5Type t, PetscInt n, const void *v)
{
  const hid_t type = attribute_type(t, n), space = H5Screate(H5S_SCALAR);
  const hid_t attribute = H5Acreate_by_name(h->file, object, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);

  PetscFunctionBeginUser;
  if (attribute < 0 || H5Awrite(attribute, type, v) < 0) note_failure(h, strcmp(object, "/") ? object : "the file");
  if (attribute >= 0) H5Aclose(attribute);
  H5Sclose(space);
  H5Tclose(type);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode Hdf5ReadAttribute(Hdf5 h, const char object[], const char name[], Hdf5Type t, PetscInt n, void *v, PetscBool *good)
{
  const hid_t type      = attribute_type(t, n);
  const hid_t attribute = H5Aexists_by_name(h->file, object, name, H5P_DEFAULT) > 0 ? H5Aopen_by_name(h->file, object, name, H5P_DEFAULT, H5P_DEFAULT)
                                                                                    : -1;

  PetscFunctionBeginUser;
  *good = (PetscBool)(attribute >= 0 && H5Aread(attribute, type, v) >= 0);
  if (attribute >= 0) H5Aclose(attribute);
  H5Tclose(type);
  PetscCall(agree(h, good));
  PetscFunctionReturn(PETSC_SUCCESS);
}
