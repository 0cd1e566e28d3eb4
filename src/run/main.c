/* tumble: rigid bodies of any shape moving in a viscous incompressible fluid.

     mpiexec -n N build/tumble runs/scene.yaml -any_petsc_option

   Checks the scene file, hands it to PETSc (the command line wins over it), and runs it. */
#include "compat.h"
#include "report/monitor.h"
#include "base/log.h"
#include "base/opt.h"
#include "run/scene.h"
#include "run/scenefile.h"
#include "cores.h"
#include "failure.h"
#include "shape.h"
#include "shape/host.h"
#include <stdio.h>
#include <stdlib.h>
#include <version.h>
#include <string.h>
#include <strings.h>
#if defined(PETSC_HAVE_CUDA) && defined(OPEN_MPI)
  #include <mpi-ext.h>
#endif

static const char help[] =
  "tumble: particulate flow by the finite element fictitious boundary method.\n"
  "usage: mpiexec -n N build/tumble runs/scene.yaml [-option value ...]\n"
  "Option -scene_dry_run describes the scene without running it; -help lists all options, -help drag those that have to do with drag\n"
  "(-help expert: more, -help petsc: those of PETSc's solvers in this scene, -help markdown, -help man, -help schema: a JSON schema\n"
  "of scene files), -help output the columns and datasets of the results, -version the versions; runs/README.md lists the scenes.\n\n";

/* Rank 0 reads the file, all learn the verdict and what PETSc cannot read by itself (SceneFileRead). */
static int read_scene(const char path[], char **options, size_t *size)
{
  char message[1024] = "";
  int  rank, told[2] = {0, 0};

  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0) {
    told[0] = SceneFileRead(path, options, size, message, sizeof(message));
    told[1] = *options ? (int)*size : -1;
  }
  (void)MPI_Bcast(told, 2, MPI_INT, 0, MPI_COMM_WORLD);
  if (told[0] && rank == 0) fprintf(stderr, "tumble: error: %s\n", message);
  if (told[0] || told[1] < 0) return told[0];
  *size = (size_t)told[1];
  if (rank) *options = (char *)malloc(*size);
  if (!*options) FailureAbort("out of memory for the scene's options");
  (void)MPI_Bcast(*options, told[1], MPI_CHAR, 0, MPI_COMM_WORLD);
  return 0;
}

/* The options of a scene that PETSc cannot read by itself (one that includes another), before PetscInitialize, so that
   the command line goes over them */
static PetscErrorCode insert_options(const char options[], size_t size)
{
  for (const char *name = options, *value; name && name < options + size; name = value + strlen(value) + 1) {
    char dashed[512];

    snprintf(dashed, sizeof(dashed), "-%s", name);
    value = name + strlen(name) + 1;
    PetscCall(PetscOptionsSetValue(NULL, dashed, value));
    value += strlen(value) + 1;
    PetscCall(OptSetFile(dashed, value));
  }
  return PETSC_SUCCESS;
}

/* What the command line asks for instead of a run */
typedef enum {
  RUN,
  HELP,
  HELP_PETSC,
  HELP_OUTPUT,
  VERSION
} Wish;

/* What follows -help up to the end, as one text, if it is words and no scene; else NULL */
static const char *join_words(int n, char **words)
{
  static char text[256];

  text[0] = 0;
  for (int i = 0; i < n; i++) {
    if (strchr(words[i], '.') || (i && words[i][0] == '-') || strlen(text) + strlen(words[i]) + 2 > sizeof(text))
      return NULL;
    if (i) strcat(text, " ");
    strcat(text, words[i]);
  }
  return n ? text : NULL;
}

/* word: what -help asks for, if it is none of its formats and no scene; else NULL */
static Wish find_wish(int argc, char **argv, OptFormat *format, const char **word)
{
  static const char *const FORMATS[] = {"", "expert", "markdown", "man", "schema"};
  Wish                     wish      = RUN;

  *format = OPT_PLAIN;
  *word   = NULL;
  for (int i = 1; i < argc; i++) {
    if (!strcmp(argv[i], "-version") || !strcmp(argv[i], "--version")) return VERSION;
    if (strcmp(argv[i], "-help") && strcmp(argv[i], "--help") && strcmp(argv[i], "-h")) continue;
    wish = i + 1 < argc && !strcmp(argv[i + 1], "petsc") ? HELP_PETSC : HELP;
    if (i + 1 < argc && !strcmp(argv[i + 1], "output")) return HELP_OUTPUT;
    if (wish == HELP_PETSC) strcpy(argv[i + 1], "1"); /* PETSc takes -help for a switch */
    for (int k = 1; k <= OPT_SCHEMA && i + 1 < argc; k++)
      if (!strcmp(argv[i + 1], FORMATS[k])) *format = (OptFormat)k;
    if (*format == OPT_PLAIN && wish == HELP) *word = join_words(argc - i - 1, argv + i + 1);
  }
  return wish;
}

