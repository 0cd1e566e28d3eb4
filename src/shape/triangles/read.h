/* Reading of surfaces: what the files of formats share. All of it runs on rank 0; errors are text. */
#pragma once
#include "triangles.h"
#include <string.h>

#define READ_WORD 64

typedef struct {
  const char *file;
  char       *text; /* [size], a zero behind it */
  size_t      size, at;
  PetscInt    line;
  char        word[READ_WORD];
  PetscInt    nx, nx_capacity;
  Vec3       *x; /* [nx] points */
  PetscInt    ncorner, corner_capacity;
  PetscInt   *corner; /* [ncorner] points of the faces, one face after the other */
  PetscInt    nface, face_capacity;
  PetscInt   *face; /* [nface] corners of each */
  PetscBool   unfinished;
  char       *error; /* [TRI_WHY], "" while all is well */
} Reader;

/* What is wrong, with file and line */
#define READ_SAY(r, ...) PetscCall(ReadComplain(r, __VA_ARGS__))
PetscErrorCode ReadComplain(Reader *, const char format[], ...);
/* The next word between blanks into r->word, at most READ_WORD - 1 characters of it; `here`: of this line only. Counts
   lines. */
PetscBool ReadWord(Reader *, PetscBool here);
/* On to the next line. */
void ReadSkipLine(Reader *);
/* The word as a number, 1d-3 and 1D-3 among them; complains unless it is finite. */
PetscErrorCode ReadNumber(Reader *, PetscReal *);
/* The next n words of the line as numbers. what: such as "a vertex has three coordinates" */
PetscErrorCode ReadNumbers(Reader *, PetscInt n, const char what[], PetscReal v[]);
/* The word as an integer; complains otherwise. */
PetscErrorCode ReadInteger(Reader *, PetscInt *);
PetscErrorCode ReadAddPoint(Reader *, const PetscReal x[3]);
/* A corner of the face that is being read; ReadEndFace ends it. Faces of less than 3 corners are an error. */
PetscErrorCode ReadAddCorner(Reader *, PetscInt point);
PetscErrorCode ReadEndFace(Reader *, PetscInt corners);

/* Is the beginning of the file what a text file has? Headings of binary files may begin with 'solid' as well. */
PetscBool      ReadIsText(const Reader *);
PetscBool      ReadIsStlBinary(const Reader *);
PetscErrorCode ReadStlBinary(Reader *);
PetscErrorCode ReadStlText(Reader *);
PetscErrorCode ReadObj(Reader *);
PetscErrorCode ReadOff(Reader *);
PetscErrorCode ReadPly(Reader *);

/* Four bytes of a file whose order is little-endian, on a machine of either order: as a number without sign, and as
   the floating-point number that these bits are */
static inline unsigned read_little32(const char text[])
{
  const unsigned char *b = (const unsigned char *)text;

  return (unsigned)b[0] | (unsigned)b[1] << 8 | (unsigned)b[2] << 16 | (unsigned)b[3] << 24;
}

static inline float read_little_float(const char text[])
{
  const unsigned bits = read_little32(text);
  float          value;

  memcpy(&value, &bits, sizeof(value));
  return value;
}
