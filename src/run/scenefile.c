/* Scene file: find it among the arguments and check it before PETSc reads it. Includes are in include.c.

   The checks follow PETSc's own reader (src/sys/objects/optionsyaml.c, 3.18 to current): nested keys are joined by '_'
   into one option name, upper case counts as lower case, lists of scalars become "a,b,c", and keys that start with "$$"
   only hold anchors. A key that would lose its value on that way is refused, with its line. Merges ("<<") are refused
   too. It does not interpret values and does not know which options exist. */
#include "run/scenefile.h"
#include "scenecheck.h"
#include <ctype.h>
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <yaml.h>

#define SCENE_NAME_MAX  512 /* PETSc's limit for an option name */
#define SCENE_DEPTH_MAX 20  /* PETSc 3.18 allows 25 nested prefixes */

int SceneCheckFault(SceneCheck *check, size_t line, const char format[], ...)
{
  va_list args;
  int     n;

  if (line) n = snprintf(check->message, check->len, "%s:%zu: ", check->path, line);
  else n = snprintf(check->message, check->len, "%s: ", check->path);
  if (n >= 0 && (size_t)n < check->len) {
    va_start(args, format);
    vsnprintf(check->message + n, check->len - (size_t)n, format, args);
    va_end(args);
  }
  return 1;
}

static size_t find_line(const yaml_node_t *node)
{
  return node->start_mark.line + 1;
}

static const char *get_text(const yaml_node_t *node)
{
  return (const char *)node->data.scalar.value;
}

/* ---- the file ---- */

/* A file that is not there: is it in runs/, or was only the ending forgotten? */
static int report_missing(SceneCheck *check)
{
  const char *slash = strrchr(check->path, '/'), *base = slash ? slash + 1 : check->path;
  char        guess[3][4096];
  struct stat info;

  snprintf(guess[0], sizeof(guess[0]), "%s.yaml", check->path);
  snprintf(guess[1], sizeof(guess[1]), "runs/%s", base);
  snprintf(guess[2], sizeof(guess[2]), "runs/%s.yaml", base);
  for (int i = 0; i < 3; i++) {
    if (!stat(guess[i], &info) && S_ISREG(info.st_mode))
      return SceneCheckFault(check, 0, "no such scene file; did you mean %s?", guess[i]);
  }
  return SceneCheckFault(check, 0, "no such scene file");
}

static int has_ending(const char text[], const char ending[])
{
  const size_t n = strlen(text), m = strlen(ending);

  return n >= m && !strcmp(text + n - m, ending);
}

int SceneFileIsList(const char path[])
{
  return has_ending(path, "options.txt");
}

/* Whole file in *text, also when it fails (free it); *size without the closing zero. */
static int read_file(SceneCheck *check, char **text, size_t *size)
{
  struct stat info;
  FILE       *file;

  *text = NULL;
  if (stat(check->path, &info))
    return errno == ENOENT || errno == ENOTDIR
           ? report_missing(check)
           : SceneCheckFault(check, 0, "cannot read the scene file: %s", strerror(errno));
  if (S_ISDIR(info.st_mode)) return SceneCheckFault(check, 0, "is a directory; wanted is a scene file");
  if (!has_ending(check->path, ".yaml") && !has_ending(check->path, ".yml") && !SceneFileIsList(check->path))
    return SceneCheckFault(check, 0, "a scene file must end in .yaml or .yml (PETSc tells the format by it)");
  file = fopen(check->path, "r");
  if (!file) return SceneCheckFault(check, 0, "cannot read the scene file: %s", strerror(errno));
  *text = (char *)malloc((size_t)info.st_size + 1);
  *size = *text ? fread(*text, 1, (size_t)info.st_size, file) : 0;
  fclose(file);
  if (!*text) return SceneCheckFault(check, 0, "no memory");
  if (*size != (size_t)info.st_size) return SceneCheckFault(check, 0, "cannot read the scene file to its end");
  (*text)[*size] = 0;
  if (strlen(*text) != *size) return SceneCheckFault(check, 0, "holds zero bytes: not a text file (save it as UTF-8)");
  return 0;
}

/* Also on blank lines and before comments, where libyaml takes them in some places and not in others. */
static int check_tabs(SceneCheck *check, const char text[])
{
  size_t line = 1;

  for (const char *s = text; *s; line++) {
    if (memchr(s, '\t', strspn(s, " \t")))
      return SceneCheckFault(check, line, "tab character in the indentation: use blanks");
    s += strcspn(s, "\n");
    if (*s) s++;
  }
  return 0;
}

/* ---- syntax ---- */