static void print_version(void)
{
  char petsc[256], mpi[MPI_MAX_LIBRARY_VERSION_STRING];
  int  len;

  (void)PetscGetVersion(petsc, sizeof(petsc));
  (void)MPI_Get_library_version(mpi, &len);
  mpi[strcspn(mpi, ",\n")] = 0;
  printf("tumble %s (commit %s)\n%s\n%s\n", TUMBLE_VERSION, TUMBLE_COMMIT, petsc, mpi);
#if defined(PETSC_PKG_HYPRE_VERSION_MAJOR)
  printf("hypre %d.%d.%d\n", PETSC_PKG_HYPRE_VERSION_MAJOR, PETSC_PKG_HYPRE_VERSION_MINOR,
         PETSC_PKG_HYPRE_VERSION_SUBMINOR);
#endif
#if defined(PETSC_PKG_HDF5_VERSION_MAJOR)
  printf("HDF5 %d.%d.%d\n", PETSC_PKG_HDF5_VERSION_MAJOR, PETSC_PKG_HDF5_VERSION_MINOR,
         PETSC_PKG_HDF5_VERSION_SUBMINOR);
#endif
#if defined(PETSC_PKG_MUMPS_VERSION_MAJOR)
  printf("MUMPS %d.%d.%d\n", PETSC_PKG_MUMPS_VERSION_MAJOR, PETSC_PKG_MUMPS_VERSION_MINOR,
         PETSC_PKG_MUMPS_VERSION_SUBMINOR);
#endif
}

/* Options or versions, without a look at the scene. PETSc gets no arguments, or it would print its own help. */
static int print_answer(Wish wish, OptFormat format, const char word[])
{
  int rank, found = 1;

  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (PetscInitializeNoArguments()) return 1;
  if (rank == 0 && wish == VERSION) print_version();
  if (rank == 0 && wish == HELP_OUTPUT) MonitorPrintTables(stdout);
  if (wish == HELP) {
    PetscCall(ShapeDeclareOptions());
    if (rank == 0 && format <= OPT_PLAIN_EXPERT && !word) printf("%s", help);
    if (rank == 0 && word) found = OptPrintMatching(stdout, word);
    else if (rank == 0) OptPrint(stdout, format);
    if (!found)
      fprintf(stderr,
              "tumble: error: no option has to do with '%s': try another word, or -help expert for all of them\n",
              word);
  }
  PetscCall(ShapeFinalize());
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  (void)MPI_Bcast(&found, 1, MPI_INT, 0, MPI_COMM_WORLD);
  MPI_Finalize();
  return !found;
}

/* The options.txt of a run repeats the run, from its beginning and in a directory of its own: where results go and what
   was continued is said anew. */
static PetscErrorCode forget_directories(int argc, char **argv)
{
  static const char *const names[] = {"-output_dir", "-output_overwrite", "-sim_restart"};

  PetscFunctionBeginUser;
  for (int k = 0; k < 3; k++) {
    PetscBool given = PETSC_FALSE;

    for (int i = 1; i < argc; i++) given = (PetscBool)(given || !strcasecmp(argv[i], names[k]));
    if (!given) PetscCall(PetscOptionsClearValue(NULL, names[k]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* PETSc with CUDA ends where MPI does not take arrays of a GPU, unless it is told so; what users say comes later */
static PetscErrorCode say_what_mpi_takes(void)
{
#if defined(PETSC_HAVE_CUDA) && defined(OPEN_MPI)
  if (!MPIX_Query_cuda_support()) return PetscOptionsSetValue(NULL, "-use_gpu_aware_mpi", "0");
#endif
  return PETSC_SUCCESS;
}

int main(int argc, char **argv)
{
  char           path[PETSC_MAX_PATH_LEN] = "", name[256] = "scene", *options = NULL;
  const char    *word;
  size_t         size = 0;
  PetscErrorCode ierr;
  OptFormat      format;
  Wish           wish;

  CoresPrepare();
  MPI_Init(&argc, &argv);
  CoresPin();
  FailurePrepare();
  wish = find_wish(argc, argv, &format, &word);
  if (wish == HELP || wish == HELP_OUTPUT || wish == VERSION) return print_answer(wish, format, word);
  if (SceneFileTake(&argc, argv, path, sizeof(path)) && wish == RUN) {
    int rank;

    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    if (rank == 0) fprintf(stderr, "tumble: error: no scene file given\n%s", help);
    MPI_Finalize();
    return 1;
  }
  if (path[0] && (read_scene(path, &options, &size) || SceneFileStem(path, name, sizeof(name)))) {
    MPI_Finalize();
    return 1;
  }
  ierr = PetscPushErrorHandler(FailureNote, NULL);
  if (!ierr) ierr = insert_options(options, size);
  if (!ierr) ierr = say_what_mpi_takes();
  if (!ierr) ierr = PetscInitialize(&argc, &argv, path[0] && !options ? path : NULL, help);
  free(options);
  if (!ierr) OptSetScene(path);
  if (!ierr && wish == HELP_PETSC) ierr = PetscOptionsSetValue(NULL, "-scene_dry_run", "1");
  if (!ierr) ierr = LogInitialize();
  if (!ierr && SceneFileIsList(path)) ierr = forget_directories(argc, argv);
  if (!ierr) ierr = FailureCatchCrashes();
  if (!ierr) ierr = FailureReserve();
  if (!ierr) ierr = ShapeGuardInstall();
  if (!ierr) ierr = SceneRun(PETSC_COMM_WORLD, name);
  if (ierr) return FailureExit();
  PetscCall(ShapeFinalize());
  PetscCall(OptFinalize());
  PetscCall(LogFinalize());
  ierr = PetscFinalize(); /* the handler was pushed before -malloc_debug could know of it: it is not popped */
  MPI_Finalize();
  return (int)ierr;
}
