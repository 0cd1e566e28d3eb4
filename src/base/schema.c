/* The tables of options as a JSON schema of scene files (draft 7), by which editors complete and check them.

   A scene nests the words of a name at any '_'. So for every beginning of a name there is a definition: the keys that
   may go on behind it, each with its value or with an object that goes on itself. A beginning that one name alone has
   is a pattern, which is valid but not offered. A placeholder, <group>, is any word. Keys that hide one in their middle
   (bc_left_type) take any value, since patterns that overlap would contradict each other. Groups hold what parts of
   composites hold and the other way round. Ranges are checked of numbers; a text may be an expression. */
#include "compat.h"
#include "optimpl.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* First words of options of PETSc */
#define PETSC_NAMES \
  "ksp|pc|mg|fieldsplit|sub|esteig|snes|mat|matmult|vec|dm|log|malloc|options|use|viewer|info|on_error|fp|memory"

#define GROUP        "particle_<group>"
#define GROUP_SCALAR "particle_<group_scalar>" /* particle: {disc: {heat: {...}}} */
#define MAX_WORDS    10                        /* of a name */

typedef struct {
  const OptSpec *spec;
  char           name[OPT_NAME]; /* without dash, as scenes nest it; that of a part is that of a group */
} Row;

/* Placeholders as scenes nest them */
static const char *const NESTED[][2] = {
  {"<part>_", ""},
  {"<scalar_bc_boundary>", "<scalar>_bc_<boundary>"},
};

/* A beginning of names: "particle_<group>_motion" */
typedef struct {
  char   name[OPT_NAME];
  int    longer;   /* how many names go on behind it */
  int    is_value; /* is it a name itself? */
  size_t row;      /* the first of that name */
} Begin;

typedef struct {
  FILE  *file;
  Row   *row;
  Begin *begin;
  size_t nrow, nbegin, total; /* of total rows */
  int    entries;             /* printed of the present object */
} Schema;

/* ---- text ---- */

static void print_text(FILE *file, const char text[])
{
  for (; *text; text++) {
    if (*text == '"' || *text == '\\') fputc('\\', file);
    fputc(*text, file);
  }
}

/* Begins an entry of an object */
static void print_key(Schema *s, const char before[], const char key[], const char after[])
{
  fprintf(s->file, "%s\n      \"%s%s%s\": ", s->entries++ ? "," : "", before, key, after);
}

/* The name of a definition: a placeholder is (group), since <group> has no place in a reference */
static void print_name(FILE *file, const char before[], const char name[])
{
  fprintf(file, "%s", before);
  for (; *name; name++) fputc(*name == '<' ? '(' : *name == '>' ? ')' : *name, file);
}

static void print_link(FILE *file, const char kind[], const char name[])
{
  print_name(file, "{\"$ref\": \"#/definitions/", kind);
  print_name(file, "", name);
  fprintf(file, "\"}");
}

/* The length of the k-th beginning of a name that ends before a '_' outside of a placeholder; 0: there are fewer */
static size_t find_cut(const char name[], int k)
{
  int inside = 0;

  for (const char *c = name; *c; c++) {
    inside += (*c == '<') - (*c == '>');
    if (*c == '_' && !inside && !k--) return (size_t)(c - name);
  }
  return 0;
}

/* What follows a beginning ("": none) in a longer one, else NULL */
static const char *get_tail(const char name[], const char begin[])
{
  const size_t len = strlen(begin);

  if (!len) return name;
  return !strncmp(name, begin, len) && name[len] == '_' ? name + len + 1 : NULL;
}

/* "bc_<boundary>_type" as the pattern bc_.+_type */
static void print_pattern(FILE *file, const char text[])
{
  int inside = 0;

  for (; *text; text++) {
    if (*text == '<') fprintf(file, ".+");
    inside += *text == '<';
    if (!inside) fputc(*text, file);
    inside -= *text == '>';
  }
}

static int is_placeholder(const char text[])
{
  return text[0] == '<' && !strchr(text, '>')[1];
}