static const char *find_hint(const char problem[])
{
  static const struct {
    const char *fragment, *hint;
  } hints[] = {
    {"could not find expected ':'", " (a key needs a colon and a blank after it: 'key: value')"},
    {"mapping values are not",
     " (a colon missing on the line before, two 'key: value' on one line, or a line indented too far?)"},
    {"expected ',' or", " (a bracket not closed, or a comma missing?)"},
    {"did not find expected key", " (indentation that differs from the lines above?)"},
    {"cannot start any token", " (put the value into quotes)"},
    {"found undefined alias", " (write '&name' before '*name' is used)"},
  };

  for (size_t i = 0; i < sizeof(hints) / sizeof(hints[0]); i++) {
    if (strstr(problem, hints[i].fragment)) return hints[i].hint;
  }
  return "";
}

static size_t count_lines(const char text[], size_t offset)
{
  size_t line = 1;

  for (size_t i = 0; i < offset && text[i]; i++) line += text[i] == '\n';
  return line;
}

static int report_syntax(SceneCheck *check, const yaml_parser_t *parser, const char text[])
{
  const char *problem = parser->problem ? parser->problem : "not readable";

  /* libyaml notices a missing colon only where the next line has one; the key itself is where the scan began */
  if (parser->context && !strcmp(parser->context, "while scanning a simple key"))
    return SceneCheckFault(check, parser->context_mark.line + 1, "syntax error: %s%s", problem, find_hint(problem));
  if (parser->error == YAML_READER_ERROR)
    return SceneCheckFault(check, count_lines(text, parser->problem_offset), "%s (save the file as UTF-8 text)",
                           problem);
  if (parser->context && parser->context_mark.line != parser->problem_mark.line)
    return SceneCheckFault(check, parser->problem_mark.line + 1, "syntax error %s that starts at line %zu: %s%s",
                           parser->context, parser->context_mark.line + 1, problem, find_hint(problem));
  return SceneCheckFault(check, parser->problem_mark.line + 1, "syntax error: %s%s", problem, find_hint(problem));
}

/* ---- keys and options ---- */

/* Does a key hold the name of a boundary, which may have blanks in a mesh file (bc_<boundary>, round_<boundary>)? */
static int names_boundary(const char prefix[], const char key[])
{
  return (!strcasecmp(prefix, "flow_") && !strncasecmp(key, "bc_", 3)) || !strcasecmp(prefix, "flow_bc_") ||
         (!strcasecmp(prefix, "mesh_") && !strncasecmp(key, "round_", 6));
}

/* What is no letter, digit or dash becomes '_', as in the names of the mesh's boundaries */
static int rename_boundary(char name[])
{
  int changed = 0;

  for (char *s = name; *s; s++) {
    if (isalnum((unsigned char)*s) || *s == '_' || *s == '-') continue;
    *s      = '_';
    changed = 1;
  }
  return changed;
}

static int check_key(SceneCheck *check, const yaml_node_t *key, const char prefix[])
{
  const char  *text;
  const size_t line = find_line(key);

  if (key->type != YAML_SCALAR_NODE)
    return SceneCheckFault(check, line, "a list or mapping cannot be a key: write 'name: value'");
  text = get_text(key);
  if (!text[0]) return SceneCheckFault(check, line, "empty key: write 'name: value'");
  if (text[0] == '-')
    return SceneCheckFault(check, line,
                           "key '%s' starts with a dash: write '%s' (the dash belongs to the command line)", text,
                           text + strspn(text, "-"));
  if (strchr(text, ':'))
    return SceneCheckFault(check, line, "key '%s' holds a colon: put a blank after the colon ('key: value')", text);
  if (!isalpha((unsigned char)text[0]) && !(prefix[0] && isdigit((unsigned char)text[0])))
    return SceneCheckFault(check, line, "key '%s' must start with a letter", text);
  for (const char *s = text; *s && !names_boundary(prefix, text); s++) {
    if (!isalnum((unsigned char)*s) && *s != '_' && *s != '-')
      return SceneCheckFault(check, line, "key '%s' cannot be an option name: use letters, digits and '_' only", text);
  }
  return 0;
}

