/* mpicount: counts what a program sends, through the profiling interface of MPI; to be put before it (LD_PRELOAD).

   MPI_Finalize appends to the file MPICOUNT names, one line a rank and kind: "rank kind calls bytes long_calls
   long_bytes longest". Kind: the name of a collective (bytes: what this rank contributes, or gets if that is more),
   or "message" (point to point, persistent ones too), or "point" (calls alone): points at which this rank waits for
   others: blocking collectives of several ranks, "together", and ends of exchanges and of non-blocking collectives.
   Of what began before the last point ended the end is none: it was under way with that. Nor are gatherings to one
   rank that follow each other. Long: more than LONG bytes. Without MPICOUNT nothing is written. */
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>

#define LONG 512
#define ROOM 65536 /* persistent requests, a power of two */

enum {
  ALLREDUCE,
  REDUCE,
  BCAST,
  SCAN,
  ALLGATHER,
  ALLTOALL,
  GATHER,
  MESSAGE,
  POINT,
  TOGETHER,
  NKIND
};

static const char *const NAME[] = {"allreduce", "reduce", "bcast",   "scan",  "allgather",
                                   "alltoall",  "gather", "message", "point", "together"};

static struct {
  long calls, bytes, long_calls, long_bytes, longest;
} kind[NKIND];

static struct {
  MPI_Request request;
  long        bytes;
} persistent[ROOM];

/* Receives: when they began, in blocking calls that have ended; -1: not begun, or over; 0: something else */
static struct {
  MPI_Request request;
  long        since;
} receive[ROOM];
static long now = 1;

static long bytes_of(long n, MPI_Datatype type)
{
  int size = 0;

  if (type != MPI_DATATYPE_NULL) PMPI_Type_size(type, &size);
  return n * size;
}

static void count(int k, long bytes)
{
  kind[k].calls++;
  kind[k].bytes += bytes;
  if (bytes > kind[k].longest) kind[k].longest = bytes;
  if (bytes <= LONG) return;
  kind[k].long_calls++;
  kind[k].long_bytes += bytes;
}

/* A blocking collective, which all ranks wait in */
static void count_point(MPI_Comm comm)
{
  int size;

  PMPI_Comm_size(comm, &size);
  if (size == 1) return;
  kind[POINT].calls++;
  kind[TOGETHER].calls++;
  now++;
}

/* A gathering or scattering */
static void count_root(MPI_Comm comm, int gathers)
{
  static long last = -1;

  if (!gathers || last != now) count_point(comm);
  last = gathers ? now : -1;
}

static long sum(const int n[], MPI_Comm comm)
{
  int  size;
  long total = 0;

  PMPI_Comm_size(comm, &size);
  for (int i = 0; i < size; i++) total += n[i];
  return total;
}

static long of_all(long n, MPI_Comm comm)
{
  int size;

  PMPI_Comm_size(comm, &size);
  return n * size;
}

/* ---- where a rank waits ---- */

static size_t find_receive(MPI_Request r)
{
  size_t i = ((size_t)r >> 4) * 2654435761u & (ROOM - 1);

  for (size_t tries = 0; receive[i].request && receive[i].request != r; tries++) {
    if (tries == ROOM) abort();
    i = (i + 1) & (ROOM - 1);
  }
  return i;
}

static void mark(MPI_Request r, int receives)
{
  size_t i;

  if (r == MPI_REQUEST_NULL) return;
  i                  = find_receive(r);
  receive[i].request = r;
  receive[i].since   = receives ? now : 0;
}

static void count_wait(int n, const MPI_Request r[])
{
  int waits = 0;

  for (int k = 0; k < n; k++) {
    size_t i;

    if (r[k] == MPI_REQUEST_NULL) continue;
    i = find_receive(r[k]);
    waits |= receive[i].since == now;
    if (receive[i].since > 0) receive[i].since = -1; /* over, or to begin anew */
  }
  if (!waits) return;
  kind[POINT].calls++;
  now++;
}

int MPI_Wait(MPI_Request *r, MPI_Status *status)
{
  count_wait(1, r);
  return PMPI_Wait(r, status);
}

