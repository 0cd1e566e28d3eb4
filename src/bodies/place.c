/* Place: first positions of the bodies of a group, see place.h.

   Lattice: of all splits of the box into nx x ny (x nz) cells that hold `count` bodies, the one with the widest
   smallest cell side. Random: sequential dart throwing; bodies are listed in a search grid with the distance that a new
   centre has to keep, so that a dart looks into one cell only. Table: a CSV reader for numbers (no quoting). Lengths in
   the unit of the scene. Knows no shapes: bodies are kept apart by their bounding radius. */
#include "compat.h"
#include "base/grid.h"
#include "place.h"
#include <ctype.h>
#include <stdlib.h>

#define MAX_TRIES   20000 /* darts for one body before the box counts as full */
#define MAX_COLUMNS 16

/* ---- lattice ---- */

static PetscReal smallest_side(PetscInt dim, const PetscReal size[3], const PetscInt n[3])
{
  PetscReal side = PETSC_MAX_REAL;

  for (PetscInt a = 0; a < dim; a++) side = PetscMin(side, size[a] / n[a]);
  return side;
}

static void split_box(PetscInt dim, const PetscReal size[3], PetscInt count, PetscInt best[3], PetscReal *side)
{
  *side = -1;
  for (PetscInt nx = 1; nx <= count; nx++) {
    const PetscInt rows = (count + nx - 1) / nx;

    for (PetscInt ny = dim == 2 ? rows : 1; ny <= rows; ny++) {
      const PetscInt  n[3] = {nx, ny, (rows + ny - 1) / ny};
      const PetscReal s    = smallest_side(dim, size, n);

      if (s > *side) {
        *side = s;
        for (PetscInt a = 0; a < 3; a++) best[a] = n[a];
      }
    }
  }
}