/* A mapping must not hold a key twice. */
static int check_duplicates(SceneCheck *check, const yaml_node_t *map)
{
  for (const yaml_node_pair_t *pair = map->data.mapping.pairs.start; pair < map->data.mapping.pairs.top; pair++) {
    const yaml_node_t *key = yaml_document_get_node(check->doc, pair->key);

    for (const yaml_node_pair_t *before = map->data.mapping.pairs.start; before < pair && key->type == YAML_SCALAR_NODE;
         before++) {
      const yaml_node_t *other = yaml_document_get_node(check->doc, before->key);

      if (other->type == YAML_SCALAR_NODE && !strcasecmp(get_text(key), get_text(other)))
        return SceneCheckFault(check, find_line(key), "duplicate key '%s' (first at line %zu): keep one of them",
                               get_text(key), find_line(other));
    }
  }
  return 0;
}

/* Texts of a list after one another, and of the lists in it: "a,b,c" */
static void join_values(const SceneCheck *check, const yaml_node_t *list, char *value)
{
  for (const yaml_node_item_t *item = list->data.sequence.items.start; item < list->data.sequence.items.top; item++) {
    const yaml_node_t *node = yaml_document_get_node(check->doc, *item);

    if (node->type == YAML_SEQUENCE_NODE) {
      join_values(check, node, value);
      continue;
    }
    if (value[0]) strcat(value, ",");
    strcat(value, get_text(node));
  }
}

static size_t measure_values(const SceneCheck *check, const yaml_node_t *list)
{
  size_t size = 1;

  for (const yaml_node_item_t *item = list->data.sequence.items.start; item < list->data.sequence.items.top; item++) {
    const yaml_node_t *node = yaml_document_get_node(check->doc, *item);

    size += node->type == YAML_SEQUENCE_NODE ? measure_values(check, node) : strlen(get_text(node)) + 1;
  }
  return size;
}

/* What PETSc makes of a value: text, or "a,b,c"; NULL: no memory */
static char *copy_value(const SceneCheck *check, const yaml_node_t *node)
{
  char *value;

  if (node->type == YAML_SCALAR_NODE) return strdup(get_text(node));
  value = (char *)calloc(measure_values(check, node), 1);
  if (value) join_values(check, node, value);
  return value;
}

/* '~' and 'null' without quotes take away what an included scene says */
static int is_null(const yaml_node_t *node)
{
  if (node->type != YAML_SCALAR_NODE || node->data.scalar.style != YAML_PLAIN_SCALAR_STYLE) return 0;
  return !strcmp(get_text(node), "~") || !strcmp(get_text(node), "null");
}

static int append_option(SceneCheck *check, const char name[], size_t line, const yaml_node_t *value)
{
  SceneOption *option;

  if (check->n == SCENE_OPTIONS_MAX)
    return SceneCheckFault(check, line,
                           "more than %d options; PETSc's table holds 512 in all: move per-body values into a table file (particle: <group>: table: bodies.csv)",
                           SCENE_OPTIONS_MAX);
  if (check->n == check->capacity) {
    const size_t capacity = check->capacity ? 2 * check->capacity : 64;

    option = (SceneOption *)realloc(check->option, capacity * sizeof(*option));
    if (!option) return SceneCheckFault(check, 0, "no memory");
    check->option   = option;
    check->capacity = capacity;
  }
  option        = check->option + check->n++;
  option->name  = strdup(name);
  option->line  = line;
  option->value = is_null(value) ? NULL : copy_value(check, value);
  return option->name && (option->value || is_null(value)) ? 0 : SceneCheckFault(check, 0, "no memory");
}

static int add_option(SceneCheck *check, const char name[], size_t line, const yaml_node_t *value)
{
  for (size_t i = 0; i < check->n; i++) {
    if (!strcasecmp(check->option[i].name, name))
      return SceneCheckFault(check, line, "option -%s is given twice (first at line %zu): keep one of them", name,
                             check->option[i].line);
  }
  return append_option(check, name, line, value);
}

/* An entry of a list, or of a list of points ([[0, 0], [1, 0]]), which is handed on as one flat list */
static int check_entry(SceneCheck *check, const yaml_node_t *key, const yaml_node_t *node, int nested)
{
  if (node->type == YAML_MAPPING_NODE)
    return SceneCheckFault(check, find_line(node),
                           "'%s' is a list of maps, which PETSc's options cannot hold: give each entry a name (groups: disc, ball) and its settings under that name (disc: {shape: circle})",
                           get_text(key));
  if (node->type == YAML_SEQUENCE_NODE) {
    if (nested)
      return SceneCheckFault(check, find_line(node),
                             "'%s' is a list of lists of lists: write one flat list, or a list of points ([[0, 0], [1, 0]])",
                             get_text(key));
    for (const yaml_node_item_t *item = node->data.sequence.items.start; item < node->data.sequence.items.top; item++)
      if (check_entry(check, key, yaml_document_get_node(check->doc, *item), 1)) return 1;
    check->nested = 1;
    return 0;
  }
  if (!get_text(node)[0])
    return SceneCheckFault(check, find_line(node),
                           "empty entry in the list '%s', which PETSc would skip: give it a value or remove it",
                           get_text(key));
  return 0;
}

