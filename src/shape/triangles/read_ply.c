/* PLY: a heading that describes elements and their properties, then the values as text or binary of either byte order.
   Points are x, y, z of the element vertex, polygons the list vertex_indices of the element face; all else is passed
   over. */
#include "compat.h"
#include "read.h"
#include <stdint.h>
#include <string.h>

#define ELEMENTS   16
#define PROPERTIES 64

typedef enum {
  PLY_TEXT,
  PLY_LITTLE,
  PLY_BIG
} PlyCoding;

typedef struct {
  char     name[READ_WORD];
  PetscInt count_type, type; /* of TYPE; count_type -1: no list */
} Property;

typedef struct {
  char     name[READ_WORD];
  PetscInt count, nproperty;
  Property property[PROPERTIES];
} Element;

typedef struct {
  PlyCoding coding;
  PetscInt  nelement;
  Element   element[ELEMENTS];
} Heading;

static const struct {
  const char *name, *other;
  PetscInt    bytes;
  char        kind; /* i, u: integer with and without sign, f: floating point */
} TYPE[] = {{"char", "int8", 1, 'i'},     {"uchar", "uint8", 1, 'u'},   {"short", "int16", 2, 'i'},
            {"ushort", "uint16", 2, 'u'}, {"int", "int32", 4, 'i'},     {"uint", "uint32", 4, 'u'},
            {"float", "float32", 4, 'f'}, {"double", "float64", 8, 'f'}};

