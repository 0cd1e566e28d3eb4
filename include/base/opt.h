/* Options, declared as data and read by name.

   Each room declares its options in one table, src/<room>/options.c, of rows OptSpec. Everything comes from these
   rows: conversion and range check when an option is read, advice for one that nobody reads, -help,
   runs/reference/OPTIONS.md and the manual page. The readers take the full name with its dash ("-flow_viscosity"),
   leave *value at its default when the option is absent, and stop with PETSC_ERR_USER_INPUT naming option, value,
   range and unit when it does not fit its row. To read a name without a row, by a reader of another type, or with
   another default or other words than the row has, is a mistake of the program: PETSC_ERR_PLIB.
   Collective on the communicator of the run (all ranks read the same database). */
#pragma once
#include <math.h>
#include <petscsys.h>

typedef enum {
  OPT_REAL,
  OPT_INT,
  OPT_BOOL,
  OPT_CHOICE,
  OPT_STRING,
  OPT_REALS,
  OPT_INTS,
  OPT_STRINGS
} OptType;

typedef enum {
  OPT_NO_PATH,
  OPT_PATH,
  OPT_PATHS /* separated by colons */
} OptPaths;

/* Closed intervals for lower, upper; greater than zero is OPT_POSITIVE. */
#define OPT_POSITIVE    2.2250738585072014e-308 /* the smallest normal number: an epsilon has a unit */
#define OPT_ANY         -INFINITY, INFINITY
#define OPT_ABOVE_ZERO  OPT_POSITIVE, INFINITY
#define OPT_FROM(lower) (lower), INFINITY

typedef struct {
  const char *name; /* with dash; <word> stands for a name of the scene: "-particle_<group>_density" */
  OptType     type;
  const char *unit;         /* "kg/m^3", "s"; "" for none */
  double      lower, upper; /* of every number in it */
  const char *value;        /* default as shown; a single number or word is compared with the reader's; "" for none */
  const char *help;         /* one sentence, no full stop */
  const char *when;         /* NULL, or the option with which it is read: "-sim_adapt true" */
  const char *choices;      /* of OPT_CHOICE: "be, cn, bdf2" */
  PetscBool   expert;       /* shown by -help expert only: tolerances, thresholds */
  OptPaths    path;         /* of OPT_STRING: a file or folder to read, see OptSetScene */
  const char *variables; /* of OPT_REALS: NULL, or what each value may be an expression of, "x, y, z, t": base/expr.h */
  const char *old;       /* former name, refused with the new one: OptCheckRenamed; NULL for none */
  const char *old_words; /* of OPT_CHOICE: former choices, each with the present one: "snap aligned"; NULL for none */
  const char *also;  /* what others call it, for advice alone: its last words, "nu, mu"; with `choices` see `words` */
  const char *words; /* of OPT_CHOICE: what others call its choices, for advice alone: "symmetry slip, wall no_slip" */
  const char *find;  /* keywords, beside `also`, by which -help WORD finds it: "drag, lift"; NULL for none */
} OptSpec;

/* OPT_TABLE("flow: fluid and boundary conditions", SPECS) at the end of a room's options.c. A constructor of the
   library, so that a program that creates one module alone knows all options as well; hence no PETSc in OptDeclare. */
#define OPT_TABLE(title, specs) \
  __attribute__((constructor)) static void declare_options(void) \
  { \
    OptDeclare(title, specs, sizeof(specs) / sizeof((specs)[0])); \
  }
void OptDeclare(const char title[], const OptSpec specs[], size_t n);

/* One row known at run time only, as of a shape's plugin; copied. In place of an earlier one of that name; one whose
   name has a placeholder stands beside those with another `when`, for printing. Rows of tables without a placeholder
   win. */
PetscErrorCode OptDeclareOne(const OptSpec *spec);

/* Name of an option with a word of the scene in it, for the readers below: OptJoin("-particle_", "disc", "_angle",
   name). Returns name. */
#define OPT_NAME 128
const char *OptJoin(const char before[], const char word[], const char after[], char name[OPT_NAME]);

PetscErrorCode OptReal(const char name[], PetscReal *value);
PetscErrorCode OptInt(const char name[], PetscInt *value);
PetscErrorCode OptBool(const char name[], PetscBool *value);

/* One of the words in `list` (NULL-terminated), which are those of the row in its order. *index is default on entry. */
PetscErrorCode OptChoice(const char name[], const char *const list[], PetscInt *index);

/* The scene file, to be told once before the first option is read: paths that a scene gives are relative to the folder
   of its file, those of the command line (and of PETSC_OPTIONS) to the working folder. Not collective. */
void OptSetScene(const char file[]);
/* The option `name` (with dash) stands in another file, one that the scene includes: its paths are relative to that.
   May be called before PetscInitialize; kept until OptFinalize. Not collective. */
PetscErrorCode OptSetFile(const char name[], const char file[]);