static size_t count_items(const yaml_node_t *node)
{
  return node->type == YAML_SEQUENCE_NODE ? (size_t)(node->data.sequence.items.top - node->data.sequence.items.start)
                                          : 1;
}

static int check_list(SceneCheck *check, const char name[], const yaml_node_t *key, const yaml_node_t *list)
{
  const yaml_node_t *first = NULL;

  for (const yaml_node_item_t *item = list->data.sequence.items.start; item < list->data.sequence.items.top; item++) {
    const yaml_node_t *node = yaml_document_get_node(check->doc, *item);

    if (check_entry(check, key, node, 0)) return 1;
    if (!first) first = node;
    if (node->type != first->type || count_items(node) != count_items(first))
      return SceneCheckFault(check, find_line(node),
                             "the entries of '%s' have %zu and %zu values: points have as many as others",
                             get_text(key), count_items(first), count_items(node));
  }
  return add_option(check, name, find_line(key), list);
}

static int check_map(SceneCheck *check, const yaml_node_t *map, const char prefix[], int depth);

/* include: other.yaml */
static int take_include(SceneCheck *check, const yaml_node_t *key, const yaml_node_t *value)
{
  if (value->type != YAML_SCALAR_NODE || !get_text(value)[0] || is_null(value))
    return SceneCheckFault(check, find_line(key),
                           "'include' takes the path of one scene file, relative to this one: include: other.yaml");
  check->include_line = find_line(key);
  check->include      = strdup(get_text(value));
  return check->include ? 0 : SceneCheckFault(check, 0, "no memory");
}

static int check_pair(SceneCheck *check, const yaml_node_t *key, const yaml_node_t *value, const char prefix[],
                      int depth)
{
  char name[SCENE_NAME_MAX];

  if (key->type == YAML_SCALAR_NODE && !strcmp(get_text(key), "<<"))
    return SceneCheckFault(check, find_line(key), "merges ('<<') are not allowed in a scene: write the keys out");
  if (key->type == YAML_SCALAR_NODE && !strncmp(get_text(key), "$$", 2)) {
    if (has_ending((const char *)value->tag, "!include"))
      return SceneCheckFault(check, find_line(key),
                             "!include is not allowed: write 'include: other.yaml' on the top level of the scene");
    return 0;
  }
  if (check_key(check, key, prefix)) return 1;
  if (snprintf(name, sizeof(name), "%s%s", prefix, get_text(key)) >= (int)sizeof(name) - 2)
    return SceneCheckFault(check, find_line(key), "option name is longer than %d characters", SCENE_NAME_MAX - 2);
  if (names_boundary(prefix, get_text(key)) && rename_boundary(name)) check->renamed = 1;
  if (!strcasecmp(name, "include")) return take_include(check, key, value);
  if (value->type == YAML_SCALAR_NODE) return add_option(check, name, find_line(key), value);
  if (value->type == YAML_SEQUENCE_NODE) return check_list(check, name, key, value);
  strcat(name, "_");
  return check_map(check, value, name, depth + 1);
}

static int check_map(SceneCheck *check, const yaml_node_t *map, const char prefix[], int depth)
{
  if (depth > SCENE_DEPTH_MAX)
    return SceneCheckFault(check, find_line(map), "nested deeper than %d levels (an alias inside its own anchor?)",
                           SCENE_DEPTH_MAX);
  if (check_duplicates(check, map)) return 1;
  for (const yaml_node_pair_t *pair = map->data.mapping.pairs.start; pair < map->data.mapping.pairs.top; pair++) {
    if (check_pair(check, yaml_document_get_node(check->doc, pair->key),
                   yaml_document_get_node(check->doc, pair->value), prefix, depth))
      return 1;
  }
  return 0;
}

/* ---- documents ---- */

static int check_document(SceneCheck *check, yaml_document_t *doc)
{
  const yaml_node_t *root = yaml_document_get_root_node(doc);

  check->doc = doc;
  if (!root || (root->type == YAML_SCALAR_NODE && !get_text(root)[0]))
    return SceneCheckFault(check, 0, "the scene file is empty: it holds no options");
  if (root->type != YAML_MAPPING_NODE)
    return SceneCheckFault(check, find_line(root), "a scene is made of 'key: value' lines, not of a %s",
                           root->type == YAML_SEQUENCE_NODE ? "list" : "single value");
  return check_map(check, root, "", 0);
}

