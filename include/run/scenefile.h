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
   several documents, keys that cannot be an option name, more options than PETSc's table holds; an include that is not
   there, leads back to a scene that includes it, or has a fault itself; "~" that takes away nothing. Anchors and
   aliases are allowed, as in PETSc. */
int SceneFileCheck(const char path[], char message[], size_t len);

/* The same check, and what PETSc cannot read by itself: a scene with 'include: other.yaml' (path relative to the scene)
   says what the other one says, but for what it says itself; '~' as value takes away an option, or all of a mapping.
   And keys with the name of a boundary: what is no letter, digit or dash in it becomes '_' (bc_left wall:
   bc_left_wall).
   A list of points ([[0, 0], [1, 0]]) is a flat list of numbers.
   *options: "name\0value\0file\0..." of *size characters, names flattened and without dash, file where the option
   stands; to be freed. NULL: the scene has neither, and PETSc reads it. */
int SceneFileRead(const char path[], char **options, size_t *size, char message[], size_t len);
