/* Failure: see failure.h. */
#include "compat.h"
#include "failure.h"
#include "report/checkpoint.h"
#include <petscblaslapack.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#define MANY 8 /* different errors that are told */
#define TAG  911

#define LIBRARIES (160 << 20) /* bytes: the buffer has 128 MB */

/* What one rank has to say */
typedef struct {
  char      message[2048]; /* PETSc cuts messages there */
  char      position[128]; /* in the code: ranks that came to the same one with bodies of their own tell it once */
  PetscBool alone;         /* raised by fewer than all ranks */
  PetscBool traced;        /* PETSc's trace was wanted, and this rank is the one to print it */
} Failure;

static Failure  failure, other; /* static: there may be no memory left */
static MPI_Comm all = MPI_COMM_WORLD;

void FailurePrepare(void)
{
  (void)MPI_Comm_dup(MPI_COMM_WORLD, &all);
}

/* Is the message enough? */
static PetscBool is_plain(PetscErrorCode code)
{
  switch ((int)code) {
  case PETSC_ERR_USER_INPUT:
  case PETSC_ERR_FILE_OPEN:
  case PETSC_ERR_FILE_READ:
  case PETSC_ERR_FILE_WRITE:
  case PETSC_ERR_FILE_UNEXPECTED:
  case PETSC_ERR_ARG_OUTOFRANGE:
  case PETSC_ERR_ARG_UNKNOWN_TYPE:
  case PETSC_ERR_NOT_CONVERGED:
  case PETSC_ERR_MEM:
  case PETSC_ERR_SUP: return PETSC_TRUE;
  default: return PETSC_FALSE;
  }
}

/* PETSc's own allocators (their error has had several codes) */
static PetscBool lacks_memory(const char *function)
{
  return (PetscBool)(!strncmp(function, "PetscMalloc", 11) || !strncmp(function, "PetscRealloc", 12) ||
                     !strncmp(function, "PetscTrMalloc", 13));
}

/* PETSc says of memory that it cannot get who asked for it. One message for all ranks, wherever each of them was. */
static void note_memory(const char *function, const char *message)
{
  struct rusage used;

  (void)getrusage(RUSAGE_SELF, &used);
  (void)
    snprintf(failure.message, sizeof(failure.message),
             "Out of memory: a rank that had taken %.0f MB was given no more (%s). Use more nodes, fewer ranks a node, or a coarser mesh",
             (double)used.ru_maxrss / 1024, message && message[0] ? message : function);
  (void)snprintf(failure.position, sizeof(failure.position), "memory");
}

PetscErrorCode FailureNote(MPI_Comm comm, int line, const char *function, const char *file, PetscErrorCode code,
                           PetscErrorType type, const char *message, void *ctx)
{
  if (type == PETSC_ERROR_INITIAL) { /* the callers that pass it on report under their own rank only */
    const PetscBool is_memory = lacks_memory(function);
    PetscMPIInt     size = 1, world = 1, rank = 0;

    MPI_Comm_size(comm, &size);
    MPI_Comm_size(MPI_COMM_WORLD, &world);
    MPI_Comm_rank(comm, &rank);
    snprintf(failure.message, sizeof(failure.message), "%s", message && message[0] ? message : "PETSc gives no reason");
    snprintf(failure.position, sizeof(failure.position), "%d %s", line, file);
    if (is_memory) note_memory(function, message);
    failure.alone  = (PetscBool)(size < world);
    failure.traced = (PetscBool)(!is_memory && !is_plain(code) && rank == 0);
  }
  if (failure.traced) (void)PetscTraceBackErrorHandler(comm, line, function, file, code, type, message, ctx);
  return code;
}

/* Code that fails before PETSc can say why, or without its macros, leaves no message */
static void print_error(const char message[])
{
  fflush(stdout);
  fprintf(stderr, "tumble: error: %s\n",
          message[0]
            ? message
            : "A library failed and gave no reason; most often it is out of memory: use more nodes, or fewer ranks a node");
  fflush(stderr);
}

static void print_checkpoint(void)
{
  if (CheckpointGetLast()[0])
    fprintf(stderr, "The last checkpoint is %s: continue from it with -sim_restart\n", CheckpointGetLast());
  fflush(stderr);
}

/* Rank 0 tells the message of another rank, unless one from the same place was told */
static void print_other(void)
{
  static char told[MANY][sizeof(other.position)];
  static int  n;

  for (int i = 0; i < n; i++)
    if (!strcmp(told[i], other.position)) return;
  if (n == MANY) return;
  memcpy(told[n++], other.position, sizeof(other.position));
  print_error(other.message);
}

