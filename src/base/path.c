/* Paths in options: those of a scene are relative to its file, those of the command line to the working folder. See
   OptSetScene in opt.h. */
#include "compat.h"
#include "base/runcomm.h"
#include "optimpl.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static char scene_folder[PETSC_MAX_PATH_LEN]; /* with a slash at its end; "" for the working folder */

/* Options that stand in a file which the scene includes */
static struct {
  struct {
    char *name, *folder;
  } * option;
  size_t n;
} elsewhere;

/* Length of "folder/" in "folder/file" */
static int folder_length(const char file[])
{
  const char *slash = strrchr(file, '/');

  return slash ? (int)(slash - file) + 1 : 0;
}

void OptSetScene(const char file[])
{
  snprintf(scene_folder, sizeof(scene_folder), "%.*s", folder_length(file), file);
}

PetscErrorCode OptSetFile(const char name[], const char file[])
{
  void *more   = realloc(elsewhere.option, (elsewhere.n + 1) * sizeof(*elsewhere.option));
  char *copy   = strdup(name);
  char *folder = strndup(file, (size_t)folder_length(file));

  if (more) elsewhere.option = more;
  if (more && copy && folder) {
    elsewhere.option[elsewhere.n].name   = copy;
    elsewhere.option[elsewhere.n].folder = folder;
    elsewhere.n++;
    return PETSC_SUCCESS;
  }
  free(copy);
  free(folder);
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_MEM, "Out of memory for the options of %s", file);
}

void OptForgetFiles(void)
{
  for (size_t i = 0; i < elsewhere.n; i++) {
    free(elsewhere.option[i].name);
    free(elsewhere.option[i].folder);
  }
  free(elsewhere.option);
  elsewhere.option = NULL;
  elsewhere.n      = 0;
}

static const char *folder_of(const char name[])
{
  for (size_t i = 0; i < elsewhere.n; i++)
    if (OptSameName(elsewhere.option[i].name, name)) return elsewhere.option[i].folder;
  return scene_folder;
}

PetscBool OptIsArgument(const char name[])
{
  int    argc = 0;
  char **argv = NULL;

  (void)PetscGetArgs(&argc, &argv);
  for (int i = 1; i < argc; i++) {
    if (OptSameName(argv[i] + !strncmp(argv[i], "--", 2), name)) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* Is the name a word of PETSC_OPTIONS? */
static PetscBool is_in_environment(const char name[])
{
  const char  *text = getenv("PETSC_OPTIONS"), *at = text;
  const size_t n = strlen(name);

  for (; at && (at = strstr(at, name)); at += n) {
    if ((at == text || at[-1] == ' ') && (at[n] == ' ' || !at[n])) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

static PetscErrorCode append_path(const char folder[], const char path[], int n, char all[], size_t len)
{
  char one[2 * PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  snprintf(one, sizeof(one), "%s%s%.*s", all[0] ? ":" : "", path[0] == '/' ? "" : folder, n, path);
  PetscCheck(strlen(all) + strlen(one) < len, RunComm(), PETSC_ERR_USER_INPUT, "Path '%s' has more than %zu characters",
             path, len - 1);
  PetscCall(PetscStrlcat(all, one, len));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Every path of the text that is not absolute, behind the folder. */
static PetscErrorCode insert_paths(const char folder[], OptPaths kind, const char text[], char all[], size_t len)
{
  PetscFunctionBeginUser;
  all[0] = 0;
  for (const char *at = text; at;) {
    const char *end = kind == OPT_PATHS ? strchr(at, ':') : NULL;

    if (*at && end != at) PetscCall(append_path(folder, at, end ? (int)(end - at) : (int)strlen(at), all, len));
    at = end ? end + 1 : NULL;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptResolvePaths(const char name[], OptPaths kind, char value[], size_t len)
{
  const PetscBool typed = (PetscBool)(OptIsArgument(name) || is_in_environment(name));
  char            seen[16 * PETSC_MAX_PATH_LEN], absolute[16 * PETSC_MAX_PATH_LEN], here[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  PetscCall(insert_paths(typed ? "" : folder_of(name), kind, value, seen, PetscMin(len, sizeof(seen))));
  PetscCall(PetscStrncpy(value, seen, len));
  if (!seen[0] || !getcwd(here, sizeof(here) - 1)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscStrlcat(here, "/", sizeof(here)));
  PetscCall(insert_paths(here, kind, seen, absolute, sizeof(absolute)));
  PetscCall(PetscOptionsSetValue(NULL, name, absolute));
  PetscFunctionReturn(PETSC_SUCCESS);
}
