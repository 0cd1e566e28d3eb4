/* Options: the tables of all rooms, and the names that a run has read; see opt.h. */
#include "compat.h"
#include "optimpl.h"
#include <stdlib.h>
#include <string.h>

#define MAX_TABLES 16

OptTable opt_table[MAX_TABLES];
size_t   opt_ntable;

static struct {
  PetscInt  n, room;
  OptKnown *known;
} list;

/* ---- tables ---- */

void OptDeclare(const char title[], const OptSpec specs[], size_t n)
{
  if (opt_ntable == MAX_TABLES) abort(); /* before main: nobody to tell */
  opt_table[opt_ntable++] = (OptTable){title, specs, n};
}

static const OptSpec *find_row(const char name[])
{
  const OptSpec *best = NULL;
  size_t         most = 0;

  for (size_t t = 0; t < opt_ntable; t++) {
    for (size_t i = 0; i < opt_table[t].n; i++) {
      const OptSpec *spec = opt_table[t].spec + i;
      const char    *open = strchr(spec->name, '<');
      const size_t   text = strlen(spec->name) + 64 * !open; /* a name without placeholder wins */

      if (text <= most || !OptFits(spec->name, name, NULL, 0)) continue;
      best = spec;
      most = text;
    }
  }
  return best;
}

/* ---- known names ---- */

/* The last of several (of OptDeclareOne) */
static OptKnown *find_known(const char name[])
{
  for (PetscInt i = list.n - 1; i >= 0; i--) {
    if (OptSameName(list.known[i].name, name)) return &list.known[i];
  }
  return NULL;
}

const OptKnown *OptGetKnown(PetscInt *n)
{
  *n = list.n;
  return list.known;
}

const OptKnown *OptFindKnown(const char name[])
{
  return find_known(name);
}

const char *OptGetDefault(const char name[])
{
  const OptSpec *spec = OptFindSpec(name);

  return spec && spec->value ? spec->value : "";
}

const OptSpec *OptFindSpec(const char name[])
{
  const OptKnown *known = find_known(name);

  return known && known->spec ? known->spec : find_row(name);
}

static PetscErrorCode copy_text(const char text[], const char **copy)
{
  PetscFunctionBeginUser;
  *copy = text ? strdup(text) : NULL;
  PetscCheck(*copy || !text, PETSC_COMM_SELF, PETSC_ERR_MEM, "Out of memory for the names of options");
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_known(const char name[], OptKnown **known)
{
  const char *copy;

  PetscFunctionBeginUser;
  if (list.n == list.room) {
    const PetscInt room = PetscMax(64, 2 * list.room);
    void          *more = realloc(list.known, (size_t)room * sizeof(*list.known));

    PetscCheck(more, PETSC_COMM_SELF, PETSC_ERR_MEM, "Out of memory for the names of options");
    list.room  = room;
    list.known = more;
  }
  PetscCall(copy_text(name, &copy));
  *known  = &list.known[list.n++];
  **known = (OptKnown){.name = (char *)(size_t)copy, .spec = find_row(name)};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptMakeKnown(const char name[], OptKnown **known)
{
  PetscFunctionBeginUser;
  *known = find_known(name);
  if (!*known) PetscCall(add_known(name, known));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void free_spec(OptSpec *spec)
{
  const char *const text[] = {spec->unit, spec->value, spec->help, spec->when, spec->choices, spec->also};

  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(text); i++) free((void *)(size_t)text[i]);
  free(spec);
}

PetscErrorCode OptDeclareOne(const OptSpec *spec)
{
  OptKnown *known;

  PetscFunctionBeginUser;
  PetscCall(OptMakeKnown(spec->name, &known));
  if (known->spec && !known->own && !strchr(known->spec->name, '<')) PetscFunctionReturn(PETSC_SUCCESS);
  if (known->own && strchr(spec->name, '<') && strcmp(known->own->when, spec->when))
    PetscCall(add_known(spec->name, &known));
  if (known->own) free_spec(known->own);
  known->spec = known->own = malloc(sizeof(*spec));
  PetscCheck(known->own, PETSC_COMM_SELF, PETSC_ERR_MEM, "Out of memory for option %s", spec->name);
  *known->own      = *spec;
  known->own->name = known->name;
  PetscCall(copy_text(spec->unit, &known->own->unit));
  PetscCall(copy_text(spec->value, &known->own->value));
  PetscCall(copy_text(spec->help, &known->own->help));
  PetscCall(copy_text(spec->when, &known->own->when));
  PetscCall(copy_text(spec->choices, &known->own->choices));
  PetscCall(copy_text(spec->also, &known->own->also));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const OptSpec *OptNextSpec(OptCursor *at)
{
  PetscInt        n;
  const OptKnown *known = OptGetKnown(&n);

  at->title = NULL;
  for (; at->table < opt_ntable; at->table++, at->row = 0) {
    if (at->row < opt_table[at->table].n) {
      at->title = at->row ? NULL : opt_table[at->table].title;
      return opt_table[at->table].spec + at->row++;
    }
  }
  for (; at->known < n; at->known++) {
    if (!known[at->known].own || !strchr(known[at->known].name, '<')) continue;
    at->title = at->row++ ? NULL : "shapes: what the plugins read";
    return known[at->known++].spec;
  }
  return NULL;
}

PetscErrorCode OptFinalize(void)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < list.n; i++) {
    if (list.known[i].is_default) PetscCall(PetscOptionsClearValue(NULL, list.known[i].name));
    if (list.known[i].own) free_spec(list.known[i].own);
    free(list.known[i].name);
  }
  free(list.known);
  list.known = NULL;
  list.n = list.room = 0;
  OptForgetFiles();
  PetscFunctionReturn(PETSC_SUCCESS);
}
