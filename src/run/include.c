/* Scenes that include another one: see scenefile.h.

   What an including scene says goes over what the included one says, option by option under their flattened names: a
   mapping adds to the mapping below, texts, numbers and lists replace, '~' takes away (the rules of JSON merge patch,
   RFC 7396). The included scene may include one in turn. */
#include "run/scenefile.h"
#include "scenecheck.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#define DEPTH_MAX 8

/* A file and the one that includes it, NULL for none */
typedef struct Link {
  const char        *path;
  const struct Link *parent;
} Link;

typedef struct {
  char *name, *value, *file;
} Entry;

typedef struct {
  Entry *entry;
  size_t n;
} Entries;

static void free_entry(Entry *e)
{
  free(e->name);
  free(e->value);
  free(e->file);
}

static void free_entries(Entries *all)
{
  for (size_t i = 0; i < all->n; i++) free_entry(all->entry + i);
  free(all->entry);
}

/* Is `name` the option `under`, or one of the mapping of that name? */
static int is_under(const char name[], const char under[])
{
  const size_t n = strlen(under);

  return !strncasecmp(name, under, n) && (!name[n] || name[n] == '_');
}

static int take_away(SceneCheck *check, const SceneOption *option, Entries *all)
{
  size_t left = 0;

  for (size_t i = 0; i < all->n; i++) {
    if (is_under(all->entry[i].name, option->name)) free_entry(all->entry + i);
    else all->entry[left++] = all->entry[i];
  }
  if (left == all->n)
    return SceneCheckFault(check, option->line,
                           "'~' takes away what the included scene says under this key, and %s says nothing of -%s",
                           check->include ? check->include : "it", option->name);
  all->n = left;
  return 0;
}

static int put_entry(SceneCheck *check, const SceneOption *option, Entries *all)
{
  Entry *e = NULL;

  for (size_t i = 0; i < all->n && !e; i++)
    if (!strcasecmp(all->entry[i].name, option->name)) e = all->entry + i;
  if (e) free_entry(e);
  else {
    Entry *more = (Entry *)realloc(all->entry, (all->n + 1) * sizeof(*more));

    if (!more) return SceneCheckFault(check, 0, "no memory");
    all->entry = more;
    e          = all->entry + all->n++;
  }
  e->name  = strdup(option->name);
  e->value = strdup(option->value);
  e->file  = strdup(check->path);
  if (!e->name || !e->value || !e->file) return SceneCheckFault(check, 0, "no memory");
  if (all->n > SCENE_OPTIONS_MAX)
    return SceneCheckFault(check, option->line, "more than %d options with those of %s", SCENE_OPTIONS_MAX,
                           check->include);
  return 0;
}

static int read_scene(const Link *link, Entries *all, int *merged, char message[], size_t len);

/* Is the file the scene itself, or one that includes it? */
static const Link *find_file(const Link *link, const struct stat *file)
{
  struct stat info;

  while (link && (stat(link->path, &info) || info.st_dev != file->st_dev || info.st_ino != file->st_ino))
    link = link->parent;
  return link;
}

static int read_included(SceneCheck *check, const Link *link, Entries *all)
{
  const char  *slash = strrchr(check->path, '/');
  const size_t n     = slash && check->include[0] != '/' ? (size_t)(slash - check->path) + 1 : 0;
  const Link  *same;
  Link         next  = {NULL, link};
  char        *path  = (char *)malloc(n + strlen(check->include) + 1);
  int          depth = 0, merged, fault;
  struct stat  info;

  if (!path) return SceneCheckFault(check, 0, "no memory");
  memcpy(path, check->path, n);
  strcpy(path + n, check->include);
  next.path = path;
  for (const Link *l = link; l; l = l->parent) depth++;
  if (SceneFileIsList(path))
    fault = SceneCheckFault(check, check->include_line, "'%s' is a list of options: include a scene", path);
  else if (stat(path, &info))
    fault = SceneCheckFault(check, check->include_line,
                            "there is no scene '%s' to include (paths are relative to the scene that includes)", path);
  else if ((same = find_file(link, &info)))
    fault = SceneCheckFault(check, check->include_line, "'%s' includes itself%s%s: remove one of the includes",
                            same->path, same == link ? "" : " by way of ", same == link ? "" : check->path);
  else if (depth == DEPTH_MAX)
    fault = SceneCheckFault(check, check->include_line, "scenes include each other more than %d deep", DEPTH_MAX);
  else fault = read_scene(&next, all, &merged, check->message, check->len);
  free(path);
  return fault;
}

/* Options of a scene over those of the scene that it includes; *merged: is there one, or something else that PETSc
   cannot read by itself? */
static int read_scene(const Link *link, Entries *all, int *merged, char message[], size_t len)
{
  SceneCheck check = {.path = link->path, .message = message, .len = len};
  int        fault = SceneCheckFile(&check);

  *merged = check.include != NULL || check.nested || check.renamed;
  if (!fault && check.include) fault = read_included(&check, link, all);
  for (size_t i = 0; i < check.n && !fault; i++) {
    const SceneOption *option = check.option + i;

    if (option->value) fault = put_entry(&check, option, all);
    else if (check.include) fault = take_away(&check, option, all);
    else
      fault =
        SceneCheckFault(&check, option->line,
                        "'~' takes away what an included scene says, and this one includes none: give -%s a value, or remove the key",
                        option->name);
  }
  SceneCheckFree(&check);
  return fault;
}

/* "name\0value\0file\0" of all entries */
static char *pack_entries(const Entries *all, size_t *size)
{
  char *text, *at;

  *size = 0;
  for (size_t i = 0; i < all->n; i++)
    *size += strlen(all->entry[i].name) + strlen(all->entry[i].value) + strlen(all->entry[i].file) + 3;
  text = at = (char *)malloc(*size + 1);
  for (size_t i = 0; text && i < all->n; i++) {
    const char *const field[] = {all->entry[i].name, all->entry[i].value, all->entry[i].file};

    for (int k = 0; k < 3; k++) at = stpcpy(at, field[k]) + 1;
  }
  return text;
}

int SceneFileRead(const char path[], char **options, size_t *size, char message[], size_t len)
{
  const Link link   = {path, NULL};
  Entries    all    = {NULL, 0};
  int        merged = 0, fault;

  if (len) message[0] = 0;
  *options = NULL;
  *size    = 0;
  fault    = read_scene(&link, &all, &merged, message, len);
  if (!fault && merged && !(*options = pack_entries(&all, size))) {
    SceneCheck check = {.path = path, .message = message, .len = len};

    fault = SceneCheckFault(&check, 0, "no memory");
  }
  free_entries(&all);
  return fault;
}

int SceneFileCheck(const char path[], char message[], size_t len)
{
  char     *options;
  size_t    size;
  const int fault = SceneFileRead(path, &options, &size, message, len);

  free(options);
  return fault;
}
