/* MshText: numbers of a Gmsh file, written out or binary, in either byte order. Nothing is read behind its end: then,
   and once a fault is known, numbers are zero. Not collective. */
#pragma once
#include "msh.h"

typedef struct {
  char       *text; /* the whole file, with a zero behind it */
  const char *at, *end;
  double      version;
  PetscBool   binary, swap; /* other byte order */
  size_t      size;         /* bytes of a count */
  char       *fault;        /* [MSH_FAULT] "" or what is wrong */
} MshText;

/* The file is in memory; the caller closes it, also after a fault. */
PetscErrorCode MshOpen(const char path[], char fault[MSH_FAULT], MshText *);
PetscErrorCode MshClose(MshText *);
/* The first fault stays: what is wrong with the file, as the end of a sentence about it. */
void MshFault(MshText *, const char format[], ...) PETSC_ATTRIBUTE_FORMAT(2, 3);

/* Go to the next section; FALSE: there is none. name [MSH_NAME] without '$'. */
PetscBool MshNextSection(MshText *, char name[]);
/* Behind the end of a section, from wherever in it */
void MshEndSection(MshText *, const char name[]);
/* Version, binary or not, byte order */
void MshFormat(MshText *);
/* The numbers of a section follow: behind the end of a line that is written out also in a binary file */
void MshBody(MshText *);

PetscInt  MshNumber(MshText *); /* written out in binary files too */
PetscInt  MshInt(MshText *);    /* 4 bytes in binary files */
PetscInt  MshSize(MshText *);   /* 8 bytes, or 4 where the file says so */
PetscReal MshReal(MshText *);
/* A name between quotes, name [MSH_NAME] */
void MshQuoted(MshText *, char name[]);
/* n, if the rest of the file can hold as many things of at least so many numbers, else a fault and 0 */
PetscInt MshCount(MshText *, PetscInt n, PetscInt numbers);
