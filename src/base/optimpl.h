/* What the sources of the option table share: opttable.c (tables), optdatabase.c, opt.c (reading), renamed.c (former
   names), suggest.c (advice), help.c and schema.c (printing). */
#pragma once
#include "base/opt.h"

#define OPT_LINE 1024 /* room for one line of text */

typedef struct {
  const char    *title;
  const OptSpec *spec;
  size_t         n;
} OptTable;

/* A name that this run has read, or to which it has given a default. */
typedef struct {
  char          *name; /* with dash */
  const OptSpec *spec; /* NULL: an option of PETSc */
  OptSpec       *own;  /* its copy, where OptDeclareOne made it */
  PetscBool      is_read;
  PetscBool      is_default; /* put into the database by OptDefault(), not by the user */
} OptEntry;

extern OptTable opt_table[];
extern size_t   opt_ntable;

/* All known names, *n of them. */
const OptEntry *OptGetEntries(PetscInt *n);
const OptEntry *OptFindEntry(const char name[]);
/* The entry of a name, made now if there is none yet */
PetscErrorCode OptMakeEntry(const char name[], OptEntry **entry);

/* One row after the other, of all tables, then what shapes declared under a placeholder, NULL after the last; title: of
   a table, once. Begin with {0}. */
typedef struct {
  size_t      table, row;
  PetscInt    entry;
  const char *title;
} OptCursor;
const OptSpec *OptNextSpec(OptCursor *at);

/* The rows as JSON schema of scene files */
void OptPrintSchema(FILE *file);

/* Row of a name, NULL if there is none; of several the one with the most text besides its placeholders. */
const OptSpec *OptFindSpec(const char name[]);

/* Called by every reader: the row of what is read, of this type or (any_type) of any; then its text, NULL when it is
   absent. */
PetscErrorCode OptBeginReading(const char name[], OptType type, PetscBool any_type, const OptSpec **spec);
PetscErrorCode OptFindText(const char name[], const OptSpec *spec, const char **text);
/* Text of an option in the database without marking it as used, "" without a value; *count: options in the database. */
PetscErrorCode OptLookUp(const char name[], PetscBool *present, PetscInt *count, char value[], size_t len);
/* Is the text a list of plain numbers? */
PetscBool OptIsNumbers(const char text[]);

/* A number as it is written: plain, an expression of numbers and pi ("pi/2"), or where the unit knows rad, in degrees
   ("40 deg"). *plain: as strtod reads it. False: none of these. */
PetscBool OptReadNumber(const char text[], const char unit[], double *value, PetscBool *plain);
/* Numbers in place of expressions in the database, so that a file of options holds no blanks. */
PetscErrorCode OptKeepNumbers(const char name[], PetscInt n, const PetscReal value[]);
/* "40 deg, 2" has two values: blanks before degrees go away; free *joined with PetscFree. */
PetscErrorCode OptJoinDegrees(const OptSpec *spec, const char text[], char **joined);
/* Edits between two names */
PetscInt OptEditDistance(const char a[], const char b[]);
/* By words of the field (OptSpec.also) or with a section that fits: "did you mean -flow_viscosity?", else "" */
void OptAdviseName(const char name[], char advice[], size_t len);

/* Does a name fit a row's name ("-flow_bc_<boundary>_type")? What stands for the placeholder goes to word[len], which
   may be NULL; "" when there is none. */
PetscBool OptFits(const char pattern[], const char name[], char word[], size_t len);

/* "meaning [unit] (range)" */
void OptFormatMeaning(const OptSpec *spec, char text[], size_t len);
/* "> 0 and <= 3", "" for any */
void OptFormatRange(const OptSpec *spec, char text[], size_t len);

/* The next item of a comma-separated list, without blanks around it. *cursor becomes NULL after the last. */
PetscBool OptNextItem(const char **cursor, char item[], size_t len);
/* The next "other word" pair of a list "symmetry slip, wall no_slip" */
PetscBool OptNextPair(const char **at, char other[64], char word[64]);
/* Items of a list */
PetscInt OptCountWords(const char text[]);
/* Give the list of an option in the database commas without blanks, since a file of options ends a value at a blank. */
PetscErrorCode OptJoinItems(const char name[]);
/* Paths in value[len] of an option as seen from the working folder; absolute in the database. */
PetscErrorCode OptResolvePaths(const char name[], OptPaths kind, char value[], size_t len);

/* Forget what OptSetFile was told. */
void OptForgetFiles(void);

PetscBool OptSameName(const char a[], const char b[]); /* PETSc's option names do not tell upper from lower case */
