/* EventTable: see eventtable.h. */
#include "compat.h"
#include "report/eventtable.h"
#include "files.h"
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define LINE 512

const MonitorColumn EVENT_DROPS[] = {
  {"time", "time", 12, "at the end of the step"},
  {"drop", "", 0, "number of the drop; new ones after drops have merged or broken up"},
  {"group", "", 0, "name of its group"},
  {"volume", "length^2", 12, "its area, the volume of unit depth"},
  {"volume_error", "", 6, "over what it is to have, less one"},
  {"x", "length", 12, "its centre"},
  {"y", "length", 12, ""},
  {"u", "length/time", 12, "mean velocity of its fluid"},
  {"v", "length/time", 12, ""},
  {"length", "length", 12, "of its interface"},
  {"circularity", "", 12, "circumference of the circle of that volume over the length"},
  {"deformation", "", 9, "(a - b)/(a + b) of the ellipse with its second moments"},
  {"angle", "rad", 9, "of that ellipse's longer axis"},
  {"wetted", "length", 12, "length of walls that it wets"},
  {NULL, NULL, 0, NULL},
};
const MonitorColumn EVENT_DROPS_SPACE[] = {
  {"time", "time", 12, "at the end of the step"},
  {"drop", "", 0, "as in the plane"},
  {"group", "", 0, ""},
  {"volume", "length^3", 12, "its volume"},
  {"volume_error", "", 6, "over what it is to have, less one"},
  {"x", "length", 12, "its centre"},
  {"y", "length", 12, ""},
  {"z", "length", 12, ""},
  {"u", "length/time", 12, "mean velocity of its fluid"},
  {"v", "length/time", 12, ""},
  {"w", "length/time", 12, ""},
  {"area", "length^2", 12, "of its interface"},
  {"sphericity", "", 12, "area of the ball of that volume over the area"},
  {"deformation", "", 9, "(a - c)/(a + c), longest and shortest axis of the ellipsoid with its second moments"},
  {"axis_x", "", 9, "direction of the longest axis"},
  {"axis_y", "", 9, ""},
  {"axis_z", "", 9, ""},
  {NULL, NULL, 0, NULL},
};
const MonitorColumn EVENT_BONDS[] = {
  {"time", "time", 12, "at the end of the step"},
  {"event", "", 0, "formed, or what broke it"},
  {"body", "", 0, "number of the body"},
  {"partner", "", 0, "number of its partner, or the wall"},
  {"tension", "force", 9, "load of the bond then, as in bonds_<step>.h5"},
  {"shear", "force", 9, ""},
  {"twist", "force length", 9, "moments"},
  {"bending", "force length", 9, ""},
  {"x", "length", 9, "where it ends on the body"},
  {"y", "length", 9, ""},
  {"z", "length", 9, ""},
  {NULL, NULL, 0, NULL},
};
const MonitorColumn EVENT_AGGREGATES[] = {
  {"time", "time", 12, "at the end of the step"},
  {"bonds", "", 0, "how many there are"},
  {"aggregates", "", 0, "of two bodies or more"},
  {"single", "", 0, "bodies without a bond"},
  {"mean_size", "", 9, "bodies of an aggregate"},
  {"largest", "", 0, "bodies of the largest"},
  {"radius_of_gyration", "length", 9, "of their bodies' centres, mean by bodies"},
  {"fractal_dimension", "", 6, "slope of log of size over log of that radius; 0 with fewer than two sizes"},
  {"coordination", "", 9, "ends of bonds over bodies that have one"},
  {NULL, NULL, 0, NULL},
};

/* The first line of a table */
static void join_heading(const MonitorColumn *c, char heading[LINE])
{
  size_t n = 0;

  for (; c->name && n < LINE; c++)
    n += (size_t)snprintf(heading + n, LINE - n, "%s%c", c->name, c[1].name ? ',' : '\n');
}

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

PetscErrorCode EventTableOpen(MPI_Comm comm, const char dir[], const char name[], const MonitorColumn column[],
                              PetscReal time, EventTable *t)
{
  PetscMPIInt rank;
  char        heading[LINE];
  int         err = 0;

  PetscFunctionBeginUser;
  join_heading(column, heading);
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
