/* EventTable: see eventtable.h. */
#include "compat.h"
#include "report/eventtable.h"
#include "files.h"
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define LINE 512

/* The table that is there without lines from `time` on; NULL: there is none with this heading */
static FILE *open_former(const char path[], const char heading[], PetscReal time)
{
  char  line[LINE];
  FILE *file = fopen(path, "r+");
  long  end  = -1;

  if (file && fgets(line, LINE, file) && !strcmp(line, heading)) {
    end = ftell(file);
    while (fgets(line, LINE, file) && strtod(line, NULL) < time) end = ftell(file);
    if (fseek(file, end, SEEK_SET) || ftruncate(fileno(file), (off_t)end)) end = -1;
  }
  if (file && end < 0) (void)FileClose(&file);
  return file;
}

PetscErrorCode EventTableOpen(MPI_Comm comm, const char dir[], const char name[], const char heading[], PetscReal time,
                              EventTable *t)
{
  PetscMPIInt rank;
  int         err = 0;

  PetscFunctionBeginUser;
  *t = (EventTable){.comm = comm};
  PetscCall(PetscSNPrintf(t->path, sizeof(t->path), "%s/%s", dir, name));
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  if (rank == 0) {
    if (time > 0) t->file = open_former(t->path, heading, time);
    if (!t->file) {
      t->file = fopen(t->path, "w");
      if (!t->file || fputs(heading, t->file) < 0 || fflush(t->file)) err = errno ? errno : EIO;
    }
  }
  PetscCall(FileCheck(comm, err, t->path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode EventTableFlush(EventTable *t)
{
  int err = 0;

  PetscFunctionBeginUser;
  if (t->file && (fflush(t->file) || ferror(t->file))) err = errno ? errno : EIO;
  PetscCall(FileCheck(t->comm, err, t->path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode EventTableClose(EventTable *t)
{
  PetscFunctionBeginUser;
  if (t->path[0]) PetscCall(FileCheck(t->comm, FileClose(&t->file), t->path));
  PetscFunctionReturn(PETSC_SUCCESS);
}