/* PETSc would read several documents into one set of options, the last value winning. */
static int check_end(SceneCheck *check, yaml_parser_t *parser, const char text[])
{
  yaml_document_t    doc;
  const yaml_node_t *root;
  int                fault = 0;

  if (!yaml_parser_load(parser, &doc)) return report_syntax(check, parser, text);
  root = yaml_document_get_root_node(&doc);
  if (root)
    fault = SceneCheckFault(check, doc.start_mark.line + 1,
                            "a second document ('---') starts here: a scene is one document");
  yaml_document_delete(&doc);
  return fault;
}

static int check_text(SceneCheck *check, const char text[], size_t size)
{
  yaml_parser_t   parser;
  yaml_document_t doc;
  int             fault;

  if (!yaml_parser_initialize(&parser)) return SceneCheckFault(check, 0, "no memory");
  yaml_parser_set_input_string(&parser, (const unsigned char *)text, size);
  if (!yaml_parser_load(&parser, &doc)) fault = report_syntax(check, &parser, text);
  else {
    fault = check_document(check, &doc);
    yaml_document_delete(&doc);
    if (!fault) fault = check_end(check, &parser, text);
  }
  yaml_parser_delete(&parser);
  return fault;
}

/* ---- public ---- */

/* Place of the scene among the arguments, 0 for none: the first if it is no option, else the first that has the ending
   of a scene and is not a file of options. */
static int find_scene(int argc, char **argv)
{
  if (argc > 1 && argv[1][0] && argv[1][0] != '-') return 1;
  for (int i = 2; i < argc; i++) {
    if (argv[i][0] == '-' || !(has_ending(argv[i], ".yaml") || has_ending(argv[i], ".yml"))) continue;
    if (strncmp(argv[i - 1], "-options_file", 13)) return i;
  }
  return 0;
}

int SceneFileTake(int *argc, char **argv, char path[], size_t len)
{
  const int at = find_scene(*argc, argv);

  if (!at || strlen(argv[at]) >= len) return 1;
  strcpy(path, argv[at]);
  --*argc;
  for (int i = at; i <= *argc; i++) argv[i] = argv[i + 1]; /* with the NULL at the end */
  return 0;
}

/* out/disc/options.txt -> disc-again */
static int name_again(const char path[], const char *base, char stem[], size_t len)
{
  const char *end = base - 1, *begin;

  while (end > path && end[-1] == '/') end--;
  for (begin = end; begin > path && begin[-1] != '/';) begin--;
  if (begin == end || *begin == '.') return 1;
  return snprintf(stem, len, "%.*s-again", (int)(end - begin), begin) >= (int)len;
}

int SceneFileStem(const char path[], char stem[], size_t len)
{
  const char  *slash = strrchr(path, '/'), *base = slash ? slash + 1 : path, *dot = strrchr(base, '.');
  const size_t n = dot && dot > base ? (size_t)(dot - base) : strlen(base);

  if (!len) return 1;
  stem[0] = 0;
  if (!strcmp(base, "options.txt") && base > path && !name_again(path, base, stem, len)) return 0;
  if (!n || n >= len) return 1;
  memcpy(stem, base, n);
  stem[n] = 0;
  return 0;
}

/* A list of options as options.txt is: "-name value" lines and comments */
static int check_list_file(SceneCheck *check, const char text[])
{
  size_t line = 1;
  int    any  = 0;

  for (const char *c = text; *c; line++) {
    const size_t n = strcspn(c, "\n"), blank = strspn(c, " \t\r");

    any |= c[0] == '-';
    if (c[0] != '-' && c[0] != '#' && blank < n)
      return SceneCheckFault(check, line,
                             "options.txt is a list of '-name value' and of comments that begin with '#'; a scene must end in .yaml");
    c += n + (c[n] == '\n');
  }
  return any ? 0 : SceneCheckFault(check, 0, "the list of options is empty");
}

int SceneCheckFile(SceneCheck *check)
{
  const int list = SceneFileIsList(check->path);
  char     *text;
  size_t    size  = 0;
  int       fault = read_file(check, &text, &size);

  if (!fault && list) fault = check_list_file(check, text);
  else if (!fault) fault = check_tabs(check, text);
  if (!fault && !list) fault = check_text(check, text, size);
  free(text);
  return fault;
}

void SceneCheckFree(SceneCheck *check)
{
  for (size_t i = 0; i < check->n; i++) {
    free(check->option[i].name);
    free(check->option[i].value);
  }
  free(check->option);
  free(check->include);
}