int MPI_Waitall(int n, MPI_Request r[], MPI_Status status[])
{
  count_wait(n, r);
  return PMPI_Waitall(n, r, status);
}

int MPI_Irecv(void *v, int n, MPI_Datatype type, int from, int tag, MPI_Comm comm, MPI_Request *r)
{
  const int err = PMPI_Irecv(v, n, type, from, tag, comm, r);

  mark(*r, 1);
  return err;
}

/* ---- collectives ---- */

int MPI_Allreduce(const void *in, void *out, int n, MPI_Datatype type, MPI_Op op, MPI_Comm comm)
{
  count(ALLREDUCE, bytes_of(n, type));
  count_point(comm);
  return PMPI_Allreduce(in, out, n, type, op, comm);
}

int MPI_Iallreduce(const void *in, void *out, int n, MPI_Datatype type, MPI_Op op, MPI_Comm comm, MPI_Request *r)
{
  const int err = PMPI_Iallreduce(in, out, n, type, op, comm, r);

  count(ALLREDUCE, bytes_of(n, type));
  mark(*r, 1);
  return err;
}

int MPI_Reduce_scatter(const void *in, void *out, const int n[], MPI_Datatype type, MPI_Op op, MPI_Comm comm)
{
  count(REDUCE, bytes_of(sum(n, comm), type));
  count_point(comm);
  return PMPI_Reduce_scatter(in, out, n, type, op, comm);
}

int MPI_Reduce_scatter_block(const void *in, void *out, int n, MPI_Datatype type, MPI_Op op, MPI_Comm comm)
{
  count(REDUCE, bytes_of(of_all(n, comm), type));
  count_point(comm);
  return PMPI_Reduce_scatter_block(in, out, n, type, op, comm);
}

int MPI_Reduce(const void *in, void *out, int n, MPI_Datatype type, MPI_Op op, int root, MPI_Comm comm)
{
  count(REDUCE, bytes_of(n, type));
  count_point(comm);
  return PMPI_Reduce(in, out, n, type, op, root, comm);
}

int MPI_Bcast(void *v, int n, MPI_Datatype type, int root, MPI_Comm comm)
{
  count(BCAST, bytes_of(n, type));
  count_point(comm);
  return PMPI_Bcast(v, n, type, root, comm);
}

int MPI_Scan(const void *in, void *out, int n, MPI_Datatype type, MPI_Op op, MPI_Comm comm)
{
  count(SCAN, bytes_of(n, type));
  count_point(comm);
  return PMPI_Scan(in, out, n, type, op, comm);
}

int MPI_Exscan(const void *in, void *out, int n, MPI_Datatype type, MPI_Op op, MPI_Comm comm)
{
  count(SCAN, bytes_of(n, type));
  count_point(comm);
  return PMPI_Exscan(in, out, n, type, op, comm);
}

int MPI_Allgather(const void *in, int n, MPI_Datatype type, void *out, int m, MPI_Datatype other, MPI_Comm comm)
{
  count(ALLGATHER, of_all(bytes_of(m, other), comm));
  count_point(comm);
  return PMPI_Allgather(in, n, type, out, m, other, comm);
}

int MPI_Allgatherv(const void *in, int n, MPI_Datatype type, void *out, const int m[], const int at[],
                   MPI_Datatype other, MPI_Comm comm)
{
  count(ALLGATHER, bytes_of(sum(m, comm), other));
  count_point(comm);
  return PMPI_Allgatherv(in, n, type, out, m, at, other, comm);
}

int MPI_Alltoall(const void *in, int n, MPI_Datatype type, void *out, int m, MPI_Datatype other, MPI_Comm comm)
{
  count(ALLTOALL, of_all(bytes_of(n, type), comm));
  count_point(comm);
  return PMPI_Alltoall(in, n, type, out, m, other, comm);
}

int MPI_Alltoallv(const void *in, const int n[], const int at[], MPI_Datatype type, void *out, const int m[],
                  const int to[], MPI_Datatype other, MPI_Comm comm)
{
  count(ALLTOALL, bytes_of(sum(n, comm), type));
  count_point(comm);
  return PMPI_Alltoallv(in, n, at, type, out, m, to, other, comm);
}

