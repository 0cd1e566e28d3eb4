/* Options with units and ranges.

   Thin wrappers around the PETSc options database: every option of the program is read through them, so that
   each one is checked against its range, is listed by -help with unit and range, and is known when a misspelt
   option needs the nearest valid name. Layer 0; no physics.

   All functions take the full option name with its dash ("-flow_viscosity"), leave *value at its default when the
   option is absent, and stop with PETSC_ERR_USER_INPUT naming option, value, range and unit when it is out of range.
   `unit` is text such as "kg/m^3", "s" or "" (no dimension). Ranges are closed intervals; use PETSC_MIN_REAL /
   PETSC_MAX_REAL (or the integer counterparts) for "no limit"; OPT_POSITIVE as `lower` means "greater than zero".
   Collective on PETSC_COMM_WORLD (all ranks read the same database). */
#pragma once
#include <petscsys.h>

#define OPT_POSITIVE PETSC_MACHINE_EPSILON /* as lower bound: must be > 0; printed as "> 0" */

PetscErrorCode OptReal(const char name[], const char help[], const char unit[], PetscReal lower, PetscReal upper, PetscReal *value);
PetscErrorCode OptInt(const char name[], const char help[], const char unit[], PetscInt lower, PetscInt upper, PetscInt *value);
PetscErrorCode OptBool(const char name[], const char help[], PetscBool *value);

/* One of the strings in `list` (NULL-terminated array of constant strings). *index is default on entry.
   An unknown value is an error that lists the known ones. */
PetscErrorCode OptChoice(const char name[], const char help[], const char *const list[], PetscInt *index);

/* A string; `value` has room for `len` characters and holds the default on entry. */
PetscErrorCode OptString(const char name[], const char help[], char value[], size_t len);

/* Exactly n reals ("1,2" or a YAML list [1, 2]); another number of values is an error that says how many are wanted.
   *found (may be NULL) tells whether the option was given. */
PetscErrorCode OptRealArray(const char name[], const char help[], const char unit[], PetscReal lower, PetscReal upper, PetscInt n, PetscReal value[],
                            PetscBool *found);
PetscErrorCode OptIntArray(const char name[], const char help[], const char unit[], PetscInt lower, PetscInt upper, PetscInt n, PetscInt value[],
                           PetscBool *found);

/* A list of strings. On entry *n is the room in list[]; on exit the number found (0 if absent).
   Each string is allocated; free it with PetscFree. */
PetscErrorCode OptStringArray(const char name[], const char help[], PetscInt *n, char *list[]);

/* Was this option given at all? Registers the name as known. */
PetscErrorCode OptHas(const char name[], const char help[], PetscBool *found);

/* Set a default for a PETSc solver option (with dash): kept only if neither scene nor command line gives it.
   Such a default never counts as an unused option. */
PetscErrorCode OptDefault(const char name[], const char value[]);

/* Stop with an error if scene or command line hold an option that nobody has read, naming the nearest known one.
   Options that PETSc reads only at the end of a run (-log_view, -options_left, -malloc_dump, ...) are exempt.
   Call after all set-up, before the first step. */
PetscErrorCode OptCheckUnused(void);

/* Write all options of the database, one "-name value" per line, to an open file (rank 0 writes; collective). */
PetscErrorCode OptWrite(FILE *file);

/* The same as text, in *text on every rank; free it with PetscFree. Not collective. */
PetscErrorCode OptGetAll(char **text);

/* Forget the table of known names (called before PetscFinalize). */
PetscErrorCode OptFinalize(void);