/* ---- values ---- */

static void print_number(FILE *file, const OptSpec *spec, const char type[])
{
  char range[OPT_LINE];

  OptFormatRange(spec, range, sizeof(range));
  fprintf(file, "{\"type\": \"%s\"", type);
  if (range[0] && spec->lower == OPT_POSITIVE) fprintf(file, ", \"exclusiveMinimum\": 0");
  else if (range[0] && isfinite(spec->lower) && spec->lower > -(double)PETSC_MAX_INT)
    fprintf(file, ", \"minimum\": %.10g", spec->lower);
  if (range[0] && isfinite(spec->upper) && spec->upper < (double)PETSC_MAX_INT)
    fprintf(file, ", \"maximum\": %.10g", spec->upper);
  fprintf(file, "}");
}

/* Words of a list; what YAML takes for true and false ("off") as such, too */
static void print_words(FILE *file, const char list[])
{
  const char *cursor = list;
  char        word[OPT_LINE];
  int         n = 0, truth = 0;

  fprintf(file, "{\"enum\": [");
  while (OptNextItem(&cursor, word, sizeof(word))) {
    fprintf(file, "%s\"%s\"", n++ ? ", " : "", word);
    truth |= OptSameName(word, "on") || OptSameName(word, "yes") || OptSameName(word, "true") ? 1 : 0;
    truth |= OptSameName(word, "off") || OptSameName(word, "no") || OptSameName(word, "false") ? 2 : 0;
  }
  fprintf(file, "%s%s]}", truth & 1 ? ", true" : "", truth & 2 ? ", false" : "");
}

static void print_type(FILE *file, const OptSpec *spec)
{
  const char *number = spec->type == OPT_INT || spec->type == OPT_INTS ? "integer" : "number";

  switch (spec->type) {
  case OPT_REAL:
  case OPT_INT:
    print_number(file, spec, number);
    fprintf(file, ", {\"type\": \"string\"%s}", spec->variables ? "" : ", \"pattern\": \"[0-9]|pi\"");
    break;
  case OPT_BOOL:
    fprintf(file, "{\"type\": \"boolean\"}, {\"enum\": [\"yes\", \"no\", \"on\", \"off\", \"true\", \"false\", 0, 1]}");
    break;
  case OPT_CHOICE: print_words(file, spec->choices); break;
  case OPT_STRING: /* parts: [hub, arm] */
    fprintf(file, "{\"type\": [\"string\", \"number\", \"boolean\"%s]}", spec->path ? "" : ", \"array\"");
    break;
  case OPT_REALS:
  case OPT_INTS:
    print_number(file, spec, number);
    fprintf(file, ", {\"type\": \"string\"}, {\"type\": \"array\", \"items\": {\"anyOf\": [");
    print_number(file, spec, number);
    fprintf(file,
            ", {\"type\": \"string\"}, {\"type\": \"array\", \"items\": {\"type\": [\"number\", \"string\"]}}]}}");
    break;
  case OPT_STRINGS:
    fprintf(file,
            "{\"type\": [\"string\", \"number\", \"boolean\"]}, {\"type\": \"array\", \"items\": {\"type\": [\"string\", \"number\", \"boolean\"]}}");
    break;
  }
}

/* A value as the rows of its name have it, which are several where shapes share it; null takes away what an included
   scene says. */
static void print_value(Schema *s, size_t first)
{
  const OptSpec *spec = s->row[first].spec;
  char           meaning[OPT_LINE];

  OptFormatMeaning(spec, meaning, sizeof(meaning));
  fprintf(s->file, "{\"description\": \"");
  print_text(s->file, meaning);
  if (spec->when) fprintf(s->file, "; with ");
  if (spec->when) print_text(s->file, spec->when);
  if (spec->value && spec->value[0]) fprintf(s->file, ". Default: ");
  if (spec->value && spec->value[0]) print_text(s->file, spec->value);
  fprintf(s->file, "\", \"anyOf\": [");
  for (size_t i = first; i < s->nrow; i++) {
    if (strcmp(s->row[i].name, s->row[first].name)) continue;
    print_type(s->file, s->row[i].spec);
    fprintf(s->file, ", ");
  }
  fprintf(s->file, "{\"type\": \"null\"}]}");
}

