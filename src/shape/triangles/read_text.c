/* OBJ and OFF: points and polygons by their numbers. Colours, normals, groups and curves are passed over. */
#include "compat.h"
#include "read.h"
#include <ctype.h>
#include <string.h>

/* One corner of a face: 7, 7/1, 7//3 or 7/1/3, counted from 1; -1 is the point before this line */
static PetscErrorCode add_obj_corner(Reader *r)
{
  PetscInt i     = 0;
  char    *slash = strchr(r->word, '/');

  PetscFunctionBeginUser;
  if (slash) *slash = 0;
  PetscCall(ReadInteger(r, &i));
  if (!r->error[0] && (i == 0 || i < -r->nx))
    READ_SAY(r, "a face has the point %" PetscInt_FMT ": they count from 1, or from -1 backwards", i);
  PetscCall(ReadAddCorner(r, i < 0 ? r->nx + i : i - 1));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ReadObj(Reader *r)
{
  PetscFunctionBeginUser;
  for (size_t i = 0; i + 1 < r->size; i++) /* lines that go on */
    if (r->text[i] == '\\' && (r->text[i + 1] == '\n' || r->text[i + 1] == '\r')) r->text[i] = r->text[i + 1] = ' ';
  while (!r->error[0] && ReadWord(r, PETSC_FALSE)) {
    if (!strcmp(r->word, "v")) {
      PetscReal x[3];

      PetscCall(ReadNumbers(r, 3, "a point has three coordinates", x));
      PetscCall(ReadAddPoint(r, x));
    } else if (!strcmp(r->word, "f")) {
      PetscInt corners = 0;

      for (; !r->error[0] && ReadWord(r, PETSC_TRUE) && r->word[0] != '#'; corners++) PetscCall(add_obj_corner(r));
      if (!r->error[0]) PetscCall(ReadEndFace(r, corners));
    }
    ReadSkipLine(r);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The first word of the next line that is neither empty nor a comment */
static PetscBool next_row(Reader *r)
{
  while (ReadWord(r, PETSC_FALSE)) {
    if (r->word[0] != '#') return PETSC_TRUE;
    ReadSkipLine(r);
  }
  return PETSC_FALSE;
}

/* The word and n - 1 more as numbers; the rest of the line (colours, normals) is passed over */
static PetscErrorCode take_row(Reader *r, PetscInt n, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(ReadNumber(r, v));
  PetscCall(ReadNumbers(r, n - 1, "a point has three coordinates", v + 1));
  ReadSkipLine(r);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_off_faces(Reader *r, PetscInt n)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n && !r->error[0]; i++) {
    PetscInt corners = 0, point = 0;

    if (!next_row(r))
      READ_SAY(r, "the file ends after %" PetscInt_FMT " of %" PetscInt_FMT " faces: it is cut off", i, n);
    else PetscCall(ReadInteger(r, &corners));
    for (PetscInt k = 0; k < corners && !r->error[0]; k++) {
      if (!ReadWord(r, PETSC_TRUE))
        READ_SAY(r, "a face of %" PetscInt_FMT " corners, the line ends after %" PetscInt_FMT, corners, k);
      else PetscCall(ReadInteger(r, &point));
      if (!r->error[0]) PetscCall(ReadAddCorner(r, point));
    }
    if (!r->error[0]) PetscCall(ReadEndFace(r, corners));
    ReadSkipLine(r);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ReadOff(Reader *r)
{
  PetscInt count[2] = {0, 0};

  PetscFunctionBeginUser;
  if (!next_row(r)) READ_SAY(r, "the file is empty");
  if (strchr(r->word, 'F')) {
    if (strpbrk(r->word, "4n")) READ_SAY(r, "'%s': points of other than three coordinates are not read", r->word);
    if (!next_row(r)) READ_SAY(r, "the numbers of points and faces are missing");
    else if (!strcmp(r->word, "BINARY"))
      READ_SAY(r, "binary OFF files are not read: save it as text, or as STL or PLY");
  }
  for (PetscInt k = 0; k < 2 && !r->error[0]; k++) {
    PetscCall(ReadInteger(r, count + k));
    if (!k && !r->error[0] && !ReadWord(r, PETSC_TRUE))
      READ_SAY(r, "the number of faces is missing after that of points");
  }
  ReadSkipLine(r); /* edges */
  for (PetscInt i = 0; i < count[0] && !r->error[0]; i++) {
    PetscReal x[3] = {0, 0, 0};

    if (!next_row(r))
      READ_SAY(r, "the file ends after %" PetscInt_FMT " of %" PetscInt_FMT " points: it is cut off", i, count[0]);
    else PetscCall(take_row(r, 3, x));
    PetscCall(ReadAddPoint(r, x));
  }
  if (!r->error[0]) PetscCall(read_off_faces(r, count[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}
