/* Options: the tables of all rooms, and the names that a run has read; see opt.h. */
#include "compat.h"
#include "optimpl.h"
#include <stdlib.h>
#include <string.h>

#define MAX_TABLES 16

OptTable opt_table[MAX_TABLES];
size_t   opt_ntable;

static struct {
  PetscInt  n, capacity;
  OptEntry *entry;
} list;

/* ---- tables ---- */

void OptDeclare(const char title[], const OptSpec specs[], size_t n)
{
  if (opt_ntable == MAX_TABLES) abort(); /* before main: nobody to tell */
  opt_table[opt_ntable++] = (OptTable){title, specs, n};
}

static const OptSpec *find_row(const char name[])
{
  const OptSpec *best    = NULL;
  size_t         longest = 0;

  for (size_t t = 0; t < opt_ntable; t++) {
    for (size_t i = 0; i < opt_table[t].n; i++) {
      const OptSpec *spec = opt_table[t].spec + i;
      const char    *open = strchr(spec->name, '<');
      const size_t   text = strlen(spec->name) + 64 * !open; /* a name without placeholder wins */

      if (text <= longest || !OptFits(spec->name, name, NULL, 0)) continue;
      best    = spec;
      longest = text;
    }
  }
  return best;
}

/* ---- known names ---- */

/* The last of several (of OptDeclareOne) */
static OptEntry *find_entry(const char name[])
{
  for (PetscInt i = list.n - 1; i >= 0; i--) {
    if (OptSameName(list.entry[i].name, name)) return &list.entry[i];
  }
  return NULL;
}

const OptEntry *OptGetEntries(PetscInt *n)
{
  *n = list.n;
  return list.entry;
}

const OptEntry *OptFindEntry(const char name[])
{
  return find_entry(name);
}

const char *OptGetDefault(const char name[])
{
  const OptSpec *spec = OptFindSpec(name);

  return spec && spec->value ? spec->value : "";
}

const OptSpec *OptFindSpec(const char name[])
{
  const OptEntry *entry = find_entry(name);

  return entry && entry->spec ? entry->spec : find_row(name);
}

static PetscErrorCode copy_text(const char text[], const char **copy)
{
  PetscFunctionBeginUser;
  *copy = text ? strdup(text) : NULL;
  PetscCheck(*copy || !text, PETSC_COMM_SELF, PETSC_ERR_MEM, "Out of memory for the names of options");
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_entry(const char name[], OptEntry **entry)
{
  const char *copy;

  PetscFunctionBeginUser;
  if (list.n == list.capacity) {
    const PetscInt capacity = PetscMax(64, 2 * list.capacity);
    void          *more     = realloc(list.entry, (size_t)capacity * sizeof(*list.entry));

    PetscCheck(more, PETSC_COMM_SELF, PETSC_ERR_MEM, "Out of memory for the names of options");
    list.capacity = capacity;
    list.entry    = more;
  }
  PetscCall(copy_text(name, &copy));
  *entry  = &list.entry[list.n++];
  **entry = (OptEntry){.name = (char *)(size_t)copy, .spec = find_row(name)};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptMakeEntry(const char name[], OptEntry **entry)
{
  PetscFunctionBeginUser;
  *entry = find_entry(name);
  if (!*entry) PetscCall(add_entry(name, entry));
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
  OptEntry *entry;

  PetscFunctionBeginUser;
  PetscCall(OptMakeEntry(spec->name, &entry));
  if (entry->spec && !entry->own && !strchr(entry->spec->name, '<')) PetscFunctionReturn(PETSC_SUCCESS);
  if (entry->own && strchr(spec->name, '<') && strcmp(entry->own->when, spec->when))
    PetscCall(add_entry(spec->name, &entry));
  if (entry->own) free_spec(entry->own);
  entry->spec = entry->own = malloc(sizeof(*spec));
  PetscCheck(entry->own, PETSC_COMM_SELF, PETSC_ERR_MEM, "Out of memory for option %s", spec->name);
  *entry->own      = *spec;
  entry->own->name = entry->name;
  PetscCall(copy_text(spec->unit, &entry->own->unit));
  PetscCall(copy_text(spec->value, &entry->own->value));
  PetscCall(copy_text(spec->help, &entry->own->help));
  PetscCall(copy_text(spec->when, &entry->own->when));
  PetscCall(copy_text(spec->choices, &entry->own->choices));
  PetscCall(copy_text(spec->also, &entry->own->also));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const OptSpec *OptNextSpec(OptCursor *at)
{
  PetscInt        n;
  const OptEntry *entry = OptGetEntries(&n);

  at->title = NULL;
  for (; at->table < opt_ntable; at->table++, at->row = 0) {
    if (at->row < opt_table[at->table].n) {
      at->title = at->row ? NULL : opt_table[at->table].title;
      return opt_table[at->table].spec + at->row++;
    }
  }
  for (; at->entry < n; at->entry++) {
    if (!entry[at->entry].own || !strchr(entry[at->entry].name, '<')) continue;
    at->title = at->row++ ? NULL : "shapes: what the plugins read";
    return entry[at->entry++].spec;
  }
  return NULL;
}

PetscErrorCode OptFinalize(void)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < list.n; i++) {
    if (list.entry[i].is_default) PetscCall(PetscOptionsClearValue(NULL, list.entry[i].name));
    if (list.entry[i].own) free_spec(list.entry[i].own);
    free(list.entry[i].name);
  }
  free(list.entry);
  list.entry = NULL;
  list.n = list.capacity = 0;
  OptForgetFiles();
  PetscFunctionReturn(PETSC_SUCCESS);
}
