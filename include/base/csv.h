/* Csv: a table of numbers in a text file: a header line that names the columns, then one line of numbers each,
   separated by commas; blank lines and lines that start with # are skipped. No quoting. */
#pragma once
#include <petscsys.h>

#define CSV_COLUMNS 16

typedef struct {
  char       file[PETSC_MAX_PATH_LEN];
  PetscInt   ncolumn, nrow, header; /* header: its line in the file */
  char       name[CSV_COLUMNS][16];
  PetscReal *value; /* [nrow][ncolumn] */
  PetscInt  *line;  /* [nrow] in the file */
} Csv;

/* Rank 0 reads, all ranks get the table or raise the same error; `first`: what the header line names, for the message
   about an empty file. Collective on the communicator of the run (runcomm.h). Free with CsvDestroy. Errors, with file
   and line: unreadable, no header, a column twice, more or fewer numbers than columns, what is not a finite number. */
PetscErrorCode CsvRead(const char file[], const char first[], Csv *);
PetscErrorCode CsvDestroy(Csv *);
/* Number of a column, -1: there is none */
PetscInt CsvColumn(const Csv *, const char name[]);