/* ---- objects ---- */

static void print_reference(Schema *s, const Begin *b)
{
  if (b->is_value && b->longer) fprintf(s->file, "{\"anyOf\": [");
  if (b->is_value) print_link(s->file, "value:", b->name);
  if (b->is_value && b->longer) fprintf(s->file, ", ");
  if (b->longer) print_link(s->file, "", b->name);
  if (b->is_value && b->longer) fprintf(s->file, "]}");
}

/* Keys without placeholder: offered if they are names or begin several, else as patterns */
static void print_keys(Schema *s, const char begin[], int offered)
{
  for (size_t i = 0; i < s->nbegin; i++) {
    const Begin *b    = s->begin + i;
    const char  *tail = get_tail(b->name, begin);

    if (!tail || strchr(tail, '<') || offered != (b->is_value || b->longer > 1)) continue;
    print_key(s, offered ? "" : "^", tail, offered ? "" : "$");
    print_reference(s, b);
  }
}

/* Is the key of this beginning an object, whatever follows its placeholder? Not if that may be nested further. */
static int is_flat(const Schema *s, const Begin *b)
{
  if (!strcmp(b->name, GROUP_SCALAR)) return 0; /* longer than a word */
  if (!b->longer || b->is_value || b->name[strlen(b->name) - 1] != '>') return 0;
  for (size_t i = 0; i < s->nbegin; i++) {
    if (s->begin[i].longer && get_tail(s->begin[i].name, b->name)) return 0;
  }
  return 1;
}

/* Keys with a placeholder and other words: objects where they can be nothing else (bc_left: {}), else any value */
static void print_hidden(Schema *s, const char begin[])
{
  int n = 0;

  for (size_t i = 0; i < s->nbegin; i++) {
    const char *tail = get_tail(s->begin[i].name, begin);

    if (!tail || !strchr(tail, '<') || is_placeholder(tail) || is_flat(s, s->begin + i)) continue;
    fprintf(s->file, n++ ? "|" : "%s\n      \"^(", s->entries++ ? "," : "");
    print_pattern(s->file, tail);
  }
  if (n) fprintf(s->file, ")$\": {}");
  for (size_t i = 0; i < s->nbegin; i++) {
    const char *tail = get_tail(s->begin[i].name, begin);

    if (!tail || is_placeholder(tail) || !is_flat(s, s->begin + i)) continue;
    fprintf(s->file, "%s\n      \"^", s->entries++ ? "," : "");
    print_pattern(s->file, tail);
    fprintf(s->file, "$\": {\"anyOf\": [{\"type\": [\"string\", \"number\", \"boolean\", \"array\"]}, ");
    print_link(s->file, "", s->begin[i].name);
    fprintf(s->file, "]}");
  }
}

/* Whatever else: what a placeholder stands for; the parts of a group are as a group, and its scalars have
   members of their own */
static void print_others(Schema *s, const char begin[])
{
  const size_t len = strlen(begin);

  fprintf(s->file, ",\n    \"additionalProperties\": ");
  for (size_t i = 0; i < s->nbegin; i++) {
    const char *tail = get_tail(s->begin[i].name, begin);

    if (!tail || !is_placeholder(tail)) continue;
    print_reference(s, s->begin + i);
    return;
  }
  if (len && !strcmp(begin, GROUP)) {
    fprintf(s->file, "{\"anyOf\": [");
    print_link(s->file, "", GROUP);
    fprintf(s->file, ", ");
    print_link(s->file, "", GROUP_SCALAR);
    fprintf(s->file, "]}");
  } else fprintf(s->file, "false");
}

