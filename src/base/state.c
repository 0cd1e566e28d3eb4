/* State: see state.h. What a checkpoint is, on top of hdf5.h: checksums, the mesh by places, files that appear when
   they are whole. */
#include "compat.h"
#include "base/state.h"
#include "base/hdf5.h"
#include "base/pointmap.h"
#include "base/rowtype.h"
#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define FORMAT_NAME    "tumble checkpoint"
#define FORMAT_VERSION 1

/* Nodes or cells: own rows here; when loading another partition, the even share of the file's rows that this rank
   reads, and the way from there */
typedef struct {
  Hdf5Rows own, piece;
  PetscSF  sf;
} Entities;

struct _p_State {
  StateKeys   key; /* its x are ours */
  MPI_Comm    comm;
  PetscMPIInt rank, size;
  Entities    entity[2];
  char        path[PETSC_MAX_PATH_LEN], module[64];
  PetscBool   open, loading, same;
  Hdf5        file;
};

static const char *const ENTITY[2] = {"nodes", "cells"};

/* ---- small tools ---- */

/* Sum over the entries of bits times an odd number by their place; the same for every distribution. Collective. */
static PetscErrorCode compute_checksum(State s, Hdf5Type t, Hdf5Rows rows, PetscInt bs, const void *v, uint64_t *sum)
{
  uint64_t mine = 0, index = 2 * (uint64_t)rows.start * (uint64_t)bs + 1;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < rows.n * bs; i++, index += 2) {
    uint64_t word;

    if (t == HDF5_BYTE) word = ((const unsigned char *)v)[i];
    else memcpy(&word, (const char *)v + 8 * i, 8);
    word = (word ^ (word >> 32)) * 0x9e3779b97f4a7c15u;
    mine += (word ^ (word >> 29)) * index;
  }
  PetscCallMPI(MPI_Allreduce(&mine, sum, 1, MPI_UINT64_T, MPI_SUM, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode full_name(State s, const char name[], char full[], size_t len)
{
  PetscFunctionBeginUser;
  PetscCheck(s->open, s->comm, PETSC_ERR_ARG_WRONGSTATE, "State '%s' is visited outside of StateBegin... and StateEnd",
             name);
  PetscCall(PetscSNPrintf(full, len, "/%s%s%s", s->module, s->module[0] ? "/" : "", name));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- arrays ---- */

static PetscErrorCode save_array(State s, const char name[], Hdf5Type t, Hdf5Rows rows, PetscInt bs, const void *v)
{
  char     full[256];
  uint64_t sum;

  PetscFunctionBeginUser;
  PetscCall(full_name(s, name, full, sizeof(full)));
  PetscCall(compute_checksum(s, t, rows, bs, v, &sum));
  PetscCall(Hdf5Write(s->file, full, t, rows, bs, v));
  PetscCall(Hdf5WriteAttribute(s->file, full, "checksum", HDF5_UINT64, 1, &sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode load_array(State s, const char name[], Hdf5Type t, Hdf5Rows rows, PetscInt bs, void *v)
{
  char      full[256];
  uint64_t  sum, stored = 0;
  PetscInt  nrow, ncol;
  PetscBool good;

  PetscFunctionBeginUser;
  PetscCall(full_name(s, name, full, sizeof(full)));
  PetscCall(Hdf5GetSize(s->file, full, &nrow, &ncol));
  PetscCheck(nrow >= 0, s->comm, PETSC_ERR_USER_INPUT,
             "Checkpoint '%s' has no '%s': it was written by another version or with options that leave it out; restart with the options of that run",
             s->path, full);
  PetscCheck((nrow == rows.total && ncol == bs), s->comm, PETSC_ERR_USER_INPUT,
             "Checkpoint '%s' has %" PetscInt_FMT " x %" PetscInt_FMT " values of '%s', this scene needs %" PetscInt_FMT
             " x %" PetscInt_FMT ": it belongs to another scene",
             s->path, nrow, ncol, full, rows.total, bs);
  PetscCall(Hdf5Read(s->file, full, t, rows, bs, v, &good));
  if (good) PetscCall(Hdf5ReadAttribute(s->file, full, "checksum", HDF5_UINT64, 1, &stored, &good));
  if (good) PetscCall(compute_checksum(s, t, rows, bs, v, &sum));
  PetscCheck(good && sum == stored, s->comm, PETSC_ERR_FILE_READ,
             "Checkpoint '%s' is damaged: '%s' %s. Restart from an earlier one (-sim_restart FILE)", s->path, full,
             good ? "has not the checksum it was written with" : "cannot be read");
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode transfer(State s, const char name[], Hdf5Type t, Hdf5Rows rows, PetscInt bs, void *v)
{
  PetscFunctionBeginUser;
  if (s->loading) PetscCall(load_array(s, name, t, rows, bs, v));
  else PetscCall(save_array(s, name, t, rows, bs, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* As transfer, for an array [n] that every rank holds: rank 0's goes into the file and comes from there */
static PetscErrorCode transfer_replicated(State s, const char name[], Hdf5Type t, PetscInt n, void *v)
{
  const Hdf5Rows rows = s->rank == 0 ? (Hdf5Rows){n, 0, n} : (Hdf5Rows){0, n, n};
  PetscMPIInt    count;

  PetscFunctionBeginUser;
  PetscCall(PetscMPIIntCast(n, &count));
  PetscCall(transfer(s, name, t, rows, 1, v));
  if (s->loading) PetscCallMPI(MPI_Bcast(v, count, t == HDF5_BYTE ? MPI_BYTE : MPI_INT64_T, 0, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- files ---- */

/* Rank 0: the file is on disk under its name, or errno */
static int commit_file(const char partial[], const char path[])
{
  char dir[PETSC_MAX_PATH_LEN], *slash;
  int  fd = open(partial, O_RDWR), err = 0;

  if (fd < 0) return errno;
  if (fsync(fd)) err = errno;
  (void)close(fd);
  if (!err && rename(partial, path)) err = errno;
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
  const StateKeys *k          = &s->key;
  int64_t          partial[2] = {k->n[STATE_NODE], k->n[STATE_CELL]},
          size[3]             = {k->dim, k->total[STATE_CELL], k->total[STATE_NODE]};

  PetscFunctionBeginUser;
  PetscCall(transfer_replicated(s, "size", HDF5_INT64, 3, size));
  PetscCall(save_array(s, "partition", HDF5_INT64, (Hdf5Rows){1, s->rank, s->size}, 2, partial));
  for (int e = 0; e < 2; e++) PetscCall(save_array(s, ENTITY[e], HDF5_REAL, s->entity[e].own, k->dim, k->x[e]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is the file's distribution of the mesh, bit for bit, this run's own? Then it can be continued bit for bit. */
static PetscErrorCode compare_partition(State s)
{
  PetscInt nrow, ncol;
  int64_t  partial[2];

  PetscFunctionBeginUser;
  PetscCall(Hdf5GetSize(s->file, "/mesh/partition", &nrow, &ncol));
  s->same = (PetscBool)(nrow == s->size && ncol == 2);
  if (!s->same) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(load_array(s, "partition", HDF5_INT64, (Hdf5Rows){1, s->rank, s->size}, 2, partial));
  s->same = (PetscBool)(partial[0] == s->key.n[STATE_NODE] && partial[1] == s->key.n[STATE_CELL]);
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &s->same, 1, COMPAT_MPI_BOOL, MPI_LAND, s->comm));
  for (int e = 0; e < 2 && s->same; e++) {
    const PetscInt n = s->entity[e].own.n * s->key.dim;
    PetscReal     *x;

    PetscCall(PetscMalloc1(n, &x));
    PetscCall(load_array(s, ENTITY[e], HDF5_REAL, s->entity[e].own, s->key.dim, x));
    s->same = (PetscBool)(n == 0 || !memcmp(x, s->key.x[e], (size_t)n * sizeof(*x)));
    PetscCall(PetscFree(x));
    PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &s->same, 1, COMPAT_MPI_BOOL, MPI_LAND, s->comm));
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
    PetscInt  missing, n = PETSC_DECIDE;

    PetscCall(PetscSplitOwnership(s->comm, &n, &t->own.total));
    PetscCall(Hdf5SpreadRows(s->comm, n, &t->piece));
    PetscCall(PetscMalloc1(t->piece.n * dim, &x));
    PetscCall(load_array(s, ENTITY[e], HDF5_REAL, t->piece, dim, x));
    PetscCall(
      PointMapCreate(s->comm, dim, s->key.tolerance, t->piece.n, x, t->own.n, s->key.x[e], &t->sf, &missing, x0));
    PetscCall(PetscFree(x));
    PetscCheck(!missing, s->comm, PETSC_ERR_USER_INPUT,
               "Checkpoint '%s' has another mesh: %" PetscInt_FMT " of %" PetscInt_FMT
               " %s of this scene are not in it, one at (%g, %g, %g). "
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
  PetscCall(transfer_replicated(s, "size", HDF5_INT64, 3, size));
  PetscCheck(size[0] == k->dim && size[1] == k->total[STATE_CELL] && size[2] == k->total[STATE_NODE], s->comm,
             PETSC_ERR_USER_INPUT,
             "Checkpoint '%s' has another mesh: %dD with %lld cells and %lld nodes, this scene %dD with %" PetscInt_FMT
             " and %" PetscInt_FMT ". Restart with the -mesh_ options of the run that wrote it",
             s->path, (int)size[0], (long long)size[1], (long long)size[2], (int)k->dim, k->total[STATE_CELL],
             k->total[STATE_NODE]);
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
  PetscCallMPI(MPI_Comm_rank(comm, &s->rank));
  PetscCallMPI(MPI_Comm_size(comm, &s->size));
  for (int e = 0; e < 2; e++) s->entity[e].own = (Hdf5Rows){key->n[e], key->start[e], key->total[e]};
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
  s->loading = loading;
  s->open    = PETSC_TRUE;
  PetscCall(StateModule(s, "mesh"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateBeginSave(State s, const char path[])
{
  const PetscInt version = FORMAT_VERSION;
  char           partial[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  PetscCall(begin(s, path, PETSC_FALSE));
  PetscCall(PetscSNPrintf(partial, sizeof(partial), "%s.part", path));
  PetscCall(Hdf5Create(s->comm, partial, &s->file));
  PetscCall(Hdf5WriteAttribute(s->file, "/", "format", HDF5_BYTE, sizeof(FORMAT_NAME), FORMAT_NAME));
  PetscCall(Hdf5WriteAttribute(s->file, "/", "version", HDF5_INT, 1, &version));
  PetscCall(save_mesh(s));
  PetscCall(StateModule(s, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Format and version: is the file one of ours? */
static PetscErrorCode check_format(State s)
{
  char      format[sizeof(FORMAT_NAME)] = "";
  PetscInt  version                     = 0;
  PetscBool ours;

  PetscFunctionBeginUser;
  PetscCall(Hdf5ReadAttribute(s->file, "/", "format", HDF5_BYTE, sizeof(format), format, &ours));
  ours = (PetscBool)(ours && !strncmp(format, FORMAT_NAME, sizeof(format)));
  if (ours) PetscCall(Hdf5ReadAttribute(s->file, "/", "version", HDF5_INT, 1, &version, &ours));
  PetscCheck(ours, s->comm, PETSC_ERR_FILE_UNEXPECTED,
             "'%s' is an HDF5 file, but no checkpoint of tumble: give one as -sim_restart (checkpoint_<step>.h5)",
             s->path);
  PetscCheck(version == FORMAT_VERSION, s->comm, PETSC_ERR_FILE_UNEXPECTED,
             "Checkpoint '%s' has format %" PetscInt_FMT
             ", this program reads format %d: restart with the version of tumble that wrote it",
             s->path, version, FORMAT_VERSION);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateBeginLook(State s, const char path[])
{
  char      reason[256] = "";
  PetscBool good;

  PetscFunctionBeginUser;
  if (s->rank == 0) (void)Hdf5CheckFile(path, reason, sizeof(reason));
  PetscCallMPI(MPI_Bcast(reason, sizeof(reason), MPI_CHAR, 0, s->comm));
  PetscCheck(!reason[0], s->comm, PETSC_ERR_FILE_READ,
             "Cannot restart from '%s': %s. Give another checkpoint as -sim_restart", path, reason);
  PetscCall(begin(s, path, PETSC_TRUE));
  PetscCall(Hdf5Open(s->comm, path, &s->file, &good));
  PetscCheck(good, s->comm, PETSC_ERR_FILE_READ,
             "Cannot restart from '%s': HDF5 cannot open it, it is damaged. Give another checkpoint as -sim_restart",
             path);
  PetscCall(check_format(s));
  PetscCall(StateModule(s, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateBeginLoad(State s, const char path[])
{
  PetscFunctionBeginUser;
  PetscCall(StateBeginLook(s, path));
  PetscCall(StateModule(s, "mesh"));
  PetscCall(load_mesh(s));
  PetscCall(StateModule(s, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateEnd(State s)
{
  char partial[PETSC_MAX_PATH_LEN], reason[256];
  int  failed[2] = {0, 0}; /* of HDF5; errno of rank 0 */

  PetscFunctionBeginUser;
  s->open = PETSC_FALSE;
  PetscCall(Hdf5Close(&s->file, reason, sizeof(reason)));
  if (s->loading) PetscFunctionReturn(PETSC_SUCCESS);
  failed[0] = reason[0] != 0;
  PetscCall(PetscSNPrintf(partial, sizeof(partial), "%s.part", s->path));
  if (s->rank == 0 && !failed[0]) failed[1] = commit_file(partial, s->path);
  PetscCallMPI(MPI_Bcast(&failed[1], 1, MPI_INT, 0, s->comm));
  if ((failed[0] || failed[1]) && s->rank == 0) (void)remove(partial);
  PetscCheck(!failed[0] && !failed[1], s->comm, PETSC_ERR_FILE_WRITE,
             "Cannot write checkpoint '%s': %s. Check the disk or choose another -output_dir", s->path,
             failed[1] ? strerror(failed[1]) : reason);
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
  PetscCall(Hdf5GetSize(s->file, full, rows, &bs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateHas(State s, const char name[], PetscBool *has)
{
  PetscInt rows = 0;

  PetscFunctionBeginUser;
  if (s->loading) PetscCall(StateGetSize(s, name, &rows));
  *has = (PetscBool)(rows >= 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateReals(State s, const char name[], PetscInt n, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(transfer_replicated(s, name, HDF5_REAL, n, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateInts(State s, const char name[], PetscInt n, PetscInt v[])
{
  int64_t *w;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &w));
  for (PetscInt i = 0; i < n; i++) w[i] = v[i];
  PetscCall(transfer_replicated(s, name, HDF5_INT64, n, w));
  for (PetscInt i = 0; i < n; i++) v[i] = (PetscInt)w[i];
  PetscCall(PetscFree(w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StateRows(State s, const char name[], PetscBool integers, PetscInt n, void *v)
{
  Hdf5Rows rows;

  PetscFunctionBeginUser;
  PetscCall(Hdf5SpreadRows(s->comm, n, &rows));
  PetscCall(transfer(s, name, integers ? HDF5_INT64 : HDF5_REAL, rows, 1, v));
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
  PetscCall(transfer_replicated(s, name, HDF5_BYTE, PetscMax(n, 0), *text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own rows [n][bs] of nodes or cells */
static PetscErrorCode transfer_entities(State s, const char name[], const Entities *t, PetscInt bs, PetscReal v[])
{
  PetscReal   *piece;
  MPI_Datatype block;

  PetscFunctionBeginUser;
  if (!s->loading || s->same) {
    PetscCall(transfer(s, name, HDF5_REAL, t->own, bs, v));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscMalloc1(t->piece.n * bs, &piece));
  PetscCall(load_array(s, name, HDF5_REAL, t->piece, bs, piece));
  PetscCall(RowTypeCreate(bs, &block));
  PetscCall(PetscSFBcastBegin(t->sf, block, piece, v, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(t->sf, block, piece, v, MPI_REPLACE));
  PetscCall(RowTypeDestroy(&block));
  PetscCall(PetscFree(piece));
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
