/* Hdf5: see hdf5.h. HDF5 itself runs on rank 0 alone: it makes groups, datasets and attributes and finds where in the
   file the values of a dataset stand, one block after its creation; there every rank reads and writes its own rows by
   itself. So whatever fails on one rank (a full disk) fails in a call of that rank alone, and no other waits for it
   inside a library, as ranks do in MPI-IO when one of them has given up. */
#include "compat.h"
#include "base/hdf5.h"
#include <errno.h>
#include <fcntl.h>
#include <hdf5.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
  #error "tumble writes values as they are in memory, and its files are little-endian"
#endif

#define TAG      417
#define CHUNK    (1 << 30) /* bytes that one call moves */
#define NOWHERE  (-1)      /* where a dataset's values stand: there is none */
#define ANYWHERE (-2)      /* they are not one block of the same type (a file that other tools have written anew) */

struct _p_Hdf5 {
  MPI_Comm    comm;
  PetscMPIInt rank, size;
  hid_t       file; /* rank 0 */
  int         fd;   /* of the same file, for the rows; -1: not opened yet */
  PetscBool   writing;
  char        path[PETSC_MAX_PATH_LEN], failed[256]; /* writing: what failed first on this rank */
  H5E_auto2_t printer;                               /* of HDF5's own stack of errors, off while the file is open */
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

/* What failed while writing, and errno as the call left it (0 before it) */
static void note_failure(Hdf5 h, const char what[])
{
  if (!h->failed[0]) (void)snprintf(h->failed, sizeof(h->failed), errno ? "%s (%s)" : "%s", what, strerror(errno));
}

/* Does it hold on every rank? */
static PetscErrorCode agree(Hdf5 h, PetscBool *good)
{
  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, good, 1, COMPAT_MPI_BOOL, MPI_LAND, h->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- files ---- */

/* Rank 0. Other ranks write to the file as well: no lock. */
static hid_t open_here(const char path[], PetscBool writing)
{
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  hid_t       file   = -1;

#if H5_VERSION_GE(1, 10, 7)
  if (access >= 0) (void)H5Pset_file_locking(access, 0, 1);
#endif
  if (access >= 0)
    file = writing ? H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, access) : H5Fopen(path, H5F_ACC_RDONLY, access);
  if (access >= 0) (void)H5Pclose(access);
  return file;
}

static PetscErrorCode open_file(MPI_Comm comm, const char path[], PetscBool writing, Hdf5 *file)
{
  Hdf5 h;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&h));
  h->comm    = comm;
  h->writing = writing;
  h->file    = -1;
  h->fd      = -1;
  PetscCallMPI(MPI_Comm_rank(comm, &h->rank));
  PetscCallMPI(MPI_Comm_size(comm, &h->size));
  PetscCall(PetscStrncpy(h->path, path, sizeof(h->path)));
  H5Eget_auto2(H5E_DEFAULT, &h->printer, &h->printer_data);
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
  errno = 0;
  if (h->rank == 0) h->file = open_here(path, writing);
  if (h->rank == 0 && h->file < 0) note_failure(h, "the file");
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
  *good = (PetscBool)((*file)->rank || (*file)->file >= 0);
  PetscCall(agree(*file, good));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* This rank's own way to the rows; made with the file by rank 0, so that O_CREAT finds it at once on any file system */
static PetscBool open_rows(Hdf5 h)
{
  if (h->fd < 0) h->fd = open(h->path, (h->writing ? O_WRONLY | O_CREAT : O_RDONLY) | O_CLOEXEC, 0666);
  return (PetscBool)(h->fd >= 0);
}

/* On disk, all of it: rank 0 after HDF5 has closed the file */
static void close_rows(Hdf5 h)
{
  if (h->writing && h->rank == 0 && !h->failed[0] && !open_rows(h)) note_failure(h, "the file");
  if (h->fd < 0) return;
  if (h->writing && fsync(h->fd) && errno != EINVAL) note_failure(h, "the file");
  if (close(h->fd) && h->writing) note_failure(h, "the file");
}