/* The members of what may follow a beginning; extra: a further pattern, or NULL */
static void print_object(Schema *s, const char begin[], const char extra[])
{
  s->entries = 0;
  fprintf(s->file, "\"type\": [\"object\", \"null\"],\n    \"properties\": {");
  if (!begin[0]) print_key(s, "", "include", "");
  if (!begin[0])
    fprintf(s->file, "{\"description\": \"another scene file, over which this one goes\", \"type\": \"string\"}");
  print_keys(s, begin, 1);
  fprintf(s->file, "},\n    \"patternProperties\": {");
  s->entries = 0;
  print_keys(s, begin, 0);
  print_hidden(s, begin);
  if (extra) print_key(s, "^(", extra, ")$");
  if (extra) fprintf(s->file, "{}");
  fprintf(s->file, "}");
  print_others(s, begin);
}

/* ---- the schema ---- */

static void add_begin(Schema *s, size_t row, size_t len)
{
  const char *name     = s->row[row].name;
  const int   is_value = !name[len];
  size_t      i        = 0;

  while (i < s->nbegin && (strlen(s->begin[i].name) != len || strncmp(s->begin[i].name, name, len))) i++;
  if (i == s->nbegin && i == MAX_WORDS * s->total) abort(); /* a name of more words: raise MAX_WORDS */
  if (i == s->nbegin) snprintf(s->begin[s->nbegin++].name, OPT_NAME, "%.*s", (int)len, name);
  if (is_value && !s->begin[i].is_value) s->begin[i].row = row;
  s->begin[i].is_value |= is_value;
  s->begin[i].longer += !is_value;
}

static void add_row(Schema *s, const OptSpec *spec)
{
  Row        *r    = s->row + s->nrow++;
  const char *name = spec->name + 1;
  size_t      len;

  r->spec = spec;
  snprintf(r->name, sizeof(r->name), "%s", name);
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(NESTED); i++) {
    const char *match = strstr(name, NESTED[i][0]);

    if (match)
      snprintf(r->name, sizeof(r->name), "%.*s%s%s", (int)(match - name), name, NESTED[i][1],
               match + strlen(NESTED[i][0]));
  }
  for (int k = 0; (len = find_cut(r->name, k)) > 0; k++) add_begin(s, s->nrow - 1, len);
  add_begin(s, s->nrow - 1, strlen(r->name));
}

void OptPrintSchema(FILE *file)
{
  const OptSpec *spec;
  OptCursor      at     = {0};
  Schema         schema = {.file = file}, *s = &schema;
  size_t         n = 0;

  while (OptNextSpec(&at)) n++;
  s->total = n;
  s->row   = calloc(n, sizeof(*s->row));
  s->begin = calloc(MAX_WORDS * n, sizeof(*s->begin));
  at       = (OptCursor){0};
  while (s->row && s->begin && (spec = OptNextSpec(&at))) add_row(s, spec);
  fprintf(file, "{\n  \"$schema\": \"http://json-schema.org/draft-07/schema#\",\n");
  fprintf(file, "  \"title\": \"scene of tumble\",\n  ");
  fprintf(file, "\"description\": "
                "\"Made by 'make options' from the tables in src/<room>/options.c: tumble -help schema\",\n    ");
  print_object(s, "", "\\\\$\\\\$.*|(" PETSC_NAMES ")(_.*)?");
  fprintf(file, ",\n  \"definitions\": {\n");
  for (size_t i = 0; i < s->nbegin; i++) {
    const Begin *b = s->begin + i;

    if (i) fprintf(file, ",\n");
    if (b->longer) print_name(file, "    \"", b->name);
    if (b->longer) fprintf(file, "\": {");
    if (b->longer) print_object(s, b->name, strcmp(b->name, "flow") ? NULL : "(" PETSC_NAMES ")(_.*)?");
    if (b->longer) fprintf(file, "}%s", b->is_value ? ",\n" : "");
    if (b->is_value) print_name(file, "    \"value:", b->name);
    if (b->is_value) fprintf(file, "\": ");
    if (b->is_value) print_value(s, b->row);
  }
  fprintf(file, "\n  }\n}\n");
  free(s->row);
  free(s->begin);
}
