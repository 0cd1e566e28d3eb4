/* Faults on demand, a library for LD_PRELOAD (tools/faults): between MPI_Init and MPI_Finalize it counts what a run
   asks of the system, and lets the k-th of a kind fail on one rank.

     TUMBLE_FAULT=KIND:K:ACTION:RANK   K = 0 only counts. ACTION: fail (this one), lasting (this one and all that
                                       follow) or kill (the process ends there; a write has written half of its bytes)
     TUMBLE_FAULT_FOLDER               files in it count, and those with a relative path
     TUMBLE_FAULT_REPORT               file.<rank>: what failed, how many checkpoints had their names by then, and at
                                       the end the counts

   KIND alloc    malloc and its family, called by the program, its plugins or PETSc: other libraries are theirs to mend
        open     open, creat, fopen, mkdir
        write    write and its family, ftruncate; a stream when it hands its buffer over
        sync     fsync, fdatasync
        rename   rename
        hdf5     any HDF5 call of the program
        plugin   dlopen
        step     the end of a step (kill only)

   A call that fails does nothing. Errors are those of a full disk, or EIO. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <hdf5.h>
#include <link.h>
#include <malloc.h>
#include <mpi.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

enum {
  ALLOC,
  OPEN,
  WRITE,
  SYNC,
  RENAME,
  HDF5,
  PLUGIN,
  STEP,
  NKIND
};

static const char *const KIND[NKIND] = {"alloc", "open", "write", "sync", "rename", "hdf5", "plugin", "step"};

#define MAX_RANGES 128
#define MAX_FILES  1024

static struct {
  int  armed, kind, lasting, kill, report, fired, checkpoints, steps;
  long k, count[NKIND];
  char folder[1024];
} fault = {.kind = -1, .report = -1};

static struct {
  unsigned long from, to;
} range[MAX_RANGES]; /* code of the program, its plugins and PETSc */
static int  nrange;
static char ours[MAX_FILES]; /* by descriptor: a file that counts, open for writing */

/* ---- whose call ---- */

static int note_ranges(struct dl_phdr_info *info, size_t size, void *ctx)
{
  (void)size;
  (void)ctx;
  if (info->dlpi_name[0] && !strstr(info->dlpi_name, "libtumble") && !strstr(info->dlpi_name, "libpetsc") &&
      !strstr(info->dlpi_name, "/shapes/"))
    return 0;
  for (int i = 0; i < info->dlpi_phnum && nrange < MAX_RANGES; i++) {
    const ElfW(Phdr) *p = info->dlpi_phdr + i;

    if (p->p_type != PT_LOAD || !(p->p_flags & PF_X)) continue;
    range[nrange].from = info->dlpi_addr + p->p_vaddr;
    range[nrange].to   = range[nrange].from + p->p_memsz;
    nrange++;
  }
  return 0;
}

static void find_ranges(void)
{
  nrange = 0;
  dl_iterate_phdr(note_ranges, NULL);
}

static int is_ours(const void *caller)
{
  for (int i = 0; i < nrange; i++)
    if ((unsigned long)caller >= range[i].from && (unsigned long)caller < range[i].to) return 1;
  return 0;
}

static int counts_file(const char *path)
{
  return fault.armed && path &&
         (path[0] != '/' || (fault.folder[0] && !strncmp(path, fault.folder, strlen(fault.folder))));
}

/* ---- count, report, fail ---- */

static void report(const char text[])
{
  if (fault.report >= 0 && syscall(SYS_write, fault.report, text, strlen(text)) < 0) _exit(99);
}

static void die(void)
{
  (void)syscall(SYS_kill, getpid(), SIGKILL);
  _exit(99);
}

/* Does this call fail? what, name: for the report. */
static int fails(int kind, const char what[], const char name[], int dies)
{
  char text[512];
  long n;

  if (!fault.armed) return 0;
  n = ++fault.count[kind];
  if (kind != fault.kind || fault.k < 1 || (fault.lasting ? n < fault.k : n != fault.k)) return 0;
  if (!fault.fired++) {
    (void)snprintf(text, sizeof(text), "fired %s %ld step %d checkpoints %d at %s %.300s\n", KIND[kind], n, fault.steps,
                   fault.checkpoints, what, name);
    report(text);
  }
  if (fault.kill && dies) die();
  return 1;
}

