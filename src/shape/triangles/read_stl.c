/* STL: text in any case, binary (little-endian, whatever the machine). */
#include "compat.h"
#include "read.h"
#include <strings.h>

#define HEAD   84 /* bytes before the triangles of a binary file */
#define STRIDE 50 /* bytes of a triangle: normal, three corners, two bytes */

PetscBool ReadIsText(const Reader *r)
{
  const size_t n = PetscMin(r->size, (size_t)1024);

  for (size_t i = 0; i < n; i++)
    if ((unsigned char)r->text[i] < 9 || ((unsigned char)r->text[i] > 13 && (unsigned char)r->text[i] < 32))
      return PETSC_FALSE;
  return PETSC_TRUE;
}

/* Known by the number of its triangles: exactly, or followed by more bytes, as some programs write */
PetscBool ReadIsStlBinary(const Reader *r)
{
  double bytes;

  if (r->size < HEAD) return PETSC_FALSE;
  bytes = HEAD + STRIDE * (double)read_little32(r->text + 80);
  if ((double)r->size == bytes) return PETSC_TRUE;
  return (PetscBool)((double)r->size > bytes && bytes > HEAD && !ReadIsText(r));
}

PetscErrorCode ReadStlBinary(Reader *r)
{
  const unsigned n = read_little32(r->text + 80);

  PetscFunctionBeginUser;
  if (n > TRI_MAX)
    PetscCall(
      PetscSNPrintf(r->error, TRI_WHY,
                    "STL file '%s' has %u triangles, and %d are the most: simplify the surface with a mesh program",
                    r->file, n, TRI_MAX));
  for (unsigned t = 0; t < n && !r->error[0]; t++) {
    for (unsigned i = 0; i < 3; i++) {
      const char *at = r->text + HEAD + STRIDE * (size_t)t + 12 + 12 * (size_t)i;
      PetscReal   x[3];

      for (int a = 0; a < 3; a++) {
        x[a] = read_little_float(at + 4 * a);
        if (PetscIsInfOrNanReal(x[a]))
          PetscCall(PetscSNPrintf(r->error, TRI_WHY,
                                  "STL file '%s': a corner of triangle %u is not finite, at byte %.0f", r->file, t,
                                  (double)(at + 4 * a - r->text)));
      }
      PetscCall(ReadAddPoint(r, x));
      PetscCall(ReadAddCorner(r, r->nx - 1));
    }
    PetscCall(ReadEndFace(r, 3));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The corners after every word "vertex" until the facet ends; files that have corners alone: three by three */
PetscErrorCode ReadStlText(Reader *r)
{
  PetscInt  corners = 0; /* of this facet */
  PetscBool end = PETSC_FALSE, facets = PETSC_FALSE;

  PetscFunctionBeginUser;
  r->unfinished = PETSC_TRUE;
  while (!r->error[0] && ReadWord(r, PETSC_FALSE)) {
    const char     *word    = r->word;
    const PetscBool was_end = end;

    end = PETSC_FALSE;
    if (!strcasecmp(word, "vertex")) {
      PetscReal x[3];

      PetscCall(ReadNumbers(r, 3, "expected three finite numbers after 'vertex'", x));
      PetscCall(ReadAddPoint(r, x));
      PetscCall(ReadAddCorner(r, r->nx - 1));
      corners++;
    } else if (!strcasecmp(word, "end")) end = PETSC_TRUE;
    else if (!strcasecmp(word, "solid") || !strcasecmp(word, "endsolid")) {
      r->unfinished = (PetscBool)(!was_end && !strcasecmp(word, "solid"));
      ReadSkipLine(r); /* a name may be any words */
    } else if (!strcasecmp(word, "facet")) facets = PETSC_TRUE;
    if (corners && (!strcasecmp(word, "facet") || !strcasecmp(word, "endfacet") || !strcasecmp(word, "endloop") ||
                    (!facets && corners == 3))) {
      PetscCall(ReadEndFace(r, corners));
      corners = 0;
    }
  }
  if (corners && !r->error[0]) PetscCall(ReadEndFace(r, corners));
  PetscFunctionReturn(PETSC_SUCCESS);
}