/* All ranks are here: rank 0 tells what happened, once where ranks came to the same line with bodies of their own. */
static void print_errors(void)
{
  int size, rank;

  MPI_Comm_size(MPI_COMM_WORLD, &size);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank) (void)MPI_Send(&failure, sizeof(failure), MPI_BYTE, 0, TAG, all);
  for (int i = 0; rank == 0 && i < size; i++) {
    other = failure;
    if (i) (void)MPI_Recv(&other, sizeof(other), MPI_BYTE, i, TAG, all, MPI_STATUS_IGNORE);
    print_other();
  }
  if (rank == 0) print_checkpoint();
}

/* ---- crashes ---- */

static void say(const char text[])
{
  if (write(STDERR_FILENO, text, strlen(text)) < 0) return; /* nothing left to tell it to */
}

/* Calls nothing but write and _exit; the launcher ends the other ranks */
static void on_crash(int number)
{
  say("tumble: error: The program crashed: ");
  say(number == SIGFPE    ? "arithmetic error"
      : number == SIGABRT ? "a library gave up"
      : number == SIGILL  ? "no such instruction"
                          : "memory it does not own");
  say(
    ". It may be out of memory (use more nodes, fewer ranks a node, or a coarser mesh); else it is a mistake of the program: please report the "
    "scene, and what -on_error_attach_debugger shows\n");
  if (CheckpointGetLast()[0]) {
    say("The last checkpoint is ");
    say(CheckpointGetLast());
    say(": continue from it with -sim_restart\n");
  }
  _exit(1);
}

PetscErrorCode FailureCatchCrashes(void)
{
  static const char *const NAME[]   = {"-on_error_attach_debugger", "-start_in_debugger", "-no_signal_handler",
                                       "-fp_trap"};
  static const int         SIGNAL[] = {SIGSEGV, SIGBUS, SIGILL, SIGABRT, SIGFPE};
  PetscBool                given = PETSC_FALSE, any = PETSC_FALSE;
  struct sigaction         action;

  PetscFunctionBeginUser;
  for (int i = 0; i < (int)PETSC_STATIC_ARRAY_LENGTH(NAME); i++) {
    PetscCall(PetscOptionsHasName(NULL, NULL, NAME[i], &given));
    any = (PetscBool)(any || given);
  }
  if (any) PetscFunctionReturn(PETSC_SUCCESS);
  memset(&action, 0, sizeof(action));
  sigemptyset(&action.sa_mask);
  action.sa_handler = on_crash;
  action.sa_flags   = SA_ONSTACK;
  for (int i = 0; i < (int)PETSC_STATIC_ARRAY_LENGTH(SIGNAL); i++) (void)sigaction(SIGNAL[i], &action, NULL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FailureReserve(void)
{
  PetscScalar  a      = 1;
  PetscBLASInt n      = 1, pivot, info;
  void        *memory = malloc(LIBRARIES); /* of addresses: not touched */

  PetscFunctionBeginUser;
  PetscCheck(memory, PETSC_COMM_SELF, PETSC_ERR_MEM,
             "Out of memory: a rank is given less than %d MB at its start. Raise the limit (ulimit -v)",
             LIBRARIES >> 20);
  free(memory);
  LAPACKgetrf_(&n, &n, &a, &n, &pivot, &info);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the end ---- */

/* Libraries that hold what the error left open (files of a full disk) may fall over it while they leave */
static void exit_quietly(int number)
{
  (void)number;
  _exit(1);
}

/* Leave together. A rank that is missing after some seconds (or soon, when the error was this rank's own) waits for us
   elsewhere and is not coming. */
int FailureExit(void)
{
  const int   patience = failure.alone ? 50 : 500; /* hundredths of a second */
  MPI_Request request;
  int         done = 0;

  MPI_Ibarrier(all, &request);
  MPI_Test(&request, &done, MPI_STATUS_IGNORE);
  for (int wait = 0; wait < patience && !done; wait++) {
    (void)usleep(10000);
    MPI_Test(&request, &done, MPI_STATUS_IGNORE);
  }
  if (!done) FailureAbort(failure.message);
  print_errors();
  for (int i = 0; i < 4; i++) (void)signal((int[]){SIGSEGV, SIGBUS, SIGABRT, SIGFPE}[i], exit_quietly);
  MPI_Finalize();
  return 1;
}

void FailureAbort(const char message[])
{
  print_error(message);
  print_checkpoint();
  MPI_Abort(MPI_COMM_WORLD, 1);
  _exit(1);
}