static void *next(const char name[])
{
  void *f = dlsym(RTLD_NEXT, name);

  if (!f) {
    report("no such function\n");
    _exit(99);
  }
  return f;
}
#define NEXT(name) \
  static __typeof__(&name) real; \
  if (!real) real = (__typeof__(&name))next(#name)

/* ---- begin and end ---- */

static void arm(void)
{
  const char *spec = getenv("TUMBLE_FAULT"), *path = getenv("TUMBLE_FAULT_REPORT"),
             *folder = getenv("TUMBLE_FAULT_FOLDER");
  char kind[16] = "", action[16] = "fail", name[1024];
  int  mine, rank                = 0;

  PMPI_Comm_rank(MPI_COMM_WORLD, &mine);
  if (spec) (void)sscanf(spec, "%15[^:]:%ld:%15[^:]:%d", kind, &fault.k, action, &rank);
  if (path) {
    (void)snprintf(name, sizeof(name), "%s.%d", path, mine);
    fault.report = (int)syscall(SYS_openat, AT_FDCWD, name, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  }
  if (folder) (void)snprintf(fault.folder, sizeof(fault.folder), "%s", folder);
  for (int i = 0; i < NKIND && mine == rank; i++)
    if (!strcmp(kind, KIND[i])) fault.kind = i;
  fault.lasting = !strcmp(action, "lasting");
  fault.kill    = !strcmp(action, "kill");
  find_ranges();
  fault.armed = 1;
}

int MPI_Init(int *argc, char ***argv)
{
  const int err = PMPI_Init(argc, argv);

  arm();
  return err;
}

int MPI_Finalize(void)
{
  char   text[512];
  size_t n = 0;

  fault.armed = 0;
  n += (size_t)snprintf(text, sizeof(text), "counts");
  for (int i = 0; i < NKIND; i++) n += (size_t)snprintf(text + n, sizeof(text) - n, " %s %ld", KIND[i], fault.count[i]);
  (void)snprintf(text + n, sizeof(text) - n, " checkpoints %d\n", fault.checkpoints);
  report(text);
  return PMPI_Finalize();
}

/* The end of a step: a function of the program's own, which its step calls through the linker. A long passes on a
   PetscInt of either size. */
int CheckpointPoll(void *c, long step, void *due, void *stop)
{
  static int (*real)(void *, long, void *, void *);

  if (!real) real = (int (*)(void *, long, void *, void *))next("CheckpointPoll");
  fault.steps++;
  (void)fails(STEP, "step", "", 1);
  return real(c, step, due, stop);
}

/* ---- memory ---- */

extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t),
  *__libc_memalign(size_t, size_t);

static int fails_alloc(const char what[], size_t size, const void *caller)
{
  char name[32];

  if (!fault.armed || !is_ours(caller)) return 0;
  if (fault.kind == ALLOC && fault.count[ALLOC] + 1 >= fault.k) (void)snprintf(name, sizeof(name), "%zu bytes", size);
  else name[0] = 0;
  if (!fails(ALLOC, what, name, 1)) return 0;
  errno = ENOMEM;
  return 1;
}
#define CALLER __builtin_return_address(0)

void *malloc(size_t size)
{
  return fails_alloc("malloc", size, CALLER) ? NULL : __libc_malloc(size);
}

void *calloc(size_t n, size_t size)
{
  return fails_alloc("calloc", n * size, CALLER) ? NULL : __libc_calloc(n, size);
}

void *realloc(void *p, size_t size)
{
  return fails_alloc("realloc", size, CALLER) ? NULL : __libc_realloc(p, size);
}

void *memalign(size_t align, size_t size)
{
  return fails_alloc("memalign", size, CALLER) ? NULL : __libc_memalign(align, size);
}

void *aligned_alloc(size_t align, size_t size)
{
  return fails_alloc("aligned_alloc", size, CALLER) ? NULL : __libc_memalign(align, size);
}

int posix_memalign(void **p, size_t align, size_t size)
{
  if (fails_alloc("posix_memalign", size, CALLER)) return ENOMEM;
  *p = __libc_memalign(align, size);
  return *p ? 0 : ENOMEM;
}

char *strndup(const char *text, size_t n)
{
  const size_t length = strnlen(text, n);
  char        *copy   = fails_alloc("strndup", length + 1, CALLER) ? NULL : __libc_malloc(length + 1);

  if (copy) {
    memcpy(copy, text, length);
    copy[length] = 0;
  }
  return copy;
}

char *strdup(const char *text)
{
  const size_t size = strlen(text) + 1;
  char        *copy = fails_alloc("strdup", size, CALLER) ? NULL : __libc_malloc(size);

  return copy ? memcpy(copy, text, size) : NULL;
}

/* ---- files ---- */

static int fails_file(int kind, const char what[], const char name[], int error, int dies)
{
  if (!fails(kind, what, name, dies)) return 0;
  errno = error;
  return 1;
}

static int note_file(int fd, int flags)
{
  if (fd >= 0 && fd < MAX_FILES) ours[fd] = (flags & O_ACCMODE) != O_RDONLY;
  return fd;
}

static int open_file(const char what[], const char path[], int flags, mode_t mode)
{
  if (counts_file(path) && fails_file(OPEN, what, path, flags & O_CREAT ? ENOSPC : EIO, 1)) return -1;
  return counts_file(path) ? note_file((int)syscall(SYS_openat, AT_FDCWD, path, flags, mode), flags)
                           : (int)syscall(SYS_openat, AT_FDCWD, path, flags, mode);
}

#define OPEN_LIKE(name) \
  int name(const char *path, int flags, ...) \
  { \
    mode_t  mode = 0; \
    va_list args; \
\
    va_start(args, flags); \
    if (flags & (O_CREAT | O_TMPFILE)) mode = va_arg(args, mode_t); \
    va_end(args); \
    return open_file(#name, path, flags, mode); \
  }
OPEN_LIKE(open)
OPEN_LIKE(open64)

int creat(const char *path, mode_t mode)
{
  return open_file("creat", path, O_CREAT | O_WRONLY | O_TRUNC, mode);
}

int mkdir(const char *path, mode_t mode)
{
  NEXT(mkdir);
  if (counts_file(path) && fails_file(OPEN, "mkdir", path, ENOSPC, 1)) return -1;
  return real(path, mode);
}

int close(int fd)
{
  NEXT(close);
  if (fd >= 0 && fd < MAX_FILES) ours[fd] = 0;
  return real(fd);
}

static int counts_write(int fd)
{
  return fault.armed && fd >= 0 && fd < MAX_FILES && ours[fd];
}

/* Writes and their half before the process ends: `half` is the same call with half of the bytes */
#define WRITE_LIKE(name, args, call, half) \
  ssize_t name args \
  { \
    NEXT(name); \
    if (counts_write(fd) && fails_file(WRITE, #name, "", ENOSPC, 0)) { \
      if (fault.kill) { \
        (void)!half; \
        die(); \
      } \
      errno = ENOSPC; \
      return -1; \
    } \
    return call; \
  }
WRITE_LIKE(write, (int fd, const void *b, size_t n), real(fd, b, n), real(fd, b, n / 2))
WRITE_LIKE(pwrite, (int fd, const void *b, size_t n, off_t at), real(fd, b, n, at), real(fd, b, n / 2, at))
WRITE_LIKE(pwrite64, (int fd, const void *b, size_t n, off64_t at), real(fd, b, n, at), real(fd, b, n / 2, at))
WRITE_LIKE(writev, (int fd, const struct iovec *v, int n), real(fd, v, n), real(fd, v, n / 2))
WRITE_LIKE(pwritev, (int fd, const struct iovec *v, int n, off_t at), real(fd, v, n, at), real(fd, v, n / 2, at))
WRITE_LIKE(pwritev64, (int fd, const struct iovec *v, int n, off64_t at), real(fd, v, n, at), real(fd, v, n / 2, at))

int ftruncate(int fd, off_t length)
{
  NEXT(ftruncate);
  if (counts_write(fd) && fails_file(WRITE, "ftruncate", "", EIO, 1)) return -1;
  return real(fd, length);
}

int fsync(int fd)
{
  NEXT(fsync);
  return fails_file(SYNC, "fsync", "", EIO, 1) ? -1 : real(fd);
}

int fdatasync(int fd)
{
  NEXT(fdatasync);
  return fails_file(SYNC, "fdatasync", "", EIO, 1) ? -1 : real(fd);
}

int rename(const char *from, const char *to)
{
  int err;

  NEXT(rename);
  if (counts_file(to) && fails_file(RENAME, "rename", to, EIO, 1)) return -1;
  err = real(from, to);
  if (!err && fault.armed && strstr(to, "/checkpoint_")) fault.checkpoints++;
  return err;
}

/* ---- streams: libc writes them by calls of its own, so those that count get a writer of ours ---- */

static FILE *stream[MAX_FILES]; /* by descriptor */

static ssize_t stream_write(void *cookie, const char *b, size_t n)
{
  return write((int)(long)cookie, b, n);
}

static ssize_t stream_read(void *cookie, char *b, size_t n)
{
  return read((int)(long)cookie, b, n);
}

static int stream_seek(void *cookie, off64_t *at, int whence)
{
  *at = lseek64((int)(long)cookie, *at, whence);
  return *at < 0 ? -1 : 0;
}

static int stream_close(void *cookie)
{
  stream[(long)cookie] = NULL;
  return close((int)(long)cookie);
}

static FILE *open_stream(const char what[], const char path[], const char mode[],
                         FILE *(*real)(const char *, const char *))
{
  const cookie_io_functions_t io = {stream_read, stream_write, stream_seek, stream_close};
  int                         fd, flags = strchr(mode, '+') ? O_RDWR : O_WRONLY;

  if (!counts_file(path)) return real(path, mode);
  if (fails_file(OPEN, what, path, mode[0] == 'r' ? EIO : ENOSPC, 1)) return NULL;
  if (mode[0] == 'r' && flags == O_WRONLY) return real(path, mode);
  if (mode[0] != 'r') flags |= O_CREAT | (mode[0] == 'w' ? O_TRUNC : O_APPEND);
  fd = note_file((int)syscall(SYS_openat, AT_FDCWD, path, flags | O_CLOEXEC, 0666), flags);
  if (fd < 0) return NULL;
  stream[fd] = fopencookie((void *)(long)fd, mode, io);
  return stream[fd];
}

FILE *fopen(const char *path, const char *mode)
{
  NEXT(fopen);
  return open_stream("fopen", path, mode, real);
}

FILE *fopen64(const char *path, const char *mode)
{
  NEXT(fopen64);
  return open_stream("fopen64", path, mode, real);
}

int fileno(FILE *f)
{
  NEXT(fileno);
  for (int fd = 0; fd < MAX_FILES; fd++)
    if (f && stream[fd] == f) return fd;
  return real(f);
}

/* ---- plugins ---- */

void *dlopen(const char *file, int flags)
{
  void *handle;

  NEXT(dlopen);
  if (fault.armed && is_ours(CALLER) && file && fails(PLUGIN, "dlopen", file, 1))
    return real("/nowhere/fault.so", RTLD_NOW);
  handle = real(file, flags);
  if (fault.armed) find_ranges();
  return handle;
}

/* ---- HDF5 ---- */

#define HDF5_CALL(type, name, args, call, text) \
  type name args \
  { \
    NEXT(name); \
    return fails(HDF5, #name, text, 1) ? (type)-1 : real call; \
  }
HDF5_CALL(hid_t, H5Fcreate, (const char *path, unsigned flags, hid_t a, hid_t b), (path, flags, a, b), path)
HDF5_CALL(hid_t, H5Fopen, (const char *path, unsigned flags, hid_t a), (path, flags, a), path)
HDF5_CALL(herr_t, H5Fflush, (hid_t f, H5F_scope_t scope), (f, scope), "")
HDF5_CALL(herr_t, H5Fclose, (hid_t f), (f), "")
HDF5_CALL(hid_t, H5Dcreate2, (hid_t f, const char *name, hid_t a, hid_t b, hid_t c, hid_t d, hid_t e),
          (f, name, a, b, c, d, e), name)
HDF5_CALL(hid_t, H5Dopen2, (hid_t f, const char *name, hid_t a), (f, name, a), name)
HDF5_CALL(herr_t, H5Dwrite, (hid_t d, hid_t a, hid_t b, hid_t c, hid_t e, const void *v), (d, a, b, c, e, v), "")
HDF5_CALL(herr_t, H5Dread, (hid_t d, hid_t a, hid_t b, hid_t c, hid_t e, void *v), (d, a, b, c, e, v), "")
HDF5_CALL(herr_t, H5Dclose, (hid_t d), (d), "")
HDF5_CALL(hid_t, H5Dget_space, (hid_t d), (d), "")
HDF5_CALL(hid_t, H5Acreate_by_name,
          (hid_t f, const char *o, const char *n, hid_t a, hid_t b, hid_t c, hid_t d, hid_t e),
          (f, o, n, a, b, c, d, e), n)
HDF5_CALL(hid_t, H5Aopen_by_name, (hid_t f, const char *o, const char *n, hid_t a, hid_t b), (f, o, n, a, b), n)
HDF5_CALL(htri_t, H5Aexists_by_name, (hid_t f, const char *o, const char *n, hid_t a), (f, o, n, a), n)
HDF5_CALL(herr_t, H5Awrite, (hid_t a, hid_t t, const void *v), (a, t, v), "")
HDF5_CALL(herr_t, H5Aread, (hid_t a, hid_t t, void *v), (a, t, v), "")
HDF5_CALL(herr_t, H5Aclose, (hid_t a), (a), "")
HDF5_CALL(htri_t, H5Lexists, (hid_t f, const char *name, hid_t a), (f, name, a), name)
HDF5_CALL(hid_t, H5Pcreate, (hid_t c), (c), "")
HDF5_CALL(herr_t, H5Pclose, (hid_t p), (p), "")
HDF5_CALL(herr_t, H5Pset_create_intermediate_group, (hid_t p, unsigned yes), (p, yes), "")
HDF5_CALL(herr_t, H5Pset_alloc_time, (hid_t p, H5D_alloc_time_t t), (p, t), "")
HDF5_CALL(herr_t, H5Pset_fill_time, (hid_t p, H5D_fill_time_t t), (p, t), "")
HDF5_CALL(H5D_layout_t, H5Pget_layout, (hid_t p), (p), "")
HDF5_CALL(int, H5Pget_external_count, (hid_t p), (p), "")
HDF5_CALL(haddr_t, H5Dget_offset, (hid_t d), (d), "")
HDF5_CALL(hid_t, H5Dget_type, (hid_t d), (d), "")
HDF5_CALL(hid_t, H5Dget_create_plist, (hid_t d), (d), "")
HDF5_CALL(htri_t, H5Tequal, (hid_t a, hid_t b), (a, b), "")
#if H5_VERSION_GE(1, 10, 7)
HDF5_CALL(herr_t, H5Pset_file_locking, (hid_t p, hbool_t use, hbool_t ignore), (p, use, ignore), "")
#endif
HDF5_CALL(hid_t, H5Screate, (H5S_class_t c), (c), "")
HDF5_CALL(hid_t, H5Screate_simple, (int n, const hsize_t a[], const hsize_t b[]), (n, a, b), "")
HDF5_CALL(herr_t, H5Sselect_hyperslab,
          (hid_t s, H5S_seloper_t op, const hsize_t a[], const hsize_t b[], const hsize_t c[], const hsize_t d[]),
          (s, op, a, b, c, d), "")
HDF5_CALL(herr_t, H5Sselect_none, (hid_t s), (s), "")
HDF5_CALL(int, H5Sget_simple_extent_ndims, (hid_t s), (s), "")
HDF5_CALL(int, H5Sget_simple_extent_dims, (hid_t s, hsize_t a[], hsize_t b[]), (s, a, b), "")
HDF5_CALL(herr_t, H5Sclose, (hid_t s), (s), "")
HDF5_CALL(hid_t, H5Tcopy, (hid_t t), (t), "")
HDF5_CALL(herr_t, H5Tset_size, (hid_t t, size_t n), (t, n), "")
HDF5_CALL(herr_t, H5Tclose, (hid_t t), (t), "")
