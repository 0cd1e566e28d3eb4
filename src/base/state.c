/* State: see state.h. Through HDF5 itself, because PETSc's viewer neither tells why a file is refused nor writes arrays that only one rank holds.

   Failures of HDF5 while saving are remembered and told at the end by all ranks; while loading they are told at once. */
#include "compat.h"
#include "base/state.h"
#include "base/pointmap.h"
#include <errno.h>
#include <fcntl.h>
#include <hdf5.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#if !defined(H5_HAVE_PARALLEL)
  #error "tumble needs an HDF5 that is built for MPI"
#endif

#define FORMAT_NAME    "tumble checkpoint"
#define FORMAT_VERSION 1

/* One dimension of an array in the file and this rank's part of it */
typedef struct {
  PetscInt n, start, total;
} Rows;

/* Nodes or cells: own rows here; when loading another partition, the even share of the file's rows that this rank reads, and the way from there */
typedef struct {
  Rows    own, share;
  PetscSF sf;
} Entities;

struct _p_State {
  StateKeys   key; /* its x are ours */
  MPI_Comm    comm;
  PetscMPIInt rank, size;
  Entities    entity[2];
  char        path[PETSC_MAX_PATH_LEN], module[64], failed[128]; /* failed: first array that could not be written */
  PetscBool   open, loading, same;
  hid_t       file, together; /* transfer property: all ranks take part */
  H5E_auto2_t printer;
  void       *printer_data;
};

static const char *const ENTITY[2] = {"nodes", "cells"};

typedef enum {
  TYPE_REAL,
  TYPE_INT, /* int64_t */
  TYPE_BYTE
} Type;

/* ---- small tools ---- */

static hid_t memory_type(Type t)
{
  return t == TYPE_REAL ? H5T_NATIVE_DOUBLE : t == TYPE_INT ? H5T_NATIVE_INT64 : H5T_NATIVE_UCHAR;
}

static hid_t file_type(Type t)
{
  return t == TYPE_REAL ? H5T_IEEE_F64LE : t == TYPE_INT ? H5T_STD_I64LE : H5T_STD_U8LE;
}

