/* tumble: rigid bodies of any shape moving in a viscous incompressible fluid.

     mpiexec -n N build/tumble runs/scene.yaml -any_petsc_option

   Checks the scene file, hands it to PETSc (the command line wins over it), and runs it. */
#include "compat.h"
#include "log.h"
#include "opt.h"
#include "scene.h"
#include "scenefile.h"
#include "shape.h"

static const char help[] = "tumble: particulate flow by the finite element fictitious boundary method.\n"
                           "usage: mpiexec -n N build/tumble runs/scene.yaml [-option value ...]\n"
                           "-scene_dry_run describes the scene without running it; README.md and runs/README.md list the scenes.\n\n";

/* User mistakes get their message alone, once; everything else also PETSc's trace. An error that one rank meets alone ends all of them. */
static PetscErrorCode print_error(MPI_Comm comm, int line, const char *function, const char *file, PetscErrorCode code, PetscErrorType type, const char *message, void *ctx)
{
  const PetscBool user = (PetscBool)(code == PETSC_ERR_USER_INPUT || code == PETSC_ERR_FILE_OPEN || code == PETSC_ERR_FILE_WRITE || code == PETSC_ERR_FILE_UNEXPECTED || code == PETSC_ERR_ARG_OUTOFRANGE || code == PETSC_ERR_NOT_CONVERGED || code == PETSC_ERR_SUP);
  PetscMPIInt     size = 1, world = 1, rank = 0;

  MPI_Comm_size(comm, &size);
  MPI_Comm_size(MPI_COMM_WORLD, &world);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (type == PETSC_ERROR_INITIAL && (rank == 0 || size < world)) {
    fflush(stdout);
    fprintf(stderr, "tumble: error: %s\n", message ? message : "unknown error");
    fflush(stderr);
  }
  if (!user) (void)PetscTraceBackErrorHandler(comm, line, function, file, code, type, message, ctx);
  if (size < world) MPI_Abort(MPI_COMM_WORLD, 1);
  return code;
}

/* All ranks have the error: leave together. A rank that is missing after some seconds is not coming. */
static int leave_after_error(void)
{
  MPI_Request request;
  int         done = 0;

  MPI_Ibarrier(MPI_COMM_WORLD, &request);
  for (int wait = 0; wait < 500 && !done; wait++) {
    MPI_Test(&request, &done, MPI_STATUS_IGNORE);
    if (!done) PetscSleep(0.01);
  }
  if (!done) MPI_Abort(MPI_COMM_WORLD, 1);
  MPI_Finalize();
  return 1;
}

/* Rank 0 checks the file, all learn the verdict. */
static int check_scene(const char path[])
{
  char message[1024] = "";
  int  rank, bad = 0;

  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0) bad = SceneFileCheck(path, message, sizeof(message));
  (void)MPI_Bcast(&bad, 1, MPI_INT, 0, MPI_COMM_WORLD);
  if (bad && rank == 0) fprintf(stderr, "tumble: error: %s\n", message);
  return bad;
}

int main(int argc, char **argv)
{
  char           path[PETSC_MAX_PATH_LEN] = "", name[256] = "scene";
  PetscErrorCode ierr;
  PetscBool      wants_help = PETSC_FALSE;

  MPI_Init(&argc, &argv);
  for (int i = 1; i < argc; i++) wants_help = (PetscBool)(wants_help || !strcmp(argv[i], "-help") || !strcmp(argv[i], "--help"));
  if (SceneFileName(argc, argv, path, sizeof(path)) && !wants_help) {
    int rank;

    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    if (rank == 0) fprintf(stderr, "tumble: error: no scene file given\n%s", help);
    MPI_Finalize();
    return 1;
  }
  if (path[0] && (check_scene(path) || SceneFileStem(path, name, sizeof(name)))) {
    MPI_Finalize();
    return 1;
  }
  ierr = PetscInitialize(&argc, &argv, path[0] ? path : NULL, help);
  if (ierr) return 1;
  PetscCall(PetscPushErrorHandler(print_error, NULL));
  if (wants_help && !path[0]) PetscCall(PetscOptionsSetValue(NULL, "-scene_dry_run", "1"));
  ierr = LogInitialize();
  if (!ierr) ierr = SceneRun(name);
  if (ierr) return leave_after_error();
  PetscCall(ShapeFinalize());
  PetscCall(OptFinalize());
  PetscCall(PetscPopErrorHandler());
  ierr = PetscFinalize();
  MPI_Finalize();
  return (int)ierr;
}
