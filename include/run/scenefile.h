/* Scene file: find it among the arguments and check it before PETSc reads it.

   PETSc reads the scene itself (file argument of PetscInitialize), but it takes the last of duplicate keys in
   silence, cannot hold lists of maps, and reports syntax errors without a line. So the file is checked first, with
   libyaml, and every fault is said as "file:line: what, and what to do". No PETSc and no MPI inside: these functions
   may be called before PetscInitialize.
   In a parallel run call SceneFileCheck on one rank and share the answer (MPI_Init first), so that the message
   appears once.
   Option names and values are not looked at here; opt.h does that when they are read. */
#pragma once
#include <stddef.h>

/* The scene file may stand anywhere: "tumble scene.yaml -option value", "tumble -option value scene.yaml". It is the
   first argument, if that does not start with a dash, else the first one that ends in .yaml or .yml and does not follow
   -options_file or -options_file_yaml. It is taken out of argv, which ends in NULL, so that PETSc does not take it for
   the value of the option before it. Returns 0 and fills path, or 1 when there is none (or when it does not fit into
   len characters). */
int SceneFileTake(int *argc, char **argv, char path[], size_t len);

/* "runs/sedimentation.yaml" -> "sedimentation"; "out/dkt/options.txt" -> "dkt-again". Returns 0, or 1 when the stem is
   empty or does not fit (stem is "" then). */
int SceneFileStem(const char path[], char stem[], size_t len);

/* Is the file a list of options in place of a scene, the options.txt of a run? Told by its name. */
int SceneFileIsList(const char path[]);

/* Returns 0 when PETSc can read the file as it was meant. Otherwise 1, with the first fault in message: unreadable or
   empty file, tabs in the indentation, syntax, duplicate keys (also two spellings of one option), lists of maps,
   several documents, keys that cannot be an option name, more options than PETSc's table holds. Anchors, aliases and
   merge keys are allowed, as in PETSc. */
int SceneFileCheck(const char path[], char message[], size_t len);
