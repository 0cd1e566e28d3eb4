/* What a scene file says, as read by scenefile.c for include.c. No PETSc, no MPI. */
#pragma once
#include <stddef.h>
#include <yaml.h>

#define SCENE_OPTIONS_MAX 450 /* of the 512 places of PETSc 3.18; the rest is for command line and solver defaults */

typedef struct {
  char  *name;  /* flattened, without dash */
  char  *value; /* as PETSc makes it; NULL: takes away what an included scene says under this name */
  size_t line;
} SceneOption;

typedef struct {
  const char      *path;
  char            *message; /* [len] the first fault */
  size_t           len;
  yaml_document_t *doc;
  SceneOption     *option; /* [n] none of a list of options */
  size_t           n, capacity;
  char            *include; /* as written, NULL: none */
  size_t           include_line;
  int              renamed; /* keys are named otherwise in options: PETSc must not read the file itself */
  int              nested;  /* holds a list of lists, which PETSc's own reader does not take */
} SceneCheck;

/* Puts "path:line: ..." (line 0: "path: ...") into the message and returns 1. */
__attribute__((format(printf, 3, 4))) int SceneCheckFault(SceneCheck *, size_t line, const char format[], ...);
/* Reads and checks the one file check->path, and keeps its options. Returns 0, or 1 with the fault in the message; free
   in both cases. */
int  SceneCheckFile(SceneCheck *);
void SceneCheckFree(SceneCheck *);