int MPI_Gather(const void *in, int n, MPI_Datatype type, void *out, int m, MPI_Datatype other, int root, MPI_Comm comm)
{
  count(GATHER, bytes_of(n, type));
  count_root(comm, 1);
  return PMPI_Gather(in, n, type, out, m, other, root, comm);
}

int MPI_Gatherv(const void *in, int n, MPI_Datatype type, void *out, const int m[], const int at[], MPI_Datatype other,
                int root, MPI_Comm comm)
{
  count(GATHER, bytes_of(n, type));
  count_root(comm, 1);
  return PMPI_Gatherv(in, n, type, out, m, at, other, root, comm);
}

int MPI_Scatterv(const void *in, const int n[], const int at[], MPI_Datatype type, void *out, int m, MPI_Datatype other,
                 int root, MPI_Comm comm)
{
  count(GATHER, bytes_of(m, other));
  count_root(comm, 0);
  return PMPI_Scatterv(in, n, at, type, out, m, other, root, comm);
}

/* ---- messages ---- */

int MPI_Send(const void *v, int n, MPI_Datatype type, int to, int tag, MPI_Comm comm)
{
  count(MESSAGE, bytes_of(n, type));
  return PMPI_Send(v, n, type, to, tag, comm);
}

int MPI_Isend(const void *v, int n, MPI_Datatype type, int to, int tag, MPI_Comm comm, MPI_Request *r)
{
  const int err = PMPI_Isend(v, n, type, to, tag, comm, r);

  count(MESSAGE, bytes_of(n, type));
  mark(*r, 0);
  return err;
}

int MPI_Issend(const void *v, int n, MPI_Datatype type, int to, int tag, MPI_Comm comm, MPI_Request *r)
{
  const int err = PMPI_Issend(v, n, type, to, tag, comm, r);

  count(MESSAGE, bytes_of(n, type));
  mark(*r, 0);
  return err;
}

/* Where a request stands, or a free place. Freed ones stay until their handle comes again. */
static size_t place(MPI_Request r)
{
  size_t i = ((size_t)r >> 4) & (ROOM - 1);

  for (size_t tries = 0; persistent[i].request && persistent[i].request != r; tries++) {
    if (tries == ROOM) abort();
    i = (i + 1) & (ROOM - 1);
  }
  return i;
}

int MPI_Send_init(const void *v, int n, MPI_Datatype type, int to, int tag, MPI_Comm comm, MPI_Request *r)
{
  const int err = PMPI_Send_init(v, n, type, to, tag, comm, r);

  persistent[place(*r)].bytes   = bytes_of(n, type);
  persistent[place(*r)].request = *r;
  mark(*r, 0);
  return err;
}

int MPI_Recv_init(void *v, int n, MPI_Datatype type, int from, int tag, MPI_Comm comm, MPI_Request *r)
{
  const int    err = PMPI_Recv_init(v, n, type, from, tag, comm, r);
  const size_t i   = place(*r);

  if (persistent[i].request) persistent[i].bytes = -1; /* a handle that was of a message before */
  mark(*r, 1);
  receive[find_receive(*r)].since = -1; /* not begun yet */
  return err;
}

static void count_start(MPI_Request r)
{
  const size_t i = place(r), k = find_receive(r);

  if (receive[k].request && receive[k].since) receive[k].since = now;

  if (persistent[i].request && persistent[i].bytes >= 0) count(MESSAGE, persistent[i].bytes);
}

int MPI_Start(MPI_Request *r)
{
  count_start(*r);
  return PMPI_Start(r);
}

int MPI_Startall(int n, MPI_Request r[])
{
  for (int i = 0; i < n; i++) count_start(r[i]);
  return PMPI_Startall(n, r);
}

int MPI_Finalize(void)
{
  const char *name = getenv("MPICOUNT");
  int         rank;

  PMPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (name) {
    FILE *f = fopen(name, "a");

    for (int k = 0; f && k < NKIND; k++)
      fprintf(f, "%d %s %ld %ld %ld %ld %ld\n", rank, NAME[k], kind[k].calls, kind[k].bytes, kind[k].long_calls,
              kind[k].long_bytes, kind[k].longest);
    if (f) fclose(f);
  }
  return PMPI_Finalize();
}