/* Sum over the entries of the array of their bits times an odd number that depends on the place; the same for every distribution. Collective. */
static PetscErrorCode compute_checksum(State s, Type t, Rows rows, PetscInt bs, const void *v, uint64_t *sum)
{
  uint64_t mine = 0, place = 2 * (uint64_t)rows.start * (uint64_t)bs + 1;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < rows.n * bs; i++, place += 2) {
    uint64_t word;

    if (t == TYPE_BYTE) word = ((const unsigned char *)v)[i];
    else memcpy(&word, (const char *)v + 8 * i, 8);
    word = (word ^ (word >> 32)) * 0x9e3779b97f4a7c15u;
    mine += (word ^ (word >> 29)) * place;
  }
  PetscCallMPI(MPI_Allreduce(&mine, sum, 1, MPI_UINT64_T, MPI_SUM, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does it hold on every rank? Collective. */
static PetscErrorCode agree(State s, PetscBool *good)
{
  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, good, 1, COMPAT_MPI_BOOL, MPI_LAND, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode full_name(State s, const char name[], char full[], size_t len)
{
  PetscFunctionBeginUser;
  PetscCheck(s->open, s->comm, PETSC_ERR_ARG_WRONGSTATE, "State '%s' is visited outside of StateBegin... and StateEnd", name);
  PetscCall(PetscSNPrintf(full, len, "/%s%s%s", s->module, s->module[0] ? "/" : "", name));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Select this rank's rows of a [total][bs] array in the file, and the same number in memory */
static void select_rows(Rows rows, PetscInt bs, hid_t *in_file, hid_t *in_memory)
{
  const hsize_t total[2] = {(hsize_t)rows.total, (hsize_t)bs}, n[2] = {(hsize_t)rows.n, (hsize_t)bs}, start[2] = {(hsize_t)rows.start, 0};

  *in_file   = H5Screate_simple(2, total, NULL);
  *in_memory = H5Screate_simple(2, n, NULL);
  if (rows.n > 0) H5Sselect_hyperslab(*in_file, H5S_SELECT_SET, start, NULL, n, NULL);
  else {
    H5Sselect_none(*in_file);
    H5Sselect_none(*in_memory);
  }
}

/* Attribute of one value: 0 if it went well. All ranks give the same value. */
static int put_attribute(hid_t object, const char name[], hid_t type, const void *v)
{
  const hid_t space = H5Screate(H5S_SCALAR), attribute = H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
  int         bad = attribute < 0 || H5Awrite(attribute, type, v) < 0;

  if (attribute >= 0) H5Aclose(attribute);
  H5Sclose(space);
  return bad;
}

static int get_attribute(hid_t object, const char name[], hid_t type, void *v)
{
  const hid_t attribute = H5Aexists(object, name) > 0 ? H5Aopen(object, name, H5P_DEFAULT) : -1;
  int         bad       = attribute < 0 || H5Aread(attribute, type, v) < 0;

  if (attribute >= 0) H5Aclose(attribute);
  return bad;
}

/* ---- arrays ---- */

static PetscErrorCode save_array(State s, const char name[], Type t, Rows rows, PetscInt bs, const void *v)
{
  char     full[256];
  hid_t    in_file, in_memory, set, make_groups;
  uint64_t sum;
  int      bad;

  PetscFunctionBeginUser;
  PetscCall(full_name(s, name, full, sizeof(full)));
  PetscCall(compute_checksum(s, t, rows, bs, v, &sum));
  select_rows(rows, bs, &in_file, &in_memory);
  make_groups = H5Pcreate(H5P_LINK_CREATE);
  H5Pset_create_intermediate_group(make_groups, 1);
  set = H5Dcreate2(s->file, full, file_type(t), in_file, make_groups, H5P_DEFAULT, H5P_DEFAULT);
  bad = set < 0 || (rows.total > 0 && bs > 0 && H5Dwrite(set, memory_type(t), in_memory, in_file, s->together, v) < 0) ||
        put_attribute(set, "checksum", H5T_NATIVE_UINT64, &sum);
  if (set >= 0) H5Dclose(set);
  H5Pclose(make_groups);
  H5Sclose(in_file);
  H5Sclose(in_memory);
  if (bad && !s->failed[0]) PetscCall(PetscStrncpy(s->failed, full, sizeof(s->failed)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rows and columns of an array in the file; rows -1: not there */
static PetscErrorCode measure_array(State s, const char full[], PetscInt *rows, PetscInt *bs)
{
  char    group[256];
  hsize_t extent[2] = {0, 0};
  hid_t   set, space;

  PetscFunctionBeginUser;
  *rows = *bs = -1;
  PetscCall(PetscStrncpy(group, full, sizeof(group)));
  if (strrchr(group, '/') > group) {
    *strrchr(group, '/') = 0;
    if (H5Lexists(s->file, group, H5P_DEFAULT) <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (H5Lexists(s->file, full, H5P_DEFAULT) <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  set = H5Dopen2(s->file, full, H5P_DEFAULT);
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

static PetscErrorCode load_array(State s, const char name[], Type t, Rows rows, PetscInt bs, void *v)
{
  char      full[256];
  hid_t     in_file, in_memory, set;
  uint64_t  sum, stored = 0;
  PetscInt  nrow, ncol;
  PetscBool good;

  PetscFunctionBeginUser;
  PetscCall(full_name(s, name, full, sizeof(full)));
  PetscCall(measure_array(s, full, &nrow, &ncol));
  PetscCheck(nrow >= 0, s->comm, PETSC_ERR_USER_INPUT,
             "Checkpoint '%s' has no '%s': it was written by another version or with options that leave it out; restart with the options of that run",
             s->path, full);
  PetscCheck((nrow == rows.total && ncol == bs), s->comm, PETSC_ERR_USER_INPUT,
             "Checkpoint '%s' has %" PetscInt_FMT " x %" PetscInt_FMT " values of '%s', this scene needs %" PetscInt_FMT " x %" PetscInt_FMT
             ": it belongs to another scene",
             s->path, nrow, ncol, full, rows.total, bs);
  select_rows(rows, bs, &in_file, &in_memory);
  set  = H5Dopen2(s->file, full, H5P_DEFAULT);
  good = (PetscBool)(set >= 0 && (rows.total == 0 || bs == 0 || H5Dread(set, memory_type(t), in_memory, in_file, s->together, v) >= 0) &&
                     !get_attribute(set, "checksum", H5T_NATIVE_UINT64, &stored));
  if (set >= 0) H5Dclose(set);
  H5Sclose(in_file);
  H5Sclose(in_memory);
  PetscCall(agree(s, &good));
  if (good) PetscCall(compute_checksum(s, t, rows, bs, v, &sum));
  PetscCheck(good && sum == stored, s->comm, PETSC_ERR_FILE_READ,
             "Checkpoint '%s' is damaged: '%s' %s. Restart from an earlier one (-sim_restart FILE)", s->path, full,
             good ? "has not the checksum it was written with" : "cannot be read");
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode transfer(State s, const char name[], Type t, Rows rows, PetscInt bs, void *v)
{
  PetscFunctionBeginUser;
  if (s->loading) PetscCall(load_array(s, name, t, rows, bs, v));
  else PetscCall(save_array(s, name, t, rows, bs, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* As transfer, for an array [n] that every rank holds: rank 0's goes into the file and comes from there */
static PetscErrorCode transfer_replicated(State s, const char name[], Type t, PetscInt n, void *v)
{
  const Rows rows = s->rank == 0 ? (Rows){n, 0, n} : (Rows){0, n, n};

  PetscFunctionBeginUser;
  PetscCall(transfer(s, name, t, rows, 1, v));
  if (s->loading) PetscCallMPI(MPI_Bcast(v, (PetscMPIInt)(t == TYPE_BYTE ? n : 8 * n), MPI_BYTE, 0, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- files ---- */

static uint64_t little_endian(const unsigned char b[])
{
  uint64_t v = 0;

  for (int i = 7; i >= 0; i--) v = v << 8 | b[i];
  return v;
}

const char *StateCheckFile(const char path[], char reason[], size_t len)
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
  if (fstat(fileno(f), &st)) st.st_size = 0;
  (void)fclose(f);
  if (n < 8 || memcmp(head, signature, 8)) {
    (void)snprintf(reason, len, n == 0 ? "the file is empty" : "it is no HDF5 file");
    return reason;
  }
  end = little_endian(head + (head[8] == 0   ? 40
                              : head[8] == 1 ? 44
                                             : 28)); /* end of file as the superblock of this version has it, with offsets of 8 bytes */
  if (n < sizeof(head) || (uint64_t)st.st_size < end) {
    (void)snprintf(reason, len, "it is truncated: %lld bytes of %llu", (long long)st.st_size, (unsigned long long)end);
    return reason;
  }
  return NULL;
}

/* HDF5 prints its own stack of errors unless told not to; ours say what to do */
static void silence(State s)
{
  H5Eget_auto2(H5E_DEFAULT, &s->printer, &s->printer_data);
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
}

static hid_t open_file(State s, const char path[])
{
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  hid_t       file;

  H5Pset_fapl_mpio(access, s->comm, MPI_INFO_NULL);
  file = s->loading ? H5Fopen(path, H5F_ACC_RDONLY, access) : H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, access);
  H5Pclose(access);
  s->together = H5Pcreate(H5P_DATASET_XFER);
  H5Pset_dxpl_mpio(s->together, H5FD_MPIO_COLLECTIVE);
  return file;
}

static PetscErrorCode close_file(State s)
{
  PetscFunctionBeginUser;
  if (s->file >= 0) {
    if (!s->loading && H5Fflush(s->file, H5F_SCOPE_GLOBAL) < 0 && !s->failed[0]) PetscCall(PetscStrncpy(s->failed, "the file", sizeof(s->failed)));
    if (H5Fclose(s->file) < 0 && !s->loading && !s->failed[0]) PetscCall(PetscStrncpy(s->failed, "the file", sizeof(s->failed)));
  }
  H5Pclose(s->together);
  H5Eset_auto2(H5E_DEFAULT, s->printer, s->printer_data);
  s->open = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rank 0: the file is on disk under its name, or errno */
static int settle_file(const char part[], const char path[])
{
  char dir[PETSC_MAX_PATH_LEN], *slash;
  int  fd = open(part, O_RDWR), err = 0;

  if (fd < 0) return errno;
  if (fsync(fd)) err = errno;
  (void)close(fd);
  if (!err && rename(part, path)) err = errno;
  if (err) return err;
  (void)snprintf(dir, sizeof(dir), "%s", path);
  slash = strrchr(dir, '/');
  if (slash) *slash = 0;
  fd = open(slash ? dir : ".", O_RDONLY);
  if (fd >= 0) { /* some file systems cannot synchronise a directory: the rename itself is atomic anyway */
    (void)fsync(fd);
    (void)close(fd);
  }
  return 0;
}

/* ---- the mesh ---- */

static PetscErrorCode save_mesh(State s)
{
  const StateKeys *k       = &s->key;
  int64_t          part[2] = {k->n[STATE_NODE], k->n[STATE_CELL]}, size[3] = {k->dim, k->total[STATE_CELL], k->total[STATE_NODE]};

  PetscFunctionBeginUser;
  PetscCall(transfer_replicated(s, "size", TYPE_INT, 3, size));
  PetscCall(save_array(s, "partition", TYPE_INT, (Rows){1, s->rank, s->size}, 2, part));
  for (int e = 0; e < 2; e++) PetscCall(save_array(s, ENTITY[e], TYPE_REAL, s->entity[e].own, k->dim, k->x[e]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is the file's distribution of the mesh this run's own? Bit for bit, then what it holds can be continued bit for bit. */
static PetscErrorCode compare_partition(State s)
{
  PetscInt nrow, ncol;
  int64_t  part[2];

  PetscFunctionBeginUser;
  PetscCall(measure_array(s, "/mesh/partition", &nrow, &ncol));
  s->same = (PetscBool)(nrow == s->size && ncol == 2);
  if (!s->same) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(load_array(s, "partition", TYPE_INT, (Rows){1, s->rank, s->size}, 2, part));
  s->same = (PetscBool)(part[0] == s->key.n[STATE_NODE] && part[1] == s->key.n[STATE_CELL]);
  PetscCall(agree(s, &s->same));
  for (int e = 0; e < 2 && s->same; e++) {
    const PetscInt n = s->entity[e].own.n * s->key.dim;
    PetscReal     *x;

    PetscCall(PetscMalloc1(n, &x));
    PetscCall(load_array(s, ENTITY[e], TYPE_REAL, s->entity[e].own, s->key.dim, x));
    s->same = (PetscBool)(n == 0 || !memcmp(x, s->key.x[e], (size_t)n * sizeof(*x)));
    PetscCall(PetscFree(x));
    PetscCall(agree(s, &s->same));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode match_mesh(State s)
{
  const PetscInt dim = s->key.dim;

  PetscFunctionBeginUser;
  for (int e = 0; e < 2; e++) {
    Entities *t     = s->entity + e;
    PetscReal x0[3] = {0, 0, 0}, *x;
    PetscInt  missing;

    t->share = (Rows){PETSC_DECIDE, 0, t->own.total};
    PetscCall(PetscSplitOwnership(s->comm, &t->share.n, &t->share.total));
    PetscCallMPI(MPI_Exscan(&t->share.n, &t->share.start, 1, MPIU_INT, MPI_SUM, s->comm));
    if (s->rank == 0) t->share.start = 0;
    PetscCall(PetscMalloc1(t->share.n * dim, &x));
    PetscCall(load_array(s, ENTITY[e], TYPE_REAL, t->share, dim, x));
    PetscCall(PointMapCreate(s->comm, dim, s->key.tolerance, t->share.n, x, t->own.n, s->key.x[e], &t->sf, &missing, x0));
    PetscCall(PetscFree(x));
    PetscCheck(!missing, s->comm, PETSC_ERR_USER_INPUT,
               "Checkpoint '%s' has another mesh: %" PetscInt_FMT " of %" PetscInt_FMT " %s of this scene are not in it, one at (%g, %g, %g). "
               "Restart with the -mesh_ options of the run that wrote it",
               s->path, missing, t->own.total, ENTITY[e], (double)x0[0], (double)x0[1], (double)x0[2]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode load_mesh(State s)
{
  const StateKeys *k = &s->key;
  int64_t          size[3];

  PetscFunctionBeginUser;
  PetscCall(transfer_replicated(s, "size", TYPE_INT, 3, size));
  PetscCheck(size[0] == k->dim && size[1] == k->total[STATE_CELL] && size[2] == k->total[STATE_NODE], s->comm, PETSC_ERR_USER_INPUT,
             "Checkpoint '%s' has another mesh: %dD with %lld cells and %lld nodes, this scene %dD with %" PetscInt_FMT " and %" PetscInt_FMT
             ". Restart with the -mesh_ options of the run that wrote it",
             s->path, (int)size[0], (long long)size[1], (long long)size[2], (int)k->dim, k->total[STATE_CELL], k->total[STATE_NODE]);
  PetscCall(compare_partition(s));
  if (!s->same) PetscCall(match_mesh(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

PetscErrorCode StateCreate(MPI_Comm comm, const StateKeys *key, State *state)
{
  State s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->key  = *key;
  s->comm = comm;
  s->file = -1;
  PetscCallMPI(MPI_Comm_rank(comm, &s->rank));
  PetscCallMPI(MPI_Comm_size(comm, &s->size));
  for (int e = 0; e < 2; e++) s->entity[e].own = (Rows){key->n[e], key->start[e], key->total[e]};
  *state = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateDestroy(State *state)
{
  State s = *state;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  for (int e = 0; e < 2; e++) {
    PetscCall(PetscSFDestroy(&s->entity[e].sf));
    PetscCall(PetscFree(s->key.x[e]));
  }
  PetscCall(PetscFree(*state));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode begin(State s, const char path[], PetscBool loading)
{
  PetscFunctionBeginUser;
  PetscCheck(!s->open, s->comm, PETSC_ERR_ARG_WRONGSTATE, "'%s' is still open", s->path);
  PetscCall(PetscStrncpy(s->path, path, sizeof(s->path)));
  s->loading   = loading;
  s->open      = PETSC_TRUE;
  s->failed[0] = 0;
  PetscCall(PetscStrncpy(s->module, "mesh", sizeof(s->module)));
  silence(s);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateBeginSave(State s, const char path[])
{
  char      part[PETSC_MAX_PATH_LEN];
  const int version = FORMAT_VERSION;
  hid_t     text    = H5Tcopy(H5T_C_S1);

  PetscFunctionBeginUser;
  PetscCall(begin(s, path, PETSC_FALSE));
  PetscCall(PetscSNPrintf(part, sizeof(part), "%s.part", path));
  s->file = open_file(s, part);
  H5Tset_size(text, sizeof(FORMAT_NAME));
  if (s->file < 0 || put_attribute(s->file, "format", text, FORMAT_NAME) || put_attribute(s->file, "version", H5T_NATIVE_INT, &version))
    PetscCall(PetscStrncpy(s->failed, "the file", sizeof(s->failed)));
  H5Tclose(text);
  PetscCall(save_mesh(s));
  PetscCall(StateModule(s, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Format and version: is the file one of ours? */
static PetscErrorCode check_format(State s)
{
  char      format[sizeof(FORMAT_NAME)] = "";
  int       version                     = 0;
  hid_t     text                        = H5Tcopy(H5T_C_S1);
  PetscBool ours;

  PetscFunctionBeginUser;
  H5Tset_size(text, sizeof(FORMAT_NAME));
  ours = (PetscBool)(!get_attribute(s->file, "format", text, format) && !strcmp(format, FORMAT_NAME));
  if (ours) ours = (PetscBool)!get_attribute(s->file, "version", H5T_NATIVE_INT, &version);
  H5Tclose(text);
  PetscCall(agree(s, &ours));
  PetscCheck(ours, s->comm, PETSC_ERR_FILE_UNEXPECTED,
             "'%s' is an HDF5 file, but no checkpoint of tumble: give one as -sim_restart (checkpoint_<step>.h5)", s->path);
  PetscCheck(version == FORMAT_VERSION, s->comm, PETSC_ERR_FILE_UNEXPECTED,
             "Checkpoint '%s' has format %d, this program reads format %d: restart with the version of tumble that wrote it", s->path, version,
             FORMAT_VERSION);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateBeginLoad(State s, const char path[])
{
  char      reason[256] = "";
  PetscBool good;

  PetscFunctionBeginUser;
  if (s->rank == 0) (void)StateCheckFile(path, reason, sizeof(reason));
  PetscCallMPI(MPI_Bcast(reason, sizeof(reason), MPI_CHAR, 0, s->comm));
  PetscCheck(!reason[0], s->comm, PETSC_ERR_FILE_READ, "Cannot restart from '%s': %s. Give another checkpoint as -sim_restart", path, reason);
  PetscCall(begin(s, path, PETSC_TRUE));
  s->file = open_file(s, path);
  good    = (PetscBool)(s->file >= 0);
  PetscCall(agree(s, &good));
  PetscCheck(good, s->comm, PETSC_ERR_FILE_READ,
             "Cannot restart from '%s': HDF5 cannot open it, it is damaged. Give another checkpoint as -sim_restart", path);
  PetscCall(check_format(s));
  PetscCall(load_mesh(s));
  PetscCall(StateModule(s, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateEnd(State s)
{
  char part[PETSC_MAX_PATH_LEN];
  int  failed[2] = {0, 0}; /* on any rank; errno of rank 0 */

  PetscFunctionBeginUser;
  PetscCall(close_file(s));
  if (s->loading) PetscFunctionReturn(PETSC_SUCCESS);
  failed[0] = s->failed[0] != 0;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, failed, 1, MPI_INT, MPI_MAX, s->comm));
  PetscCall(PetscSNPrintf(part, sizeof(part), "%s.part", s->path));
  if (s->rank == 0 && !failed[0]) failed[1] = settle_file(part, s->path);
  PetscCallMPI(MPI_Bcast(failed, 2, MPI_INT, 0, s->comm));
  if (failed[0] || failed[1]) {
    if (s->rank == 0) (void)remove(part);
    SETERRQ(s->comm, PETSC_ERR_FILE_WRITE, "Cannot write checkpoint '%s': %s%s. Check the disk or choose another -output_dir", s->path,
            failed[1]      ? strerror(failed[1])
            : s->failed[0] ? "HDF5 fails at "
                           : "HDF5 fails on another rank",
            failed[1] ? "" : s->failed);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- visits ---- */

PetscErrorCode StateModule(State s, const char name[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscStrncpy(s->module, name ? name : "", sizeof(s->module)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool StateIsLoading(State s)
{
  return s->loading;
}

PetscBool StateIsSamePartition(State s)
{
  return s->same;
}

PetscErrorCode StateGetSize(State s, const char name[], PetscInt *rows)
{
  char     full[256];
  PetscInt bs;

  PetscFunctionBeginUser;
  PetscCall(full_name(s, name, full, sizeof(full)));
  PetscCall(measure_array(s, full, rows, &bs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateReals(State s, const char name[], PetscInt n, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(transfer_replicated(s, name, TYPE_REAL, n, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateInts(State s, const char name[], PetscInt n, PetscInt v[])
{
  int64_t *w;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &w));
  for (PetscInt i = 0; i < n; i++) w[i] = v[i];
  PetscCall(transfer_replicated(s, name, TYPE_INT, n, w));
  for (PetscInt i = 0; i < n; i++) v[i] = (PetscInt)w[i];
  PetscCall(PetscFree(w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateText(State s, const char name[], char **text)
{
  PetscInt n;

  PetscFunctionBeginUser;
  if (s->loading) {
    PetscCall(StateGetSize(s, name, &n));
    PetscCall(PetscMalloc1(PetscMax(n, 0) + 1, text));
    (*text)[PetscMax(n, 0)] = 0;
  } else n = (PetscInt)strlen(*text);
  PetscCall(transfer_replicated(s, name, TYPE_BYTE, PetscMax(n, 0), *text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own rows [n][bs] of nodes or cells */
static PetscErrorCode transfer_entities(State s, const char name[], const Entities *t, PetscInt bs, PetscReal v[])
{
  PetscReal   *share;
  MPI_Datatype block;

  PetscFunctionBeginUser;
  if (!s->loading || s->same) {
    PetscCall(transfer(s, name, TYPE_REAL, t->own, bs, v));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscMalloc1(t->share.n * bs, &share));
  PetscCall(load_array(s, name, TYPE_REAL, t->share, bs, share));
  PetscCallMPI(MPI_Type_contiguous((PetscMPIInt)bs, MPIU_REAL, &block));
  PetscCallMPI(MPI_Type_commit(&block));
  PetscCall(PetscSFBcastBegin(t->sf, block, share, v, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(t->sf, block, share, v, MPI_REPLACE));
  PetscCallMPI(MPI_Type_free(&block));
  PetscCall(PetscFree(share));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateNodes(State s, const char name[], PetscInt bs, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(transfer_entities(s, name, &s->entity[STATE_NODE], bs, v));
  if (s->loading) PetscCall(s->key.sync(s->key.sync_context, bs, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateCells(State s, const char name[], PetscInt bs, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(transfer_entities(s, name, &s->entity[STATE_CELL], bs, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}