PetscErrorCode PlaceLattice(const char name[], PetscInt dim, const PetscReal lower[3], const PetscReal upper[3], PetscReal radius, PetscReal margin,
                            PetscInt count, Placement p[])
{
  PetscReal size[3] = {0, 0, 0}, side;
  PetscInt  n[3]    = {1, 1, 1};

  PetscFunctionBeginUser;
  if (!count) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < dim; a++) size[a] = upper[a] - lower[a];
  split_box(dim, size, count, n, &side);
  PetscCheck(side > 2 * radius + margin, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Lattice of group '%s' does not fit: %" PetscInt_FMT
             " bodies leave cells of width %g, a body with margin needs more than %g. Lower -particle_%s_count or widen -particle_%s_lower .. _upper",
             name, count, (double)side, (double)(2 * radius + margin), name, name);
  for (PetscInt i = 0; i < count; i++) {
    const PetscInt row    = i / n[0];
    const PetscInt in_row = PetscMin(n[0], count - row * n[0]); /* the last row may be short */

    p[i].x[0] = lower[0] + size[0] * (i % n[0] + 0.5) / in_row;
    p[i].x[1] = lower[1] + size[1] * (row % n[1] + 0.5) / n[1];
    p[i].x[2] = dim == 3 ? lower[2] + size[2] * (row / n[1] + 0.5) / n[2] : 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- random ---- */

/* splitmix64 (Steele, Lea, Flood 2014): uniform in [0, 1), the same on every machine */
PetscReal PlaceUniform(PetscInt64 *state)
{
  unsigned long long z = (unsigned long long)*state + 0x9e3779b97f4a7c15ULL;

  *state = (PetscInt64)z;
  z      = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z      = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  z ^= z >> 31;
  return (PetscReal)((double)(z >> 11) / 9007199254740992.0);
}

PetscInt64 PlaceStream(PetscInt seed, PetscInt stream)
{
  PetscInt64 state = seed;

  for (PetscInt i = 0; i < stream; i++) (void)PlaceUniform(&state);
  return (PetscInt64)((unsigned long long)(1e15 * PlaceUniform(&state)) * 0xd1342543de82ef95ULL + (unsigned long long)stream);
}

static PetscReal ball_volume(PetscInt dim, PetscReal r)
{
  return dim == 2 ? PETSC_PI * r * r : 4 * PETSC_PI / 3 * r * r * r;
}

/* keep[i]: distance a new centre has to keep from item i at x[i], for a body without size */
static PetscBool is_free(Grid cells, PetscInt dim, PetscReal (*x)[3], const PetscReal keep[], PetscReal radius, const PetscReal y[3])
{
  for (PetscInt e = GridFirst(cells, y); e >= 0; e = GridNext(cells, e)) {
    const PetscInt i  = GridItem(cells, e);
    PetscReal      d2 = 0;

    for (PetscInt a = 0; a < dim; a++) d2 += PetscSqr(x[i][a] - y[a]);
    if (d2 <= PetscSqr(keep[i] + radius)) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

static PetscErrorCode throw_darts(Grid cells, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3], PetscReal radius, PetscReal (*x)[3],
                                  const PetscReal keep[], PetscInt64 *state, PetscReal y[3], PetscBool *found)
{
  PetscFunctionBeginUser;
  *found = PETSC_FALSE;
  for (PetscInt t = 0; t < MAX_TRIES && !*found; t++) {
    for (PetscInt a = 0; a < dim; a++) y[a] = lower[a] + radius + (upper[a] - lower[a] - 2 * radius) * PlaceUniform(state);
    *found = is_free(cells, dim, x, keep, radius, y);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Large bodies first, which small ones leave no room for; bodies of one size in their order */
static PetscErrorCode sort_by_size(PetscInt count, const Placement p[], PetscInt order[])
{
  PetscReal *size;
  PetscBool  differ = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(count, &size));
  for (PetscInt i = 0; i < count; i++) {
    order[i] = i;
    size[i]  = -p[i].scale;
    differ   = (PetscBool)(differ || size[i] != size[0]);
  }
  if (differ) PetscCall(PetscSortRealWithArrayInt(count, size, order));
  PetscCall(PetscFree(size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PlaceRandom(const char name[], PetscInt dim, const PetscReal lower[3], const PetscReal upper[3], PetscReal radius, PetscReal margin,
                           PetscInt seed, PetscInt n, PetscReal (*other_x)[3], const PetscReal other_radius[], PetscInt count, Placement p[])
{
  Grid cells;
  PetscReal(*x)[3], *keep, box = 1, largest = 0, filled = 0;
  PetscInt64 state = seed;
  PetscInt  *order;
  PetscBool  found = PETSC_TRUE;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < count; i++) largest = PetscMax(largest, radius * p[i].scale);
  for (PetscInt a = 0; a < dim; a++) {
    PetscCheck(upper[a] - lower[a] >= 2 * largest, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Random bodies of group '%s': the box is %g wide along axis %" PetscInt_FMT ", one body needs %g. Widen -particle_%s_lower .. _upper",
               name, (double)(upper[a] - lower[a]), a, (double)(2 * largest), name);
    box *= upper[a] - lower[a];
  }
  PetscCall(PetscMalloc3(n + count, &x, n + count, &keep, count, &order));
  PetscCall(sort_by_size(count, p, order));
  PetscCall(GridCreate(dim, lower, upper, 2 * largest + margin, 4 * (n + count) + 64, &cells));
  for (PetscInt i = 0; i < n + count && found; i++) {
    const PetscReal r = i < n ? other_radius[i] : radius * p[order[i - n]].scale;

    if (i < n)
      for (PetscInt a = 0; a < 3; a++) x[i][a] = other_x[i][a];
    else {
      x[i][2] = 0;
      PetscCall(throw_darts(cells, dim, lower, upper, r, x, keep, &state, x[i], &found));
      PetscCheck(found, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
                 "Random bodies of group '%s': only %" PetscInt_FMT " of %" PetscInt_FMT
                 " fit, they fill %.3g of the box. Lower -particle_%s_count or -particle_%s_margin, widen the box, or use -particle_%s_place lattice or "
                 "pack",
                 name, i - n, count, (double)(filled / box), name, name, name);
      PetscCall(PetscArraycpy(p[order[i - n]].x, x[i], 3));
      filled += ball_volume(dim, r);
    }
    keep[i] = margin + r;
    PetscCall(GridInsert(cells, i, x[i], keep[i] + largest));
  }
  PetscCall(GridDestroy(&cells));
  PetscCall(PetscFree3(x, keep, order));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- table ---- */

typedef struct {
  const char *file;
  PetscInt    line, ncolumns, dim;
  PetscBool   positive[MAX_COLUMNS];
  size_t      offset[MAX_COLUMNS]; /* where in a Placement the column goes */
  char        name[MAX_COLUMNS][16];
} Table;

/* All ranks get the text of the file, or all raise the same error. */
static PetscErrorCode read_text(const char file[], char **text)
{
  PetscMPIInt rank;
  PetscInt    length = -1;

  PetscFunctionBeginUser;
  *text = NULL;
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  if (!rank) {
    FILE *f = fopen(file, "rb");

    if (f) {
      if (!fseek(f, 0, SEEK_END)) length = (PetscInt)ftell(f);
      rewind(f);
      if (length >= 0) {
        PetscCall(PetscMalloc1(length + 1, text));
        if (fread(*text, 1, (size_t)length, f) != (size_t)length) length = -1;
      }
      fclose(f);
    }
  }
  PetscCallMPI(MPI_Bcast(&length, 1, MPIU_INT, 0, PETSC_COMM_WORLD));
  if (length < 0) PetscCall(PetscFree(*text));
  PetscCheck(length >= 0, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN,
             "Table '%s' cannot be read: check the path and its permissions (in a scene it is relative to the scene file)", file);
  if (rank) PetscCall(PetscMalloc1(length + 1, text));
  PetscCallMPI(MPI_Bcast(*text, (PetscMPIInt)length, MPI_CHAR, 0, PETSC_COMM_WORLD));
  (*text)[length] = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static char *trim(char *s)
{
  char *end = s + strlen(s);

  while (end > s && isspace((unsigned char)end[-1])) *--end = 0;
  while (isspace((unsigned char)*s)) s++;
  return s;
}

/* Cut the next item off a comma-separated line; NULL at the end. */
static char *cut_field(char **rest)
{
  char *start = *rest, *comma;

  if (!start) return NULL;
  comma = strchr(start, ',');
  *rest = comma ? comma + 1 : NULL;
  if (comma) *comma = 0;
  return trim(start);
}

static PetscErrorCode add_column(Table *t, const char name[])
{
  const struct {
    const char *name;
    size_t      offset;
    PetscInt    dim; /* smallest dimension in which the column means something */
  } known[]  = {{"x", offsetof(Placement, x), 2},
                {"y", offsetof(Placement, x) + sizeof(PetscReal), 2},
                {"angle", offsetof(Placement, angle), 2},
                {"u", offsetof(Placement, u), 2},
                {"v", offsetof(Placement, u) + sizeof(PetscReal), 2},
                {"omega", offsetof(Placement, omega) + 2 * sizeof(PetscReal), 2},
                {"size", offsetof(Placement, scale), 2},
                {"radius", offsetof(Placement, radius), 2},
                {"density", offsetof(Placement, density), 2},
                {"z", offsetof(Placement, x) + 2 * sizeof(PetscReal), 3},
                {"w", offsetof(Placement, u) + 2 * sizeof(PetscReal), 3}};
  PetscInt k = -1;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < (PetscInt)(sizeof(known) / sizeof(known[0])); i++)
    if (!strcmp(known[i].name, name) && known[i].dim <= t->dim) k = i;
  PetscCheck(k >= 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s:%" PetscInt_FMT ": column '%s' is not known (known in %" PetscInt_FMT "D: x, y, angle, u, v, omega, size, radius, density%s)",
             t->file, t->line, name, t->dim, t->dim == 3 ? ", z, w" : "");
  for (PetscInt i = 0; i < t->ncolumns; i++)
    PetscCheck(strcmp(t->name[i], name), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "%s:%" PetscInt_FMT ": column '%s' appears twice: remove one",
               t->file, t->line, name);
  t->positive[t->ncolumns] = (PetscBool)(!strcmp(name, "size") || !strcmp(name, "radius") || !strcmp(name, "density"));
  t->offset[t->ncolumns]   = known[k].offset;
  PetscCall(PetscStrncpy(t->name[t->ncolumns++], name, sizeof(t->name[0])));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool has_column(const Table *t, const char name[])
{
  for (PetscInt i = 0; i < t->ncolumns; i++)
    if (!strcmp(t->name[i], name)) return PETSC_TRUE;
  return PETSC_FALSE;
}

static PetscErrorCode parse_header(Table *t, char *line)
{
  const char *const axes[] = {"x", "y", "z"};

  PetscFunctionBeginUser;
  for (char *field, *rest = line; (field = cut_field(&rest));) PetscCall(add_column(t, field));
  for (PetscInt a = 0; a < t->dim; a++)
    PetscCheck(has_column(t, axes[a]), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "%s:%" PetscInt_FMT ": the header line has no column '%s': add it",
               t->file, t->line, axes[a]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode parse_body(const Table *t, char *line, Placement *p)
{
  PetscInt i = 0;

  PetscFunctionBeginUser;
  for (char *field, *rest = line, *end; (field = cut_field(&rest)); i++) {
    double value;

    PetscCheck(i < t->ncolumns, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s:%" PetscInt_FMT ": more values than the %" PetscInt_FMT " columns of the header line", t->file, t->line, t->ncolumns);
    value = strtod(field, &end);
    PetscCheck(end != field && !*end && !PetscIsInfOrNanReal((PetscReal)value), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s:%" PetscInt_FMT ": '%s' in column '%s' is not a finite number", t->file, t->line, field, t->name[i]);
    PetscCheck(value > 0 || !t->positive[i], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "%s:%" PetscInt_FMT ": %s %s must be positive", t->file, t->line,
               t->name[i], field);
    *(PetscReal *)((char *)p + t->offset[i]) = (PetscReal)value;
  }
  PetscCheck(i == t->ncolumns, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s:%" PetscInt_FMT ": %" PetscInt_FMT " values, the header line names %" PetscInt_FMT " columns", t->file, t->line, i, t->ncolumns);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PlaceTable(const char file[], PetscInt dim, const Placement *base, PetscInt *n, Placement **p, PetscBool *sizes, PetscBool *densities)
{
  Table    t = {.file = file, .dim = dim};
  char    *text;
  PetscInt room = 1;

  PetscFunctionBeginUser;
  *n = 0;
  PetscCall(read_text(file, &text));
  for (const char *s = text; *s; s++) room += *s == '\n';
  PetscCall(PetscMalloc1(room, p));
  for (char *next = text; next;) {
    char *line = next, *end = strchr(line, '\n');

    next = end ? end + 1 : NULL;
    if (end) *end = 0;
    t.line++;
    line = trim(line);
    if (!*line || *line == '#') continue;
    if (!t.ncolumns) PetscCall(parse_header(&t, line));
    else {
      (*p)[*n] = *base;
      PetscCall(parse_body(&t, line, &(*p)[(*n)++]));
    }
  }
  PetscCheck(t.ncolumns, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "%s:%" PetscInt_FMT ": the table is empty: its first line names the columns x,y%s",
             file, t.line, dim == 3 ? ",z" : "");
  PetscCheck(!has_column(&t, "size") || !has_column(&t, "radius"), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s: the columns 'size' and 'radius' both give the size of a body: remove one", file);
  *sizes     = (PetscBool)(has_column(&t, "size") || has_column(&t, "radius"));
  *densities = has_column(&t, "density");
  PetscCall(PetscFree(text));
  PetscFunctionReturn(PETSC_SUCCESS);
}