/* A string; `value` has room for `len` characters and holds the default on entry. A path comes as seen from the working
   folder, and stands in the database (hence in options.txt) as an absolute one from then on. */
PetscErrorCode OptString(const char name[], char value[], size_t len);

/* Exactly n numbers ("1,2" or a YAML list [1, 2]). *found (may be NULL) tells whether the option was given. */
PetscErrorCode OptRealArray(const char name[], PetscInt n, PetscReal value[], PetscBool *found);
PetscErrorCode OptIntArray(const char name[], PetscInt n, PetscInt value[], PetscBool *found);

/* A list of strings. On entry *n is the room in list[]; on exit the number found (0 if absent).
   Each string is allocated; free it with PetscFree. */
PetscErrorCode OptStringArray(const char name[], PetscInt *n, char *list[]);

/* A list of axes, out of x, y (, z), as bits of *axes. Error: what is no axis of `dim` dimensions. */
PetscErrorCode OptAxes(const char name[], PetscInt dim, PetscInt *axes, PetscBool *found);

/* Was this option given at all? Counts as reading it. */
PetscErrorCode OptHas(const char name[], PetscBool *found);

/* Text of an option, "" when it is absent or has no value. Does not count as reading it: for defaults that
   depend on other options. */
PetscErrorCode OptPeek(const char name[], char text[], size_t len);

/* The default of an option as -help shows it, "" if it has none or is not one of ours. Not collective. */
const char *OptGetDefault(const char name[]);
/* The number of a single value, as OptReal would read it; *found is false if it is absent or none. Does not count as
   reading it. */
PetscErrorCode OptPeekReal(const char name[], PetscReal *value, PetscBool *found);

/* The numbers of a list, at most `most`; *n is 0 if the option is absent, has more, or has one that is none: an
   expression of x or t, though it may begin with a number. Does not count as reading it. */
PetscErrorCode OptPeekReals(const char name[], PetscInt max, PetscReal value[], PetscInt *n);
/* Whether it is on, as OptBool would read it; *value stays where it is absent or neither true nor false. Does not count
   as reading it. */
PetscErrorCode OptPeekBool(const char name[], PetscBool *value);

/* Advice for a word that is none of `choices` ("a, b"): "; did you mean b?", by `words` ("c b, d b") or as the nearest
   spelling, else "". Not collective. */
void OptAdviseWord(const char word[], const char choices[], const char words[], char advice[], size_t len);

/* How many values the list of an option has, 0 when it is absent. Does not count as reading it. */
PetscErrorCode OptCountItems(const char name[], PetscInt *n);

/* Set a default: kept only if neither scene nor command line gives the option. Of two for one name the later holds.
   Such a default never counts as an unused option. For PETSc's solver objects where they are made; those of our own
   options stand in src/run/defaults.c. */
PetscErrorCode OptDefault(const char name[], const char value[]);

/* Does the command line itself hold this option, rather than the scene, another file of options or the environment? */
PetscBool OptIsArgument(const char name[]);

/* Remove an option unless the command line gives it or it is a default: text[len] is its text, "" if nothing was
   removed. For what a preset replaces. */
PetscErrorCode OptTake(const char name[], char text[], size_t len);

/* Stop with an error if scene or command line give options or choices by names that they had in an earlier version
   (OptSpec.old, old_words): the message has the lines to write instead. Call before the first option is read. */
PetscErrorCode OptCheckRenamed(void);
/* Lines "-name value" of an earlier version with the names and choices of this one, in *renamed; free it with
   PetscFree. Not collective. */
PetscErrorCode OptRenameLines(const char text[], char **renamed);

/* Stop with an error if scene or command line hold an option that nobody has read: one of another mode with what it is
   read with, any other with the nearest known name. Options that PETSc reads only at
   the end of a run (-log_view, ...) are exempt. Call after all set-up, before the first step. */
PetscErrorCode OptCheckUnused(void);

/* All options of the database, one "-name value" per line, in *text; free it with PetscFree. Not collective. */
PetscErrorCode OptGetAll(char **text);
/* The same without defaults that nobody has read so far: read from a file, these would be options that nobody uses. */
PetscErrorCode OptGetRead(char **text);

/* Every option of every table, once, in order of rooms. Not collective, needs no PETSc. */
typedef enum {
  OPT_PLAIN,
  OPT_PLAIN_EXPERT,
  OPT_MARKDOWN,
  OPT_MAN,
  OPT_SCHEMA /* JSON schema of scene files */
} OptFormat;
void OptPrint(FILE *file, OptFormat format);
/* Those, experts' too, that hold a word in name, meaning, choices, the shape they belong to or what others call them,
   or have it as a name of a scene (particle_disc_density); with several words, between blanks, all of them; returns
   how many. */
int OptPrintMatching(FILE *file, const char words[]);

/* Forget what has been read, the defaults in the database, and the rows of OptDeclareOne (at the end of a run, and
   before PetscFinalize). */
PetscErrorCode OptFinalize(void);
