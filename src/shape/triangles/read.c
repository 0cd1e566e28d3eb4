/* Reading of surfaces: which format a file has, and the triangles of its faces. */
#include "compat.h"
#include "read.h"
#include <ctype.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

/* The corners [n][3][3] of all faces, polygons cut into triangles */
static PetscErrorCode gather_corners(Reader *r, PetscInt *n, PetscReal **xyz)
{
  Int3    *t;
  PetscInt first = 0, largest = 3;

  PetscFunctionBeginUser;
  *n = 0;
  for (PetscInt i = 0; i < r->nface && !r->error[0]; i++) {
    *n += r->face[i] - 2;
    largest = PetscMax(largest, r->face[i]);
  }
  for (PetscInt i = 0; i < r->ncorner && !r->error[0]; i++)
    if (r->corner[i] < 0 || r->corner[i] >= r->nx)
      PetscCall(PetscSNPrintf(r->error, TRI_WHY,
                              "'%s': a face has the point %" PetscInt_FMT ", and there are %" PetscInt_FMT
                              " (counted from 0)",
                              r->file, r->corner[i], r->nx));
  if (r->error[0]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(9 * (size_t)*n + 1, xyz));
  PetscCall(PetscMalloc1(largest, &t));
  *n = 0;
  for (PetscInt i = 0; i < r->nface; i++) {
    PetscCall(PolygonSplit((const Vec3 *)r->x, r->face[i], r->corner + first, t));
    for (PetscInt k = 0; k < 3 * (r->face[i] - 2); k++)
      PetscCall(PetscArraycpy(*xyz + 9 * *n + 3 * k, r->x[t[k / 3][k % 3]], 3));
    *n += r->face[i] - 2;
    first += r->face[i];
  }
  PetscCall(PetscFree(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- files ---- */

static PetscErrorCode load_text(Reader *r)
{
  FILE *f = fopen(r->file, "rb");
  long  n = -1;

  PetscFunctionBeginUser;
  if (f && !fseek(f, 0, SEEK_END)) n = ftell(f);
  if (n >= 0) {
    rewind(f);
    PetscCall(PetscMalloc1((size_t)n + 1, &r->text));
    if (fread(r->text, 1, (size_t)n, f) != (size_t)n) n = -1;
    else r->text[n] = 0;
  }
  if (f) fclose(f);
  r->size = n < 0 ? 0 : (size_t)n;
  if (n < 0)
    PetscCall(
      PetscSNPrintf(r->error, TRI_WHY,
                    "STL file '%s' cannot be read: set the option file of shape 'stl' to the path of a file, in a scene relative to the "
                    "scene file",
                    r->file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool has_extension(const char file[], const char extension[])
{
  const char *dot = strrchr(file, '.');

  return (PetscBool)(dot && !strcasecmp(dot + 1, extension));
}

/* First word of an OBJ file, after comments */
static PetscBool is_obj_word(const char word[])
{
  const char *const known[] = {"v", "vn", "vt", "f", "o", "g", "s", "mtllib", "usemtl"};

  for (size_t i = 0; i < sizeof(known) / sizeof(known[0]); i++)
    if (!strcmp(word, known[i])) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* OFF with letters for what its vertices carry before, such as COFF */
static PetscBool is_off_word(const char word[])
{
  word += strspn(word, "STCN4n");
  return (PetscBool)(!strcmp(word, "OFF"));
}

/* Files of other programs, by their first bytes */
static PetscErrorCode refuse_file(Reader *r)
{
  const struct {
    const char *start, *what;
  } other[] = {
    {"\x1f\x8b", "compressed: unpack it, such as by gunzip"},
    {"PK\x03\x04", "a ZIP archive (or a 3MF file): unpack it, or save the surface as STL, OBJ, PLY or OFF"},
    {"ISO-10303-21", "a STEP file of CAD surfaces: save triangles as STL with a CAD program"},
    {"# vtk", "a VTK file: save the surface as STL or PLY, such as with ParaView"},
    {"<?xml", "an XML file: save the surface as STL, OBJ, PLY or OFF"},
    {"$MeshFormat", "a Gmsh file: save the surface as STL, such as by gmsh -2 -format stl"},
    {"version https://git-lfs", "a pointer to a file that is not there: fetch it with git lfs pull"},
  };
  const unsigned count = r->size >= 84 ? read_little32(r->text + 80) : 0;

  PetscFunctionBeginUser;
  for (size_t i = 0; i < sizeof(other) / sizeof(other[0]) && !r->error[0]; i++)
    if (r->size > strlen(other[i].start) && !memcmp(r->text, other[i].start, strlen(other[i].start)))
      PetscCall(PetscSNPrintf(r->error, TRI_WHY, "'%s' is no STL file, it is %s", r->file, other[i].what));
  if (!r->error[0])
    PetscCall(
      PetscSNPrintf(r->error, TRI_WHY,
                    "'%s' is no STL file: a text file begins with 'solid', a binary one of %u triangles has %.0f bytes, this one has %.0f. "
                    "OBJ, PLY and OFF files are read as well",
                    r->file, count, 84 + 50 * (double)count, (double)r->size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does a text file hold this word, in any case, in its first 64 KiB? */
static PetscBool mentions(const Reader *r, const char word[])
{
  const size_t n = strlen(word);

  for (size_t i = 0; i + n <= PetscMin(r->size, (size_t)65536); i++)
    if (!strncasecmp(r->text + i, word, n)) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* By what the file holds, then by its extension */
static PetscErrorCode read_format(Reader *r)
{
  PetscFunctionBeginUser;
  if (r->size >= 3 && !memcmp(r->text, "\xef\xbb\xbf", 3)) r->at = 3; /* byte-order mark */
  if (r->size > 4 && !memcmp(r->text, "ply", 3) && isspace((unsigned char)r->text[3])) {
    PetscCall(ReadPly(r));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (ReadIsStlBinary(r)) {
    PetscCall(ReadStlBinary(r));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  const size_t start = r->at;

  for (size_t i = 0, n = ReadIsText(r) ? r->size : 0; i + 1 < n; i++) /* line ends of old machines */
    if (r->text[i] == '\r' && r->text[i + 1] != '\n') r->text[i] = '\n';
  while (ReadWord(r, PETSC_FALSE) && r->word[0] == '#') ReadSkipLine(r);
  const PetscBool solid = (PetscBool)(!strncasecmp(r->word, "solid", 5) ||
                                      (!strcasecmp(r->word, "facet") && mentions(r, "vertex")));
  const PetscBool off   = (PetscBool)(is_off_word(r->word) || has_extension(r->file, "off"));
  const PetscBool obj   = (PetscBool)(is_obj_word(r->word) || has_extension(r->file, "obj"));

  r->at   = start;
  r->line = 1;
  if (!ReadIsText(r)) PetscCall(refuse_file(r));
  else if (solid) PetscCall(ReadStlText(r));
  else if (off) PetscCall(ReadOff(r));
  else if (obj) PetscCall(ReadObj(r));
  else PetscCall(refuse_file(r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrianglesReadFile(const char file[], PetscInt *n, PetscReal **xyz, PetscBool *unfinished, char error[])
{
  Reader r = {.file = file, .line = 1, .error = error};

  PetscFunctionBeginUser;
  *n   = 0;
  *xyz = NULL;
  PetscCall(load_text(&r));
  if (!error[0]) PetscCall(read_format(&r));
  if (!error[0]) PetscCall(gather_corners(&r, n, xyz));
  if (!error[0] && (*n < 4 || *n > TRI_MAX))
    TRI_SAY("Surface file '%s' has %" PetscInt_FMT " triangles: a body needs 4, and %d are the most", file, *n,
            TRI_MAX);
  *unfinished = r.unfinished;
  PetscCall(PetscFree(r.text));
  PetscCall(PetscFree(r.x));
  PetscCall(PetscFree(r.corner));
  PetscCall(PetscFree(r.face));
  PetscFunctionReturn(PETSC_SUCCESS);
}