/* What the first rank says that has something to say */
static PetscErrorCode agree_on_failure(Hdf5 h, char reason[], size_t len)
{
  int first = h->failed[0] ? h->rank : h->size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &first, 1, MPI_INT, MPI_MIN, h->comm));
  if (first < h->size) PetscCallMPI(MPI_Bcast(h->failed, sizeof(h->failed), MPI_CHAR, first, h->comm));
  if (reason) (void)snprintf(reason, len, "%s%s", h->failed[0] ? "HDF5 fails at " : "", h->failed);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode Hdf5Close(Hdf5 *file, char reason[], size_t len)
{
  Hdf5 h = *file;

  PetscFunctionBeginUser;
  errno = 0;
  if (h->file >= 0 && h->writing && H5Fflush(h->file, H5F_SCOPE_GLOBAL) < 0) note_failure(h, "the file");
  if (h->file >= 0 && H5Fclose(h->file) < 0) note_failure(h, "the file");
  close_rows(h);
  H5Eset_auto2(H5E_DEFAULT, h->printer, h->printer_data);
  PetscCall(agree_on_failure(h, reason, len));
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
    (void)
      snprintf(reason, len,
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

static size_t row_size(Hdf5Type t, PetscInt bs)
{
  return H5Tget_size(memory_type(t)) * (size_t)PetscMax(bs, 1);
}

/* All n bytes of v to or from the place, in calls that none refuses for its length; errno is 0 at the end of a file
   that is too short */
static PetscBool move_rows(Hdf5 h, size_t n, int64_t offset, void *v)
{
  char *at = v;

  if (n && !open_rows(h)) return PETSC_FALSE;
  while (n) {
    const size_t  ask  = n < CHUNK ? n : CHUNK;
    const ssize_t done = h->writing ? pwrite(h->fd, at, ask, (off_t)offset) : pread(h->fd, at, ask, (off_t)offset);

    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) return PETSC_FALSE;
    n -= (size_t)done;
    at += done;
    offset += done;
  }
  return PETSC_TRUE;
}

/* Rank 0: a dataset, whose values get their place now and are written by nobody but us; where it is, or NOWHERE */
static int64_t create_set(Hdf5 h, const char name[], Hdf5Type t, Hdf5Rows rows, PetscInt bs)
{
  const hsize_t total[2] = {(hsize_t)rows.total, (hsize_t)bs};
  const hid_t   space = H5Screate_simple(bs ? 2 : 1, total, NULL), groups = H5Pcreate(H5P_LINK_CREATE),
              how = H5Pcreate(H5P_DATASET_CREATE);
  hid_t   set     = -1;
  haddr_t offset  = HADDR_UNDEF;

  if (space >= 0 && groups >= 0 && how >= 0 && H5Pset_create_intermediate_group(groups, 1) >= 0 &&
      H5Pset_alloc_time(how, H5D_ALLOC_TIME_EARLY) >= 0 && H5Pset_fill_time(how, H5D_FILL_TIME_NEVER) >= 0)
    set = H5Dcreate2(h->file, name, file_type(t), space, groups, how, H5P_DEFAULT);
  if (set >= 0) offset = rows.total > 0 ? H5Dget_offset(set) : 0;
  if (set >= 0 && H5Dclose(set) < 0) offset = HADDR_UNDEF;
  if (how >= 0) (void)H5Pclose(how);
  if (groups >= 0) (void)H5Pclose(groups);
  if (space >= 0) (void)H5Sclose(space);
  return offset == HADDR_UNDEF ? NOWHERE : (int64_t)offset;
}

PetscErrorCode Hdf5Write(Hdf5 h, const char name[], Hdf5Type t, Hdf5Rows rows, PetscInt bs, const void *v)
{
  const size_t size   = row_size(t, bs);
  int64_t      offset = NOWHERE;

  PetscFunctionBeginUser;
  errno = 0;
  if (h->rank == 0 && h->file >= 0) offset = create_set(h, name, t, rows, bs);
  if (h->rank == 0 && offset < 0) note_failure(h, name);
  PetscCallMPI(MPI_Bcast(&offset, 1, MPI_INT64_T, 0, h->comm));
  errno = 0;
  if (offset >= 0 &&
      !move_rows(h, (size_t)rows.n * size, offset + (int64_t)((size_t)rows.start * size), (void *)(size_t)v))
    note_failure(h, name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rank 0: does the dataset have this shape? Then where its values stand, or ANYWHERE */
static int64_t find_set(hid_t set, Hdf5Type t, Hdf5Rows rows, PetscInt bs)
{
  const int   ndim      = bs ? 2 : 1;
  hsize_t     extent[2] = {0, 0};
  const hid_t space = H5Dget_space(set), type = H5Dget_type(set), how = H5Dget_create_plist(set);
  int64_t     offset = NOWHERE;

  if (space >= 0 && type >= 0 && how >= 0 && H5Sget_simple_extent_ndims(space) == ndim &&
      H5Sget_simple_extent_dims(space, extent, NULL) == ndim && extent[0] == (hsize_t)rows.total &&
      (!bs || extent[1] == (hsize_t)bs)) {
    const haddr_t at = H5Dget_offset(set);

    offset = rows.total == 0 ? 0 : ANYWHERE;
    if (rows.total && at != HADDR_UNDEF && H5Pget_layout(how) == H5D_CONTIGUOUS && H5Pget_external_count(how) == 0 &&
        H5Tequal(type, file_type(t)) > 0)
      offset = (int64_t)at;
  }
  if (how >= 0) (void)H5Pclose(how);
  if (type >= 0) (void)H5Tclose(type);
  if (space >= 0) (void)H5Sclose(space);
  return offset;
}

/* Rank 0: n rows from start, by HDF5 */
static PetscBool read_here(hid_t set, Hdf5Type t, hsize_t n, hsize_t start, PetscInt bs, void *v)
{
  const hsize_t from[2] = {start, 0}, count[2] = {n, (hsize_t)bs};
  const hid_t   in_file = H5Dget_space(set), in_memory = H5Screate_simple(bs ? 2 : 1, count, NULL);
  PetscBool     good = (PetscBool)(in_file >= 0 && in_memory >= 0);

  if (good && n) good = (PetscBool)(H5Sselect_hyperslab(in_file, H5S_SELECT_SET, from, NULL, count, NULL) >= 0);
  if (good && n) good = (PetscBool)(H5Dread(set, memory_type(t), in_memory, in_file, H5P_DEFAULT, v) >= 0);
  if (in_memory >= 0) (void)H5Sclose(in_memory);
  if (in_file >= 0) (void)H5Sclose(in_file);
  return good;
}

/* Values that are not one block, or of another type: rank 0 reads them for one rank after the other. *good is
   rank 0's. */
static PetscErrorCode read_for_all(Hdf5 h, hid_t set, Hdf5Type t, Hdf5Rows rows, PetscInt bs, void *v, PetscBool *good)
{
  const size_t size = row_size(t, bs);
  MPI_Datatype row;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Type_contiguous((PetscMPIInt)size, MPI_BYTE, &row));
  PetscCallMPI(MPI_Type_commit(&row));
  if (h->rank) {
    const int64_t mine[2] = {rows.n, rows.start};

    PetscCallMPI(MPI_Send(mine, 2, MPI_INT64_T, 0, TAG, h->comm));
    PetscCallMPI(MPI_Recv(v, (PetscMPIInt)rows.n, row, 0, TAG, h->comm, MPI_STATUS_IGNORE));
  } else *good = read_here(set, t, (hsize_t)rows.n, (hsize_t)rows.start, bs, v);
  for (PetscMPIInt r = 1; h->rank == 0 && r < h->size; r++) {
    int64_t theirs[2];
    char   *w;

    PetscCallMPI(MPI_Recv(theirs, 2, MPI_INT64_T, r, TAG, h->comm, MPI_STATUS_IGNORE));
    PetscCall(PetscCalloc1((size_t)theirs[0] * size, &w));
    *good = (PetscBool)(read_here(set, t, (hsize_t)theirs[0], (hsize_t)theirs[1], bs, w) && *good);
    PetscCallMPI(MPI_Send(w, (PetscMPIInt)theirs[0], row, r, TAG, h->comm));
    PetscCall(PetscFree(w));
  }
  PetscCallMPI(MPI_Type_free(&row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode Hdf5Read(Hdf5 h, const char name[], Hdf5Type t, Hdf5Rows rows, PetscInt bs, void *v, PetscBool *good)
{
  const size_t size   = row_size(t, bs);
  const hid_t  set    = h->rank == 0 && h->file >= 0 ? H5Dopen2(h->file, name, H5P_DEFAULT) : -1;
  int64_t      offset = NOWHERE;

  PetscFunctionBeginUser;
  *good = PETSC_TRUE;
  if (set >= 0) offset = find_set(set, t, rows, bs);
  PetscCallMPI(MPI_Bcast(&offset, 1, MPI_INT64_T, 0, h->comm));
  if (offset == NOWHERE) *good = PETSC_FALSE;
  else if (offset == ANYWHERE) PetscCall(read_for_all(h, set, t, rows, bs, v, good));
  else *good = move_rows(h, (size_t)rows.n * size, offset + (int64_t)((size_t)rows.start * size), v);
  if (set >= 0) (void)H5Dclose(set);
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

/* Rank 0: is the name there, and are the groups that lead to it? */
static PetscBool has_name(Hdf5 h, const char name[])
{
  char partial[256];

  (void)snprintf(partial, sizeof(partial), "%s", name);
  for (char *c = partial + 1; *c; c++) {
    if (*c != '/') continue;
    *c = 0;
    if (H5Lexists(h->file, partial, H5P_DEFAULT) <= 0) return PETSC_FALSE;
    *c = '/';
  }
  return (PetscBool)(H5Lexists(h->file, partial, H5P_DEFAULT) > 0);
}

PetscErrorCode Hdf5GetSize(Hdf5 h, const char name[], PetscInt *rows, PetscInt *bs)
{
  hsize_t extent[2] = {0, 0};
  int64_t found[2]  = {-1, -1};
  hid_t   set = -1, space = -1;

  PetscFunctionBeginUser;
  if (h->rank == 0 && h->file >= 0 && has_name(h, name)) set = H5Dopen2(h->file, name, H5P_DEFAULT);
  if (set >= 0) space = H5Dget_space(set);
  if (space >= 0 && H5Sget_simple_extent_ndims(space) <= 2 && H5Sget_simple_extent_dims(space, extent, NULL) > 0) {
    found[0] = (int64_t)extent[0];
    found[1] = (int64_t)extent[1];
  }
  if (space >= 0) (void)H5Sclose(space);
  if (set >= 0) (void)H5Dclose(set);
  PetscCallMPI(MPI_Bcast(found, 2, MPI_INT64_T, 0, h->comm));
  *rows = (PetscInt)found[0];
  *bs   = (PetscInt)found[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- attributes ---- */

/* Of one value; n bytes are one text. < 0 when it cannot be made */
static hid_t attribute_type(Hdf5Type t, PetscInt n)
{
  const hid_t type = H5Tcopy(t == HDF5_BYTE ? H5T_C_S1 : memory_type(t));

  if (type >= 0 && t == HDF5_BYTE && H5Tset_size(type, (size_t)n) < 0) {
    (void)H5Tclose(type);
    return -1;
  }
  return type;
}

PetscErrorCode Hdf5WriteAttribute(Hdf5 h, const char object[], const char name[], Hdf5Type t, PetscInt n, const void *v)
{
  hid_t type = -1, space = -1, attribute = -1;

  PetscFunctionBeginUser;
  if (h->rank || h->file < 0) PetscFunctionReturn(PETSC_SUCCESS); /* a file that is not there was noted */
  errno = 0;
  type  = attribute_type(t, n);
  space = H5Screate(H5S_SCALAR);
  if (type >= 0 && space >= 0)
    attribute = H5Acreate_by_name(h->file, object, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  if (attribute < 0 || H5Awrite(attribute, type, v) < 0) note_failure(h, strcmp(object, "/") ? object : "the file");
  if (attribute >= 0 && H5Aclose(attribute) < 0) note_failure(h, strcmp(object, "/") ? object : "the file");
  if (space >= 0) (void)H5Sclose(space);
  if (type >= 0) (void)H5Tclose(type);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode Hdf5ReadAttribute(Hdf5 h, const char object[], const char name[], Hdf5Type t, PetscInt n, void *v,
                                 PetscBool *good)
{
  const size_t size = t == HDF5_BYTE ? (size_t)n : H5Tget_size(memory_type(t));
  hid_t        type = -1, attribute = -1;

  PetscFunctionBeginUser;
  *good = PETSC_FALSE;
  if (h->rank == 0 && h->file >= 0) {
    type = attribute_type(t, n);
    if (type >= 0 && H5Aexists_by_name(h->file, object, name, H5P_DEFAULT) > 0)
      attribute = H5Aopen_by_name(h->file, object, name, H5P_DEFAULT, H5P_DEFAULT);
    *good = (PetscBool)(attribute >= 0 && H5Aread(attribute, type, v) >= 0);
  }
  if (attribute >= 0) (void)H5Aclose(attribute);
  if (type >= 0) (void)H5Tclose(type);
  PetscCallMPI(MPI_Bcast(good, 1, COMPAT_MPI_BOOL, 0, h->comm));
  if (*good) PetscCallMPI(MPI_Bcast(v, (PetscMPIInt)size, MPI_BYTE, 0, h->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}