static PetscErrorCode take_type(Reader *r, PetscInt *type)
{
  PetscFunctionBeginUser;
  *type = 0;
  if (!ReadWord(r, PETSC_TRUE)) READ_SAY(r, "the type of a property is missing");
  for (size_t i = 0; i < sizeof(TYPE) / sizeof(TYPE[0]); i++) {
    *type = (PetscInt)i;
    if (!strcmp(r->word, TYPE[i].name) || !strcmp(r->word, TYPE[i].other)) PetscFunctionReturn(PETSC_SUCCESS);
  }
  READ_SAY(r, "'%s' is no type of a PLY file", r->word);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_property(Reader *r, Heading *h)
{
  Element  *e = h->nelement ? &h->element[h->nelement - 1] : NULL;
  Property *p;

  PetscFunctionBeginUser;
  if (!e || e->nproperty == PROPERTIES) {
    READ_SAY(r, "a property without an element, or more than %d of one", PROPERTIES);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  p                   = &e->property[e->nproperty++];
  p->count_type       = -1;
  const size_t before = r->at;

  if (ReadWord(r, PETSC_TRUE) && !strcmp(r->word, "list")) PetscCall(take_type(r, &p->count_type));
  else r->at = before;
  PetscCall(take_type(r, &p->type));
  if (!ReadWord(r, PETSC_TRUE)) READ_SAY(r, "the name of a property is missing");
  PetscCall(PetscStrncpy(p->name, r->word, sizeof(p->name)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_element(Reader *r, Heading *h)
{
  Element *e;

  PetscFunctionBeginUser;
  if (h->nelement == ELEMENTS) {
    READ_SAY(r, "more than %d elements", ELEMENTS);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  e = &h->element[h->nelement++];
  if (!ReadWord(r, PETSC_TRUE)) READ_SAY(r, "the name of an element is missing");
  PetscCall(PetscStrncpy(e->name, r->word, sizeof(e->name)));
  if (!ReadWord(r, PETSC_TRUE)) READ_SAY(r, "the number of elements is missing");
  if (!r->error[0]) PetscCall(ReadInteger(r, &e->count));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_format(Reader *r, Heading *h)
{
  const char *const name[] = {"ascii", "binary_little_endian", "binary_big_endian"};
  PetscBool         known  = PETSC_FALSE;

  PetscFunctionBeginUser;
  (void)ReadWord(r, PETSC_TRUE);
  for (int i = 0; i < 3; i++)
    if (!strcmp(r->word, name[i])) {
      h->coding = (PlyCoding)i;
      known     = PETSC_TRUE;
    }
  if (!known) READ_SAY(r, "the format '%s' is none of ascii, binary_little_endian, binary_big_endian", r->word);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Up to the line after end_header */
static PetscErrorCode read_heading(Reader *r, Heading *h)
{
  PetscFunctionBeginUser;
  for (PetscBool end = PETSC_FALSE; !end && !r->error[0];) {
    if (!ReadWord(r, PETSC_FALSE)) {
      READ_SAY(r, "the heading has no end_header: the file is cut off");
      break;
    }
    if (!strcmp(r->word, "format")) PetscCall(take_format(r, h));
    else if (!strcmp(r->word, "element")) PetscCall(take_element(r, h));
    else if (!strcmp(r->word, "property")) PetscCall(take_property(r, h));
    end = (PetscBool)!strcmp(r->word, "end_header");
    ReadSkipLine(r);
  }
  r->line++;
  if (r->at < r->size) r->at++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The next value; `of` and `number` are for the message */
static PetscErrorCode take_value(Reader *r, const Heading *h, PetscInt type, const char of[], PetscInt number,
                                 PetscReal *v)
{
  const size_t  bytes = (size_t)TYPE[type].bytes;
  unsigned char b[8];
  uint64_t      bits = 0;

  PetscFunctionBeginUser;
  *v = 0;
  if (h->coding == PLY_TEXT) {
    if (!ReadWord(r, PETSC_FALSE)) READ_SAY(r, "the file ends within %s %" PetscInt_FMT ": it is cut off", of, number);
    else PetscCall(ReadNumber(r, v));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (r->at + bytes > r->size) {
    PetscCall(PetscSNPrintf(r->error, TRI_WHY,
                            "PLY file '%s' ends within %s %" PetscInt_FMT ", at byte %.0f: it is cut off", r->file, of,
                            number, (double)r->size));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  memcpy(b, r->text + r->at, bytes);
  r->at += bytes;
  for (size_t i = 0; i < bytes; i++) bits |= (uint64_t)b[h->coding == PLY_LITTLE ? i : bytes - 1 - i] << 8 * i;
  if (TYPE[type].kind == 'u') *v = (PetscReal)bits;
  else if (TYPE[type].kind == 'i') *v = (PetscReal)((int64_t)(bits << (64 - 8 * bytes)) >> (64 - 8 * bytes));
  else if (bytes == 8) {
    double d;

    memcpy(&d, &bits, 8);
    *v = (PetscReal)d;
  } else {
    const uint32_t half = (uint32_t)bits;
    float          s;

    memcpy(&s, &half, 4);
    *v = (PetscReal)s;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One vertex, face or another element */
static PetscErrorCode take_one(Reader *r, const Heading *h, const Element *e, PetscInt number)
{
  const PetscBool vertex = (PetscBool)!strcmp(e->name, "vertex"), face = (PetscBool)!strcmp(e->name, "face");
  PetscReal       x[3] = {0, 0, 0}, v = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < e->nproperty && !r->error[0]; i++) {
    const Property *p       = &e->property[i];
    const PetscBool polygon = (PetscBool)(face &&
                                          (!strcmp(p->name, "vertex_indices") || !strcmp(p->name, "vertex_index")));
    PetscReal       count   = 1;

    if (p->count_type >= 0) PetscCall(take_value(r, h, p->count_type, e->name, number, &count));
    for (PetscInt k = 0; k < (PetscInt)count && !r->error[0]; k++) {
      PetscCall(take_value(r, h, p->type, e->name, number, &v));
      if (polygon) PetscCall(ReadAddCorner(r, (PetscInt)v));
    }
    if (polygon && !r->error[0]) PetscCall(ReadEndFace(r, (PetscInt)count));
    if (vertex && p->name[0] >= 'x' && p->name[0] <= 'z' && !p->name[1]) x[p->name[0] - 'x'] = v;
  }
  for (int a = 0; a < 3; a++)
    if (PetscIsInfOrNanReal(x[a]) && !r->error[0])
      PetscCall(
        PetscSNPrintf(r->error, TRI_WHY, "PLY file '%s': vertex %" PetscInt_FMT " is not finite", r->file, number));
  if (vertex) PetscCall(ReadAddPoint(r, x));
  if (h->coding == PLY_TEXT) ReadSkipLine(r); /* some programs write more than their heading says */
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ReadPly(Reader *r)
{
  Heading *h;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&h));
  PetscCall(read_heading(r, h));
  for (PetscInt e = 0; e < h->nelement && !r->error[0]; e++)
    for (PetscInt i = 0; h->element[e].nproperty && i < h->element[e].count && !r->error[0]; i++)
      PetscCall(take_one(r, h, &h->element[e], i));
  if (!r->error[0] && !r->nface)
    PetscCall(
      PetscSNPrintf(r->error, TRI_WHY,
                    "PLY file '%s' has no polygons (element face with a list vertex_indices): points alone, or strips, bound no body",
                    r->file));
  PetscCall(PetscFree(h));
  PetscFunctionReturn(PETSC_SUCCESS);
}
